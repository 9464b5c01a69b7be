"""Depth images of ROS 1 and ROS 2, their cameras, and the images of a bag that belong to a radar's frames."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from itertools import chain
from math import inf
from typing import Any, NamedTuple

import numpy as np

from radarcore import check, notice
from radarcore.adapters.depth import PlanarDepth, decoded, radar_in_camera, unpacked
from radarcore.adapters.ros.bags import BagReader
from radarcore.adapters.ros.messages import header_nanoseconds, seconds
from radarcore.adapters.ros.motions import IMAGES, first_stamp_ns
from radarcore.geometry.camera import Camera

_ENCODINGS = {"32FC1": ("f4", 1.0), "16UC1": ("u2", 1e-3)}
"""Numbers of an encoding, and the metres that are one of them (REP 118)."""


def from_ros_image(
    message: Any,
    *,
    camera: Camera | tuple[float, float] | None = None,
    camera_info: Any = None,
    frame: str = "optical",
    start_ns: int = 0,
) -> PlanarDepth:
    """Depth of a ROS 1 or ROS 2 ``sensor_msgs/Image``: 32FC1 in metres or 16UC1 in millimetres, top row first.

    Infinities of both signs and NaN (REP 117), and 0, are nothing. Whole millimetres are warned of: they are useless
    for phases.

    Parameters
    ----------
    message : sensor_msgs/Image
        Anything with its fields.
    camera : Camera or (float, float), optional
        Or the horizontal and vertical field of view [degrees]; to be preferred where they are known.
    camera_info : sensor_msgs/CameraInfo, optional
        In place of `camera`, see `from_camera_info`. Publishers differ in the principal point by half a pixel, 0.13
        degrees at 256 pixels and 60 degrees.
    frame : {"optical", "link"}
        Axes of the frame that the header names: an optical one (REP 103), or, for images bridged by
        ``ros_gz`` from Gazebo without ``optical_frame_id``, the link, x forward.
    start_ns : int
        Stamp that counts as time 0 [ns].

    See Also
    --------
    adapters.ros.from_camera_info : Camera of the image.
    adapters.ros.DepthImages : Images of a bag.
    frame_from_depth : Frame from the image.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> pixels = np.full((48, 64), 2.0, np.float32)
    >>> layout = {"height": 48, "width": 64, "encoding": "32FC1", "is_bigendian": 0, "step": 256}
    >>> message = SimpleNamespace(data=pixels.tobytes(), **layout)
    >>> image = rc.adapters.ros.from_ros_image(message, camera=(60.0, 47.0))
    >>> print(image.depth.shape, image.depth[0, 0])
    (48, 64) 2.0
    """
    if message.encoding not in _ENCODINGS:
        raise ValueError(f"encoding: expected 32FC1 or 16UC1, got {message.encoding!r}")
    axes = radar_in_camera(check.choice("frame", frame, ("optical", "link"))).rotation
    kind, unit = _ENCODINGS[message.encoding]
    rows, columns = check.count("height", message.height), check.count("width", message.width)
    order = ">" if message.is_bigendian else "<"
    metres = unit * unpacked("data", message.data, order + kind, rows, columns, int(message.step)).astype(np.float64)
    if camera is not None and camera_info is not None:
        raise ValueError("camera: expected either camera or camera_info, got both")
    if camera_info is not None:
        check_size(camera_info, message)
        camera = from_camera_info(camera_info)
    elif camera is None:
        raise ValueError("camera: expected either camera or camera_info, got neither")
    elif not isinstance(camera, Camera):
        camera = Camera.from_field_of_view(camera, rows, columns)
    if message.encoding == "16UC1":
        notice.warn(
            "encoding: 16UC1 has whole millimetres, 42 degrees of phase (rms) at 60 GHz and 53 at 77 GHz: good for "
            "range profiles alone; 32FC1 keeps the phase"
        )
    time_ns = header_nanoseconds(message)
    time = None if time_ns is None else seconds(time_ns, start_ns)
    frame_id = getattr(getattr(message, "header", None), "frame_id", None)
    return decoded(metres, np.inf, camera, axes, time, frame_id or None)


def from_camera_info(message: Any, *, centered: bool = False, rectified: bool = False) -> Camera:
    """Camera of a ROS 1 or ROS 2 ``sensor_msgs/CameraInfo``, of the image as it is sent: binned, and its window alone.

    Parameters
    ----------
    message : sensor_msgs/CameraInfo
        Its K and P count pixel centres at whole numbers, `Camera` at halves.
    centered : bool
        The principal point is the middle of the whole image, whatever the message says: simulators are seen to send
        (W - 1)/2, W/2 and (W + 1)/2 for it.
    rectified : bool
        The image is a rectified one: P counts, not K. Images that are not are warned of if there is a distortion.

    See Also
    --------
    Camera : The result.
    adapters.ros.from_ros_image : Takes the message as `camera_info`.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> k = [500.0, 0.0, 319.5, 0.0, 500.0, 239.5, 0.0, 0.0, 1.0]
    >>> rc.adapters.ros.from_camera_info(SimpleNamespace(width=640, height=480, k=k, d=[], p=[0.0] * 12))
    Camera(fx=500.0, fy=500.0, cx=320.0, cy=240.0)
    """
    name, size, places = ("p", 12, (0, 5, 2, 6)) if rectified else ("k", 9, (0, 4, 2, 5))
    matrix = check.array("camera_info", _field(message, name), (size,))
    if not rectified and any(_field(message, "d")):
        notice.warn("camera_info: its distortion is not undone; send rectified images (rectified=True)")
    fx, fy, cx, cy = (float(matrix[place]) for place in places)
    if not (fx > 0.0 and fy > 0.0):
        raise ValueError(f"camera_info: expected focal lengths in {name.upper()}, got {fx:g} and {fy:g}: uncalibrated")

    x, y = (0.5 * message.width, 0.5 * message.height) if centered else (cx + 0.5, cy + 0.5)
    # The window is cut out first, then several pixels become one.
    window = getattr(message, "roi", None)
    left, top = (getattr(window, edge, 0) for edge in ("x_offset", "y_offset"))
    across, down = (max(int(getattr(message, name, 1)), 1) for name in ("binning_x", "binning_y"))
    return Camera(fx / across, fy / down, (x - left) / across, (y - top) / down)


def check_size(camera_info: Any, image: Any) -> None:
    """Refuse a camera whose images have another size; zeros say nothing."""
    window = getattr(camera_info, "roi", None)
    stated = []
    for side, axis in (("width", "x"), ("height", "y")):
        whole = int(getattr(window, side, 0)) or int(getattr(camera_info, side, 0))
        stated.append(whole // max(int(getattr(camera_info, f"binning_{axis}", 1)), 1))
    size = [int(image.width), int(image.height)]
    if all(stated) and stated != size:
        raise ValueError(
            f"camera_info: expected a camera of {size[0]} x {size[1]} pixels, got one of {stated[0]} x {stated[1]}"
        )


def _field(message: Any, name: str) -> Any:
    """Field of a camera's message: ROS 2 has small letters, ROS 1 large ones."""
    return np.asarray(getattr(message, name, getattr(message, name.upper(), ())))


_CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
_FEW, _UNEVEN = 3, 0.4
"""More images than this are uneven if the shortest interval is below this share of the mean. Half may be lost."""

_LAST = 1e-6
"""Time after the last image at which a frame may still start [s]."""


class DepthImages:
    """Depth images of a bag, decoded on access.

    Parameters
    ----------
    bag : BagReader
    topic : str, optional
        Default: the only topic with depth images.
    info_topic : str, optional
        Of ``sensor_msgs/CameraInfo``; default: ``camera_info`` beside the images, or the only topic of that type.
    camera : Camera or (float, float), optional
        Camera, or its horizontal and vertical field of view [degrees], in place of `info_topic`.
    start_ns : int, optional
        Stamp of time 0 [ns]; default: the first stamp in the header of a message, see `first_stamp_ns`.

    Attributes
    ----------
    topic : str
    start_ns : int

    Raises
    ------
    ValueError
        When the bag has no depth images, or nothing says what camera they are from: names the topics that there are.

    See Also
    --------
    adapters.ros.frame_images : Images for every frame.
    adapters.ros.from_ros_image : One message.
    frame_from_depth : Frame from an image.

    Examples
    --------
    >>> with rc.adapters.ros.BagWriter("depth") as bag:
    ...     for k in range(3):
    ...         image = rc.adapters.ros.to_map_image(np.full((4, 6), 2.0 - 0.1 * k), time_ns=k * 10**8, types=bag.types)
    ...         bag.write("/camera/depth", image, time_ns=k * 10**8)
    >>> with rc.adapters.ros.BagReader("depth") as bag:
    ...     images = rc.adapters.ros.DepthImages(bag, camera=(60.0, 45.0))
    ...     for image in images:
    ...         print(f"{image.time:.1f} s: {image.depth[0, 0]:.1f} m")
    0.0 s: 2.0 m
    0.1 s: 1.9 m
    0.2 s: 1.8 m
    """

    def __init__(
        self,
        bag: BagReader,
        topic: str | None = None,
        *,
        info_topic: str | None = None,
        camera: Camera | tuple[float, float] | None = None,
        start_ns: int | None = None,
    ) -> None:
        self._bag = bag
        self.topic: str = _depth_topic(bag, topic)
        if camera is not None and info_topic is not None:
            raise ValueError(f"info_topic: expected none together with a camera, got {info_topic!r}")
        self._camera = _camera_of(bag, self.topic, info_topic) if camera is None else camera
        self.start_ns: int = first_stamp_ns(bag) if start_ns is None else int(start_ns)

    def __len__(self) -> int:
        """Number of images."""
        return self._bag.topics[self.topic].num_messages

    def __iter__(self) -> Iterator[PlanarDepth]:
        """The images with times since `start_ns`; one that is not later than the one before is left out.

        An image without a stamp gets its time of recording. Warns once of each case, and at the end if images were so
        close that the difference of two gives wrong velocities.
        """
        last, warned = -inf, set[str]()
        intervals: list[float] = []

        def warn(message: str) -> None:
            if message not in warned:
                warned.add(message)
                notice.warn(f"{self.topic}: {message}")

        for found in self._bag.messages(self.topic):
            image = from_ros_image(found.message, camera=self._camera, start_ns=self.start_ns)
            if not header_nanoseconds(found.message) and self.start_ns > 0:  # a simulated clock may start at zero
                warn("header stamps are zero; times of recording replace them")
                image = replace(image, time=seconds(found.time_ns, self.start_ns))
            time = float(image.time or 0.0)
            if time > last:
                intervals.append(time - last)
                last = time
                yield image
            else:
                warn("images with stamps not later than the image before are left out")
        if len(intervals) > _FEW and min(intervals) < _UNEVEN * (mean := sum(intervals[1:]) / (len(intervals) - 1)):
            warn(
                f"intervals of images are {min(intervals):.3g} to {max(intervals[1:]):.3g} s, {mean:.3g} s on average; "
                "if the stamps are reception times, velocities from two images are wrong"
            )


