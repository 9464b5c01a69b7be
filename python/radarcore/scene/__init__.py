"""What a radar looks at: bodies, points, materials."""
