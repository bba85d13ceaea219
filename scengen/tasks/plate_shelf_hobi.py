r"""T05 plate-shelf-hobi: stand a plate on edge in the slot of a shelf, with two jaws.

       jaw \
            \__                   press    From the robot: the right arm presses the rim to the table. The plate turns
                \___                |      about the edge of its foot, by the incline of its rim. The other side comes
                     \___           v      up, and makes room for the palm of the left hand. The shelf stands behind.
    ----------------------\________/----

Bottleneck: no jaw takes the plate from the table, because the palm of a hand level with the rim would be under it. A
second arm has to press the plate until the first one holds the raised rim, and has to leave before the plate is turned
on edge. A failed attempt cannot be repaired: a plate that falls breaks.

Decisions, where the paper (App. B, T05) says no more than "cutlery plate", "slot" and "slight incline":

* The plate has a wide foot and a rim that rises by 12 mm: pressed down there it leans by the incline, 20 deg, and the
  other side is 76 mm high. The raised rim has twice the incline, and so has the hand that takes it.
* The plate is glazed. A hand over the table that grips the rim of a flat plate is steeper than 60 deg. Two pads hold a
  rim that slopes by s and is askew to them if the difference is less than twice the angle of friction: at a friction of
  0.6 they do, at 0.3 they slip off. A single finger under the rim does not lift it either; it pushes the plate away.
* If something stops the plate, or a palm has space beside the table, one arm could lift the rim. So the plate stays
  6 cm from the table's edge, and touches the shelf only on edge, over the slot. Nor can it be laid down on the shelf,
  to be taken there by its rim.
* The paper lets one arm press, so that the plate tilts. A stop beyond its far side and a finger under its rim lift it
  as well (11 of 12), and so do two jaws that grip opposite sides and squeeze, though each alone slips off (5 of 12). So
  until the plate has turned by half its incline, hands touch only the side that goes down, and the plate stays on the
  table.
* The slot is longer than the plate is wide: two hands that squeeze the plate between them lift it, but do not get
  between the dividers with it. The dividers are lower than the plate, so that the fingers on its upper rim are free.
* The arm that is farther from the shelf presses. In training that is the right one.
"""

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from ..assets.dish import Dish
from ..assets.prop import TABLE_TOP
from ..control.loop import Loop
from ..errors import GaveUp
from ..geometry import UP, Mat3, Vec3, about_z, between, corners, gap, polar, shortest, way_to
from ..means import Mean, once, throughout, when
from ..params import param
from ..physics import GRAVITY
from ..predicates import borne
from ..robots import panda
from ..robots.jaw import FINGER_ACROSS, PALM_ABOVE, TIP_BELOW, droop, pinch
from ..scenario import Plan, Refutation, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT, Arm
from ..sim.world import World
from ..skills import jaw
from ..skills.handover import OVERLAP, STAND_OFF, steepness, take_rim
from ..skills.motion import CLOSED, OPEN, STEADY, Pace, alone, facing_down, go_to, steer, together, until
from .plate_and_slot import (
    ANGLE_TOLERANCE,
    EDGE_MARGIN,
    FOOT_CLEARANCE,
    LIFT_HEIGHT,
    LIFT_PACE,
    PROBE_PACE,
    PlateAndSlot,
)

PRESS_OFFSET = 0.008  # distance from the rim's edge at which the rim is pressed [m]
SHIFT_MARGIN = 0.015
"""Distance that a pressed plate may move to either side [m]: it moves by 4 mm, as it turns about its foot."""
PRESSED_SHARE = 0.5  # share of its incline by which a pressed plate has turned before any other side is touched
ROCKING = math.radians(2.0)  # tilt below which a plate lies: a hand that touches it makes it rock [rad]
OFF_TABLE = 0.004, 0.020  # height of the middle of the foot in which a plate that does not lean is being lifted [m]
PALM_CLEARANCE = 0.005  # gap between palm and table [m]


