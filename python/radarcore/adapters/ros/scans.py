"""Detections to and from ``radar_msgs/RadarScan`` and ``sensor_msgs/PointCloud2``; maps to and from images.

Frames follow the radar: x forward, y left, z up (REP 103), angles positive to the left and up. Velocities are
range rates, receding positive; neither message says so itself, and other publishers may mean the opposite.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.adapters.depth import unpacked
from radarcore.adapters.ros.messages import Types, checked_frame_id, header, header_nanoseconds, make, seconds
from radarcore.processing.detection.point_cloud import Detections

_FIELDS = ("x", "y", "z", "velocity", "intensity")
"""Columns of a point cloud, float32 each."""

_POINT_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""sensor_msgs/PointField: datatype."""

_FLOAT32 = 7


def to_radar_scan(
    detections: Detections, *, frame_id: str = "radar", time_ns: int | None = None, types: Types = None
) -> Any:
    """Detections as a ``radar_msgs/RadarScan``; the signal-to-noise ratio is the amplitude [dB].

    An unknown elevation is 0, as the message defines it for 2D radars; other unknown values are NaN.

    Parameters
    ----------
    detections : Detections
    frame_id : str
        Frame of the radar.
    time_ns : int, optional
        Stamp [ns]; default: the middle of the frame of the detections, to the nearest nanosecond.
    types : optional
        Types of messages, see `radarcore.adapters.ros.messages`.

    See Also
    --------
    adapters.ros.from_radar_scan : The way back.
    adapters.ros.to_point_cloud : Points in place of ranges and angles.

    Examples
    --------
    >>> found = rc.Detections([2.0], [-0.5], [0.25], [0.0], [20.0])
    >>> message = rc.adapters.ros.to_radar_scan(found)
    >>> message.returns[0].range, message.returns[0].doppler_velocity
    (2.0, -0.5)
    """
    name = "radar_msgs/msg/RadarReturn"
    elevation = np.nan_to_num(detections.elevation)
    columns = (detections.range, detections.azimuth, elevation, detections.velocity, detections.snr_db)
    rows = np.stack(columns, axis=-1).astype(np.float32).tolist()
    fields = ("range", "azimuth", "elevation", "doppler_velocity", "amplitude")
    returns = [make(types, name, **dict(zip(fields, row, strict=True))) for row in rows]
    stamped = header(detections.time, time_ns, checked_frame_id(frame_id), types)
    return make(types, "radar_msgs/msg/RadarScan", header=stamped, returns=returns)


def from_radar_scan(
    message: Any, *, approaching_positive: bool = False, has_elevation: bool = True, start_ns: int = 0
) -> Detections:
    """Detections of a ``radar_msgs/RadarScan``, by increasing range.

    Ranges that are infinite or NaN are no detections (REP 117). Early drafts of the message, which call their returns
    `points`, have azimuths positive to the right, and an intensity without a unit in the place of decibels.

    Parameters
    ----------
    message : radar_msgs/RadarScan
        Anything with its fields.
    approaching_positive : bool
        The publisher's velocities are positive for approaching targets.
    has_elevation : bool
        False for a 2D radar: its elevations, all 0, are unknown.
    start_ns : int
        Stamp that counts as time 0 [ns].

    See Also
    --------
    adapters.ros.to_radar_scan : The way back.
    Tracker.update : Tracks from detections.

    Examples
    --------
    >>> found = rc.Detections([2.0], [-0.5], [0.25], [0.0], [20.0])
    >>> again = rc.adapters.ros.from_radar_scan(rc.adapters.ros.to_radar_scan(found))
    >>> again.range.tolist(), again.azimuth.tolist()
    ([2.0], [0.25])
    """
    is_draft = not hasattr(message, "returns")
    entries = message.points if is_draft else message.returns
    right = ("angle", "azimuth") if is_draft else ("azimuth",)
    rows = [
        [
            entry.range,
            _first(entry, "doppler_velocity", "doppler"),
            _first(entry, *right),
            entry.elevation if has_elevation else np.nan,
            _first(entry, "amplitude", "intensity"),
        ]
        for entry in entries
    ]
    columns = np.array(rows, dtype=np.float64).reshape(-1, 5).T
    columns[2] *= -1.0 if is_draft else 1.0
    return _detections(columns, message, approaching_positive, start_ns)


