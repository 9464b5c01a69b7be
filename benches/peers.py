"""Rays of images, as radarcore and public libraries cast them, distances compared first; and a published rotor.

    python benches/peers.py            print the tables
    python benches/peers.py --rotor    print the table of the rotor alone
    python benches/peers.py --write    also write them into benches/results/performance.md
    python benches/peers.py --tiny     run everything once on few rays

The libraries are optional; a line says what is missing and how to get it.
"""

from __future__ import annotations

import argparse
import ctypes
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

# Builds are measured on one thread, for our core (rayon) and the other libraries (OpenMP).
os.environ.update(RAYON_NUM_THREADS="1", OMP_NUM_THREADS="1")

import numpy as np
from numpy.typing import NDArray

import radarcore as rc
from meshes import Triangles, box_grid, joined, room, sphere
from page import PERFORMANCE, machine, milliseconds, section_of, table, write_section
from radarcore.motion.protocol import as_motion
from radarcore.simulate.placement import Placement
from radarcore.units import SPEED_OF_LIGHT

FIELD_OF_VIEW_DEG = 60.0
FRAMES_PER_SECOND = 40.0

RADAR = rc.Radar(rc.Waveform(start_frequency=60e9, slope=1e12, sample_rate=1e6, num_samples=8))
"""A simulator wants one; casting does not use it."""

PAGE_TEXT = """\
## Ray casting

Distances along the rays of an image, {side} x {side} pixels, 60 degrees, beside public libraries. Written by
`python benches/peers.py --write`. {machine}; one thread on one core unless stated otherwise.

{images}

The room has bumpy walls and four spheres. The sphere has a radius of 1 m, is 2 m in front of the camera, and fills
the image except for the corners. The camera moves from frame to frame. Times are medians over {rounds} rounds of
{frames} frames in which the casters take turns. "×" is the speedup over embreex and over Embree's packets, a median of
ratios of the rounds; on other machines times change more than ratios. Distances are compared before any timing.

"tracer" is the first step of `Simulator`: rays from the pose of the camera, search in f32, distances in f64, triangle
indices. "depth_image" adds cosines of incidence, reflectance and body indices. The libraries get precomputed rays in
their preferred layout. embreex and Open3D take single rays and measure distances in f32; Open3D also returns normals;
trimesh calls embreex and computes the points in f64. "Embree packets" is Embree called from C with coherent packets
of 4 x 4 pixels, in its default mode, which lets a few rays pass between triangles; embreex uses the robust mode.
Versions: {versions}.

Builds in ms from arrays of vertices and triangles: `Mesh(..., shading="flat")`, including its checks, and the commit
of Embree's scene, after the arrays were copied.

{builds}
"""

ROTOR_TITLE = "### A rotor"

ROTOR_TEXT = """
Frames of 1024 chirps of 128 samples, 77 GHz, 4 MHz, one channel, as WiTwin Radar 0.4.1 times them: its "rotor" is a
point of 1 m^2 that circles 80 times per second at a radius of 3 mm, 30 m away. Here the radar circles instead. The
second rotor, whose echo WiTwin cannot simulate, is a mesh: four paddles of 5 x 2 cm, as fast, 3 m away, seen from the
side. "error" compares all samples (rms): of the point with the closed form, of the paddles with a frame of
`retrace_deg=1, tolerance=1e-4, rcs_floor=1e-4`. Written by `python benches/peers.py --rotor --write`; {machine}, load
{load}; medians over {frames} frames [ms], in which CPU time sums all threads.

{table}

"published" is for an RTX 5080; 174 ms with `nodes=5` (<https://pypi.org/project/witwin-radar/0.4.1/>). The peer's own
comparison gives 134 ms and an error of 0.46 %, and 217 ms for MATLAB on a Ryzen 7 9800X3D
(`docs/dev/audit/radar-matlab-comparison-2026-09-17.md` of <https://github.com/witwin-ai/witwin-radar>).
"""

Image = NDArray[np.floating]


@dataclass(frozen=True)
class Run:
    """Sizes of a measurement."""

    side: int  # pixels, a multiple of 4
    sizes: list[int]  # triangles
    rounds: int
    frames: int  # per round, after one that warms up
    builds: int
    rays_in_f64: int  # that are also compared with all triangles one by one


