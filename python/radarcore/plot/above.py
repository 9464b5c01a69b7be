"""Floor plans: bodies of a scene with their trails and the field of view of the sensor, and tracks of targets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarcore import check
from radarcore.direction import unit_vectors
from radarcore.geometry.camera import checked_field_of_view
from radarcore.geometry.mesh import used_by
from radarcore.geometry.pose import Pose
from radarcore.motion.protocol import AnyMotion, Motion, as_motion, poses_at
from radarcore.plot import canvas
from radarcore.plot.canvas import Name
from radarcore.processing.tracking.kalman import covariance_from_above
from radarcore.processing.tracking.tracks import Track, Tracks
from radarcore.recording.frame import Truth
from radarcore.scene.body import Body, PointTarget, motion_of
from radarcore.scene.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STILL = 1e-3
"""Bodies that move less than this do not move [m]."""

_DIRECTIONS = np.stack([f(np.arange(0.0, 2.0 * np.pi, np.pi / 90.0)) for f in (np.cos, np.sin)])
"""(2, direction): an outline goes through the farthest point in each, so corners flatter than 2 degrees are cut."""

_POINTS_OF_TRAIL = 100


_DEVIATIONS = 2.0
"""Standard deviations that the ellipse at the end of a track shows: the target is inside in 86 % of all cases."""


def scene_from_above(
    scene: Scene,
    radar_motion: AnyMotion | None = None,
    times: ArrayLike = (0.0,),
    ax: Axes | None = None,
    *,
    field_of_view_deg: tuple[float, float] | None = None,
    colors: Mapping[str, str] | None = None,
) -> Axes:
    """Floor plan: x to the right, y up [m]; the sensor with its field of view at the last of the times.

    Bodies are their convex outlines. Static bodies are grey; moving bodies are drawn at each of the times, later times
    stronger, on their trails. A body around the sensor (a room, the floor) is a line only. Interferers are empty
    squares, at the last of the times.

    Parameters
    ----------
    scene : Scene
    radar_motion : motion, optional
        Sensor to world, as `Simulator` takes it; default: the world's own frame.
    times : (time,) array_like
        When to draw what moves [s].
    ax : matplotlib Axes, optional
        Default: axes of a new figure.
    field_of_view_deg : (float, float), optional
        Horizontal and vertical angle of view [degrees], such as `Simulator.view_deg`; default: not drawn.
    colors : dict, optional
        Colours by name; default: in turn for what moves.

    See Also
    --------
    plot.tracks_from_above : Tracks in the same view.
    adapters.rerun.Viewer : The scene in space.

    Examples
    --------
    >>> wall = rc.Body(rc.shapes.plate(1.0, 1.0), motion=rc.Pose([2.0, 0.0, 0.0]), name="wall")
    >>> ax = rc.plot.scene_from_above(rc.Scene([wall]), field_of_view_deg=(60.0, 60.0))
    >>> ax.get_xlabel()
    'x [m]'
    """
    ax = canvas.new_axes() if ax is None else ax
    names = draw_scene(ax, scene, radar_motion, times, field_of_view_deg, colors)
    canvas.place_names((ax, names, "white"))
    return ax


def tracks_from_above(
    tracks: Tracks, ax: Axes | None = None, *, truth: Truth | None = None, colors: Mapping[str, str] | None = None
) -> Axes:
    """Paths of targets in the world of the sensor's motion: x to the right, y up [m].

    Without a motion the world is the sensor frame, and the sensor is at its origin. A sensor that moves is drawn at its
    last known place, with its path. Tracks are lines in a colour each from a dot at their first detection, dotted where
    frames had no detection; at their end is an ellipse of two standard deviations. The truth is grey; with a moving
    sensor it is drawn in frames with a track.

    Parameters
    ----------
    tracks : Tracks
        With positions: of detections that have an azimuth.
    ax : matplotlib Axes, optional
        Default: axes of a new figure.
    truth : Truth, optional
        Arrays (frame, body) of the frames of the tracks.
    colors : dict, optional
        Colours by name, such as ``"track 0"``; default: in turn.

    See Also
    --------
    track : Tracks of a recording.
    plot.tracks : Ranges and velocities over time.
    plot.scene_from_above : The scene.

    Examples
    --------
    >>> found = [rc.Detections([2.0 - 0.025 * k], [-0.5], [0.1], [np.nan], [20.0], time=0.05 * k) for k in range(6)]
    >>> ax = rc.plot.tracks_from_above(rc.track(found))
    >>> ax.get_xlabel()
    'x [m]'
    """
    check.instance("tracks", tracks, Tracks)
    if any(np.isnan(one.position).all() for one in tracks):
        raise ValueError("tracks: expected tracks with positions, got some of ranges alone, without angles")
    ax = canvas.new_axes() if ax is None else ax
    poses = _sensor_poses(tracks)
    path = poses[:, :2, 3]
    x, y = path[np.isfinite(path[:, 0])][-1].tolist()
    names = [Name(x, y, "radar", "black")]
    if truth is not None:
        names += _draw_truth(ax, check.instance("truth", truth, Truth), poses)
    palette = canvas.color_cycle([f"track {one.id}" for one in tracks], colors)
    for one in tracks:
        name, color = f"track {one.id}", palette[f"track {one.id}"]
        _draw_track(ax, one, color)
        names.append(Name(float(one.position[-1, 0]), float(one.position[-1, 1]), name, color))
    if len(path) > 1:
        _draw_path(ax, path)
    ax.plot(x, y, "o", color="black", markersize=6.0, zorder=6.0)
    _finish(ax)
    canvas.place_names((ax, names, "white"))
    return ax


def scene_colors(scene: Scene, times: ArrayLike, first: Iterable[str] = ()) -> dict[str, str]:
    """Colours by name: the given names first, then bodies that move between the times [s], while colours remain.

    The parts of one thing, such as the links of an arm, have one colour.
    """
    dense = _dense(check.numbers("times", times))
    chosen = list(dict.fromkeys(map(canvas.thing, first)))
    moving = [name for name, body in zip(scene.names, scene.bodies, strict=True) if _moves(body, dense)]
    others = [thing for thing in dict.fromkeys(map(canvas.thing, moving)) if thing not in chosen]
    colors = canvas.color_cycle(chosen)
    colors |= dict(zip(others, canvas.COLORS[len(colors) :], strict=False))
    return {name: colors[canvas.thing(name)] for name in scene.names if canvas.thing(name) in colors}


def draw_scene(
    ax: Axes,
    scene: Scene,
    radar_motion: AnyMotion | None,
    times: ArrayLike,
    field_of_view_deg: tuple[float, float] | None,
    colors: Mapping[str, str] | None = None,
) -> list[Name]:
    """Draw `scene_from_above` without the names, which are returned."""
    check.instance("scene", scene, Scene)
    sensor: Motion = Pose() if radar_motion is None else as_motion("radar_motion", radar_motion)
    moments = np.sort(check.array("times", times, (None,)))
    if len(moments) == 0:
        raise ValueError("times: expected at least one time [s], got none")
    view = None if field_of_view_deg is None else checked_field_of_view(field_of_view_deg)
    dense = _dense(moments)
    palette = scene_colors(scene, moments) if colors is None else colors
    last = float(moments[-1])
    sensor_pose = sensor.at(last)

    # Bodies, from the largest to the smallest so that none is covered.
    names = []
    for name, body in sorted(zip(scene.names, scene.bodies, strict=True), key=lambda pair: -_extent(pair[1], last)):
        color = palette.get(name, canvas.GREY)
        shown = moments[-1:]
        if _moves(body, dense):
            shown, trail = moments, _trail(body, dense)
            ax.plot(*trail.T, color=color, linewidth=1.0, linestyle=(0, (4, 2)), alpha=0.8, zorder=3.0)
        for k, time in enumerate(shown.tolist(), 1):
            _draw_body(ax, body, time, color, k / len(shown), sensor_pose.position[:2])
        names.append(_name_place(name, body, last, color, sensor_pose.position[:2]))

    # The sensor on top, then the limits, and the field of view as far as they go.
    path = np.array([sensor.at(time).position[:2] for time in dense.tolist()])
    if (np.ptp(path, axis=0) > _STILL).any():
        _draw_path(ax, path)
    ax.plot(*sensor_pose.position[:2], "o", color="black", markersize=6.0, zorder=6.0)
    names.append(Name(float(sensor_pose.position[0]), float(sensor_pose.position[1]), "radar", "black"))
    for name, interferer in zip(scene.interferer_names, scene.interferers, strict=True):
        x, y, _ = interferer.motion.at(last).position.tolist()
        ax.plot(x, y, "s", color="black", markersize=5.0, fillstyle="none", zorder=6.0)
        names.append(Name(x, y, name, "black"))
    _finish(ax)
    if view is not None:
        _draw_view(ax, sensor_pose, view[0])
    return names


def _draw_body(
    ax: Axes, body: Body | PointTarget, time: float, color: str, strength: float, sensor: NDArray[np.float64]
) -> None:
    """Outline of a body, or the place of a point, at one time."""
    outline = _outline(body, time)
    alpha = 0.25 + 0.75 * strength
    if isinstance(body, PointTarget) or len(outline) == 1:
        ax.plot(*outline[0], "x", color=color, markersize=6.0, markeredgewidth=1.6, alpha=alpha, zorder=4.0)
    elif _encloses(outline, sensor):
        ax.plot(*np.vstack([outline, outline[:1]]).T, color=color, linewidth=1.6, alpha=alpha, zorder=2.0)
    else:
        from matplotlib.colors import to_rgba

        ax.fill(
            *outline.T,
            facecolor=to_rgba(color, 0.12 + 0.4 * strength),
            edgecolor=to_rgba(color, alpha),
            linewidth=1.2,
            zorder=2.5,
        )


def _draw_path(ax: Axes, path: NDArray[np.float64]) -> None:
    """Draw the path of the sensor (time, 2)."""
    ax.plot(*path.T, color="black", linewidth=1.0, linestyle=(0, (4, 2)), zorder=5.0)


def _draw_view(ax: Axes, sensor: Pose, horizontal_deg: float) -> None:
    """Draw the field of view between its left and right border; nothing for a sensor that looks up or down."""
    from matplotlib.patches import Polygon

    half = np.tan(np.deg2rad(0.5 * horizontal_deg))
    borders = sensor.rotation @ np.array([[1.0, 1.0], [half, -half], [0.0, 0.0]])
    if np.hypot(*sensor.rotation[:2, 0]) < 0.2:
        return
    far = 10.0 * float(np.hypot(ax.dataLim.width, ax.dataLim.height))
    origin = sensor.position[:2]
    corners = [origin, *(origin + far * border[:2] / np.hypot(*border[:2]) for border in borders.T)]
    wedge = Polygon(corners, facecolor="#F0E442", alpha=0.18, edgecolor="none", zorder=1.0)
    lines = Polygon([corners[1], corners[0], corners[2]], closed=False, fill=False, edgecolor="#8a7f00", linewidth=0.9)
    lines.set_zorder(1.1)
    for patch in (wedge, lines):
        ax.add_artist(patch)  # not add_patch: the scene sets the limits


def _finish(ax: Axes) -> None:
    """Equal metres, a margin around all that is drawn, not less than two metres; grid and labels."""
    middle = ax.dataLim.get_points().mean(axis=0)
    if ax.dataLim.width < 2.0 and ax.dataLim.height < 2.0:
        ax.update_datalim([middle - 1.0, middle + 1.0])
    ax.margins(0.06)
    ax.autoscale_view()
    ax.set_aspect("equal", adjustable="datalim")  # the limits grow to the shape of the axes
    ax.grid(alpha=0.3)
    ax.set(axisbelow=True, xlabel="x [m]", ylabel="y [m]")


def _name_place(name: str, body: Body | PointTarget, time: float, color: str, sensor: NDArray[np.float64]) -> Name:
    """Name and its place: the middle of a body, or a corner of a body around the sensor."""
    outline = _outline(body, time)
    corner, middle = outline[np.argmax(outline @ (-1.0, 1.0))], 0.5 * (outline.min(axis=0) + outline.max(axis=0))
    x, y = corner if _encloses(outline, sensor) else middle
    return Name(float(x), float(y), name, color)


def _corners(body: Body | PointTarget, time: float) -> NDArray[np.float64]:
    """Points of a body in its own coordinates at one time, (n, 3)."""
    if isinstance(body, PointTarget) or len(body.mesh.triangles) == 0:
        return np.zeros((1, 3))
    vertices = body.vertices_at(time)
    return np.asarray(vertices[used_by(body.mesh.triangles, len(vertices))])


def _moved(body: Body | PointTarget, times: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points of a body in its own coordinates at several times, (time, n, 3), in the world [m]."""
    maps = poses_at(motion_of(body), times)  # at once: of a person, time by time takes far longer
    return np.asarray(points @ maps[:, :, :3].swapaxes(1, 2) + maps[:, None, :, 3])


