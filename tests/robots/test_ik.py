"""Inverse kinematics agrees with forward kinematics, and what is claimed to be out of reach is out of reach."""

import functools

import mujoco
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from scengen import load_task
from scengen.geometry import UP, about_y, about_z, between
from scengen.robots import ik, panda
from scengen.skills.motion import facing_down
from scengen.tasks.tool_retrieve import MAX_DISTANCE, ToolRetrieve

NAMES = panda.Names()
LIMITS = [(-2.8973, 2.8973), (-1.7628, 1.7628), (-2.8973, 2.8973), (-3.0718, -0.0698)]
LIMITS += [(-2.8973, 2.8973), (-0.0175, 3.7525), (-2.8973, 2.8973)]
"""Franka Emika, limits of the Panda's joints [rad]."""
POSTURES = st.tuples(*(st.floats(low + 0.02, high - 0.02) for low, high in LIMITS)).map(np.array)


@functools.cache
def robot():
    """The robot alone, with the names of nothing but its own files."""
    spec = mujoco.MjSpec()
    panda.attach(spec)
    model = spec.compile()
    return model, mujoco.MjData(model)


def posed(angles, opening=0.0):
    """The model and data of the robot in a posture, each finger `opening` [m] from the middle."""
    model, data = robot()
    for name, angle in zip(NAMES.joints, angles, strict=True):
        data.joint(name).qpos = angle
    data.qpos[panda.fingers(model, NAMES)] = opening, -opening
    mujoco.mj_kinematics(model, data)
    return model, data


def grip_site(angles):
    site = posed(angles)[1].site(NAMES.grip_site)
    return site.xpos.copy(), site.xmat.reshape(3, 3).copy()


def farthest_of_gripper(angles):
    """Largest distance of a corner of link 7, hand or open fingers from the shoulder [m]."""
    model, data = posed(angles, 0.04)
    farthest, links = 0.0, {f"{NAMES.arm}link7"}
    for body in range(model.nbody):
        if model.body(body).name not in links and model.body(model.body_parentid[body]).name not in links:
            continue
        links.add(model.body(body).name)
        for g in np.flatnonzero(model.geom_bodyid == body):
            if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH:
                mesh = model.geom_dataid[g]
                corners = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
            else:
                corners = model.geom_size[g] * np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
            points = corners @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g]
            farthest = max(farthest, float(np.linalg.norm(points - panda.SHOULDER, axis=1).max()))
    return farthest


# --- inverse against forward kinematics -------------------------------------------------


@given(angles=POSTURES)
@settings(max_examples=30, deadline=None)
def test_every_place_to_which_a_posture_leads_is_found_again(angles):
    place, _ = grip_site(angles)
    nearest = ik.reach(place)
    assert nearest.residual < 1e-4
    assert grip_site(nearest.angles)[0] == pytest.approx(place, abs=2e-4)


@given(angles=POSTURES, target=st.tuples(st.floats(-0.6, 0.6), st.floats(-0.8, 0.8), st.floats(0.5, 2.0)))
@settings(max_examples=8, deadline=None)
def test_residual_and_turn_are_those_of_the_posture_that_is_returned_and_it_keeps_the_limits(angles, target):
    _, rot = grip_site(angles)
    nearest = ik.reach(target, rot)
    place, here = grip_site(nearest.angles)
    assert np.linalg.norm(place - target) == pytest.approx(nearest.residual, abs=1e-9)
    assert np.linalg.norm(between(here, rot)) == pytest.approx(nearest.turn, abs=1e-6)
    low, high = np.transpose(LIMITS)
    assert (low <= nearest.angles).all() and (nearest.angles <= high).all()


@pytest.mark.parametrize(("away", "reached"), [(MAX_DISTANCE, True), (0.76, True), (0.80, False)])
def test_a_hand_that_points_down_reaches_760_mm_and_not_800_mm(away, reached):
    place = panda.BASE + np.array([away, 0, -0.092])
    nearest = ik.reach(place, facing_down())
    assert (nearest.residual < 0.002 and nearest.turn < 0.02) == reached


