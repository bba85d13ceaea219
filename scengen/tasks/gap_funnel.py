"""T21 gap-funnel: roll a ball through the only gap of a wall, into a square that the hand cannot reach.

                    #
          (_) o     #            seen from above, the robot is on the left
           :        #
           :  1     #
           v    2             [zone]|
          ( ) - - ->  - - - - [    ]|  kerb
                    #
                    #

Bottleneck: the ball lies beside the gap's axis, and the hand must stop at the wall. So the robot must first bring the
ball before the gap, and then send it along the axis, fast enough to roll as far as the zone by itself.

A ball that rolls slows down by 5/7 c g, where c is its rolling resistance: at speed v it rolls 7 v^2 / (10 c g).

Decisions where the paper (App. B, T21) is silent:

* The ball need not rest before the gap: drawn to the axis and thrown along it by a jaw that opens at 0.26 m/s, it
  arrives in 12 of 12. That is fair.
* The gap is seen, not felt for. A badly aimed ball could roll along the wall until it finds the gap, or be tried again;
  closed fingers that slid along the wall to a jamb found it in 12 of 12.
* The square alone shows the axis where the gap leads straight ahead: a policy that never looks at wall and gap, and
  believes that they are where they are in training, solves 12 of 12 (`far_gap` and `narrow_gap` 6 of 6, `turned_wall` 0
  of 6). That is fair.
* The ball may be held, but not lifted: over the wall no gap is needed. The wall is so high that the palm cannot pass
  over it while the jaw holds the ball on the table.
* No hand touches the ball beyond the middle of the wall. The hand's narrow side, 63 mm, fits through the gap: a ball
  could be dragged through in the jaw and nudged on.
* "Outside the robot's workspace" is beyond a bound that no posture of the arm exceeds (`panda.REACH`).
* A kerb behind the zone stops a ball that is too fast. Without it the speed would have to be right to 8 %, and the
  speed of a ball that a finger pushes scatters by 10 %: it rolls ahead of a hand that moves unevenly.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from ..assets.ball import Ball
from ..assets.gap_wall import GapWall, Kerb
from ..assets.patch import Patch
from ..assets.prop import TABLE_HALF, TABLE_TOP, place, table
from ..control.loop import Loop
from ..decisions import Decision, around, choice, side_of
from ..geometry import UP, Vec3, between, heading, quat
from ..means import Mean, once, throughout, when
from ..params import param
from ..physics import GRAVITY
from ..predicates import fallen, inside, still
from ..robots.ik import shortfall
from ..robots.jaw import FINGER_ACROSS, OPEN_GAP, PALM_ACROSS, PALM_ALONG, TIP_BELOW
from ..scenario import Answer, Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT
from ..sim.world import World
from ..skills import motion
from ..skills.jaw import carry, come_down, grasp, let_go, pick, release
from ..skills.motion import CLOSED, COARSE, go_to, hold, stay, steer, wait
from ..skills.waiting import at_most

MAX_RISE = 0.02  # height by which the ball's centre may rise [m]: more than on a kerb, less than over a wall
STANDOFF_DISTANCE = 0.03
"""Gap between hand and ball before a push, and distance that the hand goes back and up after it [m]."""
APPROACH_HEIGHT = 0.09  # height over the ball from which the hand comes down [m]
SPEED_FACTOR = 1.1  # speed of a push over the speed that the ball needs
MAX_PUSH_SPEED = 0.27  # largest speed of a push [m/s]
CONTACT_SPEED = 0.04  # speed at which the hand approaches the ball [m/s]


@dataclass(frozen=True, kw_only=True)
class GapFunnel(Scenario):
    """A ball, a wall with a gap, and a zone behind it."""

    VERSION = 2
    HOLD = 0.3

    wall_x: float = param(0.15, "m", 0.0, 0.3)
    gap_y: float = param(0.0, "m", -0.35, 0.35)  # place of the middle of the gap
    yaw: float = param(0.0, "deg", -45.0, 45.0)  # direction in which the gap leads; 0 is straight away from the robot
    before: float = param(0.24, "m", 0.05, 0.4)  # distance of the ball from the middle of the wall
    offset: float = param(0.12, "m", -0.4, 0.4)  # offset of the ball from the gap's axis, to the left
    run: float = param(0.195, "m", 0.05, 0.3)  # distance from the middle of the gap to that of the zone
    rolling: float = param(0.008, "1", 0.003, 0.1)  # rolling resistance, as a share of the load
    wall: GapWall = GapWall()
    ball: Ball = Ball(radius=0.025, density=600.0, friction=0.3, rgba=(0.90, 0.45, 0.10, 1.0))
    zone: Patch = Patch(size=0.08)
    kerb: Kerb = Kerb()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene, yaw = table(), math.radians(self.yaw)
        left, right = (self._edge_distance(side) for side in (1.0, -1.0))
        place(scene, replace(self.wall, left=left, right=right), "wall", self.gap_at, yaw, free=False)
        place(scene, self.zone, "zone", self.zone_at, yaw, free=False)
        self._add_kerb(scene)
        place(scene, replace(self.ball, rolling=self.rolling), "ball", self.start)
        return scene

    def _add_kerb(self, scene: mujoco.MjSpec) -> None:
        """Add the kerb to the table's body: contact with the kerb says nothing about the way that a ball took."""
        top = scene.body("table")
        self.kerb.fill(top, scene)
        bar = top.geoms[-1]
        bar.pos, bar.quat = bar.pos + self.kerb_at - top.pos, quat("z", math.radians(self.yaw))

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        half, high = self.zone.size / 2, self.ball.radius + MAX_RISE
        within = inside(world, "ball", "zone", np.array([-half, -half, 0.0]), np.array([half, half, high]))
        # From 0.02 m/s a ball stops within 3 mm.
        return within and still(world, "ball", 0.02) and not world.touching(ROBOT, "ball")

    def failure(self, world: World) -> str | None:
        return "the ball fell off the table" if fallen(world, "ball") else None

    def means(self) -> Mapping[str, Mean]:
        through = "the ball rolled through the gap by itself, on the table"

        def brought(world: World) -> bool:
            x, y = self.from_gap(world)
            return world.touching(ROBOT, "ball") and x < 0.0 and abs(y) < self.wall.gap / 2 - self.ball.radius

        def rolls(world: World) -> bool:
            low = world.com("ball")[2] - self.start[2] <= MAX_RISE
            return low and not world.touching(ROBOT, "ball") and abs(self.from_gap(world)[1]) < self.wall.gap / 2

        return {
            "the robot brought the ball before the gap": once(brought),
            through: when(lambda world: self.from_gap(world)[0] > 0.0, rolls),
            "no hand touched the ball beyond the gap": throughout(
                lambda world: not world.touching(ROBOT, "ball"), after=through
            ),
            "the ball stayed on the table": throughout(lambda world: world.com("ball")[2] - self.start[2] <= MAX_RISE),
            "neither ball nor hand felt for the gap along the wall": throughout(
                lambda world: not world.touched("ball", "wall") and not world.touched(ROBOT, "wall")
            ),
        }

    def from_gap(self, world: World) -> tuple[float, float]:
        """Place of the ball from the middle of the gap, in the direction in which it leads and to the left [m]."""
        away = world.com("ball") - self.gap_at
        return float(away @ self.normal), float(away @ self.tangent)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Draw the ball in front of the gap, release it, and push it through."""
        yield from self.align(world, self.gap_at - self.before * self.normal)
        yield from self.send(world, self.gap_at, SPEED_FACTOR)
        yield from wait(world.arm, lambda: self.success(world), give_up=6.0)

    def align(self, world: World, spot: Vec3) -> Plan:
        """Grasp the ball across the gap's axis, draw it over the table to a spot, and release it."""
        yield from pick(world.arm, world.com("ball"), self.tangent, above=APPROACH_HEIGHT, lift=0.0)
        yield from self._draw(world, spot)
        yield from self._leave(world)

    def _draw(self, world: World, spot: Vec3) -> Plan:
        """Draw the held ball over the table to a spot."""
        arm = world.arm
        yield from carry(arm, "ball", [spot[0], spot[1], world.com("ball")[2]], pace=motion.Pace(0.15, 0.002))
        yield from hold(arm, 0.2)

    def _leave(self, world: World) -> Plan:
        """Open the jaw and move up."""
        yield from let_go(world.arm, APPROACH_HEIGHT, seconds=0.3)

    def send(self, world: World, spot: Vec3, factor: float) -> Plan:
        """Push the ball towards a spot, until the hand is in front of the wall.

        The hand approaches slowly and then accelerates evenly: after a blow the ball rolls ahead at an unknown speed.

        Args:
            spot: place to which the ball is pushed [m].
            factor: speed of the push over that from which the ball comes to rest in the zone.
        """
        arm, way = world.arm, (spot - world.com("ball")) * [1.0, 1.0, 0.0]
        along = way / np.linalg.norm(way)
        start = world.com("ball") - (self.ball.radius + FINGER_ACROSS + STANDOFF_DISTANCE) * along
        start[2] = TABLE_TOP + (TIP_BELOW + 0.010)  # at the height of the ball's middle the fingers are flat
        side = np.array([-along[1], along[0], 0.0])
        rot = motion.closing_along(arm, side)
        yield from go_to(arm, start + APPROACH_HEIGHT * UP, rot, COARSE, CLOSED)
        yield from go_to(arm, start, rot)
        precise = stay(arm, start, rot, lambda: math.dist(arm.hand, start) < 0.001)
        yield from at_most(world, 1.0, precise)  # the push corrects the remaining error
        stop, pace = self.stop_distance + PALM_ALONG * abs(float(along @ self.tangent)), CONTACT_SPEED
        while (arm.hand - self.gap_at) @ self.normal < -stop:
            if pace > CONTACT_SPEED or world.touching(ROBOT, "ball"):
                goal = factor * self.speed_for(float((self.zone_at - world.com("ball")) @ self.normal))
                pace = min(goal, MAX_PUSH_SPEED, pace + 0.25 * Loop.PERIOD)  # [m/s^2]
            off = float((world.com("ball") - spot) @ side)
            on_line = start + (arm.hand - start) @ along * along  # an error along the way is not corrected: no blow
            # The hand moves aside by 3 times the ball's error, and drags the ball along.
            yield steer(arm, on_line - 3.0 * off * side, pace * along, between(arm.hand_rot, rot), CLOSED)
        yield from go_to(arm, arm.hand + STANDOFF_DISTANCE * (UP - along), pace=COARSE)

    def steps(self) -> Mapping[str, Planner]:
        return {
            "reach_ball": lambda world: come_down(world.arm, world.com("ball"), self.tangent, APPROACH_HEIGHT),
            "draw_in_line": self._draw_in_line,
            "release": self._leave,
            "push_through": lambda world: self.send(world, self.gap_at, SPEED_FACTOR),
            "in_square": lambda world: wait(world.arm, lambda: self.success(world), give_up=6.0),
            "lift_over": self._over,
        }

    def _draw_in_line(self, world: World) -> Plan:
        """Close the jaw and draw the ball in front of the gap."""
        yield from grasp(world.arm)
        yield from self._draw(world, self.gap_at - self.before * self.normal)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "straight_ahead": Shortcut(lambda world: self.send(world, world.com("ball") + self.normal, SPEED_FACTOR)),
            "straight_at_the_zone": Shortcut(lambda world: self.send(world, self.zone_at, SPEED_FACTOR)),
            "aslant_through_the_gap": Shortcut(lambda world: self.send(world, self.gap_at, SPEED_FACTOR)),
            "too_slow": Shortcut(self._too_slow, to_rest=True),
            "over_the_wall": Shortcut(self._over),
        }

    def _too_slow(self, world: World) -> Plan:
        """Push it at a speed at which it rolls half as far as the zone's middle."""
        yield from self.align(world, self.gap_at - self.before * self.normal)
        yield from self.send(world, self.gap_at, math.sqrt(0.5))

    def _over(self, world: World) -> Plan:
        """Carry it over the wall, as far as the arm reaches, and release it there."""
        height = self.wall.height + APPROACH_HEIGHT
        yield from pick(world.arm, world.com("ball"), self.tangent, above=APPROACH_HEIGHT, lift=height)
        yield from carry(world.arm, "ball", self.gap_at + 0.1 * self.normal + height * UP, pace=motion.STEADY)
        yield from release(world.arm)

    def answer(self) -> Answer:
        """Place of the gap along y [m]. One try: no goal counts after a ball has struck the wall."""

        def act(world: World, place: float) -> Plan:
            yield from self.align(world, self.gap_at - self.before * self.normal + (place - self.gap_y) * self.tangent)
            yield from self.send(world, world.com("ball") + self.normal, SPEED_FACTOR)

        def right(place: float) -> bool:
            return abs(place - self.gap_y) * math.cos(math.radians(self.yaw)) < self.wall.gap / 2 - self.ball.radius

        return Answer(tuple(np.linspace(-0.18, 0.18, 37).round(3).tolist()), act, right, tries=1)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        return {"no_gap": replace(self, wall=replace(self.wall, gap=0.0)).build()}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        room = (self.wall.gap / 2 - self.ball.radius) / math.cos(math.radians(self.yaw))
        return {
            "gap": around(self.gap_y, room, "gap_y"),
            "ball_is_drawn": choice(side_of(-self.offset), "offset", "gap_y"),
            "ball_is_drawn_by": around(-self.offset, 0.008, "offset", "gap_y"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        wide, gap = 2 * self.ball.radius, self.wall.gap
        # The hand is exact to 2 mm.
        yield require(wide * 1.08 <= gap, "the ball does not fit through the gap", gap=gap, ball=wide)
        yield require(wide + 0.010 <= OPEN_GAP, "the jaw cannot take the ball", ball=wide, opening=OPEN_GAP)
        # At 60 mm: the jaw reaches 40 mm from the ball, the gap 36 mm from its axis.
        yield require(abs(self.offset) >= 0.06, "the ball lies before the gap already", offset=self.offset)
        yield on_table("the ball", self.start, margin=self.ball.radius)
        jambs = [self.gap_at + side * gap * self.tangent for side in (-1, 1)]
        yield on_table("the gap", jambs)
        half = self.zone.size / 2
        square = [self.zone_at + half * (a * self.normal + b * self.tangent) for a in (-1, 1) for b in (-1, 1)]
        bar = [self.kerb_at + a * self.kerb.width / 2 * self.normal for a in (-1, 1)]
        yield on_table("the zone or the kerb", [*square, *bar])
        away = min(shortfall(corner + self.ball.radius * UP) for corner in square)
        yield require(away > 0, "the hand may come to the zone", beyond_reach=away)
        room, needed = self.before - self.stop_distance - self.ball.radius, 0.10  # [m] in which the hand accelerates
        yield require(room >= needed, "the hand has no room to push", room=room, needed=needed)
        needed, fastest = self.needed_speed, MAX_PUSH_SPEED
        yield require(needed <= fastest, "the hand is too slow", needed=needed, fastest=fastest)
        low = self.arrival_speed < self.jump_speed
        yield require(low, "the ball jumps over the kerb", speed=self.arrival_speed, jumping=self.jump_speed)
        hand = [self.start, self.gap_at - self.before * self.normal, self.gap_at - self.stop_distance * self.normal]
        yield within_reach("the ball, or the gap", *hand)

    def features(self) -> Mapping[str, float]:
        """Speed that the ball needs [m/s], clearance over radius, offset of the ball [m], angle of the gap [deg]."""
        return {
            "speed": self.needed_speed,
            "air_over_radius": self.wall.gap / 2 / self.ball.radius - 1,
            "aside": self.offset,
            "heading": self.yaw,
        }

    def facts(self) -> Mapping[str, float | str]:
        side = "on the left" if self.offset > 0.0 else "on the right"
        return {
            "side": "on the line" if abs(self.offset) < 0.01 else side,
            "aside": abs(self.offset),
            "gap": self.wall.gap,
            "run": self.run,
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def normal(self) -> Vec3:
        """Unit vector in which the gap leads."""
        return heading(self.yaw)

    @cached_property
    def tangent(self) -> Vec3:
        """Unit vector along the wall, to the left."""
        return heading(self.yaw + 90.0)

    @cached_property
    def gap_at(self) -> Vec3:
        """Middle of the gap, on the table [m]."""
        return np.array([self.wall_x, self.gap_y, TABLE_TOP])

    @cached_property
    def start(self) -> Vec3:
        """Centre of the ball at the start [m]."""
        return self.gap_at - self.before * self.normal + self.offset * self.tangent + self.ball.radius * UP

    @cached_property
    def zone_at(self) -> Vec3:
        """Middle of the zone [m]."""
        return self.gap_at + self.run * self.normal

    @cached_property
    def kerb_at(self) -> Vec3:
        """Middle of the kerb, at the end of the zone [m]."""
        return self.zone_at + (self.zone.size / 2 + self.kerb.width / 2) * self.normal

    @cached_property
    def stop_distance(self) -> float:
        """Distance from the middle of the wall at which the hand stops [m], 8 mm before the palm touches it."""
        return self.wall.thickness / 2 + PALM_ACROSS + 0.008

    def speed_for(self, way: float) -> float:
        """Speed from which the ball rolls a distance [m/s]."""
        return math.sqrt(10 / 7 * self.rolling * GRAVITY * max(0.0, way))

    @cached_property
    def needed_speed(self) -> float:
        """Speed at which a ball must leave the hand to come to rest in the middle of the zone [m/s]."""
        return self.speed_for(self.run + self.stop_distance - self.ball.radius - FINGER_ACROSS)

    @cached_property
    def arrival_speed(self) -> float:
        """Speed of the fastest ball at the kerb [m/s]."""
        on = self.zone.size / 2 - self.ball.radius
        return math.sqrt(max(0.0, MAX_PUSH_SPEED**2 - self.needed_speed**2 - self.speed_for(on) ** 2))

    @cached_property
    def jump_speed(self) -> float:
        """Speed at which a rolling ball gets over the kerb [m/s].

        The ball turns about the kerb's edge with the remaining part of its spin, and must rise by the kerb's height.
        """
        share = self.kerb.height / self.ball.radius
        return math.sqrt(10 / 7 * GRAVITY * self.kerb.height) / (1 - 5 / 7 * share) if share < 1 else math.inf

    def _edge_distance(self, side: float) -> float:
        """Distance from the gap to the edge of the table, along the wall to one side [m]."""
        along = side * self.tangent[:2]
        axes = zip(self.gap_at, along, strict=False)
        ways = [(math.copysign(TABLE_HALF, u) - p) / u for p, u in axes if abs(u) > 1e-6]
        return min(ways) - self.wall.gap / 2
