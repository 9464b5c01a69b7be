"""Boards in trouble while they measure: long packets, damage, silence, answers that get lost."""

from __future__ import annotations

import re
import time
from collections.abc import Callable

import pytest

import radarcore as rc
from boards import TRANSPORTS, Numbered, number_of, opened
from radarcore.sensor import SensorTimeoutError, open_sensor
from radarcore.sensor.emulator.pty import PtyPort
from radarcore.sensor.emulator.strata import CdcBoard, Controller
from radarcore.sensor.strata import packets
from radarcore.sensor.strata.packets import DataPacket

SMALL = rc.bgt60tr13c(num_samples=32, num_chirps=8, frame_interval=25e-3)
LARGE = rc.bgt60tr13c(num_chirps=64, frame_interval=100e-3)  # two slices of 9216 bytes to a frame


# Long packets


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_slices_may_come_in_packets_of_any_size(transport: str) -> None:
    with opened(Controller(Numbered(), speed=None, most_payload=20_000), transport) as sensor:
        sensor.configure(LARGE)
        assert [number_of(frame.raw) for frame in sensor.frames(5)] == [0, 1, 2, 3, 4]
        assert sensor.num_lost == 0


def test_packet_that_claims_more_than_comes_delays_the_next_ones_for_a_moment(monkeypatch: pytest.MonkeyPatch) -> None:
    encode = packets.encode_data

    def claiming(packet: DataPacket, *, with_crc: bool = True) -> bytes:
        data = encode(packet, with_crc=with_crc)
        return data[:5] + b"\xff" + data[6:] if packet.counter == 3 else data

    monkeypatch.setattr(packets, "encode_data", claiming)
    with opened(Controller(Numbered())) as sensor:
        sensor.configure(rc.bgt60tr13c(num_samples=8, num_chirps=8, frame_interval=50e-3))
        frames = sensor.frames()
        given = [next(frames) for _ in range(3)]
        began = time.monotonic()
        with pytest.warns(rc.sensor.FramesLostWarning, match="1 lost: packet that never became whole"):
            given.append(next(frames))
        assert time.monotonic() - began < 1.0  # 65 kB of such frames are 12 s
        assert [number_of(frame.raw) for frame in given] == [0, 1, 2, 4]
        frames.close()


# Damage


def damaging(monkeypatch: pytest.MonkeyPatch, change: Callable[[bytes, DataPacket], bytes], first: int = 1) -> None:
    """Change the bytes of data packets, from a counter on."""
    encode = packets.encode_data

    def damaged(packet: DataPacket, *, with_crc: bool = True) -> bytes:
        data = encode(packet, with_crc=with_crc)
        return data if packet.counter < first else change(data, packet)

    monkeypatch.setattr(packets, "encode_data", damaged)


def flipped(data: bytes, packet: DataPacket) -> bytes:
    return data[:-1] + bytes([data[-1] ^ 1])


def timed_out(sensor: rc.sensor.Sensor, num_frames: int = 1) -> str:
    """Message of the time-out behind the first frames."""
    sensor.configure(SMALL)
    frames = sensor.frames(timeout=0.4)
    for index in range(num_frames):
        assert number_of(next(frames).raw) == index
    with pytest.raises(SensorTimeoutError) as caught:
        next(frames)
    return str(caught.value)


def test_damaged_packets_stand_in_the_message_of_a_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    damaging(monkeypatch, flipped)
    with opened(Controller(Numbered())) as sensor:
        message = timed_out(sensor)
    # Slices of 768 samples: 1152 bytes, and 16 of header, time stamp and CRC around them; all in one place, as no
    # good packet comes between.
    found = re.fullmatch(
        r"usb:1-1: no frame within 0\.4 s; (\d+) bytes dropped at 1 place \(bad CRC of a packet of 1168 bytes\)"
        r"(, \d+ bytes? of a packet that is not whole)?",
        message,
    )
    assert found is not None, message
    assert int(found[1]) >= 5 * 1168


def test_damaged_packets_of_a_vendor_board_are_counted_too(monkeypatch: pytest.MonkeyPatch) -> None:
    damaging(monkeypatch, lambda data, packet: data[:-1])
    with opened(Controller(Numbered()), "vendor") as sensor:
        message = timed_out(sensor)
    found = re.search(r"; (\d+) bytes dropped at (\d+) places \(.*expected 6 \+ 1160 bytes, got 1165\)$", message)
    assert found is not None, message
    assert int(found[1]) == 1165 * int(found[2]) >= 5 * 1165


def test_lost_packets_stand_in_the_message_of_a_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every second packet of slices of two is missing."""
    damaging(monkeypatch, lambda data, packet: b"" if packet.counter % 2 else data, first=2)
    with opened(Controller(Numbered(), most_payload=768)) as sensor:
        message = timed_out(sensor)
    found = re.search(r"; (\d+) packets lost$", message)
    assert found is not None, message
    assert int(found[1]) >= 2 * 5


def test_damage_before_a_good_frame_is_not_told_later(monkeypatch: pytest.MonkeyPatch) -> None:
    damaging(monkeypatch, lambda data, packet: flipped(data, packet) if packet.counter == 1 else data)
    controller = Controller(Numbered())
    with opened(controller) as sensor, pytest.warns(rc.sensor.FramesLostWarning, match="bad CRC"):  # noqa: PT031
        sensor.configure(SMALL)
        frames = sensor.frames(timeout=0.4)
        assert [number_of(next(frames).raw) for _ in range(2)] == [0, 2]
        controller.chip.close()
        with pytest.raises(SensorTimeoutError, match=r"no frame within 0\.4 s$"):  # noqa: PT012  # some had come
            for _ in range(1000):
                next(frames)


def test_noise_in_place_of_an_answer_stands_in_the_message_of_a_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    encode = packets.encode_response
    with PtyPort(CdcBoard(Controller(Numbered()))) as port:
        monkeypatch.setattr(packets, "encode_response", lambda response: encode(response)[:-1] + b"\0")
        message = (
            r"within 1 s; 22 bytes dropped at 1 place \(bytes before the first whole packet\)"
            r"|within 1 s; 22 bytes of a packet that is not whole"
        )
        with pytest.raises(SensorTimeoutError, match=message):
            open_sensor(port.path, protocol="strata")
