"""An independent decoder and client, of the package natnet, against ours and our server."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

import doubles.natnet_packets as made
import radarcore as rc
from doubles.motive import MotionCaptureServer
from doubles.motive_files import TO_MOTIVE
from radarcore.adapters.optitrack import decode_frame, decode_model

natnet = pytest.importorskip("natnet", reason="a second decoder: pip install natnet")

BODIES: list[made.Body] = [
    (1, (0.5, 1.25, -0.75), (0.5, -0.5, 0.5, 0.5), True),
    (2, (2.0, 0.25, 4.0), (0.0, 0.0, 0.0, 1.0), False),
]


@pytest.mark.parametrize("version", [(3, 0), (4, 0), (4, 1)])
def test_second_decoder_reads_the_same(version: made.Version) -> None:
    from natnet.data_descriptions import DataDescriptions
    from natnet.data_frame import DataFrame
    from natnet.packet_buffer import PacketBuffer
    from natnet.version import Version

    def read(kind: Any, packet: bytes) -> Any:
        buffer = PacketBuffer(packet)
        buffer.pointer = 4
        return kind.read_from_buffer(buffer, Version(*version))

    packet = made.frame(version, 17, BODIES, 12.5, everything=True)
    ours, theirs = decode_frame(packet, version), read(DataFrame, packet)
    assert theirs.prefix.frame_number == ours.number
    for mine, other in zip(ours.bodies, theirs.rigid_bodies, strict=True):
        x, y, z, w = other.rot
        assert (other.id_num, tuple(other.pos), (w, x, y, z)) == (mine.id, mine.position, mine.quaternion)
        assert other.tracking_valid == mine.is_tracked
    assert [tuple(one.pos) for one in theirs.labeled_markers] == [one.position for one in ours.markers]
    assert theirs.suffix.stamp_camera_mid_exposure == ours.exposure_ticks

    packet = made.model(version, ["radar", "person"])
    names, descriptions = decode_model(packet, version), read(DataDescriptions, packet)
    assert {body.id_num: body.name for body in descriptions.rigid_bodies} == names.bodies
    assert [skeleton.name for skeleton in descriptions.skeletons] == [name for name, _ in names.skeletons.values()]


def test_second_client_receives_from_our_server() -> None:
    pose = rc.Pose.from_rpy([1.0, 2.0, 3.0], [0.0, 0.0, 0.5])
    received: list[Any] = []
    names: list[Any] = []
    with MotionCaptureServer({"radar": pose, "person": rc.Pose()}, version=(4, 0)) as server:
        client = natnet.NatNetClient("127.0.0.1", command_port=server.command_port, use_multicast=False)
        client.on_data_frame_received_event.handlers.append(received.append)
        client.on_data_description_received_event.handlers.append(names.append)
        client.connect(timeout=5.0)
        try:
            client.request_modeldef()
            server.send(0.25)
            end = time.monotonic() + 5.0
            while not (received and names) and time.monotonic() < end:
                client.update_sync()
                time.sleep(0.002)
        finally:
            client.shutdown()
    assert [body.name for body in names[0].rigid_bodies] == ["radar", "person"]
    np.testing.assert_allclose(received[0].rigid_bodies[0].pos, TO_MOTIVE @ pose.position, atol=1e-6)
    np.testing.assert_allclose(received[0].rigid_bodies[0].rot, [0.0, np.sin(0.25), 0.0, np.cos(0.25)], atol=1e-6)
    assert received[0].suffix.stamp_camera_mid_exposure == 2_500_000
