"""Tier of detours: on the way, something is done that the oracle does not do, and its solution goes on from there.

A rule that cannot be broken without losing the episode has no effect. An attempt makes a move beside its place, presses
what it holds on another body, pushes a body before it is taken, or opens the jaw a little. What has moved is taken
where it is now.
"""

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from ..geometry import between
from ..skills.motion import CLOSED, OPEN
from .macros import Macro
from .player import Attempt, Player, in_turn
from .solids import TABLE
from .variations import phase, rest, stretch

DETOUR = "detour"
"""Tier of detours."""

MISSES = (0.06, 0.03)
"""Distances by which a move misses its place [m]: at 6 cm a body meets the outer side of a finger."""
WAYS = ((0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
"""Directions in which a move misses."""
CLEAR_WAY = 0.10
"""Length of the straight way on which a hand comes to a body that it pushes aside, and leaves it [m]."""
DESCENT_OFFSET = 0.07
"""Distance beside its grasp at which a hand comes down beside a body [m]."""
PUSH_OFFSET = 0.015
"""Distance beside its grasp to which closed fingers then move [m]: they push a cube of 4 cm by some 2 cm."""
PRESSED = 0.1
"""Time for which a held body is pressed on another one [s]."""
SLIPS = (0.04, 0.10)
"""Times for which a jaw opens that holds a body [s]."""


def detours(player: Player) -> Iterator[Attempt]:
    """All kinds of detours in turn, the most promising ones of each kind first."""
    return in_turn([pressed(player), missed(player), moved(player), loosened(player)])


def missed(player: Player) -> Iterator[Attempt]:
    """A phase of the witness is made beside its place, then from its beginning as it should be.

    Phases that end in a grasp come first, then those before them.
    """
    taken = [one.stage for one in takings(player)]
    order = sorted(range(player.phases), key=lambda k: min((h - 1 - k for h in taken if h > k), default=player.phases))
    for miss, way in product(MISSES, WAYS):
        shift = tuple(miss * share for share in way)
        for k in order:
            yield Attempt(DETOUR, (phase(player, k, shift=shift), *resumed(player, k)), k)


def pressed(player: Player) -> Iterator[Attempt]:
    """A body in the hand of the witness is pressed on all other bodies in turn, or on one; the last ones first."""
    bodies = [body for body in player.trace.concerned if body in player.solids and body != TABLE]
    held = [one for one in takings(player) if one.stage < player.phases]
    for some, one in product((bodies, *([body] for body in bodies)), held):
        if others := [other for other in some if other != one.body]:
            presses = [Macro("press", other, (0.0, 0.0, PRESSED, 0.08), one.arm) for other in others]
            yield Attempt(DETOUR, (*presses, *rest(player, one.stage)), one.stage)


def moved(player: Player) -> Iterator[Attempt]:
    """A body is pushed aside with closed fingers before it is taken: from one of four sides, along the hand's way."""
    stages, hands = player.trace.stages, player.trace.hands
    for turn in range(4):
        for one in takings(player):
            taken = stages[one.stage].row
            away = np.linalg.norm(hands[:taken, one.arm] - hands[taken, one.arm], axis=1) > CLEAR_WAY
            if one.stage <= player.phases and away.any():
                row = int(np.flatnonzero(away)[-1])
                begin = max(k for k in range(one.stage) if stages[k].row <= row)
                there = (stretch(stages[begin].row, row),) if stages[begin].row < row else ()
                again = Macro("resume", one.body, (float(row), float(taken)))
                aside = _aside(player, one.arm, taken, turn)
                yield Attempt(DETOUR, (*there, *aside, again, *rest(player, one.stage)), begin)


def _aside(player: Player, number: int, row: int, turn: int) -> Iterator[Macro]:
    """Macros that push what an arm takes at a row of the witness aside.

    Args:
        number: number of the arm.
        turn: number of quarter turns from the closing direction of the hand to the side from which it pushes.
    """
    hand, rot = player.trace.hands[row, number], player.trace.rots[row, number]
    side, back = (1.0, 1.0, -1.0, -1.0)[turn] * rot[:, turn % 2], CLEAR_WAY * rot[:, 2]
    numbers, grip = between(np.eye(3), rot), OPEN if player.world.arms[number].suction else CLOSED
    for place in (
        hand - back + DESCENT_OFFSET * side,
        hand + DESCENT_OFFSET * side,
        hand + PUSH_OFFSET * side,
        hand - back + PUSH_OFFSET * side,
    ):
        yield Macro("go", "", (*map(float, (*place, *numbers)), grip), number)


def loosened(player: Player) -> Iterator[Attempt]:
    """The jaw opens a little with a body in it, and closes again."""
    for seconds, one in product(SLIPS, takings(player)):
        if one.stage < player.phases:
            slip = Macro("release", "", (seconds, 0.0), one.arm)
            yield Attempt(DETOUR, (slip, Macro("wait", "", (0.3,)), *rest(player, one.stage)), one.stage)


class Taking(NamedTuple):
    """A hand has taken a body."""

    stage: int
    """Stage of the witness."""
    arm: int
    """Number of the arm."""
    body: str


def takings(player: Player) -> list[Taking]:
    """All bodies that hands take in the witness, in order."""
    holds = [stage.holds for stage in player.trace.stages]
    return [
        Taking(k, arm, body)
        for k in range(1, len(holds))
        for arm, (body, before) in enumerate(zip(holds[k], holds[k - 1], strict=True))
        if body is not None and body != before
    ]


def resumed(player: Player, k: int) -> tuple[Macro, ...]:
    """The witness from phase `k` on. Until the next body is taken, the hands follow it as far as it has moved."""
    for one in takings(player):
        if one.stage > k:
            first, last = (float(player.trace.stages[stage].row) for stage in (k, one.stage))
            return Macro("resume", one.body, (first, last)), *rest(player, one.stage)
    return rest(player, k)
