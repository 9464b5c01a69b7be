"""Antenna patterns: power gain over azimuth and elevation, and their CSV files."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import _core, check, notice
from radarcore.records import Twinned, sealed
from radarcore.units import power_from_db

_BEAMWIDTHS = (1e-3, 360.0)
"""Limits of beam widths [degrees]: a dish of a hundred metres, and the width above which nothing is directive."""

_RADIATED_DB = 1.0
"""Radiated over supplied power, above which gain and beam widths contradict each other [dB]: data sheets round."""

_NUM_ANGLES = 180
"""Angles of either kind at which the gain is taken for the power."""


@sealed
@dataclass(unsafe_hash=True)
class IsotropicPattern(Twinned):
    """Constant gain in all directions; more than 3 dBi is impossible and causes a warning.

    See Also
    --------
    GaussianPattern : A beam.
    TabulatedPattern : Gains as measured.

    Examples
    --------
    >>> rc.IsotropicPattern(gain_db=3.0).gain([0.0, 1.0], 0.0).round(3)
    array([1.995, 1.995])
    """

    gain_db: float = 0.0

    def __post_init__(self) -> None:
        self.gain_db = check.level("gain_db", self.gain_db, "dBi")
        _warn_of_gain(self, self.gain_db, "in all directions")

    def gain(self, azimuth: ArrayLike, elevation: ArrayLike) -> NDArray[np.float64]:
        """Power gain (ratio) at angles in radians, broadcast together."""
        shape = np.broadcast(*_direction(azimuth, elevation)).shape
        return np.full(shape, power_from_db(self.gain_db))

    @cached_property
    def _core(self) -> _core.Pattern:
        return _core.Pattern.gaussian(power_from_db(self.gain_db), 0.0, 0.0)

    def __str__(self) -> str:
        return f"isotropic, {self.gain_db:g} dBi"


@sealed
@dataclass(unsafe_hash=True)
class GaussianPattern(Twinned):
    """Gaussian beam ``G0 exp(-4 ln 2 [(az/BW_az)^2 + (el/BW_el)^2])``.

    Parameters
    ----------
    gain_db : float
        Power gain on boresight [dBi].
    beamwidth_azimuth_deg, beamwidth_elevation_deg : float
        Full widths at half power [degrees].

    Warns
    -----
    UserWarning
        For more gain than beams of these widths can have: the antenna would radiate more power than it is fed with.

    See Also
    --------
    TabulatedPattern : Gains as measured.
    IsotropicPattern : The same gain everywhere.
    Radar.field_of_view_deg : Angles that antennas see.

    Examples
    --------
    >>> pattern = rc.GaussianPattern(3.5, beamwidth_azimuth_deg=65.0, beamwidth_elevation_deg=40.0)
    >>> loss = pattern.gain(np.deg2rad(0.5 * 65.0), 0.0) / pattern.gain(0.0, 0.0)
    >>> print(f"{10 * np.log10(loss):.2f} dB")
    -3.01 dB
    """

    gain_db: float
    beamwidth_azimuth_deg: float
    beamwidth_elevation_deg: float

    def __post_init__(self) -> None:
        self.gain_db = check.level("gain_db", self.gain_db, "dBi")
        for name in ("beamwidth_azimuth_deg", "beamwidth_elevation_deg"):
            setattr(self, name, check.within(name, getattr(self, name), *_BEAMWIDTHS, "degrees"))
        widths = self.beamwidth_azimuth_deg, self.beamwidth_elevation_deg
        check.degrees("beamwidth_azimuth_deg, beamwidth_elevation_deg", widths)
        _warn_of_gain(self, self.gain_db, f"over {widths[0]:g} x {widths[1]:g} degrees", widths)

    def gain(self, azimuth: ArrayLike, elevation: ArrayLike) -> NDArray[np.float64]:
        """Power gain (ratio) at angles in radians, broadcast together; periodic in azimuth."""
        peak, a, b = self._parameters
        az, el = _direction(azimuth, elevation)
        return np.asarray(peak * np.exp(-a * np.square(az) - b * np.square(el)), dtype=np.float64)

    @property
    def _parameters(self) -> tuple[float, float, float]:
        """Peak gain and the two exponents [1/rad^2]."""
        widths = np.deg2rad([self.beamwidth_azimuth_deg, self.beamwidth_elevation_deg])
        a, b = 4.0 * np.log(2.0) / widths**2
        return power_from_db(self.gain_db), float(a), float(b)

    @cached_property
    def _core(self) -> _core.Pattern:
        return _core.Pattern.gaussian(*self._parameters)

    def __str__(self) -> str:
        widths = f"{self.beamwidth_azimuth_deg:g} x {self.beamwidth_elevation_deg:g} degrees"
        return f"Gaussian, {self.gain_db:g} dBi, {widths}"


@sealed
@dataclass(eq=False, repr=False)
class TabulatedPattern(Twinned):
    """Gains at angles, bilinear between them in azimuth, elevation and dB.

    The gain is zero outside of the table; nothing is extrapolated. The edge is a step, so extend a table until the gain
    no longer matters. A table over all azimuths, with no wider gap behind the antenna than between its other azimuths,
    is closed there: give -180 or 180 degrees, or both.

    Parameters
    ----------
    azimuth : (n,) array_like
        Increasing, from -pi to pi [rad], positive to the left; at least two.
    elevation : (m,) array_like
        Increasing, from -pi/2 to pi/2 [rad], positive up; at least two.
    gain_db : (n, m) array_like
        Power gain [dBi], finite: a null is some large negative number. Straight up and down are seen at azimuth 0.

    See Also
    --------
    TabulatedPattern.load : Table of a CSV file.
    GaussianPattern : A beam by its widths.

    Examples
    --------
    >>> pattern = rc.TabulatedPattern([-1.0, 0.0, 1.0], [-0.5, 0.5], [[-9.0, -9.0], [3.0, 3.0], [-9.0, -9.0]])
    >>> print(f"{10 * np.log10(pattern.gain(0.5, 0.0)):.1f} dBi")
    -3.0 dBi
    """

    azimuth: NDArray[np.float64]
    elevation: NDArray[np.float64]
    gain_db: NDArray[np.float64]

    def __init__(self, azimuth: ArrayLike, elevation: ArrayLike, gain_db: ArrayLike) -> None:
        self.azimuth = _angles("azimuth", azimuth, np.pi, "rad")
        self.elevation = _angles("elevation", elevation, 0.5 * np.pi, "rad")
        gains = check.array("gain_db", gain_db, (len(self.azimuth), len(self.elevation)))
        self.gain_db = check.frozen(check.below("gain_db", gains, check.LARGEST_DB, "dB"))
        _warn_of_gain(self, float(self.gain_db.max()), "with the beam width of the table")

    @classmethod
    def from_degrees(cls, azimuth_deg: ArrayLike, elevation_deg: ArrayLike, gain_db: ArrayLike) -> TabulatedPattern:
        """Pattern from angles in degrees.

        See Also
        --------
        TabulatedPattern.load : Table of a CSV file.

        Examples
        --------
        >>> pattern = rc.TabulatedPattern.from_degrees([-60, 0, 60], [-30, 30], [[-9, -9], [3, 3], [-9, -9]])
        >>> pattern
        <TabulatedPattern: table of 3 x 2, peak 3 dBi, azimuth -60 to 60, elevation -30 to 30 degrees>
        """
        azimuth = _angles("azimuth_deg", azimuth_deg, 180.0, "degrees")
        elevation = _angles("elevation_deg", elevation_deg, 90.0, "degrees")
        for name, angles in (("azimuth_deg", azimuth), ("elevation_deg", elevation)):
            check.degrees(name, check.numbers(name, angles))
        return cls(np.deg2rad(azimuth), np.deg2rad(elevation), gain_db)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> TabulatedPattern:
        """Read a table from a CSV file.

        Parameters
        ----------
        path : path
            Columns ``azimuth_deg``, ``elevation_deg`` and ``gain_db``, named in the first line, in any order; one line
            for every pair of an azimuth and an elevation, in any order.

        Raises
        ------
        FileNotFoundError
            When there is no such file.
        ValueError
            When lines are not a table; names the row if possible.

        See Also
        --------
        TabulatedPattern.from_degrees : Table in memory.

        Examples
        --------
        >>> rows = [(az, el, 3.0 - abs(az) / 10.0) for az in (-60, 0, 60) for el in (-30, 30)]
        >>> np.savetxt("gain.csv", rows, header="azimuth_deg,elevation_deg,gain_db", delimiter=",", comments="")
        >>> rc.TabulatedPattern.load("gain.csv")
        <TabulatedPattern: table of 3 x 2, peak 3 dBi, azimuth -60 to 60, elevation -30 to 30 degrees>
        """
        try:
            return cls.from_degrees(*read_table(Path(path)))
        except (ValueError, TypeError) as error:
            raise ValueError(f"{fspath(path)}: {error}") from None

    def gain(self, azimuth: ArrayLike, elevation: ArrayLike) -> NDArray[np.float64]:
        """Power gain (ratio) at angles in radians, broadcast together; 0 outside of the table."""
        az, el = np.broadcast_arrays(*_direction(azimuth, elevation))
        return self._core.gain(az.ravel(), np.ascontiguousarray(el).ravel()).reshape(az.shape)

    @cached_property
    def _core(self) -> _core.Pattern:
        return _core.Pattern.table(self.azimuth, self.elevation, self.gain_db)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TabulatedPattern) and all(
            np.array_equal(getattr(self, field.name), getattr(other, field.name)) for field in dataclasses.fields(self)
        )

    def __hash__(self) -> int:
        return hash((*self.azimuth.tolist(), *self.elevation.tolist()))

    def __repr__(self) -> str:
        return f"<TabulatedPattern: {self}>"

    def __str__(self) -> str:
        azimuth, elevation = (
            f"{np.rad2deg(angles[0]):g} to {np.rad2deg(angles[-1]):g}" for angles in (self.azimuth, self.elevation)
        )
        size = f"table of {len(self.azimuth)} x {len(self.elevation)}"
        return f"{size}, peak {self.gain_db.max():g} dBi, azimuth {azimuth}, elevation {elevation} degrees"


Pattern = IsotropicPattern | GaussianPattern | TabulatedPattern
"""Antenna pattern as `Radar` takes it."""

_KINDS: dict[str, type[Pattern]] = {
    "isotropic": IsotropicPattern,
    "gaussian": GaussianPattern,
    "tabulated": TabulatedPattern,
}


def pattern_to_dict(pattern: Pattern) -> dict[str, Any]:
    """Kind and parameters of a pattern, for JSON."""
    kind = next(name for name, kind in _KINDS.items() if isinstance(pattern, kind))
    parameters = {field.name: getattr(pattern, field.name) for field in dataclasses.fields(pattern)}
    plain = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in parameters.items()}
    return {"kind": kind, **plain}


def pattern_from_dict(values: Mapping[str, Any]) -> Pattern:
    """Pattern from its description by `pattern_to_dict`."""
    parameters = dict(values)
    kind = check.choice("pattern kind", parameters.pop("kind", None), tuple(_KINDS))
    return _KINDS[kind](**parameters)


def _direction(azimuth: ArrayLike, elevation: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The angles as arrays, azimuths from -pi to pi."""
    az = check.numbers("azimuth", azimuth)
    return np.where(np.abs(az) > np.pi, np.arctan2(np.sin(az), np.cos(az)), az), check.numbers("elevation", elevation)


