"""The recipe for robomimic: its numbers, what its policy sees, and what it cannot be trained on."""

import json
import os
import subprocess
import sys

import h5py
import numpy as np
import pytest

from scengen import cli
from scengen.errors import BadConfig, PoolError
from scengen.export.recipes.robomimic import NAME
from scengen.export.recipes.settings import RecipeSettings
from scengen.export.recipes.writer import write_recipe

POSES = {"object": 30, "robot0_eef_pos": 3, "robot0_eef_quat": 4, "robot0_eef_quat_site": 4, "robot0_gripper_qpos": 2}
"""Vectors of a recording of one arm, and their lengths."""
SEEN = ["robot0_eef_pos", "robot0_eef_quat_site", "robot0_gripper_qpos"]


def recorded(path, pictures=()):
    """What the recipe reads of a recording: the columns of its first episode, and its task."""
    with h5py.File(path, "w") as file:
        demo = file.create_group("data/demo_0")
        demo.attrs["ep_meta"] = json.dumps({"task": "domino_single"})
        for name, length in POSES.items():
            demo[f"obs/{name}"] = np.zeros((5, length))
        for name in pictures:
            demo[f"obs/{name}"] = np.zeros((5, 84, 100, 3), np.uint8)
    return path


def config(folder, name="train"):
    return json.loads((folder / f"{name}.json").read_text())


def test_it_has_the_numbers_of_robomimics_study_for_poses(tmp_path):
    data = recorded(tmp_path / "data.hdf5")
    write_recipe(RecipeSettings(NAME, str(data), str(tmp_path / "to"), seed=7))
    told = config(tmp_path / "to")
    assert told["observation"]["modalities"]["obs"] == {"low_dim": ["object", *SEEN], "rgb": []}
    assert told["algo"]["rnn"] == {
        "enabled": True,
        "horizon": 10,
        "hidden_dim": 400,
        "rnn_type": "LSTM",
        "num_layers": 2,
        "open_loop": False,
    }
    assert told["algo"]["gmm"]["num_modes"] == 5 and told["algo"]["actor_layer_dims"] == []
    assert told["algo"]["optim_params"]["policy"]["learning_rate"]["initial"] == 1e-4
    train = told["train"]
    assert (train["batch_size"], train["num_epochs"], told["experiment"]["epoch_every_n_steps"]) == (100, 2000, 100)
    assert (train["seed"], train["cuda"], train["seq_length"], train["hdf5_filter_key"]) == (7, True, 10, "success")
    assert train["data"] == str(data)


def test_a_policy_that_sees_pictures_does_not_see_poses_of_objects(tmp_path):
    data = recorded(tmp_path / "data.hdf5", pictures=["agentview_image", "robot0_eye_in_hand_image"])
    write_recipe(RecipeSettings(NAME, str(data), str(tmp_path / "to")))
    told = config(tmp_path / "to")
    seen = told["observation"]["modalities"]["obs"]
    assert seen["low_dim"] == SEEN and len(seen["rgb"]) == 2 and "object" not in seen["low_dim"]
    crop = told["observation"]["encoder"]["rgb"]["obs_randomizer_kwargs"]
    assert (crop["crop_height"], crop["crop_width"]) == (76, 90)
    assert (told["train"]["batch_size"], told["train"]["num_epochs"], told["algo"]["rnn"]["hidden_dim"]) == (
        16,
        600,
        1000,
    )
    evaluation = (tmp_path / "to" / "evaluate.sh").read_text()
    assert "rgb_gripper_cam" in evaluation and "width=100" in evaluation and "height=84" in evaluation
    assert "object-state" not in evaluation


def test_the_smoke_run_is_short_and_the_same_otherwise(tmp_path):
    write_recipe(RecipeSettings(NAME, str(recorded(tmp_path / "data.hdf5")), str(tmp_path / "to")))
    whole, smoke = config(tmp_path / "to"), config(tmp_path / "to", "smoke")
    experiment, train = smoke["experiment"], smoke["train"]
    assert (experiment["epoch_every_n_steps"], train["num_epochs"], train["batch_size"]) == (20, 1, 2)
    assert not train["cuda"] and experiment["save"] == {"enabled": True, "every_n_epochs": 1}
    assert smoke["algo"] == whole["algo"] and smoke["observation"] == whole["observation"]


