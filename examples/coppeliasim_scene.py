"""What does a radar see in a scene of CoppeliaSim, by its meshes and by the depth image of a vision sensor?

Usage: coppeliasim_scene.py [HOST:PORT [VISION_SENSOR [TIMEOUT]]], default: localhost:23000 /radar 5
"""

import sys

import radarcore as rc
from radarcore.adapters import coppeliasim

radar = rc.bgt60tr13c(
    start_frequency=60e9,
    stop_frequency=61e9,
    num_samples=128,
    num_chirps=64,
    chirp_interval=300e-6,
)


def text(peak: rc.processing.Peak | None) -> str:
    """Range and velocity of an echo."""
    return "nothing" if peak is None else f"{peak.range:.2f} m {peak.velocity:+.2f} m/s"


def watch(scene: coppeliasim.CoppeliaSim, sensor_path: str, num_steps: int = 20) -> None:
    """Run the scene, and print the strongest echo of every step on both routes."""
    sensor = scene.vision_sensor(sensor_path)
    simulator = rc.Simulator(rc.Scene(scene.bodies()), radar, radar_motion=sensor.motion)
    with scene.running():
        before = sensor.image()
        for _ in range(num_steps):
            time = scene.step()
            traced = simulator.frame(time)
            image = sensor.image()
            seen = rc.frame_from_depth(
                image.depth,
                image.grey,  # bright is reflecting
                radar,
                camera=image.camera,
                planar=True,
                previous=before.depth,
                interval=image.time - before.time,
                sampling="point",
                time=time,
            )
            before = image
            peaks = [text(rc.strongest_peak(frame, min_range=0.3)) for frame in (traced, seen)]
            print(f"{time:.3f} s: meshes {peaks[0]}, depth image {peaks[1]}")


if __name__ == "__main__":
    defaults = ["localhost:23000", "/radar", "5"]
    address, path, timeout = sys.argv[1:] + defaults[len(sys.argv) - 1 :]
    host, _, port = address.partition(":")
    try:
        with coppeliasim.CoppeliaSim(host, int(port or 23000), timeout=float(timeout)) as scene:
            watch(scene, path)
    except coppeliasim.CoppeliaSimError as error:
        sys.exit(f"{error}")
