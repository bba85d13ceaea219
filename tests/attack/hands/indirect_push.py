"""T20: one block is pushed corner first by a hand that leans far out, which reaches farther than a square one."""

import math

import numpy as np
from hand import Hand

from scengen.control.loop import Loop
from scengen.geometry import UP, about_z, between
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.jaw import carry, pick, release
from scengen.skills.motion import CLOSED, COARSE, STEADY, Pace, go_to, push, retreat, steer
from scengen.tasks.indirect_push import END_MARGIN, ZONE_SIZE, IndirectPush

LEAN = math.radians(65.0)  # lean of the hand at the end of the push; the oracle's is 35 deg
SPIN_GAIN = 0.02  # shift of the fingers for a rotation of the block [m/rad]


def leaning(scenario: IndirectPush, distance: float) -> np.ndarray:
    """Orientation of the hand at a distance of the push [m]."""
    lean = LEAN * float(np.clip((distance - 0.55) / 0.25, 0.0, 1.0))
    along = math.sin(lean) * scenario.u - math.cos(lean) * UP
    return np.stack([scenario.side, np.cross(along, scenario.side), along], axis=1)


def corner_first(scenario: Scenario, world: World) -> Plan:
    """Put one block down with a corner ahead, push it outwards, and steer the fingers against its drift."""
    assert isinstance(scenario, IndirectPush)
    arm, block, half = world.arm, scenario.chosen[0], scenario.edge / 2 * UP
    faces = [sign * axis for axis in world.rot(block)[:, :2].T for sign in (1.0, -1.0)]
    closing = max(faces, key=lambda normal: float(normal @ scenario.side))
    yield from pick(arm, world.com(block), closing, above=0.09, lift=0.09, pace=Pace(0.20, 0.004))
    diagonal = about_z(math.pi / 4) @ scenario.side
    turn = about_z(math.atan2(float(np.cross(closing, diagonal)[2]), float(closing @ diagonal)))
    rot, spot = turn @ world.rot(block), scenario.at(0.70) + half
    yield from carry(arm, block, spot + 0.07 * UP, rot, COARSE)
    yield from carry(arm, block, spot + 0.008 * UP, rot, Pace(0.20, 0.003))
    yield from push(arm, -0.04 * UP, until=lambda: world.touching(block, "table"))
    yield from release(arm)
    yield from retreat(arm, 0.09)
    start = scenario.out(world.com(block)) - 0.71 * scenario.edge - 0.025
    begin = scenario.at(start)
    yield from go_to(arm, [*begin[:2], scenario.height + 0.12], leaning(scenario, start), COARSE, CLOSED)
    yield from go_to(arm, [*begin[:2], scenario.height], leaning(scenario, start), STEADY)
    entered = scenario.distance + scenario.way - ZONE_SIZE / 2 + END_MARGIN
    ahead, end = scenario.out(arm.hand), world.time + 9.0
    while scenario.out(world.com("target")) < entered and world.time < end:
        pace = 0.03 if scenario.out(world.com(block)) > scenario.distance - 1.4 * scenario.edge else 0.08
        ahead = min(ahead + pace * Loop.PERIOD, 0.90)
        off = float((world.com(block) - scenario.at(0.0)) @ scenario.side)
        tilt = math.remainder(math.atan2(*world.rot(block)[1::-1, 0]) - scenario.angle - math.pi / 4, math.pi / 2)
        aside = 2.0 * off + SPIN_GAIN * tilt
        at = scenario.at(ahead) + aside * scenario.side
        at[2] = scenario.height + 2.0 * (scenario.height - arm.hand[2])
        yield steer(arm, at, pace * scenario.u, between(arm.hand_rot, leaning(scenario, ahead)), CLOSED)
    yield from go_to(arm, arm.hand - 0.04 * scenario.u, pace=STEADY)


HANDS = {"corner_first": Hand(corner_first)}
