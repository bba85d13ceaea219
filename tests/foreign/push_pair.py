"""X02 push-pair: two arms push a block each past a line, side by side.

    left    hand > [left] ........ | line
    right   hand > [right] ....... | line

Bottleneck: the blocks must stay abreast of each other, so that neither arm can do its work before the other.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from scengen.assets.box import Block
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.params import param
from scengen.predicates import fallen
from scengen.scenario import Plan, Refutation, Scenario, Shortcut, on_table
from scengen.sim.arm import Arm
from scengen.sim.world import World
from scengen.skills.jaw import poke
from scengen.skills.motion import alone, together

SIDES = {"right": -0.25, "left": 0.25}
"""y of the block before each arm [m], in the order of the arms."""
ABREAST = 0.04
"""How far one block may be ahead of the other [m]."""


@dataclass(frozen=True, kw_only=True)
class PushPair(Scenario):
    """Two blocks on the table, and a line across it."""

    VERSION = 1

    x: float = param(-0.10, "m", -0.3, 0.3)
    distance: float = param(0.10, "m", 0.0, 0.4)
    """From the blocks to the line, along x."""
    block: Block = Block(friction=0.4, mass=0.15)

    def build(self) -> mujoco.MjSpec:
        scene = table()
        for name, y in SIDES.items():
            place(scene, self.block, name, [self.x, y, TABLE_TOP])
        return scene

    def success(self, world: World) -> bool:
        return all(world.com(name)[0] >= self.x + self.distance and world.tilt(name) < 0.1 for name in SIDES)

    def failure(self, world: World) -> str | None:
        if lost := fallen(world, *SIDES):
            return f"the {lost} block fell"
        right, left = (world.com(name)[0] for name in SIDES)
        return "one block went ahead of the other" if abs(right - left) > ABREAST else None

    def oracle(self, world: World) -> Plan:
        """Push both at once until it is done."""
        yield from together(world, *(self.push_to(arm, self.distance) for arm in world.arms))

    def push_to(self, arm: Arm, way: float) -> Plan:
        """Push the block before an arm from half its height until it has gone so far [m]."""
        world, name, y = arm.world, [*SIDES][arm.number], [*SIDES.values()][arm.number]
        behind = np.array([self.x - self.block.width / 2 - 0.03, y, TABLE_TOP + 0.03])
        yield from poke(arm, behind, np.array([0.1, 0.0, 0.0]), lambda: world.com(name)[0] >= self.x + way)

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "right_arm_alone": Shortcut(lambda world: self.in_turn(world, 1)),
            "one_arm_after_the_other": Shortcut(lambda world: self.in_turn(world, 2)),
            "push_halfway": Shortcut(
                lambda world: together(world, *(self.push_to(arm, self.distance / 2) for arm in world.arms))
            ),
        }

    def in_turn(self, world: World, count: int) -> Plan:
        """The first so many arms, one after the other."""
        for arm in world.arms[:count]:
            yield from alone(arm, self.push_to(arm, self.distance))

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        scene = self.build()
        scene.body("left").pos = [0.3, SIDES["left"], TABLE_TOP]
        return {"left_block_elsewhere": scene}

    def constraints(self) -> Iterator[Refutation | None]:
        yield on_table("the line", [self.x + self.distance, 0.0], margin=0.05)
