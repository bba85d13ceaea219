"""Epochs of a training, each of which is kept on disk: a training that was interrupted continues after the last one.

The perceptrons are scikit-learn's `MLPRegressor`. An epoch is one `fit` of each that continues from the weights of the
previous epoch, with fresh noise and its own learning rate. All random numbers depend on the seed, the member and the
epoch, and the arithmetic runs on one core: the same data give the same weights, with or without interruptions.

One pass of one perceptron over 48 300 rows of 176 inputs took scikit-learn 1.0 to 1.5 s of processor time, and the same
network in jax 0.7.1 (compiled, one core, in turn) 0.65 to 0.9 s. This saves too little for another dependency.
"""

import math
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..samplers.keyed import unit
from ..work.targets import write
from .models import BC, KNN, MIP, REFINED_AT, first_pass, second_pass
from .samples import Samples
from .store import arrays_as_bytes, network_shapes, read_arrays

INPUT_NOISE = 0.02
"""Standard deviation of the noise on inputs in training [standard deviations]. It represents states near those of the
demonstrations."""
BATCH = 256
"""Rows per step of the optimiser."""
FIRST_RATE = 1e-3
"""Learning rate of Adam in the first epoch. It falls to 0 along half a cosine."""
BEST = "best_"
"""Prefix of the weights of the best epoch in the file of an unfinished training."""
INTERRUPTED = "Training interrupted by user"
"""Beginning of the warning of scikit-learn about Ctrl-C."""
DECAY = 1e-4
"""Weight of the squared norm of the weights."""


def best_epoch(losses: Sequence[tuple[float, float]]) -> int:
    """Number of the epoch with the lowest held-out loss, from 1; 0 before the first.

    Args:
        losses: losses after each epoch, of demonstrations that were learned from, and of held-out ones.
    """
    return 1 + int(np.argmin([held_out for _, held_out in losses])) if losses else 0


