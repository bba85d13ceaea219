"""Shapes weigh what a textbook says, stand where their centre of mass is over what is under them, and not on a cone."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from scengen.assets.prop import TABLE_TOP, place, table
from scengen.assets.shape import (
    BEECH_DENSITY,
    CONE_SLOPE,
    CUBE,
    CYLINDER,
    FRUSTUM,
    HEXAGON,
    KINDS,
    TIP_RADIUS,
    TRIANGLE,
    Shape,
)

FLAT = (CUBE, CYLINDER, HEXAGON, TRIANGLE)
CONE = Shape(kind=FRUSTUM, width=0.042, height=0.041)


def settled(lower, upper, off=0.0, yaw=0.0, seconds=2.0):
    """Some time after the upper shape was set on the lower one, `off` its middle [m] and turned by `yaw` [rad]."""
    scene = table()
    place(scene, lower, "lower", [0, 0, TABLE_TOP])
    place(scene, upper, "upper", [off, 0, TABLE_TOP + lower.height], yaw)
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, round(seconds / model.opt.timestep))
    return data


def left_alone(lower, upper, off=0.0, yaw=0.0):
    """How far the upper shape sinks [m] and leans [rad] in 2 s."""
    data = settled(lower, upper, off, yaw)
    sunk = TABLE_TOP + lower.height - data.body("upper").xpos[2]
    return float(sunk), math.acos(min(1.0, data.body("upper").xmat[8]))


def area(shape):
    w = shape.width
    return {CUBE: w**2, CYLINDER: math.pi * w**2 / 4, HEXAGON: math.sqrt(3) / 2 * w**2, TRIANGLE: w**2 / math.sqrt(3)}[
        shape.kind
    ]


@pytest.mark.parametrize("kind", FLAT, ids=KINDS.__getitem__)
def test_prisms_weigh_density_times_area_times_height(kind):
    shape = Shape(kind=kind)
    assert shape.spec().compile().body("body").mass == pytest.approx(
        BEECH_DENSITY * area(shape) * shape.height, rel=0.01
    )


@pytest.mark.parametrize("height", [0.025, 0.041])
def test_a_frustum_weighs_its_foot_and_its_cone(height):
    frustum = replace(CONE, height=height)
    r, top, low = frustum.width / 2, frustum.top, frustum.collar
    volume = math.pi * r**2 * low + math.pi / 3 * (height - low) * (r**2 + r * top + top**2)
    assert frustum.spec().compile().body("body").mass == pytest.approx(BEECH_DENSITY * volume, rel=0.02)
    assert math.atan2(height - low, r - top) == pytest.approx(CONE_SLOPE)


@pytest.mark.parametrize("upper", [*FLAT, FRUSTUM], ids=KINDS.__getitem__)
@pytest.mark.parametrize("lower", FLAT, ids=KINDS.__getitem__)
def test_every_shape_stands_still_on_every_flat_one(lower, upper):
    sunk, lean = left_alone(Shape(kind=lower), Shape(kind=upper, width=0.05), off=0.003, yaw=0.3)
    assert abs(sunk) < 0.0005 and lean < math.radians(1.0)


@pytest.mark.parametrize("yaw", np.radians([0.0, 30.0, 70.0, 80.0, 90.0, 100.0]))
def test_a_hexagon_does_not_tremble_on_a_triangle_whichever_way_it_is_turned(yaw):
    """With feet wider apart some hang beside the triangle, and it moves by up to 100 mm/s for good."""
    data = settled(Shape(kind=TRIANGLE, width=0.048), Shape(kind=HEXAGON, width=0.052), off=0.002, yaw=yaw)
    assert np.linalg.norm(data.joint("upper_free").qvel) < 0.01


@pytest.mark.parametrize(("beyond", "stands"), [(-0.004, True), (0.001, False)])
@pytest.mark.parametrize("kind", [CUBE, CYLINDER], ids=KINDS.__getitem__)
def test_a_shape_stands_on_a_cube_as_long_as_its_middle_is_over_it(kind, beyond, stands):
    """To 3 mm: one whose feet overhang leans by a degree until the edge under it bears."""
    sunk, _ = left_alone(Shape(), Shape(kind=kind), off=Shape().width / 2 + beyond)
    assert (sunk < 0.005) == stands


@pytest.mark.parametrize(("off", "friction"), [(3 * TIP_RADIUS, 0.7), (0.003, 0.7), (0.009, 0.7), (0.003, 1.0)])
@pytest.mark.parametrize("kind", FLAT, ids=KINDS.__getitem__)
def test_off_its_tip_nothing_rests_on_a_cone_that_is_steeper_than_friction_holds(kind, off, friction):
    assert math.tan(CONE_SLOPE) > 1.0
    upper = Shape(kind=kind, friction=friction)
    assert left_alone(replace(CONE, friction=friction), upper, off=off, yaw=0.2)[1] > math.radians(75.0)


def test_on_a_frustum_with_a_face_something_stands():
    low = replace(CONE, height=0.025)
    assert low.top > 0.003 and not low.pointed and CONE.pointed
    assert left_alone(low, Shape(), off=0.0005)[1] < math.radians(1.0)


@pytest.mark.parametrize("kind", range(len(KINDS)), ids=KINDS.__getitem__)
def test_a_jaw_across_a_side_has_its_middle_half_way_through_the_shape(kind):
    shape = Shape(kind=kind)
    along = shape.corners[:, 0]
    assert np.mean([along.min(), along.max()]) == pytest.approx(shape.between, abs=1e-9)
    assert along.max() - along.min() == pytest.approx(shape.width, rel=0.01)
