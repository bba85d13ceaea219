"""pytest plugin: `pytest --scengen-task=push_off --scengen-axis=far` runs scengen's checks of tasks on a task.

Without paths on the command line pytest collects nothing else. `-k certified`, `-x`, `-n 2`, `--junitxml` and all other
options of pytest work on these checks as on any test.
"""

from typing import TYPE_CHECKING, Any

import pytest

from ..errors import ScengenError

if TYPE_CHECKING:
    from .rules import Rule


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options to pytest's command line."""
    group = parser.getgroup("scengen", "scengen: checks of a task")
    group.addoption("--scengen-task", metavar="TASK", help="check this task: draws, names, frames, certificates")
    group.addoption(
        "--scengen-axis", metavar="AXIS", help="check that this axis breaks memories of training, and write its card"
    )
    group.addoption(
        "--scengen-conf", metavar="FOLDER", help="folder with task/TASK.yaml, for a package that is not installed"
    )
    group.addoption("--scengen-n", metavar="N", type=int, default=30, help="number of twins of the axis (default: 30)")


def pytest_configure(config: pytest.Config) -> None:
    """If no paths are given, collect only the checks, not the tests of the current folder."""
    if config.option.scengen_axis and not config.option.scengen_task:
        raise pytest.UsageError("--scengen-axis needs --scengen-task; give the task of the axis")
    if config.option.scengen_task and config.args_source is not config.ArgsSource.ARGS:
        config.args = []


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(session: pytest.Session, items: list[pytest.Item]) -> None:
    """Add the checks, before options such as `-k` choose among them."""
    if task := session.config.option.scengen_task:
        checks = RuleCollector.from_parent(session, name=task, nodeid=f"scengen/{task}")
        items.extend(RuleItem.from_parent(checks, name=rule.name, rule=rule) for rule in _rules(session.config))


def _rules(config: pytest.Config) -> list["Rule"]:
    """All checks of a task, and of one of its axes if one is given."""
    from .. import conformance  # imported only if checks are requested

    option = config.option
    task, axis, conf = option.scengen_task, option.scengen_axis, option.scengen_conf
    try:
        rules = conformance.checks(task, conf) + conformance.frame_checks(task, conf)
        return rules + (conformance.axis_checks(task, axis, conf, option.scengen_n) if axis else [])
    except ScengenError as error:
        raise pytest.UsageError(str(error)) from None


class RuleCollector(pytest.Collector):
    """Collector of the checks of a task."""

    def collect(self) -> list[pytest.Item]:
        return []


class RuleItem(pytest.Item):
    """One check as a test of pytest."""

    def __init__(self, *, rule: "Rule", **others: Any):
        super().__init__(**others)
        self.rule = rule

    def runtest(self) -> None:
        self.rule()

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """The message of an error of scengen, without a traceback."""
        return str(excinfo.value) if isinstance(excinfo.value, ScengenError) else super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Any, int | None, str]:
        return self.path, None, f"{self.parent.name if self.parent else ''}: {self.name}"
