"""Hooks balance and swing as their drawings say, pass pegs by the nominal circle, and hold what they reach past."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from helpers import anywhere
from hypothesis import example, given, settings
from hypothesis import strategies as st

from scengen.assets.box import Cube
from scengen.assets.hook import BARBED_J, ROUND_J, JHook, LHook, THook
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.physics import GRAVITY


def hung(hook):
    """A hook that turns without friction about a pin at the end of its handle; x points down."""
    scene = mujoco.MjSpec()
    scene.option.gravity, scene.option.timestep = [GRAVITY, 0, 0], 0.0005
    body = scene.worldbody.add_frame().attach_body(hook.spec().body("body"), "hook/", "")
    body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1], pos=[-hook.length / 2, 0, 0])
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def drawn(hook):
    """Mass, centre [m] and moment of inertia about it [kg m^2] of a hook without overlaps: rectangles and arcs."""
    w, s = hook.width, getattr(hook, "side", 0.0)
    if isinstance(hook, LHook):
        parts = [(hook.length, w, 0, 0), (w, hook.tip, hook.length / 2 - w / 2, s * (w + hook.tip) / 2)]
    else:
        parts = [(hook.length - w, w, -w / 2, 0), (w, w + 2 * hook.tip, hook.length / 2 - w / 2, 0)]
    area = sum(a * b for a, b, *_ in parts)
    centre = sum(a * b * np.array([x, y]) for a, b, x, y in parts) / area
    inertia = sum(a * b * ((a**2 + b**2) / 12 + (x - centre[0]) ** 2 + (y - centre[1]) ** 2) for a, b, x, y in parts)
    return centre, hook.mass / area * inertia


@given(hook=st.one_of(anywhere(LHook), anywhere(THook)))
@settings(max_examples=15, deadline=None)
def test_a_hook_hung_by_its_handle_swings_as_a_physical_pendulum(hook):
    """It rests with its centre of mass below the pin, and T = 2 pi root(I / m g d)."""
    centre, inertia = drawn(hook)
    arm = centre + np.array([hook.length / 2, 0])
    model, data = hung(hook)
    rest, swing = -math.atan2(arm[1], arm[0]), math.radians(2.0)
    data.qpos[0] = rest + swing
    crossings = []
    while len(crossings) < 3:
        before = data.qpos[0] - rest
        mujoco.mj_step(model, data)
        after = data.qpos[0] - rest
        if before * after < 0:
            crossings.append(data.time - model.opt.timestep * after / (after - before))
    d = float(np.hypot(*arm))
    period = 2 * math.pi * math.sqrt((inertia + hook.mass * d**2) / (hook.mass * GRAVITY * d))
    assert crossings[2] - crossings[0] == pytest.approx(period, rel=0.005)


def test_the_nominal_hook_hangs_2_2_degrees_askew():
    """Handle 370 x 32 mm, tip 70 x 32 mm: 70 * 51 / 440 beside the pin, (370 * 185 + 70 * 354) / 440 below it [mm]."""
    hook = LHook()
    _, data = hung(hook)
    below, beside, _ = 1000 * (data.xipos[1] + [hook.length / 2, 0, 0])
    assert (below, beside) == pytest.approx((211.9, 8.114), abs=0.02)
    assert math.degrees(math.atan2(beside, below)) == pytest.approx(2.19, abs=0.01)


@given(hook=anywhere(JHook))
@settings(max_examples=40, deadline=None)
def test_the_bend_of_a_j_balances_at_two_radii_by_pi(hook):
    """The centroid of a half circle's arc lies 2 R / pi from its centre."""
    arc, side = math.pi * hook.radius, hook.side
    stretches = [
        (hook.length, 0.0, 0.0),
        (arc, hook.length / 2 + 2 * hook.radius / math.pi, side * hook.radius),
        (hook.barb, hook.length / 2 - hook.barb / 2, side * 2 * hook.radius),
    ]
    centre = sum(length * np.array([x, y]) for length, x, y in stretches) / sum(length for length, *_ in stretches)
    _, data = hung(hook)
    assert data.xipos[1][:2] == pytest.approx(centre, abs=0.01 * hook.radius)


@given(hook=st.one_of(anywhere(LHook), anywhere(JHook), anywhere(THook)))
@settings(max_examples=40, deadline=None)
def test_a_hook_weighs_what_it_should_and_lies_flat(hook):
    model, data = hung(hook)
    assert model.body_mass[1] == pytest.approx(hook.mass)
    bottom, top = data.geom_xpos[:, 2] - model.geom_size[:, 2], data.geom_xpos[:, 2] + model.geom_size[:, 2]
    assert bottom == pytest.approx(0.0, abs=1e-12) and top == pytest.approx(hook.height)


@given(hook=st.one_of(anywhere(LHook), anywhere(JHook), anywhere(THook)))
@settings(max_examples=40, deadline=None)
def test_the_outline_is_that_of_the_compiled_boxes(hook):
    model, data = hung(hook)
    seen = []
    for i in range(model.ngeom):
        along, left = (data.geom_xmat[i].reshape(3, 3)[:2, axis] * model.geom_size[i, axis] for axis in (0, 1))
        seen += [data.geom_xpos[i, :2] + end * along + side * left for end in (-1, 1) for side in (1, -1)]
    assert hook.corners[:, :2] == pytest.approx(np.array(seen)) and not hook.corners[:, 2].any()


