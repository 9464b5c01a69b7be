"""A BGT60TR13C on a board that speaks Strata: life cycle, and radar frames out of slices."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any, TypeVar

import numpy as np

from radarcore.radar.radar import Radar
from radarcore.sensor.bgt60.registers import (
    CHIP_ID,
    FIFO_RESET,
    FSM_RESET,
    MAIN,
    SADC_RESULT,
    SFCTL,
    STAT0,
    chip_name,
    start_words,
    temperature_of,
    write_word,
)
from radarcore.sensor.bgt60.settings import Settings, achieved, choose_slice_size, registers_of
from radarcore.sensor.errors import ProtocolError, RequestError, SensorError, SensorTimeoutError, answering
from radarcore.sensor.interface import BoardInfo, Damage, RawFrame
from radarcore.sensor.strata import packets
from radarcore.sensor.strata.packets import Avian, Code, Component, Data, Info, Request, Status, Version
from radarcore.sensor.strata.slices import Slice, SliceAssembler, SliceLost, StreamError, unpack_msb
from radarcore.sensor.strata.stream import DAMAGED, REQUEST_TIMEOUT, RETRIES, DamageCount, Link

_Decoded = TypeVar("_Decoded")

_SFCTL_AT_PROBE = 0x100000
"""Normal timing of MISO with two wait cycles, needed to read registers."""

_TEMPERATURE_AGE = 0.1
"""Interval between temperature requests [s]: the duration of a measurement."""

_SADC_TRIES = 1000
# Idle mode, with clock and supply for the temperature sensor; then the sensor on; then measure.
_SADC_POWER = (0x19000000, 0x1F000BE0, 0x11000000, 0x13001000, 0x17000F80, 0x09800000, 0x011F8271, 0x0D000000)
_SADC_ENABLE = (0x17000D80,)
_SADC_START = (0x0F010F10,)

_JITTER = 1000
"""Time stamps of interrupts are not nearer to the truth [us]."""

_MOST_STARTS = 3
"""Tries of a start whose answers are lost."""

_HALT_TIMEOUT = 0.5
"""Time-out of the stop between two of them [s]: a silent board has been waited for once."""

_FAREWELL = 0.2
"""Time-out of the stop of a board that has sent nothing for longer than any takes [s]."""

_MOST_RESTARTS = 10
"""Restarts without a frame in between before giving up."""


class StrataBoard:
    """Host's side of a board with a BGT60TR13C; a `Board`.

    Slices are whole frames, or whole parts of one (`choose_slice_size`). Where packets are missing, the frames they
    belong to are reported as lost: by time stamps, or else by the counters of packets. Then, and after an error of the
    board, a frame of several slices cannot be assembled safely: the measurement restarts.

    Raises
    ------
    SensorError
        When there is no board that speaks Strata 4, or none with this chip.
    """

    options: tuple[str, ...] = (
        "tx_power_level",
        "if_gain_db",
        "highpass_cutoff",
        "is_transmitting",
        "has_test_pattern",
    )

    def __init__(self, link: Link, *, timeout: float = 1.0) -> None:
        self._link = link
        self._settings: Settings | None = None
        self._slice_size = 0
        self._assembler: SliceAssembler | None = None
        self._is_running = False
        self._damage = DamageCount()  # since the last frame
        self._lost_reasons: list[str] = []  # likewise
        self._temperature: tuple[float, float] = (-np.inf, np.nan)
        self.info: BoardInfo = self._open(timeout)

    def _open(self, timeout: float) -> BoardInfo:
        """Ask whether a board speaks Strata there, and for its identity."""
        asked = Request.read(Code.BOARD_INFO, Info.VERSION, 0, 16)
        try:
            answer = self._link.ask(asked, timeout)
        except RequestError as error:
            with answering("strata"):
                if error.status != Status.REQUEST_TYPE_INVALID:
                    raise
                # Protocol 3 has other types of requests (Strata, version negotiation).
                raise self._other_protocol("3 or older", "update the board's firmware") from error
        version = self._decoded(Version.decode, answer)
        with answering("strata"):
            return self._identify(version)

    def _other_protocol(self, got: str, advice: str) -> ProtocolError:
        return ProtocolError(f"{self._link.name}: expected protocol 4 of Strata, got {got}; {advice}")

    def _identify(self, version: Version) -> BoardInfo:
        """Stop a running measurement, reset the chip and ask what it is."""
        if version.protocol_major != 4:
            advice = "update the board's firmware" if version.protocol_major < 4 else "update radarcore"
            raise self._other_protocol(f"{version.protocol_major}.{version.protocol_minor}", advice)
        self._stop_data()
        count = self._try(Request.read(Code.COMPONENT, Component.COUNT, Component.AVIAN, 1)) or b"\0"
        if count[0] == 0:
            raise SensorError(f"{self._link.name}: expected a board with a radar of the BGT60 family, got none")
        uuid = self._try(Request.read(Code.BOARD_INFO, Info.UUID, 0, 16)) or bytes(16)
        name = self._try(Request.transfer(Code.BOARD_INFO, Info.NAME, 0)) or bytes(4)

        self._pins_reset()
        self._execute([write_word(SFCTL, _SFCTL_AT_PROBE)])
        self._link.discard()
        chip = chip_name(self._read_register(CHIP_ID))
        if chip != "BGT60TR13C":
            raise SensorError(f"{self._link.name}: expected a BGT60TR13C, got {chip}, whose registers are others")
        return BoardInfo(
            port=self._link.name,
            protocol="strata",
            name=self._decoded(packets.decode_board_info, name)[2] or "Strata board",
            chip=chip,
            firmware=version.firmware,
            serial_number=self._decoded(packets.uuid_text, uuid) if any(uuid) else "",
        )

    def configure(self, radar: Radar, **options: Any) -> Radar:
        """Settings for the next start; options as in `Settings.from_radar`."""
        settings = Settings.from_radar(radar, **options)
        slice_size = choose_slice_size(settings)
        registers_of(settings, slice_size)  # refuses what the chip cannot do
        self.stop()
        self._settings = achieved(settings)
        self._requested, self._slice_size = settings, slice_size
        return self._settings.to_radar()

    def start(self) -> None:
        """Tell the board how to read, then set all registers and begin."""
        if self._settings is None:
            raise SensorError(f"{self._link.name}: expected configure(radar) before measuring")
        self.stop()
        self._index = 0
        self._num_restarts = 0
        self._damage = DamageCount()
        self._lost_reasons = []
        self._begin()

    def _begin(self) -> None:
        """Start; where an answer is lost, the board may measure all the same: stop it, and start anew."""
        for tries_left in reversed(range(_MOST_STARTS)):
            try:
                self._start()
                return
            except SensorTimeoutError:
                if tries_left == 0:
                    raise
            except RequestError as error:
                # The request was damaged on its way, or executed in spite of a reported overflow.
                if tries_left == 0 or error.status not in (*DAMAGED, Status.UNEXPECTED_VALUE):
                    raise
            self._halt(_HALT_TIMEOUT)

    def _start(self) -> None:
        """Start once."""
        image = registers_of(self._requested, self._slice_size)
        # A FIFO that has overflown before would end the data at once.
        self._execute([write_word(MAIN, image[MAIN] | _RESETS)])
        self._is_running = True
        self._link.ask(Request.write(Code.DATA, Data.CONFIGURE, 0, packets.data_configuration(self._slice_size)))
        self._link.ask(Request.write(Code.DATA, Data.START, 0), retries=0)
        while self._link.packets(0.0):
            pass  # of an earlier measurement: this one has not begun
        self._link.ask(Request.write(*_EXECUTE, packets.encode_commands(start_words(image))), retries=0)
        self._assembler = SliceAssembler(self._slice_size * 3 // 2)
        self._parts: list[Slice] = []
        self._expected: int | None = None  # counter of the next slice's first packet
        self._last: Slice | None = None
        self._missing = ""  # why packets are missing since the last slice
        self._arrived = time.monotonic()

    def read(self, timeout: float) -> list[RawFrame]:
        """Frames since the last call."""
        found: list[RawFrame] = []
        assembler = self._assembler
        if assembler is None:
            raise SensorError(f"{self._link.name}: expected start() before frames are read")
        for packet in self._link.packets(timeout):
            if isinstance(packet, Damage):
                self._damage.add(packet)
                self._missing = self._missing or packet.reason
                continue
            for item in assembler.feed(packet):
                if isinstance(item, SliceLost):
                    self._damage.num_lost += item.num_packets
                    self._missing = self._missing or item.reason
                elif isinstance(item, StreamError):
                    code = item.error
                    text = code if isinstance(code, str) else packets.status_text(code)
                    self._restart(f"the board stopped: {text}")
                    return found
                elif len(item.data) != self._slice_size * 3 // 2:
                    self._missing = self._missing or f"a slice of {len(item.data)} bytes"
                else:
                    found += self._frames(item)
                    if self._assembler is not assembler:  # started anew
                        return found
        return found

    def _frames(self, item: Slice) -> list[RawFrame]:
        """Frames that are whole with a slice."""
        settings = self._running
        num_samples = self._samples_per_frame
        gap = 0 if self._expected is None else (item.first_counter - self._expected) % 65536
        if item == self._last:
            return []  # sent twice
        if self._slice_size < num_samples and not self._is_in_step(item, gap, num_samples // self._slice_size):
            self._restart(self._missing or "packets are missing")
            return []
        if gap > 0 or (self._missing and self._expected is None):
            frames_per_slice = self._slice_size // num_samples
            lost = self._num_lost(item, gap) * frames_per_slice
            if lost > 0:
                self._lose(lost, self._missing or "packets are missing")
        self._missing = ""
        self._expected = (item.first_counter + item.num_packets) % 65536
        self._last = item
        self._arrived = time.monotonic()

        self._parts.append(item)
        if len(self._parts) * self._slice_size < num_samples:
            return []
        samples = np.concatenate([unpack_msb(part.data) for part in self._parts])
        self._parts = []
        self._damage = DamageCount()
        self._num_restarts = 0
        shape = (settings.num_chirps, settings.num_samples, settings.rx_mask.bit_count())
        number = len(samples) // num_samples
        found = []
        now = time.time()
        for first, frame in enumerate(samples.reshape(number, *shape)):
            # The time stamp belongs to the end of the slice.
            left = (number - 1 - first) * settings.frame_time + settings.num_chirps * settings.chirp_time
            stamp = None if item.timestamp is None else 1e-6 * item.timestamp - left
            cube = np.ascontiguousarray(frame.transpose(2, 0, 1))
            found.append(RawFrame(cube, self._index, now, stamp, tuple(self._lost_reasons)))
            self._index += 1
            self._lost_reasons = []
        return found

    def _num_lost(self, item: Slice, gap: int) -> int:
        """Slices of whole frames between the last slice and this one; `gap` is what the counter is ahead."""
        if self._last is None:
            return 1  # how many came before only the board knows
        if (elapsed := _elapsed(self._last, item)) is not None:
            frames_per_slice = self._slice_size // self._samples_per_frame
            interval = 1e6 * self._running.frame_time * frames_per_slice
            return max(round(elapsed / interval) - 1, 0)
        # A counter that goes back says nothing.
        return max(gap // item.num_packets, 1) if gap < 0x8000 else 1

    def _is_in_step(self, item: Slice, gap: int, slices_per_frame: int) -> bool:
        """True when a slice is known to be the next part of a frame."""
        if gap > 0 or (self._missing and self._expected is None):
            return False
        if self._last is None or (elapsed := _elapsed(self._last, item)) is None:
            return True
        # Chirps pause between frames, which tells where a frame begins.
        active = self._running.num_chirps * self._running.chirp_time
        within, between = (
            1e6 * active / slices_per_frame,
            1e6 * (self._running.frame_time - active * (1.0 - 1.0 / slices_per_frame)),
        )
        is_first = len(self._parts) == 0
        nearest_is_between = abs(elapsed - between) < abs(elapsed - within)
        return nearest_is_between == is_first or abs(between - within) < _JITTER

    def _lose(self, num_frames: int, reason: str) -> None:
        """Count lost frames."""
        self._index += num_frames
        if reason not in self._lost_reasons:
            self._lost_reasons.append(reason)

    def _restart(self, reason: str) -> None:
        """Begin anew; the frames that would have been measured meanwhile are lost."""
        self._num_restarts += 1
        if self._num_restarts > _MOST_RESTARTS:
            raise SensorError(f"{self._link.name}: {reason}, again after {_MOST_RESTARTS} restarts")
        began = self._arrived
        self.stop()
        self._begin()
        lost = max(1, round((time.monotonic() - began) / self._running.frame_time))
        self._lose(lost, f"{reason}; measuring was started anew")

    def stop(self, *, is_silent: bool = False) -> None:
        """Stop the data, then the chip, and discard packets still on their way."""
        if self._is_running and is_silent:
            self._halt(_FAREWELL, retries=0)
        elif self._is_running:
            self._halt()

    def _halt(self, timeout: float = REQUEST_TIMEOUT, *, retries: int = RETRIES) -> None:
        self._stop_data(timeout, retries=retries)
        image = registers_of(self._requested, self._slice_size)
        self._execute([write_word(MAIN, image[MAIN] | _RESETS)])
        self._is_running = False  # and not before: an interrupted caller above stops again
        self._link.discard()

    def damage(self) -> str:
        """Reasons of losses since the last frame, and damage of the data; empty for none."""
        return "; ".join(filter(None, [*self._lost_reasons, self._damage.text(self._link.num_held)]))

    def details(self) -> dict[str, Any]:
        """Settings of the chip, under the names that Infineon's recordings have for them."""
        settings = self._running
        return {
            "infineon": {
                "aaf_cutoff_Hz": 500000,
                "hp_cutoff_Hz": round(settings.highpass_cutoff),
                "if_gain_dB": settings.if_gain_db,
                "rx_antennas": [index + 1 for index in settings.rx_indices],
                "tx_power_level": settings.tx_power_level,
                "firmware_version": self.info.firmware,
                "uuid": str(int(self.info.serial_number.replace("-", "") or "0", 16)),
            }
        }

    def identity(self) -> dict[str, Any]:
        """Facts reported by the board; None for unknown ones.

        ``usb_ids`` (vendor and product), ``name``, ``version`` (of firmware and protocol), ``extended_version``,
        ``uuid`` (text) and ``chip_id`` (the register).
        """
        told = self._try(Request.transfer(Code.BOARD_INFO, Info.NAME, 0))
        extended = self._try(Request.transfer(Code.BOARD_INFO, Info.EXTENDED_VERSION, 0))
        uuid = self._try(Request.read(Code.BOARD_INFO, Info.UUID, 0, 16))
        version = self._link.ask(Request.read(Code.BOARD_INFO, Info.VERSION, 0, 16))
        if not self._is_running:
            self._execute([write_word(SFCTL, _SFCTL_AT_PROBE)])
        chip_id = self._read_register(CHIP_ID)
        info = None if told is None else self._decoded(packets.decode_board_info, told)
        return {
            "usb_ids": None if info is None else info[:2],
            "name": None if info is None else info[2],
            "version": self._decoded(Version.decode, version),
            "extended_version": None if extended is None else packets.decode_text(extended),
            "uuid": None if uuid is None else self._decoded(packets.uuid_text, uuid),
            "chip_id": chip_id,
        }

    def read_registers(self, addresses: Iterable[int]) -> dict[int, int]:
        """Values of registers of the chip, 24 bits each, by address."""
        wanted = list(addresses)
        answer = self._on_chip(Request.transfer(*_EXECUTE, packets.encode_commands(a << 25 for a in wanted)))
        values = self._decoded(packets.decode_values, answer)
        if len(values) != len(wanted):
            raise ProtocolError(f"{self._link.name}: expected {len(wanted)} registers, got {len(values)}")
        return {address: value & 0xFFFFFF for address, value in zip(wanted, values, strict=True)}

    def write_registers(self, registers: dict[int, int]) -> None:
        """Set registers of the chip in ascending order, MAIN last; ends what is being measured.

        The next `start` sets all that it needs anew, but for what `reset` alone undoes.
        """
        addresses = sorted(registers, key=lambda address: (address == MAIN, address))
        self.stop()
        self._execute(write_word(address, registers[address]) for address in addresses)

    def reset(self) -> None:
        """Stop, and reset the chip by its pin: registers as after power-up, but SFCTL, so that they can be read."""
        self.stop()
        self._pins_reset()
        self._execute([write_word(SFCTL, _SFCTL_AT_PROBE)])

    @property
    def slice_size(self) -> int:
        """Samples that are read at once, of the settings of `configure`."""
        return self._slice_size

    @property
    def last_slice(self) -> Slice | None:
        """The newest slice of frames; None before the first."""
        return None if self._assembler is None else self._last

    def temperature(self) -> float:
        """Temperature of the chip [degrees Celsius]; at most 0.1 s old."""
        when, value = self._temperature
        if time.monotonic() - when >= _TEMPERATURE_AGE:
            value = self._measure_temperature()
            self._temperature = (time.monotonic(), value)
        return value

    def _measure_temperature(self) -> float:
        if self._is_running:
            return temperature_of(self._read_register(SADC_RESULT) & 0x3FF)
        # Idle: power the chip for its sensor, and reset it afterwards.
        self._execute(_SADC_POWER)
        self._await(STAT0, 1 << 2, 1 << 2)
        self._execute(_SADC_ENABLE)
        self._await(STAT0, 1, 1)
        self._execute(_SADC_START)
        result = self._await(SADC_RESULT, 1 << 10, 0)
        self._pins_reset()
        return temperature_of(result & 0x3FF)

    def _await(self, address: int, mask: int, value: int) -> int:
        for _ in range(_SADC_TRIES):
            if (found := self._read_register(address)) & mask == value:
                return found
        raise SensorError(f"{self._link.name}: the temperature sensor did not settle")

    def close(self) -> None:
        """Stop and give the port back."""
        try:
            self.stop()
        except SensorError:
            pass  # a board that is gone has stopped
        finally:
            self._link.close()

    @property
    def _samples_per_frame(self) -> int:
        settings = self._running
        return settings.num_samples * settings.num_chirps * settings.rx_mask.bit_count()

    @property
    def _running(self) -> Settings:
        assert self._settings is not None  # `start` has looked
        return self._settings

    def _read_register(self, address: int) -> int:
        return self.read_registers([address])[address]

    def _decoded(self, decode: Callable[[bytes], _Decoded], payload: bytes) -> _Decoded:
        """Decoded answer, or a ProtocolError with the port."""
        try:
            return decode(payload)
        except ProtocolError as error:
            raise ProtocolError(f"{self._link.name}: {error}") from error

    def _execute(self, words: Iterable[int]) -> None:
        """Send words to the chip."""
        self._on_chip(Request.write(*_EXECUTE, packets.encode_commands(words)))

    def _on_chip(self, request: Request) -> bytes:
        """Answer of the chip; asked again if the first one only reports an earlier overflow of the FIFO."""
        try:
            return self._link.ask(request)
        except RequestError as error:
            if error.status != Status.UNEXPECTED_VALUE:
                raise
            return self._link.ask(request)

    def _pins_reset(self) -> None:
        self._link.ask(Request.write(Code.COMPONENT, Component.AVIAN, Avian.PIN_RESET_PULSE))

    def _stop_data(self, timeout: float = REQUEST_TIMEOUT, *, retries: int = RETRIES) -> None:
        """Ask for an end of the data; boards that send none refuse that, each firmware in its own way."""
        with suppress(ProtocolError):
            self._link.ask(Request.write(Code.DATA, Data.STOP, 0), timeout, retries=retries)

    def _try(self, request: Request) -> bytes | None:
        """The answer, or None if the board refuses one, for whatever reason."""
        try:
            return self._link.ask(request)
        except ProtocolError:
            return None


def _elapsed(earlier: Slice, later: Slice) -> int | None:
    """Time between two slices [us]; None if their time stamps do not tell: none, or a clock that has gone back."""
    if earlier.timestamp is None or later.timestamp is None or later.timestamp < earlier.timestamp:
        return None
    return later.timestamp - earlier.timestamp


_EXECUTE = (Code.COMPONENT, Component.AVIAN, Avian.EXECUTE)
_RESETS = FSM_RESET | FIFO_RESET
