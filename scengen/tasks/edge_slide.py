"""T01 edge-slide: lift a plate that is too flat and too wide to be grasped where it lies.

      hand                          edge
       ||          ________________  .
       ||  >>     |________________| .        seen along the table's edge
    ---------------------------------.
                           __________.____
                          |__________.____|   a lip: now a jaw beside the table can close on it,
    ---------------------------------.        one finger above and one below; farther out the plate falls

Bottleneck: a push must first create the grasp, and must end in time. If it is too short, no finger fits under the
plate. If it is too far or too fast, the plate falls on the floor, which the paper names as a failure of policies (App.
J).

Decisions, where the paper (App. B, T01) says no more than "a thin rectangular plate":

* Both sides are longer than the jaw opens, so the plate cannot be grasped across either; 5 mm of its 2, 3 and 5 mm.
* The edge is the nearest of the two side edges: no level hand reaches beside the far or the near edge.
* "Above the table": its lowest corner by 5 cm, held by the robot and by nothing else for 0.3 s, 30 steps as in the
  paper's T12 and T13.
* How the overhang is made is free: a plate that is pressed on top and dragged must be stopped in time, too. In training
  this needs no look at the width: a hand that always stops 90 to 120 mm before the edge solved 6 of 6 draws. Of widths
  from 118 to 235 mm one place would fit at least half. The axes need the look: 90 mm solved 5 of 6 of `narrow` and
  none of `heavy_strip`, 120 mm all of `heavy_strip` and none of `narrow`, 100 mm none of either.
* A plate below the table top is lost. The robot does not search the floor.
* The statics of a lever say where to stop: the plate tips when its centre of mass is over the edge. One side may be of
  a heavier material, which is visible; then it tips before half of the width is out.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..assets.board import Board
from ..assets.prop import BOX, TABLE_HALF, TABLE_TOP, place, table
from ..control.loop import Loop
from ..decisions import Decision, choice, side_of, span
from ..errors import GaveUp
from ..geometry import AHEAD, UP, Mat3, Outline, Vec3, between, corners
from ..means import Mean, once, when
from ..params import param
from ..physics import GRAVITY
from ..predicates import borne, fallen, held
from ..robots.jaw import OPENING, PAD, TIP_BELOW, pinch, time_to_grip
from ..scenario import Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import World
from ..skills.jaw import grasp, pick
from ..skills.motion import CLOSED, COARSE, FINE, OPEN, STEADY, Pace, facing_down, go_to, retreat, steer

MIN_LIFT = 0.05
"""Height of the plate's lowest corner above the table top at which the plate counts as lifted [m]: five times the
thickest plate in the task file."""
MIN_LIP = 0.010
"""Overhang of a plate's farthest corner from which it has a lip [m]; half of the pads is 11 mm wide."""
LYING_TOLERANCE = math.radians(15.0)
"""Largest tilt of a plate that lies on the table [rad]: fingers that close on its lip turn it by a few degrees."""
MIN_OVERHANG = 0.036
"""Least overhang that can be pinched [m]: palm and fingers of that hand reach 12 and 14 mm past the grip site towards
the table, which leaves 4 mm of clearance beside the edge, and half of the pads is 11 mm wide."""
TIPPING_MARGIN = 0.008  # overhang that remains until the plate tips [m]: it coasts, and the jaw moves it as it closes
GRIP_INSET = 0.014  # distance of the pinch from the plate's side towards the robot [m]
GRIP_DEPTH = 0.018
"""Distance of the pinch from the plate's outer side [m]. The palm is 31 mm behind the grip site and must pass outside
of the corner."""
PUSH_SPEED = 0.06  # speed of the push [m/s]
END_SPEED = 0.03  # speed of the last stretch of the push [m/s]
PUSHING_HAND = facing_down()  # with the other yaw joint 7 reaches its limit
LIFT_HEIGHT = 0.16  # height by which the plate is lifted [m]
LIFT_PACE = Pace(0.20, 0.01)
PUSH_TIMEOUT = 10.0  # time after which a push is given up [s]