@given(hook=st.one_of(anywhere(LHook), anywhere(JHook)))
@settings(max_examples=20, deadline=None)
def test_a_mirrored_hook_is_the_mirror_image(hook):
    ends = [
        np.array([bar[:2] for bar in replace(hook, mirrored=mirrored).bars]) * [1, side]
        for mirrored, side in ((0, 1), (1, -1))
    ]
    assert ends[0] == pytest.approx(ends[1])


# --- what goes in -----------------------------------------------------------------------


def contacts_of_peg(hook, radius, x, y):
    """Contacts between a hook and an upright peg."""
    scene = mujoco.MjSpec()
    scene.worldbody.add_frame().attach_body(hook.spec().body("body"), "hook/", "")
    peg = scene.worldbody.add_body(pos=[x, y, hook.height / 2])
    peg.add_freejoint()
    peg.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[radius, hook.height, 0], mass=1.0)
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data.ncon


@given(hook=anywhere(JHook))
@example(hook=JHook(radius=0.02, width=0.04))
@settings(max_examples=40, deadline=None)
def test_a_bend_lets_in_the_nominal_circle_and_nothing_wider(hook):
    at = hook.length / 2, hook.side * hook.radius
    if hook.engaging > 4e-5:  # a bend at the ends of its bounds is closed: no circle is smaller than that
        assert contacts_of_peg(hook, hook.engaging / 2 - 2e-5, *at) == 0
    assert contacts_of_peg(hook, hook.engaging / 2 + 2e-5, *at) > 0


def test_the_outside_of_the_bend_is_round_to_half_a_millimetre():
    """Bars overshoot the outer circle only where they meet."""
    for hook in (ROUND_J, BARBED_J, JHook(radius=0.08, width=0.030)):
        outside = hook.radius + hook.width / 2
        corners = []
        for start, end, more in hook._bend():
            along = (end - start) / np.linalg.norm(end - start)
            out = hook.width / 2 * np.array([along[1], -along[0]]) * hook.side
            corners += [start - more * along + out, end + more * along + out]
        radii = np.linalg.norm(np.array(corners) - [hook.length / 2, hook.side * hook.radius], axis=1)
        assert 0 < radii.min() - outside <= radii.max() - outside < 0.0005


def test_only_the_barb_keeps_a_peg_from_slipping_out_sideways():
    """The two variants of the J differ in the way that is free."""
    at = ROUND_J.length / 2 - 0.03, 2 * ROUND_J.radius
    assert contacts_of_peg(ROUND_J, 0.005, *at) == 0
    assert contacts_of_peg(BARBED_J, 0.005, *at) > 0


# --- what it pulls ----------------------------------------------------------------------


def pulled(overlap, friction=0.4, mirrored=0):
    """Draw a cube 0.15 m towards -x with the last `overlap` [m] of a tip. Returns its way [m] and its turn [deg]."""
    hook, cube = LHook(mirrored=mirrored), Cube(friction=friction)
    scene = table()
    place(scene, hook, "hook", [0, 0, TABLE_TOP + 0.001], free=False)
    scene.body("hook").add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0], armature=1000)
    beside = hook.side * (hook.width / 2 + hook.tip - overlap + cube.edge / 2)
    place(scene, cube, "cube", [hook.inside - cube.edge / 2 - 0.002, beside, TABLE_TOP])
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    start, data.qvel[0] = data.body("cube").xpos.copy(), -0.1
    mujoco.mj_step(model, data, 750)
    turn = math.degrees(math.atan2(data.body("cube").xmat[3], data.body("cube").xmat[0]))
    return float(start[0] - data.body("cube").xpos[0]), abs(turn)


@pytest.mark.parametrize("mirrored", [0, 1])
@pytest.mark.parametrize("friction", [0.1, 0.5])
def test_a_tip_that_reaches_past_the_middle_of_a_cube_draws_it_straight(friction, mirrored):
    """Statics: the push and the friction, which acts at the middle, must lie on one line."""
    edge = Cube().edge
    come, turn = pulled(0.6 * edge, friction, mirrored)
    assert come == pytest.approx(0.148, abs=0.004) and turn < 2.0
    come, turn = pulled(0.4 * edge, friction, mirrored)
    assert turn > 10.0


@pytest.mark.parametrize("hook", [LHook(), LHook(mirrored=1), ROUND_J, BARBED_J, THook()])
def test_what_plans_ask_of_a_hook_is_what_its_outline_shows(hook):
    """How far it stands out beside the handle, and where its innermost face is; polygons overshoot circles by 0.5 %."""
    corners = hook.corners * [1.0, hook.side, 1.0]
    assert corners[:, 1].max() - hook.width / 2 == pytest.approx(hook.aside, rel=0.02)
    assert corners[:, 0].max() - hook.width == pytest.approx(hook.inside, rel=0.02)
