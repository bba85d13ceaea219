"""Pictures of a scenario and its training twin with one camera, from the side on which what an axis moves shows."""

from collections.abc import Sequence
from contextlib import closing

import mujoco
import numpy as np
from mujoco import MjvCamera

from ..geometry import Vec3
from ..look.looks import ROOM, Look
from ..pool.row import SceneRow
from ..sim.world import World
from ..validate.playable import check_scene, stored_world
from .render import Camera, Picture, address, check_pictures, encode
from .views import Directions, box_of, fitted, scene_corners, things, view_axes, visible_share

DIRECTIONS: Directions = ((180.0, -35.0), (180.0, -60.0), (90.0, -30.0), (270.0, -30.0))
"""Directions of the views. They look along the edges of the table: from its corner, what training
has parallel to an edge would look oblique, and what an axis has oblique would look parallel."""
PICTURE = (320, 240)
"""Width and height of a picture of a pair [pixels]."""
MIN_MOTION = 0.002
"""Smallest motion of a body between two pictures that counts as visible, as a share of the distance to it."""
MIN_ADVANTAGE = 1.2
"""Factor by which another view must show more than the first one to be chosen."""


def pair(row: SceneRow, twin_scene: str, directions: Directions, look: Look = ROOM) -> tuple[str, str, Directions]:
    """Pictures of the training twin and of a scenario as data addresses for HTML, and the direction of both.

    Args:
        row: a scenario of a pool. Its scene is tried first in a process with limits.
        twin_scene: the scene of its training twin.
        directions: those from which the one is chosen that shows best in what the two differ.

    Raises:
        NoPictures: OpenGL is missing.
        ScengenError: the scene cannot be compiled.
    """
    check_scene(row.scene_xml, row.embodiment)
    check_pictures()  # before the meshes of the robots, which take a part of the address space
    worlds = World.load(twin_scene, row.embodiment, look), stored_world(row, look)
    view = comparison_view(worlds, PICTURE[0] / PICTURE[1], directions)
    twin, here = (address(encode(each), "webp") for each in twin_pictures(*worlds, size=PICTURE, view=view))
    return twin, here, [(view.azimuth, view.elevation)]


def twin_pictures(*worlds: World, size: tuple[int, int], view: MjvCamera) -> list[Picture]:
    """Pictures of a training twin and of OOD scenarios with one camera.

    Args:
        worlds: the scenarios at their starts, with visual geoms.
        size: width and height of the pictures [pixels].

    Raises:
        NoPictures: OpenGL is missing.
    """
    pictures = []
    for world in worlds:
        with closing(Camera(world, *size, view)) as camera:
            pictures.append(camera.take())
    return pictures


def comparison_view(worlds: Sequence[World], aspect: float, directions: Directions = DIRECTIONS) -> MjvCamera:
    """The view that contains the things of all worlds and shows best in what the last one differs from the first.

    Args:
        worlds: a training twin and its OOD scenarios at their starts.
        aspect: width of the picture over its height.
        directions: those to choose from.
    """
    points = np.vstack([scene_corners(world) for world in worlds])
    views = [fitted(worlds[0], aspect, *direction, points) for direction in directions]
    first, last = worlds[0], worlds[-1]
    motions = [_motion(first, last, view) for view in views]
    if max(motions) < MIN_MOTION:  # what moves is hidden, such as a mass: the view that hides least is as good
        motions = [1.0] * len(views)
    shown = [
        motion * (visible_share(first, view) + visible_share(last, view))
        for motion, view in zip(motions, views, strict=True)
    ]
    best = int(np.argmax(shown))
    return views[best if shown[best] > MIN_ADVANTAGE * shown[0] else 0]


def _motion(one: World, other: World, view: MjvCamera) -> float:
    """Mean distance in the picture between the corners of the same body in two worlds, of the body that moves most.

    A body whose shape has changed has moved, too. The distance is a share of that from the eye.
    """
    farthest = 0.0
    for body in range(1, one.model.nbody):
        name = one.model.body(body).name
        match = mujoco.mj_name2id(other.model, mujoco.mjtObj.mjOBJ_BODY, name)
        here = [geom for geom in things(one) if one.model.geom_bodyid[geom] == body]
        there = [geom for geom in things(other) if other.model.geom_bodyid[geom] == match]
        for a, b in zip(here, there, strict=False):
            moved = _projected(box_of(one, a), view) - _projected(box_of(other, b), view)
            farthest = max(farthest, float(np.linalg.norm(moved, axis=1).mean()))
    return farthest


def _projected(points: Vec3, view: MjvCamera) -> Vec3:
    """Points in the plane of the picture, per distance from the eye, shape (n, 2)."""
    ahead, right, up = view_axes(view)
    away = points - view.lookat
    return np.stack([away @ right, away @ up], axis=1) / (view.distance + away @ ahead)[:, None]
