"""robosuite's OSC_POSE and PandaGripper as compiled functions over MuJoCo's own arrays.

Operational space control (Khatib 1987), configured as robosuite's default BASIC controller of the Panda
(controllers/config/robots/default_panda.json): the action moves a goal pose relative to the current pose, and joint
torques pull the grip site to it. `set_goal` runs once per control period, `apply` once per physics step, between
mj_step1 and mj_step2. Formulas and their order follow robosuite, including the float32 rounding of the rotation.

Symbols: J Jacobian of the grip site, M joint-space inertia, Lambda = (J M^-1 J^T)^-1 inertia at the site.
"""

import math

import mujoco
import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from ..robots.panda import JOINTS, Names
from .native import float64s

STEP = 0.05
"""Translation of the goal at full action [m]: default_panda.json, output_max."""
TURN = 0.5
"""Rotation of the goal at full action [rad]: default_panda.json, output_max."""
KP = 150.0
"""Stiffness of the goal, for translation and rotation [1/s^2]: default_panda.json, kp."""
KD = 2.0 * math.sqrt(KP)
"""Damping of the goal [1/s], critical: default_panda.json, damping_ratio 1."""
POSTURE_KP = 10.0
"""Stiffness of the pull to the initial posture [1/s^2]: control_utils.nullspace_torques, joint_kp."""
POSTURE_KD = 2.0 * math.sqrt(POSTURE_KP)
"""Damping of the pull to the initial posture [1/s], critical."""
JAW_SPEED = 0.2
"""Change of the jaw command in one control period: PandaGripper.speed."""
CLOSED_JAW = (-1.0, 1.0)
"""Jaw command after a command to close: PandaGripper.current_action."""
MIN_SEALED_PADS = 3
"""Number of a suction cup's four pads that must touch something before it pulls. With two it would hold on to an
edge."""
NONE = -1
"""Index of a part that this robot does not have, jaw or suction cup."""
MIN_PIVOT = 1e-18
"""Smallest pivot. Smaller ones are raised to it, so that a singular posture gives finite torques, which are clipped
later."""

PLACES = np.dtype(
    [
        ("qpos", np.int64),
        ("qvel", np.int64),
        ("ctrl", np.int64),
        ("ctrlrange", np.int64),
        ("M", np.int64),
        ("qfrc_bias", np.int64),
        ("cdof", np.int64),
        ("subtree_com", np.int64),
        ("grip_pos", np.int64),
        ("grip_rot", np.int64),
        ("base_pos", np.int64),
        ("base_rot", np.int64),
        ("angle", np.int64, (JOINTS,)),
        ("row", np.int64, (JOINTS,)),
        ("motor", np.int64, (JOINTS,)),
        ("jaw", np.int64, (2,)),
        ("cup", np.int64),
        ("pad", np.int64),
        ("kp", np.float64),
        ("kd", np.float64),
        ("jaw_speed", np.float64),
        ("suction_speed", np.float64),
    ]
)
"""Locations in memory, and the settings of the controller (`tune`).

Addresses: qpos, ctrl, ctrlrange of the whole model; qvel, qfrc_bias, cdof from the first arm joint on; M whole;
subtree_com of the robot; position and rotation of the grip site and of the controller's base site. Indices: joint
angles in qpos, arm rows in M, arm motors, jaw motors and suction cup in ctrl, first of the cup's four pads among the
geoms. Settings: stiffness, damping, changes of the jaw command and of the suction in one control period.
"""

STATE = np.dtype(
    [
        ("goal_pos", np.float64, (3,)),
        ("goal_rot", np.float64, (3, 3)),
        ("jaw", np.float64, (2,)),
        ("jammed", np.float64),
        ("posture", np.float64, (JOINTS,)),
    ]
)
"""State of the controller: goal in the base frame [m], jaw command in [-1, 1] (or, in its first element, the
suction from off (0) to full (1)), whether the gripper is forced open (1) against the command, initial angles [rad]."""

