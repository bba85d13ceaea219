"""T02 recover-peg-insert: lay an upright peg level, bring it in line with a slot, and bring it in line once more.

                  back window
       pin o      ___|  |___
           |\\    |          |       seen from above: when the peg is in line before the mouth, the board turns about
           |board|          |       its pin, to the left or to the right. A peg that is askew comes through the front
                 |___    ___|       window, but meets the back plate.
                     |  |  mouth
                      ||
                      ||  peg, in the jaw

Bottleneck: what was in line is so no longer. The mouth has moved to the side and the slot points elsewhere; the peg
must be moved and turned, the right way, before it goes in. The paper names what fails: "rotated in the wrong
direction", "never achieved alignment" (App. J).

Decisions, where the paper (App. B, T02) is silent:

* What the "one-time +-10 deg yaw perturbation" turns. It is the board, by a servo: that is physics, and a peg in a hand
  cannot be turned without one. The pin is behind the mouth, so that mouth and direction change together.
* When "the peg aligns with the slot": its axis is within `ALIGNED` of the slot's, its nose within `BESIDE` of the
  slot's axis and as near to a mouth as `distance` says, on either side of the board. More than `ALIGNED` is more than
  the slot lets pass, so nobody gets in before it has turned; without the turn no goal counts.
* The slot has walls only at both ends. In a channel an arm that gives way is squared by the walls: a peg that was only
  shifted, not turned, went in 6 times in 6. Between two windows nothing squares it.
* "95 % of its length": so much of the peg is beyond the mouth, its middle within the slot. Whoever wants it flush may
  push on to 103 %. The board is shorter than the peg, or nothing could stick out for the hand to hold.
* Tipping the peg over and taking it again is one way, and not demanded: the goal counts. The oracle takes the peg from
  the side with a level hand, near its foot, and lays it down in the air by turning the hand down.
* The way of the turn is told by nothing before it happens. Who re-aims blindly to one side is right every other time.

The oracle looks all the time: it steers the nose by where peg and slot are now, waits where the nose is not in line,
and so corrects a peg that sits askew in the jaw, a board that has turned, and disturbances alike.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from ..assets.peg import Peg, Plinth
from ..assets.prop import TABLE_TOP, place, servo, table
from ..assets.slot_board import PLATE_THICKNESS, STIFFNESS, SlotBoard
from ..control.loop import Loop
from ..errors import GaveUp
from ..geometry import UP, Mat3, Outline, Vec3, about_z, axes, between, corners, gap, heading, polar, rotation
from ..params import param
from ..predicates import fallen, still
from ..robots.jaw import FINGER_ACROSS, PALM_ABOVE, TIP_BELOW
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.memory import remember
from ..sim.world import World
from ..skills.jaw import grasp, release
from ..skills.motion import CLOSED, COARSE, FINE, OPEN, STEADY, Condition, facing, go_to, push, retreat, steer, turn_to

HINGE = "board/hinge"
ALIGNED, BESIDE = math.radians(6.0), 0.010
"""Angle to the slot's axis [rad], and the nose's distance from it [m], up to which a peg is in line."""
HOME, DEEP, FLUSH = 0.95, 0.93, 1.03
"""Share of the length beyond the mouth: what the oracle pushes to (paper), and from where to where it counts."""
TURNED_BY = math.radians(3.0)
"""By how much the turn must exceed what the slot lets pass [rad]."""
GRIP = 0.024
"""How far above its foot the peg is taken [m]: the palm of the level hand is 32 mm below, the table 54 mm."""
SAFE = 0.003
"""How far before the back of the slot the peg's middle must be in the end [m]: then it lies there by itself."""
CLEAR = 0.006
"""How far the fingers stay from the board [m]."""
BEFORE = (0.08, 0.02)
"""How far before the mouth the nose is when the peg comes into line, and when it is brought into line again [m]."""
IN_LINE = (0.002, 0.015, 0.010)
"""Where a peg counts as brought into line: distance of the nose [m], angle [rad], speed [m/s]."""
ASIDE = 0.006
"""Distance from the slot's axis at which a nose before the mouth stops coming nearer [m]."""
BEHIND = 0.020
"""How far behind the peg the closed fingers come down for the last push [m]."""
ENTERING, SHOVING = 0.08, 0.06
"""How fast the peg goes in, held and pushed [m/s]."""

Line = tuple[Mat3, Vec3]
"""Axes of a slot, x leading in, and the middle of its mouth."""


