"""Versions of the packages that the physics depends on, read without importing the packages, and the cache."""

import importlib.metadata
import os
import platform
from functools import cache
from pathlib import Path

ROBOSUITE = "1.5.2"
"""Release of robosuite whose Panda is the robot, and whose environments run certified scenarios."""


@cache
def versions() -> dict[str, str]:
    """Versions of every package that the physics depends on, and the platform.

    robosuite's is that of the robot's files (`robots.files`), whether or not robosuite is installed.
    """
    scengen, mujoco, numpy = (importlib.metadata.version(package) for package in ("scengen", "mujoco", "numpy"))
    packages = {"scengen": scengen, "mujoco": mujoco, "robosuite": ROBOSUITE, "numpy": numpy}
    return {**packages, "platform": f"{platform.system()}-{platform.machine()}"}


def cache_folder() -> Path:
    """The folder `scengen` in the user's folder of cached files, as the XDG specification says."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "scengen")
