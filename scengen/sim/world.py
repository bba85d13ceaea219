"""World: a running simulation seen through names. SI units, world frame, wxyz quaternions."""

import functools
import hashlib
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import product
from typing import Self

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..control.loop import ACTION, Loop
from ..control.teleop import Filter
from ..errors import NoEvent, UnknownName, Unstable
from ..geometry import Mat3, Vec3
from ..robots import panda, suction
from ..robots.jaw import OVERLAP
from ..robots.panda import MAX_ARMS, Names
from . import scene_text
from .memory import Memory

ROBOT = "robot"
"""Stands for any body of the robot in questions about contact, whichever arm."""
IDLE: NDArray[np.float64] = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0])
"""No motion of an arm, gripper open: what doing nothing means from the start."""


JAW = "panda_jaw"
SUCTION = "panda_suction"
HANDS: dict[str, Callable[[mujoco.MjSpec, bool, int, NDArray[np.float64]], None]] = {
    JAW: lambda scene, visual, number, base: panda.attach(scene, visual, None, number, base),
    SUCTION: suction.attach,
}
"""Arms by their hands, and how each is added to a scene: with or without visual geometry, its number, its place."""
SCRIPTED = "scripted_"
"""What the name of a hand begins with whose arm belongs to the scene: its events move it, and no action does."""
EMBODIMENTS = (
    *("+".join(hands) for arms in range(1, MAX_ARMS + 1) for hands in product(HANDS, repeat=arms)),
    *(f"{driven}+{SCRIPTED}{partner}" for driven, partner in product(HANDS, repeat=MAX_ARMS)),
)
"""The robots that a task may ask for: the hands of its arms, joined by `+`. Two arms stand side by side, the first one
on the right. What is scripted comes last."""


def all_hands(embodiment: str) -> tuple[str, ...]:
    """The hands of all arms in a scene with that robot, in their order, scripted ones included.

    Raises:
        UnknownName: it is none of `EMBODIMENTS`.
    """
    if embodiment not in EMBODIMENTS:
        raise UnknownName("embodiment", embodiment, EMBODIMENTS)
    return tuple(hand.removeprefix(SCRIPTED) for hand in embodiment.split("+"))


def hands(embodiment: str) -> tuple[str, ...]:
    """The hands that actions drive, in the order of their arms: what a policy has.

    Raises:
        UnknownName: it is none of `EMBODIMENTS`.
    """
    return all_hands(embodiment)[: len(all_hands(embodiment)) - embodiment.count(SCRIPTED)]


def action_size(embodiment: str) -> int:
    """Numbers in an action of a robot: seven for each arm that actions drive."""
    return ACTION * len(hands(embodiment))


def compose(scene_xml: str, embodiment: str, visual: bool = False) -> mujoco.MjSpec:
    """The scene of a pool with its robot added; without visual geometry unless asked for.

    The text is what counts: it is parsed anew, so that exactly the scene on disk is simulated.
    """
    scene_text.check(scene_xml)
    scene = mujoco.MjSpec.from_string(scene_xml)
    if not visual:
        panda.strip_visual(scene)
    named = all_hands(embodiment)
    for number, (hand, base) in enumerate(zip(named, panda.bases(len(named)), strict=True)):
        HANDS[hand](scene, visual, number, base)
    return scene


