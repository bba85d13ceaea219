"""Bars and posts with a square base."""

from dataclasses import dataclass

import numpy as np

from ..geometry import Vec3
from ..params import param
from .box import Cube


@dataclass(frozen=True, kw_only=True)
class Bar(Cube):
    """A cube, or a bar or post as wide as a cube."""

    long: float = param(1.0, "1", 1.0, 2.5)
    """Length along y, in widths."""
    high: float = param(1.0, "1", 1.0, 3.0)
    """Height, in widths."""

    @property
    def size(self) -> Vec3:
        return self.edge * np.array([1.0, self.long, self.high])
