"""The command line as its users meet it: exit status, one clear line, nothing lost."""

import importlib
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import mujoco
import numpy as np
import pytest
from helpers import REFERENCE
from pools import QUICKLY, make

from scengen import cli, list_tasks, load_task
from scengen.cli import program
from scengen.cli.commands.settings import read
from scengen.cli.completion import completions
from scengen.cli.verbs import RENAMED, file_stem
from scengen.demos.generate import DemosSettings
from scengen.errors import BadConfig
from scengen.evaluate.settings import EvaluateSettings
from scengen.export import recording
from scengen.export.mjcf import export, without_slashes
from scengen.look.looks import PLAIN
from scengen.ood import axis_card
from scengen.ood.discovery import search as discovery
from scengen.pictures import film, render
from scengen.pool import Pool
from scengen.runs import generate
from scengen.samplers import task_files
from scengen.sim import scene_text
from scengen.sim.world import World
from scengen.validate.settings import QUICK

BASE = Path(__file__).parents[1] / "checker" / "base"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cli") / "pool"
    make(folder, n=2)
    return folder


def said(capsys, *argv):
    """Exit status and what stood on standard error."""
    status = cli.run(argv)
    return status, capsys.readouterr().err


GENERATE = ("generate", "task=domino_single")


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (("generat",), "no command named 'generat' (did you mean 'generate'?)"),
        (("generate",), "generate needs task=NAME; known: "),
        (("generate", "task=domino_singel"), "no task named 'domino_singel' (did you mean 'domino_single'?)"),
        ((*GENERATE, "split=diagnal"), "did you mean 'diagonal'"),
        ((*GENERATE, "split=diagonal+diagonal"), "two of its axes move heading"),
        ((*GENERATE, "workrs=2"), "no setting of generate named 'workrs' (did you mean 'workers'?)"),
        ((*GENERATE, "n=many"), "n = 'many'; it must be a whole number"),
        ((*GENERATE, "n=2.5"), "n = 2.5; it must be a whole number"),
        ((*GENERATE, "n=0"), "n = 0; it must be at least 1"),
        ((*GENERATE, "task.id.tile.mass=9"), "domino_single.id.tile.mass = 9 kg; it must lie in [0.005, 0.5] kg"),
        ((*GENERATE, "task.id.tile.mas=0.04"), "no key in task.id.tile named 'mas' (did you mean 'mass'?)"),
        ((*GENERATE, "+task.id.tile.mas=0.04"), "did you mean 'tile.mass'"),
        ((*GENERATE, "task.id.gap_ratio=[unifrm,1,2]"), "no distribution named 'unifrm' (did you mean 'uniform'?)"),
        ((*GENERATE, "task.id.count=[uniform,3,6]"), "it must be a whole number in [2, 15] tiles"),
        ((*GENERATE, "task.axes.wide_gaps.replace.gap_ratio=[uniform,1.1,1.4]"), "touches or overlaps its training"),
        ((*GENERATE, "certify=quik"), "did you mean 'quick'"),
        ((*GENERATE, "certify.robust.run=3"), "did you mean 'runs'"),
        ((*GENERATE, "certify.robust.runs=few"), "certify.robust.runs = 'few'; it must be a whole number"),
        ((*GENERATE, "keep=good"), "keep = good; it must be refuted, unknown, or both"),
        ((*GENERATE, "task.horizon=-1"), "it must be a positive number of seconds"),
        ((*GENERATE, "split=a=b"), "'split=a=b' is not an override"),
        ((*GENERATE, "--workers=2"), "'--workers=2' is not an option"),
        (("verify",), "verify needs pool="),
        (("verify", "pool=nowhere"), "no pool at nowhere"),
        (("show", "pool=nowhere"), "no pool at nowhere"),
        (("export", "pool=nowhere", "to=x"), "no pool at nowhere"),
        (("tasks", "task=domino_singel"), "did you mean 'domino_single'"),
        (("tasks", "axes=papr"), "no choice of axes named 'papr' (did you mean 'paper'?)"),
        (("tasks", "name=domino_single"), "no setting of tasks named 'name'"),
    ],
)
def test_bad_input_ends_in_one_clear_line_and_status_2(capsys, argv, says):
    status, err = said(capsys, *argv)
    assert status == 2 and says in err
    assert err.startswith("scengen: ") and err.count("\n") == 1 and "Traceback" not in err


