"""Poses and joint angles of ROS: single messages to poses and back, and series of messages to motions.

Motion capture comes in such series: ``mocap_optitrack`` sends PoseStamped on ``NAME/pose``, ``natnet_ros_cpp`` on
``/natnet_ros/NAME/pose``, MOCAP4ROS2 sends ``mocap4r2_msgs/RigidBodies``. Some nodes use another world, or swap axes
depending on the version of Motive: ``rc.Attached(world_from_mocap, series.trajectory())`` corrects them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.adapters.ros.message_times import message_times, unpacked, warn_of_gap
from radarcore.adapters.ros.messages import Types, header, header_nanoseconds, make, seconds
from radarcore.geometry.pose import Pose, as_pose, transforms
from radarcore.geometry.rotation import quaternion_of, rotations_of
from radarcore.motion.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class PoseSeries:
    """Poses of a frame or body in another frame, by increasing time.

    Attributes
    ----------
    times_ns : (n,) int64
        Stamps [ns]; of equal ones the first counts, as in TF.
    poses : tuple of Pose
        One per stamp.
    frame_id : str
        Frame that the poses are in.

    See Also
    --------
    adapters.ros.pose_series : Makes one.
    Trajectory : A motion through poses.

    Examples
    --------
    >>> poses = [rc.Pose([2.0 - 0.1 * k, 0.0, 0.0]) for k in range(4)]
    >>> messages = [rc.adapters.ros.to_pose_stamped(pose, time_ns=k * 100_000_000) for k, pose in enumerate(poses)]
    >>> series = rc.adapters.ros.pose_series(messages)
    >>> series.times().tolist(), series.trajectory().at(0.15).position.round(3).tolist()
    ([0.0, 0.1, 0.2, 0.3], [1.85, 0.0, 0.0])
    """

    times_ns: NDArray[np.int64]
    poses: tuple[Pose, ...]
    frame_id: str = ""

    def __post_init__(self) -> None:
        times = np.asarray(self.times_ns, dtype=np.int64)
        if times.shape != (len(self.poses),):
            raise ValueError(f"times_ns: expected shape ({len(self.poses)},), one per pose, got {times.shape}")
        times, order = np.unique(times, return_index=True)
        times.flags.writeable = False
        object.__setattr__(self, "times_ns", times)
        object.__setattr__(self, "poses", tuple(self.poses[k] for k in order.tolist()))

    def __len__(self) -> int:
        return len(self.poses)

    def times(self, start_ns: int = 0) -> NDArray[np.float64]:
        """Times since `start_ns` [s], (n,).

        See Also
        --------
        adapters.ros.PoseSeries.trajectory : The motion.

        Examples
        --------
        >>> poses = [rc.Pose([2.0 - 0.1 * k, 0.0, 0.0]) for k in range(4)]
        >>> messages = [rc.adapters.ros.to_pose_stamped(pose, time_ns=k * 100_000_000) for k, pose in enumerate(poses)]
        >>> rc.adapters.ros.pose_series(messages).times(start_ns=100_000_000).tolist()
        [-0.1, 0.0, 0.1, 0.2]
        """
        return times_since(self.times_ns, start_ns)

    def trajectory(self, start_ns: int = 0, **options: Any) -> Trajectory | Pose:
        """Motion through the poses, its times counted from `start_ns`; a single pose rests.

        `options` go to `radarcore.Trajectory`, such as ``extrapolate="hold"``.

        See Also
        --------
        Trajectory : The result, and its options.

        Examples
        --------
        >>> poses = [rc.Pose([2.0 - 0.1 * k, 0.0, 0.0]) for k in range(4)]
        >>> messages = [rc.adapters.ros.to_pose_stamped(pose, time_ns=k * 100_000_000) for k, pose in enumerate(poses)]
        >>> motion = rc.adapters.ros.pose_series(messages).trajectory()
        >>> motion.at(0.25).position.round(3).tolist()
        [1.75, 0.0, 0.0]
        """
        if len(self.poses) == 1:
            return self.poses[0]
        return Trajectory(self.times(start_ns), self.poses, **options)


@dataclass(frozen=True, eq=False)
class JointSeries:
    """Positions of joints by increasing time.

    Attributes
    ----------
    times_ns : (n,) int64
        Stamps [ns].
    names : tuple of str
        One per joint.
    positions : (n, joint) float64
        Angles [rad] of revolute joints, ways [m] of prismatic ones.

    See Also
    --------
    adapters.ros.joint_series : Makes one.
    models.RobotArm : Arms that joints move.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> stamp = rc.adapters.ros.to_pose_stamped(rc.Pose(), time_ns=0).header
    >>> message = SimpleNamespace(header=stamp, name=["elbow", "wrist"], position=[0.5, -0.2])
    >>> series = rc.adapters.ros.joint_series([message])
    >>> series.names, series.positions.tolist(), series.times().tolist()
    (('elbow', 'wrist'), [[0.5, -0.2]], [0.0])
    """

    times_ns: NDArray[np.int64]
    names: tuple[str, ...]
    positions: NDArray[np.float64]

    def __post_init__(self) -> None:
        for values in (self.times_ns, self.positions):
            values.flags.writeable = False

    def times(self, start_ns: int = 0) -> NDArray[np.float64]:
        """Times since `start_ns` [s], (n,).

        See Also
        --------
        adapters.ros.PoseSeries.times : Of poses.

        Examples
        --------
        >>> from types import SimpleNamespace
        >>> stamp = rc.adapters.ros.to_pose_stamped(rc.Pose(), time_ns=0).header
        >>> message = SimpleNamespace(header=stamp, name=["elbow", "wrist"], position=[0.5, -0.2])
        >>> rc.adapters.ros.joint_series([message]).times(start_ns=-1_000_000_000).tolist()
        [1.0]
        """
        return times_since(self.times_ns, start_ns)


def from_pose(message: Any) -> Pose:
    """Pose of a ``geometry_msgs`` Pose, Transform, or one of these with a header; quaternions are (x, y, z, w).

    See Also
    --------
    adapters.ros.pose_series : A motion from many of them.
    adapters.ros.to_pose_stamped : The way back.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> at, turned = SimpleNamespace(x=1.0, y=2.0, z=0.5), SimpleNamespace(x=0.0, y=0.0, z=1.0, w=0.0)
    >>> pose = rc.adapters.ros.from_pose(SimpleNamespace(position=at, orientation=turned))
    >>> pose.apply([1.0, 0.0, 0.0]).round(6).tolist()
    [0.0, 2.0, 0.5]
    """
    return as_pose(_maps_of([pose_numbers(message)])[0])


def pose_numbers(message: Any) -> tuple[float, ...]:
    """Position and quaternion (x, y, z, w) of a message such as `from_pose` takes."""
    message = getattr(message, "pose", getattr(message, "transform", message))
    message = getattr(message, "pose", message)  # PoseWithCovarianceStamped
    if hasattr(message, "position"):
        p, q = message.position, message.orientation
    else:
        p, q = message.translation, message.rotation
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w


def _maps_of(rows: ArrayLike) -> NDArray[np.float64]:
    """``[rotation | position]`` of many rows of `pose_numbers`, (n, 3, 4): recordings have 100,000 of them."""
    numbers = check.array("position and orientation", rows, (None, 7))
    positions, quaternions = numbers[:, :3], numbers[:, 3:]
    lengths = np.linalg.norm(quaternions, axis=1, keepdims=True)
    if (is_zero := lengths[:, 0] == 0.0).any():
        raise ValueError(f"orientation: expected a quaternion, got zeros at index {int(is_zero.argmax())}")
    return transforms(rotations_of(np.roll(quaternions / lengths, 1, axis=1)), positions)


class SeriesRows:
    """Collects the poses of a frame or body from messages."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._stamps: list[int] = []
        self._reception_times: list[int | None] = []
        self._rows: list[tuple[float, ...]] = []

    def add(self, stamp: int, received: int | None, numbers: tuple[float, ...]) -> None:
        """Add a pose (see `pose_numbers`) with its stamp and time of recording [ns]."""
        self._stamps.append(stamp)
        self._reception_times.append(received)
        self._rows.append(numbers)

    @property
    def has_valid_pose(self) -> bool:
        """True if any of the poses is finite and has a quaternion."""
        return bool(self._is_valid().any())

    def series(self, frame_id: str) -> PoseSeries:
        """Poses that are finite and have a quaternion, at repaired times; an error without any."""
        chosen, maps = self._valid_maps()
        values = np.column_stack([maps[..., 3], maps[..., :3].reshape(-1, 9) / np.sqrt(2.0)])  # 1 m per rad
        stamps, received = [self._stamps[k] for k in chosen], [self._reception_times[k] for k in chosen]
        times, kept = message_times(self._name, stamps, received, values, "m/s")
        return PoseSeries(times, tuple(map(as_pose, maps[kept])), frame_id)

    def last(self) -> Pose:
        """The last pose that is finite and has a quaternion; an error without any."""
        return as_pose(self._valid_maps()[1][-1])

    def _valid_maps(self) -> tuple[list[int], NDArray[np.float64]]:
        """Indices and maps of the valid poses; of all poses without any, so that the error names one."""
        chosen = np.flatnonzero(self._is_valid()) if self.has_valid_pose else np.arange(len(self._rows))
        return chosen.tolist(), _maps_of(np.array(self._rows)[chosen])

    def _is_valid(self) -> NDArray[np.bool_]:
        numbers = np.array(self._rows)
        valid: NDArray[np.bool_] = np.isfinite(numbers).all(axis=1) & numbers[:, 3:].any(axis=1)
        return valid


