"""T20 indirect-push: push a red block into a zone, where the arm reaches neither.

                                                           zone
      base                     block  block     target    .---.      seen from above, along the target's bearing
       (o)  - - - -  hand >>    [ ]    [ ]  - - - [#] - - |   | -    from the robot's first axis
                                                          '---'
                 [ ]       [ ]      [ ]   blocks lie scattered

Bottleneck: the push has to be made longer. No part of the hand comes to the target, but a block does that is pushed by
a block that is pushed by the hand; they have to be fetched and put in line first, as many as the distance asks for.

Decisions, where the paper (App. B, T20) is silent or cannot be meant as it is written:

* The paper's chain connects "the target to the goal zone": there it would stand in the target's way. Here it stands
  between hand and target, in line with the zone.
* Out of reach. The arm swings about a shoulder 0.445 m above the table, and a band before the far edge is beyond it.
  It is deep enough for a target, a way to go and a zone only towards the corners: hence the bearing near 20 deg.
  Scenarios are refuted unless *no part of the gripper* can touch the target in any posture (`ik.GRIPPER_REACH`).
* One block must not do: the zone begins beyond what the arm at full stretch reaches with one, by the triangle
  inequality and no search. Two do in training; three do, without stretching the arm to its limit, where the zone is
  farther or the blocks are smaller.
* A push, not a blow: the target may move only while a chain of blocks that touch leads from the hand to it; one that
  slides on by itself faster than 80 mm/s is lost. An arm that is driven through its full stretch jumps, and the block
  before it flies at 0.6 m/s: so one block, shot at the target, brought it anywhere. And one block that was knocked on
  again and again, each time some millimetres farther than a hand comes, brought it into the zone in a dozen knocks.
* In the zone is a target whose middle is over it, on the table and at rest, for 0.3 s, 30 steps as in the paper's T12
  and T13. Touching the target loses the episode: nothing but a block may come to it.
* What else is done with the blocks is free. A block that is held in the jaw reaches less far than one that is pushed.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from ..assets.box import Cube
from ..assets.patch import Patch
from ..assets.prop import TABLE_TOP, Rgba, place, table
from ..control.loop import Loop
from ..geometry import UP, Mat3, Outline, Vec3, about_z, between, corners, gap, heading
from ..params import check_bounds, param
from ..physics import GRAVITY
from ..predicates import fallen, inside, still
from ..robots import ik
from ..robots.jaw import TIP_BELOW
from ..robots.panda import BASE, REACH, SHOULDER
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require
from ..sim.world import ROBOT, World
from ..skills.jaw import carry, pick, release
from ..skills.motion import CLOSED, COARSE, STEADY, Pace, go_to, push, retreat, steer

COLOURS: tuple[Rgba, ...] = ((0.20, 0.36, 0.66, 1.0), (0.25, 0.60, 0.35, 1.0), (0.90, 0.72, 0.20, 1.0))
"""Of the blocks; the target is red."""
ZONE = 0.036
"""Length of a side of the zone [m]."""
FRONT = 0.829
"""How far from the robot's first axis the tips of a hand come that leans outwards, at the height of a block's middle,
without trouble [m]. Measured; up to 25 mm farther the arm is nearly straight and jumps."""
COASTING = 0.08
"""Speed at which the target may slide on when nothing pushes it any more [m/s]: for half a millimetre. It is looked at
once in a control period: a blow that is over before that takes the target 2 mm farther at most."""
HAND = (0.36, 0.72)
"""Nearest and farthest distance from the robot's first axis at which a hand that points down takes a block [m]."""
PLACED, APART = 0.690, 0.004
"""How far out the first block of the chain is put down, and the space between two of them [m]."""
BESIDE = 0.040
"""How far on either side of the chain the table must be free for open fingers [m]."""
LEAN, OVER = math.radians(35.0), (0.45, 0.76)
"""By how much the hand leans outwards at the end of a push [rad], and between which distances it goes over to that from
pointing down [m]: farther in joint 6 allows no more, farther out the arm asks for it."""
PUSHING, SLOWLY, LAST = 0.12, 0.05, 0.02
"""How fast the chain is pushed, how fast from just before it meets the target on [m/s], and how far before [m]."""
BEHIND, PATIENCE = 0.03, 1.0
"""How far behind the chain the hand comes down [m], and how long it stays at full stretch before a push ends [s]."""
LEVELLING = 4.0
"""How fast an error in the height of the pushing hand adds up to a correction [1/s]."""
INSIDE = 0.004
"""How far inside the zone the push ends [m]."""


