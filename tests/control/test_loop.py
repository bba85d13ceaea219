"""The control loop: bits that depend on no way of calling it, contacts no one may miss, the filter's laws."""

import subprocess
import sys
from itertools import product
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from scengen.control import native
from scengen.control.loop import Loop
from scengen.control.teleop import ALPHA, LARGEST_CHANGE, Filter
from scengen.robots import panda

BALL_RADIUS = 0.02
NAMES = panda.Names()


def scene(timestep: float = 0.002) -> mujoco.MjSpec:
    """A table, a small ball 1 mm above it, which bounces within pi / 500 = 6 ms, and a box near the hand."""
    spec = mujoco.MjSpec()
    spec.option.timestep = timestep
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 20
    table = spec.worldbody.add_body(name="table", pos=[0, 0, 0.775])
    table.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.4, 0.4, 0.025])
    ball = spec.worldbody.add_body(name="ball", pos=[0.2, 0.2, 0.801 + BALL_RADIUS])
    ball.add_freejoint(name="ball")
    ball.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[BALL_RADIUS, 0, 0],
        mass=0.001,
        solref=[-2.5e5, -1.0],
        priority=1,
    )
    box = spec.worldbody.add_body(name="box", pos=[-0.1, 0, 0.82])
    box.add_freejoint(name="box")
    box.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.02, 0.02, 0.02], mass=0.1)
    return spec


def loop(visual: bool = False) -> Loop:
    spec = scene()
    panda.attach(spec, visual=visual)
    model = spec.compile()
    return Loop(model, mujoco.MjData(model))


def downward(n: int) -> NDArray[np.float32]:
    """Actions that drive the closing jaw down onto box and table, shape (n, 7)."""
    time = np.arange(n) * Loop.PERIOD
    actions = np.zeros((n, 7))
    actions[:, 0] = 0.2 * np.sin(3 * time)
    actions[:, 2] = -0.6
    actions[:, 5] = 0.3 * np.sin(2 * time)
    actions[:, 6] = np.where(time > 0.5, 1, -1)
    return actions.astype(np.float32)


DOWN = downward(150)


@pytest.fixture(scope="module")
def shared() -> Loop:
    """One loop for all tests; each starts it with a reset, which is the point of the first test."""
    return loop()


def run(one: Loop, actions: NDArray[np.float32]) -> NDArray[np.float64]:
    """Step through `actions` and return the state at the end."""
    for action in actions:
        assert one.step(action) == 0
    return one.state()


def test_a_used_loop_after_reset_is_a_fresh_one(shared: Loop) -> None:
    run(shared, DOWN)
    shared.reset()
    fresh = loop()
    np.testing.assert_array_equal(shared.state(), fresh.state())
    np.testing.assert_array_equal(run(shared, DOWN), run(fresh, DOWN))


def test_restoring_a_state_continues_with_the_same_bits(shared: Loop) -> None:
    shared.reset()
    run(shared, DOWN[:90])
    middle, poses = shared.state(), shared.data.xpos.copy()
    end = run(shared, DOWN[90:])
    for other in (shared, loop()):
        other.restore(middle)
        np.testing.assert_array_equal(other.state(), middle)
        np.testing.assert_array_equal(other.data.xpos, poses)
        np.testing.assert_array_equal(run(other, DOWN[90:]), end)


@pytest.mark.slow
def test_replay_is_as_many_steps(shared: Loop) -> None:
    shared.reset()
    end, poses = run(shared, DOWN), shared.data.xpos.copy()
    touching = shared.touching.copy()
    shared.reset()
    assert shared.replay(DOWN) == 0
    np.testing.assert_array_equal(shared.state(), end)
    np.testing.assert_array_equal(shared.data.xpos, poses)
    np.testing.assert_array_equal(shared.touching, touching)


def test_recorded_controls_through_plain_mj_step_end_in_the_same_bits(shared: Loop) -> None:
    controls = np.zeros((len(DOWN) * shared.substeps, shared.model.nu))
    shared.reset()
    start = shared.data.qpos.copy()
    shared.replay(DOWN, controls)
    plain = mujoco.MjData(shared.model)
    plain.qpos[:] = start
    mujoco.mj_forward(shared.model, plain)
    for row in controls:
        plain.ctrl[:] = row
        mujoco.mj_step(shared.model, plain)
    np.testing.assert_array_equal(plain.qpos, shared.data.qpos)
    np.testing.assert_array_equal(plain.qvel, shared.data.qvel)


def test_visual_geoms_do_not_change_a_bit(shared: Loop) -> None:
    shared.reset()
    seen = loop(visual=True)
    assert seen.model.nmesh > shared.model.nmesh
    np.testing.assert_array_equal(run(seen, DOWN), run(shared, DOWN))


