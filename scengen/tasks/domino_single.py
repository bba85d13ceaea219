"""T17 domino-single: knock over a slab that the robot may not touch, by toppling the chain of tiles that leads to it.

    hand ->  | | | | |  []          seen from the side; the chain runs along +u
             0 1 2 3 4  slab

Bottleneck: the robot pushes one tile only, and each falling tile must reach the next one.

Decision: the paper forbids touching the slab and nothing else. It notes (App. on task-specific behaviours) that
policies then knock over a tile in the middle instead of the first. Pushing the last tile solves almost every scene that
way, without a causal chain. Here a goal counts if the robot touched the first tile alone, toppled it and did not carry
it: a first tile carried in the jaw could knock over the slab or the last tile. This is the paper's canonical plan; the
shortcuts below verify that each bypass fails.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import mujoco
import numpy as np

from ..assets.box import Domino
from ..assets.prop import TABLE_TOP, place, remove, table
from ..decisions import Decision, choice, near
from ..geometry import UP, Vec3, heading, spoken
from ..means import Mean, once, throughout
from ..params import param
from ..predicates import carried, displaced, touched_only
from ..robots.jaw import FINGER_ACROSS
from ..scenario import Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT
from ..sim.world import World
from ..skills.jaw import come_beside, grasp, pick, poke, step_back
from ..skills.motion import COARSE, FINE, Condition, go_to, push, wait

PUSH_HEIGHT_SHARE = 0.8  # height at which a piece is pushed, as a share of its own height
PUSH_SPEED = 0.08  # speed of the push [m/s]
APPROACH_HEIGHT = 0.12
"""Height above the start of a push from which the hand comes down [m]; it passes over every piece."""
CARRY_TOLERANCE = 0.01
"""Distance that the first tile's foot may move while the robot touches it [m]; a topple moves it by less than 1 mm."""
SLAB_DISPLACEMENT = 0.05
"""Displacement along the table at which the slab counts as knocked over [m] (paper, App. B, T17)."""


