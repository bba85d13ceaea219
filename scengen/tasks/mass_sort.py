"""T25 mass-sort: put three cubes that look alike into three zones, the lightest into the first one.

         I       II      III          seen from above, the robot is below; it has left and right as we have
        [ ]      [ ]     [ ]

        (?)      (?)     (?)

Bottleneck: what the cubes weigh is felt in the hand, at the wrist, and shows nowhere else. A cube that is let go in a
wrong zone loses the episode (paper, App. B, T25), so that all have to be lifted before the first is put down for good.

Decisions where the paper is silent:

* Left is the robot's left. The zones carry one, two and three bars, and the instruction goes by the bars.
* The cubes never lie in the order in which they belong, left to right: nothing would have to be felt.
* Chance: training has four orders; who always answers with the same one is right in a quarter of it.
* In a zone is a cube whose middle is over it, that stands on the table and has been let go.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise, permutations

import mujoco
import numpy as np

from ..assets.box import Cube
from ..assets.prop import TABLE_TOP, place, table
from ..assets.zone import Zone
from ..geometry import UP, Outline, Vec3, corners, gap
from ..params import check_bounds, param
from ..predicates import fallen, rests_on, still
from ..robots.jaw import OPEN_GAP, SPAN
from ..scenario import Answer, Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import ROBOT, World
from ..skills.jaw import pick, put, release, weigh
from ..skills.motion import STEADY, push, retreat

ORDERS = tuple(permutations(range(3)))
"""Which rank the cubes on the left, in the middle and on the right have: 0 for the lightest. The first is sorted."""
COUNT = 3
APART = 0.025
"""Least difference of two neighbours in mass [kg]: 0.25 N, ten times the error of a weighing under noise."""
STANDS = 0.01
"""Speed below which a cube stands [m/s]."""
AIR = 0.010
"""Room that the fingers have beside what else stands there [m]."""
LIFT, OVER, CLEAR = 0.03, 0.03, 0.015
"""How far a cube is lifted to be weighed; how far the hand rises over a cube, and a held cube over others [m]."""
COMMON = (0.075, 0.150)
"""Between which a cube of training is the middle one [kg]."""


@dataclass(frozen=True, kw_only=True)
class Spot:
    """Where a cube stands."""

    x: float = param(-0.16, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)

    def __post_init__(self) -> None:
        check_bounds(self)


@dataclass(frozen=True, kw_only=True)
class MassSort(Scenario):
    """Three cubes in front of three zones."""

    HOLD = 0.3

    light: float = param(0.05, "kg", 0.02, 0.6, hidden=True)
    middle: float = param(0.10, "kg", 0.02, 0.6, hidden=True)
    heavy: float = param(0.20, "kg", 0.02, 0.6, hidden=True)
    """Paper, App. B: 50, 100 and 200 g."""
    order: int = param(3, "", 0, 5, hidden=True)
    """Which of `ORDERS` they lie in."""
    edge: float = param(0.045, "m", 0.02, 0.07)
    friction: float = param(0.6, "1", 0.2, 1.5)
    mirrored: int = param(0, "", 0, 1)
    """1: the zone of the lightest cube is on the right."""
    zones_x: float = param(0.07, "m", -0.4, 0.4)
    zones_apart: float = param(0.16, "m", 0.1, 0.3)
    first: Spot = Spot(y=0.15)
    second: Spot = Spot()
    third: Spot = Spot(y=-0.15)
    zone: Zone = Zone()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        for rank in range(COUNT):
            place(scene, replace(self.zone, label=rank + 1), f"zone_{rank}", self.zone_at(rank), free=False)
        for cube, spot, rank in zip(self.cubes, self.spots, self.ranks, strict=True):
            box = Cube(edge=self.edge, friction=self.friction, mass=self.masses[rank])
            place(scene, box, cube, [spot.x, spot.y, TABLE_TOP], math.radians(spot.yaw))
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return all(
            self.within(world, cube, rank) and rests_on(world, cube, "table") and still(world, cube, STANDS)
            for cube, rank in self.belongs(world).items()
        )

    def failure(self, world: World) -> str | None:
        for cube, rank in self.belongs(world).items():
            let_go = world.touching(cube, "table") and not world.touching(ROBOT, cube)
            if let_go and any(self.within(world, cube, other) for other in range(COUNT) if other != rank):
                return "a cube was put into a wrong zone"
        return "a cube fell off the table" if fallen(world, *self.cubes) else None

    def belongs(self, world: World) -> dict[str, int]:
        """The rank of every cube, by what it weighs."""
        weights = {cube: float(world.model.body_mass[world.body(cube)]) for cube in self.cubes}
        return {cube: rank for rank, cube in enumerate(sorted(weights, key=weights.__getitem__))}

    def within(self, world: World, cube: str, rank: int) -> bool:
        """Whether a cube's middle is over the zone of a rank."""
        offset = np.abs(world.com(cube) - self.zone_at(rank))[:2]
        return bool((offset <= self.zone.size / 2).all())

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Lift every cube and feel it, set it back; the last one, and then the others, into their zones."""
        felt: list[float] = []
        *others, last = self.cubes
        for cube in others:
            yield from self.take(world, cube, LIFT)
            felt.append(float((yield from weigh(world.arm))[2]))
            yield from push(world.arm, -0.1 * UP, lambda cube=cube: world.touching(cube, "table"))
            yield from release(world.arm)
            yield from retreat(world.arm, self.edge + OVER)
        yield from self.take(world, last, self.edge + CLEAR)
        felt.append(float((yield from weigh(world.arm))[2]))
        ranks = [sorted(felt).index(weight) for weight in felt]
        yield from self.place_held(world, last, ranks[-1])
        yield from self.deliver(world, dict(zip(others, ranks, strict=False)))

    def take(self, world: World, cube: str, lift: float) -> Plan:
        """Lift a cube, held by its middle."""
        above, closing = self.edge + OVER, world.rot(cube)[:, 1]
        yield from pick(world.arm, world.com(cube), closing, above=above, lift=lift, pace=STEADY)

    def place_held(self, world: World, cube: str, rank: int) -> Plan:
        """Put the held cube into the zone of a rank."""
        middle = self.zone_at(rank) + self.edge / 2 * UP
        yield from put(world.arm, cube, middle, on="table", hover=self.edge + CLEAR)
        yield from retreat(world.arm, self.edge + OVER)

    def deliver(self, world: World, ranks: Mapping[str, int]) -> Plan:
        """Take cubes to the zones of these ranks, one after the other."""
        for cube, rank in ranks.items():
            yield from self.take(world, cube, self.edge + CLEAR)
            yield from self.place_held(world, cube, rank)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        """Answers without feeling, or with feeling too little, as far as they are wrong here."""
        blind = {"as_they_lie": (0, 1, 2), "the_other_way_round": (2, 1, 0), "one_further": (1, 2, 0)}
        first = self.ranks[0]
        rest = [rank for rank in range(COUNT) if rank != first]
        answers = {**blind, "feel_one_guess_two": (first, *rest), "by_common_masses": self.by_common_masses}
        plans = {name: self._answer(answer) for name, answer in answers.items() if answer != self.ranks}
        return {name: Shortcut(plan) for name, plan in plans.items()}

    def _answer(self, ranks: Sequence[int]) -> Planner:
        return lambda world: self.deliver(world, dict(zip(self.cubes, ranks, strict=True)))

    def answer(self) -> Answer:
        """One of the six orders. One try: a cube in a wrong zone is the end."""
        numbers = tuple(float(k) for k in range(len(ORDERS)))
        return Answer(
            numbers,
            lambda world, number: self._answer(ORDERS[round(number)])(world),
            lambda number: ORDERS[round(number)] == self.ranks,
            tries=1,
        )

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """The same scene to the eye, with the lightest and the heaviest cube exchanged."""
        return {"masses_exchanged": replace(self, light=self.heavy, heavy=self.light).build()}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        apart = min(heavier - lighter for lighter, heavier in pairwise(self.masses))
        yield require(apart >= APART, "two cubes weigh about the same, or not what their names say", apart=apart)
        yield require(self.order != 0, "the cubes lie in the order in which they belong", order=self.order)
        yield require(self.edge + 0.008 <= OPEN_GAP, "the jaw cannot take a cube", edge=self.edge, opening=OPEN_GAP)
        squares = [corners(self.zone_at(rank), 0.0, [self.zone.size] * 2) for rank in range(COUNT)]
        yield on_table("a cube or a zone", [*self.outlines, *squares])
        room = min(gap(one, other) for one, other in combinations(squares, 2)) + self.zone.size - self.edge
        yield require(room >= self.hand_beside, "the hand has no room between the zones", room=room)
        clear = min(gap(one, other) for one, other in combinations(self.outlines, 2))
        yield require(clear >= self.hand_beside, "the hand has no room between the cubes", room=clear)
        away = min(gap(cube, square) for cube in self.outlines for square in squares)
        yield require(away >= AIR, "a cube lies in a zone, or too near to one", away=away)
        high = (2 * self.edge + CLEAR) * UP
        yield within_reach("a cube", *(np.array([spot.x, spot.y, TABLE_TOP]) + high for spot in self.spots))
        yield within_reach("a zone", *(self.zone_at(rank) + high for rank in range(COUNT)))

    def features(self) -> Mapping[str, float]:
        """How near two masses are, the heaviest one [kg], how many pairs lie the wrong way round; air, and where to."""
        return {
            "least_ratio": min(heavier / lighter for lighter, heavier in pairwise(self.masses)),
            "heaviest": self.heavy,
            "inversions": sum(a > b for a, b in combinations(self.ranks, 2)),
            "air_over_opening": 1.0 - self.edge / OPEN_GAP,
            "lightest_to_the_left": -1.0 if self.mirrored else 1.0,
        }

    # --- geometry -------------------------------------------------------------------------

    @property
    def masses(self) -> tuple[float, float, float]:
        """By rank [kg]."""
        return self.light, self.middle, self.heavy

    @property
    def ranks(self) -> tuple[int, ...]:
        """Of the cubes, from left to right."""
        return ORDERS[self.order]

    @property
    def by_common_masses(self) -> tuple[int, ...]:
        """The ranks that a cube of these masses would have in training."""
        return tuple(sum(self.masses[rank] > limit for limit in COMMON) for rank in self.ranks)

    @property
    def cubes(self) -> tuple[str, ...]:
        """Names, from left to right: they say nothing about masses."""
        return tuple(f"cube_{k}" for k in range(COUNT))

    @property
    def spots(self) -> tuple[Spot, ...]:
        """Of the cubes, from left to right."""
        return self.first, self.second, self.third

    @property
    def outlines(self) -> list[Outline]:
        """Of the cubes at the start [m]."""
        return [corners([s.x, s.y], math.radians(s.yaw), [self.edge] * 2) for s in self.spots]

    @property
    def hand_beside(self) -> float:
        """Room beside a cube that the open jaw needs to take it [m]."""
        return (SPAN - self.edge) / 2 + AIR

    def zone_at(self, rank: int) -> Vec3:
        """The middle of a zone [m]; the first one is on the left, or on the right where it is mirrored."""
        side = (1 - rank) * (-1 if self.mirrored else 1)
        return np.array([self.zones_x, side * self.zones_apart, TABLE_TOP])
