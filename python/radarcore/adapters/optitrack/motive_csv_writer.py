"""Captures saved as CSV files in the format of Motive, version 1.23."""

from __future__ import annotations

import csv
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.adapters.optitrack.axes import AXES, motive_positions, motive_quaternions
from radarcore.adapters.optitrack.capture import MotionCapture
from radarcore.output import check_file, new_file

Array = NDArray[np.float64]

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
