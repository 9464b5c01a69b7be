"""A walking or standing person: 16 rigid segments that follow the gait along a path, as spheroids or real meshes."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from radarcore import check
from radarcore.geometry import shapes
from radarcore.geometry.mesh import Mesh
from radarcore.models.people import gait
from radarcore.models.people.figure import HIP_HEIGHT, SEGMENTS, Figure, Floats, Walk, lift_of
from radarcore.models.people.path import FloorPath
from radarcore.models.people.segments import real_man, real_skeleton, skeleton, spheroids, support
from radarcore.motion.protocol import Links, Motion
from radarcore.records import sealed
from radarcore.scene.body import Body
from radarcore.scene.material import Material

_TALLEST = 3.0
"""Largest plausible height of a person [m]."""

_MASS_INDICES = (6.0, 260.0)
"""Limits of mass over height squared [kg/m^2]; reported extremes are 7.5 and 251."""


_FASTEST_BREATHING = 2.0
"""Fastest breathing [Hz]: infants breathe once per second."""


@sealed
class Human(Links):
    """A walking or standing person of 16 rigid segments, each with exact pose and velocity at any time.

    Legs, arms, pelvis and trunk move as in the walking model of Boulic, Magnenat-Thalmann and Thalmann (1990, see
    `radarcore.models.people.gait`), which depends only on speed and height. The person stays upright and faces along
    the path. Before the first and after the last waypoint the person walks straight, into and out of the scene.
    Velocities, accelerations and their derivatives are continuous, also in turns of the path.

    The model does not fix the feet to the floor: at 1.4 m/s the sole slides at up to 0.5 m/s and rises by up to 2 cm,
    more at running speeds. The lowest point of a cycle touches the floor z = 0. The person does not lean into turns.

    A standing person breathes and sways: the chest moves by 4 mm with every breath, the body rotates about the ankles
    by 0.26 degrees rms forward and back, and the legs by 0.22 degrees sideways (published amplitudes, see
    `radarcore.models.people.standing`). The feet rest. A walking person does neither, because the gait masks both.

    Parameters
    ----------
    height : float
        Body height [m].
    speed : float
        Mean speed along the path [m/s], up to 3 hip heights (0.53 of the height) per second. At 0 the person stands at
        the first waypoint and faces the second.
    path : (n, 2) array_like
        Waypoints on the floor, x and y [m], at least two; turns cut the corners, see `turn_radius`.
    turn_radius : float
        Smallest radius of the turns of the path [m], see `radarcore.models.people.path.FloorPath`.
    start_time : float
        Time at which the pelvis is at the first waypoint [s].
    phase : float
        Phase of the gait at `start_time` in cycles of two steps: the right heel strikes at 0, the left heel at 0.5.
        Standing people sway differently at different places and with different phases.
    mass : float, optional
        Body mass [kg], for the volumes; default: 70 kg at 1.75 m, in proportion to the square of the height.
    breathing : float, optional
        Breaths per second of a standing person [Hz], at most 2. With None the person is static, and simulation is
        faster.

    Raises
    ------
    ValueError
        For a height above 3 m, an impossible mass for the height, a speed above the model's limit, more than 2 breaths
        per second, and a path with legs too short for its turns.

    See Also
    --------
    Human.bodies : Bodies for a scene.
    models.RobotArm : An arm.
    Scene : Takes the bodies.

    Examples
    --------
    >>> person = rc.models.Human(height=1.8, speed=1.2, path=[[4.0, 0.0], [1.0, 0.0]])
    >>> person
    <Human: 1.8 m, 74.1 kg, 1.2 m/s along 3 m>
    >>> print(f"{person.segment_motion('head').at(1.0).position[2]:.1f} m")
    1.6 m
    """

    def __init__(
        self,
        *,
        height: float = 1.75,
        speed: float = 1.4,
        path: ArrayLike = ((0.0, 0.0), (10.0, 0.0)),
        turn_radius: float = 0.4,
        start_time: float = 0.0,
        phase: float = 0.0,
        mass: float | None = None,
        breathing: float | None = 0.25,
    ) -> None:
        self.height: float = check.positive("height", height, "m")
        if self.height > _TALLEST:
            raise ValueError(
                f"height: expected at most {_TALLEST:g} m, got {self.height:g}; centimetres? 1.75 is a person of 175 cm"
            )
        self.speed: float = check.non_negative("speed", speed, "m/s")
        fastest = gait.MAX_RELATIVE_SPEED * HIP_HEIGHT * self.height
        if self.speed > fastest:
            raise ValueError(
                f"speed: expected at most {fastest:.3g} m/s for a height of {self.height:g} m (3 hip heights per "
                f"second, the limit of the walking model), got {self.speed:g}"
            )
        self.path: FloorPath = FloorPath(path, turn_radius)
        self.start_time: float = check.number("start_time", start_time, "s")
        self.phase: float = check.number("phase", phase)
        self.mass: float = 70.0 * (self.height / 1.75) ** 2 if mass is None else check.positive("mass", mass, "kg")
        lightest, heaviest = (index * self.height**2 for index in _MASS_INDICES)
        if not lightest <= self.mass <= heaviest:
            raise ValueError(
                f"mass: expected {lightest:.3g} to {heaviest:.3g} kg for a height of {self.height:g} m, "
                f"got {self.mass:g}"
            )
        self.breathing: float | None = None if breathing is None else check.positive("breathing", breathing, "Hz")
        if self.breathing is not None and self.breathing > _FASTEST_BREATHING:
            raise ValueError(
                f"breathing: expected at most {_FASTEST_BREATHING:g} breaths per second [Hz], got {self.breathing:g}; "
                "breaths per minute? 0.25 is 15 per minute"
            )
        self._walk = Walk(self.height, self.speed, self.path, self.start_time, self.phase, self.breathing)
        self._spheroids = spheroids(self.height, self.mass)
        self._figure = Figure(self._walk, skeleton(self.height), _lift(self.height, self.speed, self.mass))

    @property
    def relative_speed(self) -> float:
        """Speed in hip heights per second: the parameter of the gait [1/s]."""
        return self._walk.relative_speed

    @property
    def cycle_duration(self) -> float:
        """Duration of two steps [s]; inf when standing."""
        return self._walk.cycle_duration

    def segment_motion(self, name: str) -> Motion:
        """Motion of a segment, one of `SEGMENTS`.

        The origin is the upper joint: hip, knee or ankle for the leg, shoulder, elbow or wrist for the arm. Pelvis and
        trunk have it midway between the hips, the neck between the shoulders, and the head on the trunk's axis at the
        height of the chin. With hanging legs and arms, the axes are x forward, y left, z up.
        """
        return self._figure.motion(name)

    def link_poses_at(self, times: ArrayLike) -> Floats:
        """``[rotation | position]`` from all `SEGMENTS` to the world at several times [s], (n, segment, 3, 4)."""
        return self._figure.link_poses_at(times)

    def link_poses_and_rates_at(self, times: ArrayLike) -> Floats:
        """`link_poses_at` and their time derivatives, (2, n, segment, 3, 4)."""
        return self._figure.link_poses_and_rates_at(times)

    def bodies(self, material: Material | None = None, name: str = "human", *, subdivisions: int = 4) -> list[Body]:
        """The person as 16 closed spheroids with the volumes of the segments.

        Parameters
        ----------
        material : Material, optional
            Default: ``materials["skin"]``.
        name : str
            Bodies have names ``name/segment``, such as ``human/left_foot``.
        subdivisions : int
            Subdivisions of every spheroid, as for `shapes.sphere`: ``20 * 4**subdivisions`` triangles.

        See Also
        --------
        Human.mesh_bodies : With the meshes of a man.
        Scene : Takes them.

        Examples
        --------
        >>> bodies = rc.models.Human(path=[[4.0, 0.0], [1.0, 0.0]]).bodies(subdivisions=2)
        >>> len(bodies), bodies[0].name
        (16, 'human/pelvis')
        """
        meshes = {
            kind: _spheroid(tuple(spheroid.semi_axes.tolist()), tuple(spheroid.center.tolist()), subdivisions)
            for kind, spheroid in self._spheroids.items()
        }
        return self._figure.bodies({segment: meshes[_kind(segment)] for segment in SEGMENTS}, material, name)

    def mesh_bodies(self, material: Material | None = None, name: str = "human") -> list[Body]:
        """The person as 16 real meshes of a man, scaled to the height (extra `robots`; about 109 000 triangles).

        The meshes follow the same joint angles with the man's proportions: the joints of the limbs are within 0.1 m of
        `segment_motion`, and pelvis and trunk have their origin at the waist. Parameters and names as for `bodies`.
        """
        scale, meshes = _real_meshes(self.height)
        joints = real_skeleton(real_man()[0], scale)
        lift = lift_of(self._walk, joints, support(meshes["right_foot"].vertices))
        return Figure(self._walk, joints, lift).bodies(meshes, material, name)

    def __repr__(self) -> str:
        return f"<Human: {self.height:g} m, {self.mass:.3g} kg, {self.speed:g} m/s along {self.path.length:.3g} m>"


@lru_cache(maxsize=2)
def _unit_sphere(subdivisions: int) -> Mesh:
    return shapes.sphere(1.0, subdivisions=subdivisions)


@lru_cache(maxsize=160)  # of sixteen people, of 0.6 MB each
def _spheroid(semi_axes: tuple[float, ...], center: tuple[float, ...], subdivisions: int) -> Mesh:
    """Mesh of a spheroid [m]; people of equal height and mass share it."""
    unit = _unit_sphere(subdivisions)
    return Mesh(unit.vertices * np.array(semi_axes) + np.array(center), unit.triangles)


@lru_cache(maxsize=64)
def _lift(height: float, speed: float, mass: float) -> float:
    """Lift of a person of spheroids, independent of path and time [m]."""
    walk = Walk(height, speed, FloorPath([[0.0, 0.0], [1.0, 0.0]], 0.4), 0.0, 0.0)
    return lift_of(walk, skeleton(height), spheroids(height, mass)["foot"].lowest)


@lru_cache(maxsize=8)  # of 20 MB each
def _real_meshes(height: float) -> tuple[float, dict[str, Mesh]]:
    """Scale of the real man and the meshes of his segments, each in its own axes, at a body height [m]."""
    rest, parts = real_man()
    scale = height / max(mesh.bounds[1, 2] for mesh in parts.values())
    return scale, {
        segment: Mesh(scale * (mesh.vertices - rest[segment]), mesh.triangles) for segment, mesh in parts.items()
    }


def _kind(segment: str) -> str:
    """Name of a segment without its side."""
    return segment.removeprefix("left_").removeprefix("right_")
