"""`radarcore sensor serve`, and clients of it."""

import gc
import threading
import time
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

import radarcore as rc
from doubles.boards import SWING
from radarcore.sensor import SensorTimeoutError, open_sensor, virtual_board
from radarcore.sensor.bgt60.registers import start_words
from radarcore.sensor.bgt60.settings import Settings, achieved, registers_of
from radarcore.sensor.emulator.pty import PtyPort
from radarcore.sensor.emulator.source import Noise, Playback
from radarcore.virtual.source import Simulated, Worker

# Another radar than the scene file's: the client's settings are simulated.
CLIENT = rc.bgt60tr13c(
    start_frequency=60e9,
    stop_frequency=61e9,
    num_samples=128,
    num_chirps=32,
    chirp_interval=500e-6,
    frame_interval=50e-3,
)


@pytest.fixture
def swing(tmp_path):
    path = tmp_path / "swing.toml"
    path.write_text(SWING)
    return path


@contextmanager
def virtual_sensor(source, **options):
    """The sensor of a virtual board behind a pty."""
    with (
        virtual_board(source, **options) as board,
        PtyPort(board) as port,
        open_sensor(port.path, protocol="strata") as sensor,
    ):
        yield sensor


def test_client_tracks_a_moving_scene_for_a_minute(swing):
    simulation = rc.load_scene(swing)
    with virtual_sensor(simulation, speed=None) as sensor:
        seldom = replace(CLIENT, waveform=CLIENT.waveform.replace(frame_interval=2.4))
        radar = sensor.configure(seldom, if_gain_db=60)
        wf = radar.waveform
        frames = list(sensor.frames(25))
        assert sensor.num_lost == 0
    np.testing.assert_allclose([frame.time for frame in frames], np.arange(25) * wf.frame_interval, atol=1e-4)
    peaks = [rc.strongest_peak(frame.cube - frame.cube.mean(axis=-1, keepdims=True), wf) for frame in frames]
    ranges, velocities = (np.array([getattr(peak, name) for peak in peaks]) for name in ("range", "velocity"))
    assert np.ptp(ranges) > 2.0, "it swings"
    assert np.ptp(velocities) > 0.5
    # The truth holds for the middle of a frame, as the peak does.
    # A tenth of a bin: a wrong slope or wavelength, a frame too late or swapped chirps would miss by more.
    truth_of = simulation.simulator().with_radar(radar)
    truths = [truth_of.frame(frame.time).truth for frame in frames]
    range_error = ranges - [truth.range[0] for truth in truths]
    velocity_error = velocities - [truth.velocity[0] for truth in truths]
    assert np.abs(range_error).max() < 0.1 * wf.range_resolution
    assert np.abs(velocity_error).max() < 0.1 * wf.velocity_resolution


def test_what_the_client_sets_is_simulated(swing):
    with virtual_sensor(rc.load_scene(swing), speed=None) as sensor:
        # Wide sweeps would put the plate beyond the range of 64 samples.
        for num_chirps, num_samples, stop in ((8, 64, 60.4e9), (16, 256, 61.5e9)):
            wanted = rc.bgt60tr13c(
                start_frequency=60e9, stop_frequency=stop, num_chirps=num_chirps, num_samples=num_samples
            )
            radar = sensor.configure(wanted, if_gain_db=60)
            (frame,) = sensor.frames(1)
            assert frame.cube.shape == (3, num_chirps, num_samples)
            peak = rc.strongest_peak(frame.cube - frame.cube.mean(axis=-1, keepdims=True), radar.waveform)
            assert peak.range == pytest.approx(1.5, abs=0.2 * radar.waveform.range_resolution)


