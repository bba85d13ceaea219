"""rod_across, a task of our own: lay a rod across a narrow ridge so that it stays level by itself.

        ______________________[#]____
                            |_|              side view; a heavy slug is hidden somewhere inside the rod
        ____________________|_|_____

Bottleneck: the centre of mass must be over the ridge, which is 12 mm wide, and it is not visible. A held rod
reveals it: the torque at the wrist over the rod's weight is the distance of the centre of mass from the hand. No goal
counts after a failed attempt, so the robot must know the place before it releases the rod.

Decisions (the paper has no such task: its rods stand on the ridge, see `balance`; the 10 deg are theirs, here of the
rod's upward side):

* The rod has to cross the ridge within 30 deg of a right angle: along the ridge it needs no balance.
* If the centre of mass were always in the middle, the middle of the rod over the middle of the ridge would solve every
  scene. Here it is up to 9 cm to either side, never near the middle, and the weight of the rod is unknown too: the
  torque alone does not suffice. Chance: one fixed place along the rod balances 9 % of training.
* The jaw opens once, on a level rod, and leaves it alone. A jaw that is loosened on the ridge, catches the rod at 1 to
  4 deg and halves the stretch finds the place in 4 to 6 trials (12 of 12). That is labelled.
* The same trials over the table's edge, before the rod comes to the ridge, are another way to find the centre of mass,
  and fair (2 of 6).
"""

import math
from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from ..assets.ridge import Ridge
from ..assets.rod import SLUG_EDGE, Rod
from ..decisions import Decision, around, choice, near, side_of
from ..errors import GaveUp
from ..geometry import UP, Vec3, about_z, gap, shortest, way_to
from ..means import Mean, once
from ..params import param
from ..physics import GRAVITY
from ..predicates import borne, fallen, rests_on, still
from ..robots.jaw import PAD, pinch
from ..robots.panda import WRIST_MIDDLE
from ..scenario import Action, Answer, Plan, Planner, Refutation, Shortcut, on_table, require, within_reach
from ..sim.world import World
from ..skills.jaw import let_go, pick, weigh
from ..skills.motion import COARSE, OPEN, STEADY, Pace, closing_along, facing_down, go_to, hold, retreat, until
from .rod_and_ridge import MAX_TILT, RIDGE, RodAndRidge

CROSSING_TOLERANCE = math.radians(30.0)  # largest angle between the rod and the level normal of the ridge [rad]
STEADY_TILT = math.radians(6.0)
"""Largest tilt of a rod on which the jaw opens [rad]. As it comes down, a rod turns in the grip by up to 4.2 deg."""
REST_SPEED = 0.02  # speed below which a held rod is at rest [m/s]
MISS_MARGIN = 0.006
"""Least distance beyond the ridge's edge of the centre of mass of a rod that is laid by its middle [m]."""
LIFT_HEIGHT = 0.10  # height to which the rod is lifted to be weighed [m]
CARRY_HEIGHT = 0.015  # height over the ridge at which the rod is aligned [m]
MIN_WEIGHT = 0.1  # weight from which something hangs in the jaw [N], a tenth of the lightest rod
EXPECTED_MASS = 0.125  # mass that a guess assumes without having weighed the rod [kg]: the middle of training


