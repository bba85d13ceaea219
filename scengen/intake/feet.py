"""Feet for a body of convex pieces: a mesh rests on a table on one or two points of contact, and rocks."""

import math

import numpy as np
from manifold3d import Manifold

from ..assets.mesh_prop import Points
from ..assets.turned import FOOT_COUNT, FOOT_PROTRUSION, FOOT_RADIUS
from ..geometry import Vec3

LEVEL = 0.0003
"""How far above the plane that it stands on a corner may be to have a foot [m]."""
LEAN = math.radians(15.0)
"""How far a body may lean from how its file shows it, to stand [rad]."""


def feet(corners: Points, com: Vec3) -> Points:
    """Centres of the spheres of radius `FOOT_RADIUS` that a body stands on, shape (n, 3); none if it would not stand as it is.

    It stands on that side of its convex hull in which the foot of the perpendicular from the centre of mass lies; of
    several the most level one. Feet are where its corners reach farthest in `FOOT_COUNT` directions.

    Args:
        corners: of all its pieces [m].
        com: centre of mass [m].
    """
    side = side_below(corners, com)
    if side is None:
        return np.zeros((0, 3))
    up, height = side
    low = corners[corners @ up - height < LEVEL]
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
    """The unit vector from the side that a body stands on to the body, and that side's distance from the origin [m]."""
    hull = Manifold.hull_points(np.ascontiguousarray(corners)).to_mesh64()
    triangles = np.asarray(hull.vert_properties)[:, :3][np.asarray(hull.tri_verts, np.int64)]
    best = None
    for a, b, c in triangles:
        inward = np.cross(c - a, b - a)
        inward /= max(float(np.linalg.norm(inward)), 1e-18)
        below = com - ((com - a) @ inward) * inward
        inside = all(np.cross(q - p, below - p) @ inward <= 0.0 for p, q in ((a, b), (b, c), (c, a)))
        if inside and inward[2] > (best[0][2] if best else math.cos(LEAN)):
            best = inward, float(a @ inward)
    return best
