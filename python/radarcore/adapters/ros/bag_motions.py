"""Motions that a bag holds: frames of TF, poses, rigid bodies of motion capture, joints of robots."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.adapters.ros.bags import BagReader
from radarcore.adapters.ros.message_times import LATEST_FIRST, warn_of_gap
from radarcore.adapters.ros.poses import PoseSeries, joint_series, pose_series, rigid_body_series
from radarcore.adapters.ros.stamps import header_nanoseconds, nanoseconds
from radarcore.adapters.ros.transforms import TransformTree
from radarcore.check import near_names
from radarcore.motion.protocol import Motion

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
        self._series: dict[tuple[str, str | None], PoseSeries] = {}
        self._spans: list[tuple[float, float]] = []
        self._told: set[str] = set()

    @property
    def span(self) -> tuple[float, float] | None:
        """First and last time that all motions and joints asked for so far have in common [s]; None if none moves.

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
        beyond: str | None = None,
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
        beyond : "hold", "continue" or "error", optional
            As for `radarcore.Trajectory`.
        max_gap : float, optional
            Intervals longer than this [s] are gaps, and times in them an error. Default: splines go through, with a
            warning of long ones.

        Raises
        ------
        ValueError
            For a topic, frame or body that is not there: names those that are.

        See Also
        --------
        Trajectory : Most are of this kind.
        adapters.ros.BagMotions.joints : Positions of joints.

        Examples
        --------
        >>> with rc.adapters.ros.BagWriter("moving") as bag:
        ...     for k in range(3):
        ...         pose = rc.Pose([0.1 * k, 0.0, 0.0])
        ...         message = rc.adapters.ros.to_pose_stamped(pose, time_ns=k * 10**8, types=bag.types)
        ...         bag.write("/ball", message, time_ns=k * 10**8)
        >>> with rc.adapters.ros.BagReader("moving") as bag:
        ...     print(rc.adapters.ros.BagMotions(bag).motion("/ball").at(0.1).position.round(3))
        [0.1 0.  0. ]
        """
        found = self.bag.topic(topic, *TRANSFORMS, *POSES, *RIGID_BODIES)
        if found.type in TRANSFORMS:
            return self._of_transforms(found.name, frame, within, {"beyond": beyond, "max_gap": max_gap})
        if within is not None:
            raise ValueError(f"within: expected none for {found.type}, got {within!r}")
        series = self._poses(found.name, found.type, frame)
        self._note(series.times(self.start_ns), found.name, max_gap)
        return series.trajectory(self.start_ns, beyond=beyond, max_gap=max_gap)

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
        line = _line(tree, frame)
        root = line[-1] if within is None else within
        for name in {*line, *_line(tree, root)}:
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
        key = (topic, frame)
        if key not in self._series:
            messages = self.bag.messages(topic)
            if kind in POSES:
                if frame is not None:
                    raise ValueError(f"frame: expected none for {kind}, got {frame!r}")
                self._series[key] = pose_series(messages)
            else:
                bodies = rigid_body_series(messages)
                if frame not in bodies:
                    got = "none" if frame is None else repr(frame)
                    raise ValueError(
                        f"frame: expected a body of {topic!r}, got {got}; {near_names(frame or '', bodies)}"
                    )
                self._series[key] = bodies[frame]
        return self._series[key]

    def _note(self, times: NDArray[np.float64], name: str, max_gap: float | None) -> None:
        """Take the times of what moves into `span`; warn of the longest gap in them, once, if splines go through it."""
        if len(times) < 2:
            return
        self._spans.append((float(times[0]), float(times[-1])))
        if max_gap is None and name not in self._told:
            self._told.add(name)
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


def _line(tree: TransformTree, frame: str) -> list[str]:
    """A frame, its parent, and so on up to the root."""
    line = [frame]
    while (parent := tree.parent(line[-1])) is not None:
        line.append(parent)
    return line
