"""The bodies and geoms of a scene, each with a box around it: the adversary's view of a scene, without the task."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from ..geometry import UP, Mat3, Outline, Vec3, corners, gap
from ..robots.jaw import FINGER_ACROSS, OPEN_GAP, PALM_ABOVE, SPAN
from ..sim.arm import Arm
from ..sim.world import World

TABLE = "table"
"""Name of the body of the table."""
MAX_PARTS = 6
"""Maximum number of geoms of one body that are considered, the largest ones: a curved floor consists of dozens."""
MIN_HALF_LENGTH = 0.008
"""Minimum of half the longest side of a geom that is considered: half a finger's width [m]."""

EMPTY_JAW_GAP = 0.003
"""Maximum distance of the fingers of a closed, empty jaw [m]."""


@dataclass(frozen=True)
class Solid:
    """A body, or one collision geom of it, with the box around it in the axes of the body."""

    name: str
    """Name of the body, or of the geom if it is one of several; `body#2` for a geom without a name."""
    body: str
    """Name of the body."""
    free: bool
    """Whether the body hangs on a free joint."""
    middle: Vec3
    """Middle of the box, in the axes of the body [m]."""
    axes: Mat3
    """Axes of the box, in the axes of the body."""
    half: Vec3
    """Half the side lengths of the box [m]."""

    def centre(self, world: World) -> Vec3:
        """Present position of the middle of the box [m]."""
        return world.pos(self.body) + world.rot(self.body) @ self.middle

    def rot(self, world: World) -> Mat3:
        """Present orientation of the box."""
        return world.rot(self.body) @ self.axes

    def reach(self, world: World, direction: Vec3) -> float:
        """Extent of the box from its middle in a direction, a unit vector [m]."""
        return float(np.abs(self.rot(world).T @ direction) @ self.half)

    def level_axes(self, world: World) -> list[tuple[Vec3, float]]:
        """The two axes of the box that are nearest to level, as level unit vectors, each with its half length [m].

        The shorter axis, along which a jaw closes, comes first.
        """
        rot = self.rot(world)
        flat = sorted(range(3), key=lambda i: abs(float(rot[2, i])))[:2]
        found = []
        for i in sorted(flat, key=lambda i: float(self.half[i])):
            level = np.array([rot[0, i], rot[1, i], 0.0])
            found.append((level / max(float(np.linalg.norm(level)), 1e-9), float(self.half[i])))
        return found

    def top(self, world: World) -> float:
        """Height of the highest point of the box [m]."""
        return float(self.centre(world)[2]) + self.reach(world, UP)

    def outline(self, world: World) -> Outline:
        """Outline of the box from above, as if its level axes were exactly level."""
        (along, first), (_, second) = self.level_axes(world)
        return corners(self.centre(world), math.atan2(along[1], along[0]), (2 * first, 2 * second))

    @property
    def graspable(self) -> bool:
        """Whether a jaw can grasp it: the body is free, and the box narrower than the open jaw in one direction."""
        return self.free and 2 * float(self.half.min()) < OPEN_GAP


def solids(world: World) -> Mapping[str, Solid]:
    """All solids of the scene by name, without floor and robot: bodies first, then the parts of composite bodies."""
    found, parts = {}, {}
    for body in _bodies(world):
        name, free = world.model.body(body).name, world.model.body(body).name in world.free_bodies
        geoms = [g for g in _subtree(world, body, whole=free) if world.model.geom_contype[g]]
        if not geoms:
            continue
        boxes = {g: _box(world, body, g) for g in geoms}
        if len(geoms) == 1:
            found[name] = Solid(name, name, free, *boxes[geoms[0]])
            continue
        found[name] = Solid(name, name, free, *_around(list(boxes.values())))
        large = [g for g in geoms if boxes[g][2].max() >= MIN_HALF_LENGTH]
        for k, g in enumerate(sorted(large, key=lambda g: -float(np.prod(boxes[g][2])))[:MAX_PARTS]):
            part = world.model.geom(g).name or f"{name}#{k}"
            parts[part] = Solid(part, name, free, *boxes[g])
    return found | parts


