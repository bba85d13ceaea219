"""The page about whole pools says what is true of them."""

import json
import shutil

import pytest
from helpers import REFERENCE

from scengen import cli


@pytest.mark.slow
def test_a_pool_beside_its_own_copy_leaks_every_scenario(tmp_path, capsys):
    copy = shutil.copytree(REFERENCE, tmp_path / "copy")
    page, numbers = tmp_path / "report.html", tmp_path / "report.json"
    assert cli.run(("report", f"pool={REFERENCE},{copy}", f"to={page}", f"json={numbers}")) == 0
    told = json.loads(numbers.read_text())
    assert len(told["contrasts"][0]["shared"]) == 6 and told["contrasts"][0]["apart"]["energy"]["distance"] == 0.0
    assert [p["scenarios"] for p in told["pools"]] == [6, 6] and told["pools"][0]["outside"] == {}
    assert "6 pairs" in page.read_text() and "6 near duplicates" in capsys.readouterr().out


def test_pools_of_one_scenario_are_reported_too(tmp_path):
    one = tmp_path / "one"
    assert cli.run(("subset", f"pool={REFERENCE}", "n=1", f"to={one}")) == 0
    assert cli.run(("report", f"pool={one},{REFERENCE}", f"to={tmp_path / 'report.html'}")) == 0


@pytest.mark.parametrize(
    ("argv", "says"),
    [(("pool=nowhere",), "no pool at nowhere"), ((f"pool={REFERENCE}", "to=report.pdf"), "give an .html file")],
)
def test_bad_input_is_told_in_one_line(argv, says, capsys):
    assert cli.run(("report", *argv)) == 2 and says in capsys.readouterr().err
