"""Fingerprint of the machine: machines with equal fingerprints replay actions bit for bit."""

from collections.abc import Mapping
from functools import cache
from typing import Protocol

import numpy as np

from ..assets.box import Domino
from ..assets.prop import TABLE_TOP, place, table
from ..installation import versions
from ..sim import scene_text
from ..sim.world import World


@cache
def fingerprint() -> str:
    """Hash of the final state of a fixed short rollout of the arm and a falling tile.

    It shows how this machine rounds. Machines with equal fingerprints replay actions bit for bit. On a machine with
    another fingerprint (another libm, another instruction set) the same actions end in nearly the same state.
    """
    scene = table()
    place(scene, Domino(), "tile", [0.1, 0.0, TABLE_TOP + 0.01], yaw=0.3)
    world = World.load(scene_text.emit(scene)[0])
    for k in range(30):
        world.step(np.array([np.sin(0.3 * k), np.cos(0.2 * k), -0.5, 0.1, -0.2, 0.3, 1.0]))
    return world.digest


class Made(Protocol):
    """A manifest or a certificate, which states what it was made with."""

    @property
    def versions(self) -> Mapping[str, str]: ...

    @property
    def fingerprint(self) -> str: ...


def same_bits(made: Made) -> bool:
    """Whether recorded actions must replay bit for bit here: same rounding, and the same MuJoCo."""
    return made.fingerprint == fingerprint() and made.versions["mujoco"] == versions()["mujoco"]
