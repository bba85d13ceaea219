"""Poses, velocities and sizes of all bodies of a scene: robosuite's `object-state`, for state-based policies.

It is privileged, but contains only what very good vision could measure: poses, velocities and outer sizes of the
bodies, and no parameter. Velocities are those of a body's origin, because those of the centre of mass would reveal its
position. All readings have the resolution of a sensor, `RESOLUTION`: the micrometres by which a body sinks into its
support, or the hundredths of a degree by which it leans on a stop, would reveal its mass.

    <body>_pos  <body>_quat                            in the world [m], xyzw
    <body>_vel_lin  <body>_vel_ang                     of its origin, world axes [m/s], [rad/s]
    <body>_to_robot0_eef_pos  ..._quat                 relative to the hand, in its axes; likewise for a second arm
    <body>_to_robot0_eef_vel_lin  ..._vel_ang          velocities relative to the hand and its motion, in its axes
    <body>_box_low  <body>_box_high                    corners of the box around its solid parts, in its axes [m]

Without the box, a policy that has to grasp things of various heights would have to guess where their upper side is,
which every picture shows. robosuite's own environments have no such entries, because their objects have one size each.

Bodies without joints, such as a bin, have poses and no velocities. All scenarios of a task have the same entries, in
the order of the bodies' names, movable bodies first; the boxes come after all else. If a scenario lacks a body, its
entries are 0, also its quaternion.
"""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from math import ceil, floor
from weakref import WeakKeyDictionary

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..geometry import Mat3
from ..params import with_values
from ..robots.panda import Names
from ..samplers.dists import Dist
from ..samplers.task import Task
from ..scenario import Scenario
from ..sim import scene_text
from ..sim.boxes import box_around
from ..sim.world import World

NAME = "object-state"
"""robosuite's name of the whole vector."""
COMMON_BODIES = ("world", "table")
"""Bodies that are the same in every scenario and therefore omitted."""

POSE = {"pos": ("x", "y", "z"), "quat": ("x", "y", "z", "w")}
"""Parts of a pose, and the names of their entries."""
MOTION = {"vel_lin": ("x", "y", "z"), "vel_ang": ("x", "y", "z")}
"""Parts of a velocity, and the names of their entries."""
BOX = {"box_low": ("x", "y", "z"), "box_high": ("x", "y", "z")}
"""Corners of the box around a body, and the names of their entries."""
POSE_SIZE = sum(map(len, POSE.values()))
"""Number of entries of a pose."""
BOUNDS = {"pos": 3.0, "quat": 1.0, "vel_lin": 100.0, "vel_ang": 1000.0, **dict.fromkeys(BOX, 3.0)}
"""Largest absolute value of each part, to which readings are clipped: far beyond the room [m], and beyond the speeds
of all bodies here [m/s], [rad/s]."""

RESOLUTION = {"pos": 1e-4, "quat": 4.4e-4, "vel_lin": 1e-3, "vel_ang": 1e-2, "force": 1e-3, "torque": 1e-4}
"""Resolution of each part, in the world: 0.1 mm, 0.05 deg (entries of a quaternion are those of half the angle), 1 mm/s
and 0.6 deg/s; of the wrist's readings 1 mN and 0.1 mN m. Readings relative to a hand follow from the rounded ones, so
that moving the hand gives no finer ones."""


def xyzw(rot: Mat3) -> NDArray[np.float64]:
    """A rotation as a quaternion xyzw, the order of robosuite's keys, shape (4,)."""
    return quats(rot[None])[0]


Bodies = Mapping[str, bool]
"""Names of bodies, and whether each is movable."""


def bodies_of(task: Task, scenes: Iterable[str] = ()) -> Bodies:
    """The bodies that scenarios of a task may have, with any parameters of training and of the axes.

    Args:
        scenes: further scenes (MJCF), such as those of a pool that was drawn with other distributions.
    """
    found: dict[str, bool] = {}
    for bodies in chain([_bodies_drawn(task)], map(bodies_in_text, _distinct(scenes))):
        for name, moves in bodies.items():
            found[name] = found.get(name, False) or moves
    return {name: found[name] for name in sorted(found, key=_natural_key) if name not in COMMON_BODIES}


_drawn = WeakKeyDictionary[type[Scenario], list[tuple[object, Bodies]]]()


