"""Frames for training, simulated while a network learns, and samples of a dataset as tensors."""

from __future__ import annotations

import multiprocessing
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import count as counted
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.dataset.items import Item, checked_output, output_of
from radarcore.dataset.notices import Told, gathered
from radarcore.dataset.sample import Sample
from radarcore.dataset.variation import Parameter, Variation
from radarcore.recording.frame import Frame
from radarcore.simulate.schedule import frame_times
from radarcore.simulate.simulator import Simulator

if TYPE_CHECKING:
    from radarcore.dataset.labels import Labels
    from radarcore.dataset.opened import Dataset

_Made = tuple[list[Item], list[str]]


class _ImpossibleError(ValueError):
    """A sample that cannot be simulated."""


_AHEAD = 2
"""Samples per worker that are made ahead of those that were taken."""


@dataclass(frozen=True, eq=False, repr=False)
class Stream:
    """Frames of samples of a varied scene, simulated when they are asked for; `stream` makes it.

    Iteration gives pairs of an array and a dictionary of labels, frame by frame and sample by sample. Where there is a
    `count`, `len` and an index work as well: frame ``k`` of sample ``i`` is number ``i * num_frames + k``. So
    ``torch.utils.data.DataLoader`` takes a stream as it is, shuffled and with workers of its own.

    Attributes
    ----------
    variation : Variation
    seed : int
    count : int or None
        Samples; None: without an end.
    num_frames : int
        Frames of every sample.

    See Also
    --------
    dataset.stream : Makes it.
    dataset.TorchDataset : Of a stored dataset.

    Examples
    --------
    >>> lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.05", "[[point]]", "rcs = { uniform = [0.1, 1.0] }"]
    >>> np.savetxt("scene.toml", [*lines, "position = [2.0, 0.0, 0.0]"], fmt="%s")
    >>> frames = rc.dataset.stream("scene.toml", seed=1, count=50)
    >>> frames
    <Stream of 50 samples x 2 frames of scene.toml, seed 1>
    >>> cube, labels = frames[99]  # no frame before it is simulated
    >>> cube.shape, labels["sample"], labels["frame"]
    ((3, 64, 128), 49, 1)
    """

    variation: Variation
    seed: int
    count: int | None
    num_frames: int
    _labels: Labels | None
    _output: str | Callable[[Frame], NDArray[Any]]
    _workers: int

    def __len__(self) -> int:
        if self.count is None:
            raise TypeError("count: expected a number of samples for a stream with a length, got none")
        return self.count * self.num_frames

    def __getitem__(self, index: int) -> Item:
        sample, frame = divmod(check.index("index", index, len(self)), self.num_frames)
        (item,) = self.items_of(sample, frame)
        return item

    def __iter__(self) -> Iterator[Item]:
        """All frames in order, the same whatever the number of workers.

        Impossible samples are left out; warnings of samples come once of each kind.
        """
        numbers = counted() if self.count is None else iter(range(self.count))
        told = Told()
        for items, messages in self._ahead(numbers) if self._workers else map(self._made, numbers):
            told.tell(messages)
            yield from items

    def items_of(self, sample: int, frame: int | None = None) -> list[Item]:
        """Items of a sample, or of one of its frames; a ValueError says what is impossible about the sample."""
        drawn = self.variation.sample(sample, seed=self.seed)
        try:
            found = drawn.simulation()
        except ValueError as error:
            raise _ImpossibleError(str(error)) from error
        run, simulator = found.run, found.simulator(threads=1)
        times = frame_times(run.start, run.stop, run.rate)
        items = []
        for k in range(self.num_frames) if frame is None else [frame]:
            try:
                simulated = simulator.frame(times[k])
            except ValueError as error:
                raise _ImpossibleError(f"sample {sample} of seed {self.seed}, at {times[k]:g} s: {error}") from error
            items.append(self._item(drawn, simulator, simulated, k))
        return items

    def _item(self, sample: Sample, simulator: Simulator, frame: Frame, number: int) -> Item:
        labels: dict[str, Any] = {"sample": sample.index, "frame": number, "time": frame.time}
        labels |= {each.path: sample.values.get(each.path, _missing(each)) for each in self.variation.parameters}
        if self._labels is not None:
            from radarcore.dataset.labels import labels_of

            names = list(dict.fromkeys(name.partition("/")[0] for name in self.variation.body_names))
            labels |= {name: label.values for name, label in labels_of(simulator, frame, names, self._labels).items()}
        return output_of(self._output)(frame), labels

    def _made(self, sample: int) -> _Made:
        """Items of a sample, none if it is impossible, and warnings."""
        items: list[Item] = []
        with gathered() as messages:
            try:
                items = self.items_of(sample)
            except _ImpossibleError as error:
                return [], [f"{error}; such samples are left out"]
        return items, [f"sample {sample} of seed {self.seed}: {message}" for message in messages]

    def _ahead(self, numbers: Iterator[int]) -> Iterator[_Made]:
        """Items of `_made` from processes, in order."""
        context = multiprocessing.get_context("spawn")
        alone = replace(self, _workers=0)
        pool = ProcessPoolExecutor(self._workers, mp_context=context, initializer=_begin, initargs=(alone,))
        try:
            waiting: deque[Future[_Made]] = deque()
            for number in numbers:
                waiting.append(pool.submit(_work, number))
                if len(waiting) > _AHEAD * self._workers:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            pool.shutdown(cancel_futures=True)

    def __repr__(self) -> str:
        number = "samples without end" if self.count is None else f"{self.count} samples"
        return f"<Stream of {number} x {self.num_frames} frames of {self.variation.path.name}, seed {self.seed}>"


