"""The emulated chip and its controller: overflows, answers in time, ramps of all kinds, a constant wave."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import radarcore as rc
from chip_settings import V1, image, legal_settings, triangle
from doubles.boards import Numbered, numbered
from radarcore.radar.radar import Radar
from radarcore.sensor.bgt60 import registers as reg
from radarcore.sensor.bgt60.settings import Settings, achieved, registers_of
from radarcore.sensor.emulator.sequence import sequence_of, tx_power_dbm
from radarcore.sensor.emulator.source import NO_POWER_DBM
from radarcore.sensor.emulator.strata import CdcBoard, Controller
from radarcore.sensor.strata import packets
from radarcore.sensor.strata.packets import Avian, Code, Component, Data, DataPacket, Info, Request, Status
from radarcore.sensor.strata.slices import unpack_msb

CW_MODE = 1 << 16
EXECUTE = (Code.COMPONENT, Component.AVIAN, Avian.EXECUTE)
READ_VERSION = Request.read(Code.BOARD_INFO, Info.VERSION, 0, 16)


class Told:
    """Codes of one number for each kind of ramp, and what was asked for."""

    def __init__(self) -> None:
        self.asked: list[tuple[Radar, int, float, float]] = []

    def frame(self, radar: Radar, index: int, time: float, *, if_gain_db: float = 23.0) -> NDArray[np.uint16]:
        self.asked.append((radar, index, time, if_gain_db))
        wf = radar.waveform
        rising = 1000 if wf.slope > 0.0 else 2000
        codes = rising + 16 * np.arange(wf.num_chirps)[:, None] + np.arange(radar.num_channels)[:, None, None]
        return np.broadcast_to(codes, (radar.num_channels, wf.num_chirps, wf.num_samples)).astype(np.uint16)


def ask(controller: Controller, request: Request) -> bytes:
    response = controller.handle(request)
    assert response.status == 0, f"status {response.status:#x}"
    return response.payload


def execute(controller: Controller, words: list[int]) -> int:
    """Status of words that are sent to the chip."""
    return controller.handle(Request.write(*EXECUTE, packets.encode_commands(words))).status


def read(controller: Controller, address: int) -> int:
    (answer,) = packets.decode_values(
        ask(controller, Request.transfer(*EXECUTE, packets.encode_commands([address << 25])))
    )
    return answer & 0xFFFFFF


def begin(controller: Controller, words: list[int], slice_size: int) -> None:
    """Send what the vendor's host sends to start."""
    configuration = bytes.fromhex("10 00 00 00 00 00 00 00 60 00") + slice_size.to_bytes(2, "little")
    ask(controller, Request.write(Code.DATA, Data.CONFIGURE, 0, configuration))
    ask(controller, Request.write(Code.DATA, Data.START, 0))
    assert execute(controller, words) == 0


def packet(controller: Controller, timeout: float = 5.0) -> DataPacket:
    """The next data packet."""
    deadline = time.monotonic() + timeout
    with controller.arrived:
        while (found := controller.take_packet()) is None:
            assert controller.chip.failure is None, controller.chip.failure
            assert controller.arrived.wait(deadline - time.monotonic()), "no packet"
    return found


# Overflows.