def _warn_of_gain(
    pattern: Pattern, peak_db: float, beam: str, beamwidths_deg: tuple[float, float] = (180.0, 180.0)
) -> None:
    """Warn of a pattern that radiates more power to the front, x > 0, than the antenna is fed with.

    The back is ignored: constant gains of up to 3 dBi represent elements in front of a ground plane.
    """
    # Midpoints of equal steps, to twice the beam width on either side.
    halves = [np.deg2rad(min(90.0, 2.0 * width)) for width in beamwidths_deg]
    azimuth, elevation = (half * (np.arange(-_NUM_ANGLES + 1, _NUM_ANGLES, 2) / _NUM_ANGLES) for half in halves)
    density = pattern.gain(azimuth[:, None], elevation) * np.cos(elevation)
    radiated = float(density.mean() * halves[0] * halves[1] / np.pi)
    excess_db = 10.0 * np.log10(radiated) if radiated > 0.0 else -np.inf
    if excess_db > _RADIATED_DB:
        notice.warn(
            f"gain_db: expected at most {peak_db - excess_db:.3g} dBi {beam}, as no antenna radiates more power than "
            f"it is fed with, got {peak_db:g} dBi"
        )


def _angles(name: str, value: ArrayLike, limit: float, unit: str) -> NDArray[np.float64]:
    """Increasing angles within a limit, frozen."""
    angles = check.array(name, value, (None,))
    if len(angles) < 2:
        raise ValueError(f"{name}: expected at least two angles [{unit}], got {len(angles)}")
    is_beyond = np.abs(angles) > limit * (1.0 + 1e-12)  # as degrees are rounded
    if is_beyond.any():
        hint = "; degrees? np.deg2rad" if unit == "rad" else ""
        bad = angles[int(is_beyond.argmax())]
        raise ValueError(f"{name}: expected angles from {-limit:.6g} to {limit:.6g} [{unit}], got {bad:g}{hint}")
    check.in_order(name, angles, f"angles [{unit}]")
    return check.frozen(np.clip(angles, -limit, limit))


