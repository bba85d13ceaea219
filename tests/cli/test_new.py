"""scengen new: what it writes works as it stands, under any name; bad input is one line, and nothing is overwritten."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import scengen
from scengen import cli
from scengen.cli.commands import new


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The folder of a package with names that are not those of the template."""
    folder = tmp_path_factory.mktemp("new") / "lab"
    assert cli.run(("new", "task=slide_home", "package=lab_tasks", f"to={folder}")) == 0
    return folder


def test_every_name_of_the_template_is_replaced(written):
    files = {str(p.relative_to(written)): p.read_text() for p in written.rglob("*") if p.is_file()}
    assert files.keys() == {
        "README.md",
        "pyproject.toml",
        "lab_tasks/__init__.py",
        "lab_tasks/slide_home.py",
        "lab_tasks/conf/task/slide_home.yaml",
        "tests/test_slide_home.py",
    }
    whole = "\n".join(files.values())
    assert not [name for name in ("push_off", "PushOff", "push-off", "my_tasks", "my-tasks") if name in whole]
    assert "class SlideHome(Scenario)" in whole and "# slide-home" in whole


def test_the_entry_point_names_the_folder_of_the_task_file(written):
    told = tomllib.loads((written / "pyproject.toml").read_text())["project"]
    (where,) = told["entry-points"]["scengen.tasks"].values()
    assert (written / where.replace(".", "/") / "task" / "slide_home.yaml").is_file()
    ours = tomllib.loads((Path(scengen.__file__).parents[1] / "pyproject.toml").read_text())["project"]
    assert told["name"] == "lab-tasks" and told["requires-python"] == ours["requires-python"]


@pytest.mark.parametrize("which", ["not certified", pytest.param("certified", marks=pytest.mark.slow)])
def test_its_tests_pass(written, which):
    """In a separate process, from its folder, as its README says; certificates under `make slow`."""
    env = {**os.environ, "PYTHONPATH": str(Path(scengen.__file__).parents[1])}
    argv = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", which)
    done = subprocess.run(argv, cwd=written, env=env, capture_output=True, text=True)
    assert done.returncode == 0 and " passed" in done.stdout, done.stdout + done.stderr


def test_a_new_name_that_contains_an_old_one_is_not_replaced_twice():
    assert new._renamed("push_off in my_tasks", new._names("my_tasks_push", "push_off")) == "my_tasks_push in push_off"


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (("task=push_off",), "new needs package=..."),
        (("task=x", "package=numpy"), "package = numpy; a package of that name is installed"),
        (("task=x", "package=json"), "package = json; a package of that name is installed"),
        (("task=x", "package=tests"), "package = tests; give a word of at most 60 letters in snake_case"),
        (("task=domino_single", "package=x"), "a task of that name exists; give another name, see scengen tasks"),
        (("task=Push-Off", "package=x"), "task = Push-Off; give a word of at most 60 letters in snake_case"),
        (("task=../up", "package=x"), "task = ../up; give a word"),
        (("task=class", "package=x"), "task = class; give a word"),
        (("task=conf", "package=x"), "task = conf; give a word"),
        (("task=" + "a" * 61, "package=x"), "give a word of at most 60 letters"),
        (("task=x", "pakage=x"), "no setting of new named 'pakage' (did you mean 'package'?)"),
        (("task=x", "package=x", f"to={__file__}"), "is a file; name a folder"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(capsys, tmp_path, monkeypatch, argv, says):
    monkeypatch.chdir(tmp_path)
    assert cli.run(("new", *argv)) == 2
    told = capsys.readouterr().err
    assert says in told and told.count("\n") == 1 and not list(tmp_path.iterdir())


def test_a_package_that_a_kill_has_cut_short_is_completed(capsys, tmp_path):
    command = ("new", "task=slide_home", "package=lab_tasks", f"to={tmp_path / 'new'}")
    assert cli.run(command) == 0
    whole = {path: path.read_bytes() for path in (tmp_path / "new").rglob("*") if path.is_file()}
    first, second, *_ = sorted(whole)
    first.unlink()
    second.rename(f"{second}.part")
    assert cli.run(command) == 0
    assert {path: path.read_bytes() for path in (tmp_path / "new").rglob("*") if path.is_file()} == whole


def test_a_folder_that_is_not_empty_stays_as_it_is(capsys, tmp_path):
    (tmp_path / "README.md").write_text("mine")
    assert cli.run(("new", "task=slide_home", "package=lab_tasks", f"to={tmp_path}")) == 2
    assert "is not empty: it holds README.md; give a new folder as to=FOLDER" in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["README.md"] and (tmp_path / "README.md").read_text() == "mine"
