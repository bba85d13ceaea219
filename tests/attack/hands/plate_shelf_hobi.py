"""T05: the rim of the lying plate is raised without a press: pried up against a stop, or held by two jaws at once."""

import math
from contextlib import suppress

import numpy as np
from hand import Hand

from scengen.errors import GaveUp
from scengen.geometry import UP, Mat3, Vec3, between, rotation
from scengen.robots.jaw import FINGER_ACROSS, OPEN_GAP, TIP_BELOW
from scengen.scenario import Plan, Scenario
from scengen.sim.arm import Arm
from scengen.sim.world import World
from scengen.skills.handover import CLOSING, STAND_OFF, sideways
from scengen.skills.jaw import grasp, release
from scengen.skills.motion import CLOSED, OPEN, STEADY, Pace, alone, facing_down, go_to, steer
from scengen.tasks.plate_shelf_hobi import PlateShelfHobi

PRY_TILTS = math.radians(57.0), math.radians(42.0)  # of the hand below the level, first and last [rad]
PRY_DEPTHS = 0.003, 0.012  # distances of the rim beyond the grip site, first and last [m]
PRY_ANGLE = math.radians(20.0)  # angle by which the plate is pried up [rad]
INWARDS = 0.008  # distance by which the prying finger aims under the plate [m]
BESIDE = OPEN_GAP / 2 - 0.0025  # distance of the grip site from a rim that lies on the lower finger [m]
CREEP = Pace(0.06, 0.003, 1.0)
FLAT_TILT = math.radians(58.0)  # tilt of both hands that hold the lying plate between them [rad]
TIGHT = 0.03  # distance by which each of these hands aims at the other one [m]


def pry_against_a_stop(scenario: Scenario, world: World) -> Plan:
    """One hand stands beyond the far side; a finger of the other one lifts the rim, and the jaw closes on it."""
    assert isinstance(scenario, PlateShelfHobi)
    self, (stopper, taker), out = scenario, scenario.roles(world), scenario.outside
    first, _ = prying(self, 0.0)
    spot = self.start - (self.plate.radius + FINGER_ACROSS) * out + (TIP_BELOW + 0.002) * UP
    yield from self.in_roles(world, stand(stopper, spot, 0.02 * out), come_near(taker, self, first))
    for share in np.linspace(0.0, 1.0, 12):
        with suppress(GaveUp):
            yield from alone(taker, go_to(taker, *prying(self, float(share)), CREEP, OPEN))
    yield from alone(taker, grasp(taker, CLOSING))
    yield from alone(stopper, self.park(stopper))
    yield from self.deliver(taker)


def stand(arm: Arm, spot: Vec3, nearer: Vec3) -> Plan:
    """Come down beside a spot with closed fingers, and move to it."""
    down = facing_down(math.pi / 2)
    for away in (0.1 * UP - nearer, -nearer, 0.0 * UP):
        yield from go_to(arm, spot + away, down, STEADY, CLOSED)


def come_near(arm: Arm, scenario: PlateShelfHobi, spot: Vec3) -> Plan:
    """Bring the open jaw outside of the rim."""
    hand = scenario.hand(PRY_TILTS[0])
    yield from go_to(arm, spot + 0.05 * (scenario.outside + UP), hand, STEADY, OPEN)
    with suppress(GaveUp):
        yield from go_to(arm, spot + 0.03 * scenario.outside, hand, STEADY, OPEN)


def prying(scenario: PlateShelfHobi, share: float) -> tuple[Vec3, Mat3]:
    """Pose of the hand whose lower finger is under the rim, when the plate has turned by a share of `PRY_ANGLE` about
    the far edge of its foot."""
    plate, angle = scenario.plate, share * PRY_ANGLE
    (tilt, depth), out = (a + share * (b - a) for a, b in (PRY_TILTS, PRY_DEPTHS)), scenario.outside
    along, high = plate.radius + plate.foot, plate.rise + plate.thickness / 2
    rim = scenario.start - plate.foot * out + along * (math.cos(angle) * out + math.sin(angle) * UP)
    rim += high * (math.cos(angle) * UP - math.sin(angle) * out)
    hand = scenario.hand(tilt)
    upper = math.cos(tilt) * UP - math.sin(tilt) * out  # from the lower finger to the upper one
    return rim - depth * hand[:, 2] + BESIDE * upper - INWARDS * out, hand


def hold_it_between_two_jaws(scenario: Scenario, world: World) -> Plan:
    """Two jaws grip opposite sides of the lying plate and press inwards; in the air one is levelled and keeps it."""
    assert isinstance(scenario, PlateShelfHobi)
    self, (other, taker) = scenario, scenario.roles(world)
    sides = {other.number: -self.side, taker.number: self.side}
    hands = {number: sideways(side, FLAT_TILT) for number, side in sides.items()}
    starts = dict[int, Vec3]()

    def grip(arm: Arm) -> Plan:
        side, hand = sides[arm.number], hands[arm.number]
        rim = self.start + side * self.plate.radius * abs(self.outside)
        rim = rim + (self.plate.rise + self.plate.thickness / 2) * UP
        yield from go_to(arm, rim - STAND_OFF * hand[:, 2], hand, STEADY, OPEN)
        with suppress(GaveUp):
            yield from go_to(arm, rim + 0.006 * hand[:, 2], hand, Pace(0.06, 0.003, 1.5), OPEN)
        yield from grasp(arm, CLOSING)
        starts[arm.number] = arm.hand

    def squeeze(arm: Arm, low: float, high: float, rot: Mat3) -> Plan:
        begin, inwards, turn = world.time, -sides[arm.number] * abs(self.outside), between(hands[arm.number], rot)
        while world.time < begin + 2.0:
            share = (world.time - begin) / 2.0
            at = starts[arm.number] + (low + share * (high - low)) * UP + TIGHT * inwards
            aim = rotation(share * turn) @ hands[arm.number]
            yield steer(arm, at, (high - low) / 2.0 * UP, between(arm.hand_rot, aim), CLOSED)

    yield from self.in_roles(world, grip(other), grip(taker))
    for low, high, rot in ((0.0, 0.12, hands[taker.number]), (0.12, 0.12, self.hand(math.radians(25.0)))):
        yield from self.in_roles(world, squeeze(other, low, high, hands[other.number]), squeeze(taker, low, high, rot))
    yield from alone(other, release(other, 0.3))
    yield from alone(other, go_to(other, other.hand - 0.1 * hands[other.number][:, 2], pace=STEADY))
    yield from self.deliver(taker)


HANDS = {f.__name__: Hand(f) for f in (pry_against_a_stop, hold_it_between_two_jaws)}
