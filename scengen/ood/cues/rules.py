"""Rules that answer a decision: a fixed answer, one or two quantities, a place beside a body, or all together."""

import abc
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...decisions import Choice, Near, Span, places
from ...errors import BadConfig
from .quantities import Floats, Sample

Bools = NDArray[np.bool_]

MAX_LEAVES = 8
"""Number of answers that a rule of one or two quantities may give, at most."""
MIN_LEAF = 6
"""Number of draws for each answer of a rule, at least."""
BINS = 4
"""Number of cells along each quantity in the search for pairs."""
TRIED_PAIRS = 8
"""Number of pairs that are fitted, the most promising ones."""
TREES = 60
"""Number of trees of the rule that uses all quantities."""


@dataclass(frozen=True)
class Rule:
    """A rule that was fitted to some draws."""

    words: str
    """Name of the rule."""
    uses: tuple[str, ...]
    """Quantities that it uses; none for a fixed answer."""
    right: Callable[[Sample], Bools]
    """Function that reveals in which scenarios the rule is right."""
    fitted: float
    """Share of the draws to which it was fitted in which it is right."""


class Answers(abc.ABC):
    """Right answers of one decision in some scenarios."""

    learned: Any
    """Numbers or labels from which a learner learns the answers."""
    classes: NDArray[np.int64]
    """Coarse classes of the answers, in which pairs of quantities are searched."""

    @abc.abstractmethod
    def best(self, rows: NDArray[np.int64]) -> Any:
        """The answer that is right in most of some scenarios."""

    @abc.abstractmethod
    def right(self, guesses: Sequence[Any]) -> Bools:
        """In which scenarios a guess is right, given one guess for each."""


class Choices(Answers):
    """Answers of decisions among a few."""

    def __init__(self, decisions: Sequence[Choice]) -> None:
        self.values = [one.value for one in decisions]
        self.labels = list(dict.fromkeys(self.values))
        self.learned = self.classes = np.array([self.labels.index(value) for value in self.values])

    def best(self, rows: NDArray[np.int64]) -> Any:
        return Counter(self.values[k] for k in rows).most_common(1)[0][0]

    def right(self, guesses: Sequence[Any]) -> Bools:
        return np.array([guess == value for guess, value in zip(guesses, self.values, strict=True)], bool)


class Spans(Answers):
    """Answers of decisions about a number."""

    def __init__(self, decisions: Sequence[Span]) -> None:
        self.low, self.high = np.array([(one.low, one.high) for one in decisions]).T
        self.learned = (self.low + self.high) / 2
        self.classes = _cells(self.learned)

    def best(self, rows: NDArray[np.int64]) -> float:
        return _in_most(self.low[rows], self.high[rows])

    def right(self, guesses: Sequence[Any]) -> Bools:
        return (self.low <= np.asarray(guesses)) & (np.asarray(guesses) <= self.high)


class Nears(Answers):
    """Answers of decisions about a place."""

    def __init__(self, at: Floats, within: Floats) -> None:
        self.learned, self.within = at, within
        self.classes = _cells(at[:, 0]) * BINS + _cells(at[:, 1])

    def best(self, rows: NDArray[np.int64]) -> Floats:
        at = self.learned[rows]
        inside = np.linalg.norm(at[:, None] - at[None], axis=2) <= self.within[None, rows]
        return at[inside.sum(1).argmax()]

    def right(self, guesses: Sequence[Any]) -> Bools:
        return np.linalg.norm(self.learned - np.asarray(guesses), axis=1) <= self.within


def answers(sample: Sample, name: str) -> Answers:
    """The right answers of a decision in a sample.

    Raises:
        BadConfig: the decision has several kinds.
    """
    every = [row[name] for row in sample.decisions]
    choices = [one for one in every if isinstance(one, Choice)]
    spans = [one for one in every if isinstance(one, Span)]
    nears = [one for one in every if isinstance(one, Near)]
    if not every or len(every) not in (len(choices), len(spans), len(nears)):
        raise BadConfig(f"decision {name!r} is of different kinds in different scenarios; it must be of one kind")
    if choices:
        return Choices(choices)
    return Spans(spans) if spans else Nears(places(nears), np.array([one.within for one in nears]))


