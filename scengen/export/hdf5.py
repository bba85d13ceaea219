"""Checks whether HDF5 files can be written. Needs h5py (`pip install scengen[record]`)."""

from importlib.util import find_spec
from pathlib import Path

from ..errors import BadConfig, ScengenError

SUFFIXES = (".hdf5", ".h5")
"""Accepted endings of the names of HDF5 files."""


class NoHdf5(ScengenError):
    """h5py is missing on this machine."""


def check_target(to: str) -> None:
    """Check the name of an HDF5 file, and that h5py is installed.

    Raises:
        BadConfig: the name of the file has another ending.
        NoHdf5: h5py is missing.
    """
    if Path(to).suffix not in SUFFIXES:
        raise BadConfig(f"to = {to}; robomimic's format is one file: name one that ends in {' or '.join(SUFFIXES)}")
    if find_spec("h5py") is None:
        raise NoHdf5("no h5py for HDF5 files; run pip install 'scengen[record]'")
