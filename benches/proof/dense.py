"""Dense integration of a scene: the limit of all samplings for free rays.

H = (j / 4 pi) sum of Gamma sqrt(G_t G_r) exp(-2jkR) dOmega over rays as close as the phase asks for. Of radarcore only
the distances of depth images are used: no footprint, no cell, nothing of its scattering or of its sum over paths. With
the distances of Embree nothing of its tracer either, to the facets as they are.

Every group of bodies has a window of its own, just wide enough for it. The rays of one image are too sparse on steep
surfaces, which causes false echoes as in any point image. These differ from image to image when the radar is turned by
parts of a pixel, and the mean of such images equals a finer image.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import radarcore as rc
from proof.measure import Phasors, Reals
from proof.range_spectrum import CELLS, add, spectrum

OVERVIEW = 512
"""Pixels of the image in which windows are looked for."""

MARGIN = 3.0
"""Pixels of the overview by which windows are wider than what it shows."""


@dataclass(frozen=True)
class Camera:
    """Pinhole camera at the radar: pose in the world, (rows, columns), half its width and height at a distance of 1."""

    pose: rc.Pose
    shape: tuple[int, int]
    half: tuple[float, float]

    def image(self, scene: rc.Scene, radar: rc.Radar) -> rc.DepthImage:
        """Depth image of radarcore."""
        view = tuple(np.rad2deg(2.0 * np.arctan(half)) for half in self.half)
        sim = rc.Simulator(
            scene,
            radar,
            radar_motion=self.pose,
            resolution=self.shape,
            field_of_view_deg=view,
            sampling="point",
        )
        return sim.depth_image()


Tracer = Callable[[rc.Scene, rc.Radar, Camera], tuple[Reals, NDArray[np.int32]]]
"""Distances along the rays of the pixels [m], and numbers of the bodies they meet, -1 for none."""


def smooth_surfaces(scene: rc.Scene, radar: rc.Radar, camera: Camera) -> tuple[Reals, NDArray[np.int32]]:
    """Distances by radarcore to the smooth surfaces that it takes meshes for."""
    image = camera.image(scene, radar)
    return image.surface_distance, image.body


def facets(scene: rc.Scene, radar: rc.Radar, camera: Camera) -> tuple[Reals, NDArray[np.int32]]:
    """Distances by radarcore to the facets as they are."""
    image = camera.image(scene, radar)
    return image.distance, image.body


@dataclass(frozen=True)
class Dense:
    """H at the frequencies of the sweep, from half of the images each."""

    halves: tuple[Phasors, Phasors]
    num_rays: int
    nearest: float
    """Distance of the nearest surface [m]."""
    farthest: float

    @property
    def transfer_function(self) -> Phasors:
        """H, from all images."""
        return 0.5 * (self.halves[0] + self.halves[1])


def dense(
    scene: rc.Scene,
    radar: rc.Radar,
    radar_motion: rc.Pose,
    *,
    pitch: float,
    shifts: int,
    background: Sequence[int] = (),
    field_of_view_deg: float = 60.0,
    tracer: Tracer = smooth_surfaces,
) -> Dense:
    """Sum over all rays, body by body.

    Parameters
    ----------
    scene : Scene
        Of bodies with real, constant reflection coefficients, all within the field of view but for the background.
    radar : Radar
        One transmitter and one receiver at the origin; its waveform says the frequencies.
    radar_motion : Pose
    pitch : float
        Between rays [rad], of one image.
    shifts : int
        Number of images, an even one.
    background : sequence of int
        Bodies that fill the field of view; large and flat, they have rays with twice the spacing.
    field_of_view_deg : float
        Field of view for the search of bodies; the background fills it [degrees].
    tracer : Tracer
        Whose distances, and to what surfaces.
    """
    histograms = np.zeros((2, CELLS))
    num_rays, spans = 0, []
    overview = rc.Simulator(
        scene,
        radar,
        radar_motion=radar_motion,
        resolution=OVERVIEW,
        field_of_view_deg=(field_of_view_deg, field_of_view_deg),
        sampling="point",
    ).depth_image()
    border = np.concatenate([overview.body[[0, -1]].ravel(), overview.body[:, [0, -1]].ravel()])
    if cut := [scene.names[body] for body in np.setdiff1d(border, [-1, *background])]:
        # Windows are wider than the bodies: parts outside of frames would count.
        raise ValueError(f"scene: expected bodies within the field of view, got {', '.join(cut)} at its border")
    seen = np.setdiff1d(overview.body, [-1, *background])
    views = [(View.around(overview, body), [body], pitch) for body in seen]
    if background:
        views.append((View.whole(field_of_view_deg), list(background), 2.0 * pitch))
    for view, bodies, spacing in views:
        for number, shift in enumerate(lattice(shifts)):
            distance, weight, count = view.look(scene, radar, radar_motion, bodies, spacing, shift, tracer)
            num_rays += count
            if distance.size == 0:
                continue
            spans += [distance.min(), distance.max()]
            add(histograms[2 * number // shifts], radar.waveform, distance, weight)
    first_half, second_half = (2.0 / shifts * spectrum(histogram, radar.waveform) for histogram in histograms)
    return Dense((first_half, second_half), num_rays, min(spans), max(spans))


def lattice(number: int) -> Reals:
    """Points spread evenly over a square about the origin, (number, 2): multiples of the plastic number's powers."""
    plastic = 1.324717957244746
    return (0.5 + np.arange(number)[:, None] / [plastic, plastic**2]) % 1.0 - 0.5


