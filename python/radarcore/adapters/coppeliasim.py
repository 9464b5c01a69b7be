"""CoppeliaSim through its ZeroMQ remote API (extra `coppelia`): depth and grey images, meshes and poses.

Every call is one of the API `sim-1`, as CoppeliaSim 4.6 and later have it.
"""

from __future__ import annotations

import time as clock
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check, notice
from radarcore.adapters.depth import radar_in_camera
from radarcore.adapters.images import PlanarDepth, from_coppeliasim
from radarcore.geometry.mesh import Mesh
from radarcore.geometry.pose import Pose
from radarcore.motion.group import Attached
from radarcore.motion.live import LiveGroup
from radarcore.motion.protocol import Motion
from radarcore.scene.body import Body
from radarcore.scene.material import Material

__all__ = [
    "CoppeliaSim",
    "CoppeliaSimError",
    "VisionImage",
    "VisionSensor",
    "from_grey_buffer",
    "from_matrix",
    "from_shape_viz",
]


def __dir__() -> list[str]:
    """Public names, for completion."""
    return __all__


PORT = 23000
"""Port of the server of CoppeliaSim's first instance."""


class CoppeliaSimError(OSError):
    """CoppeliaSim did not answer within the time-out, or answered that it cannot do what it was asked.

    See Also
    --------
    adapters.coppeliasim.CoppeliaSim : Raises it.

    Examples
    --------
    >>> try:
    ...     rc.adapters.coppeliasim.CoppeliaSim("127.0.0.1", 1, timeout=0.1)
    ... except rc.adapters.coppeliasim.CoppeliaSimError as error:
    ...     print("nobody answers")
    nobody answers
    """


def _connected(host: str, port: int, timeout: float) -> Any:
    """The client of CoppeliaSim's package; all calls end within the time-out."""
    try:
        import zmq
        from coppeliasim_zmqremoteapi_client import RemoteAPIClient
    except ImportError as error:
        raise ImportError(
            "CoppeliaSim needs coppeliasim-zmqremoteapi-client, pyzmq and cbor2: pip install radarcore[coppelia]"
        ) from error

    address, longest = f"tcp://{host}:{check.port('port', port)}", check.positive("timeout", timeout, "s")

    class Remote(RemoteAPIClient):  # type: ignore[misc]  # without types
        """One deadline for all messages of a call: `sim.step` receives one per wait."""

        deadline: float
        socket: Any

        def call(self, func: str, args: Any) -> Any:
            if self.socket.closed:
                raise CoppeliaSimError(f"{address}: expected an open connection for {func}, got a closed one")
            self.deadline = clock.monotonic() + longest
            try:
                return super().call(func, args)
            except zmq.Again:
                self.close()
                raise CoppeliaSimError(
                    f"{address}: expected an answer to {func} within {longest:g} s, got none; is CoppeliaSim "
                    "running, with its ZMQ remote API server on this port? It does not answer while one of its dialogs "
                    "is open; slow scenes need a longer timeout"
                ) from None
            except Exception as error:
                if type(error) is not Exception:  # as the client raises for what the server reports
                    raise
                raise CoppeliaSimError(f"{func}: {error}") from error

        def _recv(self) -> Any:
            left = max(0.0, self.deadline - clock.monotonic())
            if not self.socket.poll(int(1e3 * left)):
                raise zmq.Again
            return super()._recv()

        def close(self) -> None:
            self.context.destroy(linger=0)

        def __del__(self) -> None:
            self.close()  # the base class would fail when Python ends

    try:
        remote = Remote(host, port)
    except zmq.ZMQError as error:
        raise ValueError(f"host: expected the name or address of a machine, got {host!r} ({error})") from error
    remote.socket.setsockopt(zmq.LINGER, 0)
    # After Ctrl-C the next call, which stops the simulation, does not wait for the answer to the one before.
    remote.socket.setsockopt(zmq.REQ_RELAXED, 1)
    remote.socket.setsockopt(zmq.REQ_CORRELATE, 1)
    return remote


