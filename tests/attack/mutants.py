"""Weakened families: one mean, or one clause of a goal, a failure or the constraints, left out or made wide.

Clauses are found in the source, so that mutants follow the families: every `if` of `failure`, every operand of
`success`. Limits are constants of the modules. Values are scenarios that the constraints refute.
"""

import ast
import inspect
import math
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from typing import Any
from unittest import mock

from scengen import list_tasks, load_task
from scengen.attack.campaign import Subject
from scengen.attack.evidence import Hit
from scengen.means import Mean
from scengen.pool.names import Name
from scengen.samplers.task import Task
from scengen.scenario import Scenario
from scengen.sim import scene_text
from scengen.sim.world import World
from scengen.validate.rollout import replay, run

TASKS = tuple(list_tasks())
BLIND = ("shortcut", "prior_1", "prior_2", "prior_3", "random")
"""Tiers that know nothing of the witness: their hits count where the scenario itself is wrong."""

Change = Callable[[Scenario], Scenario]


@dataclass(frozen=True)
class Mutant:
    """One task, weakened in one place."""

    task: str
    name: str
    patch: Mapping[str, Any] = field(default_factory=dict)
    """Attributes of the family that are replaced."""
    limits: Mapping[str, float] = field(default_factory=dict)
    """Constants of its module that are replaced."""
    change: Change | None = None
    """Makes of a scenario one that the constraints refute."""
    narrow: tuple[str, ...] = ()
    """Overrides of the task: training ranges so narrow that fixed answers are right too often."""

    @property
    def asked(self) -> Task:
        """The task."""
        return load_task(self.task, self.narrow)

    @contextmanager
    def weakened(self) -> Iterator[None]:
        """The family as it is attacked."""
        with patched(self.task, self.patch, self.limits):
            yield

    def kills(self, hit: Hit, scenario: Scenario, scene_xml: str) -> bool:
        """Whether a hit is one because of the weakness: the family as it should be refuses the same actions."""
        if self.change is not None:
            return hit.refutes or hit.tier in BLIND
        task = load_task(self.task)
        with strict(self):
            world = World.load(scene_xml, task.embodiment)
            return not replay(scenario, world, hit.actions, task.horizon, until_settled=True).solved

    def subjects(self, n: int, seed: int = 0) -> list[Subject]:
        """The first scenarios of training, changed as they must be, that the oracle solves."""
        task, found = self.asked, list[Subject]()
        for index in range(4 * n):
            with strict(self):
                scenario = task.draw("id", seed, index).scenario
            scenario = self.change(scenario) if self.change else scenario
            text, _ = scene_text.emit(scenario.build())
            rollout = run(scenario, World.load(text, task.embodiment), scenario.oracle, task.horizon)
            if rollout.solved:
                name = Name(task.name, "id", index, scenario.id)
                found.append(Subject(scenario, text, task.embodiment, task.horizon, rollout.actions, name))
            if len(found) == n:
                break
        return found


@contextmanager
def patched(task: str, patch: Mapping[str, Any], limits: Mapping[str, float]) -> Iterator[None]:
    """A family with attributes and constants replaced."""
    family = load_task(task).family
    with ExitStack() as stack:
        for name, value in patch.items():
            stack.enter_context(mock.patch.object(family, name, value))
        for name, value in limits.items():
            stack.enter_context(mock.patch.object(sys.modules[family.__module__], name, value))
        yield


@contextmanager
def strict(mutant: Mutant) -> Iterator[None]:
    """The family as it should be, also where a mutant is in force."""
    family = load_task(mutant.task).family
    with patched(
        mutant.task, {n: SOUND[family, n] for n in mutant.patch}, {n: SOUND[family, n] for n in mutant.limits}
    ):
        yield


SOUND: dict[tuple[type, str], Any] = {}
"""Attributes of families and constants of their modules as they were when the mutants were made."""


def mutants() -> list[Mutant]:
    """All of them: the first one of each task, then the second ones. Without rules on what is lost anyway come last."""
    kinds = (values, narrow, clauses, limits)
    of_tasks = [sorted((m for kind in kinds for m in kind(task)), key=lambda m: "fallen" in m.name) for task in TASKS]
    found = [mutant for round_ in zip_longest(*of_tasks) for mutant in round_ if mutant]
    for mutant in found:
        family = load_task(mutant.task).family
        module = sys.modules[family.__module__]
        SOUND.update({(family, name): getattr(family, name) for name in mutant.patch})
        SOUND.update({(family, name): getattr(module, name) for name in mutant.limits})
    return found


# --- clauses, from the source ------------------------------------------------------------------


def clauses(task: str) -> Iterator[Mutant]:
    """The family without one of its means, or one clause of its failure or of its goal."""
    family = load_task(task).family
    for name in load_task(task).nominal.means():
        yield Mutant(task, f"no mean: {name}", {"means": _without(family.means, name)})
    if family.failure is not Scenario.failure:
        tree = _parsed(family.failure)
        for statement in list(tree.body):
            if isinstance(statement, ast.If):
                kept, statement.body = statement.body, [ast.Pass()]
                yield Mutant(
                    task, f"no failure: {ast.unparse(statement.test)}", {"failure": _made(family.failure, tree)}
                )
                statement.body = kept
            elif isinstance(statement, ast.Return) and isinstance(one := statement.value, ast.IfExp):
                told, one.body = one.body, ast.Constant(None)
                yield Mutant(task, f"no failure: {ast.unparse(one.test)}", {"failure": _made(family.failure, tree)})
                one.body = told
    tree = _parsed(family.success)
    for node in ast.walk(tree):
        if isinstance(node, ast.BoolOp) and isinstance(node.op, ast.And):
            for gone in list(node.values):
                kept = list(node.values)
                others = [value for value in kept if value is not gone]
                node.values = others if len(others) > 1 else others * 2
                yield Mutant(task, f"no goal: {ast.unparse(gone)}", {"success": _made(family.success, tree)})
                node.values = kept
            break
    if family.HOLD:
        yield Mutant(task, "no hold", {"HOLD": 0.0})


