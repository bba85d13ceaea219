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
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from ..assets.ball import Ball
from ..assets.cage import BOTTOM, SIDE, TOP, HoledCage
from ..assets.prop import TABLE_HALF, TABLE_TOP, UP, place, table
from ..assets.stool import Stool
from ..params import param
from ..robots.panda import REACH, SHOULDER
from ..scenario import Plan, Planner, Refutation, Scenario
from ..sim.world import Mat3, Vec3, World
from ..skills.motion import CLOSED, OPEN, facing_down, go_to, grasp, hold, push, rotate, wait

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
KEEP = 0.25
"""For a hole in a side: component of gravity that keeps the ball at the hole's end meanwhile, over the other ones."""
HANDLE = 0.030
"""Height of the grip site above the foot of the cage [m]: the finger tips, 12 mm lower, stay 18 mm above the stool."""
ROOM = 0.040
"""Free height below the lowest edge of the tilted cage [m]; the ball passes under it."""
ASIDE = 0.19
"""How far from the stool the cage is emptied [m]: the tilted cage and the stool reach 0.07 m each."""
WIDEST = math.radians(55.0)
"""The cage is emptied towards a heading between straight ahead and this far to the middle [rad]: there the hand can
lean far, and the ball has half a metre to run out."""
YAW_LEAST, YAW_MOST = math.radians(-100.0), math.radians(190.0)
"""Turns of the downward hand that joint 7 allows with 10 deg and more to spare [rad]: its limits are +-2.897 rad, and
it is at pi / 4 where the hand is not turned."""
RUN_UP = 0.05
"""Distance behind the cage from which it is pushed [m]: half the thickness of a closed jaw, and air."""
LAPS = (-2 * math.pi, 0.0, 2 * math.pi)
HALF_TURNS = (0.0, -math.pi, math.pi)


