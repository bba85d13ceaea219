"""Programs that drive three tasks with a pad: they read the state line and press controls, as a person does."""

import math

import numpy as np

from scengen.demos.teleop.pad import PadEvent

SLOW = 0.05
"""Distance from the target at which the stick starts to return to its rest [m]."""
REST = 0.24
"""Dead zone of the sticks."""
CREEP = 0.12
"""Deflection beyond the dead zone that still moves the hand."""

PUSH = 0.014
"""Distance ahead of the hand that it is sent to while it pushes [m]: slowly, so that it can stop in time."""
UP = np.array([0.0, 0.0, 1.0])


class Hands:
    """A person at the pad. `plan` yields the controls that are held; those that are not named are at rest."""

    def __init__(self):
        self.held, self.line, self.running = {}, None, None

    def read(self, line):
        self.line = line
        if line.outcome is not None:
            return None
        self.running = self.running or self.plan()
        wanted = next(self.running, None)
        if wanted is None:
            return [PadEvent(name, 0.0) for name in self._changed({})]
        return [PadEvent(name, wanted.get(name, 0.0)) for name in self._changed(wanted)]

    def _changed(self, wanted):
        names = [n for n in {*self.held, *wanted} if self.held.get(n, 0.0) != wanted.get(n, 0.0)]
        self.held = wanted
        return sorted(names)

    # --- what a person does ---------------------------------------------------------------

    def hand(self):
        return np.array(self.line.hand)

    def body(self, name):
        return np.array(self.line.bodies[name][:3])

    def axes(self, name):
        """Directions of a body's x and y axes, seen from above."""
        w, x, y, z = self.line.bodies[name][3:]
        yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        return [np.array([math.cos(yaw + k * math.pi / 2), math.sin(yaw + k * math.pi / 2)]) for k in range(2)]

    def tilt(self, name):
        """Angle between a body's z axis and the vertical [rad]."""
        x, y = self.line.bodies[name][4:6]
        return math.acos(max(-1.0, min(1.0, 1 - 2 * (x * x + y * y))))

    def towards(self, target, **held):
        """Controls that move the hand to a target: sticks for the plane, shoulder buttons up and down."""
        way = target - self.hand()
        flat = math.hypot(*way[:2])
        share = min(1.0, flat / SLOW)
        length = (REST + (1 - REST) * max(CREEP, share)) if flat > 0.002 else 0.0
        push = way[:2] / flat * length if length else np.zeros(2)
        found = {"lefty": round(-float(push[0]), 3), "leftx": round(-float(push[1]), 3), **held}
        period = 1 if abs(way[2]) > 0.03 else 4  # tapping moves slowly
        self.beat = (getattr(self, "beat", 0) + 1) % period
        if abs(way[2]) > 0.003 and not self.beat:
            found["rightshoulder" if way[2] > 0 else "leftshoulder"] = 1.0
        return found

    def go(self, target, within=0.006, wait=400, **held):
        target = np.array(target, float)
        for _ in range(wait):
            if np.linalg.norm(target - self.hand()) < within:
                return
            yield self.towards(target, **held)

    def tap(self, button, rest=40):
        yield {button: 1.0}
        for _ in range(rest):
            yield {}

    def turning(self, direction, within=0.06):
        """Controls that turn the hand about the vertical until its fingers open along a direction, or against it."""
        opening = np.array(self.line.opening)
        cross = opening[0] * direction[1] - opening[1] * direction[0]
        error = (math.atan2(cross, opening[:2] @ direction) + math.pi / 2) % math.pi - math.pi / 2
        return {} if abs(error) < within else {"dpleft" if error > 0 else "dpright": 1.0}

    def reach(self, target, direction, within=0.006, wait=500):
        """Move to a target and turn at the same time."""
        for _ in range(wait):
            turn = self.turning(direction)
            if np.linalg.norm(target - self.hand()) < within and not turn:
                return
            yield self.towards(target, **turn)

    def narrow(self, name):
        """Width of a body, and the direction of this width from above."""
        box = np.array(self.line.boxes[name])
        sizes = (box[3:] - box[:3])[:2]
        return sizes.min(), self.axes(name)[int(sizes.argmin())]

    def plan(self):
        raise NotImplementedError


class Domino(Hands):
    """T17: go behind the first tile, push it over along the chain, step back, wait."""

    def plan(self):
        tiles = sorted(name for name in self.line.bodies if name.startswith("tile_"))
        first, second = self.body(tiles[0]), self.body((*tiles, "slab")[1])
        along = (second - first) * [1, 1, 0]
        along /= np.linalg.norm(along)
        height = np.array([0, 0, 0.06])
        start = first - 0.045 * along
        yield from self.tap("a")  # closed fingers
        yield from self.go(start + 3 * height, within=0.01)
        yield from self.go(start + height, within=0.005)
        for _ in range(200):
            if self.tilt(tiles[0]) > 0.35:
                break
            yield self.towards(self.hand() + PUSH * along)
        yield from self.go(start - 0.04 * along + height)
        while True:
            yield {}


class MirroredCube(Hands):
    """M01: the poses on the state line are those of the world, so that the turned picture does not mislead."""

    def plan(self):
        grasp = self.body("cube") + 0.03 * UP
        across = max(self.axes("cube"), key=lambda axis: abs(axis @ np.array(self.line.opening[:2])))
        yield from self.reach(grasp + 0.08 * UP, across)
        yield from self.reach(grasp, across)
        yield from self.tap("a")
        yield from self.go(grasp + 0.2 * UP)
        while True:
            yield {}


class Follower(Hands):
    """T29: take the thing, follow the square wherever it jumps, put the thing down on it."""

    def plan(self):
        foot, (_, across) = self.body("thing"), self.narrow("thing")
        height = self.line.boxes["thing"][5] - self.line.boxes["thing"][2]
        grasp = foot + max(0.014, height - 0.035) * UP
        yield from self.reach(grasp + 0.06 * UP, across, within=0.012)
        yield from self.reach(grasp, across)
        yield from self.tap("a", rest=25)
        carried = grasp + 0.07 * UP
        yield from self.go(carried, within=0.02)
        while True:
            offset = (self.hand() - self.body("thing")) * [1, 1, 0]
            above = np.array([*self.body("patch")[:2], carried[2]]) + offset
            if np.linalg.norm(above - self.hand()) < 0.012:
                break
            yield self.towards(above)
        yield from self.go(np.array([*above[:2], grasp[2] + 0.004]), within=0.008)
        yield from self.tap("a", rest=25)
        yield from self.go(np.array([*above[:2], grasp[2] + 0.1]))
        while True:
            yield {}
