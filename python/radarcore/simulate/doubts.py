"""Warnings about the validity of results, one of each kind."""

from __future__ import annotations

from math import hypot

from radarcore import _core, notice
from radarcore.radar.radar import Radar
from radarcore.scene import library
from radarcore.scene.scene import Scene


class Doubts:
    """Warnings of a simulation, each given once.

    Parameters
    ----------
    radar : Radar
    tolerance : float
        Bound on the error of the synthesis.
    """

    def __init__(self, radar: Radar, tolerance: float) -> None:
        self._radar, self._tolerance = radar, tolerance
        self._told: set[str] = set()

    def of_materials(self, scene: Scene) -> None:
        """Warn of materials at frequencies for which they are not known."""
        if self._is_new("materials"):
            used = (body.material for body in scene.parts.meshed)
            if text := library.extrapolation(used, self._radar.waveform.center_frequency):
                notice.warn(text)

    def of_rate(self, rate: float) -> None:
        """Warn of frames that overlap at a rate [Hz]."""
        duration = self._radar.waveform.duration
        if duration * rate > 1.0:
            notice.warn(
                f"frames of {1e3 * duration:.2f} ms overlap at {rate:g} frames per second; no real sensor can do that"
            )

    def of_frame(self, ideal: _core.IdealFrame) -> None:
        """Warn of unresolved motion within a frame, and of echoes from beyond the largest range."""
        phase, weight = ideal.series_errors
        if (residual := hypot(phase, weight)) > self._tolerance and self._is_new("series"):
            series = "phases (fast motion, or large absolute times)" if phase > weight else "amplitudes (turning edges)"
            notice.warn(
                f"{series} are interpolated within a frame with an error of {residual:.1e}, above the tolerance of "
                f"{self._tolerance:.1e}"
            )
        if ideal.farthest > self._radar.max_range and self._is_new("range"):
            notice.warn(
                f"the scene reaches to {ideal.farthest:.2f} m, beyond max_range {self._radar.max_range:.2f} m of the "
                "waveform: echoes from there appear at wrong ranges"
            )

    def of_sampling(self, cells_not_split: int) -> None:
        """Warn of cells that adaptive sampling should have refined, and could not."""
        if cells_not_split > 0 and self._is_new("sampling"):
            notice.warn(
                f"adaptive sampling ended at its finest cells or its ray_budget: {cells_not_split} cells have a larger "
                "residual error than rcs_floor asks for"
            )

    def _is_new(self, kind: str) -> bool:
        if kind in self._told:
            return False
        self._told.add(kind)
        return True
