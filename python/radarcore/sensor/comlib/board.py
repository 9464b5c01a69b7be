"""A board that speaks ComLib: the host's side of the conversation."""

from __future__ import annotations

import contextlib
import math
import re
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

from radarcore import check
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform
from radarcore.sensor.comlib.codes import (
    Adc,
    Base,
    Direction,
    EndpointType,
    Fmcw,
    ProtocolStatus,
    SignalPart,
    Status,
    status_text,
)
from radarcore.sensor.comlib.codes import Protocol as ProtocolCode
from radarcore.sensor.comlib.messages import (
    AdcSettings,
    Endpoint,
    Firmware,
    FmcwSettings,
    Format,
    Frame,
    Info,
    Message,
    Parser,
    StatusMessage,
    Temperature,
    decode_endpoints,
    decode_number,
    encode_number,
)
from radarcore.sensor.errors import ProtocolError, RequestError, SensorError, SensorTimeoutError, answering
from radarcore.sensor.interface import BoardInfo, Damage, RawFrame, check_single_ramp
from radarcore.sensor.transport.stream import Stream

_Decoded = TypeVar("_Decoded")

_TIMEOUT = 1.0
"""Time-out of the answer to a request [s]."""

_BOARD_TIMEOUT = 10.0
"""Silence after which a board that has lost step listens again [s]."""

_QUIET = 0.2
"""Pause after which nothing more of an answer comes [s]."""

_CONFUSED = (
    ProtocolStatus.BAD_START,
    ProtocolStatus.NO_SUCH_ENDPOINT,
    ProtocolStatus.EMPTY_PAYLOAD,
    ProtocolStatus.PAYLOAD_TOO_LARGE,
    ProtocolStatus.BAD_END_MARKER,
)
"""Status of endpoint 0 after which a board discards everything up to a silence."""

_READ_SIZE = 16384

_RATE_TOLERANCE = 1e-3
"""Largest error of a measured sample rate: durations in whole ns of chirps that differ by 64 samples or more."""