@dataclass(frozen=True, kw_only=True)
class BallCageEscape(Scenario):
    """A cage on a stool, the ball behind the sill, the hole near the other end. Lengths are along the cage's axes."""

    HOLD = 0.3

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

    # --- geometry -------------------------------------------------------------------------

    @property
    def axes(self) -> Mat3:
        """The cage's axes at the start."""
        c, s = math.cos(math.radians(self.yaw)), math.sin(math.radians(self.yaw))
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    @property
    def foot(self) -> Vec3:
        """Where the cage stands [m]: the centre of its foot."""
        return np.array([self.x, self.y, TABLE_TOP + self.stool.height])

    @property
    def lip(self) -> float:
        """Height of the hole's rim above the floor, for a hole in an upright wall [m]."""
        return self.cage.cavity[2] / 2 - self.cage.hole

    @property
    def least_tilt(self) -> float:
        """Tilt that lets the ball roll over the sill and, where the hole is in a wall, over its rim [rad]."""
        over_sill = self.cage.tilt_over_sill(self.ball.radius)
        if self.cage.face == BOTTOM:
            return over_sill
        return max(over_sill, math.acos(max(-1.0, 1 - self.lip / self.ball.radius)))

    @property
    def pocket(self) -> tuple[float, float]:
        """Where the ball's centre may lie behind the sill: least and largest x [m]."""
        r, sill = self.ball.radius, min(self.cage.sill, self.ball.radius)
        touching = self.cage.wall / 2 + math.sqrt(2 * r * sill - sill**2)
        return r - self.cage.cavity[0] / 2, self.cage.sill_x - touching

    def infeasible(self) -> Refutation | None:
        return self._ball_cannot_leave() or self._ball_cannot_stay() or self._cage_cannot_stand()

    def _ball_cannot_leave(self) -> Refutation | None:
        cage, r = self.cage, self.ball.radius
        if cage.margin < 0:
            return Refutation("the hole does not fit into its face", {"hole": cage.hole, "margin": cage.margin})
        if r >= cage.hole:
            return Refutation("the ball is wider than the hole", {"ball": r, "hole": cage.hole})
        if cage.face in (BOTTOM, SIDE) and cage.offset - cage.hole < cage.sill_x + cage.wall / 2:
            return Refutation("the hole is not beyond the sill", {"hole": cage.offset - cage.hole, "sill": cage.sill_x})
        if cage.face == TOP:
            return Refutation("the hole looks up, and the hand cannot turn over", {"steepest": STEEPEST})
        if self.least_tilt + SPARE > STEEPEST:
            numbers = {"least": self.least_tilt, "spare": SPARE, "steepest": STEEPEST}
            return Refutation("the ball stays in at every tilt that the hand reaches", numbers)
        return None

    def _ball_cannot_stay(self) -> Refutation | None:
        cage, r = self.cage, self.ball.radius
        if 2 * r > cage.cavity[2] or r + abs(self.ball_y) > cage.cavity[1] / 2:
            return Refutation("the ball does not fit between the walls", {"radius": r, "y": self.ball_y})
        low, high = self.pocket
        if not low <= self.ball_x <= high:
            return Refutation("the ball does not lie behind the sill", {"x": self.ball_x, "from": low, "to": high})
        if (held := cage.tilt_over_sill(r)) < LEAST_HELD:
            return Refutation("the sill does not hold the ball", {"tilt": held, "least": LEAST_HELD})
        return None

    def _cage_cannot_stand(self) -> Refutation | None:
        cage, stool = self.cage, self.stool
        before, behind = self.stool_x - stool.length / 2, self.stool_x + stool.length / 2
        hole = cage.offset - cage.hole, cage.offset + cage.hole
        if cage.face == BOTTOM and not (before <= hole[0] and hole[1] <= behind and cage.hole <= stool.width / 2):
            return Refutation(
                "the stool does not cover the hole", {"near": before, "far": behind, "width": stool.width}
            )
        load = (cage.mass * cage.inertial()[0][0] + self.ball.mass * self.ball_x) / (cage.mass + self.ball.mass)
        if not before < load < behind:
            return Refutation("the cage tips off the stool by itself", {"load": load, "near": before, "far": behind})
        if (far := float(np.abs(self.foot[:2]).max()) + cage.length) > TABLE_HALF:
            return Refutation("the cage stands too near the edge of the table", {"farthest": far, "edge": TABLE_HALF})
        if (away := float(np.linalg.norm(self.foot + HANDLE * UP - SHOULDER))) > REACH:
            return Refutation("the cage is out of reach", {"distance": away, "reach": REACH})
        return None

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.cage)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        return {"no hole": self._scene(dataclasses.replace(self.cage, closed=True))}

    def _scene(self, cage: HoledCage) -> mujoco.MjSpec:
        scene, yaw = table(), math.radians(self.yaw)
        place(
            scene, self.stool, "stool", self.foot + self.axes @ [self.stool_x, 0, -self.stool.height], yaw, free=False
        )
        place(scene, cage, "cage", self.foot, yaw)
        inside = [self.ball_x, self.ball_y, cage.wall + self.ball.radius]
        place(scene, self.ball, "ball", self.foot + self.axes @ inside)
        felt = scene.geom("ball/ball")
        felt.condim, felt.friction[2] = 6, self.rolling * self.ball.radius  # MuJoCo's coefficient is a length
        return scene

    # --- goal -----------------------------------------------------------------------------

    def out(self, world: World) -> bool:
        """Whether the whole ball is outside the cuboid that the cage fills."""
        beyond = np.abs(self.ball_in_cage(world) - self.cage.middle) - self.cage.size / 2
        return bool(beyond.max() > self.ball.radius)

    def ball_in_cage(self, world: World) -> Vec3:
        """The ball's centre in the cage's axes [m]."""
        return world.rot("cage").T @ (world.com("ball") - world.pos("cage"))

    def success(self, world: World) -> bool:
        velocity = world.velocity("ball")[3:]
        return world.touching("ball", "table") and math.sqrt(velocity @ velocity) < STILL and self.out(world)

    def failure(self, world: World) -> str | None:
        if world.com("ball")[2] < TABLE_TOP:
            return "the ball fell off the table"
        if world.touched("cage", "table") or world.com("cage")[2] < TABLE_TOP:
            return "the cage was dropped or set down"
        return None

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
        yield from wait(world, lambda: self.success(world), give_up=4.0)

    def tilts(self) -> list[Vec3]:
        """Where down must be, in the cage's axes, one after the other: unit vectors, shape (3,)."""
        steep = self.least_tilt + SPARE
        if self.cage.face != SIDE:
            return [_towards_end(steep)]
        aside = np.array([KEEP, math.sin(steep), -math.cos(steep)])
        return [_towards_end(self.cage.tilt_over_sill(self.ball.radius) + SPARE), aside / np.linalg.norm(aside)]

    def pick_up(self, world: World) -> Plan:
        """Take the cage by its width and lift it clear of the stool."""
        handle, yaw = self.foot + HANDLE * UP, self._grip_yaw()
        halfway = facing_down(yaw / 2)  # from there on the shorter way round is the one that joint 7 can go
        yield from go_to(world, handle + 0.10 * UP, halfway, grip=OPEN, within=0.03)
        yield from go_to(world, handle + 0.06 * UP, facing_down(yaw), within=0.015)
        yield from go_to(world, handle, speed=0.15, within=0.005)
        yield from grasp(world, 0.3)
        yield from go_to(world, handle + 0.05 * UP, speed=0.10, within=0.01)

    def _grip_yaw(self) -> float:
        """Turn of the hand that spans the cage's width and leaves joint 7 room [rad]."""
        return next(y for y in (math.radians(self.yaw) + half for half in HALF_TURNS) if YAW_LEAST <= y <= YAW_MOST)

    def present(self, world: World, down: Vec3) -> Plan:
        """Carry the cage level to a free place, low over the table, and turn it until `down` can come to point down."""
        steep = math.acos(-down[2])
        low = math.hypot(self.cage.length, self.cage.width) / 2 * math.sin(steep) + HANDLE * math.cos(steep) + ROOM
        side = -1.0 if self.y > 0 else 1.0
        spot = np.array([min(max(self.x, -0.15), -0.05), self.y + side * ASIDE, TABLE_TOP + low])
        yield from go_to(world, [spot[0], spot[1], max(world.hand[2], spot[2])], speed=0.2, within=0.01)
        yield from go_to(world, spot, speed=0.2, within=0.01)
        turn = self._turn_to_middle(world, world.rot("cage") @ down, -side)
        for _ in range(2):  # each half is the shorter way
            yield from rotate(world, _about_z(turn / 2) @ world.hand_rot, rate=2.0)

    @staticmethod
    def _turn_to_middle(world: World, leaning: Vec3, side: float) -> float:
        """The smallest turn of the hand that takes a direction to the front, and to the table's middle [rad].

        Out of its 360 deg more or less, one that joint 7 can go.
        """
        heading, yaw = math.atan2(leaning[1], leaning[0]), hand_yaw(world)
        turns = [side * front - heading + lap for front in np.linspace(0.0, WIDEST, 12) for lap in LAPS]
        return min((t for t in turns if YAW_LEAST <= yaw + t <= YAW_MOST), key=abs)

    def tip(self, world: World, down: Vec3, rate: float = 1.0) -> Plan:
        """Turn the cage about the hand, the shortest way, until `down` in its axes points down, or the ball is out."""
        turn = _shortest(world.rot("cage") @ down, -UP)
        yield from rotate(world, turn @ world.hand_rot, rate, until=lambda: self.out(world))

    def watch(self, world: World) -> Plan:
        """Wait until the ball has come to rest in the cage, or is out."""

        def quiet() -> bool:
            relative = world.velocity("ball")[3:] - world.velocity("cage")[3:]
            return math.sqrt(relative @ relative) < STILL

        yield from hold(world, 0.3)
        yield from wait(world, lambda: self.out(world) or quiet(), give_up=3.0)

    # --- shortcuts ------------------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Planner]:
        return {
            "lift it off the stool": lambda world: self._tip_only(world, 0.0),
            "tip it half as far": lambda world: self._tip_only(world, self.least_tilt / 2),
            "tip it to the wrong end": lambda world: self._tip_only(world, -self.least_tilt - SPARE),
            "knock it off the stool": self._knock_off,
        }

    def _tip_only(self, world: World, tilt: float) -> Plan:
        """As the oracle, with another tilt and nothing after it."""
        yield from self.pick_up(world)
        yield from self.present(world, _towards_end(tilt))
        yield from self.tip(world, _towards_end(tilt), rate=0.5)
        yield from hold(world, 1.0)

    def _knock_off(self, world: World) -> Plan:
        """Push the cage over the end of the stool with closed fingers, the holed end first."""
        u = self.axes[:, 0]
        behind = self.foot + HANDLE * UP - (self.cage.length / 2 + RUN_UP) * u
        across = facing_down(math.radians((self.yaw + 90.0) % 180.0))
        yield from go_to(world, behind + 0.08 * UP, across, grip=CLOSED, within=0.01)
        yield from go_to(world, behind, within=0.01)
        yield from push(world, 0.15 * u, until=lambda: world.touched("cage", "table"))

    # --- features -------------------------------------------------------------------------

    def features(self) -> Mapping[str, float]:
        """How far the cage must be tilted [rad], and the air that the hole leaves round the ball."""
        return {"least tilt": self.least_tilt, "air over radius": self.cage.hole / self.ball.radius - 1}


def _towards_end(tilt: float) -> Vec3:
    """Where down is in a cage whose holed end is lowered by `tilt` [rad]."""
    return np.array([math.sin(tilt), 0.0, -math.cos(tilt)])


def hand_yaw(world: World) -> float:
    """The `yaw` of `facing_down` for a hand that points about down, counted from -125 deg up [rad]."""
    x = world.hand_rot[:, 0]
    return (math.atan2(-x[0], x[1]) + math.radians(125.0)) % (2 * math.pi) - math.radians(125.0)


def _about_z(angle: float) -> Mat3:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _shortest(here: Vec3, there: Vec3) -> Mat3:
    """The smallest rotation that takes one unit vector, not opposite to the other, to the other."""
    v, c = np.cross(here, there), float(here @ there)
    k = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + k + k @ k / (1.0 + c)
