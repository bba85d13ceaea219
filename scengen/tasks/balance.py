"""T31 balance-medium and T32 balance-hard: stand a rod upright on a narrow ridge so that it stays up by itself.

            | |
            | |       seen along the ridge; one long side of the rod may be of lead, which is dark
            |_|
             |
        _____|_____

Bottleneck: the ridge, 12 or 8 mm wide, is narrower than the rod. The rod stays up only if its centre of mass is over
the ridge when it is released, nearly without tilt and speed. A rod 0.2 m high tips from 3.4 deg on 12 mm, from 2.3 deg
on 8 mm. Contacts yield by 0.25 mm, so that a rod that is released at rest stays up to 4 and 2 mm off the middle.

Decisions where the paper (App. B, T31 and T32) is silent:

* The rod starts upright on the table, so that the jaw takes it at its upper end. The paper gives no sizes.
* The paper's policies suffer from a displaced centre of mass (4.3). Here a plate of lead in one side of the rod
  displaces it. The dark side shows where it is, its thickness how far, and the weight confirms it; nothing is hidden.
  In training the middle of the foot may be over the ridge: a policy that never looks at the lead solves 12 of 12. On
  the axis `off_centre` it may not: the foot must be set off the ridge's middle, or turned until the dark side looks
  along the ridge.
* Only the ridge may touch the rod for 1 s, and for a further second without action: a rod that leans on a finger, on
  the plate or on the ridge's side does not stand on the ridge.
* The rod is released once, upright and at rest. A hand that opens a little, sees the rod tip and catches it would find
  the place by trial.
* Released on the ridge (paper) means that the rod falls from no more than 6 mm: a rod that is aligned and dropped from
  60 mm stays up on 12 mm.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from ..assets.inlaid_rod import InlaidRod
from ..assets.ridge import Ridge
from ..decisions import Decision, around, choice, near, side_of
from ..geometry import UP, Mat3, about_z, gap, way_to
from ..means import Mean, throughout
from ..params import param
from ..physics import GRAVITY
from ..predicates import count_time, fallen, rests_on, still
from ..robots.jaw import OPEN_GAP, pinch
from ..scenario import Plan, Planner, Refutation, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT
from ..sim.memory import remember
from ..sim.world import World
from ..skills.jaw import carry, let_go, pick
from ..skills.motion import COARSE, FINE, OPEN, STEADY, Pace, go_to, hold, push, retreat, turn_to, wait
from ..skills.waiting import elapsed
from .rod_and_ridge import MAX_TILT, RIDGE, RodAndRidge

RELEASE_TIME = 0.1
"""Time without the robot after which a rod on the ridge has been released [s]. Fingers that open rattle for less."""
MAX_FALL_SPEED = 0.35
"""Speed of the free fall above which the rod has been dropped [m/s]: as of a fall from 6 mm."""
STEADY_TILT = math.radians(1.5)
"""Largest tilt of a rod on which the jaw opens [rad]: 0.3 deg in jittered runs. On 8 mm a rod tips from 2.3 deg."""
STEADY_SPEED = 0.06  # largest speed of the middle of such a rod [m/s]: 0.03 in jittered runs
MISS_MARGIN = 0.0015
"""Least distance beyond the ridge's edge of the centre of mass of a rod that is set down by its foot [m]."""
HOLD_MARGIN = 0.0015
"""Least distance of the centre of mass from the edge of what supports it [m], the accuracy of the hand."""
GRIP_DEPTH = 0.025  # distance of the grip below the rod's upper end [m]; the palm stays 6 mm above the rod
LIFT_HEIGHT = 0.10  # height to which the rod is lifted [m]
DROP_HEIGHT = 0.06  # height over the ridge from which a shortcut drops the rod [m]
SLIDE_SPEED = 0.15  # speed across the ridge at which a shortcut releases the rod [m/s]


