"""T13 bounce-intercept: catch a ball that comes back from the walls.

     ___________________
    |         . o       |
    |       .     .     |        The walls stand away from the robot and are open towards it. The ball is launched at
    |     .         .   |        the back wall; it leaves every wall with a part of the speed with which it came.
    |   .             . |
      .             .
     o            .          robot

Bottleneck: the ball is faster than the hand, and where it can be caught follows from where it is thrown back, and from
how much speed the wall leaves it. On a smooth floor it is the mirror image no more: the wall keeps a sixth of the speed
along its normal, and nothing of that along it.

Decisions, where the paper (App. B, T13) is silent:

* The floor is a smooth mat, on which the ball slides without turning. A ball that rolls keeps its spin in the bounce,
  slips, and ends with 2/7 of the speed before and 5/7 of that after it: no mirror image at all. That is an axis.
* The walls keep 12 to 20 % of the speed in training, like fresh cushions; a bounce takes 22 ms.
* The hand may be anywhere, also between the walls, but whoever touches the ball before a wall did has lost: to catch it
  before it is thrown back is another task (T12). Above the table is 4 cm higher than before, as there.

* Aims, places and both sides are drawn so widely that no place serves many: after a bounce, 16 % of the balls come
  within 20 mm of the best one, between open fingers that are turned the right way there.

The oracle looks again after every bounce: what a wall leaves of the speed depends on when in a time step it is met.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from ..assets.ball import Ball
from ..assets.enclosure import LASTS, Enclosure, Way
from ..assets.prop import PRIORITY, TABLE_TOP, place, solid, table
from ..errors import GaveUp
from ..geometry import UP, Vec3, about_z, corners, polar
from ..params import param
from ..physics import GRAVITY, SPIN, slipping
from ..robots import jaw
from ..robots.panda import BASE
from ..scenario import Plan, Refutation, Shortcut, on_table, require
from ..sim.memory import remember
from ..sim.world import ROBOT, World
from .launched_ball import EDGE, HAND_SPEED, LONGEST, READY, SEEN, SPARE, LaunchedBall

MIDDLE = 0.10
"""How far before the middle of the table the middle of the enclosure is [m]."""
MAT = (0.39, 0.39, 0.002)
"""Half length, half width and height of the mat [m]."""
ROOM = 0.085
"""From the place of an open hand to the walls at least [m]: half its width, and some air."""
APART = 0.10
"""From that place to any way on which the ball comes by before, at least [m]."""
COMING = 2.0
"""How long before the ball's last way the hand may have come there [s]."""
AFTER, BEFORE = 0.10, 0.15
"""How long after a bounce and before the next one it can be taken [s]."""
ENDS = 2.0
"""How far from the end of a wall it must meet that wall or pass it before it is caught, in radii. In a corner two walls
throw it back one after the other, or at once: each takes its own part of the velocity."""
MIRRORED = 0.06
"""How far beside the place of a mirror image the ball must pass, so that the hand misses it [m]."""
SLOWEST = 0.05
"""Speed below which a ball is not waited for [m/s]."""

LEVEL: Vec3 = np.array([1.0, 1.0, 0.0])
"""Leaves of a vector what is level."""


