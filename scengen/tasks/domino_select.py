"""T18 domino-select: five chains of dominoes, one try; only one of them knocks over the red slab.

    first tiles                       slabs         seen from above; every chain runs along +u
     |   |   |   |       #            red           lane 4   gap: a tile stands beside the chain
                 |       #
     |   |   |   |   |   #                          lane 3   intact
     | |  |    |         #                          lane 2   drift: each space is wider than the previous one
     |   |       |   |   #                          lane 1   (not in training) a tile is missing
     |   |   |   |   |   @            blue          lane 0   decoy: intact, but leads to the wrong slab

Bottleneck: the robot must choose by looking, because a toppled chain cannot be tried again. Near the hand all chains
look the same: the first tiles stand in one row, and the slabs in another. Only the tiles between them differ.

Decisions:

* "The target": one red slab, which stands across the lanes of all chains but one. Five straight chains cannot end at a
  slab as wide as a tile without standing in each other's way.
* "The wrong target": the outermost chain on one side leads to a separate blue slab, which never counts. So colour
  identifies this chain and nothing else.
* Each scene has one chain of each of the paper's defects (gap, drift, wrong target) and a fourth with a gap or a drift.
* One try: the robot touches one first tile and nothing else, and topples it but does not carry it. Touching another
  body does not end the episode, but no goal counts after it. Every wrong chain is judged by physics: each certificate
  topples each of them as the oracle topples the right one, until everything is at rest.
* Chance: the intact chain is each of the four that lead to the red slab equally often, and the others are dealt at
  random. A policy that sees only colours, and one that always chooses the same lane in the middle, are right in 1 of 4
  scenes. The side of the decoy carries no further information.
* The strength of the push does not matter: a first tile gets 2 rad/s from the oracle and 8 from the fastest hand, but
  11 from its own fall over a gap of 0.6 heights.
"""

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial

import mujoco
import numpy as np

from ..assets.box import Domino
from ..assets.chain import DECOY, DRIFT, GAP, MISSING, Chain, Defect, Lanes
from ..assets.prop import TABLE_TOP, place, remove, table
from ..decisions import Decision, choice
from ..geometry import UP, Vec3, about_z, heading, spoken
from ..means import Mean, once, throughout
from ..params import param
from ..predicates import carried, displaced, touched_only
from ..robots.jaw import FINGER_ACROSS, TIP_BELOW
from ..scenario import Answer, Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import World
from ..skills.jaw import come_beside, pick, poke, step_back
from ..skills.motion import Condition, go_to, push, retreat, wait

PUSH_SPEED = 0.08  # speed of the push [m/s]
LANES = 5
"""Chains on the table (paper, App. B, T18)."""
RED_LANES = LANES - 1
"""Chains that lead to the red slab."""
SLAB_DISPLACEMENT = 0.05
"""Displacement along the table at which a slab counts as knocked over [m] (paper, App. B, T17; T18 gives no number)."""
MIN_CLEARANCE = 0.002
"""Free space across the chains that neighbouring chains must leave [m]: the jitter of the robustness check."""
MAX_SLAB_WIDTH = 0.60
"""Largest width of the red slab [m]: the bound of `Domino`, and less than that of the table."""
CARRY_TOLERANCE = 0.01
"""Distance that a first tile's foot may move while the robot touches it [m]; a topple moves it by less than 1 mm."""


