"""Names of the bodies of a scene: all different."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import radarcore as rc
from radarcore.models import Human
from scene_files import BALL, check_fault, write

PLATE = rc.Body(rc.shapes.plate(0.3, 0.3), motion=rc.Pose([2.0, 0.0, 0.0]), name="plate")


def people(name: str) -> list[rc.Body]:
    return Human(speed=0.0).bodies(name=name)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: [PLATE, rc.PointTarget([1.0, 0.0, 0.0]), PLATE], "'plate' at index 0 and 2"),
        (lambda: people("human") + people("human"), "'human/pelvis' at index 0 and 16"),
    ],
    ids=["bodies", "people"],
)
def test_bodies_of_one_name_are_refused(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(ValueError, match=f"bodies: expected names that differ, got {message}"):
        rc.Scene(make())


def test_bodies_of_different_names_or_none_are_a_scene() -> None:
    unnamed = [rc.Body(PLATE.mesh), rc.Body(PLATE.mesh)]
    assert rc.Scene([*unnamed, *people("ann"), *people("bob")]).names[:3] == ("body 0", "body 1", "ann/pelvis")


def test_default_names_leave_those_that_others_have_been_given() -> None:
    def point(name: str | None = None) -> rc.PointTarget:
        return rc.PointTarget([1.0, 0.0, 0.0], name=name)

    assert rc.Scene([point("point 1"), point(), point()]).names == ("point 1", "point 3", "point 2")
    names = rc.Scene([point(), point(), point("point 0"), point("point 1"), rc.Body(PLATE.mesh)]).names
    assert names[2:] == ("point 0", "point 1", "body 4")
    assert len(set(names)) == 5
    radar = rc.Interferer(rc.bgt60tr13c(), rc.Pose())
    scene = rc.Scene([point("interferer 0"), radar])
    assert scene.interferer_names != scene.names


def test_scene_files_refuse_names_that_two_bodies_have(tmp_path: Path) -> None:
    check_fault(write(tmp_path, BALL + BALL), "body[1] 'ball': name: expected a name of its own, got that of body[0]")
    (tmp_path / "part.obj").write_text("v 0 0 0\nv 0 1 0\nv 0 0 1\nusemtl steel\nf 1 2 3\n", encoding="utf-8")
    part = '[[body]]\nshape = { kind = "mesh", path = "part.obj" }\npose = { position = [2, 0, 0] }\nmaterials = {}\n'
    check_fault(write(tmp_path, part + part), "bodies: expected names that differ, got 'steel' at index 0 and 1;")
