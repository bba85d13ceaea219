"""T30 shape-stack: stack all shapes one on another, so that exactly one of them touches the table.

                                            /\\
                                           |__|
        __     /\\    ____    ____         |____|          the cone goes on top, wherever it lies
       |__|   |__|  |____|  |____|  ->    |____|

Bottleneck: every shape has to stand on the one below, with its centre of mass over it, and on the cone frustum nothing
stands: its slope is steeper than friction holds, and its face smaller than any hand is exact. So it has to come last,
and the shapes under it one by one, each over the middle of the one below.

Decisions where the paper (App. B, T30) is silent:

* A stack has one shape on each: two beside each other on a third, which a wide one bears, are none.
* All shapes stand on a flat face at the start, and one of them is a frustum; two could not both be on top.
* The frustum has a straight foot for the jaw and ends in a tip: one with a wide face would be a base like any other.
* A shape that is let go and topples loses the episode: else one could try what stands on what, or lay the frustum on
  its side, where two of its faces are parallel enough.
* Chance: who does not look and takes the shape of a fixed place for the top is right in a third of training.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import combinations, pairwise

import mujoco
import numpy as np

from ..assets.prop import TABLE_TOP, place, table
from ..assets.shape import CONE_SLOPE, CYLINDER, FRUSTUM, HEXAGON, Shape
from ..geometry import UP, Vec3, about_z
from ..params import check_bounds, param
from ..predicates import fallen, still
from ..robots.jaw import OPEN_GAP, PAD_BELOW, PALM_ABOVE, PALM_ALONG, TIP_BELOW
from ..scenario import Answer, Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import ROBOT, World
from ..skills.jaw import pick, put
from ..skills.motion import OPEN, Pace, closing_along, go_to, hand_yaw, retreat

TOPPLED = math.radians(30.0)
"""Lean at which a shape that is let go is lost [rad]. The feet of one that overhangs let it lean by 5 deg; one 52 mm
high and 44 mm wide tips over its edge at 40 deg."""
SLACK = math.radians(10.0)
"""By how much the cone's slope is steeper than friction holds, at least [rad]: a shape 10 % rougher, as in jittered
runs, is held to 3 deg more, and MuJoCo's cone gives 1 deg."""
BEYOND = 0.004
"""How far over the edge a shape's middle is let go, by who does not look for the one below [m]."""
STANDS = 0.01
"""Speed below which a shape stands [m/s]."""
LOWEST, CLEAR = TIP_BELOW + 0.003, 0.004
"""Of the grip site over what a shape stands on; between a shape and the palm [m]."""
BITE = 0.005
"""Of the cone's collar between the pads, at least [m]."""
ROOM = 0.010
"""Air that the jaw needs in all [m]: moves are exact to 3 mm."""
OVER = 0.03
"""How far the hand rises over a shape that it has let go, and a held one over the pile [m]."""
LEVEL = Pace(0.30, 0.008)
"""Over the pile to the next shape."""


