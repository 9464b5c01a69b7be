"""Radar cross-sections of bodies far away."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import _core, check, notice
from radarcore.direction import unit_vectors
from radarcore.geometry.mesh import Mesh
from radarcore.motion.group import Motions
from radarcore.scene.body import Body
from radarcore.scene.material import Material
from radarcore.scene.scene import Scene
from radarcore.simulate.beat import check_threads
from radarcore.simulate.settings import MAX_BOUNCES


def rcs(
    target: Mesh | Body | Scene,
    frequency: ArrayLike,
    directions: ArrayLike | None = None,
    *,
    azimuth_deg: ArrayLike | None = None,
    elevation_deg: ArrayLike | None = None,
    receiver: ArrayLike | None = None,
    max_bounces: int = 1,
    polarization: str | ArrayLike | None = None,
    time: float = 0.0,
    threads: int | None = None,
    progress: bool = True,
) -> NDArray[np.float64]:
    """Far-field radar cross-sections of a mesh, a body or a scene.

    By physical optics after up to `max_bounces` reflections, docs/theory.md eqs. (7) to (9), with a plane wave, without
    edges and creeping waves. Rough surfaces add the power that they scatter, in the mean over their speckle.

    Parameters
    ----------
    target : Mesh, Body or Scene
        A mesh is a perfect conductor. A body has its material, in the axes of its mesh; its motion does not matter. A
        scene has all its bodies where they are at `time`, in the world's axes.
    frequency : float or (frequency,) array_like
        Frequency [Hz].
    directions : (direction, 3) or (3,) array_like
        Unit vectors from the object to the radar.
    azimuth_deg, elevation_deg : array_like
        Directions by their angles, in place of `directions`: azimuth from x towards y, elevation from there towards z.
        Arrays of both are broadcast.
    receiver : (direction, 3) or (3,) array_like, optional
        Unit vectors from the object to a receiver elsewhere; default: monostatic.
    max_bounces : int
        Largest number of reflections of a path.
    polarization : "vertical", "horizontal" or (3,) array_like, optional
        Direction of the field of both antennas: "vertical" is the z axis of the radar, "horizontal" its y axis, where
        the radar looks upright at the object, as by `Pose.look_at` (from above or below, along z, with its y axis along
        y); or a unit vector in the axes of the object. Of every ray the direction across it. None: reflections are
        averaged over polarisations.
    time : float
        Time of a scene, or of a body that deforms [s].
    threads : int, optional
        Threads to use; default: all cores. The result does not depend on it.
    progress : bool
        Show a progress bar in a terminal when it takes long.

    Returns
    -------
    sigma : float64
        Cross-sections [m^2], in the shape of the directions, (direction,), or of the angles; an array of frequencies
        adds an axis at the end.

    See Also
    --------
    plot.rcs : Picture of cross-sections over azimuth.
    shapes : Plates, corners, spheres and others.
    PointTarget : Target of a cross-section that is known already.
    mesh_report : Whether a mesh is good enough.

    Notes
    -----
    It is the far field: distances beyond ``2 D**2 / wavelength`` for an object of extent D. `Simulator` has
    echoes from nearer, too.

    It is physical optics. Edge diffraction beyond the rim of the aperture and creeping waves are missing; nothing
    passes through surfaces. A thin wire, a sharp edge seen along its face, a shadow side, and a body smaller than a few
    wavelengths return something else in reality. An exact sphere of radius a differs by about ``1 / (2 k a)``, 1 % for
    4 cm at 60 GHz.

    More than `max_bounces` reflections are left out: a dihedral takes two, a trihedral three. All of a path are
    specular.

    Plates, spheres, cylinders and corners of 10 cm agree at 60 GHz with their closed forms within 0.12 dB, see
    benches/results/accuracy.md, "Cross-sections".

    Examples
    --------
    >>> plate = rc.shapes.plate(0.1, 0.1)
    >>> sigma = rc.rcs(plate, 60e9, azimuth_deg=180.0)
    >>> print(f"{10 * np.log10(sigma[0]):.2f} dBsm")
    17.02 dBsm
    """
    frequencies = check.array("frequency", frequency, (None,) if np.ndim(frequency) else ())
    shape, to_transmitter = _directions(directions, azimuth_deg, elevation_deg)
    to_receiver = to_transmitter if receiver is None else _units("receiver", receiver)
    count = max(len(to_transmitter), len(to_receiver))
    both = []
    for name, units in (("directions", to_transmitter), ("receiver", to_receiver)):
        if len(units) not in (1, count):
            raise ValueError(f"{name}: expected shape ({count}, 3), got {units.shape}")
        both.append(np.ascontiguousarray(np.broadcast_to(units, (count, 3))))
    fields = None if polarization is None else (_fields(polarization, both[0]), _fields(polarization, both[1]))
    bodies, poses = _bodies(target, check.number("time", time, "s"))
    if not any(len(body.mesh.triangles) for body in bodies):
        notice.warn("target: expected a mesh with triangles, got none: its cross-section is 0")
    surfaces = [_surface(body, time) for body in bodies]
    sections = []
    total = count * frequencies.size
    with notice.progress_if_long("cross-sections", "direction", total, shown=progress) as report:
        for number, at in enumerate(np.atleast_1d(frequencies).tolist()):
            at = check.frequency("frequency", at)

            def tell(num_done: int, before: int = number * count) -> None:
                report(before + num_done)

            sections.append(
                _core.cross_sections(
                    surfaces,
                    poses,
                    [body.material._core_at(at) for body in bodies],
                    *both,
                    frequency=at,
                    polarization=fields,
                    max_bounces=check.count("max_bounces", max_bounces, maximum=MAX_BOUNCES),
                    threads=check_threads(threads),
                    report=tell,
                )
            )
    shape = shape if np.prod(shape, dtype=int) == count else (count,)
    sigma = np.array(sections).reshape(frequencies.size, count).T.reshape(*shape, frequencies.size)
    return sigma if np.ndim(frequency) else sigma[..., 0]


def _directions(
    directions: ArrayLike | None, azimuth_deg: ArrayLike | None, elevation_deg: ArrayLike | None
) -> tuple[tuple[int, ...], NDArray[np.float64]]:
    """Shape of the directions, and unit vectors (direction, 3)."""
    if (directions is None) == (azimuth_deg is None and elevation_deg is None):
        got = "none" if directions is None else "both"
        raise ValueError(f"directions: expected either unit vectors or azimuth_deg and elevation_deg, got {got}")
    if directions is not None:
        units = _units("directions", directions)
        return units.shape[:1], units
    azimuth, elevation = _angles("azimuth_deg", azimuth_deg), _angles("elevation_deg", elevation_deg)
    try:
        azimuth, elevation = np.broadcast_arrays(np.deg2rad(azimuth), np.deg2rad(elevation))
    except ValueError:
        message = f"elevation_deg: expected a shape that fits {azimuth.shape} of azimuth_deg, got {elevation.shape}"
        raise ValueError(message) from None
    return np.atleast_1d(azimuth).shape, unit_vectors(azimuth, elevation).reshape(-1, 3)


def _angles(name: str, angles: ArrayLike | None) -> NDArray[np.float64]:
    """Angles [deg] of any shape; zero by default."""
    angles = 0.0 if angles is None else angles
    found = check.array(name, angles, (None,) * np.ndim(angles))
    check.degrees(name, found)
    return found


def _bodies(target: Mesh | Body | Scene, time: float) -> tuple[tuple[Body, ...], NDArray[np.float64]]:
    """Bodies of a target and their poses at a time [s], (body, 3, 4)."""
    check.instance("target", target, Mesh, Body, Scene)
    if isinstance(target, Scene):
        if len(target.parts.positions):
            raise ValueError("target: expected a scene of bodies with meshes, got one with a PointTarget")
        motions = Motions([body.motion for body in target.parts.meshed])
        return target.parts.meshed, np.ascontiguousarray(motions.poses_at(np.array([time]))[0])
    if isinstance(target, Mesh):
        target = Body(target, material=Material(reflection=-1.0))
    return (target,), np.eye(3, 4)[None]


def _surface(body: Body, time: float) -> _core.Surface:
    surface = body.mesh._core
    return surface if body.deformation is None else surface.deform(np.ascontiguousarray(body.vertices_at(time)))


def _units(name: str, value: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(value)
    vectors = check.array(name, array[None] if array.ndim == 1 else array, (None, 3))
    lengths = np.linalg.norm(vectors, axis=1)
    if (abs(lengths - 1.0) > 1e-3).any():
        raise ValueError(f"{name}: expected unit vectors, got one of length {lengths[abs(lengths - 1.0).argmax()]:g}")
    units: NDArray[np.float64] = vectors / lengths[:, None]
    return units


def _fields(polarization: str | ArrayLike, directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors along the fields of antennas in these directions, as far as they are across them."""
    if not isinstance(polarization, str):
        return np.ascontiguousarray(np.broadcast_to(_units("polarization", polarization), directions.shape))
    if polarization not in ("vertical", "horizontal"):
        raise ValueError(f"polarization: expected 'vertical', 'horizontal' or a unit vector, got {polarization!r}")
    # The y axis of a radar that looks upright at the object, and its z axis.
    x, y, _ = directions.T
    across = np.stack([-y, x, 0.0 * x], axis=1)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    across = np.where(length > 1e-9, across, [0.0, 1.0, 0.0]) / np.where(length > 1e-9, length, 1.0)
    return np.ascontiguousarray(across if polarization == "horizontal" else np.cross(directions, across))
