"""The ledger of measured figures: its rows are about today's tasks, and no page shows a figure of another version."""

import json
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace

import baselines_page
import predictors
import pytest
import tables

from scengen import list_tasks, load_task
from scengen.cli import run
from scengen.errors import BadConfig
from scengen.evidence import ledger, measuring
from scengen.evidence.ledger import KINDS, Evidence
from scengen.measures import figures
from scengen.measures.measurement import Result, Row
from scengen.measures.policies import MIXED
from scengen.measures.scenarios import Certified
from scengen.samplers import task_files

TASK = load_task("domino_single")
ROWS = [row for kind in KINDS for task in list_tasks() for row in ledger.read(kind, task)]
ROW = Evidence(TASK.name, TASK.version, "id", "plan", 3, {"solved": 2}, {"seed": 0}, measuring.draws_of(TASK, "id"))


@pytest.fixture
def empty(tmp_path, monkeypatch):
    """A ledger without rows."""
    monkeypatch.setattr(ledger, "folder_of", lambda task: tmp_path)
    return tmp_path


# --- the rows of the repository -------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_every_file_is_about_a_task_and_every_row_is_whole(kind):
    for path in (task_files.shipped("records") / kind).iterdir():
        assert path.suffix == ".jsonl" and path.stem in list_tasks()
        rows = ledger.read(kind, path.stem)
        assert path.read_text() == "".join(json.dumps(asdict(row), sort_keys=True) + "\n" for row in rows)
        assert [row.place for row in rows] == sorted({row.place for row in rows}), "one row for each place, in order"
        splits, version = task_files.splits(path.stem), task_files.version(path.stem)
        for row in rows:
            assert (row.task, row.kind) == (path.stem, kind)
            assert row.split in ("", *splits)
            assert type(row.version) is int and 1 <= row.version <= version
            assert type(row.n) is int and row.n >= 1
            assert isinstance(row.value, dict) and row.value and isinstance(row.made_with, dict) and row.made_with


@pytest.mark.parametrize("name", sorted({row.task for row in ROWS}))
def test_no_row_is_stale(name):
    """A row about today's version was measured on today's draws. If not, the version was not raised with the task."""
    task = load_task(name)
    rows = [row for row in ROWS if row.task == name and row.version == task.version]
    draws = {split: measuring.draws_of(task, split) for split in {row.split for row in rows}}
    stale = [f"{row.kind} of {row.split}" for row in rows if row.draws != draws[row.split]]
    assert not stale, f"{name} has changed without a new VERSION: {', '.join(stale)}"


def test_the_ledger_has_a_row_of_every_kind():
    assert {row.kind for row in ROWS} == set(KINDS)


# --- versions -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", list_tasks())
def test_the_version_is_read_without_an_import_as_the_family_declares_it(name):
    assert task_files.version(name) == load_task(name).version


@pytest.mark.parametrize("stated", ["VERSION: ClassVar[int] = 3", "VERSION = 3"])
def test_a_version_is_that_of_the_class_itself(tmp_path, stated):
    path = tmp_path / "families.py"
    path.write_text(f"class Other:\n    {stated}\n\nclass Family(Other):\n    pass  # VERSION\n")
    assert task_files._stated_version(str(path), "Other") == 3
    assert task_files._stated_version(str(path), "Family") == 1


# --- measuring ------------------------------------------------------------------------------


def test_what_was_measured_with_the_same_settings_is_not_measured_again(empty, monkeypatch):
    made_with = {"n": 2, "mujoco": ["3.5.0", "4.0.0"]}
    assert measuring.measured(TASK, "id", "plan", made_with) is None
    row = measuring.keep(TASK, "id", "plan", 2, {"solved": 1}, made_with)
    assert measuring.measured(TASK, "id", "plan", made_with) == row
    assert measuring.measured(TASK, "id", "plan", {**made_with, "n": 3}) is None
    assert measuring.measured(TASK, "diagonal", "plan", made_with) is None
    assert measuring.measured(TASK, "id", "drift", made_with) is None
    monkeypatch.setattr(TASK.family, "VERSION", TASK.version + 1)
    assert measuring.measured(TASK, "id", "plan", made_with) is None


def test_a_split_with_other_draws_is_measured_again(empty):
    ledger.write(replace(ROW, draws="0" * 12))
    assert measuring.measured(TASK, "id", "plan", ROW.made_with) is None
    ledger.write(ROW)
    assert measuring.measured(TASK, "id", "plan", ROW.made_with) == ROW


