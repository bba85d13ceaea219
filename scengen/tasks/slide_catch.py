"""T15 slide-catch: draw a bin from lane to lane, so that it is where the next block slides off a tilting ramp.

        |  []          ramp, tilting up        seen from above; the robot is below
        |        []
        |  .     .  [] |
     lip ----+-----+-----+----
                 _____
                |_bin_|
                   |  handle

Bottleneck: a block lets go of the ramp where the tangent of its slope reaches the friction, and is over the lip half a
second later. In that time the bin gets no farther than half a lane; it must be there before, wait, and then be taken on
to the lane of the block that is going to slide next. Everything else is said by the angle: who watches the ramp tilt
and knows which of the blocks that are left is the slickest need not know when.

Decisions where the paper (App. B, T15) is silent:

* The paper says both that friction decides when a block slides and that the lower ones slide first. In training both
  hold, as the lower ones are the slicker ones. Friction shows: the darker a block, the rougher.
* Lanes are so far apart that no place of the bin serves two, and so is the time of the slides: a bin that is drawn at
  the hand's speed comes in time to the next lane, but not if it leaves only when a block there is seen to slide, by
  2 mm. Who knows which one comes first and waits for it may, after that, wait midway between the other two, if they
  lie in neighbouring lanes, and go to the one that moves: half a lane is near enough. Of the six sequences four allow
  that, and none without having foreseen the first.
* When the ramp begins to tilt varies by more than the bin has to spare: who moves on by the clock misses some of them.
* Chance: training has all six sequences; who always answers with the same one is right in a sixth of it.
* The bin catches, and nothing else. Neither the robot nor the bin may touch a block on the ramp: by hand the blocks
  could be picked off, and with the bin herded into one lane. Nor may the robot touch the ramp. A block that has come to
  the table is lost.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise, permutations

import mujoco
import numpy as np

from ..assets.box import Cube
from ..assets.catch_bin import CatchBin
from ..assets.incline import Incline, driven
from ..assets.prop import TABLE_TOP, Rgba, place, table
from ..geometry import UP, Vec3, about_z, yaw_of
from ..params import check_bounds, param
from ..physics import slid, slip_angle
from ..predicates import fallen, still
from ..scenario import Answer, Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import ROBOT, World
from ..skills.jaw import pick, release
from ..skills.motion import Condition, Pace, facing_down, go_to, hold, retreat, stay

COUNT = 3
ORDERS = tuple(permutations(range(COUNT)))
"""Lanes, counted from the left, of the lowest, the middle and the highest block."""
MASS = 0.02
"""Of a block [kg]."""
PALE, DARK = np.array([0.96, 0.93, 0.86]), np.array([0.10, 0.08, 0.12])
"""Colours of what has no friction and of what has `ROUGHEST`; between them, in proportion."""
ROUGHEST = 1.0
UNDER = 0.014
"""How far the bin's inside reaches under the lip [m], so that nothing falls behind it."""
SUNK, REST = 0.005, 0.02
"""How far below the rim the middle of a block must lie [m], and how slow it must be [m/s]."""
TIPPED = math.radians(20.0)
"""Tilt at which the bin counts as tipped over."""
HAND_SPEED, BEGIN = 0.27, 0.12
"""At which a hand draws the bin [m/s], and what a change of lanes takes besides [s]; measured."""
FASTEST, LAG = 0.29, 0.08
"""Of a hand that is asked for all it can [m/s], and how much later than that it is everywhere [s]; measured."""
FETCH = 2.4
"""From the start until the bin stands at a lane [s]; measured."""
FALL = 0.16
"""From when its middle is over the lip until a block is in the bin [s]: it tips over first; 0.13 to 0.17 measured."""
SOONER = 0.9
"""Share of the time by the law of sliding that a cube takes to the lip: 0.86 to 0.93 measured. It leans on its lower
edge, and tips before its middle is there."""
UNSURE = 0.10
"""By what share the friction of a block may differ from what is known of it: the jitter of certificates."""
SEEN = 0.002
"""How far a block has moved when it is seen to slide [m]."""
BRISK = Pace(0.30, 0.004)
"""How the bin is drawn."""


