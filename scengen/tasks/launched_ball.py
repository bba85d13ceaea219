"""What the two tasks with a ball that is launched and caught share (T12, T13): its launch, its goal, meeting it."""

import math
from collections.abc import Callable, Iterator
from typing import ClassVar

import numpy as np

from ..assets.ball import Ball
from ..assets.prop import TABLE_HALF, TABLE_TOP
from ..control.loop import Loop
from ..geometry import UP, Vec3, between, heading
from ..predicates import fallen, held
from ..robots import jaw
from ..robots.panda import BASE
from ..scenario import Plan, Scenario
from ..sim.world import World
from ..skills.jaw import grasp, pick
from ..skills.motion import COARSE, OPEN, Condition, closing_along, go_to, hold, retreat, stay, steer, until

LIFTED = 0.04
"""How far the ball's centre must rise above its height on the table [m]: robosuite Lift, `_check_success`."""
HAND_SPEED = 0.28
"""Of the hand along one axis, at most [m/s]; measured."""
HAND_TURN = 1.2
"""How fast the hand turns on its way [rad/s]; measured."""
READY: Vec3 = np.array([-0.05, 0.0, TABLE_TOP + 0.10])
"""Where the hand waits until the ball rolls [m]."""
SETTLING, SPARE = 0.8, 0.1
"""What the hand needs besides its way, to come down and stand still, and how long before the ball it is there [s]."""
ABOVE = 0.06
"""Height over its place from which the hand comes down, so that nothing strikes the ball [m]."""
NEAREST, FARTHEST, EDGE = 0.40, 0.74, 0.03
"""Where the ball is taken: its distance from the robot's first axis, and from the table's edge [m]."""
LONGEST = 6.0
"""How far ahead a meeting is looked for [s]."""
SEEN = 0.05
"""How long after its launch it is known how the ball rolls [s]."""
BESIDE, CAUGHT = 0.02, 0.008
"""How near the hand is to being over its place, or the ball, when it comes down; and to a ball that it goes after, when
it closes [m]."""
NEAR, SHIFTING = 0.08, 0.10
"""So near to a place the hand goes there straight, not from above [m], and how long it needs besides its way [s]."""
AIR = 0.006
"""Between finger tips and table, and between palm and ball [m]."""


class LaunchedBall(Scenario):
    """A ball that is launched over the table at some moment. Subclasses are dataclasses with these parameters."""

    HOLD: ClassVar[float] = 0.3
    MOVING: ClassVar[tuple[str, ...]] = ("ball",)

    x: float
    y: float
    heading: float
    speed: float
    launch: float
    ball: Ball

    def pending(self, world: World) -> bool:
        return world.time < self.launch + Loop.PERIOD / 2

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return world.com("ball")[2] - self.start[2] >= LIFTED and held(world, "ball")

    def failure(self, world: World) -> str | None:
        return "the ball rolled off the table" if fallen(world, "ball") else None

    # --- moves ----------------------------------------------------------------------------

    def look(self, world: World) -> Plan:
        """Be ready over the middle of the table, with the jaw open, until the ball rolls."""
        rot = closing_along(world.arm, np.cross(UP, BASE - self.start))

        def rolls() -> bool:
            return world.time > self.launch + SEEN

        yield from until(go_to(world.arm, READY, rot, COARSE, OPEN), rolls)
        yield from until(hold(world.arm, LONGEST, OPEN), rolls)

    def wait_at(self, world: World, at: Vec3, along: Vec3, ends: Condition) -> Plan:
        """Bring the open jaw to a place, its fingers on either side of a path, and keep it there.

        Args:
            along: direction of the path.
        """
        arm, over, rot = world.arm, at + ABOVE * UP, closing_along(world.arm, np.cross(UP, along))
        if math.dist(arm.hand, at) > NEAR:
            yield from stay(arm, over, rot, lambda: ends() or math.dist(arm.hand, over) < BESIDE, COARSE, OPEN)
        yield from stay(arm, at, rot, ends, grip=OPEN)

    def catch(self, world: World) -> Plan:
        """Close the jaw and lift what is in it."""
        yield from grasp(world.arm)
        yield from retreat(world.arm)

    def pick_at(self, world: World, at: Vec3) -> Plan:
        """Pick the ball from a place where it is taken to be."""
        yield from pick(world.arm, [at[0], at[1], self.grip], np.cross(UP, self.u), ABOVE)

    def follow(self, world: World, along: Callable[[], Vec3]) -> Plan:
        """Go after the ball where it is, and close when it is between the fingers.

        Args:
            along: direction of its path now.
        """
        yield from self.look(world)
        arm = world.arm
        while world.com("ball")[2] > TABLE_TOP:
            rot = closing_along(arm, np.cross(UP, along()))
            offset = world.com("ball") - arm.hand
            aside = math.hypot(offset[0], offset[1])
            if aside < CAUGHT and abs(offset[2]) < BESIDE:
                yield from self.catch(world)
                return
            aim = world.com("ball") + (ABOVE * UP if aside > BESIDE else 0.0)
            yield steer(arm, aim, np.zeros(3), between(arm.hand_rot, rot), OPEN)

    # --- foresight --------------------------------------------------------------------------

    def meetings(
        self,
        way: Callable[[float], Vec3 | None],
        hand: Vec3,
        turn: Callable[[float], float],
        spare: float = SPARE,
    ) -> Iterator[tuple[Vec3, float]]:
        """The places on the ball's path where the hand is in time, and when [s].

        Args:
            way: where the ball will be in so many seconds [m], None where it cannot be taken.
            hand: where the hand is [m].
            turn: by how much the hand must turn to have its fingers on either side of the path there [rad].
            spare: how long before the ball it is to be there [s].
        """
        for seconds in np.arange(0.0, LONGEST, 0.02):
            if (at := way(float(seconds))) is None:
                continue
            at = np.array([at[0], at[1], self.grip])
            distance = math.hypot(at[0] - BASE[0], at[1] - BASE[1])
            if not (NEAREST < distance < FARTHEST and max(abs(at[0]), abs(at[1])) < TABLE_HALF - EDGE):
                continue
            if (left := math.dist(at, hand)) < NEAR:
                there = left / HAND_SPEED + SHIFTING
            else:
                there = max(math.dist(at + ABOVE * UP, hand) / HAND_SPEED, turn(seconds) / HAND_TURN) + SETTLING
            if there + spare + self.closing < seconds:
                yield at, float(seconds)

    # --- geometry -------------------------------------------------------------------------

    @property
    def closing(self) -> float:
        """How long the jaw takes from the command until it touches the ball [s]."""
        return jaw.time_to_touch(2 * self.ball.radius)

    @property
    def grip(self) -> float:
        """Height of the grip site of a hand that takes the ball [m]: finger tips over the floor, palm over the ball."""
        centre, palm = self.ball.radius, 2 * self.ball.radius - jaw.PALM_ABOVE
        return self.floor + max(centre, palm + AIR, jaw.TIP_BELOW + AIR)

    @property
    def floor(self) -> float:
        """Height of what the ball lies on [m]."""
        return TABLE_TOP

    @property
    def u(self) -> Vec3:
        """Unit vector along the path after the launch."""
        return heading(self.heading)

    @property
    def start(self) -> Vec3:
        """Centre of the ball at the start [m]."""
        return np.array([self.x, self.y, self.floor + self.ball.radius])
