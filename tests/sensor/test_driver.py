"""The driver against emulated boards, through pyusb's and pyserial's own code."""

import threading
import time
import warnings

import numpy as np
import pytest

import radarcore as rc
from doubles.boards import LARGE, SMALL, TRANSPORTS, Numbered, number_of, opened, plugged
from doubles.comlib_boards import ComLibDouble, Pipe
from doubles.usb_bus import bus_with, cdc_device
from full_disk import largest_file
from radarcore.recording.frame import to_samples
from radarcore.sensor import (
    FramesLostWarning,
    SensorDisconnectedError,
    SensorError,
    SensorNotFoundError,
    SensorTimeoutError,
    list_sensors,
    open_sensor,
)
from radarcore.sensor.comlib.board import ComLibBoard
from radarcore.sensor.emulator.faults import Faults
from radarcore.sensor.emulator.pty import PtyPort
from radarcore.sensor.emulator.source import Noise
from radarcore.sensor.emulator.strata import Controller, Identity
from radarcore.sensor.strata.packets import Version
from radarcore.sensor.transport.capture import Capture
from short_requests import shorten_requests

OUTER = rc.Radar(SMALL.waveform, tx=SMALL.tx, rx=SMALL.rx[[0, 2]], receiver=SMALL.receiver)


def check_numbers(frames):
    """The first frames of a measurement, except for reported losses before them."""
    lost = np.cumsum([frame.lost_before for frame in frames])
    assert [number_of(frame.raw) for frame in frames] == list(range(len(frames)) + lost)


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_frames_are_those_that_the_board_measures(transport):
    with opened(Controller(Numbered(), speed=None), transport) as sensor:
        for radar, num_frames in ((SMALL, 200), (LARGE, 10), (OUTER, 3)):
            achieved = sensor.configure(radar)
            frames = list(sensor.frames(num_frames))
            assert [number_of(frame.raw) for frame in frames] == list(range(num_frames))
            assert [frame.stats["index"] for frame in frames] == list(range(num_frames))
            assert sensor.num_lost == 0
            assert all(frame.radar is achieved for frame in frames)
            np.testing.assert_allclose(achieved.rx, radar.rx)
            assert frames[2].cube.dtype == np.float32
            np.testing.assert_array_equal(frames[2].cube, to_samples(frames[2].raw))
            # Time stamps are whole microseconds.
            expected = np.arange(num_frames) * achieved.waveform.frame_interval
            np.testing.assert_allclose([frame.time for frame in frames], expected, atol=2e-6)


def test_board_is_found_and_says_what_it_is():
    controller = Controller(Noise(), identity=Identity(version=Version(2, 9, 0)))
    with plugged(controller, "cdc") as (where, _):
        (info,) = list_sensors(**where)
        with open_sensor(**where) as sensor:
            assert sensor.info == info
    assert (info.chip, info.firmware, info.protocol) == ("BGT60TR13C", "2.9.0", "strata")
    assert info.name == "Radar Baseboard MCU7 (MCU A)"
    assert info.serial_number == "00000000-0000-0000-0000-0000636f7265"


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_temperature_is_that_of_the_chip_idle_and_measuring(transport):
    with opened(Controller(Noise(), temperature=41.5, speed=4.0), transport) as sensor:
        assert sensor.temperature() == pytest.approx(41.5, abs=0.3)  # a step of the converter
        sensor.configure(SMALL)
        frames = sensor.frames()
        next(frames)
        sensor._board._temperature = (-1.0, 0.0)  # earlier data is invalid
        assert sensor.temperature() == pytest.approx(41.5, abs=0.3)
        assert next(frames).stats["index"] == 1
        frames.close()
        # The idle measurement resets the chip; a start writes everything again.
        assert sensor.temperature() == pytest.approx(41.5, abs=0.3)
        assert len(list(sensor.frames(2))) == 2


