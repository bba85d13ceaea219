r"""T09 cracker-box-jaw: lay a cracker box that stands upright flat into a slot, with a two-finger jaw.

              __
      hand __/   \__           From the side: the jaw holds the box by its upper end, across its thickness. The palm of
            \       \__        a level hand, wider than the slot is high, meets the slot's wall or the table. So the
          |  \__       \ |     box goes in leaning, far end first. Let go, it falls onto the near wall, lies there at
    ------+-----\______/-+--   16 deg, and is knocked home.

Bottleneck: no hand lets the box down into the slot. What can be reached is a box that leans with its far end in the
slot, as flat as the palm permits. Let go, from there or from a level hand, it is caught on the near wall; it has to be
seen there, and shifted until it drops in, for which its length leaves 3 mm of room.

Decisions, where the paper (App. B, T09) says no more than "tight slot outline" and "partially insert":

* The slot and the box are those of T08 (`assets.cracker_box`), the box no thicker than the jaw opens. Its thickness is
  the "narrow side": across its width, "the flat side", no jaw reaches.
* A wrong try is not punished by a rule: what falls beside the slot lies flat there, with nothing that a jaw reaches
  around, and what is toppled over in the slot leans on its far wall.
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
from ..geometry import UP, Mat3, Vec3, axes, gap
from ..params import param
from ..physics import GRAVITY
from ..predicates import fallen, seated
from ..robots.jaw import OPEN_GAP, PALM_ABOVE, PALM_ALONG, pinch
from ..scenario import Plan, Refutation, Shortcut, on_table, require, within_reach
from ..sim.world import Arm, World
from ..skills.jaw import carry, pick, poke, release
from ..skills.motion import CLOSED, COARSE, OPEN, STEADY, Pace, facing_down, go_to, hold, push, retreat
from ..skills.suction import carry_to
from .cracker_box import BoxAndSlot

FLAT = math.radians(3.0)
"""Largest angle between the box' thin axis and the vertical [rad]."""
OFF, HIGH = 0.007, 0.003
"""Largest distances of the box' middle from its seat, along the table and upright [m]."""
BELOW = 0.02
"""How far under the box' upper end it is held [m]: the palm allows 0.03."""
LIFT = 0.10
"""How far the box is lifted before it is leant [m]."""
STEEP = math.radians(45.0)
"""Angle to the level at which the far end is brought into the slot [rad]."""
SPARE, LEANING = math.radians(2.0), math.radians(7.0)
"""How much steeper than the palm permits the box is let go, and by how much it leans more at a time [rad]."""
AIR, UNDER_THE_PALM = 0.004, 0.005
"""Between the far wall and the box while it is leant, between palm and table at the end of that [m]."""
TRANSIT, LOWERING = Pace(0.25, 0.01), Pace(0.10, 0.006, 3.0)
AIMING, INSERTING = Pace(0.10, 0.002), Pace(0.10, 0.004)
"""How the box is leant high over the slot, and in it; how it is aimed between the two, and its far end lowered."""
STEADIES, DROOP = 0.2, 0.01
"""How long the box swings in the jaw before it is aimed [s], and how far it then hangs off at most [m]."""
OVER, JUST_OVER, BACK = 0.07, 0.003, 0.06
"""How high over the floor the far end is at first, and before the box is leant on it; how far the open jaw draws back
along the box [m]."""
STAND_OFF, KNOCKING, PATIENCE, TRIES = 0.05, 0.06, 2.5, 4
"""How far from the near end the closed jaw comes down [m], how fast it pushes [m/s], for how long [s], how often."""
SPARE_GAP = 0.005
"""Of the jaw's opening, which the hand and the box, each 2 mm out of place, may take up [m]."""
HOLDS = 2.0
"""How many times the weight the friction of the pads must hold."""
SHORT, SLIPPERY = 0.02, 0.02
"""By how much a slot is too short [m]; friction at which every box slips out of the jaw, which holds 0.8 N."""
APART, PASSES = 0.01, 0.0005
"""Least distance of box and slot, and least room of the box as it is pushed between the slot's walls [m]."""


