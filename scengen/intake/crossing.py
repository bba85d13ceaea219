"""Length of the curves along which a triangulated surface crosses itself."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ..assets.mesh_prop import Points

TOLERANCE = 1e-5
"""Distance that counts as zero [m]: many files are rounded to micrometres, so that surfaces cross by as much."""
MIN_HEIGHT = 5e-5
"""Smallest height of a triangle whose plane is used [m]: rounding tilts the plane of a thinner one."""
MORTON_BITS = 10
"""Bits for each coordinate in the order of the triangles."""

Indices = NDArray[np.int64]


def longest_crossing(points: Points, faces: Indices) -> float:
    """Length of the longest connected curve along which a surface crosses itself [m]; 0.0 if it does not.

    Triangles that only touch, or that share an edge, do not cross. Of two triangles the one that is less thin decides,
    as its plane is known better.
    """
    triangles = points[faces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    doubled = np.linalg.norm(normals, axis=1)
    heights = doubled / np.maximum(np.linalg.norm(triangles - triangles[:, [1, 2, 0]], axis=2).max(axis=1), 1e-300)
    normals /= np.maximum(doubled[:, None], 1e-300)
    thin, thick = _near(triangles)
    swapped = heights[thin] > heights[thick]
    thin, thick = np.where(swapped, thick, thin), np.where(swapped, thin, thick)
    common = (faces[thin][:, :, None] == faces[thick][:, None, :]).sum(axis=(1, 2))
    examined = (common < 2) & (heights[thick] > MIN_HEIGHT)
    thin, thick = thin[examined], thick[examined]
    lengths = _overlaps(triangles[thin], triangles[thick], normals[thick])
    crossing = lengths > 0.0
    if not crossing.any():
        return 0.0
    return _longest(faces, thin[crossing], thick[crossing], lengths[crossing])


def _near(triangles: Points) -> tuple[Indices, Indices]:
    """Pairs of triangles whose bounding boxes overlap.

    The boxes are leaves of a binary tree along a space-filling curve. Pairs of nodes are refined level by level.
    """
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    order = np.argsort(_morton(low + high), kind="stable")
    levels = [(low[order], high[order])]
    while len(levels[-1][0]) > 1:
        lows, highs = levels[-1]
        if len(lows) % 2:  # an empty box overlaps nothing
            lows, highs = np.vstack([lows, np.full(3, np.inf)]), np.vstack([highs, np.full(3, -np.inf)])
            levels[-1] = lows, highs
        levels.append((np.minimum(lows[::2], lows[1::2]), np.maximum(highs[::2], highs[1::2])))
    first = second = np.zeros(1, np.int64)
    for lows, highs in reversed(levels[:-1]):
        pairs = np.stack([2 * first, 2 * second])[:, :, None] + np.array([[[0, 0, 1, 1]], [[0, 1, 0, 1]]])
        first, second = pairs.reshape(2, -1)
        kept = first <= second
        first, second = first[kept], second[kept]
        kept = ((lows[first] <= highs[second]) & (lows[second] <= highs[first])).all(axis=1)
        first, second = first[kept], second[kept]
    apart = first < second
    return order[first[apart]], order[second[apart]]


def _morton(spots: Points) -> Indices:
    """Positions of points along a space-filling curve."""
    span = np.maximum(np.ptp(spots, axis=0), 1e-300)
    cells = ((spots - spots.min(axis=0)) / span * (2**MORTON_BITS - 1)).astype(np.int64)
    codes = np.zeros(len(spots), np.int64)
    for bit in range(MORTON_BITS):
        for axis in range(3):
            codes |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return codes


def _overlaps(first: Points, second: Points, normals: Points) -> NDArray[np.float64]:
    """Length of the segment that each pair of triangles has in common, apart from the rim of the second one [m].

    Args:
        normals: unit normals of the second triangles.
    """
    lengths = np.zeros(len(first))
    above = np.einsum("nij,nj->ni", first - second[:, :1], normals)
    above = np.where(np.abs(above) > TOLERANCE, above, 0.0)
    across = np.flatnonzero((above.min(axis=1) < 0.0) & (above.max(axis=1) > 0.0))
    above, first, second, normals = above[across], first[across], second[across], normals[across]
    start, end = _segment(first, above)
    low, high = np.zeros(len(across)), np.ones(len(across))
    for k in range(3):  # cut the segment off at each side of the triangle
        side = second[:, (k + 1) % 3] - second[:, k]
        inwards = np.cross(normals, side)
        inwards /= np.linalg.norm(inwards, axis=1, keepdims=True)
        before, after = (np.einsum("nj,nj->n", spot - second[:, k], inwards) - TOLERANCE for spot in (start, end))
        rise = after - before
        place = -before / np.where(rise == 0.0, 1.0, rise)
        low = np.where(rise > 0.0, np.maximum(low, place), low)
        high = np.where(rise < 0.0, np.minimum(high, place), high)
        high = np.where((rise == 0.0) & (before < 0.0), -1.0, high)
    shared = (high - low) * np.linalg.norm(end - start, axis=1)
    lengths[across] = np.where((high > low) & (shared > TOLERANCE), shared, 0.0)
    return lengths


def _segment(triangles: Points, above: NDArray[np.float64]) -> tuple[Points, Points]:
    """Ends of the segments in which triangles meet planes that have corners of theirs on both sides.

    Args:
        above: heights of the corners above the plane [m].
    """
    following, next_above = triangles[:, [1, 2, 0]], above[:, [1, 2, 0]]
    cut = (above * next_above < 0.0) | (above == 0.0)  # two of three: sides that are cut, or corners on the plane
    share = np.where(cut & (above != 0.0), above / np.where(above == next_above, 1.0, above - next_above), 0.0)
    spots = triangles + share[:, :, None] * (following - triangles)
    rows = np.arange(len(triangles))
    return spots[rows, cut.argmax(axis=1)], spots[rows, 2 - cut[:, ::-1].argmax(axis=1)]


def _longest(faces: Indices, first: Indices, second: Indices, lengths: NDArray[np.float64]) -> float:
    """Length of the longest curve: pairs of triangles are on one curve if corners of theirs coincide."""
    ends = faces[np.stack([first, second])]  # (2, n, 3)
    count = int(ends.max()) + 1
    start = np.broadcast_to(ends[0, :, :1], (len(first), 5)).ravel()
    others = np.column_stack([ends[0, :, 1:], ends[1]]).ravel()
    _, curves = connected_components(coo_matrix((np.ones(len(start)), (start, others)), (count, count)), directed=False)
    return float(np.bincount(curves[ends[0, :, 0]], lengths).max())
