"""T33 packing: lay L-shaped pieces into a bin that they fill without a gap, with a suction cup.

    +-+--------+      The bin's footprint was cut into these pieces by guillotine cuts (assets/guillotine.py), so that
    | |   +----+      a packing without gaps exists. The pieces lie around the bin, each turned away from its slot.
    | | 3 |  2 |      x and y of the sketch are the bin's axes; piece 1 frames a rectangle that 2 and 3 share by
    | +---+    |      stairs. With four pieces the footprint is cut in two instead, and each half is shared by stairs.
    |1|   2    |
    | +--------+
    |    1     |
    +----------+

Bottleneck: no piece has a place of its own in sight; positions and quarter turns of all pieces depend on each other,
and any that is wrong leaves a piece lying on the others. Suction grips from above alone: no piece can be turned over.

Decisions, where the paper (App. B, T33) says no more than "L-shaped pieces", "bin" and "zero gaps":

* Zero gaps means: all pieces lie flat on the bin's floor. They cannot overlap there, so that the uncovered area is the
  floor's minus theirs; what remains is the clearance around each piece, of about a millimetre, which a real joint
  needs. Nothing else can lie between them: a gap would be at least a unit wide, and there is no area left for one. Any
  arrangement that does this counts, not the planned one alone; `solutions` says how many there are.
* Cuts fall on a grid. Lengths of strips between cuts are the parameters, so that every combination closes exactly.
* The bin is fixed to the table and lower than the pieces, so that the cup never meets a wall.
* The lower edges of the pieces are round, by 3 mm. With sharp ones a piece has to be held within its clearance on all
  six sides at once to enter its slot, which neither a person at a gamepad nor a hand under noise can do.
* Table 3 of the paper (line 512) lists the task under "jaw"; its description says suction, and a jaw could not let go
  of a piece between two others. It is suction here.
"""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..assets import guillotine
from ..assets.bin import Bin
from ..assets.guillotine import Ell, Rect
from ..assets.l_piece import Box, LPiece
from ..assets.prop import TABLE_TOP, UP, place, table
from ..params import check_bounds, param
from ..robots.panda import REACH, SHOULDER
from ..robots.suction import REACHES
from ..scenario import Plan, Planner, Refutation, Scenario
from ..sim.world import ROBOT, Vec3, World
from ..skills.motion import OPEN, facing_down, go_to, turn_between
from ..skills.suction import carry, let_go, suck, upright, yaw_of

FLAT = math.radians(2.0)
"""Largest tilt of a piece that lies flat [rad]. The thinnest piece with a side on a neighbour tilts by 4 deg."""
DOWN = 0.0015
"""Largest height of a piece's foot above the bin's floor where it lies on it [m]."""
APART = 0.008
"""Least distance of two things on the table at the start [m]: a cup may be a little off, a piece a little turned."""
TRANSIT = 0.05
"""Height above the table at which pieces are carried [m], twice what stands in the way."""
RIM = 0.6
"""Depth of the bin by the thickness of the pieces."""
ABOVE = 0.003
"""Height above its neighbours at which a piece hangs over its slot before it is lowered [m]."""
AIM = 0.0015
"""Mean error that is good enough there [m]: half the radius of a piece's lower edges, which guide it from then on."""
LOWERING, SLACK = 0.04, 0.0015
"""Speed at which a piece is lowered [m/s], and the most by which the hand may lag [m]: a piece that is caught on an
edge presses there with some 1.5 N then and slides in; 2.5 N at 0.1 m from the cup would peel it off."""
PATIENCE = 2.0
"""How long it may be pressed before it is raised and lowered again [s]; the way down takes half of that."""
WRIST = math.radians(45.0)
"""Direction of the hand for which the last joint is in the middle of its range [rad]: 160 deg are left each way."""
COLOURS = ((0.86, 0.46, 0.20, 1.0), (0.25, 0.58, 0.44, 1.0), (0.85, 0.70, 0.28, 1.0), (0.55, 0.40, 0.66, 1.0))

