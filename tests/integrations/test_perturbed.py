"""inspect-robots and vla-eval get what the Gymnasium environment gives under the same perturbation. Both packages are
needed, as `make integrations` installs them."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import REFERENCE, pictures_are_possible

from scengen.envs.gym import PoolEnv
from scengen.errors import BadConfig

ROOT = Path(__file__).parents[2] / "integrations"
PERTURB = {"perturb": "light_colour@4+proprioception_noise@3+verbose@2", "perturb_seed": 5}
POOL = str(REFERENCE)
CAMERA = "rgb_exo_right_cam"

pytestmark = pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL")


def begun(names, repeat, scenario):
    env = PoolEnv("domino_single", POOL, names, width=64, height=64, action_repeat=repeat, **PERTURB)
    return env, env.reset(options={"scenario": scenario})[0]


def test_inspect_robots(monkeypatch):
    pytest.importorskip("inspect_robots")
    monkeypatch.syspath_prepend(str(ROOT / "inspect_robots_scengen"))
    from inspect_robots.types import Action
    from inspect_robots_scengen import ScengenEmbodiment, scengen_task

    body, task = ScengenEmbodiment(POOL, width=64, **PERTURB), scengen_task(POOL, **PERTURB)
    assert task.name == f"scengen/domino_single/id/{PERTURB['perturb']}"
    scene = task.scenes[1]
    found = body.reset(scene)
    env, expected = begun([*body.env.cameras, *body.env.streams], 10, scene.id)
    for _ in range(2):
        assert all((found.images[name] == expected[name]).all() for name in body.env.cameras)
        assert all((found.state[name] == expected[name]).all() for name in body.env.streams)
        result = body.step(Action(np.zeros(7)))
        found, expected = result.observation, env.step(np.zeros(7))[0]
    assert found.instruction == env.task_description == scene.instruction != env.row.instruction
    assert result.info["perturb"] == env.drawn.plain()
    body.close()
    env.close()
    with pytest.raises(BadConfig, match="affects all cameras"):
        ScengenEmbodiment(POOL, cameras=False, perturb="noise@1")


def test_vla_eval(monkeypatch):
    pytest.importorskip("vla_eval")
    monkeypatch.syspath_prepend(str(ROOT / "vla_eval_scengen"))
    from vla_eval_scengen import ScengenBenchmark

    benchmark = ScengenBenchmark("domino_single", POOL, cameras=[CAMERA], width=64, **PERTURB)
    (task,) = benchmark.get_tasks()
    seen = benchmark.make_obs(benchmark.reset({**task, "episode_idx": 1}), task)
    env, expected = begun([*benchmark.state, CAMERA], 4, benchmark._running.row.id)
    assert (seen["images"][CAMERA] == expected[CAMERA]).all()
    assert (seen["state"] == np.concatenate([expected[name] for name in benchmark.state])).all()
    assert seen["task_description"] == env.task_description != env.row.instruction
    benchmark._recorder = SimpleNamespace(record_step=lambda **step: None)
    result = benchmark.get_step_result(benchmark.step({"actions": np.zeros(7)}))
    assert result["perturb"] == env.drawn.plain()
    assert benchmark.get_metadata()["perturb"] == PERTURB["perturb"]
    benchmark.cleanup()
    env.close()
    with pytest.raises(BadConfig, match="affects all cameras"):
        ScengenBenchmark("domino_single", POOL, perturb="noise@1")
