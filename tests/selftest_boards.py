"""Emulated boards whose receivers are like measured ones, for the self-test: with noise, leakage, a transmitter."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.radar.radar import Radar
from radarcore.sensor.bgt60.registers import CSU1_0
from radarcore.sensor.emulator.chip import Chip
from radarcore.sensor.emulator.source import MIDDLE
from radarcore.sensor.emulator.strata import Controller

NOISE = {23.0: 1.1, 50.0: 5.5, 55.0: 9.8}
"""Noise from chirp to chirp [codes] by IF gain [dB], as measured on boards."""
LEAKAGE = (1240.0, 650.0, 360.0)
"""Leakage of the wide sweep at 23 dB, peak to peak [codes] by receiver."""


class Receivers:
    """Source of noise that follows the gain, and of leakage where the transmitter is on; `chip` is whose it is.

    Parameters
    ----------
    dead : int, optional
        Receiver without noise and leakage.
    leaks : bool
        False: the transmitter changes nothing.
    tx_factor : float
        Factor of the noise with the transmitter on.
    """

    chip: Chip | None = None

    def __init__(self, *, dead: int | None = None, leaks: bool = True, tx_factor: float = 1.0) -> None:
        self.dead, self.leaks, self.tx_factor = dead, leaks, tx_factor

    def frame(self, radar: Radar, index: int, time: float, *, if_gain_db: float = 23.0, **_: Any) -> NDArray[np.uint16]:
        wf = radar.waveform
        shape = (radar.num_channels, wf.num_chirps, wf.num_samples)
        is_on = self.chip is None or bool(self.chip.registers[CSU1_0] & 1)
        noise = NOISE.get(float(if_gain_db), 1.1) * (self.tx_factor if is_on else 1.0)
        codes = MIDDLE + np.random.default_rng(index).normal(0.0, noise, shape)
        if is_on and self.leaks:
            # A quarter of a cycle over the wide sweep, the transient of turning on alone in narrow ones.
            samples = np.arange(wf.num_samples)
            ramp = np.cos(0.5 * np.pi * samples / wf.num_samples) if wf.bandwidth > 1e9 else np.exp(-samples / 2.5)
            codes += np.resize(LEAKAGE, len(codes))[:, None, None] * ramp
        if self.dead is not None and self.dead < len(codes):
            codes[self.dead] = MIDDLE
        return np.clip(np.rint(codes), 0, 4095).astype(np.uint16)


def noise_codes(shape: tuple[int, ...], index: int) -> NDArray[np.uint16]:
    """Codes of a frame without echoes, for a `ComLibDouble`."""
    return np.random.default_rng(index).normal(MIDDLE, 1.1, shape).astype(np.uint16)


def controller(receivers: Receivers | None = None, **options: Any) -> Controller:
    """Board with a BGT60TR13C; as fast as the host reads, where no `speed` is given."""
    source = Receivers() if receivers is None else receivers
    board = Controller(source, **({"speed": None} | options))
    source.chip = board.chip
    return board
