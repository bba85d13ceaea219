"""T07 bowl-table: take a bowl out of the rack in which it is upside down and stand it up, with a suction cup and a jaw.

          _______                    |                       The rim, all there is to be held by, is down in the rack.
        .'       '.            ______|______                 The cup takes the bowl by its foot, holds it out, the jaw
      |/           \\|         |  |_____|                     takes the rim and turns it up.
      ||___________||
      |_____________|

Bottleneck: neither hand can do it alone. The jaw spans the dome only where that is too flat to be pinched, and no
finger gets between the dome and the ring. The cup, on the foot, can pull the bowl out, but no hand turns up from below:
with the cup the opening never looks higher than level. So the bowl changes hands in the air, and each hand turns it by
about a right angle. What is done wrong costs the episode.

Decisions, where the paper (App. B, T07) says no more than "bowl", "rack" and "goal position":

* The rack is a ring, made to measure: 4 mm of room around the rim, and so high that no finger gets in beside the dome.
  The foot is flush with the dome: a ring underneath could be pinched. The cup does not hold on to the dome, on whose
  side it would have a right angle more to turn.
* The goal position is a green square, in which the bowl's foot is to stand, upright within 8 deg, let go.
* "Some failed handovers accidentally invert the bowl and still lead to successful upright placement" (App. J): put
  down on its side a bowl rocks upright by itself. Here such an accident loses the episode: nothing but hands may
  touch the bowl while it leans by more than 30 deg, except the rack in which it is upside down; and a bowl that falls
  faster than 0.40 m/s, as from 8 mm, breaks.
* The paper ships two sizes of bowls and tells none. Training has soup bowls; larger and smaller ones are axes.

The oracle looks: where the rim is, and how far the bowl is from upright, it reads when it needs it, of a bowl that has
shifted on the cup by millimetres and droops in the jaw by some 8 deg. Room: the cup on the foot 8 mm to each side, the
rim between the open fingers 35 mm, the pads on the bead 5 mm along it, the foot in the square 32 mm.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from ..assets.bowl import Bowl
from ..assets.patch import TURNED_OVER, Patch
from ..assets.prop import TABLE_TOP, place, solid, table
from ..assets.ring_rack import RingRack
from ..errors import GaveUp
from ..geometry import UP, Mat3, Vec3, about_y, about_z, corners, gap, shortest
from ..params import param
from ..physics import GRAVITY
from ..predicates import fallen, over
from ..robots import panda
from ..robots.jaw import OPENING, PAD, TIP_BELOW, pinch
from ..robots.suction import CUP_HALF_WIDTH, TORQUE
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import ROBOT, Arm, World
from ..skills import jaw, suction
from ..skills.handover import FORWARDS, LEFT, SIDEWAYS, STAND_OFF, hand_over
from ..skills.motion import (
    CLOSED,
    COARSE,
    FINE,
    OPEN,
    STEADY,
    Condition,
    Pace,
    alone,
    closing_along,
    facing,
    facing_down,
    go_to,
    hold,
    push,
    retreat,
    together,
    turn_to,
    until,
)

UPRIGHT, LEANING = math.radians(8.0), math.radians(30.0)
"""Largest tilt of a bowl that stands, and of one that may touch anything but a hand [rad]: it tips at 35 and more."""
BREAKS = 0.40
"""Speed of a fall that the bowl does not survive [m/s]."""
ROOM, BESIDE = 0.004, 0.012
"""Between rim and ring, and between dome and ring at the ring's upper edge [m]; a finger is 15 mm thick at its tip."""
LOWEST = 0.008
"""Least height of the ring [m]: twice the room, so that the rim stays in it however the bowl is pushed along."""
AWAY: Vec3 = np.array([1.0, 0.0, 0.0])
"""From the robot."""
UPWARDS: Mat3 = about_y(-math.radians(20.0)) @ FORWARDS
"""The same, 20 deg up."""
MEETING: Vec3 = np.array([-0.10, -0.03, TABLE_TOP + 0.32])
"""Where the middle of the bowl's foot is when it changes hands [m]."""
ASIDE: Vec3 = np.array([-0.15, -0.35, TABLE_TOP + 0.35])
"""Where the cup's hand is out of the way [m]."""
OVERLAP = 0.007
"""How far the rim goes between the fingers, beyond the grip site [m]: with it the pads cover the 12 mm of the bead."""
CARRYING = Pace(0.20, 0.01)
"""With the bowl in the jaw, whose way down is to be clearly slower than a fall that breaks it."""
ROUND = math.radians(60.0)
"""How far the hand goes round the bowl, of 90 deg from its right to the robot's side [rad]: at 90 joint 5 comes to its
end with a bowl that droops."""
ROCKS = 0.05
"""How far the middle of the foot comes back to the robot when a bowl on its side rocks upright [m]."""
DOWNWARDS = 0.04
"""How fast the bowl is put down [m/s]."""


