"""Counts of losses, and times of frames: slices put in by hand, and clocks of all kinds."""

import time
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

import radarcore as rc
from chip_settings import power_up
from doubles.boards import Numbered, number_of, numbered, opened
from radarcore.sensor import FramesLostWarning, Sensor, SensorError
from radarcore.sensor.bgt60.settings import Settings, achieved, choose_slice_size
from radarcore.sensor.emulator.chip import Chip
from radarcore.sensor.emulator.source import Noise
from radarcore.sensor.emulator.strata import Controller
from radarcore.sensor.interface import BoardInfo, Damage, RawFrame
from radarcore.sensor.strata.board import StrataBoard
from radarcore.sensor.strata.packets import Avian, Code, Component, DataPacket, Kind, Request
from radarcore.sensor.strata.slices import pack_msb

SMALL = power_up(num_samples=32, num_chirps=8, frame_interval=25e-3)
LARGE = power_up(num_chirps=64, frame_interval=100e-3)  # two slices to a frame
FAST = power_up(num_samples=32, num_chirps=1, chirp_interval=400e-6, frame_interval=2e-3)  # three frames to a slice


class Slices:
    """A link whose requests an emulated board answers, and whose data packets a test puts in."""

    name = "test"
    most_payload = 4085
    num_held = 0

    def __init__(self):
        self.controller = Controller(Noise())
        self.waiting = []
        self.num_starts = 0

    def ask(self, request, timeout=1.0, *, retries=2):
        response = self.controller.handle(request)
        assert response.status == 0
        if (request.request, request.kind, request.index) == (Code.COMPONENT, Kind.WRITE, Avian.EXECUTE):
            self.num_starts += request.value == Component.AVIAN and request.payload[-1] & 1
            self.controller.chip.close()  # only the test sends data
        return response.payload

    def packets(self, timeout):
        waiting, self.waiting = self.waiting, []
        return waiting

    def discard(self):
        self.waiting.clear()

    def close(self):
        self.controller.close()


