"""What passes is no wider than the strip between two edges; the servo turns and gives way as its law says."""

import math

import mujoco
import numpy as np
import pytest
from helpers import anywhere
from hypothesis import given, settings

from scengen.assets.peg import Peg
from scengen.assets.prop import TABLE_TOP, place, servo, table
from scengen.assets.slot_board import ARMATURE, DAMPING, SIDE_THICKNESS, STIFFNESS, SlotBoard

EPS = math.radians(0.1)


def scene_of(board):
    scene = table()
    place(scene, board, "board", [0.0, 0.0, TABLE_TOP], free=False)
    return scene


def contacts(board, width, yaw=0.0, length=0.30, x=None, aside=0.0):
    """Contacts of a level bar with the board, its middle between the windows or at `x` behind the mouth [m]."""
    scene = scene_of(board)
    depth = (board.depth + board.chamfer) / 2 if x is None else x  # between the edges that it can touch
    bar = scene.worldbody.add_body(name="bar", pos=[depth - board.pivot, aside, TABLE_TOP + board.centre])
    bar.quat = [math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)]
    bar.add_freejoint()
    bar.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[length / 2, width / 2, width / 2])
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pairs = [set(map(int, model.geom_bodyid[geoms])) for geoms in data.contact.geom[data.contact.dist <= 0]]
    return sum(pair == {model.body("board").id, model.body("bar").id} for pair in pairs)


def is_open(board):
    """Whether only the windows bound the slot: walls remain beside it, and the sides of the board stand clear of it."""
    sides = board.width / 2 - SIDE_THICKNESS
    return board.slot / 2 + board.chamfer < board.width / 2 - 0.002 and board.slot / 2 < sides and board.depth > 0.03


@settings(deadline=None, max_examples=15)
@given(board=anywhere(SlotBoard).filter(is_open))
def test_a_bar_of_the_slots_width_passes_and_a_thicker_one_does_not(board):
    assert contacts(board, board.slot - 2e-4) == 0
    assert contacts(board, board.slot + 2e-4) > 0


@pytest.mark.parametrize("width", [0.020, 0.024, 0.027])
@pytest.mark.parametrize("depth", [0.05, 0.07])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_bar_passes_up_to_the_angle_of_a_strip_between_two_edges(width, depth, side):
    board = SlotBoard(depth=depth, width=0.20)
    steepest = board.steepest(width)
    assert board.slot * math.cos(steepest) - (depth - board.chamfer) * math.sin(steepest) == pytest.approx(width)
    assert contacts(board, width, side * (steepest - EPS)) == 0
    assert contacts(board, width, side * (steepest + EPS)) > 0


def test_what_is_wider_than_the_slot_passes_at_no_angle():
    assert SlotBoard(slot=0.02).steepest(0.024) == SlotBoard(slot=0.024).steepest(0.024) == 0.0


@pytest.mark.parametrize(("aside", "touches"), [(0.9, False), (1.1, True)])
def test_the_mouth_is_wider_by_the_chamfer_on_each_side(aside, touches):
    board = SlotBoard(chamfer=0.004)
    found = contacts(board, board.slot - 2e-4, length=0.10, x=-0.05 + 1e-4, aside=aside * board.chamfer)
    assert bool(found) == touches


def test_without_slot_nothing_passes():
    assert contacts(SlotBoard(plugged=True), 0.01) > 0


# --- the turn -----------------------------------------------------------------------------


def turning(goal, torque=0.0, seconds=0.5):
    """Angles of the hinge after the servo is sent to `goal` [rad], every 2 ms, and its inertia [kg m^2]."""
    scene = scene_of(SlotBoard())
    servo(scene, "board/hinge", STIFFNESS)
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    (inertia,) = data.M  # of a scene with one joint
    data.ctrl[0], angles = goal, []
    data.qfrc_applied[0] = torque
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        angles.append(float(data.qpos[0]))
    return np.array(angles), float(inertia)


def test_the_turn_is_that_of_a_damped_spring():
    goal, dt = math.radians(10.0), 0.002
    angles, inertia = turning(goal)
    assert ARMATURE < inertia < 2 * ARMATURE
    decay, root = DAMPING / (2 * inertia), np.emath.sqrt((DAMPING / (2 * inertia)) ** 2 - STIFFNESS / inertia)
    t = dt * np.arange(1, len(angles) + 1)
    law = goal * (1 - np.exp(-decay * t) * (np.cosh(root * t) + decay / root * np.sinh(root * t)).real)
    assert np.abs(angles - law).max() < 0.03 * goal
    assert np.abs(angles[round(0.2 / dt) :] - goal).max() < 0.02 * goal


@pytest.mark.parametrize("torque", [1.5, -0.5])
def test_it_gives_way_as_a_spring_does(torque):
    angles, _ = turning(math.radians(10.0), torque)
    assert angles[-1] - math.radians(10.0) == pytest.approx(torque / STIFFNESS, rel=0.01)


def test_a_peg_tips_at_the_angle_of_its_diagonal():
    peg = Peg(width=0.024, length=0.120)
    assert math.degrees(peg.tipping_angle) == pytest.approx(11.31, abs=0.01)
    for beyond, falls in ((-0.02, False), (0.02, True)):
        scene, tilt = table(), peg.tipping_angle + beyond
        place(scene, peg, "peg", [0.0, 0.0, TABLE_TOP])
        scene.option.gravity = [9.81 * math.sin(tilt), 0.0, -9.81 * math.cos(tilt)]
        scene.geom("table_top").friction[0] = 1.0
        model = scene.compile()
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, 500)
        assert (data.body("peg").xmat[8] < 0.5) == falls
