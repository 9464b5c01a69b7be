"""A MuJoCo model seen by a radar through rendered depth: images, bodies and motions for `frame_from_depth`."""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.adapters.images import PlanarDepth, from_mujoco_pixels
from radarcore.adapters.mujoco.model import LiveModel, gl_context, mujoco_module, no_graphics, number_of
from radarcore.geometry.rotation import Matrix
from radarcore.motion.protocol import Motion

_SPARE_GEOMS = 200
"""Room in MuJoCo's list of what is drawn, beyond the geoms of the model."""


@dataclass(frozen=True, eq=False)
class View:
    """View of a radar on a MuJoCo model, pixel by pixel; row 0 on top, column 0 on the left.

    Use: ``rc.frame_from_depth(radar=radar, **view.arguments)``.

    Attributes
    ----------
    depth : PlanarDepth
        Depth along the line of sight, camera and time.
    body : (rows, columns) int32
        Index of the body in ``LiveModel.bodies``; -1 for nothing.
    reflectance, albedo : (rows, columns) float64
        Of the body's material at normal incidence: power of the specular part, and of the diffuse one.
    twists : (body, 6) float64
        Motion of every body relative to the radar, in its axes, as `frame_from_depth` takes it.

    See Also
    --------
    adapters.mujoco.DepthView : Makes one.
    frame_from_depth : Frame from it.

    Examples
    --------
    >>> depth = rc.adapters.images.from_mujoco_renderer(np.full((48, 64), 2.0), fovy_deg=45.0, far=9.0, time=0.0)
    >>> none, metal = np.zeros((48, 64)), np.full((48, 64), 0.9)
    >>> view = rc.adapters.mujoco.View(depth, none.astype(np.int32), metal, none, twists=[[-0.5, 0, 0, 0, 0, 0]])
    >>> frame = rc.frame_from_depth(radar=rc.bgt60tr13c(num_chirps=16), **view.arguments)
    >>> frame.truth.velocity.round(2).tolist()
    [-0.5]
    """

    depth: PlanarDepth
    body: NDArray[np.int32]
    reflectance: Matrix
    albedo: Matrix
    twists: Matrix

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments of `frame_from_depth` but for the radar; the frame starts at the time of the image."""
        return {
            "distance": self.depth.depth,
            "reflectance": self.reflectance,
            "albedo": self.albedo,
            "camera": self.depth.camera,
            "planar": True,
            "body": self.body,
            "twists": self.twists,
            "time": 0.0 if self.depth.time is None else self.depth.time,
        }


class DepthView:
    """Draws depth and bodies of a MuJoCo model as a camera or a site sees them. A context manager.

    Both come from one pass, in single precision with a reversed z-buffer. Primitives are drawn with many facets, so
    that spheres and cylinders are round to a few hundredths of a millimetre.

    Parameters
    ----------
    live : LiveModel
        The model; its geoms are drawn, and nothing else.
    camera, site : str
        One of them, by name: the radar looks along the camera's line of sight, or along the x axis of the site.
    rows, columns : int
        Pixels.
    fovy_deg : float, optional
        Vertical angle of the image [degrees], pixels are square; default: the camera's.
    near, far : float
        Nearest and farthest depth that is drawn [m].
    frequency : float
        At which materials reflect [Hz].
    facets : int
        Facets round spheres, cylinders and capsules.

    Raises
    ------
    ImportError
        Where no OpenGL library is found: says which Debian packages have one.

    See Also
    --------
    adapters.mujoco.View : The drawn image.
    adapters.mujoco.LiveModel : Meshes, exact in phase.
    frame_from_depth : Frame from a view.

    Examples
    --------
    >>> import mujoco
    >>> ball = '<site name="radar"/><body pos="2 0 0"><freejoint/><geom name="ball" size="0.1"/></body>'
    >>> model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{ball}</worldbody></mujoco>")
    >>> data = mujoco.MjData(model)
    >>> live = rc.adapters.mujoco.LiveModel(model)
    >>> # What follows needs OpenGL.
    >>> with rc.adapters.mujoco.DepthView(live, site="radar", fovy_deg=40.0) as depth:  # doctest: +SKIP
    ...     frame = rc.frame_from_depth(radar=rc.bgt60tr13c(), **depth.view(data).arguments)
    >>> frame.truth.range.round(2).tolist()  # doctest: +SKIP
    [1.9]
    """

    def __init__(
        self,
        live: LiveModel,
        *,
        camera: str | None = None,
        site: str | None = None,
        rows: int = 240,
        columns: int = 320,
        fovy_deg: float | None = None,
        near: float = 0.1,
        far: float = 20.0,
        frequency: float = 60e9,
        facets: int = 256,
    ) -> None:
        mujoco = mujoco_module()
        self._sensor: Motion = live.motion(camera=camera, site=site)
        model = live.model
        self.live: LiveModel = live
        self.rows: int = check.count("rows", rows)
        self.columns: int = check.count("columns", columns)
        self.near: float = check.positive("near", near, "m")
        self.far: float = check.positive("far", far, "m")
        if self.far <= self.near:
            raise ValueError(f"far: expected more than near {self.near:g} m, got {self.far:g} m")
        self.fovy_deg: float = _vertical_angle(model, camera, fovy_deg)
        if not 0.0 < self.fovy_deg < 180.0:
            raise ValueError(f"fovy_deg: expected an angle between 0 and 180 degrees, got {self.fovy_deg:g}")

        # Reflectance of the materials, and the body of each geom.
        responses = [body.material.response(frequency) for body in live.bodies]
        # One more for pixels that show nothing.
        self._reflectance = np.array([*(abs(complex(field)) ** 2 for field, _ in responses), 0.0])
        self._albedo = np.array([*(float(albedo) for _, albedo in responses), 0.0])
        self._number = np.full(model.ngeom, -1, dtype=np.int32)
        self._number[list(live.geoms)] = np.arange(len(live.geoms), dtype=np.int32)

        # A context without smoothed edges, which would mix depths and colours of neighbours.
        quality, size = model.vis.quality, model.vis.global_
        wanted = [(quality, "offsamples", 0), (quality, "numslices", facets), (quality, "numstacks", facets // 2)]
        wanted += [(quality, "shadowsize", 0), (size, "offwidth", self.columns), (size, "offheight", self.rows)]
        saved = [(owner, name, getattr(owner, name)) for owner, name, _ in wanted]
        try:
            for setting in wanted:
                setattr(*setting)
            self._gl = gl_context(self.columns, self.rows)
            self._gl.make_current()
            self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        except Exception as error:  # every back end fails in its own way
            raise no_graphics(error) from error
        finally:
            for setting in saved:
                setattr(*setting)
        self._close = weakref.finalize(self, _free, self._gl, self._context)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        self._drawn = mujoco.MjvScene(model, model.ngeom + _SPARE_GEOMS)
        self._option = _only_geoms(mujoco, live.groups)

    def view(self, data: Any) -> View:
        """View of the state of an MjData, whose poses and velocities `live` takes as its newest update."""
        self.live.update(data)
        time = float(data.time)
        buffer, geom = self._draw(data)
        depth = from_mujoco_pixels(buffer, fovy_deg=self.fovy_deg, near=self.near, far=self.far, time=time)
        body = np.where(depth.valid & (geom >= 0), self._number[geom], np.int32(-1)).astype(np.int32)
        return View(depth, body, self._reflectance[body], self._albedo[body], self._twists(time))

    def close(self) -> None:
        """Free what the graphics library holds."""
        self._close()

    def __enter__(self) -> DepthView:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _draw(self, data: Any) -> tuple[NDArray[np.float32], NDArray[np.intp]]:
        """Reversed z-buffer, bottom row first, and number of the geom of every pixel, top row first; -1 for none."""
        if not self._close.alive:
            raise ValueError("DepthView: it is closed")
        mujoco, model, drawn = mujoco_module(), self.live.model, self._drawn
        # Geoms that the radar does not see are transparent meanwhile.
        alpha = model.geom_rgba[:, 3].copy()
        try:
            model.geom_rgba[self._number < 0, 3] = 0.0
            every = int(mujoco.mjtCatBit.mjCAT_ALL)
            mujoco.mjv_updateScene(model, data, self._option, None, mujoco.MjvCamera(), every, drawn)
        finally:
            model.geom_rgba[:, 3] = alpha
        self._point_cameras(time=float(data.time))
        for flag in ("SHADOW", "REFLECTION", "SKYBOX", "FOG", "HAZE"):
            drawn.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = False
        for flag in ("SEGMENT", "IDCOLOR"):
            drawn.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = True
        color = np.empty((self.rows, self.columns, 3), dtype=np.uint8)
        depth = np.empty((self.rows, self.columns), dtype=np.float32)
        self._gl.make_current()
        rectangle = mujoco.MjrRect(0, 0, self.columns, self.rows)
        mujoco.mjr_render(rectangle, drawn, self._context)
        mujoco.mjr_readPixels(color, depth, rectangle, self._context)

        # Colours count what is drawn, from 1 on; background is 0.
        counts = color[::-1].astype(np.intp) @ [1, 256, 65536]
        geoms = np.full(drawn.ngeom + 1, -1, dtype=np.intp)
        for part in (drawn.geoms[k] for k in range(drawn.ngeom)):
            if part.objtype == mujoco.mjtObj.mjOBJ_GEOM and part.segid >= 0:
                geoms[part.segid + 1] = part.objid
        return depth, geoms[np.minimum(counts, drawn.ngeom)]

    def _point_cameras(self, time: float) -> None:
        """Let both eyes of the drawing look from the radar's place, over its angles and depths."""
        pose = self._sensor.at(time)
        top = self.near * np.tan(0.5 * np.deg2rad(self.fovy_deg))
        for eye in (self._drawn.camera[0], self._drawn.camera[1]):
            eye.pos[:], eye.forward[:], eye.up[:] = pose.position, pose.rotation[:, 0], pose.rotation[:, 2]
            eye.frustum_near, eye.frustum_far = self.near, self.far
            eye.frustum_top, eye.frustum_bottom, eye.frustum_center, eye.frustum_width = top, -top, 0.0, 0.0
            eye.orthographic = 0

    def _twists(self, time: float) -> Matrix:
        """Motion of every body relative to the radar, in its axes, (body, 6): at the radar's place."""
        sensor, place = self._sensor.at(time), self._sensor.rate_at(time)
        own = _turning(sensor.rotation, place[:, :3])
        found = np.zeros((len(self.live.bodies), 6))
        for twist, body in zip(found, self.live.bodies, strict=True):
            pose, rate = body.motion.at(time), body.motion.rate_at(time)
            angular = _turning(pose.rotation, rate[:, :3])
            there = rate[:, 3] + np.cross(angular, sensor.position - pose.position)
            twist[:3], twist[3:] = (there - place[:, 3]) @ sensor.rotation, (angular - own) @ sensor.rotation
        return found


