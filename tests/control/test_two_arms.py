"""Two arms under one control loop: each moves as one arm alone does, and contacts tell them apart."""

from itertools import product

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from scengen.control.loop import Loop
from scengen.control.teleop import Filter
from scengen.errors import NoEvent, UnknownName
from scengen.robots import panda
from scengen.sim.arm import IDLE, ROBOT
from scengen.sim.embodiment import EMBODIMENTS, HANDS, SCRIPTED, action_size, all_hands, hands
from scengen.sim.world import World

PERIODS = 150
PARKED = np.tile(np.array([0, 0, 0, 0, 0, 0, -1], np.float32), (PERIODS, 1))


def scene(embodiment: str = "", base: NDArray[np.float64] | None = None) -> World:
    """A table with two boxes, one in front of each of two arms; without `embodiment` with one arm on a base."""
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.impratio = 0.002, 20
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    table = spec.worldbody.add_body(name="table", pos=[0, 0, 0.775])
    table.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.4, 0.4, 0.025])
    for name, y in (("right", -0.25), ("left", 0.25)):
        box = spec.worldbody.add_body(name=name, pos=[-0.1, y, 0.82])
        box.add_freejoint()
        box.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.02, 0.02, 0.02], mass=0.1)
    if base is not None:
        panda.attach(spec, base=base)
    for number, hand in enumerate(all_hands(embodiment) if embodiment else ()):
        HANDS[hand](spec, False, number, panda.bases(2)[number])
    return World.of(spec.compile(), embodiment.count(SCRIPTED))


def waving(seed: int = 0) -> NDArray[np.float32]:
    """Actions of one arm that moves and turns in the air, shape (PERIODS, 7)."""
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, 6)
    actions = np.full((PERIODS, 7), -1.0)
    actions[:, :6] = 0.5 * np.sin(3 * Loop.PERIOD * np.arange(PERIODS)[:, None] + phases)
    return actions.astype(np.float32)


def down() -> NDArray[np.float32]:
    """Actions of one arm that drive its closing jaw down onto the box before it and the table, shape (PERIODS, 7)."""
    actions = np.zeros((PERIODS, 7))
    actions[:, 2], actions[:, 6] = -0.6, np.where(np.arange(PERIODS) > 50, 1, -1)
    return actions.astype(np.float32)


@pytest.fixture(scope="module")
def pair() -> World:
    """One world for all tests; each resets it."""
    return scene("panda_jaw+panda_jaw")


def paths(world: World, actions: NDArray[np.float32]) -> NDArray[np.float64]:
    """Joint angles of all arms after each period [rad], shape (PERIODS, arms, 7)."""
    world.reset()
    found = []
    for action in actions:
        world.step_filtered(action)
        found.append([arm.joint_pos for arm in world.arms])
    return np.array(found)


# --- each arm for itself ------------------------------------------------------------------


