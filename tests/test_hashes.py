"""Equal objects have equal hashes: 0.0 and -0.0 are equal, their bytes are not."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable
from importlib import import_module
from inspect import getmembers, isclass
from typing import Any

import numpy as np
import pytest

import radarcore as rc

WAVEFORM = rc.bgt60tr13c().waveform
HALF_TURN = [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]


def table(zero: float) -> rc.TabulatedPattern:
    return rc.TabulatedPattern([-1.0, zero, 1.0], [zero, 0.5], [[zero, 1.0]] * 3)


# By class: an object with a number that is 0.0 or -0.0.
MADE: dict[type, Callable[[float], Any]] = {
    rc.Pose: lambda zero: rc.Pose([1.0, zero, zero], np.where(np.array(HALF_TURN) == 0.0, zero, HALF_TURN)),
    rc.Radar: lambda zero: rc.Radar(WAVEFORM, tx=[[zero, 0.0, 0.0]], rx=[[zero, 0.01, zero]], pattern=table(zero)),
    rc.Schedule: lambda zero: rc.Schedule.steered([1.0 + zero * 1j, zero]),
    rc.TabulatedPattern: table,
    rc.Waveform: lambda zero: WAVEFORM.replace(slope=zero, adc_delay=zero, num_chirps=2, chirp_times=[zero, 1e-3]),
}


def test_every_class_with_a_hash_of_its_own_is_in_the_table() -> None:
    names = [
        found.name
        for found in pkgutil.walk_packages(rc.__path__, "radarcore.")
        if found.ispkg or found.name[-2:] != "__"
    ]
    classes = {kind for name in names for _, kind in getmembers(import_module(name), isclass)}
    # Generated hashes, as of dataclasses, hash the fields and have no file.
    hashes = {kind: getattr(kind.__hash__, "__code__", None) for kind in classes if "__hash__" in vars(kind)}
    own = {kind for kind, code in hashes.items() if code and code.co_filename.startswith(rc.__path__[0])}
    assert own == set(MADE)


@pytest.mark.parametrize("kind", MADE, ids=lambda kind: kind.__name__)
def test_zero_of_either_sign_has_one_hash(kind: type) -> None:
    one, other = MADE[kind](0.0), MADE[kind](-0.0)
    assert one == other
    assert hash(one) == hash(other)
    assert len({one, other}) == 1
