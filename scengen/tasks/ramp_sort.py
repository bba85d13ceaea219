"""T16 ramp-sort: let every ball go on that side of a ridge from which it rolls into the bin of its colour.

      [ o o o o ]   ___________ . . . . . . .         seen from above; where the dots are a barrier stands, which
        box        |  left     :     [ bin ]          stops the arm and lets the balls pass
                   |- -ridge- -:= = =
                   |  right    :     [ bin ]
                    ----------- . . . . . . .

Bottleneck: nothing can be put right. Where a ball goes is decided when it is let go, and by a few millimetres where it
is let go near the ridge; a ball in the wrong bin ends the episode.

Decisions, where the paper (App. B, T16) is silent:

* "Color-dependent rolling trajectories separate red balls from blue balls": all balls roll alike, and the colour says
  which side to choose. Colours that change how a ball rolls would be masses or frictions that nobody can see.
* What separates the sides is a crown: two planes that lean away from a ridge. Where the ridge lies can be seen, and is
  not always the middle of the ramp.
* The barrier keeps the hand from the bins and from the lower half of the ramp. A ball that is let go above it falls
  through; so a ball must touch the ramp before its bin counts, else the episode is lost, as in the wrong bin, on the
  table or on the floor.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from ..assets.ball import Ball
from ..assets.barrier import Barrier, let_pass
from ..assets.bin import Bin
from ..assets.crowned_ramp import CrownedRamp
from ..assets.prop import TABLE_TOP, place, table
from ..geometry import UP, Mat3, Outline, Vec3, about_z, corners, gap
from ..params import param
from ..physics import GRAVITY
from ..robots.jaw import FINGER_ACROSS, PALM_ACROSS, PALM_ALONG, TIP_BELOW
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import ROBOT, World
from ..skills.jaw import pick, release
from ..skills.motion import COARSE, Pace, closing_along, go_to, push, wait

MOST = 6
"""Balls, at most."""
RED, BLUE = (0.82, 0.20, 0.15, 1.0), (0.15, 0.30, 0.80, 1.0)
BOX_WIDTH, BOX_WALL, BOX_FLOOR, SILL = 0.06, 0.006, 0.004, 0.006
"""Of the box across the row, its walls, its floor, and how high they stand above it [m]: lower than the finger tips."""
PITCH = 0.042
"""Distance of neighbours in the row [m]: of a ball of 18 mm radius, the finger beside it has 13 mm left to the next."""
BIN_LENGTH, BIN_DEPTH, BIN_FLOOR, BIN_WALL = 0.11, 0.040, 0.004, 0.006
BIN_RIM = BIN_DEPTH + BIN_FLOOR
"""Of the bins: length along the ramp, depth, floor, walls, and how high the walls end over the table [m]."""
BEHIND, WIDER = 0.014, 0.04
"""Between the low end of the ramp and the inside of the bins, and how far these reach beyond the rails [m]: a ball that
has been drawn aside all the way leaves the ramp beside its rail, outwards."""
FROM_TOP = 0.028
"""How far from the high end balls are let go [m]."""
ASIDE = 0.035
"""How far from the ridge, at most [m]."""
SURE = 0.008
"""How far outside the band in which its side is not certain a ball is let go at least [m]."""
ACROSS: Vec3 = np.array([0.0, 1.0, 0.0])
"""Across the row of balls."""
STARTS, BARRIER = 0.04, 0.18
"""Where the barrier begins, from the middle of the ramp: the palm stays before it; and its height, below the hand as it
is after a reset [m]."""
DOWN = Pace(0.25, 0.004)
"""Down to a ball or to the ramp."""
CLEAR = 0.065
"""How far the hand goes up before it goes aside [m]: its tips, 9 mm below it, over a ball of 36 mm."""
OVER, HOVER = 0.19, 0.012
"""Height over the table at which balls are carried, and over the ramp from which they are lowered [m]."""


@dataclass(frozen=True, kw_only=True)
class RampSort(Scenario):
    """Balls of two colours in a box, a crowned ramp, and a bin for either colour behind a barrier."""

    HOLD = 0.5

    reds: int = param(2, "balls", 1, 3)
    blues: int = param(2, "balls", 1, 3)
    arrangement: int = param(0, "index", 0, math.comb(MOST, MOST // 2) - 1)
    """Which places in the row the red balls have: a number among all ways to choose them."""
    red_side: int = param(-1, "1 left, -1 right", -1, 1)
    """On which side of the ridge the red bin is. 0 is refuted."""
    x: float = param(0.02, "m", -0.3, 0.3)
    y: float = param(0.02, "m", -0.3, 0.3)
    ramp_yaw: float = param(0.0, "deg", -60.0, 60.0)
    """0: balls roll to the robot's left."""
    box_x: float = param(0.02, "m", -0.3, 0.3)
    box_y: float = param(-0.285, "m", -0.35, 0.35)
    ramp: CrownedRamp = CrownedRamp()
    ball: Ball = Ball(radius=0.018, density=1000.0, friction=0.6, rolling=0.01)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.red_side)

    def _scene(self, red_side: int) -> mujoco.MjSpec:
        scene, yaw = table(), self._yaw
        place(scene, self.ramp, "ramp", self.middle, yaw, free=False)
        for name, side, colour in (("red_bin", red_side, RED), ("blue_bin", -red_side, BLUE)):
            shape, at = self.bin(side)
            place(scene, replace(shape, rgba=colour), name, at, yaw, free=False)
        place(scene, self.barrier, "barrier", self.at(STARTS + self.barrier.length / 2, 0.0), yaw, free=False)
        place(scene, self.box, "box", [self.box_x, self.box_y, TABLE_TOP], free=False)
        for i, red in enumerate(self.colours):
            place(scene, replace(self.ball, rgba=RED if red else BLUE), f"ball_{i}", self.start(i))
            let_pass(scene.body(f"ball_{i}"))
        return scene

    @property
    def barrier(self) -> Barrier:
        """From the upper half of the ramp to the far ends of the bins."""
        end = self.ramp.length / 2 + BEHIND + BIN_LENGTH + BIN_WALL
        return Barrier(length=end - STARTS, width=2 * self._half, height=BARRIER)

    @property
    def box(self) -> Bin:
        """Low walls around a row of balls."""
        length = (self.reds + self.blues - 1) * PITCH + 2 * self.ball.radius + 0.02
        return Bin(width=length, length=BOX_WIDTH, depth=SILL, wall=BOX_WALL, floor=BOX_FLOOR)

    def bin(self, side: int) -> tuple[Bin, Vec3]:
        """The bin at the foot of one slab, and where it stands [m]: from the ridge to beyond the rail."""
        rim = side * self._half
        shape = Bin(
            width=BIN_LENGTH,
            length=abs(rim - self.ramp.ridge) - 2 * BIN_WALL,
            depth=BIN_DEPTH,
            floor=BIN_FLOOR,
            wall=BIN_WALL,
        )
        return shape, self.at(self._bins, (rim + self.ramp.ridge) / 2)

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        red_side = self._red_side(world)
        sides = (red_side if red else -red_side for red in self.colours)
        return all(self.arrived(world, i) == side for i, side in enumerate(sides))

    def failure(self, world: World) -> str | None:
        red_side = self._red_side(world)
        for i, red in enumerate(self.colours):
            ball, side = f"ball_{i}", self.arrived(world, i)
            if side == (-red_side if red else red_side):
                return "a ball is in the bin of the other colour"
            if side and not world.touched(ball, "ramp"):
                return "a ball came into its bin without the ramp"
            if world.touched(ball, "table") or world.com(ball)[2] < TABLE_TOP:
                return "a ball is on the table or on the floor"
        return None

    def arrived(self, world: World, i: int) -> int:
        """The side of the bin that a ball is in; 0 while it is in none."""
        along, across, height = (world.com(f"ball_{i}") - self.middle) @ self.axes
        if height > BIN_RIM or abs(along - self._bins) > BIN_LENGTH / 2 or abs(across) > self._half:
            return 0
        return 1 if across > self.ramp.ridge else -1

    def _red_side(self, world: World) -> int:
        """The side on which the red bin stands in this scene."""
        return 1 if (world.pos("red_bin") - self.middle) @ self.axes[:, 1] > self.ramp.ridge else -1

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Red balls first: take one, let it go on its side of the ridge, fetch the next while it rolls."""
        sides = [self.red_side if red else -self.red_side for red in self.colours]
        yield from self.sort(world, sides, sorted(range(len(sides)), key=lambda i: not self.colours[i]))

    def sort(self, world: World, sides: Sequence[int], order: Iterable[int]) -> Plan:
        """Let balls go one after the other, each on one of the sides, and look after the last one."""
        for i in order:
            yield from self.take(world, i)
            yield from self.let_go_at(world, i, self.release(sides[i]))
        yield from wait(world.arm, lambda: self.success(world), give_up=3.0)

    def take(self, world: World, i: int) -> Plan:
        """Take a ball from the box, the fingers on both sides of the row, and lift it over everything."""
        ball = world.com(f"ball_{i}")
        yield from pick(world.arm, ball, ACROSS, above=0.12, lift=TABLE_TOP + OVER - ball[2], pace=DOWN)

    def let_go_at(self, world: World, i: int, spot: Vec3) -> Plan:
        """Lower a held ball on the ramp and let go, the fingers before and behind it: they push it to neither side."""
        arm, rot = world.arm, closing_along(world.arm, self.axes[:, 0])
        yield from go_to(arm, [spot[0], spot[1], TABLE_TOP + OVER], rot, COARSE)
        yield from go_to(arm, spot + HOVER * UP, rot, DOWN)
        yield from push(arm, -0.06 * UP, lambda: any(world.touching(it, "ramp") for it in (f"ball_{i}", ROBOT)))
        yield from release(arm)
        yield from go_to(arm, spot + CLEAR * UP, pace=COARSE)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        right = [self.red_side if red else -self.red_side for red in self.colours]
        plans = {"all_on_one_side": [1] * len(right), "colours_exchanged": [-side for side in right]}
        found = {
            name: Shortcut(lambda world, s=sides: self.sort(world, s, range(len(s)))) for name, sides in plans.items()
        }
        return {
            **found,
            "through_the_barrier": Shortcut(lambda world: self._over_the_bin(world, self.barrier.height + 0.03)),
            "by_hand_into_the_bin": Shortcut(lambda world: self._over_the_bin(world, BIN_RIM)),
        }

    def _over_the_bin(self, world: World, height: float) -> Plan:
        """Bring every ball over the bin of its colour, at a height over the table [m], and let it fall."""
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
        bare.delete(bare.body("ramp"))
        return {"no_ramp": bare, "bins_exchanged": self._scene(-self.red_side)}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        ramp, radius = self.ramp, self.ball.radius
        ways = math.comb(self.reds + self.blues, self.reds)
        yield require(self.red_side != 0, "the red bin stands on neither side", red_side=self.red_side)
        yield require(self.arrangement < ways, "there are fewer arrangements", number=self.arrangement, ways=ways)
        needed = 2.0 / 7.0 * ramp.fall
        yield require(ramp.friction > needed, "balls slip instead of rolling", friction=ramp.friction, needed=needed)
        narrow = ramp.width / 2 - abs(ramp.ridge)
        least = self.band + SURE
        yield require(narrow / 2 >= least, "a slab is too narrow to let a ball go on it", room=narrow / 2, least=least)
        yield require(narrow / 2 > radius + 0.005, "a ball on the slab meets its rail", room=narrow / 2, radius=radius)
        end, low = FROM_TOP - ramp.length / 2 + PALM_ALONG, STARTS - 0.005
        yield require(end < low, "the palm meets the barrier", palm=end, barrier=STARTS)
        rim = float(ramp.surface(ramp.length / 2, ramp.width / 2 * (1 if ramp.ridge < 0 else -1))[2])
        yield require(rim > BIN_RIM, "the bins are higher than the end of the ramp", end=rim, rim=BIN_RIM)
        room = OVER - radius - float(ramp.surface(-ramp.length / 2, ramp.ridge)[2])
        yield require(room > 0.01, "balls are not carried over the ramp", room=room)
        above = radius - TIP_BELOW - SILL
        yield require(above > 0.0, "the finger tips meet the walls of the box", above=above)
        beside = PITCH - radius - FINGER_ACROSS
        yield require(beside > 0.005, "a finger meets the next ball", beside=beside)
        yield on_table(
            "the ramp or the box", [self.outlines[0], corners([self.box_x, self.box_y], 0.0, self.box.outer)]
        )
        apart = gap(*self.outlines)
        yield require(apart > 0.01, "the ramp is in the way of the palm over the box", apart=apart)
        spots = [self.release(side) + HOVER * UP for side in (1, -1)]
        yield within_reach("a ball or the ramp", self.start(0), self.start(len(self.colours) - 1), *spots)

    def features(self) -> Mapping[str, float]:
        """How far a ball is drawn aside, as a share of a slab; how sure its side is; how fast it is; the red side."""
        aside = min(abs(self._aside(side)) for side in (1, -1))
        return {
            "drift_over_width": self.ramp.drift / (self.ramp.width / 2),
            "band_over_aside": self.band / aside,
            "ridge": self.ramp.ridge,
            "speed": math.sqrt(10.0 / 7.0 * GRAVITY * self.ramp.length * self.ramp.fall),
            "balls": float(len(self.colours)),
            "red_to": float(self.red_side),
        }

    # --- geometry ---------------------------------------------------------------------------

    @cached_property
    def colours(self) -> tuple[bool, ...]:
        """Which balls are red, in the order of the row."""
        places = range(self.reds + self.blues)
        ways = list(itertools.combinations(places, self.reds))
        return tuple(i in ways[self.arrangement % len(ways)] for i in places)

    @property
    def band(self) -> float:
        """How near to the ridge the side on which a ball will roll is not certain [m]."""
        return self.ball.radius * math.sin(math.radians(self.ramp.lean)) + 0.004

    @cached_property
    def axes(self) -> Mat3:
        """Axes of the ramp: down along the ridge, to the left of it, up."""
        return about_z(self._yaw)

    @property
    def _yaw(self) -> float:
        """Direction in which balls roll [rad]."""
        return math.pi / 2 + math.radians(self.ramp_yaw)

    @cached_property
    def middle(self) -> Vec3:
        """The point on the table below the middle of the ramp [m]."""
        return np.array([self.x, self.y, TABLE_TOP])

    @cached_property
    def _bins(self) -> float:
        """How far from there the middle of the bins is, along the ramp [m]."""
        return self.ramp.length / 2 + BEHIND + BIN_LENGTH / 2

    @cached_property
    def _half(self) -> float:
        """How far from the middle of the ramp the bins reach across it [m]."""
        return self.ramp.width / 2 + WIDER

    def at(self, along: float, across: float) -> Vec3:
        """A point on the table, told in the axes of the ramp [m]."""
        return self.middle + self.axes @ [along, across, 0.0]

    def start(self, i: int) -> Vec3:
        """Where the middle of a ball is in the beginning [m]."""
        away = (i - (self.reds + self.blues - 1) / 2) * PITCH
        return np.array([self.box_x + away, self.box_y, TABLE_TOP + BOX_FLOOR + self.ball.radius])

    def release(self, side: int) -> Vec3:
        """Where the middle of a ball is that is let go on a slab [m]."""
        surface = self.ramp.surface(FROM_TOP - self.ramp.length / 2, self.ramp.ridge + self._aside(side))
        return self.middle + self.axes @ (surface + self.ball.radius * self.ramp.axes(side)[:, 2])

    def _aside(self, side: int) -> float:
        """How far from the ridge that is: not farther than the middle of the slab [m]."""
        return side * min(ASIDE, abs(side * self.ramp.width / 2 - self.ramp.ridge) / 2)

    @property
    def outlines(self) -> tuple[Outline, Outline]:
        """Of the ramp with its bins, and of the palm wherever a ball is taken from the box."""
        start, end = -self.ramp.length / 2, self._bins + BIN_LENGTH / 2 + BIN_WALL
        ramp = corners(self.middle, self._yaw, (end - start, 2 * self._half), ((start + end) / 2, 0.0))
        row = (len(self.colours) - 1) * PITCH + 2 * PALM_ACROSS
        return ramp, corners([self.box_x, self.box_y], 0.0, (row, 2 * PALM_ALONG))
