"""Reduction of a failing scenario to the few parameters that make it fail."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from ...errors import BadConfig
from ...params import Value
from ...samplers.dists import Dist

HALVINGS = 5
"""Number of halvings of the distance to the centre: the values found are accurate to 1/32 of it."""

Fails = Callable[[Mapping[str, Value]], bool]
"""Test whether a scenario with these parameter values fails in the way that is to be explained."""


@dataclass(frozen=True)
class Cause:
    """A parameter without which the scenario does not fail: put to its centre alone, the failure disappears."""

    parameter: str
    centre: Value
    """Median of the parameter in training."""
    value: Value
    """Value nearest to the centre with which the scenario failed."""
    started: Value
    """Value before shrinking."""
    departure: float
    """Distance of the value from the centre [training widths]."""


@dataclass(frozen=True)
class Shrunk:
    """The failing scenario nearest to the centre that was found."""

    values: Mapping[str, Value]
    """Values of all parameters."""
    causes: tuple[Cause, ...]
    """Parameters that the failure needs, the farthest from its centre first."""
    tries: int
    """Number of scenarios that were judged."""


def centre(training: Mapping[str, Dist]) -> dict[str, Value]:
    """The medians of the training distributions."""
    return {name: dist.quantile(0.5) for name, dist in training.items()}


def shrink(
    begin: Mapping[str, Value], middle: Mapping[str, Value], scales: Mapping[str, float], fails: Fails
) -> Shrunk:
    """Move a failing scenario towards a centre while it still fails.

    First, delta debugging (Zeller and Hildebrandt 2002) puts as many parameters as possible to their centre, in groups.
    Then the distances of the remaining parameters are halved, one after the other. No scenario is judged twice.

    Args:
        begin, middle: values of all parameters of the failing scenario and of the centre.
        scales: unit of each parameter's departure, see `scengen.ood.analysis.space.scale`.
        fails: test that is called often; the cheaper the better.

    Raises:
        BadConfig: the scenario does not fail, or the centre fails too.
    """
    judged: dict[tuple[Value, ...], bool] = {}

    def failing(values: Mapping[str, Value]) -> bool:
        key = tuple(values[name] for name in begin)
        if key not in judged:
            judged[key] = fails(values)
        return judged[key]

    if not failing(begin):
        raise BadConfig("the scenario does not fail; there is nothing to shrink")
    if failing(middle):
        raise BadConfig("the centre of training fails in the same way: the family is at fault, not a parameter")
    differ = [name for name in begin if begin[name] != middle[name]]
    needed = _fewest(differ, lambda kept: failing({**middle, **{n: begin[n] for n in kept}}))
    values = {**middle, **{n: begin[n] for n in needed}}
    for name in needed:
        values = _nearer(values, name, middle[name], failing)
    causes = [Cause(n, middle[n], values[n], begin[n], abs(values[n] - middle[n]) / scales[n]) for n in needed]
    return Shrunk(values, tuple(sorted(causes, key=lambda c: -c.departure)), len(judged))


def _fewest(items: Sequence[str], fails: Callable[[Sequence[str]], bool]) -> list[str]:
    """A failing subset from which no single item can be removed (the algorithm ddmin)."""
    kept, parts = list(items), 2
    while len(kept) > 1:
        groups = list(_split(kept, min(parts, len(kept))))
        rests = [[n for n in kept if n not in group] for group in groups] if len(groups) > 2 else []
        smaller = next((some for some in [*groups, *rests] if fails(some)), None)
        if smaller is not None:
            parts = 2 if smaller in groups else max(2, len(groups) - 1)
            kept = smaller
        elif len(groups) == len(kept):
            break
        else:
            parts = 2 * len(groups)
    return kept


def _split(items: Sequence[str], parts: int) -> Iterator[list[str]]:
    """Cut a list into parts of nearly equal lengths."""
    for i in range(parts):
        yield list(items[i * len(items) // parts : (i + 1) * len(items) // parts])


def _nearer(values: Mapping[str, Value], name: str, middle: Value, failing: Fails) -> dict[str, Value]:
    """Move one parameter towards the centre by bisection while the scenario still fails."""
    good, bad = middle, values[name]
    for _ in range(HALVINGS):
        between = (good + bad) / 2
        if isinstance(bad, int):
            between = round(between)
            if between in (good, bad):
                break
        if failing({**values, name: between}):
            bad = between
        else:
            good = between
    return {**values, name: bad}
