"""Serial ports on ptys, and captures that are written and played."""

from __future__ import annotations

import json
import os
import random
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from doubles.small_boards import HANG, Call, Loopback, other_user, read_all
from doubles.usb_bus import EmulatedBus, cdc_device, on_bus
from radarcore.sensor.emulator.pty import PtyPort, Unplugged
from radarcore.sensor.errors import (
    ProtocolError,
    SensorDisconnectedError,
    SensorError,
    SensorNotFoundError,
    SensorTimeoutError,
)
from radarcore.sensor.transport import serialport
from radarcore.sensor.transport.capture import Capture, Replay
from radarcore.sensor.transport.serialport import SerialStream
from radarcore.sensor.transport.usbport import UsbStream

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="ptys need Linux or macOS")


# Serial ports


def test_a_megabyte_goes_both_ways_unharmed() -> None:
    data = random.Random(2).randbytes(1_000_000)
    peripheral = Loopback()
    with PtyPort(peripheral) as port:
        stream = SerialStream(port.path)
        call = Call(lambda: stream.write(data, HANG))
        assert read_all(stream, len(data)) == data
        call.result()
        assert peripheral.received == data
        stream.close()


def test_line_is_raw_and_fast() -> None:
    import termios

    with PtyPort(Loopback()) as port:
        stream = SerialStream(port.path)
        client = os.open(port.path, os.O_RDWR | os.O_NOCTTY)
        _, _, control, local, _, speed, _ = termios.tcgetattr(client)
        os.close(client)
        stream.close()
    if sys.platform == "linux":
        assert speed == termios.B921600
    assert control & (termios.CSIZE | termios.PARENB | termios.CSTOPB | termios.CRTSCTS) == termios.CS8
    assert not local & (termios.ICANON | termios.ECHO | termios.ISIG)


def test_rate_that_a_port_refuses_is_followed_by_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    import serial

    def refuse(port: serial.Serial, rate: int) -> None:
        raise ValueError(f"{rate} baud")

    # Rates that the system has no name for are set by this method of pyserial.
    monkeypatch.setattr(serial.Serial, "_set_special_baudrate", refuse)
    monkeypatch.setattr(serialport, "BAUD_RATES", (123_456, 115_200))
    with PtyPort(Loopback()) as port:
        SerialStream(port.path).close()
        monkeypatch.setattr(serialport, "BAUD_RATES", (123_456, 234_567))
        with pytest.raises(SensorError, match=r"none that can be set up \(123456 baud\)"):
            SerialStream(port.path)


def test_read_gives_at_most_what_is_asked() -> None:
    with PtyPort(Loopback()) as port:
        stream = SerialStream(port.path)
        stream.write(b"abcdef", HANG)
        assert read_all(stream, 2) == b"ab"
        assert read_all(stream, 3) == b"cde"
        assert read_all(stream, 1) == b"f"
        assert stream.read(1, 0.02) == b""
        stream.close()


def test_board_that_takes_nothing_is_a_timeout() -> None:
    class Deaf(Loopback):
        def receive(self, data: bytes) -> None:
            listens.wait(HANG)

    listens = threading.Event()
    with PtyPort(Deaf()) as port:
        stream = SerialStream(port.path)
        with pytest.raises(SensorTimeoutError, match="the board did not take all bytes in time"):
            stream.write(bytes(1_000_000), 0.2)
        listens.set()
        stream.close()


def test_board_is_asked_for_no_more_than_the_client_reads() -> None:
    class Endless(Loopback):
        num_sent = 0

        def send(self, size: int, timeout: float) -> bytes:
            self.num_sent += size
            return bytes(size)

    peripheral = Endless()
    with PtyPort(peripheral) as port:
        before = -1
        while before != peripheral.num_sent:  # until the terminal's buffer is full
            before = peripheral.num_sent
            time.sleep(0.2)
        assert before < 1_000_000
        stream = SerialStream(port.path)
        assert len(read_all(stream, 200_000)) == 200_000
        assert peripheral.num_sent > before
        stream.close()


