"""Noise in the cells of a transform, where the receiver's is known."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarcore.recording.frame import FULL_SCALE, Frame
from radarcore.recording.recording import Recording


def known_noise(frame: Frame | Recording, *weights: NDArray[Any]) -> float | None:
    """Mean power of the receiver's noise in a cell of one channel; None where it is not known.

    White noise of variance s^2 has the power ``s^2 sum(w^2)`` in every cell of a transform with weights w, and a factor
    ``sum(w^2)`` more for every further axis. It is known of frames in sqrt(W), simulated ones, whose radar has a noise
    figure; not of codes of an ADC.

    Parameters
    ----------
    frame : Frame or Recording
    weights : (length,) arrays
        Window over each axis that is transformed.
    """
    receiver = frame.radar.receiver
    in_full_scale = frame.raw is not None if isinstance(frame, Frame) else frame.source.get("cube_unit") == FULL_SCALE
    if receiver is None or in_full_scale:
        return None
    variance = receiver.noise_variance(frame.radar.waveform.sample_rate)
    return variance * float(np.prod([np.square(w).sum() for w in weights])) or None
