"""Messages of Gazebo (gz sim), decoded: depth images and poses.

A message is anything with the fields of the protobuf type that its function names; Gazebo's bindings are not imported.
They come with Gazebo: ``from gz.transport import Node``, ``node.subscribe(Image, topic, callback)``.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from radarcore import check
from radarcore.adapters.depth import GZ_AXES, PlanarDepth, centered, decoded, unpacked
from radarcore.adapters.ros.messages import header_nanoseconds, seconds
from radarcore.geometry.pose import Pose

__all__ = ["from_gz_image", "from_gz_poses"]


def __dir__() -> list[str]:
    """Public names, for completion."""
    return __all__


_PIXEL_FORMATS = (
    "UNKNOWN", "L_INT8", "L_INT16", "RGB_INT8", "RGBA_INT8",
    "BGRA_INT8", "RGB_INT16", "RGB_INT32", "BGR_INT8", "BGR_INT16",
    "BGR_INT32", "R_FLOAT16", "RGB_FLOAT16", "R_FLOAT32", "RGB_FLOAT32",
)  # fmt: skip
"""gz.msgs.PixelFormatType, by number; those behind are Bayer patterns."""

_R_FLOAT32 = _PIXEL_FORMATS.index("R_FLOAT32")


def from_gz_image(message: Any, *, horizontal_fov: float, start_ns: int = 0) -> PlanarDepth:
    """Depth image of a Gazebo camera (``gz.msgs.Image``, R_FLOAT32): metres, top row first.

    Infinities of both signs, beyond the far sphere and before the near plane, are nothing.

    Parameters
    ----------
    message : gz.msgs.Image
        Anything with `width`, `height`, `step`, `data`, `pixel_format_type` and `header`.
    horizontal_fov : float
        As in the sensor's SDF [rad].
    start_ns : int
        Stamp that counts as time 0 [ns].

    See Also
    --------
    adapters.gazebo.from_gz_poses : Poses of models.
    adapters.ros.from_ros_image : The same over the bridge to ROS.
    frame_from_depth : Frame from the image.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> data = np.full(64 * 48, 2.0, "<f4").tobytes()
    >>> message = SimpleNamespace(width=64, height=48, step=256, data=data, pixel_format_type=13)
    >>> image = rc.adapters.gazebo.from_gz_image(message, horizontal_fov=1.05)
    >>> print(image.depth.shape, image.depth[0, 0])
    (48, 64) 2.0
    """
    kind = int(message.pixel_format_type)
    if kind != _R_FLOAT32:
        name = _PIXEL_FORMATS[kind] if 0 <= kind < len(_PIXEL_FORMATS) else "another"
        raise ValueError(f"pixel_format_type: expected R_FLOAT32 (13), got {name} ({kind})")
    rows, columns = check.count("height", message.height), check.count("width", message.width)
    metres = unpacked("data", message.data, "<f4", rows, columns, int(message.step))
    camera = centered("horizontal_fov", horizontal_fov, columns, metres.shape)
    time_ns = header_nanoseconds(message)
    time = None if time_ns is None else seconds(time_ns, start_ns)
    return decoded(metres, np.inf, camera, GZ_AXES, time, _frame_id(message))


def from_gz_poses(message: Any) -> dict[str, Pose]:
    """Poses of a ``gz.msgs.Pose_V`` by name, as on ``/world/NAME/pose/info``.

    Models have poses in the world, links in their model, sensors and visuals in their link. A repeated name, as of the
    links of two models, gets the entity's number: ``"link [12]"``.

    See Also
    --------
    Live : Motion by the newest poses.
    adapters.gazebo.from_gz_image : Depth images.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> at, turned = SimpleNamespace(x=1.0, y=2.0, z=0.5), SimpleNamespace(w=1.0, x=0.0, y=0.0, z=0.0)
    >>> message = SimpleNamespace(pose=[SimpleNamespace(name="cart", position=at, orientation=turned)])
    >>> rc.adapters.gazebo.from_gz_poses(message)["cart"].position.tolist()
    [1.0, 2.0, 0.5]
    """
    counts = Counter(str(entry.name) for entry in message.pose)
    poses: dict[str, Pose] = {}
    for entry in message.pose:
        p, q, name = entry.position, entry.orientation, str(entry.name)
        if counts[name] > 1:
            name = f"{name} [{entry.id}]"
        if name in poses:
            raise ValueError(f"pose: expected entities of different names or numbers (id), got {name!r} twice")
        poses[name] = Pose.from_quaternion([p.x, p.y, p.z], wxyz=[q.w, q.x, q.y, q.z])
    return poses


def _frame_id(message: Any) -> str | None:
    """Frame of a header: the entry ``frame_id`` of its data."""
    for entry in getattr(getattr(message, "header", None), "data", ()):
        if entry.key == "frame_id" and len(entry.value) > 0:
            return str(entry.value[0])
    return None
