"""What oracles are made of. Each move yields actions until a condition on the world holds.

A move steers the hand by feedback: the action asks for the velocity of a setpoint that runs along a straight
line, plus a correction towards it. Positions in [m], speeds in [m/s], orientations as 3 x 3 matrices.
"""

import math
from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from ..errors import GaveUp
from ..scenario import Action, Plan
from ..sim.loop import Loop
from ..sim.world import Mat3, Vec3, World

OPEN, CLOSED = -1.0, 1.0

STEP = np.array([0.05, 0.05, 0.05, 0.5, 0.5, 0.5])
"""What an action of 1 asks for [m, rad]: robosuite's OSC_POSE output range."""
RATE = math.sqrt(150.0) / 2
"""Velocity [m/s] that the controller settles at per metre of asked displacement: kp / kd = sqrt(kp) / 2 at kp = 150."""
STIFFNESS = 1.5
"""Share of the distance to the setpoint that is asked for as displacement; above 2.5 the hand starts to ring."""


def facing_down(yaw: float = 0.0) -> Mat3:
    """Orientation of a hand that points down; at `yaw` = 0 [rad], as after a reset, the fingers close along y."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[-s, c, 0.0], [c, s, 0.0], [0.0, 0.0, -1.0]])


def go_to(
    world: World,
    target: ArrayLike,
    frame: Mat3 | None = None,
    speed: float = 0.25,
    within: float = 0.003,
    grip: float | None = None,
    give_up: float = 6.0,
) -> Plan:
    """Carry the hand in a straight line to `target`, turning it to `frame` (default: as it is now).

    Ends when the hand is `within` [m] of the target and 0.05 rad of the frame.

    Raises:
        GaveUp: that took longer than `give_up` [s].
    """
    end, goal, setpoint = world.time + give_up, np.asarray(target, float), world.hand
    frame = world.hand_frame if frame is None else frame
    while True:
        left = goal - world.hand
        turn = turn_between(world.hand_frame, frame)
        if math.sqrt(left @ left) < within and math.sqrt(turn @ turn) < 0.05:
            return
        if world.time > end:
            raise GaveUp(
                f"the hand stayed {1000 * math.sqrt(left @ left):.0f} mm short of its target for {give_up:g} s"
            )
        ahead = goal - setpoint
        distance = math.sqrt(ahead @ ahead)
        pace = min(speed, 4.0 * distance)
        velocity = ahead * (pace / distance) if distance > 1e-9 else np.zeros(3)
        setpoint = setpoint + velocity * Loop.PERIOD
        yield steer(world, setpoint, velocity, turn, grip)


def push(
    world: World,
    velocity: ArrayLike,
    until: Callable[[], bool],
    grip: float | None = None,
    give_up: float = 3.0,
) -> Plan:
    """Move at a constant `velocity`, orientation held, until something happens.

    Raises:
        GaveUp: it did not happen within `give_up` [s].
    """
    end, along, setpoint, frame = (
        world.time + give_up,
        np.asarray(velocity, float),
        world.hand,
        world.hand_frame,
    )
    while not until():
        if world.time > end:
            raise GaveUp(f"pushing for {give_up:g} s did not do what it should")
        setpoint = setpoint + along * Loop.PERIOD
        yield steer(world, setpoint, along, turn_between(world.hand_frame, frame), grip)


def grasp(world: World, seconds: float = 0.5) -> Plan:
    """Close the gripper where the hand is, and give it `seconds` to build up force."""
    yield from hold(world, seconds, CLOSED)


def release(world: World, seconds: float = 0.3) -> Plan:
    """Open the gripper where the hand is."""
    yield from hold(world, seconds, OPEN)


def hold(world: World, seconds: float, grip: float | None = None) -> Plan:
    """Keep the hand where it is, against whatever pulls at it."""
    end, here, frame = world.time + seconds, world.hand, world.hand_frame
    while world.time < end:
        yield steer(world, here, np.zeros(3), turn_between(world.hand_frame, frame), grip)


def wait(world: World, until: Callable[[], bool], give_up: float) -> Plan:
    """Ask for nothing until something happens.

    Raises:
        GaveUp: it did not happen within `give_up` [s].
    """
    end = world.time + give_up
    while not until():
        if world.time > end:
            raise GaveUp(f"nothing came of waiting {give_up:g} s")
        yield idle(world)


def idle(world: World) -> Action:
    """No motion, the gripper command kept."""
    return np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, world.grip])


def steer(world: World, setpoint: Vec3, velocity: Vec3, turn: Vec3, grip: float | None) -> Action:
    """The action that follows a moving setpoint and turns the hand by a rotation vector [rad]."""
    action = np.empty(7)
    action[:3] = velocity / RATE + STIFFNESS * (setpoint - world.hand)
    action[3:6] = turn
    action[:6] = np.clip(action[:6] / STEP, -1.0, 1.0)
    action[6] = world.grip if grip is None else grip
    return action


def turn_between(here: Mat3, there: Mat3) -> Vec3:
    """The rotation vector in world axes [rad] that turns frame `here` into `there`."""
    quat, turn = np.empty(4), np.empty(3)
    mujoco.mju_mat2Quat(quat, (there @ here.T).ravel())
    mujoco.mju_quat2Vel(turn, quat, 1.0)
    return turn


def rotate(
    world: World,
    frame: Mat3,
    rate: float = 1.0,
    until: Callable[[], bool] = lambda: False,
    grip: float | None = None,
    within: float = 0.03,
    give_up: float = 6.0,
) -> Plan:
    """Turn the hand on the spot to `frame` at an even `rate` [rad/s], until it is there or something happens.

    Turns the shorter way; ends within `within` [rad] of the frame.

    Raises:
        GaveUp: it was not there within `give_up` [s].
    """
    end, here, start = world.time + give_up, world.hand, world.hand_frame
    way = turn_between(start, frame)
    angle, turned = math.sqrt(way @ way), 0.0
    while not until():
        left = turn_between(world.hand_frame, frame)
        if math.sqrt(left @ left) < within:
            return
        if world.time > end:
            raise GaveUp(f"the hand stayed {math.degrees(math.sqrt(left @ left)):.0f} deg short for {give_up:g} s")
        turned = min(angle, turned + rate * Loop.PERIOD)
        share, quat, mat = turned / max(angle, 1e-9), np.empty(4), np.empty(9)
        mujoco.mju_axisAngle2Quat(quat, way / max(angle, 1e-9), share * angle)
        mujoco.mju_quat2Mat(mat, quat)
        yield steer(world, here, np.zeros(3), turn_between(world.hand_frame, mat.reshape(3, 3) @ start), grip)
