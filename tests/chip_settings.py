"""Settings of the BGT60TR13C: published ones with their registers, and any that the chip can have."""

from __future__ import annotations

from typing import Any

from hypothesis import assume
from hypothesis import strategies as st

from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.radar.radar import Radar
from radarcore.sensor.bgt60.registers import (
    CCR2,
    CSU1_0,
    CSU1_1,
    PLL1_0,
    PLL1_1,
    PLL1_2,
    PLL1_3,
    PLL1_4,
    PLL1_5,
    PLL1_6,
    SFCTL,
)
from radarcore.sensor.bgt60.settings import Settings

CLOCK = 80e6  # [Hz]

# Published lists: register=value, hex.
V1 = """
00=1E8270 01=0A0210 04=E967FD 05=0805B4 06=102BFF 07=010D00 08=000000 09=000000 0A=000000 0B=000BE0 0C=000000 0D=000000
0E=000000 0F=000B60 10=13FC51 11=7FF41F 12=701CE7 16=000490 1D=000480 24=000480 2B=000480 2C=11BE0E 2D=62FC0A 2E=03F000
2F=787E1E 30=A2A850 31=000C88 32=000172 33=000040 34=000000 35=000000 36=000000 37=393B10 3F=000100 47=000100 4F=000100
56=000000 5B=000000
"""
V2_CHANGES = """
06=1021FF 07=010300 10=103C51 11=1FF41F 2D=4D2C0A 2E=01F000 30=85C082 31=003DDD 32=00005A 33=000008 37=08A910
"""
V3_CHANGES = """
01=088210 06=1027FF 07=010700 10=130C51 11=4FF41F 12=006F7B 2D=3EF40A 2E=00F000 30=F5208A 31=0000A4 32=000252 33=000080
37=093910
"""
V1_SETTINGS = Settings(chirp_time=591.1249900e-6, frame_time=77.26884633e-3)
V2_SETTINGS = Settings(num_samples=8, num_chirps=32, rx_mask=1, chirp_time=15.9625e-6, frame_time=10.0053e-3)
V3_SETTINGS = Settings(
    start_frequency=61.020099e9,
    end_frequency=61.479903e9,
    sample_rate=2.352941e6,
    num_samples=128,
    num_chirps=16,
    rx_mask=4,
    if_gain_db=60,
    chirp_time=70e-6,
    frame_time=5e-3,
)


def power_up(**changes: Any) -> Radar:
    """The radar that the chip is at power-up, with some other keywords of `bgt60tr13c`."""
    settings = {"start_frequency": 58e9, "stop_frequency": 63.5e9, "num_samples": 64}
    times = {"chirp_interval": 591.125e-6, "frame_interval": 77.26885e-3}
    if "chirp_times" in changes:
        del times["chirp_interval"]
    return bgt60tr13c(**(settings | times | changes))


def image(text: str) -> dict[int, int]:
    """Values by register, from a list of them."""
    return {int(a, 16): int(v, 16) for a, v in (pair.split("=") for pair in text.split())}


@st.composite
def legal_settings(draw: st.DrawFn) -> Settings:
    """Settings within all limits of the chip."""
    rate = draw(st.integers(78201, 4_000_000))
    divider = (160_000_000 // rate + 1) // 2
    samples = draw(st.integers(1, min(4095, (131064 - 399) // divider)))
    chirps = draw(st.integers(1, 4096))
    chirp = (8 * -(-(samples * divider + 399) // 8) + 217) / CLOCK
    delay = draw(st.one_of(st.just(0.0), st.floats(-8.0, 0.0).map(lambda x: 10.0**x)))
    rest = draw(st.floats(-7.0, 4.0).map(lambda x: 10.0**x))
    # The timer after a chirp may take 6 cycles or 0.4 % longer than wanted.
    frame = chirps * (chirp + delay * 1.004 + 8 / CLOCK) + rest
    frequency = st.floats(58e9, 63.5e9)
    start, end = draw(frequency), draw(frequency)
    # Ramps of fewer cycles than these begin beyond the PLL's range, 1.3 GHz from the band.
    length = samples * divider + 249
    assume(150 * abs(end - start) / length < 1.6e9)
    return Settings(
        start_frequency=start,
        end_frequency=end,
        sample_rate=rate,
        num_samples=samples,
        num_chirps=chirps,
        chirp_time=chirp + delay,
        frame_time=frame,
        rx_mask=draw(st.integers(1, 7)),
        tx_power_level=draw(st.integers(0, 31)),
        is_transmitting=draw(st.booleans()),
        if_gain_db=draw(st.integers(18, 60)),
        highpass_cutoff=draw(st.floats(0.0, 1e6)),
        num_frames=draw(st.integers(0, 4094)),
        has_test_pattern=draw(st.booleans()),
    )


def triangle(num_pairs: int, num_falling: int) -> dict[int, int]:
    """Registers of one receiver and of pairs of ramps: 64 samples rising, and others falling from where those end."""
    registers = image(V1)
    start, step, ramp_time = (registers[address] for address in (PLL1_0, PLL1_1, PLL1_2))
    one_receiver = registers[CSU1_1] & 0x0FFFFF | 1 << 20
    return registers | {
        CSU1_1: one_receiver,
        0x13: registers[CSU1_0],
        0x14: one_receiver,
        0x15: registers[0x12],
        PLL1_3: 64 | num_falling << 12,
        PLL1_4: (start + step * 8 * ramp_time) & 0xFFFFFF,
        PLL1_5: -step & 0xFFFFFF,
        PLL1_6: ramp_time,
        CCR2: num_pairs - 1 << 12,
        SFCTL: registers[SFCTL] & ~0x1FFF | (num_pairs * (64 + num_falling) // 2 - 1),
    }
