"""What every task must keep to, as checks that a package runs on its own tasks.

In the tests of a package whose task files lie in `conf/task`, three lines do:

    @pytest.mark.parametrize("check", conformance.checks("push_block", conf="path/to/conf"), ids=str)
    def test_push_block_keeps_to_the_rules(check):
        check()

`frame_checks` and `axis_checks` are more of the same kind. `pytest --scengen-task=push_block --scengen-axis=far` runs
all of them without a file (`pytest_plugin`).
"""

import json
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

from .. import config
from ..errors import ScengenError
from ..ood import axis_card, behaviour, features
from ..params import canonical, values, with_values
from ..samplers.split import ID
from ..samplers.task import Task
from ..scenario import Scenario
from ..sim import scene_text
from ..validate.certify import NOT_TRIED, certify
from ..validate.rebuilt import rebuild, world_of
from ..validate.rollout import run
from ..validate.settings import QUICK
from . import frames

TRIED = 2
"""How many shortcuts of every scenario must be carried out to their end: one that gives up shows nothing."""


SURE = 0.95
"""Share of fresh draws of every split that an oracle has to solve without jitter."""


class Nonconformity(ScengenError):
    """A task breaks a rule."""


SNAKE_CASE = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
"""What names of shortcuts, ablations and features look like: they stand on command lines and in comma lists."""


@dataclass(frozen=True)
class Rule:
    """One rule for one split. Calling it raises `Nonconformity` where the rule is broken."""

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
        conf: folder of the package that holds `task/<task>.yaml`; None for scengen's own.
        scenarios: how many of each split are looked at closely and certified, at some 3 CPU seconds each.
        seed: of the draws.
        certified: splits whose scenarios are certified; None for all.

    Raises:
        ScengenError: the file cannot be loaded: names, types, bounds, or an axis that does not leave training.
    """
    found = config.task(task, search(conf))
    splits = (ID, *found.axes)
    wanted = [
        *((split, rule) for split in splits for rule in (_draws_are_keyed, _twins_differ_in_the_axis_alone)),
        *((split, _scenes_have_controls) for split in splits),
        *((split, _scenarios_are_certified) for split in splits if certified is None or split in certified),
    ]
    told = [Rule("the file tells what policies may know", partial(_told_well, found))]
    return told + [
        Rule(f"{split}: {rule.__name__.strip('_').replace('_', ' ')}", partial(rule, found, split, scenarios, seed))
        for split, rule in wanted
    ]


def frame_checks(task: str, conf: str | Path | None = None, seed: int = 0) -> list[Rule]:
    """Checks that the first training scenario is judged alike wherever it stands, see `frames`: some CPU seconds.

    Returns:
        One check for each parameter that moves or turns the whole scene; none where a family has no such parameter.

    Raises:
        ScengenError: the file cannot be loaded.
    """
    found = config.task(task, search(conf))
    scenario = found.draw(ID, seed, 0).scenario
    return [
        Rule(f"judged alike wherever {other.parameter} puts the scene", partial(_judged_alike, found, scenario, other))
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
    """Checks of what an axis does to memories of training, from its card, at some 5 CPU seconds a twin.

    Args:
        axis: its name in the task's file.
        n: twins; a fifth of them are tried with any of 16 memories.
        to: folder of the card, which a second call continues; generated/axes/<task>-<axis> by default.

    Raises:
        ScengenError: the file cannot be loaded, it has no such axis, or n is less than 2.
    """
    found = config.task(task, search(conf))
    settings = axis_card.AxisSettings(axis, n, any_n=n // 5, certify_n=0, seed=seed, rounds=0, workers=workers)
    settings.check(found)
    folder = Path(to or f"generated/axes/{task}-{axis}")

    @cache
    def made() -> axis_card.AxisCard:
        return axis_card.make_axis_card(found, QUICK, settings, folder, lambda *_: None)[0]

    return [
        Rule(f"{axis}: the oracle solves it", lambda: _solvable(made())),
        Rule(f"{axis}: memory of training does not", lambda: _breaks(made())),
    ]


def search(conf: str | Path | None) -> tuple[str, ...]:
    """The override that makes Hydra look into another package's folder too."""
    return () if conf is None else (f"hydra.searchpath=[file://{Path(conf).resolve()}]",)


def _told_well(task: Task) -> None:
    """The instruction names no axis, and every axis says why."""
    for name, axis in task.axes.items():
        _ask(name not in task.instruction, f"the instruction of {task.name} names the axis {name}")
        _ask(bool(axis.why), f"axis {name} of {task.name} does not say why a habit from training fails there")


def _draws_are_keyed(task: Task, split: str, scenarios: int, seed: int) -> None:
    """A scenario depends on its index alone, and its parameters survive being written down."""
    forward = [task.draw(split, seed, i).scenario for i in range(10)]
    backward = [task.draw(split, seed, i).scenario for i in reversed(range(10))]
    for i, (one, other) in enumerate(zip(forward, reversed(backward), strict=True)):
        _ask(one.id == other.id, f"{task.name}/{split}/{i} is another scenario when drawn in another order")
        again = with_values(task.family(), json.loads(canonical(one)))
        _ask(again == one, f"{task.name}/{split}/{i} does not come back from its parameters; every field must be one")
    _ask(len({s.id for s in forward}) > 1, f"{task.name}/{split}: ten draws gave one scenario; nothing varies")