@dataclass(frozen=True, kw_only=True)
class DominoSelect(Scenario):
    """Five parallel chains, one intact, four with a defect, and two slabs; first tiles may differ from the others."""

    VERSION = 2

    count: int = param(4, "tiles", 3, 8)
    gap_ratio: float = param(1.25, "tile widths", 0.2, 2.5)
    lane: float = param(0.09, "m", 0.05, 0.15)  # distance between neighbouring chains
    heading: float = param(0.0, "deg", -180.0, 180.0, period=360.0)
    x: float = param(0.0, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    intact: int = param(2, "lane before the red slab, from the right", 0, RED_LANES - 1, answer=True)
    decoy_side: int = param(1, "-1 right, 1 left", -1, 1)
    """Side of the chain that leads to the blue slab. 0 is refuted."""
    order: int = param(0, "", 0, math.factorial(RED_LANES - 1) - 1)
    """Number of the permutation, in lexicographic order, that deals three defects to the other lanes before the red
    slab."""
    first: Defect = Defect(kind=GAP)
    second: Defect = Defect(kind=DRIFT)
    third: Defect = Defect(kind=GAP, place=0.6)
    """Its tile beside the chain stands on the side of that of `first`."""
    starter: Domino = Domino(height=0.05, width=0.025, thickness=0.008, mass=0.02, rgba=(0.95, 0.70, 0.25, 1.0))
    tile: Domino = Domino(height=0.05, width=0.025, thickness=0.008, mass=0.02)
    slab: Domino = Domino(height=0.11, width=0.04, thickness=0.008, mass=0.04, rgba=(0.78, 0.10, 0.10, 1.0))
    """The red slab. It is wider than this by three lanes, and light, so that one tile at its end tips it: with 0.1 kg
    and 12 mm it stays up."""
    decoy: Domino = Domino(height=0.11, width=0.04, thickness=0.008, mass=0.03, rgba=(0.15, 0.30, 0.62, 1.0))

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        # Relative to the scene's inertia; at MuJoCo's 1e-8 two dozen tiles of 20 g never stop rocking.
        scene.option.tolerance = 1e-10
        for name, foot in self.feet.items():
            place(scene, self.lanes.piece(name), name, foot, math.radians(self.heading))
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return displaced(world, "slab", self.feet["slab"]) >= SLAB_DISPLACEMENT

    def means(self) -> Mapping[str, Mean]:
        chain = [*(f"tile_{self.intact_lane}_{i}" for i in range(self.count)), "slab"]
        return {
            "the robot touched the first tile of the intact chain alone": throughout(
                lambda world: not touched_only(world, chain[0])
            ),
            "that tile fell where it stood": throughout(
                lambda world: not carried(world, chain[0], self.feet[chain[0]], CARRY_TOLERANCE)
            ),
            "each tile of that chain struck the next": once(
                lambda world: all(world.touched(*pair) for pair in itertools.pairwise(chain))
            ),
        }

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Topple the intact chain and wait until its slab has fallen."""
        yield from self.topple(world, f"tile_{self.intact_lane}_0")
        yield from wait(world.arm, lambda: self.success(world), give_up=4.0)

    def topple(self, world: World, tile: str) -> Plan:
        """Push a tile over along its chain with the closed finger tips, then step back."""
        yield from poke(world.arm, self._behind(tile), PUSH_SPEED * self.u, self._falls(world, tile), above=0.08)

    def _behind(self, tile: str) -> Vec3:
        """Place of the closed finger tips behind a tile [m]."""
        piece = self.lanes.piece(tile)
        return self.feet[tile] + 0.8 * piece.height * UP - (piece.thickness / 2 + FINGER_ACROSS + 0.02) * self.u

    def _falls(self, world: World, tile: str) -> Condition:
        """A condition: a tile falls by itself. Past 30 deg a slender one does, even if it pushes its neighbour."""
        lean = max(math.radians(30.0), 1.3 * self.lanes.piece(tile).tipping_angle)
        return lambda: world.tilt(tile) > lean

    def steps(self) -> Mapping[str, Planner]:
        first, wrong = f"tile_{self.intact_lane}_0", f"tile_{self.wrong[0]}_0"
        return {
            "reach_behind": lambda world: come_beside(world.arm, self._behind(first), self.u, above=0.08),
            "tip_first": lambda world: push(world.arm, PUSH_SPEED * self.u, self._falls(world, first)),
            "step_back": lambda world: step_back(world.arm, self.u),
            "chain_falls": lambda world: wait(world.arm, lambda: self.success(world), give_up=4.0),
            "push_slab": self._push_slab,
            "try_second": lambda world: self.topple(world, wrong),
            "carry_first": self._carry,
        }

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        """Topple each wrong chain, which must fall short by physics, and try four ways around the choice."""
        wrong = {f"topple_chain_{k}": partial(self.topple, tile=f"tile_{k}_0") for k in self.wrong}
        return {name: Shortcut(plan, to_rest=True) for name, plan in wrong.items()} | {
            "try_a_second_chain": Shortcut(self._try_a_second_chain),
            "push_a_slab": Shortcut(self._push_slab),
            "push_the_last_tile": Shortcut(partial(self.topple, tile=f"tile_{self.intact_lane}_{self.count - 1}")),
            "carry_the_first_tile_to_the_slab": Shortcut(self._carry),
        }

    def _try_a_second_chain(self, world: World) -> Plan:
        """Topple a wrong chain, then the right one."""
        yield from self.topple(world, f"tile_{self.wrong[0]}_0")
        yield from retreat(world.arm, 0.05)
        yield from self.topple(world, f"tile_{self.intact_lane}_0")

    def _push_slab(self, world: World) -> Plan:
        """Knock the red slab over along the lane of the intact chain."""
        start = self.end + 0.8 * self.slab.height * UP - 0.06 * self.u
        yield from poke(world.arm, start, 0.15 * self.u, lambda: self.success(world), above=0.06)

    def _carry(self, world: World) -> Plan:
        """Carry the intact chain's first tile, which may be touched, to the slab and knock it over with the foot."""
        tile, slab = self.feet[f"tile_{self.intact_lane}_0"], self.end
        yield from pick(world.arm, tile + 0.7 * self.starter.height * UP, np.cross(UP, self.u), above=0.06, lift=0.10)
        yield from go_to(world.arm, slab + (self.slab.height + TIP_BELOW + 0.012) * UP - 0.04 * self.u)
        yield from push(world.arm, 0.15 * self.u, lambda: self.success(world))

    def answer(self) -> Answer:
        """The lane of the intact chain. One try: a toppled chain cannot be tried again."""
        lanes, right = tuple(map(float, range(LANES))), self.intact_lane
        return Answer(lanes, lambda w, k: self.topple(w, f"tile_{round(k)}_0"), lambda k: k == right, tries=1)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Remove all tiles of the intact chain but the first; the others might bridge the place of a missing tile."""
        scene = self.build()
        for i in range(1, self.count):
            remove(scene, f"tile_{self.intact_lane}_{i}")
        return {"no_chain": scene}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        return {
            "lane": choice(self.intact_lane, "first", "second", "third"),
            "direction": choice(spoken(self.heading), "heading"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        gap, height, spaces = self.gap, self.tile.height, self.count * self.gap
        least = min(height, self.starter.height)
        yield require(gap < least, "a falling tile cannot reach its neighbour", gap=gap, height=least)
        beyond, broken = 2 * gap + self.tile.thickness, self.lanes.defects(GAP, MISSING)
        yield require(beyond > height or not broken, "a falling tile reaches across the gap", gap=beyond, height=height)
        widest = max((drift.stretch * height for drift in self.lanes.defects(DRIFT)), default=0.0)
        yield require(widest < spaces, "the drift takes more space than the chain has", widest=widest, spaces=spaces)
        width = self.lanes.slab_width
        yield require(width <= MAX_SLAB_WIDTH, "the red slab is too wide", width=width, largest=MAX_SLAB_WIDTH)
        astray, room = len(self.lanes.defects(DECOY)), self.lanes.room
        yield require(astray == 1 and self.decoy_side != 0, "not one chain leads astray, at one side", chains=astray)
        yield require(room >= MIN_CLEARANCE, "a piece stands in a neighbouring chain", room=room, needed=MIN_CLEARANCE)
        starts = [self.feet[f"tile_{k}_0"] for k in range(LANES)]
        half, along = self.lanes.slab.width / 2 * np.cross(UP, self.u), self.slab.height * self.u
        fallen = [self.feet["slab"] + along + half, self.feet["slab"] + along - half, self.feet["decoy"] + along]
        yield on_table("a chain", starts + fallen)
        yield within_reach("a first tile", *(start + self.starter.height * UP for start in starts))

    def features(self) -> Mapping[str, float]:
        """Ratios that decide at which angle tiles strike, the space between chains, how much chains fail (0: none
        does), and tipping angles [rad].
        """
        return {
            "gap_over_height": self.gap / self.tile.height,
            "gap_over_starter_height": self.gap / self.starter.height,
            "lane_over_slab_width": self.lane / self.slab.width,
            "least_drift_over_height": min((drift.stretch for drift in self.lanes.defects(DRIFT)), default=0.0),
            "least_offset_over_width": min((gap.offset for gap in self.lanes.defects(GAP)), default=0.0),
            "starter_tipping_angle": self.starter.tipping_angle,
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "intact": self.intact_lane + 1,
            "decoy": "the last one on the right" if self.decoy_side < 0 else "the last one on the left",
            "way": spoken(self.heading),
            "gap": self.gap / self.tile.height,
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def u(self) -> Vec3:
        """Unit vector along the chains, shape (3,)."""
        return heading(self.heading)

    @cached_property
    def gap(self) -> float:
        """Free space between neighbouring faces of an intact chain [m]."""
        return self.gap_ratio * self.tile.width

    @cached_property
    def defects(self) -> tuple[Defect | None, ...]:
        """The defect of the chain in each lane; None for the intact one."""
        third = replace(self.third, side=self.first.side)  # on two sides they would not fit between their lanes
        dealt = list(itertools.permutations((self.first, self.second, third)))[self.order]
        red, astray = (*dealt[: self.intact], None, *dealt[self.intact :]), Defect(kind=DECOY)
        return (astray, *red) if self.decoy_side < 0 else (*red, astray)

    @cached_property
    def intact_lane(self) -> int:
        """Lane of the intact chain, from the right, among all."""
        return self.defects.index(None)

    @cached_property
    def end(self) -> Vec3:
        """Place on the foot of the red slab where the intact chain ends [m]."""
        start = self.feet[f"tile_{self.intact_lane}_0"]
        return start + float((self.feet["slab"] - start) @ self.u) * self.u

    @cached_property
    def wrong(self) -> list[int]:
        """Lanes of the chains that have a defect."""
        return [k for k in range(LANES) if k != self.intact_lane]

    @cached_property
    def lanes(self) -> Lanes:
        """The five chains in their own axes."""
        ends = [(self.decoy if defect and defect.kind == DECOY else self.slab, defect) for defect in self.defects]
        return Lanes(tuple(Chain(self.count, self.gap, self.starter, self.tile, *end) for end in ends), self.lane)

    @cached_property
    def feet(self) -> dict[str, Vec3]:
        """Positions of all feet [m], by name as in `Lanes.feet`."""
        middle, turn = np.array([self.x, self.y, TABLE_TOP]), about_z(math.radians(self.heading))
        return {name: middle + turn @ foot for name, foot in self.lanes.feet.items()}