@dataclass(frozen=True, kw_only=True)
class EdgeSlide(Scenario):
    """A plate that lies near one of the table's side edges."""

    VERSION = 2
    HOLD = 0.3

    side: int = param(1, "1 left, -1 right", -1, 1)
    """Side of the nearest edge. 0 is refuted."""
    x: float = param(-0.10, "m", -0.4, 0.4)  # position of the plate's middle along the edge
    away: float = param(0.18, "m", 0.03, 0.4)  # distance of the plate's middle from the edge
    yaw: float = param(0.0, "deg", -60.0, 60.0)  # angle of the plate to the edge; 0 is square to it
    plate: Board = Board()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        place(scene, self.plate, "plate", self.spot, self.turn)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return held(world, "plate") and self.lowest(world) >= TABLE_TOP + MIN_LIFT

    def failure(self, world: World) -> str | None:
        return "the plate fell off the table" if fallen(world, "plate") else None

    def means(self) -> Mapping[str, Mean]:
        def lies_out(world: World) -> bool:
            reach = np.abs(self.underside(world)[:, :2]).max()
            flat = world.touching("plate", "table") and abs(world.rot("plate")[2, 2]) > math.cos(LYING_TOLERANCE)
            return flat and reach > TABLE_HALF + MIN_LIP

        slid = "the plate lay on the table with a lip over its edge"
        return {
            slid: once(lies_out),
            "the jaw gripped the lip of the plate that lay there": when(
                lambda world: world.arm.grips("plate") and world.arm.gap > self.plate.thickness / 2,
                lies_out,
                after=slid,
            ),
            "both pads lifted the plate": when(
                lambda world: self.lowest(world) >= TABLE_TOP + MIN_LIFT, lambda world: borne(world, world.arm, "plate")
            ),
        }

    def underside(self, world: World) -> Vec3:
        """Present positions of the corners of the plate's underside [m], shape (4, 3)."""
        return world.pos("plate") + self._underside @ world.rot("plate").T

    def lowest(self, world: World) -> float:
        """Present height of the plate's lowest corner, whichever side is up [m]."""
        upper = self.plate.thickness * world.rot("plate")[2, 2]
        return float(self.underside(world)[:, 2].min() + min(0.0, upper))

    def overhang(self, world: World) -> float:
        """Present overhang of the plate's outer side over the edge, if the plate is square to it [m]."""
        return self.plate.tipping_overhang - TABLE_HALF + float(world.com("plate") @ self.out)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Slide the plate out, pinch the lip, lift."""
        yield from self.slide_out(world, self.aim)
        yield from self.pinch(world)

    def slide_out(self, world: World, overhang: float, speed: float = PUSH_SPEED, last: float = END_SPEED) -> Plan:
        """Push the plate from behind with closed fingers to an overhang, step back, move up.

        Args:
            overhang: overhang at which the push ends [m].
            speed: speed of the push [m/s].
            last: speed of its last stretch [m/s].
        """
        yield from self._reach_inner_side(world)
        yield from self._push_out(world, overhang, speed, last)
        yield from self._leave(world)

    def _reach_inner_side(self, world: World) -> Plan:
        """Bring the closed fingers behind the plate."""
        arm, rot = world.arm, PUSHING_HAND
        behind = min(float(corner @ self.out) for corner in self.underside(world))
        start = self.contact(world) * self.along + (behind - 0.03) * self.out + (TABLE_TOP + TIP_BELOW + 0.002) * UP
        yield from go_to(arm, start + 0.08 * UP, rot, COARSE, CLOSED)
        yield from go_to(arm, start, rot, FINE)

    def _leave(self, world: World) -> Plan:
        """Step back from the plate and move up."""
        yield from go_to(world.arm, world.arm.hand - 0.03 * self.out, PUSHING_HAND, STEADY)
        yield from retreat(world.arm, 0.20)

    def _push_out(self, world: World, overhang: float, speed: float = PUSH_SPEED, last: float = END_SPEED) -> Plan:
        """Push to an overhang [m], with the fingers beside the plate's middle so that it becomes square.

        The speed is `last` over the last 2 cm. The finger tips are kept above the table by 0.4 of the plate's
        thickness: tips that press on the table stick and slip, and higher ones climb the plate. The error in height
        adds up at 8 per second.

        Raises:
            GaveUp: the push took longer than `PUSH_TIMEOUT`.
        """
        arm, setpoint, end = world.arm, world.arm.hand, world.time + PUSH_TIMEOUT
        while (remaining := overhang - self.overhang(world)) > 0.0:
            if world.time > end:
                raise GaveUp(f"the plate was not over the edge after {PUSH_TIMEOUT:g} s")
            sideways = 4.0 * (self.contact(world) - float(setpoint @ self.along))
            rise = 8.0 * (TABLE_TOP + TIP_BELOW + 0.4 * self.plate.thickness - arm.hand[2])
            velocity = (speed if remaining > 0.02 else last) * self.out + sideways * self.along + rise * UP
            setpoint = setpoint + velocity * Loop.PERIOD
            yield steer(arm, setpoint, velocity, between(arm.hand_rot, PUSHING_HAND), CLOSED)

    def contact(self, world: World) -> float:
        """Position along the edge at which the fingers are to push now [m].

        It is beside the plate's middle by three times the angle by which the plate is askew [rad], as a share of the
        way to 12 mm from the corner.
        """
        across, half = world.rot("plate")[:, 1], self.plate.length / 2
        askew = math.atan2(float(np.cross(self.out, across)[2]), float(across @ self.out))
        beside = float(world.com("plate") @ self.along) + np.clip(-3.0 * askew, -1.0, 1.0) * (half - 0.012)
        inner = sorted(self.underside(world), key=lambda corner: float(corner @ across))[:2]
        ends = sorted(float(corner @ self.along) for corner in inner)
        return float(np.clip(beside, ends[0], ends[1]))

    def pinch(self, world: World, lift: float = LIFT_HEIGHT) -> Plan:
        """Come down beside the table, grasp the outer corner on the robot's side, lift it [m]."""
        yield from self._reach_lip(world)
        yield from grasp(world.arm, time_to_grip(self.plate.thickness))
        yield from retreat(world.arm, lift, LIFT_PACE)

    def _reach_lip(self, world: World) -> Plan:
        """Come down beside the table, the open jaw around the outer corner on the robot's side."""
        arm, rot = world.arm, self.grip
        outermost = max(float(corner @ self.out) for corner in self.underside(world))
        nearest = min(corner[0] for corner in self.underside(world) if corner @ self.out > outermost - 0.02)
        height = TABLE_TOP + self.plate.thickness / 2
        at = np.array([nearest + GRIP_INSET, 0.0, height]) + (outermost - GRIP_DEPTH) * self.out
        back = at - 0.07 * rot[:, 2]
        yield from go_to(arm, back + 0.05 * self.out + 0.18 * UP, rot, COARSE, OPEN)
        yield from go_to(arm, back, rot, STEADY)
        yield from go_to(arm, at, rot, Pace(0.15, 0.003, 2.5))

    def steps(self) -> Mapping[str, Planner]:
        return {
            "reach_inner_side": self._reach_inner_side,
            "slide_out": lambda world: self._push_out(world, self.aim),
            "leave_plate": self._leave,
            "reach_lip": self._leave_for_lip,
            "pinch": lambda world: grasp(world.arm, time_to_grip(self.plate.thickness)),
            "lift": lambda world: retreat(world.arm, LIFT_HEIGHT, LIFT_PACE),
            "close_from_above": self._close_from_above,
            "squeeze_corner": self._squeeze_corner,
            "push_off": lambda world: self._push_out(world, self.plate.length + self.plate.width),
        }

    def _leave_for_lip(self, world: World) -> Plan:
        """Bring the jaw to the lip; fingers that are still low behind the plate leave it first."""
        if world.arm.hand[2] < TABLE_TOP + TIP_BELOW + 0.05:
            yield from self._leave(world)
        yield from self._reach_lip(world)

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

    def _slide_and_pinch(
        self, world: World, overhang: float, speed: float = PUSH_SPEED, last: float = END_SPEED
    ) -> Plan:
        """Slide the plate out to another overhang or at other speeds, then pinch and lift."""
        yield from self.slide_out(world, overhang, speed, last)
        yield from self.pinch(world)

    def _close_from_above(self, world: World) -> Plan:
        """Come down on the middle of the plate as on a block, close across the shorter side, lift."""
        axis = 0 if self.plate.length < self.plate.width else 1
        at = world.com("plate") + (self.plate.thickness / 2 + TIP_BELOW) * UP
        yield from pick(world.arm, at, world.rot("plate")[:, axis], lift=0.16)

    def _squeeze_corner(self, world: World) -> Plan:
        """Come down with the fingers on both sides of a corner, close, lift. The fingers slide off its two sides.

        The place is 25 mm inside the corner, where the corner is 50 mm wide.
        """
        into, across = (world.rot("plate") @ np.array([1.0, sign, 0.0]) / math.sqrt(2) for sign in (1.0, -1.0))
        corner = world.com("plate") - world.rot("plate") @ [self.plate.length / 2, self.plate.width / 2, 0.0]
        at = np.array([*corner[:2], TABLE_TOP + TIP_BELOW + 0.001]) + 0.025 * into
        yield from pick(world.arm, at, across, lift=0.16)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Extend the table beyond the edge: the plate does not overhang, and no finger fits under it."""
        scene = self.build()
        wider = scene.body("table").add_geom(name="table_leaf", type=BOX, size=[TABLE_HALF, 0.10, 0.025])
        wider.pos = (TABLE_HALF + 0.10) * self.out
        return {"wider_table": scene}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        half, tips = self.plate.width / 2, self.plate.tipping_overhang
        return {
            "side": choice(self.side, "side"),
            "hand_stops_before_the_edge": span(self.plate.width - tips, self.plate.width - 0.036, "plate"),
            "way_of_the_push": span(self.away + 0.036 - half, self.away + tips - half, "away", "plate"),
            "plate_turns": choice(side_of(self.yaw), "yaw"),
        }

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
        room = plate.tipping_overhang - TIPPING_MARGIN - MIN_OVERHANG
        yield require(room > 0.0, "the plate falls before there is a lip to pinch", room=room)
        friction = plate.friction * pinch(plate.thickness)
        yield require(friction > 2 * weight, "the plate slips out of the pinch", friction=friction, weight=weight)
        lever = math.hypot(plate.length / 2 - GRIP_INSET, plate.tipping_overhang - GRIP_DEPTH)
        resists = PAD * pinch(plate.thickness)
        yield require(resists > lever * weight, "the plate turns in the pinch", resists=resists, turns=lever * weight)
        lip = np.array([self.x, self.side * TABLE_HALF, TABLE_TOP])
        yield within_reach("the plate or its lip", self.spot, lip)

    def features(self) -> Mapping[str, float]:
        """Overhang at which the plate tips [m], share of it in which the push may end, way of the push [m], yaw
        [rad]."""
        tipping = self.plate.tipping_overhang
        return {
            "tipping_overhang": tipping,
            "window_over_overhang": (tipping - MIN_OVERHANG) / tipping,
            "way": self.aim + self.away - tipping,
            "askew": math.radians(self.yaw),
        }

    def facts(self) -> Mapping[str, float | str]:
        strip = "a strip along one side is of another material"
        return {
            "edge": "the left one" if self.side > 0 else "the right one",
            "material": strip if self.plate.off_centre > 0.0 else "one material",
            "way": self.away - self.plate.off_centre,
            "overhang": self.plate.tipping_overhang,
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def aim(self) -> float:
        """Overhang at which the oracle ends its push [m]: two thirds of the way from the least to the largest."""
        longest = self.plate.tipping_overhang - TIPPING_MARGIN
        return MIN_OVERHANG + 2 / 3 * (longest - MIN_OVERHANG)

    @cached_property
    def out(self) -> Vec3:
        """Level unit vector out over the edge, shape (3,)."""
        return np.array([0.0, float(self.side), 0.0])

    @cached_property
    def along(self) -> Vec3:
        """Level unit vector along the edge, to the right of `out`, shape (3,)."""
        return np.array([float(self.side), 0.0, 0.0])

    @cached_property
    def turn(self) -> float:
        """Yaw of the plate [rad]; its strip is towards the edge."""
        return math.radians(self.side * self.yaw) + (0.0 if self.side > 0 else math.pi)

    @cached_property
    def spot(self) -> Vec3:
        """Initial position of the plate's middle [m]."""
        return np.array([self.x, self.side * (TABLE_HALF - self.away), TABLE_TOP])

    @cached_property
    def outline(self) -> Outline:
        """Outline of the plate at the start."""
        return corners(self.spot, self.turn, self.plate.size)

    @cached_property
    def _underside(self) -> Vec3:
        """Corners of the plate's underside in its own axes [m], shape (4, 3)."""
        return np.column_stack([corners([0.0, 0.0], 0.0, self.plate.size), np.zeros(4)])

    @cached_property
    def grip(self) -> Mat3:
        """Orientation of the hand that pinches: from the robot's side towards the table, closing up and down.

        It points 30 deg from straight ahead towards the table, and 15 deg below the horizontal. So the arm stays 0.2
        rad and more away from its limits along 0.2 m of either edge. Straight towards the table the hand cannot get
        there.
        """
        azimuth, tilt = math.radians(30.0), math.radians(15.0)
        level = math.cos(azimuth) * AHEAD - math.sin(azimuth) * self.out
        ahead = math.cos(tilt) * level - math.sin(tilt) * UP
        closing = -self.side * (math.cos(tilt) * UP + math.sin(tilt) * level)  # else joint 5 is at its limit
        return np.stack([closing, np.cross(ahead, closing), ahead], axis=1)
