"""The robot and its controller are robosuite's: same compiled numbers, same motion under the same actions.

Two differences are known. robosuite's controller looks at the arm once before it is put into its initial
posture, and uses that stale Jacobian and inertia in the first physics step after a reset; ours does not
(`cleared` below removes it from robosuite's side). And robosuite inverts with LAPACK where we factorise, so
that the last bits differ. They stay the last bits until the robot touches something: the points that the
empty jaw finds on itself, or the hand on the pedestal, can hang on a last bit, and all later motion with it.
"""

import logging
from collections.abc import Iterator
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from helpers import needs_robosuite
from numpy.typing import NDArray

from scengen.control.loop import Loop
from scengen.installation import ROBOSUITE
from scengen.robots import files, panda

PERIODS = 200
WORLDS = {"one arm": ("Lift", "default", ["Panda"]), "two arms": ("TwoArmLift", "parallel", ["Panda", "Panda"])}


@pytest.fixture(scope="module", params=WORLDS)
def world(request: pytest.FixtureRequest) -> Iterator[Any]:
    """robosuite's Lift, and TwoArmLift with the arms side by side, as `made`."""
    yield from made(*WORLDS[request.param])


@pytest.fixture(scope="module")
def lift() -> Iterator[Any]:
    """robosuite's Lift, as `made`."""
    yield from made(*WORLDS["one arm"])


def made(name: str, layout: str, robots: list[str]) -> Iterator[Any]:
    """An environment of robosuite at 100 Hz, without renderers, GL or log lines."""
    logging.disable(logging.WARNING)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MUJOCO_GL", "disable")  # robosuite sets it to egl on import; the context puts it back
        needs_robosuite()
        import robosuite
    env = robosuite.make(
        name,
        robots=robots,
        env_configuration=layout,
        has_renderer=False,
        has_offscreen_renderer=False,
        use_camera_obs=False,
        control_freq=100,
        horizon=100_000,
        seed=1,
    )
    yield env
    env.close()
    logging.disable(logging.NOTSET)


def smooth_actions(seed: int, amplitude: float, arms: int = 1) -> NDArray[np.float32]:
    """Random sums of sines below 1 Hz, shape (PERIODS, 7 * arms), with the jaws open."""
    rng = np.random.default_rng(seed)
    time = np.arange(PERIODS) * Loop.PERIOD
    actions = np.zeros((PERIODS, 7 * arms))
    for channel in range(7 * arms):
        for frequency, size, phase in rng.uniform([0.1, -0.5, 0], [1, 0.5, 2 * np.pi], (4, 3)):
            actions[:, channel] += size * np.sin(2 * np.pi * frequency * time + phase)
    actions *= amplitude
    actions[:, 6::7] = -1.0
    return np.clip(actions, -1, 1).astype(np.float32)


def start(env: Any, cleared: bool) -> tuple[mujoco.MjData, Loop]:
    """Reset robosuite, and put a loop of ours over the same model into the same state."""
    env.reset()
    model, data = env.sim.model._model, env.sim.data._data
    controllers = [robot.composite_controller.part_controllers["right"] for robot in env.robots]
    for controller in controllers:
        controller.new_update = cleared
    loop = Loop(model, mujoco.MjData(model), home=[controller.initial_joint for controller in controllers])
    mujoco.mj_copyData(loop.data, model, data)
    return data, loop


def grip(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.float64]:
    """Positions of the grip sites that belong to the present qpos [m], shape (arms, 3)."""
    mujoco.mj_kinematics(model, data)
    return np.array([data.site(names.grip_site).xpos for names in panda.arms(model)])


def distance(env: Any, actions: NDArray[np.float32], cleared: bool) -> float:
    """Largest distance of a grip site here and there [m] over an episode, or until the robot touches something."""
    data, loop = start(env, cleared)
    origin, path, apart = grip(loop.model, data), 0.0, 0.0
    for action in actions:
        env.step(action)
        loop.step(action)
        if loop.touched[-1].any():
            break
        theirs = grip(loop.model, data)
        path = max(path, float(np.linalg.norm(theirs - origin, axis=1).min()))
        apart = max(apart, float(np.linalg.norm(theirs - grip(loop.model, loop.data), axis=1).max()))
    assert path > 0.05
    return apart


@pytest.mark.parametrize("seed", range(3))
def test_translation_is_robosuites_to_the_last_bits(world: Any, seed: int) -> None:
    actions = smooth_actions(seed, 1.0, len(world.robots))
    for channel in (3, 4, 5):
        actions[:, channel::7] = 0
    assert distance(world, actions, cleared=True) <= 1e-12


@pytest.mark.parametrize("seed", range(3))
def test_translation_and_rotation_are_robosuites_to_the_last_bits(world: Any, seed: int) -> None:
    assert distance(world, smooth_actions(seed, 1.0, len(world.robots)), cleared=True) <= 1e-12


@pytest.mark.parametrize("seed", range(3))
def test_robosuites_stale_first_step_stays_below_a_micrometre(world: Any, seed: int) -> None:
    assert distance(world, smooth_actions(seed, 0.5, len(world.robots)), cleared=False) <= 1e-6


