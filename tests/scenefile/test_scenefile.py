"""Scene files describe the objects that Python would have built."""

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from arms import needs_robots
from scene_files import BALL, EXAMPLES, PARTS, RADAR, load, pose_of, shaped


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_gives_the_same_samples_from_its_scene_file_and_from_python(path: Path) -> None:
    expected = runpy.run_path(str(path.with_suffix(".py")))["simulator"].frame(0.3)
    frame = rc.load_scene(path).simulator().frame(0.3)
    assert np.abs(expected.cube).max() > 0.0
    assert np.array_equal(frame.cube, expected.cube)
    assert frame.truth is not None
    assert frame.truth.names == expected.truth.names
    assert frame.radar == expected.radar


def bodies_of(simulation: rc.Simulation) -> list[rc.Body]:
    return [body for body in simulation.scene.bodies if isinstance(body, rc.Body)]


def bodies(folder: Path, text: str) -> list[rc.Body]:
    return bodies_of(load(folder, text))


def radar_table(keys: dict[str, Any]) -> str:
    return "[radar]\n" + "".join(f"{name} = {value}\n" for name, value in keys.items())


def test_there_is_an_example_for_everything_that_a_scene_holds() -> None:
    text = "".join(path.read_text() for path in EXAMPLES)
    for table in ("[[body]]", "[[point]]", "[[human]]", "[[arm]]", "[run]", "attached_to", "along_z", "preset"):
        assert table in text
    assert len(EXAMPLES) >= 5


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
        ('{ kind = "box", size = [0.1, 0.2, 0.3] }', rc.shapes.box([0.1, 0.2, 0.3])),
        ('{ kind = "sphere", radius = 0.2, subdivisions = 1 }', rc.shapes.sphere(0.2, subdivisions=1)),
        ('{ kind = "cylinder", radius = 0.2, length = 0.5, caps = false }', rc.shapes.cylinder(0.2, 0.5, caps=False)),
        ('{ kind = "dihedral", width = 0.2, height = 0.1 }', rc.shapes.dihedral(0.2, 0.1)),
        ('{ kind = "trihedral", leg = 0.2, shape = "square" }', rc.shapes.trihedral(0.2, shape="square")),
    ],
)
def test_shapes_are_those_of_python(tmp_path: Path, shape: str, mesh: rc.Mesh) -> None:
    (body,) = bodies(tmp_path, shaped(shape))
    assert np.array_equal(body.mesh.vertices, mesh.vertices)
    assert np.array_equal(body.mesh.triangles, mesh.triangles)


def test_mesh_file_is_relative_to_the_scene_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "part.obj").write_text("v 0 0 0\nv 0 100 0\nv 0 0 100\nf 1 2 3\n")
    monkeypatch.chdir("/")
    shape = '{ kind = "mesh", path = "part.obj", scale = 1e-3, crease_angle_deg = 20, shading = "flat" }'
    (body,) = bodies(tmp_path, shaped(shape))
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
    (body,) = bodies(tmp_path, BALL + f"material = {text}\n")
    assert body.material == material


