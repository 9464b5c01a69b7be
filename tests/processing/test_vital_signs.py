"""Vital signs of simulated chests with known rates, of a real recording, and refusals."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore.processing.estimation.vital_signs import _centres, vital_signs

C = 299_792_458.0
RATE = 12.0
WAVEFORM = rc.Waveform(start_frequency=58.5e9, slope=5e9 / 32e-6, sample_rate=2e6, num_samples=64, num_chirps=1)
HALF = 0.5 * WAVEFORM.wavelength
RADAR = rc.Radar(WAVEFORM, rx=np.arange(3)[:, None] * [0.0, HALF, 0.0], receiver=rc.Receiver(output="real"))
TIME = np.arange(0.0, 40.0, 1.0 / RATE)


def breath(rate: float, size: float = 4e-3, second: float = 0.2) -> NDArray[np.float64]:
    """Movement of the chest, `size` peak to peak."""
    turns = 2.0 * np.pi * rate * TIME
    movement = np.sin(turns) + second * np.sin(2.0 * turns + 0.7)
    return np.asarray(size * movement / np.ptp(movement))


def beats(rate: float, size: float) -> NDArray[np.float64]:
    return 0.5 * size * np.sin(2.0 * np.pi * rate * TIME)


def measured(
    *chests: NDArray[np.float64],
    snr_db: float = 20.0,
    clutter: float = 1.0,
    seed: int = 0,
    radar: rc.Radar = RADAR,
    distances: tuple[float, ...] = (0.6,),
    faded: int | None = None,
) -> rc.Recording:
    """Recording of chests that move about their distances [m], a static echo in the cell of the first, and noise."""
    rng = np.random.default_rng(seed)
    waveform = radar.waveform
    cube = np.zeros((len(TIME), radar.num_channels, waveform.num_chirps, waveform.num_samples), complex)
    static = np.full(len(TIME), distances[0] + 0.01)
    places = [distance + chest for distance, chest in zip(distances, chests, strict=True)]
    for place, level in (*((place, 1.0) for place in places), (static, clutter)):
        paths = 2.0 * place[:, None] + 1e-4 * np.arange(radar.num_channels)
        delay = (paths / C)[:, :, None, None]
        phase = (
            2.0 * np.pi * delay * (waveform.start_frequency + waveform.slope * (waveform.sample_times - 0.5 * delay))
        )
        cube += level * np.exp(1j * phase)
    window = np.hanning(waveform.num_samples + 1)[:-1]
    part = 0.5 if radar.is_real else 1.0
    power = (part * window.sum()) ** 2 * waveform.num_chirps / np.square(window).sum() * 10.0 ** (-0.1 * snr_db)
    noise = rng.normal(0.0, np.sqrt(0.5 * power), (*cube.shape, 2)) @ [1.0, 1j]
    samples = cube.real + np.sqrt(2.0) * noise.real if radar.is_real else cube + noise
    if faded is not None:
        samples[:, faded] *= 1e-3
    return rc.Recording(samples.astype(np.float32 if radar.is_real else np.complex64), TIME, radar)


@pytest.mark.parametrize("seed", range(3))
def test_rates_are_found_beside_a_static_echo_of_the_same_power(seed: int) -> None:
    rng = np.random.default_rng(seed)
    breathing, heart = rng.uniform(0.17, 0.35), rng.uniform(0.85, 1.6)
    signs = vital_signs(measured(breath(breathing) + beats(heart, 0.3e-3), seed=seed))
    assert signs.breathing_rate == pytest.approx(breathing, rel=0.005)
    assert signs.heart_rate == pytest.approx(heart, abs=0.01)
    assert signs.amplitude == pytest.approx(4e-3, rel=0.06)
    assert signs.range == pytest.approx(0.6, abs=0.03)
    assert abs(signs.breathing_rate - breathing) < 5.0 * signs.breathing_deviation < 0.01
    assert abs(signs.heart_rate - heart) < 5.0 * signs.heart_deviation < 0.02
    assert (signs.breathing_reason, signs.heart_reason) == ("", "")


def test_displacement_follows_the_chest_away_from_the_radar() -> None:
    movement = breath(0.25, second=0.4)
    signs = vital_signs(measured(movement, snr_db=30.0))
    error = signs.displacement - (movement - movement[0])
    assert np.std(error) < 0.1e-3
    np.testing.assert_allclose(signs.time, TIME + RADAR.middle)


@pytest.mark.parametrize("size", [0.6e-3, 12e-3])
def test_arcs_far_below_and_above_a_turn_have_their_amplitude(size: float) -> None:
    """0.25 and 5 turns of the phase; the mean of the samples is no centre of the short arc."""
    signs = vital_signs(measured(breath(0.25, size=size, second=0.0), snr_db=30.0, clutter=3.0))
    assert signs.breathing_rate == pytest.approx(0.25, rel=0.01)
    assert signs.amplitude == pytest.approx(size, rel=0.1)


def test_centre_of_an_arc_is_the_centre_of_its_circle() -> None:
    rng = np.random.default_rng(2)
    arc = 3.0 - 2.0j + 1.5 * np.exp(1j * np.linspace(0.3, 1.7, 400))[:, None, None]
    noise = 0.01 * (rng.normal(size=(400, 2, 3)) + 1j * rng.normal(size=(400, 2, 3)))
    assert np.abs(_centres(arc + noise) - (3.0 - 2.0j)).max() < 0.05
    assert np.abs(_centres(arc + 0.0 * noise) - (3.0 - 2.0j)).max() < 1e-9


def test_iq_samples_and_a_faded_channel_do_not_matter() -> None:
    movement = breath(0.3) + beats(1.32, 0.4e-3)
    radar = rc.Radar(WAVEFORM, rx=RADAR.rx)
    assert vital_signs(measured(movement, radar=radar)).heart_rate == pytest.approx(1.32, abs=0.01)
    faded = vital_signs(measured(movement, faded=1))
    assert faded.breathing_rate == pytest.approx(0.3, rel=0.005)


@pytest.mark.parametrize("heart", [0.0, 0.003e-3])
def test_without_a_visible_heartbeat_the_heart_rate_is_nan(heart: float) -> None:
    for seed in range(3):
        signs = vital_signs(measured(breath(0.27, second=0.3) + beats(1.3, heart), seed=seed))
        assert np.isfinite(signs.breathing_rate)
        assert np.isnan([signs.heart_rate, signs.heart_deviation]).all()
        assert signs.heart_reason


@pytest.mark.parametrize("order", [3, 4, 5])
def test_harmonic_of_breathing_is_no_heartbeat(order: int) -> None:
    turns = 2.0 * np.pi * 0.26 * TIME
    harmonics = np.sum([np.sin(k * turns + k) / k**1.5 for k in range(1, order + 1)], axis=0)
    signs = vital_signs(measured(2e-3 * harmonics, snr_db=30.0))
    assert np.isnan(signs.heart_rate)
    beside = vital_signs(measured(2e-3 * harmonics + beats(1.43, 0.5e-3), snr_db=30.0))
    assert beside.heart_rate == pytest.approx(1.43, abs=0.01)


def test_heartbeat_beside_a_harmonic_is_found_and_one_at_the_harmonic_is_uncertain() -> None:
    beside, at = (vital_signs(measured(breath(0.25, second=0.1) + beats(rate, 0.4e-3))) for rate in (1.28, 1.25))
    assert beside.heart_rate == pytest.approx(1.28, abs=0.01)
    assert np.isnan(at.heart_rate)


def test_double_of_a_heartbeat_that_is_a_harmonic_of_breathing_is_not_called() -> None:
    """The line at 4 times the breathing rate may be breathing's, so that the one at 8 times is uncertain."""
    movement = breath(0.28, second=0.2) + 0.15e-3 * np.sin(2.0 * np.pi * 0.84 * TIME)
    signs = vital_signs(measured(movement + beats(1.12, 0.3e-3) + beats(2.24, 0.1e-3)))
    assert np.isnan(signs.heart_rate) or signs.heart_rate == pytest.approx(1.12, abs=0.02)