def test_a_scripted_grasp_lifts_the_cube_in_both(lift: Any) -> None:
    data, loop = start(lift, cleared=True)
    model, cube = loop.model, loop.model.body("cube_main").id
    target, apart = data.xpos[cube].copy(), 0.0
    for t in range(330):
        wanted = target + np.array([0, 0, 0.1 if t >= 230 else 0.0])
        action = np.zeros(7, np.float32)
        action[:3] = np.clip((wanted - grip(model, data)[0]) * 10, -1, 1)
        action[6] = 1.0 if t >= 150 else -1.0
        lift.step(action)
        loop.step(action)
        apart = max(apart, float(np.linalg.norm(grip(model, data) - grip(model, loop.data))))
    assert data.xpos[cube][2] > target[2] + 0.05
    assert loop.touched[cube, -1]
    assert apart <= 1e-6
    assert np.linalg.norm(data.xpos[cube] - loop.data.xpos[cube]) <= 1e-6


FIELDS = {
    "body": "body_mass body_inertia body_ipos body_iquat body_pos body_quat body_gravcomp",
    "jnt": "jnt_type jnt_range jnt_limited jnt_stiffness jnt_pos jnt_axis jnt_margin jnt_solref jnt_solimp "
    "dof_damping dof_armature dof_frictionloss dof_solref dof_solimp",
    "actuator": "actuator_gainprm actuator_biasprm actuator_ctrlrange actuator_ctrllimited "
    "actuator_forcerange actuator_forcelimited actuator_gear actuator_dyntype",
    "geom": "geom_type geom_size geom_pos geom_quat geom_friction geom_contype geom_conaffinity geom_condim "
    "geom_solref geom_solimp geom_priority geom_margin geom_gap geom_solmix",
    "site": "site_pos site_quat",
    "camera": "cam_pos cam_quat cam_fovy",
    "sensor": "sensor_type sensor_dim",
}
KINDS = {
    "body": mujoco.mjtObj.mjOBJ_BODY,
    "jnt": mujoco.mjtObj.mjOBJ_JOINT,
    "actuator": mujoco.mjtObj.mjOBJ_ACTUATOR,
    "geom": mujoco.mjtObj.mjOBJ_GEOM,
    "site": mujoco.mjtObj.mjOBJ_SITE,
    "camera": mujoco.mjtObj.mjOBJ_CAMERA,
    "sensor": mujoco.mjtObj.mjOBJ_SENSOR,
}


def names(model: mujoco.MjModel, kind: str) -> set[str]:
    """Names of the robot's elements of one kind, visual geoms apart."""
    count = getattr(model, {"actuator": "nu", "camera": "ncam"}.get(kind, f"n{kind}"))
    found = set()
    for index in range(count):
        name = mujoco.mj_id2name(model, KINDS[kind], index) or ""
        seen_only = kind == "geom" and not (model.geom_contype[index] or model.geom_conaffinity[index])
        if name.startswith(tuple(panda.FOLDERS)) and not seen_only:
            found.add(name)
    return found


def value(model: mujoco.MjModel, kind: str, name: str, field: str) -> NDArray[np.float64]:
    """One field of one named element."""
    index = mujoco.mj_name2id(model, KINDS[kind], name)
    if field.startswith("dof_"):
        index = model.jnt_dofadr[index]
    return np.array(getattr(model, field)[index], float)


@pytest.mark.parametrize("visual", [False, True])
@pytest.mark.parametrize("kind", FIELDS)
def test_the_robot_compiles_to_robosuites_numbers(world: Any, kind: str, visual: bool) -> None:
    theirs = world.sim.model._model
    scene = mujoco.MjSpec()
    for number, base in enumerate(panda.bases(len(world.robots))):
        panda.attach(scene, visual, number=number, base=base)
    ours = scene.compile()
    sensible = kind != "sensor" or visual  # the bare robot has no sensors
    assert names(ours, kind) == (names(theirs, kind) if sensible else set())
    for name in names(ours, kind):
        for field in FIELDS[kind].split():
            np.testing.assert_array_equal(
                value(ours, kind, name, field), value(theirs, kind, name, field), err_msg=f"{field} of {name}"
            )


def test_the_hashes_of_the_robots_files_are_those_of_the_installed_robosuite() -> None:
    if (robosuite := find_spec("robosuite")) is None or not robosuite.submodule_search_locations:
        pytest.skip("no robosuite; it is an extra")
    theirs = Path(robosuite.submodule_search_locations[0]) / "models" / "assets"
    assert len(files.hashes()) == 67 and version("robosuite") == ROBOSUITE
    for name in files.hashes():
        assert files.is_ours(name, (theirs / name).read_bytes()), name


def test_every_mesh_of_the_robot_is_one_of_these_files() -> None:
    scene = mujoco.MjSpec()
    panda.attach(scene, visual=True)
    assert len({panda.mesh_file(mesh.name, mesh.file) for mesh in scene.meshes}) == 64


def test_home_is_robosuites(lift: Any) -> None:
    model = lift.robots[0].robot_model
    np.testing.assert_array_equal(panda.HOME, model.init_qpos)
    np.testing.assert_array_equal(panda.FINGERS, lift.robots[0].gripper["right"].init_qpos)
