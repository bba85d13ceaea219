"""The blindfold: the oracle of a scenario plays with one parameter at training's middle, in the true world.

If it still solves the task, the parameter need not be looked at. A control far from the middle shows whether the oracle
uses the parameter at all. Tolerances of decisions (`scengen.decisions`) are confirmed in this way.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from ...errors import UnknownName
from ...params import Value, with_values
from ...samplers.task import Task
from ...scenario import Scenario
from ..behaviour import solves
from ..belief import solves_with

CONTROL_WIDTHS = 2.0
"""Distance of the control from training's middle [training ranges], within the parameter's bounds."""


@dataclass(frozen=True)
class Blindfold:
    """Result for one parameter."""

    middle: Value
    """Median of the parameter in training."""
    control: Value
    """Value of the control."""
    tried: int
    """Number of scenarios that the oracle solves."""
    solved: int
    """Number of those that it solves with the middle."""
    controls: int
    """Number of those that it solves with the control's value."""


def blindfold(task: Task, parameter: str, scenarios: Sequence[Scenario]) -> Blindfold:
    """Play the oracle of scenarios with a parameter at training's middle, and at the control's value.

    Raises:
        UnknownName: there is no such parameter.
    """
    if parameter not in task.known:
        raise UnknownName(f"parameter of {task.name}", parameter, task.known)
    known, dist = task.known[parameter], task.training[parameter]
    middle, (low, high) = dist.quantile(0.5), (dist.quantile(0.001), dist.quantile(0.999))
    far = min(known.high, middle + CONTROL_WIDTHS * ((high - low) or (known.high - known.low)))
    far = far if far > high else known.low
    control = round(far) if known.integer else far
    true = [scenario for scenario in scenarios if solves(task, scenario)]
    solved, controls = (
        sum(solves_with(task, scenario, with_values(scenario, {parameter: value})) for scenario in true)
        for value in (middle, control)
    )
    return Blindfold(middle, control, len(true), solved, controls)
