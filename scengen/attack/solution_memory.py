"""A memory of one solution: its actions, and the path of the hand relative to the bodies that it went to.

Replayed as it is, a memory is open-loop. Used object-centrically, it works as MimicGen generates demonstrations
(Mandlekar et al. 2023, arXiv:2310.17596): the path is cut where the hand turns to another body, each part is stored
relative to that body, and feedback follows the body. The cuts follow from contacts and need no
annotation. With two arms, each arm follows its own path.
"""

import math
from collections.abc import Set as AbstractSet
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..control.loop import ACTION, Loop
from ..episode import Actions, Episode
from ..errors import GaveUp
from ..geometry import Mat3, Vec3, about_z, between
from ..scenario import Plan, Scenario
from ..sim.arm import Arm
from ..sim.world import World
from ..skills.motion import STEP, STIFFNESS, Pace, go_to, together
from .solids import held

ARRIVAL_PACE = Pace(0.30, 0.01, 2.0)
"""Pace at which the hand moves to the beginning of a part. If it does not arrive in time, the path continues anyway."""
MIN_HOLD_TIME = 0.2
"""Time that a body has to be in the hand before the hand turns to the next body [s]."""
MAX_FALL_TIME = 1.0
"""Maximum time that a released body may fall until it touches the body that it was brought to [s]."""
FIXED_BODIES = {"world", "table"}
"""Bodies that are not targets of the hand: they never move, and bodies that touch them are put down or slide."""


@dataclass(frozen=True)
class PathPart:
    """A stretch of a hand's path that belongs to one body."""

    first: int
    """Row of the first action of the stretch."""
    body: str | None
    """Name of the body; None if the path touches nothing. The path is then followed in world coordinates."""
    pos: Vec3
    """Position of the body at the beginning of the stretch [m]."""
    rot: Mat3
    """Orientation of the body at the beginning of the stretch."""


@dataclass(frozen=True)
class HandPath:
    """The path of one arm."""

    actions: Actions
    """Actions of this arm, shape (n, 7)."""
    hands: NDArray[np.float64]
    """Positions of the hand before each action [m], shape (n, 3)."""
    rots: NDArray[np.float64]
    """Orientations of the hand before each action, shape (n, 3, 3)."""
    parts: tuple[PathPart, ...]
    """Stretches of the path, in order."""

    def follow(self, arm: Arm) -> Plan:
        """The path again, each part relative to its body as it now is, or as it was if the body is missing."""
        world, ends = arm.world, [*(part.first for part in self.parts[1:]), len(self.actions)]
        here = _target_bodies(world)
        for part, end in zip(self.parts, ends, strict=True):
            turn, origin = np.eye(3), part.pos
            if part.body in here:
                turn, origin = upright(world.rot(part.body) @ part.rot.T), world.pos(part.body)
            aims = origin + (self.hands[part.first : end] - part.pos) @ turn.T
            rots = turn @ self.rots[part.first : end]
            try:
                yield from go_to(arm, aims[0], rots[0], ARRIVAL_PACE, self._grip(part.first))
            except GaveUp:
                pass  # this pose may be out of reach, though the hand only passes it; the next one may not be
            for asked, aim, rot in zip(self.actions[part.first : end], aims, rots, strict=True):
                action = np.array(asked, float)
                action[:3] = turn @ action[:3] + STIFFNESS * (aim - arm.hand) / STEP[:3]
                action[3:6] = turn @ action[3:6] + between(arm.hand_rot, rot) / STEP[3:] / 2
                yield np.clip(action, -1.0, 1.0)

    def _grip(self, row: int) -> float:
        """The gripper command in force when a part starts."""
        return float(self.actions[row - 1][6]) if row else -1.0


@dataclass(frozen=True)
class SolutionMemory:
    """The memory of a rollout that reached its goal."""

    actions: Actions
    """Actions as the controller received them."""
    paths: tuple[HandPath, ...]
    """Paths of the arms, in the order of the arms."""

    def follow(self, world: World) -> Plan:
        """The paths of all arms again; the actions go to the controller unfiltered."""
        yield from together(world, *(path.follow(arm) for path, arm in zip(self.paths, world.arms, strict=True)))


