"""Views of scenes: close enough, with little hidden behind the robot, and the hand in the picture when it acts."""

import itertools
import math
from collections import defaultdict
from collections.abc import Iterator, Sequence

import mujoco
import numpy as np
from mujoco import MjvCamera
from numpy.typing import NDArray

from ..assets.prop import TABLE_TOP
from ..geometry import Vec3
from ..sim.world import World, scene_geoms

State = NDArray[np.float64]
"""State of a world, see `World.state`."""
Directions = Sequence[tuple[float, float]]
"""Azimuths and elevations of views [deg]."""
VIEWS: Directions = (
    *((140.0, -28.0), (220.0, -28.0), (180.0, -35.0), (100.0, -28.0), (260.0, -28.0)),
    *((140.0, -55.0), (220.0, -55.0), (100.0, -50.0), (260.0, -50.0), (180.0, -65.0)),
)
"""Azimuths and elevations of the fitted views [deg]. The first looks from the free corner of the table to the robot, so
that the arm hides little."""
MIN_GAIN = 0.05
"""Smallest share of the scene by which another view must show more than the first one to be chosen."""
HIDDEN = 0.25
"""Visible share of a body below which it counts as hidden."""
MAX_HIDDEN = 0.25
"""Share of a film for which a body may be hidden."""
NEAR = 0.12
"""Distance of a hand from the box around a thing below which the hand acts [m]."""
DISTANCE_MARGIN = 1.12
"""Factor on the smallest distance at which the fitted view holds all points."""
CLOSEST = 0.55
"""Smallest distance of the fitted view [m]: a closer one would not show where on the table things are."""
FALL_DEPTH = 0.1
"""Depth below the table top at which things are not followed [m], unless a fixed body is as low."""
CORNER_SIGNS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
"""Signs of the corners of a box, shape (8, 3)."""
CORNER_SHRINKAGE = 0.8
"""Scale of the boxes whose corners must be visible: the corners of the full boxes touch neighbouring things."""
SHOWN_GROUPS = np.array([1, 1, 1, 0, 0, 0], np.uint8)
"""Groups of geoms that pictures show."""
RAY_STEP = 1e-6
"""Distance behind a transparent surface at which a ray continues, as a share of the ray."""


def fitted(
    world: World,
    aspect: float,
    azimuth: float = VIEWS[0][0],
    elevation: float = VIEWS[0][1],
    points: NDArray[np.float64] | None = None,
) -> MjvCamera:
    """The closest view that contains the things of the scene and the robot's hand, but not all of table and floor.

    Args:
        aspect: width of the picture over its height.
        azimuth, elevation: direction of the view [deg].
        points: points that it must contain instead, shape (n, 3) [m].
    """
    view = MjvCamera()
    view.azimuth, view.elevation = azimuth, elevation
    ahead, right, up = view_axes(view)
    axes = np.array([right, up, ahead])
    seen = (scene_corners(world) if points is None else points) @ axes.T
    centre = (seen.min(axis=0) + seen.max(axis=0)) / 2
    away = seen - centre
    half = np.tan(np.radians(world.model.vis.global_.fovy) / 2)
    needed = np.abs(away[:, :2]) / [half * aspect, half]  # at this distance from the eye a point is on the rim
    view.lookat = axes.T @ centre
    view.distance = max(CLOSEST, DISTANCE_MARGIN * float((needed.max(axis=1) - away[:, 2]).max()))
    return view


def clearest(world: World, aspect: float, states: Sequence[State] = (), directions: Directions = VIEWS) -> MjvCamera:
    """The view in which the robot and other things hide least of the scene.

    It contains the initial position of the hand, the hand whenever it is near a thing, and the things of the scene in
    all states, unless they fall off the table. A thing that is hidden in more than `MAX_HIDDEN` of the states counts
    against a view, unless no view shows it.

    Args:
        aspect: width of the picture over its height.
        states: states of the world. Default: the present one. The world ends in the last one.
        directions: those to choose from; the first one unless another one is better by `MIN_GAIN`.
    """
    corners = [_hands(world), *(np.vstack([_thing_corners(world), acting(world)]) for _ in _visit(world, states))]
    points = np.vstack(corners)
    points = points[points[:, 2] > min(TABLE_TOP - FALL_DEPTH, _lowest_fixed(world))]
    views = [fitted(world, aspect, *where, points) for where in directions]
    shares = np.array([[visible_shares(world, view) for view in views] for _ in _visit(world, states)])
    hidden = ((shares < HIDDEN).mean(axis=0) - MAX_HIDDEN).clip(0.0)
    quality = shares.mean(axis=(0, 2)) - (hidden - hidden.min(axis=0)).max(axis=1)
    best = int(quality.argmax())
    return views[best if quality[best] > quality[0] + MIN_GAIN else 0]


