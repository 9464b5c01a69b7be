"""Checks of arguments: messages name the argument, the expected and the given value."""

from __future__ import annotations

import difflib
import operator
from cmath import isfinite
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import notice

_Number = TypeVar("_Number", np.float64, np.complex128)
_Scalar = TypeVar("_Scalar", bound=np.generic)
_Kind = TypeVar("_Kind")
_Float = TypeVar("_Float", float, complex)

LARGEST_DB = 1000.0
"""Levels and gains are within this [dB]: the powers of a few of them together are still numbers."""

_LONGEST_TIME = 1e12
"""Largest time of a series [s], hundreds of times the seconds since 1970."""

_SHORTEST_INTERVAL = 1e-12
"""Shortest interval between two times of a series [s]."""

_LOWEST_FREQUENCY, HIGHEST_FREQUENCY = 1e8, 3e12
"""Frequencies outside of these limits are implausible, such as gigahertz in place of hertz [Hz]."""

_PART_OF_PI = np.pi / 12.0
"""15 degrees [rad]; usual angles are multiples of it."""


def number(name: str, value: object, unit: str = "") -> float:
    """A finite number, or a ValueError (TypeError for what is no number at all)."""
    return _scalar(name, value, unit, float)


def complex_number(name: str, value: object) -> complex:
    """A finite complex number, or a ValueError (TypeError for what is no number at all)."""
    return _scalar(name, value, "", complex)


