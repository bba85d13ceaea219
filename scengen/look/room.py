"""The room: a wooden table with legs on a tiled floor between walls, under a key light and two fills.

Nothing of it has mass or collides, and it is the same for all scenarios.
"""

import itertools

import mujoco
import numpy as np

from . import textures
from .finish import WOOD, Finish, finish_of

Rgba = tuple[float, float, float, float]
TABLE = Finish("look_table", 0.15, 0.4, 0.0, textures.planks, 0.8)
FLOOR = Finish("look_floor", 0.05, 0.2, 0.0, textures.slabs, 1.2)
PLASTER = Finish("look_plaster")
TABLE_COLOUR = (0.69, 0.62, 0.55, 1.0)
"""Lightest colour of the table: darker than tiles and boards of birch, lighter than steel."""
FLOOR_COLOUR = (0.50, 0.51, 0.53, 1.0)
WALL_COLOUR = (0.80, 0.82, 0.82, 1.0)
LEG_COLOUR = (0.42, 0.34, 0.27, 1.0)
HIDDEN_GROUP = 3
"""Lowest group of geoms that pictures do not show."""
LEG = 0.025
"""Half the thickness of a leg [m]."""
INSET = 0.04
"""Distance of the legs from the edges of the table [m]."""
WALLS = {
    "back": ((-1.9, 0.0), (1.0, 0.0)),
    "left": ((0.0, 2.6), (0.0, -1.0)),
    "right": ((0.0, -2.6), (0.0, 1.0)),
    "front": ((3.0, 0.0), (-1.0, 0.0)),
}
"""Place [m] and direction inwards of each wall, which is farther than any camera."""
ROOM_HEIGHT = 3.4
"""Height of the walls [m]."""
WALL_LENGTH = 6.0
"""Length of the walls [m]: that of the floor."""
AIM = np.array([0.0, 0.0, 0.8])
"""Place at which lights aim: the middle of the table [m]."""
KEY_POS = (1.0, -1.2, 3.2)
"""Place of the key light [m]: from there the arm throws its shadow behind what it handles."""
KEY_COLOUR = (0.50, 0.49, 0.47)
"""Light of the key: warm, and less than half of all light, so that shadows are not black."""
FILLS = (((-1.0, 1.8, 2.4), 0.14), ((1.8, 1.4, 2.2), 0.12))
"""Place [m] and light of each fill, from the other sides; they throw no shadows."""
AMBIENT = 0.38
"""Light from everywhere."""
HEADLIGHT = 0.08
"""Light from the camera."""
CONE = 60.0
"""Half angle of the key light's cone, which takes in the whole room [deg]."""
SHADOW_CONE = 15.0
"""Half angle of the cone in which shadows are drawn [deg]: table and arm. A smaller one has finer shadows."""


def dress(spec: mujoco.MjSpec) -> None:
    """Give a scene the look of the room."""
    things = [geom for geom in spec.geoms if not geom.material and geom.group < HIDDEN_GROUP]
    finishes = {_cover(geom, *_surface(geom)) for geom in things} | _furnish(spec)
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
        geom.rgba = np.asarray(rgba, np.float32)
    return finish


def _furnish(spec: mujoco.MjSpec) -> set[Finish]:
    """Add legs to the table, and walls. Returns their finishes."""
    top = spec.geom("table_top")
    reach, half = float(top.size[0]) - INSET, (float(spec.body("table").pos[2]) - float(top.size[2])) / 2
    for x, y in itertools.product((-reach, reach), repeat=2):
        leg = _visual(spec.body("table"), mujoco.mjtGeom.mjGEOM_BOX)
        leg.size, leg.pos = [LEG, LEG, half], [x, y, -float(top.size[2]) - half]
        _cover(leg, WOOD, LEG_COLOUR)
    for at, inwards in WALLS.values():
        wall, normal, turn = (
            _visual(spec.worldbody, mujoco.mjtGeom.mjGEOM_PLANE),
            np.array([*inwards, 0.0]),
            np.empty(4),
        )
        frame = np.stack([[0.0, 0.0, 1.0], np.cross(normal, [0.0, 0.0, 1.0]), normal], axis=1)
        mujoco.mju_mat2Quat(turn, frame.ravel())
        wall.size, wall.pos, wall.quat = [ROOM_HEIGHT / 2, WALL_LENGTH / 2, 1.0], [*at, ROOM_HEIGHT / 2], turn
        _cover(wall, PLASTER, WALL_COLOUR)
    return {WOOD, PLASTER}


def _visual(body: mujoco.MjsBody, kind: mujoco.mjtGeom) -> mujoco.MjsGeom:
    """A new geom of a body, without mass or collisions."""
    return body.add_geom(type=kind, group=1, contype=0, conaffinity=0, mass=0)


def _light(spec: mujoco.MjSpec) -> None:
    """Replace the lights, and the sky, which walls hide."""
    for light in list(spec.lights):
        spec.delete(light)
    key = _lamp(spec, KEY_POS, KEY_COLOUR, CONE)
    key.castshadow, key.specular = True, [0.6] * 3
    for place, light in FILLS:
        _lamp(spec, place, (light,) * 3, 90.0)
    spec.visual.map.shadowscale = SHADOW_CONE / CONE
    head = spec.visual.headlight
    head.ambient, head.diffuse = np.full(3, AMBIENT, np.float32), np.full(3, HEADLIGHT, np.float32)
    head.specular = np.zeros(3, np.float32)
    for texture in list(spec.textures):
        if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
            spec.delete(texture)


def _lamp(spec: mujoco.MjSpec, place: tuple[float, ...], colour: tuple[float, ...], cone: float) -> mujoco.MjsLight:
    """A new lamp that aims at the table, without shadows or highlights."""
    lamp = spec.worldbody.add_light(pos=place, dir=AIM - place, castshadow=False)
    lamp.diffuse, lamp.specular, lamp.cutoff, lamp.exponent = colour, [0.0] * 3, cone, 0.0
    return lamp
