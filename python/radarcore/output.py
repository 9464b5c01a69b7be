"""Output files and folders: rules of replacement, final names and locks.

- A single file is replaced only with an explicit ``overwrite``, in one step, and never by another kind of file.
- A folder is replaced only if radarcore made it, and only the files that its own description lists are deleted.
- A folder has one writer at a time; the system releases the lock of a process that dies.
- A result never replaces its own source.
"""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

LOCK = ".radarcore-lock"
"""Name of the lock file of a writer in its folder."""

_LOCK_PLACE = 1 << 30
"""Byte to lock on Windows, beyond the content, as a locked byte is unreadable."""

_LONGEST_STEM = 40
"""Characters of a name that the name of its temporary file repeats."""

_STARTS: dict[str, tuple[bytes, ...]] = {
    ".png": (b"\x89PNG\r\n",),
    ".jpg": (b"\xff\xd8\xff",),
    ".pdf": (b"%PDF",),
    ".svg": (b"<",),
    ".html": (b"<",),
    ".npz": (b"PK\x03\x04", b"PK\x05\x06"),
    ".npy": (b"\x93NUMPY",),
    ".h5": (b"\x89HDF\r\n",),
    ".mcap": (b"\x89MCAP",),
    ".db3": (b"SQLite format 3\0",),
    ".bag": (b"#ROSBAG",),
    ".rrd": (b"RRF", b"RRIO"),
}
"""First bytes of files by their kind."""

_SAME = {".jpeg": ".jpg", ".hdf5": ".h5", ".htm": ".html"}
"""Other suffixes of the same kind."""

_OTHERS = (".bin", ".csv", ".json", ".mat", ".toml", ".tar", ".txt", ".zip")
"""More suffixes of files, which new folders cannot have."""


def already_exists(path: Path, what: str) -> FileExistsError:
    """Error for a path that exists."""
    return FileExistsError(errno.EEXIST, f"expected no such path, got {what}", str(path))


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Gives an OSError the path that the system left out (disk full and the like)."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno is not None:
            raise type(error)(error.errno, error.strerror, str(path)) from error
        raise


def check_folder_name(path: Path) -> None:
    """Refuse a new folder with the suffix of a file: other programs would take it for one."""
    kind = path.suffix.lower()
    if kind in {*_STARTS, *_SAME, *_OTHERS} and not path.exists():
        bags = "; adapters.ros.write_frames writes frames into a bag" if kind in (".mcap", ".db3") else ""
        raise ValueError(f"{path}: expected the name of a folder, got the suffix {kind} of a file{bags}")


def make_folder(path: Path) -> None:
    """Make a folder with its parents; it may exist."""
    check_folder_name(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise already_exists(path, "a file, not a folder") from None
    except OSError as error:
        raise _creation_error(error, path) from error


def is_empty(path: Path) -> bool:
    """True for a folder that is empty, except for the lock file of its writer."""
    return all(entry.name == LOCK for entry in path.iterdir())


def replaces(folder: Path, is_own: Callable[[Path], bool], what: str, overwrite: bool) -> bool:
    """True if a result in a folder will be replaced; raises FileExistsError if none can be written.

    `is_own` is true for a folder with such a result. Messages call it `what`.
    """
    if folder.exists() and not folder.is_dir():
        raise already_exists(folder, "a file, not a directory")
    if not folder.is_dir() or is_empty(folder):
        return False
    if not is_own(folder):
        raise already_exists(folder, f"a directory that is not empty and no {what}")
    if not overwrite:
        raise already_exists(folder, f"a {what}; overwrite=True replaces it")
    return True


def check_file(path: Path, *, overwrite: bool, kind: str | None = None) -> None:
    """Refuse to write a file of a kind (a suffix, by default its own) in place of something else.

    Raises
    ------
    FileExistsError
        The path is a folder, a file and `overwrite` is False, or a file of another kind.
    ValueError
        The suffix is of another kind.
    """
    own = path.suffix.lower()
    kind = own if kind is None else kind
    own, kind = _SAME.get(own, own), _SAME.get(kind, kind)
    if own != kind and (own in _STARTS or own == ".toml"):
        raise ValueError(f"{path}: expected a file name with {kind}, got one with {own}")
    if path.is_dir():
        raise already_exists(path, "a directory")
    if not path.is_file():
        return
    if not overwrite:
        raise already_exists(path, "a file; overwrite=True replaces it")
    if not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, "expected a file that may be written, got a protected one", str(path))
    with path.open("rb") as file:
        start = file.read(64)
    if start and kind in _STARTS and not start.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(_STARTS[kind]):
        raise already_exists(path, f"a file that is no {kind} file, which overwrite=True does not replace")


