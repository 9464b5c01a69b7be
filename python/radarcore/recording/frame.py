"""Frame of beat signals, with its radar, time and truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from radarcore import check
from radarcore.radar.radar import Radar
from radarcore.units import html_table

TRUTH_FIELDS = ("range", "velocity", "azimuth", "elevation")
CUBE_TYPES = ("float32", "float64", "complex64", "complex128")
_CUBE_DTYPES = frozenset(map(np.dtype, CUBE_TYPES))
FULL_SCALE = "full scale"
"""``source["cube_unit"]`` of a recording with samples of an ADC: from -1, code 0, to 1, the largest."""

PARTS_OF_FULL_SCALE = "parts of full scale"
"""Unit of samples that are no codes of 12 bits, see `Receiver.unit`: filtered ones among them."""

COUNTS = "counts"
"""Unit of samples that were integers of an ADC whose full scale nothing tells."""

_MAX_LOST = np.iinfo(np.int32).max

Kind = tuple[np.dtype[Any], tuple[str, ...] | None]
"""Dtype of the cube and names of the bodies (None: no truth): common to all frames of a recording."""


@dataclass(frozen=True, eq=False)
class Truth:
    """True range, velocity and direction of the bodies, seen from the radar; NaN for a body that was not visible.

    For a body with a mesh they belong to its **nearest visible point**: the point hit by a ray that is nearest to the
    centre of the array, not the body's centre or origin. Of a sphere that is about its centre's range less its radius;
    the strongest echo may come from another point. The velocity is the velocity of the material there. A `PointTarget`
    is that point itself, visible in the whole field of view. Simulated truth holds for the middle of the frame.
    `compare` uses the nearest point of a body's mesh, visible or not, and the origin of a bare motion.

    Parameters
    ----------
    names : tuple of str
        One per body.
    range : (body,) or (frame, body) array_like
        Distance from the centre of the array, `Radar.array_center`, to that point [m].
    velocity : (body,) or (frame, body) array_like
        Range rate of that point, receding positive [m/s].
    azimuth, elevation : (body,) or (frame, body) array_like
        Angles to it in the sensor frame [rad], positive to the left and up.

    See Also
    --------
    Truth.select : Of some bodies.
    assign_to_truth : Which track belongs to which body.
    compare : Differences between estimates and truth.

    Examples
    --------
    >>> ball = rc.Body(rc.shapes.sphere(0.1), motion=rc.Linear(rc.Pose([2.0, 0.0, 0.0]), [-1.0, 0.0, 0.0]), name="ball")
    >>> truth = rc.Simulator(rc.Scene([ball]), rc.bgt60tr13c()).frame(0.0).truth
    >>> print(f"{truth.names[0]}: {truth.range[0]:.2f} m, {truth.velocity[0]:.1f} m/s")  # its centre: 1.99 m
    ball: 1.89 m, -1.0 m/s
    """

    names: tuple[str, ...]
    range: NDArray[np.float64]
    velocity: NDArray[np.float64]
    azimuth: NDArray[np.float64]
    elevation: NDArray[np.float64]

    def __post_init__(self) -> None:
        if isinstance(self.names, str):
            raise TypeError(f"names: expected one name per body, got the text {self.names!r}")
        object.__setattr__(self, "names", tuple(map(str, self.names)))
        shape = np.shape(self.range)
        if len(shape) not in (1, 2) or shape[-1] != len(self.names):
            bodies = len(self.names)
            raise ValueError(f"range: expected shape ({bodies},) or (frame, {bodies}) as names, got {shape}")
        for name in TRUTH_FIELDS:
            values = np.array(check.numbers(name, getattr(self, name), shape))
            object.__setattr__(self, name, check.frozen(values))

    def select(self, names: Sequence[str]) -> Truth:
        """The truth of some bodies only, in the order of `names`; KeyError for a name that is not there.

        See Also
        --------
        Scene : Has the names.

        Examples
        --------
        >>> truth = rc.Truth(("cat", "dog"), range=[1.0, 2.0], velocity=[0.0, 0.5], azimuth=[0, 0], elevation=[0, 0])
        >>> truth.select(["dog"]).range
        array([2.])
        """
        if missing := [name for name in names if name not in self.names]:
            raise KeyError(f"no truth of {', '.join(map(repr, missing))}; there is {', '.join(self.names)}")
        columns = [self.names.index(name) for name in names]
        kept = (a[..., columns] for a in (self.range, self.velocity, self.azimuth, self.elevation))
        return Truth(tuple(names), *kept)

    def texts(self) -> list[str]:
        """True range and velocity of every body of one frame, in words."""
        return [
            "not visible" if np.isnan(distance) else f"at {distance:.3f} m, {velocity:+.3f} m/s"
            for distance, velocity in zip(self.range, self.velocity, strict=True)
        ]

    def __getitem__(self, frame_index: int | slice) -> Truth:
        """Truth of one frame of a recording, or of several."""
        return Truth(self.names, *(getattr(self, name)[frame_index] for name in TRUTH_FIELDS))


def truth_of_rows(names: tuple[str, ...], rows: NDArray[np.float64]) -> Truth:
    """Truth of one frame from an array (field, body), which becomes read-only and is not copied."""
    if rows.shape != (expected := (len(TRUTH_FIELDS), len(names))):
        raise ValueError(f"rows: expected shape {expected}, got {rows.shape}")
    truth = object.__new__(Truth)
    vars(truth).update(zip(TRUTH_FIELDS, check.frozen(rows), strict=True), names=tuple(names))
    return truth


@dataclass(frozen=True, eq=False)
class Frame:
    """Frame of samples, simulated or measured.

    Parameters
    ----------
    cube : (channel, chirp, sample) complex64, complex128, float32 or float64
        Beat signal, I/Q or real; copied.
    time : float
        Start of the first chirp [s].
    radar : Radar
    truth : Truth, optional
        Truth of this frame: arrays (body,).
    stats : dict
        Counts of the simulation or the sensor. Only ``lost_before`` is written to files, the number of frames lost
        just before this one, and ``cube_unit``, for samples that are not in sqrt(W) or codes.
    raw : (channel, chirp, sample) uint16, optional
        Codes of the ADC; the cube is then in full scale, see `radarcore.recording.frame.to_samples`.

    See Also
    --------
    Simulator.frame : A simulated one.
    Recording : Several of one radar.
    range_doppler : Its range-velocity map.
    detect : Its targets.

    Examples
    --------
    >>> radar = rc.bgt60tr13c()
    >>> rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), radar).frame(0.0)
    <Frame at 0 s: 3 channels x 64 chirps x 128 samples, float32, truth of point 0>
    >>> rc.Frame(np.zeros((3, 64, 128), np.float32), time=0.0, radar=radar)
    <Frame at 0 s: 3 channels x 64 chirps x 128 samples, float32>
    """

    cube: NDArray[Any]
    time: float
    radar: Radar
    truth: Truth | None = None
    stats: dict[str, Any] = field(default_factory=dict)
    raw: NDArray[np.uint16] | None = None

    def __post_init__(self) -> None:
        self._check()
        # Later changes to the caller's arrays must not reach the frame.
        object.__setattr__(self, "cube", self.cube.copy())
        object.__setattr__(self, "raw", None if self.raw is None else self.raw.copy())

    def _check(self) -> None:
        check.instance("radar", self.radar, Radar)
        object.__setattr__(self, "cube", checked_cube(self.cube, frame_shape(self.radar)))
        object.__setattr__(self, "time", check.number("time", self.time, "s"))
        check_truth(self.truth, ())
        if self.raw is not None:
            codes = np.asarray(self.raw)
            if codes.dtype != np.uint16:
                raise TypeError(f"raw: expected uint16, got {codes.dtype}")
            if codes.shape != self.cube.shape:
                raise ValueError(f"raw: expected shape {self.cube.shape} as the cube, got {codes.shape}")
            object.__setattr__(self, "raw", codes)

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.cube, dtype=dtype, copy=copy)

    def __repr__(self) -> str:
        channels, chirps, samples = self.cube.shape
        return (
            f"<Frame at {self.time:g} s: {channels} channels x {chirps} chirps x {samples} samples, "
            f"{self.cube.dtype}{bodies_text(self.truth)}>"
        )

    def _repr_html_(self) -> str:
        truth = {} if self.truth is None else dict(zip(self.truth.names, self.truth.texts(), strict=True))
        facts = {"start [s]": self.time, "cube [channel, chirp, sample]": self.cube.shape, "dtype": self.cube.dtype}
        return html_table("Frame", {**facts, "unit": unit_of(self) or "sqrt(W)", **truth, **self.radar.facts()})

    def sequences(self) -> tuple[Frame, ...]:
        """Frames of the sub-sequences, one per waveform of the radar; of one waveform the frame itself.

        The chirp times of each waveform count from `time`, the start of them all. Cubes are views; truth and stats
        belong to the whole frame.
        """
        radars = self.radar.sequences()
        if len(radars) == 1:
            return (self,)
        chirps = chirps_of(radars)
        raws = [None if self.raw is None else self.raw[:, part] for part in chirps]
        return tuple(
            frame_of(self.cube[:, part], self.time, radar, self.truth, self.stats, raw)
            for radar, part, raw in zip(radars, chirps, raws, strict=True)
        )

    @property
    def lost_before(self) -> int | None:
        """``stats["lost_before"]``; None if the number of lost frames is unknown."""
        if (num_lost := self.stats.get("lost_before")) is None:
            return None
        if (count := check.count('stats["lost_before"]', num_lost, 0)) > _MAX_LOST:
            raise ValueError(f'stats["lost_before"]: expected at most {_MAX_LOST}, got {count}')
        return count


def frame_of(
    cube: NDArray[Any],
    time: float,
    radar: Radar,
    truth: Truth | None = None,
    stats: dict[str, Any] | None = None,
    raw: NDArray[np.uint16] | None = None,
) -> Frame:
    """Frame of arrays that no user holds, or of views, without copies."""
    frame = object.__new__(Frame)
    vars(frame).update(cube=cube, time=time, radar=radar, truth=truth, stats={} if stats is None else stats, raw=raw)
    frame._check()
    return frame


def bodies_text(truth: Truth | None) -> str:
    """Bodies with a known truth, after a comma; empty for none."""
    return "" if truth is None or not truth.names else f", truth of {', '.join(truth.names)}"


def unit_of(frame: Frame) -> str | None:
    """``source["cube_unit"]`` of a recording of such frames; None for samples in sqrt(W)."""
    if frame.raw is not None:
        return FULL_SCALE
    receiver = frame.radar.receiver
    unit: str | None = frame.stats.get("cube_unit", None if receiver is None else receiver.unit)
    return unit


def is_of_adc(frame: Frame) -> bool:
    """True for samples of an ADC, measured or simulated: codes, counts, or parts of its full scale."""
    return unit_of(frame) in (FULL_SCALE, PARTS_OF_FULL_SCALE, COUNTS)


def frame_shape(radar: Radar) -> tuple[int, int, int]:
    """Channels, chirps and samples of a frame."""
    return radar.num_channels, radar.num_chirps, radar.waveform.num_samples


def chirps_of(radars: Sequence[Radar]) -> list[slice]:
    """Chirps of the frame that belong to the radar of every sub-sequence."""
    ends = np.cumsum([radar.num_chirps for radar in radars]).tolist()
    return [slice(start, end) for start, end in zip([0, *ends], ends, strict=False)]


def kind_of(cube: NDArray[Any], truth: Truth | None) -> Kind:
    """Properties that all frames of a recording share besides the radar."""
    return cube.dtype, None if truth is None else truth.names


def check_alike(name: str, frame: Frame, radar: Radar, kind: Kind | None) -> None:
    """Refuse a frame of another radar or, if there is a kind, of another kind."""
    check.instance(name, frame, Frame)
    if frame.radar is not radar and frame.radar != radar:
        raise ValueError(f"{name}: expected a frame of the recording's radar, got one of another")
    if kind is not None and (given := kind_of(frame.cube, frame.truth)) != kind:
        expected, got = (f"{dtype} with truth of {names}" for dtype, names in (kind, given))
        raise ValueError(f"{name}: expected {expected} as in the first frame, got {got}")


def checked_cube(cube: object, shape: tuple[int | None, ...]) -> NDArray[Any]:
    """Samples of the given shape (None: any length) as an array."""
    samples = np.asarray(cube)
    if samples.dtype not in _CUBE_DTYPES and samples.dtype.name not in CUBE_TYPES:  # as of other byte orders
        raise TypeError(f"cube: expected {', '.join(CUBE_TYPES)}, got {samples.dtype}")
    if not check.fits(samples.shape, shape):
        axes = ", ".join(("frame", "channel", "chirp", "sample")[-len(shape) :])
        raise ValueError(f"cube: expected shape {check.shape_text(shape)} [{axes}] of the radar, got {samples.shape}")
    return samples


def check_truth(truth: object, frames: tuple[int, ...]) -> None:
    """Refuse anything but the truth of one frame, ``frames = ()``, or of ``frames = (n,)``."""
    if truth is None:
        return
    truth = check.instance("truth", truth, Truth)
    if truth.range.shape != (expected := (*frames, len(truth.names))):
        raise ValueError(f"truth: expected arrays of shape {expected}, got {truth.range.shape}")


NUM_CODES = 4096
"""Codes of a 12-bit ADC: from 0 to 4095."""

FULL_SCALE_VOLT = 1.21
"""Voltage of a sample of 1 at the ADC's input [V]; -1 is as much below zero."""


