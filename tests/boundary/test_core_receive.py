"""White noise of the compiled core: its arguments, its errors, and the order of samples."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from core_calls import refuses
from radarcore import _core


def noise(
    shape: Any = (2, 3, 16), seeds: Any = (1,), deviation: float = 2.0, start: float = 0.5, dtype: Any = np.float32
) -> NDArray[Any]:
    samples = np.zeros(shape, dtype)
    _core.add_noise(samples, seeds, deviation, start)
    return samples


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_noise_is_added_in_the_memory_of_the_samples(dtype: Any) -> None:
    samples = np.arange(96.0).reshape(2, 3, 16).astype(dtype)
    before = samples.copy()
    _core.add_noise(samples, [1], 0.0, 0.5)
    np.testing.assert_array_equal(samples, before)
    _core.add_noise(samples, [1], 2.0, 0.5)
    np.testing.assert_array_equal(samples, before + noise(dtype=dtype))


def test_noise_is_that_of_a_seed_and_a_start_and_is_added_in_order() -> None:
    expected = noise()
    np.testing.assert_array_equal(noise(), expected)
    assert (noise(seeds=[2]) != expected).all()
    assert (noise(start=0.25) != expected).all()
    np.testing.assert_array_equal(noise(start=0.0), noise(start=-0.0))
    assert 1.0 < expected.std() < 3.0
    # The same numbers one after another, whatever they are parts of, and whatever their precision and deviation.
    np.testing.assert_array_equal(noise((7,)), expected.ravel()[:7])
    np.testing.assert_array_equal(noise(dtype=np.float64), expected)
    np.testing.assert_array_equal(2.0 * noise(deviation=1.0), expected)


def test_every_frame_has_the_noise_of_its_seed() -> None:
    both = noise((4, 3, 16), seeds=[7, 1])
    np.testing.assert_array_equal(both, np.concatenate([noise(seeds=[7]), noise(seeds=[1])]))


@pytest.mark.parametrize("shape", [(2, 0, 8), (0, 0, 0), (0,), ()])
def test_little_or_nothing_is_taken(shape: tuple[int, ...]) -> None:
    assert noise(shape).shape == shape
    np.testing.assert_array_equal(noise(shape, seeds=[]), np.zeros(shape))


def test_what_is_no_memory_of_samples_is_refused() -> None:
    samples = np.zeros((2, 3, 16))
    for bad in (samples.astype(complex), samples.astype(int), samples.tolist(), None):
        refuses(lambda bad=bad: _core.add_noise(bad, [1], 1.0, 0.0), TypeError)
    for bad in (samples[..., ::2], np.asfortranarray(samples)):
        refuses(lambda bad=bad: _core.add_noise(bad, [1], 1.0, 0.0), TypeError, "samples: expected a C-contiguous")
    samples.flags.writeable = False
    refuses(lambda: _core.add_noise(samples, [1], 1.0, 0.0), TypeError, "not writeable")
    assert (samples == 0.0).all()
