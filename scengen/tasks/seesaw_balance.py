"""T19 seesaw-balance: level a seesaw with a counterweight of unknown mass, by trying and looking.

                 o
      [t]   _____|_____   [w] ?        side view; +s runs from the axle to the right
    --------------|--------------
                 / \\

Bottleneck: the place of the counterweight follows from three masses that nobody can see. The tilt tells.

The seesaw is a balance, not a plank on an edge (assets/seesaw.py): axle above the deck, stops at 10 deg. Between the
stops its tilt is proportional to the excess moment, and the counterweight may stand within

    margin = tan(5 deg) * (stiffness / g) / (mass of the counterweight),    some 8 to 25 mm,

of the balancing place. Scenarios with less than `ROOM` of balancing deck are refuted.

Decisions where the paper is silent (it gives the story, the 5 deg, the pivot offset and the mass of the beam):

* All masses are hidden; blocks and beam look the same whatever they weigh. What can be seen, may be used: geometry,
  and which side is down. The oracle starts from the masses that one would expect and learns only from tilts.
* A place that anybody would try first must not balance: the mirror image of the target's, and the one that follows
  if blocks that look alike weigh alike. With masses drawn at will one of them would in every second scene; therefore
  a counterweight is clearly lighter or clearly heavier than the target.
* The beam weighs in: its middle lies off the axle. It can even outweigh the target, so that the counterweight
  belongs on the target's own arm.
* Level counts only hands off, with both blocks standing on the deck and nowhere else, the target where it was: else the
  hand could hold the beam, the counterweight could prop it up from the table, or both blocks could be moved to the
  axle, where they weigh nothing. None of these needs any balance of moments.
* Level must last for `HOLD` = 3 s: the beam also sweeps through level on its way from stop to stop.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from ..assets.box import Block
from ..assets.prop import TABLE_HALF, TABLE_TOP, UP, place, table
from ..assets.seesaw import Seesaw
from ..errors import GaveUp
from ..params import param
from ..robots.panda import REACH, SHOULDER
from ..scenario import Plan, Planner, Refutation, Scenario
from ..sim.world import ROBOT, Mat3, Vec3, World
from ..skills.motion import CLOSED, OPEN, facing_down, go_to, grasp, hold, push, release, wait

LEVEL = math.radians(5.0)
"""Tilt that counts as level [rad] (paper, App. B, T19)."""
SURELY = math.radians(4.5)
"""Tilt with which the oracle is content [rad]: a beam that looks at rest at 0.01 rad/s may creep by another 0.4 deg."""
CLEARLY = math.radians(7.0)
"""Tilt that a tempting place must at least cause [rad]: level, and what a misplacement by some 4 mm can change."""
STAYS = 0.015
"""How far the target may be from where it stood on the deck [m]. A heavy counterweight that is let go far out throws
the deck against its stop, and the target hops by up to 10 mm."""
MOVED = 0.017
"""By how much the target may be moved without levelling the deck, the counterweight in its mirror image [m]."""
ROOM = 0.016
"""Least deck on which the counterweight balances [m]: 8 mm to either side, twice the error of a careful placement."""
INNER = 0.055
"""Least distance between block and axle [m]: the fingers pass the posts by 1 cm."""
BESIDE = 0.056
"""Least distance between the middles of two blocks [m]: 16 mm of air at 40 mm of width."""
PALM = 0.110
"""Half the width of the hand across the fingers, and 8 mm of air [m]: hull of the hand in robosuite's gripper."""
RIM = 0.004
"""Least deck beyond a block [m]."""
EXPECTED_BEAM, EXPECTED_BLOCK = 0.28, 0.22
"""Masses that one would expect without having tried [kg]: a common beam, and blocks that look alike weighing alike."""
EXPECTED_MARGIN = 0.013
"""`margin` for these masses and the nominal seesaw [m]."""
TRANSIT = TABLE_TOP + 0.25
"""Height of the hand when it carries a block across [m]: 40 mm over a block on the raised end of the longest arm."""

