"""Streams of observations: the paper's streams under robosuite's names, each read only if it is requested.

Words stand for several streams (`WORDS`): `state` is the default.

Shapes, units and names follow the paper's table of modalities. Images are (height, width, 3), first row on top. The
table is for one arm. A second arm has the same streams, with `robot1_` in place of `robot0_` or as a prefix. An arm
that the scene's events move has no streams and is visible in pictures only.
`robot0_eef_quat` is the orientation of the grip site, robosuite's `robot0_eef_quat_site`. robosuite's own
`robot0_eef_quat` is the orientation of the body `right_hand`.

If a scenario is seen turned or mirrored (`Scenario.orientation`), only its pictures are turned: poses stay in the axes
of the actions. For state-based policies `seen_<body>_pos` is the position that such a picture shows.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..errors import UnknownName
from ..orientation import Orientation
from ..robots.panda import JOINTS, MAX_ARMS, Names
from ..scenario import Scenario
from ..sim.arm import Arm
from ..sim.embodiment import JAW, hands
from ..sim.world import World
from .object_state import NAME, POSE, ObjectState, quats, rounded, xyzw

Reading = NDArray[np.float32] | NDArray[np.uint8]

TAXELS = 8
"""Number of rows and of columns of a tactile grid (paper, table of modalities)."""
PADS = {"tactile_left": "finger1_pad_collision", "tactile_right": "finger2_pad_collision"}
"""Geom of the finger pad of each tactile grid. The grid spans the pad's inner face, columns along x, rows along z."""


@dataclass(frozen=True)
class Stream:
    """One kind of reading."""

    names: tuple[str, ...]
    """Name of each entry of a vector, such as `x`; or of each axis of a grid."""
    bound: float | NDArray[np.float64]
    """Largest absolute value, for all entries or for each; the robot's limits determine it where they can."""
    read: Callable[[World], NDArray[np.float64]]
    """Function that reads the stream from a world."""
    grid: tuple[int, ...] = ()
    """Shape of a grid; empty for a vector."""
    view: Callable[[World], NDArray[np.float64]] | None = None
    """Function that returns the array in which the simulation of a world holds the reading, now and later, so that
    many simulations are read at once; None if the reading has to be computed."""
    convert: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None
    """Function that converts n such arrays to readings, shape (n, entries); None if they are the readings."""

    @property
    def shape(self) -> tuple[int, ...]:
        return self.grid or (len(self.names),)

    def entries(self, name: str) -> tuple[str, ...]:
        """Full names of the entries, such as `robot0_eef_pos.x`, if the stream has this name."""
        return self.names if self.grid or name == NAME else tuple(f"{name}.{entry}" for entry in self.names)


def _wrench(arm: Arm) -> NDArray[np.float64]:
    wrench = arm.wrench()
    return np.concatenate([rounded(wrench[:3], "force"), rounded(wrench[3:], "torque")])


def _world_force(arm: Arm) -> NDArray[np.float64]:
    return arm.wrist_rot @ _wrench(arm)[:3]


def _tactile(pad: str) -> Callable[[Arm], NDArray[np.float64]]:
    def read(arm: Arm) -> NDArray[np.float64]:
        """Sum of the normal forces of the contacts in each taxel [N]."""
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


def _positions(joints: Sequence[str]) -> Callable[[World], NDArray[np.float64]]:
    return lambda world: _part(world.data.qpos, [world.model.joint(name).qposadr[0] for name in joints])


def _speeds(joints: Sequence[str]) -> Callable[[World], NDArray[np.float64]]:
    return lambda world: _part(world.data.qvel, [world.model.joint(name).dofadr[0] for name in joints])


def _part(values: NDArray[np.float64], places: Sequence[int]) -> NDArray[np.float64]:
    """Successive entries of an array of the simulation, not copied."""
    assert all(np.diff(places) == 1), "the joints of a chain follow one another"
    return values[places[0] : places[-1] + 1]


