"""X01 push-block: push a block past a line, without touching anything but it and without grasping it.

    robot   hand > [block] ........ | line

Bottleneck: how far and how hard depends on a distance that differs from scene to scene.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from scengen.assets.box import Block
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.geometry import UP
from scengen.params import param
from scengen.predicates import fallen
from scengen.scenario import Plan, Refutation, Scenario, Shortcut, on_table
from scengen.sim.arm import ROBOT
from scengen.sim.world import World
from scengen.skills.jaw import poke


@dataclass(frozen=True, kw_only=True)
class PushBlock(Scenario):
    """A block on the table, and a line across it."""

    VERSION = 1

    y: float = param(-0.10, "m", -0.4, 0.4)
    distance: float = param(0.12, "m", 0.0, 0.6)
    """From the block to the line, along y."""
    block: Block = Block(friction=0.4, mass=0.15)

    def build(self) -> mujoco.MjSpec:
        scene = table()
        place(scene, self.block, "block", [0.0, self.y, TABLE_TOP])
        return scene

    def success(self, world: World) -> bool:
        return bool(world.com("block")[1] >= self.y + self.distance and world.tilt("block") < 0.1)

    def failure(self, world: World) -> str | None:
        return "the block fell" if fallen(world, "block") else None

    def oracle(self, world: World) -> Plan:
        """Push until it is done."""
        yield from self.push_to(world, self.distance)

    def push_to(self, world: World, way: float) -> Plan:
        """Push the block from half its height until it has gone so far [m]."""
        beside = np.array([0.0, self.y - self.block.width / 2 - 0.03, TABLE_TOP + 0.03])
        yield from poke(world.arm, beside, np.array([0.0, 0.1, 0.0]), lambda: world.com("block")[1] >= self.y + way)

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "push_halfway": Shortcut(lambda world: self.push_to(world, self.distance / 2)),
            "press_from_above": Shortcut(self._press),
        }

    def _press(self, world: World) -> Plan:
        above = world.com("block") + (self.block.height / 2 + 0.02) * UP
        down = np.array([0.0, 0.0, -0.05])
        yield from poke(world.arm, above, down, lambda: world.touching(ROBOT, "block"), rot=world.arm.hand_rot)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        scene = self.build()
        scene.body("block").pos = [0.3, self.y, TABLE_TOP]
        return {"block_elsewhere": scene}

    def constraints(self) -> Iterator[Refutation | None]:
        yield on_table("the line", [0.0, self.y + self.distance], margin=0.05)
