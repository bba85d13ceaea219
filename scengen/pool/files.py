"""Files of a pool: their hashes, how they are replaced, and which of them are opened at all."""

import hashlib
import os
import stat
from pathlib import Path
from typing import Any

from . import untrusted

MAX_JSON = 16_000_000
"""Size of the largest JSON file that is read [bytes]; the entries of ten thousand shards have 2 MB."""


def sha256(content: str | bytes) -> str:
    """Hash of a text or of bytes, in hex."""
    return hashlib.sha256(content.encode() if isinstance(content, str) else content).hexdigest()


def sha256_of_file(path: Path) -> str:
    """Hash of a file, in hex."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


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
    """Why a file of a pool is not opened; empty if it is. Links, pipes and devices are not."""
    try:
        mode = os.lstat(path).st_mode
    except OSError:
        return "is missing"
    return "" if stat.S_ISREG(mode) else "is not a plain file"


def read_json_file(path: Path) -> Any:
    """Content of a JSON file beside the shards: a manifest, or an index.

    Raises:
        ValueError: it is not a plain file, too large, or not strict JSON.
        OSError: it cannot be read.
    """
    if why := why_not_plain(path):
        raise ValueError(f"it {why}")
    if (size := path.stat().st_size) > MAX_JSON:
        raise ValueError(f"it has {size} bytes; at most {MAX_JSON} are read")
    return untrusted.read_json(path.read_text(), MAX_JSON)
