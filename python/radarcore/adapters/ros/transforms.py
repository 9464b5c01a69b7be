"""Trees of transforms (TF): the motion of any frame in any other."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from radarcore import check
from radarcore.adapters.planar_depth import radar_in_camera
from radarcore.adapters.ros.message_times import unpacked
from radarcore.adapters.ros.poses import PoseSeries, SeriesRows, frame_name, pose_numbers
from radarcore.adapters.ros.stamps import nanoseconds
from radarcore.geometry.pose import Pose
from radarcore.motion.attached import Attached
from radarcore.motion.inverse import Inverse
from radarcore.motion.protocol import Motion
from radarcore.sealed import sealed

_OPTICAL = "_optical_frame"
"""End of the names of frames with z forward (REP 103)."""


@sealed
class TransformTree:
    """Frames and the transforms between them, of ``tf2_msgs/TFMessage``.

    Parameters
    ----------
    messages : iterable of tf2_msgs/TFMessage
        Messages of ``/tf``, as for `pose_series`.
    static : iterable of tf2_msgs/TFMessage
        Those of ``/tf_static``: the last one of a frame holds at all times, whatever ``/tf`` says of it.

    Raises
    ------
    ValueError
        For a frame with two parents, or whose parents form a circle, when it is used; others stay usable.

    See Also
    --------
    adapters.ros.BagMotions.motion : The same from a bag.
    Attached : A motion on another.

    Examples
    --------
    >>> to_transforms = rc.adapters.ros.to_transforms
    >>> poses = [rc.Pose([0.1 * k, 0.0, 0.0]) for k in range(3)]
    >>> moving = [to_transforms({"cart": pose}, time_ns=k * 10**8, frame_id="map") for k, pose in enumerate(poses)]
    >>> still = [to_transforms({"radar": rc.Pose([0.0, 0.0, 0.5])}, time_ns=0, frame_id="cart")]
    >>> tree = rc.adapters.ros.TransformTree(moving, still)
    >>> tree.motion("radar", within="map").at(0.1).position.round(3).tolist()
    [0.1, 0.0, 0.5]
    """

    def __init__(self, messages: Iterable[Any] = (), static: Iterable[Any] = ()) -> None:
        self._parents: dict[str, str] = {}
        self._other_parents: dict[str, str] = {}
        self._still: dict[str, Pose] = {child: rows.last() for child, rows in self._collected(static).items()}
        self._moving: dict[str, SeriesRows] = self._collected(messages)
        self._series: dict[str, PoseSeries] = {}

    def _collected(self, messages: Iterable[Any]) -> dict[str, SeriesRows]:
        """Poses of every child frame."""
        topic, given = unpacked(messages)
        found: dict[str, SeriesRows] = {}
        for message, received in given:
            for transform in message.transforms:
                child, parent = frame_name(transform.child_frame_id), frame_name(transform.header.frame_id)
                if self._parents.setdefault(child, parent) != parent:
                    self._other_parents.setdefault(child, parent)
                rows = found.setdefault(child, SeriesRows(f"{topic}, {child}"))
                rows.add(nanoseconds(transform.header.stamp), received, pose_numbers(transform))
        return found

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of all frames, sorted."""
        return tuple(sorted({*self._parents, *self._parents.values()}))

    def parent(self, frame: str) -> str | None:
        """Parent of a frame; None for a root.

        See Also
        --------
        adapters.ros.TransformTree.series : Poses in the parent.

        Examples
        --------
        >>> to_transforms = rc.adapters.ros.to_transforms
        >>> poses = [rc.Pose([0.1 * k, 0.0, 0.0]) for k in range(3)]
        >>> moving = [to_transforms({"cart": pose}, time_ns=k * 10**8, frame_id="map") for k, pose in enumerate(poses)]
        >>> still = [to_transforms({"radar": rc.Pose([0.0, 0.0, 0.5])}, time_ns=0, frame_id="cart")]
        >>> tree = rc.adapters.ros.TransformTree(moving, still)
        >>> tree.parent("radar"), tree.parent("map")
        ('cart', None)
        """
        return self._parent(self._known("frame", frame))

    def series(self, frame: str) -> PoseSeries | Pose:
        """Poses of a frame in its parent, at times repaired as by `pose_series`; one pose for a static frame.

        See Also
        --------
        adapters.ros.TransformTree.motion : In any other frame.

        Examples
        --------
        >>> to_transforms = rc.adapters.ros.to_transforms
        >>> poses = [rc.Pose([0.1 * k, 0.0, 0.0]) for k in range(3)]
        >>> moving = [to_transforms({"cart": pose}, time_ns=k * 10**8, frame_id="map") for k, pose in enumerate(poses)]
        >>> still = [to_transforms({"radar": rc.Pose([0.0, 0.0, 0.5])}, time_ns=0, frame_id="cart")]
        >>> tree = rc.adapters.ros.TransformTree(moving, still)
        >>> tree.series("cart").times().tolist()
        [0.0, 0.1, 0.2]
        """
        name = self._known("frame", frame)
        parent = self._parent(name)
        if parent is None:
            raise ValueError(f"frame: expected one with a parent, got the root {name!r}")
        if name in self._still:
            return self._still[name]
        if name not in self._series:
            self._series[name] = self._moving[name].series(parent)
        return self._series[name]

    def motion(self, frame: str, within: str, *, start_ns: int = 0, **options: Any) -> Motion:
        """Motion of a frame in another one: a `Pose` where all between them is static.

        Every moving transform on the way is a `radarcore.Trajectory`, a C2 spline of position and rotation: unlike
        TF's own interpolation between two stamps it has no steps in velocity.

        Parameters
        ----------
        frame, within : str
            Names of frames.
        start_ns : int
            Stamp that counts as time 0 [ns]. With 0 times are seconds since 1970, good to 0.2 us.
        **options
            Of `radarcore.Trajectory`, such as ``beyond="hold"``.

        Raises
        ------
        ValueError
            For a frame that is not there, and for frames that no transforms connect.

        See Also
        --------
        adapters.ros.TransformTree.radar_motion : Of a radar at a camera.

        Examples
        --------
        >>> to_transforms = rc.adapters.ros.to_transforms
        >>> poses = [rc.Pose([0.1 * k, 0.0, 0.0]) for k in range(3)]
        >>> moving = [to_transforms({"cart": pose}, time_ns=k * 10**8, frame_id="map") for k, pose in enumerate(poses)]
        >>> still = [to_transforms({"radar": rc.Pose([0.0, 0.0, 0.5])}, time_ns=0, frame_id="cart")]
        >>> tree = rc.adapters.ros.TransformTree(moving, still)
        >>> tree.motion("map", within="cart").at(0.2).position.round(3).tolist()
        [-0.2, 0.0, 0.0]
        """
        up, down = self._line(self._known("frame", frame)), self._line(self._known("within", within))
        common = next((name for name in up if name in down), None)
        if common is None:
            raise ValueError(
                f"within: expected a frame that transforms connect with {up[0]!r}, got {down[0]!r}: the one hangs on "
                f"{up[-1]!r}, the other on {down[-1]!r}, and nothing joins them"
            )
        forth, back = (self._product(line[: line.index(common)], start_ns, options) for line in (up, down))
        return _joined(back.inverse() if isinstance(back, Pose) else Inverse(back), forth)

    def radar_motion(
        self, camera: str, within: str, *, axes: str | None = None, start_ns: int = 0, **options: Any
    ) -> Motion:
        """Motion of a radar that sits at a camera's frame and looks where the camera looks.

        `axes`: ``"optical"`` or ``"link"``, those of the camera's frame, see `radar_in_camera`; default: optical for a
        name that ends in ``_optical_frame``. Others as in `motion`.

        See Also
        --------
        adapters.ros.radar_in_camera : Pose of a radar at a camera.
        Simulator : Takes it as `radar_motion`.

        Examples
        --------
        >>> to_transforms = rc.adapters.ros.to_transforms
        >>> poses = [rc.Pose([0.1 * k, 0.0, 0.0]) for k in range(3)]
        >>> moving = [to_transforms({"cart": pose}, time_ns=k * 10**8, frame_id="map") for k, pose in enumerate(poses)]
        >>> still = [to_transforms({"radar": rc.Pose([0.0, 0.0, 0.5])}, time_ns=0, frame_id="cart")]
        >>> tree = rc.adapters.ros.TransformTree(moving, still)
        >>> motion = tree.radar_motion("radar", within="map", axes="optical")
        >>> motion.at(0.0).rotation[:, 0].tolist()  # it looks along z of that frame
        [0.0, 0.0, 1.0]
        """
        if axes is None:
            axes = "optical" if camera.endswith(_OPTICAL) else "link"
        return _joined(self.motion(camera, within, start_ns=start_ns, **options), radar_in_camera(axes))

    def _product(self, line: list[str], start_ns: int, options: dict[str, Any]) -> Motion:
        """Motion of the first frame of a line of children in the parent of the last."""
        product: Motion = Pose()
        for child in line:
            series = self.series(child)
            own: Motion = series if isinstance(series, Pose) else series.trajectory(start_ns, **options)
            product = _joined(own, product)
        return product

    def _line(self, frame: str) -> list[str]:
        """A frame, its parent, and so on up to a root."""
        line = [frame]
        while (parent := self._parent(line[-1])) is not None:
            if parent in line:
                raise ValueError(f"messages: expected a tree of frames, got the circle {' < '.join([*line, parent])}")
            line.append(parent)
        return line

    def _parent(self, frame: str) -> str | None:
        """Parent of a frame, None of a root; a ValueError for a frame with two."""
        parent = self._parents.get(frame)
        if frame in self._other_parents:
            raise ValueError(
                f"messages: expected one parent of {frame!r}, got {parent!r} and {self._other_parents[frame]!r}"
            )
        return parent

    def _known(self, argument: str, frame: str) -> str:
        name = frame_name(frame)
        if name not in (frames := self.frames):
            near = check.near(name, frames)
            meant = f"did you mean {' or '.join(map(repr, near))}? " if near else ""
            raise ValueError(f"{argument}: no frame {name!r}; {meant}there is {', '.join(frames) or 'none'}")
        return name


def _joined(parent: Motion, own: Motion) -> Motion:
    """Motion relative to another, in as few parts as can be."""
    if isinstance(parent, Pose) and isinstance(own, Pose):
        return parent @ own
    if isinstance(own, Pose) and own == Pose():
        return parent
    return own if isinstance(parent, Pose) and parent == Pose() else Attached(parent, own)
