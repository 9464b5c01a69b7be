"""The commands as a user runs them: what they write and print, and how they fail."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import radarcore as rc
from radarcore.cli import plot
from radarcore.cli.main import main
from scene_files import APPROACHING

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
COMMAND = [sys.executable, "-m", "radarcore"]


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True, check=False, timeout=300)


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(APPROACHING)
    return path


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("recorded")
    (directory / "scene.toml").write_text(APPROACHING)
    rc.load_scene(directory / "scene.toml").record(directory / "recording", progress=False)
    return directory / "recording"


# --- simulate


def test_simulate_writes_the_recording_and_is_quiet_when_not_in_a_terminal(scene: Path, tmp_path: Path) -> None:
    done = run("simulate", scene, "-o", tmp_path / "new" / "recording", "--threads", "1")
    assert (done.returncode, done.stderr) == (0, "")
    assert "3 frames of 3 x 8 x 128 samples" in done.stdout
    assert len(done.stdout.splitlines()) == 1
    recording = rc.Recording.load(tmp_path / "new" / "recording")
    assert np.array_equal(recording.cube, rc.load_scene(scene).record(progress=False).cube)


def test_simulate_prints_json(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", str(scene), "-o", str(tmp_path / "recording"), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["frames"] == 3
    assert summary["cube_shape"] == [3, 3, 8, 128]
    assert summary["seconds"] > 0.0
    assert summary["real_time_factor"] == pytest.approx(0.3 / summary["seconds"])


def test_simulate_replaces_a_recording_only_when_told_to(scene: Path, tmp_path: Path) -> None:
    arguments = ["simulate", str(scene), "-o", str(tmp_path / "recording")]
    assert main(arguments) == 0
    before = (tmp_path / "recording" / "cube.npy").stat().st_mtime_ns
    assert main(arguments) == 1
    assert (tmp_path / "recording" / "cube.npy").stat().st_mtime_ns == before
    assert main([*arguments, "--overwrite"]) == 0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("radius = 0.1", "radius = -0.1", "body[0] 'ball': radius: expected a positive number [m], got -0.1"),
        ("radius = 0.1", 'radius = "10 cm"', "body[0] 'ball': radius: expected a number [m], got '10 cm'"),
        ("radius =", "raduis =", "body[0] 'ball': shape: unknown key 'raduis'; did you mean 'radius'?"),
        ("rate = 10.0", "rate = -1", "run: rate: expected a positive number [Hz], got -1.0"),
        ("stop_frequency = 60e9", "stop_frequency = 60", "radar: stop_frequency: expected 1e8 to 3e12 [Hz]"),
        ("1.5, 0.0, 0.0", "0.1, 0.0, 0.0", "sensor: pose: expected all antennas at least 1 mm from every surface"),
    ],
)
def test_a_fault_is_reported_in_one_line_and_nothing_is_written(
    tmp_path: Path, scene: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, message: str
) -> None:
    scene.write_text(APPROACHING.replace(old, new))
    assert main(["simulate", str(scene), "-o", str(tmp_path / "new" / "recording")]) == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    assert len(printed.err.splitlines()) == 1, printed.err
    assert printed.err.startswith(f"radarcore: {scene}: {message}"), printed.err
    assert list(tmp_path.iterdir()) == [scene]


def test_missing_mesh_and_missing_scene_are_one_line(
    tmp_path: Path, scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene.write_text(APPROACHING.replace('kind = "sphere", radius = 0.1', 'kind = "mesh", path = "part.obj"'))
    assert main(["simulate", str(scene), "-o", str(tmp_path / "recording")]) == 1
    fault = f"radarcore: {scene}: body[0] 'ball': path: expected a mesh file, got none at {tmp_path / 'part.obj'}\n"
    assert capsys.readouterr().err == fault
    assert main(["simulate", str(tmp_path / "none.toml"), "-o", str(tmp_path / "recording")]) == 1
    assert capsys.readouterr() == ("", f"radarcore: {tmp_path / 'none.toml'}: No such file or directory\n")
    assert not (tmp_path / "recording").exists()


def test_bad_options_write_nothing(tmp_path: Path, scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", str(scene), "-o", str(tmp_path / "recording"), "--threads", "0"]) == 1
    assert capsys.readouterr().err.startswith("radarcore: threads: expected at least 1")
    assert main(["simulate", str(scene), "-o", str(tmp_path / "recording.npz")]) == 1
    assert list(tmp_path.iterdir()) == [scene]


def test_interrupt_leaves_a_readable_recording(tmp_path: Path, scene: Path) -> None:
    scene.write_text(APPROACHING.replace("stop = 0.3", "stop = 1000.0").replace("-0.5, 0.0", "0.0, 0.0"))
    output = tmp_path / "recording"
    # A background job of a shell ignores interrupts by default.
    program = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "from radarcore.cli.main import main; sys.exit(main())"
    )
    command = [sys.executable, "-c", program, "simulate", str(scene), "-o", str(output)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    row = 3 * 8 * 128 * 4  # bytes of a frame
    deadline = time.monotonic() + 60.0
    while not ((cube := output / "cube.npy").exists() and cube.stat().st_size > 3 * row):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert errors == "radarcore: interrupted; what was written so far is readable\n"
    with pytest.warns(UserWarning, match="of 10000 planned frames"):
        recording = rc.Recording.load(output)
    assert len(recording) >= 2
    assert recording.cube.any(axis=(1, 2, 3)).all()


# --- plot


@pytest.mark.parametrize("kind", plot.KINDS)
def test_every_picture_of_a_scene(scene: Path, tmp_path: Path, kind: str) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    picture = tmp_path / "new" / f"{kind}.png"
    assert main(["plot", str(scene), "-o", str(picture), "--kind", kind]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")


# One of each way from a recording to a picture; `test_pictures_of_a_sub_sequence_take_what_can_be_chosen_of_them` draws
# them all.
@pytest.mark.parametrize("kind", ["overview", "chirp", "map", "range-time"])
def test_last_frame_of_a_recording_is_drawn(recording: Path, tmp_path: Path, kind: str) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    picture = tmp_path / f"{kind}.png"
    assert main(["plot", str(recording), "-o", str(picture), "--kind", kind, "--frame", "-1"]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.fixture(scope="module")
def of_two_sequences(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A scene of a radar with two sub-sequences, and its recording."""
    directory = tmp_path_factory.mktemp("sequences")
    radar = 'preset = "bgt60tr24"\nnum_chirps = 8\nalternating = true\nschedule = { kind = "tdm" }\nslope = 20e12\n'
    text = APPROACHING.replace('preset = "bgt60tr13c"\nstop_frequency = 60e9\nnum_chirps = 8\n', radar)
    (directory / "scene.toml").write_text(text)
    rc.load_scene(directory / "scene.toml").record(directory / "recording", progress=False)
    return {"scene": directory / "scene.toml", "recording": directory / "recording"}


