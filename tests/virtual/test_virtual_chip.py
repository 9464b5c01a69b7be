"""A simulated scene behind the registers of the chip: transmitter, receivers, gains, ramps that fall."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc
from chip_settings import V1, image, power_up, triangle
from doubles.boards import opened
from radarcore.sensor.bgt60.registers import CSU1_2, PLL1_1
from radarcore.sensor.bgt60.settings import Settings, registers_of
from radarcore.sensor.emulator.sequence import constant_wave_of, sequence_of
from radarcore.sensor.emulator.strata import Controller
from radarcore.virtual.source import Simulated

POINT = rc.Scene([rc.PointTarget([0.5, 0.0, 0.0], rcs=0.1)])


def source(scene: rc.Scene, radar: rc.Radar | None = None, **options: Any) -> Simulated:
    return Simulated(rc.Simulator(scene, rc.bgt60tr13c() if radar is None else radar, resolution=8), **options)


def measured(simulated: Simulated, registers: dict[int, int], num_frames: int = 1) -> list[NDArray[np.float64]]:
    """Codes (frame, rx, chirp, sample) of every kind of ramp."""
    sequence = sequence_of(registers)
    frames = [
        [
            simulated.frame(ramps.radar, index, index * sequence.frame_time, if_gain_db=ramps.if_gain_db)
            for ramps in sequence.ramps
        ]
        for index in range(num_frames)
    ]
    return [np.array(kind, np.float64) for kind in zip(*frames, strict=True)]


def wide(**changes: Any) -> dict[int, int]:
    """Registers of 58 to 63.5 GHz, 64 samples, eight chirps."""
    return registers_of(Settings(num_chirps=8, chirp_time=591.125e-6, **changes), 3072)


@pytest.mark.parametrize(("gain_db", "recorded"), [(23, 1.1), (50, 5.5), (55, 9.8)])
def test_noise_of_a_board_follows_its_gain_as_that_of_real_ones(gain_db: int, recorded: float) -> None:
    """Change from chirp to chirp, by its root of two, of each receiver; at 23 dB without the offsets of the chirps."""
    with opened(Controller(source(rc.Scene()), speed=None)) as sensor:
        sensor.configure(rc.bgt60tr13c(num_chirps=32), if_gain_db=gain_db)
        raw = np.array([frame.raw for frame in sensor.frames(4)], np.float64)
    change = np.diff(raw, axis=2) / np.sqrt(2.0)
    if gain_db == 23:
        change -= change.mean(axis=-1, keepdims=True)
    np.testing.assert_allclose(change.std(axis=(0, 2, 3)), recorded, rtol=0.1)


def test_board_leaks_as_a_recorded_one() -> None:
    """The range profile of the mean chirp, see tests/receive/test_measured_receiver.py, through driver and board."""
    with opened(Controller(source(rc.Scene()), speed=None)) as sensor:
        sensor.configure(power_up(num_chirps=8))
        mean = np.array([frame.raw for frame in sensor.frames(20)], np.float64).mean(axis=(0, 2))
    np.testing.assert_allclose(mean.mean(axis=1), [1581.0, 1967.0, 2064.0], atol=8.0)
    spectrum = 20.0 * np.log10(abs(np.fft.rfft(mean - mean.mean(axis=1, keepdims=True)))[:, 1:10])
    recorded = [
        [83.8, 72.7, 70.2, 65.6, 63.1, 61.0, 59.2, 57.7, 56.5],
        [76.0, 68.1, 67.7, 62.0, 60.1, 57.5, 55.8, 54.4, 52.9],
    ]
    np.testing.assert_allclose(spectrum[:2], recorded, atol=2.0)


@pytest.mark.filterwarnings("ignore:receiver.full_scale")  # it clips, as the chip does
def test_transmitter_that_is_off_neither_echoes_nor_leaks() -> None:
    registers = wide(if_gain_db=33, is_transmitting=False)
    registers[0x11] |= 31  # the level does not matter
    (off,) = measured(source(POINT), registers, 8)
    (empty,) = measured(source(rc.Scene()), registers, 8)
    np.testing.assert_array_equal(off, empty)
    # Residual of 8 x 8 chirps of noise of 1.5 codes.
    mean = off.mean(axis=(0, 2))
    assert np.ptp(mean, axis=1).max() < 1.5
    change = np.diff(off, axis=2).std() / np.sqrt(2.0)
    assert 1.0 < change < 2.0, "noise and offsets of the receivers"
    (on,) = measured(source(POINT), wide(if_gain_db=33), 8)
    assert np.ptp(on.mean(axis=(0, 2)), axis=1).min() > 400.0


def test_level_of_the_transmitter_scales_echoes_and_leakage() -> None:
    """Level 0 is 15 dB below 31, half of the levels half of that in dB."""
    simulated = source(POINT)
    ramps = {
        level: measured(simulated, wide(tx_power_level=level), 4)[0].mean(axis=(0, 2)) for level in (0, 15, 16, 31)
    }
    (off,) = measured(simulated, wide(is_transmitting=False), 4)
    swings = {level: ramp - off.mean(axis=(0, 2)) for level, ramp in ramps.items()}
    decibels = {level: 10.0 * np.log10((swing**2).mean() / (swings[31] ** 2).mean()) for level, swing in swings.items()}
    assert decibels[0] == pytest.approx(-15.0, abs=0.02)
    assert decibels[16] == pytest.approx(-15.0 * 15 / 31, abs=0.02)
    assert decibels[15] < decibels[16]


@pytest.mark.filterwarnings("ignore:receiver.full_scale")  # it clips, as the chip does
def test_receivers_gain_and_high_pass_are_those_of_the_registers() -> None:
    simulated = source(POINT)
    settings = Settings(num_chirps=8, chirp_time=591.125e-6, rx_mask=0b110, if_gain_db=40, highpass_cutoff=20e3)
    (codes,) = measured(simulated, registers_of(settings, 1024))
    assert codes.shape == (1, 2, 8, 64)
    radar = power_up(receiver="measured", if_gain_db=40, high_pass=20e3, num_chirps=8)
    chain = radar.receiver
    assert chain is not None
    (ramps,) = sequence_of(registers_of(settings, 1024)).ramps
    expected = rc.Radar(
        ramps.radar.waveform,
        tx=radar.tx,
        rx=radar.rx[1:],
        pattern=radar.pattern,
        tx_power_dbm=4.0,
        receiver=replace(chain, phase_noise=None).of_receivers([1, 2]),
    )
    (high,) = measured(simulated, registers_of(settings, 1024) | {CSU1_2: image(V1)[CSU1_2]})
    frame = rc.Simulator(POINT, expected, resolution=8).frame()
    np.testing.assert_array_equal(codes[0], frame.raw)
    assert (high != codes).any()


def test_scene_with_a_receiver_of_its_own_keeps_it() -> None:
    """Effects that it does not have are left out: leakage and offsets of a receiver with a high-pass alone."""
    receiver = rc.Receiver(output="real", noise_figure_db=12.0, high_pass=80e3)
    plain = rc.bgt60tr13c()
    own = rc.Radar(plain.waveform, tx=plain.tx, rx=plain.rx, pattern=plain.pattern, receiver=receiver)
    registers = wide()
    (quiet,) = measured(source(rc.Scene(), own), registers)
    assert np.ptp(quiet) < 6.0
    assert quiet.mean() == pytest.approx(2047.5, abs=1.0)
    (ideal,) = measured(source(rc.Scene(), receiver="ideal"), registers)
    assert np.ptp(ideal) <= 3.0, "noise of the data sheet is below a code"
    (leaky,) = measured(source(rc.Scene()), registers)
    assert np.ptp(leaky) > 1000.0
    with pytest.raises(ValueError, match="receiver: expected"):
        source(rc.Scene(), receiver="real")


@pytest.mark.filterwarnings("ignore:.*beyond max_velocity")
def test_falling_ramps_are_simulated_as_falling_chirps() -> None:
    """A target that recedes has its beat lowered or raised by its Doppler shift: where the peaks differ by two."""
    registers = triangle(8, 64)
    for velocity in (0.0, 50.0):
        scene = rc.Scene([rc.PointTarget([0.5, 0.0, 0.0], rcs=0.1, velocity=[velocity, 0.0, 0.0])])
        rising, falling = measured(source(scene, receiver="ideal"), registers)
        assert rising.shape == falling.shape == (1, 1, 8, 64)
        beats = []
        for codes in (rising, falling):
            spectrum = abs(np.fft.rfft((codes[0, 0, 0] - 2047.5) * np.hanning(64), 4096))
            beats.append(spectrum.argmax() * 2e6 / 4096)
        # 2 v / wavelength at 60.9 GHz: added if the chirp rises, subtracted if it falls.
        doppler = 2.0 * velocity * 60.9e9 / 299792458.0
        assert np.mean(beats) == pytest.approx(2.0 * 0.5 / 299792458.0 * 156.6e12, rel=0.03)
        assert beats[0] - beats[1] == pytest.approx(2.0 * doppler, abs=2e3 + 0.1 * doppler)


def test_constant_wave_has_no_echo_of_what_stands_still() -> None:
    registers = image(V1) | {PLL1_1: 0}
    (ramps,) = constant_wave_of(registers).ramps
    codes = source(POINT).frame(ramps.radar, 0, 0.0, if_gain_db=23)
    assert codes.shape == (3, 1, 64)
    settled = codes[:, 0, 24:].astype(float)
    assert np.ptp(settled, axis=1).max() < 12.0


def test_frames_of_other_settings_are_simulated_anew() -> None:
    """Frames simulated ahead belong to a radar, a number and a time."""
    simulated = source(POINT, receiver="ideal")
    (a,), (b,) = (measured(simulated, wide(if_gain_db=gain), 3) for gain in (30, 50))
    (c,) = measured(source(POINT, receiver="ideal"), wide(if_gain_db=50), 3)
    np.testing.assert_array_equal(b, c)
    assert np.abs(a - 2047.5).max() < np.abs(b - 2047.5).max()
