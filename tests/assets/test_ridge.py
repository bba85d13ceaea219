"""What lies across a ridge stays if its centre of mass is over the top, and rocks back if it is not pushed too hard."""

import math

import mujoco
import pytest

from scengen.assets.prop import TABLE_TOP, place, table
from scengen.assets.ridge import Ridge
from scengen.assets.rod import Rod


def tilt_after(ridge, rod, off, spin=0.0, turned=0.0, timestep=0.002):
    """Tilt after 2 s of a rod whose centre of mass starts `off` the middle of the ridge [m].

    `spin` is about the ridge's edge [rad/s], `turned` the angle between the ridge and the square to the rod [rad].
    """
    scene = table()
    scene.option.timestep = timestep
    place(scene, ridge, "stand", [0, 0, TABLE_TOP], turned, free=False)
    place(scene, rod, "rod", [0, off - rod.com, TABLE_TOP + ridge.height])
    model = scene.compile()
    data = mujoco.MjData(model)
    data.qvel[2], data.qvel[3] = spin * (ridge.width / 2 - rod.com), spin  # about the edge of the ridge
    mujoco.mj_step(model, data, round(2.0 / timestep))
    return math.acos(min(1.0, data.body("rod").xmat[8]))


@pytest.mark.parametrize(("beyond", "stays"), [(-0.0005, True), (0.0005, False)])
@pytest.mark.parametrize("turned", [0.0, 25.0])
@pytest.mark.parametrize("width", [0.012, 0.008])
def test_a_rod_stays_if_its_centre_of_mass_is_over_the_ridge(width, turned, beyond, stays):
    """The edge crosses the rod's axis at width / 2, divided by the cosine of the angle at which they cross."""
    ridge, angle = Ridge(width=width), math.radians(turned)
    for side in (-1, 1):
        off = side * (width / 2 / math.cos(angle) + beyond)
        tilt = tilt_after(ridge, Rod(com=side * 0.06), off, turned=angle)
        assert (tilt < math.radians(1.0)) == stays, math.degrees(tilt)


def test_at_rest_on_the_narrowest_ridge_it_stays_at_half_the_time_step_too():
    for timestep in (0.002, 0.001):
        assert tilt_after(Ridge(width=0.008), Rod(com=0.06), 0.0, timestep=timestep) < math.radians(0.2)


@pytest.mark.parametrize(("factor", "stays"), [(0.95, True), (1.05, False)])
@pytest.mark.parametrize("width", [0.012, 0.008])
def test_it_rocks_back_if_its_spin_does_not_lift_the_centre_of_mass_over_the_edge(width, factor, stays):
    """Energy about the edge: 1/2 I w^2 = m g (r - h), with r from the edge to the centre of mass, h its height.

    Over a ridge so high that no end strikes the table before.
    """
    rod, half = Rod(), width / 2
    up = rod.width / 2
    rise, inertia = math.hypot(half, up) - up, rod.inertia[0] + rod.mass * (half**2 + up**2)
    spin = math.sqrt(2 * rod.mass * 9.81 * rise / inertia)
    tilt = tilt_after(Ridge(width=width, height=0.15), rod, 0.0, factor * spin)
    assert (tilt < math.atan(half / up)) == stays
