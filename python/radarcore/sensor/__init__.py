"""Real sensors, their emulator, and simulated scenes behind the wire protocol of a real sensor.

`open_sensor` connects to a board, `list_sensors` says which there are, `virtual_board` makes one of a scene.
"""

from radarcore.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__)

del attach
