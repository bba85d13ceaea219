"""What every task must keep to, as checks that a package runs on its own tasks.

In the tests of a package whose task files lie in `conf/task`, three lines do:

    @pytest.mark.parametrize("check", conformance.checks("push_block", conf="path/to/conf"), ids=str)
    def test_push_block_keeps_to_the_rules(check):
        check()
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from . import config
from .errors import ScengenError
from .ood import features
from .params import canonical, with_values
from .samplers.task import ID, Task
from .validate.certify import certify
from .validate.settings import CertifySettings


class Nonconformity(ScengenError):
    """A task breaks a rule."""


@dataclass(frozen=True)
class Check:
    """One rule for one split. Calling it raises `Nonconformity` where the rule is broken."""

    name: str
    run: Callable[[], None]

    def __call__(self) -> None:
        self.run()

    def __str__(self) -> str:
        return self.name


def checks(task: str, conf: str | Path | None = None, scenarios: int = 2, seed: int = 0) -> list[Check]:
    """All checks of a task: for every split its draws, and certificates of the first scenarios.

    Args:
        task: name of the task's file.
        conf: folder of the package that holds `task/<task>.yaml`; None for scengen's own.
        scenarios: how many of each split are certified, at some 3 CPU seconds each.
        seed: of the draws.

    Raises:
        ScengenError: the file cannot be loaded: names, types, bounds, or an axis that does not leave training.
    """
    found = config.task(task, search(conf))
    rules = [_draws_are_keyed, _twins_differ_in_the_axis_alone, _scenarios_are_certified]
    told = [Check("the file tells what policies may know", partial(_told_well, found))]
    return told + [
        Check(f"{split}: {rule.__name__.strip('_').replace('_', ' ')}", partial(rule, found, split, scenarios, seed))
        for split in (ID, *found.axes)
        for rule in rules
    ]


def search(conf: str | Path | None) -> tuple[str, ...]:
    """The override that makes Hydra look into another package's folder too."""
    return () if conf is None else (f"hydra.searchpath=[file://{Path(conf).resolve()}]",)


def _told_well(task: Task) -> None:
    """The instruction names no axis, every axis says why, and the family has shortcuts."""
    for name, axis in task.axes.items():
        _ask(name not in task.instruction, f"the instruction of {task.name} names the axis {name}")
        _ask(bool(axis.why), f"axis {name} of {task.name} does not say why a habit from training fails there")
    _ask(bool(task.family().shortcuts()), f"{task.name} has no shortcuts: nothing shows that its bottleneck is real")


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
    """Scenario i of an axis is scenario i of training but for what the axis names."""
    if split == ID:
        return
    strays = features.sampled(task, split, 50, seed).strays
    _ask(
        not strays, f"{task.name}/{split}: {', '.join(strays)} differ between twins, though the axis does not name them"
    )


def _scenarios_are_certified(task: Task, split: str, scenarios: int, seed: int) -> None:
    """The first scenarios pass every check, and their witnesses replay in a fresh world."""
    for i in range(scenarios):
        scenario = task.draw(split, seed, i).scenario
        certificate = certify(scenario, task.horizon, CertifySettings(), task.embodiment).certificate
        where = f"{task.name}/{split}/{i} (seed {seed}, {canonical(scenario)})"
        _ask(certificate.verdict == "certified", f"{where} is {certificate.verdict}: {certificate.reason}")


def _ask(holds: bool, otherwise: str) -> None:
    if not holds:
        raise Nonconformity(otherwise)
