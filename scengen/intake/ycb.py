"""Scans of YCB objects, from a folder of the set, as part of a task in place of their proxies."""

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
from ..installation import cache_folder
from ..samplers.split import Split
from ..samplers.task import Task, load, things
from ..work.targets import try_folder, write
from .asset import IntakeRequest, MeshAsset, key, make_asset
from .feet import side_below
from .solid import content

LIES: Mat3 = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Rotation of a carton from standing, as in its scan, to its narrow side: its upward axis is then along y."""


def with_scans(task: Task, split: str, folder: str) -> Task:
    """The task with scans in place of the proxies of all objects that a split or training may draw.

    Args:
        folder: folder of the set, or of a part of it, see `assets.ycb.mesh_of`.

    Raises:
        BadConfig: the task has no YCB object, a scan is missing, or a mesh is not a solid.
    """
    found = {}
    for thing in _drawn(task, split):
        found[thing.called] = _scan(thing, folder)
    return load(task.name, {**task.node, "scans": found})


def other_files(task: Task, folder: str) -> list[str]:
    """Differences between the scans that a task holds and those made again from a folder.

    Raises:
        BadConfig: a scan is missing, or a mesh is not a solid.
    """
    wrong = []
    for called, stored in task.node["scans"].items():
        made = _scan(by_name()[called], folder)
        if stored["sha256"] != made["sha256"]:
            wrong.append(f"the scan of {called} was made of another file, {stored['file']}")
        elif stored["settings"] == made["settings"] and stored["solid"] != made["solid"]:
            wrong.append(f"the solid of {called} differs from the one that is made of its file")
    return wrong


def _drawn(task: Task, split: str) -> list[Ycb]:
    """Every YCB object that training or the split may draw."""
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
        raise BadConfig(f"task {task.name} has no YCB object; name a task that has one, or leave ycb= out")
    return [found[called] for called in sorted(found)]


def _scan(thing: Ycb, folder: str) -> dict[str, Any]:
    """The data of an object's scan that a task holds, cached by the content and settings of the scan."""
    path = mesh_of(folder, thing.row)
    request = IntakeRequest(str(path), mass=thing.mass, friction=_friction(thing.row.prop))
    made_of = key(request, hashlib.sha256(content(request.mesh)).hexdigest())
    kept = cache_folder() / "scans" / f"{made_of}{'-low' * thing.lies}.json"
    if kept.is_file():
        return json.loads(kept.read_text())
    try_folder(kept.parent)
    asset = make_asset(request)
    figures = asset.figures()
    found = {
        "file": f"{thing.row.folder}/{path.relative_to(Path(folder) / thing.row.folder)}",
        "sha256": asset.solid.sha256,
        "settings": {**figures["settings"], "versions": figures["versions"]},
        "solid": asset.turned(_upright(thing, asset)).written(),
    }
    write(kept, json.dumps(found))
    return found


def _friction(proxy: Prop) -> float:
    """Friction of an object's proxy: that of its first geom."""
    return float(proxy.spec().compile().geom_friction[0, 0])


def _upright(thing: Ycb, asset: MeshAsset) -> Mat3:
    """The rotation from a scan's axes to those of the proxy. Scans stand or lie as their proxies do, but askew.

    It turns the scan about the vertical, to align its narrow side with the proxy's; to its side, if it is a carton that
    lies; and by the tilt of the face on which it then stands, as otherwise it would turn while it comes to rest.
    """
    corners, com = np.vstack(asset.pieces.corners), np.asarray(asset.solid.mesh.center_mass)
    turn = about_z(_alignment(corners, _long_direction(thing.row.prop)))
    turn = LIES @ turn if thing.lies else turn
    side = side_below(corners @ turn.T, turn @ com)
    if side is None:
        raise BadConfig(f"the scan of {thing.called} does not stand upright in its file; turn it upright there")
    return shortest(side[0], UP) @ turn


def _alignment(corners: Points, direction: float) -> float:
    """Rotation about the vertical that aligns the narrowest strip that contains a body with a direction [rad].

    Of the two solutions, which differ by pi, it is the smaller one.
    """
    flat = corners[:, :2]
    outline = flat[ConvexHull(flat).vertices]
    edges = np.roll(outline, -1, axis=0) - outline
    angles = np.arctan2(edges[:, 1], edges[:, 0])
    widths = [float(np.ptp(outline @ np.array([-math.sin(a), math.cos(a)]))) for a in angles]
    return math.remainder(direction - float(angles[int(np.argmin(widths))]), math.pi)


def _long_direction(proxy: Prop) -> float:
    """Horizontal direction in which a proxy is longer: 0 for x, pi / 2 for y [rad]."""
    model = proxy.spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for geom in np.flatnonzero(model.geom_contype):
        rot, box = data.geom_xmat[geom].reshape(3, 3), model.geom_aabb[geom]
        middle, half = data.geom_xpos[geom] + rot @ box[:3], np.abs(rot) @ box[3:]
        low, high = np.minimum(low, middle - half), np.maximum(high, middle + half)
    return 0.0 if high[0] - low[0] > high[1] - low[1] else math.pi / 2
