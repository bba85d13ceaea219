"""T25 mass-sort: put three cubes that look alike into three zones, the lightest into the first one.

         I       II      III          seen from above, the robot is below; left and right are the robot's
        [ ]      [ ]     [ ]

        (?)      (?)     (?)

Bottleneck: no camera shows the mass of a cube; it is felt. A cube that is released in a wrong zone loses the episode
(paper, App. B, T25).

Decisions where the paper is silent:

* "Each cube must be probed before placement": each is lifted by `PROBE_HEIGHT` in the hand before the first is
  released in a zone. Otherwise a policy sorts the cubes by their resistance to a push (12 of 12), or puts one after the
  other down in its final place, the last one by deduction from the fixed set of masses (12 of 12).
* How a policy weighs is free. A hand with a zero action sinks by the mass within a second, so its position suffices,
  without a sense of force. With one cube weighed, training's four orders leave 3 of 4.
* Left is the robot's left. The zones carry one, two and three bars, and the instruction refers to the bars.
* The cubes never lie in their final order, left to right: then no weighing would be needed.
* Chance: training has four orders, so one fixed answer is right in a quarter of it.
* A cube is in a zone if its middle is over it, it stands on the table and has been released. The jaw sets it down
  there: cubes that had only hung over a zone were pushed into theirs (3 of 6).
"""

import math
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import combinations, pairwise, permutations

import mujoco
import numpy as np

from ..assets.box import Cube
from ..assets.prop import TABLE_TOP, place, table
from ..assets.zone import Zone
from ..decisions import Decision, choice
from ..geometry import UP, Outline, Vec3, corners, gap, least_gap
from ..means import Mean, when
from ..params import Bounded, param
from ..predicates import fallen, held, over, rests_on, still
from ..robots.jaw import OPEN_GAP, SPAN
from ..scenario import (
    Action,
    Answer,
    Plan,
    Planner,
    Refutation,
    Scenario,
    Shortcut,
    on_table,
    require,
    within_reach,
)
from ..sim.arm import ROBOT
from ..sim.memory import remember
from ..sim.world import World
from ..skills.jaw import let_go, pick, put, weigh
from ..skills.motion import STEADY, push, retreat

CUBE_COUNT = 3
PLACES = ("left", "middle", "right")
RANKS = ("lightest", "middle", "heaviest")
PROBE_LIFT = 0.04  # height by which a cube is lifted to be weighed [m]; the hand ends 2 cm short
ORDERS = tuple(permutations(range(CUBE_COUNT)))
"""Ranks of the cubes on the left, in the middle and on the right: 0 is the lightest. The first order is sorted."""
MIN_MASS_DIFFERENCE = 0.025
"""Least difference in mass of two neighbours in rank [kg]: 0.25 N, ten times the error of a weighing under noise."""
PROBE_HEIGHT = 0.01
"""Height to which each cube must be lifted before one is released in a zone [m]; the oracle lifts them by 2 cm."""
MIN_CLEARANCE = 0.010  # least clearance of the fingers from other cubes and zones [m]
APPROACH_HEIGHT = 0.03  # height above a cube from which the hand comes down, and to which it moves up [m]
CARRY_HEIGHT = 0.015  # height above other cubes at which a cube is carried [m]


@dataclass(frozen=True, kw_only=True)
class Spot(Bounded):
    """Pose of a cube at the start."""

    x: float = param(-0.16, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)


