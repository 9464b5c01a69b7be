"""Scene files with USD stages: bodies, materials, carriers, mistakes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import radarcore as rc
from usd_stages import Usd, UsdGeom, add_box, bind

HEAD = """
[radar]
preset = "bgt60tr13c"
num_chirps = 4

[sensor]
attached_to = "cell/World/rig/eye"

[[body]]
name = "cell"
pose = { position = [0.0, 0.0, 1.0] }
material = "wood"
"""
SHAPE = 'shape = { kind = "usd", path = "cell.usda" }\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    stage = Usd.Stage.CreateNew(str(tmp_path / "cell.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.SetStageUpAxis(stage, "Z")
    drive = UsdGeom.Xform.Define(stage, "/World/rig").AddTranslateOp()
    drive.Set((0.0, 0.0, 0.0), 0.0)
    drive.Set((100.0, 0.0, 0.0), 24.0)
    UsdGeom.Camera.Define(stage, "/World/rig/eye").AddRotateXYZOp().Set((90.0, 0.0, -90.0))  # looks along x
    for k, name in enumerate(("near", "far")):
        add_box(stage, f"/World/{name}", (-10.0,) * 3, (10.0,) * 3).AddTranslateOp().Set((300.0 + 100.0 * k, 0.0, 0.0))
    bind(stage, stage.GetPrimAtPath("/World/far"), "Glass")
    stage.Save()
    return tmp_path


def test_a_stage_is_placed_and_carries_the_radar(folder: Path) -> None:
    (folder / "scene.toml").write_text(HEAD + SHAPE + 'materials = { "/World/near" = "metal" }\n')
    loaded = rc.load_scene(folder / "scene.toml")
    assert loaded.scene.names == ("cell/World/near", "cell/World/far")
    assert [body.material for body in loaded.scene.bodies] == [rc.materials["metal"], rc.materials["glass"]]
    np.testing.assert_allclose(loaded.radar_motion.at(0.5).position, [0.5, 0.0, 1.0], atol=1e-12)
    truth = loaded.simulator().frame(0.5).truth
    assert truth.range[0] == pytest.approx(2.4 - 2.5e-3, abs=4e-3)  # the antennas are millimetres from the origin
    assert truth.velocity[0] == pytest.approx(-1.0, abs=2e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            SHAPE.replace("cell.", "gone."),
            r"body\[0\] 'cell': shape\.stage: expected a USD file, got none at .*gone\.usda",
        ),
        (
            SHAPE + 'materials = { "/World/neat" = "metal" }\n',
            r"nothing is called '/World/neat'; did you mean '/World/near'",
        ),
        (SHAPE.replace("path", "file"), r"unknown key 'file'"),
    ],
)
def test_mistakes_are_one_line(folder: Path, text: str, message: str) -> None:
    (folder / "scene.toml").write_text(HEAD + text)
    with pytest.raises((ValueError, FileNotFoundError), match=message) as error:
        rc.load_scene(folder / "scene.toml")
    assert "\n" not in str(error.value)


def test_a_carrier_that_is_no_prim_is_refused_with_near_ones(folder: Path) -> None:
    (folder / "scene.toml").write_text(HEAD.replace("/eye", "/ear") + SHAPE)
    with pytest.raises(
        ValueError, match=r"attached_to: unknown 'cell/World/rig/ear'; did you mean 'cell/World/rig/eye'"
    ):
        rc.load_scene(folder / "scene.toml")