@dataclass(frozen=True)
class View:
    """A window of the image plane of a camera that is turned against the radar."""

    rotation: rc.Pose
    half_width: float
    half_height: float

    @classmethod
    def whole(cls, field_of_view_deg: float) -> View:
        """A square field of view [degrees]."""
        half = float(np.tan(np.deg2rad(0.5 * field_of_view_deg)))
        return cls(rc.Pose(), half, half)

    @classmethod
    def around(cls, overview: rc.DepthImage, body: int) -> View:
        """Just wide enough for a body that the overview shows."""
        directions = overview.directions[overview.body == body]
        x, y, z = directions.mean(axis=0)
        rotation = rc.Pose.from_rpy([0.0, 0.0, 0.0], [0.0, -np.arctan2(z, np.hypot(x, y)), np.arctan2(y, x)])
        ahead = directions @ rotation.rotation
        margin = MARGIN * 2.0 * np.tan(np.deg2rad(0.5 * overview.field_of_view_deg[0])) / OVERVIEW
        half_width, half_height = np.abs(ahead[:, 1:] / ahead[:, :1]).max(axis=0) + margin
        return cls(rotation, float(half_width), float(half_height))

    def look(
        self,
        scene: rc.Scene,
        radar: rc.Radar,
        radar_motion: rc.Pose,
        bodies: list[int],
        pitch: float,
        shift: Reals,
        tracer: Tracer,
    ) -> tuple[Reals, Reals, int]:
        """Distances of some bodies [m] and their weights Gamma sqrt(G_t G_r) dOmega, and how many rays were cast."""
        columns, rows = (int(np.ceil(2.0 * half / pitch)) for half in (self.half_width, self.half_height))
        turned = self.rotation @ rc.Pose.from_rpy([0.0, 0.0, 0.0], [0.0, *(shift * pitch)])
        half_width, half_height = 0.5 * pitch * columns, 0.5 * pitch * rows
        camera = Camera(radar_motion @ turned, (rows, columns), (half_width, half_height))
        distance, body = tracer(scene, radar, camera)
        # Misses have the number -1: the last.
        is_wanted = np.zeros(len(scene.bodies) + 1, dtype=bool)
        is_wanted[bodies] = True
        row, column = np.nonzero(is_wanted[body])
        u, v = half_width - (column + 0.5) * pitch, half_height - (row + 0.5) * pitch
        square = 1.0 + u**2 + v**2
        reflection = np.array([body.material.reflection.real for body in scene.bodies])
        weight = reflection[body[row, column]] * pitch**2 / (square * np.sqrt(square))
        # Directions as the antennas see them.
        x, y, z = turned.rotation @ np.stack([np.ones_like(u), u, v])
        pattern = radar.tx_patterns[0]
        weight = weight * pattern.gain(np.arctan2(y, x), np.arctan2(z, np.hypot(x, y)))
        return distance[row, column], weight, rows * columns
