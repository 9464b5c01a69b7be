"""Receiver of the compiled core: its arguments, its errors, and the order of samples."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from core_calls import INF, NAN, refuses
from radarcore import _core

CUBE = (np.arange(48.0) - 1j * np.arange(48.0)).reshape(2, 3, 8)


def receive(ideal: Any, output: str = "iq", deviation: float = 0.0, seed: int = 1, start: float = 0.5) -> NDArray[Any]:
    return _core.receive(ideal, output=output, deviation=deviation, seeds=[seed], start=start)


@pytest.mark.parametrize("dtype", ["complex64", "complex128"])
def test_samples_have_the_memory_of_the_ideal_ones_or_are_real_parts(dtype: str) -> None:
    ideal = CUBE.astype(dtype)
    assert receive(ideal) is ideal
    np.testing.assert_array_equal(ideal, CUBE)
    real = receive(ideal, "real")
    assert real.dtype == ideal.real.dtype
    assert real.flags.c_contiguous
    assert real.flags.writeable
    np.testing.assert_array_equal(real, CUBE.real)


@pytest.mark.parametrize("output", ["iq", "real"])
def test_noise_is_that_of_a_seed_and_a_start_and_is_added_in_order(output: str) -> None:
    def noise(**settings: Any) -> NDArray[Any]:
        samples = receive(np.zeros((2, 3, 8), dtype=np.complex64), output, deviation=2.0, **settings)
        return samples.view(np.float32).ravel()

    expected = noise()
    np.testing.assert_array_equal(noise(), expected)
    assert (noise(seed=2) != expected).all()
    assert (noise(start=0.25) != expected).all()
    np.testing.assert_array_equal(noise(start=0.0), noise(start=-0.0))
    assert 1.0 < expected.std() < 3.0
    # The same numbers one after another, whatever they are parts of.
    other = receive(np.zeros((2, 3, 8), dtype=np.complex64), "iq", deviation=2.0).view(np.float32).ravel()
    np.testing.assert_array_equal(other[: len(expected)], expected)


@pytest.mark.parametrize("shape", [(2, 0, 8), (2, 2, 0), (0, 0, 0)])
@pytest.mark.parametrize("output", ["iq", "real"])
def test_cubes_without_samples_stay_so(shape: tuple[int, ...], output: str) -> None:
    assert receive(np.zeros(shape, dtype=complex), output, deviation=1.0).shape == shape


def test_what_is_no_cube_or_no_setting_is_refused() -> None:
    for bad in (CUBE.real.copy(), CUBE[0], CUBE[None], CUBE.tolist(), None):
        refuses(lambda bad=bad: receive(bad), TypeError)
    for output in ("iq", "real"):
        for bad in (np.repeat(CUBE, 2, axis=-1)[..., ::2], np.asfortranarray(CUBE)):
            refuses(lambda bad=bad, output=output: receive(bad, output), TypeError, "ideal: expected a C-contiguous")
    refuses(lambda: receive(CUBE, "IQ"), ValueError, r"output: expected 'iq' or 'real', got \"IQ\"")
    for deviation in (-1.0, NAN, INF):
        refuses(
            lambda deviation=deviation: receive(CUBE, deviation=deviation), ValueError, "deviation: expected zero or"
        )


def test_read_only_cube_gives_real_parts_and_is_no_memory_of_samples() -> None:
    ideal = CUBE.copy()
    ideal.flags.writeable = False
    np.testing.assert_array_equal(receive(ideal, "real"), CUBE.real)
    refuses(lambda: receive(ideal, deviation=1.0), TypeError, "not writeable")


def test_normal_numbers_are_those_that_noise_is_made_of() -> None:
    numbers = _core.normal(96, seed=1, start=0.5)
    assert numbers.dtype == np.float32
    noise = receive(np.zeros((2, 3, 8), np.complex64), deviation=2.0).view(np.float32).ravel()
    np.testing.assert_array_equal(2.0 * numbers, noise)
    np.testing.assert_array_equal(_core.normal(7, seed=1, start=0.5), numbers[:7])
    np.testing.assert_array_equal(_core.normal(7, seed=1, start=-0.0), _core.normal(7, seed=1, start=0.0))
    assert _core.normal(0, seed=1, start=0.0).shape == (0,)
    refuses(lambda: _core.normal(2**62, seed=1, start=0.0), MemoryError, "num")
    for bad in (-1, 1.5, None):
        refuses(lambda bad=bad: _core.normal(bad, seed=1, start=0.0), (TypeError, OverflowError))
