"""The compiled core: exact dtypes, layouts and shapes, errors instead of panics, and threads beside it."""

from __future__ import annotations

import contextlib
import re
import sys
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from radarcore import _core

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

# Two squares that face the sensor, one body at x = 2 m.
VERTICES = np.array([[0.0, y, z] for y in (-1.0, 0.0, 1.0) for z in (-0.5, 0.5)])
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
POINTS, RCS = np.array([[[3.0, 0.5, 0.0]]]), np.ones(1)
IMAGE_PLANE = (20, 30, 0.5, 0.5)
SETTINGS: dict[str, Any] = {
    "sampling": "footprint",
    "rotations": [np.eye(3).tolist()],
    "rcs_floor": 1e-3,
    "follows_echo": False,
    "ray_budget": 2000,
    "end_points": True,
    "gain_floor": 1e-8,
    "skip_empty": True,
    "reuse_tiles": True,
    "max_bounces": 1,
    "bounce_floor": 1e-8,
    "retrace": 0.2,
    "seed": 0,
    "tolerance": 1e-4,
    "method": "direct",
}

SURFACE = _core.Surface(VERTICES, TRIANGLES)
MATERIAL = _core.Material.constant((-0.5, 0.0), 0.5)
GLASS = _core.Material.dielectric((6.31, -0.26), roughness=1e-4, thickness=4e-3)
SHAPE = (4, 5)
COSINES = np.array([1.0, 0.5, 0.0])
SURFELS: dict[str, Any] = {
    "distance": np.full(SHAPE, 2.0),
    "normals": np.broadcast_to([-1.0, 0.0, 0.0], (*SHAPE, 3)).copy(),
    "reflection": np.full(SHAPE, -1.0 + 0j),
    "albedo": np.full(SHAPE, 0.1),
    "body": np.zeros(SHAPE, np.int32),
}
CAMERA: dict[str, Any] = {"num_bodies": 1, "focal_length": (50.0, 60.0), "principal_point": (2.5, 2.0)}


def waveform(**changes: Any) -> Any:
    return _core.Waveform(**(WAVEFORM | changes))


def beat(delay: Any = DELAY, amplitude: Any = AMPLITUDE, *rates: Any, **changes: Any) -> Any:
    options = {"tolerance": 1e-9, "method": "direct"}
    options |= {name: changes.pop(name) for name in list(changes) if name not in WAVEFORM}
    samples, _ = _core.beat_signal(delay, amplitude, *rates, waveform=waveform(**changes), **options)
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
    return _core.Settings(**(SETTINGS | planes | changes))


def surface(vertices: Any = VERTICES, triangles: Any = TRIANGLES, **changes: Any) -> Any:
    return _core.Surface(vertices, triangles, **changes)


def scene(surfaces: Any = (SURFACE,), **changes: Any) -> Any:
    """Surfaces, then one point target."""
    number = len(surfaces)
    numbers = {"deforming": [], "rcs": RCS, "body_numbers": list(range(number)), "point_numbers": [number]}
    return _core.Scene(list(surfaces), **(numbers | changes))


def deforming_scene() -> Any:
    return scene(deforming=[0])


def placement(sensor: Any = SENSOR, poses: Any = POSES[None], points: Any = POINTS, vertices: Any = ()) -> Any:
    return _core.Placement(sensor, poses, points, vertices)


def depth_scene(**changes: Any) -> Any:
    arguments = SURFELS | CAMERA | changes
    return _core.DepthScene(*[arguments.pop(name) for name in SURFELS], **arguments)


def simulator(source: Any = None, materials: Any = (MATERIAL,), **changes: Any) -> Any:
    """Changes are those of the simulator, of its settings and of its antennas."""
    array = {name: changes.pop(name) for name in list(changes) if name in ARRAY or name == "polarization"}
    planes = ("rays", "tubes", "image")
    chosen = {name: changes.pop(name) for name in list(changes) if name in SETTINGS or name in planes}
    arguments = {
        "antennas": antennas(**array),
        "waveform": waveform(),
        "center": (0.0, 0.0, 0.0),
        "settings": settings(**chosen),
    }
    return _core.Simulator(scene() if source is None else source, list(materials), **(arguments | changes))


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
    return HITS.reflectance(list(materials), **({"frequency": 60e9} | changes))


def response(cosine: Any = COSINES, **changes: Any) -> Any:
    return GLASS.response(cosine, **({"wavelength": 5e-3, "te": 0.5, "tm": 0.5} | changes))


def deform(vertices: Any = VERTICES, **changes: Any) -> Any:
    return SURFACE.deform(vertices, **changes)


Call = Callable[[], Any]


def refuses(call: Call, error: type[Exception] | tuple[type[Exception], ...], message: str | None = None) -> None:
    """A panic is no Exception but a BaseException, so `pytest.raises` of any of these lets it through as a failure."""
    with pytest.raises(error, match=message):
        call()


def test_all_triangles_that_are_kept_need_no_rows() -> None:
    for made in (surface(np.zeros((0, 3)), np.zeros((0, 3), np.uint32)), surface(crease_angle=NAN), SURFACE):
        assert made.kept() is None
    assert surface(crease_angle=-1.0).kept() is None
    tree, vertices = SURFACE.memory
    assert 4 * 12 < tree < 4000
    assert vertices == VERTICES.nbytes


