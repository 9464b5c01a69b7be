"""Identities of paths of several reflections, reciprocity among them, and where they end."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from bounce_scenes import CHANNELS, POLARIZATIONS, ball, body, room, simulator, tone, transfer_function

# --- identities ----------------------------------------------------------------------------------------------------


CORNERS: dict[str, tuple[rc.Mesh, float, list[float]]] = {
    "dihedral at 0.5 m": (rc.shapes.dihedral(0.1), 0.5, [0.1, 0.05, 0.15]),
    "dihedral at 1 m": (rc.shapes.dihedral(0.1), 1.0, [0.1, 0.02, 0.15]),
    "dihedral at 4 m": (rc.shapes.dihedral(0.1), 4.0, [0.1, 0.02, 0.15]),
    "trihedral": (rc.shapes.trihedral(0.1), 1.0, [0.05, 0.04, 0.1]),
    "square trihedral": (rc.shapes.trihedral(0.1, shape="square"), 5.0, [0.3, -0.1, 0.2]),
}


# One corner of each order in all polarisations, the others in one.
@pytest.mark.parametrize(
    ("name", "polarization"),
    [
        *product(["dihedral at 0.5 m", "trihedral"], POLARIZATIONS),
        ("dihedral at 1 m", "vertical"),
        ("dihedral at 4 m", "horizontal"),
        ("square trihedral", None),
    ],
)
def test_transmitter_and_receiver_may_change_places(name: str, polarization: str | None) -> None:
    mesh, distance, rpy = CORNERS[name]
    places, angle = ([[0.0, 0.004, 0.001]], [[0.0, -0.003, -0.002]]), 13.0 / distance
    there, back = (
        transfer_function(
            simulator(
                [body(mesh, [distance, 0.0, 0.0], rpy=rpy)],
                rc.Radar(tone(), tx=tx, rx=rx, polarization=polarization),
                sampling="adaptive",
                resolution=128,
                field_of_view_deg=(angle, angle),
            )
        )
        for tx, rx in (places, places[::-1])
    )
    assert abs(there) * distance**2 > 1e-5
    assert abs(there - back) < 1e-9 * abs(there)


@pytest.mark.parametrize("sampling", ["footprint", "adaptive"])
def test_so_may_arrays_with_their_patterns(sampling: str) -> None:
    beams = [rc.GaussianPattern(10.0, beamwidth, 40.0) for beamwidth in (30.0, 50.0, 70.0)]
    ends: list[tuple[Any, Any]] = [
        ([[0.0, 0.06, 0.01], [0.01, -0.05, 0.0]], beams[:2]),
        ([[0.0, 0.03, 0.0], [0.0, 0.01, -0.03], [0.0, 0.0, 0.02]], beams[::-1]),
    ]
    there, back = (
        simulator(
            room(),
            rc.Radar(tone(), tx=tx[0], rx=rx[0], tx_patterns=tx[1], rx_patterns=rx[1]),
            sampling=sampling,
            resolution=96,
        )
        .frame()
        .cube
        for tx, rx in (ends, ends[::-1])
    )
    swapped = back.reshape(3, 2).T.reshape(there.shape)
    np.testing.assert_allclose(there, swapped, rtol=0, atol=1e-9 * np.abs(there).max())


def test_one_reflection_is_what_it_was_and_a_ball_alone_has_no_more() -> None:
    settings: dict[str, Any] = {"sampling": "footprint", "resolution": 64, "field_of_view_deg": (60.0, 60.0)}
    default = rc.Simulator(rc.Scene(room()), rc.Radar(tone()), tolerance=1e-9, **settings)
    single = simulator(room(), resolution=64, max_bounces=1)
    np.testing.assert_array_equal(default.frame().cube, single.frame().cube)
    assert single.frame().stats["bounce_paths"] == 0
    one, many = (simulator([ball()], resolution=128, max_bounces=n).frame() for n in (1, 4))
    np.testing.assert_array_equal(one.cube, many.cube)
    assert many.stats["bounce_rays"] > 50
    assert many.stats["bounce_paths"] == 0


def test_results_do_not_depend_on_the_number_of_threads() -> None:
    sims = [simulator(room(), CHANNELS, resolution=96, threads=threads) for threads in (1, 3)]
    first, second = (sim.frame() for sim in sims)
    assert first.stats["bounce_paths"] > 100
    np.testing.assert_array_equal(first.cube, second.cube)


def test_paths_of_bodies_that_stand_still_are_taken_once() -> None:
    waveform = rc.Waveform(
        start_frequency=60e9, slope=20e12, sample_rate=2e6, num_samples=64, num_chirps=16, chirp_interval=300e-6
    )
    walking = ball(rc.Linear(rc.Pose([0.9, 0.15, 0.0]), velocity=[0.5, 0.0, 0.0]))
    bodies = [*room(), walking]
    frame = simulator(bodies, rc.Radar(waveform), resolution=128, tolerance=1e-5).frame()
    assert 0 < frame.stats["still_paths"] < frame.stats["paths"]
    # The same with nothing known to stand still.
    riding = [rc.Body(b.mesh, material=b.material, motion=rc.Linear(b.motion.at(0.0))) for b in room()]
    all_moving = simulator([*riding, walking], rc.Radar(waveform), resolution=128, tolerance=1e-5).frame()
    error = np.abs(frame.cube - all_moving.cube).max() / np.abs(frame.cube).max()
    assert error < 1e-4


# --- limits --------------------------------------------------------------------------------------------------------


def test_rays_end_at_the_floor_and_the_answer_stays_within_the_tolerance() -> None:
    # Rough walls leave little of what they mirror.
    rough = rc.materials["concrete"].with_surface(roughness=2e-3)
    mesh = rc.shapes.dihedral(0.4)
    bodies = [
        body(mesh, [1.5, 0.0, 0.0]),
        body(rc.shapes.plate(2.0, 2.0), [1.5, -0.6, 0.0], rpy=[0.0, 0.0, -1.2], material=rough),
    ]

    def frame(floor: float) -> rc.Frame:
        return simulator(bodies, resolution=128, max_bounces=4, bounce_floor_db=floor).frame()

    whole, most, little = frame(np.inf), frame(80.0), frame(10.0)
    assert whole.stats["bounces_stopped"] == 0
    assert most.stats["bounces_stopped"] > 0
    assert little.stats["bounces_stopped"] > most.stats["bounces_stopped"]
    assert most.stats["bounce_rays"] < whole.stats["bounce_rays"]
    assert np.abs(whole.cube - most.cube).max() <= 1e-4 * np.abs(whole.cube).max()


def test_matt_bodies_send_nothing_on() -> None:
    matt = rc.Material.lambertian(0.5)
    stats = simulator([body(rc.shapes.dihedral(0.4), [1.5, 0.0, 0.0], material=matt)], resolution=64).frame().stats
    assert (stats["bounce_paths"], stats["bounce_rays"]) == (0, 0)
    assert stats["bounces_stopped"] == stats["rays_hit"]


def test_adaptive_sampling_has_the_same_paths_of_several_reflections() -> None:
    target = body(rc.shapes.dihedral(0.1), [2.0, 0.0, 0.0])
    options: dict[str, Any] = {"field_of_view_deg": (5.0, 5.0), "max_bounces": 2}
    pixels = rc.Simulator(rc.Scene([target]), rc.Radar(tone()), sampling="footprint", **options).paths()
    cells = rc.Simulator(rc.Scene([target]), rc.Radar(tone()), sampling="adaptive", **options).paths()
    number = (
        rc.Simulator(rc.Scene([target]), rc.Radar(tone()), sampling="footprint", **options)
        .frame()
        .stats["bounce_paths"]
    )
    assert number > 1000
    np.testing.assert_array_equal(cells.delay[:, -number:], pixels.delay[:, -number:])
    np.testing.assert_array_equal(cells.amplitude[:, -number:], pixels.amplitude[:, -number:])
