"""robosuite's environment is perturbed as the Gymnasium environment is: the same draws, the same errors."""

import numpy as np
import pytest
from helpers import REFERENCE, needs_robosuite, pictures_are_possible

from scengen.envs.gym import PoolEnv
from scengen.errors import BadConfig, UnknownName
from scengen.look.looks import PLAIN
from scengen.perturb.distractors import SPARE
from scengen.perturb.drawn import arrays
from scengen.pool import Pool

needs_robosuite()
# ruff: noqa: E402
from scengen.envs.robosuite import env_class

drawing = pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL on this machine")
CAMERAS = {"agentview": "rgb_exo_right_cam", "robot0_eye_in_hand": "rgb_gripper_cam"}
STREAMS = {
    name: name
    for name in ("robot0_eef_pos", "robot0_joint_pos", "robot0_joint_vel", "robot0_gripper_qpos", "object-state")
} | {"robot0_eef_quat_site": "robot0_eef_quat"}
"""This package's names of readings, by robosuite's."""
STEPS = 3
SIZE = 64


@pytest.fixture(scope="module")
def row():
    return Pool.open(REFERENCE).row("8ed4")


def theirs(row, perturb, cameras=(), repeat=1, **settings):
    pictures = {"camera_names": [*cameras], "camera_widths": SIZE, "camera_heights": SIZE} if cameras else {}
    shown = {"use_camera_obs": bool(cameras), "has_offscreen_renderer": bool(cameras), **pictures}
    made = {"scenario": row, "control_freq": 100 // repeat, "perturb": perturb, "perturb_seed": 2, **shown, **settings}
    env = env_class(row.task)(**made)
    observations = [env.reset()]
    for _ in range(STEPS):
        seen, _, _, info = env.step(np.full(7, 0.3))
        observations.append(seen)
    state, meta = env.sim.get_state().flatten(), env.get_ep_meta()
    return env, observations, state, info, meta


def ours(row, perturb, cameras=(), repeat=1):
    names = [*STREAMS.values(), *(CAMERAS[each] for each in cameras)]
    settings = {"width": SIZE, "height": SIZE, "look": "plain", "action_repeat": repeat}
    env = PoolEnv(row.task, REFERENCE, names, perturb=perturb, perturb_seed=2, **settings)
    observations = [env.reset(options={"scenario": row.id})[0]]
    observations += [env.step(np.full(7, 0.3))[0] for _ in range(STEPS)]
    env.close()
    return env, observations


@pytest.mark.parametrize("repeat", [1, 4])
@pytest.mark.parametrize("perturb", ["object_noise@3+proprioception_noise@3", "proprioception_bias@3"])
def test_readings_have_the_errors_of_the_gymnasium_environment(row, perturb, repeat):
    (_, clean, state, *_), (_, found, same, info, meta) = (theirs(row, each, (), repeat) for each in (None, perturb))
    (_, still), (env, moved) = (ours(row, each, (), repeat) for each in (None, perturb))
    assert (state == same).all(), "the physics is the same to the bit"
    for name, stream in STREAMS.items():
        for number in range(STEPS + 1):
            here, there = found[number][name] - clean[number][name], moved[number][stream] - still[number][stream]
            np.testing.assert_allclose(here, there, atol=5e-5)  # quaternions of other moments are normalized
            assert bool(np.abs(here).max() > 1e-4) == (stream != "object-state" or "object" in perturb)
    last = found[-1]
    at = env.metadata["names"]["object-state"].index("slab_pos.x")
    np.testing.assert_array_equal(last["slab_pos"], last["object-state"][at : at + 3])
    np.testing.assert_allclose(last["robot0_joint_pos_cos"], np.cos(last["robot0_joint_pos"]), atol=1e-12)
    np.testing.assert_allclose(last["robot0_joint_pos_sin"], np.sin(last["robot0_joint_pos"]), atol=1e-12)
    for name in ("robot0_joint_acc", "robot0_gripper_qvel", "robot0_eef_quat"):
        assert (last[name] != clean[-1][name]).any(), f"{name} tells nothing that is clean"
    assert info["perturb"] == env.drawn.plain() and (meta["perturb"], meta["perturb_seed"]) == (perturb, 2)


@drawing
@pytest.mark.parametrize(
    "perturb", ["light_colour@5", "camera_angle@5+noise@5", "distractors@5", "late@2", "dropped@5+patch@1"]
)
def test_pictures_are_those_of_the_gymnasium_environment(row, perturb):
    """But for the edges of shadows, which differ by a grey level without a perturbation as well."""
    (_, clean, state, *_), (env, found, same, *_) = (theirs(row, each, CAMERAS) for each in (None, perturb))
    (_, still), (twin, moved) = (ours(row, each, CAMERAS) for each in (None, perturb))
    assert (state == same).all(), "the physics is the same to the bit"
    for number in (0, STEPS):
        for camera, name in CAMERAS.items():
            before, after = (each[number][f"{camera}_image"][::-1].astype(float) for each in (clean, found))
            here, there = (each[number][name].astype(float) for each in (still, moved))
            apart = [np.abs(one - other).mean() for one, other in ((before, here), (after, there))]
            assert apart[1] < apart[0] + 0.2 < 2
            assert np.abs(after - before).mean() == pytest.approx(np.abs(there - here).mean(), abs=1.0)
    mine, its = arrays(twin.world.model), arrays(env.sim.model._model)
    for part in ("light_pos", "light_dir", "light_diffuse", "vis_headlight_ambient"):
        np.testing.assert_array_equal(mine[part], its[part])
    for camera in CAMERAS:
        number, other = (model.camera(camera).id for model in (twin.world.model, env.sim.model._model))
        np.testing.assert_array_equal(mine["cam_quat"][number], its["cam_quat"][other])
    if "distractors" in perturb:
        for number in range(8):
            here, there = (model.geom(f"{SPARE}{number}") for model in (twin.world.model, env.sim.model._model))
            assert here.rgba[3] == 1.0 and all((getattr(here, a) == getattr(there, a)).all() for a in ("pos", "size"))
        assert SPARE not in env.model_text(row), "what is recorded is the stored scene"


@drawing
def test_a_reset_perturbs_the_same_again_and_not_twice(row):
    env, seen, *_ = theirs(row, "light_intensity@4+late@5", ["agentview"], hard_reset=False)
    assert (env.reset()["agentview_image"] == seen[0]["agentview_image"]).all()
    hard, again, *_ = theirs(row, "light_intensity@4+late@5", ["agentview"], hard_reset=True)
    assert (hard.reset()["agentview_image"] == again[0]["agentview_image"]).all()


def test_the_instruction_is_perturbed(row):
    *_, meta = theirs(row, "foreign@1")
    assert meta["lang"].startswith("Kipp den ersten")
    *_, info, meta = theirs(row, None)
    assert meta["lang"] == row.instruction and "perturb" not in meta and "perturb" not in info


@pytest.mark.parametrize(
    ("perturb", "settings", "error", "says"),
    [
        ("noise@1", {}, BadConfig, "affects all cameras, and none is observed"),
        ("object_noise@1", {"use_object_obs": False}, BadConfig, "affects streams of object-state"),
        ("wrench_noise@1", {}, BadConfig, "affects streams of wrench"),
        ("stiffness@1", {}, BadConfig, "robosuite's own controller would ignore it"),
        ("nois@1", {}, UnknownName, "did you mean 'noise'"),
        ("table_texture@1", {}, BadConfig, f"shows in look=room, not in {PLAIN.name}"),
    ],
)
def test_what_does_nothing_is_refused(row, perturb, settings, error, says):
    with pytest.raises(error, match=says):
        theirs(row, perturb, **settings)