@pytest.mark.parametrize("number", [0, 1])
def test_beside_a_parked_arm_an_arm_moves_as_one_alone_does(pair: World, number: int) -> None:
    parts = [waving(), PARKED] if number == 0 else [PARKED, waving()]
    moved = paths(pair, np.hstack(parts))
    alone = paths(scene(base=panda.bases(2)[number]), waving())
    np.testing.assert_allclose(moved[:, number], alone[:, 0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(moved[:, 1 - number], np.broadcast_to(panda.HOME, (PERIODS, 7)), atol=5e-3)


def test_what_one_arm_does_in_the_air_is_nothing_to_the_other(pair: World) -> None:
    """Not to the last bit: MuJoCo's solver decides for all joints at once from where it starts."""
    beside = paths(pair, np.hstack([waving(), waving(1)]))
    assert not pair.touched(ROBOT, ROBOT)
    np.testing.assert_allclose(beside[:, 0], paths(pair, np.hstack([waving(), PARKED]))[:, 0], rtol=0, atol=1e-12)


def test_equal_actions_give_equal_paths_side_by_side(pair: World) -> None:
    both = paths(pair, np.hstack([waving(), waving()]))
    np.testing.assert_allclose(both[:, 0], both[:, 1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(pair.arms[1].hand - pair.arms[0].hand, [0, 2 * panda.ARM_OFFSET, 0], rtol=0, atol=1e-12)


# --- bits ---------------------------------------------------------------------------------


@pytest.mark.parametrize("embodiment", [e for e in EMBODIMENTS if "+" in e and SCRIPTED not in e])
def test_reset_restore_and_replay_give_the_same_bits(embodiment: str) -> None:
    world, actions = scene(embodiment), np.hstack([down(), waving()])
    paths(world, actions)
    end, digest = world.state(), world.digest
    paths(world, actions[:70])
    middle = world.state()
    fresh = scene(embodiment)
    fresh.restore(middle)
    np.testing.assert_array_equal(fresh.state(), middle)
    for action in actions[70:]:
        fresh.step_filtered(action)
    np.testing.assert_array_equal(fresh.state(), end)
    world.reset()
    world.loop.replay(actions)
    assert world.digest == fresh.digest == digest


def test_the_state_holds_the_filters_and_grippers_of_both_arms(pair: World) -> None:
    pair.reset()
    for action in np.hstack([waving(), down()])[:60]:
        pair.step(action)
    middle, after = pair.state(), np.hstack([waving(), waving()])[60:70]
    assert [arm.grip for arm in pair.arms] == [-1.0, 1.0]
    first = [pair.step(action) for action in after]
    pair.reset()
    pair.restore(middle)
    assert [arm.grip for arm in pair.arms] == [-1.0, 1.0]
    np.testing.assert_array_equal([pair.step(action) for action in after], first)


# --- an arm of the scene's own ------------------------------------------------------------


def test_a_scripted_arm_moves_like_one_that_actions_drive(pair: World) -> None:
    pair.reset()
    driven = scene("panda_jaw+scripted_panda_jaw")
    assert [arm.label for arm in (*driven.arms, *driven.partners)] == ["robot0", "robot1"] and driven.size == 7
    for own, partner in zip(waving(), down(), strict=True):
        pair.step_filtered(np.concatenate([own, partner]))
        with driven.events():
            driven.partners[0].set_action(partner)
        driven.step_filtered(own)
    assert driven.digest == pair.digest and driven.touched("robot1", "left")


def test_a_scripted_action_holds_for_one_period_and_only_events_may_set_it() -> None:
    world = scene("panda_jaw+scripted_panda_jaw")
    (partner,) = world.partners
    for event in ([1.0] * 7, None):
        with world.events():
            if event:
                partner.set_action(event)
        np.testing.assert_array_equal(world.with_partner_actions(np.zeros(7))[7:], event or IDLE)
    with pytest.raises(NoEvent, match="setting the action of robot1"):
        partner.set_action(IDLE)
    with world.events(), pytest.raises(UnknownName, match="'robot0'"):
        world.arm.set_action(IDLE)
    with pytest.raises(ValueError, match=r"shape \(7,\)"):
        world.step_filtered(np.zeros(14, np.float32))


# --- contacts -----------------------------------------------------------------------------


def test_contacts_are_latched_for_each_arm_and_for_the_robot(pair: World) -> None:
    pair.reset()
    for action in np.hstack([down(), PARKED]):
        pair.step_filtered(action)
    assert pair.touched("robot0", "right") and pair.touched(ROBOT, "right")
    assert not pair.touched("robot1", "right") and not pair.touched(ROBOT, "left")
    assert pair.touching_bodies("right") >= {ROBOT} and "robot0" not in pair.touching_bodies("right")
    assert not pair.touched("robot0", "robot1")
    robots = {i: arm for arm, names in enumerate(panda.arms(pair.model)) for i in _tree(pair.model, names.base)}
    model, loop = pair.model, pair.loop
    controls, expected = np.zeros((PERIODS * loop.substeps, model.nu)), np.zeros_like(loop.touched)
    pair.reset()
    start = pair.data.qpos.copy()
    loop.replay(np.hstack([down(), down()]), controls)
    data = mujoco.MjData(model)
    data.qpos[:] = start
    for row in controls:
        data.ctrl[:] = row
        mujoco.mj_step1(model, data)
        for geoms in data.contact.geom[data.contact.dist <= 0]:
            ends = [
                {body, *([model.nbody + robots[body], model.nbody + 2] if body in robots else [])}
                for body in map(int, model.geom_bodyid[geoms])
            ]
            for one, other in product(*ends):
                expected[one, other] = expected[other, one] = 1
        mujoco.mj_step2(model, data)
    assert expected[model.nbody].any() and expected[model.nbody + 1].any()
    np.testing.assert_array_equal(loop.touched, expected)


def _tree(model: mujoco.MjModel, base: str) -> list[int]:
    return np.flatnonzero(model.body_rootid == model.body(base).id).tolist()


def test_arms_that_meet_touch_each_other(pair: World) -> None:
    inward = np.zeros((PERIODS, 14), np.float32)
    inward[:, 1], inward[:, 8] = 1.0, -1.0
    paths(pair, inward)
    assert pair.touched("robot0", "robot1") and pair.touched("robot1", "robot0")


def test_a_cup_pulls_by_its_own_pads_alone() -> None:
    """The cup of the right arm comes down on its box, the one of the left arm stays in the air, both switched on."""
    world = scene("panda_suction+panda_suction")
    press, wait = down(), PARKED.copy()
    press[:, 6] = wait[:, 6] = 1.0
    pulled = []
    for action in np.hstack([press, wait]):
        world.step_filtered(action)
        pulled.append([arm.sealed for arm in world.arms])
    assert np.array(pulled)[:, 0].any() and not np.array(pulled)[:, 1].any()


# --- input --------------------------------------------------------------------------------


def test_names_of_robots_are_lists_of_hands() -> None:
    assert hands("panda_suction+panda_jaw") == ("panda_suction", "panda_jaw")
    assert [action_size(name) for name in ("panda_jaw", "panda_suction+panda_jaw")] == [7, 14]
    shared = "panda_jaw+scripted_panda_suction"
    assert hands(shared) == ("panda_jaw",) and all_hands(shared) == ("panda_jaw", "panda_suction")
    assert action_size(shared) == 7
    world = scene("panda_suction+panda_jaw")
    assert [arm.suction for arm in world.arms] == [True, False]
    assert [len(arm.finger_pos) for arm in world.arms] == [0, 2] and world.idle.shape == (14,)


@pytest.mark.parametrize("shape", [(7,), (13,), (2, 7), (21,)])
def test_actions_of_another_shape_are_refused_and_change_nothing(pair: World, shape: tuple[int, ...]) -> None:
    pair.reset()
    before = pair.state()
    for play in (pair.step, pair.step_filtered, pair.loop.step):
        with pytest.raises(ValueError, match=r"shape \(14,\)"):
            play(np.zeros(shape))
    with pytest.raises(ValueError, match=r"shape \(n, 14\)"):
        pair.loop.replay(np.zeros((3, 7)))
    with pytest.raises(ValueError, match="of each arm"):
        Loop(pair.model, mujoco.MjData(pair.model), home=np.zeros((3, 7)))
    np.testing.assert_array_equal(pair.state(), before)


def test_a_filter_for_two_arms_is_two_filters() -> None:
    rng = np.random.default_rng(0)
    both, single = Filter(2), [Filter(), Filter()]
    for action in rng.uniform(-1.5, 1.5, (50, 2, 7)):
        np.testing.assert_array_equal(
            both(action.ravel()), np.concatenate([f(a) for f, a in zip(single, action, strict=True)])
        )
    np.testing.assert_array_equal(both.state, np.concatenate([f.state for f in single]))
