"""T27 slip-recovery: carry an object to a place with a gripper that opens without a command on the way.

      start            slip               goal        seen from the side
       __       __ __ __ _                 __
      |  |  -> |  |     |  | v            |  |
    --+--+--------------+--+-----[========+--+====]--

Bottleneck: the slip voids the plan. The robot must notice it, find the object where it fell, grasp it again and
continue. A policy that continues without looking, or only grips harder, arrives with an empty hand.

Decisions, where the paper (App. B, T27) says "once during transport, the gripper unexpectedly opens for a brief window"
and "sliding the object is not allowed":

* Transport means: carried at least `MIN_LIFT` above where the object stood. An object 1 cm above the table stays
  between the fingers when they open, and is held again when they close. From `MIN_LIFT` on it falls clear of a jaw that
  points down, which holds an object at most 31 mm below its highest point, where the palm starts, and whose tips end 9
  mm below. Once the object has fallen by the sum, its top is below the tips. A level hand with the wrist turned over
  holds a raised object with its foot just above the table, and closes on it again after the slip (23 of 24). That is
  labelled: the object stands between the fingers when it lands. The slip comes at a distance from the place where the
  object was first so high, seen from above, and no goal counts before it, so creeping along lower or letting the slip
  happen on the spot gains nothing. The distance is hidden and has a wide range, and the object's narrow side is along
  the way: a hand that comes down blindly where objects fall on average comes down beside it or on it, and there is no
  time for a second attempt.
* During the window the gripper ignores its command and is open; afterwards it obeys. The window lasts longer than the
  fall; scenarios with shorter ones are refuted.
* The object falls out of the hand: no goal counts if the robot touches it at the end of a slip, unless it has lain on
  the table untouched in the meantime. A hand on its side, with one finger below the object, keeps it through the slip,
  and nothing is left to recover.
* Placed means: lifted again after the last slip, and released in the region, at rest. An object that falls into the
  region is not placed.
* The paper names no YCB object. These are proxies, solids of their size, mass and balance with printed labels
  (`assets.ycb`), or the scans if `ycb=FOLDER` is given.
* Sliding means: pushed by the robot over the table by `MAX_SLIDE` in total, while the robot touches the object and as
  long as it lies afterwards. Its motion after a fall does not count.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..assets.patch import Patch
from ..assets.prop import TABLE_TOP, place, table
from ..assets.ycb import Ycb
from ..decisions import Decision, choice, near, span
from ..geometry import UP, Vec3, heading, way_to
from ..means import Mean, throughout
from ..params import param
from ..physics import GRAVITY
from ..predicates import fallen, over, rests_on, still
from ..robots.jaw import OPEN_GAP, PALM_ABOVE, TIP_BELOW
from ..robots.panda import BASE
from ..scenario import Answer, Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT
from ..sim.memory import remember
from ..sim.world import World
from ..skills.grip import extent, take
from ..skills.jaw import carry, grasp, let_go, poke, put, release
from ..skills.motion import Pace, go_to, retreat
from ..skills.waiting import settle

MIN_LIFT = 0.05
"""Height above its stand to which an object must be lifted to count as carried [m]: more than `PALM_ABOVE` +
`TIP_BELOW`."""
MIN_CARRY_HEIGHT = 0.042  # height to which a carried object may sink [m]: also more than `PALM_ABOVE` + `TIP_BELOW`
MAX_SLIDE = 0.04
"""Total distance that the robot may push the object over the table [m]; a grasp and a landing move it by less."""
CARRY_HEIGHT = 0.07
"""Height at which the oracle carries the object [m]; from 12 cm objects fall on the face on which they stood."""
CARRY_PACE = Pace(0.2, 0.01)  # pace at which the oracle carries
REST_SPEED = 0.02  # speed below which the object counts as at rest [m/s]
FALL_TIME = 0.02 + math.sqrt(2 * (PALM_ABOVE + TIP_BELOW) / GRAVITY)
"""Time from the start of a slip until the object is below the finger tips [s]: 20 ms until its release, then free
fall."""
FLIGHT_DISTANCE = 0.018
"""Distance along the way that an object flies when it slips at the oracle's pace [m]: 16 to 22 mm measured."""
MAX_FLIGHT_DISTANCE = 0.03  # distance that is allowed for this flight [m]
MIN_CARRY_DISTANCE = 0.015
"""Least distance that the object is carried before a slip, and that remains after the last one [m]."""
MEMORY = ("slips", "jam_ends", "lost", "kept", "stood", "high", "high_x", "high_y", "recovered")
"""Number of slips and end of the present one; whether the object has lain on the table untouched since the slip
started, and whether the hand kept it through one; height of the object's centre of mass at the last contact with the
table [m]; whether it is carried high enough to slip, and since which place [m]; whether it has been so since the last
slip."""
PUSHES = ("pushed", "slid", "x", "y")
"""Whether the object lies where the robot pushed it, the total distance of the pushes, its place one period ago [m]."""


