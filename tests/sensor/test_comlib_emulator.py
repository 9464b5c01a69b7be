"""An emulated ComLib board, byte by byte: what it answers, refuses and holds back."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import pytest

from doubles.comlib_boards import Ramp
from radarcore.sensor.comlib.codes import Base
from radarcore.sensor.comlib.messages import (
    AdcSettings,
    FmcwSettings,
    Format,
    HostParser,
    Message,
    StatusMessage,
    decode_number,
    encode_number,
)
from radarcore.sensor.emulator.comlib import ComLibEmulator


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
        (1, b"\x01", 0xFFFF),
        (1, encode_number(0x02, 1), 0x05),
        (1, bytes(8).replace(b"\0", b"\x03", 1), 0x03),
        (1, b"\x30\x01", 0x07),
        (1, b"\x32\x02", 0x06),
        (1, Format(64, 16, 0x10).encode(), 0x06),
        (1, Format(0, 16, 1).encode(), 0x08),
        (1, Format(64, 16, 1, 2).encode(), 0x0B),
        (2, FmcwSettings(55_999_999, 64_000_000, 0, 0).encode(), 0x09),
        (2, FmcwSettings(57_000_000, 64_000_000, 0, 32).encode(), 0x0A),
        (2, FmcwSettings(57_000_000, 64_000_000, 2, 0).encode(), 0x20),
        (3, AdcSettings(3_000_001).encode(), 0x50),
        (3, AdcSettings(1_000_000, 10).encode(), 0x51),
    ],
)
def test_emulator_refuses_with_the_status_of_the_protocol(endpoint, payload, status):
    assert talk(ComLibEmulator(Ramp()), endpoint, payload) == [StatusMessage(endpoint, status)]


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
