"""Settings of a simulation: sampling, sum, floors, reflections, seed, threads, and times of frames."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from radarcore import check
from radarcore.geometry.camera import checked_field_of_view
from radarcore.records import sealed
from radarcore.simulate.beat import METHODS, check_threads, check_tolerance
from radarcore.simulate.view import CELLS_AT_60, MOST_OF_A_PLANE, MOST_OF_ANTENNAS, Angles, Sectors, one_plane

SAMPLINGS = ("adaptive", "fast", "footprint", "point")
"""Ways to cast rays and to sample the surface around a hit."""

_RCS_FLOORS = {"adaptive": 1e-2, "fast": 1e-1}
"""Smallest cross-section of interest by default [m^2]."""

_RAY_BUDGET = 400_000
"""Rays through cells of adaptive sampling by default."""

_MOST_RAYS = 2**32
"""Largest ray budget."""

_RAYS_PER_CELL = 4
"""Least budget of rays per cell of the base grid: all cells can be split once."""

_IMAGE_SIDE = 2 * CELLS_AT_60
"""Default pixels of images; images of rays and ray tubes have more above 60 degrees."""

MAX_BOUNCES = 64
"""Largest number of reflections: paths with more are lost in the noise."""

NOT_RECORDED = ("method", "threads")
"""Settings that change no result."""

_OF_ADAPTIVE = ("rcs_floor", "ray_budget")
"""Settings of adaptive sampling alone."""


@sealed
@dataclass(kw_only=True, eq=False)
class Settings:
    """Settings of `Simulator`, which documents them."""

    resolution: int | tuple[int, int] | None = None
    field_of_view_deg: Angles | None = None
    sampling: str = "adaptive"
    tolerance: float = 1e-3
    method: str = "auto"
    rcs_floor: float | None = None
    ray_budget: float | None = None
    gain_floor_db: float = 80.0
    max_bounces: int = 1
    bounce_floor_db: float = 80.0
    retrace_deg: float = 10.0
    seed: int = 0
    threads: int | None = None

    def __post_init__(self) -> None:
        if self.resolution is not None:
            self.resolution = _resolution(self.resolution)
        if self.field_of_view_deg is not None:
            self.field_of_view_deg = checked_field_of_view(self.field_of_view_deg)
        check.choice("sampling", self.sampling, SAMPLINGS)
        self.tolerance = check_tolerance(self.tolerance)
        check.choice("method", self.method, METHODS)
        if self.rcs_floor is not None:
            self.rcs_floor = check.positive("rcs_floor", self.rcs_floor, "m^2")
        self.max_bounces = check.count("max_bounces", self.max_bounces, maximum=MAX_BOUNCES)
        for name, unit in (("gain_floor_db", "dB"), ("bounce_floor_db", "dB"), ("retrace_deg", "degrees")):
            if (value := getattr(self, name)) != np.inf:
                setattr(self, name, check.positive(name, value, unit))
        self.seed = check.count("seed", self.seed, minimum=0, maximum=2**64 - 1)
        self.threads = check_threads(self.threads)
        if self.ray_budget is not None:
            self.ray_budget = _ray_budget(self.ray_budget, self._cells)

    @property
    def view_deg(self) -> Angles:
        """Horizontal and vertical angle that frames have [degrees]: those chosen, or as wide as any antennas see."""
        return self.field_of_view_deg or (MOST_OF_ANTENNAS, MOST_OF_ANTENNAS)

    @property
    def image_view_deg(self) -> Angles:
        """Horizontal and vertical angle of depth images [degrees]: those chosen, or at most 110."""
        horizontal, vertical = self.view_deg
        most = MOST_OF_A_PLANE if self.field_of_view_deg is None else 180.0
        return min(horizontal, most), min(vertical, most)

    @property
    def num_pixels(self) -> tuple[int, int]:
        """Rows and columns across the field of view, of the rays of frames unless sampling is adaptive."""
        return self._pixels.shape

    @property
    def num_cells(self) -> tuple[int, int]:
        """Rows and columns of the base grid of adaptive sampling, across the field of view."""
        return self._cells.shape

    @property
    def _cells(self) -> Sectors:
        """Base grid of adaptive sampling."""
        return Sectors.of(self.view_deg, self._number)

    @property
    def _pixels(self) -> Sectors:
        """Pixels of regular images, and of images that launch ray tubes."""
        return Sectors.of(self.view_deg, self._number, _IMAGE_SIDE, narrowest=60.0)

    @property
    def _number(self) -> tuple[int, int] | None:
        return None if self.resolution is None else _resolution(self.resolution)

    @property
    def num_rays(self) -> int:
        """Largest number of rays of a cast; without a limit the largest ray budget."""
        if not self.is_adaptive:
            return self._pixels.num_pixels
        return _MOST_RAYS if self.most_rays is None else self.most_rays

    @property
    def is_adaptive(self) -> bool:
        """True if rays go through cells that are refined, not through the pixels of an image."""
        return self.sampling in _RCS_FLOORS

    @property
    def most_rays(self) -> int | None:
        """Largest number of rays through cells; None: enough for `rcs_floor`."""
        if self.ray_budget is None:
            return max(_RAY_BUDGET, _RAYS_PER_CELL * self._cells.num_pixels)
        return None if self.ray_budget == np.inf else int(self.ray_budget)

    def to_dict(self) -> dict[str, Any]:
        """Settings that change results, for recordings; infinite ones are None, as JSON has no infinity."""
        values = {field.name: getattr(self, field.name) for field in fields(Settings)}
        values["field_of_view_deg"] = self.view_deg
        values["resolution"] = self.num_cells if self.is_adaptive else self.num_pixels
        values["ray_budget"] = self.most_rays
        left_out = NOT_RECORDED if self.is_adaptive else NOT_RECORDED + _OF_ADAPTIVE
        return {name: _as_json(value) for name, value in values.items() if name not in left_out}


def changed_settings(settings: Settings) -> dict[str, Any]:
    """Settings that are not the default ones."""
    given = {field.name: getattr(settings, field.name) for field in fields(Settings)}
    return {name: value for name, value in given.items() if value != getattr(Settings, name)}


def core_settings(settings: Settings, **debug: Any) -> dict[str, Any]:
    """Settings of the core.

    Rays, ray tubes and images go through planes (rows, columns, width and height of a pixel at distance 1, column and
    row of the axis); of rays and tubes there is one per sector of the field of view, whose rotations begin with the
    identity. In adaptive sampling the planes of the rays are the base grid. `debug` has the switches of tests and
    benches, which change no result.
    """
    pixels, image = settings._pixels, settings.image_view_deg
    rays = settings._cells if settings.is_adaptive else pixels
    return {
        "sampling": "adaptive" if settings.is_adaptive else settings.sampling,
        "rotations": rays.rotations,
        "rays": rays.planes,
        "tubes": pixels.planes,
        "image": one_plane(image, *(settings._number or (_IMAGE_SIDE, _IMAGE_SIDE))),
        "rcs_floor": _RCS_FLOORS.get(settings.sampling, 1.0) if settings.rcs_floor is None else settings.rcs_floor,
        "follows_echo": settings.rcs_floor is None,
        "ray_budget": settings.most_rays,
        "gain_floor": None if settings.gain_floor_db == np.inf else _ratio(settings.gain_floor_db),
        "max_bounces": settings.max_bounces,
        "bounce_floor": _ratio(settings.bounce_floor_db),
        "retrace": float(np.deg2rad(settings.retrace_deg)),
        "seed": settings.seed,
        "tolerance": settings.tolerance,
        "method": settings.method,
        "debug": {"skip_empty": True, "reuse_tiles": True, "level": None, **debug},
    }


def _ratio(floor_db: float) -> float:
    return float(10.0 ** (-0.1 * floor_db))


def _as_json(value: Any) -> Any:
    if isinstance(value, tuple):
        return list(value)
    return None if value == np.inf else value


def _ray_budget(value: float, cells: Sectors) -> float:
    """Checked budget: enough for the base grid."""
    if value == np.inf:
        return np.inf
    (rows, columns), budget = cells.shape, check.count("ray_budget", value)
    if budget < cells.num_pixels:
        # Sides of a box leave out its corners.
        size = f"{rows} x {columns}" if rows * columns == cells.num_pixels else f"{cells.num_pixels}"
        raise ValueError(f"ray_budget: expected at least the {size} rays of the base grid, got {budget}")
    if budget >= _MOST_RAYS:
        raise ValueError(f"ray_budget: expected less than 2**32, or inf, got {budget}")
    return budget


def _resolution(value: int | tuple[int, int]) -> tuple[int, int]:
    pair = (value, value) if np.ndim(value) == 0 else tuple(value)  # type: ignore[arg-type]  # ndim distinguishes them
    if len(pair) != 2:
        raise ValueError(f"resolution: expected an integer or (rows, columns), got {value!r}")
    rows, columns = (check.count("resolution", side) for side in pair)
    if rows * columns > 2**28:
        raise ValueError(f"resolution: expected at most {2**28} rays, got {rows} x {columns}")
    return rows, columns


_MAX_FRAMES = 10_000_000
"""Largest number of frames of a recording: a day at 100 Hz."""


def frame_times(start: float, stop: float, rate: float) -> list[float]:
    """Starts of the frames before `stop` [s]."""
    first, last = check.number("start", start, "s"), check.number("stop", stop, "s")
    per_second = check.positive("rate", rate, "Hz")
    if last <= first:
        raise ValueError(f"stop: expected a time after start {first:g} s, got {last:g} s")
    # A stop that is a whole number of frames away, but for rounding, is not the start of one more.
    num_frames = max(1.0, float(np.ceil((last - first) * per_second - 1e-6)))
    if num_frames > _MAX_FRAMES:
        raise ValueError(f"rate, stop: expected at most {_MAX_FRAMES} frames, got {num_frames:.3g}")
    return [first + i / per_second for i in range(int(num_frames))]
