"""A ball stays on the side of the ridge where it was let go, and is drawn aside as the two slopes say."""

import math

import mujoco
import numpy as np
import pytest

from scengen.assets.ball import Ball
from scengen.assets.barrier import Barrier, let_pass
from scengen.assets.box import Cube
from scengen.assets.crowned_ramp import CrownedRamp
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.geometry import UP

BALL = Ball(radius=0.018, density=1000.0, friction=0.6)


def rolled(ramp, x, y, seconds, side):
    """Places of a ball every 2 ms that is let go on a slab at (x, y), in the ramp's axes [m], shape (n, 3)."""
    scene = table()
    place(scene, ramp, "ramp", [0.0, 0.0, TABLE_TOP], free=False)
    place(scene, BALL, "ball", ramp.surface(x, y) + BALL.radius * ramp.axes(side)[:, 2] + TABLE_TOP * UP)
    model = scene.compile()
    data, found = mujoco.MjData(model), []
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        found.append(data.body("ball").xpos - TABLE_TOP * UP)
    return np.array(found)


@pytest.mark.parametrize("pitch", [8.0, 12.0, 18.0])
def test_a_ball_rolls_at_five_sevenths_of_what_it_would_slide(pitch):
    ramp = CrownedRamp(pitch=pitch, lean=0.3)
    path = rolled(ramp, -0.09, 0.04, 0.4, 1)
    along = (path - path[0]) @ ramp.axes(1)[:, 0]
    slope = math.sin(math.radians(pitch))
    assert along[-1] == pytest.approx(5 / 7 * 9.81 * slope * 0.4**2 / 2, rel=0.02)


@pytest.mark.parametrize(("pitch", "lean"), [(12.0, 4.0), (12.0, 1.5), (18.0, 4.0)])
@pytest.mark.parametrize("side", [1, -1])
def test_a_ball_is_drawn_aside_in_proportion_to_the_two_slopes(pitch, lean, side):
    ramp = CrownedRamp(pitch=pitch, lean=lean)
    path = rolled(ramp, -0.09, side * 0.02, 0.4, side)
    along, aside, _ = path[-1] - path[0]
    assert aside / along == pytest.approx(side * ramp.drift / ramp.length, rel=0.05)


@pytest.mark.parametrize("ridge", [-0.03, 0.0, 0.05])
@pytest.mark.parametrize("side", [1, -1])
def test_beside_the_ridge_the_side_is_certain_and_it_is_the_ridges_side(ridge, side):
    """2 mm outside the contact of both slabs is enough in a ramp that is perfectly still."""
    ramp = CrownedRamp(ridge=ridge)
    beside = BALL.radius * math.sin(math.radians(ramp.lean)) + 0.002
    end = rolled(ramp, -0.09, ridge + side * beside, 0.55, side)[-1]
    assert end[0] > 0.03 and side * (end[1] - ridge) > 0.02


@pytest.mark.parametrize(("passes", "ends"), [(True, 0.0), (False, 0.1)])
def test_what_may_pass_falls_through_a_barrier_and_everything_else_lands_on_it(passes, ends):
    scene, barrier = table(), Barrier(height=0.1)
    place(scene, barrier, "barrier", [0.0, 0.0, TABLE_TOP], free=False)
    place(scene, Cube(edge=0.04), "cube", [0.0, 0.0, TABLE_TOP + 0.12])
    if passes:
        let_pass(scene.body("cube"))
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 300)
    assert data.body("cube").xpos[2] == pytest.approx(TABLE_TOP + ends, abs=1e-3)


def test_things_that_pass_meet_each_other():
    scene = table()
    for i in range(2):
        place(scene, Cube(edge=0.04), f"cube_{i}", [0.0, 0.0, TABLE_TOP + 0.05 * i])
        let_pass(scene.body(f"cube_{i}"))
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 300)
    assert data.body("cube_1").xpos[2] == pytest.approx(TABLE_TOP + 0.04, abs=1e-3)
