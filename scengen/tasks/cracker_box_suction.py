"""T08 cracker-box-suction: lay a cracker box that stands upright flat into a slot, with a suction cup.

         ____
        |    |                                 The slot has the outline of the box' broad face, the one that is seen
        |    |              |            |     here, and four fifths of its thickness as its depth. From the side:
        |    |              |            |     the box stands on its smallest face, and has to lie in the slot.
    ----+----+--------------+------------+----

Bottleneck: the choice of the face. Taken by its top, the box goes in upright, or hangs beside a level hand, which meets
the slot's walls before the box is down. Only a cup on the broad face is above the box once it lies. At the start that
face is upright: the hand must come level and square, else the lip does not seal and the box is pushed along; and
friction alone carries the box until it has been turned flat.

Decisions, where the paper (App. B, T08) says no more than "a horizontal slot fixture" and "its centroid aligned":

* The slot is a pocket with the outline of the broad face, in which the box lies flat: only then is the broad face the
  right one, and the descent "uniform". A cup's lip on a side face ends at least 30 mm under the upper edge, so that the
  slot's wall stops the cup while the box has 1 to 2 cm left to fall.
* If a corner of the box goes down faster than 0.35 m/s, as of a box that falls from 6 mm, its crackers break: neither
  knocking it over nor dropping it is a way. No hand lowers anything faster than 0.3 m/s.
* The cup lays the box down by a broad face. A small box that is held by its top in the air stays on the cup: laid askew
  on the slot's walls and let go, it shows its broad face upwards.
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
from ..errors import GaveUp
from ..geometry import UP, Mat3, Vec3, axes, gap, shortest, way_to
from ..means import Mean, once, throughout, when
from ..params import param
from ..physics import GRAVITY
from ..predicates import borne, fallen, seated
from ..robots.suction import CUP_HALF_WIDTH, PULL, TORQUE
from ..scenario import Plan, Planner, Refutation, Shortcut, on_table, require, within_reach
from ..sim.arm import Arm
from ..sim.world import World
from ..skills.jaw import poke
from ..skills.motion import CLOSED, COARSE, OPEN, STEADY, Pace, facing, go_to, push, retreat, turn_to, until
from ..skills.suction import STAND_OFF, carry_to, let_go, suck_upright, take
from .cracker_box import FLAT_TOLERANCE, HEIGHT_TOLERANCE, BoxAndSlot

SEAT_TOLERANCE = 0.006  # largest distance of the box' middle from its seat along the table [m]
MAX_FALL_SPEED = 0.35  # speed of a corner on its way down above which the crackers break [m/s]
LEANING = math.radians(30.0)  # tilt above which a box does not stand [rad]
SEATED = 0.03, 0.010  # distances from its seat, along the table and in height, within which a box is in the slot [m]
GRIP_SHARE = 0.6
"""Share of the box' height at which the cup takes it. It is so high that links 6 and 7, which reach 47 mm below the
middle of a level cup, pass over the slot, and so low that the box slides along: it tips where the friction exceeds
thickness / (2 height), 0.28."""
LIFT_PACE = Pace(0.15, 0.01)  # pace at which the box is lifted once it is off the table
TIP_SPEED = 0.8  # speed at which the box is turned flat [rad/s]
TURN_TOLERANCE = 0.1
"""Angle within which the hand is turned [rad]: under a load the wrist stays a few degrees short, and the moves that
follow look at the box."""
CARRY_HEIGHT = 0.02  # height of the box over the slot's walls before it is lowered [m]


@dataclass(frozen=True, kw_only=True)
class CrackerBoxSuction(BoxAndSlot):
    """A box of crackers that stands on the table, and a slot."""

    VERSION = 2
    HOLD = 0.5

    box_x: float = param(-0.13, "m", -0.4, 0.4)
    box_y: float = param(0.13, "m", -0.4, 0.4)
    box_yaw: float = param(0.0, "deg", -90.0, 90.0, period=180.0)  # yaw of the box: at 0 its broad faces look along y
    slot_x: float = param(0.08, "m", -0.4, 0.4)
    slot_y: float = param(-0.06, "m", -0.4, 0.4)
    slot_yaw: float = param(0.0, "deg", -90.0, 90.0, period=180.0)  # yaw of the slot: at 0 its long side is along y
    clearance: float = param(0.004, "m", 0.0005, 0.02)  # gap between the box in the middle of the slot and each wall
    box: CrackerBox = CrackerBox(friction=0.21)

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        flat = abs(world.rot("box")[2, 0]) > math.cos(FLAT_TOLERANCE)
        return flat and seated(world, "box", "slot", self.seat, SEAT_TOLERANCE, HEIGHT_TOLERANCE)

    def failure(self, world: World) -> str | None:
        return "the box fell off the table" if fallen(world, "box") else None

    def in_slot(self, world: World) -> bool:
        """Whether the box is near its seat."""
        off, (aside, high) = world.com("box") - self.seat, SEATED
        return math.hypot(off[0], off[1]) <= aside and abs(off[2]) <= high

    def fall_speed(self, world: World) -> float:
        """Speed of the box' fastest corner on its way down [m/s]."""
        velocity, rot = world.velocity("box"), world.rot("box")
        turning = velocity[0] * rot[1] - velocity[1] * rot[0]  # z of the turn's velocity at the tip of each axis
        return float(np.abs(turning) @ self.box.size / 2 - velocity[5])

    def means(self) -> Mapping[str, Mean]:
        def leans(world: World) -> bool:
            return world.tilt("box") >= LEANING

        return {
            "the box did not fall": throughout(lambda world: self.fall_speed(world) <= MAX_FALL_SPEED),
            "the cup lifted the upright box by a broad face": once(
                lambda world: not leans(world) and borne(world, world.arm, "box") and self.by_broad_face(world)
            ),
            "the cup on a broad face laid the box down": throughout(
                lambda world: not leans(world) or self.in_slot(world) or self.by_broad_face(world)
            ),
            "the cup still pulled when the box was down": when(
                lambda world: leans(world) and abs(world.com("box")[2] - self.seat[2]) < HEIGHT_TOLERANCE,
                lambda world: world.arm.grips("box"),
            ),
        }

    def by_broad_face(self, world: World) -> bool:
        """Whether the cup pulls at a broad face of the box."""
        facing_it = abs(float(world.arm.hand_rot[:, 2] @ world.rot("box")[:, 0])) > math.cos(LEANING)
        return facing_it and world.arm.grips("box")

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Take the box by its broad face, turn it flat, bring it over the slot, lower it evenly, let go."""
        arm = world.arm
        yield from self.take(arm)
        yield from self.tip(arm)
        yield from self.bring(arm, self.laid(world))
        yield from self.lower(arm, self.laid(world))
        yield from let_go(arm)

    def take(self, arm: Arm) -> Plan:
        """Bring the level cup in front of the broad face that looks at the robot's middle; take hold, and lift."""
        face, out = self.broad_face(arm.world)
        level = facing(math.atan2(out[1], out[0]), 0.0)
        # The hand draws back from the box and up before it turns: it swings out by 8 cm.
        away = np.array([0.0, -0.09, 0.06]) * [1.0, math.copysign(1.0, self.box_y), 1.0]
        yield from go_to(arm, arm.hand + away, pace=COARSE, grip=OPEN)
        yield from turn_to(arm, level, 1.2, grip=OPEN, within=TURN_TOLERANCE)
        yield from go_to(arm, face - 5 * STAND_OFF * out, level, Pace(0.25, 0.02), OPEN)
        yield from suck_upright(arm, face, level)
        yield from retreat(arm, 0.02, Pace(0.05, 0.005))  # slow off the table: a jerk peels the box off
        yield from retreat(arm, self.slot.depth + self.box.size[2] / 2, LIFT_PACE)

    def broad_face(self, world: World) -> tuple[Vec3, Vec3]:
        """Position at which the cup takes the box [m], and the direction in which the hand looks there."""
        thickness, _, height = self.box.size
        thin = world.rot("box")[:, 0]
        out = math.copysign(1.0, float(thin[1] * world.pos("box")[1])) * thin
        return world.pos("box") + GRIP_SHARE * height * UP - thickness / 2 * out, out

    def tip(self, arm: Arm) -> Plan:
        """Turn the level hand down, and the box with it, where the arm's joints allow it."""
        # At least that far out along x: at -0.18 joint 4 meets its limit.
        yield from go_to(arm, [max(arm.hand[0], -0.08), *arm.hand[1:]], pace=LIFT_PACE)
        yield from turn_to(arm, axes(arm.hand_rot[:, 0], -UP), TIP_SPEED, within=TURN_TOLERANCE)

    def bring(self, arm: Arm, rot: Mat3) -> Plan:
        """Bring the box over the slot's walls, turned to `rot`."""
        for pace in (STEADY, Pace(0.05, 0.001)):
            yield from carry_to(arm, "box", self.origin(rot, self.slot.depth + CARRY_HEIGHT), rot, pace)

    def lower(self, arm: Arm, rot: Mat3) -> Plan:
        """Lower the box, turned to `rot`, until it lies on the slot's floor."""
        # Its way ends 3 mm below the floor; if something is in the way, the hand may lag by 2 mm.
        descent = carry_to(arm, "box", self.origin(rot, -0.003), rot, Pace(0.06, 0.0, 4.0), 0.002)
        yield from until(descent, lambda: arm.world.com("box")[2] - self.seat[2] < 0.0015)

    def laid(self, world: World) -> Mat3:
        """Orientation of the box in the slot that needs the least turn from how it is now."""
        now, along = world.rot("box"), world.rot("slot")[:, 1]
        tall = math.copysign(1.0, float(now[:, 2] @ along)) * along
        return axes(math.copysign(1.0, now[2, 0]) * UP, tall)

    def origin(self, rot: Mat3, above: float) -> Vec3:
        """Position of the box' origin with its middle over the middle of the slot, `above` its seat [m]."""
        return self.seat + above * UP - self.box.size[2] / 2 * rot[:, 2]

    def steps(self) -> Mapping[str, Planner]:
        return {
            "take_face": lambda world: self.take(world.arm),
            "turn_flat": lambda world: self.tip(world.arm),
            "bring": lambda world: self.bring(world.arm, self.laid(world)),
            "lower": lambda world: self.lower(world.arm, self.laid(world)),
            "let_go": lambda world: let_go(world.arm),
            "take_top": lambda world: self._take_top(world.arm),
            "drop_box": self._let_drop,
            "knock_over": self._knock_over,
        }

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        """Not turning the box is tempting, and wrong, if the slot is turned from how the box comes."""
        # From 5 deg on a box that is not turned stays on the slot's walls: 2 deg take up all clearance.
        return {
            "upright_into_the_slot": Shortcut(self._insert_upright),
            "flat_by_the_top": Shortcut(self._lay_by_top),
            "knock_it_over": Shortcut(self._knock_over),
            "let_it_drop": Shortcut(self._let_drop),
            **({"as_it_comes": Shortcut(self._lay_unturned)} if self.misfit > 5.0 else {}),
        }

    def _take_top(self, arm: Arm, beside: float = 0.0) -> Plan:
        """Take the box by its top, `beside` [m] behind the middle, and lift it over the slot's walls."""
        world = arm.world
        _, out = self.broad_face(world)
        top = world.pos("box") + self.box.size[2] * UP + beside * out
        down = axes(facing(math.atan2(out[1], out[0]), 0.0)[:, 0], -UP)
        yield from take(arm, top, down, 0.04)
        yield from retreat(arm, self.slot.depth + 2 * CARRY_HEIGHT, LIFT_PACE)

    def _insert_upright(self, world: World) -> Plan:
        """Take the box by its top, and put it into the slot as it stands."""
        arm, along = world.arm, world.rot("slot")[:, 1]
        yield from self._take_top(arm)
        thin = math.copysign(1.0, float(world.rot("box")[:, 0] @ along)) * along
        above = self.foot + (self.slot.floor + self.slot.depth + CARRY_HEIGHT) * UP
        yield from carry_to(arm, "box", above, axes(thin, UP), STEADY)
        yield from push(arm, -0.05 * UP, lambda: world.touching("box", "slot"), CLOSED, give_up=5.0)
        yield from let_go(arm)

    def _lay_by_top(self, world: World) -> Plan:
        """Take the box by its top, turn the hand level, lower the box until something stops the hand, let go."""
        arm = world.arm
        yield from self._take_top(arm, self.box.size[0] / 2 - CUP_HALF_WIDTH)
        yield from retreat(arm, self.box.size[2] / 2, LIFT_PACE)
        yield from turn_to(arm, axes(arm.hand_rot[:, 0], self.broad_face(world)[1]), TIP_SPEED)
        with suppress(GaveUp):
            yield from self.bring(arm, self.laid(world))
            yield from self.lower(arm, self.laid(world))
        yield from let_go(arm)

    def _knock_over(self, world: World) -> Plan:
        """Push the box at its top."""
        face, out = self.broad_face(world)
        high = world.pos("box")[2] + 0.9 * self.box.size[2]
        start = np.array([*(face - (CUP_HALF_WIDTH + 0.03) * out)[:2], high])
        falls = math.radians(25.0)  # from 18 on the box tips over by itself: tan = thickness / height
        yield from poke(world.arm, start, 0.15 * out, lambda: world.tilt("box") > falls)

    def _let_drop(self, world: World) -> Plan:
        """Do as the oracle does, but let the box fall into the slot."""
        yield from self.take(world.arm)
        yield from self.tip(world.arm)
        yield from self.bring(world.arm, self.laid(world))
        yield from let_go(world.arm)

    def _lay_unturned(self, world: World) -> Plan:
        """Do as the oracle does, but without turning the box to the direction of the slot."""
        arm = world.arm
        yield from self.take(arm)
        yield from self.tip(arm)
        flat = shortest(math.copysign(1.0, world.rot("box")[2, 0]) * world.rot("box")[:, 0], UP) @ world.rot("box")
        with suppress(GaveUp):
            yield from self.bring(arm, flat)
            yield from self.lower(arm, flat)
        yield from let_go(arm)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """A slot that is 20 mm too short; a face so slippery that the cup, which then holds 0.8 N, cannot carry it."""
        short, slippery = replace(self.slot, length=self.slot.length - 0.02), replace(self.box, friction=0.02)
        return {"short_slot": self._scene(self.box, short), "slippery_box": self._scene(slippery, self.slot)}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        yield on_table("the box", self._box_outline)
        yield on_table("the slot", self._slot_outline)
        apart, high = gap(self._box_outline, self._slot_outline), GRIP_SHARE * self.box.size[2]
        yield require(apart > 0.01, "the box stands in the slot's place", apart=apart)
        steady, friction = 0.9 * self.box.size[0] / (2 * high), self.box.friction  # 0.9 of that at which it would tip
        yield require(friction < steady, "the box tips when the cup is pressed on", friction=friction, most=steady)
        grip, weight = self.box.friction * PULL, GRAVITY * self.box.mass
        # At 1.2 times its weight half of the boxes slip off.
        yield require(grip > 1.4 * weight, "the box slips off a cup on its side", grip=grip, weight=weight)
        torque = weight * self.box.size[0] / 2
        # At 1.4 times its torque about the face most boxes are peeled off by the lift.
        yield require(TORQUE > 1.5 * torque, "the box peels a cup off its side", torque=torque, most=TORQUE)
        yield within_reach("the box", self.start + high * UP)
        yield within_reach("the slot", self.seat + (self.slot.depth + CARRY_HEIGHT + self.box.size[0] / 2) * UP)

    def features(self) -> Mapping[str, float]:
        """Weight over what friction holds, tendency to tip, size, clearance in the slot, turn, and azimuth."""
        return {
            "weight_on_friction": GRAVITY * self.box.mass / (self.box.friction * PULL),
            "tipping": self.box.friction * self.box.size[2] / self.box.size[0],
            "size": self.box.scale,
            "room": self.clearance / self.box.size[2],
            "turn": math.radians(self.misfit),
            "azimuth": math.radians(self.box_yaw + math.copysign(90.0, self.box_y)),
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "box": way_to(self.start, self.foot),
            "apart": math.dist(self.start, self.foot),
            "height": float(self.box.size[2]),
            "turn": self.misfit,
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def misfit(self) -> float:
        """Angle between the long side of a box that is turned down as it comes, and that of the slot [deg]."""
        return abs(math.remainder(self.slot_yaw - self.box_yaw, 180.0))
