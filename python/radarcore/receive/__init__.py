"""Receiver: effects on the ideal beat signal."""
