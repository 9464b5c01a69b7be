"""Registers read back: what a chip must still hold of what was written."""

from __future__ import annotations

from collections.abc import Mapping

from radarcore.sensor.bgt60.registers import (
    ADC0,
    CCR0,
    CCR1,
    CCR2,
    CCR3,
    CHIP_ID,
    CSC1,
    CSC2,
    CSC3,
    CSC4,
    CSCDS,
    CSCI,
    CSDS_0,
    CSDS_1,
    CSDS_2,
    CSI_0,
    CSI_1,
    CSI_2,
    CSU1_0,
    CSU1_1,
    CSU1_2,
    FSTAT,
    MAIN,
    PACR1,
    PACR2,
    PLL1_0,
    PLL1_1,
    PLL1_2,
    PLL1_3,
    PLL1_4,
    PLL1_5,
    PLL1_6,
    PLL1_7,
    PLL2_7,
    PLL3_7,
    PLL4_7,
    RESET_VALUES,
    SADC_CTRL,
    SADC_RESULT,
    SFCTL,
    STAT0,
    STAT1,
)

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

    Left out are those of states, `CHIP_ID`, and SFCTL, without which they could not be read.
    """
    usual = {address: value for address, value in RESET_VALUES.items() if address not in (*_STATES, CHIP_ID, SFCTL)}
    return {
        address: value
        for address, value in read.items()
        if address in usual and (value ^ usual[address]) & COMPARED.get(address, 0xFFFFFF)
    }
