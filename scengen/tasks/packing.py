"""T33 packing: lay L-shaped pieces into a bin that they fill without a gap, with a suction cup.

    +-+--------+      The bin's footprint is cut into the pieces by guillotine cuts (assets/guillotine.py), so a packing
    | |   +----+      without gaps exists. The pieces lie around the bin, each turned away from its slot. x and y of the
    | | 3 |  2 |      sketch are the bin's axes; piece 1 frames a rectangle that a staircase divides between 2 and 3.
    | +---+    |      With four pieces the footprint is cut in two instead, and a staircase divides each half.
    |1|   2    |
    | +--------+
    |    1     |
    +----------+

Bottleneck: no slot is visible, and one wrong piece comes to lie on the others. Suction grips only from above: no piece
can be turned over. The assignment of pieces to slots is drawn for each scene, and half of the cuts are mirrored: one
memorised arrangement is right in one scene of twelve, or in 10 to 14 %, because some pieces are alike. Within an
arrangement the lengths have little influence on a compliant hand: walls and neighbours push a piece in that is half a
unit off.

Decisions, where the paper (App. B, T33) says no more than "L-shaped pieces", "bin" and "zero gaps":

* Zero gaps means: all pieces lie flat on the bin's floor. They cannot overlap there, so the uncovered area is the
  floor's minus theirs. That is the clearance around each piece, about a millimetre, which a real joint needs. A gap
  would be at least a unit wide, and no area remains for one. Every arrangement with this property counts, not only the
  cut.
* Cuts fall on a grid. Lengths of strips between cuts are the parameters, so that every combination closes exactly.
* The bin is fixed to the table and lower than the pieces, so that the cup never touches a wall.
* The lower edges of the pieces are rounded by 3 mm. With sharp edges a piece must be held within its clearance on all
  six sides at once to enter its slot, which neither a person at a gamepad nor a hand under noise can do.
* The pieces need not be worked out together, as the staircase turned by half is again a packing. The largest piece to
  its corner by its handedness, and the others in any order, flush with the free corners, with memorised quarter turns,
  solve 36 of 36 (`tight` and `large_turns` 8 of 8, `four_pieces` 10 of 12). The yaws of the three pieces at the start
  alone reveal which of the twelve arrangements it is (99.8 % of 500). Both are fair.
* A piece has one place: where it first touched the bin or a piece in it. Otherwise the cup feels for the arrangement:
  held over one place after the other, a piece goes in or is stopped by its neighbours (7 of 12).
* Table 3 of the paper (line 512) lists the task under "jaw"; its description says suction, and a jaw could not release
  a piece between two others. It is suction here.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import mujoco
import numpy as np

from ..assets import guillotine
from ..assets.bin import Bin
from ..assets.guillotine import Ell
from ..assets.l_piece import LPiece
from ..assets.prop import TABLE_TOP, Rgba, place, table
from ..decisions import Decision, around, choice, side_of
from ..errors import GaveUp
from ..geometry import UP, Vec3, about_z, corners, least_gap, way_to, yaw_of
from ..means import Mean, throughout
from ..params import Bounded, param
from ..physics import GRAVITY
from ..predicates import fallen, inside, off_first_pose, remember_first_pose
from ..robots.suction import CUP_HALF_WIDTH, PULL
from ..scenario import Answer, Plan, Planner, Refutation, Scenario, Shortcut, require, within_reach
from ..sim.arm import ROBOT
from ..sim.memory import remember
from ..sim.world import World
from ..skills import fitting
from ..skills.suction import let_go

FLAT_TOLERANCE = math.radians(2.0)
"""Largest tilt of a piece that lies flat [rad]. The thinnest piece with a side on a neighbour tilts by 4 deg."""
FLOOR_TOLERANCE = 0.0015
"""Largest height of the foot of a piece above the bin's floor at which the piece lies on it [m]."""
MAX_TURN = math.radians(45.0)
"""Largest turn of a piece after its first touch in the bin [rad]; the largest shift is a unit. Under jitter, walls and
neighbours shift a piece by more than 0.75 units. Another slot is farther away, or a quarter turn."""
MIN_CLEARANCE = 0.008
"""Least distance of two bodies on the table at the start [m]: a cup may be a little off, a piece a little turned."""
USUAL_LENGTHS = {"left": 2, "right": 2, "low": 2, "rise": 1}
"""Lengths that a plan assumes which does not look at the pieces [units]."""
COLOURS = ((0.86, 0.46, 0.20, 1.0), (0.25, 0.58, 0.44, 1.0), (0.85, 0.70, 0.28, 1.0), (0.55, 0.40, 0.66, 1.0))


