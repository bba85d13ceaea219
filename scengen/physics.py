"""How things move that nobody holds: flight, bounces, rolling, sliding. Pure functions of numbers, [m], [s], [rad].

Oracles foresee with them, constraints ask them what is possible, tests compare the simulation with them. What swings is
in `scengen.assets.pendulum`, what rolls over a ramp in `scengen.assets.ramp`.
"""

import math

from scipy.optimize import brentq

from .geometry import UP, Vec3

GRAVITY = 9.81
"""[m/s^2]: MuJoCo's default."""
SPIN = 0.4
"""Moment of inertia of a solid ball over mass and radius squared."""


def flight(pos: Vec3, velocity: Vec3, height: float) -> tuple[float, Vec3]:
    """When what was thrown comes down through a height, and where; air is left out.

    Args:
        pos: where it is let go [m].
        velocity: with which [m/s].
        height: z of the level that it comes down through [m].

    Returns:
        Time from letting go [s] and place [m]. It is inf, and the place that of the apex, if it does not get up there.
    """
    up = float(velocity[2])
    rest = up**2 - 2 * GRAVITY * (height - float(pos[2]))
    seconds = (up + math.sqrt(max(0.0, rest))) / GRAVITY
    place = pos + velocity * seconds - GRAVITY * seconds**2 / 2 * UP
    return (seconds if rest >= 0.0 else math.inf), place


def reflected(velocity: Vec3, normal: Vec3, restitution: float) -> Vec3:
    """Velocity after a bounce off a smooth wall [m/s].

    Args:
        velocity: before it [m/s], shape (3,).
        normal: unit vector out of the wall.
        restitution: what is left of the speed along the normal, as a share.
    """
    return velocity - (1.0 + restitution) * min(0.0, float(velocity @ normal)) * normal


def contact(restitution: float, stiffness: float) -> tuple[float, float]:
    """MuJoCo's `solref` of a contact from which something comes back with a share of its speed.

    A contact is a damped spring that does not pull: Schwager and Poeschel, Granular Matter 9 (2007), eq. 19. It takes
    about pi / sqrt(stiffness) seconds, which have to be many time steps: with 2e4 they are 11 of 2 ms, and what comes
    back scatters, by when in a step the wall is met, by 0.01 about 0.84 and by 0.035 about 0.5; stiffer, by more.

    Args:
        restitution: that share, from 0.2 on, below 1.
        stiffness: [1/s^2].
    """

    def returned(damped: float) -> float:
        w = math.sqrt(1.0 - damped**2)
        return math.exp(-damped / w * (math.pi - math.atan2(2 * damped * w, 1.0 - 2 * damped**2)))

    damped = brentq(lambda ratio: returned(ratio) - restitution, 0.0, 0.7)
    return -stiffness, -2.0 * damped * math.sqrt(stiffness)


def rolled(speed: float, slowing: float, seconds: float) -> float:
    """How far something gets in some time [m] that begins at `speed` [m/s] and loses it at an even rate [m/s^2]."""
    if slowing > 0.0:
        seconds = min(seconds, speed / slowing)
    return speed * seconds - slowing * seconds**2 / 2


def passes(distance: float, speed: float, slowing: float) -> float:
    """When such a thing has come `distance` [m] far [s], 0 if it is past; inf if it stops before."""
    if distance <= 0.0:
        return 0.0
    left = speed**2 - 2 * slowing * distance
    return 2 * distance / (speed + math.sqrt(left)) if left > 0.0 else math.inf


def rolling_deceleration(resistance: float) -> float:
    """What a solid ball loses on the level that resists rolling with a share of its load [m/s^2].

    It carries 7/5 of its mass, as it turns.
    """
    return resistance * GRAVITY / (1.0 + SPIN)


def slipping(speed: float, spin: float, friction: float) -> tuple[float, float]:
    """Until when a solid ball slips on the level, and how fast it rolls then.

    Args:
        speed: of its centre [m/s].
        spin: speed of its surface about the centre [m/s]: `speed` if it rolls, 0 if it does not turn.
        friction: coefficient of sliding friction.

    Returns:
        Time [s], inf without friction, and speed [m/s] when it rolls.
    """
    slip = speed - spin
    if slip == 0.0:
        return 0.0, speed
    seconds = abs(slip) * SPIN / ((1.0 + SPIN) * friction * GRAVITY) if friction > 0.0 else math.inf
    return seconds, speed - slip * SPIN / (1.0 + SPIN)


def slip_angle(friction: float) -> float:
    """The slope on which a block begins to slide [rad]."""
    return math.atan(friction)


def slid(friction: float, rate: float, seconds: float) -> tuple[float, float]:
    """How far a block has slid on a slope that goes on turning, and how fast it is then.

    What pulls grows evenly from nothing, by g w / cos(a) in a second, as long as the slope turns little meanwhile.

    Args:
        friction: coefficient; it lets go at the angle a with tan(a) = friction.
        rate: w, at which the slope turns [rad/s].
        seconds: since it let go [s].

    Returns:
        Way [m] and speed [m/s] along the slope.
    """
    grows = GRAVITY * rate / math.cos(slip_angle(friction))
    return grows * seconds**3 / 6, grows * seconds**2 / 2
