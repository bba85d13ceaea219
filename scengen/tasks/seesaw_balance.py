"""T19 seesaw-balance: level a seesaw with a counterweight of unknown mass, by trying and looking.

                 o
      [t]   _____|_____   [w] ?        side view; +s runs from the axle to the right
    --------------|--------------
                 / \\

Bottleneck: the place of the counterweight follows from three masses that nobody can see. The tilt tells.

The seesaw is a balance, not a plank on an edge (assets/seesaw.py): between stops at 10 deg its tilt is proportional to
the excess moment. The counterweight may stand within tan(5 deg) * stiffness / (its mass), in training some 5 to 8 mm,
of the balancing place, which lies anywhere on an arm of 0.36 m. Chance: a guess levels the deck in 7 % of training,
one of three in 19 %, at best, for who sees the geometry and knows how masses are distributed; so does who weighs.

Decisions where the paper is silent (it gives the story, the 5 deg, the pivot offset and the mass of the beam):

* All masses are hidden; blocks and beam look the same whatever they weigh. What can be seen, may be used: geometry,
  and which side is down. The oracle starts in the middle of the raised arm and learns only from tilts.
* A place that anybody would try first must not balance: the mirror image of the target's, and the one that follows
  if blocks that look alike weigh alike.
* The beam weighs in: its middle lies off the axle. It can even outweigh the target, and then both blocks belong on
  the same arm.
* Level counts only hands off, with both blocks standing on the deck and nowhere else: else the hand could hold the
  beam, or the counterweight could prop it up from the table. It must last: the beam also sweeps through level on its
  way from stop to stop. Who touches the target has lost: moved by a few mm it would level what a guess has missed.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from ..assets.box import Block
from ..assets.prop import TABLE_TOP, place, table
from ..assets.seesaw import Seesaw, standing
from ..errors import GaveUp
from ..geometry import UP, Mat3, Vec3, about_z, heading, quat
from ..params import param, with_values
from ..predicates import fallen
from ..robots.jaw import PALM_ALONG
from ..robots.panda import WRIST_MIDDLE
from ..scenario import Answer, Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import ROBOT, World
from ..skills.jaw import pick, put
from ..skills.motion import CLOSED, COARSE, OPEN, STEADY, facing_down, go_to, hold, push, retreat

LEVEL = math.radians(5.0)
"""Tilt that counts as level [rad] (paper, App. B, T19)."""
SURELY = math.radians(4.5)
"""Tilt with which the oracle is content [rad]: a beam that creeps by 0.01 rad/s may go on for another 0.4 deg."""
CLEARLY = math.radians(7.0)
"""Tilt that a tempting place must at least cause [rad]: level, and what a misplacement by 2 mm can change."""
STAYS = 0.006
"""How far the target may be from where it stood on the deck [m]. A counterweight that is let go far out throws the deck
against its stop, and the target hops by up to 3 mm; a hand that strikes the deck three times moves it by up to 7."""
ROOM = 0.008
"""Least deck on which the counterweight balances [m]: 4 mm to either side, three times the error of a placement."""
AMISS = 0.006
"""How far from balance, at least, a counterweight is that puts the deck on its stop [m]: 1.5 of the least margin."""
INNER, BESIDE = 0.055, 0.056
"""Least distance of the middle of a block from the axle, where the palm passes the posts; of two blocks [m]."""
RIM, AIR = 0.004, 0.006
"""Least deck beyond a block; least air between a deck and the palm of a hand that takes a block beside it [m]."""
EXPECTED = {"seesaw.mass": 0.25, "target.mass": 0.30, "weight.mass": 0.30}
"""What one would expect without having tried [kg]: a common beam, and blocks that look alike weighing alike."""
TRANSIT = TABLE_TOP + 0.25
"""Height of the hand when it carries a block across [m]: 20 mm over a block that stands 0.35 m out on a raised arm."""
BEAM = "seesaw/beam"


@dataclass(frozen=True, kw_only=True)
class SeesawBalance(Scenario):
    """A seesaw with the target on its deck, and a counterweight on the table in front of it."""

    HOLD = 3.0
    """How long the deck must stay level [s]. On its way to 6 deg on the other side it creeps through +-5 deg in
    (damping / stiffness) ln(11 / 1) = 0.12 / 0.15 x 2.4 = 1.9 s, for the softest seesaw of training."""

    x: float = param(0.0, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    heading: float = param(90.0, "deg", -180.0, 180.0, period=360.0)
    """Direction of +s."""
    offset: float = param(0.14, "m", -0.35, 0.35)
    """Of the target from the axle, along the deck."""
    weight_x: float = param(-0.17, "m", -0.4, 0.4)
    weight_y: float = param(0.0, "m", -0.4, 0.4)
    weight_yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)
    """Against the heading."""
    seesaw: Seesaw = Seesaw()
    target: Block = Block(rgba=(0.78, 0.10, 0.10, 1.0))
    weight: Block = Block()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene, yaw, tilt = table(), math.radians(self.heading), self.tilt_at(None)
        # Under Newton's method blocks chatter on a deck that turns freely, and creep by 1 mm/s when it leans by 5 deg.
        scene.option.solver = mujoco.mjtSolver.mjSOL_CG
        place(scene, replace(self.seesaw, tilt=tilt), "seesaw", self.foot, yaw, free=False)
        place(scene, self.weight, "weight", self.start, yaw + math.radians(self.weight_yaw))
        place(scene, self.target, "target", self.on_deck(self.offset, tilt), yaw)
        scene.body("target").quat = np.array(quat("y", tilt))
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        blocks = world.free_bodies
        return (
            world.tilt(BEAM) <= LEVEL
            and abs(self.along(world, "target") - self.offset) <= STAYS
            and all(world.touching_bodies(block).difference(blocks) == {BEAM} for block in blocks)
            and not world.touching(ROBOT, BEAM)
        )

    def failure(self, world: World) -> str | None:
        others = {ROBOT, *world.free_bodies} - {"target"}
        if any(world.touched(other, "target") for other in others):
            return "the target was touched"
        return "a block fell" if world.touched("target", "table") or fallen(world, *world.free_bodies) else None

    def along(self, world: World, block: str) -> float:
        """Where a block is, measured along the deck from the axle [m]."""
        return float(world.rot(BEAM)[:, 0] @ (world.pos(block) - world.pos(BEAM)))

    def tilt(self, world: World) -> float:
        """Tilt of the deck, positive where +s is down [rad]."""
        return -math.asin(float(world.rot(BEAM)[2, 0]))

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Put, let go, look; then narrow the stretch of the arm that is left, until the deck is level. Reads no mass.

        A deck on its stop says which way to go, and `AMISS` how far at least. Between the stops the tilt is
        proportional to the error, by a factor that is half to twice the one that one would expect.
        """
        low, high = (self.nearest(self.raised, end) for end in (-1.0, 1.0))
        along = (low + high) / 2
        while True:
            yield from self.put_at(world, self.nearest(self.raised, along))
            tilt, stood = self.tilt(world), self.along(world, "weight")
            if abs(tilt) <= SURELY:
                return
            stopped = abs(tilt) > self.seesaw.steepest - math.radians(1.0)
            past = stood - math.copysign(AMISS if stopped else 0.0, tilt)
            low, high = (low, min(high, past)) if tilt > 0 else (max(low, past), high)
            if high - low < 0.004:
                raise GaveUp("the balancing place was not found")
            there = stood - math.tan(tilt) / math.tan(LEVEL) * with_values(self, EXPECTED).margin
            along = (low + high) / 2 if stopped or not low < there < high else there

    def put_at(self, world: World, along: float, block: str = "weight") -> Plan:
        """Put a block on the deck from wherever it stands, let go, and see whether the deck stays level."""
        arm, at = world.arm, world.com(block)
        high = TRANSIT - at[2]
        yield from go_to(arm, at + high * UP, self.down, COARSE, OPEN)
        yield from pick(arm, at, closing=world.rot(block)[:, 1], above=high, lift=high, pace=STEADY)
        spot = self.on_deck(along, self.tilt(world))
        yield from go_to(arm, [*spot[:2], TRANSIT], self.down, COARSE)
        yield from put(arm, block, spot + world.com(block) - world.pos(block), on=BEAM, hover=0.02)
        yield from retreat(arm, 0.08)
        before = math.inf
        while abs(self.tilt(world) - before) > 0.002:  # a deck that bounces is at rest for a moment
            before = self.tilt(world)
            yield from hold(arm, 0.2)
        if world.tilt(BEAM) <= SURELY:
            yield from hold(arm, self.HOLD)

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "mirror_the_target": Shortcut(lambda world: self.put_at(world, self.mirror)),
            "put_it_once": Shortcut(lambda world: self.put_at(world, self.guess)),
            "hold_the_deck_level": Shortcut(self._hold_level),
            "shift_the_target": Shortcut(self._shift),
        }

    def _hold_level(self, world: World) -> Plan:
        """Put the counterweight in the mirror image and hold the deck level by hand: level it is, but not balanced."""
        yield from self.put_at(world, self.mirror)
        arm, side = world.arm, -1 if self.tilt(world) > 0 else 1
        spot = self.on_deck(side * (self.seesaw.arm(side) - 0.02), self.tilt(world))
        yield from go_to(arm, [*spot[:2], TRANSIT], pace=COARSE, grip=CLOSED)
        yield from push(arm, -0.08 * UP, until=lambda: side * self.tilt(world) > 0)
        yield from hold(arm, 1.2 * self.HOLD)
        yield from retreat(arm, 0.08)

    def _shift(self, world: World) -> Plan:
        """Miss the balancing place by a little, and level the deck by moving the target instead."""
        miss = 1.4 * self.margin
        moved = min(STAYS - 0.002, miss * self.weight.mass / self.target.mass)
        yield from self.put_at(world, self.balance - math.copysign(miss, self.balance))
        yield from self.put_at(world, self.offset + math.copysign(moved, self.balance), "target")

    def answer(self) -> Answer:
        """A place on the raised arm: by how much farther out than the target [m]. No share of the target's offset or
        of the arm, no distance from the axle and no lever law with fixed ratios of masses balances more of training."""

        def at(beyond: float) -> float:
            return self.nearest(self.raised, self.raised * (abs(self.offset) + beyond))

        beyond = tuple(round(0.01 * k, 2) for k in range(-12, 21))
        return Answer(beyond, lambda w, b: self.put_at(w, at(b)), lambda b: abs(self.tilt_at(at(b))) <= LEVEL)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        scene = self.build()
        scene.delete(scene.body("weight"))
        return {"no_counterweight": scene}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        """The arrangement, whatever weighs what; the lever law against the places that there are; no easy guess."""
        deck, lever = self.seesaw, abs(self.offset)
        far = deck.arm(1 if self.offset > 0 else -1) - self.target.width / 2 - RIM
        yield require(INNER <= lever <= far, "the target has no room on its arm", offset=lever, farthest=far)
        yield on_table("the stand or the counterweight", [self.foot, self.start], margin=0.05)
        yield require((air := deck.height - deck.thickness - deck.dip) >= 0.0, "the deck strikes the table", air=air)
        beside = abs(float(heading(self.heading + 90.0) @ (self.start - self.foot))) - deck.width / 2 - PALM_ALONG
        yield require(beside >= AIR, "the hand cannot take the counterweight beside the seesaw", beside=beside)
        grip, need = max(deck.friction, min(self.target.friction, self.weight.friction)), 1.5 * math.tan(deck.steepest)
        yield require(grip >= need, "blocks slide on the tilted deck", friction=grip, needed=need)
        at, margin, spans = self.balance, self.margin, self.spans(self.raised)
        yield require(bool(spans), "the raised arm has no room", arm=deck.arm(self.raised))
        room = max(min(high, at + margin) - max(low, at - margin) for low, high in spans)
        yield require(room >= ROOM, "no place on the deck balances with room to spare", balance=at, room=room)
        yield within_reach("a place of the counterweight", self.on_deck(at, 0.0) + self.weight.height * UP, self.start)
        alone = abs(self.tilt_at(None))
        yield require(alone >= deck.steepest, "the seesaw is not on its stop at the start", tilt=alone)
        for what, along in ("mirror image of the target's place", self.mirror), ("first guess", self.guess):
            tilt = abs(self.tilt_at(along))
            yield require(tilt >= CLEARLY, f"the {what} balances", tilt=tilt, needed=CLEARLY)

    def features(self) -> Mapping[str, float]:
        """The torque to be balanced by that of the counterweight in the mirror image, and where it balances [m].

        And, in half lengths of the beam, how far the axle is off its middle, and the target off the axle.
        """
        half = self.seesaw.length / 2
        return {
            "torque_ratio": -self.balance / self.offset,
            "place_of_balance": self.balance,
            "axle_off_middle": abs(self.seesaw.pivot_offset) / half,
            "target_lever": self.offset / half,
        }

    # --- statics and geometry -------------------------------------------------------------

    def tilt_at(self, along: float | None) -> float:
        """Tilt with the counterweight at `along` [m], or without it [rad]."""
        target = standing(self.target, self.offset)
        return self.seesaw.rest([target] if along is None else [target, standing(self.weight, along)])

    @property
    def raised(self) -> int:
        """The arm that is up at the start and has to carry the counterweight, -1 or 1."""
        return -1 if self.balance < 0 else 1

    @property
    def balance(self) -> float:
        """Where the counterweight makes the deck exactly level, along s [m]: m_w s_w = -(m_t s_t + m_b s_b)."""
        return -self.seesaw.moment([standing(self.target, self.offset)]) / self.weight.mass

    @property
    def margin(self) -> float:
        """How far from `balance` the counterweight may stand for the tilt to stay within `LEVEL` [m]."""
        stiffness = self.seesaw.stiffness([standing(block, 0.0) for block in (self.target, self.weight)])
        return math.tan(LEVEL) * stiffness / self.weight.mass

    @property
    def guess(self) -> float:
        """The place on the raised arm that would balance, were all masses as one expects; as far as it reaches [m]."""
        return self.nearest(self.raised, with_values(self, EXPECTED).balance)

    @property
    def down(self) -> Mat3:
        """A hand that closes along the axle, on faces that no tilt turns; the last joint has room to either side."""
        return facing_down(WRIST_MIDDLE + math.remainder(math.radians(self.heading) - WRIST_MIDDLE, math.pi))

    @property
    def foot(self) -> Vec3:
        """Point on the table below the axle [m]."""
        return np.array([self.x, self.y, TABLE_TOP])

    @property
    def start(self) -> Vec3:
        """Foot of the counterweight on the table [m]."""
        return np.array([self.weight_x, self.weight_y, TABLE_TOP])

    @property
    def mirror(self) -> float:
        """The place opposite to the target, as far as the deck reaches [m]."""
        return self.nearest(-1 if self.offset > 0 else 1, -self.offset)

    def spans(self, side: int) -> list[tuple[float, float]]:
        """Stretches of one arm, -1 or 1, where the middle of the counterweight can be [m]; see `Seesaw.stretches`."""
        return self.seesaw.stretches(side, INNER, self.weight.width / 2 + RIM, taken=self.offset, apart=BESIDE)

    def nearest(self, side: int, along: float) -> float:
        """The place on one arm, if it has any, that is nearest to `along` [m]."""
        near = [min(max(along, low), high) for low, high in self.spans(side)]
        return min(near, key=lambda at: abs(at - along))

    def on_deck(self, along: float, tilt: float) -> Vec3:
        """The point of the deck's upper face at `along` [m] when it is tilted [rad], in the world [m]."""
        return self.foot + about_z(math.radians(self.heading)) @ self.seesaw.on_deck(along, tilt)
