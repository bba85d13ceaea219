"""T22 ball-cage-escape: get a ball out of a cage whose only hole is blocked by the stool that it stands on.

      ________________
     | (_)   |        |     seen from the side; the sill lies between the ball and the hole,
     |_______|____ _ _|     which is in the floor near one end and rests on the stool
              [=======]
               |     |

Bottleneck: two things keep the ball in, and each hides the other. The stool blocks the hole, so that no tilt helps
before the cage is lifted; the sill holds the ball, so that no lift helps before the cage is tilted, towards the right
end, past the angle at which the ball rolls over the sill: cos(tilt) = 1 - sill / radius (36.9 deg nominally).

Decisions. The paper gives the story, no numbers. (1) The sill is ours. On a bare floor the ball lies wherever the last
jerk has left it, lifting alone empties the cage as soon as it rolls across the hole, and "the reorientation must
account for the ball's position" would be an accident; with the sill it is a law with a number. It stands one
centimetre before the ball: with more room the ball takes a run-up, and jumps a sill of 3 mm at half the angle. (2) The
jaw holds the cage across its width, the one edge that it can span; walls are translucent so that cameras see ball and
hole. (3) The stool is fixed: a tipping stool would be another task. (4) The ball must come to rest on the table. A ball
on the floor is out of reach, hence a failure. It rolls like a felt ball (coefficient 0.04); a steel ball would leave
every table. (5) The cage may not touch the table: knocked off its stool it tumbles, and a tumbling cage tilts without
anybody having thought about it; whoever drops it or sets it down has given up the plan of the paper, "lift, tilt,
reorient".
"""

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from ..assets.ball import Ball
from ..assets.cage import BOTTOM, SIDE, TOP, HoledCage
from ..assets.prop import TABLE_TOP, place, table
from ..assets.stool import Stool
from ..geometry import UP, Mat3, Vec3, about_z, shortest
from ..params import param
from ..predicates import fallen, inside, still
from ..robots.jaw import FINGER
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import Arm, World
from ..skills.jaw import pick, poke
from ..skills.motion import WRIST_SPARE, Pace, can_turn, go_to, hand_yaw, hold, turn_about_vertical, turn_to, wait

STILL = 0.02
"""Speed below which the ball counts as lying [m/s]: at the nominal rolling friction it stops within 1 mm."""
LEAST_HELD = math.radians(20.0)
"""Least tilt that the sill must withstand [rad]. A hand that carries the cage level tilts it by up to 3 deg, and
brakes at up to 2 m/s^2, which tilts the apparent gravity by 12 deg."""
STEEPEST = math.radians(72.0)
"""Tilt that the hand reaches low over the table at every heading that `present` may choose [rad], tried on the model
between x = -0.2 and 0 m."""
SPARE = math.radians(13.0)
"""How far past the least tilt the oracle goes [rad]: the ball must roll, not creep, and the grip gives some degrees."""
HOLD_AT_END = 0.25
"""For a hole in a side: component of gravity that keeps the ball at the hole's end meanwhile, over the other ones."""
HANDLE = 0.030
"""Height of the grip site above the foot of the cage [m]: the finger tips, 9 mm lower, stay 21 mm above the stool."""
ROOM = 0.040
"""Free height below the lowest edge of the tilted cage [m]; the ball passes under it."""
ASIDE = 0.19
"""How far from the stool the cage is emptied [m]: the tilted cage and the stool reach 0.07 m each."""
WIDEST = math.radians(55.0)
"""The cage is emptied towards a heading between straight ahead and this far to the middle [rad]: there the hand can
lean far, and the ball has half a metre to run out."""
LEVEL = Pace(0.20, 0.01)
"""With the cage in the hand: slow enough for the sill to hold the ball."""