@dataclass(frozen=True, kw_only=True)
class Spot:
    """Where a block lies."""

    x: float = param(-0.12, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)

    def __post_init__(self) -> None:
        check_bounds(self)

    @property
    def pos(self) -> Vec3:
        """Of the middle of its foot [m]."""
        return np.array([self.x, self.y, TABLE_TOP])


@dataclass(frozen=True, kw_only=True)
class IndirectPush(Scenario):
    """A red block and a zone at the far end of the table, and three blocks at its near end."""

    HOLD = 0.3

    bearing: float = param(20.0, "deg", -45.0, 45.0)
    """Of target and zone, from the robot's first axis; 0 is straight ahead."""
    distance: float = param(0.924, "m", 0.5, 1.1)
    """Of the target's middle from that axis."""
    way: float = param(0.050, "m", 0.01, 0.15)
    """Of the zone's middle from the target's."""
    target_yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)
    """Against the bearing."""
    edge: float = param(0.055, "m", 0.03, 0.07)
    """Of the blocks and the target."""
    mass: float = param(0.10, "kg", 0.02, 1.0, hidden=True)
    """Of a block."""
    target_mass: float = param(0.10, "kg", 0.02, 1.0, hidden=True)
    friction: float = param(0.65, "1", 0.1, 1.2, hidden=True)
    block_0: Spot = Spot(y=-0.25)
    block_1: Spot = Spot(y=-0.11)
    block_2: Spot = Spot(y=0.03)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        place(scene, Patch(size=ZONE), "zone", self.at(self.distance + self.way), self.angle, free=False)
        target = Cube(edge=self.edge, mass=self.target_mass, friction=self.friction)
        place(scene, target, "target", self.at(self.distance), self.turn)
        for i, (spot, rgba) in enumerate(zip(self.spots, COLOURS, strict=True)):
            block = Cube(edge=self.edge, mass=self.mass, friction=self.friction, rgba=rgba)
            place(scene, block, f"block_{i}", spot.pos, math.radians(spot.yaw))
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        low, high = np.array([-ZONE / 2, -ZONE / 2, -0.005]), np.array([ZONE / 2, ZONE / 2, 0.005])
        return inside(world, "target", "zone", low, high) and still(world, "target", 0.02)

    def failure(self, world: World) -> str | None:
        if world.touched(ROBOT, "target"):
            return "the robot touched the target"
        if not still(world, "target", COASTING) and not self._pushed(world):
            return "the target was struck"
        return "the target fell off the table" if fallen(world, "target") else None

    def _pushed(self, world: World) -> bool:
        """Whether a chain of blocks that touch leads from the robot to the target."""
        chain, ends = {ROBOT}, [ROBOT]
        while ends:
            beside = world.touching_bodies(ends.pop()) - chain - {"table", "zone"}
            if "target" in beside:
                return True
            chain |= beside
            ends += beside
        return False

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Put as many blocks in line as are needed, the nearest ones, and push the last of them."""
        yield from self._chain_and_push(world, self.chosen)

    def _chain_and_push(self, world: World, blocks: list[str], speed: float = PUSHING, last: float = SLOWLY) -> Plan:
        """The same with other blocks, or at other speeds [m/s]."""
        for i, block in enumerate(blocks):
            yield from self.put_in_line(world, block, self.at(PLACED - i * self.pitch))
        yield from self.push_out(world, blocks[-1], speed, last)

    def put_in_line(self, world: World, block: str, spot: Vec3) -> Plan:
        """Take a block, put it down on a spot [m] with its faces square to the bearing."""
        arm, held = world.arm, self.edge / 2 * UP
        faces = [sign * axis for axis in world.rot(block)[:, :2].T for sign in (1.0, -1.0)]
        closing = max(faces, key=lambda normal: float(normal @ self.side))
        yield from pick(arm, world.com(block), closing, above=0.09, lift=0.09, pace=Pace(0.20, 0.004))
        turn = about_z(math.atan2(float(np.cross(closing, self.side)[2]), float(closing @ self.side)))
        rot = turn @ world.rot(block)
        yield from carry(arm, block, spot + held + 0.07 * UP, rot, COARSE)
        yield from carry(arm, block, spot + held + 0.008 * UP, rot, Pace(0.20, 0.003))
        yield from push(arm, -0.04 * UP, until=lambda: world.touching(block, "table"))
        yield from release(arm)
        yield from retreat(arm, 0.09)

    def push_out(self, world: World, block: str, speed: float = PUSHING, last: float = SLOWLY) -> Plan:
        """Push a block outwards with the leaning hand until the target is in the zone or the arm is stretched out.

        Then step back.
        """
        start = self.out(world.com(block)) - self.edge / 2 - BEHIND
        aside = float((world.com(block) - BASE) @ self.side)
        yield from self._come_down(world, self.at(start) + aside * self.side, self.leaning(start))
        entered = self.distance + self.way - ZONE / 2 + INSIDE
        yield from self._push(world, lambda: entered - self.out(world.com("target")), speed, last)
        yield from go_to(world.arm, world.arm.hand - 0.04 * self.u, pace=STEADY)

    def _come_down(self, world: World, at: Vec3, rot: Mat3) -> Plan:
        """Bring the closed fingers down to the height at which they push."""
        yield from go_to(world.arm, [*at[:2], self.height + 0.12], rot, COARSE, CLOSED)
        yield from go_to(world.arm, [*at[:2], self.height], rot, STEADY)

    def _push(self, world: World, left: Callable[[], float], speed: float, last: float) -> Plan:
        """Push outwards at one height, leaning more and more, until nothing is `left` [m] or the arm is stretched.

        From just before the chain meets the target on it goes at the `last` speed.
        """
        arm, setpoint = world.arm, world.arm.hand
        end = world.time + (FRONT - self.out(setpoint)) / speed + LAST / last + PATIENCE
        while left() > 0.0 and world.time < end:
            ahead, rise = self.out(setpoint), LEVELLING * (self.height - arm.hand[2])
            pace = last if self._near(world) else speed
            velocity = (pace if ahead < FRONT + 0.01 else 0.0) * self.u + rise * UP
            setpoint = setpoint + velocity * Loop.PERIOD
            yield steer(arm, setpoint, velocity, between(arm.hand_rot, self.leaning(ahead)), CLOSED)

    def _near(self, world: World) -> bool:
        """Whether a block touches the target, or is about to."""
        head = max(self.out(world.com(f"block_{i}")) for i in range(len(self.spots)))
        return self.out(world.com("target")) - head - self.edge < LAST

    def leaning(self, distance: float) -> Mat3:
        """Orientation of the hand that pushes: it leans outwards, its fingers side by side across the push."""
        lean = LEAN * float(np.clip((distance - OVER[0]) / (OVER[1] - OVER[0]), 0.0, 1.0))
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
        """Stretch out for the target itself."""
        yield from self._come_down(world, self.at(PLACED), self.leaning(PLACED))
        yield from self._push(world, lambda: self.distance - self.out(world.arm.hand), PUSHING, PUSHING)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Without the block at the head of the chain the others come too short by its length."""
        scene = self.build()
        scene.delete(scene.body(self.chosen[0]))
        return {"one_block_less": scene}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        outlines = [corners(spot.pos, math.radians(spot.yaw), [self.edge] * 3) for spot in self.spots]
        yield on_table("a block", outlines)
        yield on_table("the target or the zone", [self.outline, self.zone_outline])
        yield require(self.out_of_touch > 0, "the hand may touch the target without a block", gap=self.out_of_touch)
        entered = self.distance + self.way - ZONE / 2
        reaches = self.stretch + 1.5 * self.edge + COASTING**2 / (2 * GRAVITY * self.friction)
        yield require(reaches < entered, "one block would do", reaches=reaches, zone=entered)
        yield require(self.needed <= len(self.spots), "no chain is long enough", needed=self.needed)
        away = [math.dist(spot.pos[:2], BASE[:2]) for spot in self.spots]
        yield require(HAND[0] <= min(away) and max(away) <= HAND[1], "a block is out of reach", away=max(away))
        apart = min(gap(one, other) for one, other in itertools.combinations(outlines, 2))
        yield require(apart > 0.03, "there is no room for the fingers between two blocks", apart=apart)
        beside = min(gap(one, self.lane) for one in outlines)
        yield require(beside > 0.0, "a block lies where the chain is to stand", beside=beside)

    def features(self) -> Mapping[str, float]:
        """How many edges are missing, how many blocks that makes, and where the line of the push runs."""
        missing = (self.distance + self.way - ZONE / 2 - FRONT) / self.edge - 0.5
        return {"edges_missing": missing, "needed": float(self.needed), "direction": self.angle}

    # --- geometry -------------------------------------------------------------------------

    @property
    def needed(self) -> int:
        """How many blocks a chain needs with which a hand that comes to `FRONT` brings the target into the zone."""
        return max(1, math.ceil((self.distance + self.way - ZONE / 2 + INSIDE - FRONT) / self.edge - 0.5))

    @property
    def stretch(self) -> float:
        """How far the tips come in any posture, up to the height of a block's upper edge [m]: `panda.REACH`."""
        drop = SHOULDER[2] - TABLE_TOP - self.edge
        return math.sqrt(REACH**2 - drop**2) + TIP_BELOW

    @property
    def chosen(self) -> list[str]:
        """The blocks that the chain is made of, its head first: those nearest to where it is to stand."""
        order = sorted(range(len(self.spots)), key=lambda i: math.dist(self.spots[i].pos, self.at(PLACED)))
        return [f"block_{i}" for i in order[: self.needed]]

    @property
    def spots(self) -> tuple[Spot, ...]:
        """Where the blocks lie."""
        return self.block_0, self.block_1, self.block_2

    @property
    def angle(self) -> float:
        """The bearing [rad]."""
        return math.radians(self.bearing)

    @property
    def turn(self) -> float:
        """Of the target about the vertical [rad]."""
        return self.angle + math.radians(self.target_yaw)

    @property
    def u(self) -> Vec3:
        """Level unit vector outwards along the bearing, shape (3,)."""
        return heading(self.bearing)

    @property
    def side(self) -> Vec3:
        """Level unit vector to the left of `u`, shape (3,)."""
        return heading(self.bearing + 90.0)

    @property
    def pitch(self) -> float:
        """From one block of the chain to the next [m]."""
        return self.edge + APART

    @property
    def height(self) -> float:
        """Of the grip site when it pushes [m]: below the middle of a block, the tips 8 mm above the table."""
        return TABLE_TOP + max(0.4 * self.edge, TIP_BELOW + 0.008)

    def at(self, distance: float) -> Vec3:
        """A place on the table along the bearing, by its distance from the robot's first axis [m]."""
        return np.array([BASE[0], BASE[1], TABLE_TOP]) + distance * self.u

    def out(self, point: Vec3) -> float:
        """How far out along the bearing a point is [m]."""
        return float((point - BASE) @ self.u)

    @property
    def outline(self) -> Outline:
        """Of the target."""
        return corners(self.at(self.distance), self.turn, [self.edge] * 3)

    @property
    def zone_outline(self) -> Outline:
        """Of the zone."""
        return corners(self.at(self.distance + self.way), self.angle, [ZONE] * 3)

    @property
    def lane(self) -> Outline:
        """Where the chain is put together and the hand comes down behind it."""
        near, far = self.behind, PLACED + self.edge / 2
        return corners(self.at((near + far) / 2), self.angle, [far - near, self.edge + 2 * BESIDE])

    @property
    def behind(self) -> float:
        """How far out the hand comes down behind the chain [m]."""
        return PLACED - (self.needed - 1) * self.pitch - self.edge / 2 - BEHIND

    @property
    def out_of_touch(self) -> float:
        """How far at least any point of the gripper stays away from the target [m]; not positive if it may touch."""
        middle = self.at(self.distance) + self.edge / 2 * UP
        return ik.box_shortfall(middle, about_z(self.turn), self.edge / 2, ik.GRIPPER_REACH)
