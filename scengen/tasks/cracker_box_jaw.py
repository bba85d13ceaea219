r"""T09 cracker-box-jaw: lay a cracker box that stands upright flat into a slot, with a two-finger jaw.

              __
      hand __/   \__           From the side: the jaw holds the box by its upper end, across its thickness. The palm of
            \       \__        a level hand, wider than the slot is high, meets the slot's wall or the table. So the
          |  \__       \ |     box goes in leaning, far end first. Let go, it falls onto the near wall, lies there at
    ------+-----\______/-+--   16 deg, and is knocked home.

Bottleneck: no hand lets the box down flat into the slot. The hand can reach a box that leans with its far end in the
slot, as flat as the palm permits. Released there, or from a level hand, the box is caught on the near wall. It must be
shifted there until it drops in, for which the box' length leaves 3 mm.

Decisions, where the paper (App. B, T09) says no more than "tight slot outline" and "partially insert":

* The slot and the box are those of T08 (`assets.cracker_box`), the box no thicker than the jaw opens. Its thickness is
  the "narrow side": across its width, "the flat side", no jaw reaches.
* The box that lies on the near wall needs no look: one knock at a place that follows from the slot alone is fair and
  solves 12 of 12, on `tight` too.
* A box that falls beside the slot is not a failure: it lies flat, with nothing that a jaw reaches around.
* The box is let go at most `MAX_RELEASE_ANGLE` steep. Stood up in the slot and toppled, it comes in by gravity alone,
  and a few shoves finish it (12 of 12). A held box may stand in the slot at any angle.
* One arm, as in the catalogue (App. B.1); the text has a second one, which is frozen.
"""

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from ..assets.cracker_box import CrackerBox
from ..assets.prop import TABLE_TOP
from ..errors import GaveUp
from ..geometry import UP, Mat3, Vec3, axes, gap, way_to
from ..means import Mean, once, throughout, when
from ..params import param
from ..physics import GRAVITY
from ..predicates import fallen, seated
from ..robots.jaw import OPEN_GAP, PALM_ABOVE, PALM_ALONG, pinch
from ..scenario import Plan, Planner, Refutation, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT, Arm
from ..sim.world import World
from ..skills import jaw
from ..skills.motion import CLOSED, COARSE, OPEN, STEADY, Pace, facing_down, go_to, hold, push, retreat
from ..skills.suction import carry_to
from ..skills.waiting import at_most
from .cracker_box import FLAT_TOLERANCE, HEIGHT_TOLERANCE, BoxAndSlot

SEAT_TOLERANCE = 0.007  # largest distance of the box' middle from its seat along the table [m]
GRIP_DEPTH = 0.02  # depth below the box' upper end at which it is held [m]: the palm allows 0.03
LIFT_HEIGHT = 0.10  # height by which the box is lifted before it is leant [m]
STEEP_ANGLE = math.radians(45.0)  # angle to the level at which the far end is brought into the slot [rad]
MAX_RELEASE_ANGLE = math.radians(40.0)
"""Largest angle to the level of a box in the slot that the robot does not touch [rad]; the palm permits 28 deg."""
WALL_CLEARANCE = 0.004  # gap between the far wall and the box while it is leant [m]
LEAN_PACE = Pace(0.25, 0.01)  # pace at which the box is leant high over the slot
INSERT_PACE = Pace(0.10, 0.004)  # pace at which the far end is lowered into the slot
MAX_SWING = 0.01  # largest distance of a box that swings in the jaw from its target, before it is aimed [m]
CARRY_HEIGHT = 0.07  # height of the far end over the slot's floor before it is lowered [m]
STAND_OFF = 0.05  # distance from the box' near end at which the closed jaw comes down [m]
KNOCK_TIMEOUT = 2.5  # time for which one knock pushes [s]
MIN_SLIDE_CLEARANCE = 0.0005  # least clearance of the box as it is pushed between the slot's walls [m]


