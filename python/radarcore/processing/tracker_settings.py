"""Settings of a tracker: how targets move and are detected, and when a track begins and ends."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from radarcore import check


@dataclass(frozen=True, kw_only=True)
class TrackerSettings:
    """Settings of a tracker: how targets move, how well they are detected, when tracks begin and end.

    Parameters
    ----------
    acceleration_density : float
        Power spectral density of the acceleration of targets [m^2/s^3]: their velocity changes by
        ``sqrt(acceleration_density * t)`` in a time t, one standard deviation.
    max_speed : float
        Largest speed of targets [m/s]. No track begins with more; the velocity across the line of sight begins as
        unknown within it.
    max_velocity : float, optional
        Largest unambiguous velocity of the waveform [m/s], `Waveform.max_velocity`: measured velocities are known
        modulo twice that, and are taken as those nearest to what is expected. Default: that of the frames; from
        `Detections` alone, velocities are taken as they are.
    gate : float
        Probability that a detection of a target lies within the gate of its track, from 0 to 1.
    confirm_hits, confirm_frames : int
        A track is confirmed with so many detections within so many frames from its first on, that one included; it ends
        as soon as it cannot be any more.
    max_missed : int
        Frames in a row without a detection that a confirmed track outlives. Lost frames do not count.
    max_gap : float, optional
        Longest time between two detections of a track [s]; default: any.
    cluster_distance, cluster_velocity : float or None
        Detections within both [m, m/s] of each other are one target, see `cluster`; None: any. Both None: every
        detection is one of its own.
    deviations : (4,) array_like
        Standard deviations of range [m], velocity [m/s], azimuth and elevation [rad] for detections without a
        covariance.
    extent : float
        Standard deviation of the place on a target from which echoes come [m]: adds to that of detections.
    velocity_extent : float
        Standard deviation of the velocities of its parts [m/s]: likewise.
    num_dimensions : 1, 2 or 3, optional
        Range alone; the plane, by azimuth; space, by elevation too. Default: by what the first detections tell.

    See Also
    --------
    track : Takes them as keywords.
    Tracker : Likewise.

    Examples
    --------
    >>> settings = rc.TrackerSettings(max_speed=2.0, confirm_hits=2, confirm_frames=3)
    >>> rc.Tracker(max_speed=2.0, confirm_hits=2, confirm_frames=3).settings == settings
    True
    """

    acceleration_density: float = 1.0
    max_speed: float = 3.0
    max_velocity: float | None = None
    gate: float = 0.999
    confirm_hits: int = 3
    confirm_frames: int = 5
    max_missed: int = 10
    max_gap: float | None = None
    cluster_distance: float | None = 0.3
    cluster_velocity: float | None = 1.0
    deviations: ArrayLike = (0.05, 0.2, 0.1, 0.1)
    extent: float = 0.05
    velocity_extent: float = 0.1
    num_dimensions: int | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        positive = {"acceleration_density": "m^2/s^3", "max_speed": "m/s"}
        optional = {"max_velocity": "m/s", "max_gap": "s", "cluster_distance": "m", "cluster_velocity": "m/s"}
        for name, unit in (positive | optional).items():
            if getattr(self, name) is not None or name in positive:
                put(self, name, check.positive(name, getattr(self, name), unit))
        for name, unit in {"extent": "m", "velocity_extent": "m/s"}.items():
            put(self, name, check.non_negative(name, getattr(self, name), unit))
        put(self, "gate", check.number("gate", self.gate))
        if not 0.0 < self.gate < 1.0:
            raise ValueError(f"gate: expected a probability between 0 and 1, got {self.gate:g}")
        put(self, "confirm_hits", check.count("confirm_hits", self.confirm_hits))
        put(self, "confirm_frames", check.count("confirm_frames", self.confirm_frames))
        if self.confirm_frames < self.confirm_hits:
            raise ValueError(
                f"confirm_frames: expected at least confirm_hits = {self.confirm_hits}, got {self.confirm_frames}"
            )
        put(self, "max_missed", check.count("max_missed", self.max_missed, 0))
        deviations = check.array("deviations", self.deviations, (4,))
        if (deviations <= 0.0).any():
            raise ValueError(f"deviations: expected positive numbers, got {deviations.tolist()}")
        put(self, "deviations", tuple(deviations.tolist()))
        if self.num_dimensions is not None and check.count("num_dimensions", self.num_dimensions) > 3:
            raise ValueError(f"num_dimensions: expected 1, 2 or 3, got {self.num_dimensions}")
