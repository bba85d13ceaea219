"""T03 sheltered-grasp: take an object out of a covered rack, through its one open side.

         ______________
        |   |      |   |           seen from above, without its roof; there are two storeys, and both
        |   |  []  |   |  rack     have a back, ends and a roof. Whether the object is in the upper or
        |   |      |   |           the lower one, and how far to the left, only a camera on the hand can see.
        '---'  ^^  '---'
               hand        [tray]

Bottleneck: the approach. The way from above, free in other tasks, is closed. The jaw must point level to the open side,
not down; its palm, 208 mm wide, fits between floor and ceiling only in that orientation.

Decisions, where the paper (App. B, T03) is silent:

* The object. The text says cube, App. D.2 lists the cracker box and the pudding box: training has cubes, an axis the
  pudding box, which lies on its narrow side. The cracker box, 72 mm across its narrowest side, leaves 2 mm on each side
  to a jaw that cannot be aimed from above.
* In training the rack is on the left of the table's middle and opens towards it. On the "opposite side" (App. I) rack
  and tray are mirrored: an object that is sheltered from the left can be reached only from the right.
* "Initially not visible": no fixed camera sees any part of the object in any scene; the camera on the hand may.
  From where `rgb_exo_left_cam` stands in robosuite, it would look into a rack on the right. Here it stands higher, and
  looks down on the roof of either rack. A scene in which any line of sight ends at the object is refuted.
* The storey and the object's place in it are geometry, which no label reveals: the robot must look into one storey,
  then into the other. The paper calls this exploring. So there is no `answer`.
* Exploring is looking: the object is between the fingers at the first touch, and the jaw closes in the rack on nothing
  else. Otherwise closed fingers that sweep each storey drive the object to a place where the jaw takes it (32 of 48),
  or feel for it with short thrusts (32 of 48). An open jaw that passes over the object and is lowered on it feels the
  side to shift to (8 of 12). A blind jaw that closes at three places one after the other finds it in 11 to 18 of 48
  scenes. These are labelled, unless the first place is right (10 of 48). The opening between the rack's ends is not
  much wider than the hand. In a rack of 50 cm three places would leave 10 of 60, but there an approach that is learned
  relative to the object would serve turned racks, too.
* The tray needs no look in training: one fixed place serves 82 % of the scenes.
* Dropped in the tray: its middle is between the tray's walls, and it touches the tray and nothing else, at rest, for
  0.3 s, 30 steps as in the paper's T12 and T13. Raking it out of the rack and grasping it on the table counts: it came
  out of the open side, too.
"""

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import mujoco
import numpy as np

from ..assets.bin import Bin
from ..assets.box import Box, Cube
from ..assets.package import Carton
from ..assets.prop import CAMERAS, TABLE_TOP, aim, place, table
from ..assets.rack import STOREYS, TierRack
from ..assets.ycb import Ycb
from ..decisions import Decision, around, choice, near, side_of
from ..geometry import UP, Mat3, Outline, Vec3, about_z, corners, gap, way_to
from ..means import Mean, once, throughout, when
from ..params import param
from ..predicates import borne, fallen, rests_on, still
from ..robots.jaw import OPEN_GAP, PALM_ABOVE, PALM_ACROSS, PALM_ALONG, TIP_BELOW
from ..robots.panda import BASE, ROBOTVIEW
from ..scenario import Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT
from ..sim.world import World
from ..skills.jaw import grasp, let_go, pick
from ..skills.motion import COARSE, FINE, OPEN, STEADY, Pace, facing, facing_down, go_to

