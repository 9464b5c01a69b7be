"""ComLib boards configured for a radar: their nearest settings, and unsupported boards."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from doubles.boards import number_of
from doubles.comlib_boards import ALL, INFO, NO_ADC, ComLibDouble, board_of, described_payload, frame_payload, radar
from radarcore.sensor.comlib.board import ComLibBoard
from radarcore.sensor.comlib.codes import EndpointType
from radarcore.sensor.comlib.messages import AdcSettings, FmcwSettings, Format, encode_number
from radarcore.sensor.errors import (
    ProtocolError,
    RequestError,
    SensorDisconnectedError,
    SensorError,
    SensorTimeoutError,
)


def test_board_tells_what_it_is():
    info = board_of().info
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
    achieved = board_of().configure(radar(**wanted)).waveform
    assert getattr(achieved, name) == pytest.approx(value, rel=1e-6)


def test_configured_radar_is_the_one_of_the_board():
    double = ComLibDouble()
    board = board_of(double)
    achieved = board.configure(radar(2, sample_rate=1e6), rx_mask=0b1010, tx_power=10)
    board.start()
    # 64 samples at 1 MHz and 22 us; slopes in whole MHz/s of ramps in whole kHz.
    assert double.ramp == FmcwSettings(57_000_000, 60_440_000, 0, 10)
    assert (double.adc.sample_rate, double.form, double.interval) == (1_000_000, Format(64, 16, 0b1010), 50_000)
    wave = achieved.waveform
    assert (wave.start_frequency, wave.sample_rate, wave.num_samples, wave.num_chirps) == (57e9, 1e6, 64, 16)
    assert wave.slope == pytest.approx(40e12, rel=1e-6)
    assert (wave.chirp_interval, wave.adc_delay) == pytest.approx((86e-6, 11e-6), rel=1e-12)
    assert wave.frame_interval == 0.05
    assert achieved.is_real
    assert (len(achieved.rx), achieved.receiver.noise_figure_db) == (2, 12.0)


def test_sample_rate_of_a_board_without_adc_endpoint_is_measured():
    for num_samples in (63, 64, 200):
        double = ComLibDouble(types=NO_ADC)
        double.adc = AdcSettings(1_700_000)
        board = board_of(double)
        achieved = board.configure(radar(sample_rate=1.7e6, num_samples=num_samples))
        assert (achieved.waveform.sample_rate, achieved.waveform.num_samples) == (1.7e6, num_samples)
        message = r"sample_rate: expected 1\.7e\+06 Hz.*got 2e\+06; the endpoint .*\(RadarSoli\) is not public"
        with pytest.raises(ValueError, match=message):
            board.configure(radar(num_samples=num_samples))
        # Half of a setting is not measured with.
        with pytest.raises(SensorError, match="not configured"):
            board.start()


@pytest.mark.parametrize(
    ("types", "message"),
    [
        ((EndpointType.IRDR,), r"pipe: the board speaks the ComLib of 2016/17 .*iRDR"),
        ((EndpointType.RBAS, 0x5244504C), "expected an FMCW radar with endpoint RFMC, got RBAS, RDPL"),
    ],
)
def test_boards_with_other_endpoints_are_refused_by_name(types, message):
    with pytest.raises(SensorError, match=message):
        board_of(ComLibDouble(types=types))


@pytest.mark.parametrize(
    ("request_of", "answer", "types", "error", "message"),
    [
        ((1, 0x41), 0x08, NO_ADC, RequestError, r"pipe: endpoint 1 refused a request: unsupported format \(0x0008\)"),
        ((1, 0x41), 0x0B, NO_ADC, RequestError, "signal part not available .*the board has no real samples"),
        ((1, 0x40), Format(64, 16, 0xF, 2).encode(), NO_ADC, SensorError, "real samples .*got signal part 2"),
        ((1, 0x40), Format(32, 16, 0xF).encode(), NO_ADC, ProtocolError, "was set to .*64.* and says .*32"),
        ((2, 0x00), FmcwSettings(57_000_000, 58_000_000, 2, 0).encode(), NO_ADC, ProtocolError, "board was set to"),
        ((1, 0x34), encode_number(0x35, 7), NO_ADC, ProtocolError, "expected more samples to last longer"),
        ((1, 0x34), encode_number(0x37, 7), NO_ADC, ProtocolError, "answer 0x35 .* to 0x34, got none"),
        ((1, 0x36), b"\x37\0", NO_ADC, ProtocolError, "pipe: ComLib message: expected 5 bytes, got 2"),
        ((1, 0x01), bytes(18), NO_ADC, ProtocolError, "^pipe: ComLib frame: expected real samples .* got 0, 0, 0"),
        (
            (1, 0x01),
            frame_payload(0, np.zeros((4, 16, 63), np.uint16), 0xF),
            NO_ADC,
            ProtocolError,
            r"^pipe: expected a frame of \[rx, chirp, sample\] \(4, 16, 64\), got \(4, 16, 63\)",
        ),
        (
            (1, 0x22),
            described_payload(replace(INFO, num_sensors=0)),
            NO_ADC,
            SensorError,
            "has no temperature sensor",
        ),
        ((1, 0x34), encode_number(0x35, 0), ALL, ProtocolError, "expected a sample rate and a duration"),
        ((3, 0x01), 0x50, ALL, RequestError, "sample rate out of range"),
    ],
)
def test_board_that_refuses_or_says_something_else_than_it_was_set_to_is_told(
    request_of, answer, types, error, message
):
    board = board_of(ComLibDouble(types=types, other_answers={request_of: answer}))
    with pytest.raises(error, match=message) as caught:
        measured_once(board)
    if isinstance(answer, int):
        assert caught.value.status == answer


def measured_once(board: ComLibBoard) -> None:
    board.configure(radar())
    board.start()
    board.read(60.0)
    board.temperature()


def test_slope_follows_from_the_ramp_where_the_board_does_not_tell():
    board = board_of(ComLibDouble(other_answers={(2, 0x02): encode_number(0x02, 0)}))
    assert board.configure(radar()).waveform.slope == pytest.approx(40e12, rel=1e-6)


# Boards that measure


def test_frames_come_as_they_were_sent():
    board = board_of(size=64)
    board.configure(radar(3))
    board.start()
    frames = [item for _ in range(3) for item in board.read(60.0)]
    board.stop()
    assert [(frame.index, number_of(frame.codes)) for frame in frames] == [(0, 0), (1, 1), (2, 2)]
    assert (frames[0].codes.shape, frames[0].codes.dtype) == ((3, 16, 64), np.uint16)


class Clock:
    """Time advanced by hand [s]."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def started(clock: Clock | None = None) -> ComLibBoard:
    """A board that measures, with an interval of 50 ms."""
    board = board_of(ComLibDouble(clock=clock))
    board.configure(radar())
    board.start()
    return board


