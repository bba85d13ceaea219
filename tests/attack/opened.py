"""A task whose scenarios are changed after they are drawn: without a mend, or with what a constraint refutes."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from scengen.samplers.task import Draw, Task
from scengen.scenario import Scenario


class Opened:
    """A task with changed scenarios, and everything else as it is."""

    def __init__(self, task: Task, change: Callable[[Scenario], Scenario]):
        self._task, self._change = task, change

    def __getattr__(self, name: str) -> Any:
        return getattr(self._task, name)

    def draw(self, *where: Any) -> Draw:
        """A draw of the task, its scenario changed."""
        draw = self._task.draw(*where)
        return replace(draw, scenario=self._change(draw.scenario))
