"""What people who know Hydra try: lists of values, --cfg and --info, completion, examples in every help."""

import os
import re
import shlex
import shutil
import subprocess

import pytest
import yaml
from helpers import REFERENCE
from pools import QUICKLY

from scengen import cli, compose
from scengen.cli.commands import generate
from scengen.cli.commands.settings import read_task
from scengen.cli.completion import BASH, completions
from scengen.cli.usage import usage
from scengen.cli.verbs import parsed
from scengen.errors import BadConfig, UnknownName
from scengen.pool import Pool
from scengen.samplers import task_files

DOMINO = "task=domino_single"


def said(capsys, *argv):
    status = cli.run(argv)
    return status, capsys.readouterr()


# --- several values -------------------------------------------------------------------------


def test_lists_and_hydras_own_words_are_combined():
    found = compose.combinations("generate", ["task=glob(balance_*)", "split=id,turned", "n=3", "seed=range(0,2)"])
    assert len(found) == 8 and len({one.overrides for one in found}) == 8
    assert found[0].swept == {"task": "balance_hard", "split": "id", "seed": "0"} and "n=3" in found[0].overrides
    mass = compose.combinations("generate", [DOMINO, "task.id.tile.mass=[uniform,0.03,0.04],0.05"])
    assert [one.swept["task.id.tile.mass"] for one in mass] == ["[uniform,0.03,0.04]", "0.05"]
    (alone,) = compose.combinations("generate", [DOMINO, "keep=refuted,unknown", "task.id.tile.mass=[uniform,1,2]"])
    assert not alone.swept, "these are lists, and no sweeps"


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        (("task=domino_single,packing", "split=id,tigt"), "split=tigt: no split of"),
        ((DOMINO, "split=id,diagonl"), "split=diagonl: no split of domino_single named 'diagonl' (did you mean 'diag"),
        (("task=packing,nothing",), "task=nothing: no task named 'nothing'"),
        ((DOMINO, "n=1,0"), "n=0: n = 0; it must be at least 1"),
        ((DOMINO, "seed=1,1"), "2 of the combinations would be written to"),
        ((DOMINO, "seed=range(0,100000)"), "combinations of settings; give at most 1000 at once"),
        ((DOMINO, "task.id.x=interval(0,1)"), "Can only enumerate"),
        (("task=glob(none_*)",), "has no value; give at least one"),
    ],
)
def test_a_combination_that_makes_no_sense_is_one_line_before_anything_is_made(capsys, tmp_path, asked, says):
    status, shown = said(capsys, "generate", *asked, f"pool={tmp_path / 'many'}")
    assert status == 2 and says in shown.err and shown.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("asked", "says"),
    [("runs=choice(1,2)", "repeat the command for each value of runs"), ("split=id,id", "give each value once")],
)
def test_demonstrations_of_a_sweep_that_would_share_a_folder_get_a_remedy(capsys, tmp_path, asked, says):
    status, shown = said(capsys, "demos", DOMINO, asked, f"to={tmp_path / 'many'}")
    told = f"2 of the combinations would be written to {tmp_path / 'many' / 'domino_single-id'}; {says}"
    assert status == 2 and told in shown.err and not list(tmp_path.iterdir())


def test_an_axis_of_another_task_of_a_sweep_is_left_out_and_told(capsys):
    asked = compose.combinations("generate", ["task=domino_single,packing", "split=id,tight"])
    kept, runs = generate._valid_runs(asked)
    assert [(run.task.name, run.settings.split) for run in runs] == [
        ("domino_single", "id"),
        ("packing", "id"),
        ("packing", "tight"),
    ]
    assert len(kept) == 3 and "left out, because the task has no such split: task=domino_single split=tight" in (
        capsys.readouterr().err
    )


def test_pools_that_are_told_apart_in_their_own_names_have_these_names(tmp_path):
    for named, told in {"${split}/${task}": "{0}/domino_single", "all": "all/domino_single-{0}"}.items():
        asked = compose.combinations("generate", [DOMINO, "split=id,wide_gaps", f"pool={tmp_path / named}"])
        runs = generate._with_folders(*generate._valid_runs(asked))
        assert [run.settings.pool for run in runs] == [str(tmp_path / told.format(s)) for s in ("id", "wide_gaps")]


def test_a_sweep_is_not_written_into_a_pool(capsys, tmp_path):
    pool = shutil.copytree(REFERENCE, tmp_path / "pool")
    status, shown = said(capsys, "generate", DOMINO, "split=id,wide_gaps", f"pool={pool}")
    assert status == 2 and f"{pool} is a pool already (manifest.json); choose another pool=" in shown.err