@contextmanager
def new_file(path: Path, *, overwrite: bool = False, kind: str | None = None) -> Iterator[Path]:
    """A temporary file beside `path`, which is renamed to `path` when the block ends without an error.

    After an error it is removed. `overwrite` and `kind` as in `check_file`. Devices and pipes are written directly.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        yield path
        return
    path = path.resolve() if path.is_symlink() else path  # the link stays
    check_file(path, overwrite=overwrite, kind=kind)
    make_folder(path.parent)
    part = path.with_name(f".{path.stem[:_LONGEST_STEM]}.{secrets.token_hex(4)}.part{path.suffix}")
    try:
        try:
            part.open("xb").close()
        except OSError as error:
            raise _creation_error(error, path) from error
        with naming(path):
            yield part
        if path.exists():
            check_file(path, overwrite=overwrite, kind=kind)  # another program may have made it meanwhile
            shutil.copymode(path, part)
        give_name(part, path, overwrite=overwrite)
    finally:
        part.unlink(missing_ok=True)


def give_name(part: Path, path: Path, *, overwrite: bool) -> None:
    """Rename a complete file in one step; without `overwrite` only to a free name."""
    if not overwrite:
        try:
            os.link(part, path)  # a rename would replace a file that another writer has just made
        except FileExistsError:
            raise already_exists(path, "a file; overwrite=True replaces it") from None
        except OSError:  # a file system without links
            pass
        else:
            part.unlink()
            return
    part.replace(path)


def write_text(path: Path, text: str, *, overwrite: bool = False) -> None:
    """Write a text, whole or not at all."""
    with new_file(path, overwrite=overwrite) as part:
        part.write_text(text, encoding="utf-8")


@contextmanager
def claimed(path: Path) -> Iterator[None]:
    """A new file that grows in place; it is removed if it is empty at the end."""
    try:
        path.open("xb").close()
    except FileExistsError:
        raise already_exists(path, "a file; delete it, or choose another name") from None
    except OSError as error:
        raise _creation_error(error, path) from error
    try:
        yield
    finally:
        if path.is_file() and path.stat().st_size == 0:
            path.unlink()


def refuse_source(name: str, path: Path, source: Path) -> None:
    """Refuse an output that is the source itself, a folder around it, or a place in it."""
    output, origin = path.resolve(), source.resolve()
    if output == origin or output in origin.parents or origin in output.parents:
        where = "the source itself" if output == origin else "around" if output in origin.parents else "within"
        of = "" if output == origin else f" the source {source}"
        raise ValueError(f"{name}: expected a place outside the source, got {path}, {where}{of}")


class Lock:
    """Lock of a folder for one writer at a time.

    The system releases it when a process ends or is killed. File systems without locks do not limit writers.

    Raises
    ------
    BlockingIOError
        Another writer has it.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / LOCK
        self._file: int | None = None
        while True:
            with naming(folder):
                file = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o666)
            try:
                _lock(file)
                # The previous writer may have removed the file between the two steps.
                if not os.path.samestat(os.fstat(file), self._path.stat()):
                    raise FileNotFoundError
            except FileNotFoundError:
                os.close(file)
            except BlockingIOError:
                owner = os.read(file, 20).decode("ascii", "replace")
                os.close(file)
                raise BlockingIOError(
                    errno.EWOULDBLOCK,
                    f"expected no other writer, got {f'process {owner}' if owner else 'one'}, which writes there now; "
                    "wait until it ends, or choose another path",
                    str(folder),
                ) from None
            else:
                break
        self._file, self._owner = file, os.getpid()
        with suppress(OSError):  # on a full disk the lock works without the process number
            os.truncate(file, 0)
            os.write(file, str(os.getpid()).encode())

    def __enter__(self) -> Lock:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def release(self) -> None:
        """Release the lock; may be called twice."""
        file, self._file = self._file, None
        if file is not None:
            if sys.platform != "win32" and self._owner == os.getpid():  # not in a fork; Windows needs it closed first
                self._path.unlink(missing_ok=True)
            os.close(file)
            if sys.platform == "win32":
                with suppress(OSError):
                    self._path.unlink()

    def __del__(self) -> None:
        if getattr(self, "_file", None) is not None:
            with suppress(OSError):
                self.release()


