"""Representations of objects: a line in a terminal, a table in a notebook."""

import dataclasses

import numpy as np
import pytest

import radarcore as rc

WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=15e12, sample_rate=2e6, num_samples=128, num_chirps=16, chirp_interval=3e-4
)
RADAR = rc.Radar(WAVEFORM, rx=[[0.0, 0.0, 0.0], [0.0, 2.5e-3, 0.0]], receiver=rc.Receiver(noise_figure_db=12.0))
SCENE = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[-1.0, 0.0, 0.0], name="<ball>")])
SIMULATOR = rc.Simulator(SCENE, RADAR, seed=3)
RADAR_LINE = "60 to 60.96 GHz, 16 chirps of 128 samples, 1 TX, 2 RX, 208 Hz"


@pytest.fixture(scope="module")
def recording() -> rc.Recording:
    return SIMULATOR.record(0.0, 0.03, rate=100.0, progress=False)


def test_lines(recording: rc.Recording) -> None:
    shape = "2 channels x 16 chirps x 128 samples"
    assert repr(RADAR) == f"<Radar {RADAR_LINE}>"
    assert repr(recording[0]) == f"<Frame at 0 s: {shape}, complex64, truth of <ball>>"
    assert repr(recording) == f"<Recording of 3 frames in 0.02 s: {shape}, complex64, truth of <ball>>"
    assert repr(recording[1:2]) == f"<Recording of 1 frames: {shape}, complex64, truth of <ball>>"
    assert repr(SIMULATOR) == f"<Simulator of <Scene: <ball>> and <Radar {RADAR_LINE}>: 150 x 150 degrees, seed=3>"


def test_line_of_a_frame_without_truth_ends_with_its_samples(recording: rc.Recording) -> None:
    assert repr(dataclasses.replace(recording[0], truth=None)).endswith("complex64>")


def test_line_of_a_radar_at_one_frequency_and_of_several_ramps() -> None:
    cw = rc.Radar(dataclasses.replace(WAVEFORM, slope=0.0))
    assert repr(cw) == "<Radar 60 GHz, 16 chirps of 128 samples, 1 TX, 1 RX, 208 Hz>"
    down = dataclasses.replace(WAVEFORM, start_frequency=61e9, slope=-15e12, chirp_times=5e-3 + WAVEFORM.chirp_times)
    both = rc.Radar([WAVEFORM, down])
    assert "60 to 60.96 GHz, 16 chirps and 61 to 60.04 GHz, 16 chirps of 128 samples" in repr(both)


def test_tables_have_units_that_people_write_and_escape_names(recording: rc.Recording) -> None:
    for value in (RADAR, recording[0], recording, SIMULATOR):
        table = value._repr_html_()
        assert ">15 MHz/us</td>" in table
        assert ">15.6142 cm</td>" in table
        assert "<ball>" not in table
    assert ">at 1.998 m, -1.000 m/s</td>" in recording[0]._repr_html_()
    unseen = dataclasses.replace(recording[0], truth=rc.Truth(("wall",), [np.nan], [np.nan], [np.nan], [np.nan]))
    assert ">not visible</td>" in unseen._repr_html_()
