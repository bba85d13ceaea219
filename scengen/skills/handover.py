"""Moves of two arms: a body that one holds is handed over to the other. See `motion`."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from ..geometry import UP, Mat3, Vec3, rotation, shortest
from ..robots.jaw import PALM_ALONG
from ..scenario import Plan
from ..sim.arm import Arm
from ..sim.world import World
from .jaw import carry, grasp, let_go
from .motion import COARSE, OPEN, STEADY, Pace, alone, go_to, hold, push, together, turn_to
from .suction import carry_to

LEFT: Vec3 = np.array([0.0, 1.0, 0.0])
"""Unit vector from the right arm to the left one."""
FORWARDS: Mat3 = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""Orientation of the right arm's hand, level, that looks away from the robot: of four rolls the farthest-reaching."""
SIDEWAYS: Mat3 = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
"""Orientation of the left arm's hand, level, that points at the right arm and closes up and down. Upside down the hand
would run into joint 6."""
STAND_OFF = 0.06
"""Distance of the open jaw from a rim before it moves in [m]."""
OVERLAP = 0.010
"""Distance of the rim beyond the grip site when the jaw closes [m]."""
GENTLY = Pace(0.06, 0.002)
"""Pace towards the rim: a push peels the body off the cup that holds it."""
CLOSING = 0.45
"""Time that the jaw needs to close on a rim [s]: `robots.jaw.time_to_grip` at a thickness of 2 mm."""
LETTING_GO = 0.15
"""Time that a cup needs to let go, while the jaw holds [s]."""


def sideways(side: float = 1.0, tilt: float = 0.0) -> Mat3:
    """Orientation of either arm's hand as `SIDEWAYS`, level or pointing down.

    Args:
        side: 1 for the left arm, -1 for the right one.
        tilt: angle of the hand below the level [rad].
    """
    level = np.array([[1.0], [side], [side]]) * SIDEWAYS
    return rotation(np.array([side * tilt, 0.0, 0.0])) @ level


def steepness(height: float, before: float) -> float:
    """Least tilt below the level at which the palm of a hand that closes up and down is over the ground [rad].

    If the rim is `height` over the ground [m] and `before` the palm's front [m], the palm's lower edge is at
    height + before * sin(tilt) - PALM_ALONG * cos(tilt).
    """
    return math.atan2(PALM_ALONG, before) - math.asin(min(1.0, height / math.hypot(PALM_ALONG, before)))


def take_rim(taker: Arm, rim: Callable[[], Vec3], hand: Mat3, overlap: float = OVERLAP) -> Plan:
    """Move the open jaw along its approach axis to a rim that another arm holds still, and close it.

    Args:
        rim: function that returns the current position of the rim's outermost point [m].
        hand: orientation of the hand that takes the rim.
        overlap: depth of the rim between the fingers, beyond the grip site [m].
    """
    along = hand[:, 2]
    yield from alone(taker, go_to(taker, rim() - STAND_OFF * along, hand, STEADY, OPEN))
    yield from alone(taker, go_to(taker, rim() + overlap * along, hand, GENTLY, OPEN))
    yield from alone(taker, grasp(taker, CLOSING))


def hand_over(giver: Arm, taker: Arm, rim: Callable[[], Vec3], hand: Mat3, overlap: float = OVERLAP) -> Plan:
    """Take the rim of a body that hangs on a cup, as in `take_rim`; only then the cup lets go, where it is."""
    yield from take_rim(taker, rim, hand, overlap)
    yield from alone(giver, hold(giver, LETTING_GO, OPEN))


def hold_out(giver: Arm, body: str, point: Vec3, axis: Vec3, pace: Pace) -> Plan:
    """Bring a body that hangs on a cup to a point [m], turned by the smallest angle at which its z is along an axis."""
    rot = giver.world.rot(body)
    yield from carry_to(giver, body, point, shortest(rot[:, 2], axis) @ rot, pace)


def draw_back(giver: Arm, parked: Vec3, pace: Pace = COARSE) -> Plan:
    """Draw a cup that has let go back from its body, and take its hand to a place out of the way [m]."""
    yield from go_to(giver, giver.hand - 0.08 * giver.hand_rot[:, 2], pace=pace)
    yield from go_to(giver, parked, pace=COARSE)


def parking(index: int, parked: Vec3, plan: Callable[[Arm], Plan]) -> Callable[[World], Plan]:
    """Turn a plan of one of two arms into one of the world, in which the other hand goes to a place out of the way.

    Args:
        index: index of that other hand's arm in `world.arms`.
        parked: the place [m].
        plan: the plan.
    """

    def planned(world: World) -> Plan:
        plans = [go_to(arm, parked, pace=COARSE) if arm.number == index else plan(arm) for arm in world.arms]
        yield from together(world, *plans)

    return planned


def upright_hand(taker: Arm, body: str) -> Mat3:
    """Orientation of a hand in which the body that it holds is upright."""
    return shortest(taker.world.rot(body)[:, 2], UP) @ taker.hand_rot


def stand_up(taker: Arm, body: str, spot: Vec3, heights: Sequence[float], pace: Pace, speed: float) -> Plan:
    """Turn a held body upright over a place, at one height after the other, lower it to the table, and release it.

    Args:
        taker: the arm whose jaw holds the body by its rim. The body droops all the time, and at every jerk.
        body: the body.
        spot: the place [m].
        heights: heights of the body's origin over the place [m].
        pace: pace of the moves between them.
        speed: speed of the last stretch [m/s].
    """
    world = taker.world
    for height in heights:
        yield from turn_to(taker, upright_hand(taker, body), 0.8)
        com = spot + (height + world.com(body)[2] - world.pos(body)[2]) * UP
        yield from carry(taker, body, com, pace=pace)
    yield from push(taker, -speed * UP, lambda: world.touching(body, "table"))
    yield from let_go(taker)
