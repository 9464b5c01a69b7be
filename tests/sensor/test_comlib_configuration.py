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
    HostParser,
    Info,
    Message,
    encode_number,
)
from radarcore.sensor.emulator.comlib import ComLibEmulator
from radarcore.sensor.errors import ProtocolError, RequestError, SensorError


def test_board_tells_what_it_is():
    info = ComLibBoard(Pipe(ComLibEmulator(Ramp()))).info
    assert (info.port, info.protocol, info.chip, info.firmware) == ("pipe", "comlib", "BGT60TR24B", "1.0.0")
    assert info.name == "BGT60TR24B radar board, emulated"


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


def test_down_chirp_starts_at_its_upper_frequency():
    emulator = ComLibEmulator(Ramp())
    achieved = ComLibBoard(Pipe(emulator)).configure(radar(start_frequency=63e9, slope=-40e12))
    assert achieved.waveform.start_frequency == 63e9
    assert achieved.waveform.slope == pytest.approx(-40e12, rel=1e-6)
    assert emulator.radar.waveform.slope == pytest.approx(-40e12, rel=1e-6)


def test_ramp_ends_at_the_limit_of_the_board():
    # 100 MHz/us for 54 us from 60 GHz would end at 65.4 GHz: 4 GHz in 54 us are 74 MHz/us.
    achieved = ComLibBoard(Pipe(ComLibEmulator(Ramp()))).configure(radar(start_frequency=60e9, slope=100e12))
    assert achieved.waveform.slope == pytest.approx(4e9 / 54e-6, rel=1e-6)


def test_frame_interval_is_at_least_what_the_chirps_take():
    achieved = ComLibBoard(Pipe(ComLibEmulator(Ramp()))).configure(radar(frame_interval=1e-6))
    # 16 chirps of 54 us.
    assert achieved.waveform.frame_interval == pytest.approx(864e-6, rel=1e-12)


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


def test_oldest_firmware_is_refused_by_name():
    with pytest.raises(SensorError, match=r"pipe: the board speaks the ComLib of 2016/17 .*iRDR"):
        ComLibBoard(Pipe(OtherEndpoints([EndpointType.IRDR])))


def test_board_without_fmcw_is_refused():
    with pytest.raises(SensorError, match="expected an FMCW radar with endpoint RFMC, got RBAS, RDPL"):
        ComLibBoard(Pipe(OtherEndpoints([EndpointType.RBAS, 0x5244504C])))


class Swapped(Pipe):
    """Stream to a board whose endpoints 1 and 2 are numbered the other way round."""

    NUMBERS = (0, 2, 1, 3)

    def __init__(self) -> None:
        super().__init__(OtherEndpoints([EndpointType.RFMC, EndpointType.RBAS, EndpointType.RADX]))
        self.parser = HostParser()
        self.change = self.swap

    def swap(self, data: bytes) -> bytes:
        return b"".join(replace(item, endpoint=self.NUMBERS[item.endpoint]).encode() for item in self.parser.feed(data))

    def write(self, data: bytes, timeout: float) -> None:
        super().write(data[:1] + bytes([self.NUMBERS[data[1]]]) + data[2:], timeout)


def test_endpoints_are_found_by_their_types():
    board = ComLibBoard(Swapped())
    achieved = board.configure(radar())
    assert achieved.waveform.slope == pytest.approx(40e12, rel=1e-6)
    board.start()
    np.testing.assert_array_equal(board.read(60.0)[0].codes, Ramp().frame(radar(), 0, 0.0))


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
    ("lies", "error", "message"),
    [
        ({(1, 0x40): Format(64, 16, 0xF, 2).encode()}, SensorError, "expected real samples .*got signal part 2"),
        ({(1, 0x40): Format(32, 16, 0xF).encode()}, ProtocolError, "the board was set to .*64.* and says .*32"),
        ({(2, 0x00): FmcwSettings(57_000_000, 58_000_000, 2, 0).encode()}, ProtocolError, "the board was set to"),
        (
            {(1, 0x34): encode_number(0x35, 7)},
            ProtocolError,
            "expected the one with more samples to last longer",
        ),
        (
            {(1, 0x34): encode_number(0x37, 7)},
            ProtocolError,
            "expected answer 0x35 of endpoint 1 to 0x34, got none",
        ),
        ({(1, 0x36): b"\x37\0"}, ProtocolError, "pipe: ComLib message: expected 5 bytes, got 2"),
    ],
)
def test_board_that_says_something_else_than_it_was_set_to_is_refused(lies, error, message):
    board = ComLibBoard(Pipe(Lying(lies, has_adc=False)))
    with pytest.raises(error, match=message):
        board.configure(radar())


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (
            Frame(0, np.zeros((4, 16, 63), np.uint16), 0xF).encode(),
            r"expected a frame of \[rx, chirp, sample\] \(4, 16, 64\), got \(4, 16, 63\)",
        ),
        (bytes(18), r"ComLib frame: expected real samples \(data format 0\) of 12 bit, .* got 0, 0, 0"),
    ],
)
def test_frame_of_another_format_than_set_is_refused(frame, message):
    board = ComLibBoard(Pipe(Lying({(1, 0x01): frame})))
    board.configure(radar())
    board.start()
    with pytest.raises(ProtocolError, match=f"^pipe: {message}"):
        board.read(60.0)


def test_board_that_tells_no_duration_of_chirps_is_refused():
    board = ComLibBoard(Pipe(Lying({(1, 0x34): encode_number(0x35, 0)})))
    with pytest.raises(
        ProtocolError, match=r"pipe: expected a sample rate and a duration of chirps, got .* Hz and 0 s"
    ):
        board.configure(radar())


def test_slope_follows_from_the_ramp_where_the_board_does_not_tell():
    board = ComLibBoard(Pipe(Lying({(2, 0x02): encode_number(0x02, 0)})))
    assert board.configure(radar()).waveform.slope == pytest.approx(40e12, rel=1e-6)


def test_board_without_temperature_sensor_says_so():
    info = Info(56_000_000, 64_000_000, 1, 4, 31, 0, 1, 0, 0, 0, "board")
    board = ComLibBoard(Pipe(Lying({(1, 0x22): info.encode()})))
    with pytest.raises(SensorError, match="has no temperature sensor"):
        board.temperature()
