"""The audit of a task: rules are chosen on one part of the draws, judged on the other, and tried on its axes.

A rule is intended if it uses a quantity that depends on the parameters which the decision is meant to follow from.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase

import numpy as np
from scipy.stats import binom

from ...errors import BadConfig, Infeasible, UnknownName
from ...evaluate.statistics import wilson
from ...params import Parameter, values, with_values
from ...samplers.keyed import unit
from ...samplers.task import Task
from ...scenario import Scenario
from .quantities import Sample, joined, visible
from .rules import Choices, Rule, Search, answers, varied

FITTED = 0.6
"""Share of the draws on which rules are chosen. They are judged on the others."""
MIN_DRAWS = 40
"""Number of scenarios below which nothing is measured."""
LEVEL = 0.001
"""Level of the binomial test of a rule against the best fixed answer, with Bonferroni's correction."""
REVEALED = 0.75
"""Share of the held-out draws from which a rule counts as revealing the decision. An axis on which it is right in
fewer draws breaks it."""
SIMPLER = 0.05
"""Share by which a rule must be better than a simpler one to be reported instead of it."""
MAX_CUES = 12
"""Number of unintended rules of one quantity that are reported, at most."""
MIN_JUDGED = 5
"""Number of scenarios from which an axis or a parameter is judged."""
SWAPS = 8
"""Number of pairs of scenarios in which a value is exchanged to see which quantities depend on the parameter."""
WIDENED = 8
"""Number of scenarios in which a parameter leaves its training range."""


@dataclass(frozen=True)
class Cue:
    """A rule and how often it is right."""

    rule: str
    """Name of the rule: its quantities, or the fixed answer."""
    share: float
    """Share of the held-out draws in which it is right."""
    low: float
    """Lower end of the 95 % interval of the share."""
    high: float
    """Upper end of the 95 % interval of the share."""
    p: float
    """P-value against the best fixed answer, times the number of rules that were tried; 1 for a fixed answer."""
    equal: Sequence[str] = ()
    """Other quantities that follow the same line in these draws, for a rule of one quantity."""
    axes: Mapping[str, float] = field(default_factory=dict)
    """Share of right answers on each axis that keeps training's answers."""

    @property
    def breaks(self) -> list[str]:
        """Axes that break the rule."""
        return [axis for axis, share in self.axes.items() if share < REVEALED]


@dataclass(frozen=True)
class DecisionAudit:
    """The result for one decision."""

    decision: str
    """Name of the decision."""
    draws: int
    """Number of held-out draws."""
    tried: int
    """Number of rules that were tried."""
    fixed: Cue
    """Best fixed answer; its share is the chance level."""
    intended: Cue | None
    """Best rule that uses an intended quantity, if one beats the fixed answer."""
    cues: Sequence[Cue]
    """Unintended rules that beat the fixed answer: of one quantity, then the best of two, then all quantities."""
    widen: Mapping[str, float]
    """Parameters that would break the best unintended rule if their range were wider: its share of right answers."""
    protected: Sequence[str]
    """Parameters that would break it, but only in scenarios which the constraints refuse."""

    @property
    def best(self) -> Cue:
        """The simplest unintended rule that is about as good as the best one."""
        every = (self.fixed, *self.cues)
        most = max(cue.share for cue in every)
        return next(cue for cue in every if cue.share >= most - SIMPLER)

    @property
    def revealed(self) -> bool:
        """Whether an unintended rule reveals the decision."""
        return self.best.share >= REVEALED


def draws(task: Task, split: str, seed: int, count: int) -> list[Scenario]:
    """The feasible scenarios among the first indices of a split."""
    found = []
    for index in range(count):
        try:
            found.append(task.draw(split, seed, index).scenario)
        except Infeasible:
            continue
    return found