def to_pose_stamped(pose: Pose, *, time_ns: int, frame_id: str = "world", types: Types = None) -> Any:
    """Pose as a ``geometry_msgs/PoseStamped`` in the frame `frame_id`, with a stamp [ns].

    See Also
    --------
    adapters.ros.from_pose : The way back.
    adapters.ros.to_transforms : Poses for TF.
    adapters.ros.BagWriter.write : Writes it into a bag.

    Examples
    --------
    >>> message = rc.adapters.ros.to_pose_stamped(rc.Pose([1.0, 2.0, 3.0]), time_ns=5_250_000_000, frame_id="map")
    >>> message.pose.position.y, message.header.stamp.sec, message.header.stamp.nanosec
    (2.0, 5, 250000000)
    """
    position, orientation = _vector(types, "Point", pose), _quaternion(types, pose)
    placed = make(types, "geometry_msgs/msg/Pose", position=position, orientation=orientation)
    stamped = header(None, time_ns, frame_id, types)
    return make(types, "geometry_msgs/msg/PoseStamped", header=stamped, pose=placed)


def to_transforms(poses: dict[str, Pose], *, time_ns: int, frame_id: str = "world", types: Types = None) -> Any:
    """Poses of frames in the frame `frame_id` as a ``tf2_msgs/TFMessage``, by the frames' names.

    See Also
    --------
    adapters.ros.TransformTree : The way back.
    adapters.ros.to_pose_stamped : A single pose.

    Examples
    --------
    >>> message = rc.adapters.ros.to_transforms({"radar": rc.Pose([1.0, 0.0, 0.5])}, time_ns=0, frame_id="map")
    >>> [(each.header.frame_id, each.child_frame_id) for each in message.transforms]
    [('map', 'radar')]
    """
    sent = []
    for name, pose in poses.items():
        translation, rotation = _vector(types, "Vector3", pose), _quaternion(types, pose)
        placed = make(types, "geometry_msgs/msg/Transform", translation=translation, rotation=rotation)
        stamped = header(None, time_ns, frame_id, types)
        name_of_type = "geometry_msgs/msg/TransformStamped"
        sent.append(make(types, name_of_type, header=stamped, child_frame_id=name, transform=placed))
    return make(types, "tf2_msgs/msg/TFMessage", transforms=sent)


