"""T12: the hand follows the ball wherever it is; or closed fingers stop the ball, and pick it up where it lies."""

import math

import numpy as np
from hand import Hand

from scengen.attack.plans import LOWEST_HAND, STOPPED_SPEED, pursue, velocity_of
from scengen.geometry import UP
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.motion import CLOSED, COARSE, OPEN, Pace, closing_along, go_to, hold, stay, steer, until

AHEAD = 2.5  # time after which the ball comes to the fingers that stop it [s]
BEFORE = 0.035  # distance of the fingers before the ball that they brake [m]
BRAKED_SPEED = 3 * STOPPED_SPEED  # speed below which the ball is picked up [m/s]


def follow(scenario: Scenario, world: World) -> Plan:
    """Follow the ball by feedback, a little ahead of it, and grasp it as it rolls."""
    yield from pursue(world.arm, "ball", lead=0.05)


def stop_and_pick(scenario: Scenario, world: World) -> Plan:
    """Put closed fingers into the ball's way, brake it until it is slow, pick it up."""
    arm = world.arm
    yield from until(hold(arm, 9.0, CLOSED), lambda: math.hypot(*velocity_of(arm, "ball")[:2]) > STOPPED_SPEED)
    velocity = velocity_of(arm, "ball")
    along = velocity / np.linalg.norm(velocity)
    rot, at = closing_along(arm, np.cross(UP, along)), world.com("ball") + AHEAD * velocity
    at[2] = LOWEST_HAND
    yield from go_to(arm, at + 0.06 * UP, rot, COARSE, CLOSED)
    yield from stay(arm, at, rot, lambda: world.touching(arm.label, "ball"), grip=CLOSED)
    while np.linalg.norm(velocity_of(arm, "ball")) > BRAKED_SPEED:
        aim = world.com("ball") + BEFORE * along
        yield steer(arm, np.array([aim[0], aim[1], LOWEST_HAND]), np.zeros(3), np.zeros(3), CLOSED)
    yield from go_to(arm, arm.hand + 0.05 * UP, pace=Pace(0.30, 0.01, 2.0), grip=OPEN)
    yield from pursue(arm, "ball", lead=0.1, seconds=4.0)


HANDS = {"follow": Hand(follow), "stop_and_pick": Hand(stop_and_pick)}
