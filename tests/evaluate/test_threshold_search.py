"""A search finds the level at which a policy breaks, says where it does not know, and its lines prove what was run."""

import json
import re
import shutil
from dataclasses import replace

import helpers
import numpy as np
import pools
import pytest
from scipy.special import expit, logit

from scengen import cli, load_task
from scengen.errors import BadConfig, UnknownName
from scengen.evaluate.lines import read_lines, renewed
from scengen.evaluate.player import PolicyPlayer
from scengen.evaluate.threshold.curves import LOOKS_AT_LEVEL, Curves
from scengen.evaluate.threshold.pools import Candidate
from scengen.evaluate.threshold.search import Search
from scengen.evaluate.threshold.settings import ThresholdSettings
from scengen.evaluate.threshold.shift import Shift
from scengen.evaluate.threshold.simulation import simulate
from scengen.evidence import ledger
from scengen.evidence.ledger import Evidence
from scengen.pool import Pool
from scengen.pool.collection import write_index
from scengen.tasks.domino_single import DominoSingle

LEVELS = np.arange(6)
LAPSES = (0.85, 0.05)
"""Success of a policy with lapses on either side of its fall."""
LAPSE_SHIFT = 0.3 * logit((0.5 - LAPSES[1]) / (LAPSES[0] - LAPSES[1]))
"""Distance from the middle of such a fall to one half [levels]."""
SHAPES = {
    "steep": lambda point: expit((point - LEVELS) / 0.1),
    "shallow, 90 to 10 % over 2.5 levels": lambda point: expit((point - LEVELS) / 0.57),
    "linear over 2.5 levels": lambda point: np.clip(0.5 + 0.4 * (point - LEVELS), 0, 1),
    "step": lambda point: (LEVELS < point) * 1.0,
    "lapses": lambda point: LAPSES[1] + (LAPSES[0] - LAPSES[1]) * expit((point + LAPSE_SHIFT - LEVELS) / 0.3),
}
"""Curves of success by the level at which they cross one half."""
RETURNING = {
    "dip": ((0.95, 0.95, 0.1, 0.9, 0.9, 0.1), 1.53),
    "wide dip": ((0.9, 0.2, 0.2, 0.8, 0.8, 0.7), 0.57),
    "late dip": ((0.9, 0.9, 0.9, 0.2, 0.9, 0.9), 2.57),
}
"""Curves that are not monotone, and where lines between their levels first cross one half."""


def points(count):
    """Breaking points all over the levels, those on levels and next to them included."""
    return 0.5 + 4 * (np.arange(count) + 0.5) / count


def report(name, found, where):
    width = found.high - found.low
    print(
        f"{name}: covered {found.covers(where):.3f}, width {width.mean():.2f} (median {np.median(width):.2f}), "
        f"{found.looks.mean():.1f} rollouts, not monotone {found.returns.mean():.3f}"
    )
    return width


@pytest.mark.parametrize("count", [40, pytest.param(400, marks=pytest.mark.slow)])
@pytest.mark.parametrize("shape", SHAPES)
def test_sixty_rollouts_give_an_interval_of_a_level_that_holds_the_breaking_point(shape, count):
    where = points(count)
    found = simulate(np.array([SHAPES[shape](point) for point in where]))
    width = report(shape, found, where)
    assert found.covers(where) >= (0.93 if count > 100 else 0.85)  # below 0.85: 1 in 10 000 if 0.95 are covered
    assert np.median(width) <= 1.05 + 1e-6 and width.mean() <= 1.5 and found.looks.max() <= 60
    assert found.returns.mean() <= 0.05


@pytest.mark.slow
@pytest.mark.parametrize("shape", RETURNING)
def test_a_curve_that_is_not_monotone_is_reported_as_such(shape):
    chances, first = RETURNING[shape]
    where = np.full(300, first)
    found = simulate(np.tile(chances, (300, 1)))
    report(shape, found, where)
    assert found.returns.mean() >= 0.93 and found.covers(where) >= 0.93