def _visit(world: World, states: Sequence[State]) -> Iterator[None]:
    """Bring the world into one state after the other. Without states it stays as it is."""
    if not states:
        yield
    for state in states:
        world.restore(state)
        yield


def view_axes(view: MjvCamera) -> tuple[Vec3, Vec3, Vec3]:
    """Unit vectors ahead, right and up of a view."""
    turn, dip = np.radians(view.azimuth), np.radians(view.elevation)
    ahead = np.array([np.cos(dip) * np.cos(turn), np.cos(dip) * np.sin(turn), np.sin(dip)])
    right = np.array([np.sin(turn), -np.cos(turn), 0.0])
    return ahead, right, np.cross(right, ahead)


def visible_share(world: World, view: MjvCamera) -> float:
    """Mean of `visible_shares`."""
    return float(np.mean(visible_shares(world, view)))


def visible_shares(world: World, view: MjvCamera) -> list[float]:
    """Visible share of the corners of the boxes around the geoms of each body.

    Transparent things hide nothing.
    """
    eye = view.lookat - view.distance * view_axes(view)[0]
    visible = defaultdict(list)
    for geom in things(world):
        body = world.model.geom_bodyid[geom]
        visible[body] += [_is_visible(world, eye, corner, body) for corner in box_of(world, geom, CORNER_SHRINKAGE)]
    return [float(np.mean(each)) for each in visible.values()]


def _is_visible(world: World, eye: Vec3, point: Vec3, body: int) -> bool:
    """Whether no opaque thing is between the eye and a point, apart from the body of the point."""
    model, hit = world.model, np.array([-1], np.int32)
    while True:
        ahead = point - eye
        share = mujoco.mj_ray(model, world.data, eye, ahead, SHOWN_GROUPS, 1, -1, hit, None)
        if not 0 <= share < 1 or model.geom_bodyid[hit[0]] == body:
            return True
        material = model.geom_matid[hit[0]]
        if (model.geom_rgba[hit[0], 3] if material < 0 else model.mat_rgba[material, 3]) == 1.0:
            return False
        eye = eye + (share + RAY_STEP) * ahead


def scene_corners(world: World) -> NDArray[np.float64]:
    """Corners of the boxes around the geoms of all things, and the hands, shape (n, 3) [m]."""
    return np.vstack([_thing_corners(world), _hands(world)])


def _hands(world: World) -> NDArray[np.float64]:
    """Positions of all hands, shape (n, 3) [m]."""
    return np.vstack([arm.hand for arm in world.arms])


def acting(world: World) -> NDArray[np.float64]:
    """Positions of the hands that are near a thing, those of partners included, shape (n, 3) [m]."""
    boxes = [
        (world.data.geom_xpos[g], world.data.geom_xmat[g], *world.model.geom_aabb[g].reshape(2, 3))
        for g in things(world)
    ]

    def gap(hand: Vec3) -> float:
        away = (np.abs((hand - at) @ frame.reshape(3, 3) - middle) - half for at, frame, middle, half in boxes)
        return min(float(np.linalg.norm(each.clip(0.0))) for each in away)

    hands = [arm.hand for arm in (*world.arms, *world.partners)]
    return np.array([hand for hand in hands if gap(hand) < NEAR]).reshape(-1, 3)


def _thing_corners(world: World) -> NDArray[np.float64]:
    """Corners of the boxes around the geoms of all things, shape (n, 3) [m]."""
    return np.vstack([box_of(world, geom) for geom in things(world)])


def _lowest_fixed(world: World) -> float:
    """Height of a millimetre below all fixed things of the scene [m]; inf if there are none."""
    fixed = [geom for geom in things(world) if world.model.body_weldid[world.model.geom_bodyid[geom]] == 0]
    return min((float(box_of(world, geom)[:, 2].min()) for geom in fixed), default=math.inf) - 0.001


def things(world: World) -> list[int]:
    """All geoms of the scene without table and floor."""
    return scene_geoms(world.model)


def box_of(world: World, geom: int, scale: float = 1.0) -> NDArray[np.float64]:
    """Corners of the box around a geom, scaled about its middle, shape (8, 3) [m]."""
    centre, half = world.model.geom_aabb[geom].reshape(2, 3)
    frame = world.data.geom_xmat[geom].reshape(3, 3)
    return world.data.geom_xpos[geom] + (centre + scale * half * CORNER_SIGNS) @ frame.T