class Measuring:
    """A board that measures, of a driver without threads."""

    def __init__(self, radar, *, stamps=True, packets_per_slice=1):
        self.link = Slices()
        self.board = StrataBoard(self.link)
        self.radar = self.board.configure(radar)
        self.board.start()
        self.last, self.losses = -1, []
        settings = Settings.from_radar(radar)
        self.slice_size = choose_slice_size(settings)
        self.frame_size = settings.frame_size
        self.frame_time = self.radar.waveform.frame_interval
        self.stamps, self.packets_per_slice = stamps, packets_per_slice
        self.shape = (self.radar.num_channels, self.radar.waveform.num_chirps, self.radar.waveform.num_samples)
        self.active = self.radar.waveform.num_chirps * achieved(settings).chirp_time

    def packets(self, number, *, counter=None, stamp=0.0):
        """Slice of a measurement, from 0; `stamp` is what the board's clock is ahead [s]."""
        first_sample = number * self.slice_size
        frames = range(first_sample // self.frame_size, -(-(first_sample + self.slice_size) // self.frame_size))
        samples = np.concatenate([numbered(self.shape, frame).transpose(1, 2, 0).reshape(-1) for frame in frames])
        begin = first_sample - frames[0] * self.frame_size
        data = pack_msb(samples[begin : begin + self.slice_size])
        parts = np.array_split(np.frombuffer(data, np.uint8), self.packets_per_slice)
        counter = number * self.packets_per_slice if counter is None else counter
        within = (begin + self.slice_size) / self.frame_size - len(frames) + 1
        when = stamp + frames[-1] * self.frame_time + within * self.active
        return [
            DataPacket(
                part.tobytes(),
                (counter + index) % 65536,
                timestamp=round(1e6 * when) if self.stamps and index == len(parts) - 1 else None,
                is_first=index == 0,
                is_last=index == len(parts) - 1,
            )
            for index, part in enumerate(parts)
        ]

    def read(self, *packets):
        self.link.waiting = [packet for group in packets for packet in (group if isinstance(group, list) else [group])]
        items = self.board.read(0.0)
        indices = [self.last, *(item.index for item in items)]
        self.last = indices[-1]
        gaps = [later - earlier - 1 for earlier, later in pairwise(indices)]
        self.losses = [(gap, ", ".join(item.lost_reasons)) for gap, item in zip(gaps, items, strict=True) if gap]
        return items


def frames_of(items):
    return [(item.index, number_of(item.codes)) for item in items]


def at(number, **options):
    """A slice of a measurement, with its counter or what the board's clock is ahead."""
    return number, options


ODD = power_up(num_samples=33, num_chirps=7, frame_interval=25e-3)
ODD = rc.Radar(ODD.waveform, rx=ODD.rx[:1], receiver=ODD.receiver)  # two frames to a slice
NO_PAUSE = power_up(num_chirps=64, chirp_interval=500e-6, frame_interval=64 * 500e-6)  # two slices to a frame


@pytest.mark.parametrize(
    ("radar", "options", "sent", "frames", "lost"),
    [
        # A counter that wraps, between frames and in a loss.
        *(
            (
                SMALL,
                {"stamps": stamps, "packets_per_slice": num},
                [at(slice_, counter=65536 + num * (slice_ - before)) for slice_ in (0, 1, 2, 3, 6, 7)],
                [0, 1, 2, 3, 6, 7],
                [2],
            )
            for stamps in (True, False)
            for num in (1, 3)
            for before in (2, 5)
        ),
        # Time stamps say what the counter does not: more packets than it counts, and a jump without a loss.
        (SMALL, {}, [at(0), at(70_000)], [0, 70_000], [69_999]),
        (SMALL, {}, [at(0), at(1, counter=500), at(2, counter=501)], [0, 1, 2], []),
        # Time stamps that go back leave counting to the counter, and do not split frames.
        (SMALL, {}, [at(0, stamp=60.0), at(3), at(4)], [0, 3, 4], [2]),
        *(
            (LARGE, {}, [at(number, stamp=5000.0 if number < when else 0.0) for number in range(4)], [0, 1], [])
            for when in (1, 2, 3)
        ),
        # Stamps that jitter say nothing about frames that follow without a pause.
        (NO_PAUSE, {}, [at(number, stamp=3e-4 * (number % 3)) for number in range(12)], [0, 1, 2, 3, 4, 5], []),
        # A packet that comes twice is one frame.
        (SMALL, {}, [at(0), at(1), at(1), at(2)], [0, 1, 2], []),
        # A slice of several frames loses all of them.
        *((FAST, {"stamps": stamps}, [at(0), at(3)], [0, 1, 2, 9, 10, 11], [6]) for stamps in (True, False)),
        (ODD, {}, [at(0), at(2)], [0, 1, 4, 5], [2]),
    ],
)
def test_frames_and_losses_are_counted(radar, options, sent, frames, lost):
    given = Measuring(radar, **options)
    items = given.read(*(given.packets(number, **change) for number, change in sent))
    assert frames_of(items) == [(index, index % 4096) for index in frames]
    assert [number for number, _ in given.losses] == lost
    assert given.link.num_starts == 1


def test_frames_of_one_slice_have_times_of_their_own():
    given = Measuring(FAST)
    times = [frame.device_time for frame in given.read(given.packets(0))]
    np.testing.assert_allclose(times, np.arange(3) * given.frame_time, atol=1e-6)


def test_damage_before_the_first_frame_is_a_loss_of_unknown_length():
    given = Measuring(SMALL)
    items = given.read(Damage(100, "bad CRC"), given.packets(5), given.packets(6))
    assert frames_of(items) == [(1, 5), (2, 6)]
    assert given.losses == [(1, "bad CRC")]


def test_parts_of_two_frames_are_never_put_together():
    """By time stamps even where the counter says nothing: the first part of the first frame is lost."""
    given = Measuring(LARGE)
    items = given.read(given.packets(1, counter=7), given.packets(2, counter=8))
    assert frames_of(items) == []
    assert given.link.num_starts == 2, "measured anew"
    assert frames_of(given.read(given.packets(0, stamp=9.0), given.packets(1, stamp=9.0))) == [(1, 0)]
    assert given.losses == [(1, "packets are missing; measuring was started anew")]


def test_what_was_on_its_way_before_the_start_is_no_frame_of_it():
    given = Measuring(SMALL)
    given.board.stop()
    ask = given.link.ask

    def late(request, *arguments, **options):
        if request == Request.write(Code.DATA, 3, 0):
            given.link.waiting += given.packets(77)
        return ask(request, *arguments, **options)

    given.link.ask = late
    given.board.start()
    assert given.board.read(0.0) == []


def test_reason_is_that_of_the_loss_it_is_told_with():
    given = Measuring(SMALL)
    given.read(given.packets(0), Damage(9, "bad CRC"), given.packets(2), given.packets(3), given.packets(5))
    assert given.losses == [(1, "bad CRC"), (1, "expected packet 4, got 5")]
    # Damage that was no part of a slice, such as an answer, costs nothing, and is no reason for what comes later.
    given.read(Damage(9, "bad CRC"), given.packets(6), given.packets(8))
    assert given.losses == [(1, "expected packet 7, got 8")]


def test_slice_of_another_length_is_lost():
    given = Measuring(SMALL)
    (whole,) = given.packets(1)
    items = given.read(given.packets(0), replace(whole, payload=whole.payload[:-3]), given.packets(2))
    assert frames_of(items) == [(0, 0), (2, 2)]
    assert given.losses == [(1, "a slice of 1149 bytes")]


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (0x07, "overflow (0x07)"),
        (0x012E, "FIFO overflow (0x12E)"),
        (0x40000002, "(0x40000002)"),
        ("no supply", "no supply"),
    ],
)
def test_error_of_the_board_starts_anew_and_counts_the_frames_meanwhile(error, text, monkeypatch):
    now = [100.0]
    monkeypatch.setattr("radarcore.sensor.strata.board.time", SimpleNamespace(monotonic=lambda: now[0], time=time.time))
    given = Measuring(SMALL)
    (whole,) = given.packets(1)
    given.read(given.packets(0))
    now[0] += 20.2 * given.frame_time
    assert given.read(replace(whole, payload=b"", error=error)) == []
    assert given.board.damage().endswith(f"{text}; measuring was started anew")
    assert given.link.num_starts == 2
    assert frames_of(given.read(given.packets(0, stamp=1.0))) == [(21, 0)]
    ((number, reason),) = given.losses
    assert number == 20
    assert reason.startswith("the board stopped: ")
    assert reason.endswith(f"{text}; measuring was started anew")
    assert given.board.damage() == ""


