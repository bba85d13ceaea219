"""Macros: moves that need no knowledge of a task. A macro is data; when it is played, a plan made of skills.
| kind    | target   | numbers                                                                      |
|---------|----------|------------------------------------------------------------------------------|
| pick    | solid    | height (share), skew of the jaw [rad], level axis that it spans, lift [m]    |
| push    | solid    | direction [rad], height (share), offset (share), distance [m], speed [m/s]   |
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
| pursue  | body     | lead [s]                                                                     |
| pin     | body     | lead [s]                                                                     |
| block   | body     | lead [s]                                                                     |
| take    | body     | skew of the jaw from the body's narrow side [rad], lift [m]                  |
| cradle  | body     | direction of the hand [rad], its pitch [rad], depth [m]                      |
| touch   | body     | place of the body in the hand, from above [m]; none: straight from its place |
| await   | body     | none: hold the open hand until the body changes its course                   |
| meet    | body     | place of the hand [m], its orientation as a rotation vector, periods open    |
| stop    | body     | place where it is stopped [m], goal of the hand [m], its rotation, pitch     |
| ease    |          | displacement [m]; the hand stops while the jaw opens by itself               |
| roll    | body     | direction and elevation of a hand that holds the body on its side [rad]      |
| bring   | body     | goal of its centre [m], height [m], turn [rad], detour [m], drop [m]         |
| settle  | body     | displacement of its first place [m], number of tries                         |
| slide   |          | directions of the surface and of the slide (unit vectors), seconds           |
| fling   | body     | goal of its centre [m], speed [m/s], distance at which the hand opens [m]    |
| slip    |          | number of slips, control periods off and on                                  |
| lean    |          | axis (unit vector), angle [rad], displacement [m], speed [m/s]               |
| along   | body     | turn of the hand from the body's way in the witness [rad], height [m]        |

Shares run from -1 to 1 over a face and from 0 to 1 over a height. `push`, `place`, `press` use the body in the hand.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..control.loop import Loop
from ..errors import GaveUp
from ..geometry import UP, Vec3, about_z, heading, rotation
from ..robots.jaw import FINGER_ACROSS, PALM_ABOVE, TIP_BELOW
from ..scenario import Plan
from ..sim.arm import ROBOT, Arm
from ..sim.world import World
from ..skills import suction
from ..skills.jaw import grasp, release
from ..skills.motion import CLOSED, OPEN, Pace, alone, closing_along, go_to, hold, push, retreat, turn_to
from . import plans, touch
from .solids import Solid, held

FREE_PACE = Pace(0.30, 0.02, give_up=2.5)
"""Pace through free space. Moves of the adversary give up early: a failed attempt costs time."""
LADEN = Pace(0.20, 0.008, give_up=3.0)
"""Pace with a body in the hand, or over a place: at 0.30 m/s the hand overshoots by 1 to 2 cm."""
APPROACH = Pace(0.20, 0.006, give_up=1.5)
"""Pace of the last stretch to a body."""
TRAVEL_HEIGHT = 0.08
"""Height of the hand above the highest solid in question when it travels [m]."""
PUSH_CLEARANCE = 0.015
"""Clearance between a tool and the body that it is going to push [m]."""
GONE_DISTANCE = 0.06
"""Distance from the hand above which a body counts as gone [m]."""
CATCH_DISTANCE = 0.05
"""Distance from the hand at which the hand starts to close on a body that returns [m]. On an incline of 25 deg the body
then turns round 0.15 s later, which is the time that the fingers need."""
MAX_GRASP_DEPTH = PALM_ABOVE - 0.004
"""Maximum height of the top of a body above the grip site of a hand that grasps it [m]."""


@dataclass(frozen=True)
class Macro:
    """One move, as data: equal macros in equal states give equal actions."""

    kind: str
    target: str = ""
    """Name of a solid or body of the scene; empty for moves of the hand alone."""
    numbers: tuple[float, ...] = ()
    """Numbers of the move, by kind; see the table above."""
    arm: int = 0
    """Number of the arm that makes the move; the other one is held still."""

    def __str__(self) -> str:
        numbers = ", ".join(f"{number:.3g}" for number in self.numbers)
        by = f" by {ROBOT}{self.arm}" if self.arm else ""
        return f"{self.kind} {self.target}".rstrip() + by + (f" ({numbers})" if numbers else "")


@dataclass(frozen=True)
class MacroContext:
    """The arm that plays a macro, and the solids of its world."""

    arm: Arm
    solids: Mapping[str, Solid]

    @property
    def world(self) -> World:
        return self.arm.world


def plan(world: World, solids: Mapping[str, Solid], macro: Macro) -> Plan:
    """The plan of one macro, from the present position of the hand."""
    arm = world.arms[macro.arm]
    return alone(arm, KINDS[macro.kind](MacroContext(arm, solids), macro))


# --- grasping and releasing -------------------------------------------------------------------


def _pick(field: MacroContext, macro: Macro) -> Plan:
    height, skew, which, lift = macro.numbers
    solid, world = field.solids[macro.target], field.world
    centre, up = solid.centre(world), solid.reach(world, UP)
    yield from release(field.arm, 0.05)
    if field.arm.suction:
        yield from _pick_by_suction(field, centre + up * UP, skew)
    else:
        closing = about_z(skew) @ solid.level_axes(world)[round(which)][0]
        low, high = max(TIP_BELOW + 0.003 - up, up - MAX_GRASP_DEPTH), max(up - 0.004, 0.0)
        at = centre + (low + height * (high - low)) * UP if low < high else centre
        rot = closing_along(field.arm, closing)
        yield from _rise(field.arm, float(at[2]) + TRAVEL_HEIGHT)
        yield from go_to(field.arm, at + TRAVEL_HEIGHT * UP, rot, FREE_PACE, OPEN)
        yield from go_to(field.arm, at, rot, APPROACH, OPEN)
        yield from grasp(field.arm)
    yield from retreat(field.arm, lift, FREE_PACE)


def _pick_by_suction(field: MacroContext, spot: Vec3, skew: float) -> Plan:
    arm = field.arm
    rot = closing_along(arm, about_z(skew) @ arm.hand_rot[:, 1])
    yield from _rise(arm, float(spot[2]) + TRAVEL_HEIGHT)
    yield from go_to(arm, spot + 0.02 * UP, rot, FREE_PACE, OPEN)
    yield from suction.suck(arm, spot, rot, give_up=1.5)


def _place(field: MacroContext, macro: Macro) -> Plan:
    u, v, drop, speed = macro.numbers
    yield from _move_over(field, macro.target, u, v, drop + 0.01)
    if drop <= 0.0:
        yield from _lower_until_contact(field, macro.target, 0.04, speed)
    yield from release(field.arm)
    yield from retreat(field.arm, TRAVEL_HEIGHT, FREE_PACE)


def _press(field: MacroContext, macro: Macro) -> Plan:
    u, v, seconds, speed = macro.numbers
    yield from _move_over(field, macro.target, u, v, PUSH_CLEARANCE)
    yield from _lower_until_contact(field, macro.target, 0.04, speed)
    yield from _push_blindly(field.arm, -speed * UP, seconds)
    yield from retreat(field.arm, TRAVEL_HEIGHT, FREE_PACE)


def _release(field: MacroContext, macro: Macro) -> Plan:
    seconds, rise = macro.numbers
    yield from release(field.arm, seconds)
    if rise > 0.0:
        yield from retreat(field.arm, rise, FREE_PACE)


def _catch(field: MacroContext, macro: Macro) -> Plan:
    """Keep the hand open until a body that has gone away returns, then close it: fingers need time."""
    (longest,) = macro.numbers
    world, body = field.world, macro.target
    end, gone, last = world.time + longest, False, 0.0
    while world.time < end:
        away = float(np.linalg.norm(world.com(body) - field.arm.hand))
        if gone and away < min(last, CATCH_DISTANCE):
            break
        gone, last = gone or away > GONE_DISTANCE, away
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
    start = (
        centre - (solid.reach(world, u) + radius + PUSH_CLEARANCE) * u + offset * solid.reach(world, across) * across
    )
    z = centre[2] - up + height * 2 * up
    start[2] = z if load is None else max(z, centre[2] - up + below + 0.002)
    yield from _rise(arm, float(centre[2] + up + below + 0.03 + lag[2]))
    yield from go_to(arm, [*(start + lag)[:2], arm.hand[2]], rot, FREE_PACE, CLOSED)
    yield from go_to(arm, start + lag, rot, APPROACH, CLOSED)
    yield from _push_blindly(arm, speed * u, way / speed)
    yield from retreat(arm, TRAVEL_HEIGHT, FREE_PACE)


# --- moves of the hand alone --------------------------------------------------------------------


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
    yield from go_to(field.arm, [x, y, z], rotation(np.array([a, b, c])), APPROACH, grip)


# --- feedback plans -----------------------------------------------------------------------------


def _pursue(field: MacroContext, macro: Macro) -> Plan:
    return plans.pursue(field.arm, macro.target, *macro.numbers)


def _pin(field: MacroContext, macro: Macro) -> Plan:
    return plans.press_and_pick(field.arm, macro.target, *macro.numbers)


def _block(field: MacroContext, macro: Macro) -> Plan:
    return plans.block_and_pick(field.arm, macro.target, *macro.numbers)


def _take(field: MacroContext, macro: Macro) -> Plan:
    return plans.pick_where_it_is(field.arm, macro.target, *macro.numbers)


def _cradle(field: MacroContext, macro: Macro) -> Plan:
    return plans.cradle(field.arm, macro.target, *macro.numbers)


def _touch(field: MacroContext, macro: Macro) -> Plan:
    """Move the body in the hand to another one until they touch: straight, or down to a place."""
    load = held(field.arm)
    if load is None:
        raise GaveUp("no body in the hand")
    if macro.numbers:
        above = np.array(macro.numbers) + TRAVEL_HEIGHT * UP
        yield from _rise(field.arm, float(above[2]))
        yield from go_to(field.arm, above + field.arm.hand - field.world.com(load), pace=LADEN, grip=CLOSED)
        yield from _lower_until_contact(field, macro.target, 2 * TRAVEL_HEIGHT, 0.1)
        return
    way = field.solids[macro.target].centre(field.world) - field.world.com(load)
    velocity = 0.15 * way / max(float(np.linalg.norm(way)), 1e-9)
    yield from plans.touch_with(field.arm, load, field.solids[macro.target].body, velocity)


def _await(field: MacroContext, macro: Macro) -> Plan:
    return plans.await_turn(field.arm, macro.target)


def _meet(field: MacroContext, macro: Macro) -> Plan:
    x, y, z, a, b, c, periods = macro.numbers
    return plans.meet(field.arm, macro.target, [x, y, z], rotation(np.array([a, b, c])), round(periods))


def _stop(field: MacroContext, macro: Macro) -> Plan:
    at, to, turn, (pitch,) = macro.numbers[:3], macro.numbers[3:6], macro.numbers[6:9], macro.numbers[9:]
    return plans.stop_and_bring(field.arm, macro.target, np.array(at), to, rotation(np.array(turn)), pitch)


def _ease(field: MacroContext, macro: Macro) -> Plan:
    return plans.carry_steadily(field.arm, macro.numbers)


def _roll(field: MacroContext, macro: Macro) -> Plan:
    _check_held(field, macro)
    yield from plans.turn_about(field.arm, macro.target, plans.on_its_side(*macro.numbers))


def _bring(field: MacroContext, macro: Macro) -> Plan:
    x, y, z, over, skew, aside, drop = macro.numbers
    _check_held(field, macro)
    yield from plans.carry_to(field.arm, macro.target, [x, y, z], over, skew, drop, aside)


# --- plans of a hand that feels -------------------------------------------------------------------


def _settle(field: MacroContext, macro: Macro) -> Plan:
    *shift, tries = macro.numbers
    _check_held(field, macro)
    yield from touch.settle(field.arm, macro.target, shift, round(tries))


def _slide(field: MacroContext, macro: Macro) -> Plan:
    against, along, (seconds,) = macro.numbers[:3], macro.numbers[3:6], macro.numbers[6:]
    return touch.slide(field.arm, against, along, seconds)


def _fling(field: MacroContext, macro: Macro) -> Plan:
    *goal, speed, early = macro.numbers
    _check_held(field, macro)
    yield from touch.fling(field.arm, goal, speed, early, macro.target)


def _slip(field: MacroContext, macro: Macro) -> Plan:
    return touch.slip(field.arm, *map(round, macro.numbers))


def _lean(field: MacroContext, macro: Macro) -> Plan:
    axis, (angle,), way, (speed,) = macro.numbers[:3], macro.numbers[3:4], macro.numbers[4:7], macro.numbers[7:]
    return touch.lean(field.arm, axis, angle, way, speed)


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
    "pursue": _pursue,
    "pin": _pin,
    "block": _block,
    "take": _take,
    "cradle": _cradle,
    "touch": _touch,
    "await": _await,
    "meet": _meet,
    "stop": _stop,
    "ease": _ease,
    "roll": _roll,
    "bring": _bring,
    "settle": _settle,
    "slide": _slide,
    "fling": _fling,
    "slip": _slip,
    "lean": _lean,
}
"""The plan of each kind of macro."""


# --- parts of plans -----------------------------------------------------------------------------


def _check_held(field: MacroContext, macro: Macro) -> None:
    """Raise `GaveUp` if the target is not in the hand."""
    if held(field.arm) != macro.target:
        raise GaveUp(f"{macro.target} is not in the hand")


def _rise(arm: Arm, height: float) -> Plan:
    """Move straight up to a height [m], if the hand is lower."""
    if arm.hand[2] < height - FREE_PACE.within:
        yield from go_to(arm, [*arm.hand[:2], height], pace=FREE_PACE)


def _move_over(field: MacroContext, target: str, u: float, v: float, above: float) -> Plan:
    """Move the body in the hand, or the finger tips, over a point of a solid's upper face."""
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
    yield from go_to(arm, goal, pace=APPROACH, grip=CLOSED)


def _lower_until_contact(field: MacroContext, target: str, farthest: float, speed: float) -> Plan:
    """Lower the body in the hand, or the closed fingers, until it touches the target, by at most `farthest` [m]."""
    arm, world, body = field.arm, field.world, field.solids[target].body
    tool, end = held(arm) or arm.label, world.time + farthest / speed
    yield from push(arm, -speed * UP, lambda: world.touching(tool, body) or world.time > end, CLOSED)


def _push_blindly(arm: Arm, velocity: Vec3, seconds: float) -> Plan:
    """Push at a constant velocity for a time [s], without stopping at contact."""
    world, end = arm.world, arm.world.time + seconds - Loop.PERIOD / 2
    yield from push(arm, velocity, lambda: world.time > end, give_up=seconds + 1.0)
