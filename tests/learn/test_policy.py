"""Policies on disk and in an environment: data of strangers are refused, and what was shown is played."""

import json
import shutil
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import REFERENCE
from numpy.lib import format as npy

from scengen import cli
from scengen.envs.gym import PoolEnv
from scengen.errors import BadConfig, PoolError
from scengen.evaluate.policies import find_policy
from scengen.evaluate.rollouts import evaluate
from scengen.evaluate.settings import EvaluateSettings, other_version
from scengen.learn.data import TrainingData
from scengen.learn.features import LARGEST_INPUT, Features
from scengen.learn.player import TrainedPolicy
from scengen.learn.store import StoredPolicy
from scengen.learn.train import TrainSettings, train
from scengen.tasks.domino_single import DominoSingle


@pytest.fixture(scope="module")
def memory(tmp_path_factory):
    """Nearest neighbours in the witnesses of the reference pool."""
    folder = tmp_path_factory.mktemp("memory")
    assert cli.run(["record", f"pool={REFERENCE}", f"to={folder / 'data'}", "cameras=none"]) == 0
    assert cli.run(["train", "policy=knn", f"data={folder / 'data'}", f"to={folder / 'policy'}"]) == 0
    return folder / "policy"


@pytest.fixture
def mine(memory, tmp_path):
    """A copy to damage."""
    return Path(shutil.copytree(memory, tmp_path / "mine"))


def played(folder, to, **changes):
    given = {"pool": str(REFERENCE), "seeds": 6, "rollouts": 1, "to": str(to), **changes}
    return evaluate(EvaluateSettings(policy=str(folder), **given), lambda *_: None).episodes


def test_a_memory_solves_scenarios_that_it_has_seen(memory, tmp_path):
    """Five of six: the held-out one may be too far from the others."""
    assert sum(episode["success"] for episode in played(memory, tmp_path)) >= 5


def test_a_policy_brings_its_observations_and_its_rate(memory, tmp_path):
    with pytest.raises(BadConfig, match="action_repeat = 2; the policy acts 25 times per second"):
        played(memory, tmp_path / "a", action_repeat=2)
    with pytest.raises(BadConfig, match="the policy observes robot0_eef_quat"):
        played(memory, tmp_path / "b", observations=["robot0_eef_pos"])


def test_a_policy_need_not_see_the_hand_that_it_moves(memory, tmp_path):
    """Poses of the hands are read to play goals, also where they are no inputs."""
    own = tmp_path / "policy"
    data = f"data={memory.parent / 'data'}"
    assert cli.run(["train", "policy=knn", data, "observations=[object-state]", f"to={own}"]) == 0
    settings = StoredPolicy.open(own).settings
    assert settings.streams == ("object-state",) and "robot0_eef_quat" in settings.observed
    assert sum(episode["success"] for episode in played(own, tmp_path / "results")) >= 5


def test_a_chunk_is_played_before_the_next_is_predicted(memory, monkeypatch):
    env = PoolEnv("domino_single", REFERENCE, list(StoredPolicy.open(memory).settings.observed), action_repeat=4)
    policy = find_policy(str(memory))(env)
    assert isinstance(policy, TrainedPolicy)
    calls, predicted = [], policy._predicted
    monkeypatch.setattr(policy, "_predicted", lambda: calls.append(1) or predicted())
    observation, info = env.reset(seed=0)
    policy.reset(observation, info, 0)
    for step in range(9):
        policy.act(observation)
        assert len(calls) == 1 + step // 3


def test_a_policy_of_another_version_of_its_task_is_played_with_a_line(memory, mine, tmp_path, capsys, monkeypatch):
    now = DominoSingle.VERSION
    assert StoredPolicy.open(memory).settings.task_version == now
    argv = ["evaluate", f"policy={mine}", f"pool={REFERENCE}", "seeds=1", "rollouts=1"]
    assert cli.run([*argv, f"to={tmp_path / 'same'}"]) == 0 and "trained on" not in capsys.readouterr().err
    monkeypatch.setattr(DominoSingle, "VERSION", now + 1)
    assert cli.run([*argv, f"to={tmp_path / 'other'}"]) == 0
    assert f"{mine} was trained on version {now} of domino_single; installed: {now + 1}" in capsys.readouterr().err
    told = json.loads((tmp_path / "other" / "table.json").read_text())
    assert told["task_versions"] == {"domino_single": now + 1}
    settings = json.loads((mine / "policy.json").read_text())
    del settings["task_version"]
    (mine / "policy.json").write_text(json.dumps(settings))
    told = other_version(EvaluateSettings(policy=str(mine)))
    assert told == f"{mine} was trained on an unknown version of domino_single; installed: {now + 1}"
    assert other_version(EvaluateSettings(policy="idle")) == ""


def change(folder, **values):
    path = folder / "policy.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **values}))


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"kind": "knm"}, "did you mean 'knn'"),
        ({"task_version": 0}, "task_version is 0"),
        ({"task_version": "1"}, "task_version"),
        ({"chunk": 0}, "chunk is 0"),
        ({"rate": 30}, "rate = 30 does not divide 100"),
        ({"hidden": [10**9]}, "hidden layers too large"),
        ({"members": 0}, "members is 0"),
        ({"rows": 10**7}, "bytes of weights"),
        ({"inputs": 10**6}, "inputs = 1000000"),
        ({"surprise": 1}, "no key named 'surprise'"),
        ({"weights_sha256": "0" * 64}, "its sha256 is not that in policy.json"),
        ({"format": 99}, "has format 99, this scengen reads 4"),
    ],
)
def test_settings_of_a_stranger_are_refused(mine, values, said):
    change(mine, **values)
    with pytest.raises((PoolError, BadConfig)) as error:
        StoredPolicy.open(mine)
    assert said in str(error.value) and "\n" not in str(error.value)


