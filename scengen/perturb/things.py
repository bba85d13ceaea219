"""Colours and textures in place of those of things whose look carries no meaning.

`conf/things/<task>.yaml` names their bodies. Other colours keep a distance from those of all other things and of the
table, so that people distinguish them, and from the hue of another thing, which a text may name.
"""

from collections.abc import Collection
from fnmatch import fnmatchcase

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..look.colour import CHROMATIC, chroma, lab, turn
from ..sim.world import scene_geoms

APART = 30.0
"""Distance in CIELAB that other colours keep from those of other things, if it was as large before."""
OTHER_HUE = 50.0
"""Difference of hues that they keep from those of other things, if it was as large before [deg]: red from orange."""
FAR = 45.0
"""Distance in CIELAB from the present colour from which on another one is taken at once."""
TRIES = 100
"""Number of colours that are tried at once."""
ROUNDS = 20
"""Largest number of rounds of `TRIES`; the next one is tried if none of its colours is clear."""
SHARES = np.linspace(0.0, 1.0, 41)[1:, None]
"""Shares of another colour at which it must be clear of others, shape (n, 1)."""
HIDDEN_GROUP = 3
"""Lowest group of geoms that pictures do not show."""
PRINT = "spare_print_"
"""Beginning of the names of spare materials and their textures, with which scenes are compiled."""
PRINTS = 8
"""Number of spare materials: one for each colour of things."""
EDGE = 64
"""Edge of each face of the texture [pixels]."""
FACES = 6
"""Number of faces: textures are cubes, which cover meshes as well."""

Colour = tuple[float, ...]
Path = NDArray[np.float64]
"""Colours in CIELAB at `SHARES`, shape (n, 3)."""


def add_prints(spec: mujoco.MjSpec) -> None:
    """Add the spare materials to a scene."""
    for number in range(PRINTS):
        name = f"{PRINT}{number}"
        texture = spec.add_texture(name=name, type=mujoco.mjtTexture.mjTEXTURE_CUBE, width=EDGE, height=EDGE)
        texture.builtin, texture.rgb1 = mujoco.mjtBuiltin.mjBUILTIN_FLAT, np.ones(3)
        made = spec.add_material(name=name)
        made.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
        made.specular, made.shininess = 0.1, 0.2


def paint(model: mujoco.MjModel, share: float, key: int, bodies: Collection[str]) -> None:
    """Mix the colours of things with others; things of one colour stay of one colour.

    Args:
        share: share of the other colours.
        key: seed of the other colours.
        bodies: patterns of the names of the bodies.
    """
    for rgb, geoms, other in _others(model, key, bodies):
        model.geom_rgba[geoms, :3] = _mixed(rgb, other, np.array(share))


def print_on(
    model: mujoco.MjModel, share: float, key: int, shade: NDArray[np.float64], bodies: Collection[str]
) -> None:
    """Print a pattern of their colours and of others on things. Things of more colours than `PRINTS` stay.

    Args:
        share: share of the other colours.
        key: seed of the other colours.
        shade: 0 where the pattern has another colour and 1 elsewhere, shape (`EDGE`, `EDGE`).
        bodies: patterns of the names of the bodies.
    """
    for number, (rgb, geoms, other) in enumerate(_others(model, key, bodies)[:PRINTS]):
        colours = shade[..., None] * rgb + (1.0 - shade[..., None]) * _mixed(rgb, other, np.array(share))
        material = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MATERIAL, f"{PRINT}{number}")
        start = model.tex_adr[model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB]]
        face = (255.0 * colours).round().astype(np.uint8).ravel()
        model.tex_data[start : start + FACES * face.size] = np.tile(face, FACES)
        model.geom_matid[geoms], model.geom_rgba[geoms, :3] = material, 1.0


