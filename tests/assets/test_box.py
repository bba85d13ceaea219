"""Boxes tip, slide and stop where a textbook says."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from helpers import anywhere
from hypothesis import given, settings

from scengen.assets.bar import Bar
from scengen.assets.box import LEAD_DENSITY, Block, Cube, Domino, Lid, LoadedCube
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.physics import GRAVITY


def alone(box, slope=0.0):
    """A box on the table, and a gravity that leans towards +x by `slope` [rad]."""
    scene = table()
    place(scene, box, "box", [0, 0, TABLE_TOP])
    scene.option.gravity = [GRAVITY * math.sin(slope), 0, -GRAVITY * math.cos(slope)]
    model = scene.compile()
    return model, mujoco.MjData(model)


def lean(data, about_x, angle):
    """Turn the free body about the line x = `about_x` on the table, parallel to y."""
    c, s = math.cos(angle), math.sin(angle)
    data.qpos[:3] = about_x - c * about_x, 0, TABLE_TOP + s * about_x
    data.qpos[3:7] = math.cos(angle / 2), 0, math.sin(angle / 2), 0


@pytest.mark.parametrize(
    "box", [Domino(), Block(), Cube(), Bar(long=2.0, high=1.5), LoadedCube(), Lid()], ids=lambda box: type(box).__name__
)
def test_a_box_weighs_what_it_should_and_stands_on_the_middle_of_its_foot(box):
    model, data = alone(box)
    mujoco.mj_forward(model, data)
    assert model.body("box").mass == pytest.approx(box.mass)
    assert 2 * model.geom("box/box").size == pytest.approx(box.size)
    assert data.body("box").xipos == pytest.approx([0, 0, TABLE_TOP + box.size[2] / 2])


@pytest.mark.parametrize(("factor", "falls"), [(0.9, False), (1.1, True)])
@given(tile=anywhere(Domino).filter(lambda d: d.height > 1.5 * d.thickness and d.friction > 0.3))
@settings(max_examples=25, deadline=None)
def test_a_tile_falls_when_its_centre_passes_the_edge(tile, factor, falls):
    model, data = alone(tile)
    lean(data, tile.thickness / 2, factor * tile.tipping_angle)
    mujoco.mj_step(model, data, round(2.0 / model.opt.timestep))
    tilt = math.acos(np.clip(data.body("box").xmat[8], -1, 1))
    assert (tilt > math.radians(60)) == falls


@pytest.mark.parametrize(("factor", "slides"), [(0.93, False), (1.07, True)])
@pytest.mark.parametrize("friction", [0.1, 0.3, 0.6])
def test_a_lying_tile_slides_on_a_slope_steeper_than_its_friction(friction, factor, slides):
    """Slope angle = atan mu, with the tile's own friction although the table has mu = 1."""
    slope = math.atan(factor * friction)
    model, data = alone(Domino(height=0.03, thickness=0.03, friction=friction), slope)
    mujoco.mj_step(model, data, 500)
    expected = 0.5 * GRAVITY * (math.sin(slope) - friction * math.cos(slope))  # after 1 s, if it slides
    assert (data.body("box").xpos[0] > 0.7 * max(expected, 0.002)) == slides


@pytest.mark.parametrize("mass", [0.06, 0.5])
@pytest.mark.parametrize("friction", [0.1, 0.4])
def test_a_sliding_cube_stops_after_v_squared_by_2_mu_g_whatever_it_weighs(friction, mass):
    """0.25 m/s, as fast as the hand draws: 32 mm on a slippery cube's sides, 8 mm on a common one's."""
    model, data = alone(Cube(friction=friction, mass=mass))
    data.qvel[0] = 0.25
    mujoco.mj_step(model, data, 500)
    assert data.qpos[0] == pytest.approx(0.25**2 / (2 * friction * GRAVITY), rel=0.06)
    assert abs(data.qvel[0]) < 1e-3


