"""Frames as messages and in bags: samples, codes, times, truth, lost frames and settings come back to the last bit."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="needs the extra `ros`: pip install radarcore[ros]")

from radarcore.adapters import ros
from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.bags import BagReader
from radarcore.adapters.ros.frames import BagFrames, FrameWriter, from_frame_message, write_frames
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import Waveform
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording
from recordings import CODES, RADAR, SENSOR, assert_same, frame, recording, sensor_frame
from ros_bags import FORMATS, stamp_of

START_NS = 1_700_000_000_000_000_001
RECORDINGS: dict[str, Callable[[], Recording]] = {
    "complex64": recording,
    "complex128": lambda: recording(dtype="complex128"),
    "float32": lambda: recording(dtype="float32"),
    "float64": lambda: recording(dtype="float64", names=None),
    "no bodies": lambda: recording(names=()),
    "codes": lambda: Recording.from_frames([sensor_frame(k, lost_before=3 * k) for k in range(4)], {"board": "BGT60"}),
}


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("name", RECORDINGS)
def test_recordings_come_back_to_the_last_bit(tmp_path: Path, kind: str, name: str) -> None:
    sent = RECORDINGS[name]()
    with BagWriter(tmp_path / "bag", kind) as bag:
        write_frames(bag, sent, start_ns=0 if name == "codes" else START_NS)
    with BagReader(tmp_path / "bag") as read:
        frames = BagFrames(read)
        assert len(frames) == len(sent)
        got = frames.recording()
        stamps = {message.time_ns for message in read.messages("/radar")}
    assert_same(got, sent)
    assert got.cube.tobytes() == sent.cube.tobytes()
    if name == "codes":
        np.testing.assert_array_equal(got.raw, CODES)
        np.testing.assert_array_equal(got.lost, [0, 3, 6, 9])
    else:
        assert stamps == {START_NS + k * 25_000_000 for k in range(3)}


@pytest.mark.parametrize("name", ["codes", "complex64"])
def test_a_second_reader_sees_the_same(tmp_path: Path, name: str) -> None:
    """The definition of the message comes with the file."""
    reader = pytest.importorskip("mcap.reader", reason="needs mcap: pip install radarcore[ros]")
    decoder = pytest.importorskip("mcap_ros2.decoder", reason="needs mcap-ros2-support")
    sent, path = RECORDINGS[name](), tmp_path / "take.mcap"
    with BagWriter(path) as bag:
        write_frames(bag, sent, start_ns=3)
    with path.open("rb") as file:
        messages = reader.make_reader(file, decoder_factories=[decoder.DecoderFactory()]).iter_decoded_messages()
        found = [(message.log_time, decoded) for _, _, message, decoded in messages]
    assert [time for time, _ in found] == [3 + ros.nearest_nanoseconds(time) for time in sent.time]
    assert [decoded.time for _, decoded in found] == sent.time.tolist()
    assert {decoded.dtype for _, decoded in found} == {"uint16" if name == "codes" else "complex64"}
    expected = CODES if name == "codes" else sent.cube
    assert [bytes(decoded.data) for _, decoded in found] == [part.tobytes() for part in expected]
    for (_, decoded), one in zip(found, sent, strict=True):
        again = from_frame_message(decoded)
        assert again.radar == (SENSOR if name == "codes" else RADAR)
        np.testing.assert_array_equal(again.cube, one.cube)


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


def test_several_radars_have_topics_of_their_own(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        write_frames(bag, recording(2), topic="/left")
        write_frames(bag, RECORDINGS["codes"](), topic="/right/radar", start_ns=5)
    with BagReader(tmp_path / "bag") as read:
        assert_same(BagFrames(read, "/left").recording(), recording(2))
        assert_same(BagFrames(read, "/right/radar").recording(), RECORDINGS["codes"]())


def test_bad_frames_and_bags_are_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        with pytest.raises(TypeError, match="source: expected what JSON can hold"):
            FrameWriter(bag, RADAR, source={"a": b""})
        writer = FrameWriter(bag, RADAR)
        writer.append(frame(1))
        with pytest.raises(
            ValueError, match=r"frame\.time: expected at least a nanosecond between frames, got 0\.025 s"
        ):
            writer.append(frame(1))
        with pytest.raises(ValueError, match=r"frame\.time: expected a time after 1970 by start_ns, got -0\.025 s"):
            FrameWriter(bag, RADAR, topic="/other").append(replace(frame(1), time=-0.025))
        point = {"header": {"stamp": stamp_of(1), "frame_id": ""}, "point": dict.fromkeys("xyz", 0.0)}
        bag.write("/point", point, 1, type="geometry_msgs/msg/PointStamped")
    with BagReader(tmp_path / "bag") as read:
        for topic, message in (
            ("/lidar", r"topic: no topic '/lidar' in .*; did you mean|there are /radar "),
            ("/point", "topic: expected radarcore_msgs/msg/RadarFrame, got geometry_msgs/msg/PointStamped of '/point'"),
            ("/other", "expected frames on /other, got none"),
        ):
            with pytest.raises(ValueError, match=message):
                BagFrames(read, topic)
