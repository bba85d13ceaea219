"""T17 domino-single: knock over a slab you may not touch, by toppling a chain that leads to it.

    hand ->  | | | | |  []          seen from the side; the chain runs along +u
             0 1 2 3 4  slab

Bottleneck: the push is local, its effect is not. Each falling tile must reach the next one.

The bypass. The paper forbids touching the slab only, and notes (App. on task-specific behaviours) that policies
then knock over a tile in the middle instead of the first: pushing the last tile solves almost every scene, and
nothing is left of the causal chain. Here the robot may touch the first tile and no other; any other contact is a
latched failure like touching the slab. The paper's canonical plan is unaffected, and the shortcuts below show that
the bypass is closed.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from ..assets.box import Domino
from ..assets.prop import TABLE_HALF, TABLE_TOP, UP, place, table
from ..params import param
from ..robots.panda import REACH, SHOULDER
from ..scenario import Plan, Planner, Refutation, Scenario
from ..sim.world import ROBOT, Vec3, World
from ..skills.motion import CLOSED, facing_down, go_to, push, wait

SLAB_MOVES = 0.05
"""How far the slab's centre of mass must go, measured along the table [m] (paper, App. B, T17)."""
FINGERTIP = 0.0105
"""How far the closed fingers reach in front of the grip site when it points down [m]: half their width in the model."""


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

    # --- geometry -------------------------------------------------------------------------

    @property
    def u(self) -> Vec3:
        """Unit vector along the chain, shape (3,)."""
        a = math.radians(self.heading)
        return np.array([math.cos(a), math.sin(a), 0.0])

    @property
    def gap(self) -> float:
        """Free space between neighbouring faces [m]."""
        return self.gap_ratio * self.tile.width

    @property
    def pieces(self) -> list[Domino]:
        """The starter, the other tiles and the slab, in the order in which they fall."""
        return [self.starter, *[self.tile] * (self.count - 1), self.slab]

    def spot(self, i: int) -> Vec3:
        """Foot of tile `i` [m]; `spot(count)` is where the slab stands.

        (x, y) is the middle of a chain of equal tiles: a stouter starter grows away from the face that is pushed.
        """
        half = self.count * (self.gap + self.tile.thickness) / 2
        before = sum(piece.thickness + self.gap for piece in self.pieces[:i])
        return np.array([self.x, self.y, TABLE_TOP]) + (before + self.pieces[i].thickness / 2 - half) * self.u

    def infeasible(self) -> Refutation | None:
        if self.gap >= self.tile.height:
            return Refutation(
                "a falling tile cannot reach its neighbour", {"gap": self.gap, "height": self.tile.height}
            )
        ends = np.array(
            [self.spot(0) - self.tile.thickness * self.u, self.spot(self.count) + self.slab.height * self.u]
        )
        if (far := float(np.abs(ends[:, :2]).max())) > TABLE_HALF:
            return Refutation("the chain leaves the table", {"farthest": far, "edge": TABLE_HALF})
        if (away := float(np.linalg.norm(self.spot(0) + self.starter.height * UP - SHOULDER))) > REACH:
            return Refutation("the first tile is out of reach", {"distance": away, "reach": REACH})
        return None

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene, yaw = table(), math.radians(self.heading)
        for i, piece in enumerate(self.pieces[:-1]):
            place(scene, piece, f"tile_{i}", self.spot(i), yaw)
        place(scene, self.slab, "slab", self.spot(self.count), yaw + math.radians(self.slab_yaw))
        return scene

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Without the chain the first tile falls on nothing; one tile less may still be bridged by the others."""
        scene = self.build()
        for i in range(1, self.count):
            scene.delete(scene.body(f"tile_{i}"))
        return {"no chain": scene}

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        offset = world.com("slab") - self.spot(self.count)
        return math.hypot(offset[0], offset[1]) >= SLAB_MOVES

    def failure(self, world: World) -> str | None:
        if world.touched(ROBOT, "slab"):
            return "the robot touched the slab"
        if any(world.touched(ROBOT, tile) for tile in world.free_bodies if tile != "tile_0"):
            return "the robot touched a tile other than the first"
        return None

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Go behind the first tile, tip it past its balance point, step back, watch."""
        yield from self.topple(world, 0)
        yield from wait(world, lambda: self.success(world), give_up=4.0)

    def topple(self, world: World, i: int) -> Plan:
        """Push tile `i` over along the chain with the closed finger tips, then step back.

        Behind any tile but the first the tips go into the middle of the gap.
        """
        tile = self.pieces[i]
        room = 0.02 if i == 0 else max(0.0, self.gap / 2 - FINGERTIP)
        behind = self.spot(i) + 0.8 * tile.height * UP - (tile.thickness / 2 + FINGERTIP + room) * self.u
        half_turn = (self.heading + 90.0) % 180.0 - 90.0  # the closed fingers look the same from behind
        yield from go_to(world, behind + 0.12 * UP, facing_down(math.radians(half_turn)), grip=CLOSED)
        yield from go_to(world, behind, speed=0.15)
        yield from push(world, 0.08 * self.u, until=lambda: self._falling(world, i) or self._falling(world, i + 1))
        yield from go_to(world, world.hand - 0.03 * self.u + 0.03 * UP, within=0.01)

    def _falling(self, world: World, i: int) -> bool:
        """Whether a piece is past its balance point for good. A stout one may strike its neighbour before that."""
        name = f"tile_{i}" if i < self.count else "slab"
        return world.tilt(name) > 1.3 * self.pieces[i].tipping_angle

    # --- shortcuts ------------------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Planner]:
        return {
            "push the slab": self._push_slab,
            "push the last tile": lambda world: self.topple(world, self.count - 1),
            "push the second tile": lambda world: self.topple(world, 1),
        }

    def _push_slab(self, world: World) -> Plan:
        """Straight to the target: knock the slab over from the side."""
        side = np.array([-self.u[1], self.u[0], 0.0])
        beside = self.spot(self.count) + 0.8 * self.slab.height * UP + 0.08 * side
        yield from go_to(world, beside + 0.12 * UP, grip=CLOSED)
        yield from go_to(world, beside)
        yield from push(world, -0.15 * side, until=lambda: self.success(world))

    # --- features -------------------------------------------------------------------------

    def features(self) -> Mapping[str, float]:
        """How far a tile leans when it strikes the next one, what the last one must move, and the first push [rad]."""
        return {
            "gap over height": self.gap / self.tile.height,
            "slab over tile mass": self.slab.mass / self.tile.mass,
            "tipping angle of the starter": self.starter.tipping_angle,
        }