FULL = Run(side=256, sizes=[5000, 100_000, 1_000_000], rounds=10, frames=5, builds=5, rays_in_f64=20)
TINY = Run(side=16, sizes=[100], rounds=1, frames=1, builds=1, rays_in_f64=256)


# Views.


@dataclass(frozen=True)
class View:
    """Rays of a frame in the world, row by row: origins, all the same, and unit directions, (ray, 3) f32."""

    time: float
    origins: NDArray[np.float32]
    directions: NDArray[np.float32]


def camera(at: float) -> rc.Pose:
    """The camera wanders by centimetres and turns by degrees, about a pixel per frame."""
    position = 0.05 * np.sin(at * np.array([3.1, 2.3, 1.7]))
    angles = 0.05 * np.cos(at * np.array([1.3, 2.9, 1.9]))
    return rc.Pose.from_rpy(position, angles)


def view(frame: int, side: int) -> View:
    """The rays of the pixels as `Simulator` orders them: row 0 at +z, column 0 at +y."""
    at = frame / FRAMES_PER_SECOND
    ticks = np.tan(0.5 * np.deg2rad(FIELD_OF_VIEW_DEG)) * (1.0 - (2.0 * np.arange(side) + 1.0) / side)
    y, z = np.meshgrid(ticks, ticks)
    directions = np.stack([np.ones_like(y), y, z], axis=-1).reshape(-1, 3)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    pose = camera(at)
    origins = np.tile(pose.position.astype(np.float32), (len(directions), 1))
    return View(at, origins, (directions @ pose.rotation.T).astype(np.float32))


# Casters.


@dataclass(frozen=True)
class Caster:
    """One way to cast the rays of an image; only `cast` is timed."""

    name: str
    rays: Callable[[View], Any]  # as the caster likes them
    cast: Callable[[Any], Any]
    distance: Callable[[Any], Image]  # along the ray [m], (row, column); inf where nothing was hit
    threads: int = 1
    version: str = rc.__version__


def tracer(scene: rc.Scene, side: int, threads: int) -> Caster:
    """From the places of the bodies to the hits."""
    simulator = rc.Simulator(scene, RADAR, resolution=side, field_of_view_deg=(60.0, 60.0), threads=threads)
    placement = Placement(scene, as_motion("camera", camera), RADAR.waveform)
    # A view that is cast again is cast as a whole.
    engine = simulator._new_engines(reuse_tiles=False)[0]
    name = "radarcore tracer" + (f", {threads} threads" if threads > 1 else "")
    return Caster(name, lambda view: placement.at(view.time), engine.image, lambda hits: hits[0], threads)


def depth_image(scene: rc.Scene, side: int) -> Caster:
    """Run times with all images."""
    simulator = rc.Simulator(
        scene, RADAR, radar_motion=camera, resolution=side, field_of_view_deg=(60.0, 60.0), threads=1
    )
    return Caster("radarcore depth_image", lambda view: view.time, simulator.depth_image, lambda image: image.distance)


def embreex(mesh: Triangles) -> Caster:
    """Embree's single rays."""
    from embreex import __version__
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene()
    TriangleMesh(scene, mesh[0].astype(np.float32), mesh[1].astype(np.int32))

    def cast(rays: View) -> Image:
        return scene.run(rays.origins, rays.directions, dists=np.inf, query="DISTANCE")

    return Caster("embreex", lambda view: view, cast, squared, version=__version__)


def open3d(mesh: Triangles) -> Caster:
    """Open3D's RaycastingScene, which has Embree inside and also returns normals and barycentric coordinates."""
    import open3d

    tensor = open3d.core.Tensor
    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(tensor(mesh[0].astype(np.float32)), tensor(mesh[1]))

    def rays(view: View) -> Any:
        return tensor(np.concatenate([view.origins, view.directions], axis=1))

    def cast(rays: Any) -> Any:
        return scene.cast_rays(rays, nthreads=1)["t_hit"]

    return Caster("Open3D", rays, cast, lambda hits: squared(hits.numpy()), version=open3d.__version__)