class ComLibBoard:
    """A `Board` behind ComLib: the XMC boards with BGT60 and 24 GHz radars of 2016 to 2021.

    It is known by its answer to the query of endpoints, not by its USB ids. Its radar is real, I of I and Q; other
    boards are refused. Public facts leave open

    - the sample rate and the TX mode of the BGT60 boards (endpoint RadarSoli): `configure` measures the rate by the
      durations of two chirps and refuses another;
    - how chirps follow each other: back to back, it is assumed;
    - where in the ramp the samples lie: in its middle, it is assumed.

    The constructor leaves the stream open where it raises.

    Parameters
    ----------
    stream : Stream
        Connection, which `close` gives back.
    timeout : float
        Time-out of the answer to a request [s].
    board_timeout : float
        Silence after which a board that has lost step listens again [s].

    Raises
    ------
    SensorError
        The board's firmware is too old, or lacks what is needed.
    SensorTimeoutError, ProtocolError
        Whatever is there does not speak ComLib.
    """

    info: BoardInfo
    options: tuple[str, ...] = ("rx_mask", "tx_power")

    def __init__(self, stream: Stream, *, timeout: float = _TIMEOUT, board_timeout: float = _BOARD_TIMEOUT) -> None:
        self._stream = stream
        self._timeout = check.positive("timeout", timeout, "s")
        self._board_timeout = check.non_negative("board_timeout", board_timeout, "s")
        self._parser = Parser()
        self._messages: list[Message] = []
        # Bytes of an earlier conversation may be on their way.
        self._is_out_of_step = True
        self._is_board_confused = False
        self._is_measuring = self._is_frame_due = False
        self._ready: list[RawFrame] = []
        self._last_number: int | None = None
        self._index = -1  # of the last frame
        self._interval_us = 0
        self._shape = (0, 0, 0)
        self._closed = False

        endpoints = self._probe()
        with answering("comlib"):
            self.info = self._identify(endpoints)

    def _identify(self, endpoints: list[Endpoint]) -> BoardInfo:
        """Find the endpoints that are needed, stop a measurement that was left running, and ask who is there."""
        stream = self._stream
        types = [endpoint.type for endpoint in endpoints]
        if EndpointType.IRDR in types and EndpointType.RBAS not in types:
            raise SensorError(
                f"{stream.name}: the board speaks the ComLib of 2016/17 ('Sensing Interface v5.0', endpoint iRDR), "
                f"which radarcore does not; it needs firmware with the endpoints RBAS and RFMC"
            )
        for needed in (EndpointType.RBAS, EndpointType.RFMC):
            if needed not in types:
                letters = ", ".join(endpoint.letters for endpoint in endpoints) or "none"
                raise SensorError(f"{stream.name}: expected an FMCW radar with endpoint {needed.name}, got {letters}")
        self._base = types.index(EndpointType.RBAS) + 1
        self._fmcw = types.index(EndpointType.RFMC) + 1
        self._adc = types.index(EndpointType.RADX) + 1 if EndpointType.RADX in types else None

        self._exchange(self._base, encode_number(Base.SET_INTERVAL, 0))
        firmware = self._ask(0, ProtocolCode.FIRMWARE, ProtocolCode.FIRMWARE, Firmware.decode)
        self._limits = self._ask(self._base, Base.GET_INFO, Base.INFO, Info.decode)
        chip = re.search(r"BGT\w+", f"{self._limits.description} {firmware.description}")
        return BoardInfo(
            port=stream.name,
            protocol="comlib",
            name=firmware.description or self._limits.description,
            chip=chip[0] if chip else "",
            firmware=f"{firmware.major}.{firmware.minor}.{firmware.build}",
            serial_number="",
        )

    def configure(self, radar: Radar, *, rx_mask: int | None = None, tx_power: int | None = None) -> Radar:
        """The radar that the board can do nearest to `radar`; it is in force from the next `start` on.

        The ramp has the slope of `radar` up to the frequency limits of the board, and lasts as long as the board's
        chirp. Receivers, pattern and power are taken over as they are.

        Parameters
        ----------
        radar : Radar
            One TX; one RX for every enabled receiver; real, or what comes is.
        rx_mask : int, optional
            Enabled receivers, the first in the lowest bit; default: the first ones.
        tx_power : int, optional
            Power step of the board; default: as it is.

        Raises
        ------
        ValueError
            For a radar that no setting of the board comes near to.
        RequestError
            For a request that the board refuses.
        """
        check_single_ramp(radar)
        wave = radar.waveform
        rx_mask = self._rx_mask(radar, rx_mask)
        if tx_power is not None and check.count("tx_power", tx_power, 0) > self._limits.max_tx_power:
            raise ValueError(f"tx_power: expected 0 to {self._limits.max_tx_power}, got {tx_power}")
        lowest, highest = self._limits.min_frequency_khz * 1e3, self._limits.max_frequency_khz * 1e3
        if not lowest <= wave.start_frequency <= highest:
            raise ValueError(
                f"start_frequency: expected {lowest:g} to {highest:g} Hz, the limits of {self.info.name}, "
                f"got {wave.start_frequency:g}"
            )

        self._stop()
        self._interval_us = 0
        # The order of the vendor's host: frames off, frequencies, rate, format.
        self._exchange(self._base, encode_number(Base.SET_INTERVAL, 0))
        power = self._fmcw_settings().tx_power if tx_power is None else tx_power
        self._set_ramp(wave, power, wave.adc_delay + wave.num_samples / wave.sample_rate)
        if self._adc is not None:
            settings = replace(self._adc_settings(self._adc), sample_rate=round(wave.sample_rate))
            self._exchange(self._adc, settings.encode())
        form = Format(wave.num_samples, wave.num_chirps, rx_mask)
        self._set_format(form)
        sample_rate = self._sample_rate(form, wave.sample_rate)
        # The ramp lasts as long as the chirp, which follows from rate and format.
        duration = self._chirp_duration(sample_rate)
        ramp = self._set_ramp(wave, power, duration)
        achieved = self._achieved(ramp, form, sample_rate, duration, wave.frame_interval)
        self._interval_us = round(achieved.frame_interval * 1e6)
        self._shape = (rx_mask.bit_count(), wave.num_chirps, wave.num_samples)
        noise_figure_db = None if radar.receiver is None else radar.receiver.noise_figure_db
        receiver = Receiver(output="real", noise_figure_db=noise_figure_db)
        return replace(radar, waveform=achieved, receiver=receiver)

    def present_radar(self, interval: float) -> Radar:
        """The radar that the board is set to, with frames every `interval` [s] or as fast as it can.

        `configure` finds nothing else to change. Its antennas stand in one place.
        """
        self._stop()
        ramp = self._fmcw_settings()
        # Real samples are what is wanted, whatever the board was set to.
        form = replace(self._ask(self._base, Base.GET_FORMAT, Base.FORMAT, Format.decode), signal_part=SignalPart.I)
        self._set_format(form)
        if self._adc is not None:
            sample_rate = float(self._adc_settings(self._adc).sample_rate)
        else:
            sample_rate = self._measured_rate(form)
        duration = self._chirp_duration(sample_rate)
        waveform = self._achieved(ramp, form, sample_rate, duration, max(interval, form.num_chirps * duration))
        return Radar(waveform, rx=[[0.0, 0.0, 0.0]] * form.rx_mask.bit_count(), receiver=Receiver(output="real"))

    def start(self) -> None:
        """Begin to measure; frames count from 0."""
        if not self._interval_us:
            raise SensorError(f"{self.info.port}: not configured; call configure first")
        self._stop()
        self._last_number, self._index = None, -1
        self._is_measuring = True
        try:
            self._exchange(self._base, encode_number(Base.SET_INTERVAL, self._interval_us))
        except SensorTimeoutError:
            # The answer may have been lost, and the board measure: stop it, and start anew.
            self._exchange(self._base, encode_number(Base.SET_INTERVAL, 0))
            self._exchange(self._base, encode_number(Base.SET_INTERVAL, self._interval_us))

    def read(self, timeout: float) -> list[RawFrame]:
        """Frames that have come since the last call, in order.

        Waits up to `timeout` [s] for one; a frame that comes later belongs to a later call.
        """
        if not self._is_measuring:
            raise SensorError(f"{self.info.port}: not measuring; call start first")
        if not self._ready:
            with contextlib.suppress(SensorTimeoutError):
                self._read_frame(check.non_negative("timeout", timeout, "s"))
        ready, self._ready = self._ready, []
        return ready

    def stop(self, *, is_silent: bool = False) -> None:
        """End measuring; does nothing where nothing is measured. A silent board gets the command without a wait."""
        if is_silent:
            self._dismiss()
        else:
            self._stop()

    def damage(self) -> str:
        """Bytes of a frame that is not whole; empty for none. All other damage is an error at once."""
        num_held = self._parser.num_held
        return f"{num_held} bytes of a message that is not whole" if num_held else ""

    def details(self) -> dict[str, Any]:
        """Entries of `Recording.source`: none, as the radar has all known settings."""
        return {}

    @property
    def has_temperature(self) -> bool:
        """True for a board with a temperature sensor."""
        return self._limits.num_sensors > 0

    def temperature(self) -> float:
        """Temperature of the chip [degrees Celsius]."""
        if not self._limits.num_sensors:
            raise SensorError(f"{self.info.port}: {self.info.name} has no temperature sensor")
        request = bytes([Base.GET_TEMPERATURE, 0])
        return self._ask(self._base, request, Base.TEMPERATURE, Temperature.decode).thousandths / 1e3

    def close(self) -> None:
        """Stop, and give the port back; may be called twice."""
        # A board that is gone or confused must not keep the port from being closed.
        if not self._closed:
            with contextlib.suppress(SensorError):
                self.stop(is_silent=self._is_out_of_step)
        self._closed = True
        self._stream.close()

    # Settings

    def _rx_mask(self, radar: Radar, rx_mask: int | None) -> int:
        """Mask of the enabled receivers, where the antennas are possible."""
        num_rx = self._limits.num_rx
        if rx_mask is None:
            if len(radar.rx) > num_rx:
                raise ValueError(
                    f"rx: expected at most {num_rx} antennas, as {self.info.name} has, got {len(radar.rx)}"
                )
            return (1 << len(radar.rx)) - 1
        if check.count("rx_mask", rx_mask) >= 1 << num_rx:
            raise ValueError(f"rx_mask: expected at most 0x{(1 << num_rx) - 1:x}, got 0x{rx_mask:x}")
        if rx_mask.bit_count() != len(radar.rx):
            raise ValueError(f"rx_mask: expected {len(radar.rx)} receivers, as in rx, got {rx_mask.bit_count()}")
        return rx_mask

    def _set_ramp(self, wave: Waveform, power: int, duration: float) -> FmcwSettings:
        """Ramp of the waveform's slope for a time [s], within the limits of the board; returns what is set."""
        start, stop = (
            min(max(round(frequency * 1e-3), self._limits.min_frequency_khz), self._limits.max_frequency_khz)
            for frequency in (wave.start_frequency, wave.start_frequency + wave.slope * duration)
        )
        if start == stop:
            limits = f"{self._limits.min_frequency_khz * 1e3:g} to {self._limits.max_frequency_khz * 1e3:g} Hz"
            raise ValueError(f"start_frequency: expected room for a ramp within {limits}, got {wave.start_frequency:g}")
        direction = Direction.UP if wave.slope > 0.0 else Direction.DOWN
        wanted = FmcwSettings(min(start, stop), max(start, stop), direction, power)
        self._exchange(self._fmcw, wanted.encode())
        settings = self._fmcw_settings()
        if settings.direction != direction or settings.lower_khz >= settings.upper_khz:
            raise ProtocolError(f"{self._stream.name}: the board was set to {wanted}, and says {settings}")
        return settings

    def _set_format(self, wanted: Format) -> None:
        try:
            self._exchange(self._base, wanted.encode())
        except RequestError as error:
            if error.status == Status.SIGNAL_PART_NOT_AVAILABLE:
                raise RequestError(
                    f"{error}: the board has no real samples, and radarcore reads no other", error.status
                ) from None
            raise
        answer = self._ask(self._base, Base.GET_FORMAT, Base.FORMAT, Format.decode)
        if answer.signal_part != SignalPart.I:
            raise SensorError(
                f"{self._stream.name}: expected real samples (signal part {SignalPart.I.value}), got signal part "
                f"{answer.signal_part}; radarcore reads no I/Q samples of ComLib boards"
            )
        if answer != wanted:
            raise ProtocolError(f"{self._stream.name}: the board was set to {wanted}, and says {answer}")

    def _sample_rate(self, form: Format, wanted: float) -> float:
        """Sample rate of the board [Hz]; ValueError if it is another than the wanted one and cannot be set."""
        if self._adc is not None:
            return float(self._adc_settings(self._adc).sample_rate)
        rate = self._measured_rate(form)
        if abs(rate / wanted - 1.0) > _RATE_TOLERANCE:
            raise ValueError(
                f"sample_rate: expected {rate:.4g} Hz, which the board is set to, got {wanted:g}; the "
                f"endpoint that sets the sample rate of BGT60 boards (RadarSoli) is not public"
            )
        return wanted

    def _measured_rate(self, form: Format) -> float:
        """Sample rate [Hz] of a board that does not report it; leaves the board with this format."""
        # Chirps of n and of other samples differ by the time of the samples between them.
        num_samples = form.num_samples
        other = num_samples // 2 if num_samples >= 128 else num_samples + 64
        durations = []
        for samples in (other, num_samples):
            self._set_format(replace(form, num_samples=samples))
            durations.append(self._number(Base.GET_CHIRP_DURATION, Base.CHIRP_DURATION))
        rate = (num_samples - other) / ((durations[1] - durations[0]) / 1e9 or math.inf)
        if rate <= 0.0:
            raise ProtocolError(
                f"{self._stream.name}: chirps of {other} and {num_samples} samples last {durations[0]} and "
                f"{durations[1]} ns; expected more samples to last longer"
            )
        return rate

    def _chirp_duration(self, sample_rate: float) -> float:
        """Duration of a chirp [s]; an error where it or the sample rate is none."""
        duration = self._number(Base.GET_CHIRP_DURATION, Base.CHIRP_DURATION) / 1e9
        if sample_rate == 0.0 or duration == 0.0:
            raise ProtocolError(
                f"{self._stream.name}: expected a sample rate and a duration of chirps, "
                f"got {sample_rate:g} Hz and {duration:g} s"
            )
        return duration

    def _achieved(
        self, ramp: FmcwSettings, form: Format, sample_rate: float, duration: float, interval: float
    ) -> Waveform:
        """Waveform of the board's settings: chirps of a `duration`, frames every `interval` [s] or at its fastest."""
        slope = self._ask(self._fmcw, Fmcw.SLOPE, Fmcw.SLOPE, decode_number) * 1e6
        shortest = self._number(Base.GET_MIN_INTERVAL, Base.MIN_INTERVAL)
        if slope == 0.0:
            slope = (ramp.upper_khz - ramp.lower_khz) * 1e3 / duration
        is_down = ramp.direction == Direction.DOWN
        return Waveform(
            start_frequency=(ramp.upper_khz if is_down else ramp.lower_khz) * 1e3,
            slope=-slope if is_down else slope,
            sample_rate=sample_rate,
            num_samples=form.num_samples,
            num_chirps=form.num_chirps,
            chirp_interval=duration,
            frame_interval=max(1, shortest, min(round(interval * 1e6), 0xFFFFFFFF)) / 1e6,
            adc_delay=0.5 * max(0.0, duration - form.num_samples / sample_rate),
        )

    def _fmcw_settings(self) -> FmcwSettings:
        return self._ask(self._fmcw, Fmcw.GET_SETTINGS, Fmcw.SETTINGS, FmcwSettings.decode)

    def _adc_settings(self, endpoint: int) -> AdcSettings:
        return self._ask(endpoint, Adc.GET_SETTINGS, Adc.SETTINGS, AdcSettings.decode)

    def _number(self, request: int, code: int) -> int:
        return self._ask(self._base, request, code, decode_number)

    # Frames

    def _stop(self) -> None:
        if self._is_measuring:
            self._is_measuring = False
            self._ready.clear()
            self._exchange(self._base, encode_number(Base.SET_INTERVAL, 0))
            self._ready.clear()

    def _dismiss(self) -> None:
        """Tell a board to stop that answers nothing; if it answers that, the next request finds the line silent."""
        if self._is_measuring:
            self._is_measuring = self._is_frame_due = False
            self._ready.clear()
            self._is_out_of_step = True
            self._stream.write(Message(self._base, encode_number(Base.SET_INTERVAL, 0)).encode(), _QUIET)

    def _read_frame(self, timeout: float) -> None:
        """Ask for a frame where none is due, and put it into `_ready` when it has come."""
        if not self._is_frame_due:
            self._send(self._base, bytes([Base.GET_FRAME, 1]))
            self._is_frame_due = True
        try:
            messages = self._answer(self._base, timeout)
        except SensorTimeoutError:
            raise SensorTimeoutError(f"{self._stream.name}: no frame came in {timeout:g} s") from None
        except SensorError:
            self._is_frame_due = False
            raise
        self._is_frame_due = False
        host_time = time.time()
        for message in messages:
            if message.endpoint == self._base and message.code == Base.FRAME:
                self._put_frame(self._decoded(Frame.decode, message.payload), host_time)

    def _put_frame(self, frame: Frame, host_time: float) -> None:
        codes = frame.codes
        if codes.shape != self._shape:
            raise ProtocolError(
                f"{self._stream.name}: expected a frame of [rx, chirp, sample] {self._shape}, got {codes.shape}"
            )
        # The number of the first frame after a start is not known; a board without trigger may repeat a number.
        step = 1 if self._last_number is None else (frame.number - self._last_number) % 2**32
        reasons: tuple[str, ...] = ()
        if 1 < step < 2**31:
            between = f"between frames {self._last_number} and {frame.number} of the board"
            reasons = (f"{between}: asked for late, or damaged",)
            self._index += step - 1
        self._index += 1
        self._last_number = frame.number
        self._ready.append(RawFrame(codes, self._index, host_time, lost_reasons=reasons))

    # Conversation

    def _probe(self) -> list[Endpoint]:
        """Endpoints; a second try if the first meets the end of another program's answers."""
        with contextlib.suppress(ProtocolError):
            return self._endpoints()
        try:
            return self._endpoints()
        except RequestError:
            with answering("comlib"):
                raise

    def _endpoints(self) -> list[Endpoint]:
        return self._ask(0, ProtocolCode.ENDPOINTS, ProtocolCode.ENDPOINTS, decode_endpoints)

    def _ask(self, endpoint: int, request: int | bytes, code: int, decode: Callable[[bytes], _Decoded]) -> _Decoded:
        """Decoded payload with `code` of the answer to a request, among others that may come with it."""
        payload = bytes([request]) if isinstance(request, int) else request
        for message in self._exchange(endpoint, payload):
            if message.endpoint == endpoint and message.code == code:
                return self._decoded(decode, message.payload)
        raise ProtocolError(
            f"{self._stream.name}: expected answer 0x{code:02x} of endpoint {endpoint} to 0x{payload[0]:02x}, got none"
        )

    def _decoded(self, decode: Callable[[bytes], _Decoded], payload: bytes) -> _Decoded:
        """Decoded payload, or a ProtocolError with the port."""
        try:
            return decode(payload)
        except ProtocolError as error:
            raise ProtocolError(f"{self._stream.name}: {error}") from error

    def _exchange(self, endpoint: int, payload: bytes) -> list[Message]:
        """Messages that answer a request, once its status is OK."""
        if self._is_frame_due:
            # No request before the answer to the last one; an error in that comes again with the next frame.
            try:
                self._read_frame(self._interval_us / 1e6 + self._timeout)
            except SensorTimeoutError:
                self._is_frame_due = False
                self._is_out_of_step = True
            except SensorError:
                pass
        self._send(endpoint, payload)
        try:
            return self._answer(endpoint, self._timeout)
        except SensorTimeoutError:
            self._is_out_of_step = True
            raise

    def _send(self, endpoint: int, payload: bytes) -> None:
        if self._is_out_of_step:
            self._await_silence()
        self._messages = []
        self._stream.write(Message(endpoint, payload).encode(), self._timeout)

    def _answer(self, endpoint: int, timeout: float) -> list[Message]:
        """Messages up to the status of `endpoint`; messages received before a time-out stay for the next call."""
        deadline = time.monotonic() + timeout
        while True:
            data = self._stream.read(_READ_SIZE, max(0.0, deadline - time.monotonic()))
            for item in self._parser.feed(data):
                if isinstance(item, Damage):
                    self._is_out_of_step = True
                    raise ProtocolError(f"{self._stream.name}: not ComLib: {item.reason}")
                if isinstance(item, Message):
                    self._messages.append(item)
                elif item.endpoint == endpoint or (item.endpoint == 0 and item.status):
                    return self._finish(endpoint, item)
            if not data and time.monotonic() >= deadline:
                raise SensorTimeoutError(f"{self._stream.name}: no answer in {timeout:g} s")

    def _finish(self, endpoint: int, item: StatusMessage) -> list[Message]:
        if item.status:
            if item.endpoint == 0 and item.status in _CONFUSED:
                self._is_out_of_step = self._is_board_confused = True
            text = status_text(item.endpoint, item.status)
            raise RequestError(f"{self._stream.name}: endpoint {endpoint} refused a request: {text}", item.status)
        messages, self._messages = self._messages, []
        return messages

    def _await_silence(self) -> None:
        """Discard bytes until the line is silent, for as long as a confused board needs to listen again."""
        listens = StatusMessage(0, ProtocolStatus.SILENCE).encode()
        limit = time.monotonic() + self._timeout + (self._board_timeout if self._is_board_confused else 0.0)
        last = b""
        while True:
            data = self._stream.read(_READ_SIZE, min(self._timeout, _QUIET))
            last = last[1 - len(listens) :] + data
            if listens in last:
                self._is_board_confused = False
            now = time.monotonic()
            if not data and (now >= limit or not self._is_board_confused):
                break
            if now >= limit + self._timeout:
                raise SensorTimeoutError(
                    f"{self._stream.name}: the line is never silent; unplug the board, or it is no ComLib"
                )
        self._parser.reset()
        self._is_out_of_step = self._is_board_confused = False
