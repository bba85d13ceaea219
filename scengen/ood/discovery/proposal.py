"""Findings of the search as axes that can stand in a task file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from ...samplers.axis import Axis, Proof
from ...samplers.dists import Dist, Fixed, Integer, Mixture, Uniform
from ...samplers.task import Task
from .regions import Region, located
from .trial import BREAKS, INFEASIBLE, RegionBox, SearchTrial


@dataclass(frozen=True)
class Finding:
    """A box outside training in which the memory fails and the oracle does not."""

    axis: Axis
    proofs: list[Proof]
    """Proof for each moved parameter that its values lie outside training."""
    seen: int
    """Number of search trials within the box in which the memory failed and the oracle succeeded."""
    tried: int
    """Number of search trials within the box that were feasible."""
    confirmed: int
    """Number of fresh twins in which the memory failed and the oracle succeeded."""
    fresh: int
    """Number of fresh twins tried."""
    within: int
    """Number of their controls that the memory solved."""
    controls: int
    """Number of controls tried."""
    p: float
    """One-sided p value of the confirmation, corrected for its looks, and by Holm for the number of boxes."""
    known: tuple[str, ...]
    """Axes of the task file that move one of the same parameters into the same region."""


def finding(
    task: Task,
    known: Sequence[Region],
    box: RegionBox,
    searched: Sequence[SearchTrial],
    confirming: Sequence[SearchTrial],
    p: float,
) -> Finding:
    """The axis of a box, with its evidence.

    Args:
        known: all regions, by number.
        searched: all trials of the search.
        confirming: the trials in fresh twins.
        p: p value of the confirmation, corrected for its looks.
    """
    confirmed = sum(trial.breaks for trial in confirming)
    played = [solved for trial in confirming for solved in trial.controls]
    axis = _axis(known, box, _reason(confirmed, len(confirming), played))
    inside = [t.outcome for t in searched if box.holds(t.point) and t.outcome != INFEASIBLE]
    return Finding(
        axis=axis,
        proofs=task.prove(axis),
        seen=inside.count(BREAKS),
        tried=len(inside),
        confirmed=confirmed,
        fresh=len(confirming),
        within=sum(played),
        controls=len(played),
        p=p,
        known=tuple(a.name for a in task.axes.values() if any(_moves_into(known[i], a.replace) for i in box.regions)),
    )


def _reason(confirmed: int, fresh: int, played: Sequence[bool]) -> str:
    """The text `why` of an axis."""
    return (
        f"An object-centric memory fails in {confirmed} of {fresh} fresh twins that the oracle solves"
        f" and, moved within training, in {played.count(False)} of {len(played)}."
    )


def _axis(known: Sequence[Region], box: RegionBox, why: str) -> Axis:
    """The axis that moves the parameters of a box; one continuous parameter gets five severities."""
    moved = {known[i].parameter.name: distribution(known[i], low, high) for i, low, high in box.ranges}
    name = "_and_".join(known[i].name for i in box.regions)
    first = known[box.regions[0]]
    graded = len(box.ranges) == 1 and first.beyond and not first.parameter.integer
    return Axis(name, why, "scengen axis discover", moved, 5 if graded else 0)


def distribution(region: Region, low: float, high: float) -> Dist:
    """The distribution over a range of places; on a circle it may run through the seam of the parameter's bounds."""
    begin, end = region.value(low), region.value(high)
    known = region.parameter
    if known.integer:
        return Fixed(begin) if begin == end else Integer(*sorted((int(begin), int(end))))
    begin, end = (float(f"{v:.4g}") for v in (begin, end))
    if known.period and begin > end:
        return Mixture((_uniform(begin, known.high), _uniform(known.low, end)))
    return _uniform(*sorted((begin, end)))


def _uniform(low: float, high: float) -> Fixed | Uniform:
    return Fixed(low) if low == high else Uniform(low, high)


def _moves_into(region: Region, replaced: Mapping[str, Dist]) -> bool:
    """Whether an axis moves the parameter of a region into it."""
    dist = replaced.get(region.parameter.name)
    return dist is not None and any(located(region, v) for part in dist.support for v in (part.low, part.high))


def as_yaml(task: Task, findings: Sequence[Finding], spent: Mapping[str, int]) -> str:
    """The confirmed axes in the format of a task file, after a comment with the number of trials.

    Args:
        spent: number of trials by stage and by outcome.
    """
    text = ", ".join(f"{count} {what}" for what, count in spent.items())
    axes = {one.axis.name: _entry(one.axis) for one in findings}
    found = yaml.safe_dump({"axes": axes}, sort_keys=False, default_flow_style=None, width=120)
    return f"# Axes of {task.name} found by scengen axis discover: {text}\n{found}"


def _entry(axis: Axis) -> dict[str, Any]:
    """An axis as an entry of a task file."""
    moved: dict[str, Any] = {}
    for name, dist in axis.replace.items():
        *groups, last = name.split(".")
        inner = moved
        for group in groups:
            inner = inner.setdefault(group, {})
        inner[last] = plain(dist)
    severities = {"severities": axis.severities} if axis.severities else {}
    return {"why": axis.why, "source": axis.source, **severities, "replace": moved}


def plain(dist: Dist) -> list[Any]:
    """A distribution as a task file spells it."""
    if isinstance(dist, Fixed):
        return ["fixed", dist.value]
    if isinstance(dist, Mixture):
        return ["mixture", *map(plain, dist.parts)]
    ends = dist.support[0].low, dist.support[-1].high
    return ["integer" if isinstance(dist, Integer) else "uniform", *ends]
