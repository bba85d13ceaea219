"""Triangulation of polygons in space, which need not be convex."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from manifold3d import triangulate
from numpy.typing import ArrayLike, NDArray

from ..assets.mesh_prop import Points

FLAT_AREA = 1e-6
"""Area that counts as zero, over the square of the extent of a polygon, as coordinates in files are rounded."""

Indices = NDArray[np.int64]


class CrossesItself(Exception):
    """The outline of a polygon crosses itself."""


@dataclass(frozen=True)
class Polygons:
    """Polygons as indices of vertices."""

    corners: Indices
    """Corners of all polygons, one polygon after the other."""
    sizes: Indices
    """Number of corners of each polygon."""

    @classmethod
    def of(cls, polygons: Sequence[ArrayLike] | NDArray[np.integer]) -> Self:
        """Polygons from the list of the corners of each."""
        if isinstance(polygons, np.ndarray):
            count, size = polygons.shape
            return cls(polygons.astype(np.int64).ravel(), np.full(count, size))
        parts = [np.asarray(polygon, np.int64) for polygon in polygons]
        sizes = np.array([len(part) for part in parts], np.int64)
        return cls(np.concatenate(parts) if parts else np.zeros(0, np.int64), sizes)

    def joined(self, names: Indices) -> Self:
        """The polygons with other indices of vertices, without corners that repeat the previous one.

        Args:
            names: new index of each vertex.
        """
        corners, polygon = names[self.corners], np.repeat(np.arange(len(self.sizes)), self.sizes)
        starts = np.cumsum(self.sizes) - self.sizes
        before = np.arange(len(corners)) - 1
        before[starts[self.sizes > 0]] = (starts + self.sizes - 1)[self.sizes > 0]
        kept = corners != corners[before]
        sizes = np.bincount(polygon[kept], minlength=len(self.sizes))
        enough = sizes > 2
        return type(self)(corners[kept & enough[polygon]], sizes[enough])

    def triangles(self, points: Points) -> Indices:
        """Triangles that fill the polygons, shape (n, 3). They do not depend on the corner from which one is written.

        Raises:
            CrossesItself: an outline crosses itself.
        """
        starts = np.cumsum(self.sizes) - self.sizes
        found = []
        for size in np.unique(self.sizes):
            same = self.corners[starts[self.sizes == size, None] + np.arange(size)]
            first = np.argmin(same, axis=1)[:, None]
            same = np.take_along_axis(same, (first + np.arange(size)) % size, axis=1)
            if size == 3:
                found.append(same)
            elif size == 4:
                found.append(_cut_quadrilaterals(points, same))
            else:
                found.extend(_cut(points, polygon) for polygon in same)
        every = np.concatenate(found) if found else np.zeros((0, 3), np.int64)
        return every[(every != np.roll(every, 1, axis=1)).all(axis=1)]


def _cut_quadrilaterals(points: Points, corners: Indices) -> Indices:
    """Cut quadrilaterals along the diagonal that leaves the larger of the smallest triangles."""
    a, b, c, d = np.moveaxis(points[corners], 1, 0)
    normal = np.cross(c - a, d - b)
    doubled = np.linalg.norm(normal, axis=1, keepdims=True)
    normal /= np.maximum(doubled, 1e-300)
    extent = np.maximum(np.linalg.norm(c - a, axis=1), np.linalg.norm(d - b, axis=1))
    ways = np.array([[[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]])
    smallest = []
    for way in ways:
        p, q, r = np.moveaxis(points[corners[:, way]], 2, 0)
        smallest.append(np.einsum("nki,ni->nk", np.cross(q - p, r - p), normal).min(axis=1) / 2)
    first, second = smallest
    flat = FLAT_AREA * extent**2
    doubtful = (np.maximum(first, second) < -flat) | (doubled[:, 0] < 2 * flat)
    found = corners[np.arange(len(corners))[:, None, None], ways[(second > first + flat).astype(int)]].reshape(-1, 3)
    for polygon in corners[doubtful]:
        _cut(points, polygon)  # says what is wrong
    return found


def _cut(points: Points, corners: Indices) -> Indices:
    """Cut one polygon: its projection along its mean normal is triangulated."""
    own = points[corners] - points[corners].mean(axis=0)
    extent = float(np.ptp(own, axis=0).max())
    normal = np.cross(own, np.roll(own, -1, axis=0)).sum(axis=0) / 2
    flat = FLAT_AREA * extent**2
    if (area := float(np.linalg.norm(normal))) < flat:
        if np.linalg.svd(own, compute_uv=False)[1] > FLAT_AREA**0.5 * extent:
            raise CrossesItself
        middle = np.arange(1, len(corners) - 1)  # all corners are on a line
        return np.stack([np.broadcast_to(corners[0], middle.shape), corners[middle], corners[middle + 1]], axis=1)
    normal /= area
    x = np.cross(np.eye(3)[np.argmin(np.abs(normal))], normal)
    x /= np.linalg.norm(x)
    drawn = np.stack([own @ x, own @ np.cross(normal, x)], axis=1)
    cut = np.asarray(triangulate([drawn], allow_convex=False), np.int64)
    p, q, r = np.moveaxis(drawn[cut], 1, 0)
    one, other = (q - p).T, (r - p).T
    if ((one[0] * other[1] - one[1] * other[0]) / 2).min() < -flat:
        raise CrossesItself
    return corners[cut]