def test_scripts_run_the_training_and_evaluate_its_newest_checkpoint(tmp_path):
    """Programs that only record their arguments stand in for python and scengen."""
    to, programs = tmp_path / "to", tmp_path / "programs"
    write_recipe(RecipeSettings(NAME, str(recorded(tmp_path / "data.hdf5")), str(to)))
    models, told = to / "training" / "20260101" / "models", tmp_path / "told.json"
    models.mkdir(parents=True)
    programs.mkdir()
    text = f"#!{sys.executable}\nimport json, os, sys\njson.dump([sys.argv, os.environ.get('ROBOMIMIC_CHECKPOINT')], "
    for name in ("python", "scengen"):
        (programs / name).write_text(text + f"open({str(told)!r}, 'w'))\n")
        (programs / name).chmod(0o755)
    environment = {**os.environ, "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}"}

    def run(script, *arguments):
        return subprocess.run(["sh", str(to / script), *arguments], env=environment, capture_output=True).returncode

    assert run("train.sh") != 0, "robomimic ends with status 0 where it failed: no checkpoint is a failure"
    for age, name in enumerate(("model_epoch_50.pth", "model_epoch_100.pth")):
        (models / name).write_text("")
        os.utime(models / name, (age, age))
    assert run("train.sh") == 0
    assert json.loads(told.read_text())[0][1:] == ["-m", "robomimic.scripts.train", "--config", str(to / "train.json")]
    assert run("evaluate.sh", "generated/id") == 0
    argv, checkpoint = json.loads(told.read_text())
    assert checkpoint == str(models / "model_epoch_100.pth") and argv[1:3] == ["evaluate", "pool=generated/id"]
    assert "action_repeat=1" in argv


def test_what_cannot_be_trained_is_refused_before_anything_is_written(tmp_path):
    (tmp_path / "text.hdf5").write_text("no HDF5")
    for name in ("no_json", "no_demo", "blind", "flat"):
        recorded(tmp_path / f"{name}.hdf5")
    with h5py.File(tmp_path / "no_json.hdf5", "a") as file:
        file["data/demo_0"].attrs["ep_meta"] = "{"
    with h5py.File(tmp_path / "no_demo.hdf5", "a") as file:
        del file["data/demo_0"]
    with h5py.File(tmp_path / "blind.hdf5", "a") as file:
        del file["data/demo_0/obs/object"]
    with h5py.File(tmp_path / "flat.hdf5", "a") as file:
        file["data/demo_0/obs/agentview_image"] = np.zeros(5, np.uint8)
    for name, error, says in (
        ("flat.hdf5", PoolError, "is not a recording of scengen"),
        ("folder", BadConfig, "data = .*; robomimic's format is one file"),
        ("none.hdf5", PoolError, "no recording at"),
        ("text.hdf5", PoolError, "is not a recording of scengen"),
        ("no_json.hdf5", PoolError, "is not a recording of scengen"),
        ("no_demo.hdf5", PoolError, "is not a recording of scengen"),
        ("blind.hdf5", BadConfig, "neither pictures nor object"),
    ):
        with pytest.raises(error, match=says):
            write_recipe(RecipeSettings(NAME, str(tmp_path / name), str(tmp_path / "to")))
    data = recorded(tmp_path / "data.hdf5")
    with pytest.raises(BadConfig, match="'mps'; robomimic trains on cuda or cpu"):
        write_recipe(RecipeSettings(NAME, str(data), str(tmp_path / "to"), device="mps"))
    assert not (tmp_path / "to").exists()


def test_the_command_tells_what_to_run_next(tmp_path, capsys):
    data = recorded(tmp_path / "data.hdf5")
    assert cli.run(["export", "recipe", f"train={NAME}", f'data="{data}"', f"to={tmp_path / 'to'}"]) == 0
    told = capsys.readouterr().out
    assert "requirements.txt, train.json, smoke.json" in told and "arXiv 2108.03298" in told
