"""The point of a path at which a chance of success first falls to one half, estimated from single trials.

The threshold is the first point at which the chance, over all scenarios, is one half or less. No curve is assumed.
Every point of the path is tested for being the threshold: the chance is then above one half before it, and one half or
less from there on. The looks nearest to the point are counted on either side, 6, 9, 15, 20, 30 and 40 of them. The
point is refuted if, at a chance of one half, as many failures before it, or as many successes beyond it, occur in at
most 2.5 % of cases (sign tests). The interval reaches from the first to the last point that remains.

* Failures refute every point beyond them, for any shape of the curve. If success has returned, the nearest looks do not
  show it. There the failures of a hole count, corrected for as many tests as there are stretches to look for them.
* Successes refute the points before them only if success has not returned after a fall. So no count reaches across a
  hole: two failures in a row. A hole without any look in it is not seen.

Each test is exact for looks fixed beforehand. Two things are not corrected for: that a test counts several numbers of
looks, and that earlier looks decide on later ones. tests/ood/test_boundary.py simulates what this costs, for steep and
shallow curves, plateaus, holes, recoveries and mixtures.

The next look follows from a guess at the curve: one fall, perhaps one recovery, and one trial in five that ends
otherwise. If the guess is wrong, the interval gets wide.
"""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom, binomtest

POINTS_TO_FAR_END = 100
"""Number of points between 0 and 1. Beyond 1 they stand in equal ratios, half as many to a factor of ten."""
LOOKS_AT_END = 6
"""Number of fixed looks at either end: the fewest with which a sign test can refute."""
FIXED_PLACES = 12
"""Number of places of fixed looks from 0 to 1. They are at most 9 points apart, so that a stretch of a tenth of the way
from 0 to 1 holds one."""
LOOKS_AT_PLACE = 2
"""Number of fixed looks at each of these places."""
LOOK_COUNTS = (6, 9, 15, 20, 30, 40)
"""Minimum numbers of looks that the tests count: looks at one point are counted together."""
CONFIDENCE = 0.95
"""Confidence of an interval."""
TEST_LEVEL = (1 - CONFIDENCE) / 2
"""Significance level of a test: an interval has two sides."""
SURPRISE = 0.2
"""Share of trials that do not end as the guess predicts."""

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


def points(end: float) -> Floats:
    """The points at which trials are made, from 0 to the end of the path.

    Args:
        end: end of the path, at least 1.
    """
    per_tenfold = POINTS_TO_FAR_END / 2
    steps = math.ceil(round(per_tenfold * math.log10(end), 6))
    beyond = [10 ** (k / per_tenfold) for k in range(1, steps)]
    return np.array([k / POINTS_TO_FAR_END for k in range(POINTS_TO_FAR_END + 1)] + beyond + [end] * (steps > 0))


def fixed(last: int) -> list[int]:
    """Numbers of the points of the fixed looks: both ends, then the places between them.

    Args:
        last: number of the last point.
    """
    places = [place for k in range(1, last) if (place := round(k * POINTS_TO_FAR_END / FIXED_PLACES)) < last]
    return [0] * LOOKS_AT_END + [last] * LOOKS_AT_END + [place for place in places for _ in range(LOOKS_AT_PLACE)]


def interval(at: Ints, solved: Bools, last: int) -> tuple[int, int]:
    """The first and the last gap in which the threshold may lie, at 95 % confidence; there is always one.

    Gap 0 is point 0, gap k lies between points k - 1 and k, and gap `last + 1` is a chance that never falls. Where most
    looks fail, two of them fail in a row, and success beyond these does not refute the gap before them: it remains.

    Args:
        at: number of the point of every look.
        solved: outcome of every look.
        last: number of the last point.
    """
    at, solved = _in_order(at, solved)
    gaps = np.append(0, np.unique(at) + 1)  # for the gaps up to the next look, the looks give the same result
    ends = np.append(gaps[1:] - 1, last + 1)
    starts = np.searchsorted(at, gaps)
    holding = [_mostly(at[start:], _before_hole(solved[start:])) for start in starts]
    failing = [_mostly(at[:start][::-1], ~solved[:start][::-1]) for start in starts]
    fallen = [_mostly(at[:start][::-1], ~solved[:start][::-1], among=len(at)) for start in starts]
    possible = np.flatnonzero(~np.array(failing) & ~np.logical_or.accumulate(fallen))
    return int(np.append(gaps, last + 1)[[*holding, False].index(False)]), int(ends[possible[-1]])


def recovery(at: Ints, solved: Bools, fallen: int) -> tuple[int, int] | None:
    """First and last point of the stretch beyond `fallen` on which success has returned; None if there is none."""
    at, solved = _in_order(at, solved)
    for start in range(int(np.searchsorted(at, fallen, side="right")), len(at)):
        held = _before_hole(solved[start:])
        if solved[start] and _mostly(at[start:], held):
            return int(at[start]), int(at[start + np.flatnonzero(held)[-1]])
    return None


def guess(at: Ints, solved: Bools, last: int) -> Floats:
    """Probability of each gap (see `interval`), for choosing the next look: weights that sum to 1."""
    tried = np.bincount(at, minlength=last + 1)
    good = np.bincount(at[solved], minlength=last + 1)
    right, wrong = math.log(1 - SURPRISE), math.log(SURPRISE)
    holds = np.append(0, np.cumsum(good * right + (tried - good) * wrong))
    fails = np.append(0, np.cumsum(good * wrong + (tried - good) * right))
    gaps = np.arange(last + 2)
    far = np.minimum(
        gaps + math.ceil(POINTS_TO_FAR_END / FIXED_PLACES), last + 1
    )  # up to here it fails, then it may recover
    chance = holds[gaps] + fails[far] - fails[gaps] + np.logaddexp(holds[-1] - holds[far], fails[-1] - fails[far])
    weight = np.exp(chance - chance.max())
    return weight / weight.sum()


def at_least(solved: int, tried: int) -> float:
    """One-sided lower 95 % bound of a chance (Clopper-Pearson); 0 without trials."""
    return float(binomtest(solved, tried, alternative="greater").proportion_ci(CONFIDENCE).low) if tried else 0.0


def _in_order(at: Ints, solved: Bools) -> tuple[Ints, Bools]:
    order = np.argsort(at, kind="stable")
    return at[order], solved[order]


def _mostly(at: Ints, hits: Bools, among: int = 0) -> bool:
    """Whether too many of the first looks are hits for a chance of one half.

    Args:
        hits: whether each look is a hit; may be shorter than `at`.
        among: number of all looks, if every stretch of them is tested and one positive test is enough: the level is
            then shared by as many stretches as follow one another.
    """
    for count in LOOK_COUNTS:
        if count > len(hits):
            return False
        count = int(np.flatnonzero(at == at[count - 1])[-1]) + 1
        level = TEST_LEVEL * min(1.0, count / among) if among else TEST_LEVEL
        if count <= len(hits) and np.count_nonzero(hits[:count]) >= _needed(count, level):
            return True
    return False


def _before_hole(solved: Bools) -> Bools:
    """The looks before two failures in a row."""
    holes = np.flatnonzero(~solved[:-1] & ~solved[1:])
    return solved[: holes[0]] if len(holes) else solved


@cache
def _needed(count: int, level: float) -> int:
    """The smallest number of hits that occurs in at most a share `level` of cases at a chance of one half."""
    return int(binom.isf(level, count, 0.5)) + 1
