"""T11 pendulum-grasp: grasp the bob of a swinging pendulum at a turning point, where it stands still for a moment.

                  =====o=====  axle
       arm            /|
        \\            / |          seen from the side; the plane of the swing is turned by `plane`
         \\ hand     /  |
          ---<     O   .          the hand looks along the path on which the bob comes
          turning point

Bottleneck: time. The bob is slow enough to be grasped twice in a period and nowhere else. The fingers need 0.13 s to
close. To meet the bob while they close, they must start before it has arrived.

Decisions, where the paper (App. B, T11) says "grasp the bob at the swing apex" and no more:

* At the apex means: no part of the robot touches the pendulum nearer to the middle than 98 % of the amplitude. Beyond,
  the bob is slower than a fifth of its greatest speed, for a sixteenth of the period, 0.08 s, at either end. Otherwise
  a hand in the bob's way would succeed, or one that brakes the bob and then grasps it.
* One try: no goal counts after a jaw has closed farther than the bob is wide. Otherwise a jaw that opens and closes
  without looking would catch the bob after some time.
* The jaw closes once, from wide open, 65 mm, and meets the bob in the time that it needs to close. Otherwise a jaw that
  was opened 3 mm wider than the bob grasped it when it was seen to turn, without any lead, in 12 of 12; or a jaw could
  start to close at every swing and open again.
* The jaw is closing as it meets the bob. One finger of a wide-open jaw that waits 2 mm beside the path pins a bob that
  has arrived, without any lead (34 of 36). That is labelled.
* The means require the lead, not the rhythm. A jaw that closes when the bob passes 24 deg on its way out grasps it in
  12 of 12 of training and in 8 of 8 of `off_centre`, but in 0 of 8 of `wide_swing`, 3 of 8 of `small_bob` and 5 or 6 of
  8 of the other axes. One that closes when the bob has slowed to 0.5 m/s grasps it in 6 of 6, of `plane_45` too.
* The pendulum swings already when the episode starts, at any moment of its period. If it always started at the end of a
  swing, as the paper may mean, one fixed time would serve every scenario. Either turning point counts; the arm reaches
  one.
* The bob counts as grasped when it is between the pads of both fingers and as slow as the hand, for 0.3 s. It need not
  be lifted: at the place of the grasp the pendulum hangs askew, and it falls when it is released.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from ..assets.pendulum import Pendulum
from ..assets.prop import TABLE_TOP, place, table
from ..compat import set_damping
from ..control.loop import Loop
from ..decisions import Decision, choice, near, side_of, span
from ..geometry import UP, Mat3, Vec3, between, corners, heading, polar, spoken
from ..means import Mean, throughout, when
from ..params import param
from ..predicates import still
from ..robots import jaw
from ..robots.panda import BASE
from ..scenario import Answer, Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT
from ..sim.memory import remember
from ..sim.world import World
from ..skills.jaw import grasp
from ..skills.motion import CLOSED, COARSE, FINE, OPEN, Pace, facing, go_to, hold, steer, until

BOB = "pendulum/bob"
HINGE = "pendulum/hinge"
APEX_SHARE = 0.98  # share of the amplitude beyond which a place belongs to the turning point
GRASP_TOLERANCE = 0.012
"""Largest distance of the bob's centre from the grip site at which it is between the pads [m], three quarters of a pad:
below the finger tips of a jaw that it does not fit into it is 17 mm away."""
MAX_HELD_SPEED = 0.05  # largest speed of a bob that is held [m/s]
MISS_SHARE = 0.9
"""Gap of a jaw that has closed on nothing, as a share of the bob's diameter. At 60 % a jaw that opened and closed
without looking caught every fifth bob."""
WIDE_GAP = 0.065
"""Gap from which a jaw is wide open [m]. An open jaw that is commanded to close for 50 ms, one step of a policy at
20 Hz, and to open again stays wider. A jaw kept at 46 or 54 mm grasped a bob that it saw turn; at 62 mm it was late."""
MAX_BREAK = 0.2  # time for which pads may lose a bob that bounces between them [s]: longer than 0.09 s, see `jaw`
HAND_TILT = 65.0
"""Angle of the hand below the horizontal [deg]. At 30 it would look along the bob's path, but below 60 it drifts away
by a centimetre, as joint 6 comes near its end; above 70 the palm meets the rod."""
MEETING_ROOM = 0.012
"""Largest gap beyond the bob's diameter at which a closing jaw meets it [m]. One finger that waits beside the path
meets it with a wide jaw."""
NEAR_SIDE = -1  # side of the turning point that is nearer to the robot


@dataclass(frozen=True, kw_only=True)
class PendulumGrasp(Scenario):
    """A pendulum that swings below a gantry on the table."""

    VERSION = 2
    HOLD = 0.3
    DISTURBED = (HINGE,)

    pivot_x: float = param(0.28, "m", 0.1, 0.4)
    pivot_y: float = param(0.0, "m", -0.3, 0.3)
    plane: float = param(0.0, "deg", -80.0, 80.0)
    """Direction in which the bob swings away from the robot; 0 is straight ahead, the sagittal plane."""
    amplitude: float = param(30.0, "deg", 15.0, 50.0)
    phase: float = param(0.0, "deg", -180.0, 180.0, period=360.0)
    """Phase of the swing at the start: 0 at the far turning point, 180 at the near one."""
    pendulum: Pendulum = Pendulum()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.pendulum.swing(self.peak_angle, self.phase / 360.0)[0])

    def _scene(self, angle: float) -> mujoco.MjSpec:
        scene = table()
        pendulum = replace(self.pendulum, angle=angle, turn=math.radians(self.plane))
        place(scene, pendulum, "pendulum", self.foot, free=False)
        remember(scene, "wide", "touch", "reopened")
        return scene

    def events(self, world: World) -> None:
        """At the start, give the bob the speed from which it reaches the amplitude, at any angle.

        Remember when the jaw was wide open, when it touched the bob [s], and whether it has opened again without it.
        """
        memory = world.memory
        if world.arm.gap >= WIDE_GAP:
            closed = world.time - memory["wide"] > 1.5 * Loop.PERIOD and memory["wide"] > memory["touch"]
            memory["wide"], memory["reopened"] = world.time, max(memory["reopened"], float(closed))
        if world.touching(ROBOT, BOB):
            memory["touch"] = world.time
        if world.passes(0.0):
            _, rate = self.pendulum.swing(self.peak_angle, self.phase / 360.0)
            angle, _ = world.hinge(HINGE)
            world.spin(HINGE, math.copysign(self.pendulum.rate(self.peak_angle, angle), rate))

    def pending(self, world: World) -> bool:
        return world.time == 0.0

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return self.at_apex(world) and self.grasped(world) and still(world, BOB, MAX_HELD_SPEED)

    def at_apex(self, world: World) -> bool:
        """Whether the bob is at a turning point of its swing, or farther out."""
        return abs(world.hinge(HINGE)[0]) >= APEX_SHARE * self.peak_angle

    def grasped(self, world: World) -> bool:
        """Whether the bob is between the pads, and the pads touch it."""
        inside = math.dist(world.com(BOB), world.arm.hand) < GRASP_TOLERANCE
        return inside and world.touching(ROBOT, BOB) and world.arm.gap < 2 * self.pendulum.radius

    def missed(self, world: World) -> bool:
        """Whether a jaw has closed on nothing, or did not touch the bob in time after it was wide open."""
        memory = world.memory
        if world.arm.gap < MISS_SHARE * 2 * self.pendulum.radius:
            return True
        met = memory["touch"] > memory["wide"] or world.touching(ROBOT, BOB)
        late = world.time - memory["wide"] > self.closing_time
        return bool(memory["reopened"]) or (memory["wide"] > 0.0 and late and not met)

    def narrow(self, world: World) -> bool:
        """Whether a jaw starts to touch the bob that was not wide open just before."""
        starts = world.touching(ROBOT, BOB) and world.time - world.memory["touch"] > MAX_BREAK
        return starts and world.time - world.memory["wide"] > self.closing_time

    def means(self) -> Mapping[str, Mean]:
        def meets(world: World) -> bool:
            return world.touching(ROBOT, BOB)

        return {
            "the jaw was closing when the bob came": when(
                meets, lambda world: world.arm.gap <= 2 * self.pendulum.radius + MEETING_ROOM
            ),
            "the jaw closed from wide open": throughout(lambda world: not self.narrow(world)),
            "the jaw closed once, in time for the bob": throughout(lambda world: not self.missed(world)),
            "the robot touched the bob at its turning point alone": throughout(
                lambda world: self.at_apex(world) or not meets(world)
            ),
        }

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Wait at the near turning point, and close so that the fingers arrive when the bob does."""
        yield from self.close_before(world, self.closing_time)

    def close_before(self, world: World, lead: float) -> Plan:
        """Wait at the near turning point and close `lead` [s] before the bob arrives."""
        yield from self.wait_at(world, self.bob_at(NEAR_SIDE * self.peak_angle))
        yield from self._close(world, lead)

    def _close(self, world: World, lead: float) -> Plan:
        """Close `lead` [s] before the bob arrives, and pull it out of the swing."""
        for later in (True, False):  # wait for the next arrival but one if the next is too soon
            yield from until(hold(world.arm, 3.0), lambda later=later: (self.time_left(world) > lead) == later)
        yield from grasp(world.arm, self.closing_time + 0.05)  # the force needs 0.05 s more: `jaw.time_to_grip`
        # Pull the bob out of the swing by 2 deg, in case the hand gives way, and slower than a held bob may be.
        pulled = self.bob_at(NEAR_SIDE * (self.peak_angle + math.radians(2.0)))
        out = pulled - self.bob_at(NEAR_SIDE * self.peak_angle)
        yield from go_to(world.arm, world.arm.hand + out, self.grasp_rot, Pace(0.04, 0.003), CLOSED)
        yield from hold(world.arm, 1.0)

    def wait_at(self, world: World, at: Vec3, rot: Mat3 | None = None) -> Plan:
        """Bring the open jaw to a place on the bob's path [m], from behind."""
        rot = self.grasp_rot if rot is None else rot
        yield from go_to(world.arm, at - 0.08 * rot[:, 2], rot, COARSE, OPEN)
        yield from go_to(world.arm, at, rot, FINE, OPEN)

    def time_left(self, world: World) -> float:
        """Time until the bob is at the near turning point [s]."""
        return self.pendulum.until_turning(*world.hinge(HINGE), NEAR_SIDE)

    def steps(self) -> Mapping[str, Planner]:
        return {
            "wait_at_apex": lambda world: self.wait_at(world, self.bob_at(NEAR_SIDE * self.peak_angle)),
            "close_in_time": lambda world: self._close(world, self.closing_time),
            "grab_at_bottom": self._grab_below,
            "brake": self._stop,
            "follow": self._follow,
        }

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "close_when_it_is_there": Shortcut(lambda world: self.close_before(world, Loop.PERIOD)),
            "close_when_it_is_fastest": Shortcut(self._close_early),
            "grab_it_at_the_bottom": Shortcut(self._grab_below),
            "stop_it_and_lift_it": Shortcut(self._stop),
            "follow_it": Shortcut(self._follow),
        }

    def _close_early(self, world: World) -> Plan:
        """Close at the near turning point when the bob is fastest, a quarter of a period before it arrives."""
        yield from self.close_before(world, self.closing_time + self.period / 4)

    def _grab_below(self, world: World) -> Plan:
        """Wait at the lowest point, and close so that the fingers arrive when the bob does."""
        yield from self.wait_at(world, self.bob_at(0.0), self.rot_beside(0.0))
        yield from until(hold(world.arm, 3.0), lambda: self.time_left(world) <= self.closing_time + self.period / 4)
        yield from grasp(world.arm)

    def _stop(self, world: World) -> Plan:
        """Block the bob until it is at rest, grasp it and lift it to the turning point."""
        arm = world.arm
        yield from go_to(arm, self.bob_at(0.0), self.rot_beside(0.0), COARSE)
        yield from until(hold(arm, 4.0), lambda: world.touching(ROBOT, BOB) and still(world, BOB, MAX_HELD_SPEED))
        yield from self.wait_at(world, world.com(BOB), self.rot_beside(0.0))
        yield from grasp(arm)
        for share in np.linspace(0.2, 1.1, 10):  # along the arc: the rod does not give way
            at, rot = self.bob_at(NEAR_SIDE * share * self.peak_angle), self.rot_beside(share * self.peak_angle)
            yield from go_to(arm, at, rot, Pace(0.15, 0.02))
        yield from hold(arm, 1.0)

    def _follow(self, world: World) -> Plan:
        """Follow the bob, and close when it is between the fingers."""
        arm, end = world.arm, world.time + 6.0
        while world.time < end:
            caught = math.dist(world.com(BOB), arm.hand) < GRASP_TOLERANCE
            turn = between(arm.hand_rot, self.grasp_rot)
            yield steer(arm, world.com(BOB), world.velocity(BOB)[3:], turn, CLOSED if caught else OPEN)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """In an axle with critical damping the bob sinks to the lowest point and stays there."""
        damped = self.build()
        set_damping(damped.joint(HINGE), 2.0 * self.pendulum.pace * self.pendulum.inertia)
        return {"no_swing": damped}

    def answer(self) -> Answer:
        """Time at which to close at the near turning point [s]. One try: no goal counts after a miss."""

        def act(world: World, moment: float) -> Plan:
            yield from self.wait_at(world, self.bob_at(NEAR_SIDE * self.peak_angle))
            yield from hold(world.arm, max(0.0, moment - world.time))
            yield from grasp(world.arm, 1.0)

        def right(moment: float) -> bool:
            turns = (0.5 - self.phase / 360.0) * self.period
            return abs(math.remainder(moment + self.closing_time - turns, self.period)) <= self.window / 2

        return Answer(tuple(np.arange(3.0, 6.0, 0.02).round(2).tolist()), act, right, tries=1)

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        angle, half = math.tau / self.period, self.window / 2
        turns = (0.5 - self.phase / 360.0) * self.period - self.closing_time
        first = 3.0 + (turns - 3.0) % self.period
        late, early = (self.amplitude * math.cos(angle * (self.closing_time + sign * half)) for sign in (1, -1))
        return {
            "angle_at_which_to_close": span(late, early, "pendulum", "amplitude"),
            "time_at_which_to_close": span(first - half, first + half, "phase", "pendulum"),
            "apex": near(self.bob_at(-self.peak_angle), 0.012, "pivot_x", "pivot_y", "plane", "pendulum", "amplitude"),
            "starts_to": choice(side_of(math.sin(math.radians(self.phase))), "phase"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        pendulum = self.pendulum
        width, low = 2 * pendulum.radius, pendulum.height - pendulum.length - pendulum.radius
        clear = 0.03
        yield require(low >= clear, "the bob swings too low over the table", low=low, clear=clear)
        yield on_table("the gantry", corners(self.foot, 0.0, pendulum.size))
        aside = pendulum.span * math.cos(math.radians(self.plane))
        hand = jaw.PALM_ALONG + 0.02  # half the hand, which closes across the plane of the swing, and a clearance
        yield require(aside >= hand, "the posts leave no room for the hand", aside=aside, hand=hand)
        yield require(width <= jaw.OPENING - 2 * 0.005, "the bob is too wide for the jaw", width=width, jaw=jaw.OPENING)
        reset = jaw.RESET_GAP
        yield require(MISS_SHARE * width < reset, "the jaw is too far closed at the start", width=width, jaw=reset)
        askew = math.radians(HAND_TILT - self.amplitude)
        room = jaw.PALM_ABOVE - jaw.PALM_ACROSS * math.tan(askew)
        yield require(room > 0.0, "the palm is in the rod's way", room=room)
        yield within_reach("the near turning point", self.bob_at(NEAR_SIDE * self.peak_angle))

    def features(self) -> Mapping[str, float]:
        """Period and closing time [s], rise of the bob [m], and angle by which the hand must turn to the side [rad]."""
        azimuth, _ = polar(self.bob_at(NEAR_SIDE * self.peak_angle) - BASE)
        return {
            "period": self.period,
            "closing_time": self.closing_time,
            "rise": self.pendulum.length * (1.0 - math.cos(self.peak_angle)),
            "turned_aside": math.radians(self.plane) - azimuth,
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "start": self._seen_at_start(),
            "amplitude": self.amplitude,
            "length": self.pendulum.length,
            "period": self.period,
            "radius": self.pendulum.radius,
        }

    # --- geometry -------------------------------------------------------------------------

    def _seen_at_start(self) -> str:
        """Place of the bob at the start, as text; below the axle within 4 deg, where pictures do not show the side."""
        angle, _ = self.pendulum.swing(self.peak_angle, self.phase / 360.0)
        below = abs(angle) < math.radians(4.0)
        return "below the axle" if below else spoken(self.plane + (0.0 if angle > 0.0 else 180.0))

    @cached_property
    def peak_angle(self) -> float:
        """Amplitude of the swing [rad]."""
        return math.radians(self.amplitude)

    @cached_property
    def period(self) -> float:
        """Period of the swing [s]."""
        return self.pendulum.period(self.peak_angle)

    @cached_property
    def closing_time(self) -> float:
        """Time from the command until the jaw touches the bob [s]."""
        return jaw.time_to_touch(2 * self.pendulum.radius)

    @cached_property
    def window(self) -> float:
        """Time for which the bob is at a turning point [s]."""
        from_apex = APEX_SHARE * self.peak_angle
        return 2 * self.pendulum.until_turning(from_apex, self.pendulum.rate(self.peak_angle, from_apex), 1)

    @cached_property
    def foot(self) -> Vec3:
        """Point on the table below the axle [m]."""
        return np.array([self.pivot_x, self.pivot_y, TABLE_TOP])

    @cached_property
    def grasp_rot(self) -> Mat3:
        """Orientation of the hand that grasps the bob: it looks along the plane of the swing, and closes across it."""
        return self.rot_beside(self.peak_angle)

    def rot_beside(self, angle: float) -> Mat3:
        """Orientation of a hand that grasps the bob at `angle` [rad] on the near side, its palm beside the rod."""
        return facing(math.radians(self.plane), math.radians(HAND_TILT) - self.peak_angle + angle)

    def bob_at(self, angle: float) -> Vec3:
        """Centre of the bob at an angle [rad], in [m]."""
        along, down = math.sin(angle), math.cos(angle)
        above = self.pendulum.height - self.pendulum.length * down
        return self.foot + self.pendulum.length * along * heading(self.plane) + above * UP
