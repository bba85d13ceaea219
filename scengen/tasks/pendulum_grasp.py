"""T11 pendulum-grasp: take the bob of a swinging pendulum at a turning point, where it stands still for a moment.

                  =====o=====  axle
       arm            /|
        \\            / |          seen from the side; the plane of the swing is turned by `plane`
         \\ hand     /  |
          ---<     O   .          the hand looks along the path on which the bob comes
          turning point

Bottleneck: time. Twice in a period, and nowhere else, the bob is slow enough to be taken; the fingers need 0.13 s to
close, and so must set out before it has arrived.

Decisions, where the paper (App. B, T11) says "grasp the bob at the swing apex" and no more:

* At the apex means: no part of the robot touches the pendulum nearer to the middle than 98 % of the amplitude. Beyond,
  the bob is slower than a fifth of its greatest speed, for a sixteenth of the period, 0.08 s, at either end. Else a
  hand that bars the way would do, or one that brakes the bob and takes it then.
* One try: a jaw that closes farther than the bob is wide has missed, and the episode is lost. Else patience would do
  instead of insight: a jaw that opens and shuts without looking finds the bob between its fingers some time.
* The pendulum swings already when the episode begins, at any moment of its period: from the end of a swing, as the
  paper may have it, one fixed time would serve every scenario. Either turning point will do; the arm reaches one.
* The bob is grasped when it is between the pads of both fingers and as slow as the hand, for 0.3 s. Nothing has to be
  lifted: where it is held, it hangs askew, and falls when it is let go.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from ..assets.pendulum import Pendulum
from ..assets.prop import TABLE_TOP, place, table
from ..control.loop import Loop
from ..geometry import UP, Mat3, Vec3, between, corners, heading, polar
from ..params import param
from ..predicates import still
from ..robots import jaw
from ..robots.panda import BASE
from ..scenario import Answer, Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import ROBOT, World
from ..skills.jaw import grasp
from ..skills.motion import CLOSED, COARSE, FINE, OPEN, Pace, facing, go_to, hold, steer, until

BOB, HINGE = "pendulum/bob", "pendulum/hinge"
APEX = 0.98
"""Share of the amplitude from which on a place belongs to the turning point."""
BETWEEN = 0.012
"""Largest distance of the bob's centre from the grip site where it is between the pads [m], three quarters of a pad:
below the finger tips of a jaw that it does not fit into it is 17 mm away."""
SLOW = 0.05
"""Largest speed of a bob that is held [m/s]."""
MISSED = 0.9
"""Gap of a jaw that has closed on nothing, as a share of the bob's diameter. At 60 % a jaw that opened and shut
without looking took every fifth bob."""
TILT = 65.0
"""How far below the level the hand looks [deg]. At 30 it would look along the bob's path, but below 60 it drifts away
by a centimetre, as joint 6 comes near its end; above 70 the palm comes into the rod's way."""
PULLED, GRIPPED = math.radians(2.0), 0.05
"""How far the held bob is pulled out of the swing [rad], so that a hand that gives way does not lose the turning point,
and how long after the touch [s]: `jaw.time_to_grip`."""
GENTLY, SLOWLY = Pace(0.04, 0.003), Pace(0.15, 0.02)
"""Of that pull, slower than a held bob may be, and of a hand that takes the bob along."""
CLEAR, AIR = 0.03, 0.005
"""Between the bob and the table, and between the bob and either finger, at least [m]."""
HAND = jaw.PALM_ALONG + 0.02
"""From the plane of the swing to the posts at least: half the hand, which closes across the plane, and some air [m]."""
NEAR = -1
"""The side of the turning point that is nearer to the robot."""


