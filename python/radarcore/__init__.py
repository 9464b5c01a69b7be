"""FMCW radar simulation for robotics."""
