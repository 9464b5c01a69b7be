"""The board's side of ComLib: an XMC board with a 60 GHz radar behind a byte stream."""

from __future__ import annotations

import math
import threading
import time
from enum import IntEnum

import numpy as np

from radarcore import check
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform
from radarcore.sensor.comlib.codes import Adc, Base, Direction, EndpointType, Fmcw, ProtocolStatus, SignalPart, Status
from radarcore.sensor.comlib.codes import Protocol as ProtocolCode
from radarcore.sensor.comlib.messages import (
    MAX_PAYLOAD,
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
    TxPower,
    decode_byte,
    decode_number,
    encode_endpoints,
    encode_number,
)
from radarcore.sensor.emulator.pty import Unplugged
from radarcore.sensor.emulator.source import FrameSource
from radarcore.sensor.interface import Damage


class _At(IntEnum):
    """Numbers of the endpoints."""

    PROTOCOL = 0
    BASE = 1
    FMCW = 2
    ADC = 3


_OVERHEAD_NS = 22_000
"""A chirp lasts longer than its samples: 150 us were measured with 256 samples at 2 MHz."""

_MIN_RATE, _MAX_RATE = 20_000, 3_000_000
"""Sample rates [Hz]: the highest seen in use, and the lowest that lets the longest chirp be told in 32 bits of ns."""

_RX = 1.75e-3 * np.array([[0, -1, 1], [0, 1, 1], [0, -1, -1], [0, 1, -1]])
"""Receivers of the BGT60TR24, a square of 3.5 mm [m]: RX1 is taken to be the upper right one, seen along the beam."""


class _Refused(Exception):  # noqa: N818  # what has happened
    def __init__(self, status: int) -> None:
        self.status = status


