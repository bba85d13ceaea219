"""T02 recover-peg-insert: lay an upright peg level, align it with a slot, and align it again after the slot has moved.

                  back window
       pin o      ___|  |___
           |\\    |          |       seen from above: when the peg is in line before the mouth, the board turns about
           |board|          |       its pin, to the left or to the right. A peg that is askew comes through the front
                 |___    ___|       window, but meets the back plate.
                     |  |  mouth
                      ||
                      ||  peg, in the jaw

Bottleneck: the alignment is lost once. The mouth moves to the side and the slot points in another direction; the peg
must be moved and turned, the right way, before it goes in. The paper names these failures: "rotated in the wrong
direction", "never achieved alignment" (App. J).

Decisions, where the paper (App. B, T02) is silent:

* What the "one-time +-10 deg yaw perturbation" turns. Here a servo turns the board: that is physics, while a peg in a
  hand cannot be turned without a body that turns it. The pin is behind the mouth, so place and direction change
  together.
* When "the peg aligns with the slot": its axis is within `ALIGN_ANGLE` of the slot's, its nose within `SIDE_TOLERANCE`
  of the slot's axis and as near to a mouth as `distance` says, on either side of the board. A larger angle does not
  pass the slot, and without the turn no goal counts.
* A peg that is partly in the board does not turn it. A nose that came in askew and was squared up inside would turn the
  board around the inserted peg, with nothing to recover (12 of 12). Such a peg must come out again.
* The slot has walls only at both ends. In a channel the walls square a compliant arm: a peg that was only shifted, not
  turned, went in 6 times out of 6. Between two windows nothing squares it.
* "95 % of its length": this share of the peg is beyond the mouth, with its middle within the slot. Up to 103 % counts,
  so that a policy may push it flush. The board is shorter than the peg, so that the end in the hand sticks out.
* Tipping the peg over and grasping it again is one way, and not demanded: the goal counts. The oracle grasps the peg
  from the side with a level hand, near its foot, and lays it level in the air by turning the hand down.
* The direction of the turn is hidden until it happens: re-aiming blindly to one side is right in half of the scenarios.
  A peg that is stopped on the wrong side and re-aimed to the other goes in (12 of 12). That is labelled: after the turn
  neither hand nor peg feels for the window.

The oracle uses feedback: it steers the nose by the present poses of peg and slot, and waits while the nose is out of
line. This corrects a peg that sits askew in the jaw, a board that has turned, and disturbances alike.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from ..assets.peg import Peg, Plinth
from ..assets.prop import TABLE_TOP, place, servo, table
from ..assets.slot_board import PLATE_THICKNESS, STIFFNESS, SlotBoard
from ..decisions import Decision, around, choice, near, side_of
from ..geometry import UP, Outline, Vec3, about_z, corners, gap, heading, polar, way_to
from ..means import Mean, throughout, when
from ..params import param
from ..predicates import fallen
from ..robots.jaw import FINGER_ACROSS, PALM_ABOVE, TIP_BELOW
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.arm import ROBOT
from ..sim.memory import remember
from ..sim.world import World
from ..skills import insertion
from ..skills.insertion import Aim, Line
from ..skills.jaw import let_go
from ..skills.motion import COARSE, Condition, facing, go_to, turn_to
from ..skills.waiting import elapsed

HINGE = "board/hinge"
ALIGN_ANGLE = math.radians(6.0)  # largest angle between peg and slot for the peg to be in line [rad]
SIDE_TOLERANCE = 0.010  # largest distance of the nose from the slot's axis for the peg to be in line [m]
TURN_MARGIN = math.radians(3.0)  # angle by which the turn exceeds the steepest one that passes the slot [rad]
INSERTED_SHARE = 0.95  # share of the peg's length beyond the mouth to which the oracle pushes (paper)
MIN_INSERTED_SHARE = 0.93  # least such share that counts
MAX_INSERTED_SHARE = 1.03  # largest such share that counts: a flush peg
GRIP_HEIGHT = 0.024
"""Height above the foot at which the peg is grasped [m]: the level hand's palm is 32 mm below, the table 54 mm."""
BOARD_CLEARANCE = 0.006  # clearance of the fingers from the board when they release the peg [m]
WAITING_DISTANCE = 0.02  # distance before the mouth at which the nose is aligned again after the turn [m]
ENTER_SPEED = 0.08  # speed at which the held peg enters the slot [m/s]


