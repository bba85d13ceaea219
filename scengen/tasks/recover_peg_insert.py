"""T02 recover-peg-insert."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from ..assets.peg import Peg
from ..assets.prop import TABLE_TOP, place, servo, solid, table
from ..assets.slot_board import STIFFNESS, SlotBoard
from ..control.loop import Loop
from ..errors import GaveUp
from ..geometry import UP, Mat3, Vec3, axes, between, rotation
from ..params import param
from ..predicates import fallen
from ..robots.jaw import FINGER
from ..scenario import Plan, Refutation, Scenario, Shortcut, on_table, require, within_reach
from ..sim.memory import remember
from ..sim.world import ROBOT, World
from ..skills.jaw import carry, grasp, release
from ..skills.motion import CLOSED, COARSE, FINE, OPEN, STEADY, Pace, facing, go_to, hold, retreat, steer, turn_to, wait

PLINTH = 0.030
GRIP = 0.024
HINGE = "board/hinge"


def nearest(here: Mat3, u: Vec3) -> Mat3:
    """Of the four orientations of a square bar along `u` that lies flat the one nearest to `here`."""
    side = np.cross(UP, u)
    return max((axes(x, u) for x in (UP, -UP, side, -side)), key=lambda rot: float(np.sum(rot * here)))


@dataclass(frozen=True, kw_only=True)
class RecoverPegInsert(Scenario):
    HOLD = 0.3

    peg_x: float = param(-0.08, "m", -0.4, 0.4)
    peg_y: float = param(-0.08, "m", -0.4, 0.4)
    peg_yaw: float = param(0.0, "deg", -45.0, 45.0, period=90.0)
    side: int = param(1, "1", -1, 1)
    mouth_x: float = param(-0.05, "m", -0.4, 0.4)
    mouth_y: float = param(0.15, "m", -0.4, 0.4)
    board_yaw: float = param(0.0, "deg", -60.0, 60.0)
    turn: float = param(10.0, "deg", -30.0, 30.0, hidden=True)
    distance: float = param(0.05, "m", 0.005, 0.10, hidden=True)
    peg: Peg = Peg()
    board: SlotBoard = SlotBoard()

    def build(self) -> mujoco.MjSpec:
        return self._scene(self.board)

    def _scene(self, board: SlotBoard) -> mujoco.MjSpec:
        scene = table()
        remember(scene, "turned")
        stand = scene.worldbody.add_body(name="plinth", pos=[*self.foot[:2], TABLE_TOP])
        solid(stand, "plinth/box", [0.015, 0.015, PLINTH / 2], [0, 0, PLINTH / 2])
        place(scene, self.peg, "peg", self.foot, math.radians(self.peg_yaw))
        place(scene, board, "board", self.pin, math.atan2(self.u[1], self.u[0]), free=False)
        servo(scene, HINGE, STIFFNESS)
        return scene

    # --- goal
    def ends(self, world: World) -> tuple[Vec3, Vec3]:
        """foot and top in slot axes, from the middle of the mouth"""
        frame, at = self.slot(world)
        foot, axis = world.pos("peg"), world.rot("peg")[:, 2]
        return frame.T @ (foot - at), frame.T @ (foot + self.peg.length * axis - at)

    def slot(self, world: World) -> tuple[Mat3, Vec3]:
        rot, pin = world.rot("board"), world.pos("board")
        return rot, pin + rot @ np.array([-self.board.pivot, 0.0, self.board.centre])

    def progress(self, world: World) -> float:
        foot, top = self.ends(world)
        return 0.5 + (foot + top)[0] / 2 / self.peg.length

    def success(self, world: World) -> bool:
        if not world.memory["turned"]:
            return False
        foot, top = self.ends(world)
        off = np.abs(foot + top)[1:].max() / 2
        return 0.93 <= self.progress(world) <= 1.03 and off < self.board.slot / 2

    def failure(self, world: World) -> str | None:
        return "the peg fell off the table" if fallen(world, "peg") else None

    def events(self, world: World) -> None:
        if not world.memory["turned"] and self.aligned(world):
            world.memory["turned"] = 1.0
            world.drive(HINGE, math.radians(self.turn))

    def aligned(self, world: World) -> bool:
        foot, top = self.ends(world)
        way = top - foot
        angle = math.acos(min(1.0, abs(way[0]) / self.peg.length))
        nose = foot if abs(foot[0] - self.board.depth / 2) < abs(top[0] - self.board.depth / 2) else top
        before = abs(nose[0] - self.board.depth / 2) - self.board.depth / 2
        return angle < math.radians(6) and math.hypot(nose[1], nose[2]) < 0.010 and 0.0 < before < self.distance

    # --- oracle
    def oracle(self, world: World) -> Plan:
        yield from self.take(world)
        yield from self.bring(world)
        yield from self.follow(world, 0.0, 0.08, lambda: world.memory["turned"] > 0)
        yield from self.follow(world, -0.02, 0.15)
        yield from self.insert(world)
        yield from self.push_home(world)

    def take(self, world: World) -> Plan:
        arm, yaw = world.arm, math.radians(self.peg_yaw)
        rot = facing(self.side * math.pi / 2 + yaw, 0.0)
        at = self.foot + GRIP * UP
        back = at - 0.09 * rot[:, 2]
        yield from go_to(arm, back + (self.peg.length + 0.03) * UP - 0.03 * rot[:, 2], None, COARSE, OPEN)
        yield from turn_to(arm, rot, 1.5)
        yield from go_to(arm, back, rot, STEADY)
        yield from go_to(arm, at, rot, FINE)
        yield from grasp(arm)
        yield from retreat(arm, 0.10)

    def bring(self, world: World) -> Plan:
        u = self.slot(world)[0][:, 0]
        az = math.atan2(u[1], u[0])
        yield from turn_to(world.arm, facing(az, math.pi / 2), 1.2)
        yield from self.follow(world, -0.08, 0.25)

    def follow(self, world: World, depth: float, speed: float, until=None, give_up=6.0) -> Plan:
        """Steer the nose"""
        arm = world.arm
        setpoint, end = None, world.time + give_up
        while until is None or not until():
            frame, mouth = self.slot(world)
            u = frame[:, 0]
            here, nose = world.rot("peg"), self.nose(world)
            goal = mouth + depth * u
            turn = between(here, nearest(here, u))
            left = goal - nose
            if until is None and math.sqrt(left @ left) < 0.002 and math.sqrt(turn @ turn) < 0.015:
                return
            if world.time > end:
                raise GaveUp(f"x {left} {turn}")
            setpoint = nose if setpoint is None else setpoint
            ahead = goal - setpoint
            dist = math.sqrt(ahead @ ahead)
            v = ahead * (min(speed, 4 * dist) / max(dist, 1e-9))
            setpoint = setpoint + v * Loop.PERIOD
            hand = setpoint + rotation(turn) @ (arm.hand - nose)
            yield steer(arm, hand, v, turn, None)

    def nose(self, world: World) -> Vec3:
        return world.pos("peg") + self.peg.length * world.rot("peg")[:, 2]

    def insert(self, world: World) -> Plan:
        def there() -> bool:
            frame, mouth = self.slot(world)
            return float((mouth - world.arm.hand) @ frame[:, 0]) < FINGER + 0.006

        yield from self.follow(world, self.peg.length, 0.08, there)
        yield from release(world.arm)

    def push_home(self, world: World) -> Plan:
        arm = world.arm
        frame, mouth = self.slot(world)
        u = frame[:, 0]
        foot = world.pos("peg")
        rot = arm.hand_rot
        yield from go_to(arm, arm.hand - 0.0 * u + 0.05 * UP, pace=COARSE)
        behind = foot - (FINGER + 0.02) * u
        yield from go_to(arm, np.array([*behind[:2], mouth[2] + 0.06]), rot, pace=COARSE, grip=CLOSED)
        yield from go_to(arm, np.array([*behind[:2], mouth[2]]), rot, pace=FINE)
        from ..skills.motion import push
        yield from push(arm, 0.06 * u, lambda: self.progress(world) > 0.95)
        yield from go_to(arm, arm.hand - 0.03 * u)

    @property
    def foot(self) -> Vec3:
        return np.array([self.peg_x, self.side * self.peg_y, TABLE_TOP + PLINTH])

    @property
    def u(self) -> Vec3:
        yaw = math.radians(self.board_yaw)
        return np.array([math.sin(yaw), self.side * math.cos(yaw), 0.0])

    @property
    def mouth(self) -> Vec3:
        return np.array([self.mouth_x, self.side * self.mouth_y, TABLE_TOP])

    @property
    def pin(self) -> Vec3:
        return self.mouth + self.board.pivot * self.u
