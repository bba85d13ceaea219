"""T07 bowl-table: take a bowl out of the rack in which it is upside down and stand it up, with a suction cup and a jaw.

          _______                    |                       The rim, the only part that a jaw can hold, is down in the
        .'       '.            ______|______                 rack. The cup takes the bowl by its foot and holds it out.
      |/           \\|         |  |_____|                     The jaw takes the rim and turns it up.
      ||___________||
      |_____________|

Bottleneck: one hand alone cannot do it. The jaw spans the dome only where the dome is too flat to be pinched, and no
finger fits between the dome and the ring. The cup, on the foot, can pull the bowl out, but must let go of the foot on
which the bowl is to stand. So the bowl is handed over in the air, and each hand turns it by about a right angle.

Decisions, where the paper (App. B, T07) says no more than "bowl", "rack" and "goal position":

* The rack is a ring that fits the bowl: 4 mm of clearance around the rim, and so high that no finger fits beside the
  dome. The foot is flush with the dome, because a ring underneath could be pinched. The cup does not seal on the dome;
  on its side the cup could turn the bowl by a right angle more.
* The goal position is a green square: the bowl's foot must stand in it, upright within 8 deg, released.
* "Some failed handovers accidentally invert the bowl and still lead to successful upright placement" (App. J): a bowl
  that is put down on its side rocks upright by itself. Here no goal counts after such an accident: while the bowl leans
  by more than 30 deg, only hands may touch it, except for the rack in which it is upside down. A bowl that falls faster
  than 0.40 m/s, as from 8 mm, breaks.
* The jaw turns the bowl up. A bowl that the cup lays on two open fingers rolls upright between them, and the cup eases
  it down to the table. The cup can even swing the bowl up about a point beside the rim, to 2.6 deg from upright, stand
  it on half-open fingers and take its floor from above (12 of 12). Both are labelled: the jaw never holds the rim.
* The paper ships two sizes of bowls and gives no lengths. Training has soup bowls; larger and smaller ones are axes.

The oracle reads the place of the rim and the bowl's tilt when it needs them: the bowl shifts on the cup by millimetres
and droops in the jaw by about 8 deg. Clearances: cup on the foot 8 mm to each side, rim between the open fingers 35 mm,
pads on the bead 5 mm along it, foot in the square 32 mm.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from ..assets.bowl import Bowl, closed
from ..assets.patch import TURNED_OVER, Patch
from ..assets.prop import TABLE_TOP, place, table
from ..assets.ring_rack import RingRack
from ..decisions import Decision, near
from ..geometry import AHEAD, UP, Mat3, Vec3, about_y, about_z, corners, gap, way_to
from ..means import Mean, once, throughout, when
from ..params import param
from ..physics import GRAVITY
from ..predicates import borne, fallen, over
from ..robots import panda
from ..robots.jaw import OPENING, TIP_BELOW, droop, pinch
from ..robots.suction import CUP_HALF_WIDTH, TORQUE
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT, Arm
from ..sim.world import World
from ..skills import handover, jaw, motion, suction
from ..skills.handover import FORWARDS, LEFT, SIDEWAYS, STAND_OFF, hand_over, parking
from ..skills.motion import COARSE, OPEN, STEADY, Pace, alone, facing_down, go_to, turn_to, until, with_arm
from ..skills.waiting import at_most, elapsed

UPRIGHT_TOLERANCE = math.radians(8.0)  # largest tilt of a bowl that stands [rad]
FALL_ANGLE = math.radians(30.0)
"""Largest tilt of a bowl that may touch bodies other than hands [rad]: it tips over at 35 deg and more."""
TURNED_UP = math.radians(75.0)  # tilt below which the jaw must bear the bowl [rad]: the handover is near 90 deg
RIM_REACH = 0.015  # largest distance of the rim from the grip site of a jaw that holds it [m]
MAX_FALL_SPEED = 0.40  # speed of a fall above which the bowl breaks [m/s]
RIM_CLEARANCE = 0.004  # gap between the rim and the ring [m]
DOME_CLEARANCE = 0.012
"""Gap between the dome and the ring at the ring's upper edge [m]: a finger is 15 mm thick at its tip."""
HANDOVER_POINT: Vec3 = np.array([-0.10, -0.03, TABLE_TOP + 0.32])
"""Position of the middle of the bowl's foot during the handover [m]."""
PARKED_HAND: Vec3 = np.array([-0.15, -0.35, TABLE_TOP + 0.35])
"""Position of the cup's hand while it is out of the way [m]."""
RIM_OVERLAP = 0.007
"""Depth of the rim between the fingers, beyond the grip site [m]: with it the pads cover the 12 mm of the bead."""
CARRY_PACE = Pace(0.20, 0.01)
"""Pace with the bowl in the jaw: on its way down clearly slower than a fall that breaks the bowl."""
LOWER_SPEED = 0.04  # speed at which the bowl is put down [m/s]


