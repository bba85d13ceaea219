"""Moves of a hand that draws things in with a hook: take it, pass it by, pull, put it down. See `motion`.

They are told in polar coordinates about the robot's first axis, where all bearings look the same to the arm.
"""

import math

import numpy as np

from ..assets.hook import Hook
from ..assets.prop import TABLE_TOP
from ..geometry import about_y, about_z, polar
from ..robots.jaw import TIP_BELOW
from ..robots.panda import BASE
from ..scenario import Plan
from ..sim.world import Arm
from .jaw import carry, pick, release
from .motion import STEADY, go_to, retreat

FROM_END, GRASP_HEIGHT = 0.035, TIP_BELOW + 0.005
"""Where the handle is held: least distance from its end to the middle of the pads, height over the table [m]."""
HAND_AT = 0.65
"""How far out the hand is when the tip is behind a thing, if the handle is long enough [m]."""
NEAREST_HAND = 0.41
"""How near to the robot's first axis the hand draws [m]: at 0.36 joint 6 of a hand that points down is at its limit,
and a hook that has slipped in the jaw asks for more."""
RAISED, NOSE_UP = 0.003, 0.07
"""How far the held end of the hook is raised while it moves [m], and how much its far end is tilted up [rad].
Dragged flat, the tip catches the table's edge from outside as soon as it has been behind a cube that stands there."""
HOOK_CLEARANCE, WIDE = 0.012, 0.03
"""Free space kept between hook and cube where the tip goes behind it, and on the way there [m]."""
SQUARING = 0.015
"""How far the handle pushes the cube sideways before the tip pulls it [m]: that turns a cube that stands askew by
20 deg until its side lies against the handle."""


def shortest_stretch(hook: Hook, behind: float) -> float:
    """Distance from where the handle is best held to the face that pulls [m].

    As short as it may be: the farther out the hook is held, the less its weight turns it in the jaw.
    A handle too short for that is held at its end, and the hand goes farther out than `HAND_AT`.

    Args:
        behind: how far out the face that pulls must come [m].
    """
    return min(hook.inside + hook.length / 2 - FROM_END, behind - HAND_AT)


def nearest_pull(stretch: float) -> float:
    """How near to the robot's first axis the face that pulls may come, for a hook held at a `stretch` [m]."""
    return NEAREST_HAND + stretch


def take_handle(arm: Arm, hook: Hook, body: str, stretch: float) -> Plan:
    """Grasp the handle across and leave the hook where it lies.

    Args:
        stretch: distance from where it is held to the face that pulls [m].
    """
    rot = arm.world.rot(body)
    at = arm.world.pos(body) + rot @ [hook.inside - stretch, 0, GRASP_HEIGHT]
    yield from pick(arm, at, closing=rot[:, 1], lift=0.0)


def pull(arm: Arm, hook: Hook, body: str, cube: str, half: float, to: float, mirror: float = 1.0) -> Plan:
    """Pass the held hook by a cube on the side away from its tip, put the tip behind the cube, pull.

    Args:
        cube: the cube's body.
        half: half its edge [m].
        to: how far from the robot's first axis its centre shall be in the end [m].
        mirror: at -1 the hook passes on the other side, and the tip ends up behind nothing.
    """
    bearing, there = polar(arm.world.com(cube) - BASE)
    along = arm.world.rot(cube).T @ about_z(bearing)[:, 0]
    across = half * float(np.abs(along).sum())  # half the cube's width, seen along the bearing
    before, behind, drawn = there - across - hook.width - WIDE, there + across + HOOK_CLEARANCE + hook.depth, half + to
    past, against = across + WIDE + hook.aside + hook.width / 2, half + hook.width / 2 - SQUARING
    for inside, beside in ((before, past), (behind, past), (behind, against), (drawn, against)):
        yield from slide(arm, hook, body, bearing, inside, mirror * beside)


def slide(arm: Arm, hook: Hook, body: str, bearing: float, inside: float, beside: float) -> Plan:
    """Move the held hook over the table until it lies along `bearing` [rad], seen from the robot's first axis.

    Args:
        inside: how far out the face that pulls shall lie [m].
        beside: how far from the line of the bearing the middle of the handle shall lie, on the side away from
            where the tip points [m].
    """
    world, rot = arm.world, about_z(bearing) @ about_y(-NOSE_UP)
    lifted = TABLE_TOP - BASE[2] + RAISED + hook.length / 2 * math.sin(NOSE_UP)
    origin = BASE + about_z(bearing) @ [inside - hook.inside, -hook.side * beside, lifted]
    com = world.rot(body).T @ (world.com(body) - world.pos(body))
    yield from carry(arm, body, origin + rot @ com, rot, STEADY)


def put_down(arm: Arm, hook: Hook, body: str) -> Plan:
    """Take the tip, then the handle off what has been drawn in, let go, go up."""
    along, left = arm.world.rot(body)[:, 0], arm.world.rot(body)[:, 1]
    yield from go_to(arm, arm.hand + (0.03 + hook.depth) * along)
    yield from go_to(arm, arm.hand - 0.05 * hook.side * left)
    yield from release(arm)
    yield from retreat(arm)