def test_board_that_always_fails_is_given_up_and_one_that_gives_frames_is_not():
    given = Measuring(SMALL)
    error = DataPacket(b"", 0, error=0x07)
    for _ in range(12):
        assert given.read(error, given.packets(0)) == []
        assert len(given.read(given.packets(0))) == 1
    for _ in range(10):
        given.read(error)
    with pytest.raises(SensorError, match=r"test: the board stopped: overflow \(0x07\), again after 10 restarts"):
        given.read(error)


def test_other_bits_of_the_temperature_register_are_no_temperature(monkeypatch):
    given = Measuring(SMALL)
    read = Chip.read
    monkeypatch.setattr(Chip, "read", lambda self, address: read(self, address) | 0x2BC400)  # raw result, busy
    assert given.board.temperature() == pytest.approx(25.0, abs=0.3)


class Clocked:
    """A board whose frames have the time stamps of a list."""

    info = BoardInfo("test", "strata", "board", "BGT60TR13C", "1", "")

    def __init__(self, items):
        self.items = items

    def configure(self, radar):
        return radar

    def start(self):
        self.left = list(self.items)

    def read(self, timeout):
        left, self.left = self.left, []
        return left

    def stop(self, *, is_silent=False):
        pass

    close = stop
    details = dict
    damage = str


INTERVAL = SMALL.waveform.frame_interval


def raw(index, device_time, *lost_reasons):
    return RawFrame(np.zeros((3, 8, 32), np.uint16), index, 0.0, device_time, lost_reasons)


