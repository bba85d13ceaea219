"""The search for axes: regions outside training, what it finds of a planted truth, and what it writes."""

import json
import sys

import numpy as np
import pytest
import yaml
from scipy import stats

from scengen import cli, list_tasks, load_task
from scengen.errors import BadConfig
from scengen.ood import behaviour
from scengen.ood.discovery import candidates, confirmation, proposal
from scengen.ood.discovery.regions import located, regions
from scengen.ood.discovery.search import DiscoverSettings, discover
from scengen.ood.discovery.trial import (
    BREAKS,
    CONFIRM,
    HOLDS,
    INFEASIBLE,
    Place,
    Point,
    Range,
    RegionBox,
    SearchTrial,
    TrialRunner,
)
from scengen.samplers.axis import Axis
from scengen.samplers.dists import Fixed, parse
from scengen.samplers.support import distance
from scengen.samplers.task import load
from scengen.validate.settings import QUICK

TASK = load_task("domino_single")
KNOWN = regions(TASK)


@pytest.mark.parametrize("name", list_tasks())
def test_every_place_of_every_region_is_within_bounds_and_outside_training(name):
    task = load_task(name)
    for region in regions(task):
        known = region.parameter
        for place in (0.0, 0.01, 0.5, 0.99, 1.0):
            value = region.value(place)
            known.check(known.name, value)
            assert distance(task.training[known.name].support, Fixed(value).support, known.period) > 0
            assert located(region, value)


@pytest.mark.parametrize("name", ["domino_single", "packing"])
def test_every_range_of_places_of_every_region_can_be_an_axis(name):
    task = load_task(name)
    for region in regions(task):
        for low, high in ((0.0, 0.0), (0.0, 1.0), (0.1, 0.6), (0.4, 0.9)):
            dist = proposal.distribution(region, low, high)
            task.prove(Axis("found", "", "", {region.parameter.name: dist}))
            assert parse("axis", proposal.plain(dist)) == dist


def test_a_range_through_the_seam_of_a_circle_has_both_its_sides():
    turn = next(r for r in regions(load_task("packing")) if r.name == "spot_1_turn_from_minus_50")
    there = proposal.distribution(turn, 0.15, 0.9)
    assert there.parts[0].high == 180.0 and there.parts[1].low == -180.0
    middle = turn.value(0.6)
    assert any(part.low <= middle <= part.high for part in there.parts)


def test_regions_lie_between_training_values_and_beyond_them():
    named = {region.name: region for region in KNOWN}
    assert {"count_high", "count_low", "gap_ratio_high", "heading_from_0", "heading_from_90"} <= named.keys()
    assert "heading_high" not in named, "a circle has no end"
    assert named["count_low"].whole == [2] and named["count_high"].value(1.0) == 15
    assert -180 <= named["heading_from_90"].value(0.6) <= -90


def test_a_hypercube_uses_every_region_alike_and_spreads_its_places():
    reaches = dict.fromkeys(range(len(KNOWN)), (0.0, 1.0))
    points = candidates.hypercube(30 * len(KNOWN), reaches, np.random.default_rng(0))
    uses = [sum(i == k for point in points for i, _ in point) for k in range(len(KNOWN))]
    assert max(uses) - min(uses) <= 2 and {len(point.places) for point in points} == {1, 2}
    places = sorted(place for point in points for i, place in point if i == 0)
    assert all(abs(place - (k + 0.5) / len(places)) <= 0.5 / len(places) + 1e-6 for k, place in enumerate(places))


def test_a_point_far_out_is_in_the_outer_quarter_of_what_is_feasible_or_in_the_middle_between_training_values():
    reaches = dict.fromkeys(range(len(KNOWN)), (0.0, 0.5))
    points = dict(point.places[0] for point in candidates.far_points(KNOWN, reaches, np.random.default_rng(0)))
    assert points.keys() == reaches.keys()
    for k, place in points.items():
        low, high = (0.375, 0.5) if KNOWN[k].beyond else (0.1875, 0.3125)
        assert low <= place <= high


@pytest.fixture
def planted(monkeypatch):
    """A world in which the memory fails where the starter is low but not too low, or both heavy and stout."""

    def outcome(self, trained, memory, point):
        place = {self.known[i].name: p for i, p in point}
        if place.get("starter_height_low", 0.0) > 0.8:
            return INFEASIBLE
        pair = place.get("starter_mass_high", 0) > 0.2 and place.get("starter_thickness_high", 0) > 0.2
        return BREAKS if place.get("starter_height_low", 0.0) > 0.4 or pair else HOLDS

    monkeypatch.setattr(TrialRunner, "twin", lambda self, number: (TASK.family(), None))
    monkeypatch.setattr(TrialRunner, "outcome", outcome)
    monkeypatch.setattr(TrialRunner, "feasible", lambda *args: outcome(args[0], args[1], None, args[2]) != INFEASIBLE)
    monkeypatch.setattr(behaviour, "moved_within", lambda *_: TASK.family())
    monkeypatch.setattr(behaviour, "follows", lambda *_: True)


