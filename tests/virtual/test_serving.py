"""`radarcore sensor serve` in processes of its own: how it ends, its link, and clients that come, go and misbehave."""

import os
import signal
import sys
import time
from contextlib import contextmanager, suppress

import numpy as np
import pytest

import radarcore as rc
from doubles.boards import CLI, SWING, Numbered, numbered, python
from doubles.small_boards import is_soon
from radarcore.cli.main import main
from radarcore.sensor import SensorError, SensorTimeoutError, open_sensor, virtual_board
from radarcore.sensor.bgt60.registers import start_words
from radarcore.sensor.bgt60.settings import Settings, achieved, registers_of
from radarcore.sensor.emulator.pty import PtyPort
from radarcore.sensor.emulator.strata import CdcBoard, Controller
from radarcore.sensor.strata import packets
from radarcore.sensor.strata.packets import Avian, Code, Component, Info, Kind, Request

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="ends of pseudo terminals and /proc are Linux's")

RADAR = achieved(Settings.from_radar(rc.bgt60tr13c(num_samples=32, num_chirps=8, frame_interval=25e-3))).to_radar()
PATIENCE = 30.0
"""Longest time that a process may take [s]; a busy machine takes a second to start one."""
VERSION = packets.encode_request(Request(Kind.READ, Code.BOARD_INFO, Info.VERSION, 0, 16, b""))
LONG = packets.encode_request(Request(Kind.WRITE, Code.COMPONENT, Component.AVIAN, Avian.EXECUTE, 400, bytes(400)))


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("recorded") / "rec"
    raw = np.stack([numbered((3, 8, 32), number) for number in range(4)])
    cube = (raw * 2.0 / 4095.0 - 1.0).astype(np.float32)
    times = np.arange(4) * RADAR.waveform.frame_interval
    rc.Recording(cube, times, RADAR, source={"cube_unit": "full scale"}).save(path)
    return path


@pytest.fixture
def board():
    """A board in this process, which loses no frame however busy the machine is."""
    controller = Controller(Numbered(), speed=None)
    yield CdcBoard(controller)
    controller.close()


@contextmanager
def serving(*arguments, program=CLI):
    """A server that listens, and its first line; killed at the end if it still runs."""
    with python(program, "sensor", "serve", *arguments) as server:
        try:
            assert server.stdout.readline() == f"listening on {arguments[arguments.index('--link') + 1]}\n"
            yield server
        finally:
            server.kill()


@pytest.fixture(scope="module")
def served(recording, tmp_path_factory):
    """Link to a server of a recording, for clients that come and go."""
    link = tmp_path_factory.mktemp("served") / "radar"
    with serving(recording, "--link", link, "--latency", "0.03") as server:
        yield link
        assert server.poll() is None


def end(process, number):
    """Output and errors of a process that a signal ends."""
    process.send_signal(number)
    return process.communicate(timeout=PATIENCE)


def test_signal_ends_a_server_which_removes_its_link_if_it_can(recording, tmp_path, capsys):
    link = tmp_path / "radar"
    with serving(recording, "--link", link) as server:
        end(server, signal.SIGKILL)
    left = link.readlink()
    assert main(["sensor", "serve", str(recording), "--link", str(link)]) == 1
    assert "File exists; --force" in capsys.readouterr().err
    assert link.readlink() == left
    with serving(recording, "--link", link, "--force") as server:
        assert "BGT60TR13C, protocol Strata; 4 frames over and over" in server.stdout.readline()
        assert f"radarcore view {link}" in server.stdout.readline()
        with open_sensor(str(link), protocol="strata") as sensor:
            sensor.configure(RADAR)
            assert len(list(sensor.frames(5))) == 5
        out, err = end(server, signal.SIGTERM)
    assert (server.returncode, err) == (0, "stopped\n")
    assert not link.is_symlink()
    number_of_frames, _, rest = out.strip().partition(" ")
    assert 5 <= int(number_of_frames) <= 12  # a few were on their way
    assert rest == "frames delivered, 0 lost"


HEAVY = """
import signal, time
signal.signal(signal.SIGHUP, signal.SIG_DFL)
from radarcore.simulate.simulator import Simulator
def frame(self, time_of_frame):
    print("simulates", flush=True)
    time.sleep(60)
Simulator.frame = frame
"""
"""A simulator with frames as slow as with millions of rays."""


