"""Witnesses of ID twins, replayed out of distribution, and the card that tells of it."""

import json

import pytest

from scengen import cli, config
from scengen.ood import behaviour
from scengen.ood.behaviour import BUG, COSMETIC, EXTRAPOLATION, UNKNOWN, Trial, shares, try_twins
from scengen.statistics import wilson

TASK = config.task("domino_single")


def test_the_four_verdicts_are_what_their_names_say():
    kinds = [Trial(0, replay, oracle, "").kind for replay, oracle in ((0, 1), (1, 1), (0, 0), (1, 0))]
    assert kinds == [EXTRAPOLATION, COSMETIC, UNKNOWN, BUG]


def test_shares_add_up_and_carry_wilsons_interval():
    found = shares([Trial(k, False, k < 6, "") for k in range(8)])
    assert sum(s.value for s in found) == 1.0 and [s.count for s in found] == [6, 0, 2, 0]
    assert (found[0].low, found[0].high) == wilson(0.75, 8)


def test_a_stout_first_tile_defeats_memory_and_a_light_tile_does_not(tmp_path):
    assert {t.kind for t in try_twins(TASK, "stout_starter", tmp_path / "stout", 2)} == {EXTRAPOLATION}
    assert {t.kind for t in try_twins(TASK, "light_tiles", tmp_path / "light", 2)} == {COSMETIC}


def test_twins_are_not_tried_twice(tmp_path, monkeypatch):
    first = try_twins(TASK, "light_tiles", tmp_path, 1)

    def never(*_):
        raise AssertionError

    monkeypatch.setattr(behaviour, "_try_twin", never)
    assert try_twins(TASK, "light_tiles", tmp_path, 1) == first


def test_an_axis_card_holds_all_the_evidence(tmp_path, capsys):
    far = "task.id.x=[uniform,0.0,0.2]"  # with a stout first tile the chain of index 1 leaves the table
    argv = ("axis", "task=domino_single", "axis=stout_starter", "n=2", "rounds=2", far, f"to={tmp_path}")
    assert cli.run((*argv, "certify.robust.runs=1", "certify.robust.bound=0.04")) == 0
    card = json.loads((tmp_path / "card.json").read_text())
    assert card["proofs"][0]["parameter"] == "starter.thickness" and card["proofs"][0]["gap"] == pytest.approx(0.014)
    assert card["funnel"]["certified"] == 2 and [s["count"] for s in card["behaviour"]] == [1, 0, 1, 0]
    assert card["reasons"]["feasible: the chain leaves the table"] == card["funnel"]["proposed"] - 2
    assert card["boundaries"]["replay"]["trials"] == 8 and card["energy"]["distance"] > 1
    page = (tmp_path / "card.html").read_text()
    assert "true extrapolation" in page and 'src="http' not in page and "<script" not in page
    longer = [a.replace("rounds=2", "rounds=3") for a in argv]
    assert cli.run((*longer, "certify.robust.runs=1", "certify.robust.bound=0.04")) == 0, "a card can be continued"
    assert json.loads((tmp_path / "card.json").read_text())["boundaries"]["replay"]["trials"] > 8


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (("axis=wide_gap",), "did you mean 'wide_gaps'"),
        (("axis=id",), "no axis of domino_single named 'id'"),
        (("axis=diagonal", "n=1"), "n = 1; it must be at least 2"),
        ((), "axis needs axis=..."),
    ],
)
def test_bad_input_is_told_in_one_line(argv, says, capsys, tmp_path):
    status = cli.run(("axis", "task=domino_single", f"to={tmp_path}", *argv))
    told = capsys.readouterr().err
    assert status == 2 and says in told and told.count("\n") == 1