def test_the_draws_tell_distributions_apart_and_scenes(monkeypatch):
    axes = [measuring.draws_of(TASK, split) for split in ("", "id", *TASK.axes)]
    assert axes[0] == axes[1] and len(set(axes)) == 1 + len(TASK.axes)
    monkeypatch.setattr(measuring, "rebuild", lambda scenario: "<mujoco/>")
    assert measuring.draws_of(TASK, "id") != axes[1]


def test_a_row_of_the_same_settings_is_replaced_and_others_stay(empty):
    other = replace(ROW, made_with={"seed": 1})
    newer = replace(ROW, version=ROW.version + 1, n=5)
    for row in (ROW, other, newer):
        ledger.write(row)
    assert ledger.read("plan", TASK.name) == [newer, other]


def test_pages_show_the_newest_rows_of_each_split_and_mark_old_ones(empty):
    old = replace(ROW, version=1, made_with={"seed": 1})
    diagonal, later = replace(old, split="diagonal"), replace(ROW, version=TASK.version + 1, made_with={"seed": 2})
    for row in (old, ROW, diagonal, later):
        ledger.write(row)
    assert sorted(ledger.newest("plan", TASK.name), key=lambda row: row.split) == [diagonal, ROW], "none of the future"
    assert ledger.mark(ROW) == "" and ledger.mark(diagonal) == " (version 1)"


def test_rows_that_are_written_at_once_are_all_kept(empty):
    rows = [replace(ROW, made_with={"seed": seed}) for seed in range(20)]
    with ThreadPoolExecutor(8) as threads:
        list(threads.map(ledger.write, rows))
    assert sorted(ledger.read("plan", TASK.name), key=lambda row: row.made_with["seed"]) == rows
    assert [path.name for path in (empty / "plan").iterdir()] == ["domino_single.jsonl"]


def test_a_damaged_line_is_told_with_its_number(empty):
    ledger.write(ROW)
    with open(empty / "plan" / "domino_single.jsonl", "a") as file:
        file.write('{"task": "domino_single"}\n')
    with pytest.raises(BadConfig, match=r"domino_single\.jsonl, line 2: .*restore the file"):
        ledger.read("plan", TASK.name)


def test_of_several_rows_of_a_split_the_largest_is_shown(empty):
    for n, seed in ((20, 0), (50, 1), (10, 2)):
        ledger.write(replace(ROW, n=n, made_with={"seed": seed}))
    assert ledger.latest("plan", TASK.name)["id"].n == 50
    assert ledger.latest("plan", TASK.name, seed=2)["id"].n == 10


def test_certification_is_measured_once(empty, monkeypatch):
    calls = []

    def result(self, job):
        calls.extend(job.splits)
        return Result(job, [Row(job.splits[0], 3, {"indices": 3})])

    monkeypatch.setattr(Certified, "result", result)
    splits = ["id", *TASK.axes]
    words = ("measure", "kind=certified", f"task={TASK.name}")
    assert run((*words, "n=2", "splits=id")) == 0
    for _ in range(2):
        assert run((*words, "n=2")) == 0
    assert calls == splits
    assert run((*words, "n=3", "splits=id")) == 0
    assert run((*words, "n=3", "splits=id", "fresh=true")) == 0
    assert calls == [*splits, "id", "id"]


# --- what is shown --------------------------------------------------------------------------


@pytest.fixture
def of_another_version(empty):
    """The rows of one task, all of another version."""
    for row in ROWS:
        if row.task == TASK.name:
            ledger.write(replace(row, version=7))
    pages = (baselines_page._rates, baselines_page._measured, baselines_page._trainings, tables.of_axes)
    cached = (*pages, predictors.ranking, predictors._trials)
    for of in cached:
        of.cache_clear()
    yield
    for of in cached:
        of.cache_clear()


def test_no_page_shows_figures_of_another_version(of_another_version):
    none = "not measured on version 1"
    assert set(tables.of_axes(TASK.name)["diagonal"].values()) <= {none, "nothing hidden"}
    assert all(not ledger.newest(kind, TASK.name) for kind in KINDS)
    assert tables.reports() == {} and f"`{TASK.name}`: {none}" in tables.attacks()["attacks"]
    assert f"| [{TASK.name}](tasks/{TASK.name}.md) | {none} |" in baselines_page._all_splits()
    assert not baselines_page._trainings(MIXED)
    assert [row for row in tables.cheats() if TASK.name in row[0] and row.count(none) != 3] == []
    assert TASK.name not in tables.drift()["drift"]
    assert f"| [{TASK.name}](tasks/{TASK.name}.md) | {none} |" in tables.cluster()["costs"]


