"""Replay a witness and yield dataset rows."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..control.loop import ACTION
from ..envs.observations import Stream
from ..episode import Actions, Episode
from ..pictures.render import Picture
from ..pool.pool import PoolRow
from ..scenario import Scenario
from ..sim.world import World


@dataclass(frozen=True)
class View:
    """What is seen at one moment."""

    streams: Mapping[str, NDArray[np.float32]]
    pictures: Mapping[str, Picture]
    physics: NDArray[np.float64]
    """Time, `qpos` and `qvel`, one after the other: what robosuite calls a flattened state."""

    @classmethod
    def of(cls, world: World, streams: Mapping[str, Stream], pictures: Callable[[], dict[str, Picture]]) -> "View":
        """What is seen now. `pictures` takes those of this moment."""
        read = {name: stream.read(world).astype(np.float32) for name, stream in streams.items()}
        data = world.data
        return cls(read, pictures(), np.concatenate([[data.time], data.qpos, data.qvel]))


@dataclass(frozen=True)
class Moment:
    """One row: what is seen, then what is done until the next row."""

    seen: View
    actions: Actions
    """What the controller received in the control periods of the row, shape (periods, 7 * arms)."""
    success: bool
    """Whether the goal was reached in them."""
    done: bool
    """Whether the episode was over then."""

    @property
    def action(self) -> NDArray[np.float32]:
        """The one action that, held for the whole row, asks for the same motion: the mean, and the last grips."""
        action = self.actions.mean(axis=0)
        action[ACTION - 1 :: ACTION] = self.actions[-1, ACTION - 1 :: ACTION]
        return action.astype(np.float32)


@dataclass(frozen=True)
class Replay:
    """A witness to be played, as the Gymnasium environment would."""

    row: PoolRow
    scenario: Scenario
    world: World
    every: int
    """Control periods in a row of the data."""
    look: Callable[[], View]
    """What is seen now."""

    def moments(self) -> Iterator[Moment]:
        """The rows, from the start until the episode is over.

        After the last recorded action the robot is idle. The control periods of the last row are all simulated.
        """
        self.world.reset()
        episode, over, recorded = Episode(self.scenario, self.world, self.row.horizon), None, iter(self.row.witness)
        while over is None:
            seen, done = self.look(), []
            for _ in range(self.every):
                action = next(recorded, None)
                done.append(self.world.idle.astype(np.float32) if action is None else action)
                outcome = episode.step(done[-1])
                over = over or outcome
            yield Moment(seen, np.array(done), over == "success", over is not None)
