"""Designs: where the numbers come from that distributions turn into values. All are keyed like `keyed.unit`.

A design answers with a number in (0, 1) for each parameter of each index. Whichever it is, index 731 can be made alone,
an axis moves what it names and nothing else, and another parameter or worker moves no number. A later try at an index,
after an infeasible one, is independent of the first in every design: only first tries have a place in it.
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
"""Draws of one index before the distribution is called infeasible."""


@dataclass(frozen=True)
class Independent:
    """Every number by itself: the design that a statement about a whole distribution needs."""

    key: str
    """Name of the task."""
    tries: ClassVar[int] = TRIES
    """Draws of one index before it is called infeasible."""
    size: ClassVar[None] = None
    """How many indices there are; None if there is no end."""

    def number(self, name: str, seed: int, index: int, attempt: int) -> float:
        """The number in (0, 1) for parameter `name` in try `attempt` at scenario `index`."""
        return unit(self.key, name, seed, index, attempt)


@dataclass(frozen=True)
class Sobol:
    """A Sobol sequence, shifted by parameter and seed: even in all parameters together, best at 2^k indices.

    A parameter's dimension is its place in the family, not among those that vary: to let one more vary moves no other.
    With 8 of 40 parameters and 128 indices the discrepancy is a third of that of independent draws, instead of a sixth.
    """

    key: str
    names: tuple[str, ...]
    """All parameters of the family, in its order."""
    tries: ClassVar[int] = TRIES
    size: ClassVar[None] = None

    def number(self, name: str, seed: int, index: int, attempt: int) -> float:
        if attempt:
            return unit(self.key, name, seed, index, attempt)
        block, place = divmod(index, _BLOCK)
        point = int(_sobol(len(self.names), block)[place, self.names.index(name)])
        shift = int(unit(self.key, name, seed, "shift") * 2**53)
        return ((point ^ shift) + 0.5) / 2**53


@dataclass(frozen=True)
class Latin:
    """Latin hypercubes of n indices, one after the other: in each, every n-th part of a range is met exactly once."""

    key: str
    strata: int
    tries: ClassVar[int] = TRIES
    size: ClassVar[None] = None

    def number(self, name: str, seed: int, index: int, attempt: int) -> float:
        inside = unit(self.key, name, seed, index, attempt)
        if attempt:
            return inside
        block, place = divmod(index, self.strata)
        return (_ranks(self.strata, self.key, name, seed, block)[place] + inside) / self.strata


@dataclass(frozen=True)
class Grid:
    """Every combination of a few values of each parameter that varies in training, once, in a shuffled order.

    An infeasible combination is not replaced by another. A parameter that only an axis lets vary takes its values in
    turn. An axis that fixes a parameter which training varies makes equal scenarios of combinations that differ in it.
    """

    key: str
    sizes: Mapping[str, int]
    """Number of values of each parameter that varies in training."""
    values: int
    """Number of values of any other."""
    tries: ClassVar[int] = 1

    @property
    def size(self) -> int:
        return math.prod(self.sizes.values())

    def number(self, name: str, seed: int, index: int, attempt: int) -> float:
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


NUMBERED = ("lhs", "grid")
SOBOL = 128
"""Points from which a Sobol set is one: below, pairs of parameters correlate, up to 0.95 at 32 and 0.76 at 50 points,
and nothing can be told about one of them alone; Latin hypercubes stay below 0.5."""
KINDS = ("iid", "sobol", *NUMBERED)
SPELLED = "iid, sobol, lhs:STRATA (such as lhs:50), grid:VALUES (such as grid:3)"


def parse(spelled: str, key: str, training: Mapping[str, Dist]) -> Design:
    """Read `iid`, `sobol`, `lhs:50` or `grid:3`.

    Args:
        spelled: the design and, where it has one, its number.
        key: name of the task.
        training: the ID distribution of every parameter of the family, in its order.

    Raises:
        BadConfig: it is none of these.
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
    hint = f" ({kind} needs a whole number from 1 on)" if kind in NUMBERED else nearest(kind, KINDS)
    raise BadConfig(f"sampler = {spelled}{hint}; known: {SPELLED}")


def _values(dist: Dist, count: int) -> int:
    """How many values of a distribution a grid takes: all if they can be listed."""
    if isinstance(dist, Choice):
        return len(dist.options)
    return dist.high - dist.low + 1 if isinstance(dist, Integer) else count


_BLOCK = 1024
"""Points of a Sobol sequence that are made at a time."""


@cache
def _sobol(dimensions: int, block: int) -> NDArray[np.int64]:
    """Points `block * _BLOCK` and following of the plain sequence as whole numbers of 53 bits, (_BLOCK, dimensions)."""
    from scipy.stats import qmc  # whose import takes as long as all else that a command needs

    sequence = qmc.Sobol(dimensions, scramble=False, bits=30)
    if block:  # scipy cannot go forward by nothing
        sequence.fast_forward(block * _BLOCK)
    return (sequence.random(_BLOCK) * 2**53).astype(np.int64)


@cache
def _ranks(count: int, *key: str | int) -> Sequence[int]:
    """The numbers 0 to count - 1 in a keyed order."""
    return sorted(range(count), key=lambda i: unit(*key, "stratum", i))


@cache
def _stride(size: int) -> int:
    """A step round a circle of `size` places that meets all of them; near the golden section: a few are even."""
    start = max(1, round(size * (math.sqrt(5) - 1) / 2))
    return next(s for s in range(start, start + size + 1) if math.gcd(s, size) == 1)
