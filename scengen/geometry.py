"""Directions, rotations and outlines: the geometry that scenes and moves share. Lengths in [m], angles in [rad]."""

import math
from collections.abc import Iterable, Sequence
from itertools import combinations

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

Vec3 = NDArray[np.float64]
"""Vector of shape (3,)."""
Mat3 = NDArray[np.float64]
"""Rotation matrix of shape (3, 3). Its columns are the axes of the rotated frame."""
Outline = NDArray[np.float64]
"""Corners of a rectangle in order, seen from above [m], shape (4, 2)."""

UP: Vec3 = np.array([0.0, 0.0, 1.0])
"""Unit vector that points up."""
AHEAD: Vec3 = np.array([1.0, 0.0, 0.0])
"""Unit vector that points away from the robot."""


def heading(angle: float) -> Vec3:
    """Level unit vector in the direction `angle` [deg]; 0 is x, 90 is y."""
    a = math.radians(angle)
    return np.array([math.cos(a), math.sin(a), 0.0])


DIRECTIONS = (
    "away from the robot",
    "away and to the robot's left",
    "to the robot's left",
    "towards the robot and to its left",
    "towards the robot",
    "towards the robot and to its right",
    "to the robot's right",
    "away and to the robot's right",
)
"""Level directions as text, every 45 deg from x on, counter-clockwise seen from above."""


def spoken(angle: float) -> str:
    """The one of `DIRECTIONS` that is nearest to the direction `angle` [deg]; 0 is x, 90 is y."""
    return DIRECTIONS[round(angle / 45.0) % len(DIRECTIONS)]


def way_to(there: Vec3, here: Vec3) -> str:
    """The one of `DIRECTIONS` in which a place lies, seen from another one [m]."""
    return spoken(math.degrees(math.atan2(there[1] - here[1], there[0] - here[0])))


def polar(offset: Vec3) -> tuple[float, float]:
    """Direction [rad] (0 is x) and length [m] of an offset seen from above."""
    x, y = offset[:2]
    return math.atan2(y, x), math.hypot(x, y)


def about_z(yaw: float) -> Mat3:
    """Rotation by `yaw` [rad] about the vertical."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def about_y(tilt: float) -> Mat3:
    """Rotation by `tilt` [rad] about y. It turns z towards x, and x down."""
    c, s = math.cos(tilt), math.sin(tilt)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def rotation(turn: Vec3) -> Mat3:
    """Rotation matrix of a rotation vector [rad]."""
    q, mat, angle = np.empty(4), np.empty(9), math.sqrt(turn @ turn)
    mujoco.mju_axisAngle2Quat(q, turn / max(angle, 1e-12), angle)
    mujoco.mju_quat2Mat(mat, q)
    return mat.reshape(3, 3)


def quat(axis: str, angle: float) -> list[float]:
    """Rotation by `angle` [rad] about the axis `x`, `y` or `z`, as a quaternion (wxyz)."""
    q = [math.cos(angle / 2), 0.0, 0.0, 0.0]
    q[1 + "xyz".index(axis)] = math.sin(angle / 2)
    return q


def compound(first: ArrayLike, second: ArrayLike) -> NDArray[np.float64]:
    """The rotation `second` followed by `first`, both about fixed axes, as a quaternion (wxyz)."""
    product = np.empty(4)
    mujoco.mju_mulQuat(product, np.asarray(first, float), np.asarray(second, float))
    return product


def between(here: Mat3, there: Mat3) -> Vec3:
    """Rotation vector in world axes [rad] that turns `here` into `there`."""
    q, turn = np.empty(4), np.empty(3)
    mujoco.mju_mat2Quat(q, (there @ here.T).ravel())
    mujoco.mju_quat2Vel(turn, q, 1.0)
    return turn


def shortest(here: Vec3, there: Vec3) -> Mat3:
    """Smallest rotation that takes one unit vector to another. The two must not be opposite."""
    v, c = np.cross(here, there), float(here @ there)
    k = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + k + k @ k / (1.0 + c)


def axes(x: Vec3, z: Vec3) -> Mat3:
    """Orientation of a frame whose first and last axes are the given perpendicular unit vectors."""
    return np.stack([x, np.cross(z, x), z], axis=1)


def yaw_of(rot: Mat3) -> float:
    """Direction of a body's x axis, seen from above [rad]."""
    return math.atan2(rot[1, 0], rot[0, 0])


def corners(pos: ArrayLike, yaw: float, size: ArrayLike, offset: ArrayLike = (0.0, 0.0)) -> Outline:
    """Outline of a box, seen from above.

    Args:
        pos: position of the body that the box belongs to, of which x and y are used [m].
        yaw: yaw of that body [rad].
        size: full lengths along the body's x and y [m].
        offset: offset of the box's middle from the body's origin, in the body's axes [m].
    """
    signs = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
    flat = about_z(yaw)[:2, :2]
    return (np.asarray(offset, float) + signs * np.asarray(size, float)[:2] / 2) @ flat.T + np.asarray(pos, float)[:2]


def gap(one: Outline, other: Outline) -> float:
    """Lower bound of the distance between two rectangles [m], exact face to face; negative if they overlap.

    It is the largest gap between their projections on the directions of their sides (separating axes).
    """
    sides = np.array([one[1] - one[0], one[2] - one[1], other[1] - other[0], other[2] - other[1]])
    axes = sides / np.linalg.norm(sides, axis=1, keepdims=True)
    a, b = one @ axes.T, other @ axes.T
    return float(np.maximum(a.min(axis=0) - b.max(axis=0), b.min(axis=0) - a.max(axis=0)).max())


def least_gap(bodies: Iterable[Sequence[Outline]]) -> float:
    """Least `gap` between outlines of different bodies, each of which has one outline or more [m]."""
    return min(gap(a, b) for one, other in combinations(bodies, 2) for a in one for b in other)
