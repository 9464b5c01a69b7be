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
# # Choosing a waveform and an array
#
# Which ranges, velocities and angles can a radar resolve, and how accurately? We state requirements, look at their
# limits, and check these with simulated targets.

# %%
import warnings

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import find_peaks

import radarcore as rc

MAX_RANGE = 20.0  # [m]
RANGE_RESOLUTION = 0.25  # [m]
MAX_VELOCITY = 8.0  # [m/s]
NUM_TRIALS = 200  # frames with new noise each

# %% [markdown]
# ## Requirements
#
# `Waveform.design` turns requirements into settings. `max_range` holds for real samples; I/Q samples, as here, have
# twice that. [Waveforms](../waveforms.md) has a table with the cost of each requirement.

# %%
requirements = {"max_range": MAX_RANGE, "range_resolution": RANGE_RESOLUTION, "max_velocity": MAX_VELOCITY}
waveform = rc.Waveform.design(**requirements, num_tx=3, num_chirps=64, start_frequency=76.5e9, sample_rate=5e6)
print(f"{waveform.num_samples} samples, {waveform.bandwidth / 1e6:.0f} MHz, chirps every", end=" ")
print(f"{1e6 * waveform.chirp_interval:.0f} us, velocity bins of {waveform.velocity_resolution:.2f} m/s")

# %% [markdown] Requirements compete. A finer range resolution needs longer chirps, which reduce the largest velocity.
# Conflicting requirements raise an error with the limit:

# %%
try:
    rc.bgt60tr13c(max_range=10.0, range_resolution=0.05, max_velocity=8.0, sample_rate=2e6)
except ValueError as error:
    print(error)

# %% [markdown]
# ## Resolution
#
# Two equal targets at the same velocity: closer than about one and a half range bins, they merge into one peak.

# %%
radar = rc.Radar(waveform, receiver=rc.Receiver(noise_figure_db=12.0))
figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.2), layout="constrained", sharey=True)
for apart, ax in zip((1.0, 3.0), axes, strict=True):
    places = [8.0, 8.0 + apart * waveform.range_resolution]
    pair = rc.Scene([rc.PointTarget([x, 0.0, 0.0]) for x in places])
    frame = rc.Simulator(pair, radar).frame()
    spectrum = np.abs(rc.range_profile(frame, num_bins=1024)[0, 0])
    ax.plot(waveform.range_axis(1024), 20.0 * np.log10(spectrum / spectrum.max()))
    ax.vlines(places, -40.0, 0.0, color="black", linestyle="--", label="truth")
    ax.set(xlim=(6.0, 11.0), ylim=(-40.0, 3.0), xlabel="Range [m]", title=f"Distance in range bins: {apart:.0f}")
axes[0].set_ylabel("Level [dB]")
_ = axes[0].legend()

# %% [markdown]
# ## Ambiguity
#
# Velocities are known modulo twice the largest one. A target that recedes faster seems to approach, with a warning:

# %%
for speed in (0.5 * MAX_VELOCITY, 1.25 * MAX_VELOCITY):
    receding = rc.PointTarget([8.0, 0.0, 0.0], velocity=[speed, 0.0, 0.0], name="car")
    with warnings.catch_warnings(record=True, action="always") as caught:
        peak = rc.strongest_peak(rc.Simulator(rc.Scene([receding]), radar).frame())
    folded = (speed + radar.max_velocity) % (2.0 * radar.max_velocity) - radar.max_velocity
    print(f"true {speed:+.1f} m/s: found {peak.velocity:+.2f} m/s, expected {folded:+.2f} m/s")
    for warning in caught:
        print(f"  warning: {warning.message}")

# %% [markdown]
# ## Angles
#
# Three transmitters that take turns (TDM) and four receivers form a row of twelve channels with half-wavelength spacing
# and a beam of about 8.5 degrees. Capon's method is one of four that [angles](../angles.md) compares.

# %%
half = 0.5 * waveform.wavelength
mimo = rc.Radar(
    waveform,
    tx=[[0.0, 4 * half * i, 0.0] for i in (-1, 0, 1)],
    rx=[[0.0, half * (i - 1.5), 0.0] for i in range(4)],
    pattern=rc.GaussianPattern(8.0, beamwidth_azimuth_deg=90.0, beamwidth_elevation_deg=30.0),
    receiver=rc.Receiver(noise_figure_db=12.0),
    schedule=rc.Schedule.tdm(),
)
true_deg = np.array([-15.0, 20.0])
targets = rc.Scene([rc.PointTarget([8.0 * np.cos(a), 8.0 * np.sin(a), 0.0]) for a in np.deg2rad(true_deg)])
frame = rc.Simulator(targets, mimo, field_of_view_deg=(120.0, 20.0)).frame()
figure, (upper, lower) = plt.subplots(2, 1, figsize=(7.0, 5.0), height_ratios=(1.0, 5.0), layout="constrained")
rc.plot.virtual_array(mimo, upper, unit="wavelengths").set_ylabel("z, up")
rc.plot.range_angle_map(frame, lower, method="capon", field_of_view_deg=120.0, max_range=12.0)

angles_deg = np.arange(-60.0, 60.1, 0.25)
power = rc.range_angle(frame, method="capon", azimuth=np.deg2rad(angles_deg))[
    np.abs(waveform.range_axis() - 8.0).argmin()
]
found_deg = angles_deg[find_peaks(power, height=0.1 * power.max())[0]]
print("truth", true_deg, "found", found_deg, "degrees")

# %% [markdown]
# ## How well
#
# Noise sets a limit: no unbiased estimate has a standard deviation below the Cramér-Rao bound. We measure range and
# velocity of one target in many frames with new noise, and compare. [Velocity](../velocity.md) has four methods.

# %%
weak = rc.Scene([rc.PointTarget([15.3, 0.0, 0.0], rcs=0.01, velocity=[0.7, 0.0, 0.0])])
recording = rc.Simulator(weak, radar).record(0.0, 0.02 * NUM_TRIALS, rate=50.0, progress=False)
estimates = rc.doppler_velocity(recording)
snr_db = np.median(estimates.snr_db)
bound = rc.processing.doppler_bound(waveform, snr_db)
print(f"SNR {snr_db:.1f} dB per sample")
for name, unit in (("range", "mm"), ("velocity", "mm/s")):
    errors = getattr(estimates, name) - getattr(recording.truth, name)[:, 0]
    measured, least = 1e3 * np.sqrt(np.mean(errors**2)), 1e3 * getattr(bound, name)
    print(f"{name}: errors of {measured:.2f} {unit} (rms), bound {least:.2f} {unit}")

# %% [markdown] Vary the requirements above. Twice the bandwidth halves the range error, and twice the duration halves
# the velocity error; ten times the SNR reduces both by the root of ten.
#
# Next: [a board and its simulation](board_and_simulation.py).