def _cells(column: Floats) -> NDArray[np.int64]:
    """Numbers of the quarters in which values lie."""
    cuts = np.quantile(column, np.linspace(0, 1, BINS + 1)[1:-1])
    return np.searchsorted(cuts, column, "left").astype(np.int64)


def _in_most(low: Floats, high: Floats) -> float:
    """The number that lies in most intervals: the middle of the first stretch of such numbers."""
    at = np.sort(np.concatenate([low, high]))
    at = (at[1:] + at[:-1]) / 2
    inside = np.searchsorted(np.sort(low), at, "right") - np.searchsorted(np.sort(high), at, "left")
    best = np.flatnonzero(inside == inside.max())
    run = best[: np.flatnonzero(np.diff(best, append=best[-1] + 2) > 1)[0] + 1]
    return float((at[run[0]] + at[run[-1]]) / 2)


class Search:
    """Search for rules of one decision in the draws of a sample."""

    def __init__(self, sample: Sample, name: str, names: Sequence[str]) -> None:
        self.sample, self.name, self.names = sample, name, list(names)
        self.answers, self.columns = answers(sample, name), sample.columns(names)
        self.rows = np.arange(len(sample))

    def fixed(self) -> Rule:
        """The best fixed answer."""
        best = self.answers.best(self.rows)
        words = "always " + (str(best) if isinstance(self.answers, Choices) else np.array2string(np.round(best, 3)))
        return self._rule(words, (), lambda sample: [best] * len(sample))

    def single(self) -> Iterator[Rule]:
        """The best rule of each quantity, and of each place beside a body."""
        for name in self.names:
            rules = [self._tree((name,))]
            if isinstance(self.answers, Spans):
                rules.append(self._line((name,), self.answers))
            yield max(rules, key=lambda rule: rule.fitted)
        if isinstance(self.answers, Nears):
            for body in self.sample.poses[0]:
                if all(body in row for row in self.sample.poses):
                    yield from (self._beside(body, turned, self.answers) for turned in (False, True))

    def pairs(self, fair: Sequence[str]) -> Iterator[Rule]:
        """The most promising rules of two of some quantities: those whose cells hold the fewest classes of answers."""
        codes = {name: _cells(self.columns[:, self.names.index(name)]) for name in fair}
        many = int(self.answers.classes.max()) + 1
        scored = []
        for a, b in combinations(fair, 2):
            cells = (codes[a] * BINS + codes[b]) * many + self.answers.classes
            score = np.bincount(cells, minlength=BINS**2 * many).reshape(-1, many).max(1).sum()
            scored.append((-int(score), a, b))
        for _, *both in sorted(scored)[:TRIED_PAIRS]:
            yield self._tree(tuple(both))
            if isinstance(self.answers, Spans):
                yield self._line(tuple(both), self.answers)

    def together(self, fair: Sequence[str]) -> Rule:
        """A rule that uses many quantities: randomized trees."""
        ensemble = learners("ensemble")
        kind = ensemble.ExtraTreesClassifier if isinstance(self.answers, Choices) else ensemble.ExtraTreesRegressor
        model = kind(TREES, min_samples_leaf=3, max_features=0.3, random_state=0)
        model.fit(self.sample.columns(fair), self.answers.learned)

        def guesses(sample: Sample) -> Sequence[Any]:
            answers = model.predict(sample.columns(fair))
            return [self.answers.labels[k] for k in answers] if isinstance(self.answers, Choices) else answers

        return self._rule(f"all {len(fair)} unintended quantities", tuple(fair), guesses)

    def _rule(self, words: str, uses: tuple[str, ...], guesses: Callable[[Sample], Sequence[Any]]) -> Rule:
        def right(sample: Sample) -> Bools:
            return answers(sample, self.name).right(guesses(sample))

        return Rule(words, uses, right, float(self.answers.right(guesses(self.sample)).mean()))

    def _tree(self, uses: tuple[str, ...]) -> Rule:
        """A tree, which gives the best answer in each of its leaves."""
        tree = learners("tree")
        kind = tree.DecisionTreeClassifier if isinstance(self.answers, Choices) else tree.DecisionTreeRegressor
        model = kind(max_leaf_nodes=MAX_LEAVES, min_samples_leaf=MIN_LEAF, random_state=0)
        x = self.columns[:, [self.names.index(name) for name in uses]]
        leaves = model.fit(x, self.answers.learned).apply(x)
        best = {leaf: self.answers.best(np.flatnonzero(leaves == leaf)) for leaf in set(leaves)}
        return self._rule(
            " & ".join(uses), uses, lambda sample: [best[leaf] for leaf in model.apply(sample.columns(uses))]
        )

    def _line(self, uses: tuple[str, ...], spans: Spans) -> Rule:
        """A number that is linear in the quantities."""
        x = self.columns[:, [self.names.index(name) for name in uses]]
        slope = np.linalg.lstsq(x - x.mean(0), spans.learned - spans.learned.mean(), rcond=None)[0]
        at = _in_most(spans.low - x @ slope, spans.high - x @ slope)
        return self._rule(" & ".join(uses), uses, lambda sample: list(sample.columns(uses) @ slope + at))

    def _beside(self, body: str, turned: bool, nears: Nears) -> Rule:
        """A fixed place beside a body, in the axes of the table or, turned, in its own."""
        poses = np.array([row[body] for row in self.sample.poses])
        local = Nears(_seen_from(poses, nears.learned, turned), nears.within)
        best = local.best(self.rows)

        def guesses(sample: Sample) -> Sequence[Any]:
            poses = np.array([row.get(body, np.full(3, np.nan)) for row in sample.poses])
            return list(_placed(poses, best, turned))

        uses = (f"{body}.x", f"{body}.y", *([f"{body}.yaw"] if turned else []))
        return self._rule(f"a place beside {body}" + (", turned with it" if turned else ""), uses, guesses)


