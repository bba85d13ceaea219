"""T04: two hands press on the rough bead from outside, lift the cup without suction or grasp, and roll it over."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from hand import Hand, otherwise

from scengen.assets.prop import TABLE_TOP
from scengen.geometry import UP, Mat3, Vec3, between, rotation
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.handover import LEFT
from scengen.skills.motion import CLOSED, facing, steer, until
from scengen.tasks.cup_inversion import CupInversion

STEEP = math.radians(72.0), math.radians(62.0)  # tilts of both hands at the table, below the level [rad]
LEVELLED = 0.75  # share of these tilts by which the hands are levelled in the air
HEIGHT = 0.006  # height of the contacts on the bead above the table [m]
TIGHT = 0.022  # distance by which each hand aims into the cup [m]
LIFT = 0.22  # height by which the cup is lifted [m]
LOWER_SPEED = 0.08  # speed at which it is lowered [m/s]

Motion = Callable[[float], tuple[Vec3, float, float, float]]


def unmended(scenario: Scenario) -> Scenario:
    """The task with a bead that is rough on both sides."""
    assert isinstance(scenario, CupInversion)
    return otherwise(replace(scenario, cup=replace(scenario.cup, smooth_outside=False)))


def contact(rot: Mat3, number: int) -> Vec3:
    """Point of a hand that meets the bead, in the hand's axes [m]: the edge of the pads, or of the finger tips."""
    along = rot[:, 2]
    up = (UP - along[2] * along) / math.hypot(along[0], along[1])
    return rot.T @ (0.0085 * up + 0.009 * along if number else 0.0135 * up)


def both(scenario: CupInversion, world: World, seconds: float, motion: Motion) -> Plan:
    """Steer both contacts; `motion` maps the share of the time to their middle, their distance from the bead [m], and
    the shares of levelling and of half a roll."""
    start = world.time
    while world.time < start + seconds:
        middle, apart, level, roll = motion((world.time - start) / seconds)
        actions = []
        for arm, side, tilt in zip(world.arms, (-1, 1), STEEP, strict=True):
            azimuth = -side * math.pi / 2
            point = contact(facing(azimuth, tilt), arm.number)
            rot = rotation(math.pi * roll * LEFT) @ facing(azimuth, (1.0 - LEVELLED * level) * tilt)
            at = middle + side * (scenario.cup.rim - 0.001 + apart) * LEFT - rot @ point
            actions.append(steer(arm, at, np.zeros(3), 2.0 * between(arm.hand_rot, rot), CLOSED))
        yield np.concatenate(actions)


def squeeze_the_bead(scenario: Scenario, world: World) -> Plan:
    """Press both hands on the bead, lift, level the hands in the air, roll by half a turn, set the cup down."""
    assert isinstance(scenario, CupInversion)
    here, there = (np.array([*spot[:2], TABLE_TOP + HEIGHT]) for spot in (world.com("cup"), scenario.goal))
    high = LIFT * UP
    yield from both(scenario, world, 2.5, lambda t: (here + 0.14 * UP, 0.08, 0.0, 0.0))
    yield from both(scenario, world, 2.0, lambda t: (here + (1 - t) * 0.14 * UP, 0.08 - 0.05 * t, 0.0, 0.0))
    yield from both(scenario, world, 1.5, lambda t: (here, 0.03 - (0.03 + TIGHT) * t, 0.0, 0.0))
    yield from both(scenario, world, 1.5, lambda t: (here + t * high, -TIGHT, 0.0, 0.0))
    yield from both(scenario, world, 1.5, lambda t: (here + high, -TIGHT, t, 0.0))
    yield from both(scenario, world, 4.0, lambda t: (here + high, -TIGHT, 1.0, t))
    yield from both(
        scenario, world, 3.0, lambda t: (here + min(1.0, 1.2 * t) * (there - here) + high, -TIGHT, 1.0, 1.0)
    )
    start = world.time
    down = both(scenario, world, 5.0, lambda t: (there + (LIFT - 5.0 * LOWER_SPEED * t) * UP, -TIGHT, 1.0, 1.0))
    yield from until(down, lambda: world.touching("cup", "table"))
    end = there + (LIFT - LOWER_SPEED * (world.time - start)) * UP
    yield from both(scenario, world, 0.5, lambda t: (end, (TIGHT + 0.02) * t - TIGHT, 1.0, 1.0))
    yield from both(scenario, world, 1.0, lambda t: (end, 0.02 + 0.05 * t, 1.0, 1.0))


HANDS = {"squeeze_the_bead": Hand(squeeze_the_bead, unmended)}
