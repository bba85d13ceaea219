"""M01 mirror-pick-place: pick up a cube that is not where the picture shows it.

        .-------------------.         .-------------------.
        |       (o) robot   |         |  []               |      what every camera frame shows is turned by
        |                   |   ->    |                   |      180 deg; what the arm does is not
        |               []  |         |     robot (o)     |
        '-------------------'         '-------------------'

Bottleneck: the camera frame is not the frame of the actions. The physics is easy: one cube, one grasp. A certificate
therefore says that the cube can be lifted, and that a hand that goes where the picture shows the cube fails. It cannot
say whether pictures show enough, which is the same question in every scene.

Decisions, where the paper (App. B, M01) is silent, and its text contradicts itself:

* The orientation of pictures is a parameter of the scenario, `view`. It applies to every picture that a policy or a
  recording gets, and to no other: people see scenes upright. Actions, proprioception and privileged poses stay in world
  axes. `seen_cube_pos` gives state-based policies what the picture suggests (`scengen.orientation`).
* App. B turns frames by 180 deg; App. J says in one place that they are flipped horizontally. Training uses the first,
  the other is an axis.
* "Lift the cube to a small height": 4 cm above its place on the table, as in robosuite's Lift, held by the robot and by
  nothing else for 0.3 s, 30 steps as in the paper's T12 and T13. The time limit of 12 s lets a policy see the hand go
  the wrong way and turn back: noticing that is what the task requires, so it is not a bypass.
* A miss costs nothing but time. A hand that closes where the picture shows the cube, feels nothing, and goes to the
  opposite place lifts the cube at 8 s (12 of 12, on `flipped` with one more try 4 of 4). The task asks a policy to
  notice the turned frame before or after a miss; a success does not show which. A palm that sweeps the table until the
  wrist feels the cube lifts it without a picture (27 of 36), and so does a level open jaw that sweeps it like a fork
  and shifts to the side on which a finger meets the cube (6 of 10). Both are labelled: the cube is not between the
  fingers, away from the palm, when the robot first touches it.
* The cube stands at least 7 cm from the middle lines of the view: else some orientation shows it where it is.

Axes. The paper has none. Those of `view` test the eye alone: memory, which has none, cannot distinguish them from
training. Of the others, those of shape break a path that is kept relative to the cube: `small`, `long`, `high`. Nothing
else about lifting one thing is hard. For the same reason plans that read poses instead of pictures, the adversary's
random grasps among them, solve half of the scenes: the task's question does not arise for a policy that reads poses.
"""

import math
from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..assets.bar import Bar
from ..assets.prop import TABLE_TOP, place, table
from ..decisions import Decision, choice, near, side_of
from ..geometry import UP, Vec3, corners
from ..means import Mean, when
from ..orientation import UPRIGHT, VIEW_CENTRE, Orientation
from ..params import param
from ..physics import GRAVITY
from ..predicates import borne, fallen, held
from ..robots.jaw import OPEN_GAP, PALM_ABOVE, TIP_BELOW, pinch
from ..scenario import Action, Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT
from ..sim.world import World
from ..skills.jaw import grasp, pick
from ..skills.motion import COARSE, FINE, OPEN, closing_along, facing_down, go_to, retreat, steer

LIFT_HEIGHT = 0.04
"""Height that the cube's centre must rise above its height on the table [m]: robosuite Lift, `_check_success`."""
MIN_PICTURE_OFFSET = 0.12
"""Least distance between the cube and where the picture shows it [m]: the open jaw reaches 66 mm to either side of the
hand and half a diagonal of the cube is 42 mm, so that a hand that goes there does not even touch the cube."""
MIN_CLEARANCE = 0.002
"""Least distance between palm and cube when the robot first touches the cube [m]: the oracle keeps 6 mm. Level fingers
that sweep the table like a fork meet the cube with their tips, or with the palm."""
APPROACH_HEIGHT = 0.10  # height above the grasp from which the hand comes down [m]
VIEWS = (UPRIGHT, Orientation(2), Orientation(0, True), Orientation(2, True), Orientation(1))
"""Orientations by `view`: upright, turned by 180 deg, left and right exchanged, above and below exchanged, a quarter
turn."""
TRAINING_VIEW = VIEWS[1]  # orientation that a policy learns here: the paper's


