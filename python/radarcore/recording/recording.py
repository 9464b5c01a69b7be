"""Recordings: the frames of one radar in memory, and the formats they have on disk."""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from radarcore import check
from radarcore.radar.radar import Radar
from radarcore.recording import bare, infineon
from radarcore.recording.bare import Description, is_setup
from radarcore.recording.frame import (
    FULL_SCALE,
    TRUTH_FIELDS,
    Frame,
    Truth,
    bodies_text,
    check_alike,
    check_truth,
    checked_cube,
    chirps_of,
    frame_of,
    frame_shape,
    kind_of,
    to_codes,
    unit_of,
)
from radarcore.recording.native import RecordingWriter, Stored, format_of, load_directory, load_npz, open_as, save_npz
from radarcore.recording.npy import Converted
from radarcore.units import html_table

_FILES = (".npz", ".npy", ".mat", ".bin")
"""Suffixes of files with samples."""

_MANY = 8
"""Names that a message has at most."""


def recordings_in(path: Path) -> list[Path]:
    """Recordings that lie in a folder that is none itself, or the sensors of one, in the order of their names."""
    if not path.is_dir() or is_one(path):
        return []
    if sensors := infineon.sensor_folders(path):
        return [path / name for name in sensors] if len(sensors) > 1 else []
    return sorted(place for place in path.iterdir() if _is_recording(place))


def is_one(path: Path) -> bool:
    """True for a folder that is a recording of one sensor, even if a part of it is missing."""
    is_native = any((path / name).is_file() for name in ("meta.json", "cube.npy"))
    return (is_native or infineon.is_recording(path)) and len(infineon.sensor_folders(path)) <= 1


def refuse_several(path: Path) -> None:
    """Refuse a folder with recordings in it, which does not say which of them is meant; of sensors others do."""
    found = recordings_in(path)
    if found and not infineon.sensor_folders(path):
        names = [place.name for place in found]
        listed = ", ".join(names[:_MANY]) + (f" and {len(names) - _MANY} more" if len(names) > _MANY else "")
        raise ValueError(
            f"{path}: expected one recording, got a folder with {listed}; give one of these, as {found[0]} "
            "(radarcore info describes them)"
        )


def _is_recording(place: Path) -> bool:
    if place.is_dir():
        return (place / "meta.json").is_file() or infineon.is_recording(place)
    return place.suffix.lower() in _FILES or is_setup(place)