@pytest.mark.parametrize(("old", "new"), RENAMED.items())
def test_an_old_name_runs_the_new_command_and_says_so(capsys, monkeypatch, old, new):
    run = []
    monkeypatch.setattr(
        import_module(f"scengen.cli.commands.{file_stem(new)}"), "command", lambda arguments: run.append(arguments) or 0
    )
    status, err = said(capsys, old, "pool=here")
    assert status == 0 and run == [["pool=here"]]
    assert err == f"scengen: `{old}` is now `{new}`; the old name goes with 0.4\n"
    assert cli.run(("--help",)) == 0 and f"\n  {old} " not in capsys.readouterr().out
    assert old not in cli.VERBS and old not in completions(f"scengen {old}", cli.VERBS)


@pytest.mark.parametrize("argv", [(), ("--help",), ("--version",), ("tasks", "--help")])
def test_elsewhere_than_on_linux_every_command_warns_in_one_line_and_runs(capsys, monkeypatch, argv):
    monkeypatch.setattr(sys, "platform", "darwin")
    status, err = said(capsys, *argv)
    assert status == 0 and err.startswith("scengen: not tried on darwin: ") and err.count("\n") == 1


def test_a_pool_that_cannot_be_written_is_one_line(capsys, tmp_path):
    (tmp_path / "file").write_text("")
    status, err = said(capsys, *GENERATE, "n=1", f"pool={tmp_path}/file/pool")
    assert status == 2 and "cannot be written" in err


def test_a_damaged_pool_is_shown_and_exported_by_nobody(capsys, made, tmp_path):
    import shutil

    broken = shutil.copytree(made, tmp_path / "broken")
    shard = Path(broken, "scenarios-00000.parquet")
    shard.write_bytes(shard.read_bytes()[:-50])
    assert said(capsys, "show", f"pool={broken}")[0] == 2
    assert said(capsys, "export", f"pool={broken}", f"to={tmp_path / 'out'}")[0] == 2
    status, err = said(capsys, "verify", f"pool={broken}")
    assert status == 1 and "truncated" in err


