"""scengen: physical puzzles for robot manipulation, each verified to be solvable before it is released.

    import scengen

    task = scengen.load_task("domino_single")
    draw = task.draw("wide_gaps", seed=0, index=7)
    certified = scengen.certify(draw.scenario, task.horizon)

The names below are the public interface. Each is imported at its first use.
"""

import ctypes.util
import importlib
import os
import sys
from typing import TYPE_CHECKING, Any

if sys.platform == "linux" and not {"MUJOCO_GL", "DISPLAY"} & os.environ.keys():
    # MuJoCo chooses its OpenGL back end at import. Without a display its default cannot draw.
    for _library, _backend in (("EGL", "egl"), ("OSMesa", "osmesa")):
        if ctypes.util.find_library(_library):
            os.environ["MUJOCO_GL"] = _backend
            break

if TYPE_CHECKING:
    from .certificate import Certificate
    from .compose import load_task
    from .envs.inline import picture
    from .envs.pools import reference_pool
    from .params import param
    from .pool import Pool
    from .samplers.task import Draw, Task
    from .samplers.task_files import tasks as list_tasks
    from .scenario import Scenario, Shortcut
    from .sim.world import World
    from .validate.certify import certify
    from .validate.rollout import replay, run

__all__ = [
    "Certificate",
    "Draw",
    "Pool",
    "Scenario",
    "Shortcut",
    "Task",
    "World",
    "certify",
    "list_tasks",
    "load_task",
    "param",
    "picture",
    "reference_pool",
    "replay",
    "run",
]

_HOME = {
    "Certificate": ("certificate", "Certificate"),
    "Draw": ("samplers.task", "Draw"),
    "Pool": ("pool", "Pool"),
    "Scenario": ("scenario", "Scenario"),
    "Shortcut": ("scenario", "Shortcut"),
    "Task": ("samplers.task", "Task"),
    "World": ("sim.world", "World"),
    "certify": ("validate.certify", "certify"),
    "list_tasks": ("samplers.task_files", "tasks"),
    "load_task": ("compose", "load_task"),
    "param": ("params", "param"),
    "picture": ("envs.inline", "picture"),
    "reference_pool": ("envs.pools", "reference_pool"),
    "replay": ("validate.rollout", "replay"),
    "run": ("validate.rollout", "run"),
}
"""Module and name of each public name. Importing scengen imports none of them, and no module of scengen imports this
one."""


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version  # here, because it takes 20 ms

        return version(__name__)
    if name not in _HOME:
        raise AttributeError(f"module 'scengen' has no attribute {name!r}; public names: {', '.join(__all__)}")
    module, inner = _HOME[name]
    return getattr(importlib.import_module(f".{module}", __name__), inner)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