@dataclass(frozen=True, eq=False)
class Recording(Stored):
    """Frames of one radar.

    Parameters
    ----------
    cube : (frame, channel, chirp, sample) complex64, complex128, float32 or float64
        Beat signal, I/Q or real; kept, not copied, as it may be large or on disk.
    time : (frame,) array_like
        Start of every frame [s], increasing.
    radar : Radar
    truth : Truth, optional
        Arrays (frame, body).
    source : dict
        Origin of the frames: anything JSON can hold. ``cube_unit`` is the unit of the samples, if not
        sqrt(W); "full scale" for samples of an ADC.
    lost : (frame,) array_like, optional
        Number of frames lost just before each; None if not counted. Frames have it in
        ``stats["lost_before"]``.

    See Also
    --------
    Recording.load : From disk.
    Simulator.record : A simulated one.
    Frame : One of its frames.

    Examples
    --------
    >>> radar = rc.bgt60tr13c()
    >>> recording = rc.Recording(np.zeros((4, 3, 64, 128), np.float32), time=0.025 * np.arange(4), radar=radar)
    >>> recording
    <Recording of 4 frames in 0.075 s: 3 channels x 64 chirps x 128 samples, float32>
    >>> recording[1]
    <Frame at 0.025 s: 3 channels x 64 chirps x 128 samples, float32>
    """

    _rows: ClassVar[NDArray[Any] | Converted]  # samples in memory or on disk, of each instance

    def __post_init__(self) -> None:
        check.instance("radar", self.radar, Radar)
        shape = None, *frame_shape(self.radar)
        if isinstance(self.cube, Converted):  # samples that `__getattr__` makes when they are used
            checked_cube(self.cube[:0], shape)
            object.__setattr__(self, "_rows", self.__dict__.pop("cube"))
        else:
            object.__setattr__(self, "cube", checked_cube(self.cube, shape))
            object.__setattr__(self, "_rows", self.cube)
        times = check.array("time", self.time, (len(self),))
        object.__setattr__(self, "time", check.in_order("time", times))
        check_truth(self.truth, (len(self),))
        if not isinstance(self.source, dict):
            raise TypeError(f"source: expected a dict, got {type(self.source).__name__}")
        if self.lost is not None:
            object.__setattr__(self, "lost", _counts("lost", self.lost, len(self)))

    def __getattr__(self, name: str) -> Any:
        if name != "cube" or "_rows" not in self.__dict__:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)
        object.__setattr__(self, "cube", self._rows[:])
        object.__setattr__(self, "_rows", self.cube)
        return self.cube

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of frames, channels, chirps and samples; reads no samples."""
        return self._rows.shape

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the samples; reads none."""
        return self._rows.dtype

    def __iter__(self) -> Iterator[Frame]:
        return self.frames()

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.cube, dtype=dtype, copy=copy)

    def __repr__(self) -> str:
        channels, chirps, samples = self.shape[1:]
        span = f" in {np.ptp(self.time):.6g} s" if len(self) > 1 else ""
        return (
            f"<Recording of {len(self)} frames{span}: {channels} channels x {chirps} chirps x {samples} samples, "
            f"{self.dtype}{bodies_text(self.truth)}>"
        )

    def _repr_html_(self) -> str:
        return html_table("Recording", facts_of_frames(self))

    @overload
    def __getitem__(self, frame_index: int) -> Frame: ...
    @overload
    def __getitem__(self, frame_index: slice) -> Recording: ...
    def __getitem__(self, frame_index: int | slice) -> Frame | Recording:
        """Frame at an index, or the recording of a slice of frames that follow each other; their cubes are views."""
        return self._part(frame_index) if isinstance(frame_index, slice) else self._frame(frame_index)

    def _part(self, frames: slice) -> Recording:
        """The recording of some frames."""
        if frames.step not in (None, 1):
            raise ValueError(f"frame_index: expected a slice of frames that follow each other, got step {frames.step}")
        truth = None if self.truth is None else self.truth[frames]
        lost = None if self.lost is None else self.lost[frames]
        return replace(self, cube=self._rows[frames], time=self.time[frames], truth=truth, lost=lost)

    def _frame(self, frame_index: int) -> Frame:
        """Frame at an index; negative ones count from the end."""
        if not -len(self) <= (index := check.count("frame_index", frame_index, -(2**63))) < len(self):
            raise IndexError(f"frame_index: expected an index into {len(self)} frames, got {frame_index}")
        index %= len(self)
        cube = self._rows[index : index + 1][0]
        stats: dict[str, Any] = {} if self.lost is None else {"lost_before": int(self.lost[index])}
        if not self._has_codes and (unit := self.source.get("cube_unit")) is not None:
            stats["cube_unit"] = unit
        return frame_of(
            cube,
            float(self.time[index]),
            self.radar,
            truth=None if self.truth is None else self.truth[index],
            stats=stats,
            raw=to_codes(cube) if self._has_codes else None,
        )

    @property
    def raw(self) -> NDArray[np.uint16] | None:
        """Codes of the ADC (frame, channel, chirp, sample), from 0 to 4095; None if the unit is not full scale.

        Nearest codes, computed again at every use: exact for samples that came from codes.
        """
        return to_codes(self.cube) if self._has_codes else None

    @property
    def _has_codes(self) -> bool:
        return self.source.get("cube_unit") == FULL_SCALE and self.dtype.kind == "f"

    def sequences(self) -> tuple[Recording, ...]:
        """Recordings of the sub-sequences, see `Frame.sequences`."""
        radars = self.radar.sequences()
        if len(radars) == 1:
            return (self,)
        parts = zip(radars, chirps_of(radars), strict=True)
        return tuple(replace(self, cube=self.cube[:, :, chirps], radar=radar) for radar, chirps in parts)

    def frames(self) -> Iterator[Frame]:
        """The frames in order, one at a time; few are in memory."""
        for first in range(0, len(self), _CHUNK):
            part = self[first : first + _CHUNK]
            for index in range(len(part)):
                yield part[index]

    def replay(self, *, speed: float | None = 1.0, loop: bool = False) -> Iterator[Frame]:
        """The frames in order, each when it is due: the first at once, the others by their times.

        Every frame is due at a time of its own on the clock, so that delays do not add up; a consumer that is late
        gets frames without waiting until it has caught up.

        Parameters
        ----------
        speed : float or None
            1: as recorded, 2: twice as fast; None: no waiting.
        loop : bool
            Begin again after the last frame, without end. Times of frames go on as if the recording did, an
            ordinary interval after the last.

        See Also
        --------
        Recording.frames : Without waiting.
        open_sensor : Frames of a board, in the same way.

        Examples
        --------
        >>> radar = rc.bgt60tr13c()
        >>> recording = rc.Recording(np.zeros((2, 3, 64, 128), np.float32), time=[0.0, 0.025], radar=radar)
        >>> [frame.time for frame in recording.replay(speed=10.0)]
        [0.0, 0.025]
        """
        rounds = self._rounds() if loop else self.frames()
        return rounds if speed is None else frames_when_due(rounds, check.positive("speed", speed))

    def _rounds(self) -> Iterator[Frame]:
        """Frames in endless rounds, with times that go on."""
        if len(self) == 0:
            return
        usual = usual_interval(self)
        length = float(np.ptp(self.time)) + usual
        start = 0.0
        while True:
            for frame in self.frames():
                yield replace(frame, time=start + frame.time)
            start += length

    @classmethod
    def from_frames(cls, frames: Iterable[Frame], source: dict[str, Any] | None = None) -> Recording:
        """Recording of frames of one radar with the same bodies and dtype.

        If `source` has no ``cube_unit``, the first frame gives it: full scale for codes of an ADC.

        See Also
        --------
        Simulator.record : Simulates many.
        Recording.save : Writes to disk.

        Examples
        --------
        >>> simulator = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), rc.bgt60tr13c())
        >>> recording = rc.Recording.from_frames(simulator.frame(time) for time in (0.0, 0.025))
        >>> len(recording)
        2
        """
        kept = list(frames)
        if not kept:
            raise ValueError("frames: expected at least one frame, got none")
        first, truth, lost = kept[0], None, None
        check.instance("frames[0]", first, Frame)
        for index, frame in enumerate(kept):
            check_alike(f"frames[{index}]", frame, first.radar, kind_of(first.cube, first.truth))
        if first.truth is not None:
            rows = ([getattr(frame.truth, name) for frame in kept] for name in TRUTH_FIELDS)
            truth = Truth(first.truth.names, *map(np.stack, rows))
        if any(frame.lost_before is not None for frame in kept):
            lost = np.array([frame.lost_before or 0 for frame in kept], np.int32)
        source = dict(source or {})
        if (unit := unit_of(first)) is not None:
            source.setdefault("cube_unit", unit)
        times = np.array([frame.time for frame in kept])
        return cls(np.stack([frame.cube for frame in kept]), times, first.radar, truth, source, lost)

    def save(self, path: str | os.PathLike[str], format: str | None = None, *, overwrite: bool = False) -> None:
        """Write to disk.

        Parameters
        ----------
        path : path
            A directory (no suffix) or an ``.npz`` file; missing parents are made.
        format : "npz" or "infineon", optional
            Default: by the suffix of `path`. ``"infineon"`` is the recording folder of Infineon's tools, for real
            samples in full scale of a BGT60TR13C: codes of the ADC and settings of the chip, with the values of a
            folder that was loaded. It holds no times of frames, no truth and no lost frames; warns if that matters.
        overwrite : bool
            Replace a recording that is already there.

        Raises
        ------
        FileExistsError
            When `path` exists and is not a recording to be overwritten.
        OSError
            When the place cannot be written to.
        ValueError
            When the format cannot hold this recording.

        See Also
        --------
        Recording.load : Reads it.
        RecordingWriter : Writes frame by frame.

        Examples
        --------
        >>> point = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])])
        >>> recording = rc.Simulator(point, rc.bgt60tr13c()).record(0.0, 0.1, rate=40.0, progress=False)
        >>> recording.save("point.npz")
        >>> len(rc.Recording.load("point.npz"))
        4
        """
        path = Path(path)
        kind = format_of(path) if format is None else check.choice("format", format, ("npz", "infineon"))
        save = {"npz": save_npz, "infineon": infineon.save, "directory": _save_directory}[kind]
        save(path, self, overwrite)

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        *,
        mmap: bool = True,
        radar: Radar | None = None,
        config: str | os.PathLike[str] | None = None,
        shape: str | Sequence[str] | None = None,
        dtype: str | None = None,
        variable: str | None = None,
        iq_order: str | None = None,
    ) -> Recording:
        """Read from disk; warns of no frames, and of frames that are missing because the writer was interrupted.

        Samples stay on disk until they are used: iterating keeps a few frames in memory, `cube` reads the rest.

        Parameters
        ----------
        path : path
            A recording's directory, an ``.npz`` file, or a recording folder of Infineon's tools: ``RadarIfxAvian_00``
            or its parent. Such a folder has no times of frames: they are multiples of the requested interval, with an
            error of up to a per mille. Bare samples, ``.npy``, ``.mat``, ``.npz`` or a raw file of numbers, together
            with `radar` or `config`: frames ``[frame, channel, chirp, sample]``, or one, at the frame interval;
            integers become float32 counts. A raw capture of TI's DCA1000, ``.bin``, with a `config` of TI, or its
            ``.setup.json``.
        mmap : bool
            Leave the samples on disk until they are used; the cube of a directory is mapped into memory, read-only.
        radar : Radar, optional
            Radar of bare samples; other recordings have their own.
        config : path, optional
            File with that radar: a scene file (TOML), the JSON of a radar or recording, ``config.json`` of Infineon's
            tools, or of a TI chip the ``.mmwave.json`` or ``.setup.json`` of mmWave Studio or the ``.cfg`` of the SDK's
            demo.
        shape : str or sequence, optional
            Axes of bare samples in the order of the file, as ``"frame,rx,chirp,sample"``, ``"chirp,tx,rx,sample"`` or
            ``"frame,chirp,rx,sample,iq"``.
        dtype : str, optional
            Type of the numbers of a raw file, as NumPy calls it: ``"int16"``, ``"uint16"``, ``">i2"``.
        variable : str, optional
            Name of the array in a ``.mat`` or ``.npz`` file with several.
        iq_order : "IQ" or "QI", optional
            Which of I and Q comes first in a capture of TI; default: as its configuration says. If it is wrong, targets
            are at the ranges of images.

        Raises
        ------
        FileNotFoundError
            When there is nothing at `path`.
        ValueError
            When it is not a recording, or several; of a newer version, damaged, or the arrays do not fit the radar; for
            bare samples without what they need.
        ImportError
            For a MAT file of version 7.3 without h5py.

        See Also
        --------
        Recording.save : Writes to disk.
        load_radar : Radar of a file.

        Examples
        --------
        >>> np.save("samples.npy", np.zeros((2, 3, 64, 128), np.int16))
        >>> rc.Recording.load("samples.npy", radar=rc.bgt60tr13c())
        <Recording of 2 frames in 0.025 s: 3 channels x 64 chirps x 128 samples, float32>
        """
        stored = _stored_at(Path(path), mmap, Description(radar, config, shape, dtype, variable, iq_order))
        with check.located(path):
            recording = cls(**vars(stored))
        if not mmap:
            recording.cube  # noqa: B018  # reads it
        return recording


