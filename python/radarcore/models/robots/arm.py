"""Robot arms: joints, links, and poses of the links while the joints move."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from os import PathLike, fspath
from typing import Literal, cast

import numpy as np
from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry.mesh import Mesh
from radarcore.geometry.pose import Pose, as_pose
from radarcore.geometry.rotation import Matrix, cross_matrix
from radarcore.models.robots.joint import Joint, JointAngles, JointMotion, JointTrajectory
from radarcore.motion.group import Attached, Motions
from radarcore.motion.protocol import AnyMotion, LinkMotion, Links, Motion, as_motion, derivative, latest_update
from radarcore.records import sealed
from radarcore.scene.body import Body
from radarcore.scene.material import Material

RADAR_AT_TOOL0 = Pose(rotation=[[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""Pose of a radar that looks along the flange: its x, y and z axes are z, x and y of ``tool0``.

Further out along the flange: ``Pose([0, 0, 0.05]) @ RADAR_AT_TOOL0``.
"""


@sealed
class RobotArm:
    """A tree of joints, with meshes on the links between them.

    Parameters
    ----------
    joints : iterable of Joint
        Every link but one, the root, is the child of exactly one.
    links : mapping of str to Mesh or None
        All links by name, with their shape in their own coordinates.
    name : str
        Prefix of the names of bodies.

    Attributes
    ----------
    joints : tuple of Joint
        As given.
    links : dict
        As given, the root first and every other after its parent.
    joint_names : tuple of str
        The joints that move: the order of joint angles.

    See Also
    --------
    RobotArm.named : A real arm by its name.
    RobotArm.from_urdf : Arm of a file.
    models.MovingArm : The arm in motion.
    models.JointTrajectory : Joint angles over time.

    Examples
    --------
    >>> arm = rc.models.RobotArm.ur10()
    >>> arm.joint_names[:2]
    ('shoulder_pan_joint', 'shoulder_lift_joint')
    >>> arm.link_pose("tool0", [0.0, -1.57, 1.57, 1.57, 1.57, 0.0]).position.round(2)
    array([0.46, 0.16, 0.65])
    """

    def __init__(self, joints: Iterable[Joint], links: Mapping[str, Mesh | None], *, name: str = "arm") -> None:
        self.name = name
        self.joints: tuple[Joint, ...] = tuple(joints)
        moving = [joint for joint in self.joints if joint.kind != "fixed"]
        self.joint_names: tuple[str, ...] = tuple(joint.name for joint in moving)
        ordered = _from_the_root(self.joints, links)
        root = next(link for link in links if all(joint.child != link for joint in self.joints))
        self.links: dict[str, Mesh | None] = {link: links[link] for link in [root, *(joint.child for joint in ordered)]}

        # A link's map to its parent is fixed + first * a + second * b, with (first, second) = (sin q, 1 - cos q)
        # for a joint that turns (Rodrigues) and (q, 0) for one that slides.
        self._numbers = {link: i for i, link in enumerate(self.links)}
        self._parents = [self._numbers[joint.parent] for joint in ordered]
        self._slots = np.array([ordered.index(joint) for joint in moving], dtype=np.intp)
        self._axes = np.array([joint.axis for joint in moving], dtype=np.float64).reshape(-1, 3)
        # True for joints between the root and each link, (link, moving joint).
        self._carries = np.zeros((len(self.links), len(moving)), dtype=bool)
        for k, parent in enumerate(self._parents):
            self._carries[k + 1] = self._carries[parent] | (self._slots == k)
        self._is_revolute = np.array([joint.kind == "revolute" for joint in ordered], dtype=bool)
        self._fixed, self._first, self._second = np.zeros((3, len(ordered), 4, 4))
        for k, joint in enumerate(ordered):
            self._fixed[k] = _matrix(joint.origin)
            if joint.axis is None:
                continue
            if joint.kind == "revolute":
                cross = cross_matrix(joint.axis)
                self._first[k, :3, :3] = joint.origin.rotation @ cross
                self._second[k, :3, :3] = joint.origin.rotation @ cross @ cross
            else:
                self._first[k, :3, 3] = joint.origin.rotation @ joint.axis

    @classmethod
    def from_urdf(
        cls,
        path: str | PathLike[str],
        *,
        meshes: Literal["collision", "visual"] | None = "collision",
        package_directories: Mapping[str, str | PathLike[str]] | None = None,
    ) -> RobotArm:
        """Read a URDF file.

        Parameters
        ----------
        path : path
            The file. Its root link is the arm's base.
        meshes : "collision", "visual" or None
            Geometry of the links. Box, cylinder, sphere and OBJ files need nothing else
            installed; DAE files need pycollada and others trimesh (``pip install radarcore[mesh]``).
        package_directories : mapping, optional
            Directories of ``package://name/...`` by name; default: the directory `name` that the file is in.

        Raises
        ------
        FileNotFoundError
            When the file or one of its meshes is not there.
        ValueError
            When the file is not XML (names the line) or lacks what URDF demands.

        See Also
        --------
        RobotArm.named : A real arm by its name.
        RobotArm.ur10 : One that needs no file.

        Notes
        -----
        Joints that mimic others are joints of their own here, with a warning.

        Examples
        --------
        >>> links = '<link name="base"/><link name="tool"/>'
        >>> origin = '<origin xyz="0 0 0.5"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/>'
        >>> joint = f'<joint name="turn" type="revolute"><parent link="base"/><child link="tool"/>{origin}</joint>'
        >>> np.savetxt("arm.urdf", [f'<robot name="small">{links}{joint}</robot>'], fmt="%s")
        >>> rc.models.RobotArm.from_urdf("arm.urdf")
        <RobotArm 'small': 2 links, joints turn>
        """
        from radarcore.models.robots import urdf

        model = urdf.read(path, geometry=meshes, package_directories=package_directories)
        try:
            return cls(model.joints, urdf.shapes_of(model), name=model.name)
        except ValueError as error:
            raise ValueError(f"{fspath(path)}: {error}") from error

    @classmethod
    def named(cls, name: str, *, meshes: Literal["collision", "visual"] | None = "collision") -> RobotArm:
        """A real arm by its name (``pip install radarcore[robots]``), from the package example-robot-data.

        Parameters
        ----------
        name : str
            ``"ur3"``, ``"ur5"``, ``"ur10"``, ``"panda"``, ``"kinova"``, ``"xarm7"``, ``"so100"``, ``"so101"``: all of
            `radarcore.models.robots.arm_names`.
        meshes : "collision", "visual" or None
            Geometry of the links: plain collision meshes, or detailed visual meshes with twenty times the triangles for
            most arms.

        Raises
        ------
        KeyError
            For an unknown name; suggests near ones.
        ImportError
            When the extra is not installed.

        See Also
        --------
        models.robots.arm_names : The names.
        RobotArm.from_urdf : Arm of a file.

        Notes
        -----
        Joints count from the base outwards. The fingers of the Panda's hand are closed and no joints.

        Examples
        --------
        >>> rc.models.RobotArm.named("panda", meshes=None).joint_names[-1]
        'panda_joint7'
        """
        from radarcore.models.robots import named

        joints, shapes = named.read(name, meshes)
        return cls(_from_the_root(tuple(joints), shapes), shapes, name=name)

    @classmethod
    def ur10(cls) -> RobotArm:
        """A UR10 made of cylinders: kinematics of the real arm, sizes of its housings; base_link to tool0.

        See Also
        --------
        RobotArm.named : With its real meshes, and other arms.

        Examples
        --------
        >>> rc.models.RobotArm.ur10().joint_names[0]
        'shoulder_pan_joint'
        """
        from radarcore.models.robots import ur10

        return cls(ur10.joints(), ur10.shapes(), name="ur10")

    @property
    def moving_joints(self) -> tuple[Joint, ...]:
        """The joints that move, in the order of joint angles."""
        return tuple(joint for joint in self.joints if joint.kind != "fixed")

    def joint_array(self, joint_angles: JointAngles) -> Matrix:
        """Joint angles as an array (num_joints,) in the order of `joint_names`; a KeyError for an unknown name."""
        if isinstance(joint_angles, Mapping):
            for name in joint_angles:
                if name not in self.joint_names:
                    raise KeyError(f"no moving joint {name!r}; {check.near_names(name, self.joint_names)}")
            joint_angles = [joint_angles.get(name, 0.0) for name in self.joint_names]
        angles = check.array("joint_angles", joint_angles, (len(self.joint_names),))
        check.radians("joint_angles", angles[[joint.kind == "revolute" for joint in self.moving_joints]])
        return angles

    def link_pose(self, link: str, joint_angles: JointAngles) -> Pose:
        """Pose of a link in the coordinates of the root link.

        See Also
        --------
        RobotArm.jacobian : How it moves.
        MovingArm.link_motion : Over time, in the world.

        Examples
        --------
        >>> arm = rc.models.RobotArm.ur10()
        >>> arm.link_pose("tool0", {"elbow_joint": np.pi / 2}).position.round(3)
        array([ 0.496,  0.256, -0.445])
        """
        number = self.link_number(link)
        return as_pose(self.link_poses(self.joint_array(joint_angles))[number])

    def jacobian(self, link: str, joint_angles: JointAngles) -> Matrix:
        """Geometric Jacobian of a link, (6, num_joints), in the coordinates of the root link.

        Velocity of the link's origin [m/s] and angular velocity [rad/s] per rate of each joint.

        See Also
        --------
        RobotArm.link_pose : Pose of the link.
        models.cartesian_line : Joint angles of a straight line.

        Examples
        --------
        >>> jacobian = rc.models.RobotArm.ur10().jacobian("tool0", [0.0, -1.57, 1.57, 1.57, 1.57, 0.0])
        >>> jacobian[3:, 0].round(3) + 0.0  # the base turns the tool about z
        array([0., 0., 1.])
        """
        number = self.link_number(link)
        return self.jacobian_at(number, self.link_poses(self.joint_array(joint_angles)))

    def moving(
        self, joint_motion: JointMotion | Callable[[float], ArrayLike] | JointAngles, base: AnyMotion | None = None
    ) -> MovingArm:
        """The arm in motion.

        Parameters
        ----------
        joint_motion : JointTrajectory, function of time or joint angles
            Anything with `angles` and `rates`; a function of time [s] that returns joint angles (its rates are
            central differences); or joint angles at which the arm stays.
        base : Pose or other motion, optional
            Root link to world.

        See Also
        --------
        models.JointTrajectory : Joint angles over time.
        models.cartesian_line : Joint angles of a straight line.
        MovingArm.bodies : Its bodies for a scene.

        Examples
        --------
        >>> arm = rc.models.RobotArm.ur10()
        >>> moving = arm.moving(lambda time: [0.5 * time, -1.57, 1.57, 1.57, 1.57, 0.0], base=rc.Pose([2.0, 0.0, 0.0]))
        >>> moving.link_motion("tool0").at(0.0).position.round(2)
        array([2.46, 0.16, 0.65])
        """
        return MovingArm(self, joint_motion, base)

    def link_number(self, link: str) -> int:
        """Index of a link in `links`; a KeyError that names near ones when there is none."""
        try:
            return self._numbers[link]
        except KeyError:
            raise KeyError(f"no link {link!r}; {check.near_names(link, self.links)}") from None

    def link_poses(self, angles: Matrix, root: Matrix | None = None) -> Matrix:
        """Maps of all links to the root's surroundings, (..., num_links, 4, 4), in the order of `links`.

        Angles (..., num_joints) and root (..., 4, 4), default: identity, are not checked. With `root`
        (..., 3, 4) the maps lack their last row as well.
        """
        return self._along_the_tree(self._local(angles), np.eye(4) if root is None else root)

    def link_poses_and_rates(self, angles: Matrix, rates: Matrix, root: Matrix, root_rate: Matrix) -> Matrix:
        """`link_poses` and their time derivatives, (2, ..., num_links, 3, 4), by the product rule along the tree."""
        local = np.zeros((*angles.shape[:-1], len(self._fixed), 8, 8))
        local[..., :4, :4] = local[..., 4:, 4:] = self._local(angles)
        local[..., :4, 4:] = self._local_rate(angles, rates)
        # [P P'] [[L L'] [0 L]] = [P L, P' L + P L']
        both = self._along_the_tree(local, np.concatenate([root, root_rate], axis=-1))
        return np.array([both[..., :4], both[..., 4:]])

    def _along_the_tree(self, local: Matrix, root: Matrix) -> Matrix:
        """Products of matrices from the root (..., k, m) to every link, (..., num_links, k, m)."""
        products = np.empty((*local.shape[:-3], len(self.links), *root.shape[-2:]))
        products[..., 0, :, :] = root
        for k, parent in enumerate(self._parents):
            products[..., k + 1, :, :] = products[..., parent, :, :] @ local[..., k, :, :]
        return products

    def _local(self, angles: Matrix) -> Matrix:
        """Map of every link but the root to its parent, (..., num_links - 1, 4, 4)."""
        q = np.zeros((*angles.shape[:-1], len(self._fixed)))
        q[..., self._slots] = angles
        # 1 - cos as 2 sin^2 keeps small angles exact.
        first, second = np.where(self._is_revolute, np.sin(q), q), 2.0 * np.sin(0.5 * q) ** 2
        result: Matrix = self._fixed + first[..., None, None] * self._first + second[..., None, None] * self._second
        return result

    def _local_rate(self, angles: Matrix, rates: Matrix) -> Matrix:
        q, rate = np.zeros((2, *angles.shape[:-1], len(self._fixed)))
        q[..., self._slots], rate[..., self._slots] = angles, rates
        first, second = np.where(self._is_revolute, np.cos(q), 1.0) * rate, np.sin(q) * rate
        result: Matrix = first[..., None, None] * self._first + second[..., None, None] * self._second
        return result

    def jacobian_at(self, number: int, poses: Matrix) -> Matrix:
        """`jacobian` of a link by its number, from the poses of all links (link, 4, 4)."""
        joints = poses[self._slots + 1]
        turns = self._is_revolute[self._slots][:, None]
        axes = (joints[:, :3, :3] @ self._axes[..., None])[..., 0]
        linear = np.where(turns, np.cross(axes, poses[number, :3, 3] - joints[:, :3, 3]), axes)
        columns: Matrix = np.hstack([linear, np.where(turns, axes, 0.0)]) * self._carries[number][:, None]
        return columns.T

    def __repr__(self) -> str:
        return f"<RobotArm {self.name!r}: {len(self.links)} links, joints {', '.join(self.joint_names) or 'none'}>"


