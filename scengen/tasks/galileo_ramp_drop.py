"""T14 galileo-ramp-drop: let a steel ball go where it will run out of speed on the patch across the valley.

      hand                                seen from the side; u points to the right
       ()  \\                       //     the ball goes down here and up there
            \\                   ///patch
             \\__             __//
    [()tray]     ``--.....--``

Bottleneck: nothing can be done about the ball any more once it is let go. Its height says everything about the end:
too high and it crosses the patch, too low and it never gets there.

What "arrives at near-zero velocity" means here. The paper gives no number. A ball that turns back on the patch has
speed zero there, so the goal is: the ball rolled through the valley, has touched the patch, and has not gone past its
upper edge. The patch is `Ramp.band` = 6 mm high, so that this is the same as a sliding ball that crosses the lower edge
with at most sqrt(2 g band) = 0.34 m/s: 7 % of the energy that it has in the valley, if it comes down from 80 mm. The
predicate asks for contact and not for a speed because contact is seen at the physics rate, and because on a ramp
without friction the ball rolls back at once: there is no state that lasts. Crossing the upper edge loses for good, and
HOLD is longer than the time to cross the patch, so a ball that is only on its way across it never counts.

Carrying. The robot may not touch the ball beyond the middle of the ramp. Otherwise the patch is reached by carrying
the ball there. Pushing the ball on the near side is no failure, but makes it arrive too fast.

The paper calls the ramp frictionless and ships it with a friction of 0.10 to 0.50 (App. C). Training is close to the
former; App. C is an axis, where the ball rolls. Rolling changes the speed (sqrt(10/7 g h) instead of sqrt(2 g h)) and
not the height; the loss lies in between, where the ball slips as it rolls (see `Ramp.climb`).

The tray is fixed to the table: the paper does not say, and a tray that moves would be a tool of its own.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import mujoco
import numpy as np

from ..assets.ball import Ball
from ..assets.prop import PRIORITY, STIFF, TABLE_HALF, TABLE_TOP, UP, place, table
from ..assets.ramp import RIM, WALL, Ramp
from ..params import param
from ..robots.panda import REACH, SHOULDER
from ..scenario import Plan, Planner, Refutation, Scenario
from ..sim.world import ROBOT, Mat3, Vec3, World
from ..skills.motion import OPEN, facing_down, go_to, grasp, push, release, wait

JAW = 0.132
"""Width of the open jaw with its fingers [m], measured on the model as the next two."""
FINGER = (0.010, 0.009)
"""Half a finger's thickness, and how far it reaches beyond the grip site, along the ramp and down [m]."""
PALM = (0.032, 0.031)
"""Half the palm's thickness, and how far it is behind the grip site [m]."""
TRAY = (0.075, 0.04)
"""Half the inner size of the tray [m], across and along the ramp: the open jaw must fit."""
TRAY_RIM = 0.012
"""Height of the tray's rim above its floor [m]: holds the ball, and stays below its equator."""
TRAY_WALL = 0.005
"""Thickness of the tray's walls and floor [m]."""
BRIM = 0.015
"""The highest release is this far below the top of the ramp, along the incline [m]; there the ball still lies on it."""
LIFT = 0.12
"""How high above its tray and above the floor of the ramp the ball is carried [m]: over rims and walls."""


