"""Scene files: one TOML file describes the radar, its scene and the run.

Keys are in SI units unless their name ends otherwise (`_deg`, `_db`, `_dbm`); `radarcore schema` lists them all.
Unknown keys are errors; paths are relative to the file.
"""
