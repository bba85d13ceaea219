"""T12 linear-intercept: catch a ball that rolls over the table, at a place where it will arrive.

       o ball, starts near an edge         seen from above
        \\
         \\  path
     [   \\   ]   the open jaw waits across the path, closes as the ball arrives, and lifts it
           \\

Bottleneck: the ball does not wait. The hand needs two seconds to reach a place on the table, and the fingers need
0.14 s more; in that time the ball rolls over half the table. The robot must predict its path from its position and
velocity.

Decisions, where the paper (App. B, T12) is silent:

* Speeds. A ball that rolls without slipping on a hard table keeps its velocity. The hand reaches 0.28 m/s along an
  axis. The ball has half of that speed and leaves the table after three to six seconds. A faster ball would leave no
  time for the way to its path.
* The hand waits while the ball is within 15 cm, 0.8 to 1.1 s before it arrives, and the first touch is the catch
  (`launched_ball`). A hand that followed the ball caught 10 of 12, none of them by these means.
* Paths are 14 to 45 deg off the way straight across the table. With paths within 20 deg, a hand that followed the ball
  along a line across its way, and closed when it saw it 25 mm before the line, caught 24 of 24. Now it is 4 to 11 cm
  beside the place when it must wait: by the means 2 of 60, and 8 of 60 if it follows by half.
* All paths lead towards the middle. A hand at the best one of 25 places, which corrects its place by 2 cm when the ball
  is near, catches 15 of 60. The start x reveals most of the drift (r2 0.87): a hand that waits where balls from there
  usually pass, and follows 21 mm by place alone, catches 15 of 24 without the velocity. Both are fair.
* A jaw that waits 10 mm wider than the ball may close when the ball is there, without a lead (4 of 8; 7 of 8 with a
  lead of 30 ms). That is fair: place and course are predicted.
* The ball rests at first, near the left edge, and is launched, rolling, at a moment that the robot does not know.
* "Above the table" means 4 cm higher than on the table, as in robosuite's Lift, held by the robot and by nothing else
  for the paper's 30 steps.
"""

import math
from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from ..assets.ball import Ball
from ..assets.prop import TABLE_HALF, TABLE_TOP, place, solid, table
from ..decisions import Decision, around, choice
from ..errors import GaveUp
from ..geometry import UP, Vec3, between, heading, polar, quat, way_to
from ..params import param
from ..physics import passes, rolled, rolling_deceleration
from ..predicates import displaced
from ..robots import jaw
from ..robots.panda import BASE
from ..scenario import Action, Plan, Planner, Refutation, Shortcut, on_table, require
from ..sim.memory import remember
from ..sim.world import World
from ..skills.jaw import grasp
from ..skills.motion import COARSE, OPEN, Condition, closing_along, retreat, stay
from .launched_ball import (
    EDGE_MARGIN,
    FORESIGHT_TIME,
    HAND_SPEED,
    HAND_TURN_RATE,
    LEAD_TIME,
    MEMORY,
    OBSERVATION_TIME,
    PARKED_HAND,
    LaunchedBall,
)

NEAR_DISTANCE = 0.15  # level distance of the ball from the hand within which the hand must wait [m]
NEAR_CORRECTION = 0.008  # distance by which a waiting hand still corrects its place [m]
PARKED_SHARE = 0.3
"""Distance of the parked hand beyond the middle of the table, as a share of the ball's distance before it. At 0 and at
0.5 the hand came too late more often."""
LOW_SETTLING_TIME = 0.6  # time that a low hand needs besides its way, to stand still [s]


