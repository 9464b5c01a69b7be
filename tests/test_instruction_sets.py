"""Kernels of the compiled core, read off its own symbols.

A closure inside a kernel, one of `map` or `from_fn` too, does not inherit the instruction set of the kernel: intrinsics
that it uses become calls, two to three times slower, and nothing else tells (rust/numeric/simd). A called intrinsic is
a function of its own in the library; so is a called function of fearless_simd, which holds one. The shipped library is
read: debug assertions, which other builds have, keep the compiler from inlining loads and stores.
"""

import platform
import re
import sys
from pathlib import Path

import pytest

from radarcore import _core

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64",
    reason="symbols are read of ELF files with x86-64 code only",
)


def symbols() -> set[str]:
    """Mangled names of Rust functions, `_R..core_arch..3x86..avx512f15__mm512_fmadd_ps..`, of the compiled core."""
    library = Path(_core.__file__).read_bytes()
    return {name.decode() for name in re.findall(rb"\0(_(?:R|ZN)[\w.$]+)(?=\0)", library)}


def called(names: set[str]) -> set[str]:
    """Intrinsics among functions, and functions around them. Registers are types of their module as well, `__m512`."""
    intrinsic = re.compile(r"core_arch.*_mm(256|512)?_\w+|__fearless_simd_kernel")
    return {found[0] for name in names if (found := intrinsic.search(name))}


@pytest.mark.parametrize("level", ["avx2", "avx512"])
def test_every_intrinsic_is_inlined_into_its_kernel(level):
    names = symbols()
    kernels = [name for name in names if f"vectorize_{level}" in name]
    assert len(kernels) > 5, "no kernels are found where they should be: is the library stripped?"
    assert called(names) == set(), "called from code that lacks the instruction set: a closure in a kernel?"


def test_an_intrinsic_that_is_called_is_found():
    legacy = "_ZN4core9core_arch3x867avx512f15_mm512_fmadd_ps17h0123456789abcdefE"
    current = "_RNvNtNtNtCs3core4core9core_arch3x864avx218__mm256_loadu_ps"
    around = "_ZN13fearless_simd9generated6avx51212add_f32x166kernel22__fearless_simd_kernel17h0123456789abcdefE"
    takes_a_register = "_RINvNtCs9radarcore4simd5Isa3runNtNtCs4core9core_arch3x866__m512EB4_"
    assert len(called({legacy, current, around})) == 3
    assert called({takes_a_register}) == set()