def from_grey_buffer(data: bytes, resolution: Sequence[int]) -> NDArray[np.uint8]:
    """Grey image of ``sim.getVisionSensorImg(handle, 1)``, (rows, columns) uint8; row 0 on top.

    `data` has the bottom row first, a byte per pixel; `resolution` is (columns, rows).

    See Also
    --------
    adapters.images.from_coppeliasim : Depth images.

    Examples
    --------
    >>> rc.adapters.coppeliasim.from_grey_buffer(bytes([0, 0, 255, 255]), (2, 2)).tolist()
    [[255, 255], [0, 0]]
    """
    sides = check.array("resolution", resolution, (2,))
    columns, rows = (check.count("resolution", int(side)) for side in sides)
    grey = np.frombuffer(data, np.uint8)
    if grey.size != rows * columns:
        raise ValueError(
            f"data: expected {rows * columns} bytes for {columns} x {rows} grey pixels, got {grey.size}; "
            "options=1 asks for grey"
        )
    return grey.reshape(rows, columns)[::-1].copy()


def from_matrix(matrix: ArrayLike) -> Pose:
    """Pose of an object by ``sim.getObjectMatrix(handle, sim.handle_world)``: 12 numbers, three rows of four.

    See Also
    --------
    Pose.from_matrix : Of a matrix in rows.

    Examples
    --------
    >>> rc.adapters.coppeliasim.from_matrix([1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 1.2]).position.tolist()
    [0.5, 0.0, 1.2]
    """
    return Pose.from_matrix(check.array("matrix", matrix, (12,)).reshape(3, 4))


def from_shape_viz(items: Sequence[Mapping[str, Any]]) -> Mesh:
    """Mesh of a shape in its own coordinates, of what ``sim.getShapeViz(handle, index)`` returns for index 0, 1, ...

    A compound shape has several items; they become one mesh.

    See Also
    --------
    Mesh : The result.
    adapters.coppeliasim.CoppeliaSim.bodies : Asks for all shapes.

    Examples
    --------
    >>> item = {"vertices": [0, 0, 0, 1, 0, 0, 0, 1, 0], "indices": [0, 1, 2]}
    >>> rc.adapters.coppeliasim.from_shape_viz([item]).triangles.tolist()
    [[0, 1, 2]]
    """
    vertices, triangles, num_vertices = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0
    for number, item in enumerate(items):
        for name in ("vertices", "indices"):
            if name not in item:
                raise ValueError(
                    f"items: expected {name!r} in item {number}, got {', '.join(map(repr, item)) or 'none'}"
                )
        vertices.append(np.asarray(item["vertices"], dtype=np.float64).reshape(-1, 3))
        triangles.append(np.asarray(item["indices"], dtype=np.int64).reshape(-1, 3) + num_vertices)
        num_vertices += len(vertices[-1])
    return Mesh(np.concatenate(vertices), np.concatenate(triangles))


_METRES = 1
"""Option of ``sim.getVisionSensorDepth``: metres instead of fractions of near to far."""

_GREY = 1
"""Option of ``sim.getVisionSensorImg``: a byte per pixel."""

_NEAREST = 0.1
"""Near clipping plane before which a z-buffer of 24 bits is too coarse for phases of radar [m]."""

_BITS = 24


