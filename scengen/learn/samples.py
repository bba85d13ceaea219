"""Training samples of a policy: inputs and standardised chunks of goals at each row of the demonstrations."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import BadConfig
from ..export.floors import ACTION_SHARE
from ..samplers.keyed import unit
from .data import Trajectory
from .features import Features
from .goals import goals_of
from .models import predict

HELD_OUT = 0.1
"""Share of the scenarios whose demonstrations are held out."""
VALIDATED = 2000
"""Largest number of rows on which an error is measured."""
Arrays = Mapping[str, NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class Samples:
    """Training samples of a policy: inputs, shape (n, size), and standardised chunks, shape (n, outputs)."""

    inputs: NDArray[np.float32]
    chunks: NDArray[np.float32]

    def some(self) -> "Samples":
        """At most `VALIDATED` rows, evenly spread."""
        every = max(1, math.ceil(len(self.inputs) / VALIDATED))
        return Samples(self.inputs[::every], self.chunks[::every])

    @property
    def copied(self) -> dict[str, NDArray[np.float32]]:
        """The arrays of a policy of nearest neighbours, which copies the samples."""
        return {"inputs": self.inputs, "chunks": self.chunks}

    def error(self, kind: str, arrays: Arrays) -> float:
        """Mean squared error of the chunks that a policy predicts [variances]."""
        return float(np.square(predict(kind, arrays, self.inputs) - self.chunks).mean())


def parted(trajectories: Sequence[Trajectory]) -> tuple[list[Trajectory], list[Trajectory]]:
    """Demonstrations to learn from, and held-out ones. All runs of a scenario are on the same side.

    Raises:
        BadConfig: all demonstrations are of one scenario.
    """
    scenarios = sorted({one.scenario for one in trajectories}, key=lambda scenario: unit("held out", scenario))
    if len(scenarios) < 2:
        raise BadConfig("all demonstrations are of one scenario; nothing can be held out: make more of them")
    apart = set(scenarios[: max(1, round(HELD_OUT * len(scenarios)))])
    learned = [one for one in trajectories if one.scenario not in apart]
    return learned, [one for one in trajectories if one.scenario in apart]


def scaling_of(
    entries: Sequence[str], steps: int, chunk: int, learned: Sequence[Trajectory]
) -> dict[str, NDArray[np.float32]]:
    """Means and spreads of inputs and chunks, as arrays of a policy.

    Args:
        entries: names of the entries of an observation.
        steps: number of observations that the policy sees at once.
        chunk: number of actions in a chunk.
        learned: demonstrations that are learned from.
    """
    features = Features.of(entries, steps, np.concatenate([one.observations for one in learned]))
    chunks = np.concatenate([goals_of(one.hands, one.actions, chunk) for one in learned])
    return {
        "input_mean": features.mean,
        "input_scale": features.scale,
        "output_mean": chunks.mean(axis=0),
        "output_scale": np.maximum(chunks.std(axis=0), np.float32(ACTION_SHARE)),
    }


def samples_of(features: Features, chunk: int, scaling: Arrays, trajectories: Sequence[Trajectory]) -> Samples:
    """Samples of some demonstrations, scaled."""
    chunks = np.concatenate([goals_of(one.hands, one.actions, chunk) for one in trajectories])
    inputs = np.concatenate([features.inputs(one.observations) for one in trajectories])
    return Samples(inputs, (chunks - scaling["output_mean"]) / scaling["output_scale"])
