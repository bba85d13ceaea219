"""What conditions change: perturbations and arms against the clean episodes, and interactions of two factors."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from ..perturb.perturbation import NONE
from ..samplers.split import ID
from .arms import ARMS, BENIGN, CLEAN, LANGUAGE, PICTURES
from .settings import Condition
from .statistics import Difference, Rate, contrast, difference, paired, rate
from .table import otherwise, percent

Cell = Mapping[tuple[int, int], Sequence[bool]]
"""Outcomes of the rollouts of each scenario by seed and index, which twins share."""
Factors = frozenset[str]
"""Axes and kinds of perturbation, each with its severity or level."""
JOINT = (1, -1, -1, 1)
"""Signs of an interaction: both factors, the first alone, the second alone, none."""
VERBS = {PICTURES: "pictures", LANGUAGE: "the instruction"}
"""Names of the inputs in sentences."""


@dataclass(frozen=True)
class ConditionLine:
    """Success on one split under a condition, against the clean episodes of the same scenarios."""

    task: str
    """Name of the task."""
    split: str
    """Name of the split."""
    condition: str
    """Perturbation or arm."""
    rate: Rate
    """Success rate under the condition."""
    difference: Difference | None
    """Difference to the clean episodes; None if there are none."""
    same_actions: int
    """Number of episodes in which every action is that of the clean episode."""
    crashed: int
    """Number of episodes in which the policy crashed. They are in no rate."""
    otherwise: int
    """Number of episodes that reached the goal without all means of their task."""


@dataclass(frozen=True)
class Interaction:
    """What two factors do together beyond the sum of what each does alone, on twins."""

    task: str
    """Name of the task."""
    one: str
    """First factor: axes and perturbations, joined by `+`."""
    other: str
    """Second factor."""
    rates: tuple[float, float, float, float]
    """Success rates with both factors, the first, the second, and none."""
    difference: Difference
    """Both minus the first minus the second plus none: negative if they are worse together than the sum."""

    def __str__(self) -> str:
        both, one, other, none = (f"{100 * each:.0f}" for each in self.rates)
        apart, value = self.difference, 100 * self.difference.value
        interval = f"[{100 * apart.low:.0f}, {100 * apart.high:.0f}]"
        if apart.high < 0:
            told = (
                f"worse together than the sum by {-value:.0f} points [{-100 * apart.high:.0f}, {-100 * apart.low:.0f}]"
            )
        elif apart.low > 0:
            told = f"better together than the sum by {value:.0f} points {interval}"
        else:
            told = f"no interaction is seen: {value:+.0f} points {interval}"
        rates = f"none {none}, first {one}, second {other}, both {both}"
        return f"{self.task}, {self.one} and {self.other}: {told} ({apart.twins} scenarios; {rates})"


def condition_lines(episodes: Sequence[Mapping[str, Any]]) -> list[ConditionLine]:
    """A line for each task, split and condition but the clean one, in the order of the episodes."""
    keys = dict.fromkeys((e["task"], e["split"], Condition(e["perturbation"], e["arm"])) for e in episodes)
    return [line for key in keys if key[2] and (line := _condition_line(episodes, *key))]


def _condition_line(
    episodes: Sequence[Mapping[str, Any]], task: str, split: str, condition: Condition
) -> ConditionLine | None:
    there = [e for e in episodes if (e["task"], e["split"]) == (task, split)]
    own = [e for e in there if Condition(e["perturbation"], e["arm"]) == condition]
    clean = {(e["scenario"], e["rollout"]): e for e in there if not Condition(e["perturbation"], e["arm"])}
    found, before = outcomes(own), outcomes(clean.values())
    if not found:
        return None
    shared = [key for key in found if key in before]
    apart = paired([found[key] for key in shared], [before[key] for key in shared]) if len(shared) > 1 else None
    if condition.arm == BENIGN and before:
        apart = difference(rate([*found.values()]), rate([*before.values()]))
    twins = [(e, clean[key]) for e in own if (key := (e["scenario"], e["rollout"])) in clean]
    same = sum(e["actions_sha256"] == twin["actions_sha256"] != "" for e, twin in twins)
    counts = sum(bool(e["crashed"]) for e in own), sum(map(otherwise, own))
    return ConditionLine(task, split, str(condition), rate([*found.values()]), apart, same, *counts)


def outcomes(episodes: Iterable[Mapping[str, Any]]) -> dict[tuple[int, int], list[bool]]:
    """Outcomes of the episodes in which the policy did not crash, by scenario."""
    found: dict[tuple[int, int], list[bool]] = {}
    for e in episodes:
        if not e["crashed"]:
            found.setdefault((e["seed"], e["index"]), []).append(e["success"])
    return found


def interactions(episodes: Sequence[Mapping[str, Any]]) -> list[Interaction]:
    """All interactions of two factors for which the four cells were played."""
    found = []
    for task in dict.fromkeys(e["task"] for e in episodes):
        cells = _cells(e for e in episodes if e["task"] == task)
        for both in cells:
            found += [_interaction(task, cells, one, both - one) for one in _parts(both, cells)]
    return [each for each in found if each is not None]


def _cells(episodes: Iterable[Mapping[str, Any]]) -> dict[Factors, Cell]:
    """Outcomes of the episodes without an intervention, by what is shifted in them."""
    of: dict[Factors, list[Mapping[str, Any]]] = {}
    for e in episodes:
        if e["arm"] == CLEAN:
            of.setdefault(factors(e["split"], e["perturbation"]), []).append(e)
    return {which: outcomes(some) for which, some in of.items()}


def factors(split: str, perturbation: str) -> Factors:
    """Axes and kinds of perturbation of an episode."""
    return frozenset(
        part for text, nothing in ((split, ID), (perturbation, NONE)) if text != nothing for part in text.split("+")
    )


def _parts(both: Factors, cells: Mapping[Factors, Cell]) -> Iterator[Factors]:
    """First halves of the ways to split factors in two that were played alone; each way once."""
    names = sorted(both)
    for size in range(1, len(names)):
        for some in combinations(names, size):
            one = frozenset(some)
            if names[0] in one and one in cells and both - one in cells and frozenset() in cells:
                yield one


def _interaction(task: str, cells: Mapping[Factors, Cell], one: Factors, other: Factors) -> Interaction | None:
    four = [cells[one | other], cells[one], cells[other], cells[frozenset()]]
    shared = [key for key in four[0] if all(key in cell for cell in four)]
    if len(shared) < 2:
        return None
    sides = [[cell[key] for key in shared] for cell in four]
    means = tuple(rate(side).value for side in sides)
    return Interaction(task, _named(one), _named(other), means, contrast(sides, JOINT))  # type: ignore[arg-type]


def _named(some: Factors) -> str:
    return "+".join(sorted(some))


def arm_sentences(lines: Sequence[ConditionLine], clean: Mapping[tuple[str, str], Rate]) -> Iterator[str]:
    """What the arms show of the inputs that a policy uses.

    Args:
        clean: success rates of the clean episodes, by task and split.
    """
    for line in lines:
        if line.condition in ARMS and line.difference is not None:
            arm, before = ARMS[line.condition], clean[line.task, line.split]
            told = f"{arm.title} {_of(line.rate)}, clean {_of(before)}"
            what = _use(line, VERBS[arm.needs]) if arm.needs else f"by chance {percent(line.difference, '+', 0)} points"
            yield f"{line.task}, {line.split}: {what}: {told}"


def without_effect(lines: Sequence[ConditionLine]) -> dict[str, list[str]]:
    """Perturbations under which a policy acts as without them in every episode, by task."""
    found: dict[str, list[str]] = {}
    for task, name in dict.fromkeys((line.task, line.condition) for line in lines if line.condition not in ARMS):
        own = [line for line in lines if (line.task, line.condition) == (task, name)]
        if all(line.same_actions == line.rate.rollouts for line in own):
            found.setdefault(task, []).append(name)
    return found


def _use(line: ConditionLine, what: str) -> str:
    """Whether an input is used."""
    assert line.difference is not None
    low, high = line.difference.low, line.difference.high
    if line.same_actions == line.rate.rollouts:
        return f"{what} ignored, every action is the same"
    if high < 0:
        return f"{what} used, without it {percent(line.difference, '+', 0)} points"
    return f"no use of {what} is seen" if low <= 0 else f"success is higher without {what}"


def _of(found: Rate) -> str:
    return f"{round(found.value * found.rollouts)} of {found.rollouts}"