@dataclass(frozen=True, kw_only=True)
class BallCageEscape(Scenario):
    """A cage on a stool, the ball behind the sill, the hole near the other end. Lengths are along the cage's axes."""

    HOLD: ClassVar[float] = 0.3

    x: float = param(-0.08, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    yaw: float = param(0.0, "deg", -180.0, 180.0, period=360.0)
    """Where the end with the hole points; at 0 straight away from the robot."""
    ball_x: float = param(-0.042, "m", -0.1, 0.1)
    ball_y: float = param(0.0, "m", -0.04, 0.04)
    stool_x: float = param(0.0195, "m", -0.1, 0.1)
    """Middle of the stool; 19.5 mm leave 1.5 mm of plate beyond the hole."""
    rolling: float = param(0.04, "1", 0.0, 0.2)
    """Resistance to rolling of the felt-covered ball, as a share of the load."""
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
        place(scene, dataclasses.replace(self.ball, rolling=self.rolling), "ball", ball)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return world.touching("ball", "table") and still(world, "ball", STILL) and self.out(world)

    def failure(self, world: World) -> str | None:
        if fallen(world, "ball", below=0.0):
            return "the ball fell off the table"
        if world.touched("cage", "table") or fallen(world, "cage", below=0.0):
            return "the cage was dropped or set down"
        return None

    def out(self, world: World) -> bool:
        """Whether the whole ball is outside the cuboid that the cage fills."""
        middle, reach = self.cage.middle, self.cage.size / 2 + self.ball.radius
        return not inside(world, "ball", "cage", middle - reach, middle + reach)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Lift the cage, carry it aside, tip it until the ball is over the sill, and on until it is out."""
        yield from self.pick_up(world)
        yield from self.present(world, self.tilts()[-1])
        for down in self.tilts():
            yield from self.tip(world, down)
            yield from self.watch(world)
        for shallow in (10.0, -5.0) * 3:  # past the hole at a steep tilt: back it comes, at a gentle one
            if self.out(world):
                break
            yield from self.tip(world, _towards_end(math.radians(shallow)))
            yield from self.watch(world)
        yield from wait(world.arm, lambda: self.success(world), give_up=4.0)

    def tilts(self) -> list[Vec3]:
        """Where down must be, in the cage's axes, one after the other: unit vectors."""
        steep = self.least_tilt + SPARE
        if self.cage.face != SIDE:
            return [_towards_end(steep)]
        aside = np.array([HOLD_AT_END, math.sin(steep), -math.cos(steep)])
        return [_towards_end(self.cage.tilt_over_sill(self.ball.radius) + SPARE), aside / np.linalg.norm(aside)]

    def pick_up(self, world: World) -> Plan:
        """Take the cage by its width and lift it clear of the stool.

        If joint 7 allows, the hand turns as the cage is turned: then it turns back in `present`.
        """
        turn = math.radians(self.yaw) - hand_yaw(world.arm)
        turn = next(t for t in (turn, turn - math.pi, turn + math.pi) if can_turn(world.arm, t))
        yield from turn_about_vertical(world.arm, turn)
        yield from pick(world.arm, self.handle, closing=self.axes[:, 1], lift=0.05)

    def present(self, world: World, down: Vec3) -> Plan:
        """Carry the cage level to a free place, low over the table, and turn it until `down` can come to point down."""
        arm, side, steep = world.arm, -1.0 if self.y > 0 else 1.0, math.acos(-down[2])
        low = math.hypot(self.cage.length, self.cage.width) / 2 * math.sin(steep) + HANDLE * math.cos(steep) + ROOM
        spot = np.array([min(max(self.x, -0.15), -0.05), self.y + side * ASIDE, TABLE_TOP + low])
        yield from go_to(arm, [spot[0], spot[1], max(arm.hand[2], spot[2])], pace=LEVEL)
        yield from go_to(arm, spot, pace=LEVEL)
        yield from turn_about_vertical(arm, self._turn_to_front(arm, world.rot("cage") @ down, -side))

    def _turn_to_front(self, arm: Arm, leaning: Vec3, side: float) -> float:
        """The least turn of the hand that takes a direction to the front, or up to `WIDEST` to a side of it [rad].

        With a hole in a side it is the turn that takes it straightest to the front, as far as joint 7 can go: such a
        cage is tipped towards its end first, and the end must not point to the robot.
        """
        heading, laps = math.atan2(leaning[1], leaning[0]), (-2 * math.pi, 0.0, 2 * math.pi)
        aside = {side * front - heading + lap: front for front in np.linspace(0.0, WIDEST, 12) for lap in laps}
        possible = [turn for turn in aside if can_turn(arm, turn, WRIST_SPARE / 2)]  # leaning relieves joint 7
        return min(possible, key=aside.__getitem__ if self.cage.face == SIDE else abs)

    def tip(self, world: World, down: Vec3, rate: float = 1.0) -> Plan:
        """Turn the cage about the hand, the shortest way, until `down` in its axes points down, or the ball is out."""
        rot = shortest(world.rot("cage") @ down, -UP) @ world.arm.hand_rot
        yield from turn_to(world.arm, rot, rate, until=lambda: self.out(world))

    def watch(self, world: World) -> Plan:
        """Wait until the ball has come to rest in the cage, or is out."""

        def quiet() -> bool:
            return float(np.linalg.norm((world.velocity("ball") - world.velocity("cage"))[3:])) < STILL

        yield from hold(world.arm, 0.3)
        yield from wait(world.arm, lambda: self.out(world) or quiet(), give_up=3.0)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "lift_it_off_the_stool": Shortcut(lambda world: self.tip_only(world, 0.0)),
            "tip_it_half_as_far": Shortcut(lambda world: self.tip_only(world, self.least_tilt / 2)),
            "tip_it_to_the_wrong_end": Shortcut(lambda world: self.tip_only(world, -self.least_tilt - SPARE)),
            "knock_it_off_the_stool": Shortcut(self._knock_off),
        }

    def tip_only(self, world: World, tilt: float) -> Plan:
        """As the oracle, with another tilt [rad] and nothing after it."""
        yield from self.pick_up(world)
        yield from self.present(world, _towards_end(tilt))
        yield from self.tip(world, _towards_end(tilt), rate=0.5)
        yield from hold(world.arm, 1.0)

    def _knock_off(self, world: World) -> Plan:
        """Push the cage over the end of the stool with closed fingers, the holed end first."""
        u = self.axes[:, 0]
        behind = self.handle - (self.cage.length / 2 + FINGER + 0.04) * u
        yield from poke(world.arm, behind, 0.15 * u, until=lambda: world.touched("cage", "table"))

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        closed = dataclasses.replace(self.cage, closed=True)
        return {"no_hole": dataclasses.replace(self, cage=closed).build()}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        cage, stool, r = self.cage, self.stool, self.ball.radius
        # The ball can leave.
        yield require(cage.margin >= 0, "the hole does not fit into its face", hole=cage.hole, margin=cage.margin)
        yield require(r < cage.hole, "the ball is wider than the hole", ball=r, hole=cage.hole)
        near = cage.offset - cage.hole
        beyond = cage.face not in (BOTTOM, SIDE) or near >= cage.sill_x + cage.wall / 2
        yield require(beyond, "the hole is not beyond the sill", hole=near, sill=cage.sill_x)
        yield require(cage.face != TOP, "the hole looks up, and the hand cannot turn over", steepest=STEEPEST)
        tilt = self.least_tilt + SPARE
        yield require(tilt <= STEEPEST, "the ball stays in at every tilt of the hand", tilt=tilt, steepest=STEEPEST)

        # It stays in until the cage is tilted.
        fits = 2 * r <= cage.cavity[2] and r + abs(self.ball_y) <= cage.cavity[1] / 2
        yield require(fits, "the ball does not fit between the walls", radius=r, y=self.ball_y)
        low, high = cage.pocket(r)
        behind = low <= self.ball_x <= high
        yield require(behind, "the ball does not lie behind the sill", x=self.ball_x, least=low, largest=high)
        tilt = cage.tilt_over_sill(r)
        yield require(tilt >= LEAST_HELD, "the sill does not hold the ball", tilt=tilt, least=LEAST_HELD)

        # The cage stands by itself, where the hand can take it.
        half, far = stool.length / 2, abs(cage.offset - self.stool_x) + cage.hole
        covered = cage.face != BOTTOM or (far <= half and cage.hole <= stool.width / 2)
        yield require(covered, "the stool does not cover the hole", far=far, hole=cage.hole, width=stool.width)
        load = (cage.mass * cage.inertial()[0][0] + self.ball.mass * self.ball_x) / (cage.mass + self.ball.mass)
        lever = abs(load - self.stool_x)
        yield require(lever < half, "the cage tips off the stool by itself", lever=lever, half=half)
        yield on_table("the cage", self.foot, margin=cage.length)
        yield within_reach("the cage", self.handle)

    def features(self) -> Mapping[str, float]:
        """How far the cage must be tilted [rad], and the air that the hole leaves round the ball."""
        return {"least_tilt": self.least_tilt, "air_over_radius": self.cage.hole / self.ball.radius - 1}

    # --- geometry ---------------------------------------------------------------------------

    @property
    def axes(self) -> Mat3:
        """The cage's axes at the start."""
        return about_z(math.radians(self.yaw))

    @property
    def foot(self) -> Vec3:
        """Where the cage stands [m]: the centre of its foot."""
        return np.array([self.x, self.y, TABLE_TOP + self.stool.height])

    @property
    def handle(self) -> Vec3:
        """Where the hand takes the cage [m]."""
        return self.foot + HANDLE * UP

    @property
    def least_tilt(self) -> float:
        """Tilt that lets the ball out [rad]."""
        return self.cage.least_tilt(self.ball.radius)


def _towards_end(tilt: float) -> Vec3:
    """Where down is in a cage whose holed end is lowered by `tilt` [rad]."""
    return np.array([math.sin(tilt), 0.0, -math.cos(tilt)])