def test_a_failed_verification_is_status_1(capsys, made, tmp_path):
    import shutil

    broken = shutil.copytree(made, tmp_path / "flipped")
    shard = Path(broken, "scenarios-00000.parquet")
    content = bytearray(shard.read_bytes())
    content[len(content) // 2] ^= 4
    shard.write_bytes(content)
    status, err = said(capsys, "verify", f"pool={broken}", f"json={tmp_path / 'v.json'}")
    assert status == 1 and "REFUTED" in err and "Traceback" not in err
    assert '"failed": [' in (tmp_path / "v.json").read_text()


def test_fewer_than_asked_for_is_status_1_and_keeps_what_there_is(capsys, tmp_path):
    folder = tmp_path / "few"
    hopeless = ("+task.id.slab.mass=0.5", "+task.id.slab.thickness=0.04", "limit=2", "n=2", "keep=unknown")
    status, err = said(capsys, *GENERATE, *QUICKLY, *hopeless, f"pool={folder}")
    assert status == 1 and "only 0 of 2 could be certified among 2 indices" in err
    opened = Pool.open(folder)
    assert len(opened) == 0 and opened.manifest.funnel["not trivial"] == 2
    rejects = list(opened.rejects())
    assert [r.certificate.verdict for r in rejects] == ["unknown", "unknown"]
    assert all("the oracle failed" in r.certificate.reason and len(r.witness) == 0 for r in rejects)


@pytest.mark.parametrize("verb", list(cli.VERBS))
def test_an_interrupted_command_says_whether_it_will_continue(capsys, monkeypatch, verb):
    def interrupted(arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(import_module(f"scengen.cli.commands.{file_stem(verb)}"), "command", interrupted)
    status, text = said(capsys, *verb.split())
    head = task_files.command_file(verb).read_text().split("# Example")[0]
    continues = "to continue" in head
    assert status == 130 and ("is kept" in text) == continues and ("start over" in text) != continues


@pytest.mark.slow
def test_every_lost_draw_is_counted_with_its_reason(capsys, tmp_path):
    """Indices that were drawn again, and one that could not be drawn at all."""
    far = ("task.id.x=[uniform,0.1,0.4]", "+task.id.slab.mass=0.5", "+task.id.slab.thickness=0.04", "limit=3", "n=1")
    assert said(capsys, *GENERATE, *QUICKLY, *far, f"pool={tmp_path / 'far'}")[0] == 1
    opened = Pool.open(tmp_path / "far")
    infeasible = {why: n for why, n in opened.manifest.reasons.items() if why.startswith("feasible: ")}
    lost = opened.manifest.funnel["proposed"] - opened.manifest.funnel["feasible"]
    assert infeasible.keys() == {"feasible: the chain leaves the table"} and sum(infeasible.values()) == lost > 0


@pytest.mark.parametrize("verb", list(cli.VERBS))
def test_every_command_explains_its_settings(capsys, verb):
    assert cli.run((*verb.split(), "--help")) == 0
    out = capsys.readouterr().out
    assert out.startswith(f"# scengen {verb}:") and "=" not in out.split("\n")[0]
    assert cli.run(()) == 0 and verb in capsys.readouterr().out


def test_an_axis_from_the_command_line_is_proved_like_any_other(capsys, tmp_path):
    slick = "+task.axes.slick={why: slippery, replace: {tile: {friction: [uniform, 0.2, 0.3]}}}"
    assert cli.run((*GENERATE, slick, "split=slick", "n=1", *QUICKLY, f"pool={tmp_path / 'slick'}")) == 0
    (row,) = Pool.open(tmp_path / "slick").rows()
    assert row.axes == ("slick",) and row.shifted.keys() == {"tile.friction"}
    assert 0.2 <= row.shifted["tile.friction"] <= 0.3
    same = slick.replace("[uniform, 0.2, 0.3]", "0.5")
    assert said(capsys, *GENERATE, same, "split=slick")[0] == 2


def test_a_finished_pool_does_not_lose_scenarios_by_a_smaller_n(capsys, made):
    there, before = len(Pool.open(made)), Pool.open(made).sha256
    assert cli.run(("generate", "task=domino_single", f"n={there - 1}", f"pool={made}")) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"has {there} scenarios, of which {there - 1} would be left: give n={there} or more" in said
    with pytest.raises(BadConfig, match="would be left"):
        fewer = generate.GenerateSettings(n=there - 1, pool=str(made))
        generate.generate(load_task("domino_single"), QUICK, fewer, lambda *_: None)
    assert Pool.open(made).sha256 == before


def test_show_takes_an_index_in_place_of_an_id(capsys, made):
    *_, row = Pool.open(made).rows()
    assert cli.run(("show", f"pool={made}", f"index={row.index}")) == 0
    assert str(row.name) in capsys.readouterr().out
    for words, says in (
        (("show", f"id={row.id}", "index=0"), "give one of them"),
        (("show", "index=999"), "no scenario has it"),
        (("show", f"index={'9' * 400}"), "; it must be at most 1000000000"),
        (("show", "index=-1"), "index = -1; it must be at least 0"),
        (("show", "view"), "give id=ID or index=N"),
    ):
        assert cli.run((*words, f"pool={made}")) == 2
        assert says in capsys.readouterr().err


def test_show_prints_pools_and_scenarios(capsys, made):
    row = next(Pool.open(made).rows())
    assert cli.run(("show", f"pool={made}")) == 0 and row.id in capsys.readouterr().out
    assert cli.run(("show", f"pool={made}", f"id={row.id[:5]}")) == 0
    out = capsys.readouterr().out
    assert "certified" in out and "gap_ratio" in out and "ablations" in out


def test_tasks_lists_every_task_with_units_bounds_and_proofs(capsys):
    assert cli.run(("tasks",)) == 0
    assert "domino_single" in capsys.readouterr().out
    assert cli.run(("tasks", "task=domino_single")) == 0
    out = capsys.readouterr().out
    assert "tile.mass" in out and "0.005 to 0.5" in out and "stout_starter" in out


@pytest.mark.parametrize("pool", [BASE / "single_severity", BASE / "packing_id", BASE / "shelf_id"])
@pytest.mark.slow
def test_exported_scenes_open_from_anywhere(pool, tmp_path):
    """Jaw, suction cup, and both; in dm_control too, which refuses names with a slash."""
    assert cli.run(("export", f"pool={pool}", f"to={tmp_path / 'out'}")) == 0
    moved = (tmp_path / "out").rename(tmp_path / "elsewhere")
    for row in Pool.open(pool).rows():
        folder = moved / row.id
        alone = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
        whole = mujoco.MjModel.from_xml_path(str(folder / "scene_with_robot.xml"))
        world = World.load(row.scene_xml, row.embodiment, look=PLAIN)
        assert alone.nbody < whole.nbody == world.model.nbody and whole.nq == world.model.nq
        start = mujoco.MjData(whole)
        mujoco.mj_resetDataKeyframe(whole, start, whole.key("home").id)
        assert np.allclose(start.qpos, world.data.qpos, atol=1e-5)
        for text in (folder / "scene.xml").read_text(), (folder / "scene_with_robot.xml").read_text():
            assert str(tmp_path) not in text and not re.search(r' (name|class|mesh|body\d?|joint)="[^"]*/', text)


def test_two_names_that_differ_in_a_slash_alone_are_refused():
    root = ET.fromstring("<mujoco><worldbody><body name='a/b'/><body name='a.b'/></worldbody></mujoco>")
    with pytest.raises(BadConfig, match=r"two names that become 'a\.b'"):
        without_slashes(root)


def test_a_scene_that_is_exported_stands_alone(tmp_path):
    includes = replace(next(Pool.open(REFERENCE).rows()), scene_xml="<mujoco><include file='/etc/passwd'/></mujoco>")
    with pytest.raises(BadConfig, match="contains <include>"):
        export(includes, tmp_path, robot=False)
    assert not list(tmp_path.iterdir())


def test_a_contact_sheet_shows_every_scene_or_says_why_not(made, tmp_path):
    page = tmp_path / "sheet.html"
    assert cli.run(("show", f"pool={made}", f"to={page}", "films=true")) == 0
    text = page.read_text()
    assert all(row.id in text for row in Pool.open(made).rows())
    assert (text.count("data:image/webp") == 4) != ("No pictures: no OpenGL" in text), "scene and film, twice"


def test_a_contact_sheet_shows_the_training_twin_and_what_has_moved(tmp_path):
    pool, page = BASE / "single_severity", tmp_path / "sheet.html"
    assert cli.run(("show", f"pool={pool}", f"to={page}", "films=false")) == 0
    text = page.read_text()
    assert (
        "gap ratio 1.476 tile widths (training 0.6 to 1.2)" in text and "later, lower and with a smaller margin" in text
    )
    assert (text.count("data:image/webp") == 2) != ("No pictures: no OpenGL" in text)
    assert text.count('<span class="badge passed">witness</span>') == 1, "what all certificates share is one line"


def test_a_film_strip_shows_something_or_the_error_names_the_remedy(made, capsys, tmp_path):
    row = next(Pool.open(made).rows())
    try:
        scenario = load_task(row.task).scenario(row.params)
        picture = film.strip(film.Take.witness(row, scenario), frames=4)
    except render.NoPictures as error:
        assert "libegl1" in str(error)
    else:
        first, last = picture[:, :320].astype(int), picture[:, -320:].astype(int)
        assert picture.shape[0] > 240 and picture.shape[1:] == (1280, 3), "the means of the task are below"
        assert picture.std() > 20
        assert np.abs(first - last).max() > 50, "the arm moves and tiles fall"


@pytest.mark.parametrize(
    ("verb", "kind", "given"),
    [
        ("generate", generate.GenerateSettings, {}),
        ("demos", DemosSettings, {}),
        ("axis card", axis_card.AxisSettings, {"axis": "diagonal"}),
        ("axis discover", discovery.DiscoverSettings, {}),
        ("evaluate", EvaluateSettings, {"policy": "idle", "pool": "here"}),
        ("record", recording.RecordSettings, {"pool": "here", "to": "there"}),
    ],
)
def test_python_and_the_command_line_have_the_same_defaults(verb, kind, given):
    task = ["task=domino_single"] if verb in ("generate", "demos", "axis card", "axis discover") else []
    assert read(verb, [*task, *(f"{name}={value}" for name, value in given.items())], kind) == kind(**given)


def test_it_runs_from_any_folder_as_a_module(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "scengen", "--version"], cwd=tmp_path, capture_output=True, text=True, env=os.environ
    )
    assert done.returncode == 0 and f"mujoco {mujoco.__version__}" in done.stdout


def test_a_back_end_that_mujoco_does_not_have_is_told_by_name():
    env = {**os.environ, "MUJOCO_GL": "vulkan"}
    done = subprocess.run([sys.executable, "-m", "scengen", "tasks"], capture_output=True, text=True, env=env)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 2 and "MUJOCO_GL=vulkan" in line and "unset MUJOCO_GL" in line


def test_another_error_before_mujoco_is_imported_is_not_its_back_ends(monkeypatch, capsys):
    monkeypatch.setattr(program, "_run", len)  # a fault of our own: two arguments
    monkeypatch.setenv("MUJOCO_GL", "egl")  # which scengen itself sets without a display
    monkeypatch.delitem(sys.modules, "mujoco")
    assert cli.run(["tasks"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "unforeseen TypeError: len() takes" in line and "MUJOCO_GL" not in line


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<mujoco", "not well-formed XML"),
        ("<robot/>", "expected <mujoco>"),
        ("<!DOCTYPE m [<!ENTITY a 'b'>]><mujoco>&a;</mujoco>", "document type or entities"),
        ("<mujoco><include file='x.xml'/></mujoco>", "contains <include>"),
        ("<mujoco><asset><mesh file='/etc/passwd'/></asset></mujoco>", "reads '/etc/passwd'"),
        ("<mujoco><asset><texture fileright='a.png'/></asset></mujoco>", "must stand alone"),
        ("<mujoco><compiler meshdir='/'/></mujoco>", "must stand alone"),
        ("<mujoco><extension><plugin plugin='p'/></extension></mujoco>", "contains <extension>"),
        ("<mujoco><asset><model file='a.xml' name='b'/></asset></mujoco>", "must stand alone"),
    ],
)
def test_a_scene_that_reaches_outside_itself_is_refused(text, says):
    with pytest.raises(BadConfig, match=says):
        scene_text.check(text)


def test_every_task_file_is_found_without_registration():
    files = {path.stem for path in (task_files.conf_dir() / "task").glob("*.yaml")}
    assert set(list_tasks()) == files and "domino_single" in files


def test_a_run_that_fails_says_why_while_it_fails_and_when_it_is_interrupted(monkeypatch, capsys, tmp_path):
    run = importlib.import_module("scengen.cli.commands.generate")
    notes = []

    def fails(task, certify_settings, settings, progress):
        for done in (1, 2, 3):
            progress(0, done, {"unknown": done - 1, "refuted": 1}, {"solved: the hand": done - 1, "rest: it fell": 1})
        raise KeyboardInterrupt

    monkeypatch.setattr(run, "generate", fails)
    monkeypatch.setattr("scengen.runs.progress.ProgressBar.show", lambda self, done, note="": notes.append(note))
    status, told = said(capsys, *GENERATE, f"pool={tmp_path / 'pool'}")
    assert notes[-1] == "3 tried, 1 refuted, 2 unknown (2x solved: the hand)"
    assert status == 130 and told.splitlines()[:2] == ["scengen: 2x solved: the hand", "scengen: 1x rest: it fell"]
    assert "finished work is kept" in told.splitlines()[2]


def test_reasons_are_counted_with_those_of_an_earlier_run(tmp_path):
    told = []
    task = load_task("domino_single", ["task.horizon=0.5"])
    for limit in (1, 2):
        settings = generate.GenerateSettings(n=1, limit=limit, pool=str(tmp_path / "pool"))
        generate.generate(task, QUICK, settings, lambda *all: told.append(all))
    assert [(finished, dict(reasons)) for _, finished, _, reasons in told][-1] == (2, {told_reason(told): 2})


def told_reason(told):
    ((reason, _),) = told[-1][3].items()
    assert reason.startswith("solved: the oracle failed: ") and "#" in reason
    return reason


def test_a_remedy_can_be_followed(tmp_path, capsys):
    """An axis that the command line adds cannot be deleted from the file, and a package has to be installed."""
    axis = "+task.axes.near={why: w, source: s, replace: {heading: [uniform, 0.0, 0.1]}}"
    assert cli.run(["generate", "task=domino_single", "split=near", axis]) == 2
    assert "leave +task.axes.near out, or give ~task.axes.near if the task file has it" in capsys.readouterr().err
    assert cli.run(["new", "task=slide_home", "package=lab_tasks", f"to={tmp_path / 'lab'}"]) == 0
    assert cli.run(["tasks", "task=slide_home", f"hydra.searchpath=[file://{tmp_path}/lab/lab_tasks/conf]"]) == 2
    assert "No module named 'lab_tasks'; install the package, as with pip install --editable" in capsys.readouterr().err


def test_a_shortcut_that_never_rests_gets_a_remedy(monkeypatch, capsys, tmp_path):
    import scengen.cli.commands.generate as command

    def rejected(task, certify_settings, settings, progress):
        pool = Pool.open("generated/reference/domino_single-id")
        reasons = {"shortcuts: 'spin' was not seen to its end (raw): the goal was not reached in # s": 3}
        return generate.Summary(pool, 1, 4, pool.manifest.funnel, reasons, 1, None, 1.0)

    monkeypatch.setattr(command, "generate", rejected)
    assert cli.run(["generate", "task=domino_single", "n=1", f"pool={tmp_path / 'p'}"]) == 0
    assert "leave to_rest out" in capsys.readouterr().out.replace("\n", " ")


INSIDE_C = """
import ctypes, signal, time
from scengen.cli.program import Signals
signals = Signals()
signals.working = True
try:
    ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGTERM))()
    time.sleep(5)
except KeyboardInterrupt:
    print("ended in order", signals.status)
"""


def test_an_interruption_in_a_function_that_c_has_called_is_not_lost():
    """C ignores errors, and Python would print a traceback: a compiler that was interrupted would go on."""
    done = subprocess.run([sys.executable, "-c", INSIDE_C], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("ended in order 143\n", "")


def test_a_warning_is_a_line_without_a_place_in_the_code(capsys):
    program.print_warning(UserWarning("made on version 1"), UserWarning, "pools.py", 34)
    program.print_warning(DeprecationWarning("old"), DeprecationWarning, "pools.py", 34)
    assert capsys.readouterr().err == "scengen: made on version 1\npools.py:34: DeprecationWarning: old\n"
