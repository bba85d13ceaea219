"""Levels of certificates in a search path, Hydra's options, and what to say instead of its settings."""

import pytest
import yaml

from scengen import cli, compose
from scengen.cli.commands.settings import read_task
from scengen.errors import BadConfig
from scengen.runs.generate import GenerateSettings

DOMINO = "task=domino_single"


@pytest.fixture
def conf(tmp_path):
    """A search path with a level of certificates of its own."""
    (tmp_path / "certify").mkdir()
    (tmp_path / "certify" / "mine.yaml").write_text("defaults: [quick]\nrobust: {runs: 6}\n")
    (tmp_path / "certify" / "called.yaml").write_text("defaults: [quick]\nname: called\n")
    return f"hydra.searchpath={tmp_path}"


def test_a_level_of_the_search_path_continues_ours_and_the_command_line_wins(conf):
    _, _, level = read_task("generate", [DOMINO, "certify=mine", conf], GenerateSettings)
    assert (level.name, level.robust.runs, level.robust.bound, level.settle) == ("quick", 6, 0.45, 1.0)
    _, _, level = read_task("generate", [DOMINO, "certify=mine", conf, "certify.robust.bound=0.6"], GenerateSettings)
    assert (level.robust.runs, level.robust.bound) == (6, 0.6)
    words = [DOMINO, "certify=mine", conf, "+task.certify.robust.mass=0.01"]
    _, _, level = read_task("generate", words, GenerateSettings)
    assert level.robust.runs == 6 and level.robust.mass == 0.01, "settings of a task win over those of a level"


def test_a_name_that_no_verifier_knows_is_refused_before_the_first_draw(conf):
    with pytest.raises(BadConfig, match="verify knows full, quick and prints what differs"):
        read_task("generate", [DOMINO, "certify=called", conf], GenerateSettings)


HEAVY = """# @package _global_
defaults:
  - override /task: domino_single
  - override /certify: full
n: 3
split: diagonal
task: {id: {tile: {mass: [uniform, 0.03, 0.04]}}}
certify: {robust: {runs: 16}}
"""


@pytest.fixture
def experiments(tmp_path):
    """A search path with experiments."""
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "heavy.yaml").write_text(HEAVY)
    (tmp_path / "experiment" / "bare.yaml").write_text("n: 3\n")
    sweeping = "# @package _global_\nn: 3\nhydra: {sweeper: {params: {split: 'id,diagonal'}}}\n"
    (tmp_path / "experiment" / "sweeping.yaml").write_text(sweeping)
    (tmp_path / "experiment" / "several.yaml").write_text("# @package _global_\nsplit: id,low_starter\n")
    (tmp_path / "experiment" / "misspelt.yaml").write_text("# @package _global_\nsed: 3\n")
    (tmp_path / "experiment" / "few.yaml").write_text("# @package _global_\nn: 3\n")
    return f"hydra.searchpath={tmp_path}"


def test_an_experiment_chooses_files_and_sets_values_and_the_command_line_wins(experiments):
    settings, task, level = read_task("generate", ["+experiment=heavy", experiments], GenerateSettings)
    assert (settings.n, settings.split, task.name) == (3, "diagonal", "domino_single")
    assert (level.name, level.robust.runs) == ("full", 16) and task.node["id"]["tile"]["mass"] == [
        "uniform",
        0.03,
        0.04,
    ]
    words = ["+experiment=heavy", experiments, "n=7", "certify.robust.runs=9", "certify=quick"]
    settings, _, level = read_task("generate", words, GenerateSettings)
    assert (settings.n, level.name, level.robust.runs) == (7, "quick", 9)


