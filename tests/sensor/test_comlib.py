"""ComLib: messages against the byte examples of the protocol, and the host against an emulated board."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform
from radarcore.sensor.board import Lost, RawFrame
from radarcore.sensor.comlib.board import ComLibBoard
from radarcore.sensor.comlib.codes import Base, Direction, EndpointType, status_text
from radarcore.sensor.comlib.messages import BoardParser, Damage, HostParser, Message, StatusMessage
from radarcore.sensor.comlib.payloads import (
    AdcSettings,
    Endpoint,
    Firmware,
    FmcwSettings,
    Format,
    Frame,
    Info,
    Reading,
    decode_byte,
    decode_endpoints,
    decode_number,
    encode_byte,
    encode_endpoints,
    encode_number,
    pack_bits,
    unpack_bits,
)
from radarcore.sensor.emulator.comlib import ComLibEmulator
from radarcore.sensor.emulator.peripheral import Unplugged
from radarcore.sensor.errors import (
    ProtocolError,
    RequestError,
    SensorDisconnectedError,
    SensorError,
    SensorTimeoutError,
)

fuzz = settings(derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])

ENDPOINTS = [Endpoint(EndpointType.RBAS), Endpoint(EndpointType.RFMC), Endpoint(EndpointType.RADX)]
FOUR_CODES = np.array([0x123, 0x456, 0x789, 0xABC], np.uint16).reshape(1, 1, 4, 1)

# Byte examples


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("5A 00 01 00 00 DB E0", Message(0, b"\0")),
        (
            "5A 00 14 00 00 03 53 41 42 52 01 00 43 4D 46 52 01 00 58 44 41 52 01 00 DB E0",
            Message(0, encode_endpoints(ENDPOINTS)),
        ),
        ("5B 00 00 00", StatusMessage(0, 0)),
        ("5A 01 02 00 01 01 DB E0", Message(1, encode_byte(Base.GET_FRAME, 1))),
        ("5A 01 0B 00 41 40 00 00 00 10 00 00 00 0F 00 DB E0", Message(1, Format(64, 16, 0xF).encode())),
        (
            "5A 02 0B 00 01 40 C0 65 03 00 90 D0 03 00 1F DB E0",
            Message(2, FmcwSettings(57_000_000, 64_000_000, Direction.UP, 31).encode()),
        ),
        ("5A 01 05 00 02 50 C3 00 00 DB E0", Message(1, encode_number(Base.SET_INTERVAL, 50_000))),
        (
            "5A 01 18 00 00 07 00 00 00 01 00 00 00 01 04 00 00 00 01 00 0C 00 23 61 45 89 C7 AB DB E0",
            Message(1, Frame(7, FOUR_CODES, rx_mask=1).encode()),
        ),
    ],
)
def test_messages_are_the_bytes_of_the_protocol(text, message):
    assert message.encode() == bytes.fromhex(text)
    assert HostParser().feed(bytes.fromhex(text)) == [message]


def test_records_come_back_as_they_were_sent():
    assert decode_endpoints(encode_endpoints(ENDPOINTS)) == ENDPOINTS
    assert [endpoint.letters for endpoint in ENDPOINTS] == ["RBAS", "RFMC", "RADX"]
    for record in (
        Firmware(1, 2, 300, "Position2Go BGT24MTR12 Demo Radar Board"),
        Info(56_000_000, 64_000_000, 2, 4, 31, 1, 1, 2, 0, 1, "board"),
        Format(256, 31, 5, 2),
        FmcwSettings(1, 2, 3, 4),
        AdcSettings(640_000, 12, 1),
    ):
        assert type(record).decode(record.encode()) == record
    reading = Reading(0, -12_345)
    assert Reading.decode(reading.encode(Base.TEMPERATURE)) == reading
    assert decode_number(encode_number(0x35, 150_000)) == 150_000


def test_status_names_depend_on_the_endpoint():
    assert status_text(0, 2) == "bad start byte (0x0002)"
    assert status_text(1, 2) == "busy (0x0002)"
    assert status_text(1, 0x12E) == "FIFO overflow (0x012E)"
    assert status_text(1, 0x7777) == "unknown status (0x7777)"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Message(256, b"").encode(), "endpoint: expected 0 to 255, got 256"),
        (lambda: Message(1, bytes(65536)).encode(), "payload: expected at most 65535 bytes, got 65536"),
        (lambda: Format(-1, 0, 0).encode(), "ComLib frame format: .*-1"),
        (lambda: StatusMessage(0, 65536).encode(), "ComLib status: .*65536"),
    ],
)
def test_what_does_not_fit_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(
    "decode",
    [
        decode_endpoints,
        decode_number,
        decode_byte,
        Firmware.decode,
        Info.decode,
        Format.decode,
        FmcwSettings.decode,
        AdcSettings.decode,
        Reading.decode,
        Frame.decode,
    ],
)
@fuzz
@given(payload=st.binary(max_size=40))
def test_any_payload_is_decoded_or_refused(decode, payload):
    try:
        decode(payload)
    except ProtocolError as error:
        assert str(error).startswith("ComLib ")  # noqa: PT017  # most payloads are refused, not all


# Frames


def in_order_of_the_wire(codes: np.ndarray, *, is_interleaved: bool, data_format: int) -> list[int]:
    """Codes [rx, chirp, sample, part] in the order that the protocol tells, by loops."""
    num_rx, num_chirps, num_samples, _ = codes.shape
    rxs, samples, parts = range(num_rx), range(num_samples), range(2 if data_format else 1)
    stream = []
    for chirp in range(num_chirps):
        if not is_interleaved and data_format == 1:
            order = [(rx, s, part) for rx in rxs for part in parts for s in samples]
        elif not is_interleaved:
            order = [(rx, s, part) for rx in rxs for s in samples for part in parts]
        elif data_format == 1:
            order = [(rx, s, part) for part in parts for s in samples for rx in rxs]
        else:
            order = [(rx, s, part) for s in samples for rx in rxs for part in parts]
        stream += [int(codes[rx, chirp, s, part]) for rx, s, part in order]
    return stream


@pytest.mark.parametrize(("is_interleaved", "data_format"), list(itertools.product([False, True], [0, 1, 2])))
def test_frames_of_every_order_are_decoded(is_interleaved, data_format):
    codes = np.random.default_rng(1).integers(0, 4096, (3, 2, 5, 2 if data_format else 1), np.uint16)
    stream = in_order_of_the_wire(codes, is_interleaved=is_interleaved, data_format=data_format)
    # 12 bits each, the lowest first: one large number, written from its lowest byte on.
    number = sum(code << 12 * i for i, code in enumerate(stream))
    head = bytes.fromhex("00 09 00 00 00 02 00 00 00 03 05 00 00 00 07") + bytes([data_format, 12, is_interleaved])
    payload = head + number.to_bytes(-(-len(stream) * 12 // 8), "little")

    frame = Frame.decode(payload)
    assert (frame.number, frame.rx_mask, frame.data_format, frame.is_interleaved) == (
        9, 7, data_format, is_interleaved,
    )  # fmt: skip
    np.testing.assert_array_equal(frame.codes, codes)
    assert frame.codes.dtype == np.uint16
    assert frame.codes.flags.c_contiguous
    assert frame.encode() == payload


@given(st.integers(1, 16), st.lists(st.integers(0, 65535), max_size=20))
@fuzz
def test_codes_of_any_resolution_are_packed_without_gaps(resolution, numbers):
    codes = np.array(numbers, np.uint16) & np.uint16((1 << resolution) - 1)
    data = pack_bits(codes, resolution)
    assert len(data) == -(-len(numbers) * resolution // 8)
    assert int.from_bytes(data, "little") == sum(int(code) << resolution * i for i, code in enumerate(codes))
    np.testing.assert_array_equal(unpack_bits(data, len(codes), resolution), codes)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data[:-1], "expected 24 bytes .* got 23"),
        (lambda data: data + b"\0", "expected 24 bytes .* got 25"),
        (lambda data: data[:10], "expected 18 bytes, got 10"),
        (lambda data: data[:15] + b"\x03" + data[16:], "expected data format 0 to 2"),
        (lambda data: data[:16] + b"\x00" + data[17:], "1 to 16 bits"),
        (lambda data: data[:5] + b"\xff\xff\xff\xff" + data[9:], r"expected 25769803788 bytes"),
    ],
)
def test_frame_of_a_wrong_size_is_refused(change, message):
    with pytest.raises(ProtocolError, match=message):
        Frame.decode(change(Frame(7, FOUR_CODES, rx_mask=1).encode()))


# Parsers

items = st.builds(Message, st.integers(0, 255), st.binary(max_size=300)) | st.builds(
    StatusMessage, st.integers(0, 255), st.integers(0, 65535)
)
requests = st.builds(Message, st.integers(0, 3), st.binary(min_size=1, max_size=300))
cuts = st.lists(st.integers(0, 2000))


def pieces(data: bytes, places: Sequence[int]) -> list[bytes]:
    places = sorted({0, len(data), *(place % (len(data) + 1) for place in places)})
    return [data[a:b] for a, b in itertools.pairwise(places)]


@fuzz
@given(st.lists(items), cuts)
def test_host_gets_every_message_however_the_stream_is_cut(sent, places):
    parser = HostParser()
    stream = b"".join(item.encode() for item in sent)
    assert [item for piece in pieces(stream, places) for item in parser.feed(piece)] == sent
    assert parser.is_idle


@fuzz
@given(st.lists(requests), cuts)
def test_board_gets_every_request_however_the_stream_is_cut(sent, places):
    parser = BoardParser(3)
    stream = b"".join(item.encode() for item in sent)
    assert [item for piece in pieces(stream, places) for item in parser.feed(piece)] == sent


@fuzz
@given(st.lists(st.binary() | items.map(lambda item: item.encode())), cuts)
def test_no_bytes_upset_the_parsers(parts, places):
    stream = b"".join(parts)
    host, board = HostParser(), BoardParser(3)
    num_used = 0
    for piece in pieces(stream, places):
        for item in host.feed(piece):
            num_used += item.num_bytes if isinstance(item, Damage) else len(item.encode())
        assert len(host._buffer) <= 65541
        board.feed(piece)
        assert len(board._buffer) <= 518
    assert num_used + len(host._buffer) == len(stream)
    # After silence both listen again.
    host.reset()
    board.silence()
    request = Message(1, b"\x22")
    assert host.feed(request.encode()) == board.feed(request.encode()) == [request]


def test_host_discards_everything_after_damage_until_silence():
    parser = HostParser()
    status = StatusMessage(1, 0)
    assert parser.feed(status.encode() + b"\0" + status.encode()) == [status, Damage(5, "byte 0x00 begins no message")]
    assert parser.feed(status.encode()) == [Damage(4, "byte 0x00 begins no message")]
    parser.reset()
    assert parser.feed(bytes.fromhex("5a 01 01 00 20 db e1")) == [
        Damage(7, "message of 1 bytes without its end marker")
    ]


@pytest.mark.parametrize(
    ("text", "status"),
    [
        ("5b", 2),
        ("00", 2),
        ("5a 04 01 00", 3),
        ("5a 01 00 00", 5),
        ("5a 01 01 02", 6),
        ("5a 01 01 00 20 da", 7),
        ("5a 01 01 00 20 db e1", 7),
    ],
)
def test_board_answers_wrong_bytes_once_and_then_discards(text, status):
    parser = BoardParser(3)
    found = [item for byte in bytes.fromhex(text) for item in parser.feed(bytes([byte]))]
    assert found == [StatusMessage(0, status)]
    request = Message(1, b"\x20")
    assert parser.feed(request.encode()) == []
    assert parser.silence() == [StatusMessage(0, 1)]
    assert parser.silence() == []
    assert parser.feed(request.encode()) == [request]


# The emulated board, byte by byte


class Ramp:
    """Source whose codes tell frame, receiver, chirp and sample."""

    def __init__(self) -> None:
        self.calls: list[tuple[Radar, int, float]] = []

    def frame(self, radar: Radar, index: int, time: float) -> np.ndarray:
        self.calls.append((radar, index, time))
        shape = (len(radar.rx), radar.waveform.num_chirps, radar.waveform.num_samples)
        return (np.arange(np.prod(shape), dtype=np.uint16).reshape(shape) + 100 * index) % 4096


class Pipe:
    """Stream to an emulated board in the same process; `change` is applied to what comes from it."""

    name = "pipe"

    def __init__(self, emulator: ComLibEmulator, size: int = 16384) -> None:
        self.emulator = emulator
        self.size = size
        self.change: Callable[[bytes], bytes] = lambda data: data
        self.is_closed = False

    def read(self, size: int, timeout: float) -> bytes:
        try:
            return self.change(self.emulator.send(min(size, self.size), timeout))
        except Unplugged:
            raise SensorDisconnectedError(f"{self.name}: gone") from None

    def write(self, data: bytes, timeout: float) -> None:
        try:
            self.emulator.receive(data)
        except Unplugged:
            raise SensorDisconnectedError(f"{self.name}: gone") from None

    def discard(self) -> None:
        while self.read(65536, 0.0):
            pass

    def close(self) -> None:
        self.is_closed = True


def talk(emulator: ComLibEmulator, endpoint: int, payload: bytes) -> list[Message | StatusMessage]:
    """Everything that a request is answered with."""
    emulator.receive(Message(endpoint, payload).encode())
    return said(emulator)


def said(emulator: ComLibEmulator, timeout: float = 0.0) -> list[Any]:
    parser = HostParser()
    found = []
    while data := emulator.send(7, timeout):
        found += parser.feed(data)
    assert parser.is_idle
    return found


def codes_of(answer: Sequence[Message | StatusMessage]) -> list[tuple[int, int]]:
    return [
        (item.endpoint, item.code if isinstance(item, Message) else -1 - item.status)
        for item in answer
    ]  # fmt: skip


OK = -1


def test_emulator_answers_the_query_with_the_bytes_of_the_protocol():
    emulator = ComLibEmulator(Ramp())
    emulator.receive(bytes.fromhex("5A 00 01 00 00 DB E0"))
    reply = "5A 00 14 00 00 03 53 41 42 52 01 00 43 4D 46 52 01 00 58 44 41 52 01 00 DB E0"
    assert emulator.send(1000, 1.0) == bytes.fromhex(reply) + bytes.fromhex("5B 00 00 00")


def test_emulator_tells_what_follows_from_a_setting():
    emulator = ComLibEmulator(Ramp())
    assert codes_of(talk(emulator, 1, Format(64, 16, 0xF).encode())) == [
        (1, 0x41), (1, 0x35), (1, 0x37), (3, 0x01), (2, 0x02), (1, OK),
    ]  # fmt: skip
    ramp = FmcwSettings(57_000_000, 64_000_000, 0, 31)
    assert codes_of(talk(emulator, 2, ramp.encode())) == [(1, 0x33), (1, 0x33), (2, 0x01), (2, OK)]
    assert codes_of(talk(emulator, 3, AdcSettings(1_000_000).encode())) == [(1, 0x35), (1, 0x37), (3, 0x01), (3, OK)]
    without = ComLibEmulator(Ramp(), has_adc=False)
    assert codes_of(talk(without, 1, Format(64, 16, 0xF).encode())) == [
        (1, 0x41), (1, 0x35), (1, 0x37), (2, 0x02), (1, OK),
    ]  # fmt: skip


def test_emulator_chirp_lasts_as_long_as_the_measured_one():
    emulator = ComLibEmulator(Ramp())
    talk(emulator, 1, Format(256, 16, 0xF).encode())
    (duration, _) = talk(emulator, 1, b"\x34")
    assert decode_number(duration.payload) == 150_000  # 256 samples at 2 MHz: 150 us
    (slope, _) = talk(emulator, 2, b"\x02")
    assert decode_number(slope.payload) == 46_666_667  # 7 GHz in 150 us, in MHz/s


@pytest.mark.parametrize(
    ("endpoint", "payload", "status"),
    [
        (0, b"\x07", 0xFFFF),
        (0, b"\0\0", 0xFFFF),
        (1, b"\x99", 0xFFFF),
        (1, b"\x01", 0xFFFF),
        (1, b"\x01\x01\x01", 0xFFFF),
        (1, encode_number(0x02, 1), 0x05),
        (1, bytes(8).replace(b"\0", b"\x03", 1), 0x03),
        (1, b"\x30\x01", 0x07),
        (1, b"\x32\x02", 0x06),
        (1, Format(64, 16, 0x10).encode(), 0x06),
        (1, Format(64, 16, 0).encode(), 0x06),
        (1, Format(0, 16, 1).encode(), 0x08),
        (1, Format(43679, 1, 1).encode(), 0x08),
        (1, Format(64, 16, 1, 2).encode(), 0x0B),
        (2, FmcwSettings(55_999_999, 64_000_000, 0, 0).encode(), 0x09),
        (2, FmcwSettings(57_000_000, 64_000_001, 0, 0).encode(), 0x09),
        (2, FmcwSettings(57_000_000, 57_000_000, 0, 0).encode(), 0x09),
        (2, FmcwSettings(57_000_000, 64_000_000, 0, 32).encode(), 0x0A),
        (2, FmcwSettings(57_000_000, 64_000_000, 2, 0).encode(), 0x20),
        (3, AdcSettings(3_000_001).encode(), 0x50),
        (3, AdcSettings(1_000_000, 10).encode(), 0x51),
    ],
)
def test_emulator_refuses_with_the_status_of_the_protocol(endpoint, payload, status):
    assert talk(ComLibEmulator(Ramp()), endpoint, payload) == [StatusMessage(endpoint, status)]


def test_emulator_tells_its_driver_and_its_power():
    emulator = ComLibEmulator(Ramp())
    assert talk(emulator, 1, b"\x20") == [Message(1, b"\x21\x01\0\0"), StatusMessage(1, 0)]
    (power, _) = talk(emulator, 1, b"\x32\x01")
    assert Reading.decode(power.payload) == (1, 8400)  # step 31 of 0.4 dB, where 10 is 0 dBm
    with pytest.raises(ValueError, match="sample_rate: expected 20000 to 3000000 Hz, got 4000000"):
        ComLibEmulator(Ramp(), sample_rate=4e6)


def test_largest_frame_fits_into_a_message():
    emulator = ComLibEmulator(Ramp())
    talk(emulator, 1, Format(43678, 1, 1).encode())
    frame, status = talk(emulator, 1, b"\x01\x01")
    assert (len(frame.payload), status) == (65535, StatusMessage(1, 0))


def test_emulator_gives_up_an_incomplete_message_after_silence():
    emulator = ComLibEmulator(Ramp(), resync_timeout=0.05)
    emulator.receive(b"\x5a\x01")
    assert said(emulator) == []
    assert emulator.send(100, 60.0) == StatusMessage(0, 1).encode()
    assert codes_of(talk(emulator, 1, b"\x22")) == [(1, 0x23), (1, OK)]


def test_reset_brings_back_what_power_up_has():
    emulator = ComLibEmulator(Ramp())
    talk(emulator, 1, Format(32, 1, 1).encode())
    assert talk(emulator, 0, b"\x02") == [StatusMessage(0, 0)]
    assert talk(emulator, 1, b"\x40")[0] == Message(1, Format(64, 16, 0xF).encode())


def test_frames_are_not_counted_without_a_trigger():
    emulator = ComLibEmulator(Ramp())
    frames = [Frame.decode(talk(emulator, 1, b"\x01\x01")[0].payload) for _ in range(2)]
    assert [frame.number for frame in frames] == [0, 0]
    talk(emulator, 1, encode_number(0x02, 50_000))
    frames = [Frame.decode(talk(emulator, 1, b"\x01\x01")[0].payload) for _ in range(2)]
    assert [frame.number for frame in frames] == [0, 1]


def test_frame_that_is_not_ready_is_refused_or_held_back():
    # A frame every 100 ms, which takes days of the clock.
    emulator = ComLibEmulator(Ramp(), speed=1e-6)
    talk(emulator, 1, encode_number(0x02, 100_000))
    assert talk(emulator, 1, b"\x01\x00") == [StatusMessage(1, 0x02)]
    assert talk(emulator, 1, b"\x01\x01") == []
    # The next request waits behind it.
    assert talk(emulator, 1, b"\x22") == []


def test_frame_comes_when_its_interval_is_over():
    emulator = ComLibEmulator(Ramp(), speed=2.0)
    talk(emulator, 1, encode_number(0x02, 100_000))
    begin = time.monotonic()
    emulator.receive(Message(1, b"\x01\x01").encode())
    data = emulator.send(100, 60.0)
    # Half the interval, less what passed before the clock was read.
    assert data
    assert time.monotonic() - begin > 0.02
    assert data[4] == Base.FRAME


def test_unplugged_board_wakes_who_waits():
    emulator = ComLibEmulator(Ramp())
    raised = []

    def wait() -> None:
        try:
            emulator.send(1, 600.0)
        except Unplugged as error:
            raised.append(error)

    thread = threading.Thread(target=wait)
    thread.start()
    emulator.unplug()
    thread.join(60.0)
    assert len(raised) == 1
    with pytest.raises(Unplugged):
        emulator.receive(b"")


def test_source_must_give_codes_of_the_frame():
    class Wrong:
        def frame(self, radar: Radar, index: int, time: float) -> np.ndarray:
            return np.zeros((1, 2, 3), np.uint16)

    with pytest.raises(
        ValueError, match=r"frame: expected codes of 12 bit, uint16 \(4, 16, 64\), got uint16 \(1, 2, 3\)"
    ):
        talk(ComLibEmulator(Wrong()), 1, b"\x01\x01")


# The host against the emulated board


def radar(num_rx: int = 4, *, num_tx: int = 1, **waveform: Any) -> Radar:
    values = {
        "start_frequency": 57e9,
        "slope": 40e12,
        "sample_rate": 2e6,
        "num_samples": 64,
        "num_chirps": 16,
        "frame_interval": 0.05,
    }
    return Radar(
        Waveform(**(values | waveform)),
        tx=np.zeros((num_tx, 3)),
        rx=np.zeros((num_rx, 3)),
        receiver=Receiver(output="real", noise_figure_db=12.0),
    )


def board_with(emulator: ComLibEmulator, **options: Any) -> ComLibBoard:
    """Board with short time-outs; those of requests are hang guards."""
    return ComLibBoard(Pipe(emulator, **options), timeout=0.1, board_timeout=0.2)


def test_board_tells_what_it_is():
    info = ComLibBoard(Pipe(ComLibEmulator(Ramp()))).info
    assert (info.port, info.protocol, info.chip, info.firmware) == ("pipe", "comlib", "BGT60TR24B", "1.0.0")
    assert info.name == "BGT60TR24B radar board, emulated"


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


@pytest.mark.parametrize(
    ("wanted", "options", "message"),
    [
        (lambda: radar(num_tx=2), {}, r"tx: expected one antenna, got 2; .*\(RadarSoli\) is not public"),
        (lambda: radar(5), {}, "rx: expected at most 4 antennas.*got 5"),
        (radar, {"rx_mask": 0b111}, "rx_mask: expected 4 receivers, as in rx, got 3"),
        (radar, {"rx_mask": 0x1F}, "rx_mask: expected at most 0xf, got 0x1f"),
        (radar, {"tx_power": 32}, "tx_power: expected 0 to 31, got 32"),
        (lambda: radar(start_frequency=77e9), {}, r"start_frequency: expected 5\.6e\+10 to 6\.4e\+10 Hz"),
        (lambda: radar(start_frequency=64e9), {}, "start_frequency: expected room for a ramp"),
        (
            lambda: radar(num_chirps=3, chirp_times=[0.0, 1e-3, 3e-3]),
            {},
            "waveform: expected chirps at equal intervals",
        ),
    ],
)  # fmt: skip
def test_what_no_setting_comes_near_to_is_refused(wanted, options, message):
    board = ComLibBoard(Pipe(ComLibEmulator(Ramp())))
    with pytest.raises(ValueError, match=message):
        board.configure(wanted(), **options)


def test_refusal_of_the_board_is_told_in_words():
    board = ComLibBoard(Pipe(ComLibEmulator(Ramp())))
    with pytest.raises(
        RequestError, match=r"pipe: endpoint 1 refused a request: unsupported frame format \(0x0008\)"
    ) as refused:
        board.configure(radar(num_samples=4096, num_chirps=64, frame_interval=None))
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
        ComLibBoard(Pipe(OtherEndpoints([EndpointType.RBAS, EndpointType.RDPL])))


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
            return super()._set_format(form._replace(signal_part=form.signal_part ^ 2))

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
        ({(1, 0x36): b"\x37\0"}, ProtocolError, "ComLib message: expected 5 bytes, got 2"),
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
            Frame(0, np.zeros((4, 16, 63, 1), np.uint16), 0xF),
            r"expected a real frame .*\(4, 16, 64\), got \(4, 16, 63\)",
        ),
        (Frame(0, np.zeros((4, 16, 64, 2), np.uint16), 0xF, 1), "of data format 1"),
        (Frame(0, np.zeros((4, 16, 64, 1), np.uint16), 0xF, 0, 14), "expected samples of 12 bit, got 14"),
    ],
)
def test_frame_of_another_format_than_set_is_refused(frame, message):
    board = ComLibBoard(Pipe(Lying({(1, 0x01): frame.encode()})))
    board.configure(radar())
    board.start()
    with pytest.raises(ProtocolError, match=message):
        board.read(60.0)


def test_slope_follows_from_the_ramp_where_the_board_does_not_tell():
    board = ComLibBoard(Pipe(Lying({(2, 0x02): encode_number(0x02, 0)})))
    assert board.configure(radar()).waveform.slope == pytest.approx(40e12, rel=1e-6)


def test_board_without_temperature_sensor_says_so():
    info = Info(56_000_000, 64_000_000, 1, 4, 31, 0, 1, 0, 0, 0, "board")
    board = ComLibBoard(Pipe(Lying({(1, 0x22): info.encode()})))
    with pytest.raises(SensorError, match="has no temperature sensor"):
        board.temperature()


def test_temperature_is_that_of_the_chip():
    emulator = ComLibEmulator(Ramp(), temperature=-3.25)
    board = ComLibBoard(Pipe(emulator))
    assert board.temperature() == pytest.approx(-3.25, abs=1e-9)


def test_temperature_told_with_a_frame_is_no_frame():
    emulator = ComLibEmulator(Ramp())
    board = ComLibBoard(Pipe(emulator))
    board.configure(radar())
    board.start()
    emulator.temperature = 50.0
    (frame,) = board.read(60.0)
    assert isinstance(frame, RawFrame)


class Stepped(ComLibEmulator):
    """Board whose time goes on by hand."""

    now = 0.0

    def _now(self) -> float:
        return self.now


def test_frames_that_were_over_are_reported():
    emulator = Stepped(Ramp(), speed=1.0)
    board = ComLibBoard(Pipe(emulator))
    board.configure(radar())
    board.start()
    emulator.now = 0.06  # [s], an interval takes 50 ms
    (first,) = board.read(60.0)
    emulator.now = 10.0
    lost, second = board.read(60.0)
    assert isinstance(lost, Lost)
    assert first.index == 0
    assert second.index == 1 + lost.num_frames > 100


def test_late_frame_is_that_of_the_next_read():
    emulator = Stepped(Ramp(), speed=1.0)
    board = ComLibBoard(Pipe(emulator))
    board.configure(radar())
    board.start()
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


def test_other_threads_get_in_between_frames():
    board = ComLibBoard(Pipe(ComLibEmulator(Ramp())))
    board.configure(radar())
    board.start()
    indices: list[int] = []
    is_over = threading.Event()

    def read() -> None:
        while not is_over.is_set():
            indices.extend(frame.index for frame in board.read(60.0))

    thread = threading.Thread(target=read)
    thread.start()
    temperatures = [board.temperature() for _ in range(20)]
    is_over.set()
    thread.join(60.0)
    board.close()
    assert temperatures == pytest.approx([40.0] * 20)
    assert indices == list(range(len(indices)))


def test_host_finds_step_again_after_damage():
    emulator = ComLibEmulator(Ramp(), resync_timeout=0.05)
    board = board_with(emulator)
    board.configure(radar())
    board.start()
    pipe = board._stream
    (frame,) = board.read(60.0)
    assert frame.index == 0
    pipe.change = lambda data: b"\x11" + data
    with pytest.raises(ProtocolError, match="pipe: not ComLib: byte 0x11 begins no message"):
        board.read(60.0)
    pipe.change = lambda data: data
    lost, frame = board.read(60.0)
    assert (lost.num_frames, frame.index) == (1, 2)


def test_host_waits_for_a_board_that_has_lost_step():
    emulator = ComLibEmulator(Ramp(), resync_timeout=0.3)
    board = ComLibBoard(Pipe(emulator), timeout=0.2, board_timeout=60.0)
    emulator.receive(b"\xc0")
    begin = time.monotonic()
    with pytest.raises(RequestError, match=r"bad start byte \(0x0002\)"):
        board.temperature()
    assert board.temperature() == pytest.approx(40.0)
    # The board says when it listens again; it is not waited for as long as others may take.
    assert time.monotonic() - begin < 30.0


def test_board_that_was_left_half_way_is_opened():
    emulator = ComLibEmulator(Ramp(), resync_timeout=0.05)
    # Another program has sent half a request; its rest is taken from the first of ours.
    emulator.receive(bytes.fromhex("5a 01 02 00"))
    assert board_with(emulator).temperature() == pytest.approx(40.0)


def test_silence_is_no_comlib():
    class Silent(ComLibEmulator):
        def receive(self, data: bytes) -> None:
            pass

    with pytest.raises(SensorTimeoutError, match=r"pipe: no answer in 0\.1 s"):
        board_with(Silent(Ramp()))


def test_endless_noise_is_no_comlib():
    class Noise(ComLibEmulator):
        def send(self, size: int, timeout: float) -> bytes:
            time.sleep(0.001)
            return b"\xd3" * size

    with pytest.raises(SensorTimeoutError, match="pipe: the line is never silent"):
        ComLibBoard(NoDiscard(Noise(Ramp())), timeout=0.02, board_timeout=0.05)


class NoDiscard(Pipe):
    """Stream whose discarding ends early, as that of a port does."""

    def discard(self) -> None:
        self.read(65536, 0.0)


def test_unplugged_board_is_disconnected_and_can_be_closed():
    emulator = ComLibEmulator(Ramp())
    board = ComLibBoard(Pipe(emulator))
    board.configure(radar())
    board.start()
    emulator.unplug()
    with pytest.raises(SensorDisconnectedError):
        board.read(60.0)
    board.close()
    board.close()
    assert board._stream.is_closed


def test_close_stops_the_board():
    emulator = ComLibEmulator(Ramp())
    board = ComLibBoard(Pipe(emulator))
    board.configure(radar())
    board.start()
    board.close()
    assert board._stream.is_closed
    assert emulator._interval == 0