def test_frames_that_were_over_are_reported():
    clock = Clock()
    board = started(clock)
    clock.now = 0.06
    (first,) = board.read(60.0)
    clock.now = 10.0
    (second,) = board.read(60.0)
    assert (first.index, first.lost_reasons) == (0, ())
    assert second.index > 100
    assert second.lost_reasons == (f"between frames 0 and {second.index} of the board: asked for late, or damaged",)


def test_late_frame_is_that_of_the_next_read():
    clock = Clock()
    board = started(clock)
    assert board.read(0.0) == []
    clock.now = 0.06
    (frame,) = board.read(0.0)
    assert frame.index == 0
    # The temperature is asked for once the frame has come; no frame gets lost by that.
    assert board.read(0.0) == []
    clock.now = 0.11
    assert board.temperature() == pytest.approx(40.0)
    (frame,) = board.read(0.0)
    assert frame.index == 1


def test_stop_and_start_count_from_zero():
    clock = Clock()
    board = started(clock)
    board.stop()
    for _ in range(2):
        board.start()
        clock.now += 0.06
        assert board.read(0.0)[0].index == 0
        assert board.read(0.0) == []
        clock.now += 0.06
        board.stop()
        with pytest.raises(SensorError, match="not measuring"):
            board.read(0.0)


def test_frame_that_never_comes_does_not_hold_up_the_board_for_ever():
    # The board does not even answer what is asked behind it.
    clock = Clock()
    board = board_of(ComLibDouble(clock=clock), timeout=0.05, board_timeout=0.05)
    board.configure(radar(frame_interval=0.01))
    board.start()
    assert board.read(0.0) == []
    with pytest.raises(SensorTimeoutError, match="pipe: no answer"):
        board.temperature()
    clock.now = 1.0
    assert board.temperature() == pytest.approx(40.0)
    board.stop()


def test_host_finds_step_again_after_damage():
    board = board_of(timeout=0.1, board_timeout=0.2)
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
    double = ComLibDouble()
    double.patience = 0.1
    board = board_of(double, timeout=0.05, board_timeout=60.0)
    double.receive(b"\xc0")
    begin = time.monotonic()
    with pytest.raises(RequestError, match=r"bad start \(0x0002\)"):
        board.temperature()
    assert board.temperature() == pytest.approx(40.0)
    # The board says when it listens again; it is not waited for as long as others may take.
    assert time.monotonic() - begin < 30.0


def test_board_that_was_left_half_way_is_opened():
    double = ComLibDouble()
    double.patience = 0.05
    # Another program has sent half a request; its rest is taken from the first of ours.
    double.receive(bytes.fromhex("5a 01 02 00"))
    assert board_of(double, timeout=0.1, board_timeout=0.2).temperature() == pytest.approx(40.0)


class Silent(ComLibDouble):
    def receive(self, data: bytes) -> None:
        pass


class Noise(ComLibDouble):
    def send(self, size: int, timeout: float) -> bytes:
        time.sleep(0.001)
        return b"\xd3" * size


@pytest.mark.parametrize(("kind", "message"), [(Silent, r"no answer in 0\.05 s"), (Noise, "the line is never silent")])
def test_silence_and_endless_noise_are_no_comlib(kind, message):
    with pytest.raises(SensorTimeoutError, match=f"pipe: {message}"):
        board_of(kind(), timeout=0.05, board_timeout=0.05)


def test_unplugged_board_is_disconnected_and_can_be_closed():
    board = started()
    board._stream.board.is_gone = True
    with pytest.raises(SensorDisconnectedError):
        board.read(60.0)
    board.close()
    board.close()
    assert board._stream.is_closed
