"""Pictures of frames, recordings and scenes: one call each, into given axes or a new figure.

Figures are made without pyplot, so no window opens and no backend changes: save one with
``ax.figure.savefig(path)``, or show it in a notebook by its name (after ``%matplotlib inline``).
"""

from radarcore.plot.above import scene_from_above
from radarcore.plot.canvas import require
from radarcore.plot.figures import experiment, overview
from radarcore.plot.frame import Image, chirp, depth_image, range_doppler_map, range_profile, reflectance_image
from radarcore.plot.history import range_time, spectrogram, tracks
from radarcore.plot.live.view import LiveView
from radarcore.plot.live.window import view

__all__ = [
    "Image",
    "LiveView",
    "chirp",
    "depth_image",
    "experiment",
    "overview",
    "range_doppler_map",
    "range_profile",
    "range_time",
    "reflectance_image",
    "require",
    "scene_from_above",
    "spectrogram",
    "tracks",
    "view",
]
