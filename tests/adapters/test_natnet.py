"""Packets of NatNet 3.0 to 4.2: the same poses in all versions, bad packets refused."""

from __future__ import annotations

import dataclasses
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import doubles.natnet_packets as made
import radarcore as rc
from doubles.motive_files import TO_MOTIVE, motive_file
from radarcore.adapters.optitrack import (
    NatNetError,
    decode_frame,
    decode_model,
    decode_server_info,
    read_motive_csv,
)
from radarcore.adapters.optitrack.capture import positions_of, quaternions_of

VERSIONS = [(3, 0), (3, 1), (4, 0), (4, 1), (4, 2)]
BODIES: list[made.Body] = [
    (1, (0.5, 1.25, -0.75), (0.5, -0.5, 0.5, 0.5), True),
    (2, (2.0, 0.25, 4.0), (0.0, 0.0, 0.0, 1.0), False),
]


@pytest.mark.parametrize("version", VERSIONS)
def test_all_versions_decode_to_the_same_poses(version: made.Version) -> None:
    found = decode_frame(made.frame(version, 17, BODIES, 12.5), version)
    assert (found.number, found.timestamp, found.exposure_ticks) == (17, 12.5, 125_000_000)
    assert (found.received_ticks, found.transmitted_ticks) == (125_020_000, 125_040_000)
    # Halves and quarters are exact in 32 bits.
    assert [body.position for body in found.bodies] == [(0.5, 1.25, -0.75), (2.0, 0.25, 4.0)]
    assert [body.quaternion for body in found.bodies] == [(0.5, 0.5, -0.5, 0.5), (1.0, 0.0, 0.0, 0.0)]
    assert [body.is_tracked for body in found.bodies] == [True, False]
    assert found.bodies[0].mean_marker_error == pytest.approx(2e-4)
    assert not found.is_model_changed


@pytest.mark.parametrize("version", VERSIONS)
def test_other_things_in_a_frame_do_not_disturb(version: made.Version) -> None:
    plain = decode_frame(made.frame(version, 17, BODIES, 12.5), version)
    full = decode_frame(made.frame(version, 17, BODIES, 12.5, everything=True), version)
    assert full.bodies == plain.bodies
    assert [dataclasses.replace(bone, id=bone.id & 0xFFFF) for bone in full.skeletons[3]] == list(plain.bodies)
    assert full.assets == ({9: plain.bodies[:1]} if version >= (4, 1) else {})
    labelled, loose = full.markers
    assert (labelled.model, labelled.member, labelled.is_occluded, labelled.is_unlabelled) == (1, 2, True, False)
    assert (loose.model, loose.member, loose.is_occluded, loose.is_unlabelled) == (0, 7, False, True)
    assert loose.position == (1.0, 2.0, 3.0)
    assert full.timestamp == 12.5
    assert full.is_model_changed
    assert not full.is_recording


@pytest.mark.parametrize("version", VERSIONS)
def test_names_are_those_of_the_model(version: made.Version) -> None:
    found = decode_model(made.model(version, ["radar", "Mühle"]), version)
    assert found.bodies == {1: "radar", 2: "Mühle"}
    assert found.skeletons == {3: ("Fred", {1: "Hip", 2: "Chest"})}
    assert found.assets == ({9: ("Tool", {1: "Grip"})} if version >= (4, 1) else {})


def test_server_says_its_version_and_its_group() -> None:
    found = decode_server_info(made.server_info((4, 1), multicast=True, port=1522))
    assert (found.name, found.version, found.clock_frequency) == ("Motive", (4, 1), 10_000_000)
    assert (found.is_multicast, found.data_port, found.multicast_address) == (True, 1522, "239.255.42.99")
    # Versions before 3.0 say nothing else.
    old = made.packet(1, b"Motive".ljust(256, b"\0") + bytes([1, 9, 0, 0, 2, 9, 0, 0]))
    assert decode_server_info(old).version == (2, 9)


