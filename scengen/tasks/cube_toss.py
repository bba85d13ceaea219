"""T10 cube-toss: throw a cube into a tray that is farther away than the arm can reach.

          __
      ===|hand|-> o  .                seen from the side; the swing runs out from the robot along +u
     /        table    .
    robot    ------+     .
      |      |     |      .
      |      |     |    |___| tray    on the floor, 0.96 to 1.08 m from its axis

Bottleneck: the hand never gets over the tray. The landing place is decided at release, by the cube's position, speed
and direction; nothing can be corrected afterwards.

How far a Panda throws. Under OSC_POSE the hand moves at 0.30 m/s along an axis. A pitch added to it drags the hand
along, as position and rotation are controlled as if they were independent. From pointing straight down, 0.63 m from the
first axis, the hand swings out and up and releases the cube up to 0.90 m from the axis with at least 0.33 m/s outwards.
Half a second later the cube lands, at 1.09 m at bearings of 32 to 50 deg on either side, where both axes drive the
hand, and at 1.06 m beyond. No posture holds the cube farther out than 0.94 m (`panda.REACH`). The tray is between the
two distances; straight ahead the table is in the way.

Decisions, where the paper (App. B, T10) is silent or contradicts itself:

* "A gripper holds a cube" (set-up): it does from the start, half a centimetre off the middle. "Lift the cube and throw
  it" (plan): the hand starts above the table, and a swing goes up. A cube that is put down may be picked up again.
* The paper gives no distances, and speaks of a goal zone. All of the table is within reach, so the zone is on the
  floor. A cube that falls from 1.1 m tumbles on where it lands, so the zone is a tray with walls, which faces the
  robot.
* The cube comes down inside the tray, not on its rim. Otherwise a cube that comes down 2 cm beside the middle tips in
  over the rim, and one fixed swing turned to the tray solves every distance. So the cube must come down within 7 mm of
  the middle along the throw. Distances are spread over 11 cm, so that the best single distance, thrown as precisely as
  by the oracle, solves one draw in seven (measured: 11 of 80 at five distances).
* There is one throw: a cube on the floor is out of reach, and lost.
* On an axis of ours the tray rides on a rail around the robot, from a moment that the robot does not know: the same
  throw, to the place where the tray will be. "Comes to rest inside the goal zone" then means relative to the tray.

In every period the oracle predicts where the cube would come down if released now. It steers that place instead of the
hand, by swinging at the speed that carries the cube from where it is now into the tray, until the place stays in the
middle. Then it opens the jaw. This corrects noise and a cube that is held off the middle. The moment of release has
little influence: if the jaw opens 0.1 s earlier or later, the cube lands within 1 cm of the same place.
"""

import math
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import mujoco
import numpy as np

from ..assets.bin import Bin
from ..assets.box import Cube
from ..assets.prop import TABLE_HALF, TABLE_TOP, aim, place, place_in_hand, solid, table
from ..control.loop import Loop
from ..decisions import Decision, around, choice, side_of
from ..geometry import UP, Vec3, about_z, heading, polar, quat, rotation, spoken
from ..means import Mean, once, throughout
from ..params import param
from ..physics import flight
from ..predicates import borne, seated
from ..robots import jaw
from ..robots.panda import BASE, REACH
from ..scenario import Action, Plan, Refutation, Scenario, Shortcut, require
from ..sim.arm import ROBOT
from ..sim.world import World
from ..skills.jaw import release
from ..skills.motion import CLOSED, COARSE, OPEN, facing_down, go_to, hold, push, turn_to, until, wait
from ..skills.waiting import elapsed

