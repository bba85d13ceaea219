"""T18 domino-select: five chains of dominoes, one try; only one of them knocks over a red slab.

    first tiles                       slabs         seen from above; every chain runs along +u
     |   |   |   |       #            red           lane 4   gap: a tile stands beside the chain
                 |
     |   |   |   |   |   #            red           lane 3   intact
     | |  |    |         #            red           lane 2   drift: each space is wider than the one before
     |   |   |   |   |   @            blue          lane 1   decoy: intact, but leads to the wrong slab
     |   |       |   |   #            red           lane 0   (not in training) a tile is missing

Bottleneck: the choice is made by looking, because a toppled chain cannot be tried again. Near the hand all chains look
the same: their first tiles stand in one row and so do their slabs, and only what lies between tells them apart.

Decisions and deviations.

* The paper speaks of one target to which the chains lead. Five straight chains cannot end at one slab 5 cm wide
  without standing in each other's way, and a chain that passes it by would run through the next one. Here every chain
  has a slab of its own: a red one counts wherever it stands, a blue one never does. So colour tells the decoys and
  nothing else.
* Each scene has one chain of each of the paper's defects (gap, drift, wrong target) and a fourth that repeats a kind.
* One try: the robot may touch one first tile and nothing else. A second chain, a later tile or a slab is a latched
  failure. The paper notes that policies knock over tiles in the middle of a chain; and without the rule about the
  second chain, knocking over one after the other solves every scene. Touching a wrong first tile is no failure by
  itself: nothing can be won any more, and thus every wrong chain can be judged by physics alone. Each certificate
  topples each wrong chain as the oracle topples the right one, and watches until all is still.
* How hard a first tile is pushed does not matter. It gets 2 rad/s from the oracle and 8 from the fastest hand, but
  11 from its own fall over a gap of 0.6 heights; a tile slides by no more than the 2 mm by which a drift of 1.05
  heights exceeds its reach.
* A first tile may be toppled, not carried: a robot that pushes it up to the break, or takes it to the slab, needs no
  chain.
"""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from scipy.optimize import root_scalar

from ..assets.box import Domino
from ..assets.prop import TABLE_HALF, TABLE_TOP, UP, place, table
from ..params import check_bounds, param
from ..robots.panda import REACH, SHOULDER
from ..scenario import Plan, Planner, Refutation, Scenario
from ..sim.world import ROBOT, Mat3, Vec3, World
from ..skills.motion import CLOSED, OPEN, facing_down, go_to, grasp, push, wait

LANES = 5
"""Chains on the table (paper, App. B, T18)."""
GAP, DRIFT, DECOY, MISSING = range(4)
"""Kinds of defect. The first three are the paper's."""
SLAB_MOVES = 0.05
"""How far a slab's centre of mass must go, measured along the table [m] (paper, App. B, T17; T18 gives no number)."""
FINGERTIP = 0.012
"""How far the closed finger tips reach in front of the grip site when it points down [m], measured on the model."""
CLEAR = 0.002
"""Free space across the chains that neighbouring chains must leave [m]: the jitter of the robustness check."""
CARRIED = 0.01
"""How far the foot of a first tile may have moved while the robot still touches it [m]. In a topple it moves less than
1 mm; to fall across a gap in the chain the tile would have to be brought `2 * gap + thickness - height` closer."""
TOLERANCE = 1e-10
"""Solver tolerance. It is relative to the inertia of the whole scene: at MuJoCo's 1e-8 two dozen tiles of 20 g never
stop rocking by 2e-3 rad/s; here they come to rest, at the same cost."""
TOPPLED = math.radians(30.0)
"""Lean at which a first tile falls on by itself, even where it has to carry its neighbour along [rad]."""


@dataclass(frozen=True, kw_only=True)
class Defect:
    """Why a chain does not reach a red slab. Of the values only those that belong to its kind count."""

    kind: int = param(GAP, "0 gap, 1 drift, 2 decoy, 3 missing", GAP, MISSING)
    place: float = param(0.3, "share of the chain", 0.0, 1.0)
    """Which tile is out of line or missing: 0 is the second tile, 1 the last."""
    offset: float = param(1.3, "tile widths", 1.02, 2.5)
    """How far that tile stands beside the chain."""
    side: int = param(1, "0 right, 1 left", 0, 1)
    stretch: float = param(1.25, "tile heights", 1.02, 2.0)
    """The widest space of a drifting chain, the one before its slab."""

    def __post_init__(self) -> None:
        check_bounds(self)

    def broken(self, count: int) -> int:
        """Index of the tile that is out of line or missing in a chain of `count`; never the first one."""
        return 1 + min(int(self.place * (count - 1)), count - 2)


