"""Pictures of directions: drawn objects, their axes and sides."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from radarcore import plot

pytest.importorskip("matplotlib.figure", reason="needs the extra `plot`: pip install radarcore[plot]")

WAVEFORM = rc.Waveform(
    start_frequency=76.5e9, slope=30e12, sample_rate=4e6, num_samples=64, num_chirps=4, chirp_interval=60e-6
)
WAVELENGTH = WAVEFORM.wavelength


def row(number: int, spacing: float = 0.5, axis: int = 1) -> NDArray[np.float64]:
    """Positions along an axis about the origin; spacing in wavelengths."""
    return WAVELENGTH * spacing * (np.arange(number) - 0.5 * (number - 1))[:, None] * np.eye(3)[axis]


RADAR = rc.Radar(WAVEFORM, tx=row(3, 2.0), rx=row(4), pattern=rc.GaussianPattern(8.0, 80.0, 30.0))
TARGETS = [
    rc.PointTarget([5.0, 2.5, 0.0], name="left"),
    rc.PointTarget([7.0, -3.0, 0.0], name="right"),
]


@pytest.fixture(scope="module")
def frame() -> rc.Frame:
    noisy = rc.Radar(WAVEFORM, tx=RADAR.tx, rx=RADAR.rx, receiver=rc.Receiver(noise_figure_db=12.0), tx_power_dbm=12.0)
    return rc.Simulator(rc.Scene(TARGETS), noisy, field_of_view_deg=(90.0, 20.0)).frame(0.0)


@pytest.mark.parametrize("method", ["bartlett", "capon", "music", "fft"])
def test_map_is_brightest_where_the_targets_are_with_left_on_the_left(frame: rc.Frame, method: str) -> None:
    ax: Any = plot.range_angle_map(frame, method=method, max_range=9.0, field_of_view_deg=140.0)
    (drawn,) = ax.collections
    corners = drawn.get_coordinates()
    centres = 0.25 * (corners[1:, 1:] + corners[:-1, 1:] + corners[1:, :-1] + corners[:-1, :-1])
    level = drawn.get_array().reshape(centres.shape[:2])
    low, high = drawn.get_clim()
    assert (low, high) == ((-40.0, 0.0) if method == "music" else (0.0, 30.0))  # echoes of 20 dB over the noise
    assert low <= level.min()
    assert 20.0 <= level.max() - low <= 40.0
    for target in TARGETS:
        x, y, _ = target.position
        near = np.hypot(centres[..., 0] - y, centres[..., 1] - x) < 1.0
        peak = centres[near][level[near].argmax()]
        # Half a range bin along, 1.5 degrees across: cells of 0.8 degrees and side lobes of the other target. MUSIC is
        # no power, its ridge as high at any range.
        along = 1.0 if method == "music" else 0.5 * WAVEFORM.range_resolution
        assert np.hypot(*peak) == pytest.approx(np.hypot(x, y), abs=along)
        assert np.arctan2(*peak) == pytest.approx(np.arctan2(y, x), abs=np.deg2rad(1.5))
    left, right = ax.get_xlim()
    assert left == -right == pytest.approx(9.0 * np.sin(np.deg2rad(70.0)))
    assert ax.get_ylim() == (0.0, 9.0)
    crosses = np.array([(line.get_xdata()[0], line.get_ydata()[0]) for line in ax.get_lines()])
    np.testing.assert_allclose(crosses, [(2.5, 5.0), (-3.0, 7.0)], atol=1e-9)
    assert {text.get_text() for text in ax.texts} == {"left", "right"}
    words = "Pseudo-spectrum" if method == "music" else "Power"
    scale = "re maximum, floor −40" if method == "music" else "over noise"
    assert ax.child_axes[0].get_ylabel() == f"{words} [dB {scale}]"
    assert ax.get_title() == f"{words} in front at 0.000 s"
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("y [m], to the left", "x [m], forward")


@pytest.mark.parametrize("method", ["bartlett", "fft", "capon"])
def test_map_of_noise_alone_is_dark(method: str) -> None:
    noisy = rc.Radar(WAVEFORM, tx=RADAR.tx, rx=RADAR.rx, receiver=rc.Receiver(noise_figure_db=12.0))
    rng = np.random.default_rng(3)
    parts = rng.standard_normal((2, 12, 4, 64)) * np.sqrt(0.5 * noisy.receiver.noise_variance(4e6))  # type: ignore[union-attr]
    ax: Any = plot.range_angle_map(rc.Frame(parts[0] + 1j * parts[1], 0.0, noisy), method=method)
    drawn = ax.collections[0]
    assert drawn.get_clim() == (0.0, 30.0)
    # A mean over 4 chirps is above 9 dB, eight times its own mean, with a probability of e^-31.8 (31.8^3 / 6 + ...),
    # 1e-10. Capon's beam of so few chirps has less.
    assert drawn.get_array().max() < 9.0


def test_map_ends_a_little_beyond_the_last_echo(frame: rc.Frame) -> None:
    ax: Any = plot.range_angle_map(frame)
    farthest = np.hypot(*TARGETS[1].position[:2])
    assert farthest < ax.get_ylim()[1] < farthest + max(0.3 * farthest, 14.0 * WAVEFORM.range_resolution)
    assert ax.get_ylim()[1] < 0.6 * 2.0 * WAVEFORM.max_range  # I/Q samples


def test_map_of_silence_lies_on_the_floor_and_goes_without_truth() -> None:
    silent = rc.Frame(np.zeros((12, 4, 64), np.float32), 0.0, rc.Radar(WAVEFORM, tx=RADAR.tx, rx=RADAR.rx))
    ax: Any = plot.range_angle_map(silent, dynamic_range_db=30.0)
    assert (ax.collections[0].get_array() == -30.0).all()
    assert ax.get_ylim()[1] == pytest.approx(WAVEFORM.max_range)  # real samples
    assert len(ax.get_lines()) == 0


@pytest.mark.parametrize(("unit", "scale"), [("mm", 1e3), ("wavelengths", 1.0 / WAVELENGTH)])
def test_virtual_array_has_all_positions_about_its_centre(unit: str, scale: float) -> None:
    moved = rc.Radar(WAVEFORM, tx=RADAR.tx + np.array([0.0, 0.1, 0.2]), rx=RADAR.rx)
    ax: Any = plot.virtual_array(moved, unit=unit)
    drawn = {line.get_label(): line.get_xydata() for line in ax.get_lines()}
    np.testing.assert_allclose(drawn["virtual channel"], scale * moved.virtual_array[:, 1:], atol=1e-9)
    np.testing.assert_allclose(drawn["transmitter"], scale * (moved.tx - moved.array_center)[:, 1:], atol=1e-9)
    np.testing.assert_allclose(drawn["receiver"], scale * (moved.rx - moved.array_center)[:, 1:], atol=1e-9)
    assert ax.xaxis_inverted()
    assert (ax.get_xlabel(), ax.get_ylabel()) == (f"y [{unit}], to the left", f"z [{unit}], up")


def test_antenna_pattern_has_both_cuts_of_every_pattern_once() -> None:
    ax: Any = plot.antenna_pattern(RADAR)
    assert ax.name == "polar"
    azimuth, elevation = ax.get_lines()
    assert (azimuth.get_label(), elevation.get_label()) == ("azimuth", "elevation")
    for line, width in ((azimuth, 80.0), (elevation, 30.0)):
        half = np.interp(np.deg2rad(width / 2.0), line.get_xdata(), line.get_ydata())
        assert half == pytest.approx(8.0 - 10.0 * np.log10(2.0), abs=1e-6)  # half power at half the width
    assert ax.get_ylim() == (-20.0, 10.0)
    wide = rc.IsotropicPattern(2.0)
    mixed = rc.Radar(WAVEFORM, tx=row(1), rx=row(3), pattern=RADAR.pattern, rx_patterns=[RADAR.pattern, wide, wide])
    straight: Any = plot.antenna_pattern(mixed, polar=False)
    labels = [line.get_label() for line in straight.get_lines()]
    assert labels == ["TX and RX 0, azimuth", "TX and RX 0, elevation", "RX 1, 2, azimuth", "RX 1, 2, elevation"]
    assert len(plot.antenna_pattern(wide).get_lines()) == 2


@pytest.mark.parametrize("part", ["two-way", "transmit", "receive"])
def test_array_pattern_is_highest_where_it_is_steered(part: str) -> None:
    ax: Any = plot.array_pattern(rc.Radar(WAVEFORM, tx=row(4), rx=row(6)), steer=np.deg2rad(25.0), part=part)
    ahead, steered = ax.get_lines()
    assert ahead.get_xdata()[ahead.get_ydata().argmax()] == pytest.approx(0.0, abs=1e-9)
    assert steered.get_xdata()[steered.get_ydata().argmax()] == pytest.approx(25.0)
    gain = {"two-way": 24.0, "transmit": 4.0, "receive": 6.0}[part]
    assert steered.get_ydata().max() == pytest.approx(10.0 * np.log10(gain))
    assert ax.get_xlim() == (90.0, -90.0)  # left on the left
    assert ax.get_ylabel() == f"{part.capitalize()} gain [dB]"
    assert steered.get_label() == "steered to 25°"


def test_array_pattern_cuts_through_the_direction_steered_to() -> None:
    plane = rc.Radar(WAVEFORM, tx=row(4, axis=2), rx=row(4))
    to = np.deg2rad([20.0, -10.0])
    for cut, place in (("azimuth", 20.0), ("elevation", -10.0)):
        ax: Any = plot.array_pattern(plane, steer=to, cut=cut, polar=True)
        steered = ax.get_lines()[-1]
        assert np.rad2deg(steered.get_xdata()[steered.get_ydata().argmax()]) == pytest.approx(place, abs=0.05)
        assert steered.get_ydata().max() == pytest.approx(10.0 * np.log10(16.0), abs=1e-6)
    assert len(plot.array_pattern(plane).get_lines()) == 1


def test_radar_cross_section_is_drawn_in_dbsm_from_the_floor_of_the_first_curve() -> None:
    angles = np.arange(-180.0, 181.0, 1.0)
    sections = 10.0 ** (0.1 * (-5.0 + 10.0 * np.cos(np.deg2rad(angles))))
    sections[0] = 0.0
    ax: Any = plot.rcs(angles, sections, label="body")
    (line,) = ax.get_lines()
    assert ax.name == "polar"
    np.testing.assert_allclose(line.get_xdata(), np.deg2rad(angles))
    np.testing.assert_allclose(line.get_ydata()[1:], 10.0 * np.log10(sections[1:]))
    assert line.get_ydata()[0] == ax.get_ylim()[0] == -30.0  # nothing lies on the floor
    assert plot.rcs(angles, np.full(361, 10.0), ax, label="sphere") is ax
    assert len(ax.get_lines()) == 2
    assert ax.get_ylim() == (-30.0, 15.0)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["body", "sphere"]
    straight: Any = plot.rcs(angles, sections, polar=False)
    assert straight.xaxis_inverted()
    assert straight.get_ylabel() == "Radar cross-section [dBsm]"
