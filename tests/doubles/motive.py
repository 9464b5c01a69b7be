"""A server that streams known motions as Motive does."""

from __future__ import annotations

import socket
import struct
import threading
import time as clock
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from radarcore import check
from radarcore.adapters.optitrack.capture import motive_positions, motive_quaternions
from radarcore.adapters.optitrack.natnet import SIZED, Kind, NatNetError, Version, checked_version, packet_kind
from radarcore.geometry.pose import Pose
from radarcore.geometry.rotation import quaternion_of
from radarcore.motion.protocol import AnyMotion, as_motion

_FREQUENCY = 10_000_000
"""Ticks per second of the stamps, as those of Windows."""

_LATENCY = 4e-3
"""Time from the exposure to the departure of a frame [s]."""

_SILENCE = 10.0
"""Time after which a client without a sign of life gets no more frames [s]."""

_UNRECOGNIZED = 100
_MARKER_ERROR = 2e-4


class MotionCaptureServer:
    """Streams motions as Motive streams those of rigid bodies.

    Use it in a ``with`` statement. Frames are sent one by one, or at a rate in the background::

        with MotionCaptureServer({"radar": motion}) as server:
            server.send(0.25)
            server.start()

    Parameters
    ----------
    motions : mapping of str to motion
        Motions of bodies, by name.
    rate : float
        Frames per second.
    address : str
        Address at which the server listens; from other computers it can be reached with ``"0.0.0.0"``.
    command_port : int
        0: a free one, see `command_port`.
    multicast_address, data_port : str, int
        Group and port to which frames are sent; default: to every client that has connected.
    version : (int, int)
        Of the protocol.
    axes : "z_up", "z_up_world" or "unchanged"
        How the client will turn the axes: here they are turned back.
    clock_offset : float
        The server's clock shows the time of the motions and this [s].
    drop_rate : float
        Share of frames that are lost.
    occlusions : mapping of str to sequence of (float, float), optional
        Times between which a body is not tracked [s].
    seed : int
        Of the lost frames.
    """

    def __init__(
        self,
        motions: Mapping[str, AnyMotion],
        *,
        rate: float = 120.0,
        address: str = "127.0.0.1",
        command_port: int = 0,
        multicast_address: str | None = None,
        data_port: int = 1511,
        version: Version = (4, 1),
        axes: str = "z_up",
        clock_offset: float = 0.0,
        drop_rate: float = 0.0,
        occlusions: Mapping[str, Sequence[tuple[float, float]]] | None = None,
        seed: int = 0,
    ) -> None:
        self._motions = {name: as_motion(f"motions[{name!r}]", motion) for name, motion in motions.items()}
        self._rate = rate
        self._version = checked_version(version)
        self._axes = axes
        self._clock_offset = clock_offset
        self._drop_rate = drop_rate
        self._occlusions = dict(occlusions or {})
        self._random = np.random.default_rng(seed)
        self._group = None if multicast_address is None else (multicast_address, data_port)
        self._data_port = data_port
        self._wanted_address = (address, command_port)
        self._socket: socket.socket | None = None
        self._clients: dict[tuple[str, int], float] = {}
        self._lock = threading.Lock()
        self._threads: list[threading.Thread] = []
        self._is_closed = threading.Event()
        self._number = 0
        self._last: bytes | None = None
        self._seen: dict[str, Pose] = {}

    def __enter__(self) -> MotionCaptureServer:
        one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            one.bind(self._wanted_address)
            if self._group is not None:
                if self._wanted_address[0] not in ("", "0.0.0.0"):
                    interface = socket.inet_aton(self._wanted_address[0])
                    one.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, interface)
                one.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
        except OSError:
            one.close()
            raise
        one.settimeout(0.05)
        self._socket = one
        self._is_closed.clear()
        self._run(self._answer_clients)
        return self

    def __exit__(self, *_: object) -> None:
        self._is_closed.set()
        for thread in self._threads:
            thread.join()
        self._threads.clear()
        self._clients.clear()
        if self._socket is not None:
            self._socket.close()
        self._socket = None

    @property
    def command_port(self) -> int:
        """Port at which clients connect."""
        return int(self._open_socket.getsockname()[1])

    def send(self, time: float) -> None:
        """Send the frame of a time of the motions [s], unless it is one of those that get lost."""
        now, outlet = check.number("time", time, "s"), self._open_socket
        self._number += 1
        packet = self._frame(now)
        if self._random.random() < self._drop_rate:
            return
        self._last = packet
        with self._lock:
            oldest = clock.monotonic() - _SILENCE
            self._clients = {address: sign for address, sign in self._clients.items() if sign > oldest}
            receivers = list(self._clients) if self._group is None else [self._group]
        for receiver in receivers:
            outlet.sendto(packet, receiver)

    def start(self, time: float = 0.0) -> None:
        """Send frames in the background, in real time, from a time of the motions on [s]."""
        first, _ = check.number("time", time, "s"), self._open_socket

        def stream() -> None:
            begin = clock.monotonic()
            for number in range(2**62):
                delay = begin + number / self._rate - clock.monotonic()
                if self._is_closed.wait(max(delay, 0.0)):
                    return
                self.send(first + number / self._rate)

        self._run(stream)

    @property
    def _open_socket(self) -> socket.socket:
        if self._socket is None:
            raise ValueError("server: expected an open one, got a closed one; use it in a `with` statement")
        return self._socket

    def _run(self, work: Callable[[], None]) -> None:
        thread = threading.Thread(target=work, name="motion capture server", daemon=True)
        self._threads.append(thread)
        thread.start()

    def _answer_clients(self) -> None:
        """Answer requests until the server is closed."""
        while not self._is_closed.is_set():
            try:
                packet, sender = self._open_socket.recvfrom(65_536)
                kind = packet_kind(packet)
            except (TimeoutError, ConnectionError, NatNetError):  # nothing, or no packet of this protocol
                continue
            if (answer := self._answer(kind, sender)) is not None:
                self._open_socket.sendto(answer, sender)

    def _answer(self, kind: int, sender: tuple[str, int]) -> bytes | None:
        """Answer to a request, or None."""
        with self._lock:
            if kind == Kind.DISCONNECT:
                self._clients.pop(sender, None)
            elif kind == Kind.CONNECT or sender in self._clients:
                self._clients[sender] = clock.monotonic()
        if kind == Kind.CONNECT:
            return self._info()
        if kind == Kind.REQUEST_MODEL:
            return self._model()
        if kind == Kind.REQUEST_FRAME:
            return self._last
        return _packet(_UNRECOGNIZED, b"") if kind == Kind.REQUEST else None

    def _info(self) -> bytes:
        versions = bytes([3, 1, 0, 0, *self._version, 0, 0])
        group = socket.inet_aton("239.255.42.99" if self._group is None else self._group[0])
        stream = struct.pack("<QHB", _FREQUENCY, self._data_port, self._group is not None) + group
        return _packet(Kind.SERVER_INFO, b"radarcore".ljust(256, b"\0") + versions + stream)

    def _model(self) -> bytes:
        """Names of the bodies, without markers."""
        descriptions = b""
        for number, name in enumerate(self._motions, 1):
            turn = struct.pack("<4f", 0.0, 0.0, 0.0, 1.0) if self._version >= (4, 2) else b""
            body = name.encode() + b"\0" + struct.pack("<ii3f", number, -1, 0.0, 0.0, 0.0) + turn + struct.pack("<i", 0)
            descriptions += struct.pack("<i", 1) + self._sized(body)
        return _packet(Kind.MODEL, struct.pack("<i", len(self._motions)) + descriptions)

    def _frame(self, time: float) -> bytes:
        bodies = b""
        for number, (name, motion) in enumerate(self._motions.items(), 1):
            is_tracked = not any(first <= time < last for first, last in self._occlusions.get(name, ()))
            if is_tracked or name not in self._seen:
                self._seen[name] = motion.at(time) if is_tracked else Pose()
            pose = self._seen[name]  # of old where it is not tracked, as Motive's
            position = motive_positions(pose.position, self._axes)
            w, *xyz = motive_quaternions(quaternion_of(pose.rotation), self._axes)
            bodies += struct.pack("<i3f4ffh", number, *position, *xyz, w, _MARKER_ERROR, is_tracked)
        count, empty = struct.pack("<i", len(self._motions)), struct.pack("<i", 0) + self._sized(b"")
        sections = [empty, empty, count + self._sized(bodies), *[empty] * (5 if self._version >= SIZED else 4)]
        exposure = time + self._clock_offset
        ticks = [max(round(_FREQUENCY * (exposure + later)), 0) for later in (0.0, 0.5 * _LATENCY, _LATENCY)]
        suffix = struct.pack("<IId3Q", 0, 0, exposure, *ticks) + (bytes(8) if self._version >= SIZED else b"")
        return _packet(
            Kind.FRAME, struct.pack("<i", self._number) + b"".join(sections) + suffix + struct.pack("<hi", 0, 0)
        )

    def _sized(self, data: bytes) -> bytes:
        """Data after its size, which versions from 4.1 on have."""
        return (struct.pack("<i", len(data)) if self._version >= SIZED else b"") + data


def _packet(kind: int, payload: bytes) -> bytes:
    return struct.pack("<HH", kind, len(payload)) + payload