class Training:
    """A training with its present weights."""

    def __init__(
        self,
        path: Path,
        kind: str,
        hidden: tuple[int, ...],
        members: int,
        learned: Samples,
        held_out: Samples,
        epochs: int,
        limit: float | None,
        seed: int,
        patience: int | None = None,
    ):
        """Begin, or continue from a file.

        Args:
            path: file of the weights after the last epoch; its name identifies the training.
            kind: name of the policy.
            hidden: units of the hidden layers.
            members: number of perceptrons.
            learned: what is learned.
            held_out: what the held-out losses are measured on.
            epochs: number of epochs.
            limit: processor time after which the training ends [s]; None for none.
            seed: seed of all random numbers.
            patience: number of epochs without a lower held-out loss after which the training ends, with the weights of
                the best epoch; None to train to the end.

        Raises:
            Broken: the file is damaged.
        """
        self.path, self.kind, self.hidden, self.learned = path, kind, hidden, learned
        self.members = members
        self._measured = learned.some(), held_out.some()
        self.epochs, self._limit, self._seed, self._patience = epochs, limit, seed, patience
        self.arrays: dict[str, NDArray[np.float32]] = {}
        self.best: dict[str, NDArray[np.float32]] = {}
        """Weights after the epoch with the lowest held-out loss; none without patience."""
        self.losses: list[tuple[float, float]] = []
        """Losses after each epoch [variances]: of what is learned, and of what is held out."""
        self.seconds = 0.0
        """Processor time, that of earlier runs included [s]."""
        if path.exists():
            self._continue()

    @property
    def share(self) -> float:
        """Share of the training that is done, by epochs or by time, whichever is larger."""
        timed = self.seconds / self._limit if self._limit else 0.0
        return max(len(self.losses) / self.epochs, timed)

    @property
    def best_epoch(self) -> int:
        """Number of the epoch with the lowest held-out loss, from 1; 0 before the first."""
        return best_epoch(self.losses)

    @property
    def is_over(self) -> bool:
        """Whether nothing is left to do."""
        waited = len(self.losses) - self.best_epoch
        return self.share >= 1.0 or (self._patience is not None and waited >= self._patience)

    @property
    def kept(self) -> dict[str, NDArray[np.float32]]:
        """Weights of the policy."""
        return self.best if self._patience is not None else self.arrays

    def advance(self) -> None:
        """Train for one epoch and keep the result."""
        started = time.process_time()
        if self.kind == KNN:
            self.arrays = self.learned.copied
        else:
            found = [self._fitted(member) for member in range(self.members)]
            self.arrays = {name: np.stack([one[name] for one in found]) for name in found[0]}
        learned, held_out = (samples.error(self.kind, self.arrays) for samples in self._measured)
        self.losses.append((learned, held_out))
        self.seconds += time.process_time() - started
        if self._patience is not None and self.best_epoch == len(self.losses):
            self.best = self.arrays
        if self.kind != KNN:
            best = {f"{BEST}{name}": values for name, values in self.best.items()}
            values = {"losses": self._all_losses(), "seconds": np.array([self.seconds], np.float32)}
            write(self.path, arrays_as_bytes({**self.arrays, **best, **values}))

    def _all_losses(self) -> NDArray[np.float32]:
        """Losses of all epochs, shape (epochs, 2); -1 for those to come."""
        found = np.full((self.epochs, 2), -1.0, np.float32)
        found[: len(self.losses)] = self.losses
        return found

    def _continue(self) -> None:
        shapes = network_shapes(
            self.kind, self.learned.inputs.shape[1], self.hidden, self.learned.chunks.shape[1], self.members
        )
        best = {f"{BEST}{name}": shape for name, shape in shapes.items()} if self._patience is not None else {}
        arrays = read_arrays(self.path, {**shapes, **best, "losses": (self.epochs, 2), "seconds": (1,)})
        self.best = {name.removeprefix(BEST): arrays.pop(name) for name in best}
        self.losses = [(float(a), float(b)) for a, b in arrays.pop("losses") if b >= 0.0]
        self.seconds = float(arrays.pop("seconds")[0])
        self.arrays = arrays

    def _fitted(self, member: int) -> dict[str, NDArray[np.float32]]:
        """Weights of one perceptron after one more epoch."""
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.neural_network import MLPRegressor
        from threadpoolctl import threadpool_limits

        number = len(self.losses)
        random = np.random.default_rng(int(2**31 * unit("noise", self._seed, member, number)))
        inputs, chunks = _augmented(self.kind, self.learned, random)
        options: dict[str, Any] = {
            "hidden_layer_sizes": self.hidden,
            "alpha": DECAY,
            "batch_size": min(BATCH, len(inputs)),
            "learning_rate_init": FIRST_RATE * 0.5 * (1.0 + math.cos(math.pi * self.share)),
            "max_iter": 1,
            "warm_start": True,
            "random_state": int(2**31 * unit("epoch", self._seed, member, number)),
        }
        network = MLPRegressor(**options)
        with threadpool_limits(1), _interruptions(), warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # one pass is what was requested
            warnings.filterwarnings("error", INTERRUPTED, UserWarning)
            if self.arrays:
                network.partial_fit(inputs[:BATCH], chunks[:BATCH])  # makes the arrays that are replaced now
                network.coefs_ = [self.arrays[f"weights{i}"][member].copy() for i in range(len(self.hidden) + 1)]
                network.intercepts_ = [self.arrays[f"biases{i}"][member].copy() for i in range(len(self.hidden) + 1)]
            network.fit(inputs, chunks)
        weights = {f"weights{i}": values for i, values in enumerate(network.coefs_)}
        return weights | {f"biases{i}": values for i, values in enumerate(network.intercepts_)}


@contextmanager
def _interruptions() -> Iterator[None]:
    """Interrupt a training again: scikit-learn turns Ctrl-C into a warning, and calls half an epoch a whole one."""
    try:
        yield
    except UserWarning as error:
        if INTERRUPTED not in str(error):
            raise
        raise KeyboardInterrupt from None


def _augmented(
    kind: str, samples: Samples, random: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Inputs and targets of one epoch, with noise; those of both calls for `mip`."""
    noise = INPUT_NOISE * random.standard_normal(samples.inputs.shape, np.float32)
    inputs, chunks = samples.inputs + noise, samples.chunks
    if kind == BC:
        return inputs, chunks
    assert kind == MIP
    blurred = REFINED_AT * chunks + (1.0 - REFINED_AT) * random.standard_normal(chunks.shape, np.float32)
    both = np.concatenate([first_pass(inputs, chunks.shape[1]), second_pass(inputs, blurred)])
    return both, np.concatenate([chunks, chunks])
