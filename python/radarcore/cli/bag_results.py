"""Detections, maps and samples of a recording as messages in a ROS bag."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.frames import FrameWriter
from radarcore.adapters.ros.messages import nearest_nanoseconds
from radarcore.adapters.ros.scans import to_map_image, to_point_cloud, to_radar_scan
from radarcore.processing.detection.point_cloud import Detections
from radarcore.processing.spectra.spectra import range_doppler
from radarcore.radar.radar import Radar
from radarcore.recording.frame import Frame

_FRAME_ID = "radar"
_TOPIC = "/radar"


class ResultBag:
    """Writes what was found in frame after frame.

    ``/radar/scan`` (radar_msgs/RadarScan) and ``/radar/points`` (PointCloud2) are the detections, ``/radar/map`` is the
    range-velocity map [dB] of every radar that has one.

    Parameters
    ----------
    path : path
        Bag to make, its format by the suffix.
    radar : Radar
        Of the recording.
    source : dict
        Its origin; of one from a bag the stamps go on from that one's.
    with_samples : bool
        Write the frames as well.
    overwrite : bool
    files : ExitStack
        Finishes the bag.
    """

    def __init__(
        self,
        path: Path,
        radar: Radar,
        source: dict[str, Any],
        *,
        with_samples: bool,
        overwrite: bool,
        files: ExitStack,
    ) -> None:
        origin = source.get("bag")
        self._start_ns = int(origin.get("start_ns", 0)) if isinstance(origin, dict) else 0
        self._bag = files.enter_context(BagWriter(path, overwrite=overwrite))
        self._frames = FrameWriter(self._bag, radar, source=source, start_ns=self._start_ns) if with_samples else None
        for name, kind in (("scan", "radar_msgs/msg/RadarScan"), ("points", "sensor_msgs/msg/PointCloud2")):
            self._bag.add_topic(f"{_TOPIC}/{name}", kind)

    def write(self, frame: Frame, part: Frame, found: Detections) -> None:
        """Write a frame, and what was found in it or in the sub-sequence `part` of it."""
        if self._frames is not None:
            self._frames.append(frame)
        stamp = self._start_ns + nearest_nanoseconds(found.time)
        options: dict[str, Any] = {"frame_id": _FRAME_ID, "time_ns": stamp, "types": self._bag.types}
        if _has_map(part.radar):
            power = (np.abs(range_doppler(part)) ** 2).sum(axis=0)
            values = 10.0 * np.log10(np.maximum(power, np.finfo(np.float32).tiny))
            self._bag.write(f"{_TOPIC}/map", to_map_image(values, **options), stamp)
        self._bag.write(f"{_TOPIC}/scan", to_radar_scan(found, **options), stamp)
        self._bag.write(f"{_TOPIC}/points", to_point_cloud(found, **options), stamp)


def _has_map(radar: Radar) -> bool:
    waveform = radar.waveform
    return not waveform.is_cw and waveform.num_chirps > 1 and waveform.has_uniform_chirps
