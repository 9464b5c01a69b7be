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
# # A robot arm and a walking person
#
# A robot arm reaches forward with a radar on its flange, and a person walks past. Where is the person? We define the
# motions, record some frames, remove static echoes, track the person, and look at the gait.

# %%
import matplotlib.pyplot as plt
import numpy as np

import radarcore as rc

DURATION = 1.0  # of the recording [s]
RATE = 10.0  # frames per second
ARM_SPEED = 0.25  # [m/s]
WALKING_SPEED = 1.0  # [m/s]

# %% [markdown]
# ## Motions
#
# The arm moves its flange along a straight line. The radar is mounted on it: its motion is the flange motion times a
# pose. [Arms](../robots.md) come by name or from URDF files, too.

# %%
arm = rc.models.RobotArm.ur10()
start = np.deg2rad([0.0, -112.0, 134.6, -22.6, 90.0, 0.0])
reach = rc.models.cartesian_line(arm, start, direction=[1.0, 0.0, 0.0], speed=ARM_SPEED, duration=2.0)
moving_arm = arm.moving(reach, base=rc.Pose([0.0, 0.0, 0.7]))
radar_motion = rc.Attached(moving_arm.link_motion("tool0"), rc.Pose([0.0, 0.0, 0.05]) @ rc.models.RADAR_AT_TOOL0)
for time in (0.0, DURATION):
    print(f"{time:.1f} s: radar at", np.round(radar_motion.at(time).position, 2), "m")

# %% [markdown]
# The person walks along a path. Every limb is a body of the scene with its own motion.

# %%
person = rc.models.Human(height=1.75, speed=WALKING_SPEED, path=[[4.8, -1.0], [2.6, 1.0]])
post = rc.Body(rc.shapes.cylinder(0.06, 0.5), motion=rc.Pose([2.4, 0.2, 1.0]), name="post")
scene = rc.Scene([post, *person.bodies(name="person"), *moving_arm.bodies(name="arm")])

figure, ax = plt.subplots(figsize=(6.0, 4.0), layout="constrained")
_ = rc.plot.scene_from_above(scene, radar_motion, np.linspace(0.0, DURATION, 4), ax)

# %% [markdown]
# ## A recording
#
# `record` simulates frame after frame. With `path=` it writes to a folder instead, for recordings that do not fit in
# memory: [recordings](../recordings.md).

# %%
radar = rc.bgt60tr13c(start_frequency=60e9, stop_frequency=61.5e9, num_chirps=64, chirp_interval=300e-6)
simulator = rc.Simulator(scene, radar, radar_motion=radar_motion, field_of_view_deg=(90.0, 60.0))
recording = simulator.record(0.0, DURATION, rate=RATE, progress=False)
recording

# %% [markdown]
# ## Static echoes
#
# Relative to the moving radar, the post moves, too. The arm knows the velocity of its flange, and `remove_static`
# removes all echoes with the velocity of the ground: [moving radar](../ego-motion.md).

# %%
times = recording.time + radar.middle  # the middle of every frame
velocities = [radar_motion.at(t).rotation.T @ radar_motion.rate_at(t)[:, 3] for t in times]  # in the sensor's axes
without_static = rc.remove_static(recording, velocities)
trunk = recording.truth.select(["person/trunk"]).range[:, 0]
for name, one in (("as it is", recording), ("without what stands still", without_static)):
    peaks = [rc.strongest_peak(frame) for frame in one.frames()]
    hits = sum(peak is not None and abs(peak.range - r) < 0.4 for peak, r in zip(peaks, trunk, strict=True))
    print(f"{name}: the person is the strongest echo in {hits} of {len(one)} frames")

# %% [markdown]
# ## Tracks
#
# A person gives many detections: trunk, arms, legs. `track` groups them, whatever their velocities, and follows the
# groups through the frames, on the floor: `num_dimensions=2`. More in [tracking](../tracking.md).

# %%
people = {"cluster_distance": 0.5, "cluster_velocity": None, "extent": 0.1, "velocity_extent": 0.3}
tracks = rc.track(without_static, num_dimensions=2, **people)
figure, ax = plt.subplots(figsize=(7.0, 3.6), layout="constrained")
_ = rc.plot.tracks(without_static, tracks, ax)
longest = max(tracks, key=lambda track: track.num_hits)
print(f"{len(tracks)} track(s); the longest is seen in {longest.num_hits} of {len(recording)} frames")

# %% [markdown]
# ## Gait
#
# The spectrogram shows velocities over time: legs and arms swing about the trunk. Here a radar at rest sees the same
# person. Dashed lines are the truth.

# %%
alone = rc.Scene(person.bodies(name="person"))
at_rest = rc.Simulator(alone, radar, radar_motion=rc.Pose([0.0, 0.0, 1.0]), field_of_view_deg=(90.0, 60.0))
watched = at_rest.record(0.0, DURATION, rate=4.0 * RATE, progress=False)
figure, ax = plt.subplots(figsize=(7.0, 3.6), layout="constrained")
names = ["person/trunk", "person/right_foot"]
_ = rc.plot.spectrogram(watched, ax, names=names)

# %% [markdown] Vary `WALKING_SPEED` and the path: a person who walks across the view has small range rates and is hard
# to see.
#
# Next: [choosing a waveform and an array](waveform_and_array.py).
