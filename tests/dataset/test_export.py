"""Datasets as HDF5, WebDataset and MCAP hold the same numbers, names and units as the dataset."""

from __future__ import annotations

import gc
import io
import json
import sys
import tarfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import radarcore as rc

pytest.importorskip("zarr", reason="needs zarr: pip install radarcore[zarr]")

LABELS = rc.dataset.Labels(boxes=True, visibility=True, joints=True, cells=True)
SCENE = """
radar.preset = "bgt60tr13c"
radar.num_chirps = 8
radar.num_samples = 32
run.stop = 0.05
[[body]]
name = "box"
shape = { kind = "box", size = [0.2, 0.2, 0.2] }
material = { choice = ["metal", "wood"] }
pose = { position = [{ uniform = [1.5, 2.5] }, 0.0, 0.0] }
[[point]]
name = "ball"
position = [2.0, 0.5, 0.0]
rcs = { normal = [0.5, 1.0] }
"""
COUNT = 6


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> rc.dataset.Dataset:
    """Frames of a box and a ball; of samples whose cross-section is drawn below zero there are none."""
    folder = tmp_path_factory.mktemp("exported")
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    made = rc.dataset.make(folder / "scene.toml", folder / "out", count=COUNT, seed=5, workers=1, labels=LABELS)
    assert 0 < len(made.failed) < COUNT
    return made


def made_samples(dataset: rc.dataset.Dataset) -> list[int]:
    failed = {failed.sample for failed in dataset.failed}
    return [index for index in range(len(dataset)) if index not in failed]


