"""Configurations of TI's radars: the settings of a chip, and the radar and the order of samples that they make.

Files are settings of mmWave Studio, see `studio`, or commands of the SDK's demo, see `commands`. Both name the
fields of TI's mmWaveLink: frequencies in GHz, slopes in MHz/us, times in us, rates in kHz.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore import check, notice
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.schedule import Schedule
from radarcore.radar.waveform import Waveform
from radarcore.recording.ti.boards import Board, board_of
from radarcore.recording.ti.capture import Capture

_OUTPUTS = ("real", "complex 1x", "complex 2x")
"""Formats of samples by the number that TI gives them: real, I/Q, and I/Q with the band of the images."""

_BITS = (12, 14, 16)
"""Bits of a sample by the number that TI gives them."""

NUM_RX, _NUM_TX = 4, 4
"""Most receivers and transmitters of a chip."""

_NUM_CHIRPS = 512
"""Chirps that a chip has at most, from 0 on."""

_ROW = "row with half-wavelength spacing"
"""Antennas of other boards."""


class Profile(NamedTuple):
    """Profile of chirps in the units of TI: GHz, MHz/us, us, and kHz of samples.

    Times are those before the ramp, and from its start to the first sample and to its end.
    """

    start: float
    slope: float
    idle: float
    adc_start: float
    ramp_end: float
    num_samples: float
    rate: float


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of a chip for a capture.

    Parameters
    ----------
    profile : Profile
    tx_masks : tuple of int
        Transmitters of every chirp of a loop, bit 0 the first one.
    num_loops : int
        Loops of a frame.
    frame_interval : float
        [s].
    rx_mask : int
        Receivers, bit 0 the first one.
    output, bits : int
        Format and bits of samples by TI's numbers: places in ``("real", "complex 1x", "complex 2x")`` and
        ``(12, 14, 16)``.
    num_lanes : int
        LVDS lanes; 0: the order of samples in captures is not public.
    has_q_first : bool
    is_interleaved : bool
        Receivers sample by sample, not one after the other.
    is_rdif : bool
        Samples from the data interface of low-power chips, see `capture`.
    device : str
        Name of the chip or of its family: ``"xWR18xx"``, ``"awr1843"``; nothing if the files do not say.
    range_bias : float
        To subtract from all ranges [m].
    coefficients : (transmitter, receiver) complex array, optional
        Factors of every channel of the chip, used or not: `Radar.channel_weights`. With inverted feeds of the board,
        except where all are 1.
    board : Board, optional
        Antennas that the files have, with signs besides `coefficients`; else those of `device`.
    round_interval : float, optional
        Time between rounds of all transmitters [s], if they do not follow each other directly.
    mount : dict, optional
        Arguments of `Pose.from_rpy` for the pose of the radar over the floor.
    """

    profile: Profile
    tx_masks: tuple[int, ...]
    num_loops: int
    frame_interval: float
    rx_mask: int
    output: int
    bits: int
    num_lanes: int
    has_q_first: bool
    is_interleaved: bool
    is_rdif: bool = False
    device: str = ""
    range_bias: float = 0.0
    coefficients: NDArray[np.complex128] | None = None
    board: Board | None = None
    round_interval: float | None = None
    mount: dict[str, list[float]] | None = None