@dataclass(frozen=True, kw_only=True)
class GalileoRampDrop(Scenario):
    """A ramp with a patch on its far side, and a ball in a tray beside its near side."""

    HOLD: ClassVar[float] = 0.3
    """The slowest ball that crosses the patch takes sqrt(2 length / (g sin slope)) < 0.2 s at 12 deg or more."""

    x: float = param(0.06, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    heading: float = param(90.0, "deg", -180.0, 180.0, period=360.0)
    """Direction in which the ball rolls."""
    tray_back: float = param(0.12, "m", 0.05, 0.3)
    """How far the tray's middle lies behind the middle of the ramp."""
    tray_gap: float = param(0.045, "m", 0.035, 0.1)
    """Free space between tray and ramp."""
    ramp: Ramp = Ramp()
    ball: Ball = Ball()

    # --- geometry -------------------------------------------------------------------------

    @property
    def frame(self) -> Mat3:
        """Axes of the ramp: along it, across it, up."""
        a = math.radians(self.heading)
        return np.array([[math.cos(a), -math.sin(a), 0.0], [math.sin(a), math.cos(a), 0.0], [0.0, 0.0, 1.0]])

    @property
    def middle(self) -> Vec3:
        """The point on the table below the middle of the ramp [m]."""
        return np.array([self.x, self.y, TABLE_TOP])

    @property
    def tray(self) -> Vec3:
        """Middle of the tray's foot [m], on that side of the ramp where the robot stands."""
        along, across, _ = self.frame.T
        away = self.ramp.width / 2 + WALL + self.tray_gap + TRAY_WALL + TRAY[0]
        return self.middle - self.tray_back * along + away * (across if across[0] <= 0 else -across)

    def resting(self, s: float) -> Vec3:
        """Centre of a ball that touches the floor at s [m]."""
        return self.middle + self.frame @ (self.ramp.floor(s) + self.ball.radius * self.ramp.normal(s))

    def along(self, world: World) -> float:
        """How far the ball is from the middle of the ramp, along it and level [m]; positive on the far side."""
        return float((world.com("ball") - self.middle) @ self.frame[:, 0])

    @cached_property
    def edge(self) -> float:
        """How far along the ramp, level, the centre of a ball is that touches the patch's upper edge [m]."""
        return float((self.resting(self.ramp.patch[1]) - self.middle) @ self.frame[:, 0])

    @cached_property
    def start(self) -> float:
        """Where to let the ball go [m], negative on the near side."""
        return -self.ramp.at_height(self.ramp.release(self.ball.radius))

    @property
    def brim(self) -> float:
        """The highest place of release [m], negative on the near side."""
        return BRIM - self.ramp.top

    def infeasible(self) -> Refutation | None:
        low, high = self.ramp.patch
        if low < self.ramp.foot or high > self.ramp.top:
            return Refutation(
                "the patch is not on the incline",
                {"low": low, "high": high, "foot": self.ramp.foot, "top": self.ramp.top},
            )
        if self.start < self.brim:
            return Refutation(
                "the ball would have to start above the ramp",
                {"release": self.ramp.height(self.start), "top": self.ramp.height(self.brim)},
            )
        highest = self.ramp.climb(self.brim, self.ball.radius)
        if highest < (edge := self.ramp.height(high)) + self.ramp.band:
            return Refutation("a ball from the top does not overshoot", {"climbs": highest, "edge": edge})
        return self._cramped() or self._misplaced()

    def _cramped(self) -> Refutation | None:
        """No room for a hand that points down and holds the ball on the incline by its middle."""
        if self.ramp.width < JAW:
            return Refutation("the open jaw does not fit between the walls", {"jaw": JAW, "width": self.ramp.width})
        fall, centre = math.tan(self.ramp.slope), self.ball.radius / math.cos(self.ramp.slope)
        if (tips := centre - FINGER[1] - FINGER[0] * fall) < 0.0:
            return Refutation("the fingers meet the floor before the ball does", {"room": tips})
        if (palm := centre + PALM[1] - PALM[0] * fall - RIM / math.cos(self.ramp.slope)) < 0.0:
            return Refutation("the palm meets the walls before the ball meets the floor", {"room": palm})
        return None

    def _misplaced(self) -> Refutation | None:
        corners = np.array([[a, b, 0.0] for a in (-1, 1) for b in (-1, 1)])
        ramp = self.middle + (corners * [self.ramp.span / 2, self.ramp.width / 2 + WALL, 0.0]) @ self.frame.T
        tray = self.tray + (corners * [TRAY[1] + TRAY_WALL, TRAY[0] + TRAY_WALL, 0.0]) @ self.frame.T
        if (far := float(np.abs(np.vstack([ramp, tray])[:, :2]).max())) > TABLE_HALF:
            return Refutation("the ramp or the tray leaves the table", {"farthest": far, "edge": TABLE_HALF})
        hover = [self.resting(self.start) + LIFT * UP, self.tray + LIFT * UP]
        if (away := max(float(np.linalg.norm(p - SHOULDER)) for p in hover)) > REACH:
            return Refutation("the ball's way is out of reach", {"distance": away, "reach": REACH})
        return None

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene, yaw = table(), math.radians(self.heading)
        place(scene, self.ramp, "ramp", self.middle, yaw, free=False)
        self._add_tray(scene)
        place(scene, self.ball, "ball", self.tray + (TRAY_WALL + self.ball.radius) * UP)
        return scene

    def _add_tray(self, scene: mujoco.MjSpec) -> None:
        a = math.radians(self.heading) / 2
        body = scene.worldbody.add_body(name="tray", pos=self.tray.tolist(), quat=[math.cos(a), 0, 0, math.sin(a)])
        (across, along), half = TRAY, TRAY_WALL / 2
        tall = TRAY_RIM / 2 + half
        boards = [((0.0, 0.0, half), (along, across, half))]
        boards += [((sign * (along + half), 0.0, tall), (half, across + TRAY_WALL, tall)) for sign in (-1, 1)]
        boards += [((0.0, sign * (across + half), tall), (along, half, tall)) for sign in (-1, 1)]
        for i, (pos, size) in enumerate(boards):
            body.add_geom(
                name=f"tray_{i}",
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=size,
                pos=pos,
                friction=[0.4, 0.005, 0.0001],
                solref=STIFF,
                priority=PRIORITY,
                mass=0.1,
                rgba=[0.35, 0.38, 0.45, 1.0],
            )

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Without the near incline the ball falls from the hand to the table; without the far one nothing brakes it."""
        near, far = self.build(), self.build()
        _clear(near, "ramp/near")
        _clear(far, "ramp/far", "ramp/beyond")
        self._lay_down(far.body("ramp/patch"))
        return {"no near incline": near, "no far incline": far}

    def _lay_down(self, patch: mujoco.MjsBody) -> None:
        """Put the patch, which has lost its support, flat below its place, flush with the table top."""
        c, s = math.cos(self.ramp.slope), math.sin(self.ramp.slope)
        x, _, z = self.ramp.floor(sum(self.ramp.patch) / 2)
        patch.quat = np.array([math.cos(self.ramp.slope / 2), 0.0, math.sin(self.ramp.slope / 2), 0.0])
        patch.pos = np.array([x - (c * x + s * z), 0.0, s * x - c * z])

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return world.touched("ball", "ramp/valley") and world.touched("ball", "ramp/patch")

    def failure(self, world: World) -> str | None:
        along = self.along(world)
        if along > 0.0 and world.touching(ROBOT, "ball"):
            return "the robot touched the ball beyond the middle of the ramp"
        if along > self.edge:
            return "the ball went past the patch"
        return None

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Find the height by energy, bring the ball there, let it go, keep out of its way."""
        yield from self.let_go(world, self.start)

    def let_go(self, world: World, s: float) -> Plan:
        """Take the ball from the tray and release it at rest on the floor of the ramp, at s."""
        yield from self._pick(world)
        up = self.frame @ self.ramp.normal(s)
        yield from self._bring(world, self.resting(s) + LIFT * UP, within=0.02)
        yield from self._bring(world, self.resting(s) + 0.01 * up)
        yield from push(world, -0.04 * up, until=lambda: world.touching("ball", "ramp/near"))
        yield from release(world, 0.15)
        yield from go_to(world, world.hand + LIFT * UP, within=0.02)
        yield from wait(world, lambda: self.success(world), give_up=3.0)

    def _pick(self, world: World) -> Plan:
        """Grasp the ball across the ramp and lift it."""
        half_turn = self.heading - 180.0 * round(self.heading / 220.0)
        yield from go_to(world, world.com("ball") + 0.1 * UP, facing_down(math.radians(half_turn)), grip=OPEN)
        yield from go_to(world, world.com("ball"))
        yield from grasp(world, 0.3)
        yield from go_to(world, world.hand + LIFT * UP, within=0.02)

    def _bring(self, world: World, target: Vec3, within: float = 0.002) -> Plan:
        """Carry the ball, wherever it sits in the jaw, to a place."""
        yield from go_to(world, world.hand + target - world.com("ball"), within=within)

    # --- shortcuts ------------------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Planner]:
        goal, start = self.ramp.level * self.ramp.height(self.ramp.top), self.ramp.height(self.start)
        plans: dict[str, Planner] = {
            "as high as possible": lambda world: self.let_go(world, self.brim),
            "half as high": lambda world: self.let_go(world, -self.ramp.at_height(start / 2)),
            "carry it to the patch": self._carry,
        }
        if start - goal > 1.5 * self.ramp.band:
            plans["as high as the patch"] = lambda world: self.let_go(world, -self.ramp.at_height(goal))
        return plans

    def _carry(self, world: World) -> Plan:
        """Straight to the target: put the ball down on the patch."""
        yield from self.let_go(world, sum(self.ramp.patch) / 2)

    # --- features -------------------------------------------------------------------------

    def features(self) -> Mapping[str, float]:
        """How high the ball must start [m], and whether it slips: from 2/7 on it rolls."""
        slope = math.tan(math.radians(self.ramp.angle))
        return {"release height": self.ramp.height(self.start), "friction over slope": self.ramp.friction / slope}


def _clear(scene: mujoco.MjSpec, *bodies: str) -> None:
    """Take all geoms of some bodies away."""
    for body in bodies:
        for geom in list(scene.body(body).geoms):
            scene.delete(geom)
