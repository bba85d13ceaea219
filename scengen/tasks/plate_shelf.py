"""T06 plate-shelf-hetbi: stand a plate on edge in the slot of a shelf, with a suction cup and a jaw.

                                  | |   | |
      ______            ______    | |   | |        The plate lies on its small foot, the slot is as wide as the plate
      \\____\\__________/____/     | |   | |        is high. From the front the plate is as wide as the slot is long.
    ------------------------------+-+---+-+---

Bottleneck: neither hand can do it alone. The jaw cannot take the plate from the table: a hand level with the lip would
have its palm under the table. The cup takes it by its broad face, but cannot follow it between the dividers. So the cup
lifts the plate and holds it out, the jaw takes the lip, the cup lets go, and the jaw turns the plate on edge and puts
it in. What is done wrong costs the episode: a plate that is dropped breaks.

Decisions, where the paper (App. B, T05 and T06) says no more than "cutlery plate", "slot" and "incline":

* The plate stands on a small foot, with a level lip: its "slight incline". Its thickness and its two diameters in
  training are of the paper's list (App. C); the others are axes.
* One jaw alone: a steep hand that is pressed against the rim as deep as it gets lifted a plate with a lip 20 mm above
  the table at a friction of 0.6, and sometimes of 0.4. The lip is at 12 mm and glazed: there the pads slip off at 0.5.
* The dividers are as high as the plate: closed fingers go down between them with it, by their thickness of 35 mm, but a
  cup sits across the slot. Even on the lip, its uppermost part, it meets them 11 mm before the plate is down. Between
  dividers that are 6 cm lower than the plate a cup on the lip puts it in alone.
* The slot is closed at both ends. Beside an open end a cup on the foot lowers the plate until it stands half in the
  slot, lets go, and rolls it in.
* A plate that falls breaks: else the cup could let it drop the rest of the way, from 10 mm on. What else the two tasks
  with a plate share stands in `plate_and_slot`.
"""

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from ..assets.dish import Dish
from ..assets.plate import Plate
from ..assets.prop import TABLE_TOP
from ..assets.slot_shelf import SlotShelf
from ..errors import GaveUp
from ..geometry import UP, Vec3, about_z, corners, gap
from ..params import param
from ..physics import GRAVITY
from ..robots import panda
from ..robots.jaw import PAD, TIP_BELOW, TIP_SPAN_CLOSED, pinch
from ..robots.suction import CUP_HALF_WIDTH, TUBE
from ..scenario import Plan, Refutation, Shortcut, on_table, require, within_reach
from ..sim.world import Arm, World
from ..skills import jaw, suction
from ..skills.handover import FORWARDS, LEFT, OVERLAP, SIDEWAYS, STAND_OFF, hand_over
from ..skills.motion import (
    COARSE,
    OPEN,
    STEADY,
    Condition,
    Pace,
    alone,
    facing_down,
    go_to,
    hold,
    push,
    retreat,
    together,
    turn_to,
    until,
)
from .plate_and_slot import AIR, ALONG, DEEP, EDGE, OVER, PlateAndSlot

MEETING: Vec3 = np.array([-0.15, 0.0, TABLE_TOP + 0.22])
"""Where the plate changes hands [m]. The palm of a level hand that closes up and down reaches 0.104 m below the lip."""
CLOSED_BY = 0.018
"""Thickness of the walls at the slot's ends, as of its dividers [m]."""
FORCED = 0.03
"""How far beyond the grip site a jaw tries to get that takes the rim alone, as far as the table lets it [m]."""
SPARE = 0.005
"""How far a plate that the cup is pressed on may move, where it lies nearest to the table's edge [m]."""


