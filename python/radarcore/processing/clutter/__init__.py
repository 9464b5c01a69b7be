"""Filters against static echoes."""
