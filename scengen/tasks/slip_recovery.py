"""T27 slip-recovery: carry a thing to a place with a gripper that opens unasked on the way.

      start            slip               goal        seen from the side
       __       __ __ __ _                 __
      |  |  -> |  |     |  | v            |  |
    --+--+--------------+--+-----[========+--+====]--

Bottleneck: the plan that was good is void. The slip must be noticed, the thing found where it fell, taken again and
carried on; whoever goes on, or only grips harder, arrives with an empty hand.

Decisions, where the paper (App. B, T27) says "once during transport, the gripper unexpectedly opens for a brief window"
and "sliding the object is not allowed":

* Transport means carried at least `LIFTED` above where it stood. A thing 1 cm above the table stays between the fingers
  when they open, and is held again when they close. From `LIFTED` it is lost: a jaw that points down holds a thing at
  most 31 mm under its highest point, where the palm begins, and its tips end 9 mm below: once it has fallen by the sum
  its top is under the tips. The slip comes a distance from where the thing came to be so high, seen from above, and
  without it no goal counts: nothing is gained by creeping along lower, or by letting the slip happen on the spot. That
  distance is hidden and of wide range, and the thing stands with its narrow side along the way: a hand that goes down
  blindly where things fall on average comes down beside it or on top of it, and there is no time to do so twice.
* During the window the gripper is open whatever is commanded, and then obeys again. The window lasts longer than that
  fall: shorter ones are refuted.
* Placed means: lifted again after the last slip, and let go in the region, at rest. What falls into it is not placed.
* The paper names no YCB object. These are proxies, solids of their size, mass and balance (`assets.ycb`), or
  scans where `ycb=FOLDER` is given.
* Slid is what has gone `SLID` over the table pushed by the robot, all stretches added up: touched while it lay, and as
  long as it lies after that. Where it goes after a fall does not count.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from ..assets.patch import Patch
from ..assets.prop import TABLE_TOP, place, table
from ..assets.ycb import Ycb
from ..control.loop import Loop
from ..geometry import UP, Vec3, heading
from ..params import param
from ..physics import GRAVITY
from ..predicates import fallen, over, rests_on, still
from ..robots.jaw import OPEN_GAP, PALM_ABOVE, TIP_BELOW
from ..scenario import Answer, Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.memory import remember
from ..sim.world import ROBOT, World
from ..skills.grip import extent, take
from ..skills.jaw import carry, grasp, poke, put, release
from ..skills.motion import Pace, go_to, retreat

LIFTED, LOWERED = 0.05, 0.042
"""How far a thing must be lifted to count as carried, and how low it may sink then [m]: both more than `PALM_ABOVE` and
`TIP_BELOW` together."""
SLID = 0.04
"""How far in all the robot may push the thing over the table [m]; a grasp and a landing move it by less."""
RAISED = 0.07
"""How high the oracle carries the thing [m]; from 12 cm things fall on the face that they stood on."""
CALM, RESTED = 0.02, 0.2
"""Speed below which a thing counts as at rest [m/s], and for how long it must be so before it is taken again [s]."""
BRISK = Pace(0.2, 0.01)
"""How fast the oracle carries."""
LOST = 0.02 + math.sqrt(2 * (PALM_ABOVE + TIP_BELOW) / GRAVITY)
"""From the beginning of a slip until the thing is below the finger tips [s]: 20 ms to let go, then free fall."""
FLOWN = 0.018
"""How far a thing flies that is lost at the oracle's pace [m]: 16 to 22 mm measured."""
OVERRUN, SHORTEST = 0.03, 0.015
"""How far a thing flies on that is lost on the way, and how far it must come before a slip and be away after it [m]."""
MEMORY = ("slips", "jam_ends", "stood", "high", "high_x", "high_y", "recovered", "pushed", "slid", "x", "y")
"""How often and until when the jaw has slipped; how high the thing's centre of mass was when it last touched the table
[m]; whether it is carried so high that it may slip, and since where [m]; whether it has been so since the last slip;
whether it lies where the robot pushed it, and how far in all [m]; where it was a period ago [m]."""


@dataclass(frozen=True, kw_only=True)
class Slip:
    """When the gripper opens, and for how long."""

    share: float = param(0.4, "1", 0.05, 0.95, hidden=True)
    """Of the way that is left, start to the rim of the square, at which it comes."""
    seconds: float = param(0.30, "s", 0.05, 4.0, hidden=True)


