"""Scene files: what they describe is what Python would have built; what is wrong is named in one line."""

import importlib.util
import json
import runpy
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args, get_origin

import numpy as np
import pytest

import radarcore as rc
from radarcore.models import robots
from radarcore.scenefile import schema, tables
from radarcore.scenefile.read import kind_of, tables_in
from radarcore.simulate.settings import Settings

EXAMPLES = sorted((Path(__file__).resolve().parents[2] / "examples").glob("*.toml"))

RADAR = """
[radar]
start_frequency = 60e9
stop_frequency = 61e9
sample_rate = 2e6
num_samples = 64
"""

BALL = '[[body]]\nname = "ball"\nshape = { kind = "sphere", radius = 0.1 }\npose = { position = [2.0, 0.0, 0.0] }\n'


def write(directory: Path, text: str, radar: str = RADAR) -> Path:
    path = directory / "scene.toml"
    path.write_text(radar + text, encoding="utf-8")
    return path


def load(directory: Path, text: str, radar: str = RADAR) -> rc.Simulation:
    return rc.load_scene(write(directory, text, radar))


def pose_of(simulation: rc.Simulation, name: str, time: float = 0.0) -> rc.Pose:
    body = simulation.scene.bodies[simulation.scene.names.index(name)]
    assert isinstance(body, rc.Body)
    return body.motion.at(time)


# --- Equal to Python


def test_every_setting_is_a_key_of_the_run_table_with_the_same_default() -> None:
    defaults = {field.name: field.default for field in fields(Settings)}
    keys = {name: field.default for name, field in tables.RunTable.model_fields.items()}
    assert {name: keys.get(name, "no key") for name in defaults} == defaults | {"method": "no key", "threads": "no key"}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_gives_the_same_samples_from_its_scene_file_and_from_python(path: Path) -> None:
    from_file, from_python = rc.load_scene(path), runpy.run_path(str(path.with_suffix(".py")))["simulator"]
    for time in (0.0, 0.3):
        expected = from_python.frame(time)
        frame = from_file.simulator().frame(time)
        assert np.abs(expected.cube).max() > 0.0
        assert np.array_equal(frame.cube, expected.cube)
        assert frame.truth is not None
        assert frame.truth.names == expected.truth.names
        assert frame.radar == expected.radar


def test_there_is_an_example_for_everything_that_a_scene_holds() -> None:
    text = "".join(path.read_text() for path in EXAMPLES)
    for table in ("[[body]]", "[[point]]", "[[human]]", "[[arm]]", "[run]", "attached_to", "along_z", "preset"):
        assert table in text
    assert len(EXAMPLES) >= 5


def test_example_runs_as_a_script(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(EXAMPLES[0].with_suffix(".py")), run_name="__main__")
    assert "truth" in capsys.readouterr().out


def test_record_simulates_the_run(tmp_path: Path) -> None:
    simulation = load(tmp_path, BALL + "[run]\nstart = 0.1\nstop = 0.3\nrate = 10.0\nresolution = 32\n")
    recording = simulation.record(tmp_path / "recording", progress=False, threads=1)
    assert recording.time.tolist() == [0.1, 0.2]
    assert np.array_equal(recording.cube, simulation.record(progress=False).cube)


# --- Every key arrives


@pytest.mark.parametrize(
    ("shape", "mesh"),
    [
        ('{ kind = "plate", width = 0.2, height = 0.3 }', rc.shapes.plate(0.2, 0.3)),
        ('{ kind = "disc", radius = 0.2 }', rc.shapes.disc(0.2)),
        ('{ kind = "box", size = [0.1, 0.2, 0.3] }', rc.shapes.box([0.1, 0.2, 0.3])),
        ('{ kind = "sphere", radius = 0.2 }', rc.shapes.sphere(0.2)),
        ('{ kind = "cylinder", radius = 0.2, length = 0.5 }', rc.shapes.cylinder(0.2, 0.5)),
        ('{ kind = "cylinder", radius = 0.2, length = 0.5, caps = false }', rc.shapes.cylinder(0.2, 0.5, caps=False)),
        ('{ kind = "capsule", radius = 0.1, length = 0.5 }', rc.shapes.capsule(0.1, 0.5)),
        ('{ kind = "dihedral", width = 0.2 }', rc.shapes.dihedral(0.2)),
        ('{ kind = "dihedral", width = 0.2, height = 0.1 }', rc.shapes.dihedral(0.2, 0.1)),
        ('{ kind = "trihedral", leg = 0.2 }', rc.shapes.trihedral(0.2)),
        ('{ kind = "trihedral", leg = 0.2, shape = "square" }', rc.shapes.trihedral(0.2, shape="square")),
    ],
)
def test_shapes_are_those_of_python(tmp_path: Path, shape: str, mesh: rc.Mesh) -> None:
    body = load(tmp_path, f"[[body]]\nshape = {shape}\npose = {{ position = [2, 0, 0] }}\n").scene.bodies[0]
    assert isinstance(body, rc.Body)
    assert np.array_equal(body.mesh.vertices, mesh.vertices)
    assert np.array_equal(body.mesh.triangles, mesh.triangles)


def test_there_is_a_table_for_every_shape() -> None:
    kinds = {kind_of(table) for table in tables_in(tables.ShapeTable)} - {"mesh"}
    assert all(callable(getattr(rc.shapes, kind)) for kind in kinds)
    assert kinds == {"plate", "disc", "box", "sphere", "cylinder", "capsule", "dihedral", "trihedral"}


