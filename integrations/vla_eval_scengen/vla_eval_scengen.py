"""Scenarios of scengen as a benchmark of vla-eval: `benchmark: vla_eval_scengen:ScengenBenchmark` in its configuration.

Each split of the pools is a task of vla-eval, and each of its scenarios an episode.
"""

from typing import Any

import numpy as np
from vla_eval.benchmarks.base import StepBenchmark, StepResult
from vla_eval.render import configure_mujoco_render
from vla_eval.specs import GRIPPER_CLOSE_POS, IMAGE_RGB, LANGUAGE, POSITION_DELTA, RAW, DimSpec
from vla_eval.types import Action, EpisodeResult, Observation, Task

from scengen.control.loop import Loop
from scengen.envs.gym import PoolEnv, action_repeat_at
from scengen.envs.observations import proprioception
from scengen.envs.pools import rows_of
from scengen.errors import BadConfig
from scengen.evaluate.recorder import Player, Recorder
from scengen.sim.embodiment import action_size


class ScengenBenchmark(StepBenchmark):
    """Certified scenarios, each played once.

    A reached goal must still hold after a second with the robot idle, as in `scengen evaluate`. An episode that would
    repeat a scenario is refused, so `episodes_per_task` is at most the number of scenarios of a split.
    """

    render_backends = frozenset({"gpu", "cpu"})

    @classmethod
    def configure_render(cls, mode: str) -> dict[str, str]:
        """Environment variables for the renderer."""
        return configure_mujoco_render(mode)

    def __init__(
        self,
        task: str,
        pool: list[str] | str,
        splits: list[str] | None = None,
        cameras: list[str] | None = None,
        hz: int = 25,
        width: int = 256,
        settle: bool = True,
        rules: str = "strict",
        perturb: str | None = None,
        perturb_seed: int = 0,
        lines: str | None = None,
        policy: str = "policy",
    ):
        """
        Args:
            task: name of the task.
            pool: folders of pools.
            splits: splits to play; default: all splits of the pools.
            cameras: cameras of the observation, such as `rgb_exo_right_cam`; default: none.
            hz: rate of the policy [Hz], which divides 100 Hz.
            width: width and height of pictures [pixels].
            settle: whether a reached goal must still hold after a second with the robot idle.
            rules: `strict` or `paper`.
            perturb: kinds of perturbation at their levels, such as `light_direction@3+noise@1`. Results name them.
            perturb_seed: another number draws other perturbations for the same scenarios.
            lines: folder for lines as those of `scengen evaluate`, which `scengen verify results=` rebuilds.
            policy: name of the policy in the lines.

        Raises:
            ScengenError: a setting or a pool is not valid.
        """
        super().__init__()
        self.task_name, self.cameras = task, list(cameras or [])
        self.pool = [pool] if isinstance(pool, str) else list(pool)
        rows = rows_of(self.pool, task)
        self.splits, self.embodiment = splits or sorted(rows.kinds("split")), rows[0].embodiment
        self.horizon = max(limit for split in self.splits for (limit,) in rows.of_split(split).columns("horizon"))
        self.state = proprioception(self.embodiment)
        self._envs: dict[str, PoolEnv] = {}
        self.settings = {
            "observations": [*self.state, *self.cameras],
            "action_repeat": action_repeat_at(hz, "hz"),
            "width": width,
            "height": width,
            "settle": settle,
            "rules": rules,
            "perturb": perturb,
            "perturb_seed": perturb_seed,
        }
        first = self._env(self.splits[0])  # what is not valid is refused here
        self.recorder = Recorder(lines, Player("vla-eval", policy), first) if lines else None

    def get_tasks(self) -> list[Task]:
        """A task for every split. vla-eval passes it to the model server, which must not read the name."""
        return [{"name": f"{self.task_name}/{split}", "suite": split} for split in self.splits]

    def reset(self, task: Task) -> Any:
        """Start the scenario whose number in the split is that of the episode."""
        env, number = self._env(task["suite"]), task["episode_idx"]
        if number >= len(env.scenarios):
            raise BadConfig(
                f"episode {number} would repeat a scenario: {task['name']} has {len(env.scenarios)}; "
                "give episodes_per_task of at most that"
            )
        self._running = env
        observation, _ = env.reset(options={"scenario": env.scenarios[number]})
        if self.recorder:
            self.recorder.begin(env, observation)
        return observation

    def step(self, action: Action) -> StepResult:
        """Play one action for one period of the policy."""
        given = action.get("actions", action.get("action"))
        observation, reward, terminated, truncated, info = self._running.step(given)
        if self.recorder and (terminated or truncated):
            self.recorder.end(self._running, info)
        self._recorder.record_step(reward=reward, done=terminated or truncated, success=bool(info["success"]))
        return StepResult(observation, reward, terminated or truncated, info)

    def make_obs(self, raw_obs: Any, task: Task) -> Observation:
        """Pictures, the robot's own pose as one vector, and the instruction."""
        return {
            "images": {camera: raw_obs[camera] for camera in self.cameras},
            "state": np.concatenate([np.ravel(raw_obs[name]) for name in self.state]).astype(np.float32),
            "task_description": self._running.task_description,
        }

    def get_step_result(self, step_result: StepResult) -> EpisodeResult:
        """Success, and the reason of a failure."""
        info = step_result.info
        labels = {"scenario": self._running.row.id, "perturb": self._running.drawn.plain()}
        return {"success": bool(info["success"]), "reason": info["reason"], **labels}

    def get_metadata(self) -> dict[str, Any]:
        """Number of steps until the longest time limit, and settings."""
        seconds = Loop.PERIOD * self.settings["action_repeat"]
        chosen = {name: self.settings[name] for name in ("settle", "perturb", "perturb_seed")}
        return {"max_steps": round(self.horizon / seconds) + 1, **chosen}

    def get_hold_action(self, last_action: Action | None) -> Action:
        """No displacement, and the last gripper command."""
        held = np.zeros(action_size(self.embodiment), np.float32)
        if last_action is not None:
            held[6::7] = np.asarray(last_action["actions"], np.float32).reshape(-1, held.size)[-1][6::7]
        return {"actions": held}

    def get_action_spec(self) -> dict[str, DimSpec]:
        """Seven numbers of an arm: displacement, rotation vector (1 is 0.5 rad), gripper (above 0 closes)."""
        if action_size(self.embodiment) != 7:
            return {"raw": RAW}
        turn = DimSpec("rotation", 3, "axis_angle", (-1, 1), description="1 is 0.5 rad")
        return {"position": POSITION_DELTA, "rotation": turn, "gripper": GRIPPER_CLOSE_POS}

    def get_observation_spec(self) -> dict[str, DimSpec]:
        """Pictures, state, instruction."""
        entries = sum(len(self._env(self.splits[0]).metadata["names"][name]) for name in self.state)
        state = DimSpec("state", entries, "+".join(self.state))
        return {**dict.fromkeys(self.cameras, IMAGE_RGB), "state": state, "language": LANGUAGE}

    def cleanup(self) -> None:
        """Free the renderers, and write the tables of the lines."""
        for env in self._envs.values():
            env.close()
        if self.recorder:
            self.recorder.finish()

    def _env(self, split: str) -> PoolEnv:
        if split not in self._envs:
            self._envs[split] = PoolEnv(self.task_name, self.pool, split=split, **self.settings)
        return self._envs[split]
