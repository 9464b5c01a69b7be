"""Cubes of EdgeFirst: values, axes and scales come back from bags, and read as their own nodes write them."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="needs the extra `ros`: pip install radarcore[ros]")

import radarcore as rc
from radarcore.adapters import ros
from ros_bags import FORMATS

START_NS = 1_700_000_000_000_000_001


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("is_complex", [True, False])
def test_cubes_come_back_from_bags_by_value(tmp_path: Path, kind: str, is_complex: bool) -> None:
    rng = np.random.default_rng(3)
    values: Any = rng.integers(-32768, 32768, (2, 3, 4, 5))
    if is_complex:
        values = values + 1j * rng.integers(-32768, 32768, values.shape)
    axes, scales = ("sequence", "range", "channel", "doppler"), (1.0, 0.25, 1.0, 0.125)
    with ros.BagWriter(tmp_path / "bag", kind) as bag:
        for k in range(2):
            message = ros.to_cube_message(
                values[: 2 - k], axes, scales, time_ns=START_NS + k, timestamp=2**63 + k, types=bag.types
            )
            bag.write("/radar/cube", message, START_NS + k)
    with ros.BagReader(tmp_path / "bag") as read:
        assert read.topics["/radar/cube"].type == "edgefirst_msgs/msg/RadarCube"
        cubes = [ros.from_cube_message(found.message) for found in read.messages("/radar/cube")]
    for k, cube in enumerate(cubes):
        np.testing.assert_array_equal(cube.values, values[: 2 - k])
        assert cube.values.dtype == (np.complex64 if is_complex else np.int16)
        assert (cube.axes, cube.scales, cube.time_ns, cube.timestamp) == (axes, scales, START_NS + k, 2**63 + k)
    assert len(cubes) == 2


def test_another_reader_sees_the_cube_as_the_definition_has_it(tmp_path: Path) -> None:
    """The definition comes with the file; the last length counts both parts."""
    reader = pytest.importorskip("mcap.reader", reason="needs mcap: pip install radarcore[ros]")
    decoder = pytest.importorskip("mcap_ros2.decoder", reason="needs mcap-ros2-support")
    path = tmp_path / "take.mcap"
    with ros.BagWriter(path) as bag:
        message = ros.to_cube_message(
            [[1 + 2j, 3 - 4j, 0.4 + 5.6j]], ["channel", "range"], [1, 0.5], time_ns=7, types=bag.types
        )
        bag.write("/radar/cube", message, 7)
    with path.open("rb") as file:
        messages = reader.make_reader(file, decoder_factories=[decoder.DecoderFactory()]).iter_decoded_messages()
        [decoded] = [message for _, _, _, message in messages]
    assert (list(decoded.layout), list(decoded.shape), list(decoded.scales)) == ([5, 1], [1, 6], [1.0, 0.5])
    assert (list(decoded.cube), decoded.is_complex) == ([1, 2, 3, -4, 0, 6], True)


def test_a_target_is_in_the_cube_of_a_frame_where_its_scales_say() -> None:
    radar = rc.bgt60tr13c(num_chirps=32)
    scene = rc.Scene([rc.PointTarget([2.0, 0.0, 0.0], velocity=[1.0, 0.0, 0.0])])
    maps = rc.range_doppler(rc.Simulator(scene, radar).frame())
    maps = maps * (32767 / np.abs(maps).max())
    waveform = radar.waveform
    scales = (1.0, waveform.velocity_resolution, waveform.range_resolution)
    message = ros.to_cube_message(maps, ["channel", "doppler", "range"], scales, time_ns=0)
    cube = ros.from_cube_message(message)
    assert np.abs(cube.values - maps).max() < 0.71  # two roundings
    _, doppler, at = np.unravel_index(np.abs(cube.values).argmax(), cube.values.shape)
    assert (doppler - 16) * cube.scales[1] == pytest.approx(1.0, abs=cube.scales[1])
    assert at * cube.scales[2] == pytest.approx(2.0, abs=2 * cube.scales[2])


def test_cubes_that_do_not_fit_are_refused() -> None:
    for values, axes, scales, message in (
        ([[40000.0]], ["channel", "range"], [1, 1], "values: expected parts within -32768 to 32767"),
        ([[np.nan]], ["channel", "range"], [1, 1], "values: expected parts within"),
        ([[1]], ["channel"], [1, 1], r"axes: expected a name and a scale per axis of \(1, 1\) values"),
        ([1], ["chirp"], [1], "axes: expected "),
        (np.zeros(40000, complex), ["range"], [1], "values: expected lengths within 16 bits, got .80000"),
    ):
        with pytest.raises(ValueError, match=message):
            ros.to_cube_message(values, axes, scales, time_ns=0)
    good = vars(ros.to_cube_message([[1 + 2j]], ["channel", "range"], [1, 1], time_ns=0))
    for changes, message in (
        ({"cube": np.zeros(3, np.int16)}, r"cube: expected 2 numbers for \(1, 2\), got 3"),
        ({"layout": b"\x05"}, "layout: expected a label and a scale per axis, got 1 labels and 2 scales of 2 axes"),
        ({"layout": b"\x05\x07"}, "layout: expected labels of 0 to 6, got 7"),
        ({"shape": np.array([2, 1]), "is_complex": True}, "shape: expected an even last length"),
    ):
        with pytest.raises(ValueError, match=message):
            ros.from_cube_message(SimpleNamespace(**good | changes))
