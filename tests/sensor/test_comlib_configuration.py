"""ComLib boards configured for a radar: what they come near to, and boards that are refused."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from doubles.comlib_boards import Pipe, Ramp, radar
from radarcore.sensor.comlib.board import ComLibBoard
from radarcore.sensor.comlib.codes import EndpointType
from radarcore.sensor.comlib.messages import (
    Endpoint,
    FmcwSettings,
    Format,
    Frame,
    Info,
    Message,
    encode_number,
)
from radarcore.sensor.emulator.comlib import ComLibEmulator
from radarcore.sensor.errors import ProtocolError, RequestError, SensorError


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
        self._endpoints = [Endpoint(kind) for kind in types]


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
        def _set_format(self, form: Format) -> list[Message]:
            return super()._set_format(replace(form, signal_part=form.signal_part ^ 2))

    board = ComLibBoard(Pipe(Complex(Ramp())))
    with pytest.raises(RequestError, match=r"signal part not available .*the board has no real samples"):
        board.configure(radar())


class Lying(ComLibEmulator):
    """Board that answers some requests to RBAS and RFMC, by endpoint and code, with what is given."""

    def __init__(self, lies: dict[tuple[int, int], bytes], **options: Any) -> None:
        super().__init__(Ramp(), **options)
        self.lies = lies

    def _base(self, payload: bytes) -> list[Message]:
        return self.lie(1, payload, super()._base)

    def _fmcw(self, payload: bytes) -> list[Message]:
        return self.lie(2, payload, super()._fmcw)

    def lie(self, endpoint: int, payload: bytes, truth: Callable[[bytes], list[Message]]) -> list[Message]:
        lie = self.lies.get((endpoint, payload[0]))
        return truth(payload) if lie is None else [Message(endpoint, lie)]


@pytest.mark.parametrize(
    ("lies", "has_adc", "error", "message"),
    [
        ({(1, 0x40): Format(64, 16, 0xF, 2).encode()}, False, SensorError, "real samples .*got signal part 2"),
        ({(1, 0x40): Format(32, 16, 0xF).encode()}, False, ProtocolError, "was set to .*64.* and says .*32"),
        (
            {(2, 0x00): FmcwSettings(57_000_000, 58_000_000, 2, 0).encode()},
            False,
            ProtocolError,
            "the board was set to",
        ),
        (
            {(1, 0x34): encode_number(0x35, 7)},
            False,
            ProtocolError,
            "expected the one with more samples to last",
        ),
        (
            {(1, 0x34): encode_number(0x35, 0)},
            True,
            ProtocolError,
            "expected a sample rate and a duration",
        ),
        ({(1, 0x34): encode_number(0x37, 7)}, False, ProtocolError, "answer 0x35 .* to 0x34, got none"),
        ({(1, 0x36): b"\x37\0"}, False, ProtocolError, "pipe: ComLib message: expected 5 bytes, got 2"),
        (
            {(1, 0x01): Frame(0, np.zeros((4, 16, 63), np.uint16), 0xF).encode()},
            False,
            ProtocolError,
            r"^pipe: expected a frame of \[rx, chirp, sample\] \(4, 16, 64\), got \(4, 16, 63\)",
        ),
        ({(1, 0x01): bytes(18)}, False, ProtocolError, r"^pipe: ComLib frame: expected real samples .* got 0, 0, 0"),
        (
            {(1, 0x22): Info(56_000_000, 64_000_000, 1, 4, 31, 0, 1, 0, 0, 0, "board").encode()},
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
    board = ComLibBoard(Pipe(Lying({(2, 0x02): encode_number(0x02, 0)})))
    assert board.configure(radar()).waveform.slope == pytest.approx(40e12, rel=1e-6)
