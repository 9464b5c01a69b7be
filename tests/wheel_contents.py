"""Checks of built wheels: `python tests/wheel_contents.py dist/*.whl`, with the standard library alone.

A wheel is small, holds the files of the package, the compiled core and what tells about them, nothing else, and asks
for no newer C library than its name says. Prints its size.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path
from zipfile import ZipFile

PACKAGE = Path(__file__).resolve().parents[1] / "python" / "radarcore"

LARGEST = 5_000_000
"""Size of a wheel that is not reached [bytes]."""

SUFFIXES = {".py", ".pyi", ".toml", ".typed"}
"""Of files that the package is made of."""

CORE = re.compile(r"radarcore/_core(\.abi3\.so|\.pyd)")

ABOUT = {"METADATA", "RECORD", "WHEEL", "entry_points.txt", "licenses/LICENSE", "sboms/radarcore.cyclonedx.json"}
"""Files that tell about the package."""


def package_files() -> set[str]:
    """Files of the source tree that belong into a wheel, by their names in it."""
    found = (path for path in PACKAGE.rglob("*") if path.suffix in SUFFIXES)
    return {f"radarcore/{path.relative_to(PACKAGE).as_posix()}" for path in found}


def newest_glibc(core: bytes) -> tuple[int, int]:
    """Version of the GNU C library that the compiled core asks for by its symbols, (0, 0) if it names none."""
    found = re.findall(rb"\0GLIBC_(\d+)\.(\d+)(?:\.\d+)?(?=\0)", core)
    return max(((int(major), int(minor)) for major, minor in found), default=(0, 0))


def faults(path: Path, expected: set[str]) -> list[str]:
    """Faults of a wheel that should hold the expected files of the package; empty for none."""
    wrong = []
    size = path.stat().st_size
    if size >= LARGEST:
        wrong.append(f"{path.name}: expected less than {LARGEST} bytes, got {size}")
    with ZipFile(path) as wheel:
        names = {info.filename for info in wheel.infolist() if not info.is_dir()}
        cores = {name for name in names if CORE.fullmatch(name)}
        glibc = max((newest_glibc(wheel.read(name)) for name in cores), default=(0, 0))
    if len(cores) != 1:
        wrong.append(f"{path.name}: expected one compiled core, got {sorted(cores)}")
    promised = re.search(r"manylinux_(\d+)_(\d+)", path.name)
    if promised and glibc > (int(promised[1]), int(promised[2])):
        wrong.append(f"{path.name}: expected symbols of that C library, got those of {glibc[0]}.{glibc[1]}")
    folder = "-".join(path.name.split("-")[:2]) + ".dist-info"
    wanted = expected | {f"{folder}/{name}" for name in ABOUT}
    wrong += [f"{path.name}: {name} should not be in it" for name in sorted(names - cores - wanted)]
    wrong += [f"{path.name}: {name} is missing" for name in sorted(wanted - names)]
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheels", nargs="+", type=Path)
    expected = package_files()
    wrong = []
    for path in parser.parse_args().wheels:
        print(f"{path.name}: {path.stat().st_size / 1e6:.2f} MB")
        wrong += faults(path, expected)
    for fault in wrong:
        print(fault, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
