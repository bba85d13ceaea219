"""T23 tool-retrieve: fetch a cube that the arm cannot reach, with a hook that it can reach.

                             _ tip
      base            cube [] |      seen from above; the cube's bearing is seen from the robot's first axis
       (o)  - - - - - - - - - |
                ==============+      the hook lies at the robot's side, its tip towards the cube's bearing
              held here

Bottleneck: the order. The hook lengthens the arm and occupies the jaw, and only an empty jaw can grasp the cube. The
robot must fetch the hook, pass it behind the cube on the side where its tip can catch, draw the cube in, put the hook
down, then grasp the cube.

Out of reach. The robot's own table is enough: the arm swings about a shoulder 0.445 m above it, and a band of 2 cm
before the far edge, except the corners, is beyond it. Scenarios are refuted unless *no part of the gripper* can touch
the cube in any posture. The bound ignores joint limits (`ik.GRIPPER_REACH`), so it does not depend on a search.

The goal. The paper's "lift the cube above the table" has no numbers. Here: 4 cm above its height on the table, as in
robosuite's Lift; held by the robot and by nothing else, with the hook released ("set the hook down, then grasp the cube
and lift"), for 0.3 s, 30 steps as in the paper's T12 and T13. How the hook draws the cube nearer is free: a policy may
push, sweep or throw. The place of the cube is not a secret either: a hook swept along the far edge, and then drawn in,
brings it from anywhere, without a look at the cube until it has been drawn in (24 of 24). So there is no `answer` to
guess. A hook that falls off the table may have done its work before.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial

import mujoco
import numpy as np

from ..assets.box import Cube
from ..assets.hook import Hook, JHook, LHook, THook
from ..assets.prop import TABLE_TOP, place, remove, table
from ..decisions import Decision, choice, near, side_of
from ..geometry import UP, Vec3, about_y, about_z, corners, heading, polar, way_to
from ..means import Mean, when
from ..params import param
from ..predicates import fallen, held
from ..robots import ik
from ..robots.jaw import OPENING
from ..robots.panda import BASE, REACH, SHOULDER
from ..scenario import Plan, Planner, Refutation, Scenario, Shortcut, on_table, require
from ..sim.arm import ROBOT
from ..sim.world import World
from ..skills.hook import (
    HOOK_CLEARANCE,
    Leg,
    nearest_pull,
    pull_legs,
    put_down,
    shortest_stretch,
    slide,
    take_handle,
)
from ..skills.jaw import grasp, pick, release
from ..skills.motion import COARSE, OPEN, facing_down, go_to, push, retreat

MIN_LIFT = 0.04
"""Height of the cube's centre above its height on the table at which it counts as lifted [m]: robosuite Lift,
`_check_success`."""
L_HOOK = 0
"""Number of the L hook among the kinds: the paper's T23 has an L, its App. C says "J-shape and T-shape"."""
J_HOOK = 1  # number of the J hook
T_HOOK = 2  # number of the T hook
MAX_DISTANCE = 0.72
"""Largest distance from the robot's first axis of a grasp from above at table height that plans use [m]; inverse
kinematics allows 0.76."""
MIN_DRAW = 0.05  # least distance by which the hook draws the cube towards the robot [m]
PULL_END_DISTANCE = 0.60
"""Distance from the robot's first axis to which the cube is drawn, if the handle is short enough [m]."""


