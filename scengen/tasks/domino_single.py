"""T17 domino-single: knock over a slab you may not touch, by toppling a chain that leads to it.

    hand ->  | | | | |  []          seen from the side; the chain runs along +u
             0 1 2 3 4  slab

Bottleneck: the push is local, its effect is not. Each falling tile must reach the next one.

The bypass. The paper forbids touching the slab only, and notes (App. on task-specific behaviours) that policies
then knock over a tile in the middle instead of the first: pushing the last tile solves almost every scene, and
nothing is left of the causal chain. Here the robot may touch the first tile and no other, and topple it, not carry
it: else the starter in the jaw knocks over the slab, or the last tile, without any chain. Both are latched failures
like touching the slab. The paper's canonical plan is unaffected; the shortcuts below show that the bypass is closed.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..assets.box import Domino
from ..assets.prop import TABLE_TOP, place, table
from ..geometry import UP, Vec3, heading
from ..params import param
from ..predicates import carried, displaced, touched_only
from ..robots.jaw import FINGER_ACROSS
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import ROBOT, World
from ..skills.jaw import pick, poke
from ..skills.motion import COARSE, FINE, go_to, push, wait

CARRIED = 0.01
"""How far the foot of the starter may have moved while the robot still touches it [m]; in a topple less than 1 mm."""
SLAB_MOVES = 0.05
"""How far the slab's centre of mass must go, measured along the table [m] (paper, App. B, T17)."""


