"""How much stronger than noise is a corner reflector, and how much a plate of the same size?"""

import numpy as np

import radarcore as rc

waveform = rc.Waveform.from_sweep(start_frequency=60e9, stop_frequency=62e9, sample_rate=2e6, num_samples=128)
radar = rc.Radar(
    waveform,
    pattern=rc.GaussianPattern(6.0, beamwidth_azimuth_deg=60.0, beamwidth_elevation_deg=40.0),
    tx_power_dbm=4.0,
    receiver=rc.Receiver(output="real", noise_figure_db=12.0),
)

# A corner works by three reflections (max_bounces); all of their paths are as long as that to its apex.
conductor = rc.materials["perfect_conductor"]
corner = rc.Body(rc.shapes.trihedral(0.1), material=conductor, motion=rc.Pose([2.0, 0.0, 1.0]), name="corner")
plate = rc.Body(
    rc.shapes.plate(0.1, 0.1),
    material=conductor,
    motion=rc.Pose.look_at([3.0, 0.4, 1.0], [0.0, 0.0, 1.0]),
    name="plate",
)

simulator = rc.Simulator(
    rc.Scene([corner, plate]),
    radar,
    radar_motion=rc.Pose([0.0, 0.0, 1.0]),
    field_of_view_deg=(24.0, 8.0),
    max_bounces=3,
)

if __name__ == "__main__":
    frame = simulator.record(0.0, 0.1, rate=20.0)[0]
    profile = np.abs(rc.range_profile(frame.cube, waveform)[0, 0])  # [range]
    noise = np.median(profile)
    for name, distance in zip(frame.truth.names, frame.truth.range, strict=True):
        peak = rc.strongest_peak(frame, min_range=distance - 0.3, max_range=distance + 0.3)
        if peak is None:
            print(f"{name}: nothing above the noise, truth {distance:.3f} m")
            continue
        level = profile[round(peak.range / waveform.range_resolution)]
        print(f"{name}: {peak.range:.3f} m, truth {distance:.3f} m; {20 * np.log10(level / noise):.0f} dB above noise")
