"""T10 cube-toss: throw a cube into a tray that stands farther away than the arm can stretch.

          __
      ===|hand|-> o  .                seen from the side; the swing runs out from the robot along +u
     /        table    .
    robot    ------+     .
      |      |     |      .
      |      |     |    |___| tray    on the floor, 1.00 to 1.05 m from its axis

Bottleneck: the hand never gets over the tray. Where the cube comes down is settled when it is let go, by where it is
then, how fast it is and which way it goes; nothing can be put right afterwards.

How far a Panda throws. Under OSC_POSE the hand does 0.30 m/s along an axis. A pitch added to it drags the hand along,
as position and rotation are controlled as if they were independent: from straight down, 0.63 m from its axis, the hand
swings out and up and leaves the cube 0.90 m from the axis with at least 0.33 m/s outwards and 0.42 m/s upwards. Half a
second later the cube comes down on the floor, at 1.07 to 1.10 m, at bearings from 30 to 65 deg on either side. No
posture holds it farther out than 0.94 m (`panda.REACH`). The tray stands between the two; straight ahead the table is
in the way.

Decisions, where the paper (App. B, T10) is silent or contradicts itself:

* "A gripper holds a cube" (set-up), "lift the cube and throw it" (plan): the cube lies on the table and is picked up.
* It gives no distances, and speaks of a goal zone. All of the table is within reach, so the zone is on the floor; and
  as a cube that falls from 1.1 m tumbles on where it lands, it is a tray with walls, which faces the robot.
* There is one throw: the floor, on which a cube is lost, is out of reach.
* On an axis of ours the tray rides on a rail around the robot, from a moment that nobody knows beforehand: the same
  throw, to where the tray is going to be. "Comes to rest inside the goal zone" then means relative to the tray.

The oracle foresees in every period where the cube would come down if it were let go, and steers not the hand but that
place: sideways and outwards, by swinging faster or slower, until it stays in the middle of the tray. Then it opens the
jaw. Noise and a cube that sits askew are corrected on the way, and the moment hardly matters: opened 0.1 s earlier or
later the jaw lets the cube land within 1 cm of the same place.
"""

import math
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..assets.bin import Bin
from ..assets.box import Cube
from ..assets.prop import TABLE_HALF, TABLE_TOP, place, solid, table
from ..control.loop import Loop
from ..geometry import UP, Vec3, about_z, axes, heading, polar, quat, rotation
from ..params import param
from ..physics import flight
from ..predicates import seated
from ..robots import jaw
from ..robots.panda import BASE, REACH
from ..scenario import Action, Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import World
from ..skills.grip import take
from ..skills.jaw import release
from ..skills.motion import CLOSED, COARSE, OPEN, facing_down, go_to, hold, push, turn_to, until

AXIS: Vec3 = BASE * [1.0, 1.0, 0.0]
"""Where the robot's first axis meets the floor [m]."""
WOUND, ARRIVED, CALM = (0.63, 0.95), 0.02, 0.2
"""Where the swing begins, hand pointing down: distance from the axis and height of the grip site [m], how near to it is
there [m], and how long it is held there [s]. The place where throws at all bearings go farthest, flat within 5 cm."""
RISE, FEED = 0.3, 0.7
"""Action upwards in a swing, and outwards once the cube would come down where it should."""
GAIN, LEVEL = 40.0, 4.0
"""Action per metre by which it would come down elsewhere, and per radian by which the closing axis is off the level."""
LOST = 0.006
"""By how much less far the cube flies than foreseen when it is let go [m]: the fingers hold it back, 4 to 10 mm."""
EXACT, STEADY, SLOPE = (0.006, 0.012), 0.15, 5
"""How near to the middle of the tray the cube must be bound to come down, along and across the swing [m], how fast that
place may still move [m/s], and over how many periods this is seen."""
TRUSTED, LONGEST, FOLLOW = 0.1, 0.9, 0.2
"""When after its start a swing is judged first, when the jaw opens at the latest, and how long the swing goes on then
[s]."""
THROWN, RADIUS, HEIGHT = (0.33, 0.42), 0.90, 1.15
"""Velocity outwards and upwards [m/s], distance from the axis and height [m] at which a full swing leaves a cube: the
least of what was measured at bearings from 30 to 75 deg."""
SWUNG = 75.0
"""Largest bearing at which that was measured [deg]."""
STILL = 0.02
"""Speed below which the cube counts as at rest [m/s]."""
STRETCHED = 0.92
"""How far from its axis the arm is stretched for a drop [m]; farther out it trembles."""
EYES = {"agentview": (2.0, 0.0, 1.9), "sideview": (1.9, 0.5, 2.1)}
"""Where two of the arena's cameras stand, so that they see the floor on both sides of the table [m]. Elsewhere they see
the table alone."""
MIDDLE: Vec3 = np.array([0.1, 0.0, 0.45])
"""What they look at [m]."""
RAIL, RAISED = "rail", 0.01
"""Hinge on which a tray rides around the robot, and how far over the floor [m]."""
LEAD, ENDS = 3.2, 6.5
"""How long after it has been picked up the cube comes down, about, and when at the latest it does [s]."""
YELLOW = (0.95, 0.75, 0.20, 1.0)
"""Of the tray, on a grey floor."""

