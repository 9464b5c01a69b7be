"""Simulation of radar frames from a scene."""
