"""A world: a running simulation accessed by names. SI units, world frame, wxyz quaternions."""

import functools
import hashlib
import weakref
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any, Self

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..control.impairment import Channel
from ..control.loop import ACTION, Loop
from ..control.teleop import Filter, unfiltered
from ..errors import NoEvent, UnknownName, Unstable
from ..geometry import Mat3, Vec3
from ..look.looks import Look
from ..robots import panda
from .arm import IDLE, ROBOT, Arm
from .embodiment import JAW, all_hands, compose, hands
from .memory import Memory
from .style import Style

ROBOTS_BODIES = ("robot", "gripper", "fixed_mount")
"""Beginnings of the names of bodies of robots."""
MAX_MEANS = 12
"""Largest number of means of a task."""
BODY = mujoco.mjtObj.mjOBJ_BODY


def _revived(kind: "type[World]", model: mujoco.MjModel, scripted: int, state: NDArray[np.float64]) -> "World":
    """A world of a compiled scene in a state."""
    world = kind.of(model, scripted)
    world.restore(state)
    return world


@dataclass(repr=False)
class World:
    """Simulation that maps names to numbers. It holds no task logic. `World.load` makes it, `step` drives it."""

    model: mujoco.MjModel
    """Compiled model of the scene with the robot."""
    data: mujoco.MjData
    """State of the simulation."""
    loop: Loop
    """Control loop of all arms."""
    scripted: int = 0
    """Number of arms, counted from the last, that the scene's events move instead of actions."""
    filter: Filter = field(init=False)
    """Teleoperation filter of the actions, which `received` applies."""
    channel: Channel = field(init=False)
    """Way of the actions to the controller, which `received` takes."""
    arms: tuple[Arm, ...] = field(init=False)
    """Arms that actions drive. An action holds seven numbers for each, in this order."""
    partners: tuple[Arm, ...] = field(init=False)
    """Arms that events move (`Arm.set_action`)."""
    memory: Memory = field(init=False)
    """Numbers that record the episode's history, by the names that the scene declares with `remember`; all 0 at the
    start."""
    shown: NDArray[np.float64] = field(init=False)
    """What has been found out about the means of the task, shape (`MAX_MEANS`,); see `scengen.means`."""
    style: Style | None = field(default=None, init=False)
    """Style of the moves in this episode; None for those of certificates. A reset removes it."""
    _happening: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        data = self.data
        self._pos, self._com, self._rot = data.xpos, data.xipos, data.xmat.reshape(-1, 3, 3)  # views of MuJoCo's memory
        self._forces = data.xfrc_applied
        every = tuple(Arm(self, names.number) for names in panda.arms(self.model))
        self.arms, self.partners = every[: len(every) - self.scripted], every[len(every) - self.scripted :]
        this = weakref.proxy(self)
        self.memory = Memory(self.model, self.data, lambda: this.check_event("writing to the memory"))
        self.filter, self.shown = Filter(len(self.arms)), np.zeros(MAX_MEANS)
        self.channel = Channel(self.loop.impairment, self.size)

    def __repr__(self) -> str:
        arms = f"{len(self.arms)} arms" if len(self.arms) > 1 else "1 arm"
        return f"World({self.model.nbody} bodies, {arms}, time {self.time:.2f} s)"

    @classmethod
    def load(cls, scene_xml: str, embodiment: str = JAW, look: Look | None = None, substeps: int | None = None) -> Self:
        """Compile a scene text with the robot and put everything at its start.

        Args:
            scene_xml: MJCF of the scene, without the robot.
            embodiment: one of `EMBODIMENTS`.
            look: look of its pictures; None: without visual geometry. The physics is the same bit by bit.
            substeps: physics steps in a control period of 10 ms; by default the scene's own time step decides.
        """
        spec = compose(scene_xml, embodiment, look is not None)
        if look is not None:
            look.dress(spec)
        if substeps is not None:
            spec.option.timestep = Loop.PERIOD / substeps
        return cls.of(spec.compile(), len(all_hands(embodiment)) - len(hands(embodiment)))

    @classmethod
    def of(cls, model: mujoco.MjModel, scripted: int = 0) -> Self:
        """A world at its start, around a compiled scene with robot.

        Args:
            scripted: number of arms, counted from the last, that the scene's events move.
        """
        data = mujoco.MjData(model)
        world = cls(model, data, Loop(model, data, scripted=scripted), scripted)
        world.reset()
        return world

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles get a separate simulation in the same state: addresses are looked up again."""
        return _revived, (type(self), self.model, self.scripted, self.state())

    def reset(self) -> None:
        """Return to the start. A used world then behaves bit by bit like a fresh one."""
        self.loop.reset()
        self.filter.reset()
        self.shown[:] = 0.0
        self.style = None
        for arm in (*self.arms, *self.partners):
            arm.grip, arm.scripted_action = (1.0 if self.loop.holds and arm.number == 0 else -1.0), IDLE
        self.channel.reset(self.idle)

    @property
    def size(self) -> int:
        """Length of an action."""
        return ACTION * len(self.arms)

    def step(self, action: ArrayLike) -> NDArray[np.float32]:
        """Pass an action through the teleoperation filter and advance one control period (10 ms).

        Returns:
            The action that the controller received, shape (7 * arms,).

        Raises:
            Unstable: MuJoCo raised a warning.
        """
        received = self.received(action)
        self.step_filtered(received)
        return received

    def received(self, action: ArrayLike, raw: bool = False) -> NDArray[np.float32]:
        """The action that the controller receives in the coming control period, in which another one is sent.

        Called once in a period. They differ where an impairment of the scene hinders the channel.

        Args:
            action: shape (7 * arms,), finite.
            raw: whether it is only clipped, instead of passing the teleoperation filter.
        """
        if self.channel.changes:
            action = self.channel(np.asarray(action), self.idle, round(self.time / Loop.PERIOD))
        return unfiltered(action) if raw else self.filter(action)

    def step_filtered(self, filtered: NDArray[np.float32]) -> None:
        """Advance one control period under an action that has already passed the filter, shape (7 * arms,).

        Raises:
            ValueError: the action has another shape or is not finite.
            Unstable: MuJoCo raised a warning.
        """
        warnings = self.loop.step(self.with_partner_actions(filtered))
        self.record_grip(filtered)
        if warnings:
            raise Unstable(f"MuJoCo raised a warning at t = {self.time:.3f} s: {', '.join(self.warnings)}")

    def with_partner_actions(self, action: NDArray[np.floating]) -> NDArray[np.floating]:
        """An action, shape (7 * arms,), followed by the partners' actions: the input of the controllers of all arms."""
        if not self.partners:
            return action
        if np.shape(action) != (self.size,):
            raise ValueError(f"an action has shape ({self.size},), not {np.shape(action)}")
        return np.concatenate([action, *(arm.scripted_action for arm in self.partners)], dtype=np.float32)

    def record_grip(self, action: NDArray[np.floating]) -> None:
        """Record the gripper commands of an action, shape (7 * arms,), that this or another simulator has simulated."""
        for arm in self.arms:
            arm.grip = float(action[ACTION * arm.number + ACTION - 1])

    # --- events ---------------------------------------------------------------------------

    def events(self) -> AbstractContextManager[None]:
        """The moment before a control period in which a scenario's events happen. An `Episode` opens it.

        Forces (`force`) and partners' actions (`Arm.set_action`) of the previous period end here.
        """
        return _Moment(self)

    def check_event(self, what: str) -> None:
        """Raise `NoEvent` unless events happen now.

        Args:
            what: the attempted change, for the error message.
        """
        if not self._happening:
            raise NoEvent(what)

    def move(self, body: str, pos: ArrayLike, turn: ArrayLike = (1.0, 0.0, 0.0, 0.0)) -> None:
        """Place a mocap body, such as a patch that marks the goal, elsewhere from the coming control period on.

        Such a body is visual only and pushes nothing away. Its place belongs to the state.

        Args:
            pos: position of its origin [m].
            turn: its orientation (wxyz).

        Raises:
            NoEvent: the caller is not a scenario's `events`.
            UnknownName: no mocap body has that name.
        """
        self.check_event(f"moving {body}")
        mocap = self.model.body_mocapid
        if body not in self._bodies or mocap[self.body(body)] < 0:
            raise UnknownName("mocap body", body, [name for name, b in self._bodies.items() if mocap[b] >= 0])
        self.data.mocap_pos[mocap[self.body(body)]] = pos
        self.data.mocap_quat[mocap[self.body(body)]] = turn

    def passes(self, moment: float) -> bool:
        """Whether `moment` [s] falls into the control period that starts now, to the nearest period."""
        return abs(self.time - moment) < Loop.PERIOD / 2

    def launch(self, body: str, linear: ArrayLike, angular: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """Give a free body a velocity, as by a blow.

        Args:
            linear: velocity of its origin [m/s], world axes, shape (3,).
            angular: angular velocity of the body [rad/s], world axes, shape (3,).

        Raises:
            NoEvent: the caller is not a scenario's `events`.
            UnknownName: no free body has that name.
        """
        self.check_event(f"launching {body}")
        if body not in self.free_bodies:
            raise UnknownName("free body", body, self.free_bodies)
        dof = int(self.model.body_dofadr[self.body(body)])
        self.data.qvel[dof : dof + 3] = linear
        self.data.qvel[dof + 3 : dof + 6] = self.rot(body).T @ np.asarray(angular, float)

    def force(self, body: str, force: ArrayLike) -> None:
        """Push a body at its centre of mass for the coming control period only: an impulse of force * 10 ms.

        Args:
            force: in world axes [N], shape (3,).

        Raises:
            NoEvent: the caller is not a scenario's `events`.
        """
        self.check_event(f"pushing {body}")
        self._forces[self.body(body), :3] = force

    def drive(self, joint: str, goal: float) -> None:
        """Send a joint with a servo (`prop.servo`) to `goal` [rad or m] from the coming control period on.

        The goal belongs to the state; it is 0 at the start.

        Raises:
            NoEvent: the caller is not a scenario's `events`.
            UnknownName: the joint has no servo.
        """
        self.check_event(f"driving {joint}")
        servos = {self.model.actuator(i).name: i for i in range(self.model.nu)}
        if joint not in servos:
            raise UnknownName("servo", joint, servos)
        self.data.ctrl[servos[joint]] = goal

    def spin(self, joint: str, rate: float) -> None:
        """Set the rate of a hinge [rad/s].

        Raises:
            NoEvent: the caller is not a scenario's `events`.
        """
        self.check_event(f"spinning {joint}")
        self.data.qvel[self.model.joint(joint).dofadr[0]] = rate

    # --- queries --------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return self.data.time

    @property
    def arm(self) -> Arm:
        """The arm of a world with a single arm."""
        (arm,) = self.arms
        return arm

    @property
    def idle(self) -> NDArray[np.float64]:
        """Action without motion that keeps all gripper commands, shape (7 * arms,)."""
        return self.arms[0].idle if len(self.arms) == 1 else np.concatenate([arm.idle for arm in self.arms])

    def pos(self, body: str) -> Vec3:
        """Position of a body's origin [m]."""
        return self._pos[self.body(body)].copy()

    def com(self, body: str) -> Vec3:
        """Position of a body's centre of mass [m]."""
        return self._com[self.body(body)].copy()

    def rot(self, body: str) -> Mat3:
        """Orientation of a body."""
        return self._rot[self.body(body)].copy()

    def tilt(self, body: str) -> float:
        """Angle between a body's z axis and the vertical [rad]."""
        return float(np.arccos(min(1.0, max(-1.0, self._rot.item(self.body(body), 2, 2)))))

    def velocity(self, body: str) -> NDArray[np.float64]:
        """Angular [rad/s] and linear [m/s] velocity of a body's centre of mass, world axes, shape (6,)."""
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(self.model, self.data, BODY, self.body(body), velocity, 0)
        return velocity

    def hinge(self, joint: str) -> tuple[float, float]:
        """Angle [rad] and rate [rad/s] of a hinge."""
        place, speed = self._hinge(joint)
        return self.data.qpos.item(place), self.data.qvel.item(speed)

    def touching(self, a: str, b: str) -> bool:
        """Whether two bodies were in contact at any physics step of the last control period.

        `ROBOT` and the `label` of an arm are accepted in place of a body.
        """
        return self.loop.touching.item(self.row(a), self.row(b)) != 0

    def touched(self, a: str, b: str) -> bool:
        """Whether two bodies were in contact at any physics step since the start. Names as for `touching`."""
        return self.loop.touched.item(self.row(a), self.row(b)) != 0

    def touching_bodies(self, body: str) -> set[str]:
        """Names of the bodies that touched a body in the last control period. `ROBOT` stands for the robot's bodies."""
        names = self._others
        found = {names[i] for i in self.loop.touching[self.row(body)].nonzero()[0].tolist() if i in names}
        return found - {ROBOT} if body == ROBOT else found

    @property
    def free_bodies(self) -> tuple[str, ...]:
        """Names of all bodies with a free joint."""
        return self._free

    @property
    def warnings(self) -> list[str]:
        """Kinds of warnings that MuJoCo has raised since the start."""
        kinds = mujoco.mjtWarning
        return [kinds(i).name for i in range(kinds.mjNWARNING) if self.data.warning[i].number]

    def state(self) -> NDArray[np.float64]:
        """Everything that the future depends on, as one vector."""
        grips = [arm.grip for arm in self.arms]
        return np.concatenate([self.loop.state(), self.channel.state, self.filter.state, self.shown, grips])

    def restore(self, state: NDArray[np.float64]) -> None:
        """Continue bit by bit from the `state()` of a world of the same scene."""
        sizes = [len(self.channel.state), len(self.filter.state), MAX_MEANS, len(self.arms)]
        loop, late, motion, self.shown[:], grips = np.split(state, len(state) - np.cumsum(sizes[::-1])[::-1])
        self.loop.restore(loop)
        self.channel.state = late
        self.filter.state = motion
        for arm, grip in zip(self.arms, grips, strict=True):
            arm.grip = float(grip)
        for arm in self.partners:
            arm.grip, arm.scripted_action = -1.0, IDLE  # the events of the coming period set it again

    @property
    def digest(self) -> str:
        """Hash of the full physics state, sixteen hex digits: equal digests mean bit-identical states."""
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        state = np.empty(mujoco.mj_stateSize(self.model, kind))
        mujoco.mj_getState(self.model, self.data, state, kind)
        return hashlib.sha256(state.tobytes()).hexdigest()[:16]

    # --- names ----------------------------------------------------------------------------

    def body(self, name: str) -> int:
        """Index of a named body."""
        try:
            return self._bodies[name]
        except KeyError:
            own = [known for known in self._bodies if not known.startswith(ROBOTS_BODIES)]
            raise UnknownName("body", name, self._bodies if name.startswith(ROBOTS_BODIES) else own) from None

    @functools.cached_property
    def _bodies(self) -> dict[str, int]:
        """Indices of all bodies by name."""
        return {self.model.body(i).name: i for i in range(self.model.nbody)}

    @functools.cached_property
    def own(self) -> frozenset[int]:
        """Indices of the robot's bodies."""
        roots = [self.model.body(names.base).id for names in panda.arms(self.model)]
        return frozenset(np.flatnonzero(np.isin(self.model.body_rootid, roots)).tolist())

    @functools.cached_property
    def _labels(self) -> dict[str, int]:
        """Rows of the loop's contact table that stand for more than one body."""
        names = [*(arm.label for arm in (*self.arms, *self.partners)), ROBOT]
        return {name: self.model.nbody + k for k, name in enumerate(names)}

    @functools.cached_property
    def _rows(self) -> dict[str, int]:
        """Rows of the loop's contact tables by name."""
        return self._bodies | self._labels

    @functools.cached_property
    def _others(self) -> dict[int, str]:
        """Names of the bodies that `touching_bodies` returns, by row of the contact tables."""
        scene = {row: name for name, row in self._bodies.items() if row not in self.own}
        return scene | {self._labels[ROBOT]: ROBOT}

    @functools.cached_property
    def _hinge(self) -> Callable[[str], tuple[int, int]]:
        """Function that finds the places of a hinge's angle and of its rate in the state."""
        model = self.model

        @functools.cache
        def places(joint: str) -> tuple[int, int]:
            found = model.joint(joint)
            return int(found.qposadr[0]), int(found.dofadr[0])

        return places

    @functools.cached_property
    def _free(self) -> tuple[str, ...]:
        """Names of all bodies with a free joint."""
        joints = np.flatnonzero(self.model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
        return tuple(self.model.body(int(self.model.jnt_bodyid[j])).name for j in joints)

    def row(self, name: str) -> int:
        """Row of the loop's contact tables for a name as in `touching`."""
        found = self._rows.get(name)
        return self.body(name) if found is None else found


class _Moment(AbstractContextManager[None]):
    """The moment in which a scenario's events happen in a world."""

    def __init__(self, world: World):
        self._world = world

    def __enter__(self) -> None:
        world = self._world
        world._happening = True
        world._forces[:] = 0.0
        for arm in world.partners:
            arm.grip, arm.scripted_action = -1.0, IDLE

    def __exit__(self, *error: object) -> None:
        self._world._happening = False


def scene_geoms(model: mujoco.MjModel) -> list[int]:
    """All geoms of a compiled scene without robot, table and floor."""
    apart = {model.body(name).id for name in ("world", "table", *(names.base for names in panda.arms(model)))}
    return [g for g in range(model.ngeom) if model.body_rootid[model.geom_bodyid[g]] not in apart]
