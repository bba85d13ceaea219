"""Feet for a body of convex pieces: without them a mesh has one or two points of contact with a table, and rocks."""

import math

import numpy as np
from manifold3d import Manifold

from ..assets.mesh_prop import Points
from ..assets.turned import FOOT_COUNT, FOOT_PROTRUSION, FOOT_RADIUS
from ..geometry import Vec3

CORNER_HEIGHT = 0.0003
"""Largest height of a corner above the plane on which the body stands for the corner to get a foot [m]."""
MAX_LEAN = math.radians(15.0)
"""Largest angle between the orientation of the file and the one in which the body stands [rad]."""


def feet(corners: Points, com: Vec3) -> Points:
    """Centres of the feet of a body, spheres of radius `FOOT_RADIUS`, shape (n, 3) [m]; none if it cannot stand.

    The body stands on the face of its convex hull that contains the foot of the perpendicular from the centre of mass;
    of several faces on the most horizontal one. Feet are at the corners that are farthest in `FOOT_COUNT` directions.

    Args:
        corners: corners of all its pieces [m].
        com: centre of mass [m].
    """
    side = side_below(corners, com)
    if side is None:
        return np.zeros((0, 3))
    up, height = side
    low = corners[corners @ up - height < CORNER_HEIGHT]
    x = np.cross(up, [0.0, 1.0, 0.0])
    x /= np.linalg.norm(x)
    flat = np.stack([x, np.cross(up, x)])
    angles = 2 * math.pi * np.arange(FOOT_COUNT) / FOOT_COUNT
    away = (low - com) @ flat.T
    farthest = np.unique((away @ np.stack([np.cos(angles), np.sin(angles)])).argmax(axis=0))
    spots, distances = away[farthest], np.linalg.norm(away[farthest], axis=1, keepdims=True)
    inwards = spots * np.maximum(
        1 - FOOT_RADIUS / np.maximum(distances, FOOT_RADIUS), 0.0
    )  # not to stand out at the side
    base = com + (height - com @ up + FOOT_RADIUS - FOOT_PROTRUSION) * up
    return base + inwards @ flat


def side_below(corners: Points, com: Vec3) -> tuple[Vec3, float] | None:
    """Inward unit normal of the face on which a body stands, and the face's distance from the origin [m], or None."""
    hull = Manifold.hull_points(np.ascontiguousarray(corners)).to_mesh64()
    triangles = np.asarray(hull.vert_properties)[:, :3][np.asarray(hull.tri_verts, np.int64)]
    best = None
    for a, b, c in triangles:
        inward = np.cross(c - a, b - a)
        inward /= max(float(np.linalg.norm(inward)), 1e-18)
        below = com - ((com - a) @ inward) * inward
        inside = all(np.cross(q - p, below - p) @ inward <= 0.0 for p, q in ((a, b), (b, c), (c, a)))
        if inside and inward[2] > (best[0][2] if best else math.cos(MAX_LEAN)):
            best = inward, float(a @ inward)
    return best
