"""Preset of the BGT60TR24, two transmitters and four receivers."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

from radarcore import check
from radarcore.radar.bgt60_receiver import receiver_of
from radarcore.radar.pattern import GaussianPattern
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.schedule import Schedule
from radarcore.radar.waveform import Waveform

_PITCH = 3.5e-3
"""Side of the square of receivers [m]."""


def bgt60tr24(
    *,
    tx_power_dbm: float = 4.0,
    receiver: str | Receiver = "thermal",
    if_gain_db: int | None = None,
    high_pass: float | None = None,
    schedule: Schedule | None = None,
    **waveform: Any,
) -> Radar:
    """Infineon BGT60TR24: two TX, four RX in a square of 3.5 mm, real samples.

    There is no public data sheet. Receivers are at the places that published code has: RX1 upper right, RX2 upper
    left, RX3 lower right, RX4 lower left, seen along the beam. The transmitters are put 7 mm apart, above the square,
    so that the channels make a row of four by two without gaps: **an assumption**. Power, gain, beam widths and noise
    figure are those of the BGT60TR13C. Without a schedule both transmitters are told apart without error.

    Defaults: 58 to 63.5 GHz sampled, 64 samples at 2 MHz, 16 chirps every 591 us, 25 ms from frame to frame.

    Parameters
    ----------
    tx_power_dbm : float
        Power of one transmitter [dBm].
    receiver : "thermal", "measured" or Receiver
        Thermal: real samples with thermal noise of 12 dB. Measured: the chain of a BGT60TR13C as measured, with RX4
        like RX3 and all receivers in phase, **an assumption** too.
    if_gain_db, high_pass : optional
        Of the measured chain, as in `bgt60tr13c`.
    schedule : Schedule, optional
        How the transmitters share the time, as in `Radar`.
    **waveform
        Keywords of `Waveform` in place of the defaults.

    See Also
    --------
    bgt60tr13c : One transmitter and three receivers.
    Schedule : How transmitters share the time.

    Examples
    --------
    >>> radar = rc.bgt60tr24(schedule=rc.Schedule.tdm())
    >>> radar
    <Radar 58 to 63.5 GHz, 16 chirps of 64 samples, 2 TX, 4 RX, 40 Hz>
    >>> radar.num_channels
    8
    """
    settings: dict[str, Any] = {
        "start_frequency": 58e9,
        "slope": 5.5e9 / 32e-6,
        "sample_rate": 2e6,
        "num_samples": 64,
        "num_chirps": 16,
    } | waveform
    names = [field.name for field in fields(Waveform)]
    check.keywords("bgt60tr24", waveform, ["tx_power_dbm", "receiver", "if_gain_db", "high_pass", "schedule", *names])
    if "chirp_times" not in settings:
        settings.setdefault("chirp_interval", 591.125e-6)
    if "frame_interval" not in settings:
        settings["frame_interval"] = max(25e-3, Waveform(**settings).frame_interval)
    shape = Waveform(**settings)
    chain = receiver_of(receiver, if_gain_db, high_pass, bandwidth=shape.bandwidth)
    if receiver == "measured":
        chain = replace(chain.of_receivers([0, 1, 2, 2]), rx_phase_deg=None)
    half = 0.5 * _PITCH
    return Radar(
        shape,
        tx=[[0.0, -_PITCH, 3.0 * _PITCH], [0.0, _PITCH, 3.0 * _PITCH]],
        rx=[[0.0, -half, half], [0.0, half, half], [0.0, -half, -half], [0.0, half, -half]],
        pattern=GaussianPattern(3.5, beamwidth_azimuth_deg=65.0, beamwidth_elevation_deg=40.0),
        tx_power_dbm=tx_power_dbm,
        receiver=chain,
        schedule=schedule,
    )
