"""Base of the tasks in which a ball is launched and caught (T12, T13): launch, goal, and moves that meet the ball.

The means are the plan of the paper: position the gripper at the predicted place, close it as the ball arrives.

* The hand waits for the ball. From the moment at which `may_move` becomes false until the first touch, it moves by at
  most 25 mm, seen from above; the oracle moves by 0 to 23 mm. A hand that followed the ball caught 10 of 12 in T12 and
  8 of 12 in T13.
* The first touch is the catch: within 0.1 s the ball is between the pads. The oracle needs 0.07 s at most, also in
  jittered runs. Closed fingers that stopped the ball picked it up at rest in 12 of 12.
"""

import abc
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import ClassVar

import numpy as np

from ..assets.ball import Ball
from ..assets.enclosure import Way
from ..assets.prop import TABLE_HALF, TABLE_TOP
from ..control.loop import Loop
from ..geometry import UP, Vec3, between
from ..means import Mean, throughout, when
from ..predicates import fallen, held
from ..robots import jaw
from ..robots.panda import BASE
from ..scenario import Plan, Scenario
from ..sim.arm import ROBOT
from ..sim.world import World
from ..skills.jaw import grasp, pick
from ..skills.motion import COARSE, OPEN, Condition, closing_along, go_to, hold, retreat, stay, steer, until

MIN_LIFT = 0.04
"""Height of the ball's centre above its height on the table at which it counts as lifted [m]: robosuite Lift,
`_check_success`."""
HAND_SPEED = 0.28  # largest speed of the hand along one axis [m/s]; measured
HAND_TURN_RATE = 1.2  # rate at which the hand turns on its way [rad/s]; measured
PARKED_HAND: Vec3 = np.array([-0.05, 0.0, TABLE_TOP + 0.10])  # place where the hand waits until the ball rolls [m]
SETTLING_TIME = 0.8  # time that the hand needs besides its way, to come down and stand still [s]
LEAD_TIME = 0.1  # time by which the hand arrives before the ball [s]
APPROACH_HEIGHT = 0.06  # height from which the hand comes down, so that nothing strikes the ball [m]
MIN_DISTANCE = 0.40  # smallest distance from the robot's first axis at which the ball is taken [m]
MAX_DISTANCE = 0.74  # largest distance from the robot's first axis at which the ball is taken [m]
EDGE_MARGIN = 0.03  # distance from the table's edge within which no ball is taken [m]
FORESIGHT_TIME = 6.0  # time ahead in which a meeting is looked for [s]
OBSERVATION_TIME = 0.05  # time after the launch from which the motion of the ball is known [s]
ARRIVAL_TOLERANCE = 0.02  # distance from its place, or from the ball, within which the hand comes down [m]
CATCH_TOLERANCE = 0.008  # level distance from a ball that it follows, within which the hand closes [m]
DIRECT_DISTANCE = 0.08  # distance up to which the hand goes straight to a place, not from above [m]
DIRECT_TIME = 0.10  # time that the hand needs besides such a straight way [s]
MIN_CLEARANCE = 0.006  # gap between finger tips and table, and between palm and ball [m]
WAITING_TOLERANCE = 0.025  # level distance by which a hand that waits may move [m]
ARRIVAL_TIME = 0.1
"""Time from the first touch within which a jaw that closes as the ball arrives has it between the pads [s]. The oracle
needs up to 0.07 s. A jaw that starts to close at the touch needs 0.14 s."""
PAD_TOLERANCE = 0.015  # largest distance of the centre of a ball between the pads from the grip site [m]
GAP_TOLERANCE = 0.004  # largest difference between the gap of a jaw that holds the ball and the ball's width [m]
MEMORY = ("place_x", "place_y", "moved", "first_touch", "caught")
"""Names of what `watch` remembers: place at which the hand waits, from above [m], distance from it at the first touch
of the ball [m], time of that touch [s], and whether the ball has been between the pads."""


