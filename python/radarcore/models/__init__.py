"""Models of what a sensor meets: robots and people."""