WORK = np.dtype(
    [
        ("J", np.float64, (6, JOINTS)),
        ("M", np.float64, (JOINTS, JOINTS)),
        ("M_root", np.float64, (JOINTS, JOINTS)),
        ("white_Jt", np.float64, (JOINTS, 6)),
        ("Lambda_inv", np.float64, (6, 6)),
        ("full_root", np.float64, (6, 6)),
        ("pos_root", np.float64, (3, 3)),
        ("rot_root", np.float64, (3, 3)),
        ("task", np.float64, (6,)),
        ("wrench", np.float64, (6,)),
        ("joint", np.float64, (JOINTS,)),
        ("leak", np.float64, (6,)),
        ("delta", np.float64, (3, 3)),
        ("world_rot", np.float64, (3, 3)),
    ]
)
"""Scratch memory of one control step. Nothing in it outlives the step. A `root` is a lower Cholesky factor."""


def places(model: mujoco.MjModel, data: mujoco.MjData, names: Names) -> NDArray[np.void]:
    """Addresses and indices of the arm in one model and its data, `PLACES` of shape ().

    Raises ValueError if the model has no Panda, or one whose arm is not a separate chain on the ground.
    """
    found = np.zeros((), PLACES)
    try:
        grip = model.site(names.grip_site).id
        base = model.site(names.controller_site).id
        joints = [model.joint(name) for name in names.joints]
        found["motor"] = [model.actuator(name).id for name in names.motors]
        found["jaw"] = found["cup"] = found["pad"] = NONE
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, names.cup) == NONE:
            found["jaw"] = [model.actuator(name).id for name in names.finger_motors]
        else:
            found["cup"] = model.actuator(names.cup).id
            found["pad"] = model.geom(names.first_pad).id
    except KeyError as error:
        raise ValueError(
            f"no Panda in this model: {error.args[0]}; call panda.attach(scene) before compiling"
        ) from None
    dofs = np.array([joint.dofadr[0] for joint in joints])
    if model.dof_parentid[dofs[0]] != -1 or (np.diff(dofs) != 1).any():
        raise ValueError("the arm must stand on the ground with consecutive joints; use panda.attach(scene)")
    first = dofs[0]
    for name in ("qpos", "ctrl", "M"):
        found[name] = getattr(data, name).ctypes.data
    found["ctrlrange"] = model.actuator_ctrlrange.ctypes.data
    found["qvel"] = data.qvel[first:].ctypes.data
    found["qfrc_bias"] = data.qfrc_bias[first:].ctypes.data
    found["cdof"] = data.cdof[first:].ctypes.data
    found["subtree_com"] = data.subtree_com[model.body_rootid[model.site_bodyid[grip]]].ctypes.data
    found["grip_pos"], found["grip_rot"] = data.site_xpos[grip].ctypes.data, data.site_xmat[grip].ctypes.data
    found["base_pos"], found["base_rot"] = data.site_xpos[base].ctypes.data, data.site_xmat[base].ctypes.data
    found["angle"] = [joint.qposadr[0] for joint in joints]
    found["row"] = model.M_rowadr[dofs]
    tune(found, 1.0, 1.0)
    return found


def tune(at: NDArray[np.void], stiffness: float, gripper: float) -> None:
    """Set stiffness, with critical damping, and the gripper's speed, as factors on robosuite's."""
    at["kp"], at["kd"] = KP * stiffness, KD * math.sqrt(stiffness)
    at["jaw_speed"], at["suction_speed"] = JAW_SPEED * gripper, gripper


def start(state: NDArray[np.void], posture: ArrayLike, closed: bool = False) -> None:
    """Set the controller's state as after a reset, with the initial joint angles [rad].

    Args:
        closed: whether the jaw has been commanded to close.
    """
    state["goal_pos"] = state["goal_rot"] = 0.0  # set by the first action, before its first use
    # PandaGripper.current_action: half open until commanded; a cup's suction is off
    state["jaw"] = CLOSED_JAW if closed else 0.0
    state["jammed"] = 0.0
    state["posture"] = posture