@dataclass(frozen=True, kw_only=True)
class UprightRod(RodAndRidge[InlaidRod]):
    """A rod that stands on the table, and a ridge."""

    VERSION = 2
    HOLD = 1.0

    rod_x: float = param(-0.13, "m", -0.4, 0.4)
    rod_y: float = param(0.10, "m", -0.4, 0.4)
    rod_yaw: float = param(0.0, "deg", -180.0, 180.0, period=360.0)  # yaw of the rod; at 0 the lead is at +y or -y
    ridge_x: float = param(0.06, "m", -0.4, 0.4)
    ridge_y: float = param(-0.06, "m", -0.4, 0.4)
    ridge_yaw: float = param(0.0, "deg", -90.0, 90.0, period=180.0)  # yaw of the ridge; at 0 it runs along x
    rod: InlaidRod = InlaidRod()
    ridge: Ridge = Ridge(height=0.05)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = super().build()
        remember(scene, "alone")
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return bool(world.tilt("rod") <= MAX_TILT and rests_on(world, "rod", RIDGE))

    def failure(self, world: World) -> str | None:
        return "the rod fell off the table" if fallen(world, "rod") else None

    def means(self) -> Mapping[str, Mean]:
        def steady(world: World) -> bool:
            return world.tilt("rod") < STEADY_TILT and still(world, "rod", STEADY_SPEED)

        def dropped(world: World) -> bool:
            return world.velocity("rod")[5] < -MAX_FALL_SPEED and not world.touching_bodies("rod")

        return {
            **self.release("the rod stood upright and at rest as the jaw opened", steady),
            "the rod was not dropped": throughout(lambda world: not dropped(world)),
            "a rod that stood by itself was not touched again": throughout(
                lambda world: not (self.released(world) and world.touching(ROBOT, "rod"))
            ),
        }

    def released(self, world: World) -> bool:
        """Whether the rod has stood on the ridge without the robot."""
        return world.memory["alone"] >= RELEASE_TIME

    def events(self, world: World) -> None:
        """Count for how long the rod has been on the ridge without the robot [s]."""
        if self.released(world):
            return
        alone = world.touching("rod", RIDGE) and not world.touching(ROBOT, "rod")
        count_time(world, "alone", alone)

    def pending(self, world: World) -> bool:
        return False

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Take the rod at its upper end, set it down with its centre of mass over the ridge, let it go."""
        yield from self.lift(world)
        yield from self.stand(world, self.rod.com)

    def lift(self, world: World) -> Plan:
        """Take the rod at its upper end. The fingers close along the ridge, the direction in which it cannot tip."""
        arm, above = world.arm, 0.06
        grip = world.pos("rod") + (self.rod.height - GRIP_DEPTH) * UP
        yield from go_to(arm, [*arm.hand[:2], max(arm.hand[2], grip[2] + above)], pace=COARSE, grip=OPEN)
        yield from pick(arm, grip, world.rot("rod")[:, 0], above=above, lift=LIFT_HEIGHT)

    def stand(self, world: World, across: float) -> Plan:
        """Set the held rod upright on the ridge and release it.

        Args:
            across: place of the foot, along the rod's y from its middle, that comes over the ridge's middle [m].
        """
        yield from self.bring(world, across)
        yield from self._set_down(world)
        yield from self.leave(world)

    def _set_down(self, world: World) -> Plan:
        """Lower the held rod until it touches the ridge."""
        yield from push(world.arm, -0.02 * UP, until=lambda: world.touching("rod", RIDGE))

    def leave(self, world: World) -> Plan:
        """Open the jaw and go straight up, slowly while the fingers are beside the rod."""
        yield from let_go(world.arm, 0.03, seconds=0.3, pace=Pace(0.05, 0.003))
        yield from retreat(world.arm, 0.06)

    def bring(self, world: World, across: float, height: float = 0.004) -> Plan:
        """Bring the held rod upright over the ridge, with its foot `height` [m] above it; see `stand`.

        After each move the rod swings in the hand for 0.2 s. Then its remaining error is added to the next target: the
        friction of the joints leaves a hand 1 mm short.
        """
        rot, short = self.aligned(world), np.zeros(3)
        target = self.top + self.rod.height / 2 * UP + (self.rod.com - across) * rot[:, 1]
        slow, aim = Pace(0.08, 0.002), Pace(0.03, 0.0015)
        for above, pace in ((0.06, STEADY), (height + 0.008, FINE), (height + 0.002, slow), *[(height, aim)] * 3):
            yield from carry(world.arm, "rod", target + short + above * UP, rot, pace)
            yield from hold(world.arm, 0.2)
            if pace is aim:
                short = short + target + above * UP - world.com("rod")

    def aligned(self, world: World) -> Mat3:
        """The nearest orientation of an upright rod with a side along the ridge."""
        yaw = math.radians(self.ridge_yaw)
        rod = math.atan2(*world.rot("rod")[1::-1, 0])
        return about_z(rod + math.remainder(yaw - rod, math.pi / 2))

    def steps(self) -> Mapping[str, Planner]:
        return {
            "take_top": self.lift,
            "bring_over": lambda world: self.bring(world, self.rod.com),
            "set_down": self._set_down,
            "let_go": self.leave,
            "stays": lambda world: wait(world.arm, lambda: self.success(world), give_up=4.0),
            "drop_rod": self._drop_held,
            "lay_across": self._lay_held,
            "hold_on": lambda world: hold(world.arm, 3 * self.HOLD),
        }

    # --- shortcuts and ablations ------------------------------------------------------------

    @cached_property
    def lopsided(self) -> bool:
        """Whether the rod falls if it is turned as little as possible and its foot is centred on the ridge."""
        across = abs(math.remainder(self.rod_yaw - self.ridge_yaw, 180.0)) < 45.0
        return across and abs(self.rod.com) >= self.ridge.width / 2 + MISS_MARGIN

    def shortcuts(self) -> Mapping[str, Shortcut]:
        """The shortcut that ignores the lead is included only if the rod then falls."""
        return {
            **({"by_the_middle_of_the_foot": Shortcut(self._by_the_foot)} if self.lopsided else {}),
            "drop_it_from_above": Shortcut(self._drop),
            "let_go_in_motion": Shortcut(self._slide),
            "lay_it_across": Shortcut(self._lay),
            "hold_it_there": Shortcut(self._hold),
            "stand_it_on_the_plate": Shortcut(self._beside),
        }

    def _by_the_foot(self, world: World) -> Plan:
        """Set the middle of the foot on the ridge."""
        yield from self.lift(world)
        yield from self.stand(world, 0.0)

    def _drop(self, world: World) -> Plan:
        """Let the rod fall on the ridge."""
        yield from self.lift(world)
        yield from self._drop_held(world)

    def _drop_held(self, world: World) -> Plan:
        """Let the held rod fall on the ridge."""
        yield from self.bring(world, self.rod.com, DROP_HEIGHT)
        yield from self.leave(world)

    def _slide(self, world: World) -> Plan:
        """Release the rod on the ridge while the hand moves across it."""
        yield from self.lift(world)
        yield from self.bring(world, self.rod.com)
        arm, across = world.arm, self.normal
        yield from go_to(arm, arm.hand - 0.05 * across)
        yield from push(arm, SLIDE_SPEED * across, until=lambda: bool((world.com("rod") - self.top) @ across > -0.012))
        yield from push(arm, SLIDE_SPEED * across, until=elapsed(world, 0.25), grip=OPEN)
        yield from retreat(arm, 0.08)

    def _lay(self, world: World) -> Plan:
        """Lay the rod level across the ridge, with its centre of mass over it."""
        yield from self.lift(world)
        yield from self._lay_held(world)

    def _lay_held(self, world: World) -> Plan:
        """Lay the held rod level across the ridge, with its centre of mass over it."""
        yield from self.bring(world, self.rod.com, LIFT_HEIGHT)
        arm, start = world.arm, world.arm.hand_rot
        level = np.column_stack([start[:, 0], -start[:, 2], start[:, 1]])
        yield from turn_to(arm, level, within=0.1)
        for above, pace in ((0.04, STEADY), (self.rod.width / 2 + 0.004, Pace(0.05, 0.002))):
            yield from carry(arm, "rod", self.top + above * UP, pace=pace)
        yield from self.leave(world)

    def _hold(self, world: World) -> Plan:
        """Hold the rod upright on the ridge."""
        yield from self.lift(world)
        yield from self.bring(world, self.rod.com)
        yield from self._set_down(world)
        yield from hold(world.arm, 3 * self.HOLD)

    def _beside(self, world: World) -> Plan:
        """Stand the rod on the plate, beside the ridge and against it."""
        yield from self.lift(world)
        beside = (self.ridge.width + self.rod.width) / 2 + 0.004
        across = math.copysign(1.0, float(self.aligned(world)[:, 1] @ self.normal)) * self.normal
        yield from self.bring(world, self.rod.com, 0.03)
        yield from go_to(world.arm, world.arm.hand + beside * across)
        yield from push(world.arm, -0.05 * UP, until=lambda: world.touching("rod", "stand"))
        yield from push(world.arm, -0.03 * across, until=lambda: world.touching("rod", RIDGE))
        yield from self.leave(world)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Without the ridge the rod has no support; with the lead on the other side a lopsided rod falls."""
        scene = self.build()
        scene.delete(scene.geom("stand/wall"))
        other = replace(self, rod=replace(self.rod, com=-self.rod.com))
        return {"no_ridge": scene, **({"lead_on_the_other_side": other.build()} if self.lopsided else {})}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        return {
            "foot_beside_ridge": around(-self.rod.com, self.ridge.width / 2 - 0.002, "rod.com"),
            "hand_turns": choice(side_of(self.ridge_yaw - self.rod_yaw), "rod_yaw", "ridge_yaw"),
            "ridge": near(self.foot, 0.004, "ridge_x", "ridge_y", "ridge_yaw"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        rod, ridge = self.rod, self.ridge
        yield require(rod.possible, "no inlay displaces the centre of mass so much", com=rod.com, width=rod.width)
        yield require(rod.width < OPEN_GAP - 0.01, "the jaw does not open wide enough", width=rod.width, gap=OPEN_GAP)
        off, half = abs(rod.com), ridge.width / 2
        edge = min(half, rod.width / 2 - off)
        yield require(edge >= HOLD_MARGIN, "the centre of mass has no support", edge=edge, needed=HOLD_MARGIN)
        yield require(rod.width > ridge.width, "the rod is narrower than the ridge", rod=rod.width, ridge=ridge.width)
        weight, grip = rod.mass * GRAVITY, 0.5 * pinch(rod.width) * rod.friction
        yield require(weight <= grip, "the rod slips out of the grip", weight=weight, grip=grip)
        yield on_table("the rod or the stand", [*self.outline, *self.stand_outline])
        air = gap(self.hand_over_rod, self.stand_outline)
        yield require(air >= 0.0, "the hand has no room beside the stand", air=air)
        yield within_reach("the rod", self.start + (rod.height + LIFT_HEIGHT) * UP)
        yield within_reach("the hand over the ridge", self.top + (rod.height + 0.08) * UP)

    def features(self) -> Mapping[str, float]:
        """Tilts at which the rod tips, centred and as it is [rad], heights of ridge and grip [m], section [m]."""
        half, middle = self.ridge.width / 2, self.rod.height / 2
        return {
            "tipping_tilt": math.atan2(half, middle),
            "centre_of_mass": abs(self.rod.com) / half,
            "ridge_top": self.ridge.height,
            "grip_height": self.rod.height - GRIP_DEPTH,
            "section": self.rod.width,
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "rod": way_to(self.start, self.foot),
            "apart": math.dist(self.start[:2], self.foot[:2]),
            "height": self.rod.height,
            "ridge": self.ridge.height,
            "dark": "yes" if self.rod.com else "no",
        }
