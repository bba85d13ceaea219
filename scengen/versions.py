"""Versions of what is installed, told without importing any of it."""

import importlib.metadata
import platform
from functools import cache


@cache
def versions() -> dict[str, str]:
    """Versions of everything that the physics depends on."""
    packages = {p: importlib.metadata.version(p) for p in ("scengen", "mujoco", "robosuite", "numpy")}
    return {**packages, "platform": f"{platform.system()}-{platform.machine()}"}