def test_slow_consumer_loses_whole_frames_and_is_told():
    with opened(Controller(Numbered(), speed=20.0), queue_size=4, radar=SMALL) as sensor:
        frames = sensor.frames()
        with pytest.warns(FramesLostWarning, match="not taken in time"):  # noqa: PT031  # a frame may be lost before
            before = next(frames)
            time.sleep(0.3)
            after = next(frames)
        assert after.stats["lost_before"] == number_of(after.raw) - number_of(before.raw) - 1 > 0
        assert after.stats["lost_reason"] == "frames were not taken in time"
        assert sensor.num_lost == before.stats["lost_before"] + after.stats["lost_before"]
        frames.close()


@pytest.mark.parametrize("transport", ["cdc", "vendor"])
def test_unplugging_ends_the_wait_for_a_frame_at_once_and_the_board_opens_again(transport):
    with plugged(Controller(Numbered()), transport) as (where, board):
        sensor = open_sensor(**where)
        sensor.configure(rc.bgt60tr13c(num_samples=32, num_chirps=8, frame_interval=5.0))
        frames = sensor.frames(timeout=60.0)
        next(frames)  # measured after 5 ms
        threading.Timer(0.1, board.unplug).start()
        began = time.monotonic()
        for call in (lambda: next(frames), sensor.temperature):
            with pytest.raises(SensorDisconnectedError):
                call()
        assert time.monotonic() - began < 5.0
        sensor.close()
        board.replug()
        with open_sensor(**where) as again:
            again.configure(SMALL)
            check_numbers(list(again.frames(2)))


@pytest.mark.filterwarnings("ignore::radarcore.sensor.FramesLostWarning")  # on a busy machine: the board never waits
def test_board_left_measuring_is_taken_over():
    """A program that was killed leaves the board sending; the next one begins in the middle of a packet."""
    with plugged(Controller(Numbered(), speed=None), "cdc") as (where, _):
        first = open_sensor(**where)
        first.configure(LARGE)
        next(first.frames())
        first._board._link._stream.close()  # the board is not asked to stop
        with open_sensor(**where) as second:
            second.configure(SMALL)
            check_numbers(list(second.frames(4)))


@pytest.mark.parametrize(
    ("identity", "message"),
    [
        (Identity(version=Version(2, 0, 0, protocol_major=3)), "protocol 4 of Strata, got 3.0; update the board"),
        (Identity(version=Version(9, 0, 0, protocol_major=5)), "protocol 4 of Strata, got 5.0; update radarcore"),
        (Identity(chip_id=0x000504), "expected a BGT60TR13C, got BGT60ATR24C"),
    ],
)
def test_other_boards_are_refused_by_name(identity, message):
    pytest.importorskip("usb", reason="needs the extra `usb`: pip install radarcore[usb]")
    with plugged(Controller(Noise(), identity=identity), "cdc") as (where, _):
        with pytest.warns(RuntimeWarning, match=message):
            assert list_sensors(**where) == []
        with pytest.raises(SensorError, match=message):
            open_sensor("usb:058b:0251", **where)


def test_captured_conversation_plays_without_the_board(tmp_path):
    path = tmp_path / "capture.jsonl"
    with (
        plugged(Controller(Numbered(), speed=None), "cdc") as (where, _),
        open_sensor("usb:058b:0251", capture=path, queue_size=4096, **where) as sensor,
    ):
        achieved = sensor.configure(SMALL)
        first = list(sensor.frames(5))
    with open_sensor(f"capture:{path}", queue_size=4096) as sensor:
        assert sensor.info.protocol == "strata"
        assert sensor.configure(SMALL) == achieved
        again = list(sensor.frames(5))
    assert [number_of(frame.raw) for frame in again] == [0, 1, 2, 3, 4]
    assert [frame.time for frame in again] == [frame.time for frame in first]
    # A program with another request gets an error.
    with open_sensor(f"capture:{path}") as sensor:
        sensor.configure(LARGE)
        with pytest.raises(SensorError, match="expected"):
            list(sensor.frames(1))
    # The file is the only one of its name.
    content = path.read_bytes()
    for transport, name, error, message in (
        ("vendor", "other.jsonl", ValueError, "capture: expected"),
        ("cdc", "capture.jsonl", FileExistsError, "got a file; delete it, or choose another name"),
    ):
        with plugged(Controller(Numbered()), transport) as (where, _), pytest.raises(error, match=message):
            open_sensor(capture=tmp_path / name, **where)
    assert path.read_bytes() == content
    assert list(tmp_path.iterdir()) == [path]


