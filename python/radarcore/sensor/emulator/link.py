"""Symbolic links to ptys, and which process serves a pty."""

from __future__ import annotations

import errno
import socket
import struct
import sys
from pathlib import Path

_MOST_QUESTIONS = 128
"""Questions for the server of a pty that the system keeps; nobody takes them up."""


def make_link(link: Path, path: str) -> None:
    """Make a symbolic link to a pty, in place of one that a killed server has left behind.

    Raises
    ------
    FileExistsError
        Somebody serves what the link leads to, or there is something else of that name.
    OSError
        There is no such folder, or nothing can be written there.
    """
    try:
        link.symlink_to(path)
        return
    except FileExistsError:
        if not _is_left_behind(link, path):
            raise FileExistsError(errno.EEXIST, _obstacle(link), str(link)) from None
    except FileNotFoundError as error:
        reason = f"expected a link in a folder that exists, got none named {link.parent}"
        raise FileNotFoundError(error.errno, reason, str(link)) from None
    except OSError as error:
        raise OSError(error.errno, f"no link can be made there: {error.strerror}", str(link)) from None
    link.unlink()
    link.symlink_to(path)


def remove_link(link: Path, path: str) -> None:
    """Remove a link, unless it is gone or leads to something else by now."""
    if link.is_symlink() and str(link.readlink()) == path:
        link.unlink()


def announce(path: str) -> socket.socket | None:
    """Let others find the process that serves a pty, until it ends or the socket is closed; None where that is unknown.

    The kernel forgets the name with the process, also one that is killed.
    """
    if sys.platform != "linux":
        return None
    server = socket.socket(socket.AF_UNIX)
    try:
        server.bind(_name(Path(path)))
        server.listen(_MOST_QUESTIONS)
    except OSError:  # a sandbox without such sockets
        server.close()
        return None
    return server


def server_of(path: Path) -> int | None:
    """Number of the process that serves a pty, 0 for one in another container; None if nobody has announced it."""
    if sys.platform != "linux" or not path.exists():
        return None
    with socket.socket(socket.AF_UNIX) as client:
        client.setblocking(False)
        try:
            client.connect(_name(path))
        except BlockingIOError:  # very many have asked
            return 0
        except OSError:
            return None
        number: int = struct.unpack("3i", client.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[0]
        return number


def _name(path: Path) -> str:
    """Name of the socket, in the abstract namespace of Linux."""
    status = path.stat()
    return f"\0radarcore pty {status.st_dev} {status.st_rdev}"


def _is_left_behind(link: Path, path: str) -> bool:
    """True for a link to a pty that is gone, or whose number has gone to another one since."""
    if not link.is_symlink() or link.readlink().parent != Path(path).parent:
        return False
    if not link.exists() or link.samefile(path):
        return True
    return server_of(link) is None and link.stat().st_ctime_ns > link.lstat().st_mtime_ns


def _obstacle(link: Path) -> str:
    free = "expected a name that is free"
    if not link.is_symlink():
        return f"{free}, got that of a {'folder' if link.is_dir() else 'file'}"
    number = server_of(link)
    if number is None:
        return f"{free}, got a link to {link.readlink()}, which no server of radarcore has made or left behind"
    return f"served by {f'process {number}' if number else 'another process'}; end that one, or choose another name"
