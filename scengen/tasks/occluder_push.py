"""T26 occluder-push: put the red one of three cubes on a patch; flat lids hide all of them.

          _______    _______    _______
         |       |  |       |  |       |     seen from above, the robot is below
         |   ?   |  |   ?   |  |   ?   |
         |_______|  |_______|  |_______|

                     [patch]

Bottleneck: the colour of a cube is visible only once its lid is off, and nothing else distinguishes the cubes. No goal
counts after another cube came onto the patch, so the robot must look before it brings a cube there.

A lid is twice as wide as the jaw opens and lies flat, 25 mm above the table: it has nothing to grasp. It is pushed off
its cube. The open jaw does that best: one finger on either side pushes the lid straight, and the cube passes between
the two. The cube stays in place: friction under it carries cube and lid, friction on top of it the lid alone. Scenarios
whose lids are too rough for this are refuted.

Decisions where the paper (App. B, T26) is silent:

* Hidden means: no camera of the table sees any part of a cube. That is exact, not sampled: a flat lid hides a cube if
  its foot, projected from the camera onto the lid's underside, lies within the lid.
* The jaw sets the red cube down on the patch: one that had only hung over it was pushed onto it (6 of 6).
* No other cube stands on the patch, held or not. Otherwise a policy could bring cube after cube until one counts.
* Chance: training has three places for the red cube; a policy that always uncovers the same one is right in a third.
* The paper's axis stacks two or three lids more on the target. Here every cube gets as many, because a single pile
  would mark the target.
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
from ..decisions import Decision, choice, near
from ..geometry import UP, Outline, Vec3, about_z, corners, gap, least_gap
from ..means import Mean, throughout, when
from ..params import Bounded, param
from ..predicates import fallen, over, rests_on, still
from ..robots.jaw import FINGER_ACROSS, OPEN_GAP, SPAN, TIP_BELOW
from ..scenario import Answer, Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import World
from ..skills.jaw import grasp, pick, poke, put, release
from ..skills.motion import COARSE, OPEN, STEADY, closing_along, go_to, push, retreat

CUBE_COUNT = 3
RED: Rgba = (0.82, 0.20, 0.15, 1.0)
OTHER_COLOURS: tuple[tuple[Rgba, Rgba], ...] = (
    ((0.20, 0.36, 0.66, 1.0), (0.92, 0.78, 0.20, 1.0)),
    ((0.93, 0.48, 0.12, 1.0), (0.80, 0.24, 0.52, 1.0)),
)
"""Colours of the other cubes, by `likeness`: blue and yellow, orange and magenta."""
PUSH_HEIGHT = TIP_BELOW + 0.010
"""Height of the grip site above the table during a push [m]: the tips are below the lid, the palm is 50 mm up."""
PUSH_SPEED = 0.10  # speed at which a lid is pushed [m/s]
APPROACH_DISTANCE = 0.02  # distance behind a lid at which the hand comes down [m]
PUSH_DISTANCE = 0.032
"""Distance past the cube's middle to which the hand pushes [m]: there the lid's edge is 3 cm past the cube, and the
fingers come down beside the cube without touching the lid."""
MIN_CLEARANCE = 0.008  # least clearance between a pushed body and the bodies beside its way [m]
CARRY_HEIGHT = 0.08
"""Height above the table to which the hand moves between two pushes, and to which a cube is lifted [m]: above piles."""


@dataclass(frozen=True, kw_only=True)
class Spot(Bounded):
    """Place of a cube, and yaw of the cube and its lids."""

    x: float = param(-0.01, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)


@dataclass(frozen=True, kw_only=True)
class OccluderPush(Scenario):
    """Three covered cubes and a green patch."""

    VERSION = 3
    CONCEALED = ("cube_*",)
    HOLD = 0.3

    red: int = param(1, "0 left, 1 middle, 2 right", 0, CUBE_COUNT - 1, hidden=True, answer=True)
    likeness: int = param(0, "0 = blue and yellow, 1 = orange and magenta", 0, 1)  # colours of the other two cubes
    lids: int = param(1, "lids", 1, 5)  # number of lids on each cube
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
        # at MuJoCo's 1e-8 of the scene's inertia, mostly the arm's, cubes of 30 g under lids never rest
        scene.option.tolerance = 1e-10
        place(scene, self.patch, "patch", self.goal, free=False)
        others = iter(OTHER_COLOURS[self.likeness])
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
        return self.on_patch(world, red) and rests_on(world, red, "table") and still(world, red, 0.01)

    def failure(self, world: World) -> str | None:
        return "the red cube fell off the table" if fallen(world, self.cubes[self.reddest(world)]) else None

    def means(self) -> Mapping[str, Mean]:
        def red(world: World) -> str:
            return self.cubes[self.reddest(world)]

        def open_above(world: World) -> bool:
            i, reach = self.reddest(world), (self.lid.width + self.cube.edge) / 2
            lids = (world.com(f"lid_{i}_{k}") - world.com(self.cubes[i]) for k in range(self.lids))
            return all(math.hypot(away[0], away[1]) > reach for away in lids)

        def strays(world: World) -> bool:
            others = set(self.cubes) - {red(world)}
            return any(world.touching(cube, "table") and self.on_patch(world, cube) for cube in others)

        return {
            "the red cube lay uncovered when the jaw gripped it": when(
                lambda world: world.arm.grips(red(world)), open_above
            ),
            "the jaw set the red cube down on the patch": when(
                lambda world: self.on_patch(world, red(world)) and world.touching(red(world), "table"),
                lambda world: world.arm.grips(red(world)),
            ),
            "no other cube came onto the patch": throughout(lambda world: not strays(world)),
        }

    def reddest(self, world: World) -> int:
        """Index of the red cube, by its colour in the scene."""
        model = world.model
        colours = [model.geom_rgba[model.body_geomadr[world.body(cube)]] for cube in self.cubes]
        return min(range(CUBE_COUNT), key=lambda i: float(np.abs(colours[i] - RED).sum()))

    def on_patch(self, world: World, cube: str) -> bool:
        return over(world, cube, self.goal, self.patch.size / 2)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Push the lids off one cube after the other until the red one is visible; bring it to the patch."""
        for i in range(CUBE_COUNT):
            yield from self.uncover(world, i)
            if i == self.reddest(world):
                yield from self.deliver(world, i)
                return

    def uncover(self, world: World, i: int) -> Plan:
        """Come down behind the lids with the open jaw and push them off; the cube passes between the fingers."""
        arm, along, cube = world.arm, self.directions[i], world.com(self.cubes[i])
        start = self.push_start(i) + PUSH_HEIGHT * UP
        rot = closing_along(arm, np.cross(UP, along))
        yield from go_to(arm, start + CARRY_HEIGHT * UP, rot, COARSE, OPEN)
        yield from go_to(arm, start, rot, STEADY, OPEN)
        past = lambda: float((arm.hand - cube) @ along) >= PUSH_DISTANCE  # noqa: E731
        yield from push(arm, PUSH_SPEED * along, past, OPEN, give_up=6.0)
        yield from retreat(arm, CARRY_HEIGHT)

    def deliver(self, world: World, i: int) -> Plan:
        """Take a cube and put it down on the patch."""
        yield from self._take(world, i)
        yield from self._place(world, i)

    def _take(self, world: World, i: int) -> Plan:
        """Take a cube and lift it."""
        half = self.cube.edge / 2
        at = self.foot(i) * [1.0, 1.0, 0.0] + (TABLE_TOP + max(half, TIP_BELOW + 0.005)) * UP
        at[:2] = world.com(self.cubes[i])[:2]
        yield from pick(world.arm, at, np.cross(UP, self.directions[i]), above=CARRY_HEIGHT, lift=CARRY_HEIGHT)

    def _place(self, world: World, i: int) -> Plan:
        """Put the held cube down on the patch."""
        at = self.goal + self.cube.edge / 2 * UP
        yield from put(world.arm, self.cubes[i], at, on="table", hover=CARRY_HEIGHT)
        yield from retreat(world.arm)

    def steps(self) -> Mapping[str, Planner]:
        uncovered, other = list[int](), (self.red + 1) % CUBE_COUNT

        def uncover_next(world: World) -> Plan:
            if self.reddest(world) not in uncovered and len(uncovered) < CUBE_COUNT:
                uncovered.append(len(uncovered))
                yield from self.uncover(world, uncovered[-1])

        return {
            "uncover_first": uncover_next,
            "take_red": lambda world: self._take(world, self.reddest(world)),
            "place_red": lambda world: self._place(world, self.reddest(world)),
            "lift_lid": self._pick_lid,
            "place_any": lambda world: self._look_under(world, other),
            "reach_through": self._reach_through,
        }

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        other = (self.red + 1) % CUBE_COUNT
        return {
            "reach_through_the_lid": Shortcut(self._reach_through, to_rest=True),
            "pick_the_lid_up": Shortcut(self._pick_lid, to_rest=True),
            "shove_hard": Shortcut(self._shove),
            "take_another": Shortcut(lambda world: self._look_under(world, other)),
        }

    def _reach_through(self, world: World) -> Plan:
        """Come down on the red cube as if nothing covered it, close, move to the patch."""
        yield from self._grasp_and_deliver(world, self.foot(self.red), np.cross(UP, self.directions[self.red]))

    def _pick_lid(self, world: World) -> Plan:
        """Grasp the red cube's lid at its edge and bring it to the patch."""
        along = self.directions[self.red]
        yield from self._grasp_and_deliver(world, self.foot(self.red) - self.lid.width / 2 * along, along)

    def _shove(self, world: World) -> Plan:
        """Push lid and cube with closed fingers at full speed; then grasp the cube where it was."""
        arm, along, foot = world.arm, self.directions[self.red], self.foot(self.red)
        start = self.push_start(self.red) + PUSH_HEIGHT * UP
        yield from poke(arm, start, 0.3 * along, lambda: float((arm.hand - foot) @ along) >= 0.05, above=CARRY_HEIGHT)
        yield from self._grasp_and_deliver(world, foot, np.cross(UP, along))

    def _grasp_and_deliver(self, world: World, spot: Vec3, closing: Vec3) -> Plan:
        """Come down on a place with the open jaw, close, move to the patch and let go."""
        arm = world.arm
        yield from go_to(arm, spot + (PUSH_HEIGHT + 2 * CARRY_HEIGHT) * UP, closing_along(arm, closing), COARSE, OPEN)
        end = world.time + 2.5  # the way down to the table takes 1.6 s; a blocked hand presses until then
        yield from push(arm, -PUSH_SPEED * UP, lambda: arm.hand[2] <= TABLE_TOP + PUSH_HEIGHT or world.time >= end)
        yield from grasp(arm)
        yield from retreat(arm, CARRY_HEIGHT)
        yield from go_to(arm, self.goal + (PUSH_HEIGHT + CARRY_HEIGHT) * UP, pace=COARSE)
        yield from release(arm)

    def _look_under(self, world: World, i: int) -> Plan:
        """Uncover one cube only and deliver it."""
        yield from self.uncover(world, i)
        yield from self.deliver(world, i)

    def answer(self) -> Answer:
        """Place of the red cube. One try: no goal counts after another cube on the patch."""
        numbers = tuple(float(i) for i in range(CUBE_COUNT))
        return Answer(
            numbers,
            lambda world, number: self._look_under(world, round(number)),
            lambda number: round(number) == self.red,
            tries=1,
        )

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """The scene looks the same, with the red cube under the next lid."""
        return {"red_elsewhere": replace(self, red=(self.red + 1) % CUBE_COUNT).build()}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        return {"red": choice(self.red), "patch": near(self.goal, 0.033, "patch_x", "patch_y")}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        edge, most = self.cube.edge, OPEN_GAP - 2 * MIN_CLEARANCE
        yield require(edge <= most, "the open jaw does not pass by a cube", edge=edge, most=most)
        yield require(self.hiding_margin > 0.0, "a camera sees part of a cube", shade=self.hiding_margin)
        fingers = self.lid.width - SPAN
        yield require(fingers >= 0.0, "the fingers of the open jaw pass by a lid", overlap=fingers)
        load, under = self.lids * self.lid.mass, self.cube.friction
        drag, hold = max(self.lid.friction, under) * load, under * (load + self.cube.mass)
        yield require(drag < hold, "a cube goes along with its lids", drag=drag, hold=hold)
        yield on_table("a lid or the patch", [*self.lid_outlines, self.patch_outline])
        apart = least_gap([each] for each in (*self.lid_outlines, self.patch_outline))
        yield require(apart >= MIN_CLEARANCE, "lids or the patch lie too near to each other", apart=apart)
        ways = len(self.directions)
        yield require(ways == CUBE_COUNT, "there is no room to push the lids off", ways=ways)
        starts = [self.push_start(i) for i in range(CUBE_COUNT)]
        ends = [self.foot(i) + PUSH_DISTANCE * along for i, along in enumerate(self.directions)]
        yield within_reach("a cube or the patch", *(at + PUSH_HEIGHT * UP for at in (*starts, *ends, self.goal)))

    def features(self) -> Mapping[str, float]:
        """Height of the pile and overhang of the lids [m], their drag over g [kg], and turn of the pushes [rad]."""
        return {
            "pile": self.lids * self.lid.thickness,
            "overhang": (self.lid.width - self.cube.edge) / 2,
            "drag": self.lids * self.lid.mass * self.lid.friction,
            "most_turned_way": max((abs(math.atan2(along[1], along[0])) for along in self.directions), default=0.0),
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "lids": self.lids,
            "width": self.lid.width,
            "apart": math.hypot(self.patch_x - self.middle.x, self.patch_y - self.middle.y),
        }

    # --- geometry -------------------------------------------------------------------------

    @functools.cached_property
    def spots(self) -> tuple[Spot, ...]:
        """Places of the cubes, from left to right."""
        return self.left, self.middle, self.right

    @functools.cached_property
    def cubes(self) -> tuple[str, ...]:
        """Names of the cubes, from left to right, independent of their colours."""
        return tuple(f"cube_{i}" for i in range(CUBE_COUNT))

    @functools.cached_property
    def goal(self) -> Vec3:
        """Middle of the patch [m]."""
        return np.array([self.patch_x, self.patch_y, TABLE_TOP])

    def foot(self, i: int) -> Vec3:
        """Initial position of the middle of a cube's foot [m]."""
        return np.array([self.spots[i].x, self.spots[i].y, TABLE_TOP])

    @functools.cached_property
    def lid_outlines(self) -> list[Outline]:
        """Outlines of the lids at the start [m]."""
        return [corners([s.x, s.y], math.radians(s.yaw), [self.lid.width] * 2) for s in self.spots]

    @functools.cached_property
    def patch_outline(self) -> Outline:
        """Outline of the patch [m]."""
        return corners(self.goal, 0.0, [self.patch.size] * 2)

    @functools.cached_property
    def hiding_margin(self) -> float:
        """Least distance from a lid's edge at which a camera's line of sight to a cube's foot meets the lid [m]."""
        least = math.inf
        for (_, camera, _), (i, spot) in product(CAMERAS, enumerate(self.spots)):
            foot, turn = self.foot(i), about_z(math.radians(spot.yaw))
            share = self.cube.edge / (camera[2] - TABLE_TOP)  # of the line from the foot to the camera, up to the lid
            for corner in corners(foot, math.radians(spot.yaw), self.cube.size):
                seen = (1 - share) * corner + share * np.array(camera[:2])
                inside = self.lid.width / 2 - np.abs(turn.T[:2, :2] @ (seen - foot[:2])).max()
                least = min(least, float(inside))
        return least

    @functools.cached_property
    def directions(self) -> tuple[Vec3, ...]:
        """Direction in which each lid is pushed: the first normals of their sides with clearance for all three.

        Straight ahead is tried first, then to the left, to the right and back. Empty if there are none.
        """
        return self._free_directions or ()

    @functools.cached_property
    def _free_directions(self) -> tuple[Vec3, ...] | None:
        free: list[list[tuple[Vec3, Outline]]] = []
        for i, spot in enumerate(self.spots):
            normals = [about_z(math.radians(spot.yaw + turn))[:, 0] for turn in (0.0, 90.0, -90.0, 180.0)]
            swept = [(normal, self.swept(i, normal)) for normal in normals]
            free.append([(along, area) for along, area in swept if area is not None])
        apart = (
            tuple(along for along, _ in choice)
            for choice in product(*free)
            if all(gap(one, other) >= MIN_CLEARANCE for (_, one), (_, other) in combinations(choice, 2))
        )
        return next(apart, None)

    def push_start(self, i: int) -> Vec3:
        """Place on the table where the push starts [m]."""
        return self.foot(i) - (self.lid.width / 2 + APPROACH_DISTANCE) * self.directions[i]

    def swept(self, i: int, along: Vec3) -> Outline | None:
        """Area over which hand and lid pass in a push along a direction [m]; None if it is not free."""
        start = self.lid.width / 2 + APPROACH_DISTANCE + FINGER_ACROSS
        end = PUSH_DISTANCE + FINGER_ACROSS + self.lid.width
        yaw = math.atan2(along[1], along[0])
        middle = self.foot(i)
        area = corners(middle, yaw, [start + end, self.lid.width], [(end - start) / 2, 0.0])
        pushed = corners(middle, yaw, [end, self.lid.width], [end / 2, 0.0])
        rest = middle + (end - self.lid.width / 2) * along
        gaps = [gap(area, outline) for k, outline in enumerate(self.lid_outlines) if k != i]
        clear = min([*gaps, gap(pushed, self.patch_outline)]) >= MIN_CLEARANCE
        return area if clear and on_table("a lid", rest, margin=0.02) is None else None
