"""Points that the search tries next, by stage."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats.qmc import Halton

from ...errors import BadConfig
from .boxes import boxes
from .regions import Region
from .trial import Place, Point, SearchTrial

NARROW = "narrow"
"""Stage of the trials in and around the boxes."""
OUTER_SHARE = 0.25
"""Share of a region that counts as far out."""
FOREST_CANDIDATES = 4000
"""Number of points among which the forest chooses."""
FOREST_BATCH = 8
"""Number of points that are tried before the forest is fitted again."""
NARROWED_BOXES = 12
"""Number of boxes that are narrowed, those with most evidence first."""
MARGIN_SHARE = 0.3
"""Margin around a box that is tried too, as a share of the box."""
MIN_MARGIN = 0.05
"""Minimum margin around a box that is tried too, as a share of the region."""
NOT_MOVED = -0.2
"""Number that the forest sees where a region is not moved: before the beginning of every region."""

Reaches = Mapping[int, tuple[float, float]]
"""First and last place along each region at which some twin is feasible, by the number of the region."""


def far_points(known: Sequence[Region], reaches: Reaches, random: np.random.Generator) -> list[Point]:
    """A point far out in each region: near its feasible end, or in its middle where training lies behind its end."""
    points = list[Point]()
    for i in map(int, random.permutation(list(reaches))):
        begin = 1 - OUTER_SHARE if known[i].beyond else (1 - OUTER_SHARE) / 2
        points.append(Point((_placed(i, reaches[i], begin + OUTER_SHARE * random.random()),)))
    return points


def _placed(region: int, reach: tuple[float, float], share: float) -> Place:
    return Place(region, round(float(reach[0] + share * (reach[1] - reach[0])), 6))


def hypercube(n: int, reaches: Reaches, random: np.random.Generator) -> list[Point]:
    """Points in one or two regions: every region is used equally often, its places are spread evenly (Latin hypercube).

    Two of three points move one parameter only.
    """
    turns, uses = list[list[int]](), Counter[int]()
    deck = list[int]()
    for k in range(n):
        wanted = 1 if k % 3 else 2
        while len(deck) < 2:
            deck += [int(i) for i in random.permutation(list(reaches))]
        first = deck.pop(0)
        chosen = [first] if wanted == 1 else sorted({first, deck.pop(0)})
        turns.append(chosen)
        uses.update(chosen)
    places = {i: list((random.permutation(m) + random.random(m)) / m) for i, m in sorted(uses.items())}
    return [Point(tuple(_placed(i, reaches[i], places[i].pop()) for i in chosen)) for chosen in turns]


def forest_class() -> type[Any]:
    """Scikit-learn's classifier.

    Raises:
        BadConfig: scikit-learn is missing.
    """
    try:
        from sklearn.ensemble import RandomForestClassifier
    except ImportError:
        raise BadConfig(
            "no scikit-learn for method=forest; say pip install 'scengen[discover]', or method=hypercube"
        ) from None
    return RandomForestClassifier


def uncertain_points(trials: Sequence[SearchTrial], reaches: Reaches, random: np.random.Generator) -> list[Point]:
    """The points at which a forest is least certain whether they break the memory, all in different regions."""
    count = max(reaches) + 1
    table = np.stack([_row(trial.point, count) for trial in trials])
    breaks = np.array([trial.breaks for trial in trials])
    points = hypercube(FOREST_CANDIDATES, reaches, random)
    if breaks.all() or not breaks.any():
        return points[:FOREST_BATCH]
    forest = forest_class()(200, min_samples_leaf=2, random_state=int(random.integers(2**31)))
    share = forest.fit(table, breaks).predict_proba(np.stack([_row(point, count) for point in points]))[:, 1]
    chosen, used = list[Point](), set[int]()
    for k in np.argsort(-share * (1 - share), kind="stable"):
        if not used.intersection(points[k].regions):
            used.update(points[k].regions)
            chosen.append(points[k])
        if len(chosen) == FOREST_BATCH:
            break
    return chosen


def _row(point: Point, count: int) -> NDArray[np.float64]:
    """A point as a row of the table that the forest is fitted to."""
    row = np.full(count, NOT_MOVED)
    for place in point:
        row[place.region] = place.at
    return row


def single_points(trials: Sequence[SearchTrial]) -> list[tuple[Point, int]]:
    """One parameter of each pair that broke a memory, and the pair's twin: one of the two may break it alone."""
    single = {trial.point.regions[0] for trial in trials if trial.breaks and len(trial.point.places) == 1}
    pairs = [trial for trial in trials if trial.breaks and len(trial.point.places) == 2]
    return [
        (Point((place,)), trial.twin)
        for trial in pairs
        if not single.intersection(trial.point.regions)
        for place in trial.point
    ]


def surrounding_points(trials: Sequence[SearchTrial]) -> list[Point]:
    """A point in each of the boxes with most evidence, or a little outside, to find where the box ends.

    The points of one box are spread evenly, however many are tried (Halton sequence).
    """
    points = list[Point]()
    for _, box in boxes(trials)[:NARROWED_BOXES]:
        tried = sum(trial.stage == NARROW and trial.point.regions == box.regions for trial in trials)
        shares = Halton(len(box.ranges), scramble=False).fast_forward(tried + 1).random()[0]
        places = list[Place]()
        for share, (region, low, high) in zip(shares, box.ranges, strict=True):
            margin = max(MARGIN_SHARE * (high - low), MIN_MARGIN)
            begin, end = max(0.0, low - margin), min(1.0, high + margin)
            places.append(Place(region, round(begin + float(share) * (end - begin), 6)))
        points.append(Point(tuple(places)))
    return points