def test_poses_after_a_step_belong_to_the_present_qpos(shared: Loop) -> None:
    shared.reset()
    run(shared, DOWN[:50])
    now = mujoco.MjData(shared.model)
    now.qpos[:] = shared.data.qpos
    mujoco.mj_kinematics(shared.model, now)
    np.testing.assert_array_equal(shared.data.xpos, now.xpos)
    np.testing.assert_array_equal(shared.data.site_xpos, now.site_xpos)


def test_latches_are_the_union_of_the_bindings_contacts_at_every_physics_step(shared: Loop) -> None:
    controls = np.zeros((len(DOWN) * shared.substeps, shared.model.nu))
    shared.reset()
    start = shared.data.qpos.copy()
    shared.replay(DOWN, controls)
    model, data = shared.model, mujoco.MjData(shared.model)
    robot = {i for i in range(model.nbody) if model.body_rootid[i] == model.body(NAMES.base).id}
    expected = np.zeros_like(shared.touched)
    data.qpos[:] = start
    for row in controls:
        data.ctrl[:] = row
        mujoco.mj_step1(model, data)
        for pair in data.contact.geom[data.contact.dist <= 0]:
            a, b = ({body, *([-2, -1] if body in robot else [])} for body in model.geom_bodyid[pair])
            for one, other in product(a, b):
                expected[one, other] = expected[other, one] = 1
        mujoco.mj_step2(model, data)
    assert expected[-1].any()
    np.testing.assert_array_equal(shared.touched, expected)


def test_a_tap_between_two_control_steps_is_latched(shared: Loop) -> None:
    shared.reset()
    model, data = shared.model, shared.data
    ball, table = model.body("ball").id, model.body("table").id
    data.joint("ball").qvel[2] = -1.0
    shared.step(np.zeros(7, np.float32))
    # In the air before and after the period, going down before and up after.
    assert data.xpos[ball][2] - BALL_RADIUS > 0.8 and data.joint("ball").qvel[2] > 0
    assert shared.touched[ball, table] == shared.touched[table, ball] == 1
    assert shared.touching[ball, table] == 1
    shared.step(np.zeros(7, np.float32))
    assert shared.touching[ball, table] == 0
    assert shared.touched[ball, table] == 1


def test_the_last_row_is_the_robot(shared: Loop) -> None:
    shared.reset()
    box, table, ball = (shared.model.body(name).id for name in ("box", "table", "ball"))
    run(shared, DOWN[:20])
    assert not shared.touched[-1].any()
    run(shared, DOWN[20:])
    assert shared.touched[-1, box] == shared.touched[box, -1] == 1
    assert shared.touched[-1, ball] == shared.touched[ball, -1] == 0
    assert shared.touched[box, table] == 1
    np.testing.assert_array_equal(shared.touched, shared.touched.T)
    shared.reset()
    assert not shared.touched.any()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_number_that_is_none_is_refused_and_changes_nothing(shared: Loop, bad: float) -> None:
    shared.reset()
    before = shared.state()
    for channel in range(7):
        action = np.zeros(7, np.float32)
        action[channel] = bad
        with pytest.raises(ValueError, match="finite"):
            shared.step(action)
        with pytest.raises(ValueError, match="row 1"):
            shared.replay([np.zeros(7), action])
    np.testing.assert_array_equal(shared.state(), before)


@pytest.mark.parametrize("shape", [(), (6,), (8,), (1, 7)])
def test_an_action_of_another_shape_is_refused(shared: Loop, shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="shape"):
        shared.step(np.zeros(shape))


def test_other_wrong_input_is_refused_with_a_remedy(shared: Loop) -> None:
    with pytest.raises(ValueError, match="shape"):
        shared.replay(np.zeros((3, 6)))
    with pytest.raises(ValueError, match="ctrl_out"):
        shared.replay(DOWN, np.zeros((3, 3)))
    with pytest.raises(ValueError, match="state of this scene"):
        shared.restore(shared.state()[1:])
    with pytest.raises(ValueError, match="7 joint angles"):
        Loop(shared.model, shared.data, home=np.zeros(6))
    bare = scene().compile()
    with pytest.raises(ValueError, match=r"panda\.attach"):
        Loop(bare, mujoco.MjData(bare))
    spec = scene(timestep=0.003)
    panda.attach(spec)
    model = spec.compile()
    with pytest.raises(ValueError, match=r"0\.002"):
        Loop(model, mujoco.MjData(model))
    spec = scene()
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    panda.attach(spec)
    model = spec.compile()
    with pytest.raises(ValueError, match="Euler"):
        Loop(model, mujoco.MjData(model))


