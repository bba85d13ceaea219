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
    """The cage with its hole and sill moved to where they fit, within their own bounds."""
    axis = {BOTTOM: 2, END: 0, SIDE: 1, TOP: 2}[cage.face]
    along = 1 if cage.face == END else 0
    room = cage.cavity / 2
    hole = max(0.005, min(cage.hole, 0.95 * room[3 - axis - along], 0.4 * room[along]))
    sill_x = max(-0.08, cage.wall - 0.9 * room[0])
    low = sill_x + cage.wall if cage.face == BOTTOM else -room[along]
    offset = min(max(cage.offset, low + hole), room[along] - hole, 0.08)
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


def bore(cage, radius):
    """A cylinder through the holed plate and no other."""
    cylinder = Manifold.cylinder(2 * cage.wall, radius, circular_segments=1024, center=True)
    turn = {BOTTOM: (0, 0, 0), END: (0, 90, 0), SIDE: (90, 0, 0), TOP: (0, 0, 0)}[cage.face]
    return cylinder.rotate(turn).translate((cage.hole_centre + cage.wall / 2 * cage.normal).tolist())


@given(cage=anywhere(HoledCage).map(fitted))
@settings(max_examples=30, deadline=None)
def test_no_collision_geometry_lies_in_the_cavity_or_in_the_hole(cage):
    assert cage.margin > -1e-9
    shrink = 1e-6  # MuJoCo keeps mesh vertices in single precision
    cavity = Manifold.cube((cage.cavity - 2 * shrink).tolist(), True).translate(cage.middle.tolist())
    for centre, size in cage._sill():
        cavity -= Manifold.cube((size + 2 * shrink).tolist(), True).translate(centre.tolist())
    touched = union(cage)
    assert (touched ^ cavity).volume() < 1e-15
    assert (touched ^ bore(cage, cage.hole - shrink)).volume() < 1e-15


@given(cage=anywhere(HoledCage).map(fitted))
@settings(max_examples=30, deadline=None)
def test_collision_geometry_and_picture_differ_by_a_thin_ring_round_the_hole_alone(cage):
    """What is missing lies between the circle and the corners of the polygon. Seams of single precision are ignored."""
    seams = 1e-7 * float(cage.size.sum()) ** 2
    solid, touched = cage.solid(), union(cage)
    polygons = WEDGES * math.tan(math.pi / WEDGES) - SEGMENTS / 2 * math.sin(2 * math.pi / SEGMENTS)
    missing = solid - touched
    assert missing.volume() == pytest.approx(polygons * cage.hole**2 * cage.wall, abs=seams)
    assert (missing - bore(cage, cage.hole + BAR)).volume() < seams
    assert (touched - solid).volume() < seams