@dataclass(frozen=True, kw_only=True)
class BowlTable(Scenario):
    """A bowl upside down in a rack and a green square on the table."""

    VERSION = 2
    HOLD = 0.5

    rack_x: float = param(-0.05, "m", -0.3, 0.2)
    rack_y: float = param(-0.14, "m", -0.35, 0.35)
    goal_x: float = param(0.03, "m", -0.3, 0.3)
    goal_y: float = param(0.15, "m", -0.35, 0.35)
    bowl: Bowl = Bowl()
    plinth: float = param(0.020, "m", 0.005, 0.20)  # height of the rack's floor
    patch: Patch = Patch(size=0.12)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.bowl)

    @cached_property
    def rack(self) -> RingRack:
        """Rack that fits the bowl: at the ring's upper edge the dome is `DOME_CLEARANCE` from it."""
        height = self.bowl.dome_height(self.bowl.radius + RIM_CLEARANCE - DOME_CLEARANCE)
        return RingRack(radius=self.bowl.radius + RIM_CLEARANCE, height=height, plinth=self.plinth)

    def _scene(self, bowl: Bowl) -> mujoco.MjSpec:
        scene = table()
        place(scene, bowl, "bowl", self.start, turn=TURNED_OVER)
        place(scene, self.rack, "rack", self.foot, free=False)
        place(scene, self.patch, "patch", self.goal, free=False)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        stands = world.touching_bodies("bowl") == {"table"} and world.tilt("bowl") < UPRIGHT_TOLERANCE
        return stands and over(world, "bowl", self.goal, self.patch.size / 2 - self.bowl.foot)

    def failure(self, world: World) -> str | None:
        return "the bowl fell off the table" if fallen(world, "bowl") else None

    def means(self) -> Mapping[str, Mean]:
        pulled, shared = (
            "suction alone pulled the bowl out of the rack",
            "the jaw gripped the bowl while suction pulled",
        )

        def fell(world: World) -> bool:
            touched, tilt = world.touching_bodies("bowl") - {ROBOT}, world.tilt("bowl")
            stored = touched == {"rack"} and tilt > math.pi - FALL_ANGLE
            askew = bool(touched) and tilt > FALL_ANGLE and not stored
            return askew or world.velocity("bowl")[5] < -MAX_FALL_SPEED

        def pinched(world: World) -> bool:
            return world.arms[1].grips("bowl") and world.arms[1].gap < self.bowl.bead + RIM_REACH

        return {
            pulled: once(lambda w: w.tilt("bowl") > math.pi - FALL_ANGLE and borne(w, w.arms[0], "bowl")),
            shared: once(
                lambda w: w.arms[0].grips("bowl") and pinched(w) and w.touching_bodies("bowl") == {ROBOT}, after=pulled
            ),
            "the jaw alone turned the bowl up": throughout(
                lambda w: not FALL_ANGLE < w.tilt("bowl") < TURNED_UP or (pinched(w) and borne(w, w.arms[1], "bowl"))
            ),
            "the jaw set the bowl down upright": when(
                lambda w: w.tilt("bowl") < FALL_ANGLE and w.touching("bowl", "table"), pinched
            ),
            "the bowl neither fell nor touched anything askew": throughout(lambda w: not fell(w)),
        }

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Pull the bowl out with the cup, hand it over to the jaw, put it down with the jaw."""
        right, left = world.arms
        yield from alone(right, self.extract(right))
        yield from motion.together(world, self.present(right), self.wait_beside(left))
        yield from hand_over(right, left, lambda: self.rim(world), SIDEWAYS, RIM_OVERLAP)
        yield from motion.together(world, handover.draw_back(right, PARKED_HAND, STEADY), self.turn_up(left))
        yield from alone(left, self.put_down(left))

    def extract(self, arm: Arm) -> Plan:
        """Suck the bowl by its foot and pull it out over the middle of the ring: a rim that rubs there peels it off."""
        yield from suction.take(arm, arm.world.pos("bowl"), facing_down())
        above = [*self.start[:2], arm.world.pos("bowl")[2] + self.rack.height + 0.02]
        yield from suction.carry_to(arm, "bowl", np.array(above), arm.world.rot("bowl"), Pace(0.10, 0.004))

    def present(self, arm: Arm) -> Plan:
        """Hold the bowl out so that the uppermost part of its rim is level where the jaw takes it."""
        yield from go_to(arm, [*arm.hand[:2], HANDOVER_POINT[2]], pace=Pace(0.15, 0.02))
        yield from go_to(arm, HANDOVER_POINT, pace=Pace(0.20, 0.02))
        yield from turn_to(arm, motion.facing(math.pi / 2, self.bowl.bead_slope), 0.8)
        yield from handover.hold_out(arm, "bowl", HANDOVER_POINT, self.opening, CARRY_PACE)

    def wait_beside(self, arm: Arm) -> Plan:
        """Bring the open jaw beside the place where the rim is going to be."""
        rim = HANDOVER_POINT + self.bowl.depth * self.opening + (self.bowl.radius - self.bowl.bead / 2) * UP
        yield from go_to(arm, rim + 2 * STAND_OFF * LEFT, SIDEWAYS, STEADY, OPEN)

    def rim(self, world: World) -> Vec3:
        """Uppermost point of the rim of a bowl that is held out, at half the rim's thickness [m]."""
        return self.bowl.rim_top(world.pos("bowl"), world.rot("bowl"))

    def turn_up(self, arm: Arm) -> Plan:
        """Turn the opening up, and the hand to the robot's side of the bowl, where its palm meets no rack."""
        # 60 of the 90 deg from the bowl's right to the robot's side: at 90 with a drooping bowl joint 5 meets its limit
        yield from turn_to(arm, about_z(-math.radians(60.0)) @ handover.upright_hand(arm, "bowl"), 1.0)

    def put_down(self, arm: Arm) -> Plan:
        """Bring the bowl over the square, lower it until its foot is on the table, and release it."""
        heights = (0.18, 0.02)  # levelled twice: the bowl droops all the time, and by 7 deg at every jerk
        yield from handover.stand_up(arm, "bowl", self.goal, heights, CARRY_PACE, LOWER_SPEED)

    # --- what must not work ---------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "cup_sets_it_down": Shortcut(self._set_down),
            "cup_tips_it_over": Shortcut(self._tip_over),
            "cup_flings_it": Shortcut(self._fling),
            "cup_rights_it_in_the_rack": Shortcut(self._right_in_rack),
            "cup_on_the_dome": Shortcut(self._turn_by_dome),
            "jaw_on_the_dome": Shortcut(parking(0, PARKED_HAND, self._pinch_dome), to_rest=True),
            "jaw_pries_it_out": Shortcut(parking(0, PARKED_HAND, self._pry_out)),
            "jaw_leaves_it_turned": Shortcut(self._put_down_on_side),
        }

    @with_arm(0)
    def _set_down(self, arm: Arm) -> Plan:
        """Put the bowl on the square with the cup, upside down."""
        yield from self.extract(arm)
        yield from suction.put(arm, "bowl", self.goal, CARRY_PACE)

    @with_arm(0)
    def _tip_over(self, arm: Arm) -> Plan:
        """Turn the bowl as far as the cup's hand goes, and put it on the square on its side: it would rock upright."""
        yield from self._turn_with_cup(arm, self.goal + 0.20 * UP, FORWARDS)
        yield from suction.put(arm, "bowl", self.goal + 0.05 * AHEAD, CARRY_PACE)  # as far as the foot rocks back up

    @with_arm(0)
    def _fling(self, arm: Arm) -> Plan:
        """Turn the bowl fast and let go in the middle of the turn, so that it turns on as it falls."""
        yield from self.extract(arm)
        yield from go_to(arm, self.goal - 0.06 * AHEAD + 0.20 * UP, pace=Pace(0.2, 0.02))
        turn = turn_to(arm, about_y(-math.radians(20.0)) @ FORWARDS, 3.0)  # forwards and 20 deg up
        yield from until(turn, lambda: arm.world.tilt("bowl") < math.radians(110.0))
        yield from suction.let_go(arm)

    @with_arm(0)
    def _turn_by_dome(self, arm: Arm) -> Plan:
        """Take the bowl by the right side of its dome, which leaves more of a turn, and turn it upright."""
        out = (UP - LEFT) / math.sqrt(2.0)
        spot = arm.world.pos("bowl") - self.bowl.centre * UP + self.bowl.outer * out
        yield from go_to(arm, spot + 0.04 * out, motion.facing(math.pi / 2, math.pi / 4), STEADY, OPEN)
        yield from suction.press_on(arm, -out, LOWER_SPEED, "the dome")
        yield from go_to(arm, arm.hand + 0.25 * UP, pace=CARRY_PACE)
        yield from turn_to(arm, facing_down(), 0.6)
        yield from at_most(arm.world, 6.0, turn_to(arm, motion.facing(-math.pi / 2, 0.0), 0.6, give_up=7.0))
        yield from suction.put(arm, "bowl", self.goal, CARRY_PACE)

    @with_arm(0)
    def _right_in_rack(self, arm: Arm) -> Plan:
        """Lay the bowl on the rack on its side: it would rock upright there. Bring it to the square by its inside."""
        yield from self._turn_with_cup(arm, self.foot + (self.rack.top + 0.15) * UP, FORWARDS)
        yield from suction.put(arm, "bowl", self.foot, CARRY_PACE)
        floor = arm.world.pos("bowl") + self.bowl.floor * UP
        yield from suction.take(arm, floor, facing_down(), above=0.10, pace=COARSE)
        yield from go_to(arm, arm.hand + 0.10 * UP, pace=CARRY_PACE)
        yield from suction.put(arm, "bowl", self.goal, CARRY_PACE)

    def _turn_with_cup(self, arm: Arm, above: Vec3, rot: Mat3) -> Plan:
        """Pull the bowl out, bring it to `above` [m], and turn the hand towards `rot` as far as it goes."""
        yield from self.extract(arm)
        yield from go_to(arm, [*arm.hand[:2], above[2]], pace=CARRY_PACE)
        yield from go_to(arm, above - self.bowl.depth / 2 * AHEAD, pace=CARRY_PACE)
        yield from at_most(arm.world, 6.0, turn_to(arm, rot, 0.6, give_up=7.0))

    def _pinch_dome(self, arm: Arm) -> Plan:
        """Pinch the dome with the jaw, as far down as it opens, lift, and bring the bowl to the square."""
        across, below = (math.sqrt(self.bowl.outer**2 - r**2) for r in (OPENING / 2, self.bowl.foot))
        grip = arm.world.pos("bowl") + (TIP_BELOW + across - below) * UP
        yield from jaw.snatch(arm, grip, LEFT, self.goal + 0.10 * UP)  # the dome may stop it higher, or slip out

    def _pry_out(self, arm: Arm) -> Plan:
        """Push the part of the bowl above the ring with closed fingers, up and to the other side; pinch the dome."""
        beside = self.foot + (self.rack.top + TIP_BELOW) * UP + (self.rack.radius + 0.02) * LEFT
        yield from jaw.poke(arm, beside, 0.15 * (0.2 * UP - LEFT), elapsed(arm.world, 4.0))
        yield from self._pinch_dome(arm)

    def _put_down_on_side(self, world: World) -> Plan:
        """Hand the bowl over, and put it on the square without turning it up."""
        right, left = world.arms
        yield from alone(right, self.extract(right))
        yield from motion.together(world, self.present(right), self.wait_beside(left))
        yield from hand_over(right, left, lambda: self.rim(world), SIDEWAYS, RIM_OVERLAP)
        yield from alone(right, handover.draw_back(right, PARKED_HAND, STEADY))
        yield from alone(left, jaw.carry(left, "bowl", self.goal + (self.bowl.radius + 0.01) * UP, pace=CARRY_PACE))
        yield from alone(left, jaw.release(left))

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """With a hole in its foot the cup does not hold the bowl; with a lid on the bowl the jaw finds no rim."""
        holed = self._scene(replace(self.bowl, hole=0.020))
        return {"holed_foot": holed, "lidded": closed(self.build(), "bowl", self.bowl)}

    # --- what must hold -------------------------------------------------------------------

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        return {
            "square": near(self.goal, 0.032, "goal_x", "goal_y"),
            "foot": near(self.foot, 0.008, "rack_x", "rack_y"),
        }

    def constraints(self) -> Iterator[Refutation | None]:
        bowl, rack = self.bowl, self.rack
        # 8 mm is twice the clearance: so the rim stays in the ring for any push of the bowl.
        yield require(rack.height > 0.008, "the ring is too low to keep the bowl", height=rack.height)
        yield on_table("the rack", corners(self.foot, 0.0, 2 * [2 * rack.outer]))
        yield on_table("the square", corners(self.goal, 0.0, 2 * [self.patch.size]))
        apart = gap(corners(self.foot, 0.0, 2 * [2 * rack.outer]), corners(self.goal, 0.0, 2 * [2 * bowl.radius]))
        yield require(apart > 0.01, "there is no room for the bowl beside the rack", apart=apart)
        flat = bowl.foot - math.sqrt(2.0) * CUP_HALF_WIDTH
        yield require(flat > 0.005, "the cup does not fit on the bowl's foot", room=flat)
        weight, lever = GRAVITY * bowl.mass, float(bowl.inertial()[0][2])
        yield require(TORQUE > 3 * weight * lever, "the bowl peels off the cup", torque=weight * lever, most=TORQUE)
        steep = math.sqrt(bowl.outer**2 / (OPENING / 2) ** 2 - 1.0)
        yield require(bowl.friction < 0.8 * steep, "the jaw can take the bowl by its dome", friction=bowl.friction)
        grip = bowl.friction * pinch(bowl.bead)
        yield require(grip > 2 * weight, "the jaw does not hold the bowl", grip=grip, weight=weight)
        right, left = panda.bases(2)
        yield within_reach("the bowl", self.start, base=right)
        yield within_reach("the square", self.goal + 0.18 * UP, base=left)

    def features(self) -> Mapping[str, float]:
        bowl = self.bowl
        return {
            "rim": bowl.radius,
            "depth": bowl.depth,
            "slope": bowl.bead_slope,
            "droop": droop(bowl.mass, bowl.radius, bowl.bead),
            "foot_height": self.plinth + bowl.depth,
            "side": self.goal_y - self.rack_y,
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "rack": "on its left" if self.rack_y > 0.0 else "on its right",
            "square": way_to(self.goal, self.foot),
            "apart": math.dist(self.goal[:2], self.foot[:2]),
            "radius": self.bowl.radius,
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def opening(self) -> Vec3:
        """Direction in which the bowl's opening looks during the handover."""
        return math.cos(self.bowl.bead_slope) * LEFT - math.sin(self.bowl.bead_slope) * UP

    @cached_property
    def foot(self) -> Vec3:
        """Position of the rack on the table [m]."""
        return np.array([self.rack_x, self.rack_y, TABLE_TOP])

    @cached_property
    def start(self) -> Vec3:
        """Initial position of the middle of the bowl's foot, which is on top [m]."""
        return self.foot + (self.plinth + self.bowl.depth) * UP

    @cached_property
    def goal(self) -> Vec3:
        """Goal position of the middle of the bowl's foot [m]."""
        return np.array([self.goal_x, self.goal_y, TABLE_TOP])
