"""T22 ball-cage-escape: get a ball out of a cage whose only hole is blocked by the stool on which the cage stands.

      ________________
     |     (_)        |    seen from the side: the hole is in the floor, near one end, on the stool
     |___________[ ]__|
         [=========]
           |     |

Bottleneck: the stool blocks the hole, so that no tilt helps before the cage is lifted. The lifted cage must be tilted
towards the hole, past the angle at which the ball rolls: tan(tilt) = rolling resistance (5.7 deg nominally). The robot
must know on which side of the ball the hole is; of two ends, a guess is right in half of the scenes.

Decisions. The paper gives the story, no numbers. (1) The ball resists rolling like one of soft foam: a tenth of its
load. So it stays where it is in a cage that is lifted and carried level, by up to 1 m/s^2, and comes to rest on the
table. (2) The jaw holds the cage across its width, the one edge that it can span; walls are translucent so that
cameras see the ball. (3) The stool is fixed: a tipping one would be another task. (4) The paper lets a policy try until
the ball falls out. Here no goal counts after the ball has rolled to the end without the hole, so that it does not help
to tilt the cage both ways. As the ball leaves, the jaw holds the cage off stool and table: otherwise the cage could be
knocked off its stool, or slid until the hole is beside it. The cage is then tilted towards the hole, by `SHAKE_TILT`
more than the ball needs to roll: otherwise a shake, or a stop, would do. A tilt slower than 12 deg/s may let the ball
out below that angle. With the hole in the middle (`ball_beyond`), a cage that is slid off its stool in the hand is as
good as lifted. (5) In training two facts reveal the way without a look at the hole, and both are fair: the side of the
stool's middle, and the end farther from the ball (12 of 12 each).
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import ClassVar

import mujoco
import numpy as np

from ..assets.ball import Ball
from ..assets.cage import BOTTOM, END, SIDE, TOP, HoledCage, lowered
from ..assets.prop import TABLE_TOP, place, table
from ..assets.stool import Stool
from ..decisions import Decision, choice, side_of, span
from ..geometry import UP, Mat3, Vec3, about_z, shortest, spoken
from ..means import Mean, throughout, when
from ..params import param
from ..predicates import fallen, inside, still
from ..robots.jaw import FINGER_ACROSS
from ..scenario import Answer, Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT, Arm
from ..sim.world import World
from ..skills.jaw import pick, poke
from ..skills.motion import CLOSED, Pace, can_turn, go_to, hold, retreat, turn_about_vertical, turn_to, wait

REST_SPEED = 0.02
"""Speed below which the ball counts as at rest [m/s]: at the nominal rolling resistance it stops within 1 mm."""
MAX_HAND_TILT = math.radians(72.0)
"""Tilt that the hand reaches at every heading that `present` may choose [rad], tried for x from -0.2 to 0 m."""
TILT_MARGIN = math.radians(10.0)
"""Angle by which the oracle exceeds the least tilt over a rim [rad]: the grip gives some degrees."""
STEEP = math.radians(35.0)
"""Tilt of a cage in which the ball cannot pass the hole [rad]."""
GENTLE = math.radians(9.0)
"""Angle by which the oracle exceeds the rolling tilt if the ball can pass the hole [rad]: it must roll, but slowly."""
SHAKE_TILT = math.radians(6.5)
"""Angle above the rolling tilt up to which a cage counts as level [rad]. A hand that shakes a cage tilted by 5 deg
tilts it by up to 9.8 deg (48 rollouts, filtered and raw, periods from 0.2 to 1 s), one that jerks it, by up to 11.8.
At this limit no plan with jerks, rocking by up to 6 deg, creep or spins got a ball out, in 168 rollouts."""
END_MARGIN = 0.001
"""Distance from the wall at which a ball has come to an end of the cage [m]."""
GRIP_HEIGHT = 0.030
"""Height of the grip site above the foot of the cage [m]: the finger tips, 9 mm lower, stay 21 mm above the stool."""
LIFT_HEIGHT = 0.05  # height by which the cage is lifted off the stool [m]
CARRY_PACE = Pace(0.15, 0.01)  # pace with the cage in the hand: slow enough for the ball to stay where it is


@dataclass(frozen=True, kw_only=True)
class BallCageEscape(Scenario):
    """A cage on a stool, with a ball in it. Lengths are along the cage's axes."""

    VERSION = 2

    HOLD: ClassVar[float] = 0.3

    x: float = param(-0.08, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    yaw: float = param(0.0, "deg", -120.0, 240.0, period=360.0)
    """Direction of the cage's x axis, at whose end the hole is; 0 is straight away from the robot."""
    ball_x: float = param(-0.010, "m", -0.1, 0.1)
    ball_y: float = param(0.0, "m", -0.04, 0.04)
    stool_x: float = param(0.022, "m", -0.1, 0.1)
    """Middle of the stool; 22 mm leave 1.5 mm of plate beyond the hole."""
    rolling: float = param(0.1, "1", 0.0, 0.2)  # rolling resistance of the ball, as a share of the load
    cage: HoledCage = HoledCage()
    ball: Ball = Ball(radius=0.015, density=1400.0, friction=0.5, rgba=(0.85, 0.20, 0.15, 1.0))
    stool: Stool = Stool(length=0.080)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene, yaw = table(), math.radians(self.yaw)
        stool = self.foot + self.axes @ [self.stool_x, 0.0, -self.stool.height]
        ball = self.foot + self.axes @ [self.ball_x, self.ball_y, self.cage.wall + self.ball.radius]
        place(scene, self.stool, "stool", stool, yaw, free=False)
        place(scene, self.cage, "cage", self.foot, yaw)
        place(scene, replace(self.ball, rolling=self.rolling), "ball", ball)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return world.touching("ball", "table") and still(world, "ball", REST_SPEED) and self.out(world)

    def failure(self, world: World) -> str | None:
        if fallen(world, "ball", below=0.0):
            return "the ball fell off the table"
        return "the cage fell off the table" if fallen(world, "cage", below=0.0) else None

    def means(self) -> Mapping[str, Mean]:
        def leaves(world: World) -> bool:
            return self.cage.passes(self.in_cage(world), self.ball.radius)

        def lifted(world: World) -> bool:
            return world.arm.grips("cage") and world.touching_bodies("cage") <= {ROBOT, "ball"}

        return {
            "the jaw held the cage in the air as the ball left it": when(leaves, lifted),
            "the cage was tilted to the hole, farther than the ball needs to roll": when(
                leaves, lambda world: self.lean(world) >= self.rolling_tilt + SHAKE_TILT
            ),
            "the ball did not roll to the other end": throughout(
                lambda world: not self.at_wrong_end(self.in_cage(world))
            ),
            "no hand touched the ball in the cage": when(leaves, lambda world: not world.touched(ROBOT, "ball")),
        }

    def in_cage(self, world: World) -> Vec3:
        """Centre of the ball in the axes of the cage [m]."""
        return world.rot("cage").T @ (world.pos("ball") - world.pos("cage"))

    def at_wrong_end(self, at: Vec3) -> bool:
        """Whether a ball in the cage, at a place in its axes, has come to the end on the other side than the hole."""
        within = bool(np.all(np.abs(at - self.cage.middle) < self.cage.size / 2))
        return within and -self.way * at[0] > self.cage.cavity[0] / 2 - self.ball.radius - END_MARGIN

    def lean(self, world: World) -> float:
        """Angle by which the cage is tilted in the direction in which the ball must leave [rad]."""
        axis, sign = (1, 1.0) if self.cage.face == SIDE else (0, self.way)
        rot = world.rot("cage")
        return math.atan2(-sign * rot[2, axis], rot[2, 2])

    def out(self, world: World) -> bool:
        """Whether the whole ball is outside the cuboid that the cage fills."""
        middle, reach = self.cage.middle, self.cage.size / 2 + self.ball.radius
        return not inside(world, "ball", "cage", middle - reach, middle + reach)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Lift the cage, carry it aside, and tip it until the ball is over the sill and out."""
        yield from self.pick_up(world)
        yield from self.present(world, self.tilts()[-1])
        yield from self._tip_out(world)
        yield from wait(world.arm, lambda: self.success(world), give_up=4.0)

    def _tip_out(self, world: World) -> Plan:
        """Tip the held cage from one tilt to the next until the ball is out."""
        for down in self.tilts():
            if self.out(world):
                break
            yield from self.tip(world, down)
            yield from hold(world.arm, 0.3)
            yield from wait(world.arm, lambda: self.out(world) or still(world, "ball", REST_SPEED), give_up=3.0)

    def tilts(self) -> list[Vec3]:
        """Unit vectors in the cage's axes that must point down, one after the other."""
        if self.cage.face == SIDE:
            # 0.25 times gravity keeps the ball at the hole's end meanwhile.
            steep = self.least_tilt + TILT_MARGIN
            sideways = np.array([self.way * 0.25, math.sin(steep), -math.cos(steep)])
            return [lowered(self.way * STEEP), sideways / np.linalg.norm(sideways)]
        if self.cage.face == END:
            return [lowered(self.least_tilt + TILT_MARGIN)]
        if self.room_beyond < -self.ball.radius / 2:
            return [lowered(self.way * STEEP)]
        return [lowered(self.way * (self.rolling_tilt + GENTLE + math.radians(more))) for more in (0.0, 3.0, 6.0)]

    def pick_up(self, world: World, lift: float = LIFT_HEIGHT) -> Plan:
        """Take the cage by its width and lift it clear of the stool [m]."""
        yield from pick(world.arm, self.handle, closing=self.axes[:, 1], lift=lift)

    def present(self, world: World, down: Vec3) -> Plan:
        """Carry the cage level to a free place, low over the table, and turn it so that `down` can come to point down.

        The place is towards the middle. If the end must face about, it is to the left: there joint 7 has half a turn.
        """
        arm, steep, leaning = world.arm, math.acos(-down[2]), world.rot("cage") @ down
        side = -1.0 if self.y > 0 and (leaning[0] > 0 or self.cage.face == SIDE) else 1.0
        # The ball passes under the lowest edge of the tilted cage, 40 mm over the table. The place is 0.19 m beside the
        # stool; the tilted cage and the stool reach 0.07 m each.
        half = math.hypot(self.cage.length, self.cage.width) / 2
        low = half * math.sin(steep) + GRIP_HEIGHT * math.cos(steep) + 0.040
        spot = np.array([min(max(self.x, -0.15), -0.05), self.y + side * 0.19, TABLE_TOP + low])
        yield from go_to(arm, [spot[0], spot[1], max(arm.hand[2], spot[2])], pace=CARRY_PACE)
        yield from go_to(arm, spot, pace=CARRY_PACE)
        yield from turn_about_vertical(arm, self._turn_to_front(arm, world.rot("cage") @ down, -side))

    def _turn_to_front(self, arm: Arm, leaning: Vec3, side: float) -> float:
        """Least turn of the hand that brings a direction to the front, or up to 55 deg to one side of it [rad].

        There the ball has half a metre of table. For a hole in a side it is the turn that brings it straightest to the
        front: the end, which is lowered first, must not point to the robot.
        """
        heading, laps = math.atan2(leaning[1], leaning[0]), (-2 * math.pi, 0.0, 2 * math.pi)
        fronts = np.linspace(0.0, math.radians(55.0), 12)
        angles = {side * front - heading + lap: front for front in fronts for lap in laps}
        possible = [turn for turn in angles if can_turn(arm, turn)]
        return min(possible, key=angles.__getitem__ if self.cage.face == SIDE else abs, default=0.0)

    def tip(self, world: World, down: Vec3, rate: float = 1.0) -> Plan:
        """Turn the cage about the hand, the shortest way, until `down` in its axes points down, or the ball is out."""
        rot = shortest(world.rot("cage") @ down, -UP) @ world.arm.hand_rot
        yield from turn_to(world.arm, rot, rate, until=lambda: self.out(world))

    def steps(self) -> Mapping[str, Planner]:
        return {
            "take_cage": partial(self.pick_up, lift=0.0),
            "lift_off": lambda world: retreat(world.arm, LIFT_HEIGHT),
            "carry_aside": lambda world: self.present(world, self.tilts()[-1]),
            "tilt_to_hole": self._tip_out,
            "ball_out": lambda world: wait(world.arm, lambda: self.success(world), give_up=4.0),
            "shake": self._shake_held,
            "tilt_to_trap": lambda world: self.tip(world, lowered(-self.way * STEEP), rate=0.5),
        }

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        half, steep = self.way * self.rolling_tilt / 2, self.way * STEEP
        return {
            "lift_it_off_the_stool": Shortcut(lambda world: self.tip_only(world, 0.0)),
            "tip_it_half_as_far": Shortcut(lambda world: self.tip_only(world, half)),
            "tip_it_to_the_wrong_end": Shortcut(lambda world: self.tip_only(world, -steep)),
            "tip_it_to_both_ends": Shortcut(lambda world: self.tip_only(world, -steep, steep)),
            "shake_it_level": Shortcut(lambda world: self._shake(world)),
            "shake_it_with_the_wrist": Shortcut(lambda world: self._shake(world, spin=1.0)),
            "shake_it_half_tipped": Shortcut(lambda world: self._shake(world, half)),
            "knock_it_off_the_stool": Shortcut(self._knock_off),
        }

    def tip_only(self, world: World, *tilts: float) -> Plan:
        """Do as the oracle, with other tilts [rad], and stop after them."""
        yield from self.pick_up(world)
        yield from self.present(world, lowered(tilts[-1]))
        for tilt in tilts:
            yield from self.tip(world, lowered(tilt), rate=0.5)
            yield from hold(world.arm, 1.0)

    def _shake(self, world: World, tilt: float = 0.0, spin: float = 0.0) -> Plan:
        """Shake the cage along its length as hard as the hand can; if `spin` is not 0, the wrist turns to and fro."""
        yield from self.tip_only(world, tilt)
        yield from self._shake_held(world, spin)

    def _shake_held(self, world: World, spin: float = 0.0) -> Plan:
        """Shake the held cage along its length for 4 s."""
        end = world.time + 4.0
        while world.time < end:
            sign = 1.0 if world.time % 0.6 < 0.3 else -1.0
            yield np.array([*(sign * world.rot("cage")[:, 0]), 0.0, 0.0, sign * spin, CLOSED])

    def _knock_off(self, world: World) -> Plan:
        """Push the cage across the stool, and off it, with closed fingers."""
        across = self.axes[:, 1]
        beside = self.handle - (self.cage.width / 2 + FINGER_ACROSS + 0.04) * across
        yield from poke(world.arm, beside, 0.15 * across, until=lambda: world.touched("cage", "table"))

    def answer(self) -> Answer:
        """Heading in which the cage is tilted [deg], chosen without looking which end has the hole."""

        def right(heading: float) -> bool:
            return self.way * math.cos(math.radians(heading - self.yaw)) > 0

        def act(world: World, heading: float) -> Plan:
            yield from self.tip_only(world, self.way * math.copysign(STEEP, right(heading) - 0.5))

        return Answer(tuple(map(float, range(-90, 270, 15))), act, right, tries=1)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        return {"no_hole": replace(self, cage=replace(self.cage, closed=True)).build()}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        up = math.cos(math.radians(self.yaw)) * self.way
        hole = ("cage.offset", "cage.yaw", "stool.yaw", "* in cage.*", "* in stool.*")  # in the axes of the cage
        return {
            "lowered_end": choice("far" if up > 0 else "near", *hole),
            "side_along_the_cage": choice(side_of(self.way), *hole),
            "tilt": span(math.degrees(self.least_tilt), 72.0, "cage", "ball.radius", "rolling"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        cage, stool, r = self.cage, self.stool, self.ball.radius
        # The ball can leave.
        yield require(cage.margin >= 0, "the hole does not fit into its face", hole=cage.hole, margin=cage.margin)
        yield require(r < cage.hole, "the ball is wider than the hole", ball=r, hole=cage.hole)
        yield require(cage.face != TOP, "the hole looks up, and the hand cannot turn over", steepest=MAX_HAND_TILT)
        tilt, steepest = self.least_tilt + TILT_MARGIN, MAX_HAND_TILT
        yield require(tilt <= steepest, "the ball stays in at every tilt of the hand", tilt=tilt, steepest=steepest)

        # It stays in until the cage is tilted.
        fits = 2 * r <= cage.cavity[2] and r + abs(self.ball_y) <= cage.cavity[1] / 2
        yield require(fits, "the ball does not fit between the walls", radius=r, y=self.ball_y)
        room, least = cage.cavity[0] / 2 - r + self.way * self.ball_x, 0.004  # [m]; starts are jittered by 2 mm
        yield require(room >= least, "the ball is at the end without the hole", room=room, least=least)
        away, least = abs(cage.offset - self.ball_x), cage.hole + 0.005
        beside = cage.face in (END, SIDE) or away >= least
        yield require(beside, "the ball lies over the hole", away=away, least=least)
        # A hand that carries the cage level tilts it by up to 3 deg.
        least = math.radians(4.5)
        yield require(self.rolling_tilt >= least, "the ball rolls in a level cage", tilt=self.rolling_tilt, least=least)

        # The cage stands by itself, in reach.
        half, far = stool.length / 2, abs(cage.offset - self.stool_x) + cage.hole
        covered = cage.face != BOTTOM or (far <= half and cage.hole <= stool.width / 2)
        yield require(covered, "the stool does not cover the hole", far=far, hole=cage.hole, width=stool.width)
        moment = cage.mass * cage.inertial()[0][0] + self.ball.mass * self.ball_x
        lever = abs(moment / (cage.mass + self.ball.mass) - self.stool_x)
        yield require(lever < half, "the cage tips off the stool by itself", lever=lever, half=half)
        yield on_table("the cage", self.foot, margin=cage.length)
        yield within_reach("the cage", self.handle)

    def features(self) -> Mapping[str, float]:
        """Least tilt that frees the ball [rad], its clearance in the hole over its radius, room beyond the hole [m]."""
        return {
            "least_tilt": self.least_tilt,
            "air_over_radius": self.cage.hole / self.ball.radius - 1,
            "room_beyond": self.room_beyond,
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "hole": spoken(self.yaw),
            "trap": spoken(self.yaw + 180.0),
            "tilt": math.degrees(self.least_tilt),
            "ball": self.ball.radius,
        }

    # --- geometry ---------------------------------------------------------------------------

    @cached_property
    def axes(self) -> Mat3:
        """Axes of the cage at the start."""
        return about_z(math.radians(self.yaw))

    @cached_property
    def foot(self) -> Vec3:
        """Centre of the cage's foot at the start [m]."""
        return np.array([self.x, self.y, TABLE_TOP + self.stool.height])

    @cached_property
    def handle(self) -> Vec3:
        """Place at which the hand grasps the cage [m]."""
        return self.foot + GRIP_HEIGHT * UP

    @cached_property
    def way(self) -> float:
        """1 if the ball must roll towards +x in the cage's axes, -1 if towards -x."""
        return math.copysign(1.0, self.cage.offset - self.ball_x) if self.cage.face in (BOTTOM, SIDE) else 1.0

    @cached_property
    def room_beyond(self) -> float:
        """Length on which the ball can lie beyond a hole in the bottom [m]; negative: it ends over the hole."""
        return self.cage.cavity[0] / 2 - self.ball.radius - (self.way * self.cage.offset + self.cage.hole)

    @cached_property
    def rolling_tilt(self) -> float:
        """Tilt of the floor at which the ball starts to roll by itself [rad]."""
        return math.atan(self.rolling)

    @cached_property
    def least_tilt(self) -> float:
        """Tilt that lets the ball out [rad]."""
        return max(self.rolling_tilt, self.cage.rim_tilt(self.ball.radius))