def radar_and_capture(settings: Settings, where: str) -> tuple[Radar, Capture | None]:
    """The radar of some settings, and the order of its samples in a capture, if that is public.

    Warns where several transmitters send and the board, which places them, is not known.
    """
    profile, receivers = settings.profile, _bits(settings.rx_mask, NUM_RX, "receivers", where)
    if not (0 <= settings.bits < len(_BITS) and 0 <= settings.output < len(_OUTPUTS)):
        got = f"{settings.bits} and {settings.output}"
        raise ValueError(f"{where}: expected bits and format of samples (adcCfg) of 0 to 2, got {got}")
    is_real = settings.output == 0
    _check_lanes(settings, len(receivers), where)
    numbers, repetitions = _tx_order(settings.tx_masks, where)
    used = sorted(numbers)
    turns = tuple(used.index(number) for number in numbers)
    ramp_interval = 1e-6 * (profile.idle + profile.ramp_end)
    with check.located(where):
        waveform = Waveform(
            start_frequency=1e9 * profile.start,
            slope=1e12 * profile.slope,
            sample_rate=1e3 * profile.rate,
            num_samples=int(profile.num_samples),
            num_chirps=settings.num_loops * repetitions,
            chirp_interval=settings.round_interval or ramp_interval * len(turns),
            frame_interval=settings.frame_interval,
            adc_delay=1e-6 * profile.adc_start,
        )
        board = settings.board or board_of(settings.device)
        tx, rx, antennas = _antennas(board, used, receivers, waveform.wavelength)
        radar = Radar(
            waveform,
            tx=tx,
            rx=rx,
            receiver=Receiver(output="real") if is_real else None,
            schedule=Schedule.tdm(ramp_interval, turns) if len(turns) > 1 else None,
            channel_weights=_channel_weights(settings, board if antennas != _ROW else None, used, receivers, where),
        )
    if antennas == _ROW and len(used) > 1:
        notice.warn(
            f"{where}: unknown board; its {len(used)} transmitters are assumed to be a row with channels at half "
            "wavelengths, so angles may be wrong"
        )
    if settings.num_lanes == 0:
        return radar, None
    facts = {
        "device": settings.device or "unknown",
        "lanes": settings.num_lanes,
        "output": _OUTPUTS[settings.output],
        "transmitters": [number + 1 for number in used],
        "receivers": [number + 1 for number in receivers],
        "antennas": antennas,
        **({} if settings.mount is None else {"mount": settings.mount}),
    }
    range_bias = 0.0 if is_real else settings.range_bias
    if range_bias:
        facts["range_bias"] = range_bias
    elif settings.range_bias:
        notice.warn(f"{where}: real samples have no phase, so the range bias of {settings.range_bias:g} m is left out")
    capture = Capture(
        num_lanes=settings.num_lanes,
        is_real=is_real,
        is_rdif=settings.is_rdif,
        has_q_first=settings.has_q_first and not is_real,
        bits=_BITS[settings.bits],
        turns=turns,
        facts=facts,
        range_bias=range_bias,
    )
    return radar, capture


def _channel_weights(
    settings: Settings, board: Board | None, used: list[int], receivers: list[int], where: str
) -> NDArray[np.complex128] | None:
    """Factors of the channels in use; None if they change nothing."""
    channels = np.ix_(used, receivers)
    factors = np.ones((len(used), len(receivers)), np.complex128)
    if settings.coefficients is not None:
        if max(used) >= len(settings.coefficients):
            raise ValueError(
                f"{where}: expected compRangeBiasAndRxChanPhase with pairs for TX1 to TX{max(used) + 1}, got pairs "
                f"for {len(settings.coefficients)} transmitters"
            )
        factors = settings.coefficients[channels]
    if not factors.all():
        raise ValueError(f"{where}: expected compRangeBiasAndRxChanPhase without zeros, got one for a channel in use")
    # Compensations that were measured, or written by TI's tools, have the feeds in them.
    if board is not None and (board is settings.board or (factors == 1.0).all()):
        factors = factors * board.signs[channels]
    return None if (factors == factors[0, 0]).all() and factors[0, 0] in (1.0, -1.0) else factors.ravel()


def _check_lanes(settings: Settings, num_rx: int, where: str) -> None:
    """Refuse orders of samples that the documents do not have."""
    if num_rx == 0:
        raise ValueError(f"{where}: expected at least one receiver, got the mask {settings.rx_mask:#x}")
    if settings.num_lanes == 0:
        return
    if settings.num_lanes not in (2, 4):
        raise ValueError(f"{where}: expected two or four LVDS lanes, got {settings.num_lanes}")
    if settings.is_interleaved != (settings.num_lanes == 4):
        expected = "interleaved receivers" if settings.num_lanes == 4 else "receivers one after the other"
        raise ValueError(f"{where}: expected {expected} on {settings.num_lanes} LVDS lanes, got the other order")
    if settings.num_lanes == 4 and num_rx != NUM_RX and not settings.is_rdif:
        raise ValueError(f"{where}: expected all four receivers on four LVDS lanes, got the mask {settings.rx_mask:#x}")
    if settings.is_rdif and settings.profile.num_samples % 4:
        raise ValueError(f"{where}: expected a multiple of four samples, got {settings.profile.num_samples:g}")
    if settings.num_lanes == 2 and settings.output != 0 and settings.profile.num_samples % 2:
        raise ValueError(f"{where}: expected an even number of I/Q samples, got {settings.profile.num_samples:g}")


