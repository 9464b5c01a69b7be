"""Takes that Motive exports as CSV files, format versions 1.21 to 1.25."""

from __future__ import annotations

import csv
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterator
from dataclasses import dataclass
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
    columns: dict[str, int]
    """Index of the column by what it holds: ``Rotation X``, ``Position X``, ``error``."""


@dataclass(frozen=True)
class _Header:
    """Header of a take: settings and columns."""

    settings: dict[str, str]
    items: list[_Item]
    num_columns: int
    num_lines: int


def read_motive_csv(path: str | PathLike[str], *, axes: str = "z_up", length_unit: str | None = None) -> MotionCapture:
    """Read a take that Motive exported as CSV file.

    Frames without a body or a marker are NaN there. A file that ends too early is read up to there, with a warning;
    another warning names columns of types that are not read, such as force plates.

    Parameters
    ----------
    path : path
        Of the file; rotations must have been exported as quaternions, coordinates in the global space.
    axes : "z_up", "z_up_world" or "unchanged"
        In Motive y is up. ``"z_up"`` turns the axes of world and bodies alike, (x, -z, y) for (x, y, z), so that a body
        that is not turned in Motive is not turned; ``"z_up_world"`` turns those of the world alone; ``"unchanged"``
        leaves them.
    length_unit : "meters", "centimeters" or "millimeters", optional
        Of a file that does not say it.

    Raises
    ------
    ValueError
        When the file is no such export, has separators other than commas, Euler angles or no unit, or a line has
        something other than numbers.

    See Also
    --------
    adapters.optitrack.MotionCapture : What comes back.
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
    text = _text(file)
    rows = _rows(file, text)
    header = _header(file, rows)
    unit = _unit(file, header.settings, length_unit)
    frames = _frames(file, rows, header, is_ended=text.endswith(("\n", "\r")))

    bodies: dict[str, CapturedBody] = {}
    markers: dict[str, Array] = {}
    body_markers: dict[str, Array] = {}
    for item in header.items:
        position = positions_of(unit * _values(frames, item, "Position", "XYZ"), axes)
        if item.kind in _BODIES:
            quaternion = quaternions_of(_values(frames, item, "Rotation", "WXYZ"), axes)
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
        frame_rate=_rate(header.settings),
        start_time=header.settings.get("Capture Start Time", ""),
        take=header.settings.get("Take Name", ""),
    )


def _text(file: Path) -> str:
    """Text of a file, by its byte-order mark, with commas between its cells."""
    data = file.read_bytes()
    is_wide = data.startswith((BOM_UTF16_LE, BOM_UTF16_BE))
    text = data.decode("utf-16" if is_wide else "utf-8-sig", "replace")
    first = text.partition("\n")[0]
    if "\0" in first:
        raise ValueError(f"{file.name}: expected text in UTF-8, got zeros between letters: save it as UTF-8")
    for mark, name in ((";", "semicolons"), ("\t", "tabulators")):
        if first.startswith(f"Format Version{mark}"):
            raise ValueError(
                f"{file.name}: expected commas between cells and points in numbers, got {name}, as a spreadsheet saves "
                "them; take the file that Motive exported"
            )
    return text


def _rows(file: Path, text: str) -> Iterator[list[str]]:
    """Lines as cells."""
    try:
        yield from csv.reader(StringIO(text, newline=""))
    except csv.Error as error:
        raise ValueError(f"{file.name}: expected text in cells between commas, got something else ({error})") from None


def _header(file: Path, rows: Iterator[list[str]]) -> _Header:
    """Everything up to the line that begins with ``Frame``."""
    lines: list[list[str]] = []
    for row in rows:
        lines.append([cell.strip() for cell in row])
        if lines[-1] and lines[-1][0] == "Frame":
            break
    else:
        raise ValueError(
            f"{file.name}: expected a line that begins with 'Frame', got none: truncated, or not of Motive"
        )
    first = lines[0] or [""]
    settings = dict(zip(first[0::2], first[1::2], strict=False))
    if "Format Version" not in settings:
        raise ValueError(f"{file.name}: expected 'Format Version' in the first line, got {check.printable(first[0])!r}")
    rotation = settings.get("Rotation Type", "Quaternion")
    if rotation.lower() != "quaternion":
        raise ValueError(
            f"{file.name}: expected the Rotation Type Quaternion, got {rotation!r}; export the take with quaternions"
        )
    space = settings.get("Coordinate Space", "Global")
    if space.lower() not in ("global", "world"):
        raise ValueError(
            f"{file.name}: expected the Coordinate Space Global, got {space!r}; export the take in global ones"
        )
    above = [line for line in lines[1:-1] if any(line)]
    if len(above) < 2:
        raise ValueError(f"{file.name}: expected lines of types and names above 'Frame', got {len(above)}")
    kinds, names, ids = _labelled(file, above[:-1])
    items = list(_items(kinds, names, ids, above[-1], lines[-1]))
    others = {
        kind: _cell(names, column) for column, kind in enumerate(kinds) if column > 1 and kind not in {"", *_KINDS}
    }
    if others:
        text = ", ".join(f"{kind} ({name})" if name else kind for kind, name in others.items())
        notice.warn(f"{file.name}: expected types {', '.join(_KINDS)}; left out: {check.printable(text)}")
    for item in items:
        _check_columns(file, item)
    return _Header(settings, items, len(lines[-1]), len(lines))


def _labelled(file: Path, lines: list[list[str]]) -> list[list[str]]:
    """Lines of types, names and identities, by their labels; by their order where there are none."""
    labels = [line[1].lower() if len(line) > 1 else "" for line in lines]
    if not any(labels):
        labels = [*_LABELS, *("" for _ in lines)]
    found = dict(zip(labels, lines, strict=False))
    for label in ("type", "name"):
        if label not in found:
            raise ValueError(f"{file.name}: expected a line labelled {label.capitalize()!r}, got {labels}")
    return [found.get(label, []) for label in _LABELS]


def _items(
    kinds: list[str], names: list[str], ids: list[str], quantities: list[str], letters: list[str]
) -> Iterator[_Item]:
    """Bodies and markers, each with its columns, in the order of the file; other things are left out."""
    known: dict[tuple[str, str, str], _Item] = {}
    for column, kind in enumerate(kinds):
        if column < 2 or kind not in _KINDS:
            continue
        name, number, quantity, letter = (_cell(line, column) for line in (names, ids, quantities, letters))
        key = (kind, name, number)
        if key not in known:
            known[key] = _Item(kind, name, number, {})
        is_error = _ERRORS & {quantity.lower(), letter.lower()}
        known[key].columns["error" if is_error else f"{quantity} {letter}"] = column
    yield from known.values()


def _check_columns(file: Path, item: _Item) -> None:
    """Refuse bodies without a position and a quaternion, and markers without a position."""
    needed = [f"Position {letter}" for letter in "XYZ"]
    if item.kind in _BODIES:
        needed += [f"Rotation {letter}" for letter in "XYZW"]
    missing = [one for one in needed if one not in item.columns]
    if missing:
        advice = "; export the take with quaternions" if missing == ["Rotation W"] else ""
        raise ValueError(
            f"{file.name}: expected a column {missing[0]!r} of {item.kind} {item.name!r}, got none{advice}"
        )


def _unit(file: Path, settings: dict[str, str], given: str | None) -> float:
    """Unit of lengths [m]."""
    if given is not None:
        check.choice("length_unit", given, tuple(_UNITS))
    stated = settings.get("Length Units", "").lower()
    if not stated and given is None:
        raise ValueError(
            f"{file.name}: expected 'Length Units' in the first line, got none; "
            f"give length_unit='meters', 'centimeters' or 'millimeters'"
        )
    if stated and stated not in _UNITS:
        raise ValueError(f"{file.name}: expected Length Units Meters, Centimeters or Millimeters, got {stated!r}")
    if stated and given is not None and stated != given:
        raise ValueError(f"length_unit: expected {stated!r}, as the file says, got {given!r}")
    return _UNITS[stated or str(given)]


def _frames(file: Path, rows: Iterator[list[str]], header: _Header, *, is_ended: bool) -> Array:
    """Numbers (frame, column) of all whole lines below the header; NaN where there are none."""
    lines = [row for row in rows if any(row)]
    expected = _announced(header.settings)
    # A last line without an end, in a file with too few lines or itself with too few cells, is cut within a number.
    is_short = expected is not None and len(lines) < expected
    is_cut = bool(lines) and not is_ended and (is_short or len(lines[-1]) < header.num_columns)
    if is_cut:
        lines.pop()
    if not lines:
        raise ValueError(f"{file.name}: expected frames below the line 'Frame', got none")
    wanted = sorted({0, 1, *(column for item in header.items for column in item.columns.values())})
    frames = np.full((len(lines), header.num_columns), np.nan)
    for k, row in enumerate(lines):
        frames[k, wanted] = _numbers(f"{file.name}, line {header.num_lines + k + 1}", row, wanted)
    if is_short or is_cut:
        count = "whole lines" if expected is None else f"{expected} frames"
        notice.warn(f"{file.name}: expected {count}, got {len(lines)}: the file is truncated after {frames[-1, 1]:g} s")
    return frames


def _numbers(place: str, row: list[str], wanted: list[int]) -> list[float]:
    """Numbers of a line in some columns, NaN for empty cells."""
    cells = [_cell(row, column) for column in wanted]
    for cell in cells:
        if cell and not _is_number(cell):
            raise ValueError(f"{place}: expected numbers, got {check.printable(cell)!r}")
    if not cells[1]:
        raise ValueError(f"{place}: expected a time in the second cell, got none")
    return [float(cell) if cell else np.nan for cell in cells]


def _announced(settings: dict[str, str]) -> int | None:
    """Number of frames that the first line says."""
    text = settings.get("Total Exported Frames", "")
    return int(text) if text.isdecimal() else None


def _rate(settings: dict[str, str]) -> float | None:
    """Frames per second, of the export if it says them."""
    for name in ("Export Frame Rate", "Capture Frame Rate"):
        if _is_number(text := settings.get(name, "")):
            return float(text)
    return None


def _values(frames: Array, item: _Item, quantity: str, letters: str) -> Array:
    """Values of a body or marker, (n, letters)."""
    return frames[:, [item.columns[f"{quantity} {letter}"] for letter in letters]]


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


_XYZ = ["Position"] * 3, ["X", "Y", "Z"]


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
        Those with which the capture was made and the file will be read, see `read_motive_csv`.
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
    kinds, names, quantities, letters = [], [], [], []
    columns: list[Array] = []

    def add(kind: str, name: str, heads: tuple[list[str], list[str]], values: Array) -> None:
        kinds.extend([kind] * len(heads[0]))
        names.extend([name] * len(heads[0]))
        quantities.extend(heads[0])
        letters.extend(heads[1])
        columns.append(values)

    for name, body in capture.bodies.items():
        turned = motive_quaternions(body.quaternion, axes)[:, [1, 2, 3, 0]]
        add("Rigid Body", name, (["Rotation"] * 4, ["X", "Y", "Z", "W"]), turned)
        add("Rigid Body", name, _XYZ, motive_positions(body.position, axes))
        add("Rigid Body", name, (["Mean Marker Error"], [""]), body.mean_marker_error[:, None])
    for kind, markers in (("Rigid Body Marker", capture.body_markers), ("Marker", capture.markers)):
        for name, places in markers.items():
            add(kind, name, _XYZ, motive_positions(places, axes))
    first = {"Format Version": "1.23", "Take Name": capture.take, "Take Notes": ""}
    if capture.frame_rate is not None:
        first |= dict.fromkeys(["Capture Frame Rate", "Export Frame Rate"], f"{capture.frame_rate:.6f}")
    first |= {"Capture Start Time": capture.start_time}
    first |= dict.fromkeys(["Total Frames in Take", "Total Exported Frames"], str(len(capture)))
    first |= {"Rotation Type": "Quaternion", "Length Units": "Meters", "Coordinate Space": "Global"}
    values = np.column_stack(columns) if columns else np.zeros((len(capture), 0))
    with (
        new_file(file, overwrite=overwrite, kind=".csv") as part,
        part.open("w", encoding="utf-8", newline="") as stream,
    ):
        lines = csv.writer(stream)
        lines.writerow([cell for pair in first.items() for cell in pair])
        lines.writerow([])
        ids = [f"{1 + names.index(name):X}" for name in names]
        for label, cells in (("Type", kinds), ("Name", names), ("ID", ids), ("", quantities)):
            lines.writerow(["", label, *cells])
        lines.writerow(["Frame", "Time (Seconds)", *letters])
        for k, (time, row) in enumerate(zip(capture.time, values, strict=True)):
            lines.writerow([k, f"{time:.6f}", *("" if np.isnan(value) else f"{value:.9f}" for value in row)])
