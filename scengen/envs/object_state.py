"""Where everything in a scene is and how it moves: robosuite's `object-state`, for policies without eyes.

Privileged, and still no more than perfect eyes would see: poses and velocities of the bodies, and no parameter.
Velocities are those of a body's origin, since those of its centre of mass would give away where that is.

    <body>_pos  <body>_quat                            in the world [m], xyzw
    <body>_vel_lin  <body>_vel_ang                     of its origin, world axes [m/s], [rad/s]
    <body>_to_robot0_eef_pos  ..._quat                 seen from the hand, in its axes; the same for every further arm
    <body>_to_robot0_eef_vel_lin  ..._vel_ang          the same of the velocity, less the hand's own motion

Bodies without joints, such as a bin, have poses and no velocities. All scenarios of a task have the same entries, in
the order of the bodies' names, those that can move first; a body that a scenario lacks reads 0, its quaternion too.
"""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from math import ceil, floor

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
from ..sim.world import World

NAME = "object-state"
"""robosuite's name of the whole."""
ALWAYS = ("world", "table")
"""Bodies that are the same in every scenario."""

POSE = {"pos": ("x", "y", "z"), "quat": ("x", "y", "z", "w")}
"""Parts of a pose, and what their entries are."""
MOTION = {"vel_lin": ("x", "y", "z"), "vel_ang": ("x", "y", "z")}
"""The same of a velocity."""
POSE_SIZE = sum(map(len, POSE.values()))
BOUNDS = {"pos": 3.0, "quat": 1.0, "vel_lin": 100.0, "vel_ang": 1000.0}
"""Larger readings are cut: far beyond the room [m], and beyond what anything here reaches [m/s], [rad/s]."""


def xyzw(rot: Mat3) -> NDArray[np.float64]:
    """A rotation as a quaternion in the order that robosuite's keys promise, shape (4,)."""
    return _quats(rot[None])[0]


Bodies = Mapping[str, bool]
"""Names of bodies, and whether each can move."""


def bodies_of(task: Task, scenes: Iterable[str] = ()) -> Bodies:
    """The bodies that scenarios of a task may have, whatever its parameters are in training and on its axes.

    Args:
        scenes: further scenes, MJCF, such as those of a pool that was drawn with other distributions.
    """
    found: dict[str, bool] = {}
    for told in chain(map(_built, _variants(task)), map(_written, _different(scenes))):
        for name, moves in told.items():
            found[name] = found.get(name, False) or moves
    return {name: found[name] for name in sorted(found, key=_naturally) if name not in ALWAYS}


def all_bodies(several: Iterable[Bodies]) -> Bodies:
    """The bodies of several tasks together."""
    found: dict[str, bool] = {}
    for told in several:
        found |= {name: moves or found.get(name, False) for name, moves in told.items()}
    return {name: found[name] for name in sorted(found, key=_naturally)}


@dataclass(frozen=True)
class ObjectState:
    """A vector of poses and velocities, its names, and how it is read."""

    bodies: Bodies
    arms: int
    """How many hands the bodies are also seen from."""

    @cached_property
    def ordered(self) -> tuple[str, ...]:
        """Names of the bodies, those that can move first."""
        return tuple(sorted(self.bodies, key=lambda name: not self.bodies[name]))

    @cached_property
    def segments(self) -> dict[str, slice]:
        """Where each reading, such as `cube_pos`, stands in the vector."""
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
        """No entry is larger in size, shape (n,)."""
        sizes = [next(b for kind, b in BOUNDS.items() if name.endswith(kind)) for name, _ in self._readings()]
        return np.repeat(sizes, [len(entries) for _, entries in self._readings()])

    def read(self, world: World) -> NDArray[np.float64]:
        """The vector as it is now, shape (n,); velocities are those of the last physics step (2 ms)."""
        model, data = world.model, world.data
        found = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) for name in self.ordered]
        ids = np.maximum(found, 0, dtype=int)  # -1 where there is no such body
        pos, rot = data.xpos[ids], data.xmat[ids].reshape(-1, 3, 3)
        ang, lin = _velocities(world, pos, ids)
        frames = [_frame(pos, rot, lin, ang)]
        for arm in world.arms:
            hand, axes, moved = arm.hand, arm.hand_rot, model.site(Names(arm.number).grip_site).bodyid
            turning, going = _velocities(world, hand[None], moved)
            slid = lin - going - _cross(turning, pos - hand)
            frames.append(_frame((pos - hand) @ axes, axes.T @ rot, slid @ axes, (ang - turning) @ axes))
        rows = np.stack(frames, axis=1) * (np.array(found) >= 0)[:, None, None]
        moving = sum(self.bodies.values())
        return np.concatenate([rows[:moving].ravel(), rows[moving:, :, :POSE_SIZE].ravel()])

    def _readings(self) -> Iterator[tuple[str, tuple[str, ...]]]:
        """Every reading and its entries, in order."""
        for body in self.ordered:
            kinds = {**POSE, **MOTION} if self.bodies[body] else POSE
            for frame in ("", *(f"to_{Names(number).arm}eef_" for number in range(self.arms))):
                yield from ((f"{body}_{frame}{kind}", entries) for kind, entries in kinds.items())


