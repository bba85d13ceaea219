"""Base of the two tasks with a plate and a shelf (T05, T06): the scene, the goal, and how a held plate is put in.

* A plate that falls faster than 0.35 m/s, as from 6 mm, breaks: no goal counts any more. No hand lowers anything faster
  than 0.3 m/s. Speeds are checked every 10 ms, in which a fall gains 0.1 m/s: from 10 mm on it is seen for certain.
  The shelf is polished, so that a plate that is released in the slot does fall.
* A plate that lies stays 6 cm from the table's edge: beyond the edge a palm has space, and one jaw would take the rim
  there. The plate is glazed and its rim is low, so that no jaw takes it where it lies: a hand over
  the table that reaches the rim is steep, and its pads slip off.
* In the slot means: on edge within 10 deg, along the slot, the plate's middle between the dividers, its rim on the
  slot's floor, and released. Leaning against the shelf from outside does not count.
"""

import math
from collections.abc import Mapping
from contextlib import suppress
from functools import cached_property
from typing import Generic, TypeVar

import mujoco
import numpy as np

from ..assets.dish import Dish
from ..assets.plate import Plate
from ..assets.prop import TABLE_HALF, TABLE_TOP, place, table
from ..assets.slot_shelf import SlotShelf
from ..control.loop import Loop
from ..decisions import Decision, choice, near, side_of
from ..errors import GaveUp
from ..geometry import UP, Mat3, Outline, Vec3, between, corners, shortest
from ..means import Mean, throughout, when
from ..predicates import fallen
from ..robots.jaw import PALM_ABOVE, TIP_BELOW
from ..scenario import Plan, Scenario
from ..sim.arm import ROBOT, Arm
from ..sim.world import World
from ..skills import jaw, motion
from ..skills.handover import CLOSING, LEFT, OVERLAP, STAND_OFF, sideways, steepness, take_rim
from ..skills.motion import CLOSED, COARSE, OPEN, STEADY, Pace, alone, facing_down, go_to, push, retreat, turn_to

ANGLE_TOLERANCE = math.radians(10.0)
"""Largest angle between the plate's axis and the level, and between it and the slot's normal [rad]."""
FLOOR_TOLERANCE = 0.005  # largest height of the rim's lowest point above the slot's floor [m]
ALONG_TOLERANCE = 0.03
"""Largest distance of the plate along the slot from its middle [m]: at an end a cup could pass outside the dividers."""
MAX_FALL_SPEED = 0.35  # speed of a fall above which the plate breaks [m/s]
EDGE_MARGIN = 0.06
"""Distance that the rim of a lying plate must keep from the table's edge [m]: nearer, a palm has space for a grip."""
FOOT_CLEARANCE = 0.002  # gap between the plate's foot and the divider while the plate is lowered [m]
CARRY_HEIGHT = 0.02  # height of the plate's rim over the dividers before the plate is lowered [m]
LOWER_SPEED = 0.05  # speed at which the plate is lowered [m/s]
LOWER_TIMEOUT = 12.0  # time after which lowering the plate gives up [s]
LIFT_HEIGHT = 0.25  # height by which the plate is lifted before it is turned on edge [m]
LIFT_PACE = Pace(0.10, 0.01)  # pace of the lift: the plate turns in the pinch
PROBE_PACE = Pace(0.06, 0.003, 1.5)  # pace at which one hand alone tries to take the rim
PARKED_HAND: Vec3 = np.array([-0.15, 0.35, TABLE_TOP + 0.35])
"""Position of the left hand while it is out of the way [m]; the right hand waits at its mirror image."""

PlateT = TypeVar("PlateT", bound=Plate | Dish)


