"""Distractors: things that pictures show and the physics does not know, on the table.

A scene that may have them is compiled with spare geoms, which are invisible, have no mass and do not collide.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..assets.prop import TABLE_HALF, TABLE_TOP
from ..look.looks import Look
from ..sim.world import scene_geoms
from .things import add_prints

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
MOST_MARGIN = 0.16
"""Largest such distance [m]: things that are higher than `MARGIN` may topple as far as they are high."""
TRIES = 400
"""Number of places that are tried."""


def with_spares(look: Look) -> Look:
    """A look whose scenes have spare geoms, and spare materials."""

    def change(spec: mujoco.MjSpec) -> None:
        look.change(spec)
        add_prints(spec)
        for number in range(SPARES):
            spare = spec.worldbody.add_geom(name=f"{SPARE}{number}", group=1, contype=0, conaffinity=0, mass=0)
            spare.size, spare.pos = np.full(3, HALF[0]), np.array([0.0, 0.0, -1.0])
            spare.rgba = np.zeros(4, np.float32)

    return replace(look, change=change)


def spare_elements() -> Iterator[dict[str, str]]:
    """Attributes of the spare geoms in MJCF, for scenes that other programs compile."""
    for number in range(SPARES):
        unseen = {"pos": "0 0 -1", "rgba": "0 0 0 0", "group": "1", "contype": "0", "conaffinity": "0", "mass": "0"}
        yield {"name": f"{SPARE}{number}", "type": "sphere", "size": f"{HALF[0]}", **unseen}


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
    rng, taken, free = np.random.default_rng(key), _taken(model), spares(model)[:number]
    for _ in range(TRIES):
        half, yaw, place = rng.uniform(*HALF, 3), rng.uniform(0.0, np.pi), rng.uniform(-EDGE, EDGE, 2)
        colour, shape = COLOURS[int(rng.integers(len(COLOURS)))], SHAPES[int(rng.integers(len(SHAPES)))]
        if not free:
            return
        reach = float(np.linalg.norm(half[:2]))
        if any(area.distance(place) < reach + area.margin for area in taken):
            continue
        spare, is_round = free.pop(0), shape == mujoco.mjtGeom.mjGEOM_CYLINDER  # its size: radius, half the height
        height = half[1] if is_round else half[2]
        model.geom_type[spare], model.geom_size[spare] = shape, [*half[:2], 0.0] if is_round else half
        model.geom_pos[spare], model.geom_rgba[spare] = [*place, TABLE_TOP + height], [*colour, 1.0]
        model.geom_quat[spare] = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
        taken.append(_Area(place, half[:2], MARGIN))


@dataclass(frozen=True)
class _Area:
    """A rectangle along the edges of the table that something takes, seen from above."""

    middle: NDArray[np.float64]
    """Its middle [m]."""
    half: NDArray[np.float64]
    """Half its edges [m]."""
    margin: float
    """Distance that distractors keep [m]."""

    def distance(self, place: NDArray[np.float64]) -> float:
        """Distance of a place [m]; 0 within."""
        return float(np.linalg.norm(np.maximum(np.abs(place - self.middle) - self.half, 0.0)))


def _taken(model: mujoco.MjModel) -> list[_Area]:
    """What the things above the table take at the start."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    above = (g for g in scene_geoms(model) if data.geom_xpos[g, 2] + model.geom_rbound[g] > TABLE_TOP)
    return [_area(model, data, geom) for geom in above]


def _area(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> _Area:
    """What a geom takes. It may topple as far as it is high."""
    half = np.abs(data.geom_xmat[geom].reshape(3, 3)) @ model.geom_aabb[geom, 3:]
    height = float(data.geom_xpos[geom, 2] + half[2] - TABLE_TOP)
    return _Area(data.geom_xpos[geom, :2].copy(), half[:2], min(max(height, MARGIN), MOST_MARGIN))


def in_the_way(model: mujoco.MjModel, data: mujoco.MjData, moving: Iterable[int], margin: float) -> bool:
    """Whether a distractor is closer than a margin [m] to one of some geoms now."""
    spot = np.zeros(6)
    pairs = ((one, other) for one in visible(model) for other in moving)
    return any(mujoco.mj_geomDistance(model, data, one, other, 2 * margin, spot) < margin for one, other in pairs)
