"""Moves of a suction cup: take hold of a face, carry a body to a place on the millimetre, let go. See `motion`."""

import math

import numpy as np

from ..control.loop import Loop
from ..errors import GaveUp
from ..geometry import UP, Mat3, Vec3, about_z, between, rotation
from ..scenario import Action, Plan
from ..sim.world import Arm
from .motion import CLOSED, OPEN, STEADY, Pace, hold, retreat, steer

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
    """Bring a body that hangs on the hand to `target` [m], upright and turned to `yaw` [rad], looking at the body.

    The hand follows a straight line to where it must be for the body to be right, plus what the error adds up to,
    against the weight and the friction of the joints. It waits where it lags on its way by `slack` [m], as something is
    in the way. Ends when the mean error of every point of the body is within that of the pace.

    Raises:
        GaveUp: that took too long.
    """
    end, goal, upright, setpoint = arm.world.time + pace.give_up, np.asarray(target, float), about_z(yaw), arm.hand
    turned, way, mean = upright @ arm.world.rot(body).T, goal - arm.world.pos(body), np.full(6, 1.0)
    aim, aim_rot = goal + turned @ (arm.hand - arm.world.pos(body)), turned @ arm.hand_rot
    way = way / max(math.sqrt(way @ way), 1e-9)
    while True:
        left, askew = goal - arm.world.pos(body), between(arm.world.rot(body), upright)
        mean = mean + Loop.PERIOD / MEMORY * (np.concatenate([left, LEVER * askew]) - mean)
        if math.sqrt(mean @ mean) < pace.within:
            return
        if arm.world.time > end:
            off, turn = 1000 * math.sqrt(left @ left), math.degrees(math.sqrt(askew @ askew))
            raise GaveUp(f"{body} stayed {off:.1f} mm and {turn:.1f} deg off for {pace.give_up:g} s")
        across = left if left @ left < NEAR**2 else left - (left @ way) * way
        if max(across @ across, LEVER**2 * (askew @ askew)) < NEAR**2:
            shift, aim_rot = INTEGRAL * Loop.PERIOD * across, rotation(INTEGRAL * Loop.PERIOD * askew) @ aim_rot
            aim, setpoint = aim + shift, setpoint + shift
        lag = max(0.0, float((setpoint - arm.hand) @ way))
        setpoint = setpoint - max(0.0, lag - slack) * way
        ahead = aim - setpoint
        distance = math.sqrt(ahead @ ahead)
        velocity = ahead * (max(0.0, 1.0 - lag / slack) * min(pace.speed, BRAKE * distance) / max(distance, 1e-9))
        setpoint = setpoint + velocity * Loop.PERIOD
        yield firm(arm, setpoint, velocity, between(arm.hand_rot, aim_rot))
