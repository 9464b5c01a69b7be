"""Clusters of detections and their tracks over time."""
