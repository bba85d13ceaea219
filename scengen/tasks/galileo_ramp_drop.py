"""T14 galileo-ramp-drop: release a steel ball at the height from which it stops on the patch across the valley.

      hand                                seen from the side; the ball goes down here and up there
       ()  \\                       //
            \\                   ///patch
             \\__             __//
    [()tray]     ``--.....--``

Bottleneck: after the release the robot cannot influence the ball. Its height alone decides: from too high it crosses
the patch, from too low it does not reach it.

Decisions. (1) The paper gives no number for "arrives at near-zero velocity". A ball that turns back on the patch has
speed zero there, so the goal is: the ball rolled through the valley, has touched the patch, and has not gone past its
upper edge. The patch is `Ramp.band` = 3 mm high: a sliding ball crosses its lower edge with at most sqrt(2 g band) =
0.24 m/s, about a third of its speed in the valley or less (0.5 % of training draws exceed it). Contact is detected at
the physics rate; on a ramp without friction no state lasts. No goal counts after the upper edge is crossed, and HOLD is
longer than the time to cross the patch. (2) The ball is let go once, at rest on the near slope. A hand could otherwise
carry it to the patch, or try higher and higher; and from one of six fixed places a falling ball bounces on to the
patch. There it touches the ramp first: a ball that ran from just above the slope, or from the far side, showed what a
run loses, and was caught as it came back (6 and 4 of 12). (3) The paper calls the ramp frictionless and ships it with
0.10 to 0.50 (App. C). Training is close to the former: the ball let go at the height of the patch solves 32 of 48
draws. App. C is an axis, where the ball rolls: that changes its speed (sqrt(10/7 g h) instead of sqrt(2 g h)) and not
the height. The loss is in between, where the ball slips as it rolls (`Ramp.climb`). (4) The tray is fixed to the table:
a tray that moves is a tool.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import ClassVar

import mujoco
import numpy as np

from ..assets.ball import Ball
from ..assets.bin import Bin
from ..assets.prop import TABLE_TOP, place, table
from ..assets.ramp import WALL_RISE, WALL_THICKNESS, Ramp
from ..decisions import Decision, around
from ..geometry import UP, Mat3, Outline, Vec3, about_z, corners, spoken
from ..means import Mean, throughout, when
from ..params import param
from ..predicates import still
from ..robots import jaw
from ..scenario import Answer, Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT
from ..sim.world import World
from ..skills.jaw import carry, grasp, let_go, lower, pick, release
from ..skills.motion import COARSE, closing_along, retreat, turn_to, wait

TRAY = Bin(width=0.08, length=0.15, depth=0.012, wall=0.005, floor=0.005)
"""Tray of the ball, long enough for the open jaw; its rim holds the ball and is below its equator."""
MAX_HOP = 0.01  # largest gap between the ramp and a ball that is let go [m]: at its release it hops by 1 to 2 mm
RELEASE_SPEED = 0.2
"""Largest speed of a ball that is let go at rest, as it leaves the fingers [m/s]: as they open it slides at up to 0.13
m/s. A push to 0.2 m/s is worth 2 mm of height."""
CARRY_HEIGHT = 0.12
"""Height above the tray and above the floor of the ramp at which the ball is carried [m]: over rims and walls."""


@dataclass(frozen=True, kw_only=True)
class GalileoRampDrop(Scenario):
    """A ramp with a patch on its far side, and a ball in a tray beside its near side."""

    VERSION = 3

    HOLD: ClassVar[float] = 0.3
    """The slowest ball that crosses the patch takes sqrt(2 length / (g sin slope)) < 0.2 s at 12 deg or more."""

    x: float = param(0.06, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    heading: float = param(90.0, "deg", -180.0, 180.0, period=360.0)  # direction in which the ball rolls
    tray_back: float = param(0.12, "m", 0.05, 0.3)  # distance of the tray's middle behind the middle of the ramp
    tray_gap: float = param(0.045, "m", 0.035, 0.1)  # free space between tray and ramp
    ramp: Ramp = Ramp()
    ball: Ball = Ball()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene, yaw = table(), math.radians(self.heading)
        place(scene, self.ramp, "ramp", self.middle, yaw, free=False)
        place(scene, TRAY, "tray", self.tray, yaw, free=False)
        place(scene, self.ball, "ball", self.tray + (TRAY.floor + self.ball.radius) * UP)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return world.touched("ball", "ramp/valley") and world.touched("ball", "ramp/patch")

    def means(self) -> Mapping[str, Mean]:
        held, free = "the jaw brought the ball to the near slope", "the ball was let go there at rest"

        def on_slope(world: World) -> bool:
            return world.arm.grips("ball") and world.touching("ball", "ramp/near")

        def at_rest(world: World) -> bool:
            on_floor = self.gap(world.com("ball")) <= MAX_HOP
            return on_floor and self.along(world.com("ball")) < 0.0 and still(world, "ball", RELEASE_SPEED)

        def untouched(world: World) -> bool:
            return not world.touching(ROBOT, "ball")

        return {
            held: when(lambda world: any(part.startswith("ramp/") for part in world.touching_bodies("ball")), on_slope),
            free: when(untouched, at_rest, after=held),
            "no hand touched the ball after that": throughout(untouched, after=free),
            "the ball came to the patch through the valley": when(
                lambda world: world.touched("ball", "ramp/patch"), lambda world: world.touched("ball", "ramp/valley")
            ),
            "the ball kept to the ramp and turned before the patch's upper edge": throughout(
                lambda world: (
                    self.along(world.com("ball")) <= self.patch_edge
                    and (world.touching(ROBOT, "ball") or self.gap(world.com("ball")) <= MAX_HOP)
                )
            ),
        }

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Compute the height from the energy, bring the ball there, release it and move away."""
        yield from self.release_at(world, self.release_place)

    def release_at(self, world: World, s: float) -> Plan:
        """Take the ball from the tray and release it at rest on the floor of the ramp, at s [m]."""
        yield from self._drop_at(world, s)
        yield from retreat(world.arm, CARRY_HEIGHT)

    def _drop_at(self, world: World, s: float) -> Plan:
        """As `release_at`, but the open jaw stays where it is."""
        yield from self._take(world)
        yield from self._put_at(world, s)

    def _put_at(self, world: World, s: float, hover: float = CARRY_HEIGHT) -> Plan:
        """Lower the held ball on the floor at s [m], from a height `hover` [m], and release it."""
        yield from self._lower_at(world, s, hover)
        yield from release(world.arm)

    def _lower_at(self, world: World, s: float, hover: float = CARRY_HEIGHT) -> Plan:
        """Lower the held ball on the floor at s [m], from a height `hover` [m]."""
        on, down = f"ramp/{self.ramp.part(s)}", -self.axes @ self.ramp.normal(s)
        yield from lower(world.arm, "ball", self.resting(s), on, hover, down)

    def _take(self, world: World) -> Plan:
        """Take the ball from the tray. The hand turns first: turning on the way may bend the arm out of reach."""
        across = self.axes[:, 1]
        yield from turn_to(world.arm, closing_along(world.arm, across), rate=2.0)
        yield from pick(world.arm, world.com("ball"), across, lift=CARRY_HEIGHT)

    def steps(self) -> Mapping[str, Planner]:
        return {
            "take_ball": self._take,
            "bring_to_height": lambda world: self._lower_at(world, self.release_place),
            "release": self._leave,
            "turns_on_patch": lambda world: wait(world.arm, lambda: self.success(world), give_up=6.0),
            "carry_to_patch": partial(self._lower_at, s=self.ramp.at_height(self.ramp.goal)),
            "try_again": self._try_higher,
        }

    def _leave(self, world: World) -> Plan:
        """Open the jaw and move away from the ball."""
        yield from let_go(world.arm, CARRY_HEIGHT)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        height, patch = self.ramp.height(self.release_place), self.ramp.at_height(self.ramp.goal)
        plans = {
            "as_high_as_possible": Shortcut(partial(self.release_at, s=self.brim)),
            "half_as_high": Shortcut(partial(self.release_at, s=-self.ramp.at_height(height / 2))),
            "carry_it_to_the_patch": Shortcut(partial(self.release_at, s=patch)),
            "catch_it_and_try_higher": Shortcut(self._try_higher),
            "let_it_bounce_across": Shortcut(partial(self.let_fall, s=-0.05, height=0.12)),
        }
        if height - self.ramp.goal > 1.5 * self.ramp.band:
            plans["as_high_as_the_patch"] = Shortcut(partial(self.release_at, s=-patch))
        return plans

    def _try_higher(self, world: World) -> Plan:
        """Release the ball too low, catch it when it comes back between the fingers, and repeat a little higher."""
        arm, height = world.arm, self.ramp.height(self.release_place) - 0.008
        yield from self._drop_at(world, -self.ramp.at_height(height))
        while True:
            yield from wait(arm, lambda: math.dist(world.com("ball"), arm.hand) > 0.12, give_up=2.0)
            yield from wait(arm, lambda: math.dist(world.com("ball"), arm.hand) < 0.08, give_up=3.0)
            yield from grasp(arm)
            yield from self._put_at(world, -self.ramp.at_height(height := height + 0.004), hover=0.02)

    def let_fall(self, world: World, s: float, height: float) -> Plan:
        """Drop the ball on the ramp at s from a height [m]: it bounces, and may come down on the patch."""
        yield from self._take(world)
        above = self.resting(s) + height * UP
        yield from carry(world.arm, "ball", above + 0.05 * UP, pace=COARSE)
        yield from carry(world.arm, "ball", above)
        yield from let_go(world.arm, CARRY_HEIGHT)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Without the near incline the ball falls to the table; without the far one nothing brakes it."""
        near, far = self.build(), self.build()
        for scene, part in ((near, "near"), (far, "far"), (far, "beyond")):
            for geom in list(scene.body(f"ramp/{part}").geoms):
                scene.delete(geom)
        self.ramp.lay_down(far.body("ramp/patch"))
        return {"no_near_incline": near, "no_far_incline": far}

    def answer(self) -> Answer:
        """Height of release as a share of the highest one. One try: after its run the ball may not be touched."""
        highest, wanted = self.ramp.height(self.brim), self.ramp.height(self.release_place)

        def act(world: World, share: float) -> Plan:
            yield from self.release_at(world, -self.ramp.at_height(share * highest))

        def right(share: float) -> bool:
            return abs(share * highest - wanted) <= self.ramp.band / 2

        return Answer(tuple(np.linspace(0.25, 0.95, 71).round(2).tolist()), act, right, tries=1)

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        highest, wanted = self.ramp.height(self.brim), self.ramp.height(self.release_place)
        return {
            "share_of_the_height": around(wanted / highest, self.ramp.band / 2 / highest, "ramp.level"),
            "height": around(wanted, self.ramp.band / 2, "ramp.level"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        ramp, (low, high) = self.ramp, self.ramp.patch
        fits = ramp.foot <= low and high <= ramp.top
        yield require(fits, "the patch is not on the incline", low=low, high=high, foot=ramp.foot, top=ramp.top)
        release, top, edge = ramp.height(self.release_place), ramp.height(self.brim), ramp.height(high)
        fits = self.release_place >= self.brim
        yield require(fits, "the ball would have to start above the ramp", release=release, top=top)
        climbs = ramp.climb(self.brim, self.ball.radius)
        yield require(climbs >= edge + ramp.band, "a ball from the top does not overshoot", climbs=climbs, edge=edge)

        # A hand that points down holds the ball on the incline by its middle.
        fall, centre, fits = math.tan(ramp.slope), self.ball.radius / math.cos(ramp.slope), ramp.width >= jaw.SPAN
        yield require(fits, "the open jaw does not fit between the walls", jaw=jaw.SPAN, width=ramp.width)
        room = centre - jaw.TIP_BELOW - jaw.FINGER_ACROSS * fall
        yield require(room >= 0.0, "the fingers meet the floor before the ball does", room=room)
        room = centre + jaw.PALM_ABOVE - jaw.PALM_ACROSS * fall - WALL_RISE / math.cos(ramp.slope)
        yield require(room >= 0.0, "the palm meets the walls before the ball meets the floor", room=room)
        yield on_table("the ramp or the tray", self.outlines)
        above = CARRY_HEIGHT * UP
        yield within_reach("the ball's way", self.resting(self.release_place) + above, self.tray + above)

    def features(self) -> Mapping[str, float]:
        """Height of release [m], and friction over slope: from 2/7 on the ball rolls, below it slips."""
        return {
            "release_height": self.ramp.height(self.release_place),
            "friction_over_slope": self.ramp.friction / math.tan(self.ramp.slope),
        }

    def facts(self) -> Mapping[str, float | str]:
        release = self.ramp.height(self.release_place)
        return {
            "way": spoken(self.heading),
            "patch": self.ramp.goal,
            "release": release,
            "relation": "clearly higher" if release > 1.15 * self.ramp.goal else "about as high",
        }

    # --- geometry ---------------------------------------------------------------------------

    @cached_property
    def axes(self) -> Mat3:
        """Axes of the ramp: along it, across it, up."""
        return about_z(math.radians(self.heading))

    @cached_property
    def middle(self) -> Vec3:
        """Point on the table below the middle of the ramp [m]."""
        return np.array([self.x, self.y, TABLE_TOP])

    @cached_property
    def tray(self) -> Vec3:
        """Middle of the tray's foot [m], on the robot's side of the ramp."""
        along, across, _ = self.axes.T
        away = self.ramp.width / 2 + WALL_THICKNESS + self.tray_gap + TRAY.wall + TRAY.length / 2
        return self.middle - self.tray_back * along + away * (across if across[0] <= 0 else -across)

    @cached_property
    def outlines(self) -> tuple[Outline, Outline]:
        """Outlines of the ramp and of the tray [m]."""
        yaw, ramp = math.radians(self.heading), (self.ramp.span, self.ramp.width + 2 * WALL_THICKNESS)
        return corners(self.middle, yaw, ramp), corners(self.tray, yaw, TRAY.outer)

    def resting(self, s: float) -> Vec3:
        """Centre of a ball that touches the floor at s [m]."""
        return self.middle + self.axes @ (self.ramp.floor(s) + self.ball.radius * self.ramp.normal(s))

    def along(self, point: Vec3) -> float:
        """Level distance of a point from the middle of the ramp, along it [m]; positive on the far side."""
        return float((point - self.middle) @ self.axes[:, 0])

    def gap(self, point: Vec3) -> float:
        """Gap between the floor of the ramp and a ball with its centre at a point [m]; not positive beside the ramp."""
        x, y, z = self.axes.T @ (point - self.middle)
        if abs(x) > self.ramp.span / 2 or abs(y) > self.ramp.width / 2:
            return 0.0
        s = self.ramp.below(x)
        return float(([x, 0.0, z] - self.ramp.floor(s)) @ self.ramp.normal(s)) - self.ball.radius

    @cached_property
    def patch_edge(self) -> float:
        """Level distance along the ramp of the centre of a ball that touches the patch's upper edge [m]."""
        return self.along(self.resting(self.ramp.patch[1]))

    @cached_property
    def release_place(self) -> float:
        """Place of the right release [m], negative on the near side."""
        return -self.ramp.at_height(self.ramp.release(self.ball.radius))

    @cached_property
    def brim(self) -> float:
        """Highest place of release [m], negative on the near side; 15 mm from the top a ball still lies on the ramp."""
        return 0.015 - self.ramp.top
