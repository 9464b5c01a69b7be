"""Samples of a dataset: a scene drawn, simulated, and labelled, as rows of its variables."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.dataset.labels import Labels, labels_of
from radarcore.dataset.layout import STATUS, TEXT, Layout, Variable
from radarcore.dataset.variation import Sample, Variation
from radarcore.recording.frame import Frame
from radarcore.simulate.schedule import frame_times
from radarcore.simulate.simulator import Simulator

Rows = dict[str, NDArray[Any]]
"""A row of every variable."""

AXES = {"doppler": "velocity"}
"""Names of axes of labels in a dataset: those of the coordinates that they have."""


@dataclass(frozen=True)
class Recipe:
    """All that the samples of a dataset follow from.

    Parameters
    ----------
    variation : Variation
    seed : int
    labels : Labels
    threads : int
        Threads of a simulator; results do not depend on it.
    """

    variation: Variation
    seed: int
    labels: Labels
    threads: int

    @property
    def body_names(self) -> tuple[str, ...]:
        """Names along the axis `body`: of people, arms and others made of parts one each."""
        return tuple(dict.fromkeys(name.partition("/")[0] for name in self.variation.body_names))

    def sample(self, index: int) -> Sample:
        """The sample as drawn; a ValueError names what is out of range."""
        return self.variation.sample(index, seed=self.seed)


@dataclass(frozen=True)
class Failed:
    """A sample that could not be simulated.

    Parameters
    ----------
    sample : int
        Its index.
    seed : int
        Seed of the dataset, which with the index gives the same sample again.
    error : str
        What was wrong with it.
    """

    sample: int
    seed: int
    error: str


def simulated(recipe: Recipe, sample: Sample) -> Iterator[tuple[Simulator, Frame]]:
    """Simulator and frames of the run of a sample."""
    simulation = sample.simulation()
    run, simulator = simulation.run, simulation.simulator(threads=recipe.threads)
    for time in frame_times(run.start, run.stop, run.rate):
        yield simulator, simulator.frame(time)


def cube_of(frame: Frame) -> NDArray[Any]:
    """Stored samples of a frame: codes where there was an ADC of 12 bits."""
    return frame.cube if frame.raw is None else frame.raw


def made(recipe: Recipe, layout: Layout, index: int) -> tuple[Rows, Failed | None]:
    """Rows of a sample; with fill values for what could not be made, and why."""
    values: dict[str, Any] = {}
    try:
        sample = recipe.sample(index)
        values |= parameters_of(sample, layout)
        results = _results(recipe, sample, layout)
    except Exception as error:
        rows = _rows(layout, {**values, "status": STATUS["failed"]})
        return rows, Failed(index, recipe.seed, f"{type(error).__name__}: {error}")
    return _rows(layout, {**values, **results, "status": STATUS["made"]}), None


def parameters_of(sample: Sample, layout: Layout) -> dict[str, Any]:
    """Values of what varies, by the names of their variables."""
    values = {}
    for name, variable in layout.variables.items():
        if (path := variable.attrs.get("path")) is not None and path in sample.values:
            values[name] = as_stored(sample.values[path], variable)
    return values


def as_stored(value: Any, variable: Variable) -> Any:
    """A drawn value as its variable holds it: true and false as texts."""
    if variable.dtype != TEXT:
        return float(value)
    return value if isinstance(value, str) else json.dumps(value)


def _rows(layout: Layout, values: dict[str, Any]) -> Rows:
    """Rows of all variables, with the fill value where there is none."""
    return {name: variable.row(values.get(name)) for name, variable in layout.variables.items()}


def _results(recipe: Recipe, sample: Sample, layout: Layout) -> dict[str, Any]:
    """Samples, times and labels of the frames of a sample, (frame, ...) each, all of the type and shape planned."""
    names = recipe.body_names
    columns: dict[str, list[Any]] = {}
    for simulator, frame in simulated(recipe, sample):
        labelled = labels_of(simulator, frame, names, recipe.labels)
        row = {"cube": cube_of(frame), "time": frame.time, **{name: each.values for name, each in labelled.items()}}
        for name, value in row.items():
            columns.setdefault(name, []).append(value)
    results = {}
    for name, frames in columns.items():
        variable, values = layout.variables[name], np.stack(frames)
        if values.shape != variable.shape:
            shape = f"{variable.shape} [{', '.join(variable.dims)}]"
            raise ValueError(f"{name}: expected shape {shape} as in all samples, got {values.shape}")
        if values.dtype != variable.dtype:
            raise ValueError(f"{name}: expected {variable.dtype} as in all samples, got {values.dtype}")
        results[name] = values
    return results