BRISK = 0.30
"""Speed of the hand between places [m/s]: as fast as an action of 1 goes."""

BEAM = "seesaw/beam"


@dataclass(frozen=True, kw_only=True)
class SeesawBalance(Scenario):
    """A seesaw with the target on its deck, and a counterweight on the table in front of it."""

    HOLD = 3.0
    """How long the deck must stay level [s]: no swing passes for balance. A beam on its way from one side to 6 deg on
    the other creeps through +-5 deg in (damping / stiffness) ln(11 / 1) = 0.16 / 0.26 x 2.4 = 1.5 s; 0.26 N m/rad is
    the softest seesaw of the task file."""

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

    # --- geometry -------------------------------------------------------------------------

    @property
    def s(self) -> Vec3:
        """Unit vector along the level deck, shape (3,)."""
        a = math.radians(self.heading)
        return np.array([math.cos(a), math.sin(a), 0.0])

    @property
    def foot(self) -> Vec3:
        """Point on the table below the axle [m]."""
        return np.array([self.x, self.y, TABLE_TOP])

    @property
    def start(self) -> Vec3:
        """Foot of the counterweight on the table [m]."""
        return np.array([self.weight_x, self.weight_y, TABLE_TOP])

    def spans(self, side: int) -> list[tuple[float, float]]:
        """Stretches of one arm (-1 or 1) where the middle of the counterweight can stand, from the inside out [m].

        Both ends of a stretch are distances from the axle.
        """
        inside, outside = INNER, abs(self.seesaw.ends[(side + 1) // 2]) - self.weight.width / 2 - RIM
        stretches = [(inside, outside)]
        if side * self.offset > 0:
            stretches = [(inside, abs(self.offset) - BESIDE), (abs(self.offset) + BESIDE, outside)]
        return [(low, high) for low, high in stretches if low <= high]

    def nearest(self, side: int, place: float) -> float:
        """The place on one arm, if it has any, that is nearest to `place`, both along s [m]."""
        near = [min(max(side * place, low), high) for low, high in self.spans(side)]
        return side * min(near, key=lambda at: abs(at - side * place))

    # --- statics --------------------------------------------------------------------------

    def tilt_at(self, place: float | None, moved: float = 0.0) -> float:
        """Tilt with the counterweight at `place` [m], or without it [rad]. Positive where +s is down.

        Args:
            moved: by how much the target has been moved along s [m].
        """
        loads = [(self.target.mass, self.offset + moved, self.target.height / 2)]
        if place is not None:
            loads.append((self.weight.mass, place, self.weight.height / 2))
        stop = math.radians(self.seesaw.stop)
        return min(max(math.atan(self.seesaw.slope(loads)), -stop), stop)

    @property
    def moment(self) -> float:
        """First moment of target and beam about the axle [kg m]; times g it is the torque to be balanced."""
        return self.target.mass * self.offset - self.seesaw.mass * self.seesaw.pivot_offset

    @property
    def balance(self) -> float:
        """Where the counterweight makes the deck exactly level, along s [m]: m_w s_w = -(m_t s_t + m_b s_b)."""
        return -self.moment / self.weight.mass

    @property
    def margin(self) -> float:
        """How far from `balance` the counterweight may stand for the tilt to stay within `LEVEL` [m]."""
        block, beam = self.seesaw.drop - self.weight.height / 2, self.seesaw.drop + self.seesaw.thickness / 2
        stiffness = self.seesaw.mass * beam + (self.target.mass + self.weight.mass) * block
        return math.tan(LEVEL) * stiffness / self.weight.mass

    @property
    def torque_ratio(self) -> float:
        """Torque of target and beam over that of the counterweight in the mirror image of the target's place.

        At 1 the mirror image balances; below 0 the counterweight belongs on the target's own arm.
        """
        return self.moment / (self.weight.mass * self.offset)

    @property
    def raised(self) -> int:
        """The arm that is up at the start, -1 or 1."""
        return -1 if self.moment > 0 else 1

    @property
    def mirror(self) -> float:
        """The place opposite to the target, as far as the deck reaches [m]."""
        return self.nearest(-1 if self.offset > 0 else 1, -self.offset)

    def expected(self, side: int) -> float:
        """The place that would balance, were all masses as one expects; as far as that arm has it [m]."""
        moment = EXPECTED_BLOCK * self.offset - EXPECTED_BEAM * self.seesaw.pivot_offset
        return self.nearest(side, -moment / EXPECTED_BLOCK)

    def infeasible(self) -> Refutation | None:
        return self._misplaced() or self._unbalanceable() or self._too_easy()

    def _misplaced(self) -> Refutation | None:
        """What is wrong with the arrangement, whatever weighs what."""
        arm = abs(self.seesaw.ends[1 if self.offset > 0 else 0])
        far = arm - self.target.width / 2 - RIM
        if not INNER <= abs(self.offset) <= far:
            return Refutation("the target has no room on its arm", {"offset": abs(self.offset), "farthest": far})
        if (out := float(np.abs([self.x, self.y, self.weight_x, self.weight_y]).max())) > TABLE_HALF - 0.05:
            return Refutation(
                "the stand or the counterweight is not on the table", {"farthest": out, "edge": TABLE_HALF}
            )
        dip = max(map(abs, self.seesaw.ends)) * math.sin(math.radians(self.seesaw.stop))
        if (under := self.seesaw.height - self.seesaw.thickness) < dip:
            return Refutation("the deck strikes the table before its stop", {"dip": dip, "height": under})
        away = self.start - self.foot
        beside = abs(float(self.s[0] * away[1] - self.s[1] * away[0]))
        if beside < (need := PALM + self.seesaw.width / 2):
            return Refutation(
                "the hand cannot take the counterweight beside the seesaw", {"beside": beside, "needed": need}
            )
        grip = max(self.seesaw.friction, min(self.target.friction, self.weight.friction))
        if grip < (need := 1.5 * math.tan(math.radians(self.seesaw.stop))):
            return Refutation("blocks slide on the tilted deck", {"friction": grip, "needed": need})
        return None

    def _unbalanceable(self) -> Refutation | None:
        """The lever law against the places that there are."""
        spans = self.spans(self.raised)
        if not spans:
            return Refutation("the raised arm has no room", {"arm": abs(self.seesaw.ends[(self.raised + 1) // 2])})
        at, margin = self.raised * self.balance, self.margin
        room = max(min(high, at + margin) - max(low, at - margin) for low, high in spans)
        if room < ROOM:
            return Refutation(
                "no place on the deck balances with room to spare",
                {
                    "balance": at,
                    "margin": margin,
                    "room": room,
                    "needed": ROOM,
                    "inner": spans[0][0],
                    "outer": spans[-1][1],
                },
            )
        reaches = [
            np.linalg.norm(self.foot + self.raised * at * self.s + 0.15 * UP - SHOULDER),
            np.linalg.norm(self.start - SHOULDER),
        ]
        if (away := float(max(reaches))) > REACH:
            return Refutation("a place of the counterweight is out of reach", {"distance": away, "reach": REACH})
        return None

    def _too_easy(self) -> Refutation | None:
        """What is level without any search is no puzzle."""
        stop = math.radians(self.seesaw.stop)
        if (alone := abs(self.tilt_at(None))) < stop:
            return Refutation("the seesaw is not on its stop at the start", {"tilt": alone, "stop": stop})
        if (tilt := abs(self.tilt_at(self.mirror))) < CLEARLY:
            return Refutation("the mirror image of the target's place balances", {"tilt": tilt, "needed": CLEARLY})
        low, high = self.tilt_at(self.mirror, -MOVED), self.tilt_at(self.mirror, MOVED)
        if low <= LEVEL and high >= -LEVEL:
            return Refutation("the mirror image balances once the target is nudged", {"from": low, "to": high})
        if (tilt := abs(self.tilt_at(self.expected(self.raised)))) < CLEARLY:
            return Refutation("the first guess balances", {"tilt": tilt, "needed": CLEARLY})
        return None

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene, yaw = table(), math.radians(self.heading)
        tilt = self.tilt_at(None)
        place(scene, replace(self.seesaw, tilt=tilt), "seesaw", self.foot, yaw, free=False)
        place(scene, self.weight, "weight", self.start, yaw + math.radians(self.weight_yaw))
        place(scene, self.target, "target", self._on_deck(self.offset, tilt), yaw)
        turn = np.zeros(4)
        mujoco.mju_mulQuat(
            turn, scene.body("target").quat, np.array([math.cos(tilt / 2), 0.0, math.sin(tilt / 2), 0.0])
        )
        scene.body("target").quat = turn
        return scene

    def _on_deck(self, along: float, tilt: float) -> Vec3:
        """The point of the deck's upper face at `along` when it is tilted [m]."""
        level = np.array([math.cos(tilt), -math.sin(tilt)]) * along
        hangs = np.array([math.sin(tilt), math.cos(tilt)]) * -self.seesaw.drop
        run, rise = level + hangs
        return self.foot + self.seesaw.axle * UP + run * self.s + rise * UP

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        scene = self.build()
        scene.delete(scene.body("weight"))
        return {"no counterweight": scene}

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return (
            world.tilt(BEAM) <= LEVEL
            and abs(self.along(world, "target") - self.offset) <= STAYS
            and all(self._stands(world, block) for block in world.free_bodies)
            and not world.touching(ROBOT, BEAM)
        )

    def failure(self, world: World) -> str | None:
        if world.touched("target", "table"):
            return "the target fell off the seesaw"
        if any(world.pos(block)[2] < TABLE_TOP - 0.1 for block in world.free_bodies):
            return "a block fell off the table"
        return None

    def _stands(self, world: World, block: str) -> bool:
        """Whether a block is carried by the deck, and by nothing and nobody else."""
        others = (ROBOT, "table", "seesaw")
        return world.touching(block, BEAM) and not any(world.touching(block, other) for other in others)

    def along(self, world: World, block: str) -> float:
        """Where a block is, measured along the deck from the axle [m]."""
        return float(world.rot(BEAM)[:, 0] @ (world.pos(block) - world.pos(BEAM)))

    def tilt(self, world: World) -> float:
        """Tilt of the deck, positive where +s is down [rad]."""
        return -math.asin(float(world.rot(BEAM)[2, 0]))

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Guess, put, let go, look; then halve the stretch that is left, until the deck is level. Reads no mass."""
        side = -1 if self.tilt(world) > 0 else 1
        spans = self.spans(side)
        low, high, guess = spans[0][0], spans[-1][1], self.expected(side)
        while True:
            yield from self.put(world, guess)
            yield from self.watch(world)
            excess, stood = side * self.tilt(world), side * self.along(world, "weight")
            if abs(excess) <= SURELY:
                return
            low, high = (low, min(high, stood)) if excess > 0 else (max(low, stood), high)
            if high - low < 0.004:
                raise GaveUp("the balancing place was not found")
            guess = self.nearest(side, side * self._next(low, high, stood, excess))

    def _next(self, low: float, high: float, stood: float, excess: float) -> float:
        """The next distance to try between `low` and `high` [m], from the tilt towards the counterweight [rad].

        A deck on its stop says only which way to go. Between the stops the tilt is proportional to the error, and the
        factor that one would expect is off by a factor of two at most.
        """
        middle = (low + high) / 2
        if abs(excess) > math.radians(self.seesaw.stop - 0.5):
            return middle
        there = stood - math.tan(excess) / math.tan(LEVEL) * EXPECTED_MARGIN
        return there if low < there < high else middle

    def put(self, world: World, along: float) -> Plan:
        """Take the counterweight from where it stands and put it on the deck, as gently as the deck allows."""
        yield from self.take(world, "weight")
        spot = self._on_deck(along, self.tilt(world))
        hangs = float(world.hand[2] - world.pos("weight")[2])
        yield from go_to(world, [spot[0], spot[1], TRANSIT], self._across(world, self.s), BRISK, within=0.015)
        yield from go_to(world, spot + (hangs + 0.006) * UP, self._across(world, self.s), BRISK, within=0.003)
        yield from push(world, -0.04 * UP, until=lambda: world.touching("weight", BEAM))
        yield from release(world, 0.15)
        yield from go_to(world, world.hand + 0.08 * UP, speed=BRISK, within=0.02, grip=OPEN)

    def take(self, world: World, block: str) -> Plan:
        """Grasp a block where and as it stands, and lift it clear of everything."""
        frame = self._across(world, world.rot(block)[:, 0])
        high = 0.6 * self.weight.height * UP
        over = world.pos(block) + high
        over[2] = max(world.hand[2] - 0.02, TABLE_TOP + 0.14)
        yield from go_to(world, over, frame, BRISK, within=0.02, grip=OPEN)
        yield from go_to(world, world.pos(block) + high, frame, BRISK, within=0.003, grip=OPEN)
        yield from grasp(world, 0.2)
        yield from go_to(world, [*world.hand[:2], TRANSIT], speed=BRISK, within=0.03, grip=CLOSED)

    def watch(self, world: World) -> Plan:
        """Wait until the beam has come to rest, and where that is level, whether it lasts."""
        yield from hold(world, 0.2)
        yield from wait(world, lambda: np.abs(world.velocity(BEAM)[:3]).max() < 0.01, give_up=4.0)
        if world.tilt(BEAM) <= SURELY:
            yield from hold(world, self.HOLD)

    def _across(self, world: World, along: Vec3) -> Mat3:
        """The hand pointing down, closing across `along`: pads then lie against faces that no tilt turns.

        Of the two orientations that look alike, the one closer to the hand's own: it never turns half round.
        """
        x = world.hand_rot[:, 0]
        here, there = math.atan2(-x[0], x[1]), math.atan2(along[1], along[0])
        return facing_down(here + (there - here + math.pi / 2) % math.pi - math.pi / 2)

    # --- shortcuts ------------------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Planner]:
        return {
            "mirror the target": lambda world: self._once(world, self.mirror),
            "put it once": lambda world: self._once(world, self.expected(-1 if self.tilt(world) > 0 else 1)),
            "hold the deck level": self._hold_level,
        }

    def _once(self, world: World, along: float) -> Plan:
        """Put the counterweight somewhere and leave it there."""
        yield from self.put(world, along)
        yield from self.watch(world)

    def _hold_level(self, world: World) -> Plan:
        """Put the counterweight in the mirror image and hold the deck level by hand: level it is, but not balanced."""
        yield from self._once(world, self.mirror)
        side = -1 if self.tilt(world) > 0 else 1
        spot = self._on_deck(self.seesaw.ends[(side + 1) // 2] - side * 0.02, self.tilt(world))
        frame = self._across(world, self.s)
        yield from go_to(world, [*world.hand[:2], TRANSIT], frame, BRISK, within=0.03, grip=CLOSED)
        yield from go_to(world, [*spot[:2], TRANSIT], frame, BRISK, within=0.015, grip=CLOSED)
        yield from push(world, -0.08 * UP, until=lambda: side * self.tilt(world) > 0, grip=CLOSED)
        yield from hold(world, 1.2 * self.HOLD, CLOSED)
        yield from go_to(world, world.hand + 0.08 * UP, within=0.02)

    # --- features -------------------------------------------------------------------------

    def features(self) -> Mapping[str, float]:
        """How wrong the mirror image is, and where the counterweight belongs [m]."""
        return {"torque ratio": self.torque_ratio, "place of balance": self.balance}
