"""T13: the ball is followed after a bounce, or met on its straight line: nothing about the walls is known."""

import math

import numpy as np
from hand import Hand

from scengen.assets.prop import TABLE_HALF
from scengen.attack.plans import HOVER_HEIGHT, LOWEST_HAND, pursue, velocity_of
from scengen.geometry import UP, Vec3
from scengen.robots.panda import BASE
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.jaw import grasp
from scengen.skills.motion import COARSE, OPEN, closing_along, hold, retreat, stay

PARKED: Vec3 = np.array([-0.15, 0.0, LOWEST_HAND + 0.07])  # place of the hand until the first bounce [m]
CLOSING_TIME = 0.14  # time that the fingers need [s]


def follow(scenario: Scenario, world: World) -> Plan:
    """Wait for the first bounce, then follow the ball by feedback and grasp it as it moves."""
    while not world.memory["bounces"] or world.memory["at_wall"]:
        yield from hold(world.arm, 0.02, OPEN)
    yield from pursue(world.arm, "ball", lead=0.05)


def go_ahead(scenario: Scenario, world: World) -> Plan:
    """After every bounce, go to a place on the ball's straight line, as if there were no walls."""
    arm, bounces, rot = world.arm, 0.0, world.arm.hand_rot

    def bounced() -> bool:
        return world.memory["bounces"] > bounces and not world.memory["at_wall"]

    while True:
        yield from stay(arm, PARKED, rot, bounced, COARSE, OPEN)
        bounces = world.memory["bounces"]
        yield from hold(arm, 0.03, OPEN)  # the wall lets the ball go
        velocity, start = velocity_of(arm, "ball") * [1.0, 1.0, 0.0], world.time
        if (seconds := reached(world, velocity)) is None:
            continue
        at = world.com("ball") + seconds * velocity
        at[2], rot = LOWEST_HAND + 0.003, closing_along(arm, np.cross(UP, velocity / np.linalg.norm(velocity)))
        due = start + seconds - CLOSING_TIME
        late = lambda due=due: bounced() or world.time > due  # noqa: E731
        above = at + HOVER_HEIGHT * UP
        over = lambda above=above, late=late: late() or math.dist(arm.hand, above) < 0.02  # noqa: E731
        yield from stay(arm, above, rot, over, COARSE, OPEN)
        yield from stay(arm, at, rot, late, grip=OPEN)
        if not bounced():
            break
    yield from grasp(arm)
    yield from retreat(arm)


def reached(world: World, velocity: Vec3) -> float | None:
    """Time after which hand and ball can meet on the ball's straight line [s]; None if they cannot."""
    for seconds in np.arange(0.3, 4.0, 0.05):
        at = world.com("ball") + float(seconds) * velocity
        if max(abs(at[0]), abs(at[1])) > TABLE_HALF - 0.04:
            return None
        near = 0.38 < math.dist(at[:2], BASE[:2]) < 0.76
        if near and math.dist(at[:2], world.arm.hand[:2]) / 0.28 + 0.8 < seconds:
            return float(seconds)
    return None


HANDS = {"follow": Hand(follow), "go_ahead": Hand(go_ahead)}
