"""Moves of two arms: what hangs on one goes over to the other. See `motion`."""

import math
from collections.abc import Callable

import numpy as np

from ..geometry import Mat3, Vec3, rotation
from ..robots.jaw import PALM_ALONG
from ..scenario import Plan
from ..sim.world import Arm
from .jaw import grasp
from .motion import OPEN, STEADY, Pace, alone, go_to, hold

LEFT: Vec3 = np.array([0.0, 1.0, 0.0])
"""From the right arm to the left one."""
FORWARDS: Mat3 = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""The right arm's hand, level, looks away from the robot; of four rolls the one with which it gets farthest."""
SIDEWAYS: Mat3 = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
"""The left arm's hand, level, points at the right arm; it closes up and down. Upside down it would run into joint 6."""
STAND_OFF, OVERLAP = 0.06, 0.010
"""Distance of the open jaw from a rim before it moves in, and how far the rim then is beyond the grip site [m]."""
GENTLY = Pace(0.06, 0.002)
"""Towards the rim: what pushes a thing peels it off the cup that holds it."""
CLOSING = 0.45
"""How long the jaw needs for something as thin as a rim [s]: `robots.jaw.time_to_grip` at 2 mm."""
LETTING_GO = 0.15
"""How long a cup needs to let go, while the jaw holds [s]."""


def sideways(side: float = 1.0, tilt: float = 0.0) -> Mat3:
    """As `SIDEWAYS`, of either arm, level or pointing down.

    Args:
        side: 1 for the left arm, -1 for the right one.
        tilt: how far it points below the level [rad].
    """
    level = np.array([[1.0], [side], [side]]) * SIDEWAYS
    return rotation(np.array([side * tilt, 0.0, 0.0])) @ level


def steepness(height: float, before: float) -> float:
    """Least tilt below the level at which the palm of a hand that closes up and down is over the ground [rad].

    With the rim `height` over the ground [m], and `before` the palm's front [m], the palm's lower edge is at
    height + before * sin(tilt) - PALM_ALONG * cos(tilt).
    """
    return math.atan2(PALM_ALONG, before) - math.asin(min(1.0, height / math.hypot(PALM_ALONG, before)))


def take_rim(taker: Arm, rim: Callable[[], Vec3], hand: Mat3, overlap: float = OVERLAP) -> Plan:
    """Close the jaw on a rim that another arm holds out, coming along the hand's approach; that arm holds still.

    Args:
        rim: where the outermost point of the rim is now [m].
        hand: orientation of the hand that takes it.
        overlap: how far the rim goes between the fingers, beyond the grip site [m].
    """
    along = hand[:, 2]
    yield from alone(taker, go_to(taker, rim() - STAND_OFF * along, hand, STEADY, OPEN))
    yield from alone(taker, go_to(taker, rim() + overlap * along, hand, GENTLY, OPEN))
    yield from alone(taker, grasp(taker, CLOSING))


def hand_over(giver: Arm, taker: Arm, rim: Callable[[], Vec3], hand: Mat3, overlap: float = OVERLAP) -> Plan:
    """The jaw takes the rim of what hangs on a cup, as in `take_rim`; only then the cup lets go, where it is."""
    yield from take_rim(taker, rim, hand, overlap)
    yield from alone(giver, hold(giver, LETTING_GO, OPEN))
