"""Moves of a two-finger jaw: pick up, put down, poke. See `motion`."""

from collections.abc import Generator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..geometry import UP, Mat3, Vec3
from ..scenario import Action, Plan
from ..sim.world import Arm
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

Wrench = NDArray[np.float64]
"""Force [N] and torque [N m], shape (6,)."""

SQUEEZE = 0.3
"""How long the fingers need to close and to build up force [s]: enough, by `robots.jaw.time_to_grip` from the widest
gap, for things 13 mm wide and wider. A thinner one takes as long as that function says, up to 0.51 s at 2 mm."""
LET_GO = 0.15
"""How long they need to let go of anything [s]: `robots.jaw.time_to_free` of the widest thing, 0.12 s, and latency."""


def grasp(arm: Arm, seconds: float = SQUEEZE) -> Plan:
    """Close the jaw where the hand is."""
    yield from hold(arm, seconds, CLOSED)


def release(arm: Arm, seconds: float = LET_GO) -> Plan:
    """Open the jaw where the hand is."""
    yield from hold(arm, seconds, OPEN)


def pick(
    arm: Arm,
    at: ArrayLike,
    closing: ArrayLike,
    above: float = 0.10,
    lift: float = 0.12,
    squeeze: float = SQUEEZE,
    pace: Pace = FINE,
) -> Plan:
    """Come down on a thing from above with the open jaw, grasp it, lift it.

    Args:
        at: where the grip site is to be [m].
        closing: level direction along which the fingers close; of the two wrist turns it is the nearer one.
        above: height from which the hand comes down [m].
        lift: how far it goes up again [m].
        squeeze: how long the jaw closes [s].
        pace: of the way down.
    """
    target, rot = np.asarray(at, float), closing_along(arm, closing)
    yield from go_to(arm, target + above * UP, rot, COARSE, OPEN)
    yield from go_to(arm, target, rot, pace, OPEN)
    yield from grasp(arm, squeeze)
    yield from retreat(arm, lift)


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
    """Bring a held body over a place, lower it until it touches `on`, and let go.

    Args:
        at: where the body's centre of mass is to be [m].
        hover: height at which it is brought there [m].
        down: unit vector of the last stretch.
        speed: of the last stretch [m/s].
        near: how long the last stretch is [m].
    """
    target, last = np.asarray(at, float), np.asarray(down, float)
    yield from carry(arm, body, target + hover * UP, pace=COARSE)
    yield from carry(arm, body, target - near * last)
    yield from push(arm, speed * last, until=lambda: arm.world.touching(body, on))
    yield from release(arm)


def carry(
    arm: Arm, body: str, pos: ArrayLike, rot: Mat3 | None = None, pace: Pace = FINE, ends: Condition = lambda: False
) -> Plan:
    """Take a held body in a straight line to a pose, wherever it sits in the jaw.

    Args:
        pos: where its centre of mass is to be [m].
        rot: its orientation there; as it is now by default.
        ends: the plan is broken off when this holds.
    """
    world, target = arm.world, np.asarray(pos, float)
    turn = np.eye(3) if rot is None else rot @ world.rot(body).T
    yield from until(go_to(arm, target + turn @ (arm.hand - world.com(body)), turn @ arm.hand_rot, pace), ends)


def weigh(arm: Arm, seconds: float = 0.3, settle: float = 0.1) -> Generator[Action, None, Wrench]:
    """Hold still and feel the weight of what is in the hand.

    Args:
        seconds: over which the readings are averaged [s].
        settle: how long before that the hand is held still [s].

    Returns:
        `Arm.load`, averaged: force [N] and torque about the grip site [N m] that support it, world axes, shape (6,).
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
    """Come down beside a thing with closed fingers, move against it until something happens, step back.

    Args:
        start: where the grip site begins to move [m].
        velocity: of the poke, level or not [m/s].
        above: height from which the hand comes down to `start` [m].
        back: how far it goes back and up in the end [m].
        rot: orientation of the hand; by default it points down with its fingers side by side across the motion.
        pace: of the way down.
    """
    at, along = np.asarray(start, float), velocity / np.linalg.norm(velocity)
    rot = closing_along(arm, [-along[1], along[0], 0.0]) if rot is None else rot
    yield from go_to(arm, at + above * UP, rot, COARSE, CLOSED)
    yield from go_to(arm, at, rot, pace)
    yield from push(arm, velocity, until)
    yield from go_to(arm, arm.hand + back * (UP - along), pace=COARSE)
