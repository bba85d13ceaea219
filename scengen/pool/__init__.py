"""Pools of certified scenarios on disk: how they are written, read and searched."""

from .pool import Pool
from .row import PoolRow

__all__ = ["Pool", "PoolRow"]
