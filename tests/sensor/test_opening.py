"""Opening a board: any answer to the stop, the right protocol first, and the reason where it fails."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import pytest

from doubles.boards import SMALL, Numbered, number_of, opened, plugged
from doubles.comlib_boards import ComLibDouble
from doubles.small_boards import Loopback, list_serial_ports, other_user
from doubles.usb_bus import EmulatedBus, cdc_device
from radarcore.sensor import (
    RequestError,
    SensorError,
    SensorNotFoundError,
    SensorTimeoutError,
    list_sensors,
    open_sensor,
    opening,
)
from radarcore.sensor.emulator.pty import PtyPort
from radarcore.sensor.emulator.source import Noise
from radarcore.sensor.emulator.strata import CdcBoard, Controller, Identity
from radarcore.sensor.strata import packets
from radarcore.sensor.strata.packets import Code, Data, Info, Kind, Request, Version
from radarcore.sensor.transport import ports
from short_requests import shorten_requests

OLD = Identity(version=Version(2, 0, 0, protocol_major=3))
needs_pty = pytest.mark.skipif(sys.platform == "win32", reason="ptys need Linux or macOS")


class Heard:
    """A board behind a byte stream that keeps what it hears."""

    def __init__(self, board: Any) -> None:
        self.board = board
        self.bytes = bytearray()
        self.send, self.hang_up = board.send, board.hang_up

    def receive(self, data: bytes) -> None:
        self.bytes += data
        self.board.receive(data)


class Silent(Loopback):
    """A port that takes all bytes and answers nothing."""

    def receive(self, data: bytes) -> None:
        pass


@contextmanager
def named_port(monkeypatch: pytest.MonkeyPatch, board: Any, ids: tuple[int, int] | None) -> Iterator[PtyPort]:
    """A pty that the system lists as the port of a USB device with these ids."""
    with PtyPort(board) as port:
        list_serial_ports(monkeypatch, port.path, ids=ids)
        yield port


# The stop


def refusing(monkeypatch: pytest.MonkeyPatch, refused: Any, status: int) -> None:
    """Let emulated boards refuse requests with a status."""
    handle = Controller.handle

    def answer(self: Controller, request: Request) -> packets.Response:
        return packets.Response(request.kind, status) if refused(request) else handle(self, request)

    monkeypatch.setattr(Controller, "handle", answer)


def is_stop(request: Request) -> bool:
    return (request.request, request.value) == (Code.DATA, Data.STOP)


@pytest.mark.parametrize("status", [0x05, 0x16, 0x86])
@pytest.mark.parametrize("transport", ["cdc", "vendor"])
def test_stop_may_be_refused_with_any_status(transport: str, status: int, monkeypatch: pytest.MonkeyPatch) -> None:
    refusing(monkeypatch, is_stop, status)
    with opened(Controller(Numbered(), speed=None), transport, radar=SMALL) as sensor:
        for _ in range(2):  # the stop in between is refused too, and the chip is reset
            assert [number_of(frame.raw) for frame in sensor.frames(2)] == [0, 1]


def test_stop_without_an_answer_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    shorten_requests(monkeypatch, 0.1, is_stop)
    receive = CdcBoard.receive
    stop = packets.encode_request(Request.write(Code.DATA, Data.STOP, 0))
    monkeypatch.setattr(CdcBoard, "receive", lambda self, data: None if data == stop else receive(self, data))
    with (
        plugged(Controller(Noise()), "cdc") as (where, _),
        pytest.raises(SensorTimeoutError, match=r"usb:1-1: no answer to request 0x0D \(value 0x0004"),
    ):
        open_sensor(**where)


@pytest.mark.parametrize("status", [0x10, 0x8C])
def test_board_that_has_no_uuid_and_no_name_is_opened(status: int, monkeypatch: pytest.MonkeyPatch) -> None:
    refusing(monkeypatch, lambda asked: asked.request == Code.BOARD_INFO and asked.value != Info.VERSION, status)
    with opened(Controller(Noise())) as sensor:
        assert (sensor.info.serial_number, sensor.info.name) == ("", "Strata board")


# Named ports


@needs_pty
@pytest.mark.parametrize("is_link", [False, True])
@pytest.mark.parametrize("ids", [(0x058B, 0x0251), (0x04B4, 0xF155), (0x0403, 0x6001)])
def test_board_at_a_named_port_with_usb_ids_hears_strata_alone(
    ids: tuple[int, int], is_link: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Boards by their ids, and bridges that ComLib boards do not need; a link has the ids of its port."""
    heard = Heard(CdcBoard(Controller(Noise())))
    with named_port(monkeypatch, heard, ids) as port:
        path = tmp_path / "usb-Infineon_IFX_CDC-if00" if is_link else Path(port.path)
        if is_link:
            path.symlink_to(port.path)
        with open_sensor(str(path)) as sensor:
            assert (sensor.info.protocol, sensor.info.port) == ("strata", str(path))
    version = packets.encode_request(Request.read(Code.BOARD_INFO, Info.VERSION, 0, 16))
    assert heard.bytes.startswith(version), "and nothing before"


