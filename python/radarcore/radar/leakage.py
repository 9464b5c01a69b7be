"""Leakage from the transmitter into the receivers of the same radar."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from radarcore import check
from radarcore.radar.levels import non_positive_level

PerReceiver = float | tuple[float, ...]
"""One number for all receivers, or one of each."""

PER_RECEIVER = ("level_db", "phase_deg", "echo_db", "echo_phase_deg", "step_db", "step_phase_deg")
"""Fields of `Leakage` that may have one number per receiver."""


@dataclass(frozen=True, kw_only=True)
class Leakage:
    """Leakage from a transmitter to the receivers: tones of very low frequency, and what turning on leaves.

    All are the same in every chirp. Levels, at most 0 dB, and phases are numbers, or sequences with one per receiver.
    Delays are at most the duration of the ramp.

    Parameters
    ----------
    level_db : float or sequence of float, optional
        Power at the receiver's input over that of one transmitter [dB]. None: no tone.
    delay : float
        Delay [s]; the high-pass sees the beat frequency ``slope * delay``.
    phase_deg : float or sequence of float
        Phase on top of that of the delay [degrees].
    echo_db : float or sequence of float, optional
        Power of a second tone, which comes off a cover, a housing or the board, as `level_db` [dB]. None: no such tone.
    echo_delay : float
        Its delay [s].
    echo_phase_deg : float or sequence of float
        Its phase on top of that of the delay [degrees].
    step_db : float or sequence of float, optional
        What is left, at the first sample, of the step as the transmitter turns on, behind the high-pass; over the power
        of one transmitter [dB]. None: no step.
    step_phase_deg : float or sequence of float
        Its phase [degrees]: 180 for a real receiver that starts below its mean.
    step_time : float
        Time in which the step falls to 1/e [s].

    See Also
    --------
    Receiver : Takes it as `leakage`.
    bgt60tr13c : Has that of a real chip with ``receiver="measured"``.

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
        put = object.__setattr__
        for name in ("level_db", "echo_db", "step_db"):
            if (value := getattr(self, name)) is not None:
                put(self, name, per_receiver(name, value, "dB", one=non_positive_level))
        for name in ("delay", "echo_delay"):
            put(self, name, check.non_negative(name, getattr(self, name), "s"))
        for name in ("phase_deg", "echo_phase_deg", "step_phase_deg"):
            put(self, name, per_receiver(name, getattr(self, name), "degrees"))
        put(self, "step_time", check.positive("step_time", self.step_time, "s"))

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


def check_per_receiver(name: str, value: PerReceiver | None, num_rx: int) -> None:
    """Refuse another number of numbers than of receivers."""
    if isinstance(value, tuple) and len(value) != num_rx:
        raise ValueError(f"{name}: expected one number, or {num_rx}, one per receiver, got {len(value)}")
