"""Combination of the answers of a goal and its failure by an episode, for any task."""

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from itertools import product
from types import SimpleNamespace
from typing import Any, cast

import mujoco
import numpy as np

from ..control.loop import Loop
from ..episode import RULES, Episode, Rules
from ..means import Mean, throughout
from ..scenario import Scenario
from ..sim.world import MAX_MEANS, World

Answer = tuple[bool, str | None, bool]
"""Whether the goal holds, the reason of a failure or None, and whether the means are kept, in a control period."""

ANSWERS: tuple[Answer, ...] = (
    *((goal, None, kept) for goal in (False, True) for kept in (False, True)),
    *((goal, "lost", True) for goal in (False, True)),
)
"""Answers of which episodes are made."""
PERIODS = 5
"""Number of control periods of an episode; the time limit is one less."""


class Scripted(Scenario):
    """A scenario that gives one answer after the other."""

    HOLD = 2 * Loop.PERIOD

    def __init__(self) -> None:
        self.now: Answer = ANSWERS[1]

    def build(self) -> mujoco.MjSpec:
        """Never called: there is no scene."""
        raise NotImplementedError

    def success(self, world: World) -> bool:
        return self.now[0]

    def failure(self, world: World) -> str | None:
        return self.now[1]

    def means(self) -> Mapping[str, Mean]:
        return {"kept": throughout(lambda world: self.now[2])}


@cache
def episodes_sha256() -> str:
    """Hash of the outcomes of all episodes of `PERIODS` answers, under all rules."""
    parts = [_outcome(answers, rules) for rules in RULES for answers in product(ANSWERS, repeat=PERIODS)]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:12]


def _outcome(answers: tuple[Answer, ...], rules: Rules) -> list[Any]:
    """Outcome and reason after each period, and after the time for which a reached goal has to last."""
    scenario, clock = Scripted(), SimpleNamespace(time=0.0, shown=np.zeros(MAX_MEANS))
    episode = Episode(scenario, cast(World, clock), (PERIODS - 1) * Loop.PERIOD, rules)
    found: list[Any] = []
    for scenario.now in answers:
        clock.time += Loop.PERIOD
        found.append([episode.judge(), episode.reason])
    return [*found, *([episode.settled()] if episode.outcome else [])]