@njit
def set_goal(at: np.record, state: np.record, work: np.record, action: NDArray[np.float32]) -> None:
    """Move goal and jaw by `action`, shape (7,), once per control period, relative to the current pose."""
    grip_pos, grip_rot = float64s(at.grip_pos, 3), float64s(at.grip_rot, (3, 3))
    base_pos, base_rot = float64s(at.base_pos, 3), float64s(at.base_rot, (3, 3))
    for i in range(3):
        here = 0.0
        for k in range(3):
            here += base_rot[k, i] * (grip_pos[k] - base_pos[k])
        state.goal_pos[i] = here + STEP * clip(action[i], -1.0, 1.0)
    _rotation(
        TURN * clip(action[3], -1.0, 1.0),
        TURN * clip(action[4], -1.0, 1.0),
        TURN * clip(action[5], -1.0, 1.0),
        work.delta,
    )
    for j in range(3):
        for i in range(3):
            work.world_rot[i, j] = _column_dot(base_rot, i, grip_rot, j)
    _multiply(work.delta, work.world_rot, state.goal_rot)
    if at.cup == NONE:
        _move_jaw(state, at.jaw_speed, action[6])
    else:
        state.jaw[0] = min(state.jaw[0] + at.suction_speed, 1.0) if action[6] > 0.0 else 0.0


@njit
def apply(at: np.record, state: np.record, work: np.record) -> None:
    """Write torques and jaw commands of this physics step into ctrl, between mj_step1 and mj_step2.

    A suction cup depends on the contacts and is left to `suck`.
    """
    _jacobian(at, work.J)
    _joint_inertia(at, work.M)
    _task_inertia(work)
    _task_acceleration(at, state, work)
    cholesky_solve(work.pos_root, work.task[:3], work.wrench[:3])
    cholesky_solve(work.rot_root, work.task[3:], work.wrench[3:])
    _posture_acceleration(at, state, work)
    _write_torques(at, work)
    if at.cup == NONE:
        _write_jaw(at, state)
        force_open(at, state)


@njit
def suck(at: np.record, state: np.record, touching: int) -> None:
    """Write the suction of this physics step into ctrl: the commanded one if `touching` pads close the lip, else 0."""
    pull = float64s(at.ctrl + 8 * at.cup, 1)
    pull[0] = state.jaw[0] if touching >= MIN_SEALED_PADS and state.jammed == 0.0 else 0.0


@njit
def force_open(at: np.record, state: np.record) -> None:
    """Write into ctrl the command that opens a jammed jaw: the ends of the ranges that correspond to full opening."""
    if state.jammed != 0.0:
        left, right = float64s(at.ctrlrange + 16 * at.jaw[0], 2), float64s(at.ctrlrange + 16 * at.jaw[1], 2)
        float64s(at.ctrl + 8 * at.jaw[0], 1)[0] = left[1]
        float64s(at.ctrl + 8 * at.jaw[1], 1)[0] = right[0]


@njit
def _rotation(x: float, y: float, z: float, out: NDArray[np.float64]) -> None:
    """Rotation matrix, shape (3, 3), of a rotation vector [rad]: robosuite's axisangle2quat and quat2mat.

    Like robosuite, it rounds the quaternion to float32 and multiplies it in float32.
    """
    angle = math.sqrt(x * x + y * y + z * z)
    q = np.zeros(4, np.float32)
    q[0] = 1.0
    if angle > 0.0:
        sine = math.sin(angle / 2.0)
        q[0] = math.cos(angle / 2.0)
        q[1], q[2], q[3] = x / angle * sine, y / angle * sine, z / angle * sine
    # OpenBLAS adds the float32 products of a short sdot in float64.
    squares = 0.0
    for i in range(4):
        squares += q[i] * q[i]
    scale = math.sqrt(2.0 / np.float32(squares))
    for i in range(4):
        q[i] = q[i] * scale
    out[0, 0] = 1.0 - q[2] * q[2] - q[3] * q[3]
    out[0, 1] = q[1] * q[2] - q[3] * q[0]
    out[0, 2] = q[1] * q[3] + q[2] * q[0]
    out[1, 0] = q[1] * q[2] + q[3] * q[0]
    out[1, 1] = 1.0 - q[1] * q[1] - q[3] * q[3]
    out[1, 2] = q[2] * q[3] - q[1] * q[0]
    out[2, 0] = q[1] * q[3] - q[2] * q[0]
    out[2, 1] = q[2] * q[3] + q[1] * q[0]
    out[2, 2] = 1.0 - q[1] * q[1] - q[2] * q[2]


