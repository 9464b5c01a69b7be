"""Nearest point of a body: echoes that are separated, and the lead that follows from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import radarcore as rc
from radarcore.processing.tracking import front

RADAR = rc.bgt60tr13c()
WF = RADAR.waveform
BIN = WF.range_resolution


def points(*places: tuple[float, float], velocity: float = 0.5) -> rc.Scene:
    """Points in front of the radar: range at the start [m] and cross-section [m^2]."""
    return rc.Scene([rc.PointTarget([x, 0.0, 0.0], rcs=rcs, velocity=[velocity, 0.0, 0.0]) for x, rcs in places])


def test_echoes_within_one_main_lobe_are_separated_at_any_phase() -> None:
    """1.5 bins apart, 10 dB weaker: a Hann window's main lobe is four bins wide, and the detector mostly sees one."""
    num_detected = 0
    for phase in range(8):
        lead = 1.5 * BIN + phase * WF.wavelength / 16.0
        frame = rc.Simulator(points((3.0, 1.0), (3.0 - lead, 0.1)), RADAR).frame()
        true = 3.0 + 0.5 * RADAR.middle - np.array([0.0, lead])
        found, detected = front.echoes(frame, 3.0, 0.5), rc.detect(frame)
        assert found is not None
        assert np.abs(found.range - true[:, None]).min(axis=1).max() < 0.5 * BIN
        assert np.abs(found.velocity[0] - 0.5) < 0.1 * WF.velocity_resolution
        num_detected += np.abs(detected.range - true[1]).min() < 0.5 * BIN
    assert num_detected < 4


def test_level_of_an_echo_is_that_of_the_detector() -> None:
    frame = rc.Simulator(points((3.04, 0.1), velocity=3.0), RADAR).frame()
    detected, found = rc.detect(frame), front.echoes(frame, 3.0, 3.0)
    assert found is not None
    assert found.snr_db[0] == pytest.approx(detected.snr_db[0], abs=1.0)
    assert found.range[0] == pytest.approx(detected.range[0], abs=0.02 * BIN)  # its Doppler shift is 0.06 bins


def test_noise_and_empty_frames_have_no_strong_echoes() -> None:
    found = front.echoes(rc.Simulator(rc.Scene([]), RADAR).frame(), 3.0, 0.5)
    assert found is not None
    assert (found.snr_db < 12.0).all()
    nothing = rc.Frame(np.zeros((3, WF.num_chirps, WF.num_samples), np.float32), 0.0, RADAR)
    assert front.echoes(nothing, 3.0, 0.5) is None


def test_lead_without_echoes_is_that_of_the_prior_in_every_frame() -> None:
    mean, deviation = front.leads(np.ones((5, 81)), smooth=True)
    assert mean == pytest.approx(np.full(5, 0.15), abs=1e-3)
    assert deviation == pytest.approx(np.full(5, np.hypot(0.07, 0.05)), abs=1e-3)


def test_leads_are_those_of_all_paths_added() -> None:
    """Three frames, all paths through the grid enumerated: the marginal of each frame."""
    likelihoods = np.random.default_rng(3).uniform(size=(3, 81)) ** 8
    prior, changes = front._walk()
    np.testing.assert_allclose([changes.sum(axis=0), changes @ prior / prior], 1.0, rtol=1e-9)
    paths = np.einsum("i,ji,kj,i,j,k->ijk", prior, changes, changes, *likelihoods)
    for smooth, frames in ((True, range(3)), (False, [2])):
        mean, _ = front.leads(likelihoods, smooth=smooth)
        for k in frames:
            marginal = paths.sum(axis=tuple({0, 1, 2} - {k}))
            assert mean[k] == pytest.approx(marginal @ front._LEADS / marginal.sum(), rel=1e-9)


def test_strong_echo_in_front_is_the_nearest_point_and_a_weak_one_far_in_front_is_noise() -> None:
    def mean(*echoes: tuple[float, float]) -> float:
        lead, snr_db = np.array(echoes).T
        return float(front.leads(front._likelihood(lead, snr_db)[None], smooth=False)[0][0])

    hand, noise, trunk = (0.2, 25.0), (0.45, 9.0), (0.0, 30.0)
    assert mean(hand, trunk) == pytest.approx(0.2, abs=0.03)  # one deviation of an echo from the nearest point
    assert mean(hand, trunk, noise) == pytest.approx(mean(hand, trunk), abs=0.01)
    assert 0.1 < mean(trunk) < 0.15  # nothing in front: the prior, and perhaps the trunk


