"""The box around geoms of a body, in the axes of that body."""

from collections.abc import Iterable

import mujoco
import numpy as np
from numpy.typing import NDArray


def box_around(model: mujoco.MjModel, geoms: Iterable[int]) -> NDArray[np.float64]:
    """Lower and upper corner of the box around some geoms of one body, in its axes [m], shape (2, 3); 0 without geoms.

    Args:
        geoms: numbers of the geoms.
    """
    low, high, axes = np.full(3, np.inf), np.full(3, -np.inf), np.empty(9)
    for geom in geoms:
        mujoco.mju_quat2Mat(axes, model.geom_quat[geom])
        turn, (middle, half) = axes.reshape(3, 3), model.geom_aabb[geom].reshape(2, 3)
        middle, half = model.geom_pos[geom] + turn @ middle, np.abs(turn) @ half
        low, high = np.minimum(low, middle - half), np.maximum(high, middle + half)
    return np.stack([low, high]) if np.isfinite(low).all() else np.zeros((2, 3))
