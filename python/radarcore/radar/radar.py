"""A radar: waveform, antennas, power and receiver."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check, notice
from radarcore.radar import beam
from radarcore.radar.pattern import IsotropicPattern, Pattern, pattern_from_dict, pattern_to_dict
from radarcore.radar.receiver import Receiver, check_receivers
from radarcore.radar.schedule import Schedule, check_sequences, require_fit, shortest_interval
from radarcore.radar.waveform import Waveform
from radarcore.records import sealed
from radarcore.units import html_table, power_from_dbm, quantity

_FARTHEST_ANTENNA = 1e6
"""Largest coordinate of an antenna in the sensor frame [m]."""

_POLARIZATIONS = {"vertical": (0.0, 0.0, 1.0), "horizontal": (0.0, 1.0, 0.0)}
"""Directions of the field by name, in the sensor frame."""


_WIDEST_APERTURE = 100.0
"""Largest plausible distance of the outermost antennas [wavelengths]; beyond it positions are not in metres."""


@sealed
@dataclass(eq=False)
class Radar:
    """Radar sensor; every TX-RX pair is a channel, ``channel = tx_index * num_rx + rx_index``.

    Parameters
    ----------
    waveform : Waveform or sequence of Waveform
        Of a frame of several sub-sequences (up- and down-chirps, say) all their waveforms: equally many samples at one
        sample rate, and chirps that do not overlap in time. `waveform` is then the first of them, `waveforms` has all;
        a frame has the chirps of the first, then of the second, ...
    tx, rx : (n, 3) array_like
        Antenna positions in the sensor frame [m]: x forward, y left, z up.
    pattern : IsotropicPattern, GaussianPattern or TabulatedPattern
        Power gain of every element, TX and RX.
    tx_patterns, rx_patterns : sequence of patterns, optional
        One per element, in place of `pattern`.
    tx_power_dbm : float
        Transmitted power of one TX [dBm]; the default, 1 W, makes amplitudes transfer functions.
    receiver : Receiver, optional
        None: the ideal receiver, I/Q without noise.
    polarization : "vertical", "horizontal" or (3,) array_like, optional
        Direction of the field of every element, TX and RX: "vertical" is the z axis of the radar, "horizontal" its y
        axis; or a unit vector in the sensor frame. Of every ray the direction across it. None: reflections are averaged
        over polarisations.
    schedule : Schedule, optional
        When and in which phase transmitters send: `Schedule.tdm`, `.ddm`, `.steered`. None: every transmitter is
        received as if it were alone, all at the same time, which no radar with several can do.
    more_waveforms : sequence of Waveform
        Waveforms of the sub-sequences after the first; without effect beside a sequence of all.
    channel_weights : (channel,) array_like of complex, optional
        Factors that equalise the channels, the inverse of their errors, as `calibrate` measures them. `detect`,
        `track`, `range_angle` and all others that combine channels by phase multiply the channels by them. Samples stay
        as they are, and `Simulator` ignores them. None: corrects the phases of the receiver, `channel_phases`.

    Raises
    ------
    ValueError
        For ramps that overlap, of sub-sequences or of transmitters in turn, and a schedule of other numbers of
        transmitters or chirps.

    Warns
    -----
    UserWarning
        For antennas more than 100 wavelengths from each other, which is implausible.

    See Also
    --------
    bgt60tr13c : A real one.
    Waveform : Its transmitted signal.
    Receiver : The chain between antennas and samples.
    Simulator : Frames of a scene.

    Examples
    --------
    >>> wf = rc.Waveform.design(max_range=20.0, range_resolution=0.2, max_velocity=5.0, start_frequency=77e9)
    >>> radar = rc.Radar(wf, rx=[[0.0, 0.0, 0.0], [0.0, 1.9e-3, 0.0]], tx_power_dbm=12.0)
    >>> radar
    <Radar 77 to 77.75 GHz, 64 chirps of 200 samples, 1 TX, 2 RX, 80.7 Hz>
    """

    waveform: Waveform
    tx: NDArray[np.float64]
    rx: NDArray[np.float64]
    pattern: Pattern
    tx_patterns: tuple[Pattern, ...]
    rx_patterns: tuple[Pattern, ...]
    tx_power_dbm: float
    receiver: Receiver | None
    polarization: str | tuple[float, float, float] | None
    schedule: Schedule | None
    more_waveforms: tuple[Waveform, ...]
    channel_weights: NDArray[np.complex128] | None

    def __init__(
        self,
        waveform: Waveform | Sequence[Waveform],
        *,
        tx: ArrayLike = ((0.0, 0.0, 0.0),),
        rx: ArrayLike = ((0.0, 0.0, 0.0),),
        pattern: Pattern | None = None,
        tx_patterns: Sequence[Pattern] | None = None,
        rx_patterns: Sequence[Pattern] | None = None,
        tx_power_dbm: float = 30.0,
        receiver: Receiver | None = None,
        polarization: str | ArrayLike | None = None,
        schedule: Schedule | None = None,
        more_waveforms: Sequence[Waveform] = (),
        channel_weights: ArrayLike | None = None,
    ) -> None:
        if isinstance(waveform, Sequence):
            if len(waveform) == 0:
                raise ValueError("waveform: expected at least one, got none")
            waveform, *more_waveforms = waveform
        pattern = IsotropicPattern() if pattern is None else pattern
        for i, each in enumerate((waveform, *more_waveforms)):
            check.instance(f"waveform[{i}]" if more_waveforms else "waveform", each, Waveform)
        check.instance("pattern", pattern, *get_args(Pattern))
        check.instance("receiver", receiver, Receiver, type(None))
        check.instance("schedule", schedule, Schedule, type(None))
        self.waveform = waveform
        self.tx = _positions("tx", tx)
        self.rx = _positions("rx", rx)
        self.pattern = pattern
        self.tx_patterns = _patterns("tx_patterns", tx_patterns, pattern, len(self.tx))
        self.rx_patterns = _patterns("rx_patterns", rx_patterns, pattern, len(self.rx))
        self.tx_power_dbm = check.level("tx_power_dbm", tx_power_dbm, "dBm")
        self.receiver = receiver
        self.polarization = _polarization(polarization)
        if receiver is not None:
            check_receivers(receiver, len(self.rx), (waveform, *more_waveforms))
        self.schedule = schedule
        self.more_waveforms = tuple(more_waveforms)
        if schedule is not None:
            for each in self.waveforms:
                require_fit(schedule, len(self.tx), each.num_chirps)
        check_sequences(self.waveforms, self._tx_offsets)
        self.channel_weights = None if channel_weights is None else _weights(channel_weights, self.num_channels)
        aperture = float(np.linalg.norm(np.ptp(np.concatenate([self.tx, self.rx]), axis=0)))
        if aperture > _WIDEST_APERTURE * waveform.wavelength:
            notice.warn(
                f"tx, rx: expected antennas within {_WIDEST_APERTURE:g} wavelengths of each other "
                f"({_WIDEST_APERTURE * waveform.wavelength:.3g} m), got {aperture:.4g} m (2.5 mm is 2.5e-3)"
            )

    def __repr__(self) -> str:
        ramps = " and ".join(f"{_band_text(waveform)}, {waveform.num_chirps} chirps" for waveform in self.waveforms)
        rate = quantity(1.0 / self.waveform.frame_interval, "Hz")
        return f"<Radar {ramps} of {self.waveform.num_samples} samples, {len(self.tx)} TX, {len(self.rx)} RX, {rate}>"

    def _repr_html_(self) -> str:
        return html_table("Radar", self.facts())

    def facts(self) -> dict[str, Any]:
        """Parameters and resolutions by name with SI unit, as in ``"bandwidth [Hz]"``."""
        wf = self.waveform
        return {
            "transmitters": len(self.tx),
            "receivers": len(self.rx),
            **_pattern_facts(self.tx_patterns, self.rx_patterns),
            "samples": "real" if self.is_real else "I/Q",
            "start frequency [Hz]": wf.start_frequency,
            "slope [Hz/s]": wf.slope,
            "bandwidth [Hz]": wf.bandwidth,
            "sample rate [Hz]": wf.sample_rate,
            "samples per chirp": wf.num_samples,
            "chirps per frame": self.num_chirps,
            "chirp interval [s]": wf.chirp_interval,
            "frame interval [s]": wf.frame_interval,
            "range bin [m]": None if wf.is_cw else wf.range_resolution,
            "largest range [m]": None if wf.is_cw else self.max_unambiguous_range,
            "velocity bin [m/s]": wf.velocity_resolution,
            "largest velocity [m/s]": self.max_velocity,
            **({} if self.schedule is None else {"schedule": self.schedule.kind}),
            **({"sub-sequences": len(self.waveforms)} if self.more_waveforms else {}),
            **({} if self.channel_weights is None else {"channel weights": _weights_text(self.channel_weights)}),
        }

    @cached_property
    def num_channels(self) -> int:
        """Number of TX-RX pairs; of receivers where a schedule has all transmitters send at once."""
        return len(self.rx) if self._is_sum else len(self.tx) * len(self.rx)

    @cached_property
    def num_chirps(self) -> int:
        """Number of chirps of a frame, over all sub-sequences."""
        return sum(waveform.num_chirps for waveform in self.waveforms)

    @cached_property
    def waveforms(self) -> tuple[Waveform, ...]:
        """Waveforms of the sub-sequences of a frame."""
        return self.waveform, *self.more_waveforms

    def sequences(self) -> tuple[Radar, ...]:
        """Radars with one waveform each, of the sub-sequences of a frame."""
        return self._parts if self.more_waveforms else (self,)

    @cached_property
    def _parts(self) -> tuple[Radar, ...]:
        """Radars of several sub-sequences."""
        schedule = self.schedule
        if schedule is not None and schedule.kind == "tdm" and schedule.interval is None:
            # Its default follows from the chirps of all.
            schedule = replace(schedule, interval=shortest_interval(self.waveforms) / len(self.tx))
        return tuple(replace(self, waveform=each, more_waveforms=(), schedule=schedule) for each in self.waveforms)

    @property
    def _is_sum(self) -> bool:
        return self.schedule is not None and self.schedule.is_sum

    @property
    def _tx_offsets(self) -> NDArray[np.float64]:
        """Time from the chirps of the waveforms to the chirps of every transmitter, (tx,) [s]."""
        if self.schedule is None:
            return np.zeros(len(self.tx))
        return self.schedule.offsets(len(self.tx), shortest_interval(self.waveforms))

    @property
    def array_center(self) -> NDArray[np.float64]:
        """Mean of the centres of transmitters and receivers in the sensor frame, (3,) [m]; rays start here."""
        center: NDArray[np.float64] = 0.5 * (self.tx.mean(axis=0) + self.rx.mean(axis=0))
        return center

    @property
    def virtual_array(self) -> NDArray[np.float64]:
        """Positions of the channels in the sensor frame, (channel, 3) [m]: of TX and RX, about their means, added.

        An echo from far away in a direction has the phase ``-2 pi position . direction / wavelength`` relative to one
        of antennas at the centre of the array. If a schedule has all transmitters send at once, these are the receivers
        about their mean; the transmitters have one common phase, the phase at their mean if the beam is steered by
        angles.
        """
        tx, rx = self.tx - self.tx.mean(axis=0), self.rx - self.rx.mean(axis=0)
        positions: NDArray[np.float64] = rx if self._is_sum else (tx[:, None] + rx).reshape(-1, 3)
        return positions

    @cached_property
    def channel_offsets(self) -> NDArray[np.float64]:
        """Time from ``waveform.chirp_times`` to the chirps of every channel, (channel,) [s]: of TDM, else zero."""
        offsets = np.zeros(self.num_channels) if self._is_sum else np.repeat(self._tx_offsets, len(self.rx))
        return check.frozen(offsets)

    @property
    def duration(self) -> float:
        """Duration from the start of a frame to the last sample of the last ramp [s]."""
        return max(waveform.duration for waveform in self.waveforms) + float(self._tx_offsets.max())

    @cached_property
    def middle(self) -> float:
        """Time from the start of a frame to its middle [s], for which range, velocity and truth hold.

        `Waveform.middle` of the first sub-sequence, plus half of the TDM transmitter sequence.
        """
        return self.waveform.middle + 0.5 * float(self.channel_offsets.max())

    @cached_property
    def max_velocity(self) -> float:
        """Largest unambiguous velocity [m/s]: the least of the waveforms'.

        With DDM over the number of transmitters, unless an empty band tells which transmitter is which.
        """
        schedule, least = self.schedule, min(waveform.max_velocity for waveform in self.waveforms)
        if schedule is None or schedule.kind != "ddm":
            return least
        return least if schedule.bands(len(self.tx), self.waveform.num_chirps) is not None else least / len(self.tx)

    @property
    def channel_phases(self) -> NDArray[np.float64]:
        """Phases that the receivers add to echoes, (channel,) [rad]; see `channel_corrections`."""
        phases = None if self.receiver is None else self.receiver.rx_phase_deg
        of_receivers = np.zeros(len(self.rx)) if phases is None else np.deg2rad(phases)
        return np.tile(of_receivers, self.num_channels // len(self.rx))

    @cached_property
    def channel_corrections(self) -> NDArray[np.complex128]:
        """Factors of the channels before they are combined, (channel,): `channel_weights`, or from `channel_phases`."""
        factors: NDArray[np.complex128] = np.exp(-1j * self.channel_phases)
        return check.frozen(factors) if self.channel_weights is None else self.channel_weights

    @property
    def tx_power(self) -> float:
        """Transmitted power of one TX [W]."""
        return power_from_dbm(self.tx_power_dbm)

    @property
    def polarization_vector(self) -> tuple[float, float, float] | None:
        """Unit vector along the field of the antennas in the sensor frame; None without a polarisation."""
        return _POLARIZATIONS[self.polarization] if isinstance(self.polarization, str) else self.polarization

    @property
    def field_of_view_deg(self) -> tuple[float, float]:
        """Horizontal and vertical angle that the antennas see [degrees].

        The smallest field of view about the x axis with all directions in which the two-way gain of any TX-RX pair is
        within 20 dB of the largest; at most 150 degrees. `Simulator` rounds it up to whole tiles of rays.
        """
        return beam.field_of_view_deg(self.tx_patterns, self.rx_patterns)

    @property
    def is_real(self) -> bool:
        """True when the receiver gives real samples."""
        return self.receiver is not None and self.receiver.output == "real"

    @cached_property
    def max_unambiguous_range(self) -> float:
        """Largest unambiguous range [m]: ``c sample_rate / (4 abs(slope))`` of real samples, of I/Q samples twice that.

        This follows the radar's receiver, real or I/Q; `Waveform.max_range` assumes real samples. The smallest of
        several waveforms; inf for a CW radar.
        """
        return min(waveform.max_range for waveform in self.waveforms) * (1.0 if self.is_real else 2.0)

    def to_dict(self) -> dict[str, Any]:
        """Radar as plain numbers, lists and texts, for JSON."""
        return {
            "waveform": self.waveform.to_dict(),
            "tx": self.tx.tolist(),
            "rx": self.rx.tolist(),
            "pattern": pattern_to_dict(self.pattern),
            "tx_patterns": self._own_patterns(self.tx_patterns),
            "rx_patterns": self._own_patterns(self.rx_patterns),
            "tx_power_dbm": self.tx_power_dbm,
            "receiver": None if self.receiver is None else self.receiver.to_dict(),
            "polarization": list(self.polarization) if isinstance(self.polarization, tuple) else self.polarization,
            "schedule": None if self.schedule is None else self.schedule.to_dict(),
            "more_waveforms": [waveform.to_dict() for waveform in self.more_waveforms],
            **({} if self.channel_weights is None else {"channel_weights": _pairs(self.channel_weights)}),
        }

    def _own_patterns(self, patterns: tuple[Pattern, ...]) -> list[dict[str, Any]] | None:
        """Patterns of elements for JSON; None if all have the pattern of the radar."""
        return None if all(p == self.pattern for p in patterns) else [pattern_to_dict(p) for p in patterns]

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Radar:
        """The radar that `to_dict` described."""
        receiver, schedule, pairs = values["receiver"], values.get("schedule"), values.get("channel_weights")
        return cls(
            Waveform(**values["waveform"]),
            tx=values["tx"],
            rx=values["rx"],
            pattern=pattern_from_dict(values["pattern"]),
            tx_patterns=_patterns_from_dicts(values["tx_patterns"]),
            rx_patterns=_patterns_from_dicts(values["rx_patterns"]),
            tx_power_dbm=values["tx_power_dbm"],
            receiver=None if receiver is None else Receiver.from_dict(receiver),
            polarization=values["polarization"],
            schedule=None if schedule is None else Schedule.from_dict(schedule),
            more_waveforms=[Waveform(**entry) for entry in values.get("more_waveforms", ())],
            channel_weights=None if pairs is None else complex_of_pairs(pairs),
        )

    def __eq__(self, other: object) -> bool:
        return self is other or (isinstance(other, Radar) and self.to_dict() == other.to_dict())

    def __hash__(self) -> int:
        return hash((self.waveform, *self.tx.ravel().tolist(), *self.rx.ravel().tolist()))


def _patterns_from_dicts(values: list[dict[str, Any]] | None) -> list[Pattern] | None:
    return None if values is None else [pattern_from_dict(entry) for entry in values]


def complex_of_pairs(pairs: ArrayLike) -> NDArray[np.complex128]:
    """Channel weights from pairs of real and imaginary parts, (channel, 2)."""
    parts = check.array("channel_weights", pairs, (None, 2))
    weights: NDArray[np.complex128] = parts[:, 0] + 1j * parts[:, 1]
    return weights


def _pairs(weights: NDArray[np.complex128]) -> list[list[float]]:
    return [[weight.real, weight.imag] for weight in weights.tolist()]


def _weights(value: ArrayLike, num_channels: int) -> NDArray[np.complex128]:
    """Finite weights of all channels, none of them zero."""
    weights = check.finite("channel_weights", check.complex_numbers("channel_weights", value, (num_channels,)))
    if not weights.all():
        first = int(np.flatnonzero(weights == 0.0)[0])
        raise ValueError(f"channel_weights: expected numbers other than zero, got zero for channel {first}")
    return check.frozen(weights.copy())


def _weights_text(weights: NDArray[np.complex128]) -> str:
    levels, phases = 20.0 * np.log10(np.abs(weights)), np.rad2deg(np.angle(weights))
    return ", ".join(f"{level:+.1f} dB {phase:+.0f} deg" for level, phase in zip(levels, phases, strict=True))


def _band_text(waveform: Waveform) -> str:
    """Sampled band, such as "60 to 61.5 GHz"."""
    start = waveform.start_frequency + waveform.slope * waveform.adc_delay
    stop = start + waveform.slope * waveform.num_samples / waveform.sample_rate
    return quantity(start, "Hz", 4) if waveform.is_cw else f"{start / 1e9:.4g} to {quantity(stop, 'Hz', 4)}"


def _pattern_facts(tx: Sequence[Pattern], rx: Sequence[Pattern]) -> dict[str, str]:
    """The common pattern of all antennas, or a list of patterns."""
    every = (("transmitter", tx), ("receiver", rx))
    facts = {f"pattern of {kind} {i}": str(p) for kind, patterns in every for i, p in enumerate(patterns)}
    return facts if len(set(facts.values())) > 1 else {"antenna pattern": str(tx[0])}


def _polarization(value: object) -> str | tuple[float, float, float] | None:
    """Polarisation that was given by name or as a unit vector."""
    if value is None:
        return None
    if isinstance(value, str):
        if value not in _POLARIZATIONS:
            raise ValueError(f"polarization: expected 'vertical', 'horizontal' or a unit vector, got {value!r}")
        return value
    vector = check.array("polarization", value, (3,))  # type: ignore[arg-type]  # what is no array is refused there
    length = float(np.linalg.norm(vector))
    if abs(length - 1.0) > 1e-3:
        raise ValueError(f"polarization: expected a unit vector, got one of length {length:g}")
    x, y, z = (vector / length).tolist()
    return x, y, z


def _patterns(name: str, value: Sequence[Pattern] | None, default: Pattern, number: int) -> tuple[Pattern, ...]:
    """Patterns, one per element."""
    if value is None:
        return (default,) * number
    if not isinstance(value, Sequence):
        raise TypeError(f"{name}: expected a sequence of patterns, one per element, got {type(value).__name__}")
    if len(value) != number:
        raise ValueError(f"{name}: expected {number} patterns, one per element, got {len(value)}")
    return tuple(check.instance(f"{name}[{i}]", pattern, *get_args(Pattern)) for i, pattern in enumerate(value))


def _positions(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Positions of at least one antenna, (n, 3) [m]."""
    given = check.array(name, value, (None, 3))
    if len(given) == 0:
        raise ValueError(f"{name}: expected at least one antenna position, got none")
    if (farthest := float(np.abs(given).max())) > _FARTHEST_ANTENNA:
        raise ValueError(f"{name}: expected coordinates within {_FARTHEST_ANTENNA:g} m, got {farthest:g}")
    return check.frozen(given)