def test_angles_of_a_board_are_right_with_the_phases_of_its_receivers():
    wanted = rc.bgt60tr13c(receiver="measured", if_gain_db=33, num_chirps=16)
    scene = rc.Scene([rc.PointTarget([1.5, 0.3, 0.2], rcs=1.0, velocity=[0.5, 0.0, 0.0])])
    with virtual_sensor(rc.Simulator(scene, wanted), speed=None) as sensor:
        radar = sensor.configure(wanted, if_gain_db=33)
        (frame,) = sensor.frames(1)
        weighted = sensor.configure(replace(wanted, channel_weights=[1.0, 1j, 0.5]), if_gain_db=33)
    assert weighted.channel_weights.tolist() == [1.0, 1j, 0.5]
    assert radar.receiver.rx_phase_deg == wanted.receiver.rx_phase_deg
    found = rc.detect(frame)
    # 37 dB of SNR leave a fraction of a degree; 75 degrees between two receivers would be 25 degrees off.
    np.testing.assert_allclose(np.rad2deg(found.azimuth), [np.rad2deg(np.arctan2(0.3, 1.5))], atol=2.0)
    np.testing.assert_allclose(
        np.rad2deg(found.elevation), [np.rad2deg(np.arcsin(0.2 / np.hypot(1.53, 0.2)))], atol=2.0
    )


def test_level_is_that_of_the_radar_equation():
    """1 m^2 at 1 m on boresight: 2.5 mW, 3.5 dBi twice, 12 dB of receiver noise below one code at 23 dB."""
    point = rc.PointTarget([1.0, 0.0, 0.0], rcs=1.0)
    radar = rc.bgt60tr13c(start_frequency=60e9, stop_frequency=61e9, num_samples=128, num_chirps=1)
    simulator = rc.Simulator(rc.Scene([point]), radar, resolution=8)
    codes = Simulated(simulator, receiver="ideal").frame(radar, 0, 0.0, if_gain_db=40.0).astype(float) - 2047.5
    wavelength = radar.waveform.wavelength
    gain = 10.0**0.35
    power = 2.51e-3 * gain**2 * wavelength**2 / (4.0 * np.pi) ** 3
    volt = np.sqrt(2.0 * 50.0 * power) * 10.0 ** ((14.0 + 40.0) / 20.0)
    assert np.abs(codes).max() == pytest.approx(volt / 1.21 * 2047.5, rel=0.05)


def test_playback_gives_a_recording_over_and_over_and_refuses_other_settings(tmp_path):
    radar = achieved(Settings.from_radar(rc.bgt60tr13c(num_chirps=8))).to_radar()
    noise = Noise(seed=5)
    raw = np.stack([noise.frame(radar, index, 0.0) for index in range(3)])
    recording = rc.Recording(
        (raw * 2.0 / 4095.0 - 1.0).astype(np.float32),
        np.arange(3) * radar.waveform.frame_interval,
        radar,
        source={"cube_unit": "full scale"},
    )
    with virtual_sensor(recording, speed=None) as sensor:
        sensor.configure(radar)
        for index, frame in enumerate(sensor.frames(7)):
            np.testing.assert_array_equal(frame.raw, raw[index % 3])
    with pytest.raises(ValueError, match="as recorded"):
        Playback(recording).frame(rc.bgt60tr13c(num_chirps=9), 0, 0.0)


def test_serve_tells_why_no_frames_come(swing):
    with virtual_board(rc.load_scene(swing), speed=None) as board:
        assert board.news() == []
        image = registers_of(Settings.from_radar(rc.bgt60tr13c()), 6144)
        image[0x37] = 0  # no shape
        board.controller.chip.execute(start_words(image))
        (line,) = board.news()
        assert line.startswith("the client's settings give no frames: ")
        assert board.news() == [], "once"


def test_client_that_asks_for_the_temperature_is_no_news(swing):
    """The chip is idle then, in a mode that has no frames."""
    with virtual_board(rc.load_scene(swing)) as board, PtyPort(board) as port:
        with open_sensor(port.path, protocol="strata") as sensor:
            sensor.temperature()
        assert board.news() == []


