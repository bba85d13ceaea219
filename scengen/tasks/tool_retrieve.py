"""T23 tool-retrieve: fetch a cube that the arm cannot reach, with a hook that it can.

                             _ tip
      base            cube [] |      seen from above; u points from the robot's first axis to the cube
       (o)  - - - - - - - - - |  --> u
                ==============+      the hook lies at the robot's side, its tip towards the cube's bearing
              held here

Bottleneck: order. The hook lengthens the arm and occupies the jaw, and only an empty jaw can take the cube: fetch the
hook, pass it behind the cube on the side where its tip can catch, draw the cube in, put the hook down, then grasp.

Out of reach. The robot's own table is enough: the arm swings about a shoulder 0.445 m above it, and a band of 2 cm
before the far edge, the corners aside, is beyond it. Scenarios are refuted unless *no part of the gripper* can touch
the cube in any posture (`ik.TOUCH`, a bound that ignores joint limits, so that no search has to be believed); the grip
site misses the cube's centre by 70 mm or more, by a bound of the same kind and by inverse kinematics alike.

The goal. The paper says "lift the cube above the table", without numbers. Here: 4 cm above where a cube on the
table has its centre, as in robosuite's Lift; held by the robot and by nothing else, the hook let go, for 0.3 s, which
are the paper's 30 steps of its other lifting tasks (T12, T13). That the hook must not be touched then says in the goal
what the paper says in words ("set the hook down, then grasp the cube and lift"). There is no other rule: a policy may
push with the tip, sweep with the handle, or throw, if it can.

The oracle works in polar coordinates about the robot's first axis, where all bearings look the same to the arm.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..assets.box import Cube
from ..assets.hook import LHook
from ..assets.prop import TABLE_HALF, TABLE_TOP, UP, place, table
from ..params import param
from ..robots import ik
from ..robots.panda import BASE, REACH, SHOULDER
from ..scenario import Plan, Planner, Refutation, Scenario
from ..sim.world import ROBOT, Mat3, Vec3, World
from ..skills.motion import OPEN, facing_down, go_to, grasp, push, release

LIFTED = 0.04
"""How far the cube's centre must rise above its height on the table [m]: robosuite Lift, `_check_success`."""
FALLEN = 0.10
"""What has its centre this far below the table top will not come back [m]."""
ARM = 0.72
"""Farthest distance of a top-down grasp at table height from the robot's first axis that plans use [m]; inverse
kinematics allows 0.76."""
JAW_OPENING = 0.08
"""Widest thing that fits between the fingers [m]: twice the range of a finger joint, panda_gripper.xml."""
HAND_AT = 0.65
"""How far out the hand is when the tip is behind the cube, if the handle is long enough [m]."""
DRAWN_TO = 0.60
"""Where the cube is drawn to, if the handle is short enough: its distance from the robot's first axis [m]."""
NEAREST_HAND = 0.41
"""How near to the robot's first axis the hand draws [m]: at 0.36 joint 6 of a hand that points down is at its limit,
and a hook that has slipped in the jaw asks for more."""
GRASP_FROM_END = 0.035
"""Least distance from the handle's end to where it is held [m]: the pads are 16 mm wide."""
GRASP_HEIGHT = 0.014
"""Height of the grip site over the table when the hook is held [m]; the finger tips end 9 mm below it."""
RAISED, NOSE_UP = 0.003, 0.07
"""How far the held end of the hook is raised while it moves [m], and how much its far end is tilted up [rad].
Dragged flat, the tip catches the table's edge from outside as soon as it has been behind a cube that stands there."""
CLEAR, WIDE = 0.012, 0.03
"""Free space kept between hook and cube where the tip goes behind it, and on the way there [m]."""
SQUARING = 0.015
"""How far the handle pushes the cube sideways before the tip pulls it [m]: that turns a cube that stands askew by
20 deg until its side lies against the handle."""

OUTWARDS = math.radians(40.0)
"""Tilt of a hand that reaches out for the cube: near full stretch inverse kinematics comes closest with it."""
STRETCHED = 0.03
"""How far short of full stretch a reaching plan stops [m]: beyond it the arm is singular and creeps."""


