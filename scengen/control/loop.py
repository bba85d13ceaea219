"""The compiled control loop of one or two Pandas with jaw or suction cup: actions in, physics and contacts out."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import mujoco
import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from ..robots import panda, suction
from ..robots.panda import HOME, JOINTS
from . import native, osc
from .impairment import Impairment

ACTION = 7
"""Length of the action of one arm: translation (3), rotation vector (3), gripper, each in [-1, 1]. An action of the
robot holds them for each arm, one after the other."""

SCENE = np.dtype(
    [
        ("model", np.int64),
        ("data", np.int64),
        ("ncon", np.int64),
        ("contact", np.int64),
        ("stride", np.int64),
        ("dist", np.int64),
        ("geom", np.int64),
        ("warning", np.int64),
        ("warning_stride", np.int64),
        ("warning_kinds", np.int64),
        ("ctrl", np.int64),
        ("substeps", np.int64),
        ("iterations", np.int64),
        ("islands", np.int64),
        ("max_iterations", np.int64),
        ("cut_short", np.int64),
    ]
)
"""Addresses of the structs and of their fields (`native.Layout`), the number of physics steps in one control period,
the number of islands whose solver iterations are counted, and whether a solver has made all the iterations that it may
make since the reset."""


def _sources() -> str:
    """Digest of every file that goes into the compiled entry points."""
    files = [str(module.__file__) for module in (osc, panda, native)]
    return hashlib.sha256(b"".join(Path(file).read_bytes() for file in [__file__, *files])).hexdigest()[:16]


ARM = np.dtype(
    [
        ("at", osc.PLACES),
        ("state", osc.STATE),
        ("work", osc.WORK),
        (f"sources_{_sources()}", np.int64),
    ]
)
"""Record of one arm's controller.

The last field is never used. numba's disk cache compares only the types of the arguments and the file of the entry
point. It would take machine code of an older `osc` for the present one. The field's name prevents that.
"""

INTEGRATION = mujoco.mjtState.mjSTATE_INTEGRATION
"""Part of MuJoCo's state that the future depends on."""


