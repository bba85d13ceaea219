"""Moves of a jaw that takes cubes from among others and stacks them. See `motion` and `grip`.

Cubes are given by their edges [m], by body. The origin of a cube is the middle of its base.
"""

import math
from collections.abc import Mapping

import numpy as np

from ..geometry import UP, Outline, Vec3, corners, gap
from ..robots.jaw import FINGER_ACROSS, PALM_ABOVE, PALM_ACROSS, PALM_ALONG, SPAN, TIP_BELOW
from ..scenario import Plan
from ..sim.arm import Arm
from ..sim.world import World
from .grip import Grip, directions, extent, grips
from .jaw import pick, put
from .motion import FINE, OPEN, Pace, facing_down, go_to, hand_yaw, retreat

CARRY_HEIGHT = 0.03
"""Height above all cubes at which a cube is carried, and above a released cube to which the hand rises [m]."""
CARRY_PACE = Pace(0.30, 0.008)
"""Pace of moves above the cubes."""
TIP_CLEARANCE = 0.008
"""Height of the finger tips over a cube before the hand comes down on it [m]."""
SIDE_CLEARANCE = 0.010
"""Clearance of the jaw beside a cube from other cubes that is enough [m]: moves are exact to 3 mm."""
MAX_WRIST_ANGLE = 1.7
"""Angle of joint 7 up to which it can be turned on the way to any place [rad]; it ends at 2.9 rad."""


def centre(world: World, cube: str, edge: float) -> Vec3:
    """Middle of a cube in its present pose [m]."""
    return world.pos(cube) + edge / 2 * world.rot(cube)[:, 2]


def outline(world: World, cube: str, edge: float) -> Outline:
    """Outline of a cube that lies on one of its faces, as seen from above."""
    x, y, _ = directions(world, cube)[0]
    return corners(centre(world, cube, edge), math.atan2(y, x), [edge] * 2)


def supports(world: World, below: str, cube: str) -> bool:
    """Whether a cube lies on top of another one, `below`."""
    return world.touching(below, cube) and world.com(cube)[2] > extent(world, below, UP)[1]


def clearance(world: World, edges: Mapping[str, float], cube: str, grip: Grip) -> float:
    """Clearance between the open jaw around a cube and the other cubes, as seen from above [m]."""
    least, yaw = math.inf, math.atan2(grip.closing[1], grip.closing[0])
    for other, edge in edges.items():
        top = extent(world, other, UP)[1]
        fingers, palm = (SPAN, 2 * FINGER_ACROSS), (2 * PALM_ALONG, 2 * PALM_ACROSS)
        for bottom, size in ((-TIP_BELOW, fingers), (PALM_ABOVE, palm)):
            if other != cube and top > grip.at[2] + bottom:
                least = min(least, gap(corners(grip.at, yaw, size), outline(world, other, edge)))
    return least


def choose_sides(arm: Arm, edges: Mapping[str, float], cube: str) -> tuple[Vec3, float]:
    """Direction in which to close the jaw on a cube, and the turn of the hand that this takes [rad].

    The smallest turn that keeps the wrist away from its limits, among the sides that have enough clearance for the jaw.
    If none has enough, those with the most clearance are used.
    """
    clearances = {tuple(grip.closing): clearance(arm.world, edges, cube, grip) for grip in grips(arm.world, cube)}
    least = min(SIDE_CLEARANCE, max(clearances.values()))
    enough = [np.array(closing) for closing, spare in clearances.items() if spare >= least]
    yaw, wrist = hand_yaw(arm), float(arm.joint_pos[6])
    turns = [
        (math.remainder(math.atan2(-x, y) + flip - yaw, 2 * math.pi), np.array([x, y, 0.0]))
        for x, y, _ in enough
        for flip in (0.0, math.pi)
    ]
    turn, closing = min(turns, key=lambda one: (abs(wrist - one[0]) > MAX_WRIST_ANGLE, abs(one[0])))
    return closing, turn


def take(arm: Arm, edges: Mapping[str, float], cube: str) -> Plan:
    """Grasp a cube by two of its sides and lift it above all cubes."""
    world, half = arm.world, edges[cube] / 2
    at = grips(world, cube)[0].at
    height = max(extent(world, other, UP)[1] for other in edges) + half + CARRY_HEIGHT - at[2]
    above = half + TIP_BELOW + TIP_CLEARANCE
    yield from go_to(arm, at + height * UP, pace=CARRY_PACE, grip=OPEN)  # the range of the wrist is read there
    closing, turn = choose_sides(arm, edges, cube)
    rot = facing_down(hand_yaw(arm) + turn)
    yield from go_to(arm, at + height * UP, rot)  # a turn drags the hand along
    yield from go_to(arm, at + above * UP, rot, FINE)  # the arm overshoots when it comes near the robot
    yield from pick(arm, at, closing, above=above, lift=height)


def stack(
    arm: Arm, edges: Mapping[str, float], below: str, cube: str, offset: float = 0.0, by_mass: bool = True
) -> Plan:
    """Take a cube, put it down on the cube `below`, move up.

    Args:
        arm: the arm.
        edges: edges of all cubes [m].
        below: the lower cube.
        cube: the cube to be taken.
        offset: distance from the lower cube's middle, towards the robot [m].
        by_mass: whether the cube's centre of mass is brought there, or else its middle.
    """
    world = arm.world
    yield from take(arm, edges, cube)
    foot = np.array([*centre(world, below, edges[below])[:2], extent(world, below, UP)[1]]) - [offset, 0.0, 0.0]
    at = foot + (world.com(cube)[2] - extent(world, cube, UP)[0]) * UP
    if not by_mass:
        at[:2] += (world.com(cube) - centre(world, cube, edges[cube]))[:2]
    yield from put(arm, cube, at, on=below, hover=CARRY_HEIGHT)
    yield from retreat(arm, edges[cube] / 2 + 2 * CARRY_HEIGHT)  # ends up to 2 cm short
