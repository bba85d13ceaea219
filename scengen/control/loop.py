"""The control loop of one Panda with jaw or suction cup, compiled: filtered actions in, physics and contacts out."""

import hashlib
from pathlib import Path

import mujoco
import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from ..robots import panda
from ..robots.panda import FINGERS, HOME, JOINTS
from . import native, osc

ACTION = 7
"""Numbers in an action: translation (3), rotation vector (3), gripper, each in [-1, 1]."""

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
    ]
)
"""Addresses of the structs, of their fields (`native.Layout`), and physics steps in one control period."""


def _sources() -> str:
    """A digest of every file that goes into the compiled entry points."""
    files = [str(module.__file__) for module in (osc, panda, native)]
    return hashlib.sha256(b"".join(Path(file).read_bytes() for file in [__file__, *files])).hexdigest()[:16]


MEMORY = np.dtype(
    [
        ("scene", SCENE),
        ("at", osc.PLACES),
        ("state", osc.STATE),
        ("work", osc.WORK),
        (f"sources_{_sources()}", np.int64),
    ]
)
"""Everything that compiled code needs besides MuJoCo, in one record: one argument is the cheapest call.

The last field is never used. numba's disk cache looks at the types of the arguments and at the file of the
entry point alone, and would take machine code of an older `osc` for the present one; its name forbids that.
"""

INTEGRATION = mujoco.mjtState.mjSTATE_INTEGRATION