def _arm_streams(number: int, hand: str) -> dict[str, Stream]:
    """The streams of one arm without the cameras. Quaternions are xyzw, as under robosuite's keys."""
    own = Names(number)
    robot, prefix = own.arm, own.arm if number else ""

    def stream(
        names: Sequence[str], bound: float, read: Callable[[Arm], NDArray[np.float64]], **further: Any
    ) -> Stream:
        return Stream(tuple(names), bound, lambda world: read(world.arms[number]), **further)

    def grid(pad: str) -> Stream:
        read = _tactile(pad)
        return Stream(("row", "column"), 1e4, lambda world: read(world.arms[number]), (TAXELS, TAXELS))

    joints, force = [f"joint{i + 1}" for i in range(JOINTS)], ("force_x", "force_y", "force_z")
    found = {
        f"{robot}eef_pos": stream(
            POSE["pos"], 3.0, lambda arm: arm.hand, view=lambda w: w.data.site(own.grip_site).xpos
        ),
        f"{robot}eef_quat": stream(
            POSE["quat"],
            1.0,
            lambda arm: xyzw(arm.hand_rot),
            view=lambda w: w.data.site(own.grip_site).xmat,
            convert=lambda rots: quats(rots.reshape(-1, 3, 3)),
        ),
        f"{robot}joint_pos": stream(joints, 7.0, lambda arm: arm.joint_pos, view=_positions(own.joints)),
        f"{robot}joint_vel": stream(joints, 100.0, lambda arm: arm.joint_vel, view=_speeds(own.joints)),
        f"{robot}gripper_qpos": stream(
            ("finger_joint1", "finger_joint2"), 0.1, lambda arm: arm.finger_pos, view=_positions(own.finger_joints)
        ),
        f"{prefix}force_torque": stream((*force, "torque_x", "torque_y", "torque_z"), 1e4, _wrench),
        f"{prefix}force_torque_world": stream(force, 1e4, _world_force),
        **{f"{robot}{name}": grid(pad) for name, pad in PADS.items()},
    }
    missing = [] if hand == JAW else [f"{robot}{name}" for name in JAW_ONLY]
    return {name: stream for name, stream in found.items() if name not in missing}


def turns_pictures(family: type[Scenario]) -> bool:
    """Whether scenarios of a family may be seen turned or mirrored."""
    return family.orientation is not Scenario.orientation


def privileged(state: ObjectState, family: type[Scenario], orientation: Callable[[], Orientation]) -> dict[str, Stream]:
    """`object-state`, each reading in it as a stream, and the positions at which pictures show the bodies.

    Args:
        orientation: function that gives the orientation of pictures of the running scenario; used only if its family
            turns any.
    """
    found = {NAME: Stream(state.names, state.bounds, state.read)}
    for body, moves in state.bodies.items():
        found |= _body_streams(ObjectState({body: moves}, state.arms))
        if turns_pictures(family) and moves:
            found[f"seen_{body}_pos"] = _seen_position(body, orientation)
    return found


def _body_streams(state: ObjectState) -> dict[str, Stream]:
    """The readings of one body, each as a stream."""

    def part(where: slice) -> Stream:
        names = tuple(name.rpartition(".")[2] for name in state.names[where])
        return Stream(names, state.bounds[where], lambda world: state.read(world)[where])

    return {name: part(where) for name, where in state.segments.items()}


def _seen_position(body: str, orientation: Callable[[], Orientation]) -> Stream:
    """The position; 0 if the scene lacks the body, as in `object-state`."""

    def read(world: World) -> NDArray[np.float64]:
        if mujoco.mj_name2id(world.model, mujoco.mjtObj.mjOBJ_BODY, body) < 0:
            return np.zeros(3)
        return orientation().seen_at(rounded(world.pos(body), "pos"))

    return Stream(POSE["pos"], 3.0, read)


OWN_POSE = ("eef_pos", "eef_quat", "joint_pos", "joint_vel", "gripper_qpos")
"""Streams of an arm's own pose, without its prefix."""
JAW_ONLY = ("gripper_qpos", *PADS)
"""Streams that only an arm with a jaw has."""

CAMERAS = {
    "rgb_exo_right_cam": "agentview",
    "rgb_exo_left_cam": "sideview",
    "rgb_ego_cam": "robot0_robotview",
    "rgb_gripper_cam": "robot0_eye_in_hand",
}
"""robosuite's names of the cameras, by the paper's."""


def streams_of(embodiment: str) -> dict[str, Stream]:
    """All streams of a robot without the cameras, one arm after the other."""
    arms = (_arm_streams(number, hand) for number, hand in enumerate(hands(embodiment)))
    return {name: stream for arm in arms for name, stream in arm.items()}


def cameras_of(embodiment: str) -> dict[str, str]:
    """robosuite's names of all cameras of a robot, by the paper's."""
    further = [Names(number).arm for number in range(1, len(hands(embodiment)))]
    return {**CAMERAS, **{f"{arm}rgb_gripper_cam": f"{arm}eye_in_hand" for arm in further}}


def proprioception(embodiment: str) -> tuple[str, ...]:
    """Names of the streams of the robot's own pose."""
    poses = [f"{Names(number).arm}{name}" for number in range(len(hands(embodiment))) for name in OWN_POSE]
    return tuple(name for name in streams_of(embodiment) if name in poses)


