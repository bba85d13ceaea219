"""Distractors: things that pictures show and the physics does not know, on the table.

A scene that may have them is compiled with spare geoms, which are invisible, have no mass and do not collide.
"""

from collections.abc import Iterable
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..assets.prop import TABLE_HALF, TABLE_TOP
from ..look.looks import Look
from ..sim.world import scene_geoms

SPARE = "spare_"
"""Beginning of the names of the spare geoms."""
SPARES = 8
"""Number of spare geoms."""
COLOURS = ((0.42, 0.26, 0.52), (0.40, 0.29, 0.20), (0.33, 0.34, 0.36), (0.84, 0.80, 0.70), (0.55, 0.42, 0.47))
"""Colours of distractors: violet, brown, grey, cream, mauve. No instruction names one of them."""
SHAPES = (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_ELLIPSOID)
"""Shapes of distractors."""
HALF = (0.012, 0.028)
"""Least and largest half size [m]."""
EDGE = TABLE_HALF - 0.04
"""Largest coordinate of the middle of a distractor [m]."""
MARGIN = 0.08
"""Least distance of a distractor from things and other distractors at the start [m]."""
TRIES = 400
"""Number of places that are tried."""


def with_spares(look: Look) -> Look:
    """A look whose scenes have spare geoms."""

    def change(spec: mujoco.MjSpec) -> None:
        look.change(spec)
        for number in range(SPARES):
            spare = spec.worldbody.add_geom(name=f"{SPARE}{number}", group=1, contype=0, conaffinity=0, mass=0)
            spare.size, spare.pos = np.full(3, HALF[0]), np.array([0.0, 0.0, -1.0])
            spare.rgba = np.zeros(4, np.float32)

    return replace(look, change=change)


def spares(model: mujoco.MjModel) -> list[int]:
    """Numbers of the spare geoms of a compiled scene."""
    return [geom for geom in range(model.ngeom) if model.geom(geom).name.startswith(SPARE)]


def visible(model: mujoco.MjModel) -> list[int]:
    """Numbers of the distractors that pictures show."""
    return [geom for geom in spares(model) if model.geom_rgba[geom, 3] > 0]


def put(model: mujoco.MjModel, number: int, key: int) -> None:
    """Show some distractors where nothing else is at the start; with more of them the others stay.

    Args:
        number: how many. Where things leave no place, there are fewer.
        key: seed of their places, shapes and colours.
    """
    rng, taken, free = np.random.default_rng(key), _taken(model), iter(spares(model)[:number])
    spare = next(free, None)
    for _ in range(TRIES):
        half, yaw = rng.uniform(*HALF, 3), rng.uniform(0.0, np.pi)
        place, colour, shape = (
            rng.uniform(-EDGE, EDGE, 2),
            int(rng.integers(len(COLOURS))),
            int(rng.integers(len(SHAPES))),
        )
        reach = float(np.linalg.norm(half[:2]))
        if spare is None:
            return
        if any(np.linalg.norm(place - other) < reach + radius + MARGIN for other, radius in taken):
            continue
        model.geom_type[spare], model.geom_size[spare] = SHAPES[shape], half
        if SHAPES[shape] == mujoco.mjtGeom.mjGEOM_CYLINDER:
            half[2] = half[1]  # radius and half length
        model.geom_pos[spare] = [*place, TABLE_TOP + half[2]]
        model.geom_quat[spare] = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
        model.geom_rgba[spare] = [*COLOURS[colour], 1.0]
        taken.append((place, reach))
        spare = next(free, None)


def _taken(model: mujoco.MjModel) -> list[tuple[NDArray[np.float64], float]]:
    """Place [m] and radius [m] of each thing above the table at the start, seen from above."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    above = (g for g in scene_geoms(model) if data.geom_xpos[g, 2] + model.geom_rbound[g] > TABLE_TOP)
    return [(data.geom_xpos[g, :2].copy(), _radius(model, data, g)) for g in above]


def _radius(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> float:
    """Radius of the circle around a geom's box, seen from above [m]."""
    half = np.abs(data.geom_xmat[geom].reshape(3, 3)) @ model.geom_aabb[geom, 3:]
    return float(np.linalg.norm(half[:2]))


def in_the_way(model: mujoco.MjModel, data: mujoco.MjData, moving: Iterable[int], margin: float) -> bool:
    """Whether a distractor is closer than a margin [m] to one of some geoms now."""
    spot = np.zeros(6)
    pairs = ((one, other) for one in visible(model) for other in moving)
    return any(mujoco.mj_geomDistance(model, data, one, other, 2 * margin, spot) < margin for one, other in pairs)
