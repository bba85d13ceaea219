"""push-off: bring a cube into a zone without touching it, by pushing the block that stands behind it.

    hand ->  [block] [cube] . . . . | zone |        seen from the side; the push runs along u

Bottleneck: what the hand may touch is not what has to move, and how far it has to go differs from scene to scene. A
cube that has gone past the zone is lost: a wrong try costs the episode.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from scengen.assets.box import Block, Cube
from scengen.assets.patch import Patch
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.geometry import UP, Vec3, heading
from scengen.params import param
from scengen.predicates import fallen, inside, still
from scengen.robots.jaw import FINGER_ACROSS
from scengen.scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from scengen.sim.world import ROBOT, World
from scengen.skills.jaw import pick, poke, put
from scengen.skills.motion import wait

GAP = 0.01
"""Free space between block and cube [m]."""
SPEED = 0.10
"""Of a push [m/s]: friction of 0.5 stops that within v^2 / 2 mu g = 1 mm."""
CALM = 0.02
"""Speed below which the cube counts as at rest [m/s]: a fifth of that of a push, which only passes through the zone."""
SPARE = 0.015
"""How far the zone reaches beyond the cube on either side [m], seven times what jittered runs displace things by."""


@dataclass(frozen=True, kw_only=True)
class PushOff(Scenario):
    """A block, a cube in front of it, and a zone farther on, in one line."""

    HOLD = 0.5  # the goal counts when it has held for so long [s]

    # Every number of a scene is a parameter, with its unit and the bounds of its meaning. The task file says how it is
    # drawn; what that does not list keeps the value that stands here. Assets bring parameters of their own: `cube.mass`.
    x: float = param(-0.05, "m", -0.4, 0.4)
    y: float = param(-0.10, "m", -0.4, 0.4)
    """Where the cube stands at the start."""
    heading: float = param(90.0, "deg", -180.0, 180.0, period=360.0)
    """Direction of the push; 0 is x, away from the robot, 90 is y, to its left."""
    distance: float = param(0.12, "m", 0.05, 0.40)
    """From where the cube stands to the middle of the zone."""
    block: Block = Block(mass=0.15)
    cube: Cube = Cube(edge=0.04, rgba=(0.82, 0.20, 0.15, 1.0))
    zone: Patch = Patch(size=0.07)

    # --- scene: what there is, without the robot ------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene, yaw = table(), math.radians(self.heading)
        place(scene, self.block, "block", self.spot(-self.behind), yaw)
        place(scene, self.cube, "cube", self.spot(0.0), yaw)
        place(scene, self.zone, "zone", self.spot(self.distance), yaw, free=False)
        return scene

    # --- goal: asked in every control period ----------------------------------------------------

    def success(self, world: World) -> bool:
        """Whether the whole cube is at rest in the zone, in the zone's own axes: it may lie in any direction."""
        room = np.array([1.0, 1.0, math.inf]) * (self.zone.size - self.cube.edge) / 2
        return inside(world, "cube", "zone", -room, room) and still(world, "cube", CALM)

    def failure(self, world: World) -> str | None:
        if world.touched(ROBOT, "cube"):
            return "the robot touched the cube"
        if self.gone(world) > self.distance + self.zone.size / 2:
            return "the cube has gone past the zone"
        return "the cube fell off the table" if fallen(world, "cube") else None

    def gone(self, world: World) -> float:
        """How far the cube has gone along the push [m]."""
        return float((world.pos("cube") - self.spot(0.0)) @ self.u)

    # --- oracle: one way to do it, through the actions that a policy has --------------------------

    def oracle(self, world: World) -> Plan:
        """Push the block until the cube is in the middle of the zone, step back, and see that it stays there."""
        yield from self.push(world, self.distance)
        yield from wait(world.arm, lambda: self.success(world), give_up=2.0)

    def push(self, world: World, way: float) -> Plan:
        """Push the block with closed fingers until the cube has gone so far [m], then step back."""
        face = self.behind + self.block.width / 2
        start = self.spot(-face - FINGER_ACROSS - 0.02) + self.block.height / 2 * UP
        yield from poke(world.arm, start, SPEED * self.u, lambda: self.gone(world) >= way)

    # --- shortcuts: tempting plans that must fail, or the task is not what it seems -----------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "carry_the_cube": Shortcut(self._carry),
            "push_halfway": Shortcut(lambda world: self.push(world, self.distance / 2), to_rest=True),
            "push_too_far": Shortcut(lambda world: self.push(world, self.distance + self.zone.size)),
        }

    def _carry(self, world: World) -> Plan:
        """Leave the block alone: pick the cube up and put it down in the zone."""
        middle, across = self.cube.edge / 2 * UP, np.cross(UP, self.u)
        yield from pick(world.arm, world.com("cube"), across)
        yield from put(world.arm, "cube", self.spot(self.distance) + middle, "table")

    # --- ablations: without the intended means the recorded solution must fail ------------------------

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """No block: neither the goal nor a failure may ask for it, since it is not there."""
        scene = self.build()
        scene.delete(scene.body("block"))
        return {"no_block": scene}

    # --- constraints: which parameters make no scene, told before anything is simulated ---------------

    def constraints(self) -> Iterator[Refutation | None]:
        room = (self.zone.size - self.cube.edge) / 2
        yield require(room >= SPARE, "the zone leaves the cube no room", room=room, needed=SPARE)
        clear = self.distance - self.cube.edge / 2 - self.zone.size / 2
        yield require(clear >= 0.0, "the cube stands on the zone at the start", clear=clear)
        ends = [self.spot(-self.behind - 0.10), self.spot(self.distance + self.zone.size)]
        yield on_table("the push", ends, margin=0.02)
        yield within_reach("the push", *ends)

    def features(self) -> Mapping[str, float]:
        """What the physics depends on: how far it goes, and what is pushed."""
        return {"way_over_room": self.distance / self.zone.size, "pushed_mass": self.block.mass + self.cube.mass}

    # --- geometry -------------------------------------------------------------------------------

    @property
    def u(self) -> Vec3:
        """Unit vector along the push, shape (3,)."""
        return heading(self.heading)

    @property
    def behind(self) -> float:
        """From the middle of the block to that of the cube [m]."""
        return self.block.width / 2 + GAP + self.cube.edge / 2

    def spot(self, way: float) -> Vec3:
        """The place on the table that is `way` [m] from where the cube stands at the start, along the push."""
        return np.array([self.x, self.y, TABLE_TOP]) + way * self.u
