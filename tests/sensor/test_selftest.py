"""Self-test of boards: healthy ones pass, and a fault is named by the check that is about it."""

from __future__ import annotations

import itertools
import re
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest

import radarcore as rc
from doubles.boards import TRANSPORTS, opened, plugged
from doubles.comlib_boards import ALL, NO_ADC, ComLibDouble
from radarcore.sensor import SensorError, open_sensor
from radarcore.sensor.bgt60 import registers as reg
from radarcore.sensor.bgt60.registers import test_pattern as pattern_of
from radarcore.sensor.bgt60.settings import Settings, registers_of
from radarcore.sensor.checks import chirp_noise, reasons_of
from radarcore.sensor.emulator import chip
from radarcore.sensor.emulator.pty import PtyPort
from radarcore.sensor.emulator.strata import Controller, Identity
from radarcore.sensor.interface import RawFrame
from radarcore.sensor.selftest import pace_of
from radarcore.sensor.strata import board as strata_board
from radarcore.sensor.strata.packets import Version
from selftest_boards import Receivers, controller, noise_codes

STRATA = [
    *("USB ids", "board name", "firmware", "protocol", "chip id", "UUID", "temperature", "registers", "test pattern"),
    *("noise, 23 dB, TX off", "noise, 50 dB, TX off", "noise, 55 dB, TX off"),
    *("noise, 23 dB, TX on", "leakage, 23 dB, TX on", "noise, 50 dB, TX on", "frame rate", "frames lost", "slices"),
]


def checks_of(board, groups, transport="cdc", **options):
    """Checks of an emulated board by their names."""
    with opened(board, transport, protocol="strata") as sensor:
        return {check.name: check for check in sensor.selftest(groups, **options)}


def failed(checks):
    return [name for name, check in checks.items() if check.result == "FAIL"]


# Healthy boards


def calm(sensor, duration):
    """Checks of a sensor at its real pace; up to twice more where the host was busy with something else."""
    for _ in range(3):
        checks = list(sensor.selftest(duration=duration))
        if not {check.name for check in checks if check.result == "FAIL"} & {"frame rate", "frames lost", "slices"}:
            break
    return checks


def test_healthy_board_passes_every_check():
    with opened(controller(speed=1.0), protocol="strata") as sensor:
        checks = calm(sensor, 0.8)
        assert [(check.name, check.result) for check in checks] == [(name, "PASS") for name in STRATA]
        assert all(check.measured and check.expected for check in checks)
        # The board is another one now, until it is configured.
        with pytest.raises(SensorError, match="expected configure"):
            next(sensor.frames())
        sensor.configure(rc.bgt60tr13c(num_chirps=8, frame_interval=25e-3))
        assert len(list(sensor.frames(2))) == 2


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_healthy_board_passes_behind_every_transport(transport):
    checks = checks_of(controller(), ("identity", "registers", "pattern", "noise"), transport)
    assert list(checks) == STRATA[:-3]
    assert failed(checks) == []
    assert checks["test pattern"].values["first_words"][:6] == ["001", "800", "400", "200", "100", "880"]
    assert checks["test pattern"].measured == "all of 24576 words, in one run"
    # Noise of the source, and of rounding to codes, which is 1/sqrt(12).
    for gain, deviation in ((23, 1.1), (50, 5.5), (55, 9.8)):
        noise = checks[f"noise, {gain} dB, TX off"].values["noise"]
        assert noise == pytest.approx([np.hypot(deviation, 12**-0.5)] * 3, rel=0.05)  # 5,000 steps of each receiver
    # 63 of 64 samples of a quarter of a cosine: from 1 to 0.025.
    seen = checks["leakage, 23 dB, TX on"].values["leakage"]
    assert seen == pytest.approx(0.975 * np.array([1240.0, 650.0, 360.0]), abs=2.0)


@pytest.mark.parametrize("types", [ALL, NO_ADC])
def test_healthy_board_with_comlib_passes_what_its_protocol_allows(types):
    board = ComLibDouble(noise_codes, clock=time.monotonic, types=types)
    with PtyPort(board) as port, open_sensor(port.path, protocol="comlib") as sensor:
        checks = {check.name: check for check in calm(sensor, 0.5)}
    assert failed(checks) == []
    skipped = [name for name, check in checks.items() if check.result == "SKIP"]
    assert skipped == ["registers", "pattern"]
    assert len(checks["noise"].values["noise"]) == 4


