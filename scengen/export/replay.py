"""Replay a witness and yield the rows of a data set."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..control.loop import ACTION
from ..control.teleop import MOTION
from ..envs.observations import Stream
from ..episode import STRICT, Actions, Episode, Rules
from ..perturb.drawn import Senses
from ..pictures.render import Picture
from ..pool.row import DemonstrationRow, SceneRow
from ..scenario import Scenario
from ..sim.world import World

MOVING_ACTION = 0.1
"""Size of an action's motion above which it counts as a command to move: five times the noise of demonstrations."""


@dataclass(frozen=True)
class Snapshot:
    """Observations and physics state at one moment."""

    streams: Mapping[str, NDArray[np.float32]]
    pictures: Mapping[str, Picture]
    physics: NDArray[np.float64]
    """Time, `qpos` and `qvel` in one vector: robosuite's flattened state."""

    @classmethod
    def of(
        cls,
        world: World,
        streams: Mapping[str, Stream],
        pictures: Callable[[], dict[str, Picture]],
        senses: Senses | None = None,
    ) -> "Snapshot":
        """The present moment of a world. `pictures` takes its pictures."""
        data = world.data
        return cls(read(world, streams, senses), pictures(), np.concatenate([[data.time], data.qpos, data.qvel]))


def asks_for_motion(action: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether actions command a motion of each arm, shape (..., arms), of actions of shape (..., 7 * arms)."""
    arms = action.reshape(*action.shape[:-1], -1, ACTION)
    return np.abs(arms[..., :MOTION]).max(axis=-1) > MOVING_ACTION


def read(world: World, streams: Mapping[str, Stream], senses: Senses | None = None) -> dict[str, NDArray[np.float32]]:
    """The present readings of some streams, as they are perceived."""
    found = {name: stream.read(world) for name, stream in streams.items()}
    if senses is not None:
        found = {n: senses.reading(n, streams[n].entries(n), world.time, value) for n, value in found.items()}
    return {name: value.astype(np.float32) for name, value in found.items()}


@dataclass(frozen=True)
class DatasetRow:
    """One row: the observations at its start, then the actions until the next row."""

    observed: Snapshot
    actions: Actions
    """Actions that the controller received in the control periods of the row, shape (periods, 7 * arms)."""
    samples: Sequence[Mapping[str, NDArray[np.float32]]]
    """Streams at the start of each control period of the row; none unless they were requested."""
    success: bool
    """Whether the goal was reached during the row."""
    done: bool
    """Whether the episode ended during the row."""

    @property
    def action(self) -> NDArray[np.float32]:
        """The single action that gives the same motion if held for the whole row: the mean, with the last grips."""
        action = self.actions.mean(axis=0)
        action[ACTION - 1 :: ACTION] = self.actions[-1, ACTION - 1 :: ACTION]
        return action.astype(np.float32)

    @property
    def waiting(self) -> bool:
        """Whether the robot waits on purpose: the action of the row commands no arm to move."""
        return not asks_for_motion(self.action).any()


@dataclass(frozen=True)
class WitnessReplay:
    """A witness to be replayed, with the same steps as the Gymnasium environment."""

    row: SceneRow
    scenario: Scenario
    world: World
    periods_per_row: int
    """Control periods in a row of the data set."""
    observe: Callable[[], Snapshot]
    """Function that returns the present moment of the world."""
    sample: Callable[[], Mapping[str, NDArray[np.float32]]] | None = None
    """Function that reads the streams in every control period."""
    rules: Rules = STRICT
    """Rules of the episode."""
    calibrations: Mapping[str, dict[str, Any]] = field(default_factory=dict[str, dict[str, Any]])
    """Calibration of each recorded camera, by the paper's name."""
    instruction: str = ""
    """The instruction as it is given."""

    @property
    def promised(self) -> bool:
        """Whether the actions reach the goal, and it lasts, by their row."""
        return not isinstance(self.row, DemonstrationRow) or self.row.outcome == "success"

    def rows(self) -> Iterator[DatasetRow]:
        """The rows, from the start to the end of the episode.

        After the last recorded action the robot is idle. The control periods of the last row are all simulated.
        """
        self.world.reset()
        episode = Episode(self.scenario, self.world, self.row.horizon, self.rules)
        over, recorded = None, iter(self.row.witness)
        while over is None:
            observed, done, samples = self.observe(), [], []
            for _ in range(self.periods_per_row):
                samples += [self.sample()] if self.sample else []
                action = next(recorded, None)
                done.append(self.world.idle.astype(np.float32) if action is None else action)
                outcome = episode.step(done[-1])
                over = over or outcome
            yield DatasetRow(observed, np.array(done), samples, over == "success" and self.promised, over is not None)
