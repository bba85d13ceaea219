"""T29 pick-place-ycb: put an object on a green square that jumps away when the object comes near.

      thing                        seen from above; the square lies at 0 when the object is lifted, jumps to 1
       ()  - - ->  [0]             when the object is near, then to 2, and there it is locked
                    .
                    . - - - [1]
           [2] - - - - - -'

Bottleneck: the goal moves. A policy that completes the plan made at the start puts the object down on bare table. How
often the square jumps, and where to, is not known in advance. A policy that always steers to where the square is now
needs neither: it comes within `near` of the square before it is over it, so a square that stays below the object is
locked. Such a policy never looks at the colour, and succeeds (6 of 6; `more_jumps` and `late_jump` 4 of 4 each).

Decisions, where the paper (App. B, T29) says "when the lifted object approaches the patch, the patch teleports to a new
location; after 1-3 relocations, the patch locks in place":

* The square jumps when an object that has been lifted once is within a distance of its middle, at any height: putting
  the object down early and pushing it to the square gains nothing. The square never jumps to a place as near to the
  object.
* It jumps a given distance, to a place on the field in front of the robot, where all places can be reached.
* Locked means that its dark side is up; only then does it count. Nothing else shows it.
* The objects are proxies, solids of their size, mass and balance with printed labels (`assets.ycb`), or the scans if
  `ycb=FOLDER` is given. Cartons lie on their narrow side, as a jaw must grasp them; the master chef can of the paper's
  list is too wide for it.
"""

import functools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from ..assets.patch import TURNED_OVER, Patch
from ..assets.prop import TABLE_TOP, place, table
from ..assets.ycb import Ycb
from ..decisions import Decision, choice, near
from ..geometry import UP, Vec3, heading, way_to
from ..means import Mean, throughout, when
from ..params import param
from ..predicates import borne, fallen, held, over, rests_on, still
from ..robots.panda import BASE
from ..scenario import Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.memory import remember
from ..sim.world import World
from ..skills.grip import take
from ..skills.jaw import carry, let_go, put
from ..skills.motion import Condition, Pace, retreat

MIN_LIFT = 0.03  # height of the object's centre of mass above its stand from which the object counts as lifted [m]
CARRY_HEIGHT = 0.07
"""Height at which the oracle carries the object [m]; an object lost there falls on the face on which it stood."""
CARRY_PACE = Pace(0.2, 0.01)  # pace at which the oracle carries
FIELD = np.array([[-0.22, 0.05], [-0.32, 0.32]])
"""Range of the middle of the square, in x and y [m]: 0.34 to 0.69 from the robot's first axis, where a hand that points
down comes without leaning or folding up."""
JUMP_MARGIN = 0.03  # distance, in excess of `near`, of the object from the square after any jump [m]


@dataclass(frozen=True, kw_only=True)
class Jump:
    """Distance and direction of a jump of the square."""

    way: float = param(0.24, "m", 0.05, 0.60, hidden=True)  # distance of the jump
    share: float = param(0.5, "1", 0.0, 0.999, hidden=True)
    """Direction of the jump: the directions in whole degrees that end on the field are counted from x to the left, and
    this share of them is skipped."""


