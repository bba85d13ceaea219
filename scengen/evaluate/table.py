"""The table of an evaluation: success in and out of distribution, with intervals."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from ..samplers.split import ID
from .statistics import Difference, Rate, difference, mean_difference, mean_rate, paired, rate


@dataclass(frozen=True)
class TableLine:
    """One line of the table: a task or a category, on one OOD split."""

    what: str
    """Name of the task or category."""
    split: str
    """Name of the split, or `all`."""
    id: Rate | None
    """Success rate in distribution; None if no training pool was given."""
    ood: Rate | None
    """Success rate out of distribution; None if no other pool was given."""
    difference: Difference | None
    """Difference OOD minus ID; None if a rate is missing."""
    crashed: int = 0
    """Number of episodes in which the policy crashed. They are in no rate."""
    otherwise: int = 0
    """Number of episodes that reached the goal without all means of their task. Rates count them as solved under the
    paper's rules alone."""


def table(episodes: Sequence[Mapping[str, Any]]) -> list[TableLine]:
    """The paper's table: one line for every task and OOD split, for every category, and for all tasks together.

    A scenario counts once, with any number of rollouts. Scenario i of an axis is scenario i of training with
    the axis moved. If training has at least half of these twins, differences are taken within twins. A line over
    several axes first takes the mean over the axes for each i. Categories are means over their tasks, with equal
    weights on both sides, so that tasks with many axes count no more than others.
    """
    lines, whole = [], []
    for task in _values(episodes, "task"):
        cells = _outcomes_by_split(e for e in episodes if e["task"] == task and not e.get("crashed"))
        training, axes = cells.pop(ID, {}), cells
        lines += [_line(task, axis, training, [shares]) for axis, shares in axes.items()]
        every = _line(task, "all", training, list(axes.values()))
        if len(axes) > 1:
            lines.append(every)
        elif not axes:
            lines.append(replace(every, split=ID))
        category = next(e["category"] for e in episodes if e["task"] == task)
        whole.append((category, every))
    for category in dict.fromkeys(name for name, _ in whole):
        lines.append(_mean_line(category, [line for name, line in whole if name == category]))
    found = [*lines, _mean_line("all", [line for _, line in whole])]
    counted = {"crashed": [e for e in episodes if e.get("crashed")], "otherwise": [e for e in episodes if otherwise(e)]}
    return [
        replace(line, **{name: sum(_belongs(e, line) for e in some) for name, some in counted.items()})
        for line in found
    ]


def otherwise(episode: Mapping[str, Any]) -> bool:
    """Whether an episode reached the goal, but not by the means of its task. Earlier releases do not record it."""
    return bool(episode.get("lacks"))


def _belongs(episode: Mapping[str, Any], line: TableLine) -> bool:
    """Whether a line of the table is about an episode."""
    about = line.what in (episode["task"], episode["category"], "all")
    return about and (line.split == "all" or episode["split"] in (ID, line.split))


def cells(line: TableLine) -> list[str]:
    """The cells of a line, as text."""
    return [line.what, line.split, percent(line.id), percent(line.ood), percent(line.difference, "+")]


def plain(lines: Sequence[TableLine]) -> list[dict[str, Any]]:
    """The table as plain data."""
    return [asdict(line) for line in lines]


Outcomes = dict[tuple[int, int], list[bool]]
"""Outcomes of the rollouts of each scenario of a split, by seed and index: twins have the same in all splits."""


def _outcomes_by_split(episodes: Iterable[Mapping[str, Any]]) -> dict[str, Outcomes]:
    """Outcomes by split."""
    found: dict[str, Outcomes] = {}
    for e in episodes:
        found.setdefault(e["split"], {}).setdefault((e["seed"], e["index"]), []).append(e["success"])
    return found


def _line(what: str, split: str, training: Outcomes, axes: Sequence[Outcomes]) -> TableLine:
    """The line of one task. Several axes are averaged over the scenarios that all of them have."""
    inside = rate(list(training.values())) if training else None
    shared = [key for key in axes[0] if all(key in axis for axis in axes)] if axes else []
    if not shared:
        return TableLine(what, split, inside, None, None)
    outcomes = {key: [success for axis in axes for success in _equally(axis[key], axes, key)] for key in shared}
    outside = rate(list(outcomes.values()))
    twins = [key for key in shared if key in training]
    if inside is None:
        return TableLine(what, split, None, outside, None)
    if 2 * len(twins) >= len(shared) and len(twins) > 1:
        apart = paired([outcomes[key] for key in twins], [training[key] for key in twins])
    else:
        apart = difference(outside, inside)
    return TableLine(what, split, inside, outside, apart)


def _equally(outcomes: list[bool], axes: Sequence[Outcomes], key: tuple[int, int]) -> list[bool]:
    """The same number of rollouts of every axis, so that each axis has the same weight."""
    return outcomes[: min(len(axis[key]) for axis in axes)]


def _mean_line(what: str, lines: Sequence[TableLine]) -> TableLine:
    """The mean line of some tasks: over those with both rates, or over all if no task has both."""
    both = [line for line in lines if line.difference is not None]
    if not both:
        inside = [line.id for line in lines if line.id is not None]
        outside = [line.ood for line in lines if line.ood is not None]
        return TableLine(
            what, "all", mean_rate(inside) if inside else None, mean_rate(outside) if outside else None, None
        )
    parts = [(line.id, line.ood, line.difference) for line in both]
    inside, outside, apart = ([part for part in column if part is not None] for column in zip(*parts, strict=True))
    return TableLine(what, "all", mean_rate(inside), mean_rate(outside), mean_difference(apart))


def _values(episodes: Sequence[Mapping[str, Any]], name: str) -> list[str]:
    return list(dict.fromkeys(e[name] for e in episodes))


def percent(rate: Rate | Difference | None, sign: str = "", digits: int = 1) -> str:
    """A rate with its interval in percent, as text."""
    if rate is None:
        return "-"
    value, low, high = (f"{100 * each:{sign}.{digits}f}" for each in (rate.value, rate.low, rate.high))
    return f"{value} [{low}, {high}]"


def distinct(lines: Sequence[TableLine], category: Mapping[str, str]) -> list[TableLine]:
    """Lines without those that repeat another one: means over one task, or over one category.

    Args:
        category: category of each task.
    """
    found = [line for line in lines if line.what in category]
    for line in (line for line in lines if line.what not in category):
        if not any(_repeats(line, other) for other in found):
            found.append(line)
    return found


def _repeats(line: TableLine, other: TableLine) -> bool:
    """Whether a mean has the rates of another line, as that of one task has."""

    def numbers(rate: Rate | None) -> tuple[float, ...]:
        return () if rate is None else (rate.scenarios, rate.rollouts, round(rate.value, 9))

    return (numbers(line.id), numbers(line.ood)) == (numbers(other.id), numbers(other.ood))
