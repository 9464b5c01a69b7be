"""Parts that the benches share: their meshes, the page that several of them write, and the results of criterion."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import radarcore as rc
from meshes import room, sphere
from page import section_of, table, tables_of, with_section
from pareto import Method
from proof.bounds import Bound, unheld_lines
from proof.convergence import Point, read_points, write_points
from proof.real_meshes import Way
from rays import ratio, times_in

PAGE = "# Speed\n\n<!-- benches/a.py -->\n\nold\n\n<!-- end of benches/a.py -->\n\nby hand\n"


@pytest.mark.parametrize("size", [100, 5000])
def test_room_and_sphere_have_the_triangles_of_the_rust_benches(size: int) -> None:
    m = {100: 1, 5000: 7}[size]
    assert len(room(size)[1]) == 12 * (2 * m) ** 2 + 4 * 12 * m**2
    n = {100: 3, 5000: 20}[size]
    assert len(sphere(1.0, size, (0.0, 0.0, 0.0))[1]) == 12 * n**2


def test_sphere_is_closed_and_faces_outwards() -> None:
    radius, n = 0.5, 20
    mesh = rc.Mesh(*sphere(radius, 12 * n**2, (2.0, -1.0, 0.5)))
    ball = 4.0 / 3.0 * np.pi * radius**3
    # Edges are up to sqrt(2) * 2 / n radii long, so facets lie up to half of (1 / n)^2 * 2 radii inside.
    assert ball * (1.0 - 3.0 / n**2) < mesh.volume < ball
    np.testing.assert_allclose(mesh.bounds, [[1.5, -1.5, 0.0], [2.5, -0.5, 1.0]], rtol=0, atol=1e-12)


def test_room_is_around_the_camera_and_its_spheres_are_in_front() -> None:
    mesh = rc.Mesh(*room(5000))
    bump = 3 * 0.02
    np.testing.assert_allclose(mesh.bounds, [[-0.5, -2.5, -1.0], [5.5, 2.5, 1.8]], rtol=0, atol=bump)
    distance = rc.Simulator(rc.Scene([rc.Body(mesh)]), rc.bgt60tr13c(), resolution=32).depth_image().distance
    assert 1.2 < distance.min() < 1.3  # the nearest sphere, sqrt(1.5^2 + 0.4^2) - 0.3 = 1.25 m
    assert 5.0 < distance.max() < np.inf


def test_section_is_replaced_and_the_rest_of_the_page_stays() -> None:
    assert with_section(PAGE, "a", "new") == PAGE.replace("old", "new")


def test_first_section_of_a_bench_comes_at_the_end() -> None:
    page = with_section(PAGE, "b", "## Of b\n")
    assert page == PAGE + "\n<!-- benches/b.py -->\n\n## Of b\n\n<!-- end of benches/b.py -->\n"
    assert with_section(page, "b", "## Of b\n") == page
    assert with_section(page, "a", "old") == page


def test_tables_are_read_as_they_were_written(tmp_path: Path) -> None:
    rows = [["a, 1 GHz", "1e-3"], ["b", "-"]]
    text = f"Above:\n\n{table(['case', 'error'], rows)}\n\nand\n\n{table(['ms'], [['2.5']])}\n"
    first, second = tables_of(text)
    assert [list(row.values()) for row in first] == rows
    assert second == [{"ms": "2.5"}]
    page = tmp_path / "page.md"
    page.write_text(with_section(PAGE, "b", text))
    assert (section_of(page, "a").strip(), section_of(page, "b").strip()) == ("old", text.strip())


def test_points_of_the_picture_of_accuracy_are_kept(tmp_path: Path) -> None:
    points = [Point("ball, 10 cm", Way("adaptive", "floor", 1e-7), 0.125, 143178.0, 2.5e-3)]
    write_points(tmp_path / "points.csv", points)
    assert read_points(tmp_path / "points.csv") == points


def test_section_without_an_end_is_refused() -> None:
    with pytest.raises(ValueError, match=r"expected '<!-- end of benches/a\.py -->' after '<!-- benches/a\.py -->'"):
        with_section(PAGE.replace("end of", ""), "a", "new")


def test_time_of_a_rust_bench_is_that_of_its_fastest_sample(tmp_path: Path) -> None:
    for when in ("base", "new"):
        directory = tmp_path / "trace" / "room_5k" / when
        directory.mkdir(parents=True)
        (directory / "benchmark.json").write_text(json.dumps({"full_id": "trace/room_5k"}))
    times = {"iters": [1.0, 2.0, 4.0], "times": [3e6, 5e6, 1.2e7]}  # [ns]
    (directory / "sample.json").write_text(json.dumps(times))
    assert times_in(tmp_path) == {"trace/room_5k": 2.5e-3}


def test_benches_are_compared_within_runs() -> None:
    runs = [{"slow": 2.0, "fast": 1.0}, {"slow": 30.0, "fast": 10.0}, {"slow": 9.0, "fast": 1.0}]
    assert ratio(runs, "slow", "fast") == "3"


def test_a_bound_that_is_not_held_says_what_to_set_and_the_default_has_none() -> None:
    def bound(what: str, measured: float) -> Bound:
        return Bound(what, "level [dB]", "closed form", 1.0, [0.1, measured])

    held, unheld = bound("adaptive, default, single bodies", 0.9), bound("footprint, 512 pixels, spheres", 1.1)
    (line,) = unheld_lines([held, unheld])
    assert line.startswith("- `footprint`: ")
    assert "use the default" in line
    with pytest.raises(ValueError, match="expected what to set in place of 'adaptive, default, single bodies'"):
        list(unheld_lines([bound("adaptive, default, single bodies", 1.1)]))


def test_speedup_is_the_median_of_the_ratios_of_rounds() -> None:
    base, own = (Method(name, None, lambda: np.zeros(1), times=times) for name, times in TIMES.items())
    # Ratios of 2, 10 and 1; of the medians 3.
    assert (own.speedup(base), base.seconds / own.seconds) == (2.0, 3.0)


TIMES = {"base": [2.0, 10.0, 3.0], "own": [1.0, 1.0, 3.0]}
