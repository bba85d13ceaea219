"""What is as large as a storey fits, what is larger does not, there is one way in, and things slide at their angle."""

import math

import mujoco
import numpy as np
import pytest
from helpers import anywhere
from hypothesis import given, settings

from scengen.assets.box import Cube
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.assets.rack import STOREYS, TierRack
from scengen.geometry import UP

EPS = 1e-4


def contacts(rack, half, middle):
    """Contacts of a box with the rack, given half its size and its middle in the rack's axes [m]."""
    scene = table()
    place(scene, rack, "rack", [0.0, 0.0, TABLE_TOP], free=False)
    box = scene.worldbody.add_body(name="box", pos=middle + TABLE_TOP * UP)
    box.add_freejoint()
    box.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half)
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rack_body, box_body = model.body("rack").id, model.body("box").id
    pairs = [set(map(int, model.geom_bodyid[geoms])) for geoms in data.contact.geom[data.contact.dist <= 0]]
    return sum(pair == {rack_body, box_body} for pair in pairs)


def filling(rack, storey, over=0.0):
    """Half the size and the middle of a box that fills a storey but for 0.1 mm, and is too large by `over` [m]."""
    half = np.array([rack.width, rack.depth, rack.height]) / 2 - EPS + over / 2
    return half, rack.inside(storey, 0.0, rack.depth / 2) + rack.height / 2 * UP


@settings(deadline=None, max_examples=15)
@given(rack=anywhere(TierRack))
def test_a_box_as_large_as_a_storey_fits_and_a_larger_one_does_not(rack):
    for storey in range(STOREYS):
        assert contacts(rack, *filling(rack, storey)) == 0
        assert contacts(rack, *filling(rack, storey, over=4 * EPS)) > 0


@pytest.mark.parametrize("way", [(0, 1, 0), (1, 0, 0), (-1, 0, 0), (0, 0, 1), (0, 0, -1)])
@pytest.mark.parametrize("storey", range(STOREYS))
def test_a_thing_in_a_storey_comes_out_one_way_only(storey, way):
    """Along the way to each side a small box meets a board, and none on the way to the open side."""
    rack, half = TierRack(), [0.01] * 3
    start = rack.inside(storey, 0.03, rack.depth / 2) + rack.height / 2 * UP
    steps = np.arange(0.0, 0.4, 0.004)[:, None]
    assert any(contacts(rack, half, at) for at in start + steps * way)
    out = start + steps * [0, -1, 0]
    assert not any(contacts(rack, half, at) for at in out)
    assert any(contacts(TierRack(closed=True), half, at) for at in out)


def test_places_are_told_from_the_open_side():
    rack = TierRack()
    assert rack.inside(0, 0.1, 0.0) == pytest.approx([0.1, -rack.outer[1] / 2, rack.floor(0)])
    assert rack.floor(1) - rack.floor(0) == pytest.approx(rack.height + rack.board)
    assert rack.top == pytest.approx(rack.plinth + 3 * rack.board + 2 * rack.height)


@pytest.mark.parametrize(("beyond", "slides"), [(-0.03, False), (0.03, True)])
def test_a_cube_slides_out_at_the_angle_whose_tangent_is_the_friction(beyond, slides):
    rack, cube = TierRack(friction=0.2), Cube(friction=0.2)
    scene, slope = table(), math.atan(0.2) + beyond
    place(scene, rack, "rack", [0.0, 0.0, TABLE_TOP], free=False)
    place(scene, cube, "cube", rack.inside(1, 0.0, 0.1) + TABLE_TOP * UP)
    scene.option.gravity = [0.0, -9.81 * math.sin(slope), -9.81 * math.cos(slope)]
    model = scene.compile()
    data = mujoco.MjData(model)
    start = rack.inside(1, 0.0, 0.1)[1]
    mujoco.mj_step(model, data, 500)
    assert (start - data.body("cube").xpos[1] > 0.01) == slides
