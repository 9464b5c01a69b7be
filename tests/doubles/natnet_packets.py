"""Packets of NatNet, made without the reader: by the table of the protocol."""

from __future__ import annotations

import socket
import struct
from collections.abc import Sequence

Version = tuple[int, int]
Body = tuple[int, Sequence[float], Sequence[float], bool]
"""Identity, position and quaternion (x, y, z, w) in Motive's axes, whether it is tracked."""

pack = struct.pack
FREQUENCY = 10_000_000
GROUP = "239.255.42.99"


def packet(kind: int, payload: bytes) -> bytes:
    return pack("<HH", kind, len(payload)) + payload


def section(version: Version, count: int, data: bytes = b"") -> bytes:
    return pack("<i", count) + (pack("<i", len(data)) if version >= (4, 1) else b"") + data


def rigid(bodies: Sequence[Body]) -> bytes:
    return b"".join(pack("<i3f4ffh", i, *p, *q, 2e-4, ok) for i, p, q, ok in bodies)


def frame(version: Version, number: int, bodies: Sequence[Body], t: float, *, everything: bool = False) -> bytes:
    """A frame with rigid bodies alone, or with one of all other things too."""
    out = pack("<i", number)
    if everything:
        bones = [(0x00030000 + i, p, q, ok) for i, p, q, ok in bodies]
        marked = pack("<i3ffhf", (1 << 16) + 2, 0.1, 0.2, 0.3, 0.014, 1 | 8, 4e-4)
        loose = pack("<i3ffhf", 7, 1.0, 2.0, 3.0, 0.01, 2 | 16, 5e-4)
        measured = pack("<ii", 5, 2) + pack("<i3f", 3, 1.0, 2.0, 3.0) + pack("<i", 0)
        out += section(version, 1, b"all\0" + pack("<i6f", 2, *range(6)))
        out += section(version, 2, pack("<6f", *range(6)))
        out += section(version, len(bodies), rigid(bodies))
        out += section(version, 1, pack("<ii", 3, len(bones)) + rigid(bones))
        if version >= (4, 1):
            out += section(version, 1, pack("<ii", 9, 1) + rigid(bodies[:1]) + pack("<i", 1) + marked)
        out += section(version, 2, marked + loose)
        out += 2 * section(version, 1, measured)
    else:
        out += 2 * section(version, 0) + section(version, len(bodies), rigid(bodies)) + section(version, 0)
        out += (section(version, 0) if version >= (4, 1) else b"") + 3 * section(version, 0)
    ticks = [round((t + late) * FREQUENCY) for late in (0.0, 0.002, 0.004)]
    out += pack("<IId3Q", 0, 0, t, *ticks)
    out += (pack("<II", 0, 0) if version >= (4, 1) else b"") + pack("<hi", 2 if everything else 0, 0)
    return packet(7, out)


def server_info(version: Version, *, multicast: bool = False, port: int = 1511) -> bytes:
    head = b"Motive".ljust(256, b"\0") + bytes([3, 0, 0, 0, *version, 0, 0])
    return packet(1, head + pack("<QH?", FREQUENCY, port, multicast) + socket.inet_aton(GROUP))


def model(version: Version, names: Sequence[str], *, everything: bool = True) -> bytes:
    """Descriptions of bodies by those names from 1 on, after one of all other things or alone."""

    def described(kind: int, data: bytes) -> bytes:
        return pack("<i", kind) + (pack("<i", len(data)) if version >= (4, 1) else b"") + data

    def body(number: int, name: str) -> bytes:
        data = name.encode() + b"\0" + pack("<ii3f", number, -1, 0.0, 0.0, 0.0)
        data += pack("<4f", 0.0, 0.0, 0.0, 1.0) if version >= (4, 2) else b""
        data += pack("<i3fi", 1, 0.1, 0.2, 0.3, 0)
        return data + (b"marker\0" if version >= (4, 0) else b"")

    things = [
        described(0, b"all\0" + pack("<i", 2) + b"one\0two\0"),
        described(2, b"Fred\0" + pack("<ii", 3, 2) + body(1, "Hip") + body(2, "Chest")),
        described(4, pack("<i", 1) + b"daq\0serial\0" + pack("<iii", 0, 0, 2) + b"a\0b\0"),
        described(5, b"camera\0" + pack("<7f", *range(7))),
    ]
    if version >= (4, 1):
        asset = b"Tool\0" + pack("<iii", 1, 9, 1) + body(1, "Grip")
        things.append(described(6, asset + pack("<i", 1) + b"tip\0" + pack("<i3ffh", 1, 0.0, 0.0, 0.0, 0.01, 0)))
    bodies = [described(1, body(number, name)) for number, name in enumerate(names, 1)]
    things = [*things, *bodies] if everything else bodies
    return packet(5, pack("<i", len(things)) + b"".join(things))
