"""Can a small classifier distinguish a walking person, a moving arm and an empty room by range-velocity maps?

Each map is drawn anew: place, heading, speed and height of the person, place and motion of the arm, furniture, noise.
The seed of the maps that it is tested on is another. Vary the distributions, or num_chirps. Needs scikit-learn.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from sklearn.ensemble import ExtraTreesClassifier
from sklearn.metrics import ConfusionMatrixDisplay

import radarcore as rc

ROOM = """
run = { start = 0.5, stop = 0.51, sampling = "fast" }
radar = { preset = "bgt60tr13c", chirp_interval = 200e-6 }
sensor.pose.position = [0.0, 0.0, 1.0]
[[body]]
shape = { kind = "box", size = [0.5, { uniform = [0.5, 1.5] }, 1.8] }
material = { choice = ["wood", "metal"] }
pose = { position = [{ uniform = [3, 5] }, { uniform = [-2, 2] }, 0.9], rpy_deg = [0, 0, { uniform = [0, 90] }] }
"""
WALKING = """
[[human]]
height = { normal = [1.72, 0.1], min = 1.5, max = 2.0, step = 0.05 }
speed = { uniform = [0.5, 1.5], step = 0.1 }
phase = { uniform = [0, 1] }
path = [[{ uniform = [1.5, 4] }, { uniform = [-1, 1] }], [{ choice = [-4, 9] }, { uniform = [-3, 3] }]]
"""
ARM = """
[[arm]]
pose = { position = [{ uniform = [1.5, 3] }, { uniform = [-1, 1] }, 0.3], rpy_deg = [0, 0, { uniform = [0, 360] }] }
joints.kind = "trajectory"
joints.times = [0.0, 1.0]
joints.angles_deg = [[0, -90, 60, 0, 90, 0], [{ uniform = [20, 75] }, { uniform = [-120, -60] }, 60, 0, 90, 0]]
"""


def levels(frame: rc.Frame) -> np.ndarray:
    """Levels over the noise [dB] by velocity, nearer than 7 m: the strongest and the mean, as from any range."""
    power = (np.abs(rc.range_doppler(frame)) ** 2).sum(axis=0)[:, :45]
    return 10.0 * np.log10(np.concatenate([power.max(axis=1), power.mean(axis=1)]) / np.median(power))


def main(count: int, output: Path) -> None:
    output.parent.mkdir(parents=True, exist_ok=True)
    x, y = {1: [], 2: []}, {1: [], 2: []}  # by seed: to learn from, and to test on
    for name, text in {"empty": ROOM, "arm": ROOM + ARM, "walking": ROOM + WALKING}.items():
        scene = output.with_name(f"{name}.toml")
        scene.write_text(text, encoding="utf-8")
        variation = rc.dataset.Variation.load(scene)
        for seed, number in {1: count, 2: count // 2}.items():
            x[seed] += [found for found, _ in rc.dataset.stream(variation, seed=seed, count=number, output=levels)]
            y[seed] += [name] * number
    model = ExtraTreesClassifier(300, random_state=0).fit(x[1], y[1])
    print(f"{len(x[1])} maps to learn from, {len(x[2])} of another seed: accuracy {model.score(x[2], y[2]):.2f}")
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.4, 1.0))
    velocity = rc.bgt60tr13c(chirp_interval=200e-6).waveform.velocity_axis()
    for name in dict.fromkeys(y[2]):
        strongest = np.array(x[2])[np.array(y[2]) == name, : len(velocity)]
        low, middle, high = np.percentile(strongest, (10.0, 50.0, 90.0), axis=0)
        left.fill_between(velocity, low, high, alpha=0.2)
        left.plot(velocity, middle, label=name)
    left.set(xlabel="Velocity [m/s, receding positive]", ylabel="Strongest range [dB over noise]")
    left.set_title("Features: median, band of 80 % of the maps", fontsize="medium")
    left.margins(x=0.0)
    left.grid(alpha=0.3)
    left.legend(loc="upper left")
    ConfusionMatrixDisplay.from_estimator(model, x[2], y[2], ax=right, colorbar=False, cmap="Blues")
    right.set_title(f"{len(x[2])} maps of another seed: {model.score(x[2], y[2]):.0%} right", fontsize="medium")
    figure.savefig(output, dpi=90)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--count", type=int, default=200, help="maps of each class to learn from")
    options.add_argument("-o", "--output", type=Path, default=Path("out/classify_motion.png"))
    main(**vars(options.parse_args()))
