"""Refusals of the compiled core: the error that is documented, in words that name the argument."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from core_calls import (
    AMPLITUDE,
    DELAY,
    EMPTY,
    HUGE,
    INF,
    NAN,
    POSES,
    SHAPE,
    SURFACE,
    TRIANGLES,
    VERTICES,
    Call,
    antennas,
    beat,
    cast,
    deform,
    deformed,
    deforming_scene,
    depth_scene,
    frame,
    occluded,
    paths,
    placement,
    reflectance,
    refuses,
    scene,
    simulator,
    surface,
    surfels,
    table,
    waveform,
)
from radarcore import _core


@pytest.mark.parametrize(
    ("call", "message"),
    [
        # Shapes with the right number of elements in another order.
        (lambda: beat(amplitude=[np.ones((3, 2), complex)]), r"amplitude: expected shape \(2, 3\), got \(3, 2\)"),
        (lambda: beat([DELAY, DELAY[:1]]), r"delay: expected shape \(2, 3\), got \(1, 3\)"),
        (lambda: beat([DELAY, DELAY.T.copy()]), r"delay: expected shape \(2, 3\), got \(3, 2\)"),
        (lambda: beat([DELAY] * 4), "delay: expected 1 to 3 terms, got 4"),
        (lambda: beat(amplitude=[AMPLITUDE] * 2), "amplitude: expected one amplitude per path, got 2"),
        (lambda: beat([], is_nodal=True), "delay: expected 1 to 4096 nodes, got 0"),
        (lambda: beat(amplitude=[], is_nodal=True), "amplitude: expected 1 to 4096 nodes, got 0"),
        (lambda: beat([], []), "delay: expected 1 to 3 terms, got 0"),
        (lambda: beat(method="recurrence"), "method: expected 'auto', 'direct' or 'grid'"),
        (lambda: beat(level="avx9"), "level: expected one of"),
        (lambda: surface(VERTICES.reshape(3, 6)), r"vertices: expected shape \(n, 3\), got \(3, 6\)"),
        (lambda: surface(triangles=TRIANGLES.reshape(3, 4)), r"triangles: expected shape \(n, 3\), got \(3, 4\)"),
        (lambda: simulator(materials=[]), "materials: expected 1, one per body, got 0"),
        (lambda: reflectance([]), "body: expected numbers below 0, got 0"),
        (
            lambda: _core.Material.dielectric((2.0, 0.0), roughness=1e-4, scattering=0.1),
            "scattering: expected none with roughness, got both",
        ),
        # Places: of an odd number of times, and of what the scene has.
        (lambda: placement(sensor=np.zeros((0, 3, 4))), "sensor: expected an odd number of times, got 0"),
        (lambda: placement(sensor=np.zeros((1, 4, 3))), r"sensor: expected shape \(n, 3, 4\), got \(1, 4, 3\)"),
        (lambda: placement(poses=np.zeros((1, 1, 4, 3))), r"poses: expected shape \(1, n, 3, 4\), got \(1, 1, 4, 3\)"),
        (lambda: placement(points=np.zeros((3, 1, 3))), r"points: expected shape \(1, n, 3\), got \(3, 1, 3\)"),
        (lambda: placement(vertices=[np.zeros((1, 3, 6))]), r"vertices: expected shape \(n, n, 3\), got \(1, 3, 6\)"),
        *(
            (lambda call=call, bad=bad: call(bad), f"{message} as the scene has, got")
            for call in (frame, cast, paths, lambda bad: paths(rates=bad), lambda bad: frame(rates=bad))
            for bad, message in (
                (placement(poses=np.zeros((1, 2, 3, 4))), "poses: expected 1 of them"),
                (placement(points=np.zeros((1, 2, 3))), "points: expected 1 of them"),
                (placement(vertices=[VERTICES[None]]), "vertices: expected 0 of them"),
            )
        ),
        (lambda: cast(source=EMPTY, materials=[]), "poses: expected 0 of them as the scene has, got 1"),
        (lambda: surfels(num_bodies=2), "poses: expected 2 of them as the scene has, got 1"),
        (lambda: deformed(VERTICES[None, :5]), "vertices: expected 6 as the mesh has, got 5"),
        (lambda: frame(source=deforming_scene()), "vertices: expected 1 of them as the scene has, got 0"),
        (lambda: occluded(np.zeros((1, 4))), r"points: expected shape \(n, 3\), got \(1, 4\)"),
        # Scenes and settings.
        (lambda: simulator(sampling="fine"), "sampling: expected 'adaptive', 'footprint' or 'point', got \"fine\""),
        (lambda: frame(rays=(0, 1, 0.5, 0.5)), "resolution: expected at least one row and one column, got 0 x 1"),
        (lambda: frame(rays=(HUGE, HUGE, 0.5, 0.5)), "resolution: expected at most 268435456 rays"),
        (lambda: antennas(tx=np.zeros((3, 1))), r"tx: expected shape \(n, 3\), got \(3, 1\)"),
        (lambda: antennas(tx=np.zeros((2, 3))), "tx_patterns: expected 2, one per antenna, got 1"),
        (lambda: antennas(frequency=-60e9), "frequency: expected a positive frequency in Hz, got -60000000000"),
        (
            lambda: antennas(responses=np.ones((2, 3), complex), longest_path=1.0),
            "responses: expected none, or 1, one per transmit antenna, got 2",
        ),
        (lambda: table(gain_db=np.zeros((2, 3))), r"gain_db: expected shape \(2, 2\), got \(2, 3\)"),
        (lambda: table().gain(np.zeros(2), np.zeros(3)), r"elevation: expected shape \(2,\), got \(3,\)"),
        (lambda: deform(VERTICES[:5]), "vertices: expected 6 as the mesh has, got 5"),
        (lambda: deform(VERTICES.reshape(9, 2)), r"vertices: expected shape \(n, 3\), got \(9, 2\)"),
        (lambda: deform(VERTICES * NAN), "vertices: expected finite coordinates.*at row 0"),
        (lambda: depth_scene(normals=np.zeros((4, 3, 5))), r"normals: expected shape \(4, 5, 3\), got \(4, 3, 5\)"),
        (lambda: surfels(albedo=np.zeros((5, 4))), r"albedo: expected shape \(4, 5\), got \(5, 4\)"),
        # Values that no result can be formed for.
        (lambda: surfels(body=np.full(SHAPE, 1, np.int32)), "body: expected numbers below 1, got 1"),
        (lambda: surfels(plane=(*SHAPE, INF, 1.0, 2.5, 2.0)), "field_of_view: expected angles"),
        (lambda: surfels(plane=(*SHAPE, 0.02, 0.02, INF, 2.0)), "principal_point: expected finite numbers"),
        (lambda: table(np.array([1.0, 0.0])), "azimuth: expected increasing angles .*, got 1 and then 0"),
        (lambda: beat([np.full((2, 3), NAN)]), "delay: expected finite numbers, got NaN at flat index 0"),
        (lambda: beat(amplitude=[np.full((2, 3), INF + 0j)]), "amplitude: expected finite numbers, got inf"),
        (lambda: beat(start_frequency=NAN), "waveform: expected finite numbers"),
        (lambda: beat(sample_rate=0.0), "waveform: expected samples, chirps and a positive sample rate"),
        (lambda: surface(VERTICES * NAN), "vertices: expected finite coordinates.*at row 0"),
        (lambda: cast(rows=2**24), "resolution: expected at most 268435456 rays, got 16777216 x 30"),
        (lambda: cast(half_width=0.0), "field_of_view: expected angles between 0 and 180 degrees"),
    ],
)
def test_what_does_not_fit_together_is_a_value_error(call: Call, message: str) -> None:
    refuses(call, ValueError, message)


@pytest.mark.parametrize("threads", [0, 1025, 2**32, HUGE])
@pytest.mark.parametrize("call", [beat, cast, deform, frame, surfels, paths, reflectance])
def test_pool_has_one_to_1024_threads(call: Any, threads: int) -> None:
    refuses(lambda: call(threads=threads), ValueError, f"threads: expected 1 to 1024, got {threads}")


@pytest.mark.parametrize(
    "call",
    [
        lambda: beat(num_samples=2**40),
        lambda: beat(num_samples=HUGE),
        lambda: beat([np.zeros((2**40, 0))], [np.zeros((2**40, 0), complex)]),
        lambda: beat([np.zeros((2**40, 0))], [np.zeros((2**40, 0), complex)], method="auto"),
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
        (lambda: beat(threads=1.0), TypeError),
        (lambda: cast(half_width=None), TypeError),
        (lambda: simulator(rotations=[]), ValueError),
        (lambda: simulator(debug={"skip_empty": 1, "reuse_tiles": True, "level": None}), TypeError),
        (lambda: simulator(antennas=None), TypeError),
        (lambda: simulator(SURFACE), TypeError),
        (lambda: simulator().frame(placement(), POSES), TypeError),
        (lambda: placement(vertices=VERTICES), TypeError),
        (lambda: scene(deforms=0.0), TypeError),
        (lambda: scene(["surface"]), TypeError),
        (lambda: scene(rcs=["1.0"]), TypeError),
        (lambda: simulator(materials=[None]), TypeError),
        (lambda: _core.Material.constant(-1.0 + 0.0j, 0.0), TypeError),
        (lambda: _core.IdealFrame(), TypeError),
        (lambda: simulator(settings={}), KeyError),
        (lambda: _core.load_obj(7), TypeError),
        (lambda: _core.load_obj("no such\n file.obj"), FileNotFoundError),
        (lambda: _core.load_obj("/"), IsADirectoryError),
        (lambda: _core.load_obj("nul\0.obj"), (OSError, ValueError)),
    ],
)
def test_numbers_and_things_of_the_wrong_kind_are_refused(call: Call, error: Any) -> None:
    refuses(call, error)
