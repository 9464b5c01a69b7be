"""Schedules of transmitters: in turns (TDM), at once with a Doppler code (DDM), or at once as one beam."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.direction import unit_vectors
from radarcore.radar.waveform import Waveform
from radarcore.records import sealed

KINDS = ("tdm", "ddm", "steered")
"""Kinds of schedules."""

_LARGEST_WEIGHT = 1.0 + 1e-9
"""Largest magnitude of a weight, with room for its rounding: a transmitter sends its power or less."""


@sealed
@dataclass(kw_only=True, eq=False)
class Schedule:
    """Order and phases of the transmitters; made by `tdm`, `ddm` and `steered`.

    Without a schedule the transmitters of a radar are ideally separated: each is received as if it were alone, all at
    the same time. No hardware does this; real radars use schedules.

    Parameters
    ----------
    kind : "tdm", "ddm" or "steered"
    interval : float, optional
        TDM: time from the ramp of one transmitter to the next [s].
    order : tuple of int, optional
        TDM: numbers of the transmitters in the order of their turns.
    turns : (tx,) array_like, optional
        DDM: turns by which the phase of every transmitter advances from chirp to chirp.
    weights : (tx,) or (chirp, tx) array_like of complex, optional
        Steered: factors of the transmitted fields.
    azimuth, elevation : float or (chirp,) array_like, optional
        Steered: direction of the beam [rad], in place of weights.

    See Also
    --------
    Schedule.tdm : Transmitters in turns.
    Schedule.ddm : At once, separated by Doppler.
    Schedule.steered : At once, as one beam.
    demultiplex : Channels from the samples of DDM.

    Examples
    --------
    >>> radar = rc.bgt60tr24(schedule=rc.Schedule(kind="tdm", order=(1, 0)))
    >>> (1e6 * radar.channel_offsets).round(1)
    array([295.6, 295.6, 295.6, 295.6,   0. ,   0. ,   0. ,   0. ])
    """

    kind: str
    interval: float | None = None
    order: tuple[int, ...] | None = None
    turns: NDArray[np.float64] | None = None
    weights: NDArray[np.complex128] | None = None
    azimuth: NDArray[np.float64] | None = None
    elevation: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        check.choice("kind", self.kind, KINDS)
        for name, (kind, checked) in _SETTINGS.items():
            if (value := getattr(self, name)) is not None:
                if kind != self.kind:
                    raise ValueError(
                        f"{name}: expected none in a schedule of kind {self.kind!r}, as it is for {kind!r}"
                    )
                setattr(self, name, checked(name, value))
        if self.kind == "steered":
            has_angles = self.azimuth is not None or self.elevation is not None
            if (self.weights is not None) == has_angles:
                got = "both" if has_angles else "neither"
                raise ValueError(f"weights: expected either weights or azimuth and elevation, got {got}")

    @classmethod
    def tdm(cls, interval: float | None = None, order: Sequence[int] | None = None) -> Schedule:
        """Transmitters take turns (time-division multiplexing): after every chirp of the first comes one of the second.

        ``waveform.chirp_times`` are then the starts of the ramps of the first transmitter; ramps of number k in turn
        start `k interval` later. Velocity axes follow the waveform. A target moves between the turns: its phase differs
        between transmitters by
        ``2 pi f_doppler k interval``. Channels are ``tx * num_rx + rx``, and `Radar.channel_offsets` has their times.

        Parameters
        ----------
        interval : float, optional
            From one turn to the next [s]; default: the shortest interval between chirps over
            the number of transmitters.
        order : sequence of int, optional
            Numbers of the transmitters in the order of their turns; default: 0, 1, 2, ...

        See Also
        --------
        Schedule.ddm : All at once, separated by Doppler.
        Radar.channel_offsets : Times of the channels.

        Examples
        --------
        >>> radar = rc.bgt60tr24(schedule=rc.Schedule.tdm())
        >>> (1e6 * radar.channel_offsets).round(1)
        array([  0. ,   0. ,   0. ,   0. , 295.6, 295.6, 295.6, 295.6])
        """
        return cls(kind="tdm", interval=interval, order=order)  # type: ignore[arg-type]  # __post_init__ makes it one

    @classmethod
    def ddm(cls, turns: ArrayLike | None = None) -> Schedule:
        """All transmitters send at once, separated by their Doppler frequency (Doppler-division multiplexing).

        The phase of transmitter i advances by ``turns[i]`` from chirp to chirp. Receivers get the sum: echoes of every
        transmitter appear at velocities of their own, ``-turns[i] * 2 max_velocity`` beside the true one, and
        `demultiplex` makes channels of them. Channels are the receivers. With the default turns, unambiguous velocities
        are fewer by the number of transmitters. With an empty band, `detect` identifies the transmitters:
        all velocities of the waveform are unambiguous, and all pairs of antennas give the direction.

        Parameters
        ----------
        turns : (tx,) array_like, optional
            Turns per chirp; default: ``i / num_tx``. ``i / (num_tx + 1)`` leaves a band empty.

        See Also
        --------
        demultiplex : Makes channels of the sum.
        Schedule.tdm : In turns.

        Examples
        --------
        >>> radar = rc.bgt60tr24(schedule=rc.Schedule.ddm())
        >>> print(f"{radar.num_channels} channels, {radar.max_velocity:.2f} of {radar.waveform.max_velocity:.2f} m/s")
        4 channels, 1.04 of 2.09 m/s
        """
        return cls(kind="ddm", turns=turns)  # type: ignore[arg-type]  # __post_init__ makes it an array

    @classmethod
    def steered(
        cls,
        weights: ArrayLike | None = None,
        *,
        azimuth: ArrayLike | None = None,
        elevation: ArrayLike | None = None,
    ) -> Schedule:
        """All transmitters send at once, as one array whose beam is steered, chirp by chirp if need be.

        Every transmitter sends `Radar.tx_power` times ``abs(weight)**2``; n of them add up to n**2 times the power of
        one in the direction of the beam. Receivers get the sum over transmitters of their separate samples times
        ``conj(weight)``: a field that lags by a phase is an echo of a greater delay with a greater phase,
        docs/theory.md eq. (1). Channels are the receivers.

        Parameters
        ----------
        weights : (tx,) or (chirp, tx) array_like of complex
            Factors of the transmitted fields (time dependence ``exp(j w t)``), of magnitudes up to 1.
        azimuth, elevation : float or (chirp,) array_like
            Direction of the beam [rad], in place of weights: azimuth positive to the left (+y), elevation up.

        See Also
        --------
        processing.steering_weights : Weights of a beam.
        array_pattern : Beam of an array.

        Examples
        --------
        >>> radar = rc.bgt60tr24(schedule=rc.Schedule.steered(azimuth=np.deg2rad(20.0)))
        >>> radar.num_channels
        4
        """
        return cls(kind="steered", weights=weights, azimuth=azimuth, elevation=elevation)  # type: ignore[arg-type]

    @property
    def is_sum(self) -> bool:
        """True if all transmitters send at once, so that receivers get the sum of their echoes."""
        return self.kind != "tdm"

    def offsets(self, num_tx: int, shortest: float) -> NDArray[np.float64]:
        """Time from the chirps of a waveform to the ramps of every transmitter [s], (tx,).

        `shortest`: shortest interval between chirps [s].
        """
        offsets = np.zeros(num_tx)
        if self.kind == "tdm":
            interval = shortest / num_tx if self.interval is None else self.interval
            offsets[list(range(num_tx) if self.order is None else self.order)] = interval * np.arange(num_tx)
        return offsets

    def tx_turns(self, num_tx: int) -> NDArray[np.float64]:
        """Turns by which the phase of every transmitter advances from chirp to chirp, (tx,); zero without DDM."""
        if self.turns is not None:
            return self.turns
        return np.arange(num_tx) / num_tx if self.kind == "ddm" else np.zeros(num_tx)

    def bands(self, num_tx: int, most: int) -> NDArray[np.bool_] | None:
        """Bands of Doppler that DDM uses of up to `most` equal ones, (band,); None unless they tell the transmitters.

        They do if no shift of the used bands by some bands gives the used bands again.
        """
        turns = self.tx_turns(num_tx) % 1.0
        for number in range(num_tx + 1, most + 1) if self.kind == "ddm" and num_tx > 1 else ():
            places = turns * number
            if np.abs(places - np.rint(places)).max() < 1e-6:
                used = np.zeros(number, dtype=bool)
                used[np.rint(places).astype(int) % number] = True
                is_own = any((np.roll(used, shift) == used).all() for shift in range(1, number))
                return None if is_own else used
        return None

    def tx_weights(self, tx: NDArray[np.float64], wavelength: float, num_chirps: int) -> NDArray[np.complex128]:
        """Factors of the fields of transmitters at positions `tx` (tx, 3) [m] in every chirp, (chirp, tx)."""
        num_tx = len(tx)
        if self.kind == "ddm":
            coded: NDArray[np.complex128]
            coded = np.exp(2j * np.pi * (np.arange(num_chirps)[:, None] * self.tx_turns(num_tx) % 1.0))
            return coded
        if self.weights is not None:
            return np.broadcast_to(self.weights, (num_chirps, num_tx)).copy()
        azimuth = 0.0 if self.azimuth is None else self.azimuth
        elevation = 0.0 if self.elevation is None else self.elevation
        direction = unit_vectors(azimuth, elevation)
        # The transmitter nearer to the target lags, so that all fields arrive in phase.
        turns = direction @ (tx - tx.mean(axis=0)).T / wavelength
        return np.broadcast_to(np.exp(-2j * np.pi * turns), (num_chirps, num_tx)).copy()

    def to_dict(self) -> dict[str, Any]:
        """Schedule as plain numbers and lists, for JSON; complex numbers as pairs."""
        values = {name: getattr(self, name) for name in _SETTINGS if getattr(self, name) is not None}
        if self.weights is not None:
            values["weights"] = np.stack([self.weights.real, self.weights.imag], axis=-1)
        return {"kind": self.kind} | {name: np.asarray(value).tolist() for name, value in values.items()}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Schedule:
        """The schedule that `to_dict` described."""
        values = dict(values)
        if values.get("weights") is not None:
            pairs = check.numbers("weights", values["weights"])
            if pairs.ndim < 2 or pairs.shape[-1] != 2:
                raise ValueError(f"weights: expected pairs of real and imaginary parts, got shape {pairs.shape}")
            values["weights"] = pairs[..., 0] + 1j * pairs[..., 1]
        return cls(**values)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Schedule) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash((self.kind, self.interval, self.order))


def require_fit(schedule: Schedule, num_tx: int, num_chirps: int) -> None:
    """Refuse a number of transmitters or of chirps that the schedule does not fit."""
    shapes_of: dict[str, tuple[tuple[int, ...], ...]] = {
        "order": ((num_tx,),),
        "turns": ((num_tx,),),
        "weights": ((num_tx,), (num_chirps, num_tx)),
        "azimuth": ((), (num_chirps,)),
        "elevation": ((), (num_chirps,)),
    }
    for name, shapes in shapes_of.items():
        value = getattr(schedule, name)
        if value is not None and np.shape(value) not in shapes:
            expected = " or ".join(map(str, shapes))
            raise ValueError(f"schedule: expected {name} of shape {expected}, got {np.shape(value)}")


def _order(name: str, value: Any) -> tuple[int, ...]:
    if not np.iterable(value):
        raise TypeError(f"{name}: expected numbers of transmitters, got {value!r}")
    order = tuple(check.count(f"{name}[{i}]", number, 0) for i, number in enumerate(value))
    if sorted(order) != list(range(len(order))):
        raise ValueError(f"{name}: expected every number from 0 to {len(order) - 1} once, got {list(order)}")
    return order


def _turns_per_chirp(name: str, value: ArrayLike) -> NDArray[np.float64]:
    turns = check.array(name, value, (None,))
    if len(turns) > 1 and np.diff(np.sort(turns % 1.0)).min() < 1e-9:
        raise ValueError(f"{name}: expected another part of a turn for every transmitter, got {turns.tolist()}")
    return check.frozen(turns)


def _weights(name: str, value: ArrayLike) -> NDArray[np.complex128]:
    weights = check.finite(name, np.array(check.complex_numbers(name, value)))
    if weights.ndim not in (1, 2) or weights.size == 0:
        raise ValueError(f"{name}: expected shape (tx,) or (chirp, tx), got {weights.shape}")
    if (largest := float(np.abs(weights).max())) > _LARGEST_WEIGHT:
        raise ValueError(f"{name}: expected magnitudes up to 1 (tx_power_dbm sets the power), got {largest:g}")
    return check.frozen(weights)


def _angles(name: str, value: ArrayLike) -> NDArray[np.float64]:
    return check.frozen(check.radians(name, check.array(name, value, (None,) if np.ndim(value) else ())))


_SETTINGS: dict[str, tuple[str, Callable[[str, Any], Any]]] = {
    "interval": ("tdm", partial(check.positive, unit="s")),
    "order": ("tdm", _order),
    "turns": ("ddm", _turns_per_chirp),
    "weights": ("steered", _weights),
    "azimuth": ("steered", _angles),
    "elevation": ("steered", _angles),
}
"""Kind of schedule that has each setting, and the check that returns it as it is kept."""


_ROUNDING = 1e-9
"""Overlap of ramps that is rounding, in parts of a ramp."""


def shortest_interval(waveforms: Sequence[Waveform]) -> float:
    """Shortest interval between the chirps of a frame [s]."""
    starts = np.sort(np.concatenate([waveform.chirp_times for waveform in waveforms]))
    return waveforms[0].chirp_interval if len(starts) == 1 else float(np.diff(starts).min())


def check_sequences(waveforms: Sequence[Waveform], tx_offsets: NDArray[np.float64]) -> None:
    """Refuse waveforms of other samples than the first, and ramps that overlap.

    `tx_offsets`: time from the chirps of a waveform to the ramps of every transmitter (tx,) [s]; equal ones are ramps
    that are sent together.
    """
    first = waveforms[0]
    for number, waveform in enumerate(waveforms[1:], 1):
        for name, unit in (("num_samples", ""), ("sample_rate", " Hz")):
            if (got := getattr(waveform, name)) != (expected := getattr(first, name)):
                text = f"expected {name} = {expected:g}{unit} as in waveform[0], got {got:g}{unit}"
                raise ValueError(f"waveform[{number}]: {text}")
    offsets = np.unique(tx_offsets)
    if len(waveforms) == 1 and len(offsets) == 1:
        return

    # Starts of all ramps in their order, with the duration of each up to its last sample.
    starts = np.concatenate([np.add.outer(waveform.chirp_times, offsets).ravel() for waveform in waveforms])
    lengths = np.concatenate(
        [np.full(waveform.num_chirps * len(offsets), waveform.sample_times[-1]) for waveform in waveforms]
    )
    order = np.argsort(starts, kind="stable")
    gaps, lengths = np.diff(starts[order]), lengths[order][:-1]
    short = gaps < lengths * (1.0 - _ROUNDING)
    if short.any() or (gaps == 0.0).any():
        index = int((gaps - lengths).argmin())
        name = "schedule" if len(waveforms) == 1 else "waveform"
        of = "transmitters in turn" if len(waveforms) == 1 else "sub-sequences and transmitters"
        raise ValueError(
            f"{name}: expected at least {lengths[index]:g} s between the ramps of {of} (adc_delay + samples), "
            f"got {gaps[index]:g} s at {starts[order][index]:g} s"
        )
