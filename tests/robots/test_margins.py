"""Distances at which moves are said to keep their reach do so on a grid, with joints away from their limits.

A posture is looked for within narrower limits than the arm's: what is found there has that much to spare everywhere.
"""

import math
from contextlib import contextmanager

import numpy as np
import pytest

from scengen.assets.prop import TABLE_HALF, TABLE_TOP
from scengen.geometry import UP
from scengen.robots import ik, panda
from scengen.skills import hook
from scengen.skills.handover import LEFT, STAND_OFF, sideways
from scengen.skills.motion import facing_down
from scengen.tasks import (
    edge_slide,
    indirect_push,
    launched_ball,
    pick_place_ycb,
    plate_shelf,
    stack_collapse_recovery,
    tool_retrieve,
)

pytestmark = pytest.mark.slow

SPARE = 0.1
"""What a plan that follows a path needs at least [rad]: hands are turned to within 0.05 rad of what is requested."""
BEARINGS = np.radians([-20.0, 20.0])
"""At which rings around the first axis are looked at [rad]: what is farther out leaves the table."""
TAKEN_AT = TABLE_TOP + 0.03
"""Height of the grip site of a hand that takes a thing from the table [m]."""

RINGS = {
    "take a block": (indirect_push.MIN_DISTANCE, indirect_push.MAX_DISTANCE),
    "take what has fallen": (stack_collapse_recovery.MIN_DISTANCE, stack_collapse_recovery.MAX_DISTANCE),
    "meet a ball": (launched_ball.MIN_DISTANCE, launched_ball.MAX_DISTANCE),
    "grasp a hook": (hook.MIN_HAND_DISTANCE, tool_retrieve.MAX_DISTANCE),
}
"""Nearest and farthest distance from the first axis at which a hand points down [m]."""


@contextmanager
def spared(spare):
    """Limits of the joints narrower by so much on either side [rad]."""
    arm = ik._arm()
    whole = arm.limits
    arm.limits = whole[0] + spare, whole[1] - spare
    try:
        yield
    finally:
        arm.limits = whole


def miss(place, rot, spare=SPARE, base=panda.BASE):
    """How far the hand stays from a pose, as `ik.Nearest.error` [m], for an arm that stands at `base`."""
    with spared(spare):
        return ik.reach(np.asarray(place) - base + panda.BASE, rot).error


def down(away, bearing, spare=SPARE):
    """As `miss`, of a hand that points down at a distance from the first axis, turned as it comes there by itself."""
    out = np.array([math.cos(bearing), math.sin(bearing), 0.0])
    place = np.array([*panda.BASE[:2], TAKEN_AT]) + away * out
    return miss(place, facing_down(bearing), spare)


@pytest.mark.parametrize("move", RINGS)
def test_a_hand_that_points_down_keeps_its_margin_between_the_stated_distances(move):
    nearest, farthest = RINGS[move]
    for away in (nearest, farthest):
        for bearing in BEARINGS:
            assert down(away, bearing) < 1e-3, (away, bearing)


def test_a_grasp_from_above_ends_where_inverse_kinematics_is_said_to():
    """`tool_retrieve.MAX_DISTANCE`: 0.76 m is allowed, with nothing to spare."""
    assert down(0.76, 0.0, spare=0.0) < 1e-3 < down(0.80, 0.0, spare=0.0)


def test_the_square_lies_only_where_a_hand_that_points_down_comes():
    field = pick_place_ycb.FIELD
    ends = np.array([np.linalg.norm([x - panda.BASE[0], y]) for x in field[0] for y in (*field[1], 0.0)])
    assert (ends.min(), ends.max()) == (pytest.approx(0.34, abs=0.005), pytest.approx(0.69, abs=0.005))
    for x in field[0]:
        for y in (*field[1], 0.0):
            assert miss([x, y, TAKEN_AT + pick_place_ycb.CARRY_HEIGHT], facing_down(), 0.05) < 1e-3, (x, y)


@pytest.mark.parametrize("side", [-1, 1])
def test_the_hand_that_pinches_at_an_edge_has_two_tenths_of_a_radian_along_two_tenths_of_a_metre(side):
    scenario = edge_slide.EdgeSlide(side=side)
    for x in (-0.25, -0.15, -0.05):
        assert miss([x, side * TABLE_HALF, TABLE_TOP], scenario.grip, 0.2) < 1e-3, x


def test_the_jaw_takes_the_rim_of_every_plate_where_it_changes_hands():
    for radius in (0.085, 0.122):
        for off in (0.0, STAND_OFF):
            place = plate_shelf.HANDOVER_POINT + (radius + off) * LEFT + 0.012 * UP
            assert miss(place, sideways(), base=panda.bases(2)[1]) < 1e-3, (radius, off)
