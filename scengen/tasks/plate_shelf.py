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

* The plate is deep, on a small foot, with a level lip: its "slight incline". Its thickness and its two diameters in
  training are of the paper's list (App. C); the others are axes.
* The dividers are as high as the plate: closed fingers go down between them with it, by their thickness of 35 mm, but a
  cup sits across the slot. Even on the lip, its uppermost part, it meets them 11 mm before the plate is down. Between
  dividers that are 6 cm lower than the plate a cup on the lip puts it in alone.
* A plate that falls faster than 0.35 m/s, as from 6 mm, breaks, and the episode is lost: else the cup could let it
  drop the rest of the way. No hand lowers anything faster than 0.3 m/s. Speeds are looked at every 10 ms, in which a
  fall gains 0.1 m/s: from 10 mm on, less than what is left under a cup, it is seen for certain. The shelf is polished,
  so that a plate that is let go in the slot does fall.
* In the slot means: on edge within 10 deg, along the slot, with its middle between the dividers and its rim on the
  slot's floor, and let go. Leaning against the shelf from outside is not.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from ..assets.plate import Plate
from ..assets.prop import TABLE_TOP
from ..geometry import UP, Vec3, about_z, corners, gap
from ..params import param
from ..physics import GRAVITY
from ..robots import panda
from ..robots.jaw import PAD, TIP, TIPS_CLOSED, pinch
from ..robots.suction import REACHES, TUBE
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
from .plate_and_slot import AIR, DEEP, OVER, PlateAndSlot

MEETING: Vec3 = np.array([-0.15, 0.0, TABLE_TOP + 0.22])
"""Where the plate changes hands [m]. The palm of a level hand that closes up and down reaches 0.104 m below the lip."""
ASIDE: Vec3 = np.array([-0.15, -0.35, TABLE_TOP + 0.35])
"""Where the cup's hand is out of the way [m]."""


