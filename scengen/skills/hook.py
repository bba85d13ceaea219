"""Moves of a hand that pulls objects in with a hook: take it, pass the object, pull, put it down. See `motion`.

Positions are polar coordinates about the robot's first axis, in which all bearings look the same to the arm.
"""

import math

import numpy as np

from ..assets.hook import Hook
from ..assets.prop import TABLE_TOP
from ..geometry import about_y, about_z, polar
from ..robots.jaw import TIP_BELOW
from ..robots.panda import BASE
from ..scenario import Plan
from ..sim.arm import Arm
from .jaw import carry, pick, release
from .motion import STEADY, go_to, retreat

END_DISTANCE = 0.035
"""Least distance from the end of the handle to the middle of the pads that hold it [m]."""
GRASP_HEIGHT = TIP_BELOW + 0.005
"""Height over the table at which the handle is held [m]."""
HAND_DISTANCE = 0.65
"""Distance of the hand from the robot's first axis when the tip is behind an object, if the handle is long enough
[m]."""
MIN_HAND_DISTANCE = 0.41
"""Least distance from the robot's first axis to which the hand pulls [m]. At 0.36 joint 6 of a hand that points down is
at its limit, and a hook that has slipped in the jaw needs a margin."""
RAISE_HEIGHT = 0.003
"""Height by which the held end of the hook is raised while it moves [m]."""
NOSE_TILT = 0.07
"""Angle by which the far end of the hook is tilted up while it moves [rad]. Dragged flat, the tip catches the table's
edge from outside as soon as it has been behind a cube that stands there."""
HOOK_CLEARANCE = 0.012
"""Clearance between hook and cube where the tip moves behind the cube [m]."""
PASSING_CLEARANCE = 0.03
"""Clearance between hook and cube on the way there [m]."""
SQUARING_PUSH = 0.015
"""Distance by which the handle pushes the cube sideways before the tip pulls it [m]. This turns a cube that is rotated
by 20 deg until its side lies against the handle."""


def shortest_stretch(hook: Hook, behind: float) -> float:
    """Distance from the best place to hold the handle to the face that pulls [m].

    It is as short as possible: the farther out the hook is held, the less its weight turns it in the jaw. If the handle
    is too short for that, it is held at its end, and the hand goes farther out than `HAND_DISTANCE`.

    Args:
        hook: the hook.
        behind: distance that the face that pulls must reach from the robot's first axis [m].
    """
    return min(hook.inside + hook.length / 2 - END_DISTANCE, behind - HAND_DISTANCE)


def nearest_pull(stretch: float) -> float:
    """Least distance from the robot's first axis that the face that pulls can reach [m].

    Args:
        stretch: distance from the grasp to the face that pulls [m].
    """
    return MIN_HAND_DISTANCE + stretch


def take_handle(arm: Arm, hook: Hook, body: str, stretch: float) -> Plan:
    """Grasp the handle across and leave the hook where it lies.

    Args:
        arm: the arm.
        hook: the hook.
        body: the hook's body.
        stretch: distance from the grasp to the face that pulls [m].
    """
    rot = arm.world.rot(body)
    at = arm.world.pos(body) + rot @ [hook.inside - stretch, 0, GRASP_HEIGHT]
    yield from pick(arm, at, closing=rot[:, 1], lift=0.0)


Leg = tuple[float, float, float]
"""Arguments of `slide`: bearing [rad], inside [m], beside [m]."""


def pull_legs(arm: Arm, hook: Hook, cube: str, half: float, to: float, mirror: float = 1.0) -> list[Leg]:
    """Legs by which a held hook passes a cube on the side away from its tip, comes behind it, and pulls.

    The first three end before the cube, beyond it, and with the tip behind it; the last one draws it in.

    Args:
        arm: the arm.
        hook: the hook.
        cube: the cube's body.
        half: half the cube's edge [m].
        to: final distance of the cube's centre from the robot's first axis [m].
        mirror: at -1 the hook passes on the other side, and the tip ends up behind nothing.
    """
    bearing, there = polar(arm.world.com(cube) - BASE)
    along = arm.world.rot(cube).T @ about_z(bearing)[:, 0]
    across = half * float(np.abs(along).sum())  # half the cube's width, seen along the bearing
    before, behind, drawn = (
        there - across - hook.width - PASSING_CLEARANCE,
        there + across + HOOK_CLEARANCE + hook.depth,
        half + to,
    )
    past, against = across + PASSING_CLEARANCE + hook.aside + hook.width / 2, half + hook.width / 2 - SQUARING_PUSH
    legs = ((before, past), (behind, past), (behind, against), (drawn, against))
    return [(bearing, inside, mirror * beside) for inside, beside in legs]


def slide(arm: Arm, hook: Hook, body: str, bearing: float, inside: float, beside: float) -> Plan:
    """Move the held hook over the table until it lies along `bearing` [rad], seen from the robot's first axis.

    Args:
        arm: the arm.
        hook: the hook.
        body: the hook's body.
        bearing: final direction of the handle [rad].
        inside: final distance of the face that pulls from the robot's first axis [m].
        beside: final distance of the handle's middle from the line of the bearing, on the side away from the tip [m].
    """
    world, rot = arm.world, about_z(bearing) @ about_y(-NOSE_TILT)
    lifted = TABLE_TOP - BASE[2] + RAISE_HEIGHT + hook.length / 2 * math.sin(NOSE_TILT)
    origin = BASE + about_z(bearing) @ [inside - hook.inside, -hook.side * beside, lifted]
    com = world.rot(body).T @ (world.com(body) - world.pos(body))
    yield from carry(arm, body, origin + rot @ com, rot, STEADY)


def put_down(arm: Arm, hook: Hook, body: str) -> Plan:
    """Move the tip, then the handle, away from the pulled cube, release the hook, and move up."""
    along, left = arm.world.rot(body)[:, 0], arm.world.rot(body)[:, 1]
    yield from go_to(arm, arm.hand + (0.03 + hook.depth) * along)
    yield from go_to(arm, arm.hand - 0.05 * hook.side * left)
    yield from release(arm)
    yield from retreat(arm)
