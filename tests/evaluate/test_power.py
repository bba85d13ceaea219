"""The power analysis against the textbook and against what evaluation does."""

import json
import math
from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest
from scipy.stats import beta, norm

from scengen import cli
from scengen.errors import BadConfig
from scengen.evaluate.power import PowerAnalysis, seeds_for
from scengen.evaluate.statistics import correlation, difference, paired, rate


def textbook(p, q, significance=0.05, power=0.8):
    """Sample size per group for two independent proportions (Fleiss, Levin and Paik 2003, eq. 4.14)."""
    a, b = NormalDist().inv_cdf(1 - significance / 2), NormalDist().inv_cdf(power)
    middle = (p + q) / 2
    both = a * math.sqrt(2 * middle * (1 - middle)) + b * math.sqrt(p * (1 - p) + q * (1 - q))
    return (both / (p - q)) ** 2


@pytest.mark.parametrize(("p", "q"), [(0.9, 0.85), (0.7, 0.6)])
def test_without_clustering_it_comes_near_the_textbook_formula_for_two_proportions(p, q):
    """From above: the intervals keep what they promise at any success rate, normal ones do not."""
    needed = math.ceil(textbook(p, q))
    analysis = PowerAnalysis(seeds=needed, rollouts=1, correlation=0.0)
    assert analysis.chance(p, q) < 0.82 and replace(analysis, seeds=round(1.1 * needed)).chance(p, q) > 0.79


def test_the_textbooks_own_example():
    """60 % against 70 % at 5 %, 80 % power: 356 a group (Fleiss, Levin and Paik 2003, table A.4 without correction)."""
    assert math.ceil(textbook(0.6, 0.7)) == 356


def test_rollouts_of_one_scenario_that_end_alike_count_once():
    alike, single = PowerAnalysis(rollouts=5, correlation=1.0), PowerAnalysis(rollouts=1, correlation=1.0)
    assert alike.effective == single.effective == 20
    assert alike.chance(0.7, 0.2) == pytest.approx(single.chance(0.7, 0.2), abs=0.05)
    assert PowerAnalysis(rollouts=5, correlation=0.0).effective == 100


def test_what_the_paper_reports_as_a_gain_of_12_points_is_no_finding_at_20_by_5():
    assert PowerAnalysis(correlation=0.0).chance(0.28, 0.40) < 0.5
    assert PowerAnalysis(correlation=0.5).chance(0.28, 0.40) < 0.2


def test_more_of_anything_finds_smaller_drops_and_more_questions_larger_ones():
    drop = PowerAnalysis().smallest_drop(0.7)
    assert PowerAnalysis(seeds=40).smallest_drop(0.7) < drop and PowerAnalysis(rollouts=20).smallest_drop(0.7) < drop
    assert PowerAnalysis(twins=0.8).smallest_drop(0.7) < drop < PowerAnalysis(comparisons=4).smallest_drop(0.7)
    assert PowerAnalysis(seeds=5, correlation=1.0).smallest_drop(0.2) is None
    assert seeds_for(PowerAnalysis(), 0.7, 0.001) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seeds", "rollouts", "twins", "before"),
    [(20, 5, 0.0, 0.7), (20, 5, 0.9, 0.7), (50, 5, 0.5, 0.7), (8, 5, 0.5, 0.9), (20, 1, 0.0, 0.9)],
)
def test_the_analysis_of_simulated_evaluations_finds_the_smallest_drop_as_often_as_promised(
    seeds, rollouts, twins, before
):
    drop = PowerAnalysis(seeds=seeds, rollouts=rollouts, twins=twins).smallest_drop(before)
    random = np.random.default_rng(9)
    normal = random.standard_normal((2, 3000, seeds))
    normal[1] = twins * normal[0] + math.sqrt(1 - twins**2) * normal[1]
    sides = [
        random.binomial(rollouts, beta.ppf(norm.cdf(z), p, 1 - p)) / rollouts  # of correlation 1 / (p + 1 - p + 1)
        for p, z in zip((before, before - drop), normal, strict=True)
    ]
    found = 0
    for a, b in zip(*(side[..., None].tolist() for side in sides), strict=True):
        found += (paired(a, b) if twins else difference(rate(a), rate(b))).low > 0
    assert found / 3000 == pytest.approx(0.8, abs=0.03)


def test_the_smallest_drop_is_found_where_nothing_is_left_to_chance():
    """Twins that share everything: whatever differs is the axis."""
    assert 0.1 < PowerAnalysis(twins=1.0, correlation=1.0).smallest_drop(0.7) < 0.3


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


@pytest.mark.slow
def test_the_command_answers_both_ways(tmp_path, capsys):
    told = tmp_path / "power.json"
    arguments = ("seeds=8", "rollouts=12", "correlation=0", "success=0.7", "drop=0.2", f"json={told}")
    assert cli.run(("evaluate", "power", *arguments)) == 0
    result = json.loads(told.read_text())
    assert 8 < result["seeds_needed"] < 30 and 0.2 < result["smallest_drop"] < 0.5
    assert "a drop of" in capsys.readouterr().out
    assert cli.run(("evaluate", "power", "success=0.5", "drop=0.6")) == 2
    assert cli.run(("evaluate", "power", "seeds=1")) == 2