def audit(
    task: Task,
    scenarios: Sequence[Scenario],
    axes: Mapping[str, Sequence[Scenario]],
    widen: bool = True,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[DecisionAudit]:
    """Audit the decisions of a task.

    Args:
        scenarios: scenarios of training, or of a pool.
        axes: scenarios by axis.
        widen: whether to look for parameters whose wider range would break what was found.
        progress: called with the number of decisions done and of all.

    Raises:
        BadConfig: the family declares no decisions, or names a parameter wrongly, or there are too few scenarios.
    """
    if len(scenarios) < MIN_DRAWS:
        raise BadConfig(f"{len(scenarios)} scenarios of {task.name}; the audit needs {MIN_DRAWS} or more")
    sample = Sample.of(scenarios)
    names = list(dict.fromkeys(name for row in sample.decisions for name in row))
    if not names:
        raise BadConfig(
            f"{task.family.__name__} declares no decisions; add a method decisions(), see docs/cues.md and scengen new"
        )
    depends = _Dependence(task, sample)
    tested = {axis: Sample.of(some) for axis, some in axes.items()}
    wider = _Wider(task, sample)
    found = []
    for done, name in enumerate(names, 1):
        rows = sample.with_decision(name)
        if len(rows) >= MIN_DRAWS:
            by = next(iter(rows.decisions))[name].by
            found.append(_judged(name, rows, depends.on(by), tested, wider if widen else None))
        progress(done, len(names))
    return found


def _judged(
    name: str, sample: Sample, intended: Mapping[str, bool], axes: Mapping[str, Sample], wider: "_Wider | None"
) -> DecisionAudit:
    """Audit one decision."""
    middle = int(FITTED * len(sample))
    fit, test = sample.part(range(middle)), sample.part(range(middle, len(sample)))
    quantities = varied(fit, intended)
    search = Search(fit, name, list(quantities))
    fixed = search.fixed()
    chance = float(fixed.right(test).mean())
    fair = [quantity for quantity in quantities if not intended[quantity]]
    several = not (isinstance(search.answers, Choices) and len(search.answers.labels) == 1)
    single, pairs = (list(search.single()), list(search.pairs(fair))) if several else ([], [])
    tried = len(single) + len(fair) * (len(fair) - 1) // 2 if several else 0

    def judged(rule: Rule) -> Cue:
        right = rule.right(test)
        share, n = float(right.mean()), len(right)
        equal = quantities.get(rule.words, ())
        p = float(binom.sf(right.sum() - 1, n, max(chance, 1.0 / n))) if rule.uses else 1.0
        return Cue(
            rule.words, share, *wilson(share, n), min(1.0, p * max(tried, 1)), equal, _shares(rule, name, fit, axes)
        )

    def better(rules: Iterable[Rule], most: int) -> list[tuple[Rule, Cue]]:
        ranked = sorted(rules, key=lambda rule: -rule.fitted)[:most]
        return [(rule, cue) for rule in ranked if (cue := judged(rule)).p < LEVEL]

    meant = better((rule for rule in single if any(intended[use] for use in rule.uses)), 1)
    unmeant = better((rule for rule in single if not any(intended[use] for use in rule.uses)), MAX_CUES)
    unmeant += better(pairs, 1)
    unmeant += better([search.together(fair)], 1) if several and fair else []
    every = {cue.rule: rule for rule, cue in unmeant} | {fixed.words: fixed}
    result = DecisionAudit(
        name, len(test), tried, judged(fixed), meant[0][1] if meant else None, [cue for _, cue in unmeant], {}, ()
    )
    if not (wider and result.revealed):
        return result
    breaking, protected = wider.breaking(every[result.best.rule], name, fit)
    return replace(result, widen=breaking, protected=protected)


def _shares(rule: Rule, name: str, training: Sample, others: Mapping[str, Sample]) -> dict[str, float]:
    """Shares of right answers in other samples, in those scenarios whose answer training has."""
    found, known = {}, answers(training, name)
    for other, sample in others.items():
        rows = sample.with_decision(name)
        if isinstance(known, Choices):
            kept = [k for k, row in enumerate(rows.decisions) if getattr(row[name], "value", None) in known.labels]
            rows = rows.part(kept)
        if len(rows) >= MIN_JUDGED:
            found[other] = float(rule.right(rows).mean())
    return found


class _Dependence:
    """Which visible quantities depend on which parameters."""

    def __init__(self, task: Task, sample: Sample) -> None:
        self.task, self.sample = task, sample
        self.found: dict[str, set[str]] = {}

    def on(self, by: Sequence[str]) -> dict[str, bool]:
        """Whether each quantity is one of these sources or depends on one: patterns of quantities, parameters, groups.

        Raises:
            ScengenError: one of them does not exist, or states an answer.
        """
        every, changed = self.sample.names(), set[str]()
        for source in by:
            matching = [name for name in every if fnmatchcase(name, source)]
            changed.update(matching)
            for parameter in [] if matching else named(source, self.task.known):
                if parameter not in self.found:
                    self.found[parameter] = self._changed(parameter)
                changed |= self.found[parameter]
        return {name: name in changed for name in every}

    def _changed(self, parameter: str) -> set[str]:
        """Quantities that change if a scenario gets another one's value of a parameter."""
        column = [values(scenario)[parameter] for scenario in self.sample.scenarios]
        changed, tried = set(), 0
        for k in range(len(column) // 2):
            other = next((value for value in column[2 * k + 1 :] if value != column[2 * k]), None)
            if other is None or tried == SWAPS:
                break
            try:
                after, _ = visible(with_values(self.sample.scenarios[2 * k], {parameter: other}))
            except Exception:  # a combination that cannot be built shows nothing
                continue
            before = self.sample.quantities[2 * k]
            changed |= {name for name, value in before.items() if abs(after.get(name, np.inf) - value) > 1e-9}
            tried += 1
        return changed


def named(by: str, known: Mapping[str, Parameter]) -> list[str]:
    """The parameters that a name stands for: itself, or all of a group.

    Raises:
        UnknownName: there is none.
        BadConfig: one of them states an answer.
    """
    found = [name for name in known if name == by or name.startswith(f"{by}.")]
    if not found:
        raise UnknownName("parameter that a decision follows from", by, known)
    if stated := [name for name in found if known[name].answer]:
        raise BadConfig(f"{stated[0]} states an answer; name the parameters from which the answer follows")
    return found


class _Wider:
    """Scenarios of training in which one parameter leaves its training range for anywhere within its bounds."""

    def __init__(self, task: Task, sample: Sample) -> None:
        self.task, self.sample = task, sample
        self.made: dict[str, tuple[dict[int, Sample], dict[int, Sample]]] = {}

    def breaking(self, rule: Rule, name: str, training: Sample) -> tuple[dict[str, float], list[str]]:
        """Parameters that break a rule, with its shares, and those that do so only against the constraints.

        Only scenarios in which the rule is right before the change count.
        """
        held = [k for k in range(min(len(self.sample), 3 * WIDENED)) if name in self.sample.decisions[k]]
        held = [k for k, right in zip(held, rule.right(self.sample.part(held)), strict=True) if right]
        free: dict[str, float] = {}
        refused: list[str] = []
        for parameter, known in self.task.known.items():
            if known.answer or known.low == known.high:
                continue
            feasible, others = (joined([made[k] for k in held if k in made]) for made in self._samples(known))
            shares = _shares(rule, name, training, {"feasible": feasible, "refused": others})
            if shares.get("feasible", 1.0) < REVEALED:
                free[parameter] = shares["feasible"]
            elif shares.get("refused", 1.0) < REVEALED:
                refused.append(parameter)
        return dict(sorted(free.items(), key=lambda item: item[1])), refused

    def _samples(self, parameter: Parameter) -> tuple[dict[int, Sample], dict[int, Sample]]:
        """Feasible scenarios with other values of a parameter, and those that the constraints refuse, by place."""
        if parameter.name not in self.made:
            free: dict[int, Sample] = {}
            refused: dict[int, Sample] = {}
            for place, scenario in enumerate(self._others(parameter)):
                kept = refused if scenario.infeasible() else free
                if len(kept) < WIDENED and (one := _built(scenario)):
                    kept[place] = one
            self.made[parameter.name] = free, refused
        return self.made[parameter.name]

    def _others(self, parameter: Parameter) -> Iterator[Scenario]:
        """Training scenarios with another value of a parameter, between the present one and one of the bounds."""
        for k, scenario in enumerate(self.sample.scenarios[: 3 * WIDENED]):
            way, high = (unit(self.task.name, "cues", parameter.name, k, what) for what in ("way", "end"))
            here, end = values(scenario)[parameter.name], parameter.high if high < 0.5 else parameter.low
            value = here + way * (end - here)
            yield with_values(scenario, {parameter.name: round(value) if parameter.integer else value})


def _built(scenario: Scenario) -> Sample | None:
    """The sample of one scenario; None if it cannot be built. The bounds of a parameter alone do not promise that."""
    try:
        return Sample.of([scenario])
    except Exception:  # families promise nothing for scenarios that their constraints refuse
        return None
