"""T25: weights are felt by pushing, or cubes are put down for good one after the other, the last by deduction."""

import numpy as np
from hand import Hand

from scengen.assets.prop import TABLE_TOP
from scengen.geometry import UP
from scengen.scenario import Plan, Scenario
from scengen.sim.arm import ROBOT
from scengen.sim.world import World
from scengen.skills.jaw import weigh
from scengen.skills.motion import CLOSED, COARSE, STEADY, closing_along, go_to, push
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


HANDS = {"push_each": Hand(push_each), "one_after_the_other": Hand(one_after_the_other)}