@pytest.mark.parametrize(("slope", "tips"), [(43.0, False), (47.0, True)])
def test_a_cube_that_cannot_slide_tips_at_45_degrees(slope, tips):
    model, data = alone(Cube(friction=1.5), math.radians(slope))
    mujoco.mj_step(model, data, 500)
    assert (data.body("box").xmat[8] < math.cos(math.radians(30))) == tips


@pytest.mark.parametrize(("beyond", "tips"), [(-0.001, False), (0.001, True)])
def test_a_lid_tips_off_a_cube_once_its_centre_has_passed_the_edge(beyond, tips):
    scene, cube, lid = table(), Cube(edge=0.025, mass=0.1), Lid()
    place(scene, cube, "cube", [0, 0, TABLE_TOP])
    place(scene, lid, "lid", [cube.edge / 2 + beyond, 0, TABLE_TOP + cube.edge])
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 500)
    assert (math.acos(min(1.0, data.body("lid").xmat[8])) > math.radians(5)) == tips


@pytest.mark.parametrize(("factor", "goes_along"), [(0.93, False), (1.07, True)])
def test_a_cube_goes_along_with_a_lid_whose_friction_on_it_exceeds_what_holds_both(factor, goes_along):
    """Coulomb: the lid drags with mu M g, mu being the larger of the two, the table holds with mu_cube (m + M) g."""
    cube = Cube(edge=0.025, mass=0.03, friction=0.4)
    lid = Lid(mass=0.04, friction=factor * 0.4 * (0.03 + 0.04) / 0.04)
    scene = table()
    place(scene, cube, "cube", [0, 0, TABLE_TOP])
    place(scene, lid, "lid", [0, 0, TABLE_TOP + cube.edge])
    model = scene.compile()
    data = mujoco.MjData(model)
    while data.body("lid").xpos[0] < 0.008 and data.time < 3.0:
        data.body("lid").xfrc_applied[0] = 0.2 * data.time  # [N], far more slowly than anything swings
        mujoco.mj_step(model, data)
    assert data.time < 3.0 and (data.body("cube").xpos[0] > 0.004) == goes_along


@pytest.mark.parametrize(("beyond", "tips"), [(-0.001, False), (0.001, True)])
def test_a_loaded_cube_tips_once_its_centre_of_mass_has_passed_the_edge(beyond, tips):
    """15 mm from its middle, on a block 24 mm wide: the middle of the cube is 2 to 4 mm behind the edge then."""
    cube, block = LoadedCube(edge=0.052, lean=0.29), Cube(edge=0.024, mass=0.2)
    scene = table()
    place(scene, block, "block", [0, 0, TABLE_TOP])
    place(scene, cube, "cube", [block.edge / 2 + beyond - cube.com, 0, TABLE_TOP + block.edge])
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 500)
    assert (data.body("cube").xmat[8] < math.cos(math.radians(20))) == tips


def test_the_slug_of_a_loaded_cube_weighs_what_lead_weighs_and_fits_in():
    cube = LoadedCube(edge=0.052, mass=0.05, lean=0.29)
    assert cube.slug**3 * LEAD_DENSITY == pytest.approx(0.9 * 0.05)
    assert cube.com / 0.9 + cube.slug / 2 < cube.edge / 2  # where its outer side is
    assert cube.lean < cube.steepest
    assert replace(cube, lean=cube.steepest).com / 0.9 + cube.slug / 2 == pytest.approx(cube.edge / 2)


def test_a_loaded_cube_swings_about_an_edge_with_the_inertia_of_foam_and_slug():
    """The parallel axis theorem, for two cubes: about an axis through the middle, across the load."""
    cube = LoadedCube(edge=0.052, mass=0.05, lean=0.29)
    foam, slug = 0.1 * 0.05, 0.9 * 0.05
    about_the_middle = foam * cube.edge**2 / 6 + slug * (cube.slug**2 / 6 + (cube.com / 0.9) ** 2)
    assert cube.inertia[2] + cube.mass * cube.com**2 == pytest.approx(about_the_middle)
    model, _ = alone(cube)
    assert model.body("box").inertia == pytest.approx(cube.inertia)
    assert model.body("box").ipos == pytest.approx([cube.com, 0.0, cube.edge / 2])