@pytest.mark.slow
def test_a_sweep_makes_a_pool_for_each_combination_and_is_continued(capsys, tmp_path, monkeypatch):
    asked = ("generate", "-m", DOMINO, "split=id,wide_gaps", "n=1", *QUICKLY, f"pool={tmp_path}")
    assert said(capsys, *asked)[0] == 0
    pools = {name: Pool.open(tmp_path / f"domino_single-{name}") for name in ("id", "wide_gaps")}
    assert {name: pool.split for name, pool in pools.items()} == {"id": "id", "wide_gaps": "wide_gaps"}
    hashes = [pool.sha256 for pool in pools.values()]
    shutil.rmtree(pools["wide_gaps"].folder)
    monkeypatch.setattr("scengen.runs.generate.certify", None)  # nothing needs to be certified again
    status, shown = said(capsys, *asked)
    assert status == 0 and "1 of 1" in shown.out.split("2 pools")[-1]
    assert [Pool.open(pool.folder).sha256 for pool in pools.values()] == hashes


def test_other_commands_say_that_they_take_one_value(capsys):
    status, shown = said(capsys, "axis", "shrink", DOMINO, "index=0,1")
    assert status == 2 and "axis shrink takes one at a time (generate and demos take several)" in shown.err
    assert "for x in 0 1; do scengen axis shrink ... index=$x json=NAME-$x; done" in shown.err


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        (
            ("train", "-m", "data=x", "seed=range(1,20)"),
            "for x in 1 2 3 4 5 ...; do scengen train ... seed=$x to=NAME-$x",
        ),
        (("attack", DOMINO, "seed=1,2"), "do scengen attack ... seed=$x to=NAME-$x; done"),
        (("evaluate", "policy=a,b", "seeds=3,5"), "for x in 3 5; do scengen evaluate ... seeds=$x to=NAME-$x; done"),
        (("try", DOMINO, "index=interval(0,1)"), "for x in VALUE; do scengen try ... index=$x; done"),
        (("train", "data=x", "to=y", "policy=bc,mip"), "give one of them, and repeat the command for the others"),
        (("generate", DOMINO, "perturb=[a@1,b@1]"), "parts are joined by +; give perturb=a@1+b@1"),
        (("generate", DOMINO, "split=[diagonal,wide_gaps]"), "parts are joined by +; give split=diagonal+wide_gaps"),
        (("generate", DOMINO, "split=[id,diagonal]"), ": split=id,diagonal without brackets makes a run of each"),
        (("generate", DOMINO, "split=id,diagonal", "hydra.mode=MULTIRUN"), "scengen: 'hydra.mode=MULTIRUN': leave it"),
        (("generate", DOMINO, "certify=mine"), "hydra.searchpath=FOLDER adds the folder that holds your certify/NAME"),
        (("generate", DOMINO, "certify=full", "certify.robust.bound=0.4"), "level full have 0.8 or more"),
        (("generate", DOMINO, "task.id.x=uniform(0.1,0.2)"), "; give 'task.id.x=[uniform,0.1,0.2]'"),
        (("generate", DOMINO, "+task.axes.x={why: a, replace: {}"), "a bracket is not closed: } is missing"),
        (("generate", DOMINO, "--cfg", "job", "-p", "certify"), "--cfg shows the whole configuration; leave -p out"),
    ],
)
def test_several_values_where_one_is_taken_have_a_remedy(asked, says, capsys):
    status, shown = said(capsys, *asked)
    assert status == 2 and says in shown.err and shown.err.count("\n") == 1


# --- what a command would work with ----------------------------------------------------------


def test_cfg_job_is_what_the_command_works_with(capsys):
    asked = ("task=seesaw_balance", "n=3", "certify.robust.runs=5", "task.id.x=0.01")
    status, shown = said(capsys, "generate", *asked, "--cfg", "job")
    plain = yaml.safe_load(shown.out)
    settings, task, certify_settings = read_task("generate", asked, generate.GenerateSettings)
    assert status == 0 and plain["n"] == settings.n == 3 and plain["task"]["id"]["x"] == 0.01
    assert plain["certify"]["robust"]["runs"] == certify_settings.robust.runs == 5
    assert plain["certify"]["rest"] == vars(certify_settings.rest), "with what the task's file changes"
    assert plain["task"]["horizon"] == task.horizon