def _bodies_drawn(task: Task) -> Bodies:
    """The bodies of all `_variants` of a task. They are found once: many environments of a task need them."""
    known, spaces = _drawn.setdefault(task.family, []), (task.training, {n: a.replace for n, a in task.axes.items()})
    for given, bodies in known:
        if given == spaces:
            return bodies
    found: dict[str, bool] = {}
    for bodies in map(_bodies_built, _variants(task)):
        found |= {name: moves or found.get(name, False) for name, moves in bodies.items()}
    known.append((spaces, found))
    return found


def all_bodies(several: Iterable[Bodies]) -> Bodies:
    """The bodies of several tasks together."""
    found: dict[str, bool] = {}
    for bodies in several:
        found |= {name: moves or found.get(name, False) for name, moves in bodies.items()}
    return {name: found[name] for name in sorted(found, key=_natural_key)}


@dataclass(frozen=True)
class ObjectState:
    """A vector of poses, velocities and boxes: its entries, their names and bounds, and how to read it."""

    bodies: Bodies
    arms: int
    """Number of hands relative to which poses and velocities are also given."""

    @cached_property
    def ordered(self) -> tuple[str, ...]:
        """Names of the bodies, movable ones first."""
        return tuple(sorted(self.bodies, key=lambda name: not self.bodies[name]))

    @cached_property
    def segments(self) -> dict[str, slice]:
        """Slice of the vector for each reading, such as `cube_pos`."""
        found, start = {}, 0
        for name, entries in self._readings():
            found[name] = slice(start, start + len(entries))
            start += len(entries)
        return found

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all entries, such as `cube_pos.x`."""
        return tuple(f"{name}.{entry}" for name, entries in self._readings() for entry in entries)

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """Largest absolute value of each entry, shape (n,)."""
        sizes = [next(b for kind, b in BOUNDS.items() if name.endswith(kind)) for name, _ in self._readings()]
        return np.repeat(sizes, [len(entries) for _, entries in self._readings()])

    def read(self, world: World) -> NDArray[np.float64]:
        """The present vector, shape (n,). Velocities are those of the last physics step (2 ms)."""
        model, data = world.model, world.data
        found = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) for name in self.ordered]
        ids = np.maximum(found, 0, dtype=int)  # -1 if there is no such body
        pos, rot = rounded(data.xpos[ids], "pos"), _rounded_rots(data.xquat[ids])
        ang, lin = _velocities(world, data.xpos[ids], ids)
        ang, lin = rounded(ang, "vel_ang"), rounded(lin, "vel_lin")
        frames = [_frame(pos, rot, lin, ang)]
        for arm in world.arms:
            hand, axes, moved = arm.hand, arm.hand_rot, model.site(Names(arm.number).grip_site).bodyid
            turning, going = _velocities(world, hand[None], moved)
            slid = lin - going - _cross(turning, pos - hand)
            frames.append(_frame((pos - hand) @ axes, axes.T @ rot, slid @ axes, (ang - turning) @ axes))
        there = np.array(found) >= 0
        rows = np.stack(frames, axis=1) * there[:, None, None]
        moving, boxes = sum(self.bodies.values()), _boxes(model)[ids] * there[:, None]
        return np.concatenate([rows[:moving].ravel(), rows[moving:, :, :POSE_SIZE].ravel(), boxes.ravel()])

    def _readings(self) -> Iterator[tuple[str, tuple[str, ...]]]:
        """Names of all readings and of their entries, in order."""
        for body in self.ordered:
            kinds = {**POSE, **MOTION} if self.bodies[body] else POSE
            for frame in ("", *(f"to_{Names(number).arm}eef_" for number in range(self.arms))):
                yield from ((f"{body}_{frame}{kind}", entries) for kind, entries in kinds.items())
        for body in self.ordered:
            yield from ((f"{body}_{kind}", entries) for kind, entries in BOX.items())


def rounded(values: NDArray[np.float64], kind: str) -> NDArray[np.float64]:
    """Values at the resolution of a part."""
    return np.round(values / RESOLUTION[kind]) * RESOLUTION[kind]


def _rounded_rots(quats: NDArray[np.float64]) -> NDArray[np.float64]:
    """Orientations at the resolution of quaternions, shape (n, 3, 3), of quaternions wxyz, shape (n, 4)."""
    rots, row = np.empty((len(quats), 3, 3)), np.empty(9)
    coarse = rounded(quats, "quat")
    coarse /= np.linalg.norm(coarse, axis=1, keepdims=True)
    for rot, quat in zip(rots, coarse, strict=True):
        mujoco.mju_quat2Mat(row, quat)
        rot[:] = row.reshape(3, 3)
    return rots


def _frame(
    pos: NDArray[np.float64], rot: NDArray[np.float64], lin: NDArray[np.float64], ang: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Poses and velocities of n bodies side by side, shape (n, 13)."""
    return np.hstack([pos, quats(rot), lin, ang])


