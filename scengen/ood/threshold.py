"""Where along a path a chance of success first falls to one half, from single trials at points chosen as they come in.

The threshold is the first point at which the chance, over all scenarios, is one half or less. No curve is assumed. For
every point of the path it is tested that the threshold lies there: the chance is then above one half before it, and
one half or less from there on. The looks nearest to the point are counted on either side, 6, 9, 15, 20, 30 and 40 of
them. The point is refuted if, at a chance of one half, so many failures before it, or so many successes beyond it,
occur in at most 2.5 % of cases (sign tests). The interval reaches from the first to the last point that remains.

* Failures refute every point beyond them, however the curve runs. Where success has come back the nearest looks do not
  show it; there the failures of a hole count, corrected for as many tests as there are stretches to look for them.
* Successes refute the points before them only if success has not come back after a fall. So no count reaches across a
  hole: two failures in a row. A hole that no look falls into is not seen.

Each test is exact for looks fixed beforehand. That it counts several numbers of looks, and that earlier looks decide on
later ones, is not corrected for; what this costs is simulated in tests/ood/test_boundary.py, for steep and shallow
curves, plateaus, holes, recoveries and mixtures.

Where to look next follows a guess at the curve: one fall, perhaps one recovery, and one trial in five that ends
otherwise. Where the guess is wrong the interval gets wide.
"""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom, binomtest

GRAIN = 100
"""Points between 0 and 1. Beyond 1 they stand in equal ratios, half as many to a tenfold."""
EDGE = 6
"""Looks at either end that are fixed beforehand: the fewest with which a sign test can refute."""
PLACES, PLACE = 12, 2
"""Fixed looks between the ends: how many places there are from 0 to 1, and looks at each. Places are at most 9 points
apart, so that a stretch of the path as long as a tenth of the way from 0 to 1 holds one."""
COUNTS = (6, 9, 15, 20, 30, 40)
"""How many looks a test counts, at least: looks at one point are counted together."""
CONFIDENCE = 0.95
LEVEL = (1 - CONFIDENCE) / 2
"""Of a test: an interval has two sides."""
SURPRISE = 0.2
"""Share of trials that end otherwise than the guess has it."""

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


def points(end: float) -> Floats:
    """The points that may be looked at, from 0 to the end of the path, which is 1 or more."""
    per_tenfold = GRAIN / 2
    steps = math.ceil(round(per_tenfold * math.log10(end), 6))
    beyond = [10 ** (k / per_tenfold) for k in range(1, steps)]
    return np.array([k / GRAIN for k in range(GRAIN + 1)] + beyond + [end] * (steps > 0))


def fixed(last: int) -> list[int]:
    """Numbers of the points to look at first, the last point being number `last`: both ends, then the places."""
    places = [place for k in range(1, last) if (place := round(k * GRAIN / PLACES)) < last]
    return [0] * EDGE + [last] * EDGE + [place for place in places for _ in range(PLACE)]


def interval(at: Ints, solved: Bools, last: int) -> tuple[int, int]:
    """The first and the last gap in which the threshold may lie, at 95 %; there is always one.

    Gap 0 is point 0, gap k what lies between points k - 1 and k, and gap `last + 1` a chance that never falls. Where
    most looks fail two do so in a row, and success beyond these says nothing about the gap before them: it remains.

    Args:
        at: number of the point of every look.
        solved: how it ended.
        last: number of the last point.
    """
    at, solved = _in_order(at, solved)
    gaps = np.append(0, np.unique(at) + 1)  # and those up to the next look, about which the looks say the same
    ends = np.append(gaps[1:] - 1, last + 1)
    starts = np.searchsorted(at, gaps)
    holding = [_mostly(at[start:], _before_hole(solved[start:])) for start in starts]
    failing = [_mostly(at[:start][::-1], ~solved[:start][::-1]) for start in starts]
    fallen = [_mostly(at[:start][::-1], ~solved[:start][::-1], among=len(at)) for start in starts]
    possible = np.flatnonzero(~np.array(failing) & ~np.logical_or.accumulate(fallen))
    return int(np.append(gaps, last + 1)[[*holding, False].index(False)]), int(ends[possible[-1]])


def recovery(at: Ints, solved: Bools, fallen: int) -> tuple[int, int] | None:
    """From which point to which success has come back beyond the point `fallen`; None if it is not seen to."""
    at, solved = _in_order(at, solved)
    for start in range(int(np.searchsorted(at, fallen, side="right")), len(at)):
        held = _before_hole(solved[start:])
        if solved[start] and _mostly(at[start:], held):
            return int(at[start]), int(at[start + np.flatnonzero(held)[-1]])
    return None


def guess(at: Ints, solved: Bools, last: int) -> Floats:
    """How likely each gap is, see `interval`: weights that sum to 1, for choosing the next look."""
    tried = np.bincount(at, minlength=last + 1)
    good = np.bincount(at[solved], minlength=last + 1)
    right, wrong = math.log(1 - SURPRISE), math.log(SURPRISE)
    holds = np.append(0, np.cumsum(good * right + (tried - good) * wrong))
    fails = np.append(0, np.cumsum(good * wrong + (tried - good) * right))
    gaps = np.arange(last + 2)
    far = np.minimum(gaps + math.ceil(GRAIN / PLACES), last + 1)  # so far it fails, then it fails on or has recovered
    chance = holds[gaps] + fails[far] - fails[gaps] + np.logaddexp(holds[-1] - holds[far], fails[-1] - fails[far])
    weight = np.exp(chance - chance.max())
    return weight / weight.sum()


def at_least(solved: int, tried: int) -> float:
    """Clopper and Pearson's one-sided lower 95 % bound of a chance; 0 without trials."""
    return float(binomtest(solved, tried, alternative="greater").proportion_ci(CONFIDENCE).low) if tried else 0.0


def _in_order(at: Ints, solved: Bools) -> tuple[Ints, Bools]:
    order = np.argsort(at, kind="stable")
    return at[order], solved[order]


def _mostly(at: Ints, hits: Bools, among: int = 0) -> bool:
    """Whether too many of the first looks are hits for a chance of one half; `hits` may end before `at`.

    Args:
        among: how many looks there are, if this is asked all along them and one answer is enough: the level is then
            shared by as many stretches as follow one another.
    """
    for count in COUNTS:
        if count > len(hits):
            return False
        count = int(np.flatnonzero(at == at[count - 1])[-1]) + 1
        level = LEVEL * min(1.0, count / among) if among else LEVEL
        if count <= len(hits) and np.count_nonzero(hits[:count]) >= _needed(count, level):
            return True
    return False


def _before_hole(solved: Bools) -> Bools:
    """The looks before two failures in a row."""
    holes = np.flatnonzero(~solved[:-1] & ~solved[1:])
    return solved[: holes[0]] if len(holes) else solved


@cache
def _needed(count: int, level: float) -> int:
    """The least number of hits that occurs in at most this share of cases at a chance of one half."""
    return int(binom.isf(level, count, 0.5)) + 1
