"""T20 indirect-push: push a red block into a zone, with both out of the arm's reach.

                                                           zone
      base                     block  block     target    .---.      seen from above, along the target's bearing
       (o)  - - - -  hand >>    [ ]    [ ]  - - - [#] - - |   | -    from the robot's first axis
                                                          '---'
                 [ ]       [ ]      [ ]   blocks lie scattered

Bottleneck: the push must be lengthened. No part of the hand reaches the target, but the hand can push a block that
pushes a block that pushes the target. These blocks must be fetched and put in line first, as many as the distance
requires.

Decisions, where the paper (App. B, T20) is silent or cannot be taken literally:

* The paper's chain connects "the target to the goal zone", where it would stand in the target's way. Here it stands
  between hand and target, in line with the zone.
* Out of reach. The arm swings about a shoulder 0.445 m above the table, and a band before the far edge is beyond it. It
  is deep enough for target, zone and the way between them only towards the corners, which gives the bearing: 20 deg.
  Scenarios are refuted unless *no part of the gripper* can touch the target in any posture (`ik.GRIPPER_REACH`).
* One block must not be enough: the zone starts beyond what the arm at full stretch reaches with one, by the triangle
  inequality and without search. Two are enough in training. If the zone is farther or the blocks are smaller, a hand
  that leans by 35 deg, as the oracle's does, needs three so that the arm is not stretched to its limit. A hand that
  leans by 65 deg does it with two (`far_zone` 12 of 12, `small_blocks` 8 of 12).
* In training one bearing, 19.5 deg, serves every scene (12 of 12). So do one end of the push, two blocks, and block 2
  at the head. Target and zone need no look there, the blocks do.
* A push, not a blow: the target moves while a chain of touching blocks leads from the hand to it, and slides on by
  itself no faster than 80 mm/s. Otherwise an arm driven through its full stretch jumped and shot the block before it at
  0.6 m/s at the target, and one block moved the target anywhere. A block that was knocked on repeatedly, each time some
  millimetres beyond the hand's reach, brought it into the zone in a dozen knocks.
* No block touches robot and target at once; the paper says that a chain is needed. The bound above holds for a block
  that is pushed square. A block that is pushed corner first reaches 0.41 edges farther, and brought the target into the
  zone in a third of the training draws.
* The target is in the zone if its middle is over it, on the table and at rest, for 0.3 s, 30 steps as in the paper's
  T12 and T13. Only blocks touch it.
* Anything else may be done with the blocks. A block that is held in the jaw reaches less far than one that is pushed.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..assets.box import Cube
from ..assets.patch import Patch
from ..assets.prop import TABLE_TOP, Rgba, place, remove, table
from ..control.loop import Loop
from ..decisions import Decision, around, choice
from ..geometry import UP, Mat3, Outline, Vec3, about_z, between, corners, gap, heading, least_gap
from ..means import Mean, once, throughout
from ..params import Bounded, param
from ..physics import GRAVITY
from ..predicates import fallen, inside, still
from ..robots import ik
from ..robots.jaw import TIP_BELOW
from ..robots.panda import BASE, REACH, SHOULDER
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require
from ..sim.arm import ROBOT
from ..sim.world import World
from ..skills.jaw import carry, let_go, pick
from ..skills.motion import CLOSED, COARSE, STEADY, Pace, go_to, push, steer

COLOURS: tuple[Rgba, ...] = ((0.20, 0.36, 0.66, 1.0), (0.25, 0.60, 0.35, 1.0), (0.90, 0.72, 0.20, 1.0))
"""Colours of the blocks; the target is red."""
ZONE_SIZE = 0.036  # length of a side of the zone [m]
MIN_DISTANCE = 0.36  # least distance from the robot's first axis at which a hand that points down takes a block [m]
MAX_DISTANCE = 0.72  # largest such distance [m]
MAX_PUSH_DISTANCE = 0.829
"""Distance from the robot's first axis that the tips of an outwards leaning hand reach without trouble, at the height
of a block's middle [m]. Measured; up to 25 mm farther the arm is nearly straight and jumps."""
MAX_COAST_SPEED = 0.08
"""Speed at which the target may slide on without being pushed [m/s]: for half a millimetre. It is checked once in a
control period: a blow that is over before that moves the target 2 mm farther at most."""
CHAIN_DISTANCE = 0.690  # distance from the robot's first axis at which the first block of the chain is put down [m]
APPROACH_DISTANCE = 0.03  # distance behind the chain at which the hand comes down [m]
PUSH_SPEED = 0.12  # speed of the push up to the target [m/s]
CONTACT_SPEED = 0.05  # speed of the push from just before the chain meets the target [m/s]
CONTACT_DISTANCE = 0.02  # distance between chain and target below which the push is slow [m]
END_MARGIN = 0.004  # distance inside the zone at which the push ends [m]


