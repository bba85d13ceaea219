"""T19 seesaw-balance: level a seesaw with a counterweight of unknown mass, by trying and looking.

                 o
      [t]   _____|_____   [w] ?        side view; +s runs from the axle to the right
    --------------|--------------
                 / \\

Bottleneck: the place of the counterweight follows from three masses that are not visible. The tilt reveals them.

The seesaw is a balance, not a plank on an edge (assets/seesaw.py): between stops at 10 deg its tilt is proportional to
the excess moment. The counterweight may stand within tan(5 deg) * stiffness / (its mass), in training some 5 to 8 mm,
of the balancing place, which can be anywhere on an arm of 0.36 m. Chance, for a policy that sees the geometry and knows
how masses are distributed: the best single guess levels the deck in 7 % of training, one of three guesses in 19 %. Five
fixed places fit into 30 s; tried one after the other, with a look whether the deck is level, they solve 10 of 48. In
training the place is always on the arm opposite the target. Weighing the counterweight alone does not help. A hand with
a sense of force finds the place without a trial in half of training: it presses the raised arm down until the deck is
level, and weighs the counterweight (docs/cheats.md). So the task requires a torque balance, by trial or by force.

Decisions where the paper is silent (it gives the story, the 5 deg, the pivot offset and the mass of the beam):

* All masses are hidden; blocks and beam look the same at any mass. Visible facts may be used: geometry, and
  which side is down. The oracle starts in the middle of the raised arm and learns only from tilts.
* An obvious first place must not balance: the mirror image of the target's, and the one that follows if blocks that
  look alike weigh alike.
* The beam counts: its middle is off the axle. It can even outweigh the target, and then both blocks belong on the same
  arm.
* The deck must be level without the hand, with both blocks standing on the deck and nowhere else: otherwise the hand
  could hold the beam, or the counterweight could prop it up from the table. It must stay level: the beam also sweeps
  through level on its way from stop to stop. The target stays untouched: moved by a few mm it would level what a guess
  has missed.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from ..assets.box import Block
from ..assets.prop import TABLE_TOP, place, remove, table
from ..assets.seesaw import Seesaw, standing
from ..decisions import Decision, around, choice, near
from ..errors import GaveUp
from ..geometry import UP, Mat3, Vec3, about_z, compound, heading, quat, spoken
from ..means import Mean, throughout, when
from ..params import param, with_values
from ..predicates import fallen
from ..robots.jaw import PALM_ALONG
from ..robots.panda import WRIST_MIDDLE
from ..scenario import Answer, Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT
from ..sim.world import World
from ..skills.jaw import pick, put
from ..skills.motion import CLOSED, COARSE, OPEN, STEADY, facing_down, go_to, hold, push, retreat, wait

MAX_TILT = math.radians(5.0)
"""Largest tilt that counts as level [rad] (paper, App. B, T19)."""
SAFE_TILT = math.radians(4.5)
"""Tilt at which the oracle stops [rad]: a beam that creeps by 0.01 rad/s may move on by another 0.4 deg."""
MIN_SHORTCUT_TILT = math.radians(7.0)
"""Least tilt that a tempting place must cause [rad]: level, and the change that a misplacement by 2 mm can cause."""
TARGET_TOLERANCE = 0.006
"""Distance that the target may move along the deck [m]. A counterweight that is released far out throws the deck
against its stop, and the target hops by up to 3 mm; a hand that strikes the deck three times moves it by up to 7."""
MIN_STOP_ERROR = 0.006
"""Least distance from balance of a counterweight that puts the deck on its stop [m]: 1.5 times the least margin."""
MIN_LEVER = 0.055  # least distance of the middle of a block from the axle, at which the palm passes the posts [m]
DECK_MARGIN = 0.004  # least length of deck beyond a block [m]
EXPECTED_MASSES = {"seesaw.mass": 0.25, "target.mass": 0.30, "weight.mass": 0.30}
"""Masses that a guess assumes [kg]: a common beam, and blocks that look alike weighing alike."""
CARRY_HEIGHT = 0.25
"""Height over the table of a hand that carries a block [m]: 20 mm over a block 0.35 m out on a raised arm."""
BEAM = "seesaw/beam"


@dataclass(frozen=True, kw_only=True)
class SeesawBalance(Scenario):
    """A seesaw with the target on its deck, and a counterweight on the table in front of it."""

    VERSION = 2
    HOLD = 3.0
    """Time for which the deck must stay level [s]. On its way to 6 deg on the other side it creeps through +-5 deg in
    (damping / stiffness) ln(11 / 1) = 0.12 / 0.15 x 2.4 = 1.9 s, for the softest seesaw of training."""

    x: float = param(0.0, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    heading: float = param(90.0, "deg", -180.0, 180.0, period=360.0)  # direction of +s
    offset: float = param(0.14, "m", -0.35, 0.35)  # offset of the target from the axle, along the deck
    weight_x: float = param(-0.17, "m", -0.4, 0.4)
    weight_y: float = param(0.0, "m", -0.4, 0.4)
    weight_yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)  # angle of the counterweight to the heading
    seesaw: Seesaw = Seesaw()
    target: Block = Block(rgba=(0.78, 0.10, 0.10, 1.0))
    weight: Block = Block()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene, yaw, tilt = table(), math.radians(self.heading), self.tilt_at(None)
        # With Newton's method blocks chatter on a deck that turns freely, and creep by 1 mm/s when it leans by 5 deg.
        scene.option.solver = mujoco.mjtSolver.mjSOL_CG
        place(scene, replace(self.seesaw, tilt=tilt), "seesaw", self.foot, yaw, free=False)
        place(scene, self.weight, "weight", self.start, yaw + math.radians(self.weight_yaw))
        turn = compound(quat("z", yaw), quat("y", tilt))
        place(scene, self.target, "target", self.on_deck(self.offset, tilt), turn=turn)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        blocks = world.free_bodies
        return (
            world.tilt(BEAM) <= MAX_TILT
            and abs(self.along(world, "target") - self.offset) <= TARGET_TOLERANCE
            and all(world.touching_bodies(block).difference(blocks) == {BEAM} for block in blocks)
            and not world.touching(ROBOT, BEAM)
        )

    def failure(self, world: World) -> str | None:
        return "a block fell off the table" if fallen(world, *world.free_bodies) else None

    def means(self) -> Mapping[str, Mean]:
        def moved(world: World) -> bool:
            others = {"table", ROBOT, *world.free_bodies} - {"target"}
            return any(world.touched(other, "target") for other in others)

        return {
            "the target stayed where it stood, untouched": throughout(lambda world: not moved(world)),
            "the jaw set the counterweight on the deck": when(
                lambda world: "weight" in world.touching_bodies(BEAM), lambda world: world.arm.grips("weight")
            ),
        }

    def along(self, world: World, block: str) -> float:
        """Place of a block along the deck, from the axle [m]."""
        return float(world.rot(BEAM)[:, 0] @ (world.pos(block) - world.pos(BEAM)))

    def tilt(self, world: World) -> float:
        """Tilt of the deck, positive where +s is down [rad]."""
        return -math.asin(float(world.rot(BEAM)[2, 0]))

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Put the counterweight down, look, and narrow the remaining stretch of the arm until the deck is level.

        Reads no mass. A deck on its stop shows the direction of the error, which is at least `MIN_STOP_ERROR`. Between
        the stops the tilt is proportional to the error, by a factor that is half to twice the expected one.
        """
        low, high = self._ends
        along = (low + high) / 2
        while True:
            yield from self.put_at(world, self.nearest(self.raised, along))
            if abs(self.tilt(world)) <= SAFE_TILT:
                return
            low, high, along = self._narrowed(world, low, high)

    @cached_property
    def _ends(self) -> tuple[float, float]:
        """Ends of the raised arm between which the balancing place is [m]."""
        return self.nearest(self.raised, -1.0), self.nearest(self.raised, 1.0)

    def _narrowed(self, world: World, low: float, high: float) -> tuple[float, float, float]:
        """The stretch in which the balancing place is, given how the deck stands now, and the next place to try [m].

        Raises:
            GaveUp: no such stretch is left.
        """
        tilt, stood = self.tilt(world), self.along(world, "weight")
        stopped = abs(tilt) > self.seesaw.steepest - math.radians(1.0)
        past = stood - math.copysign(MIN_STOP_ERROR if stopped else 0.0, tilt)
        low, high = (low, min(high, past)) if tilt > 0 else (max(low, past), high)
        if high - low < 0.004:
            raise GaveUp("the balancing place was not found")
        there = stood - math.tan(tilt) / math.tan(MAX_TILT) * with_values(self, EXPECTED_MASSES).margin
        return low, high, (low + high) / 2 if stopped or not low < there < high else there

    def put_at(self, world: World, along: float, block: str = "weight") -> Plan:
        """Put a block on the deck, release it, and wait until the deck is at rest; if it is level, wait for `HOLD`."""
        yield from self._take(world, block)
        yield from self._set_on(world, along, block)
        yield from self._settle(world)

    def _take(self, world: World, block: str) -> Plan:
        """Grasp a block and lift it over the deck."""
        arm, at = world.arm, world.com(block)
        lift = TABLE_TOP + CARRY_HEIGHT - at[2]
        yield from go_to(arm, at + lift * UP, self.down, COARSE, OPEN)
        yield from pick(arm, at, closing=world.rot(block)[:, 1], above=lift, lift=lift, pace=STEADY)

    def _set_on(self, world: World, along: float, block: str) -> Plan:
        """Put the held block on the deck and release it."""
        arm, spot = world.arm, self.on_deck(along, self.tilt(world))
        yield from go_to(arm, [*spot[:2], TABLE_TOP + CARRY_HEIGHT], self.down, COARSE)
        yield from put(arm, block, spot + world.com(block) - world.pos(block), on=BEAM, hover=0.02)
        yield from retreat(arm, 0.08)

    def _settle(self, world: World) -> Plan:
        """Wait until the deck is at rest; if it is level, for `HOLD`."""
        arm, before = world.arm, math.inf
        while abs(self.tilt(world) - before) > 0.002:  # a deck that bounces is at rest for a moment
            before = self.tilt(world)
            yield from hold(arm, 0.2)
        if world.tilt(BEAM) <= SAFE_TILT:
            yield from hold(arm, self.HOLD)

    def steps(self) -> Mapping[str, Planner]:
        search = list(self._ends)

        def correct(world: World) -> Plan:
            if abs(self.tilt(world)) > SAFE_TILT:
                *search[:], along = self._narrowed(world, *search)
                yield from self.put_at(world, self.nearest(self.raised, along))

        return {
            "take_weight": lambda world: self._take(world, "weight"),
            "put_on_arm": lambda world: self._set_on(world, self.nearest(self.raised, sum(search) / 2), "weight"),
            "look": self._settle,
            "correct": correct,
            "level": lambda world: wait(world.arm, lambda: self.success(world), give_up=4.0),
            "hold_level": self._hold_level,
            "move_target": self._shift,
        }

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "mirror_the_target": Shortcut(lambda world: self.put_at(world, self.mirror)),
            "put_it_once": Shortcut(lambda world: self.put_at(world, self.guess)),
            "hold_the_deck_level": Shortcut(self._hold_level),
            "shift_the_target": Shortcut(self._shift),
        }

    def _hold_level(self, world: World) -> Plan:
        """Put the counterweight at the mirror image and hold the deck level by hand: it is level, but not balanced."""
        yield from self.put_at(world, self.mirror)
        arm, side = world.arm, -1 if self.tilt(world) > 0 else 1
        spot = self.on_deck(side * (self.seesaw.arm(side) - 0.02), self.tilt(world))
        yield from go_to(arm, [*spot[:2], TABLE_TOP + CARRY_HEIGHT], pace=COARSE, grip=CLOSED)
        yield from push(arm, -0.08 * UP, until=lambda: side * self.tilt(world) > 0)
        yield from hold(arm, 1.2 * self.HOLD)
        yield from retreat(arm, 0.08)

    def _shift(self, world: World) -> Plan:
        """Miss the balancing place by a little, and level the deck by moving the target instead."""
        miss = 1.4 * self.margin
        moved = min(TARGET_TOLERANCE - 0.002, miss * self.weight.mass / self.target.mass)
        yield from self.put_at(world, self.balance - math.copysign(miss, self.balance))
        yield from self.put_at(world, self.offset + math.copysign(moved, self.balance), "target")

    def answer(self) -> Answer:
        """Place on the raised arm, by its distance beyond the target's [m]. No share of the target's offset or of the
        arm, no distance from the axle and no lever law with fixed ratios of masses balances more of training."""

        def at(beyond: float) -> float:
            return self.nearest(self.raised, self.raised * (abs(self.offset) + beyond))

        beyond = tuple(round(0.01 * k, 2) for k in range(-12, 21))
        return Answer(beyond, lambda w, b: self.put_at(w, at(b)), lambda b: abs(self.tilt_at(at(b))) <= MAX_TILT)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        scene = self.build()
        remove(scene, "weight")
        return {"no_counterweight": scene}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        at = np.array([self.x, self.y, 0.0]) + self.balance * heading(self.heading)
        masses = ("target.mass", "weight.mass", "seesaw.mass")
        return {
            "arm_beside_the_target": choice("other" if self.raised * self.offset < 0 else "the same", *masses),
            "place_on_the_arm": around(abs(self.balance), self.margin, *masses),
            "place_on_the_table": near(at, self.margin, *masses),
            "beyond_the_target": choice(bool(abs(self.balance) > abs(self.offset)), *masses),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        """Checks of the arrangement for any masses, of the lever law against the free places, and of guesses."""
        deck, lever = self.seesaw, abs(self.offset)
        far = deck.arm(1 if self.offset > 0 else -1) - self.target.width / 2 - DECK_MARGIN
        yield require(MIN_LEVER <= lever <= far, "the target has no room on its arm", offset=lever, farthest=far)
        yield on_table("the stand or the counterweight", [self.foot, self.start], margin=0.05)
        yield require((air := deck.height - deck.thickness - deck.dip) >= 0.0, "the deck strikes the table", air=air)
        beside = abs(float(heading(self.heading + 90.0) @ (self.start - self.foot))) - deck.width / 2 - PALM_ALONG
        yield require(beside >= 0.006, "the hand cannot take the counterweight beside the seesaw", beside=beside)
        grip, need = max(deck.friction, min(self.target.friction, self.weight.friction)), 1.5 * math.tan(deck.steepest)
        yield require(grip >= need, "blocks slide on the tilted deck", friction=grip, needed=need)
        at, margin, spans = self.balance, self.margin, self.spans(self.raised)
        yield require(bool(spans), "the raised arm has no room", arm=deck.arm(self.raised))
        room = max(min(high, at + margin) - max(low, at - margin) for low, high in spans)
        # 4 mm to either side, three times the error of a placement.
        yield require(room >= 0.008, "no place on the deck balances with room to spare", balance=at, room=room)
        yield within_reach("a place of the counterweight", self.on_deck(at, 0.0) + self.weight.height * UP, self.start)
        alone = abs(self.tilt_at(None))
        yield require(alone >= deck.steepest, "the seesaw is not on its stop at the start", tilt=alone)
        for what, along in ("mirror image of the target's place", self.mirror), ("first guess", self.guess):
            tilt = abs(self.tilt_at(along))
            yield require(tilt >= MIN_SHORTCUT_TILT, f"the {what} balances", tilt=tilt, needed=MIN_SHORTCUT_TILT)

    def features(self) -> Mapping[str, float]:
        """Torque to be balanced over that of a counterweight at the mirror image, and balancing place [m].

        And, in half lengths of the beam, the distances of the axle from its middle and of the target from the axle.
        """
        half = self.seesaw.length / 2
        return {
            "torque_ratio": -self.balance / self.offset,
            "place_of_balance": self.balance,
            "axle_off_middle": abs(self.seesaw.pivot_offset) / half,
            "target_lever": self.offset / half,
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "raised": spoken(self.heading + (0.0 if self.raised > 0 else 180.0)),
            "lever": abs(self.offset),
            "long_arm": self.seesaw.length / 2 + abs(self.seesaw.pivot_offset),
        }

    # --- statics and geometry -------------------------------------------------------------

    def tilt_at(self, along: float | None) -> float:
        """Tilt with the counterweight at `along` [m], or without it [rad]."""
        target = standing(self.target, self.offset)
        return self.seesaw.rest([target] if along is None else [target, standing(self.weight, along)])

    @cached_property
    def raised(self) -> int:
        """Arm that is up at the start and must carry the counterweight, -1 or 1."""
        return -1 if self.balance < 0 else 1

    @cached_property
    def balance(self) -> float:
        """Place at which the counterweight levels the deck exactly, along s [m]: m_w s_w = -(m_t s_t + m_b s_b)."""
        return -self.seesaw.moment([standing(self.target, self.offset)]) / self.weight.mass

    @cached_property
    def margin(self) -> float:
        """Distance from `balance` up to which the tilt stays within `MAX_TILT` [m]."""
        stiffness = self.seesaw.stiffness([standing(block, 0.0) for block in (self.target, self.weight)])
        return math.tan(MAX_TILT) * stiffness / self.weight.mass

    @cached_property
    def guess(self) -> float:
        """Place on the raised arm that would balance with `EXPECTED_MASSES`, as far as the arm reaches [m]."""
        return self.nearest(self.raised, with_values(self, EXPECTED_MASSES).balance)

    @cached_property
    def down(self) -> Mat3:
        """Orientation of a hand that closes along the axle, on faces that no tilt turns, far from joint 7's limits."""
        return facing_down(WRIST_MIDDLE + math.remainder(math.radians(self.heading) - WRIST_MIDDLE, math.pi))

    @cached_property
    def foot(self) -> Vec3:
        """Point on the table below the axle [m]."""
        return np.array([self.x, self.y, TABLE_TOP])

    @cached_property
    def start(self) -> Vec3:
        """Foot of the counterweight on the table [m]."""
        return np.array([self.weight_x, self.weight_y, TABLE_TOP])

    @cached_property
    def mirror(self) -> float:
        """Place opposite to the target, as far as the deck reaches [m]."""
        return self.nearest(-1 if self.offset > 0 else 1, -self.offset)

    def spans(self, side: int) -> list[tuple[float, float]]:
        """Stretches of one arm, -1 or 1, on which the counterweight's middle can be [m]; see `Seesaw.stretches`."""
        half = self.weight.width / 2 + DECK_MARGIN
        return self.seesaw.stretches(side, MIN_LEVER, half, taken=self.offset, apart=0.056)

    def nearest(self, side: int, along: float) -> float:
        """Place on one arm that is nearest to `along` [m]."""
        near = [min(max(along, low), high) for low, high in self.spans(side)]
        return min(near, key=lambda at: abs(at - along))

    def on_deck(self, along: float, tilt: float) -> Vec3:
        """Point of the deck's upper face at `along` [m] when it is tilted [rad], in the world [m]."""
        return self.foot + about_z(math.radians(self.heading)) @ self.seesaw.on_deck(along, tilt)
