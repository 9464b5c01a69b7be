"""Captures of TI's DCA1000: a target where it was put, in every order of samples; configurations that are refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from dca1000_files import Scene, commands, half_wavelength, setup, studio
from radarcore.processing.detection.detect import detect
from radarcore.recording.ti.capture import parts_of
from recordings import refused

SCENE = Scene()
WORDS = SCENE.numbers("lanes2", q_first=True)


def assert_target(recording: rc.Recording, scene: Scene, *, angles: bool = True) -> None:
    """The target of a scene stands out in every frame at its range, velocity and angles."""
    assert len(recording) == scene.num_frames
    waveform = recording.radar.waveform
    for frame in recording.frames():
        found = detect(frame)
        best = int(np.argmax(found.snr_db))
        middle = scene.range + scene.velocity * (frame.time + 0.5 * waveform.duration)
        assert abs(found.range[best] - middle) < 1e-3 * waveform.range_resolution
        # Amplitudes of 1000 codes, rounded: noise 68 dB below each sample, 100 dB after the transforms.
        assert abs(found.velocity[best] - scene.velocity) < 1e-4 * waveform.velocity_resolution
        if angles:
            # The files have plane waves, the fit has the spheres of 3 m: up to 0.45 mrad.
            assert found.azimuth[best] == pytest.approx(scene.azimuth, abs=1e-3)


def write(path: Path, words: np.ndarray[Any, Any], config: str) -> tuple[Path, Path]:
    words.tofile(path / "adc_data.bin")
    (path / "profile.cfg").write_text(config)
    return path / "adc_data.bin", path / "profile.cfg"


@pytest.mark.parametrize(
    ("order", "output", "swap"),
    [("lanes2", 2, 0), ("lanes2", 0, 0), ("lanes4", 1, 0), ("lanes4", 0, 0), ("lanes4", 2, 1)],
)
def test_target_of_a_capture_is_where_it_was(tmp_path: Path, order: str, output: int, swap: int) -> None:
    words = SCENE.numbers(order, real=output == 0, q_first=swap == 1)
    is_apart = order == "lanes2"
    data, config = write(tmp_path, words, commands(SCENE, output=output, swap=swap, apart=int(is_apart)))
    recording = rc.Recording.load(data, config=config)
    assert recording.cube.shape == (2, 8, 16, 64)
    assert recording.cube.dtype == (np.float32 if output == 0 else np.complex64)
    assert recording.source["cube_unit"] == "counts"
    assert recording.source["capture"]["output"] == ["real", "complex 1x", "complex 2x"][output]
    assert_target(recording, SCENE)


def test_every_number_comes_to_its_place(tmp_path: Path) -> None:
    """Two lanes of 18xx: the sample of a transmitter, receiver, loop and time is the closed form's, rounded."""
    data, config = write(tmp_path, WORDS, commands(SCENE))
    recording = rc.Recording.load(data, config=config)
    rng = np.random.default_rng(1)
    for _ in range(50):
        frame, turn, rx, loop, n = (int(rng.integers(length)) for length in (2, 2, 4, 16, 64))
        time = frame * 50e-3 + (2 * loop + turn) * 47e-6
        assert recording.cube[frame, 4 * turn + rx, loop, n] == SCENE.chirp(time, SCENE.masks[turn])[rx, n]


def test_radar_has_the_settings_of_the_configuration(tmp_path: Path) -> None:
    (tmp_path / "a.cfg").write_text(commands(SCENE))
    (tmp_path / "a.mmwave.json").write_text(json.dumps(studio(SCENE)))
    (tmp_path / "a.setup.json").write_text(json.dumps({"mmWaveDevice": "awr1843"}))
    radar = rc.load_radar(tmp_path / "a.cfg")
    wf = radar.waveform
    assert (wf.start_frequency, wf.slope, wf.sample_rate) == pytest.approx((77e9, 60e12, 6e6), rel=1e-12)
    assert (wf.num_samples, wf.num_chirps) == (64, 16)
    assert (wf.chirp_interval, wf.frame_interval, wf.adc_delay) == pytest.approx((94e-6, 50e-3, 6e-6), rel=1e-12)
    assert radar.schedule is not None
    assert radar.schedule.interval == pytest.approx(47e-6, rel=1e-12)
    half = 0.5 * wf.wavelength
    np.testing.assert_allclose(radar.rx[:, 1] / half, [0, 1, 2, 3])
    np.testing.assert_allclose(radar.tx[:, 1:] / half, [[0, 0], [4, 0]])
    assert rc.load_radar(tmp_path / "a.mmwave.json") == radar


