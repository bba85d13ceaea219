"""Output files and folders: tested before the work, written whole or not at all. Faults come with a remedy."""

import errno
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import BadConfig, cut

STREAMS = ("/dev/stdout", "/dev/stderr", "/dev/null")
"""Devices that are accepted as a target."""

_REMEDY = {
    errno.ENOSPC: "make room and repeat the command",
    errno.EDQUOT: "make room and repeat the command",
    errno.EFBIG: "the file is too large here; raise the limit (ulimit -f) and repeat the command",
    errno.EROFS: "the place is read-only; choose another place",
    errno.EACCES: "make it writable, or choose another place",
    errno.EPERM: "make it writable, or choose another place",
    errno.ENAMETOOLONG: "choose a shorter name",
    errno.ENOTDIR: "a part of this path is a file; choose another place",
    errno.EEXIST: "a part of this path is a file; choose another place",
    errno.EISDIR: "it is a folder; name a file",
    errno.ENOENT: "choose another place",
    errno.EIO: "the disk has a fault; choose another place",
    errno.ELOOP: "its links form a circle; choose another place",
    errno.EMFILE: "raise the limit of open files (ulimit -n), or use fewer workers",
    errno.ENOMEM: "use fewer workers, or ask for less at once",
    errno.EAGAIN: "use fewer workers",
}


def remedy(error: OSError) -> str:
    """Fault and remedy in words, without the path; empty if the fault is not one of disks."""
    known = _REMEDY.get(error.errno or 0)
    return f"{(error.strerror or 'fault').lower()}; {known}" if known else ""


def refused(path: Path | str, error: OSError) -> BadConfig:
    """The error for a path that cannot be written."""
    why = remedy(error) or f"{(error.strerror or str(error)).lower()}; choose another place"
    return BadConfig(f"{cut(str(path))} cannot be written: {why}")


def cache_folder() -> Path:
    """The folder `scengen` in the user's folder of cached files, as the XDG specification says."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "scengen")


def try_file(path: Path | str | None) -> None:
    """Test whether a file can be written, before the work on its content. Nothing is left behind.

    Raises:
        BadConfig: it cannot be written.
    """
    if path is None or str(path) in STREAMS:
        return
    path = Path(path)
    try:
        if path.is_dir():
            raise BadConfig(f"{cut(str(path))} is a folder; name a file")
        if os.path.lexists(path) and not stat.S_ISREG(os.stat(path).st_mode):
            raise BadConfig(f"{cut(str(path))} is not a plain file; name another one")
        if path.exists():
            open(path, "r+b").close()
        with _trial_folder(path.parent) as folder:
            open(folder / path.name, "xb").close()
    except OSError as error:
        raise refused(path, error) from None


def try_folder(path: Path | str | None) -> None:
    """Test whether files can be written into a folder, which need not exist. Nothing is left behind.

    Raises:
        BadConfig: they cannot be written.
    """
    if path is None:
        return
    path = Path(path)
    try:
        if os.path.lexists(path) and not path.is_dir():
            raise BadConfig(f"{cut(str(path))} is a file; name a folder")
        with _trial_folder(path):
            pass
    except OSError as error:
        raise refused(path, error) from None


def write(path: Path, content: str | bytes) -> None:
    """Write a whole file or nothing. Its folder is made if necessary.

    Raises:
        BadConfig: it cannot be written.
    """
    data = content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
    part = path.with_name(f"{path.name}.part") if len(path.name) < 250 else path.with_name(f"{path.name[:-9]}.part")
    try:
        if str(path) in STREAMS:
            with open(path, "wb") as stream:
                stream.write(data)
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            part.write_bytes(data)
            os.replace(part, path)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise refused(path, error) from None


@contextmanager
def _trial_folder(folder: Path) -> Iterator[Path]:
    """A trial folder with the same path below a new one in the nearest folder that exists. A block is written in it.

    Nothing is made or removed that another process could use.
    """
    nearest = folder
    while not os.path.lexists(nearest):
        nearest = nearest.parent
    with tempfile.TemporaryDirectory(prefix=".trial-", dir=nearest) as new:
        trial = Path(new, folder.relative_to(nearest))
        trial.mkdir(parents=True, exist_ok=True)
        (trial / "block").write_bytes(b"\0" * 4096)  # a full disk still takes an empty file
        (trial / "block").unlink()
        yield trial
