"""What a scene consists of, to somebody who knows no task: bodies and geoms, each with a box around it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from ..geometry import UP, Mat3, Outline, Vec3, corners, gap
from ..robots.jaw import FINGER_ACROSS, OPEN_GAP, PALM_ABOVE, SPAN
from ..sim.world import Arm, World

TABLE = "table"
PARTS = 6
"""How many geoms of one body are looked at, the largest ones: a curved floor consists of dozens."""
LEAST = 0.008
"""Half the longest side of the smallest geom that is looked at [m]: half a finger's width."""

EMPTY = 0.003
"""Distance of the fingers of a closed jaw with nothing in it [m], at most."""


@dataclass(frozen=True)
class Solid:
    """A body, or one collision geom of it, with the box around it in the axes of the body."""

    name: str
    """Of the body, or of the geom where it is one of several; `body#2` for a geom without a name."""
    body: str
    free: bool
    """Whether the body hangs on a free joint."""
    middle: Vec3
    """Of the box, in the axes of the body [m]."""
    axes: Mat3
    """Of the box, in the axes of the body."""
    half: Vec3
    """Half the lengths of the box [m]."""

    def centre(self, world: World) -> Vec3:
        """Middle of the box now [m]."""
        return world.pos(self.body) + world.rot(self.body) @ self.middle

    def rot(self, world: World) -> Mat3:
        """Axes of the box now."""
        return world.rot(self.body) @ self.axes

    def reach(self, world: World, direction: Vec3) -> float:
        """How far the box goes from its middle in a direction, a unit vector [m]."""
        return float(np.abs(self.rot(world).T @ direction) @ self.half)

    def level_axes(self, world: World) -> list[tuple[Vec3, float]]:
        """The two axes of the box that are nearest to level, as level unit vectors, with half the length [m].

        The shorter one first: along it a jaw closes.
        """
        rot = self.rot(world)
        flat = sorted(range(3), key=lambda i: abs(float(rot[2, i])))[:2]
        found = []
        for i in sorted(flat, key=lambda i: float(self.half[i])):
            level = np.array([rot[0, i], rot[1, i], 0.0])
            found.append((level / max(float(np.linalg.norm(level)), 1e-9), float(self.half[i])))
        return found

    def top(self, world: World) -> float:
        """Height of its highest point [m]."""
        return float(self.centre(world)[2]) + self.reach(world, UP)

    def outline(self, world: World) -> Outline:
        """What of the box is seen from above, as if its level axes were level."""
        (along, first), (_, second) = self.level_axes(world)
        return corners(self.centre(world), math.atan2(along[1], along[0]), (2 * first, 2 * second))

    @property
    def graspable(self) -> bool:
        """Whether a jaw may span it: a free body, and narrow in one direction."""
        return self.free and 2 * float(self.half.min()) < OPEN_GAP


def solids(world: World) -> Mapping[str, Solid]:
    """All solids of the scene by name, without floor and robot: bodies first, then the parts of composed ones."""
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
        large = [g for g in geoms if boxes[g][2].max() >= LEAST]
        for k, g in enumerate(sorted(large, key=lambda g: -float(np.prod(boxes[g][2])))[:PARTS]):
            part = world.model.geom(g).name or f"{name}#{k}"
            parts[part] = Solid(part, name, free, *boxes[g])
    return found | parts


def handles(found: Mapping[str, Solid], suction: bool) -> list[Solid]:
    """What a hand can take hold of: the best handle of each free body, then the second best ones."""
    ranked = []
    for whole in (solid for solid in found.values() if solid.free and solid.name == solid.body):
        parts = [solid for solid in found.values() if solid.body == whole.body and solid is not whole]
        if suction:
            takes = parts or [whole]  # the middle of a box around several parts may be air
        else:
            takes = [whole] if whole.graspable else [part for part in parts if part.graspable]
        ranked += list(enumerate(takes[:2]))
    return [solid for _, solid in sorted(ranked, key=lambda pair: pair[0])]


def sides(world: World, found: Mapping[str, Solid], solid: Solid) -> list[int]:
    """Which of a solid's level axes an open jaw can close along, the one with the most room for the fingers first."""
    rooms = {}
    for which, (along, half) in enumerate(solid.level_axes(world)):
        if 2 * half < OPEN_GAP:
            jaw = corners(solid.centre(world), math.atan2(along[1], along[0]), (SPAN, 2 * FINGER_ACROSS))
            others = [other for other in found.values() if other.body not in (solid.body, TABLE)]
            near = [
                gap(jaw, other.outline(world)) for other in others if other.top(world) > solid.top(world) - PALM_ABOVE
            ]
            rooms[which] = min(near, default=1.0)
    return sorted(rooms, key=lambda which: -rooms[which])


def held(arm: Arm) -> str | None:
    """The free body in the hand: between fingers that are closed but apart, or on a cup that is sealed."""
    world, fingers = arm.world, arm.finger_pos
    if arm.grip < 0 or not (abs(float(fingers[0] - fingers[1])) > EMPTY if len(fingers) else arm.sealed):
        return None
    touched = [body for body in world.free_bodies if world.touching(arm.label, body)]
    return min(touched, key=lambda body: float(np.linalg.norm(world.com(body) - arm.hand)), default=None)


def _bodies(world: World) -> list[int]:
    """Every body of the scene that stands for itself: not of the robot, not the floor, no part of a free body."""
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
    """Geoms of a body, with `whole` those of everything that hangs on it too."""
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
