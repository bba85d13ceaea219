"""World: a running simulation seen through names. SI units, world frame, wxyz quaternions."""

import functools
import hashlib
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Self

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..control.loop import Loop
from ..control.teleop import Filter
from ..errors import UnknownName, Unstable
from ..geometry import Mat3, Vec3
from ..robots import panda, suction
from ..robots.panda import Names
from . import scene_text

ROBOT = "robot"
"""Stands for any body of the robot in questions about contact."""
IDLE: NDArray[np.float64] = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0])
"""No motion, gripper open: what doing nothing means from the start."""


JAW = "panda_jaw"
SUCTION = "panda_suction"
EMBODIMENTS: dict[str, Callable[[mujoco.MjSpec, bool], None]] = {JAW: panda.attach, SUCTION: suction.attach}
"""The robots that a task may ask for, and how each is added to a scene, with or without visual geometry."""


def compose(scene_xml: str, embodiment: str, visual: bool = False) -> mujoco.MjSpec:
    """The scene of a pool with its robot added; without visual geometry unless asked for.

    The text is what counts: it is parsed anew, so that exactly the scene on disk is simulated.
    """
    scene_text.check(scene_xml)
    scene = mujoco.MjSpec.from_string(scene_xml)
    if not visual:
        panda.strip_visual(scene)
    EMBODIMENTS[embodiment](scene, visual)
    return scene


class Arm:
    """One arm of a world with its hand: what a move looks at, and steers."""

    def __init__(self, world: "World", number: int):
        model, names = world.model, Names(number)
        self.world: World = weakref.proxy(world)  # no circle: a world that nobody holds must free its memory at once
        self.number, self.data = number, world.data
        self.grip = -1.0
        """The gripper command of the last action: -1 open or suction off, 1 closed or suction on."""
        joints = [model.joint(name) for name in names.joints]
        self._qpos, self._dofs = [j.qposadr[0] for j in joints], [j.dofadr[0] for j in joints]
        self._fingers = panda.fingers(model, names)
        self._site = model.site(names.grip_site).id

    @property
    def hand(self) -> Vec3:
        """Position of the grip site, between the finger tips or in the middle of the suction cup's lip [m]."""
        return self.data.site_xpos[self._site].copy()

    @property
    def hand_rot(self) -> Mat3:
        """Orientation of the grip site; its z axis points out of the hand."""
        return self.data.site_xmat[self._site].reshape(3, 3).copy()

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
    def sealed(self) -> bool:
        """Whether the suction cup pulled at the last physics step: switched on, with its lip closed."""
        return bool(self.data.ctrl[self._cup] > 0.0)

    @property
    def idle(self) -> NDArray[np.float64]:
        """The action without motion that keeps the gripper command, shape (7,)."""
        return np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, self.grip])

    @functools.cached_property
    def wrist_range(self) -> tuple[float, float]:
        """Limits of the last joint [rad]."""
        low, high = self.world.model.joint(Names(self.number).joints[-1]).range
        return float(low), float(high)

    @functools.cached_property
    def _cup(self) -> int:
        return self.world.model.actuator(Names(self.number).cup).id


