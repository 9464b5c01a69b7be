"""Detections and the strongest peak of a frame."""