class Loop:
    """The control loop of all arms over one (model, data). It finds the robot of the model by its names.

    After every call, the poses in `data` (xpos, xquat, site_xpos ...) are those of the current qpos. Velocities,
    sensors and contacts in it are those of the last physics step, 2 ms before, as in robosuite. `data` may be changed
    between two periods, because each starts with a fresh mj_step1.
    """

    PERIOD = 0.01
    """Control period [s]: the paper's 100 Hz."""

    touched: NDArray[np.uint8]
    """Contact table: 1 where two bodies were in contact (dist <= 0) at any physics step since the reset. Symmetric,
    shape (nbody + arms + 1, nbody + arms + 1). After the bodies comes one row and column for each arm, which stands for
    any body of it, mount and gripper included. The last one stands for any body of any arm. Contacts of the robot with
    itself count: the fingertips of an empty closed jaw are in the last row."""
    touching: NDArray[np.uint8]
    """Contact table of the last control period alone, in the form of `touched`."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, home: ArrayLike = HOME, scripted: int = 0):
        """Take over `data` and reset it.

        Args:
            model: of a scene with one or two arms.
            data: of that model.
            home: joint angles of every arm after a reset [rad], shape (7,); or of each, shape (arms, 7).
            scripted: number of arms, counted from the last, that no impairment of the scene hinders.

        Raises:
            ValueError: the model has no arm, or its options do not allow control.
        """
        steps = self.PERIOD / model.opt.timestep
        self.substeps = round(steps)
        if self.substeps < 1 or abs(steps - self.substeps) > 1e-6:
            raise ValueError(
                f"timestep {model.opt.timestep:g} s does not divide the control period of {self.PERIOD:g} s; "
                "set option.timestep to 0.002"
            )
        if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
            raise ValueError("a Runge-Kutta step cannot be controlled; set option.integrator to Euler")
        self.model, self.data = model, data
        names = panda.arms(model) or [panda.Names()]
        self.size = ACTION * len(names)
        """Length of an action of the robot."""
        given = np.array(home, dtype=np.float64)
        if given.shape not in ((JOINTS,), (len(names), JOINTS)):
            raise ValueError(f"home must be {JOINTS} joint angles of each arm, not an array of shape {given.shape}")
        self.impairment = Impairment.of(model)
        """What hinders the control of the arms that are not scripted."""
        self.home = np.broadcast_to(given, (len(names), JOINTS)) + self._offsets(len(names), scripted)
        self._arms = np.zeros(len(names), ARM)
        for arm, name in zip(self._arms, names, strict=True):
            arm["at"] = osc.places(model, data, name)
        for arm in self._arms[: len(names) - scripted]:
            osc.tune(arm["at"], self.impairment.stiffness, self.impairment.gripper)
        self._scene = np.zeros(1, SCENE)
        _fill_scene(self._scene[0], model, data, self.substeps)
        self._owner = _owners(model, names)
        self._tight = _tight(model)
        labels = model.nbody + len(names) + 1
        self._latches = np.zeros((2, labels, labels), np.uint8)
        self.touched, self.touching = self._latches
        self._action = np.zeros(self.size, np.float32)
        self._no_record = np.zeros((0, model.nu))
        self._fingers = [(panda.fingers(model, name), panda.start_fingers(model, name)) for name in names]
        self.holds = panda.width_in_hand(model) is not None
        """Whether the jaw of the first arm is closed on a body at the start (`panda.IN_HAND`)."""
        self.reset()

    def _offsets(self, arms: int, scripted: int) -> NDArray[np.float64]:
        """Offsets of the joints at the start [rad], shape (arms, 7)."""
        offsets, driven = np.zeros((arms, JOINTS)), arms - scripted
        if given := self.impairment.start:
            if len(given) != JOINTS * driven:
                raise ValueError(f"the scene offsets {len(given)} joints at the start; its robot has {JOINTS * driven}")
            offsets[:driven] = np.reshape(given, (driven, JOINTS))
        return offsets

    def __reduce__(self) -> NoReturn:
        remedy = "copy the World, or make Loop(model, data) and restore(loop.state())"
        raise TypeError(f"a Loop holds addresses of its model and data and cannot be copied or pickled; {remedy}")

    def reset(self) -> None:
        """Return to the start: `home`, jaw half open or closed on what it holds, suction off, no contacts.

        The bits equal those of a new loop.
        """
        mujoco.mj_resetData(self.model, self.data)
        for number, (arm, home, (fingers, places)) in enumerate(zip(self._arms, self.home, self._fingers, strict=True)):
            self.data.qpos[arm["at"]["angle"]] = home
            self.data.qpos[fingers] = places
            osc.start(arm["state"], home, closed=self.holds and number == 0)
        self._latches[:] = 0
        self._scene["max_iterations"], self._scene["cut_short"] = self.model.opt.iterations, 0
        mujoco.mj_forward(self.model, self.data)

    @property
    def converged(self) -> bool:
        """Whether the solver has ended by its tolerance in every physics step since the reset, so that more iterations
        would have given the same bits. False if that is unknown, because there may be more islands than are counted."""
        (scene,) = self._scene
        return bool(not scene["cut_short"] and self.model.ntree <= scene["islands"])

    def step(self, action: ArrayLike) -> int:
        """Simulate one control period under an action of shape (size,).

        Returns the number of MuJoCo warnings since the reset; it is 0 for a sound simulation.

        Warnings matter: MuJoCo resets an unstable simulation silently, and only the warning shows it.
        """
        given = np.asarray(action, np.float32)
        if given.shape != (self.size,):
            raise ValueError(f"an action has shape ({self.size},), not {given.shape}")
        self._action[:] = given
        warnings = _step(self._scene, self._arms, self._owner, self._tight, self._latches, self._action)
        if warnings < 0:
            raise ValueError(f"an action must be finite, not {given.tolist()}")
        return warnings

    def replay(self, actions: ArrayLike, ctrl_out: NDArray[np.float64] | None = None) -> int:
        """Simulate one period per row of `actions`, shape (n, size): the same bits as n calls of `step`, in one call.

        `ctrl_out`, shape (n * substeps, nu), receives the controls of every physics step.
        """
        actions = np.ascontiguousarray(actions, np.float32)
        if actions.ndim != 2 or actions.shape[1] != self.size:
            raise ValueError(f"actions have shape (n, {self.size}), not {actions.shape}")
        bad = np.flatnonzero(~np.isfinite(actions).all(axis=1))
        if bad.size:
            raise ValueError(f"actions must be finite, but row {bad[0]} is {actions[bad[0]].tolist()}")
        record = self._no_record
        if ctrl_out is not None:
            record, wanted = ctrl_out, (len(actions) * self.substeps, self.model.nu)
            if record.shape != wanted or record.dtype != np.float64 or not record.flags.c_contiguous:
                raise ValueError(f"ctrl_out must be a C-contiguous float64 array of shape {wanted}")
        return _replay(self._scene, self._arms, self._owner, self._tight, self._latches, actions, record)

    def watch(self, first: bool) -> None:
        """Record the contacts of a physics step that another simulator makes, between its mj_step1 and mj_step2.

        A suction cup that is switched on but not sealed is switched off for this step, and a jammed gripper is opened.
        `first`: whether the step starts a control period.
        """
        _watch(self._scene, self._arms, self._owner, self._tight, self._latches, first)

    def jam(self, arm: int, on: bool) -> None:
        """Force the gripper of an arm open from the next physics step on, or return it to its commands.

        A jaw is driven to its open end; a suction cup is shut off. Commands still advance the jaw's ramp meanwhile:
        after the jam, the jaw does from its position what it would do without the jam.
        """
        self._arms[arm]["state"]["jammed"] = float(on)

    def jammed(self, arm: int) -> bool:
        """Whether the gripper of an arm is jammed."""
        return bool(self._arms[arm]["state"]["jammed"])

    def state(self) -> NDArray[np.float64]:
        """Everything that the future depends on: integration state, controllers, contact tables and warnings."""
        physics = np.empty(mujoco.mj_stateSize(self.model, INTEGRATION))
        mujoco.mj_getState(self.model, self.data, physics, INTEGRATION)
        parts = [physics, self._controllers().ravel(), np.packbits(self._latches), self._warnings()]
        return np.concatenate(parts, dtype=np.float64)

    def restore(self, state: NDArray[np.float64]) -> None:
        """Return to a `state()` of this scene and continue from it bit for bit."""
        warnings = self._warnings()
        packed = -(-self._latches.size // 8)
        physics_size = mujoco.mj_stateSize(self.model, INTEGRATION)
        parts = np.cumsum([physics_size, self._controllers().size, packed])
        if np.shape(state) != (parts[-1] + warnings.size,):
            raise ValueError(
                f"a state of this scene has shape ({parts[-1] + warnings.size},), not {np.shape(state)}; "
                "restore only what state() of the same scene returned"
            )
        physics, controllers, latches, counts = np.split(np.asarray(state, np.float64), parts)
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_setState(self.model, self.data, physics, INTEGRATION)
        mujoco.mj_forward(self.model, self.data)
        # Forward dynamics may change the warm start, so the state is set again.
        mujoco.mj_setState(self.model, self.data, physics, INTEGRATION)
        self._arms["state"] = controllers.view(osc.STATE)
        bits = np.unpackbits(latches.astype(np.uint8), count=self._latches.size)
        self._latches[:] = bits.reshape(self._latches.shape)
        warnings[:] = counts.astype(np.int32)

    def _controllers(self) -> NDArray[np.float64]:
        """States of the controllers, one row per arm."""
        return np.ascontiguousarray(self._arms["state"]).view(np.float64).reshape(len(self._arms), -1)

    def _warnings(self) -> NDArray[np.int32]:
        """MuJoCo's warning counters, one per kind, as a view."""
        return self.data.warning.number


