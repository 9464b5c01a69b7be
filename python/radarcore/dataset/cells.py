"""Labels of the cells of a range-velocity map: the body whose echo is strongest there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radarcore.dataset.echoes import Echo
from radarcore.processing.inputs import require_one_waveform, require_uniform_chirps
from radarcore.processing.spectra.spectra import range_doppler
from radarcore.processing.spectra.windows import window_weights
from radarcore.radar.radar import Radar
from radarcore.radar.waveform import require_range
from radarcore.simulate.beat import beat_signal
from radarcore.units import power_from_db

DEPTH_DB = 60.0
"""Lowest level of a labelled cell below the strongest of the map [dB]."""

TIE_DB = 0.01
"""Powers that differ by less are equal: ten times what synthesis is exact to [dB]."""

NOBODY = -1


def require_map(radar: Radar) -> None:
    """Refuse radars whose frames have no range-velocity map, or one in which an echo is at several velocities."""
    require_one_waveform(radar)
    require_range(radar.waveform)
    require_uniform_chirps(radar.waveform)
    if radar.num_channels < len(radar.tx) * len(radar.rx):
        raise ValueError("cells: expected transmitters that send in turn, got a schedule of all at once")


def map_shape(radar: Radar) -> tuple[int, int]:
    """Rows and columns of `range_doppler` of a frame."""
    num_samples = radar.waveform.num_samples
    return radar.waveform.num_chirps, num_samples // 2 + 1 if radar.is_real else num_samples


def noise_power(radar: Radar) -> float:
    """Mean power of the receiver's thermal noise in a cell of the map, summed over the channels [W]."""
    if radar.receiver is None:
        return 0.0
    wf = radar.waveform
    fast, slow = window_weights("window", "hann", wf.num_samples), window_weights("window", "hann", wf.num_chirps)
    return float(radar.num_channels * radar.receiver.noise_variance(wf.sample_rate) * np.sum(fast**2) * np.sum(slow**2))


def strongest_bodies(echo: Echo, owners: NDArray[np.intp], radar: Radar) -> NDArray[np.int16]:
    """Label of the strongest echo in every cell of the range-velocity map, (doppler, range); -1 for none.

    Parameters
    ----------
    echo : Echo
        Paths at the middle of the frame, per TX-RX pair.
    owners : (body,) intp
        Label of every body of the scene.
    radar : Radar
        Of the frame.
    """
    first, second = np.zeros(map_shape(radar)), np.zeros(map_shape(radar))
    labels = np.full(map_shape(radar), NOBODY, dtype=np.int16)
    for label, own in echo.of_each(owners):
        power = map_power(own, radar)
        is_first = power > first
        np.maximum(second, np.where(is_first, first, power), out=second)
        first[is_first], labels[is_first] = power[is_first], label
    level = max(noise_power(radar), float(first.max(initial=0.0)) / power_from_db(DEPTH_DB))
    labels[(first < level) | (second * power_from_db(TIE_DB) > first)] = NOBODY
    return labels


def map_power(echo: Echo, radar: Radar) -> NDArray[np.float64]:
    """Power of paths in the cells of the map, summed over the channels, (doppler, range) [W]."""
    wf = radar.waveform
    # Velocities are those of the middle of the frame.
    begin = radar.channel_offsets[:, None] - radar.middle
    samples = beat_signal(echo.delay + begin * echo.rate, echo.amplitude, wf, delay_rate=echo.rate)
    cells = range_doppler(np.ascontiguousarray(samples.real) if radar.is_real else samples, wf)
    power: NDArray[np.float64] = (cells.real**2 + cells.imag**2).sum(axis=0, dtype=np.float64)
    return power