def _tx_order(masks: tuple[int, ...], where: str) -> tuple[list[int], int]:
    """Transmitters, from 0, in the order of their turns, and the number of rounds in a loop."""
    numbers = []
    for index, mask in enumerate(masks):
        on = _bits(mask, _NUM_TX, f"transmitters of chirp {index}", where)
        if len(on) != 1:
            raise ValueError(
                f"{where}: expected one transmitter per chirp (TDM), got the mask {mask:#x} of chirp {index} "
                "(several at once, in binary phases or as a beam, are not separable)"
            )
        numbers.append(on[0])
    num_tx = len(set(numbers))
    repetitions = len(numbers) // num_tx
    if numbers != numbers[:num_tx] * repetitions:
        names = ", ".join(f"TX{number + 1}" for number in numbers)
        raise ValueError(f"{where}: expected transmitters that take turns, each once in a round, got {names}")
    return numbers[:num_tx], repetitions


def _antennas(
    board: Board | None, used: list[int], receivers: list[int], wavelength: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], str]:
    """Positions of transmitters and receivers [m], and whose they are."""
    if board is not None and max(used) < len(board.tx) and max(receivers) < len(board.rx):
        tx, rx = board.positions(wavelength)
        return tx[used], rx[receivers], board.name
    # Channels in a line, without gaps if receivers have none.
    half = 0.5 * wavelength
    rx = np.array([[0.0, half * number, 0.0] for number in receivers])
    tx = np.array([[0.0, half * (receivers[-1] + 1) * place, 0.0] for place in range(len(used))])
    return tx, rx, _ROW


def _bits(mask: int, most: int, what: str, where: str) -> list[int]:
    """Numbers of the bits of a mask, from 0."""
    if not 0 <= mask < 1 << most:
        raise ValueError(f"{where}: expected a mask of up to {most} {what}, got {mask:#x}")
    return [number for number in range(most) if mask >> number & 1]


def chirps_of_frame(
    entries: Iterable[tuple[str, int, int, int, int]], first: int, last: int, listed: str, where: str
) -> tuple[tuple[int, ...], int]:
    """Masks of the transmitters of the chirps of a loop, and the number of their profile.

    Entries have a deviation from the profile (nothing for none), first and last index, profile and mask. `listed` is
    the name of their list in the files.
    """
    chirps: dict[int, tuple[str, int, int]] = {}
    for change, start, stop, profile, mask in entries:
        chirps |= dict.fromkeys(_indices(start, stop, where), (change, profile, mask))
    used = _indices(first, last, where)
    if missing := [index for index in used if index not in chirps]:
        raise ValueError(f"{where}: expected chirp {missing[0]}, which the frame has, in {listed}, got none")
    if changed := [index for index in used if chirps[index][0]]:
        got = f"{chirps[changed[0]][0]} of chirp {changed[0]}"
        raise ValueError(f"{where}: expected chirps as their profile has them, got {got}")
    if len(numbers := sorted({chirps[index][1] for index in used})) != 1:
        raise ValueError(f"{where}: expected chirps of one profile, got those of {numbers or 'none'}")
    return tuple(chirps[index][2] for index in used), numbers[0]


def _indices(first: int, last: int, where: str) -> range:
    """Indices of chirps, both included."""
    if first < 0 or last >= _NUM_CHIRPS:
        raise ValueError(f"{where}: expected chirps 0 to {_NUM_CHIRPS - 1}, got {first} to {last}")
    return range(first, last + 1)
