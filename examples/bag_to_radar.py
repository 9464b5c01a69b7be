"""What would a radar on a mobile robot have seen, by a bag with the poses of the robot and of a tracked cart?"""

import tempfile
from pathlib import Path

import numpy as np

import radarcore as rc
from radarcore.adapters import ros

START_NS = 1_700_000_000_000_000_000
radar = rc.bgt60tr13c(num_chirps=64, frame_interval=0.05)


def write_poses(path: Path) -> None:
    """A bag as a robot records it: its own pose by TF, the pose of the cart by motion capture."""
    with ros.BagWriter(path) as bag:
        for k in range(41):
            t, time_ns = 0.025 * k, START_NS + k * 25_000_000
            robot = {"base_link": rc.Pose([0.2 * t, 0.0, 0.5])}
            cart = rc.Pose.from_rpy([2.8 - 0.5 * t, 0.3 - 0.2 * t, 0.5], np.deg2rad([0.0, 0.0, 10.0 * t]))
            bag.write("/tf", ros.to_transforms(robot, time_ns=time_ns, frame_id="map", types=bag.types), time_ns)
            pose = ros.to_pose_stamped(cart, time_ns=time_ns, frame_id="map", types=bag.types)
            bag.write("/natnet_ros/cart/pose", pose, time_ns)


def simulate(path: Path) -> tuple[rc.Recording, int]:
    """The recording of a radar on the robot, and the stamp of its time 0 [ns]."""
    with ros.BagReader(path) as bag:
        recorded = ros.BagMotions(bag)
        cart = rc.Body(rc.shapes.sphere(0.2), motion=recorded.motion("/natnet_ros/cart/pose"), name="cart")
        robot = recorded.motion("/tf", frame="base_link", within="map")
        simulator = rc.Simulator(rc.Scene([cart]), radar, radar_motion=robot, field_of_view_deg=(50.0, 30.0))
        start, stop = recorded.span
        return simulator.record(start, stop - 0.05, rate=5.0), recorded.start_ns


def write_radar(path: Path, recording: rc.Recording, start_ns: int) -> None:
    """A bag with the samples, and with what is found in them."""
    with ros.BagWriter(path) as bag:
        ros.write_frames(bag, recording, start_ns=start_ns)
        for frame in recording.frames():
            found = rc.detect(frame)
            time_ns = start_ns + ros.nearest_nanoseconds(found.time)
            bag.write("/radar/scan", ros.to_radar_scan(found, time_ns=time_ns, types=bag.types), time_ns)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        write_poses(Path(folder) / "poses")
        recording, start_ns = simulate(Path(folder) / "poses")
        write_radar(Path(folder) / "radar.mcap", recording, start_ns)
        with ros.BagReader(Path(folder) / "radar.mcap") as bag:
            scans = [ros.from_radar_scan(found.message, start_ns=start_ns) for found in bag.messages("/radar/scan")]
    for scan, truth in zip(scans, map(recording.truth.__getitem__, range(len(scans))), strict=True):
        best = int(scan.snr_db.argmax())
        print(
            f"{scan.time:.3f} s: {scan.range[best]:.2f} m at {scan.velocity[best]:+.2f} m/s, "
            f"truth {truth.range[0]:.2f} m at {truth.velocity[0]:+.2f} m/s"
        )
