"""T16 ramp-sort: release every ball on the side of a ridge from which it rolls into the bin of its colour.

      [ o o o o ]   ___________ . . . . . . .         seen from above; where the dots are a barrier stands, which
        box        |  left     :     [ bin ]          stops the arm and lets the balls pass
                   |- -ridge- -:= = =
                   |  right    :     [ bin ]
                    ----------- . . . . . . .

Bottleneck: a ball's way is decided at its release, near the ridge by a few millimetres. Past the barrier nothing can be
corrected, and a ball in the wrong bin ends the episode.

Decisions, where the paper (App. B, T16) is silent:

* "Color-dependent rolling trajectories separate red balls from blue balls": all balls roll alike, and the colour
  decides which side to choose. Balls that roll differently by colour would need masses or frictions that cannot be
  seen.
* A crown separates the sides: two planes that lean away from a ridge. The ridge is visible, and is not always in the
  middle of the ramp. It needs no look: a hand that always releases 8 cm from the middle, beside the rail, is fair and
  solves 12 of 12, on `shifted_ridge` and `flat_crown` too.
* The barrier keeps the hand from the bins and from the lower half of the ramp. A ball that is released above it falls
  through, so a ball must touch the ramp before its bin counts. A ball on the table or on the floor is a failure.
* A ball comes over the lower half of the ramp by itself, less than 46 mm above its way. Otherwise a ball that has
  touched the ramp once is carried over the barrier and dropped into its bin, on no side of the ridge.
"""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import mujoco
import numpy as np

from ..assets.ball import Ball
from ..assets.barrier import Barrier, let_pass
from ..assets.bin import Bin
from ..assets.crowned_ramp import CrownedRamp
from ..assets.prop import TABLE_TOP, place, remove, table
from ..decisions import Decision, choice, near, side_of, span
from ..errors import GaveUp
from ..geometry import UP, Mat3, Outline, Vec3, about_z, corners, gap, way_to
from ..means import Mean, throughout
from ..params import param
from ..physics import GRAVITY
from ..predicates import still
from ..robots.jaw import FINGER_ACROSS, PALM_ACROSS, PALM_ALONG, TIP_BELOW
from ..scenario import Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT
from ..sim.world import World
from ..skills.jaw import pick, release
from ..skills.motion import COARSE, Pace, closing_along, go_to, push, wait

MAX_BALLS = 6  # largest number of balls
RED = (0.82, 0.20, 0.15, 1.0)
BLUE = (0.15, 0.30, 0.80, 1.0)
BOX_FLOOR = 0.004  # thickness of the box's floor [m]
BOX_DEPTH = 0.006  # height of the box's walls over its floor [m]: lower than the finger tips
ROW_PITCH = 0.042
"""Distance of neighbours in the row [m]: beside a ball of 18 mm radius, a finger has 13 mm to the next ball."""
BIN_LENGTH = 0.11  # length of the bins along the ramp, inside [m]
BIN_FLOOR = 0.004  # thickness of the bins' floor [m]
BIN_WALL = 0.006  # thickness of the bins' walls [m]
BIN_DEPTH = 0.040  # depth of the bins [m]
BIN_RIM = BIN_DEPTH + BIN_FLOOR  # height of the bins' rim over the table [m]
BIN_GAP = 0.014  # gap between the low end of the ramp and the inside of the bins [m]
BARRIER_START = 0.04  # distance from the middle of the ramp to the start of the barrier [m]: the palm stays before it
TOP_DISTANCE = 0.028  # distance from the high end of the ramp at which balls are released [m]
CARRY_HEIGHT = 0.19  # height over the table at which balls are carried [m]
RELEASE_HEIGHT = 0.012  # height over the ramp from which balls are lowered [m]
MAX_FLIGHT_SPEED = 0.3
"""Largest speed of a ball that has been let go above the ramp [m/s]: as of a fall from 5 mm."""
LOWER_PACE = Pace(0.25, 0.004)  # pace down to a ball or to the ramp


