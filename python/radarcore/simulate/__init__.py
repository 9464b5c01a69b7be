"""From a scene to radar frames."""
