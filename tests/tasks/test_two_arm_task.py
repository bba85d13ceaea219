"""A task for two arms goes everywhere that one for one arm goes: pools, environments, recordings, the adversary."""

import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pyarrow.parquet as pq
import pytest
from gymnasium.utils.env_checker import check_env
from helpers import env_class, pictures_are_possible
from pools import QUICKLY, rewritten

from scengen import cli, compose, conformance, load_task
from scengen.attack.evidence import CausalContacts
from scengen.attack.macros import Macro
from scengen.attack.player import Attempt, Player
from scengen.attack.retries import retries
from scengen.attack.variations import rest
from scengen.control.teleop import Filter
from scengen.envs.gym import PoolEnv
from scengen.envs.observations import cameras_of, proprioception, streams_of
from scengen.errors import BadConfig, PoolError
from scengen.evaluate import policies
from scengen.evaluate.player import BadPolicy, PolicyPlayer
from scengen.evaluate.settings import EvaluateSettings as Evaluation
from scengen.evaluate.settings import RolloutId
from scengen.look.looks import PLAIN
from scengen.pool import Pool
from scengen.pool.untrusted import Malformed
from scengen.sim.world import World
from scengen.validate.rollout import Jitter, replay

CONF = Path(__file__).parents[1] / "foreign" / "conf"
SEARCH = conformance.search(CONF)
PAIR = "panda_jaw+panda_jaw"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("pools") / "pair"
    assert cli.run(("generate", "task=push_pair", "n=2", f"pool={path}", *QUICKLY, *SEARCH)) == 0
    return path


@pytest.fixture(scope="module")
def rows(folder):
    return list(Pool.open(folder).rows())


@pytest.fixture
def known(monkeypatch):
    """Let environments find the task: they know no search path."""
    find = load_task
    monkeypatch.setattr(compose, "load_task", lambda name, overrides=(): find(name, (*SEARCH, *overrides)))


@pytest.mark.parametrize("check", conformance.checks("push_pair", conf=CONF, scenarios=1), ids=str)
def test_push_pair_keeps_to_the_rules(check):
    check()


# --- pools ------------------------------------------------------------------------------------


def test_pools_hold_fourteen_numbers_for_each_period_and_are_verified(folder, rows):
    assert all(row.embodiment == PAIR and row.witness.shape[1] == 14 for row in rows)
    (shard,) = folder.glob("*.parquet")
    assert pq.read_schema(shard).field("witness").type.value_type.list_size == 14
    assert cli.run(("verify", f"pool={folder}", *SEARCH)) == 0


@pytest.mark.parametrize("embodiment", ["panda_jaw", "panda_suction"])
def test_a_witness_that_is_not_of_the_robot_is_refused(folder, rows, tmp_path, embodiment):
    copy = tmp_path / "copy"
    copy.mkdir()
    for path in folder.iterdir():
        (copy / path.name).write_bytes(path.read_bytes())
    rewritten(copy, lambda row: replace(row, embodiment=embodiment))
    with pytest.raises((PoolError, Malformed), match=f"14 numbers in an action; those of {embodiment} have 7"):
        list(Pool.open(copy).rows())


def test_noise_goes_to_the_motion_of_both_arms_and_that_of_one_arm_stays_as_it_was():
    jitter = Jitter("key", 0, 0, 0, 0, noise=0.03, latency=0)
    both, one = jitter.shaken(np.zeros(14), 3), jitter.shaken(np.zeros(7), 3)
    assert np.array_equal(both[:7], one) and (both[[6, 13]] == 0).all()
    assert (both[:6] != 0).all() and (both[7:13] != 0).all() and not np.array_equal(both[:6], both[7:13])


# --- environments -----------------------------------------------------------------------------


def test_gymnasium_plays_the_witness_to_the_certified_end(folder, rows, known):
    env = PoolEnv("push_pair", folder)
    check_env(env, skip_render_check=True)
    assert env.action_space.shape == (14,) and tuple(env.streams) == proprioception(PAIR)
    env.reset(options={"scenario": rows[0].id})
    for action in rows[0].witness:
        seen, reward, over, _, _ = env.step(action)
        if over:
            break
    assert reward == 1.0
    for number in (0, 1):
        np.testing.assert_allclose(seen[f"robot{number}_eef_pos"], env.world.arms[number].hand, atol=1e-6)
    with pytest.raises(ValueError, match="an action is 14 finite numbers"):
        env.step(np.zeros(7))


def test_streams_of_the_second_arm_are_its_own(rows):
    streams, world = streams_of("panda_suction+panda_jaw"), World.load(rows[0].scene_xml, "panda_suction+panda_jaw")
    assert "robot1_tactile_left" in streams and "robot0_tactile_left" not in streams
    assert {"force_torque", "robot1_force_torque"} <= streams.keys()
    for name, stream in streams.items():
        assert stream.read(world).shape == stream.shape, name
    push = np.zeros(14)
    push[7:10] = 1.0
    before = {name: stream.read(world) for name, stream in streams.items()}
    for _ in range(20):
        world.step(push)
    moved = {name for name, stream in streams.items() if np.abs(stream.read(world) - before[name]).max() > 0.01}
    assert {"robot1_eef_pos", "robot1_joint_pos"} <= moved and not {"robot0_eef_pos", "robot0_joint_pos"} & moved


@pytest.mark.parametrize("embodiment", [PAIR, "panda_suction+panda_jaw"])
def test_every_camera_is_in_the_model(rows, embodiment):
    model = World.load(rows[0].scene_xml, embodiment, look=PLAIN).model
    assert "robot1_rgb_gripper_cam" in cameras_of(embodiment)
    assert all(
        mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, name) >= 0 for name in cameras_of(embodiment).values()
    )


