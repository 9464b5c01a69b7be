"""Command `python -m tests.fuzz`: draw inputs of readers for a time, and store the failing ones."""

from __future__ import annotations

import argparse
import faulthandler
import resource
import shutil
import sys
import time
from collections import Counter
from pathlib import Path
from random import Random

# Tests share their modules by this path, as pytest has it.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fuzz.cases import next_case, read_back, size_of, write
from fuzz.judge import judge
from fuzz.targets import TARGETS

HANG = 30.0
"""Time after which a reading ends the program [s]; its input stays in the folder of its target."""

ROOM = 1 << 30
"""Address space for readings [bytes]: the core's memory is not traced."""

MOST_KEPT = 2000
"""Inputs that are damaged further: each was read or refused in a way of its own."""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description="Fuzz readers of files and bytes.")
    parser.add_argument("target", nargs="*", choices=[[], *TARGETS], help=f"default: all ({', '.join(TARGETS)})")
    parser.add_argument("--minutes", type=float, default=1.0, help="for each target")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--replay", type=Path, help="folder of one input")
    parser.add_argument("--out", type=Path, default=Path("out/fuzz"), help="folder for inputs that fail")
    options = parser.parse_args()
    names = options.target or list(TARGETS)
    if options.replay is not None:
        verdict = judge(TARGETS[names[0]].read, options.replay.resolve(), size_of(read_back(options.replay)))
        print(verdict.trace or verdict.kind, verdict.fault, sep="\n")
        return bool(verdict.fault)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + ROOM, used + ROOM))
    num_faults = [run(name, options.minutes, options.seed, options.out.resolve()) for name in names]
    return int(any(num_faults))


def run(name: str, minutes: float, seed: int, out: Path) -> int:
    """Draw inputs of a target for a time; a line for each new fault, and one at the end. Returns their number."""
    target, folder, random = TARGETS[name], out / name, Random(f"{name} {seed}")
    corpus = list(target.seeds())
    kinds: Counter[str] = Counter()
    num_faults = 0
    end = time.monotonic() + 60.0 * minutes
    while time.monotonic() < end:
        case = next_case(target, corpus, random)
        write(case, folder)
        faulthandler.dump_traceback_later(HANG, exit=True)
        verdict = judge(target.read, folder, size_of(case))
        kinds[verdict.kind] += 1
        if kinds[verdict.kind] > 1:
            continue
        if verdict.fault:
            num_faults += 1
            place = out / f"{name}-{num_faults}-{seed}"
            shutil.copytree(folder, place, dirs_exist_ok=True)
            (out / f"{place.name}.txt").write_text(f"{verdict.fault}\n{verdict.trace}", errors="replace")
            print(f"{name}: {verdict.kind}: {verdict.fault.splitlines()[0][:200]}: {place}", flush=True)
        elif len(corpus) < MOST_KEPT:
            corpus.append(case)
    faulthandler.cancel_dump_traceback_later()
    shutil.rmtree(folder)
    print(f"{name}: {kinds.total()} inputs, {kinds['read']} read, {len(kinds) - 1} other outcomes, {num_faults} faults")
    return num_faults


if __name__ == "__main__":
    sys.exit(main())
