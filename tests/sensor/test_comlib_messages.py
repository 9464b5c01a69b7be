"""ComLib messages: byte examples of the protocol, codes of frames, and parsers of any stream."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from doubles.comlib_boards import FIRMWARE, INFO, described_payload, endpoints_payload, frame_payload
from doubles.small_boards import pieces
from radarcore.sensor.comlib import messages as comlib
from radarcore.sensor.comlib.codes import Base, Direction, EndpointType, status_text
from radarcore.sensor.errors import ProtocolError
from radarcore.sensor.interface import Damage

fuzz = settings(max_examples=50, derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
ENDPOINTS = (EndpointType.RBAS, EndpointType.RFMC, EndpointType.RADX)
FOUR_CODES = np.array([0x123, 0x456, 0x789, 0xABC], np.uint16).reshape(1, 1, 4)


# Byte examples


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("5A 00 01 00 00 DB E0", comlib.Message(0, b"\0")),
        (
            "5A 00 14 00 00 03 53 41 42 52 01 00 43 4D 46 52 01 00 58 44 41 52 01 00 DB E0",
            comlib.Message(0, endpoints_payload(ENDPOINTS)),
        ),
        ("5B 00 00 00", comlib.StatusMessage(0, 0)),
        ("5A 01 02 00 01 01 DB E0", comlib.Message(1, bytes([Base.GET_FRAME, 1]))),
        ("5A 01 0B 00 41 40 00 00 00 10 00 00 00 0F 00 DB E0", comlib.Message(1, comlib.Format(64, 16, 0xF).encode())),
        (
            "5A 02 0B 00 01 40 C0 65 03 00 90 D0 03 00 1F DB E0",
            comlib.Message(2, comlib.FmcwSettings(57_000_000, 64_000_000, Direction.UP, 31).encode()),
        ),
        ("5A 01 05 00 02 50 C3 00 00 DB E0", comlib.Message(1, comlib.encode_number(Base.SET_INTERVAL, 50_000))),
        (
            "5A 01 18 00 00 07 00 00 00 01 00 00 00 01 04 00 00 00 01 00 0C 00 23 61 45 89 C7 AB DB E0",
            comlib.Message(1, frame_payload(7, FOUR_CODES, 1)),
        ),
    ],
)
def test_messages_are_the_bytes_of_the_protocol(text, message):
    assert message.encode() == bytes.fromhex(text)
    assert comlib.Parser().feed(bytes.fromhex(text)) == [message]


def test_records_come_back_as_they_were_sent():
    endpoints = comlib.decode_endpoints(endpoints_payload((*ENDPOINTS, 0x00410A9C)))
    assert [endpoint.letters for endpoint in endpoints] == ["RBAS", "RFMC", "RADX", r"\x00A\x0a\x9c"]
    assert comlib.Firmware.decode(described_payload(FIRMWARE)) == FIRMWARE
    assert comlib.Info.decode(described_payload(INFO)) == INFO
    for record in (
        comlib.Format(256, 31, 5, 2),
        comlib.FmcwSettings(1, 2, 3, 4),
        comlib.AdcSettings(640_000, 12, 1),
        comlib.Temperature(0, -12_345),
    ):
        assert type(record).decode(record.encode()) == record
    assert comlib.decode_number(comlib.encode_number(0x35, 150_000)) == 150_000


def test_status_names_depend_on_the_endpoint():
    assert status_text(0, 2) == "bad start (0x0002)"
    assert status_text(1, 2) == "busy (0x0002)"
    assert status_text(1, 0x7777) == "unknown status (0x7777)"


# Frames


@pytest.mark.parametrize("is_interleaved", [False, True])
def test_frames_of_every_order_are_decoded(is_interleaved):
    codes = np.random.default_rng(1).integers(0, 4096, (3, 2, 5), np.uint16)
    # Chirp by chirp: receivers one after the other, or in turn.
    stream = [int(code) for chirp in codes.transpose(1, 0, 2) for code in (chirp.T if is_interleaved else chirp).flat]
    # 12 bits each, the lowest first: one large number, written from its lowest byte on.
    number = sum(code << 12 * i for i, code in enumerate(stream))
    head = bytes.fromhex("00 09 00 00 00 02 00 00 00 03 05 00 00 00 07 00 0c") + bytes([is_interleaved])
    payload = head + number.to_bytes(-(-len(stream) * 12 // 8), "little")

    frame = comlib.Frame.decode(payload)
    assert frame.number == 9
    np.testing.assert_array_equal(frame.codes, codes)
    assert frame.codes.dtype == np.uint16
    assert frame.codes.flags.c_contiguous
    assert frame_payload(9, codes, 7, is_interleaved=is_interleaved) == payload


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data[:-1], "expected 24 bytes .* got 23"),
        (lambda data: data + b"\0", "expected 24 bytes .* got 25"),
        (lambda data: data[:10], "expected 18 bytes, got 10"),
        (
            lambda data: data[:15] + b"\x03" + data[16:],
            r"expected real samples \(data format 0\) of 12 bit, .* got 3, 12, 0",
        ),
        (lambda data: data[:16] + b"\x00" + data[17:], "got 0, 0, 0"),
        (lambda data: data[:5] + b"\xff\xff\xff\xff" + data[9:], r"expected 25769803788 bytes"),
    ],
)
def test_frame_of_a_wrong_size_is_refused(change, message):
    with pytest.raises(ProtocolError, match=message):
        comlib.Frame.decode(change(frame_payload(7, FOUR_CODES, 1)))


# Parsers

items = st.builds(comlib.Message, st.integers(0, 255), st.binary(max_size=300)) | st.builds(
    comlib.StatusMessage, st.integers(0, 255), st.integers(0, 65535)
)


@fuzz
@given(st.lists(items), st.lists(st.integers(0, 2000)))
def test_every_message_arrives_however_the_stream_is_cut(sent, places):
    parser = comlib.Parser()
    stream = b"".join(item.encode() for item in sent)
    assert [item for piece in pieces(stream, places) for item in parser.feed(piece)] == sent
    assert parser.num_held == 0


def test_host_discards_everything_after_damage_until_silence():
    parser = comlib.Parser()
    status = comlib.StatusMessage(1, 0)
    assert parser.feed(status.encode() + b"\0" + status.encode()) == [status, Damage(5, "bad start (0x0002)", 2)]
    assert parser.feed(status.encode()) == [Damage(4, "bad start (0x0002)")]
    parser.reset()
    assert parser.feed(bytes.fromhex("5a 01 01 00 20 db e1")) == [Damage(7, "bad end marker (0x0007)", 7)]