def test_the_terminal_tells_what_was_not_measured(of_another_version, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert run(("tasks", f"task={TASK.name}")) == 0
    told = capsys.readouterr().out
    lines = told.partition("evidence about version 1")[2].splitlines()
    kinds = {row.kind for row in ROWS if row.task == TASK.name}
    for kind in kinds:
        [line] = [line for line in lines if f" {kind} " in line]
        assert "all on version 7" in line
    [never] = [line for line in lines if line.startswith("not measured: ")]
    assert {*never.strip().removeprefix("not measured: ").split(", ")} == {*KINDS} - kinds
    assert run(("tasks",)) == 0
    [line] = [line for line in capsys.readouterr().out.splitlines() if " domino_single " in line]
    assert " of " not in line


def test_rows_without_an_end_are_one_line(empty):
    path = empty / "plan" / f"{TASK.name}.jsonl"
    path.parent.mkdir()
    with open(path, "wb") as file:
        file.truncate(10**12)
    with pytest.raises(BadConfig, match="it has 1000000000000 bytes; at most .* are read; restore the file"):
        ledger.read("plan", TASK.name)
    path.write_text("[" * 100_000 + "\n")
    with pytest.raises(BadConfig, match="line 1: .*; restore the file"):
        ledger.read("plan", TASK.name)


@pytest.mark.parametrize(
    "changed",
    [
        {"version": "2"},
        {"version": [2]},
        {"version": 0},
        {"n": -1},
        {"n": float("inf")},
        {"n": True},
        {"split": None},
        {"value": "high"},
        {"task": "packing"},
        {"kind": "attack"},
        {"proved": True},
    ],
)
def test_a_row_that_no_measurement_writes_is_refused(changed, empty):
    ledger.write(ROW)
    path = empty / "plan" / "domino_single.jsonl"
    path.write_text(path.read_text() + json.dumps({**asdict(ROW), "split": "diagonal", **changed}) + "\n")
    with pytest.raises(BadConfig, match="line 2: .*; restore the file"):
        ledger.read("plan", "domino_single")


@pytest.mark.parametrize(
    "changed",
    [('"n": 3', '"n": 3, "n": 4'), ("2", "NaN"), ("2", "1e999"), ("2", "[" * 99 + "]" * 99), ("2", r'"\ud800"')],
)
def test_a_row_that_is_no_strict_json_is_refused(changed, empty):
    ledger.write(ROW)
    path = empty / "plan" / "domino_single.jsonl"
    path.write_text(
        path.read_text().replace('"solved": 2', f'"solved": {changed[1]}')
        if changed[0] == "2"
        else path.read_text().replace(*changed)
    )
    with pytest.raises(BadConfig, match="line 1: .*; restore the file"):
        ledger.read("plan", "domino_single")


@pytest.mark.parametrize(
    "value",
    [{"solved": 2}, {"certified": "all", "indices": 4, "cpu": 1.0}, {"certified": -1, "indices": 4, "cpu": 1.0}],
)
def test_figures_that_commands_print_are_numbers(value, empty, capsys):
    ledger.write(replace(ROW, kind="certified", value=value))
    assert run(("tasks",)) == 2 and "line 1: value has certified = " in capsys.readouterr().err


def test_rows_on_other_draws_are_not_told_as_measured(empty, capsys):
    figures = {"certified": 4, "indices": 4, "cpu": 1.0}
    honest = replace(ROW, kind="certified", value=figures)
    for split, draws in (("id", ROW.draws), ("diagonal", "0" * 12), ("nowhere", ROW.draws)):
        ledger.write(replace(honest, split=split, draws=draws))
    assert run(("tasks", "task=domino_single", f"records={empty}")) == 0
    told = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert " certified id 3 8 of 9: diagonal, " in told and "; on other draws: diagonal, nowhere" in told
    assert f"claimed, and not checked: the figures of {empty}" in told


def test_figures_that_a_row_lacks_are_named(empty):
    ledger.write(replace(ROW, kind="belief", split="diagonal"))
    with pytest.raises(BadConfig, match="a row of the ledger lacks baselines, it has solved"):
        figures.baselines(TASK)
    ledger.write(replace(ROW, kind="belief", split="diagonal", value={"baselines": []}))
    ledger.write(replace(ROW, kind="belief", split="an_axis_of_an_earlier_version"))
    assert not any(figures.baselines(TASK).values())


def test_two_rows_of_the_same_place_and_files_that_are_none_are_refused(empty):
    ledger.write(ROW)
    path = empty / "plan" / "domino_single.jsonl"
    path.write_text(path.read_text() + json.dumps({**asdict(ROW), "n": 1000}) + "\n")
    with pytest.raises(BadConfig, match="line 2: a row with this split .* stands above"):
        ledger.read("plan", "domino_single")
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(BadConfig, match="it is not a plain file"):
        ledger.read("plan", "domino_single")
