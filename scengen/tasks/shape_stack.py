"""T30 shape-stack: stack all shapes one on another, so that exactly one of them touches the table.

                                            /\\
                                           |__|
        __     /\\    ____    ____         |____|          the cone goes on top, from any place
       |__|   |__|  |____|  |____|  ->    |____|

Bottleneck: every shape must stand on the one below, with its centre of mass over it. Nothing stands on the cone
frustum: its slope is steeper than friction holds, and its upper face is smaller than any hand is exact. So it must come
last, and each other shape must be placed over the middle of the one below.

The shapes are a subset of the paper's five, each at most once: cube, cylinder, hexagonal and triangular prism, cone
frustum. Decisions where the paper (App. B, T30) is silent:

* A stack has one shape on each. Two shapes beside each other on a third, which a wide one supports, are not a stack.
* All shapes stand on a flat face at the start. The frustum is always among them: without it any order would do.
* The frustum has a straight foot for the jaw and ends in a tip: with a wide face it would be a base like any other.
* Shapes stay upright, and nothing is set on the frustum, in the hand or not. Otherwise a policy could try what stands
  on what: a jaw that opens by 3 mm feels a shape lean on it, and closes again. Or it could lay the frustum on its side,
  where two of its faces are parallel enough.
* Chance: the shape at one fixed place is the right one for the top in a third of training. The frustum is also the
  narrowest shape, the highest one and the only one of its colour: a policy that puts the narrowest or the highest last
  is right in 12 of 12, without asking what stands on what. No axis breaks narrowest or colour.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, pairwise, permutations
from typing import NamedTuple

import mujoco
import numpy as np

from ..assets.prop import TABLE_TOP, place, table
from ..assets.shape import CONE_SLOPE, CYLINDER, FRUSTUM, HEXAGON, TRIANGLE, Shape
from ..decisions import Decision, choice
from ..geometry import UP, Vec3, about_z
from ..means import Mean, throughout
from ..params import Bounded, param
from ..predicates import fallen, still
from ..robots.jaw import OPEN_GAP, PAD_BELOW, PALM_ABOVE, PALM_ALONG, TIP_BELOW
from ..robots.panda import BASE
from ..scenario import Answer, Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT
from ..sim.world import World
from ..skills.jaw import pick, put
from ..skills.motion import OPEN, Pace, closing_along, go_to, hand_yaw, retreat

FALL_ANGLE = math.radians(30.0)
"""Tilt at which a shape has toppled [rad]. The feet of an overhanging shape let it lean by 5 deg; a shape 52 mm
high and 44 mm wide tips over its edge at 40 deg."""
MAX_DROP_SPEED = 0.35  # speed of a shape in the air above which it falls [m/s]: as of a fall from 6 mm
SLOPE_MARGIN = math.radians(10.0)
"""Least angle by which the cone's slope is steeper than friction holds [rad]: friction higher by 10 %, as in jittered
runs, holds 3 deg more, and MuJoCo's friction cone gives 1 deg."""
MIN_GRIP_HEIGHT = TIP_BELOW + 0.003  # least height of the grip site above the foot of a shape [m]
MIN_PAD_OVERLAP = 0.005  # least height of the cone's collar between the pads [m]
MIN_CLEARANCE = 0.010  # total clearance that the jaw needs [m]: moves are exact to 3 mm
CARRY_HEIGHT = 0.03
"""Height above the pile at which a shape is carried, and above a released shape to which the hand rises [m]."""
CARRY_PACE = Pace(0.30, 0.008)  # pace of the move above the pile to the next shape


