"""The power analysis against the textbook and against simulated experiments."""

import json
import math
from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest

from scengen import cli
from scengen.errors import BadConfig
from scengen.evaluate.power import PowerAnalysis, seeds_for
from scengen.statistics import correlation


def textbook(p, q, significance=0.05, power=0.8):
    """Sample size per group for two independent proportions (Fleiss, Levin and Paik 2003, eq. 4.14)."""
    a, b = NormalDist().inv_cdf(1 - significance / 2), NormalDist().inv_cdf(power)
    middle = (p + q) / 2
    both = a * math.sqrt(2 * middle * (1 - middle)) + b * math.sqrt(p * (1 - p) + q * (1 - q))
    return (both / (p - q)) ** 2


@pytest.mark.parametrize(("p", "q"), [(0.9, 0.8), (0.7, 0.5), (0.5, 0.2)])
def test_without_clustering_it_is_the_textbook_formula_for_two_proportions(p, q):
    analysis = PowerAnalysis(seeds=20, rollouts=5, correlation=0.0)
    assert seeds_for(analysis, p, p - q) == math.ceil(textbook(p, q) / 5)
    drop = analysis.smallest_drop(p)
    assert textbook(p, p - drop) == pytest.approx(100, rel=1e-6)


def test_the_textbooks_own_example():
    """60 % against 70 % at 5 %, 80 % power: 356 a group (Fleiss, Levin and Paik 2003, table A.4 without correction)."""
    assert math.ceil(textbook(0.6, 0.7)) == 356
    assert seeds_for(PowerAnalysis(rollouts=1, correlation=0.0), 0.7, 0.1) == 356


def test_rollouts_of_one_scenario_that_end_alike_count_once():
    alike, single = PowerAnalysis(rollouts=5, correlation=1.0), PowerAnalysis(rollouts=1, correlation=0.3)
    assert alike.effective == single.effective == 20
    assert alike.smallest_drop(0.7) == pytest.approx(single.smallest_drop(0.7))
    assert PowerAnalysis(rollouts=5, correlation=0.0).effective == 100


def test_what_the_paper_reports_as_a_gain_of_12_points_is_no_finding_at_20_by_5():
    assert PowerAnalysis(correlation=0.0).chance(0.28, 0.40) < 0.5
    assert PowerAnalysis(correlation=0.5).chance(0.28, 0.40) < 0.2


def test_more_of_anything_finds_smaller_drops_and_more_questions_larger_ones():
    drop = PowerAnalysis().smallest_drop(0.7)
    assert PowerAnalysis(seeds=40).smallest_drop(0.7) < drop and PowerAnalysis(rollouts=20).smallest_drop(0.7) < drop
    assert PowerAnalysis(twins=0.8).smallest_drop(0.7) < drop < PowerAnalysis(comparisons=24).smallest_drop(0.7)
    assert PowerAnalysis(seeds=5, correlation=1.0).smallest_drop(0.2) is None
    assert seeds_for(PowerAnalysis(), 0.7, 0.001) is None


def rates(rng, p, correlation, seeds, rollouts, experiments, ranks=None):
    """Success rates of whole experiments; the scenarios' difficulties are beta-distributed."""
    size = (1 - correlation) / correlation
    from scipy.stats import beta

    ranks = rng.random((experiments, seeds)) if ranks is None else ranks
    return rng.binomial(rollouts, beta.ppf(ranks, p * size, (1 - p) * size)) / rollouts


@pytest.mark.parametrize(("seeds", "correlation"), [(60, 0.3), (20, 0.5)])
def test_simulated_experiments_find_the_smallest_drop_as_often_as_promised(seeds, correlation):
    analysis, rng, n = PowerAnalysis(seeds=seeds, correlation=correlation), np.random.default_rng(0), 2000
    drop = analysis.smallest_drop(0.7)
    before = rates(rng, 0.7, correlation, seeds, 5, n).mean(1)
    after = rates(rng, 0.7 - drop, correlation, seeds, 5, n).mean(1)
    middle = (before + after) / 2
    error = np.sqrt(2 * middle * (1 - middle) / analysis.effective)
    assert np.mean(np.abs(before - after) > 1.96 * error) == pytest.approx(0.8, abs=0.04)


def test_twins_of_equal_difficulty_vary_less_by_what_the_formula_says():
    analysis, rng, n = PowerAnalysis(seeds=30, correlation=0.5, twins=1.0), np.random.default_rng(1), 4000
    ranks = rng.random((n, 30))
    one, other = (rates(rng, 0.6, 0.5, 30, 5, n, ranks).mean(1) for _ in range(2))
    assert np.std(one - other) == pytest.approx(analysis._error(0.6, 0.6), rel=0.05)


def test_the_correlation_that_is_asked_for_can_be_measured():
    rng = np.random.default_rng(2)
    outcomes = rng.random((400, 5)) < rng.beta(0.7, 0.3, (400, 1))  # 1 / (0.7 + 0.3 + 1) = 0.5
    assert correlation(outcomes.tolist()) == pytest.approx(0.5, abs=0.06)


@pytest.mark.parametrize(
    "wrong", [{"seeds": 1}, {"rollouts": 0}, {"correlation": 1.5}, {"twins": -0.1}, {"power": 1.0}, {"comparisons": 0}]
)
def test_an_analysis_that_makes_no_sense_is_refused(wrong):
    with pytest.raises(BadConfig, match=next(iter(wrong))):
        replace(PowerAnalysis(), **wrong)


def test_the_command_answers_both_ways(tmp_path, capsys):
    told = tmp_path / "power.json"
    arguments = ("seeds=20", "rollouts=5", "correlation=0", "success=0.7", "drop=0.2", f"json={told}")
    assert cli.run(("power", *arguments)) == 0
    result = json.loads(told.read_text())
    assert result["seeds_needed"] == math.ceil(textbook(0.7, 0.5) / 5) and result["smallest_drop"] < 0.2
    assert "a drop of" in capsys.readouterr().out
    assert cli.run(("power", "success=0.5", "drop=0.6")) == 2
    assert cli.run(("power", "seeds=1")) == 2
