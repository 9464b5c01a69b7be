"""Frames of live motion capture, and takes of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from radarcore.adapters.optitrack.axes import positions_of, quaternions_of
from radarcore.adapters.optitrack.capture import CapturedBody, MotionCapture
from radarcore.adapters.optitrack.stream import BodyState
from radarcore.geometry.pose import Pose


@dataclass(frozen=True)
class CapturedFrame:
    """A frame of live motion capture.

    Attributes
    ----------
    number : int
        Of the frame; those between are lost.
    time : float
        Middle of the exposure, by the server's clock [s].
    bodies : mapping of str to BodyState
        Rigid bodies, and bones as ``skeleton:bone``, by name, in Motive's axes.
    poses : mapping of str to Pose
        Of the bodies that are tracked, in the axes of the client.
    received : float
        Time at which the frame came, as of `time.time` [s].

    See Also
    --------
    adapters.optitrack.MotionCaptureClient.frames : They come from there.

    Examples
    --------
    >>> motions = {"ball": rc.Linear(rc.Pose([2.0, 0.0, 1.0]), velocity=[-0.5, 0.0, 0.0])}
    >>> with rc.adapters.optitrack.MotionCaptureServer(motions) as server:
    ...     with rc.adapters.optitrack.MotionCaptureClient(command_port=server.command_port) as client:
    ...         frames = client.frames()
    ...         server.send(0.5)
    ...         frame = next(frames)
    >>> print(frame.time, frame.bodies["ball"].is_tracked)
    0.5 True
    """

    number: int
    time: float
    bodies: Mapping[str, BodyState]
    poses: Mapping[str, Pose]
    received: float


def poses_of(bodies: Mapping[str, BodyState], axes: str) -> dict[str, Pose]:
    """Poses of the bodies that are tracked, in radarcore's world."""
    poses = {}
    for name, body in bodies.items():
        if body.is_tracked:
            position = positions_of(np.array(body.position), axes)
            poses[name] = Pose.from_quaternion(position, wxyz=quaternions_of(np.array(body.quaternion), axes))
    return poses


def one_take(frames: Iterator[CapturedFrame]) -> Iterator[CapturedFrame]:
    """Frames up to the end of a take: until it starts again, or no more frames come."""
    last: CapturedFrame | None = None
    try:
        for frame in frames:
            if last is not None and frame.time < last.time:
                return
            last = frame
            yield frame
    except TimeoutError:
        if last is None:
            raise


def without_poses(frame: CapturedFrame) -> CapturedFrame:
    """The frame without poses, a tenth as large: a capture needs only its bodies."""
    return replace(frame, poses={})


def capture_of(frames: list[CapturedFrame], axes: str) -> MotionCapture:
    """Frames as a take; NaN where a body is not tracked."""
    names = list(dict.fromkeys(name for frame in frames for name in frame.bodies))
    bodies = {}
    for name in names:
        rows = np.full((len(frames), 8), np.nan)
        for k, frame in enumerate(frames):
            state = frame.bodies.get(name)
            if state is not None and state.is_tracked:
                rows[k] = [*state.position, *state.quaternion, state.mean_marker_error]
        bodies[name] = CapturedBody(positions_of(rows[:, :3], axes), quaternions_of(rows[:, 3:7], axes), rows[:, 7])
    times = np.array([frame.time for frame in frames])
    rate = float(1.0 / np.median(np.diff(times))) if len(times) > 1 else None
    return MotionCapture(time=times, bodies=bodies, frame_rate=rate)
