"""robomimic's format: what its loaders read, and what its robosuite environments need to play it again."""

import json
import sys

import h5py
import numpy as np
import pytest
from helpers import REFERENCE, needs_robosuite, pictures_are_possible

from scengen import cli
from scengen.envs.gym import PoolEnv
from scengen.envs.object_state import NAME
from scengen.envs.robomimic import names
from scengen.errors import BadConfig
from scengen.export.recording import RecordSettings, record
from scengen.pool import Pool
from scengen.sim.world import World

needs_robosuite()
import robosuite  # noqa: E402
from robosuite.environments.base import REGISTERED_ENVS  # noqa: E402

PROPRIOCEPTION = ("robot0_eef_pos", "robot0_eef_quat", "robot0_gripper_qpos")
"""What robomimic's policies without eyes see by default, besides `object`."""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The first two scenarios, read-only."""
    path = tmp_path_factory.mktemp("robomimic") / "made.hdf5"
    record(RecordSettings(str(REFERENCE), str(path), "robomimic", n=2, cameras="none"), lambda *_: None)
    with h5py.File(path, "r", swmr=True, libver="latest") as file:  # as robomimic opens it
        yield file


@pytest.fixture(scope="module")
def witnesses():
    return list(Pool.open(REFERENCE).rows())[:2]


def test_a_loader_finds_every_demonstration_with_all_its_parts(made, witnesses):
    """What robomimic's SequenceDataset asks for: names, lengths, observations and the next ones, in step."""
    demos = sorted(made["data"], key=lambda name: int(name[5:]))
    assert demos == ["demo_0", "demo_1"] and set(made) == {"data", "mask"}
    assert made["data"].attrs["total"] == sum(made[f"data/{demo}"].attrs["num_samples"] for demo in demos)
    for demo, row in zip(demos, witnesses, strict=True):
        group = made[f"data/{demo}"]
        count = group.attrs["num_samples"]
        assert group["actions"].shape == (count, 7) and group["rewards"].shape == group["dones"].shape == (count,)
        assert group["actions"][()].tobytes() == row.witness[:count].tobytes()
        assert set(group["obs"]) == set(group["next_obs"]) >= {*PROPRIOCEPTION, "object"}
        for key in group["obs"]:
            now, after = group[f"obs/{key}"], group[f"next_obs/{key}"]
            assert len(now) == len(after) == count and (now[1:] == after[:-1]).all()
        assert not group["rewards"][:-1].any() and group["rewards"][-1] == group["dones"][-1] == 1


def test_the_file_names_the_version_of_its_task(made):
    assert json.loads(made["data"].attrs["scengen"])["task_versions"] == {"domino_single": 1}
    assert [json.loads(demo.attrs["ep_meta"])["task_version"] for demo in made["data"].values()] == [1, 1]


def test_filter_keys_name_splits_and_successes(made):
    assert {name: [demo.decode() for demo in made[f"mask/{name}"]] for name in made["mask"]} == {
        "id": ["demo_0", "demo_1"],
        "success": ["demo_0", "demo_1"],
    }


def test_states_are_those_of_the_simulation(made, witnesses):
    world, states = World.load(witnesses[0].scene_xml), made["data/demo_0/states"]
    for number in range(40):
        told = np.concatenate([[world.data.time], world.data.qpos, world.data.qvel])
        assert (states[number] == told).all()
        world.step_filtered(witnesses[0].witness[number])


def test_robosuite_plays_a_demonstration_as_robomimic_asks_it_to(made, witnesses):
    """As robomimic's environment does: make from `env_args`, restore `ep_meta`, model and state, then act."""
    told = json.loads(made["data"].attrs["env_args"])
    assert told["type"] == 1 and told["env_name"] == "DominoSingle" and told["env_kwargs"]["control_freq"] == 100
    env = REGISTERED_ENVS[told["env_name"]](**told["env_kwargs"])
    demo = made["data/demo_1"]
    env.set_ep_meta(json.loads(demo.attrs["ep_meta"]))
    env.reset()
    text = demo.attrs["model_file"]
    assert 'file="robosuite/models/' in text and 'file="/' not in text, "no path of this machine"
    env.reset_from_xml_string(env.edit_model_xml(text))
    env.sim.reset()
    env.sim.set_state_from_flattened(demo["states"][0])
    env.sim.forward()
    assert env.row.id == witnesses[1].id
    seen = env._get_observations(force_update=True)
    for key in PROPRIOCEPTION:
        np.testing.assert_allclose(demo[f"obs/{key}"][0], seen[key], atol=1e-5)
    np.testing.assert_allclose(demo["obs/object"][0], seen["object-state"], atol=1e-5)
    for action in demo["actions"][:50]:
        seen, *_ = env.step(action)
    np.testing.assert_allclose(demo["next_obs/robot0_eef_pos"][49], seen["robot0_eef_pos"], atol=1e-3)
    np.testing.assert_allclose(demo["next_obs/robot0_eef_quat"][49], seen["robot0_eef_quat"], atol=5e-3)


@pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL on this machine")
def test_a_file_plays_from_any_folder(tmp_path, monkeypatch):
    """The pool was named by a path relative to the folder in which the recording was made."""
    monkeypatch.chdir(REFERENCE.parent)
    record(RecordSettings(REFERENCE.name, str(tmp_path / "a.hdf5"), "robomimic", n=1, cameras="none"), lambda *_: None)
    monkeypatch.chdir(tmp_path)
    with h5py.File("a.hdf5") as file:
        told = json.loads(file["data"].attrs["env_args"])
    env = robosuite.make(told["env_name"], **told["env_kwargs"])
    env.reset()
    assert env.row.id in {row.id for row in Pool.open(REFERENCE).rows()}


def test_pictures_have_robosuites_names_and_follow_one_another(tmp_path, monkeypatch, witnesses):
    monkeypatch.setattr("scengen.episode.Episode.judge", lambda self: (self.world.time > 0.035 and "timeout") or None)
    path = tmp_path / "seen.hdf5"
    cameras = ["rgb_exo_right_cam", "rgb_gripper_cam"]
    record(
        RecordSettings(str(REFERENCE), str(path), "robomimic", 1, cameras=cameras, width=32, height=24), lambda *_: None
    )
    with h5py.File(path) as file:
        demo = file["data/demo_0"]
        now, after = (demo[f"{what}/agentview_image"] for what in ("obs", "next_obs"))
        assert now.dtype == np.uint8 and now.shape == after.shape == (4, 24, 32, 3) and now[0].std() > 5
        assert (now[1:] == after[:-1]).all() and "robot0_eye_in_hand_image" in demo["obs"]
        told = json.loads(file["data"].attrs["env_args"])["env_kwargs"]
        assert told["camera_names"] == ["agentview", "robot0_eye_in_hand"] and told["camera_widths"] == 32
        assert "mask/success" not in file and not demo["rewards"][()].any()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["fps=25"], "fps = 25; robomimic's data have 100 rows per second, for replay in robosuite"),
        (["to=out"], "to = out; robomimic's format is one file"),
        (["pool=nowhere"], "no pool at nowhere"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(tmp_path, capsys, arguments, says):
    target = tmp_path / "out.hdf5"
    given = ["record", "format=robomimic", "cameras=none", f"pool={REFERENCE}", f"to={target}", *arguments]
    assert cli.run(given) == 2
    err = capsys.readouterr().err
    assert says in err and err.count("\n") == 1 and not list(tmp_path.iterdir())


def test_a_file_has_one_environment(tmp_path):
    """The command makes a file for each task; who calls it in Python is told."""
    pools = [str(REFERENCE), str(REFERENCE.parents[2] / "tests/checker/base/ball_id")]
    settings = RecordSettings(pool=pools, to=str(tmp_path / "out.hdf5"), format="robomimic", cameras="none")
    with pytest.raises(BadConfig, match="has one environment"):
        record(settings, lambda *_: None)
    assert not list(tmp_path.iterdir())


def test_without_h5py_the_line_names_what_to_install(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    assert cli.run(["record", "format=robomimic", f"pool={REFERENCE}", f"to={tmp_path / 'out.hdf5'}"]) == 2
    assert "pip install 'scengen[record]'" in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_keys_have_the_values_of_the_environments_names(made):
    """A policy that was trained on a recording sees the same in `scengen evaluate`."""
    env = PoolEnv("domino_single", pool=[str(REFERENCE)], observations=["robot0_eef_pos", "robot0_eef_quat", NAME])
    own = names(env.task.embodiment)
    for demo in made["data"].values():
        observation, _ = env.reset(options={"scenario": json.loads(demo.attrs["ep_meta"])["scenario"]})
        for key in ("object", "robot0_eef_pos", "robot0_eef_quat_site"):
            np.testing.assert_array_equal(demo[f"obs/{key}"][0].astype(np.float32), observation[own[key]])
        assert {*demo["obs"]} - {*own} == {"robot0_eef_quat"}, "robosuite's orientation of the hand's body"
