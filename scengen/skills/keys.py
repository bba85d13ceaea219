"""Moves of a hand that types on a keyboard, at its current place. See `motion`."""

import math
from collections.abc import Callable

import numpy as np

from ..assets.keyboard import Keyboard
from ..geometry import UP, Vec3, between
from ..scenario import Action, Plan
from ..sim.arm import Arm
from .motion import CLOSED, COARSE, FINE, Condition, Pace, facing_down, go_to, hold, steer, until
from .pace import approach

TRAVEL_HEIGHT = 0.10
"""Height above the keys of hands on their way [m]."""
PRESS_PACE = Pace(0.08, 0.0, 20.0)
"""Pace of a finger that goes down on a key and stays there."""
EXTRA_TIME = 0.10
"""Time for which a key is held after its letter has counted [s]: a replay that does not look may be too short."""


def travel_z(arm: Arm, keyboard: Keyboard, body: str) -> float:
    """World z at which hands travel over the keys [m]."""
    return float(arm.world.pos(body)[2]) + keyboard.height + TRAVEL_HEIGHT


def is_up(arm: Arm, keyboard: Keyboard, body: str) -> bool:
    """Whether a hand is at the height at which hands travel, or at most 20 mm below."""
    return bool(arm.hand[2] > travel_z(arm, keyboard, body) - 0.02)


def rise(arm: Arm, keyboard: Keyboard, body: str) -> Plan:
    """Go straight up to the height at which hands travel."""
    if not is_up(arm, keyboard, body):
        yield from go_to(arm, [*arm.hand[:2], travel_z(arm, keyboard, body)], facing_down(), COARSE)


def press(
    arm: Arm,
    keyboard: Keyboard,
    body: str,
    spot: Callable[[], Vec3],
    count: Callable[[], float],
    late: Condition,
    grip: float = CLOSED,
) -> Plan:
    """Press a key: over it, down, stay there until it counts, up.

    Args:
        arm: the arm.
        keyboard: the keyboard.
        body: the keyboard's body.
        spot: function that returns the present position of the middle of the key's upper face [m].
        count: function that returns the number of letters that have counted.
        late: condition that ends the press although nothing has counted.
        grip: gripper command of the hand.
    """
    over, down = spot(), facing_down()
    yield from rise(arm, keyboard, body)
    yield from go_to(arm, [*over[:2], travel_z(arm, keyboard, body)], down, COARSE, grip)
    over = spot()
    yield from go_to(arm, over + 0.02 * UP, down, FINE, grip)
    before = count()
    yield from until(go_to(arm, over - 0.006 * UP, down, PRESS_PACE, grip), lambda: count() > before or late())
    if count() > before:
        yield from hold(arm, EXTRA_TIME, grip)
    yield from rise(arm, keyboard, body)


def type_or_go_home(
    arm: Arm, keyboard: Keyboard, body: str, key: Vec3 | None, counts: bool, home: Vec3, speed: float
) -> Action:
    """Action of a hand that types without memory: a law of where the hand is now.

    Over the key, down until it counts, up, home.

    Args:
        arm: the arm.
        keyboard: the keyboard.
        body: the keyboard's body.
        key: position of the middle of the upper face of the key that is to be pressed [m], or None.
        counts: whether a key has been held long enough to count.
        home: place of the hand while it has nothing to type [m].
        speed: largest speed of the hand [m/s].
    """
    hand, up, high = arm.hand, is_up(arm, keyboard, body), travel_z(arm, keyboard, body)
    spot = home if key is None else key
    off = math.hypot(*(spot - hand)[:2])
    # It goes down within 4 mm of the key's middle. While down it may be 10 mm off: at 12 it touches the neighbour.
    if off > (0.004 if up else 0.010):
        goal = np.array([*(spot if up else hand)[:2], max(high, home[2] if key is None else 0.0)])
    elif key is None:
        goal = home
    else:
        # It aims 10 mm below the cap's upper face, so it arrives at 0.04 m/s and presses with about 4 N: the
        # controller of a hand that is stopped from below pushes it aside too, the more the harder it presses.
        goal = key + TRAVEL_HEIGHT * UP if counts else key - 0.010 * UP
    velocity = approach(goal - hand, speed)
    return steer(arm, hand, velocity, between(arm.hand_rot, facing_down()), CLOSED)