def handles(found: Mapping[str, Solid], suction: bool) -> list[Solid]:
    """The solids that a hand can grasp: the best handle of each free body, then the second best ones."""
    ranked = []
    for whole in (solid for solid in found.values() if solid.free and solid.name == solid.body):
        parts = [solid for solid in found.values() if solid.body == whole.body and solid is not whole]
        if suction:
            takes = parts or [whole]  # the middle of a box around several parts may be empty space
        else:
            takes = [whole] if whole.graspable else [part for part in parts if part.graspable]
        ranked += list(enumerate(takes[:2]))
    return [solid for _, solid in sorted(ranked, key=lambda pair: pair[0])]


def sides(world: World, found: Mapping[str, Solid], solid: Solid) -> list[int]:
    """Numbers of a solid's level axes along which an open jaw can close.

    The most clearance for the fingers comes first, then the fewest solids in their way.
    """
    clearances = {}
    for which, (along, half) in enumerate(solid.level_axes(world)):
        if 2 * half < OPEN_GAP:
            jaw = corners(solid.centre(world), math.atan2(along[1], along[0]), (SPAN, 2 * FINGER_ACROSS))
            others = [other for other in found.values() if other.body not in (solid.body, TABLE)]
            near = [
                gap(jaw, other.outline(world)) for other in others if other.top(world) > solid.top(world) - PALM_ABOVE
            ]
            clearances[which] = max(min(near, default=1.0), 0.0), -sum(distance <= 0.0 for distance in near)
    return sorted(clearances, key=clearances.__getitem__, reverse=True)


def held(arm: Arm) -> str | None:
    """The free body in the hand: between fingers that are closed but apart, or on a sealed suction cup."""
    world, fingers = arm.world, arm.finger_pos
    if arm.grip < 0 or not (abs(float(fingers[0] - fingers[1])) > EMPTY_JAW_GAP if len(fingers) else arm.sealed):
        return None
    touched = [body for body in world.free_bodies if world.touching(arm.label, body)]
    return min(touched, key=lambda body: float(np.linalg.norm(world.com(body) - arm.hand)), default=None)


def _bodies(world: World) -> list[int]:
    """Numbers of the scene's bodies, without those of the robot, the floor, and the parts of free bodies."""
    model = world.model
    scene = [b for b in range(1, model.nbody) if b not in world.own]
    free = {world.body(name) for name in world.free_bodies}
    return [b for b in scene if not any(a in free for a in _ancestors(world, b))]


def _ancestors(world: World, body: int) -> list[int]:
    found = []
    while (body := int(world.model.body_parentid[body])) > 0:
        found.append(body)
    return found


def _subtree(world: World, body: int, whole: bool) -> list[int]:
    """Geoms of a body; with `whole`, also those of all bodies attached to it."""
    of = {b for b in range(body, world.model.nbody) if b == body or (whole and body in _ancestors(world, b))}
    return [g for g in range(world.model.ngeom) if int(world.model.geom_bodyid[g]) in of]


def _box(world: World, body: int, geom: int) -> tuple[Vec3, Mat3, Vec3]:
    """Middle, axes and half lengths of the box around a geom, in the axes of `body`."""
    model, data = world.model, world.data
    at, rot = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
    here, axes = data.xpos[body], data.xmat[body].reshape(3, 3)
    middle = at + rot @ model.geom_aabb[geom, :3]
    half = model.geom_aabb[geom, 3:].copy()
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_SPHERE:
        rot = axes  # a ball has no axes of its own
    return axes.T @ (middle - here), axes.T @ rot, half


def _around(boxes: list[tuple[Vec3, Mat3, Vec3]]) -> tuple[Vec3, Mat3, Vec3]:
    """The box around several boxes, along the axes of the body."""
    low = np.min([middle - np.abs(axes) @ half for middle, axes, half in boxes], axis=0)
    high = np.max([middle + np.abs(axes) @ half for middle, axes, half in boxes], axis=0)
    return (low + high) / 2, np.eye(3), (high - low) / 2
