"""T04 cup-inversion."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from ..assets.cup import Cup
from ..assets.patch import Patch
from ..assets.prop import TABLE_TOP, place, table
from ..geometry import UP, Mat3, Vec3, corners, gap, quat, shortest
from ..params import param
from ..predicates import fallen
from ..robots import panda
from ..robots.jaw import OPENING, PAD, pinch
from ..robots.suction import REACHES
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import ROBOT, Arm, World
from ..skills import jaw, suction
from ..skills.handover import hand_over
from ..skills.motion import (
    CLOSED,
    COARSE,
    FINE,
    OPEN,
    STEADY,
    Pace,
    alone,
    facing,
    facing_down,
    go_to,
    hold,
    push,
    retreat,
    together,
    turn_to,
    until,
)

UPRIGHT = math.radians(8.0)
LYING = (math.radians(25.0), math.radians(155.0))
TURNED_OVER = quat("x", math.pi)
OUT: Mat3 = facing(math.pi / 2, 0.0)
SIDEWAYS: Mat3 = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
MEETING: Vec3 = np.array([-0.15, -0.05, TABLE_TOP + 0.25])
ASIDE: Vec3 = np.array([-0.15, -0.35, TABLE_TOP + 0.35])


@dataclass(frozen=True, kw_only=True)
class CupInversion(Scenario):
    """A cup upside down on the table, and a green square."""

    HOLD = 0.5

    x: float = param(-0.05, "m", -0.4, 0.4)
    y: float = param(-0.10, "m", -0.4, 0.4)
    goal_x: float = param(0.0, "m", -0.4, 0.4)
    goal_y: float = param(0.12, "m", -0.4, 0.4)
    cup: Cup = Cup(height=0.09, base=0.043, rim=0.055, friction=0.06, handle_friction=0.8)
    patch: Patch = Patch(size=0.14)

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.cup)

    def _scene(self, cup: Cup) -> mujoco.MjSpec:
        scene = table()
        scene.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
        place(scene, cup, "cup", self.start + cup.height * UP, turn=TURNED_OVER)
        place(scene, self.patch, "patch", self.goal, free=False)
        return scene

    def success(self, world: World) -> bool:
        off = np.abs(world.pos("cup") - self.goal)[:2].max()
        stands = world.touching("cup", "table") and not world.touching(ROBOT, "cup")
        return stands and world.tilt("cup") < UPRIGHT and bool(off < self.room)

    def failure(self, world: World) -> str | None:
        if fallen(world, "cup"):
            return "the cup fell off the table"
        low, high = LYING
        if world.touching("cup", "table") and low < world.tilt("cup") < high:
            return "the cup was knocked over"
        return None

    def oracle(self, world: World) -> Plan:
        giver, taker = world.arms
        yield from together(world, self.present(giver), self.wait_beside(taker))
        yield from hand_over(giver, taker, lambda: self.rim(world), SIDEWAYS)
        yield from alone(giver, self.leave(giver))
        yield from alone(taker, self.set_down(taker))

    def present(self, arm: Arm) -> Plan:
        yield from self.lift(arm)
        yield from turn_to(arm, OUT, 1.0, grip=CLOSED)
        rot = shortest(arm.world.rot("cup")[:, 2], np.array([0, 1.0, 0])) @ arm.world.rot("cup")
        yield from suction.carry_to(arm, "cup", MEETING, rot, Pace(0.2, 0.004))

    def lift(self, arm: Arm) -> Plan:
        base = arm.world.pos("cup")
        down = facing_down(math.pi / 2)
        yield from go_to(arm, base + 0.03 * UP, down, STEADY, OPEN)
        yield from suction.suck(arm, base, down)
        yield from go_to(arm, arm.hand + 0.15 * UP, pace=Pace(0.15, 0.02))

    def rim(self, world: World) -> Vec3:
        along = world.rot("cup")[:, 2]
        up = UP - along[2] * along
        return world.pos("cup") + self.cup.height * along + (self.cup.rim - self.cup.bead / 2) * up / np.linalg.norm(up)

    def wait_beside(self, arm: Arm) -> Plan:
        at = MEETING + [0.0, self.cup.height + 0.10, self.cup.rim]
        yield from go_to(arm, at, SIDEWAYS, STEADY, OPEN)

    def leave(self, arm: Arm) -> Plan:
        yield from go_to(arm, arm.hand - 0.08 * arm.hand_rot[:, 2], pace=COARSE)

    def set_down(self, arm: Arm) -> Plan:
        world = arm.world
        yield from turn_to(arm, facing_down(), 0.8)
        com = world.com("cup") - world.pos("cup")
        rot = shortest(world.rot("cup")[:, 2], UP) @ world.rot("cup")
        height = self.cup.inertial()[0][2]
        yield from jaw.carry(arm, "cup", self.goal + (height + 0.06) * UP, rot, STEADY)
        yield from jaw.put(arm, "cup", self.goal + height * UP, "table", hover=0.04)
        yield from retreat(arm)

    def constraints(self) -> Iterator[Refutation | None]:
        yield on_table("the cup", corners(self.start, 0.0, 2 * [2 * self.cup.rim]))

    @property
    def start(self) -> Vec3:
        return np.array([self.x, self.y, TABLE_TOP])

    @property
    def goal(self) -> Vec3:
        return np.array([self.goal_x, self.goal_y, TABLE_TOP])

    @property
    def room(self) -> float:
        return self.patch.size / 2 - self.cup.base
