"""Simulators in use: read-only settings, frames placed ahead, several threads, Ctrl-C and other processes."""

from __future__ import annotations

import dataclasses
import os
import pickle
import signal
import threading
import time
import warnings
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from interrupts import time_to_hear
from radarcore.simulate.side_by_side import in_order

WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=2e13, sample_rate=2e6, num_samples=32, num_chirps=8, chirp_interval=300e-6
)
RADAR = rc.Radar(WAVEFORM, rx=[[0.0, 0.0, 0.0], [0.0, 0.0025, 0.0]])
MATT = rc.Material(-0.5, 0.5)
WALL = rc.Body(rc.shapes.plate(4.0, 4.0), motion=rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=[1.0, 0.0, 0.0]))


def moving_bodies() -> list[Any]:
    """Uniform, by a function of time, at rest, deforming, and a point."""
    ball = rc.shapes.sphere(0.1, subdivisions=2)
    return [
        rc.Body(ball, motion=rc.Linear(rc.Pose([2.0, 0.3, 0.0]), velocity=[-0.5, 0.2, 0.0]), material=MATT),
        rc.Body(ball, motion=lambda t: rc.Pose([1.5 + 0.1 * np.sin(9.0 * t), -0.3, 0.1])),
        rc.Body(rc.shapes.plate(0.5, 0.5), motion=rc.Pose([3.0, 0.0, 0.0]), material=MATT),
        rc.Body(
            ball, motion=rc.Pose([1.8, 0.0, -0.3]), deformation=lambda t: ball.vertices * (1.0 + 0.1 * np.sin(9.0 * t))
        ),
        rc.PointTarget([2.5, 0.4, 0.3], velocity=[0.0, 0.5, 0.0]),
    ]


def simulator(bodies: list[Any] | None = None, radar: rc.Radar = RADAR, **options: Any) -> rc.Simulator:
    settings: dict[str, Any] = {"resolution": 32, "field_of_view_deg": (40.0, 40.0)} | options
    return rc.Simulator(rc.Scene(moving_bodies() if bodies is None else bodies), radar, **settings)


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(rc.Simulator)])
def test_settings_are_read_only(name: str) -> None:
    sim = simulator([])
    with pytest.raises(AttributeError, match=f"{name}: attributes of Simulator are read-only"):
        setattr(sim, name, getattr(sim, name))


def test_replaced_settings_make_another_simulator() -> None:
    sim = simulator(seed=1)
    before = sim.frame(0.1)
    other = dataclasses.replace(sim, seed=2)
    assert (sim.seed, other.seed, other.resolution) == (1, 2, sim.resolution)
    np.testing.assert_array_equal(other.frame(0.1).cube, simulator(seed=2).frame(0.1).cube)
    assert not np.array_equal(other.frame(0.1).cube, before.cube)  # speckle of the matt bodies
    np.testing.assert_array_equal(sim.frame(0.1).cube, before.cube)
    with pytest.raises(ValueError, match=r"tolerance: expected a number from 1e-12 to 0.1, got -1"):
        dataclasses.replace(sim, tolerance=-1.0)


@pytest.mark.parametrize(("sampling", "threads"), [("adaptive", 3), ("footprint", 2)])
def test_frames_side_by_side_are_those_one_by_one(sampling: str, threads: int) -> None:
    recording = simulator(sampling=sampling, threads=threads).record(0.2, 0.7, 40.0, progress=False)
    assert len(recording) == 20  # more than are placed together
    for frame, expected in zip(recording.frames(), simulator(sampling=sampling).frames(0.2, 0.7, 40.0), strict=True):
        assert frame.time == expected.time
        np.testing.assert_array_equal(frame.cube, expected.cube)
        assert frame.truth is not None
        assert expected.truth is not None
        for name in ("range", "velocity", "azimuth", "elevation"):
            np.testing.assert_array_equal(getattr(frame.truth, name), getattr(expected.truth, name))


def test_larger_budgets_of_rays_let_fewer_frames_share_the_memory() -> None:
    budgets = (10_000, 1_000_000, 2**31, np.inf)
    numbers = [simulator(ray_budget=budget)._most_side_by_side for budget in budgets]
    assert numbers[0] > numbers[1] > numbers[2] == numbers[3] == 0, numbers  # 0: one by one


