"""Moves of a jaw that takes an upright bar near its foot and inserts it into a slot. See `motion`."""

import math
from collections.abc import Callable

import numpy as np

from ..control.loop import Loop
from ..errors import GaveUp
from ..geometry import UP, Mat3, Vec3, axes, between, rotation
from ..predicates import still
from ..scenario import Plan
from ..sim.arm import Arm
from .jaw import grasp
from .motion import CLOSED, COARSE, FINE, OPEN, STEADY, Condition, go_to, push, retreat, steer, turn_to
from .pace import approach

NOSE_TOLERANCE = 0.002
"""Distance from its place within which the nose has arrived [m]."""
TURN_TOLERANCE = 0.015
"""Angle to the line within which the bar is in line [rad]."""
REST_SPEED = 0.010
"""Speed below which the bar is at rest [m/s]."""
WAIT_DISTANCE = 0.006
"""Distance off the line at which the nose stops before it goes in [m]."""
GIVE_UP = 6.0
"""Time after which a move gives up [s]."""

Line = tuple[Mat3, Vec3]
"""Axes of a slot, x leading in, and the middle of its mouth [m]."""
Aim = Callable[[], Line]
"""Function that returns the present pose of the line into a slot, which may move."""


def take_upright(arm: Arm, at: Vec3, rot: Mat3, top: float) -> Plan:
    """Grasp an upright bar from the side with a level hand, and lift it.

    Args:
        arm: the arm.
        at: position of the grip site for the grasp [m].
        rot: level orientation of the hand.
        top: height above the grip site at which the hand turns level behind the bar [m].
    """
    yield from go_to(arm, at - 0.12 * rot[:, 2] + top * UP, pace=COARSE, grip=OPEN)
    yield from turn_to(arm, rot, 1.5)
    yield from go_to(arm, at - 0.09 * rot[:, 2] + 0.01 * UP, rot, STEADY)
    yield from go_to(arm, at, rot, FINE)
    yield from grasp(arm)
    yield from retreat(arm)


def push_in(arm: Arm, behind: Vec3, along: Vec3, ends: Condition) -> Plan:
    """Come down behind a bar that lies in a slot, push it in with closed fingers until a condition holds, step back.

    Args:
        arm: the arm.
        behind: position at which the grip site starts to push [m].
        along: unit vector into the slot.
        ends: condition that ends the push.
    """
    yield from go_to(arm, behind + 0.06 * UP, pace=COARSE, grip=CLOSED)
    yield from go_to(arm, behind, pace=FINE)
    yield from push(arm, 0.06 * along, ends)
    yield from go_to(arm, arm.hand - 0.03 * along)


def guide(
    arm: Arm,
    bar: str,
    nose: Callable[[], Vec3],
    aim: Aim,
    depth: float,
    speed: float = 0.15,
    ends: Condition | None = None,
) -> Plan:
    """Steer the nose of a held bar to a place on a line, with the bar's z axis along the line and one side level.

    Args:
        arm: the arm.
        bar: the bar's body.
        nose: function that returns the present position of the bar's end that goes in [m].
        aim: function that returns the line's present pose.
        depth: distance of the place behind the mouth [m].
        speed: speed of the approach while the nose is on the line [m/s].
        ends: condition that ends the move; by default the bar is at the place, in line and at rest.

    Raises:
        GaveUp: the move took longer than `GIVE_UP`.
    """
    world, end, setpoint = arm.world, arm.world.time + GIVE_UP, nose()
    while ends is None or not ends():
        (rot, mouth), tip = aim(), nose()
        goal = mouth + depth * rot[:, 0]
        turn, left = between(world.rot(bar), _level_sides(world.rot(bar), rot[:, 0])), goal - tip
        arrived = math.sqrt(left @ left) < NOSE_TOLERANCE and math.sqrt(turn @ turn) < TURN_TOLERANCE
        if ends is None and arrived and still(world, bar, REST_SPEED):
            return
        if world.time > end:
            short = f"{1000 * math.sqrt(left @ left):.0f} mm short of its place"
            raise GaveUp(f"the {bar}'s nose stayed {short} for {GIVE_UP:g} s")
        x, *off = rot.T @ (tip - mouth)
        waits = math.hypot(*off) / WAIT_DISTANCE if depth > 0.0 > x else 0.0
        velocity = approach(goal - setpoint, speed, max(0.0, 1.0 - waits))
        setpoint = setpoint + velocity * Loop.PERIOD
        yield steer(arm, setpoint + rotation(turn) @ (arm.hand - tip), velocity, turn, CLOSED)


def _level_sides(here: Mat3, u: Vec3) -> Mat3:
    """Orientation nearest to `here` in which a square bar points along `u` with level sides."""
    beside = np.cross(UP, u)
    return max((axes(x, u) for x in (UP, -UP, beside, -beside)), key=lambda rot: float(np.sum(rot * here)))