def remember(scenario: Scenario, world: World, actions: Actions) -> SolutionMemory:
    """Replay a solution in its own world, events included, and record the memory of it."""
    world.reset()
    episode = Episode(scenario, world)
    poses, bodies = list[dict[str, tuple[Vec3, Mat3]]](), _target_bodies(world)
    hands, trackers = list[list[tuple[Vec3, Mat3]]](), [_TargetTracker(arm, bodies) for arm in world.arms]
    for action in actions:
        poses.append({body: (world.pos(body), world.rot(body)) for body in bodies})
        hands.append([(arm.hand, arm.hand_rot) for arm in world.arms])
        episode.step(action)
        for tracker in trackers:
            tracker.look()
    paths = list[HandPath]()
    for number, tracker in enumerate(trackers):
        parts = list[PathPart]()
        for row, body in enumerate(_targets(tracker.touched)):
            if not parts or parts[-1].body != body:
                pos, rot = poses[row][body] if body else (np.zeros(3), np.eye(3))
                parts.append(PathPart(row, body, pos, rot))
        own = actions[:, ACTION * number : ACTION * (number + 1)]
        where, rots = (np.array(of_all) for of_all in zip(*(row[number] for row in hands), strict=True))
        paths.append(HandPath(own, where, rots, tuple(parts)))
    return SolutionMemory(actions, tuple(paths))


class _TargetTracker:
    """Finds the body that a hand goes to: one that it touches, that its load touches, or on which its load falls."""

    def __init__(self, arm: Arm, bodies: list[str]):
        self.arm, self.world, self.bodies = arm, arm.world, bodies
        self.touched = list[str | None]()
        """Body that was touched, by control period."""
        self.in_hand: str | None = None
        """Body in the hand."""
        self.periods = 0
        """Number of control periods that it has been in the hand."""
        self.leaving: str | None = None
        """Released body, until the hand has left it."""
        self.falling: tuple[str, int] | None = None
        """Released body and the row of its release, until it touches another body."""

    def look(self) -> None:
        """Evaluate the past control period."""
        world, row, body = self.world, len(self.touched), held(self.arm)
        if body != self.in_hand:
            if self._carried:
                self.leaving, self.falling = self.in_hand, (str(self.in_hand), row)
            self.in_hand, self.periods = body, 0
        self.periods += 1
        robot, carried = world.touching_bodies(self.arm.label), self._carried
        if self.leaving not in robot:
            self.leaving = None
        found = robot | (world.touching_bodies(carried) if carried else set())
        self.touched.append(self._nearest(found - {carried, self.leaving}))
        if self.falling:
            fallen, since = self.falling
            if below := self._nearest(world.touching_bodies(fallen) - {fallen}):
                self.touched[since] = below
            if below or (row - since) * Loop.PERIOD > MAX_FALL_TIME:
                self.falling = None

    @property
    def _carried(self) -> str | None:
        return self.in_hand if self.periods * Loop.PERIOD >= MIN_HOLD_TIME else None

    def _nearest(self, found: AbstractSet[str | None]) -> str | None:
        """The body that was touched before, if it is among them, else the one nearest to the hand."""
        touched = [body for body in self.bodies if body in found]
        if self.touched and self.touched[-1] in touched:
            return self.touched[-1]
        hand = self.arm.hand
        return min(touched, key=lambda body: float(np.linalg.norm(self.world.com(body) - hand)), default=None)


def _targets(touched: list[str | None]) -> list[str | None]:
    """The target in every control period: the body that is touched then or next; after the last contact, the last."""
    found, coming = list[str | None](), next((body for body in reversed(touched) if body), None)
    for body in reversed(touched):
        coming = body or coming
        found.append(coming)
    return found[::-1]


def upright(turn: Mat3) -> Mat3:
    """The rotation about the vertical that is nearest to a rotation, so that the hand is never turned upside down."""
    return about_z(math.atan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1]))


def _target_bodies(world: World) -> list[str]:
    """Names of all bodies of the scene that can be targets of a hand."""
    names = [world.model.body(i).name for i in range(world.model.nbody) if i not in world.own]
    return [name for name in names if name and name not in FIXED_BODIES]
