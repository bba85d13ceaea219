"""Moves of a suction cup: take hold of a face, carry a body to a place on the millimetre, let go. See `moves`."""

import math
from collections.abc import Callable

import mujoco
import numpy as np

from ..assets.scene import UP
from ..errors import GaveUp
from ..scenario import Action, Plan
from ..sim.loop import Loop
from ..sim.world import Mat3, Vec3, World
from .moves import CLOSED, go_to, release, steer, turn_between

FIRMLY = 0.15
"""How long the cup must hold on before a piece is lifted [s]."""
PACE, FIRM, FIRM_TURN = 6.0, 1.6, 2.0
"""Carrying slows down at `PACE` [1/s] by the distance left. By how much more than `steer` it asks for, in place and in
turn, against the friction of the joints: a hand that carries a piece trembles least at these under noisy actions."""
NEAR, INTEGRAL, LEVER = 0.003, 1.0, 0.08
"""Distance from which on errors add up [m], how fast they do [1/s], and how far from its middle a piece reaches [m]."""
MEMORY = 0.15
"""Time over which the error is averaged [s]; noise on the actions makes the hand tremble by half a millimetre."""


def suck(world: World, spot: Vec3, frame: Mat3, speed: float = 0.08, give_up: float = 3.0) -> Plan:
    """Press the cup onto a face at `spot` [m] until it has held on for `FIRMLY` [s]; by then it lies flat.

    Raises:
        GaveUp: that took longer than `give_up` [s].
    """
    end, sealed, setpoint = world.time + give_up, world.time, np.array([spot[0], spot[1], world.hand[2]])
    while world.time - sealed < FIRMLY:
        if world.time > end:
            raise GaveUp(f"the cup did not get hold of anything for {give_up:g} s")
        if not world.sealed:
            sealed, setpoint = world.time, setpoint - speed * Loop.PERIOD * UP
        yield firm(world, setpoint, -speed * UP * (not world.sealed), turn_between(world.hand_frame, frame))


def let_go(world: World) -> Plan:
    """Suction off, and straight up."""
    yield from release(world, seconds=0.1)
    yield from go_to(world, world.hand + 0.04 * UP, within=0.01)


def firm(world: World, setpoint: Vec3, velocity: Vec3, turn: Vec3) -> Action:
    """As `steer` with suction on, but stiffer: for the last millimetres of slow moves, where friction holds back."""
    return steer(world, world.hand + FIRM * (setpoint - world.hand), velocity, FIRM_TURN * turn, CLOSED)


def carry(
    world: World,
    body: str,
    target: Vec3,
    yaw: float,
    speed: float = 0.25,
    within: float = 0.0,
    slack: float = math.inf,
    until: Callable[[], bool] = lambda: False,
    give_up: float = 5.0,
) -> Plan:
    """Bring a body that hangs on the hand to `target` [m], upright and turned to `yaw` [rad], looking at the body.

    The hand follows a straight line to where it must be for the body to be right, plus what the error adds up to,
    against the weight and the friction of the joints. It waits where it lags on its way by `slack` [m], as something is
    in the way. Ends when the mean error of every point of the body is `within` [m], or when `until` says so.

    Raises:
        GaveUp: that took longer than `give_up` [s].
    """
    end, goal, frame, setpoint = world.time + give_up, np.asarray(target, float), upright(yaw), world.hand
    turned, way, mean = frame @ world.frame(body).T, goal - world.pos(body), np.full(6, 1.0)
    aim, aim_frame = goal + turned @ (world.hand - world.pos(body)), turned @ world.hand_frame
    way = way / max(math.sqrt(way @ way), 1e-9)
    while not until():
        left, askew = goal - world.pos(body), turn_between(world.frame(body), frame)
        mean = mean + Loop.PERIOD / MEMORY * (np.concatenate([left, LEVER * askew]) - mean)
        if math.sqrt(mean @ mean) < within:
            return
        if world.time > end:
            off, turn = 1000 * math.sqrt(left @ left), math.degrees(math.sqrt(askew @ askew))
            raise GaveUp(f"{body} stayed {off:.1f} mm and {turn:.1f} deg off for {give_up:g} s")
        across = left if left @ left < NEAR**2 else left - (left @ way) * way
        if max(across @ across, LEVER**2 * (askew @ askew)) < NEAR**2:
            shift, aim_frame = INTEGRAL * Loop.PERIOD * across, _rotation(INTEGRAL * Loop.PERIOD * askew) @ aim_frame
            aim, setpoint = aim + shift, setpoint + shift
        lag = max(0.0, float((setpoint - world.hand) @ way))
        setpoint = setpoint - max(0.0, lag - slack) * way
        ahead = aim - setpoint
        distance = math.sqrt(ahead @ ahead)
        velocity = ahead * (max(0.0, 1.0 - lag / slack) * min(speed, PACE * distance) / max(distance, 1e-9))
        setpoint = setpoint + velocity * Loop.PERIOD
        yield firm(world, setpoint, velocity, turn_between(world.hand_frame, aim_frame))


def upright(yaw: float) -> Mat3:
    """Orientation of a body that stands upright, turned by `yaw` [rad]."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _rotation(turn: Vec3) -> Mat3:
    """The matrix of a rotation vector [rad]."""
    quat, mat, angle = np.empty(4), np.empty(9), math.sqrt(turn @ turn)
    mujoco.mju_axisAngle2Quat(quat, turn / max(angle, 1e-12), angle)
    mujoco.mju_quat2Mat(mat, quat)
    return mat.reshape(3, 3)


def yaw_of(frame: Mat3) -> float:
    """Direction of a body's x axis, seen from above [rad]."""
    return math.atan2(frame[1, 0], frame[0, 0])
