"""The cage is the solid that it claims to be, and its hole decides by size alone what leaves it."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from helpers import anywhere
from hypothesis import given, settings
from manifold3d import Manifold

from scengen.assets.cage import BOTTOM, END, SEGMENTS, SIDE, TOP, WEDGES, HoledCage

BAR = 0.0005
"""Largest error that a decomposition may have [m]."""
FACES = {"bottom": BOTTOM, "end": END, "side": SIDE, "top": TOP}


def fitted(cage):
    """The cage with its hole and sill moved to where they fit."""
    axis = {BOTTOM: 2, END: 0, SIDE: 1, TOP: 2}[cage.face]
    along = 1 if cage.face == END else 0
    room = cage.cavity / 2
    hole = min(cage.hole, 0.95 * room[3 - axis - along], 0.4 * room[along])
    sill_x = -0.9 * room[0] + cage.wall
    low = sill_x + cage.wall if cage.face == BOTTOM else -room[along]
    offset = min(max(cage.offset, low + hole), room[along] - hole)
    return replace(cage, hole=hole, offset=offset, sill_x=sill_x, sill=min(cage.sill, room[2]))


def pieces(cage):
    """What a compiled cage collides with, as convex solids in its own axes."""
    model = cage.spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for g in range(model.ngeom):
        if not model.geom_contype[g]:
            continue
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX:
            corners = model.geom_size[g] * np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
        else:
            mesh = model.geom_dataid[g]
            corners = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
        yield Manifold.hull_points(corners @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g])


def union(cage):
    return sum(pieces(cage), Manifold())


def vertices(solid):
    return np.asarray(solid.to_mesh().vert_properties)[:, :3]


@given(cage=anywhere(HoledCage).map(fitted))
@settings(max_examples=30, deadline=None)
def test_no_collision_geometry_lies_in_the_cavity_or_in_the_hole(cage):
    assert cage.margin > -1e-9
    shrink = 1e-6  # MuJoCo keeps mesh vertices in single precision
    cavity = Manifold.cube((cage.cavity - 2 * shrink).tolist(), True).translate(cage.middle.tolist())
    for centre, size in cage._sill():
        cavity -= Manifold.cube((size + 2 * shrink).tolist(), True).translate(centre.tolist())
    bore = Manifold.cylinder(2 * cage.wall, cage.hole - shrink, circular_segments=1024, center=True)
    turn = {BOTTOM: (0, 0, 0), END: (0, 90, 0), SIDE: (90, 0, 0), TOP: (0, 0, 0)}[cage.face]
    bore = bore.rotate(turn).translate((cage.hole_centre + cage.wall / 2 * cage.normal).tolist())
    touched = union(cage)
    assert (touched ^ cavity).volume() < 1e-15
    assert (touched ^ bore).volume() < 1e-15


@given(cage=anywhere(HoledCage).map(fitted))
@settings(max_examples=30, deadline=None)
def test_all_that_the_collision_geometry_lacks_is_a_thin_ring_round_the_hole(cage):
    """What is missing lies between circle and polygon, so the largest error is that of the polygon's corners."""
    missing = cage.solid() - union(cage)
    polygons = WEDGES * math.tan(math.pi / WEDGES) - SEGMENTS / 2 * math.sin(2 * math.pi / SEGMENTS)
    assert missing.volume() == pytest.approx(polygons * cage.hole**2 * cage.wall, rel=1e-3)
    ring = max(missing.decompose(), key=lambda part: part.volume())
    from_centre = vertices(ring) - cage.hole_centre
    radius = np.linalg.norm(from_centre - np.outer(from_centre @ cage.normal, cage.normal), axis=1)
    assert radius.max() - cage.hole < BAR
    assert missing.volume() - ring.volume() < 1e-12