@pytest.mark.skipif(sys.platform != "linux", reason="Linux tells whether a port is exclusive")
@pytest.mark.parametrize("is_pty", [True, False])
def test_ports_of_hardware_refuse_programs_without_locks(is_pty: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    import fcntl

    monkeypatch.setattr(serialport, "is_pty", lambda path: is_pty)
    with PtyPort(Loopback()) as port:
        stream = SerialStream(port.path)
        answer = fcntl.ioctl(stream._serial.fileno(), 0x80045440, bytes(4))  # TIOCGEXCL
        assert answer == (not is_pty).to_bytes(4, "little")
        stream.close()


@pytest.mark.parametrize("end", ["unplugged", "port closed"])
def test_end_of_a_port_ends_a_read_that_waits_and_all_later_calls(end: str) -> None:
    peripheral = Loopback()
    with PtyPort(peripheral) as port:
        stream = SerialStream(port.path)
        call = Call(lambda: stream.read(1, 10 * HANG))
        time.sleep(0.02)
        if end == "unplugged":
            peripheral.queue(Unplugged)
        else:
            port.close()
        for ended in (call.result, lambda: stream.read(1, 1.0), lambda: stream.write(b"x", 1.0)):
            with pytest.raises(SensorDisconnectedError, match=f"{port.path}: the board is gone"):
                ended()
        stream.close()
        stream.close()  # does nothing
    port.close()


def test_what_is_no_serial_port_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"abc")
    for path, error, message in (
        (tmp_path / "no" / "such", SensorNotFoundError, "there is no such port; is the board plugged in"),
        (file, SensorError, "no serial port"),
        (tmp_path, SensorError, "no serial port"),
    ):
        with pytest.raises(error, match=message):
            SerialStream(str(path))
    assert file.read_bytes() == b"abc"


def test_missing_permission_names_the_group(tmp_path: Path) -> None:
    file = tmp_path / "ttyACM0"
    file.touch(mode=0o000)
    with other_user(), pytest.raises(SensorError, match="no permission") as raised:
        SerialStream(str(file))
    if sys.platform == "linux":
        assert "add yourself to the group dialout" in str(raised.value)


# Ptys


def test_link_leads_to_the_pty_and_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    link, folder = tmp_path / "radar", tmp_path / "folder"
    folder.mkdir()
    monkeypatch.chdir(tmp_path)
    with PtyPort(Loopback(), link="radar") as port:
        monkeypatch.chdir(folder)  # a relative name stays in its folder
        assert link.resolve() == Path(port.path).resolve()
        stream = SerialStream(str(link))
        stream.write(b"abc", HANG)
        assert read_all(stream, 3) == b"abc"
        stream.close()
        with pytest.raises(FileExistsError, match="File exists; --force"):
            PtyPort(Loopback(), link=link)
        assert str(link.readlink()) == port.path
    assert not link.is_symlink()


def test_link_is_replaced_if_asked_and_removed_by_its_last_owner(tmp_path: Path) -> None:
    link = tmp_path / "radar"
    link.symlink_to("/dev/pts/999999")  # of a process that was killed
    with PtyPort(Loopback(), link=link, replace_link=True), PtyPort(Loopback()) as last:
        link.unlink()
        link.symlink_to(last.path)
    assert str(link.readlink()) == last.path


def test_links_are_made_nowhere_but_where_nothing_is(tmp_path: Path) -> None:
    file, folder = tmp_path / "file", tmp_path / "folder"
    file.write_bytes(b"abc")
    folder.mkdir()
    for link, message in (
        (file, "File exists"),
        (folder, "File exists"),
        (tmp_path / "none" / "radar", "No such file or directory"),
    ):
        with pytest.raises(OSError, match=message) as raised:
            PtyPort(Loopback(), link=link, replace_link=True)
        assert raised.value.filename == str(link)
    assert file.read_bytes() == b"abc"


def test_idle_pty_asks_its_board_seldom() -> None:
    peripheral = Loopback()
    with PtyPort(peripheral) as port:
        SerialStream(port.path).close()  # a client that has gone is no reason to spin
        num_asked = peripheral.num_asked
        time.sleep(0.3)
    assert peripheral.num_asked - num_asked < 50


# Captures


def conversation(stream: Any) -> list[bytes]:
    """A few requests and answers."""
    answers = []
    for request in (b"one", b"two", b"three", b"four"):
        stream.write(request, HANG)
        answers.append(read_all(stream, len(request)))
    return answers


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    """Capture of the conversation above."""
    path = tmp_path / "capture.jsonl"
    bus = EmulatedBus()
    bus.plug(cdc_device(Loopback()))
    stream = Capture(UsbStream(on_bus(bus)), path)
    assert stream.name == "usb:1-1"
    assert conversation(stream) == [b"one", b"two", b"three", b"four"]
    stream.close()
    stream.close()
    return path


