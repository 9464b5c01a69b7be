"""Scene files that are wrong: every fault is one line that names it."""

from pathlib import Path

import pytest

import radarcore as rc
from scene_files import BALL, PARTS, RADAR, check_fault, shaped, write

MESH = '{ kind = "mesh", path = "part.obj" }'
ARM = '[[arm]]\njoints = { kind = "rest", angles_deg = [0, 0, 0, 0, 0, 0] }\n'
STEERED = 'schedule = { kind = "steered", phases_deg = '
BOTH_ENDS = "azimuth_deg = [0, 1], elevation_deg = [0, 1]"
NO_ANGLES = 'joints = { kind = "rest", angles_deg = [] }'
NEAR = "sensor: pose: expected all antennas at least 1 mm from every surface when the run begins, got "


def radar(line: str, without: str = "") -> str:
    return "\n".join(row for row in RADAR.splitlines() if not (without and row.startswith(without))) + f"\n{line}\n"


# A message that ends here may go on in the line.
FAULTS = [
    # Unknown keys, tables and names.
    (BALL + "colour = 1", "body[0] 'ball': unknown key 'colour'; known: pose, motion, attached_to, name, shape"),
    (BALL + 'materal = "wood"', "body[0] 'ball': unknown key 'materal'; did you mean 'material' or 'materials'?"),
    (shaped('{ kind = "sphere", raduis = 0.1 }'), "body[0] 'a': shape: unknown key 'raduis'; did you mean 'radius'?"),
    ("[[bodys]]\nname = 1", "unknown key 'bodys'; did you mean 'body'?"),
    ("[str]\nname = 1", "unknown key 'str'; known: radar, sensor"),
    (shaped('{ kind = "sphere", radius = 0.1, sphere = 1 }'), "body[0] 'a': shape: unknown key 'sphere'; known: kind"),
    (shaped('{ kind = "spere", radius = 0.1 }'), "body[0] 'a': kind: expected one of 'box', 'capsule', 'cylinder'"),
    (BALL + "motion = { velocity = [1, 0, 0] }", "body[0] 'ball': motion.kind: expected one of 'linear', 'trajectory'"),
    (BALL + 'material = "woood"', "body[0] 'ball': material: no material 'woood'; did you mean 'wood' or"),
    (BALL + "material = { albdo = 0.1 }", "body[0] 'ball': material: unknown key 'albdo'; did you mean 'albedo'?"),
    ('[run]\nsampling = "points"', "run: sampling: expected 'adaptive', 'fast', 'footprint' or 'point', got 'points'"),
    (BALL + '[sensor]\nattached_to = "bal"', "sensor: attached_to: unknown 'bal'; did you mean 'ball'?"),
    (BALL + 'attached_to = "ball"', "body[0] 'ball': attached_to: expected a carrier that is not attached to this"),
    (ARM + '[sensor]\nattached_to = "arm/tol0"', "sensor: attached_to: unknown 'arm/tol0'; did you mean 'arm/tool0'?"),
    (BALL + BALL, "body[1] 'ball': name: expected a name of its own, got that of body[0] 'ball'"),
    (f'{shaped(MESH)}materials = {{ glas = "glass" }}', "body[0] 'a': materials: no material 'glas' in the file"),
    (f'{shaped(MESH)}materials = {{ glass = "glas" }}', "body[0] 'a': materials: material: no material 'glas'"),
    (BALL + 'materials = { glass = "glass" }', "body[0] 'ball': materials: expected a shape of kind 'mesh' with"),
    (f'[[arm]]\nmodel = "ur6"\n{NO_ANGLES}', "arm[0] 'arm': model: expected a URDF file or an arm by name, got 'ur6'"),
    (f'[[arm]]\nmodel = "robot"\n{NO_ANGLES}', "arm[0] 'arm': model: expected a URDF file or an arm by name, got "),
    # Wrong types and units.
    (shaped('{ kind = "sphere", radius = "10 cm" }'), "body[0] 'a': radius: expected a number [m], got '10 cm'"),
    ("[run]\nrate = true", "run: rate: expected a number [Hz], got true"),
    ("[run]\nstop = inf", "run: stop: expected a finite number [s], got inf"),
    ('[run]\nresolution = "fine"', "run: resolution: expected an integer or a list, got 'fine'"),
    (BALL + "[sensor]\npose = { position = [1, 2] }", "sensor: pose.position[2]: expected a value [m], got none"),
    ("[sensor]\npose = { position = [1, 2, 3, 4] }", "sensor: pose.position: expected 3 values [m], got 4"),
    ("[[body]]\nshape = 3", "body[0]: shape: expected a table, got 3"),
    ('[[body]]\nname = "x"', "body[0] 'x': shape: expected a value, got none"),
    (BALL + "material = 3", "body[0] 'ball': material: expected text or a table, got 3"),
    ("[run]\nresolution = [1, 2.5]", "run: resolution[1]: expected an integer, got 2.5"),
    (shaped('{ kind = "mesh", path = "broken.obj" }'), "body[0] 'a': "),
    # Values that cannot be.
    (BALL + shaped('{ kind = "sphere", radius = -0.1 }'), "body[1] 'a': radius: expected a positive number [m], got"),
    (
        BALL + "material = { reflection = -1, permittivity = [2, 0] }",
        "body[0] 'ball': material.reflection: expected either reflection or permittivity, got both",
    ),
    (BALL + 'material = { permittivity = "conrete" }', "body[0] 'ball': material.permittivity: no material 'conrete'"),
    (BALL + "material = { albedo = 0.1, roughness = 1e-4 }", "body[0] 'ball': material.roughness: expected "),
    (BALL + "material = { permittivity = [2, 0], albedo = 0.1 }", "body[0] 'ball': material.albedo: expected none"),
    (BALL + 'material = "fellt"\n[[material]]\nname = "felt"\nalbedo = 0.5', "body[0] 'ball': material: no material"),
    ('[[material]]\nname = "wood"\nalbedo = 0.5', "material[0] 'wood': name: expected a name of its own, got that"),
    (2 * '[[material]]\nname = "felt"\nalbedo = 0.5\n', "material[1] 'felt': name: expected a name of its own"),
    (
        "[sensor]\npose = { rpy_deg = [0, 0, 0], look_at = [1, 0, 0] }",
        "sensor: pose.look_at: expected one of rpy_deg, wxyz, xyzw and look_at, got also rpy_deg",
    ),
    (
        BALL + 'motion = { kind = "trajectory", times = [0, 1], poses = [{}, {}] }',
        "body[0] 'ball': pose: expected none together with a trajectory, which has its own poses",
    ),
    (f"[[arm]]\n{NO_ANGLES}", "arm[0] 'arm': joints.angles_deg: expected 6 values (shoulder_pan_joint, shoulder_"),
    ("[[human]]\nspeed = 30\npath = [[3, 0], [5, 0]]", "human[0] 'human': speed: expected at most 2.78 m/s"),
    ("[[human]]\nbreathing = 15\npath = [[3, 0], [5, 0]]", "human[0] 'human': breathing: expected at most 2 breaths"),
    ("[run]\nstop = -1", "run: stop: expected a time after start 0 s, got -1 s"),
    ("[run]\nfield_of_view_deg = [190, 60]", "run: field_of_view_deg: expected angles between 0 and 180 degrees"),
    ("[sensor]\nalong_z = 0.05", "sensor: along_z: expected attached_to as well"),
    (BALL + '[sensor]\nalong_z = 0\nattached_to = "ball"\npose = {}', "sensor: along_z: expected it alone"),
    (shaped('{ kind = "sphere", radius = 2.0, subdivisions = 2 }'), NEAR),
    (
        '[[body]]\nname = "ball"\nshape = { kind = "sphere", radius = 0.3 }',
        "sensor: pose: expected the antennas outside of every body smaller than 2 m when the run begins, got them "
        "inside 'ball'",
    ),
    (ARM + '[sensor]\nattached_to = "arm/tool0"\nalong_z = 0', NEAR),
]