def test_capture_of_comlib_plays_without_its_name(tmp_path):
    path = tmp_path / "comlib.jsonl"
    ComLibBoard(Capture(Pipe(ComLibDouble()), path)).close()
    with open_sensor(f"capture:{path}") as sensor:
        assert sensor.info.protocol == "comlib"


def test_capture_on_a_full_disk_is_a_warning_and_plays_up_to_it(tmp_path):
    """The board continues, and stops as usual."""
    path = tmp_path / "capture.jsonl"
    controller = Controller(Numbered(), speed=None)
    with (
        plugged(controller, "cdc") as (where, _),
        open_sensor("usb:058b:0251", capture=path, queue_size=4096, **where) as sensor,
    ):
        sensor.configure(SMALL)
        with (
            largest_file(path.stat().st_size + 20_001),
            pytest.warns(RuntimeWarning, match=r"capture\.jsonl: File too large; the capture ends here"),
        ):
            assert len(list(sensor.frames(100))) == 100
        assert len(list(sensor.frames(5))) == 5
    assert path.read_bytes().endswith(b"}\n")
    with open_sensor(f"capture:{path}", queue_size=4096) as sensor:
        sensor.configure(SMALL)
        with pytest.raises(SensorError, match="the capture ends here"):
            list(sensor.frames())


def test_recorded_frames_keep_codes_losses_and_settings(tmp_path):
    with opened(Controller(Numbered(), speed=20.0), queue_size=64) as sensor:
        radar = sensor.configure(SMALL, if_gain_db=33, tx_power_level=20, highpass_cutoff=45e3)
        recording = sensor.record(tmp_path / "rec", num_frames=12, progress=False)
        assert recording.radar == radar
        assert [number_of(codes) for codes in recording.raw] == list(range(12))
        np.testing.assert_allclose(np.diff(recording.time), radar.waveform.frame_interval, atol=2e-6)
    recording.save(tmp_path / "infineon", format="infineon")
    text = (tmp_path / "infineon" / "RadarIfxAvian_00" / "config.json").read_text()
    for entry in ('"if_gain_dB": 33', '"tx_power_level": 20', '"hp_cutoff_Hz": 45000'):
        assert entry in text
    again = rc.Recording.load(tmp_path / "infineon")
    np.testing.assert_array_equal(again.raw, recording.raw)


def test_board_with_comlib_is_found_by_asking_or_by_its_usb_ids():
    wanted = rc.bgt60tr13c(num_samples=64, num_chirps=4, frame_interval=50e-3)
    radar = rc.Radar(wanted.waveform, rx=[[0.0, 0.0, 0.0]], receiver=wanted.receiver)
    board = ComLibDouble()
    with PtyPort(board) as port, open_sensor(port.path) as sensor:
        assert sensor.info.protocol == "comlib"
        achieved = sensor.configure(radar, rx_mask=1)
        frames = list(sensor.frames(5))
        assert [number_of(frame.raw) for frame in frames] == [0, 1, 2, 3, 4]
        assert frames[0].radar is achieved
        assert frames[0].cube.shape == (1, 4, 64)
    (info,) = list_sensors(usb_backend=bus_with(cdc_device(board, product_id=0x0058)))
    assert (info.protocol, info.port) == ("comlib", "usb:1-1")


