"""Scene of a radar: bodies, points, materials."""