def test_info_tells_where_it_comes_from(capsys):
    assert "limits/packing" in said(capsys, "generate", "task=packing", "--info", "defaults")[1].out
    assert (
        "command/generate:\n    task: packing"
        in said(capsys, "generate", "--info=defaults-tree", "task=packing")[1].out
    )
    assert f"file://{task_files.conf_dir()}" in said(capsys, "generate", "task=packing", "-i", "searchpath")[1].out


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        (("--cfg", "jobs"), "expected --cfg job"),
        (("--cfg",), "expected --cfg job"),
        (("--info", "default"), "did you mean 'defaults'?"),
        (("--cfg", "job", "--info", "defaults"), "give one of them"),
        (("--nope",), "'--nope' is not an option"),
        (("workrs=2", "--cfg", "job"), "did you mean 'workers'?"),
    ],
)
def test_options_that_do_not_exist_are_one_line(capsys, asked, says):
    status, shown = said(capsys, "generate", DOMINO, *asked)
    assert status == 2 and says in shown.err and shown.err.count("\n") == 1


# --- help and completion ---------------------------------------------------------------------


@pytest.mark.parametrize("verb", cli.VERBS)
def test_every_help_has_an_example_that_can_be_composed(verb):
    text = usage(verb, [DOMINO])
    (example,) = re.findall(r"^# Example: (scengen .*)$", text, re.M)
    text = re.sub(r"\s*\n# {2,}", " ", text)  # lines are as wide as the terminal
    program, *words = shlex.split(example)
    given, overrides = parsed(words)
    assert (program, given) == ("scengen", verb)
    for one in compose.combinations(verb, overrides) if verb == "generate" else [overrides]:
        compose.as_yaml(verb, getattr(one, "overrides", one))
    takes_task = "task" in task_files.groups(verb)
    assert takes_task == ("stout_starter turned_slab" in text) == ("+task.axes.NAME" in text)
    assert ("certify.robust.runs=4" in text) == ("certify" in task_files.groups(verb))
    assert ("hydra.searchpath=" in text) == (takes_task or bool(re.search("^(pool|hits|replay):", text, re.M)))


def test_the_help_of_a_chosen_task_tells_its_splits_alone():
    text = usage("generate", ["task=packing"])
    assert "four_pieces tight" in text and "turned_slab" not in text
    with pytest.raises(UnknownName, match="no task named 'packin' .*hydra.searchpath=FOLDER adds"):
        usage("generate", ["task=packin"])


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("scengen gen", ["generate"]),
        ("scengen generate task=dom", ["task=domino_select", "task=domino_single"]),
        ("scengen generate task=domino_single,pac", ["task=domino_single,packing"]),
        ("scengen generate task=packing split=t", ["split=tight", "split=turned_bin", "split=thin_heavy"]),
        ("scengen generate task=packing split=tight+l", ["split=tight+large_turns", "split=tight+large_pieces"]),
        ("scengen axis card task=packing axis=i", []),
        ("scengen ax", ["axis"]),
        ("scengen axis d", ["discover"]),
        ("scengen show f", ["film", "films="]),
        ("scengen generate wor", ["workers="]),
        ("scengen generate task=packing certify=", ["certify=full", "certify=quick"]),
        ("scengen generate task=packing certify.robust.r", ["certify.robust.runs="]),
        (f"scengen show pool={REFERENCE} id=8e", ["id=8ed4a4577fe0"]),
        (f"scengen show pool={REFERENCE} id=domino_single/id@0", ["id=domino_single/id@0/8ed4a4577fe0"]),
        ("scengen show pool=nowhere id=8e", []),
        ("scengen verify hyd", []),
        ("scengen nothing x", []),
    ],
)
def test_completion_knows_commands_settings_tasks_splits_and_ids(line, found):
    assert completions(line, cli.VERBS) == found