def _twins_differ_in_the_axis_alone(task: Task, split: str, scenarios: int, seed: int) -> None:
    """Scenario i of an axis is scenario i of training but for what the axis names, all of it."""
    if split == ID:
        return
    seen, where = features.sampled(task, split, 12, seed), f"{task.name}/{split}"
    _ask(not seen.strays, f"{where}: {', '.join(seen.strays)} differ between twins, though the axis does not name them")
    _ask(not seen.stuck, f"{where}: the axis names {', '.join(seen.stuck)}, and twins are equal there")


def _scenes_have_controls(task: Task, split: str, scenarios: int, seed: int) -> None:
    """Shortcuts show that the bottleneck is real, ablations that the means are needed; all have names in snake_case.

    A family without ablations says why in `NO_ABLATIONS`."""
    for i in range(scenarios):
        scenario, where = task.draw(split, seed, i).scenario, f"{task.name}/{split}/{i}"
        shortcuts, ablations = scenario.shortcuts(), scenario.ablations()
        few = f"{where} has {len(shortcuts)} shortcuts: {TRIED} at least must show that its bottleneck is real"
        _ask(len(shortcuts) >= TRIED, few)
        why = f"{where} has no ablations: nothing shows that the intended means are needed; say why in NO_ABLATIONS"
        _ask(bool(ablations or scenario.NO_ABLATIONS), why)
        for kind, names in (("shortcut", shortcuts), ("ablation", ablations), ("feature", scenario.features())):
            for name in names:
                good = SNAKE_CASE.fullmatch(name) is not None
                _ask(good, f"{where}: the {kind} {name!r} has no name in snake_case, such as push_the_slab")
        both = sorted(scenario.features().keys() & values(scenario).keys())
        _ask(not both, f"{where}: {', '.join(both)} name both parameters and features; a table of both needs two names")
        whole = rebuild(scenario)
        for name, scene in ablations.items():
            _ask(scene_text.emit(scene)[0] != whole, f"{where}: the ablation {name!r} takes nothing away")


def _scenarios_are_certified(task: Task, split: str, scenarios: int, seed: int) -> None:
    """The first scenarios pass every check, with shortcuts that were carried out to their end."""
    for i in range(scenarios):
        scenario = task.draw(split, seed, i).scenario
        certificate = certify(scenario, task.horizon, QUICK, task.embodiment).certificate
        where = f"{task.name}/{split}/{i} (seed {seed}, {canonical(scenario)})"
        _ask(certificate.verdict == "certified", f"{where} is {certificate.verdict}: {certificate.reason}")
        ends = certificate["shortcuts"].numbers
        tried = [name for name, told in ends.items() if any(end["outcome"] != NOT_TRIED for end in told.values())]
        gave_up = "; ".join(f"{name}: {told['filtered']['reason']}" for name, told in ends.items() if name not in tried)
        _ask(len(tried) >= TRIED, f"{where}: of its shortcuts only {len(tried)} could be carried out; {gave_up}")


def _judged_alike(task: Task, scenario: Scenario, other: frames.MovedScene) -> None:
    """What a family says of every moment of a solution does not depend on where the scene stands."""
    world = world_of(scenario, task.embodiment)
    solution = run(scenario, world, scenario.oracle, task.horizon)
    _ask(solution.solved, f"{task.name}/id/0: the oracle fails: {solution.reason}")
    differs = frames.differing(scenario, other, solution.actions, task.embodiment)
    _ask(not differs, f"{task.name}/id/0 moved by {other.parameter}: {differs}")


def _solvable(made: axis_card.AxisCard) -> None:
    """The oracle solves nearly all twins."""
    solved = made.oracle.value if made.oracle else 0.0
    _ask(solved >= SURE, f"{made.task}/{made.axis}: the oracle solves {solved:.0%} of the twins, less than {SURE:.0%}")


def _breaks(made: axis_card.AxisCard) -> None:
    """A memory that works in training fails; where none works there, a feature of the physics leaves training."""
    weak = all(baseline.finding in ("too weak", "not tried") for baseline in made.baselines)
    leaves = weak and any(departure.leaves for departure in made.features)
    told = ", ".join(f"{baseline.name} {baseline.finding}" for baseline in made.baselines)
    helps = "more twins may tell" if made.verdict == behaviour.INCONCLUSIVE else "say in its why what it asks of the eye"
    _ask(made.verdict.startswith("breaks") or leaves, f"{made.task}/{made.axis}: {made.verdict} ({told}); {helps}")


def _ask(holds: bool, otherwise: str) -> None:
    if not holds:
        raise Nonconformity(otherwise)
