"""The cage is the solid that it claims to be, and its hole decides by size alone what leaves it."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from helpers import anywhere
from hypothesis import example, given, settings
from manifold3d import Manifold

from scengen.assets.ball import Ball
from scengen.assets.cage import BOTTOM, END, SEGMENTS, SIDE, TOP, WEDGES, HoledCage
from scengen.assets.prop import place, table

BAR = 0.0005
"""Largest error that a decomposition may have [m]."""
FACES = {"bottom": BOTTOM, "end": END, "side": SIDE, "top": TOP}


def fitted(cage):
    """The cage with its hole, its sill and the wall of its trap moved to where they fit, within their own bounds."""
    axis = {BOTTOM: 2, END: 0, SIDE: 1, TOP: 2}[cage.face]
    along = 1 if cage.face == END else 0
    room = cage.cavity / 2
    hole = max(0.005, min(cage.hole, 0.95 * room[3 - axis - along], 0.4 * room[along]))
    trap_x = max(-0.08, cage.wall - 0.9 * room[0])
    sill_x = trap_x + cage.wall
    low = sill_x + cage.wall if cage.face == BOTTOM else -room[along]
    offset = min(max(cage.offset, low + hole), room[along] - hole, 0.08)
    sill, trap_sill = min(cage.sill, room[2]), min(cage.trap_sill, room[2])
    return replace(cage, hole=hole, offset=offset, sill_x=sill_x, sill=sill, trap_x=trap_x, trap_sill=trap_sill)


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


MEETING = HoledCage(
    length=0.08,
    width=0.0625,
    height=0.0625,
    wall=0.0032713438704522826,
    face=END,
    hole=0.015625,
    offset=0.0,
    sill=0.0078125,
    trap=0.015625,
    trap_sill=0.006754993846739619,
)
"""Its two sills meet but for rounding."""


@given(cage=anywhere(HoledCage).map(fitted))
@example(cage=fitted(MEETING))
@settings(max_examples=30, deadline=None)
def test_no_collision_geometry_lies_in_the_cavity_or_in_the_hole(cage):
    assert cage.margin > -1e-9
    shrink = 1e-6  # MuJoCo keeps mesh vertices in single precision
    cavity = Manifold.cube((cage.cavity - 2 * shrink).tolist(), True).translate(cage.middle.tolist())
    centre, size = cage._trap()[1]
    cavity += Manifold.cube((size - 2 * shrink).tolist(), True).translate(centre.tolist())
    for centre, size in cage._sills():
        cavity -= Manifold.cube((size + 2 * shrink).tolist(), True).translate(centre.tolist())
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
        """Whether the ball's centre leaves the cage and its trap under `force(time)` [m/s^2]."""
        while self.data.time < seconds:
            self.model.opt.gravity[:] = force(self.data.time)
            mujoco.mj_step(self.model, self.data)
            place = self.data.qpos[:3] - [0, 0, 2.0]
            boxes = [(self.cage.middle, self.cage.size), self.cage._trap()[0]]
            if all((np.abs(place - centre) > size / 2).any() for centre, size in boxes):
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
    assert not Shaken(HoledCage(closed=True, sill=0.0), 0.008).gets_out(shaking, 8.0)


def rolled(cage, radius, tilt, start, way):
    """Where a ball is, in the cage's axes [m], after 2 s on a floor tilted [rad] towards `way`, which is 1 or -1."""
    scene = table()
    scene.option.gravity = [way * 9.81 * math.sin(tilt), 0, -9.81 * math.cos(tilt)]
    place(scene, cage, "cage", [0, 0, 2.0], free=False)
    place(scene, Ball(radius=radius), "ball", [start[0], 0, 2.0 + start[1]])
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 1000)
    return data.qpos[:3] - [0, 0, 2.0]


@pytest.mark.parametrize(("more", "rolls"), [(-1.5, False), (1.5, True)])
@pytest.mark.parametrize(
    ("sill", "radius", "angle"), [(0.003, 0.015, 36.87), (0.005, 0.015, 48.19), (0.005, 0.012, 54.31)]
)
def test_a_ball_rolls_over_the_sill_where_its_centre_passes_the_edge(sill, radius, angle, more, rolls):
    """The vertical through the centre must pass the edge: cos(tilt) = 1 - sill / radius."""
    cage = HoledCage(sill=sill, closed=True)
    tilt = cage.tilt_over_sill(radius)
    assert math.degrees(tilt) == pytest.approx(angle, abs=0.01)
    against = cage.sill_x - cage.beside(sill, radius)
    end = rolled(cage, radius, tilt + math.radians(more), (against, cage.wall + radius), 1.0)
    assert (end[0] > cage.sill_x) == rolls


@pytest.mark.parametrize(("more", "falls"), [(-1.5, False), (1.5, True)])
@pytest.mark.parametrize(("sill", "angle"), [(0.0012, 23.07), (0.0020, 29.93)])
def test_the_same_law_holds_for_the_sill_of_the_trap_and_the_ball_sinks_in(sill, angle, more, falls):
    cage, radius = HoledCage(trap_sill=sill), 0.015
    tilt = cage.tilt_into_trap(radius)
    assert math.degrees(tilt) == pytest.approx(angle, abs=0.01)
    against = cage.trap_x + cage.beside(sill, radius)
    end = rolled(cage, radius, tilt + math.radians(more), (against, cage.wall + radius), -1.0)
    assert cage.traps(end, radius) == falls and (end[0] < cage.trap_x) == falls


@pytest.mark.parametrize(("trap", "angle", "tilt", "stays"), [(0.016, 90.0, 80.0, True), (0.005, 54.1, 57.0, False)])
def test_out_of_a_trap_deeper_than_its_radius_no_ball_rolls_again(trap, angle, tilt, stays):
    """The sill on top counts: of the shallow one it makes a step of 6.2 mm, and cos(54.1 deg) = 1 - 6.2 / 15."""
    cage, radius = HoledCage(trap=trap, closed=True), 0.015
    assert math.degrees(cage.tilt_out_of_trap(radius)) == pytest.approx(angle, abs=0.1)
    start = (cage.trap_x - cage.wall / 2 - radius, cage.wall - trap + radius)
    assert (rolled(cage, radius, math.radians(tilt), start, 1.0)[0] < cage.trap_x) == stays
