"""Replay a witness and yield dataset rows."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..control.loop import ACTION
from ..envs.observations import Stream
from ..episode import Actions, Episode
from ..pictures.render import Picture
from ..pool import PoolRow
from ..scenario import Scenario
from ..sim.world import World


@dataclass(frozen=True)
class Moment:
    """One row: what is seen, then what is done until the next row."""

    streams: Mapping[str, NDArray[np.float32]]
    pictures: Mapping[str, Picture]
    actions: Actions
    """What the controller received in the control periods of the row, shape (periods, 7 * arms)."""
    success: bool
    """Whether the goal was reached in them."""
    done: bool
    """Whether the episode was over then."""

    def values(self, state: Sequence[str]) -> dict[str, Any]:
        """The columns of the row: the paper's streams, the actions, and what LeRobot looks for.

        Args:
            state: names of the streams that make up `observation.state`.
        """
        return {
            **self.streams,
            "observation.state": np.concatenate([self.streams[name] for name in state]),
            "action": self.action,
            "actions": self.actions,
            "reward": np.float32(self.success),
            "next.reward": np.float32(self.success),
            "next.done": self.done,
            "next.success": self.success,
        }

    @property
    def action(self) -> NDArray[np.float32]:
        """The one action that, held for the whole row, asks for the same motion: the mean, and the last grips."""
        action = self.actions.mean(axis=0)
        action[ACTION - 1 :: ACTION] = self.actions[-1, ACTION - 1 :: ACTION]
        return action.astype(np.float32)


def play(
    world: World,
    scenario: Scenario,
    row: PoolRow,
    every: int,
    streams: Mapping[str, Stream],
    pictures: Callable[[], dict[str, Picture]],
) -> Iterator[Moment]:
    """Play the witness of a pool's row until the episode is over, as the Gymnasium environment would.

    After the last recorded action the robot is idle. The control periods of the last row are all simulated.

    Args:
        every: control periods in a row.
        streams: what is read at the beginning of each row.
        pictures: takes the pictures of that moment.
    """
    world.reset()
    episode, over, recorded = Episode(scenario, world, row.horizon), None, iter(row.witness)
    while over is None:
        seen = {name: stream.read(world).astype(np.float32) for name, stream in streams.items()}
        taken, done = pictures(), []
        for _ in range(every):
            action = next(recorded, None)
            done.append(world.idle.astype(np.float32) if action is None else action)
            outcome = episode.step(done[-1])
            over = over or outcome
        yield Moment(seen, taken, np.array(done), over == "success", over is not None)