@dataclass(frozen=True, kw_only=True)
class DominoSingle(Scenario):
    """A straight chain of tiles and a red slab at its end; the first tile, the starter, may differ from the others."""

    count: int = param(5, "tiles", 2, 15)
    gap_ratio: float = param(0.9, "tile widths", 0.2, 2.5)
    heading: float = param(0.0, "deg", -180.0, 180.0, period=360.0)
    x: float = param(0.0, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    slab_yaw: float = param(0.0, "deg", -90.0, 90.0, period=180.0)
    starter: Domino = Domino(rgba=(0.95, 0.70, 0.25, 1.0))
    tile: Domino = Domino()
    slab: Domino = Domino(height=0.12, width=0.06, thickness=0.015, mass=0.06, rgba=(0.78, 0.10, 0.10, 1.0))

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene, yaw = table(), math.radians(self.heading)
        for i, piece in enumerate(self.pieces[:-1]):
            place(scene, piece, f"tile_{i}", self.spot(i), yaw)
        place(scene, self.slab, "slab", self.spot(self.count), yaw + math.radians(self.slab_yaw))
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return displaced(world, "slab", self.spot(self.count)) >= SLAB_MOVES

    def failure(self, world: World) -> str | None:
        if world.touched(ROBOT, "slab"):
            return "the robot touched the slab"
        if touched_only(world, "tile_0"):
            return "the robot touched a tile other than the first"
        if carried(world, "tile_0", self.spot(0), CARRIED):
            return "the robot carried the first tile away"
        return None

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Go behind the first tile, tip it past its balance point, step back, watch."""
        yield from self.topple(world, 0)
        yield from wait(world.arm, lambda: self.success(world), give_up=4.0)

    def topple(self, world: World, i: int) -> Plan:
        """Push tile `i` over along the chain with the closed finger tips, then step back.

        Behind any tile but the first the tips go into the middle of the gap.
        """
        tile = self.pieces[i]
        room = 0.02 if i == 0 else max(0.0, self.gap / 2 - FINGER_ACROSS)
        behind = self.spot(i) + 0.8 * tile.height * UP - (tile.thickness / 2 + FINGER_ACROSS + room) * self.u

        def falls() -> bool:
            return self._falling(world, i) or self._falling(world, i + 1)

        yield from poke(world.arm, behind, 0.08 * self.u, falls, above=0.12, pace=FINE)

    def _falling(self, world: World, i: int) -> bool:
        """Whether a piece is past its balance point for good. A stout one may strike its neighbour before that."""
        name = f"tile_{i}" if i < self.count else "slab"
        return world.tilt(name) > 1.3 * self.pieces[i].tipping_angle

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "push_the_slab": Shortcut(self._push_slab),
            "push_the_last_tile": Shortcut(lambda world: self.topple(world, self.count - 1)),
            "push_the_second_tile": Shortcut(lambda world: self.topple(world, 1)),
            "carry_the_starter_to_the_slab": Shortcut(lambda world: self._carry(world, self.count)),
            "carry_the_starter_to_the_last_tile": Shortcut(lambda world: self._carry(world, self.count - 1)),
        }

    def _push_slab(self, world: World) -> Plan:
        """Straight to the target: knock the slab over from the side."""
        side = np.array([-self.u[1], self.u[0], 0.0])
        beside = self.spot(self.count) + 0.8 * self.slab.height * UP + 0.08 * side
        yield from poke(world.arm, beside, -0.15 * side, lambda: self.success(world), above=0.12)

    def _carry(self, world: World, i: int) -> Plan:
        """Take the starter, which may be touched, over the chain and knock piece `i` over with its foot."""
        start, hit = self.spot(0), self.spot(i) + 0.8 * self.pieces[i].height * UP
        yield from pick(world.arm, start + 0.7 * self.starter.height * UP, np.cross(UP, self.u), above=0.06, lift=0.16)
        grip = 0.7 * self.starter.height * UP
        yield from go_to(world.arm, hit + grip + 0.12 * UP - 0.03 * self.u, pace=COARSE)
        yield from go_to(world.arm, hit + grip - (0.03 if i == self.count else 0.015) * self.u)
        yield from push(world.arm, 0.15 * self.u, lambda: self.success(world))

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Without the chain the first tile falls on nothing; one tile less may still be bridged by the others."""
        scene = self.build()
        for i in range(1, self.count):
            scene.delete(scene.body(f"tile_{i}"))
        return {"no_chain": scene}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        reaches, height = self.gap < self.tile.height, self.tile.height
        yield require(reaches, "a falling tile cannot reach its neighbour", gap=self.gap, height=height)
        ends = [self.spot(0) - self.tile.thickness * self.u, self.spot(self.count) + self.slab.height * self.u]
        yield on_table("the chain", ends)
        yield within_reach("the first tile", self.spot(0) + self.starter.height * UP)

    def features(self) -> Mapping[str, float]:
        """How far a tile leans when it strikes the next one, what the last one must move, and the first push [rad]."""
        return {
            "gap_over_height": self.gap / self.tile.height,
            "slab_over_tile_mass": self.slab.mass / self.tile.mass,
            "starter_tipping_angle": self.starter.tipping_angle,
        }

    # --- geometry -------------------------------------------------------------------------

    @property
    def u(self) -> Vec3:
        """Unit vector along the chain, shape (3,)."""
        return heading(self.heading)

    @property
    def gap(self) -> float:
        """Free space between neighbouring faces [m]."""
        return self.gap_ratio * self.tile.width

    @property
    def pieces(self) -> list[Domino]:
        """The starter, the other tiles and the slab, in the order in which they fall."""
        return [self.starter, *[self.tile] * (self.count - 1), self.slab]

    def spot(self, i: int) -> Vec3:
        """Foot of tile `i` [m]; `spot(count)` is where the slab stands."""
        return self._spots[i]

    @cached_property
    def _spots(self) -> list[Vec3]:
        """The feet of all pieces [m]; goal and failure ask for them in every control period.

        (x, y) is the middle of a chain of equal tiles: a stouter starter grows away from the face that is pushed.
        """
        half = self.count * (self.gap + self.tile.thickness) / 2
        spots, before = [], 0.0
        for piece in self.pieces:
            spot = np.array([self.x, self.y, TABLE_TOP]) + (before + piece.thickness / 2 - half) * self.u
            spot.flags.writeable = False
            spots.append(spot)
            before += piece.thickness + self.gap
        return spots
