"""Command that runs targets for a time: a child reads, its parent notices when it dies or hangs."""

from __future__ import annotations

import argparse
import faulthandler
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections import Counter
from pathlib import Path
from random import Random

from fuzz.cases import Case, Target, damaged_case, read_back, write
from fuzz.judge import judge
from fuzz.targets import TARGETS

HANG = 30.0
"""Time after which a child is given up [s]; it is asked for every second reading."""

ROOM = 1 << 30
"""Address space for readings [bytes]: the core's memory is not traced."""

_FAULTS = 3
"""Exit status of a child that has found faults; an exception of its own is 1."""

MOST_KEPT = 2000
"""Inputs that are damaged further: each was read or refused in a way of its own."""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description="Fuzz readers of files and bytes.")
    parser.add_argument("target", nargs="*", choices=[[], *TARGETS], help=f"default: all ({', '.join(TARGETS)})")
    parser.add_argument("--minutes", type=float, default=1.0, help="for each target")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--replay", type=Path, help="folder of one input")
    parser.add_argument("--out", type=Path, default=Path("out/fuzz"), help="folder for inputs that fail")
    parser.add_argument("--within", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    names = options.target or list(TARGETS)
    if options.replay is not None:
        return _replay(TARGETS[names[0]], options.replay)
    if options.within is not None:
        return _run(names[0], options.minutes, options.seed, options.within, options.out)
    return max(_supervise(name, options.minutes, options.seed, options.out) for name in names)


def _replay(target: Target, folder: Path) -> int:
    """Read one input again, with its exception."""
    tracemalloc.start()
    verdict = judge(target.read, folder.resolve(), sum(map(len, read_back(folder).values())))
    print(verdict.trace or verdict.kind, verdict.fault, sep="\n")
    return bool(verdict.fault)


def _supervise(name: str, minutes: float, seed: int, out: Path) -> int:
    """Run a target in a child, and again for the rest of the time where that dies."""
    end = time.monotonic() + 60.0 * minutes
    failed = 0
    with tempfile.TemporaryDirectory() as directory:
        while (left := end - time.monotonic()) > 1.0:
            arguments = [name, "--minutes", str(left / 60.0), "--seed", str(seed), "--out", str(out)]
            command = [sys.executable, "-m", "tests.fuzz", *arguments, "--within", directory]
            code = subprocess.run(command, check=False).returncode
            if code in (0, _FAULTS):
                return max(failed, int(code == _FAULTS))
            place = out / f"{name}-died-{seed}"
            shutil.copytree(Path(directory) / "case", place, dirs_exist_ok=True)
            print(f"{name}: the reader died or hung (exit status {code}): {place}", flush=True)
            failed, seed = 1, seed + 1
    return failed


def _run(name: str, minutes: float, seed: int, directory: Path, out: Path) -> int:
    """Run a target; a line for each new fault, and one at the end."""
    target, folder = TARGETS[name], (directory / "case").resolve()
    folder.mkdir(exist_ok=True)
    random = Random(f"{name} {seed}")
    corpus = target.seeds()
    num_seeds = len(corpus)
    kinds: Counter[str] = Counter()
    faults: Counter[str] = Counter()
    _limit_memory()
    tracemalloc.start()
    began = armed = time.monotonic()
    number = 0
    while (now := time.monotonic()) < began + 60.0 * minutes:
        if number == 0 or now > armed + 1.0:
            armed = now
            faulthandler.dump_traceback_later(HANG, exit=True)
        case = corpus[number] if number < num_seeds else next_case(target, corpus, random)
        number += 1
        write(case, folder)
        verdict = judge(target.read, folder, sum(map(len, case.values())))
        if verdict.fault:
            faults[verdict.kind] += 1
            if faults[verdict.kind] == 1:
                place = out / f"{name}-{len(faults)}-{seed}"
                shutil.rmtree(place, ignore_errors=True)
                shutil.copytree(folder, place)
                (out / f"{place.name}.txt").write_text(f"{verdict.fault}\n{verdict.trace}", errors="replace")
                print(f"{name}: {verdict.kind}: {verdict.fault.splitlines()[0][:200]}: {place}", flush=True)
        elif not kinds[verdict.kind] and len(corpus) < MOST_KEPT:
            corpus.append(case)
        kinds[verdict.kind] += 1
    faulthandler.cancel_dump_traceback_later()
    print(
        f"{name}: {number} inputs in {time.monotonic() - began:.0f} s, {kinds['read']} read, "
        f"{number - kinds['read'] - sum(faults.values())} refused in {len(kinds) - 1} ways, {len(faults)} faults",
        flush=True,
    )
    return _FAULTS if faults else 0


def next_case(target: Target, corpus: list[Case], random: Random) -> Case:
    """A structured input, or one with damaged bytes, or both."""
    is_structured = random.random() < 0.6
    case = target.make(random) if is_structured else random.choice(corpus)
    return case if is_structured and random.random() < 0.8 else damaged_case(case, random, corpus)


def _limit_memory() -> None:
    """Make the core fail rather than take the machine's memory."""
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + ROOM, used + ROOM))