def test_mesh_file_is_relative_to_the_scene_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "part.obj").write_text("v 0 0 0\nv 0 100 0\nv 0 0 100\nf 1 2 3\n")
    monkeypatch.chdir("/")
    shape = '{ kind = "mesh", path = "part.obj", scale = 1e-3, crease_angle_deg = 20, shading = "flat" }'
    body = load(tmp_path, f"[[body]]\nshape = {shape}\npose = {{ position = [2, 0, 0] }}\n").scene.bodies[0]
    assert isinstance(body, rc.Body)
    assert body.mesh.vertices.max() == pytest.approx(0.1)
    assert (body.mesh.crease_angle_deg, body.mesh.shading) == (20.0, "flat")


@pytest.mark.parametrize(
    ("text", "material"),
    [
        ('"wood"', rc.materials["wood"]),
        ("{ reflection = -0.5, albedo = 0.1 }", rc.Material(-0.5, 0.1)),
        ("{ albedo = 0.3 }", rc.Material.lambertian(0.3)),
        ("{ permittivity = [5.0, 0.2] }", rc.Material.dielectric(5.0 - 0.2j)),
        ("{ permittivity = [5.0, 0.2], roughness = 3e-4 }", rc.Material.dielectric(5.0 - 0.2j, roughness=3e-4)),
        (
            "{ permittivity = [2.5, 0], scattering = 0.4, thickness = 4e-3 }",
            rc.Material.dielectric(2.5, scattering=0.4, thickness=4e-3),
        ),
        (
            '{ permittivity = "concrete", roughness = 3e-4 }',
            rc.Material.dielectric(rc.materials["concrete"].permittivity, roughness=3e-4),
        ),
    ],
)
def test_materials(tmp_path: Path, text: str, material: rc.Material) -> None:
    body = load(tmp_path, BALL + f"material = {text}\n").scene.bodies[0]
    assert isinstance(body, rc.Body)
    assert body.material == material


def test_materials_of_the_file_are_referred_to_by_name(tmp_path: Path) -> None:
    text = (
        '[[material]]\nname = "felt"\npermittivity = [1.6, 0.06]\nthickness = 2e-3\n'
        '[[material]]\nname = "rough concrete"\npermittivity = "concrete"\nroughness = 5e-4\n'
        '[[material]]\nname = "paint"\nreflection = -0.2\nalbedo = 0.5\n'
    )
    made = []
    for name in ("felt", "rough concrete", "paint", "wood"):
        body = load(tmp_path, f'{BALL}material = "{name}"\n{text}').scene.bodies[0]
        assert isinstance(body, rc.Body)
        made.append(body.material)
    concrete = rc.materials["concrete"]
    assert made == [
        rc.Material.dielectric(1.6 - 0.06j, thickness=2e-3),
        concrete.with_surface(roughness=5e-4),
        rc.Material(-0.2, 0.5),
        rc.materials["wood"],
    ]
    assert (made[1].source, made[1].valid_frequency) == (concrete.source, concrete.valid_frequency)


PARTS = "v 0 0 0\nv 0 1 0\nv 0 0 1\nv 0 1 1\nf 1 2 3\nusemtl steel\nf 2 4 3\nusemtl glass\nf 1 3 2\nf 2 3 4\n"