@njit
def _move_jaw(state: np.record, speed: float, command: float) -> None:
    """One period of the jaw's ramp, as PandaGripper.format_action: only the sign counts; positive closes."""
    change = speed * np.sign(command)
    state.jaw[0] = clip(state.jaw[0] - change, -1.0, 1.0)
    state.jaw[1] = clip(state.jaw[1] + change, -1.0, 1.0)


@njit
def _jacobian(at: np.record, J: NDArray[np.float64]) -> None:
    """Jacobian of the grip site, shape (6, 7): rows of linear [m/rad], then of angular velocity [rad/rad]."""
    grip, centre = float64s(at.grip_pos, 3), float64s(at.subtree_com, 3)
    axes = float64s(at.cdof, (JOINTS, 6))  # angular, then linear velocity at the robot's centre of mass
    x, y, z = grip[0] - centre[0], grip[1] - centre[1], grip[2] - centre[2]
    for i in range(JOINTS):
        wx, wy, wz = axes[i, 0], axes[i, 1], axes[i, 2]
        J[0, i] = axes[i, 3] + wy * z - wz * y
        J[1, i] = axes[i, 4] + wz * x - wx * z
        J[2, i] = axes[i, 5] + wx * y - wy * x
        J[3, i], J[4, i], J[5, i] = wx, wy, wz


@njit
def _joint_inertia(at: np.record, M: NDArray[np.float64]) -> None:
    """The arm's block of the inertia matrix [kg m^2], shape (7, 7). Row i of data.M lists joints 0 to i."""
    for i in range(JOINTS):
        row = float64s(at.M + 8 * at.row[i], i + 1)
        for k in range(i + 1):
            M[i, k] = M[k, i] = row[k]


@njit
def _task_inertia(work: np.record) -> None:
    """Cholesky factors of M, of J M^-1 J^T, and of its translation and rotation blocks alone.

    With M = L L^T and W = L^-1 J^T, J M^-1 J^T is W^T W: half the work of solving for M^-1 J^T.
    """
    cholesky(work.M, work.M_root)
    _whiten(work.M_root, work.J, work.white_Jt)
    W = work.white_Jt
    for i in range(6):
        for j in range(i + 1):
            total = 0.0
            for k in range(JOINTS):
                total += W[k, i] * W[k, j]
            work.Lambda_inv[i, j] = work.Lambda_inv[j, i] = total
    cholesky(work.Lambda_inv, work.full_root)
    cholesky(work.Lambda_inv[:3, :3], work.pos_root)
    cholesky(work.Lambda_inv[3:, 3:], work.rot_root)


@njit
def _whiten(root: NDArray[np.float64], J: NDArray[np.float64], W: NDArray[np.float64]) -> None:
    """Solve root W = J^T, for all six columns at once: shapes (7, 7), (6, 7), (7, 6)."""
    for i in range(JOINTS):
        for j in range(6):
            W[i, j] = J[j, i]
        for k in range(i):
            for j in range(6):
                W[i, j] -= root[i, k] * W[k, j]
        scale = 1.0 / root[i, i]
        for j in range(6):
            W[i, j] *= scale


@njit
def _task_acceleration(at: np.record, state: np.record, work: np.record) -> None:
    """Desired acceleration of the grip site [m/s^2, rad/s^2], world, shape (6,): kp error - kd velocity."""
    grip_pos, grip_rot = float64s(at.grip_pos, 3), float64s(at.grip_rot, (3, 3))
    base_pos, base_rot = float64s(at.base_pos, 3), float64s(at.base_rot, (3, 3))
    _multiply(base_rot, state.goal_rot, work.world_rot)
    velocity = float64s(at.qvel, JOINTS)
    for i in range(3):
        work.task[i] = at.kp * (base_pos[i] + dot(base_rot[i], state.goal_pos) - grip_pos[i])
        work.task[3 + i] = at.kp * _turn_error(grip_rot, work.world_rot, i)
    for i in range(6):
        work.task[i] -= at.kd * dot(work.J[i], velocity)