@dataclass(frozen=True, kw_only=True)
class PendulumGrasp(Scenario):
    """A pendulum that swings below a gantry on the table."""

    HOLD = 0.3
    DISTURBED = (HINGE,)

    pivot_x: float = param(0.28, "m", 0.1, 0.4)
    pivot_y: float = param(0.0, "m", -0.3, 0.3)
    plane: float = param(0.0, "deg", -80.0, 80.0)
    """Direction in which the bob swings away from the robot; 0 is straight ahead, the sagittal plane."""
    amplitude: float = param(30.0, "deg", 15.0, 50.0)
    phase: float = param(0.0, "deg", -180.0, 180.0, period=360.0)
    """Where it is at the start, by time: 0 at the far turning point, 180 at the near one."""
    pendulum: Pendulum = Pendulum()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.pendulum.swing(self.reach, self.phase / 360.0)[0])

    def _scene(self, angle: float) -> mujoco.MjSpec:
        scene = table()
        pendulum = replace(self.pendulum, angle=angle, turn=math.radians(self.plane))
        place(scene, pendulum, "pendulum", self.foot, free=False)
        return scene

    def events(self, world: World) -> None:
        """At the start the bob gets the speed with which it comes up to the amplitude, whatever its angle is."""
        if world.passes(0.0):
            _, rate = self.pendulum.swing(self.reach, self.phase / 360.0)
            angle, _ = world.hinge(HINGE)
            world.spin(HINGE, math.copysign(self.pendulum.rate(self.reach, angle), rate))

    def pending(self, world: World) -> bool:
        return world.time == 0.0

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return self.at_apex(world) and self.grasped(world) and still(world, BOB, SLOW)

    def at_apex(self, world: World) -> bool:
        """Whether the bob is at a turning point of its swing, or farther out."""
        return abs(world.hinge(HINGE)[0]) >= APEX * self.reach

    def grasped(self, world: World) -> bool:
        """Whether the bob is between the pads, and they on it."""
        inside = math.dist(world.com(BOB), world.arm.hand) < BETWEEN
        return inside and world.touching(ROBOT, BOB) and world.arm.gap < 2 * self.pendulum.radius

    def failure(self, world: World) -> str | None:
        if world.touching(ROBOT, BOB) and not self.at_apex(world):
            return "the robot touched the pendulum away from its turning point"
        if world.arm.gap < MISSED * 2 * self.pendulum.radius:
            return "the jaw closed on nothing"
        return None

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Wait at the near turning point, and close so that the fingers arrive when the bob does."""
        yield from self.close_before(world, self.closing)

    def close_before(self, world: World, lead: float) -> Plan:
        """Wait at the near turning point and close `lead` [s] before the bob is there."""
        yield from self.wait_at(world, self.place(NEAR * self.reach))
        for later in (True, False):  # the one after the next, if that comes too soon
            yield from until(hold(world.arm, 3.0), lambda later=later: (self.left(world) > lead) == later)
        yield from grasp(world.arm, self.closing + GRIPPED)
        out = self.place(NEAR * (self.reach + PULLED)) - self.place(NEAR * self.reach)
        yield from go_to(world.arm, world.arm.hand + out, self.hand, GENTLY, CLOSED)
        yield from hold(world.arm, 1.0)

    def wait_at(self, world: World, at: Vec3, hand: Mat3 | None = None) -> Plan:
        """Bring the open jaw to a place on the bob's path from behind [m]."""
        hand = self.hand if hand is None else hand
        yield from go_to(world.arm, at - 0.08 * hand[:, 2], hand, COARSE, OPEN)
        yield from go_to(world.arm, at, hand, FINE, OPEN)

    def left(self, world: World) -> float:
        """Time until the bob is at the near turning point next [s]."""
        return self.pendulum.until_turning(*world.hinge(HINGE), NEAR)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "close_when_it_is_there": Shortcut(lambda world: self.close_before(world, Loop.PERIOD)),
            "close_when_it_is_fastest": Shortcut(
                lambda world: self.close_before(world, self.closing + self.period / 4)
            ),
            "grab_it_at_the_bottom": Shortcut(self._grab_below),
            "stop_it_and_lift_it": Shortcut(self._stop),
            "follow_it": Shortcut(self._follow),
        }

    def _grab_below(self, world: World) -> Plan:
        """Wait at the lowest point, and close so that the fingers arrive when the bob does."""
        yield from self.wait_at(world, self.place(0.0), self.beside(0.0))
        yield from until(hold(world.arm, 3.0), lambda: self.left(world) <= self.closing + self.period / 4)
        yield from grasp(world.arm)

    def _stop(self, world: World) -> Plan:
        """Stand in the bob's way until it has come to rest, take it and lift it to the turning point."""
        arm = world.arm
        yield from go_to(arm, self.place(0.0), self.beside(0.0), COARSE)
        yield from until(hold(arm, 4.0), lambda: world.touching(ROBOT, BOB) and still(world, BOB, SLOW))
        yield from self.wait_at(world, world.com(BOB), self.beside(0.0))
        yield from grasp(arm)
        for share in np.linspace(0.2, 1.1, 10):  # along the arc: the rod does not give way
            yield from go_to(arm, self.place(NEAR * share * self.reach), self.beside(share * self.reach), SLOWLY)
        yield from hold(arm, 1.0)

    def _follow(self, world: World) -> Plan:
        """Go after the bob where it is, and close when it is between the fingers."""
        arm, end = world.arm, world.time + 6.0
        while world.time < end:
            caught = math.dist(world.com(BOB), arm.hand) < BETWEEN
            turn = between(arm.hand_rot, self.hand)
            yield steer(arm, world.com(BOB), world.velocity(BOB)[3:], turn, CLOSED if caught else OPEN)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """In an axle with critical damping the bob sinks down and stays there."""
        damped = self.build()
        damped.joint(HINGE).damping = 2.0 * self.pendulum.pace * self.pendulum.inertia
        return {"no_swing": damped}

    def answer(self) -> Answer:
        """The moment at which to close at the near turning point [s]. One try: a jaw that misses ends the episode."""

        def act(world: World, moment: float) -> Plan:
            yield from self.wait_at(world, self.place(NEAR * self.reach))
            yield from hold(world.arm, max(0.0, moment - world.time))
            yield from grasp(world.arm, 1.0)

        def right(moment: float) -> bool:
            turns = (0.5 - self.phase / 360.0) * self.period
            return abs(math.remainder(moment + self.closing - turns, self.period)) <= self.window / 2

        return Answer(tuple(np.arange(3.0, 6.0, 0.02).round(2).tolist()), act, right, tries=1)

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        pendulum = self.pendulum
        width, low = 2 * pendulum.radius, pendulum.height - pendulum.length - pendulum.radius
        yield require(low >= CLEAR, "the bob swings too low over the table", low=low, clear=CLEAR)
        yield on_table("the gantry", corners(self.foot, 0.0, pendulum.size))
        aside = pendulum.span * math.cos(math.radians(self.plane))
        yield require(aside >= HAND, "the posts leave no room for the hand", aside=aside, hand=HAND)
        yield require(width <= jaw.OPENING - 2 * AIR, "the bob is too wide for the jaw", width=width, jaw=jaw.OPENING)
        at_reset = jaw.RESET_GAP
        yield require(MISSED * width < at_reset, "the jaw is too far closed at the start", width=width, jaw=at_reset)
        askew = math.radians(TILT - self.amplitude)
        room = jaw.PALM_ABOVE - jaw.PALM_ACROSS * math.tan(askew)
        yield require(room > 0.0, "the palm is in the rod's way", room=room)
        yield within_reach("the near turning point", self.place(NEAR * self.reach))

    def features(self) -> Mapping[str, float]:
        """What has to be foreseen, and where: times [s], lengths [m], and how far the hand must turn aside [rad]."""
        azimuth, _ = polar(self.place(NEAR * self.reach) - BASE)
        return {
            "period": self.period,
            "closing_time": self.closing,
            "rise": self.pendulum.length * (1.0 - math.cos(self.reach)),
            "turned_aside": math.radians(self.plane) - azimuth,
        }

    # --- geometry -------------------------------------------------------------------------

    @property
    def reach(self) -> float:
        """The amplitude [rad]."""
        return math.radians(self.amplitude)

    @property
    def period(self) -> float:
        """Of the swing [s]."""
        return self.pendulum.period(self.reach)

    @property
    def closing(self) -> float:
        """How long the jaw takes from the command until it touches the bob [s]."""
        return jaw.time_to_touch(2 * self.pendulum.radius)

    @property
    def window(self) -> float:
        """How long the bob is at a turning point [s]."""
        from_apex = APEX * self.reach
        return 2 * self.pendulum.until_turning(from_apex, self.pendulum.rate(self.reach, from_apex), 1)

    @property
    def foot(self) -> Vec3:
        """The point on the table below the axle [m]."""
        return np.array([self.pivot_x, self.pivot_y, TABLE_TOP])

    @property
    def hand(self) -> Mat3:
        """Orientation of the hand that takes the bob: it looks along the plane, and closes across it."""
        return self.beside(self.reach)

    def beside(self, angle: float) -> Mat3:
        """Orientation of a hand that takes the bob at `angle` [rad] on the near side, its palm beside the rod."""
        return facing(math.radians(self.plane), math.radians(TILT) - self.reach + angle)

    def place(self, angle: float) -> Vec3:
        """The bob's centre at an angle [rad], in [m]."""
        along, down = math.sin(angle), math.cos(angle)
        above = self.pendulum.height - self.pendulum.length * down
        return self.foot + self.pendulum.length * along * heading(self.plane) + above * UP
