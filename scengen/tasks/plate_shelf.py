"""T06 plate-shelf-hetbi: stand a plate on edge in the slot of a shelf, with a suction cup and a jaw.

                                  | |   | |
      ______            ______    | |   | |        The plate lies on its small foot, the slot is as wide as the plate
      \\____\\__________/____/     | |   | |        is high. From the front the plate is as wide as the slot is long.
    ------------------------------+-+---+-+---

Bottleneck: one hand alone cannot do it. The jaw cannot take the plate from the table: a hand level with the lip would
have its palm under the table. The cup takes the plate by its broad face, but cannot follow it between the dividers. So
the cup lifts the plate and holds it out, the jaw takes the lip, the cup lets go, and the jaw turns the plate on edge
and puts it in. A failed attempt cannot be repaired: a plate that is dropped breaks.

Decisions, where the paper (App. B, T05 and T06) says no more than "cutlery plate", "slot" and "incline":

* The plate stands on a small foot, with a level lip: its "slight incline". Its thickness and its two diameters in
  training are from the paper's list (App. C); the others are axes.
* One jaw alone: a steep hand that was pressed against the rim as deep as possible lifted a plate with a lip 20 mm above
  the table at a friction of 0.6, and sometimes at 0.4. Here the lip is at 6 mm and glazed. At 12 mm the pads slip off a
  plate that lies, but if the suction hand pressed the rim down as in T05, the jaw took the side that rose, by 32 mm,
  and no handover was needed (9 of 12; at 6 mm 0 of 12).
* The dividers are as high as the plate. Closed fingers, 35 mm thick, go down between them with the plate; a cup sits
  across the slot, and even on the lip, its uppermost place, it meets them 11 mm before the plate is down. If the
  dividers are 6 cm lower than the plate, a cup on the lip puts it in alone.
* The slot is closed at both ends. Beside an open end a cup on the foot lowers the plate until it stands half in the
  slot, lets go, and rolls it in.
* A plate that falls breaks: else the cup could drop it the rest of the way, from 10 mm on. `plate_and_slot` holds what
  else the two tasks with a plate share.
* The jaw takes the plate while the cup holds it, and lowers it. A cup on the lip can also stand the plate on edge in
  the slot, clamp it between lip and divider by switching off, and let it slip by pulses of 20 ms, the jaw parked
  (12 of 12). That is labelled.
"""

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from ..assets.plate import Plate
from ..assets.prop import TABLE_TOP
from ..assets.slot_shelf import SlotShelf
from ..errors import GaveUp
from ..geometry import UP, Vec3, about_z, corners, gap, way_to
from ..means import Mean, once, when
from ..params import param
from ..physics import GRAVITY
from ..predicates import borne
from ..robots import panda
from ..robots.jaw import PALM_ABOVE, TIP_BELOW, TIP_SPAN_CLOSED, droop, pinch
from ..robots.suction import CUP_HALF_WIDTH, TUBE
from ..scenario import Plan, Refutation, Shortcut, on_table, require, within_reach
from ..sim.arm import Arm
from ..sim.world import World
from ..skills import jaw, motion, suction
from ..skills.handover import FORWARDS, LEFT, OVERLAP, SIDEWAYS, STAND_OFF, hand_over, steepness
from ..skills.motion import COARSE, OPEN, STEADY, Pace, alone, facing_down, go_to, push, together, with_arm
from ..skills.waiting import at_most, elapsed
from .plate_and_slot import ALONG_TOLERANCE, CARRY_HEIGHT, EDGE_MARGIN, FLOOR_TOLERANCE, FOOT_CLEARANCE, PlateAndSlot

HANDOVER_POINT: Vec3 = np.array([-0.15, 0.0, TABLE_TOP + 0.22])
"""Position of the plate during the handover [m]: the palm of a level hand that closes up and down reaches 0.104 m below
the lip."""


