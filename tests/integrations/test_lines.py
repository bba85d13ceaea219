"""Other programs write the lines of `scengen evaluate`, which verify. The packages are needed, as `make integrations`
installs them; for LeRobot see integrations/lerobot_env_scengen/check.py."""

from pathlib import Path
from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from helpers import REFERENCE

from scengen import cli
from scengen.envs.gym import PoolEnv
from scengen.evaluate.lines import read_lines
from scengen.evaluate.recorder import Player, RecordedEpisodes, Recorder
from scengen.tasks.domino_single import DominoSingle

ROOT = Path(__file__).parents[2] / "integrations"
POOL = str(REFERENCE)


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(DominoSingle, "failure", lambda self, world: "too late" if world.time > 0.2 else None)


def checked(folder, harness, count):
    lines = read_lines(folder / "episodes.jsonl")
    assert len(lines) == count and {line["policy"] for line in lines} == {"mine"}
    assert all(not line["crashed"] and line["reason"] == "too late" for line in lines)
    assert cli.run(["verify", f"results={folder}", "level=full"]) == 0
    assert harness in (folder / "run.json").read_text()
    return lines


def test_inspect_robots(monkeypatch, tmp_path):
    pytest.importorskip("inspect_robots")
    monkeypatch.syspath_prepend(str(ROOT / "inspect_robots_scengen"))
    from inspect_robots.types import Action
    from inspect_robots_scengen import ScengenEmbodiment, scengen_task

    body = ScengenEmbodiment(POOL, cameras=False, lines=str(tmp_path / "out"), policy="mine")
    for scene in scengen_task(POOL).scenes[:2]:
        body.reset(scene)
        while not body.step(Action(np.zeros(7))).termination_reason:
            pass
    body.close()
    assert all(line["instruction_read"] for line in checked(tmp_path / "out", "inspect-robots", 2))
    body.recorder.close()


def test_vla_eval(monkeypatch, tmp_path):
    pytest.importorskip("vla_eval")
    monkeypatch.syspath_prepend(str(ROOT / "vla_eval_scengen"))
    from vla_eval_scengen import ScengenBenchmark

    benchmark = ScengenBenchmark("domino_single", POOL, lines=str(tmp_path / "out"), policy="mine")
    benchmark._recorder = SimpleNamespace(record_step=lambda **told: None)
    (task,) = benchmark.get_tasks()
    for number in range(2):
        raw, done = benchmark.reset({**task, "episode_idx": number}), False
        benchmark.make_obs(raw, task)
        while not done:
            done = benchmark.step({"actions": np.zeros(7)}).done
    benchmark.cleanup()
    checked(tmp_path / "out", "vla-eval", 2)
    benchmark.recorder.close()


def test_a_vector_of_environments_that_resets_by_itself_as_lerobot_makes_it(tmp_path):
    """LeRobot's rollout seeds every slot, steps until all are done, and ignores episodes that start on the way."""
    made = []

    def make() -> gymnasium.Env:
        own = PoolEnv("domino_single", POOL, action_repeat=4, settle=True)
        made.append(Recorder(tmp_path / "out", Player("lerobot-eval", "mine"), own) if not made else made[0])
        return RecordedEpisodes(own, made[0])

    envs = SyncVectorEnv([make, make], autoreset_mode=AutoresetMode.SAME_STEP)
    envs.reset(seed=[3, 4])
    done = np.zeros(2, bool)
    while not done.all():
        _, _, terminated, truncated, _ = envs.step(np.zeros((2, 7), np.float32))
        done |= terminated | truncated
    for _ in range(3):
        envs.step(np.zeros((2, 7), np.float32))
    envs.close()
    made[0].close()
    checked(tmp_path / "out", "lerobot-eval", 2)
