"""T03 sheltered-grasp: take a cube out of a covered rack, through the one side that is open.

         ______________
        |   |      |   |           seen from above, without its roof; there are two storeys, and both
        |   |  []  |   |  rack     have a back, ends and a roof. Whether the cube is in the upper or the
        |   |      |   |           lower one, and how far to the left, only a camera on the hand can see.
        '---'  ^^  '---'
               hand        [tray]

Bottleneck: the way in. What is free above every other cube is closed here, and the jaw must not point down but level,
turned to the open side; its palm, 208 mm wide, fits between floor and ceiling only that way round.

Decisions, where the paper (App. B, T03) is silent:

* The cube. App. D.2 lists the cracker box and the pudding box for this task, its text says cube: it is the cube. The
  cracker box, 72 mm across its narrowest side, leaves a jaw that cannot be aimed from above 2 mm on each side.
* In training the rack is on the left of the table's middle and opens towards it. On the "opposite side" (App. I)
  everything is mirrored, rack and tray: what is sheltered from the left can only be reached from the right. There
  one camera, `rgb_exo_left_cam`, looks into the rack: robosuite's cameras are not mirrored with it.
* The cube stands so deep that no camera that stands still sees any of it in training; the one on the hand may.
* The storey, and where the cube stands in it, are told by no label: they are geometry, and have to be looked for. To
  look into one storey and then into the other one is what the paper calls exploring. So there is no `answer`.
* Dropped in the tray: its middle within the tray's walls and below their top, at rest, let go, for 0.3 s, 30 steps as
  in the paper's T12 and T13. A cube that is raked out of the rack and taken from the table came out the open side too.
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
from ..geometry import UP, Mat3, Outline, Vec3, about_z, corners, gap
from ..params import param
from ..predicates import fallen, inside, still
from ..robots.jaw import OPEN_GAP, PALM_ABOVE, PALM_ACROSS, PALM_ALONG, TIP_BELOW
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import ROBOT, World
from ..skills.jaw import grasp, pick, release
from ..skills.motion import COARSE, FINE, OPEN, STEADY, Pace, facing, facing_down, go_to, retreat

TRAY = Bin(width=0.13, length=0.13, depth=0.025, wall=0.006)
"""Wide enough for a cube that is dropped 6 cm and rolls over an edge."""
AT = 0.042
"""Height of the grip site over the floor of a storey [m]: the palm of a level hand reaches 32 mm below it."""
AIR = 0.007
"""Least space between hand and rack on every side [m]: jitter takes 2 mm, moves are exact to 4 mm."""
STAND_OFF = 0.12
"""How far before the mouth the hand is when it goes in and when it has come out [m]."""
ASIDE: Vec3 = np.array([0.0, 0.14, 0.0])
"""How far the hand goes away from a rack on the left before it turns up [m]: turning drags it 0.1 m back."""
ENTERING = Pace(0.15, 0.004)
"""In and out."""
RAISED = 0.008
"""How far the cube is lifted before it is drawn out [m]; above the palm there is more room than that."""
DROP = 0.09
"""Height of the grip site over the tray's floor when the cube is let go [m]: the palm stays 28 mm above the walls."""
STEEP = math.radians(60.0)
"""How far down the hand points that comes in neither level nor from above [rad]."""
OUTWARDS = math.radians(60.0)
"""Where the level hand points when it lets go: straight to the side it could not come to the far end of the table."""


