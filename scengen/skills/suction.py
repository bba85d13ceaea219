"""Moves of a suction cup: take hold of a face, carry a body to a pose within millimetres, let go. See `motion`."""

import math

import numpy as np

from ..control.loop import Loop
from ..errors import GaveUp
from ..geometry import UP, Mat3, Vec3, about_z, between, rotation
from ..scenario import Action, Plan
from ..sim.arm import ROBOT, Arm
from .motion import CLOSED, INTEGRAL_ANGLE, MAX_CORRECTION, OPEN, STEADY, Pace, go_to, hold, push, retreat, steer
from .pace import approach
from .waiting import at_most

APPROACH_HEIGHT = 0.03
"""Height above a face from which the cup comes down on it [m]."""
FIRMLY = 0.15
"""Time that the cup must hold on before a piece is lifted [s]."""
BRAKE = 6.0
"""Speed limit of carrying per metre of remaining distance [1/s]."""
FIRM_TRANSLATION = 1.6
"""Gain of `firm` over `steer` in translation, against the friction of the joints: under noisy actions, a hand that
carries a piece trembles least at this gain and `FIRM_TURN`."""
FIRM_TURN = 2.0
"""Gain of `firm` over `steer` in rotation."""
INTEGRAL_DISTANCE = 0.003
"""Distance to the target below which errors are integrated [m]."""
INTEGRAL = 1.0
"""Integral gain of the error of a carried piece [1/s]."""
LEVER = 0.08
"""Distance from the middle of a piece to its farthest point, which turns an angle into a length [m]."""
MEMORY = 0.15
"""Time over which the error is averaged [s]; noise on the actions makes the hand tremble by half a millimetre."""
STAND_OFF = 0.012
"""Distance in front of an upright face at which the hand is squared up [m]."""
SQUARE = math.radians(0.1)
"""Angle within which the hand is squared up [rad]."""
SQUARED = 2.0
"""Longest time of squaring up [s]: under noise the mean error may stay above `SQUARE`."""
ADDING = 2.0
"""Integral gain of the error of a hand that is squared up [1/s]; at 4 the hand swings by a degree to either side."""


def take(
    arm: Arm, spot: Vec3, rot: Mat3, speed: float = 0.08, above: float = APPROACH_HEIGHT, pace: Pace = STEADY
) -> Plan:
    """Come down on a face at `spot` [m] from `above` it [m], and take hold of it with the cup; see `suck`."""
    yield from go_to(arm, spot + above * UP, rot, pace, OPEN)
    yield from suck(arm, spot, rot, speed)


def suck(arm: Arm, spot: Vec3, rot: Mat3, speed: float = 0.08, give_up: float = 3.0) -> Plan:
    """Press the cup onto a face at `spot` [m] until it has held on for `FIRMLY` [s]; by then it lies flat on it.

    Raises:
        GaveUp: the cup did not take hold within `give_up` [s].
    """
    end, sealed, setpoint = arm.world.time + give_up, arm.world.time, np.array([spot[0], spot[1], arm.hand[2]])
    while arm.world.time - sealed < FIRMLY:
        if arm.world.time > end:
            raise GaveUp(f"the cup did not get hold of anything for {give_up:g} s")
        if not arm.sealed:
            sealed, setpoint = arm.world.time, setpoint - speed * Loop.PERIOD * UP
        yield firm(arm, setpoint, -speed * UP * (not arm.sealed), between(arm.hand_rot, rot))


def suck_upright(arm: Arm, spot: Vec3, rot: Mat3, speed: float = 0.02, give_up: float = 6.0) -> Plan:
    """Take hold of an upright face of a free-standing body, at `spot` [m], from `STAND_OFF` in front of it.

    A cup that touches the face before its lip is closed pushes the body along, by 1 to 20 mm: three pads of the cup
    must meet the face within micrometres of each other. So the hand is squared up first, and its remaining angular
    error is integrated until the cup holds. Then the hand draws back: the ground's friction, which was against the
    push, would help to peel the cup off in the lift.

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


def press_on(arm: Arm, along: Vec3, speed: float, face: str) -> Plan:
    """Press the cup along a direction onto a face of a name, for 2 s at most, until it holds.

    Raises:
        GaveUp: the cup did not take hold.
    """
    yield from at_most(arm.world, 2.0, push(arm, speed * along, lambda: arm.sealed, CLOSED))
    yield from hold(arm, 0.3, CLOSED)
    if not arm.sealed:
        raise GaveUp(f"the cup did not get hold of {face}")


def put(arm: Arm, body: str, spot: Vec3, pace: Pace, speed: float = 0.04) -> Plan:
    """Bring the cup over `spot` [m], for 4 s at most, lower it until its body touches something, let go, move up.

    Args:
        arm: the arm.
        body: the body that hangs on the cup.
        spot: the place; its height does not count [m].
        pace: pace of the way there.
        speed: speed of the way down [m/s].
    """
    yield from at_most(arm.world, 4.0, go_to(arm, [spot[0], spot[1], arm.hand[2]], pace=pace))
    yield from push(arm, -speed * UP, lambda: arm.world.touching_bodies(body) > {ROBOT}, give_up=8.0)
    yield from let_go(arm)
    yield from retreat(arm)


def let_go(arm: Arm) -> Plan:
    """Switch the suction off, and go straight up."""
    yield from hold(arm, 0.1, OPEN)
    yield from retreat(arm, 0.04)


def firm(arm: Arm, setpoint: Vec3, velocity: Vec3, turn: Vec3) -> Action:
    """Action as of `steer` with suction on, but stiffer: for the last millimetres of slow moves, against friction."""
    return steer(arm, arm.hand + FIRM_TRANSLATION * (setpoint - arm.hand), velocity, FIRM_TURN * turn, CLOSED)


def carry(
    arm: Arm,
    body: str,
    target: Vec3,
    yaw: float,
    pace: Pace = STEADY,
    slack: float = math.inf,
) -> Plan:
    """Bring a body that hangs upright to `target` [m], turned to `yaw` [rad]; see `carry_to`."""
    yield from carry_to(arm, body, target, about_z(yaw), pace, slack)


def carry_to(
    arm: Arm,
    body: str,
    target: Vec3,
    rot: Mat3,
    pace: Pace = STEADY,
    slack: float = math.inf,
    near: float = INTEGRAL_DISTANCE,
) -> Plan:
    """Bring a body that hangs on the hand, or is held by a jaw, to `target` [m], turned to `rot`, by feedback.

    The hand follows a straight line to the pose at which the body is at its target, plus the integral of the error,
    against the weight and the friction of the joints. If the hand lags by `slack` [m], because something is in the way,
    it waits. The move ends when the mean error of every point of the body is within that of the pace.

    Args:
        near: distance to the target below which errors are integrated [m]; a body that turns in a jaw hangs farther off
            than one on a cup.

    Raises:
        GaveUp: the body was not there in the time of the pace.
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
        velocity = approach(aim - setpoint, pace.speed, max(0.0, 1.0 - lag / slack), BRAKE)
        setpoint = setpoint + velocity * Loop.PERIOD
        yield firm(arm, setpoint, velocity, between(arm.hand_rot, aim_rot))
