"""A sensor's life: threads and ports given back however it ends, and measuring that ends at once."""

import gc
import os
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

import radarcore as rc
from doubles.boards import SMALL, TRANSPORTS, Numbered, number_of, opened, plugged, python
from doubles.small_boards import is_soon
from radarcore.sensor import SensorError, SensorTimeoutError, open_sensor
from radarcore.sensor.emulator.faults import Faults
from radarcore.sensor.emulator.pty import PtyPort
from radarcore.sensor.emulator.strata import CdcBoard, Controller

AT_ONCE = 1.0
"""Half the time-out of `SMALL`'s frames [s]."""


def is_measuring(controller):
    thread = controller.chip._thread
    if thread is not None:
        thread.join(0.1)  # it ends by itself, a moment after the request
    return controller._is_sending or (thread is not None and thread.is_alive())


def files():
    return len(list(Path("/proc/self/fd").iterdir())) if sys.platform == "linux" else 0


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_opening_and_closing_again_and_again_leaves_nothing(transport):
    with plugged(Controller(Numbered()), transport) as (where, _):
        gc.collect()
        before = threading.active_count(), files()
        for _ in range(3):
            with open_sensor(**where, protocol="strata") as sensor:
                sensor.configure(SMALL)
                assert len(list(sensor.frames(2))) == 2
        # A pty looks once more, for a moment, whether anything is left of a client that has gone.
        assert is_soon(lambda: (threading.active_count(), files()) == before)


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_forgotten_sensor_gives_its_port_back(transport):
    controller = Controller(Numbered())
    with plugged(controller, transport) as (where, _):
        sensor = open_sensor(**where, protocol="strata")
        sensor.configure(SMALL)
        frames = sensor.frames()
        next(frames)
        del sensor, frames
        gc.collect()
        assert not is_measuring(controller)
        open_sensor(**where, protocol="strata").close()


def test_forgotten_sensor_is_closed_whichever_thread_finds_it():
    def opens():
        with suppress(SensorError):
            open_sensor(**where).close()
            return True

    with plugged(Controller(Numbered()), "cdc") as (where, _):
        kept = [open_sensor(**where)]
        thread = threading.Thread(target=kept.clear)
        thread.start()
        thread.join()
        assert is_soon(opens), "the port is still in use"


def test_closing_from_another_thread_ends_the_wait_for_a_frame_at_once():
    controller = Controller(Numbered())
    with plugged(controller, "cdc") as (where, _):
        sensor = open_sensor(**where)
        sensor.configure(rc.bgt60tr13c(num_samples=32, num_chirps=8, frame_interval=5.0))
        frames = sensor.frames()
        next(frames)
        threading.Timer(0.2, sensor.close).start()
        began = time.monotonic()
        with pytest.raises(SensorError, match="no more frames, the sensor was closed"):
            next(frames)
        assert time.monotonic() - began < AT_ONCE
        sensor.close()  # waits for the running one: then the port is free
        open_sensor(**where).close()


def test_stopping_ends_the_iteration_quietly():
    with opened(Controller(Numbered()), radar=SMALL) as sensor:
        began, given = time.monotonic(), 0
        for _ in sensor.frames():
            given += 1
            if given == 3:
                sensor.stop()
        assert given == 3
        assert time.monotonic() - began < AT_ONCE


def test_second_iteration_ends_the_first_with_an_error():
    with opened(Controller(Numbered()), radar=SMALL) as sensor:
        first, second = sensor.frames(), sensor.frames(3)
        assert number_of(next(first).raw) == 0
        assert number_of(next(second).raw) == 0
        with pytest.raises(SensorError, match="no more frames, measuring was begun anew"):
            next(first)
        assert [number_of(frame.raw) for frame in second] == [1, 2], "the second continues"


def test_settings_are_those_at_the_first_frame():
    with opened(Controller(Numbered()), radar=SMALL) as sensor:
        frames = sensor.frames(1)
        achieved = sensor.configure(rc.bgt60tr13c(num_samples=64, num_chirps=4, frame_interval=25e-3))
        frame = next(frames)
        assert frame.radar is achieved
        assert frame.cube.shape == (3, 4, 64)
        frames = sensor.frames(1)
    with pytest.raises(SensorError, match="got one that is closed"):
        next(frames)


def test_error_in_the_middle_of_recording_ends_measuring_although_somebody_keeps_the_error(tmp_path, monkeypatch):
    controller = Controller(Numbered())
    with opened(controller, radar=SMALL) as sensor:
        monkeypatch.setattr(rc.RecordingWriter, "append", _full_disk)
        with pytest.raises(OSError, match="disk") as kept:
            sensor.record(tmp_path / "rec", progress=False)
        assert kept.value.__traceback__ is not None
        assert not is_measuring(controller)


def _full_disk(self, frame):
    raise OSError("no room on the disk")


