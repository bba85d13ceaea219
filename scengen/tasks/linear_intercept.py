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
from ..control.loop import Loop
from ..errors import GaveUp
from ..geometry import UP, Vec3, between, heading, polar, quat
from ..params import param
from ..physics import passes, rolled, rolling_slows
from ..predicates import fallen, held
from ..robots import jaw
from ..robots.panda import BASE
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require
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
PASSED, MISSES = 0.020, 0.05
"""How far a ball has rolled on that fingers do not get hold of any more, and how far beside a place that they do not
reach [m]."""
AIR = 0.006
"""Between finger tips and table, and between palm and ball [m]."""
BAR = (0.010, 0.10, 0.012)
"""Of the bar that stops the ball in the ablation: along its path, across it, up [m]. No hand that takes a ball comes so
low."""


@dataclass(frozen=True, kw_only=True)
class LinearIntercept(Scenario):
    """A ball that is launched over the table."""

    HOLD = 0.3
    MOVING = ("ball",)

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

    def pending(self, world: World) -> bool:
        return world.time < self.launch + Loop.PERIOD / 2

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return world.com("ball")[2] - self.start[2] >= LIFTED and held(world, "ball")

    def failure(self, world: World) -> str | None:
        return "the ball rolled off the table" if fallen(world, "ball") else None

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """See how the ball rolls, wait where it is going to be, close so that the fingers arrive when it does."""
        yield from self.take(world, self.closing)

    def take(self, world: World, lead: float) -> Plan:
        """Meet the ball, and close `lead` [s] before it is there."""
        yield from self.look(world)
        across = between(world.arm.hand_rot, closing_along(world.arm, np.cross(UP, self.u)))
        found = self.meeting(world.com("ball"), world.velocity("ball")[3:], world.arm.hand, math.sqrt(across @ across))
        if found is None:
            raise GaveUp("the hand comes too late to every place on the ball's path")
        at, _ = found
        yield from self.wait_at(world, at, lambda: self.left(world, world.arm.hand) <= lead)
        yield from grasp(world.arm)
        yield from retreat(world.arm)

    def look(self, world: World) -> Plan:
        """Be ready over the middle of the table, with the jaw open, until the ball rolls."""
        rot = closing_along(world.arm, np.cross(UP, BASE - self.start))

        def rolls() -> bool:
            return world.time > self.launch + SEEN

        yield from until(go_to(world.arm, READY, rot, COARSE, OPEN), rolls)
        yield from until(hold(world.arm, LONGEST, OPEN), rolls)

    def wait_at(self, world: World, at: Vec3, ends: Condition) -> Plan:
        """Bring the open jaw to a place, its fingers on either side of the ball's path, and keep it there."""
        arm, over, rot = world.arm, at + ABOVE * UP, closing_along(world.arm, np.cross(UP, self.u))
        yield from stay(arm, over, rot, lambda: ends() or math.dist(arm.hand, over) < BESIDE, COARSE, OPEN)
        yield from stay(arm, at, rot, ends, grip=OPEN)

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
            "follow_it": Shortcut(self._follow),
        }
        if self.speed * self.closing > PASSED:
            plans["close_when_it_is_there"] = Shortcut(lambda world: self.take(world, 0.0))
        if abs(self.beside_middle) > MISSES:
            plans["expect_it_in_the_middle"] = Shortcut(self._expect)
        return plans

    def _go_to_it(self, world: World) -> Plan:
        """Pick the ball where it is when it begins to roll."""
        yield from self.look(world)
        yield from self._pick_at(world, world.com("ball"))

    def _too_short(self, world: World) -> Plan:
        """Pick the ball where it will be after the time that the way there takes at full speed."""
        yield from self.look(world)
        ball, velocity, hand = world.com("ball"), world.velocity("ball")[3:], world.arm.hand
        times = np.arange(0.0, LONGEST, 0.02)
        late = [t - math.dist(ball + t * velocity, hand) / HAND_SPEED for t in times]
        yield from self._pick_at(
            world, ball + next(t for t, over in zip(times, late, strict=True) if over > 0) * velocity
        )

    def _pick_at(self, world: World, at: Vec3) -> Plan:
        yield from pick(world.arm, [at[0], at[1], self.grip], np.cross(UP, self.u), ABOVE)

    def _follow(self, world: World) -> Plan:
        """Go after the ball where it is, and close when it is between the fingers."""
        yield from self.look(world)
        arm, rot = world.arm, closing_along(world.arm, np.cross(UP, self.u))
        while world.com("ball")[2] > TABLE_TOP:
            offset = world.com("ball") - arm.hand
            aside = math.hypot(offset[0], offset[1])
            if aside < CAUGHT and abs(offset[2]) < BESIDE:
                yield from grasp(arm)
                yield from retreat(arm)
                return
            aim = world.com("ball") + (ABOVE * UP if aside > BESIDE else 0.0)
            yield steer(arm, aim, np.zeros(3), between(arm.hand_rot, rot), OPEN)

    def _expect(self, world: World) -> Plan:
        """Wait in the middle, where such balls come through, and close when it comes nearest."""
        yield from self.look(world)
        middle = np.array([0.0, 0.0, self.grip])
        yield from self.wait_at(world, middle, lambda: self.left(world, world.arm.hand) <= self.closing)
        yield from grasp(world.arm)
        yield from retreat(world.arm)

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
        met = self.meeting(seen, self.speed * self.u, READY, turn, 2.5 * SPARE)
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

    def meeting(
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
        for seconds in np.arange(SETTLING, LONGEST, 0.02):
            at = ball + rolled(speed, self.slowing, seconds) / speed * velocity
            at[2] = self.grip
            distance = math.hypot(at[0] - BASE[0], at[1] - BASE[1])
            if not (NEAREST < distance < FARTHEST and max(abs(at[0]), abs(at[1])) < TABLE_HALF - EDGE):
                continue
            there = max(math.dist(at + ABOVE * UP, hand) / HAND_SPEED, turn / HAND_TURN) + SETTLING
            if there + spare + self.closing < seconds:
                return at, float(seconds)
        return None

    @property
    def slowing(self) -> float:
        """How fast it loses speed [m/s^2]."""
        return rolling_slows(self.rolling)

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

    @property
    def closing(self) -> float:
        """How long the jaw takes from the command until it touches the ball [s]."""
        return jaw.time_to_touch(2 * self.ball.radius)

    @property
    def grip(self) -> float:
        """Height of the grip site of a hand that takes the ball [m]: finger tips over the table, palm over the ball."""
        centre, palm = self.ball.radius, 2 * self.ball.radius - jaw.PALM_ABOVE
        return TABLE_TOP + max(centre, palm + AIR, jaw.TIP + AIR)

    @property
    def u(self) -> Vec3:
        """Unit vector along the path."""
        return heading(self.heading)

    @property
    def start(self) -> Vec3:
        """Centre of the ball at the start [m]."""
        return np.array([self.x, self.y, TABLE_TOP + self.ball.radius])