def test_instability_raises_the_count(shared: Loop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log file beside the caller
    shared.reset()
    assert shared.step(DOWN[0]) == 0
    shared.data.qvel[0] = 1e12
    assert shared.step(DOWN[0]) > 0
    unsound = shared.state()
    shared.reset()
    assert shared.step(DOWN[0]) == 0
    shared.restore(unsound)
    assert shared.step(DOWN[0]) > 0


def test_silence_keeps_warnings_counted_and_writes_nothing(tmp_path: Path) -> None:
    code = """
import mujoco
import numpy as np
from scengen.robots import panda
from scengen.control import native
from scengen.control.loop import Loop
native.silence()
scene = mujoco.MjSpec()
panda.attach(scene)
model = scene.compile()
one = Loop(model, mujoco.MjData(model))
one.data.qvel[0] = 1e12
assert one.step(np.zeros(7)) > 0
"""
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env={"PYTHONPATH": str(root)}, capture_output=True
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")
    assert not list(tmp_path.iterdir())


def test_the_layout_of_contacts_is_the_bindings(shared: Loop) -> None:
    layout = native.layout()
    contact = shared.data.contact
    assert layout.stride == contact.dist.strides[0]
    assert layout.geom - layout.dist == contact.geom.ctypes.data - contact.dist.ctypes.data


def test_no_posture_reaches_beyond_the_bound_and_some_come_close(shared: Loop) -> None:
    model, data = shared.model, mujoco.MjData(shared.model)
    np.testing.assert_allclose(panda.SHOULDER, _shoulder(model, data), atol=1e-12)
    rng = np.random.default_rng(0)
    low, high = np.array([model.joint(name).range for name in NAMES.joints]).T
    address = [model.joint(name).qposadr[0] for name in NAMES.joints]
    straight = [0, 0, 0, -0.0698, 0, 1.0, 0]
    distances = []
    for angles in [straight, *rng.uniform(low, high, (2000, 7))]:
        data.qpos[address] = angles
        mujoco.mj_kinematics(model, data)
        distances.append(np.linalg.norm(data.site(NAMES.grip_site).xpos - panda.SHOULDER))
    assert max(distances) <= panda.REACH
    assert max(distances) > 0.9 * panda.REACH


def _shoulder(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.float64]:
    mujoco.mj_kinematics(model, data)
    return data.body(f"{NAMES.arm}link2").xpos


def test_stripping_refuses_to_change_inertia() -> None:
    spec = scene()
    geom = spec.body("box").add_geom(
        name="paint", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1] * 3, group=1, contype=0, conaffinity=0
    )
    with pytest.raises(ValueError, match=r"paint.*box"):
        panda.strip_visual(spec)
    geom.mass = 0
    panda.strip_visual(spec)
    assert len(spec.body("box").geoms) == 1


def test_a_step_is_followed_at_the_limit_of_change_then_averaged() -> None:
    one = Filter()
    outputs = [one([1, 0, 0, 0, 0, 0, 0])[0] for _ in range(20)]
    expected, value = [], 0.0
    for _ in range(20):
        value += min(ALPHA * (1 - value), LARGEST_CHANGE)
        expected.append(np.float32(value))
    assert outputs == expected
    assert outputs[:2] == [np.float32(0.15), np.float32(0.3)]
    assert outputs[-1] == pytest.approx(1.0, abs=1e-6)


def test_below_the_limit_the_filter_is_the_average_alone() -> None:
    assert Filter()([0.1, 0, 0, 0, 0, 0, 0])[0] == np.float32(0.08)


ACTIONS = st.lists(st.lists(st.floats(-3, 3), min_size=7, max_size=7), min_size=1, max_size=20)


@given(ACTIONS)
@settings(deadline=None, max_examples=50)
def test_outputs_stay_in_range_change_little_and_leave_the_gripper_alone(actions: list[list[float]]) -> None:
    one, previous = Filter(), np.zeros(6)
    for action in actions:
        output = one(action)
        assert output.dtype == np.float32 and output.shape == (7,)
        assert (np.abs(output) <= 1).all()
        assert (np.abs(output[:6] - previous) <= LARGEST_CHANGE + 1e-6).all()
        assert output[6] == np.float32(np.clip(action[6], -1, 1))
        previous = output[:6].astype(float)


@given(ACTIONS)
@settings(deadline=None, max_examples=20)
def test_a_filter_continues_from_a_restored_state(actions: list[list[float]]) -> None:
    one, other = Filter(), Filter()
    one(actions[0])
    other.state = one.state
    for action in actions:
        np.testing.assert_array_equal(one(action), other(action))
    one.reset()
    np.testing.assert_array_equal(one.state, np.zeros(6))


def test_the_filter_refuses_what_the_controller_would() -> None:
    one = Filter()
    with pytest.raises(ValueError, match="finite"):
        one([0, 0, np.nan, 0, 0, 0, 0])
    with pytest.raises(ValueError, match="shape"):
        one([0, 0])
    with pytest.raises(ValueError, match="6 numbers"):
        one.state = np.full(6, 2.0)
    np.testing.assert_array_equal(one.state, np.zeros(6))
