"""Products of matrices in the calling thread only.

OpenBLAS wakes a thread on every core for a large product. On a busy machine these threads spin and wait for a core, so
that a product of 0.1 ms sometimes takes 100 ms.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_MOST_REAL, _MOST_COMPLEX = 2**19 - 1, 2**16 - 1
"""Largest number of multiplications for which OpenBLAS wakes no threads."""

_MOST_OF_VECTOR = 2**12
"""Largest number for a matrix and a vector."""

_LONGEST = 10_000
"""Largest length of an inner product for which OpenBLAS wakes no threads."""

_LEAST_COLUMNS = 16
"""Smallest number of columns of a block, so that it is no vector."""


def product(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """``a @ b`` of stacks of matrices (..., m, k) and (..., k, n), in blocks that wake no threads."""
    most = _MOST_REAL if a.dtype.kind == b.dtype.kind == "f" else _MOST_COMPLEX
    if a.ndim < 2:
        return np.asarray(a @ b)
    (m, k), n = a.shape[-2:], b.shape[-1]
    if min(m, n) == 1 and m * k * n > _MOST_OF_VECTOR:
        return np.asarray(np.einsum("...mk,...kn->...mn", a, b))
    if m * k * n <= most:
        return np.asarray(a @ b)
    columns = min(n, max(_LEAST_COLUMNS, most // (m * k)))
    rows = max(1, most // (k * columns))
    result = np.empty((*np.broadcast_shapes(a.shape[:-2], b.shape[:-2]), m, n), np.result_type(a, b))
    for row in range(0, m, rows):
        for column in range(0, n, columns):
            block = a[..., row : row + rows, :], b[..., column : column + columns]
            result[..., row : row + rows, column : column + columns] = product(*block)  # the last may be a vector
    return result


def real_inner(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Real part of the inner product of arrays of one shape; NaN or infinite if a value is."""
    first, second = a.ravel(), b.ravel()
    blocks = [slice(start, start + _LONGEST) for start in range(0, len(first), _LONGEST)]
    return float(sum(np.vdot(first[block], second[block]).real for block in blocks))


def orthonormal(vector: NDArray[Any], basis: NDArray[Any]) -> NDArray[Any]:
    """A vector (n,) orthogonal to orthonormal rows (k, n), of length 1 (Gram-Schmidt, twice)."""
    for _ in range(2):
        vector = vector - np.einsum("kn,k->n", basis, np.einsum("kn,n->k", basis.conj(), vector))
    return np.asarray(vector / np.sqrt(real_inner(vector, vector)))
