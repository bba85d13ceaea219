"""T04 cup-inversion: turn a cup that stands upside down, and put it upright on a square, with suction and a jaw.

        ______                 suction ]==|      |<==[ jaw               \\      /
       /      \\                          |______|                        \\____/
    --/________\\-------                                               ----=======--

Bottleneck: one hand alone cannot do it. The jaw finds nothing to hold: the cup is wider than the jaw opens, and the rim
is on the table. Suction holds the base, but a cup that stands has its base down, where no hand fits between it and the
table. So the suction hand lifts the cup and turns it until the jaw can reach the rim, the jaw takes it, suction lets
go, and the jaw puts it down upright.

Decisions, where the paper (App. B, T04) is silent:

* "The jaw cannot grasp the smooth rim", and yet it "grabs it by the rim": it cannot on the table, it can in the air.
* Each hand turns the cup by a quarter turn. In the paper suction turns it by half; here a hand points up only where the
  cup is at least 0.28 m above the table, and level hands need less height.
* The wall is smooth and leans. Two hands can press from both sides, and each can roll by half a turn: they slip off
  if the wall's friction is less than its slope. Upright, the cup could be lifted that way; upside down, it cannot. The
  bead is rough on its inside only: if it is rough outside as well, two hands that press on it lift the cup without
  suction or a grasp, and roll it upright in the air (12 of 12; as it is 0 of 12). The wall is ribbed, so that suction
  does not hold on it: else a level hand could take the cup by its wall, with the other hand behind it as a stop, and
  roll.
* "Toppling is not a reliable option since the cup just slides out": the rim's friction on the table is less than its
  radius over the cup's height. No goal counts after the cup touched the table askew or fell faster than a hand lowers
  it: else it could be laid down for the jaw, or be dropped from a hand that points up.
* In the region means that the whole base is on the square, upright within 8 deg, and released.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from ..assets.cup import Cup
from ..assets.patch import TURNED_OVER, Patch
from ..assets.prop import TABLE_TOP, place, table
from ..decisions import Decision, near
from ..geometry import UP, Mat3, Vec3, between, corners, gap, rotation, shortest, way_to
from ..means import Mean, once, throughout, when
from ..params import param
from ..physics import GRAVITY
from ..predicates import borne, fallen
from ..robots import panda
from ..robots.jaw import OPENING, PALM_ACROSS, TIP_BELOW, droop, pinch
from ..robots.suction import PULL
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT, Arm
from ..sim.world import World
from ..skills import jaw, motion, suction
from ..skills.handover import LEFT, OVERLAP, SIDEWAYS, STAND_OFF, draw_back, hand_over, hold_out, parking
from ..skills.motion import COARSE, OPEN, STEADY, Pace, alone, facing, facing_down, go_to, together, turn_to, with_arm

TUMBLER = Cup(height=0.090, base=0.043, rim=0.055, friction=0.06, handle_friction=0.8, ribbed=True, smooth_outside=True)
"""Cup of the training distribution: 86 mm wide at its narrowest, and polished except for the inside of its bead."""
UPRIGHT_TOLERANCE = math.radians(8.0)  # largest tilt of a cup that counts as upright [rad]
FALL_ANGLE = math.radians(25.0)  # tilt above which a cup that touches the table is no longer upright [rad]
INVERTED_ANGLE = math.radians(155.0)  # tilt above which a cup that touches the table counts as upside down [rad]
MAX_FALL_SPEED = 0.5
"""Speed above which the cup has fallen [m/s], as from 13 mm: no hand lowers anything faster than 0.3 m/s. It is
checked every 10 ms, in which a fall gains 0.1 m/s: from 19 mm on it is seen for certain."""
LEFTWARDS: Mat3 = facing(math.pi / 2, 0.0)
"""Orientation of the suction hand, level, in which it points at the other arm."""
HANDOVER_POINT: Vec3 = np.array([-0.15, -0.05, TABLE_TOP + 0.25])
"""Position of the middle of the base during the handover [m]; the palm is then at least 0.09 m above the table."""
PARKED_HAND: Vec3 = np.array([-0.20, -0.45, TABLE_TOP + 0.40])
"""Position of the suction hand while it is out of the way [m]."""
JAW_PARKED_HAND: Vec3 = PARKED_HAND * [1.0, -1.0, 1.0]
"""Position of the jaw's hand while it is out of the way [m]."""
CARRY_HEIGHT = 0.06  # height above the square at which the cup is brought there and put upright [m]
MAX_REACH = 0.77
"""Level distance from its base up to which the jaw's hand sets the cup down [m]: to its side it fails from 0.774 on,
straight ahead from 0.79."""


