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
Which piece lies where is dealt anew in each scene, and half of the cuts are mirror images: an arrangement learnt by
heart is right in one scene of twelve, about 8 %. Within an arrangement the lengths hardly matter to a soft hand: walls
and neighbours push a piece in that is half a unit off.

Decisions, where the paper (App. B, T33) says no more than "L-shaped pieces", "bin" and "zero gaps":

* Zero gaps means: all pieces lie flat on the bin's floor. They cannot overlap there, so that the uncovered area is the
  floor's minus theirs: the clearance around each piece, of about a millimetre, which a real joint needs. A gap would be
  at least a unit wide, and there is no area left for one. Any arrangement that does this counts, not the cut alone.
* Cuts fall on a grid. Lengths of strips between cuts are the parameters, so that every combination closes exactly.
* The bin is fixed to the table and lower than the pieces, so that the cup never meets a wall.
* The lower edges of the pieces are round, by 3 mm. With sharp ones a piece has to be held within its clearance on all
  six sides at once to enter its slot, which neither a person at a gamepad nor a hand under noise can do.
* Table 3 of the paper (line 512) lists the task under "jaw"; its description says suction, and a jaw could not let go
  of a piece between two others. It is suction here.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from ..assets import guillotine
from ..assets.bin import Bin
from ..assets.guillotine import Ell, Rect
from ..assets.l_piece import LPiece
from ..assets.prop import TABLE_TOP, Rgba, place, table
from ..errors import GaveUp
from ..geometry import UP, Vec3, about_z, between, corners, gap, yaw_of
from ..params import check_bounds, param
from ..physics import GRAVITY
from ..predicates import fallen, inside
from ..robots.panda import WRIST_MIDDLE
from ..robots.suction import CUP_HALF_WIDTH, PULL
from ..scenario import Answer, Plan, Refutation, Scenario, Shortcut, require, within_reach
from ..sim.world import ROBOT, World
from ..skills.motion import COARSE, OPEN, STEADY, Pace, facing_down, go_to, retreat, until
from ..skills.suction import carry, let_go, suck

