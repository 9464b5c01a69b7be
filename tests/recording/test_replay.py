"""Recordings replayed: frames when they are due, by a clock that tests set."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from radarcore.recording.recording import Recording
from recordings import RADAR, WAVEFORM, assert_same, recording


class Clock:
    """A clock that advances only by sleep or by hand."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, duration: float) -> None:
        assert duration > 0.0
        self.now += duration


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    result = Clock()
    monkeypatch.setattr("time.monotonic", result)
    monkeypatch.setattr("time.sleep", result.sleep)
    return result


def of_times(*times: float) -> Recording:
    return Recording(np.zeros((len(times), 2, 4, 16), np.complex64), np.array(times), RADAR)


@pytest.mark.parametrize(("speed", "scale"), [(1.0, 1.0), (4.0, 0.25), (0.5, 2.0)])
def test_frames_are_replayed_when_they_are_due(clock: Clock, speed: float, scale: float) -> None:
    times = [7.0, 7.1, 7.15, 27.0]
    due = []
    for one in of_times(*times).replay(speed=speed):
        due.append((one.time, clock.now))
        clock.now += 0.005  # the consumer's time does not add up
    assert [time for time, _ in due] == times
    np.testing.assert_allclose([now for _, now in due], 100.0 + scale * (np.array(times) - 7.0), atol=1e-9)


def test_late_consumer_does_not_wait_until_it_has_caught_up(clock: Clock) -> None:
    seen = []
    for one in of_times(0.0, 0.1, 0.2, 0.3, 0.4).replay():
        seen.append(clock.now)
        clock.now += 0.25 if one.time == 0.0 else 0.0
    np.testing.assert_allclose(seen, [100.0, 100.25, 100.25, 100.3, 100.4], atol=1e-9)


def test_first_frame_comes_at_once_whenever_it_is_asked_for(clock: Clock) -> None:
    frames = of_times(5.0, 6.0).replay()
    clock.now = 200.0
    next(frames)
    assert clock.now == 200.0
    next(frames)
    assert clock.now == 201.0


@pytest.mark.parametrize("speed", [None, 1.0])
def test_replay_in_a_loop_goes_on_in_time(clock: Clock, speed: float | None) -> None:
    frames = list(itertools.islice(of_times(2.0, 2.1, 2.2).replay(speed=speed, loop=True), 8))
    np.testing.assert_allclose([one.time for one in frames], 2.0 + 0.1 * np.arange(8))
    assert clock.now == pytest.approx(100.0 if speed is None else 100.7)


def test_loop_of_a_single_frame_has_the_interval_of_the_radar() -> None:
    frames = list(itertools.islice(of_times(2.0).replay(speed=None, loop=True), 3))
    np.testing.assert_allclose([one.time for one in frames], 2.0 + WAVEFORM.frame_interval * np.arange(3))


def test_replay_without_waiting_gives_what_frames_gives() -> None:
    rec = recording()
    replayed = Recording.from_frames(rec.replay(speed=None), rec.source)
    assert_same(replayed, rec)
    assert list(of_times().replay(speed=None, loop=True)) == []
    assert list(of_times().replay()) == []