def _without(means: Callable[[Any], Mapping[str, Mean]], gone: str) -> Callable[[Any], Mapping[str, Mean]]:
    return lambda scenario: {name: mean for name, mean in means(scenario).items() if name != gone}


def _parsed(function: Callable[..., Any]) -> ast.FunctionDef:
    module = ast.parse(textwrap.dedent(inspect.getsource(function)))
    (tree,) = module.body
    assert isinstance(tree, ast.FunctionDef)
    tree.body = [s for s in tree.body if not (isinstance(s, ast.Expr) and isinstance(s.value, ast.Constant))]
    return tree


class _ExplicitSuper(ast.NodeTransformer):
    """Gives `super()` its arguments, which it cannot find in a function that is made outside of its class."""

    def __init__(self, family: str):
        self.family = family

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.func, ast.Name) and node.func.id == "super" and not node.args:
            node.args = [ast.Name(self.family, ast.Load()), ast.Name("self", ast.Load())]
        return node


def _made(function: Callable[..., Any], tree: ast.FunctionDef) -> Any:
    tree = _ExplicitSuper(function.__qualname__.split(".")[0]).visit(tree)
    module = ast.fix_missing_locations(ast.Module([tree], []))
    space: dict[str, Any] = {}
    exec(compile(module, f"<mutant of {function.__qualname__}>", "exec"), function.__globals__, space)
    return space[tree.name]


def narrow(task: str) -> Iterator[Mutant]:
    """The ranges that there were when a few fixed answers solved most draws."""
    if overrides := NARROW.get(task):
        yield Mutant(task, "hole: fixed answers", narrow=overrides)


NARROW: Mapping[str, tuple[str, ...]] = {
    "seesaw_balance": (
        "task.id.offset=[uniform,0.12,0.15]",
        "task.id.seesaw.drop=0.06",
        "task.id.seesaw.pivot_offset=[uniform,-0.01,0.01]",
        "task.id.target.mass=[uniform,0.20,0.25]",
        "task.id.weight.mass=[mixture,[uniform,0.13,0.15],[uniform,0.32,0.37]]",
    ),
    "galileo_ramp_drop": (
        "task.id.ramp.level=[uniform,0.42,0.60]",
        "task.id.ramp.angle=[uniform,20.0,28.0]",
        "~task.id.ramp.span",
        "~task.id.ramp.bend",
        "+task.id.ramp.band=0.006",
    ),
}
BARS: Mapping[int, float] = {1: 0.10, 3: 0.20}
"""How many fresh draws one and three fixed answers may solve."""


# --- limits: constants made wide ----------------------------------------------------------------

WIDE: Mapping[str, Mapping[str, float]] = {
    "domino_single": {"SLAB_DISPLACEMENT": 0.004},
    "domino_select": {"SLAB_DISPLACEMENT": 0.004, "CARRY_TOLERANCE": 0.30},
    "ball_cage_escape": {"REST_SPEED": 5.0, "SHAKE_TILT": math.radians(-60.0)},
    "seesaw_balance": {"MAX_TILT": math.radians(10.5), "TARGET_TOLERANCE": 0.40},
    "tool_retrieve": {"MIN_LIFT": -0.001},
    "packing": {"FLAT_TOLERANCE": math.radians(60.0), "FLOOR_TOLERANCE": 0.03},
}


def limits(task: str) -> Iterator[Mutant]:
    """The family with one limit made wide."""
    for name, value in WIDE.get(task, {}).items():
        yield Mutant(task, f"{name} = {value:.3g}", limits={name: value})


# --- values: scenarios that the constraints refute -----------------------------------------------


def values(task: str) -> Iterator[Mutant]:
    """Scenarios that a constraint would refute."""
    for name, change in VALUES.get(task, {}).items():
        yield Mutant(task, name, {"constraints": Scenario.constraints}, change=change)


def _mirror_balances(self: Any) -> Any:
    return replace(self, weight=replace(self.weight, mass=self.weight.mass * abs(self.balance / self.offset)))


def _guess_balances(self: Any) -> Any:
    return replace(self, weight=replace(self.weight, mass=self.weight.mass * abs(self.balance / self.guess)))


VALUES: Mapping[str, Mapping[str, Change]] = {
    "seesaw_balance": {"the mirror image balances": _mirror_balances, "the first guess balances": _guess_balances},
    "tool_retrieve": {"the arm reaches the cube": lambda s: replace(s, distance=0.76)},
    "galileo_ramp_drop": {
        "a ball from the top does not overshoot": lambda s: replace(s, ramp=replace(s.ramp, level=0.93)),
    },
    "ball_cage_escape": {
        "the ball rolls in a level cage": lambda s: replace(s, rolling=0.02),
        "the ball lies over the hole": lambda s: replace(s, ball_x=0.03),
    },
    "packing": {
        "every piece lies within 45 deg of its slot": lambda s: replace(
            s, **{f"spot_{i}": replace(spot, turn=math.copysign(2.0, spot.turn)) for i, spot in enumerate(s.spots)}
        ),
    },
    "domino_single": {},
    "domino_select": {},
}
