"""Samples of an emulated sensor from a simulated scene."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import suppress
from dataclasses import asdict, fields, replace
from functools import lru_cache, partial
from importlib import import_module
from queue import Empty, SimpleQueue
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.radar.bgt60_receiver import HIGHPASS_CUTOFFS, measured_receiver
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver, is_plain
from radarcore.receive.chain import receive
from radarcore.receive.filters import phase_noise_delays
from radarcore.recording.frame import FULL_SCALE_VOLT, to_codes
from radarcore.sensor.emulator.source import MIDDLE, NO_POWER_DBM, codes_of
from radarcore.simulate.simulator import Simulator
from radarcore.units import power_from_db

Result = TypeVar("Result")

_Job = tuple["Future[Result]", Callable[[], Result]]

RECEIVERS = ("measured", "ideal")

_IMPEDANCE = 50.0
"""Impedance of the receiver's input [ohm]."""

_CONVERSION_GAIN_DB = 14.0
"""Gain from the receiver's input to the voltage before the baseband [dB], typical value of the data sheet."""

_SAME_PLACE = 1e-4
"""Distance within which a receiver is taken for one of the chip's [m]."""

_NUM_AHEAD = 2
"""Frames that are simulated ahead: a frame that takes longer than others is then not late."""

_MOST_RADARS = 16
"""Radars whose simulators are kept: a frame of the chip has up to eight kinds of ramps."""

_OF_THE_ADC = ("gain_db", "full_scale", "adc_bits", "output", "noise_figure_db")
"""Settings of the chain that a receiver without codes cannot switch off."""


class Simulated:
    """Frames of a simulated scene, as the receivers and the ADC of the chip make codes of them.

    The chain is the measured chip (``bgt60tr13c(receiver="measured")``), with leakage, offsets, filters and noise, at
    the gain and the high-pass that the registers have. Phase noise is omitted: it would double the time, and at the
    ranges of the chip it is far below the other noise. A simulator's radar with a receiver of its own keeps that:
    effects that are None there are left out, and phase noise counts.

    Ideal is a chain of the data sheet's figures alone: the echo's power at the receiver's input, with thermal noise,
    goes through 50 ohm, the conversion gain of the mixer (14 dB), the gain behind it and an ADC of 12 bits that spans
    1.21 V to either side. So it is for radars whose receivers are at other places than the chip's.

    Echoes and leakage have the power that the registers set; there are none with the transmitter off, and none of a
    constant wave, whose echoes of 0 Hz the high-pass leaves out. The next frames are simulated ahead.

    Parameters
    ----------
    simulator : Simulator
        Scene and settings; the radar is what the sensor is set to.
    start : float
        Time of the scene when the sensor starts to measure [s].
    receiver : "measured" or "ideal"
    """

    def __init__(self, simulator: Simulator, *, start: float = 0.0, receiver: str = "measured") -> None:
        self.start: float = check.number("start", start, "s")
        check.choice("receiver", receiver, RECEIVERS)
        import_module("scipy.fft")  # for noise and filters; loading it within the first frame could exceed a timeout
        self._simulator = simulator
        own = simulator.radar.receiver
        own = None if own is None or is_plain(own) else own
        self._simulator_of = lru_cache(_MOST_RADARS)(simulator.with_radar)
        self._with_receiver = lru_cache(_MOST_RADARS)(partial(_with_receiver, own, receiver == "ideal" and own is None))
        self._worker: Worker[NDArray[np.float64]] = Worker("radarcore-simulate")
        self._ahead: dict[tuple[Radar, int], tuple[float, Future[NDArray[np.float64]]]] = {}

    def frame(self, radar: Radar, index: int, time: float, *, if_gain_db: float = 23.0) -> NDArray[np.uint16]:
        """The frame that starts `time` after `start`."""
        radar, has_codes = self._with_receiver(radar, if_gain_db)
        samples = self._taken(radar, index, time)
        for k in range(1, _NUM_AHEAD + 1):
            self._begin(radar, index + k, time + k * radar.waveform.frame_interval)
        if has_codes:
            return to_codes(samples)
        gain = np.sqrt(power_from_db(_CONVERSION_GAIN_DB + if_gain_db))
        # Samples are the real part of an amplitude whose square is the power; a tone has half its peak's square.
        volt = gain * np.sqrt(2.0 * _IMPEDANCE) * samples
        return codes_of(volt * (MIDDLE / FULL_SCALE_VOLT))

    def close(self) -> None:
        """End simulating; waiting readers get a RuntimeError at once. May be called twice."""
        self._worker.close()

    def _taken(self, radar: Radar, index: int, time: float) -> NDArray[np.float64]:
        """Samples of a frame, simulated ahead or now; frames ahead of others are forgotten."""
        begin = self._ahead.pop((radar, index), None)
        for key in [key for key in self._ahead if not 0 <= key[1] - index <= _NUM_AHEAD]:
            self._ahead.pop(key)[1].cancel()
        if begin is not None and abs(begin[0] - time) < 0.5 * radar.waveform.sample_times[-1]:
            return self._worker.result(begin[1])
        return self._worker.result(self._worker.begin(partial(self._samples, radar, time)))

    def _begin(self, radar: Radar, index: int, time: float) -> None:
        if (radar, index) not in self._ahead:
            self._ahead[radar, index] = time, self._worker.begin(partial(self._samples, radar, time))

    def _samples(self, radar: Radar, time: float) -> NDArray[np.float64]:
        """Real samples [sqrt(W)], or parts of full scale of the measured receiver."""
        start = self.start + time
        if radar.waveform.is_cw or radar.tx_power_dbm <= NO_POWER_DBM:
            return receive(_nothing(radar), radar, start, seed=getattr(self._simulator, "seed", 0))
        samples: NDArray[np.float64] = self._simulator_of(radar).frame(start).cube
        return samples


