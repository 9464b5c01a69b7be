"""Packets of NatNet, the stream of Motive, versions 3.0 to 4.2: bytes to frames and names.

Little endian; every packet has a header of two numbers of 16 bits, its kind and the number of bytes that follow.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from math import hypot, isfinite
from typing import Any, TypeVar

Version = tuple[int, int]
"""Major and minor number of the protocol."""


@dataclass(frozen=True)
class ServerInfo:
    """Answer of a server to a client that connects.

    Attributes
    ----------
    name : str
        Of the program.
    version : (int, int)
        Of the protocol.
    clock_frequency : int
        Ticks per second of the stamps.
    data_port : int
        Port of multicast frames.
    is_multicast : bool
        Frames come by multicast, to all that have joined; otherwise to the address that connected.
    multicast_address : str

    See Also
    --------
    adapters.optitrack.decode_server_info : Makes one.
    adapters.optitrack.MotionCaptureClient : Has it as `info`.

    Examples
    --------
    >>> with rc.adapters.optitrack.MotionCaptureClient(command_port=motive.command_port) as client:
    ...     print(client.info.version, client.info.is_multicast)
    (4, 1) False
    """

    name: str
    version: Version
    clock_frequency: int
    data_port: int
    is_multicast: bool
    multicast_address: str


@dataclass(frozen=True)
class BodyState:
    """A rigid body, or bone, in a frame, in Motive's axes.

    Attributes
    ----------
    id : int
    position : (float, float, float)
        [m].
    quaternion : (float, float, float, float)
        Order (w, x, y, z).
    mean_marker_error : float
        [m].
    is_tracked : bool
        Position and quaternion are of this frame; otherwise they are old.

    See Also
    --------
    adapters.optitrack.CapturedFrame : Has one for each body.

    Examples
    --------
    >>> state = rc.adapters.optitrack.BodyState(1, (0.0, 1.0, 2.0), (1.0, 0.0, 0.0, 0.0), 1e-4, is_tracked=True)
    >>> state.position
    (0.0, 1.0, 2.0)
    """

    id: int
    position: tuple[float, ...]
    quaternion: tuple[float, ...]
    mean_marker_error: float
    is_tracked: bool


@dataclass(frozen=True)
class MarkerState:
    """A marker in a frame, in Motive's axes.

    Attributes
    ----------
    model : int
        Identity of the body that it belongs to.
    member : int
        Number of the marker in it.
    position : (float, float, float)
        [m].
    size : float
        Diameter [m].
    is_occluded, is_unlabelled : bool
    residual : float
        Mean distance of the cameras' rays from the marker, as Motive gives it.

    See Also
    --------
    adapters.optitrack.NatNetFrame : Has one for each marker.

    Examples
    --------
    >>> marker = rc.adapters.optitrack.MarkerState(1, 2, (0.0, 1.0, 2.0), 0.014, False, False, residual=1e-4)
    >>> marker.member
    2
    """

    model: int
    member: int
    position: tuple[float, ...]
    size: float
    is_occluded: bool
    is_unlabelled: bool
    residual: float


@dataclass(frozen=True)
class NatNetFrame:
    """A frame of the stream.

    Attributes
    ----------
    number : int
    bodies : tuple of BodyState
        Rigid bodies.
    skeletons, assets : mapping of int to tuple of BodyState
        Bones by the identity of the skeleton or of the asset.
    markers : tuple of MarkerState
    timestamp : float
        Of the program, from its start or the start of the take [s].
    exposure_ticks, received_ticks, transmitted_ticks : int
        Middle of the cameras' exposure, arrival of their data, departure of the frame, by the server's clock.
    is_recording, is_model_changed : bool
        `is_model_changed`: request the names again.

    See Also
    --------
    adapters.optitrack.decode_frame : Makes one.
    adapters.optitrack.CapturedFrame : The same with names, in the axes of a client.

    Examples
    --------
    >>> frame = rc.adapters.optitrack.NatNetFrame(17, (), {}, {}, (), 12.5, 1, 2, 3, False, False)
    >>> frame.number, frame.timestamp
    (17, 12.5)
    """

    number: int
    bodies: tuple[BodyState, ...]
    skeletons: dict[int, tuple[BodyState, ...]]
    assets: dict[int, tuple[BodyState, ...]]
    markers: tuple[MarkerState, ...]
    timestamp: float
    exposure_ticks: int
    received_ticks: int
    transmitted_ticks: int
    is_recording: bool
    is_model_changed: bool


@dataclass
class ModelNames:
    """Names of what a stream has, by identity.

    See Also
    --------
    adapters.optitrack.decode_model : Makes one.

    Examples
    --------
    >>> rc.adapters.optitrack.ModelNames(bodies={1: "ball"}).bodies[1]
    'ball'
    """

    bodies: dict[int, str] = field(default_factory=dict)
    skeletons: dict[int, tuple[str, dict[int, str]]] = field(default_factory=dict)
    """Name of the skeleton, and of its bones."""
    assets: dict[int, tuple[str, dict[int, str]]] = field(default_factory=dict)


_Item = TypeVar("_Item")

OLDEST: Version = (3, 0)
"""Before, rigid bodies had their markers with them."""

_NEWEST_MAJOR = 4
SIZED: Version = (4, 1)
"""From here on the size in bytes of every section comes after its count."""
_TURNED: Version = (4, 2)
"""From here on descriptions of rigid bodies have a rotation."""


class Kind(IntEnum):
    """Kinds of packets."""

    CONNECT = 0
    SERVER_INFO = 1
    REQUEST = 2
    RESPONSE = 3
    REQUEST_MODEL = 4
    MODEL = 5
    REQUEST_FRAME = 6
    FRAME = 7
    MESSAGE = 8
    DISCONNECT = 9
    KEEP_ALIVE = 10


class NatNetError(ValueError):
    """A packet that is truncated or of another kind, or a version that is not supported.

    See Also
    --------
    adapters.optitrack.decode_frame : Raises it.

    Examples
    --------
    >>> try:
    ...     rc.adapters.optitrack.decode_frame(b"", (4, 1))
    ... except rc.adapters.optitrack.NatNetError as error:
    ...     print(error)
    packet: expected at least 4 bytes, got 0
    """


def packet_kind(packet: bytes) -> int:
    """Kind of a packet, one of `Kind` or not; a NatNetError if it is truncated."""
    if len(packet) < 4:
        raise NatNetError(f"packet: expected at least 4 bytes, got {len(packet)}")
    kind, size = struct.unpack_from("<HH", packet)
    if len(packet) < 4 + size:
        raise NatNetError(f"packet: expected {4 + size} bytes, got {len(packet)}: truncated")
    return int(kind)


def _payload(packet: bytes, kind: Kind) -> bytes:
    """Content of a packet, or a NatNetError if it is of another kind."""
    if (got := packet_kind(packet)) != kind:
        raise NatNetError(f"packet: expected one of kind {int(kind)} ({kind.name}), got {got}")
    return packet[4 : 4 + struct.unpack_from("<H", packet, 2)[0]]


def checked_version(version: Version) -> Version:
    """Version of the protocol, or a NatNetError if it is not supported."""
    if version < OLDEST or version[0] > _NEWEST_MAJOR:
        raise NatNetError(
            f"version: expected NatNet 3.0 to {_NEWEST_MAJOR}.x, got {version[0]}.{version[1]}; set it in Motive's "
            "streaming settings, or update Motive (2.0 has NatNet 3.0)"
        )
    return version


def decode_server_info(packet: bytes) -> ServerInfo:
    """Description of a server by itself; of versions that are not supported name and version alone.

    See Also
    --------
    adapters.optitrack.ServerInfo : The result.

    Examples
    --------
    >>> import struct
    >>> packet = b"Motive".ljust(256, bytes(1)) + bytes([3, 0, 0, 0, 4, 1, 0, 0])
    >>> packet += struct.pack("<QH?4B", 10_000_000, 1511, True, 239, 255, 42, 99)
    >>> info = rc.adapters.optitrack.decode_server_info(struct.pack("<HH", 1, len(packet)) + packet)
    >>> info.name, info.version, info.multicast_address
    ('Motive', (4, 1), '239.255.42.99')
    """
    data = _Reader(_payload(packet, Kind.SERVER_INFO))
    name = data.take(256).split(b"\0")[0].decode("utf-8", "replace")
    data.take(4)  # version of the program
    major, minor, *_ = data.numbers("4B")
    if (major, minor) < OLDEST:
        return ServerInfo(name, (major, minor), 0, 0, False, "")
    frequency, port, is_multicast, *address = data.numbers("QHB4B")
    return ServerInfo(name, (major, minor), frequency, port, bool(is_multicast), ".".join(map(str, address)))


def decode_frame(packet: bytes, version: Version) -> NatNetFrame:
    """Frame of a packet of kind `Kind.FRAME`.

    Parameters
    ----------
    packet : bytes
    version : (int, int)
        Of the protocol, as `ServerInfo` has it.

    Raises
    ------
    NatNetError
        When the packet is truncated or of another kind, or the version is not 3.0 to 4.x.

    See Also
    --------
    adapters.optitrack.NatNetFrame : The result.
    adapters.optitrack.MotionCaptureClient : Receives packets and decodes them.

    Examples
    --------
    >>> import struct
    >>> layout = "<4i i3f4ffh 4i IId3Q hi"  # of version 3.0, with a rigid body alone
    >>> body = 1, 0.5, 1.25, -0.75, 0.0, 0.0, 0.0, 1.0, 1e-4, 1
    >>> packet = struct.pack(layout, 17, 0, 0, 1, *body, *4 * [0], 0, 0, 12.5, 1, 2, 3, 0, 0)
    >>> frame = rc.adapters.optitrack.decode_frame(struct.pack("<HH", 7, len(packet)) + packet, (3, 0))
    >>> frame.timestamp, frame.bodies[0].position
    (12.5, (0.5, 1.25, -0.75))
    """
    is_sized = checked_version(version) >= SIZED
    data = _Reader(_payload(packet, Kind.FRAME), is_sized=is_sized)
    number = data.number("i")
    data.section(lambda each: (each.text(), each.skip_items(12)))  # marker sets
    data.section(lambda each: each.take(12))  # markers without labels
    free = data.section(_body)
    skeletons = data.section(lambda each: (each.number("i"), each.items(_body)))
    assets = data.section(lambda each: (each.number("i"), each.items(_body), each.skip_items(26))) if is_sized else ()
    markers = data.section(_marker)
    for _ in ("force plates", "devices"):
        data.section(lambda each: (each.number("i"), each.items(lambda channel: channel.skip_items(4))))
    *_, timestamp, exposure, received, transmitted = data.numbers("IId3Q")
    if is_sized:
        data.take(8)  # seconds and their fraction, by a clock of higher precision
    flags = data.number("h")
    return NatNetFrame(
        number=number,
        bodies=free,
        skeletons=dict(skeletons),
        assets={asset: members for asset, members, _ in assets},
        markers=markers,
        timestamp=timestamp,
        exposure_ticks=exposure,
        received_ticks=received,
        transmitted_ticks=transmitted,
        is_recording=bool(flags & 1),
        is_model_changed=bool(flags & 2),
    )


def decode_model(packet: bytes, version: Version) -> ModelNames:
    """Names of bodies, skeletons and assets of a packet of kind `Kind.MODEL`; errors as in `decode_frame`.

    See Also
    --------
    adapters.optitrack.ModelNames : The result.
    adapters.optitrack.decode_frame : Bodies by these numbers.

    Examples
    --------
    >>> import struct
    >>> body = b"ball" + bytes(1) + struct.pack("<ii3fi", 1, -1, 0.0, 0.0, 0.0, 0)
    >>> packet = struct.pack("<3i", 1, 1, len(body)) + body
    >>> rc.adapters.optitrack.decode_model(struct.pack("<HH", 5, len(packet)) + packet, (4, 1)).bodies
    {1: 'ball'}
    """
    packed = _Reader(_payload(packet, Kind.MODEL), is_sized=checked_version(version) >= SIZED)
    names = ModelNames()

    def body(data: _Reader) -> tuple[int, str]:
        return _description(data, version)

    for _ in range(packed.count()):
        kind, data = packed.number("i"), packed.part()
        match kind:
            case 0:  # a set of markers
                data.text(), data.items(_Reader.text)
            case 1:  # a rigid body
                number, name = body(data)
                names.bodies[number] = name
            case 2:  # a skeleton
                name, number = data.text(), data.number("i")
                names.skeletons[number] = name, dict(data.items(body))
            case 3:  # a force plate: sizes, origin, calibration (12 x 12), corners, kinds
                data.number("i"), data.text(), data.take(4 * (2 + 3 + 144 + 12 + 2)), data.items(_Reader.text)
            case 4:  # a device
                data.number("i"), data.text(), data.text(), data.take(8), data.items(_Reader.text)
            case 5:  # a camera
                data.text(), data.take(28)
            case 6:  # an asset
                name, (_, number) = data.text(), data.numbers("ii")
                names.assets[number] = name, dict(data.items(body))
                data.items(lambda marker: (marker.text(), marker.take(4 + 12 + 4 + 2)))
            case _ if version < SIZED:
                raise NatNetError(f"packet: expected a description of kinds 0 to 6, got {kind}")
    return names


def _description(data: _Reader, version: Version) -> tuple[int, str]:
    """Identity and name of a rigid body or bone."""
    name = data.text()
    number, _ = data.numbers("ii")  # itself and its parent
    data.take(12 + (16 if version >= _TURNED else 0))
    num_markers = data.count()
    data.take(16 * num_markers)  # places and labels
    if version >= (4, 0):
        for _ in range(num_markers):
            data.text()
    return number, name


def _body(data: _Reader) -> BodyState:
    number, x, y, z, qx, qy, qz, qw, error, flags = data.numbers("i3f4ffh")
    # Bodies that were never seen have zeros: no rotation.
    is_pose = all(map(isfinite, (x, y, z))) and 0.5 < hypot(qw, qx, qy, qz) < 2.0
    return BodyState(number, (x, y, z), (qw, qx, qy, qz), error, bool(flags & 1) and is_pose)


def _marker(data: _Reader) -> MarkerState:
    number, x, y, z, size, flags, residual = data.numbers("i3ffhf")
    return MarkerState(
        model=number >> 16,
        member=number & 0xFFFF,
        position=(x, y, z),
        size=size,
        is_occluded=bool(flags & 1),
        is_unlabelled=bool(flags & 16),
        residual=residual,
    )


class _Reader:
    """Bytes read from their begin; whatever goes beyond their end is a NatNetError."""

    def __init__(self, data: bytes, *, is_sized: bool = False) -> None:
        self._data, self._is_sized = data, is_sized
        self._at = 0

    def take(self, size: int) -> bytes:
        """The next bytes."""
        if not 0 <= size <= len(self._data) - self._at:
            raise NatNetError(
                f"packet: expected {size} bytes at byte {self._at}, got {len(self._data) - self._at}: truncated, or of "
                "another version"
            )
        self._at += size
        return self._data[self._at - size : self._at]

    def numbers(self, layout: str) -> tuple[Any, ...]:
        """Numbers in the letters of `struct`."""
        return struct.unpack("<" + layout, self.take(struct.calcsize("<" + layout)))

    def number(self, letter: str) -> Any:
        """A number."""
        return self.numbers(letter)[0]

    def count(self) -> int:
        """Number of things, each of a byte or more."""
        count = int(self.number("i"))
        if not 0 <= count <= len(self._data) - self._at:
            raise NatNetError(f"packet: expected a count of things that fit into it, got {count} at byte {self._at}")
        return count

    def text(self) -> str:
        """Text up to a zero."""
        end = self._data.find(b"\0", self._at)
        if end < 0:
            raise NatNetError(f"packet: expected a zero at the end of the text at byte {self._at}, got none: truncated")
        return self.take(end + 1 - self._at)[:-1].decode("utf-8", "replace")

    def items(self, read: Callable[[_Reader], _Item]) -> tuple[_Item, ...]:
        """Count and things."""
        return tuple(read(self) for _ in range(self.count()))

    def skip_items(self, size: int) -> bytes:
        """Count of things of some bytes each, which are left out."""
        return self.take(size * self.count())

    def section(self, read: Callable[[_Reader], _Item]) -> tuple[_Item, ...]:
        """Count, size in bytes if the version has it, and things."""
        count, part = self.count(), self.part()
        return tuple(read(part) for _ in range(count))

    def part(self) -> _Reader:
        """The rest of the packet; its next section alone if the version has sizes in bytes."""
        return _Reader(self.take(self.number("i")), is_sized=True) if self._is_sized else self