class PartFolder:
    """A new folder ``NAME.part`` beside a path, for a result that is renamed to the path when it is complete.

    Attributes
    ----------
    folder : Path
        The folder ``NAME.part``, which this writer has locked.

    Raises
    ------
    FileExistsError
        ``NAME.part`` exists, as after a killed writer.
    BlockingIOError
        Another writer has locked it.
    """

    def __init__(self, path: Path) -> None:
        self._path = path = path.resolve() if path.is_symlink() else path  # a link to a folder stays
        self._is_complete = False
        self.folder: Path = path.with_name(f"{path.name}.part")
        make_folder(path.parent)
        try:
            self.folder.mkdir()
        except FileExistsError:
            with suppress(FileNotFoundError):  # the writer has ended just now
                if (self.folder / LOCK).is_file():
                    Lock(self.folder).release()
            what = "a file" if not self.folder.is_dir() else f"a folder, such as a killed writer of {path.name} leaves"
            raise already_exists(self.folder, f"{what}; keep it by another name, or delete it") from None
        except OSError as error:
            raise _creation_error(error, path) from error
        self._lock = Lock(self.folder)

    def __enter__(self) -> PartFolder:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            self.leave() if self._is_complete else self.remove()

    def put(self, made: Path, ours: Iterable[Path] = ()) -> None:
        """Rename a folder within the part to the path and remove the part.

        `ours` are the files of an older result in the folder; only these are deleted.
        """
        old = {self._path / file.name for file in ours}  # theirs is the path as given, which may be a link
        if self._path.is_dir():
            kept = [place for place in self._path.iterdir() if place not in old and place.name != LOCK]
            if taken := {place.name for place in kept} & {place.name for place in made.iterdir()}:
                raise already_exists(self._path / sorted(taken)[0], "a file of others")
            self._is_complete = True
            for file in old:
                file.unlink(missing_ok=True)
            if not kept:
                self._path.rmdir()
        if self._path.is_dir():
            for place in sorted(made.iterdir()):
                place.replace(self._path / place.name)
        else:
            made.replace(self._path)
        self.remove()

    def remove(self) -> None:
        """Delete the part with its content."""
        self._lock.release()
        shutil.rmtree(self.folder)

    def leave(self) -> None:
        """Release the lock and keep the part for the user."""
        self._lock.release()


def _lock(file: int) -> None:
    """Lock an open file; a BlockingIOError if another writer has locked it."""
    if sys.platform == "win32":
        import msvcrt

        os.lseek(file, _LOCK_PLACE, os.SEEK_SET)
        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        except OSError as error:
            raise BlockingIOError from error
        finally:
            os.lseek(file, 0, os.SEEK_SET)
    else:
        import fcntl

        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise
        except OSError:  # a file system without locks
            pass


def _creation_error(error: OSError, path: Path) -> OSError:
    """Error for a path where no file can be made; for /proc and the like the system reports 'no such file'."""
    if isinstance(error, FileNotFoundError):
        return PermissionError(
            errno.EPERM, "expected a folder in which files can be made, got one that is protected", str(path)
        )
    return OSError(error.errno, error.strerror, str(path))
