"""HDF5 files that are written whole or not at all. Needs h5py (`pip install scengen[record]`)."""

import io
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..errors import BadConfig, ScengenError
from ..work.targets import refused

SUFFIXES = (".hdf5", ".h5")
"""Accepted endings of the names of HDF5 files."""


class NoHdf5(ScengenError):
    """h5py is missing on this machine."""


def check_target(path: str, setting: str = "to") -> None:
    """Check the name of an HDF5 file, and that h5py is installed.

    Args:
        setting: name of the setting that names the file.

    Raises:
        BadConfig: the name of the file has another ending.
        NoHdf5: h5py is missing.
    """
    if Path(path).suffix not in SUFFIXES:
        raise BadConfig(
            f"{setting} = {path}; robomimic's format is one file: name one that ends in {' or '.join(SUFFIXES)}"
        )
    if find_spec("h5py") is None:
        raise NoHdf5("no h5py for HDF5 files; run pip install 'scengen[record]'")


class Output(io.RawIOBase):
    """A file for HDF5 to write to.

    HDF5 ends the process, or tries for minutes, if its file cannot grow, because closing the file also fails then. Here
    it does not learn of an error: the first one is kept for `check`, and what follows it is not written.
    """

    def __init__(self, path: Path):
        """
        Raises:
            BadConfig: the file cannot be written.
        """
        self.path = path
        self._error: OSError | None = None
        try:
            self._file = open(path, "w+b", buffering=0)  # noqa: SIM115 (closed by `close`)
        except OSError as error:
            raise refused(path, error) from None

    def check(self) -> None:
        """Raise `BadConfig` if something could not be written."""
        if self._error:
            raise refused(self.path, self._error)

    def write(self, data: Any) -> int:
        view = memoryview(data).cast("B")
        done = 0
        while done < len(view) and self._error is None:
            try:
                done += self._file.write(view[done:]) or 0
            except OSError as error:
                self._error = error
        if done < len(view):
            self._file.seek(len(view) - done, io.SEEK_CUR)
        return len(view)

    def readinto(self, buffer: Any) -> int:
        view = memoryview(buffer).cast("B")
        count = self._file.readinto(view) or 0
        if self._error and count < len(view):  # it was not written
            view[count:] = bytes(len(view) - count)
            return len(view)
        return count

    def truncate(self, size: int | None = None) -> int:
        place = self.tell() if size is None else size
        try:
            if self._error is None:
                self._file.truncate(place)
        except OSError as error:
            self._error = error
        return place

    def seek(self, place: int, whence: int = io.SEEK_SET) -> int:
        return self._file.seek(place, whence)

    def tell(self) -> int:
        return self._file.tell()

    def flush(self) -> None:
        pass  # the file has no buffer

    def seekable(self) -> bool:
        return True

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def close(self) -> None:
        try:
            self._file.close()
        except OSError as error:
            self._error = self._error or error
        super().close()
