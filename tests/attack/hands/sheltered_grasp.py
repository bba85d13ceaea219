"""T03: blind. Closed fingers drive the object to a known place for the jaw, or a jaw that comes down feels its top."""

import math
from contextlib import suppress

import numpy as np
from hand import Hand

from scengen.attack.plans import KEEP
from scengen.errors import GaveUp
from scengen.geometry import UP, Vec3, about_z
from scengen.scenario import Plan, Scenario
from scengen.sim.arm import Arm
from scengen.sim.world import World
from scengen.skills.jaw import grasp
from scengen.skills.motion import CLOSED, COARSE, OPEN, Pace, go_to, hold, push, until
from scengen.tasks.sheltered_grasp import GRIP_HEIGHT, LIFT_HEIGHT, ShelteredGrasp

TIP_DEPTH = 0.088
"""Distance of the grip site behind the open side during a sweep [m]: the fingertips are beside the object."""
IN_RACK = Pace(0.3, 0.006, 2.5)
"""Pace in the rack."""
FINGER = 0.036
"""Distance of the closed fingers from the middle of a cube that they push [m]."""
OVER_DEPTH = 0.087
"""Distance of the grip site behind the open side when the fingers are over the object [m]."""
OVER_HEIGHT = 0.068
"""Height of the grip site over the floor of a storey when the fingers pass over the object [m]."""
LOWERING_SPEED = 0.05
"""Speed at which the hand feels for the object [m/s]."""
FELT = 0.5
"""Vertical force that is felt [N]."""
HALF_OPEN = 0.052
"""Gap of the jaw that feels for the object [m]: wide enough not to count as closed."""
SHIFT = 0.014
"""First shift to the side on which the object is felt [m]; each further one is half as large."""


def herd(scenario: Scenario, world: World) -> Plan:
    """Sweep the lower storey, then the upper one; the jaw's opening tells where the object was."""
    assert isinstance(scenario, ShelteredGrasp)
    arm, rot, half = world.arm, scenario.entry, scenario.rack.width / 2 - 0.111
    yield from go_to(arm, arm.hand - np.array([0.0, 0.17 * scenario.side, 0.0]), pace=COARSE, grip=OPEN)
    for storey in (0, 1):

        def at(along: float, depth: float, storey: int = storey) -> Vec3:
            inside = scenario.rack.inside(storey, scenario.side * along, depth)
            return scenario.foot + about_z(scenario.turn) @ inside + GRIP_HEIGHT * UP

        yield from go_to(arm, at(-half, -0.07), rot, Pace(0.5, 0.01, 3.0), CLOSED)
        end = half - 0.049
        sweep = ((-half, TIP_DEPTH, CLOSED), (end, TIP_DEPTH, CLOSED), (end, 0.0, CLOSED))
        take = ((end + FINGER, 0.0, OPEN), (end + FINGER, 0.085, OPEN))
        for along, depth, grip in (*sweep, *take):
            with suppress(GaveUp):
                yield from go_to(arm, at(along, depth), rot, IN_RACK, grip)
        with suppress(GaveUp):
            yield from grasp(arm)
        if arm.gap > 0.03:
            yield from go_to(arm, arm.hand + LIFT_HEIGHT * UP, rot, IN_RACK)
            yield from go_to(arm, at(end + FINGER, -0.12) + LIFT_HEIGHT * UP, rot, IN_RACK)
            yield from scenario.drop(world)
            return
        yield from go_to(arm, at(end + FINGER, -0.07), rot, IN_RACK, CLOSED)
    yield from hold(arm, 1.0)


def feel_from_above(scenario: Scenario, world: World) -> Plan:
    """Enter each storey in the middle, over the object, and lower the half-open jaw. A finger that meets the object's
    top tells the side by its torque; the jaw opens, shifts to that side, and is lowered again."""
    assert isinstance(scenario, ShelteredGrasp)
    arm, rot, across = world.arm, scenario.entry, about_z(scenario.turn) @ [scenario.side, 0.0, 0.0]

    def at(storey: int, along: float, depth: float, height: float) -> Vec3:
        inside = scenario.rack.inside(storey, scenario.side * along, depth)
        return scenario.foot + about_z(scenario.turn) @ inside + height * UP

    yield from go_to(arm, arm.hand - np.array([0.0, 0.17 * scenario.side, 0.0]), pace=COARSE, grip=OPEN)
    for storey in (0, 1):
        along, shift = 0.0, SHIFT
        with suppress(GaveUp):
            yield from go_to(arm, at(storey, along, -0.05, OVER_HEIGHT), rot, Pace(0.5, 0.008, 3.5), CLOSED)
        yield from until(hold(arm, 1.0, OPEN), lambda: arm.gap > HALF_OPEN)
        with suppress(GaveUp):
            yield from go_to(arm, at(storey, along, OVER_DEPTH, OVER_HEIGHT), rot, IN_RACK, KEEP)
        for _ in range(5):
            low = at(storey, along, OVER_DEPTH, GRIP_HEIGHT)[2]
            lower = push(arm, -LOWERING_SPEED * UP, lambda low=low: arm.hand[2] < low or felt(arm), arm.grip)
            with suppress(GaveUp):
                yield from lower
            if not felt(arm):
                break
            lever = np.cross(UP, arm.load()[3:]) / arm.load()[2]
            along, shift = along + math.copysign(shift, float(lever @ across)), max(0.005, shift / 2)
            with suppress(GaveUp):
                yield from go_to(arm, at(storey, along, OVER_DEPTH, OVER_HEIGHT), rot, Pace(0.3, 0.006, 1.2), OPEN)
        if along:
            yield from grasp(arm)
            yield from go_to(arm, arm.hand + LIFT_HEIGHT * UP, rot, IN_RACK)
            yield from go_to(arm, arm.hand - (OVER_DEPTH + 0.12) * rot[:, 2], rot, IN_RACK)
            yield from scenario.drop(world)
            return
        with suppress(GaveUp):
            yield from go_to(arm, at(storey, along, -0.07, OVER_HEIGHT), rot, IN_RACK, KEEP)


def felt(arm: Arm) -> bool:
    """Whether something presses on the hand from below."""
    return bool(abs(arm.load()[2]) > FELT)


HANDS = {"herd": Hand(herd), "feel_from_above": Hand(feel_from_above)}