def _vertical_angle(model: Any, camera: str | None, fovy_deg: float | None) -> float:
    """Vertical angle of the image [degrees]: as given, or from the camera."""
    if fovy_deg is not None:
        return check.number("fovy_deg", fovy_deg, "degrees")
    if camera is None:
        raise ValueError("fovy_deg: expected an angle [degrees] with a site, which has none of its own")
    number = number_of(model, "camera", camera)
    if model.cam_sensorsize[number].any():
        raise ValueError(
            f"fovy_deg: expected an angle [degrees], as camera {camera!r} has a sensor size instead of one"
        )
    return float(model.cam_fovy[number])


def _turning(rotation: Matrix, rate: Matrix) -> Matrix:
    """Angular velocity (3,) of a rotation and its time derivative."""
    cross = rate @ rotation.T
    return np.array([cross[2, 1], cross[0, 2], cross[1, 0]])


def _only_geoms(mujoco: Any, groups: tuple[int, ...]) -> Any:
    """Options of the drawing: geoms of the groups alone."""
    option = mujoco.MjvOption()
    option.flags[:] = False
    option.flags[mujoco.mjtVisFlag.mjVIS_STATIC] = True
    for kind in ("site", "joint", "tendon", "actuator", "skin", "flex"):
        getattr(option, f"{kind}group")[:] = False
    option.geomgroup[:] = [group in groups for group in range(len(option.geomgroup))]
    return option


def _free(gl: Any, context: Any) -> None:
    gl.make_current()
    context.free()
    gl.free()
