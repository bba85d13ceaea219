"""M01 mirror-pick-place: pick up a cube that is not where the picture shows it.

        .-------------------.         .-------------------.
        |       (o) robot   |         |  []               |      what every camera frame shows is turned by
        |                   |   ->    |                   |      180 deg; what the arm does is not
        |               []  |         |     robot (o)     |
        '-------------------'         '-------------------'

Bottleneck: the frame in which one sees is not the frame in which one acts. The physics asks for nothing: one cube, one
grasp. A certificate says therefore that the cube can be lifted, and that going where the picture shows it fails; it
cannot say whether pictures tell enough, which is the same question in every scene.

Decisions, where the paper (App. B, M01) is silent, and its text contradicts itself:

* How pictures are held is a parameter of the scenario, `view`. It holds for every picture that a policy or a recording
  gets, and for no other: people see scenes upright. Actions, proprioception and privileged poses stay in world axes.
  `seen_cube_pos` tells policies without eyes what the picture suggests (`scengen.orientation`).
* App. B turns frames by 180 deg, App. J once says that they are flipped horizontally: the first is trained on, the
  other is an axis.
* "Lift the cube to a small height": 4 cm above its place on the table, as in robosuite's Lift; held by the robot and by
  nothing else for 0.3 s, 30 steps as in the paper's T12 and T13. There is no other rule. The 12 s leave time to see the
  hand go the wrong way and to turn back: to notice that is what the task asks for, and so no way around it.
* The cube stands at least 7 cm from the middle lines of the view, or else some orientation shows it where it is.

Axes. The paper has none. Those of `view` ask the eye alone, and memory, which has none, cannot tell them from training.
Of the others, those of shape break a path that is kept relative to the cube: `small`, `long` and `high`. Nothing else
about lifting one thing is hard. For the same reason plans that read poses instead of pictures, the adversary's random
grasps among them, solve half of the scenes: what is asked here, nobody who reads poses is asked.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from ..assets.bar import Bar
from ..assets.prop import TABLE_TOP, place, table
from ..geometry import UP, Vec3, corners
from ..orientation import UPRIGHT, VIEW_CENTRE, Orientation
from ..params import param
from ..physics import GRAVITY
from ..predicates import fallen, held
from ..robots.jaw import OPEN_GAP, PALM_ABOVE, TIP_BELOW, pinch
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.world import World
from ..skills.jaw import pick
from ..skills.motion import FINE, OPEN, facing_down, go_to, steer

LIFTED = 0.04
"""How far the cube's centre must rise above its height on the table [m]: robosuite Lift, `_check_success`."""
ASIDE = 0.12
"""How far from the cube the picture must show it at least [m]: the open jaw reaches 66 mm to either side of the hand,
half a diagonal of the cube is 42 mm, so whoever goes there does not even touch it."""
GRIP, LOWEST = 0.65, TIP_BELOW + 0.004
"""Where the cube is held: share of its height, and least height over the table [m]. Above its middle it hangs straight:
below it the edges of the pads would be all that keeps it from turning."""
ABOVE = 0.10
"""From where the hand comes down [m]."""
UNDER_THE_PALM = 0.006
"""Least air between the palm and the top of what is held [m]."""
ROOM = 0.009
"""Air that a jaw needs in all to come down around the cube [m]: moves are exact to 3 mm and 3 deg, which takes 3 mm on
either side, and 3 mm of the width of the cube."""
STEERED = 2.0
"""How long the hand is steered by the picture [s]: at 0.15 m/s long enough to arrive, if the picture were upright."""
VIEWS = (UPRIGHT, Orientation(2), Orientation(0, True), Orientation(2, True), Orientation(1))
"""By `view`: upright, turned by 180 deg, left and right exchanged, above and below exchanged, a quarter turn."""
TAUGHT = VIEWS[1]
"""What a policy learns here: the paper's."""


