"""Client and server of live motion capture: poses, occlusions, lost frames, clocks, and servers that do not answer."""

from __future__ import annotations

import gc
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import doubles.natnet_packets as made
import radarcore as rc
from doubles.motive import MotionCaptureServer
from radarcore.adapters.optitrack import CapturedFrame, MotionCaptureClient, NatNetError

QUIET, PATIENT = 0.5, 10.0
"""Time-outs without and with packets [s]: a busy machine is late."""


def swing(t: float) -> rc.Pose:
    return rc.Pose.from_rpy([1.0 + 0.1 * np.sin(5.0 * t), 2.0, 3.0], [0.2, -0.3, t])


MOTIONS = {"radar": swing, "person": rc.Pose([4.0, 0.0, 1.0])}


@contextmanager
def connected(
    *, axes: str = "z_up", timeout: float = 2.0, **options: Any
) -> Iterator[tuple[MotionCaptureServer, MotionCaptureClient]]:
    """A server of `MOTIONS`, and its client."""
    with (
        MotionCaptureServer(MOTIONS, axes=axes, **options) as server,
        MotionCaptureClient(command_port=server.command_port, axes=axes, timeout=timeout) as client,
    ):
        yield server, client


class Told:
    """A motion that writes down its updates, as `Live` takes them."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self.poses: list[rc.Pose] = []

    def update(self, time: float, pose: rc.Pose) -> None:
        self.times.append(time)
        self.poses.append(pose)


def sent(server: MotionCaptureServer, times: Any, client: MotionCaptureClient, **given: Any) -> list[CapturedFrame]:
    """Frames that are sent at some times, each received before the next."""
    frames = client.frames(**given)
    received = []
    for t in times:
        server.send(t)
        received.append(next(frames))
    return received


@pytest.mark.parametrize(
    ("version", "axes"), [((3, 0), "z_up"), ((4, 0), "z_up_world"), ((4, 1), "unchanged"), ((4, 2), "z_up")]
)
def test_poses_arrive_as_they_were(version: made.Version, axes: str) -> None:
    with connected(version=version, axes=axes, clock_offset=100.0) as (server, client):
        assert client.names == ("radar", "person")
        assert client.info.version == version
        frames = sent(server, [0.25, 0.5], client)
    assert [frame.number for frame in frames] == [1, 2]
    for t, frame in zip([0.25, 0.5], frames, strict=True):
        assert frame.time == pytest.approx(100.0 + t, abs=1e-7)  # a tick
        np.testing.assert_allclose(frame.poses["radar"].position, swing(t).position, atol=1e-6)  # 32 bits
        np.testing.assert_allclose(frame.poses["radar"].rotation, swing(t).rotation, atol=1e-6)


def test_occluded_bodies_have_no_pose_and_do_not_update_motions() -> None:
    told = Told()
    with connected(occlusions={"radar": [(0.1, 0.3)]}) as (server, client):
        frames = sent(server, [0.0, 0.1, 0.2, 0.3], client, motions={"radar": told})
    assert ["radar" in frame.poses for frame in frames] == [True, False, False, True]
    assert all("person" in frame.poses for frame in frames)
    # Old positions come all the same, as of Motive.
    assert frames[1].bodies["radar"].position == frames[0].bodies["radar"].position
    assert told.times == [0.0, 0.3]
    np.testing.assert_allclose(told.poses[1].position, swing(0.3).position, atol=1e-6)


def test_recorded_stream_is_a_capture_with_gaps() -> None:
    with connected(occlusions={"radar": [(0.2, 0.4)]}) as (server, client), client.follow() as follower:
        for k in range(73):
            server.send(k / 120.0)
        follower.wait(73)
        capture = follower.capture()
    assert capture.names == ("radar", "person")
    assert capture.frame_rate == pytest.approx(120.0, rel=1e-4)
    trajectory = capture.trajectory("radar")
    np.testing.assert_allclose(trajectory.gaps[0], [23 / 120, 48 / 120], atol=1e-6)
    np.testing.assert_allclose(trajectory.at(0.503).position, swing(0.503).position, atol=2e-5)
    assert np.isnan(capture["radar"].position[30]).all()
    assert np.isnan(capture["radar"].mean_marker_error[30])
    assert capture["radar"].mean_marker_error[3] == pytest.approx(2e-4)


def test_server_in_the_background_keeps_its_rate_and_loses_its_share() -> None:
    with connected(rate=200.0, drop_rate=0.25, seed=3) as (server, client):
        server.start(5.0)
        before = time.time()
        capture = client.record(0.4)
        taken = time.time() - before
        assert client.clock_offset == pytest.approx(before - capture.time[0], abs=0.1)
    assert 0.35 < taken < 2.0
    lost = np.round(np.diff(capture.time) * 200.0) - 1.0
    # A quarter of 80 frames, but for three standard deviations.
    assert abs(lost.sum() / 80.0 - 0.25) < 3.0 * np.sqrt(0.25 * 0.75 / 80.0)
    np.testing.assert_allclose(np.diff(capture.time) * 200.0, lost + 1.0, atol=1e-3)


@contextmanager
def client_of(answers: dict[int, list[bytes]], timeout: float = PATIENT) -> Iterator[MotionCaptureClient]:
    """Client of a socket that answers kinds of packets by others."""
    stop = threading.Event()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        one.settimeout(0.02)

        def serve() -> None:
            while not stop.is_set():
                try:
                    packet, sender = one.recvfrom(65_536)
                except TimeoutError:
                    continue
                for answer in answers.get(packet[0], []):
                    one.sendto(answer, sender)

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            with MotionCaptureClient(command_port=one.getsockname()[1], timeout=timeout) as client:
                yield client
        finally:
            stop.set()
            thread.join()


BODY: made.Body = (1, (0.0, 1.0, 2.0), (0.0, 0.0, 0.0, 1.0), True)


def answers(version: made.Version, *packets: bytes) -> dict[int, list[bytes]]:
    return {0: [made.server_info(version)], 4: [made.model(version, ["radar"]), *packets]}


def test_late_frames_and_other_packets_are_left_out() -> None:
    times = [1.0, 1.01, 1.03, 1.02, 1.03, 1.04]
    packets = [made.frame((4, 1), k, [BODY], t) for k, t in enumerate(times)]
    packets.insert(3, made.packet(8, b"hello\0"))
    with client_of(answers((4, 1), *packets)) as client:
        frames = client.frames()
        assert [round(next(frames).time, 6) for _ in range(4)] == [1.0, 1.01, 1.03, 1.04]


def test_stray_and_damaged_packets_do_not_end_the_stream() -> None:
    packets = [made.frame((4, 1), k, [BODY], 1.0 + 0.01 * k) for k in range(4)]
    cut, overfull = packets[0][:60], packets[0].replace(made.pack("<i", 1), made.pack("<i", 2**30), 1)
    stray = [b"\x07", cut, made.packet(7, b"\0\0"), made.packet(5, b"\xff" * 9), overfull, b""]
    mixed = [packet for pair in zip(stray, packets + packets[3:] * 2, strict=True) for packet in pair]
    with client_of(answers((4, 1), *mixed), QUIET) as client:
        frames = client.frames()
        assert [round(next(frames).time, 6) for _ in range(4)] == [1.0, 1.01, 1.02, 1.03]
        with pytest.raises(TimeoutError, match="no frame"):
            next(frames)


def test_frames_of_other_senders_are_ignored() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        try:
            stranger.bind(("127.0.0.2", 0))
        except OSError:
            pytest.skip("this system has one loopback address alone")
        with connected(timeout=QUIET) as (server, client):
            assert client._command is not None
            stranger.sendto(
                made.frame((4, 1), 9, [(1, (9.0, 9.0, 9.0), BODY[2], True)], 5.0), client._command.getsockname()
            )
            (frame,) = sent(server, [0.25], client)
            assert frame.time == 0.25
            with pytest.raises(TimeoutError, match=r"no frame .* Packets from 127\.0\.0\.2 were ignored\."):
                next(client.frames())


@contextmanager
def sending(server: MotionCaptureServer, times: Any) -> Iterator[None]:
    """Frames of some times, one every 2 ms, in the background."""
    stop = threading.Event()

    def run() -> None:
        for t in times:
            if stop.wait(0.002):
                return
            server.send(float(t))

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


TAKE = np.arange(50) / 100.0


@pytest.mark.parametrize("times", [np.tile(TAKE, 200), TAKE, np.r_[TAKE, np.full(5000, TAKE[-1])]])
def test_a_recording_ends_with_the_take(times: Any) -> None:
    """A take in a loop, a take that ends, and a take that stops at its last frame."""
    with connected(timeout=QUIET) as (server, client), sending(server, times):
        before = time.monotonic()
        with pytest.warns(UserWarning, match=r"duration: expected 60 s of frames, got 0\.4\d* s: the take ended"):
            capture = client.record(60.0)
        assert time.monotonic() - before < 5.0
    assert capture.time[-1] == TAKE[-1]
    np.testing.assert_allclose(np.diff(capture.time), 0.01, atol=1e-6)


def test_live_motions_begin_again_with_the_take_and_keep_the_newest_frame_alone() -> None:
    live = rc.Live()
    with connected(timeout=PATIENT) as (server, client), client.follow({"radar": live}) as follower:
        for t in np.tile(TAKE, 3):
            server.send(float(t))
        follower.wait(150)
        assert follower.newest is not None
        assert (len(follower), follower.newest.number, live.newest) == (150, 150, TAKE[-1])
        frames = [one for one in gc.get_objects() if isinstance(one, CapturedFrame)]
        assert len(frames) <= 2  # the newest, and perhaps one that is being received
        with pytest.raises(ValueError, match=r"capture: expected frames that are kept, .* give follow\(keep=True\)"):
            follower.capture()


def test_skeletons_and_assets_have_names_with_their_owner() -> None:
    sent_frame = made.frame((4, 1), 1, [BODY], 1.0, everything=True)
    with client_of(answers((4, 1), sent_frame)) as client:
        assert client.names == ("radar", "Fred:Hip", "Fred:Chest", "Tool:Grip")
        assert list(next(client.frames()).poses) == ["radar", "Fred:Hip", "Tool:Grip"]


def test_takes_that_are_played_back_have_the_time_of_the_take() -> None:
    packet = made.frame((3, 0), 1, [BODY], 0.0)
    packet = packet[:-38] + made.pack("<d3Qhi", 7.25, 0, 0, 0, 0, 0)
    with client_of(answers((3, 0), packet)) as client:
        assert next(client.frames()).time == 7.25
        assert client.clock_offset is None


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def test_missing_server_is_an_error_with_its_address_within_the_time_out() -> None:
    port = free_port()
    before = time.monotonic()
    with pytest.raises(TimeoutError, match=rf"no answer .* at 127\.0\.0\.1:{port} within 0\.5 s: does Motive run"):
        MotionCaptureClient(command_port=port, timeout=QUIET).connect()
    assert time.monotonic() - before < QUIET + 1.0


def test_server_without_frames_is_an_error_with_a_hint() -> None:
    with connected(timeout=QUIET) as (_, client):
        with pytest.raises(TimeoutError, match=r"no frame from .* within 0\.5 s \(to this client alone\): is it live"):
            next(client.frames())
        with pytest.raises(TimeoutError, match="no frame"), client.follow() as follower:
            follower.wait(1)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({0: [made.server_info((2, 9))]}, r"version: expected NatNet 3\.0 to 4\.x, got 2\.9"),
        ({0: [made.server_info((4, 1))[:100]]}, "packet: expected 283 bytes, got 100: truncated"),
        (answers((4, 1), made.frame((4, 1), 1, [BODY], 0.0)[:60]), "packet: expected"),
    ],
)
def test_damaged_and_old_streams_are_refused(given: dict[int, list[bytes]], message: str) -> None:
    with pytest.raises(NatNetError, match=message), client_of(given, QUIET) as client:
        next(client.frames())


# 192.0.2.0/24 is for documentation: nobody has such an address.
@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: MotionCaptureClient("no such host").connect(), ConnectionError, "server: .* got 'no such host'"),
        (
            lambda: MotionCaptureClient(local_address="192.0.2.1").connect(),
            ConnectionError,
            r"local_address: expected an address of this computer, got '192\.0\.2\.1'",
        ),
        (lambda: MotionCaptureClient(command_port=99_999), ValueError, "command_port: expected at most 65535, got 99"),
        (lambda: MotionCaptureClient().frames(), ValueError, "client: expected a connection, got none"),
    ],
)
def test_wrong_requests_are_errors_that_name_them(call: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        call()


def test_unknown_body_is_an_error_that_suggests_near_names() -> None:
    with connected() as (_, client), pytest.raises(ValueError, match="no body 'rader' in the stream; did you mean 'ra"):
        client.frames({"rader": Told()})


def test_multicast_frames_reach_all_clients() -> None:
    with MotionCaptureServer(MOTIONS, multicast_port=free_port()) as server:
        local: dict[str, Any] = {"command_port": server.command_port, "local_address": "127.0.0.1"}
        with MotionCaptureClient(**local) as one, MotionCaptureClient(**local) as other:
            assert one.info.is_multicast
            server.send(0.5)
            for client in (one, other):
                np.testing.assert_allclose(next(client.frames()).poses["person"].position, [4.0, 0.0, 1.0], atol=1e-6)
