"""push-off: bring a cube into a zone without touching it, by pushing the block that stands behind it.

    hand ->  [block] [cube] . . . . | zone |        seen from the side; the push runs along u

Bottleneck: the hand may touch the block, but the cube must move, by a distance that differs from scene to scene. A cube
past the zone is lost: a failed attempt ends the episode.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from scengen.assets.box import Block, Cube
from scengen.assets.patch import Patch
from scengen.assets.prop import TABLE_TOP, place, remove, table
from scengen.decisions import Decision, around
from scengen.geometry import UP, Vec3, heading
from scengen.means import Mean, when
from scengen.params import param
from scengen.predicates import fallen, inside, still
from scengen.robots.jaw import FINGER_ACROSS
from scengen.scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from scengen.sim.arm import ROBOT
from scengen.sim.world import World
from scengen.skills.jaw import pick, poke, put
from scengen.skills.motion import wait

BLOCK_GAP = 0.01
"""Free space between block and cube at the start [m]."""
PUSH_SPEED = 0.10
"""Speed of a push [m/s]: at a friction of 0.5 the cube stops within v^2 / 2 mu g = 1 mm."""
REST_SPEED = 0.02
"""Speed below which the cube counts as at rest [m/s]: a fifth of that of a push, which may only pass through the zone."""
ZONE_MARGIN = 0.015
"""Least distance from the cube to the zone's edge on either side [m], seven times the displacement in jittered runs."""


@dataclass(frozen=True, kw_only=True)
class PushOff(Scenario):
    """A block, a cube in front of it, and a zone beyond the cube, in one line."""

    VERSION = 1
    HOLD = 0.5  # time for which the goal must hold before it counts [s]

    # Every number of a scene is a parameter, with a nominal value, a unit and bounds. The task file says how it is drawn;
    # a parameter that the task file does not list keeps its nominal value. Assets have parameters too: `cube.mass`.
    x: float = param(-0.05, "m", -0.4, 0.4)
    y: float = param(-0.10, "m", -0.4, 0.4)
    """Place of the cube at the start."""
    heading: float = param(90.0, "deg", -180.0, 180.0, period=360.0)
    """Direction of the push; 0 is x, away from the robot, 90 is y, to its left."""
    distance: float = param(0.12, "m", 0.05, 0.40)
    """Distance from the cube at the start to the middle of the zone."""
    block: Block = Block(mass=0.15)
    cube: Cube = Cube(edge=0.04, rgba=(0.82, 0.20, 0.15, 1.0))
    zone: Patch = Patch(size=0.07)

    # --- scene, without the robot ---------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene, yaw = table(), math.radians(self.heading)
        place(scene, self.block, "block", self.spot(-self.behind), yaw)
        place(scene, self.cube, "cube", self.spot(0.0), yaw)
        place(scene, self.zone, "zone", self.spot(self.distance), yaw, free=False)
        return scene

    # --- goal, evaluated in every control period ------------------------------------------------

    def success(self, world: World) -> bool:
        """Whether the whole cube is at rest in the zone. It is measured in the zone's axes, which may be turned."""
        half = np.array([1.0, 1.0, math.inf]) * (self.zone.size - self.cube.edge) / 2
        return inside(world, "cube", "zone", -half, half) and still(world, "cube", REST_SPEED)

    def failure(self, world: World) -> str | None:
        if world.touched(ROBOT, "cube"):
            return "the robot touched the cube"
        if self.moved(world) > self.distance + self.zone.size / 2:
            return "the cube has gone past the zone"
        return "the cube fell off the table" if fallen(world, "cube") else None

    def means(self) -> Mapping[str, Mean]:
        """What the intended solution does. A goal that was reached without it does not count under strict rules."""
        return {
            "the block pushed the cube": when(
                lambda world: self.moved(world) > 0.01, lambda world: world.touched("block", "cube")
            )
        }

    def moved(self, world: World) -> float:
        """Distance that the cube has moved along the push [m]."""
        return float((world.pos("cube") - self.spot(0.0)) @ self.u)

    # --- oracle: a solution by the actions of a policy ------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Push the block until the cube is in the middle of the zone, step back, and wait until it counts."""
        yield from self.push(world, self.distance)
        yield from wait(world.arm, lambda: self.success(world), give_up=2.0)

    def push(self, world: World, distance: float) -> Plan:
        """Push the block with closed fingers until the cube has moved by a distance [m], then step back."""
        face = self.behind + self.block.width / 2
        start = self.spot(-face - FINGER_ACROSS - 0.02) + self.block.height / 2 * UP
        yield from poke(world.arm, start, PUSH_SPEED * self.u, lambda: self.moved(world) >= distance)

    # --- shortcuts: tempting plans that must fail -----------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "carry_the_cube": Shortcut(self._carry),
            "push_halfway": Shortcut(lambda world: self.push(world, self.distance / 2), to_rest=True),
            "push_too_far": Shortcut(lambda world: self.push(world, self.distance + self.zone.size)),
        }

    def _carry(self, world: World) -> Plan:
        """Pick the cube up and put it down in the zone, without the block."""
        middle, across = self.cube.edge / 2 * UP, np.cross(UP, self.u)
        yield from pick(world.arm, world.com("cube"), across)
        yield from put(world.arm, "cube", self.spot(self.distance) + middle, "table")

    # --- ablations: scenes without the means, in which the recorded solution must fail ------------

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """No block; `success` and `failure` must therefore not refer to it."""
        scene = self.build()
        remove(scene, "block")
        return {"no_block": scene}

    # --- decisions: what a solution depends on, for scengen axis cues -----------------------------

    def decisions(self) -> Mapping[str, Decision]:
        """How far and in which direction the cube must move, and the parameters that this is meant to follow from."""
        room = (self.zone.size - self.cube.edge) / 2
        return {
            "distance": around(self.distance, room, "distance"),
            "direction": around(self.heading, math.degrees(room / self.distance), "heading"),
        }

    # --- constraints: refute invalid parameters before anything is simulated ----------------------

    def constraints(self) -> Iterator[Refutation | None]:
        room = (self.zone.size - self.cube.edge) / 2
        yield require(room >= ZONE_MARGIN, "the zone leaves the cube no room", room=room, needed=ZONE_MARGIN)
        clear = self.distance - self.cube.edge / 2 - self.zone.size / 2
        yield require(clear >= 0.0, "the cube stands on the zone at the start", clear=clear)
        ends = [self.spot(-self.behind - 0.10), self.spot(self.distance + self.zone.size)]
        yield on_table("the push", ends, margin=0.02)
        yield within_reach("the push", *ends)

    def features(self) -> Mapping[str, float]:
        """What the physics depends on: distance over the size of the zone, and the mass that is pushed [kg]."""
        return {"way_over_room": self.distance / self.zone.size, "pushed_mass": self.block.mass + self.cube.mass}

    # --- geometry -------------------------------------------------------------------------------

    @property
    def u(self) -> Vec3:
        """Unit vector along the push, shape (3,)."""
        return heading(self.heading)

    @property
    def behind(self) -> float:
        """Distance from the middle of the block to that of the cube at the start [m]."""
        return self.block.width / 2 + BLOCK_GAP + self.cube.edge / 2

    def spot(self, distance: float) -> Vec3:
        """Place on the table at a distance [m] from the cube's at the start, along the push."""
        return np.array([self.x, self.y, TABLE_TOP]) + distance * self.u
