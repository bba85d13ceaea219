"""What a policy may see: the paper's streams under robosuite's names, each read only if it is asked for.

Shapes, units and names follow the paper's table of modalities; images are (height, width, 3), first row on top.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..errors import UnknownName
from ..robots.panda import JOINTS, Names
from ..sim.world import JAW, World

Reading = NDArray[np.float32] | NDArray[np.uint8]

TAXELS = 8
"""Rows and columns of a tactile grid (paper, table of modalities)."""
PADS = {
    "robot0_tactile_left": f"{Names().hand}finger1_pad_collision",
    "robot0_tactile_right": f"{Names().hand}finger2_pad_collision",
}
"""The finger pad under each tactile grid. The grid spans the pad's inner face, columns along x, rows along z."""


@dataclass(frozen=True)
class Stream:
    """One kind of reading."""

    shape: tuple[int, ...]
    bound: float
    """No reading is larger in size; finite where the robot's limits make it so."""
    read: Callable[[World], NDArray[np.float64]]


def _hand_quat(world: World) -> NDArray[np.float64]:
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, world.arm.hand_rot.ravel())
    return np.array([quat[1], quat[2], quat[3], quat[0]])


def wrench(world: World) -> NDArray[np.float64]:
    """Force [N] and torque [N m] that the hand exerts on the wrist, axes of the wrist's sensor frame, shape (6,).

    The same numbers as robosuite's force and torque sensors; computed on demand, since sensors in the model would
    cost time in every step.
    """
    mujoco.mj_rnePostConstraint(world.model, world.data)
    site = world.model.site(Names().wrist_site).id
    body = int(world.model.site_bodyid[site])
    local = np.empty(6)
    root = int(world.model.body_rootid[body])
    moment, force = world.data.cfrc_int[body, :3], world.data.cfrc_int[body, 3:]
    arm = world.data.site_xpos[site] - world.data.subtree_com[root]
    frame = world.data.site_xmat[site].reshape(3, 3)
    local[:3] = frame.T @ force
    local[3:] = frame.T @ (moment - np.cross(arm, force))
    return local


def _world_force(world: World) -> NDArray[np.float64]:
    frame = world.data.site(Names().wrist_site).xmat.reshape(3, 3)
    return frame @ wrench(world)[:3]


def _tactile(pad: str) -> Callable[[World], NDArray[np.float64]]:
    def read(world: World) -> NDArray[np.float64]:
        """Normal force of every contact on the pad, in the taxel where it acts [N]."""
        grid, force = np.zeros((TAXELS, TAXELS)), np.zeros(6)
        geom = world.model.geom(pad).id
        half = world.model.geom_size[geom]
        frame, centre = world.data.geom_xmat[geom].reshape(3, 3), world.data.geom_xpos[geom]
        for i in range(world.data.ncon):
            contact = world.data.contact[i]
            if geom in contact.geom:
                mujoco.mj_contactForce(world.model, world.data, i, force)
                spot = frame.T @ (contact.pos - centre) / half
                column, row = np.clip((TAXELS * (spot[[0, 2]] + 1) / 2).astype(int), 0, TAXELS - 1)
                grid[row, column] += abs(force[0])
        return grid

    return read


STREAMS: dict[str, Stream] = {
    "robot0_eef_pos": Stream((3,), 3.0, lambda world: world.arm.hand),
    "robot0_eef_quat": Stream((4,), 1.0, _hand_quat),
    "robot0_joint_pos": Stream((JOINTS,), 7.0, lambda world: world.arm.joint_pos),
    "robot0_joint_vel": Stream((JOINTS,), 100.0, lambda world: world.arm.joint_vel),
    "robot0_gripper_qpos": Stream((2,), 0.1, lambda world: world.arm.finger_pos),
    "force_torque": Stream((6,), 1e4, wrench),
    "force_torque_world": Stream((3,), 1e4, _world_force),
    **{name: Stream((TAXELS, TAXELS), 1e4, _tactile(pad)) for name, pad in PADS.items()},
}
"""All streams but the cameras. Quaternions are xyzw, as robosuite's key promises."""

CAMERAS = {
    "rgb_exo_right_cam": "agentview",
    "rgb_exo_left_cam": "sideview",
    "rgb_ego_cam": "robot0_robotview",
    "rgb_gripper_cam": "robot0_eye_in_hand",
}
"""The paper's names of the cameras, and robosuite's."""

JAW_ONLY = ("robot0_gripper_qpos", *PADS)
"""Streams that a robot without jaw does not have."""


def streams_of(embodiment: str) -> dict[str, Stream]:
    """All streams that this robot has."""
    return {name: stream for name, stream in STREAMS.items() if embodiment == JAW or name not in JAW_ONLY}


def proprioception(embodiment: str) -> tuple[str, ...]:
    """Names of the streams about the robot's own pose."""
    return tuple(name for name in streams_of(embodiment) if name.startswith("robot0_") and name not in PADS)


def check_names(names: Sequence[str], embodiment: str = JAW) -> None:
    """Raise `UnknownName` for the first name that is neither a stream of this robot nor a camera."""
    known = [*streams_of(embodiment), *CAMERAS]
    for name in names:
        if name not in known:
            raise UnknownName("observation", name, known)
