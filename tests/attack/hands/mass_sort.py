"""T25: weights are felt by pushing, or cubes are put down for good one after the other, the last by deduction; or cubes
that hung over a zone once are pushed into theirs."""

import numpy as np
from hand import Hand, shove

from scengen.assets.prop import TABLE_TOP
from scengen.geometry import UP
from scengen.scenario import Plan, Scenario
from scengen.sim.arm import ROBOT
from scengen.sim.world import World
from scengen.skills.jaw import carry, put, weigh
from scengen.skills.motion import CLOSED, COARSE, STEADY, closing_along, go_to, push, retreat
from scengen.tasks.mass_sort import CARRY_HEIGHT, CUBE_COUNT, MassSort

WEIGHTS = (0.49, 0.98, 1.96)  # weights of the paper's cubes by rank [N]
PUSHED_DISTANCE = 0.05  # distance by which each cube is pushed [m]
ALONG = np.array([1.0, 0.0, 0.0])  # direction of the pushes, away from the robot


def push_each(scenario: Scenario, world: World) -> Plan:
    """Push each cube at 0.05 m/s, sort the cubes by the mean resistance, deliver them without a weighing."""
    assert isinstance(scenario, MassSort)
    arm, felt = world.arm, []
    for cube in scenario.cubes:
        begin, readings = world.com(cube), []
        start = begin - (0.72 * scenario.edge + 0.025) * ALONG
        start[2] = TABLE_TOP + 0.02
        rot = closing_along(arm, [0.0, 1.0, 0.0])
        yield from go_to(arm, start + 0.08 * UP, rot, COARSE, CLOSED)
        yield from go_to(arm, start, rot, STEADY, CLOSED)
        end = world.time + 3.0

        def pushed(cube=cube, begin=begin) -> float:
            return float((world.com(cube) - begin) @ ALONG)

        done = lambda pushed=pushed, end=end: pushed() > PUSHED_DISTANCE or world.time > end  # noqa: E731
        for action in push(arm, 0.05 * ALONG, done, CLOSED, 4.0):
            yield action
            if world.touching(ROBOT, cube) and pushed() > 0.4 * PUSHED_DISTANCE:
                readings.append(abs(float(arm.load()[:3] @ ALONG)))
        felt.append(float(np.mean(readings)) if readings else 0.0)
        yield from go_to(arm, arm.hand + 0.09 * UP - 0.02 * ALONG, pace=COARSE)
    yield from scenario.deliver(
        world, {cube: sorted(felt).index(f) for cube, f in zip(scenario.cubes, felt, strict=True)}
    )


def one_after_the_other(scenario: Scenario, world: World) -> Plan:
    """Weigh a cube and put it down for good, then the next one; the last one needs no weighing."""
    assert isinstance(scenario, MassSort)
    left = list(range(CUBE_COUNT))
    for cube in scenario.cubes:
        yield from scenario.take(world, cube, scenario.edge + CARRY_HEIGHT)
        rank = left[0]
        if len(left) > 1:
            weight = float((yield from weigh(world.arm))[2])
            rank = min(left, key=lambda rank: abs(weight - WEIGHTS[rank]))
        left.remove(rank)
        yield from scenario.place_held(world, cube, rank)


def weigh_and_push(scenario: Scenario, world: World) -> Plan:
    """Weigh each cube, hold it over the middle zone, put it back; then push all into their zones."""
    assert isinstance(scenario, MassSort)
    arm, weights, half = world.arm, [], scenario.edge / 2 * UP
    for cube in scenario.cubes:
        start, high = world.com(cube), (scenario.edge + 0.02) * UP
        yield from scenario.take(world, cube, scenario.edge + 0.02)
        weights.append(float((yield from weigh(arm))[2]))
        yield from carry(arm, cube, scenario.zones[1] + half + high, pace=COARSE)
        yield from put(arm, cube, start, on="table", hover=0.03)
        yield from retreat(arm, scenario.edge + 0.03)
    for cube, weight in zip(scenario.cubes, weights, strict=True):
        yield from shove(arm, cube, scenario.zones[sorted(weights).index(weight)] + half, near=0.012)


HANDS = {
    "push_each": Hand(push_each),
    "one_after_the_other": Hand(one_after_the_other),
    "weigh_and_push": Hand(weigh_and_push),
}