@dataclass(frozen=True, kw_only=True)
class ToolRetrieve(Scenario):
    """A cube near the far edge of the table, and a hook at the robot's side."""

    VERSION = 2
    HOLD = 0.3

    distance: float = param(0.925, "m", 0.5, 1.1)
    """Distance from the robot's first axis to the cube's centre, along the table."""
    bearing: float = param(0.0, "deg", -60.0, 60.0)
    """Direction from the robot's first axis to the cube; 0 is straight ahead."""
    cube_yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)
    hook_x: float = param(-0.05, "m", -0.4, 0.4)
    hook_y: float = param(-0.18, "m", -0.4, 0.4)
    hook_yaw: float = param(0.0, "deg", -90.0, 90.0, period=360.0)
    """Yaw of the hook; at 0 the handle points away from the robot, with its end towards the robot."""
    cube: Cube = Cube()
    kind: int = param(L_HOOK, "0 = L, 1 = J, 2 = T", L_HOOK, T_HOOK)
    """Kind of the hook. All kinds have handle, cross section, mass and friction of `hook`."""
    hook: LHook = LHook()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        place(scene, self.cube, "cube", self.spot, math.radians(self.cube_yaw))
        place(scene, self.tool, "hook", [self.hook_x, self.hook_y, TABLE_TOP], math.radians(self.hook_yaw))
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        raised = world.com("cube")[2] - TABLE_TOP - self.half
        return raised >= MIN_LIFT and held(world, "cube") and "hook" not in world.touching_bodies(ROBOT)

    def failure(self, world: World) -> str | None:
        return "the cube fell off the table" if fallen(world, "cube") else None

    def means(self) -> Mapping[str, Mean]:
        near = polar(self.spot - BASE)[1] - MIN_DRAW
        return {
            "the hook drew the cube nearer before a hand touched it": when(
                lambda world: world.touching(ROBOT, "cube"),
                lambda world: world.touched("hook", "cube") and polar(world.com("cube") - BASE)[1] < near,
            ),
            "the hook was put down before the cube was taken": when(
                lambda world: world.touching(ROBOT, "cube") and not world.touching("cube", "table"),
                lambda world: not world.touching(ROBOT, "hook"),
            ),
        }

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Fetch the hook, draw the cube in, put the hook down beside it, grasp and lift the cube."""
        yield from self.take_hook(world)
        yield from self.draw_in(world)
        yield from put_down(world.arm, self.tool, "hook")
        yield from self.lift_cube(world)

    def take_hook(self, world: World) -> Plan:
        """Grasp the hook by its handle."""
        yield from take_handle(world.arm, self.tool, "hook", self.stretch)

    def draw_in(self, world: World, mirror: float = 1.0) -> Plan:
        """Put the tip behind the cube and pull; with `mirror` = -1 the tip passes the cube on the wrong side."""
        for leg in self._legs(world, mirror):
            yield from slide(world.arm, self.tool, "hook", *leg)

    def lift_cube(self, world: World, lift: float = 0.12) -> Plan:
        """Grasp the cube across the faces for which the hand turns least, and lift it [m]."""
        closing = world.arm.hand_rot[:, 0]
        faces = max(world.rot("cube")[:, :2].T, key=lambda normal: abs(float(normal @ closing)))
        yield from pick(world.arm, world.com("cube"), closing=faces, lift=lift)

    def steps(self) -> Mapping[str, Planner]:
        legs = list[Leg]()

        def pass_behind(world: World) -> Plan:
            legs[:] = self._legs(world)
            for leg in legs[:-1]:
                yield from slide(world.arm, self.tool, "hook", *leg)

        def draw_in(world: World) -> Plan:
            yield from slide(world.arm, self.tool, "hook", *(legs or self._legs(world))[-1])

        return {
            "take_hook": self.take_hook,
            "pass_behind": pass_behind,
            "draw_in": draw_in,
            "put_hook_down": lambda world: put_down(world.arm, self.tool, "hook"),
            "grasp_cube": partial(self.lift_cube, lift=0.0),
            "lift_cube": lambda world: retreat(world.arm, 0.12),
            "reach_cube": self._reach,
            "lift_with_hook": self._pick_with_hook,
            "grasp_with_hook": self._grasp_with_hook,
        }

    def _legs(self, world: World, mirror: float = 1.0) -> list[Leg]:
        """Ways of the held hook past the cube, behind it and back; see `hook.pull_legs`."""
        end = max(PULL_END_DISTANCE, nearest_pull(self.stretch) - self.half)
        return pull_legs(world.arm, self.tool, "cube", self.half, end, mirror)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        """Plans that skip a step; a T has a tip on either side, so none can be turned away."""
        return {
            "reach_for_the_cube": Shortcut(self._reach),
            **({"pull_with_the_tip_turned_away": Shortcut(self._pull_past)} if self.kind != T_HOOK else {}),
            "pick_the_cube_with_the_hook": Shortcut(self._pick_with_hook),
            "grasp_the_cube_with_the_hook_in_the_jaw": Shortcut(self._grasp_with_hook),
        }

    def _reach(self, world: World) -> Plan:
        """Stretch the arm towards the cube, hand tilted outwards, close, lift.

        With the tilt of 40 deg inverse kinematics comes closest near full stretch. The hand stops 3 cm short of full
        stretch, beyond which the arm is singular and creeps.
        """
        out = (world.com("cube") - SHOULDER) / np.linalg.norm(world.com("cube") - SHOULDER)
        tilted = about_z(polar(world.com("cube") - BASE)[0]) @ about_y(-math.radians(40.0)) @ facing_down()
        nearest = SHOULDER + (REACH - 0.03) * out
        yield from go_to(world.arm, nearest - 0.1 * out + 0.05 * UP, tilted, COARSE, OPEN)
        yield from go_to(world.arm, nearest, tilted)
        yield from grasp(world.arm)
        yield from go_to(world.arm, nearest - 0.1 * out + 0.1 * UP, pace=COARSE)

    def _pull_past(self, world: World) -> Plan:
        """Draw with the handle on the wrong side of the cube, then reach for the cube, which has not moved."""
        yield from self.take_hook(world)
        yield from self.draw_in(world, mirror=-1.0)
        yield from put_down(world.arm, self.tool, "hook")
        yield from self._reach(world)

    def _pick_with_hook(self, world: World) -> Plan:
        """Draw the cube in and lift it in the corner of the hook, then open the jaw."""
        yield from self.take_hook(world)
        yield from self.draw_in(world)
        yield from retreat(world.arm, 0.12)
        yield from release(world.arm)

    def _grasp_with_hook(self, world: World) -> Plan:
        """Draw the cube in, come down on it with the hook still in the jaw, close, lift, let go."""
        yield from self.take_hook(world)
        yield from self.draw_in(world)
        yield from retreat(world.arm, 0.08)
        cube, arm = world.com("cube"), world.arm
        yield from go_to(arm, [cube[0], cube[1], arm.hand[2]])
        yield from push(arm, -0.1 * UP, lambda: arm.hand[2] <= cube[2] or world.touching("hook", "cube"))
        yield from grasp(arm)
        yield from retreat(arm, 0.12)
        yield from release(arm)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Remove the hook, so that nothing reaches the cube; remove its tip, so that nothing pulls the cube."""
        bare, straight = self.build(), self.build()
        remove(bare, "hook")
        for i in range(1, len(self.tool.bars)):
            straight.delete(straight.geom(f"hook/bar_{i}"))
        return {"no_hook": bare, "no_tip": straight}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        return {
            "tip_to": choice(side_of(0.5 - self.hook.mirrored), "hook", "hook_yaw"),
            "hook_lies_on_the": choice(side_of(self.hook_y), "hook_y"),
            "side_of_the_cube": choice(side_of(self.bearing), "bearing"),
            "cube": near(self.spot, 0.020, "distance", "bearing"),
            "hand_on_the_hook": near((self.hook_x, self.hook_y), 0.010, "hook_x", "hook_y"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        turn, at = about_z(math.radians(self.hook_yaw)), np.array([self.hook_x, self.hook_y, TABLE_TOP])
        yield on_table("the hook", self.tool.corners @ turn.T + at)
        yield on_table("the cube", corners(self.spot, math.radians(self.cube_yaw), self.cube.size))
        gap, hand_at = self.out_of_touch, self._behind - self.stretch
        yield require(gap > 0, "the arm may touch the cube without the hook", gap=gap, reach=ik.GRIPPER_REACH)
        yield require(hand_at <= MAX_DISTANCE, "the hook is too short", hand_at=hand_at, arm=MAX_DISTANCE)
        both, tip = self.cube.edge + self.hook.width, self.hook.tip
        yield require(both > OPENING, "the jaw can hold hook and cube together", both=both, jaw=OPENING)
        yield require(tip >= self.half, "the tip ends before the cube's middle", tip=tip, half=self.half)
        _, away = polar(at + turn @ [self.tool.inside - self.stretch, 0.0, 0.0] - BASE)
        yield require(away <= MAX_DISTANCE, "the handle is out of reach", distance=away, arm=MAX_DISTANCE)

    def features(self) -> Mapping[str, float]:
        """Distance of the cube from the gripper's reach [m], the same over the handle, length of the tip over the
        edge."""
        return {
            "out_of_touch": self.out_of_touch,
            "shortfall_over_handle": self.out_of_touch / self.hook.length,
            "tip_over_edge": self.tool.engaging / self.cube.edge,
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "kind": ("like an L", "like a J", "like a T")[self.kind],
            "side": "on its left" if self.hook_y > 0.0 else "on its right",
            "distance": self.distance,
            "cube": way_to(self.spot, np.array([self.hook_x, self.hook_y])),
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def spot(self) -> Vec3:
        """Initial position of the cube's foot [m]."""
        away = self.distance * heading(self.bearing)
        return np.array([BASE[0] + away[0], BASE[1] + away[1], TABLE_TOP])

    @cached_property
    def tool(self) -> Hook:
        """Hook of its kind, with the handle of `hook`."""
        hook = self.hook
        width, height, mass, friction = hook.width, hook.height, hook.mass, hook.friction
        if self.kind == J_HOOK:
            # the opening is 22 mm wider than the tip of an L is long: the cube lies in it instead of at it
            length, radius = hook.length - hook.width, (hook.tip + 0.022 + hook.width) / 2
            return JHook(
                length=length,
                radius=radius,
                mirrored=hook.mirrored,
                width=width,
                height=height,
                mass=mass,
                friction=friction,
            )
        if self.kind == T_HOOK:
            return THook(length=hook.length, tip=hook.tip, width=width, height=height, mass=mass, friction=friction)
        return hook

    @cached_property
    def half(self) -> float:
        """Half the cube's edge [m]."""
        return self.cube.edge / 2

    @cached_property
    def out_of_touch(self) -> float:
        """Least distance of the gripper from the cube in any posture [m]; not positive if it may touch."""
        turn = about_z(math.radians(self.cube_yaw))
        return ik.box_shortfall(self.spot + self.half * UP, turn, self.half, ik.GRIPPER_REACH)

    @cached_property
    def stretch(self) -> float:
        """Distance from the grip on the handle to the face that pulls [m]."""
        return shortest_stretch(self.tool, self._behind)

    @cached_property
    def _behind(self) -> float:
        """Distance from the robot's first axis at which the pulling face is behind the cube, for any yaw of the cube
        [m]."""
        return self.distance + self.half * math.sqrt(2) + HOOK_CLEARANCE + self.tool.depth
