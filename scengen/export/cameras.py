"""Calibration of cameras: intrinsics and extrinsics."""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..orientation import UPRIGHT, Orientation
from ..robots import panda
from ..sim.world import World

WORLD = "world"
"""Frame of extrinsics. For a camera on a hand it is `robot0_eef`, the frame of `robot0_eef_pos` and `robot0_eef_quat`,
or likewise `robot1_eef`."""
TO_OPENCV = np.diag([1.0, -1.0, -1.0])
"""Rotation from OpenCV's camera axes to MuJoCo's. MuJoCo's cameras look along -z with y up; OpenCV's, which vision
tools expect, along z with y down."""


def calibration(world: World, name: str, width: int, height: int, orientation: Orientation = UPRIGHT) -> dict[str, Any]:
    """Intrinsics and extrinsics of a camera, rounded to a micrometre, as plain data.

    `intrinsics` is the 3 x 3 matrix K in pixels; the middle of the first pixel is (0.5, 0.5). `extrinsics` is the 4 x 4
    matrix that maps points from the camera's frame (x right, y down, z ahead) to `frame` [m]. If pictures are turned or
    mirrored, K maps points to the pixels of the turned picture, and the extrinsics do not change.
    """
    model, data = world.model, world.data
    mujoco.mj_camlight(model, data)  # the control loop leaves cameras one physics step behind
    camera = model.camera(name)
    focal = height / 2 / np.tan(np.radians(float(camera.fovy[0])) / 2)
    intrinsics = np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])
    pose = _pose(data.cam_xpos[camera.id], data.cam_xmat[camera.id].reshape(3, 3) @ TO_OPENCV)
    frame, root = WORLD, model.body_rootid[camera.bodyid[0]]
    if model.body_weldid[camera.bodyid[0]] != 0:
        arm = next(arm for arm in world.arms if model.body(panda.Names(arm.number).base).id == root)
        frame = f"{arm.label}_eef"
        pose = np.linalg.inv(_pose(arm.hand, arm.hand_rot)) @ pose
    return {
        "model": "pinhole without distortion",
        "width": width,
        "height": height,
        "intrinsics": (orientation.pixels(width, height) @ intrinsics + 0.0).tolist(),  # + 0.0 turns -0.0 into 0.0
        "frame": frame,
        "extrinsics": (pose.round(6) + 0.0).tolist(),
    }


def _pose(position: NDArray[np.float64], axes: NDArray[np.float64]) -> NDArray[np.float64]:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = axes, position
    return pose
