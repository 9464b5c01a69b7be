"""Calibration with a reflector: known errors of the channels and of ranges come back, whatever else is in the frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc

WAVEFORM = rc.Waveform(
    start_frequency=77e9, slope=20e12, sample_rate=4e6, num_samples=128, num_chirps=16, chirp_interval=80e-6
)
BIN = WAVEFORM.range_resolution
HALF = 0.5 * WAVEFORM.wavelength
ROW = np.arange(4)[:, None] * HALF * np.array([0.0, 1.0, 0.0])
AT = [8.0 * BIN * 0.995, 0.1, 0.1]
ERRORS = 10.0 ** (np.array([0.3, -1.5, 1.2, 0.0, -0.7, 1.5, -1.0, 0.4]) / 20.0) * np.exp(
    1j * np.deg2rad([10.0, -40.0, 25.0, 38.0, 0.0, -15.0, 5.0, 30.0])
)


def array(output: str = "iq", **changes: Any) -> rc.Radar:
    settings: dict[str, Any] = {
        "tx": 4.0 * ROW[:2],
        "rx": ROW,
        "receiver": rc.Receiver(output=output, noise_figure_db=12.0),
        "tx_power_dbm": 10.0,
        "schedule": rc.Schedule.tdm(),
    }
    return rc.Radar(changes.pop("waveform", WAVEFORM), **(settings | changes))


def measured(*targets: rc.PointTarget, radar: rc.Radar | None = None, errors: Any = ERRORS) -> rc.Frame:
    """Frame of a radar with errors of its channels, which I/Q samples show as factors."""
    frame = rc.Simulator(rc.Scene(list(targets)), radar or array()).frame()
    return with_cube(frame, frame.cube * errors[:, None, None])


def with_cube(frame: rc.Frame, cube: NDArray[Any]) -> rc.Frame:
    return replace(frame, cube=cube.astype(frame.cube.dtype))


def left(found: rc.processing.Calibration, errors: Any = ERRORS) -> NDArray[np.complex128]:
    """Errors that the weights leave, over their mean."""
    rest: NDArray[np.complex128] = found.channel_weights * errors
    return rest / rest.mean()


@pytest.mark.parametrize("offset", [0.0, 0.25, 0.5, 0.75])
def test_errors_of_the_channels_come_back_wherever_the_reflector_is_in_its_bin(offset: float) -> None:
    place = [AT[0] + offset * BIN, *AT[1:]]
    found = rc.calibrate(measured(rc.PointTarget(place)), at=place)
    # Relative amplitudes and phases have the same deviation: 6 are 4.2 of both together.
    assert np.abs(left(found) - 1.0).max() < 6.0 * found.phase_deviation.max()
    assert found.phase_deviation.max() < 0.01
    assert found.channel_weights[0].imag == pytest.approx(0.0, abs=1e-12)
    assert np.isnan(found.residual_phase).all()
    # 1e-3 bins is the error of the tone's model.
    assert abs(found.range_offset) < 4.0 * found.range_deviation + 1e-3 * BIN
    np.testing.assert_allclose(np.diff(found.snr_db), np.diff(20.0 * np.log10(np.abs(ERRORS))), atol=0.2)


def test_near_reflector_is_compared_with_a_sphere() -> None:
    place = [3.0 * BIN, 0.3, -0.2]
    far = 100.0 * np.array(place) / np.linalg.norm(place)
    frame = measured(rc.PointTarget(place))
    paths = rc.Simulator(rc.Scene([rc.PointTarget(far)]), array()).paths().delay[:, 0]
    plane = np.exp(2j * np.pi * WAVEFORM.center_frequency * (paths - paths.mean()))
    assert np.abs(left(rc.calibrate(frame, at=place)) - 1.0).max() < 0.01
    snapshot = np.abs(np.angle(left(rc.calibrate(frame, at=place)) * plane))
    assert np.ptp(snapshot) > 0.1, "a plane wave would be another reference"


@pytest.mark.parametrize("output", ["iq", "real"])
@pytest.mark.parametrize("slope", [20e12, -20e12])
def test_samples_of_both_kinds_and_slopes_give_the_phases_of_receivers(output: str, slope: float) -> None:
    phases = np.array([0.0, -75.0, 40.0, 10.0])
    receiver = rc.Receiver(output=output, noise_figure_db=12.0, rx_phase_deg=tuple(phases))
    radar = array(receiver=receiver, waveform=WAVEFORM.replace(slope=slope, start_frequency=78e9))
    frame = rc.Simulator(rc.Scene([rc.PointTarget(AT)]), radar).frame()
    found = rc.calibrate(frame, at=AT)
    errors = np.tile(np.exp(1j * np.deg2rad(phases)), 2)
    assert np.abs(left(found, errors) - 1.0).max() < 6.0 * found.phase_deviation.max() < 0.05


def test_stronger_targets_elsewhere_do_not_matter() -> None:
    others = [rc.PointTarget([AT[0] + 3.0, 0.5, 0.0], rcs=30.0), rc.PointTarget([5.0, -1.0, 0.0], velocity=[2.0, 0, 0])]
    found = rc.calibrate(measured(rc.PointTarget(AT), *others), at=AT)
    assert np.abs(left(found) - 1.0).max() < 0.02


def test_several_frames_are_more_exact_and_tell_the_scatter() -> None:
    simulator = rc.Simulator(rc.Scene([rc.PointTarget(AT, rcs=1e-3)]), array())
    recording = simulator.record(0.0, 0.2, rate=50.0, progress=False)
    turned = np.exp(2j * np.pi * np.random.default_rng(1).uniform(size=len(recording)))  # of the oscillator
    cube = recording.cube * ERRORS[:, None, None] * turned[:, None, None, None]
    found = rc.calibrate(replace(recording, cube=cube.astype(np.complex64)), at=AT)
    one = rc.calibrate(recording[0], at=AT)
    assert found.phase_deviation.mean() == pytest.approx(one.phase_deviation.mean() / np.sqrt(10.0), rel=0.1)
    assert np.abs(left(found) - 1.0).max() < 5.0 * found.phase_deviation.max()
    scatter = found.residual_phase / (np.sqrt(10.0) * found.phase_deviation)
    assert 0.6 < np.sqrt(np.mean(scatter**2)) < 1.4
    drifting = cube.copy()
    drifting[5:, 3] *= np.exp(0.3j)
    assert rc.calibrate(replace(recording, cube=drifting.astype(np.complex64)), at=AT).residual_phase[3] > 0.1


def test_range_offset_is_measured_minus_true() -> None:
    frame = measured(rc.PointTarget(AT))
    at = [AT[0] - 0.1, *AT[1:]]
    path = np.linalg.norm(np.array(AT)) - np.linalg.norm(at)
    assert rc.calibrate(frame, at=at).range_offset == pytest.approx(path, abs=2e-3)


def test_directions_and_maps_of_a_calibrated_radar_are_those_without_errors() -> None:
    radar = array()
    target = rc.PointTarget([3.0, 1.3, 0.0], velocity=[1.0, 0.0, 0.0])
    corner = measured(rc.PointTarget(AT, rcs=10.0))
    calibrated = replace(radar, channel_weights=rc.calibrate(corner, at=AT).channel_weights)
    clean, wrong = measured(target, errors=np.ones(8)), measured(target)
    right = replace(wrong, radar=calibrated)
    expected, before, after = (rc.detect(frame) for frame in (clean, wrong, right))
    assert before.is_resolved.tolist() == [False]
    assert after.is_resolved.tolist() == [True]
    assert abs(before.azimuth - expected.azimuth)[0] > np.deg2rad(0.05)
    assert abs(after.azimuth - expected.azimuth)[0] < np.deg2rad(0.03)
    np.testing.assert_array_equal(before.snr_db, after.snr_db)
    power, mapped = (rc.range_angle(frame) for frame in (clean, right))
    np.testing.assert_allclose(mapped / mapped.max(), power / power.max(), atol=0.01)
    named = rc.range_angle(wrong, channel_phase=-np.angle(calibrated.channel_weights))
    assert named.argmax() == power.argmax()


def test_simulator_ignores_the_weights() -> None:
    radar = array()
    scene = rc.Scene([rc.PointTarget(AT)])
    plain, weighted = (
        rc.Simulator(scene, one).frame().cube for one in (radar, replace(radar, channel_weights=1.0 / ERRORS))
    )
    np.testing.assert_array_equal(plain, weighted)


def test_weights_replace_the_phases_of_receivers_and_earlier_weights() -> None:
    radar = array(receiver=rc.Receiver(rx_phase_deg=(0.0, 90.0, 0.0, 0.0)))
    np.testing.assert_allclose(radar.channel_corrections[[1, 5]], -1j, atol=1e-12)
    weighted = replace(radar, channel_weights=1.0 / ERRORS)
    np.testing.assert_array_equal(weighted.channel_corrections, 1.0 / ERRORS)
    frame = measured(rc.PointTarget(AT))
    again = rc.calibrate(replace(frame, radar=replace(frame.radar, channel_weights=1.0 / ERRORS)), at=AT)
    np.testing.assert_array_equal(again.channel_weights, rc.calibrate(frame, at=AT).channel_weights)


def test_recordings_keep_the_weights(tmp_path: Path) -> None:
    frame = measured(rc.PointTarget(AT))
    radar = replace(frame.radar, channel_weights=1.0 / ERRORS)
    rc.Recording(frame.cube[None], [0.0], radar).save(tmp_path / "r")
    back = rc.Recording.load(tmp_path / "r")
    assert back.radar == radar != frame.radar
    np.testing.assert_array_equal(back.cube[0], frame.cube)


FRAME = measured(rc.PointTarget(AT))
DDM = array(schedule=rc.Schedule.ddm())
NEIGHBOUR = rc.PointTarget([AT[0] + 4.0 * BIN, 0.0, 0.0])
SATURATED = r"frames: expected samples within the range of the ADC, got .* % at its limits in the frame at 0 s"


def clipped(unit: str, over: float) -> rc.Frame:
    """Samples of an ADC that the echo exceeds."""
    limit = 32767.0 if unit == "counts" else 1.0
    cube = FRAME.cube / np.abs(FRAME.cube).max() * over
    parts = np.clip(cube.astype(np.complex64).view(np.float32), -limit, limit)
    return rc.Frame(parts.view(np.complex64), 0.0, FRAME.radar, stats={"cube_unit": unit})


REFUSED: list[tuple[Callable[[], Any], str]] = [
    (lambda: rc.calibrate(FRAME, at=[AT[0] + 1.0, 0.0, 0.0]), r"at: expected an echo from 2\.\d+ to .*, got none in"),
    (lambda: rc.calibrate(FRAME, at=[0.01, 0.0, 0.0]), r"at: expected a position 0\.468 to .* m from the antennas"),
    (lambda: rc.calibrate(FRAME, at=[1e3, 0.0, 0.0]), "at: expected a position"),
    (lambda: rc.calibrate(FRAME, at=AT, max_offset=0.0), "max_offset: expected a positive number"),
    (
        lambda: rc.calibrate(
            measured(rc.PointTarget(AT), rc.PointTarget([AT[0] + 4 * BIN, 0, 0])), at=AT, max_offset=2
        ),
        r"at: expected one strong echo from .*, got 1\.865 m \(44 dB\) and 2\.802 m \(36 dB\); remove",
    ),
    (
        lambda: rc.calibrate(measured(rc.PointTarget(AT, velocity=[3.0, 0.0, 0.0])), at=AT),
        r"frames: expected radar and reflector at rest, got \+2\.99 m/s",
    ),
    (lambda: rc.calibrate(clipped("counts", 4e4), at=AT), SATURATED),
    (lambda: rc.calibrate(clipped("parts of full scale", 1.3), at=AT), SATURATED),
    (
        lambda: rc.calibrate(rc.Recording(FRAME.cube[None], [0.0], FRAME.radar)[:0], at=AT),
        "frames: expected at least one",
    ),
    (lambda: rc.calibrate(rc.Frame(np.ones((1, 16, 128)), 0.0, rc.Radar(WAVEFORM.replace(slope=0.0))), at=AT), "CW"),
    (lambda: rc.calibrate(measured(rc.PointTarget(AT), radar=DDM, errors=np.ones(4)), at=AT), "kind 'ddm'"),
]


@pytest.mark.parametrize(("call", "message"), REFUSED)
def test_refusals_say_what_is_wrong(call: Callable[[], Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()
