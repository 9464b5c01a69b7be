"""Labels of cells: targets in the middle of cells label those, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import radarcore as rc
from radarcore.dataset import Labels, labels_of
from radarcore.dataset.echoes import noise_power

SETTINGS = Labels(truth=False, cells=True)
WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=20e12, sample_rate=4e6, num_samples=64, num_chirps=32, chirp_interval=50e-6
)
NAMES = ("near", "far", "mover")


def targets(waveform: rc.Waveform) -> list[rc.PointTarget]:
    """Two at rest in columns 8 and 16, one in column 24 and row 20; of equal echoes."""
    step, velocity = waveform.range_axis()[1], waveform.velocity_axis()[20]
    # Beat and Doppler frequency add: it is nearer than its column by this.
    ahead = velocity * waveform.center_frequency / waveform.slope
    ranges = [8 * step, 16 * step, 24 * step - ahead]
    velocities = [0.0, 0.0, velocity]
    starts = [r - 0.5 * waveform.duration * v for r, v in zip(ranges, velocities, strict=True)]
    return [
        rc.PointTarget([start, 0.0, 0.0], rcs=1e-4 * (r / step) ** 4, velocity=[v, 0.0, 0.0], name=name)
        for name, start, r, v in zip(NAMES, starts, ranges, velocities, strict=True)
    ]


def radar_with(snr_db: float, output: str = "iq", waveform: rc.Waveform = WAVEFORM) -> rc.Radar:
    """A radar in whose maps the peaks of the targets are so far above the mean noise."""
    radar = rc.Radar(waveform, receiver=rc.Receiver(output=output, noise_figure_db=10.0), tx_power_dbm=0.0)
    amplitude = abs(rc.Simulator(rc.Scene(targets(waveform)[:1]), radar).paths(0.0).amplitude[0, 0])
    # Of the Hann window: sums n/2 and 3n/8 of its values and squares; a real signal has half of its tone.
    n = waveform.num_samples * waveform.num_chirps
    tone = (amplitude * n / 4) ** 2 * (0.25 if output == "real" else 1.0)
    noise = radar.receiver.noise_variance(waveform.sample_rate) * n * (3 / 8) ** 2
    return replace(radar, tx_power_dbm=snr_db - 10.0 * np.log10(tone / noise))


def cells_of(radar: rc.Radar, bodies: list[rc.PointTarget], names: tuple[str, ...] = NAMES) -> np.ndarray:
    simulator = rc.Simulator(rc.Scene(bodies), radar)
    return labels_of(simulator, simulator.frame(0.0), names, SETTINGS)["strongest_body"].values


@pytest.mark.parametrize("output", ["iq", "real"])
def test_targets_label_exactly_the_main_lobes_of_their_cells(output: str) -> None:
    """The Hann window has three cells per axis, the corners 12 dB below the middle."""
    radar = radar_with(20.0, output)
    expected = np.full((32, 64 if output == "iq" else 33), -1)
    for label, (row, column) in enumerate([(16, 8), (16, 16), (20, 24)]):
        expected[row - 1 : row + 2, column - 1 : column + 2] = label
    np.testing.assert_array_equal(cells_of(radar, targets(WAVEFORM)), expected)


def test_corners_below_the_noise_have_no_label() -> None:
    """At 9 dB the middle and its neighbours, 6 dB lower, are above the mean noise; the corners are not."""
    cells = cells_of(radar_with(9.0), targets(WAVEFORM))
    expected = np.array([[-1, 0, -1], [0, 0, 0], [-1, 0, -1]])
    np.testing.assert_array_equal(cells[15:18, 7:10], expected)


def test_a_noiseless_map_has_labels_down_to_60_db() -> None:
    """A weak echo 50 dB below a strong one has cells, one 70 dB below has none."""
    strong = targets(WAVEFORM)[0]
    for below_db, has_cells in ((50.0, True), (70.0, False)):
        far = targets(WAVEFORM)[1]
        weak = rc.PointTarget(far.position, rcs=far.rcs * 10 ** (-0.1 * below_db), name="far")
        labels = cells_of(rc.Radar(WAVEFORM), [strong, weak])
        assert (labels == 1).any() == has_cells


def test_ties_have_no_label() -> None:
    mirrored = [rc.PointTarget([3.0, y, 0.0], name=name) for name, y in (("near", 0.4), ("far", -0.4))]
    assert (cells_of(rc.Radar(WAVEFORM), mirrored) == -1).all()
    louder = rc.PointTarget([3.0, -0.4, 0.0], rcs=1.05, name="far")
    assert set(np.unique(cells_of(rc.Radar(WAVEFORM), [mirrored[0], louder]))) == {-1, 1}


def test_parts_count_as_their_person_or_as_those_that_have_names() -> None:
    parts = [rc.PointTarget(t.position, t.rcs, t.velocity, name=f"eve/{t.name}") for t in targets(WAVEFORM)]
    radar = radar_with(20.0)
    whole = cells_of(radar, parts, ("eve",))
    some = cells_of(radar, parts, ("eve/mover", "eve"))
    assert set(np.unique(whole)) == {-1, 0}
    assert some[20, 24] == 0
    assert some[16, 8] == some[16, 16] == 1


def test_transmitters_in_turn_have_the_cells_of_one() -> None:
    """A mover is seen later by the second transmitter: the same cells, as its channels have them."""
    radar = replace(
        radar_with(26.0), tx=np.array([[0.0, 0.0, 0.0], [0.0, 2e-3, 0.0]]), tx_patterns=None, schedule=rc.Schedule.tdm()
    )
    labels = cells_of(radar, targets(WAVEFORM))
    for label, (row, column) in enumerate([(16, 8), (16, 16), (20, 24)]):
        assert labels[row, column] == label


def test_labels_agree_with_the_maps_of_each_body_alone() -> None:
    """Frames of a person and of a box by themselves, without noise, say whose echo is stronger in every cell."""
    radar, pose, time = rc.bgt60tr13c(), rc.Pose([0.0, 0.0, 1.0]), 0.4
    person = rc.models.Human(path=[[3.0, 0.0], [1.0, 0.0]], speed=0.8).bodies(name="person", subdivisions=3)
    motion = rc.Linear(rc.Pose([2.2, 0.9, 1.0]), velocity=[0.5, 0.0, 0.0])
    box = rc.Body(rc.shapes.box([0.2, 0.2, 0.2]), motion=motion, name="box")

    def map_of(*bodies: rc.Body) -> np.ndarray:
        noiseless = replace(radar, receiver=rc.Receiver(output="real"))
        frame = rc.Simulator(rc.Scene(bodies), noiseless, radar_motion=pose, max_bounces=1).frame(time)
        return (np.abs(rc.range_doppler(frame)) ** 2).sum(axis=0)

    simulator = rc.Simulator(rc.Scene([*person, box]), radar, radar_motion=pose, max_bounces=1)
    labels = labels_of(simulator, simulator.frame(time), ("person", "box"), SETTINGS)["strongest_body"].values
    powers = np.array([map_of(*person), map_of(box)])
    level = noise_power(radar)
    agrees = labels == powers.argmax(axis=0)
    strong = powers.max(axis=0) > 100.0 * level
    assert strong.sum() > 20
    assert {*labels[strong]} == {0, 1}
    assert agrees[strong].all()
    assert agrees[powers.max(axis=0) > 10.0 * level].mean() > 0.9
    assert (labels[powers.max(axis=0) < 0.1 * level] == -1).all()
