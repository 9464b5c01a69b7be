"""An independent decoder, of the package natnet, against ours."""

from __future__ import annotations

from typing import Any

import pytest

import doubles.natnet_packets as made
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
