"""Scans of YCB objects in the place of their proxies: a folder of the set becomes a part of a task."""

import hashlib
import json
import math
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.spatial import ConvexHull

from ..assets.mesh_prop import Points
from ..assets.prop import Prop
from ..assets.ycb import Ycb, by_name, mesh_of
from ..errors import BadConfig
from ..geometry import UP, Mat3, about_z, shortest
from ..samplers.split import Split
from ..samplers.task import Task, load, things
from ..work.targets import cache_folder, try_folder, write
from .asset import IntakeRequest, MeshAsset, key, take_in
from .feet import side_below
from .solid import content

LIES: Mat3 = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Turns a carton that stands, as in its scan, to its narrow side: what was up then lies along y."""


def with_scans(task: Task, split: str, folder: str) -> Task:
    """The task with scans in the place of the proxies, of all objects that a split or training may draw.

    Args:
        folder: that holds the set, or a part of it, see `assets.ycb.mesh_of`.

    Raises:
        BadConfig: the task has no YCB object, a scan is not there, or a mesh is no solid.
    """
    found = {}
    for thing in _drawn(task, split):
        found[thing.called] = _scan(thing, folder)
    return load(task.name, {**task.node, "scans": found})


def other_files(task: Task, folder: str) -> list[str]:
    """What is wrong with the scans that a task holds, made again from a folder; empty if nothing is.

    Raises:
        BadConfig: a scan is not there, or a mesh is no solid.
    """
    wrong = []
    for called, told in task.node["scans"].items():
        made = _scan(by_name()[called], folder)
        if told["sha256"] != made["sha256"]:
            wrong.append(f"the scan of {called} was made of another file, {told['file']}")
        elif told["settings"] == made["settings"] and told["solid"] != made["solid"]:
            wrong.append(f"the solid of {called} is not what is made of its file")
    return wrong


def _drawn(task: Task, split: str) -> list[Ycb]:
    """Every YCB object that may be drawn, in training or in the split."""
    found = {}
    for name in things(task.family):
        shifts = task.shifts(Split.parse(split))
        for space in (task.training, {**task.training, **shifts}):
            items, lows = (
                sorted({int(interval.low) for interval in space[f"{name}.{what}"].support}) for what in ("item", "low")
            )
            every = (Ycb(item=item, low=low) for item in items for low in lows)
            found |= {thing.called: thing for thing in every}
    if not found:
        raise BadConfig(f"task {task.name} has no YCB object; name one that has, or leave ycb= out")
    return [found[called] for called in sorted(found)]


def _scan(thing: Ycb, folder: str) -> dict[str, Any]:
    """What a task holds of an object: kept in the folder of cached files under what it is made of."""
    path = mesh_of(folder, thing.row)
    request = IntakeRequest(str(path), mass=thing.mass, friction=_friction(thing.row.prop))
    made_of = key(request, hashlib.sha256(content(request.mesh)).hexdigest())
    kept = cache_folder() / "scans" / f"{made_of}{'-low' * thing.lies}.json"
    if kept.is_file():
        return json.loads(kept.read_text())
    try_folder(kept.parent)
    taken = take_in(request)
    figures = taken.figures()
    found = {
        "file": f"{thing.row.folder}/{path.relative_to(Path(folder) / thing.row.folder)}",
        "sha256": taken.solid.sha256,
        "settings": {**figures["settings"], "versions": figures["versions"]},
        "solid": taken.turned(_upright(thing, taken)).written(),
    }
    write(kept, json.dumps(found))
    return found


def _friction(proxy: Prop) -> float:
    """Of an object's proxy: that of its first geom."""
    return float(proxy.spec().compile().geom_friction[0, 0])


def _upright(thing: Ycb, taken: MeshAsset) -> Mat3:
    """The turn from a scan's axes to those of the proxy: scans of the set stand or lie as their proxies do, but askew.

    About the vertical, until the narrow side lies as the proxy's; to its side, if it is a carton that lies; and by
    what the side that it then stands on is off the level: else it would turn as it comes to rest.
    """
    corners, com = np.vstack(taken.pieces.corners), np.asarray(taken.solid.mesh.center_mass)
    turn = about_z(_askew(corners, _broad(thing.row.prop)))
    turn = LIES @ turn if thing.lies else turn
    side = side_below(corners @ turn.T, turn @ com)
    if side is None:
        raise BadConfig(f"the scan of {thing.called} does not stand as its file shows it; turn it upright there")
    return shortest(side[0], UP) @ turn


def _askew(corners: Points, broad: float) -> float:
    """By how much a body must be turned about the vertical for the narrowest strip that holds it to lie along `broad`.

    Of the two ways, which differ by pi, it is the shorter one [rad].
    """
    flat = corners[:, :2]
    outline = flat[ConvexHull(flat).vertices]
    edges = np.roll(outline, -1, axis=0) - outline
    angles = np.arctan2(edges[:, 1], edges[:, 0])
    widths = [float(np.ptp(outline @ np.array([-math.sin(a), math.cos(a)]))) for a in angles]
    return math.remainder(broad - float(angles[int(np.argmin(widths))]), math.pi)


def _broad(proxy: Prop) -> float:
    """The level direction in which a proxy is longer: 0 along x, pi / 2 along y [rad]."""
    model = proxy.spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for geom in np.flatnonzero(model.geom_contype):
        rot, box = data.geom_xmat[geom].reshape(3, 3), model.geom_aabb[geom]
        middle, half = data.geom_xpos[geom] + rot @ box[:3], np.abs(rot) @ box[3:]
        low, high = np.minimum(low, middle - half), np.maximum(high, middle + half)
    return 0.0 if high[0] - low[0] > high[1] - low[1] else math.pi / 2
