"""T21 gap-funnel: roll a ball through the only gap of a wall, into a square that the hand cannot reach.

                    #
          (_) o     #            seen from above, the robot is on the left
           :        #
           :  1     #
           v    2             [zone]|
          ( ) - - ->  - - - - [    ]|  kerb
                    #
                    #

Bottleneck: the ball lies beside the gap's axis, and what the hand does ends at the wall. So the ball has to be brought
before the gap first, at rest, and then sent on: straight, and fast enough to roll as far as the zone by itself.

A ball that rolls slows down by 5/7 c g, c being its resistance to rolling: from v it gets 7 v^2 / (10 c g) far.

Decisions where the paper (App. B, T21) is silent:

* A ball that strikes the wall loses the episode. Else it is rolled along the wall until it finds the gap, and whoever
  has aimed badly tries again for nothing.
* It may be held, but not lifted: over the wall no gap is needed. The wall is so high that the palm cannot pass over it
  while the jaw holds the ball on the table.
* "Outside the robot's workspace" is beyond a bound that no posture of the arm exceeds (`panda.REACH`).
* A kerb behind the zone stops what is too fast. Without it the speed would have to be right to 8 %, and a finger gives
  a ball its own speed to 10 %: it rolls ahead of a hand that is not quite even.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from ..assets.ball import Ball
from ..assets.gap_wall import GapWall, Kerb
from ..assets.patch import Patch
from ..assets.prop import TABLE_HALF, TABLE_TOP, place, table
from ..control.loop import Loop
from ..geometry import UP, Vec3, between, heading, quat
from ..params import param
from ..physics import GRAVITY
from ..predicates import fallen, inside, still
from ..robots.ik import shortfall
from ..robots.jaw import FINGER_ACROSS, OPEN_GAP, PALM_ACROSS, PALM_ALONG, TIP_BELOW
from ..scenario import Answer, Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import ROBOT, World
from ..skills.jaw import carry, pick, release
from ..skills.motion import (
    CLOSED,
    COARSE,
    STEADY,
    Condition,
    Pace,
    closing_along,
    go_to,
    hold,
    retreat,
    stay,
    steer,
    until,
    wait,
)

STILL = 0.02
"""Speed below which the ball lies [m/s]: it stops within 3 mm."""
LIFTED = 0.02
"""How far the ball's centre may rise [m]: more than a kerb gives it, less than a wall asks for."""
ASIDE = 0.06
"""How far the ball lies from the gap's axis at least [m]: the jaw reaches 40 mm from there, the gap 36 mm."""
SPARE = 1.08
"""How much wider than the ball the gap is, at least: the hand is exact to 2 mm."""
BEHIND, AIR = 0.03, 0.008
"""Of the hand behind the ball at first, and before the wall in the end [m]."""
ROOM = 0.10
"""Way on which the hand gets as fast as the ball must be, at least [m]."""
LOW = TIP_BELOW + 0.010
"""Height of the grip site over the table when it pushes [m]: at the ball's middle the fingers are flat."""
OVER = 0.09
"""How far the hand rises over the ball [m]."""
MORE, FASTEST = 1.1, 0.27
"""Share of the speed that the ball needs, with which it is pushed; and the fastest that the hand goes [m/s]."""
BACK = 3.0
"""How far the hand moves aside for each length that the ball is off its way: it drags the ball along with it."""
SOFTLY, FASTER = 0.04, 0.25
"""Speed at which the hand comes up to the ball [m/s], and how much faster it gets behind it [m/s^2]."""
EXACT = 0.001
"""How near the hand is to where it starts to push [m]: what is left it makes up on the way."""
DRAG = Pace(0.15, 0.002)
"""Of the ball in the jaw, over the table."""