def test_server_does_not_wait_for_a_frame_that_takes_long(tmp_path):
    scene, link = tmp_path / "swing.toml", tmp_path / "radar"
    scene.write_text(SWING)
    with serving(scene, "--link", link, program=HEAVY + CLI) as server:
        with open_sensor(str(link), protocol="strata") as sensor:
            sensor.configure(RADAR)
            with pytest.raises(SensorTimeoutError, match=r"no frame within 0\.2 s"):
                next(sensor.frames(timeout=0.2))
        assert "simulates\n" in [server.stdout.readline() for _ in range(3)]
        began = time.monotonic()
        end(server, signal.SIGHUP)
        assert time.monotonic() - began < 10.0, "a busy machine may take some seconds, and the frame a minute"
    assert server.returncode == 0
    assert not link.is_symlink()


# Clients


def test_server_takes_its_time(served):
    file = os.open(served, os.O_RDWR | os.O_NOCTTY)
    began = time.monotonic()
    os.write(file, VERSION)
    assert os.read(file, 1) == b"\xc0"
    assert time.monotonic() - began >= 0.03
    os.close(file)


@contextmanager
def client_of(port):
    """File of a program that opens the port and ends; the port notices both."""
    file = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    yield file
    assert is_soon(port._has_client.is_set)
    os.close(file)
    assert is_soon(lambda: not port._has_client.is_set())
    with port._writing:  # until the port has thrown away what was not read
        pass


def test_clients_that_end_half_way_leave_nothing_to_the_next(board):
    with PtyPort(board) as port:
        for number in (4, 9, 200, len(LONG) - 1):
            with client_of(port) as file:
                os.write(file, VERSION + LONG[:number])
            with client_of(port) as file, pytest.raises(BlockingIOError):
                os.read(file, 1)  # the answer to the one before
        # A client comes back again and again; registers stay as they are, as on a board.
        for _ in range(3):
            with open_sensor(port.path, protocol="strata") as sensor:
                sensor.configure(RADAR)
                assert [frame.stats["lost_before"] for frame in sensor.frames(2)] == [0, 0]
        kept = dict(board.controller.chip.registers)
        with client_of(port) as file:
            os.write(file, VERSION)
        assert board.controller.chip.registers == kept


@contextmanager
def recorder(port, output):
    """A program that has recorded five frames, and continues."""
    pytest.importorskip("serial", reason="needs the extra `usb`: pip install radarcore[usb]")
    options = ("--rate", "40", "--chirps", "8", "--samples", "32")
    with python(CLI, "sensor", "record", port, "-o", output, *options) as client:
        cube = output / "cube.npy"
        assert is_soon(lambda: cube.exists() and cube.stat().st_size > 5 * 4 * 3 * 8 * 32)
        yield client


def test_recorder_that_is_told_to_end_does_so_well(served, tmp_path):
    with recorder(served, tmp_path / "rec") as client:
        out, err = end(client, signal.SIGTERM)  # as an interrupt does: as long as was wanted
    assert client.returncode == 0, err
    assert "0 lost" in out
    recording = rc.Recording.load(tmp_path / "rec")
    assert len(recording) >= 5
    assert recording.raw.dtype == np.uint16
    assert recording.source["sensor"]["chip"] == "BGT60TR13C"
    assert main(["info", str(tmp_path / "rec")]) == 0


def test_client_killed_while_frames_come_leaves_a_board_that_can_be_opened(served, tmp_path):
    def has_frames():
        with suppress(SensorError), open_sensor(str(served), protocol="strata") as sensor:
            sensor.configure(RADAR)
            return [frame.stats["lost_before"] for frame in sensor.frames(5)] == [0] * 5

    with recorder(served, tmp_path / "rec") as client:
        client.kill()
    time.sleep(0.3)  # frames that nobody reads
    assert is_soon(has_frames), "a busy system may take a moment to forget the client's lock"


def test_client_that_never_reads_fills_no_memory(board):
    with PtyPort(board) as port:
        file = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        num_taken, last = 0, time.monotonic()
        while time.monotonic() - last < 0.3:  # until nothing more is taken
            try:
                num_taken += os.write(file, VERSION * 100)
                last = time.monotonic()
            except BlockingIOError:
                time.sleep(0.005)
            # The system's buffers have room for some 20 000 bytes, and the board answers 22 to each 10.
            assert num_taken < 300_000, "it takes requests without end"
        assert len(board._out) + 22 * len(board._answers) < 500_000
        os.close(file)
        assert is_soon(lambda: not port._has_client.is_set())
        with open_sensor(port.path, protocol="strata") as sensor:
            sensor.configure(RADAR)
            assert len(list(sensor.frames(2))) == 2


def test_frames_that_nobody_takes_are_counted_as_lost():
    with virtual_board(Numbered(), speed=20.0) as board:
        chip = board.controller.chip
        chip.execute(start_words(registers_of(Settings.from_radar(RADAR), 768)))  # data are not started
        assert is_soon(lambda: chip.has_overflown)
        # 16384 samples have room for 21 frames of 768; the next one is lost with them.
        assert (board.num_frames, board.num_lost) == (0, 22)