@dataclass(frozen=True, kw_only=True)
class RampSort(Scenario):
    """Balls of two colours in a box, a crowned ramp, and a bin for either colour behind a barrier."""

    VERSION = 2
    HOLD = 0.5

    reds: int = param(2, "balls", 1, 3)
    blues: int = param(2, "balls", 1, 3)
    arrangement: int = param(0, "index", 0, math.comb(MAX_BALLS, MAX_BALLS // 2) - 1, answer=True)
    """Index, among all choices of places in the row, of the choice for the red balls."""
    red_side: int = param(-1, "1 left, -1 right", -1, 1)  # side of the ridge on which the red bin is; 0 is refuted
    x: float = param(0.02, "m", -0.3, 0.3)
    y: float = param(0.02, "m", -0.3, 0.3)
    ramp_yaw: float = param(0.0, "deg", -60.0, 60.0)  # direction of the ramp; at 0 balls roll to the robot's left
    box_x: float = param(0.02, "m", -0.3, 0.3)
    box_y: float = param(-0.285, "m", -0.35, 0.35)
    ramp: CrownedRamp = CrownedRamp()
    ball: Ball = Ball(radius=0.018, density=1000.0, friction=0.6, rolling=0.01)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.red_side)

    def _scene(self, red_side: int) -> mujoco.MjSpec:
        """The scene with the red bin on a given side."""
        scene, yaw = table(), self._yaw
        place(scene, self.ramp, "ramp", self.middle, yaw, free=False)
        for name, side, colour in (("red_bin", red_side, RED), ("blue_bin", -red_side, BLUE)):
            shape, at = self.bin(side)
            place(scene, replace(shape, rgba=colour), name, at, yaw, free=False)
        place(scene, self.barrier, "barrier", self.at(BARRIER_START + self.barrier.length / 2, 0.0), yaw, free=False)
        place(scene, self.box, "box", [self.box_x, self.box_y, TABLE_TOP], free=False)
        for i, red in enumerate(self.colours):
            place(scene, replace(self.ball, rgba=RED if red else BLUE), f"ball_{i}", self.start(i))
            let_pass(scene.body(f"ball_{i}"))
        return scene

    @cached_property
    def barrier(self) -> Barrier:
        """A barrier from the upper half of the ramp to the far ends of the bins, lower than the hand after a reset."""
        end = self.ramp.length / 2 + BIN_GAP + BIN_LENGTH + BIN_WALL
        return Barrier(length=end - BARRIER_START, width=2 * self._half_width, height=0.18)

    @cached_property
    def box(self) -> Bin:
        """Low walls around a row of balls."""
        length = (self.reds + self.blues - 1) * ROW_PITCH + 2 * self.ball.radius + 0.02
        return Bin(width=length, length=0.06, depth=BOX_DEPTH, wall=0.006, floor=BOX_FLOOR)

    def bin(self, side: int) -> tuple[Bin, Vec3]:
        """The bin at the foot of one slab, from the ridge to beyond the rail, and its place [m]."""
        rim = side * self._half_width
        shape = Bin(
            width=BIN_LENGTH,
            length=abs(rim - self.ramp.ridge) - 2 * BIN_WALL,
            depth=BIN_DEPTH,
            floor=BIN_FLOOR,
            wall=BIN_WALL,
        )
        return shape, self.at(self._bins_along, (rim + self.ramp.ridge) / 2)

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        red_side = self._red_side(world)
        sides = (red_side if red else -red_side for red in self.colours)
        return all(self.arrived(world, i) == side for i, side in enumerate(sides))

    def failure(self, world: World) -> str | None:
        red_side = self._red_side(world)
        for i, red in enumerate(self.colours):
            ball = f"ball_{i}"
            if self.arrived(world, i) == (-red_side if red else red_side):
                return "a ball is in the bin of the other colour"
            if world.touched(ball, "table") or world.com(ball)[2] < TABLE_TOP:
                return "a ball is on the table or on the floor"
        return None

    def means(self) -> Mapping[str, Mean]:
        def each(holds: Callable[[World, int, float, float], bool]) -> Mean:
            def hold(world: World) -> bool:
                return all(holds(world, i, *self.place_of(world, i)[:2]) for i in range(len(self.colours)))

            return throughout(hold)

        def own_side(world: World, i: int, along: float, across: float) -> bool:
            if "ramp" not in world.touching_bodies(f"ball_{i}"):
                return True
            side = self._red_side(world) if self.colours[i] else -self._red_side(world)
            return side * (across - self.ramp.ridge) > 0.0

        def laid(world: World, i: int, along: float, across: float) -> bool:
            over = abs(along) < self.ramp.length / 2 and abs(across) < self._half_width
            flies = over and not world.touching(ROBOT, f"ball_{i}") and not world.touched(f"ball_{i}", "ramp")
            return not flies or still(world, f"ball_{i}", MAX_FLIGHT_SPEED)

        def rolls(world: World, i: int, along: float, across: float) -> bool:
            past = along > BARRIER_START and abs(across) < self._half_width + self.ball.radius
            carried = past and (world.touching(ROBOT, f"ball_{i}") or self.high_over_ramp(world, i))
            return not carried and (not self.arrived(world, i) or world.touched(f"ball_{i}", "ramp"))

        return {
            "each ball touched the ramp on the side of its colour alone": each(own_side),
            "no ball was thrown or dropped onto the ramp": each(laid),
            "each ball came over the lower half of the ramp by itself": each(rolls),
        }

    def place_of(self, world: World, i: int) -> tuple[float, float, float]:
        """Place of a ball from `middle`: along the ramp, across it, and upwards [m]."""
        along, across, height = ((world.com(f"ball_{i}") - self.middle) @ self.axes).tolist()
        return along, across, height

    def arrived(self, world: World, i: int) -> int:
        """Side of the bin that a ball is in; 0 while it is in none."""
        along, across, height = self.place_of(world, i)
        if height > BIN_RIM or abs(along - self._bins_along) > BIN_LENGTH / 2 or abs(across) > self._half_width:
            return 0
        return 1 if across > self.ramp.ridge else -1

    def high_over_ramp(self, world: World, i: int) -> bool:
        """Whether a ball is past the start of the barrier, and its centre 2 r + 1 cm or more above the ramp there."""
        along, across, height = self.place_of(world, i)
        if along < BARRIER_START or abs(across) > self._half_width + self.ball.radius:
            return False
        rim = self.ramp.width / 2
        top = self.ramp.surface(min(along, self.ramp.length / 2), min(rim, max(-rim, across)))[2]
        return bool(height > top + 2 * self.ball.radius + 0.01)

    def _red_side(self, world: World) -> int:
        """Side on which the red bin stands in the world, which an ablation may have exchanged."""
        return 1 if (world.pos("red_bin") - self.middle) @ self.axes[:, 1] > self.ramp.ridge else -1

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Red balls first: take one, release it on its side of the ridge, fetch the next while it rolls."""
        sides = [self.red_side if red else -self.red_side for red in self.colours]
        yield from self.sort(world, sides, sorted(range(len(sides)), key=lambda i: not self.colours[i]))

    def sort(self, world: World, sides: Sequence[int], order: Iterable[int]) -> Plan:
        """Release balls one after the other, each on a given side, and wait for the last one."""
        for i in order:
            yield from self.take(world, i)
            yield from self.release_at(world, i, self.release_spot(sides[i]))
        yield from wait(world.arm, lambda: self.success(world), give_up=3.0)

    def take(self, world: World, i: int) -> Plan:
        """Take a ball from the box, the fingers on both sides of the row, and lift it to the carrying height."""
        ball = world.com(f"ball_{i}")
        lift = TABLE_TOP + CARRY_HEIGHT - ball[2]
        yield from pick(world.arm, ball, [0.0, 1.0, 0.0], above=0.12, lift=lift, pace=LOWER_PACE)

    def release_at(self, world: World, i: int, spot: Vec3) -> Plan:
        """Lower a held ball on the ramp and release it, the fingers before and behind it: they push it to no side."""
        arm, rot = world.arm, closing_along(world.arm, self.axes[:, 0])
        yield from go_to(arm, [spot[0], spot[1], TABLE_TOP + CARRY_HEIGHT], rot, COARSE)
        yield from go_to(arm, spot + RELEASE_HEIGHT * UP, rot, LOWER_PACE)
        yield from push(arm, -0.06 * UP, lambda: any(world.touching(it, "ramp") for it in (f"ball_{i}", ROBOT)))
        yield from release(arm)
        # Before the hand moves aside, its tips, 9 mm below it, must be over a ball of 36 mm.
        yield from go_to(arm, spot + 0.065 * UP, pace=COARSE)

    def steps(self) -> Mapping[str, Planner]:
        left, held = list(range(len(self.colours))), list[int]()

        def next_of(red: bool) -> int | None:
            return next((i for i in left if self.colours[i] == red), None)

        def take(world: World, red: bool) -> Plan:
            if (i := next_of(red)) is not None:
                held.append(left.pop(left.index(i)))
                yield from self.take(world, i)

        def release_it(world: World, red: bool) -> Plan:
            if not held and next_of(red) is not None:
                raise GaveUp("no ball is in the jaw")
            spot = self.release_spot(self.red_side if red else -self.red_side)
            yield from self.release_at(world, held.pop(), spot) if held else ()

        return {
            "take_red": partial(take, red=True),
            "release_red": partial(release_it, red=True),
            "take_blue": partial(take, red=False),
            "release_blue": partial(release_it, red=False),
            "drop_in_bin": lambda world: self._over_the_bin(world, BIN_RIM),
            "all_one_side": lambda world: self.sort(world, [1] * len(self.colours), range(len(self.colours))),
        }

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        right = [self.red_side if red else -self.red_side for red in self.colours]
        wrong, order = [-side for side in right], range(len(right))
        return {
            "all_on_one_side": Shortcut(lambda world: self.sort(world, [1] * len(right), order)),
            "colours_exchanged": Shortcut(lambda world: self.sort(world, wrong, order)),
            "through_the_barrier": Shortcut(lambda world: self._over_the_bin(world, self.barrier.height + 0.03)),
            "by_hand_into_the_bin": Shortcut(lambda world: self._over_the_bin(world, BIN_RIM)),
        }

    def _over_the_bin(self, world: World, height: float) -> Plan:
        """Release every ball over the bin of its colour, at a height over the table [m]."""
        arm = world.arm
        for i, red in enumerate(self.colours):
            yield from self.take(world, i)
            _, spot = self.bin(self.red_side if red else -self.red_side)
            high = max(height, self.barrier.height + 0.03)
            yield from go_to(arm, [arm.hand[0], arm.hand[1], TABLE_TOP + high], pace=COARSE)
            yield from go_to(arm, [spot[0], spot[1], TABLE_TOP + high], pace=COARSE)
            yield from go_to(arm, [spot[0], spot[1], TABLE_TOP + height], pace=COARSE)
            yield from release(arm)
            yield from go_to(arm, [spot[0], spot[1], TABLE_TOP + high], pace=COARSE)
            yield from go_to(arm, [self.box_x, self.box_y, TABLE_TOP + high], pace=COARSE)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        bare = self.build()
        remove(bare, "ramp")
        return {"no_ramp": bare, "bins_exchanged": self._scene(-self.red_side)}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        colours = ("ball_*.redness", "ball_*.lightness", "*ness of ball", "*_bin.*", "red_side")
        sides = [side_of(self.red_side if red else -self.red_side) for red in self.colours]
        low, high = self.ramp.ridge + self.band, self.ramp.width / 2 - self.ball.radius
        return {
            **{f"side_of_ball_{i}": choice(side, *colours) for i, side in enumerate(sides)},
            "side_of_red": choice(self.red_side, "*_bin.*", "red_side"),
            "release_to_the_left": span(low, high, "ramp.ridge"),
            "ramp": near((self.x, self.y), 0.020, "x", "y"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        ramp, radius = self.ramp, self.ball.radius
        ways = math.comb(self.reds + self.blues, self.reds)
        yield require(self.red_side != 0, "the red bin stands on neither side", red_side=self.red_side)
        yield require(self.arrangement < ways, "there are fewer arrangements", number=self.arrangement, ways=ways)
        needed = 2.0 / 7.0 * ramp.fall
        yield require(ramp.friction > needed, "balls slip instead of rolling", friction=ramp.friction, needed=needed)
        narrow = ramp.width / 2 - abs(ramp.ridge)
        least = self.band + 0.008
        yield require(narrow / 2 >= least, "a slab is too narrow to let a ball go on it", room=narrow / 2, least=least)
        yield require(narrow / 2 > radius + 0.005, "a ball on the slab meets its rail", room=narrow / 2, radius=radius)
        end, low = TOP_DISTANCE - ramp.length / 2 + PALM_ALONG, BARRIER_START - 0.005
        yield require(end < low, "the palm meets the barrier", palm=end, barrier=BARRIER_START)
        rim = float(ramp.surface(ramp.length / 2, ramp.width / 2 * (1 if ramp.ridge < 0 else -1))[2])
        yield require(rim > BIN_RIM, "the bins are higher than the end of the ramp", end=rim, rim=BIN_RIM)
        room = CARRY_HEIGHT - radius - float(ramp.surface(-ramp.length / 2, ramp.ridge)[2])
        yield require(room > 0.01, "balls are not carried over the ramp", room=room)
        above = radius - TIP_BELOW - BOX_DEPTH
        yield require(above > 0.0, "the finger tips meet the walls of the box", above=above)
        beside = ROW_PITCH - radius - FINGER_ACROSS
        yield require(beside > 0.005, "a finger meets the next ball", beside=beside)
        ramp_outline, palm = self.outlines
        box = corners([self.box_x, self.box_y], 0.0, self.box.outer)
        yield on_table("the ramp or the box", [ramp_outline, box])
        apart = gap(ramp_outline, palm)
        yield require(apart > 0.01, "the ramp is in the way of the palm over the box", apart=apart)
        spots = [self.release_spot(side) + RELEASE_HEIGHT * UP for side in (1, -1)]
        yield within_reach("a ball or the ramp", self.start(0), self.start(len(self.colours) - 1), *spots)

    def features(self) -> Mapping[str, float]:
        """Lateral drift over the width of a slab, width of the uncertain band over the release offset, place of the
        ridge [m], speed [m/s], number of balls, and the red side."""
        offset = min(abs(self._ridge_offset(side)) for side in (1, -1))
        return {
            "drift_over_width": self.ramp.drift / (self.ramp.width / 2),
            "band_over_aside": self.band / offset,
            "ridge": self.ramp.ridge,
            "speed": math.sqrt(10.0 / 7.0 * GRAVITY * self.ramp.length * self.ramp.fall),
            "balls": float(len(self.colours)),
            "red_to": float(self.red_side),
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "reds": self.reds,
            "blues": self.blues,
            "red_bin": "on the left" if self.red_side > 0 else "on the right",
            "ridge": abs(self.ramp.ridge),
            "first": "red" if self.colours[0] else "blue",
            "box": way_to(np.array([self.box_x, self.box_y]), np.array([self.x, self.y])),
        }

    # --- geometry ---------------------------------------------------------------------------

    @cached_property
    def colours(self) -> tuple[bool, ...]:
        """Whether each ball is red, in the order of the row."""
        places = range(self.reds + self.blues)
        ways = list(itertools.combinations(places, self.reds))
        return tuple(i in ways[self.arrangement % len(ways)] for i in places)

    @cached_property
    def band(self) -> float:
        """Half width of the band at the ridge in which the side of a ball is not certain [m]."""
        return self.ball.radius * math.sin(math.radians(self.ramp.lean)) + 0.004

    @cached_property
    def axes(self) -> Mat3:
        """Axes of the ramp: down along the ridge, to the left of it, up."""
        return about_z(self._yaw)

    @cached_property
    def _yaw(self) -> float:
        """Direction in which balls roll [rad]."""
        return math.pi / 2 + math.radians(self.ramp_yaw)

    @cached_property
    def middle(self) -> Vec3:
        """Point on the table below the middle of the ramp [m]."""
        return np.array([self.x, self.y, TABLE_TOP])

    @cached_property
    def _bins_along(self) -> float:
        """Distance of the bins' middle from that of the ramp, along the ramp [m]."""
        return self.ramp.length / 2 + BIN_GAP + BIN_LENGTH / 2

    @cached_property
    def _half_width(self) -> float:
        """Distance of the bins' outer side from the middle of the ramp, across it [m].

        They reach beyond the rails: a ball that drifts all the way leaves the ramp beside its rail, outwards.
        """
        return self.ramp.width / 2 + 0.04

    def at(self, along: float, across: float) -> Vec3:
        """A point on the table, from its place in the axes of the ramp [m]."""
        return self.middle + self.axes @ [along, across, 0.0]

    def start(self, i: int) -> Vec3:
        """Centre of a ball at the start [m]."""
        away = (i - (self.reds + self.blues - 1) / 2) * ROW_PITCH
        return np.array([self.box_x + away, self.box_y, TABLE_TOP + BOX_FLOOR + self.ball.radius])

    def release_spot(self, side: int) -> Vec3:
        """Centre of a ball that is released on a slab [m]."""
        surface = self.ramp.surface(TOP_DISTANCE - self.ramp.length / 2, self.ramp.ridge + self._ridge_offset(side))
        return self.middle + self.axes @ (surface + self.ball.radius * self.ramp.axes(side)[:, 2])

    def _ridge_offset(self, side: int) -> float:
        """Offset of the release from the ridge, not beyond the middle of the slab [m]."""
        return side * min(0.035, abs(side * self.ramp.width / 2 - self.ramp.ridge) / 2)

    @cached_property
    def outlines(self) -> tuple[Outline, Outline]:
        """Outlines of the ramp with its bins, and of the palm at all places where it takes a ball from the box [m]."""
        start, end = -self.ramp.length / 2, self._bins_along + BIN_LENGTH / 2 + BIN_WALL
        ramp = corners(self.middle, self._yaw, (end - start, 2 * self._half_width), ((start + end) / 2, 0.0))
        row = (len(self.colours) - 1) * ROW_PITCH + 2 * PALM_ACROSS
        return ramp, corners([self.box_x, self.box_y], 0.0, (row, 2 * PALM_ALONG))