def test_wrong_use_names_what_is_expected():
    with pytest.raises(SensorNotFoundError, match="/dev/none"):
        open_sensor("/dev/none")
    with pytest.raises(ValueError, match="protocol: expected"):
        open_sensor("/dev/none", protocol="smoke signals")
    controller = Controller(Noise(), speed=None)
    with plugged(controller, "cdc") as (where, _):
        with pytest.raises(SensorNotFoundError, match=r"usb:1-99.*there is usb:"):
            open_sensor("usb:1-99", **where)
        sensor = open_sensor(**where)
        with pytest.raises(SensorError, match=r"expected configure\(radar\) before frames"):
            sensor.frames()
        with pytest.raises(SensorError, match=r"expected configure\(radar\) before source"):
            sensor.source()
        with pytest.raises(TypeError, match="radar: expected Radar, got Waveform"):
            sensor.configure(SMALL.waveform)
        with pytest.raises(TypeError, match=r"gain: expected an option of BGT60TR13C \(tx_power_level or if_gain_db"):
            sensor.configure(SMALL, gain=33)
        with pytest.raises(ValueError, match=r"frame_interval|frame_time"):
            sensor.configure(rc.Radar(SMALL.waveform.replace(frame_interval=1e-3), receiver=SMALL.receiver))
        sensor.close()
        sensor.close()
        with pytest.raises(SensorError, match="got one that is closed"):
            sensor.temperature()


@pytest.mark.parametrize(
    ("radar", "num_packets", "rate", "has_timestamps"),
    # 44 % of the frames of 48 packets are damaged then; of many more, hardly any would come.
    [(SMALL, 3_000, 6e-3, True), (LARGE, 1_500, 2e-3, False)],
    ids=["one slice", "two slices"],
)
def test_whatever_goes_wrong_frames_are_whole_and_losses_are_told(
    radar, num_packets, rate, has_timestamps, monkeypatch
):
    """Every fault at random: each frame is one of the board's, in order; where one is missing, that is reported."""
    shorten_requests(monkeypatch, 0.35)  # some answers are lost
    names = ("bad_crc", "lost", "cut", "duplicated", "lost_counter", "rubbish")
    rare = {"overflow": rate / 5, "stall": rate / 5, "unplug": rate / 5}
    faults = Faults(**dict.fromkeys(names, rate), **rare, has_any_transfers=True)
    controller = Controller(Numbered(), speed=None, has_timestamps=has_timestamps, faults=faults, most_payload=768)
    expected = (*names, *rare) if radar is SMALL else names
    with plugged(controller, "cdc") as (where, board), warnings.catch_warnings():
        warnings.simplefilter("ignore", FramesLostWarning)
        # Rare ones may need longer.
        for least in range(num_packets, 10 * num_packets, num_packets):
            while controller.num_sent < least:
                try:
                    _watch(where, radar, controller, least)
                except (SensorDisconnectedError, SensorNotFoundError):  # unplugged while it measured, or was closed
                    board.replug()
                except SensorTimeoutError:  # requests came to nothing too often
                    pass
                except SensorError as error:
                    assert "again after 10 restarts" in str(error), "no frame came in between"  # noqa: PT017
            if all(faults.done[name] > 0 for name in expected):
                return
    pytest.fail(f"happened: {faults.done}")


def _watch(where, radar, controller, num_packets):
    """Take frames until enough packets were sent."""
    with open_sensor(**where) as sensor:
        sensor.configure(radar)
        expected = 0
        for frame in sensor.frames():
            number = number_of(frame.raw)  # whole
            was_anew = "anew" in frame.stats.get("lost_reason", "")
            ahead = (number - expected) % 4096
            if ahead and not was_anew:
                assert 0 < ahead < 2048, "in order"
                assert frame.stats["lost_before"] > 0, "told"
            expected = number + 1
            if controller.num_sent >= num_packets:
                return