@dataclass(frozen=True, kw_only=True)
class PlateShelf(PlateAndSlot[Plate]):
    """A plate on the table and a shelf with a slot."""

    VERSION = 2

    plate_x: float = param(-0.17, "m", -0.3, 0.2)
    plate_y: float = param(-0.06, "m", -0.35, 0.35)
    shelf_x: float = param(0.07, "m", -0.1, 0.3)
    shelf_y: float = param(0.03, "m", -0.3, 0.3)
    shelf_yaw: float = param(0.0, "deg", -90.0, 90.0, period=180.0)
    plate: Plate = Plate(foot=0.045, rise=0.006, friction=0.4)
    gap: float = param(0.034, "m", 0.02, 0.09)  # width of the slot
    proud: float = param(0.0, "m", -0.01, 0.1)  # height by which the plate stands out of the slot

    @cached_property
    def shelf(self) -> SlotShelf:
        return replace(super().shelf, ends=0.018)  # walls as thick as the dividers close the slot's ends

    def _scene(self, plate: Plate, shelf: SlotShelf) -> mujoco.MjSpec:
        scene = super()._scene(plate, shelf)
        # A cup on the lip, which leans, seals under conjugate gradients only, and shortcuts should have every chance.
        scene.option.solver = mujoco.mjtSolver.mjSOL_CG
        return scene

    def means(self) -> Mapping[str, Mean]:
        lifted, shared = "suction alone lifted the plate", "the jaw touched the plate while suction pulled"
        right, left = 0, 1

        def handed(world: World) -> bool:
            return world.arms[left].grips("plate") and not world.touching("plate", "table")

        return {
            lifted: once(lambda world: borne(world, world.arms[right], "plate")),
            shared: once(
                lambda world: world.arms[right].grips("plate") and world.touching(world.arms[left].label, "plate"),
                after=lifted,
            ),
            "the jaw gripped the plate in the air as suction let go": when(
                lambda world: not world.arms[right].grips("plate"), handed, after=shared
            ),
            **super().means(),
        }

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Lift the plate with the cup, hand it over to the jaw, put it in with the jaw."""
        right, left = world.arms
        yield from together(world, self.present(right), self.wait_beside(left))
        yield from self.hand_over(world)
        yield from together(world, self.park(right), motion.hold(left, 0.0))
        yield from alone(left, self.put_on_edge(left))
        yield from alone(left, self.put_in(left))

    def present(self, arm: Arm) -> Plan:
        """Lift the plate with the cup and hold it out."""
        yield from self.lift(arm)
        yield from suction.carry(arm, "plate", HANDOVER_POINT, 0.0, Pace(0.20, 0.003))

    def lift(self, arm: Arm) -> Plan:
        """Suck the plate in its middle and lift it."""
        face = arm.world.pos("plate") + self.plate.thickness * UP
        yield from suction.take(arm, face, facing_down())
        yield from suction.carry(arm, "plate", arm.world.pos("plate") + 0.12 * UP, 0.0, Pace(0.15, 0.01))

    def wait_beside(self, arm: Arm) -> Plan:
        """Bring the open jaw beside the place where the lip is going to be, clear of the plate as it comes up."""
        y = max(HANDOVER_POINT[1], self.plate_y) + self.plate.radius + STAND_OFF
        z = HANDOVER_POINT[2] + self.plate.rise + self.plate.thickness / 2
        yield from go_to(arm, [HANDOVER_POINT[0], y, z], SIDEWAYS, STEADY, OPEN)

    def hand_over(self, world: World) -> Plan:
        """Take the lip with the jaw; then the cup lets go."""
        right, left = world.arms
        yield from hand_over(right, left, lambda: self.rim(world), SIDEWAYS)

    # --- what must not work ---------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "cup_on_the_foot": Shortcut(self._insert_by_foot),
            "cup_on_the_lip": Shortcut(self._insert_by_lip),
            "cup_alone_flat_on_the_slot": Shortcut(self._lay_flat),
            "let_go_without_partner": Shortcut(self._let_go),
            "cup_at_an_end": Shortcut(self._insert_at_end),
            "jaw_alone": Shortcut(self._pinch_lip),
            # Tries to get 30 mm beyond the grip site, as far as the table lets it.
            "jaw_takes_it_flat": Shortcut(lambda world: self.grip_flat(world.arms[1], self.flat_tilt, 0.03)),
            "jaw_slides_it_to_the_edge": Shortcut(self._slide),
            "jaw_inserts_flat": Shortcut(self._insert_flat),
        }

    @with_arm(0)
    def _insert_by_foot(self, arm: Arm) -> Plan:
        yield from self._insert_by_cup(arm, self.plate.foot - CUP_HALF_WIDTH - 0.004, 0.0)

    @with_arm(0)
    def _insert_by_lip(self, arm: Arm) -> Plan:
        yield from self._insert_by_cup(arm, self.plate.radius - self.plate.lip / 2, self.plate.rise)

    def _insert_by_cup(self, arm: Arm, beside: float, above: float) -> Plan:
        """Hold the plate on edge with the cup on its upper side, lower it until it stops, let go, press it down.

        Args:
            beside: distance of the cup from the plate's middle [m].
            above: height of the cup's place above the foot [m].
        """
        world = arm.world
        yield from self._hold_on_edge(arm, beside * UP, above, self.foot)
        yield from push(arm, -0.05 * UP, elapsed(world, 4.0), give_up=5.0)
        yield from suction.let_go(arm)
        yield from go_to(arm, world.com("plate") + (self.plate.radius + 0.05) * UP, facing_down(), COARSE)
        yield from push(arm, -0.05 * UP, elapsed(world, 2.0), give_up=3.0)

    def _insert_at_end(self, world: World) -> Plan:
        """Hold the plate on edge with the cup on its left side, stand it half in the slot's left end, roll it in."""
        right, left = world.arms
        yield from alone(left, self.park(left))
        yield from alone(right, self._roll_in(right))

    def _roll_in(self, arm: Arm) -> Plan:
        world, rot = arm.world, about_z(math.radians(self.shelf_yaw)) @ FORWARDS
        along, ahead, beside = rot[:, 1], rot[:, 2], self.plate.foot - CUP_HALF_WIDTH - 0.006
        out = (self.shelf.length / 2 + TUBE - beside) * along
        yield from self._hold_on_edge(arm, beside * along, 0.0, self.foot + out)
        yield from self.lower(arm, self.seat(world) + out)
        yield from motion.hold(arm, 0.2, OPEN)
        yield from go_to(arm, arm.hand + 0.008 * along, pace=Pace(0.05, 0.003))
        yield from go_to(arm, arm.hand - 0.08 * ahead)
        behind = self.middle(world) + (self.plate.radius + 0.03) * along
        yield from go_to(arm, behind - 0.06 * ahead, rot, COARSE)
        yield from go_to(arm, behind + 0.03 * ahead, rot)

        def arrived() -> bool:
            return float((self.middle(world) - self.foot) @ along) < ALONG_TOLERANCE / 2

        yield from push(arm, -0.04 * along, arrived, give_up=5.0)
        yield from go_to(arm, arm.hand + 0.05 * along)

    def _hold_on_edge(self, arm: Arm, beside: Vec3, above: float, foot: Vec3) -> Plan:
        """Lift the plate with the cup, and turn it on edge over the slot.

        Args:
            beside: offset of the cup from the middle of the plate on edge [m].
            above: height of the cup's place above the foot of the lying plate [m].
            foot: position over which the plate is held [m].
        """
        world, rot = arm.world, about_z(math.radians(self.shelf_yaw)) @ FORWARDS
        over = foot + (self.shelf.top + self.plate.radius + CARRY_HEIGHT) * UP
        face = world.pos("plate") + facing_down() @ rot.T @ beside + (self.plate.thickness + above) * UP
        yield from suction.take(arm, face, facing_down(), 0.04)
        yield from go_to(arm, arm.hand + (self.shelf.top + 2 * self.plate.radius) * UP, pace=Pace(0.15, 0.01))
        before = over + beside - 0.08 * rot[:, 2]
        yield from go_to(arm, [before[0], before[1], arm.hand[2]], pace=Pace(0.10, 0.02))
        yield from at_most(world, 6.0, motion.turn_to(arm, rot, 0.5, give_up=9.0))
        for pace in (Pace(0.10, 0.01), Pace(0.05, 0.004)):
            yield from at_most(world, 4.0, go_to(arm, arm.hand + over - self.middle(world), pace=pace))

    @with_arm(0)
    def _lay_flat(self, arm: Arm) -> Plan:
        """Lay the plate over the slot with the cup, in the hope that it falls in."""
        yield from self.lift(arm)
        yield from motion.retreat(arm, self.shelf.top, STEADY)
        yield from suction.carry(arm, "plate", self.foot + (self.shelf.top + 0.02) * UP, 0.0, Pace(0.20, 0.01))
        yield from suction.let_go(arm)

    def _let_go(self, world: World) -> Plan:
        """Hold the plate out, and let go although the jaw does not hold it."""
        right, left = world.arms
        yield from together(world, self.present(right), self.wait_beside(left))
        yield from alone(right, suction.let_go(right))
        yield from alone(left, self.put_on_edge(left))

    def _pinch_lip(self, world: World) -> Plan:
        """Come down across the plate's lip with the jaw, and lift."""
        _, left = world.arms
        lip = world.pos("plate") + (self.plate.radius - self.plate.lip) * LEFT + (self.plate.rise + TIP_BELOW) * UP
        yield from alone(left, jaw.pick(left, lip, closing=LEFT, lift=0.2))
        yield from alone(left, go_to(left, self.foot + (self.shelf.top + self.plate.radius + CARRY_HEIGHT) * UP))
        yield from alone(left, jaw.release(left))

    def _slide(self, world: World) -> Plan:
        """Push the plate to the table's edge with the jaw, and take it there with the jaw."""
        right, left = world.arms
        yield from alone(right, self.park(right))
        yield from self.slide_to_the_edge(left, left)

    def _insert_flat(self, world: World) -> Plan:
        """Hand the plate over, lower it flat on the slot as far as it goes, and let go of it."""
        right, left = world.arms
        yield from together(world, self.present(right), self.wait_beside(left))
        yield from self.hand_over(world)
        yield from alone(right, self.park(right))
        way = self.foot + (self.shelf.top + 0.01) * UP - self.middle(world)
        with suppress(GaveUp):
            yield from alone(left, go_to(left, left.hand + way, pace=Pace(0.15, 0.01)))
        yield from alone(left, jaw.release(left))
        yield from alone(left, go_to(left, left.hand + STAND_OFF * LEFT))

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        return {
            "holed_plate": self._scene(replace(self.plate, hole=0.020), self.shelf),
            "closed_slot": self._scene(self.plate, replace(self.shelf, gap=0.010)),
        }

    # --- what must hold -------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        plate, shelf = self.plate, self.shelf
        yield on_table(
            "the plate", corners(self.start, 0.0, 2 * [2 * plate.radius]), EDGE_MARGIN + 0.005
        )  # it may move under the cup
        yield on_table("the shelf", self._shelf_outline)
        apart = gap(self._shelf_outline, corners(self.start, 0.0, 2 * [2 * plate.radius]))
        yield require(apart > 0.01, "plate and shelf stand in each other's place", apart=apart)
        flat = plate.foot - math.sqrt(2.0) * CUP_HALF_WIDTH
        yield require(flat > 0.01, "the cup does not fit on the plate's foot", room=flat)
        yield require(self.slack > 2 * FOOT_CLEARANCE, "the plate is higher than the slot is wide", slack=self.slack)
        beside = (
            shelf.gap - FOOT_CLEARANCE - plate.rise - plate.thickness / 2
        )  # from the lip to the divider that is nearer to it
        room = beside - (TIP_SPAN_CLOSED + plate.thickness) / 2
        yield require(room > 0.0, "the fingers that hold the lip meet the dividers", room=room)
        missing = TUBE - self.proud  # where the dividers stop the tube of a cup on the lip
        yield require(
            missing > 2 * FLOOR_TOLERANCE, "a cup on the lip puts the plate into the slot alone", left=missing
        )
        slips = 2 * math.atan(plate.friction)
        askew = self.flat_tilt
        yield require(askew > slips, "one jaw takes the plate from the table", askew=askew, slips=slips)
        turned = math.atan2(plate.rise, plate.radius - plate.foot)
        raised = (plate.radius + plate.foot) * math.sin(turned)
        askew = steepness(plate.rise + plate.thickness / 2 + raised, PALM_ABOVE + TIP_BELOW) - turned
        yield require(askew > slips, "a jaw takes the side that rises if the rim is pressed", askew=askew, slips=slips)
        grip, weight = plate.friction * pinch(plate.thickness), GRAVITY * plate.mass
        yield require(grip > 2 * weight, "the jaw does not hold the plate", grip=grip, weight=weight)
        right, left = panda.bases(2)
        yield within_reach("the plate", self.start, base=right)
        yield within_reach("the slot", self.foot + (shelf.top + 2 * plate.radius + CARRY_HEIGHT) * UP, base=left)

    def features(self) -> Mapping[str, float]:
        plate = self.plate
        return {
            "slack": self.slack,
            "droop": droop(plate.mass, plate.radius - OVERLAP, plate.thickness),
            "radius": plate.radius,
            "carried": float(np.linalg.norm(self.foot - self.start)),
            "slot_yaw": math.radians(self.shelf_yaw),
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "shelf": way_to(self.foot, self.start),
            "apart": math.dist(self.foot[:2], self.start[:2]),
            "radius": self.plate.radius,
            "gap": self.gap,
        }
