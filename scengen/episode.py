"""An episode: one run of a scenario. Only this module decides the order of steps in a control period."""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .control.loop import Loop
from .errors import BadConfig, UnknownName, Unstable, where_written
from .means import Watch
from .scenario import Scenario
from .sim.world import World

Outcome = Literal["success", "failure", "timeout", "unstable"]
"""Result of an episode."""
Rules = Literal["strict", "paper"]
"""Rules of an episode: `strict`, under which a goal must be reached by the means of the task, or those of the paper."""
STRICT: Rules = "strict"
PAPER: Rules = "paper"
RULES: tuple[Rules, ...] = (STRICT, PAPER)
OTHERWISE = "the goal was reached otherwise, it lacks"
"""Beginning of the reason why a reached goal does not count. The missing means follow."""
Actions = NDArray[np.float32]
"""Actions of an episode, shape (n, 7 * arms): one row per control period, exactly as the controller received it."""


def check_rules(name: str) -> Rules:
    """The rules of a name.

    Raises:
        UnknownName: they do not exist.
    """
    if name not in RULES:
        raise UnknownName("rules", str(name), RULES)
    return name


class Episode:
    """A scenario in a world: first the scene's events, then a control period, then the verdict.

    The world must be at its start. A program that steps the physics by other means (robosuite) calls `begin` before
    each control period and `judge` after it.
    """

    def __init__(self, scenario: Scenario, world: World, horizon: float = math.inf, rules: Rules = STRICT):
        """Start an episode in a world at its start.

        Args:
            scenario: the scenario that sets events and goal.
            world: a world of that scenario's scene.
            horizon: time limit for reaching the goal [s].
            rules: rules that end it.
        """
        self.scenario, self.world, self.horizon, self.rules = scenario, world, horizon, rules
        self.outcome: Outcome | None = None
        """Outcome so far; None while it is open. A later failure turns a success into a failure."""
        self.reason = ""
        """Reason why the episode is not a success, or means that a success lacks; empty for a success by the means, and
        while the outcome is open."""
        self.held = 0.0
        """Time for which the goal has held without interruption [s]."""
        self.lacks = ""
        """Means of the task that were lacking when the goal was reached, joined by semicolons; empty if none was, and
        as long as the goal has not been reached."""
        self.means = Watch(scenario.means(), world)
        """What has been shown of the means of the task."""
        self._eventful = type(scenario).events is not Scenario.events

    def step(self, action: NDArray[np.float32]) -> Outcome | None:
        """Simulate one control period (10 ms) under an action that has passed the filter, shape (7 * arms,).

        Returns:
            The outcome so far.
        """
        self.begin()
        try:
            self.world.step_filtered(action)
        except Unstable as error:
            self.outcome, self.reason = "unstable", str(error)
            return self.outcome
        return self.judge()

    def begin(self) -> None:
        """Let the events of the coming control period happen, if the family has any."""
        if self._eventful:
            with self.world.events():
                self.scenario.events(self.world)

    def judge(self) -> Outcome | None:
        """Judge the past control period: failure takes precedence over success, success over the time limit."""
        if self.outcome is None:
            self.means.update()
        if self.outcome in (None, "success") and (lost := self.scenario.failure(self.world)):
            if not isinstance(lost, str):
                where = where_written(type(self.scenario).failure)
                raise BadConfig(f"{where}: it returned {lost!r}; return the reason as text, or None")
            self.reason = f"after the goal was reached: {lost}" if self.outcome else lost
            self.outcome = "failure"
        elif self.outcome is None:
            self.held = self.held + Loop.PERIOD if self.scenario.success(self.world) else 0.0
            if self.held and self.held >= self.scenario.HOLD - 1e-9:
                self._reach()
            elif self.world.time > self.horizon - 1e-9:
                self.outcome, self.reason = "timeout", f"the goal was not reached in {self.horizon:g} s"
        return self.outcome

    def _reach(self) -> None:
        """Judge a goal that has been reached: unless the rules are the paper's, it must be reached by the means."""
        self.lacks = self.means.lacking()
        self.reason = f"{OTHERWISE}: {self.lacks}" if self.lacks else ""
        self.outcome = "failure" if self.lacks and self.rules == STRICT else "success"

    def settled(self) -> tuple[Outcome, str]:
        """The final outcome and its reason, after the time for which a reached goal has to last."""
        assert self.outcome is not None
        if self.outcome == "success" and not self.scenario.success(self.world):
            return "timeout", "the goal was reached but did not last"
        return self.outcome, self.reason