TRAY = Bin(width=0.15, length=0.15, depth=0.025, wall=0.006)
"""A tray wide enough for a cube that rolls over an edge, and for a box that topples."""
PUDDING_BOX = cast(Carton, Ycb(item=6, low=1).prop)
"""The pudding box of the YCB set on its narrow side: 38 mm wide, 90 mm high, its length away from the open side."""
SIDE_EYE = (-0.05, 0.45, 2.70)
"""Position of the camera on the left [m]. From 2.4 m above a storey's floor for each metre before the object on, the
roof hides what stands as deep as in training."""
SIDE_AIM = (-0.05, 0.0, TABLE_TOP)
"""Place in the middle of its picture [m]."""
EYES = {name: np.array(pos) for name, pos, _ in CAMERAS} | {"sideview": np.array(SIDE_EYE), "robotview": ROBOTVIEW}
"""Positions of all cameras but that on the hand [m]."""
GRIP_HEIGHT = 0.042
"""Height of the grip site above the floor of a storey [m]: the palm of a level hand reaches 32 mm below it."""
MIN_CLEARANCE = 0.007
"""Least clearance between hand and rack on every side [m]: jitter takes 2 mm, moves are exact to 4 mm."""
ENTER_PACE = Pace(0.15, 0.004)  # pace of the moves into the rack and out of it
GRIP_DEPTH = 0.025
"""Distance of the grip site behind the front of a long object [m]: the palm stays 6 mm before it."""
LIFT_HEIGHT = 0.008
"""Height by which the object is lifted before it is drawn out [m]; the clearance above the palm is larger."""
MIN_BETWEEN = 0.010
"""Least depth of the object's front behind the grip site when the robot first touches it [m]: the oracle comes 21 mm
deep. The tips of fingers that meet the front are 9 mm before it."""
MAX_SQUEEZE = 0.001  # largest distance by which pads that hold the object are closer than it is wide [m]
RELEASE_HEIGHT = 0.072
"""Height of the grip site above the tray's floor at the release [m]: the palm stays 15 mm above the walls."""


