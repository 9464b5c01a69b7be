"""Simulated, measured and true, as in figure 6 of the paper (Stetco et al., ICRA 2020), without hardware.

    python examples/figure6/run.py out/figure6

MuJoCo moves a robot arm with the radar, a cylinder and a person. Their poses are streamed as OptiTrack streams them,
and received over UDP. The radar's driver measures with an emulated BGT60TR13C, whose samples are another simulation of
the same laboratory: other noise, the measured receiver, its own clock, and lost packets. Simulated frames, measured
frames and motion capture go into one ROS bag for ``radarcore compare``.

The physics have the only clock. The board sets the pace: to measure a frame it advances the laboratory to the end of
that frame. So all times belong to the laboratory, at any speed of the computer.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from laboratory import CYLINDER_RADIUS, STEP, Laboratory

import radarcore as rc
from radarcore.adapters import ros
from radarcore.adapters.optitrack import MotionCaptureClient
from radarcore.cli.main import main as radarcore
from radarcore.sensor.emulator.faults import Faults
from radarcore.sensor.emulator.pty import PtyPort
from radarcore.virtual.source import Simulated

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests"))
from doubles.motive import MotionCaptureServer  # stands in for Motive

CLOCK_OFFSET = 0.1137
"""The board's clock shows 0 so long after the start: to be found again [s]."""

TRUNK_RADIUS = 0.13
"""Surface of the person before the axis of the trunk [m]."""

CAPTURE_RATE = 120.0
OCCLUSIONS = {"person": [(3.3, 3.5)]}
"""Times at which motion capture does not see a body [s]."""

PACKETS_LOST = 0.01
"""Of the board."""

START_NS = 1_700_000_000_000_000_000
VIEW_DEG = (90.0, 60.0)
BODIES = {"radar": "radar", "cylinder": "cylinder", "person": "person/trunk"}
# A frame in one slice of the board: a packet that is lost costs a frame, and no new start.
SETTINGS: dict[str, Any] = {
    "start_frequency": 60e9,
    "stop_frequency": 61e9,
    "num_samples": 64,
    "num_chirps": 40,
    "chirp_interval": 400e-6,
    "frame_interval": 25e-3,
}


class Followed:
    """A simulator of the laboratory that lets it go on to the end of every frame first."""

    def __init__(self, laboratory: Laboratory, simulator: rc.Simulator) -> None:
        self.laboratory, self.simulator, self.radar = laboratory, simulator, simulator.radar

    def with_radar(self, radar: rc.Radar) -> Followed:
        """Simulator for the radar that the board is set to."""
        return Followed(self.laboratory, self.simulator.with_radar(radar))

    def frame(self, time: float) -> rc.Frame:
        """The frame that starts at a time of the laboratory [s]."""
        self.laboratory.advance(time + self.radar.duration + STEP)
        return self.simulator.frame(time)


class Arrivals:
    """Poses of a body, put into the queue of what is to be recorded as they arrive."""

    def __init__(self, name: str, arrived: SimpleQueue[tuple[str, Any]]) -> None:
        self.name, self.arrived = name, arrived

    def update(self, time: float, pose: rc.Pose, /) -> None:
        """A pose of the stream."""
        self.arrived.put((self.name, (time, pose)))


