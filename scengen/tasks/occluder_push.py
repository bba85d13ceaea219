"""T26 occluder-push: put the red one of three cubes on a patch; flat lids hide all of them.

          _______    _______    _______
         |       |  |       |  |       |     seen from above, the robot is below
         |   ?   |  |   ?   |  |   ?   |
         |_______|  |_______|  |_______|

                     [patch]

Bottleneck: what is under a lid shows only once the lid is off, and nothing else tells the cubes apart. Another cube
that is let go on the patch loses the episode, so that one has to look before anything is brought there.

A lid is twice as wide as the jaw opens and lies 25 mm above the table, flat: there is nothing on it to take hold of. It
is pushed off its cube. The open jaw does that best: one finger on either side pushes the lid straight, and the cube
passes between the two. The cube stays where it is: friction under it carries cube and lid, friction on top of it the
lid alone, and scenarios whose lids are so rough that this is not enough are refuted.

Decisions where the paper (App. B, T26) is silent:

* Hidden means: no camera of the table sees any of a cube. That is exact, not sampled: a flat lid hides a cube
  if its foot, projected from the camera onto the lid's underside, lies within the lid.
* Wrong is another cube that stands on the patch and is not held. The paper has no rule; without one a policy could
  bring cube after cube until one of them counts.
* Chance: training has three places for the red cube; who always looks under the same lid only is right in a third.
* The paper's axis stacks two or three lids more on the target. Here every cube gets as many: a single pile would name
  the target.
"""

import functools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations, product

import mujoco
import numpy as np

from ..assets.box import Cube, Lid
from ..assets.patch import Patch
from ..assets.prop import CAMERAS, TABLE_TOP, Rgba, place, table
from ..geometry import UP, Outline, Vec3, about_z, corners, gap
from ..params import check_bounds, param
from ..predicates import fallen, over, rests_on, still
from ..robots.jaw import FINGER_ACROSS, OPEN_GAP, SPAN, TIP_BELOW
from ..scenario import Answer, Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import ROBOT, World
from ..skills.jaw import grasp, pick, poke, put, release
from ..skills.motion import COARSE, OPEN, STEADY, closing_along, go_to, push, retreat

COUNT = 3
RED: Rgba = (0.82, 0.20, 0.15, 1.0)
OTHERS: tuple[tuple[Rgba, Rgba], ...] = (
    ((0.20, 0.36, 0.66, 1.0), (0.92, 0.78, 0.20, 1.0)),
    ((0.93, 0.48, 0.12, 1.0), (0.80, 0.24, 0.52, 1.0)),
)
"""Colours of the other cubes, by `likeness`: blue and yellow, orange and magenta."""
STANDS = 0.01
"""Speed below which a cube stands [m/s]."""
TOLERANCE = 1e-10
"""Solver tolerance: at MuJoCo's 1e-8 of the scene's inertia, mostly the arm's, cubes of 30 g under lids never rest."""
LOW = TIP_BELOW + 0.010
"""Height of the grip site over the table while it pushes [m]: the tips are below the lid, the palm is 50 mm up."""
GENTLE = 0.10
"""How fast a lid is pushed [m/s]."""
BEHIND, BEYOND = 0.02, 0.032
"""How far behind a lid the hand comes down, and how far past the cube's middle it pushes [m]: there the lid's edge is 3
cm past the cube, and the fingers come down beside the cube without touching the lid."""
PRESSED = 2.5
"""How long a hand that comes down on something tries [s]; down to the table it takes 1.6 s."""
AIR = 0.008
"""Least space between what is pushed and what stands beside its way [m]."""
OVER = 0.08
"""How far the hand goes up from the table between two pushes, and how far a cube is lifted [m]: piles stay below."""


@dataclass(frozen=True, kw_only=True)
class Spot:
    """Where a cube stands, and how it and its lids are turned."""

    x: float = param(-0.01, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)

    def __post_init__(self) -> None:
        check_bounds(self)


