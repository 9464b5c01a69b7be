"""The viewer Rerun (extra `rerun`): scene, radar and what it measures, on one time line."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.adapters.images import ROS_OPTICAL_AXES
from radarcore.direction import unit_vectors
from radarcore.geometry.camera import Camera
from radarcore.geometry.mesh import Mesh
from radarcore.geometry.pose import Pose
from radarcore.geometry.rotation import Matrix
from radarcore.motion.protocol import AnyMotion, as_motion
from radarcore.output import check_file, make_folder
from radarcore.processing.detection.point_cloud import Detections
from radarcore.processing.spectra.spectra import range_doppler
from radarcore.processing.tracking.kalman import cartesian
from radarcore.processing.tracking.tracks import TrackState
from radarcore.recording.frame import Frame, Truth
from radarcore.scene.body import Body
from radarcore.scene.scene import Scene

__all__ = ["TIME_LINE", "Viewer"]


def __dir__() -> list[str]:
    """Public names, for completion."""
    return __all__


TIME_LINE = "sim_time"
"""Name of the time line: seconds of the simulation or recording."""

_WORLD, _RADAR = "world", "world/radar"
_CAMERA, _MAP = f"{_RADAR}/camera", "radar/range_velocity"

# Colours of materials in the order in which they come, of detections, tracks, truth and rays.
_MATERIALS = ((150, 158, 168), (205, 165, 140), (140, 150, 105), (120, 140, 175), (175, 140, 175), (190, 180, 120))
_DETECTION, _TRACK, _TRUTH, _RAY = (255, 80, 60), (60, 200, 255), (90, 230, 110), (255, 210, 90, 120)

_DOT = 0.03
"""Radius of points [m]."""

_DEEPEST_DB = 80.0
"""Levels that far below the largest of a map are drawn alike [dB]."""


class Image(Protocol):
    """Parts of a `DepthImage` that are shown: row 0 on top, column 0 on the left.

    See Also
    --------
    adapters.rerun.Viewer.show_depth : Shows it.
    DepthImage : One of a simulation.

    Examples
    --------
    >>> ball = rc.Body(rc.shapes.sphere(0.2), motion=rc.Pose([1.0, 0.0, 0.0]))
    >>> image = rc.Simulator(rc.Scene([ball]), rc.bgt60tr13c(), resolution=32).depth_image(0.5)
    >>> image.distance.shape, image.time  # what `show_depth` looks at, with the field of view
    ((32, 32), 0.5)
    """

    @property
    def distance(self) -> NDArray[Any]:
        """(row, column) distance along the ray [m]; inf where nothing was hit."""

    @property
    def field_of_view_deg(self) -> tuple[float, float]:
        """Horizontal and vertical angle of view [degrees]."""

    @property
    def time(self) -> float:
        """Time of the image [s]."""


class Viewer:
    """A file for Rerun, or its viewer, to which things are shown at their times.

    Use as a context manager, or call `close`. All entities are on the time line ``sim_time``; data of a frame are at
    its middle.

    Parameters
    ----------
    path : path, optional
        An ``.rrd`` file: ``rerun run.rrd`` opens it, here or on another machine. Default: the viewer is opened on this
        one.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    ImportError
        Without the extra (``pip install radarcore[rerun]``).
    OSError
        When there is no display for the viewer; says how to save.

    See Also
    --------
    plot.view : Frames in a window of matplotlib.
    plot.scene_from_above : A scene in one picture.

    Examples
    --------
    >>> import os
    >>> ball = rc.Body(rc.shapes.sphere(0.2), motion=rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=[-0.5, 0.0, 0.0]))
    >>> simulator = rc.Simulator(rc.Scene([ball]), rc.bgt60tr13c(num_chirps=16))
    >>> with rc.adapters.rerun.Viewer("run.rrd") as viewer:
    ...     viewer.show_poses(simulator.scene, 0.0, rc.Pose())
    ...     viewer.show_frame(simulator.frame(0.0))
    >>> os.path.getsize("run.rrd") > 0
    True
    """

    def __init__(self, path: str | os.PathLike[str] | None = None, *, overwrite: bool = False) -> None:
        try:
            import rerun
        except ImportError as error:
            raise ImportError("the viewer needs rerun-sdk: pip install radarcore[rerun]") from error
        if path is None and not _has_display():
            raise OSError("no display for the viewer; save a file instead (-o run.rrd) and open it by: rerun run.rrd")
        self._rerun: Any = rerun
        self._colors: dict[str | None, tuple[int, ...]] = {}
        self._scene: Scene | None = None
        self._stream: Any = rerun.RecordingStream("radarcore")
        if path is None:
            self._stream.spawn(default_blueprint=self._layout())
        else:
            check_file(Path(path), overwrite=overwrite, kind=".rrd")
            make_folder(Path(path).parent)
            try:
                self._stream.save(Path(path), default_blueprint=self._layout())
            except RuntimeError as error:  # a folder that cannot be written to
                raise OSError(f"{path}: expected a file that can be written; {error}") from error
        self._stream.log(_WORLD, rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Write or send what is left.

        See Also
        --------
        adapters.rerun.Viewer : A ``with`` block does this by itself.

        Examples
        --------
        >>> import os
        >>> viewer = rc.adapters.rerun.Viewer("run.rrd")
        >>> viewer.close()
        >>> os.path.getsize("run.rrd") > 0
        True
        """
        self._stream.disconnect()

    def show_poses(self, scene: Scene, time: float, radar_motion: AnyMotion | None = None) -> None:
        """Places of all bodies, points and the radar at a time [s]; meshes go out once, the first time.

        Bodies that deform are sent anew every time.

        See Also
        --------
        Scene : Bodies and points.
        plot.scene_from_above : One picture of it.

        Examples
        --------
        >>> import os
        >>> ball = rc.Body(rc.shapes.sphere(0.2), motion=rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=[-0.5, 0.0, 0.0]))
        >>> simulator = rc.Simulator(rc.Scene([ball]), rc.bgt60tr13c(num_chirps=16))
        >>> with rc.adapters.rerun.Viewer("run.rrd") as viewer:
        ...     viewer.show_poses(simulator.scene, 0.5, rc.Pose())
        >>> os.path.getsize("run.rrd") > 0
        True
        """
        rr = self._rerun
        if scene is not self._scene:
            self._scene = scene
            self._send_meshes(scene)
        self._at(time)
        for name, body in zip(scene.names, scene.bodies, strict=True):
            if not isinstance(body, Body):
                continue
            if body.deformation is not None:
                self._stream.log(_of_body(name), self._mesh(body, body.vertices_at(time)))
            self._stream.log(_of_body(name), _transform(rr, body.motion.at(time)))
        if len(scene.parts.point_numbers):
            places = scene.parts.positions + time * scene.parts.velocities
            labels = [scene.names[number] for number in scene.parts.point_numbers]
            self._stream.log(f"{_WORLD}/points", rr.Points3D(places, radii=_DOT, labels=labels, colors=_TRUTH))
        if radar_motion is not None:
            self._stream.log(_RADAR, _transform(rr, as_motion("radar_motion", radar_motion).at(time)))

    def show_depth(self, image: Image, *, num_rays: int = 24) -> None:
        """Depth image of the radar, as `Simulator.depth_image` gives it, and some of its rays.

        See Also
        --------
        Simulator.depth_image : The image.
        plot.depth_image : One picture of it.

        Examples
        --------
        >>> import os
        >>> ball = rc.Body(rc.shapes.sphere(0.2), motion=rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=[-0.5, 0.0, 0.0]))
        >>> simulator = rc.Simulator(rc.Scene([ball]), rc.bgt60tr13c(num_chirps=16))
        >>> with rc.adapters.rerun.Viewer("run.rrd") as viewer:
        ...     viewer.show_depth(simulator.depth_image(0.5))
        >>> os.path.getsize("run.rrd") > 0
        True
        """
        rr = self._rerun
        rows, columns = image.distance.shape
        camera = Camera.from_field_of_view(image.field_of_view_deg, rows, columns)
        planar = image.distance / camera.slant(rows, columns)
        self._at(image.time)
        # The optical frame of ROS: x right, y down, z forward.
        pose = Pose(rotation=ROS_OPTICAL_AXES.T)
        view = rr.Pinhole(
            resolution=[columns, rows],
            focal_length=[camera.fx, camera.fy],
            principal_point=[camera.cx, camera.cy],
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=0.3,
        )
        self._stream.log(_CAMERA, _transform(rr, pose), view)
        depth = np.where(np.isfinite(planar), planar, 0.0).astype(np.float32)
        self._stream.log(f"{_CAMERA}/depth", rr.DepthImage(depth, meter=1.0))
        rays = [[np.zeros(3), end] for end in _some_hits(image.distance, camera, num_rays)]
        self._stream.log(f"{_RADAR}/rays", rr.LineStrips3D(rays, colors=[_RAY] * len(rays)))

    def show_frame(self, frame: Frame) -> None:
        """Range-velocity map of a frame [dB], and the truth where it has one.

        See Also
        --------
        range_doppler : The map that is shown.
        plot.range_doppler_map : One picture of it.

        Examples
        --------
        >>> import os
        >>> ball = rc.Body(rc.shapes.sphere(0.2), motion=rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=[-0.5, 0.0, 0.0]))
        >>> simulator = rc.Simulator(rc.Scene([ball]), rc.bgt60tr13c(num_chirps=16))
        >>> with rc.adapters.rerun.Viewer("run.rrd") as viewer:
        ...     viewer.show_frame(simulator.frame(0.5))
        >>> os.path.getsize("run.rrd") > 0
        True
        """
        rr, waveform = self._rerun, frame.radar.waveform
        self._at(frame.time + frame.radar.middle)
        power = (np.abs(range_doppler(frame, window="hann")) ** 2).sum(axis=0)  # of all channels
        # A tensor has no axes but names: they say what a cell is.
        cell = waveform.range_axis(waveform.num_samples)[1], waveform.velocity_resolution
        names = f"velocity, {cell[1]:.3g} m/s per cell, 0 in the middle", f"range, {cell[0]:.3g} m per cell"
        self._stream.log(_MAP, rr.Tensor(_levels_db(power).astype(np.float32), dim_names=names))
        if frame.truth is not None:
            self._show_truth(frame.truth)

    def show_detections(self, found: Detections) -> None:
        """Detections of a frame, at their places in front of the radar; those without an azimuth are not drawn.

        See Also
        --------
        detect : Detections of a frame.

        Examples
        --------
        >>> import os
        >>> ball = rc.Body(rc.shapes.sphere(0.2), motion=rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=[-0.5, 0.0, 0.0]))
        >>> simulator = rc.Simulator(rc.Scene([ball]), rc.bgt60tr13c(num_chirps=16))
        >>> with rc.adapters.rerun.Viewer("run.rrd") as viewer:
        ...     viewer.show_detections(rc.detect(simulator.frame(0.5)))
        >>> os.path.getsize("run.rrd") > 0
        True
        """
        rr = self._rerun
        self._at(found.time)
        places = found.position
        is_placed = np.isfinite(places).all(axis=1)
        values = zip(found.range[is_placed], found.velocity[is_placed], strict=True)
        labels = [f"{distance:.2f} m, {velocity:+.2f} m/s" for distance, velocity in values]
        points = rr.Points3D(places[is_placed], radii=_DOT, labels=labels, colors=_DETECTION, show_labels=False)
        self._stream.log(f"{_RADAR}/detections", points)

    def show_tracks(self, states: Iterable[TrackState], time: float) -> None:
        """Confirmed tracks of a frame at its middle [s]: places, velocities as arrows, and ranges as curves.

        Places and arrows are sent relative to the radar, so tracks in the world need its pose by `show_poses`.

        See Also
        --------
        Tracker.update : States of targets.
        plot.tracks_from_above : One picture of tracks.

        Examples
        --------
        >>> import os
        >>> ball = rc.Body(rc.shapes.sphere(0.2), motion=rc.Linear(rc.Pose([2.0, 0.0, 0.0]), velocity=[-0.5, 0.0, 0.0]))
        >>> simulator = rc.Simulator(rc.Scene([ball]), rc.bgt60tr13c(num_chirps=16))
        >>> states = rc.Tracker().update(rc.detect(simulator.frame(0.5)))
        >>> with rc.adapters.rerun.Viewer("run.rrd") as viewer:
        ...     viewer.show_tracks(states, time=0.5)
        >>> os.path.getsize("run.rrd") > 0
        True
        """
        rr = self._rerun
        confirmed = [state for state in states if state.is_confirmed]
        self._at(time)
        placed = [state for state in confirmed if np.isfinite(state.position).all()]
        places = np.array([cartesian(state.state)[0] for state in placed]).reshape(-1, 3)
        motions = np.array([state.sensor_pose[:, :3].T @ state.motion for state in placed]).reshape(-1, 3)
        names = [f"track {state.id}" for state in placed]
        self._stream.log(f"{_RADAR}/tracks", rr.Points3D(places, radii=1.5 * _DOT, labels=names, colors=_TRACK))
        self._stream.log(f"{_RADAR}/tracks/velocity", rr.Arrows3D(origins=places, vectors=motions, colors=_TRACK))
        for state in confirmed:
            self._stream.log(["range", f"track {state.id}"], rr.Scalars(state.range))
            self._stream.log(["velocity", f"track {state.id}"], rr.Scalars(state.velocity))

    def _show_truth(self, truth: Truth) -> None:
        rr = self._rerun
        seen = np.flatnonzero(np.isfinite(truth.range))
        places = truth.range[seen, None] * unit_vectors(truth.azimuth[seen], truth.elevation[seen])
        names = [truth.names[k] for k in seen]
        points = rr.Points3D(places, radii=_DOT, labels=names, colors=_TRUTH, show_labels=False)
        self._stream.log(f"{_RADAR}/truth", points)
        for k in seen:
            self._stream.log(["range", truth.names[k]], rr.Scalars(float(truth.range[k])))
            self._stream.log(["velocity", truth.names[k]], rr.Scalars(float(truth.velocity[k])))

    def _at(self, time: float) -> None:
        """Put what follows at a time [s]."""
        self._stream.set_time(TIME_LINE, duration=check.number("time", time, "s"))

    def _send_meshes(self, scene: Scene) -> None:
        for name, body in zip(scene.names, scene.bodies, strict=True):
            if isinstance(body, Body) and body.deformation is None:
                self._stream.log(_of_body(name), self._mesh(body, body.mesh.vertices), static=True)

    def _mesh(self, body: Body, vertices: Matrix) -> Any:
        color = self._colors.setdefault(body.material.name, _MATERIALS[len(self._colors) % len(_MATERIALS)])
        corners, normals = _facets(body.mesh, vertices)
        return self._rerun.Mesh3D(vertex_positions=corners, vertex_normals=normals, albedo_factor=color)

    def _layout(self) -> Any:
        """Views side by side: the scene; the map, and ranges and velocities over time."""
        from rerun import blueprint

        return blueprint.Blueprint(
            blueprint.Horizontal(
                blueprint.Spatial3DView(origin=_WORLD, name="scene"),
                blueprint.Vertical(
                    blueprint.TensorView(origin=_MAP, name="velocity and range [dB]"),
                    blueprint.TimeSeriesView(origin="range", name="range [m]"),
                    blueprint.TimeSeriesView(origin="velocity", name="velocity [m/s]"),
                ),
                column_shares=[3, 2],
            ),
            blueprint.TimePanel(timeline=TIME_LINE),
            blueprint.BlueprintPanel(state="collapsed"),
            blueprint.SelectionPanel(state="collapsed"),
        )