def trimesh(mesh: Triangles) -> Caster:
    """Rays of trimesh, through embreex; its own r-tree in Python takes minutes for an image."""
    import trimesh
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    intersector = RayMeshIntersector(trimesh.Trimesh(*mesh, process=False))

    def cast(rays: View) -> tuple[View, Any]:
        return rays, intersector.intersects_location(rays.origins, rays.directions, multiple_hits=False)

    def distance(hits: tuple[View, Any]) -> Image:
        view, (points, numbers, _) = hits
        distances = np.full(len(view.directions), np.inf)
        distances[numbers] = np.linalg.norm(points - view.origins[numbers], axis=1)
        return squared(distances)

    return Caster("trimesh", lambda view: view, cast, distance, version=trimesh.__version__)


def squared(values: Image) -> Image:
    """Values of the rays row by row as a square image."""
    return values.reshape(math.isqrt(len(values)), -1)


def embree_packets(mesh: Triangles) -> Caster:
    """Embree's packets of 16 rays, 4 x 4 pixels each."""
    scene = EmbreeScene(mesh)
    scene.commit()

    def rays(view: View) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        quarter = math.isqrt(len(view.directions)) // 4
        packets = view.directions.reshape(quarter, 4, quarter, 4, 3).transpose(0, 2, 4, 1, 3)
        return view.origins[0], packets.reshape(-1, 3, 16)

    def distance(hits: Image) -> Image:
        quarter = math.isqrt(len(hits))
        return hits.reshape(quarter, quarter, 4, 4).transpose(0, 2, 1, 3).reshape(4 * quarter, -1)

    return Caster("Embree packets", rays, lambda rays: scene.cast(*rays), distance, version=scene.version)


class EmbreeScene:
    """A mesh in Embree, by embree_packets.c; to be committed before rays are cast.

    Raises ImportError where there is no Embree or no compiler.
    """

    def __init__(self, mesh: Triangles) -> None:
        self.library, self.device = embree_library()
        self.version = ".".join(str(self.library.rtcGetDeviceProperty(self.device, part)) for part in (1, 2, 3))
        vertices, triangles = mesh[0].astype(np.float32), mesh[1]
        self.scene = self.library.new_scene(self.device, vertices, len(vertices), triangles, len(triangles))
        if self.scene is None:
            raise MemoryError(f"Embree: no scene of {len(triangles)} triangles")

    def commit(self) -> None:
        """Build what the rays search."""
        self.library.rtcCommitScene(self.scene)

    def cast(self, origin: NDArray[np.float32], directions: NDArray[np.float32]) -> NDArray[np.float32]:
        """Distances (packet, 16) from one origin (3,) along unit directions (packet, 3, 16)."""
        distances = np.empty((len(directions), 16), np.float32)
        self.library.cast_packets(self.scene, origin, directions, len(directions), distances)
        return distances

    def __del__(self) -> None:
        if getattr(self, "scene", None) is not None:
            self.library.rtcReleaseScene(self.scene)


@cache
def embree_library() -> tuple[ctypes.CDLL, int]:
    """embree_packets.c with the newest Embree that is installed, and a device of one thread."""
    source = Path(__file__).with_name("embree_packets.c")
    with tempfile.TemporaryDirectory() as directory:
        for version in (4, 3):
            target = Path(directory) / f"embree{version}_packets.so"
            options = ["-O3", "-march=native", "-shared", "-fPIC", f"-DEMBREE={version}"]
            command = ["cc", *options, "-o", str(target), str(source), f"-lembree{version}"]
            try:
                done = subprocess.run(command, capture_output=True, text=True)
            except OSError as error:
                raise ImportError(f"no C compiler: {error}") from None
            if done.returncode == 0:
                library = ctypes.CDLL(str(target))
                break
        else:
            errors = [line.partition("error: ")[2] for line in done.stderr.splitlines() if "error: " in line]
            raise ImportError(errors[0] if errors else f"{source.name} does not build")

    floats = np.ctypeslib.ndpointer(np.float32, flags="C_CONTIGUOUS")
    numbers = np.ctypeslib.ndpointer(np.uint32, flags="C_CONTIGUOUS")
    pointer, size = ctypes.c_void_p, ctypes.c_size_t
    for name, result, arguments in (
        ("rtcNewDevice", pointer, [ctypes.c_char_p]),
        ("rtcGetDeviceProperty", ctypes.c_ssize_t, [pointer, ctypes.c_int]),
        ("rtcCommitScene", None, [pointer]),
        ("rtcReleaseScene", None, [pointer]),
        ("new_scene", pointer, [pointer, floats, size, numbers, size]),
        ("cast_packets", None, [pointer, floats, floats, size, floats]),
    ):
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library, library.rtcNewDevice(b"threads=1")