def to_samples(codes: ArrayLike) -> NDArray[np.float32]:
    """Samples from -1 to 1: ``2 code / 4095 - 1``, every step in float32 (Strata, scaling).

    Parameters
    ----------
    codes : array_like of integers
        From 0 to 4095.

    Returns
    -------
    samples : float32, the shape of `codes`
        Parts of the ADC's full scale, `FULL_SCALE_VOLT`.
    """
    samples: NDArray[np.float32] = np.multiply(checked_codes(codes), 2, dtype=np.float32)
    samples /= np.float32(NUM_CODES - 1)
    samples -= np.float32(1.0)
    return samples


def to_codes(samples: ArrayLike) -> NDArray[np.uint16]:
    """Codes nearest to samples; gives back the codes that `to_samples` had.

    Parameters
    ----------
    samples : array_like of real numbers
        Parts of full scale; below -1 and above 1 the ADC clips.

    Returns
    -------
    codes : uint16, the shape of `samples`

    Raises
    ------
    ValueError
        For NaN.
    """
    given = np.asarray(samples)
    if given.dtype.kind not in "fiu":
        raise TypeError(f"samples: expected real numbers, got {given.dtype}")
    if np.isnan(given).any():
        raise ValueError("samples: expected numbers, got NaN")
    values = (np.clip(given.astype(np.float64), -1.0, 1.0) + 1.0) * ((NUM_CODES - 1) / 2.0)
    codes: NDArray[np.uint16] = np.rint(values).astype(np.uint16)
    return codes


def adc_codes(samples: NDArray[np.floating], radar: Radar) -> NDArray[np.uint16] | None:
    """Codes of samples as a radar's receiver delivered them; None if they are not codes of 12 bits."""
    receiver = radar.receiver
    return to_codes(samples) if receiver is not None and receiver.has_codes else None


def checked_codes(codes: ArrayLike) -> NDArray[np.uint16]:
    """The codes as uint16, none above 4095."""
    values = np.asarray(codes)
    if values.size == 0:
        return np.empty(values.shape, np.uint16)
    if values.dtype.kind not in "iu":
        raise TypeError(f"codes: expected integers, got {values.dtype}")
    low, high = int(values.min()), int(values.max())
    if low < 0 or high >= NUM_CODES:
        raise ValueError(f"codes: expected 0 to {NUM_CODES - 1}, got {low if low < 0 else high}")
    return values.astype(np.uint16, copy=False)
