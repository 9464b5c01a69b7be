"""Plots of frames as they come."""
