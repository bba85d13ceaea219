"""T09: the box is stood up in the slot, toppled, and shoved until it drops in."""

from contextlib import suppress

from hand import Hand

from scengen.errors import GaveUp
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.motion import CLOSED, COARSE, STEADY, go_to, push, retreat
from scengen.tasks.cracker_box_jaw import STAND_OFF, CrackerBoxJaw


def topple_and_shove(scenario: Scenario, world: World) -> Plan:
    """Stand the box up at the near end, topple it onto the far wall, push its upper end back until it is down."""
    assert isinstance(scenario, CrackerBoxJaw)
    arm = world.arm
    yield from scenario.shortcuts()["stand_it_up_and_topple_it"].plan(world)
    yield from retreat(arm)
    for _ in range(4):
        if scenario.success(world):
            return
        with suppress(GaveUp):
            yield from shove_back(scenario, world)
        yield from retreat(arm, 0.08)


def shove_back(scenario: CrackerBoxJaw, world: World) -> Plan:
    """Push the upper end of a box that leans on the far wall towards the near wall, for at most 2.5 s."""
    arm, back, tall = world.arm, -scenario.out, world.rot("box")[:, 2]
    end = world.com("box") + scenario.box.size[2] / 2 * (tall if tall[2] > 0.0 else -tall)
    start = end - STAND_OFF * back
    start[2] = max(end[2], scenario.rim + scenario.box.size[0] / 3)
    above = start.copy()
    above[2] = max(arm.hand[2], start[2] + STAND_OFF)
    for place in (above, start):
        yield from go_to(arm, place, scenario._knocking_hand, STEADY, CLOSED)
    stop = world.time + 2.5
    yield from push(arm, 0.06 * back, lambda: world.time > stop or scenario.down(world), CLOSED, 5.0)
    yield from go_to(arm, arm.hand - 0.03 * back, pace=COARSE)


HANDS = {"topple_and_shove": Hand(topple_and_shove)}
