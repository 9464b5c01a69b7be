"""Real sensors, their emulator, and simulated scenes behind the wire protocol of a real sensor.

`open_sensor` connects to a board, `list_sensors` says which there are, `virtual_board` makes one of a scene.
"""

from radarcore.sensor.board import BoardInfo
from radarcore.sensor.device import Sensor, list_sensors, open_sensor
from radarcore.sensor.errors import (
    FramesLostWarning,
    ProtocolError,
    RequestError,
    SensorDisconnectedError,
    SensorError,
    SensorNotFoundError,
    SensorTimeoutError,
)
from radarcore.virtual.board import VirtualBoard, virtual_board

__all__ = [
    "BoardInfo",
    "FramesLostWarning",
    "ProtocolError",
    "RequestError",
    "Sensor",
    "SensorDisconnectedError",
    "SensorError",
    "SensorNotFoundError",
    "SensorTimeoutError",
    "VirtualBoard",
    "list_sensors",
    "open_sensor",
    "virtual_board",
]