@dataclass
class World:
    """Names -> numbers. Holds no task logic. Made by `World.load`, driven by `step`."""

    model: mujoco.MjModel
    data: mujoco.MjData
    loop: Loop
    filter: Filter = field(default_factory=Filter)
    arms: tuple[Arm, ...] = field(init=False)
    """All arms of the robot; an action holds seven numbers for each, in this order."""

    def __post_init__(self) -> None:
        self.arms = (Arm(self, 0),)

    @classmethod
    def load(cls, scene_xml: str, embodiment: str = JAW, visual: bool = False, substeps: int | None = None) -> Self:
        """Compile a scene text with the robot and put everything at its start.

        Args:
            scene_xml: MJCF of the scene, robot not included.
            embodiment: one of `EMBODIMENTS`.
            visual: keep visual geometry, for rendering; the physics is the same, bit by bit.
            substeps: physics steps in a control period of 10 ms, instead of the scene's own time step.
        """
        spec = compose(scene_xml, embodiment, visual)
        if substeps is not None:
            spec.option.timestep = Loop.PERIOD / substeps
        return cls.of(spec.compile())

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Self:
        """A world at its start, around a compiled scene with robot."""
        data = mujoco.MjData(model)
        world = cls(model, data, Loop(model, data))
        world.reset()
        return world

    def reset(self) -> None:
        """Back to the start; a used world then behaves bit by bit like a fresh one."""
        self.loop.reset()
        self.filter.reset()
        for arm in self.arms:
            arm.grip = -1.0

    def step(self, action: ArrayLike) -> NDArray[np.float32]:
        """Pass an action through the teleoperation filter and advance one control period (10 ms).

        Returns:
            What the controller received, shape (7,).

        Raises:
            Unstable: MuJoCo raised a warning.
        """
        filtered = self.filter(action)
        self.apply(filtered)
        return filtered

    def apply(self, filtered: NDArray[np.float32]) -> None:
        """Advance one control period under an action that has passed the filter already, shape (7,).

        Raises:
            Unstable: MuJoCo raised a warning.
        """
        for arm in self.arms:
            arm.grip = float(filtered[7 * arm.number + 6])
        if self.loop.step(filtered):
            raise Unstable(f"MuJoCo raised a warning at t = {self.time:.3f} s: {', '.join(self.warnings)}")

    # --- questions ------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Seconds since the start."""
        return self.data.time

    @property
    def arm(self) -> Arm:
        """The only arm of a world that has one."""
        (arm,) = self.arms
        return arm

    @property
    def idle(self) -> NDArray[np.float64]:
        """The action without motion that keeps all gripper commands, shape (7 * arms,)."""
        return np.concatenate([arm.idle for arm in self.arms])

    def pos(self, body: str) -> Vec3:
        """Origin of a body [m]."""
        return self.data.xpos[self.body(body)].copy()

    def com(self, body: str) -> Vec3:
        """Centre of mass of a body [m]."""
        return self.data.xipos[self.body(body)].copy()

    def rot(self, body: str) -> Mat3:
        """Orientation of a body."""
        return self.data.xmat[self.body(body)].reshape(3, 3).copy()

    def tilt(self, body: str) -> float:
        """Angle between a body's z axis and the vertical [rad]."""
        return float(np.arccos(min(1.0, max(-1.0, self.data.xmat[self.body(body), 8]))))

    def velocity(self, body: str) -> NDArray[np.float64]:
        """Angular [rad/s] and linear [m/s] velocity of a body's centre of mass, world axes, shape (6,)."""
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, self.body(body), velocity, 0)
        return velocity

    def touching(self, a: str, b: str) -> bool:
        """Whether two bodies were in contact at any physics step of the last control period."""
        return bool(self.loop.touching[self._label(a), self._label(b)])

    def touched(self, a: str, b: str) -> bool:
        """Whether two bodies were in contact at any physics step since the start."""
        return bool(self.loop.touched[self._label(a), self._label(b)])

    def touching_bodies(self, body: str) -> set[str]:
        """Names of the bodies that a body touched in the last control period; `ROBOT` stands for the robot's own."""
        others = np.flatnonzero(self.loop.touching[self._label(body)])
        return {ROBOT if i == self.model.nbody else self.model.body(int(i)).name for i in others if i not in self._own}

    @property
    def free_bodies(self) -> tuple[str, ...]:
        """Names of all bodies that hang on a free joint."""
        return self._free

    @property
    def warnings(self) -> list[str]:
        """Kinds of warnings that MuJoCo raised since the start."""
        kinds = mujoco.mjtWarning
        return [kinds(i).name for i in range(kinds.mjNWARNING) if self.data.warning[i].number]

    def state(self) -> NDArray[np.float64]:
        """Everything that the future depends on, in one vector."""
        return np.concatenate([self.loop.state(), self.filter.state, [arm.grip for arm in self.arms]])

    def restore(self, state: NDArray[np.float64]) -> None:
        """Continue from `state()` of a world of the same scene, bit by bit."""
        loop, motion, grips = np.split(state, [-len(self.filter.state) - len(self.arms), -len(self.arms)])
        self.loop.restore(loop)
        self.filter.state = motion
        for arm, grip in zip(self.arms, grips, strict=True):
            arm.grip = float(grip)

    @property
    def digest(self) -> str:
        """Sixteen hex digits of the full physics state: equal digests mean bit-identical states."""
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        state = np.empty(mujoco.mj_stateSize(self.model, kind))
        mujoco.mj_getState(self.model, self.data, state, kind)
        return hashlib.sha256(state.tobytes()).hexdigest()[:16]

    # --- names ----------------------------------------------------------------------------

    def body(self, name: str) -> int:
        """Index of a named body."""
        if name not in self._bodies:
            raise UnknownName("body", name, self._bodies)
        return self._bodies[name]

    @functools.cached_property
    def _bodies(self) -> dict[str, int]:
        return {self.model.body(i).name: i for i in range(self.model.nbody)}

    @functools.cached_property
    def _own(self) -> frozenset[int]:
        """Bodies of the robot."""
        return frozenset(np.flatnonzero(self.model.body_rootid == self.model.body(Names().base).id).tolist())

    @functools.cached_property
    def _free(self) -> tuple[str, ...]:
        joints = np.flatnonzero(self.model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
        return tuple(self.model.body(int(self.model.jnt_bodyid[j])).name for j in joints)

    def _label(self, name: str) -> int:
        return self.model.nbody if name == ROBOT else self.body(name)
