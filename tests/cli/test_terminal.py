"""Narrow terminals: no name, path or command is clipped or broken, and no line is wider than the terminal."""

import io

import pytest
from helpers import REFERENCE
from rich.table import Table

from scengen import cli, compose
from scengen.cli import program, tables, usage
from scengen.cli.verbs import VERBS
from scengen.evidence.table import evidence_table
from scengen.pool import Pool
from scengen.samplers import task_files
from scengen.work.printed import PlainConsole, width

WIDTHS = (60, 80, 118)


def printed(table, wide):
    """Lines of a table as a terminal of a width shows it."""
    file = io.StringIO()
    PlainConsole(width=wide, file=file).print(table)
    return [line.rstrip() for line in file.getvalue().splitlines()]


def words(table):
    """All words of a table, without the headers of names, which blocks leave out."""
    headers = [str(column.header) for column in table.columns[1:] if not column.no_wrap]
    texts = headers + [str(c) for column in table.columns for c in column.cells]
    return {word for text in [*texts, str(table.title or ""), str(table.caption or "")] for word in text.split()}


def all_tables():
    """Tables of tasks, axes, pools and certificates, as commands print them."""
    listed = [task_files.about(name) for name in task_files.tasks()]
    task, pool = compose.load_task("stack_collapse_recovery"), Pool.open(REFERENCE)
    row = next(pool.rows())
    yield tables.tasks_table(listed, {each.name: {} for each in listed})
    yield from (*tables.task_tables(task), evidence_table(task), *tables.scenario_tables(row))
    yield tables.pool_table(pool)
    yield tables.pools_table([pool, pool])
    yield tables.funnel_table(pool.manifest.funnel, {"solved: " + "a_long_name_of_a_body " * 9: 3})


@pytest.mark.parametrize("wide", WIDTHS)
def test_no_word_of_a_table_is_clipped_or_broken(wide):
    for table in all_tables():
        lines, seen = printed(table, wide), set()
        for line in lines:
            seen |= {word.rstrip(";:") for word in line.replace("│", " ").replace("┃", " ").split()}
            assert len(line) <= wide or len(line.split()) == 1, line
        lost = {word.rstrip(";:") for word in words(table)} - seen
        assert not lost and not any("…" in line for line in lines), lost


def test_a_pool_of_one_scenario_shows_the_parameters_that_training_draws(monkeypatch):
    monkeypatch.setattr(tables, "LINES", 1)
    pool = Pool.open(REFERENCE)
    ((cell,),) = ([*column.cells] for column in tables.pool_table(pool).columns[1:])
    assert [part.partition("=")[0] for part in cell.split(", ")] == [
        name for name in pool.at(0).params if name in pool.manifest.task_node["id"]
    ]


def test_a_table_that_fits_stays_one_and_a_wide_one_becomes_blocks():
    table = Table("name", "value", title="two")
    table.columns[0].no_wrap = True
    table.add_row("a", "word " * 30)
    assert printed(table, 80)[1].startswith("┏")
    table.add_row("b" * 90, "1", style="red")
    value = [f"  value: {'word ' * 13}word", f"  {'word ' * 14}word", "  word"]
    assert printed(table, 80) == ["two", "a", *value, "b" * 90, "  value: 1"]


@pytest.mark.parametrize("wide", WIDTHS)
@pytest.mark.parametrize("verb", VERBS)
def test_help_keeps_to_the_width_of_the_terminal(monkeypatch, verb, wide):
    monkeypatch.setenv("COLUMNS", "1000")
    monkeypatch.setattr(usage, "WIDTH", 1000)
    whole = usage.usage(verb, [])
    monkeypatch.setattr(usage, "WIDTH", 118)
    monkeypatch.setenv("COLUMNS", str(wide))
    narrow = usage.usage(verb, [])
    assert narrow.replace("#", " ").split() == whole.replace("#", " ").split()
    for line in narrow.splitlines():
        assert len(line) <= wide or len(line.strip("# ").split()) <= 2 or not line.startswith("#"), line


@pytest.mark.parametrize("wide", WIDTHS)
def test_the_list_of_commands_keeps_to_the_width_and_names_each(monkeypatch, wide):
    monkeypatch.setenv("COLUMNS", str(wide))
    lines = program._help().splitlines()
    names = {line[: program.NAMES].strip() for line in lines}
    assert set(VERBS) <= names and all(len(line) <= max(wide, 78) for line in lines)


def test_generate_names_each_task_once_and_help_before_or_after_is_the_same(monkeypatch, capsys):
    assert cli.run(["help", "generate"]) == 0
    before = capsys.readouterr().out
    assert cli.run(["generate", "--help"]) == 0
    assert capsys.readouterr().out == before
    told = before[before.index("# task=NAME") :].split()
    assert all(told.count(name) == 1 for name in task_files.tasks()) and "wide_gaps" not in told
    assert cli.run(["generate", "task=domino_single", "--help"]) == 0
    assert "wide_gaps" in capsys.readouterr().out


@pytest.mark.parametrize(("columns", "wide"), [("60", 60), ("97", 97), ("", 160), ("no", 160), ("0", 160)])
def test_columns_is_honoured_without_a_terminal(monkeypatch, columns, wide):
    monkeypatch.setenv("COLUMNS", columns)
    assert width() == wide