@dataclass(frozen=True, kw_only=True)
class Spot(Bounded):
    """Place of a piece at the start, and the counterclockwise turn from its yaw to that of its slot."""

    x: float = param(0.0, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    turn: float = param(60.0, "deg", -180.0, 180.0, period=360.0)


@dataclass(frozen=True, kw_only=True)
class Packing(Scenario):
    """Three or four L-shaped pieces and the bin whose footprint they were cut from. Lengths of strips are in units."""

    VERSION = 2
    HOLD = 0.3

    count: int = param(3, "pieces", 3, 4)
    unit: float = param(0.018, "m", 0.015, 0.025)
    frame: int = param(2, "units", 2, 3)
    left: int = param(2, "units", 2, 4)
    right: int = param(2, "units", 2, 4)
    low: int = param(2, "units", 2, 4)
    rise: int = param(1, "units", 1, 3)
    top: int = param(2, "units", 2, 4)
    mirror: int = param(0, "1", 0, 1, answer=True)
    deal: int = param(0, "", 0, 5, answer=True)
    """Number of the permutation that assigns the first three slots to `piece_0`, `piece_1` and `piece_2`."""
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
        remember(scene, *(f"{value}_{i}" for i in range(self.count) for value in ("tried", "x", "y", "yaw")))
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
        name, (low, high) = f"piece_{i}", self.bin.floor_region(FLOOR_TOLERANCE)
        return inside(world, name, "bin", low, high) and world.tilt(name) < FLAT_TOLERANCE

    def failure(self, world: World) -> str | None:
        return "a piece fell off the table" if fallen(world, *world.free_bodies) else None

    def means(self) -> Mapping[str, Mean]:
        numbers = range(self.count)

        def carried(world: World, i: int) -> bool:
            away = world.rot("bin").T @ (world.pos(f"piece_{i}") - world.pos("bin"))
            over = abs(away[0]) < self.bin.width / 2 and abs(away[1]) < self.bin.length / 2
            return not over or away[2] < self.bin.floor + self.bin.depth or world.arm.grips(f"piece_{i}")

        return {
            "suction held each piece until it was down in the bin": throughout(
                lambda world: all(carried(world, i) for i in numbers)
            ),
            "no piece was tried in a second place": throughout(
                lambda world: not any(self._elsewhere(world, i) for i in numbers)
            ),
        }

    def _elsewhere(self, world: World, i: int) -> bool:
        """Whether piece `i` is in a different place than at its first touch in the bin."""
        shift, turn = off_first_pose(world, f"piece_{i}", i)
        return shift > self.unit or turn > MAX_TURN

    def events(self, world: World) -> None:
        """Remember where each piece first touches the bin, or another piece over the bin."""
        half = np.array([self.bin.width / 2, self.bin.length / 2, math.inf])
        for i in range(self.count):
            name = f"piece_{i}"
            met = world.touching_bodies(name).difference({ROBOT, "table"})
            if met and inside(world, name, "bin", -half, half):
                remember_first_pose(world, name, i)

    def pending(self, world: World) -> bool:
        return False

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Take each piece by suction, lift and turn it, lower it into its slot, let go. Any order of slots works."""
        yield from self.pack(world, self.count)

    def pack(self, world: World, count: int) -> Plan:
        """Bring the first `count` pieces into their slots, and release each once it lies there."""
        for i in range(count):
            lies = partial(self.lies, world, i)
            yield from fitting.fit(world.arm, f"piece_{i}", self.face(i), *self.goal(i), self.thickness, lies)

    def insert(self, world: World, i: int, pos: Vec3, yaw: float) -> Plan:
        """Lower the held piece `i` into a place at a yaw [rad]; see `fitting.insert`."""
        lies = partial(self.lies, world, i)
        yield from fitting.insert(world.arm, f"piece_{i}", pos, yaw, self.thickness, lies)

    def steps(self) -> Mapping[str, Planner]:
        turned = set[int]()

        def piece(world: World) -> int | None:
            return next((i for i in range(self.count) if not self.lies(world, i)), None)

        def held(world: World) -> int | None:
            if (i := piece(world)) is not None and not world.arm.sealed:
                raise GaveUp("no piece is in the cup")
            return i

        def take(world: World) -> Plan:
            if (i := piece(world)) is not None and not world.arm.sealed:
                yield from fitting.take(world.arm, f"piece_{i}", self.face(i), self.goal(i)[1])

        def turn(world: World) -> Plan:
            if (i := held(world)) is not None:
                turned.add(i)
                yield from fitting.bring(world.arm, f"piece_{i}", *self.goal(i))

        def lower(world: World) -> Plan:
            if (i := held(world)) is not None:
                yield from self.insert(world, i, *(self.goal(i) if i in turned else self._unturned(world, i)))
                if self.lies(world, i):
                    yield from let_go(world.arm)

        return {"take_piece": take, "turn_piece": turn, "lower_piece": lower}

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        other = replace(self, deal=(self.deal + 3) % 6)
        return {
            "as_they_lie": Shortcut(lambda world: self._place_all(world, lambda i: self._unturned(world, i))),
            "squared_up": Shortcut(lambda world: self._place_all(world, lambda i: self._squared(world, i))),
            "all_but_one": Shortcut(lambda world: self.pack(world, self.count - 1)),
            "as_in_another_scene": Shortcut(lambda world: self._place_all(world, other.goal)),
        }

    def _place_all(self, world: World, pose: Callable[[int], tuple[Vec3, float]]) -> Plan:
        """Press each piece down softly at a pose and let go there."""
        for i in range(self.count):
            lies = partial(self.lies, world, i)
            yield from fitting.lay(world.arm, f"piece_{i}", self.face(i), *pose(i), self.thickness, lies)

    def _unturned(self, world: World, i: int) -> tuple[Vec3, float]:
        """Position of the slot of piece `i`, and the piece's present yaw [rad]."""
        return self.goal(i)[0], yaw_of(world.rot(f"piece_{i}"))

    def _squared(self, world: World, i: int) -> tuple[Vec3, float]:
        """Position of the slot of piece `i`, and the nearest yaw at which its sides are along the bin's [rad]."""
        (pos, right), (_, yaw) = self.goal(i), self._unturned(world, i)
        return pos, yaw - math.remainder(yaw - right, math.pi / 2)

    def answer(self) -> Answer:
        """Number of an arrangement with the usual lengths: deal + 6 mirror. A piece has one try.

        It is right if every piece has the shape that this arrangement supposes for the cut's own lengths.
        """

        def supposed(value: float, lengths: Mapping[str, int]) -> "Packing":
            return replace(self, **lengths, deal=int(value) % 6, mirror=int(value) // 6)

        numbers, right = tuple(map(float, range(12))), lambda v: self.cut.like(supposed(v, {}).cut)
        return Answer(numbers, lambda w, v: self._place_all(w, supposed(v, USUAL_LENGTHS).goal), right, tries=1)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Replace one piece by another L of the same area, so that the set no longer fills the bin."""
        i, other = guillotine.misfit(*self.cut)
        pieces = [*self.pieces[:i], self.shape(other, COLOURS[i]), *self.pieces[i + 1 :]]
        return {"a_piece_that_does_not_fit": self._scene(pieces)}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        sizes = ("left", "right", "low", "rise", "top", "*width*", "*length*")
        found: dict[str, Decision] = {"arrangement": choice((self.mirror, self.deal), *sizes)}
        for i in range(self.count):
            (at, yaw), (_, begins) = self.goal(i), self.start(i)
            across = about_z(-math.radians(self.heading)) @ (at - [self.x, self.y, 0.0])
            turn = math.degrees(math.remainder(yaw - begins, math.tau))
            found[f"slot_of_piece_{i}"] = choice((bool(across[0] > 0), bool(across[1] > 0)), *sizes)
            found[f"piece_{i}_turns"] = choice(side_of(turn), f"spot_{i}.turn")
            found[f"turn_of_piece_{i}"] = around(turn, 22.0, f"spot_{i}.turn")
        return found

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        area, floor = float(sum(slot.area for slot in self.cut.pieces)), float(self.cut.rect.area)
        closes = guillotine.closes(*self.cut)
        yield require(closes, "the pieces do not close the bin's footprint", pieces=area, bin=floor)
        narrow, cup = min(min(piece.upright, piece.lying) for piece in self.pieces), 2 * CUP_HALF_WIDTH
        yield require(narrow >= cup, "an arm is too narrow for the cup", arm=narrow, cup=cup)
        weight = GRAVITY * max(piece.mass for piece in self.pieces)
        yield require(weight <= PULL / 2, "a piece is too heavy for the cup", weight=weight, most=PULL / 2)
        bodies = [[corners([self.x, self.y], math.radians(self.heading), self.bin.outer)]]
        bodies += [piece.outlines(*self.start(i)) for i, piece in enumerate(self.pieces)]
        near, least = least_gap(bodies), MIN_CLEARANCE
        yield require(near >= least, "the pieces or the bin overlap at the start", distance=near, least=least)
        poses = [(i, *pose) for i in range(self.count) for pose in (self.start(i), self.goal(i))]
        tops = [pos + about_z(yaw) @ self.face(i) + fitting.CARRY_HEIGHT * UP for i, pos, yaw in poses]
        yield within_reach("a piece", *tops)
        most = max(abs(spot.turn) for spot in self.spots)
        yield require(most > 45.0, "every piece already lies within 45 deg of its slot", turn=most)

    def features(self) -> Mapping[str, float]:
        """Relative clearance, mass per area of a piece [kg/m^2], largest turn [rad], number of packings."""
        return {
            "clearance_over_unit": self.clearance / self.unit,
            "weight_over_area": self.density * self.thickness,
            "largest_turn": math.radians(max(abs(spot.turn) for spot in self.spots)),
            "solutions": guillotine.solutions(*self.cut),
        }

    def facts(self) -> Mapping[str, float | str]:
        spot = max(zip(self.pieces, self.spots, strict=False), key=lambda each: each[0].mass)[1]  # of equal densities
        return {
            "pieces": self.count,
            "left": sum(spot.y > 0.0 for spot in self.spots),
            "thickness": self.thickness,
            "largest": way_to(np.array([spot.x, spot.y]), np.array([self.x, self.y])),
            "turned": sum(abs(math.remainder(spot.turn, 360.0)) > 5.0 for spot in self.spots),
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def cut(self) -> guillotine.Cut:
        """The bin's floor as it was cut into the slots of the pieces, in units."""
        strips = self.left, self.right, self.low, self.rise, self.top
        cut = guillotine.three(self.frame, *strips) if self.count == 3 else guillotine.four(*strips)
        return (cut.mirrored() if self.mirror else cut).dealt(self.deal)

    @cached_property
    def bin(self) -> Bin:
        width, length = (self.unit * float(side) for side in (self.cut.rect.width, self.cut.rect.height))
        return Bin(width=width, length=length, depth=0.6 * self.thickness)  # lower than the pieces

    @cached_property
    def pieces(self) -> tuple[LPiece, ...]:
        """Pieces with the slots' shapes, smaller by the clearance on all sides."""
        return tuple(self.shape(slot, COLOURS[i]) for i, slot in enumerate(self.cut.pieces))

    def shape(self, slot: Ell, rgba: Rgba) -> LPiece:
        """Piece that fills a slot up to the clearance."""
        sides = [self.unit * float(side) - 2 * self.clearance for side in slot.sides]
        return LPiece.of(sides, self.thickness, self.density, rgba)

    @cached_property
    def spots(self) -> tuple[Spot, ...]:
        return (self.spot_0, self.spot_1, self.spot_2, self.spot_3)[: self.count]

    def face(self, i: int) -> Vec3:
        """Place at which the cup takes piece `i`, in the axes of the piece [m]."""
        return np.array([*self.pieces[i].hold(CUP_HALF_WIDTH), self.thickness])

    def goal(self, i: int) -> tuple[Vec3, float]:
        """Position of piece `i` in its slot [m], and its yaw [rad]."""
        (across, along), whole, turn = self.cut.pieces[i].middle, self.cut.rect, math.radians(self.heading)
        away = self.unit * np.array([float(across - whole.width / 2), float(along - whole.height / 2), 0.0])
        floor = np.array([self.x, self.y, TABLE_TOP + self.bin.floor])
        return floor + about_z(turn) @ away, turn + self.cut.pieces[i].quarter * math.pi / 2

    def start(self, i: int) -> tuple[Vec3, float]:
        """Position of piece `i` at the start [m], and its yaw [rad]."""
        spot = self.spots[i]
        return np.array([spot.x, spot.y, TABLE_TOP]), self.goal(i)[1] - math.radians(spot.turn)