@pytest.mark.slow
@pytest.mark.parametrize(("chance", "truth"), [(0.97, 6), (0.7, 6), (0.6, 6), (0.4, -1), (0.3, -1), (0.03, -1)])
def test_a_shift_without_effect_breaks_nothing(chance, truth):
    where = np.full(300, truth)
    found = simulate(np.full((300, 6), chance))
    report(f"always {chance}", found, where)
    assert found.covers(where) >= 0.88 and found.returns.mean() <= 0.12


@pytest.mark.slow
def test_a_fall_over_the_whole_axis_needs_more_than_sixty_rollouts():
    where = 1.8 + 1.4 * points(400) / 5
    curves = np.clip(0.5 + 0.2 * (where[:, None] - LEVELS), 0, 1)
    few, many = simulate(curves), simulate(curves, budget=200)
    assert np.median(report("whole axis", few, where)) > np.median(report("whole axis, 200", many, where))
    assert few.covers(where) >= 0.88 and many.covers(where) >= 0.9


def test_another_success_rate_moves_the_breaking_point():
    where = points(60)
    curves = np.array([expit((point - LEVELS) / 0.1) * 0.4 for point in where])
    assert simulate(curves, success=0.2).covers(where) >= 0.85
    assert (simulate(curves).low < 0).mean() >= 0.9  # never above one half


def test_looks_that_all_succeed_or_fail_leave_no_breaking_point():
    tried = np.full((2, 6), 8)
    found = Curves(5).estimates(tried, tried * np.array([[1], [0]]))
    assert found.low[0] >= 5 and found.high[0] == 6 and found.high[1] <= 0 and found.low[1] == -1


def test_a_rise_after_a_fall_is_reported_and_the_first_fall_counts():
    tried = np.full((1, 6), 6)
    found = Curves(5).estimates(tried, np.array([[6, 6, 0, 6, 6, 0]]))
    assert found.returns[0] and (found.fallen[0], found.risen[0]) == (2, 3) and 1 <= found.low[0] < found.high[0] <= 2.1


def test_a_suspected_rise_is_looked_at_again():
    tried, solved = np.full((1, 6), 3), np.array([[3, 3, 2, 3, 0, 0]])
    assert Curves(5).next_level(tried, solved)[0] in (2, 3)
    assert Curves(5).next_level(tried, np.array([[3, 3, 3, 0, 0, 0]]))[0] in (2, 3)  # next to the fall
    nowhere = np.array([[True, True, False, False, True, True]])
    assert Curves(5).next_level(tried, solved, nowhere)[0] in (0, 1, 4, 5)


# --- the search -----------------------------------------------------------------------------------


class Scenes:
    """Scenarios of an axis without files: as many as wanted, or a few for each level."""

    def __init__(self, shift, per_level=None):
        self.shift, self.is_drawn = shift, per_level is None
        self.there = {level: self._some(level, 0, per_level or 6) for level in range(shift.levels + 1)}

    def _some(self, level, start, count):
        return [Candidate(level, index, f"{level}-{index}", "", "pool") for index in range(start, start + count)]

    def candidates(self, level):
        return self.there[level]

    def draw(self, level):
        self.there[level] += self._some(level, len(self.there[level]), 6)


def searched(level_outcome, per_level=None, **changed):
    """The rollouts of a search, given the outcome at a level."""
    shift = Shift.of("domino_single", "low_starter")
    settings = ThresholdSettings(policy="idle", task="domino_single", along="low_starter", **changed)
    outcomes, rounds = {}, []
    for some in Search(settings, Scenes(shift, per_level), {"0-0": "lost"}).rounds(outcomes):
        rounds.append(some)
        outcomes |= {which: level_outcome(int(which.scenario.partition("-")[0])) for which in some}
    return rounds


