"""Frames in bags: samples, codes, times, truth, lost frames and settings come back to the last bit."""

from __future__ import annotations

import json
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="needs the extra `ros`: pip install radarcore[ros]")

from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.bags import BagReader
from radarcore.adapters.ros.frames import BagFrames, FrameWriter, from_truth_message, to_truth_message, write_frames
from radarcore.adapters.ros.messages import nearest_nanoseconds
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform
from radarcore.recording.frame import Frame, Truth
from radarcore.recording.recording import Recording
from recordings import CODES, RADAR, SENSOR, assert_same, frame, recording, sensor_frame
from ros_bags import BAGS, cut, stamp_of

START_NS = 1_700_000_000_000_000_001
RECORDINGS: dict[str, Callable[[], Recording]] = {
    "complex64": recording,
    "complex128": lambda: recording(dtype="complex128"),
    "float32": lambda: recording(dtype="float32"),
    "float64": lambda: recording(dtype="float64", names=None),
    "no bodies": lambda: recording(names=()),
    "codes": lambda: Recording.from_frames([sensor_frame(k, lost_before=3 * k) for k in range(4)], {"board": "BGT60"}),
}


@pytest.mark.parametrize(
    ("name", "kind"),
    dict.fromkeys([*((name, "mcap") for name in RECORDINGS), *((n, k) for n in ("complex64", "codes") for k in BAGS)]),
)
def test_recordings_come_back_to_the_last_bit(tmp_path: Path, kind: str, name: str) -> None:
    sent = RECORDINGS[name]()
    path = tmp_path / BAGS[kind]
    with BagWriter(path, kind) as bag:
        write_frames(bag, sent, start_ns=0 if name == "codes" else START_NS)
    with BagReader(path) as read:
        frames = BagFrames(read)
        assert len(frames) == len(sent)
        got = frames.recording()
        stamps = {message.time_ns for message in read.messages("/radar/time")}
    assert_same(got, sent)
    assert got.cube.tobytes() == sent.cube.tobytes()
    if name == "codes":
        np.testing.assert_array_equal(got.raw, CODES)
        np.testing.assert_array_equal(got.lost, [0, 3, 6, 9])
    else:
        assert stamps == {START_NS + k * 25_000_000 for k in range(3)}


def test_codes_are_sent_as_they_are(tmp_path: Path) -> None:
    """Message as a node of ROS sees it: int16 with labels, and JSON that names the radar."""
    with BagWriter(tmp_path / "bag") as bag:
        write_frames(bag, RECORDINGS["codes"]())
    with BagReader(tmp_path / "bag") as read:
        first = next(read.messages("/radar/adc"))
        settings = next(read.messages("/radar/settings"))
    assert first.type == "std_msgs/msg/Int16MultiArray"
    dimensions = [(d.label, d.size, d.stride) for d in first.message.layout.dim]
    assert [label for label, _, _ in dimensions][-3:] == ["channel", "chirp", "sample"]
    assert dimensions[-3:] == [("channel", 3, 192), ("chirp", 4, 64), ("sample", 16, 16)]
    np.testing.assert_array_equal(first.message.data, CODES[0].ravel())
    assert first.time_ns == 1_700_000_000 * 10**9
    assert json.loads(settings.message.data)["radar"] == SENSOR.to_dict()


@pytest.mark.parametrize("name", ["codes", "complex64"])
def test_a_second_reader_sees_the_same(tmp_path: Path, name: str) -> None:
    reader = pytest.importorskip("mcap.reader", reason="needs mcap: pip install mcap mcap-ros2-support")
    decoder = pytest.importorskip("mcap_ros2.decoder", reason="needs mcap-ros2-support")
    sent, path = RECORDINGS[name](), tmp_path / "take.mcap"
    with BagWriter(path) as bag:
        write_frames(bag, sent, start_ns=3)
    found: dict[str, list[tuple[int, object]]] = {}
    with path.open("rb") as file:
        messages = reader.make_reader(file, decoder_factories=[decoder.DecoderFactory()]).iter_decoded_messages()
        for _, channel, message, decoded in messages:
            found.setdefault(channel.topic, []).append((message.log_time, decoded.data))
    times, numbers = ([part[k] for part in found["/radar/time"]] for k in range(2))
    assert times == [3 + nearest_nanoseconds(time) for time in sent.time]
    assert numbers == sent.time.tolist()
    topic = "/radar/adc" if name == "codes" else "/radar/samples"
    expected = CODES.astype(np.int16) if name == "codes" else sent.cube.view(np.float32)
    np.testing.assert_array_equal([data for _, data in found[topic]], expected.reshape(len(sent), -1))
    assert json.loads(str(found["/radar/settings"][0][1]))["radar"] == sent.radar.to_dict()
    if sent.truth is not None:
        rows = np.stack([sent.truth.range, sent.truth.velocity, sent.truth.azimuth, sent.truth.elevation], axis=1)
        np.testing.assert_array_equal([data for _, data in found["/radar/truth"]], rows.reshape(len(sent), -1))


def test_a_recording_on_disk_goes_through_frame_by_frame(tmp_path: Path) -> None:
    recording(5).save(tmp_path / "take")
    with BagWriter(tmp_path / "bag") as bag:
        write_frames(bag, Recording.load(tmp_path / "take"))
    with BagReader(tmp_path / "bag") as read:
        frames = iter(BagFrames(read))
        np.testing.assert_array_equal(next(frames).cube, recording(5).cube[0])
        assert [one.time for one in frames] == [0.025 * k for k in range(1, 5)]