@pytest.mark.slow
def test_a_planted_axis_is_found_and_nothing_else(planted, tmp_path):
    search = discover(TASK, QUICK, DiscoverSettings(budget=400), tmp_path)
    names = {finding.axis.name for finding in search.findings}
    assert "starter_height_low" in names, "the planted one"
    assert names <= {"starter_height_low", "starter_thickness_high_and_starter_mass_high"}, "and no accident"
    found = next(f for f in search.findings if f.axis.name == "starter_height_low")
    low, high = (
        found.axis.replace["starter.height"].support[0].low,
        found.axis.replace["starter.height"].support[0].high,
    )
    region = next(r for r in KNOWN if r.name == "starter_height_low")
    assert region.value(0.85) <= low < high <= region.value(0.35)
    assert found.confirmed >= 9 and found.p < 0.05 and found.proofs[0].gap > 0 and "low_starter" in found.known
    assert sum(search.stages.values()) <= 400


@pytest.mark.slow
def test_a_memory_that_is_often_weak_is_judged_by_the_twins_in_which_it_is_not(planted, tmp_path, monkeypatch):
    fails = iter(range(10_000))
    monkeypatch.setattr(behaviour, "follows", lambda *_: next(fails) % 2 == 0)  # in every other control
    search = discover(TASK, QUICK, DiscoverSettings(budget=400, method="hypercube"), tmp_path)
    found = next(f for f in search.findings if f.axis.name == "starter_height_low")
    assert (found.confirmed, found.fresh, found.controls) == (20, 20, 20) and 8 <= found.within <= 12 and found.p < 0.05


def test_what_no_twin_allows_costs_no_trial(planted, tmp_path):
    search = discover(TASK, QUICK, DiscoverSettings(budget=200, method="hypercube"), tmp_path)
    low = next(k for k, region in enumerate(KNOWN) if region.name == "starter_height_low")
    places = [
        place
        for line in (tmp_path / "trials.jsonl").read_text().splitlines()[1:]
        for k, place, *_ in json.loads(line)["point"]
        if k == low and json.loads(line)["stage"] in ("far", "hypercube")
    ]
    assert places and max(places) <= 0.8125, "the region ends at the step in which the last twin is feasible"
    assert search.outcomes.get(INFEASIBLE, 0) <= 3


def test_a_point_goes_to_a_twin_in_which_it_is_feasible(planted, tmp_path, monkeypatch):
    twins = [TASK.family(count=number + 3) for number in range(confirmation.SEARCH_TWINS)]
    monkeypatch.setattr(TrialRunner, "twin", lambda self, number: (twins[number % len(twins)], None))
    monkeypatch.setattr(TrialRunner, "feasible", lambda self, trained, point: trained is twins[5])
    discover(TASK, QUICK, DiscoverSettings(budget=100, method="hypercube"), tmp_path)
    lines = (tmp_path / "trials.jsonl").read_text().splitlines()[1:]
    assert {json.loads(line)["twin"] for line in lines if json.loads(line)["stage"] == "hypercube"} == {5}


def _played(*twins):
    return [_confirming(HOLDS if holds else BREAKS, controls) for holds, controls in twins]


def _confirming(outcome, controls, reason=""):
    return SearchTrial(0, CONFIRM, RegionBox((Range(0, 0.0, 1.0),)), 0, outcome, tuple(controls), reason)


@pytest.mark.parametrize(("confirmed", "against"), [(0, 0), (3, 0), (8, 1), (5, 5), (1, 4)])
def test_with_one_control_the_confirmation_is_mcnemars_test(confirmed, against):
    twins = [(False, [True])] * confirmed + [(True, [False])] * against + [(True, [True])] * 3 + [(False, [False])] * 4
    expected = stats.binomtest(against, confirmed + against, 0.5, "less").pvalue if confirmed + against else 1.0
    assert confirmation.p_value(_played(*twins)) == pytest.approx(expected)


def test_a_memory_that_solves_one_of_three_controls_tells_a_quarter_each_time():
    assert confirmation.p_value(_played(*[(False, [True, False, False])] * 6)) == pytest.approx(0.75**6)
    assert confirmation.p_value(_played(*[(False, [False] * 3)] * 6)) == 1.0, "it solves nothing anywhere"
    assert confirmation.p_value([_confirming(INFEASIBLE, []), _confirming(BREAKS, [])]) == 1.0


@pytest.mark.parametrize("correlated", [False, True])
def test_what_breaks_nothing_is_confirmed_as_rarely_as_promised(correlated):
    random, found = np.random.default_rng(0), 0
    for _ in range(1000):
        ease = random.choice([0.1, 0.9], 20) if correlated else np.full(20, 0.4)
        solved = random.random((20, 4)) < ease[:, None]
        twins = _played(*[(bool(one), list(map(bool, rest))) for one, *rest in solved])
        found += any(confirmation.LOOKS * confirmation.p_value(twins[:n]) < 0.05 for n in (5, 10, 15, 20))
    assert found <= 0.06 * 1000, "whenever one looks"


