"""Receiver of the BGT60 chips: the steps of its gain and filters, and the chain as it was measured.

Measured on recordings of several boards, 2 MHz sample rate, high-pass of 80 kHz; levels in steps (LSB) of the ADC.
Where data sheet and measurement differ, the measurement holds: noise 0.7 dB above the typical noise figure at high gain
and 5 dB above it at 23 dB, where the noise of the last amplifier shows, and a transmitter that leaks far more than the
die's isolation of 50 dB.
"""

from __future__ import annotations

from math import log10, sqrt

from radarcore import check
from radarcore.radar.receiver import AdcErrors, Leakage, Receiver
from radarcore.units import BOLTZMANN, NOISE_TEMPERATURE, power_from_db, power_from_dbm

HIGHPASS_CUTOFFS = (20e3, 45e3, 70e3, 80e3)
"""Cutoffs of the baseband's high-pass [Hz], in the order of HPF_SEL."""

LOWEST_GAIN_DB, HIGHEST_GAIN_DB = 18, 60
"""Gains of the baseband [dB]."""

CONVERSION_GAIN_DB = 14.0
"""Gain from the receiver's input to the voltage before the baseband [dB], typical value of the data sheet."""

_FULL_SCALE = 1.21
_BITS = 12
_VOLT_PER_LSB = 2.0 * _FULL_SCALE / ((1 << _BITS) - 1)
_ROOT_IMPEDANCE = 10.0
"""Root of twice 50 ohm: peak voltage of a tone over the root of its power."""

_MEASURED_RATE = 2e6
_MEASURED_POWER_DBM = 4.0
"""Power of the transmitter that leaked: typical value of the data sheet at level 31 [dBm]."""

_NOISE_AT_50_DB = 7.3
"""Deviation of noise before the low-pass at 50 dB [LSB], over half of the sample rate above."""

_NOISE_OF_LAST_STAGE = 0.45
"""Deviation of noise that the gain does not change [LSB], before the low-pass: 0.56 in all at 23 dB."""

_TURN_ON_AT_50_DB = 18.0
"""Deviation of the first sample of a chirp, as the chip turns on, at 50 dB [LSB]."""

_NARROW_SWEEP = 1e9
"""Sampled bandwidth below which leakage was seen as the transient of turning on alone [Hz]."""


def gain_stages(gain_db: int) -> tuple[int, int]:
    """Gain of the first amplifier, 18 or 30 dB, and steps of 5 dB of the second, nearest to a gain.

    The second choice of the first amplifier wins where it is as near (SDK 3.6.4).
    """
    first, steps = 18, (min(gain_db - 18, 30) + 2) // 5
    if gain_db >= 29:
        other = (min(gain_db - 30, 30) + 2) // 5
        if abs(30 + 5 * other - gain_db) <= abs(first + 5 * steps - gain_db):
            return 30, other
    return first, steps


def highpass_index(cutoff: float) -> int:
    """Place in `HIGHPASS_CUTOFFS` of the one nearest to a cutoff [Hz]."""
    return sum(cutoff >= middle for middle in (32_500, 57_500, 75_000))


def receiver_of(kind: object, if_gain_db: int | None, high_pass: float | None, *, bandwidth: float) -> Receiver:
    """Receiver of a preset: "thermal", "measured" with its gain [dB] and high-pass [Hz], or one that was given."""
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


def measured_receiver(if_gain_db: int = 23, high_pass: float = 80e3, *, bandwidth: float) -> Receiver:
    """The three receivers of a BGT60TR13C with their ADCs, as measured.

    Parameters
    ----------
    if_gain_db : int
        Gain of the baseband, 18 to 60 dB; the chip takes the nearest that it has.
    high_pass : float
        Cutoff of the high-pass [Hz]; the nearest of 20, 45, 70 and 80 kHz is taken.
    bandwidth : float
        Sampled bandwidth [Hz]: below 1 GHz, leakage is the transient of turning on alone.
    """
    first, steps = gain_stages(check.count("if_gain_db", if_gain_db, LOWEST_GAIN_DB, HIGHEST_GAIN_DB))
    baseband_db = first + 5 * steps
    over_50 = sqrt(power_from_db(baseband_db - 50.0))
    gain_db = CONVERSION_GAIN_DB + baseband_db
    # From a deviation at the ADC to the noise figure: k T F fs, half of it for real samples.
    noise = sqrt((_NOISE_AT_50_DB * over_50) ** 2 + _NOISE_OF_LAST_STAGE**2)
    floor = BOLTZMANN * NOISE_TEMPERATURE * 0.5 * _MEASURED_RATE
    return Receiver(
        output="real",
        noise_figure_db=10.0 * log10(_power_at_input(noise, gain_db) / floor),
        phase_noise=((100e3, -80.0),),
        leakage=_leakage(bandwidth),
        rx_phase_deg=(0.0, -75.0, 0.0),
        high_pass=HIGHPASS_CUTOFFS[highpass_index(check.non_negative("high_pass", high_pass, "Hz"))],
        low_pass=515e3,
        low_pass_order=4,
        gain_db=gain_db,
        full_scale=_FULL_SCALE,
        dc_offset=(-0.060, 0.040, 0.093),
        adc_bits=_BITS,
        adc_errors=AdcErrors(
            noise_lsb=0.9,
            chirp_offset_lsb=(0.78, 1.02, 0.18),
            segment_offset_lsb=0.5,
            turn_on_db=20.0 * log10(_TURN_ON_AT_50_DB * over_50 / noise),
            turn_on_time=0.75e-6,
        ),
    )


def _power_at_input(lsb: float, gain_db: float) -> float:
    """Square of a sample at the receiver's input [W] that makes a number of LSB."""
    field: float = lsb * _VOLT_PER_LSB / _ROOT_IMPEDANCE
    return field * field / power_from_db(gain_db)


def _leakage(bandwidth: float) -> Leakage:
    """Leakage fitted to recordings: of 5.5 GHz at 23 dB, and of narrow sweeps at 50 dB."""

    def level_db(lsb: float, baseband_db: float) -> float:
        power = _power_at_input(lsb, CONVERSION_GAIN_DB + baseband_db)
        return round(10.0 * log10(power / power_from_dbm(_MEASURED_POWER_DBM)), 2)

    if abs(bandwidth) < _NARROW_SWEEP:
        return Leakage(step_db=level_db(700.0, 50.0), step_time=1.125e-6)
    # Before the high-pass of 80 kHz, which leaves 0.19 of a tone of 15.7 kHz and 0.72 of one of 83 kHz.
    tone = [level_db(lsb, 23.0) for lsb in (4010.0, 1674.0, 1340.0)]
    echo = [level_db(lsb, 23.0) for lsb in (45.4, 59.7, 24.6)]
    step = [level_db(lsb, 23.0) for lsb in (422.8, 16.7, 332.4)]
    return Leakage(
        level_db=tuple(tone),
        delay=0.10e-9,
        phase_deg=(109.0, 36.2, 39.7),
        echo_db=tuple(echo),
        echo_delay=0.53e-9,
        echo_phase_deg=(145.3, -95.4, -5.8),
        step_db=tuple(step),
        step_phase_deg=(0.0, 0.0, 180.0),
        step_time=3e-6,
    )
