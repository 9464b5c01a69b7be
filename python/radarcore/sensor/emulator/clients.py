"""Programs that have a port open."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path


def clients_of(path: str) -> dict[int, str]:
    """Numbers and names of the processes that have a device file open, as far as Linux tells this user.

    A process whose parent has it open too is left out: it has inherited the port.
    """
    found = {}
    parents = {}
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # ended meanwhile, or of another user
            if any(_leads_to(file, path) for file in (process / "fd").iterdir()):
                # "NUMBER (NAME) STATE PARENT ...", where the name may have blanks and brackets.
                head, _, tail = (process / "stat").read_text().rpartition(")")
                number = int(process.name)
                found[number] = head.partition("(")[2]
                parents[number] = int(tail.split()[1])
    return {number: name for number, name in sorted(found.items()) if parents[number] not in found}


def _leads_to(file: Path, path: str) -> bool:
    with suppress(OSError):  # closed meanwhile
        return str(file.readlink()) == path
    return False
