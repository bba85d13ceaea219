"""T16: each ball touches the ramp once, is carried over the barrier, and falls into its bin."""

from hand import Hand

from scengen.assets.prop import TABLE_TOP
from scengen.geometry import UP
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.jaw import release
from scengen.skills.motion import CLOSED, COARSE, closing_along, go_to, push
from scengen.tasks.ramp_sort import LOWER_PACE, RELEASE_HEIGHT, RampSort


def touch_and_drop(scenario: Scenario, world: World) -> Plan:
    """Touch the ramp with each ball in the jaw, lift the ball over the barrier, drop it over its bin."""
    assert isinstance(scenario, RampSort)
    arm, height = world.arm, TABLE_TOP + scenario.barrier.height + 0.03
    rot = closing_along(arm, scenario.axes[:, 0])
    for i, red in enumerate(scenario.colours):
        side = scenario.red_side if red else -scenario.red_side
        yield from scenario.take(world, i)
        yield from go_to(arm, [*arm.hand[:2], height], pace=COARSE)
        spot = scenario.release_spot(side)
        yield from go_to(arm, [spot[0], spot[1], height], rot, COARSE, CLOSED)
        yield from go_to(arm, spot + RELEASE_HEIGHT * UP, rot, LOWER_PACE)
        yield from push(arm, -0.06 * UP, lambda i=i: world.touching(f"ball_{i}", "ramp"))
        yield from go_to(arm, [*arm.hand[:2], height], pace=COARSE)
        _, over = scenario.bin(side)
        yield from go_to(arm, [over[0], over[1], height], pace=COARSE)
        yield from release(arm)
        yield from go_to(arm, [scenario.box_x, scenario.box_y, height], pace=COARSE)


HANDS = {"touch_and_drop": Hand(touch_and_drop)}