@dataclass(frozen=True, kw_only=True)
class BounceIntercept(LaunchedBall):
    """A ball that is launched between three walls."""

    side: int = param(1, "1 to the left, -1 to the right", -1, 1)
    """Where the ball is launched to; `y`, `aim` and `turn` are mirrored with it."""
    x: float = param(-0.12, "m", -0.36, 0.36)
    y: float = param(-0.15, "m", -0.36, 0.36)
    aim: float = param(35.0, "deg", -90.0, 90.0)
    """Direction of the launch; 0 is away from the robot, 90 to its left."""
    speed: float = param(0.32, "m/s", 0.08, 0.8)
    launch: float = param(0.8, "s", 0.3, 2.0)
    """When."""
    turn: float = param(0.0, "deg", -30.0, 30.0)
    """Of the enclosure, to the left."""
    friction: float = param(0.0, "1", 0.0, 0.6)
    """Of the mat; where there is any, the ball rolls."""
    ball: Ball = Ball(radius=0.020, density=1200.0, friction=0.6, rgba=(0.90, 0.35, 0.10, 1.0))
    enclosure: Enclosure = Enclosure()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        mat = scene.worldbody.add_body(name="mat", pos=[0.0, 0.0, TABLE_TOP + MAT[2] / 2])
        size = [MAT[0], MAT[1], MAT[2] / 2]
        smooth = {"friction": self.friction, "condim": 3 if self.friction else 1, "priority": PRIORITY + 1}
        solid(mat, "mat", size, rgba=(0.30, 0.33, 0.38, 1.0), **smooth)
        place(scene, self.enclosure, "enclosure", self.mouth, self.turned, free=False)
        place(scene, self.ball, "ball", self.start)
        remember(scene, "bounces", "at_wall")
        return scene

    def events(self, world: World) -> None:
        if world.passes(self.launch):
            spin = self.speed / self.ball.radius if self.friction else 0.0
            world.launch("ball", self.speed * self.u, spin * np.cross(UP, self.u))
        at_wall = world.touching("enclosure", "ball")
        world.memory["bounces"] += at_wall and not world.memory["at_wall"]
        world.memory["at_wall"] = float(at_wall)

    # --- goal -----------------------------------------------------------------------------

    def failure(self, world: World) -> str | None:
        if world.touching(ROBOT, "ball") and not world.memory["bounces"]:
            return "the robot touched the ball before it was thrown back"
        return super().failure(world)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """See how the ball moves, wait where it comes by, look again after every bounce, close before it is there."""
        yield from self.look(world)
        yield from self.take(world, self.closing)

    def take(self, world: World, lead: float) -> Plan:
        """Meet the ball, and close `lead` [s] before it is there.

        Raises:
            GaveUp: the hand comes too late to every place.
        """
        while True:
            bounces, ways, now = world.memory["bounces"], self.foresee(world), world.time
            if (found := self.met(ways, world.arm.hand, thrown=bounces > 0)) is None:
                raise GaveUp("the hand comes too late to every place on the ball's way")
            at, due = found[0], now + found[1]
            along = on(ways, found[1])[1].velocity

            def again(bounces: float = bounces) -> bool:
                return bool(world.memory["bounces"] > bounces and not world.memory["at_wall"])

            yield from self.wait_at(world, at, along, lambda due=due, again=again: again() or due - world.time <= lead)
            if not again():
                break
        yield from self.catch(world)

    def foresee(self, world: World) -> list[Way]:
        """The ways of the ball as it moves now."""
        spin, velocity = world.velocity("ball")[:3], world.velocity("ball")[3:]
        turns = np.cross(spin, self.ball.radius * UP)
        return self.ways(world.com("ball"), velocity * LEVEL, turns * LEVEL)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        plans = {
            "go_to_where_it_is": Shortcut(self._go_to_it),
            "follow_it": Shortcut(lambda world: self.follow(world, lambda: world.velocity("ball")[3:])),
            "expect_it_where_it_came_from": Shortcut(self._expect_back),
        }
        if self.beside_mirror > MIRRORED:
            plans["expect_a_mirror_image"] = Shortcut(self._mirror)
        return plans

    def _go_to_it(self, world: World) -> Plan:
        """Pick the ball where it is when it begins to move."""
        yield from self.look(world)
        yield from self.pick_at(world, world.com("ball"))

    def _expect_back(self, world: World) -> Plan:
        """Wait where it was launched, and close when it comes nearest."""
        yield from self.look(world)
        at = np.array([*self.start[:2], self.grip])

        def near() -> bool:
            ball = world.com("ball")
            left = float((at - ball)[:2] @ world.velocity("ball")[3:5])
            return bool(world.memory["bounces"]) and left < self.speed**2 * self.closing

        yield from self.wait_at(world, at, self.u, near)
        yield from self.catch(world)

    def _mirror(self, world: World) -> Plan:
        """Wait where a wall that keeps nothing would throw it, when it would be there."""
        yield from self.look(world)
        found = self.met(self._foreseen(1.0), world.arm.hand)
        if found is None:
            raise GaveUp("the hand comes too late to every place on the way of a mirror image")
        due = world.time + found[1]
        along = on(self._foreseen(1.0), found[1])[1].velocity
        yield from self.wait_at(world, found[0], along, lambda: due - world.time <= self.closing)
        yield from self.catch(world)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Without walls nothing comes back."""
        scene = self.build()
        for geom in list(scene.body("enclosure").geoms):
            scene.delete(geom)
        return {"no_walls": scene}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        width, enclosure = 2 * self.ball.radius, self.enclosure
        yield on_table("the ball", self.start, EDGE)
        middle = self.mouth + enclosure.depth / 2 * about_z(self.turned)[:, 0]
        yield on_table("the enclosure", corners(middle, self.turned, enclosure.size))
        yield require(width <= jaw.OPENING - 0.01, "the ball is too wide for the jaw", width=width, jaw=jaw.OPENING)
        seen = self._seen(self.start)
        yield require(seen[0] < -self.ball.radius, "the ball starts between the walls", inside=seen[0])
        ways = self._foreseen()
        yield require(len(ways) > 1, "the ball meets no wall", aim=self.aim)
        slowest = min(float(np.linalg.norm(way.velocity)) for way in ways)
        yield require(slowest > SLOWEST, "the ball comes back too slowly", speed=slowest)
        met = self.met(ways, READY, spare=2.5 * SPARE)
        late = "the hand comes too late to every place on the ball's way"
        yield require(met is not None, late, speed=self.speed, hand=HAND_SPEED)
        until = [way for way in ways if way.begins < (met[1] if met else math.inf)]
        nearest = min(*(float(self._seen(way.at)[0]) for way in until[1:]), *map(self._beside_ends, until))
        near = ENDS * self.ball.radius
        yield require(nearest >= near, "the ball meets the end of a wall", nearest=max(nearest, -1.0), near=near)

    def features(self) -> Mapping[str, float]:
        """The ball's speed before and after its walls as a share of the hand's, how far the wall turns its way off the
        mirror image [rad], how often it is thrown back, and how steeply it meets the first wall [rad]."""
        ways = self._foreseen()
        first = ways[1].velocity if len(ways) > 1 else ways[0].velocity
        image = self._foreseen(1.0)[min(1, len(ways) - 1)].velocity
        return {
            "speed_over_hand": self.speed / HAND_SPEED,
            "left_over_hand": float(np.linalg.norm(ways[-1].velocity)) / HAND_SPEED,
            "off_mirror": abs(math.remainder(polar(first)[0] - polar(image)[0], 2 * math.pi)),
            "bounces": float(len(ways) - 1),
            "bearing": math.radians(self.aim - self.turn),
        }

    # --- mechanics and geometry ---------------------------------------------------------------

    def met(
        self, ways: Sequence[Way], hand: Vec3, spare: float = SPARE, thrown: bool = False
    ) -> tuple[Vec3, float] | None:
        """The place where the ball is met after a bounce, and when [s]: the first where the hand is in time.

        Once it has been thrown back, the hand is there already, or nearly: then it is the nearest.

        Args:
            ways: of the ball from now on, in the world.
            hand: where the hand is [m].
            spare: how long before the ball it is to be there [s].
            thrown: whether the first of them already begins at a wall.
        """

        times = np.arange(0.0, LONGEST, 0.05)
        passed = np.array([place_on(ways, t)[:2] for t in times])

        def way(seconds: float) -> Vec3 | None:
            k, now = on(ways, seconds)
            ends = ways[k + 1].begins if k + 1 < len(ways) else math.inf
            if (k == 0 and not thrown) or seconds < now.begins + AFTER * (k > 0) or seconds > ends - BEFORE:
                return None
            at = place_on(ways, seconds)
            by = passed[(times > now.begins - COMING) & (times < now.begins)]
            if self._to_walls(at) < ROOM or (len(by) and np.hypot(*(by - at[:2]).T).min() < APART):
                return None
            return at

        def turn(seconds: float) -> float:
            _, now = on(ways, seconds)
            return abs(math.remainder(polar(now.velocity)[0] - polar(BASE - self.start)[0], math.pi))

        found = self.meetings(way, hand, turn, 0.0 if thrown else spare)
        return min(found, key=lambda one: math.dist(one[0], hand), default=None) if thrown else next(found, None)

    def ways(self, at: Vec3, velocity: Vec3, turns: Vec3, restitution: float | None = None) -> list[Way]:
        """The ball's ways from a state on, in the world.

        Args:
            at: where it is [m].
            velocity: of it [m/s], level.
            turns: of its surface about its centre [m/s]: as the velocity if it rolls, 0 if it does not turn.
            restitution: of the walls, if they had another one.
        """
        axes, found, begins = about_z(self.turned), [], 0.0
        while True:
            if self.friction:
                at, velocity, turns = self._rolls(at, velocity, turns)
            seen = axes.T @ (at - self.mouth), axes.T @ velocity
            ways = self.enclosure.ways(*seen, self.ball.radius, restitution)
            ways = [Way(begins + w.begins, self.mouth + axes @ w.at, axes @ w.velocity) for w in ways]
            if not self.friction or len(ways) == 1:
                return found + ways
            found.append(ways[0])
            begins, at, velocity = ways[1]
            turns = self._turned(velocity, turns)

    def _turned(self, velocity: Vec3, turns: Vec3) -> Vec3:
        """What a bounce leaves of the turning [m/s]: the wall is smooth, but the floor brakes it meanwhile."""
        slip = velocity - turns
        speed = math.sqrt(slip @ slip)
        return turns + min(1.0, self.friction * GRAVITY * LASTS / (SPIN * max(speed, 1e-9))) * slip

    def _rolls(self, at: Vec3, velocity: Vec3, turns: Vec3) -> tuple[Vec3, Vec3, Vec3]:
        """Where it would have to begin so as to roll from there, how fast, and how it turns: once it slips no more."""
        slip = velocity - turns
        if (speed := math.sqrt(slip @ slip)) < 1e-6:
            return at, velocity, turns
        seconds, left = slipping(speed, 0.0, self.friction)
        rolls = velocity - (1.0 - left / speed) * slip
        return at + seconds / 2 * (velocity - rolls), rolls, rolls

    def _foreseen(self, restitution: float | None = None) -> list[Way]:
        """The ball's ways from the moment on at which it is known how it moves."""
        velocity = self.speed * self.u
        return self.ways(self.start + SEEN * velocity, velocity, velocity * bool(self.friction), restitution)

    @property
    def beside_mirror(self) -> float:
        """How far a hand that waits for its mirror image is from the ball when that would be there [m]."""
        found = self.met(self._foreseen(1.0), READY)
        return math.inf if found is None else math.dist(found[0][:2], place_on(self._foreseen(), found[1])[:2])

    def _to_walls(self, at: Vec3) -> float:
        """How far a place is from the nearest wall [m]."""
        seen, wall = self._seen(at), self.enclosure
        beside = math.hypot(max(0.0, -seen[0]), wall.width / 2 - abs(seen[1]))
        return min(beside, wall.depth - seen[0])

    def _beside_ends(self, way: Way) -> float:
        """How far beside the ends of the side walls a way goes in [m]; inf if it does not."""
        at, velocity = self._seen(way.at), about_z(self.turned).T @ way.velocity
        if at[0] >= 0.0 or velocity[0] <= 0.0:
            return math.inf
        return self.enclosure.width / 2 - abs(float(at[1] - at[0] / velocity[0] * velocity[1]))

    def _seen(self, at: Vec3) -> Vec3:
        """A place as seen from the enclosure [m]."""
        return about_z(self.turned).T @ (at - self.mouth)

    @property
    def mouth(self) -> Vec3:
        """The middle of the opening [m]."""
        return np.array([MIDDLE, 0.0, self.floor]) - self.enclosure.depth / 2 * about_z(self.turned)[:, 0]

    @property
    def turned(self) -> float:
        """By how much the enclosure is turned to the left [rad]."""
        return self.side * math.radians(self.turn)

    @property
    def heading(self) -> float:
        """Where the ball is launched to [deg]."""
        return self.side * self.aim

    @property
    def start(self) -> Vec3:
        """Centre of the ball at the start [m]."""
        return np.array([self.x, self.side * self.y, self.floor + self.ball.radius])

    @property
    def floor(self) -> float:
        """Height of the mat [m]."""
        return TABLE_TOP + MAT[2]


def on(ways: Sequence[Way], seconds: float) -> tuple[int, Way]:
    """Number and way on which something is after a time [s]."""
    k = max(k for k, way in enumerate(ways) if way.begins <= seconds)
    return k, ways[k]


def place_on(ways: Sequence[Way], seconds: float) -> Vec3:
    """Where it is then [m]."""
    _, way = on(ways, seconds)
    return way.at + (seconds - way.begins) * way.velocity
