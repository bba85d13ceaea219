"""The interval of a threshold refutes what a sign test refutes, sees holes, and tells what it does not know."""

import numpy as np
import pytest
from scipy.stats import binomtest

from scengen.ood.threshold import at_least, fixed, guess, interval, points, recovery

LAST = 100


def looks(*runs):
    """Looks at points: `(point, "110")` are three at one point, two of which succeed."""
    at = [point for point, ends in runs for _ in ends]
    return np.array(at, int), np.array([end == "1" for _, ends in runs for end in ends], bool)


@pytest.mark.parametrize("end", [1.0, 1.02, 1.18, 4.62, 10.0])
def test_fixed_looks_stand_at_both_ends_and_in_whatever_is_as_long_as_a_tenth_of_the_axis(end):
    where = points(end)
    chosen = np.array(fixed(len(where) - 1))
    assert where[0] == 0 and where[-1] == end and (np.diff(where) > 0).all()
    assert sum(chosen == 0) == sum(chosen == len(where) - 1) == 6
    assert np.diff(np.unique(chosen)).max() <= 9  # points; of 0.01 each up to 1, and at most 1.047 times apart beyond
    inner = sum((where[chosen] > 0) & (where[chosen] < 1))
    assert inner == 2 * 11 and len(chosen) <= 46


@pytest.mark.parametrize("tried", [6, 7, 8, 9, 10, 15, 20, 30, 40])
def test_looks_at_one_point_refute_exactly_where_the_sign_test_does(tried):
    for solved in range(tried + 1):
        first, final = interval(*looks((50, "1" * solved + "0" * (tried - solved))), LAST)
        chance_of_failures = binomtest(tried - solved, tried, alternative="greater").pvalue
        chance_of_successes = binomtest(solved, tried, alternative="greater").pvalue
        assert final == (50 if chance_of_failures <= 0.025 else LAST + 1)
        one_failure_at_most = solved >= tried - 1  # two in a row are a hole
        assert first == (51 if chance_of_successes <= 0.025 and one_failure_at_most else 0)


def test_nothing_is_known_without_looks_and_five_are_too_few():
    assert interval(*looks(), LAST) == (0, LAST + 1)
    assert interval(*looks((0, "11111"), (LAST, "00000")), LAST) == (0, LAST + 1)


def test_the_fall_lies_between_what_is_solved_and_what_fails():
    assert interval(*looks((30, "111"), (40, "111"), (60, "000"), (70, "000")), LAST) == (31, 70)
    assert interval(*looks((40, "111111"), (60, "000000")), LAST) == (41, 60)


def test_success_everywhere_holds_to_the_end_and_failure_everywhere_fails_at_the_edge():
    assert interval(*looks((0, "111111"), (LAST, "111111")), LAST) == (LAST + 1, LAST + 1)
    assert interval(*looks((0, "000000"), (LAST, "000000")), LAST) == (0, 0)


def test_success_beyond_a_hole_says_nothing_about_the_way_to_it():
    hole = looks((0, "111111"), (20, "11"), (30, "11"), (40, "00"), *((point, "11") for point in range(50, 100, 5)))
    assert interval(*hole, LAST) == (1, LAST + 1)  # four solved before the hole are chance
    seen = looks((0, "111111"), (30, "111111"), (40, "0" * 12), *((point, "11") for point in range(50, 100, 5)))
    assert interval(*seen, LAST) == (31, 40) and recovery(*seen, 40) == (50, 95)


def test_six_failures_refute_what_follows_at_once_but_not_what_comes_after_a_recovery():
    tail = [(point, "11") for point in range(50, 100, 5)]
    assert interval(*looks((30, "111111"), (40, "0" * 6)), LAST) == (31, 40)
    assert interval(*looks((30, "111111"), (40, "0" * 6), *tail), LAST) == (31, LAST + 1)  # one stretch of many: chance


def test_one_failure_among_many_is_no_hole():
    at, solved = looks(*((point, "11") for point in range(0, 101, 5)))
    solved[at == 50] = [True, False]
    first, final = interval(at, solved, LAST)
    assert final == LAST + 1 and first > 80


def test_success_that_comes_back_for_a_while_is_told_with_its_end():
    at, solved = looks((0, "1" * 6), (10, "0" * 8), *((p, "11") for p in (20, 30, 40)), (50, "00"), (60, "00"))
    assert interval(at, solved, LAST)[1] == 10 and recovery(at, solved, 10) == (20, 40)
    assert recovery(*looks((10, "0" * 8), (20, "11"), (30, "11")), 10) is None  # four solved are chance


def test_some_gap_always_remains():
    random = np.random.default_rng(0)
    for _ in range(2000):
        count = random.integers(1, 80)
        at, chance = random.integers(0, random.integers(2, LAST), count), random.random(LAST).round(random.integers(3))
        first, final = interval(at, random.random(count) < chance[at], LAST)
        assert 0 <= first <= final <= LAST + 1


def test_the_exact_bound_is_clopper_and_pearsons():
    assert at_least(6, 6) == pytest.approx(0.05 ** (1 / 6)) and at_least(0, 6) == at_least(0, 0) == 0


def test_the_guess_points_at_the_first_fall_and_at_a_hole():
    flat = dict.fromkeys(range(0, 101, 8), "11")
    fall = guess(*looks(*((p, "11" if p < 50 else "00") for p in flat)), LAST)
    assert fall.sum() == pytest.approx(1) and fall[49:57].sum() > 0.8
    hole = guess(*looks(*(flat | {40: "0000"}).items()), LAST)
    assert hole[33:41].sum() > 0.8
    assert guess(*looks(*flat.items(), (LAST, "111111")), LAST).argmax() == LAST + 1
