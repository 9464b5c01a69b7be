"""A server that streams known motions as Motive does."""

from __future__ import annotations

import socket
import threading
import time as clock
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from doubles import natnet_packets as packets
from radarcore.adapters.optitrack.capture import motive_positions, motive_quaternions
from radarcore.adapters.optitrack.natnet import Kind, NatNetError, Version, packet_kind
from radarcore.geometry.pose import Pose
from radarcore.geometry.rotation import quaternion_of
from radarcore.motion.protocol import AnyMotion, as_motion

_UNRECOGNIZED = 100


class MotionCaptureServer:
    """Streams motions as Motive streams rigid bodies.

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
    multicast_port : int, optional
        Port of the group to which frames are sent; default: to every client that has connected.
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
        multicast_port: int | None = None,
        version: Version = (4, 1),
        axes: str = "z_up",
        clock_offset: float = 0.0,
        drop_rate: float = 0.0,
        occlusions: Mapping[str, Sequence[tuple[float, float]]] | None = None,
        seed: int = 0,
    ) -> None:
        self._motions = {name: as_motion(f"motions[{name!r}]", motion) for name, motion in motions.items()}
        self._rate = rate
        self._port = multicast_port
        self._version = version
        self._axes = axes
        self._clock_offset = clock_offset
        self._drop_rate = drop_rate
        self._occlusions = dict(occlusions or {})
        self._random = np.random.default_rng(seed)
        self._clients: set[tuple[str, int]] = set()
        self._lock = threading.Lock()
        self._threads: list[threading.Thread] = []
        self._is_closed = threading.Event()
        self._number = 0
        self._last: bytes | None = None
        self._seen: dict[str, Pose] = {}

    def __enter__(self) -> MotionCaptureServer:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        self._socket.settimeout(0.05)
        self._run(self._answer_clients)
        return self

    def __exit__(self, *_: object) -> None:
        self._is_closed.set()
        for thread in self._threads:
            thread.join()
        self._socket.close()

    @property
    def command_port(self) -> int:
        """Port at which clients connect."""
        return int(self._socket.getsockname()[1])

    def send(self, time: float) -> None:
        """Send the frame of a time of the motions [s], unless it gets lost."""
        self._number += 1
        packet = self._frame(time)
        if self._random.random() < self._drop_rate:
            return
        self._last = packet
        with self._lock:
            receivers = list(self._clients) if self._port is None else [(packets.GROUP, self._port)]
        for receiver in receivers:
            self._socket.sendto(packet, receiver)

    def start(self, time: float = 0.0) -> None:
        """Send frames in the background, in real time, from a time of the motions on [s]."""

        def stream() -> None:
            begin, number = clock.monotonic(), 0
            while not self._is_closed.wait(max(begin + number / self._rate - clock.monotonic(), 0.0)):
                self.send(time + number / self._rate)
                number += 1

        self._run(stream)

    def _run(self, work: Callable[[], None]) -> None:
        thread = threading.Thread(target=work, name="motion capture server", daemon=True)
        self._threads.append(thread)
        thread.start()

    def _answer_clients(self) -> None:
        """Answer requests until the server is closed."""
        while not self._is_closed.is_set():
            try:
                packet, sender = self._socket.recvfrom(65_536)
                kind = packet_kind(packet)
            except (TimeoutError, ConnectionError, NatNetError):  # nothing, or no packet of this protocol
                continue
            if (answer := self._answer(kind, sender)) is not None:
                self._socket.sendto(answer, sender)

    def _answer(self, kind: int, sender: tuple[str, int]) -> bytes | None:
        """Answer to a request, or None."""
        match kind:
            case Kind.CONNECT:
                with self._lock:
                    self._clients.add(sender)
                return packets.server_info(self._version, multicast=self._port is not None, port=self._port or 1511)
            case Kind.DISCONNECT:
                with self._lock:
                    self._clients.discard(sender)
            case Kind.REQUEST_MODEL:
                return packets.model(self._version, list(self._motions), everything=False)
            case Kind.REQUEST_FRAME:
                return self._last
            case Kind.REQUEST:
                return packets.packet(_UNRECOGNIZED, b"")
        return None

    def _frame(self, time: float) -> bytes:
        bodies: list[packets.Body] = []
        for number, (name, motion) in enumerate(self._motions.items(), 1):
            is_tracked = not any(first <= time < last for first, last in self._occlusions.get(name, ()))
            if is_tracked or name not in self._seen:
                self._seen[name] = motion.at(time) if is_tracked else Pose()
            pose = self._seen[name]  # of old where it is not tracked, as Motive's
            w, *xyz = motive_quaternions(quaternion_of(pose.rotation), self._axes)
            bodies.append((number, motive_positions(pose.position, self._axes), (*xyz, w), is_tracked))
        return packets.frame(self._version, self._number, bodies, max(time + self._clock_offset, 0.0))