ROBOT_AXIS: Vec3 = BASE * [1.0, 1.0, 0.0]  # point at which the robot's first axis meets the floor [m]
DIAGONAL_BEARING = 50.0
"""Bearing up to which both axes drive the hand, so that it throws farther [deg]."""
RELEASE_DISTANCES = 0.888, 0.90
"""Distance from the first axis at which a full swing releases a cube [m], up to `DIAGONAL_BEARING` and beyond."""
RELEASE_HEIGHTS = 1.165, 1.15
"""Height at which a full swing releases a cube [m], up to `DIAGONAL_BEARING` and beyond."""
RELEASE_SPEEDS = (0.40, 0.31), (0.34, 0.42)
"""Velocity outwards and upwards of a cube that a full swing releases [m/s], the least measured: up to
`DIAGONAL_BEARING` and beyond."""
SHORT_SPEED = 0.50  # outwards, of a cube that is thrown to a near tray [m/s]
BREADTH = 0.09  # length of the tray's inner sides across the throw [m]
RIM_HEIGHT = 0.004  # of the rim on the walls [m]
RIM_COLOUR = (0.30, 0.30, 0.30, 1.0)
MAX_BEARING = 75.0  # largest bearing at which throws were measured [deg]
MIN_THROW_SPEED = 0.2
"""Least speed outwards of a cube that is thrown [m/s]: swings release it with 0.31 and more, a hand that creeps out to
full stretch with 0.08."""
REST_SPEED = 0.02  # speed relative to the tray below which the cube counts as at rest [m/s]
LANDING_TIME = 2.5  # from the start of the oracle to the landing of the cube, about [s]
LATEST_LANDING = 3.3  # the same, at the latest [s]
RAIL = "rail"  # hinge on which a tray rides around the robot

Opens = Callable[[float, float, float], bool]
"""Whether to open the jaw, from the distance to the middle of the tray along the swing and across it [m], and the speed
at which the former decreases [m/s]."""


