"""Frames for training: a sequence of arrays with their labels, stored in a dataset or simulated on access."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count as counted
from operator import attrgetter
from os import PathLike
from typing import Any

from numpy.typing import NDArray

from radarcore import check, notice
from radarcore.dataset.labels import Labels, labels_of
from radarcore.dataset.variation import Parameter, Variation
from radarcore.processing.spectra.spectra import range_doppler
from radarcore.recording.frame import Frame

Item = tuple[NDArray[Any], dict[str, Any]]
"""Input of a network, and its labels."""

Output = Callable[[Frame], NDArray[Any]]
"""Function that makes the input of a network of a frame."""

Source = Callable[[int, Sequence[int]], Iterator[tuple[Frame, dict[str, Any]]]]
"""Frames of a sample that have some numbers, with their labels."""

_OUTPUTS: dict[str, Output] = {"cube": attrgetter("cube"), "range_doppler": range_doppler}


class _ImpossibleError(ValueError):
    """A sample that cannot be simulated."""


@dataclass(frozen=True, eq=False, repr=False)
class Frames:
    """Frames of samples with their labels: a sequence for training.

    `Dataset.frames` reads them from a dataset, `stream` simulates them on access. An item is a pair of an
    array and a dictionary of labels: sample, frame, time, the drawn values by the paths of the parameters, and the
    labels of the bodies. ``torch.utils.data.DataLoader`` takes it as it is, shuffled and with workers.

    Iteration goes sample by sample, and leaves out samples that cannot be simulated, with one warning of each kind; an
    index of one is an error.

    Attributes
    ----------
    source : object
        Where the frames come from.
    samples : sequence of int
        Indices of the samples; without an end if a stream has no `count`.
    num_frames : int
        Frames of every sample.

    See Also
    --------
    dataset.stream : Frames that are simulated.
    dataset.Dataset.frames : Frames of a stored dataset.

    Examples
    --------
    >>> lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.05", "[[point]]", "rcs = { uniform = [0.1, 1.0] }"]
    >>> np.savetxt("scene.toml", [*lines, "position = [2.0, 0.0, 0.0]"], fmt="%s")
    >>> frames = rc.dataset.stream("scene.toml", seed=1, count=50)
    >>> frames
    <Frames of 50 samples x 2 frames of scene.toml>
    >>> cube, labels = frames[99]  # no frame before it is simulated
    >>> cube.shape, labels["sample"], labels["frame"]
    ((3, 64, 128), 49, 1)
    """

    source: Source
    samples: Sequence[int] | Iterable[int]
    num_frames: int
    _output: Output
    _name: str

    def __len__(self) -> int:
        if not isinstance(self.samples, Sequence):
            raise TypeError("count: expected a number of samples for a stream with a length, got none")
        return len(self.samples) * self.num_frames

    def __getitem__(self, index: int) -> Item:
        number, frame = divmod(check.index("index", index, len(self)), self.num_frames)
        assert isinstance(self.samples, Sequence)  # or it would have no length
        return next(self._items(self.samples[number], [frame]))

    def __iter__(self) -> Iterator[Item]:
        new = notice.NewKinds()
        for sample in self.samples:
            items: list[Item] = []
            impossible: list[str] = []
            with notice.gathered() as messages:
                try:
                    items = list(self._items(sample, range(self.num_frames)))
                except _ImpossibleError as error:
                    impossible = [f"{error}; such samples are left out"]
            new.warn(impossible or [f"sample {sample}: {message}" for message in messages])
            yield from items

    def _items(self, sample: int, numbers: Sequence[int]) -> Iterator[Item]:
        return ((self._output(frame), labels) for frame, labels in self.source(sample, numbers))

    def __repr__(self) -> str:
        number = f"{len(self.samples)} samples" if isinstance(self.samples, Sequence) else "samples without end"
        return f"<Frames of {number} x {self.num_frames} frames of {self._name}>"


def _simulated(
    variation: Variation, seed: int, settings: Labels | None, sample: int, numbers: Sequence[int]
) -> Iterator[tuple[Frame, dict[str, Any]]]:
    """Frames of a sample, simulated anew each time; an error says what is impossible about the sample."""
    drawn = variation.sample(sample, seed=seed)
    values = {each.path: drawn.values.get(each.path, _missing(each)) for each in variation.parameters}
    try:
        found = drawn.simulation()
    except ValueError as error:
        raise _ImpossibleError(str(error)) from error
    simulator = found.simulator(threads=1)
    times = found.run.times
    for number in numbers:
        try:
            frame = simulator.frame(times[number])
        except ValueError as error:
            raise _ImpossibleError(f"sample {sample} of seed {seed}, at {times[number]:g} s: {error}") from error
        labels: dict[str, Any] = {"sample": sample, "frame": number, "time": frame.time, **values}
        if settings is not None:
            found_labels = labels_of(simulator, frame, variation.label_names, settings)
            labels |= {name: label.values for name, label in found_labels.items()}
        yield frame, labels


def stream(
    scene: str | PathLike[str] | Variation,
    *,
    seed: int = 0,
    labels: Labels | None = None,
    count: int | None = None,
    output: str | Output = "cube",
) -> Frames:
    """Frames of a varied scene for training, simulated on access; nothing is stored.

    Parameters
    ----------
    scene : path or Variation
        Scene file with distributions.
    seed : int
        Seed of all draws. Another seed gives samples that have not been seen.
    labels : Labels, optional
        Labels of the bodies; a person or an arm has one name. The number of the sample and of its frame, its time and
        what was drawn are always there; drawn values that a sample does not have are NaN or "".
    count : int, optional
        Samples; default: without an end.
    output : "cube", "range_doppler" or function
        Array of a frame: its samples, (channel, chirp, sample), its map, (channel, doppler, range) complex64, or the
        result of a function of a `Frame`.

    Returns
    -------
    Frames
        An iterable of pairs (array, labels); with a `count` also a sequence, for loaders with workers of their own.

    See Also
    --------
    dataset.Frames : The result.
    dataset.Dataset.frames : Frames of a stored dataset.
    dataset.Variation : The distributions.

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
    samples = counted() if count is None else range(check.count("count", count))
    source = partial(_simulated, variation, check.count("seed", seed, 0), labels)
    return Frames(source, samples, len(variation.run.times), output_of(output), variation.path.name)


def output_of(output: str | Output) -> Output:
    """Function that makes the input of a network, by its name or as it is given."""
    return output if callable(output) else _OUTPUTS[check.choice("output", output, tuple(_OUTPUTS))]


def _missing(parameter: Parameter) -> float | str:
    """Value of a parameter that a sample does not have."""
    return float("nan") if parameter.is_number else ""