def test_a_memory_that_fails_everywhere_alike_breaks_at_nothing(planted, tmp_path, monkeypatch):
    tried, fails = iter(range(10_000)), iter(range(10_000))
    monkeypatch.setattr(TrialRunner, "outcome", lambda *_: HOLDS if next(tried) % 3 == 0 else BREAKS)
    monkeypatch.setattr(behaviour, "follows", lambda *_: next(fails) % 3 == 0)
    search = discover(TASK, QUICK, DiscoverSettings(budget=400, method="hypercube"), tmp_path)
    assert search.findings == []


@pytest.mark.slow
def test_what_is_written_can_stand_in_a_task_file(planted, tmp_path):
    search = discover(TASK, QUICK, DiscoverSettings(budget=300), tmp_path)
    written = yaml.safe_load(search.as_yaml(TASK))
    assert written["axes"], "something was found"
    again = load(TASK.name, {**TASK.node, "axes": written["axes"]})
    assert set(again.proofs) == {finding.axis.name for finding in search.findings}


@pytest.mark.slow
def test_a_search_goes_on_where_it_ended(planted, tmp_path, monkeypatch):
    whole = discover(TASK, QUICK, DiscoverSettings(budget=100), tmp_path)
    lines = (tmp_path / "trials.jsonl").read_text().splitlines(keepends=True)
    (tmp_path / "trials.jsonl").write_text("".join(lines[:30]))
    assert discover(TASK, QUICK, DiscoverSettings(budget=100), tmp_path) == whole
    monkeypatch.setattr(TrialRunner, "outcome", None)
    assert discover(TASK, QUICK, DiscoverSettings(budget=100), tmp_path) == whole, "nothing is tried twice"


@pytest.mark.slow
def test_two_workers_try_what_one_does_also_after_a_kill_in_the_middle(planted, tmp_path):
    def tried(folder):
        return sorted(line.split('"outcome"')[0] for line in (folder / "trials.jsonl").read_text().splitlines()[1:])

    one, two = tmp_path / "one", tmp_path / "two"
    alone = discover(TASK, QUICK, DiscoverSettings(budget=300), one)
    assert alone.findings and discover(TASK, QUICK, DiscoverSettings(budget=300, workers=2), two) == alone
    head, *lines = (two / "trials.jsonl").read_text().splitlines(keepends=True)
    (two / "trials.jsonl").write_text("".join([head, lines[1], lines[0], lines[5], *lines[7:20]]))
    assert discover(TASK, QUICK, DiscoverSettings(budget=300, workers=2), two) == alone
    assert tried(two) == tried(one), "none is left out, none is made twice"


def test_a_search_that_finds_nothing_says_so(planted, tmp_path, monkeypatch):
    monkeypatch.setattr(TrialRunner, "outcome", lambda *_: HOLDS)
    search = discover(TASK, QUICK, DiscoverSettings(budget=40), tmp_path)
    assert search.findings == [] and yaml.safe_load(search.as_yaml(TASK)) == {"axes": {}}


def test_a_task_with_nothing_feasible_outside_training_is_told(planted, tmp_path, monkeypatch):
    monkeypatch.setattr(TrialRunner, "feasible", lambda *_: False)
    with pytest.raises(BadConfig, match="no value outside training is feasible"):
        discover(TASK, QUICK, DiscoverSettings(budget=100), tmp_path)


def test_real_trials_tell_a_memory_that_holds_from_one_that_breaks(tmp_path):
    trials = TrialRunner(TASK, QUICK, KNOWN, 0)
    number = {region.name: k for k, region in enumerate(KNOWN)}
    trained, memory = trials.twin(0)

    def at(region, place):
        return Point((Place(number[region], place),))

    assert trials.outcome(trained, memory, at("starter_height_low", 0.75)) == BREAKS
    assert trials.outcome(trained, memory, at("tile_mass_high", 0.2)) == HOLDS
    assert trials.outcome(trained, memory, at("x_high", 1.0)) == INFEASIBLE


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (("method=forrest",), "did you mean 'forest'"),
        (("budget=5",), "budget = 5; it must be at least 67"),
        (("task=domino_singel",), "did you mean 'domino_single'"),
    ],
)
def test_bad_input_is_told_in_one_line(argv, says, capsys, tmp_path):
    status = cli.run(("axis", "discover", "task=domino_single", f"to={tmp_path}", *argv))
    told = capsys.readouterr().err
    assert status == 2 and says in told and told.count("\n") == 1


def test_a_missing_forest_is_told_before_any_work(capsys, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn.ensemble", None)
    assert cli.run(("axis", "discover", "task=domino_single", f"to={tmp_path / 'found'}")) == 2
    told = capsys.readouterr().err
    assert "say pip install 'scengen[discover]', or method=hypercube" in told and told.count("\n") == 1
    assert not (tmp_path / "found").exists()
