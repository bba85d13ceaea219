"""Facts of a scenario and the order of its solution: the answers against which code grades what a model says.

Questions, options and sub-goals of a task are words in `conf/facts/<task>.yaml`. Answers come from the parameters
(`Scenario.facts`), and for the question why the simplest plan fails from the certificate.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import yaml

from ..certificate import Check
from ..errors import BadConfig, UnknownName, cut
from ..geometry import DIRECTIONS
from ..params import Value
from ..samplers.task import Task
from ..samplers.task_files import facts_file, tasks
from ..work.typed import typed
from .order import Order, Subgoal

KINDS = ("objects", "contacts", "reachability", "infeasibility", "hidden state", "causal precondition")
"""Kinds of facts: the paper's probes of stage 1 (section 4.1)."""
SIMPLEST_PLAN = "simplest_plan"
"""Id of the question why the simplest plan fails."""
NOTHING = "nothing: this plan reaches the goal"
"""Option that every question why the simplest plan fails has."""
Answer = float | tuple[str, ...]
"""Answer to a question: a number, or options."""


@dataclass(frozen=True)
class Question:
    """One question of a task, the same in all its scenarios. An entry under `facts` in `conf/facts/<task>.yaml`."""

    ask: str = ""
    """The question; for the simplest plan the plan in the infinitive."""
    kind: str = ""
    """Kind of the fact, one of `KINDS`."""
    options: str | list[str] = field(default_factory=list)
    """Options to choose from, or `directions` for those of `geometry.DIRECTIONS`; none if the answer is a number."""
    many: bool = False
    """Whether several options may be right, all of which must be named."""
    right: str | list[str] = field(default_factory=list)
    """Right options, if they are the same in all scenarios; else the family answers."""
    unit: str = ""
    """Unit of a number; `1` for a share or a count."""
    within: float = 0.0
    """Largest error of a number that counts as right."""
    shortcut: str = ""
    """Shortcut whose recorded failure is the answer to `simplest_plan`."""
    stuck: str = ""
    """Answer to `simplest_plan` if the shortcut breaks no rule, but does not get there: then the certificate says no
    more than that everything came to rest, or that a move gave up."""

    @property
    def rights(self) -> tuple[str, ...]:
        """`right` as a tuple."""
        return _listed(self.right)


