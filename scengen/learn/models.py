"""The three policies as functions of arrays, in plain numpy: from inputs to a chunk of future goals (`goals`).

    knn    weighted mean of the chunks of the k nearest rows of the demonstrations
    bc     behaviour cloning: a perceptron that minimises the squared error of the chunk
    mip    minimal iterative policy (Pan et al., arXiv 2512.01809): one perceptron p(o, a, t) that is called twice.
           Trained on |p(o, 0, 0) - a|^2 + |p(o, t* a + (1 - t*) z, t*) - a|^2 with z ~ N(0, 1) and t* = 0.9;
           played as p(o, t* p(o, 0, 0), t*).

Both are ensembles: several perceptrons of different initial weights, whose outputs are averaged. What a single one does
in a few rare states decides episodes, and differs from training to training: three trainings on 200 demonstrations of
`edge_slide` solved 9, 14 and 16 of 20 scenarios, the mean of five 17.

Chunks are standardised: each number of a goal is shifted by its mean and divided by its spread.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[np.float32]]
"""Arrays of a policy, by name."""
KNN = "knn"
"""Name of the policy of nearest neighbours."""
BC = "bc"
"""Name of behaviour cloning."""
MIP = "mip"
"""Name of the minimal iterative policy."""
KINDS = (KNN, BC, MIP)
"""Names of the policies."""
NEIGHBOURS = 5
"""Number of neighbours of `knn`."""
CANDIDATES = 100
"""Number of rows among which the neighbours are searched exactly. Before, distances are rounded."""
REFINED_AT = 0.9
"""Time t* of the second call of `mip`, as in the paper."""


def predict(kind: str, arrays: Arrays, inputs: NDArray[np.float32]) -> NDArray[np.float32]:
    """Standardised chunks, shape (n, chunk * actions), for inputs, shape (n, size)."""
    if kind == KNN:
        return np.stack([_neighbours(arrays["inputs"], arrays["chunks"], one) for one in inputs])
    if kind == BC:
        return perceptron(arrays, inputs)
    outputs = arrays[f"biases{layers(arrays) - 1}"].shape[-1]
    first = perceptron(arrays, first_pass(inputs, outputs))
    return perceptron(arrays, second_pass(inputs, REFINED_AT * first))


def first_pass(inputs: NDArray[np.float32], outputs: int) -> NDArray[np.float32]:
    """Inputs of `mip`'s perceptron in its first call: o, 0, 0."""
    return np.hstack([inputs, np.zeros((len(inputs), outputs + 1), np.float32)])


def second_pass(inputs: NDArray[np.float32], blurred: NDArray[np.float32]) -> NDArray[np.float32]:
    """Inputs of `mip`'s perceptron in its second call: o, a blurred chunk, t*."""
    return np.hstack([inputs, blurred, np.full((len(inputs), 1), REFINED_AT, np.float32)])


def perceptron(arrays: Arrays, inputs: NDArray[np.float32]) -> NDArray[np.float32]:
    """Mean output of perceptrons with rectified hidden layers, shape (n, outputs).

    Args:
        arrays: `weights0`, shape (members, size, units), `biases0`, shape (members, units), `weights1` and so on.
        inputs: shape (n, size).
    """
    found, last = inputs, layers(arrays) - 1
    for i in range(last + 1):
        found = found @ arrays[f"weights{i}"] + arrays[f"biases{i}"][:, None]
        if i < last:
            np.maximum(found, 0.0, out=found)
    return found.mean(axis=0)


def layers(arrays: Mapping[str, Any]) -> int:
    """Number of layers of a perceptron."""
    return sum(name.startswith("weights") for name in arrays)


def _neighbours(known: NDArray[np.float32], chunks: NDArray[np.float32], here: NDArray[np.float32]) -> Any:
    """Mean of the chunks of the nearest rows, weighted by the inverse of the squared distance."""
    roughly = np.einsum("ij,ij->i", known, known) - 2.0 * (known @ here)  # less |here|^2, in a tenth of the time
    among = np.sort(np.argpartition(roughly, min(CANDIDATES, len(known)) - 1)[:CANDIDATES])
    far = np.square(known[among] - here).sum(axis=1)
    near = np.argsort(far, kind="stable")[:NEIGHBOURS]
    weights = 1.0 / (far[near] + 1e-6)
    return (weights / weights.sum()) @ chunks[among[near]]
