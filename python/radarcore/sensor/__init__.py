"""Real sensors, their emulator, and simulated scenes behind the wire protocol of a real sensor."""
