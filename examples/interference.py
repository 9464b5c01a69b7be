"""What does another car's radar do to ours: one chirp with the burst, and the floor of the range-velocity map?"""

import numpy as np

import radarcore as rc

horn = rc.GaussianPattern(13.0, beamwidth_azimuth_deg=60.0, beamwidth_elevation_deg=15.0)
ours = rc.Waveform.from_sweep(
    start_frequency=76.4e9,
    stop_frequency=76.8e9,
    sample_rate=20e6,
    num_samples=512,
    num_chirps=128,
    chirp_interval=32e-6,
    adc_delay=4e-6,
)
# Falling, slower ramps of the same band.
theirs = rc.Waveform.from_sweep(
    start_frequency=76.9e9,
    stop_frequency=76.3e9,
    sample_rate=20e6,
    num_samples=1000,
    num_chirps=100,
    chirp_interval=57e-6,
    frame_interval=7e-3,
)
radar = rc.Radar(ours, pattern=horn, tx_power_dbm=12.0, receiver=rc.Receiver(noise_figure_db=12.0))
other = rc.Radar(theirs, pattern=horn, tx_power_dbm=12.0)

targets = [
    rc.PointTarget([40.0, -2.0, 0.0], rcs=10.0, velocity=[5.0, 0.0, 0.0], name="car"),
    rc.PointTarget([25.0, 2.0, 0.0], rcs=1.0, velocity=[-6.0, 0.0, 0.0], name="cyclist"),
    rc.PointTarget([18.0, -4.0, 0.0], rcs=0.02, velocity=[0.0, 1.0, 0.0], name="child"),
]
oncoming = rc.Linear(rc.Pose.look_at([30.0, 3.5, 0.0], [0.0, 3.5, 0.0]), velocity=[-10.0, 0.0, 0.0])
interferer = rc.Interferer(other, oncoming, start=0.3e-3, name="oncoming")

simulator = rc.Simulator(rc.Scene([*targets, interferer]), radar)
alone = rc.Simulator(rc.Scene(targets), radar)


def level_db(frame: rc.Frame, noise: float) -> np.ndarray:
    """Range-velocity map of a frame [velocity, range] in dB over a noise power."""
    return 10.0 * np.log10(np.abs(rc.range_doppler(frame.cube, ours)[0]) ** 2 / noise)


def peak_db(level: np.ndarray, target: rc.PointTarget) -> float:
    """Largest level in the cells around a target."""
    distance = np.linalg.norm(target.position)
    velocity = target.velocity @ target.position / distance
    row, column = (
        int(np.abs(axis - value).argmin())
        for axis, value in ((ours.velocity_axis(), velocity), (ours.range_axis(), distance))
    )
    return float(level[row - 1 : row + 2, column - 1 : column + 2].max())


def picture(frames: list[rc.Frame], levels: list[np.ndarray], path: str) -> None:
    """One chirp of two frames above their maps."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 8.0), layout="constrained")
    panels = figure.subplots(2, 2)
    chirp = int(np.abs(frames[1].cube[0]).max(axis=1).argmax())
    for column, (frame, level, title) in enumerate(zip(frames, levels, ("alone", "with an interferer"), strict=True)):
        rc.plot.chirp(frame, 0, chirp, panels[0, column]).set_title(f"Chirp {chirp}, {title}")
        mesh = panels[1, column].pcolormesh(
            ours.range_axis()[:256], ours.velocity_axis(), level[:, :256], vmin=-10.0, vmax=50.0, rasterized=True
        )
        panels[1, column].set(xlabel="Range [m]", ylabel="Velocity [m/s]", title=f"Range-velocity map, {title}")
        for target in targets:
            distance = float(np.linalg.norm(target.position))
            velocity = float(target.velocity @ target.position) / distance
            panels[1, column].annotate(
                target.name, (distance, velocity), (6, 6), textcoords="offset points", color="white"
            )
    figure.colorbar(mesh, ax=panels[1, :], label="Power over thermal noise [dB]")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    frames = [alone.frame(), simulator.frame()]
    noise = float(np.median(np.abs(rc.range_doppler(frames[0].cube, ours)[0]) ** 2))
    levels = [level_db(frame, noise) for frame in frames]
    stats = frames[1].stats
    print(f"received from the interferer: {10.0 * np.log10(stats['strongest_interferer']) + 30.0:.1f} dBm")
    print(f"chirps hit: {stats['chirps_hit']} of {ours.num_chirps}")
    burst = ours.sample_rate / abs(ours.slope - theirs.slope)
    print(f"a crossing lasts {1e6 * burst:.2f} us, {burst * ours.sample_rate:.0f} of {ours.num_samples} samples")
    print(f"floor raised by {np.median(levels[1]) - np.median(levels[0]):.1f} dB")
    for target in targets:
        over = [peak_db(level, target) - np.median(level) for level in levels]
        print(f"{target.name}: {over[0]:.1f} dB over the floor alone, {over[1]:.1f} dB with the interferer")
    picture(frames, levels, "interference.png")
    print("interference.png")
