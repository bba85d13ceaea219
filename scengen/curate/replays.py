"""The strictest check of an episode: its actions, played again, must give the recorded states."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..control.loop import ACTION
from ..envs.object_state import ObjectState
from ..envs.observations import streams_of
from ..episode import Episode
from ..errors import ScengenError
from ..export.recording import CONTROL_ACTIONS
from ..export.streams import ENVIRONMENT
from ..samplers.task import Task
from ..sim.world import World, hands
from ..validate.rebuilt import world_of
from .findings import Finding

MAX_REPLAY_ERROR = 1e-6
"""Largest difference of a stream [its unit]: streams are stored in single precision."""
FIRST = "_pos.x"
"""End of the name of a body's first entry in the environment state."""
STREAMS = ("eef_pos", "eef_quat", "joint_pos", "gripper_qpos")
"""Streams that are compared, without the arm's prefix."""


@dataclass(frozen=True)
class Recorded:
    """What a replay needs of an episode; it goes to another process."""

    number: int
    task: Task
    params: Mapping[str, Any]
    horizon: float
    actions: NDArray[np.float32]
    """Actions of all control periods of each row, shape (rows, periods, 7 * arms)."""
    streams: Mapping[str, NDArray[np.float32]]
    """Streams at the beginning of each row."""
    entries: tuple[str, ...]
    """Names of the entries of the environment state; empty if it was not recorded."""

    @classmethod
    def of(
        cls,
        number: int,
        task: Task,
        about: Mapping[str, Any],
        columns: Mapping[str, NDArray[Any]],
        entries: Sequence[str],
    ) -> "Recorded":
        """The parts of an episode that a replay compares.

        Args:
            entries: names of the entries of the environment state; empty if it was not recorded.

        Raises:
            ValueError: its parameters are not JSON.
        """
        compared = {name: values for name, values in columns.items() if name.endswith(STREAMS) or name == ENVIRONMENT}
        params, horizon = json.loads(about["scengen/params"]), float(about["scengen/horizon"])
        return cls(number, task, params, horizon, columns[CONTROL_ACTIONS], compared, tuple(entries))

    def readers(self) -> dict[str, Callable[[World], NDArray[Any]]]:
        """Functions that read the streams from a world."""
        robot = self.task.embodiment
        found: dict[str, Callable[[World], NDArray[Any]]] = {n: stream.read for n, stream in streams_of(robot).items()}
        if self.entries:
            own = [
                name.removesuffix(FIRST) for name in self.entries if name.endswith(FIRST) and "_to_robot" not in name
            ]
            bodies = {body: f"{body}_vel_lin.x" in self.entries for body in own}
            found[ENVIRONMENT] = ObjectState(bodies, len(hands(robot))).read
        return found


def replayed(recorded: Recorded) -> Finding | None:
    """What the replay of an episode finds; None if it gives the recorded states and the recorded success."""
    try:
        return _replayed(recorded)
    except (ScengenError, ValueError, TypeError, KeyError) as error:
        return Finding(
            "REPLAY", "error", (), {}, f"the episode cannot be replayed: {' '.join(str(error).split())[:200]}"
        )


def _replayed(recorded: Recorded) -> Finding | None:
    task = recorded.task
    scenario = task.scenario(recorded.params)
    world, readers = world_of(scenario, task.embodiment), recorded.readers()
    if recorded.actions.shape[2] != ACTION * len(hands(task.embodiment)):
        return Finding("REPLAY", "error", (), {}, f"the actions are not those of {task.embodiment}")
    episode = Episode(scenario, world, recorded.horizon)
    for row, actions in enumerate(recorded.actions):
        for name, values in recorded.streams.items():
            error = float(np.abs(readers[name](world) - values[row]).max(initial=0.0))
            if not error <= MAX_REPLAY_ERROR:
                numbers = {"error": error, "limit": MAX_REPLAY_ERROR}
                return Finding("REPLAY", "error", (row, row), numbers, f"replayed, {name} has other values")
        for action in actions:
            episode.step(action)
    if episode.outcome != "success":
        return Finding(
            "REPLAY", "error", (), {}, f"replayed, the goal is not reached: {episode.reason or 'no outcome'}"
        )
    return None


def lost(recorded: Recorded, reason: str) -> Finding | None:
    """The finding of a replay that has crashed its process, or has reached a limit."""
    return Finding("REPLAY", "error", (), {}, f"replaying it {reason}")