@dataclass(frozen=True, kw_only=True)
class Spot(Bounded):
    """Pose of a block at the start."""

    x: float = param(-0.12, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)

    @cached_property
    def pos(self) -> Vec3:
        """Middle of the block's foot [m]."""
        return np.array([self.x, self.y, TABLE_TOP])


@dataclass(frozen=True, kw_only=True)
class IndirectPush(Scenario):
    """A red block and a zone at the far end of the table, and three blocks at its near end."""

    VERSION = 2
    HOLD = 0.3

    bearing: float = param(20.0, "deg", -45.0, 45.0)
    """Bearing of target and zone from the robot's first axis; 0 is straight ahead."""
    distance: float = param(0.924, "m", 0.5, 1.1)  # distance of the target's middle from that axis
    way: float = param(0.050, "m", 0.01, 0.15)  # distance of the zone's middle from the target's
    target_yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)  # yaw of the target relative to the bearing
    edge: float = param(0.055, "m", 0.03, 0.07)  # edge of the blocks and the target
    mass: float = param(0.10, "kg", 0.02, 1.0, hidden=True)  # mass of a block
    target_mass: float = param(0.10, "kg", 0.02, 1.0, hidden=True)
    friction: float = param(0.65, "1", 0.1, 1.2, hidden=True)
    block_0: Spot = Spot(y=-0.25)
    block_1: Spot = Spot(y=-0.11)
    block_2: Spot = Spot(y=0.03)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        place(scene, Patch(size=ZONE_SIZE), "zone", self.at(self.distance + self.way), self.angle, free=False)
        target = Cube(edge=self.edge, mass=self.target_mass, friction=self.friction)
        place(scene, target, "target", self.at(self.distance), self.turn)
        for i, (spot, rgba) in enumerate(zip(self.spots, COLOURS, strict=True)):
            block = Cube(edge=self.edge, mass=self.mass, friction=self.friction, rgba=rgba)
            place(scene, block, f"block_{i}", spot.pos, math.radians(spot.yaw))
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        low, high = np.array([-ZONE_SIZE / 2, -ZONE_SIZE / 2, -0.005]), np.array([ZONE_SIZE / 2, ZONE_SIZE / 2, 0.005])
        return inside(world, "target", "zone", low, high) and still(world, "target", 0.02)

    def failure(self, world: World) -> str | None:
        return "the target fell off the table" if fallen(world, "target") else None

    def single_block(self, world: World) -> bool:
        """Whether one block alone is between the robot and the target."""
        return bool(world.touching_bodies(ROBOT) & world.touching_bodies("target") - {"table", "zone"})

    def _pushed(self, world: World) -> bool:
        """Whether a chain of touching blocks leads from the robot to the target."""
        chain, ends = {ROBOT}, [ROBOT]
        while ends:
            beside = world.touching_bodies(ends.pop()) - chain - {"table", "zone"}
            if "target" in beside:
                return True
            chain |= beside
            ends += beside
        return False

    def means(self) -> Mapping[str, Mean]:
        def by_chain(world: World) -> bool:
            return self._pushed(world) and not self.single_block(world)

        return {
            "a chain of two or more blocks passed the push on to the target": once(by_chain),
            "the target moved only as far as the chain pushed it": throughout(
                lambda world: still(world, "target", MAX_COAST_SPEED) or self._pushed(world)
            ),
            "no block touched robot and target at once": throughout(lambda world: not self.single_block(world)),
            "the robot did not touch the target": throughout(lambda world: not world.touched(ROBOT, "target")),
        }

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Put the nearest blocks in line, as many as are needed, and push the last of them."""
        yield from self._chain_and_push(world, self.chosen)

    def _chain_and_push(
        self, world: World, blocks: list[str], speed: float = PUSH_SPEED, last: float = CONTACT_SPEED
    ) -> Plan:
        """Put blocks in line, the first one farthest out, and push the last of them at some speeds [m/s]."""
        for i, block in enumerate(blocks):
            yield from self.put_in_line(world, block, self.at(CHAIN_DISTANCE - i * self.pitch))
        yield from self.push_out(world, blocks[-1], speed, last)

    def put_in_line(self, world: World, block: str, spot: Vec3) -> Plan:
        """Take a block, put it down at a place [m] with its faces square to the bearing."""
        arm, held = world.arm, self.edge / 2 * UP
        faces = [sign * axis for axis in world.rot(block)[:, :2].T for sign in (1.0, -1.0)]
        closing = max(faces, key=lambda normal: float(normal @ self.side))
        yield from pick(arm, world.com(block), closing, above=0.09, lift=0.09, pace=Pace(0.20, 0.004))
        turn = about_z(math.atan2(float(np.cross(closing, self.side)[2]), float(closing @ self.side)))
        rot = turn @ world.rot(block)
        yield from carry(arm, block, spot + held + 0.07 * UP, rot, COARSE)
        yield from carry(arm, block, spot + held + 0.008 * UP, rot, Pace(0.20, 0.003))
        yield from push(arm, -0.04 * UP, until=lambda: world.touching(block, "table"))
        yield from let_go(arm, 0.09)

    def push_out(self, world: World, block: str, speed: float = PUSH_SPEED, last: float = CONTACT_SPEED) -> Plan:
        """Push a block outwards with the leaning hand until the target is in the zone or the arm is stretched out.

        Then step back.
        """
        start = self.out(world.com(block)) - self.edge / 2 - APPROACH_DISTANCE
        offset = float((world.com(block) - BASE) @ self.side)
        yield from self._come_down(world, self.at(start) + offset * self.side, self.leaning(start))
        entered = self.distance + self.way - ZONE_SIZE / 2 + END_MARGIN
        yield from self._push(world, lambda: entered - self.out(world.com("target")), speed, last)
        yield from go_to(world.arm, world.arm.hand - 0.04 * self.u, pace=STEADY)

    def _come_down(self, world: World, at: Vec3, rot: Mat3) -> Plan:
        """Bring the closed fingers down to the height at which they push."""
        yield from go_to(world.arm, [*at[:2], self.height + 0.12], rot, COARSE, CLOSED)
        yield from go_to(world.arm, [*at[:2], self.height], rot, STEADY)

    def _push(self, world: World, remaining: Callable[[], float], speed: float, last: float) -> Plan:
        """Push outwards at one height, leaning more and more, until nothing remains [m] or the arm is stretched out.

        From just before the chain meets the target the speed is `last`. An arm at full stretch pushes for 1 s.
        """
        arm, setpoint = world.arm, world.arm.hand
        end = world.time + (MAX_PUSH_DISTANCE - self.out(setpoint)) / speed + CONTACT_DISTANCE / last + 1.0
        while remaining() > 0.0 and world.time < end:
            ahead = self.out(setpoint)
            rise = 4.0 * (self.height - arm.hand[2])  # the error in height adds up at 4 per second
            pace = last if self._near_target(world) else speed
            velocity = (pace if ahead < MAX_PUSH_DISTANCE + 0.01 else 0.0) * self.u + rise * UP
            setpoint = setpoint + velocity * Loop.PERIOD
            yield steer(arm, setpoint, velocity, between(arm.hand_rot, self.leaning(ahead)), CLOSED)

    def _near_target(self, world: World) -> bool:
        """Whether a block touches the target or is about to."""
        head = max(self.out(world.com(f"block_{i}")) for i in range(len(self.spots)))
        return self.out(world.com("target")) - head - self.edge < CONTACT_DISTANCE

    def leaning(self, distance: float) -> Mat3:
        """Orientation of the hand that pushes at a distance [m], with its fingers side by side across the push.

        It points down up to 0.45 m, because joint 6 allows no more lean farther in. Then it leans outwards, as the arm
        requires farther out: by 35 deg from 0.76 m on.
        """
        lean = math.radians(35.0) * float(np.clip((distance - 0.45) / (0.76 - 0.45), 0.0, 1.0))
        along = math.sin(lean) * self.u - math.cos(lean) * UP
        return np.stack([self.side, np.cross(along, self.side), along], axis=1)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        one = self.chosen[:1]
        return {
            "reach_for_the_target": Shortcut(self._reach),
            "push_one_block": Shortcut(lambda world: self._chain_and_push(world, one)),
            "strike_with_one_block": Shortcut(lambda world: self._chain_and_push(world, one, 0.28, 0.28)),
            "push_where_it_lies": Shortcut(lambda world: self.push_out(world, one[0])),
        }

    def _reach(self, world: World) -> Plan:
        """Reach out for the target itself."""
        yield from self._come_down(world, self.at(CHAIN_DISTANCE), self.leaning(CHAIN_DISTANCE))
        yield from self._push(world, lambda: self.distance - self.out(world.arm.hand), PUSH_SPEED, PUSH_SPEED)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Remove the block at the head of the chain: the others fall short by its length."""
        scene = self.build()
        remove(scene, self.chosen[0])
        return {"one_block_less": scene}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        rest = sorted({"block_0", "block_1", "block_2"} - set(self.chosen))
        return {
            "blocks": choice(self.needed, "distance", "way"),
            "head_of_the_chain": choice(self.chosen[0], "block_0", "block_1", "block_2", "bearing"),
            "left_over": choice(rest[0] if rest else "none", "block_0", "block_1", "block_2", "bearing"),
            "end_of_the_push": around(self.distance + self.way, 0.018, "distance", "way"),
            "bearing": around(self.bearing, math.degrees(0.025 / 0.92), "bearing"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        outlines = [corners(spot.pos, math.radians(spot.yaw), [self.edge] * 3) for spot in self.spots]
        yield on_table("a block", outlines)
        yield on_table("the target or the zone", [self.outline, self.zone_outline])
        yield require(self.out_of_touch > 0, "the hand may touch the target without a block", gap=self.out_of_touch)
        entered = self.distance + self.way - ZONE_SIZE / 2
        reaches = self.stretch + 1.5 * self.edge + MAX_COAST_SPEED**2 / (2 * GRAVITY * self.friction)
        yield require(reaches < entered, "one block would do", reaches=reaches, zone=entered)
        yield require(self.needed <= len(self.spots), "no chain is long enough", needed=self.needed)
        away = [math.dist(spot.pos[:2], BASE[:2]) for spot in self.spots]
        near, far = min(away), max(away)
        yield require(MIN_DISTANCE <= near and far <= MAX_DISTANCE, "a block is out of reach", away=far)
        apart = least_gap([each] for each in outlines)
        yield require(apart > 0.03, "there is no room for the fingers between two blocks", apart=apart)
        beside = min(gap(one, self.lane) for one in outlines)
        yield require(beside > 0.0, "a block lies where the chain is to stand", beside=beside)

    def features(self) -> Mapping[str, float]:
        """Number of missing edges, number of blocks that these require, and direction of the push [rad]."""
        missing = (self.distance + self.way - ZONE_SIZE / 2 - MAX_PUSH_DISTANCE) / self.edge - 0.5
        return {"edges_missing": missing, "needed": float(self.needed), "direction": self.angle}

    def facts(self) -> Mapping[str, float | str]:
        return {
            "blocks": self.needed,
            "side": "on its left" if self.bearing > 0.0 else "on its right",
            "way": self.way,
            "edge": self.edge,
            "distance": self.distance,
            "nearest": min(math.dist(spot.pos[:2], BASE[:2]) for spot in self.spots),
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def needed(self) -> int:
        """Number of blocks with which a hand at `MAX_PUSH_DISTANCE` brings the target into the zone."""
        return max(
            1, math.ceil((self.distance + self.way - ZONE_SIZE / 2 + END_MARGIN - MAX_PUSH_DISTANCE) / self.edge - 0.5)
        )

    @cached_property
    def stretch(self) -> float:
        """Bound of the tips' distance in any posture, up to the height of a block's upper edge [m]: `panda.REACH`."""
        drop = SHOULDER[2] - TABLE_TOP - self.edge
        return math.sqrt(REACH**2 - drop**2) + TIP_BELOW

    @cached_property
    def chosen(self) -> list[str]:
        """Names of the blocks for the chain, its head first: those nearest to its place."""
        order = sorted(range(len(self.spots)), key=lambda i: math.dist(self.spots[i].pos, self.at(CHAIN_DISTANCE)))
        return [f"block_{i}" for i in order[: self.needed]]

    @cached_property
    def spots(self) -> tuple[Spot, ...]:
        """Poses of the blocks at the start."""
        return self.block_0, self.block_1, self.block_2

    @cached_property
    def angle(self) -> float:
        """Bearing of target and zone [rad]."""
        return math.radians(self.bearing)

    @cached_property
    def turn(self) -> float:
        """Yaw of the target [rad]."""
        return self.angle + math.radians(self.target_yaw)

    @cached_property
    def u(self) -> Vec3:
        """Level unit vector outwards along the bearing, shape (3,)."""
        return heading(self.bearing)

    @cached_property
    def side(self) -> Vec3:
        """Level unit vector to the left of `u`, shape (3,)."""
        return heading(self.bearing + 90.0)

    @cached_property
    def pitch(self) -> float:
        """Distance from one block of the chain to the next [m], with 4 mm between them."""
        return self.edge + 0.004

    @cached_property
    def height(self) -> float:
        """Height of the grip site in a push [m]: below the middle of a block, the tips 8 mm above the table."""
        return TABLE_TOP + max(0.4 * self.edge, TIP_BELOW + 0.008)

    def at(self, distance: float) -> Vec3:
        """Place on the table along the bearing, by its distance from the robot's first axis [m]."""
        return np.array([BASE[0], BASE[1], TABLE_TOP]) + distance * self.u

    def out(self, point: Vec3) -> float:
        """Distance of a point from the robot's first axis along the bearing [m]."""
        return float((point - BASE) @ self.u)

    @cached_property
    def outline(self) -> Outline:
        """Outline of the target."""
        return corners(self.at(self.distance), self.turn, [self.edge] * 3)

    @cached_property
    def zone_outline(self) -> Outline:
        """Outline of the zone."""
        return corners(self.at(self.distance + self.way), self.angle, [ZONE_SIZE] * 3)

    @cached_property
    def lane(self) -> Outline:
        """Area in which the chain is built and the hand comes down: open fingers need 40 mm on either side."""
        near, far = self.behind, CHAIN_DISTANCE + self.edge / 2
        return corners(self.at((near + far) / 2), self.angle, [far - near, self.edge + 2 * 0.040])

    @cached_property
    def behind(self) -> float:
        """Distance from the robot's first axis at which the hand comes down behind the chain [m]."""
        return CHAIN_DISTANCE - (self.needed - 1) * self.pitch - self.edge / 2 - APPROACH_DISTANCE

    @cached_property
    def out_of_touch(self) -> float:
        """Least distance of the gripper from the target in any posture [m]; not positive if it may touch."""
        middle = self.at(self.distance) + self.edge / 2 * UP
        return ik.box_shortfall(middle, about_z(self.turn), self.edge / 2, ik.GRIPPER_REACH)
