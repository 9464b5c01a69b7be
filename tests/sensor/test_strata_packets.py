"""Strata packets against the byte examples of the protocol, and against rubbish."""

from __future__ import annotations

import random
import struct
import tracemalloc
from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from doubles.small_boards import pieces
from radarcore.sensor.emulator.strata import slice_size_of
from radarcore.sensor.errors import RequestError
from radarcore.sensor.interface import Damage
from radarcore.sensor.strata import packets as strata
from radarcore.sensor.strata.packets import (
    Avian,
    Code,
    Component,
    Data,
    DataPacket,
    Info,
    Kind,
    Request,
    Response,
    Status,
)
from radarcore.sensor.strata.slices import Slice, SliceAssembler, SliceLost, StreamError
from radarcore.sensor.strata.stream import BoardParser, HostParser

# Equal examples in every run: one in 65536 false packets has a good CRC, and no such one is among them.
fuzz = settings(max_examples=50, derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])

REQUESTS = {
    "c0 80 01 00 00 00 10 00 d7 45": Request.read(Code.BOARD_INFO, Info.VERSION, 0, 16),
    "43 80 00 00 00 00 00 00 a4 62": Request.transfer(Code.BOARD_INFO, Info.NAME, 0),
    "43 20 03 01 30 01 04 00 04 00 00 00 9e 5d": Request.transfer(
        Code.COMPONENT, Component.AVIAN, Avian.EXECUTE, strata.encode_commands([0x04000000])
    ),
    "40 0d 01 00 00 00 0c 00 10 00 00 00 00 00 00 00 60 00 00 18 56 af": Request.write(
        Code.DATA, Data.CONFIGURE, 0, strata.data_configuration(6144)
    ),
}

ANSWERS = {
    "c0 00 10 00 02 00 06 00 00 00 00 00 04 00 00 00 00 00 00 00 97 b2": Response(
        Kind.READ, 0, strata.Version(2, 6, 0).encode()
    ),
    "40 00 00 00 ea 5c": Response(Kind.WRITE, Status.SUCCESS),
    "43 00 04 00 03 03 00 f0 24 a9": Response(Kind.TRANSFER, 0, strata.encode_values([0xF0000303])),
    "40 8b 00 00 21 f7": Response(Kind.WRITE, Status.BAD_PAYLOAD),
    "df 00 01 00 0c 00 07 00 00 00 40 e2 01 00 00 00 00 00 d7 bf": DataPacket(
        b"", 1, timestamp=123456, error=Status.OVERFLOW
    ),
    "d3 00 00 00 06 00 12 34 56 78 9a bc e7 4c": DataPacket(bytes.fromhex("123456789abc"), 0),
}


def encode(answer: Response | DataPacket) -> bytes:
    return strata.encode_data(answer) if isinstance(answer, DataPacket) else strata.encode_response(answer)


def feed_all(parser: Any, parts: Sequence[bytes]) -> list[Any]:
    found = []
    for part in parts:
        found += parser.feed(part)
        assert parser.num_held == len(parser._buffer) <= parser._largest
    return found


def good(found: Sequence[Any]) -> list[Any]:
    return [item for item in found if not isinstance(item, Damage)]


def num_damaged(found: Sequence[Any]) -> int:
    return sum(item.num_bytes for item in found if isinstance(item, Damage))


# Byte examples


def test_crc_is_ccitt_false():
    assert strata.crc(b"123456789") == 0x29B1


@pytest.mark.parametrize(("text", "request_"), REQUESTS.items())
def test_requests_are_the_bytes_of_the_protocol(text, request_):
    assert strata.encode_request(request_).hex(" ") == text
    assert BoardParser().feed(bytes.fromhex(text)) == [request_]


@pytest.mark.parametrize(("text", "answer"), ANSWERS.items())
def test_answers_are_the_bytes_of_the_protocol(text, answer):
    assert encode(answer).hex(" ") == text
    assert HostParser().feed(bytes.fromhex(text)) == [answer]


def test_bulk_packet_is_the_same_without_crc():
    for text, packet in ANSWERS.items():
        if isinstance(packet, DataPacket):
            data = bytes.fromhex(text)[:-2]
            assert strata.encode_data(packet, with_crc=False) == data
            assert strata.decode_data(data) == packet


def test_identity_of_a_board():
    info = bytes.fromhex("8b 05 51 02") + b"Radar Baseboard MCU7\0"
    assert strata.encode_board_info(0x058B, 0x0251, "Radar Baseboard MCU7") == info
    assert strata.decode_board_info(info) == (0x058B, 0x0251, "Radar Baseboard MCU7")
    version = strata.Version.decode(bytes.fromhex("02 00 06 00 00 00 00 00 04 00 00 00 00 00 00 00"))
    assert (version.firmware, version.protocol_major, version.protocol_minor) == ("2.6.0", 4, 0)
    assert strata.uuid_text(bytes(range(16))) == "00010203-0405-0607-0809-0a0b0c0d0e0f"