def to_point_cloud(
    detections: Detections, *, frame_id: str = "radar", time_ns: int | None = None, types: Types = None
) -> Any:
    """Detections as a ``sensor_msgs/PointCloud2`` with x, y, z [m], velocity [m/s] and intensity [dB], float32 each.

    An unknown elevation is 0; points of an unknown azimuth are NaN. Parameters as in `to_radar_scan`.

    See Also
    --------
    adapters.ros.from_point_cloud : The way back.
    adapters.ros.to_radar_scan : Ranges and angles in place of points.
    detect : Detections of a frame.

    Examples
    --------
    >>> found = rc.Detections([2.0], [-0.5], [0.25], [0.0], [20.0])
    >>> message = rc.adapters.ros.to_point_cloud(found)
    >>> [field.name for field in message.fields], message.width
    (['x', 'y', 'z', 'velocity', 'intensity'], 1)
    """
    points = np.empty(len(detections), [(name, "<f4") for name in _FIELDS])
    for name, values in zip(_FIELDS, (*detections.position.T, detections.velocity, detections.snr_db), strict=True):
        points[name] = values
    step = points.itemsize
    fields = [
        make(types, "sensor_msgs/msg/PointField", name=name, offset=4 * k, datatype=_FLOAT32, count=1)
        for k, name in enumerate(_FIELDS)
    ]
    return make(
        types,
        "sensor_msgs/msg/PointCloud2",
        header=header(detections.time, time_ns, checked_frame_id(frame_id), types),
        height=1,
        width=len(points),
        fields=fields,
        is_bigendian=False,
        point_step=step,
        row_step=step * len(points),
        data=points.view(np.uint8) if len(points) else np.empty(0, np.uint8),
        is_dense=bool(all(np.isfinite(points[name]).all() for name in _FIELDS)),
    )


def from_point_cloud(
    message: Any,
    *,
    velocity: str | None = "velocity",
    intensity: str | None = "intensity",
    approaching_positive: bool = False,
    start_ns: int = 0,
) -> Detections:
    """Detections of a ``sensor_msgs/PointCloud2`` in the frame of a radar, by increasing range.

    Points that are not finite are left out.

    Parameters
    ----------
    message : sensor_msgs/PointCloud2
        Anything with its fields; any layout.
    velocity, intensity : str or None
        Fields with the range rate [m/s] and the signal-to-noise ratio [dB]; None: unknown.
    approaching_positive : bool
        The publisher's velocities are positive for approaching targets.
    start_ns : int
        Stamp that counts as time 0 [ns].

    See Also
    --------
    adapters.ros.to_point_cloud : The way back.
    Tracker.update : Tracks from detections.

    Examples
    --------
    >>> found = rc.Detections([2.0], [-0.5], [0.25], [0.0], [20.0])
    >>> again = rc.adapters.ros.from_point_cloud(rc.adapters.ros.to_point_cloud(found))
    >>> again.range.round(3).tolist(), again.azimuth.round(3).tolist()
    ([2.0], [0.25])
    """
    x, y, z = (_column(message, "fields", name) for name in "xyz")
    rates, strengths = (
        np.full(len(x), np.nan) if name is None else _column(message, argument, name)
        for argument, name in (("velocity", velocity), ("intensity", intensity))
    )
    across = np.hypot(x, y)
    columns = np.stack([np.hypot(across, z), rates, np.arctan2(y, x), np.arctan2(z, across), strengths])
    return _detections(columns, message, approaching_positive, start_ns)


def _detections(columns: NDArray[np.float64], message: Any, approaching_positive: bool, start_ns: int) -> Detections:
    """Detections with a range, from columns (range, velocity, azimuth, elevation, snr_db)."""
    time_ns = header_nanoseconds(message)
    if approaching_positive:
        columns[1] *= -1.0
    kept = columns[:, np.isfinite(columns[0])]
    kept = kept[:, np.argsort(kept[0], kind="stable")]
    time = 0.0 if time_ns is None else seconds(time_ns, start_ns)
    distance, velocity, azimuth, elevation, snr_db = kept
    return Detections(distance, velocity, azimuth, elevation, snr_db, time=time)