def pose_series(messages: Iterable[Any]) -> PoseSeries:
    """Series of ``geometry_msgs/PoseStamped`` (or with covariance) of one body, all in the same frame.

    Takes bare messages or `BagReader.messages`, whose times of recording replace stamps of zero. Poses that are not
    finite, or have no quaternion, are left out. Warns if stamps start again, repeat, or are so irregular that speeds
    are wrong; the documentation of bags lists the repairs.

    See Also
    --------
    adapters.ros.rigid_body_series : Of messages with several bodies.
    adapters.ros.BagMotions.motion : Of a bag.

    Examples
    --------
    >>> poses = [rc.Pose([2.0 - 0.1 * k, 0.0, 0.0]) for k in range(4)]
    >>> messages = [rc.adapters.ros.to_pose_stamped(pose, time_ns=k * 100_000_000) for k, pose in enumerate(poses)]
    >>> series = rc.adapters.ros.pose_series(messages)
    >>> len(series.poses), series.frame_id
    (4, 'world')
    """
    name, given = unpacked(messages)
    if not given:
        raise ValueError("messages: expected at least one, got none")
    rows = SeriesRows(name)
    for message, received in given:
        rows.add(_stamp(message), received, pose_numbers(message))
    frames = {frame_name(message.header.frame_id) for message, _ in given}
    if len(frames) > 1:
        raise ValueError(f"messages: expected poses in one frame, got {', '.join(map(repr, sorted(frames)))}")
    return rows.series(frames.pop())


