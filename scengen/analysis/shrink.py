"""From a failing scenario to the few parameters that make it fail."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from ..errors import BadConfig
from ..params import Value
from ..samplers.dists import Dist

STEPS = 5
"""Halvings of the distance to the centre: the values found are within 1/32 of it."""

Fails = Callable[[Mapping[str, Value]], bool]
"""Whether a scenario with these parameter values fails in the way that is to be explained."""


@dataclass(frozen=True)
class Cause:
    """A parameter that cannot be at its centre if the scenario is to fail."""

    parameter: str
    centre: Value
    value: Value
    """The value nearest to the centre with which it was seen to fail."""
    began: Value
    """The value before shrinking."""
    departure: float
    """How far the value is from the centre [training widths]."""


@dataclass(frozen=True)
class Shrunk:
    """A failing scenario as near to the centre as could be found."""

    values: Mapping[str, Value]
    causes: tuple[Cause, ...]
    """Put any one of them alone to its centre, the others being what they were: no failure. Farthest first."""
    tries: int
    """How many scenarios were judged."""


def centre(training: Mapping[str, Dist]) -> dict[str, Value]:
    """The median of every training distribution."""
    return {name: dist.quantile(0.5) for name, dist in training.items()}


def shrink(
    begin: Mapping[str, Value], middle: Mapping[str, Value], scales: Mapping[str, float], fails: Fails
) -> Shrunk:
    """Move a failing scenario towards a centre while it still fails.

    First delta debugging (Zeller and Hildebrandt 2002): put as many parameters as possible to their centre, groups at a
    time, until none can be. Then the distances of those that remain are halved, one after the other. No scenario is
    judged twice.

    Args:
        begin, middle: values of all parameters of a failing scenario and of the centre.
        scales: what to measure the departure of each parameter in, as `scengen.analysis.space.scale` has it.
        fails: judged often; the cheaper the better.

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
        raise BadConfig("the centre of training fails in the same way: no parameter is to blame, but the family")
    differ = [name for name in begin if begin[name] != middle[name]]
    needed = _fewest(differ, lambda kept: failing({**middle, **{n: begin[n] for n in kept}}))
    values = {**middle, **{n: begin[n] for n in needed}}
    for name in needed:
        values = _nearer(values, name, middle[name], failing)
    causes = [Cause(n, middle[n], values[n], begin[n], abs(values[n] - middle[n]) / scales[n]) for n in needed]
    return Shrunk(values, tuple(sorted(causes, key=lambda c: -c.departure)), len(judged))


def _fewest(items: Sequence[str], fails: Callable[[Sequence[str]], bool]) -> list[str]:
    """A subset that fails, and from which no single item can be taken away: the algorithm ddmin."""
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
    """Cut a list into parts of nearly equal length."""
    for i in range(parts):
        yield list(items[i * len(items) // parts : (i + 1) * len(items) // parts])


def _nearer(values: Mapping[str, Value], name: str, middle: Value, failing: Fails) -> dict[str, Value]:
    """Halve the distance of one parameter between a value that fails and one that does not."""
    good, bad = middle, values[name]
    for _ in range(STEPS):
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
