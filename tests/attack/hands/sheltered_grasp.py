"""T03: blind. Closed fingers sweep each storey and drive the object to a known place, where the jaw takes it."""

from contextlib import suppress

import numpy as np
from hand import Hand

from scengen.errors import GaveUp
from scengen.geometry import UP, Vec3, about_z
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.jaw import grasp
from scengen.skills.motion import CLOSED, COARSE, OPEN, Pace, go_to, hold
from scengen.tasks.sheltered_grasp import GRIP_HEIGHT, LIFT_HEIGHT, ShelteredGrasp

TIP_DEPTH = 0.088
"""Distance of the grip site behind the open side during a sweep [m]: the fingertips are beside the object."""
IN_RACK = Pace(0.3, 0.006, 2.5)
"""Pace in the rack."""
FINGER = 0.036
"""Distance of the closed fingers from the middle of a cube that they push [m]."""


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


HANDS = {"herd": Hand(herd)}