RADAR_FAULTS = [
    (radar("start_frequency = 60", without="start"), "radar: start_frequency: expected 1e8 to 3e12 [Hz] (60 GHz"),
    ('[radar]\npreset = "bgt60"', "radar: preset: expected 'bgt60tr13c' or 'bgt60tr24', got 'bgt60'"),
    ("[run]\nstop = 1", "radar: expected a value, got none"),
    (radar("", without="num_samples"), "radar: num_samples: expected a value, or a preset, got none"),
    (radar("", without="stop"), "radar: slope: expected either slope or stop_frequency, got none"),
    (radar(STEERED + "[0], azimuth_deg = 1 }"), "radar: schedule.phases_deg: expected either phases or angles of"),
    (radar(STEERED + "[[0], [0, 1]] }"), "radar: schedule.phases_deg: expected equally many per chirp, got [[0.0], "),
    (radar("sequences = [{ delay = 1, num_chirps = 0 }]"), "radar: sequences[0].num_chirps: expected at least 1"),
    (radar("max_range = 8"), "radar: stop_frequency: expected none beside requirements, which decide it, got 61"),
    (radar('polarization = "circular"'), "radar: polarization: expected 'vertical' or 'horizontal' or a list"),
    (radar("slope = 1e12"), "radar: slope: expected either slope or stop_frequency, got both"),
    (radar("num_samples = 64.0", without="num_samples"), "radar: num_samples: expected an integer, got 64.0"),
    (radar("pattern.beamwidth_azimuth_deg = 30"), "radar: pattern.beamwidth_elevation_deg: expected both beam widths"),
    (radar(f"pattern = {{ {BOTH_ENDS} }}"), "radar: pattern.gain_db: expected a list, as all three keys"),
    (radar(f'pattern = {{ {BOTH_ENDS}, gain_db = [[0, "x"]] }}'), "radar: pattern.gain_db[0][1]: expected a number"),
    (
        radar(f"pattern = {{ {BOTH_ENDS}, gain_db = [[0, 0], [0, 0]], beamwidth_azimuth_deg = 3 }}"),
        "radar: pattern.azimuth_deg: expected either a table or beam widths, got both",
    ),
    (radar('pattern = { path = "horn.csv", gain_db = 3 }'), "radar: pattern.path: expected it alone, got gain_db"),
    (radar("receiver.noise_figure_db = -1"), "radar: receiver.noise_figure_db: expected zero or a positive number"),
    (radar("receiver.leakage.level_db = [-40, 1]"), "radar: receiver.leakage.level_db[1]: expected at most 0 [dB]"),
    (radar("rx = [[0, 0]]"), "radar: rx[0][2]: expected a value [m], got none"),
    ("[radar]\npreset = bgt60", "not TOML: Invalid value (at line 2, column 10)"),
]


