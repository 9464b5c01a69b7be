"""The demo: a small room seen by a BGT60TR13C for one second, compared with the truth."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from radarcore import plot, shapes
from radarcore.body import Body
from radarcore.material import materials
from radarcore.mesh import Mesh
from radarcore.models import robots
from radarcore.motion import Linear, Motion, Pose
from radarcore.process import strongest_peak
from radarcore.radar import Radar, bgt60tr13c
from radarcore.recording import Recording
from radarcore.scene import Scene
from radarcore.simulate import Simulator

FRAME_RATE = 40.0
"""Frames per second [Hz]."""

REFLECTORS = ("plate", "cylinder", "sphere")
"""Bodies that stand alone in range and velocity, so that their echo can be compared with their truth."""

# A peak is looked for this close to the truth: range [m] and velocity [m/s].
_GATE = (0.35, 0.5)


@dataclass(frozen=True)
class Comparison:
    """How well the radar saw one body over a recording; errors in bins, over the frames that count."""

    name: str
    num_frames: int
    """Frames in which the body was visible."""
    num_range_within: int
    """Of these, frames with a range error below half a bin."""
    num_velocity_within: int
    """Of these, frames with a velocity error below one bin."""
    max_range_error: float
    """Largest range error [bins]."""
    max_velocity_error: float
    """Largest velocity error [bins]."""
    first: tuple[float, float]
    """Estimated range [m] and velocity [m/s] in the first frame."""
    last: tuple[float, float]
    """The same in the last frame."""


def radar() -> Radar:
    """BGT60TR13C with a 1.5 GHz sweep: 10 cm and 0.13 m/s bins, to 6.7 m and 4.1 m/s."""
    return bgt60tr13c(
        start_frequency=60e9,
        stop_frequency=61.5e9,
        num_samples=128,
        num_chirps=64,
        chirp_interval=300e-6,
        frame_interval=1.0 / FRAME_RATE,
    )


def sensor_motion() -> Pose:
    """The sensor, 1 m above the floor, looking along +x."""
    return Pose([0.0, 0.0, 1.0])


def scene(mesh_directory: Path | None = None) -> Scene:
    """A plate, a cylinder and a moving sphere in a room; with a directory for converted meshes also arm and man."""
    sensor = sensor_motion().position
    metal, wall = materials["metal"], materials["plasterboard"]

    def body(mesh: Mesh, motion: Motion, name: str) -> Body:
        return Body(mesh, material=metal, motion=motion, name=name)

    bodies = [
        Body(shapes.box((5.2, 4.4, 2.6)), material=wall, motion=Pose([1.9, 0.0, 1.3]), name="room"),
        body(shapes.plate(0.2, 0.2), Pose.look_at([1.3, -0.55, 1.1], sensor), "plate"),
        body(shapes.cylinder(0.12, 1.6), Pose([2.3, 0.75, 0.8]), "cylinder"),
        body(shapes.sphere(0.15), Linear(Pose([3.1, -0.3, 1.0]), velocity=[-1.0, 0.2, 0.0]), "sphere"),
    ]
    if mesh_directory is not None:
        arm = robots.ur10_links([0.6, -1.2, 1.6, -0.4, 1.5708, 0.0])
        bodies += robots.link_bodies(arm, Pose([3.1, -0.95, 0.4]), metal, mesh_directory / "ur10")
        man = robots.human_links()
        facing_the_sensor = Pose.from_rpy([3.3, 1.75, 0.0], [0.0, 0.0, np.pi])
        bodies += robots.link_bodies(man, facing_the_sensor, materials["skin"], mesh_directory / "human")
    return Scene(bodies)


def compare(recording: Recording, names: tuple[str, ...] = REFLECTORS) -> list[Comparison]:
    """Strongest peak near every body's truth, frame by frame, against that truth."""
    waveform = recording.radar.waveform
    gate_range, gate_velocity = _GATE
    comparisons = []
    for name in names:
        errors, estimates = [], []
        for frame in recording.frames():
            assert frame.truth is not None  # the simulator always gives it
            i = frame.truth.names.index(name)
            distance, velocity = float(frame.truth.range[i]), float(frame.truth.velocity[i])
            if np.isnan(distance):
                continue
            peak = strongest_peak(
                frame.cube,
                waveform,
                min_range=distance - gate_range,
                max_range=distance + gate_range,
                min_velocity=velocity - gate_velocity,
                max_velocity=velocity + gate_velocity,
            )
            estimates.append((peak.range, peak.velocity))
            errors.append(
                (
                    abs(peak.range - distance) / waveform.range_resolution,
                    abs(peak.velocity - velocity) / waveform.velocity_resolution,
                )
            )
        table = np.array(errors).reshape(-1, 2)
        comparisons.append(
            Comparison(
                name=name,
                num_frames=len(table),
                num_range_within=int((table[:, 0] < 0.5).sum()),
                num_velocity_within=int((table[:, 1] < 1.0).sum()),
                max_range_error=float(table[:, 0].max(initial=0.0)),
                max_velocity_error=float(table[:, 1].max(initial=0.0)),
                first=estimates[0] if estimates else (np.nan, np.nan),
                last=estimates[-1] if estimates else (np.nan, np.nan),
            )
        )
    return comparisons