@dataclass(frozen=True, kw_only=True)
class GapFunnel(Scenario):
    """A ball, a wall with a gap, and a zone behind it."""

    HOLD = 0.3

    wall_x: float = param(0.15, "m", 0.0, 0.3)
    gap_y: float = param(0.0, "m", -0.35, 0.35)
    """Where the middle of the gap is."""
    yaw: float = param(0.0, "deg", -45.0, 45.0)
    """Where the gap leads; at 0 straight away from the robot."""
    before: float = param(0.24, "m", 0.05, 0.4)
    """Distance of the ball from the middle of the wall."""
    offset: float = param(0.12, "m", -0.4, 0.4)
    """Of the ball from the gap's axis, to the left."""
    run: float = param(0.195, "m", 0.05, 0.3)
    """From the middle of the gap to that of the zone."""
    rolling: float = param(0.008, "1", 0.003, 0.1)
    """Resistance to rolling, as a share of the load."""
    wall: GapWall = GapWall()
    ball: Ball = Ball(radius=0.025, density=600.0, friction=0.3, rgba=(0.90, 0.45, 0.10, 1.0))
    zone: Patch = Patch(size=0.08)
    kerb: Kerb = Kerb()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene, yaw = table(), math.radians(self.yaw)
        left, right = (self._to_edge(side) for side in (1.0, -1.0))
        place(scene, replace(self.wall, left=left, right=right), "wall", self.gap_at, yaw, free=False)
        place(scene, self.zone, "zone", self.zone_at, yaw, free=False)
        self._add_kerb(scene)
        place(scene, replace(self.ball, rolling=self.rolling), "ball", self.start)
        return scene

    def _add_kerb(self, scene: mujoco.MjSpec) -> None:
        """The kerb is part of the table: whether a ball came to it says nothing of the way that it took."""
        top = scene.body("table")
        self.kerb.fill(top, scene)
        bar = top.geoms[-1]
        bar.pos, bar.quat = bar.pos + self.kerb_at - top.pos, quat("z", math.radians(self.yaw))

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        half, high = self.zone.size / 2, self.ball.radius + LIFTED
        within = inside(world, "ball", "zone", np.array([-half, -half, 0.0]), np.array([half, half, high]))
        return within and still(world, "ball", STILL) and not world.touching(ROBOT, "ball")

    def failure(self, world: World) -> str | None:
        if fallen(world, "ball"):
            return "the ball fell off the table"
        if world.touched("ball", "wall"):
            return "the ball struck the wall"
        return "the ball was lifted" if world.com("ball")[2] - self.start[2] > LIFTED else None

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Draw the ball before the gap, let it lie, and push it through."""
        yield from self.align(world, self.gap_at - self.before * self.n)
        yield from self.send(world, self.gap_at, MORE)
        yield from wait(world.arm, lambda: self.success(world), give_up=6.0)

    def align(self, world: World, spot: Vec3) -> Plan:
        """Take the ball across the gap's axis, draw it over the table to a spot, and let go."""
        arm = world.arm
        yield from pick(arm, world.com("ball"), self.t, above=OVER, lift=0.0)
        yield from carry(arm, "ball", [spot[0], spot[1], world.com("ball")[2]], pace=DRAG)
        yield from hold(arm, 0.2)
        yield from release(arm, 0.3)
        yield from retreat(arm, OVER)

    def send(self, world: World, spot: Vec3, share: float) -> Plan:
        """Push the ball from where it is towards a spot, until the hand is before the wall.

        Slowly up to the ball, and then evenly faster: a blow makes it roll ahead, at a speed that nobody chose.

        Args:
            share: of the speed with which it comes to rest in the zone, wherever it leaves the hand.
        """
        arm, way = world.arm, (spot - world.com("ball")) * [1.0, 1.0, 0.0]
        along = way / np.linalg.norm(way)
        start = world.com("ball") - (self.ball.radius + FINGER_ACROSS + BEHIND) * along
        start[2] = TABLE_TOP + LOW
        side = np.array([-along[1], along[0], 0.0])
        rot = closing_along(arm, side)
        yield from go_to(arm, start + OVER * UP, rot, COARSE, CLOSED)
        yield from go_to(arm, start, rot)
        yield from until(stay(arm, start, rot, lambda: math.dist(arm.hand, start) < EXACT), self._late(world))
        stop, pace = self.stop + PALM_ALONG * abs(float(along @ self.t)), SOFTLY
        while (arm.hand - self.gap_at) @ self.n < -stop:
            if pace > SOFTLY or world.touching(ROBOT, "ball"):
                goal = share * self.speed_for(float((self.zone_at - world.com("ball")) @ self.n))
                pace = min(goal, FASTEST, pace + FASTER * Loop.PERIOD)
            off = float((world.com("ball") - spot) @ side)
            on_line = start + (arm.hand - start) @ along * along  # no error along the way: making it up were a blow
            yield steer(arm, on_line - BACK * off * side, pace * along, between(arm.hand_rot, rot), CLOSED)
        yield from go_to(arm, arm.hand + BEHIND * (UP - along), pace=COARSE)

    def _late(self, world: World) -> Condition:
        """Whether a second has passed from now on."""
        end = world.time + 1.0
        return lambda: world.time > end

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "straight_ahead": Shortcut(lambda world: self.send(world, world.com("ball") + self.n, MORE)),
            "straight_at_the_zone": Shortcut(lambda world: self.send(world, self.zone_at, MORE)),
            "aslant_through_the_gap": Shortcut(lambda world: self.send(world, self.gap_at, MORE)),
            "too_slow": Shortcut(self._too_slow, to_rest=True),
            "over_the_wall": Shortcut(self._over),
        }

    def _too_slow(self, world: World) -> Plan:
        """At a speed with which it gets half as far as the zone's middle, behind the gap."""
        yield from self.align(world, self.gap_at - self.before * self.n)
        yield from self.send(world, self.gap_at, math.sqrt(0.5))

    def _over(self, world: World) -> Plan:
        """Carry it over the wall, as far as the arm gets, and let it fall there."""
        yield from pick(world.arm, world.com("ball"), self.t, above=OVER, lift=self.wall.height + OVER)
        yield from carry(world.arm, "ball", self.gap_at + 0.1 * self.n + (self.wall.height + OVER) * UP, pace=STEADY)
        yield from release(world.arm)

    def answer(self) -> Answer:
        """Where the gap is along y [m]. One try: a ball beside it strikes the wall."""

        def act(world: World, place: float) -> Plan:
            yield from self.align(world, self.gap_at - self.before * self.n + (place - self.gap_y) * self.t)
            yield from self.send(world, world.com("ball") + self.n, MORE)

        def right(place: float) -> bool:
            return abs(place - self.gap_y) * math.cos(math.radians(self.yaw)) < self.wall.gap / 2 - self.ball.radius

        return Answer(tuple(np.linspace(-0.18, 0.18, 37).round(3).tolist()), act, right, tries=1)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        return {"no_gap": replace(self, wall=replace(self.wall, gap=0.0)).build()}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        wide, gap = 2 * self.ball.radius, self.wall.gap
        yield require(wide * SPARE <= gap, "the ball does not fit through the gap", gap=gap, ball=wide)
        yield require(wide + 0.010 <= OPEN_GAP, "the jaw cannot take the ball", ball=wide, opening=OPEN_GAP)
        yield require(abs(self.offset) >= ASIDE, "the ball lies before the gap already", offset=self.offset)
        yield on_table("the ball", self.start, margin=self.ball.radius)
        jambs = [self.gap_at + side * gap * self.t for side in (-1, 1)]
        yield on_table("the gap", jambs)
        half = self.zone.size / 2
        square = [self.zone_at + half * (a * self.n + b * self.t) for a in (-1, 1) for b in (-1, 1)]
        bar = [self.kerb_at + a * self.kerb.width / 2 * self.n for a in (-1, 1)]
        yield on_table("the zone or the kerb", [*square, *bar])
        away = min(shortfall(corner + self.ball.radius * UP) for corner in square)
        yield require(away > 0, "the hand may come to the zone", beyond_reach=away)
        room = self.before - self.stop - self.ball.radius
        yield require(room >= ROOM, "the hand has no room to push", room=room, needed=ROOM)
        yield require(self.needed <= FASTEST, "the hand is too slow", needed=self.needed, fastest=FASTEST)
        low = self.arriving < self.jumping
        yield require(low, "the ball jumps over the kerb", speed=self.arriving, jumping=self.jumping)
        hand = [self.start, self.gap_at - self.before * self.n, self.gap_at - self.stop * self.n]
        yield within_reach("the ball, or the gap", *hand)

    def features(self) -> Mapping[str, float]:
        """The speed that is needed [m/s], the air in the gap over the radius, and where the ball is to go [m, deg]."""
        return {
            "speed": self.needed,
            "air_over_radius": self.wall.gap / 2 / self.ball.radius - 1,
            "aside": self.offset,
            "heading": self.yaw,
        }

    # --- geometry -------------------------------------------------------------------------

    @property
    def n(self) -> Vec3:
        """Where the gap leads."""
        return heading(self.yaw)

    @property
    def t(self) -> Vec3:
        """Along the wall, to the left."""
        return heading(self.yaw + 90.0)

    @property
    def gap_at(self) -> Vec3:
        """The middle of the gap, on the table [m]."""
        return np.array([self.wall_x, self.gap_y, TABLE_TOP])

    @property
    def start(self) -> Vec3:
        """Of the ball [m]."""
        return self.gap_at - self.before * self.n + self.offset * self.t + self.ball.radius * UP

    @property
    def zone_at(self) -> Vec3:
        """The middle of the zone [m]."""
        return self.gap_at + self.run * self.n

    @property
    def kerb_at(self) -> Vec3:
        """The middle of the kerb [m]: it stands where the zone ends."""
        return self.zone_at + (self.zone.size / 2 + self.kerb.width / 2) * self.n

    @property
    def stop(self) -> float:
        """How far before the middle of the wall the hand stops [m]."""
        return self.wall.thickness / 2 + PALM_ACROSS + AIR

    def speed_for(self, way: float) -> float:
        """From which the ball rolls so far [m/s]."""
        return math.sqrt(10 / 7 * self.rolling * GRAVITY * max(0.0, way))

    @property
    def needed(self) -> float:
        """Speed with which a ball that the hand lets go comes to rest in the middle of the zone [m/s]."""
        return self.speed_for(self.run + self.stop - self.ball.radius - FINGER_ACROSS)

    @property
    def arriving(self) -> float:
        """Of the fastest ball at the kerb [m/s]."""
        on = self.zone.size / 2 - self.ball.radius
        return math.sqrt(max(0.0, FASTEST**2 - self.needed**2 - self.speed_for(on) ** 2))

    @property
    def jumping(self) -> float:
        """Speed at which a rolling ball gets over the kerb [m/s].

        It turns about the kerb's edge with what is left of its spin about it, and has to rise by the kerb's height.
        """
        share = self.kerb.height / self.ball.radius
        return math.sqrt(10 / 7 * GRAVITY * self.kerb.height) / (1 - 5 / 7 * share) if share < 1 else math.inf

    def _to_edge(self, side: float) -> float:
        """From the gap to where the table ends, along the wall [m]."""
        d = side * self.t[:2]
        far = [(math.copysign(TABLE_HALF, u) - p) / u for p, u in zip(self.gap_at, d, strict=False) if abs(u) > 1e-6]
        return min(far) - self.wall.gap / 2