@dataclass(frozen=True, kw_only=True)
class Piece:
    """A shape and where it stands."""

    x: float = param(-0.16, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    yaw: float = param(0.0, "deg", -180.0, 180.0, period=360.0)
    shape: Shape = Shape()

    def __post_init__(self) -> None:
        check_bounds(self)

    @property
    def spot(self) -> Vec3:
        """Under its middle [m]."""
        return np.array([self.x, self.y, TABLE_TOP])


@dataclass(frozen=True, kw_only=True)
class ShapeStack(Scenario):
    """Three to five shapes on the table."""

    HOLD = 1.0
    NO_ABLATIONS = "every shape is part of what is asked for: none can be taken away"

    count: int = param(4, "", 3, 5)
    """How many there are: the cone, and pieces from the first one on."""
    cone_at: int = param(1, "", 0, 4)
    """In whose place the cone stands."""
    cone: Shape = Shape(kind=FRUSTUM, width=0.042, height=0.041)
    a: Piece = Piece(y=0.19)
    b: Piece = Piece()
    c: Piece = Piece(y=-0.19, shape=Shape(kind=CYLINDER))
    d: Piece = Piece(x=0.03, y=0.10, shape=Shape(kind=HEXAGON))
    e: Piece = Piece(x=0.03, y=-0.10)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        for name, piece in self.pieces.items():
            place(scene, piece.shape, name, piece.spot, math.radians(piece.yaw))
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        touched = {name: world.touching_bodies(name) for name in self.pieces}
        neighbours = {name: len(touched[name] & touched.keys()) for name in touched}
        bottom = [name for name in touched if "table" in touched[name]]
        return bool(
            [neighbours[name] for name in bottom] == [1]
            and all(1 <= number <= 2 for number in neighbours.values())
            and not any(ROBOT in others for others in touched.values())
            and all(still(world, name, STANDS) for name in touched)
        )

    def failure(self, world: World) -> str | None:
        if fallen(world, *self.pieces):
            return "a shape fell off the table"
        toppled = (n for n in self.pieces if world.tilt(n) > TOPPLED and not world.touching(ROBOT, n))
        return "a shape toppled" if next(toppled, None) else None

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """The widest shape stays; the others on it, the wider ones first, what is pointed last."""
        yield from self.pile(world, self.order)

    def pile(self, world: World, order: Sequence[str], off: float = 0.0) -> Plan:
        """Put every shape on the one before it, its middle `off` the other's towards the robot [m]."""
        for below, name in pairwise(order):
            yield from self.take(world, name)
            at = self.over(world, name, below) - [off, 0.0, 0.0]
            yield from put(world.arm, name, at, on=below, hover=self.hover(world, name))
            yield from retreat(world.arm, self.pieces[name].shape.height + OVER)

    def take(self, world: World, name: str) -> Plan:
        """Take a shape across that of its sides for which the hand turns least."""
        arm, shape, high = world.arm, self.pieces[name].shape, self.hover(world, name)
        sides = [about_z(angle) @ world.rot(name)[:, 0] for angle in shape.sides]
        side = min(sides, key=lambda n: abs(math.remainder(math.atan2(-n[0], n[1]) - hand_yaw(arm), math.pi)))
        at = world.pos(name) + shape.between * side + self.grip(shape) * UP
        yield from go_to(arm, at + high * UP, closing_along(arm, side), LEVEL, OPEN)
        yield from pick(arm, at, side, above=high, lift=high)

    def grip(self, shape: Shape) -> float:
        """Height of the grip site over the foot of a shape [m]."""
        return max(LOWEST, (LOWEST if shape.pointed else shape.height / 2), shape.height + CLEAR - PALM_ABOVE)

    def over(self, world: World, name: str, below: str) -> Vec3:
        """Where the centre of mass of a shape is when it stands on the middle of another [m]."""
        return world.pos(below) + self.pieces[below].shape.height * UP + world.com(name) - world.pos(name)

    def hover(self, world: World, name: str) -> float:
        """How far a shape has to be lifted to pass over all others [m]."""
        tops = (world.pos(n)[2] + p.shape.height for n, p in self.pieces.items() if n != name)
        return max(tops) - TABLE_TOP + OVER

    # --- shortcuts ------------------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        """Other orders, and what is no pile."""
        *flat, cone = self.order
        orders = {
            "as_they_stand": tuple(self.pieces),
            "cone_at_the_bottom": (cone, *flat),
            "cone_in_the_middle": (flat[0], cone, *flat[1:]),
        }
        wrong = {name: Shortcut(self._in_order(order)) for name, order in orders.items() if order[-1] != cone}
        over = self.pieces[flat[0]].shape.reach + BEYOND
        return {
            **wrong,
            "over_the_edge": Shortcut(self._in_order(self.order, over)),
            "leave_the_cone": Shortcut(self._in_order(flat)),
        }

    def _in_order(self, order: Sequence[str], off: float = 0.0) -> Planner:
        return lambda world: self.pile(world, order, off)

    def answer(self) -> Answer:
        """Which shape comes last, by its place. One try: what is put on the cone topples."""

        names = list(self.pieces)

        def last(world: World, number: float) -> Plan:
            top = names[round(number)]
            yield from self.pile(world, [*(name for name in self.order if name != top), top])

        return Answer((0.0, 1.0, 2.0), last, lambda number: names[round(number)] == self.order[-1], tries=1)

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        pieces = list(self.pieces.values())
        frustums = sum(piece.shape.kind == FRUSTUM for piece in pieces)
        yield require(frustums == 1, "not exactly one shape is a frustum", frustums=frustums)
        yield require(self.cone.pointed, "the cone has a face to stand on", radius=self.cone.top)
        held = math.atan(max(piece.shape.friction for piece in pieces)) + SLACK
        yield require(held <= CONE_SLOPE, "a shape may rest on the slope of the cone", slope=CONE_SLOPE, needed=held)
        for shape in (piece.shape for piece in pieces):
            yield require(shape.width + ROOM <= OPEN_GAP, "the jaw cannot take a shape", width=shape.width)
            held = shape.collar - self.grip(shape) + PAD_BELOW if shape.pointed else BITE
            yield require(held >= BITE, "the jaw cannot hold the cone by its collar", held=held, needed=BITE)
        yield on_table("a shape", [piece.spot for piece in pieces], margin=0.05)
        away = min(math.dist(one.spot, other.spot) for one, other in combinations(pieces, 2))
        need = PALM_ALONG + max(piece.shape.reach for piece in pieces) + ROOM
        yield require(away >= need, "the hand has no room beside the pile", away=away, needed=need)
        tower = sum(piece.shape.height for piece in pieces) * UP
        base = self.pieces[self.order[0]].spot
        yield within_reach("a shape or the top of the pile", base + tower, *(piece.spot for piece in pieces))

    def features(self) -> Mapping[str, float]:
        """How slender the pile is, what its joints hold by, and how many there are."""
        shapes = [piece.shape for piece in self.pieces.values()]
        return {
            "slenderness": sum(s.height for s in shapes) / min(s.width for s in shapes),
            "height": sum(s.height for s in shapes),
            "friction": min(s.friction for s in shapes),
            "joints": self.count - 1,
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def pieces(self) -> dict[str, Piece]:
        """Those that there are, by names that say nothing about shapes or places."""
        places = [piece for field in fields(self) if isinstance(piece := getattr(self, field.name), Piece)]
        cone = places.pop(self.cone_at)
        found = places[: self.count - 1]
        found.insert(self.cone_at, replace(cone, shape=self.cone))
        return {f"shape_{k}": piece for k, piece in enumerate(found)}

    @cached_property
    def order(self) -> tuple[str, ...]:
        """From the widest to the narrowest, and the pointed ones last."""
        pieces = self.pieces
        return tuple(sorted(pieces, key=lambda n: (pieces[n].shape.pointed, -pieces[n].shape.reach)))