def rigid_body_series(messages: Iterable[Any]) -> dict[str, PoseSeries]:
    """Series of every rigid body in ``mocap4r2_msgs/RigidBodies``, by name; messages as for `pose_series`.

    A body whose pose is not finite, or has no quaternion, was not seen then: the series lacks that time.

    See Also
    --------
    adapters.ros.pose_series : Of messages of one body.
    adapters.optitrack.MotionCaptureClient : Bodies from the cameras' own program.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> stamped = rc.adapters.ros.to_pose_stamped(rc.Pose([1.0, 0.0, 0.0]), time_ns=0, frame_id="map")
    >>> ball = SimpleNamespace(rigid_body_name="ball", pose=stamped.pose)
    >>> series = rc.adapters.ros.rigid_body_series([SimpleNamespace(header=stamped.header, rigidbodies=[ball])])
    >>> series["ball"].poses[0].position.tolist()
    [1.0, 0.0, 0.0]
    """
    frame_id = ""
    topic, given = unpacked(messages)
    found: dict[str, SeriesRows] = {}
    for message, received in given:
        time_ns, frame_id = _stamp(message), frame_name(message.header.frame_id)
        # Drafts of the message have an underscore in it.
        for body in message.rigidbodies if hasattr(message, "rigidbodies") else message.rigid_bodies:
            name = str(body.rigid_body_name)
            found.setdefault(name, SeriesRows(f"{topic}, {name}")).add(time_ns, received, pose_numbers(body.pose))
    return {name: rows.series(frame_id) for name, rows in found.items() if rows.has_valid_pose}


