"""T03 sheltered-grasp: take a cube out of a covered rack, through its one open side.

         ______________
        |   |      |   |           seen from above, without its roof; there are two storeys, and both
        |   |  []  |   |  rack     have a back, ends and a roof. Whether the cube is in the upper or the
        |   |      |   |           lower one, and how far to the left, only a camera on the hand can see.
        '---'  ^^  '---'
               hand        [tray]

Bottleneck: the approach. The way from above, free in other tasks, is closed. The jaw must point level to the open side,
not down; its palm, 208 mm wide, fits between floor and ceiling only in that orientation.

Decisions, where the paper (App. B, T03) is silent:

* The object. App. D.2 lists the cracker box and the pudding box for this task, its text says cube: it is the cube. The
  cracker box, 72 mm across its narrowest side, leaves 2 mm on each side to a jaw that cannot be aimed from above.
* In training the rack is on the left of the table's middle and opens towards it. On the "opposite side" (App. I) rack
  and tray are mirrored: an object that is sheltered from the left can be reached only from the right. There one camera,
  `rgb_exo_left_cam`, looks into the rack, because robosuite's cameras are not mirrored with it.
* The cube stands so deep that in training no fixed camera sees any part of it; the camera on the hand may.
* The storey and the cube's place in it are geometry, which no label tells: the robot must look into one storey, then
  into the other. The paper calls this exploring. So there is no `answer`.
* Dropped in the tray: its middle is within the tray's walls and below their top, at rest, released, for 0.3 s, 30 steps
  as in the paper's T12 and T13. Raking the cube out of the rack and grasping it on the table counts: it came out of the
  open side, too.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from ..assets.bin import Bin
from ..assets.box import Cube
from ..assets.prop import TABLE_TOP, place, table
from ..assets.rack import STOREYS, TierRack
from ..geometry import UP, Mat3, Outline, Vec3, about_z, corners, gap, way_to
from ..params import param
from ..predicates import fallen, inside, still
from ..robots.jaw import OPEN_GAP, PALM_ABOVE, PALM_ACROSS, PALM_ALONG, TIP_BELOW
from ..robots.panda import BASE
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import ROBOT, World
from ..skills.jaw import grasp, pick, release
from ..skills.motion import COARSE, FINE, OPEN, STEADY, Pace, facing, facing_down, go_to, retreat

TRAY = Bin(width=0.13, length=0.13, depth=0.025, wall=0.006)
"""A tray wide enough for a cube that is dropped 6 cm and rolls over an edge."""
GRIP_HEIGHT = 0.042
"""Height of the grip site above the floor of a storey [m]: the palm of a level hand reaches 32 mm below it."""
MIN_CLEARANCE = 0.007
"""Least clearance between hand and rack on every side [m]: jitter takes 2 mm, moves are exact to 4 mm."""
ENTER_PACE = Pace(0.15, 0.004)  # pace of the moves into the rack and out of it
LIFT_HEIGHT = 0.008
"""Height by which the cube is lifted before it is drawn out [m]; the clearance above the palm is larger."""
RELEASE_HEIGHT = 0.09
"""Height of the grip site above the tray's floor at the release [m]: the palm stays 28 mm above the walls."""


