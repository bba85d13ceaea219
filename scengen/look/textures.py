"""Textures made of numbers: square tiles that repeat without a seam, each from a separate seed.

They multiply the colour of what carries them, so that a thing keeps the colour that its scene gives it.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

Texture = NDArray[np.uint8]
"""Shape (edge, edge, 3), RGB."""
Field = NDArray[np.float64]
"""Numbers of a square tile, shape (edge, edge)."""


def noise(rng: np.random.Generator, edge: int, cells: tuple[int, int], octaves: int) -> Field:
    """Value noise from 0 to 1 that repeats without a seam.

    Args:
        edge: edge of the tile [pixels].
        cells: cells of the coarsest octave along rows and columns; each octave doubles both and halves its weight.
    """
    found, weights = np.zeros((edge, edge)), 0.5 ** np.arange(octaves)
    for octave, weight in enumerate(weights):
        rows, columns = (min(edge, cell << octave) for cell in cells)
        found += weight * _smooth(rng.random((rows, columns)), edge)
    return found / weights.sum()


def _smooth(grid: Field, edge: int) -> Field:
    """A grid that is interpolated smoothly to a tile."""
    for axis in (0, 1):
        at = np.arange(edge) * grid.shape[axis] / edge
        low, share = at.astype(int), at % 1.0
        share = (share * share * (3.0 - 2.0 * share)).reshape((-1, 1) if axis == 0 else (1, -1))
        following = np.take(grid, (low + 1) % grid.shape[axis], axis)
        grid = np.take(grid, low, axis) * (1.0 - share) + following * share
    return grid


def _tinted(shade: Field, dark: tuple[float, float, float]) -> Texture:
    """A tile that is white where `shade` is 1 and has the colour `dark` where it is 0."""
    mixed = np.asarray(dark) + (1.0 - np.asarray(dark)) * np.clip(shade, 0.0, 1.0)[..., None]
    return (255.0 * mixed).round().astype(np.uint8)


def _rings(rng: np.random.Generator, edge: int, count: float) -> Field:
    """Year rings along the columns, from 0 to 1."""
    return 0.5 + 0.5 * np.cos(2.0 * np.pi * count * noise(rng, edge, (6, 1), 4))


@cache
def planks(edge: int = 512, boards: int = 6) -> Texture:
    """Boards side by side along the columns, with year rings, fibres and joints."""
    rng, shade = np.random.default_rng(1), np.empty((edge, edge))
    fibres = noise(rng, edge, (96, 3), 3)
    for board in range(boards):
        rows = slice(board * edge // boards, (board + 1) * edge // boards)
        tone, rings = rng.uniform(-0.10, 0.10), _rings(rng, edge, 7.0)
        shade[rows] = (0.30 + tone + 0.18 * rings + 0.55 * fibres)[rows]
        shade[rows.start : rows.start + 2] *= 0.4
    return _tinted(shade, (0.64, 0.58, 0.52))


@cache
def grain(edge: int = 128) -> Texture:
    """Wood of one piece along the columns."""
    rng = np.random.default_rng(2)
    return _tinted(0.4 * _rings(rng, edge, 4.0) + 0.6 * noise(rng, edge, (32, 2), 2), (0.86, 0.80, 0.72))


@cache
def fibres(edge: int = 128) -> Texture:
    """Fibres of cardboard."""
    return _tinted(noise(np.random.default_rng(3), edge, (32, 32), 3), (0.84, 0.84, 0.84))


@cache
def weave(edge: int = 128) -> Texture:
    """A whole mat: a weave, and a dark hem along its edges."""
    at = np.arange(edge)
    threads = 0.80 + 0.20 * ((at[:, None] // 4 + at // 4) % 2)
    inside = np.minimum(at, edge - 1 - at) >= edge // 16
    return _tinted(np.where(inside[:, None] & inside, threads, 0.15), (0.45, 0.45, 0.45))


@cache
def outline(edge: int = 128) -> Texture:
    """A whole sheet with a dark line along its edges."""
    at = np.arange(edge)
    depth = np.minimum.outer(*[np.minimum(at, edge - 1 - at)] * 2)
    return _tinted(np.where((depth >= 4) & (depth < 9), 0.0, 1.0), (0.25, 0.25, 0.25))


@cache
def slabs(edge: int = 256, across: int = 2) -> Texture:
    """Square slabs of a floor, with joints."""
    rng, size = np.random.default_rng(4), edge // across
    tones = rng.uniform(-0.08, 0.08, (across, across))
    shade = 0.35 + 0.55 * noise(rng, edge, (6, 6), 5) + np.kron(tones, np.ones((size, size)))
    joint = np.arange(edge) % size < 2
    shade[joint], shade[:, joint] = 0.0, 0.0
    return _tinted(shade, (0.70, 0.70, 0.70))
