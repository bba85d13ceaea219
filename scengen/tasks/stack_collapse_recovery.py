"""T28 stack-collapse-recovery: three cubes stand on each other; something knocks them down; put them up again.

        +-+                                                +-+
    ==> +-+               start                            +-+         end
       +---+                       +---+                  +---+
       +---+              +-+      |   |      +---+       +---+
      +-----+             +-+     +-----+     +---+      +-----+
    --+-----+--    -->  --+-+-----+-----+-----+---+-- -->-+-----+--

Bottleneck: the blow undoes what a plan could count on. Whether one cube or two have come down, on which side, how far
away and on which face they lie is known only when they have come to rest; then the tower must be built from below, by
whoever has looked first what of it still stands. To put the top back where it was is right in half of the scenarios.

Decisions, where the paper (App. B, T28) says "an external impulse knocks over the stack" and "rebuild a stable stack":

* The goal is the tower that stood: the same cubes in the same order, at rest and untouched for a second, wherever.
* The blow is an impulse through the centre of mass of each cube that it throws down, within one control period. It
  comes when the tower has stood untouched for a hidden time, so that whoever holds the tower only puts it off. After it
  a tower counts once its top has lain on the table.
* "In different directions": the top cube to the left and the middle one to the right, and on an axis the other way
  round: the robot, in front of the tower, reaches both sides equally well, but not far behind the tower or before it.
* "Mass distribution": a cube over the middle of a larger one cannot tip, wherever its weight is, since that is over the
  larger one, too. In training sizes fall from below, and it does not matter. On the axis `loaded_top` the top cube is
  wider than the middle one and has its weight on one side, which is dark: middle over middle it tips. Where it comes to
  lie with that side up or down the middle will do; such scenarios are refuted by a shortcut.

There is no hurry but for the horizon: 18 s are enough for two cubes, of 32 s. A cube may be put down half the edge of
the one below from its middle, 20 mm and more; the oracle does so within 3 mm. Each finger has 12 mm beside a cube.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations, pairwise

import mujoco
import numpy as np

from ..assets.box import Cube, LoadedCube
from ..assets.prop import TABLE_TOP, place, table
from ..control.loop import Loop
from ..geometry import UP, Outline, Vec3, corners, gap, heading
from ..params import check_bounds, param
from ..predicates import fallen, still
from ..robots.jaw import FINGER_ACROSS, PALM_ABOVE, PALM_ACROSS, PALM_ALONG, SPAN, TIP_BELOW
from ..robots.panda import BASE
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.memory import remember
from ..sim.world import World
from ..skills.grip import Grip, directions, extent, grips
from ..skills.jaw import carry, pick, put, release
from ..skills.motion import FINE, OPEN, Pace, facing_down, go_to, hand_yaw, retreat, wait

CALM, RESTED = 0.01, 0.2
"""Speed below which a cube counts as at rest [m/s], and for how long all must be so before the oracle acts [s]."""
OVER = 0.03
"""How far a cube is carried over the top of the tower, and the hand rises over one that it has let go [m]."""
CLEAR = 0.008
"""Of the finger tips over a cube before they go down beside it [m]."""
ROOM = 0.010
"""Air beside the open jaw that is enough [m]: moves are exact to 3 mm."""
UNWOUND = 1.7
"""Angle of joint 7 up to which a wrist can be turned on the way to any place [rad]: it ends at 2.9."""
BEYOND = 0.004
"""How far over the edge a cube's middle is let go by who does not look for the one below [m]."""
LEVEL = Pace(0.30, 0.008)
"""Over the cubes to the next one."""
GRAVITY = 9.81
"""[m/s^2]"""
DIFFERENT = 0.004
"""Least difference of two cubes' edges [m]."""
NEAREST, FARTHEST = 0.30, 0.75
"""How far from the robot's first axis the hand, pointing down, takes things from the table [m]: measured."""
NAMES = ("bottom", "middle", "top")
MEMORY = ("blows", "stood", "fell")
"""How many blows there were; for how long the tower has stood untouched [s]; whether its top has lain on the table
since the last blow."""


@dataclass(frozen=True, kw_only=True)
class Blow:
    """What knocks the tower down: an impulse through the middle of the top cube, and one through that under it."""

    when: float = param(0.7, "s", 0.1, 10.0, hidden=True)
    """How long the tower has stood before."""
    both: int = param(1, "", 0, 1, hidden=True)
    """Whether it strikes the middle cube, too."""
    heading: float = param(90.0, "deg", -360.0, 360.0, period=360.0, hidden=True)
    """Way that the top cube goes."""
    heading_middle: float = param(270.0, "deg", -360.0, 360.0, period=360.0, hidden=True)
    speed: float = param(0.88, "m/s", 0.1, 2.5, hidden=True)
    """What the impulse gives the top cube."""
    speed_middle: float = param(0.92, "m/s", 0.1, 2.5, hidden=True)

    def __post_init__(self) -> None:
        check_bounds(self)


