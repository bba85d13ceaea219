"""Feedback plans of a hand that does not look: it feels its way, loosens, lets go in motion, and tries again.

The plans know bodies and arms, but no task. They read what a hand notices: that it has been stopped, that the body in
it tips or slips.
"""

import math
from contextlib import suppress
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ..control.loop import Loop
from ..errors import GaveUp
from ..geometry import UP, Mat3, Vec3, between, rotation
from ..scenario import Plan
from ..sim.arm import Arm
from ..sim.world import World
from ..skills.jaw import grasp, release
from ..skills.motion import CLOSED, OPEN, Pace, go_to, hold, push, retreat, turn_to, until

TIPPED = math.radians(1.5)
"""Angle by which a loosened body is felt to tip [rad]."""
LOOSE_TIME = 0.6
"""Longest time for which a jaw is loose around a body that may tip [s]."""
CLEAR = 0.03
"""Height by which a body is lifted before it is shifted [m]."""
STOPPED_SHARE = 0.3
"""Share of its commanded speed below which a hand counts as stopped."""
STOPPED_TIME = 0.1
"""Time for which a hand has to be that slow [s]."""
CREEP = 0.05
"""Speed of a hand that feels for a thing [m/s]."""
SHIFT = Pace(0.15, 0.004, 2.0)
"""Pace of a body that is shifted."""


def settle(arm: Arm, body: str, shift: ArrayLike, tries: int) -> Plan:
    """Put a held body down beside its place, loosen the jaw, catch the body as it tips, and shift it back, by half as
    much each time, until it stays.

    Args:
        arm: the arm.
        body: name of the held body.
        shift: displacement of the first place [m], shape (3,).
        tries: number of times that the jaw is loosened.
    """
    world, way, aim = arm.world, np.asarray(shift, float), arm.hand_rot
    far = float(np.linalg.norm(way))
    down = arm.hand[2]
    for _ in range(tries):
        with suppress(GaveUp):
            yield from retreat(arm, CLEAR, SHIFT)
            yield from go_to(arm, [*(arm.hand + way)[:2], arm.hand[2]], aim, SHIFT, CLOSED)
            yield from go_to(arm, [*arm.hand[:2], down], aim, SHIFT, CLOSED)
        tip = partial(_turn, world, body, world.rot(body))
        yield from until(hold(arm, LOOSE_TIME, OPEN), lambda tip=tip: _angle(tip()) > TIPPED)
        if _angle(tip()) <= TIPPED:
            break
        level, far = np.cross(tip(), UP), far / 2
        yield from grasp(arm)
        way = -far * level / max(float(np.linalg.norm(level)), 1e-9)
    yield from release(arm)
    yield from retreat(arm, 3 * CLEAR, SHIFT)


def slide(arm: Arm, against: ArrayLike, along: ArrayLike, seconds: float) -> Plan:
    """Feel for a surface, then slide along it until something stops the hand or the surface ends.

    Args:
        arm: the arm.
        against: direction in which the surface is, a unit vector, shape (3,).
        along: direction of the slide, a unit vector.
        seconds: time limit of either part [s].
    """
    normal, way = np.asarray(against, float), np.asarray(along, float)
    yield from until_stopped(arm, CREEP * normal, seconds)
    yield from until_stopped(arm, CREEP * (way + 0.3 * normal), seconds, way)


def until_stopped(arm: Arm, velocity: Vec3, seconds: float, way: Vec3 | None = None) -> Plan:
    """Move at a velocity [m/s] until the hand has almost stopped, with the jaw as it is.

    Args:
        arm: the arm.
        velocity: velocity of the hand, shape (3,).
        seconds: time limit [s].
        way: direction in which the motion counts, a unit vector; by default that of the velocity.
    """
    speed = float(np.linalg.norm(velocity))
    along = velocity / speed if way is None else way
    periods, here, slow = 0, arm.hand, 0

    def stopped() -> bool:
        nonlocal periods, here, slow
        moved, here = float((arm.hand - here) @ along), arm.hand
        periods += 1
        started = periods * Loop.PERIOD > 2 * STOPPED_TIME
        slow = slow + 1 if started and moved < STOPPED_SHARE * speed * Loop.PERIOD else 0
        return slow * Loop.PERIOD >= STOPPED_TIME

    with suppress(GaveUp):
        yield from push(arm, velocity, stopped, arm.grip, seconds)


def fling(arm: Arm, goal: ArrayLike, speed: float, early: float, body: str) -> Plan:
    """Carry a held body straight towards a place and open the jaw on the way, in motion.

    Args:
        arm: the arm.
        goal: place of the body's centre of mass [m], shape (3,).
        speed: speed of the hand [m/s].
        early: distance from the place at which the jaw opens [m].
        body: name of the held body.
    """
    world, place = arm.world, np.asarray(goal, float)
    left = place - world.com(body)
    velocity = speed * left / max(float(np.linalg.norm(left)), 1e-9)

    def near() -> bool:
        return float((place - world.com(body)) @ velocity) < early * speed

    with suppress(GaveUp):
        yield from push(arm, velocity, near, CLOSED, 4.0)
    with suppress(GaveUp):
        yield from push(arm, velocity, lambda: False, OPEN, 0.3)
    yield from hold(arm, 0.5, OPEN)


def slip(arm: Arm, pulses: int, open_periods: int, closed_periods: int) -> Plan:
    """Let a held body slip a little, again and again: the gripper is switched off for some control periods each time.

    Args:
        arm: the arm, with a jaw or a cup.
        pulses: number of times.
        open_periods: control periods for which it is off.
        closed_periods: control periods for which it is on again.
    """
    for _ in range(pulses):
        yield from hold(arm, open_periods * Loop.PERIOD, OPEN)
        yield from hold(arm, closed_periods * Loop.PERIOD, CLOSED)


def lean(arm: Arm, axis: ArrayLike, angle: float, way: ArrayLike, speed: float) -> Plan:
    """Try a way turned by an angle until the hand is stopped, come back, and try it turned to the other side.

    Args:
        arm: the arm.
        axis: axis of the turn, a unit vector, shape (3,).
        angle: angle to either side [rad].
        way: displacement of the hand [m], shape (3,).
        speed: speed of the hand [m/s].
    """
    start, straight, whole = arm.hand, arm.hand_rot, np.asarray(way, float)
    far = float(np.linalg.norm(whole))
    for turned in (angle, -angle):
        turn = rotation(turned * np.asarray(axis, float))
        with suppress(GaveUp):
            yield from turn_to(arm, turn @ straight, grip=arm.grip, give_up=1.5)
        before = arm.hand
        yield from until_stopped(arm, speed * (turn @ whole) / max(far, 1e-9), far / speed + 0.3)
        if float(np.linalg.norm(arm.hand - before)) > 0.9 * far:
            return
        with suppress(GaveUp):
            yield from go_to(arm, start, arm.hand_rot, SHIFT, arm.grip)


def _turn(world: World, body: str, before: Mat3) -> Vec3:
    """Turn of a body since it had an orientation, as a rotation vector [rad]."""
    return between(before, world.rot(body))


def _angle(turn: Vec3) -> float:
    """Angle of a rotation vector [rad]."""
    return float(np.linalg.norm(turn))