ALL = "+".join([JAW] * MAX_ARMS)
"""Embodiment that has all streams and cameras."""

STATE = "state"
"""Word for the robot's own pose and `object-state`."""
PICTURES = "pictures"
"""Word for the robot's own pose and all cameras."""
PROPRIOCEPTION = "proprioception"
"""Word for the robot's own pose."""
WORDS = (STATE, PICTURES, PROPRIOCEPTION)
"""Words for several streams."""


def requested(names: str | Iterable[str] | None, embodiment: str) -> tuple[str, ...]:
    """Names of streams and cameras that some names and words stand for, each once; `state` for None."""
    given = [names] if isinstance(names, str) else [STATE] if names is None else names
    own = proprioception(embodiment)
    words = {STATE: (*own, NAME), PICTURES: (*own, *cameras_of(embodiment)), PROPRIOCEPTION: own}
    return tuple(dict.fromkeys(each for name in given for each in words.get(name, (name,))))


MEANT: dict[str, str] = dict.fromkeys("image images camera cameras pixels rgb vision visual".split(), PICTURES)
"""What words of other packages are called here."""


def check_names(names: Sequence[str], embodiment: str, poses: Iterable[str]) -> None:
    """Raise `UnknownName` for all names that are neither streams nor cameras of the robot, nor in `poses`."""
    known = {*WORDS, *streams_of(embodiment), *cameras_of(embodiment), *poses}
    if unknown := [name for name in names if name not in known]:
        raise UnknownName("observation", unknown[0], known, MEANT.get(unknown[0]), unknown[1:])


MOVES = ("move_x", "move_y", "move_z", "turn_x", "turn_y", "turn_z", "gripper")
"""Names of the seven numbers of an arm's action."""


def action_names(embodiment: str) -> tuple[str, ...]:
    """Names of the numbers of an action, such as `robot0_move_x`."""
    return tuple(f"{Names(number).arm}{move}" for number in range(len(hands(embodiment))) for move in MOVES)


@dataclass(frozen=True)
class Entry:
    """Where a reading such as `tile_0_pos`, or one of its numbers such as `tile_0_pos.x`, lies in an observation."""

    name: str
    stream: str
    """Name of the vector that holds it."""
    where: slice
    """Its place in the vector."""
    numbers: tuple[str, ...]
    """Names of its numbers, such as x, y and z; empty for a single number."""

    def of(self, observation: Mapping[str, Reading]) -> Reading:
        """The reading in an observation, shape (n,); in observations of m environments, shape (m, n)."""
        return observation[self.stream][..., self.where]

    @property
    def unit(self) -> str:
        """Unit of its numbers; empty for quaternions and for unknown readings."""
        reading = self.name.partition(".")[0]
        return next((unit for end, unit in UNITS.items() if reading.endswith(end)), "")

    def __str__(self) -> str:
        place, numbers = f"{self.stream}[{self.where.start}:{self.where.stop}]", self.numbers
        several = numbers if len(numbers) < MANY else (numbers[0], "to", numbers[-1])
        return " ".join([f"{place:24}", f"{self.name:28}", *several, self.unit]).rstrip()


MANY = 5
"""Number of numbers from which on a legend names the first and the last only."""
UNITS = {
    "joint_pos": "[rad]",
    "joint_vel": "[rad/s]",
    "gripper_qpos": "[m]",
    "vel_lin": "[m/s]",
    "vel_ang": "[rad/s]",
    "pos": "[m]",
    "box_low": "[m]",
    "box_high": "[m]",
    "force_torque": "[N], [N m]",
    "force_torque_world": "[N]",
}
"""Units of readings by the ends of their names, longer ends first."""


def entries_of(names: Mapping[str, Sequence[str]]) -> dict[str, Entry]:
    """All readings in some vectors, by name.

    Args:
        names: full names of the entries of each vector, as in the metadata of an environment.
    """
    found = dict[str, Entry]()
    for stream, entries in names.items():
        readings = [entry.rpartition(".") for entry in entries]
        for name, some in groupby(enumerate(readings), key=lambda each: each[1][0]):
            places = list(some)
            if name:
                where = slice(places[0][0], places[-1][0] + 1)
                found[name] = Entry(name, stream, where, tuple(last for _, (*_, last) in places))
    return found


def named(streams: Mapping[str, Stream], names: Iterable[str]) -> tuple[str, ...]:
    """Full names of the entries of some streams, one after the other."""
    return tuple(entry for name in names for entry in streams[name].entries(name))