class FrameImages(NamedTuple):
    """Source of a frame of a radar.

    See Also
    --------
    adapters.ros.frame_images : Makes them.

    Examples
    --------
    >>> from radarcore.adapters.images import from_mujoco_renderer
    >>> depths = [2.0, 1.9, 1.8]
    >>> camera = {"fovy_deg": 45.0, "far": 9.0}
    >>> images = [from_mujoco_renderer(np.full((4, 6), d), time=0.1 * k, **camera) for k, d in enumerate(depths)]
    >>> first = next(rc.adapters.ros.frame_images(images, rate=10.0))
    >>> print(f"{first.time:.1f} s, {first.interval:.1f} s after the image before it, {first.num_lost} lost")
    0.1 s, 0.1 s after the image before it, 0 lost
    """

    time: float
    """Start of the frame [s]."""
    image: PlanarDepth
    """The newest at that time."""
    previous: PlanarDepth
    """The one before it."""
    interval: float
    """Between the two [s]."""
    num_lost: int
    """Frames left out just before this one, for want of images."""


def frame_images(images: Iterable[PlanarDepth], rate: float, *, max_age: float = 0.2) -> Iterator[FrameImages]:
    """Images of every frame, at a steady rate from the second image to the last one.

    Parameters
    ----------
    images : iterable of PlanarDepth
        With increasing times.
    rate : float
        Frames per second [Hz].
    max_age : float
        Frames whose image, or the difference to the one before it, would be older are left out [s].

    See Also
    --------
    adapters.ros.DepthImages : Images of a bag.
    frame_from_depth : Takes an image and the one before it.

    Examples
    --------
    >>> from radarcore.adapters.images import from_mujoco_renderer
    >>> depths = [2.0, 1.9, 1.8]
    >>> camera = {"fovy_deg": 45.0, "far": 9.0}
    >>> images = [from_mujoco_renderer(np.full((4, 6), d), time=0.1 * k, **camera) for k, d in enumerate(depths)]
    >>> [round(each.time, 3) for each in rc.adapters.ros.frame_images(images, rate=20.0)]
    [0.1, 0.15, 0.2]
    """
    period, oldest = 1.0 / check.positive("rate", rate, "Hz"), check.positive("max_age", max_age, "s")
    start, index, num_lost = 0.0, 0, 0
    previous: PlanarDepth | None = None
    image: PlanarDepth | None = None
    for following in chain(images, [None]):
        if previous is not None and image is not None:
            now, before = _time(image), _time(previous)
            start = start if index or num_lost else now
            end = now + _LAST if following is None else _time(following) - _LAST
            while (time := start + index * period) < end:
                if time - now <= oldest and now - before <= oldest:
                    yield FrameImages(time, image, previous, now - before, num_lost)
                    num_lost = 0
                else:
                    num_lost += 1
                index += 1
        previous, image = image, following