@needs_pty
def test_silent_board_with_known_ids_is_asked_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    shorten_requests(monkeypatch, 0.3)
    heard = Heard(Silent())
    with (
        named_port(monkeypatch, heard, (0x058B, 0x0251)) as port,
        pytest.raises(SensorTimeoutError, match=rf"{port.path}: no answer to request 0x80"),
    ):
        open_sensor(port.path)
    assert set(heard.bytes[::10]) == {Kind.READ}, "requests of 10 bytes"


@needs_pty
def test_xmc_board_at_a_named_port_hears_comlib_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    heard = Heard(ComLibDouble())
    with named_port(monkeypatch, heard, (0x058B, 0x0058)) as port, open_sensor(port.path) as sensor:
        assert sensor.info.protocol == "comlib"
    assert heard.bytes[0] == 0x5A


def test_windows_names_of_a_port_are_one(monkeypatch: pytest.MonkeyPatch) -> None:
    list_serial_ports(monkeypatch, "COM12", ids=(0x058B, 0x0251))
    monkeypatch.setattr(ports.sys, "platform", "win32")
    for name in ("COM12", "com12", r"\\.\COM12"):
        port = ports.serial_port(name)
        assert (port.vendor_id, port.product_id, port.path) == (0x058B, 0x0251, name)
    assert ports.serial_port("COM1").vendor_id is None


# The reason of a failure


@needs_pty
@pytest.mark.parametrize(
    ("refused", "status", "error", "message"),
    [
        (lambda request: True, 0x85, SensorError, "protocol 4 of Strata, got 3 or older; update the board's firmware"),
        (lambda request: request.value == Info.VERSION, 0x8C, RequestError, r"not available \(0x8C\)"),
    ],
)
def test_refusal_of_the_first_request_is_told_whatever_protocol_was_tried_before(
    refused: Any, status: int, error: type[SensorError], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    refusing(monkeypatch, refused, status)
    with PtyPort(CdcBoard(Controller(Noise()))) as port, pytest.raises(error, match=message):
        open_sensor(port.path)


@needs_pty
def test_what_answers_nothing_is_told_with_what_was_tried() -> None:
    with PtyPort(Silent()) as port, pytest.raises(SensorError) as caught:
        open_sensor(port.path)
    assert str(caught.value) == (
        f"{port.path}: expected a radar board, got a device without ComLib or Strata "
        f"(ComLib: no answer in 0.3 s; Strata: no answer to request 0x80 (value 0x0001, index 0x0000) within 0.6 s)"
    )


def shorten_comlib(monkeypatch: pytest.MonkeyPatch, longest: float) -> None:
    """Let requests in ComLib wait for their answers up to `longest` [s]."""
    board = opening.ComLibBoard
    monkeypatch.setattr(opening, "ComLibBoard", lambda stream, timeout: board(stream, timeout=min(timeout, longest)))


def test_boards_left_out_of_the_list_are_told_with_their_reasons(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("usb", reason="needs the extra `usb`: pip install radarcore[usb]")
    shorten_comlib(monkeypatch, 0.2)
    bus = EmulatedBus()
    controllers = [Controller(Noise(), identity=OLD), Controller(Noise()), Controller(Noise())]
    devices = [cdc_device(CdcBoard(controller)) for controller in controllers]
    devices[1].is_denied = True
    devices.append(cdc_device(Silent(), product_id=0x0058))  # another product of the vendor, for all that is known
    for device in devices:
        bus.plug(device)
    with pytest.warns(RuntimeWarning) as warned:
        (info,) = list_sensors(usb_backend=bus)
    assert info.port == "usb:1-3"
    (warning,) = warned
    first, old, denied, *_ = str(warning.message).split("\n")
    assert first == "boards left out:"
    assert old == "  usb:1-1: expected protocol 4 of Strata, got 3.0; update the board's firmware"
    assert denied.startswith("  usb:1-2: no permission to open the device")
    assert "usb:1-4" not in str(warning.message)
    with open_sensor(usb_backend=bus) as sensor:
        assert sensor.info == info


def test_reason_of_the_only_board_is_that_of_opening_any(monkeypatch: pytest.MonkeyPatch) -> None:
    bus = EmulatedBus()
    bus.plug(cdc_device(Silent(), product_id=0x0058))
    with pytest.raises(SensorNotFoundError, match=r"no radar board found; tried:\n  usb:1-1: no answer in 1 s"):
        open_sensor(usb_backend=bus)
    shorten_comlib(monkeypatch, 0.2)
    for _ in range(2):
        bus.plug(cdc_device(CdcBoard(Controller(Noise(), identity=OLD))))
        with pytest.raises(SensorError, match=r"usb:1-2: expected protocol 4 of Strata, got 3\.0; update") as caught:
            open_sensor(usb_backend=bus)
    assert str(caught.value).startswith("expected a radar board that can be opened, got\n  usb:1-2: expected")
    assert "\n  usb:1-3: expected" in str(caught.value)


# Two clients


@needs_pty
@pytest.mark.parametrize("user", [nullcontext, other_user])
def test_second_client_of_a_port_is_told_so(user: Any) -> None:
    with PtyPort(CdcBoard(Controller(Noise()))) as port, open_sensor(port.path, protocol="strata") as sensor:
        Path(port.path).chmod(0o666)
        with user(), pytest.raises(SensorError, match=f"{port.path}: the port is in use by another program"):
            open_sensor(port.path)
        assert sensor.temperature() == pytest.approx(25.0, abs=0.3), "the first one continues"
