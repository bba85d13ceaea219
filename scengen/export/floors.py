"""Smallest spreads of columns in the statistics with which trainers normalise.

A dimension that is constant in training has a standard deviation of 0, and trainers divide by 1e-8 then: an
out-of-distribution shift of 1 mm becomes an input of 1e5, and the measured drop is an artefact of the arithmetic.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .stats import Stats

LENGTH = 1e-3
"""Smallest spread of a position [m]."""
ANGLE = 8.7e-3
"""Smallest spread of an angle, 0.5 deg [rad]; entries of a quaternion are those of half the angle."""
SPEED = 1e-2
"""Smallest spread of a velocity [m/s]."""
RATE = 8.7e-2
"""Smallest spread of an angular velocity, 5 deg/s [rad/s]."""
FORCE = 1.0
"""Smallest spread of a force [N]."""
TORQUE = 0.1
"""Smallest spread of a torque [N m]: a force of 1 N at the length of the hand, 0.1 m."""
ACTION_SHARE = 1e-2
"""Smallest spread of a number of an action, which has the range [-1, 1]."""

BY_WORD: Mapping[str, float] = {
    "joint_pos": ANGLE,
    "joint_vel": RATE,
    "gripper_qpos": LENGTH,
    "vel_lin": SPEED,
    "vel_ang": RATE,
    "quat": ANGLE / 2,
    "pos": LENGTH,
    "box_low": LENGTH,
    "box_high": LENGTH,
    "torque": TORQUE,
    "force": FORCE,
    "tactile": FORCE,
    "control.actions": ACTION_SHARE,
    "_move_": ACTION_SHARE,
    "_turn_": ACTION_SHARE,
    "_gripper": ACTION_SHARE,
}
"""Smallest spread by the first of these words that is in the name of an entry: `force_torque.force_x` is a force."""
PAIRS = (("min", "max"), ("q01", "q99"), ("q10", "q90"))
"""Statistics whose difference trainers divide by."""


def floor_of(entry: str) -> float:
    """Smallest spread of an entry such as `cube_pos.x`; 0 if its name has no unit."""
    found = [entry.rpartition(".")[2], entry]  # the last word decides first
    return next((size for name in found for word, size in BY_WORD.items() if word in name), 0.0)


def floors_of(column: str, entries: Sequence[str] | None, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Smallest spreads of a column, of its shape; numbers have shape (1,).

    Args:
        entries: names of its entries, if it is a vector.
    """
    if len(shape) == 1 and entries is not None:
        return np.array([floor_of(entry) for entry in entries])
    return np.full(shape or (1,), floor_of(column))


def with_floors(found: Stats, floors: NDArray[np.float64]) -> Stats:
    """Statistics with spreads that are not below the floors: `std`, and the pairs of `PAIRS`.

    A pair of quantiles that is narrower becomes minimum and maximum, so that a rare value, such as a short grasp, stays
    of moderate size; minimum and maximum are widened about their middle.
    """
    made = {name: np.array(found[name], float) for name in ("std", *(name for pair in PAIRS for name in pair))}
    middle, half = (made["min"] + made["max"]) / 2, np.maximum((made["max"] - made["min"]) / 2, floors)
    wide = {"std": np.maximum(made["std"], floors)}
    for low, high in PAIRS:
        narrow = made[high] - made[low] < 2 * floors
        wide[low] = np.where(narrow, middle - half, made[low])
        wide[high] = np.where(narrow, middle + half, made[high])
    return {**found, **{name: values.tolist() for name, values in wide.items()}}
