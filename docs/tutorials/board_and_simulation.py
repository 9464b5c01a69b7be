# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # A board and its simulation
#
# Measure with a board, simulate the same scene, and compare both with the truth. Here the board is emulated in this
# process: it answers byte by byte like a BGT60TR13C in front of a simulated scene. For a real board, replace one
# statement. (The emulated port is a pty, which Windows lacks.)

# %%
import matplotlib.pyplot as plt
import numpy as np

import radarcore as rc
from radarcore.sensor.emulator.pty import PtyPort

NUM_FRAMES = 24
RATE = 20.0  # frames per second


# %% [markdown]
# ## The scene
#
# A ball swings on a string, and a plate hangs beside it.


# %%
def swing(time: float) -> rc.Pose:
    """Pose of the ball at a time."""
    return rc.Pose([1.5 + 0.3 * np.sin(3.0 * time), 0.0, 0.0])


ball = rc.Body(rc.shapes.sphere(0.1), motion=swing, name="ball")
plate = rc.Body(rc.shapes.plate(0.2, 0.2), motion=rc.Pose([2.6, 0.4, 0.0]), name="plate")
scene = rc.Scene([ball, plate])
wanted = rc.bgt60tr13c(range_resolution=0.05, max_range=3.2, num_chirps=32, rate=RATE)

# %% [markdown]
# ## Measure
#
# `configure` writes the registers of the chip, and returns the achieved radar: times and frequencies are rounded to the
# chip's steps. With a real board, replace the three lines in brackets with `rc.open_sensor() as sensor`.
# [Sensors](../sensor.md) explains the connection; `radarcore sensor selftest` checks it.

# %%
room = rc.Simulator(scene, rc.bgt60tr13c(), field_of_view_deg=(30.0, 10.0))
with (
    rc.sensor.virtual_board(room, speed=None) as board,  # as fast as it is read
    PtyPort(board) as port,
    rc.open_sensor(port.path) as sensor,
):
    achieved = sensor.configure(wanted)
    measured = rc.Recording.from_frames(sensor.frames(NUM_FRAMES))
    print(f"{sensor.info.chip}: {len(measured)} frames, {sensor.num_lost} lost")
measured

# %% [markdown]
# `save` stores a recording, `Recording.load` loads it: [recordings](../recordings.md).

# %%
measured.save("out/measured", overwrite=True)
measured = rc.Recording.load("out/measured")

# %% [markdown]
# ## Remove static echoes
#
# A board receives its own transmitter, at 0 m and stronger than any echo. Leakage and static echoes are equal in all
# frames.

# %%
moving = rc.remove_mean(measured)
figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.4), layout="constrained")
for one, title, ax in ((measured, "As measured", axes[0]), (moving, "Without what stands still", axes[1])):
    rc.plot.range_time(one, ax, max_range=3.2)
    ax.set_title(title)

# %% [markdown]
# ## Simulate the same
#
# The same scene, simulated with the achieved radar of the board.

# %%
simulator = rc.Simulator(scene, achieved, field_of_view_deg=(30.0, 10.0))
simulated = simulator.record(0.0, NUM_FRAMES / RATE, rate=RATE, progress=False)
simulated

# %% [markdown]
# ## Compare
#
# Both recordings are tracked separately, and their tracks are compared with the truth in fractions of a bin. Shares
# count the frames with errors below half a range bin, or below a velocity bin. [Comparison](../comparison.md) explains
# the measures and the alignment of clocks.

# %%
compared = rc.compare(simulated, rc.remove_mean(measured), range_only=True, progress=False)
for name, errors in zip(("simulated", "measured"), compared["ball"].errors, strict=True):
    print(f"{name}: {errors.num_tracked} of {errors.num_frames} frames,", end=" ")
    print(f"ranges {errors.range_share:.0%}, velocities {errors.velocity_share:.0%} within limits")

# %%
compared.figure(max_range=3.0)

# %% [markdown] When the ball turns, at 0.5 s, it is at rest for a moment, and `remove_mean` removes a part of its echo,
# too: two measured velocities are wrong. They are right in a comparison of `measured` itself.
#
# This is how to build trust in a model: where both agree with the truth, simulate scenes that you cannot measure.