@dataclass(frozen=True, kw_only=True)
class RecoverPegInsert(Scenario):
    """A peg on a plinth, and a board on a pin; everything is mirrored where the board is on the right."""

    HOLD = 0.3

    peg_x: float = param(-0.075, "m", -0.4, 0.4)
    peg_y: float = param(-0.075, "m", -0.4, 0.4)
    peg_yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)
    side: int = param(1, "1", -1, 1)
    """1 if the board is on the left, -1 on the right."""
    mouth_x: float = param(-0.04, "m", -0.4, 0.4)
    mouth_y: float = param(0.16, "m", -0.4, 0.4)
    board_yaw: float = param(0.0, "deg", -60.0, 60.0)
    """How far the slot leads away from the robot, at the start."""
    turn: float = param(10.0, "deg", -30.0, 30.0, hidden=True)
    """Of the board about the vertical, once the peg is in line."""
    distance: float = param(0.045, "m", 0.005, 0.075, hidden=True)
    """How near to the mouth the nose is then."""
    peg: Peg = Peg()
    board: SlotBoard = SlotBoard()

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.board)

    def _scene(self, board: SlotBoard) -> mujoco.MjSpec:
        scene, stand = table(), Plinth()
        remember(scene, "turned")
        place(scene, stand, "plinth", self.foot - stand.height * UP, self._peg_yaw, free=False)
        place(scene, self.peg, "peg", self.foot, self._peg_yaw)
        place(scene, board, "board", self.mouth + board.pivot * self.u, self._azimuth, free=False)
        servo(scene, HINGE, STIFFNESS)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        foot, top = self.ends(world)
        within = np.abs(foot + top)[1:].max() < self.board.slot  # the middle's two distances, doubled
        return bool(world.memory["turned"] and within and DEEP <= self.progress(world) <= FLUSH)

    def failure(self, world: World) -> str | None:
        return "the peg fell off the table" if fallen(world, "peg") else None

    def events(self, world: World) -> None:
        """As soon as the peg is in line the board turns, once."""
        if not world.memory["turned"] and self.in_line(world):
            world.memory["turned"] = 1.0
            world.drive(HINGE, math.radians(self.turn))

    def pending(self, world: World) -> bool:
        """Nothing happens as long as nobody brings the peg."""
        return False

    def in_line(self, world: World) -> bool:
        """Whether the peg points into the slot, outside of it and near, on either side of the board."""
        outwards = [abs(end[0] - self.board.depth / 2) - self.board.depth / 2 for end in self.ends(world)]
        nose = self.ends(world)[int(np.argmin(outwards))]
        way = self.ends(world)[1] - self.ends(world)[0]
        askew = math.atan2(math.hypot(way[1], way[2]), abs(way[0]))
        return askew < ALIGNED and math.hypot(nose[1], nose[2]) < BESIDE and 0.0 < min(outwards) < self.distance

    def slot(self, world: World) -> Line:
        """Where the slot is now."""
        rot = world.rot("board")
        return rot, world.pos("board") + rot @ np.array([-self.board.pivot, 0.0, self.board.centre])

    def ends(self, world: World) -> tuple[Vec3, Vec3]:
        """Foot and top of the peg, in the axes of the slot from the middle of the mouth [m]."""
        rot, mouth = self.slot(world)
        return rot.T @ (world.pos("peg") - mouth), rot.T @ (self.top(world) - mouth)

    def top(self, world: World) -> Vec3:
        """Middle of the peg's upper end: its nose, once it is laid level [m]."""
        return world.pos("peg") + self.peg.length * world.rot("peg")[:, 2]

    def progress(self, world: World) -> float:
        """Share of the peg's length that is beyond the mouth, for a peg in the slot."""
        foot, top = self.ends(world)
        return 0.5 + float(foot[0] + top[0]) / 2 / self.peg.length

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Take it, bring it into line, again after the turn, put it in as far as the fingers let, push the rest."""
        yield from self.take(world)
        yield from self.present(world)
        yield from self.guide(world, lambda: self.slot(world), -BEFORE[1])
        yield from self.enter(world, lambda: self.slot(world))
        yield from self.push_home(world)

    def take(self, world: World) -> Plan:
        """Come from the side with a level hand, take the peg near its foot, lift it."""
        arm, rot = world.arm, facing(self.side * math.pi / 2 + self._peg_yaw, 0.0)
        at = self.foot + GRIP * UP
        yield from go_to(arm, at - 0.12 * rot[:, 2] + (self.peg.length + 0.03) * UP, pace=COARSE, grip=OPEN)
        yield from turn_to(arm, rot, 1.5)
        yield from go_to(arm, at - 0.09 * rot[:, 2] + 0.01 * UP, rot, STEADY)
        yield from go_to(arm, at, rot, FINE)
        yield from grasp(arm)
        yield from retreat(arm)

    def present(self, world: World) -> Plan:
        """Lay the peg level by turning the hand down, and bring it to the mouth until the board turns."""
        yield from turn_to(world.arm, facing(self._azimuth, math.pi / 2), 1.2)
        yield from self.guide(world, lambda: self.slot(world), -BEFORE[0], 0.25)
        yield from self.guide(world, lambda: self.slot(world), 0.0, ENTERING, lambda: world.memory["turned"] > 0)

    def guide(
        self, world: World, line: Callable[[], Line], depth: float, speed: float = 0.15, ends: Condition | None = None
    ) -> Plan:
        """Steer the nose of the held peg to a place on a line, the peg along the line and flat.

        Args:
            line: where it is now.
            depth: of the place behind the mouth [m].
            speed: at which it comes nearer, if it is not aside [m/s].
            ends: when that is over; when the peg is there, in line and at rest, by default.

        Raises:
            GaveUp: that took too long.
        """
        arm, nose, end = world.arm, self.top(world), world.time + 6.0
        setpoint = nose
        while ends is None or not ends():
            (rot, mouth), nose = line(), self.top(world)
            goal = mouth + depth * rot[:, 0]
            turn, left = between(world.rot("peg"), _flat(world.rot("peg"), rot[:, 0])), goal - nose
            near, straight, calm = IN_LINE
            if ends is None and math.sqrt(left @ left) < near and math.sqrt(turn @ turn) < straight:
                if still(world, "peg", calm):
                    return
            if world.time > end:
                raise GaveUp(f"the peg's nose stayed {1000 * math.sqrt(left @ left):.0f} mm short of its place for 6 s")
            x, *off = rot.T @ (nose - mouth)
            waits = math.hypot(*off) / ASIDE if depth > 0.0 > x else 0.0
            ahead = goal - setpoint
            distance = math.sqrt(ahead @ ahead)
            velocity = ahead * (max(0.0, 1.0 - waits) * min(speed, 4.0 * distance) / max(distance, 1e-9))
            setpoint = setpoint + velocity * Loop.PERIOD
            yield steer(arm, setpoint + rotation(turn) @ (arm.hand - nose), velocity, turn, CLOSED)

    def enter(self, world: World, line: Callable[[], Line]) -> Plan:
        """Put the peg in along a line until the fingers come to the board, and let go.

        Raises:
            GaveUp: that took too long.
        """
        yield from self.guide(world, line, self.peg.length, ENTERING, lambda: self._close(world, CLEAR))
        yield from release(world.arm)
        yield from retreat(world.arm, 0.05)

    def push_home(self, world: World) -> Plan:
        """Come down behind the peg and push it, as far as it shall go or the fingers can.

        Raises:
            GaveUp: that took too long.
        """
        arm, foot, (rot, mouth) = world.arm, world.pos("peg"), self.slot(world)
        behind = np.array([*foot[:2], mouth[2]]) - (FINGER_ACROSS + BEHIND) * rot[:, 0]
        yield from go_to(arm, behind + 0.06 * UP, pace=COARSE, grip=CLOSED)
        yield from go_to(arm, behind, pace=FINE)
        yield from push(arm, SHOVING * rot[:, 0], lambda: self.progress(world) > HOME or self._close(world, 0.002))
        yield from go_to(arm, arm.hand - 0.03 * rot[:, 0])

    def _close(self, world: World, spare: float) -> bool:
        """Whether the fingers are as near as that to the plane of the mouth [m]."""
        rot, mouth = self.slot(world)
        return float((mouth - world.arm.hand) @ rot[:, 0]) < FINGER_ACROSS + spare

    # --- shortcuts and ablations ------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        return {
            "ignore_the_turn": Shortcut(lambda world: self._aim(world, 0.0, 0.0), to_rest=True),
            "shift_without_turning": Shortcut(lambda world: self._aim(world, 1.0, 0.0)),
            "turn_the_wrong_way": Shortcut(lambda world: self._aim(world, -1.0, -1.0)),
            "let_go_half_way": Shortcut(self._let_go),
            "put_it_there_upright": Shortcut(self._upright),
        }

    def _aim(self, world: World, shifted: float, turned: float) -> Plan:
        """Insert along a line that has followed the board in part: what share of its shift, and of its turn."""
        rot, mouth = self.slot(world)
        yield from self.take(world)
        yield from self.present(world)
        angle = math.radians(self.turn)
        pin = mouth + self.board.pivot * rot[:, 0]
        aim = about_z(turned * angle) @ rot, pin + about_z(shifted * angle) @ (mouth - pin)
        yield from self.guide(world, lambda: aim, -BEFORE[1])
        blocked = world.time + 4.0  # half of that is enough for a peg that is not
        ends = lambda: self._close(world, CLEAR) or world.time > blocked  # noqa: E731
        yield from self.guide(world, lambda: aim, self.peg.length, ENTERING, ends)
        yield from release(world.arm)
        yield from retreat(world.arm, 0.05)

    def _let_go(self, world: World) -> Plan:
        """As the oracle, but as soon as half of it is in it is left to itself."""
        yield from self.take(world)
        yield from self.present(world)
        yield from self.guide(world, lambda: self.slot(world), -BEFORE[1])
        half = self.peg.length / 2
        yield from self.guide(world, lambda: self.slot(world), half, ENTERING, lambda: self.progress(world) > 0.48)
        yield from release(world.arm)
        yield from retreat(world.arm)

    def _upright(self, world: World) -> Plan:
        """As if the slot were a place to put it: against the mouth as it stands, let go."""
        yield from self.take(world)
        rot, mouth = self.slot(world)
        held = world.arm.hand - world.com("peg")
        yield from go_to(world.arm, mouth + held - 0.02 * rot[:, 0] + 0.03 * UP, pace=COARSE)
        yield from release(world.arm)
        yield from retreat(world.arm, 0.05)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        return {"no_slot": self._scene(replace(self.board, plugged=True))}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        peg, board = self.peg, self.board
        yield require(self.side != 0, "the board stands neither left nor right", side=self.side)
        yield require(board.slot > peg.width, "the peg is wider than the slot", slot=board.slot, width=peg.width)
        steepest, turn = board.steepest(peg.width), abs(math.radians(self.turn))
        yield require(turn > steepest + TURNED_BY, "the turn leaves the way in open", turn=turn, passes=steepest)
        yield require(steepest < ALIGNED, "a peg gets in that is not in line", passes=steepest, aligned=ALIGNED)
        wall = board.chamfer + board.slot / 2
        yield require(wall < board.width / 2, "the board is narrower than its mouth", wall=wall, half=board.width / 2)
        room = board.centre + PALM_ABOVE - board.top
        yield require(room > 0.0, "the palm does not pass over the board", room=room)
        into = peg.length - GRIP - FINGER_ACROSS - CLEAR - (board.depth - PLATE_THICKNESS)
        yield require(into > 0.0, "the fingers come to the board before the nose is in the back window", into=into)
        balance = board.depth - (HOME - 0.5) * peg.length
        yield require(balance > SAFE, "the peg's middle is behind the slot in the end", balance=balance)
        yield on_table("the board or the peg", self.outlines)
        apart = min(gap(self.outlines[0], turned) for turned in self.outlines[1:])
        yield require(apart > 0.08, "board and peg are in each other's way", apart=apart)
        over = [self.mouth + (board.centre + TIP_BELOW) * UP, self.foot + (peg.length + 0.05) * UP]
        yield within_reach("the peg or the mouth", *over)

    def features(self) -> Mapping[str, float]:
        """How far the turn exceeds what passes, room in the slot, how far the mouth moves per angle [m], the slot's
        direction [rad], how much of the peg the slot leaves out, and when the board turns [m]."""
        steepest = self.board.steepest(self.peg.width)
        return {
            "turn_over_steepest": abs(math.radians(self.turn)) / steepest,
            "clearance_over_width": self.board.slot / self.peg.width - 1.0,
            "shift_per_turn": self.board.pivot,
            "azimuth_of_the_slot": self._azimuth,
            "peg_over_slot": self.peg.length / self.board.depth,
            "distance_at_the_turn": self.distance,
        }

    # --- geometry -------------------------------------------------------------------------

    @property
    def foot(self) -> Vec3:
        """Where the peg stands [m]."""
        return np.array([self.peg_x, self.side * self.peg_y, TABLE_TOP + Plinth().height])

    @property
    def mouth(self) -> Vec3:
        """Foot of the mouth's middle at the start [m]."""
        return np.array([self.mouth_x, self.side * self.mouth_y, TABLE_TOP])

    @property
    def u(self) -> Vec3:
        """Level unit vector into the slot at the start."""
        return heading(self.side * (90.0 - self.board_yaw))

    @property
    def outlines(self) -> list[Outline]:
        """Of the peg, and of the board before and after the turn."""
        board, pin = self.board, self.mouth + self.board.pivot * self.u
        middle = [board.depth / 2 - board.pivot, 0.0]
        yaws = (self._azimuth, self._azimuth + math.radians(self.turn))
        turned = [corners(pin, yaw, [board.depth, board.width], middle) for yaw in yaws]
        return [corners(self.foot, self._peg_yaw, self.peg.size), *turned]

    @property
    def _azimuth(self) -> float:
        """Of the slot at the start [rad]."""
        return polar(self.u)[0]

    @property
    def _peg_yaw(self) -> float:
        """Of the peg in the scene, mirrored or not [rad]."""
        return math.radians(self.side * self.peg_yaw)


def _flat(here: Mat3, u: Vec3) -> Mat3:
    """Of the four orientations in which a square bar along `u` lies flat the nearest one."""
    beside = np.cross(UP, u)
    return max((axes(x, u) for x in (UP, -UP, beside, -beside)), key=lambda rot: float(np.sum(rot * here)))
