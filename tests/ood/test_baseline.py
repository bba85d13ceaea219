"""Findings about one baseline on an axis, the verdict on the axis, and the records of both."""

import pytest

from scengen.errors import BadConfig
from scengen.evaluate.statistics import paired, rate, smallest_visible_drop
from scengen.ood.baseline import INCONCLUSIVE, MIN_TWINS, Baseline, verdict, verdict_of_twins


def baseline(name, training, here, own=1.0):
    """A baseline that solved so many of 20 in either arm."""
    return Baseline.of(name, "moved within training", [(i < training, i < here) for i in range(20)], own)


@pytest.mark.parametrize(
    ("training", "here", "own", "finding"),
    [
        (20, 0, 1.0, "breaks"),
        (20, 20, 1.0, "holds"),
        (8, 7, 1.0, "holds"),
        (4, 0, 1.0, "too weak"),
        (20, 0, 0.8, "too weak"),
    ],
)
def test_a_baseline_counts_where_it_works_within_training(training, here, own, finding):
    assert baseline("replay", training, here, own).finding == finding


def test_the_verdict_names_every_kind_that_breaks_and_the_strongest_memory():
    broken, intact, weak = baseline("replay", 20, 0), baseline("object_centric", 20, 20), baseline("any_replay", 2, 0)
    assert verdict([broken, weak, intact]) == "breaks motion memory"
    assert verdict([broken, baseline("any_object_centric", 19, 2)]) == "breaks object-centric memory"
    assert verdict([intact, baseline("belief", 20, 3)]) == "breaks belief"
    assert verdict([intact, baseline("hidden_belief", 20, 3)]) == "breaks belief"
    learner = baseline("mip", 18, 1)
    assert verdict([learner, baseline("belief", 20, 3), broken]) == "breaks motion memory, belief, learner"


def test_too_few_twins_get_no_verdict_but_the_number_that_it_takes():
    broken = baseline("replay", 20, 0)
    assert verdict_of_twins([broken], MIN_TWINS) == "breaks motion memory"
    assert verdict_of_twins([broken], 6) == "none: n = 6 is too small, a verdict takes 10 twins or more"
    assert smallest_visible_drop(1.0, MIN_TWINS) == 0.5 < smallest_visible_drop(1.0, MIN_TWINS - 1)


def test_an_axis_that_breaks_nothing_is_solved_by_the_first_kind_that_works_or_inconclusive():
    weak = baseline("replay", 2, 0)
    assert verdict([weak, baseline("object_centric", 20, 20)]) == "solved by object-centric memory"
    assert verdict([weak, baseline("belief", 20, 20), baseline("bc", 20, 20)]) == "solved by belief"
    assert verdict([weak]) == verdict([]) == INCONCLUSIVE, "a baseline that fails in training too is no evidence"
    assert verdict([Baseline.of("replay", "held-out training", [])]) == INCONCLUSIVE
    assert verdict([baseline("belief", 12, 9)]) == INCONCLUSIVE, "neither lost nor known to solve most"


def test_a_record_gives_the_same_baseline_with_its_paired_interval():
    arms = [(True, False), (True, True), (False, True), (True, False), (False, False)]
    made = Baseline.of("belief", "moved within training", arms, own=0.95)
    assert made.excess == paired([[a] for a, _ in arms], [[b] for _, b in arms])
    assert (made.training, made.both) == (rate([[a] for a, _ in arms]), 1)
    assert Baseline.of_record(made.record) == made
    empty = Baseline.of("belief", "moved within training", [])
    assert Baseline.of_record(empty.record) == empty and empty.finding == "not tried"


@pytest.mark.parametrize("changed", [{"both": 4}, {"here": 20}, {"both": -1}, {"twins": None}, {"name": ...}])
def test_a_record_whose_counts_are_impossible_is_refused(changed):
    record = baseline("belief", 3, 2).record | changed
    with pytest.raises(BadConfig, match="record"):
        Baseline.of_record({key: value for key, value in record.items() if value is not ...})