@dataclass(frozen=True, kw_only=True)
class Slip:
    """Place and duration of an opening of the gripper."""

    share: float = param(0.4, "1", 0.05, 0.95, hidden=True)
    """Share of the remaining way, from the start to the rim of the square, after which the slip comes."""
    seconds: float = param(0.30, "s", 0.05, 4.0, hidden=True)  # duration for which the gripper is forced open


@dataclass(frozen=True, kw_only=True)
class SlipRecovery(Scenario):
    """An object on the table, a green square at some distance, and one slip or several on the way."""

    VERSION = 2
    HOLD = 0.5
    NO_ABLATIONS = "the scene holds nothing that helps; without the slip less would be left to do"

    x: float = param(0.0, "m", -0.4, 0.4)
    y: float = param(0.17, "m", -0.4, 0.4)
    yaw: float = param(90.0, "deg", -180.0, 180.0, period=360.0)
    """Yaw of the object; at 90 the narrow side of every box and tin lies along y."""
    goal_x: float = param(0.0, "m", -0.4, 0.4)
    goal_y: float = param(-0.20, "m", -0.4, 0.4)
    slips: int = param(1, "slips", 0, 3, hidden=True)
    slip_0: Slip = Slip()
    slip_1: Slip = Slip()
    slip_2: Slip = Slip()
    thing: Ycb = Ycb(item=8, low=1)
    patch: Patch = Patch()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        remember(scene, *MEMORY, *PUSHES)
        place(scene, self.thing, "thing", [self.x, self.y, TABLE_TOP], math.radians(self.yaw))
        place(scene, self.patch, "patch", self.goal, free=False)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        if not world.memory["recovered"] or world.memory["slips"] < self.slips:
            return False
        placed = over(world, "thing", self.goal, self.patch.size / 2) and rests_on(world, "thing", "table")
        return placed and still(world, "thing", REST_SPEED)

    def failure(self, world: World) -> str | None:
        if world.memory["slid"] > MAX_SLIDE:
            return "the robot slid the thing over the table"
        return "the thing fell off the table" if fallen(world, "thing") else None

    def means(self) -> Mapping[str, Mean]:
        return {
            "the thing fell out of the hand": throughout(lambda world: not world.memory["kept"]),
            "the thing fell clear of the fingers": throughout(lambda world: not self.caught(world)),
        }

    def caught(self, world: World) -> bool:
        """Whether an object that slips comes to stand on the table between the fingers."""
        lands = self.pending(world) and world.touching("thing", "table") and not world.memory["lost"]
        spans = ((world.arm.hand @ axis, *extent(world, "thing", axis)) for axis in world.rot("thing").T)
        return lands and all(low <= at <= high for at, low, high in spans)

    def events(self, world: World) -> None:
        """Track where the object is carried and pushed, and open the jaw at the place of a slip."""
        memory, at = world.memory, world.com("thing")
        touched, lies = world.touching(ROBOT, "thing"), world.touching("thing", "table")
        memory["pushed"] = float(lies and (touched or memory["pushed"] > 0))
        if memory["pushed"]:
            memory["slid"] += math.hypot(at[0] - memory["x"], at[1] - memory["y"])
        memory["x"], memory["y"] = at[:2]
        if lies:
            memory["stood"] = at[2]
        memory["lost"] = max(memory["lost"], float(lies and not touched))
        if world.passes(memory["jam_ends"]):
            memory["kept"] = max(memory["kept"], float(self.kept(world)))
        raised = at[2] - memory["stood"] >= (MIN_CARRY_HEIGHT if memory["high"] else MIN_LIFT)
        carried = raised and touched and not lies and not self.pending(world)
        if carried and not memory["high"]:
            memory["high_x"], memory["high_y"], memory["recovered"] = at[0], at[1], 1.0
        memory["high"] = float(carried)
        slips, carried_by = int(memory["slips"]), math.hypot(at[0] - memory["high_x"], at[1] - memory["high_y"])
        if carried and slips < self.slips and carried_by >= self.distance(slips):
            memory["slips"], memory["jam_ends"] = slips + 1, world.time + self.planned[slips].seconds
            memory["high"] = memory["recovered"] = memory["lost"] = 0.0
        world.arm.jam(self.pending(world))

    def kept(self, world: World) -> bool:
        """Whether the robot touches the object at the end of a slip, and has done so whenever it was on the table."""
        return world.touching(ROBOT, "thing") and not world.memory["lost"]

    def pending(self, world: World) -> bool:
        """Whether the gripper is forced open."""
        return world.time < world.memory["jam_ends"] - 1e-9

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Pick the object up and carry it; if the hand is empty, find the object and start again; put it down."""
        while True:
            yield from take(world.arm, "thing", lift=CARRY_HEIGHT)
            yield from self.bring(world)
            if world.touching(ROBOT, "thing"):
                break
            yield from release(world.arm)
            yield from settle(world, "thing", below=REST_SPEED)
        yield from self.set_down(world)

    def bring(self, world: World, height: float = CARRY_HEIGHT) -> Plan:
        """Carry the object above the goal, as long as it is in the hand."""
        level = np.array([*self.goal[:2], world.memory["stood"] + height])
        yield from carry(world.arm, "thing", level, pace=CARRY_PACE, ends=lambda: not world.touching(ROBOT, "thing"))

    def set_down(self, world: World) -> Plan:
        """Lower the held object at the goal until it stands, let go, move up."""
        stands = np.array([*self.goal[:2], world.memory["stood"]])
        yield from put(world.arm, "thing", stands, "table", hover=0.03)
        yield from retreat(world.arm, 0.06)

    def steps(self) -> Mapping[str, Planner]:
        def find(world: World) -> Plan:
            if not world.touching(ROBOT, "thing"):
                yield from release(world.arm)
                yield from settle(world, "thing", below=REST_SPEED)

        def take_again(world: World) -> Plan:
            if not world.touching(ROBOT, "thing"):
                yield from take(world.arm, "thing", lift=CARRY_HEIGHT)

        return {
            "take_object": lambda world: take(world.arm, "thing", lift=CARRY_HEIGHT),
            "carry": self.bring,
            "find_object": find,
            "take_again": take_again,
            "put_down": self.set_down,
            "slide_object": self._drag,
            "carry_low": self._carry_low,
            "grip_harder": self._grip_harder,
        }

    # --- shortcuts ------------------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "carry_on": Shortcut(self._carry_on),
            "grip_harder": Shortcut(self._grip_harder),
            "carry_it_low": Shortcut(self._carry_low),
            "drag_it": Shortcut(self._drag),
            "push_the_rest": Shortcut(self._push_rest),
        }

    def _move_to_goal(self, world: World, height: float) -> Plan:
        """Move the hand, empty or not, above the goal at a height above the table [m]."""
        yield from go_to(world.arm, np.array([*self.goal[:2], TABLE_TOP + height]), pace=CARRY_PACE)

    def _carry_on(self, world: World) -> Plan:
        """Continue as if nothing had happened: above the goal, down, open."""
        yield from take(world.arm, "thing", lift=CARRY_HEIGHT)
        held_at = world.arm.hand[2] - TABLE_TOP
        yield from self._move_to_goal(world, held_at)
        yield from self._move_to_goal(world, held_at - CARRY_HEIGHT)
        yield from let_go(world.arm)

    def _grip_harder(self, world: World) -> Plan:
        """When the object slips, stop and squeeze for longer than slips last, then continue."""
        yield from take(world.arm, "thing", lift=CARRY_HEIGHT)
        held_at = world.arm.hand[2] - TABLE_TOP
        yield from self.bring(world)
        yield from grasp(world.arm, 0.6)
        yield from self._move_to_goal(world, held_at)
        yield from self._move_to_goal(world, held_at - CARRY_HEIGHT)
        yield from let_go(world.arm)

    def _carry_low(self, world: World) -> Plan:
        """Carry the object 1 cm above the table, where it stays between the fingers when it slips."""
        yield from take(world.arm, "thing", lift=0.0)
        yield from self.bring(world, 0.01)
        yield from self.set_down(world)

    def _drag(self, world: World) -> Plan:
        """Grasp the object and drag it over the table, which no slip can prevent."""
        yield from take(world.arm, "thing", lift=0.0)
        yield from self.bring(world, 0.0)
        yield from let_go(world.arm)

    def _push_rest(self, world: World) -> Plan:
        """After the fall, push the object to the goal with closed fingers."""
        yield from take(world.arm, "thing", lift=CARRY_HEIGHT)
        yield from self.bring(world)
        yield from settle(world, "thing", below=REST_SPEED)
        at, offset = world.com("thing"), (self.goal - world.com("thing")) * [1.0, 1.0, 0.0]
        along = offset / np.linalg.norm(offset)
        low, high = extent(world, "thing", -along)
        top = extent(world, "thing", UP)[1] - 0.02  # the palm stays above it
        behind = np.array([at[0], at[1], top]) - ((high - low) / 2 + 0.03) * along
        yield from poke(world.arm, behind, 0.1 * along, lambda: float((self.goal - world.com("thing")) @ along) <= 0.0)

    def answer(self) -> Answer:
        """Distance from the start, along the way to the goal, at which the object lies after its first slip [m].

        With the right guess a policy need not notice the slip. The time limit allows one guess.
        """
        width = self.thing.row.width or OPEN_GAP

        def right(away: float) -> bool:
            lies = self.distance(0) + FLIGHT_DISTANCE if self.slips else math.inf
            return self.slips == 1 and abs(away - lies) <= (OPEN_GAP - width) / 2

        return Answer(tuple(round(0.01 * k, 2) for k in range(2, 46)), self._guess, right, tries=1)

    def _guess(self, world: World, away: float) -> Plan:
        """Carry the object past the guess, open, come down at the guess, grasp and carry on, all blindly."""
        yield from take(world.arm, "thing", lift=CARRY_HEIGHT)
        along = (self.goal - self.start) / math.dist(self.goal, self.start)
        high, begin = CARRY_HEIGHT * UP, world.arm.hand
        low = begin - (world.com("thing")[2] - world.memory["stood"]) * UP
        yield from go_to(world.arm, begin + (away + MAX_FLIGHT_DISTANCE) * along, pace=CARRY_PACE)
        yield from release(world.arm)
        for there, closed in ((away, True), (math.dist(self.goal, self.start), False)):
            yield from go_to(world.arm, low + high + there * along, pace=CARRY_PACE)
            yield from go_to(world.arm, low + there * along)
            yield from (grasp if closed else release)(world.arm)
            yield from go_to(world.arm, low + high + there * along)

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        room = (0.08 - (self.thing.row.width or 0.08)) / 2
        lies, way = self.distance(0) + 0.018, (self.goal - self.start) / np.linalg.norm(self.goal - self.start)
        return {
            "lies_after": span(lies - room, lies + room),
            "lies_at": near(self.start + lies * way, room),
            "slips": choice(self.slips),
            "object": choice(self.thing.item, "thing"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        row = self.thing.row
        yield require(row.width is not None, "no jaw takes the thing", number=row.number)
        for slip in self.planned:
            yield require(slip.seconds > FALL_TIME, "the thing stays in the hand", seconds=slip.seconds, lost=FALL_TIME)
        left, least = self.left(len(self.planned)), MIN_CARRY_DISTANCE
        yield require(left >= least, "no way is left after the last slip", left=left, least=least)
        shortest = min((self.distance(i) for i in range(self.slips)), default=math.inf)
        yield require(shortest >= least, "a slip comes before the thing is on its way", distance=shortest, least=least)
        spots = np.array([self.start, self.goal])
        yield on_table("the way", spots, margin=self.patch.size / 2)
        yield within_reach("the way", *(spots + 0.2 * UP))

    def features(self) -> Mapping[str, float]:
        """Number, place and longest duration [s] of slips, way [m], mass [kg], cosine of the narrow side to the way."""
        way, side = self.left(0), heading(self.yaw) @ (self.goal - self.start)
        return {
            "number_of_slips": float(self.slips),
            "share_of_the_way_at_the_last_slip": 1.0 - self.left(self.slips) / way,
            "longest_slip": max((slip.seconds for slip in self.planned), default=0.0),
            "way": way,
            "mass": self.thing.mass,
            **self.thing.features,
            "narrow_side_along_the_way": abs(float(side)) / math.dist(self.start, self.goal),
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "square": way_to(self.goal, self.start),
            "apart": math.hypot(self.goal_x - self.x, self.goal_y - self.y),
            "distance": math.hypot(self.x - BASE[0], self.y - BASE[1]),
            "size": self.patch.size,
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def start(self) -> Vec3:
        """Initial position of the object's foot [m]."""
        return np.array([self.x, self.y, TABLE_TOP])

    @cached_property
    def goal(self) -> Vec3:
        """Middle of the region [m]."""
        return np.array([self.goal_x, self.goal_y, TABLE_TOP])

    @cached_property
    def planned(self) -> tuple[Slip, ...]:
        """Slips that happen, in their order."""
        return (self.slip_0, self.slip_1, self.slip_2)[: self.slips]

    def left(self, slips: int) -> float:
        """Distance to the rim of the square from where the object lies after the first `slips` slips [m]."""
        way = math.dist(self.start, self.goal) - self.patch.size / 2
        for slip in self.planned[:slips]:
            way -= slip.share * (way - MAX_FLIGHT_DISTANCE) + MAX_FLIGHT_DISTANCE
        return way

    def distance(self, slip: int) -> float:
        """Distance for which the object is carried before slip number `slip` [m]."""
        return self.planned[slip].share * (self.left(slip) - MAX_FLIGHT_DISTANCE)