def test_frames_without_time_stamps_have_a_rate_by_the_hosts_clock_alone():
    checks = checks_of(controller(has_timestamps=False), "frames", duration=0.5)
    assert failed(checks) == ["frame rate"], "they come as fast as they are read"
    assert "no time stamps" in checks["frame rate"].measured
    assert "without time stamps" in checks["slices"].measured


# Faults


@pytest.mark.parametrize(
    ("options", "group", "named", "result"),
    [
        ({"identity": Identity(product_id=0x1234)}, "identity", ["USB ids"], "FAIL"),
        ({"identity": Identity(name="")}, "identity", ["board name"], "FAIL"),
        ({"identity": Identity(version=Version(0, 0, 0))}, "identity", ["firmware"], "FAIL"),
        ({"identity": Identity(uuid=bytes(16))}, "identity", ["UUID"], "SKIP"),
        ({"temperature": 120.0}, "identity", ["temperature"], "FAIL"),
        (
            {"receivers": Receivers(dead=1)},
            "noise",
            [*(f"noise, {gain} dB, TX off" for gain in (23, 50, 55)), "leakage, 23 dB, TX on"],
            "FAIL",
        ),
        ({"receivers": Receivers(leaks=False)}, "noise", ["leakage, 23 dB, TX on"], "FAIL"),
        ({"receivers": Receivers(tx_factor=0.5)}, "noise", ["noise, 23 dB, TX on", "noise, 50 dB, TX on"], "FAIL"),
    ],
)
def test_fault_is_named_by_the_checks_that_are_about_it(options, group, named, result):
    checks = checks_of(controller(**options), group)
    assert [name for name, check in checks.items() if check.result != "PASS"] == named
    assert {checks[name].result for name in named} == {result}


@pytest.mark.parametrize(
    ("address", "bit", "result"),
    [
        (reg.PLL1_1, 1 << 23, "FAIL"),  # the slope's sign: one of the two sweeps is rising
        (reg.CSU1_2, 1 << 4, "FAIL"),  # six steps of gain have it, one has not
        (reg.ADC0, 1 << 13, "PASS"),  # reserved
    ],
)
@pytest.mark.parametrize("level", [0, 1])
def test_stuck_bit_of_a_register_is_named(address, bit, level, result):
    board = controller()
    whole = board.chip.read
    set_to = {0: lambda value: value & ~bit, 1: lambda value: value | bit}[level]
    board.chip.read = lambda where: set_to(whole(where)) if where == address else whole(where)
    checks = checks_of(board, "registers")
    assert checks["registers"].result == result
    if result == "FAIL":
        assert checks["registers"].values["wrong_bits"] == {f"0x{address:02X}": f"0x{bit:06X}"}
        assert f"0x{address:02X} is 0x" in checks["registers"].measured


def reversed_bits(codes):
    return np.array([int(f"{code:012b}"[::-1], 2) for code in codes.tolist()], np.uint16)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (reversed_bits, "word 0 is 800 in place of 001, 24[0-9]* of 24576 differ: bits in reverse order"),
        (lambda codes: codes.reshape(-1, 2)[:, ::-1].reshape(-1), "samples of each pair exchanged"),
        (lambda codes: codes ^ np.uint16(4095), "all bits inverted"),
        (lambda codes: np.full_like(codes, 2000), "no pattern, perhaps the receiver's own samples"),
        (lambda codes: np.where(np.arange(len(codes)) == 77, 7, codes).astype(np.uint16), "word 77 is 007 in place of"),
    ],
)
def test_wrong_test_pattern_is_named(change, reason, monkeypatch):
    monkeypatch.setattr(chip, "test_pattern", lambda number, first=0: change(pattern_of(number, first)))
    checks = checks_of(controller(), "pattern")
    assert failed(checks) == ["test pattern"]
    assert re.search(reason, checks["test pattern"].measured)


def test_pattern_that_begins_anew_with_every_frame_passes_and_is_told(monkeypatch):
    monkeypatch.setattr(chip, "test_pattern", lambda number, first=0: pattern_of(number))
    check = checks_of(controller(), "pattern")["test pattern"]
    assert (check.result, check.measured) == ("PASS", "all of 24576 words, begun anew with every frame")