def _fill_scene(scene: NDArray[np.void], model: mujoco.MjModel, data: mujoco.MjData, substeps: int) -> None:
    """Write the addresses of one model and its data into a `SCENE` record."""
    scene["model"], scene["data"], scene["substeps"] = model._address, data._address, substeps
    scene["ctrl"] = data.ctrl.ctypes.data
    scene["iterations"], scene["islands"] = data.solver_niter.ctypes.data, len(data.solver_niter)
    layout = native.layout()
    scene["ncon"], scene["contact"] = data._address + layout.ncon, data._address + layout.contact
    scene["stride"], scene["dist"], scene["geom"] = layout.stride, layout.dist, layout.geom
    scene["warning"], scene["warning_stride"], scene["warning_kinds"] = native.warning_counts(data)


def _owners(model: mujoco.MjModel, names: Sequence[panda.Names]) -> NDArray[np.int32]:
    """Labels of every geom: its body, its arm and the robot; the latter two are `osc.NONE` in the scene.

    Shape (ngeom, 3).
    """
    labels = np.full((model.nbody, 3), osc.NONE)
    labels[:, 0] = np.arange(model.nbody)
    for number, name in enumerate(names):
        labels[model.body_rootid == model.body(name.base).id, 1:] = model.nbody + np.array([number, len(names)])
    return labels[model.geom_bodyid].astype(np.int32)


def _tight(model: mujoco.MjModel) -> NDArray[np.uint8]:
    """1 for every geom on which the lip of a suction cup closes, 0 for those that are `suction.LEAKY`.

    Shape (ngeom,).
    """
    if model.nuser_geom == 0:
        return np.ones(model.ngeom, np.uint8)
    return (model.geom_user[:, 0] != suction.LEAKY).astype(np.uint8)


@njit(nogil=True, cache=True)
def _step(scenes: NDArray, arms: NDArray, owner: NDArray, tight: NDArray, latches: NDArray, action: NDArray) -> int:
    """One control period. Returns the number of warnings, or -1, with nothing done, if the action is not finite."""
    for i in range(action.shape[0]):
        if not np.isfinite(action[i]):
            return -1
    scene = scenes[0]
    _begin(latches)
    for k in range(scene.substeps):
        _substep(scene, arms, owner, tight, latches, action, k == 0)
    native.kinematics(scene.model, scene.data)
    return native.warnings(scene.warning, scene.warning_stride, scene.warning_kinds)