def test_status_has_a_name_and_a_number():
    assert strata.status_text(0x84) == "CRC error (0x84)"
    assert strata.status_text(0x8B) == "bad payload (0x8B)"
    assert strata.status_text(0x012E) == "FIFO overflow (0x12E)"
    assert strata.status_text(0x33) == "unknown status (0x33)"


# Data packets


def test_timestamp_of_a_packet_that_is_not_the_last_is_samples():
    packet = strata.decode_data(bytes.fromhex("d5 00 00 00 08 00 01 02 03 04 05 06 07 08"))
    assert packet == DataPacket(bytes(range(1, 9)), 0, is_first=True, is_last=False)


def test_error_of_another_length_than_4_is_a_text():
    packet = DataPacket(b"", 9, error="sensor lost")
    assert strata.encode_data(packet, with_crc=False) == b"\xdb\x00\x09\x00\x0b\x00sensor lost"
    assert strata.decode_data(b"\xdb\x00\x09\x00\x0c\x00sensor lost\0") == packet


# Packets that do not fit


@pytest.mark.parametrize(
    ("payload", "status"),
    [
        ("10 00 00 00 00 00 00 00 60 00 02 40", 0x07),
        ("", 0x02),
        ("10 00 00 00 00 00 00 00 60 00 00", 0x02),
        ("10 00 00 00 00 00 00 00 60 00 00 18 60 00 00 18", 0x02),
        ("10 00 00 00 00 00 00 00", 0x03),
        ("10 00 00 00 00 00 00 00 00 01 00 18", 0x03),
        ("10 00 00 00 00 00 00 00 60 00 01 18", 0x03),
        ("10 00 00 00 00 00 00 00 60 00 00 00", 0x03),
        ("11 00 00 00 00 00 00 00 60 00 00 18", 0x03),
    ],
)
def test_data_configuration_is_refused_with_the_status_of_a_board(payload, status):
    with pytest.raises(RequestError) as refused:
        slice_size_of(bytes.fromhex(payload))
    assert refused.value.status == status


# Parsers

responses = st.builds(
    Response, st.sampled_from([Kind.WRITE, Kind.READ, Kind.TRANSFER]), st.integers(0, 255), st.binary(max_size=300)
)
packets = st.builds(
    DataPacket,
    st.binary(max_size=300),
    st.integers(0, 65535),
    st.integers(0, 255),
    is_first=st.booleans(),
    timestamp=st.none() | st.integers(0, 2**64 - 1),
)
answers = responses | packets
numbers = st.integers(0, 65535)
requests = (
    st.builds(Request.read, st.integers(0, 255), numbers, numbers, numbers)
    | st.builds(Request.write, st.integers(0, 255), numbers, numbers, st.binary(max_size=300))
    | st.builds(Request.transfer, st.integers(0, 255), numbers, numbers, st.binary(max_size=300))
)
START_BYTES = (0x40, 0x43, 0xC0, *range(0xD0, 0xE0))
rubbish = st.lists(st.sampled_from([byte for byte in range(256) if byte not in START_BYTES]), max_size=50).map(bytes)
cuts = st.lists(st.integers(0, 5000))


@fuzz
@given(st.lists(st.tuples(rubbish, answers)), rubbish, cuts)
def test_host_gets_every_packet_between_rubbish(sent, tail, places):
    stream = b"".join(noise + encode(answer) for noise, answer in sent) + tail
    found = feed_all(HostParser(), pieces(stream, places))
    assert good(found) == [answer for _, answer in sent]
    assert num_damaged(found) == sum(len(noise) for noise, _ in sent) + len(tail)


@fuzz
@given(st.lists(st.tuples(rubbish, requests)), cuts)
def test_board_gets_every_request_between_rubbish(sent, places):
    stream = b"".join(noise + strata.encode_request(request) for noise, request in sent)
    found = feed_all(BoardParser(), pieces(stream, places))
    assert good(found) == [request for _, request in sent]
    # One status for every time that the stream goes wrong: as often as rubbish comes.
    damage = [item for item in found if isinstance(item, Damage)]
    assert [item.status for item in damage if item.status] == [0x85 for noise, _ in sent if noise]