@dataclass(frozen=True, kw_only=True)
class PlateShelf(PlateAndSlot):
    """A plate on the table and a shelf with a slot."""

    plate_x: float = param(-0.17, "m", -0.3, 0.2)
    plate_y: float = param(-0.06, "m", -0.35, 0.35)
    shelf_x: float = param(0.07, "m", -0.1, 0.3)
    shelf_y: float = param(0.03, "m", -0.3, 0.3)
    shelf_yaw: float = param(0.0, "deg", -90.0, 90.0, period=180.0)
    plate: Plate = Plate(foot=0.045, rise=0.012, friction=0.4)
    gap: float = param(0.038, "m", 0.02, 0.09)
    """Width of the slot."""
    proud: float = param(0.0, "m", -0.01, 0.1)
    """How far the plate stands out of the slot."""

    @property
    def shelf(self) -> SlotShelf:
        return replace(super().shelf, ends=CLOSED_BY)

    def _scene(self, plate: Plate | Dish, shelf: SlotShelf) -> mujoco.MjSpec:
        scene = super()._scene(plate, shelf)
        # A cup on the lip, which leans, closes under conjugate gradients alone, and shortcuts shall have every chance.
        scene.option.solver = mujoco.mjtSolver.mjSOL_CG
        return scene

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Lift the plate with the cup, hand it over to the jaw, put it in with the jaw."""
        giver, taker = world.arms
        yield from together(world, self.present(giver), self.wait_beside(taker))
        yield from self.hand_over(world)
        yield from together(world, self.leave(giver), hold(taker, 0.0))
        yield from alone(taker, self.put_on_edge(taker))
        yield from alone(taker, self.put_in(taker))

    def present(self, arm: Arm) -> Plan:
        """Lift the plate with the cup and hold it out."""
        yield from self.lift(arm)
        yield from suction.carry(arm, "plate", MEETING, 0.0, Pace(0.20, 0.003))

    def lift(self, arm: Arm) -> Plan:
        """Suck the plate in its middle and lift it."""
        face = arm.world.pos("plate") + self.plate.thickness * UP
        down = facing_down()
        yield from go_to(arm, face + 0.03 * UP, down, STEADY, OPEN)
        yield from suction.suck(arm, face, down)
        yield from suction.carry(arm, "plate", arm.world.pos("plate") + 0.12 * UP, 0.0, Pace(0.15, 0.01))

    def wait_beside(self, arm: Arm) -> Plan:
        """Bring the open jaw beside the place where the lip is going to be, and where it comes up."""
        away = max(MEETING[1], self.plate_y) + self.plate.radius + STAND_OFF
        high = MEETING[2] + self.plate.rise + self.plate.thickness / 2
        yield from go_to(arm, [MEETING[0], away, high], SIDEWAYS, STEADY, OPEN)

    def hand_over(self, world: World) -> Plan:
        """The jaw takes the lip, then the cup lets go."""
        yield from hand_over(*world.arms, lambda: self.rim(world), SIDEWAYS)

    # --- what must not work ---------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "cup_on_the_foot": Shortcut(
                lambda world: self._cup_alone(world, self.plate.foot - CUP_HALF_WIDTH - 0.004, 0.0)
            ),
            "cup_on_the_lip": Shortcut(
                lambda world: self._cup_alone(world, self.plate.radius - self.plate.lip / 2, self.plate.rise)
            ),
            "cup_alone_flat_on_the_slot": Shortcut(self._lay_flat),
            "let_go_without_partner": Shortcut(self._let_go),
            "cup_at_an_end": Shortcut(self._cup_at_an_end),
            "jaw_alone": Shortcut(self._jaw_alone),
            "jaw_takes_it_flat": Shortcut(lambda world: self.grip_flat(world.arms[1], self.flat_tilt, FORCED)),
            "jaw_slides_it_to_the_edge": Shortcut(self._slide),
            "jaw_inserts_flat": Shortcut(self._insert_flat),
        }

    def _cup_alone(self, world: World, beside: float, above: float) -> Plan:
        """Hold the plate on edge with the cup, on its upper side, lower it until it stops, let go, press it down.

        Args:
            beside: how far from the plate's middle the cup sits [m].
            above: how much higher than its foot [m].
        """
        arm = world.arms[0]

        def plan() -> Plan:
            yield from self._hold_on_edge(arm, beside * UP, above, self.foot)
            yield from push(arm, -0.05 * UP, _after(world, 4.0), give_up=5.0)
            yield from suction.let_go(arm)
            yield from go_to(arm, world.com("plate") + (self.plate.radius + 0.05) * UP, facing_down(), COARSE)
            yield from push(arm, -0.05 * UP, _after(world, 2.0), give_up=3.0)

        yield from alone(arm, plan())

    def _cup_at_an_end(self, world: World) -> Plan:
        """Hold the plate on edge with the cup, on its left side, stand it half in the slot's left end, roll it in."""
        arm, rot = world.arms[0], about_z(math.radians(self.shelf_yaw)) @ FORWARDS
        along, ahead, beside = rot[:, 1], rot[:, 2], self.plate.foot - CUP_HALF_WIDTH - 0.006
        out = (self.shelf.length / 2 + TUBE - beside) * along

        def home() -> bool:
            return float((self.middle(world) - self.foot) @ along) < ALONG / 2

        def plan() -> Plan:
            yield from self._hold_on_edge(arm, beside * along, 0.0, self.foot + out)
            yield from self.lower(arm, self.seat(world) + out)
            yield from hold(arm, 0.2, OPEN)
            yield from go_to(arm, arm.hand + 0.008 * along, pace=Pace(0.05, 0.003))
            yield from go_to(arm, arm.hand - 0.08 * ahead)
            clear = self.middle(world) + (self.plate.radius + 0.03) * along
            yield from go_to(arm, clear - 0.06 * ahead, rot, COARSE)
            yield from go_to(arm, clear + 0.03 * ahead, rot)
            yield from push(arm, -0.04 * along, home, give_up=5.0)
            yield from go_to(arm, arm.hand + 0.05 * along)

        yield from alone(world.arms[1], self.leave(world.arms[1]))
        yield from alone(arm, plan())

    def _hold_on_edge(self, arm: Arm, beside: Vec3, above: float, foot: Vec3) -> Plan:
        """Lift the plate with the cup, and turn it on edge over the slot.

        Args:
            beside: where the cup sits on the plate that is on edge, from its middle [m].
            above: how much higher than the foot of a plate that lies [m].
            foot: over which the plate is held [m].
        """
        world, rot = arm.world, about_z(math.radians(self.shelf_yaw)) @ FORWARDS
        over = foot + (self.shelf.top + self.plate.radius + OVER) * UP
        face = world.pos("plate") + facing_down() @ rot.T @ beside + (self.plate.thickness + above) * UP
        yield from go_to(arm, face + 0.03 * UP, facing_down(), STEADY, OPEN)
        yield from suction.suck(arm, face, facing_down(), 0.04)
        yield from go_to(arm, arm.hand + (self.shelf.top + 2 * self.plate.radius) * UP, pace=Pace(0.15, 0.01))
        before = over + beside - 0.08 * rot[:, 2]
        yield from go_to(arm, [before[0], before[1], arm.hand[2]], pace=Pace(0.10, 0.02))
        yield from until(turn_to(arm, rot, 0.5, give_up=9.0), _after(world, 6.0))
        for pace in (Pace(0.10, 0.01), Pace(0.05, 0.004)):
            yield from until(go_to(arm, arm.hand + over - self.middle(world), pace=pace), _after(world, 4.0))

    def _lay_flat(self, world: World) -> Plan:
        """Lay the plate over the slot with the cup, in the hope that it falls in."""
        arm = world.arms[0]

        def plan() -> Plan:
            yield from self.lift(arm)
            yield from retreat(arm, self.shelf.top, STEADY)
            above = self.foot + (self.shelf.top + 0.02) * UP
            yield from suction.carry(arm, "plate", above, 0.0, Pace(0.20, 0.01))
            yield from suction.let_go(arm)

        yield from alone(arm, plan())

    def _let_go(self, world: World) -> Plan:
        """Hold the plate out, and let go while nobody has it."""
        giver, taker = world.arms
        yield from together(world, self.present(giver), self.wait_beside(taker))
        yield from alone(giver, suction.let_go(giver))
        yield from alone(taker, self.put_on_edge(taker))

    def _jaw_alone(self, world: World) -> Plan:
        """Come down across the plate's lip with the jaw, and lift."""
        arm = world.arms[1]
        rim = world.pos("plate") + (self.plate.radius - self.plate.lip) * LEFT + (self.plate.rise + TIP_BELOW) * UP
        yield from alone(arm, jaw.pick(arm, rim, closing=LEFT, lift=0.2))
        yield from alone(arm, go_to(arm, self.foot + (self.shelf.top + self.plate.radius + OVER) * UP))
        yield from alone(arm, jaw.release(arm))

    def _slide(self, world: World) -> Plan:
        """Push the plate to the table's edge with the jaw, and take it there with the jaw."""
        right, left = world.arms
        yield from alone(right, self.leave(right))
        yield from self.slide_to_the_edge(left, left)

    def _insert_flat(self, world: World) -> Plan:
        """Hand the plate over, lower it on the slot without turning it on edge as far as it goes, and let go of it."""
        giver, taker = world.arms
        yield from together(world, self.present(giver), self.wait_beside(taker))
        yield from self.hand_over(world)
        yield from alone(giver, self.leave(giver))
        here = self.foot + (self.shelf.top + 0.01) * UP - self.middle(world)
        with suppress(GaveUp):
            yield from alone(taker, go_to(taker, taker.hand + here, pace=Pace(0.15, 0.01)))
        yield from alone(taker, jaw.release(taker))
        yield from alone(taker, go_to(taker, taker.hand + STAND_OFF * LEFT))

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        return {
            "holed_plate": self._scene(replace(self.plate, hole=0.020), self.shelf),
            "closed_slot": self._scene(self.plate, replace(self.shelf, gap=0.010)),
        }

    # --- what must hold -------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        plate, shelf = self.plate, self.shelf
        yield on_table("the plate", corners(self.start, 0.0, 2 * [2 * plate.radius]), EDGE + SPARE)
        yield on_table("the shelf", self._outline)
        apart = gap(self._outline, corners(self.start, 0.0, 2 * [2 * plate.radius]))
        yield require(apart > 0.01, "plate and shelf stand in each other's place", apart=apart)
        flat = plate.foot - math.sqrt(2.0) * CUP_HALF_WIDTH
        yield require(flat > 0.01, "the cup does not fit on the plate's foot", room=flat)
        yield require(self.slack > 2 * AIR, "the plate is higher than the slot is wide", slack=self.slack)
        beside = shelf.gap - AIR - plate.rise - plate.thickness / 2  # from the lip to the divider that is nearer to it
        room = beside - (TIP_SPAN_CLOSED + plate.thickness) / 2
        yield require(room > 0.0, "the fingers that hold the lip meet the dividers", room=room)
        left = TUBE - self.proud  # the dividers stop the tube
        yield require(left > 2 * DEEP, "a cup on the lip puts the plate into the slot alone", left=left)
        slips = 2 * math.atan(plate.friction)
        yield require(
            self.flat_tilt > slips, "one jaw takes the plate from the table", askew=self.flat_tilt, slips=slips
        )
        grip, weight = plate.friction * pinch(plate.thickness), GRAVITY * plate.mass
        yield require(grip > 2 * weight, "the jaw does not hold the plate", grip=grip, weight=weight)
        right, left = panda.bases(2)
        yield within_reach("the plate", self.start, base=right)
        yield within_reach("the slot", self.foot + (shelf.top + 2 * plate.radius + OVER) * UP, base=left)

    def features(self) -> Mapping[str, float]:
        plate = self.plate
        lever = plate.radius - OVERLAP
        return {
            "slack": self.slack,
            "droop": GRAVITY * plate.mass * lever / (pinch(plate.thickness) * PAD / 2),
            "radius": plate.radius,
            "carried": float(np.linalg.norm(self.foot - self.start)),
            "slot_yaw": math.radians(self.shelf_yaw),
        }


def _after(world: World, seconds: float) -> Condition:
    """Holds from some time on: for moves that may not come to their end."""
    end = world.time + seconds
    return lambda: world.time > end
