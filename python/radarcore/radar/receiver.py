"""Receiver: settings of all that lies between the antennas and the samples, leakage among them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from typing import Any

from radarcore import check, notice
from radarcore.radar.waveform import Waveform
from radarcore.records import sealed
from radarcore.units import BOLTZMANN, NOISE_TEMPERATURE, power_from_db

PerReceiver = float | tuple[float, ...]
"""One number for all receivers, or one of each."""


@sealed
@dataclass(kw_only=True, unsafe_hash=True)
class Leakage:
    """Leakage from a transmitter to the receivers: tones of very low frequency, and what turning on leaves.

    All are the same in every chirp. Levels, at most 0 dB, and phases are numbers, or sequences with one per receiver.
    Delays are at most the duration of the ramp.

    Parameters
    ----------
    level_db : float or sequence of float, optional
        Power at the receiver's input relative to one transmitter [dB]. None: no tone.
    delay : float
        Delay [s]; the high-pass sees the beat frequency ``slope * delay``.
    phase_deg : float or sequence of float
        Phase in addition to the delay [degrees].
    echo_db : float or sequence of float, optional
        Power of a second tone, which comes off a cover, a housing or the board, as `level_db` [dB]. None: no such tone.
    echo_delay : float
        Its delay [s].
    echo_phase_deg : float or sequence of float
        Its phase in addition to the delay [degrees].
    step_db : float or sequence of float, optional
        Step of turning the transmitter on, behind the high-pass at the first sample, over the power of one transmitter
        [dB]. None: no step.
    step_phase_deg : float or sequence of float
        Its phase [degrees]: 180 for a real receiver that starts below its mean.
    step_time : float
        Time in which the step falls to 1/e [s].

    See Also
    --------
    Receiver : Takes it as `leakage`.
    bgt60tr13c : Has the leakage of a real chip with ``receiver="measured"``.

    Examples
    --------
    >>> receiver = rc.Receiver(leakage=rc.Leakage(level_db=-40.0, delay=0.2e-9))
    >>> radar = rc.Radar(rc.bgt60tr13c().waveform, tx_power_dbm=30.0, receiver=receiver)
    >>> frame = rc.Simulator(rc.Scene(), radar).frame(0.0)
    >>> print(f"{20 * np.log10(np.abs(frame.cube[0, 0, 0])):.1f} dBW")
    -40.0 dBW
    """

    level_db: PerReceiver | None = None
    delay: float = 0.0
    phase_deg: PerReceiver = 0.0
    echo_db: PerReceiver | None = None
    echo_delay: float = 0.0
    echo_phase_deg: PerReceiver = 0.0
    step_db: PerReceiver | None = None
    step_phase_deg: PerReceiver = 0.0
    step_time: float = 2e-6

    def __post_init__(self) -> None:
        levels = partial(per_receiver, one=check.non_positive_level)
        _check_given(self, ("level_db", "echo_db", "step_db"), levels, "dB")
        self.delay = check.non_negative("delay", self.delay, "s")
        self.echo_delay = check.non_negative("echo_delay", self.echo_delay, "s")
        for name in ("phase_deg", "echo_phase_deg", "step_phase_deg"):
            setattr(self, name, per_receiver(name, getattr(self, name), "degrees"))
        self.step_time = check.positive("step_time", self.step_time, "s")

    @property
    def tones(self) -> list[tuple[PerReceiver, float, PerReceiver]]:
        """Levels [dB], delay [s] and phases [degrees] of the tones that there are."""
        both = (
            (self.level_db, self.delay, self.phase_deg),
            (self.echo_db, self.echo_delay, self.echo_phase_deg),
        )
        return [(level_db, delay, phase_deg) for level_db, delay, phase_deg in both if level_db is not None]


def per_receiver(
    name: str, value: Any, unit: str, *, one: Callable[[str, object, str], float] = check.number
) -> PerReceiver:
    """A number, or a tuple of them with one per receiver, each checked by `one`."""
    if isinstance(value, list | tuple) or getattr(value, "ndim", 0) == 1:
        if len(value) == 0:
            raise ValueError(f"{name}: expected a number, or one per receiver, got none")
        return tuple(one(f"{name}[{k}]", number, unit) for k, number in enumerate(value))
    return one(name, value, unit)


def _one_each(settings: Receiver | Leakage | AdcErrors | None) -> dict[str, tuple[float, ...]]:
    """Settings that have one number per receiver."""
    given = {} if settings is None else vars(settings)
    return {name: value for name, value in given.items() if isinstance(value, tuple) and name != "phase_noise"}


MAX_ORDER = 16
"""Largest order of a filter."""

_BAND_MARGIN = 1.05
"""A filter frequency above this multiple of half the sample rate raises a warning: filters are not sharp."""

MAX_BITS = 24
"""Most bits of an ADC: float32 holds every code."""


@sealed
@dataclass(kw_only=True, unsafe_hash=True)
class AdcErrors:
    """Errors of an ADC, in its steps (LSB), and noise of its start in every chirp; all off by default.

    Parameters
    ----------
    noise_lsb : float, optional
        Deviation of the ADC's own white noise before rounding; no filter or gain changes it.
    chirp_offset_lsb : float or sequence of float, optional
        Deviation of offsets that hold for a chirp of one receiver; one, or one per receiver.
    segment_offset_lsb : float, optional
        Deviation of offsets that hold for a chirp of one receiver and a sixteenth of the ADC's codes.
    odd_width : float, optional
        Width of the odd codes from a quarter of the codes on, and of the even ones below; at most 2. The others are as
        much wider. None: 1.
    turn_on_db : float, optional
        Noise that turning on leaves in every chirp, at the first sample over the deviation of thermal noise before
        the low-pass [dB]: it decays with `turn_on_time` and is one draw per chirp and receiver.
    turn_on_time : float
        Time in which this noise falls to 1/e [s].

    See Also
    --------
    Receiver : Takes it as `adc_errors`.
    bgt60tr13c : Has the errors of a real chip with ``receiver="measured"``.

    Examples
    --------
    >>> errors = rc.AdcErrors(noise_lsb=0.9, chirp_offset_lsb=0.8)
    >>> receiver = rc.Receiver(noise_figure_db=12.0, full_scale=1.0, adc_bits=12, adc_errors=errors)
    >>> receiver.adc_errors.noise_lsb
    0.9
    """

    noise_lsb: float | None = None
    chirp_offset_lsb: PerReceiver | None = None
    segment_offset_lsb: float | None = None
    odd_width: float | None = None
    turn_on_db: float | None = None
    turn_on_time: float = 2e-6

    def __post_init__(self) -> None:
        steps = "steps of the ADC"
        _check_given(self, ("noise_lsb", "segment_offset_lsb"), check.non_negative, steps)
        _check_given(self, ("chirp_offset_lsb",), partial(per_receiver, one=check.non_negative), steps)
        _check_given(self, ("turn_on_db",), check.level, "dB")
        if self.odd_width is not None:
            self.odd_width = check.within("odd_width", self.odd_width, 0.0, 2.0, steps)
        self.turn_on_time = check.positive("turn_on_time", self.turn_on_time, "s")

    @property
    def are_of_codes(self) -> bool:
        """True if an error needs the steps of an ADC."""
        given = (self.noise_lsb, self.chirp_offset_lsb, self.segment_offset_lsb, self.odd_width)
        return any(error is not None for error in given)


@sealed
@dataclass(kw_only=True, unsafe_hash=True)
class Receiver:
    """Receiver of a radar; every effect is a setting, and off by default.

    The signal passes them in this order: phase noise and phases of the receivers, leakage, high-pass, I/Q imbalance,
    noise with the low-pass, gain, offset, ADC. Samples are in sqrt(W), whose square is the power at the antenna (twice
    the mean square of a real receiver); with `gain_db` at the input of the ADC; with `full_scale` they are parts of the
    ADC's full scale, from -1 to 1.

    Parameters
    ----------
    output : "iq" or "real"
        Complex samples, or only their real part as one mixer gives it.
    noise_figure_db : float, optional
        Noise figure [dB] at 290 K; None: no noise.
    phase_noise : sequence of (float, float), optional
        Phase noise of the oscillator: offsets from the carrier [Hz] and single-sideband levels there, at most 0
        [dBc/Hz], straight lines between them over the logarithm of the offset and beyond them; -20 dB per decade for a
        single pair. Range correlation: an echo has the difference to one delay earlier, small for near targets.
    leakage : Leakage, optional
        From the transmitters into the receivers.
    rx_phase_deg : sequence of float, optional
        Phase of every receiver [degrees], of echoes; see `Radar.channel_phases`.
    high_pass, low_pass : float, optional
        Frequencies of the baseband's Butterworth filters at -3 dB [Hz]. They act on echoes by their true beat
        frequency, also beyond the sampled band: the low-pass is the anti-alias filter. Noise passes the low-pass alone.
    high_pass_order, low_pass_order : int
        Orders of the filters; 6 dB per octave each.
    iq_gain_db : float, optional
        Gain of Q over I [dB], of I/Q receivers.
    iq_phase_deg : float, optional
        Phase error of Q [degrees], of I/Q receivers.
    gain_db : float, optional
        From the receiver's input to the ADC's input, both at 50 ohm [dB].
    full_scale : float, optional
        Voltage of a sample of 1 [V]; samples beyond -1 or 1 clip.
    dc_offset : float or sequence of float, optional
        Added to the samples, in their unit; one, or one per receiver.
    adc_bits : int, optional
        Bits of the ADC; codes are spread evenly from -1 to 1, both included.
    adc_errors : AdcErrors, optional
        Errors of an ADC that is not ideal, and noise of its start in every chirp.

    Raises
    ------
    ValueError
        For phase noise above 0 dBc/Hz, a high-pass not below the low-pass, and settings that lack others they need.

    Warns
    -----
    UserWarning
        `Radar`: for a filter beyond half the sample rate. `Simulator`: once each if more than 0.1 % of the samples
        clip, and if the signal uses at most two codes of the ADC; `Frame.stats` has ``clipped_share`` and
        ``used_codes_share``.

    See Also
    --------
    Radar : Takes it as `receiver`.
    Leakage : From the transmitters into the receivers.
    AdcErrors : Errors of the ADC.
    bgt60tr13c : Has a measured one with ``receiver="measured"``.

    Examples
    --------
    >>> receiver = rc.Receiver(noise_figure_db=12.0)
    >>> print(f"{10 * np.log10(receiver.noise_variance(2e6)):.1f} dBW in 2 MHz")
    -129.0 dBW in 2 MHz
    """

    output: str = "iq"
    noise_figure_db: float | None = None
    phase_noise: tuple[tuple[float, float], ...] | None = None
    leakage: Leakage | None = None
    rx_phase_deg: tuple[float, ...] | None = None
    high_pass: float | None = None
    high_pass_order: int = 1
    low_pass: float | None = None
    low_pass_order: int = 4
    iq_gain_db: float | None = None
    iq_phase_deg: float | None = None
    gain_db: float | None = None
    full_scale: float | None = None
    dc_offset: PerReceiver | None = None
    adc_bits: int | None = None
    adc_errors: AdcErrors | None = None

    def __post_init__(self) -> None:
        check.choice("output", self.output, ("iq", "real"))
        _check_given(self, ("noise_figure_db",), check.non_negative, "dB")
        _check_given(self, ("noise_figure_db", "iq_gain_db", "gain_db"), check.level, "dB")
        _check_given(self, ("high_pass", "low_pass"), check.positive, "Hz")
        _check_given(self, ("full_scale",), check.positive, "V")
        _check_given(self, ("iq_phase_deg",), check.number, "degrees")
        _check_given(self, ("dc_offset",), per_receiver, "")
        self.high_pass_order = check.count("high_pass_order", self.high_pass_order, maximum=MAX_ORDER)
        self.low_pass_order = check.count("low_pass_order", self.low_pass_order, maximum=MAX_ORDER)
        if self.adc_bits is not None:
            self.adc_bits = check.count("adc_bits", self.adc_bits, maximum=MAX_BITS)
        if self.phase_noise is not None:
            self.phase_noise = _phase_noise(self.phase_noise)
        if self.rx_phase_deg is not None:
            phases = per_receiver("rx_phase_deg", self.rx_phase_deg, "degrees")
            if not isinstance(phases, tuple):
                raise TypeError(f"rx_phase_deg: expected one number per receiver, got {self.rx_phase_deg!r}")
            check.degrees("rx_phase_deg", phases)
            self.rx_phase_deg = phases
        for name, kind in (("leakage", Leakage), ("adc_errors", AdcErrors)):
            check.instance(name, getattr(self, name), kind, type(None))
        self._check_together()

    def _check_together(self) -> None:
        """Raise an error for settings without their prerequisites."""
        errors = AdcErrors() if self.adc_errors is None else self.adc_errors
        for name, is_given, needed in (
            ("adc_errors.turn_on_db", errors.turn_on_db is not None, "noise_figure_db"),
            ("adc_bits", self.adc_bits is not None, "full_scale"),
            ("adc_errors", errors.are_of_codes, "adc_bits"),
        ):
            if is_given and getattr(self, needed) is None:
                raise ValueError(f"{needed}: expected a value, as {name} is given, got None")
        for name in ("iq_gain_db", "iq_phase_deg"):
            if getattr(self, name) is not None and self.output == "real":
                raise ValueError(f"{name}: expected None for a real receiver, got {getattr(self, name):g}")
        if self.high_pass is not None and self.low_pass is not None and self.high_pass >= self.low_pass:
            raise ValueError(f"high_pass: expected less than low_pass, {self.low_pass:g} Hz, got {self.high_pass:g} Hz")

    def of_receivers(self, indices: Sequence[int]) -> Receiver:
        """Settings of some of the receivers, by their numbers from 0: settings with one number each keep theirs."""

        def chosen(settings: Any) -> Any:
            rows = {name: tuple(values[i] for i in indices) for name, values in _one_each(settings).items()}
            return None if settings is None else replace(settings, **rows)

        receiver: Receiver = chosen(self)
        return replace(receiver, leakage=chosen(self.leakage), adc_errors=chosen(self.adc_errors))

    @property
    def has_codes(self) -> bool:
        """True if samples are codes of 12 bits, as `radarcore.recording.frame` has them."""
        return self.adc_bits == 12 and self.output == "real"

    @property
    def unit(self) -> str | None:
        """``source["cube_unit"]`` of recordings; None for sqrt(W) at the receiver's input, and for codes of 12 bits."""
        if self.full_scale is not None:
            return None if self.has_codes else "parts of full scale"
        return None if self.gain_db is None else "sqrt(W) at the ADC"

    def noise_variance(self, sample_rate: float) -> float:
        """Noise power per sample before the low-pass [W]: ``k T F fs``, half of it for a real receiver."""
        if self.noise_figure_db is None:
            return 0.0
        power = BOLTZMANN * NOISE_TEMPERATURE * power_from_db(self.noise_figure_db) * sample_rate
        return power if self.output == "iq" else 0.5 * power

    def to_dict(self) -> dict[str, Any]:
        """All settings, for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Receiver:
        """The receiver that `to_dict` described."""
        given = dict(values)
        for name, kind in (("leakage", Leakage), ("adc_errors", AdcErrors)):
            if given.get(name) is not None:
                given[name] = kind(**given[name])
        return cls(**given)


def is_plain(receiver: Receiver) -> bool:
    """True if nothing happens but thermal noise and taking the real part."""
    return all(getattr(receiver, name) is None for name in _EFFECTS)


def check_receivers(receiver: Receiver, num_rx: int, waveforms: Sequence[Waveform]) -> None:
    """Refuse settings that do not fit the receivers or ramps, and warn of filters beyond half the sample rate."""
    parts = {"": receiver, "leakage.": receiver.leakage, "adc_errors.": receiver.adc_errors}
    for part, settings in parts.items():
        for name, values in _one_each(settings).items():
            if len(values) != num_rx:
                expected = f"one number, or {num_rx}, one per receiver"
                raise ValueError(f"receiver.{part}{name}: expected {expected}, got {len(values)}")
    if receiver.leakage is not None:
        shortest = min(wf.adc_delay + wf.num_samples / wf.sample_rate for wf in waveforms)
        for name in ("delay", "echo_delay"):
            if (delay := getattr(receiver.leakage, name)) > shortest:
                raise ValueError(f"receiver.leakage.{name}: expected at most the ramp, {shortest:g} s, got {delay:g} s")
    if receiver.high_pass is not None and any(wf.is_cw for wf in waveforms):
        raise ValueError("receiver.high_pass: expected None for a radar without a sweep, whose echoes are at 0 Hz")
    half = 0.5 * waveforms[0].sample_rate
    for name in ("high_pass", "low_pass"):
        if (getattr(receiver, name) or 0.0) > _BAND_MARGIN * half:
            notice.warn(
                f"receiver.{name}: expected at most half the sample rate, {half:g} Hz, got {getattr(receiver, name):g} "
                "Hz: signals above alias"
            )


_DEFAULTS = {field.name: field.default for field in fields(Receiver)}

_EFFECTS = tuple(name for name, default in _DEFAULTS.items() if default is None and name != "noise_figure_db")
"""Settings that do more than add noise and take the real part."""


def _check_given(settings: Any, names: Sequence[str], checked: Callable[[str, object, str], Any], unit: str) -> None:
    """Check the settings that are not None, and replace them by the checked values."""
    for name in names:
        if (value := getattr(settings, name)) is not None:
            setattr(settings, name, checked(name, value, unit))


def _phase_noise(value: Any) -> tuple[tuple[float, float], ...]:
    pairs = check.array("phase_noise", value, (None, 2))
    if len(pairs) == 0:
        raise ValueError("phase_noise: expected at least one pair (offset [Hz], level [dBc/Hz]), got none")
    offsets = pairs[:, 0]
    if offsets[0] <= 0.0 or (offsets[1:] <= offsets[:-1]).any():
        raise ValueError(f"phase_noise: expected positive, increasing offsets [Hz], got {offsets.tolist()}")
    for k, (_, decibels) in enumerate(pairs.tolist()):
        check.non_positive_level(f"phase_noise[{k}][1]", decibels, "dBc/Hz")
    return tuple((offset, decibels) for offset, decibels in pairs.tolist())