PEERS = {
    embreex: "pip install -r requirements/bench.txt",
    embree_packets: "Debian: apt install libembree-dev",
    open3d: "pip install open3d==0.20.0; Debian: apt install libusb-1.0-0",
    trimesh: "pip install -r requirements/bench.txt",
}
"""Libraries and how to get them."""

Peer = Callable[[Triangles], Caster]


def installed_peers() -> dict[Peer, str]:
    """Casters that can make a scene of one triangle, with name and version; prints how to get the others."""
    installed = {}
    for peer, hint in PEERS.items():
        try:
            caster = peer((np.eye(3), np.array([[0, 1, 2]], dtype=np.uint32)))
        except ImportError as error:
            print(f"{peer.__name__} is left out ({error}): {hint}")
        else:
            installed[peer] = f"{caster.name} {caster.version}"
    return installed


# Comparison.


def nearest_in_f64(mesh: Triangles, origin: NDArray[np.float64], directions: NDArray[np.float64]) -> Image:
    """Distances along rays (ray, 3) from one origin, from the planes of all triangles, f64."""
    a, b, c = np.moveaxis(mesh[0][mesh[1]] - origin, 1, 0)
    edge_planes = np.stack([np.cross(a, b), np.cross(b, c), np.cross(c, a)])
    normals = np.cross(b - a, c - a)
    heights = (a * normals).sum(axis=1)
    nearest = []
    for direction in directions:
        sides = edge_planes @ direction
        is_inside = (sides >= 0.0).all(axis=0) | (sides <= 0.0).all(axis=0)
        distances = heights[is_inside] / (normals[is_inside] @ direction)
        nearest.append(min(distances[distances > 0.0], default=np.inf))
    return np.array(nearest)


def check_in_f64(name: str, mesh: Triangles, image: rc.DepthImage, num_rays: int) -> None:
    """Exit unless the image is right to rounding where some of its rays go."""
    pixels = np.linspace(0, image.distance.size - 1, num_rays).astype(int)
    pose = camera(image.time)
    expected = nearest_in_f64(mesh, pose.position, image.directions.reshape(-1, 3)[pixels] @ pose.rotation.T)
    got = image.distance.ravel()[pixels]
    for pixel in np.flatnonzero(~np.isclose(got, expected, rtol=1e-12, atol=0.0)):
        sys.exit(f"{name}: expected {expected[pixel]:.15g} m at pixel {pixels[pixel]}, got {got[pixel]:.15g} m")


def check(name: str, distance: Image, image: rc.DepthImage) -> None:
    """Exit unless distances in f32 equal radarcore's, except for a handful.

    A direction rounded to f32 meets the plane off by up to eps / cos(incidence) of the distance, eps = 2^-23; as much
    again for the plane. At silhouettes, and at edges where a library lets rays pass between triangles, both may hit
    different things: one ray in 10 000, and one more.
    """
    agrees = distance == image.distance  # both missed
    is_hit = image.body >= 0
    expected = image.distance[is_hit]
    tolerance = 2.0 * np.finfo(np.float32).eps * expected / image.cos_incidence[is_hit]
    agrees[is_hit] = np.abs(distance[is_hit] - expected) <= tolerance

    allowed = 1 + agrees.size // 10_000
    if (~agrees).sum() > allowed:
        row, column = np.argwhere(~agrees)[0]
        sys.exit(
            f"{name}: expected at most {allowed} distances that differ from radarcore, got {(~agrees).sum()} of "
            f"{agrees.size}, the first in row {row}, column {column}: {distance[row, column]:.9g} m, radarcore "
            f"{image.distance[row, column]:.9g} m"
        )


# Measurement.


@contextmanager
def cores_for(threads: int) -> Iterator[None]:
    """Keep this thread, and those it starts, on one core if they are to be one, where the system can."""
    if threads > 1 or not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


def image_by(caster: Caster, view: View) -> Any:
    """Hits as the caster returns them."""
    with cores_for(caster.threads):
        return caster.cast(caster.rays(view))


