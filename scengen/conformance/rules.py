"""Rules that every task must satisfy, as checks that a package runs on its own tasks.

If the task files of a package are in `conf/task`, three lines in its tests are enough:

    @pytest.mark.parametrize("check", conformance.checks("push_block", conf="path/to/conf"), ids=str)
    def test_push_block_keeps_to_the_rules(check):
        check()

`frame_checks` and `axis_checks` return further checks. `pytest --scengen-task=push_block --scengen-axis=far` runs all
of them without a test file (`pytest_plugin`).
"""

import json
import re
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache, partial
from pathlib import Path

from .. import compose
from ..errors import Infeasible, NoOracle, ScengenError
from ..ood import axis_card, axis_evidence, features
from ..ood.baseline import BELIEF
from ..params import canonical, values, with_values
from ..samplers import task_files
from ..samplers.split import ID
from ..samplers.task import Task
from ..scenario import Scenario
from ..sim import scene_text
from ..validate.certify import NOT_TRIED, certify
from ..validate.rebuilt import rebuild, world_of
from ..validate.rollout import run
from ..validate.settings import QUICK
from . import frames

MIN_SHORTCUTS = 2
"""Smallest number of shortcuts per scenario that are carried out to their end: one that gives up shows nothing."""
MIN_ORACLE_SUCCESS = 0.95
"""Smallest share of the fresh draws of a split that the oracle solves without jitter."""
DRAWS = 10
"""Number of draws of each split that are compared in two orders."""
TWINS = 12
"""Number of twins of each axis in which the moved parameters are looked for."""
NEARLY = 0.75
"""Least similarity of two names of which one may be a misspelt other (difflib): `meens` and `means` have 0.8."""
SNAKE_CASE = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
"""Names of shortcuts, ablations and features, which users write on command lines and in lists with commas."""


class Nonconformity(ScengenError):
    """A task breaks a rule."""


@dataclass(frozen=True)
class Rule:
    """One rule for one split. Calling it raises `Nonconformity` if the task breaks the rule."""

    name: str
    run: Callable[[], None]

    def __call__(self) -> None:
        self.run()

    def __str__(self) -> str:
        return self.name


def checks(
    task: str,
    conf: str | Path | None = None,
    scenarios: int = 2,
    seed: int = 0,
    certified: Collection[str] | None = None,
) -> list[Rule]:
    """All checks of a task: for every split its draws, its names, and certificates of the first scenarios.

    Args:
        task: name of the task's file.
        conf: folder of the package that holds `task/<task>.yaml`. Default: scengen's own.
        scenarios: number of scenarios of each split that are built and certified, which takes about 3 CPU seconds each.
        seed: seed of the draws.
        certified: splits whose scenarios are certified. Default: all splits.

    Raises:
        ScengenError: the file cannot be loaded: names, types, bounds, or an axis that does not leave training.
    """
    found = compose.load_task(task, search(conf))
    splits = (ID, *found.axes)
    in_every_split = (_draws_are_keyed, _twins_differ_in_the_axis_alone)
    wanted = [
        *((split, check) for split in splits for check in in_every_split),
        *((split, _scenes_have_controls) for split in splits),
        *((split, _scenarios_are_certified) for split in splits if certified is None or split in certified),
    ]
    of_splits = [
        Rule(f"{split}: {_readable_name(check)}", partial(check, found, split, scenarios, seed))
        for split, check in wanted
    ]
    return [*_written(found, search(conf)), *of_splits]


def _written(task: Task, search: Sequence[str]) -> list[Rule]:
    """The checks of a task's files alone."""
    return [
        Rule("the file states what policies may know", partial(_describes_axes, task)),
        Rule("the family states its version", partial(_states_version, task, search)),
        Rule("the family has an oracle", partial(_has_an_oracle, task)),
        Rule("the family spells its methods", partial(_spells_its_methods, task)),
    ]


def at_sight(task: str, overrides: Sequence[str] = ()) -> list[str]:
    """What `checks` refuses about a task before anything is simulated, from its first training scenario.

    Args:
        overrides: folders of other packages, and changes of the task.
    """
    found, said = compose.load_task(task, overrides), list[str]()
    written = _written(found, task_files.search_path(overrides))
    for rule in (*written, partial(_scenes_have_controls, found, ID, 1, 0)):
        try:
            rule()
        except Nonconformity as error:
            said.append(str(error))
        except Infeasible:
            continue  # the draws' own error says more
    return said


def _readable_name(check: Callable[..., None]) -> str:
    """Name of a check: that of its function as text."""
    return check.__name__.strip("_").replace("_", " ")