@pytest.mark.parametrize(("text", "message"), FAULTS)
def test_fault_is_one_line_that_names_it(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "part.obj").write_text(PARTS, encoding="utf-8")
    (tmp_path / "broken.obj").write_text("v 0 0 x\n")
    check_fault(write(tmp_path, text), message)


@pytest.mark.parametrize(("text", "message"), RADAR_FAULTS)
def test_radar_fault_is_one_line_that_names_it(tmp_path: Path, text: str, message: str) -> None:
    check_fault(write(tmp_path, "", radar=text), message)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (shaped(MESH), "body[0] 'a': path: expected a mesh file, got none at {}/part.obj"),
        (
            shaped(MESH.replace("t.", r"t\u0000\u001b.")),
            r"body[0] 'a': path: expected a mesh file, got none at {}/part\x00",
        ),
        (f'[[arm]]\nmodel = "x.urdf"\n{NO_ANGLES}', "arm[0] 'arm': model: "),
    ],
)
def test_missing_file_is_named_with_its_body(tmp_path: Path, text: str, message: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(FileNotFoundError) as caught:
        rc.load_scene(path)
    assert str(caught.value).startswith(f"{path}: {message.format(tmp_path)}")
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


def test_several_faults_are_one_line_each(tmp_path: Path) -> None:
    path = write(tmp_path, '[run]\nstopp = 1\nrate = "fast"\n')
    with pytest.raises(ValueError, match="stopp") as caught:
        rc.load_scene(path)
    assert str(caught.value).splitlines() == [
        f"{path}: run: rate: expected a number [Hz], got 'fast'",
        f"{path}: run: unknown key 'stopp'; did you mean 'stop'?",
    ]


def test_control_characters_of_a_file_are_escaped_in_messages(tmp_path: Path) -> None:
    text = '[[material]]\nname = "a\\u0000\\u001b"\n' + BALL + 'material = "b"\n'
    with pytest.raises(ValueError, match=r"known: a\\x00\\x1b, perfect_conductor"):
        rc.load_scene(write(tmp_path, text))