class LaunchedBall(Scenario):
    """A ball that is launched over the table at some moment. Subclasses are dataclasses with these parameters."""

    HOLD: ClassVar[float] = 0.3
    MOVING: ClassVar[tuple[str, ...]] = ("ball",)

    speed: float
    launch: float
    ball: Ball

    def pending(self, world: World) -> bool:
        return world.time < self.launch + Loop.PERIOD / 2

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return world.com("ball")[2] - self.start[2] >= MIN_LIFT and held(world, "ball")

    def failure(self, world: World) -> str | None:
        return "the ball rolled off the table" if fallen(world, "ball") else None

    def watch(self, world: World) -> None:
        """Remember where the hand waits, and when it has touched and caught the ball. For `events`."""
        memory, hand = world.memory, world.arm.hand
        if self.may_move(world):
            memory["place_x"], memory["place_y"] = hand[0], hand[1]
        if not memory["first_touch"] and world.touched(ROBOT, "ball"):
            memory["first_touch"] = world.time
            memory["moved"] = math.hypot(hand[0] - memory["place_x"], hand[1] - memory["place_y"])
        if self.between_pads(world):
            memory["caught"] = 1.0

    @abc.abstractmethod
    def may_move(self, world: World) -> bool:
        """Whether the hand may still choose its place. It waits at the last place at which this was true."""

    def between_pads(self, world: World) -> bool:
        """Whether the ball is between the pads of the jaw, and the jaw is as wide as the ball."""
        inside = math.dist(world.com("ball"), world.arm.hand) < PAD_TOLERANCE
        closed = abs(world.arm.gap - 2 * self.ball.radius) < GAP_TOLERANCE
        return inside and closed and world.touching(ROBOT, "ball")

    def means(self) -> Mapping[str, Mean]:
        def met(world: World) -> bool:
            first = world.memory["first_touch"]
            return first > 0.0 and world.time - first >= ARRIVAL_TIME

        return {
            "the hand waited for the ball": throughout(lambda world: world.memory["moved"] <= WAITING_TOLERANCE),
            "the jaw closed as the ball arrived": when(met, lambda world: world.memory["caught"] > 0.0),
        }

    # --- moves ----------------------------------------------------------------------------

    def observe(self, world: World) -> Plan:
        """Wait at the middle of the table, with the jaw open, until the ball rolls."""
        rot = closing_along(world.arm, np.cross(UP, BASE - self.start))

        def rolls() -> bool:
            return world.time > self.launch + OBSERVATION_TIME

        yield from until(go_to(world.arm, self.parked_hand, rot, COARSE, OPEN), rolls)
        yield from until(hold(world.arm, FORESIGHT_TIME, OPEN), rolls)

    def wait_at(self, world: World, at: Vec3, along: Vec3, ends: Condition) -> Plan:
        """Bring the open jaw to a place, its fingers on either side of a path, and keep it there.

        Args:
            at: the place [m].
            along: direction of the path.
            ends: condition that ends the move.
        """
        arm, above, rot = world.arm, at + APPROACH_HEIGHT * UP, closing_along(world.arm, np.cross(UP, along))
        if math.dist(arm.hand, at) > DIRECT_DISTANCE:

            def over_place() -> bool:
                return ends() or math.dist(arm.hand, above) < ARRIVAL_TOLERANCE

            yield from stay(arm, above, rot, over_place, COARSE, OPEN)
        yield from stay(arm, at, rot, ends, grip=OPEN)

    def catch(self, world: World) -> Plan:
        """Close the jaw and lift its content."""
        yield from grasp(world.arm)
        yield from retreat(world.arm)

    def pick_at(self, world: World, at: Vec3) -> Plan:
        """Pick the ball from a given place."""
        yield from pick(world.arm, [at[0], at[1], self.grip], np.cross(UP, self.u), APPROACH_HEIGHT)

    def follow(self, world: World, along: Callable[[], Vec3]) -> Plan:
        """Follow the ball, and close when it is between the fingers.

        Args:
            along: gives the direction of its path.
        """
        yield from self.observe(world)
        arm = world.arm
        while world.com("ball")[2] > TABLE_TOP:
            rot = closing_along(arm, np.cross(UP, along()))
            offset = world.com("ball") - arm.hand
            level_distance = math.hypot(offset[0], offset[1])
            if level_distance < CATCH_TOLERANCE and abs(offset[2]) < ARRIVAL_TOLERANCE:
                yield from self.catch(world)
                return
            aim = world.com("ball") + (APPROACH_HEIGHT * UP if level_distance > ARRIVAL_TOLERANCE else 0.0)
            yield steer(arm, aim, np.zeros(3), between(arm.hand_rot, rot), OPEN)

    # --- foresight --------------------------------------------------------------------------

    def meetings(
        self,
        path: Callable[[float], Vec3 | None],
        hand: Vec3,
        turn: Callable[[float], float],
        lead: float = LEAD_TIME,
    ) -> Iterator[tuple[Vec3, float]]:
        """Places on the ball's path where the hand arrives in time [m], each with the time until the ball is there [s].

        Args:
            path: gives the ball's place after a time [m], None where it cannot be taken.
            hand: place of the hand [m].
            turn: gives the angle by which the hand must turn to have its fingers on either side of the path [rad].
            lead: time by which the hand must arrive before the ball [s].
        """
        for seconds in np.arange(0.0, FORESIGHT_TIME, 0.02):
            if (at := path(float(seconds))) is None:
                continue
            at = np.array([at[0], at[1], self.grip])
            distance = math.hypot(at[0] - BASE[0], at[1] - BASE[1])
            if not (MIN_DISTANCE < distance < MAX_DISTANCE and max(abs(at[0]), abs(at[1])) < TABLE_HALF - EDGE_MARGIN):
                continue
            if self.travel_time(hand, at, turn(seconds)) + lead + self.closing_time < seconds:
                yield at, float(seconds)

    def travel_time(self, hand: Vec3, at: Vec3, turn: float) -> float:
        """Time that the hand needs to reach a place and stand still there [s].

        Args:
            hand: place of the hand [m].
            at: the place [m].
            turn: angle by which the hand must turn [rad].
        """
        if (way := math.dist(at, hand)) < DIRECT_DISTANCE:
            return way / HAND_SPEED + DIRECT_TIME
        return max(math.dist(at + APPROACH_HEIGHT * UP, hand) / HAND_SPEED, turn / HAND_TURN_RATE) + SETTLING_TIME

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def closing_time(self) -> float:
        """Time from the command until the jaw touches the ball [s]."""
        return jaw.time_to_touch(2 * self.ball.radius)

    @cached_property
    def grip(self) -> float:
        """Height of the grip site when the hand takes the ball [m]: finger tips over the floor, palm over the ball."""
        centre, palm = self.ball.radius, 2 * self.ball.radius - jaw.PALM_ABOVE
        return self.floor + max(centre, palm + MIN_CLEARANCE, jaw.TIP_BELOW + MIN_CLEARANCE)

    @cached_property
    def floor(self) -> float:
        """Height of the surface on which the ball lies [m]."""
        return TABLE_TOP

    @cached_property
    def parked_hand(self) -> Vec3:
        """Place where the hand waits until the ball rolls [m]."""
        return PARKED_HAND

    @property
    @abc.abstractmethod
    def u(self) -> Vec3:
        """Unit vector along the path after the launch."""

    @property
    @abc.abstractmethod
    def start(self) -> Vec3:
        """Centre of the ball at the start [m]."""


def way_at(ways: Sequence[Way], seconds: float) -> tuple[int, Way]:
    """Index of the way on which the ball is after a time [s], and the way."""
    k = max(k for k, way in enumerate(ways) if way.starts <= seconds)
    return k, ways[k]


def place_on(ways: Sequence[Way], seconds: float) -> Vec3:
    """Place of the ball after a time [m]."""
    _, way = way_at(ways, seconds)
    return way.at + (seconds - way.starts) * way.velocity