Corners = NDArray[np.float64]
"""Shape (4, 2): the corners of a rectangle, seen from above [m]."""


@dataclass(frozen=True, kw_only=True)
class Spot:
    """Where a piece lies at the start, and how far it must be turned, counterclockwise, to lie as in its slot."""

    x: float = param(0.0, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    turn: float = param(60.0, "deg", -180.0, 180.0, period=360.0)

    def __post_init__(self) -> None:
        check_bounds(self)


@dataclass(frozen=True, kw_only=True)
class Packing(Scenario):
    """Three or four L-shaped pieces and the bin whose footprint they were cut from. Lengths of strips are in units."""

    HOLD = 0.3

    count: int = param(3, "pieces", 3, 4)
    unit: float = param(0.018, "m", 0.015, 0.025)
    frame: int = param(2, "units", 2, 3)
    left: int = param(2, "units", 2, 4)
    right: int = param(2, "units", 2, 4)
    low: int = param(2, "units", 2, 4)
    rise: int = param(1, "units", 1, 3)
    top: int = param(2, "units", 2, 4)
    mirror: int = param(0, "1", 0, 1)
    clearance: float = param(0.0010, "m", 0.0002, 0.002)
    thickness: float = param(0.020, "m", 0.008, 0.04)
    density: float = param(600.0, "kg/m^3", 200.0, 4000.0)
    x: float = param(-0.02, "m", -0.3, 0.3)
    y: float = param(0.0, "m", -0.3, 0.3)
    heading: float = param(0.0, "deg", -90.0, 90.0)
    spot_0: Spot = Spot(x=-0.08, y=0.235, turn=65.0)
    spot_1: Spot = Spot(x=-0.12, y=-0.215, turn=-65.0)
    spot_2: Spot = Spot(x=0.10, y=-0.215, turn=65.0)
    spot_3: Spot = Spot(x=0.14, y=0.215, turn=-65.0)

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def footprint(self) -> Rect:
        """Floor of the bin in units, lower left corner at the origin."""
        inner, rows = self.left + self.right, self.low + self.rise + self.top
        return Rect.sized(self.frame + inner, self.frame + rows) if self.count == 3 else Rect.sized(2 * inner, rows)

    @cached_property
    def slots(self) -> tuple[Ell, ...]:
        """The pieces as they were cut, in units: the witness that a packing without gaps exists."""
        low, high = self.low, self.low + self.rise
        if self.count == 3:
            first, rest = guillotine.framed(self.footprint, self.frame, self.frame)
            cut = (first, *guillotine.stairs(rest, self.left, low, high))
        else:
            one, two = self.footprint.cut_x(self.left + self.right)
            cut = (*guillotine.stairs(one, self.left, low, high), *guillotine.stairs(two, self.left, high, low))
        return guillotine.mirrored(cut, self.footprint) if self.mirror else cut

    @property
    def solutions(self) -> int:
        """How many arrangements without gaps there are; every one comes with the bin's half turn."""
        return guillotine.solutions(self.slots, self.footprint)

    @cached_property
    def bin(self) -> Bin:
        width, height = (self.unit * float(side) for side in (self.footprint.width, self.footprint.height))
        return Bin(width=width, length=height, depth=RIM * self.thickness)

    @cached_property
    def pieces(self) -> tuple[LPiece, ...]:
        """The slots' shapes, smaller by the clearance all round."""
        return tuple(self.shape(slot, COLOURS[i]) for i, slot in enumerate(self.slots))

    def shape(self, slot: Ell, rgba: tuple[float, float, float, float]) -> LPiece:
        """The piece that fills a slot up to the clearance."""
        width, height, upright, lying = (self.unit * float(side) - 2 * self.clearance for side in slot.sides)
        area = width * lying + upright * (height - lying)
        return LPiece(
            width=width,
            height=height,
            upright=upright,
            lying=lying,
            thickness=self.thickness,
            mass=self.density * area * self.thickness,
            rgba=rgba,
        )

    @property
    def spots(self) -> tuple[Spot, ...]:
        return (self.spot_0, self.spot_1, self.spot_2, self.spot_3)[: self.count]

    @property
    def floor(self) -> float:
        """Height of the bin's floor [m]."""
        return TABLE_TOP + self.bin.floor

    def goal(self, i: int) -> tuple[Vec3, float]:
        """Position of piece `i` in its slot [m], and its yaw [rad]."""
        middle, whole = self.slots[i].middle, (self.footprint.width / 2, self.footprint.height / 2)
        across, along = (self.unit * float(m - w) for m, w in zip(middle, whole, strict=True))
        turn = math.radians(self.heading)
        c, s = math.cos(turn), math.sin(turn)
        pos = np.array([self.x + c * across - s * along, self.y + s * across + c * along, self.floor])
        return pos, turn + self.slots[i].quarter * math.pi / 2

    def start(self, i: int) -> tuple[Vec3, float]:
        """Position of piece `i` at the start [m], and its yaw [rad]."""
        spot = self.spots[i]
        return np.array([spot.x, spot.y, TABLE_TOP]), self.goal(i)[1] - math.radians(spot.turn)

    def infeasible(self) -> Refutation | None:
        if not guillotine.closes(self.slots, self.footprint):
            areas = {"pieces": float(sum(slot.area for slot in self.slots)), "bin": float(self.footprint.area)}
            return Refutation("the pieces do not close the bin's footprint", areas)
        narrow = min(min(piece.upright, piece.lying) for piece in self.pieces)
        if narrow < 2 * REACHES:
            return Refutation("an arm is too narrow for the cup", {"arm": narrow, "cup": 2 * REACHES})
        if (near := self._nearest()) < APART:
            return Refutation("the pieces or the bin overlap at the start", {"distance": near, "least": APART})
        if (away := self._farthest()) > REACH:
            return Refutation("a piece is out of reach", {"distance": away, "reach": REACH})
        if (most := max(abs(spot.turn) for spot in self.spots)) <= 45.0:
            return Refutation("every piece already lies within 45 deg of its slot", {"turn": most})
        return None

    def _nearest(self) -> float:
        """Smallest distance between the outlines of two things on the table [m]; negative where they overlap."""
        outer = (0.0, 0.0, self.bin.width / 2 + self.bin.wall, self.bin.height / 2 + self.bin.wall)
        things = [[_corners(outer, self.x, self.y, math.radians(self.heading))]]
        for i, piece in enumerate(self.pieces):
            (x, y, _), yaw = self.start(i)
            things.append([_corners(box, x, y, yaw) for box in piece.boxes])
        pairs = itertools.combinations(things, 2)
        return min(_distance(a, b) for one, other in pairs for a in one for b in other)

    def _farthest(self) -> float:
        """Largest distance from the shoulder at which the cup must take or put down a piece [m]."""
        poses = [pose for i in range(self.count) for pose in (self.start(i), self.goal(i))]
        holds = [self.pieces[i].hold(REACHES) for i in range(self.count) for _ in range(2)]
        tops = [
            pos + _turned(h, yaw) + (self.thickness + TRANSIT) * UP for (pos, yaw), h in zip(poses, holds, strict=True)
        ]
        return max(float(np.linalg.norm(top - SHOULDER)) for top in tops)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.pieces)

    def _scene(self, pieces: Sequence[LPiece]) -> mujoco.MjSpec:
        scene = table()
        place(scene, self.bin, "bin", [self.x, self.y, TABLE_TOP], math.radians(self.heading), free=False)
        for i, piece in enumerate(pieces):
            pos, yaw = self.start(i)
            place(scene, piece, f"piece_{i}", pos, yaw)
        return scene

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """One piece replaced by another L of the same area, such that the set no longer fills the bin."""
        i, other = self.misfit
        pieces = list(self.pieces)
        pieces[i] = self.shape(other, COLOURS[i])
        return {"a piece that does not fit": self._scene(pieces)}

    @property
    def misfit(self) -> tuple[int, Ell]:
        """A piece, and an L of the same area in whose company the others fill the bin in no arrangement.

        Its mirror image, if that will do; several pieces are their own, or turn the whole packing over.
        """
        for i in range(self.count):
            for other in _same_area(self.slots[i]):
                swapped = [*self.slots[:i], other, *self.slots[i + 1 :]]
                if guillotine.solutions(swapped, self.footprint) == 0:
                    return i, other
        raise AssertionError("every L of the same area fits; no such footprint is known")

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        held = any(world.touching(ROBOT, f"piece_{i}") for i in range(self.count))
        return not held and self.gaps(world) <= self.joints + 1e-9

    @property
    def joints(self) -> float:
        """Area of the floor that stays free between the pieces and along the walls because of the clearance [m^2]."""
        return self.bin.area - sum(piece.area for piece in self.pieces)

    def gaps(self, world: World) -> float:
        """Area of the floor on which no piece lies flat [m^2]."""
        return self.bin.area - sum(piece.area for i, piece in enumerate(self.pieces) if self.lies(world, i))

    def lies(self, world: World, i: int) -> bool:
        """Whether piece `i` lies flat on the bin's floor."""
        name = f"piece_{i}"
        away = world.rot("bin").T @ (world.pos(name) - world.pos("bin"))
        inside = abs(away[0]) < self.bin.width / 2 and abs(away[1]) < self.bin.height / 2
        return inside and abs(away[2] - self.bin.floor) < DOWN and world.tilt(name) < FLAT

    def failure(self, world: World) -> str | None:
        if any(world.pos(f"piece_{i}")[2] < TABLE_TOP - 0.05 for i in range(self.count)):
            return "a piece fell off the table"
        return None

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Piece by piece: suck, lift, turn, lower into its slot, let go. Slots are filled from above, in any order."""
        for i in range(self.count):
            yield from self.pack(world, i, *self.goal(i))

    def pack(self, world: World, i: int, pos: Vec3, yaw: float) -> Plan:
        """Bring piece `i` to a position [m] and yaw [rad] in the bin, and let go once it lies there.

        A piece that stands on an edge is raised and lowered again, one that came off the cup is taken up again.
        """
        name, over = f"piece_{i}", pos + (self.thickness + ABOVE) * UP

        def lost() -> bool:
            return not world.sealed

        while not self.lies(world, i):
            if lost():
                yield from self.lift(world, i, yaw)
                yield from carry(world, name, _above(pos), yaw, within=0.02, until=lost)
            yield from carry(world, name, over, yaw, within=AIM, until=lost)
            yield from self.lower(world, i, pos - 0.002 * UP, yaw)
        yield from let_go(world)

    def lower(self, world: World, i: int, pos: Vec3, yaw: float) -> Plan:
        """Lower piece `i` softly until it lies, came off the cup, or will not go."""
        end = world.time + PATIENCE

        def done() -> bool:
            return self.lies(world, i) or not world.sealed or world.time > end

        yield from carry(world, f"piece_{i}", pos, yaw, LOWERING, slack=SLACK, until=done)

    def lift(self, world: World, i: int, yaw: float) -> Plan:
        """Take piece `i` up by suction, the wrist turned away by half of the turn that will bring it to `yaw` [rad]."""
        name = f"piece_{i}"
        turn = float(turn_between(world.rot(name), upright(yaw))[2])
        spot = world.pos(name) + _turned(self.pieces[i].hold(REACHES), yaw_of(world.rot(name)))
        down = facing_down(WRIST - turn / 2)
        yield from go_to(world, spot + (self.thickness + 0.03) * UP, down, grip=OPEN, within=0.005)
        yield from suck(world, spot + self.thickness * UP, down)
        yield from go_to(world, world.hand + TRANSIT * UP, within=0.015)

    # --- shortcuts ------------------------------------------------------------------------

    def features(self) -> Mapping[str, float]:
        """How exactly a piece is to be aimed, its weight on the cup [kg/m^2], the largest turn [rad], all packings."""
        return {
            "clearance over unit": self.clearance / self.unit,
            "weight over area": self.density * self.thickness,
            "largest turn": math.radians(max(abs(spot.turn) for spot in self.spots)),
            "solutions": self.solutions,
        }

    def shortcuts(self) -> Mapping[str, Planner]:
        return {
            "as they lie": self._as_they_lie,
            "squared up": self._squared_up,
            "all but one": self._all_but_one,
        }

    def _as_they_lie(self, world: World) -> Plan:
        """Every piece over its own slot, without turning it."""
        for i in range(self.count):
            yield from self.drop(world, i, self.goal(i)[0], yaw_of(world.rot(f"piece_{i}")))

    def _squared_up(self, world: World) -> Plan:
        """Every piece over its own slot, turned no farther than it takes to have its sides along the bin's."""
        for i in range(self.count):
            pos, goal = self.goal(i)
            wrong = round((yaw_of(world.rot(f"piece_{i}")) - goal) / (math.pi / 2)) * math.pi / 2
            yield from self.drop(world, i, pos, goal + wrong)

    def drop(self, world: World, i: int, pos: Vec3, yaw: float) -> Plan:
        """Lower piece `i` at a position [m] and yaw [rad] until it meets anything, and let go."""
        name, others = f"piece_{i}", ["bin", *(f"piece_{k}" for k in range(self.count) if k != i)]

        def met() -> bool:
            return any(world.touching(name, other) for other in others)

        yield from self.lift(world, i, yaw)
        yield from carry(world, name, _above(pos), yaw, within=0.005, until=met)
        yield from carry(world, name, pos, yaw, speed=0.06, until=met)
        yield from let_go(world)

    def _all_but_one(self, world: World) -> Plan:
        """The packing without its last piece."""
        for i in range(self.count - 1):
            yield from self.pack(world, i, *self.goal(i))