def test_two_threads_that_share_a_simulator_get_the_frames_of_one() -> None:
    times = [0.05 * k for k in range(6)]
    expected = [simulator().frame(at).cube for at in times]
    shared = simulator()
    got: dict[tuple[int, float], Any] = {}

    def work(worker: int) -> None:
        for at in times[worker::2] + times[::-1]:
            got[worker, at] = shared.frame(at).cube

    workers = [threading.Thread(target=work, args=(worker,)) for worker in range(2)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert len(got) == 2 * len(times)
    for (_, at), cube in got.items():
        np.testing.assert_array_equal(cube, expected[times.index(at)])


def test_used_simulator_travels_with_equal_bits() -> None:
    bodies = [body for body in moving_bodies() if isinstance(getattr(body, "motion", None), rc.Pose | rc.Linear)]
    sim = simulator([body for body in bodies if body.deformation is None])
    used = [sim.frame(at).cube for at in (0.0, 0.1)]
    sim.depth_image(0.1)
    again = pickle.loads(pickle.dumps(sim))
    np.testing.assert_array_equal([again.frame(at).cube for at in (0.0, 0.1)], used)


def test_results_come_in_order_and_what_nobody_wants_is_stopped() -> None:
    stopped: list[str] = []
    in_use: dict[str, threading.Lock] = {}

    def work(worker: str, item: int, _: object) -> tuple[str, int]:
        busy = in_use.setdefault(worker, threading.Lock())
        assert busy.acquire(blocking=False)
        time.sleep(0.01 * (item % 3))
        busy.release()
        if item == 7:
            raise ValueError("seven")
        return worker, item

    workers = ["a", "b", "c"]
    found = list(in_order(work, range(7), workers, stopped.append))
    assert [item for _, item in found] == list(range(7))
    assert {worker for worker, _ in found} == set(workers)
    assert list(in_order(work, range(7), workers[:1], stopped.append)) == [("a", item) for item in range(7)]
    assert stopped == []
    results = in_order(work, range(1000), workers, stopped.append)
    assert [next(results)[1] for _ in range(7)] == list(range(7))
    with pytest.raises(ValueError, match="seven"):
        next(results)
    assert stopped == workers
    early = in_order(work, range(1000), workers, stopped.append)
    next(early)
    early.close()
    assert stopped == 2 * workers


def test_workers_whose_questions_nobody_answers_any_more_end() -> None:
    """Functions run in the thread that takes the results: an error ends an item, an interrupt all of them."""
    asked_in: list[int] = []

    def fault(item: int) -> int:
        asked_in.append(threading.get_ident())
        if item == 3:
            raise ValueError("three")
        if item == 5:
            raise KeyboardInterrupt
        return item

    def work(_: str, item: int, ask: Any) -> Any:
        return ask(lambda: fault(item))

    for items, error in (([0, 1, 2, 3, 4], ValueError), ([0, 1, 2, 5, 4], KeyboardInterrupt)):
        with pytest.raises(error):
            list(in_order(work, items, ["a", "b", "c"], lambda _: None))
    assert set(asked_in) == {threading.get_ident()}


@pytest.mark.parametrize("beside", ["interferer", "fast motion", "single sample"])
def test_functions_of_users_are_called_by_the_thread_that_records(beside: str) -> None:
    called_in: set[int] = set()

    def along(speed: float, y: float) -> Any:
        def at(time: float) -> rc.Pose:
            called_in.add(threading.get_ident())
            return rc.Pose([2.0 + 0.3 * np.sin(speed * time), y, 0.0])

        return at

    plate = rc.shapes.plate(0.3, 0.3)

    def grown(time: float) -> Any:
        called_in.add(threading.get_ident())
        return plate.vertices * (1.0 + 0.01 * np.sin(9.0 * time))

    radar = rc.Radar(WAVEFORM.replace(num_samples=1, num_chirps=1)) if beside == "single sample" else RADAR
    parts: list[Any] = [
        rc.Body(plate, motion=along(5000.0 if beside == "fast motion" else 9.0, 0.0)),
        rc.Body(plate, motion=rc.Pose([2.5, 0.4, 0.0]), deformation=grown),
    ]
    if beside == "interferer":
        parts.append(rc.Interferer(RADAR, along(9.0, -1.0)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the fast motion's accuracy
        sim = simulator(parts, radar, threads=3, radar_motion=lambda time: along(1.0, 0.0)(time).inverse())
        recording = sim.record(0.2, 0.35, 40.0, progress=False)
        assert called_in == {threading.get_ident()}
        np.testing.assert_array_equal(recording.cube[3], sim.frame(recording.time[3]).cube)


@pytest.mark.usefixtures("hears_interrupts")
def test_interrupt_ends_frames_side_by_side() -> None:
    long = rc.Radar(WAVEFORM.replace(num_samples=256, num_chirps=256))
    sim = simulator([WALL], long, resolution=512, sampling="footprint", method="direct", threads=2)
    # Of half a minute for each of ten frames.
    assert time_to_hear(lambda: sim.record(0.0, 1.0, 10.0, progress=False), after=0.3) < 4.0


@pytest.mark.usefixtures("hears_interrupts")
def test_interrupted_simulator_gives_the_bits_of_a_fresh_one() -> None:
    radar = rc.Radar(WAVEFORM.replace(num_samples=64, num_chirps=64))
    options: dict[str, Any] = {"sampling": "footprint", "method": "direct", "resolution": 128}
    expected = simulator([WALL], radar, **options).frame().cube
    sim = simulator([WALL], radar, **options)
    threading.Timer(0.1, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        list(sim.frames(0.0, 100.0))
    np.testing.assert_array_equal(sim.frame().cube, expected)