@dataclass(frozen=True)
class Piece:
    """A domino and where its foot stands."""

    domino: Domino
    along: float
    """Place along the chains, from their middle [m]."""
    across: float
    """Place to the left of the middle lane [m]."""


@dataclass(frozen=True, kw_only=True)
class DominoSelect(Scenario):
    """Five parallel chains with a slab each: one intact, four with a defect."""

    count: int = param(4, "tiles", 3, 8)
    gap_ratio: float = param(1.25, "tile widths", 0.2, 2.5)
    lane: float = param(0.09, "m", 0.05, 0.15)
    """Distance between neighbouring chains."""
    heading: float = param(0.0, "deg", -180.0, 180.0, period=360.0)
    x: float = param(0.0, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    intact: int = param(2, "lane, from the right", 0, LANES - 1)
    order: int = param(0, "", 0, math.factorial(LANES - 1) - 1)
    """How the four defects are dealt to the other lanes: number of their permutation in lexicographic order."""
    first: Defect = Defect(kind=GAP)
    second: Defect = Defect(kind=DRIFT)
    third: Defect = Defect(kind=DECOY)
    fourth: Defect = Defect(kind=GAP, place=0.6, side=0)
    tile: Domino = Domino(height=0.05, width=0.025, thickness=0.008, mass=0.02)
    slab: Domino = Domino(height=0.11, width=0.04, thickness=0.012, mass=0.03, rgba=(0.78, 0.10, 0.10, 1.0))
    decoy: Domino = Domino(height=0.11, width=0.04, thickness=0.012, mass=0.03, rgba=(0.15, 0.30, 0.62, 1.0))

    # --- geometry -------------------------------------------------------------------------

    @property
    def u(self) -> Vec3:
        """Unit vector along the chains, shape (3,)."""
        a = math.radians(self.heading)
        return np.array([math.cos(a), math.sin(a), 0.0])

    @property
    def v(self) -> Vec3:
        """Unit vector across the chains, to their left, shape (3,)."""
        return np.array([-self.u[1], self.u[0], 0.0])

    @property
    def gap(self) -> float:
        """Free space between neighbouring faces of an intact chain [m]."""
        return self.gap_ratio * self.tile.width

    @cached_property
    def defects(self) -> tuple[Defect | None, ...]:
        """What is wrong with the chain in each lane; None with the intact one."""
        dealt = list(itertools.permutations((self.first, self.second, self.third, self.fourth)))[self.order]
        return *dealt[: self.intact], None, *dealt[self.intact :]

    @property
    def wrong(self) -> list[int]:
        """Lanes of the chains that have a defect."""
        return [k for k in range(LANES) if k != self.intact]

    def gaps(self, k: int) -> list[float]:
        """Free spaces of chain `k`, the one before the slab included [m], shape (count,).

        In a drifting chain each space is larger than the one before by the same factor, and their sum is that of an
        intact chain, so that first tiles and slabs stand in rows and only the spacing tells.
        """
        defect = self.defects[k]
        if defect is None or defect.kind != DRIFT:
            return [self.gap] * self.count
        widest = defect.stretch * self.tile.height
        powers = np.arange(self.count)

        def excess(ratio: float) -> float:
            return float(np.sum(ratio**powers)) - self.count * self.gap / widest

        shrink = root_scalar(excess, bracket=(0.0, 1.0)).root
        return [widest * shrink ** (self.count - 1 - i) for i in range(self.count)]

    @cached_property
    def pieces(self) -> dict[str, Piece]:
        """Everything on the table, by name: `tile_3_0` is the first tile in lane 3, `slab_3` or `decoy_3` its slab."""
        pieces = {}
        for k, defect in enumerate(self.defects):
            face, across = -self.count * (self.gap + self.tile.thickness) / 2, (k - LANES // 2) * self.lane
            for i, gap in enumerate(self.gaps(k)):
                aside = 0.0
                if defect and defect.kind in (GAP, MISSING) and i == defect.broken(self.count):
                    aside = (2 * defect.side - 1) * defect.offset * self.tile.width
                if not (aside and defect and defect.kind == MISSING):
                    pieces[f"tile_{k}_{i}"] = Piece(self.tile, face + self.tile.thickness / 2, across + aside)
                face += self.tile.thickness + gap
            name, slab = (f"decoy_{k}", self.decoy) if defect and defect.kind == DECOY else (f"slab_{k}", self.slab)
            pieces[name] = Piece(slab, face + slab.thickness / 2, across)
        return pieces

    def foot(self, name: str) -> Vec3:
        """Where a piece stands [m]."""
        piece = self.pieces[name]
        return np.array([self.x, self.y, TABLE_TOP]) + piece.along * self.u + piece.across * self.v

    @cached_property
    def targets(self) -> dict[str, Vec3]:
        """The red slabs and where they stand [m]."""
        return {name: self.foot(name) for name in self.pieces if name.startswith("slab")}

    def infeasible(self) -> Refutation | None:
        tile, beyond = self.tile, 2 * self.gap + self.tile.thickness
        if self.gap >= tile.height:
            return Refutation("a falling tile cannot reach its neighbour", {"gap": self.gap, "height": tile.height})
        if beyond <= tile.height and any(d and d.kind in (GAP, MISSING) for d in self.defects):
            return Refutation("a falling tile reaches across the gap", {"gap": beyond, "height": tile.height})
        widest = max((d.stretch * tile.height for d in self.defects if d and d.kind == DRIFT), default=0.0)
        if widest >= (chain := self.count * self.gap):
            return Refutation("the drift takes more space than the chain has", {"widest": widest, "spaces": chain})
        if len(self.targets) == 1:
            return Refutation("colour alone tells the intact chain", {"red slabs": 1})
        if (room := min(self._room(a, b) for a, b in itertools.combinations(self.pieces, 2))) < CLEAR:
            return Refutation("a piece stands in a neighbouring chain", {"room": room, "needed": CLEAR})
        fallen = self.slab.height * self.u
        far = max(float(np.abs((self.foot(p) + fallen)[:2]).max()) for p in self.pieces if not p.startswith("tile"))
        far = max(far, *(float(np.abs(self.foot(f"tile_{k}_0")[:2]).max()) for k in range(LANES)))
        if far > TABLE_HALF:
            return Refutation("a chain leaves the table", {"farthest": far, "edge": TABLE_HALF})
        tops = [self.foot(f"tile_{k}_0") + tile.height * UP for k in range(LANES)]
        if (away := max(float(np.linalg.norm(top - SHOULDER)) for top in tops)) > REACH:
            return Refutation("a first tile is out of reach", {"distance": away, "reach": REACH})
        return None

    def _room(self, a: str, b: str) -> float:
        """Free space across the chains between two pieces of different chains [m]."""
        if a.split("_")[1] == b.split("_")[1]:
            return math.inf
        p, q = self.pieces[a], self.pieces[b]
        return abs(p.across - q.across) - (p.domino.width + q.domino.width) / 2

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        scene.option.tolerance = TOLERANCE
        for name, piece in self.pieces.items():
            place(scene, piece.domino, name, self.foot(name), math.radians(self.heading))
        return scene

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Without the intact chain its first tile falls on nothing; one tile less might be bridged by the others."""
        scene = self.build()
        for i in range(1, self.count):
            scene.delete(scene.body(f"tile_{self.intact}_{i}"))
        return {"no chain": scene}

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return any(math.dist(world.com(slab)[:2], foot[:2]) >= SLAB_MOVES for slab, foot in self.targets.items())

    def failure(self, world: World) -> str | None:
        touched = [piece for piece in world.free_bodies if world.touched(ROBOT, piece)]
        if any(not piece.startswith("tile") for piece in touched):
            return "the robot touched a slab"
        if any(not piece.endswith("_0") for piece in touched):
            return "the robot touched a tile other than a first one"
        if len(touched) > 1:
            return "the robot touched a second chain"
        if any(
            math.dist(world.pos(tile), self.foot(tile)) > CARRIED and world.touching(ROBOT, tile) for tile in touched
        ):
            return "the robot carried the first tile away"
        return None

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Topple the intact chain and watch."""
        yield from self.topple(world, f"tile_{self.intact}_0")
        yield from wait(world, lambda: self.success(world), give_up=4.0)

    def topple(self, world: World, tile: str) -> Plan:
        """Push a tile over along its chain with the closed finger tips, then step back."""
        behind = self.foot(tile) + 0.8 * self.tile.height * UP - (self.tile.thickness / 2 + FINGERTIP + 0.02) * self.u
        yield from go_to(world, behind + 0.08 * UP, self._across, speed=0.3, within=0.02, grip=CLOSED)
        yield from go_to(world, behind, self._across, within=0.005)
        yield from push(world, 0.08 * self.u, until=lambda: world.tilt(tile) > TOPPLED)
        yield from go_to(world, world.hand - 0.03 * self.u + 0.03 * UP, within=0.01)

    @property
    def _across(self) -> Mat3:
        """Orientation of a hand that points down with its fingers side by side across the chains.

        Of the two that look alike, the one closer to the hand's at the start.
        """
        return facing_down(math.radians((self.heading + 90.0) % 180.0 - 90.0))

    # --- shortcuts ------------------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Planner]:
        """Each wrong chain, toppled as the oracle topples the right one, and four ways around the choice."""
        plans: dict[str, Planner] = {f"topple chain {k}": self._topple_chain(k) for k in self.wrong}
        return plans | {
            "try a second chain": self._try_a_second_chain,
            "push a slab": self._push_slab,
            "push the last tile": lambda world: self.topple(world, f"tile_{self.intact}_{self.count - 1}"),
            "carry the first tile to the slab": self._carry,
        }

    def plays_out(self, shortcut: str) -> bool:
        """A wrong chain must be seen to fall short: a rule that ends its cascade would hide that it works."""
        return shortcut.startswith("topple chain")

    def _topple_chain(self, k: int) -> Planner:
        return lambda world: self.topple(world, f"tile_{k}_0")

    def _try_a_second_chain(self, world: World) -> Plan:
        """Choose wrongly, see it, and go on to the right chain."""
        yield from self.topple(world, f"tile_{self.wrong[0]}_0")
        yield from go_to(world, world.hand + 0.05 * UP, speed=0.3, within=0.02)
        yield from self.topple(world, f"tile_{self.intact}_0")

    def _push_slab(self, world: World) -> Plan:
        """Straight to the target: knock the slab of the intact chain over along its lane, from in front of it."""
        slab = f"slab_{self.intact}"
        beside = self.foot(slab) + 0.8 * self.slab.height * UP - 0.06 * self.u
        yield from go_to(world, beside + 0.06 * UP, self._across, speed=0.3, within=0.02, grip=CLOSED)
        yield from go_to(world, beside, self._across, within=0.005)
        yield from push(world, 0.15 * self.u, until=lambda: self.success(world))

    def _carry(self, world: World) -> Plan:
        """Take the intact chain's first tile, which may be touched, and knock its slab over with the tile's foot."""
        grip = 0.7 * self.tile.height * UP
        tile, slab = self.foot(f"tile_{self.intact}_0"), self.foot(f"slab_{self.intact}")
        yield from go_to(world, tile + grip + 0.06 * UP, self._across, speed=0.3, within=0.01, grip=OPEN)
        yield from go_to(world, tile + grip, self._across)
        yield from grasp(world)
        yield from go_to(world, tile + grip + 0.10 * UP)
        over = (self.slab.height + FINGERTIP + 0.009) * UP
        yield from go_to(world, slab + over - 0.04 * self.u)
        yield from push(world, 0.15 * self.u, until=lambda: self.success(world))

    # --- features -------------------------------------------------------------------------

    def features(self) -> Mapping[str, float]:
        """The lean of a tile that strikes the next one, the room between chains, how narrowly chains fail; 0: none."""
        wrong = [d for d in self.defects if d]
        return {
            "gap over height": self.gap / self.tile.height,
            "lane over slab width": self.lane / self.slab.width,
            "widest space over height, least drift": min((d.stretch for d in wrong if d.kind == DRIFT), default=0.0),
            "offset over width, least gap": min((d.offset for d in wrong if d.kind == GAP), default=0.0),
        }