# One of each way from a file to a picture.
@pytest.mark.parametrize(
    ("source", "kind"),
    [("recording", "chirp"), ("scene", "chirp"), ("scene", "spectrogram"), ("scene", "experiment")],
)
def test_sub_sequence_is_the_one_that_was_chosen(
    of_two_sequences: dict[str, Path], tmp_path: Path, source: str, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    picture = tmp_path / "picture.png"
    arguments = [
        "plot",
        str(of_two_sequences[source]),
        "-o",
        str(picture),
        "--overwrite",
        "--kind",
        kind,
        *chosen(kind),
    ]
    assert main([*arguments, "--sequence", "1"]) == 0
    if kind == "chirp":
        second = picture.read_bytes()
        assert main(arguments) == 0
        assert picture.read_bytes() != second
    assert main([*arguments, "--sequence", "2"]) == 1
    assert "sequence: expected an index below 2, got 2" in capsys.readouterr().err


def test_help_names_every_picture(capsys: pytest.CaptureFixture[str]) -> None:
    main(["plot", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert all(kind in text for kind in plot.KINDS)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--kind", "depth"], "expected a scene file for a picture of kind 'depth', got a recording"),
        (["--frame", "3"], "frame: expected an index below 3, got 3"),
        (
            ["--kind", "chirp", "--max-range", "3"],
            "max_range: expected a picture of kind overview, range-profile, map,",
        ),
        (["--kind", "map", "--channel", "3"], "channel: expected an index below 3, got 3"),
        (["-o", "picture.txt"], "picture.txt: expected a picture (.png, .pdf, .svg, .jpg), got suffix '.txt'"),
    ],
)
def test_plot_says_what_is_wrong(
    recording: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    message: str,
) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    monkeypatch.chdir(tmp_path)
    assert main(["plot", str(recording), "-o", "picture.png", *arguments]) == 1
    captured = capsys.readouterr()
    assert message in captured.err
    assert len(captured.err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def chosen(kind: str) -> list[str]:
    """All that can be chosen of a picture."""
    values = {"channel": ["1"], "min_range": ["0.5"], "max_range": ["2.5"], "max_velocity": ["1"], "remove_static": []}
    return [word for name in plot.VIEWS[kind] for word in (f"--{name.replace('_', '-')}", *values[name])]


# The experiment with its options is above. At 80 GHz the receivers of a BGT60 have a spacing of 0.7 wavelengths.
@pytest.mark.filterwarnings("ignore:radar. expected a channel spacing below")
@pytest.mark.parametrize("kind", [kind for kind in plot.VIEWS if kind != "experiment"])
def test_pictures_of_a_sub_sequence_take_what_can_be_chosen_of_them(
    of_two_sequences: dict[str, Path], tmp_path: Path, kind: str
) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    picture = tmp_path / "picture.png"
    arguments = [
        "plot",
        str(of_two_sequences["recording"]),
        "-o",
        str(picture),
        "--overwrite",
        "--kind",
        kind,
        *chosen(kind),
    ]
    assert main([*arguments, "--sequence", "1"]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_bare_samples_are_drawn_and_described_with_the_radar_of_a_file(
    scene: Path, recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    np.save(tmp_path / "bare.npy", np.load(recording / "cube.npy"))
    picture = tmp_path / "picture.png"
    for config in (scene, recording / "meta.json"):
        arguments = ["-o", str(picture), "--overwrite", "--kind", "map", "--config", str(config)]
        assert main(["plot", str(tmp_path / "bare.npy"), *arguments]) == 0
    capsys.readouterr()
    assert main(["info", str(tmp_path / "bare.npy"), "--config", str(scene), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["cube [frame, channel, chirp, sample]"] == list(np.load(recording / "cube.npy").shape)
    assert main(["plot", str(tmp_path / "bare.npy"), "-o", str(tmp_path / "other.png")]) == 1
    assert (
        "bare.npy: expected the radar's settings, got an array (3, 3, 8, 128) of float32 without any"
        in capsys.readouterr().err
    )


# --- info, schema


def test_info_of_a_scene_and_of_its_recording_agree_on_the_radar(
    scene: Path, recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    facts = []
    for source in (scene, recording):
        assert main(["info", str(source), "--json"]) == 0
        facts.append(json.loads(capsys.readouterr().out))
    of_scene, of_recording = facts
    assert of_scene["bodies"] == of_recording["bodies"] == ["ball"]
    assert of_scene["frames"] == of_recording["frames"] == 3
    assert of_recording["cube [frame, channel, chirp, sample]"] == [3, 3, 8, 128]
    waveform = rc.load_scene(scene).radar.waveform
    for one in facts:
        assert one["range bin [m]"] == waveform.range_resolution
        assert one["samples"] == "real"
        assert one["antenna pattern"] == "Gaussian, 3.5 dBi, 65 x 40 degrees"


def test_info_is_one_fact_per_line(scene: Path, recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for source in (scene, recording):
        assert main(["info", str(source)]) == 0
        printed = capsys.readouterr()
        assert printed.err == ""
        assert "ball" in printed.out
        lines = dict(line.split("  ", 1) for line in printed.out.splitlines())
        waveform = rc.load_scene(scene).radar.waveform
        assert lines["range bin"].strip() == f"{1e2 * waveform.range_resolution:.6g} cm"
        assert lines["sample rate"].strip() == "2 MHz"


def test_info_of_a_scene_that_varies_lists_what_does(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(
        """
radar.preset = "bgt60tr13c"
[[body]]
shape = { kind = "box", size = [0.2, 0.2, 0.2] }
material = { choice = ["metal", "wood"] }
repeat = 2
pose = { position = [{ uniform = [1.5, 2.5] }, 0.0, 0.0] }
"""
    )
    assert main(["info", str(scene), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["bodies"] == ["body 0 0", "body 0 1"]
    assert facts["varies"]["body.body 0 1.material"] == "choice metal, wood"
    assert facts["varies"]["body.body 0 0.pose.position[0]"] == "uniform 1.5, 2.5 [m]"
    assert main(["info", str(scene)]) == 0
    assert "  body.body 0 0.material  choice metal, wood\n" in capsys.readouterr().out
    # Where a sample is needed, all lines say so.
    scene.write_text(scene.read_text().replace("repeat = 2\n", ""))
    assert main(["simulate", str(scene), "-o", str(tmp_path / "rec")]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert all(line.endswith("got a distribution, which radarcore.dataset.Variation draws from") for line in lines)


def test_error_for_a_recording_in_place_of_a_scene_names_its_uses(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rc.Recording.load(recording).save(tmp_path / "rec.npz")
    for source, got in ((recording, "a folder"), (tmp_path / "rec.npz", "an .npz file")):
        assert main(["simulate", str(source), "-o", str(tmp_path / "out")]) == 1
        message = f"expected a scene file (TOML), got {got}; load_radar and --radar read the radar of a recording"
        assert message in capsys.readouterr().err
        assert rc.load_radar(source) == rc.Recording.load(recording).radar


def test_info_of_what_is_neither(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(tmp_path)]) == 1
    assert "expected a recording" in capsys.readouterr().err
    assert main(["info", str(tmp_path / "none")]) == 1
    assert "no such recording" in capsys.readouterr().err


def test_schema_is_text_or_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    assert "body[].shape.radius" in capsys.readouterr().out
    assert main(["schema", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {"radar", "sensor", "run", "material", "body", "point", "human", "arm", "interferer"} == set(
        found["properties"]
    )


def test_reader_that_leaves_early_is_no_error() -> None:
    done = subprocess.run(
        f"'{sys.executable}' -m radarcore schema | head -n 1", shell=True, capture_output=True, text=True, check=False
    )
    assert done.stderr == ""
    assert len(done.stdout.splitlines()) == 1