def test_materials_of_an_obj_file_are_given_by_its_names(tmp_path: Path) -> None:
    (tmp_path / "part.obj").write_text(PARTS, encoding="utf-8")
    text = (
        '[[body]]\nname = "door"\nmaterial = "wood"\npose = { position = [2, 0, 0] }\n'
        'shape = { kind = "mesh", path = "part.obj", scale = 0.5 }\n'
        'materials = { glass = "pane", steel = { reflection = -0.9 } }\n'
        '[[material]]\nname = "pane"\npermittivity = "glass"\nthickness = 4e-3\n'
        '[[body]]\nname = "handle"\nattached_to = "door"\nshape = { kind = "sphere", radius = 0.05 }\n'
    )
    simulation = load(tmp_path, text)
    assert simulation.scene.names == ("door/rest", "door/steel", "door/glass", "handle")
    rest, steel, glass, handle = simulation.scene.bodies
    assert isinstance(rest, rc.Body)
    assert isinstance(steel, rc.Body)
    assert isinstance(glass, rc.Body)
    assert isinstance(handle, rc.Body)
    assert [len(body.mesh.triangles) for body in (rest, steel, glass)] == [1, 1, 2]
    assert [body.material for body in (rest, steel, glass)] == [
        rc.materials["wood"],
        rc.Material(-0.9),
        rc.materials["glass"].with_surface(thickness=4e-3),
    ]
    assert glass.mesh.vertices.max() == 0.5
    np.testing.assert_array_equal(handle.motion.at(0.0).position, [2.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("materials", "shape", "fault"),
    [
        ('{ glas = "glass" }', "mesh", "materials: no material 'glas' in the file; did you mean 'glass'?"),
        ('{ glass = "glas" }', "mesh", "materials: material: no material 'glas'; did you mean 'glass'?"),
        ('{ glass = "glass" }', "ball", "materials: expected a shape of kind 'mesh' with an OBJ file, got 'sphere'"),
    ],
)
def test_materials_that_an_obj_file_does_not_have_are_refused(
    tmp_path: Path, materials: str, shape: str, fault: str
) -> None:
    (tmp_path / "part.obj").write_text(PARTS, encoding="utf-8")
    kinds = {"mesh": '{ kind = "mesh", path = "part.obj" }', "ball": '{ kind = "sphere", radius = 0.1 }'}
    check_fault(write(tmp_path, f"{shaped(kinds[shape])}materials = {materials}\n"), f"body[0] 'a': {fault}")


@pytest.mark.parametrize(
    ("text", "expected"),
    [('"vertical"', "vertical"), ('"horizontal"', "horizontal"), ("[0.0, 0.6, 0.8]", (0.0, 0.6, 0.8))],
)
@pytest.mark.parametrize("head", [RADAR, '[radar]\npreset = "bgt60tr13c"\n'])
def test_polarization_is_a_word_or_a_vector(tmp_path: Path, head: str, text: str, expected: object) -> None:
    assert load(tmp_path, "", radar=f"{head}polarization = {text}\n").radar.polarization == expected


@pytest.mark.parametrize(
    ("text", "pose"),
    [
        ("{ position = [1, 2, 3] }", rc.Pose([1.0, 2.0, 3.0])),
        ("{ rpy_deg = [90, 0, 45] }", rc.Pose.from_rpy([0.0, 0.0, 0.0], [np.pi / 2, 0.0, np.pi / 4])),
        ("{ quaternion = [1, 0, 1, 0] }", rc.Pose.from_quaternion([0.0, 0.0, 0.0], [1.0, 0.0, 1.0, 0.0])),
        ("{ position = [0, 0, 1], look_at = [2, 1, 0] }", rc.Pose.look_at([0.0, 0.0, 1.0], [2.0, 1.0, 0.0])),
    ],
)
def test_poses(tmp_path: Path, text: str, pose: rc.Pose) -> None:
    assert load(tmp_path, f"[sensor]\npose = {text}\n").radar_motion == pose


def test_sensor_moves(tmp_path: Path) -> None:
    moving = load(
        tmp_path, '[sensor]\nmotion = { kind = "linear", velocity = [1, 0, 0], angular_velocity = [0, 0, 2] }\n'
    )
    expected = rc.Linear(rc.Pose(), [1.0, 0.0, 0.0], [0.0, 0.0, 2.0])
    assert moving.radar_motion.at(0.7) == expected.at(0.7)
    poses = "[{ position = [0, 0, 0] }, { position = [1, 0, 0] }]"
    curve = load(tmp_path, f'[sensor]\nmotion = {{ kind = "trajectory", times = [0, 1], poses = {poses} }}\n')
    assert curve.radar_motion.at(0.5).position[0] == pytest.approx(0.5)


def test_attached_bodies_may_stand_before_their_carriers(tmp_path: Path) -> None:
    carried = BALL.replace('"ball"', '"top"') + 'attached_to = "ball"\n'
    simulation = load(tmp_path, carried + BALL + 'motion = { kind = "linear", velocity = [0, 1, 0] }\n')
    assert simulation.scene.names == ("top", "ball")
    assert pose_of(simulation, "top", time=0.5).position.tolist() == [4.0, 0.5, 0.0]


def test_gripper_on_an_arm_on_a_cart(tmp_path: Path) -> None:
    cart = BALL + 'motion = { kind = "linear", velocity = [0, 1, 0] }\n'
    arm = '[[arm]]\nattached_to = "ball"\npose = { position = [0, 0, 1] }\n'
    arm += 'joints = { kind = "rest", angles_deg = [0, -90, 90, 0, 90, 0] }\n'
    gripper = '[[body]]\nname = "gripper"\nshape = { kind = "sphere", radius = 0.02 }\nattached_to = "arm/tool0"\n'
    simulation = load(tmp_path, gripper + cart + arm)
    flange = rc.models.RobotArm.ur10().link_pose("tool0", np.deg2rad([0, -90, 90, 0, 90, 0]))
    assert pose_of(simulation, "gripper", time=2.0).position == pytest.approx(
        flange.position + np.array([2.0, 2.0, 1.0])
    )


def test_along_z_looks_along_the_flange(tmp_path: Path) -> None:
    arm = '[[arm]]\njoints = { kind = "rest", angles_deg = [0, -120, 120, 0, 90, 0] }\n'
    simulation = load(tmp_path, '[sensor]\nattached_to = "arm/tool0"\nalong_z = 0.05\n' + arm)
    flange = rc.models.RobotArm.ur10().link_pose("tool0", np.deg2rad([0, -120, 120, 0, 90, 0]))
    sensor = simulation.radar_motion.at(0.0)
    assert sensor.rotation[:, 0] == pytest.approx(flange.rotation[:, 2])
    assert sensor.position == pytest.approx(flange.position + 0.05 * flange.rotation[:, 2])


def test_arm_follows_joint_angles(tmp_path: Path) -> None:
    rows = "[[0, -90, 90, 0, 90, 0], [30, -90, 90, 0, 90, 0]]"
    arm = f'[[arm]]\nname = "robot"\njoints = {{ kind = "trajectory", times = [0, 1], angles_deg = {rows} }}\n'
    simulation = load(tmp_path, '[sensor]\nattached_to = "robot/tool0"\nalong_z = 0.05\n' + arm)
    before, after = (simulation.radar_motion.at(time).position for time in (0.0, 1.0))
    turn = np.arctan2(after[1], after[0]) - np.arctan2(before[1], before[0])
    assert turn == pytest.approx(np.deg2rad(30.0))


def test_arm_from_a_urdf_file_slides_in_metres(tmp_path: Path) -> None:
    (tmp_path / "slide.urdf").write_text(
        '<robot name="slide"><link name="base"/><link name="hand"><collision><geometry><sphere radius="0.1"/>'
        '</geometry></collision></link><joint name="rail" type="prismatic"><parent link="base"/><child link="hand"/>'
        '<axis xyz="1 0 0"/><limit lower="0" upper="3" velocity="1" effort="1"/></joint></robot>'
    )
    arm = '[[arm]]\nmodel = "slide.urdf"\njoints = { kind = "rest", angles_deg = [2.5] }\n'
    assert pose_of(load(tmp_path, arm), "arm/hand").position.tolist() == [2.5, 0.0, 0.0]


@pytest.mark.skipif(not robots.is_available(), reason="needs the extra `robots`: pip install radarcore[robots]")
def test_real_meshes_of_arm_and_human(tmp_path: Path) -> None:
    arm = '[[arm]]\nmeshes = true\njoints = { kind = "rest", angles_deg = [0, -90, 90, 0, 90, 0] }\n'
    simulation = load(
        tmp_path,
        "[sensor]\npose = { position = [0, 0, 2] }\n" + arm + "[[human]]\nmeshes = true\npath = [[3, 0], [5, 0]]\n",
    )
    counts = {}
    for name, body in zip(simulation.scene.names, simulation.scene.bodies, strict=True):
        assert isinstance(body, rc.Body)
        counts[name.split("/")[0]] = counts.get(name.split("/")[0], 0) + len(body.mesh.triangles)
    assert counts["arm"] == 5862
    assert counts["human"] > 100_000


def test_human_and_point_have_all_their_keys(tmp_path: Path) -> None:
    simulation = load(
        tmp_path,
        '[[human]]\nname = "tom"\nheight = 1.9\nspeed = 1.0\npath = [[3, 0], [5, 0], [5, 3]]\nturn_radius = 0.5\n'
        'start_time = 0.5\nphase = 0.25\nmass = 90.0\nmaterial = "wood"\n'
        '[[point]]\nname = "p"\nposition = [1, 2, 3]\nvelocity = [0, 0, 1]\nrcs = 0.5\n',
    )
    human = rc.models.Human(
        height=1.9, speed=1.0, path=[[3, 0], [5, 0], [5, 3]], turn_radius=0.5, start_time=0.5, phase=0.25, mass=90.0
    )
    expected = human.bodies(material=rc.materials["wood"], name="tom")
    point, *segments = simulation.scene.bodies
    assert isinstance(point, rc.PointTarget)
    assert (point.name, point.rcs, point.position.tolist(), point.velocity.tolist()) == ("p", 0.5, [1, 2, 3], [0, 0, 1])
    for body, other in zip(segments, expected, strict=True):
        assert isinstance(body, rc.Body)
        assert (body.name, body.material) == (other.name, other.material)
        assert np.array_equal(body.mesh.vertices, other.mesh.vertices)
        assert body.motion.at(0.8) == other.motion.at(0.8)


def test_radar_has_all_its_keys(tmp_path: Path) -> None:
    text = """
    [radar]
    start_frequency = 77e9
    slope = -20e12
    sample_rate = 5e6
    num_samples = 32
    num_chirps = 3
    chirp_times = [0.0, 1e-4, 3e-4]
    frame_interval = 0.01
    adc_delay = 1e-6
    tx = [[0, 0.002, 0], [0, -0.002, 0]]
    rx = [[0, 0, 0.001]]
    tx_power_dbm = 10
    pattern = { gain_db = 5, beamwidth_azimuth_deg = 60, beamwidth_elevation_deg = 30 }
    receiver = { output = "real", noise_figure_db = 10 }
    """
    waveform = rc.Waveform(
        start_frequency=77e9,
        slope=-20e12,
        sample_rate=5e6,
        num_samples=32,
        num_chirps=3,
        chirp_times=np.array([0.0, 1e-4, 3e-4]),
        frame_interval=0.01,
        adc_delay=1e-6,
    )
    expected = rc.Radar(
        waveform,
        tx=[[0, 0.002, 0], [0, -0.002, 0]],
        rx=[[0, 0, 0.001]],
        tx_power_dbm=10.0,
        pattern=rc.GaussianPattern(5.0, 60.0, 30.0),
        receiver=rc.Receiver(output="real", noise_figure_db=10.0),
    )
    assert load(tmp_path, "", radar=text).radar == expected


def test_radar_has_patterns_from_tables_and_files(tmp_path: Path) -> None:
    (tmp_path / "horn.csv").write_text("azimuth_deg,elevation_deg,gain_db\n-9,0,1\n9,0,2\n-9,9,3\n9,9,4\n", "utf-8")
    text = """
    [radar]
    preset = "bgt60tr13c"
    pattern = { azimuth_deg = [-60, 0, 60], elevation_deg = [-30, 30], gain_db = [[0, 0], [10, 12], [0, 0.5]] }
    tx_patterns = [{ path = "horn.csv" }]
    """
    radar = load(tmp_path, "", radar=text).radar
    table = rc.TabulatedPattern.from_degrees([-60, 0, 60], [-30, 30], [[0, 0], [10, 12], [0, 0.5]])
    horn = rc.TabulatedPattern.from_degrees([-9, 9], [0, 9], [[1, 3], [2, 4]])
    assert (radar.pattern, radar.tx_patterns, radar.rx_patterns) == (table, (horn,), (table,) * 3)
    preset = load(tmp_path, "", radar='[radar]\npreset = "bgt60tr13c"\nrx_patterns = [{}, { gain_db = 3 }, {}]').radar
    assert preset.tx_patterns == (rc.bgt60tr13c().pattern,)
    assert preset.rx_patterns == (rc.IsotropicPattern(), rc.IsotropicPattern(3.0), rc.IsotropicPattern())


def test_preset_takes_other_values(tmp_path: Path) -> None:
    text = '[radar]\npreset = "bgt60tr13c"\nstop_frequency = 60e9\nnum_chirps = 8\ntx_power_dbm = 0\n'
    assert load(tmp_path, "", radar=text).radar == rc.bgt60tr13c(stop_frequency=60e9, num_chirps=8, tx_power_dbm=0.0)
    receiver = load(tmp_path, "", radar=text + 'receiver = { output = "iq" }\n').radar.receiver
    assert receiver == rc.Receiver(output="iq")


def test_run_reaches_the_simulator(tmp_path: Path) -> None:
    run = '[run]\nresolution = [8, 16]\nfield_of_view_deg = [50, 40]\nsampling = "point"\ntolerance = 1e-5\nseed = 3\n'
    simulator = load(tmp_path, run + "max_bounces = 3\nbounce_floor_db = 60\n").simulator(threads=1)
    assert simulator.resolution == (8, 16)
    assert simulator.field_of_view_deg == (50.0, 40.0)
    assert (simulator.sampling, simulator.tolerance, simulator.seed) == ("point", 1e-5, 3)
    assert (simulator.max_bounces, simulator.bounce_floor_db) == (3, 60.0)


def test_empty_scene_is_a_scene(tmp_path: Path) -> None:
    assert not load(tmp_path, "").simulator().frame().cube.any()


def test_room_around_the_sensor_is_no_fault(tmp_path: Path) -> None:
    assert load(tmp_path, '[[body]]\nshape = { kind = "box", size = [4, 4, 4] }\n').scene.names == ("body 0",)


# --- Faults


def shaped(shape: str) -> str:
    return f'[[body]]\nname = "a"\nshape = {shape}\npose = {{ position = [2, 0, 0] }}\n'


def radar(line: str, without: str = "") -> str:
    return "\n".join(row for row in RADAR.splitlines() if not (without and row.startswith(without))) + f"\n{line}\n"


FAULTS = {
    # Unknown keys, tables and names.
    "key": (
        BALL + "colour = 1",
        "body[0] 'ball': unknown key 'colour'; known: pose, motion, attached_to, name, shape, material",
    ),
    "near key": (
        BALL + 'materal = "wood"',
        "body[0] 'ball': unknown key 'materal'; did you mean 'material' or 'materials'?",
    ),
    "near shape key": (
        shaped('{ kind = "sphere", raduis = 0.1 }'),
        "body[0] 'a': shape: unknown key 'raduis'; did you mean 'radius'?",
    ),
    "near table": ("[[bodys]]\nname = 1", "unknown key 'bodys'; did you mean 'body'?"),
    "run key": ("[run]\nresoluton = 3", "run: unknown key 'resoluton'; did you mean 'resolution'?"),
    "kind": (
        shaped('{ kind = "spere", radius = 0.1 }'),
        "body[0] 'a': kind: expected one of 'plate', 'disc', 'box', 'sphere', 'cylinder', 'capsule', 'dihedral', "
        "'trihedral', 'mesh', got 'spere'",
    ),
    "no kind": (
        BALL + "motion = { velocity = [1, 0, 0] }",
        "body[0] 'ball': motion.kind: expected one of 'linear', 'trajectory', got none",
    ),
    "material": (BALL + 'material = "woood"', "body[0] 'ball': material: no material 'woood'; did you mean 'wood' or"),
    "material key": (
        BALL + "material = { albdo = 0.1 }",
        "body[0] 'ball': material: unknown key 'albdo'; did you mean 'albedo'?",
    ),
    "choice": (
        '[run]\nsampling = "points"',
        "run: sampling: expected 'adaptive', 'fast', 'footprint' or 'point', got 'points'",
    ),
    "attachment": (
        BALL + '[sensor]\nattached_to = "bal"',
        "sensor: attached_to: unknown 'bal'; did you mean 'ball'?",
    ),
    "body attachment": (
        BALL + 'attached_to = "arm/tool0"',
        "body[0] 'ball': attached_to: unknown 'arm/tool0'; known: none",
    ),
    "circle": (
        BALL + 'attached_to = "ball"',
        "body[0] 'ball': attached_to: expected a carrier that is not attached to this in turn, got 'ball'",
    ),
    "link": (
        '[sensor]\nattached_to = "arm/tol0"\n[[arm]]\njoints = { kind = "rest", angles_deg = [0, 0, 0, 0, 0, 0] }',
        "sensor: attached_to: unknown 'arm/tol0'; did you mean 'arm/tool0'?",
    ),
    "same names": (BALL + BALL, "body[1] 'ball': name: expected a name of its own, got that of body[0] 'ball'"),
    "same humans": (
        "[[human]]\npath = [[3, 0], [5, 0]]\n" * 2,
        "human[1] 'human': name: expected a name of its own, got that of human[0] 'human'",
    ),
    # Wrong types and units.
    "unit in text": (
        shaped('{ kind = "sphere", radius = "10 cm" }'),
        "body[0] 'a': radius: expected a number [m], got '10 cm'",
    ),
    "number as name": (BALL.replace('"ball"', "3"), "body[0]: name: expected text, got 3"),
    "boolean": ("[run]\nrate = true", "run: rate: expected a number [Hz], got true"),
    "infinite": ("[run]\nstop = inf", "run: stop: expected a finite number [s], got inf"),
    "fraction": ("[run]\nseed = 1.5", "run: seed: expected an integer, got 1.5"),
    "no integers": ('[run]\nresolution = "fine"', "run: resolution: expected an integer or a list, got 'fine'"),
    "short vector": (
        BALL + "[sensor]\npose = { position = [1, 2] }",
        "sensor: pose.position[2]: expected a value [m], got none",
    ),
    "long vector": (
        "[sensor]\npose = { position = [1, 2, 3, 4] }",
        "sensor: pose.position: expected 3 values [m], got 4",
    ),
    "no table": ("[[body]]\nshape = 3", "body[0]: shape: expected a table, got 3"),
    "missing": ('[[body]]\nname = "x"', "body[0] 'x': shape: expected a value, got none"),
    "missing size": (shaped('{ kind = "sphere" }'), "body[0] 'a': radius: expected a value [m], got none"),
    "date": ("[run]\nstart = 2020-01-01", "run: start: expected a number [s], got '2020-01-01'"),
    # Values that cannot be.
    "negative size": (
        BALL + BALL.replace('"ball"', '"b"') + '[[body]]\nname = "table"\nshape = { kind = "sphere", radius = -0.1 }',
        "body[2] 'table': radius: expected a positive number [m], got -0.1",
    ),
    "negative rcs": (
        "[[point]]\nposition = [1, 0, 0]\nrcs = -1",
        "point[0]: rcs: expected zero or a positive number [m^2], got -1.0",
    ),
    "much material": (
        BALL + "material = { reflection = -1, albedo = 0.5 }",
        "body[0] 'ball': material.reflection, albedo: expected abs(reflection)**2 + albedo of at most 1, got 1.5",
    ),
    "two materials": (
        BALL + "material = { reflection = -1, permittivity = [2, 0] }",
        "body[0] 'ball': material.reflection: expected either reflection or permittivity, got both",
    ),
    "permittivity": (
        BALL + "material = { permittivity = [2, -1] }",
        "body[0] 'ball': material.permittivity: expected eps' - j eps'' with eps'' >= 0, got (2+1j)",
    ),
    "one permittivity": (
        BALL + "material = { permittivity = 2.0 }",
        "body[0] 'ball': material.permittivity: expected text or a list, got 2.0",
    ),
    "no permittivity of that name": (
        BALL + 'material = { permittivity = "conrete" }',
        "body[0] 'ball': material.permittivity: no material 'conrete'; did you mean 'concrete'?",
    ),
    "rough without permittivity": (
        BALL + "material = { reflection = -0.5, roughness = 1e-4 }",
        "body[0] 'ball': material.roughness: expected permittivity with it, got none",
    ),
    "albedo with permittivity": (
        BALL + "material = { permittivity = [2, 0], albedo = 0.1 }",
        "body[0] 'ball': material.albedo: expected none with permittivity (roughness or scattering",
    ),
    "two ways to scatter": (
        BALL + "material = { permittivity = [2, 0], roughness = 1e-4, scattering = 0.5 }",
        "body[0] 'ball': material.scattering: expected either scattering or roughness, got both (0.5, 0.0001 m)",
    ),
    "own material": (
        BALL + 'material = "fellt"\n[[material]]\nname = "felt"\npermittivity = [1.6, 0.06]',
        "body[0] 'ball': material: no material 'fellt'; did you mean 'felt'?",
    ),
    "material without a name": ("[[material]]\nreflection = -0.5", "material[0]: name: expected a value, got none"),
    "key of a material": (
        '[[material]]\nname = "felt"\nrougness = 1e-3',
        "material[0] 'felt': unknown key 'rougness'; did you mean 'roughness'?",
    ),
    "material of the library": (
        '[[material]]\nname = "wood"\nreflection = -0.5',
        "material[0] 'wood': name: expected a name of its own, got that of one of the library",
    ),
    "material twice": (
        '[[material]]\nname = "felt"\nalbedo = 0.5\n[[material]]\nname = "felt"\nalbedo = 0.4',
        "material[1] 'felt': name: expected a name of its own, got that of another",
    ),
    "bright material": (
        '[[material]]\nname = "felt"\nalbedo = 1.5',
        "material[0] 'felt': reflection, albedo: expected abs(reflection)**2 + albedo of at most 1, got 1.5",
    ),
    "two rotations": (
        "[sensor]\npose = { rpy_deg = [0, 0, 0], look_at = [1, 0, 0] }",
        "sensor: pose.look_at: expected one of rpy_deg, quaternion and look_at, got also rpy_deg",
    ),
    "look down": (
        "[sensor]\npose = { look_at = [0, 0, -1] }",
        "sensor: pose.look_at: expected a point not straight above or below (use rpy_deg for that)",
    ),
    "no rotation": (
        "[sensor]\npose = { quaternion = [0, 0, 0, 0] }",
        "sensor: pose.quaternion: expected (w, x, y, z) of any length but zero",
    ),
    "times": (
        BALL.replace("pose", "#")
        + 'motion = { kind = "trajectory", times = [0, 1, 0.5], poses = [{}, {}, { position = [1, 0, 0] }] }',
        "body[0] 'ball': motion.times: expected increasing times [s], got 1 and then 0.5",
    ),
    "pose and trajectory": (
        BALL + 'motion = { kind = "trajectory", times = [0, 1], poses = [{}, {}] }',
        "body[0] 'ball': pose: expected none together with a trajectory, which has its own poses",
    ),
    "joint times": (
        '[[arm]]\njoints = { kind = "trajectory", times = [1, 1], angles_deg = '
        "[[0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0]] }",
        "arm[0] 'arm': joints.times: expected increasing times [s], got 1 and then 1",
    ),
    "joint angles": (
        '[[arm]]\njoints = { kind = "rest", angles_deg = [0, 0] }',
        "arm[0] 'arm': joints.angles_deg: expected 6 values (shoulder_pan_joint, shoulder_lift_joint, elbow_joint, "
        "wrist_1_joint, wrist_2_joint, wrist_3_joint), got 2",
    ),
    "fast human": (
        "[[human]]\nspeed = 30\npath = [[3, 0], [5, 0]]",
        "human[0] 'human': speed: expected at most 2.78 m/s",
    ),
    "one waypoint": ("[[human]]\npath = [[3, 0]]", "human[0] 'human': path: expected at least two waypoints, got 1"),
    "run": ("[run]\nstop = -1", "run: stop: expected a time after start 0 s, got -1 s"),
    "rate": ("[run]\nrate = 0", "run: rate: expected a positive number [Hz], got 0.0"),
    "field of view": (
        "[run]\nfield_of_view_deg = [190, 60]",
        "run: field_of_view_deg: expected angles between 0 and 180 degrees, got [190.0, 60.0]",
    ),
    "along z alone": ("[sensor]\nalong_z = 0.05", "sensor: along_z: expected attached_to as well"),
    "along z and pose": (
        BALL + '[sensor]\nalong_z = 0.05\nattached_to = "ball"\npose = {}',
        "sensor: along_z: expected it alone, got pose as well",
    ),
    "body at the sensor": (
        shaped('{ kind = "sphere", radius = 2.0 }'),
        "sensor: pose: expected all antennas at least 1 mm from every surface when the run begins, got ",
    ),
    "sensor in a body": (
        '[[body]]\nname = "ball"\nshape = { kind = "sphere", radius = 0.3 }',
        "sensor: pose: expected the antennas outside of every body smaller than 2 m when the run begins, got them "
        "inside 'ball'",
    ),
    "point at the sensor": (
        '[[point]]\nname = "p"\nposition = [0, 0, 0]',
        "sensor: pose: expected all antennas at least 1 mm from every surface when the run begins, got 0 mm to 'p'",
    ),
    "flange": (
        '[sensor]\nattached_to = "arm/tool0"\nalong_z = 0\n[[arm]]\n'
        'joints = { kind = "rest", angles_deg = [0, 0, 0, 0, 0, 0] }',
        "sensor: pose: expected all antennas at least 1 mm from every surface when the run begins, got ",
    ),
}

RADAR_FAULTS = {
    "gigahertz": (
        radar("start_frequency = 60", without="start"),
        "radar: start_frequency: expected 1e8 to 3e12 [Hz] (60 GHz is 60e9), got 60",
    ),
    "preset gigahertz": (
        '[radar]\npreset = "bgt60tr13c"\nstop_frequency = 61.5',
        "radar: stop_frequency: expected 1e8 to 3e12 [Hz] (60 GHz is 60e9), got 61.5",
    ),
    "preset": (
        '[radar]\npreset = "bgt60"',
        "radar: preset: expected 'bgt60tr13c', got 'bgt60'",
    ),
    "no radar": ("[run]\nstop = 1", "radar: expected a value, got none"),
    "no samples": (radar("", without="num_samples"), "radar: num_samples: expected a value, or a preset, got none"),
    "no slope": (radar("", without="stop"), "radar: slope: expected either slope or stop_frequency, got none"),
    "polarization": (
        radar('polarization = "circular"'),
        "radar: polarization: expected 'vertical' or 'horizontal' or a list, got 'circular'",
    ),
    "long polarization": (
        radar("polarization = [0, 0, 2]"),
        "radar: polarization: expected a unit vector, got one of length 2",
    ),
    "two slopes": (radar("slope = 1e12"), "radar: slope: expected either slope or stop_frequency, got both"),
    "float count": (
        radar("num_samples = 64.0", without="num_samples"),
        "radar: num_samples: expected an integer, got 64.0",
    ),
    "chirp times": (
        radar("num_chirps = 2\nchirp_times = [1e-3, 0.0]"),
        "radar: chirp_times: expected increasing times [s], got 0.001 and 0 at index 0 and 1",
    ),
    "beam width": (
        radar("pattern = { beamwidth_azimuth_deg = 30 }"),
        "radar: pattern.beamwidth_elevation_deg: expected both beam widths or none [degrees], got one",
    ),
    "negative beam": (
        radar("pattern = { beamwidth_azimuth_deg = -30, beamwidth_elevation_deg = 3 }"),
        "radar: pattern.beamwidth_azimuth_deg: expected a positive number [degrees], got -30.0",
    ),
    "table without gains": (
        radar("pattern = { azimuth_deg = [0, 1], elevation_deg = [0, 1] }"),
        "radar: pattern.gain_db: expected a list, as all three keys of a table are, got none",
    ),
    "gains without angles": (
        radar("pattern = { gain_db = [[0, 1], [0, 1]], elevation_deg = [0, 1] }"),
        "radar: pattern.azimuth_deg: expected a list, as all three keys of a table are, got none",
    ),
    "one gain": (
        radar("pattern = { azimuth_deg = [0, 1], elevation_deg = [0, 1], gain_db = 3 }"),
        "radar: pattern.gain_db: expected a list, as all three keys of a table are, got 3.0",
    ),
    "table of radians": (
        radar("pattern = { azimuth_deg = [0, 1], elevation_deg = [0, 91], gain_db = [[0, 0], [0, 0]] }"),
        "radar: pattern.elevation_deg: expected angles from -90 to 90 [degrees], got 91",
    ),
    "table of words": (
        radar('pattern = { azimuth_deg = [0, 1], elevation_deg = [0, 1], gain_db = [[0, 0], [0, "x"]] }'),
        "radar: pattern.gain_db[1][1]: expected a number [dBi], got 'x'",
    ),
    "word for a gain": (
        radar('pattern = { gain_db = "x" }'),
        "radar: pattern.gain_db: expected a number or a list [dBi], got 'x'",
    ),
    "table and widths": (
        radar(
            "pattern = { azimuth_deg = [0, 1], elevation_deg = [0, 1], gain_db = [[0, 0], [0, 0]], "
            "beamwidth_azimuth_deg = 3 }"
        ),
        "radar: pattern.azimuth_deg: expected either a table or beam widths, got both",
    ),
    "file and gain": (
        radar('pattern = { path = "horn.csv", gain_db = 3 }'),
        "radar: pattern.path: expected it alone, got gain_db as well",
    ),
    "patterns": (
        radar("tx_patterns = [{}, {}]"),
        "radar: tx_patterns: expected 1 patterns, one per element, got 2",
    ),
    "one of the patterns": (
        radar("tx_patterns = [{ beamwidth_azimuth_deg = 30 }]"),
        "radar: tx_patterns[0].beamwidth_elevation_deg: expected both beam widths or none [degrees], got one",
    ),
    "receiver": (
        radar("receiver = { noise_figure = 3 }"),
        "radar: receiver: unknown key 'noise_figure'; did you mean 'noise_figure_db'?",
    ),
    "antennas": (radar("rx = [[0, 0]]"), "radar: rx[0][2]: expected a value [m], got none"),
    "syntax": ("[radar]\npreset = bgt60", "not TOML: Invalid value (at line 2, column 10)"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_fault_is_one_line_that_names_it(tmp_path: Path, name: str) -> None:
    text, message = FAULTS[name]
    check_fault(write(tmp_path, text), message)


@pytest.mark.parametrize("name", RADAR_FAULTS)
def test_radar_fault_is_one_line_that_names_it(tmp_path: Path, name: str) -> None:
    text, message = RADAR_FAULTS[name]
    check_fault(write(tmp_path, "", radar=text), message)


def check_fault(path: Path, message: str) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        rc.load_scene(path)
    line = str(caught.value)
    # A message that ends in a word, number or quote is the whole line; others are its beginning.
    assert line.startswith(f"{path}: {message}")
    assert "\n" not in line


def test_missing_mesh_is_named_with_its_body(tmp_path: Path) -> None:
    path = write(tmp_path, shaped('{ kind = "mesh", path = "part.obj" }'))
    with pytest.raises(FileNotFoundError) as caught:
        rc.load_scene(path)
    assert str(caught.value) == f"{path}: body[0] 'a': path: expected a mesh file, got none at {tmp_path / 'part.obj'}"


def test_broken_mesh_is_named_with_its_body_and_line(tmp_path: Path) -> None:
    (tmp_path / "part.obj").write_text("v 0 0 x\n")
    check_fault(write(tmp_path, shaped('{ kind = "mesh", path = "part.obj" }')), "body[0] 'a': ")


def test_missing_urdf_is_named_with_its_arm(tmp_path: Path) -> None:
    path = write(tmp_path, '[[arm]]\nmodel = "x.urdf"\njoints = { kind = "rest", angles_deg = [] }\n')
    with pytest.raises(FileNotFoundError) as caught:
        rc.load_scene(path)
    assert str(caught.value).startswith(f"{path}: arm[0] 'arm': model: ")


def test_missing_scene_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        rc.load_scene(tmp_path / "none.toml")


def test_text_that_is_no_utf8(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(b"[radar]\n# \xff\n")
    check_fault(path, "not TOML: expected UTF-8, got byte 0xff")


def test_misspelt_key_does_not_hide_a_fault_of_the_right_one(tmp_path: Path) -> None:
    path = write(tmp_path, shaped('{ kind = "sphere", raduis = 0.1, radius = "x" }'))
    with pytest.raises(ValueError, match="raduis") as caught:
        rc.load_scene(path)
    assert "radius: expected a number [m], got 'x'" in str(caught.value)


def test_value_of_one_of_several_types(tmp_path: Path) -> None:
    check_fault(write(tmp_path, BALL + "material = 3"), "body[0] 'ball': material: expected text or a table, got 3")
    check_fault(write(tmp_path, "[run]\nresolution = [1, 2.5]"), "run: resolution[1]: expected an integer, got 2.5")


def test_several_faults_are_one_line_each(tmp_path: Path) -> None:
    path = write(tmp_path, '[run]\nstopp = 1\nrate = "fast"\n')
    with pytest.raises(ValueError, match="stopp") as caught:
        rc.load_scene(path)
    assert str(caught.value).splitlines() == [
        f"{path}: run: rate: expected a number [Hz], got 'fast'",
        f"{path}: run: unknown key 'stopp'; did you mean 'stop'?",
    ]


# --- Schema


def all_keys(table: type[tables.Table] = tables.SceneTable, prefix: str = "") -> Iterator[str]:
    for name, field in table.model_fields.items():
        if name == "kind":
            continue
        inner = tables_in(field.annotation)
        key = prefix + name + ("[]" if inner and get_origin(field.annotation) is list else "")
        yield key
        for part in inner:
            yield from all_keys(part, f"{key}.")


def test_schema_lists_every_key_with_unit_and_default() -> None:
    lines = schema.text().splitlines()
    listed = {line.split()[0] for line in lines}
    assert set(all_keys()) <= listed
    assert len(set(all_keys())) > 100
    for line in lines:
        key, text = line.split(maxsplit=1)
        if not key.endswith(".kind") and key not in ("sensor", "run") and not key.endswith(".pose"):
            assert "default: " in text or "required" in text, line
        if key.endswith("_deg"):
            assert "[degrees" in text or "; metres" in text, line
        for unit, ends in {"Hz": "frequency", "s": "_interval", "m": "position"}.items():
            if key.endswith(ends):
                assert f"[{unit}]" in text, line


def test_json_schema_has_the_same_keys_and_forbids_others() -> None:
    found = schema.json_schema()
    assert json.loads(json.dumps(found)) == found
    by_name = {"SceneTable": found, **found["$defs"]}

    def every(table: type[tables.Table]) -> Iterator[type[tables.Table]]:
        yield table
        for field in table.model_fields.values():
            for part in tables_in(field.annotation):
                yield from every(part)

    for table in every(tables.SceneTable):
        described: dict[str, Any] = by_name[table.__name__]
        assert set(described["properties"]) == set(table.model_fields)
        assert described["additionalProperties"] is False
        required = {name for name, field in table.model_fields.items() if field.is_required()}
        assert set(described.get("required", [])) == required
        assert all(
            get_args(field.annotation) or "description" in described["properties"][name]
            for name, field in table.model_fields.items()
        )


@pytest.mark.skipif(importlib.util.find_spec("jsonschema") is None, reason="needs jsonschema")
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_json_schema_accepts_the_examples(path: Path) -> None:
    import tomllib

    import jsonschema

    jsonschema.validate(tomllib.loads(path.read_text()), schema.json_schema())
