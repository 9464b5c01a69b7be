"""CSV files as Motive exports them, of known motions: made without the reader and its conversions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import radarcore as rc

# Motive's axes x, y, z are radarcore's x, z, -y.
TO_MOTIVE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
UNITS = {"Meters": 1.0, "Centimeters": 100.0, "Millimeters": 1000.0}
MARKERS = np.array([[0.05, 0.0, 0.02], [-0.03, 0.04, 0.0], [0.0, -0.06, 0.01]])
"""Markers of every body, in its own axes [m]."""


def motive_file(
    path: Path,
    bodies: Mapping[str, Callable[[float], rc.Pose]],
    times: NDArray[np.float64],
    *,
    version: str = "1.23",
    unit: str | None = "Meters",
    hidden: Mapping[str, Sequence[int]] | None = None,
    time_code: bool = False,
    parent: bool = False,
    kind: str = "Rigid Body",
    keep_trailing: bool = True,
    first_frame: int = 0,
    **settings: str | None,
) -> Path:
    """Write a take of some bodies, their markers and an unlabelled marker; those hidden have empty cells."""
    old = version == "1.21"
    first = {"Format Version": version, "Take Name": "t1"}
    if not old:
        first |= {"Take Notes": ""}
    rate = f"{1.0 / (times[1] - times[0]):.6f}"
    first |= {"Capture Frame Rate": rate, "Export Frame Rate": rate}
    first |= {"Capture Start Time": "2019-09-18 04.30.02.695 PM"}
    if version in ("1.24", "1.25"):
        first |= {"Capture Start Frame": str(first_frame)}
    first |= {"Total Frames in Take": str(len(times)), "Total Exported Frames": str(len(times))}
    first |= {"Rotation Type": "Quaternion"}
    if unit is not None:
        first |= {"Length Units": unit}
    first |= {"Coordinate Space": "Global"}
    first |= {name.replace("_", " "): value for name, value in settings.items() if value is not None}
    for name in [name.replace("_", " ") for name, value in settings.items() if value is None]:
        del first[name]

    # One column of five header cells and a value per time each.
    scale = UNITS[unit or "Meters"]
    quality = "Error Per Marker" if old else "Mean Marker Error"
    columns: list[tuple[list[str], list[str]]] = []
    for name, motion in bodies.items():
        lost = set(() if hidden is None else hidden.get(name, ()))
        poses = [motion(float(t)) for t in times]
        positions = scale * np.array([TO_MOTIVE @ pose.position for pose in poses])
        quaternions = Rotation.from_matrix([TO_MOTIVE @ pose.rotation @ TO_MOTIVE.T for pose in poses]).as_quat()

        def add(head: list[str], values: NDArray[np.float64], lost: set[int] = lost) -> None:
            cells = ["" if k in lost else f"{value:.9f}" for k, value in enumerate(values)]
            columns.append((head, cells))

        body = [kind, name, f"4CF0{len(columns):04X}", "Root"]
        for axis, values in zip("XYZW", quaternions.T, strict=True):
            add([*body, "Rotation", axis], values)
        for axis, values in zip("XYZ", positions.T, strict=True):
            add([*body, "Position", axis], values)
        add([*body, quality, ""], np.full(len(times), 0.000214 * scale))
        for number, marker in enumerate(MARKERS, 1):
            label = f"{name}_{number}" if old else f"{name}:Marker{number}"
            head = [f"{kind} Marker", label, f"77{len(columns):04X}", name]
            seen = scale * np.array([TO_MOTIVE @ pose.apply(marker) for pose in poses])
            for axis, values in zip("XYZ", seen.T, strict=True):
                add([*head, "Position", axis], values)
            add([*head, "Marker Quality", ""], np.ones(len(times)))
    for axis, value in zip("XYZ", scale * (TO_MOTIVE @ [1.0, 2.0, 3.0]), strict=True):
        columns.append((["Marker", "Unlabeled 1189", "99", "", "Position", axis], [f"{value:.6f}"] * len(times)))

    lead = [""] if time_code else []
    labels = [""] * 3 if old else ["Type", "Name", "ID"]
    lines = [",".join(f"{name},{value}" for name, value in first.items()), ""]
    for number, label in enumerate(labels):
        cells = [f'"{head[number]}"' if number == 2 else head[number] for head, _ in columns]
        lines.append(",".join(["", label, *lead, *cells]))
    if parent:
        lines.append(",".join(["", "Parent", *lead, *(head[3] for head, _ in columns)]))
    lines.append(",".join(["", "", *lead, *(head[4] for head, _ in columns)]))
    names = ["Frame", "Time" if old else "Time (Seconds)", *(["TimeCode"] if time_code else [])]
    lines.append(",".join([*names, *(head[5] for head, _ in columns)]))
    for k, t in enumerate(times):
        stamp = [f"15:26:46:{k:02d}.02"] if time_code else []
        line = ",".join([str(first_frame + k), f"{t:.6f}", *stamp, *(cells[k] for _, cells in columns)])
        lines.append(line if keep_trailing else line.rstrip(","))
    path.write_bytes("".join(f"{line}\r\n" for line in lines).encode())
    return path