@sealed
class MovingArm(Links):
    """A robot arm whose joints, and perhaps base, move; `RobotArm.moving` makes it.

    Parameters
    ----------
    arm, joint_motion, base
        As in `RobotArm.moving`.

    See Also
    --------
    RobotArm.moving : Makes it.
    MovingArm.bodies : Its bodies for a scene.
    models.RADAR_AT_TOOL0 : Pose of a radar on its flange.

    Examples
    --------
    >>> moving = rc.models.RobotArm.ur10().moving([0.0, -1.57, 1.57, 1.57, 1.57, 0.0])
    >>> radar = rc.Attached(moving.link_motion("tool0"), rc.models.RADAR_AT_TOOL0)
    >>> radar.at(0.0).rotation[:, 0].round(2) + 0.0  # it looks down
    array([ 0.,  0., -1.])
    """

    def __init__(
        self,
        arm: RobotArm,
        joint_motion: JointMotion | Callable[[float], ArrayLike] | JointAngles,
        base: AnyMotion | None = None,
    ) -> None:
        self.arm = arm
        self.base: Motion = Pose() if base is None else as_motion("base", base)
        self._base = Motions([self.base])
        self.joint_motion: JointMotion | None = None
        self._resting: Matrix | None = None
        if hasattr(joint_motion, "angles") and hasattr(joint_motion, "rates"):
            self.joint_motion = cast(JointMotion, joint_motion)
            first = joint_motion.times[0] if isinstance(joint_motion, JointTrajectory) else 0.0
            check.array("joint_motion", self.joint_motion.angles(first), (len(arm.joint_names),))
        elif callable(joint_motion):
            self.joint_motion = _JointFunction(joint_motion)
        else:
            self._resting = check.frozen(arm.joint_array(joint_motion))

    @property
    def newest(self) -> float | None:
        """Time of the newest update of base or joints [s]; None if neither is live."""
        return latest_update(self.base, self.joint_motion)

    def link_motion(self, link: str) -> Motion:
        """Motion of a link in the world, for bodies on it and for `Attached`.

        See Also
        --------
        Attached : A radar, or a body, on it.
        MovingArm.bodies : The links themselves.

        Examples
        --------
        >>> moving = rc.models.RobotArm.ur10().moving(lambda time: [time, -1.57, 1.57, 1.57, 1.57, 0.0])
        >>> np.linalg.norm(moving.link_motion("tool0").rate_at(0.0)[:, 3]).round(2).item()
        0.49
        """
        number = self.arm.link_number(link)
        if self._resting is None:
            return LinkMotion(self, number)
        pose = self.arm.link_pose(link, self._resting)
        return self.base @ pose if isinstance(self.base, Pose) else Attached(self.base, pose)

    def bodies(self, material: Material | None = None, name: str | None = None) -> list[Body]:
        """One body per link that has a shape, named ``ur10/forearm_link``.

        Parameters
        ----------
        material : Material, optional
            Material of all links; default: metal, as in `Body`.
        name : str, optional
            Prefix of the names; default: the arm's name.

        See Also
        --------
        Scene : Takes them.
        MovingArm.link_motion : Motion of one link.

        Examples
        --------
        >>> moving = rc.models.RobotArm.ur10().moving([0.0, -1.57, 1.57, 1.57, 1.57, 0.0])
        >>> [body.name for body in moving.bodies()][:2]
        ['ur10/base_link', 'ur10/shoulder_link']
        """
        prefix = self.arm.name if name is None else name
        return [
            Body(mesh, material=material, motion=self.link_motion(link), name=f"{prefix}/{link}")
            for link, mesh in self.arm.links.items()
            if mesh is not None
        ]

    def link_poses_at(self, times: ArrayLike) -> Matrix:
        """``[rotation | position]`` of all links at several times [s], (n, num_links, 3, 4), to the world.

        In the order of ``arm.links``.
        """
        when = check.numbers("times", times)
        return self.arm.link_poses(self._angles(when), self._base.poses_at(when)[:, 0])

    def link_poses_and_rates_at(self, times: ArrayLike) -> Matrix:
        """`link_poses_at` and their time derivatives, (2, n, num_links, 3, 4)."""
        when = check.numbers("times", times)
        root = self._base.poses_and_rates_at(when)[:, :, 0]
        return self.arm.link_poses_and_rates(self._angles(when), self._angle_rates(when), *root)

    def _angles(self, times: Matrix) -> Matrix:
        """Joint angles at several times, (n, num_joints)."""
        if self.joint_motion is None:
            assert self._resting is not None  # one of the two is there
            return np.broadcast_to(self._resting, (len(times), len(self._resting)))
        return self._at_each(self.joint_motion.angles, times)

    def _angle_rates(self, times: Matrix) -> Matrix:
        """Time derivatives of the joint angles, (n, num_joints)."""
        if self.joint_motion is None:
            return np.zeros((len(times), len(self.arm.joint_names)))
        return self._at_each(self.joint_motion.rates, times)

    def _at_each(self, function: Callable[[float], Matrix] | Callable[[ArrayLike], Matrix], times: Matrix) -> Matrix:
        """Angles or rates of the joint motion, (n, num_joints); functions of the user are called time by time."""
        if isinstance(self.joint_motion, JointTrajectory):
            return cast(Callable[[ArrayLike], Matrix], function)(times)
        values = np.empty((len(times), len(self.arm.joint_names)))
        for k, time in enumerate(times.tolist()):
            values[k] = check.array("joint_motion", function(time), values[k].shape)
        return values


