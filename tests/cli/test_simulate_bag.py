"""`radarcore simulate --bag`: a recorded bag in, a radar recording out, with ranges and velocities known on paper."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("rosbags", reason="needs the extra `ros`: pip install radarcore[ros]")

import radarcore as rc
from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.poses import to_pose_stamped, to_transforms
from radarcore.cli.main import main
from ros_bags import BAGS, START_NS, header_of

ROWS, COLUMNS, FOCAL = 48, 64, 60.0
DISTANCE, RADIUS, SPEED = 1.5, 0.2, 0.8
"""Of a ball in front of the camera that comes closer."""
EVERY_NS = 25_000_000
NUM_IMAGES = 6

RADAR = """
[radar]
preset = "bgt60tr13c"
num_chirps = 32
frame_interval = 0.025
"""


def depth_of(center: float) -> NDArray[np.float32]:
    """Depth along the optical axis of a ball on it; infinite beside it (REP 117)."""
    v, u = ((np.arange(n) - (n - 1) / 2) / FOCAL for n in (ROWS, COLUMNS))
    a = 1.0 + u[None, :] ** 2 + v[:, None] ** 2
    root = center**2 - a * (center**2 - RADIUS**2)
    return np.where(root > 0.0, (center - np.sqrt(np.maximum(root, 0.0))) / a, np.inf).astype(np.float32)


def image_of(time_ns: int, pixels: NDArray[Any], encoding: str = "32FC1") -> dict[str, Any]:
    return {
        "header": header_of(time_ns, "camera_depth_optical_frame"),
        "height": ROWS,
        "width": COLUMNS,
        "encoding": encoding,
        "is_bigendian": 0,
        "step": pixels.itemsize * COLUMNS,
        "data": np.ascontiguousarray(pixels).view(np.uint8),
    }


def info_of(time_ns: int) -> dict[str, Any]:
    k = np.array([FOCAL, 0.0, (COLUMNS - 1) / 2, 0.0, FOCAL, (ROWS - 1) / 2, 0.0, 0.0, 1.0])
    window = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
    info = {"header": header_of(time_ns), "height": ROWS, "width": COLUMNS, "distortion_model": "plumb_bob"}
    r, p = np.eye(3).ravel(), np.zeros(12)
    info |= {"d": np.zeros(5), "k": k, "r": r, "p": p, "binning_x": 0, "binning_y": 0, "roi": window}
    return info | {name.upper(): info[name] for name in "dkrp"}  # large letters in ROS 1


def write_depth(path: Path, kind: str = "mcap", numbers: Any = range(NUM_IMAGES)) -> Path:
    with BagWriter(path, kind) as bag:
        bag.write("/camera/depth/camera_info", info_of(START_NS), START_NS, type="sensor_msgs/msg/CameraInfo")
        for k in numbers:
            stamp = START_NS + k * EVERY_NS
            image = image_of(stamp, depth_of(DISTANCE - SPEED * 1e-9 * k * EVERY_NS))
            bag.write("/camera/depth/image_raw", image, stamp + 4_000_000, type="sensor_msgs/msg/Image")
            color = image_of(stamp, np.zeros((ROWS, COLUMNS), np.uint8), "mono8")
            bag.write("/camera/color/image_raw", color, stamp, type="sensor_msgs/msg/Image")
    return path


@pytest.fixture
def radar(tmp_path: Path) -> Path:
    path = tmp_path / "radar.toml"
    path.write_text(RADAR)
    return path


def peak_of(frame: rc.Frame) -> tuple[float, float]:
    """Range at the middle of the frame and velocity of the strongest echo, between bins."""
    peak = rc.strongest_peak(frame)
    assert peak is not None
    return peak.range, peak.velocity


@pytest.mark.parametrize("kind", BAGS)
def test_depth_images_become_frames_with_the_range_and_velocity_of_the_ball(
    tmp_path: Path, radar: Path, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = write_depth(tmp_path / BAGS[kind], kind)
    output = tmp_path / "recording"
    assert main(["simulate", "--bag", str(bag), "--radar", str(radar), "-o", str(output), "--json"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["frames"] == NUM_IMAGES - 1  # a velocity needs two images
    assert printed.err == ""
    recording = rc.Recording.load(output)
    # The frame interval is that of the images, so every frame has an image of its own.
    np.testing.assert_allclose(recording.time, [0.025 * k for k in range(1, NUM_IMAGES)], atol=1e-12)
    wf = recording.radar.waveform
    middle = 0.5 * wf.chirp_times[-1]
    for frame in recording.frames():
        distance, velocity = peak_of(frame)
        nearest = DISTANCE - RADIUS - SPEED * (frame.time + middle)
        assert abs(distance - nearest) < 0.1 * wf.range_resolution
        assert abs(velocity + SPEED) < 0.1 * wf.velocity_resolution
    assert recording.source["bag"] == {"path": str(bag), "start_ns": START_NS, "topic": "/camera/depth/image_raw"}


@pytest.mark.filterwarnings("default")  # the command prints them
def test_frames_without_images_are_left_out_and_counted(
    tmp_path: Path, radar: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of images 0 ... 3 and 23 ... 25, with 0.5 s between them, frames need two that are at most 0.2 s old."""
    bag = write_depth(tmp_path / "bag", numbers=[0, 1, 2, 3, 23, 24, 25])
    output = tmp_path / "recording"
    assert main(["simulate", "--bag", str(bag), "--radar", str(radar), "-o", str(output)]) == 0
    assert "frames left out: no two depth images within 0.2 s" in capsys.readouterr().err
    recording = rc.Recording.load(output)
    assert recording.lost is not None
    gaps = np.rint(np.diff(recording.time, prepend=0.0) / 0.025).astype(int) - 1
    np.testing.assert_array_equal(recording.lost, gaps)
    assert recording.time[-1] == pytest.approx(0.625)
    # Images 3 and 24 hold for 0.2 s, 23 has none before it.
    assert sorted(np.rint(recording.time / 0.025).astype(int)) == [*range(1, 12), 24, 25]