def _others(
    model: mujoco.MjModel, key: int, bodies: Collection[str]
) -> list[tuple[NDArray[np.float64], list[int], NDArray[np.float64]]]:
    """Present colour, geoms and another colour of all things whose look carries no meaning."""
    rng, clear = np.random.default_rng(key), _Clear(model, bodies)
    return [(np.array(rgb), geoms, clear.chosen(rng, rgb)) for rgb, geoms in sorted(clear.things.items())]


def _mixed(rgb: NDArray[np.float64], other: NDArray[np.float64], share: NDArray[np.float64]) -> NDArray[np.float64]:
    return (1.0 - share) * rgb + share * other


class _Clear:
    """Choice of colours that are clear of those of other things and of the table."""

    def __init__(self, model: mujoco.MjModel, bodies: Collection[str]):
        free = free_geoms(model, bodies)
        self.things: dict[Colour, list[int]] = {}
        """Geoms whose look carries no meaning, by their colours."""
        for geom in free:
            self.things.setdefault(_colour(model, geom), []).append(geom)
        others = {_colour(model, geom) for geom in [*({*_shown(model)} - {*free}), model.geom("table_top").id]}
        self._others = [lab(colour) for colour in sorted(others)]
        self._ways: dict[Colour, Path] = {rgb: lab(rgb)[None] for rgb in self.things}
        """Colours of these things at `SHARES`; the present ones of those for which nothing is chosen yet."""

    def chosen(self, rng: np.random.Generator, rgb: Colour) -> NDArray[np.float64]:
        """Another colour for things, shape (3,): the first clear one that is `FAR`, or the farthest clear one, or the
        present one if none is clear."""
        best, farthest, before = np.array(rgb), 0.0, lab(rgb)
        for _ in range(ROUNDS):
            for target in rng.uniform(0.05, 0.95, (TRIES, 3)):
                far = float(np.linalg.norm(lab(target) - before))
                if far > farthest and self._is_clear(rgb, lab(_mixed(np.array(rgb), target, SHARES))):
                    best, farthest = target, far
                    if far >= FAR:
                        break
            if farthest:
                break
        self._ways[rgb] = lab(_mixed(np.array(rgb), best, SHARES))
        return best

    def _is_clear(self, rgb: Colour, path: Path) -> bool:
        """Whether a thing stays apart from all others on a path from its present colour."""
        before, ways = lab(rgb), [(lab(each), way) for each, way in self._ways.items() if each != rgb]
        for other, way in [*((each, each[None]) for each in self._others), *ways]:
            away, was = np.linalg.norm(path - way, axis=1).min(), np.linalg.norm(before - other)
            if away < min(APART, was) - 1e-9:
                return False
        return not any(self._has_hue(before, path, other) for other in self._others if chroma(other) >= CHROMATIC)

    @staticmethod
    def _has_hue(before: NDArray[np.float64], path: Path, other: NDArray[np.float64]) -> bool:
        """Whether a thing comes near the hue of another one that it did not have."""
        least = min(OTHER_HUE, float(turn(before, other))) if chroma(before) >= CHROMATIC else OTHER_HUE
        return bool((turn(path, other)[chroma(path) >= CHROMATIC] < least - 1e-9).any())


def free_geoms(model: mujoco.MjModel, bodies: Collection[str]) -> list[int]:
    """Numbers of the opaque geoms of bodies that one of some patterns names."""

    def is_named(geom: int) -> bool:
        name = model.body(model.geom_bodyid[geom]).name
        return any(fnmatchcase(name, pattern) for pattern in bodies)

    return [geom for geom in _shown(model) if model.geom_rgba[geom, 3] == 1.0 and is_named(geom)]


def _shown(model: mujoco.MjModel) -> list[int]:
    """Numbers of the geoms of things that pictures show."""
    every = scene_geoms(model)
    return [geom for geom in every if model.geom_group[geom] < HIDDEN_GROUP and model.geom_rgba[geom, 3] > 0]


def _colour(model: mujoco.MjModel, geom: int) -> Colour:
    return tuple(model.geom_rgba[geom, :3].astype(float).round(3).tolist())