def _has_display() -> bool:
    """True unless no window can open; only known of Linux."""
    return sys.platform != "linux" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def _of_body(name: str) -> list[str]:
    """Entity of a body. Names in lists are escaped: a body called a/b is no part of a body called a."""
    return [_WORLD, "bodies", name]


def _transform(rr: Any, pose: Pose) -> Any:
    return rr.Transform3D(translation=pose.position, mat3x3=pose.rotation)


def _facets(mesh: Mesh, vertices: Matrix) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Corners of all triangles, (3 m, 3), and their normals: flat, as the rays meet them."""
    corners = vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(length > 0.0, length, 1.0)
    return corners.reshape(-1, 3).astype(np.float32), np.repeat(normals, 3, axis=0).astype(np.float32)


def _some_hits(distance: ArrayLike, camera: Camera, number: int) -> Matrix:
    """Points that some rays hit, evenly over an image, (n, 3) in radar axes [m]."""
    ranges = np.asarray(distance, dtype=np.float64)
    hits = np.argwhere(np.isfinite(ranges))
    number = min(len(hits), check.count("num_rays", number, 0))
    rows, columns = hits[np.linspace(0, len(hits) - 1, number).astype(int)].T if number else np.empty((2, 0), int)
    u, v = camera.plane(*ranges.shape)
    directions = np.stack([np.ones(number), u[columns], v[rows]], axis=-1)
    ends: Matrix = ranges[rows, columns, None] * directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    return ends


def _levels_db(power: Matrix) -> Matrix:
    """Levels below the largest [dB], none deeper than 80 dB."""
    largest = float(power.max(initial=0.0)) or 1.0
    levels: Matrix = 10.0 * np.log10(np.maximum(power / largest, np.finfo(power.dtype).tiny))
    return np.maximum(levels, -_DEEPEST_DB)  # levels are limited, not powers: logarithms round
