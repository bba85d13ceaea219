"""A package adds kinds of its own, with strengths for an effect that there is or with an effect of its own."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import REFERENCE

from scengen import cli
from scengen.envs.gym import PoolEnv
from scengen.errors import BadConfig, ScengenError, UnknownName
from scengen.perturb.kinds import kinds
from scengen.perturb.perturbation import Perturbation
from scengen.samplers import task_files

FILE = "strengths: [1, 2, 3, 4, 5]\nunit: mm\nwhy: because\nsource: none\neffect: {}\n"
MODULE = """
import numpy as np
from scengen.perturb.effects import PROPRIOCEPTION, Effect

def upward():
    return Effect(lambda strength, rng: {"mm": strength}, PROPRIOCEPTION, on_reading=rise, varies=False)

def rise(entries, reading, values, rng):
    return reading + np.array([values["mm"] / 1000 if each.endswith("eef_pos.z") else 0.0 for each in entries])

def flat():
    return Effect(lambda strength, rng: {"mm": strength}, on_picture=flattened)

def flattened(picture, values, rng):
    return picture.mean(axis=2)

def failing():
    raise ValueError("no")

def something():
    return 1
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A folder for the kinds of a package that is installed."""
    about, folder = tmp_path / "lab_kinds-1.0.dist-info", tmp_path / "lab_kinds" / "conf" / "perturbations"
    about.mkdir()
    folder.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: lab-kinds\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[scengen.tasks]\nours = lab_kinds.conf\n")
    (tmp_path / "lab_kinds" / "effects.py").write_text(MODULE)
    monkeypatch.syspath_prepend(tmp_path)
    for each in (task_files.packages, kinds):
        each.cache_clear()
    yield folder
    monkeypatch.undo()
    for each in (task_files.packages, kinds):
        each.cache_clear()
    for name in [name for name in sys.modules if name.startswith("lab_kinds")]:
        del sys.modules[name]


def test_a_file_adds_a_kind_to_every_command_and_environment(package, tmp_path, capsys):
    (package / "fog.yaml").write_text(FILE.format("blur"))
    (package / "raised.yaml").write_text(FILE.format("lab_kinds.effects:upward"))
    assert {"fog", "raised", "blur"} <= kinds().keys()
    assert Perturbation.parse("fog@2+raised@5").of("a").plain() == {"fog": {"sigma": 2.0}, "raised": {"mm": 5.0}}
    seen = []
    for perturb in (None, "raised@5"):
        env = PoolEnv("domino_single", REFERENCE, ["robot0_eef_pos"], perturb=perturb)
        seen.append(env.reset(seed=0)[0]["robot0_eef_pos"])
    np.testing.assert_allclose(seen[1] - seen[0], [0.0, 0.0, 0.005], atol=1e-6)
    with pytest.raises(BadConfig, match="raised@1 affects streams of proprioception, and none is observed"):
        PoolEnv("domino_single", REFERENCE, ["force_torque"], perturb="raised@1")
    argv = ["evaluate", "policy=idle", f"pool={REFERENCE}", "seeds=1", "rollouts=1", f"to={tmp_path / 'table'}"]
    assert cli.run([*argv, "perturb=raised@3"]) == 0 and "raised@3" in capsys.readouterr().out


def test_the_kind_of_the_page_works_as_written(package):
    page = (Path(__file__).parents[2] / "docs" / "perturb.md").read_text().partition("## A kind of your own")[2]
    file, code = (re.search(rf"```{language}\n(.*?)```", page, re.S)[1] for language in ("yaml", "python"))
    (package.parents[1] / "dusty.py").write_text(code)
    (package / "dust.yaml").write_text(file)
    (package / "grains.yaml").write_text(file.replace("effect: blur ", "effect: lab_kinds.dusty:dust "))
    assert kinds()["dust"].effect is kinds()["blur"].effect
    seen = []
    for perturb in (None, "grains@5"):
        env = PoolEnv("domino_single", REFERENCE, ["rgb_exo_right_cam"], width=64, height=64, perturb=perturb)
        seen.append(env.reset(seed=0)[0]["rgb_exo_right_cam"])
        env.close()
    changed = (seen[0] != seen[1]).any(axis=2)
    assert 0.02 < changed.mean() < 0.08 and (seen[1][changed] == 0).all()


def test_a_picture_of_another_shape_is_the_fault_of_its_function(package):
    (package / "flat.yaml").write_text(FILE.format("lab_kinds.effects:flat"))
    env = PoolEnv("domino_single", REFERENCE, ["rgb_exo_right_cam"], width=32, height=32, perturb="flat@5")
    with pytest.raises(
        BadConfig, match=r"effects.py, line \d+, in flattened: perturbation flat returned float64 of shape"
    ):
        env.reset(seed=0)
    env.close()


@pytest.mark.parametrize(
    ("name", "text", "error", "says"),
    [
        ("blur", FILE.format("noise"), BadConfig, "give a kind a name that no other has"),
        ("My-fog", FILE.format("noise"), BadConfig, "in small letters, such as my_noise"),
        ("fog", FILE.format("nois"), UnknownName, "did you mean 'noise'"),
        ("fog", FILE.format("reworded"), UnknownName, "no effect for .*fog.yaml named 'reworded'"),
        ("fog", FILE.format("thing_colour"), UnknownName, "named 'thing_colour'"),
        ("fog", FILE.format("payload"), UnknownName, "named 'payload'"),
        ("fog", FILE.format("lab_kinds.effects:none"), BadConfig, "has no function or class named 'none'"),
        ("fog", FILE.format("lab_kind:none"), BadConfig, "there is no module 'lab_kind'"),
        ("fog", FILE.format("lab_kinds.effects:failing"), ScengenError, "its function fails"),
        ("fog", FILE.format("lab_kinds.effects:something"), BadConfig, "returned int, and must return an Effect"),
        ("fog", FILE.format("noise").replace("5]", "4]"), BadConfig, "give 5 growing positive numbers"),
        (
            "fog",
            FILE.format("noise") + "strenghts: [1]\n",
            BadConfig,
            "no key named 'strenghts' .did you mean 'strengths'",
        ),
        ("fog", "strengths: [1, 2, 3, 4, 5]", BadConfig, "give strengths, unit, why, source, effect"),
    ],
)
def test_what_is_no_kind_is_refused_in_one_line(package, name, text, error, says):
    (package / f"{name}.yaml").write_text(text)
    with pytest.raises(error, match=says) as caught:
        kinds()
    assert f"{name}.yaml" in str(caught.value) and "\n" not in str(caught.value)
