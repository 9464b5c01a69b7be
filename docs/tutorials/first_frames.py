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
# # First frames
#
# A metal ball flies towards a radar, a plate stands behind it. We simulate the received samples, compute a map of
# ranges and velocities, and compare detections with the truth.

# %%
import matplotlib.pyplot as plt

import radarcore as rc

SPEED = 1.2  # of the ball [m/s]; vary it, also beyond what the radar is asked to see below
MAX_VELOCITY = 3.0  # [m/s]

# %% [markdown]
# ## A scene
#
# A scene holds bodies, each with a mesh, a material and a motion. x points forward, y to the left, z up; lengths are in
# metres, times in seconds. Files contain your own meshes: [my own mesh](../own-mesh.md).

# %%
metal = rc.materials["metal"]
flight = rc.Linear(rc.Pose([2.5, 0.2, 0.0]), velocity=[-SPEED, 0.0, 0.0])
ball = rc.Body(rc.shapes.sphere(0.1), material=metal, motion=flight, name="ball")
plate = rc.Body(rc.shapes.plate(0.4, 0.4), material=metal, motion=rc.Pose([4.0, -0.5, 0.0]), name="plate")
scene = rc.Scene([ball, plate])

# %% [markdown]
# ## A radar
#
# `bgt60tr13c` is a chip with one transmitter and three receivers at 60 GHz. We state requirements; the settings follow,
# within the limits of the chip. [Waveforms](../waveforms.md) lists the cost of each requirement.

# %%
radar = rc.bgt60tr13c(max_range=6.0, range_resolution=0.06, max_velocity=MAX_VELOCITY, rate=20.0)
radar

# %% [markdown]
# ## A frame
#
# A frame is a burst of chirps. Its cube has the samples `[channel, chirp, sample]`, as the ADC delivers them. The frame
# also has the [truth](../truth.md): the nearest points of the bodies in the middle of the frame.

# %%
simulator = rc.Simulator(scene, radar)
frame = simulator.frame()
frame

# %% [markdown]
# One chirp, sample by sample. Every echo is a tone; the farther away, the higher its frequency.

# %%
figure, ax = plt.subplots(figsize=(7.0, 2.8), layout="constrained")
_ = rc.plot.chirp(frame, ax=ax)

# %% [markdown]
# ## Ranges and velocities
#
# A Fourier transform over the samples gives ranges, another one over the chirps gives velocities. Approaching is
# negative: velocity is the rate at which the range grows. Crosses are the truth.

# %%
figure, ax = plt.subplots(figsize=(7.0, 3.6), layout="constrained")
_ = rc.plot.range_doppler_map(frame, ax=ax, max_range=5.0)

# %% [markdown]
# ## Against the truth
#
# `detect` finds echoes above the noise, and interpolates between the cells of the map. [Detection](../detection.md)
# has the details.

# %%
detections = rc.detect(frame)
for name, true_range, true_velocity in zip(frame.truth.names, frame.truth.range, frame.truth.velocity, strict=True):
    k = abs(detections.range - true_range).argmin()
    print(f"{name}: {detections.range[k]:.2f} m, {detections.velocity[k]:+z.2f} m/s, ", end="")
    print(f"{detections.snr_db[k]:.0f} dB over noise; truth {true_range:.2f} m, {true_velocity:+.2f} m/s")

# %% [markdown] Now set `SPEED` to 4.0 and run all cells again. A warning appears: the ball exceeds the maximum velocity
# and seems to recede at 2 m/s, because velocities are known only modulo `2 * radar.max_velocity`.
#
# Next: [a robot arm and a walking person](arm_and_person.py).
