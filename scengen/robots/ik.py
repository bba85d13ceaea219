"""How near the Panda's grip site can come to a place: inverse kinematics within joint limits, from fixed starts.

A residual found here is attained by a posture, so it can only be too large, never too small: it proves reach, and
suggests its absence. `shortfall` proves absence: it is too small everywhere, never too large. Where the two are close
to each other nothing is left to doubt. Neither knows of collisions, gravity or torque: the arm may pass through the
table and itself, so what is out of reach here is out of reach for good.
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
"""No posture takes any point of the gripper farther than this from `panda.SHOULDER` [m].

The first two stretches are those of `panda.REACH`; the third ends at the tip of an open finger, 0.0545 across the axis
of joint 7 and 0.2127 along it, measured on the collision meshes.
"""
LEVER = 0.1
"""A turn of 1 rad counts as much as this distance [m]: about the length of the hand."""
EXACT = 1e-6
"""A posture this close to what is asked for ends the search [m]."""
STARTS: NDArray[np.float64] = np.array(
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
"""Joint angles from which a search sets out [rad], shape (n, 7): home, leaning and stretched, wrist and elbow to
either side, wrist up. Joint 1 is turned towards the target first."""


@dataclass(frozen=True)
class Nearest:
    """The best posture of a search."""

    angles: NDArray[np.float64]
    """Joint angles [rad], shape (7,)."""
    residual: float
    """Distance left between grip site and target [m]."""
    turn: float
    """Angle left between the hand and the asked orientation [rad]; 0 where any orientation will do."""

    @property
    def left(self) -> float:
        """Both in one [m]: what a search makes small."""
        return self.residual + LEVER * self.turn


def reach(target: ArrayLike, rot: NDArray[np.float64] | None = None) -> Nearest:
    """The posture that brings the grip site closest to `target`, in the least-squares sense.

    Args:
        target: world position [m], shape (3,).
        rot: orientation of the grip site, shape (3, 3); any orientation will do by default.
    """
    goal, best = np.asarray(target, float), None
    for start in STARTS:
        found = _descend(goal, rot, start)
        if best is None or found.left < best.left:
            best = found
        if best.left < EXACT:
            break
    assert best is not None
    return best


def shortfall(target: ArrayLike, length: float = panda.REACH) -> float:
    """A distance [m] by which the robot misses `target` in every posture: the triangle inequality.

    Not positive where the bound says nothing. It ignores joint limits, and so is smaller than `reach` finds.

    Args:
        length: `panda.REACH` to ask about the grip site, `GRIPPER_REACH` to ask about any point of the gripper [m].
    """
    return float(np.linalg.norm(np.asarray(target, float) - panda.SHOULDER)) - length


def box_shortfall(
    centre: NDArray[np.float64], rot: NDArray[np.float64], half: ArrayLike, length: float = panda.REACH
) -> float:
    """`shortfall` of the point of a box that is nearest to the shoulder, and so of every point of it [m].

    Args:
        half: half its edges, shape (3,), or half the edge of a cube [m].
        length: as for `shortfall`.
    """
    inside = np.clip(rot.T @ (panda.SHOULDER - centre), -np.asarray(half), half)
    return shortfall(centre + rot @ inside, length)


def _descend(goal: NDArray[np.float64], rot: NDArray[np.float64] | None, start: NDArray[np.float64]) -> Nearest:
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
    return _Arm()
