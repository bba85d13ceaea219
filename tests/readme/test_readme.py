"""Every command of the pages exists with its settings; `make readme` runs them."""

import re
import shlex

import pytest
from helpers import REFERENCE
from readme.commands import APART, PAGES, QUOTED, ROOT, commands, globbed, why_apart
from readme.run import run

from scengen import cli, compose
from scengen.cli.verbs import parsed

LINES = [
    line
    for line in commands(
        *PAGES, *(ROOT / path for path in ("docs/axis.md", "docs/measure.md", "task_template/README.md"))
    )
    if line.startswith("scengen ") and "/path/to/" not in line  # tests/cli/test_own_axis.py has these with a folder
]


def test_no_shell_changes_a_command_that_is_pasted():
    """zsh would take brackets for patterns of files. Other programs than scengen may use pipes and variables."""
    pages = [*PAGES, *sorted((ROOT / "docs").rglob("*.md")), ROOT / "CONTRIBUTING.md"]
    lines = {line for line in commands(*pages) if re.match("(scengen|pytest|make|pip) ", line)}
    assert len(lines) > 80 and {line: globbed(line) for line in lines if globbed(line)} == {}
    inline = re.findall("`(scengen [^`]*)`", "".join(page.read_text() for page in pages))
    assert len(inline) > 80 and [line for line in inline if re.search(r"=\S*\[", QUOTED.sub("", line))] == []
    assert globbed("scengen generate task.id.x=[uniform,0,1]") == "[" and globbed("scengen show to=~/x") == "~"
    assert not globbed("scengen generate 'task.id.x=[uniform,0,1]' split=a@3+b    # (a comment) *")


def test_the_readme_has_no_comments_behind_commands():
    """zsh gives them to the command unless it is told otherwise, with what `;` and brackets do in them."""
    assert [line for line in commands(ROOT / "README.md") if "#" in line] == []


def test_what_is_left_out_is_there():
    """A reason that outlives its command would hide the next one that starts so."""
    assert all(any(command.startswith(start) for command in commands()) for start in APART)
    assert sum(not why_apart(command) for command in commands()) > 15, "most of what is cheap is run"


@pytest.mark.parametrize("line", LINES)
def test_every_setting_of_a_command_exists(line, monkeypatch):
    verb, words = parsed(shlex.split(line, comments=True)[1:])
    assert verb in cli.VERBS or verb == "--completion"
    if verb in cli.VERBS:
        overrides = [word for word in words if not word.startswith("-")]
        overrides = [word for word in overrides if word not in ("job", "defaults-tree")]
        if "task=push_off" in overrides and verb != "new":  # the task of the template, which is not installed
            monkeypatch.syspath_prepend(ROOT / "task_template")
            overrides.insert(0, f"hydra.searchpath=[file://{ROOT}/task_template/my_tasks/conf]")
        for one in compose.combinations(verb, overrides) if verb in ("generate", "demos") else [overrides]:
            compose.as_yaml(verb, getattr(one, "overrides", one))


def test_a_command_that_fails_is_seen(tmp_path):
    assert run("scengen show pool=nowhere", tmp_path)[0] == 2
    status, said, _ = run(f"scengen show pool={REFERENCE} id=8ed4", tmp_path)
    assert status == 0 and "domino_single/id@0/8ed4a4577fe0" in said
