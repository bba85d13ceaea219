"""Replay a witness and yield the rows of a data set."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..control.loop import ACTION
from ..envs.observations import Stream
from ..episode import Actions, Episode
from ..pictures.render import Picture
from ..pool.row import SceneRow
from ..scenario import Scenario
from ..sim.world import World


@dataclass(frozen=True)
class Snapshot:
    """Observations and physics state at one moment."""

    streams: Mapping[str, NDArray[np.float32]]
    pictures: Mapping[str, Picture]
    physics: NDArray[np.float64]
    """Time, `qpos` and `qvel` in one vector: robosuite's flattened state."""

    @classmethod
    def of(cls, world: World, streams: Mapping[str, Stream], pictures: Callable[[], dict[str, Picture]]) -> "Snapshot":
        """The present moment of a world. `pictures` takes its pictures."""
        read = {name: stream.read(world).astype(np.float32) for name, stream in streams.items()}
        data = world.data
        return cls(read, pictures(), np.concatenate([[data.time], data.qpos, data.qvel]))


@dataclass(frozen=True)
class DatasetRow:
    """One row: the observations at its start, then the actions until the next row."""

    observed: Snapshot
    actions: Actions
    """Actions that the controller received in the control periods of the row, shape (periods, 7 * arms)."""
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

    def rows(self) -> Iterator[DatasetRow]:
        """The rows, from the start to the end of the episode.

        After the last recorded action the robot is idle. The control periods of the last row are all simulated.
        """
        self.world.reset()
        episode, over, recorded = Episode(self.scenario, self.world, self.row.horizon), None, iter(self.row.witness)
        while over is None:
            observed, done = self.observe(), []
            for _ in range(self.periods_per_row):
                action = next(recorded, None)
                done.append(self.world.idle.astype(np.float32) if action is None else action)
                outcome = episode.step(done[-1])
                over = over or outcome
            yield DatasetRow(observed, np.array(done), over == "success", over is not None)
