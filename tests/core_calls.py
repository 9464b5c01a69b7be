"""Calls of the compiled core with valid arguments; tests change single ones."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from radarcore import _core

NAN, INF = float("nan"), float("inf")
HUGE = 2**64 - 1

WAVEFORM: dict[str, Any] = {
    "start_frequency": 60e9,
    "slope": 1e13,
    "sample_rate": 2e6,
    "adc_delay": 0.0,
    "num_samples": 8,
    "chirp_times": np.array([0.0, 1e-4]),
}
DELAY = np.full((2, 3), 1e-8)
AMPLITUDE = np.ones((2, 3), complex)

# Two small squares that face the sensor, one body at x = 2 m: matt bodies take points by their area.
VERTICES = np.array([[0.0, y, z] for y in (-0.2, 0.0, 0.2) for z in (-0.1, 0.1)])
TRIANGLES = np.array([[0, 1, 3], [0, 3, 2], [2, 3, 5], [2, 5, 4]], np.uint32)
POSES = np.array([[[1.0, 0.0, 0.0, 2.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]])
IMAGE: dict[str, Any] = {"rows": 20, "columns": 30, "half_width": 0.5, "half_height": 0.5}
SENSOR = np.eye(3, 4)[None]
ARRAY: dict[str, Any] = {
    "tx": np.zeros((1, 3)),
    "rx": np.array([[0.0, 0.0, 0.0], [0.0, 0.1, 0.0]]),
    "tx_patterns": [_core.Pattern.gaussian(2.0, 1.0, 1.5)],
    "rx_patterns": [_core.Pattern.table(np.array([-1.0, 1.0]), np.array([-1.0, 1.0]), np.zeros((2, 2)))] * 2,
    "power": 1.0,
    "frequency": 60e9,
}
POINTS = np.array([[[3.0, 0.5, 0.0]]])
IMAGE_PLANE = (20, 30, 0.5, 0.5)
SETTINGS: dict[str, Any] = {
    "sampling": "footprint",
    "rotations": [np.eye(3).tolist()],
    "rcs_floor": 1e-3,
    "follows_echo": False,
    "ray_budget": 2000,
    "gain_floor": 1e-8,
    "max_bounces": 1,
    "bounce_floor": 1e-8,
    "retrace": 0.2,
    "seed": 0,
    "tolerance": 1e-4,
    "method": "direct",
    "debug": {"skip_empty": True, "reuse_tiles": True, "level": None},
}
SURFACE = _core.Surface(VERTICES, TRIANGLES)
MATERIAL = _core.Material.constant((-0.5, 0.0), 0.5)
GLASS = _core.Material.dielectric((6.31, -0.26), roughness=1e-4, thickness=4e-3)
SHAPE = (4, 5)
COSINES = np.array([1.0, 0.5, 0.0])
PIXELS = (*SHAPE, 0.02, 0.025, 2.5, 2.0)
SURFELS: dict[str, Any] = {
    "distance": np.full(SHAPE, 2.0),
    "normals": np.broadcast_to([-1.0, 0.0, 0.0], (*SHAPE, 3)).copy(),
    "reflection": np.full(SHAPE, -1.0 + 0j),
    "albedo": np.full(SHAPE, 0.1),
    "body": np.zeros(SHAPE, np.int32),
}


def waveform(**changes: Any) -> Any:
    return _core.Waveform(**(WAVEFORM | changes))


def beat(delay: Any = (DELAY,), amplitude: Any = (AMPLITUDE,), **changes: Any) -> Any:
    options = {"tolerance": 1e-9, "method": "direct", "is_nodal": False}
    options |= {name: changes.pop(name) for name in list(changes) if name not in WAVEFORM}
    samples, *_ = _core.beat_signal(delay, amplitude, waveform=waveform(**changes), **options)
    return samples


def antennas(**changes: Any) -> Any:
    return _core.Antennas(**(ARRAY | changes))


def plane(given: Any) -> Any:
    """Plane as the core takes it, from rows, columns and half its width and height; anything else as it is."""
    if not isinstance(given, tuple) or len(given) != 4:
        return given
    rows, columns, width, height = given
    return rows, columns, 2.0 * width / max(columns, 1), 2.0 * height / max(rows, 1), 0.5 * columns, 0.5 * rows


def settings(*, rays: Any = IMAGE_PLANE, tubes: Any = IMAGE_PLANE, image: Any = IMAGE_PLANE, **changes: Any) -> Any:
    planes = {"rays": [plane(rays)], "tubes": [plane(tubes)], "image": plane(image)}
    return SETTINGS | planes | changes


def surface(vertices: Any = VERTICES, triangles: Any = TRIANGLES, **changes: Any) -> Any:
    return _core.Surface(vertices, triangles, **changes)


def scene(surfaces: Any = (SURFACE,), rcs: Any = (1.0,), deforms: Any = False) -> Any:
    """Surfaces, then point targets."""
    return _core.Scene([*((surface, deforms) for surface in surfaces), *rcs])


def deforming_scene() -> Any:
    return scene(deforms=True)


def placement(sensor: Any = SENSOR, poses: Any = POSES[None], points: Any = POINTS, vertices: Any = ()) -> Any:
    return _core.Placement(sensor, poses, points, vertices)


def depth_scene(**changes: Any) -> Any:
    return _core.DepthScene(**({"plane": PIXELS, "num_bodies": 1} | SURFELS | changes))


def simulator(source: Any = None, materials: Any = (MATERIAL,), **changes: Any) -> Any:
    """Changes concern the simulator, its settings and its antennas."""
    array = {name: changes.pop(name) for name in list(changes) if name in ARRAY or name == "polarization"}
    planes = ("rays", "tubes", "image")
    chosen = {name: changes.pop(name) for name in list(changes) if name in SETTINGS or name in planes}
    arguments = {"antennas": antennas(**array), "waveform": waveform(), "center": (0.0, 0.0, 0.0)} | changes
    return _core.Simulator(
        scene() if source is None else source, list(materials), **({"settings": settings(**chosen)} | arguments)
    )


def frame(
    places: Any = None, source: Any = None, materials: Any = (MATERIAL,), rates: Any = None, **changes: Any
) -> Any:
    return simulator(source, materials, **changes).frame(placement() if places is None else places, rates)


def paths(at: Any = None, rates: Any = None, source: Any = None, materials: Any = (MATERIAL,), **changes: Any) -> Any:
    places = placement() if at is None else at
    moving = placement() if rates is None else rates
    return simulator(source, materials, **changes).paths(placement(), places, moving)


def cast(at: Any = None, source: Any = None, materials: Any = (MATERIAL,), **changes: Any) -> Any:
    image = (IMAGE | {name: changes.pop(name) for name in list(changes) if name in IMAGE}).values()
    return simulator(source, materials, image=tuple(image), **changes).image(placement() if at is None else at)


def occluded(points: Any = POINTS[0], **changes: Any) -> Any:
    return simulator().occluded(placement(), points, **changes)


HITS = cast()
NUM_PATHS = paths()[0].shape[1]
DEPTH_PLACES = placement(poses=np.zeros((1, 1, 3, 4)) + np.eye(3, 4), points=np.zeros((1, 0, 3)))


def surfels(**changes: Any) -> Any:
    """Frame of a depth image."""
    image = {name: changes.pop(name) for name in list(changes) if name not in ("threads", "seed")}
    return frame(DEPTH_PLACES, depth_scene(**image), [], **changes)


def deformed(vertices: Any = VERTICES[None], **changes: Any) -> Any:
    """Frame of a body that deforms."""
    return frame(placement(vertices=[vertices]), deforming_scene(), **changes)


def deformed_paths(vertex_rates: Any) -> Any:
    """Paths of a body that deforms."""
    places = placement(vertices=[VERTICES[None]])
    return simulator(deforming_scene()).paths(places, places, placement(vertices=[vertex_rates]))


ANGLES, GAINS = np.array([0.0, 1.0]), np.zeros((2, 2))


def table(azimuth: Any = ANGLES, elevation: Any = ANGLES, gain_db: Any = GAINS) -> Any:
    return _core.Pattern.table(azimuth, elevation, gain_db)


def reflectance(materials: Any = (MATERIAL,), **changes: Any) -> Any:
    _, cosines, body, _, normals = HITS
    return _core.reflectance(list(materials), body, cosines, normals, normals, **({"frequency": 60e9} | changes))


def response(cosine: Any = COSINES, **changes: Any) -> Any:
    return GLASS.response(cosine, **({"wavelength": 5e-3, "seen": None} | changes))


def deform(vertices: Any = VERTICES, **changes: Any) -> Any:
    return SURFACE.deform(vertices, **changes)


Call = Callable[[], Any]


def refuses(call: Call, error: type[Exception] | tuple[type[Exception], ...], message: str | None = None) -> None:
    """A panic is no Exception but a BaseException, so `pytest.raises` of any of these lets it through as a failure."""
    with pytest.raises(error, match=message):
        call()


EMPTY = _core.Scene([])
NOWHERE = placement(poses=np.zeros((1, 0, 3, 4)), points=np.zeros((1, 0, 3)))
EMPTY_HITS = cast(NOWHERE, EMPTY, [])
