"""The experiment that `radarcore demo` runs."""
