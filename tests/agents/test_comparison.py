"""Several runs side by side: their rates are those of each run, and the prices those of their calls."""

import json

import helpers
import pytest

from scengen import cli
from scengen.agents.comparison import ModelRun, compared
from scengen.agents.runner import AgentSettings, run
from scengen.errors import BadConfig


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Runs of two stand-ins; one call of the first had 1000 tokens of prompts and 200 of answers."""
    home = tmp_path_factory.mktemp("runs")
    for model in ("facts", "wrong"):
        settings = AgentSettings(
            model=model, pool=str(helpers.REFERENCE), seeds=2, pictures=False, stage=2, execute=False,
            to=str(home / model), prices=[3.0, 15.0],
        )  # fmt: skip
        run(settings, lambda *_: None)
    journal = home / "facts" / "calls.jsonl"
    head, first, *others = journal.read_text().splitlines()
    call = json.loads(first)
    call["reply"] |= {"tokens_in": 1000, "tokens_out": 200}
    journal.write_text("\n".join([head, json.dumps(call), *others]) + "\n")
    return [home / "facts", home / "wrong"]


def test_tables_have_the_rates_of_every_model_and_stage(folders):
    by_category, first, second, _ = compared(folders)
    assert by_category.head == ("model", "stage", "", "P3", "all")
    rates = {row[:2]: row[3].value for row in by_category.rows}
    stages = ("1 understand", "2 plan")
    assert rates == {(model, s): share for model, share in (("facts", 1.0), ("wrong", 0.0)) for s in stages}
    for grid in (first, second):
        assert grid.head == ("task", "facts, ID", "wrong, ID")
        assert [[row[0], row[1].value, row[2].value] for row in grid.rows] == [["domino_single", 1.0, 0.0]]


def test_prices_are_those_of_the_calls(folders):
    *_, spent = compared(folders)
    assert spent.rows[0] == ("facts", "1 understand", "2", "1000", "200", "0.006")
    dearer = compared(folders, [30, 150])[-1]
    assert dearer.rows[0][-1] == "0.06"


def test_the_command_writes_text_latex_and_a_page(folders, tmp_path, capsys):
    assert cli.run(["agent", "report", f"runs={folders[0]},{folders[1]}", f"to={tmp_path}"]) == 0
    told = capsys.readouterr().out
    assert "Right by category" in told and "0.006" in told
    assert {file.name for file in tmp_path.iterdir()} == {"table.md", "table.tex", "report.html"}
    latex = (tmp_path / "table.tex").read_text()
    assert latex.count("\\begin{tabular}") == latex.count("\\end{tabular}") == 4 and "domino\\_single" in latex
    assert "[\\%]" in latex and "<td>domino_single</td>" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["runs={0},{0}"], "two runs are of facts"),
        (["runs={1}/nowhere"], "holds no run of scengen agent"),
        (["runs={0}", "prices=nowhere.yaml"], "prices"),
        (["prices=nowhere.yaml"], "prices= belongs to runs="),
        (["run={0}"], "needs to=FOLDER"),
    ],
)
def test_bad_input_is_one_line(folders, tmp_path, capsys, arguments, says):
    words = [each.format(*folders) for each in arguments]
    assert cli.run(["agent", "report", *words, f"to={tmp_path / 'out'}"]) == 2
    told = capsys.readouterr().err.strip()
    assert says in told and "\n" not in told


def test_damaged_results_are_refused(folders, tmp_path):
    (tmp_path / "settings.json").write_text((folders[0] / "settings.json").read_text())
    with pytest.raises(BadConfig, match="holds no results; scengen agent makes them"):
        ModelRun.read(tmp_path, None)
    for damaged in ("{", "[1]", '{"stage": 1}', "null"):
        (tmp_path / "results-1.jsonl").write_text(damaged)
        with pytest.raises(BadConfig, match="holds no results of scengen agent"):
            ModelRun.read(tmp_path, None)