class Loop:
    """The control loop of one Panda over one (model, data).

    After every call the poses in `data` (xpos, xquat, site_xpos ...) are those of the current qpos;
    velocities, sensors and contacts in it are those of the last physics step, 2 ms before, as in robosuite.
    It is safe to change `data` between two periods: each begins with a fresh mj_step1.
    """

    PERIOD = 0.01
    """Control period [s]: the paper's 100 Hz."""

    touched: NDArray[np.uint8]
    """1 where two bodies were in contact (dist <= 0) at any physics step since the reset. Symmetric, shape
    (nbody + 1, nbody + 1); the last row and column stand for any body of the robot, mount and gripper
    included. The robot may touch itself: the fingertips of an empty closed jaw are in the last row."""
    touching: NDArray[np.uint8]
    """The same for the last control period alone."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, home: ArrayLike = HOME):
        """Take over `data` and reset it. `home`: joint angles after a reset [rad], shape (7,)."""
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
        self.home = np.array(home, dtype=np.float64)
        if self.home.shape != (JOINTS,):
            raise ValueError(f"home must be {JOINTS} joint angles, not an array of shape {self.home.shape}")
        self._memory = np.zeros(1, MEMORY)
        self._memory["at"][0] = osc.places(model, data, panda.Names())
        _fill_scene(self._memory["scene"][0], model, data, self.substeps)
        self._state = self._memory["state"][0]
        self._owner = _owners(model)
        self._latches = np.zeros((2, model.nbody + 1, model.nbody + 1), np.uint8)
        self.touched, self.touching = self._latches
        self._action = np.zeros(ACTION, np.float32)
        self._no_record = np.zeros((0, model.nu))
        self._fingers = panda.fingers(model, panda.Names())
        self.reset()

    def reset(self) -> None:
        """Back to the start: `home`, jaw half open or suction off, nothing touched. The same bits as a fresh loop."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self._memory["at"]["angle"][0]] = self.home
        self.data.qpos[self._fingers] = FINGERS[: len(self._fingers)]
        osc.start(self._state, self.home)
        self._latches[:] = 0
        mujoco.mj_forward(self.model, self.data)

    def step(self, action: ArrayLike) -> int:
        """Simulate one control period and return the number of MuJoCo warnings since the reset; 0 is sound.

        Warnings matter: MuJoCo silently starts an unstable simulation afresh, and only the warning remains.
        """
        given = np.asarray(action, np.float32)
        if given.shape != (ACTION,):
            raise ValueError(f"an action has shape ({ACTION},), not {given.shape}")
        self._action[:] = given
        warnings = _step(self._memory, self._owner, self._latches, self._action)
        if warnings < 0:
            raise ValueError(f"an action must be finite, not {given.tolist()}")
        return warnings

    def replay(self, actions: ArrayLike, ctrl_out: NDArray[np.float64] | None = None) -> int:
        """Simulate one period per row of `actions`, shape (n, 7): the same bits as n ticks, in one call.

        `ctrl_out`, shape (n * substeps, nu), receives the controls of every physics step.
        """
        actions = np.ascontiguousarray(actions, np.float32)
        if actions.ndim != 2 or actions.shape[1] != ACTION:
            raise ValueError(f"actions have shape (n, {ACTION}), not {actions.shape}")
        bad = np.flatnonzero(~np.isfinite(actions).all(axis=1))
        if bad.size:
            raise ValueError(f"actions must be finite, but row {bad[0]} is {actions[bad[0]].tolist()}")
        record = self._no_record
        if ctrl_out is not None:
            record, wanted = ctrl_out, (len(actions) * self.substeps, self.model.nu)
            if record.shape != wanted or record.dtype != np.float64 or not record.flags.c_contiguous:
                raise ValueError(f"ctrl_out must be a C-contiguous float64 array of shape {wanted}")
        return _replay(self._memory, self._owner, self._latches, actions, record)

    def watch(self, first: bool) -> None:
        """Latch the contacts of a physics step that somebody else makes, between its mj_step1 and mj_step2.

        A suction cup that is switched on but not sealed is switched off for this step. `first`: whether the step
        begins a control period.
        """
        _watch(self._memory, self._owner, self._latches, first)

    def state(self) -> NDArray[np.float64]:
        """All that the future depends on, in one vector: integration state, controller, latches, warnings."""
        physics = np.empty(mujoco.mj_stateSize(self.model, INTEGRATION))
        mujoco.mj_getState(self.model, self.data, physics, INTEGRATION)
        parts = [physics, self._controller(), np.packbits(self._latches), self._warnings()]
        return np.concatenate(parts, dtype=np.float64)

    def restore(self, state: NDArray[np.float64]) -> None:
        """Return to a `state()` of this scene and continue from it bit for bit."""
        warnings = self._warnings()
        packed = -(-self._latches.size // 8)
        physics_size = mujoco.mj_stateSize(self.model, INTEGRATION)
        parts = np.cumsum([physics_size, self._controller().size, packed])
        if np.shape(state) != (parts[-1] + warnings.size,):
            raise ValueError(
                f"a state of this scene has shape ({parts[-1] + warnings.size},), not {np.shape(state)}; "
                "restore only what state() of the same scene returned"
            )
        physics, controller, latches, counts = np.split(np.asarray(state, np.float64), parts)
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_setState(self.model, self.data, physics, INTEGRATION)
        mujoco.mj_forward(self.model, self.data)
        # Forward dynamics may leave its own mark on the warm start; the state has the last word.
        mujoco.mj_setState(self.model, self.data, physics, INTEGRATION)
        self._controller()[:] = controller
        bits = np.unpackbits(latches.astype(np.uint8), count=self._latches.size)
        self._latches[:] = bits.reshape(self._latches.shape)
        warnings[:] = counts.astype(np.int32)

    def _controller(self) -> NDArray[np.float64]:
        """The controller's memory as a vector, not a copy."""
        return self._memory["state"].view(np.float64)

    def _warnings(self) -> NDArray[np.int32]:
        """MuJoCo's warning counters, one for each kind, not a copy."""
        return self.data.warning.number


def _fill_scene(scene: NDArray[np.void], model: mujoco.MjModel, data: mujoco.MjData, substeps: int) -> None:
    """Write the addresses of one model and its data into a `SCENE` record."""
    scene["model"], scene["data"], scene["substeps"] = model._address, data._address, substeps
    scene["ctrl"] = data.ctrl.ctypes.data
    layout = native.layout()
    scene["ncon"], scene["contact"] = data._address + layout.ncon, data._address + layout.contact
    scene["stride"], scene["dist"], scene["geom"] = layout.stride, layout.dist, layout.geom
    scene["warning"], scene["warning_stride"], scene["warning_kinds"] = native.warning_counts(data)


def _owners(model: mujoco.MjModel) -> NDArray[np.int32]:
    """Body of every geom, and whether it is the robot's: shape (ngeom, 2)."""
    base = model.body(panda.Names().base).id
    robot = np.zeros(model.nbody, bool)
    robot[base] = True
    for body in range(base + 1, model.nbody):
        robot[body] = robot[model.body_parentid[body]]
    return np.stack([model.geom_bodyid, robot[model.geom_bodyid]], axis=1).astype(np.int32)


@njit(nogil=True, cache=True)
def _step(memory: NDArray, owner: NDArray, latches: NDArray, action: NDArray) -> int:
    """One control period; the number of warnings, or -1 and nothing done for an action that is not finite."""
    for i in range(ACTION):
        if not np.isfinite(action[i]):
            return -1
    scene = memory[0].scene
    _begin(latches)
    for k in range(scene.substeps):
        _substep(memory, owner, latches, action, k == 0)
    native.kinematics(scene.model, scene.data)
    return native.warnings(scene.warning, scene.warning_stride, scene.warning_kinds)


@njit(nogil=True, cache=True)
def _replay(memory: NDArray, owner: NDArray, latches: NDArray, actions: NDArray, record: NDArray) -> int:
    """One control period per row of `actions`, filling `record` with the controls unless it has no rows."""
    scene = memory[0].scene
    ctrl = native.float64s(scene.ctrl, record.shape[1])
    for t in range(actions.shape[0]):
        _begin(latches)
        for k in range(scene.substeps):
            _substep(memory, owner, latches, actions[t], k == 0)
            if record.shape[0] > 0:
                record[t * scene.substeps + k] = ctrl
        # Not needed for the physics, but the same bits as ticks under any integrator are promised.
        native.kinematics(scene.model, scene.data)
    return native.warnings(scene.warning, scene.warning_stride, scene.warning_kinds)


@njit(nogil=True, cache=True)
def _watch(memory: NDArray, owner: NDArray, latches: NDArray, first: bool) -> None:
    """What `_substep` does besides controlling the arm."""
    scene, at = memory[0].scene, memory[0].at
    if first:
        _begin(latches)
    _latch(scene, owner, latches)
    if at.cup != osc.NONE and _pads_in_contact(scene, at.pad) < osc.SEAL:
        native.float64s(at.ctrl + 8 * at.cup, 1)[0] = 0.0


@njit
def _substep(memory: NDArray, owner: NDArray, latches: NDArray, action: NDArray, first: bool) -> None:
    """One physics step under control. The first of a period moves the goal, from the pose just computed."""
    scene, at, state, work = memory[0].scene, memory[0].at, memory[0].state, memory[0].work
    native.step1(scene.model, scene.data)
    if first:
        osc.set_goal(at, state, work, action)
    osc.apply(at, state, work)
    _latch(scene, owner, latches)
    if at.cup != osc.NONE:
        osc.suck(at, state, _pads_in_contact(scene, at.pad))
    native.step2(scene.model, scene.data)


@njit
def _begin(latches: NDArray) -> None:
    """Forget the contacts of the last period."""
    latches[1] = 0


@njit
def _latch(scene: np.record, owner: NDArray, latches: NDArray) -> None:
    """Remember which bodies are in contact now. The array of contacts may move at every step."""
    count = native.int32s(scene.ncon, 1)[0]
    contact = native.int64s(scene.contact, 1)[0]
    for _ in range(count):
        if native.float64s(contact + scene.dist, 1)[0] <= 0.0:
            geoms = native.int32s(contact + scene.geom, 2)
            if geoms[0] >= 0 and geoms[1] >= 0:  # -1: a flex
                _mark(owner[geoms[0]], owner[geoms[1]], latches)
        contact += scene.stride


@njit
def _pads_in_contact(scene: np.record, first: int) -> int:
    """How many of the four geoms from `first` on touch something now."""
    count = native.int32s(scene.ncon, 1)[0]
    contact = native.int64s(scene.contact, 1)[0]
    seen = 0
    for _ in range(count):
        if native.float64s(contact + scene.dist, 1)[0] <= 0.0:
            geoms = native.int32s(contact + scene.geom, 2)
            for i in range(2):
                if 0 <= geoms[i] - first < 4:
                    seen |= 1 << (geoms[i] - first)
        contact += scene.stride
    return (seen & 1) + (seen >> 1 & 1) + (seen >> 2 & 1) + (seen >> 3)


@njit
def _mark(one: NDArray, other: NDArray, latches: NDArray) -> None:
    """Latch the contact of two (body, is robot) rows, in the row and column of the whole robot too."""
    robot = latches.shape[1] - 1
    a, b = one[0], other[0]
    for kind in range(2):
        latches[kind, a, b] = latches[kind, b, a] = 1
        if one[1]:
            latches[kind, robot, b] = latches[kind, b, robot] = 1
        if other[1]:
            latches[kind, robot, a] = latches[kind, a, robot] = 1
