"""Checks of arguments: every kind once, with the name, the expected and the given value."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from radarcore import check

REFUSED: list[tuple[Callable[..., object], tuple[Any, ...], type[Exception], str]] = [
    (check.number, ("wide", "m"), TypeError, r"x: expected a number \[m\], got 'wide'"),
    (check.number, (None,), TypeError, "x: expected a number, got None"),
    (check.number, (True,), TypeError, "x: expected a number, got True"),
    (check.number, ([[1.0]],), TypeError, r"x: expected a number, got \[\[1.0\]\]"),
    (check.number, (np.inf,), ValueError, "x: expected a finite number, got inf"),
    (check.complex_number, ("-1",), TypeError, "x: expected a number, got '-1'"),
    (check.complex_number, (complex(0.0, np.nan),), ValueError, "x: expected a finite number, got nanj"),
    (check.positive, (0.0, "s"), ValueError, r"x: expected a positive number \[s\], got 0.0"),
    (check.non_negative, (-1,), ValueError, "x: expected zero or a positive number, got -1"),
    (check.within, (1.1, 0.0, 1.0), ValueError, "x: expected a number from 0 to 1, got 1.1"),
    (check.frequency, (60.0,), ValueError, r"x: expected 1e8 to 3e12 \[Hz\] \(60 GHz is 60e9\), got 60"),
    (check.level, (-2e3, "dBi"), ValueError, r"x: expected a number from -1000 to 1000 \[dBi\], got -2000"),
    (check.count, (2.0,), TypeError, "x: expected an integer, got 2.0"),
    (check.count, (0,), ValueError, "x: expected at least 1, got 0"),
    (check.count, (8, 0, 7), ValueError, "x: expected at most 7, got 8"),
    (check.port, (70_000,), ValueError, "x: expected at most 65535, got 70000"),
    (check.index, (3, 3), ValueError, "x: expected an index below 3, got 3"),
    (check.flag, ("no",), TypeError, "x: expected True or False, got 'no'"),
    (check.instance, (1.0, int, list), TypeError, "x: expected int or list, got float"),
    (check.time, (1.7e12,), ValueError, r"x: expected times up to 1e\+12 s, got 1.7e\+12 s"),
    (check.numbers, (["1"],), TypeError, "x: expected numbers, got list of <U1"),
    (check.numbers, (1j,), TypeError, "x: expected numbers, got complex of complex128"),
    (check.numbers, ([1.0], (3,)), ValueError, r"x: expected shape \(3,\), got \(1,\)"),
    (check.complex_numbers, ("word",), TypeError, "x: expected numbers, got str"),
    (check.increasing, ([0.0],), ValueError, "x: expected at least two, got 1"),
    (check.increasing, ([0.0, 1.0, 1.0],), ValueError, "got 1 and then 1 at index 2"),
    (check.choice, ("oss", ("ca", "os")), ValueError, r"x: expected .*, got 'oss'; did you mean 'os'\?"),
    (check.numbers, ([[1.0], [1.0, 2.0]], (2, None)), TypeError, r"x: expected numbers of shape \(2, n\), got list"),
    (check.array, ([0.0, np.nan], (None,)), ValueError, r"x: expected finite numbers, got nan at index \(1,\)"),
    (check.increasing, ([0.0, 1.0, 1.0 + 2e-16],), ValueError, "x: expected times at least 1e-12 s from each other"),
    (check.below, (np.array([0.0, -4e8]), 3e8, "m/s"), ValueError, r"x: expected less than 3e\+08 m/s, got -4e\+08"),
    (check.keywords, (["gard"], ["guard"]), TypeError, "x: unknown keyword 'gard'; did you mean 'guard'"),
]


@pytest.mark.parametrize(("function", "arguments", "error", "message"), REFUSED)
def test_refusals_name_the_argument_and_what_was_expected(
    function: Callable[..., object], arguments: tuple[Any, ...], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        function("x", *arguments)


def test_what_fits_comes_back_as_a_plain_value() -> None:
    assert check.number("x", np.float32(0.5)) == 0.5
    assert check.count("x", np.int8(3)) == 3
    assert check.index("x", -1, 3) == 2
    assert check.flag("x", np.True_) is True
    assert check.instance("x", 3, int, str) == 3
    given = np.array([1.0, 2.0])
    assert check.numbers("x", given) is given
    assert not np.shares_memory(check.array("x", given, (2,)), given)
    assert check.printable("a\x1b[0m") == r"a\x1b[0m"
    assert check.near_names("abc", ["xyz"]) == "known: xyz"
