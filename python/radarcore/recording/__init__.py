"""Frames and recordings, and the formats they have on disk."""
