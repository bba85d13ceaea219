"""The Gymnasium environment plays what the certificate speaks of, and nothing else reaches the simulator."""

import pickle
import shutil
import warnings
from unittest import mock

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from helpers import REFERENCE, REFERENCES, pictures_are_possible

from scengen import list_tasks, load_task
from scengen.control.teleop import LARGEST_CHANGE
from scengen.envs import gym, observations
from scengen.envs.gym import PoolEnv, register
from scengen.envs.pools import reference_pool
from scengen.errors import BadConfig, PoolError, UnknownName
from scengen.pool import Pool
from scengen.pool.collection import members
from scengen.samplers import task_files
from scengen.sim.arm import IDLE

EVERYTHING = (*observations.streams_of("panda_jaw"),)


@pytest.fixture
def env():
    with gymnasium.make("scengen/domino_single-v2", pool=REFERENCE) as made:
        yield made


def told(env, seed=None):
    """Id of the scenario that a reset starts."""
    return env.reset(seed=seed, options={"labels": True})[1]["scenario"]


def test_gymnasiums_own_checker_has_nothing_to_say():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(PoolEnv("domino_single", REFERENCE, observations=EVERYTHING), skip_render_check=True)


def test_without_a_pool_the_scenarios_that_come_with_scengen_are_played():
    made = gymnasium.make("scengen/domino_single-v2")
    told = made.reset(seed=1, options={"labels": True})[1]
    assert made.unwrapped.scenarios == tuple(row.id for row in Pool.open(REFERENCES / "domino_single-id").rows())
    assert told["pool"] == str(REFERENCES / "domino_single-id") and told["instruction"] == made.unwrapped.instruction


def test_a_certified_pool_of_every_task_comes_with_scengen():
    """`make test` verifies them."""
    pools = [Pool.open(folder) for folder in members(REFERENCES)]
    assert sorted(pool.task for pool in pools) == sorted(list_tasks())
    assert all(pool.split == "id" and 3 <= len(pool) <= 6 for pool in pools)
    assert sum(file.stat().st_size for file in REFERENCES.rglob("*") if file.is_file()) < 8e6
    assert set(members(REFERENCES)) == {str(reference_pool(name)) for name in list_tasks()}


def test_learners_see_the_scene_unless_they_ask_for_less():
    own = observations.proprioception("panda_jaw")
    for given, expected in (
        (None, (*own, "object-state")),
        ("state", (*own, "object-state")),
        ("pictures", (*own, *observations.CAMERAS)),
        (["proprioception", "rgb_ego_cam", own[0]], (*own, "rgb_ego_cam")),
    ):
        env = PoolEnv("domino_single", REFERENCE, given)
        assert set(env.observation_space.spaces) == set(expected), given


def test_readings_are_found_by_their_names(env):
    seen, _ = env.reset(seed=1)
    plain, row = env.unwrapped, Pool.open(REFERENCE).at(1)
    tile, height = plain.entry("tile_0_pos"), plain.entry("tile_0_pos.z")
    assert tile.of(seen) == pytest.approx(plain.world.pos("tile_0"), abs=1e-4) and height.of(seen) == tile.of(seen)[2:]
    envs = gymnasium.make_vec("scengen/domino_single-v2", num_envs=2, pool=REFERENCE)
    several, _ = envs.reset(options={"scenario": row.id})
    assert np.array_equal(envs.entry("tile_0_pos").of(several), [tile.of(seen)] * 2)
    for name in ("tile_0_poss", "tile_0_pos.w"):
        with pytest.raises(UnknownName, match="no reading in these observations named .*did you mean 'tile_0_pos"):
            plain.entry(name)


def test_the_legend_names_every_number_of_every_vector():
    env = PoolEnv("domino_single", REFERENCE, ["state", "force_torque", "robot0_tactile_left", "rgb_ego_cam"])
    lines = env.legend.splitlines()
    names = {line.split()[1] for line in lines if "[" in line.split()[0]}
    vectors = {name: each for name, each in env.metadata["names"].items() if "tactile" not in name}
    assert names == {entry.rpartition(".")[0] for entries in vectors.values() for entry in entries}
    assert "object-state[26:29]      tile_0_pos                   x y z [m]" in lines
    assert sum(entry.where.stop - entry.where.start for entry in map(env.entry, names)) == sum(
        map(len, vectors.values())
    )
    assert {line.split(" ")[0] for line in lines if "[" not in line} == {"robot0_tactile_left", "rgb_ego_cam"}
    assert max(map(len, lines)) <= 85


