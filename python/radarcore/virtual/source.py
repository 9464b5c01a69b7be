"""Samples of an emulated sensor from a simulated scene."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.radar.bgt60_receiver import HIGHPASS_CUTOFFS, measured_receiver
from radarcore.radar.presets import bgt60tr13c
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.recording.codes import FULL_SCALE_VOLT, to_codes
from radarcore.sensor.emulator.source import MIDDLE, codes_of
from radarcore.simulate.simulator import Simulator
from radarcore.units import power_from_db

_IMPEDANCE = 50.0
"""Impedance of the receiver's input [ohm]."""

_CONVERSION_GAIN_DB = 14.0
"""Gain from the receiver's input to the voltage before the baseband [dB], typical value of the data sheet."""


_SAME_PLACE = 1e-4
"""Distance within which a receiver is taken for one of the chip's [m]."""


class Simulated:
    """Frames of a simulated scene through the gains of the data sheet; the next frame is simulated ahead.

    The echo's power at the receiver's input goes through 50 ohm, the conversion gain of the mixer (14 dB), the gain
    behind it and an ADC of 12 bits that spans 1.21 V to either side. Filters, leakage and the offsets of a real
    receiver are left out, unless the simulator's radar has the chip's receiver as measured
    (``bgt60tr13c(receiver="measured")``): that is then the sensor's, at the gain that its registers have, without the
    effects that are None in the simulator's.

    Parameters
    ----------
    simulator : Simulator
        Scene and settings; the radar is what the sensor is set to.
    start : float
        Time of the scene when the sensor starts to measure [s].
    """

    def __init__(self, simulator: Simulator, *, start: float = 0.0) -> None:
        self.start = check.number("start", start, "s")
        self._simulator = simulator
        receiver = simulator.radar.receiver
        self._chain = receiver if receiver is not None and receiver.has_codes else None
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="radarcore-simulate")
        self._ahead: tuple[Radar, int, Future[NDArray[np.float64]]] | None = None

    def frame(self, radar: Radar, index: int, time: float, *, if_gain_db: float = 23.0) -> NDArray[np.uint16]:
        """The frame that starts `time` after `start`."""
        places: list[int] = []
        if self._chain is not None and (places := _places(radar)):
            chain = measured_receiver(
                round(if_gain_db), self._chain.high_pass or HIGHPASS_CUTOFFS[-1], bandwidth=radar.waveform.bandwidth
            )
            radar = _with_receiver(radar, _switched(chain, self._chain).of_receivers(places))
        ahead, self._ahead = self._ahead, None
        if ahead is not None and ahead[:2] == (radar, index):
            samples = ahead[2].result()
        else:
            samples = self._pool.submit(self._samples, radar, time).result()
        following = self._pool.submit(self._samples, radar, time + radar.waveform.frame_interval)
        self._ahead = (radar, index + 1, following)
        if places:
            return to_codes(samples)
        gain = np.sqrt(power_from_db(_CONVERSION_GAIN_DB + if_gain_db))
        # Samples are the real part of an amplitude whose square is the power; a tone has half its peak's square.
        volt = gain * np.sqrt(2.0 * _IMPEDANCE) * samples
        return codes_of(volt * (MIDDLE / FULL_SCALE_VOLT))

    def _samples(self, radar: Radar, time: float) -> NDArray[np.float64]:
        """Real samples [sqrt(W)], or parts of full scale of the measured receiver."""
        if self._simulator.radar != radar:
            self._simulator = self._simulator.with_radar(radar)
        samples: NDArray[np.float64] = self._simulator.frame(self.start + time).cube
        return samples


def _switched(chain: Receiver, own: Receiver) -> Receiver:
    """The chain without the effects that another receiver has switched off, and with its widths of codes."""
    names = [field.name for field in fields(own) if field.name != "gain_db"]  # that of the registers
    off = {name: None for name in names if getattr(own, name) is None}
    return replace(chain, **{"adc_odd_width": own.adc_odd_width} | off)  # type: ignore[arg-type]  # None is legal there


def _places(radar: Radar) -> list[int]:
    """Numbers of the chip's receivers that a radar has; none for one with other receivers."""
    distance = np.linalg.norm(radar.rx[:, None] - bgt60tr13c().rx, axis=-1)
    places: list[int] = distance.argmin(axis=1).tolist()
    return places if distance.min(axis=1).max() < _SAME_PLACE else []


def _with_receiver(radar: Radar, receiver: Receiver) -> Radar:
    return Radar(
        radar.waveform,
        tx=radar.tx,
        rx=radar.rx,
        pattern=radar.pattern,
        tx_power_dbm=radar.tx_power_dbm,
        receiver=receiver,
    )
