"""The room: a wooden table with legs on a tiled floor between walls, under a key light and two fills.

Nothing of it has mass or collides, and it is the same for all scenarios.
"""

import itertools

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from . import textures
from .finish import WOOD, Finish, finish_of

Rgba = tuple[float, float, float, float]
TABLE = Finish("look_table", 0.15, 0.4, 0.0, textures.planks, 0.8)
"""Finish of the table top."""
FLOOR = Finish("look_floor", 0.05, 0.2, 0.0, textures.slabs, 1.2)
"""Finish of the floor."""
PLASTER = Finish("look_plaster")
"""Finish of the walls."""
TABLE_COLOUR: Rgba = (0.62, 0.555, 0.49, 1.0)
"""Lightest colour of the table: darker than ivory tiles and birch, lighter than steel, greyer than wooden things."""
FLOOR_COLOUR: Rgba = (0.50, 0.51, 0.53, 1.0)
"""Lightest colour of the floor."""
WALL_COLOUR: Rgba = (0.80, 0.82, 0.82, 1.0)
"""Colour of the walls."""
LEG_COLOUR: Rgba = (0.42, 0.34, 0.27, 1.0)
"""Lightest colour of the table's legs."""
HIDDEN_GROUP = 3
"""Lowest group of geoms that pictures do not show."""
HALF_LEG = 0.025
"""Half the thickness of a leg [m]."""
INSET = 0.04
"""Distance of the middles of the legs from the edges of the table [m]."""
WALLS = (((-1.9, 0.0), (1.0, 0.0)), ((0.0, 3.0), (0.0, -1.0)), ((0.0, -3.0), (0.0, 1.0)), ((3.0, 0.0), (-1.0, 0.0)))
"""Place [m] of each wall and its direction inwards. Cameras of the table are inside; from outside walls are clear."""
WALL_NAMES = tuple(f"look_wall_{number}" for number in range(len(WALLS)))
"""Names of the walls."""
ROOM_HEIGHT = 3.4
"""Height of the walls [m]."""
WALL_LENGTH = 6.0
"""Length of the walls [m]: that of the floor."""
AIM = np.array([0.0, 0.0, 0.8])
"""Place at which lights aim: the middle of the table [m]."""
KEY_PLACE = (1.0, -1.2, 3.2)
"""Place of the key light [m]: from there the arm throws its shadow away from cameras in front of the table."""
KEY_LIGHT = (0.45, 0.44, 0.42)
"""Light of the key: warm, and less than half of all light, so that shadows are not black."""
KEY_HIGHLIGHT = 0.6
"""Light of the key for highlights. They show what is glossy; a stronger one bleaches colours."""
FILLS = (((-1.0, 1.8, 2.4), 0.14), ((2.4, 0.8, 1.5), 0.18))
"""Place [m] and light of each fill, on the other sides. Fills throw no shadows: each would cost as much as the key."""
AMBIENT = 0.42
"""Light from everywhere."""
HEADLIGHT = 0.08
"""Light from the camera."""
CONE = 60.0
"""Half angle of the key light's cone, which takes in the whole room [deg]."""
FILL_CONE = 90.0
"""Half angle of the cone of a fill [deg]."""
SHADOW_CONE = 15.0
"""Half angle of the cone in which shadows are drawn [deg]: table and arm. A smaller one has finer shadows."""


def dress(spec: mujoco.MjSpec) -> None:
    """Give a scene the look of the room."""
    surfaces = [geom for geom in spec.geoms if not geom.material and geom.group < HIDDEN_GROUP]
    finishes = {_cover(geom, *_surface(geom)) for geom in surfaces}
    finishes |= {_add_leg(spec, x, y) for x, y in itertools.product((-1.0, 1.0), repeat=2)}
    finishes |= {_add_wall(spec, name, *wall) for name, wall in zip(WALL_NAMES, WALLS, strict=True)}
    for finish in sorted(finishes, key=lambda finish: finish.name):
        finish.add(spec)
    _light(spec)