def test_what_went_wrong_first_is_told_where_stopping_fails_too(monkeypatch):
    def silent(*, is_silent=False):
        raise SensorTimeoutError("no answer to stop")

    with opened(Controller(Numbered()), radar=SMALL) as sensor, monkeypatch.context() as patch:
        frames = sensor.frames(timeout=0.5)
        next(frames)
        patch.setattr(sensor._board, "stop", silent)
        with pytest.raises(KeyError):
            frames.throw(KeyError("the reader's actions"))


@pytest.mark.parametrize("step", ["start", "stop"])
def test_interrupted_conversation_still_leaves_a_board_that_does_not_measure(step, monkeypatch):
    """Ctrl-C between any two requests of a start or a stop."""
    controller = Controller(Numbered())
    with plugged(controller, "cdc") as (where, _):
        for number in range(4):
            with suppress(KeyboardInterrupt), open_sensor(**where) as sensor:
                sensor.configure(SMALL)
                frames = sensor.frames()
                if step == "stop":
                    next(frames)
                _interrupt(monkeypatch, sensor._board._link, number)
                if step == "stop":
                    sensor.stop()
                else:
                    next(frames)
            assert not is_measuring(controller)


def _interrupt(monkeypatch, link, number):
    """Ctrl-C after so many more requests, once."""
    ask, left = link.ask, [number]

    def interrupted(request, *arguments, **options):
        answer = ask(request, *arguments, **options)
        left[0] -= 1
        if left[0] == -1:
            raise KeyboardInterrupt
        return answer

    monkeypatch.setattr(link, "ask", interrupted)


def test_measurement_after_an_interrupted_start_has_its_own_frames(monkeypatch):
    with opened(Controller(Numbered()), radar=SMALL) as sensor:
        with monkeypatch.context() as patch:
            _interrupt(patch, sensor._board._link, 3)
            with pytest.raises(KeyboardInterrupt):
                next(sensor.frames())
        time.sleep(0.1)  # frames of the first one come
        assert [number_of(frame.raw) for frame in sensor.frames(3)] == [0, 1, 2]


def test_temperature_may_be_asked_for_while_measuring_starts_anew():
    controller = Controller(Numbered(), speed=20.0, temperature=41.5, faults=Faults(overflow=0.3, seed=2))
    with opened(controller) as sensor, pytest.warns(match="started anew"):  # noqa: PT031  # on the way
        sensor.configure(SMALL)
        frames = sensor.frames()
        for _ in range(8):
            next(frames)
            sensor._board._temperature = (-1.0, 0.0)  # earlier data is invalid
            assert sensor.temperature() == pytest.approx(41.5, abs=0.3)
        frames.close()


@pytest.mark.skipif(os.name != "posix", reason="needs a pty")
def test_interrupt_at_any_moment_leaves_a_sensor_that_measures():
    """Ctrl-C comes between calls of functions; here it comes, one after the other, behind many of a measurement."""
    pytest.importorskip("serial", reason="needs the extra `usb`: pip install radarcore[usb]")
    program = (
        "import _thread, sys, time, radarcore as rc\n"
        "def measure(num_frames, moment):\n"
        "    count = 0\n"
        "    def interrupt(frame, event, argument):\n"
        "        nonlocal count\n"
        "        count += event in ('call', 'c_return')\n"
        "        if count == moment:\n"
        "            sys.setprofile(None)\n"
        "            raise KeyboardInterrupt\n"
        "    sys.setprofile(interrupt)\n"
        "    try:\n"
        "        frames = list(sensor.frames(num_frames))\n"
        "    finally:\n"
        "        sys.setprofile(None)\n"
        "    return len(frames), count\n"
        "with rc.open_sensor(sys.argv[1], protocol='strata') as sensor:\n"
        "    sensor.configure(rc.bgt60tr13c(num_samples=32, num_chirps=8, frame_interval=10e-3))\n"
        "    _, number = measure(1, 0)\n"
        "    before = _thread._count()\n"
        "    for moment in range(1, number, max(1, number // int(sys.argv[2]))):\n"
        "        print(moment, end=' ', flush=True)\n"
        "        try:\n"
        "            measure(1, moment)\n"
        "        except KeyboardInterrupt:\n"
        "            pass\n"
        "    assert measure(3, 0)[0] == 3\n"
        "    until = time.monotonic() + 5.0\n"
        "    while _thread._count() > before and time.monotonic() < until:\n"
        "        time.sleep(0.01)\n"
        "    assert _thread._count() <= before, (_thread._count(), before)\n"
        "print('done')\n"
    )
    controller = Controller(Numbered())
    with PtyPort(CdcBoard(controller)) as port, python(program, port.path, 40) as process:
        printed, errors = process.communicate(timeout=60)
        assert printed.split()[-1:] == ["done"], f"{printed}\n{errors}"
    controller.close()
