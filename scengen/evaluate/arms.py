"""Arms of an evaluation: the same episodes with an input taken away or exchanged, to measure whether it is used.

* `blind`: all pictures are black.
* `wrong`: the instruction is that of another task.
* `benign`: fresh training scenarios, see `evaluate.benign`. Nothing is taken away.
* `reworded`: the instruction is another wording of the task's own, from `conf/language/<task>.yaml`.

But for `benign`, scenario, physics and random numbers of the policy are those of the clean episode.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from ..errors import UnknownName
from ..perturb.language import TEXTS, Words, worded
from ..pool import PoolRow
from ..samplers.keyed import unit
from ..samplers.task_files import about, tasks

CLEAN = "clean"
"""Name of the arm without an intervention."""
AUTO = "auto"
"""Value of `arms` for those that ask about an input that the policy has."""
BENIGN = "benign"
"""Name of the arm of fresh training scenarios."""
NONE = "none"
"""Value of `arms` for no arm."""
PICTURES = "pictures"
"""Input of a policy: cameras."""
LANGUAGE = "language"
"""Input of a policy: the instruction."""


@dataclass(frozen=True)
class Arm:
    """An intervention."""

    name: str
    needs: str
    """Input of the policy that it changes: `pictures` or `language`; empty if it is none."""
    title: str
    """What the policy gets, for sentences."""
    automatic: bool = True
    """Whether `arms=auto` has it for a policy with this input."""
    instruct: Callable[[PoolRow, Sequence[str]], str] | None = None
    """Gives the instruction for a scenario, given the search path of task files; None for its own."""


def wrong_instruction(row: PoolRow, search: Sequence[str] = ()) -> str:
    """The instruction of another task, which depends on the scenario alone."""
    others = sorted({text for text in _instructions(tuple(search)) if text != row.instruction})
    return others[int(len(others) * unit("wrong instruction", row.id))]


@cache
def _instructions(search: tuple[str, ...]) -> tuple[str, ...]:
    """Instructions of all tasks."""
    return tuple(about(name, search).instruction for name in tasks(search))


def reworded_instruction(row: PoolRow, search: Sequence[str] = ()) -> str:
    """Another wording of the instruction, which depends on the scenario alone.

    Raises:
        BadConfig: the task has none.
    """
    number = 1 + int(TEXTS * unit("reworded instruction", row.id))
    return worded("reworded", number, Words.of(row.task, row.instruction, search))


ARMS: Mapping[str, Arm] = {
    arm.name: arm
    for arm in (
        Arm("blind", PICTURES, "black pictures"),
        Arm("wrong", LANGUAGE, "the instruction of another task", instruct=wrong_instruction),
        Arm(BENIGN, "", "fresh training scenarios", False),
        Arm("reworded", LANGUAGE, "another wording of the instruction", False, reworded_instruction),
    )
}
"""All arms by name."""


def check_arms(names: Iterable[str]) -> None:
    """Raise `UnknownName` for an unknown name."""
    for name in names:
        if name not in ARMS:
            raise UnknownName("arm", name, [*ARMS, AUTO, NONE])


def automatic_arms(lines: Iterable[Mapping[str, Any]]) -> list[str]:
    """Arms of the inputs that a policy has by the lines of its episodes."""
    has = {PICTURES: False, LANGUAGE: False}
    for line in lines:
        has[PICTURES] |= bool(line["pictures"])
        has[LANGUAGE] |= bool(line["instruction_read"])
    return [arm.name for arm in ARMS.values() if arm.automatic and has[arm.needs]]


def instruction(arm: str, row: PoolRow, search: Sequence[str] = ()) -> str | None:
    """The instruction that an arm gives instead of the scenario's own; None for its own."""
    give = ARMS[arm].instruct if arm in ARMS else None
    return None if give is None else give(row, search)


def seen_by(arm: str, observation: dict[str, Any], cameras: Iterable[str]) -> dict[str, Any]:
    """What a policy sees of an observation."""
    if arm == CLEAN or ARMS[arm].needs != PICTURES:
        return observation
    return {**observation, **{camera: np.zeros_like(observation[camera]) for camera in cameras}}