class PlateAndSlot(Scenario, Generic[PlateT]):
    """A plate on the table and a shelf with a slot. Subclasses are dataclasses with these parameters."""

    HOLD = 0.5

    plate_x: float
    plate_y: float
    shelf_x: float
    shelf_y: float
    shelf_yaw: float
    plate: PlateT
    gap: float
    proud: float

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.plate, self.shelf)

    @cached_property
    def shelf(self) -> SlotShelf:
        """Shelf that fits the plate."""
        height = 2 * self.plate.radius - self.proud
        length = 2 * (self.plate.radius + 0.02)  # at each end more than a finger tip beyond the plate
        return SlotShelf(gap=self.gap, height=height, length=length, base=0.012, chamfer=0.012)

    def _scene(self, plate: PlateT, shelf: SlotShelf) -> mujoco.MjSpec:
        scene = table()
        place(scene, plate, "plate", self.start)
        place(scene, shelf, "shelf", self.foot, math.radians(self.shelf_yaw), free=False)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return not world.touching(ROBOT, "plate") and self.on_edge(world) and self.in_slot(world)

    def on_edge(self, world: World) -> bool:
        """Whether the plate stands on edge, along the slot."""
        normal, across = world.rot("plate")[:, 2], world.rot("shelf")[:, 0]
        return bool(abs(normal[2]) < math.sin(ANGLE_TOLERANCE) and abs(normal @ across) > math.cos(ANGLE_TOLERANCE))

    def in_slot(self, world: World) -> bool:
        """Whether the plate's middle is between the dividers and its rim on the slot's floor."""
        spot = world.rot("shelf").T @ (self.middle(world) - self.foot) - self.shelf.base * UP
        inside = abs(spot[0]) < self.gap / 2 and abs(spot[1]) < ALONG_TOLERANCE and spot[2] < self.shelf.height
        return bool(inside and self.lowest(world) - self.foot[2] - self.shelf.base < FLOOR_TOLERANCE)

    def middle(self, world: World) -> Vec3:
        """Current position of the plate's middle, at half its height [m]."""
        return world.pos("plate") + self.plate.height / 2 * world.rot("plate")[:, 2]

    def lowest(self, world: World) -> float:
        """Current height of the rim's lowest point [m]."""
        normal = world.rot("plate")[:, 2]
        faces = (world.pos("plate")[2] + h * normal[2] for h in (self.plate.rise, self.plate.height))
        return float(min(faces) - self.plate.radius * math.sqrt(1.0 - min(1.0, normal[2] ** 2)))

    def failure(self, world: World) -> str | None:
        return "the plate fell off the table" if fallen(world, "plate") else None

    def lies_at_edge(self, world: World) -> bool:
        """Whether the plate lies near the table's edge."""
        # A rim up to 10 mm higher than that of a plate that lies on the table counts as lying.
        lies = self.lowest(world) < TABLE_TOP + self.plate.rise + 0.010
        return lies and float(np.abs(self.middle(world)[:2]).max()) > TABLE_HALF - EDGE_MARGIN - self.plate.radius

    def means(self) -> Mapping[str, Mean]:
        return {
            "a jaw alone lowered the plate in the slot": when(
                lambda world: self.on_edge(world) and self.in_slot(world),
                lambda world: any(self.bears(world, arm) for arm in world.arms if not arm.suction),
            ),
            "the plate stayed away from the table's edge": throughout(lambda world: not self.lies_at_edge(world)),
            "the plate did not fall": throughout(lambda world: world.velocity("plate")[5] >= -MAX_FALL_SPEED),
        }

    def bears(self, world: World, arm: Arm) -> bool:
        """Whether an arm grips the plate above the table, and the other arm does not touch it."""
        others = any(world.touching(other.label, "plate") for other in world.arms if other is not arm)
        return arm.grips("plate") and not others and not world.touching("plate", "table")

    # --- attempts with one jaw --------------------------------------------------------------

    def grip_flat(self, arm: Arm, tilt: float, overlap: float = OVERLAP) -> Plan:
        """Take the rim of the lying plate with one arm, as deep as the table lets the lower finger go.

        Args:
            tilt: of the hand, below the level [rad].
            overlap: distance beyond the grip site that the rim should reach [m].
        """
        hand = self.hand(tilt)
        yield from alone(arm, go_to(arm, self.rim(arm.world) - STAND_OFF * hand[:, 2], hand, STEADY, OPEN))
        with suppress(GaveUp):
            yield from alone(arm, go_to(arm, self.rim(arm.world) + overlap * hand[:, 2], hand, PROBE_PACE, OPEN))
        yield from self.lift_and_deliver(arm)

    def lift_and_deliver(self, arm: Arm) -> Plan:
        """Close the jaw and lift; if the jaw then touches the plate, put it in."""
        yield from alone(arm, jaw.grasp(arm, CLOSING))
        yield from alone(arm, retreat(arm, 0.05, LIFT_PACE))
        if arm.world.touching(arm.label, "plate"):
            yield from self.deliver(arm)

    def slide_to_the_edge(self, pusher: Arm, taker: Arm, tilt: float = 0.0) -> Plan:
        """Push the plate beyond the side of the table, where a palm has space, and take it there.

        Args:
            tilt: of the hand that takes it, below the level [rad].
        """
        world, radius, hand = taker.world, self.plate.radius, self.hand(tilt)
        behind = self.start - (radius + 0.03) * self.outside + (0.75 * self.plate.rise + TIP_BELOW) * UP
        there = TABLE_HALF + 0.03 - radius

        def arrived() -> bool:
            return float(world.pos("plate") @ self.outside) > there

        yield from alone(pusher, go_to(pusher, behind + 0.1 * UP, facing_down(), STEADY, CLOSED))
        yield from alone(pusher, go_to(pusher, behind, facing_down(), STEADY))
        yield from alone(pusher, push(pusher, 0.06 * self.outside, arrived, give_up=8.0))
        yield from alone(pusher, self.park(pusher))
        away = self.rim(world) - 2 * STAND_OFF * hand[:, 2]
        yield from alone(taker, go_to(taker, away + 0.15 * UP, hand, STEADY, OPEN))
        yield from take_rim(taker, lambda: self.rim(world), hand)
        yield from self.deliver(taker)

    # --- from the hand into the slot --------------------------------------------------------

    def park(self, arm: Arm) -> Plan:
        """Take the hand up, and out of the way."""
        yield from retreat(arm, 0.10)
        yield from go_to(arm, PARKED_HAND * [1.0, 1.0 if arm.number else -1.0, 1.0], pace=COARSE)

    def deliver(self, arm: Arm) -> Plan:
        """Lift the plate, which is held by its rim, turn it on edge, put it in."""
        yield from alone(arm, go_to(arm, arm.hand + LIFT_HEIGHT * UP, pace=LIFT_PACE))
        yield from alone(arm, self.put_on_edge(arm))
        yield from alone(arm, self.put_in(arm))

    def put_on_edge(self, arm: Arm) -> Plan:
        """Tip the hand down, so that the plate hangs under it, then turn it: rolled first, the plate would swing."""
        yield from turn_to(arm, facing_down(), 0.8)
        height = self.foot[2] + self.shelf.top + 2 * self.plate.radius + CARRY_HEIGHT
        yield from go_to(arm, [*arm.hand[:2], height], pace=STEADY)
        yield from turn_to(arm, self.edgewise(arm), 1.2)

    def edgewise(self, arm: Arm) -> Mat3:
        """Orientation of the hand, pointing down, that holds the plate along the slot: the nearer of two."""
        return motion.closing_along(arm, arm.world.rot("shelf")[:, 0])

    def put_in(self, arm: Arm) -> Plan:
        """Bring the plate over the slot and along it, lower it until the rim is on the floor, let go."""
        for pace in (STEADY, Pace(0.10, 0.008)):  # twice: the plate swings in the pinch
            yield from self.bring(arm, pace)
        yield from self.lower(arm, self.seat(arm.world))
        yield from jaw.let_go(arm)

    def lower(self, arm: Arm, seat: Vec3) -> Plan:
        """Lower the held plate until its rim is on the floor, square with the slot.

        Args:
            seat: position on the table under the plate's middle at the end [m].

        Raises:
            GaveUp: that took too long.
        """
        world, aim = arm.world, seat + (self.middle(arm.world) - self.foot)[2] * UP
        end = world.time + LOWER_TIMEOUT
        while self.lowest(world) - self.foot[2] - self.shelf.base > FLOOR_TOLERANCE / 2:
            if world.time > end:
                raise GaveUp(f"the plate was not down after {LOWER_TIMEOUT:g} s")
            aim = aim - LOWER_SPEED * Loop.PERIOD * UP
            turn = between(np.eye(3), self.squared(world))
            yield motion.steer(arm, arm.hand + (aim - self.middle(world)), -LOWER_SPEED * UP, turn, CLOSED)

    def bring(self, arm: Arm, pace: Pace) -> Plan:
        """Take the held plate over its seat, its axis across the slot."""
        world, turn = arm.world, self.squared(arm.world)
        target = self.seat(world) + (self.shelf.top + self.plate.radius + CARRY_HEIGHT) * UP
        com = target + turn @ (world.com("plate") - self.middle(world))
        yield from jaw.carry(arm, "plate", com, turn @ world.rot("plate"), pace)

    def squared(self, world: World) -> Mat3:
        """Rotation that brings the plate's axis across the slot."""
        return shortest(world.rot("plate")[:, 2], self.across(world))

    def across(self, world: World) -> Vec3:
        """Unit vector across the slot, to the side that the plate's upper face looks to."""
        across = world.rot("shelf")[:, 0]
        return math.copysign(1.0, float(world.rot("plate")[:, 2] @ across)) * across

    def seat(self, world: World) -> Vec3:
        """Position under the plate's middle in the slot [m]: with its foot at a divider, fingers fit on its lip."""
        return self.foot - (self.slack / 2 - FOOT_CLEARANCE) * self.across(world)

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        return {
            "shelf_is_turned": choice(side_of(self.shelf_yaw), "shelf_yaw"),
            "size": choice(round(self.plate.radius, 3), "plate"),
            "side_that_is_taken": choice(self.side, "plate_x", "plate_y", "shelf_x", "shelf_y", "shelf_yaw"),
            "seat": near(self.foot, max(0.002, self.slack), "shelf_x", "shelf_y"),
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def side(self) -> float:
        """Side on which the plate is taken: 1 by the left arm, -1 by the right one."""
        return 1.0

    @cached_property
    def outside(self) -> Vec3:
        """Level unit vector to the side on which the plate is taken."""
        return self.side * LEFT

    @cached_property
    def flat_tilt(self) -> float:
        """Least tilt of a hand whose finger tips hold the rim of the lying plate [rad]."""
        return steepness(self.plate.rise + self.plate.thickness / 2, PALM_ABOVE + TIP_BELOW)

    def hand(self, tilt: float) -> Mat3:
        """Orientation of a hand on the side that is taken, `tilt` below the level [rad], which closes up and down."""
        return sideways(self.side, tilt)

    def outwards(self, world: World) -> Vec3:
        """Unit vector in the plane of the plate, towards the side that is taken."""
        normal = world.rot("plate")[:, 2]
        along = self.outside - (self.outside @ normal) * normal
        return along / math.sqrt(along @ along)

    def rim(self, world: World) -> Vec3:
        """Outermost point of the rim on the side that is taken, at half the rim's thickness [m]."""
        height = self.plate.rise + self.plate.thickness / 2
        return world.pos("plate") + height * world.rot("plate")[:, 2] + self.plate.radius * self.outwards(world)

    @cached_property
    def slack(self) -> float:
        """Width of the slot beyond the plate's height [m]."""
        return self.gap - self.plate.height

    @cached_property
    def start(self) -> Vec3:
        """Initial position of the plate [m]."""
        return np.array([self.plate_x, self.plate_y, TABLE_TOP])

    @cached_property
    def foot(self) -> Vec3:
        """Position of the shelf on the table [m]."""
        return np.array([self.shelf_x, self.shelf_y, TABLE_TOP])

    @cached_property
    def _shelf_outline(self) -> Outline:
        return corners(self.foot, math.radians(self.shelf_yaw), (self.shelf.width, self.shelf.long))
