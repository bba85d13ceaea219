"""A board weighs what it should where it should, and falls off an edge when its centre of mass has passed it."""

import math

import mujoco
import pytest
from helpers import anywhere
from hypothesis import given, settings

from scengen.assets.board import STRIP_COLOUR, Board
from scengen.assets.prop import TABLE_HALF, TABLE_TOP, place, table
from scengen.physics import GRAVITY


def lying(board, overhang):
    """A board whose strip stands out over the table's left edge by `overhang` [m]."""
    scene = table()
    place(scene, board, "board", [0.0, TABLE_HALF - board.width / 2 + overhang, TABLE_TOP])
    model = scene.compile()
    return model, mujoco.MjData(model)


@given(board=anywhere(Board))
@settings(max_examples=40, deadline=None)
def test_its_centre_of_mass_is_where_it_is_said_to_be(board):
    body = board.spec().compile().body("body")
    assert body.mass == pytest.approx(board.mass)
    assert body.ipos == pytest.approx([0.0, board.off_centre, board.thickness / 2])


@pytest.mark.parametrize("off_centre", [0.0, 0.010, 0.020])
@pytest.mark.parametrize(("past", "falls"), [(-0.001, False), (0.001, True)])
def test_it_falls_when_its_centre_of_mass_has_left_the_table_and_not_before(off_centre, past, falls):
    board = Board(off_centre=off_centre)
    model, data = lying(board, board.width / 2 - off_centre + past)
    mujoco.mj_step(model, data, 750)
    assert (data.body("board").xipos[2] < TABLE_TOP - 0.05) == falls


@pytest.mark.parametrize("thickness", [0.002, 0.005, 0.012])
def test_a_thin_one_lies_still_with_a_third_of_it_over_the_edge(thickness):
    model, data = lying(Board(thickness=thickness), 0.05)
    mujoco.mj_forward(model, data)
    start = data.body("board").xpos.copy()
    mujoco.mj_step(model, data, 1000)
    assert math.dist(start, data.body("board").xpos) < 1e-4


@pytest.mark.parametrize("friction", [0.1, 0.35, 0.8])
def test_let_go_it_coasts_as_far_as_its_friction_says(friction):
    """v^2 / (2 mu g), with its own friction although the table has another one."""
    model, data = lying(Board(friction=friction), -0.3)
    mujoco.mj_step(model, data, 100)
    start, speed = data.qpos[1], 0.3
    data.qvel[1] = speed
    mujoco.mj_step(model, data, 500)
    assert data.qpos[1] - start == pytest.approx(speed**2 / (2 * friction * GRAVITY), rel=0.05)


def test_only_a_heavier_strip_shows():
    plain, loaded = (Board(off_centre=off).spec().compile() for off in (0.0, 0.01))
    assert plain.geom("strip").rgba == pytest.approx(plain.geom("board").rgba)
    assert loaded.geom("strip").rgba == pytest.approx(STRIP_COLOUR, abs=1e-6)