Opens = Callable[[float, float, float], bool]
"""Whether to open the jaw, asked with what is missing to the middle of the tray along the swing and across it [m], and
how fast the former gets less [m/s]."""


@dataclass(frozen=True, kw_only=True)
class CubeToss(Scenario):
    """A cube on the table and a tray on the floor, or on a post, beyond the arm's reach."""

    HOLD = 0.3

    distance: float = param(1.035, "m", 0.9, 1.3)
    """Of the middle of the tray from the robot's first axis."""
    bearing: float = param(50.0, "deg", -110.0, 110.0)
    """Of the tray; 0 is ahead of the robot, 90 to its left."""
    stand: float = param(0.0, "m", 0.0, 0.6)
    """Height of the post under the tray."""
    turn: float = param(0.0, "deg", -45.0, 45.0, period=90.0)
    """Of the tray, against facing the robot."""
    opening: float = param(0.095, "m", 0.06, 0.20)
    """Of the tray: the length of its inner sides."""
    rate: float = param(0.0, "deg/s", -10.0, 10.0)
    """At which the tray rides on a rail around the robot, once it does, away from straight ahead."""
    launch: float = param(2.0, "s", 0.5, 4.0)
    """When."""
    x: float = param(-0.10, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)
    cube: Cube = Cube(edge=0.040, mass=0.05, friction=0.8)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        place(scene, self.cube, "cube", self.start, math.radians(self.yaw))
        if self.stand:
            half = self.stand / 2
            post = scene.worldbody.add_body(name="post", pos=self.spot - half * UP)
            solid(post, "post", [0.03, 0.03, half], rgba=self.tray.rgba)
        place(scene, self.tray, "tray", self.spot, math.radians(self.bearing + self.turn), free=False)
        if self.rate:
            to_axis = about_z(-math.radians(self.turn)) @ [-self.distance, 0.0, 0.0]
            scene.body("tray").add_joint(name=RAIL, type=mujoco.mjtJoint.mjJNT_HINGE, axis=UP, pos=to_axis)
        for name, eye in EYES.items():
            camera = scene.camera(name)
            camera.pos, camera.quat = eye, _towards(MIDDLE - np.array(eye))
        return scene

    def events(self, world: World) -> None:
        if self.rate and world.passes(self.launch):
            world.spin(RAIL, math.copysign(1.0, self.bearing) * math.radians(self.rate))

    def pending(self, world: World) -> bool:
        return bool(self.rate) and world.time < self.launch + Loop.PERIOD / 2

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        tray, half = self.tray, self.opening / 2
        middle = world.pos("tray") + (tray.floor + tray.depth / 2) * UP
        lies = seated(world, "cube", "tray", middle, math.sqrt(2) * half, tray.depth / 2)
        slips = world.velocity("cube")[3:] - world.velocity("tray")[3:]
        return lies and math.sqrt(slips @ slips) < STILL

    def failure(self, world: World) -> str | None:
        return "the cube fell on the floor" if world.touching("cube", "world") else None

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Pick up the cube, wind up, swing, and let go when it will come down in the middle of the tray."""
        aim = yield from self.wind_up(world)
        yield from aim.swing(world, aim.bound)

    def wind_up(self, world: World) -> Generator[Action, None, Self]:
        """Pick up the cube and bring it to where the swing begins, the fingers on either side of the swing.

        Returns:
            The scenario, with the tray's bearing at the time when the cube will come down.
        """
        arm = world.arm
        yield from take(arm, "cube", lift=WOUND[1] - TABLE_TOP - self.cube.edge / 2)
        aim = self if not self.rate else replace(self, bearing=math.degrees(polar(self.target(world, LEAD) - AXIS)[0]))
        at, rot = AXIS + WOUND[0] * aim.u + WOUND[1] * UP, facing_down(math.radians(aim.bearing))
        yield from until(go_to(arm, at, rot, COARSE), lambda: math.dist(arm.hand, at) < ARRIVED)
        yield from hold(arm, CALM)
        return aim

    def swing(self, world: World, opens: Opens, wrist: float = 1.0) -> Plan:
        """Swing the hand out and up so that the cube is bound to come down in the tray, and open the jaw on the way.

        Args:
            opens: whether to open the jaw now.
            wrist: share of the pitch that goes with the swing.
        """
        arm, short = world.arm, list[float]()
        begin, opened, fast = world.time, math.inf, 1.0 / float(np.abs(self.u).max())
        while world.time < opened + FOLLOW:
            seconds, place = self.foreseen(world)
            miss = self.target(world, seconds) - place + LOST * self.u
            short.append(float(miss @ self.u))
            aside = float(miss @ self.across)
            closes = (short[-1 - SLOPE :][0] - short[-1]) / (SLOPE * Loop.PERIOD)
            if opened == math.inf and world.time > begin + TRUSTED:
                if opens(short[-1], aside, closes) or world.time > begin + LONGEST:
                    opened = world.time
            drive = fast * min(1.0, max(-1.0, FEED + GAIN * short[-1]))
            closing = arm.hand_rot[:, 0]
            level = np.cross(closing, math.copysign(1.0, closing @ self.across) * self.across)
            action = np.empty(7)
            action[:3] = drive * self.u + RISE * UP + GAIN * aside * self.across
            action[3:6] = -wrist * drive * self.across + LEVEL * (level - (level @ self.across) * self.across)
            action[6] = CLOSED if opened == math.inf else OPEN
            yield np.clip(action, -1.0, 1.0)

    def bound(self, short: float, aside: float, closes: float) -> bool:
        """Whether the cube is bound to come down in the middle of the tray once the jaw lets go, or gets no farther."""
        there = abs(short - closes * self.opens) < EXACT[0] and abs(closes) < STEADY and abs(aside) < EXACT[1]
        return there or closes <= 0.0 < short

    def foreseen(self, world: World) -> tuple[float, Vec3]:
        """When and where the cube would come down if it were let go now [s, m]."""
        return flight(world.com("cube"), world.velocity("cube")[3:], self.height)

    def target(self, world: World, seconds: float) -> Vec3:
        """Where the tray will be [m] after some time [s]."""
        if not self.rate:
            return self.spot
        return AXIS + about_z(world.hinge(RAIL)[1] * seconds) @ (world.pos("tray") - AXIS)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        plans = {
            "drop_it_at_full_stretch": Shortcut(self._stretch),
            "throw_without_the_wrist": Shortcut(self._stiff),
            "throw_it_straight_ahead": Shortcut(replace(self, bearing=0.0, rate=0.0).oracle),
        }
        if self.rate:
            plans["throw_it_where_the_tray_was"] = Shortcut(replace(self, rate=0.0).oracle)
        return plans

    def _stretch(self, world: World) -> Plan:
        """Hold the cube out towards the tray as far as the arm goes, and let go."""
        aim = yield from self.wind_up(world)
        arm, end = world.arm, world.time + 4.5
        yield from go_to(arm, arm.hand + 0.2 * UP)
        yield from turn_to(arm, rotation(-0.6 * aim.across) @ arm.hand_rot, give_up=2.0)
        out = push(arm, 0.08 * aim.u, lambda: world.time > end, give_up=8.0)
        yield from until(out, lambda: float((arm.hand - AXIS) @ aim.u) > STRETCHED)
        yield from hold(arm, 0.3)
        yield from release(arm)

    def _stiff(self, world: World) -> Plan:
        """Throw with the hand pointing down throughout."""
        aim = yield from self.wind_up(world)
        yield from aim.swing(world, aim.bound, wrist=0.0)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """A wall in the air, beyond the hand and before the tray: what flies there strikes it."""
        scene = self.build()
        near = self.distance - self.extent - 0.01
        body = scene.worldbody.add_body(
            name="wall", pos=AXIS + near * self.u, quat=quat("z", math.radians(self.bearing))
        )
        solid(body, "wall", [0.005, 0.3, 0.5], [0.0, 0.0, 0.5])
        return {"walled_off": scene}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        edge, half = self.cube.edge, self.opening / 2
        yield on_table("the cube", [self.start], margin=edge)
        yield within_reach("the cube", self.start + 0.15 * UP)
        room = self.opening - math.sqrt(2) * edge
        yield require(room > 0.01, "the cube hardly fits into the tray", room=room)
        nearest = self.distance - self.extent + edge / 2
        yield require(nearest > REACH, "the cube can be dropped into the tray", nearest=nearest, reach=REACH)
        seconds, farthest = self.farthest
        needed = self.distance - half + edge
        yield require(needed < farthest, "the tray is too far away", needed=needed, farthest=farthest)
        bearings = abs(self.bearing), abs(self.bearing) + self.rate * max(0.0, ENDS - self.launch)
        widest = max(bearings)
        yield require(widest <= SWUNG, "no throw was measured in that direction", bearing=widest, farthest=SWUNG)
        over = self.distance - THROWN[0] * (seconds - self.passing)
        beside = min(float(np.abs((AXIS + over * heading(b))[:2]).max()) - TABLE_HALF for b in bearings)
        yield require(beside > edge, "the table is in the way", beside=beside, least=edge)
        stands = not (self.rate and self.stand)
        yield require(stands, "a tray on a post does not ride", rate=self.rate, stand=self.stand)

    def features(self) -> Mapping[str, float]:
        """Its flight as a share of the farthest throw's, how long that one takes [s], the room for it in the tray, how
        far to the side it goes and how the tray is turned [rad], what the fingers need to let go [s], and how fast the
        tray is [m/s]."""
        seconds, farthest = self.farthest
        return {
            "share_of_the_farthest_throw": (self.distance - RADIUS) / (farthest - RADIUS),
            "flight_time": seconds,
            "room_over_edge": self.opening / self.cube.edge,
            "to_the_side": math.radians(abs(self.bearing)),
            "tray_turned_by": math.radians(abs(self.turn)),
            "opening_time": self.opens,
            "tray_speed": abs(math.radians(self.rate)) * self.distance,
        }

    # --- mechanics and geometry ---------------------------------------------------------------

    @property
    def opens(self) -> float:
        """Time from the command until the jaw has let go of the cube [s]."""
        return jaw.time_to_free(self.cube.edge)

    @property
    def farthest(self) -> tuple[float, float]:
        """How long the cube flies in a full swing [s], and how far from the robot's axis it comes down [m]."""
        return self._thrown(self.height)

    @property
    def passing(self) -> float:
        """When it passes the height of the table [s]."""
        return self._thrown(TABLE_TOP)[0]

    def _thrown(self, height: float) -> tuple[float, float]:
        seconds, place = flight(RADIUS * heading(0.0) + HEIGHT * UP, np.array([THROWN[0], 0.0, THROWN[1]]), height)
        return seconds, float(place[0])

    @property
    def height(self) -> float:
        """Of the middle of a cube that lies in the tray [m]."""
        return float(self.spot[2]) + self.tray.floor + self.cube.edge / 2

    @property
    def extent(self) -> float:
        """How far the space inside the tray reaches from its middle towards the robot [m]."""
        a = math.radians(self.turn)
        return self.opening / 2 * (abs(math.cos(a)) + abs(math.sin(a)))

    @property
    def u(self) -> Vec3:
        """Unit vector from the robot to the tray, seen from above."""
        return heading(self.bearing)

    @property
    def across(self) -> Vec3:
        """Level unit vector at right angles to `u`, to its left."""
        return np.cross(UP, self.u)

    @property
    def tray(self) -> Bin:
        """Lined, so that the cube does not slide; its floor is thicker than the cube comes in a time step."""
        side = self.opening
        return Bin(width=side, length=side, depth=0.06, wall=0.010, floor=0.020, friction=1.0, rgba=YELLOW)

    @property
    def spot(self) -> Vec3:
        """Middle of the foot of the tray [m]."""
        return AXIS + self.distance * self.u + (RAISED if self.rate else self.stand) * UP

    @property
    def start(self) -> Vec3:
        """Where the cube lies [m]."""
        return np.array([self.x, self.y, TABLE_TOP])


def _towards(ahead: Vec3) -> NDArray[np.float64]:
    """Orientation (wxyz) of an upright camera that looks along a direction: down its own -z, its x to the right."""
    back, turn = -ahead / np.linalg.norm(ahead), np.empty(4)
    right = np.cross(UP, back)
    mujoco.mju_mat2Quat(turn, axes(right / np.linalg.norm(right), back).ravel())
    return turn
