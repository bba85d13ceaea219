"""T22 ball-cage-escape: get a ball out of a cage whose only hole is blocked by the stool on which the cage stands.

      ________________
     |    (_)         |    seen from the side: the ball lies between two sills. Beyond one is the hole, in the floor,
     |   |___|___ _ _|     on the stool; beyond the other one, which is lower, a trap
     |___|[==========]
            |     |

Bottleneck: the stool blocks the hole, so that no tilt helps before the cage is lifted. The sill holds the ball, so that
no lift helps before the cage is tilted past the angle at which the ball rolls over it: cos(tilt) = 1 - sill / radius
(43.4 deg nominally). Over the other sill it rolls at 23.1 deg, into a pit deeper than its radius, out of which no tilt
leads. The robot must see at which end the hole is; of two ends, a guess is right in half of the scenes.

Decisions. The paper gives the story, no numbers. (1) Sills and trap are ours. On a bare floor the ball lies wherever
the last jerk has left it, lifting alone empties the cage, and a wrong tilt costs nothing. The ball has 5 mm of
clearance between the sills: with more it takes a run-up and jumps at half the angle. (2) The cage must be tilted, not
shaken. A sill holds the ball up to an acceleration of g tan(tilt), 4.2 m/s^2 before the trap and 9.3 before the hole. A
blind shake fills the trap first; a shake to one side, or of a half tilted cage, may free the ball. So the ball must
pass the sill while the floor has the tilt of the law, less `TILT_TOLERANCE`. (3) The jaw holds the cage across its
width, the one edge that it can span; walls are translucent so that cameras see the ball. (4) The stool is fixed: a
tipping one would be another task. (5) The ball must come to rest on the table. Its rolling resistance is that of felt
(coefficient 0.04); a steel ball would leave the table. (6) The cage may not touch the table: knocked off its stool, it
would tilt without a plan.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import mujoco
import numpy as np

from ..assets.ball import Ball
from ..assets.cage import BOTTOM, SIDE, TOP, HoledCage, lean, lowered
from ..assets.prop import TABLE_TOP, place, table
from ..assets.stool import Stool
from ..geometry import UP, Mat3, Vec3, about_z, shortest, spoken
from ..params import param
from ..predicates import fallen, inside, still
from ..robots.jaw import FINGER_ACROSS
from ..scenario import Answer, Plan, Refutation, Scenario, Shortcut, Strict, on_table, require, within_reach
from ..sim.world import Arm, World
from ..skills.jaw import pick, poke
from ..skills.motion import CLOSED, Pace, can_turn, go_to, hold, turn_about_vertical, turn_to, wait

REST_SPEED = 0.02
"""Speed below which the ball counts as at rest [m/s]: at the nominal rolling resistance it stops within 1 mm."""
MAX_HAND_TILT = math.radians(72.0)
"""Tilt that the hand reaches at every heading that `present` may choose [rad], tried for x from -0.2 to 0 m."""
TILT_MARGIN = math.radians(10.0)
"""Angle by which the oracle exceeds the least tilt [rad]: the ball must roll, not creep, and the grip gives some
degrees."""
TILT_TOLERANCE = math.radians(6.0)
"""Angle below the law's at which the ball may still pass the sill [rad]. If the floor turns at up to 2 rad/s the ball
passes at 1.2 deg above that angle or more (120 rollouts, filtered and raw); at 3 rad/s, 5 of 40 pass 6 to 8 deg
below."""
GRIP_HEIGHT = 0.030
"""Height of the grip site above the foot of the cage [m]: the finger tips, 9 mm lower, stay 21 mm above the stool."""
CARRY_PACE = Pace(0.20, 0.01)  # pace with the cage in the hand: slow enough for the sill to hold the ball


@dataclass(frozen=True, kw_only=True)
class BallCageEscape(Scenario):
    """A cage on a stool, the ball between two sills. Lengths are along the cage's axes."""

    HOLD: ClassVar[float] = 0.3

    x: float = param(-0.08, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    yaw: float = param(0.0, "deg", -120.0, 240.0, period=360.0)
    """Direction of the end with the hole; 0 is straight away from the robot."""
    ball_x: float = param(-0.0195, "m", -0.1, 0.1)
    ball_y: float = param(0.0, "m", -0.04, 0.04)
    stool_x: float = param(0.022, "m", -0.1, 0.1)
    """Middle of the stool; 22 mm leave 0.5 mm of plate beyond the hole, and a gap of 10 mm before the trap."""
    rolling: float = param(0.04, "1", 0.0, 0.2)  # rolling resistance of the felt-covered ball, as a share of the load
    cage: HoledCage = HoledCage()
    ball: Ball = Ball(radius=0.015, density=1400.0, friction=0.5, rgba=(0.85, 0.20, 0.15, 1.0))
    stool: Stool = Stool()

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
        if fallen(world, "cage", below=0.0):
            return "the cage fell off the table"
        at, r = world.rot("cage").T @ (world.pos("ball") - world.pos("cage")), self.ball.radius
        if self.cage.traps(at, r):
            return "the ball fell into the trap"
        if self.cage.on_sill(at, r) and lean(world.rot("cage")) < self.cage.tilt_over_sill(r) - TILT_TOLERANCE:
            return Strict("the ball was shaken over the sill")
        return Strict("the cage was dropped or set down") if world.touched("cage", "table") else None

    def out(self, world: World) -> bool:
        """Whether the whole ball is outside the cuboid that the cage fills."""
        middle, reach = self.cage.middle, self.cage.size / 2 + self.ball.radius
        return not inside(world, "ball", "cage", middle - reach, middle + reach)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Lift the cage, carry it aside, and tip it until the ball is over the sill and out."""
        yield from self.pick_up(world)
        yield from self.present(world, self.tilts()[-1])
        back = [lowered(math.radians(tilt)) for tilt in (10.0, -5.0) * 3]  # for a ball that has passed the hole
        for down in [*self.tilts(), *back]:
            if self.out(world):
                break
            yield from self.tip(world, down)
            yield from hold(world.arm, 0.3)
            yield from wait(world.arm, lambda: self.out(world) or still(world, "ball", REST_SPEED), give_up=3.0)
        yield from wait(world.arm, lambda: self.success(world), give_up=4.0)

    def tilts(self) -> list[Vec3]:
        """Unit vectors in the cage's axes that must point down, one after the other."""
        steep = self.least_tilt + TILT_MARGIN
        if self.cage.face != SIDE:
            return [lowered(steep)]
        # For a hole in a side, 0.25 times gravity keeps the ball at the hole's end meanwhile.
        sideways = np.array([0.25, math.sin(steep), -math.cos(steep)])
        return [lowered(self.cage.tilt_over_sill(self.ball.radius) + TILT_MARGIN), sideways / np.linalg.norm(sideways)]

    def pick_up(self, world: World) -> Plan:
        """Take the cage by its width and lift it clear of the stool."""
        yield from pick(world.arm, self.handle, closing=self.axes[:, 1], lift=0.05)

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

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        half, steep = self.least_tilt / 2, self.least_tilt + TILT_MARGIN
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
            return math.cos(math.radians(heading - self.yaw)) > 0

        def act(world: World, heading: float) -> Plan:
            yield from self.tip_only(world, math.copysign(self.least_tilt + TILT_MARGIN, right(heading) - 0.5))

        return Answer(tuple(map(float, range(-90, 270, 15))), act, right, tries=1)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        return {"no_hole": replace(self, cage=replace(self.cage, closed=True)).build()}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        cage, stool, r = self.cage, self.stool, self.ball.radius
        # The ball can leave.
        yield require(cage.margin >= 0, "the hole does not fit into its face", hole=cage.hole, margin=cage.margin)
        yield require(r < cage.hole, "the ball is wider than the hole", ball=r, hole=cage.hole)
        near = cage.offset - cage.hole
        beyond = cage.face not in (BOTTOM, SIDE) or near >= cage.sill_x + cage.wall / 2
        yield require(beyond, "the hole is not beyond the sill", hole=near, sill=cage.sill_x)
        yield require(cage.face != TOP, "the hole looks up, and the hand cannot turn over", steepest=MAX_HAND_TILT)
        tilt, steepest = self.least_tilt + TILT_MARGIN, MAX_HAND_TILT
        yield require(tilt <= steepest, "the ball stays in at every tilt of the hand", tilt=tilt, steepest=steepest)

        # It stays in until the cage is tilted, and a wrong tilt costs it.
        fits = 2 * r <= cage.cavity[2] and r + abs(self.ball_y) <= cage.cavity[1] / 2
        yield require(fits, "the ball does not fit between the walls", radius=r, y=self.ball_y)
        low, high = cage.pocket(r)
        behind = low <= self.ball_x <= high
        yield require(behind, "the ball does not lie between the sills", x=self.ball_x, least=low, largest=high)
        tilt, other = cage.tilt_over_sill(r), cage.tilt_into_trap(r)
        # A hand that carries the cage level tilts it by up to 3 deg, and brakes at up to 2 m/s^2, which tilts the
        # apparent gravity by 12 deg.
        least = math.radians(20.0)
        yield require(other >= least, "the sill does not hold the ball", tilt=other, least=least)
        yield require(other < tilt, "the trap does not fill before the ball is free", trap=other, hole=tilt)
        length, tilt = cage.trap_length, cage.tilt_out_of_trap(r)
        yield require(2 * r <= length, "the trap does not take the ball", length=length, radius=r)
        yield require(tilt > MAX_HAND_TILT, "the ball rolls out of the trap again", tilt=tilt, steepest=MAX_HAND_TILT)

        # The cage stands by itself, in reach.
        half, far = stool.length / 2, abs(cage.offset - self.stool_x) + cage.hole
        covered = cage.face != BOTTOM or (far <= half and cage.hole <= stool.width / 2)
        yield require(covered, "the stool does not cover the hole", far=far, hole=cage.hole, width=stool.width)
        beside = min(self.stool_x - half - cage.trap_x - cage.wall / 2, stool.height - cage.trap)
        least = 0.004  # [m]; the robot places a cage to 2 mm
        yield require(beside >= least, "the trap has no room beside the stool", room=beside, least=least)
        moment = cage.mass * cage.inertial()[0][0] + self.ball.mass * self.ball_x
        lever = abs(moment / (cage.mass + self.ball.mass) - self.stool_x)
        yield require(lever < half, "the cage tips off the stool by itself", lever=lever, half=half)
        yield on_table("the cage", self.foot, margin=cage.length)
        yield within_reach("the cage", self.handle)

    def features(self) -> Mapping[str, float]:
        """Least tilt that frees the ball [rad], and clearance of the ball in the hole over its radius."""
        return {"least_tilt": self.least_tilt, "air_over_radius": self.cage.hole / self.ball.radius - 1}

    def facts(self) -> Mapping[str, float | str]:
        return {
            "hole": spoken(self.yaw),
            "trap": spoken(self.yaw + 180.0),
            "tilt": math.degrees(self.least_tilt),
            "ball": self.ball.radius,
        }

    # --- geometry ---------------------------------------------------------------------------

    @property
    def axes(self) -> Mat3:
        """Axes of the cage at the start."""
        return about_z(math.radians(self.yaw))

    @property
    def foot(self) -> Vec3:
        """Centre of the cage's foot at the start [m]."""
        return np.array([self.x, self.y, TABLE_TOP + self.stool.height])

    @property
    def handle(self) -> Vec3:
        """Place at which the hand grasps the cage [m]."""
        return self.foot + GRIP_HEIGHT * UP

    @property
    def least_tilt(self) -> float:
        """Tilt that lets the ball out [rad]."""
        return self.cage.least_tilt(self.ball.radius)
