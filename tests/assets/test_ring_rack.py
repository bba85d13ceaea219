"""What is as wide as the ring fits, what is wider does not, and a ball leaves over it as a wheel climbs a kerb."""

import math

import mujoco
import pytest
from helpers import anywhere
from hypothesis import given, settings

from scengen.assets.prop import TABLE_TOP, place, table
from scengen.assets.ring_rack import RingRack

EPS = 1e-4


def with_body(rack, geom, size, pos):
    """Model and data of a rack on the table and a free body with one geom, at a place above its foot [m]."""
    scene = table()
    place(scene, rack, "rack", [0.0, 0.0, TABLE_TOP], free=False)
    body = scene.worldbody.add_body(name="body", pos=[pos[0], pos[1], TABLE_TOP + pos[2]])
    body.add_freejoint()
    body.add_geom(type=geom, size=size, mass=0.1)
    model = scene.compile()
    return model, mujoco.MjData(model)


@settings(deadline=None, max_examples=15)
@given(rack=anywhere(RingRack))
def test_a_disc_as_wide_as_the_ring_fits_and_a_wider_one_does_not(rack):
    for over, fits in ((-2 * EPS, True), (2 * EPS, False)):
        half = rack.height / 2 - EPS
        size, pos = [rack.radius + over, half, 0.0], [0.0, 0.0, rack.plinth + rack.height / 2]
        model, data = with_body(rack, mujoco.mjtGeom.mjGEOM_CYLINDER, size, pos)
        mujoco.mj_forward(model, data)
        assert bool((data.contact.dist <= 0).sum() == 0) == fits


@pytest.mark.parametrize(("beyond", "leaves"), [(-0.04, False), (0.04, True)])
def test_a_ball_climbs_the_ring_at_the_slope_at_which_a_wheel_climbs_a_kerb(beyond, leaves):
    """cos(slope) = 1 - height / radius: then the line of its weight passes over the edge."""
    rack, radius = RingRack(height=0.020), 0.060
    slope = math.acos(1.0 - rack.height / radius) + beyond
    # touches the edge of the board across x already, and the floor
    at = [rack.radius - math.sqrt(radius**2 - (radius - rack.height) ** 2), 0.0, rack.plinth + radius]
    model, data = with_body(rack, mujoco.mjtGeom.mjGEOM_SPHERE, [radius, 0.0, 0.0], at)
    model.opt.gravity[:] = [9.81 * math.sin(slope), 0.0, -9.81 * math.cos(slope)]
    mujoco.mj_step(model, data, 400)
    assert (data.body("body").xpos[0] > rack.radius) == leaves


def test_nothing_stands_out_beyond_the_outer_radius():
    rack = RingRack()
    assert rack.top == pytest.approx(rack.plinth + rack.height)
    model, data = with_body(rack, mujoco.mjtGeom.mjGEOM_SPHERE, [0.001, 0.0, 0.0], [0.0, 0.0, 0.5])
    mujoco.mj_forward(model, data)
    ring = [i for i in range(model.ngeom) if model.geom(i).name.startswith("rack/ring_")]
    reach = [math.hypot(*data.geom_xpos[i][:2]) + rack.board / 2 for i in ring]
    assert max(reach) <= rack.outer
