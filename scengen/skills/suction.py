"""Moves of a suction cup: take hold of a face, carry a body to a place on the millimetre, let go. See `motion`."""

import math

import numpy as np

from ..control.loop import Loop
from ..errors import GaveUp
from ..geometry import UP, Mat3, Vec3, about_z, between, rotation
from ..scenario import Action, Plan
from ..sim.world import Arm
from .motion import CLOSED, INTEGRAL_ANGLE, MAX_CORRECTION, OPEN, STEADY, Pace, hold, retreat, steer

FIRMLY = 0.15
"""How long the cup must hold on before a piece is lifted [s]."""
BRAKE = 6.0
"""Carrying is no faster than this times the distance left [1/s]."""
FIRM, FIRM_TURN = 1.6, 2.0
"""By how much more than `steer` it asks for, in place and in turn, against the friction of the joints: a hand that
carries a piece trembles least at these under noisy actions."""
NEAR, INTEGRAL, LEVER = 0.003, 1.0, 0.08
"""Distance from which on errors add up [m], how fast they do [1/s], and how far from its middle a piece reaches [m]."""
MEMORY = 0.15
"""Time over which the error is averaged [s]; noise on the actions makes the hand tremble by half a millimetre."""
STAND_OFF, SQUARE, SQUARED = 0.012, math.radians(0.1), 2.0
"""How far in front of an upright face the hand is squared up [m], how exactly [rad], and for how long at most [s]:
under noise the mean error may stay above that."""
ADDING = 2.0
"""How fast the error of a hand that is to be square adds up [1/s]; at 4 it swings by a degree to either side."""


def suck(arm: Arm, spot: Vec3, rot: Mat3, speed: float = 0.08, give_up: float = 3.0) -> Plan:
    """Press the cup onto a face at `spot` [m] until it has held on for `FIRMLY` [s]; by then it lies flat.

    Raises:
        GaveUp: that took longer than `give_up` [s].
    """
    end, sealed, setpoint = arm.world.time + give_up, arm.world.time, np.array([spot[0], spot[1], arm.hand[2]])
    while arm.world.time - sealed < FIRMLY:
        if arm.world.time > end:
            raise GaveUp(f"the cup did not get hold of anything for {give_up:g} s")
        if not arm.sealed:
            sealed, setpoint = arm.world.time, setpoint - speed * Loop.PERIOD * UP
        yield firm(arm, setpoint, -speed * UP * (not arm.sealed), between(arm.hand_rot, rot))


def suck_upright(arm: Arm, spot: Vec3, rot: Mat3, speed: float = 0.02, give_up: float = 6.0) -> Plan:
    """Take hold of an upright face of a thing that stands free, at `spot` [m], from `STAND_OFF` in front of it.

    What touches it before the lip is closed pushes it along, by 1 to 20 mm: three pads of the cup must meet it within
    micrometres of each other. So the hand is squared up first, and what its turn lacks adds up until the cup holds.
    Then it draws back: the ground's friction, which was against the push, would help to peel the cup off in the lift.

    Args:
        rot: orientation of the hand, which looks at the face.

    Raises:
        GaveUp: the cup did not get hold of the face within `give_up` [s].
    """
    world, along, aim, off, mean = arm.world, rot[:, 2], rot, np.zeros(3), np.full(3, 1.0)
    before, start = spot - STAND_OFF * along, world.time

    def add_up(aim: Mat3) -> Mat3:
        turn = between(arm.hand_rot, rot)
        return rotation(ADDING * Loop.PERIOD * turn) @ aim if turn @ turn < INTEGRAL_ANGLE**2 else aim

    while math.sqrt(mean @ mean) > SQUARE and world.time - start < SQUARED:
        mean = mean + Loop.PERIOD / MEMORY * (between(arm.hand_rot, rot) - mean)
        aim, off = (
            add_up(aim),
            np.clip(off + ADDING * Loop.PERIOD * (before - arm.hand), -MAX_CORRECTION, MAX_CORRECTION),
        )
        yield steer(arm, before + off, np.zeros(3), FIRM_TURN * between(arm.hand_rot, aim), OPEN)
    setpoint, sealed, end = before + off, world.time, world.time + give_up
    while world.time - sealed < FIRMLY:
        if world.time > end:
            raise GaveUp(f"the cup did not get hold of the face for {give_up:g} s")
        if not arm.sealed:
            sealed, setpoint, aim = world.time, setpoint + speed * Loop.PERIOD * along, add_up(aim)
            yield firm(arm, setpoint, speed * along, between(arm.hand_rot, aim))
        else:
            setpoint, aim = arm.hand, arm.hand_rot
            yield firm(arm, setpoint, -speed * along, np.zeros(3))