def frame_checks(task: str, conf: str | Path | None = None, seed: int = 0) -> list[Rule]:
    """Checks that the verdict of the first training scenario does not depend on its place, see `frames`.

    They take a few CPU seconds.

    Returns:
        One check for each parameter that moves or turns the whole scene; none if the family has no such parameter.

    Raises:
        ScengenError: the file cannot be loaded.
    """
    found = compose.load_task(task, search(conf))
    scenario = found.draw(ID, seed, 0).scenario
    return [
        Rule(f"judged alike for all values of {other.parameter}", partial(_judged_alike, found, scenario, other))
        for other in frames.moved(scenario, f"{task}/{seed}")
    ]


def axis_checks(
    task: str,
    axis: str,
    conf: str | Path | None = None,
    n: int = 30,
    seed: int = 0,
    to: str | Path | None = None,
    workers: int = 1,
) -> list[Rule]:
    """Checks from the card of an axis that it breaks what was right in training; some CPU seconds for each twin.

    Args:
        axis: name of the axis in the task's file.
        n: number of twins. A fifth of them are tried with each of 16 memories.
        to: folder of the card, which a second call continues. Default: generated/axes/<task>-<axis>.

    Raises:
        ScengenError: the file cannot be loaded, it has no such axis, or n is less than 2.
    """
    found = compose.load_task(task, search(conf))
    settings = axis_card.AxisSettings(axis, n, any_n=n // 5, certify_n=0, seed=seed, rounds=0, workers=workers)
    settings.check(found)
    folder = Path(to or f"generated/axes/{task}-{axis}")

    @cache
    def made() -> axis_card.AxisCard:
        return axis_evidence.make_axis_card(found, QUICK, settings, folder, lambda *_: None)[0]

    return [
        Rule(f"{axis}: the oracle solves it", lambda: _solvable(made())),
        Rule(f"{axis}: what was right in training does not", lambda: _breaks(made())),
    ]


def search(conf: str | Path | None) -> tuple[str, ...]:
    """The override that adds the folder of another package to Hydra's search path."""
    return () if conf is None else (f"hydra.searchpath=[file://{Path(conf).resolve()}]",)


def _describes_axes(task: Task) -> None:
    """The instruction names no axis, and every axis has a `why`."""
    for name, axis in task.axes.items():
        _require(name not in task.instruction, f"the instruction of {task.name} names the axis {name}; leave it out")
        _require(bool(axis.why), f"axis {name} of {task.name} has no why; say why a habit from training fails there")


def _states_version(task: Task, search: Sequence[str]) -> None:
    """The version stands in the family's class as a plain number, so that environments are registered with it."""
    read, where = task_files.version(task.name, search), f"{task.family.__name__} of {task.name}"
    stated = "VERSION" in vars(task.family) and read == task.version
    _require(stated, f"{where} has version {task.version}; state it in the class: VERSION = {task.version}")


def _has_an_oracle(task: Task) -> None:
    """The family has a scripted solution, without which nothing is certified."""
    _require(task.family.oracle is not Scenario.oracle, str(NoOracle(task.family.__name__)))


def _spells_its_methods(task: Task) -> None:
    """No method of the family nearly has the name of one that scengen calls, and that the family does not define."""
    own = {name for kind in task.family.__mro__ if kind not in Scenario.__mro__ for name in vars(kind)}
    called = [name for name, what in vars(Scenario).items() if callable(what) and name[0] != "_" and name not in own]
    for name in sorted(own - {*vars(Scenario)}):
        meant = get_close_matches(name, [each for each in called if each[0] == name[0]], 1, NEARLY)
        _require(not meant, f"{task.family.__name__} has {name}, and scengen calls {''.join(meant)}; rename it")


def _draws_are_keyed(task: Task, split: str, scenarios: int, seed: int) -> None:
    """A scenario depends on seed and index only, and its parameters can be written and read."""
    forward = [task.draw(split, seed, i).scenario for i in range(DRAWS)]
    backward = [task.draw(split, seed, i).scenario for i in reversed(range(DRAWS))]
    for i, (one, other) in enumerate(zip(forward, reversed(backward), strict=True)):
        where = f"{task.name}/{split}/{i}"
        _require(one.id == other.id, f"{where} depends on the order of draws; it must depend on seed and index only")
        again = with_values(task.family(), json.loads(canonical(one)))
        _require(again == one, f"{where} differs when it is made of its parameters; make every field a parameter")
    varied = len({scenario.id for scenario in forward}) > 1
    _require(varied, f"{task.name}/{split}: {DRAWS} draws gave the same scenario; vary a parameter")


def _twins_differ_in_the_axis_alone(task: Task, split: str, scenarios: int, seed: int) -> None:
    """Scenario i of an axis differs from scenario i of training in exactly the parameters that the axis names."""
    if split == ID:
        return
    seen, where = features.sampled(task, split, TWINS, seed), f"{task.name}/{split}"
    strays, stuck = ", ".join(seen.strays), ", ".join(seen.stuck)
    _require(not strays, f"{where}: {strays} differ between twins, though the axis does not name them")
    _require(not stuck, f"{where}: the axis names {stuck}, but twins do not differ in them")


def _scenes_have_controls(task: Task, split: str, scenarios: int, seed: int) -> None:
    """Shortcuts show that the bottleneck is real, ablations that the means are needed; all names are in snake_case.

    A family without ablations gives the reason in `NO_ABLATIONS`.
    """
    for i in range(scenarios):
        scenario, where = task.draw(split, seed, i).scenario, f"{task.name}/{split}/{i}"
        shortcuts, ablations = scenario.shortcuts(), scenario.ablations()
        few = f"{where} has {len(shortcuts)} shortcuts; at least {MIN_SHORTCUTS} must show that its bottleneck is real"
        _require(len(shortcuts) >= MIN_SHORTCUTS, few)
        missing = f"{where} has no ablations, which show that the intended means are needed; add one, or say why not"
        _require(bool(ablations or scenario.NO_ABLATIONS), f"{missing} in NO_ABLATIONS")
        named = {"shortcut": shortcuts, "ablation": ablations, "feature": scenario.features()}
        for kind, names in {**named, "decision": scenario.decisions()}.items():
            for name in names:
                valid = SNAKE_CASE.fullmatch(name) is not None
                _require(valid, f"{where}: the {kind} {name!r} must have a name in snake_case, such as push_the_slab")
        both = ", ".join(sorted(scenario.features().keys() & values(scenario).keys()))
        _require(not both, f"{where}: {both} name both parameters and features; rename the features")
        whole = rebuild(scenario)
        for name, scene in ablations.items():
            changed = scene_text.emit(scene)[0] != whole
            _require(
                changed, f"{where}: the ablation {name!r} does not change the scene; remove what it is named after"
            )


def _scenarios_are_certified(task: Task, split: str, scenarios: int, seed: int) -> None:
    """The first scenarios pass every check, with shortcuts that were carried out to their end."""
    for i in range(scenarios):
        scenario = task.draw(split, seed, i).scenario
        certificate = certify(scenario, task.horizon, QUICK, task.embodiment).certificate
        where = f"{task.name}/{split}/{i} (seed {seed}, {canonical(scenario)})"
        _require(certificate.verdict == "certified", f"{where} is {certificate.verdict}: {certificate.reason}")
        ends = certificate["shortcuts"].numbers
        tried = [name for name, of_plan in ends.items() if any(e["outcome"] != NOT_TRIED for e in of_plan.values())]
        gave_up = [f"{name}: {of_plan['filtered']['reason']}" for name, of_plan in ends.items() if name not in tried]
        few = f"{where}: only {len(tried)} of its shortcuts were carried out to their end; {'; '.join(gave_up)}"
        _require(len(tried) >= MIN_SHORTCUTS, few)


def _judged_alike(task: Task, scenario: Scenario, other: frames.MovedScene) -> None:
    """The verdict of a family on every moment of a solution does not depend on the place of the scene."""
    world = world_of(scenario, task.embodiment)
    solution = run(scenario, world, scenario.oracle, task.horizon)
    _require(solution.solved, f"{task.name}/id/0: the oracle fails: {solution.reason}")
    difference = frames.difference(scenario, other, solution.actions, task.embodiment)
    _require(not difference, f"{task.name}/id/0 moved by {other.parameter}: {difference}")


def _solvable(card: axis_card.AxisCard) -> None:
    """The oracle solves nearly all twins."""
    solved, least = card.oracle.value if card.oracle else 0.0, MIN_ORACLE_SUCCESS
    _require(
        solved >= least, f"{card.task}/{card.axis}: the oracle solves {solved:.0%} of the twins, less than {least:.0%}"
    )


def _breaks(card: axis_card.AxisCard) -> None:
    """Something that works in training fails; if no memory works there, a feature of the physics leaves training."""
    weak = all(found.finding in ("too weak", "not tried") for found in card.baselines if found.name not in BELIEF)
    leaves = weak and any(departure.leaves for departure in card.features)
    findings = ", ".join(f"{found.name} {found.finding}" for found in card.baselines)
    solved = card.verdict.startswith("solved")
    remedy = "say in its why what it demands of vision" if solved else "try more twins"
    broken = card.verdict.startswith("breaks") or leaves
    _require(broken, f"{card.task}/{card.axis}: {card.verdict} ({findings}); {remedy}")


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise Nonconformity(message)
