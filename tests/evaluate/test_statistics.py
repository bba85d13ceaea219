import numpy as np
import pytest
from scipy import stats

from scengen.evaluate.statistics import (
    Rate,
    correlation,
    difference,
    mean_difference,
    mean_interval,
    mean_rate,
    paired,
    rate,
    wilson,
)


@pytest.mark.parametrize("successes", [0, 1, 7, 13, 19, 20])
def test_single_rollouts_give_the_exact_interval(successes):
    """Gaffke's bound of binary values is Clopper and Pearson's."""
    found = rate([[True]] * successes + [[False]] * (20 - successes))
    exact = stats.binomtest(successes, 20).proportion_ci(method="exact")
    assert (found.low, found.high) == pytest.approx((exact.low, exact.high), abs=0.006)
    assert found.value == successes / 20


def test_rollouts_that_agree_within_each_scenario_count_once():
    found, single = rate([[True] * 5] * 10 + [[False] * 5] * 10), rate([[True]] * 10 + [[False]] * 10)
    assert (found.low, found.high) == (single.low, single.high) and found.rollouts == 100


def test_rollouts_that_do_not_agree_count_for_more():
    mixed = rate([[True] * 3 + [False] * 2] * 20)
    alike = rate([[True] * 5] * 12 + [[False] * 5] * 8)
    assert mixed.value == pytest.approx(alike.value) and mixed.high - mixed.low < 0.6 * (alike.high - alike.low)


@pytest.mark.parametrize("scenarios", [2, 8, 20, pytest.param(600, marks=pytest.mark.slow)])
def test_one_more_success_never_makes_a_bound_smaller(scenarios):
    random = np.random.default_rng(scenarios)
    outcomes = random.random((scenarios, 5)) < 0.8
    before = rate(outcomes.tolist())
    for place in random.permutation(np.argwhere(~outcomes))[:30]:
        outcomes[tuple(place)] = True
        after = rate(outcomes.tolist())
        assert after.low >= before.low and after.high >= before.high
        before = after


def test_shares_outside_of_0_to_1_are_refused():
    with pytest.raises(ValueError, match=r"numbers in \[0, 1\]"):
        mean_interval([0.2, 1.2])
    with pytest.raises(ValueError, match=r"numbers in \[0, 1\]"):
        mean_interval([])


def test_the_correlation_of_a_beta_binomial_is_recovered():
    random = np.random.default_rng(0)
    chances = random.beta(1.0, 2.0, 4000)  # intra-cluster correlation 1 / (1 + 1 + 2)
    outcomes = [list(random.random(5) < p) for p in chances]
    assert correlation(outcomes) == pytest.approx(0.25, abs=0.02)
    assert correlation([list(random.random(5) < 0.4) for _ in range(4000)]) == pytest.approx(0.0, abs=0.02)


def shares(random, experiments, scenarios, p, icc, ranks=None):
    """Shares of 5 rollouts of scenarios with beta-distributed difficulty."""
    ranks = random.random((experiments, scenarios)) if ranks is None else ranks
    size = (1 - icc) / icc if icc else 1e9
    return random.binomial(5, stats.beta.ppf(ranks, p * size, (1 - p) * size)) / 5


def covers(intervals, truth):
    return np.mean([low - 1e-12 <= truth <= high + 1e-12 for low, high in intervals])


def test_the_clustered_interval_covers_the_truth_and_a_naive_one_does_not():
    found = shares(np.random.default_rng(1), 300, 20, 0.5, 0.33)
    assert covers(map(mean_interval, found), 0.5) > 0.93
    assert covers((wilson(values.mean(), 100) for values in found), 0.5) < 0.9


@pytest.mark.slow
@pytest.mark.parametrize("scenarios", [8, 20, 50])
@pytest.mark.parametrize("p", [0.05, 0.2, 0.5, 0.8, 0.95])
def test_intervals_hold_the_truth_whatever_the_correlation(scenarios, p):
    random = np.random.default_rng(scenarios)
    for icc in (0.0, 0.3, 0.5, 0.8):
        assert covers(map(mean_interval, shares(random, 1000, scenarios, p, icc)), p) >= 0.93


@pytest.mark.slow
@pytest.mark.parametrize("scenarios", [8, 20, 50])
@pytest.mark.parametrize("twins", [0.0, 0.5, 0.9])
def test_differences_of_twins_hold_the_truth_whatever_they_share(scenarios, twins):
    random = np.random.default_rng(scenarios)
    for before, after in ((0.7, 0.7), (0.7, 0.45), (0.9, 0.6), (0.95, 0.05)):
        normal = random.standard_normal((2, 1000, scenarios))
        normal[1] = twins * normal[0] + np.sqrt(1 - twins**2) * normal[1]
        sides = (
            shares(random, 1000, scenarios, p, 0.5, stats.norm.cdf(z))
            for p, z in zip((before, after), normal, strict=True)
        )
        found = [paired(a[:, None].tolist(), b[:, None].tolist()) for a, b in zip(*sides, strict=True)]
        assert covers(((d.low, d.high) for d in found), before - after) >= 0.93


@pytest.mark.slow
@pytest.mark.parametrize("shared", [0.0, 0.3, 0.8])
def test_a_mean_over_axes_holds_the_truth_though_they_share_their_difficulty(shared):
    """Six axes of 20 scenarios: number i of each is the same scenario but for the axis."""
    random = np.random.default_rng(3)
    common, own = random.standard_normal((500, 20, 1)), random.standard_normal((500, 20, 6))
    ranks = stats.norm.cdf(np.sqrt(shared) * common + np.sqrt(1 - shared) * own)
    found = shares(random, 500, 120, 0.5, 0.5, ranks.reshape(500, 120)).reshape(500, 20, 6).mean(axis=2)
    assert covers(map(mean_interval, found), 0.5) >= 0.93


def test_differences_are_newcombes_hybrid_of_their_intervals():
    # Newcombe 1998, table II, example (a): 56/70 - 48/80, method 10, with Wilson's intervals
    found = difference(Rate(0.8, *wilson(0.8, 70), 70, 70), Rate(0.6, *wilson(0.6, 80), 80, 80))
    assert (found.value, found.low, found.high) == pytest.approx((0.2, 0.0524, 0.3339), abs=1e-4)


def test_twins_of_equal_difficulty_narrow_the_interval():
    outcomes = [[k < 8] * 5 for k in range(20)]
    other = [[k < 6] * 5 for k in range(20)]
    together, apart = paired(outcomes, other), difference(rate(outcomes), rate(other))
    assert together.value == apart.value == pytest.approx(0.1)
    assert together.high - together.low < 0.6 * (apart.high - apart.low) and together.twins == 20


def test_a_mean_of_tasks_weighs_them_alike_and_narrows_with_their_number():
    one = rate([[True]] * 14 + [[False]] * 6)
    four = mean_rate([one] * 4)
    assert four.value == one.value and four.high - four.low == pytest.approx((one.high - one.low) / 2)
    assert mean_rate([rate([[True]] * 100), rate([[False]] * 4)]).value == 0.5
    assert mean_difference([difference(one, one)] * 2).value == 0.0