def _scalar(name: str, value: Any, unit: str, kind: type[_Float]) -> _Float:
    try:
        if isinstance(value, bool | str | bytes) or value is None:
            raise TypeError
        result = kind(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: expected a number{_in(unit)}, got {value!r}") from None
    if not isfinite(result):
        raise ValueError(f"{name}: expected a finite number{_in(unit)}, got {value!r}")
    return result


def positive(name: str, value: object, unit: str = "") -> float:
    """A finite number above zero."""
    result = number(name, value, unit)
    if result <= 0.0:
        raise ValueError(f"{name}: expected a positive number{_in(unit)}, got {value!r}")
    return result


def non_negative(name: str, value: object, unit: str = "") -> float:
    """A finite number that is zero or above."""
    result = number(name, value, unit)
    if result < 0.0:
        raise ValueError(f"{name}: expected zero or a positive number{_in(unit)}, got {value!r}")
    return result


def frequency(name: str, value: object) -> float:
    """A frequency that a radar can have [Hz]."""
    result = positive(name, value, "Hz")
    if not _LOWEST_FREQUENCY <= result <= HIGHEST_FREQUENCY:
        raise ValueError(f"{name}: expected 1e8 to 3e12 [Hz] (60 GHz is 60e9), got {result:g}")
    return result


def level(name: str, value: object, unit: str = "dB") -> float:
    """A level from -1000 to 1000 dB, or a ValueError (TypeError for what is no number at all)."""
    return within(name, value, -LARGEST_DB, LARGEST_DB, unit)


def non_positive_level(name: str, value: object, unit: str = "dB") -> float:
    """A level from -1000 to 0 dB, of a ratio up to 1."""
    result = level(name, value, unit)
    if result > 0.0:
        raise ValueError(f"{name}: expected at most 0 [{unit}], got {result:g}")
    return result


def count(name: str, value: object, minimum: int = 1, maximum: int | None = None) -> int:
    """An integer of at least `minimum` and at most `maximum`."""
    if isinstance(value, bool):
        raise TypeError(f"{name}: expected an integer, got {value!r}")
    try:
        result = operator.index(value)  # type: ignore[arg-type]  # what has no index is reported below
    except TypeError:
        raise TypeError(f"{name}: expected an integer, got {value!r}") from None
    if result < minimum:
        raise ValueError(f"{name}: expected at least {minimum}, got {result}")
    if maximum is not None and result > maximum:
        raise ValueError(f"{name}: expected at most {maximum}, got {result}")
    return result


def port(name: str, value: object, minimum: int = 1) -> int:
    """Number of a port of TCP or UDP."""
    return count(name, value, minimum, 65_535)


def index(name: str, value: object, length: int) -> int:
    """An index into `length` things, from the start; negative ones count from the end."""
    result = count(name, value, -length)
    if result >= length:
        raise ValueError(f"{name}: expected an index below {length}, got {result}")
    return result % length


def flag(name: str, value: object) -> bool:
    """True or False; a TypeError for anything else, as any text would be true."""
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{name}: expected True or False, got {value!r}")
    return bool(value)


def instance(name: str, value: object, *kinds: type[_Kind]) -> _Kind:
    """An object of one of some classes, or a TypeError that names them."""
    if not isinstance(value, kinds):
        expected = listing(kind.__name__.replace("NoneType", "None") for kind in kinds)
        raise TypeError(f"{name}: expected {expected}, got {type(value).__name__}")
    return value


def within(name: str, value: object, low: float, high: float, unit: str = "") -> float:
    """A number from `low` to `high`, both included."""
    result = number(name, value, unit)
    if not low <= result <= high:
        raise ValueError(f"{name}: expected a number from {low:g} to {high:g}{_in(unit)}, got {value!r}")
    return result


def _in(unit: str) -> str:
    """Text of a unit after a number, for messages."""
    return f" [{unit}]" if unit else ""


def listing(words: Iterable[str]) -> str:
    """Text of several choices: ``A, B or C``."""
    *others, last = words
    return f"{', '.join(others)} or {last}" if others else last


def choice(name: str, value: object, choices: tuple[str, ...]) -> str:
    """Word out of a few choices."""
    if value not in choices:
        meant = f"; {near_names(value, choices)}" if near(value, choices) else ""
        raise ValueError(f"{name}: expected one of {', '.join(map(repr, choices))}, got {value!r}{meant}")
    return str(value)


def numbers(name: str, value: ArrayLike, shape: tuple[int | None, ...] | None = None) -> NDArray[np.float64]:
    """Real numbers as an array, NaN among them; a TypeError for text, dates and complex numbers.

    NumPy would read text as numbers and drop imaginary parts. A shape (None: any length) is checked.
    """
    return _numbers(name, value, shape, np.float64)


def complex_numbers(name: str, value: ArrayLike, shape: tuple[int | None, ...] | None = None) -> NDArray[np.complex128]:
    """Numbers as a complex array, NaN among them; a TypeError for text and dates. A shape is checked."""
    return _numbers(name, value, shape, np.complex128)


def _numbers(
    name: str, value: ArrayLike, shape: tuple[int | None, ...] | None, dtype: type[_Number]
) -> NDArray[_Number]:
    if type(value) is not np.ndarray or value.dtype != dtype:
        kind = "numbers" + ("" if shape is None else f" of shape {shape_text(shape)}")
        try:
            given = np.asarray(value)
            if given.dtype.kind == "O" and not any(isinstance(each, str | bytes | None) for each in given.flat):
                given = given.astype(dtype)
        except (TypeError, ValueError) as error:  # no numbers, or rows of different lengths
            raise TypeError(f"{name}: expected {kind}, got {type(value).__name__}") from error
        if given.dtype.kind not in ("biuf" if dtype is np.float64 else "biufc"):
            of = "" if isinstance(value, str | bytes | None) else f" of {given.dtype}"
            raise TypeError(f"{name}: expected {kind}, got {type(value).__name__}{of}")
        value = given.astype(dtype, copy=False)
    return value if shape is None else shaped(name, value, shape)


def shaped(name: str, values: NDArray[_Scalar], shape: tuple[int | None, ...]) -> NDArray[_Scalar]:
    """An array of the given shape (None: any length), or a ValueError."""
    if values.shape != shape and not fits(values.shape, shape):
        raise ValueError(f"{name}: expected shape {shape_text(shape)}, got {values.shape}")
    return values


def fits(shape: tuple[int, ...], expected: tuple[int | None, ...]) -> bool:
    """True for a shape with the expected lengths (None: any)."""
    return len(shape) == len(expected) and all(want in (None, got) for want, got in zip(expected, shape, strict=True))


def finite(name: str, values: NDArray[_Scalar]) -> NDArray[_Scalar]:
    """An array without NaN and infinities, or a ValueError that says where the first is."""
    if not np.isfinite(values).all():
        bad = np.argwhere(~np.isfinite(values))[0]
        where = f" at index {tuple(int(i) for i in bad)}" if values.ndim else ""
        raise ValueError(f"{name}: expected finite numbers, got {values[tuple(bad)]}{where}")
    return values


def array(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """A finite f64 array of the given shape (None: any length), copied so that later changes do not reach it."""
    return finite(name, np.array(numbers(name, value, shape), order="C"))


def radians(name: str, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """The angles [rad], with a warning of implausible ones: whole or half numbers beyond a full turn.

    Such numbers are degrees nearly always; angles of something that keeps turning are not whole.
    """
    beyond = np.abs(angles) > 2.0 * np.pi
    if beyond.any() and (bad := beyond & (np.mod(angles, 0.5) == 0.0)).any():
        notice.warn(f"{name}: expected radians, got {angles[bad][0]:g}; degrees? np.deg2rad makes radians of them")
    return angles


def below(name: str, values: NDArray[np.float64], most: float, unit: str) -> NDArray[np.float64]:
    """Values whose magnitudes are below a limit, or a ValueError."""
    if (np.abs(values) >= most).any():
        got = values.flat[np.abs(values).argmax()]
        raise ValueError(f"{name}: expected less than {most:.0e} {unit}, got {got:g}")
    return values


def time(name: str, value: object) -> float:
    """A time [s]; a ValueError for times as long as the milliseconds since 1970."""
    result = number(name, value, "s")
    if abs(result) > _LONGEST_TIME:
        raise ValueError(f"{name}: expected times up to {_LONGEST_TIME:g} s, got {result:g} s")
    return result


def degrees(name: str, angles: ArrayLike) -> ArrayLike:
    """The angles [degrees], with a warning if all nonzero ones are usual fractions of pi, as in radians."""
    given = np.abs(np.atleast_1d(np.asarray(angles, np.float64)).ravel())
    given = given[given > 0.0]
    parts = np.rint(given / _PART_OF_PI) * _PART_OF_PI
    # Exact to single precision, or rounded to three digits or more; pi and pi / 2 also to two.
    is_written = np.abs(given - parts) < 1e-6
    for digits in (3, 4, 5):
        is_written |= given == np.round(parts, digits)
    is_written |= np.isin(given, [1.57, 3.14])
    if given.size > 0 and (is_written & (parts > 0.0) & (parts < 6.3)).all():
        notice.warn(f"{name}: expected degrees, got {given[0]:g}; radians? np.rad2deg converts them")
    return angles


def increasing(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Times of a series in increasing order, at least two, read-only.

    Splines through them need finite squares and cubes, and finite inverses of squared and cubed intervals.
    """
    times = array(name, value, (None,))
    if len(times) < 2:
        raise ValueError(f"{name}: expected at least two, got {len(times)}")
    times = in_order(name, times)
    time(name, np.abs(times).max())
    if (shortest := np.diff(times).min()) < _SHORTEST_INTERVAL:
        k = int(np.diff(times).argmin()) + 1
        raise ValueError(
            f"{name}: expected times at least {_SHORTEST_INTERVAL:g} s from each other, got {shortest:g} s at index {k}"
        )
    return times


def in_order(name: str, values: NDArray[np.float64], kind: str = "times [s]") -> NDArray[np.float64]:
    """Values made read-only, or a ValueError where one does not exceed the value before it."""
    if not (np.diff(values) > 0.0).all():
        k = int((np.diff(values) <= 0.0).argmax())
        pair = f"{values[k]:.15g} and then {values[k + 1]:.15g} at index {k + 1}"  # with all digits of an epoch
        raise ValueError(f"{name}: expected increasing {kind}, got {pair}")
    return frozen(values)


def frozen(values: NDArray[_Scalar]) -> NDArray[_Scalar]:
    """Make an array read-only and return it: fields of frozen records must not change."""
    values.flags.writeable = False
    return values


def shape_text(shape: tuple[int | None, ...]) -> str:
    """Text of a shape with free lengths, for messages: ``(n, 3)``."""
    inner = ", ".join("n" if length is None else str(length) for length in shape)
    return f"({inner},)" if len(shape) == 1 else f"({inner})"


def printable(text: str) -> str:
    """Text for messages, with escapes for characters that a terminal would obey or not show."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def near(name: object, known: Iterable[str]) -> list[str]:
    """Known names close to a given one, the nearest first."""
    return difflib.get_close_matches(str(name), known, n=3)


def near_names(name: object, known: Iterable[str]) -> str:
    """Text that suggests known names close to a given one, or lists all."""
    names = list(known)
    meant = near(name, names)
    return f"did you mean {' or '.join(map(repr, meant))}?" if meant else f"known: {', '.join(names) or 'none'}"


@contextmanager
def located(where: object) -> Iterator[None]:
    """Turns every error of a wrong value into a ValueError that begins with its place, such as a file."""
    try:
        yield
    except KeyError as error:
        raise ValueError(f"{where}: expected the key {error}, got none") from error
    except (ValueError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise ValueError(f"{where}: {printable(str(error))}") from error


def keywords(owner: str, given: Iterable[str], known: Iterable[str]) -> None:
    """Refuse an unknown keyword of a function that passes its keywords on: a TypeError that suggests near ones."""
    names = list(known)
    for name in given:
        if name not in names:
            raise TypeError(f"{owner}: unknown keyword {name!r}; {near_names(name, names)}")
