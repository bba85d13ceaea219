"""Distance between the Panda's grip site and a target: inverse kinematics within joint limits, from fixed starts.

A posture attains every residual that `reach` finds. The residual can therefore only be too large, never too small: it
proves that a target is reachable, and only suggests that it is not. `shortfall` proves that a target is out of reach:
it can only be too small, never too large. Where the two are close to each other, the answer is certain. Both ignore
collisions, gravity and torque. The arm may pass through the table and itself, so a target that is out of reach here is
out of reach in the simulation.
"""

import functools
import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from ..geometry import between
from . import panda

GRIPPER_REACH = math.hypot(0.316, 0.0825) + math.hypot(0.0825, 0.384) + math.hypot(0.088 + 0.0545, 0.2127)
"""Distance from `panda.SHOULDER` that no posture exceeds for any point of the gripper [m].

The first two stretches are those of `panda.REACH`. The third ends at the tip of an open finger, 0.0545 across the axis
of joint 7 and 0.2127 along it, measured on the collision meshes.
"""
LEVER = 0.1
"""Distance that counts as much as a turn of 1 rad [m]: about the length of the hand."""
SEARCH_TOLERANCE = 1e-6
"""Residual at which the search ends [m]."""
START_POSTURES: NDArray[np.float64] = np.array(
    [
        panda.HOME,
        [0.0, 0.9, 0.0, -0.6, 0.0, 1.5, 0.8],
        [0.0, 1.5, 0.0, -0.1, 0.0, 1.6, 0.8],
        [0.0, 0.9, 0.0, -1.2, 1.5, 1.2, -0.8],
        [0.0, 0.9, 0.0, -1.2, -1.5, 1.2, 2.0],
        [0.0, 0.3, 1.5, -1.2, 0.0, 2.5, 0.8],
        [0.0, 0.3, -1.5, -1.2, 0.0, 2.5, 0.8],
        [0.0, 1.2, 0.0, -0.6, 0.0, 3.0, 0.8],
    ]
)
"""Joint angles from which a search starts [rad], shape (n, 7): home, leaning and stretched, wrist and elbow to either
side, wrist up. Joint 1 is turned towards the target first."""


@dataclass(frozen=True)
class Nearest:
    """Best posture of a search."""

    angles: NDArray[np.float64]
    """Joint angles [rad], shape (7,)."""
    residual: float
    """Distance between grip site and target [m]."""
    turn: float
    """Angle between the hand and the requested orientation [rad]; 0 if any orientation is accepted."""

    @property
    def error(self) -> float:
        """Combined residual of distance and angle [m], which the search minimizes."""
        return self.residual + LEVER * self.turn


def reach(target: ArrayLike, rot: NDArray[np.float64] | None = None) -> Nearest:
    """The posture that brings the grip site closest to `target`, in the least-squares sense.

    Args:
        target: world position [m], shape (3,).
        rot: orientation of the grip site, shape (3, 3); by default any orientation is accepted.
    """
    goal, best = np.asarray(target, float), None
    for start in START_POSTURES:
        found = _descend(goal, rot, start)
        if best is None or found.error < best.error:
            best = found
        if best.error < SEARCH_TOLERANCE:
            break
    assert best is not None
    return best


def shortfall(target: ArrayLike, length: float = panda.REACH) -> float:
    """Distance by which the robot misses `target` in every posture [m], by the triangle inequality.

    It is zero or negative where the bound proves nothing. It ignores joint limits, and is therefore smaller than the
    residual of `reach`.

    Args:
        target: world position [m], shape (3,).
        length: `panda.REACH` for the grip site, `GRIPPER_REACH` for any point of the gripper [m].
    """
    return float(np.linalg.norm(np.asarray(target, float) - panda.SHOULDER)) - length


def box_shortfall(
    centre: NDArray[np.float64], rot: NDArray[np.float64], half: ArrayLike, length: float = panda.REACH
) -> float:
    """`shortfall` of the point of a box that is nearest to the shoulder, and so of every point of the box [m].

    Args:
        centre: middle of the box [m].
        rot: orientation of the box.
        half: half its edges, shape (3,), or half the edge of a cube [m].
        length: as for `shortfall`.
    """
    inside = np.clip(rot.T @ (panda.SHOULDER - centre), -np.asarray(half), half)
    return shortfall(centre + rot @ inside, length)


def _descend(goal: NDArray[np.float64], rot: NDArray[np.float64] | None, start: NDArray[np.float64]) -> Nearest:
    """The best posture of one search."""
    arm = _arm()
    low, high = arm.limits
    angles = start.copy()
    angles[0] = np.arctan2(goal[1] - panda.BASE[1], goal[0] - panda.BASE[0])

    def error(q: NDArray[np.float64]) -> NDArray[np.float64]:
        place, here = arm.pose(q)
        return place - goal if rot is None else np.concatenate([place - goal, LEVER * between(rot, here)])

    def slope(q: NDArray[np.float64]) -> NDArray[np.float64]:
        return arm.slope(q, rot is not None)

    inside = np.clip(angles, low + 1e-6, high - 1e-6)
    end = least_squares(error, inside, slope, (low, high), xtol=1e-10).x  # type: ignore[arg-type]
    left = error(end)
    return Nearest(end, float(np.linalg.norm(left[:3])), float(np.linalg.norm(left[3:])) / LEVER)


class _Arm:
    """The bare arm as MuJoCo compiles it, for its kinematics alone."""

    def __init__(self) -> None:
        spec = mujoco.MjSpec()
        panda.attach(spec)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.site = self.model.site(panda.Names().grip_site).id
        joints = [self.model.joint(name) for name in panda.Names().joints]
        self.at = np.array([joint.qposadr[0] for joint in joints])
        self.dofs = np.array([joint.dofadr[0] for joint in joints])
        ranges = np.array([joint.range for joint in joints])
        self.limits = ranges[:, 0], ranges[:, 1]

    def pose(self, angles: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Position [m] and orientation of the grip site."""
        self.data.qpos[self.at] = angles
        mujoco.mj_kinematics(self.model, self.data)
        return self.data.site_xpos[self.site].copy(), self.data.site_xmat[self.site].reshape(3, 3).copy()

    def slope(self, angles: NDArray[np.float64], turning: bool) -> NDArray[np.float64]:
        """Derivative of the position, and of `LEVER` times the turn, shape (3 or 6, 7)."""
        self.pose(angles)
        mujoco.mj_comPos(self.model, self.data)
        along, about = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, along, about, self.site)
        return np.vstack([along, LEVER * about])[: 6 if turning else 3, self.dofs]


@functools.cache
def _arm() -> _Arm:
    """The bare arm, compiled once."""
    return _Arm()