def record(bag_path: Path, start: float, num_frames: int, ray_budget: int = 100_000) -> int:
    """Run the experiment into a bag; returns the number of frames that the driver has lost."""
    laboratory = Laboratory(start)
    live, radar_motion = laboratory.live, laboratory.live.motion(site="radar")
    of_bodies = {name: radar_motion if name == "radar" else live.geom_motion(geom) for name, geom in BODIES.items()}
    radar, noisier = rc.bgt60tr13c(**SETTINGS), rc.bgt60tr13c(**SETTINGS, receiver="measured")
    simulators = [
        rc.Simulator(
            live.scene, of, radar_motion=radar_motion, field_of_view_deg=VIEW_DEG, seed=seed, ray_budget=ray_budget
        )
        for seed, of in enumerate((radar, noisier))
    ]
    arrived: SimpleQueue[tuple[str, Any]] = SimpleQueue()
    num_simulated = num_captured = 0

    with MotionCaptureServer(of_bodies, rate=CAPTURE_RATE, drop_rate=0.01, occlusions=OCCLUSIONS) as server:

        def on_step(now: float) -> None:
            """Poses at the rate of the cameras, and a simulated frame as soon as one is over."""
            nonlocal num_simulated, num_captured
            if now >= start + num_captured / CAPTURE_RATE - 1e-9:
                server.send(now)
                num_captured += 1
            begin = start + num_simulated * radar.waveform.frame_interval
            if now >= begin + radar.duration:
                arrived.put(("simulated", simulators[0].frame(begin)))
                num_simulated += 1

        faults = Faults(seed=2)
        measured = Simulated(Followed(laboratory, simulators[1]), start=start + CLOCK_OFFSET)
        with (
            MotionCaptureClient(command_port=server.command_port, timeout=60.0) as client,
            rc.sensor.virtual_board(measured, speed=None, faults=faults) as board,
            PtyPort(board) as port,
            rc.open_sensor(port.path) as sensor,
            ros.BagWriter(bag_path, overwrite=True) as bag,
            client.follow({name: Arrivals(name, arrived) for name in BODIES}),
        ):
            achieved = sensor.configure(noisier, if_gain_db=33)  # whose phases of the receivers are calibrated
            laboratory.on_step.append(on_step)
            writers = {
                name: ros.FrameWriter(bag, of, topic=f"/{name}", start_ns=START_NS)
                for name, of in (("simulated", radar), ("measured", achieved))
            }

            def write(name: str, item: Any) -> None:
                if name in writers:
                    writers[name].append(item)
                else:
                    time, pose = item
                    stamp = START_NS + round(1e9 * time)
                    message = ros.to_pose_stamped(pose, time_ns=stamp, frame_id="world", types=bag.types)
                    bag.write(f"/optitrack/{name}/pose", message, stamp)

            for number, frame in enumerate(sensor.frames(num_frames, timeout=60.0)):
                # Data are lost, but not the answers to the start and the stop.
                faults.lost = PACKETS_LOST if number < num_frames - 1 else 0.0
                write("measured", frame)
                while not arrived.empty():
                    write(*arrived.get())
            laboratory.stop()
            while not arrived.empty():
                write(*arrived.get())
            return sensor.num_lost


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output", type=Path, help="directory of the bag and the report")
    parser.add_argument("--start", type=float, default=0.0, help="time of the laboratory at the start [s]")
    parser.add_argument("--frames", type=int, default=200, help="frames of the driver (default: %(default)s)")
    options = parser.parse_args(arguments)
    bag = options.output / "experiment.mcap"
    # The feet are faster than max_velocity for a few frames, and the rays of a frame are few, for speed.
    for text in ("has a radial speed of", "adaptive sampling ended"):
        warnings.filterwarnings("ignore", message=f".*{text}")
    num_lost = record(bag, options.start, options.frames)
    print(f"{bag}: {num_lost} frames lost; the board's clock is {options.start + CLOCK_OFFSET:.4f} s behind")
    return radarcore([*comparison(bag), "-o", str(options.output / "report.html")])


def comparison(bag: Path) -> list[str]:
    """Arguments of `radarcore` that compare what is in the bag."""
    radii = f"cylinder={CYLINDER_RADIUS},person={TRUNK_RADIUS}"
    sources = [f"{bag}:/simulated", f"{bag}:/measured", "--truth", str(bag)]
    return ["compare", *sources, "--radius", radii, "--offset", "auto", "--names", "simulated,emulated board"]


if __name__ == "__main__":
    sys.exit(main())
