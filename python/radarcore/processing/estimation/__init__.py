"""Velocity estimates of a single echo and their Cramér-Rao bounds."""