@njit(nogil=True, cache=True)
def _replay(
    scenes: NDArray, arms: NDArray, owner: NDArray, tight: NDArray, latches: NDArray, actions: NDArray, record: NDArray
) -> int:
    """One control period per row of `actions`. Fills `record` with the controls unless it has no rows."""
    scene = scenes[0]
    ctrl = native.float64s(scene.ctrl, record.shape[1])
    for t in range(actions.shape[0]):
        _begin(latches)
        for k in range(scene.substeps):
            _substep(scene, arms, owner, tight, latches, actions[t], k == 0)
            if record.shape[0] > 0:
                record[t * scene.substeps + k] = ctrl
        # The physics does not need this. It makes the bits equal those of `step` under any integrator.
        native.kinematics(scene.model, scene.data)
    return native.warnings(scene.warning, scene.warning_stride, scene.warning_kinds)


@njit(nogil=True, cache=True)
def _watch(scenes: NDArray, arms: NDArray, owner: NDArray, tight: NDArray, latches: NDArray, first: bool) -> None:
    """The work of `_substep` other than controlling the arms."""
    scene = scenes[0]
    if first:
        _begin(latches)
    _latch(scene, owner, latches)
    for i in range(arms.shape[0]):
        at = arms[i].at
        if at.cup == osc.NONE:
            osc.force_open(at, arms[i].state)
        elif arms[i].state.jammed != 0.0 or _pads_in_contact(scene, tight, at.pad) < osc.MIN_SEALED_PADS:
            native.float64s(at.ctrl + 8 * at.cup, 1)[0] = 0.0


@njit
def _substep(
    scene: np.record, arms: NDArray, owner: NDArray, tight: NDArray, latches: NDArray, action: NDArray, first: bool
) -> None:
    """One physics step under control. The first step of a period moves the goals, from the poses just computed."""
    native.step1(scene.model, scene.data)
    for i in range(arms.shape[0]):
        at, state, work = arms[i].at, arms[i].state, arms[i].work
        if first:
            osc.set_goal(at, state, work, action[ACTION * i : ACTION * (i + 1)])
        osc.apply(at, state, work)
    _latch(scene, owner, latches)
    for i in range(arms.shape[0]):
        at = arms[i].at
        if at.cup != osc.NONE:
            osc.suck(at, arms[i].state, _pads_in_contact(scene, tight, at.pad))
    native.step2(scene.model, scene.data)
    if native.int32s(scene.iterations, scene.islands).max() >= scene.max_iterations:
        scene.cut_short = 1


@njit
def _begin(latches: NDArray) -> None:
    """Clear the contact table of the last period."""
    latches[1] = 0


@njit
def _latch(scene: np.record, owner: NDArray, latches: NDArray) -> None:
    """Record the bodies in contact now. The array of contacts may move at every step."""
    count = native.int32s(scene.ncon, 1)[0]
    contact = native.int64s(scene.contact, 1)[0]
    for _ in range(count):
        if native.float64s(contact + scene.dist, 1)[0] <= 0.0:
            geoms = native.int32s(contact + scene.geom, 2)
            if geoms[0] >= 0 and geoms[1] >= 0:  # -1: a flex
                _mark(owner[geoms[0]], owner[geoms[1]], latches)
        contact += scene.stride


@njit
def _pads_in_contact(scene: np.record, tight: NDArray, first: int) -> int:
    """Number of the four geoms from `first` on that touch a tight geom now."""
    count = native.int32s(scene.ncon, 1)[0]
    contact = native.int64s(scene.contact, 1)[0]
    seen = 0
    for _ in range(count):
        if native.float64s(contact + scene.dist, 1)[0] <= 0.0:
            geoms = native.int32s(contact + scene.geom, 2)
            for i in range(2):
                if 0 <= geoms[i] - first < 4 and (geoms[1 - i] < 0 or tight[geoms[1 - i]]):
                    seen |= 1 << (geoms[i] - first)
        contact += scene.stride
    return (seen & 1) + (seen >> 1 & 1) + (seen >> 2 & 1) + (seen >> 3)


@njit
def _mark(one: NDArray, other: NDArray, latches: NDArray) -> None:
    """Record the contact of two rows of `_owners`: every label of one with every label of the other."""
    for a in one:
        for b in other:
            if a != osc.NONE and b != osc.NONE:
                for kind in range(2):
                    latches[kind, a, b] = latches[kind, b, a] = 1
