"""What the two tasks with a plate and a shelf share (T05, T06): the scene, the goal, and how a held plate is put in.

* A plate that falls faster than 0.35 m/s, as from 6 mm, breaks, and the episode is lost. No hand lowers anything faster
  than 0.3 m/s. Speeds are looked at every 10 ms, in which a fall gains 0.1 m/s: from 10 mm on it is seen for certain.
  The shelf is polished, so that a plate that is let go in the slot does fall.
* A plate that comes within 6 cm of the table's edge while it lies is lost: beyond the edge there is room for a palm,
  and one jaw would take the rim there. It is glazed and its rim low, so that no jaw takes it where it lies: a hand over
  the table that reaches the rim is steep, and its pads slip off.
* In the slot means: on edge within 10 deg, along the slot, with its middle between the dividers and its rim on the
  slot's floor, and let go. Leaning against the shelf from outside is not.
"""

import math
from contextlib import suppress

import mujoco
import numpy as np

from ..assets.dish import Dish
from ..assets.plate import Plate
from ..assets.prop import TABLE_HALF, TABLE_TOP, place, table
from ..assets.slot_shelf import SlotShelf
from ..control.loop import Loop
from ..errors import GaveUp
from ..geometry import UP, Mat3, Outline, Vec3, between, corners, shortest
from ..predicates import fallen
from ..robots.jaw import PALM_ABOVE, TIP_BELOW
from ..scenario import Plan, Scenario
from ..sim.world import ROBOT, Arm, World
from ..skills import jaw
from ..skills.handover import CLOSING, LEFT, OVERLAP, STAND_OFF, sideways, steepness, take_rim
from ..skills.motion import (
    CLOSED,
    COARSE,
    OPEN,
    STEADY,
    Pace,
    alone,
    closing_along,
    facing_down,
    go_to,
    push,
    retreat,
    steer,
    turn_to,
)

LEAN = math.radians(10.0)
"""Largest angle between the plate's axis and the level, and between it and the slot's normal [rad]."""
DEEP = 0.005
"""Largest height of the rim's lowest point above the slot's floor [m]."""
BREAKS = 0.35
"""Speed of a fall that the plate does not survive [m/s]."""
EDGE, LOW = 0.06, 0.010
"""How far from the table's edge the rim must stay [m], where a palm that passes the edge finds room for a grip, as long
as it is not this much higher than that of a plate that lies on the table [m]."""
ENDS = 0.02
"""By how much the slot is longer than the plate at either end [m]: more than a finger tip."""
AIR = 0.002
"""Between the plate's foot and the divider as it goes down [m]."""
ALONG = 0.03
"""How far along the slot the plate may stand from its middle [m]: at an end a cup could pass the dividers outside."""
DOWNWARDS, PATIENCE = 0.05, 12.0
"""How fast the plate is lowered [m/s], and when that is given up [s]."""
OVER = 0.02
"""Between the plate and the dividers before it is lowered [m]."""
LIFT, SLOWLY = 0.25, Pace(0.10, 0.01)
"""How high the plate is lifted before it is turned on edge [m], and how: it turns in the pinch."""
ASIDE: Vec3 = np.array([-0.15, 0.35, TABLE_TOP + 0.35])
"""Where the left hand is out of the way [m]; the right one at its mirror image."""
PROBING = Pace(0.06, 0.003, 1.5)
"""How a single hand tries to get hold of the rim."""


