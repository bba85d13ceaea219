"""What a rollout leaves behind that tells how it reached the goal: which bodies touched, and which moved."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..geometry import Vec3
from ..sim.world import ROBOT, World

MOVES = 0.005
"""How far the centre of mass of a body goes that counts as moved [m]."""

ContactPair = tuple[str, str]
"""Names of two bodies in alphabetical order; see `robots` for the robot."""


@dataclass(frozen=True)
class Signature:
    """Contacts since the start, and displacements."""

    pairs: frozenset[ContactPair]
    """Which bodies of the scene touched each other or the robot. At least one of two is loose: it hangs on a joint."""
    moved: frozenset[str]
    """Free bodies that are `MOVES` away from their start."""

    def lacks(self, other: "Signature") -> "Signature":
        """What the other one has and this one has not."""
        return Signature(other.pairs - self.pairs, other.moved - self.moved)

    def __bool__(self) -> bool:
        return bool(self.pairs or self.moved)


def starts(world: World) -> dict[str, Vec3]:
    """Where the centres of mass of the free bodies are now [m]."""
    return {body: world.com(body) for body in world.free_bodies}


def signature(world: World, start: Mapping[str, Vec3]) -> Signature:
    """The signature of what has happened in a world since it was reset.

    Args:
        start: of all free bodies, see `starts`.
    """
    away = {body: float(np.linalg.norm(world.com(body) - at)) for body, at in start.items()}
    return Signature(pairs(world), frozenset(body for body, distance in away.items() if distance > MOVES))


def pairs(world: World) -> frozenset[ContactPair]:
    """Which bodies have touched since the start; see `Signature.pairs`."""
    touched, found = world.loop.touched, set()
    names = scene_bodies(world)
    loose = [i for i in names if world.model.body_weldid[i] != 0]
    for i in loose:
        for k, name in [*names.items(), *robots(world).items()]:
            if i != k and touched[i, k]:
                found.add((min(names[i], name), max(names[i], name)))
    return frozenset(found)


def scene_bodies(world: World) -> dict[int, str]:
    """Names of all bodies by number, without the robot's and without the floor."""
    return {b: world.model.body(b).name for b in range(1, world.model.nbody) if b not in world.own}


def robots(world: World) -> dict[int, str]:
    """What stands for the robot in pairs, by its row in the table of contacts: `ROBOT`; of two arms, the label of each.

    Which arm has touched a thing belongs to how a goal was reached: one that does the work of both is a way around.
    """
    if len(world.arms) == 1:
        return {len(world.loop.touched) - 1: ROBOT}
    return {world.model.nbody + k: arm.label for k, arm in enumerate(world.arms)}