# --- out of reach -----------------------------------------------------------------------


@given(angles=POSTURES)
@settings(max_examples=150, deadline=None)
def test_no_posture_leads_the_grip_site_or_the_gripper_beyond_its_bound(angles):
    assert ik.shortfall(grip_site(angles)[0]) < 0
    assert farthest_of_gripper(angles) < ik.GRIPPER_REACH


def test_the_bounds_are_not_idle():
    """A stretched arm comes within 4 cm of what they allow."""
    farthest = panda.SHOULDER + np.array([2.0, 0.0, 0.0])
    stretched = ik.reach(farthest)
    assert -0.04 < ik.shortfall(grip_site(stretched.angles)[0]) < 0
    assert ik.GRIPPER_REACH - 0.04 < farthest_of_gripper(stretched.angles) < ik.GRIPPER_REACH


@given(direction=st.tuples(*[st.floats(-1, 1)] * 3), away=st.floats(0.0, 0.5))
@settings(max_examples=4, deadline=None)
def test_the_search_never_comes_nearer_than_the_bound(direction, away):
    assume(np.linalg.norm(direction) > 0.1)
    target = panda.SHOULDER + (panda.REACH + away) * np.array(direction) / np.linalg.norm(direction)
    assert ik.shortfall(target) == pytest.approx(away)
    assert ik.reach(target).residual >= away


@given(
    half=st.tuples(*[st.floats(0.01, 0.2)] * 3),
    centre=st.tuples(*[st.floats(-0.8, 0.8)] * 3),
    yaw=st.floats(-3.0, 3.0),
    tilt=st.floats(-3.0, 3.0),
)
@settings(max_examples=50, deadline=None)
def test_a_box_is_missed_by_as_much_as_the_nearest_of_its_points(half, centre, yaw, tilt):
    """The grid misses the nearest point by at most half the diagonal of a cell."""
    middle, rot = panda.SHOULDER + np.array(centre), about_z(yaw) @ about_y(tilt)
    grid = np.array(np.meshgrid(*[np.linspace(-1, 1, 11)] * 3)).reshape(3, -1).T * half
    nearest = min(float(np.linalg.norm(middle + rot @ point - panda.SHOULDER)) for point in grid) - ik.GRIPPER_REACH
    assert nearest - 0.1 * float(np.linalg.norm(half)) - 1e-9 <= ik.box_shortfall(middle, rot, half, ik.GRIPPER_REACH)
    assert ik.box_shortfall(middle, rot, half, ik.GRIPPER_REACH) <= nearest + 1e-9


@pytest.mark.parametrize("half", [0.03, (0.03, 0.03, 0.03)])
def test_a_box_in_front_of_the_shoulder_is_missed_by_its_near_face(half):
    centre = panda.SHOULDER + np.array([panda.REACH + 0.1, 0.01, -0.02])
    near = panda.SHOULDER + np.array([panda.REACH + 0.07, 0.0, 0.0])
    assert ik.box_shortfall(centre, np.eye(3), half) == pytest.approx(ik.shortfall(near)) == pytest.approx(0.07)


@pytest.mark.parametrize("split", ["id", "far_corner"])  # the others have the cubes of id
def test_no_cube_that_is_drawn_can_be_touched_without_the_hook(split):
    """Two proofs that share nothing but the robot: the bound, and a search from eight postures."""
    for index in range(2):
        scenario = load_task("tool_retrieve").draw(split, 0, index).scenario
        middle = scenario.spot + scenario.half * UP
        assert scenario.out_of_touch > 0
        assert ik.reach(middle).residual > max(0.07, ik.shortfall(middle))


def test_a_cube_that_the_arm_can_grasp_is_refuted_for_that():
    scenario = ToolRetrieve(distance=0.75)
    assert scenario.infeasible().reason == "the arm may touch the cube without the hook"
    assert ik.reach(scenario.spot + scenario.half * UP, facing_down()).residual < 0.001
