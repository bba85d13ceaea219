"""Whether HDF5 files can be written here. Needs h5py (`pip install scengen[record]`)."""

from importlib.util import find_spec
from pathlib import Path

from ..errors import BadConfig, ScengenError

SUFFIXES = (".hdf5", ".h5")


class NoHdf5(ScengenError):
    """h5py is missing on this machine."""


def check_target(to: str) -> None:
    """Raise unless a path can name such a file, and h5py is there to write it.

    Raises:
        BadConfig: the name of the file has another ending.
        NoHdf5: h5py is missing.
    """
    if Path(to).suffix not in SUFFIXES:
        raise BadConfig(f"to = {to}; robomimic's format is one file: name one that ends in {' or '.join(SUFFIXES)}")
    if find_spec("h5py") is None:
        raise NoHdf5("no h5py for HDF5 files; say pip install 'scengen[record]'")