@dataclass(frozen=True, kw_only=True)
class OccluderPush(Scenario):
    """Three covered cubes and a green patch."""

    HOLD = 0.3

    red: int = param(1, "0 left, 1 middle, 2 right", 0, COUNT - 1, hidden=True)
    likeness: int = param(0, "0 = blue and yellow, 1 = orange and magenta", 0, 1)
    """What colours the other two have."""
    lids: int = param(1, "lids", 1, 5)
    """On every cube."""
    left: Spot = Spot(y=0.235)
    middle: Spot = Spot(x=0.08)
    right: Spot = Spot(y=-0.235)
    patch_x: float = param(-0.13, "m", -0.4, 0.4)
    patch_y: float = param(0.0, "m", -0.4, 0.4)
    patch: Patch = Patch(size=0.09)
    cube: Cube = Cube(edge=0.025, mass=0.03)
    lid: Lid = Lid()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        scene.option.tolerance = TOLERANCE
        place(scene, self.patch, "patch", self.goal, free=False)
        others = iter(OTHERS[self.likeness])
        for i, (cube, spot) in enumerate(zip(self.cubes, self.spots, strict=True)):
            yaw = math.radians(spot.yaw)
            coloured = replace(self.cube, rgba=RED if i == self.red else next(others))
            place(scene, coloured, cube, self.foot(i), yaw)
            for k in range(self.lids):
                at = self.foot(i) + (self.cube.edge + k * self.lid.thickness) * UP
                place(scene, self.lid, f"lid_{i}_{k}", at, yaw)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        red = self.cubes[self.reddest(world)]
        return self.on_patch(world, red) and rests_on(world, red, "table") and still(world, red, STANDS)

    def failure(self, world: World) -> str | None:
        red = self.cubes[self.reddest(world)]
        for cube in self.cubes:
            let_go = world.touching(cube, "table") and not world.touching(ROBOT, cube)
            if cube != red and let_go and self.on_patch(world, cube):
                return "another cube was put on the patch"
        return "the red cube fell off the table" if fallen(world, red) else None

    def reddest(self, world: World) -> int:
        """Which cube is the red one, by its colour in the scene."""
        model = world.model
        colours = [model.geom_rgba[model.body_geomadr[world.body(cube)]] for cube in self.cubes]
        return min(range(COUNT), key=lambda i: float(np.abs(colours[i] - RED).sum()))

    def on_patch(self, world: World, cube: str) -> bool:
        return over(world, cube, self.goal, self.patch.size / 2)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Push lids off, one cube after the other, until the red one shows; bring that to the patch."""
        for i in range(COUNT):
            yield from self.uncover(world, i)
            if i == self.reddest(world):
                yield from self.deliver(world, i)
                return

    def uncover(self, world: World, i: int) -> Plan:
        """Come down behind the lids with the open jaw and push them off, with the cube passing between the fingers."""
        arm, way, cube = world.arm, self.ways[i], world.com(self.cubes[i])
        behind = self.behind(i) + LOW * UP
        rot = closing_along(arm, np.cross(UP, way))
        yield from go_to(arm, behind + OVER * UP, rot, COARSE, OPEN)
        yield from go_to(arm, behind, rot, STEADY, OPEN)
        yield from push(arm, GENTLE * way, lambda: float((arm.hand - cube) @ way) >= BEYOND, OPEN, give_up=6.0)
        yield from retreat(arm, OVER)

    def deliver(self, world: World, i: int) -> Plan:
        """Take a cube and put it down on the patch."""
        half = self.cube.edge / 2
        at = self.foot(i) * [1.0, 1.0, 0.0] + (TABLE_TOP + max(half, TIP_BELOW + 0.005)) * UP
        at[:2] = world.com(self.cubes[i])[:2]
        yield from pick(world.arm, at, np.cross(UP, self.ways[i]), above=OVER, lift=OVER)
        yield from put(world.arm, self.cubes[i], self.goal + half * UP, on="table", hover=OVER)
        yield from retreat(world.arm)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        other = (self.red + 1) % COUNT
        return {
            "reach_through_the_lid": Shortcut(self._reach_through, to_rest=True),
            "pick_the_lid_up": Shortcut(self._pick_lid, to_rest=True),
            "shove_hard": Shortcut(self._shove),
            "take_another": Shortcut(lambda world: self._answer(world, other)),
        }

    def _reach_through(self, world: World) -> Plan:
        """Come down where the red cube is, as if nothing covered it, close, bring what is held to the patch."""
        yield from self._clutch(world, self.foot(self.red), np.cross(UP, self.ways[self.red]))

    def _pick_lid(self, world: World) -> Plan:
        """Take hold of the red cube's lid at its edge and bring it to the patch."""
        way = self.ways[self.red]
        yield from self._clutch(world, self.foot(self.red) - self.lid.width / 2 * way, way)

    def _shove(self, world: World) -> Plan:
        """Push lid and cube as fast as the arm goes, with closed fingers; then take the cube where it was."""
        arm, way, foot = world.arm, self.ways[self.red], self.foot(self.red)
        behind = self.behind(self.red) + LOW * UP
        yield from poke(arm, behind, 0.3 * way, lambda: float((arm.hand - foot) @ way) >= 0.05, above=OVER)
        yield from self._clutch(world, foot, np.cross(UP, way))

    def _clutch(self, world: World, spot: Vec3, closing: Vec3) -> Plan:
        """Come down on a spot with the open jaw, press as long as something is in the way, close, take that along."""
        arm = world.arm
        yield from go_to(arm, spot + (LOW + 2 * OVER) * UP, closing_along(arm, closing), COARSE, OPEN)
        end = world.time + PRESSED
        yield from push(arm, -GENTLE * UP, lambda: arm.hand[2] <= TABLE_TOP + LOW or world.time >= end)
        yield from grasp(arm)
        yield from retreat(arm, OVER)
        yield from go_to(arm, self.goal + (LOW + OVER) * UP, pace=COARSE)
        yield from release(arm)

    def _answer(self, world: World, i: int) -> Plan:
        """Look under one lid only, and take what is there."""
        yield from self.uncover(world, i)
        yield from self.deliver(world, i)

    def answer(self) -> Answer:
        """Under which lid the red cube is. One try: another cube on the patch is the end."""
        numbers = tuple(float(i) for i in range(COUNT))
        return Answer(
            numbers,
            lambda world, number: self._answer(world, round(number)),
            lambda number: round(number) == self.red,
            tries=1,
        )

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """The same scene to the eye, with the red cube under the next lid."""
        return {"red_elsewhere": replace(self, red=(self.red + 1) % COUNT).build()}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        edge, most = self.cube.edge, OPEN_GAP - 2 * AIR
        yield require(edge <= most, "the open jaw does not pass by a cube", edge=edge, most=most)
        yield require(self.shade > 0.0, "a camera sees part of a cube", shade=self.shade)
        fingers = self.lid.width - SPAN
        yield require(fingers >= 0.0, "the fingers of the open jaw pass by a lid", overlap=fingers)
        load, under = self.lids * self.lid.mass, self.cube.friction
        drag, hold = max(self.lid.friction, under) * load, under * (load + self.cube.mass)
        yield require(drag < hold, "a cube goes along with its lids", drag=drag, hold=hold)
        yield on_table("a lid or the patch", [*self.outlines, self.square])
        apart = min(gap(one, other) for one, other in combinations([*self.outlines, self.square], 2))
        yield require(apart >= AIR, "lids or the patch lie too near to each other", apart=apart)
        yield require(len(self.ways) == COUNT, "there is no room to push the lids off", ways=len(self.ways))
        starts = [self.behind(i) for i in range(COUNT)]
        ends = [self.foot(i) + BEYOND * way for i, way in enumerate(self.ways)]
        yield within_reach("a cube or the patch", *(at + LOW * UP for at in (*starts, *ends, self.goal)))

    def features(self) -> Mapping[str, float]:
        """How high lids lie and how far they stand out [m], their drag over g [kg], the way most askew [rad]."""
        return {
            "pile": self.lids * self.lid.thickness,
            "overhang": (self.lid.width - self.cube.edge) / 2,
            "drag": self.lids * self.lid.mass * self.lid.friction,
            "most_turned_way": max((abs(math.atan2(way[1], way[0])) for way in self.ways), default=0.0),
        }

    # --- geometry -------------------------------------------------------------------------

    @property
    def spots(self) -> tuple[Spot, ...]:
        """From left to right."""
        return self.left, self.middle, self.right

    @property
    def cubes(self) -> tuple[str, ...]:
        """Names, from left to right: they say nothing about colours."""
        return tuple(f"cube_{i}" for i in range(COUNT))

    @property
    def goal(self) -> Vec3:
        """Middle of the patch [m]."""
        return np.array([self.patch_x, self.patch_y, TABLE_TOP])

    def foot(self, i: int) -> Vec3:
        """Where the middle of a cube's foot stands [m]."""
        return np.array([self.spots[i].x, self.spots[i].y, TABLE_TOP])

    @property
    def outlines(self) -> list[Outline]:
        """Of the lids at the start [m]."""
        return [corners([s.x, s.y], math.radians(s.yaw), [self.lid.width] * 2) for s in self.spots]

    @property
    def square(self) -> Outline:
        """Outline of the patch [m]."""
        return corners(self.goal, 0.0, [self.patch.size] * 2)

    @property
    def shade(self) -> float:
        """How far inside the lids' edges the sight of a cube's foot from any camera at least ends [m]."""
        least = math.inf
        for (_, eye, _), (i, spot) in product(CAMERAS, enumerate(self.spots)):
            foot, turn = self.foot(i), about_z(math.radians(spot.yaw))
            share = self.cube.edge / (eye[2] - TABLE_TOP)  # of the way from the foot to the eye, up to the lid
            for corner in corners(foot, math.radians(spot.yaw), self.cube.size):
                seen = (1 - share) * corner + share * np.array(eye[:2])
                inside = self.lid.width / 2 - np.abs(turn.T[:2, :2] @ (seen - foot[:2])).max()
                least = min(least, float(inside))
        return least

    @property
    def ways(self) -> tuple[Vec3, ...]:
        """Into which direction each lid is pushed: of its four sides' normals the first that leave room for all three.

        Straight ahead is tried first, then to the left, to the right and back.
        """
        return self._free_ways or ()

    @functools.cached_property
    def _free_ways(self) -> tuple[Vec3, ...] | None:
        free: list[list[tuple[Vec3, Outline]]] = []
        for i, spot in enumerate(self.spots):
            normals = [about_z(math.radians(spot.yaw + turn))[:, 0] for turn in (0.0, 90.0, -90.0, 180.0)]
            swept = [(normal, self.swept(i, normal)) for normal in normals]
            free.append([(way, area) for way, area in swept if area is not None])
        apart = (
            tuple(way for way, _ in choice)
            for choice in product(*free)
            if all(gap(one, other) >= AIR for (_, one), (_, other) in combinations(choice, 2))
        )
        return next(apart, None)

    def behind(self, i: int) -> Vec3:
        """Where on the table the hand begins to push [m]."""
        return self.foot(i) - (self.lid.width / 2 + BEHIND) * self.ways[i]

    def swept(self, i: int, way: Vec3) -> Outline | None:
        """What hand and lid pass over when it is pushed along `way` [m]; None if that is not free."""
        start, end = self.lid.width / 2 + BEHIND + FINGER_ACROSS, BEYOND + FINGER_ACROSS + self.lid.width
        yaw = math.atan2(way[1], way[0])
        middle = self.foot(i)
        area = corners(middle, yaw, [start + end, self.lid.width], [(end - start) / 2, 0.0])
        pushed = corners(middle, yaw, [end, self.lid.width], [end / 2, 0.0])
        rest = middle + (end - self.lid.width / 2) * way
        others = [outline for k, outline in enumerate(self.outlines) if k != i]
        clear = all(gap(area, other) >= AIR for other in others) and gap(pushed, self.square) >= AIR
        return area if clear and on_table("a lid", rest, margin=0.02) is None else None
