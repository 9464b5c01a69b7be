"""Options of `radarcore simulate` for ROS bags; without imports that take long."""

from __future__ import annotations

import argparse
from pathlib import Path

_OF_DEPTH = ("radar", "depth_topic", "info_topic", "field_of_view", "reflectance", "rate", "max_age")
"""Options for depth images, which a scene file has no use for."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--bag`` and what goes with it."""
    group = parser.add_argument_group("from a ROS bag")
    group.add_argument(
        "--bag",
        type=Path,
        metavar="BAG",
        help='with a scene file: motions of kind "bag" are those recorded; without: depth images become the frames',
    )
    group.add_argument(
        "--radar",
        type=Path,
        metavar="FILE",
        help="radar at the depth camera: scene file, or meta.json of a recording",
    )
    group.add_argument("--depth-topic", metavar="TOPIC", help="depth images (default: the only ones)")
    group.add_argument("--info-topic", metavar="TOPIC", help="their camera (default: camera_info beside them)")
    group.add_argument(
        "--field-of-view",
        type=float,
        nargs=2,
        metavar=("H", "V"),
        help="of the camera, in place of --info-topic [degrees]",
    )
    group.add_argument("--reflectance", type=float, metavar="R", help="power reflectance of all surfaces (default: 1)")
    group.add_argument("--rate", type=float, metavar="HZ", help="frames per second (default: those of the radar)")
    group.add_argument("--max-age", type=float, metavar="S", help="oldest image of a frame [s] (default: 0.2)")


def check_options(options: argparse.Namespace) -> None:
    """Refuse options that do not go together."""
    given = [f"--{name.replace('_', '-')}" for name in _OF_DEPTH if getattr(options, name) is not None]
    if options.bag is None and given:
        raise ValueError(f"{given[0]}: expected --bag as well, got none")
    if options.scene is not None and given:
        raise ValueError(f"{given[0]}: expected none with a scene file, got it and {options.scene}")
    if options.scene is None and (options.bag is None or options.radar is None):
        raise ValueError("scene: expected a scene file, or --bag with --radar for its depth images, got none")
