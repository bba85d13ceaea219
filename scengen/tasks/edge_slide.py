"""T01 edge-slide: lift a plate that is too flat and too wide to be grasped where it lies.

      hand                          edge
       ||          ________________  .
       ||  >>     |________________| .        seen along the table's edge
    ---------------------------------.
                           __________.____
                          |__________.____|   a lip: now a jaw beside the table can close on it,
    ---------------------------------.        one finger above and one below; farther out the plate falls

Bottleneck: what has to be grasped is made first, by a push that must end in time. Too short, and no finger comes under
the plate; too far, or too fast, and it is on the floor, which the paper names as how policies fail (App. J).

Decisions, where the paper (App. B, T01) says no more than "a thin rectangular plate":

* Both sides are longer than the jaw opens, so that it cannot be taken across either; 5 mm of its 2, 3 and 5 mm.
* The edge is the nearest of the two side edges: beside the far one and the near one no level hand can be.
* "Above the table": its lowest corner by 5 cm, held by the robot and by nothing else for 0.3 s, 30 steps as in the
  paper's T12 and T13. No other rule: whoever brings the plate up in another way has lifted it.
* A plate below the table top is lost. It is not looked for on the floor.
* Where to stop is the statics of a lever: the plate tips when its centre of mass is over the edge. One side may be
  of a heavier stuff, which is to be seen, and then that is earlier than half of the width.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from ..assets.board import Board
from ..assets.prop import BOX, TABLE_HALF, TABLE_TOP, place, table
from ..control.loop import Loop
from ..errors import GaveUp
from ..geometry import UP, Mat3, Outline, Vec3, between, corners
from ..params import param
from ..physics import GRAVITY
from ..predicates import fallen, held
from ..robots.jaw import OPENING, PAD, TIP_BELOW, pinch, time_to_grip
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import World
from ..skills.jaw import grasp, pick
from ..skills.motion import CLOSED, COARSE, FINE, OPEN, STEADY, Pace, facing_down, go_to, retreat, steer

LIFTED = 0.05
"""How far the plate's lowest corner must be above the table top [m]: five times the thickest one in the task file."""
AZIMUTH, TILT = math.radians(30.0), math.radians(15.0)
"""Where the hand that pinches points: from the robot's direction towards the table, and below the level [rad]. With it
the arm is 0.2 rad and more away from its limits along 0.2 m of either edge; straight at the table it does not come."""
LIP = 0.036
"""Least overhang that can be pinched [m]: palm and fingers of that hand reach 12 and 14 mm past the grip site towards
the table, which leaves 4 mm of air beside the edge, and half of the pads is 11 mm wide."""
SPARE = 0.008
"""How much more the plate is to stand out before it tips [m]: it coasts, and the jaw moves it as it closes."""
CORNER = (0.014, 0.018)
"""Where it is pinched: distance from the side towards the robot and from the outer side [m]. The palm is 31 mm behind
the grip site and must pass outside the corner."""
PUSHING, SLOWLY, LAST = 0.06, 0.03, 0.02
"""How fast it is pushed, how fast at the end [m/s], and over what distance that is [m]."""
HOVER, LEVELLING = 0.4, 8.0
"""How high the finger tips are above the table, as a share of the plate's thickness, and how fast an error in it adds
up to a correction [1/s]: tips that press on the table stick and slip, and higher ones climb the plate."""
SQUARING, STEERING, INSIDE = 3.0, 4.0, 0.012
"""The fingers push beside the plate's middle, by this share of the way to its corner for each radian that it is askew;
how fast they go there [1/s], and how far from the corner they stay as long as it is nearly square [m]."""
BACK, REACHING = 0.07, Pace(0.15, 0.003, 2.5)
"""How far from the lip the open jaw comes down beside the table [m], and how it goes on from there."""
ASTRIDE = 0.025
"""How far inside a corner a jaw can come down with its fingers on both sides of it [m]: there it is 50 mm wide."""
PATIENCE = 10.0
"""When a push is given up [s]."""


