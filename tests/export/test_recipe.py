"""Recipes: the scripts that are written run the programs with the settings that are meant."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from helpers import REFERENCE

import scengen
from scengen import cli
from scengen.errors import BadConfig, PoolError, UnknownName
from scengen.export.recipes.settings import RecipeSettings
from scengen.export.recipes.writer import RECIPES, write_recipe

VIDEO = {"dtype": "video", "shape": [480, 640, 3], "names": ["height", "width", "channels"]}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """The witness of the reference pool's first scenario."""
    folder = tmp_path_factory.mktemp("recorded") / "it's data"
    assert cli.run(["record", f"pool={REFERENCE}", f'to="{folder}"', "cameras=none", "n=1"]) == 0
    return folder


@pytest.fixture
def filmed(recorded, tmp_path):
    """The recording as one with two cameras, as far as its description says."""
    folder = Path(shutil.copytree(recorded, tmp_path / "filmed"))
    info = json.loads((folder / "meta" / "info.json").read_text())
    del info["features"]["observation.environment_state"]
    for camera in ("rgb_ego_cam", "rgb_exo_right_cam"):
        info["features"][f"observation.images.{camera}"] = VIDEO
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    return folder


def played(script, tmp_path, *arguments):
    """The settings with which a script runs its program, by name."""
    programs, told = tmp_path / "programs", tmp_path / "told.json"
    programs.mkdir(exist_ok=True)
    for name in ("lerobot-train", "lerobot-eval"):
        text = f"#!{sys.executable}\nimport json, sys\njson.dump(sys.argv, open({str(told)!r}, 'w'))\n"
        (programs / name).write_text(text)
        (programs / name).chmod(0o755)
    path = f"{programs}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(["sh", str(script), *arguments], check=True, env={**os.environ, "PATH": path})
    program, *settings = json.loads(told.read_text())
    return Path(program).name, dict(setting.removeprefix("--").split("=", 1) for setting in settings)


def test_the_diffusion_policy_has_the_numbers_of_the_paper(recorded, tmp_path):
    """App. G: AdamW, rate 1e-4, cosine with 500 steps of warmup, batches of 32, 50k steps, weight decay 1e-6."""
    write_recipe(RecipeSettings("lerobot_diffusion", str(recorded), str(tmp_path / "to")))
    program, told = played(tmp_path / "to" / "train.sh", tmp_path)
    paper = {"optimizer.type": "adamw", "optimizer.lr": "0.0001", "optimizer.weight_decay": "1e-06"}
    paper |= {"scheduler.name": "cosine", "scheduler.num_warmup_steps": "500"}
    paper |= {"batch_size": "32", "steps": "50000", "save_freq": "5000", "use_policy_training_preset": "false"}
    assert program == "lerobot-train" and paper.items() <= told.items()
    assert told["dataset.root"] == str(recorded) and told["policy.push_to_hub"] == told["wandb.enable"] == "false"
    assert "diffusion" in (tmp_path / "to" / "requirements.txt").read_text()


def test_the_smoke_run_is_short_and_the_same_otherwise(recorded, tmp_path):
    write_recipe(RecipeSettings("lerobot_act", str(recorded), str(tmp_path / "to"), device="cuda:1", seed=7))
    whole, smoke = (played(tmp_path / "to" / name, tmp_path)[1] for name in ("train.sh", "smoke.sh"))
    different = {name for name in whole if whole[name] != smoke[name]}
    assert different == {"steps", "batch_size", "save_freq", "log_freq", "num_workers", "policy.device", "output_dir"}
    assert (whole["policy.device"], smoke["policy.device"], smoke["steps"], whole["seed"]) == (
        "cuda:1",
        "cpu",
        "20",
        "7",
    )


def test_evaluation_plays_what_was_trained_with_the_streams_of_the_recording(recorded, filmed, tmp_path):
    for data, state, cameras in ((recorded, "true", None), (filmed, "false", "rgb_ego_cam,rgb_exo_right_cam")):
        write_recipe(RecipeSettings("lerobot_act", str(data), str(tmp_path / "to")))
        program, told = played(tmp_path / "to" / "evaluate.sh", tmp_path, "generated/id,generated/diagonal")
        trained = played(tmp_path / "to" / "train.sh", tmp_path)[1]["output_dir"]
        assert program == "lerobot-eval" and told["policy.path"] == f"{trained}/checkpoints/last/pretrained_model"
        assert (told["env.task"], told["env.fps"], told["env.environment_state"]) == ("domino_single", "25", state)
        assert told["env.pool"] == "generated/id,generated/diagonal" and told.get("env.cameras") == cameras
        assert told.get("env.width") == ("640" if cameras else None)


def test_a_pretrained_policy_gets_the_names_of_its_own_cameras(filmed, tmp_path):
    write_recipe(RecipeSettings("lerobot_smolvla", str(filmed), str(tmp_path / "to")))
    for script in ("train.sh", "evaluate.sh"):
        _, told = played(tmp_path / "to" / script, tmp_path, "generated/id")
        renamed = {f"observation.images.{a}": f"observation.images.{b}" for a, b in CAMERAS.items()}
        assert json.loads(told["rename_map"]) == renamed


CAMERAS = {"rgb_ego_cam": "camera1", "rgb_exo_right_cam": "camera2"}


def test_what_cannot_be_trained_is_refused_before_anything_is_written(recorded, filmed, tmp_path):
    blind = Path(shutil.copytree(filmed, tmp_path / "blind"))
    info = json.loads((blind / "meta" / "info.json").read_text())
    info["features"] = {name: f for name, f in info["features"].items() if f["dtype"] != "video"}
    (blind / "meta" / "info.json").write_text(json.dumps(info))
    for train, data, error, says in (
        ("lerobot_atc", recorded, UnknownName, "did you mean 'lerobot_act'"),
        ("lerobot_act", tmp_path, PoolError, "meta/info.json is missing"),
        ("lerobot_smolvla", recorded, BadConfig, "has 0 cameras, it needs 1 to 3"),
        ("lerobot_act", blind, BadConfig, "neither pictures nor observation.environment_state"),
    ):
        with pytest.raises(error, match=says):
            write_recipe(RecipeSettings(train, str(data), str(tmp_path / "to")))
    assert not (tmp_path / "to").exists()


def test_the_command_tells_what_to_run_next(recorded, tmp_path, capsys):
    argv = ["export", "recipe", "train=lerobot_act", f'data="{recorded}"', f"to={tmp_path / 'to'}"]
    assert cli.run(argv) == 0
    told = capsys.readouterr().out
    assert "requirements.txt, smoke.sh, train.sh, evaluate.sh" in told and f"sh {tmp_path / 'to' / 'smoke.sh'}" in told


def test_every_recipe_is_offered_by_the_command():
    text = (Path(scengen.__file__).parents[1] / "conf" / "command" / "export_recipe.yaml").read_text()
    assert all(name in text for name in RECIPES)