def test_transmitters_in_any_order_come_to_their_channels(tmp_path: Path) -> None:
    """Turns TX3, TX1, TX2 twice in a loop: three transmitters, twice the chirps; TX2 is higher."""
    scene = Scene(
        masks=(4, 1, 2) * 2, num_loops=8, elevation=np.deg2rad(12.0), azimuth=np.deg2rad(-15.0), velocity=-1.0
    )
    data, config = write(tmp_path, scene.numbers("lanes2", q_first=True), commands(scene))
    recording = rc.Recording.load(data, config=config)
    assert recording.cube.shape == (2, 12, 16, 64)
    assert recording.radar.schedule is not None
    assert recording.radar.schedule.order == (2, 0, 1)
    assert_target(recording, scene)
    found = detect(recording[0])
    assert found.elevation[int(np.argmax(found.snr_db))] == pytest.approx(
        scene.elevation, abs=2e-3
    )  # of two rows, likewise


def test_setup_of_mmwave_studio_loads_its_files_as_one_capture(tmp_path: Path) -> None:
    """A frame lies in two files; the setup has Windows paths."""
    words = SCENE.numbers("lanes2")
    words[:9001].tofile(tmp_path / "adc_data_Raw_0.bin")
    words[9001:].tofile(tmp_path / "adc_data_Raw_1.bin")
    path = setup(tmp_path, studio(SCENE), ["adc_data_Raw_0.bin", "adc_data_Raw_1.bin"])
    recording = rc.Recording.load(path)
    assert recording.source["files"] == ["adc_data_Raw_0.bin", "adc_data_Raw_1.bin"]
    assert recording.source["capture"]["device"] == "awr1843"
    assert_target(recording, SCENE)
    same = rc.Recording.load(tmp_path / "adc_data_Raw_0.bin", config=path)
    np.testing.assert_array_equal(same.cube, recording.cube)
    with pytest.raises(ValueError, match=r"Raw_1\.bin: expected the first file of a capture, got a continuation of"):
        rc.Recording.load(tmp_path / "adc_data_Raw_1.bin", config=path)
    reader = rc.Recording.load(path)
    np.testing.assert_array_equal([frame.cube for frame in reader], recording.cube)
    assert parts_of(tmp_path / "other_0.bin") == (tmp_path / "other_0.bin",)  # another capture may be other_1.bin


def test_frame_that_is_not_whole_is_left_out_with_a_warning(tmp_path: Path) -> None:
    data, config = write(tmp_path, WORDS[:-7], commands(SCENE))
    size = WORDS.nbytes // 2
    with pytest.warns(UserWarning, match=rf"adc_data\.bin: 1 frames, the last {size - 14} bytes are no whole frame"):
        recording = rc.Recording.load(data, config=config)
    assert len(recording) == 1
    data.write_bytes(b"\0" * 100)
    refused(rf"expected frames of {size} bytes by the configuration, got 100 bytes", data, config=config)


def test_errors_of_the_board_are_compensated(tmp_path: Path) -> None:
    """Feeds that alternate by 180 degrees and lines 7 cm too long: the commands that TI's demo prints undo both.

    Every channel of the chip has a pair, by the number of its transmitter, then of its receiver: TX2, in the middle,
    sends nothing here.
    """
    feeds = {1: [1.0, -0.8, 1.0, -1.0], 4: [0.5j, -1.0, 1.0, -1.0]}
    pairs = [0.5 / np.array(feed) for feed in (feeds[1], [0.1, 0.2, 0.3, 0.4], feeds[4])]
    command = " ".join(f"{factor.real:.5f} {factor.imag:.5f}" for factor in np.concatenate(pairs))
    board = Scene(range=SCENE.range + 0.07, feeds=feeds)
    data, config = write(
        tmp_path,
        board.numbers("lanes2", q_first=True),
        commands(SCENE, compensation=f"compRangeBiasAndRxChanPhase 0.07 {command}"),
    )
    recording = rc.Recording.load(data, config=config)
    assert_target(recording, SCENE)
    best = rc.strongest_peak(recording[0])
    assert best is not None
    assert best.range == pytest.approx(SCENE.range + 0.5 * SCENE.velocity * recording.radar.waveform.duration, abs=0.01)
    weights = recording.radar.channel_weights
    assert weights is not None
    assert np.ptp(np.abs(recording.cube[0, :, 0, 0] * weights)) < 2.0  # two roundings
    assert weights[4] == pytest.approx(-1j)
    assert recording.source["capture"]["range_bias"] == 0.07
    # Real samples are not changed; the weights hold for their spectra.
    words = board.numbers("lanes2", real=True)
    real = {"output": 0, "swap": 0}
    line = f"compRangeBiasAndRxChanPhase 0.07 {command}"
    data, config = write(tmp_path, words, commands(SCENE, compensation=line, **real))
    with pytest.warns(UserWarning, match=r"profile\.cfg: real samples have no phase, so the range bias of 0\.07 m is "):
        recording = rc.Recording.load(data, config=config)
    assert recording.cube[0, 1, 0, 0] == board.chirp(0.0, 1)[1, 0].real
    found = detect(recording[0])
    assert found.azimuth[found.snr_db.argmax()] == pytest.approx(SCENE.azimuth, abs=1e-3)