@dataclass(frozen=True, kw_only=True)
class PlateShelfHobi(PlateAndSlot[Dish]):
    """A plate on the table and a shelf with a slot."""

    VERSION = 2

    plate_x: float = param(-0.15, "m", -0.3, 0.2)
    plate_y: float = param(-0.03, "m", -0.35, 0.35)
    shelf_x: float = param(0.10, "m", -0.1, 0.3)
    shelf_y: float = param(0.05, "m", -0.3, 0.3)
    shelf_yaw: float = param(0.0, "deg", -90.0, 90.0, period=180.0)
    plate: Dish = Dish()
    gap: float = param(0.036, "m", 0.02, 0.09)  # width of the slot
    proud: float = param(0.04, "m", 0.0, 0.1)  # height by which the plate stands out of the slot

    def means(self) -> Mapping[str, Mean]:
        pressed, held = (
            "one hand had pressed the plate down when the other hand touched it",
            "a jaw gripped the rim before it fell back",
        )

        def leans(world: World) -> bool:
            return world.touching("plate", "table") and world.tilt("plate") > PRESSED_SHARE * self.plate.slope

        def gripped(world: World) -> bool:
            return any(arm.grips("plate") for arm in world.arms)

        return {
            pressed: when(lambda world: all(world.touching(arm.label, "plate") for arm in world.arms), leans),
            held: when(
                lambda world: gripped(world) or not leans(world), lambda w: gripped(w) and leans(w), after=pressed
            ),
            "then that jaw alone bore the plate": once(
                lambda world: any(borne(world, arm, "plate") for arm in world.arms), after=held
            ),
            "no hand raised the plate unpressed": throughout(lambda world: not self.raised_unpressed(world)),
            "the plate touched the shelf on edge only": throughout(
                lambda world: not world.touching("plate", "shelf") or self.over_slot(world)
            ),
            **super().means(),
        }

    def raised_unpressed(self, world: World) -> bool:
        """Whether a hand raises the plate before another hand has turned it by pressing the opposite side."""
        middle, normal, tilt = world.pos("plate"), world.rot("plate")[:, 2], world.tilt("plate")
        if tilt > PRESSED_SHARE * self.plate.slope:
            return False
        if not world.touching("plate", "table"):
            low, high = OFF_TABLE
            return world.touching(ROBOT, "plate") and bool(low < middle[2] - TABLE_TOP < high)
        down = normal * [1.0, 1.0, 0.0] / max(math.hypot(normal[0], normal[1]), 1e-9)
        touching = (arm for arm in world.arms if world.touching(arm.label, "plate"))
        return tilt > ROCKING and any((arm.hand - middle) @ down < self.plate.radius / 2 for arm in touching)

    def over_slot(self, world: World) -> bool:
        """Whether the plate is on edge within 30 deg, its middle over the slot or in it."""
        across = world.rot("shelf")[:, 0]
        beside = abs(float((self.middle(world) - self.foot) @ across))
        on_edge = abs(float(world.rot("plate")[:, 2] @ across)) > math.cos(math.radians(30.0))
        return on_edge and beside < self.gap / 2 + self.shelf.chamfer

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Press the rim with one arm, take its other side with the other arm, put the plate in."""
        presser, taker = self.roles(world)
        yield from self.take(world)
        yield from alone(presser, self.park(presser))
        yield from self.deliver(taker)

    def take(self, world: World) -> Plan:
        """Press the rim, and take the side that rises."""
        presser, taker = self.roles(world)
        yield from self.in_roles(world, self.press(presser), self.wait_beside(taker))
        yield from take_rim(taker, lambda: self.rim(world), self.gripping(world))

    def roles(self, world: World) -> tuple[Arm, Arm]:
        """The arm that presses and the one that takes the plate."""
        right, left = world.arms
        return (right, left) if self.side > 0 else (left, right)

    def in_roles(self, world: World, pressing: Plan, taking: Plan) -> Plan:
        """Run the plans of the two roles at once."""
        plans = (pressing, taking)
        yield from together(world, *(plans if self.side > 0 else plans[::-1]))

    def press(self, arm: Arm) -> Plan:
        """Press the rim to the table with closed fingers, until the plate has turned by 96 % of its incline."""
        world, spot = arm.world, self.start - (self.plate.radius - PRESS_OFFSET) * self.outside
        yield from go_to(arm, spot + (self.plate.height + TIP_BELOW + 0.03) * UP, facing_down(), STEADY, CLOSED)
        below = spot + (self.plate.thickness + TIP_BELOW - 0.008) * UP  # 8 mm deeper than the fingers get
        press = go_to(arm, below, facing_down(), Pace(0.04, 0.0), CLOSED)
        yield from until(press, lambda: self.tilt(world) > 0.96 * self.plate.slope)

    def wait_beside(self, arm: Arm) -> Plan:
        """Bring the open jaw beside the place where the rim is going to be."""
        plate, hand = self.plate, self.hand(self.raised_tilt)
        out = (plate.radius + plate.foot) * math.cos(plate.slope) + plate.rise * math.sin(plate.slope) - plate.foot
        rim = self.start + out * self.outside + (plate.raised + plate.thickness / 2) * UP
        yield from go_to(arm, rim - STAND_OFF * hand[:, 2], hand, STEADY, OPEN)

    def edgewise(self, arm: Arm) -> Mat3:
        """Orientation of the hand with the plate upright and its upper face towards the robot.

        As the rim slopes, the hand then looks away from the robot. The other way round the arm would have to reach over
        the plate, as far as it goes. If the plate is turned upright only on the way to the slot, which is quicker, a
        thin plate slips out of the pinch.
        """
        across, normal = -arm.world.rot("shelf")[:, 0], arm.world.rot("plate")[:, 2]
        turn = about_z(math.remainder(polar(across)[0] - polar(normal)[0], 2 * math.pi))
        return shortest(turn @ normal, across) @ turn @ arm.hand_rot

    def gripping(self, world: World) -> Mat3:
        """Orientation of the hand along the rim as it is now, or steeper if the palm would meet the table."""
        return self.hand(max(self.plate.slope + self.tilt(world), self.raised_tilt))

    def tilt(self, world: World) -> float:
        """Angle by which the side of the plate that is taken has risen [rad]."""
        return math.asin(float(self.outwards(world) @ UP))

    # --- what must not work ---------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "grip_it_flat": Shortcut(lambda world: self.grip_flat(self.roles(world)[1], self.flat_tilt)),
            "grip_it_from_above": Shortcut(lambda world: self.grip_flat(self.roles(world)[1], math.pi / 2)),
            "pry_it_up": Shortcut(self._pry_up),
            "slide_it_to_the_edge": Shortcut(self._slide),
            "let_it_fall_back": Shortcut(self._let_fall_back),
            "squeeze_it_between_the_hands": Shortcut(self._squeeze),
            "insert_it_flat": Shortcut(self._insert_flat),
        }

    def _pry_up(self, world: World) -> Plan:
        """Put a finger under the rim, lift and level the hand, close."""
        _, taker = self.roles(world)
        hand = self.hand(self.flat_tilt)
        yield from alone(taker, go_to(taker, self.rim(world) - STAND_OFF * hand[:, 2], hand, STEADY, OPEN))
        for share in np.linspace(0.0, 1.0, 6):
            tilt = (1.0 - share) * self.flat_tilt + share * self.raised_tilt
            target = self.rim(world) + share * (self.plate.raised - self.plate.rise) * UP
            with suppress(GaveUp):
                yield from alone(taker, go_to(taker, target, self.hand(tilt), PROBE_PACE, OPEN))
        yield from self.lift_and_deliver(taker)

    def _slide(self, world: World) -> Plan:
        """Push the plate to the table's edge with one arm, and take it there with the other."""
        yield from self.slide_to_the_edge(*self.roles(world), self.plate.slope)

    def _let_fall_back(self, world: World) -> Plan:
        """Press the rim, let go, and only then take the plate."""
        presser, taker = self.roles(world)
        yield from self.in_roles(world, self.press(presser), self.wait_beside(taker))
        yield from alone(presser, self.park(presser))
        yield from self.grip_flat(taker, self.flat_tilt)

    def _squeeze(self, world: World) -> Plan:
        """Lift the plate between the fingers of both hands, lower it on the slot, let go."""
        presser, taker = self.roles(world)
        out, across = self.outside, facing_down(math.pi / 2)
        low, high = self.start + (self.plate.rise / 2 + TIP_BELOW) * UP, self.foot[2] + self.shelf.top + TIP_BELOW
        beside = (self.plate.radius + FINGER_ACROSS) * out
        way_to_slot = self.foot - self.start - self.foot[2] * UP + self.start[2] * UP

        def go(arm: Arm, spot: Vec3) -> Plan:
            yield from go_to(arm, spot, across, Pace(0.1, 0.005), CLOSED)

        for above, apart in ((0.1, 0.04), (0.0, 0.04), (0.0, 0.005)):
            middle = low + above * UP
            places = middle - beside - apart * out, middle + beside + apart * out
            yield from self.in_roles(world, go(presser, places[0]), go(taker, places[1]))
        for way in (0.0 * UP, (high - low[2] + 0.05) * UP, way_to_slot, -0.045 * UP):
            moves = _move_squeezing(presser, out, way), _move_squeezing(taker, -out, way)
            yield from self.in_roles(world, *moves)
        yield from self.in_roles(world, go(presser, presser.hand - 0.04 * out), go(taker, taker.hand + 0.04 * out))

    def _insert_flat(self, world: World) -> Plan:
        """Take the plate as the oracle does, and lower it on the slot without turning it on edge."""
        presser, taker = self.roles(world)
        yield from self.take(world)
        yield from alone(presser, self.park(presser))
        yield from alone(taker, go_to(taker, taker.hand + LIFT_HEIGHT * UP, self.hand(self.plate.slope), LIFT_PACE))
        for above in (0.05, 0.01):
            way = self.foot + (self.shelf.top + above) * UP - self.middle(world)
            yield from alone(taker, go_to(taker, taker.hand + way, pace=LIFT_PACE))
        yield from alone(taker, jaw.release(taker))
        yield from alone(taker, go_to(taker, taker.hand + STAND_OFF * self.outside))

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        return {
            "flat_plate": self._scene(replace(self.plate, incline=0.0), self.shelf),
            "closed_slot": self._scene(self.plate, replace(self.shelf, gap=0.010)),
        }

    # --- what must hold -------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        plate, shelf, around = self.plate, self.shelf, corners(self.start, 0.0, 2 * [2 * self.plate.radius])
        yield on_table("the plate", around, EDGE_MARGIN + SHIFT_MARGIN)
        yield on_table("the shelf", self._shelf_outline)
        apart = gap(self._shelf_outline, around)
        yield require(apart > SHIFT_MARGIN, "plate and shelf stand in each other's place", apart=apart)
        yield require(self.slack > 2 * FOOT_CLEARANCE, "the plate is higher than the slot is wide", slack=self.slack)
        lean = math.atan2(self.slack, shelf.height)
        yield require(lean < 0.8 * ANGLE_TOLERANCE, "the plate leans in the slot", lean=lean)
        room = self.proud - OVERLAP - TIP_BELOW
        yield require(room > 0.0, "the fingers that hold the rim meet the dividers", room=room)
        askew, slips = self.flat_tilt - plate.slope, 2 * math.atan(plate.friction)
        yield require(askew > slips, "one jaw takes the plate from the table", askew=askew, slips=slips)
        askew = self.raised_tilt - 2 * plate.slope
        # For its clearance from the table the hand may be steeper than the rim, by less than friction allows.
        yield require(
            askew < math.radians(12.0), "the palm of the hand that takes the raised rim meets the table", askew=askew
        )
        force = GRAVITY * plate.mass * plate.foot / (plate.rim - PRESS_OFFSET)
        # A hand that holds its place is pushed away by 10 mm at 10 N (`control.osc.KP`).
        yield require(force < 10.0, "no hand presses so hard", force=force)
        grip, weight = plate.friction * pinch(plate.thickness), GRAVITY * plate.mass
        yield require(grip > 1.5 * weight, "the jaw does not hold the plate", grip=grip, weight=weight)
        presser = panda.bases(2)[0 if self.side > 0 else 1]
        yield within_reach("the rim", self.start - plate.radius * self.outside, base=presser)

    def features(self) -> Mapping[str, float]:
        plate = self.plate
        return {
            "pressed_tilt": plate.slope,
            "raised": plate.raised,
            "askew": self.raised_tilt - 2 * plate.slope,
            "droop": droop(plate.mass, plate.radius - OVERLAP, plate.thickness),
            "slack": self.slack,
            "radius": plate.radius,
            "carried": float(np.linalg.norm(self.foot - self.start)),
            "slot_yaw": math.radians(self.shelf_yaw),
            "taker": self.side,
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "shelf": way_to(self.foot, self.start),
            "apart": math.dist(self.foot[:2], self.start[:2]),
            "radius": self.plate.radius,
            "gap": self.gap,
        }

    # --- geometry of the hand over the rim --------------------------------------------------

    @cached_property
    def side(self) -> float:
        """Side on which the plate is taken, the shelf's: 1 by the left arm, -1 by the right one."""
        return math.copysign(1.0, self.shelf_y)

    @cached_property
    def raised_tilt(self) -> float:
        """Tilt of the hand that takes the raised rim [rad]: along the rim, or steeper if the palm needs it."""
        height = self.plate.raised + self.plate.thickness / 2 - PALM_CLEARANCE
        return max(2 * self.plate.slope, steepness(height, PALM_ABOVE - OVERLAP))


def _move_squeezing(arm: Arm, inwards: Vec3, way: Vec3) -> Plan:
    """Move a hand along `way` [m] while it presses inwards against a plate that another hand presses from outside."""
    world, setpoint, rot = arm.world, arm.hand, arm.hand_rot
    seconds = max(1.0, float(np.linalg.norm(way)) / 0.08)
    end = world.time + seconds
    while world.time < end:
        setpoint = setpoint + Loop.PERIOD / seconds * way
        target = setpoint + 0.02 * inwards  # 20 mm nearer to the other hand than the plate allows
        yield steer(arm, target, way / seconds, between(arm.hand_rot, rot), CLOSED)
