"""Predicates that goals and failures of tasks are made of."""

import math

from .assets.keyboard import LETTERS
from .assets.prop import TABLE_TOP
from .control.loop import Loop
from .geometry import Vec3, yaw_of
from .sim.arm import ROBOT, Arm
from .sim.world import World


def fallen(world: World, *bodies: str, below: float = 0.05) -> str | None:
    """The first body whose centre of mass is more than `below` [m] under the table top, or None."""
    return next((body for body in bodies if world.com(body)[2] < TABLE_TOP - below), None)


def displaced(world: World, body: str, start: Vec3) -> float:
    """Distance of a body's centre of mass from `start`, measured along the table [m]."""
    offset = world.com(body) - start
    return math.hypot(offset[0], offset[1])


def carried(world: World, body: str, start: Vec3, beyond: float) -> bool:
    """Whether the robot touches a body whose origin is more than `beyond` [m] from its initial position.

    Args:
        start: the initial position of the origin [m].
    """
    return world.touching(ROBOT, body) and math.dist(world.pos(body), start) > beyond


def still(world: World, body: str, below: float) -> bool:
    """Whether a body's centre of mass moves slower than `below` [m/s]."""
    velocity = world.velocity(body)[3:]
    return math.sqrt(velocity @ velocity) < below


def held(world: World, body: str) -> bool:
    """Whether the robot touches a body that nothing else touches."""
    others = (name for name in world.touching_bodies(body) if name != ROBOT)
    return world.touching(ROBOT, body) and not any(others)


def borne(world: World, arm: Arm, body: str) -> bool:
    """Whether an arm grips a body that nothing else touches, the other arm neither."""
    others = (other for other in (*world.arms, *world.partners) if other is not arm)
    return arm.grips(body) and held(world, body) and not any(world.touching(other.label, body) for other in others)


def rests_on(world: World, body: str, support: str) -> bool:
    """Whether a body touches `support`, and neither the robot nor anything else."""
    return world.touching(body, support) and world.touching_bodies(body) == {support}


def inside(world: World, body: str, container: str, low: Vec3, high: Vec3) -> bool:
    """Whether a body's origin lies between two corners given in the container's axes [m]."""
    place = world.rot(container).T @ (world.pos(body) - world.pos(container))
    return all(least <= at <= most for least, at, most in zip(low, place.tolist(), high, strict=True))


def seated(world: World, body: str, container: str, middle: Vec3, off: float, high: float) -> bool:
    """Whether a body rests on `container` alone with its centre of mass near a position.

    Args:
        middle: the position [m].
        off: largest distance from it along the table [m].
        high: largest distance above or below it [m].
    """
    away = world.com(body) - middle
    return math.hypot(away[0], away[1]) < off and abs(away[2]) < high and rests_on(world, body, container)


def over(world: World, body: str, spot: Vec3, half: float) -> bool:
    """Whether a body's centre of mass is over a square along x and y, given by its middle and half its side [m]."""
    x, y, _ = (world.com(body) - spot).tolist()
    return max(abs(x), abs(y)) <= half


def count_time(world: World, name: str, holds: bool) -> None:
    """Remember under `name` for how long a condition has held without a break [s]. For `events`, once per period."""
    world.memory[name] = world.memory[name] + Loop.PERIOD if holds else 0.0


def touched_only(world: World, *allowed: str) -> str | None:
    """The first free body, not among the allowed ones, that the robot has touched since the start, or None."""
    return next((body for body in world.free_bodies if body not in allowed and world.touched(ROBOT, body)), None)


def remember_first_pose(world: World, body: str, number: int) -> None:
    """Remember where a body is, seen from above, unless that is known. For `events`.

    The names are `tried_<number>`, which says that it is known, `x_<number>`, `y_<number>` and `yaw_<number>`.
    """
    (x, y, _), yaw, memory = world.pos(body), yaw_of(world.rot(body)), world.memory
    if not memory[f"tried_{number}"]:
        memory[f"x_{number}"], memory[f"y_{number}"], memory[f"yaw_{number}"] = x, y, yaw
        memory[f"tried_{number}"] = 1.0


def off_first_pose(world: World, body: str, number: int) -> tuple[float, float]:
    """Distance [m] and angle [rad] of a body from the pose of `remember_first_pose`, from above; 0 if none is known."""
    if not world.memory[f"tried_{number}"]:
        return 0.0, 0.0
    x, y, yaw = (world.memory[f"{value}_{number}"] for value in ("x", "y", "yaw"))
    pos, turn = world.pos(body), math.remainder(yaw_of(world.rot(body)) - yaw, math.tau)
    return math.hypot(pos[0] - x, pos[1] - y), abs(turn)


SEVERAL_KEYS = -1
"""Number that stands for more than one key at once."""
KEY_MEMORY = ("key_0", "held_0", "key_1", "held_1")
"""Names of what `key_that_counts` remembers: for each arm the key that it touches, counted from 1, or `SEVERAL_KEYS`,
and the time for which it has touched it without a break [s]."""


def long_enough(seconds: float, hold: float) -> bool:
    """Whether a key counts that has been touched for `seconds`, if it must be touched for `hold` [s]."""
    return seconds > hold - 1e-9


def key_that_counts(world: World, arm: Arm, keyboard: str, hold: float) -> int:
    """Number of the key that counts now: an arm has just touched it for `hold` [s] without a break. 0 if there is none.

    For `events`, once per period.
    """
    memory, key, held = world.memory, f"key_{arm.number}", f"held_{arm.number}"
    touched = [name for name in world.touching_bodies(arm.label) if name.startswith(f"{keyboard}/key_")]
    now = SEVERAL_KEYS if len(touched) > 1 else LETTERS.index(touched[0][-1]) + 1 if touched else 0
    before = memory[held]
    memory[held] = (before if now == memory[key] else 0.0) + Loop.PERIOD if now else 0.0
    memory[key] = now
    counted = long_enough(before, hold) and memory[held] > before
    return now if long_enough(memory[held], hold) and not counted else 0
