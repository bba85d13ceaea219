"""robosuite plays the very scene of the certificate, with its own controller, and comes to the same verdict."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from itertools import islice
from unittest import mock

import mujoco
import numpy as np
import pytest
from helpers import REFERENCE, needs_robosuite, pictures_are_possible
from pools import certificate_of

from scengen import list_tasks, load_task
from scengen.assets.prop import servo
from scengen.certificate import Certificate
from scengen.cli.program import run as scengen
from scengen.control.teleop import LARGEST_CHANGE
from scengen.envs.gym import PoolEnv
from scengen.envs.object_state import RESOLUTION
from scengen.episode import Episode
from scengen.errors import BadConfig, PoolError, UnknownName
from scengen.installation import versions
from scengen.look.looks import PLAIN
from scengen.pool import Pool
from scengen.pool.row import NO_WITNESS
from scengen.robots import panda
from scengen.runs.generate import row_of
from scengen.sim import scene_text
from scengen.sim.world import World
from scengen.validate.certify import Certified
from scengen.validate.rebuilt import rebuild

needs_robosuite()
# ruff: noqa: E402
import robosuite
from robosuite.environments.manipulation.manipulation_env import ManipulationEnv
from robosuite.wrappers import DataCollectionWrapper, GymWrapper, VisualizationWrapper

from scengen.envs import agreement
from scengen.envs.agreement import Comparison, compare, compare_all
from scengen.envs.robosuite import RobosuiteEnv, env_class
from scengen.envs.robosuite_models import SceneModel

BLIND = {"use_camera_obs": False, "has_offscreen_renderer": False}
LOOKS = {"geom_group", "geom_rgba", "mesh_polynormal", "mesh_pathadr", "narena", "nbuffer", "nconmax", "njmax"}
"""Numbers that may differ: what things look like, where strings lie in memory, and how much memory there is."""


@pytest.fixture(scope="module")
def row():
    return next(Pool.open(REFERENCE).rows())


@cache
def drawn(task):
    """A row as in a pool, of a scenario that nobody has certified."""
    found = load_task(task)
    draw = found.draw("id", 0, 0)
    text = rebuild(draw.scenario)
    return row_of(found, draw, Certified(Certificate("quick", ()), text, NO_WITNESS, ""))


def made(row, **arguments):
    return env_class(row.task)(scenario=row, **{**BLIND, **arguments})


@pytest.fixture(scope="module")
def env(row):
    return made(row, hard_reset=False, ignore_done=True)


@pytest.fixture(scope="module")
def sucking():
    return made(drawn("packing"), hard_reset=False)


def different(one, other, tolerance):
    """Names of the numbers in which two compiled models differ, apart from `LOOKS` and the places of names."""
    names = [n for n in dir(one) if not n.startswith(("_", "name", "nnames", "npaths")) and n not in LOOKS]
    options = [f"opt.{n}" for n in dir(one.opt) if not n.startswith("_")]
    found = []
    for name in [*names, *options]:
        holders = (one.opt, other.opt) if name.startswith("opt.") else (one, other)
        a, b = (getattr(holder, name.removeprefix("opt.")) for holder in holders)
        if isinstance(a, (int, float, np.ndarray)) and not (
            np.shape(a) == np.shape(b) and np.allclose(a, b, rtol=0.0, atol=tolerance)
        ):
            found.append(name)
    return found


def names(model, kind, count):
    return [mujoco.mj_id2name(model, kind, i) for i in range(count)]


# --- the model ----------------------------------------------------------------------------


def test_robosuite_knows_every_task():
    for task in list_tasks():
        name = "".join(part.capitalize() for part in task.split("_"))
        assert task == robosuite.environments.base.REGISTERED_ENVS[name].NAME


def test_robosuite_does_not_tell_where_files_lie_on_this_machine(row, caplog):
    made(row, hard_reset=False).close()
    assert not caplog.records
    caplog.set_level("INFO", "robosuite_logs")
    made(row, hard_reset=False).close()
    assert any(".json" in record.message for record in caplog.records), "the control: it would have told"


@pytest.mark.parametrize("task", list_tasks())
def test_the_text_of_a_scene_means_the_same_to_robosuite(task):
    text = drawn(task).scene_xml
    assert different(SceneModel(text).get_model(), mujoco.MjModel.from_xml_string(text), 0.0) == []


def test_robosuite_compiles_the_certified_model(row, env):
    ours = World.load(row.scene_xml, row.embodiment, look=PLAIN).model
    assert different(env.world.model, ours, 0.0) == []
    for kind, count in ((mujoco.mjtObj.mjOBJ_BODY, ours.nbody), (mujoco.mjtObj.mjOBJ_ACTUATOR, ours.nu)):
        assert names(env.world.model, kind, count) == names(ours, kind, count)


def test_robosuite_compiles_the_certified_model_with_a_suction_cup(sucking):
    ours = World.load(sucking.row.scene_xml, sucking.row.embodiment, look=PLAIN).model
    # The cup passes through a text of six digits; `site_size` differs in numbers that a sphere does not have.
    assert set(different(sucking.world.model, ours, 1e-12)) <= {"site_size"}


def test_an_episode_begins_in_the_certified_state(row, env):
    for action in row.witness[:50]:
        env.step(action)
    env.reset()
    world = World.load(row.scene_xml, row.embodiment)
    for name in ("qpos", "qvel", "qacc_warmstart", "ctrl", "act", "time"):
        np.testing.assert_array_equal(getattr(env.world.data, name), getattr(world.data, name), err_msg=name)


@pytest.mark.parametrize("hard_reset", [True, False])
def test_a_jaw_that_holds_a_cube_at_the_start_holds_it_in_robosuite_and_after_a_reset(hard_reset):
    row = drawn("cube_toss")
    env, world = made(row, hard_reset=hard_reset, ignore_done=True), World.load(row.scene_xml, row.embodiment)
    env.reset()
    for _ in range(50):
        env.step(np.array([0.0] * 6 + [-1.0]))
    assert not env.world.touching("robot", "cube")
    env.reset()
    for name in ("qpos", "qvel", "qacc_warmstart", "ctrl", "time"):
        np.testing.assert_array_equal(getattr(env.world.data, name), getattr(world.data, name), err_msg=name)
    assert env.world.arm.grip == world.arm.grip == 1.0
    for _ in range(50):
        env.step(env.world.idle)
        world.step(world.idle)
        assert env.world.touching_bodies("cube") == {"robot"}
    assert env.world.com("cube") == pytest.approx(world.com("cube"), abs=1e-4)


# --- the motion ---------------------------------------------------------------------------


def test_until_it_touches_something_the_arm_moves_as_certified_to_the_last_bits(row, env):
    world = World.load(row.scene_xml, row.embodiment)
    env.reset()
    start, apart = world.arm.hand, 0.0
    for action in row.witness[:100]:
        world.step_filtered(action)
        env.step(action)
        apart = max(apart, float(np.linalg.norm(world.arm.hand - env.world.arm.hand)))
    assert not world.loop.touched[-1].any(), "the witness is too short for a claim about free motion"
    assert np.linalg.norm(world.arm.hand - start) > 0.05
    assert apart <= 1e-12


def test_a_witness_succeeds_in_robosuite(row):
    found = compare(row)
    assert (found.ours, found.theirs, found.reason) == ("success", "success", "")
    assert found.apart <= 1e-3
    assert abs(found.later) <= 0.1


def test_the_filter_is_there_on_request(row):
    env, received = made(row, action_filter="teleop"), []
    with mock.patch.object(ManipulationEnv, "step", lambda self, action: received.append(action[0])):
        for _ in range(3):
            env.step(np.array([1.0, 0, 0, 0, 0, 0, -1.0]))
    assert received == pytest.approx([LARGEST_CHANGE, 2 * LARGEST_CHANGE, 3 * LARGEST_CHANGE])
    with pytest.raises(BadConfig, match="defined for control_freq=100, not 20"):
        made(row, action_filter="teleop", control_freq=20)


def test_contacts_are_latched_in_robosuite_as_here(row, env):
    world = World.load(row.scene_xml, row.embodiment)
    env.reset()
    for action in row.witness[:250]:
        world.step_filtered(action)
        env.step(action)
    assert world.loop.touched[-1].any()
    np.testing.assert_array_equal(env.world.loop.touched, world.loop.touched)


def test_a_robot_that_does_not_obey_is_seen_as_a_difference(row, monkeypatch):
    pre_action = RobosuiteEnv._pre_action
    monkeypatch.setattr(RobosuiteEnv, "_pre_action", lambda env, action, new: pre_action(env, 0.0 * action, new))
    horizon = len(row.witness) * 0.01 - 0.9  # just enough, because a witness goes on for a second
    found = compare(replace(row, horizon=horizon))
    assert (found.ours, found.theirs, found.agrees) == ("success", "timeout", False)
    assert found.apart > 0.1


def test_suction_pulls_only_what_closes_the_cup(sucking):
    sucking.reset()
    world = sucking.world
    cup = world.model.actuator("gripper0_right_suction").id
    for _ in range(5):
        sucking.step(np.array([0, 0, 0, 0, 0, 0, 1.0]))
    assert not world.arm.sealed and world.data.ctrl[cup] == 0.0
    for action in sucking.scenario.oracle(world):
        sucking.step(world.filter(action))
        if world.arm.sealed:
            break
    assert world.arm.sealed and world.data.ctrl[cup] == 1.0 and world.touching("gripper0_right_suction_pad", "piece_0")
    sucking.step(np.array([0, 0, 0, 0, 0, 0, -1.0]))
    assert not world.arm.sealed and world.data.ctrl[cup] == 0.0


def test_a_gripper_slips_in_robosuite_as_long_as_its_scenario_says():
    """Told to close, its fingers are sent to their open ends as long as the slip lasts. Events come before a period."""
    env = made(drawn("slip_recovery"), ignore_done=True)
    env.reset()
    motors = [env.world.model.actuator(name).id for name in panda.Names().finger_motors]
    with env.world.events():
        env.world.memory["jam_ends"] = 0.05
    opened = []
    for _ in range(8):
        env.step(np.array([0, 0, 0, 0, 0, 0, 1.0]))
        opened.append(env.world.data.ctrl[motors].tolist() == [0.04, -0.04])
    assert env.world.arm.grip == 1.0 and opened == [False, *[True] * 4, *[False] * 3]


def test_what_events_move_and_remember_is_seen_in_robosuite_and_gone_after_a_reset():
    env = made(drawn("pick_place_ycb"), ignore_done=True)
    start = env.reset()["patch_pos"]
    assert env.world.memory.names == World.load(env.row.scene_xml).memory.names
    with env.world.events():
        env.world.memory["jumps"] = 1.0
        env.world.move("patch", [0.1, 0.2, 0.8], [0, 1, 0, 0])
    seen = env.step(IDLE)[0]
    assert seen["patch_pos"] == pytest.approx([0.1, 0.2, 0.8]) and seen["patch_quat"] == pytest.approx([1, 0, 0, 0])
    assert env.world.memory["jumps"] == 1.0
    assert env.reset()["patch_pos"] == pytest.approx(start) and env.world.memory["jumps"] == 0.0


# --- verdict and clock --------------------------------------------------------------------


class Stub:
    """A scenario that is what the test says."""

    HOLD = 0.02

    def __init__(self):
        self.reached, self.lost, self.begun = False, None, 0

    def success(self, world):
        return self.reached

    def failure(self, world):
        return self.lost

    def means(self):
        return {}

    def events(self, world):
        self.begun += 1


@pytest.fixture
def stub(env, monkeypatch):
    stub = Stub()
    monkeypatch.setattr(env, "scenario", stub)
    env.reset()
    return stub


IDLE = np.zeros(7)


def test_the_goal_must_hold_and_then_stays_reached(env, stub):
    stub.reached = True
    assert env.step(IDLE)[1] == 0.0
    assert env.step(IDLE)[1] == 1.0
    stub.reached = False
    _, reward, _, info = env.step(IDLE)
    told = {"scenario": env.row.id, "success": True, "reason": "", "lacks": ""}
    assert reward == env.reward() == 1.0 and info == told


def test_a_failure_is_final(env, stub):
    stub.lost = "the slab is broken"
    env.step(IDLE)
    stub.lost, stub.reached = None, True
    for _ in range(3):
        _, reward, _, info = env.step(IDLE)
    assert reward == 0.0 and info["reason"] == "the slab is broken"


def test_a_failure_undoes_a_success(env, stub):
    stub.reached = True
    env.step(IDLE), env.step(IDLE)
    stub.lost = "the slab is broken"
    _, reward, _, info = env.step(IDLE)
    assert reward == 0.0 and info["reason"] == "after the goal was reached: the slab is broken"


def test_the_first_period_has_its_events_without_a_reset(row, monkeypatch):
    """robosuite allows a step right after `make`."""
    begun = []
    monkeypatch.setattr(Episode, "begin", lambda self: begun.append(self.world.time))
    fresh = made(row)
    assert begun == []
    fresh.step(IDLE)
    assert begun == pytest.approx([0.0, 0.01])


def test_events_and_verdict_keep_their_clock_under_any_control_frequency(row, monkeypatch):
    looks = []
    judge = Episode.judge
    monkeypatch.setattr(Episode, "judge", lambda episode: looks.append(episode.world.time) or judge(episode))
    slow = made(row, control_freq=20, hard_reset=False)
    slow.reset()
    slow.step(IDLE), slow.step(IDLE)
    np.testing.assert_allclose(looks, 0.01 * np.arange(1, 11), atol=1e-9)
    assert slow.horizon == 20 * row.horizon


def test_a_servo_of_the_scene_goes_where_events_drive_it_here_and_there(row):
    scene = mujoco.MjSpec.from_string(row.scene_xml)
    lid = scene.worldbody.add_body(name="lid", pos=[-0.2, -0.25, 1.0])
    lid.add_joint(name="lid/hinge", axis=[0, 1, 0], damping=20.0, armature=0.05)
    lid.add_geom(size=[0.1, 0.1, 0.005], type=mujoco.mjtGeom.mjGEOM_BOX, pos=[0.1, 0, 0], mass=0.5)
    servo(scene, "lid/hinge", 200.0)
    text = scene_text.emit(scene)[0]
    env = made(replace(row, scene_xml=text), hard_reset=False)
    env.reset()
    here = World.load(text)
    for world, step in (
        (env.world, lambda: env.step(IDLE)),
        (here, lambda: here.step_filtered(IDLE.astype(np.float32))),
    ):
        with world.events():
            world.drive("lid/hinge", 0.5)
        for _ in range(20):
            step()
    np.testing.assert_allclose(env.world.hinge("lid/hinge"), here.hinge("lid/hinge"), atol=1e-12)
    assert 0.1 < here.hinge("lid/hinge")[0] < 0.6


# --- robosuite's habits -------------------------------------------------------------------


def test_robosuite_makes_it_with_its_usual_arguments(row):
    env = robosuite.make(
        "DominoSingle",
        robots=["Panda"],
        pool=REFERENCE,
        scenario=row.id[:6],
        has_renderer=False,
        control_freq=100,
        horizon=3,
        initialization_noise="default",
        seed=5,
        **BLIND,
    )
    observations = env.reset()
    assert {"robot0_eef_pos", "robot0_joint_pos", "robot0_proprio-state", "object-state"} <= observations.keys()
    np.testing.assert_allclose(observations["slab_pos"], env.world.pos("slab"), atol=RESOLUTION["pos"] / 2 + 1e-9)
    np.testing.assert_allclose(observations["slab_quat"], np.roll(env.world.data.body("slab").xquat, -1), atol=3e-4)
    assert np.abs(env.world.data.qpos[env.robots[0]._ref_joint_pos_indexes] - env.robots[0].init_qpos).max() > 1e-3
    assert env.action_dim == 7
    assert [env.step(IDLE)[2] for _ in range(3)] == [False, False, True]


def test_a_pool_gives_scenarios_by_seed_with_what_lies_in_them():
    first, again = (env_class("domino_single")(pool=REFERENCE, seed=7, **BLIND) for _ in range(2))
    seen = set()
    for _ in range(4):
        observations = first.reset()
        again.reset()
        assert first.row.id == again.row.id
        seen.add(first.row.id)
        tiles = [key for key in observations if key.startswith("tile_") and key.count("_") == 2 and "quat" in key]
        assert len(tiles) == 6, "as many entries as any scenario of the task has tiles"
        there = sum(bool(observations[key].any()) for key in tiles)
        assert there == sum(name.startswith("tile_") for name in first.world.free_bodies)
    assert len(seen) > 1


def test_object_state_is_that_of_gymnasium_entry_by_entry(row):
    gym = PoolEnv(row.task, REFERENCE, ["object-state"], scenario=row.id)
    theirs, (ours, _) = made(row, hard_reset=False).reset(), gym.reset()
    np.testing.assert_allclose(theirs["object-state"], ours["object-state"], atol=1e-6)
    assert len(theirs["object-state"]) == len(gym.metadata["names"]["object-state"])
    at = gym.metadata["names"]["object-state"].index("slab_to_robot0_eef_pos.x")
    np.testing.assert_array_equal(theirs["object-state"][at : at + 3], theirs["slab_to_robot0_eef_pos"])


def test_a_demonstration_finds_its_scenario_again():
    """robomimic and robosuite hand `ep_meta` to `set_ep_meta` and reset."""
    env = env_class("domino_single")(pool=REFERENCE, **BLIND)
    for row in list(Pool.open(REFERENCE).rows())[:2]:
        env.set_ep_meta({"scenario": row.id})
        env.reset()
        told = env.get_ep_meta()
        assert (told["scenario"], told["lang"]) == (row.id, row.instruction) == (env.row.id, env.row.instruction)
    env.set_ep_meta({"scenario": "0" * 12})
    with pytest.raises(UnknownName, match="no scenario in these pools named '000000000000'"):
        env.reset()


@pytest.mark.parametrize(
    ("change", "error", "says"),
    [
        ({"robots": "Sawyer"}, BadConfig, "certified with Panda"),
        ({"gripper_types": "RethinkGripper"}, BadConfig, "certified with PandaGripper"),
        ({"scenario": None}, BadConfig, "no scenario was given"),
        ({"scenario": "nothing starts so", "pool": REFERENCE}, UnknownName, "no scenario in"),
        ({"scenario": None, "pool": REFERENCE / "not"}, PoolError, "no pool at"),
    ],
)
def test_bad_input_is_refused_in_one_line(row, change, error, says):
    with pytest.raises(error, match=says) as caught:
        env_class("domino_single")(**{"scenario": row, **change})
    assert "\n" not in str(caught.value)


def test_scenarios_of_other_tasks_or_versions_are_refused(row):
    with pytest.raises(PoolError, match="belongs to domino_single, not to packing"):
        env_class("packing")(scenario=row)
    old = certificate_of(row, versions={**versions(), "mujoco": "2.0"})
    with pytest.raises(PoolError, match="with mujoco 2.0"):
        env_class("domino_single")(scenario=old)


@pytest.mark.parametrize("edge", [1.5, "64", 0, -1, 4097, [64, 0]])
@pytest.mark.parametrize("name", ["camera_widths", "camera_heights"])
def test_pictures_of_impossible_size_are_refused_in_one_line(row, name, edge):
    with pytest.raises(BadConfig, match=f"{name} = .*; it must be a whole number of pixels from 1 to 4096"):
        env_class("domino_single")(scenario=row, camera_names=["agentview", "frontview"], **{name: edge})


@pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL on this machine")
def test_every_environment_draws_its_own_scene_in_any_thread():
    """robosuite draws with the context that is current in a thread: none, or that of another environment."""
    looks = {"hard_reset": False, "camera_names": "agentview", "camera_widths": 64, "camera_heights": 64}
    envs = [env_class(row.task)(scenario=row, **looks) for row in islice(Pool.open(REFERENCE).rows(), 2)]
    alone = [env.reset()["agentview_image"] for env in envs]
    assert not np.array_equal(*alone)
    with ThreadPoolExecutor(1) as thread:
        for reset in (lambda env: env.reset(), lambda env: thread.submit(env.reset).result()) * 2:
            assert all(
                np.array_equal(reset(env)["agentview_image"], seen) for env, seen in zip(envs, alone, strict=True)
            )
    for env in envs:
        env.close()


@pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL on this machine")
def test_cameras_show_the_things_of_the_scene(row):
    env = robosuite.make(
        "DominoSingle",
        robots="Panda",
        scenario=row,
        camera_names="agentview",
        camera_heights=64,
        camera_widths=64,
        camera_segmentations="instance",
    )
    with_slab = env._get_observations(force_update=True)
    image = with_slab["agentview_image"].astype(int)
    assert image.shape == (64, 64, 3)
    slab = 1 + list(env.model.instances_to_ids).index("slab")
    red = image[with_slab["agentview_segmentation_instance"][..., 0] == slab].mean(axis=0)
    assert red[0] > red[1] + 50 and red[0] > red[2] + 50
    env.close()


# --- the command --------------------------------------------------------------------------


def test_comparisons_come_in_the_order_of_ids_and_no_more_than_asked_for(monkeypatch):
    monkeypatch.setattr(
        agreement, "compare", lambda row, search: Comparison(row.task, row.id, "success", "success", "", 0.0, 0.0)
    )
    counts = []
    found = compare_all([Pool.open(REFERENCE)], 1, counts.append, first=4)
    assert [c.id for c in found] == sorted(c.id for c in found)
    assert counts == [1, 2, 3, 4]


@pytest.mark.parametrize(
    ("differing", "end", "status"), [(0, "success", 0), (1, "failure", 1), (1, "unknown", 3), (6, "unknown", 3)]
)
def test_the_command_fails_below_the_limit(differing, end, status, monkeypatch, tmp_path):
    def fake(row, search):
        fails = fake.left > 0
        fake.left -= 1
        return Comparison(row.task, row.id, "success", end if fails else "success", "", 0.0, 0.0)

    fake.left = differing
    monkeypatch.setattr(agreement, "compare", fake)
    file = tmp_path / "result.json"
    assert scengen(["verify", "robosuite", f"pool={REFERENCE}", f"json={file}"]) == status
    result = json.loads(file.read_text())
    assert result["same"] == len(Pool.open(REFERENCE)) - differing == len(result["scenarios"]) - differing


@pytest.mark.parametrize("given", ["limit=1.5", "first=0", "workers=0", "limt=1", "pool=nowhere"])
def test_the_command_explains_bad_input(given, capsys):
    pool = [] if given.startswith("pool") else [f"pool={REFERENCE}"]
    assert scengen(["verify", "robosuite", *pool, given]) == 2
    assert capsys.readouterr().err.count("\n") == 1


# --- robosuite's wrappers -------------------------------------------------------------------


def test_robosuites_own_wrappers_take_the_environment(row, tmp_path):
    env = robosuite.make("DominoSingle", robots="Panda", pool=REFERENCE, scenario=row.id, reward_scale=2.0, **BLIND)
    flat = GymWrapper(env)
    observation, _ = flat.reset(seed=0)
    assert flat.reward_range == (0, 2.0) and observation.shape == flat.observation_space.shape
    assert flat.action_space.shape == (7,)
    reward = 0.0
    for action in Pool.open(REFERENCE).row(row.id).witness:
        _, reward, terminated, truncated, info = flat.step(action)
        assert not (terminated or truncated)
        if info["success"]:
            break
    assert reward == 2.0
    env.close()


def test_what_is_recorded_in_robosuites_way_holds_scene_and_states(row, tmp_path):
    env = VisualizationWrapper(robosuite.make("DominoSingle", robots="Panda", pool=REFERENCE, scenario=row.id, **BLIND))
    recorded = DataCollectionWrapper(env, str(tmp_path), collect_freq=1, flush_freq=10)
    recorded.reset()
    for action in row.witness[:10]:
        recorded.step(action)
    recorded.close()
    (folder,) = tmp_path.iterdir()
    kept = [np.load(path)["states"] for path in folder.glob("state_*.npz")]
    assert sum(map(len, kept)) >= 10 and mujoco.MjModel.from_xml_path(str(folder / "model.xml")).nq


def test_there_is_no_reward_on_the_way(row):
    with pytest.raises(BadConfig, match="reward_shaping=False"):
        robosuite.make("DominoSingle", pool=REFERENCE, scenario=row.id, reward_shaping=True, **BLIND)
