"""Files of a pool: their hashes, how they are replaced, and which of them are opened at all."""

import errno
import hashlib
import os
import stat
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import Any, Self

from . import untrusted

MAX_JSON = 16_000_000
"""Size of the largest JSON file that is read [bytes]; the entries of ten thousand shards have 2 MB."""


def sha256(content: str | bytes) -> str:
    """Hash of a text or of bytes, in hex."""
    return hashlib.sha256(content.encode() if isinstance(content, str) else content).hexdigest()


def sha256_of_file(path: Path) -> str:
    """Hash of a file, in hex."""
    with open(path, "rb") as file:
        return sha256_of_opened(file)


def sha256_of_opened(file: BufferedReader) -> str:
    """Hash of an opened file from its beginning, in hex."""
    file.seek(0)
    return hashlib.file_digest(file, "sha256").hexdigest()


@dataclass(frozen=True)
class FileEntry:
    """Entry of a manifest for a file with rows."""

    file: str
    """Name of the file, which is in the folder of the manifest."""
    rows: int
    bytes: int
    sha256: str


@dataclass(frozen=True)
class Identity:
    """Numbers of a file, one of which changes when it is replaced or written. Programs cannot set the time of a change,
    as they can set the time of the last writing."""

    device: int
    inode: int
    size: int
    """Size [bytes]."""
    changed: int
    """Time of the last change [ns]."""

    @classmethod
    def of(cls, file: BufferedReader) -> Self:
        """The identity of an opened file."""
        status = os.fstat(file.fileno())
        return cls(status.st_dev, status.st_ino, status.st_size, status.st_ctime_ns)


def why_damaged(folder: Path, entry: FileEntry, identities: dict[Path, Identity]) -> str:
    """Fault of a file; empty if nothing is.

    Args:
        entry: the file's entry in the manifest of its folder.
        identities: identities of the files that were compared so far, to which this one is added.
    """
    path = folder / entry.file
    try:
        with open_plain(path) as file:
            identity = Identity.of(file)
            if identity.size != entry.bytes:
                return f"has {identity.size} bytes instead of {entry.bytes}: truncated"
            if sha256_of_opened(file) != entry.sha256:
                return "has a different sha256 than the manifest says"
    except (OSError, ValueError) as error:
        return str(error).removeprefix("it ")
    return "has been changed since its sha256 was compared" if identities.setdefault(path, identity) != identity else ""


def replace_file(path: Path, content: bytes) -> None:
    """Write a file. If the process dies at any moment, the file is either the old one or the new one."""
    part = path.with_name(path.name + ".part")
    try:
        with open(part, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def why_not_plain(path: Path) -> str:
    """Reason why a file of a pool is not opened; empty if it is. Links, pipes and devices are not."""
    try:
        mode = os.lstat(path).st_mode
    except OSError:
        return _MISSING
    return "" if stat.S_ISREG(mode) else _NOT_PLAIN


def open_plain(path: Path) -> BufferedReader:
    """Open a plain file for reading. Nothing that waits, leads elsewhere or never ends is opened.

    Raises:
        ValueError: it is missing, or a link, a pipe or a device.
        OSError: it cannot be opened.
    """
    try:
        descriptor = os.open(path, _FLAGS)
    except OSError as error:
        if error.errno == errno.ENOENT:
            raise ValueError(f"it {_MISSING}") from None
        if error.errno in (errno.ELOOP, errno.ENXIO):  # a link; a socket, or a device without a driver
            raise ValueError(f"it {_NOT_PLAIN}") from None
        raise
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise ValueError(f"it {_NOT_PLAIN}")
    return open(descriptor, "rb")


_FLAGS = os.O_RDONLY | sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY"))
"""Flags with which files are opened. Each platform has some of these flags; Windows follows links."""
_MISSING = "is missing"
_NOT_PLAIN = "is not a plain file"


def read_json_file(path: Path) -> Any:
    """Content of a JSON file in the folder of the shards: a manifest, or an index.

    Raises:
        ValueError: it is not a plain file, too large, or not strict JSON.
        OSError: it cannot be read.
    """
    with open_plain(path) as file:
        if (size := os.fstat(file.fileno()).st_size) > MAX_JSON:
            raise ValueError(f"it has {size} bytes; at most {MAX_JSON} are read")
        return untrusted.read_json(file.read(MAX_JSON + 1).decode(), MAX_JSON)