@dataclass(frozen=True, kw_only=True)
class CrackerBoxJaw(BoxAndSlot):
    """A box of crackers that stands on the table, and a slot."""

    HOLD = 0.5

    box_x: float = param(-0.06, "m", -0.4, 0.4)
    box_y: float = param(-0.17, "m", -0.4, 0.4)
    box_yaw: float = param(0.0, "deg", -90.0, 90.0, period=180.0)
    """At 0 the broad faces look along y."""
    slot_x: float = param(-0.02, "m", -0.4, 0.4)
    slot_y: float = param(0.12, "m", -0.4, 0.4)
    slot_yaw: float = param(0.0, "deg", -90.0, 90.0, period=180.0)
    """At 0 the slot's long side is along y."""
    clearance: float = param(0.005, "m", 0.0005, 0.02)
    """Between the box in the middle of the slot and each wall."""
    box: CrackerBox = CrackerBox(scale=0.85, friction=0.21)

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        flat = abs(world.rot("box")[2, 0]) > math.cos(FLAT)
        return flat and seated(world, "box", "slot", self.seat, OFF, HIGH)

    def failure(self, world: World) -> str | None:
        return "the box fell off the table" if fallen(world, "box") else None

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Take the box across its thickness, lean it into the slot with its far end, let go, knock the near end in."""
        yield from self.take(world.arm)
        yield from self.insert(world.arm)
        yield from self.leave(world.arm)
        for _ in range(TRIES):
            if self.success(world):
                return
            yield from self.knock(world.arm)

    def take(self, arm: Arm) -> Plan:
        """Take the box by its upper end, and lift it."""
        world = arm.world
        at = world.pos("box") + (self.box.size[2] - BELOW) * UP
        yield from pick(arm, at, world.rot("box")[:, 0], above=0.08, lift=LIFT)

    def insert(self, arm: Arm) -> Plan:
        """Lean the box over the slot, put its far end in, lean it as far as the palm permits."""
        yield from self._lean(arm, (math.pi / 2 + STEEP) / 2, OVER, TRANSIT)
        yield from self._lean(arm, STEEP, OVER, TRANSIT)
        yield from hold(arm, STEADIES)
        yield from self._lean(arm, STEEP, OVER, INSERTING)
        middle, rot = self.leaning(arm.world, STEEP)
        end = middle - self.box.size[2] / 2 * rot[:, 2]
        yield from carry_to(arm, "box", end + OVER * UP, rot, AIMING, near=DROOP)
        yield from carry_to(arm, "box", end + JUST_OVER * UP, rot, INSERTING, near=DROOP)
        steps = math.ceil((STEEP - self.flattest) / LEANING)
        for angle in np.linspace(STEEP, self.flattest, steps + 1)[1:]:
            with suppress(GaveUp):  # pressed on the floor it may stay some millimetres off
                yield from self._lean(arm, float(angle), 0.0, LOWERING)

    def _lean(self, arm: Arm, angle: float, above: float, pace: Pace) -> Plan:
        """Bring the box to where it leans at an angle to the level [rad], its far end so far over the floor [m]."""
        middle, rot = self.leaning(arm.world, angle)
        yield from carry(arm, "box", middle + above * UP, rot, pace)

    def leaning(self, world: World, angle: float) -> tuple[Vec3, Mat3]:
        """The middle [m] and the orientation of a box that leans in the slot, near its far wall."""
        thickness, _, height = self.box.size
        sine, cosine, out = math.sin(angle), math.cos(angle), self.out
        to_wall = min(thickness * sine, self.slot.depth * sine / cosine) + AIR
        edge = self.foot + self.slot.floor * UP + (self.slot.length / 2 - to_wall) * out
        thin, tall = sine * out + cosine * UP, sine * UP - cosine * out
        middle = edge + thickness / 2 * thin + height / 2 * tall
        return middle, axes(math.copysign(1.0, float(world.rot("box")[:, 0] @ thin)) * thin, tall)

    def leave(self, arm: Arm) -> Plan:
        """Let the box go, and draw the jaw back along it, then up."""
        yield from release(arm)
        yield from go_to(arm, arm.hand - BACK * arm.hand_rot[:, 2], pace=Pace(0.25, 0.02), grip=OPEN)
        yield from go_to(arm, arm.hand - BACK * arm.hand_rot[:, 2] + BACK * UP, pace=Pace(0.25, 0.02), grip=OPEN)

    def knock(self, arm: Arm) -> Plan:
        """Push the box' near end along the slot with the closed jaw, until the box is down or that took too long."""
        world, out = arm.world, self.out
        end = world.com("box") + self.box.size[2] / 2 * world.rot("box")[:, 2]
        height = max(end[2], self.rim + self.box.size[0] / 3)
        start = np.array([*(end - STAND_OFF * out)[:2], height])
        yield from go_to(arm, [*start[:2], max(arm.hand[2], height + STAND_OFF)], self._behind(), STEADY, CLOSED)
        yield from go_to(arm, start, self._behind(), STEADY, CLOSED)
        stop = world.time + PATIENCE
        yield from push(arm, KNOCKING * out, lambda: world.time > stop or self.down(world), CLOSED, 2 * PATIENCE)
        yield from go_to(arm, arm.hand - 0.03 * out, pace=COARSE)
        yield from retreat(arm, 0.06)

    def _behind(self) -> Mat3:
        """Orientation of a hand that points down, its fingers side by side across the slot."""
        return facing_down(math.remainder(math.atan2(-self.out[0], self.out[1]), math.pi))

    def down(self, world: World) -> bool:
        """Whether the box' middle is as low as it gets."""
        return abs(world.com("box")[2] - self.seat[2]) < HIGH

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "insert_and_leave": Shortcut(self._insert_and_leave, to_rest=True),
            "stand_it_up_and_topple_it": Shortcut(self._topple),
            "lower_it_level": Shortcut(self._lower_level),
            "by_the_flat_side": Shortcut(self._flat_side),
        }

    def _insert_and_leave(self, world: World) -> Plan:
        """Lean the box into the slot, let go, and leave it at that."""
        yield from self.take(world.arm)
        yield from self.insert(world.arm)
        yield from self.leave(world.arm)

    def _topple(self, world: World) -> Plan:
        """Stand the box up at the near end of the slot, let go, push it over along the slot."""
        arm, out = world.arm, self.out
        yield from self.take(arm)
        _, rot = self.leaning(world, math.pi / 2)
        thickness, _, height = self.box.size
        near = self.foot + (self.slot.floor + height / 2) * UP - (self.slot.length - thickness - 2 * AIR) / 2 * out
        yield from carry(arm, "box", near + LIFT * UP, rot, TRANSIT)
        yield from carry(arm, "box", near + self.slot.depth / 2 * UP, rot, Pace(0.10, 0.004))
        yield from push(arm, -0.05 * UP, lambda: world.touching("box", "slot"), CLOSED)
        yield from release(arm)
        yield from retreat(arm)
        behind = world.com("box") + 0.4 * height * UP - (thickness / 2 + STAND_OFF) * out
        yield from poke(arm, behind, 0.15 * out, lambda: world.tilt("box") > math.radians(40.0), rot=self._behind())

    def _lower_level(self, world: World) -> Plan:
        """Turn the box level in the hand, lower it over the slot until the palm meets something, let go."""
        arm = world.arm
        yield from self.take(arm)
        for angle in (math.radians(60.0), math.radians(30.0), 0.0):
            _, rot = self.leaning(world, angle)
            with suppress(GaveUp):
                yield from carry(arm, "box", self.seat + (PALM_ALONG + OVER) * UP, rot, Pace(0.15, 0.008))
        stop = world.time + 3.0
        yield from push(
            arm, -0.05 * UP, lambda: world.time > stop or world.touching("robot", "slot"), CLOSED, give_up=4.0
        )
        yield from self.leave(arm)

    def _flat_side(self, world: World) -> Plan:
        """Close the jaw across the width of the box, and carry on."""
        arm, top = world.arm, world.pos("box") + self.box.size[2] * UP
        yield from pick(arm, top + 0.01 * UP, world.rot("box")[:, 1], above=0.08, lift=LIFT)
        with suppress(GaveUp):
            yield from self.insert(arm)
        yield from self.leave(arm)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """A slot that is too short; a box so slippery that the jaw cannot hold it."""
        short, slippery = replace(self.slot, length=self.slot.length - SHORT), replace(self.box, friction=SLIPPERY)
        return {"short_slot": self._scene(self.box, short), "slippery_box": self._scene(slippery, self.slot)}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        thickness, _, height = self.box.size
        yield on_table("the box", self._footprint)
        yield on_table("the slot", self._outline)
        apart = gap(self._footprint, self._outline)
        yield require(apart > APART, "the box stands in the slot's place", apart=apart)
        widest = OPEN_GAP - SPARE_GAP
        yield require(thickness < widest, "the box is too thick for the jaw", thickness=thickness, most=widest)
        grip, weight = self.box.friction * pinch(thickness), GRAVITY * self.box.mass
        yield require(grip > HOLDS * weight, "the box slips out of the jaw", grip=grip, weight=weight)
        yield require(self.passes > PASSES, "the box jams between both walls", room=self.passes, least=PASSES)
        yield within_reach("the box", self.start + (height - BELOW + LIFT) * UP)
        yield within_reach("the slot", self.seat + (OVER + height / 2) * UP)

    def features(self) -> Mapping[str, float]:
        """How the box is held over its weight, its size, room in the slot, how flat it gets, the slot's direction."""
        return {
            "weight_on_friction": GRAVITY * self.box.mass / (self.box.friction * pinch(self.box.size[0])),
            "size": self.box.scale,
            "room": self.clearance / self.box.size[2],
            "flattest": self.flattest,
            "direction": math.atan2(self.out[1], self.out[0]),
            "turn": math.radians(math.remainder(self.slot_yaw - self.box_yaw, 180.0)),
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def flattest(self) -> float:
        """Angle to the level at which the box is let go: the palm is 5 mm over the table then [rad]."""
        behind = self.box.size[2] - BELOW + PALM_ABOVE
        return math.atan2(PALM_ALONG - self.box.size[0] / 2 + UNDER_THE_PALM, behind) + SPARE

    @property
    def passes(self) -> float:
        """Room that a box has along the slot which leans on the far wall, its near end on the near wall's edge [m]."""
        height, depth = self.box.size[2], self.slot.depth
        leans = math.asin(depth / height)
        return self.slot.length - height * math.cos(leans) - depth * math.tan(leans)

    @property
    def rim(self) -> float:
        """Height of the slot's walls [m]."""
        return TABLE_TOP + self.slot.floor + self.slot.depth

    @cached_property
    def out(self) -> Vec3:
        """Along the slot, away from where the box comes from."""
        side = math.copysign(1.0, self.slot_y - self.box_y)
        yaw = math.radians(self.slot_yaw)
        return side * np.array([-math.sin(yaw), math.cos(yaw), 0.0])