def _with_receiver(own: Receiver | None, is_ideal: bool, radar: Radar, if_gain_db: float) -> tuple[Radar, bool]:
    """The radar with the chain of its receivers, and True where that gives codes; `own` is the chain of a scene."""
    receiver = radar.receiver or Receiver(output="real")
    places = [] if is_ideal else _places(radar)
    if not places:
        return replace(radar, receiver=replace(receiver, high_pass=None)), False
    cutoff = receiver.high_pass or (None if own is None else own.high_pass) or HIGHPASS_CUTOFFS[-1]
    chain = measured_receiver(round(if_gain_db), cutoff, bandwidth=radar.waveform.bandwidth)
    chain = replace(chain, phase_noise=None) if own is None else _switched(chain, own)
    if radar.waveform.is_cw:
        chain = replace(chain, high_pass=None)
    return replace(radar, receiver=chain.of_receivers(places)), True


def _nothing(radar: Radar) -> NDArray[np.complex64]:
    """Beat signal without an echo, and its parts with phase noise, as `receive` takes them over."""
    parts = 1 if radar.receiver is None else 1 + len(phase_noise_delays(radar.receiver, radar.waveform))
    return np.zeros((parts * radar.num_channels, radar.waveform.num_chirps, radar.waveform.num_samples), np.complex64)


def _switched(chain: Receiver, own: Receiver) -> Receiver:
    """The chain without the effects that another receiver has switched off, and with its widths of codes."""
    kept = ("gain_db",) if own.has_codes else _OF_THE_ADC  # the registers set the gain
    names = [field.name for field in fields(own) if field.name not in kept]
    off: dict[str, Any] = {name: None for name in names if getattr(own, name) is None}
    if own.adc_errors is not None and chain.adc_errors is not None:
        none: dict[str, Any] = {name: None for name, error in asdict(own.adc_errors).items() if error is None}
        off["adc_errors"] = replace(chain.adc_errors, **none | {"odd_width": own.adc_errors.odd_width})
    return replace(chain, **off)


def _places(radar: Radar) -> list[int]:
    """Numbers of the chip's receivers that a radar has; none for one with other receivers."""
    distance = np.linalg.norm(radar.rx[:, None] - bgt60tr13c().rx, axis=-1)
    places: list[int] = distance.argmin(axis=1).tolist()
    return places if distance.min(axis=1).max() < _SAME_PLACE else []


class Worker(Generic[Result]):
    """Does one thing after the other in a thread of its own.

    A pool of threads is waited for when a program ends, with all that it has begun; a heavy frame takes long.

    Parameters
    ----------
    name : str
        Name of the thread.
    """

    def __init__(self, name: str) -> None:
        self._jobs: SimpleQueue[_Job[Result] | None] = SimpleQueue()
        self._closed: Future[None] = Future()
        self._thread = threading.Thread(target=_work, args=(self._jobs,), name=name, daemon=True)
        self._thread.start()
        self._forgotten = weakref.finalize(self, self._jobs.put, None)

    def begin(self, work: Callable[[], Result]) -> Future[Result]:
        """Put something at the end of what is to be done."""
        future: Future[Result] = Future()
        self._jobs.put((future, work))
        return future

    def result(self, future: Future[Result]) -> Result:
        """Result, once it is done; RuntimeError when the worker is closed before."""
        either: tuple[Future[Any], ...] = (future, self._closed)
        wait(either, return_when=FIRST_COMPLETED)
        if self._closed.done():
            raise RuntimeError("closed before it was done")
        return future.result()

    def close(self) -> None:
        """End after pending work, and release waiting readers; may be called twice."""
        if not self._closed.done():
            self._closed.set_result(None)
        with suppress(Empty):
            while True:
                if (job := self._jobs.get_nowait()) is not None:
                    job[0].cancel()
        self._forgotten()


def _work(jobs: SimpleQueue[_Job[Result] | None]) -> None:
    """Do the jobs until one is None."""
    while (job := jobs.get()) is not None:
        future, work = job
        if not future.set_running_or_notify_cancel():
            continue
        try:
            future.set_result(work())
        except BaseException as error:  # for the caller of the result
            future.set_exception(error)
        del job, future, work  # nothing is kept while there is nothing to do
