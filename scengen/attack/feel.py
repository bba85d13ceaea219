"""Tier of hands that feel instead of look: what a policy without eyes, or without the insight of a task, can do.

From states of the witness: a held body is balanced by loosening and catching it, let go in motion, or allowed to slip;
a move is tried turned to one side and then to the other; fingers slide along what they meet; a jaw waits beside a path.
"""

from collections.abc import Iterator
from itertools import product

import numpy as np

from ..geometry import UP, Vec3
from ..sim.arm import Arm
from .macros import Macro
from .player import Attempt, Player, in_turn
from .servo import moving
from .variations import rest

FEEL = "feel"
"""Tier of hands that feel."""

FIRST_SHIFTS = (0.03, -0.03, 0.06, -0.06)
"""Displacements beside the place of the witness at which a body is first loosened [m]."""
BALANCING = 6
"""Number of times that it is loosened."""
FLING_SPEEDS = (0.26, 0.15)
"""Speeds of a hand that lets go in motion [m/s]: 0.30 is its maximum."""
EARLY = (0.02, 0.06, 0.12)
"""Distances from the goal at which it opens [m]."""
PULSES = ((12, 2, 8), (6, 1, 12))
"""Number of slips, and control periods for which a gripper is off and on."""
ANGLES = (np.radians(10.0), np.radians(20.0))
"""Angles by which a way is tried to either side [rad]."""
TRY_SPEED = 0.08
"""Speed of a way that is tried [m/s]."""
LEAST_WAY = 0.02
"""Least length of a phase whose way is tried [m]."""
SLIDE_TIME = 3.0
"""Longest time of either part of a slide [s]."""
BESIDE = (0.036, -0.036)
"""Distances beside its place in the witness, along its closing direction, at which an open jaw waits [m]: one finger
stands 4 mm from the path of what comes."""


def felt(player: Player) -> Iterator[Attempt]:
    """All kinds of attempts in turn, for every arm, the most promising ones of each kind first."""
    arms = player.world.arms
    jaws = [arm for arm in arms if not arm.suction]
    makers = [made(player, arm) for made in (either_way, flung, slid, slipped) for arm in arms]
    makers += [made(player, arm) for made in (balanced, beside) for arm in jaws]
    return in_turn(makers)


def balanced(player: Player, arm: Arm) -> Iterator[Attempt]:
    """A body is put down beside the place where the witness lets it go, and balanced there."""
    for k, body in reversed(player.trace.releases(arm.number)):
        player.rewind(k)
        axes = [along for along, _ in player.solids[body].level_axes(player.world)] if body in player.solids else []
        for far, along in product(FIRST_SHIFTS, reversed(axes)):
            numbers = (*map(float, far * along), float(BALANCING))
            yield Attempt(FEEL, (Macro("settle", body, numbers, arm.number),), k)


def flung(player: Player, arm: Arm) -> Iterator[Attempt]:
    """A body in the hand is let go in motion on the straight way to where the witness leaves it."""
    for speed, early in product(FLING_SPEEDS, EARLY):
        for k, body in _held(player, arm):
            goal = tuple(map(float, player.goal_place(body)))
            yield Attempt(FEEL, (Macro("fling", body, (*goal, speed, early), arm.number),), k)


def slipped(player: Player, arm: Arm) -> Iterator[Attempt]:
    """A body in the hand slips a little, again and again; then the witness goes on."""
    for pulses in PULSES:
        for k, _ in _held(player, arm):
            slip = Macro("slip", "", tuple(map(float, pulses)), arm.number)
            yield Attempt(FEEL, (slip, *rest(player, k + 1)), k)
            yield Attempt(FEEL, (slip,), k)


def either_way(player: Player, arm: Arm) -> Iterator[Attempt]:
    """The way of a phase is tried turned to one side, then to the other; then the witness goes on."""
    for angle in ANGLES:
        for k in reversed(range(player.phases)):
            way = _way(player, arm, k)
            if np.linalg.norm(way) < LEAST_WAY:
                continue
            for axis in (UP, *_across(way)):
                lean = Macro("lean", "", (*map(float, axis), float(angle), *map(float, way), TRY_SPEED), arm.number)
                yield Attempt(FEEL, (lean, *rest(player, k + 1)), k)
                yield Attempt(FEEL, (lean,), k)


def slid(player: Player, arm: Arm) -> Iterator[Attempt]:
    """Beside the way of a phase the hand slides along what it meets until it is stopped, then goes along the way."""
    for k in reversed(range(player.phases)):
        way = _way(player, arm, k)
        if np.linalg.norm(way[:2]) < LEAST_WAY:
            continue
        ahead = way / np.linalg.norm(way)
        for side in (1.0, -1.0):
            along = side * np.cross(UP, ahead)
            along = along / np.linalg.norm(along)
            slide = Macro("slide", "", (*map(float, ahead), *map(float, along), SLIDE_TIME), arm.number)
            on = Macro("move", "", (*map(float, way), 0.15), arm.number)
            yield Attempt(FEEL, (slide, on, *rest(player, k + 1)), k)
            yield Attempt(FEEL, (slide, on), k)


def beside(player: Player, arm: Arm) -> Iterator[Attempt]:
    """An open jaw waits with one finger beside the path of a body that moves by itself, and closes when it is there."""
    restless = moving(player)
    for body in (body for body in player.trace.handled if body in restless):
        place = player.trace.hand_at(arm.number, body)
        if place is None:
            continue
        row = next(row for row, pair in player.trace.events if body in pair)
        closing = player.trace.rots[row, arm.number][:, 0]
        for far in BESIDE:
            at = np.array(place[:3]) + far * closing
            yield Attempt(FEEL, (Macro("meet", body, (*map(float, at), *place[3:], 0.0), arm.number),))


def _held(player: Player, arm: Arm) -> list[tuple[int, str]]:
    """Stages of the witness at which a body is in the hand, the last one first."""
    holds = [stage.holds[arm.number] for stage in player.trace.stages[: player.phases]]
    return [(k, body) for k, body in reversed([*enumerate(holds)]) if body]


def _way(player: Player, arm: Arm, k: int) -> Vec3:
    """Displacement of the hand in a phase of the witness [m]."""
    first, last = player.trace.phases[k]
    return player.trace.hands[last, arm.number] - player.trace.hands[first, arm.number]


def _across(way: Vec3) -> list[Vec3]:
    """The level direction across a way; none across an upright one."""
    across = np.cross(UP, way)
    far = float(np.linalg.norm(across))
    return [across / far] if far > LEAST_WAY else []