@dataclass(frozen=True, kw_only=True)
class PlateShelf(PlateAndSlot):
    """A plate on the table and a shelf with a slot."""

    plate_x: float = param(-0.17, "m", -0.3, 0.2)
    plate_y: float = param(-0.06, "m", -0.35, 0.35)
    shelf_x: float = param(0.07, "m", -0.1, 0.3)
    shelf_y: float = param(0.03, "m", -0.3, 0.3)
    shelf_yaw: float = param(0.0, "deg", -90.0, 90.0, period=180.0)
    plate: Plate = Plate(foot=0.045, rise=0.020)
    gap: float = param(0.046, "m", 0.02, 0.09)
    """Width of the slot."""
    proud: float = param(0.0, "m", -0.01, 0.1)
    """How far the plate stands out of the slot."""

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

    def lip(self, world: World) -> Vec3:
        """The leftmost point of the lip, at half its thickness, while the plate is level [m]."""
        return world.pos("plate") + (self.plate.rise + self.plate.thickness / 2) * UP + self.plate.radius * LEFT

    def wait_beside(self, arm: Arm) -> Plan:
        """Bring the open jaw beside the place where the lip is going to be, and where it comes up."""
        away = max(MEETING[1], self.plate_y) + self.plate.radius + STAND_OFF
        high = MEETING[2] + self.plate.rise + self.plate.thickness / 2
        yield from go_to(arm, [MEETING[0], away, high], SIDEWAYS, STEADY, OPEN)

    def hand_over(self, world: World) -> Plan:
        """The jaw takes the lip, then the cup lets go."""
        yield from hand_over(*world.arms, lambda: self.lip(world), SIDEWAYS)

    def leave(self, arm: Arm) -> Plan:
        """Up, and out of the way."""
        yield from retreat(arm, 0.10)
        yield from go_to(arm, ASIDE, pace=COARSE)

    # --- what must not work ---------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "cup_on_the_foot": Shortcut(lambda world: self._cup_alone(world, self.plate.foot - REACHES - 0.004, 0.0)),
            "cup_on_the_lip": Shortcut(
                lambda world: self._cup_alone(world, self.plate.radius - self.plate.lip / 2, self.plate.rise)
            ),
            "cup_alone_flat_on_the_slot": Shortcut(self._lay_flat),
            "let_go_without_partner": Shortcut(self._let_go),
            "jaw_alone": Shortcut(self._jaw_alone),
            "jaw_inserts_flat": Shortcut(self._insert_flat),
        }

    def _cup_alone(self, world: World, beside: float, above: float) -> Plan:
        """Hold the plate on edge with the cup, on its upper side, lower it until it stops, let go, press it down.

        Args:
            beside: how far from the plate's middle the cup sits [m].
            above: how much higher than its foot [m].
        """
        arm, rot = world.arms[0], about_z(math.radians(self.shelf_yaw)) @ FORWARDS
        over = self.foot + (self.shelf.top + self.plate.radius + OVER) * UP
        upper = facing_down() @ rot.T @ UP  # the side of the plate that will be its upper one

        def plan() -> Plan:
            face = world.pos("plate") + beside * upper + (self.plate.thickness + above) * UP
            yield from go_to(arm, face + 0.03 * UP, facing_down(), STEADY, OPEN)
            yield from suction.suck(arm, face, facing_down(), 0.04)
            yield from go_to(arm, arm.hand + (self.shelf.top + 2 * self.plate.radius) * UP, pace=Pace(0.15, 0.01))
            yield from go_to(arm, [over[0] - 0.08, over[1], arm.hand[2]], pace=Pace(0.10, 0.02))
            yield from until(turn_to(arm, rot, 0.5, give_up=9.0), _after(world, 6.0))
            for pace in (Pace(0.10, 0.01), Pace(0.05, 0.004)):
                yield from until(go_to(arm, arm.hand + over - self.middle(world), pace=pace), _after(world, 4.0))
            yield from push(arm, -0.05 * UP, _after(world, 4.0), give_up=5.0)
            yield from suction.let_go(arm)
            yield from go_to(arm, world.com("plate") + (self.plate.radius + 0.05) * UP, facing_down(), COARSE)
            yield from push(arm, -0.05 * UP, _after(world, 2.0), give_up=3.0)

        yield from alone(arm, plan())

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
        rim = world.pos("plate") + (self.plate.radius - self.plate.lip) * LEFT + (self.plate.rise + TIP) * UP
        yield from alone(arm, jaw.pick(arm, rim, closing=LEFT, lift=0.2))
        yield from alone(arm, go_to(arm, self.foot + (self.shelf.top + self.plate.radius + OVER) * UP))
        yield from alone(arm, jaw.release(arm))

    def _insert_flat(self, world: World) -> Plan:
        """Hand the plate over, and lower it on the slot without turning it on edge."""
        giver, taker = world.arms
        yield from together(world, self.present(giver), self.wait_beside(taker))
        yield from self.hand_over(world)
        yield from alone(giver, self.leave(giver))
        here = self.foot + (self.shelf.top + 0.01) * UP - self.middle(world)
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
        yield on_table("the plate", corners(self.start, 0.0, 2 * [2 * plate.radius]))
        yield on_table("the shelf", self._outline)
        apart = gap(self._outline, corners(self.start, 0.0, 2 * [2 * plate.radius]))
        yield require(apart > 0.01, "plate and shelf stand in each other's place", apart=apart)
        flat = plate.foot - math.sqrt(2.0) * REACHES
        yield require(flat > 0.01, "the cup does not fit on the plate's foot", room=flat)
        yield require(self.slack > 2 * AIR, "the plate is higher than the slot is wide", slack=self.slack)
        beside = shelf.gap - AIR - plate.rise - plate.thickness / 2  # from the lip to the divider that is nearer to it
        room = beside - (TIPS_CLOSED + plate.thickness) / 2
        yield require(room > 0.0, "the fingers that hold the lip meet the dividers", room=room)
        left = TUBE - self.proud  # the dividers stop the tube
        yield require(left > 2 * DEEP, "a cup on the lip puts the plate into the slot alone", left=left)
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