def test_a_search_uses_each_scenario_once_and_ends_between_two_levels():
    rounds = searched(lambda level: level < 3)
    every = [which for some in rounds for which in some]
    assert len(rounds[0]) == LOOKS_AT_LEVEL * 6 and len({*every}) == len(every) <= 40
    assert "0-0" not in [which.scenario for which in every]
    later = [which.scenario[0] for some in rounds[1:] for which in some]
    assert {*later} <= {"2", "3"} and rounds == searched(lambda level: level < 3)


def test_a_search_ends_with_its_budget_and_with_its_scenarios():
    rng = np.random.default_rng(0)
    assert sum(map(len, searched(lambda level: rng.random() < 0.55, budget=31))) == 30
    assert sum(map(len, searched(lambda level: rng.random() < 0.55, per_level=3))) == 17  # one of them is lost


def test_crashes_count_for_nothing_and_use_up_the_budget():
    assert sum(map(len, searched(lambda level: None, budget=24))) == 24


def test_a_search_without_outcomes_stops():
    shift = Shift.of("domino_single", "low_starter")
    settings = ThresholdSettings(policy="idle", task="domino_single", along="low_starter")
    assert len([*Search(settings, Scenes(shift)).rounds({})]) == 1


# --- shifts ---------------------------------------------------------------------------------------


def test_levels_are_equal_parts_of_an_axis_and_of_a_perturbation():
    axis = Shift.of("domino_single", "low_starter")
    assert (axis.levels, axis.split(0), axis.split(2), axis.perturbation(2)) == (5, "id", "low_starter@2", "none")
    assert axis.value(5) == "starter.height 0.05 m" and axis.value(2.5) == "starter.height 0.065 m"
    assert axis.level_of("low_starter@2", "none") == 2 and axis.level_of("diagonal", "none") is None
    kind = Shift.of("domino_single", "blur")
    assert (kind.levels, kind.split(3), kind.perturbation(3), kind.perturbation(0)) == (5, "id", "blur@3", "none")
    assert kind.value(1) == "1.9 pixels of 256" and kind.level_of("id", "blur@5") == 5
    assert Shift.of("domino_single", "wide_gaps").task is load_task("domino_single")  # its own severities
    assert Shift.of("domino_single", "wide_gaps", 2).value(2).startswith("gap_ratio 1.89")


def test_the_oracle_is_shown_in_levels(monkeypatch):
    """Cards of axes as `scengen measure kind=axis` stores them."""
    stored = {"low_starter": "1.29 [0.83, 1.66], starter.height 0.0413", "wide_gaps": "4.27 [2.19, 6.48], gap_ratio 2"}
    cards = {
        axis: Evidence("domino_single", 2, axis, "axis", 20, {"boundaries": {"oracle": boundary}}, {}, "0")
        for axis, boundary in stored.items()
    }
    latest = ledger.latest
    monkeypatch.setattr(ledger, "latest", lambda kind, task: cards if kind == "axis" else latest(kind, task))
    assert Shift.of("domino_single", "low_starter").oracle.startswith("the oracle breaks at level 6.5 [4.1, 8.3]")
    assert Shift.of("domino_single", "low_starter", 10).oracle.startswith("the oracle breaks at level 12.9 [8.3, 16.6]")
    limited = Shift.of("domino_single", "wide_gaps").oracle  # its fifth level is the limit of an earlier card
    middle = float(limited.split("level ")[1].split(" [")[0])
    edge, far, limit = 1.2, 1.4, 1.89
    assert middle == pytest.approx(4.27 * 5 * (far - edge) / (limit - edge), abs=0.06)
    assert "not affected" in Shift.of("domino_single", "noise").oracle
    assert "at levels 1 to 5" in Shift.of("domino_single", "action_delay").oracle


