"""T13 bounce-intercept: catch a ball that comes back from the walls.

     ___________________
    |         . o       |
    |       .     .     |        The walls stand away from the robot and are open towards it. The ball is launched at
    |     .         .   |        the back wall; it leaves every wall with a part of the speed with which it came.
    |   .             . |
      .             .
     o            .          robot

Bottleneck: the ball is faster than the hand. The place where it can be caught depends on the place of the bounce and on
the speed that the wall returns. Even on a smooth floor the path is not a mirror image: the wall takes a sixth of the
speed along its normal, and nothing of the speed along the wall.

Decisions, where the paper (App. B, T13) is silent:

* The floor is a smooth mat, on which the ball slides without turning. A ball that rolls keeps its spin in the bounce,
  slips, and ends with 2/7 of the speed before and 5/7 of that after it, which is not a mirror image at all. That is an
  axis.
* The walls take 12 to 20 % of the speed in training, like fresh cushions; a bounce takes 22 ms.
* The hand may be anywhere, also between the walls. A catch before the ball has met a wall would be another task (T12).
  "Above the table" means 4 cm higher than before, as there.
* The hand waits within 25 mm of where it is when the ball leaves the last wall, and the first touch is the catch
  (`launched_ball`). Otherwise T12 after the bounce is enough: a hand that followed the ball caught 8 of 12, and one
  that went ahead on its straight line 11 of 12, none by the means. A policy may still correct its place for the speed
  that the wall took. "The catchable zone" of the paper starts 6 cm from the walls: a hand that followed a slow ball up
  to a wall (axis `dead_walls`) was in its place when the ball left it.
* Near the wall the loss matters little. A hand that expects the mirror image, waits where that leaves the last wall,
  and then moves by up to 18 mm to the ball's straight line catches 11 of 12 (`rolling_floor` 12, `dead_walls` 3),
  without that move 9 of 12. It never uses the speed that a wall returns, and is fair.
* Aims, places and both sides are drawn so widely that no place serves many: after a bounce, 16 % of the balls come
  within 20 mm of the best one, between open fingers that are turned the right way there. A hand that hovers over the
  best of many places, and moves 25 mm after the bounce, catches 10 of 60.

The oracle predicts again after every bounce: the speed after a bounce depends on when in a time step the ball meets the
wall.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..assets.ball import Ball
from ..assets.enclosure import MAT_SIZE, Enclosure, PlacedEnclosure, Way, lay_mat
from ..assets.prop import TABLE_TOP, place, table
from ..decisions import Decision, choice, near, side_of
from ..errors import GaveUp
from ..geometry import UP, Vec3, heading, polar, way_to
from ..means import Mean, when
from ..params import param
from ..robots import jaw
from ..robots.panda import BASE
from ..scenario import Plan, Refutation, Shortcut, on_table, require
from ..sim.arm import ROBOT
from ..sim.memory import remember
from ..sim.world import World
from ..skills.motion import Condition
from .launched_ball import (
    EDGE_MARGIN,
    FORESIGHT_TIME,
    HAND_SPEED,
    LEAD_TIME,
    MEMORY,
    OBSERVATION_TIME,
    PARKED_HAND,
    LaunchedBall,
    place_on,
    way_at,
)

CATCHABLE_DISTANCE = 0.06  # distance of the ball's centre from the walls from which it may be caught [m]


@dataclass(frozen=True, kw_only=True)
class BounceIntercept(LaunchedBall):
    """A ball that is launched between three walls."""

    VERSION = 2

    side: int = param(1, "1 to the left, -1 to the right", -1, 1)
    """Side to which the ball is launched; `y`, `aim` and `turn` are mirrored with it."""
    x: float = param(-0.12, "m", -0.36, 0.36)
    y: float = param(-0.15, "m", -0.36, 0.36)
    aim: float = param(35.0, "deg", -90.0, 90.0)  # direction of the launch; 0 is away from the robot, 90 to its left
    speed: float = param(0.32, "m/s", 0.08, 0.8)
    launch: float = param(0.8, "s", 0.3, 2.0)  # time of the launch
    turn: float = param(0.0, "deg", -30.0, 30.0)  # angle by which the enclosure is turned to the left
    friction: float = param(0.0, "1", 0.0, 0.6)  # friction of the mat; if it is not 0, the ball rolls
    ball: Ball = Ball(radius=0.020, density=1200.0, friction=0.6, rgba=(0.90, 0.35, 0.10, 1.0))
    enclosure: Enclosure = Enclosure()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        lay_mat(scene, self.friction)
        place(scene, self.enclosure, "enclosure", self.placed.mouth, self.turned, free=False)
        place(scene, self.ball, "ball", self.start)
        remember(scene, *MEMORY, "bounces", "at_wall")
        return scene

    def events(self, world: World) -> None:
        self.watch(world)
        if world.passes(self.launch):
            spin = self.speed / self.ball.radius if self.friction else 0.0
            world.launch("ball", self.speed * self.u, spin * np.cross(UP, self.u))
        at_wall = world.touching("enclosure", "ball")
        world.memory["bounces"] += at_wall and not world.memory["at_wall"]
        world.memory["at_wall"] = float(at_wall)

    # --- goal -----------------------------------------------------------------------------

    def may_move(self, world: World) -> bool:
        """Whether the ball is at a wall: the hand waits at its place of the last bounce."""
        return world.touching("enclosure", "ball")

    def means(self) -> Mapping[str, Mean]:
        def met(world: World) -> bool:
            return world.touching(ROBOT, "ball")

        def far(world: World) -> bool:
            return self.placed.wall_distance(world.com("ball")) >= CATCHABLE_DISTANCE

        return {
            "a wall threw the ball back first": when(met, lambda world: world.memory["bounces"] > 0.0),
            "the robot met the ball away from the walls": when(met, far),
            **super().means(),
        }

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Observe the ball, wait at a place on its path, predict again after every bounce, close before it arrives."""
        yield from self.observe(world)
        yield from self.take(world, self.closing_time)

    def take(self, world: World, lead: float) -> Plan:
        """Meet the ball, and close `lead` [s] before it arrives.

        Raises:
            GaveUp: the hand comes too late to every place on the path.
        """
        while True:
            bounces, ways, now = world.memory["bounces"], self.predict(world), world.time
            if (found := self.meeting(ways, world.arm.hand, bounced=bounces > 0)) is None:
                raise GaveUp("the hand comes too late to every place on the ball's way")
            at, due = found[0], now + found[1]
            along = way_at(ways, found[1])[1].velocity

            def bounced(before: float = bounces) -> bool:
                return bool(world.memory["bounces"] > before and not world.memory["at_wall"])

            def ends(due: float = due, bounced: Condition = bounced) -> bool:
                return bounced() or due - world.time <= lead

            yield from self.wait_at(world, at, along, ends)
            if not bounced():
                break
        yield from self.catch(world)

    def predict(self, world: World) -> list[Way]:
        """The ball's ways from its present state on."""
        spin, velocity = world.velocity("ball")[:3], world.velocity("ball")[3:]
        surface, level = np.cross(spin, self.ball.radius * UP), np.array([1.0, 1.0, 0.0])
        return self.ways(world.com("ball"), velocity * level, surface * level)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        plans = {
            "go_to_where_it_is": Shortcut(self._go_to_it),
            "follow_it": Shortcut(lambda world: self.follow(world, lambda: world.velocity("ball")[3:])),
            "expect_it_where_it_came_from": Shortcut(self._expect_back),
        }
        if self.mirror_miss > 0.06:  # [m]; nearer to the mirror image, the hand might still catch the ball
            plans["expect_a_mirror_image"] = Shortcut(self._mirror)
        return plans

    def _go_to_it(self, world: World) -> Plan:
        """Pick the ball at the place where it starts to move."""
        yield from self.observe(world)
        yield from self.pick_at(world, world.com("ball"))

    def _expect_back(self, world: World) -> Plan:
        """Wait where the ball was launched, and close when it comes nearest."""
        yield from self.observe(world)
        at = np.array([*self.start[:2], self.grip])

        def near() -> bool:
            ball = world.com("ball")
            ahead = float((at - ball)[:2] @ world.velocity("ball")[3:5])
            return bool(world.memory["bounces"]) and ahead < self.speed**2 * self.closing_time

        yield from self.wait_at(world, at, self.u, near)
        yield from self.catch(world)

    def _mirror(self, world: World) -> Plan:
        """Wait where a wall without loss would return the ball to, and close when it would arrive there."""
        yield from self.observe(world)
        found = self.meeting(self._ways_after_launch(1.0), world.arm.hand)
        if found is None:
            raise GaveUp("the hand comes too late to every place on the way of a mirror image")
        due = world.time + found[1]
        along = way_at(self._ways_after_launch(1.0), found[1])[1].velocity
        yield from self.wait_at(world, found[0], along, lambda: due - world.time <= self.closing_time)
        yield from self.catch(world)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Without walls the ball does not come back."""
        scene = self.build()
        for geom in list(scene.body("enclosure").geoms):
            scene.delete(geom)
        return {"no_walls": scene}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        ways, motion = self._ways_after_launch(), ("aim", "speed", "enclosure", "friction", "side")
        meeting = self.meeting(ways, self.parked_hand)
        found = {"bounces": choice(len(ways) - 1, *motion)}
        if meeting is None:
            return found
        side = choice(side_of(meeting[0][1]), *motion)
        return found | {"catch": near(meeting[0], 0.020, *motion), "side_of_the_catch": side}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        width, placed = 2 * self.ball.radius, self.placed
        yield on_table("the ball", self.start, EDGE_MARGIN)
        yield on_table("the enclosure", placed.outline)
        yield require(width <= jaw.OPENING - 0.01, "the ball is too wide for the jaw", width=width, jaw=jaw.OPENING)
        inside = placed.inside(self.start)[0]
        yield require(inside < -self.ball.radius, "the ball starts between the walls", inside=inside)
        ways = self._ways_after_launch()
        yield require(len(ways) > 1, "the ball meets no wall", aim=self.aim)
        slowest = min(float(np.linalg.norm(way.velocity)) for way in ways)
        yield require(slowest > 0.05, "the ball comes back too slowly", speed=slowest)
        met = self.meeting(ways, PARKED_HAND, lead=2.5 * LEAD_TIME)
        late = "the hand comes too late to every place on the ball's way"
        yield require(met is not None, late, speed=self.speed, hand=HAND_SPEED)
        until = [way for way in ways if way.starts < (met[1] if met else math.inf)]
        nearest = min(*(float(placed.inside(way.at)[0]) for way in until[1:]), *map(placed.end_distance, until))
        # In a corner two walls return the ball one after the other or at once, each a separate part of the velocity.
        yield require(nearest >= width, "the ball meets the end of a wall", nearest=max(nearest, -1.0), near=width)

    def features(self) -> Mapping[str, float]:
        """Speed of the ball over that of the hand before the first and after the last wall, angle between its path and
        the mirror image [rad], number of bounces, and angle at which it meets the first wall [rad]."""
        ways = self._ways_after_launch()
        first = ways[1].velocity if len(ways) > 1 else ways[0].velocity
        image = self._ways_after_launch(1.0)[min(1, len(ways) - 1)].velocity
        return {
            "speed_over_hand": self.speed / HAND_SPEED,
            "left_over_hand": float(np.linalg.norm(ways[-1].velocity)) / HAND_SPEED,
            "off_mirror": abs(math.remainder(polar(first)[0] - polar(image)[0], 2 * math.pi)),
            "bounces": float(len(ways) - 1),
            "bearing": math.radians(self.aim - self.turn),
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "place": way_to(self.start, np.zeros(3)),
            "robot": math.dist(self.start[:2], BASE[:2]),
            "width": self.enclosure.width,
            "turn": abs(self.turn),
        }

    # --- mechanics and geometry ---------------------------------------------------------------

    def meeting(
        self, ways: Sequence[Way], hand: Vec3, lead: float = LEAD_TIME, bounced: bool = False
    ) -> tuple[Vec3, float] | None:
        """Place at which the ball is met after a bounce [m], and the time until it is there [s]; None if there is none.

        It is the first place where the hand arrives in time. After a bounce the hand is there, or nearly so: then it
        is the nearest.

        Args:
            ways: of the ball from now on, in the world.
            hand: place of the hand [m].
            lead: time by which the hand must arrive before the ball [s].
            bounced: whether the first way already starts at a wall.
        """
        times, placed = np.arange(0.0, FORESIGHT_TIME, 0.05), self.placed
        passed = np.array([place_on(ways, t)[:2] for t in times])

        def path(seconds: float) -> Vec3 | None:
            k, now = way_at(ways, seconds)
            ends = ways[k + 1].starts if k + 1 < len(ways) else math.inf
            # The ball can be taken from 0.10 s after a bounce until 0.15 s before the next one.
            if (k == 0 and not bounced) or seconds < now.starts + 0.10 * (k > 0) or seconds > ends - 0.15:
                return None
            at = place_on(ways, seconds)
            # The hand may come there up to 2 s before the ball's last way; earlier ways must pass 0.10 m beside it.
            earlier = passed[(times > now.starts - 2.0) & (times < now.starts)]
            if len(earlier) and np.hypot(*(earlier - at[:2]).T).min() < 0.10:
                return None
            return None if placed.wall_distance(at) < 0.085 else at  # half the width of an open hand, and a clearance

        def turn(seconds: float) -> float:
            _, now = way_at(ways, seconds)
            return abs(math.remainder(polar(now.velocity)[0] - polar(BASE - self.start)[0], math.pi))

        found = self.meetings(path, hand, turn, 0.0 if bounced else lead)
        return min(found, key=lambda one: math.dist(one[0], hand), default=None) if bounced else next(found, None)

    def ways(self, at: Vec3, velocity: Vec3, surface: Vec3, restitution: float | None = None) -> list[Way]:
        """The ball's ways from a state on, in the world; see `PlacedEnclosure.ways`."""
        return self.placed.ways(at, velocity, surface, self.ball.radius, self.friction, restitution)

    def _ways_after_launch(self, restitution: float | None = None) -> list[Way]:
        """The ball's ways from the moment at which its motion is known."""
        velocity = self.speed * self.u
        at = self.start + OBSERVATION_TIME * velocity
        return self.ways(at, velocity, velocity * bool(self.friction), restitution)

    @cached_property
    def mirror_miss(self) -> float:
        """Distance of the ball from a hand that waits for its mirror image, when the image would arrive [m]."""
        found = self.meeting(self._ways_after_launch(1.0), PARKED_HAND)
        return math.inf if found is None else math.dist(found[0][:2], place_on(self._ways_after_launch(), found[1])[:2])

    @cached_property
    def placed(self) -> PlacedEnclosure:
        """The enclosure in its place, beyond the middle of the table."""
        return PlacedEnclosure.about(self.enclosure, np.array([0.10, 0.0, self.floor]), self.turned)

    @cached_property
    def turned(self) -> float:
        """Angle by which the enclosure is turned to the left, `side` included [rad]."""
        return self.side * math.radians(self.turn)

    @property
    def u(self) -> Vec3:
        return heading(self.side * self.aim)

    @property
    def start(self) -> Vec3:
        return np.array([self.x, self.side * self.y, self.floor + self.ball.radius])

    @cached_property
    def floor(self) -> float:
        """Height of the mat [m]."""
        return TABLE_TOP + MAT_SIZE[2]