def test_receivers_that_are_full_are_no_failure_of_their_noise():
    """A reflector close by."""

    class Full(Receivers):
        def frame(self, radar, index, time, *, if_gain_db=23.0, **options):
            codes = super().frame(radar, index, time, if_gain_db=if_gain_db, **options)
            if if_gain_db == 50 and self.chip.registers[0x10] & 1:
                codes[..., ::3] = 4095
            return codes

    check = checks_of(controller(Full()), "noise")["noise, 50 dB, TX on"]
    assert check.result == "SKIP"
    assert "34 % of the samples at an end of the ADC" in check.measured  # 22 of 64


def test_clock_that_is_wrong_is_named(monkeypatch):
    """The host's clock advances with every frame only, so a busy machine changes nothing."""
    ticks = itertools.count()
    clock = SimpleNamespace(monotonic=time.monotonic, time=lambda: next(ticks) * interval / 0.95)
    interval = checks_of(controller(), "frames", duration=0.5)["frame rate"].values["wanted"] ** -1
    monkeypatch.setattr(strata_board, "time", clock)
    checks = checks_of(controller(), "frames", duration=0.5)
    assert failed(checks) == ["frame rate"]
    values = checks["frame rate"].values
    assert values["host"] == pytest.approx(0.95 * values["wanted"], rel=1e-9)
    assert values["board"] == pytest.approx(values["wanted"], rel=1e-3), "the board knows nothing of it"


class Dropping(Controller):
    """A board that loses every 25th of its packets on the way."""

    def take_packet(self):
        packet = super().take_packet()
        return super().take_packet() if packet is not None and self.num_sent % 25 == 0 else packet


def test_lost_frames_are_counted():
    checks = checks_of(Dropping(Receivers(), speed=None), "frames", duration=0.8)
    assert checks["frames lost"].result == "FAIL"
    assert checks["frames lost"].values["lost"] == 4, "36 frames of three packets each, and 108 // 25 lost packets"
    assert "lost: expected packet" in checks["frames lost"].measured


def test_reasons_of_losses_are_the_first_of_many():
    reasons = [f"between frames {number} and {number + 2}" for number in (3, 3, 7, 9, 12, 20)]
    losses = [RawFrame(np.zeros((1, 1, 1), np.uint16), 0, 0.0, lost_reasons=(reason,)) for reason in reasons]
    text = reasons_of(losses)
    assert text == "between frames 3 and 5, between frames 7 and 9, between frames 9 and 11 and 2 more"
    assert reasons_of(losses[:3]) == "between frames 3 and 5, between frames 7 and 9"


def test_silent_board_is_named_soon():
    class Failing(Receivers):
        def frame(self, *arguments, **options):
            raise ValueError("no samples")

    checks = checks_of(controller(Failing()), "pattern")
    assert failed(checks) == ["test pattern"]
    assert "0 of 3 frames, which take 0.15 s, came in 2.2 s" in checks["test pattern"].measured


def test_board_that_is_gone_fails_one_check_and_skips_the_rest():
    with plugged(controller(), "cdc") as (where, board), open_sensor(**where) as sensor:
        checks = []
        for check in sensor.selftest():
            checks.append(check)
            if check.name == "temperature":
                board.unplug()
    results = {check.name: check.result for check in checks[7:]}
    assert results == {
        "registers": "FAIL",
        **dict.fromkeys(("test pattern", "noise", "frame rate", "slices"), "SKIP"),
    }


# The chip's test pattern


def test_board_answers_another_thread_between_the_checks():
    with opened(Controller(Receivers())) as sensor:
        is_over = threading.Event()

        def asks():
            while not is_over.is_set():
                assert 20.0 < sensor.temperature() < 30.0
                time.sleep(0.001)

        with ThreadPoolExecutor(1) as others:
            asked = others.submit(asks)
            results = {check.result for _ in range(5) for check in sensor.selftest(["identity"])}
            is_over.set()
            asked.result()
        assert results == {"PASS"}


def test_closing_from_another_thread_ends_a_self_test():
    with opened(Controller(Receivers())) as sensor:
        checks = sensor.selftest()
        next(checks)
        threading.Timer(0.1, sensor.close).start()
        with pytest.raises(SensorError, match="expected an open sensor, got one that is closed"):
            list(checks)