def _axes(poses: Floats, turned: bool) -> Floats:
    """Rotations of bodies, shape (n, 2, 2); identity unless turned."""
    yaw = poses[:, 2] if turned else np.zeros(len(poses))
    return np.moveaxis(np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]), 2, 0)


def _seen_from(poses: Floats, at: Floats, turned: bool) -> Floats:
    """Places relative to bodies, shape (n, 2) [m]."""
    return np.einsum("nji,nj->ni", _axes(poses, turned), at - poses[:, :2])


def _placed(poses: Floats, offset: Floats, turned: bool) -> Floats:
    """Places of one offset from bodies, shape (n, 2) [m]."""
    return poses[:, :2] + _axes(poses, turned) @ offset


def learners(module: str) -> Any:
    """A module of scikit-learn.

    Raises:
        BadConfig: scikit-learn is missing.
    """
    try:
        if module == "tree":
            import sklearn.tree as found
        else:
            import sklearn.ensemble as found
    except ImportError:
        raise BadConfig("the cue audit needs scikit-learn; pip install 'scengen[discover]'") from None
    return found


def varied(sample: Sample, intended: Mapping[str, bool]) -> dict[str, list[str]]:
    """Quantities that vary, each with the others that are linear in it and equally intended."""
    names, groups = sample.names(), dict[tuple[bool, bytes], list[str]]()
    for name, column in zip(names, sample.columns(names).T, strict=True):
        if np.ptp(column) >= 1e-6:
            scaled = np.round((column - column.mean()) / column.std(), 5)
            first = scaled[np.flatnonzero(scaled)[0]]
            groups.setdefault((intended[name], (scaled * np.sign(first) + 0.0).tobytes()), []).append(name)
    return {first: others for first, *others in groups.values()}
