"""T27: a hand on its side carries the object, so that it rests on the lower finger when the jaw opens."""

import math
from contextlib import suppress

import numpy as np
from hand import Hand

from scengen.errors import GaveUp
from scengen.geometry import UP, Mat3, Vec3, between, rotation
from scengen.params import values, with_values
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.grip import take
from scengen.skills.jaw import carry, release
from scengen.skills.motion import CLOSED, Pace, go_to, hold, push, retreat, steer, until
from scengen.tasks.slip_recovery import SlipRecovery

TURN_RATE = 1.8  # rate at which the hand turns about the object [rad/s]


class MayBeKept(SlipRecovery):
    """The task without its rule on objects that the hand keeps through a slip."""

    def kept(self, world: World) -> bool:
        return False


def unmended(scenario: Scenario) -> Scenario:
    return with_values(MayBeKept(), values(scenario))


def cradle(scenario: Scenario, world: World) -> Plan:
    """Lift the object, turn the hand on its side about it, carry it through the slip, turn back, put it down."""
    assert isinstance(scenario, SlipRecovery)
    arm = world.arm
    yield from take(arm, "thing", lift=0.18)
    upright, goal = arm.hand_rot, np.array([*scenario.goal[:2], world.com("thing")[2]])
    yield from turn_about(world, world.com("thing"), on_its_side(math.radians(135.0), math.radians(30.0)))
    for _ in range(scenario.slips + 1):
        held = arm.hand - world.com("thing")
        with suppress(GaveUp):
            move = go_to(arm, goal + held, arm.hand_rot, Pace(0.25, 0.02, 4.0), CLOSED)
            yield from until(move, lambda: scenario.pending(world))
        if not scenario.pending(world):
            break
        while scenario.pending(world):
            yield from hold(arm, 0.02, CLOSED)
        yield from hold(arm, 0.2, CLOSED)
    yield from turn_about(world, world.com("thing"), upright)
    stands = np.array([*scenario.goal[:2], world.memory["stood"] + 0.015])
    yield from carry(arm, "thing", stands, pace=Pace(0.3, 0.01))
    yield from push(arm, -0.08 * UP, lambda: world.touching("thing", "table"))
    yield from release(arm)
    yield from retreat(arm, 0.06)


def on_its_side(azimuth: float, elevation: float) -> Mat3:
    """Orientation of a hand that looks along a direction [rad] and whose fingers close in a vertical plane."""
    along = np.array(
        [math.cos(azimuth) * math.cos(elevation), math.sin(azimuth) * math.cos(elevation), math.sin(elevation)]
    )
    closing = np.cross(along, [-math.sin(azimuth), math.cos(azimuth), 0.0])
    return np.stack([closing, np.cross(along, closing), along], axis=1)


def turn_about(world: World, middle: Vec3, rot: Mat3) -> Plan:
    """Turn the hand about the middle of the held object, for at most 1.5 s longer than the turn takes."""
    arm, start, begin = world.arm, world.arm.hand_rot, world.time
    held, turn = start.T @ (middle - arm.hand), between(start, rot)
    seconds = float(np.linalg.norm(turn)) / TURN_RATE
    while world.time < begin + seconds + 1.5:
        share = min(1.0, (world.time - begin) / max(seconds, 1e-9))
        if share == 1.0 and np.linalg.norm(between(arm.hand_rot, rot)) < 0.08:
            return
        aim = rotation(share * turn) @ start
        yield steer(arm, middle - aim @ held, np.zeros(3), between(arm.hand_rot, aim), CLOSED)


HANDS = {"cradle": Hand(cradle, unmended)}