def test_results_are_contiguous_arrays_of_their_documented_type() -> None:
    delay, delay_rate, amplitude, body, order = paths()
    for array, dtype, shape in [
        (beat(), "complex128", (2, 2, 8)),
        (HITS.distance(), "float64", (20, 30)),
        (HITS.cos_incidence(), "float64", (20, 30)),
        (reflectance(), "float64", (20, 30)),
        (reflectance([GLASS], polarization=(0.0, 0.0, 1.0)), "float64", (20, 30)),
        (table().gain(np.zeros(3), np.ones(3)), "float64", (3,)),
        (response()[0], "complex128", (3,)),
        (response()[1], "float64", (3,)),
        (HITS.body(), "int32", (20, 30)),
        (HITS.directions(), "float64", (20, 30, 3)),
        (HITS.smooth()[0], "float64", (20, 30)),
        (HITS.smooth()[1], "float64", (20, 30, 3)),
        (frame().cube, "complex64", (2, 2, 8)),
        (frame(tolerance=1e-7).cube, "complex128", (2, 2, 8)),
        (frame().truth, "float64", (2, 4)),
        (deformed().cube, "complex64", (2, 2, 8)),
        (surfels().cube, "complex64", (2, 2, 8)),
        (delay, "float64", (2, NUM_PATHS)),
        (delay_rate, "float64", (2, NUM_PATHS)),
        (amplitude, "complex128", (2, NUM_PATHS)),
        (body, "uint32", (NUM_PATHS,)),
        (order, "uint8", (NUM_PATHS,)),
        (occluded()[0], "bool", (1,)),
    ]:
        assert (array.dtype, array.shape) == (dtype, shape)
        assert array.flags.c_contiguous
        assert array.flags.writeable
    assert NUM_PATHS > 100  # the plate is in sight
    assert surfels().truth is None


# Every array argument of the core: how to call it with another one, and one that it takes.
ARGUMENTS: dict[str, tuple[Callable[[Any], Any], NDArray[Any]]] = {
    "beat delay": (lambda a: beat(delay=a), DELAY),
    "beat amplitude": (lambda a: beat(amplitude=a), AMPLITUDE),
    "beat chirp_times": (lambda a: beat(chirp_times=a), WAVEFORM["chirp_times"]),
    "surface vertices": (lambda a: surface(vertices=a), VERTICES),
    "surface triangles": (lambda a: surface(triangles=a), TRIANGLES),
    "response cosine": (lambda a: response(a), COSINES),
    "antennas tx": (lambda a: antennas(tx=a, tx_patterns=ARRAY["rx_patterns"]), ARRAY["rx"]),
    "antennas rx": (lambda a: antennas(rx=a), ARRAY["rx"]),
    "table azimuth": (lambda a: table(azimuth=a), np.array([-0.5, 1.0])),
    "table elevation": (lambda a: table(elevation=a), np.array([-0.5, 1.0])),
    "table gain_db": (lambda a: table(gain_db=a), np.array([[0.0, 1.0], [2.0, 3.0]])),
    "gain azimuth": (lambda a: table().gain(a, np.zeros(2)), np.array([0.1, 0.2])),
    "gain elevation": (lambda a: table().gain(np.zeros(2), a), np.array([0.1, 0.2])),
    **{f"depth {name}": (lambda a, name=name: depth_scene(**{name: a}), SURFELS[name]) for name in SURFELS},
    "depth range_rate": (lambda a: depth_scene(range_rate=a), SURFELS["distance"]),
    "scene rcs": (lambda a: scene(rcs=a, point_numbers=[1, 2]), np.ones(2)),
    "placement sensor": (lambda a: placement(sensor=a), SENSOR),
    "placement poses": (lambda a: placement(poses=a), POSES[None]),
    "placement points": (lambda a: placement(points=a), POINTS),
    "placement vertices": (lambda a: placement(vertices=[a]), VERTICES[None]),
    "occluded points": (lambda a: occluded(a), POINTS[0]),
    "deform vertices": (lambda a: deform(a), VERTICES),
}
each_argument = pytest.mark.parametrize("argument", ARGUMENTS)


@each_argument
def test_wrong_dtype_is_a_type_error(argument: str) -> None:
    call, good = ARGUMENTS[argument]
    call(good)
    kinds: list[Any] = ["float32", "float64", "complex64", "complex128", "int64", "uint32", "int32", "bool", "U4", "O"]
    for dtype in kinds:
        if good.dtype != dtype:
            bad = np.zeros_like(good, shape=good.shape).real.astype(dtype)
            refuses(lambda bad=bad: call(bad), TypeError)
    refuses(lambda: call(good.astype(good.dtype.newbyteorder(">"))), TypeError)
    for thing in (good.tolist(), None, "array", 1.0, memoryview(good)):
        if argument == "depth range_rate" and thing is None:  # nothing moves
            continue
        refuses(lambda thing=thing: call(thing), TypeError)