def _time(image: PlanarDepth) -> float:
    if image.time is None:
        raise ValueError("images: expected images with times, got one without")
    return image.time


def _depth_topic(bag: BagReader, topic: str | None) -> str:
    """The topic of depth images: the given one, or the only one."""
    if topic is None:
        names = [entry.name for entry in bag.topics.values() if entry.type in IMAGES]
    else:
        names = [bag.topic(topic, *IMAGES).name]
    encodings = {name: _encoding(bag, name) for name in names}
    depths = [name for name, encoding in encodings.items() if encoding in _ENCODINGS]
    if len(depths) > 1:
        raise ValueError(f"topic: expected one of {', '.join(depths)}, got none")
    if not depths and names:
        got = ", ".join(f"{encoding} of {name!r}" for name, encoding in encodings.items())
        raise ValueError(f"topic: expected depth images, {' or '.join(_ENCODINGS)}, in {bag.path}, got {got}")
    return depths[0] if depths else bag.only_topic(*IMAGES).name  # an error with the names of all topics


def _encoding(bag: BagReader, topic: str) -> str:
    """Encoding of the first image; "nothing" without one."""
    first = next(bag.messages(topic), None)
    return "nothing" if first is None else str(first.message.encoding)


def _camera_of(bag: BagReader, topic: str, info_topic: str | None) -> Camera:
    beside = f"{topic.rpartition('/')[0]}/camera_info"
    wanted = beside if info_topic is None and beside in bag.topics else info_topic
    find = bag.only_topic if wanted is None else partial(bag.topic, wanted)
    name = find(_CAMERA_INFO, argument="info_topic").name
    first: Any = next(bag.messages(name), None)
    if first is None:
        raise ValueError(f"info_topic: expected a message of {name!r}, got none")
    if (image := next(bag.messages(topic), None)) is not None:
        check_size(first.message, image.message)
    return from_camera_info(first.message)
