"""Printed labels of packages: coloured bands and a word, in thin visual geoms, because scenes do not refer to files."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from ..geometry import UP, Vec3
from .glyph import GRID_HEIGHT, GRID_WIDTH, lines
from .prop import Rgba, shown

PRINT = 0.0003
"""Height of one layer of print above what is below it [m]: thinner layers flicker in pictures."""
SPACING = 0.35
"""Distance between letters, in heights of a letter."""
WEIGHT = 0.08
"""Half the width of a stroke, in heights of a letter."""

Surface = Callable[[float, float], tuple[Vec3, Vec3]]
"""Point [m] and outward normal of a surface, from the distances to the right of and above the middle of a page [m]."""


@dataclass(frozen=True)
class Label:
    """Print on a package."""

    word: str
    """Capital letters."""
    ink: Rgba
    """Colour of the word and of the bands."""
    ground: Rgba
    """Colour of the panel behind the word."""


def label_box(body: mujoco.MjsBody, size: Vec3, label: Label) -> None:
    """Print on a box whose origin is the middle of its base: a band around both ends, and the word on both broad faces.

    Args:
        size: edges along x, y and z [m]; one level edge is the shortest.
    """
    short = int(np.argmin(size[:2]))
    middle = size[2] / 2 * UP
    long = 1 - short if size[1 - short] > size[2] else 2
    for name, end in (("low", -1), ("high", 1)):
        half = size / 2 + PRINT
        half[long] = 0.05 * size[long]
        shown(body, f"band_{name}", label.ink, size=half, pos=middle + end * 0.40 * size[long] * np.eye(3)[long])
    panel = 0.40 * size
    panel[long], panel[short] = 0.30 * size[long], size[short] / 2 + PRINT
    shown(body, "panel", label.ground, size=panel, pos=middle)
    across, up = (2 * panel[1 - short], 2 * panel[2])
    for name, side in (("front", 1), ("back", -1)):
        normal = side * np.eye(3)[short]
        right = np.cross(UP, normal)

        def face(x: float, z: float, normal: Vec3 = normal, right: Vec3 = right) -> tuple[Vec3, Vec3]:
            return middle + (size[short] / 2 + PRINT) * normal + x * right + z * UP, normal

        _write(body, name, label, face, min(0.85 * across / _aspect(label.word), 0.6 * up))


def label_can(body: mujoco.MjsBody, radius: float, height: float, label: Label) -> None:
    """Print on a can whose origin is the middle of its base: two bands, a panel, and the word on both sides.

    Args:
        radius: radius of the wall [m].
        height: height of the can [m].
    """
    cylinder = mujoco.mjtGeom.mjGEOM_CYLINDER
    for name, share, middle, rgba in (
        ("band_low", 0.05, 0.15, label.ink),
        ("panel", 0.28, 0.5, label.ground),
        ("band_high", 0.05, 0.85, label.ink),
    ):
        shown(body, name, rgba, type=cylinder, size=[radius + PRINT, share * height, 0.0], pos=middle * height * UP)
    letters = min(math.pi / 2 * radius / _aspect(label.word), 0.4 * height)
    for name, azimuth in (("front", 0.0), ("back", math.pi)):

        def wall(x: float, z: float, azimuth: float = azimuth) -> tuple[Vec3, Vec3]:
            angle = azimuth + x / radius
            normal = np.array([math.cos(angle), math.sin(angle), 0.0])
            return (radius + PRINT) * normal + (height / 2 + z) * UP, normal

        _write(body, name, label, wall, letters)


def _aspect(word: str) -> float:
    """Length of a word over the height of its letters."""
    return len(word) * GRID_WIDTH / GRID_HEIGHT + (len(word) - 1) * SPACING


def _write(body: mujoco.MjsBody, name: str, label: Label, surface: Surface, height: float) -> None:
    """Write a word on a surface, from left to right, around the middle of the page.

    Args:
        height: height of the letters [m].
    """
    step = height * (GRID_WIDTH / GRID_HEIGHT + SPACING)
    first = -step * (len(label.word) - 1) / 2
    for place, letter in enumerate(label.word):
        for number, ends in enumerate(lines(letter)):
            (a, _), (b, _) = (surface(first + place * step + height * x, height * z) for x, z in ends)
            at = (ends[0] + ends[1]) / 2
            middle, normal = surface(first + place * step + height * at[0], height * at[1])
            along = (b - a) / np.linalg.norm(b - a)
            turn = np.empty(4)
            mujoco.mju_mat2Quat(turn, np.stack([along, np.cross(normal, along), normal], axis=1).ravel())
            size = [float(np.linalg.norm(b - a)) / 2 + WEIGHT * height, WEIGHT * height, PRINT]
            shown(body, f"{name}_{place}_{number}", label.ink, size=size, pos=middle, quat=turn)