def _surface(geom: mujoco.MjsGeom) -> tuple[Finish, Rgba | None]:
    """Finish of a geom of the scene, and its colour if that is not the scene's."""
    surroundings = {"table_top": (TABLE, TABLE_COLOUR), "floor": (FLOOR, FLOOR_COLOUR)}
    return surroundings.get(geom.name) or (finish_of(geom), None)


def _cover(geom: mujoco.MjsGeom, finish: Finish, rgba: Rgba | None) -> Finish:
    """Give a geom a finish, and another colour unless it is None."""
    geom.material = finish.name
    if rgba is not None:
        geom.rgba = np.array(rgba, np.float32)
    return finish


def _add_leg(spec: mujoco.MjSpec, x: float, y: float) -> Finish:
    """Add a leg below the table. `x` and `y` are signs.

    It is part of the world: a further geom of the table would have its contacts found in another way, which changes
    bits.
    """
    table, top = spec.body("table").pos, spec.geom("table_top").size
    leg, half = _visual(spec.worldbody, mujoco.mjtGeom.mjGEOM_BOX), (table[2] - top[2]) / 2
    leg.size = np.array([HALF_LEG, HALF_LEG, half])
    leg.pos = np.array([table[0] + x * (top[0] - INSET), table[1] + y * (top[1] - INSET), half])
    return _cover(leg, WOOD, LEG_COLOUR)


def _add_wall(spec: mujoco.MjSpec, name: str, place: tuple[float, float], inwards: tuple[float, float]) -> Finish:
    """Add a wall: a plane with its x axis up and its z axis inwards."""
    wall, up, normal, turn = (
        _visual(spec.worldbody, mujoco.mjtGeom.mjGEOM_PLANE),
        np.eye(3)[2],
        np.zeros(3),
        np.empty(4),
    )
    normal[:2] = inwards
    mujoco.mju_mat2Quat(turn, np.stack([up, np.cross(normal, up), normal], axis=1).ravel())
    wall.name = name
    wall.size, wall.quat = np.array([ROOM_HEIGHT / 2, WALL_LENGTH / 2, 1.0]), turn
    wall.pos = np.array([*place, ROOM_HEIGHT / 2])
    return _cover(wall, PLASTER, WALL_COLOUR)


def _visual(body: mujoco.MjsBody, kind: mujoco.mjtGeom) -> mujoco.MjsGeom:
    """A new geom of a body, without mass or collisions."""
    return body.add_geom(type=kind, group=1, contype=0, conaffinity=0, mass=0)


def _light(spec: mujoco.MjSpec) -> None:
    """Replace the lights, and delete the sky, which walls hide."""
    for light in list(spec.lights):
        spec.delete(light)
    key = _add_lamp(spec, KEY_PLACE, KEY_LIGHT, CONE)
    key.castshadow, key.specular = True, np.full(3, KEY_HIGHLIGHT, np.float32)
    for place, light in FILLS:
        _add_lamp(spec, place, (light,) * 3, FILL_CONE)
    spec.visual.map.shadowscale = SHADOW_CONE / CONE
    head = spec.visual.headlight
    head.ambient, head.diffuse, head.specular = (np.full(3, x, np.float32) for x in (AMBIENT, HEADLIGHT, 0.0))
    for texture in list(spec.textures):
        if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
            spec.delete(texture)


def _add_lamp(spec: mujoco.MjSpec, place: tuple[float, float, float], light: ArrayLike, cone: float) -> mujoco.MjsLight:
    """Add a lamp that aims at the table, without shadows or highlights."""
    lamp = spec.worldbody.add_light(castshadow=False, cutoff=cone, exponent=0.0)
    lamp.pos, lamp.dir = np.array(place), AIM - np.array(place)
    lamp.diffuse, lamp.specular = np.array(light, np.float32), np.zeros(3, np.float32)
    return lamp
