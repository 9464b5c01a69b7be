"""Presets of real sensors."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from radarcore import check
from radarcore.radar.bgt60_receiver import HIGHPASS_CUTOFFS, measured_receiver
from radarcore.radar.pattern import GaussianPattern
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform, check_frequency

_BGT60_BAND = (57e9, 64e9)
"""Frequencies that the chip reaches [Hz]: the ISM band at 60 GHz."""


def bgt60tr13c(
    *,
    stop_frequency: float | None = None,
    tx_power_dbm: float = 4.0,
    receiver: str | Receiver = "thermal",
    if_gain_db: int | None = None,
    high_pass: float | None = None,
    **waveform: Any,
) -> Radar:
    """Infineon BGT60TR13C: one TX, three RX in an L, real samples.

    Defaults are the chip's power-up settings: 58 to 63.5 GHz, 64 samples at 2 MHz, 64 chirps every 591 us.
    The ramp starts 3.1125 us before the first sample and reaches `stop_frequency` at the last, so the sampled
    bandwidth is smaller than ``stop_frequency - start_frequency``.

    Power, gain, beam widths and noise figure are the data sheet's typical values (4 dBm, 3.5 dBi, 65 by 40
    degrees, 12 dB). RX1 and RX3 are the azimuth pair, RX2 and RX3 the elevation pair, 2.5 mm apart. The
    phase centre of the TX is not public; it is put next to the corner of the L.

    Parameters
    ----------
    stop_frequency : float, optional
        End of the ramp [Hz]; default 63.5 GHz. Not together with `slope`.
    tx_power_dbm : float
        Transmitted power [dBm].
    receiver : "thermal", "measured" or Receiver
        Thermal: real samples in sqrt(W) with thermal noise alone. Measured: the chip's whole chain as measured, with
        leakage, filters and codes of its ADC, in parts of full scale; see docs/receiver.md.
    if_gain_db : int, optional
        Gain of the measured chain's baseband, 18 to 60 dB, rounded as the chip does. Default: 23.
    high_pass : float, optional
        Cutoff of the measured chain's high-pass [Hz]: the nearest of 20, 45, 70 and 80 kHz. Default: 80 kHz.
    **waveform
        Keywords of `Waveform` in place of the defaults.

    Raises
    ------
    ValueError
        For a ramp that begins or ends outside of 57 to 64 GHz, and as `Waveform`.
    """
    names = [field.name for field in fields(Waveform)]
    check.keywords(
        "bgt60tr13c", waveform, ["stop_frequency", "tx_power_dbm", "receiver", "if_gain_db", "high_pass", *names]
    )
    settings: dict[str, Any] = {
        "start_frequency": 58e9,
        "sample_rate": 2e6,
        "num_samples": 64,
        "num_chirps": 64,
        "adc_delay": 3.1125e-6,
    } | waveform
    start = _check_band("start_frequency", settings["start_frequency"])
    if "slope" not in settings:
        stop = _check_band("stop_frequency", 63.5e9 if stop_frequency is None else stop_frequency)
        if start == stop:
            raise ValueError(f"stop_frequency: expected another frequency than start_frequency, got {stop:g} Hz")
        settings["slope"] = (stop - start) / _sweep(settings)
    elif stop_frequency is not None:
        raise ValueError("stop_frequency: expected either stop_frequency or slope, got both")
    else:
        _check_band(
            "slope, end of the ramp", start + check.number("slope", settings["slope"], "Hz/s") * _sweep(settings)
        )
    if "chirp_times" not in settings:
        settings.setdefault("chirp_interval", 591.125e-6)
    if "frame_interval" not in settings:
        shortest = Waveform(**settings).frame_interval
        settings["frame_interval"] = max(77.26885e-3, shortest)
    spacing = 2.5e-3
    wf = Waveform(**settings)
    return Radar(
        wf,
        tx=[[0.0, -spacing, 0.0]],
        rx=[[0.0, spacing, 0.0], [0.0, 0.0, spacing], [0.0, 0.0, 0.0]],
        pattern=GaussianPattern(3.5, beamwidth_azimuth_deg=65.0, beamwidth_elevation_deg=40.0),
        tx_power_dbm=tx_power_dbm,
        receiver=_receiver(receiver, if_gain_db, high_pass, wf.bandwidth),
    )


def _receiver(kind: object, if_gain_db: int | None, high_pass: float | None, bandwidth: float) -> Receiver:
    """Receiver of a word, or one that was given."""
    if kind == "measured":
        gain = 23 if if_gain_db is None else if_gain_db
        return measured_receiver(gain, HIGHPASS_CUTOFFS[-1] if high_pass is None else high_pass, bandwidth=bandwidth)
    for name, value in (("if_gain_db", if_gain_db), ("high_pass", high_pass)):
        if value is not None:
            raise ValueError(f"{name}: expected None unless receiver is 'measured', got {value!r}")
    if isinstance(kind, Receiver):
        return kind
    check.choice("receiver", kind, ("thermal", "measured"))
    return Receiver(output="real", noise_figure_db=12.0)


def _sweep(settings: dict[str, Any]) -> float:
    """Duration of a ramp [s]: to the end of the last sample."""
    sampled = check.count("num_samples", settings["num_samples"]) / check.positive(
        "sample_rate", settings["sample_rate"], "Hz"
    )
    return check.non_negative("adc_delay", settings["adc_delay"], "s") + sampled


def _check_band(name: str, value: object) -> float:
    """A frequency of the chip [Hz]."""
    frequency = check_frequency(name, value)
    lowest, highest = _BGT60_BAND
    if not lowest <= frequency <= highest:
        raise ValueError(f"{name}: expected {lowest:g} to {highest:g} [Hz] of a BGT60TR13C, got {frequency:.6g}")
    return frequency
