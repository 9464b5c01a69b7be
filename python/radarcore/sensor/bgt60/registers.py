"""Registers of the chip BGT60TR13C: words that set them, and values read from it."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from radarcore import check
from radarcore.recording.frame import NUM_CODES

FIFO_SIZE = 16384
"""Samples that the chip's memory holds."""

# Addresses.
MAIN, ADC0, CHIP_ID, STAT1, PACR1, PACR2, SFCTL, SADC_CTRL = range(0x08)
CSI_0, CSI_1, CSI_2, CSCI, CSDS_0, CSDS_1, CSDS_2, CSCDS, CSU1_0, CSU1_1, CSU1_2 = range(0x08, 0x13)
CSC1, CSC2, CSC3, CSC4 = 0x16, 0x1D, 0x24, 0x2B
CCR0, CCR1, CCR2, CCR3 = range(0x2C, 0x30)
PLL1_0, PLL1_1, PLL1_2, PLL1_3, PLL1_4, PLL1_5, PLL1_6, PLL1_7 = range(0x30, 0x38)
PLL2_7, PLL3_7, PLL4_7 = 0x3F, 0x47, 0x4F
RFT0, RFT1, DFT0, SDFT0 = 0x55, 0x56, 0x57, 0x5B
STAT0, SADC_RESULT, FSTAT = 0x5D, 0x5E, 0x5F
FIFO = 0x60
"""Address from which a burst reads samples; not a register."""

LFSR_EN = 1 << 17
"""Bit of SFCTL: the samples of RX1 are replaced by the chip's test pattern."""

# Bits of MAIN that act once and read as zero.
FRAME_START, SW_RESET, FSM_RESET, FIFO_RESET = 1 << 0, 1 << 1, 1 << 2, 1 << 3

RESET_VALUES: dict[int, int] = dict.fromkeys(range(FIFO), 0) | {
    MAIN: 0x1E0000,
    ADC0: 0x0A2240,
    CHIP_ID: 0x000303,
    PACR1: 0x196524,
    PACR2: 0x040014,
    SFCTL: 0x710000,
    **dict.fromkeys((CSCI, CSCDS, CSC1, CSC2, CSC3, CSC4), 0x000B60),
    RFT0: 0x001F40,
    RFT1: 0x060000,
    DFT0: 0x000200,
    STAT0: 0x0000A8,
    FSTAT: 0x100000,
}
"""Registers after a reset."""

CHIP_NAMES: dict[tuple[int, int], str] = {
    (3, 3): "BGT60TR13C",
    (5, 4): "BGT60ATR24C",
    (5, 5): "BGT24LTR24",
    (6, 6): "BGT60UTR13DAIP",
    (6, 11): "BGT60UTR13DAIP",
    (7, 7): "BGT60UTR11AIP",
    (7, 9): "BGT60UTR11AIP",
    (7, 12): "BGT60UTR11AIP",
    (8, 8): "BGT60TR12E",
    (8, 10): "BGT120UTR13E",
    (8, 12): "BGT60UTR11AIP",
    (9, 15): "BGT60ATR24EAIP",
    (9, 16): "BGT24LTR13E",
    (10, 13): "BGT120UTR24",
    (10, 14): "BGT120UTR24",
}
"""Chips by (digital id, RF id)."""
PLL_RANGE = 1 << 23  # frequencies are signed, 24 bits


def start_words(registers: Mapping[int, int]) -> list[int]:
    """SPI words that set the registers and start: ascending, MAIN last with FRAME_START."""
    if MAIN not in registers:
        raise ValueError("registers: expected MAIN among them, got none at 0x00")
    others = sorted(address for address in registers if address != MAIN)
    words = [write_word(address, registers[address]) for address in others]
    return [*words, write_word(MAIN, registers[MAIN] | FRAME_START)]


def write_word(address: int, value: int) -> int:
    """SPI word that sets a register."""
    if not (0 <= address < 0x80 and 0 <= value <= 0xFFFFFF):
        raise ValueError(f"address, value: expected 7 and 24 bits, got {address} and {value}")
    return address << 25 | 1 << 24 | value


def chip_name(chip_id: int) -> str:
    """Name of the chip whose register CHIP_ID has this value."""
    digital, rf = chip_id >> 8 & 0xFF, chip_id & 0xFF
    return CHIP_NAMES.get((digital, rf), f"unknown chip 0x{chip_id:06X}")


def temperature_of(code: int) -> float:
    """Temperature [degrees Celsius] that the sensor's 10-bit code stands for."""
    value = check.count("code", code, 0)
    if value > 1023:
        raise ValueError(f"code: expected 0 to 1023, got {value}")
    return (value * 1.21 / 1023.0 - 0.78984) / 0.00286


