"""ComLib boards configured for a radar: what they come near to, and boards that are refused."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from doubles.comlib_boards import Pipe, Ramp, board_with, radar
from radarcore.sensor.comlib import messages as comlib
from radarcore.sensor.comlib.board import ComLibBoard
from radarcore.sensor.comlib.codes import Base, EndpointType
from radarcore.sensor.emulator.comlib import ComLibEmulator
from radarcore.sensor.errors import (
    ProtocolError,
    RequestError,
    SensorDisconnectedError,
    SensorError,
    SensorTimeoutError,
)
from radarcore.sensor.interface import RawFrame


def configurable(**options: Any) -> ComLibBoard:
    return ComLibBoard(Pipe(ComLibEmulator(Ramp(), **options)))


def test_board_tells_what_it_is():
    info = configurable().info
    assert (info.port, info.protocol, info.chip, info.firmware) == ("pipe", "comlib", "BGT60TR24B", "1.0.0")
    assert info.name == "BGT60TR24B radar board, emulated"


@pytest.mark.parametrize(
    ("wanted", "name", "value"),
    [
        ({"start_frequency": 63e9, "slope": -40e12}, "start_frequency", 63e9),  # a falling ramp begins at the top
        ({"start_frequency": 63e9, "slope": -40e12}, "slope", -40e12),
        # 100 MHz/us for 54 us from 60 GHz would end at 65.4 GHz, beyond the limit: 4 GHz in 54 us are 74 MHz/us.
        ({"start_frequency": 60e9, "slope": 100e12}, "slope", 4e9 / 54e-6),
        ({"frame_interval": 1e-6}, "frame_interval", 864e-6),  # 16 chirps of 54 us
    ],
)
def test_settings_of_the_board_come_near_to_the_radar(wanted, name, value):
    emulator = ComLibEmulator(Ramp())
    board = ComLibBoard(Pipe(emulator))
    achieved = board.configure(radar(**wanted)).waveform
    assert getattr(achieved, name) == pytest.approx(value, rel=1e-6)
    board.start()
    assert getattr(emulator.radar.waveform, name) == pytest.approx(value, rel=1e-6)


def test_configured_radar_is_the_one_of_the_board():
    emulator = ComLibEmulator(Ramp())
    board = ComLibBoard(Pipe(emulator))
    wanted = radar(2, sample_rate=1e6)
    achieved = board.configure(wanted, tx_power=10)
    wave, truth = achieved.waveform, emulator.radar.waveform
    # 64 samples at 1 MHz and 22 us; slopes in whole MHz/s of ramps in whole kHz.
    assert wave.chirp_interval == pytest.approx(86e-6, rel=1e-12)
    assert wave.slope == pytest.approx(40e12, rel=1e-6)
    assert wave.slope == pytest.approx(truth.slope, rel=1e-7)
    for name in ("start_frequency", "sample_rate", "num_samples", "num_chirps", "chirp_interval", "adc_delay"):
        assert getattr(wave, name) == pytest.approx(getattr(truth, name), rel=1e-12), name
    assert wave.frame_interval == 0.05
    assert achieved.is_real
    assert (len(achieved.rx), achieved.receiver.noise_figure_db) == (2, 12.0)
    board.start()
    assert emulator.radar.waveform.frame_interval == 0.05
    assert emulator.radar.num_channels == 2


def test_enabled_receivers_are_those_of_the_mask():
    emulator = ComLibEmulator(Ramp())
    board = ComLibBoard(Pipe(emulator))
    board.configure(radar(2), rx_mask=0b1010)
    board.start()
    board.read(60.0)
    rx = emulator.radar.rx
    # RX2 and RX4 are on the left of the square of 3.5 mm.
    np.testing.assert_allclose(rx, [[0, 1.75e-3, 1.75e-3], [0, 1.75e-3, -1.75e-3]], rtol=1e-12)


def test_sample_rate_of_a_board_without_adc_endpoint_is_measured():
    for num_samples in (63, 64, 200):
        emulator = ComLibEmulator(Ramp(), has_adc=False, sample_rate=1.7e6)
        board = ComLibBoard(Pipe(emulator))
        achieved = board.configure(radar(sample_rate=1.7e6, num_samples=num_samples))
        assert (achieved.waveform.sample_rate, achieved.waveform.num_samples) == (1.7e6, num_samples)
        message = r"sample_rate: expected 1\.7e\+06 Hz.*got 2e\+06; the endpoint .*\(RadarSoli\) is not public"
        with pytest.raises(ValueError, match=message):
            board.configure(radar(num_samples=num_samples))
        # Half of a setting is not measured with.
        with pytest.raises(SensorError, match="not configured"):
            board.start()


def test_refusal_of_the_board_is_told_in_words():
    board = ComLibBoard(Pipe(ComLibEmulator(Ramp())))
    with pytest.raises(
        RequestError, match=r"pipe: endpoint 1 refused a request: unsupported format \(0x0008\)"
    ) as refused:
        board.configure(radar(num_samples=4096, num_chirps=64, frame_interval=None, slope=1e12))
    assert refused.value.status == 0x08
    with pytest.raises(RequestError, match="sample rate out of range"):
        board.configure(radar(sample_rate=4e6))


class OtherEndpoints(ComLibEmulator):
    """Board with endpoints of other types."""

    def __init__(self, types: Sequence[int]) -> None:
        super().__init__(Ramp())
        self._endpoints = [comlib.Endpoint(kind) for kind in types]


@pytest.mark.parametrize(
    ("types", "message"),
    [
        ([EndpointType.IRDR], r"pipe: the board speaks the ComLib of 2016/17 .*iRDR"),
        ([EndpointType.RBAS, 0x5244504C], "expected an FMCW radar with endpoint RFMC, got RBAS, RDPL"),
    ],
)
def test_boards_with_other_endpoints_are_refused_by_name(types, message):
    with pytest.raises(SensorError, match=message):
        ComLibBoard(Pipe(OtherEndpoints(types)))


def test_board_with_iq_samples_alone_is_refused():
    class Complex(ComLibEmulator):
        def _set_format(self, form: comlib.Format) -> list[comlib.Message]:
            return super()._set_format(replace(form, signal_part=form.signal_part ^ 2))

    board = ComLibBoard(Pipe(Complex(Ramp())))
    with pytest.raises(RequestError, match=r"signal part not available .*the board has no real samples"):
        board.configure(radar())


class Lying(ComLibEmulator):
    """Board that answers some requests to RBAS and RFMC, by endpoint and code, with what is given."""

    def __init__(self, lies: dict[tuple[int, int], bytes], **options: Any) -> None:
        super().__init__(Ramp(), **options)
        self.lies = lies

    def _messages(self, request: comlib.Message) -> list[comlib.Message]:
        lie = self.lies.get((request.endpoint, request.code))
        return super()._messages(request) if lie is None else [comlib.Message(request.endpoint, lie)]


@pytest.mark.parametrize(
    ("lies", "has_adc", "error", "message"),
    [
        ({(1, 0x40): comlib.Format(64, 16, 0xF, 2).encode()}, False, SensorError, "real samples .*got signal part 2"),
        ({(1, 0x40): comlib.Format(32, 16, 0xF).encode()}, False, ProtocolError, "was set to .*64.* and says .*32"),
        (
            {(2, 0x00): comlib.FmcwSettings(57_000_000, 58_000_000, 2, 0).encode()},
            False,
            ProtocolError,
            "the board was set to",
        ),
        (
            {(1, 0x34): comlib.encode_number(0x35, 7)},
            False,
            ProtocolError,
            "expected the one with more samples to last",
        ),
        (
            {(1, 0x34): comlib.encode_number(0x35, 0)},
            True,
            ProtocolError,
            "expected a sample rate and a duration",
        ),
        ({(1, 0x34): comlib.encode_number(0x37, 7)}, False, ProtocolError, "answer 0x35 .* to 0x34, got none"),
        ({(1, 0x36): b"\x37\0"}, False, ProtocolError, "pipe: ComLib message: expected 5 bytes, got 2"),
        (
            {(1, 0x01): comlib.Frame(0, np.zeros((4, 16, 63), np.uint16), 0xF).encode()},
            False,
            ProtocolError,
            r"^pipe: expected a frame of \[rx, chirp, sample\] \(4, 16, 64\), got \(4, 16, 63\)",
        ),
        ({(1, 0x01): bytes(18)}, False, ProtocolError, r"^pipe: ComLib frame: expected real samples .* got 0, 0, 0"),
        (
            {(1, 0x22): comlib.Info(56_000_000, 64_000_000, 1, 4, 31, 0, 1, 0, 0, 0, "board").encode()},
            False,
            SensorError,
            "has no temperature sensor",
        ),
    ],
)
def test_board_that_says_something_else_than_it_was_set_to_is_refused(lies, has_adc, error, message):
    board = ComLibBoard(Pipe(Lying(lies, has_adc=has_adc)))
    with pytest.raises(error, match=message):
        measured_once(board)


def measured_once(board: ComLibBoard) -> None:
    board.configure(radar())
    board.start()
    board.read(60.0)
    board.temperature()


def test_slope_follows_from_the_ramp_where_the_board_does_not_tell():
    board = ComLibBoard(Pipe(Lying({(2, 0x02): comlib.encode_number(0x02, 0)})))
    assert board.configure(radar()).waveform.slope == pytest.approx(40e12, rel=1e-6)


# Boards that measure


@pytest.mark.parametrize("is_interleaved", [False, True])
def test_frames_come_as_the_source_gave_them(is_interleaved):
    source = Ramp()
    board = ComLibBoard(Pipe(ComLibEmulator(source, is_interleaved=is_interleaved), size=64))
    board.configure(radar(3))
    board.start()
    frames = [item for _ in range(3) for item in board.read(60.0)]
    board.stop()
    assert all(isinstance(frame, RawFrame) for frame in frames)
    assert [frame.index for frame in frames] == [0, 1, 2]
    for index, frame in enumerate(frames):
        assert frame.codes.dtype == np.uint16
        np.testing.assert_array_equal(frame.codes, Ramp().frame(radar(3), index, 0.0))
    assert [(index, round(begin, 9)) for _, index, begin in source.calls] == [(0, 0.0), (1, 0.05), (2, 0.1)]


def started(emulator: ComLibEmulator) -> ComLibBoard:
    """A board that measures."""
    board = ComLibBoard(Pipe(emulator))
    board.configure(radar())
    board.start()
    return board


class Stepped(ComLibEmulator):
    """Board whose time goes on by hand."""

    now = 0.0

    def _now(self) -> float:
        return self.now


def test_frames_that_were_over_are_reported():
    emulator = Stepped(Ramp(), speed=1.0)
    board = started(emulator)
    emulator.now = 0.06  # [s], an interval takes 50 ms
    (first,) = board.read(60.0)
    emulator.now = 10.0
    (second,) = board.read(60.0)
    assert (first.index, first.lost_reasons) == (0, ())
    assert second.index > 100
    assert second.lost_reasons == (f"between frames 0 and {second.index} of the board: asked for late, or damaged",)


def test_late_frame_is_that_of_the_next_read():
    emulator = Stepped(Ramp(), speed=1.0)
    board = started(emulator)
    assert board.read(0.0) == []
    emulator.now = 0.06
    (frame,) = board.read(0.0)
    assert frame.index == 0
    # The temperature is asked for once the frame has come; no frame gets lost by that.
    assert board.read(0.0) == []
    emulator.now = 0.11
    assert board.temperature() == pytest.approx(40.0)
    (frame,) = board.read(0.0)
    assert frame.index == 1


def test_stop_and_start_count_from_zero():
    emulator = Stepped(Ramp(), speed=1.0)
    board = ComLibBoard(Pipe(emulator), timeout=0.1)
    board.configure(radar())
    board.stop()
    for _ in range(2):
        board.start()
        emulator.now += 0.06
        assert board.read(0.0)[0].index == 0
        assert board.read(0.0) == []
        emulator.now += 0.06
        board.stop()
        with pytest.raises(SensorError, match="not measuring"):
            board.read(0.0)


def test_frame_that_never_comes_does_not_hold_up_the_board_for_ever():
    # The board does not even answer what is asked behind it.
    emulator = Stepped(Ramp(), speed=1.0)
    board = ComLibBoard(Pipe(emulator), timeout=0.05, board_timeout=0.05)
    board.configure(radar(frame_interval=0.01))
    board.start()
    assert board.read(0.0) == []
    with pytest.raises(SensorTimeoutError, match="pipe: no answer"):
        board.temperature()
    emulator.now = 1.0
    assert board.temperature() == pytest.approx(40.0)
    board.stop()


def test_host_finds_step_again_after_damage():
    emulator = ComLibEmulator(Ramp(), resync_timeout=0.05)
    board = board_with(emulator)
    board.configure(radar())
    board.start()
    pipe = board._stream
    (frame,) = board.read(60.0)
    assert frame.index == 0
    pipe.change = lambda data: b"\x11" + data
    with pytest.raises(ProtocolError, match="pipe: not ComLib: bad start"):
        board.read(60.0)
    pipe.change = lambda data: data
    (frame,) = board.read(60.0)
    assert (frame.index, len(frame.lost_reasons)) == (2, 1)


def test_host_waits_for_a_board_that_has_lost_step():
    emulator = ComLibEmulator(Ramp(), resync_timeout=0.1)
    board = ComLibBoard(Pipe(emulator), timeout=0.05, board_timeout=60.0)
    emulator.receive(b"\xc0")
    begin = time.monotonic()
    with pytest.raises(RequestError, match=r"bad start \(0x0002\)"):
        board.temperature()
    assert board.temperature() == pytest.approx(40.0)
    # The board says when it listens again; it is not waited for as long as others may take.
    assert time.monotonic() - begin < 30.0


def test_board_that_was_left_half_way_is_opened():
    emulator = ComLibEmulator(Ramp(), resync_timeout=0.05)
    # Another program has sent half a request; its rest is taken from the first of ours.
    emulator.receive(bytes.fromhex("5a 01 02 00"))
    assert board_with(emulator).temperature() == pytest.approx(40.0)


class Silent(ComLibEmulator):
    def receive(self, data: bytes) -> None:
        pass


class Noise(ComLibEmulator):
    def send(self, size: int, timeout: float) -> bytes:
        time.sleep(0.001)
        return b"\xd3" * size


@pytest.mark.parametrize(("kind", "message"), [(Silent, r"no answer in 0\.05 s"), (Noise, "the line is never silent")])
def test_silence_and_endless_noise_are_no_comlib(kind, message):
    with pytest.raises(SensorTimeoutError, match=f"pipe: {message}"):
        ComLibBoard(Pipe(kind(Ramp())), timeout=0.05, board_timeout=0.05)


def test_unplugged_board_is_disconnected_and_can_be_closed():
    emulator = ComLibEmulator(Ramp())
    board = started(emulator)
    emulator.unplug()
    with pytest.raises(SensorDisconnectedError):
        board.read(60.0)
    board.close()
    board.close()
    assert board._stream.is_closed


# The emulator, byte by byte


def talk(emulator: ComLibEmulator, endpoint: int, payload: bytes) -> list[comlib.Message | comlib.StatusMessage]:
    """Everything that a request is answered with."""
    emulator.receive(comlib.Message(endpoint, payload).encode())
    parser = comlib.Parser()
    found = []
    while data := emulator.send(7, 0.0):
        found += parser.feed(data)
    assert parser.is_idle
    return found


def codes_of(answer: Sequence[comlib.Message | comlib.StatusMessage]) -> list[tuple[int, int]]:
    return [
        (item.endpoint, item.code if isinstance(item, comlib.Message) else -1 - item.status)
        for item in answer
    ]  # fmt: skip


OK = -1


def test_emulator_tells_what_follows_from_a_setting():
    emulator = ComLibEmulator(Ramp())
    assert codes_of(talk(emulator, 1, comlib.Format(64, 16, 0xF).encode())) == [
        (1, 0x41), (1, 0x35), (1, 0x37), (3, 0x01), (2, 0x02), (1, OK),
    ]  # fmt: skip
    ramp = comlib.FmcwSettings(57_000_000, 64_000_000, 0, 31)
    assert codes_of(talk(emulator, 2, ramp.encode())) == [(1, 0x33), (1, 0x33), (2, 0x01), (2, OK)]
    assert codes_of(talk(emulator, 3, comlib.AdcSettings(1_000_000).encode())) == [
        (1, 0x35),
        (1, 0x37),
        (3, 0x01),
        (3, OK),
    ]
    without = ComLibEmulator(Ramp(), has_adc=False)
    assert codes_of(talk(without, 1, comlib.Format(64, 16, 0xF).encode())) == [
        (1, 0x41), (1, 0x35), (1, 0x37), (2, 0x02), (1, OK),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("endpoint", "payload", "status"),
    [
        (0, b"\x07", 0xFFFF),
        (1, b"\x01", 0xFFFF),
        (1, comlib.encode_number(0x02, 1), 0x05),
        (1, bytes(8).replace(b"\0", b"\x03", 1), 0x03),
        (1, b"\x30\x01", 0x07),
        (1, b"\x32\x02", 0x06),
        (1, comlib.Format(64, 16, 0x10).encode(), 0x06),
        (1, comlib.Format(0, 16, 1).encode(), 0x08),
        (1, comlib.Format(64, 16, 1, 2).encode(), 0x0B),
        (2, comlib.FmcwSettings(55_999_999, 64_000_000, 0, 0).encode(), 0x09),
        (2, comlib.FmcwSettings(57_000_000, 64_000_000, 0, 32).encode(), 0x0A),
        (2, comlib.FmcwSettings(57_000_000, 64_000_000, 2, 0).encode(), 0x20),
        (3, comlib.AdcSettings(3_000_001).encode(), 0x50),
        (3, comlib.AdcSettings(1_000_000, 10).encode(), 0x51),
    ],
)
def test_emulator_refuses_with_the_status_of_the_protocol(endpoint, payload, status):
    assert talk(ComLibEmulator(Ramp()), endpoint, payload) == [comlib.StatusMessage(endpoint, status)]


def test_frame_that_is_not_ready_is_refused_or_held_back():
    # A frame every 100 ms, which takes days of the clock.
    emulator = ComLibEmulator(Ramp(), speed=1e-6)
    talk(emulator, 1, comlib.encode_number(0x02, 100_000))
    assert talk(emulator, 1, b"\x01\x00") == [comlib.StatusMessage(1, 0x02)]
    assert talk(emulator, 1, b"\x01\x01") == []
    # The next request waits behind it.
    assert talk(emulator, 1, b"\x22") == []


def test_frame_comes_when_its_interval_is_over():
    emulator = ComLibEmulator(Ramp(), speed=2.0)
    talk(emulator, 1, comlib.encode_number(0x02, 100_000))
    begin = time.monotonic()
    emulator.receive(comlib.Message(1, b"\x01\x01").encode())
    data = emulator.send(100, 60.0)
    # Half the interval, less what passed before the clock was read.
    assert data
    assert time.monotonic() - begin > 0.02
    assert data[4] == Base.FRAME
