"""Radar frames from depth images."""
