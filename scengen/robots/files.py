"""The robot's files: robosuite's MJCF and meshes of the Panda, its jaw and its mount. scengen does not hold them.

They are read from the folder that the environment variable `SCENGEN_ROBOSUITE` names, or else from the installed
robosuite, or else from the cache that `python -m scengen.robots.download` fills. The first of these that exists is
used. robosuite is found by its metadata and not imported. A file is used only if its SHA-256 is that of the release
(files.json), so that all places give the same robot.
"""

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from ..errors import NoRobot, cut
from ..installation import ROBOSUITE, cache_folder

VARIABLE = "SCENGEN_ROBOSUITE"
"""Environment variable that names a folder with robosuite, or robosuite's folder, or its folder models/assets."""
ASSETS = "robosuite/models/assets"
"""Folder of robosuite's MJCF files and meshes in its distribution. The names of the robot's files are relative to this
folder."""
INSTALL = f"pip install --no-deps robosuite=={ROBOSUITE}"
"""Command that installs robosuite without its requirements, which reading its files does not need."""
DOWNLOAD = "python -m scengen.robots.download"
"""Command that fills the cache."""


@dataclass(frozen=True)
class Place:
    """A folder in which the robot's files should be."""

    folder: Path
    label: str
    """Description of the folder in errors."""
    remedy: str
    """Remedy if a file in the folder is missing or differs."""


@cache
def hashes() -> Mapping[str, str]:
    """SHA-256 of the robot's files, in hexadecimal digits, by name."""
    return json.loads(Path(__file__).with_name("files.json").read_text())


@cache
def place() -> Place:
    """The place from which this process reads the robot's files.

    Raises:
        NoRobot: it does not exist, or the environment variable names no folder.
    """
    found = _named() or _installed() or _cached()
    if found is None:
        raise NoRobot(
            f"the robot is that of robosuite {ROBOSUITE}, whose files are not here; run {INSTALL}, or run {DOWNLOAD}, "
            f"which keeps these files alone, or set {VARIABLE} to a folder with this release"
        )
    return found


@cache
def checked(name: str) -> Path:
    """Path of one of the robot's files, which this process has compared with the release.

    Args:
        name: one of `hashes`.

    Raises:
        NoRobot: the file is missing, or it is another one.
    """
    where = place()
    path = where.folder / name
    try:
        content = path.read_bytes()
    except OSError as error:
        raise NoRobot(
            f"{name} cannot be read in {where.label}: {(error.strerror or 'fault').lower()}; {where.remedy}"
        ) from None
    if not is_ours(name, content):
        raise NoRobot(f"{name} in {where.label} is not that of robosuite {ROBOSUITE}; {where.remedy}")
    return path


def is_ours(name: str, content: bytes) -> bool:
    """Whether the content of a file is that of the release."""
    return hashlib.sha256(content).hexdigest() == hashes().get(name)


def cached_folder() -> Path:
    """The folder that `DOWNLOAD` fills, as the folder `ASSETS` of robosuite."""
    return cache_folder() / f"robosuite-{ROBOSUITE}"


def _named() -> Place | None:
    """The folder that the environment variable names."""
    if not (setting := os.environ.get(VARIABLE)):
        return None
    folder = Path(setting).expanduser().absolute()
    remedy = f"set it to a folder with robosuite {ROBOSUITE}, or unset it"
    if not folder.is_dir():
        raise NoRobot(f"{VARIABLE} = {cut(setting)}, which is not a folder; {remedy}")
    inner = (folder / ASSETS, folder / ASSETS.removeprefix("robosuite/"))
    folder = next((each for each in inner if each.is_dir()), folder)
    return Place(folder, f"{cut(str(folder))} ({VARIABLE})", remedy)


def _installed() -> Place | None:
    """The folder of the installed robosuite. An editable one, whose files lie elsewhere, does not count."""
    try:
        robosuite = distribution("robosuite")
    except PackageNotFoundError:
        return None
    folder = Path(str(robosuite.locate_file(ASSETS)))
    message = f"the installed robosuite {robosuite.version} ({folder})"
    again = INSTALL.replace("--no-deps", "--no-deps --force-reinstall")
    remedy = f"run {again}, or set {VARIABLE} to a folder with this release"
    return Place(folder, message, remedy) if folder.is_dir() else None


def _cached() -> Place | None:
    """The folder that `DOWNLOAD` fills."""
    folder = cached_folder()
    return Place(folder, f"the cache ({folder})", f"run {DOWNLOAD}") if folder.is_dir() else None