@pytest.mark.parametrize(
    ("other", "rate"),
    [(breath(0.25) + beats(1.62, 0.4e-3), "97"), (breath(0.257), "none")],
)
def test_channels_that_disagree_give_no_heart_rate(other: NDArray[np.float64], rate: str) -> None:
    cube = measured(breath(0.25) + beats(0.93, 0.4e-3)).cube
    cube[:, 1] = measured(other).cube[:, 1]
    signs = vital_signs(rc.Recording(cube, TIME, RADAR))
    assert np.isnan(signs.heart_rate)
    assert signs.heart_reason == f"channels disagree: 56, {rate}, 56 per minute"


NOBODY = np.zeros(len(TIME))
SWAY = np.cumsum(np.random.default_rng(4).normal(0.0, 0.1e-3, len(TIME)))
JUMPS = "the phase jumps from frame to frame: nobody is there, or the frames are too few"


@pytest.mark.parametrize(
    ("recording", "reason"),
    [
        (lambda: measured(NOBODY), JUMPS),
        (lambda: measured(SWAY), r"periodic breathing explains only \d+ % of the movement"),
        (lambda: measured(breath(0.25) + 0.007 * TIME), r"the person moved by 0\.[12]\d m"),
        (lambda: measured(breath(0.25))[:84], r"the recording of 7\.0 s has only 1\.\d breaths"),
        (lambda: measured(breath(0.4, size=20e-3)), JUMPS),
        (lambda: measured(breath(0.09)), r"5\.\d per minute are too slow for breathing: the person sways"),
        (lambda: measured(breath(0.12, size=16e-3)), "movements of 16 mm are no breaths: the person sways"),
    ],
)
def test_uncertain_breathing_is_nan_with_its_reason(recording: Callable[[], rc.Recording], reason: str) -> None:
    signs = vital_signs(recording())
    assert np.isnan([signs.breathing_rate, signs.breathing_deviation, signs.amplitude, signs.heart_rate]).all()
    assert re.fullmatch(reason, signs.breathing_reason), signs.breathing_reason
    assert signs.heart_reason == "the breathing rate is not known"


