"""World: a running simulation seen through names. SI units, world frame, wxyz quaternions."""

import functools
import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Self

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import UnknownName, Unstable
from ..robots import osc, panda, suction
from ..robots.teleop import Filter
from . import scene_text
from .loop import Loop

Vec3 = NDArray[np.float64]
"""Shape (3,)."""
Mat3 = NDArray[np.float64]
"""Shape (3, 3), columns are the axes of the body."""

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


@dataclass
class World:
    """Names -> numbers. Holds no task logic. Made by `World.load`, driven by `step`."""

    model: mujoco.MjModel
    data: mujoco.MjData
    loop: Loop
    filter: Filter = field(default_factory=Filter)
    grip: float = -1.0
    """The gripper command of the last action: -1 open or suction off, 1 closed or suction on."""

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
        self.grip = -1.0

    def step(self, action: ArrayLike) -> NDArray[np.float32]:
        """Pass an action through the teleoperation filter and live one control period of 10 ms.

        Returns:
            What the controller received, shape (7,).

        Raises:
            Unstable: MuJoCo raised a warning.
        """
        filtered = self.filter(action)
        self.follow(filtered)
        return filtered

    def follow(self, filtered: NDArray[np.float32]) -> None:
        """Live one control period under an action that has passed the filter already, shape (7,).

        Raises:
            Unstable: MuJoCo raised a warning.
        """
        self.grip = float(filtered[6])
        if self.loop.tick(filtered):
            raise Unstable(f"MuJoCo raised a warning at t = {self.time:.3f} s: {', '.join(self.warnings)}")

    # --- questions ------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Seconds since the start."""
        return self.data.time

    @property
    def hand(self) -> Vec3:
        """Position of the grip site, between the finger tips or in the middle of the suction cup's lip [m]."""
        return self.data.site_xpos[self._grip_site].copy()

    @property
    def hand_frame(self) -> Mat3:
        """Orientation of the grip site; its z axis points out of the hand."""
        return self.data.site_xmat[self._grip_site].reshape(3, 3).copy()

    @property
    def joint_pos(self) -> NDArray[np.float64]:
        """Angles of the arm's seven joints [rad]."""
        return self.data.qpos[self._joints[0]]

    @property
    def joint_vel(self) -> NDArray[np.float64]:
        """Speeds of the arm's seven joints [rad/s]."""
        return self.data.qvel[self._joints[1]]

    @property
    def finger_pos(self) -> NDArray[np.float64]:
        """Positions of the two finger joints [m]; empty without a jaw."""
        return self.data.qpos[self._joints[2]]

    def pos(self, body: str) -> Vec3:
        """Origin of a body [m]."""
        return self.data.xpos[self.body(body)].copy()

    def com(self, body: str) -> Vec3:
        """Centre of mass of a body [m]."""
        return self.data.xipos[self.body(body)].copy()

    def frame(self, body: str) -> Mat3:
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

    @property
    def sealed(self) -> bool:
        """Whether the suction cup pulled at the last physics step: switched on, with its lip closed."""
        return bool(self.data.ctrl[self.model.actuator(osc.CUP).id] > 0.0)

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
        return np.concatenate([self.loop.state(), self.filter.state, [self.grip]])

    def restore(self, state: NDArray[np.float64]) -> None:
        """Continue from `state()` of a world of the same scene, bit by bit."""
        n = len(self.filter.state)
        self.loop.restore(state[: -n - 1])
        self.filter.state = state[-n - 1 : -1]
        self.grip = float(state[-1])

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
    def _joints(self) -> tuple[list[int], list[int], list[int]]:
        """Places of the arm's joints in qpos and in qvel, and of the fingers in qpos."""
        arm = [self.model.joint(f"robot0_joint{i + 1}") for i in range(panda.JOINTS)]
        return [j.qposadr[0] for j in arm], [j.dofadr[0] for j in arm], panda.fingers(self.model)

    @functools.cached_property
    def _grip_site(self) -> int:
        return self.model.site("gripper0_right_grip_site").id

    @functools.cached_property
    def _free(self) -> tuple[str, ...]:
        joints = np.flatnonzero(self.model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
        return tuple(self.model.body(int(self.model.jnt_bodyid[j])).name for j in joints)

    def _label(self, name: str) -> int:
        return self.model.nbody if name == ROBOT else self.body(name)
