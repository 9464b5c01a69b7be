"""Windows, transforms and noise levels."""
