"""Builders of radar, bodies and motions from the tables of a scene file."""
