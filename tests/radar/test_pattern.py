"""Tabulated patterns, and patterns of single elements."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

import radarcore as rc
from radarcore.radar.pattern import Pattern, pattern_from_dict, pattern_to_dict

WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=20e12, sample_rate=2e6, num_samples=8, num_chirps=2, chirp_interval=100e-6
)
TX = [[0.0, 0.05, 0.0], [0.0, -0.05, 0.0]]
RX = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.05], [0.02, 0.0, 0.0]]


def table_of(pattern: Any, step_deg: float) -> rc.TabulatedPattern:
    """A pattern at angles all round."""
    azimuth = np.deg2rad(np.arange(-180.0, 180.1, step_deg))
    elevation = np.deg2rad(np.arange(-90.0, 90.1, step_deg))
    return rc.TabulatedPattern(azimuth, elevation, 10.0 * np.log10(pattern.gain(azimuth[:, None], elevation)))


def spheres() -> rc.Scene:
    """A ball on boresight, one to the side and a moving point."""
    return rc.Scene(
        [
            rc.Body(rc.shapes.sphere(0.1), motion=rc.Pose([1.5, 0.0, 0.0])),
            rc.Body(rc.shapes.sphere(0.1), material=rc.Material(-0.5, 0.3), motion=rc.Pose([1.5, 0.6, -0.4])),
            rc.PointTarget([2.0, -0.5, 0.3], velocity=[0.0, 3.0, 0.0]),
        ]
    )


def simulator(scene: rc.Scene | None = None, **radar: Any) -> rc.Simulator:
    sensor = rc.Radar(WAVEFORM, **({"tx": TX, "rx": RX} | radar))
    pixels: dict[str, Any] = {"sampling": "footprint", "resolution": 32, "field_of_view_deg": (60.0, 60.0)}
    return rc.Simulator(scene or spheres(), sensor, tolerance=1e-9, method="direct", **pixels)


def gain_towards_db(pattern: Any, position: Any) -> float:
    """Gain as a point target sees it, there and back by one antenna, halved."""
    scene = rc.Scene([rc.PointTarget(position)])
    with_it, without = (
        abs(rc.Simulator(scene, radar, resolution=2).paths().amplitude[0, 0])
        for radar in (rc.Radar(WAVEFORM, pattern=pattern), rc.Radar(WAVEFORM))
    )
    return float(10.0 * np.log10(with_it / without)) if with_it else -np.inf


def one_way_db(pattern: Any, azimuth_deg: float, elevation_deg: float) -> float:
    az, el = np.deg2rad([azimuth_deg, elevation_deg])
    return gain_towards_db(pattern, 3.0 * np.array([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)]))


def test_table_is_bilinear_in_decibels() -> None:
    rng = np.random.default_rng(3)
    azimuth = np.sort(rng.uniform(-np.pi, np.pi, 9))
    elevation = np.sort(rng.uniform(-np.pi / 2, np.pi / 2, 7))
    gain_db = rng.uniform(-30.0, 20.0, (9, 7))
    pattern = rc.TabulatedPattern(azimuth, elevation, gain_db)
    expected = RegularGridInterpolator((azimuth, elevation), gain_db)
    az, el = rng.uniform(azimuth[0], azimuth[-1], 200), rng.uniform(elevation[0], elevation[-1], 200)
    np.testing.assert_allclose(10.0 * np.log10(pattern.gain(az, el)), expected(np.stack([az, el], 1)), atol=1e-12)
    assert pattern.gain(azimuth[2], elevation[:, None]).shape == (7, 1)
    np.testing.assert_allclose(10.0 * np.log10(pattern.gain(azimuth[2], elevation)), gain_db[2], atol=1e-12)
    # Samples do not change.
    for a, e in np.rad2deg(np.stack([az, el], 1)[:5]):
        assert one_way_db(pattern, a, e) == pytest.approx(expected(np.deg2rad([a, e]))[0], abs=1e-9)


def test_nothing_is_seen_outside_of_a_table() -> None:
    pattern = rc.TabulatedPattern.from_degrees([-40, 0, 40], [-20, 20], [[0, 0], [10, 10], [0, 0]])
    assert pattern.gain(np.deg2rad([-40.0, 40.0]), np.deg2rad([20.0, -20.0])).tolist() == [1.0, 1.0]
    assert not pattern.gain(np.deg2rad([-40.1, 40.1, 0.0, 0.0, 180.0]), np.deg2rad([0, 0, 20.1, -20.1, 0])).any()
    assert one_way_db(pattern, 39.9, 0.0) == pytest.approx(10.0 * 0.1 / 40.0, abs=1e-9)
    for azimuth_deg, elevation_deg in [(40.1, 0.0), (-40.1, 0.0), (0.0, 20.1), (0.0, -20.1), (180.0, 0.0)]:
        assert one_way_db(pattern, azimuth_deg, elevation_deg) == -np.inf
    # A ball outside of a table is not there, and is not cast.
    aside = rc.Scene([spheres().bodies[1]])
    frame = simulator(aside, pattern=rc.TabulatedPattern.from_degrees([-60, 15], [-20, 20], np.zeros((2, 2)))).frame()
    assert not frame.cube.any()
    assert simulator(aside).frame().cube.any()


def test_gain_has_no_step_behind_the_antenna_where_a_table_goes_round() -> None:
    gains = [[1.0, 1.0], [2.0, 2.0], [3.0, 3.0], [4.0, 4.0]]
    for azimuth_deg, behind in [((-180, -90, 0, 90), 1.0), ((-90, 0, 90, 180), 4.0), ((-135, -45, 45, 135), 2.5)]:
        pattern = rc.TabulatedPattern.from_degrees(azimuth_deg, [-90, 90], gains)
        for beside in (-180.0, -180.0 + 1e-7, 180.0 - 1e-7, 180.0):
            assert one_way_db(pattern, beside, 10.0) == pytest.approx(behind, abs=1e-6)
            assert 10.0 * np.log10(pattern.gain(np.deg2rad(beside + 360.0), 0.0)) == pytest.approx(behind, abs=1e-6)
    # A gap that is wider than any other is no part of the table.
    part = rc.TabulatedPattern.from_degrees([-100, -50, 0, 50, 100], [-90, 90], np.zeros((5, 2)))
    assert one_way_db(part, 180.0, 0.0) == -np.inf


def test_straight_up_and_down_have_the_gain_at_azimuth_zero() -> None:
    pattern = rc.TabulatedPattern.from_degrees([-180, 0, 180], [-90, 0, 90], [[9, 9, 9], [1, 2, 3], [9, 9, 9]])
    assert one_way_db(pattern, 0.0, 0.0) == pytest.approx(2.0, abs=1e-12)
    for z, gain_db in [(2.0, 3.0), (-2.0, 1.0)]:
        assert gain_towards_db(pattern, [0.0, 0.0, z]) == pytest.approx(gain_db, abs=1e-9)


def test_table_of_a_gaussian_beam_gives_its_frames_within_the_error_of_interpolation() -> None:
    # In decibels the beam is c (angle / width)^2 with c = 40 lg 2: a chord over a step h lies below it by at most
    # c (h / width)^2 / 4, in each axis. The amplitude of a pair has half of each antenna, in decibels of power.
    beam, step = rc.GaussianPattern(6.0, 60.0, 40.0), 5.0
    error_db = 40.0 * np.log10(2.0) * ((step / 60.0) ** 2 + (step / 40.0) ** 2) / 4.0
    table = table_of(beam, step)
    azimuth, elevation = np.linspace(-3.0, 3.0, 301)[:, None], np.linspace(-1.5, 1.5, 201)
    short_db = 10.0 * np.log10(beam.gain(azimuth, elevation) / table.gain(azimuth, elevation))
    assert short_db.min() >= -1e-10
    assert 0.9 * error_db < short_db.max() <= error_db

    exact, sampled = (simulator(pattern=pattern) for pattern in (beam, table))
    amplitudes, of_table = exact.paths().amplitude, sampled.paths().amplitude
    is_seen = amplitudes != 0.0  # points at the limb face away from some antennas
    np.testing.assert_array_equal(of_table != 0.0, is_seen)
    ratio = np.abs(of_table[is_seen]) / np.abs(amplitudes[is_seen])
    assert 10.0 ** (-error_db / 10.0) <= ratio.min()
    assert ratio.max() <= 1.0 + 1e-12
    assert ratio.min() < 0.999
    difference = np.abs(sampled.frame().cube - exact.frame().cube).max(axis=(1, 2))
    bound = (1.0 - 10.0 ** (-error_db / 10.0)) * np.abs(amplitudes).sum(axis=1)
    assert (difference <= bound).all()
    assert (difference > 0.0).all()


def test_patterns_of_elements_weigh_their_channels() -> None:
    # A point at 30 degrees to the left: half power of the beam of 60 degrees, 1 dB of the table, by hand.
    azimuth, distance, rcs = np.deg2rad(30.0), 4.0, 0.3
    position = distance * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    table = rc.TabulatedPattern.from_degrees([0.0, 40.0], [-5.0, 5.0], [[4.0, 4.0], [0.0, 0.0]])
    radar = rc.Radar(
        WAVEFORM,
        tx=np.zeros((2, 3)),
        rx=np.zeros((3, 3)),
        pattern=rc.IsotropicPattern(-100.0),
        tx_patterns=[rc.IsotropicPattern(2.0), rc.GaussianPattern(3.0, 60.0, 20.0)],
        rx_patterns=[table, rc.GaussianPattern(0.0, 60.0, 60.0), rc.IsotropicPattern(-20.0)],
        tx_power_dbm=20.0,
    )
    amplitude = rc.Simulator(rc.Scene([rc.PointTarget(position, rcs)]), radar, resolution=2).paths().amplitude[:, 0]
    gains_t = np.array([10.0**0.2, 10.0**0.3 / 2.0])
    gains_r = np.array([10.0**0.1, 0.5, 0.01])
    gains = np.outer(gains_t, gains_r).ravel()  # channel = tx * num_rx + rx
    power = 0.1 * gains * WAVEFORM.wavelength**2 * rcs / ((4.0 * np.pi) ** 3 * distance**4)
    np.testing.assert_allclose(amplitude, np.sqrt(power), rtol=1e-12)


def test_patterns_of_elements_weigh_the_echoes_of_bodies_too() -> None:
    beams = [rc.GaussianPattern(6.0, 90.0, 90.0), rc.IsotropicPattern(3.0)]
    both = simulator(rx=RX[:2], tx_patterns=beams, rx_patterns=beams[::-1]).frame().cube
    for i in range(2):
        for j in range(2):
            alone = simulator(tx=TX, rx=RX[:2], tx_patterns=[beams[i]] * 2, rx_patterns=[beams[1 - j]] * 2).frame().cube
            np.testing.assert_array_equal(both[2 * i + j], alone[2 * i + j])


def test_one_pattern_for_all_is_that_of_every_element() -> None:
    beam, other = rc.GaussianPattern(6.0, 60.0, 40.0), rc.IsotropicPattern()
    of_all = rc.Radar(WAVEFORM, tx=TX, rx=RX, pattern=beam)
    assert (of_all.tx_patterns, of_all.rx_patterns) == ((beam,) * 2, (beam,) * 3)
    assert rc.Radar(WAVEFORM, tx=TX, rx=RX, tx_patterns=[beam] * 2, rx_patterns=[beam] * 3, pattern=beam) == of_all
    mixed = rc.Radar(WAVEFORM, tx=TX, rx=RX, pattern=beam, tx_patterns=[other, beam])
    assert (mixed.tx_patterns, mixed.rx_patterns) == ((other, beam), (beam,) * 3)
    assert mixed != of_all


def test_depth_images_of_other_programs_take_tables_too() -> None:
    beam = rc.GaussianPattern(6.0, 60.0, 40.0)

    def frame(pattern: Any) -> NDArray[Any]:
        radar = rc.Radar(WAVEFORM, tx=TX, rx=RX, pattern=pattern)
        return rc.frame_from_depth(np.full((24, 24), 1.5), 0.5, radar, camera=(60.0, 60.0), tolerance=1e-9).cube

    exact, fine, isotropic = frame(beam), frame(table_of(beam, 1.0)), frame(rc.IsotropicPattern())
    assert np.abs(fine - exact).max() < 2e-3 * np.abs(exact).max()
    assert np.abs(isotropic - exact).max() > 0.1 * np.abs(exact).max()


TABLE = rc.TabulatedPattern([-1.0, 0.0, 0.5], [-0.2, 0.3], [[0.1, 0.2], [3.0, 4.0], [5.0, -6.0]])


@pytest.mark.parametrize("pattern", [TABLE, rc.GaussianPattern(6.0, 60.0, 40.0)])
def test_azimuths_repeat_after_a_whole_turn(pattern: Pattern) -> None:
    azimuth = np.array([-3.1, -0.3, 0.2, 3.0])
    for turns in (-2, -1, 1):
        again = pattern.gain(azimuth + 2.0 * np.pi * turns, 0.1)
        np.testing.assert_allclose(again, pattern.gain(azimuth, 0.1), rtol=1e-12, atol=0)


def test_table_makes_the_round_trip_through_json_and_pickle() -> None:
    for pattern in (TABLE, rc.IsotropicPattern(1.0), rc.GaussianPattern(1.0, 2.0, 3.0)):
        pattern.gain(0.0, 0.0)
        assert pattern._core is not None  # the core's part stays behind
        for again in (
            pattern_from_dict(json.loads(json.dumps(pattern_to_dict(pattern)))),
            pickle.loads(pickle.dumps(pattern)),
        ):
            assert again == pattern
            assert hash(again) == hash(pattern)
    radar = rc.Radar(WAVEFORM, pattern=TABLE)
    assert rc.Simulator(rc.Scene(), radar)._engines
    assert pickle.loads(pickle.dumps(radar)) == radar


def test_tables_are_equal_when_their_numbers_are() -> None:
    same = rc.TabulatedPattern(TABLE.azimuth, TABLE.elevation, TABLE.gain_db)
    assert same == TABLE
    for changed in (
        rc.TabulatedPattern(TABLE.azimuth - 0.1, TABLE.elevation, TABLE.gain_db),
        rc.TabulatedPattern(TABLE.azimuth, TABLE.elevation - 0.1, TABLE.gain_db),
        rc.TabulatedPattern(TABLE.azimuth, TABLE.elevation, TABLE.gain_db - 0.1),
        rc.IsotropicPattern(),
    ):
        assert changed != TABLE


def test_table_tells_its_size_and_cannot_be_changed() -> None:
    pattern = rc.TabulatedPattern.from_degrees([-60, 0, 60], [-30, 45], [[0, 0], [12.5, 1], [0, 0]])
    text = "table of 3 x 2, peak 12.5 dBi, azimuth -60 to 60, elevation -30 to 45 degrees"
    assert (str(pattern), repr(pattern)) == (text, f"<TabulatedPattern: {text}>")
    assert str(rc.IsotropicPattern(3.0)) == "isotropic, 3 dBi"
    assert str(rc.GaussianPattern(6.0, 60.0, 40.0)) == "Gaussian, 6 dBi, 60 x 40 degrees"
    gains = np.zeros((2, 2))
    mine = rc.TabulatedPattern([0.0, 1.0], [0.0, 1.0], gains)
    gains[0, 0] = 50.0
    assert mine.gain(0.0, 0.0) == 1.0
    with pytest.raises(ValueError, match="read-only"):
        mine.gain_db[0, 0] = 1.0


def test_file_of_a_table_has_a_line_per_direction_in_any_order(tmp_path: Path) -> None:
    path = tmp_path / "horn.csv"
    path.write_text("gain_db, azimuth_deg,elevation_deg\n1,-10,0\n\n2,10,0\n3,-10,5\n4,10,5\n", encoding="utf-8-sig")
    pattern = rc.TabulatedPattern.load(path)
    assert pattern == rc.TabulatedPattern.from_degrees([-10, 10], [0, 5], [[1, 3], [2, 4]])


HEAD = "azimuth_deg,elevation_deg,gain_db\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected the columns azimuth_deg, elevation_deg, gain_db, got none"),
        ("0,0,1\n", "expected the columns azimuth_deg, elevation_deg, gain_db, got 0, 0, 1"),
        ("azimuth,elevation,gain_db\n", "expected the columns .*, got azimuth, elevation, gain_db"),
        ("a\0,b\n", r"expected the columns .*, got a\\x00, b"),
        ("a" * 9999, r"expected the columns .*, got a{200}\.\.\.$"),
        (HEAD, "expected lines of numbers, got none"),
        (HEAD + "0,0,1\n0,1\n", "invalid column index 2 at row 2 with 2 columns"),
        (HEAD + "0,0,high\n", "could not convert string 'high' to float64 at row 0, column 3"),
        (HEAD + "0,nan,1\n", r"lines: expected finite numbers, got nan at index \(0, 1\)"),
        (HEAD + "0,0,1\n0,1,1\n1,0,1\n", "expected one line for every .*, got 0 for azimuth 1 and elevation 1 degrees"),
        (HEAD + "0,0,1\n0,0,1\n", "expected one line for every .*, got 2 for azimuth 0 and elevation 0 degrees"),
        (HEAD + "0,0,1\n0,1,1\n", r"azimuth_deg: expected at least two angles \[degrees\], got 1"),
        (HEAD + "0,0,1\n0,91,1\n5,0,1\n5,91,1\n", r"elevation_deg: expected angles from -90 to 90 \[degrees\], got 91"),
        ("a\n\xff", ".*can't decode"),
    ],
)
def test_file_that_holds_no_table_is_refused_with_its_name(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "horn.csv"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(ValueError, match=f"horn.csv: {message}"):
        rc.TabulatedPattern.load(path)


def test_only_a_file_that_ends_is_read(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"horn\.csv"):
        rc.TabulatedPattern.load(tmp_path / "horn.csv")
    if Path("/dev/zero").exists():
        with pytest.raises(ValueError, match=r"^/dev/zero: expected a file, got a device or a pipe"):
            rc.TabulatedPattern.load("/dev/zero")