@pytest.mark.parametrize("repeat, steps", [(1, 1200), (7, 172)])
def test_the_specification_has_the_time_limit_in_steps(repeat, steps):
    made = gymnasium.make("scengen/domino_single-v2", action_repeat=repeat)
    assert made.spec.max_episode_steps == steps == made.unwrapped.max_episode_steps
    assert "TimeLimit" not in str(made), "the environment truncates by itself, at the limit of the pool"
    assert (
        gymnasium.make_vec("scengen/domino_single-v2", num_envs=1, action_repeat=repeat).spec.max_episode_steps == steps
    )


def test_every_task_is_registered():
    versions = {name: load_task(name).version for name in list_tasks()}
    assert {f"scengen/{name}-v{version}" for name, version in versions.items()} <= set(gymnasium.registry)


def test_the_version_of_a_task_is_read_without_its_family(tmp_path, monkeypatch):
    """Version 2 of a family of one's own, which raises if it is imported, and classes that are not the family."""
    (tmp_path / "task").mkdir()
    (tmp_path / "task" / "mine.yaml").write_text("family: mine_at_two.Mine\n")
    (tmp_path / "task" / "other.yaml").write_text("family: mine_at_two.Other\n")
    (tmp_path / "task" / "gone.yaml").write_text("family: no_such_package.tasks.Mine\n")
    code = "raise ImportError\nclass Mine:\n    VERSION: ClassVar[int] = 2\nclass Other:\n    HOLD = 2\n"
    (tmp_path / "mine_at_two.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    search = [f"hydra.searchpath=[file://{tmp_path}]"]
    assert [task_files.version(name, search) for name in ("mine", "other", "gone")] == [2, 1, 1]


@pytest.fixture
def registry(monkeypatch):
    """A copy of Gymnasium's registry, to register in."""
    copied = dict(gymnasium.registry)
    monkeypatch.setattr("gymnasium.envs.registration.registry", copied)
    return copied


def test_ids_have_the_installed_version_and_others_are_one_line(registry, monkeypatch):
    monkeypatch.setattr(task_files, "version", lambda name: 3)
    for name in [name for name in registry if name.startswith("scengen/domino_single-v")]:
        registry.pop(name)
    register("domino_single")
    assert gymnasium.spec("scengen/domino_single-v3").kwargs == {"task": "domino_single"}
    with pytest.raises(gymnasium.error.DeprecatedEnv, match="Please use `scengen/domino_single-v3`") as raised:
        gymnasium.spec("scengen/domino_single-v2")
    assert "\n" not in str(raised.value)
    with pytest.raises(gymnasium.error.VersionNotFound, match="`v7` .* provides versioned .* `v3` ]") as raised:
        gymnasium.spec("scengen/domino_single-v7")
    assert "\n" not in str(raised.value)


def test_v0_is_the_installed_version_with_a_warning():
    with pytest.warns(DeprecationWarning, match="scengen/domino_single-v0 is out of date.*`v2`") as told:
        made = gymnasium.make("scengen/domino_single-v0", pool=REFERENCE)
    assert len(told) == 1 and isinstance(made.unwrapped, PoolEnv)


def test_a_task_file_that_cannot_be_read_is_registered_all_the_same(registry, monkeypatch):
    monkeypatch.setattr(task_files, "version", mock.Mock(side_effect=BadConfig("it is not YAML")))
    registry.pop("scengen/packing-v0"), registry.pop("scengen/packing-v2")
    register("packing")
    assert "scengen/packing-v1" in registry


def test_witnesses_reach_the_goal_and_end_in_the_certified_seconds(env):
    for row in Pool.open(REFERENCE).rows():
        _, info = env.reset(options={"scenario": row.id, "labels": True})
        assert (info["scenario"], info["scene_sha256"]) == (row.id, row.scene_sha256)
        for action in row.witness:
            _, reward, terminated, truncated, info = env.step(action)
            if terminated or truncated:
                break
            assert reward == 0.0
        assert reward == 1.0 and terminated and not truncated and info["success"] and info["is_success"]


def test_a_policy_sees_no_label_of_its_scenario(env):
    row = Pool.open(REFERENCE).at(1)
    _, at_reset = env.reset(seed=1)
    *_, later = env.step(IDLE)
    for info in (at_reset, later):
        assert info.keys() == {"success", "is_success", "reason", "lacks", "time"}
        assert not any(label in str(info) for label in (row.id, row.scene_sha256, row.split))


def test_one_observation_needs_no_list(env):
    alone = PoolEnv("domino_single", REFERENCE, observations="robot0_eef_pos")
    assert set(alone.reset(seed=0)[0]) == {"robot0_eef_pos"}


def test_a_step_before_the_first_reset_is_refused():
    with pytest.raises(BadConfig, match="call reset first"):
        PoolEnv("domino_single", REFERENCE).step(IDLE)


def test_a_specification_with_a_path_is_json():
    made = gymnasium.make("scengen/domino_single-v2", pool=REFERENCE)
    assert str(REFERENCE) in made.spec.to_json()


def test_doing_nothing_is_cut_off_at_the_time_limit(env):
    env.reset(seed=0)
    over, steps = False, 0
    while not over:
        _, reward, terminated, truncated, info = env.step(IDLE)
        over, steps = terminated or truncated, steps + 1
    assert truncated and not terminated and reward == 0.0 and not info["success"]
    assert steps == round(load_task("domino_single").horizon * 100) and "was not reached" in info["reason"]


def test_the_filter_of_people_and_oracles_is_there_on_request():
    jerk, asked = np.array([1.0, 0, 0, 0, 0, 0, -1.0], np.float32), []
    for action_filter in (None, "teleop"):
        env = PoolEnv("domino_single", REFERENCE, action_filter=action_filter)
        env.reset(seed=0)
        with mock.patch.object(env.world, "step_filtered", side_effect=lambda action: asked.append(action.tolist())):
            env.step(jerk)
    assert asked == [jerk.tolist(), [pytest.approx(LARGEST_CHANGE), 0, 0, 0, 0, 0, -1.0]]


@pytest.mark.parametrize("settle", [False, True])
def test_a_goal_that_does_not_last_counts_only_without_settling(settle, monkeypatch):
    """The slab counts as away for half a second only."""
    env = PoolEnv("domino_single", REFERENCE, settle=settle, rules="paper")
    env.reset(seed=0)
    monkeypatch.setattr(type(env.scenario), "success", lambda self, world: 0.2 < world.time < 0.7)
    over = False
    while not over:
        _, reward, terminated, truncated, info = env.step(IDLE)
        over = terminated or truncated
    assert terminated and info["success"] is not settle and reward == float(not settle)
    assert ("did not last" in info["reason"]) is settle


def test_a_rule_broken_ends_the_episode_with_its_reason(env):
    env.reset(seed=0)
    world = env.unwrapped.world
    for _ in range(400):
        toward = world.pos("slab") - world.arm.hand
        action = np.zeros(7, np.float32)
        action[:3], action[6] = np.clip(8 * toward, -1, 1), 1.0
        _, _, terminated, _, info = env.step(action)
        if terminated:
            break
    assert terminated and not info["success"] and info["reason"] == "the robot touched the slab"


def test_the_seed_chooses_and_without_one_the_next_scenario_follows(env):
    ids = env.unwrapped.scenarios
    assert [told(env, seed=k) for k in (4, 1, 4)] == [ids[4], ids[1], ids[4]]
    assert told(env) == ids[5] and told(env) == ids[0]


def test_a_used_environment_repeats_itself_bit_by_bit(env):
    def run():
        seen, _ = env.reset(seed=2)
        for k in range(50):
            seen, *_ = env.step(np.sin(0.1 * k + np.arange(7)).astype(np.float32))
        return np.concatenate([np.ravel(v) for v in seen.values()])

    first = run()
    env.reset(seed=3)
    assert (run() == first).all()


def test_one_scenario_or_one_split_can_be_asked_for(env):
    ids = env.unwrapped.scenarios
    alone = PoolEnv("domino_single", REFERENCE, scenario=ids[3][:6], split="id")
    assert alone.scenarios == (ids[3],) and told(alone, seed=0) == ids[3]
    assert alone.task_description == next(Pool.open(REFERENCE).rows()).instruction


def test_an_action_is_held_as_often_as_was_asked_for():
    """The same control periods, with the filter in every one of them, and the same clock."""
    once, fourfold = (PoolEnv("domino_single", REFERENCE, action_filter="teleop", action_repeat=k) for k in (1, 4))
    once.reset(seed=0), fourfold.reset(seed=0)
    for action in np.random.default_rng(0).uniform(-1, 1, (5, 7)):
        for _ in range(4):
            told = once.step(action)
        _, reward, terminated, truncated, info = fourfold.step(action)
        assert (reward, terminated, truncated, info) == told[1:]
        assert fourfold.world.digest == once.world.digest
    assert (fourfold.metadata["render_fps"], once.metadata["render_fps"]) == (25, 100)


def test_a_held_action_ends_where_the_episode_does():
    """The time limit is in seconds: 12.0 s are 1200 control periods, or 171.4 times seven."""
    env = PoolEnv("domino_single", REFERENCE, action_repeat=7)
    env.reset(seed=0)
    truncated, steps = False, 0
    while not truncated:
        *_, truncated, info = env.step(IDLE)
        steps += 1
    assert steps == 172 and info["time"] == pytest.approx(12.0)


@pytest.mark.parametrize("action", [np.zeros(6), np.full(7, np.nan), np.zeros((1, 7)), [0, 0, 0, 0, 0, 0, np.inf]])
def test_what_is_no_action_never_reaches_the_simulator(env, action):
    env.reset(seed=0)
    world = env.unwrapped.world
    before = world.digest
    with pytest.raises(ValueError, match=r"7 finite numbers in \[-1, 1\]"):
        env.unwrapped.step(action)
    assert world.digest == before


@pytest.mark.parametrize(
    ("make", "error", "says"),
    [
        (lambda: PoolEnv("domino_singel", REFERENCE), UnknownName, "did you mean 'domino_single'"),
        (lambda: PoolEnv("domino_select", REFERENCE), PoolError, "of domino_single, not of domino_select"),
        (lambda: PoolEnv("domino_single", "nowhere"), PoolError, "no pool at nowhere"),
        (lambda: PoolEnv("domino_single", []), PoolError, "no pool was given; give pool=FOLDER"),
        (lambda: PoolEnv("domino_single", REFERENCE, split="idd"), UnknownName, "no split in these pools named 'idd'"),
        (
            lambda: PoolEnv("domino_single", REFERENCE, scenario="z"),
            UnknownName,
            "no scenario in these pools named 'z'",
        ),
        (lambda: PoolEnv("domino_single", REFERENCE, scenario=""), UnknownName, "no scenario in these pools named ''"),
        (lambda: PoolEnv("domino_single", REFERENCE, action_repeat=0), BadConfig, "action_repeat = 0; it must be"),
        (lambda: PoolEnv("domino_single", REFERENCE, action_repeat="4"), BadConfig, "action_repeat = '4'; it must be"),
        (
            lambda: PoolEnv("domino_single", REFERENCE, ["robot0_eef_poss"]),
            UnknownName,
            "did you mean 'robot0_eef_pos'",
        ),
        (
            lambda: PoolEnv("domino_single", REFERENCE, ["robot0_eef_poss", "image", "xyz"]),
            UnknownName,
            "(did you mean 'robot0_eef_pos'?), nor 'image', nor 'xyz'; known: force_torque, ",
        ),
        (lambda: PoolEnv("domino_single", REFERENCE, "image"), UnknownName, "did you mean 'pictures'"),
        (
            lambda: gymnasium.make("scengen/domino_single-v2", pol=REFERENCE),
            UnknownName,
            "no argument named 'pol' (did you mean 'pool'?)",
        ),
        (
            lambda: PoolEnv("domino_single", REFERENCE, render_mode="human"),
            UnknownName,
            "known: rgb_array",
        ),
        (
            lambda: PoolEnv("domino_single", REFERENCE).reset(options={"scenario": "0000"}),
            UnknownName,
            "no scenario in these pools named '0000'",
        ),
        (
            lambda: PoolEnv("domino_single", REFERENCE).reset(options={"scenari": 1}),
            UnknownName,
            "did you mean 'scenario'",
        ),
    ],
)
def test_bad_input_is_told_in_one_line(make, error, says):
    with pytest.raises(error) as raised:
        make()
    assert says in str(raised.value) and "\n" not in str(raised.value)


def test_a_pool_made_with_another_mujoco_is_refused(tmp_path):
    shutil.copytree(REFERENCE, tmp_path / "pool")
    manifest = tmp_path / "pool" / "manifest.json"
    manifest.write_text(manifest.read_text().replace(f'"mujoco": "{mujoco.__version__}"', '"mujoco": "3.1.0"'))
    with pytest.raises(PoolError, match=r"certified with mujoco 3\.1\.0, this is"):
        PoolEnv("domino_single", tmp_path / "pool")


def test_readings_have_the_papers_shapes_and_mean_what_they_say():
    env = PoolEnv("domino_single", REFERENCE, observations=EVERYTHING)
    seen, _ = env.reset(seed=0)
    shapes = {name: value.shape for name, value in seen.items()}
    assert (
        shapes["robot0_eef_quat"] == (4,) and shapes["force_torque"] == (6,) and shapes["robot0_gripper_qpos"] == (2,)
    )
    assert shapes["robot0_tactile_left"] == shapes["robot0_tactile_right"] == (8, 8)
    world = env.world
    assert np.allclose(seen["robot0_eef_pos"], world.arm.hand, atol=1e-6)
    x, y, z, w = seen["robot0_eef_quat"]
    turned = np.empty(9)
    mujoco.mju_quat2Mat(turned, np.array([w, x, y, z], float))
    assert np.allclose(turned.reshape(3, 3), world.arm.hand_rot, atol=1e-6)


def test_the_wrist_carries_the_weight_of_the_hand_at_rest():
    env = PoolEnv("domino_single", REFERENCE, observations=["force_torque_world"])
    env.reset(seed=0)
    for _ in range(100):
        seen, *_ = env.step(IDLE)
    model = env.world.model
    hand = int(model.site_bodyid[model.site("gripper0_right_ft_frame").id])
    weight = model.body_subtreemass[hand] * 9.81
    assert np.allclose(np.abs(seen["force_torque_world"]), [0, 0, weight], atol=0.05 * weight)


def test_the_fingers_feel_what_they_press_and_nothing_else():
    env = PoolEnv("domino_single", REFERENCE, observations=["robot0_tactile_left", "robot0_tactile_right"])
    seen, _ = env.reset(seed=0)
    assert not seen["robot0_tactile_left"].any()
    closed = np.array([0, 0, 0, 0, 0, 0, 1.0])
    for _ in range(150):  # the pads meet each other; the joints' end stops carry most of the grip force then
        seen, *_ = env.step(closed)
    left, right = seen["robot0_tactile_left"].sum(), seen["robot0_tactile_right"].sum()
    assert left > 0.1 and left == pytest.approx(right, rel=1e-3)


def test_vectors_of_environments_step_together():
    envs = gymnasium.make_vec("scengen/domino_single-v2", num_envs=2, vectorization_mode="sync", pool=REFERENCE)
    _, info = envs.reset(seed=[1, 3], options={"labels": True})
    assert info["scenario"][0] != info["scenario"][1]
    seen, reward, *_ = envs.step(np.zeros((2, 7), np.float32))
    assert seen["robot0_eef_pos"].shape == (2, 3) and reward.shape == (2,)
    envs.close()


@pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL on this machine")
def test_cameras_see_the_scene():
    env = PoolEnv(
        "domino_single",
        REFERENCE,
        observations=list(observations.CAMERAS),
        render_mode="rgb_array",
        width=64,
        height=48,
    )
    seen, _ = env.reset(seed=0)
    for name in observations.CAMERAS:
        assert seen[name].shape == (48, 64, 3) and seen[name].std() > 5
    assert (env.render() == seen["rgb_exo_right_cam"]).all()
    env.camera = "agentviw"
    with pytest.raises(UnknownName, match="did you mean 'agentview'"):
        env.render()
    env.close()


def test_a_pool_is_found_from_another_working_directory(monkeypatch, tmp_path):
    monkeypatch.chdir(REFERENCE.parent)
    env = PoolEnv("domino_single", REFERENCE.name)
    monkeypatch.chdir(tmp_path)
    env.reset(seed=1)
    copied = pickle.loads(pickle.dumps(env))
    assert copied.reset(seed=2)[1].keys() == env.reset(seed=2)[1].keys()


def test_environments_that_play_the_same_scenarios_are_said_to_once():
    gym._tell_of_equals.cache_clear()
    with pytest.warns(UserWarning, match="give seeds") as told:
        envs = [PoolEnv("domino_single", REFERENCE) for _ in range(3)]
        for env in envs:
            env.reset()
    assert len(told) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for seed, env in enumerate(PoolEnv("domino_single", REFERENCE) for _ in range(2)):
            env.reset(seed=seed)
