"""Moves of one arm. Each yields actions, one per control period, until a condition on the world holds.

A move steers the hand by feedback: the action commands the velocity of a setpoint that moves along a straight line,
plus a correction towards it. Positions in [m], speeds in [m/s], orientations as 3 x 3 matrices. A move takes the arm
that it steers; `together` joins the moves of several arms.
"""

import math
from collections.abc import Callable
from functools import wraps
from typing import TypeVar

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from ..control import osc
from ..control.loop import Loop
from ..errors import GaveUp
from ..geometry import UP, Mat3, Vec3, about_z, between, rotation
from ..scenario import Action, Plan
from ..sim.arm import ROBOT, Arm
from ..sim.world import World
from .pace import APPROACH_RATE, Manner, Pace, approach
from .pace import COARSE as COARSE
from .pace import FINE as FINE
from .pace import STEADY as STEADY

OPEN = -1.0
"""Gripper command: jaw open, or suction off."""
CLOSED = 1.0
"""Gripper command: jaw closed, or suction on."""

STEP = np.array([osc.STEP] * 3 + [osc.TURN] * 3)
"""Displacement of an action of 1 [m, rad], shape (6,): robosuite's OSC_POSE output range."""
RATE = math.sqrt(osc.KP) / 2
"""Steady velocity of the controller [m/s] per metre of commanded displacement: kp / kd = sqrt(kp) / 2."""
STIFFNESS = 1.5
"""Share of the distance to the setpoint that is commanded as displacement. Above 2.5 the hand starts to oscillate."""
ANGLE_TOLERANCE = 0.05
"""Angle from the target orientation within which the hand has reached it [rad]."""
WRIST_SPARE = math.radians(10.0)
"""Angle that joint 7 keeps from its limits when a hand may be turned either way [rad]."""

INTEGRAL_RATE = 4.0
"""Rate at which `stay` adds up the position error [1/s]."""
MAX_CORRECTION = 0.012
"""Largest sum of that error along each axis [m]."""
INTEGRAL_RANGE = 0.03
"""Distance from the target within which the error adds up [m]. A hand farther away is still on its way."""
INTEGRAL_ANGLE = 0.2
"""Angle from the target orientation within which the error adds up [rad]."""
ROLL_SWITCH_ANGLE = math.radians(10.0)
"""Angle to the right up to which a hand keeps the roll that it has after a reset [rad]. See `facing`."""

Condition = Callable[[], bool]
"""Condition on the world, such as the end of a move."""
S = TypeVar("S")
"""Scenario family of a decorated method."""


