"""Limits of a family's constraints: pairs of nearly equal parameters for which the constraints say different things."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self

from ..errors import ScengenError
from ..params import Parameter, Value, values, with_values
from ..samplers.keyed import unit
from ..samplers.split import ID
from ..samplers.task import Task
from ..scenario import Scenario

GRID = 12
"""Number of steps of a way between two parameter values, in each of which a constraint may start to fail."""
MAX_IN_STEP = 3
"""Largest number of limits that are looked for in one step."""
BISECTIONS = 34
"""Number of bisections between two places with different answers: to 1e-10 of their distance."""
MARGIN = 1e-6
"""Share of the way by which the stored parameters are apart from the limit, on either side."""
MAX_EDGES = 2
"""Largest number of edges that are stored for the same reasons."""
PROPOSALS = 30
"""Number of indices of each split whose refuted proposals are looked at."""
ERRORS = (ScengenError, ArithmeticError, LookupError, TypeError, ValueError)
"""Errors of constraints that rely on an earlier one which does not hold."""
CORNERS = 12
"""Number of corners of the parameters' bounds to which all parameters go at once."""


Reasons = tuple[str, ...]


@dataclass(frozen=True)
class Edge:
    """A limit of a constraint on the way from a training draw to other parameter values."""

    start: int
    """Index of the training draw."""
    pairs: Mapping[str, tuple[Value, Value]]
    """Values just before and just beyond the limit, of the parameters that differ from the draw's."""
    before: Reasons
    """Reasons of all refutations before the limit; none if the scenario is feasible."""
    after: Reasons
    """Reasons of all refutations beyond the limit, likewise."""

    def plain(self, known: list[str]) -> list[Any]:
        """Plain data, in which numbers stand for reasons.

        Args:
            known: the reasons by number, to which new ones are added.
        """
        known += [reason for reason in dict.fromkeys((*self.before, *self.after)) if reason not in known]
        sides = ([known.index(reason) for reason in side] for side in (self.before, self.after))
        return [self.start, {name: list(pair) for name, pair in self.pairs.items()}, *sides]

    @classmethod
    def of(cls, plain: Sequence[Any], known: Sequence[str]) -> Self:
        """The reverse of `plain`."""
        start, pairs, *sides = plain
        before, after = (tuple(known[int(number)] for number in side) for side in sides)
        return cls(start, {name: (low, high) for name, (low, high) in pairs.items()}, before, after)

    def again(self, start: Scenario) -> "Edge":
        """The edge with the reasons that the constraints give now."""
        low, high = ({name: pair[side] for name, pair in self.pairs.items()} for side in (0, 1))
        return Edge(self.start, self.pairs, reasons(start, low) or (), reasons(start, high) or ())


def edges(task: Task, starts: Sequence[Scenario], seed: int) -> list[Edge]:
    """Edges of all constraints that a change of one parameter, or a way to a refuted draw or a corner, reaches.

    Args:
        starts: training draws from which parameters are changed.
        seed: seed of the draws whose refuted proposals are the ends of further ways.
    """
    found: list[Edge] = []
    counts: Counter[frozenset[str]] = Counter()
    reached = set[str]()
    for number, start in enumerate(starts):
        for end in (*_one_by_one(task), *(() if number else (*_refuted(task, seed), *_corners(task)))):
            for edge in _along(number, start, end, task.known):
                kind = frozenset({*edge.before} ^ {*edge.after})
                if counts[kind] < MAX_EDGES if len(end) == 1 else kind - reached:
                    counts[kind] += 1
                    reached |= kind
                    found.append(edge)
    return sorted(found, key=lambda edge: (edge.after, edge.before))


def reasons(start: Scenario, changed: Mapping[str, Value]) -> Reasons | None:
    """Reasons of all refutations of a scenario with some parameters changed, in any order.

    The kind of error is the last one if parameters are so strange that a later constraint cannot be asked. None if they
    are out of bounds.
    """
    try:
        scenario = with_values(start, changed)
    except ScengenError:
        return None
    found = []
    try:
        for refutation in scenario.constraints():
            found += [refutation.reason] if refutation else []
    except ERRORS as error:
        found.append(type(error).__name__)
    return tuple(found)


def _one_by_one(task: Task) -> Iterator[dict[str, Value]]:
    """Ends of the ways on which one parameter goes to one of its bounds."""
    for name, parameter in task.known.items():
        for bound in (parameter.low, parameter.high):
            yield {name: int(bound) if parameter.integer else bound}


def _corners(task: Task) -> Iterator[dict[str, Value]]:
    """Corners of the bounds, chosen at random."""
    for number in range(CORNERS):
        sides = {name: unit("corner", number, name) < 0.5 for name in task.known}
        ends = {name: p.low if sides[name] else p.high for name, p in task.known.items()}
        yield {name: int(end) if task.known[name].integer else end for name, end in ends.items()}


def _refuted(task: Task, seed: int) -> Iterator[dict[str, Value]]:
    """Parameters of refuted proposals, the first one for each reason."""
    seen: set[str] = set()
    for split in (ID, *task.axes):
        for index in range(PROPOSALS):
            try:
                tries = list(task.proposals(split, seed, index))
            except ScengenError:
                continue
            for proposal in tries:
                if proposal.refutation and proposal.refutation.reason not in seen:
                    seen.add(proposal.refutation.reason)
                    yield values(proposal.scenario)


def _along(number: int, start: Scenario, end: Mapping[str, Value], known: Mapping[str, Parameter]) -> Iterator[Edge]:
    """Edges on the way from a draw to other parameter values."""
    begin = values(start)
    moved = {name: value for name, value in end.items() if value != begin[name]}

    def at(share: float) -> dict[str, Value]:
        share = min(max(share, 0.0), 1.0)
        entry = {name: begin[name] + share * (value - begin[name]) for name, value in moved.items()}
        return {name: round(value) if known[name].integer else float(f"{value:.9g}") for name, value in entry.items()}

    def ask(share: float) -> Reasons | None:
        return reasons(start, at(share))

    steps = [k / GRID for k in range(GRID + 1)]
    for (low, first), (high, last) in pairwise([(share, ask(share)) for share in steps]):
        for _ in range(MAX_IN_STEP):
            if first == last or first is None or last is None:
                break
            limit = bisected(ask, low, high)
            pair = at(limit - MARGIN), at(limit + MARGIN)
            before, after = (reasons(start, each) for each in pair)
            if before is None or after is None or before == after:
                break
            yield Edge(number, {name: (pair[0][name], pair[1][name]) for name in moved}, before, after)
            low, first = limit + MARGIN, after


def bisected(ask: Callable[[float], Any], low: float, high: float) -> float:
    """A place between two at which an answer changes."""
    before = ask(low)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if ask(middle) == before else (low, middle)
    return high
