"""T12 linear-intercept: take a ball that rolls over the table, where it is going to be.

       o ball, starts near an edge         seen from above
        \\
         \\  path
     [   \\   ]   the open jaw waits across the path, closes as the ball arrives, and lifts it
           \\

Bottleneck: the ball does not wait. The hand needs two seconds to a place on the table, and the fingers 0.14 s more; in
that time the ball rolls over half the table. Where it goes follows from where it is and how it moves.

Decisions, where the paper (App. B, T12) is silent:

* Speeds. A ball that rolls without slipping on a hard table keeps its velocity. The hand reaches 0.28 m/s along an
  axis; the ball has half of that, and leaves the table after three to six seconds. A slower one could be followed.
* The ball lies still at first, near the left edge, and is launched at a moment that nobody knows beforehand, rolling.
* "Above the table" is 4 cm higher than on the table, as in robosuite's Lift; held by the robot and by nothing else for
  the paper's 30 steps. Nothing is forbidden: who stops the ball by hand before taking it has been there first.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from ..assets.ball import Ball
from ..assets.prop import TABLE_HALF, TABLE_TOP, place, solid, table
from ..errors import GaveUp
from ..geometry import UP, Vec3, between, polar, quat
from ..params import param
from ..physics import passes, rolled, rolling_deceleration
from ..robots import jaw
from ..robots.panda import BASE
from ..scenario import Plan, Refutation, Shortcut, on_table, require
from ..sim.world import World
from ..skills.motion import closing_along
from .launched_ball import EDGE, HAND_SPEED, LONGEST, READY, SEEN, SPARE, LaunchedBall

PASSED, MISSES = 0.020, 0.05
"""How far a ball has rolled on that fingers do not get hold of any more, and how far beside a place that they do not
reach [m]."""
BAR = (0.010, 0.10, 0.012)
"""Of the bar that stops the ball in the ablation: along its path, across it, up [m]. No hand that takes a ball comes so
low."""


@dataclass(frozen=True, kw_only=True)
class LinearIntercept(LaunchedBall):
    """A ball that is launched over the table."""

    x: float = param(0.0, "m", -0.36, 0.36)
    y: float = param(0.32, "m", -0.36, 0.36)
    heading: float = param(255.0, "deg", -180.0, 360.0, period=360.0)
    """Where it rolls; 0 is away from the robot, 90 to its left."""
    speed: float = param(0.15, "m/s", 0.08, 0.4)
    launch: float = param(0.8, "s", 0.3, 2.0)
    """When."""
    rolling: float = param(0.0, "1", 0.0, 0.02)
    """Resistance to rolling, as a share of the load."""
    ball: Ball = Ball(radius=0.020, density=1200.0, friction=0.6, rgba=(0.90, 0.35, 0.10, 1.0))

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        place(scene, replace(self.ball, rolling=self.rolling or None), "ball", self.start)
        return scene

    def events(self, world: World) -> None:
        if world.passes(self.launch):
            world.launch("ball", self.speed * self.u, self.speed / self.ball.radius * np.cross(UP, self.u))

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """See how the ball rolls, wait where it is going to be, close so that the fingers arrive when it does."""
        yield from self.take(world, self.closing)

    def take(self, world: World, lead: float) -> Plan:
        """Meet the ball, and close `lead` [s] before it is there."""
        yield from self.look(world)
        across = between(world.arm.hand_rot, closing_along(world.arm, np.cross(UP, self.u)))
        found = self.met(world.com("ball"), world.velocity("ball")[3:], world.arm.hand, math.sqrt(across @ across))
        if found is None:
            raise GaveUp("the hand comes too late to every place on the ball's path")
        at, _ = found
        yield from self.wait_at(world, at, self.u, lambda: self.left(world, world.arm.hand) <= lead)
        yield from self.catch(world)

    def left(self, world: World, at: Vec3) -> float:
        """Time until the ball comes to a place on its path [s]; inf if it stops before."""
        velocity = world.velocity("ball")[3:]
        speed = math.sqrt(velocity @ velocity)
        return passes(float((at - world.com("ball")) @ velocity) / max(speed, 1e-9), speed, self.slowing)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        plans = {
            "go_to_where_it_is": Shortcut(self._go_to_it),
            "allow_for_the_way_alone": Shortcut(self._too_short),
            "follow_it": Shortcut(lambda world: self.follow(world, lambda: self.u)),
        }
        if self.speed * self.closing > PASSED:
            plans["close_when_it_is_there"] = Shortcut(lambda world: self.take(world, 0.0))
        if abs(self.beside_middle) > MISSES:
            plans["expect_it_in_the_middle"] = Shortcut(self._expect)
        return plans

    def _go_to_it(self, world: World) -> Plan:
        """Pick the ball where it is when it begins to roll."""
        yield from self.look(world)
        yield from self.pick_at(world, world.com("ball"))

    def _too_short(self, world: World) -> Plan:
        """Pick the ball where it will be after the time that the way there takes at full speed."""
        yield from self.look(world)
        ball, velocity, hand = world.com("ball"), world.velocity("ball")[3:], world.arm.hand
        times = np.arange(0.0, LONGEST, 0.02)
        late = [t - math.dist(ball + t * velocity, hand) / HAND_SPEED for t in times]
        yield from self.pick_at(
            world, ball + next(t for t, over in zip(times, late, strict=True) if over > 0) * velocity
        )

    def _expect(self, world: World) -> Plan:
        """Wait in the middle, where such balls come through, and close when it comes nearest."""
        yield from self.look(world)
        middle = np.array([0.0, 0.0, self.grip])
        yield from self.wait_at(world, middle, self.u, lambda: self.left(world, world.arm.hand) <= self.closing)
        yield from self.catch(world)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """A low bar across its path keeps the ball from where it is met."""
        barred = self.build()
        at, along = self.start + (self.ball.radius + 0.04) * self.u, math.radians(self.heading)
        bar = barred.worldbody.add_body(name="bar", pos=[at[0], at[1], TABLE_TOP + BAR[2] / 2], quat=quat("z", along))
        solid(bar, "bar", np.array(BAR) / 2)
        return {"barred_way": barred}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        width = 2 * self.ball.radius
        yield on_table("the ball", self.start, EDGE)
        yield require(width <= jaw.OPENING - 0.01, "the ball is too wide for the jaw", width=width, jaw=jaw.OPENING)
        turn = abs(math.remainder(math.radians(self.heading) - polar(BASE - self.start)[0], math.pi))
        seen = self.start + self.speed * SEEN * self.u
        ends = self.speed**2 / (2 * self.slowing) if self.slowing else math.inf
        falls = ends > self.way_to_edge
        yield require(falls, "the ball comes to rest on the table", ends=min(ends, 9.0), edge=self.way_to_edge)
        met = self.met(seen, self.speed * self.u, READY, turn, 2.5 * SPARE)
        late = "the hand comes too late to every place on the ball's path"
        yield require(met is not None, late, seconds=met[1] if met else LONGEST)

    def features(self) -> Mapping[str, float]:
        """The ball's speed as a share of the hand's, how long the jaw takes [s], where the ball starts seen from the
        robot [rad], whether it runs away from there (1) or towards it (-1), and what speed it loses in a second."""
        bearing, away = polar(self.start - BASE)
        return {
            "speed_over_hand": self.speed / HAND_SPEED,
            "closing_time": self.closing,
            "bearing": bearing,
            "running_away": float(self.u @ (self.start - BASE)) / away,
            "slowing": self.slowing / self.speed,
        }

    # --- mechanics and geometry ---------------------------------------------------------------

    def met(
        self, ball: Vec3, velocity: Vec3, hand: Vec3, turn: float, spare: float = SPARE
    ) -> tuple[Vec3, float] | None:
        """The first place on the ball's path where the hand is in time, and when [s]; None if there is none.

        Args:
            ball: where it is [m].
            velocity: of the ball [m/s].
            hand: where the hand is [m].
            turn: by which it must turn to have its fingers on either side of the path [rad].
            spare: how long before the ball it is to be there [s].
        """
        speed = math.sqrt(velocity @ velocity)

        def way(seconds: float) -> Vec3:
            return ball + rolled(speed, self.slowing, seconds) / speed * velocity

        return next(self.meetings(way, hand, lambda _: turn, spare), None)

    @property
    def slowing(self) -> float:
        """How fast it loses speed [m/s^2]."""
        return rolling_deceleration(self.rolling)

    @property
    def way_to_edge(self) -> float:
        """How far it rolls until it leaves the table [m]."""
        return min(
            (TABLE_HALF - math.copysign(1.0, along) * at) / abs(along)
            for at, along in zip(self.start[:2], self.u[:2], strict=True)
            if abs(along) > 1e-9
        )

    @property
    def beside_middle(self) -> float:
        """How far its path passes the middle of the table [m]."""
        return float(self.u[0] * self.start[1] - self.u[1] * self.start[0])
