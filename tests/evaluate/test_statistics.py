import numpy as np
import pytest
from scipy import stats

from scengen.statistics import correlation, difference, rate, wilson


def test_single_rollouts_give_wilsons_interval():
    found = rate([[True]] * 13 + [[False]] * 7)
    exact = stats.binomtest(13, 20).proportion_ci(method="wilson")
    assert (found.low, found.high) == pytest.approx((exact.low, exact.high), abs=1e-12)
    assert found.value == 0.65 and found.effective == 20


def test_rollouts_that_agree_within_each_scenario_count_once():
    found = rate([[True] * 5] * 10 + [[False] * 5] * 10)
    assert found.effective == pytest.approx(20) and found.rollouts == 100
    assert (found.low, found.high) == pytest.approx(wilson(0.5, 20))


def test_when_everything_succeeds_the_interval_is_that_of_the_scenarios():
    found = rate([[True] * 5] * 20)
    assert found.value == 1.0 and found.low == pytest.approx(wilson(1.0, 20)[0]) and found.low < 0.9


def test_the_correlation_of_a_beta_binomial_is_recovered():
    random = np.random.default_rng(0)
    chances = random.beta(1.0, 2.0, 4000)  # intra-cluster correlation 1 / (1 + 1 + 2)
    outcomes = [list(random.random(5) < p) for p in chances]
    assert correlation(outcomes) == pytest.approx(0.25, abs=0.02)
    assert correlation([list(random.random(5) < 0.4) for _ in range(4000)]) == pytest.approx(0.0, abs=0.02)


def test_the_clustered_interval_covers_the_truth():
    random = np.random.default_rng(1)
    hits = 0
    for _ in range(400):
        found = rate([list(random.random(5) < p) for p in random.beta(1.0, 1.0, 20)])
        hits += found.low <= 0.5 <= found.high
    assert hits / 400 > 0.92
    naive = [wilson(np.mean(random.random((20, 5)) < random.beta(1, 1, (20, 1))), 100) for _ in range(400)]
    assert np.mean([low <= 0.5 <= high for low, high in naive]) < 0.9


def test_newcombes_interval_matches_his_published_example():
    # Newcombe 1998, table II, example (a): 56/70 - 48/80, method 10
    a, b = rate([[True]] * 56 + [[False]] * 14), rate([[True]] * 48 + [[False]] * 32)
    found = difference(a, b)
    assert (found.value, found.low, found.high) == pytest.approx((0.2, 0.0524, 0.3339), abs=1e-4)
