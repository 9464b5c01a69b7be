"""A server that speaks the protocol of CoppeliaSim's ZeroMQ remote API, with a small scene that really moves.

The scene is made of formulas of its own: a vision sensor at a height of 0.5 m looks along the world's x axis at a plate
that moves, a ball up on the left, and the empty distance. Depth is found in the sensor's axes (x to the left of the
image, y up, z forward), and packed as CoppeliaSim packs it.
"""

from __future__ import annotations

import struct
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

_REASON = "needs the extra `coppelia`: pip install radarcore[coppelia]"
zmq: Any = pytest.importorskip("zmq", reason=_REASON)
cbor2: Any = pytest.importorskip("cbor2", reason=_REASON)
pytest.importorskip("coppeliasim_zmqremoteapi_client", reason=_REASON)

NEAR, FAR, ANGLE = 0.1, 10.0, np.deg2rad(50.0)
TIME_STEP = 0.025
HEIGHT = 0.5
PLATE_AT, PLATE_VELOCITY = 3.0, -0.8
"""Place at time zero [m] and velocity [m/s] of the plate along x."""
PLATE_SIZE = 1.0
BALL, RADIUS = np.array([2.0, 0.5, 0.9]), 0.15

RADAR, PLATE, BALL_SHAPE, HIDDEN, ARM, ORTHOGRAPHIC = 17, 21, 22, 23, 30, 40
PATHS = {
    "/radar": RADAR,
    "/plate": PLATE,
    "/ball": BALL_SHAPE,
    "/ball/proxy": HIDDEN,
    "/arm": ARM,
    "/orthographic": ORTHOGRAPHIC,
}
CHILDREN = {-12: [PLATE, BALL_SHAPE, HIDDEN], BALL_SHAPE: [BALL_SHAPE, HIDDEN], PLATE: [PLATE], ARM: []}
CONSTANTS = {
    "handle_world": -1,
    "handle_scene": -12,
    "simulation_stopped": 0,
    "objintparam_visible": 30,
    "visionintparam_perspective_operation": 1018,
    "visionfloatparam_near_clipping": 1000,
    "visionfloatparam_far_clipping": 1001,
    "visionfloatparam_perspective_angle": 1004,
}
# The sensor's x axis is the world's y, its y the world's z, its z the world's x.
SENSOR_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
GREYS = {"nothing": 0, "plate": 200, "ball": 100}


