"""T26: the red cube hangs over the patch once, is laid down beside it, and pushed onto it."""

import numpy as np
from hand import Hand, shove

from scengen.geometry import UP
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.jaw import carry, put
from scengen.skills.motion import COARSE, retreat
from scengen.tasks.occluder_push import OccluderPush

BESIDE = 0.11  # distance from the patch's middle at which the cube is laid down [m]


def show_and_push(scenario: Scenario, world: World) -> Plan:
    """Uncover the red cube, hold it over the patch, lay it down on the other side than it came from, push it back."""
    assert isinstance(scenario, OccluderPush)
    arm, red = world.arm, scenario.reddest(world)
    cube, middle = scenario.cubes[red], scenario.goal + scenario.cube.edge / 2 * UP
    for i in range(red + 1):
        yield from scenario.uncover(world, i)
    yield from scenario._take(world, red)
    yield from carry(arm, cube, middle + 0.05 * UP, pace=COARSE)
    side = BESIDE if red == 2 else -BESIDE
    yield from put(arm, cube, middle + np.array([-0.02, side, 0.0]), on="table", hover=0.05)
    yield from retreat(arm)
    yield from shove(arm, cube, middle, near=0.03)


HANDS = {"show_and_push": Hand(show_and_push)}
