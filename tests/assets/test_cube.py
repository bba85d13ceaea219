"""A cube that is let go stops, and tips, where a textbook says."""

import math

import mujoco
import pytest

from scengen.assets.box import Cube
from scengen.assets.prop import TABLE_TOP, place, table

GRAVITY = 9.81


def alone(cube, slope=0.0):
    """A cube on the table, and a gravity that leans towards +x by `slope` [rad]."""
    scene = table()
    place(scene, cube, "cube", [0, 0, TABLE_TOP])
    scene.option.gravity = [GRAVITY * math.sin(slope), 0, -GRAVITY * math.cos(slope)]
    model = scene.compile()
    return model, mujoco.MjData(model)


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
    assert (data.body("cube").xmat[8] < math.cos(math.radians(30))) == tips