@dataclass(frozen=True, kw_only=True)
class Load:
    """A block on the ramp."""

    friction: float = param(0.6, "1", 0.15, ROUGHEST, hidden=True)
    away: float = param(0.04, "m", 0.02, 0.12)
    """Of its middle from the lip."""

    def __post_init__(self) -> None:
        check_bounds(self)

    @property
    def colour(self) -> Rgba:
        """What shows the friction."""
        share = self.friction / ROUGHEST
        r, g, b = (PALE + share * (DARK - PALE)).tolist()
        return r, g, b, 1.0


@dataclass(frozen=True, kw_only=True)
class SlideCatch(Scenario):
    """A ramp that tilts, three blocks on it, and a bin with a handle."""

    HOLD = 0.5
    MOVING = ("block_0", "block_1", "block_2")

    order: int = param(0, "", 0, len(ORDERS) - 1)
    """Which of `ORDERS` they lie in."""
    low: Load = Load(friction=0.277, away=0.022)
    middle: Load = Load(friction=0.53, away=0.032)
    high: Load = Load(friction=0.87, away=0.040)
    edge: float = param(0.026, "m", 0.02, 0.04)
    """Of the blocks."""
    rate: float = param(4.3, "deg/s", 2.0, 12.0)
    """At which the ramp tilts (9.6 s for the mean demonstration: paper, App. B.1)."""
    start: float = param(1.8, "s", 0.3, 6.0)
    """When it begins to."""
    lane: float = param(0.160, "m", 0.08, 0.20)
    """Distance of neighbouring lanes."""
    x: float = param(0.12, "m", 0.0, 0.2)
    """Of the lip."""
    y: float = param(0.0, "m", -0.2, 0.2)
    """Of the middle lane."""
    bin_x: float = param(-0.02, "m", -0.2, 0.1)
    bin_y: float = param(-0.06, "m", -0.3, 0.3)
    incline: Incline = Incline()
    bin: CatchBin = CatchBin()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.loads)

    def _scene(self, loads: Sequence[Load]) -> mujoco.MjSpec:
        """The scene with these loads, by lane: with their friction, in the colours of those that belong there."""
        scene = table()
        place(scene, self.incline, "incline", [self.x, self.y, TABLE_TOP], free=False)
        driven(scene, "incline")
        for lane, (load, shown) in enumerate(zip(loads, self.loads, strict=True)):
            block = Cube(edge=self.edge, mass=MASS, friction=load.friction, rgba=shown.colour)
            place(scene, block, f"block_{lane}", self.spot(lane))
            turn = np.empty(4)
            mujoco.mju_mat2Quat(turn, self.incline.axes().ravel())
            scene.body(f"block_{lane}").quat = turn
        place(scene, self.bin, "bin", [self.bin_x, self.bin_y, TABLE_TOP])
        return scene

    def events(self, world: World) -> None:
        """Tilt the ramp."""
        tilted = math.radians(self.rate) * max(0.0, world.time - self.start)
        world.drive("incline/hinge", min(tilted, self.incline.turns))

    def pending(self, world: World) -> bool:
        """Until the ramp is as steep as it gets, and whatever lies on it has had the time to slide."""
        return world.time < self.start + self.incline.turns / math.radians(self.rate) + 1.0

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return all(self.caught(world, block, SUNK) and still(world, block, REST) for block in self.blocks)

    def failure(self, world: World) -> str | None:
        for block in self.blocks:
            if world.touching(ROBOT, block):
                return "the robot touched a block"
            if world.touching(block, "table"):
                return "a block fell on the table"
            if world.touching("bin", block) and self.on_ramp(world, block):
                return "the bin touched a block on the ramp"
        if world.touching(ROBOT, "incline/slab"):
            return "the robot touched the ramp"
        if world.tilt("bin") > TIPPED:
            return "the bin tipped over"
        return "something fell off the table" if fallen(world, "bin", *self.blocks) else None

    def caught(self, world: World, block: str, sunk: float = 0.0) -> bool:
        """Whether the middle of a block is inside the bin, so far below its rim [m]."""
        x, y, z = np.abs(world.rot("bin").T @ (world.com(block) - world.pos("bin")))
        inner = self.bin
        return bool(x < inner.width / 2 and y < inner.length / 2 and z < self.bin.rim - sunk)

    def on_ramp(self, world: World, block: str) -> bool:
        """Whether the middle of a block is over the ramp."""
        x, _, z = world.com(block) - self.lip
        return bool(x > 0.0 and z > 0.0)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Take the bin, wait with it below the block that slides next, until that is in."""
        yield from self.take(world)
        yield from self.catch_all(world, self.by_friction(world))

    def take(self, world: World) -> Plan:
        """Take hold of the handle, from above."""
        at = world.pos("bin") + world.rot("bin") @ self.bin.handle
        yield from pick(world.arm, at, world.rot("bin")[:, 1], above=0.05, lift=0.0, pace=BRISK)

    def catch_all(self, world: World, blocks: Iterable[str]) -> Plan:
        """Wait for one block after the other, and let go of the bin in the end."""
        for block in blocks:
            yield from self.wait_at(world, world.pos(block)[1], lambda block=block: self.caught(world, block))
        yield from release(world.arm)
        yield from retreat(world.arm, 0.05)

    def wait_at(self, world: World, y: float, until: Condition) -> Plan:
        """Draw the bin to a place at the lip, square to it, and keep it there until something happens."""
        arm, turn = world.arm, about_z(-yaw_of(world.rot("bin")))
        there = self.below(y) + turn @ (arm.hand - world.pos("bin"))
        yield from stay(arm, there, facing_down(), until, BRISK)

    def up(self, world: World, block: str) -> float:
        """How far up the ramp from the lip the middle of a block is [m]."""
        return float((world.rot("incline/slab").T @ (world.com(block) - self.lip))[0])

    def by_friction(self, world: World) -> list[str]:
        """The blocks, the slickest first."""
        model = world.model
        return sorted(self.blocks, key=lambda block: float(model.geom(f"{block}/box").friction[0]))

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        plans = {
            "park_in_the_middle": Shortcut(self._park),
            "the_other_way_round": Shortcut(lambda world: self._in_order(world, self.sequence[::-1])),
            "wait_for_the_slide": Shortcut(self._react),
            "herd_them_together": Shortcut(self._herd),
            "take_them_by_hand": Shortcut(self._by_hand),
        }
        if ORDERS[self.order] != self.sequence:
            plans["the_lowest_first"] = Shortcut(lambda world: self._in_order(world, ORDERS[self.order]))
        return plans

    def _in_order(self, world: World, lanes: Sequence[int]) -> Plan:
        yield from self.take(world)
        yield from self.catch_all(world, [self.blocks[lane] for lane in lanes])

    def _park(self, world: World) -> Plan:
        """Put the bin to the middle lane, and leave it there."""
        yield from self.take(world)
        yield from self.wait_at(world, self.y, lambda: not self.pending(world))

    def _react(self, world: World) -> Plan:
        """Wait midway between the lanes that are left, and go where a block begins to slide."""
        yield from self.take(world)
        starts, left = {block: self.up(world, block) for block in self.blocks}, list(self.blocks)
        while left:
            ends = [world.pos(left[0])[1], world.pos(left[-1])[1]]

            def moving() -> list[str]:
                return [block for block in left if self.up(world, block) < starts[block] - SEEN]

            yield from self.wait_at(world, float(np.mean(ends)), lambda: bool(moving()))
            block = moving()[0]
            y = world.pos(block)[1]
            yield from self.wait_at(world, y, lambda block=block: world.com(block)[2] < self.rim)
            left.remove(block)
        yield from release(world.arm)

    def _herd(self, world: World) -> Plan:
        """Lift the bin onto the ramp, and push the outer blocks beside the middle one with its wall."""
        yield from self.take(world)
        over = world.arm.hand - world.pos("bin") + (self.incline.lip + 0.03) * UP
        for side in (1, -1):
            beside = self.lip + np.array([0.0, side * (self.lane + self.bin.outer[1]), 0.0])
            beside[2] = TABLE_TOP
            yield from go_to(world.arm, beside + over + 0.05 * UP, facing_down(), BRISK)
            yield from go_to(world.arm, beside + over, facing_down(), BRISK)
            yield from go_to(world.arm, beside + over - side * self.lane * np.array([0, 1, 0]), facing_down(), BRISK)
        yield from self.wait_at(world, self.y, lambda: not self.pending(world))

    def _by_hand(self, world: World) -> Plan:
        """Pick a block off the ramp and let it go over the bin."""
        block = self.blocks[self.sequence[0]]
        yield from pick(world.arm, world.com(block), [0.0, 1.0, 0.0])
        yield from go_to(world.arm, world.pos("bin") + 0.15 * UP, pace=BRISK)
        yield from hold(world.arm, 0.3, -1.0)

    def answer(self) -> Answer:
        """The sequence of the lanes. One try: what is not caught is lost."""
        numbers = tuple(float(k) for k in range(len(ORDERS)))

        def act(world: World, number: float) -> Plan:
            return self._in_order(world, ORDERS[round(number)])

        return Answer(numbers, act, lambda number: ORDERS[round(number)] == self.sequence, tries=1)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """The same scene to the eye, with the frictions of the lowest and the highest block exchanged."""
        lowest, _, highest = ORDERS[self.order]
        exchanged = list(self.loads)
        exchanged[lowest], exchanged[highest] = exchanged[highest], exchanged[lowest]
        return {"frictions_exchanged": self._scene(exchanged)}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        slick, rough = self.slips(self.first, -UNSURE), self.slips(self.last, UNSURE)
        least, most = (math.radians(angle) for angle in (self.incline.least, self.incline.most))
        yield require(slick > least + 0.02, "a block slides before the ramp moves", slips=slick, least=least)
        yield require(rough < most - 0.02, "a block never slides", slips=rough, most=most)
        topples = math.radians(45.0)
        yield require(rough < topples, "a block topples before it slides", slips=rough, topples=topples)
        apart, width = self.lane, self.bin.length + self.edge
        yield require(apart > width, "one place of the bin serves two lanes", apart=apart, width=width)
        room, needs = self.bin.length - self.edge, 0.02
        yield require(room >= needs, "the bin is too narrow", room=room, needs=needs)
        fetched = self.over_lip(self.first, -UNSURE)
        yield require(fetched > FETCH, "the first block comes before the bin", comes=fetched, fetched=FETCH)
        spare = min(self.spare(one, other) for one, other in pairwise(self.sequence))
        yield require(spare > 0.0, "two blocks come so soon after each other that the bin serves one", spare=spare)
        outside = max(load.away for load in self.loads) + self.edge / 2
        yield require(outside < self.incline.length, "a block stands out over the ramp", out=outside)
        wide = COUNT * self.lane - self.lane + self.edge
        yield require(wide < self.incline.width, "a lane is beside the ramp", wide=wide, ramp=self.incline.width)
        beyond = self.bin_x + self.bin.outer[0] / 2
        yield require(beyond < self.x - 0.01, "the bin stands under the ramp", reaches=beyond, lip=self.x)
        yield on_table(
            "the ramp", self.lip + np.array([[self.incline.length, side * self.half, 0] for side in (-1, 1)])
        )
        hands = [self.below(self.spot(lane)[1]) + self.bin.handle for lane in range(COUNT)]
        yield within_reach("the bin", *hands, np.array([self.bin_x, self.bin_y, TABLE_TOP]) + self.bin.handle)
        late = max(self.reached(lane) for lane in range(COUNT))
        missed = self.lane - room / 2
        yield require(late < missed, "who waits for the slide comes in time", comes=late, needs=missed)

    def features(self) -> Mapping[str, float]:
        """How much time is left between two slides [s], the slope at which the first block goes [rad], by how much the
        slope grows until the last one goes [rad], and how many pairs do not go in the order in which they lie."""
        places = ORDERS[self.order]
        ranks = [self.sequence.index(lane) for lane in places]
        return {
            "spare_time": min(self.spare(one, other) for one, other in pairwise(self.sequence)),
            "first_slope": self.slips(self.first),
            "slopes": self.slips(self.last) - self.slips(self.first),
            "last_slide": self.over_lip(self.last),
            "inversions": sum(a > b for a, b in combinations(ranks, 2)),
        }

    # --- mechanics ------------------------------------------------------------------------

    def slips(self, lane: int, unsure: float = 0.0) -> float:
        """The slope at which the block of a lane begins to slide [rad], if it is by that share rougher than known."""
        return slip_angle(self.loads[lane].friction * (1.0 + unsure))

    def lets_go(self, lane: int, unsure: float = 0.0) -> float:
        """When it does [s]."""
        turned = self.slips(lane, unsure) - math.radians(self.incline.least)
        return self.start + turned / math.radians(self.rate)

    def slides_for(self, lane: int, way: float) -> float:
        """How long it takes to slide so far [s]."""
        load, rate = self.loads[lane], math.radians(self.rate)
        return SOONER * (way / slid(load.friction, rate, 1.0)[0]) ** (1 / 3)

    def over_lip(self, lane: int, unsure: float = 0.0) -> float:
        """When its middle is over the lip [s]."""
        return self.lets_go(lane, unsure) + self.slides_for(lane, self.loads[lane].away)

    def spare(self, one: int, other: int) -> float:
        """Time that is left between two slides besides that which the bin takes from lane to lane [s], at worst."""
        between = self.over_lip(other, -UNSURE) - self.over_lip(one, UNSURE) - FALL
        return between - abs(one - other) * self.lane / HAND_SPEED - BEGIN

    def reached(self, lane: int) -> float:
        """How far the bin comes from when a block is seen to slide until it is below the rim [m]."""
        seconds = self.slides_for(lane, self.loads[lane].away) - self.slides_for(lane, SEEN) + FALL
        return FASTEST * (seconds - LAG)

    # --- geometry -------------------------------------------------------------------------

    @property
    def loads(self) -> tuple[Load, ...]:
        """By lane, from the left."""
        by_place = dict(zip(ORDERS[self.order], (self.low, self.middle, self.high), strict=True))
        return tuple(by_place[lane] for lane in range(COUNT))

    @property
    def blocks(self) -> tuple[str, ...]:
        """Names, by lane: they say nothing about frictions."""
        return tuple(f"block_{lane}" for lane in range(COUNT))

    @property
    def sequence(self) -> tuple[int, ...]:
        """The lanes in the order in which their blocks slide."""
        return tuple(sorted(range(COUNT), key=lambda lane: self.loads[lane].friction))

    @property
    def first(self) -> int:
        """The lane whose block slides first."""
        return self.sequence[0]

    @property
    def last(self) -> int:
        """The lane whose block slides last."""
        return self.sequence[-1]

    @property
    def lip(self) -> Vec3:
        """The middle of the lip [m]."""
        return np.array([self.x, self.y, TABLE_TOP + self.incline.lip])

    @property
    def half(self) -> float:
        """Half the width of the ramp [m]."""
        return self.incline.width / 2

    @property
    def rim(self) -> float:
        """Height of the bin's rim [m]."""
        return TABLE_TOP + self.bin.rim

    def spot(self, lane: int) -> Vec3:
        """Where the block of a lane stands [m]."""
        along = (COUNT // 2 - lane) * self.lane
        return np.array([self.x, self.y, TABLE_TOP]) + self.incline.on_slab(self.loads[lane].away, along)

    def below(self, y: float) -> Vec3:
        """Where the bin stands at the lip, ready for what comes down at `y` [m]."""
        return np.array([self.x + UNDER - self.bin.width / 2, y, TABLE_TOP])