@pytest.mark.parametrize("version", [(3, 0), (4, 1)])
@pytest.mark.parametrize("kind", ["frame", "model"])
def test_every_truncation_is_an_error(version: made.Version, kind: str) -> None:
    whole = made.frame(version, 1, BODIES, 0.5, everything=True) if kind == "frame" else made.model(version, ["radar"])
    decode: Any = decode_frame if kind == "frame" else decode_model
    # The last four bytes of a frame are a zero that says its end.
    last = len(whole) - (4 if kind == "frame" else 0)
    for size in range(last):
        with pytest.raises(NatNetError, match="packet: expected"):
            decode(whole[:size], version)
        if size >= 4:  # with a header that agrees
            with pytest.raises(NatNetError, match="packet: expected"):
                decode(whole[:2] + struct.pack("<H", size - 4) + whole[4:size], version)


def test_random_bytes_are_errors_or_frames_and_never_hang() -> None:
    rng = np.random.default_rng(0)
    whole = bytearray(made.frame((4, 1), 1, BODIES, 0.5, everything=True))
    for _ in range(300):
        damaged = bytearray(whole)
        for place in rng.integers(4, len(whole), 3):
            damaged[place] = rng.integers(256)
        try:
            decode_frame(bytes(damaged), (4, 1))
        except NatNetError as error:
            assert str(error).startswith("packet: expected")  # noqa: PT017  # not all of them are damaged


@pytest.mark.parametrize(
    ("packet", "version", "message"),
    [
        (made.frame((3, 0), 1, BODIES, 0.0), (2, 9), r"version: expected NatNet 3\.0 to 4\.x, got 2\.9; set it in Mot"),
        (made.frame((4, 1), 1, BODIES, 0.0), (5, 0), r"version: expected NatNet 3\.0 to 4\.x, got 5\.0"),
        (made.packet(8, b"hello\0"), (4, 1), r"packet: expected one of kind 7 \(FRAME\), got 8"),
        (made.packet(4711, b""), (4, 1), r"packet: expected one of kind 7 \(FRAME\), got 4711"),
        (b"\x07", (4, 1), "packet: expected at least 4 bytes, got 1"),
        (
            made.packet(7, struct.pack("<ii", 1, -5)),
            (3, 0),
            "packet: expected a count of things that fit into it, got -5",
        ),
        (made.packet(7, struct.pack("<ii", 1, 2**30)), (3, 0), "packet: expected a count of things that fit into it"),
        (made.packet(7, struct.pack("<iiii", 1, 1, 1, 65)), (3, 0), "packet: expected"),
        (made.frame((4, 1), 1, BODIES, 0.0), (4, 0), "packet: expected"),
    ],
)
def test_other_packets_and_versions_are_refused(packet: bytes, version: made.Version, message: str) -> None:
    with pytest.raises(NatNetError, match=message):
        decode_frame(packet, version)


def test_stream_and_file_have_the_same_poses(tmp_path: Path) -> None:
    pose = rc.Pose.from_rpy([1.0, 2.0, 3.0], [0.3, -0.4, 1.1])
    path = motive_file(tmp_path / "t1.csv", {"radar": lambda _: pose}, np.array([0.0, 0.01]))
    quaternion = Rotation.from_matrix(TO_MOTIVE @ pose.rotation @ TO_MOTIVE.T).as_quat()
    sent = made.frame((4, 1), 1, [(1, TO_MOTIVE @ pose.position, quaternion, True)], 0.0)
    (body,) = decode_frame(sent, (4, 1)).bodies
    for axes in ("z_up", "z_up_world", "unchanged"):
        expected = read_motive_csv(path, axes=axes)["radar"]
        # 32 bits.
        np.testing.assert_allclose(positions_of(np.array(body.position), axes), expected.position[0], atol=1e-6)
        turned = quaternions_of(np.array(body.quaternion), axes)
        np.testing.assert_allclose(
            Rotation.from_quat(turned, scalar_first=True).as_matrix(), expected.rotation[0], atol=1e-6
        )


@pytest.mark.parametrize("version", [(3, 0), (4, 0), (4, 1)])
def test_second_decoder_reads_the_same(version: made.Version) -> None:
    pytest.importorskip("natnet", reason="a second decoder: pip install natnet")
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
