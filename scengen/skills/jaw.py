"""Moves of a two-finger jaw: pick up, put down, poke, and their parts. See `motion`."""

from collections.abc import Generator
from contextlib import suppress

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import GaveUp
from ..geometry import UP, Mat3, Vec3
from ..scenario import Action, Plan
from ..sim.arm import Arm
from .motion import (
    CLOSED,
    COARSE,
    FINE,
    OPEN,
    STEADY,
    Condition,
    Pace,
    closing_along,
    go_to,
    hold,
    push,
    retreat,
    until,
)
from .waiting import at_most

Wrench = NDArray[np.float64]
"""Force [N] and torque [N m], shape (6,)."""

GRASP_TIME = 0.3
"""Time for the fingers to close and build up force [s]. By `robots.jaw.time_to_grip` from the widest gap it is enough
for objects 13 mm wide and wider. A thinner one takes as long as that function says, up to 0.51 s at 2 mm."""
RELEASE_TIME = 0.15
"""Time for the fingers to release any object [s]: `robots.jaw.time_to_free` of the widest one, 0.12 s, and latency."""


def grasp(arm: Arm, seconds: float = GRASP_TIME) -> Plan:
    """Close the jaw in place."""
    yield from hold(arm, seconds, CLOSED)


def release(arm: Arm, seconds: float = RELEASE_TIME) -> Plan:
    """Open the jaw in place."""
    yield from hold(arm, seconds, OPEN)


def let_go(arm: Arm, up: float = 0.10, seconds: float = RELEASE_TIME, pace: Pace = COARSE) -> Plan:
    """Open the jaw in place, and move straight up by `up` [m]."""
    yield from release(arm, seconds)
    yield from retreat(arm, up, pace)


def pick(
    arm: Arm,
    at: ArrayLike,
    closing: ArrayLike,
    above: float = 0.10,
    lift: float = 0.12,
    squeeze: float = GRASP_TIME,
    pace: Pace = FINE,
) -> Plan:
    """Come down on an object from above with the open jaw, grasp it, lift it.

    Args:
        arm: the arm.
        at: position of the grip site for the grasp [m].
        closing: level direction along which the fingers close. The nearer one of the two wrist angles is used.
        above: height from which the hand comes down [m].
        lift: height by which the object is lifted [m].
        squeeze: time for which the jaw closes [s].
        pace: pace of the way down.
    """
    yield from come_down(arm, at, closing, above, pace)
    yield from grasp(arm, squeeze)
    yield from retreat(arm, lift)


def snatch(arm: Arm, at: ArrayLike, closing: ArrayLike, to: ArrayLike) -> Plan:
    """Come down on an object as far as it lets the fingers, pinch, lift, and release at a place what has come along.

    Args:
        arm: the arm.
        at: position of the grip site to which the hand comes down, for 2 s at most [m].
        closing: level direction along which the fingers close.
        to: position at which the jaw opens [m]. If the object does not come along, and holds the jaw, it opens there.
    """
    target = np.asarray(at, float)
    yield from go_to(arm, target + 0.10 * UP, closing_along(arm, closing), COARSE, OPEN)
    yield from at_most(arm.world, 2.0, go_to(arm, target, pace=FINE))
    yield from grasp(arm, 0.5)
    with suppress(GaveUp):
        yield from retreat(arm, 0.12)
        yield from go_to(arm, to)
    yield from release(arm)


def come_down(arm: Arm, at: ArrayLike, closing: ArrayLike, above: float = 0.10, pace: Pace = FINE) -> Plan:
    """Come down on an object from above with the open jaw, as `pick` does, and do not close it."""
    target, rot = np.asarray(at, float), closing_along(arm, closing)
    yield from go_to(arm, target + above * UP, rot, COARSE, OPEN)
    yield from go_to(arm, target, rot, pace, OPEN)


