"""What does a radar see where there is only the depth image of a camera or of another simulator?

Two depth images at an interval of 25 ms replace the scene: every pixel becomes an echo, and the difference of both
images gives its velocity. The images here are drawn by radarcore, which also simulates the frame of the meshes for
comparison; put yours in their place. Vary the number of pixels, and round the depth to whole millimetres: the
velocities are lost.
"""

import argparse
from dataclasses import replace
from pathlib import Path

from matplotlib.figure import Figure

import radarcore as rc

VIEW, SIDE, INTERVAL = (60.0, 50.0), 256, 0.025  # [degrees], pixels, [s]

radar = rc.bgt60tr13c(num_chirps=64)
person = rc.models.Human(height=1.75, speed=1.2, path=[[3.4, 0.6], [0.5, 0.6]])
rolling = rc.Linear(rc.Pose([1.2, -0.5, 1.0]), velocity=[1.5, 0.0, 0.0])
ball = rc.Body(rc.shapes.sphere(0.15), motion=rolling, name="ball")
post = rc.Body(rc.shapes.cylinder(0.08, 1.2), motion=rc.Pose([3.6, -0.4, 1.0]), name="post")
scene = rc.Scene([ball, post, *person.bodies(name="person")])
sensor = rc.Pose([0.0, 0.0, 1.0])
simulator = rc.Simulator(scene, radar, radar_motion=sensor, field_of_view_deg=VIEW, resolution=SIDE)


def main(output: Path) -> None:
    time = 0.5
    image, before = simulator.depth_image(time), simulator.depth_image(time - INTERVAL)
    motion = {"previous": before.distance, "interval": INTERVAL}
    # The power reflectance, 0.5: a number, an image, or a grey image.
    frame = rc.frame_from_depth(image.distance, 0.5, radar, camera=VIEW, time=time, **motion)
    meshes = simulator.frame(time)
    truth = meshes.truth.select(["ball", "post", "person/trunk"])
    for name, distance, velocity in zip(truth.names, truth.range, truth.velocity, strict=True):
        limits = {"min_velocity": velocity - 0.3, "max_velocity": velocity + 0.3}
        a, b = (rc.strongest_peak(one, **limits) for one in (frame, meshes))
        by_depth, by_meshes = (f"{peak.range:.2f} m {peak.velocity:+.2f} m/s" for peak in (a, b))
        print(f"{name}: {by_depth} by depth, {by_meshes} by meshes, truth {distance:.2f} m {velocity:+.2f} m/s")

    figure = Figure(figsize=(11.0, 3.6), layout="constrained")
    axes = figure.subplots(1, 3)
    rc.plot.depth_image(image, axes[0]).set_title("Depth image in")
    for one, ax, name in ((frame, axes[1], "depth images"), (meshes, axes[2], "meshes")):
        rc.plot.range_doppler_map(replace(one, truth=truth), ax=ax, max_range=5.0, max_velocity=3.0)
        ax.set_title(f"Radar frame of {name}")
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=90)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("-o", "--output", type=Path, default=Path("out/depth_camera.png"))
    main(**vars(options.parse_args()))