def stream(
    scene: str | PathLike[str] | Variation,
    *,
    seed: int = 0,
    labels: Labels | None = None,
    count: int | None = None,
    output: str | Callable[[Frame], NDArray[Any]] = "cube",
    workers: int = 0,
) -> Stream:
    """Frames of a varied scene for training, simulated when they are asked for; nothing is stored.

    Parameters
    ----------
    scene : path or Variation
        Scene file with distributions.
    seed : int
        Of all draws. Another seed gives samples that have not been seen.
    labels : Labels, optional
        Labels besides the number of the sample and of its frame, its time and what was drawn: those, by the paths of
        the parameters, are always there, NaN or "" where a sample lacks them. With labels of bodies, a person or an arm
        has one name.
    count : int, optional
        Samples; default: without an end.
    output : "cube", "range_doppler" or function
        What a frame is to the network: its samples, (channel, chirp, sample), its map, (channel, doppler, range)
        complex64, or what a function makes of a `Frame`.
    workers : int
        Processes that simulate ahead, of one thread each; 0: none but this one. Programs guard their start with
        ``if __name__ == "__main__":`` then.

    Returns
    -------
    Stream
        An iterable of pairs (array, labels); with a `count` also a sequence.

    See Also
    --------
    dataset.Stream : What it returns.
    dataset.Dataset.frames : Those of a stored dataset.
    dataset.Variation : What distributions there are.

    Examples
    --------
    >>> lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.02", "[[point]]", "name = 'ball'"]
    >>> np.savetxt("scene.toml", [*lines, "position = [{ uniform = [1.0, 3.0] }, 0.0, 0.0]"], fmt="%s")
    >>> for image, labels in rc.dataset.stream("scene.toml", seed=1, count=2, output="range_doppler"):
    ...     power = (np.abs(image) ** 2).sum(axis=(0, 1))
    ...     distance = rc.bgt60tr13c().waveform.range_axis()[power.argmax()]
    ...     print(image.shape, abs(distance - labels["point.ball.position[0]"]) < 0.15)
    (3, 64, 65) True
    (3, 64, 65) True
    """
    variation = scene if isinstance(scene, Variation) else Variation.load(scene)
    number = None if count is None else check.count("count", count)
    run = variation.run
    num_frames = len(frame_times(run.start, run.stop, run.rate))
    series, processes = check.count("seed", seed, 0), check.count("workers", workers, 0)
    return Stream(variation, series, number, num_frames, labels, checked_output(output), processes)


def _missing(parameter: Parameter) -> float | str:
    """In place of the value of a parameter that a sample does not have."""
    return float("nan") if parameter.is_number else ""


_OWN: list[Stream] = []
"""The stream of a worker."""


def _begin(own: Stream) -> None:
    _OWN.append(own)


def _work(sample: int) -> _Made:
    return _OWN[0]._made(sample)


class TorchDataset:
    """Samples of a stored dataset as tensors, for ``torch.utils.data.DataLoader`` (needs torch).

    Parameters
    ----------
    dataset : path or Dataset
        As `make` has made it. Samples that could not be simulated are left out.
    inputs : str
        Variable that the network sees.
    transform : function, optional
        From the tensor of the inputs to what the network sees instead.

    See Also
    --------
    dataset.stream : Frames without a dataset.

    Examples
    --------
    >>> try:
    ...     rc.dataset.TorchDataset("out")
    ... except (ImportError, FileNotFoundError) as error:
    ...     print("no torch, or no dataset")
    no torch, or no dataset
    """

    def __init__(
        self,
        dataset: str | PathLike[str] | Dataset,
        *,
        inputs: str = "cube",
        transform: Callable[[Any], Any] | None = None,
    ) -> None:
        try:
            import torch
        except ImportError as error:
            raise ImportError("tensors need torch: pip install torch") from error
        if isinstance(dataset, str | PathLike):
            from radarcore.dataset.opened import open_dataset

            dataset = open_dataset(dataset)
        if inputs not in dataset.names:
            raise KeyError(f"inputs: no variable {inputs!r}; {check.near_names(inputs, dataset.names)}")
        self._dataset, self._inputs, self._transform = dataset, inputs, transform
        self._numbers = np.flatnonzero(dataset.status == 1)
        self._tensor = torch.from_numpy

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, index: int) -> tuple[Any, dict[str, Any]]:
        """The inputs of a sample as a tensor, (frame, ...), and all other variables by name: tensors, or text."""
        sample: Mapping[str, NDArray[Any]] = self._dataset[int(self._numbers[index])]
        values = {name: self._as_tensor(value) for name, value in sample.items()}
        given = values.pop(self._inputs)
        return (given if self._transform is None else self._transform(given)), values

    def _as_tensor(self, value: NDArray[Any]) -> Any:
        array = np.asarray(value)
        return self._tensor(np.ascontiguousarray(array)) if array.dtype.kind in "biufc" else array.tolist()
