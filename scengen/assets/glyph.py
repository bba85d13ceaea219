"""Capital letters as strokes: scenes do not refer to files, so they cannot use fonts."""

from collections.abc import Iterator
from itertools import pairwise

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from ..geometry import Vec3
from .prop import Rgba, shown

GRID_WIDTH = 4
"""Last column of the grid on which the strokes are drawn; the lower left corner is (0, 0)."""
GRID_HEIGHT = 6
"""Last row of the grid."""
STROKES = {
    "A": "00 04 26 44 40,03 43",
    "B": "00 06 46 40 00,03 43",
    "C": "40 00 06 46",
    "D": "00 06 26 44 42 20 00",
    "E": "40 00 06 46,03 33",
    "F": "00 06 46,03 33",
    "G": "23 43 40 00 06 46",
    "H": "00 06,40 46,03 43",
    "I": "20 26",
    "J": "02 00 40 46",
    "K": "00 06,46 03 40",
    "L": "06 00 40",
    "M": "00 06 23 46 40",
    "N": "00 06 40 46",
    "O": "00 40 46 06 00",
    "P": "00 06 46 43 03",
    "Q": "00 40 46 06 00,22 40",
    "R": "00 06 46 43 03,23 40",
    "S": "00 40 43 03 06 46",
    "T": "20 26,06 46",
    "U": "06 00 40 46",
    "V": "06 20 46",
    "W": "06 10 23 30 46",
    "X": "00 46,06 40",
    "Y": "06 23 46,23 20",
    "Z": "06 46 00 40",
}
"""Polylines of every letter, separated by commas. Each point is two digits, column and row."""
PRINT_THICKNESS = 0.0008
"""Height of a letter above the face on which it is written [m]: flat as print, but drawn in front of the face."""


def lines(letter: str) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Both ends of every stroke, in units of the letter's height, from its middle; each of shape (2,).

    Raises:
        ValueError: it is not a capital letter.
    """
    if letter not in STROKES:
        raise ValueError(f"no strokes for {letter!r}; known: {''.join(STROKES)}")
    for line in STROKES[letter].split(","):
        points = [
            (np.array([int(c), int(r)]) - [GRID_WIDTH / 2, GRID_HEIGHT / 2]) / GRID_HEIGHT for c, r in line.split()
        ]
        yield from pairwise(points)


def write(
    body: mujoco.MjsBody, letter: str, at: ArrayLike, height: float, weight: float, rgba: Rgba, name: str
) -> None:
    """Write a letter flat on a body. Its upper end points to +x, and its lines run to -y.

    Args:
        at: middle of the letter on the face, in the body's axes [m].
        height: height of the letter [m].
        weight: half the width of the strokes [m].
        name: prefix of the names of the strokes.
    """
    middle = np.asarray(at, float)
    for number, (begin, end) in enumerate(lines(letter)):
        here, there = (middle + height * _from_page(point) for point in (begin, end))
        along = there - here
        half = float(np.linalg.norm(along)) / 2
        angle = float(np.arctan2(along[1], along[0])) / 2
        turn, size = [np.cos(angle), 0.0, 0.0, np.sin(angle)], [half + weight, weight, PRINT_THICKNESS]
        shown(body, f"{name}_{number}", rgba, size=size, pos=(here + there) / 2, quat=turn)


def _from_page(point: np.ndarray) -> Vec3:
    """A point of the page in the axes of the body: up the page is +x, along a line is -y."""
    return np.array([point[1], -point[0], 0.0])
