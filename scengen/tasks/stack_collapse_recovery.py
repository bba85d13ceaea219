"""T28 stack-collapse-recovery: rebuild a tower of three cubes after an impulse has knocked it down.

        +-+                                                +-+
    ==> +-+               start                            +-+         end
       +---+                       +---+                  +---+
       +---+              +-+      |   |      +---+       +---+
      +-----+             +-+     +-----+     +---+      +-----+
    --+-----+--    -->  --+-+-----+-----+-----+---+-- -->-+-----+--

Bottleneck: no plan made before the blow holds. Whether one cube or two fall, to which side, how far and on which face
is known only once they are at rest. Then the robot must find the cubes and build from below. Putting the top cube back
where it stood is right in half of the scenarios.

Decisions, where the paper (App. B, T28) says "an external impulse knocks over the stack" and "rebuild a stable stack":

* The goal is the tower that stood: the same cubes in the same order, anywhere, at rest and untouched for a second.
* The blow is an impulse through the centre of mass of each cube that it throws down, within one control period. It
  comes when the tower has stood untouched for a hidden time, so holding the tower only delays it. So does a hand that
  is low beside the tower, which the paper lacks: open fingers stopped a top cube that was struck alone, and a plan made
  before the blow sufficed. Afterwards a tower counts only if its top cube has lain on the table.
* Which cubes still stand need not be seen: the middle one on the bottom one, then the top one on the middle one, is
  always right, and fair.
* "In different directions": the top cube falls to the left and the middle one to the right; on an axis the other way
  round. The robot stands in front of the tower: it reaches both sides equally well, but not far behind or before it.
* "Mass distribution": a cube over the middle of a larger one cannot tip, because its centre of mass is over the larger
  one, too. In training cubes get smaller from below, so mass distribution does not matter. On the axis `loaded_top` the
  top cube is wider than the middle one and has its weight on one side, which is dark: placed middle over middle it
  tips. If it comes to lie with that side up or down, middle over middle is stable; a shortcut refutes such scenarios.

Two cubes take 18 s of 32 s. A cube may be put down half the edge of the one below from its middle, 20 mm and more; the
oracle places it within 3 mm. Each finger has 12 mm of clearance beside a cube.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import combinations, pairwise

import mujoco
import numpy as np

from ..assets.box import Cube, LoadedCube
from ..assets.prop import TABLE_TOP, place, table
from ..control.loop import Loop
from ..decisions import Decision, choice, near, side_of
from ..geometry import UP, Vec3, heading
from ..means import Mean, once
from ..params import Bounded, param
from ..physics import stopping_speed, thrown_off
from ..predicates import count_time, fallen, held, still
from ..robots.jaw import PALM_ABOVE, PALM_ALONG, SPAN, TIP_BELOW
from ..robots.panda import BASE
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.memory import remember
from ..sim.world import World
from ..skills import waiting
from ..skills.cubes import CARRY_HEIGHT, CARRY_PACE, centre, stack, supports, take
from ..skills.grip import extent
from ..skills.jaw import carry, let_go, pick
from ..skills.motion import wait

NAMES = ("bottom", "middle", "top")
REST_SPEED = 0.01  # speed below which a cube counts as at rest [m/s]
GUARD_CLEARANCE = 0.02  # least clearance over the tower of a hand beside it that does not delay the blow [m]
MIN_EDGE_DIFFERENCE = 0.004  # least difference between the edges of two cubes [m]
MIN_DISTANCE = 0.30  # least distance from the robot's first axis at which a hand takes a cube [m]: measured
MAX_DISTANCE = 0.75  # largest such distance [m]: measured
MEMORY = ("blows", "stood", "fell")
"""Number of blows so far; time for which the tower has stood untouched, with no low hand beside it [s]; whether its top
cube has lain on the table since the last blow."""


@dataclass(frozen=True, kw_only=True)
class Blow(Bounded):
    """An impulse through the middle of the top cube, and possibly one through that of the middle cube."""

    when: float = param(0.7, "s", 0.1, 10.0, hidden=True)
    """Time for which the tower has stood untouched when the blow comes."""
    both: int = param(1, "", 0, 1, hidden=True)  # 1 if the middle cube is struck, too
    heading: float = param(90.0, "deg", -360.0, 360.0, period=360.0, hidden=True)
    """Direction in which the top cube is thrown."""
    heading_middle: float = param(270.0, "deg", -360.0, 360.0, period=360.0, hidden=True)
    """Direction in which the middle cube is thrown."""
    speed: float = param(0.88, "m/s", 0.1, 2.5, hidden=True)  # speed that the impulse gives to the top cube
    speed_middle: float = param(0.92, "m/s", 0.1, 2.5, hidden=True)  # speed that the impulse gives to the middle cube


@dataclass(frozen=True, kw_only=True)
class StackCollapseRecovery(Scenario):
    """A tower of three cubes and one blow or two."""

    VERSION = 2
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
        return world.memory["blows"] == self.blows and world.memory["fell"] > 0 and self.stands(world)

    def stands(self, world: World) -> bool:
        """Whether each cube rests on the one that was below it, and nothing else touches the cubes."""
        touched = [{"table", "middle"}, {"bottom", "top"}, {"middle"}]
        if [world.touching_bodies(name) for name in NAMES] != touched:
            return False
        return all(still(world, name, REST_SPEED) for name in NAMES)

    def failure(self, world: World) -> str | None:
        return "a cube fell off the table" if fallen(world, *NAMES) else None

    def means(self) -> Mapping[str, Mean]:
        fell, last = ["top", "middle"][: 1 + self.planned[-1].both], self.blows

        def carried(name: str, world: World) -> bool:
            return world.memory["blows"] == last and bool(world.memory["fell"]) and held(world, name)

        return {f"the fallen {name} cube was carried in the jaw": once(partial(carried, name)) for name in fell}

    def events(self, world: World) -> None:
        """Strike once the tower has stood for its time; notice when its top cube lies on the table."""
        memory = world.memory
        memory["fell"] = max(memory["fell"], float(world.touching("top", "table")))
        stands = self.stands(world) and not self.guarded(world)
        count_time(world, "stood", stands)
        number = int(memory["blows"])
        if number < self.blows and memory["stood"] >= self.planned[number].when - 1e-9:
            memory["blows"], memory["stood"], memory["fell"] = number + 1, 0.0, 0.0
            for name, velocity in self.velocities(self.planned[number]).items():
                world.force(name, self.cubes[name].mass / Loop.PERIOD * velocity)

    def guarded(self, world: World) -> bool:
        """Whether the hand is so low beside the top cube that it could stop it."""
        hand, rot, top = world.arm.hand, world.arm.hand_rot, world.com("top")
        tips = TIP_BELOW * rot[2, 2] - SPAN / 2 * abs(rot[2, 0])
        palm = -PALM_ABOVE * rot[2, 2] - PALM_ALONG * abs(rot[2, 0])
        low = hand[2] + min(tips, palm) < extent(world, "top", UP)[1] + GUARD_CLEARANCE
        return bool(low and math.dist(hand[:2], top[:2]) < 0.25)  # the palm reaches 0.10 m to either side

    def pending(self, world: World) -> bool:
        """Whether a blow is still to come: the first one, or another one while the tower stands."""
        blows = world.memory["blows"]
        return blows < self.blows and (blows == 0.0 or world.memory["stood"] > 0.0)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Wait for the blow; then, each time all cubes are at rest, stack the lowest one that is out of place."""
        yield from self.wait_for_collapse(world)
        while True:
            missing = [pair for pair in pairwise(NAMES) if not supports(world, *pair)]
            yield from stack(world.arm, self.edges, *missing[0]) if missing else (world.idle,)
            yield from self.settle(world)

    def wait_for_collapse(self, world: World) -> Plan:
        """Wait for the blow and for the end of the collapse."""
        yield from wait(world.arm, lambda: world.memory["blows"] > 0, self.blow_0.when + 1.0)
        yield from self.settle(world)

    def settle(self, world: World) -> Plan:
        """Wait until all cubes are at rest."""
        yield from waiting.settle(world, *NAMES, below=REST_SPEED)

    # --- shortcuts ------------------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        """Plans that do not rebuild the tower; the last two only where they are wrong."""
        found = {
            "hold_the_tower": Shortcut(self._hold),
            "smallest_at_the_bottom": Shortcut(self._upside_down),
            "over_the_edge": Shortcut(lambda world: self._restack(world, beyond_edge=True)),
        }
        if self.blow_0.both:
            found["as_if_the_middle_stood"] = Shortcut(self._top_alone)
        if self.top.com > self.middle.edge / 2:
            found["middle_over_middle"] = Shortcut(lambda world: self._restack(world, by_mass=False))
        return found

    def _hold(self, world: World) -> Plan:
        """Grasp the top cube where it stands as fast as possible, hold it there for one second, let go."""
        at, side = centre(world, "top", self.top.edge), world.rot("top")[:, 1]
        yield from pick(world.arm, at, side, above=self.top.edge + CARRY_HEIGHT, lift=0.0, squeeze=1.0, pace=CARRY_PACE)
        yield from let_go(world.arm)

    def _upside_down(self, world: World) -> Plan:
        """Stack the middle cube on the smallest, and the largest on both, all centred."""
        yield from self.wait_for_collapse(world)
        for below, name in pairwise(reversed(NAMES)):
            yield from stack(world.arm, self.edges, below, name)

    def _restack(self, world: World, beyond_edge: bool = False, by_mass: bool = True) -> Plan:
        """Stack in the right order, but release cubes beyond the edge of the one below, or with middle over middle."""
        yield from self.wait_for_collapse(world)
        for below, name in pairwise(NAMES):
            if not supports(world, below, name):
                over_edge = self.cubes[below].edge / math.sqrt(2) + 0.004  # the middle is 4 mm over the edge
                yield from stack(world.arm, self.edges, below, name, over_edge if beyond_edge else 0.0, by_mass)
                yield from self.settle(world)

    def _top_alone(self, world: World) -> Plan:
        """Put the top cube back where it stood, without looking whether a cube is there to support it."""
        yield from self.wait_for_collapse(world)
        yield from take(world.arm, self.edges, "top")
        at = self.feet[2] + self.top.edge / 2 * UP
        yield from carry(world.arm, "top", at + CARRY_HEIGHT * UP, pace=CARRY_PACE)
        yield from carry(world.arm, "top", at)
        yield from let_go(world.arm)

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        return {
            "fallen_cubes": choice(1 + self.blow_0.both),
            "side_of_the_top_cube": choice(side_of(math.sin(math.radians(self.blow_0.heading)))),
            "top_lies_at": near(self.spots(self.blow_0)[0], 0.012),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        apart = min(abs(a - b) for a, b in combinations(self.edges.values(), 2))
        yield require(apart >= MIN_EDGE_DIFFERENCE, "two cubes are alike", difference=apart, least=MIN_EDGE_DIFFERENCE)
        steep = self.top.steepest
        yield require(self.top.lean <= steep, "the slug does not fit in", lean=self.top.lean, steepest=steep)
        yield within_reach("the tower", self.feet[2] + self.top.edge * UP)
        for blow in self.planned:
            yield on_table("a cube", self.spots(blow), margin=self.top.edge)
            speeds = {name: math.hypot(*velocity[:2]) for name, velocity in self.velocities(blow).items()}
            spare = min(speed - self.min_speed(name) for name, speed in speeds.items())
            yield require(spare > 0.0, "a blow is too weak to throw a cube down", spare=spare)
            away = [math.dist(spot[:2], BASE[:2]) for spot in self.spots(blow)]
            near, far = min(away), max(away)
            yield require(near >= MIN_DISTANCE, "a cube comes too close to the robot", away=near, least=MIN_DISTANCE)
            yield require(far <= MAX_DISTANCE, "a cube comes out of reach", away=far, most=MAX_DISTANCE)

    def features(self) -> Mapping[str, float]:
        """Number of cubes that fall, when, how far and on which side; shape and mass distribution of the tower."""
        ways = [spot - self.feet[0] for blow in self.planned for spot in self.spots(blow)]
        return {
            "number_of_blows": float(self.blows),
            "cubes_thrown_down": float(sum(len(self.velocities(blow)) for blow in self.planned)),
            "time_of_the_first_blow": self.blow_0.when,
            "farthest": max(math.hypot(*way[:2]) for way in ways),
            "nearest": min(math.hypot(*way[:2]) for way in ways),
            "top_to_the_left": math.sin(math.radians(self.blow_0.heading)),
            "top_centre_of_mass_off": self.top.com / self.middle.edge,
            "slope_of_the_sides": (self.bottom.edge - self.top.edge) / sum(c.edge for c in self.cubes.values()),
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "largest": self.bottom.edge,
            "smallest": self.top.edge,
            "away": math.hypot(self.x - BASE[0], self.y - BASE[1]),
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def cubes(self) -> dict[str, Cube | LoadedCube]:
        """Cubes by name, from the lowest up."""
        return dict(zip(NAMES, (self.bottom, self.middle, self.top), strict=True))

    @cached_property
    def edges(self) -> dict[str, float]:
        """Edges of the cubes by name [m]."""
        return {name: cube.edge for name, cube in self.cubes.items()}

    @cached_property
    def feet(self) -> list[Vec3]:
        """Initial position of each cube's foot [m]."""
        heights = np.cumsum([0.0, self.bottom.edge, self.middle.edge])
        return [np.array([self.x, self.y, TABLE_TOP + height]) for height in heights]

    @cached_property
    def planned(self) -> tuple[Blow, ...]:
        """Blows that come, in their order."""
        return (self.blow_0, self.blow_1)[: self.blows]

    def velocities(self, blow: Blow) -> dict[str, Vec3]:
        """Velocity that a blow gives to each cube that it strikes [m/s]."""
        found = {"top": blow.speed * heading(blow.heading)}
        if blow.both:
            found["middle"] = blow.speed_middle * heading(blow.heading_middle)
        return found

    def spots(self, blow: Blow) -> list[Vec3]:
        """Farthest places on the table that the middles of the cubes that a blow strikes can reach [m]."""
        found = []
        for name, velocity in self.velocities(blow).items():
            below, foot = self.cubes[NAMES[NAMES.index(name) - 1]], self.feet[NAMES.index(name)]
            speed = math.hypot(*velocity[:2])
            distance = thrown_off(speed, self.cubes[name].friction, below.edge / 2, foot[2] - TABLE_TOP)
            found.append(self.feet[0] + distance / speed * velocity)
        return found

    def min_speed(self, name: str) -> float:
        """Initial speed with which a cube just reaches the edge of the one below, along its diagonal [m/s].

        The middle cube carries the top one for the first half of its way, because the top one moves the other way.
        """
        way, load = self.cubes[NAMES[NAMES.index(name) - 1]].edge / math.sqrt(2), 0.0
        if name == "middle":
            load = self.top.mass / self.middle.mass * self.middle.edge / 2
        return stopping_speed(self.cubes[name].friction, way + load)
