"""T08: a small box is held by its top, laid askew on the walls of the slot, let go, and taken by its broad face."""

import math
from contextlib import suppress

import numpy as np
from hand import Hand, otherwise

from scengen.errors import GaveUp
from scengen.geometry import UP, Mat3, Vec3, about_z, axes, between, polar, rotation
from scengen.params import with_values
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.motion import CLOSED, COARSE, OPEN, Pace, facing, go_to, hold, push, steer
from scengen.skills.suction import carry_to, let_go, suck
from scengen.tasks.cracker_box_suction import CrackerBoxSuction

ASKEW = math.radians(-14.0)  # angle from the slot at which the box is laid on the slot's walls [rad]
REGRIP = math.radians(-40.0)  # turn of the wrist, away from its limit, before the cup takes the broad face [rad]
LET_GO = 0.12  # time for which the suction is off before the hand draws back [s]


def unmended(scenario: Scenario) -> Scenario:
    """The task without means, with a box that the cup holds level by its top."""
    return with_values(otherwise(scenario), {"box.scale": 0.85})


def glide(world: World, goal: Vec3, rot: Mat3, seconds: float) -> Plan:
    """Move and turn the hand without a jerk."""
    arm, begin = world.arm, world.time
    start, now, turn = arm.hand, arm.hand_rot, between(arm.hand_rot, rot)
    while world.time < begin + seconds:
        time = (world.time - begin) / seconds
        share, rate = time * time * (3.0 - 2.0 * time), 6.0 * time * (1.0 - time) / seconds
        aim = rotation(share * turn) @ now
        yield steer(arm, start + share * (goal - start), rate * (goal - start), between(arm.hand_rot, aim), CLOSED)


def lay_it_askew_by_its_top(scenario: Scenario, world: World) -> Plan:
    """Take the top, turn the box level in the air, lay it across the slot's walls, take it from above, turn it in."""
    assert isinstance(scenario, CrackerBoxSuction)
    self, arm = scenario, world.arm
    height = self.box.size[2]
    _, out = self.broad_face(world)
    top, down = world.pos("box") + height * UP, axes(facing(polar(out)[0], 0.0)[:, 0], -UP)
    yield from go_to(arm, top + 0.04 * UP, down, Pace(0.3, 0.01), OPEN)
    yield from go_to(arm, top + 0.015 * UP, down, Pace(0.2, 0.002), OPEN)
    yield from suck(arm, top, down, 0.05)
    slot = world.rot("slot")[:, 1]
    along = about_z(ASKEW) @ (math.copysign(1.0, float(slot @ out)) * slot)
    level, end = facing(polar(along)[0], 0.0), self.seat + self.slot.depth * UP - height / 2 * along
    yield from glide(world, arm.hand + 0.10 * UP, arm.hand_rot, 1.0)
    yield from glide(world, end + 0.06 * UP, level, 4.5)
    yield from glide(world, end + 0.004 * UP, level, 1.0)
    with suppress(GaveUp):
        lies = lambda: world.touching("box", "slot") and abs(world.rot("box")[2, 0]) > 0.9997  # noqa: E731
        yield from push(arm, -0.03 * UP, lies, CLOSED, give_up=0.8)
    yield from hold(arm, LET_GO, OPEN)
    yield from go_to(arm, arm.hand - 0.04 * arm.hand_rot[:, 2] + 0.01 * UP, pace=COARSE, grip=OPEN)
    yield from take_from_above(self, world)
    rot = self.laid(world)
    for pace in (Pace(0.3, 0.01), Pace(0.08, 0.0015)):
        yield from carry_to(arm, "box", self.origin(rot, self.slot.depth + 0.012), rot, pace)
    yield from self.lower(arm, rot)
    yield from let_go(arm)


def take_from_above(scenario: CrackerBoxSuction, world: World) -> Plan:
    """Take a box that lies by the broad face that looks up, and lift it a little."""
    arm, spot = world.arm, world.com("box") + scenario.box.size[0] / 2 * UP
    level = arm.hand_rot[:, 0] * [1.0, 1.0, 0.0]
    down = axes(about_z(REGRIP) @ (level / np.linalg.norm(level)), -UP)
    yield from go_to(arm, [*arm.hand[:2], spot[2] + 0.06], down, Pace(0.3, 0.03), OPEN)
    yield from go_to(arm, spot + 0.02 * UP, down, Pace(0.3, 0.008), OPEN)
    yield from suck(arm, spot, down, 0.06)
    yield from go_to(arm, arm.hand + 0.02 * UP, pace=Pace(0.2, 0.01))


HANDS = {"lay_it_askew_by_its_top": Hand(lay_it_askew_by_its_top, unmended)}
