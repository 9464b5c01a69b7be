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
# process: it answers byte by byte as a BGT60TR13C does, and a simulated scene stands in front of it. With a board of
# your own, replace one statement. (The port of the emulated board is a pty, which Windows has not.)

# %%
import matplotlib.pyplot as plt
import numpy as np

import radarcore as rc
from radarcore.sensor.emulator.pty import PtyPort

NUM_FRAMES = 24
RATE = 20.0  # frames per second


# %% [markdown]
# ## What stands before the radar
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
# `configure` writes the registers of the chip, and returns the radar as achieved: times and frequencies come in the
# chip's own steps. With a real board the three lines in brackets are one, `rc.open_sensor() as sensor`.
# [Sensors](../sensor.md) tells how to connect one; `radarcore sensor selftest` checks it.

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
# A recording is kept with `save`, and loaded again with `Recording.load`: [recordings](../recordings.md).

# %%
measured.save("out/measured", overwrite=True)
measured = rc.Recording.load("out/measured")

# %% [markdown]
# ## Take off what stands still
#
# A board hears its own transmitter, at 0 m and louder than any echo. The leakage is the same in all frames, and so are
# the echoes of all that stands still.

# %%
moving = rc.remove_mean(measured)
figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.4), layout="constrained")
for one, title, ax in ((measured, "As measured", axes[0]), (moving, "Without what stands still", axes[1])):
    rc.plot.range_time(one, ax, max_range=3.2)
    ax.set_title(title)

# %% [markdown]
# ## Simulate the same
#
# The same scene, simulated with the radar that the board has made of our wishes.

# %%
simulator = rc.Simulator(scene, achieved, field_of_view_deg=(30.0, 10.0))
simulated = simulator.record(0.0, NUM_FRAMES / RATE, rate=RATE, progress=False)
simulated

# %% [markdown]
# ## Compare
#
# Both recordings are tracked, each on its own, and their tracks compared with the truth in fractions of a bin. Shares
# are of the frames in which the error is below half a range bin, or below a velocity bin.
# [Comparison](../comparison.md) says what is compared, and how clocks that differ are aligned.

# %%
compared = rc.compare(simulated, rc.remove_mean(measured), range_only=True, progress=False)
for name, errors in zip(("simulated", "measured"), compared["ball"].errors, strict=True):
    print(f"{name}: {errors.num_tracked} of {errors.num_frames} frames,", end=" ")
    print(f"ranges {errors.range_share:.0%}, velocities {errors.velocity_share:.0%} within limits")

# %%
compared.figure(max_range=3.0)

# %% [markdown]
# Where the ball turns, at 0.5 s, it stands still for a moment, and `remove_mean` has taken off a part of its echo, too:
# two of the measured velocities are off. Compare `measured` itself, and they are not.
#
# That is the way from a board to a model that you trust: where both agree with the truth, simulate what you cannot
# measure.
