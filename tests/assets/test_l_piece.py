"""L-pieces have the area, mass and balance of an L, and a bin takes what fits and nothing else."""

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scengen.assets.bin import Bin
from scengen.assets.l_piece import LPiece
from scengen.assets.prop import TABLE_TOP, place, solid, table
from scengen.geometry import UP

DENSITY, GREY = 600.0, (0.5, 0.5, 0.5, 1.0)
EDGE = 0.1
"""Height of the block on whose edge a piece is balanced [m]."""


@st.composite
def pieces(draw):
    """Any L with arms that end."""
    width, length = draw(st.floats(0.05, 0.2)), draw(st.floats(0.05, 0.2))
    upright, lying = (draw(st.floats(0.2, 0.8)) * side for side in (width, length))
    return LPiece.of((width, length, upright, lying), 0.02, DENSITY, GREY)


def after(scene, seconds):
    """The state of a scene after some time [s]."""
    model = scene.compile()
    data = mujoco.MjData(model)
    while data.time < seconds:
        mujoco.mj_step(model, data)
    return data


@given(pieces())
@settings(deadline=None, max_examples=30)
def test_mass_and_balance_are_those_of_a_rectangle_less_its_corner(piece):
    corner = (piece.width - piece.upright) * (piece.length - piece.lying)
    area = piece.width * piece.length - corner
    share = corner / area
    balance = -share * piece.upright / 2, -share * piece.lying / 2
    model = piece.spec().compile()
    assert piece.area == pytest.approx(area)
    assert piece.mass == pytest.approx(DENSITY * area * piece.thickness)
    assert piece.centroid == pytest.approx(balance)
    assert model.body("body").mass[0] == pytest.approx(piece.mass)
    assert model.body("body").ipos == pytest.approx([*balance, (piece.thickness + piece.rounding) / 2], abs=1e-6)


@given(pieces(), st.floats(0.005, 0.0135))
@settings(deadline=None, max_examples=30)
def test_a_cup_is_put_on_the_face_and_as_near_to_the_balance_as_that_allows(piece, cup):
    fits = 2 * cup <= min(piece.upright, piece.lying)
    if not fits and 2 * cup > max(piece.upright, piece.lying):
        with pytest.raises(ValueError, match="give a smaller cup"):
            piece.hold(cup)
        return
    x, y = piece.hold(cup)
    right, upper = piece.width / 2, piece.length / 2
    below, beside = piece.lying - upper, piece.upright - right
    assert cup - right - 1e-9 <= x <= right - cup + 1e-9
    assert cup - upper - 1e-9 <= y <= upper - cup + 1e-9
    assert x + cup <= beside + 1e-9 or y + cup <= below + 1e-9


@pytest.mark.parametrize("beyond", [-0.002, 0.002])
def test_a_piece_tips_off_an_edge_once_its_centre_of_mass_is_beyond(beyond):
    """For arms of half the length it lies a twelfth of the length from the middle: 6.67 mm of 80 mm."""
    piece = LPiece(width=0.08, length=0.08, upright=0.04, lying=0.04)
    assert piece.centroid[0] == pytest.approx(-0.08 / 12)
    scene = table()
    block = scene.worldbody.add_body(name="block", pos=[-0.1, 0, TABLE_TOP + EDGE / 2])
    block.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, EDGE / 2])
    place(scene, piece, "piece", [0.08 / 12 + beyond, 0, TABLE_TOP + EDGE])
    data = after(scene, 1.0)
    assert (data.body("piece").xpos[2] < TABLE_TOP + EDGE - 0.02) == (beyond > 0)


@pytest.mark.parametrize(("overlap", "enters"), [(0.3, True), (1.1, False)])
def test_the_round_edge_guides_a_piece_into_a_bin_that_it_overlaps_by_less_than_the_radius(overlap, enters):
    scene, piece, room = table(), LPiece(width=0.08, length=0.08, friction=0.2), 0.002
    tray = Bin(width=0.08 + 2 * room, length=0.08 + 2 * room)
    place(scene, tray, "bin", [0, 0, TABLE_TOP], free=False)
    off = room + overlap * piece.rounding
    place(scene, piece, "piece", [off, 0, TABLE_TOP + tray.floor + tray.depth + 0.001])
    data = after(scene, 1.0)
    assert (data.body("piece").xpos[2] < TABLE_TOP + tray.floor + 0.001) == enters


@given(pieces())
@settings(deadline=None, max_examples=10)
def test_a_piece_lies_flat_on_its_five_outer_corners_and_its_foot_is_as_large_as_its_face(piece):
    r, ends = piece.rounding, [end for edge in piece.edges for end in edge]
    low, high = np.min(ends, axis=0) - r, np.max(ends, axis=0) + r
    assert np.allclose([*low, *high], np.array([-piece.width, -piece.length, piece.width, piece.length]) / 2)
    scene = table()
    place(scene, piece, "piece", [0, 0, TABLE_TOP])
    data = after(scene, 0.3)
    assert data.ncon == 5
    assert data.body("piece").xpos[2] == pytest.approx(TABLE_TOP, abs=1e-4)
    assert data.body("piece").xmat[8] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(("factor", "slides"), [(0.93, False), (1.07, True)])
def test_a_piece_slides_on_the_floor_of_a_bin_beyond_the_arc_tangent_of_its_friction(factor, slides):
    scene, slope = table(), factor * math.atan(0.4)
    place(scene, Bin(width=0.3, length=0.3), "bin", [0, 0, TABLE_TOP], free=False)
    place(scene, LPiece(friction=0.4), "piece", [0, 0, TABLE_TOP + Bin().floor])
    scene.option.gravity = 9.81 * np.array([math.sin(slope), 0.0, -math.cos(slope)])
    data = after(scene, 0.8)
    assert (data.body("piece").xpos[0] > 0.02) == slides


@pytest.mark.parametrize(("room", "fits"), [(0.0002, True), (-0.0004, False)])
def test_a_plate_of_a_bins_inner_size_falls_to_its_floor_if_it_is_a_fifth_of_a_millimetre_smaller(room, fits):
    scene, tray = table(), Bin()
    place(scene, tray, "bin", [0, 0, TABLE_TOP], free=False)
    plate = scene.worldbody.add_body(name="plate", pos=[0, 0, TABLE_TOP + tray.floor + tray.depth + 0.012])
    plate.add_freejoint()
    size = [(tray.width - room) / 2, (tray.length - room) / 2, 0.01]
    solid(plate, "plate", size, mass=0.2, friction=0.0, condim=3)
    bottom = after(scene, 1.0).body("plate").xpos[2] - 0.01 - TABLE_TOP
    assert bottom == pytest.approx(tray.floor if fits else tray.floor + tray.depth, abs=0.0005)


def test_a_ray_finds_the_floor_inside_and_the_rim_around():
    tray = Bin()
    model = tray.spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)

    def height(x, y):
        below = mujoco.mj_ray(model, data, np.array([x, y, 1.0]), -UP, None, 1, -1, np.zeros(1, np.int32))
        return 1.0 - below if below >= 0 else 0.0

    inside, outside = 0.5 * np.array([tray.width, tray.length]), tray.wall
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        edge = np.array([x, y]) * inside
        assert height(*(edge * 0.999)) == pytest.approx(tray.floor)
        assert height(*(edge + np.array([x, y]) * outside / 2)) == pytest.approx(tray.floor + tray.depth)
        assert height(*(edge + np.array([x, y]) * outside * 1.01)) == 0.0
