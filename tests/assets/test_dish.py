"""A dish pressed on its rim leans by the rim's incline, if the press beats its weight about the foot; it is a solid."""

import math

import mujoco
import numpy as np
import pytest
from helpers import anywhere
from hypothesis import given, settings

from scengen.assets.dish import Dish
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.assets.turned import FOOT_PROTRUSION
from scengen.physics import GRAVITY


def pressed(dish, force, at, steps=1000):
    """Tilt [rad] and height of the highest corner [m] of a dish that is pressed on its rim with a force [N]."""
    scene = table()
    place(scene, dish, "dish", [0.0, 0.0, TABLE_TOP])
    model = scene.compile()
    model.dof_damping[3:6] = 0.01  # [N m s/rad], as of a finger that stays on the rim: it does not bounce
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    body = model.body("dish").id
    for _ in range(steps):
        push, rot = np.zeros(model.nv), data.xmat[body].reshape(3, 3)
        spot = data.xpos[body] + rot @ [at, 0.0, dish.height]
        mujoco.mj_applyFT(model, data, [0.0, 0.0, -force], [0.0, 0.0, 0.0], spot, body, push)
        data.qfrc_applied[:] = push
        mujoco.mj_step(model, data)
    rot = data.xmat[body].reshape(3, 3)
    raised = data.xpos[body] + rot @ [-dish.radius, 0.0, dish.rise]
    return math.acos(np.clip(rot[2, 2], -1.0, 1.0)), raised[2] - TABLE_TOP


@pytest.mark.parametrize("dish", [Dish(), Dish(radius=0.09, incline=24.0, mass=0.03)], ids=["nominal", "small"])
def test_a_press_that_beats_the_weight_about_the_foot_raises_the_other_side_as_geometry_says(dish):
    """F (r - foot) = m g foot, and rise cos + (radius + foot) sin."""
    at = dish.radius - 0.008
    force = dish.mass * GRAVITY * dish.foot / (at - dish.foot)
    tilt, raised = pressed(dish, 1.2 * force, at)
    assert tilt == pytest.approx(dish.slope, rel=0.01)
    assert raised == pytest.approx(dish.raised, rel=0.01)
    assert pressed(dish, 0.9 * force, at)[0] < 0.01


def test_left_alone_it_stands_still():
    tilt, raised = pressed(Dish(), 0.0, 0.1, 1000)
    assert tilt < 1e-4 and raised == pytest.approx(Dish().rise, abs=1e-4)


@settings(deadline=None, max_examples=15)
@given(anywhere(Dish))
def test_anywhere_within_its_bounds_it_weighs_what_it_should(dish):
    model = dish.spec().compile()
    assert model.body("body").mass == pytest.approx(dish.mass)
    assert dish.foot > 0.03 and dish.height == pytest.approx(dish.rise + dish.thickness)
    assert all(min(z for _, z in section.corners) >= FOOT_PROTRUSION for section in dish.sections)