@dataclass(frozen=True, eq=False)
class VisionImage:
    """One look of a vision sensor; row 0 on top, column 0 on the left.

    Use: ``frame_from_depth(image.depth, image.grey, radar, camera=image.camera, planar=True, time=image.time)``.

    Attributes
    ----------
    planar : PlanarDepth
        The decoded depth image, with `points` and `valid`.
    grey : (rows, columns) uint8
        Grey image; `frame_from_depth` takes it for the power reflectance, as fractions of 255.
    pose : Pose
        Of a radar at the sensor: x axis along the line of sight, z axis up in the image.
    time : float
        Time of the simulation [s].

    See Also
    --------
    adapters.coppeliasim.VisionSensor.image : Makes one.
    frame_from_depth : Frame from it.

    Examples
    --------
    >>> buffer = np.full(12, 0.5, "<f4").tobytes()
    >>> planar = rc.adapters.images.from_coppeliasim(buffer, (4, 3), angle=1.0, near=0.1, far=10.1)
    >>> image = rc.adapters.coppeliasim.VisionImage(planar, np.full((3, 4), 200, np.uint8), rc.Pose(), time=0.5)
    >>> image.depth.shape, image.camera.cx
    ((3, 4), 2.0)
    """

    planar: PlanarDepth
    grey: NDArray[np.uint8]
    pose: Pose
    time: float

    @property
    def depth(self) -> NDArray[np.float64]:
        """Depth along the optical axis [m], (rows, columns); inf where there is nothing."""
        return self.planar.depth

    @property
    def camera(self) -> Any:
        """Pinhole camera of the image, `radarcore.Camera`."""
        return self.planar.camera


class VisionSensor:
    """A vision sensor of perspective type; `CoppeliaSim.vision_sensor` makes it.

    Parameters
    ----------
    sim : object
        The API `sim`.
    handle : int
        Of the sensor.
    path : str
        Its path, for messages.
    motion : Motion
        Of a radar at the sensor.

    Attributes
    ----------
    motion : Motion
        Motion of a radar at the sensor, for ``Simulator(radar_motion=...)``.
    near, far : float
        Clipping planes [m].
    angle : float
        Angle of the larger side of the image [rad].

    See Also
    --------
    adapters.coppeliasim.CoppeliaSim.vision_sensor : Makes one.
    adapters.images.from_coppeliasim : Decodes its buffers.

    Examples
    --------
    >>> # CoppeliaSim must be running.
    >>> with rc.adapters.coppeliasim.CoppeliaSim() as sim, sim.running():  # doctest: +SKIP
    ...     image = sim.vision_sensor("/camera").image()
    ...     print(image.depth.shape, image.camera)
    (128, 128) Camera(fx=110.9, fy=110.9, cx=64.0, cy=64.0)
    """

    def __init__(self, sim: Any, handle: int, path: str, motion: Motion) -> None:
        self._sim = sim
        self._handle = handle
        self.path: str = path
        self.motion: Motion = motion
        if not sim.getObjectInt32Param(handle, sim.visionintparam_perspective_operation):
            raise ValueError(f"{path}: expected a vision sensor of perspective type, got an orthographic one")
        self.near: float = float(sim.getObjectFloatParam(handle, sim.visionfloatparam_near_clipping))
        self.far: float = float(sim.getObjectFloatParam(handle, sim.visionfloatparam_far_clipping))
        self.angle: float = float(sim.getObjectFloatParam(handle, sim.visionfloatparam_perspective_angle))
        if self.near < _NEAREST:
            # Quantum of the z-buffer at 3 m, uniformly distributed.
            error = 9.0 * (self.far - self.near) / (self.far * self.near * 2.0**_BITS) / np.sqrt(12.0)
            notice.warn(
                f"{path}: expected a near clipping plane at {_NEAREST:g} m or farther, got {self.near:g} m: depths of "
                f"3 m are rounded by {1e6 * error:.0f} um rms, {720.0 * error / 5e-3:.1f} degrees of phase at 60 GHz"
            )

    def image(self, *, metres: bool = True, handle: bool = False) -> VisionImage:
        """Image of the last step.

        Parameters
        ----------
        metres : bool
            Ask for metres; else for fractions of near to far, which older versions have alone.
        handle : bool
            Make the sensor look now, as it needs when it is marked "explicit handling".
        """
        sim, number = self._sim, self._handle
        if handle:
            sim.handleVisionSensor(number)
        options = _METRES if metres else 0
        time = check.number("time", sim.getSimulationTime(), "s")
        depth, resolution = sim.getVisionSensorDepth(number, options)
        planar = from_coppeliasim(
            depth, resolution, angle=self.angle, near=self.near, far=self.far, options=options, time=time
        )
        grey = from_grey_buffer(*sim.getVisionSensorImg(number, _GREY))
        pose = from_matrix(sim.getObjectMatrix(number, sim.handle_world))
        return VisionImage(planar, grey, pose @ radar_in_camera("coppeliasim"), time)