def test_capture_has_every_byte(capture: Path) -> None:
    header, *events = map(json.loads, capture.read_text().splitlines())
    assert (header["format"], header["version"], header["stream"]) == ("radarcore capture", 1, "usb:1-1")
    assert abs(header["started"] - time.time()) < 600.0
    data = {"write": b"", "read": b""}
    for event in events:
        data[event["direction"]] += bytes.fromhex(event["bytes"])
    assert data == {"write": b"onetwothreefour", "read": b"onetwothreefour"}
    times = [event["time"] for event in events]
    assert times == sorted(times)
    assert times[0] >= 0.0


def test_capture_plays_as_the_board_did(capture: Path) -> None:
    stream = Replay(capture)
    assert conversation(stream) == [b"one", b"two", b"three", b"four"]
    with pytest.raises(SensorDisconnectedError, match="the capture ends here"):
        stream.read(1, HANG)
    stream.close()
    for ended in (lambda: stream.read(10, 10 * HANG), lambda: stream.write(b"ask", HANG)):
        with pytest.raises(SensorDisconnectedError, match="the port has been closed"):
            ended()


def write_capture(path: Path, *events: tuple[str, bytes]) -> Path:
    lines = [{"format": "radarcore capture", "version": 1, "stream": "x", "started": 0.0}]
    lines += [{"time": float(i), "direction": kind, "bytes": data.hex()} for i, (kind, data) in enumerate(events)]
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return path


def test_answers_wait_for_their_questions(tmp_path: Path) -> None:
    events = [("read", b"hello"), ("write", b"ask"), ("read", b"answer"), ("write", b"b"), ("read", b"2")]
    stream = Replay(write_capture(tmp_path / "c", *events))
    assert stream.read(2, 0.0) == b"he"
    assert stream.read(10, 0.0) == b"llo"
    assert stream.read(10, 0.01) == b""
    stream.write(b"as", HANG)
    assert stream.read(10, 0.01) == b""  # the question is not complete
    stream.write(b"kb", HANG)  # a write may come before what was read before it
    assert [stream.read(10, 0.0), stream.read(10, 0.0)] == [b"answer", b"2"]


def test_other_write_is_refused_with_both(tmp_path: Path) -> None:
    stream = Replay(write_capture(tmp_path / "c", ("write", b"\x01\x02\x03")))
    with pytest.raises(ProtocolError, match=r"expected the write of 0 s, 01 02 03 \(3 bytes\), got 01 03 \(2 bytes\)"):
        stream.write(b"\x01\x03", HANG)
    stream.write(b"\x01\x02\x03", HANG)
    with pytest.raises(ProtocolError, match=r"expected no further write, got 01 01 .* \.\.\. \(33 bytes\)"):
        stream.write(b"\x01" * 33, HANG)


HEADER = b'{"format": "radarcore capture", "version": 1, "stream": "x", "started": 0}\n'
EVENT = b'{"time": 0, "direction": "read", "bytes": "00"}\n'


@pytest.mark.parametrize(
    ("content", "message"),
    [
        *(
            (content, "line 1: expected the header of a radarcore capture of version 1, got")
            for content in (b"\xff\xfe\x00\n", b"hello\n", b"[1]\n", b"[" * 100_000 + b"\n", b"{}\n", b"\n")
        ),
        (HEADER.replace(b"1", b"2"), "line 1: .*another format or version"),
        (b"", "line 1: the file is cut off within the line"),
        (HEADER[:-1], "line 1: the file is cut off within the line"),
        (HEADER + EVENT[:-5], "line 2: the file is cut off within the line"),
        *(
            (HEADER + EVENT.replace(old, new), f"line 2: expected time, direction and bytes, got .*{message}")
            for old, new, message in (
                (b'"time": 0, ', b"", "'time'"),
                (b"0,", b"NaN,", "finite"),
                (b"0,", b"1" + b"0" * 400 + b",", ""),
                (b'"read"', b'"in"', "expected one of 'write', 'read'"),
                (b'"read"', b'["read"]', "expected one of"),
                (b'"00"', b'"0g"', "non-hexadecimal"),
                (b'"00"', b"12", ""),
                (b'"00"', b'""', "expected at least one byte"),
                (b"}", b"", "delimiter"),
            )
        ),
    ],
)
def test_damaged_capture_is_a_value_error(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "capture.jsonl"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=message) as raised:
        Replay(path)
    assert str(raised.value).startswith(str(path))


def test_capture_cut_off_anywhere_is_told_or_plays(capture: Path) -> None:
    content = capture.read_bytes()
    for length in range(0, len(content), 7):
        capture.write_bytes(content[:length])
        if length and content[length - 1 : length] == b"\n":
            Replay(capture)
        else:
            with pytest.raises(ValueError, match="line"):
                Replay(capture)