@dataclass(frozen=True, kw_only=True)
class CrackerBoxJaw(BoxAndSlot):
    """A box of crackers that stands on the table, and a slot."""

    VERSION = 2
    HOLD = 0.5

    box_x: float = param(-0.06, "m", -0.4, 0.4)
    box_y: float = param(-0.17, "m", -0.4, 0.4)
    box_yaw: float = param(0.0, "deg", -90.0, 90.0, period=180.0)  # yaw of the box: at 0 its broad faces look along y
    slot_x: float = param(-0.02, "m", -0.4, 0.4)
    slot_y: float = param(0.12, "m", -0.4, 0.4)
    slot_yaw: float = param(0.0, "deg", -90.0, 90.0, period=180.0)  # yaw of the slot: at 0 its long side is along y
    clearance: float = param(0.005, "m", 0.0005, 0.02)  # gap between the box in the middle of the slot and each wall
    box: CrackerBox = CrackerBox(scale=0.85, friction=0.21)

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        flat = abs(world.rot("box")[2, 0]) > math.cos(FLAT_TOLERANCE)
        return flat and seated(world, "box", "slot", self.seat, SEAT_TOLERANCE, HEIGHT_TOLERANCE)

    def failure(self, world: World) -> str | None:
        return "the box fell off the table" if fallen(world, "box") else None

    def let_go_steep(self, world: World) -> bool:
        """Whether the box stands in the slot, or falls in it, from more than the angle at which it may be let go."""
        steep = abs(world.rot("box")[2, 2]) > math.sin(MAX_RELEASE_ANGLE)
        return steep and world.touching("box", "slot") and not world.touching(ROBOT, "box")

    def means(self) -> Mapping[str, Mean]:
        let_go = "the jaw let go of a box with one end in the slot"
        return {
            "the jaw brought the box to the slot": when(
                lambda world: world.touching("box", "slot"), lambda world: world.arm.grips("box")
            ),
            "the box was let go at a flat angle": throughout(lambda world: not self.let_go_steep(world)),
            let_go: once(self.left_leaning, after="the jaw brought the box to the slot"),
            "a knock of the robot brought the other end down": once(
                lambda world: world.touching(ROBOT, "box") and not self.down(world), after=let_go
            ),
        }

    def left_leaning(self, world: World) -> bool:
        """Whether the robot does not touch a box that is partly in the slot, below its walls."""
        lowest = world.com("box")[2] - float(np.abs(world.rot("box")[2]) @ self.box.size) / 2
        free = world.touching("box", "slot") and not world.touching(ROBOT, "box")
        return free and lowest < self.rim and not self.down(world)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Take the box across its thickness, lean its far end into the slot, let go, knock the near end in."""
        yield from self.take(world.arm)
        yield from self.insert(world.arm)
        yield from self.leave(world.arm)
        for _ in range(4):
            if self.success(world):
                return
            yield from self.knock(world.arm)

    def take(self, arm: Arm) -> Plan:
        """Take the box by its upper end, and lift it."""
        world = arm.world
        grip = world.pos("box") + (self.box.size[2] - GRIP_DEPTH) * UP
        yield from jaw.pick(arm, grip, world.rot("box")[:, 0], above=0.08, lift=LIFT_HEIGHT)

    def insert(self, arm: Arm) -> Plan:
        """Lean the box over the slot, put its far end in, lean it as far as the palm permits."""
        yield from self._lean(arm, (math.pi / 2 + STEEP_ANGLE) / 2, CARRY_HEIGHT, LEAN_PACE)
        yield from self._lean(arm, STEEP_ANGLE, CARRY_HEIGHT, LEAN_PACE)
        yield from hold(arm, 0.2)  # until the box has stopped swinging in the jaw
        yield from self._lean(arm, STEEP_ANGLE, CARRY_HEIGHT, INSERT_PACE)
        middle, rot = self.leaning(arm.world, STEEP_ANGLE)
        end = middle - self.box.size[2] / 2 * rot[:, 2]
        yield from carry_to(arm, "box", end + CARRY_HEIGHT * UP, rot, Pace(0.10, 0.002), near=MAX_SWING)
        yield from carry_to(arm, "box", end + 0.003 * UP, rot, INSERT_PACE, near=MAX_SWING)
        # At most 7 deg at a time. Pressed on the floor, the box may stay some millimetres off.
        steps = math.ceil((STEEP_ANGLE - self.flattest) / math.radians(7.0))
        for angle in np.linspace(STEEP_ANGLE, self.flattest, steps + 1)[1:]:
            with suppress(GaveUp):
                yield from self._lean(arm, float(angle), 0.0, Pace(0.10, 0.006, 3.0))

    def _lean(self, arm: Arm, angle: float, height: float, pace: Pace) -> Plan:
        """Lean the box at `angle` to the level [rad], its far end at `height` over the slot's floor [m]."""
        middle, rot = self.leaning(arm.world, angle)
        yield from jaw.carry(arm, "box", middle + height * UP, rot, pace)

    def leaning(self, world: World, angle: float) -> tuple[Vec3, Mat3]:
        """Position of the middle [m] and orientation of a box that leans in the slot, near its far wall."""
        thickness, _, height = self.box.size
        sine, cosine, out = math.sin(angle), math.cos(angle), self.out
        to_wall = min(thickness * sine, self.slot.depth * sine / cosine) + WALL_CLEARANCE
        edge = self.foot + self.slot.floor * UP + (self.slot.length / 2 - to_wall) * out
        thin, tall = sine * out + cosine * UP, sine * UP - cosine * out
        middle = edge + thickness / 2 * thin + height / 2 * tall
        return middle, axes(math.copysign(1.0, float(world.rot("box")[:, 0] @ thin)) * thin, tall)

    def leave(self, arm: Arm) -> Plan:
        """Let the box go, draw the open jaw back along it by 60 mm, then back and up by 60 mm."""
        yield from jaw.release(arm)
        yield from go_to(arm, arm.hand - 0.06 * arm.hand_rot[:, 2], pace=Pace(0.25, 0.02), grip=OPEN)
        yield from go_to(arm, arm.hand - 0.06 * arm.hand_rot[:, 2] + 0.06 * UP, pace=Pace(0.25, 0.02), grip=OPEN)

    def knock(self, arm: Arm) -> Plan:
        """Push the box' near end along the slot with the closed jaw, until the box is down or time is over."""
        world, out = arm.world, self.out
        end = world.com("box") + self.box.size[2] / 2 * world.rot("box")[:, 2]
        height = max(end[2], self.rim + self.box.size[0] / 3)
        start = np.array([*(end - STAND_OFF * out)[:2], height])
        yield from go_to(arm, [*start[:2], max(arm.hand[2], height + STAND_OFF)], self._knocking_hand, STEADY, CLOSED)
        yield from go_to(arm, start, self._knocking_hand, STEADY, CLOSED)
        push_down = push(arm, 0.06 * out, lambda: self.down(world), CLOSED, 2 * KNOCK_TIMEOUT)
        yield from at_most(world, KNOCK_TIMEOUT, push_down)
        yield from go_to(arm, arm.hand - 0.03 * out, pace=COARSE)
        yield from retreat(arm, 0.06)

    @cached_property
    def _knocking_hand(self) -> Mat3:
        """Orientation of a hand that points down, its fingers side by side across the slot."""
        return facing_down(math.remainder(math.atan2(-self.out[0], self.out[1]), math.pi))

    def down(self, world: World) -> bool:
        """Whether the box' middle is at the height of its seat."""
        return abs(world.com("box")[2] - self.seat[2]) < HEIGHT_TOLERANCE

    def steps(self) -> Mapping[str, Planner]:
        def knock(world: World) -> Plan:
            if not self.down(world):
                yield from self.knock(world.arm)

        return {
            "take_thickness": lambda world: self.take(world.arm),
            "lean_in": lambda world: self.insert(world.arm),
            "let_go": lambda world: self.leave(world.arm),
            "knock_home": knock,
            "take_width": lambda world: self._pick_flat_side(world.arm),
            "lay_level": lambda world: self._lower_held(world.arm),
            "topple": self._topple,
        }

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "insert_and_leave": Shortcut(self._insert_and_leave, to_rest=True),
            "stand_it_up_and_topple_it": Shortcut(self._topple),
            "lower_it_level": Shortcut(self._lower_level),
            "by_the_flat_side": Shortcut(self._take_flat_side),
        }

    def _insert_and_leave(self, world: World) -> Plan:
        """Lean the box into the slot, let go, and do no more."""
        yield from self.take(world.arm)
        yield from self.insert(world.arm)
        yield from self.leave(world.arm)

    def _topple(self, world: World) -> Plan:
        """Stand the box up at the near end of the slot, let go, push it over along the slot."""
        arm, out = world.arm, self.out
        yield from self.take(arm)
        _, rot = self.leaning(world, math.pi / 2)
        thickness, _, height = self.box.size
        from_middle = (self.slot.length - thickness - 2 * WALL_CLEARANCE) / 2
        near = self.foot + (self.slot.floor + height / 2) * UP - from_middle * out
        yield from jaw.carry(arm, "box", near + LIFT_HEIGHT * UP, rot, LEAN_PACE)
        yield from jaw.carry(arm, "box", near + self.slot.depth / 2 * UP, rot, Pace(0.10, 0.004))
        yield from push(arm, -0.05 * UP, lambda: world.touching("box", "slot"), CLOSED)
        yield from jaw.let_go(arm)
        behind = world.com("box") + 0.4 * height * UP - (thickness / 2 + STAND_OFF) * out
        falls = math.radians(40.0)
        yield from jaw.poke(arm, behind, 0.15 * out, lambda: world.tilt("box") > falls, rot=self._knocking_hand)

    def _lower_level(self, world: World) -> Plan:
        """Turn the box level in the hand, lower it over the slot until the palm meets something, let go."""
        yield from self.take(world.arm)
        yield from self._lower_held(world.arm)

    def _lower_held(self, arm: Arm) -> Plan:
        """Lower the held box level, see `_lower_level`."""
        world = arm.world
        for angle in (math.radians(60.0), math.radians(30.0), 0.0):
            _, rot = self.leaning(world, angle)
            with suppress(GaveUp):
                yield from jaw.carry(arm, "box", self.seat + (PALM_ALONG + CARRY_HEIGHT) * UP, rot, Pace(0.15, 0.008))
        lower = push(arm, -0.05 * UP, lambda: world.touching("robot", "slot"), CLOSED, give_up=4.0)
        yield from at_most(world, 3.0, lower)
        yield from self.leave(arm)

    def _take_flat_side(self, world: World) -> Plan:
        """Close the jaw across the width of the box, and carry on."""
        yield from self._pick_flat_side(world.arm)
        with suppress(GaveUp):
            yield from self.insert(world.arm)
        yield from self.leave(world.arm)

    def _pick_flat_side(self, arm: Arm) -> Plan:
        """Close the jaw across the width of the box, and lift."""
        top = arm.world.pos("box") + self.box.size[2] * UP
        yield from jaw.pick(arm, top + 0.01 * UP, arm.world.rot("box")[:, 1], above=0.08, lift=LIFT_HEIGHT)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """A slot that is 20 mm too short; a box so slippery that the jaw, which holds 0.8 N then, cannot hold it."""
        short, slippery = replace(self.slot, length=self.slot.length - 0.02), replace(self.box, friction=0.02)
        return {"short_slot": self._scene(self.box, short), "slippery_box": self._scene(slippery, self.slot)}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        thickness, _, height = self.box.size
        yield on_table("the box", self._box_outline)
        yield on_table("the slot", self._slot_outline)
        apart = gap(self._box_outline, self._slot_outline)
        yield require(apart > 0.01, "the box stands in the slot's place", apart=apart)
        widest = OPEN_GAP - 0.005  # the hand and the box may each be 2 mm out of place
        yield require(thickness < widest, "the box is too thick for the jaw", thickness=thickness, most=widest)
        grip, weight = self.box.friction * pinch(thickness), GRAVITY * self.box.mass
        yield require(grip > 2.0 * weight, "the box slips out of the jaw", grip=grip, weight=weight)
        room, least = self.slide_clearance, MIN_SLIDE_CLEARANCE
        yield require(room > least, "the box jams between both walls", room=room, least=least)
        yield within_reach("the box", self.start + (height - GRIP_DEPTH + LIFT_HEIGHT) * UP)
        yield within_reach("the slot", self.seat + (CARRY_HEIGHT + height / 2) * UP)

    def features(self) -> Mapping[str, float]:
        """Weight over the grip, size, clearance in the slot, flattest angle, the slot's direction, and its turn."""
        return {
            "weight_on_friction": GRAVITY * self.box.mass / (self.box.friction * pinch(self.box.size[0])),
            "size": self.box.scale,
            "room": self.clearance / self.box.size[2],
            "flattest": self.flattest,
            "direction": math.atan2(self.out[1], self.out[0]),
            "turn": math.radians(math.remainder(self.slot_yaw - self.box_yaw, 180.0)),
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "box": way_to(self.start, self.foot),
            "apart": math.dist(self.start, self.foot),
            "height": float(self.box.size[2]),
            "turn": abs(math.remainder(self.slot_yaw - self.box_yaw, 180.0)),
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def flattest(self) -> float:
        """Angle to the level at which the box is let go [rad]: 2 deg steeper than with the palm 5 mm off the table."""
        behind = self.box.size[2] - GRIP_DEPTH + PALM_ABOVE
        return math.atan2(PALM_ALONG - self.box.size[0] / 2 + 0.005, behind) + math.radians(2.0)

    @cached_property
    def slide_clearance(self) -> float:
        """Clearance along the slot of a box that leans on the far wall, its near end on the near wall's edge [m]."""
        height, depth = self.box.size[2], self.slot.depth
        angle = math.asin(depth / height)
        return self.slot.length - height * math.cos(angle) - depth * math.tan(angle)

    @cached_property
    def rim(self) -> float:
        """Height of the slot's walls [m]."""
        return TABLE_TOP + self.slot.floor + self.slot.depth

    @cached_property
    def out(self) -> Vec3:
        """Unit vector along the slot, away from the side from which the box comes."""
        side = math.copysign(1.0, self.slot_y - self.box_y)
        yaw = math.radians(self.slot_yaw)
        return side * np.array([-math.sin(yaw), math.cos(yaw), 0.0])