def test_hdf5_has_every_variable_to_the_bit(dataset: rc.dataset.Dataset, tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py", reason="needs h5py: pip install radarcore[hdf5]")
    rc.dataset.to_hdf5(dataset.path, tmp_path / "set.h5")
    with h5py.File(tmp_path / "set.h5") as file:
        assert {*dataset.names, *dataset.coordinates} == set(file)
        for index in range(len(dataset)):
            for name, values in dataset[index].items():
                found = file[name][index]
                if values.dtype.kind in "OUT":
                    assert found.decode() == str(values[()])
                else:
                    assert found.dtype == values.dtype
                    np.testing.assert_array_equal(found, values)


def test_hdf5_has_axes_scales_and_units(dataset: rc.dataset.Dataset, tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py", reason="needs h5py: pip install radarcore[hdf5]")
    rc.dataset.to_hdf5(dataset, tmp_path / "set.h5")
    with h5py.File(tmp_path / "set.h5") as file:
        cube, cells = file["cube"], file["strongest_body"]
        assert [axis.label for axis in cube.dims] == ["sample", "frame", "channel", "chirp", "fast_time"]
        assert "scale_factor" not in cube.attrs  # the numbers are samples, no codes
        assert file["true_velocity"].attrs["units"] == "m/s"
        np.testing.assert_array_equal(cells.dims[3][0][:], dataset.values("range"))
        assert [name.decode() for name in file["true_range"].dims[2][0][:]] == ["box", "ball"]
        assert rc.Radar.from_dict(json.loads(file.attrs["radar"])) == dataset.radar


def test_hdf5_file_is_there_whole_or_not_at_all(dataset: rc.dataset.Dataset, tmp_path: Path) -> None:
    pytest.importorskip("h5py", reason="needs h5py: pip install radarcore[hdf5]")
    file = tmp_path / "set.h5"
    file.write_bytes(b"\x89HDF\r\n mine")
    with pytest.raises(FileExistsError, match="expected no such path, got a file; overwrite=True replaces it"):
        rc.dataset.to_hdf5(dataset, file)

    class Torn(rc.dataset.Dataset):
        """A dataset that ends after a shard."""

        def of_shard(self, shard: int) -> Iterator[tuple[int, dict[str, np.ndarray]]]:
            yield from super().of_shard(shard)
            raise OSError("torn")

    with pytest.raises(OSError, match="torn"):
        rc.dataset.to_hdf5(Torn(dataset.path), file, overwrite=True)
    assert file.read_bytes().endswith(b"mine")
    assert [path.name for path in tmp_path.iterdir()] == ["set.h5"]


def test_export_replaces_only_what_it_made(dataset: rc.dataset.Dataset, tmp_path: Path) -> None:
    out = tmp_path / "tars"
    rc.dataset.to_webdataset(dataset, out, samples_per_tar=1)
    with pytest.raises(FileExistsError, match="got an export; overwrite=True replaces it"):
        rc.dataset.to_webdataset(dataset, out)
    (out / "notes.txt").write_text("mine")
    rc.dataset.to_webdataset(dataset, out, overwrite=True)
    assert sorted(path.name for path in out.iterdir()) == ["000000.tar", "dataset.json", "notes.txt"]
    (out / "000001.tar").write_text("mine")
    with pytest.raises(FileExistsError, match="a file of others"):
        rc.dataset.to_webdataset(dataset, out, samples_per_tar=1, overwrite=True)
    assert sorted(path.name for path in out.iterdir()) == ["000000.tar", "000001.tar", "dataset.json", "notes.txt"]

    project = tmp_path / "project"
    project.mkdir()
    (project / "dataset.json").write_text('{"format": "mine"}')
    (tmp_path / "tars.part").write_text("mine")
    for place, message in ((project, "a folder that is no such export"), (tmp_path / "tars", "got a file; keep it")):
        with pytest.raises(FileExistsError, match=message):
            rc.dataset.to_webdataset(dataset, place, samples_per_tar=2, overwrite=True)
    assert (project / "dataset.json").read_text() == '{"format": "mine"}'
    assert (tmp_path / "tars.part").read_text() == "mine"


@pytest.mark.parametrize(
    ("place", "where"), [(".", "the source itself"), ("..", "around"), ("set.mcap", "within"), ("cube/c", "within")]
)
def test_export_into_its_own_dataset_is_refused(dataset: rc.dataset.Dataset, place: str, where: str) -> None:
    before = sorted(path for path in dataset.path.rglob("*"))
    out = dataset.path / place
    exports = {
        "webdataset": lambda: rc.dataset.to_webdataset(dataset.path, out, overwrite=True),
        "hdf5": lambda: rc.dataset.to_hdf5(dataset.path, out, overwrite=True),
        "mcap": lambda: rc.dataset.to_mcap(dataset.path, out, sample=made_samples(dataset)[0], overwrite=True),
    }
    if place != "set.mcap":
        del exports["mcap"]  # a file, not a folder
    for export in exports.values():
        with pytest.raises(ValueError, match=f"out: expected a place outside the source, got .*, {where}"):
            export()
    assert sorted(path for path in dataset.path.rglob("*")) == before


def test_tar_files_have_the_samples_that_were_made(dataset: rc.dataset.Dataset, tmp_path: Path) -> None:
    paths = rc.dataset.to_webdataset(dataset, tmp_path / "tars", samples_per_tar=2)
    indices = made_samples(dataset)
    assert [path.name for path in paths] == [f"{k:06d}.tar" for k in range(-(-len(indices) // 2))]
    found: dict[int, dict[str, np.ndarray]] = {}
    for path in paths:
        with tarfile.open(path) as tar:
            for member in tar:
                key, _, ending = member.name.partition(".")
                content = tar.extractfile(member).read()
                sample = found.setdefault(int(key), {})
                if ending == "json":
                    sample |= {name: np.asarray(value) for name, value in json.loads(content).items()}
                else:
                    sample[ending.removesuffix(".npy")] = np.load(io.BytesIO(content))
    assert list(found) == indices
    for index, sample in found.items():
        expected = dataset[index]
        assert sample.keys() == expected.keys()
        for name, values in expected.items():
            np.testing.assert_array_equal(sample[name], values)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # of files that webdataset leaves open
@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")
def test_webdataset_reads_the_tar_files(dataset: rc.dataset.Dataset, tmp_path: Path) -> None:
    webdataset = pytest.importorskip("webdataset", reason="needs webdataset: pip install webdataset")
    paths = rc.dataset.to_webdataset(dataset, tmp_path / "tars", samples_per_tar=2)
    stream = webdataset.WebDataset([str(path) for path in paths], shardshuffle=False).decode()
    samples = list(stream)
    assert [int(sample["__key__"]) for sample in samples] == made_samples(dataset)
    for sample in samples:
        expected = dataset[int(sample["__key__"])]
        np.testing.assert_array_equal(sample["cube.npy"], expected["cube"])
        np.testing.assert_array_equal(sample["true_range.npy"], expected["true_range"])
        assert sample["json"]["parameter.body.box.material"] in ("metal", "wood")
    del stream
    gc.collect()


def test_folder_of_tar_files_says_what_is_in_them(dataset: rc.dataset.Dataset, tmp_path: Path) -> None:
    rc.dataset.to_webdataset(dataset, tmp_path / "tars")
    told = json.loads((tmp_path / "tars" / "dataset.json").read_text())
    assert told["variables"]["cube"]["dims"] == ["frame", "channel", "chirp", "fast_time"]
    assert told["variables"]["true_range"]["attrs"]["units"] == "m"
    assert told["coordinates"]["body"]["values"] == ["box", "ball"]
    assert rc.Radar.from_dict(json.loads(told["attrs"]["radar"])) == dataset.radar


def test_same_dataset_gives_the_same_tar_files(dataset: rc.dataset.Dataset, tmp_path: Path) -> None:
    first, second = (rc.dataset.to_webdataset(dataset, tmp_path / name) for name in ("a", "b"))
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


def test_mcap_has_the_frames_of_a_sample_to_the_bit(dataset: rc.dataset.Dataset, tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="needs rosbags: pip install radarcore[ros]")
    index = made_samples(dataset)[-1]
    rc.dataset.to_mcap(dataset, tmp_path / "one.mcap", sample=index)
    simulator = dataset.sample(index).simulation().simulator()
    with rc.adapters.ros.BagReader(tmp_path / "one.mcap") as bag:
        frames = list(rc.adapters.ros.BagFrames(bag))
    assert [frame.time for frame in frames] == [0.0, 0.025]
    for frame in frames:
        expected = simulator.frame(frame.time)
        np.testing.assert_array_equal(frame.cube, expected.cube)
        assert frame.radar == expected.radar
        assert frame.truth.names == expected.truth.names == ("box", "ball")
        np.testing.assert_array_equal(frame.truth.range, expected.truth.range)
        np.testing.assert_array_equal(frame.truth.azimuth, expected.truth.azimuth)


def test_mcap_of_what_is_not_there_is_refused(dataset: rc.dataset.Dataset, tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="needs rosbags: pip install radarcore[ros]")
    failed = dataset.failed[0].sample
    with pytest.raises(ValueError, match=f"sample: expected one that was made, got {failed}"):
        rc.dataset.to_mcap(dataset, tmp_path / "one.mcap", sample=failed)
    with pytest.raises(ValueError, match=f"sample: expected an index below {COUNT}, got {COUNT}"):
        rc.dataset.to_mcap(dataset, tmp_path / "one.mcap", sample=COUNT)
    with pytest.raises(ValueError, match=r"out: expected a file \.mcap, got"):
        rc.dataset.to_mcap(dataset, tmp_path / "one.bag", sample=made_samples(dataset)[0])


def test_without_h5py_the_extra_is_named(
    dataset: rc.dataset.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(ImportError, match=r"HDF5 files need h5py: pip install radarcore\[hdf5\]"):
        rc.dataset.to_hdf5(dataset, tmp_path / "set.h5")


def test_what_is_no_dataset_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="dataset: expected Dataset or its path, got int"):
        rc.dataset.to_webdataset(5, tmp_path / "tars")  # type: ignore[arg-type]  # on purpose
    with pytest.raises(FileNotFoundError):
        rc.dataset.to_webdataset(tmp_path / "none", tmp_path / "tars")
