"""Options that several commands of `radarcore sensor` have."""

from __future__ import annotations

import argparse


def factor_of_real_time(text: str) -> float | None:
    """Factor of real time, None for as fast as it goes."""
    try:
        return None if text == "max" else float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number or max, got {text!r}") from None


def add_port(parser: argparse.ArgumentParser) -> None:
    """Add the argument ``PORT``."""
    parser.add_argument(
        "port",
        nargs="?",
        metavar="PORT",
        help="/dev/ttyACM0, COM3, usb:BUS-ADDRESS or usb:VENDOR:PRODUCT (default: the first board that responds)",
    )