@dataclass(frozen=True, kw_only=True)
class SlipRecovery(Scenario):
    """A thing on the table, a green square at some distance, and one slip or several on the way."""

    HOLD = 0.5
    NO_ABLATIONS = "the scene holds nothing that helps; without the slip less would be left to do"

    x: float = param(0.0, "m", -0.4, 0.4)
    y: float = param(0.17, "m", -0.4, 0.4)
    yaw: float = param(90.0, "deg", -180.0, 180.0, period=360.0)
    """Of the thing; at 90 the narrow side of every box and tin lies along y."""
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
        remember(scene, *MEMORY)
        place(scene, self.thing, "thing", [self.x, self.y, TABLE_TOP], math.radians(self.yaw))
        place(scene, self.patch, "patch", self.goal, free=False)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        if not world.memory["recovered"] or world.memory["slips"] < self.slips:
            return False
        placed = over(world, "thing", self.goal, self.patch.size / 2) and rests_on(world, "thing", "table")
        return placed and still(world, "thing", CALM)

    def failure(self, world: World) -> str | None:
        if world.memory["slid"] > SLID:
            return "the robot slid the thing over the table"
        return "the thing fell off the table" if fallen(world, "thing") else None

    def events(self, world: World) -> None:
        """Watch where the thing is carried and pushed, and open the jaw when it is time."""
        memory, at = world.memory, world.com("thing")
        touched, lies = world.touching(ROBOT, "thing"), world.touching("thing", "table")
        memory["pushed"] = float(lies and (touched or memory["pushed"] > 0))
        if memory["pushed"]:
            memory["slid"] += math.hypot(at[0] - memory["x"], at[1] - memory["y"])
        memory["x"], memory["y"] = at[:2]
        if lies:
            memory["stood"] = at[2]
        raised = at[2] - memory["stood"] >= (LOWERED if memory["high"] else LIFTED)
        carried = raised and touched and not lies and not self.pending(world)
        if carried and not memory["high"]:
            memory["high_x"], memory["high_y"], memory["recovered"] = at[0], at[1], 1.0
        memory["high"] = float(carried)
        slips, come = int(memory["slips"]), math.hypot(at[0] - memory["high_x"], at[1] - memory["high_y"])
        if carried and slips < self.slips and come >= self.distance(slips):
            memory["slips"], memory["jam_ends"] = slips + 1, world.time + self.planned[slips].seconds
            memory["high"] = memory["recovered"] = 0.0
        world.arm.jam(self.pending(world))

    def pending(self, world: World) -> bool:
        """As long as the gripper is forced open."""
        return world.time < world.memory["jam_ends"] - 1e-9

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Pick up, carry; as soon as the hand is empty find the thing and begin again; put down."""
        while True:
            yield from take(world.arm, "thing", lift=RAISED)
            yield from self.bring(world)
            if world.touching(ROBOT, "thing"):
                break
            yield from release(world.arm)
            yield from self.settle(world)
        yield from self.set_down(world)

    def settle(self, world: World) -> Plan:
        """Wait until the thing has been at rest for a while: a can that rocks is slow at the end of every swing."""
        quiet = 0.0
        while quiet < RESTED:
            yield world.idle
            quiet = quiet + Loop.PERIOD if still(world, "thing", CALM) else 0.0

    def bring(self, world: World, height: float = RAISED) -> Plan:
        """Carry it over the goal, as long as it is in the hand."""
        level = np.array([*self.goal[:2], world.memory["stood"] + height])
        yield from carry(world.arm, "thing", level, pace=BRISK, ends=lambda: not world.touching(ROBOT, "thing"))

    def set_down(self, world: World) -> Plan:
        """Lower what is in the hand at the goal until it stands, let go, go up."""
        stands = np.array([*self.goal[:2], world.memory["stood"]])
        yield from put(world.arm, "thing", stands, "table", hover=0.03)
        yield from retreat(world.arm, 0.06)

    # --- shortcuts ------------------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "carry_on": Shortcut(self._carry_on),
            "grip_harder": Shortcut(self._grip_harder),
            "carry_it_low": Shortcut(self._carry_low),
            "drag_it": Shortcut(self._drag),
            "push_the_rest": Shortcut(self._push_rest),
        }

    def _over(self, world: World, height: float, pace: Pace = BRISK) -> Plan:
        """Take the hand over the goal, whatever is in it: at what height above the table [m]."""
        yield from go_to(world.arm, np.array([*self.goal[:2], TABLE_TOP + height]), pace=pace)

    def _carry_on(self, world: World) -> Plan:
        """As if nothing had happened: over the goal, down, open."""
        yield from take(world.arm, "thing", lift=RAISED)
        held_at = world.arm.hand[2] - TABLE_TOP
        yield from self._over(world, held_at)
        yield from self._over(world, held_at - RAISED)
        yield from release(world.arm)
        yield from retreat(world.arm)

    def _grip_harder(self, world: World) -> Plan:
        """As soon as it slips stop and squeeze for as long as slips last, then go on with what is in the hand."""
        yield from take(world.arm, "thing", lift=RAISED)
        held_at = world.arm.hand[2] - TABLE_TOP
        yield from self.bring(world)
        yield from grasp(world.arm, 0.6)
        yield from self._over(world, held_at)
        yield from self._over(world, held_at - RAISED)
        yield from release(world.arm)
        yield from retreat(world.arm)

    def _carry_low(self, world: World) -> Plan:
        """1 cm above the table, where a thing that slips stays between the fingers."""
        yield from take(world.arm, "thing", lift=0.0)
        yield from self.bring(world, 0.01)
        yield from self.set_down(world)

    def _drag(self, world: World) -> Plan:
        """Take hold of it and draw it over the table, which no slip can prevent."""
        yield from take(world.arm, "thing", lift=0.0)
        yield from self.bring(world, 0.0)
        yield from release(world.arm)
        yield from retreat(world.arm)

    def _push_rest(self, world: World) -> Plan:
        """Once it has fallen push it home with closed fingers."""
        yield from take(world.arm, "thing", lift=RAISED)
        yield from self.bring(world)
        yield from self.settle(world)
        at, way = world.com("thing"), (self.goal - world.com("thing")) * [1.0, 1.0, 0.0]
        along = way / np.linalg.norm(way)
        low, high = extent(world, "thing", -along)
        top = extent(world, "thing", UP)[1] - 0.02  # the palm stays above it
        behind = np.array([at[0], at[1], top]) - ((high - low) / 2 + 0.03) * along
        yield from poke(world.arm, behind, 0.1 * along, lambda: float((self.goal - world.com("thing")) @ along) <= 0.0)

    def answer(self) -> Answer:
        """Where the thing lies after its first slip: how far from the start on the straight way to the goal [m].

        Whoever guesses right needs not look whether it has slipped, nor when. Time allows for one guess.
        """
        width = self.thing.row.width or OPEN_GAP

        def right(away: float) -> bool:
            lies = self.distance(0) + FLOWN if self.slips else math.inf
            return self.slips == 1 and abs(away - lies) <= (OPEN_GAP - width) / 2

        return Answer(tuple(round(0.01 * k, 2) for k in range(2, 46)), self._guess, right, tries=1)

    def _guess(self, world: World, away: float) -> Plan:
        """Carry the thing past the guess, open, come down at the guess, and carry on from there, all blindly."""
        yield from take(world.arm, "thing", lift=RAISED)
        along = (self.goal - self.start) / math.dist(self.goal, self.start)
        high, begin = RAISED * UP, world.arm.hand
        low = begin - (world.com("thing")[2] - world.memory["stood"]) * UP
        yield from go_to(world.arm, begin + (away + OVERRUN) * along, pace=BRISK)
        yield from release(world.arm)
        for there, closed in ((away, True), (math.dist(self.goal, self.start), False)):
            yield from go_to(world.arm, low + high + there * along, pace=BRISK)
            yield from go_to(world.arm, low + there * along)
            yield from (grasp if closed else release)(world.arm)
            yield from go_to(world.arm, low + high + there * along)

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        row = self.thing.row
        yield require(row.width is not None, "no jaw takes the thing", number=row.number)
        for slip in self.planned:
            yield require(slip.seconds > LOST, "the thing stays in the hand", seconds=slip.seconds, lost=LOST)
        left, span = self.left(len(self.planned)), SHORTEST
        yield require(left >= span, "no way is left after the last slip", left=left, least=span)
        shortest = min((self.distance(i) for i in range(self.slips)), default=math.inf)
        yield require(shortest >= span, "a slip comes before the thing is on its way", distance=shortest, least=span)
        spots = np.array([self.start, self.goal])
        yield on_table("the way", spots, margin=self.patch.size / 2)
        yield within_reach("the way", *(spots + 0.2 * UP))

    def features(self) -> Mapping[str, float]:
        """When it slips, for how long [s], how far it is [m], the mass [kg], and how the narrow side lies (cosine)."""
        way, side = self.left(0), heading(self.yaw) @ (self.goal - self.start)
        return {
            "number_of_slips": float(self.slips),
            "share_of_the_way_at_the_last_slip": 1.0 - self.left(self.slips) / way,
            "longest_slip": max((slip.seconds for slip in self.planned), default=0.0),
            "way": way,
            "mass": self.thing.mass,
            **self.thing.told,
            "narrow_side_along_the_way": abs(float(side)) / math.dist(self.start, self.goal),
        }

    # --- geometry -------------------------------------------------------------------------

    @property
    def material(self) -> str:
        return self.thing.scan.sha256 if self.thing.scan else ""

    @property
    def start(self) -> Vec3:
        """Where the thing stands [m]."""
        return np.array([self.x, self.y, TABLE_TOP])

    @property
    def goal(self) -> Vec3:
        """Middle of the region [m]."""
        return np.array([self.goal_x, self.goal_y, TABLE_TOP])

    @property
    def planned(self) -> tuple[Slip, ...]:
        """The slips that happen, in their order."""
        return (self.slip_0, self.slip_1, self.slip_2)[: self.slips]

    def left(self, slips: int) -> float:
        """Way from where the thing falls for the last of the first `slips` times to the rim of the square [m]."""
        way = math.dist(self.start, self.goal) - self.patch.size / 2
        for slip in self.planned[:slips]:
            way -= slip.share * (way - OVERRUN) + OVERRUN
        return way

    def distance(self, slip: int) -> float:
        """How far from where it has been raised the thing slips, the first time and later ones [m]."""
        return self.planned[slip].share * (self.left(slip) - OVERRUN)