@dataclass(frozen=True, kw_only=True)
class BowlTable(Scenario):
    """A bowl upside down in a rack and a green square on the table."""

    HOLD = 0.5

    rack_x: float = param(-0.05, "m", -0.3, 0.2)
    rack_y: float = param(-0.14, "m", -0.35, 0.35)
    goal_x: float = param(0.03, "m", -0.3, 0.3)
    goal_y: float = param(0.15, "m", -0.35, 0.35)
    bowl: Bowl = Bowl()
    plinth: float = param(0.020, "m", 0.005, 0.20)
    """Height of the rack's floor."""
    patch: Patch = Patch(size=0.12)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.bowl)

    @property
    def rack(self) -> RingRack:
        """The rack, made to measure."""
        return RingRack(radius=self.bowl.radius + ROOM, height=self.ring, plinth=self.plinth)

    @property
    def ring(self) -> float:
        """Height of the ring [m]: where it ends, the dome is `BESIDE` from it."""
        bowl = self.bowl
        return bowl.depth - bowl.centre + math.sqrt(bowl.outer**2 - (bowl.radius + ROOM - BESIDE) ** 2)

    def _scene(self, bowl: Bowl) -> mujoco.MjSpec:
        scene = table()
        place(scene, bowl, "bowl", self.start, turn=TURNED_OVER)
        place(scene, self.rack, "rack", self.foot, free=False)
        place(scene, self.patch, "patch", self.goal, free=False)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        stands = world.touching_bodies("bowl") == {"table"} and world.tilt("bowl") < UPRIGHT
        return stands and over(world, "bowl", self.goal, self.patch.size / 2 - self.bowl.foot)

    def failure(self, world: World) -> str | None:
        if fallen(world, "bowl"):
            return "the bowl fell off the table"
        if world.velocity("bowl")[5] < -BREAKS:
            return "the bowl was dropped"
        on, tilt = world.touching_bodies("bowl") - {ROBOT}, world.tilt("bowl")
        stored = on == {"rack"} and tilt > math.pi - LEANING
        return "the bowl lay on its side or upside down" if on and tilt > LEANING and not stored else None

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Pull the bowl out with the cup, hand it over to the jaw, put it down with the jaw."""
        giver, taker = world.arms
        yield from alone(giver, self.extract(giver))
        yield from together(world, self.present(giver), self.wait_beside(taker))
        yield from hand_over(giver, taker, lambda: self.rim(world), SIDEWAYS, OVERLAP)
        yield from together(world, self.leave(giver), self.turn_up(taker))
        yield from alone(taker, self.put_down(taker))

    def extract(self, arm: Arm) -> Plan:
        """Suck the bowl by its foot, pull it out over the middle of the ring: a rim that rubs there peels it off."""
        foot, down = arm.world.pos("bowl"), facing_down()
        yield from go_to(arm, foot + 0.03 * UP, down, STEADY, OPEN)
        yield from suction.suck(arm, foot, down)
        out = [*self.start[:2], arm.world.pos("bowl")[2] + self.rack.height + 0.02]
        yield from suction.carry_to(arm, "bowl", np.array(out), arm.world.rot("bowl"), Pace(0.10, 0.004))

    def present(self, arm: Arm) -> Plan:
        """Hold the bowl out so that its rim, on top, is level where the jaw comes to."""
        yield from go_to(arm, [*arm.hand[:2], MEETING[2]], pace=Pace(0.15, 0.02))
        yield from go_to(arm, MEETING, pace=Pace(0.20, 0.02))
        yield from turn_to(arm, facing(math.pi / 2, self.slope), 0.8)
        out = shortest(arm.world.rot("bowl")[:, 2], self.opening) @ arm.world.rot("bowl")
        yield from suction.carry_to(arm, "bowl", MEETING, out, CARRYING)

    def wait_beside(self, arm: Arm) -> Plan:
        """Bring the open jaw beside the place where the rim is going to be."""
        away = MEETING + self.bowl.depth * self.opening + (self.bowl.radius - self.bowl.bead / 2) * UP
        yield from go_to(arm, away + 2 * STAND_OFF * LEFT, SIDEWAYS, STEADY, OPEN)

    def rim(self, world: World) -> Vec3:
        """The uppermost point of the rim, at half its thickness, of a bowl held out [m]."""
        axis = world.rot("bowl")[:, 2]
        up = (UP - axis[2] * axis) / math.hypot(axis[0], axis[1])
        return world.pos("bowl") + self.bowl.depth * axis + (self.bowl.radius - self.bowl.bead / 2) * up

    def leave(self, arm: Arm) -> Plan:
        """Back, and out of the way."""
        yield from go_to(arm, arm.hand - 0.08 * arm.hand_rot[:, 2], pace=STEADY)
        yield from go_to(arm, ASIDE, pace=COARSE)

    def turn_up(self, arm: Arm) -> Plan:
        """Turn the opening up, and the hand to the robot's side of the bowl: there its palm meets no rack."""
        yield from turn_to(arm, about_z(-ROUND) @ self.level(arm), 1.0)

    def level(self, arm: Arm) -> Mat3:
        """Orientation of the hand in which the bowl that it holds is upright."""
        return shortest(arm.world.rot("bowl")[:, 2], UP) @ arm.hand_rot

    def put_down(self, arm: Arm) -> Plan:
        """Over the square, down until the foot is on the table; let go.

        The bowl droops all the while, and by 7 deg at every jerk: it is levelled evenly, before the way and on it.
        """
        world = arm.world
        for height in (0.18, 0.02):
            yield from turn_to(arm, self.level(arm), 0.8)
            com = self.goal + (height + world.com("bowl")[2] - world.pos("bowl")[2]) * UP
            yield from jaw.carry(arm, "bowl", com, pace=CARRYING)
        yield from push(arm, -DOWNWARDS * UP, lambda: world.touching("bowl", "table"))
        yield from jaw.release(arm)
        yield from retreat(arm)

    # --- what must not work ---------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "cup_sets_it_down": Shortcut(self._set_down),
            "cup_tips_it_over": Shortcut(self._tip_over),
            "cup_flings_it": Shortcut(self._fling),
            "cup_rights_it_in_the_rack": Shortcut(self._right_in_the_rack),
            "cup_on_the_dome": Shortcut(lambda world: alone(world.arms[0], self._by_the_dome(world.arms[0]))),
            "jaw_on_the_dome": Shortcut(lambda world: self._beside(world, self._on_the_dome), to_rest=True),
            "jaw_pries_it_out": Shortcut(lambda world: self._beside(world, self._pry)),
            "jaw_leaves_it_turned": Shortcut(self._unturned),
        }

    def _set_down(self, world: World) -> Plan:
        """Put the bowl on the square with the cup, upside down."""
        arm = world.arms[0]

        def plan() -> Plan:
            yield from self.extract(arm)
            yield from self._lower(arm, self.goal)

        yield from alone(arm, plan())

    def _tip_over(self, world: World) -> Plan:
        """Turn the bowl as far as the cup's hand goes, and put it on the square on its side: it would rock upright."""
        arm = world.arms[0]

        def plan() -> Plan:
            yield from self._turn_with_cup(arm, self.goal + 0.20 * UP, FORWARDS)
            yield from self._lower(arm, self.goal + ROCKS * AWAY)

        yield from alone(arm, plan())

    def _fling(self, world: World) -> Plan:
        """Turn the bowl fast and let go in the middle of the turn, so that it turns on as it falls."""
        arm = world.arms[0]

        def plan() -> Plan:
            yield from self.extract(arm)
            yield from go_to(arm, self.goal - 0.06 * AWAY + 0.20 * UP, pace=Pace(0.2, 0.02))
            spun = turn_to(arm, UPWARDS, 3.0)
            yield from until(spun, lambda: world.tilt("bowl") < math.radians(110.0))
            yield from suction.let_go(arm)

        yield from alone(arm, plan())

    def _by_the_dome(self, arm: Arm) -> Plan:
        """Take the bowl by the right side of its dome, so that there is more of a turn left, and turn it upright."""
        out = (UP - LEFT) / math.sqrt(2.0)
        spot = arm.world.pos("bowl") - self.bowl.centre * UP + self.bowl.outer * out
        yield from go_to(arm, spot + 0.04 * out, facing(math.pi / 2, math.pi / 4), STEADY, OPEN)
        yield from until(push(arm, -DOWNWARDS * out, lambda: arm.sealed, CLOSED), _after(arm.world, 2.0))
        yield from hold(arm, 0.3, CLOSED)
        if not arm.sealed:
            raise GaveUp("the cup did not get hold of the dome")
        yield from go_to(arm, arm.hand + 0.25 * UP, pace=CARRYING)
        yield from turn_to(arm, facing_down(), 0.6)
        yield from until(turn_to(arm, facing(-math.pi / 2, 0.0), 0.6, give_up=7.0), _after(arm.world, 6.0))
        yield from self._lower(arm, self.goal)

    def _right_in_the_rack(self, world: World) -> Plan:
        """Lay the bowl on the rack on its side: it would rock upright there. Bring it to the square by its inside."""
        arm = world.arms[0]

        def plan() -> Plan:
            yield from self._turn_with_cup(arm, self.foot + (self.rack.top + 0.15) * UP, FORWARDS)
            yield from self._lower(arm, self.foot)
            floor = world.pos("bowl") + self.bowl.floor * UP
            yield from go_to(arm, floor + 0.10 * UP, facing_down(), COARSE, OPEN)
            yield from suction.suck(arm, floor, facing_down())
            yield from go_to(arm, arm.hand + 0.10 * UP, pace=CARRYING)
            yield from self._lower(arm, self.goal)

        yield from alone(arm, plan())

    def _turn_with_cup(self, arm: Arm, over: Vec3, rot: Mat3) -> Plan:
        """Pull the bowl out and turn the hand to `rot`, as far as it goes, at a place [m]."""
        yield from self.extract(arm)
        yield from go_to(arm, [*arm.hand[:2], over[2]], pace=CARRYING)
        yield from go_to(arm, over - self.bowl.depth / 2 * AWAY, pace=CARRYING)
        yield from until(turn_to(arm, rot, 0.6, give_up=7.0), _after(arm.world, 6.0))

    def _lower(self, arm: Arm, spot: Vec3) -> Plan:
        """Bring the cup over a place and down until the bowl touches something; let go."""
        yield from until(go_to(arm, [spot[0], spot[1], arm.hand[2]], pace=CARRYING), _after(arm.world, 4.0))
        yield from push(arm, -DOWNWARDS * UP, lambda: arm.world.touching_bodies("bowl") > {ROBOT}, give_up=8.0)
        yield from suction.let_go(arm)
        yield from retreat(arm)

    def _beside(self, world: World, plan: Callable[[Arm], Plan]) -> Plan:
        """A plan of the jaw's arm, with the other hand out of its way: both reach for the rack."""
        other, arm = world.arms
        yield from together(world, go_to(other, ASIDE, pace=COARSE), plan(arm))

    def _on_the_dome(self, arm: Arm) -> Plan:
        """Pinch the dome with the jaw, as far down as that opens, lift, bring it to the square."""
        across, below = (math.sqrt(self.bowl.outer**2 - r**2) for r in (OPENING / 2, self.bowl.foot))
        at = arm.world.pos("bowl") + (TIP_BELOW + across - below) * UP
        yield from go_to(arm, at + 0.10 * UP, closing_along(arm, LEFT), COARSE, OPEN)
        yield from until(go_to(arm, at, pace=FINE), _after(arm.world, 2.0))  # the dome may stop it a little higher
        yield from jaw.grasp(arm, 0.5)
        with suppress(GaveUp):  # where the pads do not slip off, the bowl stays in the rack, and they on it
            yield from retreat(arm, 0.12)
            yield from go_to(arm, self.goal + 0.10 * UP)
        yield from jaw.release(arm)

    def _pry(self, arm: Arm) -> Plan:
        """Push the bowl with closed fingers where it stands out of the ring, up and to the other side."""
        beside = self.foot + (self.rack.top + TIP_BELOW) * UP + (self.rack.radius + 0.02) * LEFT
        yield from jaw.poke(arm, beside, 0.15 * (0.2 * UP - LEFT), _after(arm.world, 4.0))
        yield from self._on_the_dome(arm)

    def _unturned(self, world: World) -> Plan:
        """Hand the bowl over, and put it on the square as it is."""
        giver, taker = world.arms
        yield from alone(giver, self.extract(giver))
        yield from together(world, self.present(giver), self.wait_beside(taker))
        yield from hand_over(giver, taker, lambda: self.rim(world), SIDEWAYS, OVERLAP)
        yield from alone(giver, self.leave(giver))
        com = self.goal + (self.bowl.radius + 0.01) * UP
        yield from alone(taker, jaw.carry(taker, "bowl", com, pace=CARRYING))
        yield from alone(taker, jaw.release(taker))

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """With a hole in its foot the cup does not hold the bowl; with a lid on it the jaw finds no rim."""
        lidded = self.build()
        lid = [self.bowl.radius - self.bowl.bead, 0.001]
        at = [0.0, 0.0, self.bowl.depth - 0.001]
        solid(lidded.body("bowl"), "lid", lid, at, type=mujoco.mjtGeom.mjGEOM_CYLINDER, mass=0.0)
        return {"holed_foot": self._scene(replace(self.bowl, hole=0.020)), "lidded": lidded}

    # --- what must hold -------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        bowl = self.bowl
        yield require(self.ring > LOWEST, "the ring is too low to keep the bowl", height=self.ring)
        rack = self.rack
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
        bowl, lever = self.bowl, self.bowl.radius
        return {
            "rim": bowl.radius,
            "depth": bowl.depth,
            "slope": self.slope,
            "droop": GRAVITY * bowl.mass * lever / (pinch(bowl.bead) * PAD / 2),
            "foot_height": self.plinth + bowl.depth,
            "side": self.goal_y - self.rack_y,
        }

    # --- geometry -------------------------------------------------------------------------

    @property
    def slope(self) -> float:
        """How far the bead, as the middle of the rim's height, leans out [rad]."""
        (low, foot), (out, top) = self.bowl.sections[-1].corners[:2]
        return math.atan2(out - low, top - foot)

    @property
    def opening(self) -> Vec3:
        """Where the bowl's opening looks when it changes hands."""
        return math.cos(self.slope) * LEFT - math.sin(self.slope) * UP

    @property
    def foot(self) -> Vec3:
        """Where the rack stands [m]."""
        return np.array([self.rack_x, self.rack_y, TABLE_TOP])

    @property
    def start(self) -> Vec3:
        """Where the middle of the bowl's foot is [m]: on top."""
        return self.foot + (self.plinth + self.bowl.depth) * UP

    @property
    def goal(self) -> Vec3:
        """Where the middle of the foot is to be [m]."""
        return np.array([self.goal_x, self.goal_y, TABLE_TOP])


def _after(world: World, seconds: float) -> Condition:
    """Holds from some time on: for moves that may not come to their end."""
    end = world.time + seconds
    return lambda: world.time > end
