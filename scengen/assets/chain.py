"""Positions of the tiles in chains of dominoes that lead to a slab, and of the defects that keep the slab standing.

x runs along the chain, from the middle of an intact chain; y is to its left.
"""

import itertools
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root_scalar

from ..geometry import Vec3
from ..params import Bounded, param
from .box import Domino

GAP = 0
"""Kind of defect: a tile beside the chain (paper, App. B, T18)."""
DRIFT = 1
"""Kind of defect: spaces that grow along the chain (paper, App. B, T18)."""
DECOY = 2
"""Kind of defect: a slab that does not count (paper, App. B, T18)."""
MISSING = 3
"""Kind of defect: a missing tile, which is not in the paper."""


@dataclass(frozen=True, kw_only=True)
class Defect(Bounded):
    """A defect, because of which a chain does not reach the slab that counts. Each kind uses some of the fields."""

    kind: int = param(GAP, "0 gap, 1 drift, 2 decoy, 3 missing", GAP, MISSING)
    place: float = param(0.3, "share of the chain", 0.0, 1.0)
    """Place of the tile that is beside the chain or missing: 0 is the second tile, 1 the last."""
    offset: float = param(1.3, "tile widths", 1.02, 2.5)
    """Distance of that tile from the line of the chain."""
    side: int = param(1, "0 right, 1 left", 0, 1)
    stretch: float = param(1.25, "tile heights", 1.02, 2.0)
    """Widest space of a drifting chain, the previous one its slab."""

    def broken(self, count: int) -> int:
        """Index of the tile that is beside the chain or missing, in a chain of `count` tiles; never the first tile."""
        return 1 + min(int(self.place * (count - 1)), count - 2)


@dataclass(frozen=True)
class Chain:
    """Tiles in a row with a slab at their end."""

    count: int
    """Number of tiles, without the slab."""
    gap: float
    """Free space between neighbouring faces of an intact chain [m]."""
    starter: Domino
    """First tile."""
    tile: Domino
    """Every other tile."""
    slab: Domino
    defect: Defect | None = None

    @cached_property
    def astray(self) -> bool:
        """Whether it leads to a slab that does not count."""
        return self.defect is not None and self.defect.kind == DECOY

    @cached_property
    def gaps(self) -> NDArray[np.float64]:
        """Free spaces between the tiles and before the slab [m], shape (count,).

        In a drifting chain each space is larger than the previous one by the same factor, and their sum is that of an
        intact chain. So first tiles and slabs of all chains stand in rows, and only the spacing shows the defect.
        """
        if self.defect is None or self.defect.kind != DRIFT:
            return np.full(self.count, self.gap)
        widest, powers = self.defect.stretch * self.tile.height, np.arange(self.count)[::-1]
        total = self.count * self.gap / widest
        return widest * root_scalar(lambda ratio: np.sum(ratio**powers) - total, bracket=(0.0, 1.0)).root ** powers

    @cached_property
    def feet(self) -> dict[int, Vec3]:
        """Positions of the tiles by their index, and of the slab as `feet[count]` [m]. A missing tile has none.

        The origin is the middle of a chain of equal tiles. If the starter is thicker, its pushed face stays in place.
        """
        thick = np.array([self.starter.thickness, *[self.tile.thickness] * (self.count - 1), self.slab.thickness])
        faces = np.cumsum([-self.count * (self.gap + self.tile.thickness) / 2, *(self.gaps + thick[:-1])])
        feet = {i: np.array([middle, 0.0, 0.0]) for i, middle in enumerate(faces + thick / 2)}
        if self.defect and self.defect.kind == GAP:
            side = 1 if self.defect.side else -1
            feet[self.defect.broken(self.count)][1] = side * self.defect.offset * self.tile.width
        if self.defect and self.defect.kind == MISSING:
            del feet[self.defect.broken(self.count)]
        return feet


@dataclass(frozen=True)
class Lanes:
    """Parallel chains side by side, the first on the right. First tiles stand in one row, slabs in another.

    All chains but one lead to the same slab, which stands across their lanes. The first or the last one may lead to a
    separate slab, the decoy.
    """

    chains: tuple[Chain, ...]
    spacing: float
    """Distance between neighbouring chains [m]."""

    @cached_property
    def feet(self) -> dict[str, Vec3]:
        """Positions of all tiles and slabs, from the middle of the middle lane [m].

        `tile_3_0` is the first tile in lane 3; `slab` is the slab that counts, `decoy` the other one.
        """
        feet, ends = {}, list[Vec3]()
        for k, chain in enumerate(self.chains):
            across = (k - len(self.chains) // 2) * self.spacing * np.array([0.0, 1.0, 0.0])
            for i, foot in chain.feet.items():
                if i < chain.count:
                    feet[f"tile_{k}_{i}"] = foot + across
                elif chain.astray:
                    feet["decoy"] = foot + across
                else:
                    ends.append(foot + across)
        return {**feet, "slab": np.mean(ends, axis=0)}

    @cached_property
    def slab_width(self) -> float:
        """Width of the slab that counts [m]: that of one chain's, and the distance of the outermost lanes."""
        one, *others = (chain.slab for chain in self.chains if not chain.astray)
        return one.width + len(others) * self.spacing

    @cached_property
    def slab(self) -> Domino:
        """The slab that counts. A width beyond the bounds of `Domino` is an error."""
        one = next(chain.slab for chain in self.chains if not chain.astray)
        return replace(one, width=self.slab_width)

    def defects(self, *kinds: int) -> list[Defect]:
        """Defects of the given kinds."""
        return [chain.defect for chain in self.chains if chain.defect and chain.defect.kind in kinds]

    def piece(self, name: str) -> Domino:
        """The tile or slab with a name of `feet`."""
        if name == "slab":
            return self.slab
        if name == "decoy":
            return next(chain.slab for chain in self.chains if chain.astray)
        chain = self.chains[int(name.split("_")[1])]
        return chain.starter if name.endswith("_0") else chain.tile

    @cached_property
    def room(self) -> float:
        """Smallest free space along y between tiles of different chains, and between the slabs [m]; negative where they
        overlap."""
        tiles = [name for name in self.feet if name.startswith("tile")]
        pairs = [(a, b) for a, b in itertools.combinations(tiles, 2) if a.split("_")[1] != b.split("_")[1]]
        pairs += [("slab", "decoy")] if "decoy" in self.feet else []
        return min(abs(self.feet[a][1] - self.feet[b][1]) - self._sum_of_widths(a, b) / 2 for a, b in pairs)

    def _sum_of_widths(self, *names: str) -> float:
        return sum(self.piece(name).width for name in names)
