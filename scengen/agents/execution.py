"""Plans of stage 2, carried out: each sub-goal is played by its own move of the family, in the certified scene."""

import hashlib
import inspect
import json
from collections.abc import Generator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import Any

from ..errors import GaveUp
from ..pool import PoolRow
from ..scenario import Action, Plan, Planner, Scenario
from ..sim.world import World
from ..skills.motion import alone, hold
from ..validate.identity import source_sha256
from ..validate.playable import stored_world
from ..validate.rollout import run
from ..work.log import Log
from .order import Order

EXECUTIONS = "executions.jsonl"
"""Name of the file with the outcomes of plans that were carried out."""
LOOK_SECONDS = 0.1
"""Duration of a look: a sub-goal that only senses and has no move [s]."""
DONE = "done"
"""End of a step whose move was carried out."""


NOT_BEGUN = "not started"
"""End of a step that the plan did not come to."""
NO_PLAN = "there is no plan"
"""Reason of a reply without a step."""
CUT_OFF = "the episode was over before its end"
"""End of a step during which the episode ended."""


@dataclass(frozen=True)
class Execution:
    """Outcome of a plan that was carried out."""

    success: bool
    """Whether the goal was reached."""
    reason: str
    """Reason why it was not reached; empty for a success."""
    seconds: float
    """Duration of the episode [s]."""
    steps: list[list[str]]
    """Name and end of each step of the plan: one of `DONE`, `NOT_BEGUN`, `CUT_OFF`, or why it was not carried out."""


class Steps:
    """The steps of a plan, joined into one plan of the robot, and how each ended."""

    def __init__(self, names: Sequence[str], order: Order, moves: Mapping[str, Planner]):
        """
        Args:
            names: sub-goals in the order of the plan.
            order: sub-goals of the task.
            moves: moves of the sub-goals, see `Scenario.steps`.
        """
        self.names, self.order, self.moves = names, order, moves
        self.ends = [NOT_BEGUN] * len(names)
        """End of each step."""
        self._given = set[str]()
        """Conditions that the steps so far have given."""

    def plan(self, world: World) -> Plan:
        """Play the steps one after the other. Neighbours that may be repeated are repeated together until a round of
        them has nothing left to do.

        Raises:
            GaveUp: a step cannot be carried out; the steps after it are not played.
        """
        for repeats, group in groupby(range(len(self.names)), key=lambda k: self._repeats(self.names[k])):
            numbers, busy = list(group), True
            while busy:
                busy = False
                for number in numbers:
                    busy |= yield from self._step(world, number)
                busy &= repeats

    def _repeats(self, name: str) -> bool:
        return name in self.order.subgoals and self.order.subgoals[name].repeats

    def _senses(self, name: str) -> bool:
        return name in self.order.subgoals and self.order.subgoals[name].senses

    def _step(self, world: World, number: int) -> Generator[Action, None, bool]:
        """Play a step; returns whether it did anything but look."""
        name, busy = self.names[number], False
        self.ends[number] = CUT_OFF
        try:
            for action in self._move(name)(world):
                busy = not self._senses(name)
                yield action
        except GaveUp as error:
            self.ends[number] = str(error)
            raise GaveUp(f"{name}: {error}") from None
        self.ends[number] = DONE
        if name in self.order.subgoals:
            self._given.update(self.order.subgoals[name].gives)
        return busy

    def _move(self, name: str) -> Planner:
        """The move of a step.

        Raises:
            GaveUp: there is none, or it needs to know what no step before it has looked at.
        """
        subgoal = self.order.subgoals.get(name)
        unseen = (
            [] if subgoal is None else [c for c in subgoal.needs if c in self.order.sensed and c not in self._given]
        )
        if unseen:
            raise GaveUp(f"no step before it has looked: {unseen[0]}")
        if name in self.moves:
            return self.moves[name]
        if self._senses(name):
            return lambda world: alone(world.arms[0], hold(world.arms[0], LOOK_SECONDS))
        raise GaveUp("there is no move for it")


def execute(names: Sequence[str], order: Order, scenario: Scenario, world: World, horizon: float) -> Execution | None:
    """Carry out a plan under the rules of a certificate; then the robot is idle until everything rests.

    Args:
        names: sub-goals in the order of the plan.
        order: sub-goals of the task.
        scenario: the scenario.
        world: its world.
        horizon: time limit for reaching the goal [s].

    Returns:
        The outcome; None if the family states no moves.
    """
    if not (moves := scenario.steps()):
        return None
    steps = Steps(names, order, moves)
    found = run(scenario, world, steps.plan, horizon, until_settled=True)
    ends = [[name, end] for name, end in zip(names, steps.ends, strict=True)]
    return Execution(found.solved, found.reason, found.seconds, ends)


class Executions:
    """Outcomes of plans, each carried out once: the same plan of the same scenario under the same code ends alike."""

    def __init__(self, log: Log):
        """
        Args:
            log: the open file of outcomes.
        """
        self.log = log
        self._known = {record["digest"]: record["executed"] for record in log.records}

    def of(self, row: PoolRow, scenario: Scenario, names: Sequence[str], order: Order) -> dict[str, Any] | None:
        """Outcome of a plan as plain data, see `Execution`; None if the family states no moves."""
        family = type(scenario)
        if not names and scenario.steps():
            return asdict(Execution(False, NO_PLAN, 0.0, []))
        code = [source_sha256(family), inspect.getsource(inspect.getmodule(family) or family)]
        asked = [row.task, row.id, row.horizon, list(names), repr(order.subgoals), *code]
        digest = hashlib.sha256(json.dumps(asked).encode()).hexdigest()[:32]
        if digest not in self._known:
            found = execute(names, order, scenario, stored_world(row), row.horizon)
            self._known[digest] = asdict(found) if found else None
            self.log.add({"digest": digest, "scenario": row.id, "plan": list(names), "executed": self._known[digest]})
        return self._known[digest]
