"""What a policy may see: the paper's streams under robosuite's names, each read only if it is asked for.

Shapes, units and names follow the paper's table of modalities; images are (height, width, 3), first row on top. The
table is of one arm. A second one has the same streams, with `robot1_` in the place of `robot0_` or before the name; one
that the scene's events move has none, and is seen in pictures only.
`robot0_eef_quat` is the orientation of the grip site, robosuite's `robot0_eef_quat_site`; what robosuite calls
`robot0_eef_quat` is that of the body `right_hand`.

Where a scenario is seen turned or mirrored (`Scenario.orientation`), its pictures are, and no other stream: poses stay
in the axes in which actions are meant. `seen_<body>_pos` tells what such a picture suggests, to policies without eyes.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..errors import UnknownName
from ..orientation import Orientation
from ..robots.panda import JOINTS, MAX_ARMS, Names
from ..scenario import Scenario
from ..sim.world import JAW, Arm, World, hands
from .object_state import NAME, POSE, ObjectState, xyzw

Reading = NDArray[np.float32] | NDArray[np.uint8]

TAXELS = 8
"""Rows and columns of a tactile grid (paper, table of modalities)."""
PADS = {"tactile_left": "finger1_pad_collision", "tactile_right": "finger2_pad_collision"}
"""The finger pad under each tactile grid. The grid spans the pad's inner face, columns along x, rows along z."""


@dataclass(frozen=True)
class Stream:
    """One kind of reading."""

    names: tuple[str, ...]
    """What each entry of a vector is, such as `x`; of a grid, what its axes are."""
    bound: float | NDArray[np.float64]
    """No reading is larger in size; finite where the robot's limits make it so. One for all entries or one for each."""
    read: Callable[[World], NDArray[np.float64]]
    grid: tuple[int, ...] = ()
    """Shape of a grid; a vector has none."""

    @property
    def shape(self) -> tuple[int, ...]:
        return self.grid or (len(self.names),)

    def entries(self, name: str) -> tuple[str, ...]:
        """Full names of the entries, such as `robot0_eef_pos.x`, of a stream of that name."""
        return self.names if self.grid or name == NAME else tuple(f"{name}.{entry}" for entry in self.names)


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

    def stream(names: Sequence[str], bound: float, read: Callable[[Arm], NDArray[np.float64]]) -> Stream:
        return Stream(tuple(names), bound, lambda world: read(world.arms[number]))

    def grid(pad: str) -> Stream:
        read = _tactile(pad)
        return Stream(("row", "column"), 1e4, lambda world: read(world.arms[number]), (TAXELS, TAXELS))

    joints, push = [f"joint{i + 1}" for i in range(JOINTS)], ("force_x", "force_y", "force_z")
    found = {
        f"{robot}eef_pos": stream(POSE["pos"], 3.0, lambda arm: arm.hand),
        f"{robot}eef_quat": stream(POSE["quat"], 1.0, lambda arm: xyzw(arm.hand_rot)),
        f"{robot}joint_pos": stream(joints, 7.0, lambda arm: arm.joint_pos),
        f"{robot}joint_vel": stream(joints, 100.0, lambda arm: arm.joint_vel),
        f"{robot}gripper_qpos": stream(("finger_joint1", "finger_joint2"), 0.1, lambda arm: arm.finger_pos),
        f"{further}force_torque": stream((*push, "torque_x", "torque_y", "torque_z"), 1e4, lambda arm: arm.wrench()),
        f"{further}force_torque_world": stream(push, 1e4, _world_force),
        **{f"{robot}{name}": grid(pad) for name, pad in PADS.items()},
    }
    lacking = [] if hand == JAW else [f"{robot}{name}" for name in JAW_ONLY]
    return {name: stream for name, stream in found.items() if name not in lacking}


def turns_pictures(family: type[Scenario]) -> bool:
    """Whether scenarios of a family may be seen turned or mirrored."""
    return family.orientation is not Scenario.orientation


def privileged(state: ObjectState, family: type[Scenario], orientation: Callable[[], Orientation]) -> dict[str, Stream]:
    """`object-state`, each reading in it by itself, and where pictures show the bodies.

    Args:
        orientation: how the pictures of the running scenario are held; asked only if its family turns any.
    """
    found = {NAME: Stream(state.names, state.bounds, state.read)}
    for body, moves in state.bodies.items():
        found |= _parts(ObjectState({body: moves}, state.arms))
        if turns_pictures(family) and moves:
            found[f"seen_{body}_pos"] = _seen(body, orientation)
    return found


def _parts(state: ObjectState) -> dict[str, Stream]:
    """The readings of one body, each by itself."""

    def part(where: slice) -> Stream:
        names = tuple(name.rpartition(".")[2] for name in state.names[where])
        return Stream(names, state.bounds[where], lambda world: state.read(world)[where])

    return {name: part(where) for name, where in state.segments.items()}


def _seen(body: str, orientation: Callable[[], Orientation]) -> Stream:
    return Stream(POSE["pos"], 3.0, lambda world: orientation().seen_at(world.pos(body)))


OWN_POSE = ("eef_pos", "eef_quat", "joint_pos", "joint_vel", "gripper_qpos")
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
    poses = [f"{Names(number).arm}{name}" for number in range(len(hands(embodiment))) for name in OWN_POSE]
    return tuple(name for name in streams_of(embodiment) if name in poses)


ALL = "+".join([JAW] * MAX_ARMS)
"""The robot that has every stream and camera that any has."""


def check_names(names: Sequence[str], embodiment: str, poses: Iterable[str]) -> None:
    """Raise `UnknownName` for the first name that is neither a stream of this robot nor a camera nor one of `poses`."""
    known = [*streams_of(embodiment), *cameras_of(embodiment), *poses]
    for name in names:
        if name not in known:
            raise UnknownName("observation", name, known)


MOVES = ("move_x", "move_y", "move_z", "turn_x", "turn_y", "turn_z", "gripper")
"""What the seven numbers of an arm's action are."""


def action_names(embodiment: str) -> tuple[str, ...]:
    """What the numbers of an action are, such as `robot0_move_x`."""
    return tuple(f"{Names(number).arm}{move}" for number in range(len(hands(embodiment))) for move in MOVES)


def named(streams: Mapping[str, Stream], names: Iterable[str]) -> tuple[str, ...]:
    """Full names of the entries of some vectors, one after the other."""
    return tuple(entry for name in names for entry in streams[name].entries(name))
