"""Grasps of an object by a jaw that points down, in any pose of the object. Widths come from the collision shapes."""

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from ..assets.prop import TABLE_TOP
from ..errors import GaveUp
from ..geometry import UP, Vec3
from ..robots.jaw import PALM_ABOVE, TIP_BELOW
from ..scenario import Plan
from ..sim.arm import Arm
from ..sim.world import World
from .jaw import pick
from .motion import OPEN, go_to, hand_yaw

MAX_WIDTH = 0.072
"""Largest width of a grasp [m]: the fingers open to 77 mm, and hand and object may each be 2 mm out of place."""
PALM_CLEARANCE = 0.003
"""Clearance between the palm and the highest point of a tall object, and between finger tips and table [m]."""
MIN_LEVEL_SHARE = 0.7
"""Least horizontal share of a shape's axis for the axis to serve as a closing direction."""


@dataclass(frozen=True)
class Grip:
    """A top-down grasp."""

    at: Vec3
    """Position of the grip site [m]."""
    closing: Vec3
    """Level direction along which the fingers close."""
    width: float
    """Width of the object along that direction [m]."""


def take(arm: Arm, body: str, above: float = 0.10, lift: float = 0.12) -> Plan:
    """Grasp an object in any pose, and lift it. See `jaw.pick`.

    Args:
        arm: the arm.
        body: the object's body.
        above: height from which the hand comes down [m].
        lift: height by which the object is lifted [m].

    Raises:
        GaveUp: the object is too wide in every direction, or a move took too long.
    """
    grip = best_grip(arm, body)
    if grip is None:
        raise GaveUp(f"{body} lies so that no jaw can take it")
    yield from go_to(arm, grip.at + above * UP, grip=OPEN)  # the wrist angle is chosen from there
    yield from pick(arm, grip.at, grip.closing, above=above, lift=lift)


def best_grip(arm: Arm, body: str) -> Grip | None:
    """The narrowest grasp of an object as it lies now; among equal ones the one that turns the hand least.

    A style may choose any of the grasps that are slightly wider. None if the object is too wide in every direction.
    """
    found, style = grips(arm.world, body), arm.world.style
    if style and found:
        widest = (1.0 + style.slack) * min(grip.width for grip in found)
        equal = [grip for grip in found if grip.width <= widest]
        return equal[int(style.number("grip", body, arm.number) * len(equal))]
    return min(found, key=lambda grip: (round(grip.width, 3), abs(_turn(arm, grip.closing))), default=None)


def grips(world: World, body: str) -> list[Grip]:
    """All grasps of an object as it lies now, along and across its axes; empty if it is too wide for each of them.

    Each is at the middle of the object's height, or as low as the palm allows.
    """
    low, high = extent(world, body, UP)
    height = max((low + high) / 2, high - PALM_ABOVE + PALM_CLEARANCE, TABLE_TOP + TIP_BELOW + PALM_CLEARANCE)
    found = []
    for closing in directions(world, body):
        beside = np.array([-closing[1], closing[0], 0.0])
        (near, far), (left, right) = extent(world, body, closing), extent(world, body, beside)
        at = (near + far) / 2 * closing + (left + right) / 2 * beside + height * UP
        found.append(Grip(at, closing, far - near))
    return [grip for grip in found if grip.width <= MAX_WIDTH]


def extent(world: World, body: str, direction: Vec3) -> tuple[float, float]:
    """Lowest and highest coordinate of a body along a direction, a unit vector [m]."""
    reaches = [_reach(world, geom, direction) for geom in _geoms(world, body)]
    return min(low for low, _ in reaches), max(high for _, high in reaches)


def directions(world: World, body: str) -> list[Vec3]:
    """Level unit vectors along and across the axes of a body's shapes, each once."""
    found: list[Vec3] = []
    for geom in _geoms(world, body):
        for axis in world.data.geom_xmat[geom].reshape(3, 3).T:
            size = math.hypot(axis[0], axis[1])
            if size < MIN_LEVEL_SHARE:
                continue
            along = np.array([axis[0], axis[1], 0.0]) / size
            for one in (along, np.array([-along[1], along[0], 0.0])):
                if all(abs(float(one @ other)) < 0.999 for other in found):
                    found.append(one)
    return found


def _geoms(world: World, body: str) -> list[int]:
    """Indices of a body's collision geoms."""
    model = world.model
    geoms = np.flatnonzero((model.geom_bodyid == world.body(body)) & (model.geom_contype > 0))
    return geoms.tolist()


def _reach(world: World, geom: int, direction: Vec3) -> tuple[float, float]:
    """Lowest and highest coordinate of a geom along a direction [m]."""
    model, data, kinds = world.model, world.data, mujoco.mjtGeom
    middle = float(data.geom_xpos[geom] @ direction)
    x, y, z = np.abs(data.geom_xmat[geom].reshape(3, 3).T @ direction)
    size = model.geom_size[geom]
    match model.geom_type[geom]:
        case kinds.mjGEOM_SPHERE:
            half = size[0]
        case kinds.mjGEOM_CAPSULE:
            half = size[0] + z * size[1]
        case kinds.mjGEOM_CYLINDER:
            half = size[0] * math.hypot(x, y) + z * size[1]
        case kinds.mjGEOM_BOX:
            half = x * size[0] + y * size[1] + z * size[2]
        case _:
            corners = model.mesh_vert[_vertices(world, geom)] @ data.geom_xmat[geom].reshape(3, 3).T @ direction
            return middle + float(corners.min()), middle + float(corners.max())
    return middle - float(half), middle + float(half)


def _vertices(world: World, geom: int) -> slice:
    """Rows of the vertices of a mesh geom in the model's table."""
    mesh = world.model.geom_dataid[geom]
    first = world.model.mesh_vertadr[mesh]
    return slice(first, first + world.model.mesh_vertnum[mesh])


def _turn(arm: Arm, closing: Vec3) -> float:
    """Smallest angle by which the hand must turn to close along a direction [rad]."""
    return math.remainder(math.atan2(-closing[0], closing[1]) - hand_yaw(arm), math.pi)
