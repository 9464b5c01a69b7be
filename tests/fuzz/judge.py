"""Verdict on one reading: in order, or a fault."""

from __future__ import annotations

import re
import time
import traceback
import tracemalloc
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

LONGEST = 2.0
"""Time of the processor that a reading may take [s], whatever else the machine does."""

MOST_MEMORY = 512 << 20
"""Memory that a reading may take, besides a hundred times the size of its input [bytes]: a few words of a scene file
make a waveform of 2^24 chirps or a sphere of 300 000 triangles."""

LONGEST_MESSAGE = 20_000
"""Characters of a message: a scene file has a line for each fault."""


class Verdict(NamedTuple):
    """Outcome of a reading."""

    kind: str
    """Equal for inputs that were read, or refused, in the same way."""
    fault: str
    """Fault; "" if there is none."""
    trace: str = ""


def judge(read: Callable[[Path], Any], folder: Path, size: int) -> Verdict:
    """Read the input of `size` bytes in a folder."""
    tracemalloc.start()
    verdict, took = _timed(read, folder)
    memory = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    if verdict.fault:
        return verdict
    if took > LONGEST:
        _, took = _timed(read, folder)  # not traced
    if took > LONGEST:
        return verdict._replace(fault=f"took {took:.1f} s", kind="slow: " + verdict.kind)
    if memory > MOST_MEMORY + 100 * size:
        return verdict._replace(fault=f"took {memory >> 20} MiB for {size} bytes", kind="memory: " + verdict.kind)
    return verdict


def _timed(read: Callable[[Path], Any], folder: Path) -> tuple[Verdict, float]:
    began = time.process_time()
    return _verdict(read, folder), time.process_time() - began


def _verdict(read: Callable[[Path], Any], folder: Path) -> Verdict:
    try:
        with warnings.catch_warnings():
            # Notices to the user are in order; warnings of numpy say that a number was not checked.
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", UserWarning)
            read(folder)
        return Verdict("read", "")
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a panic of the core is no Exception
        message = str(error)
        where = traceback.extract_tb(error.__traceback__)[-1]
        kind = f"{type(error).__name__} at {Path(where.filename).name}:{where.lineno}"
        if not _is_documented(error):
            return Verdict(kind, f"{type(error).__name__}: {message[:500]}", traceback.format_exc())
        shape = re.sub(r"'[^']*'|\"[^\"]*\"|[-+]?\d[\d.e+-]*", "*", message.replace(str(folder), ""))
        if str(folder) not in message:
            return Verdict("no name: " + kind, f"names no file: {message[:500]}", traceback.format_exc())
        if len(message) > LONGEST_MESSAGE or re.search(r"[\0-\x08\x0b-\x1f\x7f]", message):
            return Verdict("text: " + kind, f"long or unprintable: {message[:500]!r}", traceback.format_exc())
        return Verdict(f"{type(error).__name__}: {shape[:120]}", "")


def _is_documented(error: BaseException) -> bool:
    """True for ValueError, OSError and the package's own errors, but not for errors of libraries and codecs."""
    is_ours = type(error).__module__.split(".")[0] in ("builtins", "radarcore")
    return is_ours and isinstance(error, ValueError | OSError) and not isinstance(error, UnicodeError)
