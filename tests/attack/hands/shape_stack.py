"""T30: a shape is set on the cone with the jaw hardly open. It leans on a finger, and is stacked somewhere else."""

from hand import Hand

from scengen.geometry import UP
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.jaw import carry, grasp, put
from scengen.skills.motion import COARSE, OPEN, hold, push, retreat
from scengen.tasks.shape_stack import CARRY_HEIGHT, ShapeStack

LOOSE_GAP = 0.003  # distance by which the jaw opens to let a shape lean [m]


def try_the_cone(scenario: Scenario, world: World) -> Plan:
    """Set a shape on the cone, open the jaw a little, close it again, and stack the shape where it can stand."""
    assert isinstance(scenario, ShapeStack)
    arm, (base, tried, *others, cone) = world.arm, scenario.order
    yield from scenario.take(world, tried)
    at = scenario.place_on(world, tried, cone)
    yield from carry(arm, tried, at + scenario.lift_height(world, tried) * UP, pace=COARSE)
    yield from carry(arm, tried, at + 0.01 * UP)
    yield from push(arm, -0.04 * UP, until=lambda: world.touching(tried, cone))
    gap, end = arm.gap, world.time + 0.5
    while arm.gap < gap + LOOSE_GAP and world.time < end:
        yield from hold(arm, 0.02, OPEN)
    yield from hold(arm, 0.5, 0.0)
    yield from grasp(arm)
    yield from retreat(arm, 0.08)
    yield from put(arm, tried, scenario.place_on(world, tried, base), on=base, hover=scenario.lift_height(world, tried))
    yield from retreat(arm, scenario.pieces[tried].shape.height + CARRY_HEIGHT)
    yield from scenario.pile(world, [tried, *others, cone])


HANDS = {"try_the_cone": Hand(try_the_cone)}
