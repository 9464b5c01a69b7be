"""Live motion capture: a client of the stream of Motive, also in the background."""

from __future__ import annotations

import select
import socket
import struct
import threading
import time as clock
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import inf
from typing import Protocol

import numpy as np

from radarcore import check, notice
from radarcore.adapters.optitrack.capture import AXES, CapturedBody, MotionCapture, positions_of, quaternions_of
from radarcore.adapters.optitrack.natnet import (
    BodyState,
    Kind,
    ModelNames,
    NatNetError,
    NatNetFrame,
    ServerInfo,
    Version,
    checked_version,
    decode_frame,
    decode_model,
    decode_server_info,
    packet_kind,
)
from radarcore.geometry.pose import Pose


@dataclass(frozen=True)
class CapturedFrame:
    """A frame of live motion capture.

    Attributes
    ----------
    number : int
        Of the frame; those between are lost.
    time : float
        Middle of the exposure, by the server's clock [s].
    bodies : mapping of str to BodyState
        Rigid bodies, and bones as ``skeleton:bone``, by name, in Motive's axes.
    poses : mapping of str to Pose
        Of the bodies that are tracked, in the axes of the client.
    received : float
        Time at which the frame came, as of `time.time` [s].

    See Also
    --------
    adapters.optitrack.MotionCaptureClient.frames : They come from there.

    Examples
    --------
    >>> with rc.adapters.optitrack.MotionCaptureClient(command_port=motive.command_port) as client:
    ...     frames = client.frames()
    ...     motive.send(0.5)
    ...     frame = next(frames)
    >>> print(frame.time, frame.bodies["ball"].is_tracked)
    0.5 True
    """

    number: int
    time: float
    bodies: Mapping[str, BodyState]
    poses: Mapping[str, Pose]
    received: float


def one_take(frames: Iterator[CapturedFrame]) -> Iterator[CapturedFrame]:
    """Frames up to the end of a take: until it starts again, or no more frames come."""
    last: CapturedFrame | None = None
    try:
        for frame in frames:
            if last is not None and frame.time < last.time:
                return
            last = frame
            yield frame
    except TimeoutError:
        if last is None:
            raise


def capture_of(frames: list[CapturedFrame], axes: str) -> MotionCapture:
    """Frames as a take; NaN where a body is not tracked."""
    names = list(dict.fromkeys(name for frame in frames for name in frame.bodies))
    bodies = {}
    for name in names:
        rows = np.full((len(frames), 8), np.nan)
        for k, frame in enumerate(frames):
            state = frame.bodies.get(name)
            if state is not None and state.is_tracked:
                rows[k] = [*state.position, *state.quaternion, state.mean_marker_error]
        bodies[name] = CapturedBody(positions_of(rows[:, :3], axes), quaternions_of(rows[:, 3:7], axes), rows[:, 7])
    times = np.array([frame.time for frame in frames])
    rate = float(1.0 / np.median(np.diff(times))) if len(times) > 1 else None
    return MotionCapture(time=times, bodies=bodies, frame_rate=rate)


_POLL = 0.005
"""Time after which a wait for frames looks again [s]."""


class Follower:
    """Frames that a client receives in the background."""

    def __init__(self, frames: Iterator[CapturedFrame], axes: str, *, keep: bool) -> None:
        self._frames, self._axes, self._keep = frames, axes, keep
        self._kept: list[CapturedFrame] = []
        self.newest: CapturedFrame | None = None
        """The newest frame, or None before the first."""
        self._count = 0
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="motion capture", daemon=True)
        self._thread.start()

    def __len__(self) -> int:
        """Number of frames that have come."""
        return self._count

    def capture(self) -> MotionCapture:
        """All frames so far, up to the end of the take; an error of the stream is raised."""
        self.check()
        if not self._keep:
            raise ValueError("capture: expected frames that are kept, got the newest alone; give follow(keep=True)")
        return capture_of(list(self._kept), self._axes)

    def check(self) -> None:
        """Raise the error of the stream, if there was one."""
        if self._error is not None:
            raise self._error

    def wait(self, num_frames: int) -> None:
        """Wait until some frames have come; an error of the stream is raised."""
        while self._count < num_frames and self._thread.is_alive():
            self._thread.join(_POLL)
        self.check()

    def join(self) -> None:
        """Wait for the end."""
        self._thread.join()

    def _run(self) -> None:
        try:
            for frame in one_take(self._frames) if self._keep else self._frames:
                if self._keep:
                    self._kept.append(replace(frame, poses={}))  # a tenth as large
                self.newest = frame
                self._count += 1
        except Exception as error:  # raised where the user sees it
            self._error = error