@dataclass(frozen=True, kw_only=True)
class MirrorPickPlace(Scenario):
    """One cube on the table, and pictures that are not upright."""

    HOLD = 0.3
    NO_ABLATIONS = "the cube is lifted with the hand alone, and what is turned is the picture, which no scene holds"

    view: int = param(1, "view", 0, len(VIEWS) - 1)
    """Which of `VIEWS`."""
    x: float = param(0.05, "m", -0.4, 0.4)
    y: float = param(0.12, "m", -0.4, 0.4)
    yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)
    cube: Bar = Bar()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        place(scene, self.cube, "cube", self.spot, math.radians(self.yaw))
        return scene

    @property
    def orientation(self) -> Orientation:
        return VIEWS[self.view]

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return world.com("cube")[2] - TABLE_TOP - self.cube.size[2] / 2 >= LIFTED and held(world, "cube")

    def failure(self, world: World) -> str | None:
        return "the cube fell off the table" if fallen(world, "cube") else None

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Grasp the cube where it is, lift it."""
        yield from self._pick(world, world.pos("cube"))

    def _pick(self, world: World, foot: Vec3) -> Plan:
        """Come down over a place, grasp what stands there across the faces that need the least turn, lift it.

        A bar is taken across its long faces, since the jaw does not open as wide as it is long. For that the hand turns
        by a right angle, first, and so that joint 7 passes the middle of its range: the other way it comes to its end.

        Args:
            foot: where the middle of the cube's foot is believed to be [m].
        """
        arm, (wide, long, high) = world.arm, self.cube.size
        at = foot + max(GRIP * high, LOWEST, high + UNDER_THE_PALM - PALM_ABOVE) * UP
        faces = world.rot("cube")[:, :2].T
        if long > wide:
            turned = facing_down(math.radians(self.yaw) + math.pi / 2)
            yield from go_to(arm, at + ABOVE * UP, turned, FINE, OPEN)
        across = max(faces, key=lambda normal: abs(float(normal @ arm.hand_rot[:, 0])))
        yield from pick(arm, at, closing=across, above=ABOVE)

    # --- shortcuts --------------------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        """Believing the picture, correcting it as training teaches, and not looking; without those that are right."""
        found = {
            "grasp_under_the_hand": Shortcut(lambda world: self._pick(world, self._below(world.arm.hand))),
            "grasp_in_the_middle": Shortcut(lambda world: self._pick(world, self._below(VIEW_CENTRE))),
        }
        for name, taken_for in {"as_shown": UPRIGHT, "as_taught": TAUGHT}.items():
            if self.orientation != taken_for:
                found[f"grasp_{name}"] = Shortcut(lambda world, t=taken_for: self._pick(world, self._believed(t)))
                found[f"steer_{name}"] = Shortcut(lambda world, t=taken_for: self._steer(world, t))
        return found

    def _believed(self, taken_for: Orientation) -> Vec3:
        """Where the cube is for somebody who takes its picture for one that is held otherwise [m]."""
        return taken_for.stands_at(self.orientation.seen_at(self.spot))

    def _steer(self, world: World, taken_for: Orientation) -> Plan:
        """Steer the hand by what the picture shows of hand and cube, then grasp; the error grows, or stays."""
        arm, end = world.arm, world.time + STEERED
        while world.time < end:
            cube, hand = (self.orientation.seen_at(pos) for pos in (world.com("cube"), arm.hand))
            way = (taken_for.stands_at(cube) - taken_for.stands_at(hand)) * [1.0, 1.0, 0.0]
            if math.hypot(*way[:2]) < FINE.within:
                break
            yield steer(arm, arm.hand, FINE.speed * way / np.linalg.norm(way), np.zeros(3), OPEN)
        yield from self._pick(world, self._below(arm.hand))

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        half, edge = self.cube.size[2] / 2, self.cube.edge
        yield on_table("the cube", corners(self.spot, math.radians(self.yaw), self.cube.size))
        yield require(edge + ROOM < OPEN_GAP, "the cube is too wide for the jaw", edge=edge, jaw=OPEN_GAP)
        shown = self._believed(UPRIGHT if self.orientation != UPRIGHT else TAUGHT)
        aside = float(np.linalg.norm(shown - self.spot))
        yield require(aside >= ASIDE, "the picture shows the cube about where it is", aside=aside, least=ASIDE)
        hold, weight = self.cube.friction * pinch(edge), GRAVITY * self.cube.mass
        yield require(hold > 2 * weight, "the jaw does not hold the cube", hold=hold, weight=weight)
        yield within_reach("the cube", self.spot + half * UP)

    def features(self) -> Mapping[str, float]:
        """How far off the picture is [m], and what the jaw must do: how wide, how hard, how high; and across what."""
        return {
            "shown_aside": float(np.linalg.norm(self._believed(UPRIGHT) - self.spot)),
            "edge_over_opening": self.cube.edge / OPEN_GAP,
            "hold_over_weight": self.cube.friction * pinch(self.cube.edge) / (GRAVITY * self.cube.mass),
            "height_over_palm": self.cube.size[2] / PALM_ABOVE,
            "length_over_opening": self.cube.size[1] / OPEN_GAP,
        }

    # --- geometry -------------------------------------------------------------------------

    @property
    def spot(self) -> Vec3:
        """Where the middle of the cube's foot stands [m]."""
        return np.array([self.x, self.y, TABLE_TOP])

    @staticmethod
    def _below(point: Vec3) -> Vec3:
        """The place on the table under a point [m]."""
        return np.array([point[0], point[1], TABLE_TOP])