STILL = measured(breath(0.25))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: vital_signs(STILL[:36]), r"recording: expected at least 5 s, got 2\.92 s"),
        (lambda: vital_signs(STILL[:0]), "recording: expected at least 5 s, got 0"),
        (
            lambda: vital_signs(rc.Recording(STILL.cube[::3], TIME[::3], RADAR)),
            "recording: expected at least 6 frames per second, got 4",
        ),
        (
            lambda: vital_signs(rc.Recording(STILL.cube, TIME + (TIME > 20.0), RADAR)),
            r"recording: expected frames every 0\.0833 s, got a gap of 1\.08 s",
        ),
        (lambda: vital_signs(STILL, min_range=50.0), "min_range, max_range: expected range bins within the limits"),
        (lambda: vital_signs(STILL, min_range=2.0, max_range=1.0), "max_range: expected at least min_range"),
        (lambda: vital_signs(rc.Recording(STILL.cube, TIME, rc.Radar(WAVEFORM.replace(slope=0.0), rx=RADAR.rx))), "CW"),
    ],
)
def test_recordings_that_cannot_tell_are_refused(call: Callable[[], Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()


def test_only_recordings_are_taken() -> None:
    with pytest.raises(TypeError, match="recording: expected Recording, got Frame"):
        vital_signs(STILL[0])  # type: ignore[arg-type]


def test_real_recording_has_its_breathing_and_no_certain_heart_rate() -> None:
    """An independent reading of the phase has 0.24 +- 0.01 Hz, 6 to 9 mm, and other heart rates in every channel."""
    beside = Path(__file__).resolve().parents[3] / "shared" / "recordings"
    path = Path(os.environ.get("RADARCORE_RECORDINGS", beside)) / "bgt60tr13c-8chirp"
    if not path.is_dir():
        pytest.skip(f"no recording of a real sensor at {path} (see CONTRIBUTING.md: RADARCORE_RECORDINGS)")
    signs = vital_signs(rc.Recording.load(path))
    assert signs.breathing_rate == pytest.approx(0.24, abs=0.01)
    assert 6e-3 <= signs.amplitude <= 9e-3
    assert 0.28 < signs.range < 0.42
    assert np.isnan(signs.heart_rate)
    reasons = r"channels disagree: \d+, \d+, \d+ per minute; no line stands out from the harmonics of breathing"
    assert re.fullmatch(reasons, signs.heart_reason), signs.heart_reason
