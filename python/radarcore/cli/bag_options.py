"""Options of `radarcore simulate` for ROS bags."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Group, Parameter

from radarcore.cli.options import File, Seconds

_OF_DEPTH = ("radar", "depth_topic", "info_topic", "field_of_view", "reflectance", "rate", "max_age")
"""Options for depth images, which a scene file has no use for."""

_Topic = Annotated[str | None, Parameter(metavar="TOPIC")]


@Parameter(name="*", group=Group("From a ROS bag", sort_key=2))
@dataclass(frozen=True, kw_only=True)
class BagOptions:
    """A bag, and what goes with it."""

    bag: Annotated[Path | None, Parameter(metavar="BAG")] = None
    """with a scene file: motions of kind "bag" are those recorded; without: depth images become the frames"""

    radar: File = None
    """radar at the depth camera: scene file, recording, or its meta.json"""

    depth_topic: _Topic = None
    """depth images (default: the only ones)"""

    info_topic: _Topic = None
    """their camera (default: camera_info beside them)"""

    field_of_view: Annotated[tuple[float, float] | None, Parameter(metavar="H V")] = None
    """of the camera, in place of --info-topic [degrees]"""

    reflectance: Annotated[float | None, Parameter(metavar="R")] = None
    """power reflectance of all surfaces (default: 1)"""

    rate: Annotated[float | None, Parameter(metavar="HZ")] = None
    """frames per second (default: those of the radar)"""

    max_age: Seconds = None
    """oldest image of a frame [s] (default: 0.2)"""

    def check(self, scene: Path | None) -> None:
        """Refuse options that do not go together."""
        given = [f"--{name.replace('_', '-')}" for name in _OF_DEPTH if getattr(self, name) is not None]
        if self.bag is None and given:
            raise ValueError(f"{given[0]}: expected --bag as well, got none")
        if scene is not None and given:
            raise ValueError(f"{given[0]}: expected none with a scene file, got it and {scene}")
        if scene is None and (self.bag is None or self.radar is None):
            raise ValueError("scene: expected a scene file, or --bag with --radar for its depth images, got none")


NO_BAG = BagOptions()