_SHORT_PATH = 1
"""Option of ``sim.getObjectAlias``: a path that fully identifies the object, such as /arm/link[0]."""

_SHAPE = 0
"""``sim.sceneobject_shape``, in older versions ``sim.object_shape_type``."""

_POLL = 0.01
"""Time between two questions whether the simulation has stopped [s]."""


class CoppeliaSim:
    """A running CoppeliaSim, reached through its ZeroMQ remote API (``pip install radarcore[coppelia]``).

    Use as a context manager, or call `close`.

    Parameters
    ----------
    host : str
        Machine that it runs on.
    port : int
        Of its ZMQ remote API server.
    timeout : float
        Longest time that a call may take [s], steps included.

    Attributes
    ----------
    sim : object
        The API `sim` of the client, for everything else: ``simulator.sim.getJointPosition(handle)``.

    Raises
    ------
    CoppeliaSimError
        Without an answer within the time-out; all later calls raise it likewise.

    See Also
    --------
    adapters.coppeliasim.VisionSensor : Its images of depth.
    Live : Motions of any other program.

    Examples
    --------
    >>> # CoppeliaSim must be running.
    >>> with rc.adapters.coppeliasim.CoppeliaSim() as sim, sim.running():  # doctest: +SKIP
    ...     scene = rc.Scene(sim.bodies())
    ...     simulator = rc.Simulator(scene, rc.bgt60tr13c(), radar_motion=sim.motion("/radar"))
    ...     print(sim.step(), simulator.frame().cube.shape)
    0.05 (3, 64, 128)
    """

    def __init__(self, host: str = "localhost", port: int = PORT, *, timeout: float = 10.0) -> None:
        self._remote = _connected(host, port, timeout)
        self._timeout = timeout
        try:
            self.sim: Any = self._remote.require("sim")
        except BaseException:
            self.close()
            raise
        self._live: list[tuple[LiveGroup, list[int]]] = []

    def __enter__(self) -> CoppeliaSim:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection."""
        self._remote.close()

    @property
    def time(self) -> float:
        """Time of the simulation [s]."""
        return check.number("time", self.sim.getSimulationTime(), "s")

    @property
    def time_step(self) -> float:
        """Time of a step [s]."""
        return check.positive("time_step", self.sim.getSimulationTimeStep(), "s")

    def handle(self, path: str) -> int:
        """Handle of an object by its path, such as ``"/arm/tool"``; a CoppeliaSimError that names near ones."""
        handle = int(self.sim.getObject(path, {"noError": True}))
        if handle >= 0:
            return handle
        known = [self._path(handle) for handle in self.sim.getObjectsInTree(self.sim.handle_scene)]
        raise CoppeliaSimError(f"no object {path!r} in the scene; {check.near_names(path, known)}")

    def bodies(
        self, *paths: str, material: Material | None = None, still: bool = False, hidden: bool = False
    ) -> list[Body]:
        """Shapes as bodies, named by their paths: meshes are read once, poses with every step.

        Parameters
        ----------
        *paths : str
            Objects whose shapes are read, with all objects below; default: the complete scene.
        material : Material, optional
            Of all of them; default: metal, as in `Body`.
        still : bool
            They never move: their poses are read once, which saves calls and rays.
        hidden : bool
            Include shapes on hidden layers, such as simple shapes for collisions.
        """
        handles = self._shapes(paths, hidden)
        meshes = {handle: from_shape_viz(self._items(handle)) for handle in handles}
        handles = [handle for handle in handles if len(meshes[handle].triangles) > 0]
        motions = [self._pose(handle) for handle in handles] if still else self._motions(handles)
        return [
            Body(meshes[handle], material=material, motion=motion, name=self._path(handle).removeprefix("/"))
            for handle, motion in zip(handles, motions, strict=True)
        ]

    def motion(self, path: str, mounting: Pose | None = None) -> Motion:
        """Motion of any object, such as a dummy that a radar is mounted on.

        Parameters
        ----------
        path : str
            Of the object.
        mounting : Pose, optional
            Of the radar in the object's axes; default: at its origin, looking along its x axis.
        """
        motion = self._motions([self.handle(path)])[0]
        return motion if mounting is None else Attached(motion, mounting)

    def vision_sensor(self, path: str) -> VisionSensor:
        """Vision sensor by its path; a ValueError unless it is of perspective type."""
        handle = self.handle(path)
        motion = Attached(self._motions([handle])[0], radar_in_camera("coppeliasim"))
        return VisionSensor(self.sim, handle, path, motion)

    @contextmanager
    def running(self) -> Iterator[CoppeliaSim]:
        """A simulation that advances by `step` alone; it is stopped at the end, also after errors."""
        sim = self.sim
        sim.setStepping(True)  # before the start, or the first steps are missed
        try:
            sim.startSimulation()
            for group, _ in self._live:
                group.clear()  # time starts again
            self._update()
            yield self
        except BaseException:
            with suppress(CoppeliaSimError):  # report the earlier error
                self._stop()
            raise
        self._stop()

    def step(self) -> float:
        """Advance by one time step, read all poses, and return the time [s]."""
        self.sim.step()
        return self._update()

    def _stop(self) -> None:
        """Stop the simulation and wait until it has; poses that were read are kept."""
        sim = self.sim
        sim.stopSimulation()
        sim.setStepping(False)
        end = clock.monotonic() + self._timeout
        while sim.getSimulationState() != sim.simulation_stopped:
            if clock.monotonic() > end:
                raise CoppeliaSimError(f"the simulation still runs {self._timeout:g} s after the request to stop")
            clock.sleep(_POLL)

    def _update(self) -> float:
        """Read the poses of everything that moves; returns the time [s]."""
        time = self.time
        for group, handles in self._live:
            group.update(time, [self._pose(handle) for handle in handles])
        return time

    def _motions(self, handles: list[int]) -> list[Motion]:
        """Motions of objects, which follow them from now on."""
        if not handles:
            return []
        group = LiveGroup(len(handles))
        self._live.append((group, handles))
        group.update(self.time, [self._pose(handle) for handle in handles])
        return list(group.motions)

    def _pose(self, handle: int) -> Pose:
        return from_matrix(self.sim.getObjectMatrix(handle, self.sim.handle_world))

    def _path(self, handle: int) -> str:
        return str(self.sim.getObjectAlias(handle, _SHORT_PATH))

    def _shapes(self, paths: tuple[str, ...], hidden: bool) -> list[int]:
        """Handles of the shapes below some objects, each once, in the order of the scene."""
        sim = self.sim
        bases = [self.handle(path) for path in paths] or [sim.handle_scene]
        found = dict.fromkeys(handle for base in bases for handle in sim.getObjectsInTree(base, _SHAPE, 0))
        return [handle for handle in found if hidden or sim.getObjectInt32Param(handle, sim.objintparam_visible)]

    def _items(self, handle: int) -> list[Any]:
        """Visible parts of a shape: one item, or several of a compound shape."""
        items: list[Any] = []
        while item := self.sim.getShapeViz(handle, len(items)):
            items.append(item)
        return items