@each_argument
def test_array_that_is_not_contiguous_is_a_type_error(argument: str) -> None:
    call, good = ARGUMENTS[argument]
    call(np.ascontiguousarray(good))
    strided = np.repeat(good, 2, axis=-1)[..., ::2]
    backwards = np.ascontiguousarray(good[..., ::-1])[..., ::-1]
    for bad in (strided, backwards):
        assert not bad.flags.c_contiguous
        np.testing.assert_array_equal(bad, good)
        refuses(lambda bad=bad: call(bad), TypeError, "contiguous")
    fortran = np.asfortranarray(good)
    if not fortran.flags.c_contiguous:
        refuses(lambda: call(fortran), TypeError, "contiguous")


@each_argument
def test_read_only_array_is_taken_and_left_alone(argument: str) -> None:
    call, good = ARGUMENTS[argument]
    before, good = good, good.copy()
    good.flags.writeable = False
    call(good)
    np.testing.assert_array_equal(good, before)


@each_argument
def test_wrong_number_of_axes_is_a_type_error(argument: str) -> None:
    call, good = ARGUMENTS[argument]
    if argument in ("beat delay", "beat amplitude"):  # any of one to three axes, which have to fit together
        return
    refuses(lambda: call(good[None]), TypeError)
    refuses(lambda: call(good[0]), TypeError)
    refuses(lambda: call(good.reshape(-1)[:1].reshape(())), TypeError)