def test_materials_of_the_file_are_referred_to_by_name(tmp_path: Path) -> None:
    text = (
        '[[material]]\nname = "felt"\npermittivity = [1.6, 0.06]\nthickness = 2e-3\n'
        '[[material]]\nname = "rough concrete"\npermittivity = "concrete"\nroughness = 5e-4\n'
        '[[material]]\nname = "paint"\nreflection = -0.2\nalbedo = 0.5\n'
    )
    for name in ("felt", "rough concrete", "paint", "wood"):
        text += f'[[body]]\nname = "{name}"\nmaterial = "{name}"\nshape = {{ kind = "plate", width = 1, height = 1 }}\n'
        text += "pose = { position = [2, 0, 0] }\n"
    made = [body.material for body in bodies(tmp_path, text)]
    concrete = rc.materials["concrete"]
    assert made == [
        rc.Material.dielectric(1.6 - 0.06j, thickness=2e-3),
        concrete.with_surface(roughness=5e-4),
        rc.Material(-0.2, 0.5),
        rc.materials["wood"],
    ]
    assert (made[1].source, made[1].valid_frequency) == (concrete.source, concrete.valid_frequency)


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
    rest, steel, glass, handle = bodies_of(simulation)
    assert [len(body.mesh.triangles) for body in (rest, steel, glass)] == [1, 1, 2]
    assert [body.material for body in (rest, steel, glass)] == [
        rc.materials["wood"],
        rc.Material(-0.9),
        rc.materials["glass"].with_surface(thickness=4e-3),
    ]
    assert glass.mesh.vertices.max() == 0.5
    np.testing.assert_array_equal(handle.motion.at(0.0).position, [2.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("text", "expected"),
    [('"vertical"', "vertical"), ('"horizontal"', "horizontal"), ("[0.0, 0.6, 0.8]", (0.0, 0.6, 0.8))],
)
@pytest.mark.parametrize("head", [RADAR, '[radar]\npreset = "bgt60tr13c"\n'])
def test_polarization_is_a_word_or_a_vector(tmp_path: Path, head: str, text: str, expected: object) -> None:
    assert load(tmp_path, "", radar=f"{head}polarization = {text}\n").radar.polarization == expected


def test_channel_weights_are_pairs(tmp_path: Path) -> None:
    head = '[radar]\npreset = "bgt60tr13c"\nchannel_weights = [[1, 0], [0.5, -0.5], [0, 1.25]]\n'
    weights = load(tmp_path, "", radar=head).radar.channel_weights
    assert weights is not None
    assert weights.tolist() == [1.0, 0.5 - 0.5j, 1.25j]


@pytest.mark.parametrize(
    ("text", "pose"),
    [
        ("{ position = [1, 2, 3] }", rc.Pose([1.0, 2.0, 3.0])),
        ("{ rpy_deg = [90, 0, 45] }", rc.Pose.from_rpy([0.0, 0.0, 0.0], [np.pi / 2, 0.0, np.pi / 4])),
        ("{ wxyz = [1, 0, 1, 0] }", rc.Pose.from_quaternion([0.0, 0.0, 0.0], wxyz=[1.0, 0.0, 1.0, 0.0])),
        ("{ xyzw = [0, 1, 0, 1] }", rc.Pose.from_quaternion([0.0, 0.0, 0.0], wxyz=[1.0, 0.0, 1.0, 0.0])),
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


def test_motions_go_on_beyond_their_ends_as_the_file_says(tmp_path: Path) -> None:
    head = '[sensor]\nmotion = { kind = "trajectory", times = [0, 1], poses = [{}, { position = [1, 0, 0] }], '
    held, goes_on = (load(tmp_path, f'{head}extrapolate = "{mode}" }}\n').radar_motion for mode in ("hold", "continue"))
    assert held.at(3.0).position == pytest.approx([1.0, 0.0, 0.0])
    assert goes_on.at(3.0).position == pytest.approx([3.0, 0.0, 0.0])
    rows = "[[0, -90, 90, 0, 90, 0], [30, -90, 90, 0, 90, 0]]"
    arm = f'[[arm]]\njoints = {{ kind = "trajectory", times = [0, 1], angles_deg = {rows}, extrapolate = "error" }}\n'
    simulation = load(tmp_path, arm + "pose = { position = [2, 0, 0] }\n")
    with pytest.raises(ValueError, match="time: expected 0 to 1 s, the times of this JointTrajectory, got 3 s"):
        pose_of(simulation, "arm/forearm_link", time=3.0)


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


@needs_robots
def test_arm_by_name_has_its_kinematics_and_meshes(tmp_path: Path) -> None:
    arm = '[[arm]]\nmodel = "ur5"\njoints = { kind = "rest", angles_deg = [0, 0, 0, 0, 0, 0] }\n'
    simulation = load(tmp_path, '[sensor]\nattached_to = "arm/tool0"\nalong_z = 0.1\n' + arm)
    # d4 + d6, and a2 + a3 of the maker's parameters; the flange looks along +y.
    np.testing.assert_allclose(simulation.radar_motion.at(0.0).position, [0.81725, 0.29145, -0.005491], atol=2e-5)
    assert simulation.scene.num_triangles == 5328  # of its collision meshes


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
    point = simulation.scene.bodies[0]
    assert isinstance(point, rc.PointTarget)
    assert (point.name, point.rcs, point.position.tolist(), point.velocity.tolist()) == ("p", 0.5, [1, 2, 3], [0, 0, 1])
    for body, other in zip(bodies_of(simulation), expected, strict=True):
        assert (body.name, body.material) == (other.name, other.material)
        assert np.array_equal(body.mesh.vertices, other.mesh.vertices)
        assert body.motion.at(0.8) == other.motion.at(0.8)


@pytest.mark.parametrize(("line", "breathing"), [("", 0.25), ("breathing = 0.4", 0.4), ("breathing = 0", None)])
def test_standing_human_breathes_as_the_file_says(tmp_path: Path, line: str, breathing: float | None) -> None:
    bodies = bodies_of(load(tmp_path, f"[[human]]\nspeed = 0\npath = [[3, 0], [0, 0]]\n{line}"))
    expected = rc.models.Human(speed=0.0, path=[[3, 0], [0, 0]], breathing=breathing).bodies()
    for body, other in zip(bodies, expected, strict=True):
        assert body.motion.at(0.8) == other.motion.at(0.8)


def test_radar_has_all_its_keys(tmp_path: Path) -> None:
    waveform: dict[str, Any] = {"start_frequency": 77e9, "slope": -20e12, "sample_rate": 5e6, "num_samples": 32}
    waveform |= {"num_chirps": 3, "chirp_times": [0.0, 1e-4, 3e-4], "frame_interval": 0.01, "adc_delay": 1e-6}
    array: dict[str, Any] = {"tx": [[0, 0.002, 0], [0, -0.002, 0]], "rx": [[0, 0, 0.001]], "tx_power_dbm": 10}
    more = """
    pattern = { gain_db = 5, beamwidth_azimuth_deg = 60, beamwidth_elevation_deg = 30 }
    receiver = { output = "real", noise_figure_db = 10 }
    """
    expected = rc.Radar(
        rc.Waveform(**waveform),
        **array,
        pattern=rc.GaussianPattern(5.0, 60.0, 30.0),
        receiver=rc.Receiver(output="real", noise_figure_db=10.0),
    )
    assert load(tmp_path, "", radar=radar_table(waveform | array) + more).radar == expected


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


@pytest.mark.parametrize(
    ("text", "schedule"),
    [
        ('{ kind = "tdm" }', rc.Schedule.tdm()),
        ('{ kind = "tdm", interval = 70e-6, order = [1, 0] }', rc.Schedule.tdm(70e-6, [1, 0])),
        ('{ kind = "ddm" }', rc.Schedule.ddm()),
        ('{ kind = "ddm", turns = [0, 0.25] }', rc.Schedule.ddm([0.0, 0.25])),
        ('{ kind = "steered" }', rc.Schedule.steered(azimuth=0.0)),
        (
            '{ kind = "steered", azimuth_deg = 10, elevation_deg = [5, 6] }',
            rc.Schedule.steered(azimuth=np.deg2rad(10.0), elevation=np.deg2rad([5.0, 6.0])),
        ),
        ('{ kind = "steered", phases_deg = [0, 90] }', rc.Schedule.steered(np.exp(1j * np.deg2rad([0.0, 90.0])))),
        (
            '{ kind = "steered", phases_deg = [[0, 90], [0, 180]] }',
            rc.Schedule.steered(np.exp(1j * np.deg2rad([[0.0, 90.0], [0.0, 180.0]]))),
        ),
    ],
)
def test_transmitters_have_schedules(tmp_path: Path, text: str, schedule: rc.Schedule) -> None:
    more = "tx = [[0, 0, 0], [0, 5e-3, 0]]\nnum_chirps = 2\nchirp_interval = 140e-6\n"
    assert load(tmp_path, f"{more}schedule = {text}\n").radar.schedule == schedule


def test_frames_have_sub_sequences(tmp_path: Path) -> None:
    times = "num_chirps = 4\nchirp_interval = 100e-6\n"
    radar = load(tmp_path, times).radar
    second = "{ delay = 1e-3, slope = -1e13, start_frequency = 62e9 }, { delay = 2e-3, num_chirps = 2 }"
    several = load(tmp_path, f"{times}sequences = [{second}]\n").radar
    one, two, three = several.waveforms
    assert one == radar.waveform
    assert two == one.replace(slope=-1e13, start_frequency=62e9).delayed(1e-3)
    assert three == one.replace(num_chirps=2).delayed(2e-3)
    assert load(tmp_path, f"{times}alternating = true\n").radar.waveforms == one.alternating()


def test_radars_come_from_requirements(tmp_path: Path) -> None:
    ranges, velocities = {"max_range": 8.0, "range_resolution": 0.1}, {"max_velocity": 3.0, "velocity_resolution": 0.2}
    requirements = ranges | velocities | {"rate": 20.0}
    text = radar_table(requirements)
    assert load(tmp_path, "", radar=text).radar.waveform == rc.Waveform.design(**requirements)
    preset = load(tmp_path, "", radar=text + 'preset = "bgt60tr13c"\n').radar
    assert preset == rc.bgt60tr13c(**requirements)


def test_run_reaches_the_simulator(tmp_path: Path) -> None:
    run = '[run]\nresolution = [8, 16]\nfield_of_view_deg = [50, 40]\nsampling = "point"\ntolerance = 1e-5\nseed = 3\n'
    simulator = load(tmp_path, run + "max_bounces = 3\nbounce_floor_db = 60\n").simulator(threads=1)
    assert simulator.resolution == (8, 16)
    assert simulator.field_of_view_deg == (50.0, 40.0)
    assert (simulator.sampling, simulator.tolerance, simulator.seed) == ("point", 1e-5, 3)
    assert (simulator.max_bounces, simulator.bounce_floor_db) == (3, 60.0)


def test_recording_of_a_scene_file_without_bodies_says_that_there_are_no_echoes(tmp_path: Path) -> None:
    simulation = load(tmp_path, "[run]\nstop = 0.1\nrate = 20.0\n")
    message = r"scene\.toml: expected a \[\[body\]\], .* or \[\[arm\]\], got none: there are no echoes"
    with pytest.warns(UserWarning, match=message) as caught:
        recording = simulation.record(progress=False)
    assert [warning.filename for warning in caught] == [__file__]
    assert len(recording) == 2
    assert not recording.cube.any()


def test_room_around_the_sensor_is_no_fault(tmp_path: Path) -> None:
    assert load(tmp_path, '[[body]]\nshape = { kind = "box", size = [4, 4, 4] }\n').scene.names == ("body 0",)


def test_a_run_without_a_rate_has_that_of_the_radar(tmp_path: Path) -> None:
    every = "frame_interval = 0.1\n"
    assert load(tmp_path, "", RADAR + every).run.rate == 10.0
    assert load(tmp_path, "[run]\nrate = 4\n", RADAR + every).run.rate == 4.0
    assert load(tmp_path, "").run.rate == 40.0  # frames back to back
    recording = load(tmp_path, "[run]\nstop = 0.5\n[[point]]\nposition = [2, 0, 0]\n", RADAR + every).record()
    np.testing.assert_allclose(recording.time, 0.1 * np.arange(5), atol=1e-15)


def test_warning_of_angles_in_radians_names_their_key(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="rpy_deg: expected degrees, got 3.14159; radians") as caught:
        load(tmp_path, BALL + "[sensor]\npose = { rpy_deg = [0.0, 0.0, 3.14159] }\n")
    assert len(caught) == 1
