"""Measurements: a task of another package fills a ledger of its own, which its tables and its page show."""

from pathlib import Path

import pytest

from scengen import cli, conformance, load_task
from scengen.agents import facts
from scengen.errors import ScengenError
from scengen.evidence import ledger
from scengen.measures import figures
from scengen.measures.axes import Beliefs
from scengen.measures.kinds import MEASUREMENTS
from scengen.measures.measurement import Result, Row
from scengen.measures.scenarios import Certified
from scengen.measures.understanding import MISSING, OPTIONAL, ORDER, RIGHT, WRONG, plans
from scengen.site import task_page

CONF = Path(__file__).parents[1] / "foreign" / "conf"
SEARCH = conformance.search(CONF)
COUNTS = {"indices": 4, "certified": 3, "cpu": 2.0, "lost": {}}


@pytest.fixture
def counted(monkeypatch):
    """The splits that would have been certified."""
    calls = []

    def result(self, job):
        calls.extend(job.splits)
        if job.splits == ("far",):
            raise ScengenError("no twin is feasible")
        return Result(job, [Row(job.splits[0], 4, COUNTS)], "3 of 4 certified")

    monkeypatch.setattr(Certified, "result", result)
    return calls


def test_a_foreign_task_has_a_ledger_of_its_own_and_the_same_tables(tmp_path, counted, capsys):
    words = ("measure", "kind=certified", "task=push_block", f"records={tmp_path}", *SEARCH)
    assert cli.run(words) == 1, "one split could not be measured"
    told = capsys.readouterr()
    assert "push_block/id: 3 of 4 certified" in told.out and "push_block/far: no twin is feasible" in told.err
    assert cli.run((*words, "splits=id")) == 0 and counted.count("id") == 1
    assert cli.run((*words[:2], "task=push_block,push_block", *words[3:], "splits=[id,id]", "fresh=true")) == 0
    assert counted.count("id") == 2, "what is named twice is measured once"
    assert "nothing is missing" in capsys.readouterr().out
    assert (tmp_path / "certified" / "push_block.jsonl").read_text().count("\n") == len(counted) - 1
    assert cli.run(("tasks", "task=push_block", f"records={tmp_path}", *SEARCH)) == 0
    assert "certified" in capsys.readouterr().out.partition("evidence about version 1")[2]
    task = load_task("push_block", SEARCH)
    with ledger.opened(str(tmp_path), SEARCH):
        assert "| id | 3 of 4 | - | - |" in "\n".join(task_page.certification(task))
        cells = figures.axes(task)["far"]
        assert (cells["certified"], cells["outside"]) == ("not measured on version 1",) * 2
        assert "not measured" in "\n".join(task_page.policies(task)) and not [*task_page.understanding(task, SEARCH)]


def test_the_ledger_of_a_foreign_task_is_beside_its_task_file():
    with ledger.opened(None, SEARCH):
        assert ledger.folder_of("push_block") == CONF / "records"
        assert ledger.folder_of("domino_single") == ledger.folder_of("no_task_any_more")
    assert ledger.folder_of("domino_single").name == "records"


def test_rows_of_another_level_are_not_those_of_the_pages(tmp_path, counted):
    words = ("kind=certified", "task=domino_single", "splits=id,diagonal", "level=full", f"records={tmp_path}")
    assert cli.run(("measure", *words)) == 0 and counted == ["id", "diagonal"]
    with ledger.opened(str(tmp_path)):
        assert ledger.newest("certified", "domino_single") and figures.certified("domino_single") == {}


def test_more_twins_replace_fewer(tmp_path, monkeypatch):
    made = []

    def result(self, job):
        made.append(job.made_with["n"])
        return Result(job, [Row("diagonal", made[-1], {})])

    monkeypatch.setattr(Beliefs, "result", result)
    for n in (8, 4, 8, 20):
        words = ("kind=belief", "task=domino_single", "splits=diagonal", f"n={n}", f"records={tmp_path}")
        assert cli.run(("measure", *words)) == 0
    assert made == [8, 20]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["kind=certifed"], "did you mean 'certified'"),
        (["kind=belief", "budget=3"], "kind=belief has no setting budget; it accepts splits, n"),
        (["kind=belief", "n=0"], "n = 0; it must be at least 1"),
        (["kind=belief", "splits=diagonl"], "did you mean 'diagonal'"),
        (["kind=certified", "level=fast"], "no level of certification named 'fast'"),
        (["kind=training", "compare=wrenches"], "did you mean 'wrench'"),
        (["kind=prior", "task.horizon=3"], "figures are about a task as its file defines it"),
        ([], "measure needs kind=..."),
        (["kind=belief", "records=README.md"], "README.md is a file; name a folder"),
    ],
)
def test_bad_settings_end_in_one_line(words, says, capsys, tmp_path):
    assert cli.run(["measure", "task=domino_single", f"records={tmp_path}", *words]) == 2
    told = capsys.readouterr().err
    assert says in told and told.count("\n") == 1


def test_every_kind_is_one_of_the_ledger_with_an_explanation():
    help_text = (Path(ledger.__file__).parents[2] / "conf" / "command" / "measure.yaml").read_text()
    for name, kind in MEASUREMENTS.items():
        assert name in ledger.KINDS and kind.__doc__ and f" {name} " in help_text


def test_wrong_plans_are_those_that_miss_exchange_or_replace_a_sub_goal():
    found = [*plans(facts.load(load_task("domino_single")).plan, 10, 3)]
    assert found[0] == (RIGHT, ("reach_behind", "tip_first", "chain_falls"), 10)
    kinds = {kind for kind, _, _ in found}
    assert kinds - {OPTIONAL} == {RIGHT, MISSING, ORDER, WRONG}
    assert (ORDER, ("tip_first", "reach_behind", "chain_falls"), 3) in found
    assert all(many == 1 for kind, _, many in found if kind == WRONG)
