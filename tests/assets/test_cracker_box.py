"""A cracker box of any size has one density, slides at the angle of its friction, and tips at that of its shape."""

import math

import mujoco
import numpy as np
import pytest

from scengen.assets.cracker_box import CrackerBox
from scengen.assets.prop import TABLE_TOP, place, table

SIZES = pytest.mark.parametrize("scale", [0.75, 0.85, 1.0, 1.15])


def on_slope(box, slope):
    scene = table()
    scene.option.gravity = [9.81 * math.sin(slope), 0, -9.81 * math.cos(slope)]
    place(scene, box, "box", [0, 0, TABLE_TOP])
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 400)
    return data.body("box")


@SIZES
def test_all_sizes_have_one_density(scale):
    box = CrackerBox(scale=scale)
    assert box.mass / np.prod(box.size) == pytest.approx(0.411 / (0.0717 * 0.1636 * 0.2138))
    assert box.spec().compile().body("body").mass[0] == pytest.approx(box.mass)


@SIZES
@pytest.mark.parametrize("friction", [0.15, 0.25])
@pytest.mark.parametrize(("factor", "slides"), [(0.93, False), (1.07, True)])
def test_it_slides_before_it_tips_whatever_its_size(scale, friction, factor, slides):
    """tan(slope) = friction, below length / height = 0.335, where it would tip."""
    body = on_slope(CrackerBox(scale=scale, friction=friction), math.atan(factor * friction))
    assert (body.xpos[0] > 0.005) == slides and body.xmat[8] > 0.99


@pytest.mark.parametrize(("factor", "tips"), [(0.95, False), (1.05, True)])
def test_a_rough_one_tips_at_the_angle_of_its_shape(factor, tips):
    box = CrackerBox(friction=0.6)
    assert (on_slope(box, factor * math.atan(box.size[0] / box.size[2])).xmat[8] < 0.98) == tips