@dataclass(frozen=True, kw_only=True)
class ShelteredGrasp(Scenario):
    """An object in a rack that is open on one side, and a tray on the table before it."""

    VERSION = 3
    CONCEALED = ("thing",)
    HOLD = 0.3

    side: int = param(1, "1 left, -1 right", -1, 1)
    """Side of the table's middle on which the rack stands. 0 is refuted."""
    rack_x: float = param(-0.06, "m", -0.3, 0.3)
    rack_y: float = param(0.212, "m", 0.1, 0.3)  # distance of the rack to that side
    rack_yaw: float = param(0.0, "deg", -60.0, 60.0)
    """Yaw of the rack. At 0 the open side faces the middle; if negative, it faces towards the robot's base, so that the
    hand comes from there."""
    storey: int = param(0, "storey", 0, STOREYS - 1)
    along: float = param(0.03, "m", -0.15, 0.15)
    """Position of the object along the open side, from its middle; positive away from the robot."""
    depth: float = param(0.061, "m", 0.01, 0.12)
    """Distance of the object's front behind the open side, if it stands square in the rack."""
    item: int = param(0, "0 cube, 1 pudding box", 0, 1)
    yaw: float = param(0.0, "deg", -45.0, 45.0)
    """Yaw of the object relative to the table, independent of the yaw of the rack."""
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
        place(scene, self.thing, "thing", self.spot(self.storey, self.along), math.radians(self.side * self.yaw))
        aim(scene, "sideview", SIDE_EYE, SIDE_AIM)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        x, y, _ = world.com("thing") - self.tray
        between = abs(x) < TRAY.width / 2 and abs(y) < TRAY.length / 2
        return between and rests_on(world, "thing", "tray") and still(world, "thing", 0.02)

    def failure(self, world: World) -> str | None:
        return "the thing fell off the table" if fallen(world, "thing") else None

    def means(self) -> Mapping[str, Mean]:
        width, length, height = self.thing.size

        def between(world: World) -> bool:
            at = world.arm.hand_rot.T @ (world.com("thing") - world.arm.hand)
            beside = abs(at[0]) < world.arm.gap / 2 and abs(at[1]) < height / 2  # not above it
            return bool(beside and at[2] - length / 2 < -MIN_BETWEEN)

        def closed(world: World) -> bool:
            at = about_z(self.turn).T @ (world.arm.hand - self.foot)
            in_rack = at[1] > self.rack.mouth and at[2] < self.rack.top
            return bool(in_rack) and world.arm.gap < width - MAX_SQUEEZE

        def over_tray(world: World) -> bool:
            away = np.abs(world.com("thing") - self.tray)
            return bool(away[0] < TRAY.width / 2 and away[1] < TRAY.length / 2)

        return {
            "the thing was between the fingers when the robot first touched it": when(
                lambda world: world.touching(ROBOT, "thing"), between
            ),
            "the jaw closed in the rack on the thing alone": throughout(
                lambda world: not closed(world) or world.touching(ROBOT, "thing")
            ),
            "the jaw held the thing as it came out of the rack": when(
                lambda world: not self._sheltered(world), lambda world: world.arm.grips("thing")
            ),
            "the jaw bore the thing over the tray": once(
                lambda world: over_tray(world) and borne(world, world.arm, "thing")
            ),
        }

    def _sheltered(self, world: World) -> bool:
        """Whether the object's middle is in the rack."""
        at = about_z(self.turn).T @ (world.com("thing") - self.foot)
        return bool(at[1] > self.rack.mouth)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Enter with a level hand at the object, grasp it, come out the same way, drop it."""
        yield from self.fetch(world, self.spot(self.storey, self.along))

    def fetch(self, world: World, spot: Vec3, rot: Mat3 | None = None) -> Plan:
        """Fetch the object from a place through the open side.

        Args:
            spot: place of the object's foot [m].
            rot: orientation of the hand as it enters; by default level, towards the rack.
        """
        rot = self.entry if rot is None else rot
        yield from self._come_before(world, spot, rot)
        yield from go_to(world.arm, self.grip_at(spot), rot, ENTER_PACE)
        yield from grasp(world.arm)
        yield from self._come_out(world, spot, rot)
        yield from self.drop(world)

    def _come_before(self, world: World, spot: Vec3, rot: Mat3) -> Plan:
        """Bring the open jaw before the open side, at the height of a place [m]."""
        away = np.array([0.0, -0.17 * self.side, 0.0])  # a turn drags the hand 0.1 m back towards the rack
        yield from go_to(world.arm, world.arm.hand + away, pace=COARSE, grip=OPEN)
        yield from go_to(world.arm, self._before(spot), rot, STEADY)

    def _come_out(self, world: World, spot: Vec3, rot: Mat3) -> Plan:
        """Lift the held object off the floor and draw it out through the open side."""
        yield from go_to(world.arm, self.grip_at(spot) + LIFT_HEIGHT * UP, rot, FINE)
        yield from go_to(world.arm, self._before(spot) + LIFT_HEIGHT * UP, rot, ENTER_PACE)

    def _before(self, spot: Vec3) -> Vec3:
        """Place of the hand 12 cm before the open side, at the height of a place [m]."""
        return self.grip_at(spot) - (self.depth + GRIP_DEPTH + 0.12) * self.entry[:, 2]

    def drop(self, world: World) -> Plan:
        """Bring the held object above the tray with a level hand, and let go.

        The hand points 60 deg to the side: straight to the side it could not reach the far end of the table.
        """
        arm, rot = world.arm, facing(self.side * math.radians(60.0), 0.0)
        above = self.tray + (TRAY.floor + RELEASE_HEIGHT) * UP
        yield from go_to(arm, [above[0], above[1], max(above[2], arm.hand[2])], rot, STEADY)
        yield from go_to(arm, above - self.lever * rot[:, 2], rot, STEADY)
        yield from let_go(arm, 0.05)

    def steps(self) -> Mapping[str, Planner]:
        spot, steep = self.spot(self.storey, self.along), facing(self._azimuth, math.radians(60.0))
        return {
            "level_hand": lambda world: self._come_before(world, spot, self.entry),
            "enter": lambda world: go_to(world.arm, self.grip_at(spot), self.entry, ENTER_PACE),
            "grasp": lambda world: grasp(world.arm),
            "come_out": lambda world: self._come_out(world, spot, self.entry),
            "drop_in_tray": self.drop,
            "from_above": lambda world: self._from_above(world, spot),
            "reach_steeply": lambda world: self.fetch(world, spot, steep),
        }

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
        """Grasp the object from above as if there were no roof."""
        roof = self.foot[2] + self.rack.top
        yield from go_to(world.arm, [spot[0], spot[1], roof + 0.05], facing_down(), COARSE, OPEN)
        yield from pick(world.arm, self.grip_at(spot), self.entry[:, 0], above=0.0)
        yield from self.drop(world)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        return {"closed_rack": self._scene(replace(self.rack, closed=True))}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        return {
            "storey": choice(self.storey),
            "along": around(self.along, (0.080 - float(self.thing.size[0])) / 2),
            "side": choice(self.side, "side"),
            "tray": near(self.tray, 0.045, "tray_x", "tray_y"),
            "hand_turns": choice(side_of(math.remainder(self._azimuth - math.pi / 2, math.tau)), "side", "rack_yaw"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        rack, high = self.rack, float(self.thing.size[2])
        yield require(self.side != 0, "the rack stands neither left nor right", side=self.side)
        yield require(abs(self.along) <= self._max_along, "a wall is in the palm's way", along=self.along)
        above = rack.height - max(GRIP_HEIGHT + PALM_ACROSS, high)
        yield require(above >= MIN_CLEARANCE + LIFT_HEIGHT, "a storey is too low", room=above)
        (_, deep), (across, _) = self.lengths(self.thing.size[1]), self.lengths(2 * GRIP_DEPTH)
        behind = rack.depth - self.middle_depth - max(TIP_BELOW + MIN_CLEARANCE, deep / 2 + 0.002)
        yield require(behind >= 0.0, "the object stands too near to the back", room=behind)
        before = self.middle_depth - deep / 2
        yield require(before >= 0.0, "the object stands out of the rack", room=before)
        beside = OPEN_GAP - across
        yield require(beside >= MIN_CLEARANCE, "turned askew the object is too wide for the jaw", across=beside)
        yield require(high > GRIP_HEIGHT - 0.02, "the level hand closes above the object", height=high)
        hidden = min(map(self.hidden_by, EYES.values()))
        yield require(hidden > 0.0, "a camera that stands still sees the object", hidden_by=hidden)
        yield on_table("the rack or the tray", self.outlines)
        apart = gap(*self.outlines)
        yield require(apart > 0.03, "the tray stands in the way into the rack", apart=apart)
        at = [self.spot(storey, self.along) + GRIP_HEIGHT * UP for storey in range(STOREYS)]
        yield within_reach("the object or the tray", *at, self.tray + RELEASE_HEIGHT * UP)

    def features(self) -> Mapping[str, float]:
        """Azimuth of the entry [rad], depth over finger length, clearance beside the palm [m], object to rack [rad],
        length of the object over its width."""
        return {
            "azimuth": self._azimuth,
            "depth_over_palm": (self.depth + GRIP_DEPTH) / PALM_ABOVE,
            "room_beside_palm": self.rack.width / 2 - abs(self.along) - PALM_ALONG,
            "object_against_rack": math.radians(self.yaw - self.rack_yaw),
            "length_over_width": float(self.thing.size[1] / self.thing.size[0]),
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "side": "on its left" if self.side > 0 else "on its right",
            "tray": way_to(self.tray, self.foot),
            "apart": math.dist(self.tray, self.foot),
            "distance": math.dist(self.foot[:2], BASE[:2]),
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def _max_along(self) -> float:
        """Largest distance from the middle of the open side at which the hand can enter [m]."""
        return self.rack.width / 2 - PALM_ALONG - MIN_CLEARANCE

    @cached_property
    def turn(self) -> float:
        """Yaw of the rack [rad]; at 0 it opens towards -y."""
        return math.radians(self.rack_yaw if self.side > 0 else 180.0 - self.rack_yaw)

    @cached_property
    def _azimuth(self) -> float:
        """Azimuth of a hand that enters the rack straight [rad], between -pi and pi."""
        return math.remainder(self.turn + math.pi / 2, math.tau)

    @cached_property
    def entry(self) -> Mat3:
        """Orientation of a level hand that enters the rack straight."""
        return facing(self._azimuth, 0.0)

    @cached_property
    def foot(self) -> Vec3:
        """Position of the rack's foot [m]."""
        return np.array([self.rack_x, self.side * self.rack_y, TABLE_TOP])

    @cached_property
    def tray(self) -> Vec3:
        """Position of the tray's foot [m]."""
        return np.array([self.tray_x, self.side * self.tray_y, TABLE_TOP])

    @cached_property
    def thing(self) -> Box:
        """The object in the rack; the y axis of its body points away from the open side."""
        return self.cube if self.item == 0 else PUDDING_BOX

    def lengths(self, most: float) -> tuple[float, float]:
        """Lengths of the object along the open side and away from it, as it stands in the rack [m].

        Args:
            most: length of it that counts, from its front [m].
        """
        turn, (x, y, _) = math.radians(self.yaw - self.rack_yaw), self.thing.size
        cos, sin, y = abs(math.cos(turn)), abs(math.sin(turn)), min(most, y)
        return cos * x + sin * y, sin * x + cos * y

    @cached_property
    def middle_depth(self) -> float:
        """Distance of the object's middle behind the open side [m]."""
        return self.depth + float(self.thing.size[1]) / 2

    @cached_property
    def lever(self) -> float:
        """Distance from the grip site to the object's middle, which is beyond it in a long object [m]."""
        return max(0.0, float(self.thing.size[1]) / 2 - GRIP_DEPTH)

    def spot(self, storey: int, along: float) -> Vec3:
        """Place for the object's foot in a storey [m]; the same `depth` everywhere."""
        return self.foot + about_z(self.turn) @ self.rack.inside(storey, self.side * along, self.middle_depth)

    def grip_at(self, spot: Vec3) -> Vec3:
        """Position of the grip site for an object whose foot is at a place [m]."""
        back = about_z(math.radians(self.side * self.yaw)) @ [0.0, -self.side, 0.0]
        return spot + self.lever * back + GRIP_HEIGHT * UP

    def hidden_by(self, eye: Vec3) -> float:
        """Distance by which the nearest line of sight from `eye` to the object misses the opening of its storey, in the
        plane of the open side [m]; negative if one passes."""
        rack, into = self.rack, about_z(self.turn).T
        x, y, z = into @ (eye - self.foot)
        if y >= rack.mouth:
            return math.inf  # the eye is behind that plane
        signs = np.array(list(itertools.product((-1, 1), (-1, 1), (0, 2))))
        turned = about_z(math.radians(self.side * self.yaw))
        ends = (self.spot(self.storey, self.along) - self.foot + self.thing.size / 2 * signs @ turned.T) @ into.T
        met = np.array([x, z]) + (ends[:, ::2] - [x, z]) * ((rack.mouth - y) / (ends[:, 1:2] - y))
        half, low = rack.width / 2, rack.floor(self.storey)
        opening = np.array([[sx, sz] for sx in (-half, half) for sz in (low, low + rack.height)])
        sides = np.vstack([np.eye(2), *(met[i + 1 :] - met[i] for i in range(len(met)))])  # separating axes
        normals = sides[:, ::-1] * [1.0, -1.0] / np.linalg.norm(sides, axis=1, keepdims=True)
        one, other = met @ normals.T, opening @ normals.T
        return float(np.maximum(one.min(0) - other.max(0), other.min(0) - one.max(0)).max())

    @cached_property
    def outlines(self) -> tuple[Outline, Outline]:
        """Outlines of the rack and of the tray."""
        return corners(self.foot, self.turn, self.rack.outer), corners(self.tray, 0.0, TRAY.outer)