NAN, INF = float("nan"), float("inf")
HUGE = 2**64 - 1
EMPTY = _core.Scene([], deforming=[], rcs=np.zeros(0), body_numbers=[], point_numbers=[])
NOWHERE = placement(poses=np.zeros((1, 0, 3, 4)), points=np.zeros((1, 0, 3)))
EMPTY_HITS = cast(NOWHERE, EMPTY, [])
TWICE = np.concatenate([SENSOR, SENSOR])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        # Shapes that hold as many numbers, but others.
        (lambda: beat(amplitude=np.ones((3, 2), complex)), r"amplitude: expected shape \[2, 3\], got \[3, 2\]"),
        (lambda: beat(amplitude=np.ones((2, 2, 3), complex)), r"amplitude: expected shape \[2, 3\], got \[2, 2, 3\]"),
        *(
            (
                lambda shape=shape: beat(np.ones((4, 2, 3)), np.ones(shape, complex)),
                rf"amplitude: expected shape \[2, 3\], or those with nodes in front, got {re.escape(str(list(shape)))}",
            )
            for shape in ((3, 2), (3, 3, 2), (0, 2, 3), (4, 2), (1, 3, 2, 3))
        ),
        (lambda: beat(DELAY, AMPLITUDE, DELAY[0]), r"delay_rate: expected shape \[2, 3\]"),
        (lambda: beat(DELAY, AMPLITUDE, DELAY, DELAY.T.copy()), r"delay_acceleration: expected shape \[2, 3\]"),
        (lambda: beat(DELAY, AMPLITUDE, None, DELAY), "delay_rate: expected one together with delay_acceleration"),
        (lambda: beat(DELAY[None], AMPLITUDE, DELAY), "delay_rate: expected .* without nodes"),
        (lambda: beat(np.ones(()), np.ones((), complex)), "delay: expected one to three axes"),
        (lambda: beat(np.ones((1, 1, 2, 3)), np.ones((1, 1, 2, 3), complex)), "delay: expected one to three axes"),
        (lambda: beat(np.zeros((0, 2, 3))), "delay: expected 1 to 4096 nodes, got 0"),
        (lambda: beat(np.zeros((4097, 2, 3))), "delay: expected 1 to 4096 nodes, got 4097"),
        (lambda: beat(method="fast"), "method: expected 'auto'"),
        (lambda: beat(level="avx9"), "level: expected one of"),
        (lambda: surface(VERTICES.reshape(3, 6)), r"vertices: expected shape \(n, 3\), got \(3, 6\)"),
        (lambda: surface(VERTICES.reshape(9, 2)), r"vertices: expected shape \(n, 3\), got \(9, 2\)"),
        (lambda: surface(np.zeros((6, 0))), r"vertices: expected shape \(n, 3\), got \(6, 0\)"),
        (lambda: surface(triangles=TRIANGLES.reshape(3, 4)), r"triangles: expected shape \(n, 3\), got \(3, 4\)"),
        (lambda: simulator(materials=[]), "materials: expected 1, one per body, got 0"),
        (lambda: simulator(materials=[MATERIAL, GLASS]), "materials: expected 1, one per body, got 2"),
        (lambda: simulator(EMPTY, [MATERIAL]), "materials: expected 0, one per body, got 1"),
        (lambda: reflectance([]), "materials: expected 1, one per body, got 0"),
        (
            lambda: _core.Material.dielectric((2.0, 0.0), roughness=1e-4, scattering=0.1),
            "scattering: expected none with roughness, got both",
        ),
        # Places: of an odd number of times, and of what the scene has.
        (lambda: placement(sensor=np.zeros((0, 3, 4))), "sensor: expected an odd number of times, got 0"),
        (lambda: placement(sensor=TWICE), "sensor: expected an odd number of times, got 2"),
        (lambda: placement(sensor=np.zeros((1, 4, 3))), r"sensor: expected shape \(n, 3, 4\), got \(1, 4, 3\)"),
        (lambda: placement(poses=np.zeros((1, 1, 4, 3))), r"poses: expected shape \(1, n, 3, 4\), got \(1, 1, 4, 3\)"),
        (lambda: placement(poses=np.zeros((3, 1, 3, 4))), r"poses: expected shape \(1, n, 3, 4\), got \(3, 1, 3, 4\)"),
        (lambda: placement(points=np.zeros((3, 1, 3))), r"points: expected shape \(1, n, 3\), got \(3, 1, 3\)"),
        (lambda: placement(points=np.zeros((1, 3, 1))), r"points: expected shape \(1, n, 3\), got \(1, 3, 1\)"),
        (lambda: placement(vertices=[np.zeros((1, 3, 6))]), r"vertices: expected shape \(n, n, 3\), got \(1, 3, 6\)"),
        *(
            (lambda call=call, bad=bad: call(bad), f"{message} as the scene has, got")
            for call in (frame, cast, paths, lambda bad: paths(rates=bad), lambda bad: frame(rates=bad))
            for bad, message in (
                (placement(poses=np.zeros((1, 2, 3, 4))), "poses: expected 1 of them"),
                (placement(poses=np.zeros((1, 0, 3, 4))), "poses: expected 1 of them"),
                (placement(points=np.zeros((1, 2, 3))), "points: expected 1 of them"),
                (placement(points=np.zeros((1, 0, 3))), "points: expected 1 of them"),
                (placement(vertices=[VERTICES[None]]), "vertices: expected 0 of them"),
            )
        ),
        (lambda: cast(source=EMPTY, materials=[]), "poses: expected 0 of them as the scene has, got 1"),
        (lambda: surfels(num_bodies=2), "poses: expected 2 of them as the scene has, got 1"),
        (lambda: deformed(VERTICES[None, :5]), "vertices: expected 6 as the mesh has, got 5"),
        (lambda: deformed(VERTICES[:0, None]), "vertices: expected 6 as the mesh has, got 0"),
        (lambda: deformed_paths(VERTICES[None, 1:]), "vertices: expected 6 as the mesh has, got 5"),
        (lambda: deformed(VERTICES[None] * NAN), "vertices: expected finite coordinates.*at row 0"),
        (lambda: frame(source=deforming_scene()), "vertices: expected 1 of them as the scene has, got 0"),
        (lambda: occluded(np.zeros((1, 4))), r"points: expected shape \(n, 3\), got \(1, 4\)"),
        # Scenes and settings.
        (lambda: scene(rcs=np.ones(2)), "rcs: expected 1 of them, got 2"),
        (lambda: scene(body_numbers=[]), "body_numbers: expected 1 of them, got 0"),
        (lambda: scene(deforming=[1]), r"deforming: expected increasing numbers below 1, got \[1\]"),
        (lambda: scene(deforming=[0, 0]), r"deforming: expected increasing numbers below 1, got \[0, 0\]"),
        (lambda: scene(deforming=[HUGE]), r"deforming: expected increasing numbers below 1"),
        (
            lambda: scene(body_numbers=[1]),
            r"body_numbers, point_numbers: expected every number below 2 once .*\[1, 1\]",
        ),
        (lambda: scene(point_numbers=[HUGE]), "body_numbers, point_numbers: expected every number below 2 once"),
        (lambda: settings(sampling="fine"), "sampling: expected 'adaptive', 'footprint' or 'point', got \"fine\""),
        (lambda: settings(method="fast"), "method: expected 'auto'"),
        (lambda: frame(rays=(0, 1, 0.5, 0.5)), "resolution: expected at least one row and one column, got 0 x 1"),
        (lambda: frame(rays=(HUGE, HUGE, 0.5, 0.5)), "resolution: expected at most 268435456 rays"),
        (
            lambda: frame(sampling="adaptive", rays=(0, 1, 0.5, 0.5)),
            "resolution: expected at least one row and one column, got 0 x 1",
        ),
        (
            lambda: frame(sampling="adaptive", rays=(HUGE, HUGE, 0.5, 0.5)),
            "resolution: expected at most 268435456 rays",
        ),
        (lambda: antennas(tx=np.zeros((3, 1))), r"tx: expected shape \(n, 3\), got \(3, 1\)"),
        (lambda: antennas(rx=np.zeros((1, 6))), r"rx: expected shape \(n, 3\), got \(1, 6\)"),
        (lambda: antennas(tx=np.zeros((2, 3))), "tx_patterns: expected 2, one per antenna, got 1"),
        (lambda: antennas(rx_patterns=[]), "rx_patterns: expected 2, one per antenna, got 0"),
        (lambda: table(gain_db=np.zeros((2, 3))), r"gain_db: expected shape \(2, 2\), got \(2, 3\)"),
        (lambda: table().gain(np.zeros(2), np.zeros(3)), r"elevation: expected shape \(2,\), got \(3,\)"),
        (lambda: deform(VERTICES[:5]), "vertices: expected 6 as the mesh has, got 5"),
        (lambda: deform(VERTICES.reshape(9, 2)), r"vertices: expected shape \(n, 3\), got \(9, 2\)"),
        (lambda: deform(VERTICES * NAN), "vertices: expected finite coordinates.*at row 0"),
        (lambda: deform(VERTICES * 1e200), r"vertices: expected coordinates below 1e15 m.*at row 0"),
        (lambda: depth_scene(normals=np.zeros((4, 3, 5))), r"normals: expected shape \(4, 5, 3\), got \(4, 3, 5\)"),
        (lambda: surfels(albedo=np.zeros((5, 4))), r"albedo: expected shape \(4, 5\), got \(5, 4\)"),
        (lambda: surfels(body=np.zeros((4, 4), np.int32)), r"body: expected shape \(4, 5\), got \(4, 4\)"),
        # Values that no result can be formed for.
        (lambda: surfels(body=np.full(SHAPE, 1, np.int32)), "body: expected numbers below 1, got 1"),
        (lambda: surfels(focal_length=(0.0, 1.0)), "field_of_view: expected angles"),
        (lambda: surfels(focal_length=(1.0, NAN)), "field_of_view: expected angles"),
        (lambda: surfels(principal_point=(INF, 1.0)), "principal_point: expected finite numbers"),
        (lambda: table(np.array([1.0, 0.0])), "azimuth: expected increasing angles .*, got 1 and then 0"),
        (lambda: table(np.array([0.0, 4.0])), "azimuth: expected angles from -3.141593 to 3.141593 .*, got 4"),
        (lambda: table(elevation=np.array([NAN, 1.0])), "elevation: expected angles from -1.57.*, got NaN"),
        (lambda: table(gain_db=np.full((2, 2), -INF)), "gain_db: expected -1000 to 1000 dB, got -inf"),
        (lambda: table(np.zeros(1), gain_db=np.zeros((1, 2))), "azimuth: expected at least two angles, got 1"),
        (lambda: table(np.zeros(0), np.zeros(0), np.zeros((0, 0))), "azimuth: expected at least two angles, got 0"),
        (lambda: beat(np.full((2, 3), NAN)), "delay: expected finite numbers, got NaN at flat index 0"),
        (lambda: beat(amplitude=np.full((2, 3), INF + 0j)), "amplitude: expected finite numbers, got inf"),
        (lambda: beat(start_frequency=NAN), "waveform: expected finite numbers"),
        (lambda: beat(chirp_times=np.array([0.0, INF])), "waveform: expected finite numbers"),
        (lambda: beat(sample_rate=0.0), "waveform: expected samples, chirps and a positive sample rate"),
        (lambda: beat(num_samples=0), "waveform: expected samples, chirps"),
        (lambda: beat(chirp_times=np.zeros(0)), "waveform: expected samples, chirps"),
        (lambda: surface(VERTICES * NAN), "vertices: expected finite coordinates.*at row 0"),
        (lambda: surface(VERTICES * 1e200), r"vertices: expected coordinates below 1e15 m.*at row 0"),
        (lambda: surface(triangles=TRIANGLES + np.uint32(1)), "triangles: expected vertex numbers below 6.*at row 2"),
        (lambda: surface(triangles=TRIANGLES - np.uint32(1)), "triangles: expected vertex numbers below 6.*at row 0"),
        (lambda: surface(np.zeros((0, 3))), "triangles: expected vertex numbers below 0, got .* at row 0"),
        (lambda: cast(rows=0), "resolution: expected at least one row and one column, got 0 x 30"),
        (lambda: cast(columns=0), "resolution: expected at least one row and one column, got 20 x 0"),
        (lambda: cast(rows=2**24), "resolution: expected at most 268435456 rays, got 16777216 x 30"),
        (lambda: cast(rows=HUGE), "resolution: expected at most 268435456 rays"),
        (lambda: cast(rows=2**32, columns=2**32), "resolution: expected at most 268435456 rays"),
        (lambda: cast(rows=HUGE, columns=HUGE), "resolution: expected at most 268435456 rays"),
        (lambda: cast(half_width=0.0), "field_of_view: expected angles between 0 and 180 degrees"),
        (lambda: cast(half_height=-1.0), "field_of_view: expected"),
        (lambda: cast(half_height=NAN), "field_of_view: expected"),
        (lambda: cast(half_width=INF), "field_of_view: expected"),
    ],
)
def test_what_does_not_fit_together_is_a_value_error(call: Call, message: str) -> None:
    refuses(call, ValueError, message)