def test_nearest_point_of_a_person_is_found_and_predicted_without_an_echo() -> None:
    """A hand 1.5 bins in front of the trunk, in one main lobe; frames 20 to 23 are noise."""
    hand = 1.5 * BIN
    seen = rc.Simulator(points((2.5, 1.0), (2.5 - hand, 0.1), velocity=0.8), RADAR).record(0.0, 1.0, progress=False)
    cube = seen.cube.copy()
    cube[20:24] = rc.Simulator(rc.Scene([]), RADAR).record(0.0, 0.1, progress=False).cube[:4]
    (one,) = rc.track(replace(seen, cube=cube), targets="people", smooth=True, separate_echoes=True)
    true = 2.5 - hand + 0.8 * one.time
    assert np.flatnonzero(~one.is_detected).tolist() == [20, 21, 22, 23]
    errors = (one.nearest - true) / BIN
    assert np.abs(errors[one.is_detected]).max() < 0.5
    assert np.abs(errors[~one.is_detected]).max() < 1.0  # expected 0.15 m, the hand is 0.16 m in front
    assert (one.nearest_deviation[~one.is_detected] > one.nearest_deviation[10]).all()


def test_static_echo_in_front_of_a_person_is_of_the_background() -> None:
    """Somebody walks to 0.25 m behind a post, whose echo is 10 dB stronger; the radar moves across, too."""
    radar_motion = rc.Linear(rc.Pose([0.0, -0.2, 0.0]), velocity=[0.0, 0.3, 0.0])
    post = rc.PointTarget([2.0, 0.3, 0.0], rcs=1.0)
    walker = rc.PointTarget([3.05, 0.0, 0.0], rcs=0.1, velocity=[-0.8, 0.0, 0.0])
    seen = rc.Simulator(rc.Scene([post, walker]), RADAR, radar_motion=radar_motion).record(0.0, 1.0, progress=False)
    settings = {"targets": "people", "motion": radar_motion, "smooth": True, "separate_echoes": True}
    (one,) = rc.track(seen, **settings)
    assert seen.truth is not None
    lead = one.range - one.nearest
    assert lead[one.range < 2.4].max() < 0.16  # expected without an echo: 0.15 m; of the post up to 0.4 m


def test_echoes_are_separated_only_if_asked_and_of_people_in_frames() -> None:
    recording = rc.Simulator(points((2.5, 1.0)), RADAR).record(0.0, 0.2, progress=False)
    cube = recording.cube.copy()
    cube[4] = 0.0
    blind = replace(recording, cube=cube)
    found = [rc.detect(frame) for frame in blind.frames()]
    (one,), (same,) = (rc.track(source, targets="people") for source in (blind, found))
    np.testing.assert_array_equal(one.nearest, same.nearest)
    assert np.flatnonzero(np.isnan(one.nearest)).tolist() == [4]
    assert (one.nearest[:4] == [each.range.min() for each in found[:4]]).all()
    with pytest.raises(ValueError, match=r'^separate_echoes: needs targets="people"$'):
        rc.track(blind, separate_echoes=True)
    with pytest.raises(ValueError, match=r"^separate_echoes: needs frames, got Detections$"):
        rc.track(found, separate_echoes=True, targets="people")


def test_echoes_of_somebody_else_do_not_count() -> None:
    """Two people walk past each other, 1.5 m apart: each is in front of the other for a while."""
    ways = {"leaving": ([2.0, 0.75, 0.0], 0.8), "coming": ([2.9, -0.75, 0.0], -0.8)}
    people = [rc.PointTarget(place, rcs=0.3, velocity=[speed, 0.0, 0.0]) for place, speed in ways.values()]
    seen = rc.Simulator(rc.Scene(people), RADAR).record(0.0, 1.0, progress=False)
    tracks = rc.track(seen, targets="people", smooth=True, separate_echoes=True)
    assert len(tracks) == 2
    assert max((one.range - one.nearest).max() for one in tracks) < 0.2  # expected: 0.15 m; of the other up to 0.5 m