_REPEAT = 0.25
"""Time after which a request without an answer is made again [s]."""

_KEEP_ALIVE = 1.0
"""Time between signs of life to the server [s]."""

_LOOK_UP = 0.05
"""Longest wait for a packet before the client sees that it is to stop, or has to ask again [s]."""

_LATE = 0.1
"""A frame that is older than the one before by less than this [s] is late, not of another take."""

_LONGEST = 65_536
"""Bytes of a packet."""

_NUM_OFFSETS = 1000
"""Frames, 4 to 10 s of them: clocks drift by less than 0.5 ms meanwhile."""


class Updated(Protocol):
    """A motion that takes poses as they come, such as `Live`."""

    def update(self, time: float, pose: Pose, /) -> None:
        """The pose at a time [s]."""
        ...


class MotionCaptureClient:
    """Receives frames that Motive streams; packets of other senders are ignored.

    Use it in a ``with`` statement, which connects::

        with MotionCaptureClient("192.168.1.20") as client:
            for frame in client.frames():
                print(frame.time, frame.poses["radar"].position)

    Frames come by multicast or to this client alone, as the server says.

    Parameters
    ----------
    server : str
        Address of the computer with Motive.
    command_port : int
        Its port for commands.
    local_address : str, optional
        Address of this computer's network interface for multicast, where it has several.
    timeout : float
        Longest wait for an answer, and for a frame [s].
    axes : "z_up", "z_up_world" or "unchanged"
        As for `read_motive_csv`.

    Raises
    ------
    TimeoutError
        When the server does not answer, or sends no frame, within the time-out.
    NatNetError
        When the server's version is before 3.0, or nothing but damaged packets comes within the time-out.

    See Also
    --------
    adapters.optitrack.read_motive_csv : Takes from files.
    Live : Motions that follow the stream.

    Examples
    --------
    >>> with rc.adapters.optitrack.MotionCaptureClient(command_port=motive.command_port) as client:
    ...     frames = client.frames()
    ...     motive.send(0.5)
    ...     print(client.names, next(frames).poses["ball"].position.round(3))
    ('ball',) [1.75 0.   1.  ]
    """

    def __init__(
        self,
        server: str = "127.0.0.1",
        *,
        command_port: int = 1510,
        local_address: str = "",
        timeout: float = 2.0,
        axes: str = "z_up",
    ) -> None:
        self._address = (server, check.port("command_port", command_port))
        self._local_address = local_address
        self._timeout = check.positive("timeout", timeout, "s")
        self._axes = check.choice("axes", axes, AXES)
        self._command: socket.socket | None = None
        self._data: socket.socket | None = None
        self._info: ServerInfo | None = None
        self._model = ModelNames()
        self._host = server
        self._strangers: set[str] = set()
        self._damage: NatNetError | None = None
        self._clock_offsets: deque[float] = deque(maxlen=_NUM_OFFSETS)
        self._last_time = -inf
        self._next_sign = 0.0

    def __enter__(self) -> MotionCaptureClient:
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def connect(self) -> None:
        """Ask the server for its version and its names, and join its multicast group if it has one.

        See Also
        --------
        adapters.optitrack.MotionCaptureClient : A ``with`` block connects and closes by itself.

        Examples
        --------
        >>> client = rc.adapters.optitrack.MotionCaptureClient(command_port=motive.command_port)
        >>> client.connect()
        >>> print(client.info.version)
        (4, 1)
        >>> client.close()
        """
        self.close()
        try:
            self._host = socket.gethostbyname(self._address[0])
        except socket.gaierror as error:
            raise ConnectionError(f"server: expected an address, got {self._address[0]!r} ({error.strerror})") from None
        self._damage = None
        self._strangers.clear()
        self._command = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            try:
                self._command.bind((self._local_address, 0))
            except OSError as error:
                raise ConnectionError(
                    f"local_address: expected an address of this computer, got {self._local_address!r} "
                    f"({error.strerror})"
                ) from error
            self._info = decode_server_info(self._answer(Kind.CONNECT, b"Ping\0", Kind.SERVER_INFO))
            checked_version(self._info.version)
            if self._info.is_multicast:
                self._data = self._joined(self._info)
            self._model = decode_model(self._answer(Kind.REQUEST_MODEL, b"", Kind.MODEL), self._info.version)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Take leave of the server.

        See Also
        --------
        adapters.optitrack.MotionCaptureClient : A ``with`` block connects and closes by itself.

        Examples
        --------
        >>> client = rc.adapters.optitrack.MotionCaptureClient(command_port=motive.command_port)
        >>> client.connect()
        >>> client.close()
        >>> print(client.names)
        ('ball',)
        """
        if self._command is not None and self._info is not None:
            self._send(Kind.DISCONNECT)
        for one in (self._command, self._data):
            if one is not None:
                one.close()
        self._command, self._data, self._info = None, None, None
        self._last_time = -inf
        self._clock_offsets.clear()

    @property
    def info(self) -> ServerInfo:
        """Name, versions and ports of the server."""
        if self._info is None:
            raise ValueError("client: expected a connection, got none; use it in a `with` statement, or connect()")
        return self._info

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the rigid bodies and of the bones, which are ``skeleton:bone``."""
        groups = (*self._model.skeletons.values(), *self._model.assets.values())
        return (*self._model.bodies.values(), *(f"{name}:{bone}" for name, bones in groups for bone in bones.values()))

    @property
    def clock_offset(self) -> float | None:
        """Time to add to times of frames for times of `time.time` [s], from the fastest of the last frames.

        None before the first frame, and of servers that do not say when a frame departs. It is too large by the
        shortest transmission time of a frame, about 0.1 ms by cable.
        """
        return min(self._clock_offsets, default=None)

    def frames(self, motions: Mapping[str, Updated] | None = None) -> Iterator[CapturedFrame]:
        """Frames as they arrive, without end; late frames are dropped.

        Parameters
        ----------
        motions : mapping of str to Live, optional
            Motions to update, by name of the body; bodies that are not tracked in a frame are not updated.

        See Also
        --------
        adapters.optitrack.MotionCaptureClient.follow : In the background.
        adapters.optitrack.CapturedFrame : A received frame.

        Examples
        --------
        >>> with rc.adapters.optitrack.MotionCaptureClient(command_port=motive.command_port) as client:
        ...     ball = rc.Live()
        ...     frames = client.frames({"ball": ball})
        ...     motive.send(0.5)
        ...     print(next(frames).number, ball.at(0.5).position.round(3))
        1 [1.75 0.   1.  ]
        """
        return self._frames(self.info.version, self._checked(motions), None)

    def record(self, duration: float, motions: Mapping[str, Updated] | None = None) -> MotionCapture:
        """Frames over a duration [s] of the server's clock; a shorter take ends them with a warning.

        See Also
        --------
        adapters.optitrack.MotionCapture : The result.
        adapters.optitrack.write_motive_csv : Saves it.

        Examples
        --------
        >>> with rc.adapters.optitrack.MotionCaptureClient(command_port=motive.command_port) as client:
        ...     motive.start()
        ...     print(client.record(0.05).names)
        ('ball',)
        """
        limit = check.positive("duration", duration, "s")
        kept: list[CapturedFrame] = []
        for frame in one_take(self.frames(motions)):
            if kept and frame.time - kept[0].time >= limit:
                break
            kept.append(replace(frame, poses={}))
        else:
            took = kept[-1].time - kept[0].time
            notice.warn(f"duration: expected {limit:g} s of frames, got {took:g} s: the take ended, or began again")
        return capture_of(kept, self._axes)

    @contextmanager
    def follow(self, motions: Mapping[str, Updated] | None = None, *, keep: bool | None = None) -> Iterator[Follower]:
        """Receive frames in the background, within a ``with`` statement.

        An error of the stream is raised at the end of the statement, and by `Follower.capture`.

        Parameters
        ----------
        motions : mapping of str to Live, optional
            As for `frames`.
        keep : bool, optional
            True: keep all frames for `Follower.capture`, up to the end of the take. False: keep only the newest frame,
            for hours of live motions. Default: True without motions.

        See Also
        --------
        adapters.optitrack.MotionCaptureClient.frames : Frame by frame.
        Live : Motion by the newest poses.

        Examples
        --------
        >>> with rc.adapters.optitrack.MotionCaptureClient(command_port=motive.command_port) as client:
        ...     ball = rc.Live()
        ...     with client.follow({"ball": ball}, keep=True) as following:
        ...         motive.start()
        ...         following.wait(3)  # or simulate meanwhile, with `ball` as a motion
        ...     print(len(following.capture().time) >= 3)
        True
        """
        stop = threading.Event()
        frames = self._frames(self.info.version, self._checked(motions), stop)
        follower = Follower(frames, self._axes, keep=not motions if keep is None else keep)
        try:
            yield follower
        finally:
            stop.set()
            follower.join()
        follower.check()

    def _checked(self, motions: Mapping[str, Updated] | None) -> dict[str, Updated]:
        """Motions of bodies that are in the stream."""
        for name in motions or ():
            if name not in self.names:
                raise ValueError(f"motions: no body {name!r} in the stream; {check.near_names(name, self.names)}")
        return dict(motions or {})

    def _frames(
        self, version: Version, updated: Mapping[str, Updated], stop: threading.Event | None
    ) -> Iterator[CapturedFrame]:
        """Frames, up to a time at which they are no longer wanted."""
        end = clock.monotonic() + self._timeout
        while (packet := self._next(Kind.FRAME, end, stop)) is not None:
            received = clock.time()
            try:
                raw = decode_frame(packet, version)
            except NatNetError as error:
                self._damage = error
                continue
            if raw.is_model_changed:
                self._send(Kind.REQUEST_MODEL)
            frame = self._named(raw, received)
            if self._last_time - _LATE < frame.time <= self._last_time:
                continue
            if frame.time <= self._last_time:  # a take that is played again
                for motion in updated.values():
                    getattr(motion, "clear", lambda: None)()
            self._last_time, self._damage = frame.time, None
            for name, motion in updated.items():
                if name in frame.poses:
                    motion.update(frame.time, frame.poses[name])
            yield frame
            end = clock.monotonic() + self._timeout

    def _named(self, raw: NatNetFrame, received: float) -> CapturedFrame:
        """Frame with names, and times in seconds."""
        frequency = float(self.info.clock_frequency)
        bodies = {self._model.bodies.get(body.id, f"body {body.id}"): body for body in raw.bodies}
        for states, known in ((raw.skeletons, self._model.skeletons), (raw.assets, self._model.assets)):
            for number, bones in states.items():
                name, names = known.get(number, (f"skeleton {number}", {}))
                for bone in bones:  # the upper bits identify its skeleton
                    member = bone.id & 0xFFFF
                    bodies[f"{name}:{names.get(member, f'bone {member}')}"] = bone
        if raw.transmitted_ticks > 0:
            self._clock_offsets.append(received - raw.transmitted_ticks / frequency)
        # Takes that are played back have no exposures.
        time = raw.exposure_ticks / frequency if raw.exposure_ticks > 0 else raw.timestamp
        poses = {
            name: Pose.from_quaternion(
                positions_of(np.array(body.position), self._axes),
                wxyz=quaternions_of(np.array(body.quaternion), self._axes),
            )
            for name, body in bodies.items()
            if body.is_tracked
        }
        return CapturedFrame(raw.number, time, bodies, poses, received)

    def _answer(self, request: Kind, payload: bytes, answer: Kind) -> bytes:
        """Answer to a request."""
        self._next_sign = 0.0
        packet = self._next(answer, clock.monotonic() + self._timeout, request=request, payload=payload)
        assert packet is not None  # nothing stops it
        self._damage = None
        return packet

    def _next(
        self,
        kind: Kind,
        end: float,
        stop: threading.Event | None = None,
        *,
        request: Kind = Kind.KEEP_ALIVE,
        payload: bytes = b"",
    ) -> bytes | None:
        """Next packet of a kind, None after `stop`; requests are repeated. A TimeoutError after the time `end`."""
        while (now := clock.monotonic()) < end:
            if stop is not None and stop.is_set():
                return None
            if now >= self._next_sign:
                self._next_sign = now + (_KEEP_ALIVE if request == Kind.KEEP_ALIVE else _REPEAT)
                self._send(request, payload)
            if (packet := self._next_packet(kind)) is not None:
                return packet
        if self._damage is not None and self._last_time == -inf:  # there never was a whole frame
            raise self._damage
        raise TimeoutError(self._no_packet(kind))

    def _no_packet(self, kind: Kind) -> str:
        """Message of a time-out."""
        server = f"motion capture server at {self._address[0]}:{self._address[1]} within {self._timeout:g} s"
        if kind != Kind.FRAME:
            text = (
                f"no answer ({kind.name}) from a {server}: does Motive run there with streaming enabled in its "
                "settings, is the address right, does a firewall stop UDP?"
            )
        else:
            info = self.info
            way = (
                f"multicast {info.multicast_address}:{info.data_port}; give local_address, the address of the network "
                "interface, if this computer has several"
                if info.is_multicast
                else "to this client alone"
            )
            text = f"no frame from the {server} ({way}): is it live, or playing a take?"
        return f"{text} Packets from {', '.join(sorted(self._strangers))} were ignored." if self._strangers else text

    def _next_packet(self, kind: Kind) -> bytes | None:
        """A packet of a kind, if one comes soon; names are taken from others that come."""
        if self._command is None:
            raise ValueError("client: expected a connection, got a closed one")
        sockets = [one for one in (self._command, self._data) if one is not None]
        for one in select.select(sockets, [], [], _LOOK_UP)[0]:
            try:
                packet, (host, _) = one.recvfrom(_LONGEST)
                if host != self._host:
                    self._strangers.add(host)
                    continue
                got = packet_kind(packet)
                if got == kind:
                    return packet
                if got == Kind.MODEL and self._info is not None:
                    self._model = decode_model(packet, self._info.version)
            except ConnectionError:  # Windows: no program listens at the requested port
                continue
            except NatNetError as error:
                self._damage = error
        return None

    def _send(self, kind: Kind, payload: bytes = b"") -> None:
        assert self._command is not None  # connected, or about to be
        self._command.sendto(struct.pack("<HH", kind, len(payload)) + payload, self._address)

    def _joined(self, info: ServerInfo) -> socket.socket:
        """Socket that has joined the multicast group."""
        one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            one.bind(("", info.data_port))
            group = socket.inet_aton(info.multicast_address) + socket.inet_aton(self._local_address or "0.0.0.0")
            one.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
        except OSError as error:
            one.close()
            raise ConnectionError(
                f"multicast {info.multicast_address}:{info.data_port} cannot be joined ({error}); give local_address, "
                "of the network interface"
            ) from error
        return one