class ComLibEmulator:
    """A `StreamPeripheral` with the endpoints RBAS, RFMC and, if wanted, RADX.

    It does what the published firmware does: checks the size of every request, reports what follows from a setting
    before the status, discards everything after an error until the line has been silent, and sends a frame only when
    asked. One TX; samples are real; chirps go up or down, one after the other.

    Parameters
    ----------
    source : FrameSource
        Gives the frames. It is called by `send`; where it raises, the frame is refused, and `failure` says why.
    speed : float, optional
        Seconds of measuring in one of the clock: 1 is real time. A frame is ready an interval after the last one, and
        over when the next is. Default: frames are ready whenever they are asked for, and none is ever lost.
    sample_rate : float
        Sample rate after power-up [Hz].
    has_adc : bool
        Offer the endpoint RADX, which sets the sample rate.
    is_interleaved : bool
        Interleave the receivers, sample by sample.
    temperature : float
        Temperature of the chip [degrees Celsius]; the attribute may change.
    resync_timeout : float
        Silence after which an incomplete message is given up [s].
    buffer_size : int
        Largest payload of a request [bytes].
    latency : float
        Time from a request to its answer, at least [s].
    """

    def __init__(
        self,
        source: FrameSource,
        *,
        speed: float | None = None,
        sample_rate: float = 2e6,
        has_adc: bool = True,
        is_interleaved: bool = False,
        temperature: float = 40.0,
        resync_timeout: float = 10.0,
        buffer_size: int = 512,
        latency: float = 0.0,
    ) -> None:
        self.temperature: float = check.number("temperature", temperature, "degrees Celsius")
        self.failure: Exception | None = None
        self.num_frames: int
        self.num_lost: int
        self.num_frames = self.num_lost = 0
        """Frames that were sent, and frames that were over before they were asked for, in all."""
        self._source = source
        self._speed = None if speed is None else check.positive("speed", speed)
        self._initial_rate = round(check.positive("sample_rate", sample_rate, "Hz"))
        if not _MIN_RATE <= self._initial_rate <= _MAX_RATE:
            raise ValueError(f"sample_rate: expected {_MIN_RATE} to {_MAX_RATE} Hz, got {sample_rate}")
        self._resync_timeout = check.positive("resync_timeout", resync_timeout, "s")
        self._latency = check.non_negative("latency", latency, "s")
        self._is_interleaved = is_interleaved
        self._info = Info(56_000_000, 64_000_000, 2, len(_RX), 31, 1, 1, 0, int(is_interleaved), 0, "BGT60TR24B")
        types = [EndpointType.RBAS, EndpointType.RFMC, EndpointType.RADX][: 3 if has_adc else 2]
        self._endpoints = [Endpoint(letters) for letters in types]
        self._parser = Parser(len(types), check.count("buffer_size", buffer_size))
        self._changed = threading.Condition()
        self._is_unplugged = False
        self._last_byte = 0.0
        self._waiting: list[Message | StatusMessage] = []
        self._out = bytearray()
        self._reset()

    @property
    def radar(self) -> Radar:
        """Radar of the present settings, whose frames the source gives."""
        ramp, adc, form = self._ramp, self._converter, self._format
        duration = self._chirp_duration / 1e9
        slope = (ramp.upper_khz - ramp.lower_khz) * 1e3 / duration
        is_up = ramp.direction == Direction.UP
        waveform = Waveform(
            start_frequency=(ramp.lower_khz if is_up else ramp.upper_khz) * 1e3,
            slope=slope if is_up else -slope,
            sample_rate=adc.sample_rate,
            num_samples=form.num_samples,
            num_chirps=form.num_chirps,
            chirp_interval=duration,
            frame_interval=max(self._interval, self._min_interval) / 1e6,
            # The place of the samples within the ramp is not known: its middle.
            adc_delay=0.5 * (duration - form.num_samples / adc.sample_rate),
        )
        enabled = [position for i, position in enumerate(_RX) if form.rx_mask >> i & 1]
        return Radar(waveform, rx=enabled, receiver=Receiver(output="real"))

    def unplug(self) -> None:
        """Take the board off the bus: calls from now on, and those that wait, raise `Unplugged`."""
        with self._changed:
            self._is_unplugged = True
            self._changed.notify_all()

    def hang_up(self) -> None:
        """Forget half a request and answers nobody has taken; settings and the measurement stay."""
        with self._changed:
            self._parser.reset()
            self._waiting.clear()
            self._out.clear()

    def receive(self, data: bytes) -> None:
        """Bytes from the host, cut anywhere."""
        with self._changed:
            self._check_plugged()
            self._give_up()
            self._last_byte = time.monotonic()
            for item in self._parser.feed(data):
                if not isinstance(item, Damage):
                    self._waiting.append(item)
                elif item.status:
                    self._waiting.append(StatusMessage(0, item.status))
            self._changed.notify_all()

    def send(self, size: int, timeout: float) -> bytes:
        """Bytes of one transfer to the host: 1 to `size`, none when nothing is to be sent within `timeout` [s]."""
        deadline = time.monotonic() + timeout
        with self._changed:
            while True:
                self._check_plugged()
                self._give_up()
                next_event = self._work()
                left = deadline - time.monotonic()
                if self._out or left <= 0.0:
                    break
                self._changed.wait(min(left, next_event, self._silent_in))
            data = bytes(self._out[:size])
            del self._out[:size]
            return data

    def _check_plugged(self) -> None:
        if self._is_unplugged:
            raise Unplugged

    def _give_up(self) -> None:
        """Say that a message is incomplete, when the line has been silent for the time-out."""
        if self._silent_in == 0.0:
            self._parser.reset()
            self._waiting.append(StatusMessage(0, ProtocolStatus.SILENCE))

    @property
    def _silent_in(self) -> float:
        """Time until an incomplete message is given up [s]."""
        if self._parser.is_idle:
            return math.inf
        return max(0.0, self._last_byte + self._resync_timeout - time.monotonic())

    def _work(self) -> float:
        """Answer what has come, up to what is not ready; time until it is [s]."""
        if self._waiting and (early := self._last_byte + self._latency - time.monotonic()) > 0.0:
            return early
        while self._waiting:
            item = self._waiting[0]
            if isinstance(item, Message):
                if (ready_in := self._answer_in(item)) > 0.0:
                    return ready_in
                self._answer(item)
            else:
                self._out += item.encode()
            del self._waiting[0]
        return math.inf

    def _answer(self, request: Message) -> None:
        try:
            messages, status = self._messages(request), Status.OK.value
        except _Refused as refused:
            messages, status = [], refused.status
        for message in messages:
            self._out += message.encode()
        self._out += StatusMessage(request.endpoint, status).encode()

    def _reset(self) -> None:
        """Settings as after power-up."""
        self._ramp = FmcwSettings(57_000_000, 64_000_000, Direction.UP, 31)
        self._converter = AdcSettings(self._initial_rate)
        self._format = Format(64, 16, 0xF)
        self._told_temperature = self.temperature
        self._set_interval(0)

    # Frames

    def _now(self) -> float:
        """Time of the board [s]."""
        return time.monotonic() * (self._speed or 1.0)

    def _set_interval(self, interval: int) -> None:
        """Begin to measure, a frame every `interval` [us]; 0: when asked."""
        self._interval = interval
        self._begin = self._now()
        self._next_index = 0

    def _answer_in(self, request: Message) -> float:
        """Time until a request can be answered [s]: none, or until a frame is ready."""
        is_frame = request.endpoint == _At.BASE and request.code == Base.GET_FRAME and len(request.payload) == 2
        return self._ready_in if is_frame and decode_byte(request.payload) else 0.0

    @property
    def _num_over(self) -> int:
        """Frames that are over or ready; those that have been sent, where frames are ready when asked for."""
        if self._speed is None or not self._interval:
            return self._next_index + 1
        return math.floor((self._now() - self._begin) / (self._interval / 1e6))

    @property
    def _ready_in(self) -> float:
        """Time until a frame is ready that has not been sent [s]."""
        if self._num_over > self._next_index:
            return 0.0
        # Rounding may make it zero too soon: look again then.
        ready = self._begin + (self._next_index + 1) * self._interval / 1e6
        return max(1e-6, (ready - self._now()) / (self._speed or 1.0))

    def _take_frame(self) -> list[Message]:
        _check(self._num_over > self._next_index, Status.BUSY)
        # The newest frame: older ones are over.
        index = self._num_over - 1
        num_over, self._next_index = index - self._next_index, index + 1
        radar = self.radar
        try:
            codes = np.asarray(self._source.frame(radar, index, index * radar.waveform.frame_interval))
        except Exception as error:  # a source that fails ends the measurement, not the board
            self.failure = error
            raise _Refused(Status.NOT_POSSIBLE) from error
        shape = (len(radar.rx), radar.waveform.num_chirps, radar.waveform.num_samples)
        if codes.shape != shape or codes.dtype != np.uint16 or codes.max() > 0xFFF:
            raise ValueError(f"frame: expected codes of 12 bit, uint16 {shape}, got {codes.dtype} {codes.shape}")
        frame = Frame(
            # Without a trigger frames are not counted.
            index % 2**32 if self._interval else 0,
            codes,
            self._format.rx_mask,
            is_interleaved=self._is_interleaved,
        )
        messages = [Message(_At.BASE, frame.encode())]
        self.num_frames += 1
        self.num_lost += num_over
        if self.temperature != self._told_temperature:
            messages.append(self._tell_temperature())
        return messages

    def _tell_temperature(self) -> Message:
        self._told_temperature = self.temperature
        return Message(_At.BASE, Temperature(0, round(self.temperature * 1e3)).encode())

    # Endpoints

    @property
    def _has_adc(self) -> bool:
        return len(self._endpoints) >= _At.ADC

    @property
    def _chirp_duration(self) -> int:
        """Duration of a chirp [ns]."""
        return round(self._format.num_samples / self._converter.sample_rate * 1e9) + _OVERHEAD_NS

    @property
    def _min_interval(self) -> int:
        """Shortest frame interval [us]."""
        return -(-self._format.num_chirps * self._chirp_duration // 1000)

    def _tell_timing(self) -> list[Message]:
        return [
            Message(_At.BASE, encode_number(Base.CHIRP_DURATION, self._chirp_duration)),
            Message(_At.BASE, encode_number(Base.MIN_INTERVAL, self._min_interval)),
        ]

    def _tell_slope(self) -> Message:
        # kHz per ns are 1e6 MHz per s.
        slope = round((self._ramp.upper_khz - self._ramp.lower_khz) / self._chirp_duration * 1e6)
        return Message(_At.FMCW, encode_number(Fmcw.SLOPE, slope))

    def _tell_power(self, tx_index: int) -> Message:
        # Step 10 is about 0 dBm; 0.4 dB a step is a guess.
        power = TxPower(tx_index, 400 * (self._ramp.tx_power - 10))
        return Message(_At.BASE, power.encode())

    def _messages(self, request: Message) -> list[Message]:
        """Messages of the answer to a request, which is known by its endpoint, code and size."""
        payload, info = request.payload, self._info
        match request.endpoint, request.code, len(payload):
            case _At.PROTOCOL, ProtocolCode.ENDPOINTS, 1:
                return [Message(_At.PROTOCOL, encode_endpoints(self._endpoints))]
            case _At.PROTOCOL, ProtocolCode.FIRMWARE, 1:
                firmware = Firmware(1, 0, 0, "BGT60TR24B radar board, emulated")
                return [Message(_At.PROTOCOL, firmware.encode())]
            case _At.PROTOCOL, ProtocolCode.RESET, 1:
                self._reset()
                return []
            case _At.BASE, Base.GET_FRAME, 2:
                return self._take_frame()
            case _At.BASE, Base.SET_INTERVAL, 5:
                interval = decode_number(payload)
                _check(interval == 0 or interval >= self._min_interval, Status.UNSUPPORTED_INTERVAL)
                self._set_interval(interval)
                return []
            case _At.BASE, Base.GET_VERSION, 1:
                return [Message(_At.BASE, bytes([Base.VERSION, 1, 0, 0]))]
            case _At.BASE, Base.GET_INFO, 1:
                return [Message(_At.BASE, info.encode())]
            case _At.BASE, Base.GET_TEMPERATURE, 2:
                _check(decode_byte(payload) < info.num_sensors, Status.NO_SUCH_SENSOR)
                return [self._tell_temperature()]
            case _At.BASE, Base.GET_TX_POWER, 2:
                _check(decode_byte(payload) < info.num_tx, Status.NO_SUCH_ANTENNA)
                return [self._tell_power(decode_byte(payload))]
            case _At.BASE, Base.GET_CHIRP_DURATION, 1:
                return self._tell_timing()[:1]
            case _At.BASE, Base.GET_MIN_INTERVAL, 1:
                return self._tell_timing()[1:]
            case _At.BASE, Base.GET_FORMAT, 1:
                return [Message(_At.BASE, self._format.encode())]
            case _At.BASE, Base.FORMAT, 11:
                return self._set_format(Format.decode(payload))
            case _At.BASE, Base.TEST, 8:
                # A constant wave is nothing that a source of frames could show.
                raise _Refused(Status.NOT_POSSIBLE)
            case _At.FMCW, Fmcw.GET_SETTINGS, 1:
                return [Message(_At.FMCW, self._ramp.encode())]
            case _At.FMCW, Fmcw.SETTINGS, 11:
                return self._set_ramp(FmcwSettings.decode(payload))
            case _At.FMCW, Fmcw.SLOPE, 1:
                return [self._tell_slope()]
            case _At.ADC, Adc.GET_SETTINGS, 1:
                return [Message(_At.ADC, self._converter.encode())]
            case _At.ADC, Adc.SETTINGS, 7:
                return self._set_converter(AdcSettings.decode(payload))
        raise _Refused(Status.UNKNOWN_MESSAGE)

    def _set_format(self, form: Format) -> list[Message]:
        _check(0 < form.rx_mask < 1 << self._info.num_rx, Status.NO_SUCH_ANTENNA)
        _check(form.signal_part == SignalPart.I, Status.SIGNAL_PART_NOT_AVAILABLE)
        num_codes = form.num_samples * form.num_chirps * form.rx_mask.bit_count()
        _check(num_codes > 0 and 18 + (num_codes * 12 + 7) // 8 <= MAX_PAYLOAD, Status.UNSUPPORTED_FORMAT)
        self._format = form
        messages = [Message(_At.BASE, form.encode()), *self._tell_timing()]
        if self._has_adc:
            messages.append(Message(_At.ADC, self._converter.encode()))
        return [*messages, self._tell_slope()]

    def _set_ramp(self, ramp: FmcwSettings) -> list[Message]:
        limits = self._info
        is_inside = limits.min_frequency_khz <= ramp.lower_khz < ramp.upper_khz <= limits.max_frequency_khz
        _check(is_inside, Status.FREQUENCY_OUT_OF_RANGE)
        _check(ramp.direction in (Direction.UP, Direction.DOWN), Status.UNSUPPORTED_DIRECTION)
        _check(ramp.tx_power <= limits.max_tx_power, Status.TX_POWER_OUT_OF_RANGE)
        self._ramp = ramp
        powers = [self._tell_power(tx_index) for tx_index in range(limits.num_tx)]
        return [*powers, Message(_At.FMCW, ramp.encode())]

    def _set_converter(self, converter: AdcSettings) -> list[Message]:
        _check(_MIN_RATE <= converter.sample_rate <= _MAX_RATE, Status.SAMPLE_RATE_OUT_OF_RANGE)
        _check(converter.resolution == 12, Status.UNSUPPORTED_RESOLUTION)
        self._converter = converter
        return [*self._tell_timing(), Message(_At.ADC, converter.encode())]


def _check(is_good: bool, status: int) -> None:
    if not is_good:
        raise _Refused(status)