def test_another_rate_takes_the_newest_image(tmp_path: Path, radar: Path) -> None:
    bag, output = write_depth(tmp_path / "bag"), tmp_path / "recording"
    options = ["--rate", "80", "--field-of-view", "56.145", "43.603", "--depth-topic", "camera/depth/image_raw"]
    assert main(["simulate", "--bag", str(bag), "--radar", str(radar), "-o", str(output), *options]) == 0
    recording = rc.Recording.load(output)
    np.testing.assert_allclose(recording.time, 0.025 + np.arange(9) / 80.0, atol=1e-12)
    # Pixels go on at their range rate between two images: ranges fall steadily.
    wf = recording.radar.waveform
    for frame in recording.frames():
        nearest = DISTANCE - RADIUS - SPEED * (frame.time + 0.5 * wf.chirp_times[-1])
        assert abs(peak_of(frame)[0] - nearest) < 0.1 * wf.range_resolution


MOVING = """
[sensor]
motion = { kind = "bag", topic = "/robot/pose" }

[[body]]
name = "ball"
shape = { kind = "sphere", radius = 0.1 }
motion = { kind = "bag", frame = "ball", within = "world" }

[run]
rate = 20
resolution = 96
"""


def test_poses_of_a_bag_move_the_bodies_and_the_sensor_of_a_scene(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The ball comes at 0.6 m/s, the radar goes towards it at 0.3 m/s."""
    bag, scene, output = tmp_path / "bag", tmp_path / "scene.toml", tmp_path / "recording"
    with BagWriter(bag) as written:
        types = written.types
        for k in range(21):
            stamp, t = START_NS + k * EVERY_NS, 0.025 * k
            moved = {"ball": rc.Pose([2.0 - 0.6 * t, 0.0, 1.0])}
            written.write("/tf", to_transforms(moved, time_ns=stamp, types=types), stamp)
            robot = to_pose_stamped(rc.Pose([0.3 * t, 0.0, 1.0]), time_ns=stamp + 7, types=types)
            written.write("/robot/pose", robot, stamp)
    scene.write_text(RADAR + MOVING)
    assert main(["simulate", "--bag", str(bag), str(scene), "-o", str(output)]) == 0
    out, err = capsys.readouterr()
    assert out.startswith(f"{output}: 10 frames of ")
    assert err == ""
    recording = rc.Recording.load(output)
    np.testing.assert_allclose(recording.time, 7e-9 + 0.05 * np.arange(10), atol=1e-12)
    wf = recording.radar.waveform
    assert recording.truth is not None
    for frame in recording.frames():
        at_middle = frame.time + 0.5 * wf.chirp_times[-1]
        distance, velocity = peak_of(frame)
        assert abs(distance - (1.9 - 0.9 * at_middle)) < 0.1 * wf.range_resolution
        assert abs(velocity + 0.9) < 0.1 * wf.velocity_resolution
        assert frame.truth is not None
        assert frame.truth.velocity[0] == pytest.approx(-0.9, abs=1e-5)  # the nearest point that a ray hit
        assert frame.truth.range[0] == pytest.approx(1.9 - 0.9 * at_middle, abs=2e-4)
    assert recording.source["bag"] == {"path": str(bag), "start_ns": START_NS}


# --- Bad input


def fault(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    assert main(["simulate", *map(str, arguments)]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    return lines[0].removeprefix("radarcore: ")


def test_wrong_topics_name_those_that_there_are(
    tmp_path: Path, radar: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag, output = write_depth(tmp_path / "bag"), tmp_path / "recording"
    given = ["--bag", bag, "--radar", radar, "-o", output]
    line = fault(capsys, *given, "--depth-topic", "/camera/dept/image_raw")
    assert line.startswith(f"--depth-topic: no topic '/camera/dept/image_raw' in {bag}; did you mean '/camera/depth/im")
    assert "/camera/color/image_raw (sensor_msgs/msg/Image), /camera/depth/image_raw" in line
    line = fault(capsys, *given, "--depth-topic", "/camera/color/image_raw")
    assert line == "--depth-topic: expected depth images, 32FC1 or 16UC1, got mono8 of '/camera/color/image_raw'"
    line = fault(capsys, *given, "--info-topic", "/camera/color/image_raw")
    assert line.startswith("--info-topic: expected sensor_msgs/msg/CameraInfo, got sensor_msgs/msg/Image of '/camera/c")
    assert not output.exists()


def test_a_bag_without_depth_says_what_it_has(tmp_path: Path, radar: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag, output = tmp_path / "bag", tmp_path / "recording"
    given = ["--bag", bag, "--radar", radar, "-o", output]
    with BagWriter(bag) as written:
        written.write("/pose", to_pose_stamped(rc.Pose(), time_ns=1, types=written.types), 1)
    line = fault(capsys, *given)
    assert line == (
        f"--depth-topic: expected a topic of sensor_msgs/msg/Image in {bag}, got none; "
        "there are /pose (geometry_msgs/msg/PoseStamped)"
    )
    with BagWriter(bag, overwrite=True) as written:
        color = image_of(1, np.zeros((ROWS, COLUMNS), np.uint8), "mono8")
        written.write("/color", color, 1, type="sensor_msgs/msg/Image")
    line = fault(capsys, *given)
    assert line.endswith(f"expected depth images, 32FC1 or 16UC1, in {bag}, got none; there are /color (mono8)")
    with BagWriter(bag, overwrite=True) as written:
        info = info_of(1) | {"width": 2 * COLUMNS}
        written.write("/depth/camera_info", info, 1, type="sensor_msgs/msg/CameraInfo")
        image = image_of(1, depth_of(DISTANCE))
        written.write("/depth/image", image, 1, type="sensor_msgs/msg/Image")
    line = fault(capsys, *given)
    assert line.startswith(
        f"--info-topic: expected that of images of {COLUMNS} x {ROWS} pixels, got one of {2 * COLUMNS}"
    )
    write_depth(tmp_path / "short", numbers=[0])
    line = fault(capsys, "--bag", tmp_path / "short", *given[2:])
    assert line.endswith("short: expected at least two depth images on /camera/depth/image_raw, got 1")
    assert not output.exists()


def test_options_that_do_not_go_together_are_refused(
    tmp_path: Path, radar: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "recording"
    assert fault(capsys, "-o", output) == (
        "scene: expected a scene file, or --bag with --radar for its depth images, got none"
    )
    assert fault(capsys, "-o", output, radar, "--rate", 3) == "--rate: expected --bag as well, got none"
    assert fault(capsys, "-o", output, radar, "--bag", "x", "--radar", radar).startswith(
        "--radar: expected none with a"
    )
    assert fault(capsys, "-o", output, "--bag", tmp_path / "x", radar) == f"{tmp_path / 'x'}: no such bag"


@pytest.mark.filterwarnings("default")  # the command prints them
def test_a_cut_bag_is_simulated_up_to_the_cut(tmp_path: Path, radar: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag, output = write_depth(tmp_path / "take.mcap", numbers=range(10)), tmp_path / "recording"
    bag.write_bytes(bag.read_bytes()[: int(0.6 * bag.stat().st_size)])
    assert main(["simulate", "--bag", str(bag), "--radar", str(radar), "-o", str(output)]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith(f"radarcore: warning: {bag}: a bag that is cut or damaged: ")
    assert len(rc.Recording.load(output)) in (4, 5)


@pytest.mark.filterwarnings("default")
def test_whole_millimetres_are_warned_of_once(tmp_path: Path, radar: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag, output = tmp_path / "bag", tmp_path / "recording"
    with BagWriter(bag) as written:
        written.write("/depth/camera_info", info_of(START_NS), START_NS, type="sensor_msgs/msg/CameraInfo")
        for k in range(NUM_IMAGES):
            metres = np.nan_to_num(depth_of(DISTANCE - SPEED * 0.025 * k), posinf=0.0)
            image = image_of(START_NS + k * EVERY_NS, np.rint(1000.0 * metres).astype(np.uint16), "16UC1")
            written.write("/depth/image", image, START_NS + k * EVERY_NS, type="sensor_msgs/msg/Image")
    assert main(["simulate", "--bag", str(bag), "--radar", str(radar), "-o", str(output)]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert sum("16UC1 has whole millimetres" in line for line in lines) == 1
    kinds = [re.sub(r"[\d.]+", "", line) for line in lines]
    assert sorted(set(kinds)) == sorted(kinds)


# --- info


def test_info_lists_topics(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = write_depth(tmp_path / "take.bag", "ros1")
    assert main(["info", str(bag)]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["/camera/depth/image_raw", "6", "sensor_msgs/msg/Image"] in lines
    assert ["start", "2023-11-14T22:13:20+00:00"] in lines
    assert main(["info", str(bag), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["topics"]["/camera/depth/camera_info"] == "1 sensor_msgs/msg/CameraInfo"
    assert (facts["ROS"], facts["messages"], facts["start [ns]"]) == (1, 13, START_NS)


# --- The page


def test_commands_of_the_page_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "bags.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```(\w+)\n(.*?)^```", page, flags=re.DOTALL | re.MULTILINE)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for kind, text in blocks:
        if 'BagWriter("take")' in text or 'BagWriter("depth.mcap")' in text:
            exec(text.partition("\nwith ros.BagReader")[0], names)
        elif kind == "toml":
            Path("scene.toml").write_text(text, encoding="utf-8")
    lines = [line.split() for kind, text in blocks if kind == "console" for line in text.splitlines()]
    assert [line[1] for line in lines] == ["info", "simulate", "simulate", "process", "process"]
    for _, *arguments in lines:
        assert main(arguments) == 0, capsys.readouterr().err
    assert capsys.readouterr().err == ""
    assert len(rc.Recording.load("out/take")) == 10
    assert len(rc.Recording.load("out/depth")) == 3


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--reflectance", "-2"], "reflectance: expected numbers from 0 to 1, got -2"),
        (["--max-age", "-1"], "max_age: expected a positive number [s], got -1.0"),
        (["--max-age", "0.001"], "--max-age: expected two depth images within it somewhere, got 0.001 s"),
    ],
)
def test_wrong_options_leave_no_recording_behind(
    tmp_path: Path, radar: Path, options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    bag, output = write_depth(tmp_path / "bag"), tmp_path / "recording"
    assert fault(capsys, "--bag", bag, "--radar", radar, "-o", output, *options) == message
    assert not output.exists()