@dataclass(frozen=True)
class Fact:
    """A question about one scenario, with its answer."""

    id: str
    """Name of the question in snake_case."""
    kind: str
    """Kind of the fact, one of `KINDS`."""
    question: str
    """The question."""
    options: tuple[str, ...]
    """Options to choose from; none for a number."""
    right: Answer | None
    """Right answer; None for hidden state, which pictures do not show: then no claim is right."""
    many: bool = False
    """Whether several options may be right, all of which must be named."""
    unit: str = ""
    """Unit of a number."""
    within: float = 0.0
    """Largest error of a number that counts as right."""

    @property
    def hidden(self) -> bool:
        """Whether pictures do not show the answer."""
        return self.right is None

    @property
    def form(self) -> str:
        """Form of the answer, as text for a prompt."""
        if not self.options and not self.within:
            return "a whole number"
        if not self.options:
            unit = "" if self.unit == "1" else f" [{self.unit}]"
            return f"a number{unit}, which counts as right within {self.within:g}"
        return "all options that hold" if self.many else "one option"

    def holds(self, claim: object) -> bool:
        """Whether a claim is right: the number within its error, or exactly the right options."""
        if self.right is None:
            return False
        if isinstance(self.right, tuple):
            return isinstance(claim, list) and set(claim) == set(self.right) and len(claim) == len(self.right)
        number = isinstance(claim, (int, float)) and not isinstance(claim, bool)
        return number and abs(float(claim) - self.right) <= self.within * (1 + 1e-9)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Sheet:
    """Contents of `conf/facts/<task>.yaml`: words for the things, questions and sub-goals of one task."""

    names: Mapping[str, str] = field(default_factory=dict)
    """Neutral names of things by body: what a person calls them who only sees the scene. `tile_*` stands for all
    bodies that begin with `tile_` and have no separate line."""
    parts: list[str] = field(default_factory=list)
    """Names of parts of things, such as a handle, that are not bodies."""
    rules: list[str] = field(default_factory=list)
    """Rules that a question asks about and that neither the instruction nor a picture shows, as sentences."""
    facts: Mapping[str, Question] = field(default_factory=dict)
    """Questions by id."""
    order: Mapping[str, Subgoal] = field(default_factory=dict)
    """Sub-goals of the canonical plan by id, in one of the right orders."""
    wrong: Mapping[str, str] = field(default_factory=dict)
    """Sub-goals that tempt and are not possible or not allowed, by id, with their outcomes."""

    @cached_property
    def plan(self) -> Order:
        """The partial order of the sub-goals."""
        return Order(self.order, self.wrong)

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the things and their parts, each once."""
        return tuple(dict.fromkeys((*self.names.values(), *self.parts)))

    def name_of(self, body: str) -> str | None:
        """Neutral name of a body; None if the sheet does not name it, such as a part of a thing."""
        pattern = next((p for p in self.names if p.endswith("*") and body.startswith(p[:-1])), "")
        return self.names.get(body, self.names.get(pattern))

    def check(self, task: Task) -> None:
        """Raise `BadConfig` unless the sheet fits the task: kinds, options, objects, who answers what, and moves."""
        where = f"conf/facts/{task.name}.yaml"
        for id_, question in self.facts.items():
            if question.kind not in KINDS:
                raise UnknownName(f"kind of {where}, facts.{id_}", question.kind, KINDS)
            right = question.rights
            if strange := [option for option in right if option not in _options(question)]:
                known = cut(", ".join(_options(question)))
                raise BadConfig(f"{where}: {id_}.right = {cut(strange[0])}; it must be one of the options: {known}")
        for id_, subgoal in self.order.items():
            if strange := [name for name in subgoal.objects if name not in self.objects]:
                raise UnknownName(f"object of {where}, order.{id_}", strange[0], self.objects)
        answered, asked = set(task.nominal.facts()), {id_ for id_, q in self.facts.items() if _by_family(id_, q)}
        if odd := sorted((answered - {SIMPLEST_PLAN}) ^ asked):
            raise BadConfig(f"{where} and {task.family.__name__}.facts() differ in {', '.join(odd)}; give both")
        moves = task.nominal.steps()
        if strange := [name for name in moves if name not in self.plan.vocabulary]:
            raise UnknownName(f"sub-goal of {task.family.__name__}.steps()", strange[0], self.plan.vocabulary)
        if moves and (still := [name for name in self.plan.moving if name not in moves]):
            raise BadConfig(f"{task.family.__name__}.steps() has no move for {', '.join(still)} of {where}; add it")

    def facts_of(self, task: Task, params: Mapping[str, Value], checks: tuple[Check, ...]) -> tuple[Fact, ...]:
        """The facts of one scenario.

        Args:
            task: task of the sheet.
            params: parameters of the scenario.
            checks: checks of its certificate, which record how the shortcuts failed.

        Raises:
            BadConfig: an answer is none of the options, or the certificate lacks the shortcut.
        """
        told = task.scenario(params).facts()
        shortcuts = next((check.numbers for check in checks if check.name == "shortcuts"), {})
        return tuple(self._fact(id_, question, told, shortcuts) for id_, question in self.facts.items())

    def _fact(self, id_: str, asked: Question, told: Mapping[str, float | str], shortcuts: Mapping[str, Any]) -> Fact:
        options, question = _options(asked), spoken_question(id_, asked)
        right: Answer | None = asked.rights
        if asked.kind == "hidden state":
            right = None
        elif id_ in told:
            value = told[id_]
            right = (value,) if isinstance(value, str) else float(value)
        elif id_ == SIMPLEST_PLAN:
            right = (_recorded(asked, shortcuts),)
        if isinstance(right, tuple) and id_ == SIMPLEST_PLAN:
            options = tuple(dict.fromkeys((*options, *right)))
        if isinstance(right, tuple) and (strange := [option for option in right if option not in options]):
            raise BadConfig(f"the answer {strange[0]!r} to {id_} is none of the options: {', '.join(options)}")
        return Fact(id_, asked.kind, question, tuple(sorted(options)), right, asked.many, asked.unit, asked.within)


def load(task: Task, search: Sequence[str] = ()) -> Sheet:
    """The sheet of a task.

    Args:
        task: the task.
        search: overrides that add folders of other packages, see `task_files.search_path`.

    Raises:
        BadConfig: the task has none, or it does not fit the task.
    """
    path = facts_file(task.name, search)
    if path is None:
        known = ", ".join(name for name in tasks() if facts_file(name))
        raise BadConfig(
            f"task {task.name} states no facts yet; add conf/facts/{task.name}.yaml; tasks that do: {known}"
        )
    try:
        plain = yaml.safe_load(path.read_text())
    except yaml.YAMLError as error:
        raise BadConfig(f"{path} is not YAML: {cut(' '.join(str(error).split()))}; correct it") from None
    sheet = typed("", Sheet, plain)
    sheet.check(task)
    return sheet


def spoken_question(id_: str, question: Question) -> str:
    """A question in full."""
    return f"The simplest plan is to {question.ask}. Why does it fail?" if id_ == SIMPLEST_PLAN else question.ask


def _by_family(id_: str, question: Question) -> bool:
    """Whether the family answers a question: neither the sheet nor a certificate does, and it has an answer."""
    return question.kind != "hidden state" and not question.right and id_ != SIMPLEST_PLAN


def _listed(value: str | list[str]) -> tuple[str, ...]:
    return (value,) if isinstance(value, str) else tuple(value)


def _options(question: Question) -> tuple[str, ...]:
    """Options of a question; those of a simplest plan include what it may be stuck at, and that it works."""
    options = DIRECTIONS if question.options == "directions" else _listed(question.options)
    if not question.shortcut:
        return options
    return tuple(dict.fromkeys((*([question.stuck] if question.stuck else []), *options, NOTHING)))


def _recorded(question: Question, shortcuts: Mapping[str, Any]) -> str:
    """Text by which a certificate reports a failed shortcut, with the filter of the oracles.

    Raises:
        BadConfig: the certificate does not record the shortcut.
    """
    if question.shortcut not in shortcuts:
        raise UnknownName("shortcut in the certificate", question.shortcut, shortcuts)
    outcome = shortcuts[question.shortcut]["filtered"]
    return question.stuck if question.stuck and outcome["outcome"] != "failure" else str(outcome["reason"])
