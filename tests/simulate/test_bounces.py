"""Paths of several reflections against answers known on paper: images in walls, a ball above a floor."""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from bounce_scenes import (
    BALL,
    CHANNELS,
    CLOSE,
    CONDUCTOR,
    RADIUS,
    SENSOR,
    VIEW,
    VIEWS,
    WAVELENGTH,
    ball,
    body,
    bounce_paths,
    image_of,
    phasors,
    reflected_by_ball,
    simulator,
    sphere,
    tone,
    touched,
    wall,
)


@cache
def ghost_paths(view: str) -> rc.Paths:
    """Paths of two reflections, by ball and wall, as seen in `VIEWS`."""
    return bounce_paths(simulator([ball(), wall()], CHANNELS, **VIEWS[view]))


def ghost_length(center: NDArray[np.float64] = BALL) -> float:
    """Length of the way from the sensor over the ball to the image of the sensor [m]."""
    point = touched(SENSOR, image_of(SENSOR), center)
    return float(np.linalg.norm(point - SENSOR) + np.linalg.norm(point - image_of(SENSOR)))


def test_ghost_of_a_ball_beside_a_wall_has_the_range_of_its_path() -> None:
    waveform = rc.Waveform.from_sweep(start_frequency=60e9, stop_frequency=62e9, sample_rate=2e6, num_samples=128)
    frames = [
        simulator([ball(), wall()], rc.Radar(waveform), **VIEW | {"max_bounces": max_bounces}).frame()
        for max_bounces in (1, 2)
    ]
    assert frames[1].stats["bounce_paths"] > 100
    added = frames[1].cube - frames[0].cube
    for cube, expected in ((frames[0].cube, BALL[0] - RADIUS), (added, 0.5 * ghost_length())):
        profile = np.abs(rc.range_profile(cube, waveform, num_bins=2048)[0, 0])
        peak = waveform.range_axis(2048)[profile.argmax()]
        assert peak == pytest.approx(expected, abs=0.2 * waveform.range_resolution)


def test_ghost_has_the_level_and_the_angles_of_geometrical_optics() -> None:
    point, expected = touched(SENSOR, image_of(SENSOR)), reflected_by_ball(SENSOR, image_of(SENSOR))
    # Over the wall to the ball, and back, which an image of the ball alone shows as well.
    for last, view, arrives_from in ((0, "wide", point), (1, "wide", image_of(point)), (1, "close", image_of(point))):
        paths = ghost_paths(view)
        received = np.where(paths.body == last, phasors(paths), 0.0).sum(axis=1)
        assert 20.0 * np.log10(abs(received[0] / expected)) == pytest.approx(0.0, abs=0.4)
        assert np.angle(received[0] / expected) == pytest.approx(0.0, abs=0.1)
        # The second receiver, to the left, is nearer to what comes from the left.
        sine = np.angle(received[1] / received[0]) / (2.0 * np.pi / WAVELENGTH * 0.00125)
        assert sine == pytest.approx(arrives_from[1] / np.linalg.norm(arrives_from), abs=0.01)


@pytest.mark.parametrize(("tx_width", "rx_width"), [(np.inf, 30.0), (30.0, 50.0)])
def test_both_ends_of_a_ghost_have_the_gain_of_their_own_directions(tx_width: float, rx_width: float) -> None:
    """Straight ahead to the ball, 36 degrees aside to its image: 17 dB less in a beam of 30 degrees."""
    point = touched(SENSOR, image_of(SENSOR))
    isotropic = 20.0 * np.log10(abs(reflected_by_ball(SENSOR, image_of(SENSOR))))
    tx, rx = (
        rc.GaussianPattern(0.0, width, width) if np.isfinite(width) else rc.IsotropicPattern()
        for width in (tx_width, rx_width)
    )
    radar = rc.Radar(tone(), tx_patterns=[tx], rx_patterns=[rx])
    ends = point, image_of(point)
    for last, view in ((0, "wide"), (1, "wide"), (1, "close")):
        paths = bounce_paths(simulator([ball(), wall()], radar, **VIEWS[view]))
        received = np.where(paths.body == last, phasors(paths), 0.0).sum()
        # A wave that leaves for the image comes back from the ball, and vice versa.
        azimuths = np.rad2deg([np.arctan2(ends[i][1], ends[i][0]) for i in (1 - last, last)])
        gains = -40.0 * np.log10(2.0) * (azimuths / [tx_width, rx_width]) ** 2
        assert 20.0 * np.log10(abs(received)) == pytest.approx(isotropic + gains.sum(), abs=0.4)


