"""Macros: moves that need no knowledge of a task. Data first, a plan made of skills when they are played.

| kind    | target   | numbers                                                                      |
|---------|----------|------------------------------------------------------------------------------|
| pick    | solid    | height (share), skew of the jaw [rad], which level axis it spans, lift [m]   |
| push    | solid    | direction [rad], height (share), offset (share), way [m], speed [m/s]        |
| place   | solid    | two shares of its upper face, drop [m], speed [m/s]                          |
| press   | solid    | two shares of its upper face, seconds, speed [m/s]                           |
| move    |          | displacement [m], speed [m/s]                                                |
| turn    |          | rotation vector in world axes [rad], rate [rad/s]                            |
| shake   |          | direction (unit vector), spin, period [s], duration [s]                      |
| throw   |          | direction (unit vector), seconds before the hand opens                       |
| release |          | seconds, then rise [m]                                                       |
| catch   | body     | longest wait [s]                                                             |
| wait    |          | seconds                                                                      |
| go      |          | place of the hand [m], its orientation as a rotation vector, grip            |

Shares run from -1 to 1 over a face and from 0 to 1 over a height. `push`, `place`, `press` use what the hand holds.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..control.loop import Loop
from ..geometry import UP, Vec3, about_z, heading, rotation
from ..robots.jaw import FINGER_ACROSS, PALM_ABOVE, TIP_BELOW
from ..scenario import Plan
from ..sim.world import ROBOT, Arm, World
from ..skills import suction
from ..skills.jaw import grasp, release
from ..skills.motion import CLOSED, OPEN, Pace, alone, closing_along, go_to, hold, push, retreat, turn_to
from .solids import Solid, held

FAST = Pace(0.30, 0.02, give_up=2.5)
"""Through free space. Moves of an adversary give up early: time is what a wrong try costs."""
LADEN = Pace(0.20, 0.008, give_up=3.0)
"""With something in the hand, or over a place: at 0.30 m/s it runs 1 to 2 cm too far."""
CLOSE = Pace(0.20, 0.006, give_up=1.5)
"""Up to a thing."""
ABOVE = 0.08
"""Height over the highest thing in question at which the hand travels [m]."""
AIR = 0.015
"""Between a tool and the thing it is going to push [m]."""
GONE, CATCH = 0.06, 0.05
"""Distance from the hand of a body that has gone, and at which the hand begins to close on its way back [m]. On an
incline of 25 deg it then comes to its turn in 0.15 s, which is what the fingers need."""
DEEPEST = PALM_ABOVE - 0.004
"""How far the top of a thing may be above the grip site of a hand that takes it [m]."""


@dataclass(frozen=True)
class Macro:
    """One move, as data: equal macros in equal states give equal actions."""

    kind: str
    target: str = ""
    """A solid or body of the scene; empty for moves of the hand alone."""
    numbers: tuple[float, ...] = ()
    arm: int = 0
    """Number of the arm that makes the move; the others are held still."""

    def __str__(self) -> str:
        numbers = ", ".join(f"{number:.3g}" for number in self.numbers)
        by = f" by {ROBOT}{self.arm}" if self.arm else ""
        return f"{self.kind} {self.target}".rstrip() + by + (f" ({numbers})" if numbers else "")


@dataclass(frozen=True)
class MacroContext:
    """An arm and the solids of its world: what the plan of a macro looks at."""

    arm: Arm
    solids: Mapping[str, Solid]

    @property
    def world(self) -> World:
        return self.arm.world


def plan(world: World, solids: Mapping[str, Solid], macro: Macro) -> Plan:
    """The moves of one macro from wherever the hand is."""
    arm = world.arms[macro.arm]
    return alone(arm, KINDS[macro.kind](MacroContext(arm, solids), macro))


# --- taking and leaving -----------------------------------------------------------------------


def _pick(field: MacroContext, macro: Macro) -> Plan:
    height, skew, which, lift = macro.numbers
    solid, world = field.solids[macro.target], field.world
    centre, up = solid.centre(world), solid.reach(world, UP)
    yield from release(field.arm, 0.05)
    if field.arm.suction:
        yield from _suck(field, centre + up * UP, skew)
    else:
        closing = about_z(skew) @ solid.level_axes(world)[round(which)][0]
        low, high = max(TIP_BELOW + 0.003 - up, up - DEEPEST), max(up - 0.004, 0.0)
        at = centre + (low + height * (high - low)) * UP if low < high else centre
        rot = closing_along(field.arm, closing)
        yield from _rise(field.arm, float(at[2]) + ABOVE)
        yield from go_to(field.arm, at + ABOVE * UP, rot, FAST, OPEN)
        yield from go_to(field.arm, at, rot, CLOSE, OPEN)
        yield from grasp(field.arm)
    yield from retreat(field.arm, lift, FAST)


def _suck(field: MacroContext, spot: Vec3, skew: float) -> Plan:
    arm = field.arm
    rot = closing_along(arm, about_z(skew) @ arm.hand_rot[:, 1])
    yield from _rise(arm, float(spot[2]) + ABOVE)
    yield from go_to(arm, spot + 0.02 * UP, rot, FAST, OPEN)
    yield from suction.suck(arm, spot, rot, give_up=1.5)


def _place(field: MacroContext, macro: Macro) -> Plan:
    u, v, drop, speed = macro.numbers
    yield from _over(field, macro.target, u, v, drop + 0.01)
    if drop <= 0.0:
        yield from _down(field, macro.target, 0.04, speed)
    yield from release(field.arm)
    yield from retreat(field.arm, ABOVE, FAST)


def _press(field: MacroContext, macro: Macro) -> Plan:
    u, v, seconds, speed = macro.numbers
    yield from _over(field, macro.target, u, v, AIR)
    yield from _down(field, macro.target, 0.04, speed)
    yield from _blindly(field.arm, -speed * UP, seconds)
    yield from retreat(field.arm, ABOVE, FAST)


def _release(field: MacroContext, macro: Macro) -> Plan:
    seconds, rise = macro.numbers
    yield from release(field.arm, seconds)
    if rise > 0.0:
        yield from retreat(field.arm, rise, FAST)


def _catch(field: MacroContext, macro: Macro) -> Plan:
    """Keep the hand open until a body that went away is coming back, then close it: fingers need time."""
    (longest,) = macro.numbers
    world, body = field.world, macro.target
    end, gone, last = world.time + longest, False, 0.0
    while world.time < end:
        away = float(np.linalg.norm(world.com(body) - field.arm.hand))
        if gone and away < min(last, CATCH):
            break
        gone, last = gone or away > GONE, away
        yield np.append(np.zeros(6), OPEN)
    yield from grasp(field.arm)


# --- pushing ----------------------------------------------------------------------------------


def _push(field: MacroContext, macro: Macro) -> Plan:
    direction, height, offset, way, speed = macro.numbers
    solid, world, arm = field.solids[macro.target], field.world, field.arm
    u = heading(math.degrees(direction))
    across = np.array([-u[1], u[0], 0.0])
    if (load := held(arm)) is None:
        radius, below, lag = FINGER_ACROSS, TIP_BELOW, np.zeros(3)
        rot = closing_along(arm, across)
    else:
        tool = field.solids[load]
        radius, below, lag = tool.reach(world, u), tool.reach(world, UP), arm.hand - tool.centre(world)
        rot = arm.hand_rot
    up, centre = solid.reach(world, UP), solid.centre(world)
    start = centre - (solid.reach(world, u) + radius + AIR) * u + offset * solid.reach(world, across) * across
    z = centre[2] - up + height * 2 * up
    start[2] = z if load is None else max(z, centre[2] - up + below + 0.002)
    yield from _rise(arm, float(centre[2] + up + below + 0.03 + lag[2]))
    yield from go_to(arm, [*(start + lag)[:2], arm.hand[2]], rot, FAST, CLOSED)
    yield from go_to(arm, start + lag, rot, CLOSE, CLOSED)
    yield from _blindly(arm, speed * u, way / speed)
    yield from retreat(arm, ABOVE, FAST)


# --- the hand alone -----------------------------------------------------------------------------


def _move(field: MacroContext, macro: Macro) -> Plan:
    x, y, z, speed = macro.numbers
    arm, way = field.arm, np.array([x, y, z])
    limit = float(np.linalg.norm(way)) / speed + 0.7
    yield from go_to(arm, arm.hand + way, pace=Pace(speed, 0.002, limit))


def _turn(field: MacroContext, macro: Macro) -> Plan:
    x, y, z, rate = macro.numbers
    arm = field.arm
    goal = rotation(np.array([x, y, z])) @ arm.hand_rot
    yield from turn_to(arm, goal, rate, give_up=0.7 + math.sqrt(x * x + y * y + z * z) / rate)


def _shake(field: MacroContext, macro: Macro) -> Plan:
    x, y, z, spin, period, duration = macro.numbers
    arm, start = field.arm, field.world.time
    while (since := field.world.time - start) < duration:
        sign = 1.0 if since % period < period / 2 else -1.0
        yield np.array([sign * x, sign * y, sign * z, 0.0, 0.0, sign * spin, arm.grip])


def _throw(field: MacroContext, macro: Macro) -> Plan:
    x, y, z, seconds = macro.numbers
    arm, start = field.arm, field.world.time
    while (since := field.world.time - start) < seconds + 0.2:
        yield np.array([x, y, z, 0.0, 0.0, 0.0, OPEN if since > seconds else arm.grip])


def _wait(field: MacroContext, macro: Macro) -> Plan:
    (seconds,) = macro.numbers
    yield from hold(field.arm, seconds)


def _go(field: MacroContext, macro: Macro) -> Plan:
    x, y, z, a, b, c, grip = macro.numbers
    yield from go_to(field.arm, [x, y, z], rotation(np.array([a, b, c])), CLOSE, grip)


KINDS: Mapping[str, Callable[[MacroContext, Macro], Plan]] = {
    "pick": _pick,
    "push": _push,
    "place": _place,
    "press": _press,
    "move": _move,
    "turn": _turn,
    "shake": _shake,
    "throw": _throw,
    "release": _release,
    "catch": _catch,
    "wait": _wait,
    "go": _go,
}
"""The plan of each kind of macro."""


# --- parts of plans -----------------------------------------------------------------------------


def _rise(arm: Arm, height: float) -> Plan:
    """Straight up to a height [m], if the hand is lower."""
    if arm.hand[2] < height - FAST.within:
        yield from go_to(arm, [*arm.hand[:2], height], pace=FAST)


def _over(field: MacroContext, target: str, u: float, v: float, above: float) -> Plan:
    """Bring what the hand holds, or its finger tips, over a point of a solid's upper face."""
    solid, world, arm = field.solids[target], field.world, field.arm
    load = held(arm)
    below = TIP_BELOW if load is None else field.solids[load].reach(world, UP)
    lag = np.zeros(3) if load is None else arm.hand - field.solids[load].centre(world)
    (a, first), (b, second) = solid.level_axes(world)
    rot, half = solid.rot(world), solid.half
    top = solid.centre(world) + u * first * a + v * second * b
    normal = rot[:, int(np.argmax(np.abs(rot[2])))]
    normal = normal * np.sign(normal[2])
    slope = -(normal[0] * (top - solid.centre(world))[0] + normal[1] * (top - solid.centre(world))[1]) / normal[2]
    top[2] += slope + float(half[int(np.argmax(np.abs(rot[2])))]) / normal[2]
    goal = top + lag + (below + above) * UP
    yield from _rise(arm, float(goal[2]) + 0.02)
    yield from go_to(arm, [*goal[:2], max(goal[2], arm.hand[2])], pace=LADEN, grip=CLOSED)
    yield from go_to(arm, goal, pace=CLOSE, grip=CLOSED)


def _down(field: MacroContext, target: str, farthest: float, speed: float) -> Plan:
    """Lower what the hand holds, or closed fingers, until it touches the target's body, by `farthest` [m] at most."""
    arm, world, body = field.arm, field.world, field.solids[target].body
    tool, end = held(arm) or arm.label, world.time + farthest / speed
    yield from push(arm, -speed * UP, lambda: world.touching(tool, body) or world.time > end, CLOSED)


def _blindly(arm: Arm, velocity: Vec3, seconds: float) -> Plan:
    """Push at a constant velocity for some time, whatever is in the way."""
    world, end = arm.world, arm.world.time + seconds - Loop.PERIOD / 2
    yield from push(arm, velocity, lambda: world.time > end, give_up=seconds + 1.0)
