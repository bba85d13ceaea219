"""Versions of installed packages, read without importing the packages."""

import importlib.metadata
import platform
from functools import cache


@cache
def versions() -> dict[str, str]:
    """Versions of every package that the physics depends on, and the platform."""
    packages = {p: importlib.metadata.version(p) for p in ("scengen", "mujoco", "robosuite", "numpy")}
    return {**packages, "platform": f"{platform.system()}-{platform.machine()}"}
