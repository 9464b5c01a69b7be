"""Frames of stored datasets, one by one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.dataset.items import Item, Output, output_of
from radarcore.dataset.layout import STATUS
from radarcore.dataset.samples import Samples
from radarcore.radar.radar import Radar
from radarcore.recording.frame import TRUTH_FIELDS, Frame, Truth, adc_codes, frame_of

Arrays = Mapping[str, NDArray[Any]]
"""Variables of a sample."""


@dataclass(frozen=True, eq=False, repr=False)
class StoredFrames:
    """Frames of a dataset in the form that `stream` has them; `Dataset.frames` makes it.

    Iteration gives pairs of an array and a dictionary of labels, frame by frame and sample by sample: of the same
    scene and seed those that are streamed, but that samples which failed or are missing are left out, and that drawn
    values are as they are stored: numbers as float, true and false as text. `len` and an index work as well, so
    ``torch.utils.data.DataLoader`` takes it as it is.

    Attributes
    ----------
    dataset : Dataset
    num_frames : int
        Frames of every sample.

    See Also
    --------
    dataset.Dataset.frames : Makes it.
    dataset.stream : Frames that are simulated when they are asked for.

    Examples
    --------
    >>> lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.05", "[[point]]", "rcs = { uniform = [0.1, 1.0] }"]
    >>> np.savetxt("scene.toml", [*lines, "position = [2.0, 0.0, 0.0]"], fmt="%s")
    >>> dataset = rc.dataset.make("scene.toml", "out", count=2, seed=1, workers=1)
    >>> stored = dataset.frames(output="range_doppler")
    >>> stored
    <StoredFrames of 2 samples x 2 frames of out>
    >>> image, labels = stored[-1]
    >>> image.shape, labels["sample"], labels["frame"]
    ((3, 64, 65), 1, 1)
    """

    dataset: Samples
    num_frames: int
    _name: str
    _output: str | Output

    def __len__(self) -> int:
        return len(self._numbers) * self.num_frames

    def __getitem__(self, index: int) -> Item:
        number, frame = divmod(check.index("index", index, len(self)), self.num_frames)
        sample = int(self._numbers[number])
        (item,) = self._items(sample, self.dataset[sample], [frame])
        return item

    def __iter__(self) -> Iterator[Item]:
        for shard in range(self.dataset.num_shards):
            for sample, arrays in self.dataset.of_shard(shard):
                yield from self._items(sample, arrays, range(self.num_frames))

    def _items(self, sample: int, arrays: Arrays, numbers: Sequence[int]) -> Iterator[Item]:
        drawn = {path: arrays[name].item() for name, path in self._parameters.items()}
        for number, frame in zip(numbers, frames_of(self.dataset, sample, arrays, numbers), strict=True):
            labels: dict[str, Any] = {"sample": sample, "frame": number, "time": frame.time, **drawn}
            labels |= {name: arrays[name][number] for name in self._labels}
            yield output_of(self._output)(frame), labels

    @cached_property
    def _numbers(self) -> NDArray[np.intp]:
        """Samples that are there."""
        return np.flatnonzero(self.dataset.values("status") == STATUS["made"])

    @cached_property
    def _parameters(self) -> dict[str, str]:
        """Variables of what was drawn, with the paths of the parameters."""
        attributes = {name: self.dataset.attributes(name) for name in self.dataset.names}
        return {name: str(values["path"]) for name, values in attributes.items() if "path" in values}

    @cached_property
    def _labels(self) -> list[str]:
        """Variables of the labels."""
        others = {"cube", "time", "status", *self._parameters}
        return [name for name in self.dataset.names if name not in others]

    def __repr__(self) -> str:
        return f"<StoredFrames of {len(self._numbers)} samples x {self.num_frames} frames of {self._name}>"


def frames_of(samples: Samples, index: int, arrays: Arrays, numbers: Sequence[int]) -> Iterator[Frame]:
    """Frames of a sample by their numbers, with their truth where it is among the labels."""
    radar = _radar_of(samples, index)
    rows = [arrays[f"true_{name}"] for name in TRUTH_FIELDS if f"true_{name}" in arrays]
    has_truth = len(rows) == len(TRUTH_FIELDS)
    names = tuple(map(str, samples.values("body"))) if has_truth else ()
    for number in numbers:
        truth = Truth(names, *(row[number] for row in rows)) if has_truth else None
        cube = arrays["cube"][number]
        yield frame_of(cube, float(arrays["time"][number]), radar, truth, raw=adc_codes(cube, radar))


def _radar_of(samples: Samples, index: int) -> Radar:
    """Radar of a sample: the scene may vary it."""
    drawn = getattr(samples, "sample", None)
    if drawn is None or not samples.attrs.get("radar_varies", True):
        return samples.radar
    radar: Radar = drawn(index).simulation().radar
    return radar
