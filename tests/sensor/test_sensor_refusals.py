"""Invalid arguments and bytes for boards, chip, protocols and ports: the expected and the given value."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from chip_settings import power_up
from doubles.boards import Numbered, opened
from doubles.comlib_boards import board_of, radar
from radarcore.sensor.bgt60.registers import start_words, temperature_code, temperature_of, write_word
from radarcore.sensor.bgt60.settings import Settings, registers_of
from radarcore.sensor.comlib.messages import Format
from radarcore.sensor.emulator.strata import Controller
from radarcore.sensor.errors import ProtocolError
from radarcore.sensor.strata import packets
from radarcore.sensor.strata.packets import DataPacket
from radarcore.sensor.transport.capture import Replay
from radarcore.sensor.transport.serialport import SerialStream

Row = tuple[Callable[[], object], str]


def of_antennas(**antennas: Any) -> Settings:
    return Settings.from_radar(rc.Radar(power_up().waveform, **antennas))


def of_waveform(**changes: Any) -> Settings:
    return Settings.from_radar(power_up(**changes))


def of_changed(**changes: Any) -> Settings:
    return Settings.from_radar(replace(power_up(), **changes))


def comlib(wanted: rc.Radar | None = None, **options: Any) -> rc.Radar:
    return board_of().configure(radar() if wanted is None else wanted, **options)


def data(text: str) -> DataPacket:
    return packets.decode_data(bytes.fromhex(text))


SETTINGS: list[Row] = [
    (lambda: registers_of(Settings(), 77), "slice_size: expected an even number, got 77; the nearest are 76, 78"),
    (lambda: registers_of(Settings(), 16386), "slice_size: expected 2 to 16384, got 16386; the nearest is 16384"),
    (lambda: Settings(chirp_time=float("nan")), "chirp_time: expected"),
    (lambda: of_antennas(rx=[[0.0, 0.0, 1.2e-4]]), "rx: expected three antennas, or some of"),
    (
        lambda: of_antennas(rx=[[0.0, 0.0, 0.0], [0.0, 2.5e-3, 0.0]]),
        "rx: expected three antennas",
    ),  # in the wrong order
    (lambda: of_antennas(rx=[[0.0, 0.0, 0.0]] * 4), "rx: expected three antennas, or some of"),
    (lambda: of_antennas(tx=1e-3 * np.eye(2, 3)), "tx: expected one antenna, got 2"),
    (lambda: of_waveform(num_chirps=3, chirp_times=[0.0, 1e-3, 3e-3]), "chirp_times: expected evenly spaced chirps"),
    (lambda: of_waveform(num_chirps=2, chirp_times=[1e-3, 2e-3]), "chirp_times: .* from 0 s on, got 0.001 s"),
    (lambda: of_waveform(chirp_interval=36e-6), "chirp_interval: expected at least 39.7125 us for 64 samples at 2 MHz"),
    (lambda: of_waveform(frame_interval=30e-3), "frame_interval: expected at least 37.2805875 ms for 64 chirps"),
    (lambda: of_waveform(start_frequency=57e9), r"start_frequency \(3.1125 us before the first sample\): .*got 57 GHz"),
    (lambda: of_waveform(stop_frequency=64e9), r"slope \(the ramp's end, one sample after the last\): .*got 64 GHz"),
    (lambda: of_changed(schedule=rc.Schedule.tdm()), "schedule: .*, got 'tdm'"),
    (lambda: of_changed(waveform=power_up().waveform.alternating()), "waveform: expected one, got 2 sub-sequences"),
    (lambda: start_words({1: 0x0A0210}), "registers: expected MAIN"),
    (lambda: write_word(0x80, 0), "address, value: expected 7 and 24 bits"),
    (lambda: temperature_of(1024), "code: expected"),
    (lambda: temperature_code(float("nan")), "temperature: expected a finite number"),
]
COMLIB: list[Row] = [
    (lambda: comlib(radar(num_tx=2)), "tx: expected one antenna, got 2"),
    (lambda: comlib(radar(5)), "rx: expected at most 4 antennas.*got 5"),
    (lambda: comlib(rx_mask=0b111), "rx_mask: expected 4 receivers, as in rx, got 3"),
    (lambda: comlib(rx_mask=0x1F), "rx_mask: expected at most 0xf, got 0x1f"),
    (lambda: comlib(tx_power=32), "tx_power: expected 0 to 31, got 32"),
    (lambda: comlib(radar(start_frequency=77e9)), r"start_frequency: expected 5\.6e\+10 to 6\.4e\+10 Hz"),
    (lambda: comlib(radar(start_frequency=64e9)), "start_frequency: expected room for a ramp"),
    (lambda: Format(-1, 0, 0).encode(), "ComLib frame format: .*-1"),
]
PORTS: list[Row] = [
    (lambda: SerialStream(""), "path: expected the path of a serial port"),
    (lambda: SerialStream("a\0b"), "path: expected the path of a serial port"),
    (lambda: Controller(Numbered(), latency=-1.0), "latency: expected .*, got -1"),
]


@pytest.mark.parametrize(("call", "message"), [*SETTINGS, *COMLIB, *PORTS])
def test_arguments_that_do_not_fit_are_value_errors(call: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: packets.Version.decode(bytes(15)), "expected .*got 15"),
        (lambda: packets.decode_board_info(bytes(3)), "expected .*got 3"),
        (lambda: packets.uuid_text(bytes(17)), "expected .*got 17"),
        (lambda: packets.decode_values(bytes(5)), "expected .*got 5"),
        (lambda: packets.decode_commands(bytes(5)), "expected .*got 5"),
        (lambda: data(""), "Strata data packet: expected"),
        (lambda: data("d3 00 00 00 01 00"), "Strata data packet: expected"),
        (lambda: data("d3 00 00 00 00 00 00"), "Strata data packet: expected"),
        (lambda: data("40 00 00 00 00 00"), "Strata data packet: expected"),
        (lambda: data("d7 00 00 00 04 00 01 02 03 04"), "Strata data packet: expected"),  # no room for its time stamp
    ],
)
def test_bytes_of_another_size_are_errors_of_the_protocol(call: Callable[[], object], message: str) -> None:
    with pytest.raises(ProtocolError, match=message):
        call()


def test_other_types_are_named() -> None:
    with pytest.raises(TypeError, match=r"^num_samples: expected"):
        Settings(num_samples=True)
    with pytest.raises(TypeError, match=r"^is_transmitting: expected"):
        Settings(is_transmitting=1)  # type: ignore[arg-type]  # on purpose
    with pytest.raises(TypeError, match=r"^radar: expected Radar, got Settings"):
        Settings.from_radar(Settings())  # type: ignore[arg-type]  # on purpose


def test_missing_capture_is_not_found(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        Replay(tmp_path / "none")


def test_groups_of_a_selftest_are_checked_at_once() -> None:
    with opened(Controller(Numbered())) as sensor:
        with pytest.raises(ValueError, match="groups: expected one of"):
            sensor.selftest(("registers", "magic"))
        with pytest.raises(ValueError, match="duration: expected a positive number"):
            sensor.selftest(duration=0.0)
