"""Motions: poses and their rates as functions of time, and deformations."""