def replace_member(folder, name, write):
    """Write another member into the archive, and its hash into the settings."""
    from scengen.pool.files import sha256_of_file

    path = folder / "weights.npz"
    with zipfile.ZipFile(path) as archive:
        members = {member: archive.read(member) for member in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for member, content in members.items():
            if member != f"{name}.npy":
                archive.writestr(member, content)
        with archive.open(f"{name}.npy", "w") as file:
            write(file)
    change(folder, weights_sha256=sha256_of_file(path))


def header(shape, dtype="<f4"):
    return lambda file: npy.write_array_header_1_0(file, {"descr": dtype, "fortran_order": False, "shape": shape})


@pytest.mark.parametrize(
    ("write", "said"),
    [
        (header((10**15,)), "has the shape (1000000000000000,)"),
        (header((56,), "|O"), "float32"),
        (lambda file: npy.write_array(file, np.array([{}]), allow_pickle=True), "float32"),
        (lambda file: npy.write_array(file, np.full(56, np.nan, np.float32)), "numbers that are not finite"),
        (header((56,)), "output_mean ends early"),
        (lambda file: file.write(b"cos\nsystem\n"), "damaged"),
    ],
    ids=["huge", "objects", "pickle", "nan", "short", "noise"],
)
def test_weights_of_a_stranger_are_refused(mine, write, said):
    """No pickle is loaded, and no memory is taken for what a header claims."""
    replace_member(mine, "output_mean", write)
    with pytest.raises(PoolError, match="damaged") as error:
        StoredPolicy.open(mine)
    assert said in str(error.value)


def test_bodies_of_other_tasks_in_the_recording_do_not_matter(memory, tmp_path):
    """A recording of several tasks has entries for the bodies of all of them, which read 0 in a scene without them."""
    data = TrainingData.read(memory.parent / "data")
    wider = [
        replace(one, observations=np.insert(one.observations, 23, 0.0, axis=1).astype(np.float32))
        for one in data.trajectories
    ]
    entries = (*data.entries[:23], "plate_pos.x", *data.entries[23:])
    own = tmp_path / "policy"
    train(TrainSettings(policy="knn", to=str(own)), replace(data, entries=entries, trajectories=tuple(wider)), print)
    both = (played(memory, tmp_path / "a", seeds=2), played(own, tmp_path / "b", seeds=2))
    one, other = ([line["actions_sha256"] for line in lines] for lines in both)
    assert one == other


def test_a_policy_of_another_task_or_other_bodies_is_refused(mine, tmp_path):
    entries = json.loads((mine / "policy.json").read_text())["entries"]
    change(mine, entries=[*entries[:-1], "other_pos.x"])
    with pytest.raises(BadConfig, match="trained on other entries"):
        played(mine, tmp_path / "a")
    change(mine, entries=entries, task="packing")
    with pytest.raises(BadConfig, match="trained for packing, the pool holds domino_single"):
        played(mine, tmp_path / "b")


def test_a_folder_without_a_policy_is_one_line(tmp_path):
    with pytest.raises(PoolError, match=r"no policy at .*policy\.json is missing; see scengen train"):
        find_policy(str(tmp_path))


# --- features -----------------------------------------------------------------------------------------

QUAT = tuple(f"cube_quat.{part}" for part in "xyzw")


def test_a_quaternion_and_its_negative_are_the_same_input():
    random = np.random.default_rng(0)
    quats = random.standard_normal((20, 4)).astype(np.float32)
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    features = Features.of(QUAT, 1, quats)
    assert np.allclose(features.inputs(quats), features.inputs(-quats), atol=1e-5) and features.size == 6


def test_the_rotation_is_that_of_the_quaternion():
    """A quarter turn about z takes x to y and y to -x."""
    quats = np.array([[0, 0, np.sqrt(0.5), np.sqrt(0.5)], [0, 0, 0, 1]], np.float32)
    features = Features(QUAT, 1, np.zeros(6, np.float32), np.ones(6, np.float32))
    assert np.allclose(features.inputs(quats)[0], [0, 1, 0, -1, 0, 0], atol=1e-6)


def test_what_never_changed_in_training_is_no_input_later():
    seen = np.array([[0.1, 0.5], [0.2, 0.5], [0.3, 0.5]], np.float32)
    features = Features.of(("cube_pos.x", "cube_pos.y"), 1, seen)
    shifted = seen + np.array([0.0, 0.2], np.float32)
    assert features.size == 1 and np.array_equal(features.inputs(seen), features.inputs(shifted))


def test_a_shift_out_of_distribution_is_an_input_of_moderate_size():
    """Without a smallest spread, 2 mm of variation would make 2 m an input of thousands."""
    seen = np.linspace(0.1, 0.102, 10, dtype=np.float32)[:, None]
    features = Features.of(("cube_pos.x",), 1, seen)
    assert features.inputs(seen + np.float32(0.001)).max() < 3.0
    assert features.inputs(seen + np.float32(2.0)).max() == LARGEST_INPUT


def test_earlier_observations_are_those_of_the_same_episode():
    seen = np.array([[0.1], [0.2], [0.4]], np.float32)
    features = Features(("cube_pos.x",), 2, np.zeros(1, np.float32), np.ones(1, np.float32))
    assert np.allclose(features.inputs(seen), [[0.1, 0.1], [0.2, 0.1], [0.4, 0.2]])
