"""X01 push-block: push a block past a line, without touching anything but it and without grasping it.

    robot   hand > [block] ........ | line

Bottleneck: how far and how hard depends on a distance that differs from scene to scene.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from scengen.assets.box import Block
from scengen.assets.prop import TABLE_HALF, TABLE_TOP, UP, place, table
from scengen.params import param
from scengen.scenario import Plan, Planner, Refutation, Scenario
from scengen.sim.world import World
from scengen.skills.motion import CLOSED, facing_down, go_to, push


@dataclass(frozen=True, kw_only=True)
class PushBlock(Scenario):
    """A block on the table, and a line across it."""

    y: float = param(-0.10, "m", -0.4, 0.4)
    distance: float = param(0.12, "m", 0.0, 0.6)
    """From the block to the line, along y."""
    block: Block = Block(friction=0.4, mass=0.15)

    def infeasible(self) -> Refutation | None:
        if (line := self.y + self.distance) > TABLE_HALF - 0.05:
            return Refutation("the line lies off the table", {"line": line, "edge": TABLE_HALF})
        return None

    def build(self) -> mujoco.MjSpec:
        scene = table()
        place(scene, self.block, "block", [0.0, self.y, TABLE_TOP])
        return scene

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        scene = self.build()
        scene.body("block").pos = [0.3, self.y, TABLE_TOP]
        return {"the block elsewhere": scene}

    def success(self, world: World) -> bool:
        return bool(world.com("block")[1] >= self.y + self.distance and world.tilt("block") < 0.1)

    def failure(self, world: World) -> str | None:
        return "the block fell" if world.pos("block")[2] < TABLE_TOP - 0.05 else None

    def oracle(self, world: World) -> Plan:
        """Push until it is done."""
        yield from self._approach(world)
        yield from push(world, [0, 0.1, 0], until=lambda: self.success(world), give_up=6.0)

    def shortcuts(self) -> Mapping[str, Planner]:
        return {"push halfway": self._halfway, "press from above": self._press}

    def _halfway(self, world: World) -> Plan:
        yield from self._approach(world)
        yield from push(world, [0, 0.1, 0], until=lambda: world.com("block")[1] > self.y + self.distance / 2)

    def _press(self, world: World) -> Plan:
        above = world.com("block") + (self.block.height / 2 + 0.02) * UP
        yield from go_to(world, above, facing_down(), grip=CLOSED)

    def _approach(self, world: World) -> Plan:
        """The closed finger tips on the near side of the block, at half its height."""
        beside = np.array([0.0, self.y - self.block.width / 2 - 0.03, TABLE_TOP + 0.03])
        yield from go_to(world, beside + 0.08 * UP, facing_down(), grip=CLOSED, within=0.01)
        yield from go_to(world, beside, facing_down(), grip=CLOSED)
