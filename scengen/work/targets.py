"""Output files and folders: tested before the work, written whole or not at all. Faults come with a remedy."""

import errno
import filecmp
import itertools
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from ..errors import BadConfig, cut
from .plain import why_not_plain

STREAMS = ("/dev/stdout", "/dev/stderr", "/dev/null")
"""Devices that are accepted as a target."""

PART = ".part"
"""Suffix of the name of a file while it is written."""
_REMEDY = {
    errno.ENOSPC: "make room and repeat the command",
    errno.EDQUOT: "make room and repeat the command",
    errno.EFBIG: "raise the limit of the size of files (ulimit -f) and repeat the command",
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
    errno.ENOMEM: "use fewer workers, or process less at once",
    errno.EAGAIN: "use fewer workers",
}


def remedy(error: OSError) -> str:
    """Fault and remedy as text, without the path; empty if the fault is not one of disks."""
    known = _REMEDY.get(error.errno or 0)
    return f"{(error.strerror or 'fault').lower()}; {known}" if known else ""


def refused(path: Path | str, error: OSError) -> BadConfig:
    """The error for a path that cannot be written."""
    why = remedy(error) or f"{(error.strerror or str(error)).lower()}; choose another place"
    return BadConfig(f"{cut(str(path))} cannot be written: {why}")


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
    part = path.with_name(f"{path.name if len(path.name) < 250 else path.name[:-9]}{PART}")
    try:
        if str(path) in STREAMS:
            with open(path, "wb") as stream:
                stream.write(data)
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            part.unlink(missing_ok=True)  # a link there would lead elsewhere
            with open(part, "xb") as file:
                file.write(data)
            os.replace(part, path)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise refused(path, error) from None


def unfinished(to: Path | str) -> Path:
    """Path of a file or folder while it is written."""
    return Path(f"{to}.unfinished")


def clear_unfinished(to: Path | str) -> None:
    """Discard what a killed command has left of a target.

    Raises:
        BadConfig: another command is writing it, or something else has its unfinished name.
    """
    part = unfinished(to)
    try:
        if not _lock_file(part).is_file():
            if os.path.lexists(part):
                raise BadConfig(
                    f"{cut(str(part))} is in the way, and no command of scengen wrote it; move it elsewhere"
                )
            return
        with _lock_of(part):
            _discard(part)
    except Timeout:
        raise BadConfig(
            f"{cut(str(part))} is being written by another command; wait for it, or name another target"
        ) from None
    except OSError as error:
        raise refused(part, error) from None


@contextmanager
def appearing(to: Path | str, folder: bool) -> Iterator[Path]:
    """Write a file or folder that appears under its name when it is complete, and is discarded after an error.

    What a command that was killed has left is discarded, too.

    Args:
        folder: whether it is a folder, which is made empty; otherwise an empty file.

    Yields:
        Where to write it.

    Raises:
        BadConfig: it cannot be written, or another command is writing it.
    """
    part = unfinished(to)
    try:
        part.parent.mkdir(parents=True, exist_ok=True)
        clear_unfinished(to)
        with _lock_of(part):
            part.mkdir() if folder else part.touch(exist_ok=False)
            try:
                yield part
                part.replace(to)
            except BaseException:
                _discard(part)
                raise
    except Timeout:
        clear_unfinished(to)
    except OSError as error:
        raise refused(to, error) from None


def foreign(folder: Path, files: Mapping[str, bytes | Path]) -> str:
    """Path in a folder of something that is not among some files, or differs; empty if a command that writes them may
    have left all that is there.

    Args:
        files: contents of the files, or files with these contents, by their paths in the folder.
    """
    for path in sorted(folder.rglob("*")) if folder.is_dir() else ():
        name = path.relative_to(folder).as_posix()
        if path.is_dir() and not path.is_symlink() and any(other.startswith(f"{name}/") for other in files):
            continue
        if name.removesuffix(PART) != name and name.removesuffix(PART) in files:  # `write` was killed
            continue
        if name not in files or why_not_plain(path) or not _same(path, files[name]):
            return name
    return ""


def check_same(folder: Path, files: Mapping[str, bytes | Path]) -> None:
    """Raise `BadConfig` if a folder holds anything `foreign`."""
    if other := foreign(folder, files):
        raise BadConfig(f"{folder} is not empty: it holds {cut(other)}; delete it, or name another folder")


def _same(path: Path, made: bytes | Path) -> bool:
    return filecmp.cmp(path, made, shallow=False) if isinstance(made, Path) else path.read_bytes() == made


@contextmanager
def _lock_of(part: Path) -> Iterator[None]:
    """Hold the lock of an unfinished target. A process that is killed loses it.

    Raises:
        Timeout: another process holds it.
    """
    path = _lock_file(part)
    with FileLock(path, timeout=0):
        try:
            yield
        finally:
            path.unlink(missing_ok=True)


def _lock_file(part: Path) -> Path:
    """Lock of an unfinished target. It stays there if its command is killed."""
    return part.with_name(f"{part.name}.lock")


def _discard(part: Path) -> None:
    if part.is_dir() and not part.is_symlink():
        shutil.rmtree(part)
    else:
        part.unlink(missing_ok=True)


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


def move_aside(*paths: Path) -> list[Path]:
    """Rename what an earlier run has left, all with the same new number: `pool-1` and `pool-1.run`. Nothing is deleted.

    Returns:
        The new names of the paths that existed.
    """

    def numbered(path: Path, number: int) -> Path:
        return path.with_name(f"{path.stem}-{number}{path.suffix}")

    free = next(k for k in itertools.count(1) if not any(os.path.lexists(numbered(path, k)) for path in paths))
    moved = []
    for path in paths:
        if os.path.lexists(path):
            try:
                path.rename(numbered(path, free))
            except OSError as error:
                raise refused(path, error) from None
            moved.append(numbered(path, free))
    return moved
