"""ROS bags on the command line: recordings simulated from them, and what they hold."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from radarcore import check, notice
from radarcore.adapters.ros.bags import BagReader
from radarcore.adapters.ros.depth import DepthImages, FrameImages, frame_images
from radarcore.adapters.ros.motions import BagMotions
from radarcore.cli.bag_options import BagOptions
from radarcore.depth.frame import frame_from_depth
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import frame_rate
from radarcore.recording.frame import Frame
from radarcore.recording.recording import Recording
from radarcore.recording.writer import RecordingWriter
from radarcore.scenefile.load import load_radar, load_scene


def simulated(
    scene: Path | None, options: BagOptions, output: Path, *, overwrite: bool, threads: int | None
) -> tuple[Recording, float]:
    """Recording of a scene whose motions a bag holds, or of its depth images; and its frames per second."""
    assert options.bag is not None
    with BagReader(options.bag) as bag:
        if scene is not None:
            return _scene(bag, scene, output, overwrite=overwrite, threads=threads)
        return _depth(bag, options, output, overwrite=overwrite, threads=threads)


def _scene(
    bag: BagReader, scene: Path, output: Path, *, overwrite: bool, threads: int | None
) -> tuple[Recording, float]:
    recorded = BagMotions(bag)
    simulation = load_scene(scene, recorded=recorded)
    if recorded.span is None:
        notice.warn(f"{scene}: expected a motion or joints of kind 'bag', got none: the bag is not used")
    source = {"bag": {"path": str(bag.path), "start_ns": recorded.start_ns}}
    recording = simulation.record(output, overwrite=overwrite, threads=threads, source=source)
    return recording, simulation.run.rate


def _depth(
    bag: BagReader, options: BagOptions, output: Path, *, overwrite: bool, threads: int | None
) -> tuple[Recording, float]:
    """Every frame from the newest depth image and the one before it."""
    assert options.radar is not None
    radar = load_radar(options.radar)
    rate = frame_rate(radar.waveform) if options.rate is None else check.positive("rate", options.rate, "Hz")
    with _argument_names(bag.path):
        images = DepthImages(bag, options.depth_topic, info_topic=options.info_topic, camera=options.field_of_view)
    if len(images) < 2:
        raise ValueError(f"{bag.path}: expected at least two depth images on {images.topic}, got {len(images)}")
    reflectance = 1.0 if options.reflectance is None else options.reflectance
    max_age = 0.2 if options.max_age is None else options.max_age
    source = {
        "kind": "depth images",
        "bag": {"path": str(bag.path), "start_ns": images.start_ns, "topic": images.topic},
    }
    num_lost = 0
    with notice.progress(images, "simulating", "image", total=len(images)) as counted, _each_kind_once():
        chosen = frame_images(counted, rate, max_age=max_age)
        # The first frame tells whether all arguments are right, before anything is written.
        if (found := next(chosen, None)) is None:
            raise ValueError(f"max_age: expected two depth images within it somewhere, got {max_age:g} s")
        frame = _frame(found, radar, reflectance, threads)
        with RecordingWriter(output, radar, source=source, overwrite=overwrite) as writer:
            writer.append(frame)
            num_lost += found.num_lost
            for found in chosen:
                writer.append(_frame(found, radar, reflectance, threads))
                num_lost += found.num_lost
    if num_lost:
        notice.warn(f"{bag.path}: {num_lost} frames left out: no two depth images within {max_age:g} s")
    return Recording.load(output), rate


def _frame(found: FrameImages, radar: Radar, reflectance: float, threads: int | None) -> Frame:
    frame = frame_from_depth(
        found.image.depth,
        reflectance,
        radar,
        camera=found.image.camera,
        planar=True,
        previous=found.previous.depth,
        interval=found.interval,
        time=found.time,
        image_time=found.image.time,
        threads=threads,
    )
    frame.stats["lost_before"] = found.num_lost
    return frame


@contextmanager
def _argument_names(path: Path) -> Iterator[None]:
    """Errors of topics by the names of their options."""
    names = {
        "topic": "--depth-topic",
        "info_topic": "--info-topic",
        "camera_info": "--info-topic",
        "camera": "--field-of-view",
    }
    try:
        yield
    except ValueError as error:
        name, colon, text = str(error).partition(": ")
        if not (colon and name in names):
            raise ValueError(f"{path}: {error}") from error
        hint = "; or give --field-of-view" if name == "info_topic" else ""
        raise ValueError(f"{names[name]}: {text}{hint}") from error


@contextmanager
def _each_kind_once() -> Iterator[None]:
    """Shows warnings that differ from earlier ones in more than numbers: images are warned of one by one."""
    told = set[str]()
    with warnings.catch_warnings():
        show = warnings.showwarning

        def show_new(message: Warning | str, *details: Any, **options: Any) -> None:
            kind = re.sub(r"[\d.]+", "0", str(message))
            if kind not in told:
                told.add(kind)
                show(message, *details, **options)

        warnings.showwarning = show_new
        warnings.simplefilter("always")
        yield
