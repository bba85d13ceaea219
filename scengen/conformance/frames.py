"""Frames: a scene that is moved or turned as a whole must be judged as it was before.

Which parameters do that is found by building, not declared: those by which everything that lies on the table moves as
one rigid body, over the table or about a vertical line. Then every moment of a solution can be carried over, robot
included, and what the family says of it there must be what it said before. A goal that counts in the table's axes,
where it means the scene's, is caught by that without a simulation of its own.
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

EXACT = 1e-9
"""How far a geom may be from where a rigid motion takes it [m, and entries of matrices]: rounding."""
TRIES = 50
"""Draws within the bounds of a parameter until one gives a feasible scene."""
EVERY = 10
"""Control periods between two moments that are judged; the last one always is."""
FIXED = ("floor", "table_top")
"""Geoms that stay where they are."""


@dataclass(frozen=True)
class Motion:
    """A turn about the vertical, then a shift."""

    rot: Mat3
    shift: Vec3
    """[m]"""

    def __call__(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where it takes points, shape (..., 3) [m]."""
        return points @ self.rot.T + self.shift


STILL = Motion(np.eye(3), np.zeros(3))


@dataclass(frozen=True)
class MovedScene:
    """A scenario that is another one moved as a whole."""

    parameter: str
    scenario: Scenario
    motion: Motion


def moved(scenario: Scenario, key: str) -> Iterator[MovedScene]:
    """The scenario moved by each parameter that moves it as a whole, to a feasible place that `key` decides."""
    for parameter in parameters(scenario):
        there = next(_elsewhere(scenario, parameter, key), None)
        if there is not None and (motion := _motion(scenario, there)):
            yield MovedScene(parameter.name, there, motion)


def differing(scenario: Scenario, other: MovedScene, actions: Actions, embodiment: str) -> str:
    """Play actions in a scenario, and judge every moment of it in the other place too.

    Args:
        actions: which have passed the filter, shape (periods, 7 * arms), such as a witness.

    Returns:
        The first verdict that is another there, in words; empty if there is none.
    """
    played, here, there = (world_of(s, embodiment) for s in (scenario, scenario, other.scenario))
    _move_robot(there, other.motion)
    episode = Episode(scenario, played)
    for period, action in enumerate(actions):
        if episode.step(action) == "unstable":
            break
        if period % EVERY and period + 1 < len(actions):
            continue
        _carry(played, here, STILL)  # both the same way: what MuJoCo derives of a state is a step old after a step
        _carry(played, there, other.motion)
        before, after = _said(scenario, here), _said(other.scenario, there)
        for what in before:
            if after[what] != before[what]:
                return f"at {played.time:.2f} s {what} is {before[what]}, and {after[what]} where the scene is moved"
    return ""


def _said(scenario: Scenario, world: World) -> dict[str, bool]:
    """What a family says of a moment."""
    return {"success": scenario.success(world), "failure": scenario.failure(world) is not None}


def _elsewhere(scenario: Scenario, parameter: Parameter, key: str) -> Iterator[Scenario]:
    """The scenario with other values of one parameter that are feasible, from anywhere within its bounds."""
    for k in range(0 if parameter.integer else TRIES):
        share = unit(key, parameter.name, k)
        there = with_values(scenario, {parameter.name: parameter.low + share * (parameter.high - parameter.low)})
        if there.infeasible() is None:
            yield there


def _start(scenario: Scenario) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The scene without robot, at its start."""
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
"""What a rigid motion leaves as it is."""


def _motion(before: Scenario, after: Scenario) -> Motion | None:
    """The rigid motion that takes all that lies on the table from one scene to the other; None if there is none."""
    (model, data), (other, there) = _start(before), _start(after)
    if not all(_alike(getattr(model, name), getattr(other, name)) for name in PHYSICS):
        return None
    movable = [g for g in range(model.ngeom) if model.geom(g).name not in FIXED]
    spots, turns = data.geom_xpos[movable], data.geom_xmat[movable].reshape(-1, 3, 3)
    new_spots, new_turns = there.geom_xpos[movable], there.geom_xmat[movable].reshape(-1, 3, 3)
    rot = about_z(yaw_of(new_turns[0] @ turns[0].T))
    motion = Motion(rot, new_spots[0] - rot @ spots[0])
    rigid = _alike(motion(spots), new_spots) and _alike(rot @ turns, new_turns) and abs(motion.shift[2]) < EXACT
    still = _alike(spots, new_spots) and _alike(turns, new_turns)
    return motion if rigid and not still else None


def _alike(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    return one.shape == other.shape and np.allclose(one, other, rtol=0.0, atol=EXACT)


def _move_robot(world: World, motion: Motion) -> None:
    """Move the robot with the scene: what it touches and holds stays where it is in the hand."""
    model = world.model
    for body in world.own:
        if model.body_parentid[body] == 0:
            model.body_pos[body] = motion(model.body_pos[body])
            model.body_quat[body] = _turned(model.body_quat[body], motion)


def _carry(here: World, there: World, motion: Motion) -> None:
    """Put the moment of one world into the other one, moved: contacts and memory of the episode are as they were."""
    there.restore(here.state())
    model, data = there.model, there.data
    for joint in np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE):
        at, dof = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        data.qpos[at : at + 3] = motion(data.qpos[at : at + 3])
        data.qpos[at + 3 : at + 7] = _turned(data.qpos[at + 3 : at + 7], motion)
        data.qvel[dof : dof + 3] = motion.rot @ data.qvel[dof : dof + 3]  # the spin counts in the body's own axes
    for mark in range(model.nmocap):
        data.mocap_pos[mark] = motion(data.mocap_pos[mark])
        data.mocap_quat[mark] = _turned(data.mocap_quat[mark], motion)
    mujoco.mj_forward(model, data)


def _turned(orientation: NDArray[np.float64], motion: Motion) -> NDArray[np.float64]:
    """A quaternion (wxyz) after a motion."""
    turned = np.empty(4)
    mujoco.mju_mulQuat(turned, np.array(quat("z", yaw_of(motion.rot))), np.ascontiguousarray(orientation))
    return turned