def test_robosuite_makes_both_arms_and_comes_to_the_same_verdict(rows):
    made = env_class("push_pair", SEARCH)
    from scengen.envs.agreement import compare

    blind = {"use_camera_obs": False, "has_offscreen_renderer": False}
    env = made(robots=["Panda", "Panda"], scenario=rows[0], **blind)
    assert env.action_dim == 14 and "robot1_eef_pos" in env.reset()
    ours, theirs = World.load(rows[0].scene_xml, PAIR, look=PLAIN).model, env.world.model
    for name in ("body_mass", "body_pos", "body_quat", "geom_size", "geom_friction", "jnt_range", "actuator_ctrlrange"):
        np.testing.assert_array_equal(getattr(theirs, name), getattr(ours, name), err_msg=name)
    for wrong in ({"robots": "Panda"}, {"gripper_types": "PandaGripper"}, {"env_configuration": "opposed"}):
        with pytest.raises(BadConfig, match="are certified with"):
            made(scenario=rows[0], **blind, **wrong)
    found = compare(rows[0], SEARCH)
    assert found.agrees and found.ours == "success" and found.apart < 1e-3


# --- policies and recordings ------------------------------------------------------------------


@pytest.mark.parametrize(("name", "solves"), [("idle", False), ("random", False), ("oracle", True)])
def test_built_in_policies_act_for_both_arms(folder, rows, known, name, solves):
    play = PolicyPlayer(Evaluation(pool=str(folder), policy=name))
    assert play([RolloutId("push_pair", "none", "clean", str(folder), rows[0].id, 0)])[0]["success"] == solves


def test_a_policy_for_one_arm_is_told_so_in_one_line(folder, rows, known, monkeypatch):
    monkeypatch.setattr(policies.Idle, "act", lambda self, observation: np.zeros(7))
    with pytest.raises(BadPolicy, match="an action is 14 finite numbers"):
        PolicyPlayer(Evaluation(pool=str(folder), policy="idle"))(
            [RolloutId("push_pair", "none", "clean", str(folder), rows[0].id, 0)]
        )


@pytest.mark.slow
def test_recordings_hold_the_actions_of_both_arms(folder, rows, tmp_path):
    made = tmp_path / "made"
    cameras = "[robot1_rgb_gripper_cam]" if pictures_are_possible() else "none"
    size = ("width=64", "height=48", "n=1")
    assert cli.run(("record", f"pool={folder}", f"to={made}", f"cameras={cameras}", *size, *SEARCH)) == 0
    about = json.loads((made / "meta" / "info.json").read_text())
    assert about["robot_type"] == PAIR and about["features"]["control.actions"]["shape"] == [4, 14]
    table = pq.read_table(next((made / "data").rglob("*.parquet")))
    actions, action = (np.array(table[name].to_pylist(), np.float32) for name in ("control.actions", "action"))
    played = actions.reshape(-1, 14)[: len(rows[0].witness)]
    np.testing.assert_array_equal(played, rows[0].witness[: len(played)])
    np.testing.assert_array_equal(action[:, [6, 13]], actions[:, -1][:, [6, 13]])
    if cameras != "none":
        calibration = json.loads((made / "meta" / "cameras" / "robot1_rgb_gripper_cam.json").read_text())
        assert calibration["frame"] == "robot1_eef"


# --- the adversary ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def player(rows):
    row, task = rows[0], load_task("push_pair", SEARCH)
    return Player(task.scenario(row.params), row.scene_xml, PAIR, row.horizon, row.witness)


@pytest.mark.parametrize(("number", "mine", "other"), [(0, "right", "left"), (1, "left", "right")])
def test_the_adversary_drives_either_arm(player, number, mine, other):
    played = player.play((Macro("push", mine, (0.0, 0.5, 0.0, 0.06, 0.2), number),), raw=False)
    assert played.actions.shape[1] == 14
    assert (mine, f"robot{number}") in played.signature.pairs
    assert played.signature.moved == {mine}
    assert [pair for pair in played.signature.pairs if other in pair] == [(other, "table")]


def test_the_witness_is_taken_apart_for_both_arms_and_can_be_followed(player):
    trace = player.trace
    assert trace.hands.shape[1:] == (2, 3) and {*trace.handled} == {"right", "left"}
    assert player.play(rest(player, 0), raw=False).solved
    player.foreign = {"own": trace.actions}
    asked, both = list(player.plan(Macro("replay", "own"), raw=False)), Filter(2)
    assert np.allclose([both(action) for action in asked], trace.actions, atol=1e-5)


def test_which_arm_touched_what_belongs_to_what_a_witness_needs(player):
    assert {("right", "robot0"), ("left", "robot1")} <= CausalContacts(player, varied=3).lacking(frozenset())


def test_retries_are_made_by_both_arms(player):
    attempts = [attempt for attempt, _ in zip(retries(player), range(40), strict=False)]
    assert {macro.arm for attempt in attempts for macro in attempt.macros} == {0, 1}
    assert all(isinstance(attempt, Attempt) for attempt in attempts)


def test_witnesses_replay_bit_for_bit(rows):
    for row in rows:
        again = replay(
            load_task("push_pair", SEARCH).scenario(row.params),
            World.load(row.scene_xml, row.embodiment),
            row.witness,
            row.horizon,
        )
        assert again.solved and again.digest == row.certificate.final_state
