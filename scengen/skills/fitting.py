"""Moves of a suction cup that fits flat pieces into slots between neighbours. See `motion` and `suction`."""

from contextlib import suppress

import numpy as np

from ..assets.prop import TABLE_TOP
from ..errors import GaveUp
from ..geometry import UP, Vec3, about_z, between
from ..robots.panda import WRIST_MIDDLE
from ..scenario import Plan
from ..sim.arm import Arm
from . import suction
from .motion import COARSE, Condition, Pace, facing_down, retreat, until
from .suction import carry

CARRY_HEIGHT = 0.05
"""Height above the table at which pieces are carried [m], twice the height of bin and pieces."""
AIM_HEIGHT = 0.003
"""Height of a piece above its neighbours while it is aimed [m]."""
AIM_PACE = Pace(0.25, 0.0015)
"""Pace of the move above a slot; it ends within half the radius of the pieces' lower edges, which guide them from
there."""
LOWER_PACE = Pace(0.04, 0.0, give_up=2.0)
"""Pace at which a piece is lowered, which takes one second."""
LAG = 0.0015
"""Lag of the hand behind a piece that is stopped [m]: a piece that is caught on an edge then presses with about 1.5 N
and slides in, or is raised and lowered again; 2.5 N at 0.1 m from the cup would peel it off."""


def take(arm: Arm, piece: str, face: Vec3, yaw: float) -> Plan:
    """Take a piece up by suction; the wrist first turns back by half of the turn to its final yaw.

    Args:
        arm: the arm.
        piece: the piece's body.
        face: place at which the cup takes it, in its axes [m].
        yaw: its final yaw [rad].
    """
    world, rot = arm.world, arm.world.rot(piece)
    spot = world.pos(piece) + rot @ face
    yield from suction.take(arm, spot, facing_down(WRIST_MIDDLE - float(between(rot, about_z(yaw))[2]) / 2))
    yield from retreat(arm, CARRY_HEIGHT)


def bring(arm: Arm, piece: str, pos: Vec3, yaw: float) -> Plan:
    """Bring the held piece above a place at a yaw [rad], or lose it on the way."""
    above = np.array([*pos[:2], TABLE_TOP + CARRY_HEIGHT])
    yield from until(carry(arm, piece, above, yaw, COARSE), lambda: not arm.sealed)


def fetch(arm: Arm, piece: str, face: Vec3, pos: Vec3, yaw: float) -> Plan:
    """Take a piece up by suction and bring it above a place at a yaw [rad], or lose it on the way."""
    yield from take(arm, piece, face, yaw)
    yield from bring(arm, piece, pos, yaw)


def insert(arm: Arm, piece: str, pos: Vec3, yaw: float, high: float, lies: Condition) -> Plan:
    """Aim with the held piece above the neighbours of a place, then lower it softly to 2 mm below the floor.

    The move ends when the piece lies, came off the cup or does not go on.

    Args:
        arm: the arm.
        piece: the piece's body.
        pos: the place on the floor [m].
        yaw: yaw of the piece there [rad].
        high: height of the neighbours over the floor [m].
        lies: condition that the piece lies on the floor.
    """
    yield from until(carry(arm, piece, pos + (high + AIM_HEIGHT) * UP, yaw, AIM_PACE), lambda: not arm.sealed)
    with suppress(GaveUp):
        lower = carry(arm, piece, pos - 0.002 * UP, yaw, LOWER_PACE, LAG)
        yield from until(lower, lambda: lies() or not arm.sealed)


def fit(arm: Arm, piece: str, face: Vec3, pos: Vec3, yaw: float, high: float, lies: Condition) -> Plan:
    """Bring a piece into its slot, and release it once it lies there. The arguments are those of `fetch` and `insert`.

    A piece that stands on an edge is raised and lowered again. A piece that came off the cup is taken up again.
    """
    while not lies():
        if not arm.sealed:
            yield from fetch(arm, piece, face, pos, yaw)
        yield from insert(arm, piece, pos, yaw, high, lies)
    yield from suction.let_go(arm)


def lay(arm: Arm, piece: str, face: Vec3, pos: Vec3, yaw: float, high: float, lies: Condition) -> Plan:
    """Bring a piece to a place, press it down softly and let go at the resulting place. See `fit` for the arguments."""
    with suppress(GaveUp):
        yield from fetch(arm, piece, face, pos, yaw)
        yield from insert(arm, piece, pos, yaw, high, lies)
    yield from suction.let_go(arm)
