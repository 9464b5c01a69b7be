"""Comparison of two recordings and the truth on a common time base, target by target."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radarcore import check, notice
from radarcore.comparison.alignment import aligned, offsets
from radarcore.comparison.echoes import echo_difference
from radarcore.comparison.figure import draw
from radarcore.comparison.record import Record, Side, TargetComparison, differences
from radarcore.comparison.report import facts, html, text
from radarcore.comparison.targets import (
    Estimates,
    TargetErrors,
    dropped_frames,
    estimates,
    found_in,
    target_errors,
    truth_of,
)
from radarcore.comparison.truth import MovingTargets, RecordedTruth, TruthOverTime, with_names
from radarcore.motion.protocol import AnyMotion
from radarcore.output import check_file, write_text
from radarcore.plot.canvas import thing
from radarcore.processing.detection.point_cloud import Detections
from radarcore.recording.frame import Frame, Truth
from radarcore.recording.recording import Recording, middles

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AnyPath = str | os.PathLike[str]


class Comparison(Record):
    """Recordings and truth side by side, made by `radarcore.compare`; `str` gives the tables.

    See Also
    --------
    compare : Makes one.

    Examples
    --------
    >>> ball = rc.compare(recording, progress=False)["ball"]
    >>> ball.errors[0].num_frames, ball.errors[0].range.num_within
    (12, 12)
    """

    def __str__(self) -> str:
        return text(self)

    def to_dict(self) -> dict[str, Any]:
        """Everything except the series as plain numbers and texts, for JSON; None for unknown values.

        See Also
        --------
        Comparison.report : Tables and pictures for people.

        Examples
        --------
        >>> sorted(rc.compare(recording, progress=False).to_dict())
        ['differences', 'recordings', 'targets', 'truth']
        """
        return facts(self)

    def figure(
        self,
        path: AnyPath | None = None,
        *,
        time: float | None = None,
        max_range: float | None = None,
        overwrite: bool = False,
    ) -> Figure:
        """Range-velocity maps side by side, and range and velocity of both recordings over the truth.

        Parameters
        ----------
        path : path, optional
            Save here, in the format of the suffix; missing parents are made.
        time : float, optional
            Common time of the maps [s]; default: the middle of the recordings' overlap.
        max_range : float, optional
            End of the range axes [m]; default: 15 % above the farthest target.
        overwrite : bool
            Replace an existing picture.
        """
        return draw(self, path, time=time, max_range=max_range, overwrite=overwrite)

    def report(
        self, path: AnyPath, *, time: float | None = None, max_range: float | None = None, overwrite: bool = False
    ) -> None:
        """Write tables and pictures as one self-contained HTML file.

        Parameters
        ----------
        path : path
            Missing parents are made.
        time, max_range
            As in `figure`.
        overwrite : bool
            Replace an existing report.
        """
        check_file(Path(path), overwrite=overwrite, kind=".html")
        write_text(Path(path), html(self, time=time, max_range=max_range), overwrite=overwrite)


def compare(
    recording_a: Recording | AnyPath,
    recording_b: Recording | AnyPath | None = None,
    truth: Mapping[str, Any] | Recording | AnyPath | None = None,
    *,
    targets: Sequence[str] | Mapping[str, str] | None = None,
    radar_motion: AnyMotion | None = None,
    radii: Mapping[str, float] | None = None,
    offset: float | str | tuple[float | str, float | str] = 0.0,
    max_offset: float | None = None,
    names: Sequence[str] | None = None,
    detector: Callable[[Frame], Detections] | None = None,
    range_only: bool = False,
    progress: bool = True,
) -> Comparison:
    """Compare a recording with another recording, with the truth, or with both, target by target.

    Each recording is detected and tracked separately. Each track is then assigned to the target with the nearest truth
    over the whole track. An object with parts, such as a person, has one track for the whole run, whose nearest point
    is compared with the nearest visible point of all parts.

    Parameters
    ----------
    recording_a, recording_b : Recording or path
        Of any radars: I/Q or real, simulated or measured. A note names quantities that the settings make incomparable.
    truth : mapping, Recording or path, optional
        Motions in the world, bodies or point targets by name; or a recording with truth. The true point of a body is
        its nearest point, of a motion its origin, see `radii`. Default: each recording's own truth; B without truth
        uses A's. Without any truth, the tracks of A are the targets of B. A motion has no truth at times when it is
        unknown (its method ``known``).
    targets : sequence of str or mapping, optional
        Targets to compare; a mapping gives the body of each by name. Default: all visible targets; for an object with
        parts, the part that is visible longest.
    radar_motion : motion, optional
        Sensor to world, for motions in the world; default: the sensor frame is the world frame.
    radii : mapping, optional
        Distance by name from the origin of a motion to the target's surface, towards the radar [m].
    offset : float, "auto" or a pair of them
        Time of the truth (and of A) minus time of the last recording, B or A alone [s]. A pair has the offsets of A and
        B. "auto" estimates the offset from detections and truth, which needs targets with changing velocity.
    max_offset : float, optional
        Largest estimated offset [s]. Default: half of the recording or of the truth must remain in common.
    names : (str, str), optional
        Names of the recordings in tables and pictures; default: the names of their paths, or A and B.
    detector : callable, optional
        Detections of a frame; default: `detect` with less than one false alarm per frame.
    range_only : bool
        Track ranges and velocities without angles, for radars with uncalibrated receiver phases.
    progress : bool
        Show progress bars when run in a terminal.

    Returns
    -------
    comparison : Comparison
        Tables (`str`), `figure`, `report` (HTML), `to_dict` (JSON) and all series.

    Raises
    ------
    ValueError
        For a single recording without truth, unknown names, or an offset that cannot be estimated.

    See Also
    --------
    Comparison : The result.
    detect : Detections of a frame.
    track : Tracks of a recording.

    Examples
    --------
    >>> scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[-0.5, 0.0, 0.0], name="ball")])
    >>> simulated, noisy = (
    ...     rc.Simulator(scene, rc.bgt60tr13c(num_chirps=32), seed=seed).record(0.0, 0.3, progress=False)
    ...     for seed in (0, 1)
    ... )
    >>> ball = rc.compare(simulated, noisy, progress=False)["ball"]
    >>> ball.errors[1].num_frames, ball.errors[1].range.num_within, round(abs(ball.echo.ratio_db), 1)
    (12, 12, 0.0)
    """
    given = [one for one in (recording_a, recording_b) if one is not None]
    recordings = [_loaded(f"recording_{letter}", one) for letter, one in zip("ab", given, strict=False)]
    shown = _names(given, names)
    reference, source = _reference(truth, radar_motion, radii)
    wanted = offsets(offset, len(recordings))
    if reference is None and len(recordings) == 1 and recordings[0].truth is None:
        raise ValueError("recording_b: expected another recording, or a truth to compare with, got neither")

    # Detections and tracks of each recording, on a common time base.
    found = [found_in(one, detector=detector, range_only=range_only, progress=progress) for one in recordings]
    base = aligned(found, wanted, reference, max_offset)
    times = [middles(one.recording, clock.seconds) for one, clock in zip(found, base.clocks, strict=True)]
    truths = [known.at(time) for known, time in zip(base.truths, times, strict=True)]
    bodies = tuple(dict.fromkeys(name for own in truths for name in own.names))
    sides = []
    for name, one, clock, time, own in zip(shown, found, base.clocks, times, truths, strict=True):
        dropped = dropped_frames(one.recording, clock.seconds)
        sides.append(Side(name, one, clock, dropped, time, with_names(own, bodies)))
    _warn_of_nothing(sides)

    # Target by target.
    chosen = _targets(targets, sides)
    estimated = [estimates(side.found, side.truth, chosen.values(), side.offset.seconds) for side in sides]
    compared = [
        _target(name, body, sides, [one[body] for one in estimated], not base.is_by_tracks)
        for name, body in chosen.items()
    ]
    return Comparison(
        tuple(sides),
        tuple(compared),
        differences(recordings[0].radar, recordings[1].radar) if len(recordings) == 2 else (),
        "" if base.is_by_tracks else source,
    )


def _loaded(name: str, given: Any) -> Recording:
    """The recording, read if it is a path; raises ValueError without frames."""
    recording = Recording.load(given) if isinstance(given, str | os.PathLike) else given
    if not isinstance(recording, Recording):
        raise TypeError(f"{name}: expected Recording or a path, got {type(given).__name__}")
    if len(recording) == 0:
        raise ValueError(f"{name}: expected at least one frame, got none")
    if recording.radar.waveform.is_cw:
        raise ValueError(f"{name}: expected a radar that measures ranges, got one without a sweep")
    return recording


def _names(given: Sequence[Any], names: Sequence[str] | None) -> tuple[str, ...]:
    """Names of the recordings: the given names, names of their paths if they differ, or letters."""
    if names is not None:
        if isinstance(names, str) or len(names) != len(given):
            raise ValueError(f"names: expected {len(given)}, one per recording, got {names!r}")
        if len(set(map(str, names))) < len(names):
            raise ValueError(f"names: expected names that differ, got {', '.join(map(repr, map(str, names)))}")
        return tuple(map(str, names))
    of_paths = [Path(one).resolve().stem for one in given if isinstance(one, str | os.PathLike)]
    return tuple(of_paths) if len(set(of_paths)) == len(given) else ("A", "B")[: len(given)]


def _reference(
    truth: Any, radar_motion: AnyMotion | None, radii: Mapping[str, float] | None
) -> tuple[TruthOverTime | None, str]:
    """The given truth, if any, and its description."""
    if isinstance(truth, Mapping):
        return MovingTargets(truth, radar_motion, radii), "motions in the world"
    for name, value in (("radar_motion", radar_motion), ("radii", radii)):
        if value is not None:
            raise TypeError(f"{name}: expected none without a truth of motions in the world, got one")
    if truth is None:
        return None, "the recordings' own"
    recording = _loaded("truth", truth)
    if recording.truth is None:
        raise ValueError("truth: expected a recording with truth, got one without")
    return RecordedTruth(middles(recording), recording.truth), "another recording's"


def _warn_of_nothing(sides: Sequence[Side]) -> None:
    """Warn if tables remain empty: recordings without overlap, no truth, or no track."""
    spans = [f"{side.name} from {side.time[0]:.3f} to {side.time[-1]:.3f} s" for side in sides]
    if len(sides) == 2 and (sides[0].time[-1] < sides[1].time[0] or sides[1].time[-1] < sides[0].time[0]):
        notice.warn(f"offset: expected recordings with times in common, got {' and '.join(spans)}")
    for side, span in zip(sides, spans, strict=True):
        if len(side.found.tracks) == 0:
            notice.warn(f"{side.name}: expected at least one track, got none in {len(side.time)} frames")
        elif not np.isfinite(side.truth.range).any():
            notice.warn(f"truth: expected some body in front of the radar at the times of {span}, got none")
        elif (nearest := float(np.nanmin(side.truth.range))) > (
            limit := side.found.recording.radar.max_unambiguous_range
        ):
            notice.warn(
                f"truth: expected ranges below {limit:.4g} m, the max_unambiguous_range of {side.name}, "
                f"got {nearest:.4g} m or more; are its lengths in metres?"
            )


def _targets(targets: Sequence[str] | Mapping[str, str] | None, sides: Sequence[Side]) -> dict[str, str]:
    """Body of every target, by the target's name."""
    known = sides[0].truth.names  # names of all sides
    if targets is not None:
        if isinstance(targets, str):
            raise TypeError(f"targets: expected several names, got the text {targets!r}")
        chosen = dict(targets) if isinstance(targets, Mapping) else {str(name): str(name) for name in targets}
        for body in chosen.values():
            if body not in known:
                raise ValueError(
                    f"targets: expected bodies of the truth, got {body!r}; {check.near_names(body, known)}"
                )
        return chosen
    counts = np.sum([np.isfinite(side.truth.range).sum(axis=0) for side in sides], axis=0)
    visible = dict(zip(known, counts.tolist(), strict=True))
    longest: dict[str, str] = {}
    for name, number in visible.items():
        owner = thing(name)
        if number > 0 and (owner not in longest or number > visible[longest[owner]]):
            longest[owner] = name
    return longest


def _target(
    name: str, body: str, sides: Sequence[Side], estimated: Sequence[Estimates], has_truth: bool
) -> TargetComparison:
    """Errors and echoes of one target from its estimates in every recording."""
    true = [truth_of(side.truth, body) for side in sides]
    errors = [
        target_errors(name, one, known, side.bins) for one, known, side in zip(estimated, true, sides, strict=True)
    ]
    is_both = len(sides) == 2
    return TargetComparison(
        name=name,
        estimates=tuple(estimated),
        truth=tuple(true) if has_truth else None,
        errors=tuple(errors) if has_truth else (),
        difference=_difference(name, estimated, sides) if is_both else None,
        echo=echo_difference([side.recording for side in sides], estimated) if is_both else None,
    )


def _difference(name: str, estimated: Sequence[Estimates], sides: Sequence[Side]) -> TargetErrors:
    """Estimates of B against A; A is interpolated between its frames."""
    a, b = estimated
    unknown = np.full((len(a.time), 1), np.nan)
    joined = RecordedTruth(a.time, Truth((name,), a.range[:, None], a.velocity[:, None], unknown, unknown)).at(b.time)
    return target_errors(name, b, (joined.range[:, 0], joined.velocity[:, 0]), sides[1].bins)
