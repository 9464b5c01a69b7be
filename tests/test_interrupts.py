"""Ctrl-C ends every long call of the core soon, and progress is reported; frames are in simulate/test_running.py."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from interrupts import time_of, time_to_hear
from path_scenes import sweep_waveform
from radarcore import _core, notice
from radarcore.simulate.beat import core_rows

pytestmark = pytest.mark.usefixtures("hears_interrupts")


def beat(
    method: str, num_paths: int, num_chirps: int, num_samples: int, tolerance: float, *, is_bending: bool = False
) -> object:
    """Sum over moving paths in random order."""
    waveform = sweep_waveform(num_chirps, num_samples, chirp_interval=3e-3)
    rng = np.random.default_rng(1)
    delay, rate = 1e-8 * rng.random((2, num_paths))
    amplitude = np.ones(num_paths, complex)
    return partial(
        _core.beat_signal,
        **core_rows(delay, amplitude, 1e-2 * rate, 1e-2 * rate if is_bending else None),
        waveform=waveform._core,
        tolerance=tolerance,
        method=method,
        threads=2,
    )


@pytest.mark.parametrize(
    ("method", "num_paths", "shape", "is_bending"),
    [
        # One chirp is the work of one thread.
        ("direct", 150_000, (1, 4096), False),
        ("direct", 150_000, (64, 64), False),
        ("grid", 1_000_000, (64, 64), True),
        ("grid", 6_000_000, (4, 64), False),
    ],
    ids=["direct-one-chirp", "direct", "chirp-wise", "range-Doppler"],
)
def test_interrupt_ends_a_long_sum_soon(method: str, num_paths: int, shape: tuple[int, int], is_bending: bool) -> None:
    tenth, whole = (beat(method, n, *shape, 1e-9, is_bending=is_bending) for n in (num_paths // 10, num_paths))
    assert time_to_hear(whole, after=0.1) < 3.0 * time_of(tenth)


def bumpy(num_squares: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Sheet with two triangles per square."""
    side = int(np.sqrt(num_squares))
    y, z = np.meshgrid(*[np.linspace(-1.0, 1.0, side + 1)] * 2, indexing="ij")
    vertices = np.stack([0.1 * np.sin(7.0 * y) * np.cos(5.0 * z), y, z], axis=-1).reshape(-1, 3)
    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    corners = [[0, side + 1, 1], [1, side + 1, side + 2]]
    return vertices, np.concatenate([first[:, None] + corner for corner in corners])


def test_interrupt_ends_a_build_soon() -> None:
    tenth, whole = bumpy(100_000), bumpy(1_000_000)
    # Arrays are checked in Python before.
    assert time_to_hear(lambda: rc.Mesh(*whole, progress=False), after=0.4) < 5.0 * time_of(lambda: rc.Mesh(*tenth))


def test_interrupt_ends_the_reading_of_a_mesh_soon(tmp_path: Path) -> None:
    head = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    for name, number in (("tenth.obj", 200_000), ("whole.obj", 2_000_000)):
        (tmp_path / name).write_text(head + "f 1 2 3\n" * number, encoding="utf-8")

    def tenth() -> float:
        return time_of(lambda: _core.load_obj(str(tmp_path / "tenth.obj")))

    # Other processes may slow down any of the three.
    before = tenth()
    heard = time_to_hear(lambda: rc.load_mesh(tmp_path / "whole.obj"), after=0.2)
    assert heard < 4.0 * max(before, tenth())


def test_interrupt_ends_an_image_soon() -> None:
    # Rays meet the boxes of most triangles.
    rng = np.random.default_rng(2)
    vertices = rng.normal(size=(30_000, 3)) * [1e-3, 1.0, 1.0] + [2.0, 0.0, 0.0]
    scene = rc.Scene([rc.Body(rc.Mesh(vertices, np.arange(30_000).reshape(-1, 3), shading="flat"))])
    waveform = rc.Waveform(start_frequency=60e9, slope=1e13, sample_rate=2e6, num_samples=16)

    def image(side: int) -> Callable[[], object]:
        sim = rc.Simulator(scene, rc.Radar(waveform), resolution=side, field_of_view_deg=(40.0, 40.0), threads=2)
        return sim.depth_image

    assert time_to_hear(image(1200), after=0.2) < 3.0 * time_of(image(200))


def test_interrupt_ends_an_adaptive_cast_soon() -> None:
    ball = rc.Body(rc.shapes.sphere(0.3, subdivisions=6), motion=rc.Pose([1.0, 0.0, 0.0]))
    waveform = rc.Waveform(start_frequency=60e9, slope=1e13, sample_rate=2e6, num_samples=16)

    def frame(rcs_floor: float) -> Callable[[], object]:
        options = {"rcs_floor": rcs_floor, "ray_budget": np.inf, "threads": 2}
        return rc.Simulator(rc.Scene([ball]), rc.Radar(waveform), **options).frame

    # More than ten times the rays.
    assert time_to_hear(frame(3e-10), after=0.1) < 3.0 * time_of(frame(3e-8))


def test_interrupt_ends_cross_sections_soon() -> None:
    corner, azimuth_deg = rc.shapes.trihedral(1.0), np.linspace(150.0, 210.0, 4000)
    a_few = time_of(lambda: rc.rcs(corner, 77e9, azimuth_deg=azimuth_deg[::2000], max_bounces=3))
    all_of_them = partial(rc.rcs, corner, 77e9, azimuth_deg=azimuth_deg, max_bounces=3)
    assert time_to_hear(all_of_them, after=0.3) < 10.0 * a_few


def told(work: Callable[[Callable[[int], object]], object]) -> list[int]:
    """Numbers that a long call has reported."""
    numbers: list[int] = []
    work(numbers.append)
    return numbers


def test_direct_sums_and_builds_tell_how_far_they_are() -> None:
    direct: Callable[..., object] = beat("direct", 120_000, 64, 64, 1e-9)
    vertices, triangles = bumpy(500_000)
    rows = triangles.astype(np.uint32)
    for numbers, total in (
        (told(lambda report: direct(report=report)), 64),
        (told(lambda report: _core.Surface(vertices, rows, crease_angle=0.7, report=report)), 1000),
    ):
        assert numbers == sorted(numbers)
        assert 0 <= numbers[0] <= numbers[-1] <= total
        assert len(set(numbers)) >= 3


def test_a_report_that_fails_ends_the_call() -> None:
    direct: Callable[..., object] = beat("direct", 100_000, 64, 64, 1e-9)

    def fails(num_done: int) -> None:
        raise RuntimeError(f"after {num_done} chirps")

    with pytest.raises(RuntimeError, match=r"after \d+ chirps"):
        direct(report=fails)


def test_a_bar_appears_after_a_second_alone_and_ends_full(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[list[int]] = []

    class Bar:
        def __init__(self) -> None:
            self.n = 0
            shown.append([])

        def update(self, more: int) -> None:
            self.n += more
            shown[-1].append(self.n)

        def close(self) -> None:
            shown[-1].append(-1)

    now = [0.0]
    monkeypatch.setattr(notice, "progress", lambda *steps, **options: Bar())
    monkeypatch.setattr(notice, "monotonic", lambda: now[0])
    with notice.progress_if_long("sum", "chirp", 10) as report:
        report(3)
    assert shown == []
    with notice.progress_if_long("sum", "chirp", 10) as report:
        now[0] = 1.1
        report(3)
        report(7)
    assert shown == [[3, 7, 10, -1]]