@dataclass(frozen=True, kw_only=True)
class StackCollapseRecovery(Scenario):
    """A tower of three cubes and one blow or two."""

    HOLD = 1.0
    NO_ABLATIONS = "every cube is part of what is asked for; without the blow nothing is left to do"

    x: float = param(-0.08, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    yaw: float = param(0.0, "deg", -180.0, 180.0, period=360.0)
    bottom: Cube = Cube(edge=0.060, mass=0.13, friction=0.45, rgba=(0.20, 0.36, 0.66, 1.0))
    middle: Cube = Cube(edge=0.050, mass=0.075, friction=0.45, rgba=(0.90, 0.70, 0.16, 1.0))
    top: LoadedCube = LoadedCube()
    blows: int = param(1, "", 1, 2, hidden=True)
    blow_0: Blow = Blow()
    blow_1: Blow = Blow(both=0)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        remember(scene, *MEMORY)
        loaded = self.feet[2] - self.top.com * heading(self.yaw)  # its centre of mass over the others'
        for name, foot in zip(NAMES, (*self.feet[:2], loaded), strict=True):
            place(scene, self.cubes[name], name, foot, math.radians(self.yaw))
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        struck = world.memory["blows"] == self.blows and world.memory["fell"] > 0
        return struck and self.stands(world)

    def stands(self, world: World) -> bool:
        """Whether each cube rests on the one that was below it, and nothing else touches them."""
        touched = [{"table", "middle"}, {"bottom", "top"}, {"middle"}]
        if [world.touching_bodies(name) for name in NAMES] != touched:
            return False
        return all(still(world, name, CALM) for name in NAMES)

    def failure(self, world: World) -> str | None:
        return "a cube fell off the table" if fallen(world, *NAMES) else None

    def events(self, world: World) -> None:
        """Strike as soon as the tower has stood for long enough; see whether it has come down."""
        memory = world.memory
        memory["fell"] = max(memory["fell"], float(world.touching("top", "table")))
        memory["stood"] = memory["stood"] + Loop.PERIOD if self.stands(world) else 0.0
        number = int(memory["blows"])
        if number < self.blows and memory["stood"] >= self.planned[number].when - 1e-9:
            memory["blows"], memory["stood"], memory["fell"] = number + 1, 0.0, 0.0
            for name, velocity in self.struck(self.planned[number]).items():
                world.force(name, self.cubes[name].mass / Loop.PERIOD * velocity)

    def pending(self, world: World) -> bool:
        """Whether the tower is going to be struck: for the first time, or, as it stands, once more."""
        blows = world.memory["blows"]
        return blows < self.blows and (blows == 0.0 or world.memory["stood"] > 0.0)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Wait for the blow; then always look until all is at rest, and put up the lowest cube out of place."""
        yield from self.watch(world)
        while True:
            missing = [pair for pair in pairwise(NAMES) if not self.bears(world, *pair)]
            yield from self.stack(world, *missing[0]) if missing else (world.idle,)
            yield from self.settle(world)

    def watch(self, world: World) -> Plan:
        """Wait for the blow and for the end of the collapse."""
        yield from wait(world.arm, lambda: world.memory["blows"] > 0, self.blow_0.when + 1.0)
        yield from self.settle(world)

    def settle(self, world: World) -> Plan:
        """Wait until all cubes have been at rest for a while."""
        quiet = 0.0
        while quiet < RESTED:
            yield world.idle
            quiet = quiet + Loop.PERIOD if all(still(world, name, CALM) for name in NAMES) else 0.0

    def bears(self, world: World, below: str, name: str) -> bool:
        """Whether a cube lies on top of another one."""
        return world.touching(below, name) and world.com(name)[2] > extent(world, below, UP)[1]

    def stack(self, world: World, below: str, name: str, off: float = 0.0, weighed: bool = True) -> Plan:
        """Take a cube, let go of it over another one, go up.

        Args:
            off: how far from the other's middle, towards the robot [m].
            weighed: whether its centre of mass is brought there, or else its middle.
        """
        yield from self.take(world, name)
        foot = np.array([*self.centre(world, below)[:2], extent(world, below, UP)[1]]) - [off, 0.0, 0.0]
        at = foot + (world.com(name)[2] - extent(world, name, UP)[0]) * UP
        if not weighed:
            at[:2] += (world.com(name) - self.centre(world, name))[:2]
        yield from put(world.arm, name, at, on=below, hover=OVER)
        yield from retreat(world.arm, self.cubes[name].edge / 2 + OVER)

    def take(self, world: World, name: str) -> Plan:
        """Take a cube by two of its sides, and lift it over the tower."""
        arm, half, at = world.arm, self.cubes[name].edge / 2, grips(world, name)[0].at
        high = max(extent(world, other, UP)[1] for other in NAMES) + half + OVER - at[2]
        rise = half + TIP_BELOW + CLEAR
        yield from go_to(arm, at + high * UP, pace=LEVEL, grip=OPEN)  # there it is seen how far the wrist can turn
        closing, turn = self.sides(world, name)
        rot = facing_down(hand_yaw(arm) + turn)
        yield from go_to(arm, at + high * UP, rot)  # a turn drags the hand along
        yield from go_to(arm, at + rise * UP, rot, FINE)  # the arm swings on when it comes near the robot
        yield from pick(arm, at, closing, above=rise, lift=high)

    def sides(self, world: World, name: str) -> tuple[Vec3, float]:
        """Along what to close the jaw on a cube, and by how much to turn the hand for that [rad].

        The least turn after which the wrist is not wound up, by sides that have room for the jaw beside them; by those
        that have most, if none has enough.
        """
        air = {tuple(grip.closing): self.room(world, name, grip) for grip in grips(world, name)}
        enough = [np.array(closing) for closing, room in air.items() if room >= min(ROOM, max(air.values()))]
        yaw, wrist = hand_yaw(world.arm), float(world.arm.joint_pos[6])
        turns = [
            (math.remainder(math.atan2(-x, y) + flip - yaw, 2 * math.pi), np.array([x, y, 0.0]))
            for x, y, _ in enough
            for flip in (0.0, math.pi)
        ]
        turn, closing = min(turns, key=lambda one: (abs(wrist - one[0]) > UNWOUND, abs(one[0])))
        return closing, turn

    def room(self, world: World, name: str, grip: Grip) -> float:
        """Air between the open jaw around a cube and the other cubes, as seen from above [m]."""
        air, yaw = math.inf, math.atan2(grip.closing[1], grip.closing[0])
        for other in NAMES:
            top = extent(world, other, UP)[1]
            for bottom, size in (
                (-TIP_BELOW, (SPAN, 2 * FINGER_ACROSS)),
                (PALM_ABOVE, (2 * PALM_ALONG, 2 * PALM_ACROSS)),
            ):
                if other != name and top > grip.at[2] + bottom:
                    air = min(air, gap(corners(grip.at, yaw, size), self.outline(world, other)))
        return air

    def outline(self, world: World, name: str) -> Outline:
        """Of a cube that lies on one of its faces, as seen from above."""
        x, y, _ = directions(world, name)[0]
        return corners(self.centre(world, name), math.atan2(y, x), [self.cubes[name].edge] * 2)

    def centre(self, world: World, name: str) -> Vec3:
        """Middle of a cube, wherever its foot is now [m]."""
        return world.pos(name) + self.cubes[name].edge / 2 * world.rot(name)[:, 2]

    # --- shortcuts ------------------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        """What does not put up the tower that was; the last two only where they are wrong."""
        found = {
            "hold_the_tower": Shortcut(self._hold),
            "smallest_at_the_bottom": Shortcut(self._upside_down),
            "over_the_edge": Shortcut(self._over_the_edge),
        }
        if self.blow_0.both:
            found["as_if_the_middle_stood"] = Shortcut(self._top_alone)
        if self.top.com > self.middle.edge / 2:
            found["middle_over_middle"] = Shortcut(self._middle_over_middle)
        return found

    def _hold(self, world: World) -> Plan:
        """Take hold of the top cube where it stands, as fast as can be, hold it there for a while, let go."""
        at, side = self.centre(world, "top"), world.rot("top")[:, 1]
        yield from pick(world.arm, at, side, above=self.top.edge + OVER, lift=0.0, squeeze=1.0, pace=LEVEL)
        yield from release(world.arm)
        yield from retreat(world.arm)

    def _upside_down(self, world: World) -> Plan:
        """The middle cube on the smallest, and the largest on both, all centred."""
        yield from self.watch(world)
        for below, name in pairwise(reversed(NAMES)):
            yield from self.stack(world, below, name)

    def _over_the_edge(self, world: World) -> Plan:
        """The right cubes in the right order, but each let go beyond the edge of the one below."""
        yield from self.watch(world)
        for below, name in pairwise(NAMES):
            if not self.bears(world, below, name):
                yield from self.stack(world, below, name, self.cubes[below].edge / math.sqrt(2) + BEYOND)
                yield from self.settle(world)

    def _top_alone(self, world: World) -> Plan:
        """Put the top cube back to where it stood, and do not look whether something is there to bear it."""
        yield from self.watch(world)
        yield from self.take(world, "top")
        at = self.feet[2] + self.top.edge / 2 * UP
        yield from carry(world.arm, "top", at + OVER * UP, pace=LEVEL)
        yield from carry(world.arm, "top", at)
        yield from release(world.arm)
        yield from retreat(world.arm)

    def _middle_over_middle(self, world: World) -> Plan:
        """As the oracle, but as if the weight of a cube were in its middle."""
        yield from self.watch(world)
        for below, name in pairwise(NAMES):
            if not self.bears(world, below, name):
                yield from self.stack(world, below, name, weighed=False)
                yield from self.settle(world)

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        edges = [cube.edge for cube in self.cubes.values()]
        apart = min(abs(a - b) for a, b in combinations(edges, 2))
        yield require(apart >= DIFFERENT, "two cubes are alike", difference=apart, least=DIFFERENT)
        steep = self.top.steepest
        yield require(self.top.lean <= steep, "the slug does not fit in", lean=self.top.lean, steepest=steep)
        yield within_reach("the tower", self.feet[2] + self.top.edge * UP)
        for blow in self.planned:
            yield on_table("a cube", self.spots(blow), margin=self.top.edge)
            speeds = {name: math.hypot(*velocity[:2]) for name, velocity in self.struck(blow).items()}
            spare = min(speed - self.least(name) for name, speed in speeds.items())
            yield require(spare > 0.0, "a blow is too weak to throw a cube down", spare=spare)
            away = [math.dist(spot[:2], BASE[:2]) for spot in self.spots(blow)]
            yield require(min(away) >= NEAREST, "a cube comes too close to the robot", away=min(away), least=NEAREST)
            yield require(max(away) <= FARTHEST, "a cube comes out of reach", away=max(away), most=FARTHEST)

    def features(self) -> Mapping[str, float]:
        """How many cubes come down, when, how far away and on which side; what the tower is like."""
        ways = [spot - self.feet[0] for blow in self.planned for spot in self.spots(blow)]
        return {
            "number_of_blows": float(self.blows),
            "cubes_thrown_down": float(sum(len(self.struck(blow)) for blow in self.planned)),
            "time_of_the_first_blow": self.blow_0.when,
            "farthest": max(math.hypot(*way[:2]) for way in ways),
            "nearest": min(math.hypot(*way[:2]) for way in ways),
            "top_to_the_left": math.sin(math.radians(self.blow_0.heading)),
            "top_centre_of_mass_off": self.top.com / self.middle.edge,
            "slope_of_the_sides": (self.bottom.edge - self.top.edge) / sum(c.edge for c in self.cubes.values()),
        }

    # --- geometry -------------------------------------------------------------------------

    @property
    def cubes(self) -> dict[str, Cube | LoadedCube]:
        """By name, from the lowest up."""
        return dict(zip(NAMES, (self.bottom, self.middle, self.top), strict=True))

    @property
    def feet(self) -> list[Vec3]:
        """Where each cube stands at first [m]."""
        heights = np.cumsum([0.0, self.bottom.edge, self.middle.edge])
        return [np.array([self.x, self.y, TABLE_TOP + height]) for height in heights]

    @property
    def planned(self) -> tuple[Blow, ...]:
        """The blows that come, in their order."""
        return (self.blow_0, self.blow_1)[: self.blows]

    def struck(self, blow: Blow) -> dict[str, Vec3]:
        """The velocity that a blow gives to each cube that it strikes [m/s]."""
        found = {"top": blow.speed * heading(blow.heading)}
        if blow.both:
            found["middle"] = blow.speed_middle * heading(blow.heading_middle)
        return found

    def spots(self, blow: Blow) -> list[Vec3]:
        """How far along the table the cubes that a blow strikes can come, with their middles [m].

        Sliding friction takes speed as far as the edge of the cube below; then they fall freely, and slide on. Tumbling
        makes it less: measured 0.6 to 1.0 of it.
        """
        found = []
        for name, velocity in self.struck(blow).items():
            below, foot = self.cubes[NAMES[NAMES.index(name) - 1]], self.feet[NAMES.index(name)]
            brake = 2 * self.cubes[name].friction * GRAVITY
            speed = math.hypot(*velocity[:2])
            left = math.sqrt(max(0.0, speed**2 - brake * below.edge / 2))
            far = below.edge / 2 + left * math.sqrt(2 * (foot[2] - TABLE_TOP) / GRAVITY) + left**2 / brake
            found.append(self.feet[0] + far / speed * velocity)
        return found

    def least(self, name: str) -> float:
        """Speed with which a cube comes to the edge of the one below, along its diagonal [m/s].

        The middle cube bears the top one for the first half of that: it goes the other way.
        """
        rank = NAMES.index(name)
        way, load = self.cubes[NAMES[rank - 1]].edge / math.sqrt(2), 0.0
        if name == "middle":
            load = self.top.mass / self.middle.mass * self.middle.edge / 2
        return math.sqrt(2 * self.cubes[name].friction * GRAVITY * (way + load))
