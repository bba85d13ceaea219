"""Files and folders that are written: tried before the work, written whole or not at all, faults told with a remedy."""

import errno
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import BadConfig, cut

STREAMS = ("/dev/stdout", "/dev/stderr", "/dev/null")
"""Devices that make sense as a target."""

_REMEDY = {
    errno.ENOSPC: "make room and repeat the command",
    errno.EDQUOT: "make room and repeat the command",
    errno.EFBIG: "files may not become so large here; raise the limit (ulimit -f) and repeat the command",
    errno.EROFS: "it can only be read here; choose another place",
    errno.EACCES: "make it writable, or choose another place",
    errno.EPERM: "make it writable, or choose another place",
    errno.ENAMETOOLONG: "choose a shorter name",
    errno.ENOTDIR: "a part of this path is a file; choose another place",
    errno.EEXIST: "a part of this path is a file; choose another place",
    errno.EISDIR: "it is a folder; name a file",
    errno.ENOENT: "choose another place",
    errno.EIO: "the disk is at fault; choose another place",
    errno.ELOOP: "its links lead in a circle; choose another place",
    errno.EMFILE: "raise the limit of open files (ulimit -n), or use fewer workers",
    errno.ENOMEM: "use fewer workers, or ask for less at once",
    errno.EAGAIN: "use fewer workers",
}


def remedy(error: OSError) -> str:
    """What is wrong and what helps, without the path; empty for a fault of another kind than those of disks."""
    helps = _REMEDY.get(error.errno or 0)
    return f"{(error.strerror or 'fault').lower()}; {helps}" if helps else ""


def refused(path: Path | str, error: OSError) -> BadConfig:
    """That a path cannot be written."""
    why = remedy(error) or f"{(error.strerror or str(error)).lower()}; choose another place"
    return BadConfig(f"{cut(str(path))} cannot be written: {why}")


def cache_folder() -> Path:
    """The folder `scengen` in the user's folder of cached files, as the XDG specification says."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "scengen")


def try_file(path: Path | str | None) -> None:
    """Find out whether a file could be written, before work is put into what shall stand in it. Leaves nothing.

    Raises:
        BadConfig: it cannot.
    """
    if path is None or str(path) in STREAMS:
        return
    path = Path(path)
    try:
        if path.is_dir():
            raise BadConfig(f"{cut(str(path))} is a folder; name a file")
        if os.path.lexists(path) and not stat.S_ISREG(os.stat(path).st_mode):
            raise BadConfig(f"{cut(str(path))} is no plain file; name another one")
        if path.exists():
            open(path, "r+b").close()
        with _trial(path.parent) as folder:
            open(folder / path.name, "xb").close()
    except OSError as error:
        raise refused(path, error) from None


def try_folder(path: Path | str | None) -> None:
    """Find out whether files could be written into a folder, made if need be. Leaves nothing.

    Raises:
        BadConfig: they cannot.
    """
    if path is None:
        return
    path = Path(path)
    try:
        if os.path.lexists(path) and not path.is_dir():
            raise BadConfig(f"{cut(str(path))} is a file; name a folder")
        with _trial(path):
            pass
    except OSError as error:
        raise refused(path, error) from None


def write(path: Path, content: str | bytes) -> None:
    """Write a file, its folder made if need be: the whole of it, or nothing.

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
def _trial(folder: Path) -> Iterator[Path]:
    """A folder with a block written in it, of the same path below a new one where the first part that exists is.

    Nothing is made, and nothing removed, that another process could be using.
    """
    there = folder
    while not os.path.lexists(there):
        there = there.parent
    with tempfile.TemporaryDirectory(prefix=".trial-", dir=there) as new:
        like = Path(new, folder.relative_to(there))
        like.mkdir(parents=True, exist_ok=True)
        (like / "block").write_bytes(b"\0" * 4096)  # an empty file fits on a disk that is full
        (like / "block").unlink()
        yield like