def test_pattern_is_one_sequence_which_every_start_begins_anew():
    words = pattern_of(5000)
    first = "001 800 400 200 100 880 440 220 110 888 444 A22"
    assert " ".join(f"{word:03X}" for word in words[:12]) == first
    assert np.array_equal(words[4095:], words[: 5000 - 4095])
    assert len(set(words[:4095].tolist())) == 4095
    # As in the vendor's example for microcontrollers: the sequence advances with every sample, and only RX1 shows it.
    with opened(controller()) as sensor:
        sensor.configure(rc.bgt60tr13c(num_samples=32, num_chirps=8, frame_interval=25e-3), has_test_pattern=True)
        for _ in range(2):
            raw = np.array([frame.raw for frame in sensor.frames(2)])
            assert np.array_equal(raw[:, 0].reshape(-1), pattern_of(2 * 3 * 256)[::3])
            assert np.ptp(raw[:, 1:]) < 2500


# Statistics of the checks


@pytest.mark.parametrize("shape", [(5, 3, 32, 64), (40, 3, 2, 64), (64, 3, 1, 16)])
def test_noise_is_its_deviation_whatever_stands_still(shape):
    rng = np.random.default_rng(3)
    noise = np.array([1.0, 5.0, 0.0])[:, None, None]
    still = rng.uniform(0.0, 2000.0, shape[-1])
    codes = still + noise * rng.normal(size=shape)
    # 1,000 steps or more, which are correlated by pairs.
    assert chirp_noise(codes) == pytest.approx([1.0, 5.0, 0.0], rel=0.1)


def test_first_chirps_and_samples_are_no_noise():
    codes = np.random.default_rng(4).normal(0.0, 2.0, (5, 1, 32, 64))
    codes[:, :, :8] += 50.0
    codes[:, :, ::2, :16] += 50.0
    assert chirp_noise(codes) == pytest.approx([2.0], rel=0.05)


def test_pace_is_that_of_most_frames():
    numbers = [0, 1, 2, 5, 6, 7, 8, 9]
    times = [0.02 * number for number in numbers]
    assert pace_of(numbers, times) == pytest.approx((0.02, 0.0), abs=1e-12)
    times[2] += 0.5  # one that was late
    assert pace_of(numbers, times)[0] == pytest.approx(0.02, abs=1e-12)
    assert pace_of([3, 5], [1.0, 1.5]) == (0.25, 0.0)


def test_jitter_is_what_one_frame_of_twenty_is_late():
    late = np.where(np.arange(200) % 10 == 0, 4e-3, 0.0)  # one of ten
    assert pace_of(range(200), 0.01 * np.arange(200) + late) == pytest.approx((0.01, 4e-3), rel=1e-9)
    late = np.where(np.arange(200) % 40 == 0, 4e-3, 0.0)  # one of forty
    assert pace_of(range(200), 0.01 * np.arange(200) + late) == pytest.approx((0.01, 0.0), abs=1e-6)


def test_registers_are_compared_but_for_bits_without_a_public_meaning():
    image = registers_of(Settings(), 6144)
    assert reg.stuck_bits(image, image) == {}
    assert reg.stuck_bits(image, image | {reg.PLL1_0: image[reg.PLL1_0] ^ 0x800001}) == {reg.PLL1_0: 0x800001}
    for address, bits in (
        (reg.ADC0, 1 << 13),
        (reg.ADC0, 1 << 12),
        (reg.MAIN, 0xF),
        (reg.RFT1, 0xFFFFFF),
        (reg.SFCTL, 1 << 15),
    ):
        assert reg.stuck_bits(image, image | {address: image[address] ^ bits}) == {}
    assert reg.stuck_bits(image, {}) == {}
    # All that is set is compared, but for two test registers; nothing is set that is not compared.
    assert set(image) - set(reg.COMPARED) == {reg.RFT1, 0x5B}
    assert all(value & ~reg.COMPARED[address] == 0 for address, value in image.items() if address in reg.COMPARED)


def test_resets_are_compared_with_published_values_but_for_states():
    assert reg.unusual_resets(reg.RESET_VALUES) == {}
    changes = {reg.ADC0: 0x0A0240, reg.FSTAT: 0, reg.CHIP_ID: 1, reg.SFCTL: 0x100000, 0x30: 5}
    assert reg.unusual_resets(reg.RESET_VALUES | changes) == {0x30: 5}
