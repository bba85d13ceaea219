"""T24 cup-extract: get a block out of a cup that is deeper than the fingers are long.

        |    |___            hand          The palm, wider than the cup, stops at its rim, and the fingers end above
        |    |   |        ____|____        the block. The cup is taken by its handle and turned until its mouth
        | __ |   |   ->  |  __     |       points down by more than the angle at which the block slides.
        ||  ||---         __|__|___
        |____|             -.  []
    --------------        ----------

Bottleneck: the block is out of reach of the hand from every direction. It leaves the cup only if the cup is turned
beyond level by the angle of friction on its wall, and only the handle allows that turn:

* The wall is so thin that the jaw's springs exert almost no force when the fingers close on it (`pinch`): friction
  there does not lift an upright cup. The handle is thick. The wall still lets a jaw lean the cup on the table, and then
  lift it on its side, because it lies on a finger. Held as deep as the palm allows, 5 of 6 were turned to more than 110
  deg in the air, but the palm is over the mouth, and the block stayed in all; held less deep, 2 of 6 were, and it
  stayed as well. A block that leaves a cup on the table is labelled.
* Fingers that open inside the cup slide out of it: they taper more than the friction of the wall holds.
* A pushed cup slides: its friction on the table is less than the distance of its centre of mass from the edge over its
  height, also towards the handle.

Decisions, where the paper (App. B, T24) is silent:

* It gives no lengths. The block is as thick as the fingers are long, so a palm over the mouth blocks it: "blocking the
  object from exiting" is among the paper's failures (App. J).
* In the region means: out of the cup, upright or upside down, touching the table alone, at rest, for 0.3 s, 30 steps as
  in the paper's T12 and T13. The cup may then be anywhere on the table. Pouring the block straight into the region
  counts, and so does shaking it out of a cup held level by its handle: the insight is the same.
* The direction of the handle needs no look in training: a jaw that closes where the handle is at 180 deg solves 12 of
  12, and on `turned_handle` 0 of 3.
* The friction of the wall is not visible; a cup that is turned slowly shows it. There is no `answer` to guess, because
  turning the cup farther than needed is not a failure.
"""

import math
from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial

import mujoco
import numpy as np

from ..assets.box import Block
from ..assets.cup import Cup
from ..assets.patch import Patch
from ..assets.prop import PRIORITY, TABLE_TOP, place, solid, table
from ..compat import set_multiccd
from ..decisions import Decision, around, choice, near, span
from ..geometry import UP, Vec3, about_y, about_z, heading, polar, spoken, way_to
from ..means import Mean, when
from ..params import param
from ..physics import GRAVITY
from ..predicates import fallen, over, rests_on, still
from ..robots.jaw import OPENING, PALM_ABOVE, PALM_ACROSS, TIP_BELOW, TIP_SPAN_CLOSED, pinch
from ..robots.panda import BASE
from ..scenario import Action, Plan, Planner, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT
from ..sim.world import World
from ..skills import motion
from ..skills.grip import take
from ..skills.jaw import grasp, pick, put
from ..skills.motion import COARSE, FINE, OPEN, STEADY, closing_along, go_to, retreat

MUG = Cup(
    base=0.043, rim=0.043, wall=0.002, bead=0.0, handle=0.046, bar=0.014, mass=0.09, friction=0.10, handle_friction=0.9
)
"""A cup 86 mm wide, more than the jaw opens, smooth as glazed china or polished metal; the handle is rubber."""
MIN_CLEARANCE = 0.005
"""Least clearance between the hand and other bodies [m]: jitter takes 2 mm, moves are exact to 3 mm."""
FINGER_TAPER = 0.35
"""Slope of the fingers' outer sides, which come nearer to each other towards the tips: measured in a cup."""
POUR_DISTANCE = 0.41
"""Distance from the robot's first axis at which the hand pours [m]; farther out it cannot point back at the robot."""
POUR_HEIGHT = 0.16
"""Height above the table at which the hand pours [m]. That leaves 2 cm under the cup: a block that falls 8 cm tumbles
so chaotically that a nanometre at the start decides where it comes to rest, and a replay outside of this MuJoCo
misses."""
MIN_POUR_TILT = math.radians(60.0)
"""Tilt from which a cup counts as tipped [rad]. A block may be shaken out of a cup that is held level, at 90 deg."""
MAX_POUR_TILT = math.radians(130.0)  # largest tilt of the cup to which a hand at `POUR_DISTANCE` turns it [rad]
TURN_RATE = 1.2  # rate at which the cup turns while the block cannot slide yet, and back [rad/s]
LIFT_HEIGHT = 0.06  # height by which the cup is lifted [m]
POUR_RATE = 0.3  # rate at which the cup turns while it pours [rad/s]
REST_SPEED = 0.02  # speed below which the block counts as at rest [m/s]


