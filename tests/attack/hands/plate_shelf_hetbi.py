"""T06: the suction hand presses the rim to the table as in T05, and the jaw takes the side that rises: no handover."""

import math
from contextlib import suppress
from dataclasses import replace

from hand import Hand, otherwise

from scengen.errors import GaveUp
from scengen.geometry import UP, Mat3, about_z, polar, shortest
from scengen.robots.jaw import PALM_ABOVE, TIP_BELOW
from scengen.scenario import Plan, Scenario
from scengen.sim.arm import Arm
from scengen.sim.world import World
from scengen.skills.handover import CLOSING, GENTLY, LEFT, STAND_OFF, steepness
from scengen.skills.jaw import grasp
from scengen.skills.motion import OPEN, STEADY, Pace, alone, facing_down, go_to, together, turn_to, until
from scengen.tasks.plate_and_slot import CARRY_HEIGHT, LIFT_HEIGHT, LIFT_PACE
from scengen.tasks.plate_shelf import PlateShelf


def unmended(scenario: Scenario) -> Scenario:
    """The task with a rim so high that the side that rises leaves room for a jaw, and a slot to match."""
    assert isinstance(scenario, PlateShelf)
    return otherwise(replace(scenario, plate=replace(scenario.plate, rise=0.012), gap=0.038))


def press(scenario: PlateShelf, arm: Arm) -> Plan:
    """Press the rim on the right with the suction hand until the plate has turned about its foot."""
    spot = scenario.start - (scenario.plate.radius - 0.006) * LEFT
    yield from go_to(arm, spot + 0.06 * UP, facing_down(), STEADY, OPEN)
    down = go_to(arm, spot + (scenario.plate.thickness - 0.012) * UP, facing_down(), Pace(0.05, 0.0), OPEN)
    turned = 0.93 * slope(scenario)
    yield from until(down, lambda: math.asin(float(scenario.outwards(arm.world) @ UP)) > turned)


def slope(scenario: PlateShelf) -> float:
    """Angle by which the plate turns when its rim is pressed to the table [rad]."""
    return math.atan(scenario.plate.rise / (scenario.plate.radius - scenario.plate.foot))


def edgewise(scenario: PlateShelf, arm: Arm) -> Mat3:
    """Orientation of the hand with the plate along the slot and its upper face towards the robot, as in T05."""
    across, normal = -arm.world.rot("shelf")[:, 0], arm.world.rot("plate")[:, 2]
    turn = about_z(math.remainder(polar(across)[0] - polar(normal)[0], math.tau))
    return shortest(turn @ normal, across) @ turn @ arm.hand_rot


def press_and_take(scenario: Scenario, world: World) -> Plan:
    """Press with one arm, take the raised rim with the other one, put the plate in."""
    assert isinstance(scenario, PlateShelf)
    right, left = world.arms
    raised = (scenario.plate.radius + scenario.plate.foot) * math.sin(slope(scenario))
    height = scenario.plate.rise + scenario.plate.thickness / 2 + raised
    hand = scenario.hand(steepness(height, PALM_ABOVE + TIP_BELOW))
    beside = scenario.rim(world) + raised * UP - 1.2 * STAND_OFF * hand[:, 2]
    yield from together(world, press(scenario, right), go_to(left, beside, hand, STEADY, OPEN))
    with suppress(GaveUp):
        yield from alone(left, go_to(left, scenario.rim(world) + 0.018 * hand[:, 2], hand, GENTLY, OPEN))
    yield from alone(left, grasp(left, CLOSING))
    yield from alone(right, scenario.park(right))
    yield from alone(left, go_to(left, left.hand + LIFT_HEIGHT * UP, pace=LIFT_PACE))
    if not world.touching(left.label, "plate"):
        raise GaveUp("the jaw does not hold the plate")
    yield from alone(left, turn_to(left, facing_down(), 0.8))
    above = scenario.foot[2] + scenario.shelf.top + 2 * scenario.plate.radius + CARRY_HEIGHT
    yield from alone(left, go_to(left, [-0.10, 0.10, above], pace=STEADY))
    yield from alone(left, turn_to(left, edgewise(scenario, left), 1.2))
    yield from alone(left, scenario.put_in(left))


HANDS = {"press_and_take": Hand(press_and_take, unmended)}