@dataclass(frozen=True, kw_only=True)
class ShelteredGrasp(Scenario):
    """A cube in a rack that is open on one side, and a tray on the table before it."""

    HOLD = 0.3

    side: int = param(1, "1 left, -1 right", -1, 1)
    """Side of the table's middle on which the rack stands. 0 is refuted."""
    rack_x: float = param(-0.06, "m", -0.3, 0.3)
    rack_y: float = param(0.205, "m", 0.1, 0.3)  # distance of the rack to that side
    rack_yaw: float = param(0.0, "deg", -60.0, 60.0)
    """Yaw of the rack. At 0 the open side faces the middle; if negative, it faces towards the robot's base, so that the
    hand comes from there."""
    storey: int = param(0, "storey", 0, STOREYS - 1)
    along: float = param(0.03, "m", -0.15, 0.15)
    """Position of the cube along the open side, from its middle; positive away from the robot."""
    depth: float = param(0.085, "m", 0.03, 0.12)  # distance of the cube's middle behind the open side
    cube_yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)
    """Yaw of the cube relative to the table, whatever the yaw of the rack."""
    tray_x: float = param(0.11, "m", -0.4, 0.4)
    tray_y: float = param(-0.08, "m", -0.4, 0.4)  # position of the tray, positive to the side of the rack
    rack: TierRack = TierRack()
    cube: Cube = Cube(edge=0.048)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.rack)

    def _scene(self, rack: TierRack) -> mujoco.MjSpec:
        scene = table()
        place(scene, rack, "rack", self.foot, self.turn, free=False)
        place(scene, TRAY, "tray", self.tray, free=False)
        place(scene, self.cube, "cube", self.spot(self.storey, self.along), math.radians(self.side * self.cube_yaw))
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        low, high = np.array([-TRAY.width, -TRAY.length, 0.0]) / 2, np.array([TRAY.width, TRAY.length, 0.0]) / 2
        within = inside(world, "cube", "tray", low, high + (TRAY.floor + TRAY.depth) * UP)
        return within and still(world, "cube", 0.02) and not world.touching(ROBOT, "cube")

    def failure(self, world: World) -> str | None:
        return "the cube fell off the table" if fallen(world, "cube") else None

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Enter with a level hand at the cube, grasp it, come out the same way, drop it."""
        yield from self.fetch(world, self.spot(self.storey, self.along))

    def fetch(self, world: World, spot: Vec3, rot: Mat3 | None = None) -> Plan:
        """Fetch the cube from a place through the open side.

        Args:
            spot: place of the cube's foot [m].
            rot: orientation of the hand as it enters; by default level, towards the rack.
        """
        arm, rot, into = world.arm, self.entry if rot is None else rot, self.entry[:, 2]
        at = spot + GRIP_HEIGHT * UP
        out = at - (self.depth + 0.12) * into  # 12 cm before the open side
        away = np.array([0.0, -0.14 * self.side, 0.0])  # a turn drags the hand 0.1 m back towards the rack
        yield from go_to(arm, arm.hand + away, pace=COARSE, grip=OPEN)
        yield from go_to(arm, out, rot, STEADY)
        yield from go_to(arm, at, rot, ENTER_PACE)
        yield from grasp(arm)
        yield from go_to(arm, at + LIFT_HEIGHT * UP, rot, FINE)
        yield from go_to(arm, out + LIFT_HEIGHT * UP, rot, ENTER_PACE)
        yield from self.drop(world)

    def drop(self, world: World) -> Plan:
        """Bring the held cube above the tray with a level hand, and let go.

        The hand points 60 deg to the side: straight to the side it could not reach the far end of the table.
        """
        arm, rot = world.arm, facing(self.side * math.radians(60.0), 0.0)
        above = self.tray + (TRAY.floor + RELEASE_HEIGHT) * UP
        yield from go_to(arm, [above[0], above[1], max(above[2], arm.hand[2])], rot, STEADY)
        yield from go_to(arm, above, rot, STEADY)
        yield from release(arm)
        yield from retreat(arm, 0.05)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        here = self.spot(self.storey, self.along)
        elsewhere = {
            "the_other_storey": self.spot(STOREYS - 1 - self.storey, self.along),
            "the_other_end": self.spot(self.storey, -math.copysign(self._max_along, self.along)),
        }
        down, steep = facing_down(), facing(self._azimuth, math.radians(60.0))
        return {
            "from_above": Shortcut(lambda world: self._from_above(world, here)),
            "without_turning_the_hand": Shortcut(lambda world: self.fetch(world, here, down)),
            "with_a_steep_hand": Shortcut(lambda world: self.fetch(world, here, steep)),
            **{name: Shortcut(lambda world, s=spot: self.fetch(world, s)) for name, spot in elsewhere.items()},
        }

    def _from_above(self, world: World, spot: Vec3) -> Plan:
        """Grasp the cube from above as if there were no roof."""
        roof = self.foot[2] + self.rack.top
        yield from go_to(world.arm, [spot[0], spot[1], roof + 0.05], facing_down(), COARSE, OPEN)
        yield from pick(world.arm, spot + GRIP_HEIGHT * UP, self.entry[:, 0], above=0.0)
        yield from self.drop(world)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        return {"closed_rack": self._scene(replace(self.rack, closed=True))}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        rack, half = self.rack, self.cube.edge / 2
        yield require(self.side != 0, "the rack stands neither left nor right", side=self.side)
        yield require(abs(self.along) <= self._max_along, "a wall is in the palm's way", along=self.along)
        above = rack.height - GRIP_HEIGHT - PALM_ACROSS
        yield require(above >= MIN_CLEARANCE + LIFT_HEIGHT, "a storey is too low for the hand", room=above)
        behind = rack.depth - self.depth - max(TIP_BELOW, math.sqrt(2) * half)
        yield require(behind >= MIN_CLEARANCE, "the cube stands too near to the back", room=behind)
        before = self.depth - math.sqrt(2) * half
        yield require(before >= 0.0, "the cube stands out of the rack", room=before)
        across = OPEN_GAP - math.sqrt(2) * self.cube.edge
        yield require(across >= MIN_CLEARANCE, "turned askew the cube is too wide for the jaw", across=across)
        low, high = GRIP_HEIGHT - 0.02, GRIP_HEIGHT + 0.03
        yield require(
            low < self.cube.edge < high, "the level hand cannot hold a cube of this height", edge=self.cube.edge
        )
        yield on_table("the rack or the tray", self.outlines)
        apart = gap(*self.outlines)
        yield require(apart > 0.03, "the tray stands in the way into the rack", apart=apart)
        at = [self.spot(storey, self.along) + GRIP_HEIGHT * UP for storey in range(STOREYS)]
        yield within_reach("the cube or the tray", *at, self.tray + RELEASE_HEIGHT * UP)

    def features(self) -> Mapping[str, float]:
        """Azimuth of the entry [rad], depth over finger length, clearance beside the palm [m], cube to rack [rad]."""
        return {
            "azimuth": self._azimuth,
            "depth_over_palm": self.depth / PALM_ABOVE,
            "room_beside_palm": self.rack.width / 2 - abs(self.along) - PALM_ALONG,
            "cube_against_rack": math.radians((self.cube_yaw - self.rack_yaw + 45.0) % 90.0 - 45.0),
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "side": "on its left" if self.side > 0 else "on its right",
            "tray": way_to(self.tray, self.foot),
            "apart": math.dist(self.tray, self.foot),
            "distance": math.dist(self.foot[:2], BASE[:2]),
        }

    # --- geometry -------------------------------------------------------------------------

    @property
    def _max_along(self) -> float:
        """Largest distance from the middle of the open side at which the hand can enter [m]."""
        return self.rack.width / 2 - PALM_ALONG - MIN_CLEARANCE

    @property
    def turn(self) -> float:
        """Yaw of the rack [rad]; at 0 it opens towards -y."""
        return math.radians(self.rack_yaw if self.side > 0 else 180.0 - self.rack_yaw)

    @property
    def _azimuth(self) -> float:
        """Azimuth of a hand that enters the rack straight [rad], between -pi and pi."""
        return math.remainder(self.turn + math.pi / 2, math.tau)

    @property
    def entry(self) -> Mat3:
        """Orientation of a level hand that enters the rack straight."""
        return facing(self._azimuth, 0.0)

    @property
    def foot(self) -> Vec3:
        """Position of the rack's foot [m]."""
        return np.array([self.rack_x, self.side * self.rack_y, TABLE_TOP])

    @property
    def tray(self) -> Vec3:
        """Position of the tray's foot [m]."""
        return np.array([self.tray_x, self.side * self.tray_y, TABLE_TOP])

    def spot(self, storey: int, along: float) -> Vec3:
        """Place for the cube's foot in a storey [m]; the same `depth` everywhere."""
        return self.foot + about_z(self.turn) @ self.rack.inside(storey, self.side * along, self.depth)

    @property
    def outlines(self) -> tuple[Outline, Outline]:
        """Outlines of the rack and of the tray."""
        return corners(self.foot, self.turn, self.rack.outer), corners(self.tray, 0.0, TRAY.outer)