def joint_series(messages: Iterable[Any], names: Sequence[str] | None = None) -> JointSeries:
    """Positions of joints in ``sensor_msgs/JointState``.

    Parameters
    ----------
    messages : iterable of sensor_msgs/JointState
        Joints may have any order and several publishers, such as an arm and its gripper. Messages as for
        `pose_series`.
    names : sequence of str, optional
        Joints in the order of the result; default: all with positions, in order of first appearance.

    Returns
    -------
    series : JointSeries
        At the times of the joint with the most messages, while all joints are known. Cubic splines interpolate joints
        with other times; a joint with a single message is constant.

    Raises
    ------
    ValueError
        For an unknown joint, and for joints without a common time.

    See Also
    --------
    adapters.ros.BagMotions.joints : Of a bag.
    models.RobotArm : Arms that joints move.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> stamp = rc.adapters.ros.to_pose_stamped(rc.Pose(), time_ns=0).header
    >>> message = SimpleNamespace(header=stamp, name=["elbow", "wrist"], position=[0.5, -0.2])
    >>> rc.adapters.ros.joint_series([message], names=["wrist", "elbow"]).positions.tolist()
    [[-0.2, 0.5]]
    """
    topic, given = unpacked(messages)
    given = [entry for entry in given if len(entry[0].position) > 0]
    if not given:
        raise ValueError("messages: expected at least one with positions, got none")
    sent: dict[str, list[tuple[int, int | None, float]]] = {}
    for message, received in given:
        if len(message.position) != len(message.name):
            raise ValueError(
                f"position: expected {len(message.name)} values, one per name, got {len(message.position)}"
            )
        stamp = _stamp(message)
        for name, position in zip(message.name, message.position, strict=True):
            sent.setdefault(name, []).append((stamp, received, float(position)))
    wanted = tuple(sent) if names is None else tuple(names)
    if missing := [name for name in wanted if name not in sent]:
        raise ValueError(f"names: no joint {', '.join(map(repr, missing))}; there is {', '.join(sorted(sent))}")

    # Joints of one publisher have the same times.
    groups: dict[tuple[tuple[int, int | None], ...], list[str]] = {}
    for name in wanted:
        sent[name] = [entry for entry in sent[name] if isfinite(entry[2])]
        if not sent[name]:
            raise ValueError(f"position: expected finite positions of joint {name!r}, got none")
        groups.setdefault(tuple(entry[:2] for entry in sent[name]), []).append(name)
    tracks = []
    for clock, members in groups.items():
        values = np.array([[entry[2] for entry in sent[name]] for name in members]).T
        label = topic if len(groups) == 1 else f"{topic}, {', '.join(members)}"
        times, kept = message_times(
            label, [entry[0] for entry in clock], [entry[1] for entry in clock], values, "rad/s"
        )
        tracks.append((label, times, values[kept], [wanted.index(name) for name in members]))
    times = max((times for _, times, _, _ in tracks), key=len)
    moving = [own for _, own, _, _ in tracks if len(own) > 1]
    first, last = max((own[0] for own in moving), default=times[0]), min((own[-1] for own in moving), default=times[-1])
    times = times[(times >= first) & (times <= last)]
    if not len(times):
        raise ValueError(f"names: expected joints at the same time, got {', '.join(wanted)} without a common time")
    positions = np.empty((len(times), len(wanted)))
    for label, own, values, columns in tracks:
        positions[:, columns] = _positions_at(label, times, own, values)
    return JointSeries(times, wanted, positions)


def _positions_at(name: str, times_ns: NDArray[np.int64], own_ns: NDArray[np.int64], values: Any) -> Any:
    """Positions (n, joint) at times within the joints' own times."""
    if len(own_ns) == 1 or np.isin(times_ns, own_ns).all():
        return values[np.searchsorted(own_ns, times_ns) if len(own_ns) > 1 else np.zeros(len(times_ns), int)]
    from scipy.interpolate import CubicSpline

    own = times_since(own_ns, int(own_ns[0]))
    warn_of_gap(name, own)
    return CubicSpline(own, values, bc_type="natural")(times_since(times_ns, int(own_ns[0])))


def times_since(times_ns: NDArray[np.int64], start_ns: int) -> NDArray[np.float64]:
    """Times [s] since a stamp [ns]: the difference is taken in whole nanoseconds."""
    return np.array([seconds(time_ns, start_ns) for time_ns in times_ns.tolist()])


def frame_name(frame_id: str) -> str:
    """Name of a frame, without the slash that old nodes of ROS 1 put in front."""
    return str(frame_id).removeprefix("/")


def _stamp(message: Any) -> int:
    if (time_ns := header_nanoseconds(message)) is None:
        raise ValueError(f"header: expected a stamp, got none in {type(message).__name__}")
    return time_ns


def _vector(types: Types, kind: str, pose: Pose) -> Any:
    x, y, z = pose.position.tolist()
    return make(types, f"geometry_msgs/msg/{kind}", x=x, y=y, z=z)


def _quaternion(types: Types, pose: Pose) -> Any:
    w, x, y, z = quaternion_of(pose.rotation).tolist()
    return make(types, "geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)