def temperature_code(temperature: float) -> int:
    """Code of the chip's sensor at a temperature [degrees Celsius], from 0 to 1023."""
    code = (check.number("temperature", temperature, "degrees Celsius") * 0.00286 + 0.78984) * 1023.0 / 1.21
    return round(min(max(code, 0.0), 1023.0))


def image_of(registers: Mapping[int, int]) -> dict[int, int]:
    """All registers, those not given as after a reset."""
    for address, value in registers.items():
        if operator.index(address) not in RESET_VALUES or not 0 <= operator.index(value) <= 0xFFFFFF:
            raise ValueError(f"registers: expected 24 bits at 0x00 to 0x5F, got {value} at {address}")
    return RESET_VALUES | dict(registers)


def signed(value: int) -> int:
    """A field of 24 bits with its sign."""
    return value - 2 * PLL_RANGE if value >= PLL_RANGE else value


_BLOCKS, _POWERS, _BASEBAND = 0x13FC73, 0x7FF41F, 0x707FFF
"""Fields of a channel set with one TX and three RX: blocks that are on; powers and ADC; filters and gains."""

COMPARED: dict[int, int] = {
    MAIN: 0xFFFFF0,  # the lowest four bits act, and read as zero
    ADC0: 0xFFCFFF,  # bit 12 triggers, bit 13 is reserved and differs from chip to chip
    PACR1: 0xFFFFFF,
    PACR2: 0x0FFFFF,
    SFCTL: 0xF73FFF,
    SADC_CTRL: 0x01FF0F,  # bit 4 starts
    **dict.fromkeys((CSI_0, CSDS_0, CSU1_0), _BLOCKS),
    **dict.fromkeys((CSI_1, CSDS_1, CSU1_1), _POWERS),
    **dict.fromkeys((CSI_2, CSDS_2, CSU1_2), _BASEBAND),
    **dict.fromkeys((CSCI, CSCDS), 0x000FE0),
    **dict.fromkeys((CSC1, CSC2, CSC3, CSC4), 0x000FFF),
    **dict.fromkeys((CCR0, CCR1, CCR2, CCR3), 0xFFFFFF),
    **dict.fromkeys((PLL1_0, PLL1_1, PLL1_3, PLL1_4, PLL1_5), 0xFFFFFF),
    **dict.fromkeys((PLL1_2, PLL1_6), 0xFF3FFF),
    **dict.fromkeys((PLL1_7, PLL2_7, PLL3_7, PLL4_7), 0xFFFF1F),
}
"""Bits with a public meaning that read back as they were written, by register; test registers have none."""

_STATES = (STAT1, STAT0, SADC_RESULT, FSTAT)
"""Registers whose values change by themselves."""


def stuck_bits(written: Mapping[int, int], read: Mapping[int, int]) -> dict[int, int]:
    """Bits that do not read back as they were written, by register; `CHIP_ID` and bits without a meaning left out."""
    wrong = {
        address: (value ^ read[address]) & COMPARED[address]
        for address, value in written.items()
        if address in COMPARED and address in read
    }
    return {address: bits for address, bits in wrong.items() if bits}


def unusual_resets(read: Mapping[int, int]) -> dict[int, int]:
    """Registers with another value after a reset than is published.

    State registers, CHIP_ID, and SFCTL, which is needed for reading, are excluded.
    """
    usual = {address: value for address, value in RESET_VALUES.items() if address not in (*_STATES, CHIP_ID, SFCTL)}
    return {
        address: value
        for address, value in read.items()
        if address in usual and (value ^ usual[address]) & COMPARED.get(address, 0xFFFFFF)
    }


def test_pattern(num_samples: int, first: int = 0) -> NDArray[np.uint16]:  # noqa: PT028  # not a test
    """Codes that the chip sends in place of its samples when its test pattern is on (SFCTL.LFSR_EN).

    Parameters
    ----------
    num_samples : int
        Number of codes.
    first : int
        Number of the first of them; code 0 is 0x001.

    Returns
    -------
    codes : (num_samples,) uint16
        Repeats after 4095.
    """
    begin = check.count("first", first, 0) % len(_period())
    return np.resize(_period(), begin + check.count("num_samples", num_samples, 0))[begin:]


test_pattern.__test__ = False  # type: ignore[attr-defined]  # or pytest takes it for a test where it is imported


@cache
def _period() -> NDArray[np.uint16]:
    """Period of the test pattern, (4095,)."""
    codes = np.empty(NUM_CODES - 1, np.uint16)
    state = 1
    for i in range(len(codes)):
        codes[i] = state
        feedback = (state ^ state >> 1 ^ state >> 2 ^ state >> 8) & 1
        state = state >> 1 | feedback << 11
    return codes
