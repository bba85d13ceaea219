"""Scenarios by their names: the id counts, and everybody is told what they need to know."""

import warnings

import numpy as np
import pytest
from helpers import REFERENCE

from scengen import cli
from scengen.cli.commands import show
from scengen.cli.commands.settings import read
from scengen.envs.gym import PoolEnv
from scengen.errors import BadConfig
from scengen.pool import Pool
from scengen.pool.directory import Directory
from scengen.pool.names import Misnamed, Name, NoScenario, find

KNOWN = [
    Name("domino_single", "id", 0, "8ed4a4577fe0"),
    Name("domino_single", "wide_gaps@2", 7, "8e12e4000000"),
    Name("domino_single", "diagonal+wide_gaps", 3, "12e4aaaaaaaa"),
]


HERE = Directory(np.array([name.id for name in KNOWN], "S12"), np.array([name.index for name in KNOWN]))


def found(text):
    """The name that a text stands for among the known ones."""
    return KNOWN[find(text, HERE, KNOWN.__getitem__, "here")]


def test_a_name_says_task_split_index_and_id():
    spelled = ["domino_single/id@0/8ed4a4577fe0", "domino_single/wide_gaps@2@7/8e12e4000000"]
    assert [str(name) for name in KNOWN[:2]] == spelled


@pytest.mark.parametrize("name", KNOWN, ids=str)
@pytest.mark.parametrize("letters", [12, 3])
def test_a_scenario_is_found_by_its_name_its_id_and_the_beginning_of_either(name, letters):
    start = name.id[:letters]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for text in (start, f"{name.task}/{start}", f"{name.task}/{name.split}@{name.index}/{start}"):
            assert found(text) == name


@pytest.mark.parametrize("before", ["packing", "domino_single/id@1", "domino_single/wide_gaps@0", "domino_single/id"])
def test_where_a_name_is_wrong_about_its_id_the_id_counts_and_a_line_says_so(before):
    with pytest.warns(Misnamed, match="is domino_single/id@0/8ed4a4577fe0: the id counts"):
        assert found(f"{before}/8ed4") == KNOWN[0]


@pytest.mark.parametrize(
    ("text", "error", "says"),
    [
        (
            "8e",
            BadConfig,
            "'8e' is a prefix of 2 ids in here; give more characters: domino_single/id@0/8ed4a4577fe0, domino_sing",
        ),
        ("8ed4a4577fe1", NoScenario, r"no scenario in here named '8ed4a4577fe1' \(did you mean '8ed4a4577fe0'\?\)"),
        ("domino_single/id@0", NoScenario, "known: domino_single/id@0/8ed4a4577fe0, "),
        ("domino_single/id@0/", NoScenario, "no scenario in here"),
        ("", NoScenario, "no scenario in here named ''"),
    ],
)
def test_what_finds_none_or_several_ends_in_one_line_with_their_names(text, error, says):
    with pytest.raises(error, match=says) as raised:
        found(text)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("id_", ["12e4", "1e400", "007", "8e12e4000000", "domino_single/wide_gaps@2@7/8e12", "a+b/1_0"])
def test_hydra_takes_no_id_for_a_number(id_):
    assert read("show", ["pool=here", f"id={id_}"], show.ShowSettings).id == id_


def test_commands_and_environments_take_names(capsys):
    row = next(Pool.open(REFERENCE).rows(witness=False))
    for text in (str(row.name), row.id[:3], f"wrong/{row.id[:3]}"):
        assert cli.run(["show", f"pool={REFERENCE}", f"id={text}"]) == 0
        shown = capsys.readouterr()
        assert shown.out.startswith(str(row.name)) and shown.err.count("\n") == text.startswith("wrong")
    env = PoolEnv(row.task, REFERENCE)
    for text in (row.id, str(row.name), row.id[:3]):
        env.reset(options={"scenario": text})
        assert env.row.id == row.id
    with pytest.raises(NoScenario, match="no scenario in these pools named 'nothing'"):
        env.reset(options={"scenario": "nothing"})


def test_a_pool_is_shown_with_the_names_of_its_scenarios(capsys):
    assert cli.run(["show", f"pool={REFERENCE}"]) == 0
    shown = capsys.readouterr().out
    assert all(str(name) in shown for name in Pool.open(REFERENCE).names())
    assert cli.run(["show", f"pool={REFERENCE},{REFERENCE}", "id=8ed4"]) == 0
    assert "8ed4" in capsys.readouterr().out