@njit
def _turn_error(actual: NDArray[np.float64], wanted: NDArray[np.float64], axis: int) -> float:
    """One component of the rotation between two matrices [rad]: control_utils.orientation_error.

    Half the sum of the cross products of their columns.
    """
    j, k = (axis + 1) % 3, (axis + 2) % 3
    total = 0.0
    for column in range(3):
        total += actual[j, column] * wanted[k, column] - actual[k, column] * wanted[j, column]
    return 0.5 * total


@njit
def _posture_acceleration(at: np.record, state: np.record, work: np.record) -> None:
    """Joint accelerations a back to the initial posture [rad/s^2], shape (7,), without effect on the grip site.

    N^T M a = M a - J^T Lambda J a (control_utils.nullspace_torques): Lambda J a is subtracted from the wrench.
    """
    qpos = float64s(at.qpos, at.angle[JOINTS - 1] + 1)
    velocity = float64s(at.qvel, JOINTS)
    for i in range(JOINTS):
        work.joint[i] = POSTURE_KP * (state.posture[i] - qpos[at.angle[i]]) - POSTURE_KD * velocity[i]
    for i in range(6):
        work.task[i] = dot(work.J[i], work.joint)
    cholesky_solve(work.full_root, work.task, work.leak)
    for i in range(6):
        work.wrench[i] -= work.leak[i]


@njit
def _write_torques(at: np.record, work: np.record) -> None:
    """ctrl of the arm motors [N m]: J^T wrench + M a + gravity and Coriolis terms, within their range."""
    bias = float64s(at.qfrc_bias, JOINTS)
    for i in range(JOINTS):
        torque = bias[i] + dot(work.M[i], work.joint)
        for k in range(6):
            torque += work.J[k, i] * work.wrench[k]
        motor = float64s(at.ctrl + 8 * at.motor[i], 1)
        limits = float64s(at.ctrlrange + 16 * at.motor[i], 2)
        motor[0] = clip(torque, limits[0], limits[1])


@njit
def _write_jaw(at: np.record, state: np.record) -> None:
    """ctrl of the finger motors [m]: the jaw command, from [-1, 1] to their range (SimpleGripController)."""
    for i in range(2):
        motor = float64s(at.ctrl + 8 * at.jaw[i], 1)
        limits = float64s(at.ctrlrange + 16 * at.jaw[i], 2)
        middle, half = 0.5 * (limits[1] + limits[0]), 0.5 * (limits[1] - limits[0])
        motor[0] = clip(middle + half * state.jaw[i], limits[0], limits[1])


@njit
def clip(value: float, low: float, high: float) -> float:
    """`value`, or the bound that it exceeds."""
    return min(max(value, low), high)


@njit
def dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Scalar product, summed from the first element on."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@njit
def _column_dot(a: NDArray[np.float64], i: int, b: NDArray[np.float64], j: int) -> float:
    """Scalar product of column i of `a` and column j of `b`, shapes (3, 3)."""
    return a[0, i] * b[0, j] + a[1, i] * b[1, j] + a[2, i] * b[2, j]


@njit
def _multiply(a: NDArray[np.float64], b: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """out = a b, shapes (3, 3); `out` is neither of them."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@njit
def cholesky(A: NDArray[np.float64], root: NDArray[np.float64]) -> None:
    """Lower factor of a symmetric positive matrix into `root`, whose upper part is left as it is."""
    for i in range(A.shape[0]):
        for j in range(i + 1):
            rest = A[i, j]
            for k in range(j):
                rest -= root[i, k] * root[j, k]
            root[i, j] = math.sqrt(max(rest, MIN_PIVOT)) if i == j else rest / root[j, j]


@njit
def cholesky_solve(root: NDArray[np.float64], b: NDArray[np.float64], x: NDArray[np.float64]) -> None:
    """Solve A x = b for A = root root^T."""
    n = root.shape[0]
    for i in range(n):
        rest = b[i]
        for k in range(i):
            rest -= root[i, k] * x[k]
        x[i] = rest / root[i, i]
    for i in range(n - 1, -1, -1):
        rest = x[i]
        for k in range(i + 1, n):
            rest -= root[k, i] * x[k]
        x[i] = rest / root[i, i]