@dataclass(frozen=True, kw_only=True)
class DominoSingle(Scenario):
    """A straight chain of tiles with a red slab at its end; the first tile, the starter, may differ from the others."""

    VERSION = 2

    count: int = param(5, "tiles", 2, 15)  # number of tiles; the slab does not count
    gap_ratio: float = param(0.9, "tile widths", 0.2, 2.5)  # free space between neighbouring faces
    heading: float = param(0.0, "deg", -180.0, 180.0, period=360.0)
    """Direction of the chain; 0 is away from the robot, 90 to its left."""
    x: float = param(0.0, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    slab_yaw: float = param(0.0, "deg", -90.0, 90.0, period=180.0)  # angle of the slab to the chain
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
        return displaced(world, "slab", self.spot(self.count)) >= SLAB_DISPLACEMENT

    def failure(self, world: World) -> str | None:
        if world.touched(ROBOT, "slab"):
            return "the robot touched the slab"
        return None

    def means(self) -> Mapping[str, Mean]:
        pairs = [*pairwise(f"tile_{i}" for i in range(self.count)), (f"tile_{self.count - 1}", "slab")]
        return {
            "the robot touched the first tile alone": throughout(lambda world: not touched_only(world, "tile_0")),
            "the first tile fell where it stood": throughout(
                lambda world: not carried(world, "tile_0", self.spot(0), CARRY_TOLERANCE)
            ),
            "each tile struck the next": once(lambda world: all(world.touched(*pair) for pair in pairs)),
        }

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Go behind the first tile, tip it past its balance point, step back and wait until the slab has fallen."""
        yield from self.topple(world, 0)
        yield from wait(world.arm, lambda: self.success(world), give_up=4.0)

    def topple(self, world: World, i: int) -> Plan:
        """Push tile `i` over along the chain with the closed finger tips, then step back.

        Behind any tile but the first, the tips go into the middle of the gap.
        """
        along, falls = PUSH_SPEED * self.u, self._falls(world, i)
        yield from poke(world.arm, self._behind(i), along, falls, above=APPROACH_HEIGHT, pace=FINE)

    def _behind(self, i: int) -> Vec3:
        """Place of the closed finger tips behind tile `i` [m]."""
        tile = self.pieces[i]
        clearance = 0.02 if i == 0 else max(0.0, self.gap / 2 - FINGER_ACROSS)
        behind = (tile.thickness / 2 + FINGER_ACROSS + clearance) * self.u
        return self.spot(i) + PUSH_HEIGHT_SHARE * tile.height * UP - behind

    def _falls(self, world: World, i: int) -> Condition:
        """A condition: tile `i` falls by itself. A stout tile may strike its neighbour before its own balance point."""
        return lambda: self._tips(world, i) or self._tips(world, i + 1)

    def _tips(self, world: World, i: int) -> bool:
        """Whether piece `i` leans so far past its balance point that it falls by itself."""
        name = f"tile_{i}" if i < self.count else "slab"
        return world.tilt(name) > 1.3 * self.pieces[i].tipping_angle

    def steps(self) -> Mapping[str, Planner]:
        return {
            "close_jaw": lambda world: grasp(world.arm),
            "reach_behind": lambda world: come_beside(world.arm, self._behind(0), self.u, APPROACH_HEIGHT, pace=FINE),
            "tip_first": lambda world: push(world.arm, PUSH_SPEED * self.u, self._falls(world, 0)),
            "step_back": lambda world: step_back(world.arm, self.u),
            "chain_falls": lambda world: wait(world.arm, lambda: self.success(world), give_up=4.0),
            "push_slab": self._push_slab,
            "push_middle": lambda world: self.topple(world, self.count // 2),
            "carry_first": lambda world: self._carry(world, self.count),
        }

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
        """Knock the slab over from the side."""
        side = np.array([-self.u[1], self.u[0], 0.0])
        start = self.spot(self.count) + PUSH_HEIGHT_SHARE * self.slab.height * UP + 0.08 * side
        yield from poke(world.arm, start, -0.15 * side, lambda: self.success(world), above=APPROACH_HEIGHT)

    def _carry(self, world: World, i: int) -> Plan:
        """Carry the starter, which may be touched, over the chain and knock piece `i` over with its foot."""
        grip = 0.7 * self.starter.height * UP
        yield from pick(world.arm, self.spot(0) + grip, np.cross(UP, self.u), above=0.06, lift=0.16)
        hit = self.spot(i) + PUSH_HEIGHT_SHARE * self.pieces[i].height * UP
        yield from go_to(world.arm, hit + grip + APPROACH_HEIGHT * UP - 0.03 * self.u, pace=COARSE)
        yield from go_to(world.arm, hit + grip - (0.03 if i == self.count else 0.015) * self.u)
        yield from push(world.arm, 0.15 * self.u, lambda: self.success(world))

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Remove all tiles but the first; the others might still bridge the place of a single missing tile."""
        scene = self.build()
        for i in range(1, self.count):
            remove(scene, f"tile_{i}")
        return {"no_chain": scene}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        return {
            "direction": choice(spoken(self.heading), "heading"),
            "first_tile": near(self.spot(0), 0.015, "x", "y", "heading", "gap_ratio"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        reaches, height = self.gap < self.tile.height, self.tile.height
        yield require(reaches, "a falling tile cannot reach its neighbour", gap=self.gap, height=height)
        ends = [self.spot(0) - self.tile.thickness * self.u, self.spot(self.count) + self.slab.height * self.u]
        yield on_table("the chain", ends)
        yield within_reach("the first tile", self.spot(0) + self.starter.height * UP)

    def features(self) -> Mapping[str, float]:
        """Gap over height, mass of the slab over that of a tile, and tipping angle of the first tile [rad]."""
        return {
            "gap_over_height": self.gap / self.tile.height,
            "slab_over_tile_mass": self.slab.mass / self.tile.mass,
            "starter_tipping_angle": self.starter.tipping_angle,
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "dominoes": self.count,
            "way": spoken(self.heading),
            "strike": "face against face" if abs(self.slab_yaw) < 15.0 else "on a corner of the slab",
            "gap": self.gap / self.tile.height,
            "tipping": math.degrees(self.starter.tipping_angle),
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def u(self) -> Vec3:
        """Unit vector along the chain, shape (3,)."""
        return heading(self.heading)

    @cached_property
    def gap(self) -> float:
        """Free space between neighbouring faces [m]."""
        return self.gap_ratio * self.tile.width

    @cached_property
    def pieces(self) -> list[Domino]:
        """The starter, the other tiles and the slab, in the order in which they fall."""
        return [self.starter, *[self.tile] * (self.count - 1), self.slab]

    def spot(self, i: int) -> Vec3:
        """Position of the foot of piece `i` [m]; piece `count` is the slab."""
        return self._spots[i]

    @cached_property
    def _spots(self) -> list[Vec3]:
        """Positions of all feet [m]; cached, because `success` and `failure` need them in every control period.

        (x, y) is the middle of a chain of equal tiles. If the starter is stouter, the face that is pushed stays there.
        """
        half = self.count * (self.gap + self.tile.thickness) / 2
        spots, before = [], 0.0
        for piece in self.pieces:
            spot = np.array([self.x, self.y, TABLE_TOP]) + (before + piece.thickness / 2 - half) * self.u
            spot.flags.writeable = False
            spots.append(spot)
            before += piece.thickness + self.gap
        return spots