def _frame(
    pos: NDArray[np.float64], rot: NDArray[np.float64], lin: NDArray[np.float64], ang: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Poses and velocities of n bodies side by side, shape (n, 13)."""
    return np.hstack([pos, _quats(rot), lin, ang])


def _quats(rots: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations, shape (n, 3, 3), as quaternions xyzw, shape (n, 4)."""
    quats = np.empty((len(rots), 4))
    for quat, rot in zip(quats, rots.reshape(-1, 9), strict=True):
        mujoco.mju_mat2Quat(quat, rot)
    return quats[:, [1, 2, 3, 0]]


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cross products of vectors, shape (n, 3); numpy's own takes five times as long for a few."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]


def _velocities(
    world: World, points: NDArray[np.float64], bodies: NDArray[np.int_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Angular and linear velocities of points on bodies, world axes, each of shape (n, 3)."""
    motion, about = world.data.cvel[bodies], world.data.subtree_com[world.model.body_rootid[bodies]]
    return motion[:, :3], motion[:, 3:] + _cross(motion[:, :3], points - about)


def _variants(task: Task) -> Iterator[Scenario]:
    """Scenarios that have all bodies between them: in training and on each axis, whole numbers take all their values.

    One at a time, while the others are at their largest. Nothing is asked but which bodies there are, so that it does
    not matter whether a scenario is feasible.
    """
    whole = [name for name, p in task.known.items() if p.integer]
    spaces: Sequence[Mapping[str, Dist]] = [task.training, *(axis.replace for axis in task.axes.values())]
    for space in spaces:
        counts = {name: _whole_numbers({**task.training, **space}[name]) for name in whole}
        largest = with_values(task.family(), {name: values[-1] for name, values in counts.items()})
        yield largest
        for name in set(counts) & set(space):
            yield from (with_values(largest, {name: value}) for value in counts[name])


def _whole_numbers(dist: Dist) -> list[int]:
    return sorted({v for i in dist.support for v in range(ceil(i.low), floor(i.high) + 1)})


def _built(scenario: Scenario) -> Bodies:
    scene = scenario.build()  # held by name: the bodies of a scene that nobody holds have lost their joints
    return {body.name: bool(body.joints or body.mocap) for body in scene.bodies}


_NUMBERS = re.compile(r"""(["'])[-+.e\d\s]*\1""")
"""Values of attributes that are numbers."""


def _different(scenes: Iterable[str]) -> Iterator[str]:
    """Of scenes that differ in numbers only, one: a pool has as many texts as scenarios, and few sets of bodies."""
    seen = set[int]()
    for text in scenes:
        if (rest := hash(_NUMBERS.sub("", text))) not in seen:
            seen.add(rest)
            yield text


def _written(text: str) -> Bodies:
    scene_text.check(text)
    found = {}
    for body in ET.fromstring(text).iter("body"):
        moves = body.get("mocap") == "true" or any(child.tag in ("joint", "freejoint") for child in body)
        found[body.get("name", "")] = moves
    return found


def _naturally(name: str) -> list[str | int]:
    """What names are sorted by: `tile_2` before `tile_10`."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]