def put(
    arm: Arm,
    body: str,
    at: ArrayLike,
    on: str,
    hover: float = 0.10,
    down: ArrayLike = -UP,
    speed: float = 0.04,
    near: float = 0.01,
) -> Plan:
    """Carry a held body over a place, lower it until it touches `on`, and release it.

    Args:
        arm: the arm.
        body: the held body.
        at: final position of the body's centre of mass [m].
        on: the body that it is put on.
        hover: height above `at` to which it is carried first [m].
        down: unit vector of the last stretch.
        speed: speed on the last stretch [m/s].
        near: length of the last stretch [m].
    """
    yield from lower(arm, body, at, on, hover, down, speed, near)
    yield from release(arm)


def lower(
    arm: Arm,
    body: str,
    at: ArrayLike,
    on: str,
    hover: float = 0.10,
    down: ArrayLike = -UP,
    speed: float = 0.04,
    near: float = 0.01,
) -> Plan:
    """Carry a held body over a place and lower it until it touches `on`, as `put` does, and do not release it."""
    target, last = np.asarray(at, float), np.asarray(down, float)
    yield from carry(arm, body, target + hover * UP, pace=COARSE)
    yield from carry(arm, body, target - near * last)
    yield from push(arm, speed * last, until=lambda: arm.world.touching(body, on))


def carry(
    arm: Arm, body: str, pos: ArrayLike, rot: Mat3 | None = None, pace: Pace = FINE, ends: Condition = lambda: False
) -> Plan:
    """Move a held body in a straight line to a pose, for any position in the jaw.

    Args:
        arm: the arm.
        body: the held body.
        pos: final position of its centre of mass [m].
        rot: its final orientation; by default the current one.
        pace: pace of the hand.
        ends: condition that stops the plan early.
    """
    world, target = arm.world, np.asarray(pos, float)
    turn = np.eye(3) if rot is None else rot @ world.rot(body).T
    yield from until(go_to(arm, target + turn @ (arm.hand - world.com(body)), turn @ arm.hand_rot, pace), ends)


def weigh(arm: Arm, seconds: float = 0.3, settle: float = 0.1) -> Generator[Action, None, Wrench]:
    """Hold still and measure the weight of the held object.

    Args:
        arm: the arm.
        seconds: time over which the readings are averaged [s].
        settle: time for which the hand is held still before that [s].

    Returns:
        `Arm.load`, averaged: force [N] and torque about the grip site [N m] that support the object, world axes, shape
        (6,).
    """
    yield from hold(arm, settle)
    readings: list[Wrench] = []
    for action in hold(arm, seconds):
        yield action
        readings.append(arm.load())
    return np.mean(readings, axis=0)


def poke(
    arm: Arm,
    start: ArrayLike,
    velocity: Vec3,
    until: Condition,
    above: float = 0.10,
    back: float = 0.03,
    rot: Mat3 | None = None,
    pace: Pace = STEADY,
) -> Plan:
    """Come down beside an object with closed fingers, move against it until a condition holds, step back.

    Args:
        arm: the arm.
        start: position at which the grip site starts to move [m].
        velocity: velocity of the poke, level or not [m/s].
        until: condition that ends the poke.
        above: height above `start` from which the hand comes down [m].
        back: distance by which the hand then moves back and up [m].
        rot: orientation of the hand. By default it points down with its fingers side by side across the motion.
        pace: pace of the way down.
    """
    yield from come_beside(arm, start, velocity, above, rot, pace)
    yield from push(arm, velocity, until)
    yield from step_back(arm, velocity, back)


def come_beside(
    arm: Arm, start: ArrayLike, velocity: Vec3, above: float = 0.10, rot: Mat3 | None = None, pace: Pace = STEADY
) -> Plan:
    """Come down beside an object with closed fingers, as `poke` does."""
    at, along = np.asarray(start, float), velocity / np.linalg.norm(velocity)
    rot = closing_along(arm, [-along[1], along[0], 0.0]) if rot is None else rot
    yield from go_to(arm, at + above * UP, rot, COARSE, CLOSED)
    yield from go_to(arm, at, rot, pace)


def step_back(arm: Arm, velocity: Vec3, back: float = 0.03) -> Plan:
    """Move back from a push and up by `back` [m] each."""
    yield from go_to(arm, arm.hand + back * (UP - velocity / np.linalg.norm(velocity)), pace=COARSE)
