"""Chains of dominoes that lead to a slab, and the defects that keep the slab standing: where each tile stands.

x runs along the chain, from the middle of an intact one; y is to its left.
"""

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root_scalar

from ..geometry import Vec3
from ..params import check_bounds, param
from .box import Domino

GAP, DRIFT, DECOY, MISSING = range(4)
"""Kinds of defect: a tile beside the chain, spaces that grow, a slab that does not count, a tile that is missing. The
first three are the paper's (App. B, T18)."""


@dataclass(frozen=True, kw_only=True)
class Defect:
    """Why a chain does not reach the slab that counts. Of the values only those that belong to its kind matter."""

    kind: int = param(GAP, "0 gap, 1 drift, 2 decoy, 3 missing", GAP, MISSING)
    place: float = param(0.3, "share of the chain", 0.0, 1.0)
    """Which tile is out of line or missing: 0 is the second tile, 1 the last."""
    offset: float = param(1.3, "tile widths", 1.02, 2.5)
    """How far that tile stands beside the chain."""
    side: int = param(1, "0 right, 1 left", 0, 1)
    stretch: float = param(1.25, "tile heights", 1.02, 2.0)
    """The widest space of a drifting chain, the one before its slab."""

    def __post_init__(self) -> None:
        check_bounds(self)

    def broken(self, count: int) -> int:
        """Index of the tile that is out of line or missing in a chain of `count`; never the first one."""
        return 1 + min(int(self.place * (count - 1)), count - 2)


@dataclass(frozen=True)
class Chain:
    """Tiles in a row with a slab at their end."""

    count: int
    """Tiles, without the slab."""
    gap: float
    """Free space between neighbouring faces of an intact chain [m]."""
    starter: Domino
    """The first tile."""
    tile: Domino
    """All others."""
    slab: Domino
    defect: Defect | None = None

    @property
    def end(self) -> str:
        """What its slab is: a `slab`, or a `decoy` that does not count."""
        return "decoy" if self.defect and self.defect.kind == DECOY else "slab"

    @property
    def gaps(self) -> NDArray[np.float64]:
        """Free spaces, the one before the slab included [m], shape (count,).

        In a drifting chain each space is larger than the one before by the same factor, and their sum is that of an
        intact chain, so that first tiles and slabs stand in rows and only the spacing tells.
        """
        if self.defect is None or self.defect.kind != DRIFT:
            return np.full(self.count, self.gap)
        widest, powers = self.defect.stretch * self.tile.height, np.arange(self.count)[::-1]
        total = self.count * self.gap / widest
        return widest * root_scalar(lambda ratio: np.sum(ratio**powers) - total, bracket=(0.0, 1.0)).root ** powers

    @property
    def feet(self) -> dict[int, Vec3]:
        """Where the tiles that are there stand, by their index, and as `feet[count]` the slab [m].

        The origin is the middle of a chain of equal tiles: a stouter starter grows away from the face that is pushed.
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
    """Parallel chains side by side, the first on the right, whose first tiles stand in one row and slabs in another."""

    chains: tuple[Chain, ...]
    spacing: float
    """Distance between neighbouring chains [m]."""

    @cached_property
    def feet(self) -> dict[str, Vec3]:
        """Where everything stands, from the middle of the middle lane [m].

        `tile_3_0` is the first tile in lane 3, `slab_3` its slab, or `decoy_3`.
        """
        feet = {}
        for k, chain in enumerate(self.chains):
            across = (k - len(self.chains) // 2) * self.spacing * np.array([0.0, 1.0, 0.0])
            for i, foot in chain.feet.items():
                feet[f"{chain.end}_{k}" if i == chain.count else f"tile_{k}_{i}"] = foot + across
        return feet

    def defects(self, *kinds: int) -> list[Defect]:
        """The defects of some kinds."""
        return [chain.defect for chain in self.chains if chain.defect and chain.defect.kind in kinds]

    def piece(self, name: str) -> Domino:
        """The tile or slab of that name."""
        chain = self.chains[int(name.split("_")[1])]
        if not name.startswith("tile"):
            return chain.slab
        return chain.starter if name.endswith("_0") else chain.tile

    @property
    def room(self) -> float:
        """Least free space across the chains between pieces of different ones [m]; negative where they overlap."""
        pairs = [(a, b) for a, b in itertools.combinations(self.feet, 2) if a.split("_")[1] != b.split("_")[1]]
        return min(abs(self.feet[a][1] - self.feet[b][1]) - self._widths(a, b) / 2 for a, b in pairs)

    def _widths(self, *names: str) -> float:
        return sum(self.piece(name).width for name in names)
