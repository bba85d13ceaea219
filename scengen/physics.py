"""Motion without contact by the robot: flight, bounces, rolling and sliding. Pure functions of numbers, in [m], [s] and
[rad].

Oracles predict with them, constraints ask them what is possible, and tests compare the simulation with them. Pendulums
are in `scengen.assets.pendulum`, balls that roll over a ramp in `scengen.assets.ramp`.
"""

import math
from typing import cast

from scipy.optimize import brentq

from .geometry import UP, Vec3

GRAVITY = 9.81
"""Acceleration of gravity [m/s^2]: MuJoCo's default."""
SPIN = 0.4
"""Moment of inertia of a solid ball, divided by its mass and its radius squared."""


def flight(pos: Vec3, velocity: Vec3, height: float) -> tuple[float, Vec3]:
    """Time and place at which a thrown object comes down through a height, without air resistance.

    Args:
        pos: position at the release [m].
        velocity: velocity at the release [m/s].
        height: z of the level [m].

    Returns:
        Time since the release [s] and place [m]. If the object does not reach the level, the time is inf and the place
        is the apex.
    """
    up = float(velocity[2])
    rest = up**2 - 2 * GRAVITY * (height - float(pos[2]))
    seconds = (up + math.sqrt(max(0.0, rest))) / GRAVITY
    place = pos + velocity * seconds - GRAVITY * seconds**2 / 2 * UP
    return (seconds if rest >= 0.0 else math.inf), place


def reflected(velocity: Vec3, normal: Vec3, restitution: float) -> Vec3:
    """Velocity after a bounce off a smooth wall [m/s].

    Args:
        velocity: velocity before the bounce [m/s], shape (3,).
        normal: unit vector out of the wall.
        restitution: share of the normal speed that remains.
    """
    return velocity - (1.0 + restitution) * min(0.0, float(velocity @ normal)) * normal


def contact(restitution: float, stiffness: float) -> tuple[float, float]:
    """MuJoCo's `solref` of a contact with a coefficient of restitution.

    A contact is a damped spring that does not pull: Schwager and Poeschel, Granular Matter 9 (2007), eq. 19. It takes
    about pi / sqrt(stiffness) seconds, which must be many time steps. With a stiffness of 2e4 it takes 11 steps of 2
    ms, and the restitution scatters with the phase of the step at which the wall is met: by 0.01 about 0.84 and by
    0.035 about 0.5. A stiffer contact scatters more.

    Args:
        restitution: share of the speed that remains, from 0.2 on, below 1.
        stiffness: [1/s^2].
    """

    def returned(damped: float) -> float:
        w = math.sqrt(1.0 - damped**2)
        return math.exp(-damped / w * (math.pi - math.atan2(2 * damped * w, 1.0 - 2 * damped**2)))

    damped = cast(float, brentq(lambda ratio: returned(ratio) - restitution, 0.0, 0.7))
    return -stiffness, -2.0 * damped * math.sqrt(stiffness)


def rolled(speed: float, slowing: float, seconds: float) -> float:
    """Distance covered in some time [m].

    Args:
        speed: initial speed [m/s].
        slowing: constant deceleration [m/s^2].
        seconds: the time [s].
    """
    if slowing > 0.0:
        seconds = min(seconds, speed / slowing)
    return speed * seconds - slowing * seconds**2 / 2


def passes(distance: float, speed: float, slowing: float) -> float:
    """Time until an object that slows down has covered a distance [s]: 0 if it is already past, inf if it stops before.

    Args:
        distance: distance ahead [m].
        speed: initial speed [m/s].
        slowing: constant deceleration [m/s^2].
    """
    if distance <= 0.0:
        return 0.0
    left = speed**2 - 2 * slowing * distance
    return 2 * distance / (speed + math.sqrt(left)) if left > 0.0 else math.inf


def rolling_deceleration(resistance: float) -> float:
    """Deceleration of a solid ball on level ground with a coefficient of rolling resistance [m/s^2].

    The effective mass is 7/5 of the ball's, because the ball turns.
    """
    return resistance * GRAVITY / (1.0 + SPIN)


def slipping(speed: float, spin: float, friction: float) -> tuple[float, float]:
    """Duration for which a solid ball slips on level ground, and its speed when it starts to roll.

    Args:
        speed: speed of its centre [m/s].
        spin: speed of its surface about the centre [m/s]: `speed` if it rolls, 0 if it does not turn.
        friction: coefficient of sliding friction.

    Returns:
        Time [s], inf without friction, and rolling speed [m/s].
    """
    slip = speed - spin
    if slip == 0.0:
        return 0.0, speed
    seconds = abs(slip) * SPIN / ((1.0 + SPIN) * friction * GRAVITY) if friction > 0.0 else math.inf
    return seconds, speed - slip * SPIN / (1.0 + SPIN)


def as_if_rolling(at: Vec3, velocity: Vec3, surface: Vec3, friction: float) -> tuple[Vec3, Vec3, Vec3]:
    """State of a ball that rolls from the start and that a ball on level ground equals once it no longer slips.

    Args:
        at: place of the ball [m].
        velocity: its level velocity [m/s].
        surface: velocity of its surface about its centre [m/s]: `velocity` if it rolls, 0 if it does not turn.
        friction: coefficient of sliding friction.

    Returns:
        Place [m], velocity [m/s] and velocity of the surface [m/s].
    """
    slip = velocity - surface
    if (speed := math.sqrt(slip @ slip)) < 1e-6:
        return at, velocity, surface
    seconds, left = slipping(speed, 0.0, friction)
    rolls = velocity - (1.0 - left / speed) * slip
    return at + seconds / 2 * (velocity - rolls), rolls, rolls


def slip_angle(friction: float) -> float:
    """Slope at which a block starts to slide [rad]."""
    return math.atan(friction)


def slid(friction: float, rate: float, seconds: float) -> tuple[float, float]:
    """Distance and speed of a block that slides on a slope that keeps turning.

    The accelerating force per mass grows linearly from zero at the rate g w / cos(a), as long as the slope turns little
    meanwhile.

    Args:
        friction: coefficient of friction; the block starts to slide at the angle a with tan(a) = friction.
        rate: rate w at which the slope turns [rad/s].
        seconds: time since the block started to slide [s].

    Returns:
        Distance [m] and speed [m/s] along the slope.
    """
    grows = GRAVITY * rate / math.cos(slip_angle(friction))
    return grows * seconds**3 / 6, grows * seconds**2 / 2


def stopping_speed(friction: float, way: float) -> float:
    """Speed from which sliding friction on level ground stops a block after `way` [m], in [m/s]."""
    return math.sqrt(2 * friction * GRAVITY * way)


def thrown_off(speed: float, friction: float, edge: float, drop: float) -> float:
    """Farthest distance that a block that is struck on top of another one can reach [m].

    Sliding friction slows it up to the edge of the lower one, it falls freely, and slides on. A block that tumbles does
    not get so far: measured are 0.6 to 1.0 of it.

    Args:
        speed: its speed after the blow [m/s].
        friction: its coefficient of friction.
        edge: distance to the edge of the lower block [m].
        drop: height from which it falls [m].
    """
    brake = 2 * friction * GRAVITY
    at_edge = math.sqrt(max(0.0, speed**2 - brake * edge))
    return edge + at_edge * math.sqrt(2 * drop / GRAVITY) + at_edge**2 / brake