@dataclass(frozen=True, kw_only=True)
class MassSort(Scenario):
    """Three cubes in front of three zones."""

    VERSION = 3
    HOLD = 0.3

    light: float = param(0.05, "kg", 0.02, 0.6, hidden=True)
    middle: float = param(0.10, "kg", 0.02, 0.6, hidden=True)
    heavy: float = param(0.20, "kg", 0.02, 0.6, hidden=True)
    """Mass of the heaviest cube; paper, App. B: 50, 100 and 200 g."""
    order: int = param(3, "", 0, 5, hidden=True, answer=True)  # index in `ORDERS` of the cubes' order
    edge: float = param(0.045, "m", 0.02, 0.07)
    friction: float = param(0.6, "1", 0.2, 1.5)
    mirrored: int = param(0, "", 0, 1)  # 1 if the zone of the lightest cube is on the right
    zones_x: float = param(0.07, "m", -0.4, 0.4)
    zones_apart: float = param(0.16, "m", 0.1, 0.3)
    first: Spot = Spot(y=0.15)
    second: Spot = Spot()
    third: Spot = Spot(y=-0.15)
    zone: Zone = Zone()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        remember(scene, *(f"lifted_{cube}" for cube in self.cubes))
        for rank in range(CUBE_COUNT):
            place(scene, replace(self.zone, label=rank + 1), f"zone_{rank}", self.zones[rank], free=False)
        for cube, spot, rank in zip(self.cubes, self.spots, self.ranks, strict=True):
            box = Cube(edge=self.edge, friction=self.friction, mass=self.masses[rank])
            place(scene, box, cube, [spot.x, spot.y, TABLE_TOP], math.radians(spot.yaw))
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return all(
            self.within(world, cube, rank) and rests_on(world, cube, "table") and still(world, cube, 0.01)
            for cube, rank in self.belongs(world).items()
        )

    def failure(self, world: World) -> str | None:
        zones = {cube: self.zone_of(world, cube) for cube in self.cubes}
        if any(zone is not None and zone != self.belongs(world)[cube] for cube, zone in zones.items()):
            return "a cube was put into a wrong zone"
        return "a cube fell off the table" if fallen(world, *self.cubes) else None

    def means(self) -> Mapping[str, Mean]:
        def released(world: World) -> bool:
            return any(self.zone_of(world, cube) is not None for cube in self.cubes)

        def stands(world: World, cube: str) -> bool:
            return world.touching(cube, "table") and any(self.within(world, cube, k) for k in range(CUBE_COUNT))

        carried = {
            f"the jaw set the {place} cube down in its zone": when(
                partial(stands, cube=cube), lambda world, cube=cube: world.arm.grips(cube)
            )
            for place, cube in zip(PLACES, self.cubes, strict=True)
        }
        return {"each cube hung in the hand before one was put into a zone": when(released, self.probed), **carried}

    def events(self, world: World) -> None:
        """Notice which cubes have been lifted."""
        for cube in self.cubes:
            if world.com(cube)[2] - self.edge / 2 - TABLE_TOP >= PROBE_HEIGHT and held(world, cube):
                world.memory[f"lifted_{cube}"] = 1.0

    def pending(self, world: World) -> bool:
        """Never: nothing happens on its own."""
        return False

    def probed(self, world: World) -> bool:
        """Whether each cube has been lifted in the hand."""
        return all(world.memory[f"lifted_{cube}"] for cube in self.cubes)

    def zone_of(self, world: World, cube: str) -> int | None:
        """Rank of the zone in which a cube has been released, or None."""
        if not world.touching(cube, "table") or world.touching(ROBOT, cube):
            return None
        return next((rank for rank in range(CUBE_COUNT) if self.within(world, cube, rank)), None)

    def belongs(self, world: World) -> dict[str, int]:
        """Rank of each cube, by its mass in the scene."""
        weights = {cube: float(world.model.body_mass[world.body(cube)]) for cube in self.cubes}
        return {cube: rank for rank, cube in enumerate(sorted(weights, key=weights.__getitem__))}

    def within(self, world: World, cube: str, rank: int) -> bool:
        """Whether the middle of a cube is over the zone of a rank."""
        return over(world, cube, self.zones[rank], self.zone.size / 2)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Weigh each cube and put it back, except the last; put that one and then the others into their zones."""
        weights = yield from self.probe(world)
        yield from self.sort_held(world, [sorted(weights).index(weight) for weight in weights])

    def probe(self, world: World) -> Generator[Action, None, list[float]]:
        """Lift each cube and put it back, except the last; returns their weights, from left to right [N]."""
        weights: list[float] = []
        *others, last = self.cubes
        for cube in others:
            yield from self.take(world, cube, PROBE_LIFT)
            weights.append(float((yield from weigh(world.arm))[2]))
            yield from self._put_back(world, cube)
        yield from self.take(world, last, self.edge + CARRY_HEIGHT)
        weights.append(float((yield from weigh(world.arm))[2]))
        return weights

    def _put_back(self, world: World, cube: str) -> Plan:
        """Lower the held cube to the table, release it and move up."""
        yield from push(world.arm, -0.1 * UP, lambda: world.touching(cube, "table"))
        yield from let_go(world.arm, self.edge + APPROACH_HEIGHT)

    def sort_held(self, world: World, ranks: Sequence[int]) -> Plan:
        """Put the last cube, which is held, and then the others into the zones of the given ranks."""
        *others, last = self.cubes
        yield from self.place_held(world, last, ranks[-1])
        yield from self.deliver(world, dict(zip(others, ranks, strict=False)))

    def take(self, world: World, cube: str, lift: float) -> Plan:
        """Grasp a cube at its middle and lift it [m]."""
        above, closing = self.edge + APPROACH_HEIGHT, world.rot(cube)[:, 1]
        yield from pick(world.arm, world.com(cube), closing, above=above, lift=lift, pace=STEADY)

    def place_held(self, world: World, cube: str, rank: int) -> Plan:
        """Put the held cube into the zone of a rank."""
        middle = self.zones[rank] + self.edge / 2 * UP
        yield from put(world.arm, cube, middle, on="table", hover=self.edge + CARRY_HEIGHT)
        yield from retreat(world.arm, self.edge + APPROACH_HEIGHT)

    def deliver(self, world: World, ranks: Mapping[str, int]) -> Plan:
        """Take cubes to the zones of the given ranks, one after the other."""
        for cube, rank in ranks.items():
            yield from self.take(world, cube, self.edge + CARRY_HEIGHT)
            yield from self.place_held(world, cube, rank)

    def steps(self) -> Mapping[str, Planner]:
        weights, held = dict[str, float](), list[str]()

        def put_back(world: World) -> Plan:
            while held:
                yield from self._put_back(world, held.pop())

        def weigh_it(world: World, cube: str) -> Plan:
            yield from put_back(world)
            held.append(cube)
            yield from self.take(world, cube, PROBE_LIFT)
            weights[cube] = float((yield from weigh(world.arm))[2])

        def place(world: World, rank: int) -> Plan:
            cube = sorted(weights, key=weights.__getitem__)[rank]
            if held != [cube]:
                yield from put_back(world)
                yield from self.take(world, cube, self.edge + CARRY_HEIGHT)
            held.clear()
            yield from self.place_held(world, cube, rank)

        weighings = {
            f"weigh_{where}": partial(weigh_it, cube=cube) for where, cube in zip(PLACES, self.cubes, strict=True)
        }
        placings = {f"place_{which}": partial(place, rank=rank) for rank, which in enumerate(RANKS)}
        by_sight = dict(zip(self.cubes, range(CUBE_COUNT), strict=True))
        return {**weighings, **placings, "sort_by_sight": lambda world: self.deliver(world, by_sight)}

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        """Orders chosen without reading the scales, or with one reading; those that are wrong in this scenario."""
        blind = {"as_they_lie": (0, 1, 2), "the_other_way_round": (2, 1, 0), "one_further": (1, 2, 0)}
        first = self.ranks[0]
        rest = [rank for rank in range(CUBE_COUNT) if rank != first]
        answers = {**blind, "feel_one_guess_two": (first, *rest), "by_common_masses": self.by_common_masses}
        plans = {name: self._answer(answer) for name, answer in answers.items() if answer != self.ranks}
        return {name: Shortcut(plan) for name, plan in plans.items()}

    def _answer(self, ranks: Sequence[int]) -> Planner:
        """Plan that lifts each cube and puts them, from left to right, into the zones of the given ranks."""

        def plan(world: World) -> Plan:
            yield from self.probe(world)
            yield from self.sort_held(world, ranks)

        return plan

    def answer(self) -> Answer:
        """Index of one of the six orders. One try: a cube in a wrong zone ends the episode."""
        numbers = tuple(float(k) for k in range(len(ORDERS)))
        return Answer(
            numbers,
            lambda world, number: self._answer(ORDERS[round(number)])(world),
            lambda number: ORDERS[round(number)] == self.ranks,
            tries=1,
        )

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """The scene looks the same, with the lightest and the heaviest cube exchanged."""
        return {"masses_exchanged": replace(self, light=self.heavy, heavy=self.light).build()}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        masses = ("light", "middle", "heavy")
        return {
            "lightest": choice(self.ranks.index(0), *masses),
            "heaviest": choice(self.ranks.index(2), *masses),
            "order": choice(tuple(self.ranks), *masses),
            "side_of_the_light_zone": choice(self.mirrored, "*zone*.y", "*zone*redness", "*zone*lightness"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        apart = min(heavier - lighter for lighter, heavier in pairwise(self.masses))
        yield require(
            apart >= MIN_MASS_DIFFERENCE, "two cubes weigh about the same, or not what their names say", apart=apart
        )
        yield require(self.order != 0, "the cubes lie in the order in which they belong", order=self.order)
        yield require(self.edge + 0.008 <= OPEN_GAP, "the jaw cannot take a cube", edge=self.edge, opening=OPEN_GAP)
        squares = [corners(self.zones[rank], 0.0, [self.zone.size] * 2) for rank in range(CUBE_COUNT)]
        yield on_table("a cube or a zone", [*self.outlines, *squares])
        room = least_gap([square] for square in squares) + self.zone.size - self.edge
        yield require(room >= self.hand_beside, "the hand has no room between the zones", room=room)
        clear = least_gap([cube] for cube in self.outlines)
        yield require(clear >= self.hand_beside, "the hand has no room between the cubes", room=clear)
        away = min(gap(cube, square) for cube in self.outlines for square in squares)
        yield require(away >= MIN_CLEARANCE, "a cube lies in a zone, or too near to one", away=away)
        above = (2 * self.edge + CARRY_HEIGHT) * UP
        yield within_reach("a cube", *(np.array([spot.x, spot.y, TABLE_TOP]) + above for spot in self.spots))
        yield within_reach("a zone", *(self.zones[rank] + above for rank in range(CUBE_COUNT)))

    def features(self) -> Mapping[str, float]:
        """Least ratio of masses, largest mass [kg], number of pairs in wrong order, clearance in the jaw, side."""
        return {
            "least_ratio": min(heavier / lighter for lighter, heavier in pairwise(self.masses)),
            "heaviest": self.heavy,
            "inversions": sum(a > b for a, b in combinations(self.ranks, 2)),
            "air_over_opening": 1.0 - self.edge / OPEN_GAP,
            "lightest_to_the_left": -1.0 if self.mirrored else 1.0,
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "light_zone": "on the robot's right" if self.mirrored else "on the robot's left",
            "far_row": "the zones" if self.zones_x > max(spot.x for spot in self.spots) else "the cubes",
            "edge": self.edge,
            "apart": math.dist(self.zones[1][:2], (self.spots[1].x, self.spots[1].y)),
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def masses(self) -> tuple[float, float, float]:
        """Masses by rank [kg]."""
        return self.light, self.middle, self.heavy

    @cached_property
    def ranks(self) -> tuple[int, ...]:
        """Ranks of the cubes, from left to right."""
        return ORDERS[self.order]

    @cached_property
    def by_common_masses(self) -> tuple[int, ...]:
        """Ranks that cubes of these masses have in training, where the middle one is between 75 and 150 g."""
        return tuple(sum(self.masses[rank] > limit for limit in (0.075, 0.150)) for rank in self.ranks)

    @cached_property
    def cubes(self) -> tuple[str, ...]:
        """Names of the cubes, from left to right, independent of their masses."""
        return tuple(f"cube_{k}" for k in range(CUBE_COUNT))

    @cached_property
    def spots(self) -> tuple[Spot, ...]:
        """Poses of the cubes at the start, from left to right."""
        return self.first, self.second, self.third

    @cached_property
    def outlines(self) -> list[Outline]:
        """Outlines of the cubes at the start [m]."""
        return [corners([s.x, s.y], math.radians(s.yaw), [self.edge] * 2) for s in self.spots]

    @cached_property
    def hand_beside(self) -> float:
        """Distance beside a cube that the open jaw needs to grasp it [m]."""
        return (SPAN - self.edge) / 2 + MIN_CLEARANCE

    @cached_property
    def zones(self) -> tuple[Vec3, ...]:
        """Middles of the zones by rank [m]; the first zone is on the left, or on the right if mirrored."""
        sides = ((1 - rank) * (-1 if self.mirrored else 1) for rank in range(CUBE_COUNT))
        return tuple(np.array([self.zones_x, side * self.zones_apart, TABLE_TOP]) for side in sides)
