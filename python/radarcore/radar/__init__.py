"""Settings of a radar: waveform, antennas, receiver, and presets of real sensors."""
