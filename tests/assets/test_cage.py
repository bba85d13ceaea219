"""The cage is the solid that it claims to be, and its hole decides by size alone what leaves it."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from helpers import anywhere
from hypothesis import given, settings
from manifold3d import Manifold

from scengen.assets.ball import Ball
from scengen.assets.cage import BOTTOM, END, SEGMENTS, SIDE, TOP, WEDGES, HoledCage
from scengen.assets.prop import place, table

BAR = 0.0005
"""Largest error that a decomposition may have [m]."""
FACES = {"bottom": BOTTOM, "end": END, "side": SIDE, "top": TOP}


def fitted(cage):
    """The cage with its hole made and moved to fit into its face."""
    axis = {BOTTOM: 2, END: 0, SIDE: 1, TOP: 2}[cage.face]
    along = 1 if cage.face == END else 0
    room = cage.cavity / 2
    hole = max(0.005, min(cage.hole, 0.95 * room[3 - axis - along], 0.4 * room[along]))
    offset = min(max(cage.offset, hole - room[along]), room[along] - hole, 0.08)
    return replace(cage, hole=hole, offset=offset)


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
    free = cavity, bore(cage, cage.hole - shrink)
    for piece in pieces(cage):  # each alone: a union of many that only just meet is not exact
        assert max((piece ^ space).volume() for space in free) < 1e-15


@given(cage=anywhere(HoledCage).map(fitted))
@settings(max_examples=30, deadline=None)
def test_collision_geometry_and_picture_differ_by_a_thin_ring_round_the_hole_alone(cage):
    """What is missing lies between the circle and the corners of the polygon. Seams of single precision are ignored."""
    seams = 1e-7 * float(cage.size.sum()) ** 2
    solid, touched = cage.manifold(), union(cage)
    polygons = WEDGES * math.tan(math.pi / WEDGES) - SEGMENTS / 2 * math.sin(2 * math.pi / SEGMENTS)
    missing = solid - touched
    assert missing.volume() == pytest.approx(polygons * cage.hole**2 * cage.wall, abs=seams)
    assert (missing - bore(cage, cage.hole + BAR)).volume() < seams
    assert (touched - solid).volume() < seams


# --- mechanics --------------------------------------------------------------------------


@given(cage=anywhere(HoledCage).map(fitted))
@settings(max_examples=15, deadline=None)
def test_mass_and_inertia_are_those_of_the_solid(cage):
    """The formula of the parts against MuJoCo's integral over the surface of the picture."""
    shown, spec = cage.manifold().to_mesh(), mujoco.MjSpec()
    mesh = spec.add_mesh(name="solid", inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_EXACT)
    mesh.uservert = np.asarray(shown.vert_properties, float)[:, :3].ravel().tolist()
    mesh.userface = np.asarray(shown.tri_verts).ravel().tolist()
    body = spec.worldbody.add_body()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="solid", mass=cage.mass)
    integral, formula = spec.compile(), cage.spec().compile()
    assert formula.body_mass[1] == pytest.approx(cage.mass)
    assert formula.body_ipos[1] == pytest.approx(integral.body_ipos[1], abs=2e-5)
    assert formula.body_inertia[1] == pytest.approx(integral.body_inertia[1], rel=2e-3)


class Shaken:
    """A ball in a cage that is held still while gravity turns about it: what the ball feels is the same."""

    def __init__(self, cage, radius):
        self.cage, scene = cage, table()
        place(scene, cage, "cage", [0, 0, 2.0], free=False)
        spot = cage.hole_centre - (cage.wall / 2 + radius + 0.0005) * cage.normal
        place(scene, Ball(radius=radius, density=1400.0), "ball", spot + np.array([0, 0, 2.0]))
        self.model = scene.compile()
        self.data = mujoco.MjData(self.model)

    def gets_out(self, force, seconds):
        """Whether the ball's centre leaves the cage under `force(time)` [m/s^2]."""
        while self.data.time < seconds:
            self.model.opt.gravity[:] = force(self.data.time)
            mujoco.mj_step(self.model, self.data)
            place = self.data.qpos[:3] - [0, 0, 2.0]
            if (np.abs(place - self.cage.middle) > self.cage.size / 2).any():
                return True
        return False


def shaking(time):
    """Three times gravity this way and that, at frequencies that never meet."""
    return 30.0 * np.array([math.sin(11 * time), math.sin(17 * time + 1), math.sin(13 * time + 2)])


@pytest.mark.parametrize("face", FACES.values(), ids=FACES)
@pytest.mark.parametrize(("wider", "leaves"), [(-0.001, True), (0.001, False)])
def test_a_ball_1_mm_wider_than_the_hole_stays_in_and_one_1_mm_narrower_is_shaken_out(face, wider, leaves):
    cage = HoledCage(face=face, offset=0.0 if face == END else 0.043)
    assert Shaken(cage, cage.hole + wider / 2).gets_out(shaking, 8.0) == leaves


@pytest.mark.parametrize("face", FACES.values(), ids=FACES)
def test_no_force_along_the_hole_squeezes_a_ball_through_that_is_1_mm_wider(face):
    cage = HoledCage(face=face, offset=0.0 if face == END else 0.043)
    assert not Shaken(cage, cage.hole + 0.0005).gets_out(lambda _: 100.0 * cage.normal, 1.0)
    assert Shaken(cage, cage.hole - 0.0005).gets_out(lambda _: 100.0 * cage.normal, 1.0)


def test_the_walls_of_a_closed_cage_keep_the_smallest_ball():
    assert not Shaken(HoledCage(closed=True), 0.008).gets_out(shaking, 8.0)


@pytest.mark.parametrize(("more", "leaves"), [(-1.5, False), (1.5, True)])
@pytest.mark.parametrize(("hole", "radius", "angle"), [(0.0175, 0.015, 45.57), (0.0160, 0.015, 53.13)])
def test_a_ball_rolls_over_the_rim_where_its_centre_passes_it(hole, radius, angle, more, leaves):
    """The vertical through the centre must pass the rim: cos(tilt) = 1 - height / radius."""
    cage = HoledCage(face=END, offset=0.0, hole=hole)
    tilt = cage.rim_tilt(radius)
    assert math.degrees(tilt) == pytest.approx(angle, abs=0.01)
    shaken = Shaken(cage, radius)
    at_rim = cage.cavity[0] / 2 - radius * math.sin(tilt)
    shaken.data.qpos[:3] = [at_rim, 0.0, 2.0 + cage.wall + radius]
    lean = tilt + math.radians(more)
    assert shaken.gets_out(lambda _: 9.81 * np.array([math.sin(lean), 0, -math.cos(lean)]), 2.0) == leaves


@pytest.mark.parametrize(
    ("depth", "aside", "passes"),
    [(-0.001, 0.0, False), (0.001, 0.0, True), (0.014, 0.0, True), (0.016, 0.0, False), (0.001, 0.018, False)],
    ids=["inside", "just beyond", "almost out", "out", "beside the hole"],
)
@pytest.mark.parametrize("face", FACES.values(), ids=FACES)
def test_a_ball_passes_while_its_centre_is_in_the_hole_beyond_the_wall(face, depth, aside, passes):
    cage = HoledCage(face=face, offset=0.0 if face == END else 0.043)
    across = np.roll(np.abs(cage.normal), 1)
    assert cage.passes(cage.hole_centre + depth * cage.normal + aside * across, 0.015) == passes
