"""Datasets as other libraries read them: xarray and Zarr, without radarcore."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from varied_scenes import write_scene

pytest.importorskip("zarr", reason="needs zarr: pip install radarcore[zarr]")

WALL = "[[body]]\nname = 'wall'\nshape = { kind = 'plate', width = 0.4, height = 0.4 }\npose.position = [2.6, 0.0, 0.0]"
MATERIAL = "material = { choice = ['metal', 'wood'] }"


@pytest.fixture(scope="module")
def xarray() -> Any:
    """The library, which takes a second to import in every process that collects tests."""
    return pytest.importorskip("xarray", reason="needs xarray: pip install radarcore[zarr]")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> rc.dataset.Dataset:
    folder = tmp_path_factory.mktemp("stored")
    scene = write_scene(folder, WALL, MATERIAL)
    return rc.dataset.make(scene, folder / "out", count=5, seed=1, samples_per_shard=2, workers=1)


def test_xarray_has_names_units_and_coordinates(dataset: rc.dataset.Dataset, xarray: Any) -> None:
    with xarray.open_zarr(dataset.path) as opened:
        axes = ("sample", "frame", "channel", "chirp", "fast_time", "body", "range", "velocity")
        assert dict(opened.sizes) == dict(zip(axes, (5, 2, 3, 8, 32, 2, 17, 8), strict=True))
        assert opened.cube.dims == ("sample", "frame", "channel", "chirp", "fast_time")
        assert opened.cube.dtype == np.float32
        units = {"cube": "sqrt(W)", "time": "s", "range": "m", "velocity": "m/s", "true_azimuth": "rad"}
        assert {name: opened[name].attrs["units"] for name in units} == units
        wf = dataset.radar.waveform
        np.testing.assert_array_equal(opened.range, wf.range_axis()[:17])
        np.testing.assert_array_equal(opened.velocity, wf.velocity_axis())
        np.testing.assert_array_equal(opened.slow_time, wf.chirp_times)
        assert opened.body.values.tolist() == ["wall", "ball"]
        assert {"time", "slow_time"} <= set(opened.coords)
        assert opened.status.values.tolist() == [1] * 5
        assert opened.attrs["seed"] == 1
        assert "uniform" in opened.attrs["scene"]
        assert json.loads(opened.attrs["radar"]) == dataset.radar.to_dict()


def test_drawn_values_are_variables_and_the_truth_follows_from_them(dataset: rc.dataset.Dataset, xarray: Any) -> None:
    with xarray.open_zarr(dataset.path) as opened:
        position = opened["parameter.point.ball.position[0]"]
        velocity = opened["parameter.point.ball.velocity[0]"]
        assert (position.attrs["units"], velocity.attrs["units"]) == ("m", "m/s")
        assert position.attrs["distribution"] == "uniform"
        assert (position >= 1.0).all()
        assert len(set(position.values.tolist())) == 5
        middle = opened.time + 0.5 * dataset.radar.waveform.duration
        expected = position + velocity * middle
        np.testing.assert_allclose(opened.true_range.sel(body="ball").transpose("sample", "frame"), expected, rtol=1e-4)
        materials = opened["parameter.body.wall.material"].values.tolist()
        assert materials == [dataset.sample(index).values["body.wall.material"] for index in range(5)]


def test_map_by_xarray_and_numpy_alone_is_ours(dataset: rc.dataset.Dataset, xarray: Any) -> None:
    def window(n: int) -> Any:
        return 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(n) / n)

    with xarray.open_zarr(dataset.path, chunks=None) as opened:
        cube = opened.cube.isel(sample=3, frame=1).values
        profile = np.fft.rfft(cube * window(cube.shape[-1]))
        spectrum = np.fft.fftshift(np.fft.fft(profile * window(cube.shape[-2])[:, None], axis=-2), axes=-2)
        power = xarray.DataArray(
            (np.abs(spectrum) ** 2).sum(axis=0), {"velocity": opened.velocity, "range": opened.range}
        )
        near = power.sel(range=slice(0.5, 2.5))
        truth = float(opened.true_range.isel(sample=3, frame=1).sel(body="ball"))
    assert abs(float(near.range[near.argmax(...)["range"]]) - truth) < dataset.radar.waveform.range_resolution
    ours = (np.abs(rc.range_doppler(dataset.cube(3)[1], dataset.radar)) ** 2).sum(axis=0)
    np.testing.assert_allclose(power.values, ours, rtol=0, atol=1e-6 * ours.max())


def test_codes_of_an_adc_are_stored_and_decoded(tmp_path: Path, xarray: Any) -> None:
    scene = write_scene(tmp_path)
    adc = (
        "radar.receiver = { output = 'real', noise_figure_db = 12.0, gain_db = 60.0, full_scale = 1.2, adc_bits = 12 }"
    )
    scene.write_text(f"{adc}\n{scene.read_text()}")
    dataset = rc.dataset.make(scene, tmp_path / "out", count=3, seed=1, samples_per_shard=2, workers=1)
    frame = dataset.sample(2).simulation().simulator().frame(0.025)
    assert frame.raw is not None
    np.testing.assert_array_equal(dataset.stored(2)[1], frame.raw)
    np.testing.assert_array_equal(dataset.cube(2)[1], frame.cube)
    with xarray.open_zarr(dataset.path) as opened:
        np.testing.assert_allclose(opened.cube.values[2, 1], frame.cube, rtol=0, atol=2e-7)
        assert opened.cube.attrs["units"] == "full scale"
    size = sum(file.stat().st_size for file in (dataset.path / "cube" / "c").rglob("*") if file.is_file())
    assert size < 0.45 * 3 * dataset.cube(0).nbytes  # of the float32


def test_a_shard_is_one_file_with_a_chunk_per_sample(dataset: rc.dataset.Dataset, xarray: Any) -> None:
    files = [file.relative_to(dataset.path) for file in (dataset.path / "cube" / "c").rglob("*") if file.is_file()]
    assert sorted(file.parts[2] for file in files) == ["0", "1", "2"]
    with xarray.open_zarr(dataset.path) as opened:
        assert opened.cube.encoding["shards"] == (2, 2, 3, 8, 32)
        assert opened.cube.encoding["chunks"] == (1, 2, 3, 8, 32)


def test_index_iteration_and_names_agree(dataset: rc.dataset.Dataset) -> None:
    samples = list(dataset)
    assert len(samples) == len(dataset) == 5
    for index, sample in enumerate(samples):
        assert sample.keys() == dataset[index].keys() == set(dataset.names)
        for name, values in sample.items():
            np.testing.assert_array_equal(values, dataset[index][name])
    with pytest.raises(ValueError, match="expected an index below 5, got 5"):
        dataset[5]


def test_all_labels_have_axes_and_names_along_them(tmp_path: Path, xarray: Any) -> None:
    person = "[[human]]\nname = 'person'\npath = [[{ uniform = [1.5, 2.0] }, 0.0], [1.0, 0.0]]"
    labels = rc.dataset.Labels(boxes=True, visibility=True, joints=True, cells=True)
    scene = write_scene(tmp_path, person)
    dataset = rc.dataset.make(scene, tmp_path / "out", count=2, seed=1, workers=1, labels=labels)
    frame = dataset.sample(1).simulation().simulator().frame(0.025)
    simulator = dataset.sample(1).simulation().simulator()
    expected = rc.dataset.labels_of(simulator, frame, dataset.body_names, labels)
    with xarray.open_zarr(dataset.path) as opened:
        for name, label in expected.items():
            stored = opened[name].isel(sample=1, frame=1)
            assert stored.dims == tuple("velocity" if axis == "doppler" else axis for axis in label.dims)
            assert stored.dtype == label.values.dtype
            np.testing.assert_array_equal(stored, label.values)
        head = opened.joint_position.isel(sample=0, frame=0).sel(body="person", joint="head", xyz="x")
        assert 1.0 < float(head) < 2.2
        assert opened.strongest_body.max() == dataset.body_names.index("person")