@fuzz
@given(st.lists(answers, max_size=3), answers, st.lists(answers, max_size=3), st.data())
def test_flipped_bits_lose_no_packet_but_their_own(before, hit, after, data):
    bits = bytearray(encode(hit))
    for _ in range(data.draw(st.integers(1, 3))):
        bit = data.draw(st.integers(0, 8 * len(bits) - 1))
        bits[bit // 8] ^= 1 << bit % 8
    stream = b"".join(map(encode, before)) + bits + b"".join(map(encode, after))
    # The damaged packet may claim more than comes: after a while that is no longer believed.
    parser = HostParser()
    found = good(feed_all(parser, pieces(stream, data.draw(cuts))) + parser.doubt())
    wanted = [*before, *after]
    if bytes(bits) == encode(hit):
        wanted.insert(len(before), hit)
    assert found == wanted


def test_false_header_does_not_hold_up_a_packet_behind_it():
    # A byte that begins no packet puts the parser out of step; 0xd3 then claims 4087 bytes.
    false = bytes.fromhex("00 d3 00 00 00 f0 0f")
    answer = Response(Kind.WRITE, 0)
    assert good(HostParser().feed(false + encode(answer))) == [answer]
    parser = HostParser()
    assert feed_all(parser, [false[:3], false[3:], encode(answer)[:4]]) == [
        Damage(1, "bytes before the first whole packet", Status.REQUEST_TYPE_INVALID)
    ]
    assert good(parser.feed(encode(answer)[4:])) == [answer]


def test_packet_within_reach_of_two_false_headers_is_found():
    answer = Response(Kind.READ, 0, b"answer")
    for claim in (20, 40, 4080):
        false = b"\x00\xd3\x00\x00\x00" + struct.pack("<H", claim) + b"\x40\x00" + struct.pack("<H", claim)
        stream = false + encode(answer) + encode(answer)
        assert good(feed_all(HostParser(), [stream[i : i + 1] for i in range(len(stream))])) == [answer, answer]


@pytest.mark.parametrize("size", [4088, 12288, 65527])
@pytest.mark.parametrize("is_in_step", [True, False])
def test_packets_may_have_any_length_of_16_bits(size, is_in_step):
    packet = DataPacket(random.Random(size).randbytes(size), 3, timestamp=77)
    before = [Response(Kind.WRITE, 0)] if is_in_step else []
    stream = b"".join(map(encode, [*before, packet, packet]))
    parts = [stream[i : i + 1000] for i in range(0, len(stream), 1000)]
    assert feed_all(HostParser(), parts) == [*before, packet, packet]
    assert strata.decode_data(strata.encode_data(packet, with_crc=False)) == packet


def test_packet_that_is_slow_is_still_taken_where_it_was_doubted():
    packet = DataPacket(bytes(20_000), 0)
    data, answer = encode(packet), Response(Kind.WRITE, 0)
    parser = HostParser()
    assert parser.feed(encode(answer) + data[:9000]) == [answer]
    assert parser.num_held == 9000
    assert parser.doubt() == []
    assert parser.feed(data[9000:]) == [packet]


def test_packets_behind_one_that_claims_too_much_come_with_the_doubt():
    packet, answer = DataPacket(bytes(500), 7), Response(Kind.WRITE, 0)
    false = bytes.fromhex("d3 00 00 00 ff ff 01 02")
    parser = HostParser()
    assert feed_all(parser, [encode(answer), false, encode(packet), encode(answer)]) == [answer]
    damage, *found = parser.doubt()
    assert found == [packet, answer]
    assert damage == Damage(len(false), "packet that never became whole", Status.PAYLOAD_INCOMPLETE)
    assert parser.doubt() == []


def test_damage_tells_its_status_once():
    request = Request.write(Code.DATA, Data.START, 0)
    bad = bytearray(strata.encode_request(request))
    bad[-1] ^= 1
    parser = BoardParser()
    (damage,) = parser.feed(bytes(bad[:6])) + parser.feed(bytes(bad[6:]))
    assert damage == Damage(10, "bad CRC of a packet of 10 bytes", Status.CRC_ERROR)
    assert parser.feed(b"\x01\x02") == [Damage(2, "bad CRC of a packet of 10 bytes")]
    assert parser.feed(strata.encode_request(request)) == [request]
    assert parser.feed(b"\x01") == [Damage(1, "byte 0x01 begins no packet", Status.REQUEST_TYPE_INVALID)]


def test_request_that_claims_too_much_is_refused_at_its_header():
    (damage, *_) = BoardParser().feed(bytes.fromhex("40 0d 01 00 00 00 f6 0f"))
    assert (damage.status, damage.reason) == (Status.PAYLOAD_TOO_LONG, "packet of 4096 bytes")


def test_packet_with_a_good_crc_and_no_room_for_its_timestamp_is_damage():
    body = bytes.fromhex("d7 00 00 00 04 00 01 02 03 04")
    found = HostParser().feed(body + strata.crc(body).to_bytes(2, "big"))
    assert good(found) == []


@pytest.mark.parametrize("kind", ["random", "start bytes", "long claims", "longest claims"])
def test_much_rubbish_takes_little_memory_and_leaves_the_next_packet_whole(kind):
    generator = random.Random(1)
    stream = {
        "random": generator.randbytes(100_000),
        "start bytes": b"\xd3" * 70_000,
        "long claims": bytes.fromhex("d3 00 d3 00 f0 0f") * 5_000,
        "longest claims": bytes.fromhex("d3 00 11 11 ff ff") * 11_500,
    }[kind]
    parser = HostParser()
    tracemalloc.start()
    found = feed_all(parser, [b"\0" + stream[i : i + 8000] for i in range(0, len(stream), 8000)])
    memory = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # A record or two for each of 100 pieces, and two records of about 200 bytes for each sixth of 65,543 places.
    assert memory < 5 << 20
    del found
    answer = Response(Kind.WRITE, 0)
    assert good(parser.feed(encode(answer)))[-1:] == [answer]


# Slices


def slice_of(*parts: bytes, first: int = 0) -> list[DataPacket]:
    """Packets of one slice, numbered from `first` on."""
    last = len(parts) - 1
    return [
        DataPacket(part, (first + i) % 65536, is_first=i == 0, is_last=i == last, timestamp=77 if i == last else None)
        for i, part in enumerate(parts)
    ]


FIRST, MIDDLE, LAST = slice_of(b"a", b"b", b"c")
AFTER, WHOLE = slice_of(b"d", b"e", first=3), Slice(b"de", 77, 3, 2)
HEADLESS = SliceLost("packet of a slice whose first packet is missing", 1)


@pytest.mark.parametrize(
    ("sent", "expected"),
    [
        (
            slice_of(b"ab", b"cd", b"e", first=65534) + slice_of(b"f", first=1),
            [Slice(b"abcde", 77, 65534, 3), Slice(b"f", 77, 1, 1)],
        ),
        # Lost packets are counted modulo 65536.
        (
            slice_of(b"a", first=65534) + slice_of(b"b", first=3),
            [Slice(b"a", 77, 65534, 1), SliceLost("expected packet 65535, got 3", 4), Slice(b"b", 77, 3, 1)],
        ),
        # A gap loses its slice alone.
        (
            [FIRST, LAST, *AFTER],
            [
                SliceLost("incomplete slice: expected packet 1, got 2", 1),
                SliceLost("expected packet 1, got 2", 1),
                HEADLESS,
                WHOLE,
            ],
        ),
        ([MIDDLE, LAST, *AFTER], [HEADLESS, HEADLESS, WHOLE]),
        (
            [FIRST, *slice_of(b"c", first=1)],
            [SliceLost("incomplete slice before the next one", 1), Slice(b"c", 77, 1, 1)],
        ),
        # A counter that goes back counts no loss.
        (2 * [*AFTER], [WHOLE, SliceLost("expected packet 5, got 3", 0), WHOLE]),
        (slice_of(b"12345678", b"9x"), [Slice(b"123456789x", 77, 0, 2)]),
        (
            slice_of(b"12345678", b"9xy", b"z") + AFTER,
            [SliceLost("slice of more than 10 bytes", 2), HEADLESS, WHOLE],
        ),
        (
            [FIRST, DataPacket(b"x", 1, channel=1, is_first=False), DataPacket(b"b", 2, is_first=False)],
            [SliceLost("packet of channel 1 in a slice of 0", 1), Slice(b"ab", None, 0, 2)],
        ),
        (
            [FIRST, DataPacket(b"", 1, timestamp=123456, error=7)],
            [SliceLost("incomplete slice before an error", 1), StreamError(7)],
        ),
    ],
)
def test_slices_are_whole_and_losses_are_counted(sent, expected):
    assembler = SliceAssembler(10)
    assert [item for packet in sent for item in assembler.feed(packet)] == expected


@fuzz
@given(
    st.lists(st.tuples(st.binary(max_size=9), st.booleans(), st.booleans(), st.integers(0, 1), st.integers(1, 40000))),
    st.integers(0, 65535),
)
def test_packets_of_slices_and_of_losses_add_up(sent, counter):
    assembler = SliceAssembler(20)
    total = counted = 0
    for payload, is_first, is_last, channel, step in sent:
        counter = (counter + step) % 65536
        # The counter that the first packet has is adopted; later ones may go back, which counts the packet alone.
        total += 1 if not total or step > 0x8000 else step
        for item in assembler.feed(DataPacket(payload, counter, channel, is_first, is_last)):
            assert not isinstance(item, Slice) or len(item.data) <= 20
            counted += item.num_packets
    assert counted + len(assembler._parts) == total
