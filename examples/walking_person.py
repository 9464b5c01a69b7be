"""What does the micro-Doppler signature of a walking person look like?"""

import radarcore as rc

waveform = rc.Waveform.from_sweep(
    start_frequency=60e9, stop_frequency=61e9, sample_rate=2e6, num_samples=64, num_chirps=64, chirp_interval=250e-6
)
radar = rc.Radar(waveform, receiver=rc.Receiver(output="iq", noise_figure_db=12.0))

person = rc.models.Human(height=1.8, speed=1.2, path=[[4.5, 0.0], [2.0, 0.0], [2.0, 3.0]])

simulator = rc.Simulator(
    rc.Scene(person.bodies(name="person")),
    radar,
    radar_motion=rc.Pose([0.0, 0.0, 1.0]),
    field_of_view_deg=(60.0, 60.0),
)

if __name__ == "__main__":
    recording = simulator.record(0.0, 3.0, rate=40.0)
    rc.plot.spectrogram(recording).figure.savefig("walking_person.png")
    print("walking_person.png")