def facts_of_frames(recording: Recording) -> dict[str, Any]:
    """Times, samples, truth and radar of a recording's frames, by name with unit."""
    times, truth = recording.time, recording.truth
    return {
        "frames": len(recording),
        "start [s]": float(times[0]) if len(recording) else None,
        "last frame [s]": float(times[-1]) if len(recording) else None,
        "cube [frame, channel, chirp, sample]": list(recording.shape),
        "dtype": str(recording.dtype),
        "bodies": None if truth is None else list(truth.names),
        **recording.radar.facts(),
    }


def _stored_at(path: Path, mmap: bool, description: Description) -> Stored:
    """Content of a recording on disk, unchecked; its cube may be converted on access."""
    if bare.is_bare(path, description):
        return bare.opened(path, description)
    description.refuse(path, "no bare file")
    refuse_several(path)
    if infineon.is_recording(path):
        return infineon.opened(path)
    if path.is_dir():
        return load_directory(path, mmap)
    if path.exists():
        return load_npz(path)
    raise FileNotFoundError(errno.ENOENT, "no such recording", str(path))


def _save_directory(path: Path, recording: Recording, overwrite: bool) -> None:
    source, num_frames = recording.source, len(recording)
    with RecordingWriter(path, recording.radar, num_frames=num_frames, source=source, overwrite=overwrite) as writer:
        open_as(writer, kind_of(recording.cube, recording.truth))  # also where there are no frames
        for frame in recording.frames():
            writer.append(frame)