@dataclass(frozen=True, kw_only=True)
class CubeToss(Scenario):
    """A cube in the gripper and a tray on the floor, or on a post, beyond the arm's reach."""

    VERSION = 2
    HOLD = 0.3

    distance: float = param(1.02, "m", 0.9, 1.3)  # distance of the middle of the tray from the robot's first axis
    bearing: float = param(42.0, "deg", -110.0, 110.0)  # bearing of the tray; 0 is ahead of the robot, 90 to its left
    stand: float = param(0.0, "m", 0.0, 0.6)  # height of the post under the tray
    turn: float = param(0.0, "deg", -45.0, 45.0, period=90.0)  # angle by which the tray is turned from facing the robot
    opening: float = param(0.070, "m", 0.06, 0.20)  # length of the tray's inner sides along the throw
    rate: float = param(0.0, "deg/s", -10.0, 10.0)
    """Rate at which the tray rides on a rail around the robot, away from straight ahead; 0: it stands still."""
    launch: float = param(0.5, "s", 0.5, 4.0)  # time at which the tray starts to ride
    held_below: float = param(0.0, "m", -0.01, 0.02)  # of the cube's middle, out of the hand
    held_beside: float = param(0.0, "m", -0.02, 0.02)  # the same across the fingers, forwards
    cube: Cube = Cube(edge=0.040, mass=0.05, friction=0.8)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        edge = self.cube.edge
        place_in_hand(scene, self.cube, "cube", edge, [self.held_beside, 0.0, -self.held_below - edge / 2])
        if self.stand:
            half = self.stand / 2
            post = scene.worldbody.add_body(name="post", pos=(self.spot - half * UP).tolist())
            solid(post, "post", [0.03, 0.03, half], rgba=self.tray.rgba)
        place(scene, self.tray, "tray", self.spot, math.radians(self.bearing + self.turn), free=False)
        self._add_rim(scene.body("tray"))
        if self.rate:
            to_axis = about_z(-math.radians(self.turn)) @ [-self.distance, 0.0, 0.0]
            hinge = mujoco.mjtJoint.mjJNT_HINGE
            scene.body("tray").add_joint(name=RAIL, type=hinge, axis=UP.tolist(), pos=to_axis.tolist())
        # From where they stand in the arena, these cameras see the table alone; here they see the floor on both sides.
        for name, eye in {"agentview": [2.0, 0.0, 1.9], "sideview": [1.9, 0.5, 2.1]}.items():
            aim(scene, name, eye, [0.1, 0.0, 0.45])
        return scene

    def _add_rim(self, tray: mujoco.MjsBody) -> None:
        """Put a rim on the walls, a separate body, so that contacts distinguish it from the walls."""
        rim, (half_x, half_y), wall = tray.add_body(name="rim"), (self.opening / 2, BREADTH / 2), self.tray.wall / 2
        z = self.tray.floor + self.tray.depth + RIM_HEIGHT / 2
        for side in (-1, 1):
            far = [wall, half_y + 2 * wall, RIM_HEIGHT / 2], [side * (half_x + wall), 0.0, z]
            beside = [half_x, wall, RIM_HEIGHT / 2], [0.0, side * (half_y + wall), z]
            for name, (size, pos) in {"far": far, "beside": beside}.items():
                solid(rim, f"rim_{name}_{(side + 1) // 2}", size, pos, rgba=RIM_COLOUR)

    def events(self, world: World) -> None:
        if self.rate and world.passes(self.launch):
            world.spin(RAIL, math.copysign(1.0, self.bearing) * math.radians(self.rate))

    def pending(self, world: World) -> bool:
        return bool(self.rate) and world.time < self.launch + Loop.PERIOD / 2

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        tray = self.tray
        middle = world.pos("tray") + (tray.floor + tray.depth / 2) * UP
        lies = seated(world, "cube", "tray", middle, math.hypot(self.opening, BREADTH) / 2, tray.depth / 2)
        slips = world.velocity("cube")[3:] - world.velocity("tray")[3:]
        return lies and math.sqrt(slips @ slips) < REST_SPEED

    def failure(self, world: World) -> str | None:
        return "the cube fell on the floor" if world.touching("cube", "world") else None

    def means(self) -> Mapping[str, Mean]:
        def outwards(world: World) -> bool:
            away = world.com("cube") - ROBOT_AXIS
            return float(away[:2] @ world.velocity("cube")[3:5]) > MIN_THROW_SPEED * math.hypot(*away[:2])

        swung = "the jaw swung the cube outwards"
        return {
            swung: once(lambda world: borne(world, world.arm, "cube") and outwards(world)),
            "the cube left the jaw in the swing and flew": once(
                lambda world: not world.touching_bodies("cube") and outwards(world), after=swung
            ),
            "the cube came down inside the tray": throughout(lambda world: not world.touched("cube", "rim")),
            "the robot did not touch the tray": throughout(
                lambda world: not any(world.touched(ROBOT, part) for part in ("tray", "rim"))
            ),
        }

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Wind up, swing, and release the cube when it will land in the middle of the tray."""
        aim = yield from self.wind_up(world)
        yield from aim.swing(world, aim.on_target)

    def wind_up(self, world: World) -> Generator[Action, None, Self]:
        """Bring the cube to the start of the swing, the fingers on either side of the swing.

        Returns:
            The scenario, with the tray's bearing at the time when the cube will land.
        """
        # Throws at all bearings go farthest from here, hand pointing down; the optimum is flat within 5 cm.
        arm, distance, height = world.arm, 0.63, 0.95
        aim = self
        if self.rate:
            yield from wait(arm, lambda: world.hinge(RAIL)[1] != 0.0, give_up=5.0)
            aim = replace(self, bearing=math.degrees(polar(self.tray_after(world, LANDING_TIME) - ROBOT_AXIS)[0]))
        at, rot = ROBOT_AXIS + distance * aim.u + height * UP, facing_down(math.radians(aim.bearing))
        yield from until(go_to(arm, at, rot, COARSE, CLOSED), lambda: math.dist(arm.hand, at) < 0.02)
        yield from hold(arm, 0.2)
        return aim

    def swing(self, world: World, opens: Opens, wrist: float = 1.0) -> Plan:
        """Swing the hand out and up so that the cube will land in the tray, and open the jaw on the way.

        Args:
            opens: whether to open the jaw now.
            wrist: share of the pitch that goes with the swing.
        """
        gain = 12.0  # action per metre of error of the landing place; from 20 on it oscillates with latency
        window = 5  # periods over which the speed of the landing place is measured
        arm, short = world.arm, list[float]()
        begin, opened, fast = world.time, math.inf, 1.0 / float(np.abs(self.u).max())
        while world.time < opened + 0.2:  # the swing goes on for 0.2 s after the jaw opens
            seconds, place = self.predicted(world)
            out = float((world.com("cube") - ROBOT_AXIS) @ self.u)
            # Measured: the fingers push the cube on from near by, and outwards; from far out they hold it back, and
            # push it inwards, unless one axis alone drives the hand.
            lost, straight = 0.05 * (out - 0.84), 0.92 if self._beyond_diagonal else 0.807
            pushed = 0.17 * (out - straight) * math.copysign(1.0, self.bearing)
            miss = self.tray_after(world, seconds) - place + lost * self.u + pushed * self.across
            short.append(float(miss @ self.u))
            aside = float(miss @ self.across)
            closes = (short[-1 - window :][0] - short[-1]) / (window * Loop.PERIOD)
            if opened == math.inf and world.time > begin + 0.1:  # a swing cannot be judged earlier
                if opens(short[-1], aside, closes) or world.time > begin + 0.9:  # 0.9 s: at the latest
                    opened = world.time
            # The speed that lands it there from here, and the speed that an action of 1 gives: less at full stretch.
            needed = short[-1] / seconds + float(world.velocity("cube")[3:] @ self.u)
            drive = min(fast, max(-fast, needed / (0.44 - 1.2 * max(0.0, out - 0.80)) + fast * gain * short[-1]))
            closing = arm.hand_rot[:, 0]
            level = np.cross(closing, math.copysign(1.0, closing @ self.across) * self.across)
            action = np.empty(7)
            action[:3] = drive * self.u + 0.3 * UP + gain * aside * self.across
            action[3:6] = -wrist * drive * self.across + 4.0 * (level - (level @ self.across) * self.across)
            action[6] = CLOSED if opened == math.inf else OPEN
            yield np.clip(action, -1.0, 1.0)

    def on_target(self, short: float, aside: float, closes: float) -> bool:
        """Whether a cube released now lands in the middle of the tray, or its landing place moves no farther out."""
        # Within 6 mm along the swing and 12 mm across it, of a landing place that moves slower than 0.15 m/s.
        there = abs(short - closes * self.opening_time) < 0.006 and abs(closes) < 0.15 and abs(aside) < 0.012
        return there or closes <= 0.0 < short

    def predicted(self, world: World) -> tuple[float, Vec3]:
        """Time of flight [s] and landing place [m] of a cube that is released now."""
        return flight(world.com("cube"), world.velocity("cube")[3:], self.landing_height)

    def tray_after(self, world: World, seconds: float) -> Vec3:
        """Place of the tray [m] after a time [s]."""
        if not self.rate:
            return self.spot
        return ROBOT_AXIS + about_z(world.hinge(RAIL)[1] * seconds) @ (world.pos("tray") - ROBOT_AXIS)

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
        """Hold the cube out towards the tray as far as the arm goes, and release it."""
        aim = yield from self.wind_up(world)
        arm, over = world.arm, elapsed(world, 4.5)
        yield from go_to(arm, arm.hand + 0.2 * UP)
        yield from turn_to(arm, rotation(-0.6 * aim.across) @ arm.hand_rot, give_up=2.0)
        out = push(arm, 0.08 * aim.u, over, give_up=8.0)
        yield from until(out, lambda: float((arm.hand - ROBOT_AXIS) @ aim.u) > 0.92)  # farther out the arm trembles
        yield from hold(arm, 0.3)
        yield from release(arm)

    def _stiff(self, world: World) -> Plan:
        """Throw with the hand pointing down throughout."""
        aim = yield from self.wind_up(world)
        yield from aim.swing(world, aim.on_target, wrist=0.0)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """A wall in the air, beyond the hand and before the tray, which a thrown cube strikes."""
        scene = self.build()
        near = self.distance - self.extent() - 0.01
        foot, turn = ROBOT_AXIS + near * self.u, quat("z", math.radians(self.bearing))
        body = scene.worldbody.add_body(name="wall", pos=foot.tolist(), quat=turn)
        solid(body, "wall", [0.005, 0.3, 0.5], [0.0, 0.0, 0.5])
        return {"walled_off": scene}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        return {
            "side": choice(side_of(self.bearing), "bearing"),
            "distance": around(self.distance, 0.007, "distance"),
            "bearing": around(self.bearing, math.degrees(0.025 / self.distance), "bearing"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        edge, half = self.cube.edge, self.opening / 2
        held = edge / 2 - max(abs(self.held_beside), abs(self.held_below))
        yield require(held >= jaw.PAD / 2, "the pads are not on the cube", held=held, least=jaw.PAD / 2)
        room = self.opening - math.sqrt(2) * edge
        yield require(room > 0.01, "the cube hardly fits into the tray", room=room)
        nearest = self.distance - self.extent(edge)
        yield require(nearest > REACH, "the cube can be dropped into the tray", nearest=nearest, reach=REACH)
        seconds, farthest = self.farthest_throw
        needed = self.distance - half + edge / math.sqrt(2)
        yield require(needed < farthest, "the tray is too far away", needed=needed, farthest=farthest)
        bearings = abs(self.bearing), abs(self.bearing) + self.rate * LATEST_LANDING
        widest, farthest = max(bearings), MAX_BEARING
        yield require(widest <= farthest, "no throw was measured in that direction", bearing=widest, farthest=farthest)
        crossing = self.distance - SHORT_SPEED * (seconds - self.table_crossing)
        beside = min(float(np.abs((ROBOT_AXIS + crossing * heading(b))[:2]).max()) - TABLE_HALF for b in bearings)
        yield require(beside > edge, "the table is in the way", beside=beside, least=edge)
        stands = not (self.rate and self.stand)
        yield require(stands, "a tray on a post does not ride", rate=self.rate, stand=self.stand)

    def features(self) -> Mapping[str, float]:
        """Length of the flight over that of the farthest throw, time of the latter [s], size of tray over cube, bearing
        and turn of the tray [rad], time in which the fingers release the cube [s], speed of the tray [m/s]."""
        (seconds, farthest), released = self.farthest_throw, RELEASE_DISTANCES[self._beyond_diagonal]
        return {
            "share_of_the_farthest_throw": (self.distance - released) / (farthest - released),
            "flight_time": seconds,
            "room_over_edge": self.opening / self.cube.edge,
            "to_the_side": math.radians(abs(self.bearing)),
            "tray_turned_by": math.radians(abs(self.turn)),
            "opening_time": self.opening_time,
            "tray_speed": abs(math.radians(self.rate)) * self.distance,
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "tray": spoken(self.bearing),
            "distance": self.distance,
            "height": self.stand,
        }

    # --- mechanics and geometry ---------------------------------------------------------------

    @cached_property
    def opening_time(self) -> float:
        """Time from the command until the jaw has let go of the cube [s]."""
        return jaw.time_to_free(self.cube.edge)

    @cached_property
    def farthest_throw(self) -> tuple[float, float]:
        """Time of flight after a full swing [s], and distance of the landing place from the robot's axis [m]."""
        return self._full_throw(self.landing_height)

    @cached_property
    def table_crossing(self) -> float:
        """Time after which it passes the height of the table [s]."""
        return self._full_throw(TABLE_TOP)[0]

    def _full_throw(self, height: float) -> tuple[float, float]:
        """Time [s] and distance from the robot's axis [m] at which a cube from a full swing comes to a height [m]."""
        beyond = self._beyond_diagonal
        start = RELEASE_DISTANCES[beyond] * heading(0.0) + RELEASE_HEIGHTS[beyond] * UP
        outwards, upwards = RELEASE_SPEEDS[beyond]
        seconds, place = flight(start, np.array([outwards, 0.0, upwards]), height)
        return seconds, float(place[0])

    @cached_property
    def _beyond_diagonal(self) -> bool:
        """Whether the tray is at a bearing at which only one axis drives the hand at its limit."""
        return abs(self.bearing) > DIAGONAL_BEARING

    @cached_property
    def landing_height(self) -> float:
        """Height of the rim of the tray, where the middle of the cube must come down [m]."""
        return float(self.spot[2]) + self.tray.floor + self.tray.depth

    def extent(self, edge: float = 0.0) -> float:
        """Distance from the middle of the tray to its inner side towards the robot, or to the nearest place [m] where a
        cube of an edge, which is turned with the tray, fits in."""
        a = math.radians(self.turn)
        return (self.opening - edge) / 2 * abs(math.cos(a)) + (BREADTH - edge) / 2 * abs(math.sin(a))

    @cached_property
    def u(self) -> Vec3:
        """Unit vector from the robot to the tray, seen from above."""
        return heading(self.bearing)

    @cached_property
    def across(self) -> Vec3:
        """Level unit vector at right angles to `u`, to its left."""
        return np.cross(UP, self.u)

    @cached_property
    def tray(self) -> Bin:
        """Lined, so that the cube does not slide; its floor is thicker than the cube moves in a time step."""
        yellow = (0.95, 0.75, 0.20, 1.0)  # on a grey floor
        return Bin(width=self.opening, length=BREADTH, depth=0.10, wall=0.010, floor=0.020, friction=1.0, rgba=yellow)

    @cached_property
    def spot(self) -> Vec3:
        """Middle of the foot of the tray [m]."""
        return ROBOT_AXIS + self.distance * self.u + (0.01 if self.rate else self.stand) * UP  # a riding tray hovers