def test_source_that_fails_is_told_to_whoever_serves():
    class Wrong:
        def frame(self, radar, index, time, **gains):
            raise ValueError("radar: expected what was recorded")

    with virtual_board(Wrong(), speed=None) as board, PtyPort(board) as port:
        with open_sensor(port.path, protocol="strata") as sensor:
            sensor.configure(rc.bgt60tr13c(num_chirps=4))
            with pytest.raises(SensorTimeoutError, match="no frame within"):
                next(sensor.frames(timeout=0.2))
        assert board.news() == ["the client's settings give no frames: radar: expected what was recorded"]
        open_sensor(port.path, protocol="strata").close()


class Clock:
    """Time of a host that passes only where something waits for it."""

    def __init__(self):
        self.now = 0.0

    def monotonic(self):
        return self.now

    def wait(self, seconds):
        self.now += seconds


class Paced:
    """Noise that takes a time of its own for every frame."""

    def __init__(self, seconds, wait=time.sleep):
        self.seconds, self.wait, self.noise = seconds, wait, Noise()

    def frame(self, radar, index, time_of_frame, **gains):
        self.wait(self.seconds(index))
        return self.noise.frame(radar, index, time_of_frame, **gains)


@pytest.mark.parametrize(
    ("seconds", "speed", "lines"),
    [
        (lambda index: 0.1, 1.0, ["simulated at 0.5 of real time over the last 10 s"] * 4),
        (lambda index: 0.05, 2.0, ["simulated at 1 of real time (2 asked for) over the last 10 s"] * 2),
        # The first frame cannot be made ahead, and a host is busy now and then.
        (lambda index: {0: 0.5, 10: 0.06, 70: 0.2}.get(index, 0.0), 1.0, []),
    ],
    ids=["slow", "slower than asked for", "late now and then"],
)
def test_serve_tells_every_ten_seconds_of_a_scene_that_is_slow_and_of_no_other(seconds, speed, lines, monkeypatch):
    clock = Clock()
    monkeypatch.setattr("radarcore.sensor.emulator.chip.time", clock)
    settings = Settings.from_radar(rc.bgt60tr13c(num_chirps=8, frame_interval=50e-3))
    with virtual_board(Paced(seconds, clock.wait), speed=speed) as board:
        chip = board.controller.chip
        monkeypatch.setattr(chip._lock, "wait", clock.wait)
        monkeypatch.setattr(chip, "_on_samples", chip._empty)  # a client that is never late
        num_frames = 410 if lines else 600
        chip.execute(start_words(registers_of(replace(settings, num_frames=num_frames), 6144)))
        chip._thread.join()
        told = board.news()
        assert [line.partition(":")[0] for line in told] == lines
        assert board.news() == [], "each once"


def test_board_answers_while_a_frame_takes_long_to_simulate():
    """A client that stops or asks is not kept waiting for the scene."""
    is_begun, is_done = threading.Event(), threading.Event()

    def wait(index):
        if index > 0:
            is_begun.set()
            is_done.wait(60.0)

    with virtual_sensor(Paced(lambda index: index, wait)) as sensor:
        sensor.configure(rc.bgt60tr13c(num_chirps=8))
        frames = sensor.frames()
        next(frames)
        assert is_begun.wait(30.0)
        began = time.monotonic()
        for call in (sensor.temperature, frames.close, sensor.temperature):
            sensor._board._temperature = (-1.0, 0.0)  # earlier data is invalid
            call()
        assert time.monotonic() - began < 5.0, "the scene takes a minute"
        # The next measurement has the source when the last one has given it back.
        again = sensor.frames(1, timeout=0.3)
        with pytest.raises(SensorTimeoutError):
            next(again)
        is_done.set()
        (frame,) = sensor.frames(1, timeout=10.0)
        assert frame.stats["index"] == 0


def test_thread_ends_with_whoever_has_it():
    worker = Worker("forgotten worker")
    (thread,) = (one for one in threading.enumerate() if one.name == "forgotten worker")
    assert worker.result(worker.begin(lambda: 1)) == 1
    del worker
    gc.collect()
    thread.join(30.0)
    assert not thread.is_alive()
