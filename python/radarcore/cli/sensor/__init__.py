"""The commands of `radarcore sensor`, with a file per group of them."""
