"""Gait: the paper's control points and curves, tables of angles at two speeds, and smoothness to any order."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from radarcore.models.people import gait

SPEEDS = (0.05, 0.5, 0.8, 1.3, 3.0)
# Between their control points smooth curves differ from the paper's by less than this [degrees].
SMOOTHING = 0.2
ANGLES = ("hip", "knee", "ankle", "shoulder", "elbow", "roll", "torsion", "thorax", "lean")


def every_angle(phase, relative_speed, derivative=0):
    """Angles of the right limbs and the trunk, (angle, phase) [degrees]."""
    return gait.posture(phase, relative_speed, derivative + 1).angles[derivative, ..., 5:].T


def joint_angle(name, phase, relative_speed):
    """Angle of a joint or of the trunk by its name [degrees]."""
    return every_angle(phase, relative_speed)[ANGLES.index(name)]


@pytest.mark.parametrize(
    ("relative_speed", "name", "expected"),
    [
        (1.0, "hip", (22.037, 0.046, -15, 12.344)),
        (1.0, "knee", (3, 3, 16.283, 70)),
        (1.0, "ankle", (-3, -8.669, 8, -11.235)),
        (1.0, "elbow", (11.407, 20.792, 34.987, 21.981)),
        (1.0, "thorax", (1.453, -0.138, -1.453, 0.138)),
        (1.0, "shoulder", (-11.82, -1.94, 7.94, -1.94)),
        (1.5, "hip", (23.211, 0.827, -15, 12.826)),
        (1.5, "knee", (3.356, 4.809, 16.565, 69.306)),
        (1.5, "ankle", (-2.412, -8.068, 7.021, -9.972)),
        (1.5, "elbow", (13.678, 26.673, 46.960, 27.349)),
        (1.5, "thorax", (2.179, -0.207, -2.179, 0.207)),
        (1.5, "roll", (0, -4.042, 0, 4.042)),
    ],
)
def test_angles_of_the_published_formulas(relative_speed, name, expected):
    angles = joint_angle(name, np.arange(4) / 4, relative_speed)
    rounding = 5.01e-4  # half of the last digit printed
    np.testing.assert_allclose(angles, expected, atol=rounding if name == "shoulder" else rounding + SMOOTHING)


@pytest.mark.parametrize("relative_speed", SPEEDS)
def test_curves_pass_through_their_control_points(relative_speed):
    for name, points in gait.control_points(relative_speed).items():
        phase, expected = np.array(points).T
        # Phases are kept to 1e-12 of a cycle, in which an angle changes by less than 1e-9 degrees.
        np.testing.assert_allclose(joint_angle(name, phase, relative_speed), expected, atol=1e-9, err_msg=name)
    roll = joint_angle("roll", [0.0, 0.15, 0.5, 0.65], relative_speed)
    np.testing.assert_allclose(roll, 3.32 * relative_speed * np.array([0.0, -1.0, 0.0, 1.0]), atol=1e-12)


@pytest.mark.parametrize("relative_speed", SPEEDS)
def test_curves_are_near_monotone_cubics_and_hardly_overshoot(relative_speed):
    t = np.linspace(0.0, 1.0, 2001)
    for name, points in gait.control_points(relative_speed).items():
        phase, angle = np.array(sorted({t % 1.0: angle for t, angle in points}.items())).T
        cubic = PchipInterpolator(np.concatenate([phase - 1.0, phase, phase + 1.0]), np.tile(angle, 3))
        angles = joint_angle(name, t, relative_speed)
        np.testing.assert_allclose(angles, cubic(t), atol=SMOOTHING, err_msg=name)
        assert angle.min() - 0.1 < angles.min() <= angles.max() < angle.max() + 0.1, name


@pytest.mark.parametrize("relative_speed", SPEEDS)
def test_roll_is_near_the_papers_four_pieces(relative_speed):
    t = np.linspace(0.0, 1.0, 1001)[:-1]
    a = 1.66 * relative_speed
    pieces = [
        a * (np.cos(2 * np.pi * t * 10 / 3) - 1),
        -a * (1 + np.cos(2 * np.pi * (t - 0.15) * 10 / 7)),
        a * (1 - np.cos(2 * np.pi * (t - 0.5) * 10 / 3)),
        a * (1 + np.cos(2 * np.pi * (t - 0.65) * 10 / 7)),
    ]
    expected = np.select([t < 0.15, t < 0.5, t < 0.65, t >= 0.65], pieces)
    np.testing.assert_allclose(joint_angle("roll", t, relative_speed), expected, atol=SMOOTHING)


@pytest.mark.parametrize("relative_speed", SPEEDS)
def test_derivatives_are_those_of_the_values(relative_speed):
    t, step = np.random.default_rng(1).random(500), 1e-6
    later, earlier, here = (np.dstack(gait.posture(t + h, relative_speed, 2)) for h in (step, -step, 0.0))
    derivative = here[1]
    # Third derivatives reach 1e6 degrees, which times the square of the step is 1e-6; rounding is 1e-8.
    np.testing.assert_allclose((later - earlier)[0] / (2 * step), derivative, atol=1e-5)


@pytest.mark.parametrize("relative_speed", SPEEDS)
def test_all_derivatives_are_continuous(relative_speed):
    # Sums of finitely many harmonics; the Gaussian scales them by exp(-2 (pi h 0.7 %)^2). The paper's curves, whose
    # second derivatives jump, have 1e-5 to 1e-4 in harmonics above the hundredth.
    t = np.arange(1024) / 1024
    spectra = np.abs(np.fft.rfft(every_angle(t, relative_speed), norm="forward"))
    assert spectra[:, 128:].max() < 1e-12
    assert spectra[:, 100:].max() < 1e-6
    rates = np.abs(np.fft.rfft(every_angle(t, relative_speed, 1), norm="forward"))
    np.testing.assert_allclose(rates, 2.0 * np.pi * np.arange(513) * spectra, atol=1e-9)


@pytest.mark.parametrize("relative_speed", SPEEDS)
def test_left_limbs_follow_the_right_ones_half_a_cycle_later(relative_speed):
    t = np.random.default_rng(2).uniform(-1.0, 2.0, 20)
    left = gait.posture(t, relative_speed).angles[..., :5]
    np.testing.assert_allclose(left, gait.posture(t + 0.5, relative_speed).angles[..., 5:10], atol=1e-9)


def test_speed_changes_angles_without_a_jump_except_the_hips_at_1_3():
    t = np.linspace(0.0, 1.0, 2001)
    for change, hips_jump in ((0.5, 0.0), (1.3, 0.65)):
        jumps = np.abs(every_angle(t, change + 1e-9) - every_angle(t, change - 1e-9)).max(axis=1)
        assert jumps[0] == pytest.approx(hips_jump, abs=1e-3)  # a doubled point parts there and changes its slope
        assert jumps[1:].max() < 1e-6  # 1e-9 of a change of speed
        root = np.abs(gait.posture(t, change + 1e-9).root - gait.posture(t, change - 1e-9).root)
        assert root.max() < 1e-9


def test_cycle_of_a_walk_at_1_4_m_per_s():
    relative_speed = 1.4 / (0.53 * 1.75)
    duration = gait.cycle_duration(relative_speed)
    assert duration == pytest.approx(1.0956, abs=5e-5)
    # Swing and double support of the paper: 0.248 Dc + 0.143 s and 0.252 Dc - 0.143 s.
    stance = gait.stance_fraction(relative_speed)
    assert (1 - stance) * duration == pytest.approx(0.248 * duration + 0.143)
    assert (2 * stance - 1) * duration == pytest.approx(0.504 * duration - 0.286)


@pytest.mark.parametrize("relative_speed", [0.0, -1.0, 3.01, float("nan")])
def test_speed_outside_the_model_is_named(relative_speed):
    with pytest.raises(ValueError, match="relative_speed: expected more than 0 and at most 3 hip heights per second"):
        gait.posture(0.0, relative_speed)
