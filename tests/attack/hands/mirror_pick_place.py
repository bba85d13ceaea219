"""M01: no picture. A level open jaw sweeps both rows where cubes stand, like a fork, and feels what it meets."""

import math

import numpy as np
from hand import Hand

from scengen.assets.prop import TABLE_TOP
from scengen.control.loop import Loop
from scengen.geometry import UP, Vec3, between
from scengen.scenario import Plan, Scenario
from scengen.sim.arm import Arm
from scengen.sim.world import World
from scengen.skills.jaw import grasp, release
from scengen.skills.motion import CLOSED, OPEN, Pace, facing, go_to, hold, push, steer, until
from scengen.skills.waiting import at_most

ROWS = (0.045, -0.145)  # x of the two rows of training [m]
ENDS = (-0.27, 0.27)  # y between which a row is swept [m]
HEIGHT = 0.037  # height of the level hand over the table [m]
ALONG = np.array([0.0, 1.0, 0.0])  # direction of the sweeps
LEVEL = facing(math.pi / 2, 0.0)  # orientation of the hand
SPEED = 0.28  # speed of the sweeps [m/s]
FELT = 0.08  # force that is felt [N]
STEP = 0.020  # first shift to the side on which the cube was felt [m]; each further one is about half as large
MOST = 5  # touches after which the jaw closes anyway


def to_row(arm: Arm, row: float, seconds: float) -> Plan:
    """Bring the open hand to the beginning of a row, and lower it."""
    start = np.array([row, ENDS[0], TABLE_TOP + HEIGHT])
    high = start + 0.03 * UP

    def there() -> bool:
        return math.dist(arm.hand, high) < 0.04 and float(np.linalg.norm(between(arm.hand_rot, LEVEL))) < 0.12

    yield from at_most(arm.world, seconds, until(go_to(arm, high, LEVEL, Pace(0.5, 0.01, 9.0), OPEN), there))
    yield from at(arm, start, 0.4)


def at(arm: Arm, place: Vec3, seconds: float) -> Plan:
    """Steer the open hand to a place for some time."""
    end = arm.world.time + seconds
    while arm.world.time < end:
        yield steer(arm, place, np.zeros(3), between(arm.hand_rot, LEVEL), OPEN)


def meets(arm: Arm, start: Vec3) -> Plan:
    """Sweep from a place until the hand feels something, or the row ends."""
    place, periods, felt = start, 0, 0
    while arm.hand[1] < ENDS[1] and felt < 2:
        place, periods = place + SPEED * Loop.PERIOD * ALONG, periods + 1
        yield steer(arm, place, SPEED * ALONG, between(arm.hand_rot, LEVEL), OPEN)
        felt = felt + 1 if periods > 8 and abs(arm.load()[1]) > FELT else 0


def fork(scenario: Scenario, world: World) -> Plan:
    """Sweep one row, then the other. Torque over force tells which finger met the cube; the hand shifts to that side
    until the palm meets it."""
    arm = world.arm
    yield from go_to(arm, arm.hand - 0.2 * ALONG, pace=Pace(0.3, 0.05, 2.0), grip=OPEN)
    for number, row in enumerate(ROWS):
        if number:
            up = arm.hand + np.array([-0.05, 0.0, 0.17])  # the wrist passes over the cubes
            yield from go_to(arm, up, LEVEL, Pace(0.3, 0.07, 1.5), OPEN)
        yield from to_row(arm, row, 2.2 if number else 1.9)
        start, step = np.array([row, arm.hand[1], TABLE_TOP + HEIGHT]), STEP
        for touch in range(MOST + 1):
            yield from meets(arm, start)
            if arm.hand[1] >= ENDS[1]:
                break
            load = arm.load()
            beside = float(load[5] / load[1]) if load[1] else 0.0
            if abs(beside) < 0.025 or touch == MOST:
                yield from at_most(world, 0.15, push(arm, 0.1 * ALONG, lambda: False, OPEN))
                yield from grasp(arm, 0.35)
                if arm.gap > 0.03:
                    yield from go_to(arm, arm.hand + 0.10 * UP, LEVEL, Pace(0.3, 0.005, 4.0), CLOSED)
                    yield from hold(arm, 1.0)
                    return
                yield from release(arm)
            start = arm.hand - 0.03 * ALONG + np.array([math.copysign(step, beside), 0.0, 0.0])
            start[2], step = TABLE_TOP + HEIGHT, 0.55 * step
            yield from at(arm, start, 0.25)


HANDS = {"fork": Hand(fork)}