def table(comparisons: list[Comparison]) -> list[str]:
    """The comparisons as lines of text."""
    lines = [
        "",
        "            frames    first > last frame          largest error [bins]   frames with errors below",
        "                      range [m]  velocity [m/s]   range     velocity     1/2 range bin   1 velocity bin",
    ]
    for c in comparisons:
        within = f"{c.num_range_within} of {c.num_frames}", f"{c.num_velocity_within} of {c.num_frames}"
        lines.append(
            f"{c.name:<10}  {c.num_frames:>6}    {c.first[0]:.2f}>{c.last[0]:.2f}  {c.first[1]:+.2f} > {c.last[1]:+.2f}"
            f"    {c.max_range_error:5.3f}     {c.max_velocity_error:5.3f}        {within[0]:<13}   {within[1]}"
        )
    return lines


def run(
    directory: Path,
    *,
    duration: float = 1.0,
    resolution: int = 256,
    with_robots: bool | None = None,
    say: Callable[[str], None] = print,
) -> list[Comparison]:
    """Simulate, record, compare and draw; what it found goes to `say`, line by line.

    Parameters
    ----------
    directory : path
        Where recording, picture and converted meshes go.
    duration : float
        Length of the recording [s].
    resolution : int
        Rays across the image.
    with_robots : bool, optional
        Put the real UR10 and human meshes into the scene; default: when the extra `robots` is installed.
    """
    if with_robots is None:
        with_robots = robots.is_available()
    place = scene(directory / "meshes" if with_robots else None)
    sensor = radar()
    waveform = sensor.waveform
    simulator = Simulator(
        place, sensor, radar_motion=sensor_motion(), resolution=resolution, field_of_view_deg=(80.0, 60.0)
    )
    say(
        f"BGT60TR13C, {waveform.start_frequency / 1e9:g} GHz + {waveform.bandwidth / 1e9:.2f} GHz, "
        f"{sensor.num_channels} channels x {waveform.num_chirps} chirps x {waveform.num_samples} samples; "
        f"range bin {100 * waveform.range_resolution:.1f} cm, velocity bin {waveform.velocity_resolution:.3f} m/s"
    )
    meshes = sum(len(b.mesh.triangles) for b in place.bodies if isinstance(b, Body))
    extra = "with UR10 and human meshes" if with_robots else "without robot meshes (pip install radarcore[robots])"
    say(f"{len(place.bodies)} bodies, {meshes} triangles, {extra}; {resolution} x {resolution} rays")

    # Simulate and record.
    path = directory / "recording"
    began = time.perf_counter()
    recording = simulator.record(0.0, duration, FRAME_RATE, path=path, overwrite=True)
    elapsed = time.perf_counter() - began
    num_frames = len(recording)
    say(
        f"{num_frames} frames in {elapsed:.1f} s: {1e3 * elapsed / num_frames:.0f} ms per frame, "
        f"{num_frames / FRAME_RATE / elapsed:.2f} x real time"
    )

    # Compare with the truth.
    comparisons = compare(recording)
    for line in table(comparisons):
        say(line)

    # One picture of the frame in the middle.
    middle = recording[num_frames // 2]
    picture = directory / "overview.png"
    assert middle.truth is not None  # the simulator always gives it
    middle = replace(middle, truth=middle.truth.select(REFLECTORS))
    plot.overview(middle, simulator.depth_image(middle.time + 0.5 * waveform.duration), picture, max_range=5.0)
    say("")
    say(f"recording {path}, picture {picture}")
    return comparisons
