"""Limits of a family's constraints: pairs of nearly equal parameters for which the constraints say different things."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self

from ..errors import ScengenError
from ..params import Parameter, Value, values, with_values
from ..samplers.split import ID
from ..samplers.task import Task
from ..scenario import Scenario

GRID = 12
"""Number of steps of a way between two parameter values, in each of which a constraint may begin to fail."""
BISECTIONS = 30
"""Number of bisections of such a step."""
MARGIN = 1e-6
"""Share of the way by which the stored parameters are apart from the limit, on either side."""
MAX_EDGES = 3
"""Largest number of edges that are stored for one reason."""
PROPOSALS = 30
"""Number of indices of each split whose refuted proposals are looked at."""


@dataclass(frozen=True)
class Edge:
    """A limit of a constraint on the way from a training draw to other parameter values."""

    start: int
    """Index of the training draw."""
    pairs: Mapping[str, tuple[Value, Value]]
    """Values just before and just beyond the limit, of the parameters that differ from the draw's."""
    before: str
    """Reason of the refutation before the limit; empty if the scenario is feasible."""
    after: str
    """Reason of the refutation beyond the limit, likewise."""

    @property
    def plain(self) -> list[Any]:
        """Plain data."""
        return [self.start, {name: list(pair) for name, pair in self.pairs.items()}, self.before, self.after]

    @classmethod
    def of(cls, plain: Sequence[Any]) -> Self:
        """The reverse of `plain`."""
        start, pairs, before, after = plain
        return cls(start, {name: (low, high) for name, (low, high) in pairs.items()}, before, after)

    def again(self, start: Scenario) -> "Edge":
        """The edge with the reasons that the constraints give now."""
        low, high = ({name: pair[side] for name, pair in self.pairs.items()} for side in (0, 1))
        return Edge(self.start, self.pairs, reason(start, low) or "", reason(start, high) or "")


def edges(task: Task, starts: Sequence[Scenario], seed: int) -> list[Edge]:
    """Edges of all constraints that a change of one parameter, or a way to a refuted draw, reaches.

    Args:
        starts: training draws from which parameters are changed.
        seed: seed of the draws whose refuted proposals are the ends of further ways.
    """
    found: list[Edge] = []
    counts: Counter[frozenset[str]] = Counter()
    refuted = list(_refuted(task, seed))
    for number, start in enumerate(starts):
        for end in (*_one_by_one(task), *refuted):
            if len(end) > 1 and number:
                continue
            for edge in _along(number, start, end, task.known):
                kind = frozenset((edge.before, edge.after))
                if counts[kind] < (MAX_EDGES if len(end) == 1 else 1):
                    counts[kind] += 1
                    found.append(edge)
    return sorted(found, key=lambda edge: (edge.after, edge.before))


def reason(start: Scenario, changed: Mapping[str, Value]) -> str | None:
    """Reason of the refutation of a scenario with some parameters changed; empty if it is feasible.

    None if the parameters are out of bounds, or if they are so strange that the constraints raise an error.
    """
    try:
        refutation = with_values(start, changed).infeasible()
    except (ScengenError, ArithmeticError, LookupError, ValueError):
        return None
    return refutation.reason if refutation else ""


def _one_by_one(task: Task) -> Iterator[dict[str, Value]]:
    """Ends of the ways on which one parameter goes to one of its bounds."""
    for name, parameter in task.known.items():
        for bound in (parameter.low, parameter.high):
            yield {name: int(bound) if parameter.integer else bound}


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
        told = {name: begin[name] + share * (value - begin[name]) for name, value in moved.items()}
        return {name: round(value) if known[name].integer else float(f"{value:.9g}") for name, value in told.items()}

    steps = [k / GRID for k in range(GRID + 1)]
    found = [reason(start, at(share)) for share in steps]
    for (low, first), (high, last) in pairwise(zip(steps, found, strict=True)):
        if first != last and first is not None and last is not None:
            limit = _bisected(lambda share: reason(start, at(share)), low, high)
            pair = at(limit - MARGIN), at(limit + MARGIN)
            before, after = (reason(start, each) for each in pair)
            if before is not None and after is not None and before != after:
                yield Edge(number, {name: (pair[0][name], pair[1][name]) for name in moved}, before, after)


def _bisected(ask: Callable[[float], str | None], low: float, high: float) -> float:
    """A place between two at which an answer changes."""
    before = ask(low)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if ask(middle) == before else (low, middle)
    return high