def _outline(body: Body | PointTarget, time: float) -> NDArray[np.float64]:
    """Corners (n, 2) of the convex outline on the floor at one time, anticlockwise [m]."""
    flat = motion_of(body).at(time).apply(_corners(body, time))[:, :2]
    farthest = np.argmax(flat @ _DIRECTIONS, axis=0)
    around = farthest[np.flatnonzero(farthest != np.roll(farthest, 1))]
    return np.asarray(flat[around] if len(around) > 0 else flat[farthest[:1]])


def _encloses(outline: NDArray[np.float64], point: NDArray[np.float64]) -> bool:
    """True when a convex outline encloses or touches a point."""
    if len(outline) < 3:
        return False
    along, to_point = np.roll(outline, -1, axis=0) - outline, point - outline
    return bool((along[:, 0] * to_point[:, 1] - along[:, 1] * to_point[:, 0] >= 0.0).all())


def _bounds(body: Body | PointTarget, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Smallest and largest of a body's own coordinates at several times, (time, 2, 3) [m]."""
    deforms = isinstance(body, Body) and body.deformation is not None
    corners = [_corners(body, time) for time in times[: None if deforms else 1].tolist()]
    bounds = np.array([[points.min(axis=0), points.max(axis=0)] for points in corners])
    return np.broadcast_to(bounds, (len(times), 2, 3))


def _trail(body: Body | PointTarget, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """The middle of a body on the floor at several times, (time, 2) [m]."""
    return _moved(body, times, _bounds(body, times).mean(axis=1, keepdims=True))[:, 0, :2]


def _moves(body: Body | PointTarget, times: NDArray[np.float64]) -> bool:
    """True when a corner of the body's bounds leaves its place."""
    return bool((np.ptp(_moved(body, times, _bounds(body, times)), axis=0) > _STILL).any())


def _extent(body: Body | PointTarget, time: float) -> float:
    """Diagonal of the body's bounds at one time [m]."""
    return float(np.linalg.norm(np.ptp(_corners(body, time), axis=0)))


def _dense(times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Times along the trails, from the first to the last of `times`."""
    return np.linspace(times.min(), times.max(), _POINTS_OF_TRAIL)


def _sensor_poses(tracks: Tracks) -> NDArray[np.float64]:
    """Poses of the sensor in all frames, (frame, 3, 4), NaN in frames without a track; (1, 3, 4) of one at rest."""
    poses = np.full((len(tracks.time), 3, 4), np.nan)
    for one in tracks:
        poses[one.frame] = one.sensor_pose
    known = poses[np.isfinite(poses[:, 0, 0])] if len(tracks) > 0 else np.eye(3, 4)[None]
    return known[:1] if (known == known[0]).all() else poses


def _draw_track(ax: Axes, track: Track, color: str) -> None:
    """The way of a target, and how well its end is known."""
    from matplotlib.patches import Ellipse

    places = track.position[:, :2]
    seen = np.where(track.is_detected[:, None], places, np.nan)
    ax.plot(*places.T, color=color, linewidth=1.0, linestyle=":", zorder=3.0)
    ax.plot(*seen.T, color=color, linewidth=1.6, zorder=3.0)
    ax.plot(*places[0], ".", color=color, markersize=6.0, zorder=3.0)
    values, vectors = np.linalg.eigh(covariance_from_above(track.state_covariance[-1], track.sensor_pose[-1]))
    width, height = (2.0 * _DEVIATIONS * np.sqrt(values)).tolist()
    angle = float(np.rad2deg(np.arctan2(vectors[1, 0], vectors[0, 0])))
    x, y = places[-1].tolist()
    ax.add_patch(Ellipse((x, y), width, height, angle=angle, color=color, alpha=0.25, zorder=2.5))


def _draw_truth(ax: Axes, truth: Truth, poses: NDArray[np.float64]) -> list[Name]:
    """Draw true paths of all bodies by the poses of the sensor, (frame, 3, 4) or (1, 3, 4); returns their names."""
    places = np.atleast_2d(truth.range)[..., None] * unit_vectors(truth.azimuth, np.nan_to_num(truth.elevation))
    if len(poses) not in (1, len(places)):
        raise ValueError(f"truth: expected the {len(poses)} frames of the tracks, got {len(places)}")
    x, y, _ = np.moveaxis(places @ poses[:, :, :3].mT + poses[:, None, :, 3], -1, 0)
    names = []
    for name, *way in zip(truth.names, x.T, y.T, strict=True):
        ax.plot(*way, color=canvas.GREY, linewidth=4.0, alpha=0.35, solid_capstyle="round", zorder=2.0)
        names += canvas.line_name(name, *way)
    return names
