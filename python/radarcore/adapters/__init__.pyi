from radarcore.adapters import coppeliasim as coppeliasim
from radarcore.adapters import images as images
from radarcore.adapters import rerun as rerun
