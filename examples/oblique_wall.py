"""Does a radar see a wall that it looks at obliquely?

A smooth wall is a mirror: the echo comes from the radar's image behind it. Where the foot of the perpendicular is off
the wall, nothing comes back. A rough wall always returns something, with speckle. Vary the width and the material.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import radarcore as rc

DISTANCE, WIDTH = 2.0, 2.0  # of the wall's middle [m]
radar = rc.bgt60tr13c(num_chirps=16)
materials = {"smooth metal": rc.materials["metal"], "rough, albedo 0.3": rc.Material.lambertian(0.3)}


def scene(angle_deg: float, material: rc.Material) -> rc.Scene:
    pose = rc.Pose.from_rpy([DISTANCE, 0.0, 0.0], [0.0, 0.0, np.deg2rad(angle_deg)])
    return rc.Scene([rc.Body(rc.shapes.plate(WIDTH, 1.0), material=material, motion=pose, name="wall")])


def level_dbm(angle_deg: float, material: rc.Material) -> float:
    """Power of all ranges together, mean over the channels; real samples hold half of a tone's."""
    frame = rc.Simulator(scene(angle_deg, material), radar, field_of_view_deg=(90.0, 30.0)).frame(0.0)
    return 10.0 * np.log10(2.0 * np.var(frame.cube.mean(axis=1), axis=-1).mean()) + 30.0


def main(output: Path, step_deg: float) -> None:
    angles = np.arange(0.0, 61.0, step_deg)
    last = np.rad2deg(np.arcsin(0.5 * WIDTH / DISTANCE))  # the foot is on the wall up to here
    seen = np.deg2rad(angles[angles < last])
    gain = radar.pattern.gain(azimuth=seen, elevation=0.0) * radar.waveform.wavelength
    image_dbm = radar.tx_power_dbm + 20.0 * np.log10(gain / (8.0 * np.pi * DISTANCE * np.cos(seen)))
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    above, ax = figure.subplots(1, 2, width_ratios=(1.0, 1.6))
    levels = np.array([[level_dbm(angle, material) for angle in angles] for material in materials.values()])
    ax.plot(angles, levels.T, ".-", label=list(materials))
    ax.plot(np.rad2deg(seen), image_dbm, "k--", linewidth=3.0, alpha=0.4, label="image of the radar")
    ax.axvline(last, color="0.4", linewidth=1.0, label="foot of the perpendicular leaves the wall")
    ax.set(ylim=(-115.0, -55.0), xlabel="Angle of the wall [°]", ylabel="Received power [dBm]")
    ax.legend(loc="upper right", ncols=2, fontsize=8)
    print(f"at 0 degrees {levels[0, 0]:.1f} dBm, image of the radar {image_dbm[0]:.1f} dBm")
    less, rough = levels[:, 0] - levels[:, -1]
    print(f"at {angles[-1]:.0f} degrees the smooth wall {less:.0f} dB less, the rough wall {rough:.0f} dB")
    rc.plot.scene_from_above(scene(45.0, materials["smooth metal"]), ax=above, field_of_view_deg=(90.0, 30.0))
    above.plot([1.3, 1.0, 0.0], [0.7, 1.0, 0.0], color="tab:blue", linestyle="--", linewidth=1.5)
    above.set_title("At 45° the perpendicular (dashed) misses", fontsize="medium")
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=90)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("-o", "--output", type=Path, default=Path("out/oblique_wall.png"))
    options.add_argument("--step-deg", type=float, default=5.0)
    main(**vars(options.parse_args()))
