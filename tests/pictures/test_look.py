"""Looks change pictures alone: the physics keeps its bits, and colours stay what they are."""

import itertools
from collections import defaultdict
from contextlib import closing

import mujoco
import numpy as np
import pytest
from helpers import REFERENCE, pictures_are_possible

from scengen import list_tasks
from scengen.compose import load_task
from scengen.envs.gym import PoolEnv
from scengen.errors import BadConfig, UnknownName
from scengen.look.looks import LOOKS, PLAIN, ROOM, look_named, look_of, look_told
from scengen.perturb.perturbation import arrays
from scengen.pictures.render import Camera, things
from scengen.pool import Pool
from scengen.sim.embodiment import compose
from scengen.sim.world import World
from scengen.validate.certify import certify
from scengen.validate.rebuilt import rebuild

drawing = pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL")
VIEWS = ("agentview", "frontview", "sideview", "birdview")
MIN_PIXELS = 30
"""Least number of pixels of a colour whose median is compared."""
MIN_CHROMA = 25.0
"""Least chroma of a stored colour that has a hue to be recognised."""
MAX_TURN = 25.0
"""Largest difference of the hue of a thing in a picture from that of its stored colour [deg]."""
APART = 30.0
"""Distance of stored colours from which on pictures must show two colours."""
MIN_DISTANCE = 12.0
"""Least distance of such colours in pictures: five times what people just see."""
MIN_FROM_TABLE = 8.0
"""Least distance of a colour of a thing in pictures from the table."""


def lab(rgb):
    """CIELAB of sRGB colours from 0 to 1, shape (..., 3), under D65."""
    rgb = np.asarray(rgb, float)
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = linear @ np.array([[0.4124, 0.2126, 0.0193], [0.3576, 0.7152, 0.1192], [0.1805, 0.0722, 0.9505]])
    share = xyz / [0.9505, 1.0, 1.089]
    x, y, z = np.moveaxis(np.where(share > 0.008856, np.cbrt(share), 7.787 * share + 16 / 116), -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def hue(colour):
    return np.degrees(np.arctan2(colour[..., 2], colour[..., 1]))


def scene(name):
    task = load_task(name)
    return rebuild(task.draw("id", 0, 0).scenario), task.embodiment


def pixels_by_colour(eye):
    """Pixels of the things of a scene by their stored colour, from the camera that shows most of each; and the table's."""
    model, found = eye.world.model, defaultdict(list)
    kept = [geom for geom in things(eye.world) if model.geom_rgba[geom, 3] == 1.0]
    for view in VIEWS:
        picture, geoms = lab(eye.take(view) / 255.0), eye.geoms(view)
        for geom in kept:
            found[tuple(model.geom_rgba[geom, :3].round(2).tolist()), view].append(picture[geoms == geom])
        found["table", view].append(picture[geoms == model.geom("table_top").id])
    best = {}
    for (colour, _), parts in found.items():
        every = np.concatenate(parts)
        if len(every) >= max(MIN_PIXELS, len(best.get(colour, ()))):
            best[colour] = every
    return {colour: np.median(every, axis=0) for colour, every in best.items()}


def colours(name):
    """Colours of the things of a task in its pictures, with the key light and in its shade."""
    text, embodiment = scene(name)
    world = World.load(text, embodiment, ROOM)
    for body in world.free_bodies:
        if body.startswith("lid"):  # uncover what is below
            world.data.qpos[world.model.joint(f"{body}_free").qposadr[0] + 2] += 5.0
    mujoco.mj_forward(world.model, world.data)
    with closing(Camera(world, 256, 256)) as eye:
        yield pixels_by_colour(eye)
        world.model.light_diffuse[world.model.light_castshadow.astype(bool)] = 0.0
        yield pixels_by_colour(eye)


@drawing
@pytest.mark.parametrize("name", list_tasks())
def test_colours_stay_recognisable_also_in_shade(name):
    for found in colours(name):
        table = found.pop("table")
        stored = {colour: lab(colour) for colour in found}
        for colour, seen in found.items():
            if np.hypot(*stored[colour][1:]) >= MIN_CHROMA:
                turn = abs((hue(seen) - hue(stored[colour]) + 180) % 360 - 180)
                assert turn <= MAX_TURN, (colour, seen)
            assert np.linalg.norm(seen - table) >= MIN_FROM_TABLE, (colour, seen, table)
        for one, other in itertools.combinations(found, 2):
            if np.linalg.norm(stored[one] - stored[other]) >= APART:
                assert np.linalg.norm(found[one] - found[other]) >= MIN_DISTANCE, (one, other)
