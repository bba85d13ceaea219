"""What a policy may see: the paper's streams under robosuite's names, each read only if it is asked for.

Shapes, units and names follow the paper's table of modalities; images are (height, width, 3), first row on top. The
table is of one arm. A second one has the same streams, with `robot1_` in the place of `robot0_` or before the name.

Where a scenario is seen turned or mirrored (`Scenario.orientation`), its pictures are, and no other stream: poses stay
in the axes in which actions are meant. `seen_<body>_pos` tells what such a picture suggests, to policies without eyes.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..errors import UnknownName
from ..geometry import Mat3
from ..orientation import Orientation
from ..robots.panda import JOINTS, MOST_ARMS, Names
from ..scenario import Scenario
from ..sim.world import JAW, Arm, World, hands

Reading = NDArray[np.float32] | NDArray[np.uint8]

TAXELS = 8
"""Rows and columns of a tactile grid (paper, table of modalities)."""
PADS = {"tactile_left": "finger1_pad_collision", "tactile_right": "finger2_pad_collision"}
"""The finger pad under each tactile grid. The grid spans the pad's inner face, columns along x, rows along z."""


@dataclass(frozen=True)
class Stream:
    """One kind of reading."""

    shape: tuple[int, ...]
    bound: float
    """No reading is larger in size; finite where the robot's limits make it so."""
    read: Callable[[World], NDArray[np.float64]]


def xyzw(rot: Mat3) -> NDArray[np.float64]:
    """A rotation as a quaternion in the order that robosuite's keys promise, shape (4,)."""
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, rot.ravel())
    return np.array([quat[1], quat[2], quat[3], quat[0]])


def _world_force(arm: Arm) -> NDArray[np.float64]:
    return arm.wrist_rot @ arm.wrench()[:3]


def _tactile(pad: str) -> Callable[[Arm], NDArray[np.float64]]:
    def read(arm: Arm) -> NDArray[np.float64]:
        """Normal force of every contact on the pad, in the taxel where it acts [N]."""
        world, grid, force = arm.world, np.zeros((TAXELS, TAXELS)), np.zeros(6)
        geom = world.model.geom(f"{Names(arm.number).hand}{pad}").id
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


def _of_arm(number: int, hand: str) -> dict[str, Stream]:
    """The streams of one arm but the cameras. Quaternions are xyzw, as robosuite's key promises."""
    robot, further = Names(number).arm, Names(number).arm if number else ""

    def stream(shape: tuple[int, ...], bound: float, read: Callable[[Arm], NDArray[np.float64]]) -> Stream:
        return Stream(shape, bound, lambda world: read(world.arms[number]))

    found = {
        f"{robot}eef_pos": stream((3,), 3.0, lambda arm: arm.hand),
        f"{robot}eef_quat": stream((4,), 1.0, lambda arm: xyzw(arm.hand_rot)),
        f"{robot}joint_pos": stream((JOINTS,), 7.0, lambda arm: arm.joint_pos),
        f"{robot}joint_vel": stream((JOINTS,), 100.0, lambda arm: arm.joint_vel),
        f"{robot}gripper_qpos": stream((2,), 0.1, lambda arm: arm.finger_pos),
        f"{further}force_torque": stream((6,), 1e4, lambda arm: arm.wrench()),
        f"{further}force_torque_world": stream((3,), 1e4, _world_force),
        **{f"{robot}{name}": stream((TAXELS, TAXELS), 1e4, _tactile(pad)) for name, pad in PADS.items()},
    }
    lacking = [] if hand == JAW else [f"{robot}{name}" for name in JAW_ONLY]
    return {name: stream for name, stream in found.items() if name not in lacking}


def turns_pictures(family: type[Scenario]) -> bool:
    """Whether scenarios of a family may be seen turned or mirrored."""
    return family.orientation is not Scenario.orientation


def poses_of(scenario: Scenario, orientation: Callable[[], Orientation]) -> dict[str, Stream]:
    """Privileged streams of everything in a scenario that can move: robosuite's names, and where pictures show it.

    Args:
        orientation: how the pictures of the running scenario are held; asked only if its family turns any.
    """

    def of(body: str) -> dict[str, Stream]:
        poses = {
            f"{body}_pos": Stream((3,), 3.0, lambda world: world.pos(body)),
            f"{body}_quat": Stream((4,), 1.0, lambda world: xyzw(world.rot(body))),
        }
        seen = Stream((3,), 3.0, lambda world: orientation().seen_at(world.pos(body)))
        return {**poses, f"seen_{body}_pos": seen} if turns_pictures(type(scenario)) else poses

    scene = scenario.build()  # held by name: the bodies of a scene that nobody holds have lost their joints
    movable = [body.name for body in scene.bodies if body.joints or body.mocap]
    return {name: stream for body in movable for name, stream in of(body).items()}


POSE = ("eef_pos", "eef_quat", "joint_pos", "joint_vel", "gripper_qpos")
"""Streams about an arm's own pose."""
JAW_ONLY = ("gripper_qpos", *PADS)
"""Streams that an arm without jaw does not have."""

CAMERAS = {
    "rgb_exo_right_cam": "agentview",
    "rgb_exo_left_cam": "sideview",
    "rgb_ego_cam": "robot0_robotview",
    "rgb_gripper_cam": "robot0_eye_in_hand",
}
"""The paper's names of the cameras, and robosuite's."""


def streams_of(embodiment: str) -> dict[str, Stream]:
    """All streams that this robot has but the cameras, one arm after the other."""
    arms = (_of_arm(number, hand) for number, hand in enumerate(hands(embodiment)))
    return {name: stream for arm in arms for name, stream in arm.items()}


def cameras_of(embodiment: str) -> dict[str, str]:
    """robosuite's names of all cameras that this robot has, by the paper's."""
    further = [Names(number).arm for number in range(1, len(hands(embodiment)))]
    return {**CAMERAS, **{f"{arm}rgb_gripper_cam": f"{arm}eye_in_hand" for arm in further}}


def proprioception(embodiment: str) -> tuple[str, ...]:
    """Names of the streams about the robot's own pose."""
    poses = [f"{Names(number).arm}{name}" for number in range(len(hands(embodiment))) for name in POSE]
    return tuple(name for name in streams_of(embodiment) if name in poses)


ALL = "+".join([JAW] * MOST_ARMS)
"""The robot that has every stream and camera that any has."""


def check_names(names: Sequence[str], embodiment: str, poses: Iterable[str]) -> None:
    """Raise `UnknownName` for the first name that is neither a stream of this robot nor a camera nor one of `poses`."""
    known = [*streams_of(embodiment), *cameras_of(embodiment), *poses]
    for name in names:
        if name not in known:
            raise UnknownName("observation", name, known)
