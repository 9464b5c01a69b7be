"""Motions of ROS: trees of transforms (TF), and the transforms, poses, rigid bodies and joints of a bag."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.adapters.depth import radar_in_camera
from radarcore.adapters.ros.bags import BagReader
from radarcore.adapters.ros.message_times import LATEST_FIRST, unpacked, warn_of_gap
from radarcore.adapters.ros.messages import header_nanoseconds, nanoseconds
from radarcore.adapters.ros.poses import (
    PoseSeries,
    SeriesRows,
    frame_name,
    joint_series,
    pose_numbers,
    pose_series,
    rigid_body_series,
)
from radarcore.check import near_names
from radarcore.geometry.pose import Pose
from radarcore.motion.group import Attached, Inverse
from radarcore.motion.protocol import Motion
from radarcore.records import sealed

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
        Messages of ``/tf_static``: the last one of a frame holds at all times and overrides ``/tf``.

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
            Of `radarcore.Trajectory`, such as ``extrapolate="hold"``.

        Raises
        ------
        ValueError
            For a frame that is not there, and for frames that no transforms connect.

        See Also
        --------
        adapters.ros.TransformTree.radar_motion : Of a radar at a camera.

        Examples
        --------
        >>> tree.motion("map", within="cart").at(0.2).position.round(3).tolist()
        [-0.2, 0.0, 0.0]
        """
        up, down = self.line("frame", frame), self.line("within", within)
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

        axes: "optical" or "link", axes of the camera's frame, see radar_in_camera; default: optical for a
        name that ends in ``_optical_frame``. Others as in `motion`.

        See Also
        --------
        adapters.ros.radar_in_camera : Pose of a radar at a camera.
        Simulator : Takes it as `radar_motion`.

        Examples
        --------
        >>> motion = tree.radar_motion("radar", within="map", axes="optical")
        >>> motion.at(0.0).rotation[:, 0].tolist()  # it looks along z of that frame
        [0.0, 0.0, 1.0]
        """
        if axes is None:
            axes = "optical" if camera.endswith(_OPTICAL) else "link"
        return _joined(self.motion(camera, within, start_ns=start_ns, **options), radar_in_camera(axes))

    def _product(self, line: list[str], start_ns: int, options: dict[str, Any]) -> Motion:
        """Motion of the first frame in a chain of children, in the parent of the last frame."""
        product: Motion = Pose()
        for child in line:
            series = self.series(child)
            own: Motion = series if isinstance(series, Pose) else series.trajectory(start_ns, **options)
            product = _joined(own, product)
        return product

    def line(self, argument: str, frame: str) -> list[str]:
        """A frame, its parent, and so on up to a root; errors name the argument."""
        line = [self._known(argument, frame)]
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
            raise ValueError(f"{argument}: no frame {name!r}; {near_names(name, frames)}")
        return name


def _joined(parent: Motion, own: Motion) -> Motion:
    """Motion relative to another, in as few parts as can be."""
    if isinstance(parent, Pose) and isinstance(own, Pose):
        return parent @ own
    if isinstance(own, Pose) and own == Pose():
        return parent
    return own if isinstance(parent, Pose) and parent == Pose() else Attached(parent, own)


TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
POSES = ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped", "nav_msgs/msg/Odometry")
RIGID_BODIES = ("mocap4r2_msgs/msg/RigidBodies", "mocap_msgs/msg/RigidBodies")
JOINTS = ("sensor_msgs/msg/JointState",)
IMAGES = ("sensor_msgs/msg/Image",)

STATIC_TRANSFORMS = "/tf_static"


class BagMotions:
    """Motions of a bag, by topic and name; for scene files with tables of kind ``"bag"``, or as truth.

    Times count from `start_ns`, so that they are exact to a nanosecond. They are the stamps in the headers. Wrong
    stamps are repaired with a warning: zeros, reception times, a second run (see the documentation of bags).

    Parameters
    ----------
    bag : BagReader
    start_ns : int, optional
        Stamp of time 0 [ns]; default: the first stamp in the header of a message, see `first_stamp_ns`.

    Attributes
    ----------
    bag : BagReader
    start_ns : int

    See Also
    --------
    load_scene : Scene files name motions of bags too.
    adapters.ros.TransformTree : Frames of TF.

    Examples
    --------
    >>> with rc.adapters.ros.BagWriter("poses") as bag:
    ...     for k in range(3):
    ...         pose = rc.Pose([0.1 * k, 0.0, 0.0])
    ...         message = rc.adapters.ros.to_pose_stamped(pose, time_ns=k * 10**8, types=bag.types)
    ...         bag.write("/ball", message, time_ns=k * 10**8)
    >>> with rc.adapters.ros.BagReader("poses") as bag:
    ...     ball = rc.adapters.ros.BagMotions(bag).motion("/ball")
    >>> print(ball.at(0.15).position.round(3))
    [0.15 0.   0.  ]
    """

    def __init__(self, bag: BagReader, *, start_ns: int | None = None) -> None:
        self.bag = bag
        self.start_ns: int = first_stamp_ns(bag) if start_ns is None else int(start_ns)
        self._trees: dict[str, TransformTree] = {}
        self._series: dict[str, Mapping[Any, PoseSeries]] = {}
        self._spans: list[tuple[float, float]] = []
        self._warned: set[str] = set()

    @property
    def span(self) -> tuple[float, float] | None:
        """First and last common time of all requested motions and joints [s]; None if none moves.

        Raises
        ------
        ValueError
            When they have none.
        """
        if not self._spans:
            return None
        start, stop = max(first for first, _ in self._spans), min(last for _, last in self._spans)
        if stop <= start:
            raise ValueError(
                f"{self.bag.path}: expected motions at the same time, got one that ends at {stop:g} s and one that "
                f"begins at {start:g} s"
            )
        return start, stop

    def motion(
        self,
        topic: str = "/tf",
        *,
        frame: str | None = None,
        within: str | None = None,
        extrapolate: str | None = None,
        max_gap: float | None = None,
    ) -> Motion:
        """Motion of a frame or body; a `Pose` where there is only one, or all transforms are static.

        Parameters
        ----------
        topic : str
            Of transforms, poses or rigid bodies.
        frame : str, optional
            Of transforms the frame, of rigid bodies the name; none for a topic of poses.
        within : str, optional
            Of transforms the frame in which it moves; default: the root of its tree.
        extrapolate : "hold", "continue" or "error", optional
            As for `radarcore.Trajectory`.
        max_gap : float, optional
            Intervals longer than this [s] are gaps, and times in them an error. Default: splines go through, with a
            warning of long ones.

        Raises
        ------
        ValueError
            For a missing topic, frame or body; the message lists the existing ones.

        See Also
        --------
        Trajectory : Most are of this kind.
        adapters.ros.BagMotions.joints : Positions of joints.

        Examples
        --------
        >>> print(rc.adapters.ros.BagMotions(bag).motion("/ball").at(0.1).position.round(3))
        [0.1 0.  0. ]
        """
        found = self.bag.topic(topic, *TRANSFORMS, *POSES, *RIGID_BODIES)
        if found.type in TRANSFORMS:
            return self._of_transforms(found.name, frame, within, {"extrapolate": extrapolate, "max_gap": max_gap})
        if within is not None:
            raise ValueError(f"within: expected none for {found.type}, got {within!r}")
        series = self._poses(found.name, found.type, frame)
        self._note(series.times(self.start_ns), found.name, max_gap)
        return series.trajectory(self.start_ns, extrapolate=extrapolate, max_gap=max_gap)

    def joints(
        self, topic: str = "/joint_states", names: Sequence[str] | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times (n,) [s] and positions (n, joint) [rad or m] of some joints (default: of all).

        See Also
        --------
        adapters.ros.joint_series : From messages.
        models.RobotArm : Arms that joints move.

        Examples
        --------
        >>> with rc.adapters.ros.BagWriter("arm") as bag:
        ...     head = rc.adapters.ros.to_pose_stamped(rc.Pose(), time_ns=0, types=bag.types).header
        ...     state = {"header": head, "name": ["elbow"], "position": np.array([0.5]), "velocity": [], "effort": []}
        ...     bag.write("/joint_states", state, time_ns=0, type="sensor_msgs/msg/JointState")
        >>> with rc.adapters.ros.BagReader("arm") as bag:
        ...     print(rc.adapters.ros.BagMotions(bag).joints())
        (array([0.]), array([[0.5]]))
        """
        found = self.bag.topic(topic, *JOINTS)
        series = joint_series(self.bag.messages(found.name), names)
        times = series.times(self.start_ns)
        self._note(times, found.name, None)
        return times, series.positions

    def _of_transforms(self, topic: str, frame: str | None, within: str | None, options: dict[str, Any]) -> Motion:
        tree = self._tree(topic)
        if frame is None:
            raise ValueError(f"frame: expected one of {', '.join(tree.frames) or 'none'} for {topic!r}, got none")
        line = tree.line("frame", frame)
        root = line[-1] if within is None else within
        for name in {*line, *tree.line("within", root)}:
            if tree.parent(name) is not None and isinstance(series := tree.series(name), PoseSeries):
                self._note(series.times(self.start_ns), f"{topic}, {name}", options["max_gap"])
        return tree.motion(frame, root, start_ns=self.start_ns, **options)

    def _tree(self, topic: str) -> TransformTree:
        if topic not in self._trees:
            has_static = STATIC_TRANSFORMS in self.bag.topics and topic != STATIC_TRANSFORMS
            static = self.bag.messages(STATIC_TRANSFORMS) if has_static else ()
            self._trees[topic] = TransformTree(self.bag.messages(topic), static)
        return self._trees[topic]

    def _poses(self, topic: str, kind: str, frame: str | None) -> PoseSeries:
        if kind in POSES and frame is not None:
            raise ValueError(f"frame: expected none for {kind}, got {frame!r}")
        if topic not in self._series:
            messages = self.bag.messages(topic)
            self._series[topic] = {None: pose_series(messages)} if kind in POSES else rigid_body_series(messages)
        bodies = self._series[topic]
        if frame not in bodies:
            got = "none" if frame is None else repr(frame)
            raise ValueError(f"frame: expected a body of {topic!r}, got {got}; {near_names(frame or '', bodies)}")
        return bodies[frame]

    def _note(self, times: NDArray[np.float64], name: str, max_gap: float | None) -> None:
        """Take the times of what moves into `span`; warn of the longest gap in them, once, if splines go through it."""
        if len(times) < 2:
            return
        self._spans.append((float(times[0]), float(times[-1])))
        if max_gap is None and name not in self._warned:
            self._warned.add(name)
            warn_of_gap(f"{self.bag.path}, {name}", times)


def first_stamp_ns(bag: BagReader) -> int:
    """First stamp in the headers of poses, transforms, joints and images [ns]; without any the time of the bag's start.

    Static transforms do not count, as they may be much older. Zero counts only at the start of a simulated clock.
    """
    kinds = {*TRANSFORMS, *POSES, *RIGID_BODIES, *JOINTS, *IMAGES}
    stamps: list[int] = []
    for topic in bag.topics.values():
        if topic.type in kinds and topic.name != STATIC_TRANSFORMS:
            first, *others = [_stamp(found.message) for found in islice(bag.messages(topic.name), 2)] or [0]
            is_set = first > 0 or any(0 < other < LATEST_FIRST for other in others)
            stamps += [first] if is_set else [other for other in others if other > 0]
    return min(stamps, default=bag.start_ns)


def _stamp(message: Any) -> int:
    """Stamp in the header, or the first nonzero stamp of the transforms [ns]; zero without any."""
    if hasattr(message, "transforms"):
        stamps = [nanoseconds(transform.header.stamp) for transform in message.transforms]
        return min((stamp for stamp in stamps if stamp > 0), default=0)
    return header_nanoseconds(message) or 0
