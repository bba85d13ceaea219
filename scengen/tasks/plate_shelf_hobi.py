"""T05 plate-shelf-hobi."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from ..assets.dish import Dish
from ..assets.prop import TABLE_TOP
from ..geometry import UP, Mat3, Vec3, corners, gap, rotation
from ..params import param
from ..physics import GRAVITY
from ..robots import panda
from ..robots.jaw import PAD, PALM_ABOVE, PALM_ALONG, TIP, pinch
from ..scenario import Plan, Refutation, Shortcut, on_table, require, within_reach
from ..sim.world import Arm, World
from ..skills import jaw
from ..skills.handover import OVERLAP, STAND_OFF, take_rim
from ..skills.motion import CLOSED, COARSE, OPEN, STEADY, Pace, alone, facing_down, go_to, hold, retreat, together, until
from .plate_and_slot import AIR, LEFT, OVER, PlateAndSlot

UNDER_THE_PALM = 0.008
PRESS_AT = 0.008
PRESSING = Pace(0.04, 0.0)
DEEPER = 0.008
ASIDE: Vec3 = np.array([-0.15, 0.35, TABLE_TOP + 0.35])
LIFT = Pace(0.10, 0.01)


@dataclass(frozen=True, kw_only=True)
class PlateShelfHobi(PlateAndSlot):
    """A plate on the table and a shelf with a slot."""

    plate_x: float = param(-0.14, "m", -0.3, 0.2)
    plate_y: float = param(-0.03, "m", -0.35, 0.35)
    shelf_x: float = param(0.10, "m", -0.1, 0.3)
    shelf_y: float = param(0.05, "m", -0.3, 0.3)
    shelf_yaw: float = param(0.0, "deg", -90.0, 90.0, period=180.0)
    plate: Dish = Dish()
    gap: float = param(0.036, "m", 0.02, 0.09)
    proud: float = param(0.04, "m", 0.0, 0.1)

    def oracle(self, world: World) -> Plan:
        presser, taker = self.roles(world)
        yield from self.both(world, self.press(presser), self.wait_beside(taker))
        yield from take_rim(taker, lambda: self.rim(world), self.gripping(world))
        yield from alone(presser, self.leave(presser))
        yield from alone(taker, go_to(taker, taker.hand + 0.25 * UP, pace=LIFT))
        yield from alone(taker, self.put_on_edge(taker))
        yield from alone(taker, self.put_in(taker))

    def roles(self, world: World) -> tuple[Arm, Arm]:
        right, left = world.arms
        return (right, left) if self.side > 0 else (left, right)

    def both(self, world, presser_plan, taker_plan) -> Plan:
        plans = (presser_plan, taker_plan)
        yield from together(world, *(plans if self.side > 0 else plans[::-1]))

    @property
    def side(self) -> float:
        return math.copysign(1.0, self.shelf_y)

    def tilt(self, world) -> float:
        return math.asin(float(self.outwards(world) @ UP))

    def outwards(self, world) -> Vec3:
        normal, out = world.rot("plate")[:, 2], self.side * LEFT
        along = out - (out @ normal) * normal
        return along / math.sqrt(along @ along)

    def rim(self, world) -> Vec3:
        middle = self.plate.rise + self.plate.thickness / 2
        return world.pos("plate") + middle * world.rot("plate")[:, 2] + self.plate.radius * self.outwards(world)

    def press(self, arm: Arm) -> Plan:
        world = arm.world
        at = self.start - self.side * (self.plate.radius - PRESS_AT) * LEFT
        down = facing_down()
        yield from go_to(arm, at + (self.plate.height + TIP + 0.03) * UP, down, STEADY, CLOSED)
        below = at + (self.plate.thickness + TIP - DEEPER) * UP
        yield from until(go_to(arm, below, down, PRESSING, CLOSED), lambda: self.tilt(world) > 0.96 * self.plate.slope)

    def wait_beside(self, arm: Arm) -> Plan:
        hand = self.hand(2 * self.plate.slope)
        slope = self.plate.slope
        out = self.side * (self.plate.foot * (math.cos(slope) - 1)+ self.plate.radius * math.cos(slope)) * LEFT
        rim = self.start + out + self.plate.raised * UP
        yield from go_to(arm, rim - STAND_OFF * hand[:, 2], hand, STEADY, OPEN)

    def hand(self, tilt: float) -> Mat3:
        level = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -self.side], [-self.side, 0.0, 0.0]])
        return rotation(np.array([self.side * tilt, 0, 0])) @ level

    def gripping(self, world) -> Mat3:
        return self.hand(self.plate.slope + self.tilt(world))

    def leave(self, arm: Arm) -> Plan:
        yield from retreat(arm, 0.10)
        yield from go_to(arm, ASIDE * [1, -self.side, 1], pace=COARSE)

    def shortcuts(self): return {}
    def ablations(self): return {}