@pytest.mark.parametrize("threads", [0, 1025, 2**32, HUGE])
@pytest.mark.parametrize(
    "call", [beat, cast, deform, frame, surfels, paths, reflectance, HITS.cos_incidence, HITS.smooth]
)
def test_pool_has_one_to_1024_threads(call: Any, threads: int) -> None:
    refuses(lambda: call(threads=threads), ValueError, f"threads: expected 1 to 1024, got {threads}")


@pytest.mark.parametrize(
    "call",
    [
        lambda: beat(num_samples=2**40),
        lambda: beat(num_samples=2**62),
        lambda: beat(num_samples=HUGE),
        lambda: beat(np.zeros((2**40, 0)), np.zeros((2**40, 0), complex)),
        lambda: beat(np.zeros((2**58, 0)), np.zeros((2**58, 0), complex)),
        lambda: beat(np.zeros((2**40, 0)), np.zeros((2**40, 0), complex), method="auto"),
        lambda: frame(waveform=waveform(num_samples=2**40)),
        lambda: frame(waveform=waveform(num_samples=HUGE)),
        lambda: surfels(num_bodies=HUGE),
    ],
)
def test_what_memory_cannot_hold_is_a_memory_error(call: Call) -> None:
    refuses(call, MemoryError, "(samples|bodies): .* do not fit into memory")