def test_memory_does_not_grow_with_the_bag(tmp_path: Path) -> None:
    """40 MB of samples pass through with a few in memory at a time."""
    waveform = Waveform(start_frequency=60e9, slope=1e12, sample_rate=2e6, num_samples=512, num_chirps=128)
    radar = Radar(waveform, rx=[[0.0, 0.0, 0.0]])
    cube = np.ones((1, 128, 512), np.complex64)
    tracemalloc.start()
    with BagWriter(tmp_path / "bag") as bag:
        writer = FrameWriter(bag, radar)
        for k in range(80):
            writer.append(Frame(cube, 0.025 * k, radar))
    with BagReader(tmp_path / "bag") as read:
        assert sum(1 for _ in BagFrames(read)) == 80
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 12e6  # a chunk that is written, packed and copied


@pytest.mark.parametrize("kind", BAGS)
def test_a_cut_bag_gives_whole_frames_up_to_the_cut(tmp_path: Path, kind: str) -> None:
    path = tmp_path / BAGS[kind]
    rng = np.random.default_rng(0)
    sent = [
        Frame(
            (noise := rng.standard_normal((2, 4, 16))).astype(np.complex64),
            0.025 * k,
            RADAR,
            Truth(("a",), *noise[0, :, :1]),
        )
        for k in range(300)
    ]
    with BagWriter(path, kind) as bag:
        writer = FrameWriter(bag, RADAR)
        for one in sent:
            writer.append(one)
    cut(path, 0.7)
    with pytest.warns(UserWarning, match="cut or damaged") as caught, BagReader(path) as read:
        got = list(BagFrames(read))
    assert sum("cut or damaged" in str(warning.message) for warning in caught) == 1
    assert 150 < len(got) < 240
    for one, whole in zip(got, sent, strict=False):
        assert (one.time, one.cube.tobytes()) == (whole.time, whole.cube.tobytes())
        assert one.truth is not None
        assert whole.truth is not None
        np.testing.assert_array_equal(one.truth.range, whole.truth.range)


def test_several_radars_have_names_of_their_own(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        write_frames(bag, recording(2), topic="/left")
        write_frames(bag, RECORDINGS["codes"](), topic="/right/radar/", start_ns=5)
    with BagReader(tmp_path / "bag") as read:
        assert_same(BagFrames(read, "/left").recording(), recording(2))
        assert_same(BagFrames(read, "/right/radar").recording(), RECORDINGS["codes"]())


def test_frames_without_all_their_messages_are_left_out_with_a_warning(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        write_frames(bag, recording(2))
        bag.write("/radar/time", {"data": 0.01}, 10**7)
    with BagReader(tmp_path / "bag") as read, pytest.warns(UserWarning, match="1 frames of /radar left out: expected"):
        assert len(list(BagFrames(read))) == 2


def test_no_frames_are_a_recording_without_frames(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        FrameWriter(bag, RADAR).close()
    with BagReader(tmp_path / "bag") as read:
        got = BagFrames(read).recording()
    assert (got.cube.shape, got.radar) == ((0, 2, 4, 16), RADAR)


def test_bad_frames_and_bags_are_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        with pytest.raises(ValueError, match="topic: expected a name such as '/radar', got 'radar'"):
            FrameWriter(bag, RADAR, topic="radar")
        with pytest.raises(TypeError, match="source: expected what JSON can hold"):
            FrameWriter(bag, RADAR, source={"a": b""})
        writer = FrameWriter(bag, RADAR)
        writer.append(frame(1))
        with pytest.raises(ValueError, match=r"frame\.time: expected frames at least a nanosecond apart, got 0\.025 s"):
            writer.append(frame(1))
        with pytest.raises(ValueError, match=r"frame\.time: expected a time after 1970 by start_ns, got -0\.025 s"):
            FrameWriter(bag, RADAR, topic="/other").append(replace(frame(1), time=-0.025))
        bag.write(
            "/pose",
            {"header": {"stamp": stamp_of(1), "frame_id": ""}, "point": dict.fromkeys("xyz", 0.0)},
            1,
            type=POINT,
        )
    with (
        BagReader(tmp_path / "bag") as read,
        pytest.raises(ValueError, match=r"topic: no topic '/lidar/settings' in .*; did you mean|there are /radar/"),
    ):
        BagFrames(read, "/lidar")
    with pytest.raises(ValueError, match=r"layout: expected \{'field': 4, 'body': 1\}, got \{'field': 4, 'body': 2\}"):
        from_truth_message(to_truth_message(Truth(("a", "b"), *np.zeros((4, 2)))), ("a",))


POINT = "geometry_msgs/msg/PointStamped"


def test_settings_that_are_no_radar_are_refused(tmp_path: Path) -> None:
    for number, (text, message) in enumerate([("x", "line 1"), ("[]", "radar"), ('{"radar": 1}', "radar")]):
        with BagWriter(tmp_path / str(number)) as bag:
            bag.write("/radar/settings", SimpleNamespace(data=text), 0, type="std_msgs/msg/String")
        with BagReader(tmp_path / str(number)) as read, pytest.raises(ValueError, match=message) as error:
            BagFrames(read)
        assert str(error.value).startswith(f"{tmp_path / str(number)}, /radar/settings")