@dataclass(frozen=True, kw_only=True)
class LinearIntercept(LaunchedBall):
    """A ball that is launched over the table."""

    VERSION = 2

    x: float = param(0.0, "m", -0.36, 0.36)
    y: float = param(0.32, "m", -0.36, 0.36)
    heading: float = param(255.0, "deg", -180.0, 360.0, period=360.0)
    """Direction in which it rolls; 0 is away from the robot, 90 to its left."""
    speed: float = param(0.15, "m/s", 0.08, 0.4)
    launch: float = param(0.8, "s", 0.3, 2.0)  # time of the launch
    rolling: float = param(0.0, "1", 0.0, 0.02)  # rolling resistance, as a share of the load
    ball: Ball = Ball(radius=0.020, density=1200.0, friction=0.6, rgba=(0.90, 0.35, 0.10, 1.0))

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        place(scene, replace(self.ball, rolling=self.rolling or None), "ball", self.start)
        remember(scene, *MEMORY)
        return scene

    def events(self, world: World) -> None:
        self.watch(world)
        if world.passes(self.launch):
            world.launch("ball", self.speed * self.u, self.speed / self.ball.radius * np.cross(UP, self.u))

    # --- goal -----------------------------------------------------------------------------

    def may_move(self, world: World) -> bool:
        """Whether the ball is still far from the hand."""
        return displaced(world, "ball", world.arm.hand) > NEAR_DISTANCE

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Observe the ball, wait at a place on its path, and close so that the fingers arrive when the ball does."""
        yield from self.take(world, self.closing_time)

    def take(self, world: World, lead: float) -> Plan:
        """Meet the ball, and close `lead` [s] before it arrives."""
        yield from self.observe(world)
        at = yield from self._wait_on_path(world, lead)
        yield from self._wait_nearer(world, at, lead)
        yield from self.catch(world)

    def _wait_on_path(self, world: World, lead: float) -> Generator[Action, None, Vec3]:
        """Wait at a place on the ball's path until the hand may not move any more; returns the place [m]."""
        across = between(world.arm.hand_rot, closing_along(world.arm, np.cross(UP, self.u)))
        found = self.meeting(world.com("ball"), world.velocity("ball")[3:], world.arm.hand, math.sqrt(across @ across))
        if found is None:
            raise GaveUp("the hand comes too late to every place on the ball's path")
        closes = self._arrives(world, lead)
        yield from self.wait_at(world, found[0], self.u, lambda: closes() or not self.may_move(world))
        return found[0]

    def _wait_nearer(self, world: World, at: Vec3, lead: float) -> Plan:
        """Wait as near to a place [m] as a waiting hand may still come, until `lead` [s] before the ball arrives."""
        left = at - world.arm.hand
        nearer = world.arm.hand + left * min(1.0, NEAR_CORRECTION / max(math.sqrt(left @ left), 1e-9))
        yield from self.wait_at(world, nearer, self.u, self._arrives(world, lead))

    def _arrives(self, world: World, lead: float) -> Condition:
        """A condition: the ball is at the hand in `lead` [s] or less."""
        return lambda: self.time_left(world, world.arm.hand) <= lead

    def wait_at(self, world: World, at: Vec3, along: Vec3, ends: Condition) -> Plan:
        """Bring the open jaw to a place straight along the table: the ball is far from the hand's way."""
        rot = closing_along(world.arm, np.cross(UP, along))
        yield from stay(world.arm, at, rot, ends, COARSE, OPEN)

    def time_left(self, world: World, at: Vec3) -> float:
        """Time until the ball arrives at a place on its path [s]; inf if it stops before."""
        velocity = world.velocity("ball")[3:]
        speed = math.sqrt(velocity @ velocity)
        return passes(float((at - world.com("ball")) @ velocity) / max(speed, 1e-9), speed, self.deceleration)

    def steps(self) -> Mapping[str, Planner]:
        place = list[Vec3]()

        def wait_on_path(world: World) -> Plan:
            place.append((yield from self._wait_on_path(world, self.closing_time)))

        def close_in_time(world: World) -> Plan:
            yield from self._wait_nearer(world, place[-1] if place else world.arm.hand, self.closing_time)
            yield from grasp(world.arm)

        return {
            "observe": self.observe,
            "wait_on_path": wait_on_path,
            "close_in_time": close_in_time,
            "lift": lambda world: retreat(world.arm),
            "chase": lambda world: self.follow(world, lambda: self.u),
            "go_to_ball": self._go_to_it,
        }

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        plans = {
            "go_to_where_it_is": Shortcut(self._go_to_it),
            "allow_for_the_way_alone": Shortcut(self._too_short),
            "follow_it": Shortcut(lambda world: self.follow(world, lambda: self.u)),
        }
        if self.speed * self.closing_time > 0.020:  # [m]; a ball that has rolled on so far is out of the fingers' reach
            plans["close_when_it_is_there"] = Shortcut(lambda world: self.take(world, 0.0))
        if abs(self.middle_miss) > 0.05:  # [m]; fingers in the middle do not reach a ball that passes so far beside
            plans["expect_it_in_the_middle"] = Shortcut(self._expect)
        return plans

    def _go_to_it(self, world: World) -> Plan:
        """Pick the ball at the place where it starts to roll."""
        yield from self.observe(world)
        yield from self.pick_at(world, world.com("ball"))

    def _too_short(self, world: World) -> Plan:
        """Pick the ball where it will be after the time that the hand takes there at full speed."""
        yield from self.observe(world)
        ball, velocity, hand = world.com("ball"), world.velocity("ball")[3:], world.arm.hand
        times = np.arange(0.0, FORESIGHT_TIME, 0.02)
        margins = [t - math.dist(ball + t * velocity, hand) / HAND_SPEED for t in times]
        soonest = next((t for t, margin in zip(times, margins, strict=True) if margin > 0), None)
        if soonest is None:
            raise GaveUp(f"the hand reaches no place before the ball within {FORESIGHT_TIME:g} s")
        yield from self.pick_at(world, ball + soonest * velocity)

    def _expect(self, world: World) -> Plan:
        """Wait in the middle of the table, and close when the ball comes nearest."""
        yield from self.observe(world)
        middle, lead = np.array([0.0, 0.0, self.grip]), self.closing_time
        yield from self.wait_at(world, middle, self.u, lambda: self.time_left(world, world.arm.hand) <= lead)
        yield from self.catch(world)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """A low bar across the path keeps the ball from the place where the hand meets it."""
        length, width, height = 0.010, 0.10, 0.012  # along the path, across it, up; lower than a hand that takes a ball
        barred = self.build()
        at, along = self.start + (self.ball.radius + 0.04) * self.u, math.radians(self.heading)
        bar = barred.worldbody.add_body(name="bar", pos=[at[0], at[1], TABLE_TOP + height / 2], quat=quat("z", along))
        solid(bar, "bar", np.array([length, width, height]) / 2)
        return {"barred_way": barred}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        motion = ("heading", "speed")
        found: dict[str, Decision] = {"drifts": choice("away" if self.u[0] > 0 else "towards the robot", *motion)}
        for line, y in (("left", 0.10), ("middle", 0.0), ("right", -0.10)):
            x = self.start[0] + (y - self.start[1]) * self.u[0] / self.u[1]
            found[f"x_at_the_{line}_line"] = around(x, 0.020 / abs(self.u[1]), *motion)
        return found

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        width = 2 * self.ball.radius
        yield on_table("the ball", self.start, EDGE_MARGIN)
        yield require(width <= jaw.OPENING - 0.01, "the ball is too wide for the jaw", width=width, jaw=jaw.OPENING)
        turn = abs(math.remainder(math.radians(self.heading) - polar(BASE - self.start)[0], math.pi))
        observed = self.start + self.speed * OBSERVATION_TIME * self.u
        ends = self.speed**2 / (2 * self.deceleration) if self.deceleration else math.inf
        falls = ends > self.distance_to_edge
        yield require(falls, "the ball comes to rest on the table", ends=min(ends, 9.0), edge=self.distance_to_edge)
        met = self.meeting(observed, self.speed * self.u, self.parked_hand, turn, spare=0.1)
        late = "the hand comes too late to every place on the ball's path"
        yield require(met is not None, late, seconds=met[1] if met else FORESIGHT_TIME)

    def features(self) -> Mapping[str, float]:
        """Speed of the ball over that of the hand, closing time [s], direction from the robot to the start [rad],
        whether the ball runs away from the robot (1) or towards it (-1), and share of its speed lost in a second."""
        bearing, away = polar(self.start - BASE)
        return {
            "speed_over_hand": self.speed / HAND_SPEED,
            "closing_time": self.closing_time,
            "bearing": bearing,
            "running_away": float(self.u @ (self.start - BASE)) / away,
            "slowing": self.deceleration / self.speed,
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "place": way_to(self.start, np.zeros(3)),
            "edge": TABLE_HALF - max(abs(self.x), abs(self.y)),
            "robot": math.dist(self.start[:2], BASE[:2]),
        }

    # --- mechanics and geometry ---------------------------------------------------------------

    def meeting(
        self, ball: Vec3, velocity: Vec3, hand: Vec3, turn: float, spare: float = 0.0
    ) -> tuple[Vec3, float] | None:
        """First place on the ball's path where the hand arrives in time [m], and the time until the ball is there [s].

        Args:
            ball: place of the ball [m].
            velocity: of the ball [m/s].
            hand: place of the hand [m].
            turn: angle by which the hand must turn to have its fingers on either side of the path [rad].
            spare: time by which the hand must arrive earlier than it needs to [s].
        """
        speed = math.sqrt(velocity @ velocity)

        def path(seconds: float) -> Vec3:
            return ball + rolled(speed, self.deceleration, seconds) / speed * velocity

        return next(self.meetings(path, hand, lambda _: turn, self.lead + spare), None)

    def travel_time(self, hand: Vec3, at: Vec3, turn: float) -> float:
        return max(math.dist(at, hand) / HAND_SPEED, turn / HAND_TURN_RATE) + LOW_SETTLING_TIME

    @cached_property
    def lead(self) -> float:
        """Time by which the hand must be at its place before it closes, so that it waits when the ball is near [s]."""
        return NEAR_DISTANCE / self.speed - self.closing_time + LEAD_TIME

    @cached_property
    def parked_hand(self) -> Vec3:
        """Place low over the table, beyond its middle, where the hand waits until the ball rolls [m]."""
        beyond = (1.0 + PARKED_SHARE) * PARKED_HAND - PARKED_SHARE * self.start
        return np.array([beyond[0], beyond[1], self.grip])

    @property
    def u(self) -> Vec3:
        return heading(self.heading)

    @property
    def start(self) -> Vec3:
        return np.array([self.x, self.y, self.floor + self.ball.radius])

    @cached_property
    def deceleration(self) -> float:
        """Deceleration by rolling resistance [m/s^2]."""
        return rolling_deceleration(self.rolling)

    @cached_property
    def distance_to_edge(self) -> float:
        """Length of its path on the table [m]."""
        return min(
            (TABLE_HALF - math.copysign(1.0, along) * at) / abs(along)
            for at, along in zip(self.start[:2], self.u[:2], strict=True)
            if abs(along) > 1e-9
        )

    @cached_property
    def middle_miss(self) -> float:
        """Distance at which its path passes the middle of the table [m], signed."""
        return float(self.u[0] * self.start[1] - self.u[1] * self.start[0])