def test_zeros_in_place_of_lost_packets_are_counted(tmp_path: Path) -> None:
    """The recorder writes zeros: for half of frame 1 and all of frame 2 of four."""
    scene = Scene(num_frames=4)
    words = scene.numbers("lanes2", q_first=True)
    length = len(words) // 4
    words[3 * length // 2 : 3 * length] = 0
    data, config = write(tmp_path, words, commands(scene))
    with pytest.warns(UserWarning, match=r"zeros in place of about 34 lost packets, in frame 1 \(49%\), frame 2"):
        recording = rc.Recording.load(data, config=config)
    assert recording.source["capture"]["lost_packets"] == 34
    assert recording.lost is not None
    assert recording.lost.tolist() == [0, 0, 1]
    assert recording.time == pytest.approx([0.0, 0.05, 0.15])
    assert recording.cube[2, 0, 0, 0] == scene.chirp(0.15, 1)[0, 0]
    # A lost packet is detected wherever it begins.
    whole = scene.numbers("lanes2", q_first=True)
    for start in (0, 1, 363, 364, 365, 5000):
        words = whole.copy()
        words[start : start + 728] = 0
        data, config = write(tmp_path, words, commands(scene))
        with pytest.warns(UserWarning, match=r"zeros in place of about 1 lost packets, in frame 0"):
            rc.Recording.load(data, config=config)
    data, config = write(tmp_path, 0 * words, commands(scene))
    with pytest.warns(UserWarning, match="all samples are zeros"):
        assert len(rc.Recording.load(data, config=config)) == 4


def test_lost_packets_and_counters_are_named(tmp_path: Path) -> None:
    data, config = write(tmp_path, np.delete(WORDS, slice(5 * 728, 6 * 728)), commands(SCENE))
    with pytest.warns(UserWarning, match="no whole frame"):
        rc.Recording.load(data, config=config)


def packets_of(sent: bytes, start: int = 0) -> list[bytes]:
    """User's Guide 5.2: the packet's number from 1 in 32 bits, the bytes before it in 48, the lowest first."""
    return [
        ((start + at) // 1456 + 1).to_bytes(4, "little") + (start + at).to_bytes(6, "little") + sent[at : at + 1456]
        for at in range(0, len(sent), 1456)
    ]


def test_packets_come_to_the_places_of_their_counters(tmp_path: Path) -> None:
    """Two of four frames lose packets, one of them all; others are late or come twice."""
    scene = Scene(num_frames=4)
    words = scene.numbers("lanes2", q_first=True)
    assert words.nbytes % 1456  # the last packet is shorter
    whole, config = write(tmp_path, words, commands(scene))
    expected = rc.Recording.load(whole, config=config).cube
    per_frame = words.nbytes // 4
    packets = packets_of(words.tobytes())
    lost = {5, 6, *range(per_frame // 1456, 2 * per_frame // 1456 + 1)}
    zeroed = bytearray(words.tobytes())
    for index in lost:
        zeroed[1456 * index : 1456 * (index + 1)] = bytes(1456)
    kept = [packet for index, packet in enumerate(packets) if index not in lost]
    kept[10], kept[12] = kept[12], kept[10]
    path = tmp_path / "packets.bin"
    for start in (0, 3 * per_frame):  # from the start, and of a recorder that came three frames later
        moved = [
            (int.from_bytes(packet[:4], "little") + start // 1456).to_bytes(4, "little")
            + (int.from_bytes(packet[4:10], "little") + start).to_bytes(6, "little")
            + packet[10:]
            for packet in [*kept, kept[7]]
        ]
        path.write_bytes(b"".join([*moved[:-2], moved[-1], moved[-2]]))
        with pytest.warns(UserWarning, match=rf"zeros in place of {len(lost)} lost packets, in frame 0 .*frame 1"):
            recording = rc.Recording.load(path, config=config)
        assert recording.source["capture"]["lost_packets"] == len(lost)
        assert recording.lost is not None
        assert recording.lost.tolist() == [0, 1, 0]
        np.testing.assert_array_equal(recording.cube[2], expected[3])
        (tmp_path / "adc_data.bin").write_bytes(zeroed)
        with pytest.warns(UserWarning, match="zeros in place of about"):
            np.testing.assert_array_equal(recording.cube, rc.Recording.load(whole, config=config).cube)
    assert recording.time == pytest.approx([0.0, 0.1, 0.15])
    path.write_bytes(b"".join(packets))
    np.testing.assert_array_equal(rc.Recording.load(path, config=config).cube, expected)
    damaged = [*packets[:4], packets[4][:4] + (3 * 1456 + 8).to_bytes(6, "little") + packets[4][10:], *packets[5:]]
    path.write_bytes(b"".join(damaged))
    refused("packets of the DCA1000 one after the other, got damaged counters", path, config=config)


# TI's tables: half wavelengths to the left and up of the transmitters by their masks, of the receivers, and their
# feeds. 2944: 0.8 wavelengths. 6844: 2.54 mm. 6432: 2.418 mm.
MM, LOW = 2.54e-3 / half_wavelength(), 2.418e-3 / half_wavelength()
BOARDS: dict[str, dict[str, Any]] = {
    "xWR14xx": {},
    "xWR68xx": {},
    "xWR18xx_AOP": {"places": {1: (0, 2), 2: (0, 1), 4: (0, 0)}, "rx": ((3, 0), (2, 0), (1, 0), (0, 0))},
    "xWR68xx_AOP": {
        "places": {1: (0, 0), 2: (2, -2), 4: (0, -2)},
        "rx": ((1, -1), (1, 0), (0, -1), (0, 0)),
        "feeds": {mask: [1, -1, 1, -1] for mask in (1, 2, 4)},
    },
    "IWR6843ISK-ODS": {
        "places": {1: (0, 0), 2: (2, 0), 4: (2, -2)},
        "rx": ((0, 0), (0, -1), (1, -1), (1, 0)),
        "feeds": {mask: [1, -1, -1, 1] for mask in (1, 2, 4)},
    },
    "xWR29xx": {"places": {1: (0, 0), 2: (2, 1.6), 4: (4, 0), 8: (8, 0)}},
    "xWRL6844EVM": {
        "places": {1: (2 * MM, 2 * MM), 2: (0, 2 * MM), 4: (0, 0), 8: (2 * MM, 0)},
        "rx": ((0, MM), (0, 0), (MM, 0), (MM, MM)),
        "feeds": {1: [-1] * 4, 2: [1] * 4, 4: [-1] * 4, 8: [1] * 4},
    },
    "xWRL6432": {
        "places": {1: (0, 0), 2: (LOW, 0)},
        "rx": ((0, 0), (LOW, LOW), (2 * LOW, 0)),
        "feeds": {1: [1, -1, 1], 2: [-1, 1, -1]},
    },
}


def board_scene(platform: str) -> Scene:
    changes = BOARDS[platform]
    masks = tuple(changes.get("places", {1: 0, 2: 0, 4: 0}))
    angles = {"azimuth": np.deg2rad(17.0), "elevation": np.deg2rad(-9.0)}
    return Scene(range=6.0, velocity=-0.5, masks=masks, num_loops=8, num_frames=1, **angles, **changes)


def assert_angles(recording: rc.Recording, scene: Scene) -> None:
    found = detect(recording[0])
    best = int(np.argmax(found.snr_db))
    assert found.azimuth[best] == pytest.approx(scene.azimuth, abs=2e-3)
    assert found.elevation[best] == pytest.approx(scene.elevation, abs=3e-3)


def l_commands(scene: Scene, **changes: str) -> str:
    """Commands of the L-SDK for the profile of `dca1000_files`, on an xWRL6844."""
    lines = {
        "channelCfg": "channelCfg 255 255 0",
        "chirpComnCfg": f"chirpComnCfg {200 / 6!r} 0 0 64 1 40 0",
        "chirpTimingCfg": "chirpTimingCfg 7 36 0 60 77",
        "frameCfg": f"frameCfg {len(scene.masks) * scene.num_loops} 0 5000 1 50 0",
        "board": "antGeometryBoard xWRL6844EVM",
        "sensorStart": "sensorStart 0 0 0 0",
    } | changes
    return "\n".join(lines.values()) + "\n"


LOW_POWER = {  # TI's demo for the BOOST board; sampling at 100 MHz over a divisor
    "channelCfg": "channelCfg 7 3 0",
    "chirpComnCfg": f"chirpComnCfg {100 / 6!r} 0 0 64 1 40 0",
    "board": "antGeometryCfg 0 0 1 1 0 2 0 1 1 2 0 3 2.418 2.418",
    "compensation": "compRangeBiasAndRxChanPhase 0.0 1 0 -1 0 1 0 -1 0 1 0 -1 0",
    "adcLogging": "adcLogging 1 0 2 0 0",
}


@pytest.mark.filterwarnings("ignore:radar. expected a channel spacing")  # 2944, 6844 and 6432 at 77 GHz
@pytest.mark.parametrize("platform", BOARDS)
def test_boards_find_a_target_at_its_angles_without_a_calibration(tmp_path: Path, platform: str) -> None:
    scene = board_scene(platform)
    is_real, is_of_rows = platform in ("xWR29xx", "xWRL6844EVM"), platform == "xWR14xx"
    order = "rdif" if platform == "xWRL6432" else "lanes4" if is_of_rows else "lanes2"
    words = scene.numbers(order, real=is_real, q_first=not is_real)
    output = {"output": 0, "swap": 0} if is_real else {"apart": int(not is_of_rows)}
    text = commands(scene, platform=platform, compensation="", **output)
    if "WRL" in platform:
        text = l_commands(scene, **(LOW_POWER if platform == "xWRL6432" else {}))
    if platform == "xWR29xx":
        text = text.replace("8 0 50.0 1 0", "8 0 64 50.0 1 0")
    data, config = write(tmp_path, words, text)
    recording = rc.Recording.load(data, config=config)
    assert_angles(recording, scene)
    if "feeds" in BOARDS[platform]:
        assert recording.radar.channel_weights is not None
    if order == "rdif":
        samples = recording.cube.reshape(2, 3, 8, 64)
        for turn, loop in ((0, 0), (1, 5)):
            time = (2 * loop + turn) * 47e-6
            np.testing.assert_array_equal(samples[turn, :, loop], scene.chirp(time, 1 << turn).real)


@pytest.mark.parametrize(
    ("platform", "lines"),
    [
        (
            "xWR68xx_AOP",
            "antGeometry0 -1 -1 0 0 -3 -3 -2 -2 -1 -1 0 0\nantGeometry1 -1 0 -1 0 -3 -2 -3 -2 -3 -2 -3 -2\n"
            "antPhaseRot -1 1 -1 1 -1 1 -1 1 -1 1 -1 1",
        ),
        (
            "IWR6843ISK-ODS",
            "antGeometry0 0 0 -1 -1 -2 -2 -3 -3 -2 -2 -3 -3\nantGeometry1 0 -1 -1 0 0 -1 -1 0 -2 -3 -3 -2\n"
            "antPhaseRot 1 -1 -1 1 1 -1 -1 1 1 -1 -1 1",
        ),
        ("xWR68xx", "antGeometry0 0 -1 -2 -3 -2 -3 -4 -5 -4 -5 -6 -7\nantGeometry1 -1 -1 -1 -1 0 0 0 0 -1 -1 -1 -1"),
        ("xWR29xx", "antGeometryCfg 1 0 1 1 1 2 1 3 0 2 0 3 0 4 0 5 1 4 1 5 1 6 1 7 1 8 1 9 1 10 1 11 0.5 0.8"),
        (
            "xWRL6844EVM",
            "antGeometryTX 2 2 2 0 0 0 0 2\nantGeometryRx 1 0 0 0 0 1 1 1\nantGeometryDist 2.54 2.54\n"
            "compRangeBiasAndRxChanPhase 0.0" + 2 * (4 * " -1 0" + 4 * " 1 0"),
        ),
    ],
)
def test_geometry_of_the_file_is_that_of_its_board(tmp_path: Path, platform: str, lines: str) -> None:
    scene = board_scene(platform)
    if "L6844" in platform:
        named, given = l_commands(scene), l_commands(scene, board=lines)
    else:
        named = commands(scene, platform=platform, compensation="")
        given = commands(scene, platform="", compensation="", geometry=lines)
    (tmp_path / "named.cfg").write_text(named)
    (tmp_path / "given.cfg").write_text(given)
    by_name, by_file = (rc.load_radar(tmp_path / name) for name in ("named.cfg", "given.cfg"))
    places = by_file.virtual_array - by_name.virtual_array
    np.testing.assert_allclose(places - places[0], 0.0, atol=1e-12)
    if by_name.channel_weights is None:
        assert by_file.channel_weights is None
    else:
        np.testing.assert_array_equal(by_file.channel_weights, by_name.channel_weights)


def test_masks_of_the_in_cabin_demo_have_a_bit_per_antenna(tmp_path: Path) -> None:
    """TI's demo for the same board: geometry by channels, and feeds among the compensations."""
    lines = (
        "antGeometry0 -2 -2 -3 -3 0 0 -1 -1 0 0 -1 -1 -2 -2 -3 -3\n"
        "antGeometry1 0 -1 -1 0 0 -1 -1 0 -2 -3 -3 -2 -2 -3 -3 -2\nantPhaseRot" + 16 * " 1" + "\n"
        "compRangeBiasAndRxChanPhase 0" + 2 * (4 * " 1 0" + 4 * " -1 0")
    )
    scene = board_scene("xWRL6844EVM")
    (tmp_path / "board.cfg").write_text(l_commands(scene))
    (tmp_path / "cabin.cfg").write_text(l_commands(scene, channelCfg="channelCfg 15 15 0", board=lines))
    board, cabin = (rc.load_radar(tmp_path / f"{name}.cfg") for name in ("board", "cabin"))
    steps = np.diff(board.virtual_array, axis=0) / 2.54e-3
    np.testing.assert_allclose(np.diff(cabin.virtual_array, axis=0) / half_wavelength(), steps, atol=1e-6)
    assert board.channel_weights is not None
    assert cabin.channel_weights is not None
    np.testing.assert_array_equal(cabin.channel_weights, -board.channel_weights)


@pytest.mark.parametrize(
    ("line", "position", "forward"),
    [
        # 2 m above the floor, turned 30 degrees to the right, 15 down.
        ("sensorPosition 2 30 15", [0, 0, 2], [np.sqrt(0.75), -0.5, -np.tan(np.deg2rad(15))]),
        ("sensorPosition 0.5 1 2 0 -15", [1, -0.5, 2], [1, 0, np.tan(np.deg2rad(15))]),
    ],
)
def test_place_of_the_sensor_is_a_pose(tmp_path: Path, line: str, position: list[float], forward: list[float]) -> None:
    data, config = write(tmp_path, WORDS, commands(SCENE, place=line))
    recording = rc.Recording.load(data, config=config)
    recording.save(tmp_path / "saved")
    pose = rc.Pose.from_rpy(**rc.Recording.load(tmp_path / "saved").source["capture"]["mount"])
    np.testing.assert_allclose(pose.position, position)
    np.testing.assert_allclose(pose.rotation[:, 0], np.array(forward) / np.linalg.norm(forward), atol=1e-12)
    assert pose.rotation[2, 1] == pytest.approx(0.0)  # no roll


def test_measured_compensations_have_the_feeds_in_them(tmp_path: Path) -> None:
    """As TI's visualizer writes them for the AOP."""
    line = "compRangeBiasAndRxChanPhase 0.0" + 6 * " 1 0 -1 0"
    (tmp_path / "a.cfg").write_text(commands(SCENE, platform="xWR68xx_AOP", compensation=line))
    weights = rc.load_radar(tmp_path / "a.cfg").channel_weights
    assert weights is not None
    np.testing.assert_array_equal(weights, 2 * [1, -1, 1, -1])


def test_low_power_chips_have_the_settings_of_their_commands(tmp_path: Path) -> None:
    """Files of TI's demos: 6844, and 6432 in bursts of one chirp per transmitter."""
    path = tmp_path / "a.cfg"
    path.write_text(
        "channelCfg 153 255 0\nchirpComnCfg 8 0 0 256 1 13.1 3\nchirpTimingCfg 6 63 0 160 58\n"
        "frameCfg 64 0 1358 1 100 0\nantGeometryBoard xWRL6844EVM\nsensorStart 0 0 0 0\n"
    )
    radar = rc.load_radar(path)
    waveform = radar.waveform
    assert (waveform.start_frequency, waveform.slope, waveform.sample_rate) == pytest.approx((58e9, 160e12, 25e6))
    assert (waveform.num_samples, waveform.num_chirps, len(radar.tx), len(radar.rx)) == (256, 16, 4, 4)
    assert waveform.adc_delay == pytest.approx(63 / 25e6)
    assert (waveform.chirp_interval, waveform.frame_interval) == pytest.approx((4 * 19.1e-6, 0.1))
    assert radar.is_real
    lines = (
        "channelCfg 7 3 0\nchirpComnCfg 15 5 0 128 1 34 3\nchirpTimingCfg 6 26 1 47.95 60\nframeCfg 2 0 600 64 200 0\n"
        "antGeometryCfg 0 0 1 1 0 2 0 1 1 2 0 3 2.418 2.418\n"
        "compRangeBiasAndRxChanPhase 0.0 1 0 -1 0 1 0 -1 0 1 0 -1 0\n"
    )
    path.write_text(lines)
    radar = rc.load_radar(path)
    waveform = radar.waveform
    assert waveform.sample_rate == pytest.approx(100e6 / 15)
    assert (waveform.num_chirps, waveform.chirp_interval) == (64, pytest.approx(600e-6))
    assert radar.schedule is not None
    assert radar.schedule.interval == pytest.approx(40e-6)
    steps = (radar.virtual_array - radar.virtual_array[0])[:, 1:] / 2.418e-3
    np.testing.assert_allclose(steps, [[0, 0], [1, 1], [2, 0], [1, 0], [2, 1], [3, 0]], atol=1e-9)
    assert radar.channel_weights is not None
    np.testing.assert_array_equal(radar.channel_weights, [1, -1, 1, -1, 1, -1])
    # Samples over SPI: `shape` has their order, by the script of TI's tools that calls ``ar_convertAdcData_xWRLx432``.
    np.arange(2 * 6 * 64 * 128, dtype="<i2").tofile(tmp_path / "adc.bin")
    shape = "frame,chirp,tx,rx,sample"
    cube = rc.Recording.load(tmp_path / "adc.bin", config=path, dtype="int16", shape=shape).cube
    assert cube.shape == (2, 6, 64, 128)
    for old, new, message in (
        ("128 1 34", "128 4 34", "transmitters that take turns .chirpComnCfg, pattern 1., got 4"),
        ("frameCfg 2 0", "frameCfg 2 12", "chirps one by one .frameCfg., got sums of 12"),
        ("frameCfg 2 0", "frameCfg 4 0", "bursts of one chirp per transmitter, or without pauses"),
        ("frameCfg 2 0 600 64", "frameCfg 3 0 600 1", "equal numbers of chirps per transmitter"),
        ("Comn", "comn", "expected the command chirpComnCfg, got none"),
        ("channelCfg", "adcLogging 1 1 2 0\nchannelCfg", "known bits .adcLogging 1 0 2 0, or 0., got 1 1 2 0"),
        ("channelCfg", "adcLogging 1\nchannelCfg", "known bits .adcLogging 1 0 2 0, or 0., got 1"),
        ("15 5 0 128", "15 5 0 126", "expected a multiple of four samples, got 126"),
    ):
        path.write_text(lines.replace(old, new) + "adcLogging 1 0 2 0 0\n" * ("Logging" not in new))
        with pytest.raises(ValueError, match=message):
            rc.load_radar(path)


def test_order_of_i_and_q_can_be_set(tmp_path: Path) -> None:
    """The configuration says Q first; the capture has I first."""
    data, config = write(tmp_path, SCENE.numbers("lanes2"), commands(SCENE))
    assert_target(rc.Recording.load(data, config=config, iq_order="IQ"), SCENE)
    swapped = rc.Recording.load(data, config=config).cube
    np.testing.assert_array_equal(swapped, rc.Recording.load(data, config=config, iq_order="QI").cube)
    refused("iq_order: expected one of 'IQ', 'QI'|iq_order: expected 'IQ' or 'QI'", data, config=config, iq_order="qi")
    config.write_text(commands(SCENE, output=0, swap=0))
    refused("iq_order: expected none for real samples, got 'IQ'", data, config=config, iq_order="IQ")


def test_unknown_board_is_a_row_with_a_warning(tmp_path: Path) -> None:
    (tmp_path / "a.cfg").write_text(commands(SCENE, platform=""))
    with pytest.warns(UserWarning, match=r"a\.cfg: unknown board; its 2 transmitters are assumed to be a row"):
        radar = rc.load_radar(tmp_path / "a.cfg")
    steps = np.diff(radar.virtual_array[:, 1]) / (0.5 * radar.waveform.wavelength)
    np.testing.assert_allclose(steps, 1.0)
    (tmp_path / "b.cfg").write_text(commands(Scene(masks=(1, 2)), platform="xWR16xx"))
    radar = rc.load_radar(tmp_path / "b.cfg")  # whose TX2 is where others have TX3
    np.testing.assert_allclose(radar.tx[:, 1:] / (0.5 * radar.waveform.wavelength), [[0, 0], [4, 0]])


def test_samples_of_12_bits_get_their_sign(tmp_path: Path) -> None:
    scene = Scene(masks=(1,), num_loops=2, num_frames=1)
    words = scene.numbers("lanes2", real=True) & 0x0FFF
    data, config = write(tmp_path, words, commands(scene, output=0, swap=0, adcCfg="adcCfg 0 0"))
    recording = rc.Recording.load(data, config=config)
    assert recording.radar.schedule is None
    cube = recording.cube
    assert cube[0, 0, 0, 5] == scene.chirp(0.0, 1)[0, 5].real
    assert cube.min() < -900.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"chirp0": "chirpCfg 0 0 0 0 0 0 0 3"}, "one transmitter per chirp .TDM., got the mask 0x3 of chirp 0"),
        ({"chirp0": "chirpCfg 0 0 0 1e6 0 0 0 1"}, "chirps as their profile has them, got changes of chirp 0"),
        ({"chirp0": "chirpCfg 0 0 1 0 0 0 0 1"}, r"chirps of one profile, got those of \[0, 1\]"),
        ({"channelCfg": "channelCfg 31 5 0"}, "a mask of up to 4 receivers, got 0x1f"),
        ({"bpmCfg": "bpmCfg -1 1 0 1"}, "got binary phase modulation"),
        ({"dfeDataOutputMode": "dfeDataOutputMode 3"}, "got sub-frames or no frames"),
        ({"lvdsStreamCfg": "lvdsStreamCfg -1 1 1 0"}, r"samples alone .*, got 1 1 0"),
        ({"frameCfg": "frameCfg 0 1 16 0 64 50 1 0 0"}, "line 11: expected 7 or 8 numbers after frameCfg, got 9"),
        ({"adcCfg": "adcCfg 2 0"}, "of the samples that adcbufCfg has"),
        ({"frameCfg": "frameCfg 0 2 16 0 50 1 0", "chirp2": "chirpCfg 2 2 0 0 0 0 0 1"}, "got TX1, TX3, TX1"),
        ({"profileCfg": "profileCfg 1 77 7 6 40 0 0 60 1 64 6000 0 0 30"}, "expected profileCfg 0"),
        (
            {"profileCfg": "profileCfg 0 77 -5 6 17 0 0 60 1 64 6000 0 0 30"},
            "between the ramps of transmitters in turn",
        ),
        ({"compensation": "compRangeBiasAndRxChanPhase 0.0 1 0"}, "expected 9 or 17 or 25 or 33 numbers .*, got 3"),
        ({"compensation": "compRangeBiasAndRxChanPhase 0.0" + 12 * " 0 0"}, "without zeros, got one for a channel"),
        ({"geometry": "antGeometry0 0 -1 -2 -3\nantGeometry1 0 0"}, "expected 4 or 8 or 12 numbers after antGeometry1"),
        (
            {"geometry": "antGeometry0 0 -1 -2 -3 -2 -3 -4 -9\nantGeometry1 0 0 0 0 0 0 0 0"},
            "all transmitters have the same receivers",
        ),
    ],
)
def test_commands_that_are_no_plain_frames_are_refused(tmp_path: Path, changes: dict[str, str], message: str) -> None:
    (tmp_path / "a.cfg").write_text(commands(SCENE, **changes))
    with pytest.raises(ValueError, match=message) as error:
        rc.load_radar(tmp_path / "a.cfg")
    assert str(error.value).startswith(str(tmp_path / "a.cfg"))


def _edited(values: dict[str, Any], *path: Any, to: Any) -> dict[str, Any]:
    part: Any = values["mmWaveDevices"][0]
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = to
    return values


@pytest.mark.parametrize(
    ("path", "to", "message"),
    [
        (("rfConfig", "waveformType"), "advancedFrameChirp", "frames without sub-frames"),
        (("rfConfig", "rlBpmChirps", 0, "rlBpmChirpCfg_t", "constBpmVal"), "0x5", "got binary phases"),
        (("rfConfig", "rlChirps", 1, "rlChirpCfg_t", "idleTimeVar_usec"), 1.5, "got idleTimeVar_usec of chirp 1"),
        (("rfConfig", "rlChanCfg_t", "rxChannelEn"), 10**400, "a mask of up to 4 receivers|expected an integer"),
        (("rfConfig", "rlProfiles"), [], "expected profile 0, which chirps have, got none"),
        (("rawDataCaptureConfig", "rlDevDataPathCfg_t", "transferFmtPkt0"), "0x6", "samples alone"),
        (("rawDataCaptureConfig", "rlDevLaneEnable_t", "laneEn"), "0x1", "two or four LVDS lanes, got 1"),
        (("rawDataCaptureConfig", "rlDevDataFmtCfg_t", "chInterleave"), 0, "receivers one after the other on 2 LVDS"),
    ],
)
def test_settings_of_mmwave_studio_are_refused_by_name(
    tmp_path: Path, path: tuple[Any, ...], to: Any, message: str
) -> None:
    (tmp_path / "a.mmwave.json").write_text(json.dumps(_edited(studio(SCENE), *path, to=to)))
    with pytest.raises(ValueError, match=message):
        rc.load_radar(tmp_path / "a.mmwave.json")


def test_setup_without_its_files_says_so(tmp_path: Path) -> None:
    path = setup(tmp_path, studio(SCENE), ["adc_data.bin"])
    refused(r"expected captured files beside it, got no adc_data\.bin", path)
    (tmp_path / "18xx.mmwave.json").unlink()
    refused(r"expected 18xx\.mmwave\.json beside it", path)


@pytest.mark.filterwarnings("ignore")
def test_damage_anywhere_is_a_value_error_or_a_radar(tmp_path: Path) -> None:
    """Bytes changed, cut out and put in, at places of two seeds."""
    texts = {"a.cfg": commands(SCENE), "a.mmwave.json": json.dumps(studio(SCENE))}
    pieces = [b"999", b"-", b"1e400", b"nan", b"[]", b"{}", b"null", b'"x"', b"\n", b"0x", b"\xff"]
    outcomes, messages = set(), []
    for name, text in texts.items():
        rng = np.random.default_rng(len(name))
        for _ in range(100):
            data = bytearray(text.encode())
            at, length = int(rng.integers(len(data))), int(rng.choice([0, 1, 20]))
            data[at : at + length] = pieces[int(rng.integers(len(pieces)))]
            (tmp_path / name).write_bytes(data)
            try:
                outcomes.add(type(rc.load_radar(tmp_path / name)))
            except ValueError as error:
                messages.append(str(error))
    assert outcomes == {rc.Radar}
    assert len(messages) > 10
    assert all(message.startswith(str(tmp_path / "a.")) for message in messages)
