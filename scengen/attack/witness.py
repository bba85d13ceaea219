"""A witness taken apart: where the hand was, the phases that it went through, and plans that follow them."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..control.loop import Loop
from ..control.teleop import ALPHA, MOTION
from ..episode import Actions, Episode
from ..geometry import Mat3, Vec3, between, rotation
from ..scenario import Plan, Scenario
from ..sim.world import ROBOT, World
from ..skills.motion import STEP, STIFFNESS, go_to
from .macros import CLOSE, Macro
from .signature import Pair, Signature, pairs, signature, starts
from .solids import held

SHORTEST = 0.20
"""Phases last at least this long [s]."""
MOST = 12
"""Phases of a witness, at most: the shortest ones are joined."""
SLOW = 0.02
"""Speed of a hand that pauses [m/s]."""
AWAY = 0.02
"""Distance from where a phase begins at which the hand is brought there first [m]."""
MIRROR = np.array([1.0, -1.0, 1.0])
"""Left for right: what it does to a displacement; rotation vectors change the other two signs."""


@dataclass(frozen=True)
class Stage:
    """The state at the beginning of a phase, or at the end of the last one."""

    row: int
    state: NDArray[np.float64]
    held: float
    """How long the goal has held [s]."""
    signature: Signature
    holds: str | None
    """The free body in the hand; see `solids.held`."""


@dataclass(frozen=True)
class Trace:
    """A rollout that reached the goal, period by period."""

    actions: Actions
    hands: NDArray[np.float64]
    """Where the hand was before each action and after the last one [m], shape (n + 1, 3)."""
    rots: NDArray[np.float64]
    """Its orientation, shape (n + 1, 3, 3)."""
    stages: tuple[Stage, ...]
    """Beginnings of phases in order, and the end: phase k goes from stage k to stage k + 1."""
    signature: Signature
    """When the goal was reached."""
    events: tuple[tuple[int, Pair], ...]
    """Contacts that there were none of at the start: the row of the first one of each, in order."""

    @property
    def phases(self) -> list[tuple[int, int]]:
        """First row of each phase, and the first of the next one."""
        rows = [stage.row for stage in self.stages]
        return list(pairwise(rows))

    @property
    def handled(self) -> tuple[str, ...]:
        """Bodies that the robot touched, in that order."""
        pairs = [pair for _, pair in self.events if ROBOT in pair]
        return tuple(one if other == ROBOT else other for one, other in pairs)

    @property
    def concerned(self) -> tuple[str, ...]:
        """Bodies that touched anything new, the latest one first: they are nearest to the goal."""
        bodies = [body for _, pair in reversed(self.events) for body in pair if body != ROBOT]
        return tuple(dict.fromkeys(bodies))

    @property
    def releases(self) -> tuple[tuple[int, str], ...]:
        """Stages at which the gripper opens, each with the body that it lets go of."""
        opens = [(k, s) for k, s in enumerate(self.stages[1:-1], 1) if self.actions[s.row][6] <= 0]
        return tuple((k, s.holds) for k, s in opens if s.holds and self.actions[s.row - 1][6] > 0)


def trace(scenario: Scenario, world: World, actions: Actions) -> Trace | None:
    """Replay a witness and take it apart; None if it does not reach the goal."""
    world.reset()
    start, episode = starts(world), Episode(scenario, world)
    hands, rots, marks, events = [world.arm.hand], [world.arm.hand_rot], [_Mark.of(world)], list[tuple[int, Pair]]()
    states = [(world.state(), 0.0, signature(world, start))]
    for action in actions:
        outcome = episode.step(action)
        hands.append(world.arm.hand)
        rots.append(world.arm.hand_rot)
        marks.append(_Mark.of(world))
        states.append((world.state(), episode.held, signature(world, start)))
        events += [(len(marks) - 2, pair) for pair in sorted(marks[-1].touched[1] - marks[-2].touched[1])]
        if outcome is not None:
            break
    if episode.outcome != "success":
        return None
    left, rows = signature(world, start), actions[: len(hands) - 1]
    cuts = _cuts(marks, np.array(hands))
    stages = tuple(Stage(row, *states[row], marks[row].holds) for row in cuts)
    return Trace(rows, np.array(hands), np.array(rots), stages, left, tuple(events))


@dataclass(frozen=True)
class _Mark:
    """What is compared from one period to the next to find where a phase ends."""

    closed: bool
    """Whether the gripper is told to close."""
    touched: tuple[bool, frozenset[Pair]]
    """Whether the robot touches a free body, and all contacts since the start."""
    holds: str | None

    @classmethod
    def of(cls, world: World) -> "_Mark":
        touches = any(world.touching(ROBOT, body) for body in world.free_bodies)
        return cls(world.arm.grip > 0, (touches, pairs(world)), held(world))


def _cuts(marks: list[_Mark], hands: NDArray[np.float64]) -> list[int]:
    """Rows at which phases begin, the end included: changes of gripper and contacts, and pauses of the hand."""
    end, least = len(marks) - 1, round(SHORTEST / Loop.PERIOD)
    speed = np.linalg.norm(np.diff(hands, axis=0), axis=1) / Loop.PERIOD
    grips = {i - 1 for i in range(2, end) if marks[i].closed != marks[i - 1].closed}
    touches = {i for i in range(1, end) if marks[i].touched != marks[i - 1].touched}
    pauses = {i for i in range(1, end) if speed[i] >= SLOW > speed[i - 1]}
    cuts = [0]
    for row in sorted(grips | touches | pauses):
        if end - row >= least and (row in grips or row - cuts[-1] >= least):
            cuts.append(row)
    cuts.append(end)
    while len(cuts) > MOST + 1:
        lengths = np.diff(cuts)
        k = int(np.argmin(lengths))
        del cuts[k if 0 < k < len(cuts) - 1 else 1]
    return cuts


# --- plans ------------------------------------------------------------------------------------


def follow(world: World, path: Trace, macro: Macro) -> Plan:
    """A stretch of a witness once more, from wherever the hand is.

    Numbers of the macro: first row, last row, pace, 1 for mirrored left for right, displacement of the whole [m].
    What the witness asked for is asked for again; the hand is kept to the way by feedback.
    """
    first, last, pace, mirrored, *shift = macro.numbers
    arm, begin, end = world.arm, round(first), round(last)
    base, sign = path.hands[begin] + np.array(shift), MIRROR if mirrored else np.ones(3)
    if float(np.linalg.norm(base - arm.hand)) > AWAY:
        yield from go_to(arm, base, path.rots[begin], CLOSE, float(path.actions[max(begin - 1, 0)][6]))
    now = float(begin)
    while now < end:
        row = min(int(now), end - 1)
        aim = base + sign * (path.hands[row] - path.hands[begin])
        turn = between(arm.hand_rot, _aim(path, begin, row, sign))
        asked = np.array(path.actions[row], float)
        asked[:3] = pace * sign * asked[:3] + STIFFNESS * (aim - arm.hand) / STEP[:3]
        asked[3:6] = turn / STEP[3:] if pace != 1 or mirrored else asked[3:6] + turn / STEP[3:] / 2
        asked[:6] = np.clip(asked[:6], -1.0, 1.0)
        yield asked
        now += pace


def _aim(path: Trace, begin: int, row: int, sign: Vec3) -> Mat3:
    """Where the hand is to point, mirrored about the beginning of the stretch if asked for."""
    if sign[1] > 0:
        return path.rots[row]
    return rotation(-sign * between(path.rots[begin], path.rots[row])) @ path.rots[begin]


def again(actions: Actions, raw: bool) -> Plan:
    """Recorded actions once more: as they were received, or as they must be asked for to come through the filter."""
    before = np.zeros(MOTION)
    for action in np.asarray(actions, float):
        asked = action.copy()
        if not raw:
            asked[:MOTION] = np.clip(before + (action[:MOTION] - before) / ALPHA, -1.0, 1.0)
        before = action[:MOTION]
        yield asked