def _first(entry: Any, *names: str) -> Any:
    """First field that an entry has, NaN if none."""
    return next((getattr(entry, name) for name in names if hasattr(entry, name)), np.nan)


def _column(message: Any, argument: str, name: str) -> NDArray[np.float64]:
    """Numbers of a field of a point cloud, point by point."""
    fields = {field.name: field for field in message.fields}
    if name not in fields:
        raise ValueError(f"{argument}: expected a field {name!r} of the point cloud, got {', '.join(fields) or 'none'}")
    field = fields[name]
    if field.datatype not in _POINT_TYPES:
        raise ValueError(f"datatype: expected 1 to 8, as of sensor_msgs/PointField, got {field.datatype} of {name!r}")
    rows, columns = (check.count(side, int(getattr(message, side)), 0) for side in ("height", "width"))
    if rows * columns == 0:
        return np.empty(0)
    kind = (">" if message.is_bigendian else "<") + _POINT_TYPES[field.datatype]
    if field.offset + np.dtype(kind).itemsize > message.point_step:
        raise ValueError(f"point_step: expected room for {name!r} at {field.offset}, got {message.point_step} bytes")
    layout = np.dtype({"names": [name], "formats": [kind], "offsets": [field.offset], "itemsize": message.point_step})
    points = unpacked("data", message.data, layout, rows, columns, int(message.row_step))
    return points[name].ravel().astype(np.float64)


def to_map_image(values: ArrayLike, *, time_ns: int, frame_id: str = "radar", types: Types = None) -> Any:
    """Range-velocity map as a ``sensor_msgs/Image``, 32FC1: a row per velocity, the lowest on top, a column per range.

    Parameters
    ----------
    values : (doppler, range) array_like
        Real numbers, such as decibels; of `radarcore.range_doppler` its absolute value.
    time_ns : int
        Stamp [ns].
    frame_id : str
        Frame of the radar.
    types : optional
        Types of messages, see `radarcore.adapters.ros.messages`.

    See Also
    --------
    adapters.ros.from_map_image : The way back.
    range_doppler : The map.

    Examples
    --------
    >>> frame = rc.Simulator(rc.Scene([rc.PointTarget([2.0, 0.0, 0.0])]), rc.bgt60tr13c(num_chirps=4)).frame()
    >>> level = 20.0 * np.log10(np.abs(rc.range_doppler(frame)[0]))
    >>> message = rc.adapters.ros.to_map_image(level, time_ns=0)
    >>> message.encoding, message.height, message.width
    ('32FC1', 4, 65)
    """
    given = np.asarray(values)
    if given.dtype.kind not in "fiu":
        raise TypeError(f"values: expected real numbers (np.abs of a spectrum), got {given.dtype}")
    if given.ndim != 2 or given.size == 0:
        raise ValueError(f"values: expected shape (doppler, range), got {given.shape}")
    pixels = np.ascontiguousarray(given, dtype="<f4")
    rows, columns = pixels.shape
    return make(
        types,
        "sensor_msgs/msg/Image",
        header=header(None, time_ns, frame_id, types),
        height=rows,
        width=columns,
        encoding="32FC1",
        is_bigendian=0,
        step=4 * columns,
        data=pixels.view(np.uint8).ravel(),
    )


def from_map_image(message: Any) -> NDArray[np.float32]:
    """Range-velocity map of a ``sensor_msgs/Image``, 32FC1: (doppler, range).

    See Also
    --------
    adapters.ros.to_map_image : The way back.

    Examples
    --------
    >>> message = rc.adapters.ros.to_map_image([[1.0, 2.0], [3.0, 4.0]], time_ns=0)
    >>> rc.adapters.ros.from_map_image(message).tolist()
    [[1.0, 2.0], [3.0, 4.0]]
    """
    if message.encoding != "32FC1":
        raise ValueError(f"encoding: expected 32FC1, got {message.encoding!r}")
    rows, columns = check.count("height", message.height), check.count("width", message.width)
    kind = ">f4" if message.is_bigendian else "<f4"
    values = unpacked("data", message.data, kind, rows, columns, int(message.step))
    return values.astype(np.float32)