@pytest.mark.parametrize(
    ("call", "error"),
    [
        (lambda: beat(num_samples=-1), OverflowError),
        (lambda: beat(num_samples=2**64), OverflowError),
        (lambda: beat(num_samples=8.0), TypeError),
        (lambda: beat(slope="1e13"), TypeError),
        (lambda: beat(tolerance="1e-3"), TypeError),
        (lambda: beat(split_still=1), TypeError),
        (lambda: beat(threads=-1), OverflowError),
        (lambda: beat(threads=1.0), TypeError),
        (lambda: cast(rows=-1), OverflowError),
        (lambda: cast(rows=8.0), TypeError),
        (lambda: cast(half_width=None), TypeError),
        (lambda: settings(seed=-1), OverflowError),
        (lambda: settings(seed=2**64), OverflowError),
        (lambda: settings(seed=1.0), TypeError),
        (lambda: settings(rays=(1, 1, 0.5)), (TypeError, ValueError)),
        (lambda: settings(image=None), TypeError),
        (lambda: settings(rotations=[]), ValueError),
        (lambda: settings(rotations=[np.diag([-1.0, -1.0, 1.0]).tolist()]), ValueError),
        (lambda: settings(rotations=2 * [np.eye(3).tolist()]), ValueError),
        (lambda: settings(ray_budget=-1), OverflowError),
        (lambda: settings(retrace="10"), TypeError),
        (lambda: settings(skip_empty=1), TypeError),
        (lambda: settings(threads=1), TypeError),
        (lambda: antennas(rx_patterns=[None, None]), TypeError),
        (lambda: antennas(rx_patterns=None), TypeError),
        (lambda: _core.Pattern(), TypeError),
        (lambda: _core.Pattern.gaussian(1.0, 0.0), TypeError),
        (lambda: simulator(antennas=None), TypeError),
        (lambda: simulator(waveform=None), TypeError),
        (lambda: simulator(settings=SETTINGS), TypeError),
        (lambda: simulator(SURFACE), TypeError),
        (lambda: simulator(center=(0.0, 0.0)), (TypeError, ValueError)),
        (lambda: simulator().frame(), TypeError),
        (lambda: simulator().frame(placement(), POSES), TypeError),
        (lambda: simulator().image(None), TypeError),
        (lambda: placement(vertices=VERTICES), TypeError),
        (lambda: scene(deforming=[-1]), OverflowError),
        (lambda: scene(deforming=[0.0]), TypeError),
        (lambda: depth_scene(num_bodies=-1), OverflowError),
        (lambda: depth_scene(age=None), TypeError),
        (lambda: scene([None]), TypeError),
        (lambda: scene(["surface"]), TypeError),
        (lambda: _core.Scene(SURFACE), TypeError),
        (lambda: simulator(materials=[None]), TypeError),
        (lambda: antennas(polarization="vertical"), (TypeError, ValueError)),
        (lambda: antennas(polarization=(1.0, 0.0)), (TypeError, ValueError)),
        (lambda: response(wavelength=None), TypeError),
        (lambda: _core.Material.constant(-1.0 + 0.0j, 0.0), TypeError),
        (lambda: _core.Material(), TypeError),
        (lambda: surface(crease_angle="45"), TypeError),
        (lambda: SURFACE.quality(crease_angle=None, wavelength=5e-3), TypeError),
        (lambda: _core.beat_signal(DELAY, AMPLITUDE), TypeError),
        (lambda: _core.Hits(), TypeError),
        (lambda: _core.IdealFrame(), TypeError),
        (lambda: _core.Settings(), TypeError),
        (lambda: _core.load_obj(7), TypeError),
        (lambda: _core.load_obj(""), FileNotFoundError),
        (lambda: _core.load_obj("no such\n file.obj"), FileNotFoundError),
        (lambda: _core.load_obj("/"), IsADirectoryError),
        (lambda: _core.load_obj("nul\0.obj"), (OSError, ValueError)),
    ],
)
def test_numbers_and_things_of_the_wrong_kind_are_refused(call: Call, error: Any) -> None:
    refuses(call, error)


def poses_of_nothing() -> Any:
    return placement(poses=np.zeros((1, 0, 3, 4)))