class Arm:
    """One arm of a world with its hand: what a move looks at, and steers."""

    def __init__(self, world: "World", number: int):
        model, names = world.model, Names(number)
        self.world: World = weakref.proxy(world)  # no circle: a world that nobody holds must free its memory at once
        self.number, self.data = number, world.data
        self.grip = -1.0
        """The gripper command of the last action: -1 open or suction off, 1 closed or suction on."""
        self.told: NDArray[np.float64] = IDLE
        """What a scripted arm does in the coming control period, shape (7,)."""
        joints = [model.joint(name) for name in names.joints]
        self._qpos, self._dofs = [j.qposadr[0] for j in joints], [j.dofadr[0] for j in joints]
        self._fingers = panda.fingers(model, names)
        self._site = model.site(names.grip_site).id
        self._wrist = model.site(names.wrist_site).id

    @property
    def label(self) -> str:
        """The arm in questions about contact: `robot0`, `robot1`."""
        return f"{ROBOT}{self.number}"

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
    def gap(self) -> float:
        """Distance of the two pads of a jaw [m]: nothing but air where they touch nothing."""
        one, other = self.finger_pos
        return float(one - other) - OVERLAP

    @property
    def suction(self) -> bool:
        """Whether the hand is a suction cup instead of a jaw."""
        return not self._fingers

    @property
    def sealed(self) -> bool:
        """Whether the suction cup pulled at the last physics step: switched on, with its lip closed."""
        return bool(self.data.ctrl[self._cup] > 0.0)

    @property
    def idle(self) -> NDArray[np.float64]:
        """The action without motion that keeps the gripper command, shape (7,)."""
        return np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, self.grip])

    def jam(self, on: bool) -> None:
        """Force the gripper open, or switch the suction off, whatever is commanded, until it is told `jam(False)`.

        Acts in every physics step and belongs to the state.

        Raises:
            NoEvent: called by anything but a scenario's `events`.
        """
        self.world.check_event("jamming a gripper")
        self.world.loop.jam(self.number, on)

    def tell(self, action: ArrayLike) -> None:
        """Say what a scripted arm does in the coming control period and no longer; else it stays where it is, open.

        Args:
            action: seven numbers, for the controller as they are: no filter is in between.

        Raises:
            NoEvent: called by anything but a scenario's `events`.
            UnknownName: actions drive the arm.
        """
        if self not in self.world.partners:
            raise UnknownName("scripted arm", self.label, [arm.label for arm in self.world.partners])
        self.world.check_event(f"telling {self.label}")
        self.told = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        self.grip = float(self.told[-1])

    def wrench(self) -> NDArray[np.float64]:
        """Force [N] and torque [N m] between hand and wrist, axes of the wrist's sensor frame, shape (6,).

        The same numbers as robosuite's force and torque sensors; computed on demand, since sensors in the model would
        cost time in every step. A hand at rest reads what supports it: a force that points up.
        """
        model, data = self.world.model, self.data
        mujoco.mj_rnePostConstraint(model, data)
        body = int(model.site_bodyid[self._wrist])
        moment, force = data.cfrc_int[body, :3], data.cfrc_int[body, 3:]
        lever = data.site_xpos[self._wrist] - data.subtree_com[model.body_rootid[body]]
        frame = self.wrist_rot
        return np.concatenate([frame.T @ force, frame.T @ (moment - np.cross(lever, force))])

    def load(self) -> NDArray[np.float64]:
        """Force [N] and torque about the grip site [N m] that support what the hand holds, world axes, shape (6,).

        By Newton's law this is what the wrist reads, less what gravity and its own motion take of the hand itself.
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
        return self.world.model.actuator(Names(self.number).cup).id


@dataclass
class World:
    """Names -> numbers. Holds no task logic. Made by `World.load`, driven by `step`."""

    model: mujoco.MjModel
    data: mujoco.MjData
    loop: Loop
    scripted: int = 0
    """How many arms, the last ones, the scene's events move instead of actions."""
    filter: Filter = field(init=False)
    arms: tuple[Arm, ...] = field(init=False)
    """The arms that actions drive; an action holds seven numbers for each, in this order."""
    partners: tuple[Arm, ...] = field(init=False)
    """The arms that events move (`Arm.tell`)."""
    memory: Memory = field(init=False)
    """What has happened in the episode, by the names that the scene was told to `remember`; all 0 at the start."""
    _happening: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        every = tuple(Arm(self, names.number) for names in panda.arms(self.model))
        self.arms, self.partners = every[: len(every) - self.scripted], every[len(every) - self.scripted :]
        this = weakref.proxy(self)
        self.memory = Memory(self.model, self.data, lambda: this.check_event("writing to the memory"))
        self.filter = Filter(len(self.arms))

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
        return cls.of(spec.compile(), len(all_hands(embodiment)) - len(hands(embodiment)))

    @classmethod
    def of(cls, model: mujoco.MjModel, scripted: int = 0) -> Self:
        """A world at its start, around a compiled scene with robot.

        Args:
            scripted: how many arms, the last ones, the scene's events move.
        """
        data = mujoco.MjData(model)
        world = cls(model, data, Loop(model, data), scripted)
        world.reset()
        return world

    def reset(self) -> None:
        """Back to the start; a used world then behaves bit by bit like a fresh one."""
        self.loop.reset()
        self.filter.reset()
        for arm in (*self.arms, *self.partners):
            arm.grip, arm.told = -1.0, IDLE

    @property
    def size(self) -> int:
        """Numbers in an action."""
        return ACTION * len(self.arms)

    def step(self, action: ArrayLike) -> NDArray[np.float32]:
        """Pass an action through the teleoperation filter and advance one control period (10 ms).

        Returns:
            What the controller received, shape (7 * arms,).

        Raises:
            Unstable: MuJoCo raised a warning.
        """
        filtered = self.filter(action)
        self.apply(filtered)
        return filtered

    def apply(self, filtered: NDArray[np.float32]) -> None:
        """Advance one control period under an action that has passed the filter already, shape (7 * arms,).

        Raises:
            ValueError: the action has another shape, or is not finite.
            Unstable: MuJoCo raised a warning.
        """
        warnings = self.loop.step(self.joined(filtered))
        self.command(filtered)
        if warnings:
            raise Unstable(f"MuJoCo raised a warning at t = {self.time:.3f} s: {', '.join(self.warnings)}")

    def joined(self, action: NDArray[np.floating]) -> NDArray[np.floating]:
        """An action, shape (7 * arms,), and behind it what the partners do: what the controllers of all arms get."""
        if not self.partners:
            return action
        if np.shape(action) != (self.size,):
            raise ValueError(f"an action has shape ({self.size},), not {np.shape(action)}")
        return np.concatenate([action, *(arm.told for arm in self.partners)], dtype=np.float32)

    def command(self, action: NDArray[np.floating]) -> None:
        """Remember the gripper commands of an action, shape (7 * arms,), that has been simulated, here or elsewhere."""
        for arm in self.arms:
            arm.grip = float(action[ACTION * arm.number + ACTION - 1])

    # --- events ---------------------------------------------------------------------------

    @contextmanager
    def events(self) -> Iterator[None]:
        """The moment before a control period in which a scenario's events happen; an `Episode` opens it.

        Forces of the period that has passed (`force`) end with it, and so does what partners were told.
        """
        self._happening = True
        self.data.xfrc_applied[:] = 0.0
        for arm in self.partners:
            arm.grip, arm.told = -1.0, IDLE
        try:
            yield
        finally:
            self._happening = False

    def check_event(self, what: str) -> None:
        """Raise `NoEvent` unless events happen now. `what` names what is done."""
        if not self._happening:
            raise NoEvent(what)

    def move(self, body: str, pos: ArrayLike, turn: ArrayLike = (1.0, 0.0, 0.0, 0.0)) -> None:
        """Put a mocap body, such as a patch that marks the goal, elsewhere, from the coming control period on.

        It pushes nothing away: such bodies are for being looked at. Belongs to the state.

        Args:
            pos: of its origin [m].
            turn: its orientation (wxyz).

        Raises:
            NoEvent: called by anything but a scenario's `events`.
            UnknownName: there is no mocap body of that name.
        """
        self.check_event(f"moving {body}")
        mocap = self.model.body_mocapid
        if body not in self._bodies or mocap[self.body(body)] < 0:
            raise UnknownName("mocap body", body, [name for name, b in self._bodies.items() if mocap[b] >= 0])
        self.data.mocap_pos[mocap[self.body(body)]] = pos
        self.data.mocap_quat[mocap[self.body(body)]] = turn

    def passes(self, moment: float) -> bool:
        """Whether the control period that begins now is the one in which `moment` [s] is due, to the nearest period."""
        return abs(self.time - moment) < Loop.PERIOD / 2

    def launch(self, body: str, linear: ArrayLike, angular: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """Give a free body a velocity, as by a blow.

        Args:
            linear: of its origin [m/s], world axes, shape (3,).
            angular: of the body [rad/s], world axes, shape (3,).

        Raises:
            NoEvent: called by anything but a scenario's `events`.
            UnknownName: there is no such free body.
        """
        self.check_event(f"launching {body}")
        if body not in self.free_bodies:
            raise UnknownName("free body", body, self.free_bodies)
        dof = int(self.model.body_dofadr[self.body(body)])
        self.data.qvel[dof : dof + 3] = linear
        self.data.qvel[dof + 3 : dof + 6] = self.rot(body).T @ np.asarray(angular, float)

    def force(self, body: str, force: ArrayLike) -> None:
        """Push a body at its centre of mass, for the coming control period and no longer: an impulse of force * 10 ms.

        Args:
            force: in world axes [N], shape (3,).

        Raises:
            NoEvent: called by anything but a scenario's `events`.
        """
        self.check_event(f"pushing {body}")
        self.data.xfrc_applied[self.body(body), :3] = force

    def drive(self, joint: str, goal: float) -> None:
        """Let a joint with a servo (`prop.servo`) go to `goal` [rad or m], from the coming control period on.

        The goal belongs to the state; it is 0 at the start.

        Raises:
            NoEvent: called by anything but a scenario's `events`.
            UnknownName: the joint has no servo.
        """
        self.check_event(f"driving {joint}")
        servos = {self.model.actuator(i).name: i for i in range(self.model.nu)}
        if joint not in servos:
            raise UnknownName("servo", joint, servos)
        self.data.ctrl[servos[joint]] = goal

    def spin(self, joint: str, rate: float) -> None:
        """Give a hinge a rate [rad/s].

        Raises:
            NoEvent: called by anything but a scenario's `events`.
        """
        self.check_event(f"spinning {joint}")
        self.data.qvel[self.model.joint(joint).dofadr[0]] = rate

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

    def hinge(self, joint: str) -> tuple[float, float]:
        """Angle [rad] and rate [rad/s] of a hinge."""
        found = self.model.joint(joint)
        return float(self.data.qpos[found.qposadr[0]]), float(self.data.qvel[found.dofadr[0]])

    def touching(self, a: str, b: str) -> bool:
        """Whether two bodies were in contact at any physics step of the last control period.

        A body may also be `ROBOT`, or the `label` of an arm.
        """
        return bool(self.loop.touching[self._label(a), self._label(b)])

    def touched(self, a: str, b: str) -> bool:
        """Whether two bodies were in contact at any physics step since the start; names as for `touching`."""
        return bool(self.loop.touched[self._label(a), self._label(b)])

    def touching_bodies(self, body: str) -> set[str]:
        """Names of the bodies that a body touched in the last control period; `ROBOT` stands for the robot's own."""
        others = self.loop.touching[self._label(body)]
        scene = {self.model.body(int(i)).name for i in np.flatnonzero(others[: self.model.nbody]) if i not in self.own}
        return scene | {ROBOT} if others[-1] and body != ROBOT else scene

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
        for arm in self.partners:
            arm.grip, arm.told = -1.0, IDLE  # until the events of the coming period tell it again

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
    def own(self) -> frozenset[int]:
        """Indices of the bodies of the robot."""
        roots = [self.model.body(names.base).id for names in panda.arms(self.model)]
        return frozenset(np.flatnonzero(np.isin(self.model.body_rootid, roots)).tolist())

    @functools.cached_property
    def _labels(self) -> dict[str, int]:
        """Rows of the loop's table of contacts that stand for more than one body."""
        names = [*(arm.label for arm in (*self.arms, *self.partners)), ROBOT]
        return {name: self.model.nbody + k for k, name in enumerate(names)}

    @functools.cached_property
    def _free(self) -> tuple[str, ...]:
        joints = np.flatnonzero(self.model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
        return tuple(self.model.body(int(self.model.jnt_bodyid[j])).name for j in joints)

    def _label(self, name: str) -> int:
        return self._labels[name] if name in self._labels else self.body(name)
