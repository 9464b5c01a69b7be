"""Visibility: half of a body that is half hidden, none of a hidden one, all of one alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.dataset import Labels, labels_of

RADAR = rc.bgt60tr13c(num_chirps=4)
ROUGH = rc.Material.lambertian(0.5)
SETTINGS = Labels(truth=False, visibility=True)


def wall(left: float, width: float = 1.0, distance: float = 1.0) -> rc.Body:
    """A wall that reaches from `left` to the right, seen from the radar."""
    pose = rc.Pose([distance, left - 0.5 * width, 0.0])
    return rc.Body(rc.shapes.plate(width, 2.0), motion=pose, name="wall")


def plate(material: rc.Material | None = None, y: float = 0.0) -> rc.Body:
    return rc.Body(rc.shapes.plate(0.4, 0.4), material=material, motion=rc.Pose([2.0, y, 0.0]), name="plate")


def visibility(*bodies: rc.Body | rc.PointTarget, name: str = "plate", **settings: float) -> float:
    simulator = rc.Simulator(rc.Scene(bodies), RADAR, **settings)
    names = list(dict.fromkeys(body.name.partition("/")[0] for body in bodies if body.name is not None))
    values = labels_of(simulator, simulator.frame(0.0), names, SETTINGS)["visibility"].values
    return float(values[names.index(name)])


SHAPES = {
    "plate": rc.shapes.plate(0.4, 0.4),
    "sphere": rc.shapes.sphere(0.2),
    "cylinder": rc.shapes.cylinder(0.1, 0.5),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("material", ["metal", "skin"])
def test_half_of_a_mirror_that_is_half_hidden(shape: str, material: str) -> None:
    """Its energy is a quarter, as amplitudes add; half of what it had comes from what is in view."""
    body = rc.Body(SHAPES[shape], material=rc.materials[material], motion=rc.Pose([2.0, 0.0, 0.0]), name="plate")
    assert visibility(body, wall(0.0), rcs_floor=1e-4) == pytest.approx(0.5, abs=0.03)


def test_nothing_of_a_mirror_whose_glint_is_hidden() -> None:
    """A quarter of the sphere is in view, but not where it reflects."""
    ball = rc.Body(SHAPES["sphere"], motion=rc.Pose([2.0, 0.0, 0.0]), name="plate")
    assert visibility(ball, wall(0.05)) == pytest.approx(0.0, abs=0.02)


def test_energies_of_a_mirror_and_a_rough_part_add() -> None:
    """Of two parts that face the radar, one hidden: shares follow the energies of each alone."""
    poses = [rc.Pose.look_at([2.0, y, 0.0], [4.0, 2.0 * y, 0.0]) for y in (0.2, -0.2)]
    made_of = [rc.Material(0.05), rc.Material.lambertian(0.9)]
    parts = [
        rc.Body(rc.shapes.plate(0.1, 0.1), material=material, motion=pose, name=f"plate/{number}")
        for number, (material, pose) in enumerate(zip(made_of, poses, strict=True))
    ]
    left, right = (visibility(*parts, wall(edge), rcs_floor=1e-5) for edge in (0.0, 1.0))
    assert 0.1 < left < 0.9
    assert left + right == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("hidden", [0.25, 0.75])
def test_share_of_a_rough_plate_is_that_of_its_area_in_view(hidden: float) -> None:
    edge = 0.5 * (-0.2 + 0.4 * hidden)  # half as far away as the plate
    assert visibility(plate(ROUGH), wall(edge)) == pytest.approx(1.0 - hidden, abs=0.04)


BAR = rc.Body(rc.shapes.plate(0.02, 1.6), motion=rc.Pose.from_rpy([1.0, 0.35, 0.0], [0.6, 0.0, 0.0]), name="bar")
BEHIND = rc.Body(rc.shapes.box(0.2), motion=rc.Pose([-2.0, 0.0, 0.0]), name="plate")


@pytest.mark.parametrize(
    ("bodies", "expected"),
    [
        ([plate(), wall(0.5)], 0.0),
        ([plate(ROUGH), wall(0.5)], 0.0),
        ([plate()], 1.0),
        ([plate(), wall(-0.3)], 1.0),
        ([plate(), wall(0.5, distance=3.0)], 1.0),
        ([plate(ROUGH), BAR], pytest.approx(1.0, abs=0.01)),
        ([BEHIND, wall(-0.3)], 0.0),
        ([rc.PointTarget([2.0, 0.0, 0.0], name="plate"), wall(0.5)], 1.0),
    ],
    ids=["hidden", "rough and hidden", "alone", "beside", "before", "only the box overlaps", "out of view", "point"],
)
def test_all_or_nothing_of_a_body(bodies: list[rc.Body | rc.PointTarget], expected: Any) -> None:
    """Points are seen through everything."""
    assert visibility(*bodies) == expected


def test_parts_of_a_body_do_not_hide_it() -> None:
    """A person alone has all of its energy, though its arms hide its trunk."""
    person = rc.models.Human(path=[[3.0, 0.0], [1.0, 0.0]]).bodies(name="eve", subdivisions=2)
    assert visibility(*person, name="eve") == 1.0


def test_rough_surfaces_have_half_at_every_seed() -> None:
    """Not the interference of their speckle, which differs from seed to seed."""
    found = [visibility(plate(ROUGH), wall(0.0), seed=seed) for seed in range(6)]
    assert np.abs(np.array(found) - 0.5).max() < 0.03


def test_reflections_do_not_make_more_than_all() -> None:
    floor = rc.Body(
        rc.shapes.plate(3.0, 3.0), motion=rc.Pose.from_rpy([2.0, 0.0, -0.3], [0.0, np.pi / 2, 0.0]), name="floor"
    )
    assert 0.5 < visibility(plate(), floor, max_bounces=2) <= 1.0


def test_visibility_is_that_of_the_middle_of_the_frame() -> None:
    """A wall that has passed half of the plate by then, and nothing of it when the frame starts."""
    radar = rc.bgt60tr13c(num_chirps=4, chirp_interval=20e-3, frame_interval=0.1)
    middle = 0.5 * radar.waveform.duration
    moving = rc.Linear(rc.Pose([1.0, -0.5 - 0.15, 0.0]), velocity=[0.0, 0.15 / middle, 0.0])
    bodies = [plate(ROUGH), rc.Body(rc.shapes.plate(1.0, 2.0), motion=moving, name="wall")]
    simulator = rc.Simulator(rc.Scene(bodies), radar)
    labels = labels_of(simulator, simulator.frame(0.0), ["plate", "wall"], SETTINGS)
    assert labels["visibility"].values[0] == pytest.approx(0.5, abs=0.03)
