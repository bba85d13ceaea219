"""The signature of a rollout, which describes how it reached the goal: the bodies that touched, and those that
moved."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..geometry import Vec3
from ..sim.arm import ROBOT
from ..sim.world import World

MIN_MOVE = 0.005
"""Displacement of its centre of mass above which a body counts as moved [m]."""

ContactPair = tuple[str, str]
"""Names of two bodies that touch, in alphabetical order; see `robots` for the robot."""


@dataclass(frozen=True)
class Signature:
    """Contacts since the start, and displacements."""

    pairs: frozenset[ContactPair]
    """Contacts of the scene's bodies with each other or the robot. At least one of the two bodies hangs on a joint."""
    moved: frozenset[str]
    """Free bodies that are more than `MIN_MOVE` away from their start."""

    def lacks(self, other: "Signature") -> "Signature":
        """The part of another signature that this one lacks."""
        return Signature(other.pairs - self.pairs, other.moved - self.moved)

    def __bool__(self) -> bool:
        return bool(self.pairs or self.moved)


def starts(world: World) -> dict[str, Vec3]:
    """Present positions of the centres of mass of the free bodies [m]."""
    return {body: world.com(body) for body in world.free_bodies}


def signature(world: World, start: Mapping[str, Vec3]) -> Signature:
    """The signature of a world since its reset.

    Args:
        start: positions of all free bodies at the reset, see `starts`.
    """
    away = {body: float(np.linalg.norm(world.com(body) - at)) for body, at in start.items()}
    return Signature(pairs(world), frozenset(body for body, distance in away.items() if distance > MIN_MOVE))


def pairs(world: World) -> frozenset[ContactPair]:
    """Contacts since the start; see `Signature.pairs`."""
    touched, found = world.loop.touched, set()
    names = scene_bodies(world)
    loose = [i for i in names if world.model.body_weldid[i] != 0]
    for i in loose:
        for k, name in [*names.items(), *robots(world).items()]:
            if i != k and touched[i, k]:
                found.add((min(names[i], name), max(names[i], name)))
    return frozenset(found)


def scene_bodies(world: World) -> dict[int, str]:
    """Names of the scene's bodies by number, without the robot's and without the floor."""
    return {b: world.model.body(b).name for b in range(1, world.model.nbody) if b not in world.own}


def robots(world: World) -> dict[int, str]:
    """Name of the robot in pairs, by its row in the table of contacts: `ROBOT`, or with two arms the label of each.

    The arms are distinguished because one arm that does the work of both bypasses the task.
    """
    if len(world.arms) == 1:
        return {len(world.loop.touched) - 1: ROBOT}
    return {world.model.nbody + k: arm.label for k, arm in enumerate(world.arms)}