FLAT = math.radians(2.0)
"""Largest tilt of a piece that lies flat [rad]. The thinnest piece with a side on a neighbour tilts by 4 deg."""
DOWN = 0.0015
"""Largest height of a piece's foot above the bin's floor where it lies on it [m]."""
APART = 0.008
"""Least distance of two things on the table at the start [m]: a cup may be a little off, a piece a little turned."""
RIM = 0.6
"""Depth of the bin by the thickness of the pieces."""
TRANSIT = 0.05
"""Height above the table at which pieces are carried [m], twice what stands in the way."""
ABOVE, UNDER = 0.003, 0.002
"""Height above its neighbours at which a piece hangs over its slot before it is lowered, and how far below the floor
its way ends then [m]."""
AIMING = Pace(0.25, 0.0015)
"""To that place: half the radius of a piece's lower edges is good enough, which guide it from then on."""
LOWERING, SLACK = Pace(0.04, 0.0, give_up=2.0), 0.0015
"""How a piece is lowered, which takes a second; and by how much the hand may lag [m]. A piece that is caught on an edge
presses there with some 1.5 N then and slides in, or is raised and lowered again; 2.5 N at 0.1 m from the cup would peel
it off."""
USUAL = {"left": 2, "right": 2, "low": 2, "rise": 1}
"""Lengths that somebody who does not look at the pieces supposes [units]."""
COLOURS = ((0.86, 0.46, 0.20, 1.0), (0.25, 0.58, 0.44, 1.0), (0.85, 0.70, 0.28, 1.0), (0.55, 0.40, 0.66, 1.0))


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
    deal: int = param(0, "", 0, 5)
    """Which of the first three slots belong to `piece_0`, `piece_1`, `piece_2`: number of the permutation."""
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

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.pieces)

    def _scene(self, pieces: Sequence[LPiece]) -> mujoco.MjSpec:
        scene = table()
        place(scene, self.bin, "bin", [self.x, self.y, TABLE_TOP], math.radians(self.heading), free=False)
        for i, piece in enumerate(pieces):
            place(scene, piece, f"piece_{i}", *self.start(i))
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        held = any(world.touching(ROBOT, piece) for piece in world.free_bodies)
        return not held and all(self.lies(world, i) for i in range(self.count))

    def lies(self, world: World, i: int) -> bool:
        """Whether piece `i` lies flat on the bin's floor."""
        name, away = f"piece_{i}", np.array([self.bin.width / 2, self.bin.length / 2, DOWN])
        floor = self.bin.floor * UP
        return inside(world, name, "bin", floor - away, floor + away) and world.tilt(name) < FLAT

    def failure(self, world: World) -> str | None:
        return "a piece fell off the table" if fallen(world, *world.free_bodies) else None

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Piece by piece: suck, lift, turn, lower into its slot, let go. Slots are filled from above, in any order."""
        yield from self.pack(world, self.count)

    def pack(self, world: World, count: int) -> Plan:
        """Bring the first pieces into their slots, and let each go once it lies there.

        A piece that stands on an edge is raised and lowered again, one that came off the cup is taken up again.
        """
        for i in range(count):
            while not self.lies(world, i):
                if not world.arm.sealed:
                    yield from self.fetch(world, i, *self.goal(i))
                yield from self.insert(world, i, *self.goal(i))
            yield from let_go(world.arm)

    def insert(self, world: World, i: int, pos: Vec3, yaw: float) -> Plan:
        """Aim with piece `i` over a place, then lower it softly until it lies, came off the cup, or will not go."""
        arm, name = world.arm, f"piece_{i}"
        yield from until(carry(arm, name, pos + (self.thickness + ABOVE) * UP, yaw, AIMING), lambda: not arm.sealed)
        lower = carry(arm, name, pos - UNDER * UP, yaw, LOWERING, SLACK)
        with suppress(GaveUp):
            yield from until(lower, lambda: self.lies(world, i) or not arm.sealed)

    def fetch(self, world: World, i: int, pos: Vec3, yaw: float) -> Plan:
        """Take piece `i` up by suction and bring it over a place at a yaw [rad], or lose it on the way.

        The wrist is turned away by half of the turn that this takes, before the piece is taken.
        """
        arm, name = world.arm, f"piece_{i}"
        spot, rot = world.pos(name) + world.rot(name) @ self.face(i), world.rot(name)
        down = facing_down(WRIST_MIDDLE - float(between(rot, about_z(yaw))[2]) / 2)
        yield from go_to(arm, spot + 0.03 * UP, down, STEADY, OPEN)
        yield from suck(arm, spot, down)
        yield from retreat(arm, TRANSIT)
        over = [*pos[:2], TABLE_TOP + TRANSIT]
        yield from until(carry(arm, name, over, yaw, COARSE), lambda: not arm.sealed)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        other = replace(self, deal=(self.deal + 3) % 6)
        return {
            "as_they_lie": Shortcut(lambda world: self._lay(world, lambda i: self._unturned(world, i))),
            "squared_up": Shortcut(lambda world: self._lay(world, lambda i: self._squared(world, i))),
            "all_but_one": Shortcut(lambda world: self.pack(world, self.count - 1)),
            "as_in_another_scene": Shortcut(lambda world: self._lay(world, other.goal)),
        }

    def _lay(self, world: World, pose: Callable[[int], tuple[Vec3, float]]) -> Plan:
        """Every piece at a pose, pressed down softly and let go, whatever comes of it."""
        for i in range(self.count):
            where = pose(i)
            with suppress(GaveUp):
                yield from self.fetch(world, i, *where)
                yield from self.insert(world, i, *where)
            yield from let_go(world.arm)

    def _unturned(self, world: World, i: int) -> tuple[Vec3, float]:
        return self.goal(i)[0], yaw_of(world.rot(f"piece_{i}"))

    def _squared(self, world: World, i: int) -> tuple[Vec3, float]:
        """The slot of piece `i`, and its yaw, turned no farther than its sides need to be along the bin's [rad]."""
        (pos, right), (_, yaw) = self.goal(i), self._unturned(world, i)
        return pos, yaw - math.remainder(yaw - right, math.pi / 2)

    def answer(self) -> Answer:
        """An arrangement, with the lengths that are usual: deal + 6 mirror. Time is short of a second try.

        Taken for right wherever every piece has the shape that is supposed, had the cut its own lengths.
        """

        def supposed(value: float, lengths: Mapping[str, int]) -> "Packing":
            return replace(self, **lengths, deal=int(value) % 6, mirror=int(value) // 6)

        def right(value: float) -> bool:
            return all(mine.sides == its.sides for mine, its in zip(self.slots, supposed(value, {}).slots, strict=True))

        return Answer(
            tuple(map(float, range(12))), lambda world, v: self._lay(world, supposed(v, USUAL).goal), right, tries=1
        )

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """One piece replaced by another L of the same area, such that the set no longer fills the bin."""
        i, other = guillotine.misfit(self.slots, self.footprint)
        pieces = [*self.pieces[:i], self.shape(other, COLOURS[i]), *self.pieces[i + 1 :]]
        return {"a_piece_that_does_not_fit": self._scene(pieces)}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        closes = guillotine.closes(self.slots, self.footprint)
        area, floor = float(sum(slot.area for slot in self.slots)), float(self.footprint.area)
        yield require(closes, "the pieces do not close the bin's footprint", pieces=area, bin=floor)
        narrow = min(min(piece.upright, piece.lying) for piece in self.pieces)
        yield require(
            narrow >= 2 * CUP_HALF_WIDTH, "an arm is too narrow for the cup", arm=narrow, cup=2 * CUP_HALF_WIDTH
        )
        weight = GRAVITY * max(piece.mass for piece in self.pieces)
        yield require(weight <= PULL / 2, "a piece is too heavy for the cup", weight=weight, most=PULL / 2)
        near = self._nearest()
        yield require(near >= APART, "the pieces or the bin overlap at the start", distance=near, least=APART)
        poses = [(i, *pose) for i in range(self.count) for pose in (self.start(i), self.goal(i))]
        tops = [pos + about_z(yaw) @ self.face(i) + TRANSIT * UP for i, pos, yaw in poses]
        yield within_reach("a piece", *tops)
        most = max(abs(spot.turn) for spot in self.spots)
        yield require(most > 45.0, "every piece already lies within 45 deg of its slot", turn=most)

    def _nearest(self) -> float:
        """Smallest distance between the outlines of two things on the table [m]; negative where they overlap."""
        things = [[corners([self.x, self.y], math.radians(self.heading), self.bin.outer)]]
        for i, piece in enumerate(self.pieces):
            things.append([corners(*self.start(i), part[2:], part[:2]) for part in piece.parts])
        pairs = itertools.combinations(things, 2)
        return min(gap(a, b) for one, other in pairs for a in one for b in other)

    def features(self) -> Mapping[str, float]:
        """How exactly a piece is to be aimed, its weight on the cup [kg/m^2], the largest turn [rad], all packings."""
        return {
            "clearance_over_unit": self.clearance / self.unit,
            "weight_over_area": self.density * self.thickness,
            "largest_turn": math.radians(max(abs(spot.turn) for spot in self.spots)),
            "solutions": guillotine.solutions(self.slots, self.footprint),
        }

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
        cut = guillotine.mirrored(cut, self.footprint) if self.mirror else cut
        dealt = list(itertools.permutations(cut[:3]))[self.deal]
        return *dealt, *cut[3:]

    @cached_property
    def bin(self) -> Bin:
        width, length = (self.unit * float(side) for side in (self.footprint.width, self.footprint.height))
        return Bin(width=width, length=length, depth=RIM * self.thickness)

    @cached_property
    def pieces(self) -> tuple[LPiece, ...]:
        """The slots' shapes, smaller by the clearance all round."""
        return tuple(self.shape(slot, COLOURS[i]) for i, slot in enumerate(self.slots))

    def shape(self, slot: Ell, rgba: Rgba) -> LPiece:
        """The piece that fills a slot up to the clearance."""
        sides = [self.unit * float(side) - 2 * self.clearance for side in slot.sides]
        return LPiece.of(sides, self.thickness, self.density, rgba)

    @property
    def spots(self) -> tuple[Spot, ...]:
        return (self.spot_0, self.spot_1, self.spot_2, self.spot_3)[: self.count]

    def face(self, i: int) -> Vec3:
        """Where the cup takes piece `i`, in the axes of the piece [m]."""
        return np.array([*self.pieces[i].hold(CUP_HALF_WIDTH), self.thickness])

    def goal(self, i: int) -> tuple[Vec3, float]:
        """Position of piece `i` in its slot [m], and its yaw [rad]."""
        (across, along), whole, turn = self.slots[i].middle, self.footprint, math.radians(self.heading)
        away = self.unit * np.array([float(across - whole.width / 2), float(along - whole.height / 2), 0.0])
        floor = np.array([self.x, self.y, TABLE_TOP + self.bin.floor])
        return floor + about_z(turn) @ away, turn + self.slots[i].quarter * math.pi / 2

    def start(self, i: int) -> tuple[Vec3, float]:
        """Position of piece `i` at the start [m], and its yaw [rad]."""
        spot = self.spots[i]
        return np.array([spot.x, spot.y, TABLE_TOP]), self.goal(i)[1] - math.radians(spot.turn)
