"""Recordings written frame by frame: readable after every frame, whole frames however it ends."""

from __future__ import annotations

import itertools
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from full_disk import largest_file
from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.recording.frame import Frame
from radarcore.recording.native import RecordingWriter
from radarcore.recording.recording import Recording
from recordings import FRAME_TIMES, RADAR, SENSOR, assert_same, frame, recording, sensor_frame


def test_recording_is_readable_after_every_frame(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "rec", RADAR, num_frames=3, source={"kind": "test"}) as writer:
        for index in range(4):
            if index < 3:
                with pytest.warns(UserWarning, match=f"rec: {index} of 3 planned frames, its writer was interrupted"):
                    partial = Recording.load(tmp_path / "rec")
                assert len(partial) == index
                if index > 0:
                    assert_same(partial, recording(), index)
                writer.append(frame(index))
            else:
                assert_same(Recording.load(tmp_path / "rec"), recording())
    assert_same(Recording.load(tmp_path / "rec"), recording())


def test_unplanned_number_of_frames_warns_only_until_closed(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "rec", RADAR, source={"kind": "test"})
    writer.append(frame(0))
    with pytest.warns(UserWarning, match=r"rec: 1 frames, its writer was interrupted"):
        Recording.load(tmp_path / "rec")
    writer.close()
    writer.close()
    assert_same(Recording.load(tmp_path / "rec"), recording(1))


APPEND_UNTIL_KILLED = """
import sys
import numpy as np
from radarcore import Frame, Radar, RecordingWriter, Truth, Waveform

waveform = Waveform(start_frequency=60e9, slope=1e14, sample_rate=2e7, num_samples=256, num_chirps=64)
radar = Radar(waveform, rx=np.zeros((4, 3)))
with RecordingWriter(sys.argv[1], radar, num_frames=10**6) as writer:
    print("ready", flush=True)
    for index in range(10**6):
        cube = np.full((4, 64, 256), index, np.complex64)
        writer.append(Frame(cube, float(index), radar, Truth(("arm",), *np.full((4, 1), float(index)))))
        print(index, flush=True)
"""


def test_killed_process_leaves_every_frame_it_had_finished(tmp_path: Path) -> None:
    num_seen = 5
    path = tmp_path / "rec"
    command = [sys.executable, "-c", APPEND_UNTIL_KILLED, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        lines = list(itertools.islice(process.stdout, 1 + num_seen))
        process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    assert len(lines) == 1 + num_seen
    with pytest.warns(UserWarning, match=r"rec: \d+ of 1000000 planned frames"):
        rec = Recording.load(path)
    assert len(rec) >= num_seen
    for index, one in enumerate(rec.frames()):
        assert (one.cube == index).all()
        assert one.time == index
        assert one.truth is not None
        assert one.truth.elevation == [index]


def test_full_disk_keeps_the_whole_frames_and_names_the_file(tmp_path: Path) -> None:
    # Room for 3.8 frames of 1024 bytes.
    with pytest.raises(OSError, match=r"Errno 27.*rec/cube\.npy'"), largest_file(4000):
        recording(10, names=None).save(tmp_path / "rec")
    with pytest.warns(UserWarning, match="3 of 10 planned frames"):
        assert_same(Recording.load(tmp_path / "rec"), recording(10, names=None), 3)
    assert len(np.load(tmp_path / "rec/cube.npy")) == 3


def test_writer_refuses_frames_that_do_not_fit_and_keeps_those_that_do(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "rec", RADAR, num_frames=2, source={"kind": "test"})
    writer.append(frame(0))
    sensor = bgt60tr13c()
    other = Frame(np.zeros((3, 64, 128), np.float32), 0.0, sensor)
    with pytest.raises(ValueError, match="frame: expected a frame of the recording's radar"):
        writer.append(other)
    with pytest.raises(ValueError, match=r"frame: expected .*'arm', 'wall'.*got complex64 with truth of None"):
        writer.append(frame(1, names=None))
    with pytest.raises(ValueError, match=r"frame.time: expected increasing times \[s\], got 0 and then 0 at index 1"):
        writer.append(frame(0))
    writer.append(frame(1))
    with pytest.raises(ValueError, match="expected num_frames = 2 frames, got one more"):
        writer.append(frame(2))
    writer.close()
    with pytest.raises(ValueError, match="expected an open recording, got one that is closed"):
        writer.append(frame(2))
    assert_same(Recording.load(tmp_path / "rec"), recording(2))


def test_lost_frames_are_readable_while_they_are_written(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "rec", SENSOR, num_frames=4)
    for index, num_lost in enumerate((None, 0, 3)):
        writer.append(sensor_frame(index) if num_lost is None else sensor_frame(index, lost_before=num_lost))
        with pytest.warns(UserWarning, match=f"{index + 1} of 4 planned frames"):
            rec = Recording.load(tmp_path / "rec")
        assert (None if rec.lost is None else rec.lost.tolist()) == (None, [0, 0], [0, 0, 3])[index]
    writer.close()


def test_writer_refuses_a_count_that_is_none_before_anything_is_written(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "rec", SENSOR) as writer:
        writer.append(sensor_frame(0))
        with pytest.raises(TypeError, match=r'stats\["lost_before"\]: expected an integer'):
            writer.append(sensor_frame(1, lost_before=1.5))  # type: ignore[arg-type]
        writer.append(sensor_frame(2))
    assert Recording.load(tmp_path / "rec").time.tolist() == [FRAME_TIMES[0], FRAME_TIMES[2]]


INTERRUPT_AT_ANY_MOMENT = """
import signal, sys, warnings
import numpy as np
from radarcore import Frame, Recording, RecordingWriter, bgt60tr13c
from radarcore.recording.frame import to_samples

warnings.simplefilter("ignore")
radar = bgt60tr13c(num_samples=64, num_chirps=16)
codes = [np.full((3, 16, 64), index, np.uint16) for index in range(1024)]
frames = [Frame(to_samples(c), float(i), radar, stats={"lost_before": i} if i > 2 else {}, raw=c)
          for i, c in enumerate(codes)]
signal.signal(signal.SIGALRM, signal.default_int_handler)  # raises KeyboardInterrupt, as Ctrl-C does
total = 0
for trial in range(30):
    path = f"{sys.argv[1]}/{trial}"
    try:
        with RecordingWriter(path, radar) as writer:
            if trial % 2:  # else it may come before there is any frame
                writer.append(frames[0])
            signal.setitimer(signal.ITIMER_REAL, 1e-4 * 1.12**trial)
            for frame in frames[trial % 2 :]:
                writer.append(frame)
    except KeyboardInterrupt:
        pass
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    rec = Recording.load(path)
    assert rec.time.tolist() == [float(i) for i in range(len(rec))], rec.time
    assert rec.lost is None or rec.lost.tolist() == [i if i > 2 else 0 for i in range(len(rec))]
    assert all((rec.raw[i] == codes[i]).all() for i in range(len(rec))) if len(rec) else True
    total += len(rec)
print(total)
"""


def test_interrupt_at_any_moment_leaves_the_whole_frames(tmp_path: Path) -> None:
    command = [sys.executable, "-c", INTERRUPT_AT_ANY_MOMENT, str(tmp_path)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.stderr == ""
    assert int(result.stdout) >= 15