@pytest.mark.parametrize(
    ("along", "levels", "error", "says"),
    [
        ("low_start", None, UnknownName, r"did you mean 'low_starter'\?"),
        ("blur", 7, BadConfig, "perturbation blur has 5: leave levels= out"),
        ("action_delay", 3, BadConfig, "perturbation action_delay has 5"),
    ],
)
def test_a_shift_that_does_not_exist_is_refused(along, levels, error, says):
    with pytest.raises(error, match=says):
        Shift.of("domino_single", along, levels)


def test_an_axis_of_whole_numbers_has_levels_where_they_fit():
    with pytest.raises(BadConfig, match=r"must be a whole number.*pass another levels="):
        Shift.of("domino_select", "longer", 7)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["along=blur"], "affects all cameras, and none is observed"),
        (["along=reworded"], "policy idle gets no text"),
        (["along=low_starter", "budget=17"], "pass budget=18 or more"),
        (["along=low_starter", "success=1.5"], r"it must lie in \[0.05, 0.95\]"),
        (["along=low_starter", "task.horizon=3"], "a search is about tasks as they are"),
        (["along=low_starter", f"pool={helpers.REFERENCE}"], "no scenario of domino_single, split low_starter@1"),
        (["along=low_starter", "rollouts=3"], "rollouts"),
    ],
)
def test_bad_input_is_one_line_before_anything_is_certified(words, says, capsys, tmp_path):
    words = ["evaluate", "threshold", "policy=idle", "task=domino_single", f"to={tmp_path / 'out'}", *words]
    assert cli.run(words) == 2
    assert re.search(says, capsys.readouterr().err) and not (tmp_path / "out" / "pools").exists()


# --- a run ----------------------------------------------------------------------------------------

WORDS = ("evaluate", "threshold", "policy=random", "task=domino_single", "along=proprioception_noise")


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """A search with short episodes, whose outcomes a level decides: success below level 3."""
    patch, folder = pytest.MonkeyPatch(), tmp_path_factory.mktemp("threshold")
    patch.setattr(DominoSingle, "failure", lambda self, world: "too late" if world.time > 0.1 else None)
    usual = PolicyPlayer.__call__

    def played(self, batch):
        records = usual(self, batch)
        for record in records:
            if record["perturbation"] == "none" or record["perturbation"][-1] < "3":
                record |= {"success": True, "reason": ""}
        return records

    patch.setattr(PolicyPlayer, "__call__", played)
    copies = []
    for seed in range(100, 116):
        copies.append(folder / "pools" / str(seed))
        shutil.copytree(helpers.REFERENCE, copies[-1])
        pools.rewritten(copies[-1], lambda row, seed=seed: replace(row, seed=seed))
    write_index(folder / "pools", [Pool.open(copy) for copy in copies])
    given = f"pool={folder / 'pools'}"
    assert cli.run([*WORDS, given, "format=[profile]", f"to={folder / 'whole'}"]) == 0
    yield folder, given
    patch.undo()


def test_a_search_says_where_the_policy_breaks(found, capsys):
    folder, given = found
    assert cli.run([*WORDS, given, f"to={folder / 'whole'}"]) == 0
    out = capsys.readouterr().out
    assert "random: breaks at level 2.5 of proprioception_noise [2.0, 3.0]" in out and "from an earlier run" in out
    table = json.loads((folder / "whole" / "table.json").read_text())
    assert table["threshold"]["monotone"] and (table["threshold"]["low"], table["threshold"]["high"]) == (2, 3)
    assert sum(level["rate"]["rollouts"] for level in table["threshold"]["levels"]) == len(
        read_lines(folder / "whole" / "episodes.jsonl")
    )
    assert (folder / "whole" / "threshold_dark.svg").read_bytes().startswith(b"<?xml")