def test_bash_gets_what_comes_after_its_own_word_breaks(tmp_path):
    (tmp_path / "scengen").write_text("#!/bin/sh\nprintf 'task=domino_select\\ntask=domino_single\\n'\n")
    (tmp_path / "scengen").chmod(0o755)
    line = "scengen generate task=dom"
    typed = f"{BASH}\nCOMP_LINE='{line}'; COMP_POINT={len(line)}; _scengen; echo ${{COMPREPLY[@]}}"
    path = f"{tmp_path}:/usr/bin:/bin"
    done = subprocess.run(["bash", "-c", typed], capture_output=True, text=True, env={"PATH": path})
    assert done.stdout.split() == ["domino_select", "domino_single"] and not done.stderr


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (("verify", "mujoco", "mujoco.x=1"), "mujoco.x: mujoco has no settings in it; give mujoco=... alone"),
        (("new", "task=all", "package=p"), "task = all; give a word"),
        (("generate", "task=domino_single", "n=1", "~certify.robust"), "certify.robust cannot be deleted"),
        (("evaluate", "~client.x"), "client.x cannot be deleted"),
        (("report", "~budget"), "no setting of report named 'budget'"),
        (("report", "~n.n"), "no setting of report named 'n'"),
        (("attack", "pool=x", "task.horizon=3"), "task.horizon: no task is chosen; give task=NAME, too"),
        (("curate", "stats", "data=x", "executor=null"), "no setting of curate stats named 'executor'"),
        (("generate", "task=domino_single", "executor=null"), "leave it out, or name a file of conf/executor"),
        (("generate", "task=domino_single", f"seed={'9' * 5000}"), "a number of more than 4300 digits"),
        (("agent", "key=a=b"), "quote the value twice: 'key=\"a=b\"'"),
        (("show", "look=x{y"), "quote the value twice: 'look=\"x{y\"'"),
        (("generate", "+task.axes.x={why:", "new}"), "put all of it in single quotes, '+task.axes.x=...'"),
        (("generate", "task.id.x=[uniform,", "0,", "1]"), "put all of it in single quotes, 'task.id.x=...'"),
        (
            ("generate", "+task.axes.x={why: it is heavy; so}"),
            'double quotes around texts within it, as in {why: "a; b"}',
        ),
        (("generate", "task=packing n=2"), "these are 2 settings: give task=packing n=2"),
        (("generate", "task=[packing,cup_extract]"), "is a list; give task=packing,cup_extract without brackets"),
        (("evaluate", "policy=idle", "edition=v1,v2"), "edition = v1,v2; give one of them"),
        (("generate", "task=packin", "--help"), "(did you mean 'packing'?)"),
        (("generate", "task=domino_single", "task.horizon.x=3"), "task.horizon has no settings in it"),
    ],
)
def test_values_and_deletions_that_hydra_takes_otherwise_have_a_remedy(argv, says, capsys):
    assert cli.run(argv) == 2
    told = capsys.readouterr().err
    assert says in told and told.count("\n") == 1


@pytest.mark.parametrize("argv", [("curate", "data=x"), ("verify", "pool=x"), ("record", "pool=x", "to=y")])
def test_a_number_of_workers_is_limited_in_every_command(argv, capsys):
    assert cli.run((*argv, "workers=100000000")) == 2
    assert "workers = 100000000; it must be at most 256" in capsys.readouterr().err


def test_pipes_and_endless_files_among_tasks_are_passed_over_or_refused(tmp_path, capsys):
    tasks = tmp_path / "task"
    tasks.mkdir()
    os.mkfifo(tasks / "piped.yaml")
    given = ("tasks", f"hydra.searchpath=[file://{tmp_path}]")
    assert cli.run(given) == 0
    with open(tasks / "endless.yaml", "wb") as file:
        file.truncate(10**12)
    capsys.readouterr()
    assert cli.run(given) == 2
    assert "endless.yaml has 1000000000000 bytes; a task file has at most" in capsys.readouterr().err


@pytest.mark.parametrize("words", ["tasks task=packing", ["evaluate", pytest]])
def test_what_is_no_list_of_texts_is_told(capsys, words):
    assert cli.run(words) == 2 and "give the command as a list of texts" in capsys.readouterr().err


def test_tasks_of_a_category_are_listed_alone(capsys):
    status, shown = said(capsys, "tasks", "task=P3")
    assert status == 0 and shown.out.startswith("6 tasks") and "packing" not in shown.out
    status, shown = said(capsys, "tasks", "task=P9")
    assert status == 2 and "no category named 'P9'" in shown.err
    status, shown = said(capsys, "generate", DOMINO, "split=id,diagonal", "--cfg", "job")
    assert status == 2 and "one combination is shown at a time; give one" in shown.err


@pytest.mark.parametrize("search", ["folder", ["folder"]])
def test_a_search_path_without_its_setting_is_not_ignored(search):
    with pytest.raises(BadConfig, match="search = folder; give a list of overrides, as in .'hydra.searchpath=FOLDER'"):
        compose.load_task("domino_single", search)
