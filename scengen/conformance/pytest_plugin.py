"""pytest plugin: `pytest --scengen-task=push_off --scengen-axis=far` checks a task as scengen checks its own.

Without paths on the command line nothing else is collected. `-k certified`, `-x`, `-n 2`, `--junitxml` and all other
options of pytest work on these checks as on any test.
"""

from typing import TYPE_CHECKING, Any

import pytest

from ..errors import ScengenError

if TYPE_CHECKING:
    from .rules import Rule


def pytest_addoption(parser: pytest.Parser) -> None:
    """What a command line may say."""
    group = parser.getgroup("scengen", "scengen: checks of a task")
    group.addoption("--scengen-task", metavar="TASK", help="check this task: draws, names, frames, certificates")
    group.addoption(
        "--scengen-axis", metavar="AXIS", help="check what this axis of it does to memory, and write its card"
    )
    group.addoption("--scengen-conf", metavar="FOLDER", help="holds task/TASK.yaml, of a package that is not installed")
    group.addoption("--scengen-n", metavar="N", type=int, default=30, help="twins of the axis (default: 30)")


def pytest_configure(config: pytest.Config) -> None:
    """Where no paths are given, collect the checks alone: not the tests of the folder that pytest was called in."""
    if config.option.scengen_axis and not config.option.scengen_task:
        raise pytest.UsageError("--scengen-axis needs --scengen-task, the task that it belongs to")
    if config.option.scengen_task and config.args_source is not config.ArgsSource.ARGS:
        config.args = []


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(session: pytest.Session, items: list[pytest.Item]) -> None:
    """Add the checks, before options such as `-k` choose among them."""
    if task := session.config.option.scengen_task:
        checks = RuleCollector.from_parent(session, name=task, nodeid=f"scengen/{task}")
        items.extend(RuleItem.from_parent(checks, name=rule.name, rule=rule) for rule in _rules(session.config))


def _rules(config: pytest.Config) -> list["Rule"]:
    """All checks of a task, and of one of its axes if that is asked for."""
    from .. import conformance  # here: whoever does not ask for checks pays nothing

    option = config.option
    task, axis, conf = option.scengen_task, option.scengen_axis, option.scengen_conf
    try:
        rules = conformance.checks(task, conf) + conformance.frame_checks(task, conf)
        return rules + (conformance.axis_checks(task, axis, conf, option.scengen_n) if axis else [])
    except ScengenError as error:
        raise pytest.UsageError(str(error)) from None


class RuleCollector(pytest.Collector):
    """What the checks of a task belong to."""

    def collect(self) -> list[pytest.Item]:
        return []


class RuleItem(pytest.Item):
    """One check."""

    def __init__(self, *, rule: "Rule", **others: Any):
        super().__init__(**others)
        self.rule = rule

    def runtest(self) -> None:
        self.rule()

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """What scengen says in its own words, without the way there."""
        return str(excinfo.value) if isinstance(excinfo.value, ScengenError) else super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Any, int | None, str]:
        return self.path, None, f"{self.parent.name if self.parent else ''}: {self.name}"
