"""Random macros by identity: the same key always gives the same macro."""

import math
from bisect import bisect
from dataclasses import replace
from itertools import accumulate

from ..samplers.keyed import spread, unit
from ..sim.arm import Arm
from .macros import Macro
from .player import Player
from .solids import TABLE, Solid, handles, sides

Key = tuple[str | int, ...]

KIND_SHARES = {
    "pick": 0.30,
    "push": 0.26,
    "place": 0.12,
    "press": 0.10,
    "turn": 0.08,
    "shake": 0.06,
    "throw": 0.04,
    "wait": 0.04,
}
"""Shares of the kinds of macro."""
MAX_MACROS = 5
"""Maximum number of macros in a random plan."""
ALIGNED_SHARE = 0.8
"""Share of the directions that are aligned with the solid in question."""


def plan(player: Player, *key: str | int) -> tuple[Macro, ...]:
    """One to five random macros."""
    count = 1 + int(MAX_MACROS * unit(*key, "count"))
    return tuple(macro(player, *key, place) for place in range(count))


def macro(player: Player, *key: str | int) -> Macro:
    """A random macro, for the scene at the start of the episode."""
    player.rewind()
    share = unit(*key, "kind")
    ends = list(accumulate(KIND_SHARES.values()))
    kind = list(KIND_SHARES)[bisect(ends[:-1], share)]
    return replace(_MAKERS[kind](player, key), arm=_arm(player, key).number)


def varied(one: Macro, *key: str | int) -> Macro:
    """The macro with its numbers changed by up to a fifth; whole numbers stay."""
    numbers = tuple(n if n == round(n) else n * (1 + spread(0.2, *key, k)) for k, n in enumerate(one.numbers))
    return one if one.kind in ("shortcut", "replay", "answer", "follow") else replace(one, numbers=numbers)


def _pick(player: Player, key: Key) -> Macro:
    found = handles(player.solids, _arm(player, key).suction)
    if not found:
        return _push(player, key)
    solid = found[int(len(found) * unit(*key, "target"))]
    fits = sides(player.world, player.solids, solid) or [0]
    which = fits[0] if unit(*key, "side") < 0.7 else fits[-1]
    return Macro(
        "pick", solid.name, (unit(*key, "height"), _skew(key), float(which), _within(0.03, 0.25, *key, "lift"))
    )


def _push(player: Player, key: Key) -> Macro:
    solid = _target(player, key, table=False)
    numbers = (
        _direction(player, solid, key),
        _within(0.05, 0.95, *key, "height"),
        0.0 if unit(*key, "middle") < 0.5 else spread(0.8, *key, "offset"),
        _within(0.03, 0.18, *key, "way"),
        _speed(key),
    )
    return Macro("push", solid.name, numbers)


def _place(player: Player, key: Key) -> Macro:
    drop = 0.0 if unit(*key, "lowered") < 0.7 else _within(0.01, 0.12, *key, "drop")
    numbers = (*_place_on_face(key), drop, _within(0.05, 0.10, *key, "speed"))
    return Macro("place", _target(player, key, table=True).name, numbers)


def _press(player: Player, key: Key) -> Macro:
    numbers = (*_place_on_face(key), _within(0.1, 0.6, *key, "seconds"), _within(0.05, 0.15, *key, "speed"))
    return Macro("press", _target(player, key, table=False).name, numbers)


def _turn(player: Player, key: Key) -> Macro:
    axis, angle = int(3 * unit(*key, "axis")), math.radians(_within(20.0, 90.0, *key, "angle"))
    turn = [0.0, 0.0, 0.0]
    turn[axis] = angle if unit(*key, "sign") < 0.5 else -angle
    return Macro("turn", "", (*turn, _within(0.5, 2.5, *key, "rate")))


def _shake(player: Player, key: Key) -> Macro:
    along = [0.0, 0.0, 0.0]
    along[int(3 * unit(*key, "axis"))] = 1.0
    spin = 0.0 if unit(*key, "spins") < 0.5 else math.copysign(1.0, spread(1.0, *key, "spin"))
    return Macro("shake", "", (*along, spin, _within(0.1, 0.5, *key, "period"), _within(0.5, 2.5, *key, "duration")))


def _throw(player: Player, key: Key) -> Macro:
    yaw, rise = spread(math.pi, *key, "yaw"), _within(0.0, 1.2, *key, "rise")
    way = (math.cos(rise) * math.cos(yaw), math.cos(rise) * math.sin(yaw), math.sin(rise))
    return Macro("throw", "", (*way, _within(0.1, 0.6, *key, "seconds")))


def _wait(player: Player, key: Key) -> Macro:
    return Macro("wait", "", (_within(0.2, 1.5, *key, "seconds"),))


_MAKERS = {
    "pick": _pick,
    "push": _push,
    "place": _place,
    "press": _press,
    "turn": _turn,
    "shake": _shake,
    "throw": _throw,
    "wait": _wait,
}
"""The function that draws each kind of macro."""


def _arm(player: Player, key: Key) -> Arm:
    """A random arm of the robot."""
    arms = player.world.arms
    return arms[int(len(arms) * unit(*key, "arm"))]


def _target(player: Player, key: Key, table: bool) -> Solid:
    found = [solid for solid in player.solids.values() if table or solid.body != TABLE]
    return found[int(len(found) * unit(*key, "target"))]


def _direction(player: Player, solid: Solid, key: Key) -> float:
    """A direction along one of the level axes of a solid, either way, or any direction [rad]."""
    if unit(*key, "aligned") > ALIGNED_SHARE:
        return spread(math.pi, *key, "direction")
    along, _ = solid.level_axes(player.world)[int(2 * unit(*key, "side"))]
    return math.atan2(along[1], along[0]) + (math.pi if unit(*key, "sign") < 0.5 else 0.0)


def _skew(key: Key) -> float:
    return 0.0 if unit(*key, "aligned") < ALIGNED_SHARE else spread(math.pi / 4, *key, "skew")


def _place_on_face(key: Key) -> tuple[float, float]:
    """A place on an upper face, as two shares of its half lengths."""
    return spread(0.9, *key, "u"), spread(0.9, *key, "v")


def _speed(key: Key) -> float:
    """Speed of a push [m/s]: 0.30 is the maximum speed of the hand."""
    return _within(0.08, 0.30, *key, "speed")


def _within(low: float, high: float, *key: str | int) -> float:
    return low + (high - low) * unit(*key)