def test_experiments_are_swept_shown_and_taken_by_commands_without_groups(experiments, capsys):
    assert cli.run(["generate", "+experiment=heavy", experiments, "--info", "defaults-tree"]) == 0
    assert "experiment: heavy" in capsys.readouterr().out
    found = compose.combinations("generate", [DOMINO, "+experiment=few,heavy", experiments])
    assert [compose.composed("generate", one.overrides)[0]["split"] for one in found] == ["id", "diagonal"]
    assert compose.composed("record", ["pool=x", "to=y", "+experiment=few", experiments])[0]["n"] == 3


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("+experiment=hevy", "did you mean 'heavy'?"),
        ("+experiment=misspelt", "experiment/misspelt.yaml: no setting of generate named 'sed' (did you mean 'seed'?)"),
        ("+experiment=bare", "experiment/bare.yaml: start it with `# @package _global_`"),
        ("experiment=heavy", "give +experiment=heavy, with one plus"),
        ("++experiment=heavy", "give +experiment=heavy, with one plus"),
        ("+experiment=several", "give several on the command line: split=id,low_starter"),
        ("+experiment=sweeping", "experiment/sweeping.yaml: leave hydra.sweeper out; several values make a sweep"),
    ],
)
def test_an_experiment_that_cannot_be_taken_has_a_remedy(word, told, experiments, capsys):
    assert cli.run(["generate", DOMINO, word, experiments]) == 2
    shown = capsys.readouterr().err
    assert told in shown and shown.count("\n") == 1


def test_a_misspelt_base_of_a_task_file_is_named_with_the_file(tmp_path, capsys):
    (tmp_path / "task").mkdir()
    (tmp_path / "task" / "mine.yaml").write_text("defaults: [domino_singel, _self_]\n")
    assert cli.run(["generate", "task=mine", f"hydra.searchpath={tmp_path}"]) == 2
    told = "task/mine.yaml, defaults: no task named 'domino_singel' (did you mean 'domino_single'?)"
    assert told in capsys.readouterr().err


def test_an_error_in_a_task_file_of_ones_own_names_the_file(tmp_path, capsys):
    (tmp_path / "task").mkdir()
    file = tmp_path / "task" / "mine.yaml"
    file.write_text("defaults: [domino_single, _self_]\nid: {tile: {mas: [uniform, 0.03, 0.04]}}\n")
    words = ["task=mine", f"hydra.searchpath={tmp_path}"]
    for verb in ("tasks", "generate"):
        assert cli.run([verb, *words]) == 2
        assert (
            f"{file}: no parameter in mine.id named 'tile.mas' (did you mean 'tile.mass'?)" in capsys.readouterr().err
        )
    file.write_text("defaults: [domino_single, _self_]\n")
    assert cli.run(["generate", *words, "task.id.x=[uniform, 9, 10]"]) == 2
    assert str(file) not in capsys.readouterr().err


def test_an_experiment_without_a_folder_says_where_to_put_it(capsys):
    assert cli.run(["generate", DOMINO, "+experiment=heavy"]) == 2
    assert "give hydra.searchpath=FOLDER, the folder in which experiment/ is" in capsys.readouterr().err


def test_options_of_hydra_show_what_they_show_there(capsys):
    assert cli.run(["generate", DOMINO, "--cfg", "job", "--resolve"]) == 0
    job = capsys.readouterr().out
    assert yaml.safe_load(job)["n"] == 20
    assert cli.run(["generate", DOMINO, "--cfg", "hydra"]) == 0
    own = capsys.readouterr().out
    assert yaml.safe_load(own)["hydra"]["runtime"]["choices"]["task"] == "domino_single"
    assert cli.run(["generate", DOMINO, "--cfg", "all"]) == 0
    assert capsys.readouterr().out == job + own
    assert cli.run(["generate", "--info", DOMINO]) == 0
    assert all(title in capsys.readouterr().out for title in ["Defaults List"])


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("hydra.job.name=x", "leave it out; scengen accepts no setting of Hydra but hydra.searchpath"),
        ("hydra.run.dir=x", "pool= or to= names the folder of the results"),
        ("hydra.sweep.dir=x", "several values make a sweep, as in seed=1,2, and pool= or to= names its folder"),
        ("hydra/launcher=joblib", "workers=N uses the cores of this machine, executor=ray those of a cluster"),
        ("hydra/sweeper=optuna", "several values make a sweep"),
        ("--config-dir=conf", "give hydra.searchpath=FOLDER"),
        ("task.axes.mine={why: a}", "+task.axes.mine={why: ..., replace: {...}} adds an axis"),
        ("task.id.x={a: 1}", "give a number, [uniform, low, high]"),
    ],
)
def test_what_hydra_would_take_is_refused_with_what_to_give_instead(capsys, word, told):
    assert cli.run(["generate", DOMINO, word]) == 2
    shown = capsys.readouterr().err
    assert told in shown and shown.count("\n") == 1