def quats(rots: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations, shape (n, 3, 3), as quaternions xyzw, shape (n, 4)."""
    quats = np.empty((len(rots), 4))
    for quat, rot in zip(quats, rots.reshape(-1, 9), strict=True):
        mujoco.mju_mat2Quat(quat, rot)
    return quats[:, [1, 2, 3, 0]]


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cross products of vectors, shape (n, 3). For a few vectors numpy's function takes five times as long."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]


_boxes_of_models = WeakKeyDictionary[mujoco.MjModel, NDArray[np.float64]]()


def _boxes(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Lower and upper corner of the box around the solid parts of each body, in its axes [m], shape (bodies, 6).

    It is 0 for a body without any, such as a mark on the table.
    """
    if model not in _boxes_of_models:
        solid = np.flatnonzero(model.geom_contype | model.geom_conaffinity)
        boxes = [box_around(model, solid[model.geom_bodyid[solid] == body]) for body in range(model.nbody)]
        _boxes_of_models[model] = rounded(np.reshape(boxes, (-1, 6)), "pos")
    return _boxes_of_models[model]


def _velocities(
    world: World, points: NDArray[np.float64], bodies: NDArray[np.int_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Angular and linear velocities of points on bodies, world axes, each of shape (n, 3)."""
    motion, about = world.data.cvel[bodies], world.data.subtree_com[world.model.body_rootid[bodies]]
    return motion[:, :3], motion[:, 3:] + _cross(motion[:, :3], points - about)


def _variants(task: Task) -> Iterator[Scenario]:
    """Scenarios that together have all bodies: in training and on each axis, integer parameters take all their values.

    One parameter varies at a time, while the others have their largest value: a post may be there only if its height
    is not 0. Only the bodies of the scenarios matter, so they need not be feasible.
    """
    integers = [name for name, p in task.known.items() if p.integer]
    spaces: Sequence[Mapping[str, Dist]] = [task.training, *(axis.replace for axis in task.axes.values())]
    for space in spaces:
        dists = {**task.training, **space}
        counts = {name: _whole_numbers(dists[name]) for name in integers}
        reals = {name: dist.support[-1].high for name, dist in dists.items() if name not in counts}
        largest = with_values(task.family(), reals | {name: values[-1] for name, values in counts.items()})
        yield largest
        for name in set(counts) & set(space):
            yield from (with_values(largest, {name: value}) for value in counts[name])


def _whole_numbers(dist: Dist) -> list[int]:
    return sorted({v for i in dist.support for v in range(ceil(i.low), floor(i.high) + 1)})


def _bodies_built(scenario: Scenario) -> Bodies:
    scene = scenario.build()  # keeps a reference: without one, the bodies of the scene lose their joints
    return {body.name: bool(body.joints or body.mocap) for body in scene.bodies}


_NUMBERS = re.compile(r"""(["'])[-+.e\d\s]*\1""")
"""Values of attributes that are numbers."""


def _distinct(scenes: Iterable[str]) -> Iterator[str]:
    """One of all scenes that differ only in numbers: a pool has one text per scenario, but few sets of bodies."""
    seen = set[int]()
    for text in scenes:
        if (rest := hash(_NUMBERS.sub("", text))) not in seen:
            seen.add(rest)
            yield text


def bodies_in_text(text: str) -> Bodies:
    """The bodies of a scene (MJCF)."""
    scene_text.check(text)
    found = {}
    for body in ET.fromstring(text).iter("body"):
        moves = body.get("mocap") == "true" or any(child.tag in ("joint", "freejoint") for child in body)
        found[body.get("name", "")] = moves
    return found


def _natural_key(name: str) -> list[str | int]:
    """Sort key of names that puts `tile_2` before `tile_10`."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]
