"""Frames, recordings and scenes to be drawn, and what is written in the pictures."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np

from radarcore.geometry import shapes
from radarcore.geometry.pose import Pose
from radarcore.motion.linear import Linear
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform
from radarcore.recording.frame import Frame, Truth
from radarcore.recording.recording import Recording
from radarcore.scene.body import Body, PointTarget
from radarcore.scene.scene import Scene
from radarcore.units import SPEED_OF_LIGHT
from reference import beat_signal_reference

NAMES = ("wall", "arm", "hidden", "behind")
RANGE = np.array([1.9, 0.9, np.nan, 50.0])
VELOCITY = np.array([0.0, -0.8, np.nan, 0.0])
AZIMUTH = np.deg2rad([-20.0, 5.0, np.nan, 80.0])
ELEVATION = np.deg2rad([12.0, -3.0, np.nan, 0.0])


def frame(*, real: bool = True, truth: bool = True, **changes: Any) -> Frame:
    """Two targets before a radar, a third hidden and a fourth out of view."""
    settings: dict[str, Any] = {"num_samples": 128, "num_chirps": 32, "chirp_interval": 400e-6} | changes
    wf = Waveform.from_sweep(start_frequency=58e9, stop_frequency=62e9, sample_rate=2e6, **settings)
    radar = Radar(wf, receiver=Receiver(output="real") if real else None)
    start = RANGE[:2] - VELOCITY[:2] * wf.duration / 2.0
    cube = beat_signal_reference(
        2.0 * start / SPEED_OF_LIGHT, [3e-5, 1e-5], wf, delay_rate=2.0 * VELOCITY[:2] / SPEED_OF_LIGHT
    )
    known = Truth(NAMES, RANGE, VELOCITY, AZIMUTH, ELEVATION) if truth else None
    return Frame(cube.real.astype(np.float32) if real else cube.astype(np.complex64), 0.125, radar, known)


def recording(times: Any = tuple(0.025 * i for i in range(12)), *, truth: bool = True) -> Recording:
    """A wall at rest at 1.9 m and an arm that comes nearer at 0.8 m/s, from 1.5 m at 0 s; a third is never visible."""
    wf = frame().radar.waveform
    times = np.asarray(times)
    middles = times + 0.5 * wf.duration
    distance = np.stack([np.full(len(times), 1.9), 1.5 - 0.8 * middles, np.full(len(times), np.nan)], axis=1)
    velocity = np.where(np.isnan(distance), np.nan, VELOCITY[:3])
    starts = distance[:, :2] - 0.5 * wf.duration * VELOCITY[:2]
    rates = 2.0 * VELOCITY[:2] / SPEED_OF_LIGHT
    cube = [beat_signal_reference(2.0 * r / SPEED_OF_LIGHT, [3e-5, 1e-5], wf, delay_rate=rates).real for r in starts]
    radar = Radar(wf, receiver=Receiver(output="real"))
    angles = np.zeros_like(distance)
    known = Truth(NAMES[:3], distance, velocity, angles, angles) if truth else None
    return Recording(np.array(cube, dtype=np.float32).reshape(-1, 1, 32, 128), times, radar, known)


def room() -> Scene:
    """A room with a wall, a moving arm and a point in it."""
    return Scene(
        [
            Body(shapes.box((4.0, 3.0, 2.5)), motion=Pose([1.0, 0.0, 0.25]), name="room"),
            Body(shapes.box((0.2, 1.0, 1.0)), motion=Pose([2.0, 0.0, 0.0]), name="wall"),
            Body(
                shapes.box((0.3, 0.1, 0.1)),
                motion=Linear(Pose([1.5, -0.6, 0.0]), velocity=[-0.8, 0.0, 0.0]),
                name="arm",
            ),
            PointTarget([0.5, 1.0, 0.0], name="point"),
        ]
    )


def image(hit: bool = True) -> Any:
    """A wall over the right half of the view, nothing on the left."""
    distance = np.full((30, 40), np.inf)
    if hit:
        distance[:, 20:] = np.linspace(1.9, 2.4, 20)
    reflectance = np.where(np.isfinite(distance), 0.4, 0.0)
    return SimpleNamespace(distance=distance, reflectance=reflectance, field_of_view_deg=(60.0, 46.0))


def texts(ax: Any) -> dict[str, Any]:
    return {label.get_text(): label for label in ax.texts}


def colour_bar_label(ax: Any) -> str:
    return str(ax.child_axes[0].get_ylabel())


def boxes(figure: Any) -> Iterator[tuple[str, Any]]:
    """Everything written in a figure, with its place in pixels."""
    from matplotlib.text import Text

    figure.draw_without_rendering()
    not_drawn = []  # labels of ticks beyond the limits
    for ax in itertools.chain(figure.axes, *(ax.child_axes for ax in figure.axes)):
        for axis in (ax.xaxis, ax.yaxis):
            low, high = sorted(axis.get_view_interval())
            beyond = [tick for tick in axis.get_major_ticks() if not low <= tick.get_loc() <= high]
            not_drawn += [id(label) for tick in beyond for label in (tick.label1, tick.label2)]
    for text in figure.findobj(lambda artist: isinstance(artist, Text) and artist.get_visible()):
        box = text.get_window_extent()
        if id(text) not in not_drawn and text.get_text().strip() and box.width > 0.0:
            yield text.get_text(), box


def texts_apart(figure: Any) -> set[str]:
    """Everything written in a figure, none over another and all of it on the figure."""
    written = list(boxes(figure))
    for (text, box), (other, other_box) in itertools.combinations(written, 2):
        assert not box.overlaps(other_box), f"{text!r} over {other!r}"
    for text, box in written:
        assert figure.bbox.x0 <= box.x0, text
        assert box.x1 <= figure.bbox.x1, text
        assert figure.bbox.y0 <= box.y0, text
        assert box.y1 <= figure.bbox.y1, text
    return {text for text, _ in written}