@dataclass(frozen=True, kw_only=True)
class CupInversion(Scenario):
    """A cup upside down on the table, and a green square."""

    VERSION = 2
    HOLD = 0.5

    x: float = param(-0.05, "m", -0.4, 0.4)
    y: float = param(-0.10, "m", -0.4, 0.4)
    goal_x: float = param(0.0, "m", -0.4, 0.4)
    goal_y: float = param(0.14, "m", -0.4, 0.4)
    cup: Cup = TUMBLER
    patch: Patch = Patch(size=0.14)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.cup)

    def _scene(self, cup: Cup) -> mujoco.MjSpec:
        scene = table()
        place(scene, cup, "cup", self.start + cup.height * UP, turn=TURNED_OVER)
        place(scene, self.patch, "patch", self.goal, free=False)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        released = world.touching("cup", "table") and not world.touching(ROBOT, "cup")
        off = float(np.abs(world.pos("cup") - self.goal)[:2].max())
        return released and world.tilt("cup") < UPRIGHT_TOLERANCE and off < self.patch.size / 2 - self.cup.base

    def failure(self, world: World) -> str | None:
        return "the cup fell off the table" if fallen(world, "cup") else None

    def means(self) -> Mapping[str, Mean]:
        lifted, shared = "suction alone lifted the inverted cup", "the jaw gripped the cup while suction still pulled"

        def askew(world: World) -> bool:
            return FALL_ANGLE < world.tilt("cup") < INVERTED_ANGLE and world.touching("cup", "table")

        def fell(world: World) -> bool:
            return world.velocity("cup")[5] < -MAX_FALL_SPEED and not world.touching(ROBOT, "cup")

        return {
            lifted: once(lambda w: w.tilt("cup") > INVERTED_ANGLE and borne(w, w.arms[0], "cup")),
            shared: once(
                lambda w: all(arm.grips("cup") for arm in w.arms) and not w.touching("cup", "table"), after=lifted
            ),
            "then the jaw alone bore the cup": once(lambda w: borne(w, w.arms[1], "cup"), after=shared),
            "the jaw set the cup down upright": when(
                lambda w: w.tilt("cup") < FALL_ANGLE and w.touching("cup", "table"), lambda w: w.arms[1].grips("cup")
            ),
            "the cup neither fell nor touched the table askew": throughout(lambda w: not askew(w) and not fell(w)),
        }

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Hold the cup out with the suction hand, hand it over to the jaw, put it down upright.

        Every target is computed from the cup's pose when its move starts, so that each move corrects the error of the
        previous one.
        """
        right, left = world.arms
        yield from alone(left, self.wait_beside(left))
        yield from alone(right, self.present(right))
        yield from hand_over(right, left, lambda: self.rim(world), SIDEWAYS)
        yield from together(world, draw_back(right, PARKED_HAND), motion.hold(left, 0.0))
        yield from alone(left, self.set_down(left))

    def present(self, arm: Arm) -> Plan:
        """Lift the cup, turn its opening to the other arm, and hold it out."""
        yield from self.lift(arm)
        yield from turn_to(arm, LEFTWARDS, 1.0)
        yield from hold_out(arm, "cup", HANDOVER_POINT, LEFT, Pace(0.20, 0.004))

    def lift(self, arm: Arm) -> Plan:
        """Suck the cup in the middle of its base and lift it."""
        yield from suction.take(arm, arm.world.pos("cup"), facing_down(math.pi / 2))
        yield from motion.retreat(arm, 0.15, Pace(0.15, 0.02))

    def rim(self, world: World) -> Vec3:
        """Uppermost point of the rim of a cup that is held out, in the middle of the bead [m]."""
        axis = world.rot("cup")[:, 2]
        up = UP - axis[2] * axis
        return world.pos("cup") + self.cup.height * axis + self.grip_radius * up / np.linalg.norm(up)

    def wait_beside(self, arm: Arm) -> Plan:
        """Bring the open jaw beside the place where the rim is going to be, clear of the cup as it comes up."""
        y = max(HANDOVER_POINT[1] + self.cup.height, self.y + self.cup.rim) + STAND_OFF + 0.04
        yield from go_to(arm, [HANDOVER_POINT[0], y, HANDOVER_POINT[2] + self.grip_radius], SIDEWAYS, STEADY, OPEN)

    def set_down(self, arm: Arm) -> Plan:
        """Tip the hand down, so that the cup hangs under it; turn the cup upright, put it on the square, let go."""
        world, com = arm.world, self.goal + self.cup.inertial()[0][2] * UP
        yield from turn_to(arm, facing_down(), 0.8)
        yield from go_to(arm, [*arm.hand[:2], self.goal[2] + self.cup.height + 2 * CARRY_HEIGHT], pace=STEADY)
        for pace in (STEADY, Pace(0.10, 0.005)):  # twice: the cup swings in the pinch
            upright = shortest(world.rot("cup")[:, 2], UP) @ world.rot("cup")
            yield from jaw.carry(arm, "cup", com + CARRY_HEIGHT * UP, upright, pace)
        yield from jaw.put(arm, "cup", com, "table", hover=CARRY_HEIGHT / 2)
        yield from motion.retreat(arm)

    # --- what must not work ---------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "topple_it": Shortcut(self._topple, to_rest=True),
            "put_down_as_it_is": Shortcut(parking(1, JAW_PARKED_HAND, self._put_down_inverted)),
            "jaw_from_above": Shortcut(self._pinch_base),
            "let_go_without_partner": Shortcut(self._let_go),
            "turn_it_up_and_drop_it": Shortcut(parking(1, JAW_PARKED_HAND, self._turn_up_and_drop)),
            "squeeze_and_roll": Shortcut(self._squeeze),
            "suck_the_wall_and_roll": Shortcut(self._suck_wall),
        }

    def _topple(self, world: World) -> Plan:
        """Push the cup near its base, which is on top, as fast as the jaw's hand goes.

        The push goes across the arm's reach, so that the cup stays within it; the other arm is out of the way.
        """
        right, left = world.arms
        x, y, _ = self.start - panda.bases(2)[1]
        along = np.array([y, -x, 0.0]) / math.hypot(x, y)
        beside = world.pos("cup") - 0.01 * UP - (self.cup.rim + 0.03) * along
        pushed = jaw.poke(left, beside, 0.3 * along, lambda: float((left.hand - beside) @ along) > 0.16)
        yield from together(world, go_to(right, PARKED_HAND, pace=COARSE), pushed)

    def _put_down_inverted(self, arm: Arm) -> Plan:
        """Put the cup on the square upside down."""
        yield from self.lift(arm)
        base = self.goal + (self.cup.height + 0.002) * UP
        yield from suction.carry_to(arm, "cup", base, arm.world.rot("cup"), Pace(0.15, 0.003))
        yield from suction.let_go(arm)

    @with_arm(1)
    def _pinch_base(self, arm: Arm) -> Plan:
        """Take the cup across its base with the jaw, turn it over in the air, put it down."""
        yield from jaw.pick(arm, arm.world.pos("cup") - 0.015 * UP, LEFT, lift=0.25)
        yield from turn_to(arm, SIDEWAYS)
        yield from jaw.put(arm, "cup", self.goal + self.cup.rim * UP, "table")

    @with_arm(0)
    def _let_go(self, arm: Arm) -> Plan:
        """Hold the cup out over the square, low above it, and let go although the jaw does not hold it."""
        yield from self.lift(arm)
        yield from turn_to(arm, LEFTWARDS, 1.0)
        yield from go_to(arm, self.goal - self.cup.height / 2 * LEFT + (self.cup.rim + 0.01) * UP, LEFTWARDS)
        yield from suction.let_go(arm)

    def _turn_up_and_drop(self, arm: Arm) -> Plan:
        """Turn the opening up with the suction hand, go down as far as it goes, pull the hand away below the cup."""
        yield from self.lift(arm)
        yield from go_to(arm, [*self.goal[:2], TABLE_TOP + 0.45], pace=Pace(0.15, 0.02))
        for above_level in (0.0, 0.5, 1.0, math.pi / 2):
            yield from turn_to(arm, facing(math.pi / 2, -above_level), 1.0, within=0.05)
        yield from go_to(arm, [*self.goal[:2], TABLE_TOP + 0.30], pace=Pace(0.10, 0.02))
        yield from go_to(arm, arm.hand - [0.15, 0.0, 0.15], pace=COARSE, grip=OPEN)

    def _squeeze(self, world: World) -> Plan:
        """Press both hands on the wall at half its height, lift the cup, roll both by half a turn, put it down."""
        middle, far = self.start + self.cup.height / 2 * UP, self.goal + (self.cup.height / 2 + 0.003) * UP
        beside, high = self.cup.outer(self.cup.height / 2), 0.2 * UP
        hands = list(zip(world.arms, (-1, 1), (LEFTWARDS, facing(-math.pi / 2, 0.0)), (0.0, TIP_BELOW), strict=True))

        def both(seconds: float, pose: Callable[[float], tuple[Vec3, float, float]]) -> Plan:
            """Steer both hands; `pose` maps the share of the time to their middle, distance from it, and roll."""
            start = world.time
            while world.time < start + seconds:
                centre, distance, roll = pose((world.time - start) / seconds)
                actions = []
                for arm, side, rot, tip in hands:
                    turn = 2.0 * between(arm.hand_rot, rotation(math.pi * roll * LEFT) @ rot)
                    target = centre + side * (distance + tip) * LEFT
                    actions.append(motion.steer(arm, target, np.zeros(3), turn, motion.CLOSED))
                yield np.concatenate(actions)

        tight = beside - 0.02
        yield from both(1.5, lambda t: (middle + high, beside + 0.06, 0.0))
        yield from both(2.0, lambda t: (middle + (1 - t) * high, beside + 0.05 - 0.02 * t, 0.0))
        yield from both(1.5, lambda t: (middle, beside + 0.03 - 0.05 * t, 0.0))
        yield from both(2.0, lambda t: (middle + t * high, tight, 0.0))
        yield from both(4.0, lambda t: (middle + high, tight, t))
        yield from both(3.0, lambda t: ((1 - t) * middle + t * far + high, tight, 1.0))
        yield from both(4.0, lambda t: (far + (1 - t) * high, tight, 1.0))
        yield from both(1.0, lambda t: (far, tight + 0.07 * t, 1.0))

    def _suck_wall(self, world: World) -> Plan:
        """Suck the wall, with the jaw's hand as a stop behind the cup, lift it, roll by half a turn, put it down."""
        right, left = world.arms
        yield from together(world, self._roll_by_wall(right), self._stop_behind(left))

    def _roll_by_wall(self, arm: Arm) -> Plan:
        high = self.cup.height / 2 + 0.01
        spot = self.start + high * UP - self.cup.outer(self.cup.height - high) * LEFT
        rot = facing(math.pi / 2, math.atan(self.slope))
        yield from go_to(arm, spot - 0.15 * LEFT + 0.1 * UP, rot, STEADY, OPEN)
        yield from go_to(arm, spot - 0.03 * LEFT, rot, STEADY)
        yield from suction.suck_upright(arm, spot, rot, give_up=3.0)
        yield from motion.retreat(arm, 0.05, Pace(0.05, 0.005))
        yield from motion.retreat(arm, 0.10, STEADY)
        start, way = arm.hand_rot, -math.copysign(1.0, float(arm.joint_pos[6]))
        for part in (1, 2):
            yield from turn_to(arm, rotation(way * part * math.pi / 2 * start[:, 2]) @ start)
        yield from go_to(arm, self.goal + (self.cup.height - high) * UP - self.cup.rim * LEFT)
        yield from suction.let_go(arm)

    def _stop_behind(self, arm: Arm) -> Plan:
        behind = self.start + (self.cup.rim + PALM_ACROSS + 0.002) * LEFT + 0.045 * UP
        yield from go_to(arm, behind + 0.1 * UP + 0.05 * LEFT, facing_down(math.pi / 2), STEADY, motion.CLOSED)
        yield from go_to(arm, behind)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """A cup without the base that suction holds; one without its bead, with a rim as smooth as its wall."""
        ring = self.build()
        for geom in list(ring.body("cup").geoms):
            if geom.name.startswith(("cup/bottom", "cup/floor", "cup/foot")):
                ring.delete(geom)
        smooth = replace(self.cup, bead=0.0, handle_friction=self.cup.friction, rim_friction=self.cup.friction)
        return {"no_base": ring, "smooth_rim": self._scene(smooth)}

    # --- what must hold -------------------------------------------------------------------

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        return {
            "square": near(self.goal, self.patch.size / 2 - self.cup.base, "goal_x", "goal_y"),
            "cup": near(self.start, 0.010, "x", "y"),
        }

    def constraints(self) -> Iterator[Refutation | None]:
        cup, weight = self.cup, GRAVITY * self.cup.mass
        around = corners(self.start, 0.0, 2 * [2 * cup.rim])
        square = corners(self.goal, 0.0, 2 * [self.patch.size])
        yield require(not cup.has_handle, "the cup has a handle", handle=cup.handle)
        yield on_table("the cup", around)
        yield on_table("the square", square)
        apart = gap(around, square)
        yield require(apart > 0.0, "the cup stands on the square", apart=apart)
        room = self.patch.size / 2 - cup.base
        yield require(room > 0.015, "the base does not fit on the square", room=room)
        width = 2 * min(cup.base, cup.rim)
        yield require(width > OPENING + 0.002, "the jaw can span the cup", width=width, jaw=OPENING)
        topples = cup.rim / cup.height
        yield require(cup.rim_friction < 0.7 * topples, "a push topples the cup", friction=cup.rim_friction, at=topples)
        most = 0.75 * self.slope  # two hands hold it if the friction reaches the slope
        yield require(cup.friction < most, "two hands can lift the cup by its wall", friction=cup.friction, most=most)
        shear = cup.friction * PULL
        yield require(shear > 2.2 * weight, "a level suction hand does not hold the cup", shear=shear, weight=weight)
        grip = (cup.handle_friction + cup.friction) / 2 * pinch(cup.bead)  # one pad is inside, the other one outside
        yield require(grip > 2 * weight, "the jaw does not hold the cup", grip=grip, weight=weight)
        yield require(self.droop < 1.5, "the cup turns in the jaw", droop=self.droop)
        right, left = panda.bases(2)
        yield within_reach("the cup", self.start + cup.height * UP, base=right)
        yield within_reach("the square", self.goal + (cup.height + 2 * CARRY_HEIGHT) * UP, base=left)
        away = math.hypot(*(self.goal - self.grip_radius * LEFT - left)[:2])
        yield require(away < MAX_REACH, "the jaw cannot set the cup down so far out", distance=away, farthest=MAX_REACH)

    def features(self) -> Mapping[str, float]:
        right, left = panda.bases(2)
        away, goal_away = (self.start - right)[:2], (self.goal - left)[:2]
        return {
            "droop": self.droop,
            "height": self.cup.height,
            "side": float(away[1]),
            "goal_side": float(goal_away[1]),
            "reach": math.hypot(*away),
            "goal_reach": math.hypot(*goal_away),
            "carried": math.dist(self.start, self.goal),
            "friction_over_slope": self.cup.friction / self.slope,
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "cup": way_to(self.start, self.goal),
            "apart": math.dist(self.start[:2], self.goal[:2]),
            "height": self.cup.height,
            "base": self.cup.base,
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def start(self) -> Vec3:
        """Initial position of the cup's middle on the table [m]."""
        return np.array([self.x, self.y, TABLE_TOP])

    @cached_property
    def goal(self) -> Vec3:
        """Position of the middle of the square [m]."""
        return np.array([self.goal_x, self.goal_y, TABLE_TOP])

    @cached_property
    def grip_radius(self) -> float:
        """Distance of the middle of the bead, which the jaw takes, from the cup's axis [m]."""
        return self.cup.rim - self.cup.bead / 2

    @cached_property
    def slope(self) -> float:
        """Slope of the wall: how far it leans out per height."""
        return (self.cup.rim - self.cup.base) / self.cup.height

    @cached_property
    def droop(self) -> float:
        """Torque of the level cup's weight about the pads, over the torque that they resist: above 1 the cup turns."""
        lever = self.cup.height - OVERLAP - self.cup.inertial()[0][2]
        return droop(self.cup.mass, lever, self.cup.bead)
