"""Take hold of a thing with a jaw that points down, however it lies: widths come from the shapes that collide."""

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from ..assets.prop import TABLE_TOP
from ..errors import GaveUp
from ..geometry import UP, Vec3
from ..robots.jaw import PALM_ABOVE, TIP_BELOW
from ..scenario import Plan
from ..sim.world import Arm, World
from .jaw import pick
from .motion import OPEN, go_to, hand_yaw

WIDEST = 0.072
"""Widest thing that is taken hold of [m]: of the 77 mm to which the fingers open, what a hand and a thing that are each
2 mm out of place leave."""
UNDER_THE_PALM = 0.003
"""Air between the palm and the highest point of a tall thing [m]."""
LEVEL = 0.7
"""An axis of a shape is a direction to close along if so much of it is level."""


@dataclass(frozen=True)
class Grip:
    """A top-down grasp."""

    at: Vec3
    """Where the grip site is to be [m]."""
    closing: Vec3
    """Level direction along which the fingers close."""
    width: float
    """Of the thing along that [m]."""


def take(arm: Arm, body: str, above: float = 0.10, lift: float = 0.12) -> Plan:
    """Take hold of a thing wherever and however it lies, and lift it. See `jaw.pick`.

    Raises:
        GaveUp: it is too wide in every direction, or a move took too long.
    """
    grip = best_grip(arm, body)
    if grip is None:
        raise GaveUp(f"{body} lies so that no jaw can take it")
    yield from go_to(arm, grip.at + above * UP, grip=OPEN)  # there it is seen which way the wrist can turn
    yield from pick(arm, grip.at, grip.closing, above=above, lift=lift)


def best_grip(arm: Arm, body: str) -> Grip | None:
    """The narrowest way to take hold of a thing as it lies now, of equal ones that which turns the hand least.

    None if it is too wide in every direction.
    """
    found = grips(arm.world, body)
    return min(found, key=lambda grip: (round(grip.width, 3), abs(_turn(arm, grip.closing))), default=None)


def grips(world: World, body: str) -> list[Grip]:
    """Every way to take hold of a thing as it lies now, along and across its axes; none if it is too wide for all.

    Taken at the middle of its height, or as low as the palm allows.
    """
    low, high = extent(world, body, UP)
    height = max((low + high) / 2, high - PALM_ABOVE + UNDER_THE_PALM, TABLE_TOP + TIP_BELOW + UNDER_THE_PALM)
    found = []
    for closing in directions(world, body):
        beside = np.array([-closing[1], closing[0], 0.0])
        (near, far), (left, right) = extent(world, body, closing), extent(world, body, beside)
        at = (near + far) / 2 * closing + (left + right) / 2 * beside + height * UP
        found.append(Grip(at, closing, far - near))
    return [grip for grip in found if grip.width <= WIDEST]


def extent(world: World, body: str, direction: Vec3) -> tuple[float, float]:
    """Where a body begins and ends along a direction, a unit vector: its lowest and highest coordinate [m]."""
    reaches = [_reach(world, geom, direction) for geom in _geoms(world, body)]
    return min(low for low, _ in reaches), max(high for _, high in reaches)


def directions(world: World, body: str) -> list[Vec3]:
    """Level unit vectors along and across the axes of a body's shapes, each once."""
    found: list[Vec3] = []
    for geom in _geoms(world, body):
        for axis in world.data.geom_xmat[geom].reshape(3, 3).T:
            size = math.hypot(axis[0], axis[1])
            if size < LEVEL:
                continue
            along = np.array([axis[0], axis[1], 0.0]) / size
            for one in (along, np.array([-along[1], along[0], 0.0])):
                if all(abs(float(one @ other)) < 0.999 for other in found):
                    found.append(one)
    return found


def _geoms(world: World, body: str) -> list[int]:
    model = world.model
    geoms = np.flatnonzero((model.geom_bodyid == world.body(body)) & (model.geom_contype > 0))
    return geoms.tolist()


def _reach(world: World, geom: int, direction: Vec3) -> tuple[float, float]:
    """As `extent`, of one geom."""
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
    mesh = world.model.geom_dataid[geom]
    first = world.model.mesh_vertadr[mesh]
    return slice(first, first + world.model.mesh_vertnum[mesh])


def _turn(arm: Arm, closing: Vec3) -> float:
    """Least angle by which the hand turns to close along a direction [rad]."""
    return math.remainder(math.atan2(-closing[0], closing[1]) - hand_yaw(arm), math.pi)