def facing_down(yaw: float = 0.0) -> Mat3:
    """Orientation of a hand that points down. At `yaw` = 0 [rad] the fingers close along y, as after a reset."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[-s, c, 0.0], [c, s, 0.0], [0.0, 0.0, -1.0]])


def facing(azimuth: float, tilt: float) -> Mat3:
    """Orientation of a hand that looks along `azimuth`, `tilt` below the horizontal [rad], and whose fingers close
    level.

    Two rolls are possible. This is the one that a hand can reach from above the table: with the other one, joint 6 or 7
    reaches its limit on the way.
    """
    out = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    closing = np.array([-out[1], out[0], 0.0]) * (1.0 if azimuth > -ROLL_SWITCH_ANGLE else -1.0)
    along = math.cos(tilt) * out - math.sin(tilt) * UP
    return np.stack([closing, np.cross(along, closing), along], axis=1)


def hand_yaw(arm: Arm) -> float:
    """Yaw of a hand that points approximately down, as for `facing_down` [rad]."""
    x = arm.hand_rot[:, 0]
    return math.atan2(-x[0], x[1])


def closing_along(arm: Arm, direction: ArrayLike) -> Mat3:
    """Orientation of a hand that points down and whose fingers close along a level direction.

    Two wrist angles fit. The nearer one is chosen unless it would take joint 7 to its limit.
    """
    along = np.asarray(direction, float)
    turn = math.remainder(math.atan2(-along[0], along[1]) - hand_yaw(arm), math.pi)
    if not can_turn(arm, turn):
        turn -= math.copysign(math.pi, turn)
    return facing_down(hand_yaw(arm) + turn)


def can_turn(arm: Arm, angle: float, spare: float = WRIST_SPARE) -> bool:
    """Whether a hand that points approximately down can turn by `angle` [rad] on the spot.

    Args:
        angle: the turn [rad].
        spare: angle that joint 7 must keep from its limits [rad].
    """
    low, high = arm.wrist_range
    return low + spare < arm.joint_pos[6] - angle < high - spare


def go_to(arm: Arm, pos: ArrayLike, rot: Mat3 | None = None, pace: Pace = STEADY, grip: float | None = None) -> Plan:
    """Move the hand in a straight line to `pos` and turn it to `rot`.

    It ends when the hand has arrived within the pace's distance and within `ANGLE_TOLERANCE`.

    Args:
        pos: target of the grip site [m].
        rot: target orientation; by default the current one.
        pace: speed, accuracy and time limit.
        grip: gripper command; by default the last one.

    Raises:
        GaveUp: the move took too long.
    """
    world, goal, rot = arm.world, np.asarray(pos, float), arm.hand_rot if rot is None else rot
    manner = Manner.of(arm, goal, pace)
    if manner.pause:
        yield from hold(arm, manner.pause)
    setpoint, beside, pace = arm.hand, np.zeros(3), manner.pace
    end = world.time + pace.give_up
    while True:
        left = goal - arm.hand
        turn = between(arm.hand_rot, rot)
        if math.sqrt(left @ left) < pace.within and math.sqrt(turn @ turn) < ANGLE_TOLERANCE:
            return
        if world.time > end:
            short = f"{1000 * math.sqrt(left @ left):.0f} mm and {math.degrees(math.sqrt(turn @ turn)):.0f} deg short"
            place = ", ".join(f"{value:.2f}" for value in goal.tolist())
            raise GaveUp(f"the hand stayed {short} of its target ({place}) m for {pace.give_up:g} s{_touching(arm)}")
        ahead = goal - setpoint
        distance = math.sqrt(ahead @ ahead)
        speed = min(pace.speed, APPROACH_RATE * distance)
        velocity = ahead * (speed / distance) if distance > 1e-9 else np.zeros(3)
        setpoint = setpoint + velocity * Loop.PERIOD
        if not manner.styled:
            yield steer(arm, setpoint, velocity, turn, grip)
            continue
        before, beside = beside, manner.detour_at(distance)
        drift = (beside - before) / Loop.PERIOD
        yield steer(arm, setpoint + beside + manner.displacement_at(distance), velocity + drift, turn, grip)


def _touching(arm: Arm) -> str:
    """Bodies that an arm touches, for the reason of a move that gave up; empty if there are none."""
    touched = sorted(arm.world.touching_bodies(arm.label) - {ROBOT})
    return f", touching {', '.join(touched)}" if touched else ""


def stay(arm: Arm, pos: ArrayLike, rot: Mat3, until: Condition, pace: Pace = STEADY, grip: float | None = None) -> Plan:
    """Move the hand to `pos` as `go_to` does, and keep it there until a condition holds, whether it has arrived or not.

    Near the target the remaining error adds up, against the friction of the joints. Without that, a hand far from where
    it started stays a centimetre off.
    """
    goal, setpoint, more = np.asarray(pos, float), arm.hand, np.zeros(3)
    while not until():
        velocity = approach(goal - setpoint, pace.speed)
        setpoint = setpoint + velocity * Loop.PERIOD
        left, turn = goal - arm.hand, between(arm.hand_rot, rot)
        if max(math.sqrt(left @ left) / INTEGRAL_RANGE, math.sqrt(turn @ turn) / INTEGRAL_ANGLE) < 1.0:
            more = np.clip(more + INTEGRAL_RATE * Loop.PERIOD * left, -MAX_CORRECTION, MAX_CORRECTION)
        yield steer(arm, setpoint + more, velocity, turn, grip)


def push(arm: Arm, velocity: ArrayLike, until: Condition, grip: float | None = None, give_up: float = 3.0) -> Plan:
    """Move at a constant `velocity` [m/s] with constant orientation until a condition holds.

    Raises:
        GaveUp: it did not hold within `give_up` [s].
    """
    world, along, setpoint, rot = arm.world, np.asarray(velocity, float), arm.hand, arm.hand_rot
    end = world.time + give_up
    while not until():
        if world.time > end:
            way = ", ".join(f"{value:.2f}" for value in along.tolist())
            raise GaveUp(f"pushing with ({way}) m/s for {give_up:g} s met no end condition{_touching(arm)}")
        setpoint = setpoint + along * Loop.PERIOD
        yield steer(arm, setpoint, along, between(arm.hand_rot, rot), grip)


def turn_to(
    arm: Arm,
    rot: Mat3,
    rate: float = 1.0,
    until: Condition = lambda: False,
    grip: float | None = None,
    within: float = 0.03,
    give_up: float = 6.0,
) -> Plan:
    """Turn the hand on the spot to `rot`, until it is there or a condition holds.

    The hand turns the shorter way.

    Args:
        rot: target orientation.
        rate: constant rate of the turn [rad/s].
        until: condition that ends the move early.
        grip: gripper command; by default the last one.
        within: angle at which the hand has arrived [rad].
        give_up: time limit [s].

    Raises:
        GaveUp: the hand was not there within `give_up` [s].
    """
    world, here, start = arm.world, arm.hand, arm.hand_rot
    end, way, turned = world.time + give_up, between(start, rot), 0.0
    angle = math.sqrt(way @ way)
    while not until():
        left = between(arm.hand_rot, rot)
        if math.sqrt(left @ left) < within:
            return
        if world.time > end:
            short = f"{math.degrees(math.sqrt(left @ left)):.0f} deg short of its turn"
            raise GaveUp(f"the hand stayed {short} for {give_up:g} s{_touching(arm)}")
        turned = min(angle, turned + rate * Loop.PERIOD)
        aim = rotation(turned / max(angle, 1e-9) * way) @ start
        yield steer(arm, here, np.zeros(3), between(arm.hand_rot, aim), grip)


def turn_about_vertical(arm: Arm, angle: float, rate: float = 2.0) -> Plan:
    """Turn the hand about the vertical by up to a full turn [rad], in the direction of the sign."""
    for _ in range(2):  # each half is the shorter way
        yield from turn_to(arm, about_z(angle / 2) @ arm.hand_rot, rate)


def hold(arm: Arm, seconds: float, grip: float | None = None) -> Plan:
    """Hold the hand in place against external forces."""
    end, here, rot = arm.world.time + seconds, arm.hand, arm.hand_rot
    while arm.world.time < end:
        yield steer(arm, here, np.zeros(3), between(arm.hand_rot, rot), grip)


def wait(arm: Arm, until: Condition, give_up: float) -> Plan:
    """Send actions without motion until a condition holds.

    Raises:
        GaveUp: it did not hold within `give_up` [s].
    """
    end = arm.world.time + give_up
    while not until():
        if arm.world.time > end:
            raise GaveUp(f"waiting for {give_up:g} s met no end condition{_touching(arm)}")
        yield arm.idle


def retreat(arm: Arm, height: float = 0.10, pace: Pace = COARSE) -> Plan:
    """Move straight up by `height` [m]."""
    yield from go_to(arm, arm.hand + height * UP, pace=pace)


def until(plan: Plan, condition: Condition) -> Plan:
    """A plan that stops as soon as the condition holds."""
    while not condition():
        try:
            yield next(plan)
        except StopIteration:
            return


def together(world: World, *plans: Plan | None) -> Plan:
    """Run plans of all arms at once, in the order of the arms: actions of shape (7 * arms,). Ends with the last plan.

    An arm without a plan, or whose plan has ended, is held still with its last gripper command.
    """
    if len(plans) != len(world.arms):
        raise ValueError(f"{len(plans)} plans for {len(world.arms)} arms; pass None for an arm that is held still")
    running = list(plans)
    still = [hold(arm, math.inf) for arm in world.arms]
    while True:
        actions: list[Action] = []
        for i, arm in enumerate(world.arms):
            action = None if (plan := running[i]) is None else next(plan, None)
            if action is None and plan is not None:
                running[i], still[i] = None, hold(arm, math.inf)  # from where it is now
            actions.append(next(still[i]) if action is None else action)
        if all(plan is None for plan in running):
            return
        yield np.concatenate(actions)


def alone(arm: Arm, plan: Plan) -> Plan:
    """Run a plan of one arm while all others are held still."""
    plans = [plan if one is arm else None for one in arm.world.arms]
    yield from together(arm.world, *plans)


def with_arm(index: int) -> Callable[[Callable[[S, Arm], Plan]], Callable[[S, World], Plan]]:
    """Turn a method that plans for one arm into one that plans for the world, in which all other arms hold still.

    Args:
        index: index of the arm in `world.arms`: 0 is the right one, 1 the left one.
    """

    def decorate(plan: Callable[[S, Arm], Plan]) -> Callable[[S, World], Plan]:
        @wraps(plan)
        def planned(scenario: S, world: World) -> Plan:
            arm = world.arms[index]
            yield from alone(arm, plan(scenario, arm))

        return planned

    return decorate


def steer(arm: Arm, setpoint: Vec3, velocity: Vec3, turn: Vec3, grip: float | None) -> Action:
    """Action that follows a moving setpoint and turns the hand by a rotation vector.

    Args:
        arm: the arm.
        setpoint: position that the hand follows [m].
        velocity: velocity of the setpoint [m/s].
        turn: rotation vector that remains to be turned [rad].
        grip: gripper command; None keeps the last one.
    """
    action = np.empty(7)
    _steer(setpoint, arm.hand, velocity, turn, action)
    action[6] = arm.grip if grip is None else grip
    return action


@njit(nogil=True, cache=True)
def _steer(setpoint: Vec3, hand: Vec3, velocity: Vec3, turn: Vec3, action: Action) -> None:
    """Write the motion of `steer` for a hand at a position [m] into an action. A number that is none stays none."""
    for i in range(3):
        action[i] = velocity[i] / RATE + STIFFNESS * (setpoint[i] - hand[i])
        action[3 + i] = turn[i]
    for i in range(6):
        action[i] /= STEP[i]
        if action[i] > 1.0:
            action[i] = 1.0
        elif action[i] < -1.0:
            action[i] = -1.0
