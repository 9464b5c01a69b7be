"""Speed of the driver relative to a board in receiving frames: emulated board, pyusb's code, frames.

The emulated board sends as fast as it is read, and both ends share this process; the time of the board's end is
measured separately; "driver" is the rest of the time over CDC. A board sends a frame per frame interval, here the
shortest that its chirps allow at 40 Hz or below.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

import radarcore as rc
from page import DOCS, printed_into
from radarcore.sensor import open_sensor
from radarcore.sensor.bgt60.registers import start_words
from radarcore.sensor.bgt60.settings import Settings, achieved, choose_slice_size, registers_of
from radarcore.sensor.emulator.strata import CdcBoard, Controller
from radarcore.sensor.strata import packets
from radarcore.sensor.strata.packets import Avian, Code, Component, Data, Request

sys.path.append(str(Path(__file__).parents[1] / "tests"))

from doubles.usb_bus import EmulatedBus, cdc_device, vendor_device  # of the tests
from doubles.vendor_board import VendorBoard

FRAMES = {  # chirps, samples
    "3 x 8 x 64": (8, 64),
    "3 x 16 x 64": (16, 64),
    "3 x 64 x 64": (64, 64),
    "3 x 64 x 128": (64, 128),
}


class Constant:
    """Equal codes for every frame: only the transport of the bytes is measured."""

    def __init__(self) -> None:
        self.codes = np.zeros((0, 0, 0), np.uint16)

    def frame(self, radar, *_, **__):
        """Random codes, made once."""
        wf = radar.waveform
        shape = (radar.num_channels, wf.num_chirps, wf.num_samples)
        if self.codes.shape != shape:
            self.codes = np.random.default_rng(0).integers(0, 4096, shape).astype(np.uint16)
        return self.codes


def frames_per_second(transport: str, radar: rc.Radar, num_frames: int) -> float:
    """Frames that come through the driver, per second."""
    controller = Controller(Constant(), speed=None)
    bus = EmulatedBus()
    bus.plug(cdc_device(CdcBoard(controller)) if transport == "cdc" else vendor_device(VendorBoard(controller)))
    # Room for whatever is measured ahead of this thread: a sensor drops what is not taken in time.
    with open_sensor(usb_backend=bus, queue_size=1_000_000) as sensor:
        sensor.configure(radar)
        frames = sensor.frames(num_frames)
        next(frames)
        began = time.perf_counter()
        number = sum(1 for _ in frames)
        elapsed = time.perf_counter() - began
        assert sensor.num_lost == 0
    controller.close()
    return number / elapsed


def board_alone(radar: rc.Radar, num_frames: int) -> float:
    """Frames that the emulated board makes per second, as bytes that nobody looks at."""
    controller = Controller(Constant(), speed=None)
    board = CdcBoard(controller)
    settings = achieved(Settings.from_radar(radar))
    slice_size = choose_slice_size(settings)
    words = start_words(registers_of(settings, slice_size))
    for request in (
        Request.write(Code.DATA, Data.CONFIGURE, 0, packets.data_configuration(slice_size)),
        Request.write(Code.DATA, Data.START, 0),
        Request.write(Code.COMPONENT, Component.AVIAN, Avian.EXECUTE, packets.encode_commands(words)),
    ):
        board.receive(packets.encode_request(request))
    num_bytes = num_frames * settings.frame_size * 3 // 2
    board.send(512, 1.0)
    began = time.perf_counter()
    while num_bytes > 0:
        num_bytes -= len(board.send(15872, 1.0))
    elapsed = time.perf_counter() - began
    controller.close()
    return num_frames / elapsed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tiny", action="store_true", help="once, quickly")
    parser.add_argument("--write", action="store_true", help="write the section of docs/sensor.md")
    options = parser.parse_args()
    with printed_into(DOCS / "sensor.md", "sensor", write=options.write):
        print_rates(options.tiny)


def print_rates(is_tiny: bool) -> None:
    """Rates of every kind of frame, and their ratios to a board."""
    print(f"{'frame [rx x chirp x sample]':<28} {'board':>8} {'cdc':>16} {'vendor':>16} {'driver':>16}")
    for name, (chirps, samples) in FRAMES.items():
        interval = 591.125e-6  # as at power-up
        frame_interval = max(25e-3, chirps * interval + 2e-3)
        radar = rc.bgt60tr13c(
            num_chirps=chirps, num_samples=samples, chirp_interval=interval, frame_interval=frame_interval
        )
        board = 1.0 / achieved(Settings.from_radar(radar)).frame_time
        number = 20 if is_tiny else max(200, round(40 * board))
        rates = [frames_per_second(transport, radar, number) for transport in ("cdc", "vendor")]
        rates.append(1.0 / max(1.0 / rates[0] - 1.0 / board_alone(radar, number), 1e-6))
        cells = [f"{rate:8.0f} {f'({rate / board:.0f} x)':>7}" for rate in rates]
        print(f"{name:<28} {board:8.1f} {cells[0]:>16} {cells[1]:>16} {cells[2]:>16}")


if __name__ == "__main__":
    main()