def middles(recording: Recording, offset: float = 0.0) -> NDArray[np.float64]:
    """Middle of every frame, by a clock that is `offset` ahead [s]: ranges, velocities and truth hold there."""
    return np.asarray(recording.time) + recording.radar.middle + offset


def usual_interval(recording: Recording) -> float:
    """Ordinary interval of frames [s]."""
    steps = np.abs(np.diff(recording.time))
    return (float(np.median(steps)) if len(steps) > 0 else 0.0) or recording.radar.waveform.frame_interval


def frames_when_due(frames: Iterable[Frame], speed: float = 1.0) -> Iterator[Frame]:
    """Frames at their times [s] divided by `speed`, by the clock from the first frame."""
    start = first = None
    for frame in frames:
        if start is None or first is None:
            start, first = time.monotonic(), frame.time
        due = start + (frame.time - first) / speed
        while (wait := due - time.monotonic()) > 0.0:
            time.sleep(min(wait, 1.0))  # whole years overflow what the system's sleep takes
        yield frame


def _counts(name: str, values: ArrayLike, length: int) -> NDArray[np.int32]:
    given = np.asarray(values)
    if given.dtype.kind not in "iu":
        raise TypeError(f"{name}: expected integers of shape ({length},), got {given.dtype}")
    check.shaped(name, given, (length,))
    if given.size > 0 and not 0 <= int(given.min()) <= int(given.max()) < 2**31:
        raise ValueError(f"{name}: expected numbers of frames, from 0 on, got {given.min()} to {given.max()}")
    return given.astype(np.int32)


_CHUNK = 16
"""Frames that are read at once."""
