"""The gallery: every example runs in short form, its output is right, and its picture is on the page."""

from __future__ import annotations

import re
import runpy
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import infineon_folders
import radarcore as rc
from radarcore.recording.frame import to_codes
from recordings import real_recording

pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
GALLERY = ROOT / "docs" / "gallery"
NAMES: tuple[str, ...] = runpy.run_path(str(EXAMPLES / "gallery.py"))["NAMES"]


Printed = Callable[..., str]


@pytest.fixture
def printed(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Printed:
    """A function that runs an example as a script in this process, and returns what it prints."""
    picture = tmp_path / "new" / "picture.png"

    def run(name: str, *arguments: str) -> str:
        script = EXAMPLES / f"{name}.py"
        monkeypatch.setattr(sys, "argv", [str(script), *arguments, "-o", str(picture)])
        runpy.run_path(str(script), run_name="__main__")
        assert picture.read_bytes()[:4] == b"\x89PNG"
        return capsys.readouterr().out

    return run


def numbers(text: str) -> list[list[float]]:
    """Numbers of every line."""
    return [[float(number) for number in re.findall(r"[-+]?\d+(?:\.\d+)?", line)] for line in text.splitlines()]


def test_person_is_found_from_the_moving_arm_once_static_echoes_are_gone(printed: Printed) -> None:
    (as_it_is, _), (filtered, count) = numbers(printed("walker_from_moving_arm", "--num-frames", "3"))
    assert (as_it_is, filtered, count) == (0.0, 3.0, 3.0)


def test_strongest_echo_of_the_walker_has_the_velocity_of_the_trunk(printed: Printed) -> None:
    (apart, velocity_bin), _ = numbers(printed("walking_person", "--duration", "0.3"))
    assert apart < velocity_bin


def test_two_blades_flash_twice_per_turn(printed: Printed) -> None:
    ((rate, expected),) = numbers(printed("propeller", "--num-turns", "1.3"))
    assert expected == 2 * 20.0
    assert rate == pytest.approx(expected, rel=0.02)  # columns every 0.2 ms, flashes every 25 ms


def test_corner_and_plate_have_the_cross_sections_of_textbooks(printed: Printed) -> None:
    lines = printed("corner_reflector", "--step-deg", "30").splitlines()
    number = r"([-+]?[\d.]+)"
    pattern = rf"\w+: {number} m, truth {number} m; \d+ dB above noise; {number} dBsm, theory {number} dBsm"
    corner, plate = (np.array(re.fullmatch(pattern, line).groups(), dtype=float) for line in lines)  # type: ignore[union-attr]
    edge, wavelength = 0.1, 299_792_458.0 / 61e9
    assert corner[3] == pytest.approx(10.0 * np.log10(4.0 * np.pi * edge**4 / (3.0 * wavelength**2)), abs=0.06)
    assert plate[3] == pytest.approx(10.0 * np.log10(4.0 * np.pi * edge**4 / wavelength**2), abs=0.06)
    np.testing.assert_allclose([corner[0], plate[0]], [corner[1], plate[1]], atol=3e-3)
    assert corner[2] == pytest.approx(corner[3], abs=0.5)
    assert plate[2] == pytest.approx(plate[3] - 1.0, abs=0.3)  # 3 m are within the far-field distance of 4 m


def test_smooth_wall_is_the_image_of_the_radar_and_unseen_obliquely(printed: Printed) -> None:
    at_0, at_60 = numbers(printed("oblique_wall", "--step-deg", "30"))
    assert at_0[1] == pytest.approx(at_0[2], abs=0.4)  # the edges of the wall add or take some
    _, smooth, rough = at_60
    assert smooth > 35.0
    assert abs(rough) < 15.0  # speckle


def test_ghosts_are_at_the_image_of_the_ball_and_half_way_to_it(printed: Printed) -> None:
    for line in numbers(printed("multipath_ghost")):
        np.testing.assert_allclose(line[:2], line[2:], atol=0.05)  # of bins of 0.2 m


def test_angles_of_the_array_are_found_and_on_the_page(printed: Printed) -> None:
    text = printed("mimo_angles")
    assert text in (ROOT / "docs" / "angles.md").read_text(encoding="utf-8")
    lines = dict(line.split(maxsplit=1) for line in text.splitlines())
    truth = np.array(lines["truth"].split()[:-1], dtype=float)
    np.testing.assert_allclose(np.array(lines["music"].split(), dtype=float), truth, atol=1.0)


def test_interferer_raises_the_floor_and_lowers_every_target(printed: Printed) -> None:
    text = printed("interference")
    assert text in (ROOT / "docs" / "interference.md").read_text(encoding="utf-8")
    (power, hit), (duration, samples, _), *levels, (raised,) = numbers(text)
    distance = np.hypot(30.0, 3.5)
    gain_db = 2.0 * (13.0 - 12.0 * np.rad2deg(np.arctan2(3.5, 30.0)) ** 2 / 60.0**2)  # of both antennas
    friis_db = 12.0 + gain_db + 20.0 * np.log10(299_792_458.0 / 76.6e9 / (4.0 * np.pi * distance))
    assert power == pytest.approx(friis_db, abs=0.2)
    assert hit > 100
    assert samples == pytest.approx(20.0 * duration, abs=1.0)
    alone, disturbed = np.array(levels)
    np.testing.assert_allclose(alone - disturbed, raised, atol=2.0)


def test_simulated_echoes_follow_the_steered_pattern_and_the_page(printed: Printed) -> None:
    text = printed("beam_steering")
    assert text in (ROOT / "docs" / "angles.md").read_text(encoding="utf-8")
    found = re.findall(r"steered to +(\d+): loudest target at \+(\d+) degrees, .* within ([\d.]+) dB", text)
    assert [steer for steer, _, _ in found] == [loudest for _, loudest, _ in found] == ["0", "15", "30"]
    assert max(float(error) for _, _, error in found) < 0.1  # wave fronts over 15 m bend by 1e-3 turns


def test_depth_images_and_meshes_give_the_same_echoes(printed: Printed) -> None:
    ball, post, trunk = numbers(printed("depth_camera"))
    for by_depth, by_meshes, true in (np.reshape(line, (3, 2)) for line in (ball, post, trunk)):
        np.testing.assert_allclose(by_depth, by_meshes, atol=0.08)  # half of a bin of 0.16 m and 0.13 m/s
        np.testing.assert_allclose(by_depth, true, atol=0.08)


def breathing(folder: Path) -> Path:
    """A recording folder of Infineon's tools: somebody 0.5 m away who breathes 30 times per minute."""
    config = infineon_folders.config(num_chirps_per_frame=2, num_samples_per_chirp=64)
    infineon_folders.folder(
        folder, config_json=config, radar_npy=infineon_folders.array(np.zeros((1, 3, 2, 64), "<u2"))
    )
    radar = rc.Recording.load(folder).radar
    times = np.arange(80) * radar.waveform.frame_interval
    delay = 2.0 / 299_792_458.0 * (0.5 + 3e-3 * np.sin(2.0 * np.pi * 0.5 * times))
    beat = [rc.beat_signal(np.array([one]), np.array([0.2 + 0.0j]), radar.waveform).real for one in delay]
    codes = to_codes(np.broadcast_to(beat, (80, 3, 2, 64)).astype(np.float32))
    (folder / infineon_folders.FOLDER / "radar.npy").write_bytes(infineon_folders.array(codes))
    return folder


def test_breaths_are_counted_in_a_folder_of_infineon(printed: Printed, tmp_path: Path) -> None:
    (tracked, total, _, _), (rate,) = numbers(printed("real_recording", str(breathing(tmp_path / "recording"))))
    assert tracked == pytest.approx(total, abs=5)
    assert rate == pytest.approx(30.0, abs=1.0)


def test_breaths_are_counted_in_a_recording_of_a_real_sensor(printed: Printed) -> None:
    (tracked, total, nearest, farthest), (rate,) = numbers(printed("real_recording", str(real_recording())))
    assert (tracked, total) == (256.0, 256.0)
    assert 0.30 < nearest < farthest < 0.45  # as published
    assert 8.0 < rate < 25.0  # of somebody at rest


def test_board_in_front_of_a_scene_measures_the_ball(printed: Printed) -> None:
    (_, _, count, lost), (error,) = numbers(printed("virtual_sensor", "--num-frames", "15"))
    assert (count, lost) == (15.0, 0.0)
    assert error < 3.0  # [mm]


def test_cart_stops_where_it_should(printed: Printed) -> None:
    ((true, wanted, measured),) = numbers(printed("live_loop"))
    assert true == pytest.approx(wanted, abs=0.01)
    assert measured == pytest.approx(true, abs=0.01)


# --- The page


def test_page_has_picture_script_and_command_of_every_example() -> None:
    page = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    assert len(NAMES) >= 12
    for name in NAMES:
        assert f"gallery/{name}.png" in page
        assert f"(../examples/{name}.py)" in page
        assert f"python examples/{name}.py" in page


def test_scripts_are_short_and_pictures_small() -> None:
    assert sorted(path.stem for path in GALLERY.iterdir()) == sorted(NAMES)
    for name in NAMES:
        assert len((EXAMPLES / f"{name}.py").read_text(encoding="utf-8").splitlines()) < 60
        assert (GALLERY / f"{name}.png").stat().st_size < 80_000
