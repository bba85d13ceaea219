"""T15: wait midway, go to the block that starts to slide, and swing the bin there by a turn of the wrist."""

import math

import numpy as np
from hand import Hand

from scengen.assets.prop import TABLE_TOP
from scengen.geometry import about_z, yaw_of
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.jaw import release
from scengen.skills.motion import Pace, facing_down, stay
from scengen.tasks.slide_catch import SlideCatch

SWING_ANGLE = math.radians(25.0)  # turn of the wrist: the bin is 85 mm before the hand and moves sideways by 36 mm
SEEN_SLIDE = 0.001  # distance after which a block is seen to slide [m]


def swing(scenario: Scenario, world: World) -> Plan:
    """Wait midway between the remaining lanes, knowing neither frictions nor order, and swing to what slides."""
    assert isinstance(scenario, SlideCatch)
    arm, remaining = world.arm, list(scenario.blocks)
    yield from scenario.take(world)
    starts = {block: scenario.distance_up(world, block) for block in remaining}

    def moving() -> list[str]:
        return [block for block in remaining if scenario.distance_up(world, block) < starts[block] - SEEN_SLIDE]

    while remaining:
        middle = float(np.mean([world.pos(remaining[0])[1], world.pos(remaining[-1])[1]]))
        yield from scenario.wait_at(world, middle, lambda: bool(moving()))
        block = moving()[0]
        y = float(world.pos(block)[1])
        aside = y - float(world.pos("bin")[1])
        angle = float(np.clip(aside / 0.085, -SWING_ANGLE, SWING_ANGLE))
        held = about_z(angle - yaw_of(world.rot("bin"))) @ (arm.hand - world.pos("bin"))
        inside = lambda block=block: world.com(block)[2] < TABLE_TOP + scenario.bin.rim  # noqa: E731
        yield from stay(arm, scenario.bin_at(y) + held, facing_down(angle), inside, Pace(0.30, 0.004))
        remaining.remove(block)
    yield from release(arm)


HANDS = {"swing": Hand(swing)}