def let_go(arm: Arm) -> Plan:
    """Suction off, and straight up."""
    yield from hold(arm, 0.1, OPEN)
    yield from retreat(arm, 0.04)


def firm(arm: Arm, setpoint: Vec3, velocity: Vec3, turn: Vec3) -> Action:
    """As `steer` with suction on, but stiffer: for the last millimetres of slow moves, where friction holds back."""
    return steer(arm, arm.hand + FIRM * (setpoint - arm.hand), velocity, FIRM_TURN * turn, CLOSED)


def carry(
    arm: Arm,
    body: str,
    target: Vec3,
    yaw: float,
    pace: Pace = STEADY,
    slack: float = math.inf,
) -> Plan:
    """As `carry_to`, of a body that hangs upright: it is brought to `target` [m], turned to `yaw` [rad]."""
    yield from carry_to(arm, body, target, about_z(yaw), pace, slack)


def carry_to(
    arm: Arm,
    body: str,
    target: Vec3,
    rot: Mat3,
    pace: Pace = STEADY,
    slack: float = math.inf,
    near: float = NEAR,
) -> Plan:
    """Bring a body that hangs on the hand, or is held by a jaw, to `target` [m], turned to `rot`, looking at the body.

    The hand follows a straight line to where it must be for the body to be right, plus what the error adds up to,
    against the weight and the friction of the joints. It waits where it lags on its way by `slack` [m], as something is
    in the way. Ends when the mean error of every point of the body is within that of the pace.

    Args:
        near: distance from which on errors add up [m]; a body that turns in a jaw comes to hang farther off than one on
            a cup.

    Raises:
        GaveUp: that took too long.
    """
    end, goal, setpoint = arm.world.time + pace.give_up, np.asarray(target, float), arm.hand
    turned, way, mean = rot @ arm.world.rot(body).T, goal - arm.world.pos(body), np.full(6, 1.0)
    aim, aim_rot = goal + turned @ (arm.hand - arm.world.pos(body)), turned @ arm.hand_rot
    way = way / max(math.sqrt(way @ way), 1e-9)
    while True:
        left, askew = goal - arm.world.pos(body), between(arm.world.rot(body), rot)
        mean = mean + Loop.PERIOD / MEMORY * (np.concatenate([left, LEVER * askew]) - mean)
        if math.sqrt(mean @ mean) < pace.within:
            return
        if arm.world.time > end:
            off, turn = 1000 * math.sqrt(left @ left), math.degrees(math.sqrt(askew @ askew))
            raise GaveUp(f"{body} stayed {off:.1f} mm and {turn:.1f} deg off for {pace.give_up:g} s")
        across = left if left @ left < near**2 else left - (left @ way) * way
        if max(across @ across, LEVER**2 * (askew @ askew)) < near**2:
            shift, aim_rot = INTEGRAL * Loop.PERIOD * across, rotation(INTEGRAL * Loop.PERIOD * askew) @ aim_rot
            aim, setpoint = aim + shift, setpoint + shift
        lag = max(0.0, float((setpoint - arm.hand) @ way))
        setpoint = setpoint - max(0.0, lag - slack) * way
        ahead = aim - setpoint
        distance = math.sqrt(ahead @ ahead)
        velocity = ahead * (max(0.0, 1.0 - lag / slack) * min(pace.speed, BRAKE * distance) / max(distance, 1e-9))
        setpoint = setpoint + velocity * Loop.PERIOD
        yield firm(arm, setpoint, velocity, between(arm.hand_rot, aim_rot))