@pytest.mark.parametrize(
    ("call", "shape"),
    [
        (lambda: beat(np.zeros((0, 3)), np.zeros((0, 3), complex)), (0, 2, 8)),
        (lambda: beat(np.zeros((2, 0)), np.zeros((2, 0), complex), np.zeros((2, 0))), (2, 2, 8)),
        (lambda: beat(np.zeros((2, 0)), np.zeros((2, 0), complex), method="auto"), (2, 2, 8)),
        (lambda: beat(np.zeros((4, 2, 0)), np.zeros((4, 2, 0), complex)), (2, 2, 8)),
        (lambda: beat(np.zeros((4, 0, 3)), np.zeros((4, 0, 3), complex), method="auto"), (0, 2, 8)),
        (lambda: beat(num_samples=1, chirp_times=np.zeros(1)), (2, 1, 1)),
        (lambda: surface(triangles=np.zeros((2, 3), np.uint32)).kept(), (0,)),  # degenerate: dropped
        (lambda: EMPTY_HITS.distance(), (20, 30)),
        (lambda: frame(NOWHERE, EMPTY, []).cube, (2, 2, 8)),
        (lambda: frame(NOWHERE, EMPTY, []).truth, (0, 4)),
        (lambda: frame(NOWHERE, EMPTY, [], sampling="adaptive").cube, (2, 2, 8)),
        (lambda: cast(rows=1, columns=1).distance(), (1, 1)),
        (lambda: cast(rows=1, columns=1000).directions(), (1, 1000, 3)),
        (lambda: frame(tx=np.zeros((0, 3)), tx_patterns=[]).cube, (0, 2, 8)),
        (lambda: paths(tx=np.zeros((0, 3)), tx_patterns=[])[0], None),
        (lambda: paths(seed=HUGE)[0], (2, NUM_PATHS)),
        (lambda: occluded(np.zeros((0, 3)))[0], (0,)),
        (lambda: frame(poses_of_nothing(), scene([]), []).cube, (2, 2, 8)),
        (lambda: frame(poses_of_nothing(), scene([]), []).truth, (1, 4)),
    ],
)
def test_nothing_is_an_answer(call: Call, shape: tuple[int, ...] | None) -> None:
    result = call()
    assert result.size == 0 if shape is None else result.shape == shape


@pytest.mark.parametrize("value", [NAN, INF, -INF, 1e300, -1e300, 1e-300, 0.0])
def test_wild_numbers_neither_panic_nor_hang(value: float) -> None:
    wild_places = placement(poses=np.full((1, 1, 3, 4), value), points=np.full((1, 1, 3), value))
    turned = placement(sensor=np.full((1, 3, 4), value))
    series = np.full((5, 1, 3, 4), value)
    series[2] = POSES
    jumping = placement(np.repeat(SENSOR, 5, axis=0), series, np.repeat(POINTS, 5, axis=0))
    wild_antennas = {"tx": np.full((1, 3), value), "rx": np.full((2, 3), -value)}
    wild_beam = [_core.Pattern.gaussian(value, value, value)]
    wild_materials = [
        _core.Material.constant((value, value), value),
        _core.Material.dielectric((value, value), roughness=value, thickness=value),
        _core.Material.dielectric((value, -value), scattering=value),
    ]
    calls: list[Call] = [
        lambda: cast(wild_places).body(),
        lambda: cast(turned).body(),
        lambda: occluded(np.full((2, 3), value)),
        lambda: simulator().occluded(wild_places, POINTS[0]),
        lambda: paths(wild_places),
        lambda: paths(rates=wild_places),
        lambda: depth_scene(age=value),
        lambda: surfels(age=value, range_rate=np.full(SHAPE, value)),
        lambda: deformed(np.full((1, 6, 3), value)),
        lambda: deformed_paths(np.full((1, 6, 3), value)),
        lambda: deformed(np.concatenate([VERTICES[None], np.full((2, 6, 3), value)])),
        *(lambda name=name: surfels(**{name: np.full_like(SURFELS[name], value)}) for name in list(SURFELS)[:-1]),
    ]
    for sampling in ("footprint", "adaptive", "point"):
        options: dict[str, Any] = {"sampling": sampling, "rays": (8, 8, 0.5, 0.5)}
        calls += [
            lambda options=options: frame(wild_places, **options),
            lambda options=options: frame(turned, **options),
            lambda options=options: frame(jumping, **options),
            lambda options=options: frame(rates=wild_places, **options),
            lambda options=options: frame(source=scene(rcs=np.full(1, value)), **options),
            lambda options=options: frame(materials=[GLASS], polarization=(value,) * 3, **options),
            lambda options=options: frame(frequency=value, power=value, **options),
            lambda options=options: frame(center=(value,) * 3, **options),
            lambda options=options: frame(**wild_antennas, **options),
            lambda options=options: frame(tx_patterns=wild_beam, gain_floor=value, **options),
            lambda options=options: frame(gain_floor=value, bounce_floor=value, max_bounces=3, **options),
            lambda options=options: frame(rcs_floor=value, retrace=value, **options),
            lambda options=options: frame(tolerance=value, **options),
            *(
                lambda options=options, material=material: frame(materials=[material], **options)
                for material in wild_materials
            ),
        ]
    for call in calls:
        # What is not finite may be refused by name; a panic is a BaseException and no answer.
        with contextlib.suppress(ValueError, MemoryError):
            call()
    table().gain(np.full(2, value), np.full(2, -value))
    SURFACE.quality(crease_angle=value, wavelength=value)
    for material in wild_materials:
        reflectance([material], polarization=(value,) * 3)
        material.response(np.array([0.0, 1.0, value]), wavelength=value, te=value, tm=value)
    if np.isfinite(value):
        wild, rates_of = np.full((2, 3), value), np.full((2, 3), value)
        for method in ("direct", "auto", "grid", "recurrence", "lanes"):
            try:
                samples = beat(wild, wild + 0j, rates_of, rates_of, slope=value, start_frequency=value, method=method)
            except (ValueError, MemoryError):
                continue
            assert np.isfinite(samples).all()


