"""A running CoppeliaSim: its objects as bodies, motions and vision sensors, and its steps."""

from __future__ import annotations

import time as clock
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import Any

import numpy as np

from radarcore import check
from radarcore.adapters.coppeliasim import decoders
from radarcore.adapters.coppeliasim.client import PORT, Client, CoppeliaSimError
from radarcore.adapters.coppeliasim.vision import VisionSensor
from radarcore.adapters.planar_depth import radar_in_camera
from radarcore.geometry.pose import Pose, transforms
from radarcore.motion.attached import Attached
from radarcore.motion.live import LiveGroup
from radarcore.motion.protocol import Motion
from radarcore.scene.body import Body
from radarcore.scene.material import Material

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
        When nobody answers within the time-out; all later calls raise it likewise.

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
        self._client = Client(host, port, timeout)
        self.sim: Any = self._client.sim
        self._live: list[tuple[LiveGroup, list[int]]] = []

    def __enter__(self) -> CoppeliaSim:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection."""
        self._client.close()

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
        try:
            return int(self.sim.getObject(path))
        except CoppeliaSimError:
            if not self._client.is_open:
                raise
        known = [self._path(handle) for handle in self.sim.getObjectsInTree(self.sim.handle_scene)]
        raise CoppeliaSimError(f"no object {path!r} in the scene; {check.near_names(path, known)}")

    def bodies(
        self, *paths: str, material: Material | None = None, still: bool = False, hidden: bool = False
    ) -> list[Body]:
        """Shapes as bodies, named by their paths: meshes are read once, poses with every step.

        Parameters
        ----------
        *paths : str
            Objects whose shapes, and those of all objects below, are meant; default: all of the scene.
        material : Material, optional
            Of all of them; default: that of `Body`, metal.
        still : bool
            They never move: their poses are read once, which saves calls and rays.
        hidden : bool
            With those that are on layers which are not shown, as are simple shapes for collisions.
        """
        handles = self._shapes(paths, hidden)
        meshes = {handle: decoders.from_shape_viz(self._items(handle)) for handle in handles}
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
            with suppress(CoppeliaSimError):  # what went wrong before is the news
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
        end = clock.monotonic() + self._client.timeout
        while sim.getSimulationState() != sim.simulation_stopped:
            if clock.monotonic() > end:
                raise CoppeliaSimError(
                    f"{self._client.address}: expected the simulation to stop within {self._client.timeout:g} s, got "
                    "one that goes on"
                )
            clock.sleep(_POLL)

    def _update(self) -> float:
        """Read the poses of everything that moves; returns the time [s]."""
        time = self.time
        for group, handles in self._live:
            poses = [self._pose(handle) for handle in handles]
            group.update(time, np.array([transforms(pose.rotation, pose.position) for pose in poses]))
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
        return decoders.from_matrix(self.sim.getObjectMatrix(handle, self.sim.handle_world))

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
