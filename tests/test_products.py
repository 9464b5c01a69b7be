"""Products of matrices: their values, and that they leave the threads of BLAS asleep."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from radarcore.products import orthonormal, product, real_inner


@pytest.mark.skipif(sys.platform != "linux", reason="asks the system how long threads have run")
def test_functions_on_frames_wake_no_threads_of_blas() -> None:
    script = Path(__file__).parent / "blas_threads.py"
    run = subprocess.run(
        [sys.executable, "-W", "ignore", str(script)],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "2"},
        capture_output=True,
        text=True,
        check=True,
    )
    if run.stdout == "none\n":
        pytest.skip("BLAS has no threads on this machine")
    assert run.stdout == ""


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ((300, 200), (200, 100)),
        ((3, 1, 70, 90), (2, 90, 200)),
        ((40_000, 3), (3, 12)),
        ((3,), (3, 5)),
        ((1, 300), (300, 200)),
    ],
)
@pytest.mark.parametrize("dtype", ["f4", "c16"])
def test_products_in_blocks_are_products(left: tuple[int, ...], right: tuple[int, ...], dtype: str) -> None:
    rng = np.random.default_rng(1)
    a, b = (rng.normal(size=shape).astype(dtype) * (1j if dtype == "c16" else 1.0) for shape in (left, right))
    np.testing.assert_allclose(product(a, b), a @ b, rtol=0.0, atol=1e-4 if dtype == "f4" else 1e-12)


def test_inner_products_and_orthonormal_vectors() -> None:
    rng = np.random.default_rng(1)
    vectors = rng.normal(size=(5, 25_000)) + 1j * rng.normal(size=(5, 25_000))
    assert real_inner(vectors[0], vectors[1]) == pytest.approx(np.sum(vectors[0].conj() * vectors[1]).real, rel=1e-12)
    basis = np.empty((0, 25_000))
    for vector in vectors:
        basis = np.vstack([basis, orthonormal(vector, basis)])
    np.testing.assert_allclose(np.einsum("in,jn->ij", basis.conj(), basis), np.eye(5), atol=1e-14)