@dataclass(frozen=True, kw_only=True)
class PickPlaceYcb(Scenario):
    """An object on the table, and a green square that is going to jump a few times."""

    VERSION = 2
    HOLD = 0.5
    NO_ABLATIONS = "the scene holds nothing that helps; a square that stays would leave less to do"

    x: float = param(-0.05, "m", -0.4, 0.4)
    y: float = param(0.15, "m", -0.4, 0.4)
    yaw: float = param(90.0, "deg", -180.0, 180.0, period=360.0)
    """Yaw of the object; at 90 the narrow side of every box and tin lies along y."""
    goal_x: float = param(-0.05, "m", -0.4, 0.4)
    goal_y: float = param(-0.15, "m", -0.4, 0.4)
    near: float = param(0.075, "m", 0.01, 0.25, hidden=True)
    """Distance of the object from the middle of the square at which the square jumps, seen from above."""
    jumps: int = param(2, "jumps", 0, 5, hidden=True)
    jump_0: Jump = Jump()
    jump_1: Jump = Jump()
    jump_2: Jump = Jump()
    jump_3: Jump = Jump()
    jump_4: Jump = Jump()
    thing: Ycb = Ycb(item=2, low=1)
    patch: Patch = Patch(size=0.10)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        remember(scene, "jumps", "stood", "lifted")
        place(scene, self.thing, "thing", self.start, math.radians(self.yaw))
        place(scene, self.patch, "patch", self.spots[0], free=False)
        scene.body("patch").mocap = True
        if not self.jumps:
            scene.body("patch").quat = np.array(TURNED_OVER)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        if not world.memory["lifted"] or world.memory["jumps"] < self.jumps:
            return False
        placed = over(world, "thing", world.pos("patch"), self.patch.size / 2) and rests_on(world, "thing", "table")
        return placed and still(world, "thing", 0.02)

    def failure(self, world: World) -> str | None:
        return "the thing fell off the table" if fallen(world, "thing") else None

    def means(self) -> Mapping[str, Mean]:
        def near(world: World) -> bool:
            spot = self.spots[int(world.memory["jumps"])]
            return math.dist(world.com("thing")[:2], spot[:2]) <= self.near

        def comes(world: World) -> bool:
            locked = world.memory["jumps"] == self.jumps
            return locked and over(world, "thing", world.pos("patch"), self.patch.size / 2)

        return {
            "the jaw bore the thing whenever the square jumped": throughout(
                lambda world: world.memory["jumps"] == self.jumps or not near(world) or borne(world, world.arm, "thing")
            ),
            "the jaw bore the thing over the locked square": when(
                comes, lambda world: borne(world, world.arm, "thing")
            ),
            "the jaw set the thing down there": when(
                lambda world: comes(world) and world.touching("thing", "table"), lambda world: world.arm.grips("thing")
            ),
        }

    def events(self, world: World) -> None:
        """Notice that the object is lifted, and let the square jump away from it."""
        memory, at = world.memory, world.com("thing")
        if world.touching("thing", "table"):
            memory["stood"] = at[2]
        elif at[2] - memory["stood"] >= MIN_LIFT and held(world, "thing"):
            memory["lifted"] = 1.0
        jumps = int(memory["jumps"])
        if memory["lifted"] and jumps < self.jumps and math.dist(at[:2], self.spots[jumps][:2]) <= self.near:
            memory["jumps"] = jumps + 1
            world.move("patch", self.spots[jumps + 1], TURNED_OVER if jumps + 1 == self.jumps else (1, 0, 0, 0))

    def pending(self, world: World) -> bool:
        """Never: the square moves only when the object is brought near."""
        return False

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Pick the object up, follow the square until it is locked, put the object down on it."""
        yield from take(world.arm, "thing", lift=CARRY_HEIGHT)
        while (before := world.memory["jumps"]) < self.jumps:
            yield from self._bring_near(world)
            if world.memory["jumps"] == before:
                yield world.arm.idle  # who believes in a jump that does not come waits until the time is over
        yield from self.set_down(world, world.pos("patch"))

    def _bring_near(self, world: World) -> Plan:
        """Carry the object above the square as it is now, until the square jumps."""
        spot = world.pos("patch")
        yield from self.bring(world, spot, ends=lambda: math.dist(world.pos("patch"), spot) > 0.0)

    def bring(self, world: World, spot: Vec3, height: float = CARRY_HEIGHT, ends: Condition = lambda: False) -> Plan:
        """Carry the object above a place on the table, at a height above where it stood [m]."""
        level = np.array([spot[0], spot[1], world.memory["stood"] + height])
        yield from carry(world.arm, "thing", level, pace=CARRY_PACE, ends=ends)

    def set_down(self, world: World, spot: Vec3) -> Plan:
        """Put the object down at a place on the table [m], let go, move up."""
        yield from self.bring(world, spot)
        yield from put(world.arm, "thing", [spot[0], spot[1], world.memory["stood"]], "table", hover=0.03)
        yield from retreat(world.arm, 0.06)

    def steps(self) -> Mapping[str, Planner]:
        def approach(world: World) -> Plan:
            if world.memory["jumps"] < self.jumps:
                yield from self._bring_near(world)

        def put_down(world: World) -> Plan:
            at = [*world.com("thing")[:2], world.memory["stood"]]
            yield from put(world.arm, "thing", at, "table", hover=0.03)
            yield from retreat(world.arm, 0.06)

        return {
            "take_object": lambda world: take(world.arm, "thing", lift=CARRY_HEIGHT),
            "approach": approach,
            "follow": self._bring_near,
            "put_down": put_down,
            "place_at_start": lambda world: self.set_down(world, self.spots[0]),
            "drag": self._drag,
        }

    # --- shortcuts ------------------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        """Plans that do not follow the square; if it jumps only once, following it once is right."""
        found = {
            "put_it_where_the_square_was": Shortcut(self._first_plan, to_rest=True),
            "drag_it_there": Shortcut(self._drag, to_rest=True),
            "drag_it_there_and_lift_it": Shortcut(self._drag_and_lift, to_rest=True),
            "put_it_down_short": Shortcut(self._short, to_rest=True),
        }
        one = {"follow_the_square_once": Shortcut(self._follow_once, to_rest=True)}
        return found | one if self.jumps > 1 else found

    def _first_plan(self, world: World) -> Plan:
        """Carry the object to the initial place of the square."""
        yield from take(world.arm, "thing", lift=CARRY_HEIGHT)
        yield from self.set_down(world, self.spots[0])

    def _follow_once(self, world: World) -> Plan:
        """Carry the object to the square's second place, and no farther."""
        yield from take(world.arm, "thing", lift=CARRY_HEIGHT)
        yield from self.bring(world, self.spots[0])
        yield from self.set_down(world, self.spots[1])

    def _drag(self, world: World) -> Plan:
        """Drag the object over the table to the square, which does not jump before the object is lifted."""
        yield from take(world.arm, "thing", lift=0.0)
        yield from self.bring(world, self.spots[0], height=0.0)
        yield from let_go(world.arm, 0.06)

    def _drag_and_lift(self, world: World) -> Plan:
        """Drag the object to the square, then lift it and put it down."""
        yield from self._drag(world)
        yield from take(world.arm, "thing", lift=CARRY_HEIGHT)
        yield from self.set_down(world, self.spots[0])

    def _short(self, world: World) -> Plan:
        """Put the object down 2 cm outside of the distance at which the square jumps."""
        yield from take(world.arm, "thing", lift=CARRY_HEIGHT)
        back = self.start - self.spots[0]
        yield from self.set_down(world, self.spots[0] + (self.near + 0.02) * back / np.linalg.norm(back))

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        spots = self.spots() if callable(self.spots) else self.spots
        return {
            "jumps": choice(self.jumps),
            "second_square": near(spots[1], 0.035),
            "last_square": near(spots[-1], 0.035),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        row, spots = self.thing.row, self.spots
        yield require(row.width is not None, "no jaw takes the thing", number=row.number)
        missing = self.jumps + 1 - len(spots)
        yield require(missing == 0, "the square has nowhere to jump to", jumps=self.jumps, missing=missing)
        inside = (FIELD[:, 0] <= spots[0][:2]) & (spots[0][:2] <= FIELD[:, 1])
        yield require(bool(inside.all()), "the square lies beyond the field", x=self.goal_x, y=self.goal_y)
        least = 2 * self.near + JUMP_MARGIN
        shortest = min((jump.way for jump in self.planned), default=least)
        yield require(shortest >= least, "the square jumps into the thing", way=shortest, least=least)
        away = math.dist(self.start, spots[0])
        yield require(away >= least, "the thing is near the square from the start", distance=away, least=least)
        yield on_table("the thing", self.start, margin=0.08)
        yield within_reach("the thing", self.start + 0.2 * UP)

    def features(self) -> Mapping[str, float]:
        """Number and longest distance of jumps [m], distance `near` in sizes of the square, size [m], mass [kg]."""
        return {
            "number_of_jumps": float(self.jumps),
            "longest_jump": max((jump.way for jump in self.planned), default=0.0),
            "near_over_size": self.near / self.patch.size,
            "size": self.patch.size,
            "mass": self.thing.mass,
            **self.thing.features,
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "square": way_to(np.array([self.goal_x, self.goal_y]), np.array([self.x, self.y])),
            "apart": math.hypot(self.goal_x - self.x, self.goal_y - self.y),
            "distance": math.hypot(self.x - BASE[0], self.y - BASE[1]),
            "size": self.patch.size,
        }

    # --- geometry -------------------------------------------------------------------------

    @functools.cached_property
    def start(self) -> Vec3:
        """Initial position of the object's foot [m]."""
        return np.array([self.x, self.y, TABLE_TOP])

    @functools.cached_property
    def planned(self) -> tuple[Jump, ...]:
        """Jumps that happen, in their order."""
        return (self.jump_0, self.jump_1, self.jump_2, self.jump_3, self.jump_4)[: self.jumps]

    @functools.cached_property
    def spots(self) -> list[Vec3]:
        """Places of the square at the start and after each jump [m]; fewer if the field has no place for a jump."""
        found = [np.array([self.goal_x, self.goal_y, TABLE_TOP])]
        for jump in self.planned:
            ends = found[-1] + jump.way * np.array([heading(float(angle)) for angle in range(360)])
            free = ends[((FIELD[:, 0] <= ends[:, :2]) & (ends[:, :2] <= FIELD[:, 1])).all(axis=1)]
            if not len(free):
                break
            found.append(free[int(jump.share * len(free))])
        return found
