"""What is as thick as the gap fits, what is thicker does not, and the mouth leads in what comes down beside it."""

import math

import mujoco
import pytest
from helpers import anywhere
from hypothesis import given, settings

from scengen.assets.box import Cube
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.assets.slot_shelf import SlotShelf

EPS = 1e-4


def contacts(shelf, thickness, x=0.0, z=None):
    """Contacts of a board of the slot's height and half its length, in the slot or with its lower edge at `z` [m]."""
    scene = table()
    place(scene, shelf, "shelf", [0.0, 0.0, TABLE_TOP], free=False)
    low = shelf.base + EPS if z is None else z
    board = scene.worldbody.add_body(name="board", pos=[x, 0.0, TABLE_TOP + low + shelf.height / 2])
    board.add_freejoint()
    half = [thickness / 2, shelf.length / 4, shelf.height / 2]
    board.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half)
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    shelf_body, board_body = model.body("shelf").id, model.body("board").id
    pairs = [set(map(int, model.geom_bodyid[geoms])) for geoms in data.contact.geom[data.contact.dist <= 0]]
    return sum(pair == {shelf_body, board_body} for pair in pairs)


@settings(deadline=None, max_examples=20)
@given(shelf=anywhere(SlotShelf).filter(lambda s: s.chamfer < 0.8 * s.height))
def test_a_board_as_thick_as_the_gap_fits_and_a_thicker_one_does_not(shelf):
    assert contacts(shelf, shelf.gap - 2 * EPS) == 0
    assert contacts(shelf, shelf.gap + 2 * EPS) > 0


@pytest.mark.parametrize(("aside", "touches"), [(0.9, False), (1.1, True)])
def test_the_mouth_is_wider_by_the_chamfer_on_each_side(aside, touches):
    shelf = SlotShelf(chamfer=0.010)
    at_the_top = shelf.top - EPS
    assert bool(contacts(shelf, shelf.gap - 2 * EPS, x=aside * shelf.chamfer, z=at_the_top)) == touches


def test_without_a_chamfer_the_mouth_is_the_gap():
    assert contacts(SlotShelf(chamfer=0.0), SlotShelf().gap - 2 * EPS, x=0.001, z=SlotShelf().top - EPS) > 0


@pytest.mark.parametrize(("beyond", "slides"), [(-0.03, False), (0.03, True)])
def test_a_rough_thing_slides_at_the_angle_of_the_shelfs_own_friction(beyond, slides):
    shelf, cube = SlotShelf(gap=0.08, friction=0.2), Cube(edge=0.03, friction=1.0)
    scene, slope = table(), math.atan(shelf.friction) + beyond
    place(scene, shelf, "shelf", [0.0, 0.0, TABLE_TOP], free=False)
    place(scene, cube, "cube", [0.0, 0.0, TABLE_TOP + shelf.base])
    scene.option.gravity = [0.0, 9.81 * math.sin(slope), -9.81 * math.cos(slope)]
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 500)
    assert (data.body("cube").xpos[1] > 0.01) == slides