@pytest.mark.parametrize(
    ("stamps", "expected"),
    [
        # frame: time stamp -> frame: time in frame intervals
        ({0: None, 1: None, 5: None}, [0, 1, 5]),
        ({1: None, 2: None}, [1, 2]),
        ({0: 100.0, 1: 101.1, 5: 105.2}, [0, 1.1, 5.2]),
        # A clock that runs on, one that starts again with the measurement, one that wraps.
        ({0: 100.0, 1: 101.0, 9: 109.7, 10: 110.7}, [0, 1, 9.7, 10.7]),
        ({0: 0.3, 1: 1.3, 9: 0.3, 10: 1.4}, [0, 1, 9, 10.1]),
        ({0: 4e9, 1: 4e9 + 1, 2: 3.0, 3: 4.0}, [0, 1, 2, 3]),
        # One that stands still, and one that is there now and then.
        ({0: 0.0, 1: 0.0, 2: 0.0}, [0, 1, 2]),
        ({0: None, 1: 51.0, 2: None, 3: 53.2}, [0, 1, 2, 3.2]),
    ],
)
@pytest.mark.filterwarnings("ignore::radarcore.sensor.FramesLostWarning")
def test_frame_times_grow_with_a_clock_of_any_kind(stamps, expected):
    frames = [raw(i, None if stamp is None else stamp * INTERVAL) for i, stamp in stamps.items()]
    with Sensor(Clocked(frames)) as sensor:
        sensor.configure(SMALL)
        given = list(sensor.frames(len(frames)))
    np.testing.assert_allclose([frame.time for frame in given], np.array(expected) * INTERVAL, atol=1e-7)
    assert [frame.stats["index"] for frame in given] == list(stamps)
    assert [frame.stats.get("device_time") for frame in given] == [frame.device_time for frame in frames]


def test_losses_are_warned_of_once_a_measurement_and_counted_anew_in_the_next():
    items = [raw(0, None), raw(3, None, "damage"), raw(5, None, "damage")]
    with Sensor(Clocked(items)) as sensor:
        sensor.configure(SMALL)
        for _ in range(2):
            with pytest.warns(FramesLostWarning) as warned:
                frames = list(sensor.frames(3))
            assert [str(warning.message) for warning in warned] == ["test: 2 lost: damage"]
            assert [frame.stats["lost_before"] for frame in frames] == [0, 2, 1]
            assert [frame.stats.get("lost_reason") for frame in frames] == [None, "damage", "damage"]
            assert sensor.num_lost == 3


def test_duration_of_a_recording_is_rounded_to_frames(tmp_path):
    with Sensor(Clocked([raw(index, None) for index in range(20)])) as sensor:
        sensor.configure(SMALL)
        recording = sensor.record(tmp_path / "rec", duration=9.6 * INTERVAL, progress=False)
        assert len(recording) == 10
        assert len(sensor.record(tmp_path / "short", duration=0.1 * INTERVAL, progress=False)) == 1


def test_times_across_a_restart_are_those_of_the_board():
    controller = Controller(Numbered(), speed=1.0)
    with opened(controller) as sensor, pytest.warns(FramesLostWarning, match="started anew"):  # noqa: PT031
        radar = sensor.configure(SMALL)
        frames = sensor.frames()
        given = [next(frames) for _ in range(3)]
        controller.chip.overflow()
        controller._collect()  # as when the FIFO is read
        while given[-1].stats["lost_before"] == 0:  # frames that had come before
            given.append(next(frames))
        restart = len(given) - 1
        given += [next(frames) for _ in range(2)]
        frames.close()
    times, indices = ([frame.time for frame in given], [frame.stats["index"] for frame in given])
    assert all(b > a for a, b in pairwise(times))
    # The host reckons from when frames arrive: to a frame or two, and a busy machine.
    interval = radar.waveform.frame_interval
    np.testing.assert_allclose(times, np.array(indices) * interval, atol=10 * interval)
    np.testing.assert_allclose(np.diff(times[restart:]), interval, atol=1e-5)


@pytest.mark.parametrize(
    "radar",
    [
        power_up(num_samples=256, num_chirps=128, frame_interval=0.15, chirp_interval=500e-6),
        power_up(num_samples=4095, num_chirps=2, sample_rate=4e6, chirp_interval=1.2e-3, frame_interval=20e-3),
        power_up(num_samples=64, num_chirps=1, chirp_interval=500e-6, frame_interval=1.5e-3),  # 660 per second
        ODD,
    ],
    ids=["six FIFOs", "largest chirps", "660 frames per second", "odd"],
)
def test_frames_of_any_size_come_in_real_time(radar):
    with opened(Controller(Numbered(), speed=1.0)) as sensor:
        sensor.configure(radar)
        assert [number_of(frame.raw) for frame in sensor.frames(3)] == [0, 1, 2]
        assert sensor.num_lost == 0