def times_in_turns(casters: list[Caster], run: Run) -> list[list[float]]:
    """Median time [s] of an image by every caster, round by round."""
    times: list[list[float]] = [[] for _ in casters]
    for i in range(run.rounds):
        first, *others = [view(i * run.frames + frame, run.side) for frame in range(run.frames + 1)]
        for caster, own in zip(casters, times, strict=True):
            with cores_for(caster.threads):
                # Fills the caches; and threads that have slept begin on one core.
                for _ in range(1 if caster.threads == 1 else 20):
                    caster.cast(caster.rays(first))
                own.append(float(np.median([duration(caster.cast, caster.rays(each)) for each in others])))
    return times


def duration(action: Callable[..., object], *arguments: object) -> float:
    """Time of one call [s], without that to drop what it returns."""
    start = time.perf_counter()
    result = action(*arguments)
    stop = time.perf_counter()
    del result
    return stop - start


def scenes(run: Run) -> Iterator[tuple[str, Triangles]]:
    """Meshes whose vertices f32 holds: all casters get the same."""
    for name, make in (("room", room), ("sphere", lambda size: sphere(1.0, size, (2.0, 0.0, 0.0)))):
        for size in run.sizes:
            vertices, triangles = make(size)
            yield f"{name} {size_name(size)}", (vertices.astype(np.float32).astype(np.float64), triangles)


def size_name(size: int) -> str:
    for unit, name in ((1_000_000, "M"), (1000, "k")):
        if size >= unit:
            return f"{size // unit}{name}"
    return str(size)


def image_rows(name: str, mesh: Triangles, peers: Iterable[Peer], run: Run) -> Iterator[list[str]]:
    """All casters on one scene."""
    with cores_for(threads=1):
        scene = rc.Scene([rc.Body(rc.Mesh(*mesh, shading="flat"))])
        others = [peer(mesh) for peer in peers]
    images = depth_image(scene, run.side)
    casters = [*(tracer(scene, run.side, n) for n in (1, 2)), images, *others]

    for seen in (view(frame, run.side) for frame in (0, run.rounds * run.frames)):
        image = image_by(images, seen)
        check_in_f64(name, mesh, image, run.rays_in_f64)
        for caster in casters:
            check(f"{name}, {caster.name}", caster.distance(image_by(caster, seen)), image)

    times = dict(zip([caster.name for caster in casters], times_in_turns(casters, run), strict=True))
    for caster, own in times.items():
        peers = ("embreex", "Embree packets")
        ratios = [f"{np.median(np.divide(times[peer], own)):.3g}" if peer in times else "-" for peer in peers]
        seconds = float(np.median(own))
        yield [name, caster, milliseconds(seconds), f"{1e-6 * run.side**2 / seconds:.3g}", *ratios]


def build_row(name: str, mesh: Triangles, has_embree: bool, run: Run) -> list[str]:
    """Builds in turns."""
    ours, theirs = [], []
    with cores_for(threads=1):
        for _ in range(run.builds):
            ours.append(duration(lambda: rc.Mesh(*mesh, shading="flat")))
            if has_embree:
                theirs.append(duration(EmbreeScene(mesh).commit))
    row = [name, milliseconds(float(np.median(ours)))]
    if not has_embree:
        return [*row, "-", "-"]
    return [*row, milliseconds(float(np.median(theirs))), f"{np.median(np.divide(theirs, ours)):.3g}"]


# Rotor.


