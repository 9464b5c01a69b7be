"""Threads in the compiled core and beside it: equal bits, a free interpreter, calls at once."""

from __future__ import annotations

import sys
import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core_calls import (
    GLASS,
    MATERIAL,
    POSES,
    SENSOR,
    SURFACE,
    TRIANGLES,
    VERTICES,
    Call,
    beat,
    cast,
    frame,
    placement,
    scene,
    simulator,
    surface,
)
from radarcore import _core


def test_threads_do_not_change_a_bit() -> None:
    rng = np.random.default_rng(1)
    vertices = np.concatenate([VERTICES, rng.uniform(-0.6, 0.6, (24, 3))])
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
    world = scene([body, SURFACE], rcs=[1.0] * 7)
    materials, plane = [MATERIAL, GLASS], (67, 91, 0.3, 0.3)

    def everything(threads: int | None) -> list[NDArray[Any]]:
        sim = simulator(world, materials, threads=threads, rays=plane, image=plane, method="auto")
        hits, found = sim.image(at), sim.frame(places)
        adaptive = simulator(world, materials, threads=threads, sampling="adaptive", max_bounces=2)
        return [
            *hits,
            *sim.paths(places, at, rates),
            found.cube,
            found.truth,
            adaptive.frame(places).cube,
            _core.reflectance(
                materials, hits[2], hits[1], hits[4], hits[4], frequency=60e9, polarization=None, threads=threads
            ),
            *(beat(num_samples=130, threads=threads, method=method, tolerance=1e-5) for method in ("direct", "auto")),
        ]

    first = everything(1)
    assert (first[2] >= 0).sum() > 1000
    assert set(range(9)) == set(first[8].tolist())
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
        lambda: beat([delay], [amplitude], num_samples=64, chirp_times=chirps, threads=1),
        lambda: cast(rows=700, columns=700, threads=1),
        lambda: frame(rays=(500, 500, 0.5, 0.5), threads=1),
        lambda: large.deform(soup, threads=1),
    ]
    # Some ten milliseconds each; where the machine is so busy that the other thread sleeps through it: once more.
    for call in calls:
        assert any(runs_beside(call) for _ in range(100))
    # The measure itself: work that keeps the interpreter lets nobody in.
    assert not any(runs_beside(lambda: sum(range(1_000_000))) for _ in range(5))
