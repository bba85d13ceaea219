"""An axis for a task of scengen, kept in a file of one's own that continues the task's file."""

import pytest

from scengen import cli
from scengen.samplers import task_files

FILE = """
defaults: [domino_single, _self_]
axes:
  heavy_tiles:
    why: The tiles are heavier than any in training.
    source: ours
    replace:
      tile:
        mass: [uniform, 0.065, 0.075]
"""


@pytest.fixture
def search(tmp_path):
    """The override that finds the file."""
    (tmp_path / "conf" / "task").mkdir(parents=True)
    (tmp_path / "conf" / "task" / "domino_mine.yaml").write_text(FILE)
    return f"hydra.searchpath=[file://{tmp_path}/conf]"


def test_tasks_generate_and_verify_take_the_file_alike(search, tmp_path, capsys):
    task, pool = "task=domino_mine", f"pool={tmp_path / 'pool'}"
    assert cli.run(["tasks", task, search]) == 0
    assert "heavy_tiles" in capsys.readouterr().out
    assert cli.run(["tasks", search]) == 0
    assert "domino_mine" in capsys.readouterr().out
    few = ("certify.robust.runs=1", "certify.robust.bound=0.04")
    assert cli.run(["generate", task, "split=heavy_tiles", "n=1", pool, search, *few]) == 0
    assert cli.run(["verify", pool, "level=replay", search]) == 0
    assert cli.run(["try", task, "split=heavy_tiles", search]) == 0


def test_what_the_file_says_lies_over_what_its_base_says(search):
    of_file, of_base = (task_files.about(name, [search]) for name in ("domino_mine", "domino_single"))
    assert of_file.axes == (*of_base.axes, "heavy_tiles")
    assert (of_file.code, of_file.instruction) == (of_base.code, of_base.instruction)


@pytest.mark.parametrize(
    ("defaults", "told"),
    [
        ("[domino_singel, _self_]", "no task named 'domino_singel' (did you mean 'domino_single'?)"),
        ("[domino_mine, _self_]", "is its own base; name other files in its defaults"),
        ("{a: 1}", "expected a list of tasks, and _self_"),
        ("[1]", "expected a list of tasks, and _self_"),
    ],
)
def test_a_base_that_is_none_is_one_line(search, tmp_path, capsys, defaults, told):
    (tmp_path / "conf" / "task" / "domino_mine.yaml").write_text(FILE.replace("[domino_single, _self_]", defaults))
    task_files._head.cache_clear()
    assert cli.run(["tasks", search]) == 2
    line = capsys.readouterr().err
    assert told in line and line.count("\n") == 1


@pytest.mark.parametrize(
    ("file", "told"),
    [
        ("task/domino_single.yaml", "scengen's task domino_single has its own files; name it after a task of your own"),
        ("language/domino_single.yaml", "which `defaults: [domino_single, _self_]` continues"),
        ("language/domino_mien.yaml", "its folder has no task/domino_mien.yaml; name it after a task there"),
        ("things/packing.yaml", "scengen's task packing has its own files"),
        ("certify/quick.yaml", "scengen has a file of that name; give it another name"),
        ("perturbations/dust.yaml", "offer the folder by an installed package"),
    ],
)
def test_a_file_that_nothing_would_read_is_refused(search, tmp_path, capsys, file, told):
    (path := tmp_path / "conf" / file).parent.mkdir(exist_ok=True)
    path.write_text("a: 1\n")
    assert cli.run(["tasks", search]) == 2
    line = capsys.readouterr().err
    assert f"{file} would not be read, " in line.replace("read;", "read, ") and told in line and line.count("\n") == 1


def test_a_copy_of_a_file_and_the_words_of_a_task_of_its_own_are_accepted(search, tmp_path):
    for group, name in (("task", "packing"), ("language", "domino_single")):
        (path := tmp_path / "conf" / group / f"{name}.yaml").parent.mkdir(exist_ok=True)
        path.write_bytes((task_files.conf_dir() / group / f"{name}.yaml").read_bytes())
    (tmp_path / "conf" / "language" / "domino_single.yaml").rename(tmp_path / "conf" / "language" / "domino_mine.yaml")
    assert cli.run(["tasks", search]) == 0
    assert task_files.file_of_group("domino_mine", "language", [search]) is not None