@dataclass(frozen=True, kw_only=True)
class ShelteredGrasp(Scenario):
    """A cube in a rack that is open on one side, and a tray on the table before it."""

    HOLD = 0.3

    side: int = param(1, "1 left, -1 right", -1, 1)
    """On which side of the table's middle the rack stands. 0 is refuted."""
    rack_x: float = param(-0.06, "m", -0.3, 0.3)
    rack_y: float = param(0.205, "m", 0.1, 0.3)
    """To that side."""
    rack_yaw: float = param(0.0, "deg", -60.0, 60.0)
    """0: the open side looks to the middle; negative: away from the robot's base, so that the hand comes from there."""
    storey: int = param(0, "storey", 0, STOREYS - 1)
    along: float = param(0.03, "m", -0.15, 0.15)
    """Where the cube stands along the open side, from its middle; positive away from the robot."""
    depth: float = param(0.085, "m", 0.03, 0.12)
    """How far the cube's middle stands behind the open side."""
    cube_yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)
    """Against the table, however the rack is turned."""
    tray_x: float = param(0.11, "m", -0.4, 0.4)
    tray_y: float = param(-0.08, "m", -0.4, 0.4)
    """To the side of the rack."""
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
        """Go in level where the cube stands, take it, come out the same way, drop it."""
        yield from self.fetch(world, self.spot(self.storey, self.along))

    def fetch(self, world: World, spot: Vec3, rot: Mat3 | None = None) -> Plan:
        """Fetch what stands on a spot [m] through the open side.

        Args:
            rot: of the hand as it goes in; level, towards the rack, by default.
        """
        arm, rot, into = world.arm, self.entry if rot is None else rot, self.entry[:, 2]
        at = spot + AT * UP
        out = at - (self.depth + STAND_OFF) * into
        yield from go_to(arm, arm.hand - self.side * ASIDE, pace=COARSE, grip=OPEN)
        yield from go_to(arm, out, rot, STEADY)
        yield from go_to(arm, at, rot, ENTERING)
        yield from grasp(arm)
        yield from go_to(arm, at + RAISED * UP, rot, FINE)
        yield from go_to(arm, out + RAISED * UP, rot, ENTERING)
        yield from self.drop(world)

    def drop(self, world: World) -> Plan:
        """Bring what the jaw holds over the tray with a level hand, and let go."""
        arm, rot = world.arm, facing(self.side * OUTWARDS, 0.0)
        over = self.tray + (TRAY.floor + DROP) * UP
        yield from go_to(arm, [over[0], over[1], max(over[2], arm.hand[2])], rot, STEADY)
        yield from go_to(arm, over, rot, STEADY)
        yield from release(arm)
        yield from retreat(arm, 0.05)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        here = self.spot(self.storey, self.along)
        elsewhere = {
            "the_other_storey": self.spot(STOREYS - 1 - self.storey, self.along),
            "the_other_end": self.spot(self.storey, -math.copysign(self._farthest, self.along)),
        }
        down, steep = facing_down(), facing(self._azimuth, STEEP)
        return {
            "from_above": Shortcut(lambda world: self._from_above(world, here)),
            "without_turning_the_hand": Shortcut(lambda world: self.fetch(world, here, down)),
            "with_a_steep_hand": Shortcut(lambda world: self.fetch(world, here, steep)),
            **{name: Shortcut(lambda world, s=spot: self.fetch(world, s)) for name, spot in elsewhere.items()},
        }

    def _from_above(self, world: World, spot: Vec3) -> Plan:
        """As if there were no roof."""
        roof = self.foot[2] + self.rack.top
        yield from go_to(world.arm, [spot[0], spot[1], roof + 0.05], facing_down(), COARSE, OPEN)
        yield from pick(world.arm, spot + AT * UP, self.entry[:, 0], above=0.0)
        yield from self.drop(world)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        return {"closed_rack": self._scene(replace(self.rack, closed=True))}

    # --- what must hold -------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        rack, half = self.rack, self.cube.edge / 2
        yield require(self.side != 0, "the rack stands neither left nor right", side=self.side)
        yield require(abs(self.along) <= self._farthest, "a wall is in the palm's way", along=self.along)
        room = rack.height - AT - PALM_ACROSS
        yield require(room >= AIR + RAISED, "a storey is too low for the hand", room=room)
        room = rack.depth - self.depth - max(TIP_BELOW, math.sqrt(2) * half)
        yield require(room >= AIR, "the cube stands too near to the back", room=room)
        room = self.depth - math.sqrt(2) * half
        yield require(room >= 0.0, "the cube stands out of the rack", room=room)
        across = OPEN_GAP - math.sqrt(2) * self.cube.edge
        yield require(across >= AIR, "turned askew the cube is too wide for the jaw", across=across)
        low, high = AT - 0.02, AT + 0.03
        yield require(
            low < self.cube.edge < high, "the level hand cannot hold a cube of this height", edge=self.cube.edge
        )
        yield on_table("the rack or the tray", self.outlines)
        apart = gap(*self.outlines)
        yield require(apart > 0.03, "the tray stands in the way into the rack", apart=apart)
        at = [self.spot(storey, self.along) + AT * UP for storey in range(STOREYS)]
        yield within_reach("the cube or the tray", *at, self.tray + DROP * UP)

    def features(self) -> Mapping[str, float]:
        """How the hand must come, how far it must go in, and what room it has."""
        return {
            "azimuth": self._azimuth,
            "depth_over_palm": self.depth / PALM_ABOVE,
            "room_beside_palm": self.rack.width / 2 - abs(self.along) - PALM_ALONG,
            "cube_against_rack": math.radians((self.cube_yaw - self.rack_yaw + 45.0) % 90.0 - 45.0),
        }

    # --- geometry -------------------------------------------------------------------------

    @property
    def _farthest(self) -> float:
        """How far from the middle of the open side the hand can go in [m]."""
        return self.rack.width / 2 - PALM_ALONG - AIR

    @property
    def turn(self) -> float:
        """Of the rack about the vertical; 0: it opens towards -y [rad]."""
        return math.radians(self.rack_yaw if self.side > 0 else 180.0 - self.rack_yaw)

    @property
    def _azimuth(self) -> float:
        """Where a hand points that goes straight into the rack [rad], between -pi and pi."""
        return math.remainder(self.turn + math.pi / 2, math.tau)

    @property
    def entry(self) -> Mat3:
        """Orientation of a level hand that points straight into the rack."""
        return facing(self._azimuth, 0.0)

    @property
    def foot(self) -> Vec3:
        """Where the rack stands [m]."""
        return np.array([self.rack_x, self.side * self.rack_y, TABLE_TOP])

    @property
    def tray(self) -> Vec3:
        """Where the tray stands [m]."""
        return np.array([self.tray_x, self.side * self.tray_y, TABLE_TOP])

    def spot(self, storey: int, along: float) -> Vec3:
        """A place for the cube's foot [m]; the same `depth` everywhere."""
        return self.foot + about_z(self.turn) @ self.rack.inside(storey, self.side * along, self.depth)

    @property
    def outlines(self) -> tuple[Outline, Outline]:
        """Of the rack and of the tray."""
        return corners(self.foot, self.turn, self.rack.outer), corners(self.tray, 0.0, TRAY.outer)