class _JointFunction:
    """A function of time as a joint motion; rates by central differences of fourth order."""

    def __init__(self, function: Callable[[float], ArrayLike]) -> None:
        self._function = function

    def angles(self, time: float) -> Matrix:
        return np.asarray(self._function(time), dtype=np.float64)

    def rates(self, time: float) -> Matrix:
        return derivative(self.angles, time)


def _from_the_root(joints: tuple[Joint, ...], links: Mapping[str, Mesh | None]) -> list[Joint]:
    """The joints, each after its parent's; a ValueError unless they form a tree."""
    names = [joint.name for joint in joints]
    for joint in joints:
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                raise ValueError(f"joint {joint.name!r}, {role}: no link {link!r}; {check.near_names(link, links)}")
        if names.count(joint.name) > 1:
            raise ValueError(f"joints: expected names that differ, got {joint.name!r} twice")
        if others := [other.name for other in joints if other.child == joint.child and other is not joint]:
            raise ValueError(
                f"joints: expected one to lead to every link, got {joint.name!r} and {others[0]!r} to {joint.child!r}"
            )
    children = {joint.child for joint in joints}
    roots = [link for link in links if link not in children]
    if len(roots) != 1:
        raise ValueError(f"joints: expected one link without a parent, got {roots or 'none'}")
    reached, ordered = {roots[0]}, list[Joint]()
    while len(ordered) < len(joints):
        more = [joint for joint in joints if joint.parent in reached and joint.child not in reached]
        if not more:
            lost = sorted(set(links) - reached)
            raise ValueError(f"joints: expected every link to hang on {roots[0]!r}, got a ring of {lost}")
        ordered += more
        reached |= {joint.child for joint in more}
    return ordered


def _matrix(pose: Pose) -> Matrix:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pose.rotation, pose.position
    return matrix
