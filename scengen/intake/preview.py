"""A picture of an asset on the table: its visual mesh, and next to it its collision geometry."""

import math
from dataclasses import replace

import mujoco
import numpy as np

from ..assets.mesh_prop import MeshProp
from ..assets.prop import TABLE_TOP, place, table
from ..geometry import UP, heading
from ..pictures.render import VIEWS, Picture, camera
from ..sim.embodiment import JAW
from ..sim.scene_text import emit

SIZE = 480
"""Edge of each half of the picture [pixels]."""
CAMERA_DISTANCE = 2.6
"""Distance of the camera, as a multiple of half the diagonal of the asset's bounding box."""


def preview(prop: MeshProp) -> Picture:
    """Both pictures side by side, shape (480, 960, 3).

    Raises:
        NoPictures: OpenGL is missing.
    """
    return np.hstack([_picture(prop), _picture(replace(prop, bare=True))])


def _picture(prop: MeshProp) -> Picture:
    scene = table()
    place(scene, prop, "asset", [0.0, 0.0, TABLE_TOP], free=False)
    low, high = prop.vertices.min(axis=0), prop.vertices.max(axis=0)
    azimuth, elevation = VIEWS[0]
    dip = math.radians(elevation)
    ahead = math.cos(dip) * heading(azimuth) + math.sin(dip) * UP
    right = np.cross(ahead, UP) / math.cos(dip)
    axes, turn = np.column_stack([right, np.cross(right, ahead), -ahead]), np.empty(4)
    mujoco.mju_mat2Quat(turn, axes.ravel())
    eye = TABLE_TOP * UP + (low + high) / 2 - CAMERA_DISTANCE * float(np.linalg.norm(high - low)) / 2 * ahead
    scene.worldbody.add_camera(name="close", pos=eye.tolist(), quat=turn.tolist())
    with camera(emit(scene)[0], JAW, SIZE, SIZE) as view:
        return view.take("close")
