"""Real meshes of a UR10 arm and of a human, posed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore.models.robots import urdf
from radarcore.models.robots.arm import RobotArm
from radarcore.models.robots.data import HUMAN, UR10, data_file, meshes_of
from radarcore.models.robots.joint import JointAngles


class Link(NamedTuple):
    """One rigid part of a model.

    See Also
    --------
    models.robots.ur10_links : Those of an arm.
    models.robots.human_links : Those of a human.

    Examples
    --------
    >>> link = rc.models.robots.Link("plate", np.zeros((4, 3)), np.array([[0, 1, 2]]), np.eye(4))
    >>> link.name, link.vertices.shape
    ('plate', (4, 3))
    """

    name: str
    vertices: NDArray[np.float64]
    """(n, 3) in mesh coordinates [m]."""
    triangles: NDArray[np.int64]
    """(m, 3) rows of `vertices`."""
    pose: NDArray[np.float64]
    """(4, 4) from mesh coordinates to those of the model."""


# ISB axes (x forward, y up, z right) to ours (x forward, y left, z up): (x, y, z) -> (x, -z, y).
_ISB_TO_Z_UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def ur10_links(joint_angles: JointAngles) -> list[Link]:
    """Collision meshes of a UR10 (7 closed or nearly closed meshes, 5862 triangles) in ``base_link``.

    Parameters
    ----------
    joint_angles : (6,)
        Shoulder pan, shoulder lift, elbow, wrist 1, 2, 3 [rad].

    See Also
    --------
    models.RobotArm.ur10_meshes : The same as an arm that moves.
    models.robots.human_links : A human.

    Examples
    --------
    >>> links = rc.models.robots.ur10_links([0.0, -1.57, 1.57, 1.57, 1.57, 0.0])
    >>> len(links), sum(len(link.triangles) for link in links)
    (7, 5862)
    """
    return _links(UR10, "collision", joint_angles)


def human_links(joint_angles: Mapping[str, float] | None = None) -> list[Link]:
    """Meshes of a human who faces +x and stands on the floor z = 0 (23 closed meshes, 1.8 m tall).

    Parameters
    ----------
    joint_angles : mapping, optional
        Angle [rad] by name of the URDF joint, such as ``left_knee_Z``; those left out are zero (arms hanging).

    See Also
    --------
    models.Human : A human who walks.
    models.robots.human_joints : Where the joints are.

    Examples
    --------
    >>> links = rc.models.robots.human_links({"left_knee_Z": -1.0})
    >>> len(links)
    23
    """
    links = _human_links(joint_angles or {})

    # Put the lowest vertex on the floor.
    lowest = _lowest(links)
    for link in links:
        link.pose[2, 3] -= lowest
    return links


def human_joints() -> dict[str, NDArray[np.float64]]:
    """Origins (3,) of the links of `human_links` with all joints at zero [m], by name: the joint that moves each.

    See Also
    --------
    models.robots.human_links : The meshes.
    models.Human : A human who walks.

    Examples
    --------
    >>> joints = rc.models.robots.human_joints()
    >>> print(f"{joints['left_lowerleg'][2]:.2f} m")
    0.52 m
    """
    model = urdf.read(data_file(HUMAN), geometry="visual")
    tree = RobotArm(model.joints, dict.fromkeys(model.links))
    floor = np.array([0.0, 0.0, _lowest(_human_links({}))])
    return {name: _ISB_TO_Z_UP[:3, :3] @ tree.link_pose(name, {}).position - floor for name in model.links}


def _human_links(joint_angles: Mapping[str, float]) -> list[Link]:
    """Every mesh of the human, in the pelvis' coordinates with z up."""
    return [link._replace(pose=_ISB_TO_Z_UP @ link.pose) for link in _links(HUMAN, "visual", joint_angles)]


def _lowest(links: list[Link]) -> float:
    """Height of the lowest vertex [m]."""
    return float(min((link.vertices @ link.pose[2, :3] + link.pose[2, 3]).min() for link in links))


def _links(urdf_file: str, geometry: Literal["visual", "collision"], joint_angles: JointAngles) -> list[Link]:
    """Every mesh of a URDF file of the package, posed in its root link."""
    model = urdf.read(data_file(urdf_file), geometry=geometry)
    tree = RobotArm(model.joints, dict.fromkeys(model.links))
    links: list[Link] = []
    for mesh in meshes_of(model):
        pose = np.eye(4)
        placed = tree.link_pose(mesh.link, joint_angles) @ mesh.origin
        pose[:3, :3], pose[:3, 3] = placed.rotation, placed.position
        links.append(Link(f"{mesh.link}/{mesh.name}", mesh.vertices, mesh.triangles, pose))
    return links