@dataclass(frozen=True, kw_only=True)
class Place(Bounded):
    """A place for a shape at the start."""

    x: float = param(-0.16, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    yaw: float = param(0.0, "deg", -180.0, 180.0, period=360.0)

    @cached_property
    def spot(self) -> Vec3:
        """Position of the foot of a shape that stands here [m]."""
        return np.array([self.x, self.y, TABLE_TOP])


class Piece(NamedTuple):
    """A shape at its place."""

    place: Place
    shape: Shape


@dataclass(frozen=True, kw_only=True)
class ShapeStack(Scenario):
    """Three to five of the paper's five shapes on the table."""

    VERSION = 2
    HOLD = 1.0
    NO_ABLATIONS = "every shape is part of what is asked for: none can be taken away"

    count: int = param(4, "", 3, 5)  # number of shapes: the cone, and others from the first place on
    cone_at: int = param(1, "", 0, 4, answer=True)  # index of the cone's place
    deal: int = param(
        0, "", 0, 23, answer=True
    )  # index of the permutation of the other four shapes over the other places
    perched: int = param(0, "", 0, 1)  # 1: the cone starts on the widest shape, and its place is free
    cone: Shape = Shape(kind=FRUSTUM, width=0.042, height=0.041)
    cube: Shape = Shape()
    cylinder: Shape = Shape(kind=CYLINDER)
    hexagon: Shape = Shape(kind=HEXAGON)
    prism: Shape = Shape(kind=TRIANGLE, width=0.050)
    a: Place = Place(y=0.19)
    b: Place = Place()
    c: Place = Place(y=-0.19)
    d: Place = Place(x=0.03, y=0.10)
    e: Place = Place(x=0.03, y=-0.10)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        for name, piece in self.pieces.items():
            place(scene, piece.shape, name, self.foot(name), math.radians(piece.place.yaw))
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
            and all(still(world, name, 0.01) for name in touched)
        )

    def failure(self, world: World) -> str | None:
        return "a shape fell off the table" if fallen(world, *self.pieces) else None

    def means(self) -> Mapping[str, Mean]:
        def falls(world: World, name: str) -> bool:
            return world.velocity(name)[5] < -MAX_DROP_SPEED and not world.touching_bodies(name)

        return {
            "nothing was set on the cone": throughout(lambda world: not self.cone_tried(world)),
            "each shape was kept upright": throughout(
                lambda world: all(world.tilt(name) <= FALL_ANGLE for name in self.pieces)
            ),
            "each shape was set down without a fall": throughout(
                lambda world: not any(falls(world, name) for name in self.pieces)
            ),
        }

    def cone_tried(self, world: World) -> bool:
        """Whether another shape is on the cone, held or not: it touches the cone with its foot above the collar."""
        cone = self.order[-1]
        above = world.pos(cone)[2] + self.cone.collar
        return any(world.pos(n)[2] > above for n in world.touching_bodies(cone) & self.pieces.keys())

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Leave the widest shape in place, stack the others on it, wider ones first and the cone last."""
        *flat, cone = self.order
        if self.perched:
            yield from self.take(world, cone)
            free = self.pieces[cone].place.spot + world.com(cone) - world.pos(cone)
            yield from put(world.arm, cone, free, on="table", hover=self.lift_height(world, cone))
            yield from retreat(world.arm, self.lift_height(world, flat[0]))
        yield from self.pile(world, [*flat, cone])

    def pile(self, world: World, order: Sequence[str], offset: float = 0.0) -> Plan:
        """Put each shape on the previous one it, with its middle offset from the other's towards the robot [m]."""
        for below, name in pairwise(order):
            yield from self.take(world, name)
            at = self.place_on(world, name, below) - [offset, 0.0, 0.0]
            yield from put(world.arm, name, at, on=below, hover=self.lift_height(world, name))
            yield from retreat(world.arm, self.pieces[name].shape.height + CARRY_HEIGHT)

    def take(self, world: World, name: str) -> Plan:
        """Grasp a shape across the side for which the hand turns least, and lift it above the others."""
        arm, shape, height = world.arm, self.pieces[name].shape, self.lift_height(world, name)
        sides = [about_z(angle) @ world.rot(name)[:, 0] for angle in shape.sides]
        side = min(sides, key=lambda n: abs(math.remainder(math.atan2(-n[0], n[1]) - hand_yaw(arm), math.pi)))
        at = world.pos(name) + shape.between * side + self.grip_height(shape) * UP
        yield from go_to(arm, at + height * UP, closing_along(arm, side), CARRY_PACE, OPEN)
        yield from pick(arm, at, side, above=height, lift=height)

    def grip_height(self, shape: Shape) -> float:
        """Height of the grip site above the foot of a shape [m], with 4 mm between shape and palm."""
        middle = MIN_GRIP_HEIGHT if shape.pointed else shape.height / 2
        return max(MIN_GRIP_HEIGHT, middle, shape.height + 0.004 - PALM_ABOVE)

    def place_on(self, world: World, name: str, below: str) -> Vec3:
        """Position of a shape's centre of mass when the shape stands on the middle of another one [m]."""
        return world.pos(below) + self.pieces[below].shape.height * UP + world.com(name) - world.pos(name)

    def lift_height(self, world: World, name: str) -> float:
        """Height to which a shape must be lifted to pass over all others [m]."""
        tops = (world.pos(n)[2] + p.shape.height for n, p in self.pieces.items() if n != name)
        return max(tops) - TABLE_TOP + CARRY_HEIGHT

    # --- shortcuts ------------------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        """Stacks in other orders, and plans that leave an incomplete stack."""
        *flat, cone = self.order
        orders = {
            "as_they_stand": tuple(self.pieces),
            "cone_at_the_bottom": (cone, *flat),
            "cone_in_the_middle": (flat[0], cone, *flat[1:]),
        }
        wrong = {name: Shortcut(self._in_order(order)) for name, order in orders.items() if order[-1] != cone}
        over_edge = self.pieces[flat[0]].shape.reach + 0.004  # the middle is 4 mm over the edge
        return {
            **wrong,
            "over_the_edge": Shortcut(self._in_order(self.order, over_edge)),
            "leave_the_cone": Shortcut(self._in_order(flat)),
        }

    def _in_order(self, order: Sequence[str], offset: float = 0.0) -> Planner:
        """Plan that stacks the shapes in some order."""
        return lambda world: self.pile(world, order, offset)

    def answer(self) -> Answer:
        """Index of the shape that comes last. One try: a shape that is put on the cone topples."""

        names = list(self.pieces)

        def last(world: World, number: float) -> Plan:
            top = names[round(number)]
            yield from self.pile(world, [*(name for name in self.order if name != top), top])

        return Answer((0.0, 1.0, 2.0), last, lambda number: names[round(number)] == self.order[-1], tries=1)

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        widths = ("*width*", "*length*")
        return {
            "last": choice(self.order[-1]),
            "base": choice(self.order[0], *widths),
            "second": choice(self.order[1], *widths),
            "shapes": choice(self.count, "count"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        pieces = list(self.pieces.values())
        frustums = sum(piece.shape.kind == FRUSTUM for piece in pieces)
        yield require(frustums == 1, "not exactly one shape is a frustum", frustums=frustums)
        yield require(self.cone.pointed, "the cone has a face to stand on", radius=self.cone.top)
        held = math.atan(max(piece.shape.friction for piece in pieces)) + SLOPE_MARGIN
        yield require(held <= CONE_SLOPE, "a shape may rest on the slope of the cone", slope=CONE_SLOPE, needed=held)
        for shape in (piece.shape for piece in pieces):
            yield require(shape.width + MIN_CLEARANCE <= OPEN_GAP, "the jaw cannot take a shape", width=shape.width)
            held, needed = MIN_PAD_OVERLAP, MIN_PAD_OVERLAP
            if shape.pointed:
                held = shape.collar - self.grip_height(shape) + PAD_BELOW
            yield require(held >= needed, "the jaw cannot hold the cone by its collar", held=held, needed=needed)
        yield on_table("a shape", [piece.place.spot for piece in pieces], margin=0.05)
        away = min(math.dist(one.place.spot, other.place.spot) for one, other in combinations(pieces, 2))
        needed = PALM_ALONG + max(piece.shape.reach for piece in pieces) + MIN_CLEARANCE
        yield require(away >= needed, "the hand has no room beside the pile", away=away, needed=needed)
        tower = sum(piece.shape.height for piece in pieces) * UP
        base = self.pieces[self.order[0]].place.spot
        yield within_reach("a shape or the top of the pile", base + tower, *(piece.place.spot for piece in pieces))

    def features(self) -> Mapping[str, float]:
        """Slenderness, height [m] and least friction of the stack, number of its joints."""
        shapes = [piece.shape for piece in self.pieces.values()]
        return {
            "slenderness": sum(s.height for s in shapes) / min(s.width for s in shapes),
            "height": sum(s.height for s in shapes),
            "friction": min(s.friction for s in shapes),
            "joints": self.count - 1,
        }

    def facts(self) -> Mapping[str, float | str]:
        aside = float(self.cone_spot[1])
        return {
            "shapes": self.count,
            "cone": "before it" if abs(aside) < 0.06 else "on its left" if aside > 0.0 else "on its right",
            "distance": math.dist(self.cone_spot[:2], BASE[:2]),
            "height": sum(piece.shape.height for piece in self.pieces.values()),
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def pieces(self) -> dict[str, Piece]:
        """Pieces of the scene, by names that are independent of shapes and places."""
        places, dealt = [self.a, self.b, self.c, self.d, self.e], list(permutations(self.flat))[self.deal]
        cone = Piece(places.pop(self.cone_at), self.cone)
        found = list(map(Piece, places, dealt[: self.count - 1]))
        found.insert(self.cone_at, cone)
        return {f"shape_{k}": piece for k, piece in enumerate(found)}

    @cached_property
    def flat(self) -> tuple[Shape, ...]:
        """The shapes other than the cone."""
        return self.cube, self.cylinder, self.hexagon, self.prism

    @cached_property
    def cone_spot(self) -> Vec3:
        """Position of the foot of the pointed shape that comes last [m]."""
        return self.foot(self.order[-1])

    def foot(self, name: str) -> Vec3:
        """Initial position of a shape's foot [m]."""
        base, cone = self.order[0], self.order[-1]
        if self.perched and name == cone:
            return self.foot(base) + self.pieces[base].shape.height * UP
        return self.pieces[name].place.spot

    @cached_property
    def order(self) -> tuple[str, ...]:
        """Names from the widest to the narrowest shape, with the pointed ones last."""
        pieces = self.pieces
        return tuple(sorted(pieces, key=lambda n: (pieces[n].shape.pointed, -pieces[n].shape.reach)))
