"""A memory of one solution: its actions, and the path of the hand relative to the bodies that it went to.

Played again as it is, a memory is open-loop replay. Object-centric, it is what MimicGen makes new demonstrations with
(Mandlekar et al. 2023, arXiv:2310.17596): the path is cut where the hand turns to another body, each part is kept
relative to that body, and it is followed by feedback wherever the body now is. Nobody annotates anything here: the cuts
follow from contacts. Of two arms each follows its own path.
"""

import math
from collections.abc import Set as AbstractSet
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..attack.solids import held
from ..control.loop import ACTION, Loop
from ..episode import Actions, Episode
from ..errors import GaveUp
from ..geometry import Mat3, Vec3, about_z, between
from ..scenario import Plan, Scenario
from ..sim.world import Arm, World
from ..skills.motion import STEP, STIFFNESS, Pace, go_to, together

ARRIVE = Pace(0.30, 0.01, 2.0)
"""How the hand is brought to where a part begins. If it does not get there in time the path goes on all the same."""
GRASP = 0.2
"""How long a body is in the hand before the hand turns to the next one [s]."""
FALL = 1.0
"""How long a body that was let go may fall until it touches what it was brought to [s]."""
GROUND = {"world", "table"}
"""Bodies that nobody goes to: what touches them is put down or slides, and they never move."""


@dataclass(frozen=True)
class PathPart:
    """A stretch of a hand's path that belongs to one body."""

    first: int
    """Row of its first action."""
    body: str | None
    """None where nothing is ever touched: the path then stays where it was."""
    pos: Vec3
    """Of the body when the stretch began [m]."""
    rot: Mat3
    """Its orientation then."""


@dataclass(frozen=True)
class HandPath:
    """What one arm did."""

    actions: Actions
    """Of this arm, shape (n, 7)."""
    hands: NDArray[np.float64]
    """Where the hand was before each action [m], shape (n, 3)."""
    rots: NDArray[np.float64]
    """Its orientation then, shape (n, 3, 3)."""
    parts: tuple[PathPart, ...]

    def follow(self, arm: Arm) -> Plan:
        """The path again, each part relative to its body as it now is; one whose body is not there, where it was."""
        world, ends = arm.world, [*(part.first for part in self.parts[1:]), len(self.actions)]
        here = _bodies(world)
        for part, end in zip(self.parts, ends, strict=True):
            turn, origin = np.eye(3), part.pos
            if part.body in here:
                turn, origin = _upright(world.rot(part.body) @ part.rot.T), world.pos(part.body)
            aims = origin + (self.hands[part.first : end] - part.pos) @ turn.T
            rots = turn @ self.rots[part.first : end]
            try:
                yield from go_to(arm, aims[0], rots[0], ARRIVE, self._grip(part.first))
            except GaveUp:
                pass  # out of reach perhaps, where the hand passed by only: what comes next may not be
            for asked, aim, rot in zip(self.actions[part.first : end], aims, rots, strict=True):
                action = np.array(asked, float)
                action[:3] = turn @ action[:3] + STIFFNESS * (aim - arm.hand) / STEP[:3]
                action[3:6] = turn @ action[3:6] + between(arm.hand_rot, rot) / STEP[3:] / 2
                yield np.clip(action, -1.0, 1.0)

    def _grip(self, row: int) -> float:
        """The gripper command in force when a part begins."""
        return float(self.actions[row - 1][6]) if row else -1.0


@dataclass(frozen=True)
class SolutionMemory:
    """What is kept of a rollout that reached its goal."""

    actions: Actions
    """As the controller received them."""
    paths: tuple[HandPath, ...]
    """Of every arm."""

    def follow(self, world: World) -> Plan:
        """The paths of all arms again; actions are meant for the controller as they are."""
        yield from together(world, *(path.follow(arm) for path, arm in zip(self.paths, world.arms, strict=True)))


def remember(scenario: Scenario, world: World, actions: Actions) -> SolutionMemory:
    """Play a solution again in its own world, events included, and keep what an object-centric memory keeps."""
    world.reset()
    episode = Episode(scenario, world)
    poses, bodies = list[dict[str, tuple[Vec3, Mat3]]](), _bodies(world)
    hands, every = list[list[tuple[Vec3, Mat3]]](), [_Aims(arm, bodies) for arm in world.arms]
    for action in actions:
        poses.append({body: (world.pos(body), world.rot(body)) for body in bodies})
        hands.append([(arm.hand, arm.hand_rot) for arm in world.arms])
        episode.step(action)
        for aims in every:
            aims.look()
    paths = list[HandPath]()
    for number, aims in enumerate(every):
        parts = list[PathPart]()
        for row, body in enumerate(_next(aims.touched)):
            if not parts or parts[-1].body != body:
                pos, rot = poses[row][body] if body else (np.zeros(3), np.eye(3))
                parts.append(PathPart(row, body, pos, rot))
        own = actions[:, ACTION * number : ACTION * (number + 1)]
        where, rots = (np.array(of_all) for of_all in zip(*(row[number] for row in hands), strict=True))
        paths.append(HandPath(own, where, rots, tuple(parts)))
    return SolutionMemory(actions, tuple(paths))


class _Aims:
    """Watches what a hand goes to: what it touches, what touches that which it carries, where that falls to."""

    def __init__(self, arm: Arm, bodies: list[str]):
        self.arm, self.world, self.bodies = arm, arm.world, bodies
        self.touched = list[str | None]()
        """The body touched in each control period."""
        self.in_hand: str | None = None
        self.periods = 0
        """How long that has been so."""
        self.leaving: str | None = None
        """What has been let go of, until the hand has left it."""
        self.falling: tuple[str, int] | None = None
        """What has been let go of, and when, until it is known what it falls to."""

    def look(self) -> None:
        """Note what the control period that has passed shows."""
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
        self.touched.append(self._choose(found - {carried, self.leaving}))
        if self.falling:
            fallen, since = self.falling
            if below := self._choose(world.touching_bodies(fallen) - {fallen}):
                self.touched[since] = below
            if below or (row - since) * Loop.PERIOD > FALL:
                self.falling = None

    @property
    def _carried(self) -> str | None:
        return self.in_hand if self.periods * Loop.PERIOD >= GRASP else None

    def _choose(self, found: AbstractSet[str | None]) -> str | None:
        """Of several bodies the one touched before, or the nearest to the hand."""
        touched = [body for body in self.bodies if body in found]
        if self.touched and self.touched[-1] in touched:
            return self.touched[-1]
        hand = self.arm.hand
        return min(touched, key=lambda body: float(np.linalg.norm(self.world.com(body) - hand)), default=None)


def _next(touched: list[str | None]) -> list[str | None]:
    """For every period the body that is touched then, or next; after the last contact the last one."""
    found, coming = list[str | None](), next((body for body in reversed(touched) if body), None)
    for body in reversed(touched):
        coming = body or coming
        found.append(coming)
    return found[::-1]


def _upright(turn: Mat3) -> Mat3:
    """The turn about the vertical that is nearest to a rotation: no memory stands on its head."""
    return about_z(math.atan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1]))


def _bodies(world: World) -> list[str]:
    """Names of all bodies of the scene that somebody may go to."""
    names = [world.model.body(i).name for i in range(world.model.nbody) if i not in world.own]
    return [name for name in names if name and name not in GROUND]
