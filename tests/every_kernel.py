"""Run every kernel of the core, in a thread with 512 kB of stack; writes hashes and errors into a folder.

Run as a process of its own: a process has one level of kernels and one stack size.
"""

from __future__ import annotations

import hashlib
import json
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import radarcore as rc
from fast_sums import moving, steady
from path_scenes import allowance, relative_error, scene_paths
from radarcore import _core

STACK = 512 * 1024


def digest(*arrays: Any) -> str:
    """Hash of the bits of arrays."""
    return hashlib.sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)).hexdigest()


def scene() -> rc.Scene:
    """An approaching ball, a turning plate, a static corner and a point."""
    turning = rc.Linear(rc.Pose([1.5, 0.4, 0.0]), angular_velocity=[0.0, 0.0, 2.0])
    return rc.Scene(
        [
            rc.Body(rc.shapes.sphere(0.1), motion=rc.Linear(rc.Pose([1.0, 0.0, 0.1]), velocity=[-1.0, 0.0, 0.0])),
            rc.Body(rc.shapes.plate(0.2, 0.2), material=rc.materials["concrete"], motion=turning),
            rc.Body(rc.shapes.dihedral(0.1, 0.1), motion=rc.Pose([1.4, -0.4, 0.0])),
            rc.PointTarget([2.0, 0.1, 0.0], velocity=[0.5, 0.0, 0.0]),
        ]
    )


def sums() -> dict[str, Any]:
    """Sums by both NUFFTs, to tolerances of every width: largest error in units of its bound, and the kernels used."""
    wf = rc.Waveform(
        start_frequency=60e9, slope=1.5e13, sample_rate=2e6, num_samples=64, num_chirps=32, chirp_interval=3e-4
    )
    errors, kernels = [], set()
    in_phase = scene_paths("facing", wf, 500, np.random.default_rng(0))
    for paths in (moving(500), steady(0, 3000), steady(2000), steady(2000, 1000), in_phase):
        exact = paths.exact(wf)
        for digits in range(1, 12):
            tolerance = 0.1**digits
            got, report = paths.signal(wf, tolerance=tolerance, method="grid")
            bound = tolerance + allowance(exact, paths, wf, tolerance)
            errors.append(float(relative_error(got, exact, paths).max()) / bound)
            kernels.add((report.engine, report.precision, report.width))
    return {"direct": digest(moving(500).exact(wf)), "worst": max(errors), "kernels": sorted(kernels)}


def frames() -> dict[str, Any]:
    """Frames of every sampling, hits, noise and far fields."""
    radar = replace(rc.bgt60tr13c(num_chirps=32, num_samples=64), receiver=None)
    results: dict[str, Any] = {"frames": {}}
    for name, settings in (
        ("adaptive", {}),
        ("low floor", {"rcs_floor": 1e-5, "tolerance": 1e-5}),
        ("bounces", {"max_bounces": 3, "tolerance": 1e-7}),
        ("pixels", {"sampling": "footprint", "resolution": 64}),
    ):
        sim = rc.Simulator(scene(), radar, **({"max_bounces": 1} | settings))
        recording = sim.record(0.0, 0.1, 40.0, progress=False)
        cube = recording.cube.astype(np.complex128)
        some = cube.ravel()[:: cube.size // 50] / np.sqrt(np.mean(np.abs(cube) ** 2))
        results["frames"][name] = digest(cube), np.stack([some.real, some.imag], axis=1).ravel().tolist()
    image = sim.depth_image(0.0)
    results["hits"] = digest(image.distance, image.body)
    noise = np.zeros(1000, np.float32)
    _core.add_noise(noise, [1], 1.0, 0.0)
    results["noise"] = digest(noise)
    results["rcs"] = rc.rcs(rc.shapes.dihedral(0.1, 0.1), 20e9, [[-1.0, 0.0, 0.0]], max_bounces=2).tolist()
    return results


def equal_triangles() -> dict[str, Any]:
    """A frame of thousands of equal triangles."""
    mesh = rc.Mesh(np.eye(3), np.tile([[0, 1, 2]], (3000, 1)))
    rc.Simulator(rc.Scene([rc.Body(mesh, motion=rc.Pose([2.0, 0.0, 0.0]))]), rc.bgt60tr13c(num_chirps=4)).frame(0.0)
    return {}


def without_kernels(folder: Path) -> dict[str, Any]:
    """A polygon of thousands of corners from a file, and tracks: equal at every level."""
    angles = np.linspace(0.0, 2.0 * np.pi, 4000, endpoint=False)
    radii = np.where(np.arange(4000) % 2, 1.0, 0.5)
    corners = np.stack([np.zeros(4000), radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["f " + " ".join(str(i + 1) for i in range(4000))]
    path = folder / "star.obj"
    path.write_text("\n".join(lines))
    tracks = list(rc.track(rc.Simulator(scene(), rc.bgt60tr13c()).record(0.0, 0.1, 40.0, progress=False)))
    return {"triangles": len(rc.load_mesh(path).triangles), "tracks": len(tracks)}


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    found: dict[str, Any] = {"level": _core.levels()[-1]}
    threading.stack_size(STACK)
    works: list[Callable[[], dict[str, Any]]] = [sums, frames, equal_triangles]
    if found["level"] == "baseline":
        works.append(lambda: without_kernels(folder))
    with ThreadPoolExecutor(1) as thread:
        for work in works:
            found |= thread.submit(work).result()
    (folder / "found.json").write_text(json.dumps(found))