class Stub(threading.Thread):
    """Server on a free port until `stop`.

    Parameters
    ----------
    columns, rows : int
        Resolution of the vision sensor.
    near : float
        Its near clipping plane [m].
    deaf_to : str
        Function that is never answered.
    waits : int
        Times that a step makes the client wait.
    """

    def __init__(
        self, columns: int = 40, rows: int = 24, *, near: float = NEAR, deaf_to: str = "", waits: int = 2
    ) -> None:
        super().__init__(daemon=True)
        self.columns, self.rows, self.near, self.deaf_to, self.waits = columns, rows, near, deaf_to, waits
        self.calls: list[str] = []
        self.num_steps, self.is_stepping, self.is_running = 0, False, False
        self.looks = 0
        self.first: dict[str, Any] = {}
        self._waiting, self._repeated = 0, False
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.REP)
        self.port = self._socket.bind_to_random_port("tcp://127.0.0.1")
        self._is_stopped = threading.Event()
        self._functions: dict[str, Callable[..., list[Any]]] = {
            "setStepping": self._set_stepping,
            "startSimulation": self._start,
            "stopSimulation": self._stop_simulation,
            "getSimulationTime": lambda: [self.time],
            "getSimulationTimeStep": lambda: [TIME_STEP],
            "getSimulationState": lambda: [17 if self.is_running else 0],
            "getObject": self._object,
            "getObjectAlias": lambda handle, options=-1: [{h: p for p, h in PATHS.items()}[handle]],
            "getObjectsInTree": self._in_tree,
            "getObjectMatrix": self._matrix,
            "getObjectInt32Param": self._integer,
            "getObjectFloatParam": lambda handle, number: [{1000: self.near, 1001: FAR, 1004: ANGLE}[number]],
            "getShapeViz": self._shape,
            "handleVisionSensor": self._look,
            "getVisionSensorDepth": self._depth,
            "getVisionSensorImg": self._image,
            "getJointPosition": self._joint,
        }

    def __enter__(self) -> Stub:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_stopped.set()
        self.join()

    def run(self) -> None:
        """Answer requests, one after another."""
        with self._context:
            while not self._is_stopped.is_set():
                if self._socket.poll(20):
                    request = cbor2.loads(self._socket.recv())
                    if (reply := self._reply(request)) is not None:
                        self._socket.send(cbor2.dumps(reply))
            self._context.destroy(linger=0)

    @property
    def time(self) -> float:
        return self.num_steps * TIME_STEP

    def plate_at(self, time: float) -> float:
        """Place of the plate along x [m]."""
        return PLATE_AT + PLATE_VELOCITY * time

    # The protocol

    def _reply(self, request: dict[str, Any]) -> dict[str, Any] | None:
        name, args = request["func"], request.get("args") or []
        assert request["argsL"] == len(args)
        if "ver" in request:  # the first of a client
            self.first = request
        assert request["uuid"] == self.first["uuid"]
        self.calls.append(name)
        if name == self.deaf_to:
            # A socket of this kind must answer before it hears again.
            self._socket.close(linger=0)
            self._socket = self._context.socket(zmq.REP)
            return None
        try:
            return self._answer(name, args)
        except Exception as error:
            return {"err": f"{error} (in function '{name}')"}

    def _answer(self, name: str, args: list[Any]) -> dict[str, Any]:
        match name:
            case "zmqRemoteApi.require":
                assert args == ["sim"]
                return {"ret": []}
            case "zmqRemoteApi.info":
                functions = {function: {"func": {}} for function in [*self._functions, "step"]}
                return {"ret": [functions | {constant: {"const": value} for constant, value in CONSTANTS.items()}]}
            case "sim.step":
                self._waiting = self.waits
                return self._advance()
            case "_*executed*_":
                return self._advance()
            case "sim.getJointPosition" if not self._repeated:
                self._repeated = True
                return {"func": "_*repeat*_", "args": []}
        return {"ret": self._functions[name.removeprefix("sim.")](*args)}

    def _advance(self) -> dict[str, Any]:
        """Wait a few times; then a step is done."""
        if self._waiting:
            self._waiting -= 1
            return {"func": "_*wait*_", "args": []}
        self.num_steps += self.is_running
        return {"ret": []}

    # The scene

    def _set_stepping(self, is_on: bool) -> list[Any]:
        before, self.is_stepping = self.is_stepping, is_on
        return [int(before)]

    def _start(self) -> list[Any]:
        self.is_running, self.num_steps = True, 0
        return [1]

    def _stop_simulation(self) -> list[Any]:
        self.is_running, self.num_steps = False, 0
        return [1]

    def _object(self, path: str, options: dict[str, Any]) -> list[Any]:
        assert options == {"noError": True}
        return [PATHS.get(path, -1)]

    def _in_tree(self, base: int, kind: int = -2, options: int = 0) -> list[Any]:
        assert options == 0
        return [list(PATHS.values()) if kind == -2 else CHILDREN[base]]

    def _matrix(self, handle: int, relative_to: int) -> list[Any]:
        assert relative_to == CONSTANTS["handle_world"]
        axes, place = np.eye(3), np.zeros(3)
        if handle == RADAR:
            axes, place = SENSOR_AXES, np.array([0.0, 0.0, HEIGHT])
        elif handle == PLATE:
            place = np.array([self.plate_at(self.time), 0.0, HEIGHT])
        elif handle in (BALL_SHAPE, HIDDEN):
            place = BALL
        elif handle == ARM:
            angle = self.time  # about z, at 1 rad/s
            axes = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        return [np.column_stack([axes, place]).ravel().tolist()]

    def _integer(self, handle: int, number: int) -> list[Any]:
        if number == CONSTANTS["objintparam_visible"]:
            return [int(handle != HIDDEN)]
        return [int(handle != ORTHOGRAPHIC)]

    def _shape(self, handle: int, item: int) -> list[Any]:
        """The plate is a compound of two halves; everything else a cube of 10 cm."""
        half = PLATE_SIZE / 2
        if handle == PLATE and item < 2:
            low, high = ((-half, 0.0), (0.0, half))[item]
            corners = [[0, low, -half], [0, high, -half], [0, high, half], [0, low, half]]
            rows = [[0, 2, 1], [0, 3, 2]]  # seen from -x
        elif item == 0:
            corners = [[x, y, z] for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-0.05, 0.05)]
            quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
            rows = [list(row) for a, b, c, d in quads for row in ((a, b, c), (a, c, d))]
        else:
            return []  # no such item
        flat = [float(number) for corner in corners for number in corner]
        return [
            {"vertices": flat, "indices": [index for row in rows for index in row], "normals": [], "colors": [0.5] * 9}
        ]

    def _look(self, handle: int) -> list[Any]:
        assert handle == RADAR
        self.looks += 1
        return [0, []]

    def _joint(self, handle: int) -> list[Any]:
        return [0.25 * handle]

    def seen(self, time: float) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
        """Depth [m] and grey image at a time, row 0 on top."""
        focal = 0.5 * max(self.columns, self.rows) / np.tan(0.5 * ANGLE)
        # To the left of the image is x, up is y, forward z.
        left = (self.columns / 2 - np.arange(self.columns) - 0.5) / focal
        up = (self.rows / 2 - np.arange(self.rows) - 0.5)[:, None] / focal
        depth, grey = np.full((self.rows, self.columns), FAR), np.zeros((self.rows, self.columns), np.uint8)
        plate = self.plate_at(time)
        is_plate = (np.abs(plate * left) < PLATE_SIZE / 2) & (np.abs(plate * up) < PLATE_SIZE / 2)
        depth[is_plate], grey[is_plate] = plate, GREYS["plate"]
        x, y, z = SENSOR_AXES.T @ (BALL - [0.0, 0.0, HEIGHT])  # of the ball, in the sensor's axes
        a, b, c = left**2 + up**2 + 1.0, left * x + up * y + z, x * x + y * y + z * z - RADIUS**2
        nearest = (b - np.sqrt(np.maximum(b * b - a * c, 0.0))) / a
        is_ball = (b * b > a * c) & (nearest < depth)
        depth[is_ball], grey[is_ball] = nearest[is_ball], GREYS["ball"]
        return depth, grey

    def _depth(self, handle: int, options: int = 0) -> list[Any]:
        assert handle == RADAR
        depth = self.seen(self.time)[0]
        values = depth if options & 1 else (depth - self.near) / (FAR - self.near)
        rows = [struct.pack(f"<{self.columns}f", *row) for row in values[::-1].tolist()]
        return [b"".join(rows), [self.columns, self.rows]]

    def _image(self, handle: int, options: int = 0) -> list[Any]:
        assert (handle, options) == (RADAR, 1)
        return [b"".join(bytes(row) for row in self.seen(self.time)[1][::-1].tolist()), [self.columns, self.rows]]
