"""One arm of a world: readings of its joints, hand and wrist, and the gripper's command."""

import functools
import weakref
from typing import TYPE_CHECKING, NoReturn

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import UnknownName
from ..geometry import Mat3, Vec3
from ..robots import panda
from ..robots.jaw import OVERLAP
from ..robots.panda import Names

if TYPE_CHECKING:
    from .world import World

ROBOT = "robot"
"""Name that stands for any body of any arm in questions about contact."""
IDLE: NDArray[np.float64] = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0])
"""Action of one arm without motion and with the gripper open, as an arm gets it if nothing is commanded from the
start."""


class Arm:
    """One arm of a world with its hand: everything that a move reads and steers."""

    def __init__(self, world: "World", number: int):
        model, names = world.model, Names(number)
        self.world: World = weakref.proxy(world)  # a cycle would delay freeing a world's memory
        self.number, self.data = number, world.data
        self.grip = -1.0
        """Gripper command of the last action: -1 open or suction off, 1 closed or suction on. Before the first action:
        1 if the jaw holds a body at the start, else -1."""
        self.scripted_action: NDArray[np.float64] = IDLE
        """Action of a scripted arm in the coming control period, shape (7,)."""
        joints = [model.joint(name) for name in names.joints]
        self._qpos, self._dofs = np.array([j.qposadr[0] for j in joints]), np.array([j.dofadr[0] for j in joints])
        self._fingers = np.array(panda.fingers(model, names), int)
        site = model.site(names.grip_site).id
        self._hand, self._hand_rot = self.data.site_xpos[site], self.data.site_xmat[site].reshape(3, 3)  # views
        self._wrist = model.site(names.wrist_site).id

    def __reduce__(self) -> NoReturn:
        raise TypeError("an Arm belongs to its World and cannot be copied or pickled alone; copy the World")

    @property
    def label(self) -> str:
        """Name of the arm in questions about contact: `robot0`, `robot1`."""
        return f"{ROBOT}{self.number}"

    @property
    def hand(self) -> Vec3:
        """Position of the grip site [m], between the finger tips or in the middle of the suction cup's lip."""
        return self._hand.copy()

    @property
    def hand_rot(self) -> Mat3:
        """Orientation of the grip site. Its z axis points out of the hand."""
        return self._hand_rot.copy()

    @property
    def joint_pos(self) -> NDArray[np.float64]:
        """Angles of the seven joints [rad]."""
        return self.data.qpos[self._qpos]

    @property
    def joint_vel(self) -> NDArray[np.float64]:
        """Speeds of the seven joints [rad/s]."""
        return self.data.qvel[self._dofs]

    @property
    def finger_pos(self) -> NDArray[np.float64]:
        """Positions of the two finger joints [m]; empty without a jaw."""
        return self.data.qpos[self._fingers]

    @property
    def gap(self) -> float:
        """Distance between the two pads of a jaw [m]."""
        one, other = self.finger_pos
        return float(one - other) - OVERLAP

    @property
    def suction(self) -> bool:
        """Whether the hand is a suction cup instead of a jaw."""
        return not len(self._fingers)

    @property
    def sealed(self) -> bool:
        """Whether the suction cup pulled at the last physics step: it was switched on, and its lip was closed."""
        return bool(self.data.ctrl[self._cup] > 0.0)

    def grips(self, body: str) -> bool:
        """Whether both fingers touch a body, at least one with its pad, or the suction cup that touches it pulls.

        A body that droops leaves one pad and leans on the face of the finger below it.
        """
        if self.suction:
            return self.sealed and self.world.touching(self._cup_pads, body)
        pads, rest = zip(*self._touches(body), strict=True)
        return any(pads) and all(pad or other for pad, other in zip(pads, rest, strict=True))

    def _touches(self, body: str) -> list[tuple[bool, ...]]:
        """Whether the pad and the rest of each finger touch a body."""
        touching = self.world.touching
        return [tuple(touching(part, body) for part in finger) for finger in self._finger_bodies]

    @functools.cached_property
    def _finger_bodies(self) -> tuple[tuple[str, ...], ...]:
        """Names of the pad and of the rest of each finger."""
        return tuple(map(tuple, Names(self.number).finger_bodies))

    @functools.cached_property
    def _cup_pads(self) -> str:
        """Name of the body with the pads of the cup."""
        return Names(self.number).cup_pads

    @property
    def idle(self) -> NDArray[np.float64]:
        """Action without motion that keeps the gripper command, shape (7,)."""
        return np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, self.grip])

    def jam(self, on: bool) -> None:
        """Force the gripper open, or switch the suction off, against any command until `jam(False)` is called.

        The jam acts in every physics step and belongs to the state.

        Raises:
            NoEvent: the caller is not a scenario's `events`.
        """
        self.world.check_event("jamming a gripper")
        self.world.loop.jam(self.number, on)

    def set_action(self, action: ArrayLike) -> None:
        """Set the action of a scripted arm for the coming control period only. Without a call the arm stays in place,
        open.

        Args:
            action: seven numbers, which the controller gets unfiltered.

        Raises:
            NoEvent: the caller is not a scenario's `events`.
            UnknownName: the arm is driven by actions.
        """
        if self not in self.world.partners:
            raise UnknownName("scripted arm", self.label, [arm.label for arm in self.world.partners])
        self.world.check_event(f"setting the action of {self.label}")
        self.scripted_action = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        self.grip = float(self.scripted_action[-1])

    def wrench(self) -> NDArray[np.float64]:
        """Force [N] and torque [N m] between hand and wrist in the axes of the wrist's sensor frame, shape (6,).

        The numbers equal those of robosuite's force and torque sensors. They are computed on demand, because sensors in
        the model would cost time in every step. A hand at rest reads the force that supports it, which points up.
        """
        model, data = self.world.model, self.data
        mujoco.mj_rnePostConstraint(model, data)
        body = int(model.site_bodyid[self._wrist])
        moment, force = data.cfrc_int[body, :3], data.cfrc_int[body, 3:]
        lever = data.site_xpos[self._wrist] - data.subtree_com[model.body_rootid[body]]
        frame = self.wrist_rot
        return np.concatenate([frame.T @ force, frame.T @ (moment - np.cross(lever, force))])

    def load(self) -> NDArray[np.float64]:
        """Force [N] and torque about the grip site [N m] that support the held object, world axes, shape (6,).

        By Newton's law this is the wrist's reading minus the hand's own weight and inertial forces.
        """
        model, data = self.world.model, self.data
        mujoco.mj_rnePostConstraint(model, data)
        first = int(model.site_bodyid[self._wrist])
        moment, force = -data.cfrc_ext[self._hand_parts].sum(axis=0).reshape(2, 3)
        lever = self.hand - data.subtree_com[model.body_rootid[first]]
        return np.concatenate([force, moment - np.cross(lever, force)])

    @functools.cached_property
    def _hand_parts(self) -> list[int]:
        """Indices of the bodies beyond the wrist."""
        model, parts = self.world.model, [int(self.world.model.site_bodyid[self._wrist])]
        for body in range(parts[0] + 1, model.nbody):
            if int(model.body_parentid[body]) in parts:
                parts.append(body)
        return parts

    @property
    def wrist_rot(self) -> Mat3:
        """Orientation of the wrist's force and torque sensor."""
        return self.data.site_xmat[self._wrist].reshape(3, 3).copy()

    @functools.cached_property
    def wrist_range(self) -> tuple[float, float]:
        """Limits of the last joint [rad]."""
        low, high = self.world.model.joint(Names(self.number).joints[-1]).range
        return float(low), float(high)

    @functools.cached_property
    def _cup(self) -> int:
        """Index of the suction cup's actuator."""
        return self.world.model.actuator(Names(self.number).cup).id
