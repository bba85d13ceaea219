"""Command lines that nobody should write: each ends in order, with a remedy, and leaves nothing behind."""

import sys
import tempfile
from pathlib import Path

import pytest

from fuzz import kills, run
from scengen import cli

COUNT, SEED = 200, 1


@pytest.mark.slow
def test_mangled_command_lines_end_in_order():
    bad = run.run(COUNT, SEED)
    assert not bad, "\n".join(f"{' '.join(line)[:300]}\n    {wrong}" for line, wrong in bad)


@pytest.mark.slow
def test_runs_that_are_killed_lose_nothing():
    assert not kills.run(kills.KINDS["generate"], 2, seed=1, each=2)


def test_the_judge_sees_what_is_wrong(monkeypatch):
    """The negative control: commands that end badly in every way."""

    def ends(says, status=2, left=False, error=None):
        def command(line):
            print(says, end="", file=sys.stderr)
            if left:
                Path(tempfile.gettempdir(), "left").write_text("")
            if error:
                raise error
            return status

        return command

    with run.playground() as place:
        for command, wrong in (
            (ends("scengen: name another one\n"), ""),
            (ends("", status=0), ""),
            (ends("scengen: name another one\n", status=3), "status 3"),
            (ends("scengen: one\nand name another\n"), "2 lines"),
            (ends("scengen: no\n"), "no remedy"),
            (ends("x.py:1: UserWarning: not there\n", status=0), "warning of Python"),
            (ends("scengen: unforeseen; name another one\n"), "unforeseen"),
            (ends("scengen: name another \x1b[2J one\n"), "control"),
            (ends("scengen: name another one " + "x" * 9000 + "\n"), "letters"),
            (ends("", error=KeyError("x")), "escaped"),
            (ends("scengen: name another one\n", left=True), "left behind"),
        ):
            monkeypatch.setattr(cli, "run", command)
            found = run.judge([], place)
            assert wrong in found and bool(found) == bool(wrong)


@pytest.mark.parametrize(
    "error", [KeyError("x"), RecursionError(), MemoryError(), OverflowError("too large"), ZeroDivisionError()]
)
def test_what_nobody_thought_of_is_one_line_and_a_file(monkeypatch, capsys, tmp_path, error):
    def fail(arguments):
        raise error

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr("scengen.cli.commands.evaluate_power.command", fail)
    assert cli.run(["evaluate", "power"]) == 2
    told = capsys.readouterr().err
    (file,) = tmp_path.iterdir()
    assert told.count("\n") == 1 and str(file) in told and type(error).__name__ in file.read_text()
    (tmp_path / "gone").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "gone" / "nowhere"))
    assert cli.run(["evaluate", "power"]) == 2 and capsys.readouterr().err.count("\n") == 1


def test_text_of_a_pool_is_shown_and_not_obeyed(capsys):
    from rich.table import Table

    from scengen.cli.commands import out, say, warn

    hostile = "[/] [bold]x[/bold] \x1b]0;title\x07 \u202e :smile: a\nb"
    table = Table(hostile, title=hostile)
    table.add_row(hostile)
    out.print(table)
    say(hostile)
    warn(hostile)
    shown = capsys.readouterr()
    for text in (shown.out, shown.err):
        assert "[bold]x[/bold]" in text and ":smile:" in text and "\\x1b]0;title\\x07" in text and "\\u202e" in text
        assert not set(text) & set("\x1b\x07\u202e")
    assert shown.err.count("\n") == 1
