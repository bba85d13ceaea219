"""Designs: the sources of the numbers that distributions turn into values. All are keyed like `keyed.unit`.

A design gives a number in (0, 1) for each parameter of each index. In every design, index 731 can be made alone, an
axis moves only the parameters that it names, and another parameter or worker changes no number. A later try at an
index, after an infeasible one, is independent of the first: only first tries belong to the design.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ..errors import BadConfig, nearest
from .dists import Choice, Dist, Fixed, Integer
from .keyed import unit

TRIES = 100
"""Number of draws of one index before the distribution is called infeasible."""


@dataclass(frozen=True)
class Independent:
    """Independent numbers: the design for statements about a whole distribution."""

    key: str
    """Name of the task."""
    tries: ClassVar[int] = TRIES
    """Number of draws of one index before it is called infeasible."""
    size: ClassVar[None] = None
    """Number of indices; None if there is no limit."""

    def number(self, name: str, seed: int, index: int, attempt: int) -> float:
        """The number in (0, 1) for a parameter.

        Args:
            name: name of the parameter.
            seed: seed of the run.
            index: index of the scenario.
            attempt: number of the try, from 0.
        """
        return unit(self.key, name, seed, index, attempt)


@dataclass(frozen=True)
class Sobol:
    """A Sobol sequence, shifted by parameter and seed: even in all parameters together, best at 2^k indices.

    The dimension of a parameter is its place in the family, not among those that vary, so that one more varying
    parameter changes no other. With 8 of 40 parameters and 128 indices the discrepancy is a third of that of
    independent draws; with dimensions of the varying parameters alone it would be a sixth.
    """

    key: str
    """Name of the task."""
    names: tuple[str, ...]
    """All parameters of the family, in its order."""
    tries: ClassVar[int] = TRIES
    """Number of draws of one index before it is called infeasible."""
    size: ClassVar[None] = None
    """Number of indices; None if there is no limit."""

    def number(self, name: str, seed: int, index: int, attempt: int) -> float:
        """See `Independent.number`."""
        if attempt:
            return unit(self.key, name, seed, index, attempt)
        block, place = divmod(index, _BLOCK)
        point = int(_sobol(len(self.names), block)[place, self.names.index(name)])
        shift = int(unit(self.key, name, seed, "shift") * 2**53)
        return ((point ^ shift) + 0.5) / 2**53


@dataclass(frozen=True)
class Latin:
    """Latin hypercubes of n indices, one after the other. Each takes every n-th part of a range exactly once."""

    key: str
    """Name of the task."""
    strata: int
    """Number of indices in a hypercube, n."""
    tries: ClassVar[int] = TRIES
    """Number of draws of one index before it is called infeasible."""
    size: ClassVar[None] = None
    """Number of indices; None if there is no limit."""

    def number(self, name: str, seed: int, index: int, attempt: int) -> float:
        """See `Independent.number`."""
        inside = unit(self.key, name, seed, index, attempt)
        if attempt:
            return inside
        block, place = divmod(index, self.strata)
        return (_ranks(self.strata, self.key, name, seed, block)[place] + inside) / self.strata


@dataclass(frozen=True)
class Grid:
    """Every combination of a few values of each parameter that varies in training, once, in a shuffled order.

    An infeasible combination is not replaced by another one. A parameter that varies only on an axis takes its values
    in turn. If an axis fixes a parameter that varies in training, combinations that differ only in it give equal
    scenarios.
    """

    key: str
    """Name of the task."""
    sizes: Mapping[str, int]
    """Number of values of each parameter that varies in training."""
    values: int
    """Number of values of any other parameter."""
    tries: ClassVar[int] = 1
    """Number of draws of one index before it is called infeasible."""

    @property
    def size(self) -> int:
        """Number of indices: all combinations."""
        return math.prod(self.sizes.values())

    def number(self, name: str, seed: int, index: int, attempt: int) -> float:
        """See `Independent.number`."""
        if index >= self.size:
            raise BadConfig(f"the grid of {self.key} has {self.size} points, numbered from 0; there is none at {index}")
        if name not in self.sizes:
            return (index % self.values + 0.5) / self.values
        place = (index * _stride(self.size) + int(unit(self.key, "grid", seed) * self.size)) % self.size
        for other, count in self.sizes.items():
            if other == name:
                break
            place //= count
        return (place % self.sizes[name] + 0.5) / self.sizes[name]


Design = Independent | Sobol | Latin | Grid
"""Source of the numbers."""


NUMBERED = ("lhs", "grid")
"""Designs with a number in their spelling."""
SOBOL = 128
"""Number of points from which a Sobol set is useful. Below it, pairs of parameters correlate, up to 0.95 at 32 and
0.76 at 50 points, and the effect of one of them alone cannot be estimated. Latin hypercubes stay below 0.5."""
KINDS = ("iid", "sobol", *NUMBERED)
"""Names of the designs."""
SPELLED = "iid, sobol, lhs:STRATA (such as lhs:50), grid:VALUES (such as grid:3)"
"""Spellings of the designs, for error messages."""


def parse(spelled: str, key: str, training: Mapping[str, Dist]) -> Design:
    """Read `iid`, `sobol`, `lhs:50` or `grid:3`.

    Args:
        spelled: the design and, where it has one, its number.
        key: name of the task.
        training: the ID distribution of every parameter of the family, in its order.

    Raises:
        BadConfig: it is not a design.
    """
    kind, _, number = spelled.partition(":")
    count = int(number) if number.isdecimal() else 0
    if spelled == "iid":
        return Independent(key)
    if spelled == "sobol":
        return Sobol(key, tuple(training))
    if kind == "lhs" and count >= 1:
        return Latin(key, count)
    if kind == "grid" and count >= 1:
        sizes = {name: _values(dist, count) for name, dist in training.items() if not isinstance(dist, Fixed)}
        return Grid(key, sizes, count)
    hint = f" ({kind} needs a whole number from 1 upwards)" if kind in NUMBERED else nearest(kind, KINDS)
    raise BadConfig(f"sampler = {spelled}{hint}; known: {SPELLED}")


def _values(dist: Dist, count: int) -> int:
    """Number of values of a distribution on a grid: all of them if they can be listed."""
    if isinstance(dist, Choice):
        return len(dist.options)
    return dist.high - dist.low + 1 if isinstance(dist, Integer) else count


_BLOCK = 1024
"""Number of points of a Sobol sequence that are made at a time."""


@cache
def _sobol(dimensions: int, block: int) -> NDArray[np.int64]:
    """Points `block * _BLOCK` and following of the plain sequence, as whole numbers of 53 bits, shape (_BLOCK,
    dimensions).
    """
    from scipy.stats import qmc  # its import takes as long as everything else that a command needs

    sequence = qmc.Sobol(dimensions, scramble=False, bits=30)
    if block:  # scipy cannot forward by 0
        sequence.fast_forward(block * _BLOCK)
    return (sequence.random(_BLOCK) * 2**53).astype(np.int64)


@cache
def _ranks(count: int, *key: str | int) -> Sequence[int]:
    """The numbers 0 to count - 1 in a keyed order."""
    return sorted(range(count), key=lambda i: unit(*key, "stratum", i))


@cache
def _stride(size: int) -> int:
    """A step round a circle of `size` places that visits all of them.

    It is near the golden section, so that the first few places are spread evenly.
    """
    start = max(1, round(size * (math.sqrt(5) - 1) / 2))
    return next(s for s in range(start, start + size + 1) if math.gcd(s, size) == 1)