def test_wild_surfaces_neither_panic_nor_hang() -> None:
    rng = np.random.default_rng(0)
    for scale in (1e-300, 1e-9, 1.0, 1e9, 9e14):
        for shape in ((3, 1), (50, 30), (50, 500)):
            vertices = scale * rng.uniform(-1.0, 1.0, (shape[0], 3))
            triangles = rng.integers(0, shape[0], (shape[1], 3)).astype(np.uint32)
            for crease_angle in (None, 0.0, 0.8, 7.0, NAN):
                body = surface(vertices, triangles, crease_angle=crease_angle)
                assert np.isin(cast(source=scene([body])).body(), (-1, 0)).all()
                with contextlib.suppress(ValueError):  # of delays that no sum can take
                    frame(source=scene([body]))
                body.quality(crease_angle=0.8, wavelength=scale)


def test_threads_do_not_change_a_bit() -> None:
    rng = np.random.default_rng(1)
    vertices = np.concatenate([VERTICES, rng.uniform(-1.0, 1.0, (24, 3))])
    triangles = np.concatenate([TRIANGLES, np.arange(6, 30, dtype=np.uint32).reshape(8, 3)])
    body = surface(vertices, triangles, crease_angle=0.8)
    two = POSES + np.array([0.0, 0.0, 0.0, -0.5]) * np.arange(2)[:, None, None]
    nodes = two + 1e-3 * np.cos(np.pi * (np.arange(5) + 0.5) / 5.0)[:, None, None, None] * np.eye(3, 4, 3)
    points = np.repeat(rng.uniform(1.0, 3.0, (1, 7, 3)), 5, axis=0)
    places = placement(np.repeat(SENSOR, 5, axis=0), nodes, points)
    at, rates = (
        placement(SENSOR, nodes[2:3], points[:1]),
        placement(0.0 * SENSOR, nodes[:1] - nodes[2:3], 0.0 * points[:1]),
    )
    world = scene([body, SURFACE], rcs=np.ones(7), point_numbers=list(range(2, 9)))
    materials, plane = [MATERIAL, GLASS], (67, 91, 0.5, 0.5)

    def everything(threads: int | None) -> list[NDArray[Any]]:
        sim = simulator(world, materials, threads=threads, rays=plane, image=plane, method="auto")
        hits, found = sim.image(at), sim.frame(places)
        adaptive = simulator(world, materials, threads=threads, sampling="adaptive", max_bounces=2)
        return [
            hits.distance(),
            hits.body(),
            hits.cos_incidence(threads=threads),
            *sim.paths(places, at, rates),
            found.cube,
            found.truth,
            adaptive.frame(places).cube,
            hits.reflectance(materials, frequency=60e9, threads=threads),
            *(
                beat(DELAY, AMPLITUDE, num_samples=130, threads=threads, method=method, tolerance=1e-5)
                for method in ("direct", "auto")
            ),
        ]

    first = everything(1)
    assert (first[1] >= 0).sum() > 1000
    assert set(range(9)) == set(first[6].tolist())
    for threads in (2, 3, None):
        for one, other in zip(first, everything(threads), strict=True):
            np.testing.assert_array_equal(one, other)


def runs_beside(call: Call) -> bool:
    """True when another Python thread gets to run between the start of a call and its end."""
    inside = threading.Event()
    ran: list[bool] = []

    def wait_and_run() -> None:
        inside.wait()
        ran.append(True)

    # With this interval no thread gives way because of the clock, only when it leaves the interpreter itself.
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1000.0)
    thread = threading.Thread(target=wait_and_run, daemon=True)
    try:
        thread.start()
        inside.set()
        before = bool(ran)
        call()
        after = bool(ran)
    finally:
        sys.setswitchinterval(interval)
        thread.join(60.0)
    return after and not before


def test_interpreter_is_free_while_the_core_computes() -> None:
    delay, amplitude = np.full((1, 20_000), 1e-8), np.ones((1, 20_000), complex)
    soup = np.random.default_rng(2).uniform(-1.0, 1.0, (60_000, 3))
    large = surface(soup, np.arange(60_000, dtype=np.uint32).reshape(-1, 3))
    chirps = 1e-4 * np.arange(16)
    calls: list[Call] = [
        lambda: beat(delay, amplitude, num_samples=64, chirp_times=chirps, threads=1),
        lambda: cast(rows=700, columns=700, threads=1),
        lambda: frame(rays=(500, 500, 0.5, 0.5), threads=1),
        lambda: large.deform(soup, threads=1),
    ]
    # Some ten milliseconds each; where the machine is so busy that the other thread sleeps through it: once more.
    for call in calls:
        assert any(runs_beside(call) for _ in range(100))
    # The measure itself: work that keeps the interpreter lets nobody in.
    assert not any(runs_beside(lambda: sum(range(1_000_000))) for _ in range(5))


def test_calls_from_several_threads_give_what_one_gives() -> None:
    expected_beat, expected_hits, expected_frame = beat(num_samples=200), HITS.distance(), frame().cube
    shared = simulator()
    failures: list[BaseException] = []

    def work(threads: int | None) -> None:
        try:
            for _ in range(20):
                np.testing.assert_array_equal(beat(num_samples=200, threads=threads), expected_beat)
                np.testing.assert_array_equal(cast(threads=threads).distance(), expected_hits)
                np.testing.assert_array_equal(shared.frame(placement()).cube, expected_frame)
        except BaseException as failure:  # a panic is a BaseException
            failures.append(failure)

    workers = [threading.Thread(target=work, args=(threads,)) for threads in (None, 1, 2, None)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert not failures