@dataclass(frozen=True, kw_only=True)
class CupExtract(Scenario):
    """A block in a cup with a handle, and a green square on the table."""

    VERSION = 2
    HOLD = 0.3

    x: float = param(0.0, "m", -0.4, 0.4)
    y: float = param(0.0, "m", -0.4, 0.4)
    handle: float = param(180.0, "deg", 0.0, 360.0, period=360.0)  # direction of the handle; 180 is towards the robot
    goal_x: float = param(-0.10, "m", -0.4, 0.4)
    goal_y: float = param(-0.25, "m", -0.4, 0.4)
    cup: Cup = MUG
    block: Block = Block(width=0.040, height=0.044, mass=0.035, friction=0.5)
    patch: Patch = Patch(size=0.11)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.cup)

    def _scene(self, cup: Cup) -> mujoco.MjSpec:
        scene, turn = table(), math.radians(self.handle)
        # An edge that lies on the wall by one point rocks, and creeps down at 10 mm/s far from the angle of friction.
        set_multiccd(scene, True)
        place(scene, cup, "cup", self.foot, turn)
        place(scene, self.block, "block", self.foot + cup.floor * UP, turn)
        place(scene, self.patch, "patch", self.goal, free=False)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        placed = over(world, "block", self.goal, self.patch.size / 2) and rests_on(world, "block", "table")
        return placed and still(world, "block", REST_SPEED) and not self.within(world)

    def within(self, world: World) -> bool:
        """Whether the middle of the block is inside the cup, in any pose of the cup."""
        x, y, z = world.rot("cup").T @ (world.com("block") - world.pos("cup"))
        return math.hypot(x, y) <= self.cup.rim and 0.0 <= z <= self.cup.height

    def failure(self, world: World) -> str | None:
        lost = fallen(world, "block", "cup")
        return f"the {lost} fell off the table" if lost else None

    def means(self) -> Mapping[str, Mean]:
        def leaves(world: World) -> bool:
            return not self.within(world)

        def lifted(world: World) -> bool:
            return world.arm.grips("cup") and world.touching_bodies("cup") <= {ROBOT, "block"}

        return {
            "the jaw held the cup in the air as the block left it": when(leaves, lifted),
            "the cup was tipped as the block left it": when(leaves, lambda world: world.tilt("cup") >= MIN_POUR_TILT),
            "no hand touched the block in the cup": when(leaves, lambda world: not world.touched(ROBOT, "block")),
        }

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Take the cup by its handle, pour the block out, put the cup aside, place the block."""
        yield from self.take_cup(world)
        yield from self.pour(world)
        yield from self.put_down(world, self.aside)
        yield from self.place_block(world)

    def take_cup(self, world: World, lift: float = LIFT_HEIGHT) -> Plan:
        """Grasp the upright of the handle and lift the cup clear of the table [m]."""
        rot = world.rot("cup")
        yield from pick(world.arm, world.pos("cup") + rot @ self.cup.grip, rot[:, 1], lift=lift)

    def pour(self, world: World, tilt: float = MAX_POUR_TILT) -> Plan:
        """Turn the handle to the robot, then the mouth away and down, until the block is out or up to a tilt [rad]."""
        arm, bearing = world.arm, polar(world.arm.hand - BASE)[0]
        spot = BASE * [1.0, 1.0, 0.0] + POUR_DISTANCE * heading(math.degrees(bearing)) + (TABLE_TOP + POUR_HEIGHT) * UP
        upright = about_z(math.remainder(bearing - polar(-world.rot("cup")[:, 0])[0], math.tau)) @ arm.hand_rot
        yield from go_to(arm, spot, upright, STEADY)
        for angle, rate in ((math.radians(85.0), TURN_RATE), (tilt, POUR_RATE)):
            tilted = about_z(bearing) @ about_y(angle) @ about_z(-bearing) @ upright
            turned = motion.turn_to(arm, tilted, rate)
            yield from motion.until(turned, lambda a=angle: world.tilt("cup") >= a or not self.within(world))
        yield from motion.turn_to(arm, upright, TURN_RATE, within=0.1)

    def put_down(self, world: World, spot: Vec3) -> Plan:
        """Put the held cup down upright at a place [m] and let go."""
        com = world.com("cup") - world.pos("cup")
        yield from put(world.arm, "cup", spot + com, "table", hover=0.06)
        yield from retreat(world.arm)

    def place_block(self, world: World) -> Plan:
        """When the block is at rest, take it, put it in the middle of the square, let go."""
        height = yield from self._take_block(world)
        yield from self._place(world, height)

    def _take_block(self, world: World) -> Generator[Action, None, float]:
        """When the block is at rest, take it; returns the height of its middle before that [m]."""
        yield from motion.wait(world.arm, lambda: still(world, "block", REST_SPEED), 2.0)
        stood = float(world.com("block")[2])
        yield from take(world.arm, "block")
        return stood

    def _place(self, world: World, height: float) -> Plan:
        """Put the held block in the middle of the square, its middle at a height [m], and let go."""
        yield from put(world.arm, "block", [self.goal_x, self.goal_y, height], "table", hover=0.06)
        yield from retreat(world.arm, 0.06)

    def steps(self) -> Mapping[str, Planner]:
        stood = list[float]()

        def take_block(world: World) -> Plan:
            stood.append((yield from self._take_block(world)))

        return {
            "take_handle": partial(self.take_cup, lift=0.0),
            "lift_cup": lambda world: retreat(world.arm, LIFT_HEIGHT),
            "pour": self.pour,
            "put_cup_aside": lambda world: self.put_down(world, self.aside),
            "take_block": take_block,
            "place_block": lambda world: self._place(world, stood[-1] if stood else world.com("block")[2]),
            "reach_in": self._reach_in,
            "hold_wall": self._hold_wall,
            "push_over": self._knock,
        }

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "reach_in": Shortcut(self._reach_in),
            "pour_by_the_rim": Shortcut(self._by_the_rim),
            "tip_it_level": Shortcut(self._level),
            "bring_the_cup": Shortcut(self._bring, to_rest=True),
            "knock_it_over": Shortcut(self._knock, to_rest=True),
        }

    def _reach_in(self, world: World) -> Plan:
        """Enter the cup with the fingers as far apart and as deep as it allows, close, lift, move to the square."""
        arm, across = world.arm, world.rot("cup")[:, 1]
        mouth = world.pos("cup") + (self.cup.height + TIP_BELOW + 0.02) * UP
        yield from go_to(arm, mouth, closing_along(arm, across), STEADY, OPEN)
        narrow = 2 * (self.cup.rim - self.cup.wall - MIN_CLEARANCE) - TIP_SPAN_CLOSED
        yield from motion.until(grasp(arm, 1.0), lambda: arm.gap <= narrow)
        yield from go_to(arm, mouth - (TIP_BELOW + 0.02 + PALM_ABOVE - MIN_CLEARANCE) * UP, pace=FINE, grip=0.0)
        yield from grasp(arm)
        yield from retreat(arm, 0.15)
        yield from go_to(arm, self.goal + 0.08 * UP)

    def _by_the_rim(self, world: World) -> Plan:
        """Pinch the wall at the handle, lift, pour."""
        yield from self._hold_wall(world)
        yield from self.pour(world, math.radians(100.0))

    def _hold_wall(self, world: World) -> Plan:
        """Pinch the wall at the handle, as deep as the palm allows, and lift."""
        arm, out = world.arm, -world.rot("cup")[:, 0]
        at = world.pos("cup") + (self.cup.rim - self.cup.wall / 2) * out
        yield from pick(arm, at + (self.cup.height - PALM_ABOVE + MIN_CLEARANCE) * UP, out, lift=LIFT_HEIGHT)

    def _level(self, world: World) -> Plan:
        """Turn the cup only until it is level, and back."""
        yield from self.take_cup(world)
        yield from self.pour(world, math.radians(90.0))
        yield from self.put_down(world, self.aside)

    def _bring(self, world: World) -> Plan:
        """Put the cup down in the square with the block in it."""
        yield from self.take_cup(world)
        yield from self.put_down(world, self.goal)

    def _knock(self, world: World) -> Plan:
        """Push the cup at its rim with closed fingers, over its handle, at full speed."""
        arm, along = world.arm, world.rot("cup")[:, 0]
        beside = world.pos("cup") - (self.cup.rim + 0.03) * along + (self.cup.height - 0.002) * UP
        yield from go_to(arm, beside + 0.05 * UP, closing_along(arm, world.rot("cup")[:, 1]), COARSE, motion.CLOSED)
        yield from go_to(arm, beside, pace=FINE)
        yield from motion.push(arm, 0.3 * along, lambda: float((arm.hand - beside) @ along) > 0.20)
        yield from retreat(arm)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """Remove the handle, so that nothing lifts the cup; cover the cup, so that nothing leaves it."""
        covered = self.build()
        lid = {"type": mujoco.mjtGeom.mjGEOM_CYLINDER, "mass": 0.0, "priority": PRIORITY + 1}
        solid(covered.body("cup"), "lid", [self.cup.rim, 0.001], [0.0, 0.0, self.cup.height + 0.001], **lid)
        return {"no_handle": self._scene(replace(self.cup, handle=0.0)), "covered": covered}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        return {
            "handle": around(self.handle, 12.0, "handle"),
            "tilt": span(90.0 + math.degrees(math.atan(self.cup.friction)), 130.0, "cup.friction"),
            "square": near((self.goal_x, self.goal_y), 0.030, "goal_x", "goal_y"),
            "side_of_the_handle": choice(self.handle > 180.0, "handle"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        cup, block = self.cup, self.block
        yield require(cup.has_handle, "the cup has no handle", handle=cup.handle)
        beside = cup.grip[0] - cup.rim - PALM_ACROSS
        yield require(beside >= MIN_CLEARANCE, "the palm does not fit between handle and cup", room=beside)
        narrowest = 2 * min(cup.base, cup.rim)
        yield require(narrowest > OPENING, "the jaw can span the cup", width=narrowest, jaw=OPENING)
        above = cup.height - cup.floor - block.height - PALM_ABOVE - TIP_BELOW
        yield require(above >= MIN_CLEARANCE, "the fingers come down to the block", room=above)
        around = min(cup.base, cup.rim) - max(cup.wall, cup.bead) - block.width / math.sqrt(2)
        yield require(around >= MIN_CLEARANCE, "the block sticks in the cup", room=around)
        weight, bears = GRAVITY * (cup.mass + block.mass), pinch(max(cup.wall, cup.bead)) * cup.friction
        yield require(bears < 0.9 * weight, "the jaw can carry the cup by its wall", bears=bears, weight=weight)
        yield require(
            cup.friction < FINGER_TAPER,
            "fingers opened in the cup can carry it",
            friction=cup.friction,
            taper=FINGER_TAPER,
        )
        com = cup.mass / (cup.mass + block.mass) * float(cup.inertial()[0][0])
        slides = (cup.base - com) / cup.height  # towards the handle, where its weight is
        yield require(cup.friction < 0.85 * slides, "a motion.push tips the cup", friction=cup.friction, most=slides)
        turn = about_z(math.radians(self.handle))
        ends = [self.foot + turn @ [cup.grip[0] + cup.bar / 2, 0.0, 0.0], self.foot + turn @ [-cup.rim, 0.0, 0.0]]
        yield on_table("the cup", ends)
        yield on_table("the square", self.goal, margin=self.patch.size / 2)
        apart = math.dist(self.foot, self.goal) - cup.grip[0] - self.patch.size
        yield require(apart >= 0.0, "the cup stands on the square", room=apart)
        yield within_reach("the handle or the square", self.foot + turn @ cup.grip, self.goal + 0.1 * UP)

    def features(self) -> Mapping[str, float]:
        """Direction of the handle relative to the robot's first axis [rad], tilt at which the block slides [rad], depth
        in lengths of the fingers, shape of the handle, torque of the weight about the jaw over the force of the pads
        [m], bearing of the square [rad]."""
        com, _ = self.cup.inertial()
        moment = GRAVITY * float(self.cup.mass * (self.cup.grip - com)[0] + self.block.mass * self.cup.grip[0])
        towards, _ = polar(self.foot - BASE)
        return {
            "handle_to_robot": math.remainder(math.radians(self.handle) - math.pi - towards, math.tau),
            "sliding_tilt": self.sliding_tilt,
            "depth_over_fingers": self.cup.height / (PALM_ABOVE + TIP_BELOW),
            "curve": self.cup.curve,
            "moment_over_pinch": moment / pinch(self.cup.bar),
            "goal_bearing": polar(self.goal - BASE)[0],
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "handle": spoken(self.handle),
            "square": way_to(self.goal, self.foot),
            "apart": math.dist(self.goal, self.foot),
            "height": self.cup.height,
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def foot(self) -> Vec3:
        """Initial position of the cup's foot [m]."""
        return np.array([self.x, self.y, TABLE_TOP])

    @cached_property
    def goal(self) -> Vec3:
        """Middle of the square [m]."""
        return np.array([self.goal_x, self.goal_y, TABLE_TOP])

    @cached_property
    def sliding_tilt(self) -> float:
        """Tilt of the cup at which the block slides [rad]: two edges of the block lie on the wall as in a groove."""
        aslant = math.asin(self.block.width / 2 / (self.cup.rim - self.cup.wall))
        return math.pi / 2 + math.atan(self.cup.friction / math.cos(aslant))

    @cached_property
    def aside(self) -> Vec3:
        """Place for the empty cup, on the side away from the square [m]."""
        return np.array([-0.13, math.copysign(0.25, -self.goal_y), TABLE_TOP])
