"""T27: a hand on its side carries the object, so that it rests on the lower finger when the jaw opens."""

import math
from contextlib import suppress

import numpy as np
from hand import Hand

from scengen.attack.plans import on_its_side, turn_about
from scengen.errors import GaveUp
from scengen.geometry import UP
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.grip import take
from scengen.skills.jaw import carry, release
from scengen.skills.motion import CLOSED, Pace, go_to, hold, push, retreat, until
from scengen.tasks.slip_recovery import SlipRecovery


def cradle(scenario: Scenario, world: World) -> Plan:
    """Lift the object, turn the hand on its side about it, carry it through the slip, turn back, put it down."""
    assert isinstance(scenario, SlipRecovery)
    arm = world.arm
    yield from take(arm, "thing", lift=0.18)
    upright, goal = arm.hand_rot, np.array([*scenario.goal[:2], world.com("thing")[2]])
    yield from turn_about(arm, "thing", on_its_side(math.radians(135.0), math.radians(30.0)))
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
    yield from turn_about(arm, "thing", upright)
    stands = np.array([*scenario.goal[:2], world.memory["stood"] + 0.015])
    yield from carry(arm, "thing", stands, pace=Pace(0.3, 0.01))
    yield from push(arm, -0.08 * UP, lambda: world.touching("thing", "table"))
    yield from release(arm)
    yield from retreat(arm, 0.06)


HANDS = {"cradle": Hand(cradle)}