def rotor_section(run: Run) -> str:
    """Frames of the published rotor, and of one with paddles."""
    waveform = rc.Waveform(start_frequency=77e9, slope=15.625e9, sample_rate=4e6, num_samples=128, num_chirps=1024)
    spin = np.array([0.0, 0.0, 2.0 * np.pi * 80.0])
    radar = rc.Radar(waveform, pattern=rc.IsotropicPattern())
    circling = rc.Attached(
        rc.Linear(rc.Pose(), angular_velocity=spin), rc.Linear(rc.Pose([0.003, 0.0, 0.0]), angular_velocity=-spin)
    )
    point = rc.Scene([rc.PointTarget([30.0, 0.0, 0.0])])

    def paddle(turn: float) -> Triangles:
        pose = rc.Pose.from_rpy(np.zeros(3), [0.0, 0.0, turn])
        return box_grid(1, lambda points: pose.apply(points * [0.025, 0.001, 0.01] + [0.035, 0.0, 0.0]))

    mesh = rc.Mesh(*joined([paddle(turn) for turn in np.arange(4) * np.pi / 2.0]), shading="flat")
    paddles = rc.Scene([rc.Body(mesh, motion=rc.Linear(rc.Pose([3.0, 0.0, 0.0]), angular_velocity=spin))])
    fine = rc.Simulator(paddles, radar, retrace_deg=1.0, tolerance=1e-4, rcs_floor=1e-4)

    rows = []
    for name, scene, motion, sampling in (
        ("point", point, circling, "adaptive"),
        ("paddles", paddles, None, "adaptive"),
        ("paddles", paddles, None, "fast"),
    ):
        times = []
        for threads in (1, 2):
            simulator = rc.Simulator(scene, radar, radar_motion=motion, sampling=sampling, threads=threads)
            simulator.frame(0.0)
            for i in range(run.rounds):
                wall, used = time.perf_counter(), time.process_time()
                frame = simulator.frame(0.1 + 0.0327 * i)
                times.append((time.perf_counter() - wall, time.process_time() - used))
        medians = np.median(np.reshape(times, (2, run.rounds, 2)), axis=1).ravel()
        expected = circling_echo(frame) if scene is point else fine.frame(frame.time).cube
        error = f"{100.0 * np.linalg.norm(frame.cube - expected) / np.linalg.norm(expected):.2g} %"
        published = "271" if scene is point else "-"
        rows.append([name, sampling, f"{frame.stats['paths']}", error, *map(milliseconds, medians), published])
    header = ["rotor", "sampling", "paths", "error", "1 thread", "CPU of 1", "2 threads", "CPU of 2", "published"]
    text = table(header, rows)
    print(text)
    load = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
    return ROTOR_TITLE + "\n" + ROTOR_TEXT.format(machine=machine(), load=load, frames=run.rounds, table=text)


def circling_echo(frame: rc.Frame) -> NDArray[np.complex128]:
    """Samples of the circling radar in closed form, (chirp, sample)."""
    waveform = frame.radar.waveform
    fast = np.arange(waveform.num_samples) / waveform.sample_rate
    angle = 2.0 * np.pi * 80.0 * (frame.time + waveform.chirp_times[:, None] + fast)
    distance = np.hypot(30.0 - 0.003 * np.cos(angle), 0.003 * np.sin(angle))
    delay = 2.0 * distance / SPEED_OF_LIGHT
    phase = waveform.start_frequency * delay + waveform.slope * delay * (fast - 0.5 * delay)
    amplitude = SPEED_OF_LIGHT / waveform.start_frequency / ((4.0 * np.pi) ** 1.5 * distance**2)
    return amplitude * np.exp(2j * np.pi * phase)


def main() -> None:
    parser = argparse.ArgumentParser(description="Rays of images beside public libraries.")
    parser.add_argument("--tiny", action="store_true", help="once, on few rays")
    parser.add_argument("--rotor", action="store_true", help="the rotor alone")
    parser.add_argument("--write", action="store_true", help="write the section of benches/results/performance.md")
    arguments = parser.parse_args()
    run = TINY if arguments.tiny else FULL

    rotor = rotor_section(run)
    if arguments.rotor:
        if arguments.write:
            images, _, _ = section_of(PERFORMANCE, "peers").partition(ROTOR_TITLE)
            write_section(PERFORMANCE, "peers", images + rotor)
        return

    peers = installed_peers()
    rows, builds = [], []
    for name, mesh in scenes(run):
        rows += image_rows(name, mesh, peers, run)
        builds.append(build_row(name, mesh, embree_packets in peers, run))
    images_table = table(["scene", "caster", "ms", "Mray/s", "× embreex", "× Embree packets"], rows)
    builds_table = table(["scene", "Mesh", "Embree", "× Embree"], builds)
    print(images_table, builds_table, sep="\n\n")

    if arguments.write:
        text = PAGE_TEXT.format(
            side=run.side,
            machine=machine(),
            images=images_table,
            rounds=run.rounds,
            frames=run.frames,
            versions=", ".join(peers.values()) or "none installed",
            builds=builds_table,
        )
        write_section(PERFORMANCE, "peers", f"{text}\n{rotor}")


if __name__ == "__main__":
    main()
