"""The compiled core given nothing at all, and wild numbers: an answer or an error, no panic."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
import pytest

from core_calls import (
    EMPTY,
    EMPTY_HITS,
    GLASS,
    HUGE,
    INF,
    MATERIAL,
    NAN,
    NOWHERE,
    NUM_PATHS,
    POINTS,
    POSES,
    SENSOR,
    SHAPE,
    SURFELS,
    VERTICES,
    Call,
    beat,
    cast,
    deformed,
    deformed_paths,
    depth_scene,
    frame,
    occluded,
    paths,
    placement,
    reflectance,
    scene,
    simulator,
    surface,
    surfels,
    table,
)
from radarcore import _core

MIRROR = _core.Material.constant((-0.5, 0.0), 0.0)


def poses_of_nothing() -> Any:
    return placement(poses=np.zeros((1, 0, 3, 4)))


@pytest.mark.parametrize(
    ("call", "shape"),
    [
        (lambda: beat([np.zeros((0, 3))], [np.zeros((0, 3), complex)]), (0, 2, 8)),
        (lambda: beat([np.zeros((2, 0))] * 2, [np.zeros((2, 0), complex)]), (2, 2, 8)),
        (lambda: beat([np.zeros((2, 0))], [np.zeros((2, 0), complex)], method="auto"), (2, 2, 8)),
        (lambda: beat([np.zeros((2, 0))] * 4, [np.zeros((2, 0), complex)] * 4, is_nodal=True), (2, 2, 8)),
        (
            lambda: beat([np.zeros((0, 3))] * 4, [np.zeros((0, 3), complex)] * 4, is_nodal=True, method="auto"),
            (0, 2, 8),
        ),
        (lambda: beat(num_samples=1, chirp_times=np.zeros(1)), (2, 1, 1)),
        (lambda: surface(triangles=np.zeros((2, 3), np.uint32)).kept(), (0,)),  # degenerate: dropped
        (lambda: EMPTY_HITS[0], (20, 30)),
        (lambda: frame(NOWHERE, EMPTY, []).cube, (2, 2, 8)),
        (lambda: frame(NOWHERE, EMPTY, []).truth, (4, 0)),
        (lambda: frame(NOWHERE, EMPTY, [], sampling="adaptive").cube, (2, 2, 8)),
        (lambda: cast(rows=1, columns=1)[0], (1, 1)),
        (lambda: cast(rows=1, columns=1000)[4], (1, 1000, 3)),
        (lambda: frame(tx=np.zeros((0, 3)), tx_patterns=[]).cube, (0, 2, 8)),
        (lambda: paths(tx=np.zeros((0, 3)), tx_patterns=[])[0], None),
        (lambda: paths(seed=HUGE)[0], (2, NUM_PATHS)),
        (lambda: occluded(np.zeros((0, 3))), (0,)),
        (lambda: frame(poses_of_nothing(), scene([]), []).cube, (2, 2, 8)),
        (lambda: frame(poses_of_nothing(), scene([]), []).truth, (4, 1)),
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
        lambda: cast(wild_places)[2],
        lambda: cast(turned)[2],
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
        # Of a matt body adaptive sampling makes thousands of points: for what they depend on.
        smooth = options | {"materials": [MIRROR if sampling == "adaptive" else MATERIAL]}
        calls += [
            lambda options=options: frame(wild_places, **options),
            lambda smooth=smooth: frame(turned, **smooth),
            lambda smooth=smooth: frame(jumping, **smooth),
            lambda smooth=smooth: frame(rates=wild_places, **smooth),
            lambda options=options: frame(source=scene(rcs=[value]), **options),
            lambda options=options: frame(materials=[GLASS], polarization=(value,) * 3, **options),
            lambda options=options: frame(frequency=value, power=value, **options),
            lambda smooth=smooth: frame(center=(value,) * 3, **smooth),
            lambda smooth=smooth: frame(**wild_antennas, **smooth),
            lambda options=options: frame(tx_patterns=wild_beam, gain_floor=value, **options),
            lambda smooth=smooth: frame(gain_floor=value, bounce_floor=value, max_bounces=3, **smooth),
            lambda options=options: frame(rcs_floor=value, retrace=value, **options),
            lambda smooth=smooth: frame(tolerance=value, **smooth),
            *(
                lambda options=options, material=material: frame(materials=[material], **options)
                for material in wild_materials
            ),
        ]
    for call in calls:
        # Non-finite values may raise an error that names them; a panic is a BaseException and no answer.
        with contextlib.suppress(ValueError, MemoryError):
            call()
    table().gain(np.full(2, value), np.full(2, -value))
    for material in wild_materials:
        reflectance([material], polarization=(value,) * 3)
        material.response(np.array([0.0, 1.0, value]), wavelength=value, seen=(value, value))
    if np.isfinite(value):
        wild = np.full((2, 3), value)
        for method in ("direct", "auto", "grid"):
            try:
                samples = beat([wild] * 3, [wild + 0j], slope=value, start_frequency=value, method=method)
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
                assert np.isin(cast(source=scene([body]))[2], (-1, 0)).all()
                with contextlib.suppress(ValueError):  # of delays that no sum can take
                    frame(source=scene([body]))
                body.topology()