@dataclass(frozen=True, kw_only=True)
class EdgeSlide(Scenario):
    """A plate that lies near one of the table's side edges."""

    HOLD = 0.3

    side: int = param(1, "1 left, -1 right", -1, 1)
    """Which edge is the nearest one. 0 is refuted."""
    x: float = param(-0.10, "m", -0.4, 0.4)
    """Of the plate's middle."""
    away: float = param(0.18, "m", 0.03, 0.4)
    """Of the plate's middle from that edge."""
    yaw: float = param(0.0, "deg", -60.0, 60.0)
    """0: square to the edge."""
    plate: Board = Board()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        place(scene, self.plate, "plate", self.spot, self.turn)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return held(world, "plate") and self.lowest(world) >= TABLE_TOP + LIFTED

    def failure(self, world: World) -> str | None:
        return "the plate fell off the table" if fallen(world, "plate") else None

    def underside(self, world: World) -> Vec3:
        """Corners of the plate's underside now, shape (4, 3) [m]."""
        return world.pos("plate") + self._flat @ world.rot("plate").T

    def lowest(self, world: World) -> float:
        """Height of the plate's lowest corner now, whichever side is up [m]."""
        upper = self.plate.thickness * world.rot("plate")[2, 2]
        return float(self.underside(world)[:, 2].min() + min(0.0, upper))

    def overhang(self, world: World) -> float:
        """How far the plate's outer side is out over the edge now, if it is square to it [m]."""
        return self.plate.tipping_overhang - TABLE_HALF + float(world.com("plate") @ self.out)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Slide the plate out, pinch the lip, lift."""
        yield from self.slide_out(world, self.aim)
        yield from self.pinch(world)

    def slide_out(self, world: World, overhang: float, speed: float = PUSHING, last: float = SLOWLY) -> Plan:
        """Push the plate from behind with closed fingers until it stands out by so much, step back, go up.

        Args:
            overhang: at which the push ends [m].
            speed: of the push [m/s].
            last: of its last stretch [m/s].
        """
        arm, rot = world.arm, facing_down()  # the other way round joint 7 ends
        behind = min(float(corner @ self.out) for corner in self.underside(world))
        start = self.contact(world) * self.along + (behind - 0.03) * self.out + (TABLE_TOP + TIP_BELOW + 0.002) * UP
        yield from go_to(arm, start + 0.08 * UP, rot, COARSE, CLOSED)
        yield from go_to(arm, start, rot, FINE)
        yield from self._push(world, lambda: overhang - self.overhang(world), rot, speed, last)
        yield from go_to(arm, arm.hand - 0.03 * self.out, rot, STEADY)
        yield from retreat(arm, 0.20)

    def _push(self, world: World, left: Callable[[], float], rot: Mat3, speed: float, last: float) -> Plan:
        """Push until nothing is `left` [m], the fingers beside the plate's middle so that it becomes square.

        Raises:
            GaveUp: that took too long.
        """
        arm, setpoint, end = world.arm, world.arm.hand, world.time + PATIENCE
        while left() > 0.0:
            if world.time > end:
                raise GaveUp(f"the plate was not over the edge after {PATIENCE:g} s")
            sideways = STEERING * (self.contact(world) - float(setpoint @ self.along))
            rise = LEVELLING * (TABLE_TOP + TIP_BELOW + HOVER * self.plate.thickness - arm.hand[2])
            velocity = (speed if left() > LAST else last) * self.out + sideways * self.along + rise * UP
            setpoint = setpoint + velocity * Loop.PERIOD
            yield steer(arm, setpoint, velocity, between(arm.hand_rot, rot), CLOSED)

    def contact(self, world: World) -> float:
        """Where along the edge the fingers are to push now [m]."""
        across, half = world.rot("plate")[:, 1], self.plate.length / 2
        askew = math.atan2(float(np.cross(self.out, across)[2]), float(across @ self.out))
        beside = float(world.com("plate") @ self.along) + np.clip(-SQUARING * askew, -1.0, 1.0) * (half - INSIDE)
        inner = sorted(self.underside(world), key=lambda corner: float(corner @ across))[:2]
        ends = sorted(float(corner @ self.along) for corner in inner)
        return float(np.clip(beside, *ends))

    def pinch(self, world: World, lift: float = 0.16) -> Plan:
        """Come down beside the table, take the outer corner on the robot's side, lift [m]."""
        arm, rot, (near, inwards) = world.arm, self.grip, CORNER
        outermost = max(float(corner @ self.out) for corner in self.underside(world))
        nearest = min(corner[0] for corner in self.underside(world) if corner @ self.out > outermost - 0.02)
        height = TABLE_TOP + self.plate.thickness / 2
        at = np.array([nearest + near, 0.0, height]) + (outermost - inwards) * self.out
        back = at - BACK * rot[:, 2]
        yield from go_to(arm, back + 0.05 * self.out + 0.18 * UP, rot, COARSE, OPEN)
        yield from go_to(arm, back, rot, STEADY)
        yield from go_to(arm, at, rot, REACHING)
        yield from grasp(arm, time_to_grip(self.plate.thickness))
        yield from retreat(arm, lift, Pace(0.20, 0.01))

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        tipping = self.plate.tipping_overhang
        return {
            "close_from_above": Shortcut(self._close_from_above),
            "squeeze_a_corner": Shortcut(self._squeeze_corner),
            "pinch_where_it_lies": Shortcut(self.pinch),
            "stop_at_the_edge": Shortcut(lambda world: self._slide_and_pinch(world, 0.0)),
            "push_too_far": Shortcut(lambda world: self._slide_and_pinch(world, tipping + 0.005)),
            "push_fast": Shortcut(lambda world: self._slide_and_pinch(world, tipping - 0.010, 0.28, 0.28)),
        }

    def _slide_and_pinch(self, world: World, overhang: float, speed: float = PUSHING, last: float = SLOWLY) -> Plan:
        yield from self.slide_out(world, overhang, speed, last)
        yield from self.pinch(world)

    def _close_from_above(self, world: World) -> Plan:
        """As if it were a block: over its middle, down, close across the shorter side, lift."""
        axis = 0 if self.plate.length < self.plate.width else 1
        at = world.com("plate") + (self.plate.thickness / 2 + TIP_BELOW) * UP
        yield from pick(world.arm, at, world.rot("plate")[:, axis], lift=0.16)

    def _squeeze_corner(self, world: World) -> Plan:
        """A corner is narrow enough: down astride it, close, lift. The fingers slide off its two sides."""
        into, across = (world.rot("plate") @ np.array([1.0, sign, 0.0]) / math.sqrt(2) for sign in (1.0, -1.0))
        corner = world.com("plate") - world.rot("plate") @ [self.plate.length / 2, self.plate.width / 2, 0.0]
        at = np.array([*corner[:2], TABLE_TOP + TIP_BELOW + 0.001]) + ASTRIDE * into
        yield from pick(world.arm, at, across, lift=0.16)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """With more table beyond the edge nothing overhangs, and there is no place for a finger under it."""
        scene = self.build()
        wider = scene.body("table").add_geom(name="table_leaf", type=BOX, size=[TABLE_HALF, 0.10, 0.025])
        wider.pos = (TABLE_HALF + 0.10) * self.out
        return {"wider_table": scene}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        plate, weight = self.plate, GRAVITY * self.plate.mass
        yield require(self.side != 0, "the nearest edge is neither left nor right", side=self.side)
        yield on_table("the plate", self.outline)
        shorter = min(plate.length, plate.width)
        yield require(shorter > OPENING, "the jaw can close on the plate from above", shorter=shorter, jaw=OPENING)
        wedge = math.tan(math.pi / 4)
        yield require(
            plate.friction < wedge, "a corner can be squeezed from above", friction=plate.friction, wedge=wedge
        )
        room = plate.tipping_overhang - SPARE - LIP
        yield require(room > 0.0, "the plate falls before there is a lip to pinch", room=room)
        friction = plate.friction * pinch(plate.thickness)
        yield require(friction > 2 * weight, "the plate slips out of the pinch", friction=friction, weight=weight)
        near, inwards = CORNER
        lever = math.hypot(plate.length / 2 - near, plate.tipping_overhang - inwards)
        resists = PAD * pinch(plate.thickness)
        yield require(resists > lever * weight, "the plate turns in the pinch", resists=resists, turns=lever * weight)
        lip = np.array([self.x, self.side * TABLE_HALF, TABLE_TOP])
        yield within_reach("the plate or its lip", self.spot, lip)

    def features(self) -> Mapping[str, float]:
        """Where the plate tips, what share of that is left for the push to end in, and how far it is pushed [m]."""
        tipping = self.plate.tipping_overhang
        return {
            "tipping_overhang": tipping,
            "window_over_overhang": (tipping - LIP) / tipping,
            "way": self.aim + self.away - tipping,
            "askew": math.radians(self.yaw),
        }

    # --- geometry -------------------------------------------------------------------------

    @property
    def aim(self) -> float:
        """Overhang at which the oracle ends its push [m]: two thirds of the way from the least to the most."""
        longest = self.plate.tipping_overhang - SPARE
        return LIP + 2 / 3 * (longest - LIP)

    @property
    def out(self) -> Vec3:
        """Level unit vector out over the edge, shape (3,)."""
        return np.array([0.0, float(self.side), 0.0])

    @property
    def along(self) -> Vec3:
        """Level unit vector along the edge, to the right of `out`."""
        return np.array([float(self.side), 0.0, 0.0])

    @property
    def turn(self) -> float:
        """Of the plate about the vertical [rad]; its strip is towards the edge."""
        return math.radians(self.side * self.yaw) + (0.0 if self.side > 0 else math.pi)

    @property
    def spot(self) -> Vec3:
        """Where the plate's middle lies [m]."""
        return np.array([self.x, self.side * (TABLE_HALF - self.away), TABLE_TOP])

    @property
    def outline(self) -> Outline:
        """Of the plate at the start."""
        return corners(self.spot, self.turn, self.plate.size)

    @property
    def _flat(self) -> Vec3:
        """Corners of the plate's underside in its own axes, shape (4, 3) [m]."""
        return np.column_stack([corners([0.0, 0.0], 0.0, self.plate.size), np.zeros(4)])

    @property
    def grip(self) -> Mat3:
        """Orientation of the hand that pinches: from the robot's side towards the table, closing up and down."""
        level = math.cos(AZIMUTH) * np.array([1.0, 0.0, 0.0]) - math.sin(AZIMUTH) * self.out
        ahead = math.cos(TILT) * level - math.sin(TILT) * UP
        closing = -self.side * (math.cos(TILT) * UP + math.sin(TILT) * level)  # the other way up joint 5 stops it
        return np.stack([closing, np.cross(ahead, closing), ahead], axis=1)