_COLUMNS = ("azimuth_deg", "elevation_deg", "gain_db")
"""Columns of a file of a table."""

_LONGEST_TEXT = 200
"""Characters of a file that a message shows."""


def read_table(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Azimuths and elevations [degrees], and gains [dB], (azimuth, elevation), of a file."""
    if path.exists() and not (path.is_file() or path.is_dir()):  # a device may never end
        raise ValueError("expected a file, got a device or a pipe")
    with path.open(encoding="utf-8-sig") as file:
        names = [name.strip() for name in file.readline().split(",")]
        if sorted(names) != sorted(_COLUMNS):
            got = check.printable(", ".join(names))
            got = got if len(got) <= _LONGEST_TEXT else f"{got[:_LONGEST_TEXT]}..."
            raise ValueError(f"expected the columns {', '.join(_COLUMNS)}, got {got or 'none'}")
        lines = [line for line in file if line.strip()]
    if not lines:
        raise ValueError("expected lines of numbers, got none")
    rows = np.loadtxt(lines, delimiter=",", usecols=[names.index(column) for column in _COLUMNS], ndmin=2)
    azimuth, elevation, gain = check.finite("lines", rows).T
    azimuths, i = np.unique(azimuth, return_inverse=True)
    elevations, j = np.unique(elevation, return_inverse=True)
    count = np.zeros((len(azimuths), len(elevations)), dtype=np.int64)
    np.add.at(count, (i, j), 1)
    if (count != 1).any():
        first = np.argwhere(count != 1)[0]
        pair = f"azimuth {azimuths[first[0]]:g} and elevation {elevations[first[1]]:g} degrees"
        raise ValueError(f"expected one line for every azimuth and elevation, got {count[tuple(first)]} for {pair}")
    gains = np.zeros(count.shape)
    gains[i, j] = gain
    return azimuths, elevations, gains
