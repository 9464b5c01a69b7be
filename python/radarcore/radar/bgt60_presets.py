"""Presets of Infineon's radars at 60 GHz."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

from radarcore import check
from radarcore.radar import bgt60_chip, design
from radarcore.radar.bgt60_receiver import receiver_of
from radarcore.radar.pattern import GaussianPattern, Pattern
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.schedule import Schedule
from radarcore.radar.waveform import Waveform

_BGT60_BAND = (57e9, 64e9)
"""Frequency range of the chip [Hz]: the ISM band at 60 GHz."""

_START, _WIDTH = 60e9, 1e9
"""Default start and width of the ramp [Hz]."""

_CHIRP_INTERVAL, _FRAME_INTERVAL = 300e-6, 25e-3
"""Default times from chirp to chirp and from frame to frame [s]."""

_SAMPLE_RATES = (2e6, 4e6)
"""Default sample rates in order of trial [Hz]: the lower has less noise, the higher faster chirps."""

_PATTERN = GaussianPattern(3.5, beamwidth_azimuth_deg=65.0, beamwidth_elevation_deg=40.0)
"""Typical values of the data sheet."""


def bgt60tr13c(
    *,
    stop_frequency: float | None = None,
    pattern: Pattern | None = None,
    tx_power_dbm: float = 4.0,
    receiver: str | Receiver = "thermal",
    if_gain_db: int | None = None,
    high_pass: float | None = None,
    max_range: float | None = None,
    max_velocity: float | None = None,
    range_resolution: float | None = None,
    velocity_resolution: float | None = None,
    rate: float | None = None,
    **waveform: Any,
) -> Radar:
    """Infineon BGT60TR13C: one TX, three RX in an L, real samples.

    By default it sees up to 10.1 m in bins of 0.157 m, up to 4.13 m/s towards or away in bins of 0.129 m/s, and 119 by
    74 degrees, 40 times per second: 60 to 61 GHz, 128 samples at 2 MHz, 64 chirps every 300 us, 25 ms per frame. The
    ramp starts 3.1125 us before the first sample and reaches `stop_frequency` at the last, so the sampled bandwidth is
    smaller than ``stop_frequency - start_frequency``. The chip's own settings at power-up see 0.96 m at 13 Hz: 58 to
    63.5 GHz, 64 samples, 64 chirps every 591.125 us, 77.26885 ms per frame.

    Power, gain, beam widths and noise figure are the data sheet's typical values (4 dBm, 3.5 dBi, 65 by 40 degrees, 12
    dB). RX1 and RX3 are the azimuth pair, RX2 and RX3 the elevation pair, with a spacing of 2.5 mm. The phase centre of
    the TX is not public; it is placed next to the corner of the L.

    Parameters
    ----------
    stop_frequency : float, optional
        End of the ramp [Hz]; default: 1 GHz above the start. Not together with `slope`.
    pattern : IsotropicPattern, GaussianPattern or TabulatedPattern, optional
        Of every antenna, such as one that you measured; default: Gaussian with the data sheet's gain and beam widths.
    tx_power_dbm : float
        Transmitted power [dBm].
    receiver : "thermal", "measured" or Receiver
        Thermal: real samples in sqrt(W) with thermal noise alone. Measured: the chip's whole chain as measured, with
        leakage, filters and codes of its ADC, in parts of full scale; see docs/receiver.md.
    if_gain_db : int, optional
        Gain of the measured chain's baseband, 18 to 60 dB, rounded as the chip does. Default: 23.
    high_pass : float, optional
        Cutoff of the measured chain's high-pass [Hz]: the nearest of 20, 45, 70 and 80 kHz. Default: 80 kHz.
    max_range, max_velocity, range_resolution, velocity_resolution, rate : float, optional
        Requirements, as in `Waveform.design`, [m], [m/s], [m], [m/s], [Hz]: settings of the chip that meet all of them,
        its timers included. Other settings keep their defaults, or less if a requirement needs it. The sample rate is 2
        MHz, or 4 MHz if that is too slow; the ramp ends by 63.5 GHz.
    **waveform
        Keywords of `Waveform` in place of the defaults. Together with requirements: `start_frequency`, `sample_rate`,
        `num_samples` and `num_chirps`, and times that the requirements leave free.

    Raises
    ------
    ValueError
        For a ramp that begins or ends outside of 57 to 64 GHz, for conflicting requirements (the message names one and
        its limit), and as `Waveform`.

    See Also
    --------
    bgt60tr24 : Two transmitters and four receivers.
    Waveform.design : Waveform from requirements, of any radar.
    open_sensor : A board with that chip.

    Examples
    --------
    >>> radar = rc.bgt60tr13c()
    >>> radar
    <Radar 60.05 to 61 GHz, 64 chirps of 128 samples, 1 TX, 3 RX, 40 Hz>
    >>> print(f"up to {radar.max_unambiguous_range:.1f} m in bins of {radar.waveform.range_resolution:.3f} m")
    up to 10.1 m in bins of 0.157 m
    >>> print(f"up to {radar.max_velocity:.2f} m/s in bins of {radar.waveform.velocity_resolution:.3f} m/s")
    up to 4.13 m/s in bins of 0.129 m/s
    """
    names = [field.name for field in fields(Waveform)]
    check.keywords(
        "bgt60tr13c",
        waveform,
        [
            *("stop_frequency", "pattern", "tx_power_dbm", "receiver", "if_gain_db", "high_pass"),
            *design.REQUIREMENTS,
            *names,
        ],
    )
    values = (max_range, max_velocity, range_resolution, velocity_resolution, rate)
    requirements = {name: value for name, value in zip(design.REQUIREMENTS, values, strict=True) if value is not None}
    if stop_frequency is not None:
        waveform["stop_frequency"] = stop_frequency
    shape = _of_requirements(requirements, waveform) if requirements else _chosen(**waveform)
    spacing = 2.5e-3
    return Radar(
        shape,
        tx=[[0.0, -spacing, 0.0]],
        rx=[[0.0, spacing, 0.0], [0.0, 0.0, spacing], [0.0, 0.0, 0.0]],
        pattern=_PATTERN if pattern is None else pattern,
        tx_power_dbm=tx_power_dbm,
        receiver=receiver_of(receiver, if_gain_db, high_pass, bandwidth=shape.bandwidth),
    )


def _chosen(stop_frequency: float | None = None, **waveform: Any) -> Waveform:
    """Waveform of keywords, with defaults for others."""
    settings: dict[str, Any] = {
        "sample_rate": 2e6,
        "num_samples": 128,
        "num_chirps": 64,
        "adc_delay": bgt60_chip.FIRST_SAMPLE / bgt60_chip.CLOCK,
    } | waveform
    if stop_frequency is not None and "slope" in settings:
        raise ValueError("stop_frequency: expected either stop_frequency or slope, got both")
    lowest, highest = _BGT60_BAND
    stop = None if stop_frequency is None else _check_band("stop_frequency", stop_frequency)
    settings.setdefault("start_frequency", _START if stop is None else max(lowest, stop - _WIDTH))
    start, sweep = _check_band("start_frequency", settings["start_frequency"]), _sweep(settings)
    if "slope" in settings:
        _check_band("slope, end of the ramp", start + check.number("slope", settings["slope"], "Hz/s") * sweep)
    else:
        stop = min(start + _WIDTH, highest) if stop is None else stop
        if start == stop:
            raise ValueError(f"stop_frequency: expected another frequency than start_frequency, got {stop:g} Hz")
        settings["slope"] = (stop - start) / sweep
    return _waveform(settings, max(_CHIRP_INTERVAL, sweep + bgt60_chip.IDLE_TIME))


def _of_requirements(requirements: dict[str, float], others: dict[str, Any]) -> Waveform:
    """Waveform that meets requirements and some other keywords."""
    kept = {"start_frequency", "sample_rate", "num_samples", "num_chirps"}
    if requirements.keys() <= {"max_range", "range_resolution"}:
        kept.add("chirp_interval")
    if "rate" not in requirements:
        kept.add("frame_interval")
    if rest := [name for name in others if name not in kept]:
        raise ValueError(
            f"{rest[0]}: expected none beside {' and '.join(requirements)}, which decide it, got {others[rest[0]]}"
        )
    if "start_frequency" in others:
        start = check.frequency("start_frequency", others["start_frequency"])
        lowest, highest = bgt60_chip.LOWEST_FREQUENCY, bgt60_chip.HIGHEST_FREQUENCY
        if not lowest <= start < highest:
            raise ValueError(f"start_frequency: expected {lowest:g} to {highest:g} [Hz], got {start:.6g}")
    if "sample_rate" in others:
        return _designed(bgt60_chip.divider_of(others["sample_rate"]), requirements, others)
    slow, fast = map(bgt60_chip.divider_of, _SAMPLE_RATES)
    try:
        return _designed(slow, requirements, others)
    except design.RequirementError:
        return _designed(fast, requirements, others)


def _designed(divider: int, requirements: dict[str, float], others: dict[str, Any]) -> Waveform:
    """Waveform that meets requirements at a number of clock cycles per sample."""
    limits = bgt60_chip.limits(divider)
    given: dict[str, Any] = requirements | {
        name: others[name] for name in ("start_frequency", "num_samples", "num_chirps") if name in others
    }
    keywords = design.keywords_for(
        limits, **given, default_start=_START, default_bandwidth=_WIDTH, default_interval=_CHIRP_INTERVAL
    )
    times = {name: others[name] for name in ("chirp_interval", "frame_interval") if name in others}
    keywords |= {name: check.positive(name, value, "s") for name, value in times.items()}
    if keywords["frame_interval"] is None:
        chirps = keywords["num_chirps"] * limits.longest(keywords["chirp_interval"])
        keywords["frame_interval"] = max(_FRAME_INTERVAL, chirps)
    return Waveform(**keywords)


def _waveform(settings: dict[str, Any], chirp_interval: float) -> Waveform:
    """Waveform with default intervals where there are none."""
    if "chirp_times" not in settings:
        settings = {"chirp_interval": chirp_interval} | settings
    if "frame_interval" not in settings:
        settings = settings | {"frame_interval": max(_FRAME_INTERVAL, Waveform(**settings).frame_interval)}
    return Waveform(**settings)


def _sweep(settings: dict[str, Any]) -> float:
    """Duration of a ramp [s]: to the end of the last sample."""
    sampled = check.count("num_samples", settings["num_samples"]) / check.positive(
        "sample_rate", settings["sample_rate"], "Hz"
    )
    return check.non_negative("adc_delay", settings["adc_delay"], "s") + sampled


def _check_band(name: str, value: object) -> float:
    """A frequency of the chip [Hz]."""
    frequency = check.frequency(name, value)
    lowest, highest = _BGT60_BAND
    if not lowest <= frequency <= highest:
        raise ValueError(f"{name}: expected {lowest:g} to {highest:g} [Hz] of a BGT60TR13C, got {frequency:.6g}")
    return frequency


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

    There is no public data sheet. Receivers are at the positions of published code: RX1 upper right, RX2 upper left,
    RX3 lower right, RX4 lower left, seen along the beam. The transmitters are 7 mm from each other, above the square,
    so that the channels form four by two without gaps: **an assumption**. Power, gain, beam widths and noise figure are
    copied from the BGT60TR13C. Without a schedule both transmitters are ideally separated.

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
    shape = _waveform(settings, 591.125e-6)
    chain = receiver_of(receiver, if_gain_db, high_pass, bandwidth=shape.bandwidth)
    if receiver == "measured":
        chain = replace(chain.of_receivers([0, 1, 2, 2]), rx_phase_deg=None)
    half = 0.5 * _PITCH
    return Radar(
        shape,
        tx=[[0.0, -_PITCH, 3.0 * _PITCH], [0.0, _PITCH, 3.0 * _PITCH]],
        rx=[[0.0, -half, half], [0.0, half, half], [0.0, -half, -half], [0.0, half, -half]],
        pattern=_PATTERN,
        tx_power_dbm=tx_power_dbm,
        receiver=chain,
        schedule=schedule,
    )
