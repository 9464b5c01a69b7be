"""The command `radarcore`."""