@dataclass(frozen=True, kw_only=True)
class ToolRetrieve(Scenario):
    """A cube near the far edge of the table, and an L hook at the robot's side."""

    HOLD = 0.3

    distance: float = param(0.925, "m", 0.5, 1.1)
    """From the robot's first axis to the cube's centre, along the table."""
    bearing: float = param(0.0, "deg", -60.0, 60.0)
    """Direction from the robot's first axis to the cube; 0 is straight ahead."""
    cube_yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)
    hook_x: float = param(-0.05, "m", -0.4, 0.4)
    hook_y: float = param(-0.18, "m", -0.4, 0.4)
    hook_yaw: float = param(0.0, "deg", -90.0, 90.0, period=360.0)
    """0: the handle points away from the robot, its end towards it."""
    cube: Cube = Cube()
    hook: LHook = LHook()

    # --- geometry -------------------------------------------------------------------------

    @property
    def spot(self) -> Vec3:
        """Where the centre of the cube's foot stands [m]."""
        a = math.radians(self.bearing)
        return np.array([BASE[0] + self.distance * math.cos(a), BASE[1] + self.distance * math.sin(a), TABLE_TOP])

    @property
    def half(self) -> float:
        """Half the cube's edge [m]."""
        return self.cube.edge / 2

    @property
    def out_of_touch(self) -> float:
        """How far at least any point of the gripper stays away from the cube [m]; not positive if it may touch."""
        turn, centre = _turned(math.radians(self.cube_yaw)), self.spot + self.half * UP
        inside = np.clip(turn.T @ (SHOULDER - centre), -self.half, self.half)
        return ik.shortfall(centre + turn @ inside, ik.TOUCH)

    @property
    def outline(self) -> NDArray[np.float64]:
        """The corners of hook and cube seen from above [m], shape (n, 2): the hook's first."""
        a, end, side = self.hook.length / 2, self.hook.width / 2, self.hook.side
        far = side * (end + self.hook.tip)
        hook = np.array([[-a, end], [-a, -end], [a, -side * end], [a, far], [self.hook.inside, far]])
        cube = self.half * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
        return np.vstack(
            [
                hook @ _turned(math.radians(self.hook_yaw))[:2, :2].T + [self.hook_x, self.hook_y],
                cube @ _turned(math.radians(self.cube_yaw))[:2, :2].T + self.spot[:2],
            ]
        )

    @property
    def stretch(self) -> float:
        """Distance from where the handle is held to the face that pulls [m].

        As short as it may be: the farther out the hook is held, the less its weight turns it in the jaw.
        """
        whole = self.hook.inside + self.hook.length / 2 - GRASP_FROM_END
        return min(whole, self.distance + self.half * math.sqrt(2) + CLEAR - HAND_AT)

    def infeasible(self) -> Refutation | None:
        if (far := float(np.abs(self.outline).max())) > TABLE_HALF:
            return Refutation("hook or cube overhang the table", {"farthest": far, "edge": TABLE_HALF})
        if (gap := self.out_of_touch) <= 0:
            return Refutation("the arm may touch the cube without the hook", {"gap": gap, "reach": ik.TOUCH})
        if (needed := self.distance + self.half * math.sqrt(2) + CLEAR - self.stretch) > ARM:
            return Refutation("the hook is too short", {"hand at": needed, "arm": ARM})
        if (both := self.cube.edge + self.hook.width) <= JAW_OPENING:
            return Refutation("the jaw can hold hook and cube together", {"both": both, "jaw": JAW_OPENING})
        if self.hook.tip < self.half:
            return Refutation("the tip ends before the cube's middle", {"tip": self.hook.tip, "half": self.half})
        held = [self.hook_x, self.hook_y] + (self.hook.inside - self.stretch) * _turned(math.radians(self.hook_yaw))[
            :2, 0
        ]
        if (away := float(np.linalg.norm(held - BASE[:2]))) > ARM:
            return Refutation("the handle is out of reach", {"distance": away, "arm": ARM})
        return None

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        place(scene, self.cube, "cube", self.spot, math.radians(self.cube_yaw))
        place(scene, self.hook, "hook", [self.hook_x, self.hook_y, TABLE_TOP], math.radians(self.hook_yaw))
        return scene

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Without the hook nothing reaches the cube; without its tip nothing pulls it."""
        bare, straight = self.build(), self.build()
        bare.delete(bare.body("hook"))
        straight.delete(straight.geom("hook/bar_1"))
        return {"no hook": bare, "no tip": straight}

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        raised = world.com("cube")[2] - TABLE_TOP - self.half
        propped = world.touching("cube", "table") or self._at_hook(world, "cube")
        held = world.touching(ROBOT, "cube") and not propped and not self._at_hook(world, ROBOT)
        return raised >= LIFTED and held

    def _at_hook(self, world: World, body: str) -> bool:
        """Whether a body touches the hook, if there is one."""
        return "hook" in world.free_bodies and world.touching(body, "hook")

    def failure(self, world: World) -> str | None:
        for body in world.free_bodies:
            if world.com(body)[2] < TABLE_TOP - FALLEN:
                return f"the {body} fell off the table"
        return None

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Fetch the hook, draw the cube in, put the hook down beside it, take the cube."""
        yield from self.take_hook(world)
        yield from self.draw_in(world)
        yield from self.put_down(world)
        yield from self.lift_cube(world)

    def take_hook(self, world: World) -> Plan:
        """Grasp the handle across."""
        held = world.pos("hook") + world.rot("hook") @ [self.hook.inside - self.stretch, 0, GRASP_HEIGHT]
        along = world.rot("hook")[:, 0]
        yield from self._descend_on(world, held, math.atan2(along[1], along[0]))
        yield from grasp(world, 0.4)

    def draw_in(self, world: World, mirror: float = 1.0) -> Plan:
        """Pass the hook by the cube on the side away from its tip, put the tip behind the cube, pull.

        With `mirror` = -1 it passes on the other side, and the tip ends up behind nothing.
        """
        cube = world.com("cube") - BASE
        bearing, there = math.atan2(cube[1], cube[0]), math.hypot(cube[0], cube[1])
        away = self._half_across(world, bearing)
        passing = away + WIDE + self.hook.tip + self.hook.width / 2
        behind, near = there + away + CLEAR, self._drawn + self.half
        beside = self.half + self.hook.width / 2 - SQUARING
        yield from self.slide(
            world, bearing, there - away - self.hook.width - WIDE, passing, within=0.015, mirror=mirror
        )
        yield from self.slide(world, bearing, behind, passing, mirror=mirror)
        yield from self.slide(world, bearing, behind, beside, speed=0.2, mirror=mirror)
        yield from self.slide(world, bearing, near, beside, speed=0.2, within=0.01, mirror=mirror)

    def put_down(self, world: World) -> Plan:
        """Take the tip, then the handle off the cube, let go, go up."""
        along, left = world.rot("hook")[:, 0], world.rot("hook")[:, 1]
        yield from go_to(world, world.hand + 0.03 * along, within=0.01)
        yield from go_to(world, world.hand - 0.05 * self.hook.side * left, within=0.01)
        yield from release(world)
        yield from go_to(world, world.hand + 0.1 * UP, within=0.02)

    def lift_cube(self, world: World) -> Plan:
        """Grasp the cube across the faces that need the least turn of the hand from its bearing."""
        cube, side = world.com("cube") - BASE, world.rot("cube")[:, 0]
        bearing = math.atan2(cube[1], cube[0])
        turn = math.remainder(math.atan2(side[1], side[0]) - bearing, math.pi / 2)
        yield from self._descend_on(world, world.com("cube"), bearing + turn)
        yield from grasp(world, 0.3)
        yield from go_to(world, world.hand + 0.12 * UP, within=0.02)

    def slide(
        self,
        world: World,
        bearing: float,
        inside: float,
        beside: float,
        speed: float = 0.25,
        within: float = 0.004,
        mirror: float = 1.0,
    ) -> Plan:
        """Move the held hook over the table until it lies along `bearing` [rad], seen from the robot's first axis.

        Args:
            inside: how far out the face that pulls shall lie [m].
            beside: how far from the line of the bearing the middle of the handle shall lie, on the side away from
                where the tip points [m].
            mirror: -1 for the other side.
        """
        held = world.rot("hook").T @ np.column_stack([world.hand - world.pos("hook"), world.hand_rot])
        place = np.array([inside - self.hook.inside, -mirror * self.hook.side * beside, 0.0])
        goal = BASE + _turned(bearing) @ place
        goal[2] = TABLE_TOP + RAISED + self.hook.length / 2 * math.sin(NOSE_UP)
        hook = _turned(bearing) @ _leaning(NOSE_UP)
        yield from go_to(world, goal + hook @ held[:, 0], hook @ held[:, 1:], speed=speed, within=within)

    @property
    def _drawn(self) -> float:
        """Where the cube is drawn to: its distance from the robot's first axis [m]."""
        return max(DRAWN_TO, NEAREST_HAND + self.stretch - self.half)

    def _half_across(self, world: World, bearing: float) -> float:
        """Half the cube's width seen along `bearing`, and as much across it [m]."""
        along = world.rot("cube")[:2, :2].T @ [math.cos(bearing), math.sin(bearing)]
        return self.half * float(np.abs(along).sum())

    def _descend_on(self, world: World, target: Vec3, yaw: float) -> Plan:
        """Bring the open jaw down on `target`, closing across the direction `yaw`."""
        frame = facing_down(math.remainder(yaw, math.pi))
        above = np.array([target[0], target[1], TABLE_TOP + 0.12])
        yield from go_to(world, above, frame, within=0.02, grip=OPEN)
        yield from go_to(world, target, frame, speed=0.2)

    # --- shortcuts ------------------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Planner]:
        return {
            "reach for the cube": self._reach,
            "pull with the tip turned away": self._pull_past,
            "pick the cube with the hook": self._pick_with_hook,
            "grasp the cube with the hook in the jaw": self._grasp_with_hook,
        }

    def _reach(self, world: World) -> Plan:
        """Stretch the arm towards the cube as far as it goes, hand tilted outwards, close, lift."""
        out = (world.com("cube") - SHOULDER) / np.linalg.norm(world.com("cube") - SHOULDER)
        bearing = math.atan2(out[1], out[0])
        tilted = _turned(bearing) @ _leaning(OUTWARDS) @ facing_down()
        nearest = SHOULDER + (REACH - STRETCHED) * out
        yield from go_to(world, nearest - 0.1 * out + 0.05 * UP, tilted, within=0.03, grip=OPEN)
        yield from go_to(world, nearest, tilted, within=0.01)
        yield from grasp(world, 0.3)
        yield from go_to(world, nearest - 0.1 * out + 0.1 * UP, within=0.03)

    def _pull_past(self, world: World) -> Plan:
        """Draw with the handle on the wrong side of the cube, then reach for where the cube still is."""
        yield from self.take_hook(world)
        yield from self.draw_in(world, mirror=-1.0)
        yield from self.put_down(world)
        yield from self._reach(world)

    def _pick_with_hook(self, world: World) -> Plan:
        """Draw the cube in and lift it in the corner of the hook, then open the jaw."""
        yield from self.take_hook(world)
        yield from self.draw_in(world)
        yield from go_to(world, world.hand + 0.12 * UP, within=0.02)
        yield from release(world)

    def _grasp_with_hook(self, world: World) -> Plan:
        """Draw the cube in, bring the hand down on it with the hook still in the jaw, close, lift, let go."""
        yield from self.take_hook(world)
        yield from self.draw_in(world)
        yield from go_to(world, world.hand + 0.08 * UP, within=0.02)
        cube = world.com("cube")
        yield from go_to(world, [cube[0], cube[1], world.hand[2]], within=0.01)
        yield from push(world, -0.1 * UP, until=lambda: world.hand[2] <= cube[2] or world.touching("hook", "cube"))
        yield from grasp(world, 0.4)
        yield from go_to(world, world.hand + 0.12 * UP, within=0.02)
        yield from release(world)

    # --- features -------------------------------------------------------------------------

    def features(self) -> Mapping[str, float]:
        """How far out of touch the cube is [m], as a share of the handle too, and how far the tip reaches past it."""
        return {
            "out of touch": self.out_of_touch,
            "shortfall over handle": self.out_of_touch / self.hook.length,
            "tip over edge": self.hook.tip / self.cube.edge,
        }


def _leaning(tilt: float) -> Mat3:
    """The rotation by `tilt` [rad] that turns down towards x."""
    c, s = math.cos(tilt), math.sin(tilt)
    return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])


def _turned(yaw: float) -> Mat3:
    """The rotation by `yaw` [rad] about the vertical."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
