"""Takes that Motive exports as CSV files, format versions 1.21 to 1.25."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import dataclass, field
from io import StringIO
from math import isfinite
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radarcore import check, notice
from radarcore.adapters.optitrack.capture import (
    AXES,
    CapturedBody,
    MotionCapture,
    motive_positions,
    motive_quaternions,
    positions_of,
    quaternions_of,
)
from radarcore.output import check_file, new_file

Array = NDArray[np.float64]

_UNITS = {"meters": 1.0, "centimeters": 1e-2, "millimeters": 1e-3}
_BODIES, _MARKERS = ("Rigid Body", "Bone"), ("Marker",)
_KINDS = (*_BODIES, "Rigid Body Marker", "Bone Marker", *_MARKERS)
_ERRORS = {"mean marker error", "error per marker"}

_LABELS = ("type", "name", "id")
"""Lines above the columns, in the order in which files without labels have them; "parent" has no use."""


@dataclass(frozen=True)
class _Item:
    """Columns of a body or a marker."""

    kind: str
    name: str
    id: str
    columns: dict[str, int] = field(default_factory=dict)
    """Index of the column by what it holds: ``Rotation X``, ``Position X``, ``error``."""

    def values(self, frames: Array, quantity: str, letters: str) -> Array:
        """Values of a quantity in all frames, (n, letters)."""
        return frames[:, [self.columns[f"{quantity} {letter}"] for letter in letters]]


def read_motive_csv(path: str | PathLike[str], *, axes: str = "z_up", length_unit: str | None = None) -> MotionCapture:
    """Read a take that Motive exported as CSV file.

    Frames without a body or a marker are NaN there. A file that ends too early is read up to there, with a warning;
    another warning names columns of types that are not read, such as force plates.

    Parameters
    ----------
    path : path
        Of the file; rotations must have been exported as quaternions, coordinates in the global space.
    axes : "z_up", "z_up_world" or "unchanged"
        In Motive y is up. "z_up" turns the axes of world and bodies, (x, -z, y) for (x, y, z), so that a body without
        rotation in Motive has none; "z_up_world" turns only the world; "unchanged" keeps them.
    length_unit : "meters", "centimeters" or "millimeters", optional
        Of a file that does not say it.

    Raises
    ------
    ValueError
        When the file is no such export, has separators other than commas, Euler angles or no unit, or a line has
        something other than numbers.

    See Also
    --------
    adapters.optitrack.MotionCapture : The result.
    adapters.optitrack.write_motive_csv : The way back.

    Examples
    --------
    >>> track = np.array([[2.0, 0.0, 1.0], [1.9, 0.0, 1.0], [1.8, 0.0, 1.0]])
    >>> ball = rc.adapters.optitrack.CapturedBody(track, np.tile([1.0, 0.0, 0.0, 0.0], (3, 1)), np.full(3, 1e-4))
    >>> capture = rc.adapters.optitrack.MotionCapture(np.array([0.0, 0.1, 0.2]), {"ball": ball})
    >>> rc.adapters.optitrack.write_motive_csv("take.csv", capture)
    >>> rc.adapters.optitrack.read_motive_csv("take.csv")["ball"].position[0].tolist()
    [2.0, 0.0, 1.0]
    """
    check.choice("axes", axes, AXES)
    file = Path(path)
    text = file.read_bytes().decode("utf-8-sig", "replace")
    rows = _rows(file, text)
    head = next((k for k, row in enumerate(rows) if row and row[0].strip() == "Frame"), len(rows))
    header = [[cell.strip() for cell in row] for row in rows[: head + 1]]
    settings = _settings(file, header)
    unit = _unit(file, settings, length_unit)
    if head == len(rows):
        raise ValueError(f"{file.name}: expected a line that begins with 'Frame', got none: truncated")
    items = _items(file, header)
    frames = _frames(file, rows, head, settings, items, is_ended=text.endswith(("\n", "\r")))

    bodies: dict[str, CapturedBody] = {}
    markers: dict[str, Array] = {}
    body_markers: dict[str, Array] = {}
    for item in items:
        position = positions_of(unit * item.values(frames, "Position", "XYZ"), axes)
        if item.kind in _BODIES:
            quaternion = quaternions_of(item.values(frames, "Rotation", "WXYZ"), axes)
            # A quaternion of zeros is none.
            length = np.linalg.norm(quaternion, axis=1)
            is_lost = np.isnan(position.sum(axis=1)) | ~(length > 0.5)
            position[is_lost], quaternion[is_lost] = np.nan, np.nan
            error = unit * frames[:, item.columns["error"]] if "error" in item.columns else np.full(len(frames), np.nan)
            bodies[_free_name(item, bodies)] = CapturedBody(position, quaternion, error)
        else:
            group = markers if item.kind in _MARKERS else body_markers
            group[_free_name(item, group)] = position
    return MotionCapture(
        time=check.in_order(f"{file.name}: Time", frames[:, 1].copy()),
        bodies=bodies,
        markers=markers,
        body_markers=body_markers,
        frame_rate=_rate(settings),
        start_time=settings.get("Capture Start Time", ""),
        take=settings.get("Take Name", ""),
    )


def _rows(file: Path, text: str) -> list[list[str]]:
    """Lines as cells."""
    try:
        return list(csv.reader(StringIO(text, newline="")))
    except csv.Error as error:
        raise ValueError(f"{file.name}: expected text in cells between commas, got something else ({error})") from None


def _settings(file: Path, header: list[list[str]]) -> dict[str, str]:
    """Settings of the first line."""
    first = header[0] if header and header[0] else [""]
    settings = dict(zip(first[0::2], first[1::2], strict=False))
    if "Format Version" not in settings:
        raise ValueError(
            f"{file.name}: expected 'Format Version' in the first line and commas between cells, as Motive exports "
            f"them, got {check.printable(first[0])!r}"
        )
    for name, known, advice in (
        ("Rotation Type", ("quaternion",), "with quaternions"),
        ("Coordinate Space", ("global", "world"), "in global ones"),
    ):
        if (got := settings.get(name, known[0])).lower() not in known:
            raise ValueError(
                f"{file.name}: expected the {name} {known[0].capitalize()}, got {got!r}; export the take {advice}"
            )
    return settings


def _items(file: Path, header: list[list[str]]) -> list[_Item]:
    """Bodies and markers, each with its columns, in the order of the file; a warning names other things."""
    *labelled, quantities = [line for line in header[1:-1] if any(line)] or [[]]
    letters = header[-1]
    kinds, names, ids = _labelled(file, labelled)
    found: dict[tuple[str, str, str], _Item] = {}
    others: dict[str, str] = {}
    for column, kind in enumerate(kinds[2:], 2):
        name, number, quantity, letter = (_cell(line, column) for line in (names, ids, quantities, letters))
        if kind in _KINDS:
            item = found.setdefault((kind, name, number), _Item(kind, name, number))
            is_error = _ERRORS & {quantity.lower(), letter.lower()}
            item.columns["error" if is_error else f"{quantity} {letter}"] = column
        elif kind:
            others[kind] = name
    if others:
        text = ", ".join(f"{kind} ({name})" if name else kind for kind, name in others.items())
        notice.warn(f"{file.name}: expected types {', '.join(_KINDS)}; left out: {check.printable(text)}")
    for item in found.values():
        needed = [f"Position {letter}" for letter in "XYZ"]
        if item.kind in _BODIES:
            needed += [f"Rotation {letter}" for letter in "XYZW"]
        if missing := [one for one in needed if one not in item.columns]:
            raise ValueError(
                f"{file.name}: expected a column {missing[0]!r} of {item.kind} {item.name!r}, got none; "
                "export the take with quaternions"
            )
    return list(found.values())


def _labelled(file: Path, lines: list[list[str]]) -> list[list[str]]:
    """Lines of types, names and identities, by their labels; by their order where there are none."""
    labels: Iterable[str] = [_cell(line, 1).lower() for line in lines]
    if not any(labels):
        labels = _LABELS
    found = dict(zip(labels, lines, strict=False))
    for label in ("type", "name"):
        if label not in found:
            raise ValueError(f"{file.name}: expected a line labelled {label.capitalize()!r}, got {list(found)}")
    return [found.get(label, []) for label in _LABELS]


def _unit(file: Path, settings: dict[str, str], given: str | None) -> float:
    """Unit of lengths [m]."""
    stated = settings.get("Length Units", "").lower()
    if stated and stated not in _UNITS:
        raise ValueError(f"{file.name}: expected Length Units Meters, Centimeters or Millimeters, got {stated!r}")
    if given is None and not stated:
        raise ValueError(
            f"{file.name}: expected 'Length Units' in the first line, got none; "
            f"give length_unit='meters', 'centimeters' or 'millimeters'"
        )
    if given is not None and check.choice("length_unit", given, tuple(_UNITS)) != (stated or given):
        raise ValueError(f"length_unit: expected {stated!r}, as the file says, got {given!r}")
    return _UNITS[stated or str(given)]


def _frames(
    file: Path, rows: list[list[str]], head: int, settings: dict[str, str], items: list[_Item], *, is_ended: bool
) -> Array:
    """Numbers (frame, column) of all whole lines below the header; NaN where there are none."""
    lines, num_columns = [row for row in rows[head + 1 :] if any(row)], len(rows[head])
    announced = settings.get("Total Exported Frames", "")
    expected = int(announced) if announced.isdecimal() else 0
    # A last line without an end, in a file with too few lines or itself with too few cells, is cut within a number.
    is_short = len(lines) < expected
    is_cut = bool(lines) and not is_ended and (is_short or len(lines[-1]) < num_columns)
    if is_cut:
        lines.pop()
    if not lines:
        raise ValueError(f"{file.name}: expected frames below the line 'Frame', got none")
    wanted = sorted({0, 1, *(column for item in items for column in item.columns.values())})
    frames = np.full((len(lines), num_columns), np.nan)
    for k, row in enumerate(lines):
        place, cells = f"{file.name}, line {head + k + 2}", [_cell(row, column) for column in wanted]
        for cell in cells:
            if cell and not _is_number(cell):
                raise ValueError(f"{place}: expected numbers, got {check.printable(cell)!r}")
        if not cells[1]:
            raise ValueError(f"{place}: expected a time in the second cell, got none")
        frames[k, wanted] = [float(cell) if cell else np.nan for cell in cells]
    if is_short or is_cut:
        count = f"{expected} frames" if expected else "whole lines"
        notice.warn(f"{file.name}: expected {count}, got {len(lines)}: the file is truncated after {frames[-1, 1]:g} s")
    return frames


def _rate(settings: dict[str, str]) -> float | None:
    """Frames per second, of the export if it says them."""
    rates = (settings.get(f"{kind} Frame Rate", "") for kind in ("Export", "Capture"))
    return next((float(text) for text in rates if _is_number(text)), None)


def _free_name(item: _Item, taken: dict[str, CapturedBody] | dict[str, Array]) -> str:
    """Name of a body or marker, with its identity where another has the same name."""
    return item.name if item.name not in taken else f"{item.name} {item.id}"


def _cell(row: list[str], column: int) -> str:
    """A cell; trailing ones may be missing."""
    return row[column].strip() if column < len(row) else ""


def _is_number(text: str) -> bool:
    try:
        return isfinite(float(text))
    except ValueError:
        return False


def write_motive_csv(
    path: str | PathLike[str], capture: MotionCapture, *, axes: str = "z_up", overwrite: bool = False
) -> None:
    """Save a capture, such as one that was recorded live, as Motive exports takes.

    Positions and quaternions have nine digits after the point, times six.

    Parameters
    ----------
    path : path
        Of the file.
    capture : MotionCapture
    axes : "z_up", "z_up_world" or "unchanged"
        Axes of the capture and of the later reading, see `read_motive_csv`.
    overwrite : bool
        Replace a file that is there.

    See Also
    --------
    adapters.optitrack.read_motive_csv : The way back.
    adapters.optitrack.MotionCaptureClient.record : A capture from a live stream.

    Examples
    --------
    >>> track = np.array([[2.0, 0.0, 1.0], [1.9, 0.0, 1.0], [1.8, 0.0, 1.0]])
    >>> ball = rc.adapters.optitrack.CapturedBody(track, np.tile([1.0, 0.0, 0.0, 0.0], (3, 1)), np.full(3, 1e-4))
    >>> capture = rc.adapters.optitrack.MotionCapture(np.array([0.0, 0.1, 0.2]), {"ball": ball})
    >>> rc.adapters.optitrack.write_motive_csv("walk.csv", capture)
    >>> rc.adapters.optitrack.read_motive_csv("walk.csv").names
    ('ball',)
    """
    check.choice("axes", axes, AXES)
    file = Path(path)
    check_file(file, overwrite=overwrite, kind=".csv")
    columns: list[tuple[str, str, str, str, Array]] = []

    def add(kind: str, name: str, quantity: str, letters: Iterable[str], values: Array) -> None:
        columns.extend((kind, name, quantity, *one) for one in zip(letters, values.T, strict=True))

    for name, body in capture.bodies.items():
        xyzw = np.roll(motive_quaternions(body.quaternion, axes), -1, axis=1)
        add("Rigid Body", name, "Rotation", "XYZW", xyzw)
        add("Rigid Body", name, "Position", "XYZ", motive_positions(body.position, axes))
        add("Rigid Body", name, "Mean Marker Error", [""], body.mean_marker_error[:, None])
    for kind, markers in (("Rigid Body Marker", capture.body_markers), ("Marker", capture.markers)):
        for name, places in markers.items():
            add(kind, name, "Position", "XYZ", motive_positions(places, axes))
    kinds, names, quantities, letters = ([column[k] for column in columns] for k in range(4))
    ids = [f"{1 + names.index(name):X}" for name in names]
    rate = {} if capture.frame_rate is None else {"Export Frame Rate": f"{capture.frame_rate:.6f}"}
    first = {
        "Format Version": "1.23",
        "Take Name": capture.take,
        **rate,
        "Capture Start Time": capture.start_time,
        "Total Exported Frames": str(len(capture)),
        "Rotation Type": "Quaternion",
        "Length Units": "Meters",
        "Coordinate Space": "Global",
    }
    with (
        new_file(file, overwrite=overwrite, kind=".csv") as part,
        part.open("w", encoding="utf-8", newline="") as stream,
    ):
        lines = csv.writer(stream)
        lines.writerow([cell for pair in first.items() for cell in pair])
        lines.writerow([])
        for label, cells in (("Type", kinds), ("Name", names), ("ID", ids), ("", quantities)):
            lines.writerow(["", label, *cells])
        lines.writerow(["Frame", "Time (Seconds)", *letters])
        for k, time in enumerate(capture.time):
            row = [column[4][k] for column in columns]
            lines.writerow([k, f"{time:.6f}", *("" if np.isnan(value) else f"{value:.9f}" for value in row)])