def test_every_pair_of_antennas_far_apart_has_its_own_ghost() -> None:
    transmitters = np.array([[0.0, 0.06, 0.01], [0.01, -0.05, 0.0]])
    receivers = np.array([[0.0, 0.03, 0.0], [0.0, -0.02, -0.03]])
    radar = rc.Radar(tone(), tx=transmitters, rx=receivers)
    # Ways over the points of another transmitter would be up to a radian too long.
    wide, close = (
        bounce_paths(simulator([ball(), wall()], radar, **view))
        for view in (VIEW | {"resolution": (160, 2000)}, CLOSE | {"resolution": 384})
    )
    for last, paths in ((0, wide), (1, wide), (1, close)):
        received = np.where(paths.body == last, phasors(paths), 0.0).sum(axis=1)
        for channel, (tx, rx) in enumerate(product(transmitters, receivers)):
            ends = (image_of(tx), rx) if last == 0 else (tx, image_of(rx))
            ratio = received[channel] / reflected_by_ball(*ends)
            assert 20.0 * np.log10(abs(ratio)) == pytest.approx(0.0, abs=0.5)
            assert np.angle(ratio) == pytest.approx(0.0, abs=0.06)


def test_ghost_of_a_moving_ball_has_the_doppler_of_its_path() -> None:
    velocity = np.array([-0.8, 1.1, 0.0])
    waveform = rc.Waveform(
        start_frequency=60e9, slope=20e12, sample_rate=2e6, num_samples=128, num_chirps=64, chirp_interval=300e-6
    )
    middle = 0.5 * waveform.duration
    moving = ball(rc.Linear(rc.Pose(BALL - middle * velocity), velocity=velocity))
    sim = simulator([moving, wall()], rc.Radar(waveform), **VIEW | {"tolerance": 1e-4})
    step = 1e-3
    rate = (ghost_length(BALL + step * velocity) - ghost_length(BALL - step * velocity)) / (2.0 * step)
    peak = rc.strongest_peak(sim.frame().cube, waveform, min_range=np.linalg.norm(BALL) + 0.1)
    assert peak.range == pytest.approx(0.5 * ghost_length(), abs=0.02 * waveform.range_resolution)
    assert peak.velocity == pytest.approx(0.5 * rate, abs=0.01 * waveform.velocity_resolution)
    assert abs(0.5 * rate - velocity @ BALL / np.linalg.norm(BALL)) > waveform.velocity_resolution


def test_a_deformation_that_moves_all_vertices_is_a_motion() -> None:
    velocity, mesh = np.array([-0.8, 1.1, 0.3]), sphere(RADIUS)
    rigid = ball(rc.Linear(rc.Pose(BALL), velocity=velocity))
    shifted = rc.Body(
        mesh, material=CONDUCTOR, motion=rc.Pose(BALL), deformation=lambda t: mesh.vertices + t * velocity
    )
    first, second = (bounce_paths(simulator([b, wall()], CHANNELS, **VIEW), 0.01) for b in (rigid, shifted))
    assert first.delay.shape[1] > 100
    np.testing.assert_allclose(second.delay, first.delay, rtol=1e-11)
    np.testing.assert_allclose(second.delay_rate, first.delay_rate, rtol=1e-5, atol=1e-14)
    np.testing.assert_allclose(second.amplitude, first.amplitude, rtol=1e-5, atol=1e-9 * abs(first.amplitude).max())


def test_what_stands_in_the_way_hides_the_ghost() -> None:
    # A black screen between the wall and the ball.
    black = rc.Material(0.0)
    screen = body(rc.shapes.plate(1.2, 1.0), [1.1, -0.35, 0.0], rpy=[0.0, 0.0, -0.5 * np.pi], material=black)
    # One outside of what the image shows, between the sensor and the place where the wall mirrors the ball.
    near = body(rc.shapes.plate(0.12, 0.12), [0.15, -0.126, 0.0], rpy=[0.0, 0.0, -0.7], material=black)
    for view, hides in (("wide", screen), ("close", screen), ("close", near)):
        hidden = bounce_paths(simulator([ball(), wall(), hides], **VIEWS[view]))
        strength = [abs(phasors(paths)[0].sum()) for paths in (ghost_paths(view), hidden)]
        assert strength[0] > 1e-7
        assert strength[1] < 0.03 * strength[0]


# --- a curved second surface ---------------------------------------------------------------------------------------


def test_paths_that_have_not_converged_are_warned_of_once() -> None:
    """A person in a room of mirrors in a wide, coarse view: many edges, and few tubes for them."""
    sides = {
        (6.0, 0.1, 3.0): [(2.0, -2.0, 0.0), (2.0, 2.0, 0.0)],
        (0.1, 4.0, 3.0): [(4.0, 0.0, 0.0)],
        (6.0, 4.0, 0.1): [(2.0, 0.0, -1.2)],
    }
    walls = [body(rc.shapes.box(size), place) for size, places in sides.items() for place in places]
    person = rc.models.Human(height=1.75, speed=0.85, path=[[3.0, 0.8], [1.3, 0.3]]).bodies(name="person")
    view: dict[str, Any] = {"field_of_view_deg": (120.0, 120.0), "resolution": 128, "max_bounces": 3}
    sim = rc.Simulator(rc.Scene([*walls, *person]), rc.Radar(tone()), **view)
    with pytest.warns(UserWarning, match="paths of several reflections have not converged: ray tubes ran out"):
        sim.frame()
    sim.frame()  # without a warning