@dataclass(frozen=True, kw_only=True)
class RodAcross(RodAndRidge[Rod]):
    """A rod with a hidden centre of mass on the table, and a ridge."""

    VERSION = 2
    HOLD = 1.0

    rod_x: float = param(-0.16, "m", -0.4, 0.4)
    rod_y: float = param(0.0, "m", -0.4, 0.4)
    rod_yaw: float = param(0.0, "deg", -90.0, 90.0, period=180.0)  # yaw of the rod; at 0 it lies along y
    ridge_x: float = param(0.06, "m", -0.4, 0.4)
    ridge_y: float = param(0.0, "m", -0.4, 0.4)
    ridge_yaw: float = param(0.0, "deg", -90.0, 90.0, period=180.0)  # yaw of the ridge; at 0 it runs along x
    rod: Rod = Rod(com=0.05)
    ridge: Ridge = Ridge()

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        crossing = abs(world.rot("rod")[:, 1] @ self.normal) >= math.cos(CROSSING_TOLERANCE)
        return bool(world.tilt("rod") <= MAX_TILT and crossing and rests_on(world, "rod", RIDGE))

    def failure(self, world: World) -> str | None:
        return "the rod fell off the table" if fallen(world, "rod") else None

    def means(self) -> Mapping[str, Mean]:
        return {
            "the jaw bore the rod at rest in the air": once(
                lambda world: borne(world, world.arm, "rod") and still(world, "rod", REST_SPEED)
            ),
            **self.release("the rod lay level as the jaw opened", lambda world: world.tilt("rod") < STEADY_TILT),
        }

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Grasp the rod in the middle, measure its centre of mass, lay it down with that over the ridge.

        Raises:
            GaveUp: the hand feels no weight.
        """
        yield from self.lift(world)
        weight, torque = yield from self.feel(world)
        if weight <= 0.0:
            raise GaveUp("the hand holds no weight")
        yield from self.lay(world, self.held_at(world) + torque / weight)

    def lift(self, world: World) -> Plan:
        """Grasp the rod in the middle, with joint 7 as far from its limits as possible: it must turn further."""
        arm, closing = world.arm, world.rot("rod")[:, 0]
        # 4 mm above the middle of the rod, the finger tips stay 7 mm over the ridge.
        middle = world.pos("rod") + (self.rod.width / 2 + 0.004) * UP
        yaw = WRIST_MIDDLE + math.remainder(math.atan2(-closing[0], closing[1]) - WRIST_MIDDLE, math.pi)
        yield from go_to(arm, middle + LIFT_HEIGHT * UP, facing_down(yaw), COARSE, OPEN)
        yield from pick(arm, middle, closing, lift=LIFT_HEIGHT)

    def feel(self, world: World) -> Generator[Action, None, tuple[float, float]]:
        """Weight of the held rod [N], and its torque about the hand [N m], positive if its far end goes down."""
        load = yield from weigh(world.arm)
        return float(load[2]), float(np.cross(world.rot("rod")[:, 1], UP) @ load[3:])

    def held_at(self, world: World) -> float:
        """Place of the hand along the rod, from its middle [m]."""
        return float((world.arm.hand - world.pos("rod")) @ world.rot("rod")[:, 1])

    def lay(self, world: World, along: float, yaw: float = 0.0) -> Plan:
        """Lay the held rod across the ridge and release it.

        Args:
            along: place of the rod that comes over the ridge, from its middle [m].
            yaw: angle to the ridge's normal [rad].
        """
        yield from self.bring(world, along, yaw)
        yield from self._leave(world)

    def _leave(self, world: World) -> Plan:
        """Open the jaw and go straight up, slowly while the fingers are beside the rod."""
        yield from let_go(world.arm, 0.03, pace=Pace(0.05, 0.003))
        yield from retreat(world.arm, 0.05)

    def bring(self, world: World, along: float, yaw: float = 0.0) -> Plan:
        """Bring the held rod over the ridge, level it, lower it until it touches; see `lay`."""
        across = self._across(world, yaw)
        yield from self._hold_over(world, along, across)
        yield from self._set_down(world, along, across)

    def _across(self, world: World, yaw: float = 0.0) -> Vec3:
        """Direction of the rod at `yaw` to the ridge's normal [rad] that the nearer of two wrist angles gives it."""
        arm, across = world.arm, about_z(yaw) @ self.normal
        wrist = closing_along(arm, np.cross(across, UP)) @ arm.hand_rot.T
        return math.copysign(1.0, float(wrist @ world.rot("rod")[:, 1] @ across)) * across

    def _hold_over(self, world: World, along: float, across: Vec3) -> Plan:
        """Bring the held rod over the ridge, level, in the direction `across`."""
        # The rod is aligned to 1.5 mm, a quarter of what the narrower ridge forgives. After a move above the ridge it
        # swings in the hand for 0.25 s; the last move ends where it touches the ridge.
        for pace in (STEADY, Pace(0.08, 0.0015)):
            yield from self._align(world, along, across, CARRY_HEIGHT, pace)
            yield from hold(world.arm, 0.25)

    def _set_down(self, world: World, along: float, across: Vec3) -> Plan:
        """Lower the held rod until it touches the ridge."""
        yield from self._align(world, along, across, -0.03, Pace(0.03, 0.001))

    def _align(self, world: World, along: float, across: Vec3, height: float, pace: Pace) -> Plan:
        """Bring a place of the held rod to a height over the ridge [m], or until the rod touches it."""
        arm, rod = world.arm, world.rot("rod")[:, 1]
        turn, spot = shortest(rod, across), world.pos("rod") + along * rod
        there = self.top + height * UP + turn @ (arm.hand - spot)
        yield from until(go_to(arm, there, turn @ arm.hand_rot, pace), lambda: world.touching("rod", RIDGE))

    def steps(self) -> Mapping[str, Planner]:
        measured = list[float]()

        def feel(world: World) -> Plan:
            weight, torque = yield from self.feel(world)
            if weight < MIN_WEIGHT:
                raise GaveUp("nothing hangs in the jaw")
            measured.append(self.held_at(world) + torque / weight)

        def com(world: World) -> float:
            return measured[-1] if measured else self.held_at(world)

        return {
            "take_rod": self.lift,
            "feel": feel,
            "bring_over": lambda world: self._hold_over(world, com(world), self._across(world)),
            "lay_down": lambda world: self._set_down(world, com(world), self._across(world)),
            "let_go": self._leave,
            "middle_on_ridge": lambda world: self.lay(world, 0.0),
            "along": lambda world: self.lay(world, self.rod.com, math.pi / 2),
            "hold_on": lambda world: hold(world.arm, 2 * self.HOLD),
        }

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        """The shortcut with a guessed weight is included only if its error is wider than the ridge."""
        weight_matters = abs(self.rod.com * (self.rod.mass / EXPECTED_MASS - 1.0)) >= self.ridge.width / 2 + MISS_MARGIN
        return {
            "by_the_middle": Shortcut(lambda world: self._lay(world, 0.0)),
            "by_the_other_side": Shortcut(lambda world: self._lay(world, -self.rod.com)),
            "hold_it_there": Shortcut(self._hold),
            "along_the_ridge": Shortcut(lambda world: self._lay(world, self.rod.com, math.pi / 2)),
            **({"by_the_torque_alone": Shortcut(self._torque_alone)} if weight_matters else {}),
        }

    def _lay(self, world: World, along: float, yaw: float = 0.0) -> Plan:
        """Lift the rod and lay it down by a given place; see `lay`."""
        yield from self.lift(world)
        yield from self.lay(world, along, yaw)

    def _hold(self, world: World) -> Plan:
        """Hold the rod level on the ridge by hand: it is not balanced."""
        yield from self.lift(world)
        yield from self.bring(world, 0.0)
        yield from hold(world.arm, 2 * self.HOLD)

    def _torque_alone(self, world: World) -> Plan:
        """Measure the torque, and assume the weight of a common rod."""
        yield from self.lift(world)
        _, torque = yield from self.feel(world)
        yield from self.lay(world, self.held_at(world) + torque / (EXPECTED_MASS * GRAVITY))

    def answer(self) -> Answer:
        """Place along the rod, from its middle [m]. One try: no goal counts after a rod has tipped."""
        places = tuple(round(0.004 * k, 3) for k in range(-30, 31))
        right = self.ridge.width / 2
        return Answer(places, self._lay, lambda along: abs(along - self.rod.com) <= right, tries=1)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Without the ridge the rod has no support; with the slug elsewhere the witness's measurement is wrong."""
        scene = self.build()
        scene.delete(scene.geom("stand/wall"))
        elsewhere = replace(self, rod=replace(self.rod, com=-self.rod.com))
        return {"no_ridge": scene, "slug_elsewhere": elsewhere.build()}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        return {
            "heavy_end": choice(side_of(self.rod.com)),
            "place_along_the_rod": around(self.rod.com, self.ridge.width / 2),
            "ridge": near(self.foot, 0.006, "ridge_x", "ridge_y", "ridge_yaw"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        rod, ridge = self.rod, self.ridge
        room = (rod.length - SLUG_EDGE) / 2
        yield require(abs(rod.slug) <= room, "the slug sticks out of the rod", slug=abs(rod.slug), room=room)
        beyond = abs(rod.com) - ridge.width / 2
        needed = MISS_MARGIN
        yield require(beyond >= needed, "the rod balances on its middle", beyond_the_edge=beyond, needed=needed)
        # Of this height a rod that is laid wrongly tips by 15 % more than `MAX_TILT`.
        drop = 1.15 * math.sin(MAX_TILT) * (rod.length / 2 + abs(rod.com))
        yield require(ridge.height >= drop, "a rod laid wrongly does not tip", height=ridge.height, needed=drop)
        torque = rod.mass * GRAVITY * abs(rod.com)
        hold = pinch(rod.width) * rod.friction * PAD / 2
        yield require(torque <= hold, "the rod turns in the grip", torque=torque, grip=hold)
        yield on_table("the rod or the stand", [*self.outline, *self.stand_outline])
        air = gap(self.hand_over_rod, self.stand_outline)
        yield require(air >= 0.0, "the hand has no room beside the stand", air=air)
        yield within_reach("the rod", self.start + LIFT_HEIGHT * UP)
        far = self.top + CARRY_HEIGHT * UP + abs(rod.com) * np.array([[1.0], [-1.0]]) * self.normal
        yield within_reach("the hand over the ridge", *far)

    def features(self) -> Mapping[str, float]:
        """Balancing place in half lengths, tolerance in lengths, mass of the rod [kg], height of the ridge [m]."""
        return {
            "centre_of_mass": abs(self.rod.com) / (self.rod.length / 2),
            "tolerance": self.ridge.width / self.rod.length,
            "weight": self.rod.mass,
            "height": self.ridge.height,
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "rod": way_to(self.start, self.foot),
            "apart": math.dist(self.start[:2], self.foot[:2]),
            "length": self.rod.length,
            "ridge": self.ridge.height,
        }
