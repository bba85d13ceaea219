"""A tile obeys statics, and a chain does not know which way the axes of the world point."""

import math

import mujoco
import numpy as np
import pytest
from helpers import anywhere
from hypothesis import given, settings

from scengen.assets.box import Domino
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.tasks.domino_single import DominoSingle


@pytest.mark.parametrize(("factor", "falls"), [(0.9, False), (1.1, True)])
@given(tile=anywhere(Domino).filter(lambda d: d.height > 1.5 * d.thickness and d.friction > 0.3))
@settings(max_examples=25, deadline=None)
def test_a_tile_falls_when_its_centre_passes_the_edge(tile, factor, falls):
    scene = table()
    place(scene, tile, "tile", (0, 0, TABLE_TOP))
    model = scene.compile()
    data = mujoco.MjData(model)
    lean(data, tile.thickness / 2, factor * tile.tipping_angle)
    mujoco.mj_step(model, data, round(2.0 / model.opt.timestep))
    tilt = math.acos(np.clip(data.body("tile").xmat[8], -1, 1))
    assert (tilt > math.radians(60)) == falls


def lean(data, about_x, angle):
    """Turn the free body about the line x = `about_x` on the table, parallel to y."""
    c, s = math.cos(angle), math.sin(angle)
    data.qpos[:3] = about_x - c * about_x, 0, TABLE_TOP + s * about_x
    data.qpos[3:7] = math.cos(angle / 2), 0, math.sin(angle / 2), 0


@pytest.mark.parametrize(("factor", "slides"), [(0.93, False), (1.07, True)])
@pytest.mark.parametrize("friction", [0.1, 0.3, 0.6])
def test_a_lying_tile_slides_on_a_slope_steeper_than_its_friction(friction, factor, slides):
    """Slope angle = atan mu, with the tile's own friction although the table has mu = 1."""
    scene = table()
    place(scene, Domino(height=0.03, thickness=0.03, friction=friction), "tile", (0, 0, TABLE_TOP))
    slope = math.atan(factor * friction)
    scene.option.gravity = [9.81 * math.sin(slope), 0, -9.81 * math.cos(slope)]
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 500)
    expected = 0.5 * 9.81 * (math.sin(slope) - friction * math.cos(slope))  # after 1 s, if it slides
    assert (data.body("tile").xpos[0] > 0.7 * max(expected, 0.002)) == slides


def cascade(chain: DominoSingle, cone: mujoco.mjtCone = mujoco.mjtCone.mjCONE_ELLIPTIC, impratio: float = 20.0):
    """Where the slab ends, along, across and above the chain [m], when the starter is given a spin, without robot."""
    scene = chain.build()
    scene.option.cone, scene.option.impratio = cone, impratio
    model = scene.compile()
    data = mujoco.MjData(model)
    spin = model.joint("tile_0_free").dofadr[0] + 4
    data.qvel[spin] = 4.0  # rad/s about the tile's own y axis
    mujoco.mj_step(model, data, 1250)
    offset = data.body("slab").xipos - chain.spot(chain.count)
    across = np.array([-chain.u[1], chain.u[0], 0.0])
    return np.array([offset @ chain.u, offset @ across, offset[2]])


@pytest.mark.parametrize("heading", [30.0, 45.0, 90.0, 135.0, 180.0])
def test_turning_the_whole_scene_turns_the_end(heading):
    straight, turned = (cascade(DominoSingle(count=4, gap_ratio=1.2, heading=h)) for h in (0.0, heading))
    assert straight[0] > 0.05
    assert np.linalg.norm(turned - straight) < 0.0005


@pytest.mark.parametrize("yaw", [2.0, 8.0])
def test_mirroring_the_whole_scene_mirrors_the_end(yaw):
    """Less exact than a turn: which corners of two touching boxes make contacts is not chosen symmetrically."""
    left, right = (cascade(DominoSingle(count=4, gap_ratio=1.2, slab_yaw=y)) for y in (yaw, -yaw))
    assert np.linalg.norm(left * [1, -1, 1] - right) < 0.004


def test_under_the_default_cone_the_end_would_depend_on_the_heading():
    """Why every scene carries its own cone: MuJoCo's default is four-sided, and its corners show."""
    pyramid = mujoco.mjtCone.mjCONE_PYRAMIDAL
    straight, turned = (cascade(DominoSingle(count=4, gap_ratio=1.2, heading=h), pyramid, 1.0) for h in (0.0, 45.0))
    assert np.linalg.norm(turned - straight) > 0.002