def test_a_search_that_was_cut_short_goes_on_and_gives_the_same_bytes(found, tmp_path):
    folder, given = found
    shutil.copytree(folder / "whole", tmp_path / "cut")
    lines = read_lines(tmp_path / "cut" / "episodes.jsonl")
    identity = json.loads((tmp_path / "cut" / "run.json").read_text())
    text = "".join(json.dumps(line) + "\n" for line in renewed(identity, lines[5:16]))
    (tmp_path / "cut" / "episodes.jsonl").write_text(text + '{"episode": 11, "poli')
    assert cli.run([*WORDS, given, "slots=3", f"to={tmp_path / 'cut'}"]) == 0
    assert (tmp_path / "cut" / "episodes.jsonl").read_bytes() == (folder / "whole" / "episodes.jsonl").read_bytes()


def test_results_verify_wherever_the_pools_are(found, tmp_path, capsys):
    folder, _ = found
    assert cli.run(["verify", f"results={folder / 'whole'}", "level=full"]) == 0
    shutil.copytree(folder, tmp_path / "moved")
    (folder / "pools").rename(folder / "elsewhere")
    try:
        assert (
            cli.run(["verify", f"results={tmp_path / 'moved' / 'whole'}", f"pool={tmp_path / 'moved' / 'pools'}"]) == 0
        )
    finally:
        (folder / "elsewhere").rename(folder / "pools")


def other_outcome(lines):
    last = next(line for line in reversed(lines) if line["success"])
    last |= {"success": False, "reason": "too late"}
    return lines


@pytest.mark.parametrize(
    "forge",
    [
        pytest.param(lambda lines: lines[:-1], id="dropped"),
        pytest.param(other_outcome, id="another outcome, which would have led elsewhere"),
        pytest.param(
            lambda lines: [line for line in lines if line["perturbation"] != "proprioception_noise@5"], id="a level"
        ),
    ],
)
def test_a_search_with_chosen_rollouts_is_refuted(found, tmp_path, forge, capsys):
    folder, _ = found
    shutil.copytree(folder / "whole", tmp_path / "forged")
    identity = json.loads((tmp_path / "forged" / "run.json").read_text())
    lines = renewed(identity, forge(read_lines(tmp_path / "forged" / "episodes.jsonl")))
    (tmp_path / "forged" / "episodes.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert cli.run(["verify", f"results={tmp_path / 'forged'}"]) == 1


@pytest.mark.parametrize("name", ["along", "success", "levels", "seed"])
def test_a_table_of_another_search_is_refuted(found, tmp_path, name, capsys):
    folder, _ = found
    shutil.copytree(folder / "whole", tmp_path / "other")
    path = tmp_path / "other" / "table.json"
    table = json.loads(path.read_text())
    table["settings"][name] = {"along": "object_noise", "success": 0.4, "levels": 5, "seed": 3}[name]
    path.write_text(json.dumps(table))
    assert cli.run(["verify", f"results={tmp_path / 'other'}"]) in (1, 2)
    if name == "seed":
        told = capsys.readouterr().err
        assert "table.json is of a search with seed = 3, run.json of one with 7400" in told
        assert "is missing" not in told


def test_pools_at_other_points_of_the_axis_are_refused(tmp_path):
    shift = Shift.of("domino_single", "low_starter")
    shift.check_values(5, {"starter.height": 0.05}, "here")
    with pytest.raises(BadConfig, match=r"starter.height = 0.062 in split low_starter@5; level 5 of 5 is 0.05"):
        shift.check_values(5, {"starter.height": 0.062}, "here")


@pytest.mark.slow
def test_fresh_scenarios_of_an_axis_are_certified_as_they_are_needed(tmp_path, capsys):
    words = ["evaluate", "threshold", "policy=oracle", "task=domino_single", "along=low_starter", "levels=2"]
    assert cli.run([*words, "budget=14", "workers=2", f"to={tmp_path / 'out'}"]) == 0
    assert "oracle: " in capsys.readouterr().out
    assert {"id", "low_starter@1", "low_starter@2"} <= {path.name for path in (tmp_path / "out" / "pools").iterdir()}
    assert cli.run(["verify", f"results={tmp_path / 'out'}"]) == 0