def _above(pos: Vec3) -> Vec3:
    """The place at which a piece is carried over `pos` [m]."""
    return np.array([pos[0], pos[1], TABLE_TOP + TRANSIT])


def _turned(point: tuple[float, float], yaw: float) -> Vec3:
    """A point in the plane turned by `yaw` [rad], as a vector in the world."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([c * point[0] - s * point[1], s * point[0] + c * point[1], 0.0])


def _corners(box: Box, x: float, y: float, yaw: float) -> Corners:
    """Corners of a box of a body that stands at (x, y), shape (4, 2)."""
    signs = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, s], [-s, c]])
    return np.asarray((box[:2] + signs * box[2:]) @ turn + (x, y), float)


def _distance(one: Corners, other: Corners) -> float:
    """A lower bound of the distance of two rectangles [m], exact face to face; negative where they overlap.

    The largest gap between their shadows on the directions of their sides (separating axes).
    """
    sides = np.array([one[1] - one[0], one[2] - one[1], other[1] - other[0], other[2] - other[1]])
    axes = sides / np.linalg.norm(sides, axis=1, keepdims=True)
    a, b = one @ axes.T, other @ axes.T
    return float(np.maximum(a.min(axis=0) - b.max(axis=0), b.min(axis=0) - a.max(axis=0)).max())


def _same_area(slot: Ell) -> Iterator[Ell]:
    """The mirror image of an L, then every L on the grid with the same bounds or others of the same area."""
    yield guillotine.mirrored([slot], slot.bounds)[0]
    width, height, upright, lying = (int(side) for side in slot.sides)
    for w, h, u, v in itertools.product(range(3, width + 3), range(3, height + 3), range(2, width), range(2, height)):
        if u < w and v < h and w * v + u * (h - v) == slot.area and (w, h, u, v) != (width, height, upright, lying):
            bounds = Rect.sized(w, h)
            yield Ell(bounds, Rect(Fraction(u), Fraction(v), bounds.x1, bounds.y1))
