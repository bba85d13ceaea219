"""Frames: the verdict of a scene must not change if the scene is moved or turned as a whole.

The parameters that move a scene are not declared, but found by building scenes: with them all things on the table move
as one rigid body, along the table or about a vertical line. Then every moment of a solution can be moved, robot
included, and the family's verdict on it must stay the same. So a goal that uses the axes of the table instead of those
of the scene is found without another simulation.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..episode import Actions, Episode
from ..geometry import Mat3, Vec3, about_z, quat, yaw_of
from ..params import Parameter, parameters, with_values
from ..samplers.keyed import unit
from ..scenario import Scenario
from ..sim.world import World
from ..validate.rebuilt import world_of

TOLERANCE = 1e-9
"""Largest deviation of a geom from a rigid motion [m, and entries of matrices], due to rounding."""
MAX_TRIES = 50
"""Largest number of draws within the bounds of a parameter to find a feasible scene."""
MOMENT_INTERVAL = 10
"""Number of control periods between two judged moments; the last moment is always judged."""
FIXED_GEOMS = ("floor", "table_top")
"""Geoms that do not move with a scene."""


@dataclass(frozen=True)
class Motion:
    """A rotation about the vertical, then a shift."""

    rot: Mat3
    shift: Vec3
    """Shift [m]."""

    def __call__(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Moved points, shape (..., 3) [m]."""
        return points @ self.rot.T + self.shift


IDENTITY = Motion(np.eye(3), np.zeros(3))
"""The motion that changes nothing."""


@dataclass(frozen=True)
class MovedScene:
    """A scenario that equals another one, moved as a whole."""

    parameter: str
    """Name of the parameter that moves it."""
    scenario: Scenario
    motion: Motion
    """Motion from the other scenario to this one."""


def moved(scenario: Scenario, key: str) -> Iterator[MovedScene]:
    """The scenario, moved by each parameter that moves it as a whole to a feasible place, which depends on `key`."""
    for parameter in parameters(scenario):
        there = next(_feasible_variants(scenario, parameter, key), None)
        if there is not None and (motion := _rigid_motion(scenario, there)):
            yield MovedScene(parameter.name, there, motion)


def difference(scenario: Scenario, other: MovedScene, actions: Actions, embodiment: str) -> str:
    """Replay actions in a scenario, and judge its moments also in the moved scene.

    Args:
        actions: filtered actions, shape (periods, 7 * arms), such as a witness.

    Returns:
        Description of the first verdict that differs there; empty if there is none.
    """
    played, here, there = (world_of(s, embodiment) for s in (scenario, scenario, other.scenario))
    _move_robot(there, other.motion)
    episode = Episode(scenario, played)
    for period, action in enumerate(actions):
        if episode.step(action) == "unstable":
            break
        if period % MOMENT_INTERVAL and period + 1 < len(actions):
            continue
        # Both in the same way: after a step, the quantities that MuJoCo derives from a state are one step old.
        _copy_moved(played, here, IDENTITY)
        _copy_moved(played, there, other.motion)
        before, after = _verdicts(scenario, here), _verdicts(other.scenario, there)
        for name in before:
            if after[name] != before[name]:
                return f"at {played.time:.2f} s {name} is {before[name]}, but {after[name]} in the moved scene"
    return ""


def _verdicts(scenario: Scenario, world: World) -> dict[str, bool]:
    """Verdicts of a family on a moment."""
    return {"success": scenario.success(world), "failure": scenario.failure(world) is not None}


def _feasible_variants(scenario: Scenario, parameter: Parameter, key: str) -> Iterator[Scenario]:
    """Feasible scenarios with another value of one parameter, from its whole range."""
    for k in range(0 if parameter.integer else MAX_TRIES):
        share = unit(key, parameter.name, k)
        there = with_values(scenario, {parameter.name: parameter.low + share * (parameter.high - parameter.low)})
        if there.infeasible() is None:
            yield there


def _start(scenario: Scenario) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Model and data of the scene without robot, at its start."""
    model = scenario.build().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


PHYSICS = (
    "body_mass",
    "body_inertia",
    "geom_type",
    "geom_size",
    "geom_friction",
    "jnt_type",
    "jnt_range",
    "dof_damping",
)
"""Fields of a model that a rigid motion does not change."""


def _rigid_motion(before: Scenario, after: Scenario) -> Motion | None:
    """The rigid motion of all things on the table from one scene to the other; None if there is none."""
    (model, data), (other, there) = _start(before), _start(after)
    if not all(_alike(getattr(model, name), getattr(other, name)) for name in PHYSICS):
        return None
    movable = [g for g in range(model.ngeom) if model.geom(g).name not in FIXED_GEOMS]
    spots, turns = data.geom_xpos[movable], data.geom_xmat[movable].reshape(-1, 3, 3)
    new_spots, new_turns = there.geom_xpos[movable], there.geom_xmat[movable].reshape(-1, 3, 3)
    rot = about_z(yaw_of(new_turns[0] @ turns[0].T))
    motion = Motion(rot, new_spots[0] - rot @ spots[0])
    rigid = _alike(motion(spots), new_spots) and _alike(rot @ turns, new_turns) and abs(motion.shift[2]) < TOLERANCE
    still = _alike(spots, new_spots) and _alike(turns, new_turns)
    return motion if rigid and not still else None


def _alike(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    return one.shape == other.shape and np.allclose(one, other, rtol=0.0, atol=TOLERANCE)


def _move_robot(world: World, motion: Motion) -> None:
    """Move the robot with the scene, so that its contacts with things do not change."""
    model = world.model
    for body in world.own:
        if model.body_parentid[body] == 0:
            model.body_pos[body] = motion(model.body_pos[body])
            model.body_quat[body] = _turned(model.body_quat[body], motion)


def _copy_moved(here: World, there: World, motion: Motion) -> None:
    """Copy the moment of one world to another one and move it. Contacts and the episode's memory do not change."""
    there.restore(here.state())
    model, data = there.model, there.data
    for joint in np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE):
        at, dof = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        data.qpos[at : at + 3] = motion(data.qpos[at : at + 3])
        data.qpos[at + 3 : at + 7] = _turned(data.qpos[at + 3 : at + 7], motion)
        data.qvel[dof : dof + 3] = motion.rot @ data.qvel[dof : dof + 3]  # the angular velocity is in the body's axes
    for mark in range(model.nmocap):
        data.mocap_pos[mark] = motion(data.mocap_pos[mark])
        data.mocap_quat[mark] = _turned(data.mocap_quat[mark], motion)
    mujoco.mj_forward(model, data)


def _turned(orientation: NDArray[np.float64], motion: Motion) -> NDArray[np.float64]:
    """A quaternion (wxyz) after a motion."""
    turned = np.empty(4)
    mujoco.mju_mulQuat(turned, np.array(quat("z", yaw_of(motion.rot))), np.ascontiguousarray(orientation))
    return turned
