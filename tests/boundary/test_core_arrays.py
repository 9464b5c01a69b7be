"""Arrays into and out of the compiled core: exact dtypes, layouts and shapes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from core_calls import (
    AMPLITUDE,
    ARRAY,
    COSINES,
    DELAY,
    GLASS,
    HITS,
    NAN,
    NUM_PATHS,
    POINTS,
    POSES,
    SENSOR,
    SURFACE,
    SURFELS,
    TRIANGLES,
    VERTICES,
    WAVEFORM,
    antennas,
    beat,
    deform,
    deformed,
    depth_scene,
    frame,
    occluded,
    paths,
    placement,
    reflectance,
    refuses,
    response,
    surface,
    surfels,
    table,
)


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
        (HITS[0], "float64", (20, 30)),
        (HITS[1], "float64", (20, 30)),
        (reflectance(), "float64", (20, 30)),
        (reflectance([GLASS], polarization=(0.0, 0.0, 1.0)), "float64", (20, 30)),
        (table().gain(np.zeros(3), np.ones(3)), "float64", (3,)),
        (response()[0], "complex128", (3,)),
        (response()[1], "float64", (3,)),
        (HITS[2], "int32", (20, 30)),
        (HITS[3], "float64", (20, 30)),
        (HITS[4], "float64", (20, 30, 3)),
        (frame().cube, "complex64", (2, 2, 8)),
        (frame(tolerance=1e-7).cube, "complex128", (2, 2, 8)),
        (frame().truth, "float64", (4, 2)),
        (deformed().cube, "complex64", (2, 2, 8)),
        (surfels().cube, "complex64", (2, 2, 8)),
        (delay, "float64", (2, NUM_PATHS)),
        (delay_rate, "float64", (2, NUM_PATHS)),
        (amplitude, "complex128", (2, NUM_PATHS)),
        (body, "uint32", (NUM_PATHS,)),
        (order, "uint8", (NUM_PATHS,)),
        (occluded(), "bool", (1,)),
    ]:
        assert (array.dtype, array.shape) == (dtype, shape)
        assert array.flags.c_contiguous
        assert array.flags.writeable
    assert NUM_PATHS > 100  # the plate is in sight
    assert surfels().truth is None


# Every array argument of the core: how to call it with another one, and one that it takes.
ARGUMENTS: dict[str, tuple[Callable[[Any], Any], NDArray[Any]]] = {
    "beat delay": (lambda a: beat(delay=[a]), DELAY),
    "beat amplitude": (lambda a: beat(amplitude=[a]), AMPLITUDE),
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
    refuses(lambda: call(good[None]), TypeError)
    refuses(lambda: call(good[0]), TypeError)
    refuses(lambda: call(good.reshape(-1)[:1].reshape(())), TypeError)
