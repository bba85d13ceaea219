"""Files of a pool: their hashes, how they are replaced, and which of them are opened at all."""

import hashlib
import os
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import Any, Self

from ..work.plain import POINTER, is_pointer, open_plain, read_opened
from . import untrusted

MAX_JSON = 16_000_000
"""Size of the largest JSON file that is read [bytes]; the entries of ten thousand shards have 2 MB."""


def sha256(content: str | bytes) -> str:
    """Hash of a text or of bytes, in hex."""
    return hashlib.sha256(content.encode() if isinstance(content, str) else content).hexdigest()


def sha256_of_file(path: Path) -> str:
    """Hash of a file, in hex.

    Raises:
        ValueError: it is not a plain file.
        OSError: it cannot be read.
    """
    with open_plain(Path(os.path.realpath(path))) as file:
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
            if is_pointer(file):
                return POINTER
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
        part.unlink(missing_ok=True)  # a link there would lead elsewhere
        with open(part, "xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def read_json_file(path: Path) -> Any:
    """Content of a JSON file in the folder of the shards: a manifest, or an index.

    Raises:
        ValueError: it is not a plain file, too large, or not strict JSON.
        OSError: it cannot be read.
    """
    with open_plain(path) as file:
        return untrusted.read_json(read_opened(file, MAX_JSON).decode(), MAX_JSON)