@dataclass(frozen=True, kw_only=True)
class MirrorPickPlace(Scenario):
    """One cube on the table, and pictures that are not upright."""

    VERSION = 4
    HOLD = 0.3
    NO_ABLATIONS = "the cube is lifted with the hand alone, and what is turned is the picture, which no scene holds"

    view: int = param(1, "view", 0, len(VIEWS) - 1)  # index of the pictures' orientation in `VIEWS`
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
        return world.com("cube")[2] - TABLE_TOP - self.cube.size[2] / 2 >= LIFT_HEIGHT and held(world, "cube")

    def failure(self, world: World) -> str | None:
        return "the cube fell off the table" if fallen(world, "cube") else None

    def means(self) -> Mapping[str, Mean]:
        def between(world: World) -> bool:
            at = world.arm.hand_rot.T @ (world.com("cube") - world.arm.hand)
            half = np.abs(world.arm.hand_rot.T @ world.rot("cube")) @ self.cube.size / 2
            beside = abs(at[0]) < world.arm.gap / 2 and abs(at[1]) < self.cube.edge / 2
            return bool(beside and -PALM_ABOVE + MIN_CLEARANCE < at[2] - half[2] < 0.0)  # from palm to pads

        return {
            "the cube stood between the fingers when the robot first touched it": when(
                lambda world: world.touching(ROBOT, "cube"), between
            ),
            "both pads bore the cube as it came up": when(
                lambda world: self._raised(world) >= LIFT_HEIGHT, lambda world: borne(world, world.arm, "cube")
            ),
        }

    def _raised(self, world: World) -> float:
        """Height of the cube's centre above its height on the table [m]."""
        return world.com("cube")[2] - TABLE_TOP - self.cube.size[2] / 2

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Grasp the cube where it is, lift it."""
        yield from self._pick(world, world.pos("cube"))

    def _pick(self, world: World, foot: Vec3) -> Plan:
        """Come down over a place, grasp what stands there across the faces that need the least turn, lift it.

        A bar is taken across its long faces, as the jaw does not open as wide as the bar is long. For that the hand
        turns by a right angle first, so that joint 7 passes the middle of its range: the other way it meets its limit.

        Args:
            foot: assumed position of the middle of the cube's foot [m].
        """
        at = foot + self._grip_above * UP
        across = yield from self._turn(world, at)
        yield from pick(world.arm, at, closing=across, above=APPROACH_HEIGHT)

    def _turn(self, world: World, at: Vec3) -> Generator[Action, None, Vec3]:
        """Turn the hand above the grasp of a bar [m]; returns the direction along which the fingers are to close."""
        arm, (wide, long, _) = world.arm, self.cube.size
        faces = world.rot("cube")[:, :2].T
        if long > wide:
            turned = facing_down(math.radians(self.yaw) + math.pi / 2)
            yield from go_to(arm, at + APPROACH_HEIGHT * UP, turned, FINE, OPEN)
        return max(faces, key=lambda normal: abs(float(normal @ arm.hand_rot[:, 0])))

    @cached_property
    def _grip_above(self) -> float:
        """Height of the grip site over the cube's foot in the grasp [m]."""
        # Held above its middle (65 %) the cube hangs straight: below, only the edges of the pads would keep it from
        # turning. The finger tips stay 4 mm above the table, and the palm 6 mm above the cube's top.
        high = self.cube.size[2]
        return max(0.65 * high, TIP_BELOW + 0.004, high + 0.006 - PALM_ABOVE)

    def steps(self) -> Mapping[str, Planner]:
        low = TABLE_TOP + self._grip_above
        return {
            "go_above": lambda world: self._go_above(world, world.pos("cube")),
            "come_down": lambda world: go_to(world.arm, [*world.arm.hand[:2], low], pace=FINE, grip=OPEN),
            "grasp": lambda world: grasp(world.arm),
            "lift": lambda world: retreat(world.arm, 0.12),
            "go_where_shown": lambda world: self._go_above(world, self._shown_spot(UPRIGHT)),
        }

    def _go_above(self, world: World, foot: Vec3) -> Plan:
        """Bring the open hand above a place [m], turned for the grasp."""
        at = foot + self._grip_above * UP
        across = yield from self._turn(world, at)
        rot = closing_along(world.arm, across)
        yield from go_to(world.arm, at + APPROACH_HEIGHT * UP, rot, COARSE, OPEN)
        yield from go_to(world.arm, at + APPROACH_HEIGHT * UP, rot, FINE, OPEN)

    # --- shortcuts --------------------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        """Trust the picture, correct it as training teaches, or do not look; without those that are right here."""
        found = {
            "grasp_under_the_hand": Shortcut(lambda world: self._pick(world, self._below(world.arm.hand))),
            "grasp_in_the_middle": Shortcut(lambda world: self._pick(world, self._below(VIEW_CENTRE))),
        }
        for name, assumed in {"as_shown": UPRIGHT, "as_taught": TRAINING_VIEW}.items():
            if self.orientation != assumed:
                found[f"grasp_{name}"] = Shortcut(lambda world, view=assumed: self._pick(world, self._shown_spot(view)))
                found[f"steer_{name}"] = Shortcut(lambda world, view=assumed: self._steer(world, view))
        return found

    def _shown_spot(self, assumed: Orientation) -> Vec3:
        """Position at which the picture shows the cube to an observer who assumes another orientation [m]."""
        return assumed.stands_at(self.orientation.seen_at(self.spot))

    def _steer(self, world: World, assumed: Orientation) -> Plan:
        """Steer the hand by what the picture shows of hand and cube, then grasp; the error grows, or stays."""
        arm, end = world.arm, world.time + 2.0  # at 0.15 m/s long enough to arrive, if the picture were upright
        while world.time < end:
            cube, hand = (self.orientation.seen_at(pos) for pos in (world.com("cube"), arm.hand))
            way = (assumed.stands_at(cube) - assumed.stands_at(hand)) * [1.0, 1.0, 0.0]
            if math.hypot(*way[:2]) < FINE.within:
                break
            yield steer(arm, arm.hand, FINE.speed * way / np.linalg.norm(way), np.zeros(3), OPEN)
        yield from self._pick(world, self._below(arm.hand))

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        return {
            "side": choice(side_of(self.y), "x", "y"),
            "cube": near(self.spot, 0.010, "x", "y"),
            "hand_turns": choice(side_of(self.yaw), "yaw"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        half, edge = self.cube.size[2] / 2, self.cube.edge
        yield on_table("the cube", corners(self.spot, math.radians(self.yaw), self.cube.size))
        # Moves are exact to 3 mm and 3 deg: 3 mm on either side, and 3 mm of the cube's width.
        yield require(edge + 0.009 < OPEN_GAP, "the cube is too wide for the jaw", edge=edge, jaw=OPEN_GAP)
        shown = self._shown_spot(UPRIGHT if self.orientation != UPRIGHT else TRAINING_VIEW)
        aside, least = float(np.linalg.norm(shown - self.spot)), MIN_PICTURE_OFFSET
        yield require(aside >= least, "the picture shows the cube about where it is", aside=aside, least=least)
        hold, weight = self.cube.friction * pinch(edge), GRAVITY * self.cube.mass
        yield require(hold > 2 * weight, "the jaw does not hold the cube", hold=hold, weight=weight)
        yield within_reach("the cube", self.spot + half * UP)

    def features(self) -> Mapping[str, float]:
        """Offset of the picture [m], and what the jaw must do: opening, force, height, and length across it."""
        return {
            "shown_aside": float(np.linalg.norm(self._shown_spot(UPRIGHT) - self.spot)),
            "edge_over_opening": self.cube.edge / OPEN_GAP,
            "hold_over_weight": self.cube.friction * pinch(self.cube.edge) / (GRAVITY * self.cube.mass),
            "height_over_palm": self.cube.size[2] / PALM_ABOVE,
            "length_over_opening": self.cube.size[1] / OPEN_GAP,
        }

    def facts(self) -> Mapping[str, float | str]:
        turned = (
            "upright",
            "turned by 180 degrees",
            "left and right are exchanged",
            "above and below are exchanged",
            "turned by 90 degrees",
        )
        upright = {"simplest_plan": "nothing: this plan reaches the goal"} if self.orientation == UPRIGHT else {}
        return {
            "pictures": turned[self.view],
            "shown": "the right half" if self.orientation.seen_at(self.spot)[1] > 0.0 else "the left half",
            "side": "on its left" if self.y > 0.0 else "on its right",
            "aside": abs(self.y),
            "height": float(self.cube.size[2]),
            **upright,
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def spot(self) -> Vec3:
        """Initial position of the middle of the cube's foot [m]."""
        return np.array([self.x, self.y, TABLE_TOP])

    @staticmethod
    def _below(point: Vec3) -> Vec3:
        """Position on the table below a point [m]."""
        return np.array([point[0], point[1], TABLE_TOP])
