"""Recordings against each other and against the truth."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from picture_scenes import texts_apart

BOARD = rc.bgt60tr13c(num_chirps=32)
WF = BOARD.waveform
RADAR = rc.Radar(
    WF, rx=BOARD.rx, pattern=BOARD.pattern, tx_power_dbm=BOARD.tx_power_dbm, receiver=rc.Receiver(noise_figure_db=12.0)
)
"""A radar of I/Q samples, whose phases can be turned."""

OFFSET = 0.3127
"""The clock of the second recording is behind by that [s]."""


def ball_at(time: float) -> rc.Pose:
    return rc.Pose([2.2 + 0.3 * np.sin(3.0 * time), 0.3, 0.0])


def scene() -> rc.Scene:
    ball = rc.Body(rc.shapes.sphere(0.05), motion=ball_at, name="ball")
    post = rc.PointTarget([3.5, -0.8, 0.0], rcs=0.1, name="post")
    return rc.Scene([ball, post])


@pytest.fixture(scope="module")
def simulated() -> rc.Recording:
    return rc.Simulator(scene(), RADAR, resolution=32).record(0.0, 1.0, 40.0, progress=False)


@pytest.fixture(scope="module")
def measured() -> rc.Recording:
    """At other times and with other noise, by a clock of its own, with frames missing, twice as weak and turned."""
    taken = rc.Simulator(scene(), RADAR, resolution=32, seed=7).record(0.0037, 1.0, 40.0, progress=False)
    kept = [k for k in range(len(taken)) if k not in (8, 9, 30)]
    cube = (0.5 * np.exp(0.4j) * taken.cube[kept].astype(np.complex128)).astype(np.complex64)
    lost = np.zeros(len(kept), np.int32)
    lost[8] = 2
    return rc.Recording(cube, taken.time[kept] - OFFSET, RADAR, lost=lost)


@pytest.fixture(scope="module")
def side_by_side(simulated: rc.Recording, measured: rc.Recording) -> rc.Comparison:
    """Both at their offset."""
    return compare(simulated, measured, offset=OFFSET, names=("simulated", "a <b> & c"))


def compare(*recordings: Any, **options: Any) -> rc.Comparison:
    return rc.compare(*recordings, progress=False, **options)


def scaled(recording: rc.Recording, factor: float) -> rc.Recording:
    return replace(recording, cube=(factor * recording.cube).astype(recording.cube.dtype))


def test_estimated_offset_of_what_swings_has_no_bias_of_half_a_chirp() -> None:
    """Chirps every 1 ms: velocities half a chirp late would shift the clock by 0.5 ms, seven deviations."""
    radar = rc.bgt60tr13c(num_chirps=64, chirp_interval=1e-3, frame_interval=70e-3)
    ball = rc.Body(rc.shapes.sphere(0.05), motion=lambda t: rc.Pose([2.0 + 0.15 * np.cos(np.pi * t), 0.0, 0.0]))
    one = rc.Simulator(rc.Scene([ball]), radar, resolution=16).record(0.0, 3.0, 14.0, progress=False)
    other = replace(one, time=one.time - OFFSET, truth=None)
    estimated = compare(one, other, offset="auto").sides[1].offset
    assert abs(estimated.seconds - OFFSET) <= 3.0 * estimated.deviation <= 0.3e-3


def test_simulated_measured_and_true_are_one_picture(simulated: rc.Recording, measured: rc.Recording) -> None:
    compared = compare(simulated, measured, offset="auto", names=("simulated", "measured"))
    a, b = compared.sides
    assert (a.name, b.name) == ("simulated", "measured")
    assert (a.offset.seconds, a.offset.is_estimated, b.offset.is_estimated) == (0.0, False, True)
    assert b.offset.seconds == pytest.approx(OFFSET, abs=1e-3)
    assert [(one.frame, one.count, one.is_counted) for one in b.dropped] == [(8, 2, True), (28, 1, False)]
    assert a.dropped == ()
    for target in compared.targets:
        first, second = target.errors
        assert first.num_frames == first.num_tracked == first.range.num_within == first.velocity.num_within == 40
        assert second.num_frames == second.range.num_within == second.velocity.num_within
        assert second.num_frames in (36, 37)  # the truth of A ends before the last frame of B
        assert target.difference is not None
        assert target.difference.range.median < 0.1 * WF.range_resolution
    assert [target.name for target in compared.targets] == ["ball", "post"]
    assert compared.differences == ()


def test_amplitudes_and_phases_are_those_of_a_known_factor(simulated: rc.Recording) -> None:
    some = simulated[:10]
    for target in compare(some, scaled(some, 0.5)).targets:
        echo = target.echo
        assert echo is not None
        assert echo.num_frames == 10
        assert echo.ratio_db == pytest.approx(20.0 * np.log10(0.5), abs=1e-4)
        assert echo.ratio_spread_db < 1e-4
        assert (echo.phase_deg, echo.phase_spread_deg) == pytest.approx((0.0, 0.0), abs=1e-3)
        assert echo.channel_phases_deg == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
        assert echo.note == ""


def test_phases_are_compared_although_targets_move_between_the_frames(side_by_side: rc.Comparison) -> None:
    for name, spread in (("post", 5.0), ("ball", 15.0)):
        echo = side_by_side[name].echo
        assert echo is not None
        assert echo.ratio_db == pytest.approx(-6.02, abs=0.15)
        # The ball moves by up to 5 mm between the frames, which is two turns of the phase.
        assert echo.phase_deg == pytest.approx(np.rad2deg(0.4), abs=5.0)
        assert echo.phase_spread_deg < spread
        assert echo.channel_phases_deg == pytest.approx((0.0, 0.0, 0.0), abs=3.0)


def test_truth_of_motions_counts_for_one_recording_alone(measured: rc.Recording) -> None:
    compared = compare(
        measured,
        truth={"ball": ball_at, "post": rc.Pose([3.5, -0.8, 0.0])},
        radii={"ball": 0.05},
        offset="auto",
        max_offset=0.6,  # motions without an end may come again
    )
    (side,) = compared.sides
    assert side.offset.seconds == pytest.approx(OFFSET, abs=1e-3)
    ball = compared["ball"]
    assert ball.errors[0].num_frames == ball.errors[0].range.num_within == len(measured)
    assert abs(ball.errors[0].range.bias) < 2e-3
    assert ball.difference is None
    assert ball.echo is None
    assert "motions in the world" in str(compared)


def test_without_truth_the_tracks_of_a_are_the_targets(simulated: rc.Recording, measured: rc.Recording) -> None:
    compared = compare(replace(simulated, truth=None), measured, offset="auto")
    assert compared.truth_source == ""
    assert compared.sides[1].offset.seconds == pytest.approx(OFFSET, abs=2e-3)
    assert len(compared.targets) == 2
    for target in compared.targets:
        assert target.errors == ()
        assert target.truth is None
        assert target.difference is not None
        assert target.difference.num_tracked == target.difference.range.num_within > 30
    assert "against the truth" not in str(compared)
    # The truth may belong to B alone.
    turned = compare(replace(measured, time=measured.time + 5.0), simulated, offset="auto")
    assert turned.sides[1].offset.seconds == pytest.approx(5.0 - OFFSET, abs=1e-3)
    assert turned["ball"].errors[0].range_share == 1.0


def test_radars_may_differ_and_it_is_said_how(simulated: rc.Recording) -> None:
    other = rc.bgt60tr13c(num_chirps=64, start_frequency=61e9, stop_frequency=63e9, receiver="measured")
    second = rc.Simulator(scene(), other, resolution=32).record(0.0, 0.5, 20.0, progress=False)
    compared = compare(simulated[:20], second)
    found = {one.name: (one.a, one.b) for one in compared.differences}
    assert found["num_chirps"] == ("32", "64")
    assert found["start_frequency"][1] == "6.1e+10 Hz"
    assert {"range_resolution", "receiver", "slope"} <= found.keys()
    assert "sample_rate" not in found
    ball = compared["ball"]
    assert [errors.range_share for errors in ball.errors] == [1.0, 1.0]
    assert ball.errors[0].range.bin_width != ball.errors[1].range.bin_width
    assert ball.echo is not None
    assert ball.echo.num_frames == 10
    assert np.isnan(ball.echo.phase_deg)
    assert "units of the samples differ" in ball.echo.note
    assert "no phases: centre frequencies differ" in ball.echo.note


def test_recordings_of_other_scenes_have_targets_of_their_own(simulated: rc.Recording) -> None:
    cart = rc.PointTarget([2.5, 0.0, 0.0], velocity=[0.4, 0.0, 0.0], rcs=0.1, name="cart")
    other = rc.Simulator(rc.Scene([cart]), RADAR).record(0.0, 0.3, 40.0, progress=False)
    compared = compare(simulated, other)
    assert {target.name for target in compared.targets} == {"ball", "post", "cart"}
    tracked = {target.name: [errors.num_tracked for errors in target.errors] for target in compared.targets}
    assert tracked == {"ball": [40, 0], "post": [40, 0], "cart": [0, len(other)]}


def test_what_leaves_tables_empty_is_warned_of(simulated: rc.Recording) -> None:
    some = simulated[:5]
    with pytest.warns(UserWarning, match="offset: expected recordings with times in common, got A from 0.00"):
        compare(some, some, offset=1e4)
    with pytest.warns(UserWarning, match="^A: expected at least one track, got none in 2 frames"):
        compare(simulated[:2])
    with pytest.warns(UserWarning, match="truth: expected some body in front of the radar at the times of A from"):
        compare(some, truth={"ball": rc.Pose([-2.0, 0.0, 0.0])})
    with pytest.warns(UserWarning, match="got 2200 m or more; are its lengths in metres?"):
        compare(some, truth={"ball": rc.Pose([2200.0, 0.0, 0.0])})
    # I/Q samples reach twice as far.
    assert WF.max_range < 15.0 < RADAR.max_unambiguous_range
    compare(some, truth={"ball": rc.Pose([15.0, 0.0, 0.0])})


def test_radar_without_velocities_is_compared_in_range(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    one_chirp = rc.bgt60tr13c(num_chirps=1)
    still = rc.Scene([rc.PointTarget([2.0, 0.3, 0.0], name="post")])
    a, b = (rc.Simulator(still, one_chirp, seed=k).record(0.0, 0.3, 40.0, progress=False) for k in (0, 1))
    compared = compare(a, b)
    for target in compared.targets:
        for errors in target.errors:
            assert errors.num_frames == errors.range.num_within == 12
            assert np.isnan(errors.velocity.median)
    compared.figure(tmp_path / "figure.png")
    with pytest.raises(ValueError, match="offset: expected detections near the truth at some offset, got none"):
        compare(a, b, offset="auto")


def test_paths_are_read_and_name_the_recordings(
    simulated: rc.Recording, measured: rc.Recording, tmp_path: Path
) -> None:
    simulated.save(tmp_path / "simulated")
    measured[:10].save(tmp_path / "measured.npz")
    compared = compare(tmp_path / "measured.npz", tmp_path / "simulated", offset=(OFFSET, 0.0))
    assert [side.name for side in compared.sides] == ["measured", "simulated"]
    some, path = measured[:10], tmp_path / "simulated"
    again = compare(some, truth=path, offset=OFFSET, targets={"thing": "ball"})
    assert [target.name for target in again.targets] == ["thing"]
    assert again["thing"].errors[0].range == compared["ball"].errors[0].range


def test_report_is_one_file_and_holds_all_numbers(side_by_side: rc.Comparison, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    compared = side_by_side
    figure = compared.figure()
    assert {"ball", "post", "Range [m]", "Velocity [m/s]"} <= texts_apart(figure)
    assert len({ax.images[0].get_clim() for ax in figure.axes if ax.images}) == 1  # although one is 6 dB weaker
    compared.report(tmp_path / "new" / "report.html")
    page = (tmp_path / "new" / "report.html").read_text(encoding="utf-8")
    assert page.count('src="data:image/png;base64,') == 2
    assert "http" not in page
    assert "a &lt;b&gt; &amp; c" in page
    assert "<b>" not in page
    for target in compared.targets:
        assert f"{target.errors[1].range.median:.4f}" in page

    facts = json.loads(json.dumps(compared.to_dict(), allow_nan=False))
    assert facts["recordings"][1]["offset"] == OFFSET
    assert facts["recordings"][1]["dropped"][0]["count"] == 2
    assert facts["targets"][0]["errors"][1]["num_frames"] == compared.targets[0].errors[1].num_frames


REFUSED: list[tuple[Callable[[rc.Recording], object], type[Exception], str]] = [
    (lambda a: compare(a, targets=["bal"]), ValueError, "bodies of the truth, got 'bal'; did you mean 'ball'"),
    (lambda a: compare(a, offset="guess"), ValueError, "offset: expected seconds or 'auto', got 'guess'"),
    (lambda a: compare(a, offset=(0.0, 0.0)), ValueError, "offset: expected one, or 1 of 1 recordings, got 2"),
    (lambda a: compare(a, offset="auto"), ValueError, "expected a number for A, whose clock is the time base without"),
    (lambda a: compare(a, names=["a", "b"]), ValueError, "names: expected 1, one per recording"),
    (lambda a: compare(a, a, names=("a", "a")), ValueError, "names: expected names that differ, got 'a', 'a'"),
    (lambda a: compare(a, truth={}), ValueError, "truth: expected at least one motion, got none"),
    (lambda a: compare(a, 3), TypeError, "recording_b: expected Recording or a path, got int"),
    (lambda a: compare(a[:0]), ValueError, "recording_a: expected at least one frame, got none"),
    (lambda a: compare(replace(a, truth=None)), ValueError, "recording_b: expected another recording, or a truth to"),
    (lambda a: compare(a, radar_motion=rc.Pose()), TypeError, "radar_motion: expected none without a truth of motions"),
    (lambda a: compare(a, truth=replace(a, truth=None)), ValueError, "truth: expected a recording with truth, got one"),
    (lambda a: compare(a[:4])["bal"], KeyError, "no target 'bal'"),
    (lambda a: compare(a[:4]).figure(time=99.0), ValueError, "time: expected one within the frames of 'A', .* got 99"),
    (lambda a: compare(a[:4]).report("n.html", time=-1.0), ValueError, "time: expected one within the frames of 'A'"),
]


@pytest.mark.filterwarnings("ignore:.*expected at least one track")
@pytest.mark.parametrize(("call", "error", "message"), REFUSED)
def test_refusals_say_what_was_expected(
    simulated: rc.Recording, call: Callable[[rc.Recording], object], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        call(simulated[:5])