class PlateAndSlot(Scenario):
    """A plate on the table and a shelf with a slot. Subclasses are dataclasses with these parameters."""

    HOLD = 0.5

    plate_x: float
    plate_y: float
    shelf_x: float
    shelf_y: float
    shelf_yaw: float
    plate: Plate | Dish
    gap: float
    proud: float

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.plate, self.shelf)

    @property
    def shelf(self) -> SlotShelf:
        """The shelf, made to measure."""
        high, long = 2 * self.plate.radius - self.proud, 2 * (self.plate.radius + ENDS)
        return SlotShelf(gap=self.gap, height=high, length=long, base=0.012, chamfer=0.012)

    def _scene(self, plate: Plate | Dish, shelf: SlotShelf) -> mujoco.MjSpec:
        scene = table()
        place(scene, plate, "plate", self.start)
        place(scene, shelf, "shelf", self.foot, math.radians(self.shelf_yaw), free=False)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return not world.touching(ROBOT, "plate") and self.on_edge(world) and self.within(world)

    def on_edge(self, world: World) -> bool:
        """Whether the plate stands on edge, along the slot."""
        normal, across = world.rot("plate")[:, 2], world.rot("shelf")[:, 0]
        return bool(abs(normal[2]) < math.sin(LEAN) and abs(normal @ across) > math.cos(LEAN))

    def within(self, world: World) -> bool:
        """Whether the plate's middle is between the dividers and its rim on the slot's floor."""
        place = world.rot("shelf").T @ (self.middle(world) - self.foot) - self.shelf.base * UP
        between = abs(place[0]) < self.gap / 2 and abs(place[1]) < ALONG and place[2] < self.shelf.height
        return bool(between and self.lowest(world) - self.foot[2] - self.shelf.base < DEEP)

    def middle(self, world: World) -> Vec3:
        """The plate's middle now, at half its height [m]."""
        return world.pos("plate") + self.plate.height / 2 * world.rot("plate")[:, 2]

    def lowest(self, world: World) -> float:
        """Height of the rim's lowest point now [m]."""
        normal = world.rot("plate")[:, 2]
        faces = (world.pos("plate")[2] + h * normal[2] for h in (self.plate.rise, self.plate.height))
        return float(min(faces) - self.plate.radius * math.sqrt(1.0 - min(1.0, normal[2] ** 2)))

    def failure(self, world: World) -> str | None:
        low = self.lowest(world) < TABLE_TOP + self.plate.rise + LOW
        if low and float(np.abs(self.middle(world)[:2]).max()) > TABLE_HALF - EDGE - self.plate.radius:
            return "the plate was pushed to the table's edge"
        if fallen(world, "plate"):
            return "the plate fell off the table"
        return "the plate was dropped" if world.velocity("plate")[5] < -BREAKS else None

    # --- what one jaw tries -----------------------------------------------------------------

    def grip_flat(self, arm: Arm, tilt: float, overlap: float = OVERLAP) -> Plan:
        """Take the rim of the plate as it lies, with one arm: as deep as the table lets the lower finger go.

        Args:
            tilt: of the hand, below the level [rad].
            overlap: how far beyond the grip site the rim is to come [m].
        """
        hand = self.hand(tilt)
        yield from alone(arm, go_to(arm, self.rim(arm.world) - STAND_OFF * hand[:, 2], hand, STEADY, OPEN))
        with suppress(GaveUp):
            yield from alone(arm, go_to(arm, self.rim(arm.world) + overlap * hand[:, 2], hand, PROBING, OPEN))
        yield from self.go_on_with(arm)

    def go_on_with(self, arm: Arm) -> Plan:
        """Close the jaw and lift; what it then holds, put in."""
        yield from alone(arm, jaw.grasp(arm, CLOSING))
        yield from alone(arm, retreat(arm, 0.05, SLOWLY))
        if arm.world.touching(arm.label, "plate"):
            yield from self.deliver(arm)

    def slide_to_the_edge(self, pusher: Arm, taker: Arm, tilt: float = 0.0) -> Plan:
        """Push the plate beyond the side of the table, where there is room for a palm, and take it there.

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
        yield from alone(pusher, self.leave(pusher))
        away = self.rim(world) - 2 * STAND_OFF * hand[:, 2]
        yield from alone(taker, go_to(taker, away + 0.15 * UP, hand, STEADY, OPEN))
        yield from take_rim(taker, lambda: self.rim(world), hand)
        yield from self.deliver(taker)

    # --- from the hand into the slot --------------------------------------------------------

    def leave(self, arm: Arm) -> Plan:
        """Up, and out of the way."""
        yield from retreat(arm, 0.10)
        yield from go_to(arm, ASIDE * [1.0, 1.0 if arm.number else -1.0, 1.0], pace=COARSE)

    def deliver(self, arm: Arm) -> Plan:
        """Lift the plate that is held by its rim, turn it on edge, put it in."""
        yield from alone(arm, go_to(arm, arm.hand + LIFT * UP, pace=SLOWLY))
        yield from alone(arm, self.put_on_edge(arm))
        yield from alone(arm, self.put_in(arm))

    def put_on_edge(self, arm: Arm) -> Plan:
        """Tip the hand down, so that the plate hangs under it, and then turn it: rolled first, it would swing."""
        yield from turn_to(arm, facing_down(), 0.8)
        yield from go_to(
            arm, [*arm.hand[:2], self.foot[2] + self.shelf.top + 2 * self.plate.radius + OVER], pace=STEADY
        )
        yield from turn_to(arm, self.edgewise(arm), 1.2)

    def edgewise(self, arm: Arm) -> Mat3:
        """The hand, which points down, with the plate in it across the slot: of two ways the nearer one."""
        return closing_along(arm, arm.world.rot("shelf")[:, 0])

    def put_in(self, arm: Arm) -> Plan:
        """Over the slot, along it, down until the rim is on the floor; let go."""
        for pace in (STEADY, Pace(0.10, 0.008)):  # once more: what hangs in the pinch has swung
            yield from self.bring(arm, pace)
        yield from self.lower(arm, self.seat(arm.world))
        yield from jaw.release(arm)
        yield from retreat(arm)

    def lower(self, arm: Arm, seat: Vec3) -> Plan:
        """Lower the held plate until its rim is on the floor, square with the slot.

        Args:
            seat: under its middle there [m].

        Raises:
            GaveUp: that took too long.
        """
        world, aim = arm.world, seat + (self.middle(arm.world) - self.foot)[2] * UP
        end = world.time + PATIENCE
        while self.lowest(world) - self.foot[2] - self.shelf.base > DEEP / 2:
            if world.time > end:
                raise GaveUp(f"the plate was not down after {PATIENCE:g} s")
            aim = aim - DOWNWARDS * Loop.PERIOD * UP
            turn = between(np.eye(3), self.squared(world))
            yield steer(arm, arm.hand + (aim - self.middle(world)), -DOWNWARDS * UP, turn, CLOSED)

    def bring(self, arm: Arm, pace: Pace) -> Plan:
        """Take the held plate over its seat, its axis across the slot."""
        world, turn = arm.world, self.squared(arm.world)
        target = self.seat(world) + (self.shelf.top + self.plate.radius + OVER) * UP
        com = target + turn @ (world.com("plate") - self.middle(world))
        yield from jaw.carry(arm, "plate", com, turn @ world.rot("plate"), pace)

    def squared(self, world: World) -> Mat3:
        """The turn that brings the plate's axis across the slot."""
        return shortest(world.rot("plate")[:, 2], self.across(world))

    def across(self, world: World) -> Vec3:
        """Across the slot, to the side that the plate's upper face is nearer to."""
        across = world.rot("shelf")[:, 0]
        return math.copysign(1.0, float(world.rot("plate")[:, 2] @ across)) * across

    def seat(self, world: World) -> Vec3:
        """Under the plate's middle in the slot [m]: with its foot at a divider there is room for fingers on its lip."""
        return self.foot - (self.slack / 2 - AIR) * self.across(world)

    # --- geometry -------------------------------------------------------------------------

    @property
    def side(self) -> float:
        """On which side the plate is taken: 1 by the left arm, -1 by the right one."""
        return 1.0

    @property
    def outside(self) -> Vec3:
        """Level unit vector to the side that is taken."""
        return self.side * LEFT

    @property
    def flat_tilt(self) -> float:
        """Least tilt of a hand whose finger tips hold the rim of the plate as it lies [rad]."""
        return steepness(self.plate.rise + self.plate.thickness / 2, PALM_ABOVE + TIP_BELOW)

    def hand(self, tilt: float) -> Mat3:
        """A hand on that side, `tilt` below the level [rad], that closes up and down."""
        return sideways(self.side, tilt)

    def outwards(self, world: World) -> Vec3:
        """Unit vector in the plane of the plate, towards the side of it that is taken."""
        normal = world.rot("plate")[:, 2]
        along = self.outside - (self.outside @ normal) * normal
        return along / math.sqrt(along @ along)

    def rim(self, world: World) -> Vec3:
        """The outermost point on the side that is taken, at half the rim's thickness [m]."""
        middle = self.plate.rise + self.plate.thickness / 2
        return world.pos("plate") + middle * world.rot("plate")[:, 2] + self.plate.radius * self.outwards(world)

    @property
    def slack(self) -> float:
        """By how much the slot is wider than the plate is high [m]."""
        return self.gap - self.plate.height

    @property
    def start(self) -> Vec3:
        """Where the plate stands [m]."""
        return np.array([self.plate_x, self.plate_y, TABLE_TOP])

    @property
    def foot(self) -> Vec3:
        """Where the shelf stands [m]."""
        return np.array([self.shelf_x, self.shelf_y, TABLE_TOP])

    @property
    def _outline(self) -> Outline:
        return corners(self.foot, math.radians(self.shelf_yaw), (self.shelf.width, self.shelf.long))
