"""T14: a first run from elsewhere than the near slope shows what a run loses; the ball is caught as it comes back."""

import math
from functools import partial

import numpy as np
from hand import Hand

from scengen.geometry import UP, between
from scengen.scenario import Plan, Scenario
from scengen.sim.arm import ROBOT
from scengen.sim.world import World
from scengen.skills.jaw import carry
from scengen.skills.motion import CLOSED, COARSE, OPEN, Pace, go_to, hold, retreat, steer, until
from scengen.tasks.galileo_ramp_drop import GalileoRampDrop

TRIAL_SHARE = 0.8  # height of the first run, as a share of the patch's
HOVER = 0.002  # gap between the near slope and the ball that is let go above it [m]
NEAR = 0.06  # distance from the hand below which the ball is between the fingers [m]
RETURN_SPEED = 0.25  # speed below which the ball is about to turn round [m/s]


def run_first(scenario: Scenario, world: World, side: float) -> Plan:
    """Let the ball go lower than the patch, see how high it climbs, catch it, and release it that much higher.

    Args:
        side: -1 to let it go just above the near slope, 1 on the far one.
    """
    assert isinstance(scenario, GalileoRampDrop)
    arm, ramp, along = world.arm, scenario.ramp, scenario.axes[:, 0]
    start = ramp.goal * TRIAL_SHARE
    s = side * ramp.at_height(start)
    yield from scenario._take(world)
    if side < 0:
        above = scenario.resting(s) + HOVER * scenario.axes @ ramp.normal(s)
        yield from carry(arm, "ball", above + 0.04 * UP, pace=COARSE)
        yield from carry(arm, "ball", above, pace=Pace(0.10, 0.0015))
    else:
        yield from scenario._lower_at(world, s, 0.05)
    held, rot, aim = arm.hand - world.com("ball"), arm.hand_rot, arm.hand
    foot = float(scenario.resting(0.0)[2]) - scenario.ball.radius * (1.0 - math.cos(ramp.slope))  # on a slope
    yield from until(hold(arm, 0.3, OPEN), lambda: not world.touching(ROBOT, "ball"))
    climbed, end = 0.0, world.time + 4.0
    while world.time < end:
        out = -side * scenario.along(world.com("ball"))
        speed = -side * float(world.velocity("ball")[3:] @ along)
        if out > 0.03:
            climbed = max(climbed, float(world.com("ball")[2]) - foot)
            if speed < 0.0:  # it comes back less high by the same share
                aim = scenario.resting(side * ramp.at_height(climbed * min(1.0, climbed / start))) + held
        if climbed and out < 0.0 and speed > (-RETURN_SPEED if _between(world) else 0.0):
            break
        yield steer(arm, aim, np.zeros(3), between(arm.hand_rot, rot), OPEN)
    for _ in range(30):
        there = [*(world.com("ball") + held)[:2], arm.hand[2]] if _between(world) else arm.hand
        yield steer(arm, np.array(there), np.zeros(3), between(arm.hand_rot, rot), CLOSED)
    if arm.grips("ball"):
        yield from go_to(arm, arm.hand + 0.03 * UP, pace=COARSE)
        yield from scenario._put_at(world, -ramp.at_height(ramp.goal * start / min(start, climbed)), hover=0.03)
        yield from retreat(arm)


def _between(world: World) -> bool:
    """Whether the ball is between the fingers."""
    return float(np.linalg.norm(world.com("ball") - world.arm.hand)) < NEAR


HANDS = {
    "run_from_above_the_slope": Hand(partial(run_first, side=-1.0)),
    "run_from_the_far_side": Hand(partial(run_first, side=1.0)),
}
