"""FMCW radar simulation for robotics: meshes in, ADC samples and range-velocity maps out.

SI units and radians unless a name says otherwise; cubes are ``[frame, channel, chirp, sample]``; velocity is range
rate, receding positive; the sensor looks along +x, y is left and z up.
"""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)

del attach
