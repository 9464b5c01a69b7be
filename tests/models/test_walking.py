"""A walking person as the radar sees it: torso line, two steps per cycle, envelope of the feet."""

from __future__ import annotations

import numpy as np
import pytest

import radarcore as rc

SPEED = 1.4
# Largest forward speeds of ankle and toe at 1.4 m/s and 1.75 m (Boulic et al. 1990, the gait's check table).
ANKLE, TOE = 4.85, 6.04


@pytest.fixture(scope="module")
def walk() -> tuple[rc.models.Human, rc.Recording]:
    """One cycle of a person who walks straight away from the radar, nothing else around."""
    person = rc.models.Human(height=1.75, speed=SPEED, path=[[3.0, 0.0], [9.0, 0.0]])
    waveform = rc.Waveform.from_sweep(
        start_frequency=60e9, stop_frequency=61e9, sample_rate=1e6, num_samples=64, num_chirps=64, chirp_interval=180e-6
    )
    simulator = rc.Simulator(
        rc.Scene(person.bodies()),
        rc.Radar(waveform),
        radar_motion=rc.Pose([0.0, 0.0, 1.0]),
        resolution=(192, 120),  # 7 mm at 3 m, and what moves fast is refined
        field_of_view_deg=(24.0, 40.0),
    )
    return person, simulator.record(0.0, person.cycle_duration, 40.0, progress=False)


def test_torso_line_lies_at_the_walking_speed(walk: tuple[rc.models.Human, rc.Recording]) -> None:
    waveform = walk[1].radar.waveform
    spectrogram = rc.spectrogram(walk[1])
    strongest = spectrogram.velocity[spectrogram.power.argmax(axis=1)]
    assert abs(strongest.mean() - SPEED) <= waveform.velocity_resolution


def test_torso_speeds_up_twice_per_cycle(walk: tuple[rc.models.Human, rc.Recording]) -> None:
    spectrogram = rc.spectrogram(walk[1])
    near_torso = np.abs(spectrogram.velocity - SPEED) < 1.2
    power, velocity = spectrogram.power[:, near_torso], spectrogram.velocity[near_torso]
    line = (power * velocity).sum(axis=1) / power.sum(axis=1)
    phase = np.exp(2j * np.pi * (spectrogram.time - spectrogram.time[0]) / walk[0].cycle_duration)
    once, twice, thrice = (abs(((line - line.mean()) * phase**n).mean()) for n in (1, 2, 3))
    assert twice > 2.0 * max(once, thrice)


def test_envelope_is_that_of_ankle_and_toe(walk: tuple[rc.models.Human, rc.Recording]) -> None:
    width = walk[1].radar.waveform.velocity_resolution
    spectrogram = rc.spectrogram(walk[1])
    level = 10.0 * np.log10(spectrogram.power / spectrogram.power.max())
    fastest = spectrogram.velocity[(level > -40.0).any(axis=0)].max()
    assert ANKLE - width <= fastest <= TOE + width
    # More sharply: the fastest point of a foot that the radar sees, from the geometry alone.
    truth = walk[1].truth
    assert truth is not None
    feet = truth.select(["human/left_foot", "human/right_foot"]).velocity
    assert abs(fastest - np.nanmax(feet)) <= width
    # The stance foot slides back by 0.14 m/s at the ankle, the swinging one slows past it: nothing goes far backwards.
    assert spectrogram.velocity[(level > -40.0).any(axis=0)].min() > -1.11 - width
