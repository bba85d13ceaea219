"""T28: open fingers stay around the top cube while the blow comes, which throws it nowhere."""

import numpy as np
from hand import Hand, otherwise

from scengen.geometry import UP
from scengen.params import values, with_values
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.cubes import CARRY_HEIGHT, CARRY_PACE, centre
from scengen.skills.jaw import carry, grasp, pick, put, release
from scengen.skills.motion import OPEN, hold, retreat
from scengen.tasks.stack_collapse_recovery import StackCollapseRecovery


class Guardable(StackCollapseRecovery):
    """The task without its rule that a low hand delays the blow."""

    def guarded(self, world: World) -> bool:
        return False


def unmended(scenario: Scenario) -> Scenario:
    return otherwise(with_values(Guardable(), values(scenario)))


def guard(scenario: Scenario, world: World) -> Plan:
    """Open the jaw around the top cube until the blow is over, lay the cube on the table and put it back, blindly."""
    assert isinstance(scenario, StackCollapseRecovery)
    arm, half, end = world.arm, scenario.top.edge / 2, 4.0
    middle, side = centre(world, "top", scenario.top.edge), world.rot("top")[:, 1]
    above = scenario.top.edge + CARRY_HEIGHT
    yield from pick(arm, middle, side, above=above, lift=0.0, squeeze=0.3, pace=CARRY_PACE)
    yield from release(arm, 0.1)
    while not world.memory["blows"] and world.time < end:
        yield from hold(arm, 0.02, OPEN)
    yield from hold(arm, 0.5, OPEN)
    yield from grasp(arm)
    yield from retreat(arm, 0.03)
    beside = scenario.feet[0] + np.array([0.0, 0.13, half])
    yield from carry(arm, "top", beside + 0.10 * UP, pace=CARRY_PACE)
    yield from put(arm, "top", beside, on="table", hover=0.03)
    yield from grasp(arm)
    yield from retreat(arm, 0.12)
    yield from put(arm, "top", scenario.feet[2] + half * UP, on="middle", hover=CARRY_HEIGHT)
    yield from retreat(arm)


HANDS = {"guard": Hand(guard, unmended)}
