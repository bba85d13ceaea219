"""Files of unknown origin: what is opened at all, and how much of it is read."""

import errno
import os
import stat
from io import BufferedReader
from pathlib import Path
from typing import Any

import yaml

from ..errors import BadConfig, cut

MAX_FILE = 16_000_000
"""Size of the largest file that is read into memory, unless another limit is given [bytes]."""
MAX_JOURNAL = 4_000_000_000
"""Size of the largest journal that is read [bytes]. A million episodes have 0.5 GB."""
POINTER = "is a pointer of Git LFS, not the file itself; run git lfs pull"
"""Fault of a file that Git LFS has left in place of a large one."""
_POINTER_START = b"version https://git-lfs.github.com/spec/"
_MAX_POINTER = 1024  # the specification's limit [bytes]


def why_not_plain(path: Path) -> str:
    """Why a file of a pool is not opened; empty if it is. Links, pipes and devices are not."""
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
"""How files are opened. Each platform has some of these flags; Windows follows links."""
_MISSING = "is missing"
_NOT_PLAIN = "is not a plain file"


def read_plain(path: Path | str, most: int = MAX_FILE) -> bytes:
    """Content of a plain file that a user names. Links to one are followed.

    Raises:
        ValueError: it is missing, no plain file, too large, or a pointer of Git LFS.
        OSError: it cannot be read.
    """
    with open_plain(Path(os.path.realpath(path))) as file:
        return read_opened(file, most)


def read_opened(file: BufferedReader, most: int = MAX_FILE) -> bytes:
    """Content of an opened file.

    Raises:
        ValueError: it is too large, or a pointer of Git LFS.
        OSError: it cannot be read.
    """
    if is_pointer(file):
        raise ValueError(f"it {POINTER}")
    if (size := os.fstat(file.fileno()).st_size) > most:
        raise ValueError(f"it has {size} bytes; at most {most} are read")
    content = file.read(most + 1)  # files of /proc have more than they say
    if len(content) > most:
        raise ValueError(f"it has more than {most} bytes")
    return content


def is_pointer(file: BufferedReader) -> bool:
    """Whether an opened file is a pointer of Git LFS. The file is read from its beginning afterwards."""
    file.seek(0)
    found = os.fstat(file.fileno()).st_size <= _MAX_POINTER and file.peek(len(_POINTER_START))
    return bool(found) and found.startswith(_POINTER_START)  # type: ignore[union-attr]


class _Plain(yaml.SafeLoader):
    """A loader that refuses keys that stand twice, and aliases, by which a small file can stand for any amount of data.

    The faster loader in C does not call `compose_node`.
    """

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("it has an alias; write the value out")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        found = super().construct_mapping(node, deep)
        if len(found) < len(node.value):
            raise yaml.YAMLError("it has a key twice; give each key once")
        return found


def read_yaml(setting: str, path: Path) -> dict[str, Any]:
    """The group of settings in a YAML file that a setting names.

    Raises:
        BadConfig: it cannot be read, is not YAML, or holds something else.
    """
    try:
        node = yaml.load(read_plain(path), _Plain)
    except (yaml.YAMLError, ValueError, OSError, RecursionError) as error:
        why = " ".join((getattr(error, "strerror", "") or str(error)).split())
        told = why if why.startswith("it ") else f"it is not YAML ({cut(why)})"
        raise BadConfig(f"{setting} = {path}; {told}") from None
    if not isinstance(node, dict) or not all(isinstance(key, str) for key in node):
        raise BadConfig(f"{setting} = {path}; it must be a group of settings, one `name: value` in a line")
    return node
