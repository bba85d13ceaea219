"""T15 slide-catch: move a bin from lane to lane, so that it is in place when the next block slides off a tilting ramp.

        |  []          ramp, tilting up        seen from above; the robot is below
        |        []
        |  .     .  [] |
     lip ----+-----+-----+----
                 _____
                |_bin_|
                   |  handle

Bottleneck: a block starts to slide when the tangent of the slope reaches its friction, and is over the lip half a
second later. In that time the bin moves no farther than half a lane. It must be in place before, wait, and then move to
the lane of the block that slides next. The angle gives all timing: an agent that observes the ramp needs no clock.

Decisions where the paper (App. B, T15) is silent:

* The paper says both that friction decides when a block slides and that the lower ones slide first. In training both
  hold, as the lower blocks have less friction. Friction is visible: the darker a block, the rougher.
* No place of the bin serves two lanes. If the bin leaves only when a block in the next lane is seen to slide, it misses
  by 26 mm in training. A bin that waits midway between two neighbouring lanes, and goes to the block that slides,
  catches all in 25 of 48 without a look at friction. That is labelled: the bin stands in the lane of each block before
  it slides.
* Once the ramp tilts, the bin stays square to the lip within 5 deg. It is 85 mm before the hand: a wrist that turned by
  25 deg swung it by 45 mm in 0.2 s, from midway to every block that started to slide.
* The start of the tilt varies by more than the bin's time margin: a policy that moves at fixed times misses blocks.
* Chance: training has all six sequences; one fixed answer is right in a sixth of it.
* The bin only catches. Each block slides by itself, untouched by robot and bin: the hand could pick blocks off, and the
  bin could push them into one lane. The robot does not touch the ramp. A block on the table is a failure.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, pairwise, permutations

import mujoco
import numpy as np

from ..assets.box import Cube
from ..assets.catch_bin import CatchBin
from ..assets.incline import Incline, Load, LoadedIncline, driven
from ..assets.prop import TABLE_TOP, place, table
from ..decisions import Decision, around, choice, near
from ..geometry import UP, Vec3, about_z, yaw_of
from ..means import Mean, throughout
from ..params import param
from ..predicates import fallen, still
from ..scenario import Answer, Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT
from ..sim.world import World
from ..skills.jaw import let_go, pick, release
from ..skills.motion import Condition, Pace, facing_down, go_to, stay

BLOCK_COUNT = 3  # blocks on the ramp, and lanes
ORDERS = tuple(permutations(range(BLOCK_COUNT)))
"""Lanes, counted from the left, of the lowest, the middle and the highest block."""
LANE_NAMES = ("in the left lane", "in the middle lane", "in the right lane")
"""Lanes as text, counted from the left."""
FRICTION_TOLERANCE = 0.10  # share by which a block's friction may differ from its known value: jitter of certificates
FALL_TIME = 0.16  # time from a block's middle over the lip to in the bin [s]; it tips first. Measured: 0.13 to 0.17
SLIDE_SPEED = 0.04
"""Speed down the ramp at which a block slides [m/s]: blocks in jittered runs settle with 0.014 before."""
VISIBLE_SLIDE = 0.002  # distance after which a block is seen to slide [m]
MAX_BIN_TURN = math.radians(5.0)  # angle of the bin to the lip; the oracle, jittered too, turns it by 2.3 deg at most
MAX_BIN_TILT = math.radians(20.0)  # tilt from which the bin has tipped over [rad]
SLAB = "incline/slab"
DRAW_PACE = Pace(0.30, 0.004)  # pace of the bin


@dataclass(frozen=True, kw_only=True)
class SlideCatch(Scenario):
    """A ramp that tilts, three blocks on it, and a bin with a handle."""

    VERSION = 2
    HOLD = 0.5
    MOVING = ("block_0", "block_1", "block_2")

    order: int = param(0, "", 0, len(ORDERS) - 1, answer=True)  # index in `ORDERS` of the lanes in which the blocks lie
    low: Load = Load(friction=0.277, away=0.022)
    middle: Load = Load(friction=0.53, away=0.032)
    high: Load = Load(friction=0.87, away=0.040)
    edge: float = param(0.026, "m", 0.02, 0.04)  # edge of the blocks
    rate: float = param(4.3, "deg/s", 2.0, 12.0)
    """Rate at which the ramp tilts (9.6 s for the mean demonstration: paper, App. B.1)."""
    start: float = param(1.8, "s", 0.3, 6.0)  # time at which the ramp starts to tilt
    lane: float = param(0.160, "m", 0.08, 0.20)  # distance between neighbouring lanes
    x: float = param(0.12, "m", 0.0, 0.2)  # place of the lip
    y: float = param(0.0, "m", -0.2, 0.2)  # place of the middle lane
    bin_x: float = param(-0.02, "m", -0.2, 0.1)
    bin_y: float = param(-0.06, "m", -0.3, 0.3)
    incline: Incline = Incline()
    bin: CatchBin = CatchBin()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.loads)

    def _scene(self, loads: Sequence[Load]) -> mujoco.MjSpec:
        """The scene with other blocks in the lanes, which have the colours of the right ones."""
        scene = table()
        place(scene, self.incline, "incline", self.ramp.foot, free=False)
        driven(scene, "incline")
        for lane, (load, shown) in enumerate(zip(loads, self.loads, strict=True)):
            block = Cube(edge=self.edge, mass=0.02, friction=load.friction, rgba=shown.colour)
            place(scene, block, f"block_{lane}", self.ramp.spot(lane), turn=self.incline.resting)
        place(scene, self.bin, "bin", [self.bin_x, self.bin_y, TABLE_TOP])
        return scene

    def events(self, world: World) -> None:
        """Tilt the ramp."""
        world.drive("incline/hinge", self.ramp.turned(world.time))

    def pending(self, world: World) -> bool:
        """Whether the ramp still tilts, or stopped less than a second ago, so that blocks may still slide."""
        return world.time < self.ramp.end + 1.0

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return all(self.caught(world, block, 0.005) and still(world, block, 0.02) for block in self.blocks)

    def failure(self, world: World) -> str | None:
        if any(world.touching(block, "table") for block in self.blocks):
            return "a block fell on the table"
        return "something fell off the table" if fallen(world, "bin", *self.blocks) else None

    def means(self) -> Mapping[str, Mean]:
        def on_ramp(world: World, block: str) -> bool:
            return self.ramp.under(world.com(block)) and not self.caught(world, block)

        def awaited(world: World, block: str) -> bool:
            aside = abs(float(world.pos("bin")[1] - world.com(block)[1])) < (self.bin.length - self.edge) / 2
            slides = -float(world.velocity(block)[3:] @ world.rot(SLAB)[:, 0]) > SLIDE_SPEED
            return aside or not slides or not on_ramp(world, block)

        def meddles(world: World, block: str) -> bool:
            return world.touching(ROBOT, block) or (world.touching("bin", block) and self.ramp.under(world.com(block)))

        return {
            "the bin stood in the lane of each block before it slid": throughout(
                lambda world: all(awaited(world, block) for block in self.blocks)
            ),
            "each block slid by itself": throughout(
                lambda world: not any(meddles(world, b) for b in self.blocks) and not world.touching(ROBOT, SLAB)
            ),
            "the bin stood upright and square to the lip": throughout(
                lambda world: not self.turned(world) and world.tilt("bin") <= MAX_BIN_TILT
            ),
        }

    def turned(self, world: World) -> bool:
        """Whether the ramp has started to tilt, and the bin is not square to the lip."""
        return world.time > self.start and abs(yaw_of(world.rot("bin"))) > MAX_BIN_TURN

    def caught(self, world: World, block: str, depth: float = 0.0) -> bool:
        """Whether the middle of a block is inside the bin, at least `depth` below its rim [m]."""
        return self.bin.holds(world.rot("bin").T @ (world.com(block) - world.pos("bin")), depth)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Take the bin, and wait with it below the block that slides next, until that block is in."""
        friction = {block: float(world.model.geom(f"{block}/box").friction[0]) for block in self.blocks}
        yield from self.take(world)
        yield from self.catch_all(world, sorted(self.blocks, key=friction.__getitem__))

    def take(self, world: World) -> Plan:
        """Grasp the handle from above."""
        at = world.pos("bin") + world.rot("bin") @ self.bin.handle
        yield from pick(world.arm, at, world.rot("bin")[:, 1], above=0.05, lift=0.0, pace=DRAW_PACE)

    def catch_all(self, world: World, blocks: Iterable[str]) -> Plan:
        """Wait for one block after the other, then let go of the bin."""
        for block in blocks:
            yield from self.wait_at(world, world.pos(block)[1], lambda block=block: self.caught(world, block))
        yield from let_go(world.arm, 0.05)

    def wait_at(self, world: World, y: float, until: Condition) -> Plan:
        """Draw the bin to a place at the lip, square to it, and keep it there until a condition holds."""
        arm, turn = world.arm, about_z(-yaw_of(world.rot("bin")))
        there = self.bin_at(y) + turn @ (arm.hand - world.pos("bin"))
        yield from stay(arm, there, facing_down(), until, DRAW_PACE)

    def distance_up(self, world: World, block: str) -> float:
        """Distance of a block's middle from the lip, up the ramp [m]."""
        return float((world.rot("incline/slab").T @ (world.com(block) - self.ramp.lip))[0])

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        plans = {
            "park_in_the_middle": Shortcut(self._park),
            "the_other_way_round": Shortcut(lambda world: self._in_order(world, self.ramp.sequence[::-1])),
            "wait_for_the_slide": Shortcut(self._react),
            "herd_them_together": Shortcut(self._herd),
            "take_them_by_hand": Shortcut(self._by_hand),
        }
        if ORDERS[self.order] != self.ramp.sequence:
            plans["the_lowest_first"] = Shortcut(lambda world: self._in_order(world, ORDERS[self.order]))
        return plans

    def _in_order(self, world: World, lanes: Sequence[int]) -> Plan:
        """Catch the blocks in a given order of the lanes."""
        yield from self.take(world)
        yield from self.catch_all(world, [self.blocks[lane] for lane in lanes])

    def _park(self, world: World) -> Plan:
        """Draw the bin to the middle lane, and leave it there."""
        yield from self.take(world)
        yield from self.wait_at(world, self.y, lambda: not self.pending(world))

    def _react(self, world: World) -> Plan:
        """Wait midway between the remaining lanes, and go to the block that starts to slide."""
        yield from self.take(world)
        starts, remaining = {block: self.distance_up(world, block) for block in self.blocks}, list(self.blocks)
        while remaining:
            ends = [world.pos(remaining[0])[1], world.pos(remaining[-1])[1]]

            def moving() -> list[str]:
                return [block for block in remaining if self.distance_up(world, block) < starts[block] - VISIBLE_SLIDE]

            yield from self.wait_at(world, float(np.mean(ends)), lambda: bool(moving()))
            block = moving()[0]
            y = world.pos(block)[1]
            yield from self.wait_at(world, y, lambda block=block: world.com(block)[2] < TABLE_TOP + self.bin.rim)
            remaining.remove(block)
        yield from release(world.arm)

    def _herd(self, world: World) -> Plan:
        """Lift the bin onto the ramp, and push the outer blocks to the middle one with its wall."""
        yield from self.take(world)
        above = world.arm.hand - world.pos("bin") + (self.incline.lip + 0.03) * UP
        for side in (1, -1):
            beside = np.array([self.x, self.y + side * (self.lane + self.bin.outer[1]), TABLE_TOP])
            pushed = beside + above - side * self.lane * np.array([0, 1, 0])
            for hand in (beside + above + 0.05 * UP, beside + above, pushed):
                yield from go_to(world.arm, hand, facing_down(), DRAW_PACE)
        yield from self.wait_at(world, self.y, lambda: not self.pending(world))

    def _by_hand(self, world: World) -> Plan:
        """Pick a block off the ramp and release it over the bin."""
        block = self.blocks[self.ramp.sequence[0]]
        yield from pick(world.arm, world.com(block), [0.0, 1.0, 0.0])
        yield from go_to(world.arm, world.pos("bin") + 0.15 * UP, pace=DRAW_PACE)
        yield from release(world.arm, 0.3)

    def answer(self) -> Answer:
        """The sequence of the lanes. One try: a block that is not caught falls on the table, a failure."""
        numbers, right = tuple(float(k) for k in range(len(ORDERS))), ORDERS.index(self.ramp.sequence)
        return Answer(numbers, lambda w, k: self._in_order(w, ORDERS[round(k)]), lambda k: k == right, tries=1)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Exchange the frictions of the lowest and the highest block; the scene looks the same."""
        lowest, _, highest = ORDERS[self.order]
        exchanged = list(self.loads)
        exchanged[lowest], exchanged[highest] = exchanged[highest], exchanged[lowest]
        return {"frictions_exchanged": self._scene(exchanged)}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        first, loads = self.ramp.sequence[0], ("block_*.redness", "block_*.lightness", "*ness of block")
        return {
            "first_lane": choice(first, *loads),
            "last_lane": choice(self.ramp.sequence[-1], *loads),
            "sequence": choice(tuple(self.ramp.sequence), *loads),
            "time_of_the_first": around(self.ramp.slide_start(first), 0.3, "start", "rate"),
            "bin_below_the_first": near(self.bin_at(self.ramp.spot(first)[1]), 0.020, "y", "lane"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        ramp, (first, *_, last) = self.ramp, self.ramp.sequence
        slick, rough = ramp.slips(first, -FRICTION_TOLERANCE), ramp.slips(last, FRICTION_TOLERANCE)
        least, most = (math.radians(angle) for angle in (self.incline.least, self.incline.most))
        yield require(slick > least + 0.02, "a block slides before the ramp moves", slips=slick, least=least)
        yield require(rough < most - 0.02, "a block never slides", slips=rough, most=most)
        topples = math.radians(45.0)
        yield require(rough < topples, "a block topples before it slides", slips=rough, topples=topples)
        apart, width = self.lane, self.bin.length + self.edge
        yield require(apart > width, "one place of the bin serves two lanes", apart=apart, width=width)
        room, needs = self.bin.length - self.edge, 0.02
        yield require(room >= needs, "the bin is too narrow", room=room, needs=needs)
        comes, fetched = ramp.lip_time(first, -FRICTION_TOLERANCE), 2.4  # [s]; measured until the bin is at a lane
        yield require(comes > fetched, "the first block comes before the bin", comes=comes, fetched=fetched)
        margin = min(self.time_margin(one, other) for one, other in pairwise(ramp.sequence))
        yield require(margin > 0.0, "two blocks come so soon after each other that the bin serves one", spare=margin)
        out = max(load.away for load in self.loads) + self.edge / 2
        yield require(out < self.incline.length, "a block stands out over the ramp", out=out)
        wide, across = BLOCK_COUNT * self.lane - self.lane + self.edge, self.incline.width
        yield require(wide < across, "a lane is beside the ramp", wide=wide, ramp=across)
        end = self.bin_x + self.bin.outer[0] / 2
        yield require(end < self.x - 0.01, "the bin stands under the ramp", reaches=end, lip=self.x)
        half = self.incline.width / 2
        yield on_table("the ramp", ramp.lip + np.array([[self.incline.length, side * half, 0] for side in (-1, 1)]))
        hands = [self.bin_at(ramp.spot(lane)[1]) + self.bin.handle for lane in range(BLOCK_COUNT)]
        yield within_reach("the bin", *hands, np.array([self.bin_x, self.bin_y, TABLE_TOP]) + self.bin.handle)
        comes = max(self.reach_after_slide(lane) for lane in range(BLOCK_COUNT))
        needs = self.lane - room / 2
        yield require(comes < needs, "who waits for the slide comes in time", comes=comes, needs=needs)

    def features(self) -> Mapping[str, float]:
        """Time margin between two slides [s], slope at which the first block slides [rad], increase of the slope until
        the last one slides [rad], and number of pairs that do not slide in the order in which they lie."""
        first, *_, last = self.ramp.sequence
        ranks = [self.ramp.sequence.index(lane) for lane in ORDERS[self.order]]
        return {
            "spare_time": min(self.time_margin(one, other) for one, other in pairwise(self.ramp.sequence)),
            "first_slope": self.ramp.slips(first),
            "slopes": self.ramp.slips(last) - self.ramp.slips(first),
            "last_slide": self.ramp.lip_time(last),
            "inversions": sum(a > b for a, b in combinations(ranks, 2)),
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "lowest": LANE_NAMES[ORDERS[self.order][0]],
            "first": LANE_NAMES[self.ramp.sequence[0]],
            "last": LANE_NAMES[self.ramp.sequence[-1]],
            "lane": self.lane,
            "bin": abs(self.bin_y - self.y),
        }

    # --- mechanics ------------------------------------------------------------------------

    @cached_property
    def ramp(self) -> LoadedIncline:
        """The ramp in its place, the blocks in its lanes, and its tilt."""
        foot, rate = np.array([self.x, self.y, TABLE_TOP]), math.radians(self.rate)
        return LoadedIncline(self.incline, foot, self.lane, self.loads, self.start, rate)

    def time_margin(self, one: int, other: int) -> float:
        """Least time margin between two slides besides the time that the bin takes from lane to lane [s]."""
        between = self.ramp.time_between(one, other, FRICTION_TOLERANCE) - FALL_TIME
        return between - abs(one - other) * self.lane / 0.27 - 0.12  # measured: speed [m/s] of a drawn bin, delay [s]

    def reach_after_slide(self, lane: int) -> float:
        """Distance that the bin moves from when a block is seen to slide until the block is below the rim [m]."""
        seconds = self.ramp.time_left(lane, VISIBLE_SLIDE) + FALL_TIME
        return 0.29 * (seconds - 0.08)  # measured: peak hand speed [m/s], and the tracking lag at that speed [s]

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def loads(self) -> tuple[Load, ...]:
        """Blocks by lane, from the left."""
        by_place = dict(zip(ORDERS[self.order], (self.low, self.middle, self.high), strict=True))
        return tuple(by_place[lane] for lane in range(BLOCK_COUNT))

    @cached_property
    def blocks(self) -> tuple[str, ...]:
        """Names of the blocks by lane; they reveal no friction."""
        return tuple(f"block_{lane}" for lane in range(BLOCK_COUNT))

    def bin_at(self, y: float) -> Vec3:
        """Place of a bin that catches blocks at `y` [m]; the lip covers 14 mm of it, so that none falls behind."""
        return np.array([self.x + 0.014 - self.bin.width / 2, y, TABLE_TOP])
