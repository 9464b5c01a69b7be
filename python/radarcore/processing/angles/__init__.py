"""Directions of echoes and patterns of arrays."""