def test_words_are_executed_under_an_overflow_and_the_board_can_be_stopped_and_started_again() -> None:
    """As a host that does not send a refused request twice."""
    controller = Controller(Numbered(), speed=1.0)
    registers = image(V1) | {
        0x2D: 0x62FC0A,
        0x37: 0x393B10,
        reg.CCR2: 7 << 12,
        reg.SFCTL: 0x102000 | (3 * 8 * 64 // 2 - 1),
    }
    size = 3 * 8 * 64
    begin(controller, reg.start_words(registers), size)
    assert packet(controller).error is None
    controller.chip.overflow()
    controller._collect()
    while packet(controller).error != Status.OVERFLOW:
        pass
    ask(controller, Request.write(Code.DATA, Data.STOP, 0))
    stop = [reg.write_word(reg.MAIN, registers[reg.MAIN] | reg.FSM_RESET | reg.FIFO_RESET)]
    assert execute(controller, stop) == 0
    assert not controller.chip.has_overflown
    for _ in range(2):
        begin(controller, reg.start_words(registers), size)
        for number in range(3):
            codes = np.empty(size, np.uint16)
            codes[:] = unpack_msb(packet(controller).payload)
            expected = numbered((3, 8, 64), number).transpose(1, 2, 0).reshape(-1)
            np.testing.assert_array_equal(codes, expected)
        ask(controller, Request.write(Code.DATA, Data.STOP, 0))
        assert execute(controller, stop) == 0
        with controller.arrived:
            while controller.take_packet() is not None:
                pass
    controller.close()


# Answers in time.


@pytest.mark.parametrize("latency", [0.0, 0.03])
def test_answers_of_a_byte_stream_take_their_time(latency: float) -> None:
    controller = Controller(Numbered(), latency=latency)
    board = CdcBoard(controller)
    began = time.monotonic()
    board.receive(packets.encode_request(READ_VERSION))
    assert (board.send(4096, 0.0) == b"") == (latency > 0.0)
    if latency:
        assert len(board.send(4096, 1.0)) > 20
    assert time.monotonic() - began >= latency
    controller.close()


# Ramps.


@pytest.mark.filterwarnings("ignore:receiver.high_pass")  # of the slowest sample rates
@given(wanted=legal_settings())
@settings(deadline=None, max_examples=50)
def test_registers_of_settings_are_the_achieved_radar(wanted: Settings) -> None:
    sequence, back = sequence_of(registers_of(wanted, 2)), achieved(wanted)
    (ramps,) = sequence.ramps
    assert ramps.radar.waveform == back.to_radar().waveform
    high_pass = None if ramps.radar.waveform.is_cw else back.highpass_cutoff  # echoes of 0 Hz
    assert (ramps.if_gain_db, ramps.radar.receiver.high_pass) == (back.if_gain_db, high_pass)
    assert (ramps.radar.tx_power_dbm == NO_POWER_DBM) != wanted.is_transmitting
    assert (sequence.frame_size, sequence.frame_time) == (back.frame_size, back.frame_time)
    assert sequence.num_frames == back.num_frames
    np.testing.assert_allclose(sequence.ends, back.chirp_time * np.arange(1, back.num_chirps + 1), rtol=1e-12)


def test_chip_at_power_up_has_the_default_settings() -> None:
    # The frame ends idle with the timer (195, 11), and unused shapes have a delay but are off.
    power_up = image(V1) | {0x2D: 10 | 1 << 9 | 195 << 11 | 11 << 19, 0x3F: 0x393B00, 0x47: 0x393B00, 0x4F: 0x393B00}
    sequence = sequence_of(power_up)
    default = Settings()
    assert sequence.frame_time == 6181508 / 80e6 == pytest.approx(default.frame_time, rel=1e-7)
    assert sequence.ramps[0].radar.waveform.chirp_interval == pytest.approx(default.chirp_time, rel=1e-7)


def test_other_timing_counts_by_the_samples() -> None:
    def waveform(changes: dict[int, int]) -> rc.Waveform:
        return sequence_of(image(V1) | changes).ramps[0].radar.waveform

    good, normal = image(V1), waveform({})
    # Power on 8 cycles later and the ramp 16 cycles later: the first sample sees 8 cycles less of the ramp.
    later = waveform({0x2F: good[0x2F] + 1, 0x2D: good[0x2D] + 2})
    assert normal.start_frequency - later.start_frequency == pytest.approx(8 * 3208 * 640e6 / 2**20, abs=1e-3)
    assert round((later.chirp_interval - normal.chirp_interval) * 80e6) == 16  # the ramp is the longer path
    # Delays after the rising and the falling ramp: 8 d + 5 instead of 2.
    delayed = waveform({0x32: good[0x32] | 2 << 16, 0x36: 1 << 16})
    assert round((delayed.chirp_interval - normal.chirp_interval) * 80e6) == (21 - 2) + (13 - 2)
    # Fast down ramp by its mode, and none at all, instead of 6.
    for mode, cycles in enumerate((0, 40, 56, 24)):
        ramp = waveform({0x05: 0x080034 | mode << 6})
        assert round((ramp.chirp_interval - normal.chirp_interval) * 80e6) == cycles - 6


@pytest.mark.filterwarnings("ignore::UserWarning")  # of filters at slow sample rates
@given(
    changes=st.dictionaries(st.integers(0, 0x5F), st.integers(0, 0xFFFFFF), max_size=12),
    flips=st.lists(st.tuples(st.sampled_from(sorted(image(V1))), st.integers(0, 23)), max_size=2),
    is_complete=st.booleans(),
)
@settings(deadline=None, max_examples=50)
def test_any_registers_are_frames_or_refused(
    changes: dict[int, int], flips: list[tuple[int, int]], is_complete: bool
) -> None:
    registers = (image(V1) if is_complete else {}) | changes
    for address, bit in flips:
        registers[address] = registers.get(address, 0) ^ 1 << bit
    try:
        sequence = sequence_of(registers)
    except ValueError:
        return
    assert sequence.frame_size >= 1
    assert sequence.frame_time >= sequence.ends[0]


def test_power_of_the_transmitter_is_that_of_the_registers() -> None:
    registers = image(V1)
    levels = [tx_power_dbm(level) for level in range(32)]
    np.testing.assert_allclose([levels[0], levels[31]], [-11.0, 4.0])
    assert (np.diff(levels) > 0.0).all()
    (weak,) = sequence_of(registers | {reg.CSU1_1: registers[reg.CSU1_1] & ~0x1F | 10}).ramps
    assert weak.radar.tx_power_dbm == levels[10]
    (off,) = sequence_of(registers | {reg.CSU1_0: registers[reg.CSU1_0] & ~1}).ramps
    assert off.radar.tx_power_dbm == NO_POWER_DBM


def test_falling_ramps_of_a_shape_are_sampled_after_its_rising_ones() -> None:
    registers = triangle(4, 32)
    sequence = sequence_of(registers)
    rising, falling = (ramps.radar.waveform for ramps in sequence.ramps)
    assert (rising.num_samples, falling.num_samples) == (64, 32)
    assert falling.slope == -rising.slope
    assert rising.num_chirps == falling.num_chirps == 4
    # Both ramps wait for the PLL: 90 cycles, the ramp, 117 at its end, and 2 more.
    chirp = (90 + 8 * registers[reg.PLL1_2] + 117 + 2) / 80e6
    np.testing.assert_allclose(falling.chirp_times - rising.chirp_times, chirp, rtol=1e-9)
    # The ramp back starts where the first one ends, and its samples as late in it.
    top = rising.start_frequency + rising.slope * (8 * registers[reg.PLL1_2] / 80e6 - 150 / 80e6)
    assert falling.start_frequency - falling.slope * 150 / 80e6 == pytest.approx(top, rel=1e-12)
    assert sequence.frame_size == 4 * 96

    source = Told()
    controller = Controller(source, speed=None)
    begin(controller, reg.start_words(registers), 4 * 96)
    for frame in range(2):
        codes = unpack_msb(packet(controller).payload).reshape(4, 96)
        for pair in range(4):
            np.testing.assert_array_equal(codes[pair, :64], 1000 + 16 * pair)
            np.testing.assert_array_equal(codes[pair, 64:], 2000 + 16 * pair)
        assert [index for _, index, *_ in source.asked[2 * frame :][:2]] == [frame, frame]
    controller.close()


def test_shapes_take_turns_and_repeat() -> None:
    """Two shapes, the second twice at once and with two receivers; five groups, so that the first comes three times."""
    registers = image(V1)
    second = {address + 8: registers[address] for address in range(reg.PLL1_0, reg.PLL1_7 + 1)}
    second |= {reg.PLL1_3 + 8: 16, reg.PLL1_7 + 8: registers[reg.PLL1_7] | 1}
    second |= {0x17: registers[reg.CSU1_0], 0x18: registers[reg.CSU1_1] & 0x0FFFFF | 0b101 << 20, 0x19: registers[0x12]}
    registers |= second | {reg.CSU1_1: registers[reg.CSU1_1] & 0x0FFFFF | 0b010 << 20, reg.CCR2: 4 << 12}
    sequence = sequence_of(registers)
    one, two = sequence.ramps
    assert (one.radar.num_channels, one.radar.waveform.num_chirps, one.radar.waveform.num_samples) == (1, 3, 64)
    assert (two.radar.num_channels, two.radar.waveform.num_chirps, two.radar.waveform.num_samples) == (2, 4, 16)
    np.testing.assert_array_equal(sequence.order, [0, 1, 1, 0, 1, 1, 0])
    assert sequence.frame_size == 3 * 64 + 4 * 2 * 16
    stream = sequence.stream([Told().frame(ramps.radar, 0, 0.0) for ramps in sequence.ramps])
    assert len(stream) == sequence.frame_size
    np.testing.assert_array_equal(stream[64:68], [1000, 1001, 1000, 1001])
    assert (np.diff(sequence.ends) > 0.0).all()
    assert sequence.frame_time > sequence.ends[-1]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({reg.PLL1_7: 0}, "shape 1 to be on"),
        ({0x12: 1 << 24}, "expected 24 bits"),
        ({0x12: -1}, "expected 24 bits"),
        ({0x60: 0}, "expected 24 bits"),
        ({reg.PLL1_3: 0}, "samples of a receiver"),
        ({reg.CSU1_1: 0x0FF41F}, "samples of a receiver"),
        ({0x01: 0x000210}, "ADC_DIV of at least 20"),
        ({0x05: 0x0805B5}, "DIVSET of 20"),
        ({reg.PLL1_7: 0x39391F, reg.CCR2: 0xFFF000}, "frames of fewer samples"),
    ],
)
def test_registers_without_samples_say_so(changes: dict[int, int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        sequence_of(image(V1) | changes)


# Constant wave.


def test_constant_wave_goes_from_state_to_state_with_every_trigger_and_samples_in_the_last() -> None:
    source = Told()
    controller = Controller(source, speed=None)
    registers = image(V1) | {reg.PLL1_1: 0, reg.CSU1_1: 0x5FF41F, reg.PLL1_3: 128}
    begin(controller, reg.start_words(registers)[:-1], 256)
    trigger = [reg.write_word(reg.MAIN, registers[reg.MAIN] | CW_MODE | reg.FRAME_START)]
    modes = [read(controller, reg.STAT0) >> 5 & 7]
    for _ in range(3):
        execute(controller, trigger)
        modes.append(read(controller, reg.STAT0) >> 5 & 7)
    assert modes == [5, 3, 2, 1], "deep sleep, idle, between chirps, active"
    for number in range(2):
        execute(controller, trigger)
        codes = unpack_msb(packet(controller).payload)
        assert len(codes) == 2 * 128
        radar, index, _, gain = source.asked[-1]
        assert (radar.waveform.slope, radar.waveform.num_chirps, index, gain) == (0.0, 1, number, 23)
        assert read(controller, reg.STAT0) >> 5 & 7 == 2
        execute(controller, trigger)
    assert read(controller, reg.MAIN) & CW_MODE
    execute(controller, [reg.write_word(reg.MAIN, registers[reg.MAIN] | reg.FSM_RESET)])
    assert read(controller, reg.STAT0) >> 5 & 7 == 5
    controller.close()
