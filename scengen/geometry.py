"""Directions, rotations and outlines: the few lines of geometry that scenes and moves share. [m], [rad]."""

import math

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

Vec3 = NDArray[np.float64]
"""Shape (3,)."""
Mat3 = NDArray[np.float64]
"""Shape (3, 3), columns are the axes of what is turned."""
Outline = NDArray[np.float64]
"""Shape (4, 2): the corners of a rectangle in order, seen from above [m]."""

UP: Vec3 = np.array([0.0, 0.0, 1.0])


def heading(angle: float) -> Vec3:
    """Level unit vector in the direction `angle` [deg]; 0 is x, 90 is y."""
    a = math.radians(angle)
    return np.array([math.cos(a), math.sin(a), 0.0])


def polar(offset: Vec3) -> tuple[float, float]:
    """Direction [rad], 0 is x, and length [m] of an offset as seen from above."""
    x, y = offset[:2]
    return math.atan2(y, x), math.hypot(x, y)


def about_z(yaw: float) -> Mat3:
    """The rotation by `yaw` [rad] about the vertical."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def about_y(tilt: float) -> Mat3:
    """The rotation by `tilt` [rad] about y: it turns z towards x, and x down."""
    c, s = math.cos(tilt), math.sin(tilt)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def rotation(turn: Vec3) -> Mat3:
    """The matrix of a rotation vector [rad]."""
    q, mat, angle = np.empty(4), np.empty(9), math.sqrt(turn @ turn)
    mujoco.mju_axisAngle2Quat(q, turn / max(angle, 1e-12), angle)
    mujoco.mju_quat2Mat(mat, q)
    return mat.reshape(3, 3)


def quat(axis: str, angle: float) -> list[float]:
    """The rotation by `angle` [rad] about the axis `x`, `y` or `z`, as a quaternion (wxyz)."""
    q = [math.cos(angle / 2), 0.0, 0.0, 0.0]
    q[1 + "xyz".index(axis)] = math.sin(angle / 2)
    return q


def between(here: Mat3, there: Mat3) -> Vec3:
    """The rotation vector in world axes [rad] that turns `here` into `there`."""
    q, turn = np.empty(4), np.empty(3)
    mujoco.mju_mat2Quat(q, (there @ here.T).ravel())
    mujoco.mju_quat2Vel(turn, q, 1.0)
    return turn


def shortest(here: Vec3, there: Vec3) -> Mat3:
    """The smallest rotation that takes one unit vector, not opposite to the other, to the other."""
    v, c = np.cross(here, there), float(here @ there)
    k = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + k + k @ k / (1.0 + c)


def axes(x: Vec3, z: Vec3) -> Mat3:
    """The orientation of what has these two unit vectors, at right angles, as its first and its last axis."""
    return np.stack([x, np.cross(z, x), z], axis=1)


def yaw_of(rot: Mat3) -> float:
    """Direction of a body's x axis, seen from above [rad]."""
    return math.atan2(rot[1, 0], rot[0, 0])


def corners(pos: ArrayLike, yaw: float, size: ArrayLike, offset: ArrayLike = (0.0, 0.0)) -> Outline:
    """The outline of a box: what of it is seen from above.

    Args:
        pos: of the body that it belongs to, of which x and y count [m].
        yaw: of that body [rad].
        size: full length along the body's x and y [m].
        offset: of the box' middle from the body's origin, in the body's axes [m].
    """
    signs = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
    flat = about_z(yaw)[:2, :2]
    return (np.asarray(offset, float) + signs * np.asarray(size, float)[:2] / 2) @ flat.T + np.asarray(pos, float)[:2]


def gap(one: Outline, other: Outline) -> float:
    """A lower bound of the distance of two rectangles [m], exact face to face; negative where they overlap.

    The largest gap between their shadows on the directions of their sides (separating axes).
    """
    sides = np.array([one[1] - one[0], one[2] - one[1], other[1] - other[0], other[2] - other[1]])
    axes = sides / np.linalg.norm(sides, axis=1, keepdims=True)
    a, b = one @ axes.T, other @ axes.T
    return float(np.maximum(a.min(axis=0) - b.max(axis=0), b.min(axis=0) - a.max(axis=0)).max())