@dataclass(frozen=True, kw_only=True)
class RecoverPegInsert(Scenario):
    """A peg on a plinth, and a board on a pin; everything is mirrored if the board is on the right."""

    VERSION = 2
    HOLD = 0.3

    peg_x: float = param(-0.075, "m", -0.4, 0.4)
    peg_y: float = param(-0.075, "m", -0.4, 0.4)
    peg_yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)
    side: int = param(1, "1", -1, 1)  # 1 if the board is on the left, -1 on the right
    mouth_x: float = param(-0.04, "m", -0.4, 0.4)
    mouth_y: float = param(0.16, "m", -0.4, 0.4)
    board_yaw: float = param(0.0, "deg", -60.0, 60.0)  # angle by which the slot leads away from the robot at the start
    turn: float = param(10.0, "deg", -30.0, 30.0, hidden=True)
    """Turn of the board about the vertical, once the peg is in line."""
    distance: float = param(0.045, "m", 0.005, 0.075, hidden=True)
    """Distance of the nose from the mouth below which the board turns."""
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
        inserted = MIN_INSERTED_SHARE <= self.inserted_share(world) <= MAX_INSERTED_SHARE
        return bool(world.memory["turned"] and within and inserted)

    def failure(self, world: World) -> str | None:
        return "the peg fell off the table" if fallen(world, "peg") else None

    def means(self) -> Mapping[str, Mean]:
        turned, room = "the jaw held the whole peg outside when the board turned", self.board.slot - self.peg.width

        def outside(world: World) -> bool:
            foot, top = (end[0] for end in self.ends(world))
            return max(foot, top) < 0.0 or min(foot, top) > self.board.depth

        def before_window(world: World) -> bool:
            nose = min(self.ends(world), key=lambda end: abs(end[0] - self.board.depth / 2))
            return bool(np.abs(nose[1:]).max() < room / 2 + self.board.chamfer)

        def feels(world: World) -> bool:
            by_hand = world.touching(ROBOT, "board") and outside(world)
            return by_hand or (world.touching("peg", "board") and not before_window(world))

        return {
            turned: when(
                lambda world: world.memory["turned"] > 0, lambda world: outside(world) and world.arm.grips("peg")
            ),
            "after the turn neither hand nor peg felt for the window": throughout(
                lambda world: not feels(world), after=turned
            ),
            "the jaw led the nose into the window": when(
                lambda world: not outside(world),
                lambda world: before_window(world) and world.arm.grips("peg"),
                after=turned,
            ),
        }

    def events(self, world: World) -> None:
        """Turn the board once, as soon as the peg is in line."""
        if not world.memory["turned"] and self.in_line(world):
            world.memory["turned"] = 1.0
            world.drive(HINGE, math.radians(self.turn))

    def pending(self, world: World) -> bool:
        """Never: the board turns only when the peg is brought into line."""
        return False

    def in_line(self, world: World) -> bool:
        """Whether the peg points into the slot from near outside, on either side of the board."""
        lengthwise = [end[0] - self.board.depth / 2 for end in self.ends(world)]
        outwards = [abs(x) - self.board.depth / 2 for x in lengthwise]
        nose = self.ends(world)[int(np.argmin(outwards))]
        axis = self.ends(world)[1] - self.ends(world)[0]
        askew = math.atan2(math.hypot(axis[1], axis[2]), abs(axis[0]))
        return (
            askew < ALIGN_ANGLE
            and math.hypot(nose[1], nose[2]) < SIDE_TOLERANCE
            and 0.0 < min(outwards) < self.distance
            and self.outside(lengthwise)
        )

    def outside(self, lengthwise: Sequence[float]) -> bool:
        """Whether both ends of the peg, given along the slot from the board's middle [m], are on one side of it."""
        return min(lengthwise) * max(lengthwise) > 0.0

    def slot(self, world: World) -> Line:
        """Present pose of the slot."""
        rot = world.rot("board")
        return rot, world.pos("board") + rot @ np.array([-self.board.pivot, 0.0, self.board.centre])

    def ends(self, world: World) -> tuple[Vec3, Vec3]:
        """Foot and top of the peg, in the axes of the slot, relative to the middle of the mouth [m]."""
        rot, mouth = self.slot(world)
        return rot.T @ (world.pos("peg") - mouth), rot.T @ (self.top(world) - mouth)

    def top(self, world: World) -> Vec3:
        """Middle of the peg's upper end, which is its nose once it is level [m]."""
        return world.pos("peg") + self.peg.length * world.rot("peg")[:, 2]

    def inserted_share(self, world: World) -> float:
        """Share of the peg's length that is beyond the mouth, for a peg in the slot."""
        foot, top = self.ends(world)
        return 0.5 + float(foot[0] + top[0]) / 2 / self.peg.length

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Take the peg, align it before and after the turn, insert it as far as the fingers allow, push the rest."""
        yield from self.present(world)
        yield from self.guide(world, lambda: self.slot(world), -WAITING_DISTANCE)
        yield from self.enter(world, lambda: self.slot(world))
        yield from self.push_home(world)

    def take(self, world: World) -> Plan:
        """Grasp the peg near its foot from the side with a level hand, lift it."""
        rot, at = facing(self.side * math.pi / 2 + self._peg_yaw, 0.0), self.foot + GRIP_HEIGHT * UP
        yield from insertion.take_upright(world.arm, at, rot, self.peg.length + 0.03)

    def present(self, world: World) -> Plan:
        """Take the peg, lay it level by turning the hand down, and bring it to the mouth until the board turns."""
        yield from self.take(world)
        yield from turn_to(world.arm, facing(self._azimuth, math.pi / 2), 1.2)
        yield from self.guide(world, lambda: self.slot(world), -0.08, 0.25)  # 5 mm outside of the largest `distance`
        yield from self.guide(world, lambda: self.slot(world), 0.0, ENTER_SPEED, lambda: world.memory["turned"] > 0)

    def guide(self, world: World, aim: Aim, depth: float, speed: float = 0.15, ends: Condition | None = None) -> Plan:
        """Steer the peg's nose to a place on a line; see `insertion.guide`."""
        yield from insertion.guide(world.arm, "peg", lambda: self.top(world), aim, depth, speed, ends)

    def enter(self, world: World, aim: Aim, seconds: float = math.inf) -> Plan:
        """Insert the peg along a line until the fingers are near the board or the time is over [s], and let go."""
        over = elapsed(world, seconds)
        ends = lambda: self._near_board(world, BOARD_CLEARANCE) or over()  # noqa: E731
        yield from self.guide(world, aim, self.peg.length, ENTER_SPEED, ends)
        yield from let_go(world.arm, 0.05)

    def push_home(self, world: World) -> Plan:
        """Come down behind the peg with closed fingers and push it in, at most until they are near the board."""
        foot, (rot, mouth) = world.pos("peg"), self.slot(world)
        behind = np.array([*foot[:2], mouth[2]]) - (FINGER_ACROSS + 0.020) * rot[:, 0]  # 20 mm behind the peg
        done = lambda: self.inserted_share(world) > INSERTED_SHARE or self._near_board(world, 0.002)  # noqa: E731
        yield from insertion.push_in(world.arm, behind, rot[:, 0], done)

    def _near_board(self, world: World, clearance: float) -> bool:
        """Whether the fingers are nearer than a clearance to the plane of the mouth [m]."""
        rot, mouth = self.slot(world)
        return float((mouth - world.arm.hand) @ rot[:, 0]) < FINGER_ACROSS + clearance

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
        """Insert along a line that follows the board by a share of its shift and a share of its turn."""
        rot, mouth = self.slot(world)
        yield from self.present(world)
        angle, pin = math.radians(self.turn), mouth + self.board.pivot * rot[:, 0]
        aim = about_z(turned * angle) @ rot, pin + about_z(shifted * angle) @ (mouth - pin)
        yield from self.guide(world, lambda: aim, -WAITING_DISTANCE)
        yield from self.enter(world, lambda: aim, 4.0)  # a peg that is not blocked takes half of that

    def _let_go(self, world: World) -> Plan:
        """As the oracle, but release the peg when half of it is in."""
        yield from self.present(world)
        yield from self.guide(world, lambda: self.slot(world), -WAITING_DISTANCE)
        half_in = lambda: self.inserted_share(world) > 0.48  # noqa: E731
        yield from self.guide(world, lambda: self.slot(world), self.peg.length / 2, ENTER_SPEED, half_in)
        yield from let_go(world.arm)

    def _upright(self, world: World) -> Plan:
        """Put the upright peg against the mouth, let go."""
        yield from self.take(world)
        rot, mouth = self.slot(world)
        held = world.arm.hand - world.com("peg")
        yield from go_to(world.arm, mouth + held - 0.02 * rot[:, 0] + 0.03 * UP, pace=COARSE)
        yield from let_go(world.arm, 0.05)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        return {"no_slot": self._scene(replace(self.board, plugged=True))}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        shift = self.board.pivot * math.sin(math.radians(abs(self.turn)))
        return {
            "board_turns": choice(side_of(self.turn)),
            "mouth_shifts_by": around(shift, 0.002, "board"),
            "side_of_the_board": choice(self.side, "side"),
            "first_mouth": near(self.mouth, 0.010, "mouth_x", "mouth_y"),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        peg, board = self.peg, self.board
        yield require(self.side != 0, "the board stands neither left nor right", side=self.side)
        yield require(board.slot > peg.width, "the peg is wider than the slot", slot=board.slot, width=peg.width)
        steepest, turn = board.steepest(peg.width), abs(math.radians(self.turn))
        yield require(turn > steepest + TURN_MARGIN, "the turn leaves the way in open", turn=turn, passes=steepest)
        yield require(steepest < ALIGN_ANGLE, "a peg gets in that is not in line", passes=steepest, aligned=ALIGN_ANGLE)
        wall = board.chamfer + board.slot / 2
        yield require(wall < board.width / 2, "the board is narrower than its mouth", wall=wall, half=board.width / 2)
        clearance = board.centre + PALM_ABOVE - board.top
        yield require(clearance > 0.0, "the palm does not pass over the board", room=clearance)
        into = peg.length - GRIP_HEIGHT - FINGER_ACROSS - BOARD_CLEARANCE - (board.depth - PLATE_THICKNESS)
        yield require(into > 0.0, "the fingers come to the board before the nose is in the back window", into=into)
        balance = board.depth - (INSERTED_SHARE - 0.5) * peg.length
        # a peg whose middle is 3 mm before the back of the slot lies there by itself
        yield require(balance > 0.003, "the peg's middle is behind the slot in the end", balance=balance)
        yield on_table("the board or the peg", self.outlines)
        apart = min(gap(self.outlines[0], turned) for turned in self.outlines[1:])
        yield require(apart > 0.08, "board and peg are in each other's way", apart=apart)
        over = [self.mouth + (board.centre + TIP_BELOW) * UP, self.foot + (peg.length + 0.05) * UP]
        yield within_reach("the peg or the mouth", *over)

    def features(self) -> Mapping[str, float]:
        """Turn over the angle that passes, clearance, shift of the mouth per angle [m], direction of the slot [rad],
        length of the peg over the slot's, and distance at which the board turns [m]."""
        steepest = self.board.steepest(self.peg.width)
        return {
            "turn_over_steepest": abs(math.radians(self.turn)) / steepest,
            "clearance_over_width": self.board.slot / self.peg.width - 1.0,
            "shift_per_turn": self.board.pivot,
            "azimuth_of_the_slot": self._azimuth,
            "peg_over_slot": self.peg.length / self.board.depth,
            "distance_at_the_turn": self.distance,
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "side": "on its left" if self.side > 0 else "on its right",
            "peg": way_to(np.array([self.peg_x, self.peg_y]), self.mouth),
            "apart": math.dist(self.foot[:2], self.mouth[:2]),
            "length": self.peg.length,
            "slot": self.board.slot,
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def foot(self) -> Vec3:
        """Initial position of the peg's foot [m]."""
        return np.array([self.peg_x, self.side * self.peg_y, TABLE_TOP + Plinth().height])

    @cached_property
    def mouth(self) -> Vec3:
        """Point on the table below the middle of the mouth, at the start [m]."""
        return np.array([self.mouth_x, self.side * self.mouth_y, TABLE_TOP])

    @cached_property
    def u(self) -> Vec3:
        """Level unit vector into the slot at the start."""
        return heading(self.side * (90.0 - self.board_yaw))

    @cached_property
    def outlines(self) -> list[Outline]:
        """Outlines of the peg, and of the board before and after the turn."""
        pin, turned = self.mouth + self.board.pivot * self.u, self._azimuth + math.radians(self.turn)
        boards = [self.board.outline(pin, yaw) for yaw in (self._azimuth, turned)]
        return [corners(self.foot, self._peg_yaw, self.peg.size), *boards]

    @cached_property
    def _azimuth(self) -> float:
        """Azimuth of the slot at the start [rad]."""
        return polar(self.u)[0]

    @cached_property
    def _peg_yaw(self) -> float:
        """Yaw of the peg in the scene, mirrored or not [rad]."""
        return math.radians(self.side * self.peg_yaw)
