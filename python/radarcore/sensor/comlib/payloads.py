"""Payloads of ComLib messages."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarcore.sensor.comlib.codes import Adc, Base, Fmcw, Protocol, SignalPart
from radarcore.sensor.errors import ProtocolError


class Endpoint(NamedTuple):
    """Type and version of an endpoint."""

    type: int
    version: int = 1

    @property
    def letters(self) -> str:
        """The four letters of the type; what is none is escaped."""
        letters = self.type.to_bytes(4, "big").decode("ascii", errors="backslashreplace")
        return "".join(letter if letter.isprintable() else rf"\x{ord(letter):02x}" for letter in letters)


def encode_endpoints(endpoints: list[Endpoint]) -> bytes:
    """Answer to `Protocol.ENDPOINTS`; the first is endpoint 1."""
    records = b"".join(pack("endpoint", "<IH", *endpoint) for endpoint in endpoints)
    return bytes([Protocol.ENDPOINTS, len(endpoints)]) + records


def decode_endpoints(payload: bytes) -> list[Endpoint]:
    """Endpoints from 1 on; ProtocolError if the answer is of a wrong size."""
    if len(payload) < 2 or len(payload) != 2 + 6 * payload[1]:
        raise ProtocolError(f"ComLib endpoints: expected 2 + 6 n bytes, got {payload[:8].hex(' ')}...")
    return [Endpoint(*fields) for fields in struct.iter_unpack("<IH", payload[2:])]


class Firmware(NamedTuple):
    """Answer to `Protocol.FIRMWARE`."""

    major: int
    minor: int
    build: int
    description: str

    def encode(self) -> bytes:
        """Payload with its code; ValueError if a number does not fit."""
        return pack("firmware", "<BHHH", Protocol.FIRMWARE, *self[:3]) + self.description.encode() + b"\0"

    @classmethod
    def decode(cls, payload: bytes) -> Firmware:
        """Decode a payload; ProtocolError when it is too short."""
        return cls(*_fields("firmware", "<xHHH", payload, has_text=True))


class Info(NamedTuple):
    """Answer to `Base.GET_INFO`: capabilities of the board."""

    min_frequency_khz: int
    max_frequency_khz: int
    num_tx: int
    num_rx: int
    max_tx_power: int
    num_sensors: int
    hardware_major: int
    hardware_minor: int
    interleaved_rx: int
    data_format: int
    description: str

    def encode(self) -> bytes:
        """Payload with its code; ValueError if a number does not fit."""
        return pack("device info", "<BII8B", Base.INFO, *self[:10]) + self.description.encode() + b"\0"

    @classmethod
    def decode(cls, payload: bytes) -> Info:
        """Decode a payload; ProtocolError when it is too short."""
        return cls(*_fields("device info", "<xII8B", payload, has_text=True))


class Format(NamedTuple):
    """Format of the frames, `Base.FORMAT`."""

    num_samples: int
    num_chirps: int
    rx_mask: int
    signal_part: int = SignalPart.I

    def encode(self) -> bytes:
        """Payload with its code; ValueError if a number does not fit."""
        return pack("frame format", "<BIIBB", Base.FORMAT, *self)

    @classmethod
    def decode(cls, payload: bytes) -> Format:
        """Decode a payload; ProtocolError when its size is wrong."""
        return cls(*_fields("frame format", "<xIIBB", payload))


class FmcwSettings(NamedTuple):
    """Frequencies [kHz], `Direction` and power step of the chirps, `Fmcw.SETTINGS`."""

    lower_khz: int
    upper_khz: int
    direction: int
    tx_power: int

    def encode(self) -> bytes:
        """Payload with its code; ValueError if a number does not fit."""
        return pack("FMCW settings", "<BIIBB", Fmcw.SETTINGS, *self)

    @classmethod
    def decode(cls, payload: bytes) -> FmcwSettings:
        """Decode a payload; ProtocolError when its size is wrong."""
        return cls(*_fields("FMCW settings", "<xIIBB", payload))


class AdcSettings(NamedTuple):
    """Sample rate [Hz], bits of a sample, and calibration after the conversion, `Adc.SETTINGS`."""

    sample_rate: int
    resolution: int = 12
    post_calibration: int = 0

    def encode(self) -> bytes:
        """Payload with its code; ValueError if a number does not fit."""
        return pack("ADC settings", "<BIBB", Adc.SETTINGS, *self)

    @classmethod
    def decode(cls, payload: bytes) -> AdcSettings:
        """Decode a payload; ProtocolError when its size is wrong."""
        return cls(*_fields("ADC settings", "<xIBB", payload))


class Reading(NamedTuple):
    """Thousandths of a degree Celsius of a sensor, or of a dBm of a TX antenna."""

    number: int
    thousandths: int

    def encode(self, code: int) -> bytes:
        """Payload with `Base.TEMPERATURE` or `Base.TX_POWER`."""
        return pack("reading", "<BBi", code, *self)

    @classmethod
    def decode(cls, payload: bytes) -> Reading:
        """Decode a payload; ProtocolError when its size is wrong."""
        return cls(*_fields("reading", "<xBi", payload))


def encode_byte(code: int, number: int) -> bytes:
    """Payload of a code and 8 bits: to wait for a frame, the number of a sensor or antenna."""
    return pack("message", "<BB", code, number)


def decode_byte(payload: bytes) -> int:
    """The 8 bits behind a code; ProtocolError if the payload is of a wrong size."""
    number: int
    (number,) = _fields("message", "<xB", payload)
    return number


def encode_number(code: int, number: int) -> bytes:
    """Payload of a code and 32 bits: frame interval [us], chirp duration [ns], slope [MHz/s]."""
    return pack("message", "<BI", code, number)


def decode_number(payload: bytes) -> int:
    """The 32 bits behind a code; ProtocolError if the payload is of a wrong size."""
    number: int
    (number,) = _fields("message", "<xI", payload)
    return number


@dataclass(frozen=True, eq=False)
class Frame:
    """Samples of a frame.

    Attributes
    ----------
    number : int
        Counts from the last time that the interval was set.
    codes : (rx, chirp, sample, part) uint16
        Codes of the ADC; one part (I or Q) where `data_format` is 0, else I and Q.
    rx_mask : int
        Enabled receivers, the first in the lowest bit.
    data_format : int
        On the wire: 0 real, 1 block of I and block of Q, 2 I and Q in turn.
    resolution : int
        Bits of a sample.
    is_interleaved : bool
        On the wire: receivers in turn, sample by sample.
    """

    number: int
    codes: NDArray[np.uint16]
    rx_mask: int
    data_format: int = 0
    resolution: int = 12
    is_interleaved: bool = False

    def encode(self) -> bytes:
        """Payload with its code; ValueError if a number does not fit."""
        num_rx, num_chirps, num_samples, _ = self.codes.shape
        head = pack(
            "frame",
            "<BIIBIBBBB",
            Base.FRAME,
            self.number,
            num_chirps,
            num_rx,
            num_samples,
            self.rx_mask,
            self.data_format,
            self.resolution,
            self.is_interleaved,
        )
        ordered = self.codes.transpose(_WIRE_AXES[self.is_interleaved, self.data_format])
        return head + pack_bits(ordered.ravel(), self.resolution)

    @classmethod
    def decode(cls, payload: bytes) -> Frame:
        """Decode a payload; ProtocolError when its size is not that of its samples."""
        head = _fields("frame", "<xIIBIBBBB", payload[:18])
        number, num_chirps, num_rx, num_samples, rx_mask, data_format, resolution, is_interleaved = head
        if data_format > 2 or not 1 <= resolution <= 16 or is_interleaved > 1:
            raise ProtocolError(
                f"ComLib frame: expected data format 0 to 2, 1 to 16 bits, interleaved 0 or 1, "
                f"got {data_format}, {resolution}, {is_interleaved}"
            )
        shape = (num_rx, num_chirps, num_samples, 2 if data_format else 1)
        num_codes = num_rx * num_chirps * num_samples * shape[3]
        size = 18 + -(-num_codes * resolution // 8)
        if len(payload) != size:
            raise ProtocolError(
                f"ComLib frame: expected {size} bytes for [rx, chirp, sample] {shape[:3]}, got {len(payload)}"
            )
        # Axes in the order of the wire, then in ours.
        axes = _WIRE_AXES[bool(is_interleaved), data_format]
        codes = unpack_bits(payload[18:], num_codes, resolution).reshape([shape[axis] for axis in axes])
        codes = np.ascontiguousarray(codes.transpose(np.argsort(axes)))
        return cls(number, codes, rx_mask, data_format, resolution, bool(is_interleaved))


_WIRE_AXES = {
    # (is_interleaved, data_format): axes of [rx, chirp, sample, part] from the outermost
    (False, 0): (1, 0, 2, 3),
    (False, 1): (1, 0, 3, 2),
    (False, 2): (1, 0, 2, 3),
    (True, 0): (1, 2, 0, 3),
    (True, 1): (1, 3, 2, 0),
    (True, 2): (1, 2, 0, 3),
}


def pack_bits(codes: NDArray[np.uint16], resolution: int) -> bytes:
    """Codes of `resolution` bits in a row, the lowest bit of the first code in the lowest bit of the first byte."""
    bits = codes.astype("<u2")[:, None].view(np.uint8)
    rows = np.unpackbits(bits, axis=1, bitorder="little")[:, :resolution]
    return np.packbits(rows, bitorder="little").tobytes()


def unpack_bits(data: bytes, num_codes: int, resolution: int) -> NDArray[np.uint16]:
    """Codes that `pack_bits` put in a row, (num_codes,)."""
    bits = np.unpackbits(np.frombuffer(data, np.uint8), count=num_codes * resolution, bitorder="little")
    rows = np.zeros((num_codes, 16), np.uint8)
    rows[:, :resolution] = bits.reshape(num_codes, resolution)
    return np.packbits(rows, axis=1, bitorder="little").view("<u2")[:, 0].astype(np.uint16)


def pack(name: str, layout: str, *numbers: int) -> bytes:
    """Numbers in a layout of `struct`; a ValueError if one does not fit."""
    try:
        return struct.pack(layout, *numbers)
    except struct.error as error:
        raise ValueError(f"ComLib {name}: {error}, got {numbers}") from None


def _fields(name: str, layout: str, payload: bytes, *, has_text: bool = False) -> tuple[Any, ...]:
    """Fields of a payload of exactly that layout, or with a zero-terminated text behind them."""
    size = struct.calcsize(layout)
    if len(payload) < size or (len(payload) > size and not has_text):
        raise ProtocolError(f"ComLib {name}: expected {size} bytes{' or more' * has_text}, got {len(payload)}")
    fields = struct.unpack_from(layout, payload)
    return (*fields, payload[size:].split(b"\0", 1)[0].decode(errors="replace")) if has_text else fields
