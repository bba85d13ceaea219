"""Scenarios of scengen as an environment of LeRobot: `lerobot-eval --env.type=scengen --env.task=... --env.pool=...`.

Each split of the pools is a suite, so that one call of lerobot-eval reports success in and out of distribution.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import gymnasium
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig
from lerobot.utils.constants import ACTION, OBS_ENV_STATE, OBS_IMAGES, OBS_STATE

from scengen.envs.gym import PoolEnv, action_repeat_at
from scengen.envs.lerobot import AGENT, ENVIRONMENT, PIXELS, ROLLOUT, LeRobotNames
from scengen.envs.object_state import NAME
from scengen.envs.observations import ALL, cameras_of, proprioception
from scengen.envs.pools import rows_of
from scengen.errors import BadConfig
from scengen.evaluate.recorder import Player, RecordedEpisodes, Recorder
from scengen.perturb.perturbation import Perturbation


class EachOnce(gymnasium.Wrapper):
    """An environment that refuses to begin a scenario a second time under another seed.

    A seed stands for a scenario of the pool and wraps around at its end. LeRobot counts seeds up, from 1000 by default.
    With more episodes than scenarios it would take repetitions for independent trials.
    """

    def __init__(self, env: gymnasium.Env, slot: int):
        """
        Args:
            slot: number of the environment in its batch; its first seed is that of the run plus this number.
        """
        super().__init__(env)
        self._slot, self._start = slot, None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """See `PoolEnv.reset`.

        Raises:
            BadConfig: the pool has fewer scenarios than the run has started episodes.
        """
        if seed is not None and (options or {}).get(ROLLOUT):
            self._start = seed - self._slot if self._start is None else self._start
            count = len(self.unwrapped.scenarios)
            if seed - self._start >= count:
                whole = "give --eval.n_episodes of at most that, and --eval.batch_size that divides it"
                raise BadConfig(f"seed {seed} would repeat a scenario: this split has {count}; {whole}")
        return self.env.reset(seed=seed, options=options)


@EnvConfig.register_subclass("scengen")
@dataclass
class ScengenEnv(EnvConfig):
    """Settings of the environment, each with `--env.` before its name."""

    task: str | None = "domino_single"
    """Name of the task."""
    pool: str = ""
    """Folder of a pool, or several folders separated by commas."""
    split: str = ""
    """Splits to play, separated by commas; default: all splits of the pools."""
    cameras: str = ""
    """Cameras of the observation, separated by commas, such as `rgb_exo_right_cam`."""
    environment_state: bool = False
    """Whether `object-state`, which is privileged, is part of the observation."""
    fps: int = 25
    """Rate of the policy [Hz], which divides 100 Hz: that of its data."""
    width: int = 256
    """Width of pictures [pixels]."""
    height: int = 256
    """Height of pictures [pixels]."""
    settle: bool = True
    """Whether a reached goal must still hold after a second with the robot idle, as in `scengen evaluate`."""
    rules: str = "strict"
    """Rules of episodes: `strict`, or `paper`."""
    perturb: str = ""
    """Kinds of perturbation at their levels, such as `light_direction@3+noise@1`. The names of suites hold them."""
    perturb_seed: int = 0
    """Another number draws other perturbations for the same scenarios."""
    lines: str = ""
    """Folder for lines as those of `scengen evaluate`, which `scengen verify results=` rebuilds; default: none."""
    policy_name: str = "policy"
    """Name of the policy in the lines."""

    _recorder: ClassVar[Recorder | None] = None

    def __post_init__(self) -> None:
        """Describe the observations, which depend on the pools.

        Raises:
            BadConfig: a perturbation affects nothing that the policy observes.
        """
        if self.pool:
            space = self._environment(self._splits()[0], 0).observation_space
            names, known = self.gym_kwargs["observations"], cameras_of(ALL)
            seen = [known[name] for name in names if name in known]
            Perturbation.parse(self.perturb).check([name for name in names if name not in known], seen)
            self.features = {ACTION: PolicyFeature(FeatureType.ACTION, self._action_shape())}
            self.features_map = {ACTION: ACTION}
            vectors = {AGENT: (FeatureType.STATE, OBS_STATE), ENVIRONMENT: (FeatureType.ENV, OBS_ENV_STATE)}
            for name in vectors.keys() & space.spaces.keys():
                kind, self.features_map[name] = vectors[name]
                self.features[name] = PolicyFeature(kind, space[name].shape)
            for camera in self._listed(self.cameras):
                self.features[f"{PIXELS}/{camera}"] = PolicyFeature(FeatureType.VISUAL, space[PIXELS][camera].shape)
                self.features_map[f"{PIXELS}/{camera}"] = f"{OBS_IMAGES}.{camera}"

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """Arguments of `PoolEnv` other than task and split.

        Raises:
            BadConfig: the rate does not divide 100 Hz.
        """
        embodiment = rows_of(self._listed(self.pool), str(self.task))[0].embodiment
        state = [NAME] if self.environment_state else []
        return {
            "pool": self._listed(self.pool),
            "observations": [*proprioception(embodiment), *state, *self._listed(self.cameras)],
            "action_repeat": action_repeat_at(self.fps, "--env.fps"),
            "width": self.width,
            "height": self.height,
            "settle": self.settle,
            "rules": self.rules,
            "perturb": self.perturb,
            "perturb_seed": self.perturb_seed,
            "render_mode": "rgb_array",
        }

    def create_envs(self, n_envs: int, use_async_envs: bool = False) -> dict[str, dict[int, VectorEnv]]:
        """Batches of environments by split and perturbation, each under the number 0.

        Raises:
            ScengenError: a setting or a pool is not valid.
        """
        if not self.pool:
            raise BadConfig("no pool was given; give --env.pool=FOLDER, which scengen generate makes")
        if self.lines and use_async_envs and n_envs > 1:
            raise BadConfig("one process writes lines; give --eval.use_async_envs=false, or leave --env.lines out")
        if self.lines:
            first = PoolEnv(str(self.task), **self.gym_kwargs)
            self._recorder = Recorder(self.lines, Player("lerobot-eval", self.policy_name), first)
        found: dict[str, dict[int, VectorEnv]] = {}
        for split in self._splits():
            makers = [lambda split=split, slot=slot: self._environment(split, slot) for slot in range(n_envs)]
            if use_async_envs and n_envs > 1:
                envs: VectorEnv = AsyncVectorEnv(makers, context="forkserver", autoreset_mode=AutoresetMode.SAME_STEP)
            else:
                envs = SyncVectorEnv(makers, autoreset_mode=AutoresetMode.SAME_STEP)
            perturbation = Perturbation.parse(self.perturb)
            found[f"{split}_{perturbation}" if perturbation else split] = {0: envs}
        return found

    def _environment(self, split: str, slot: int) -> gymnasium.Env:
        env: gymnasium.Env = PoolEnv(str(self.task), split=split, **self.gym_kwargs)
        if self._recorder:
            env = RecordedEpisodes(env, self._recorder)
        return EachOnce(LeRobotNames(env), slot)

    def _splits(self) -> list[str]:
        return self._listed(self.split) or sorted(rows_of(self._listed(self.pool), str(self.task)).kinds("split"))

    def _action_shape(self) -> tuple[int, ...]:
        return PoolEnv(str(self.task), **self.gym_kwargs).action_space.shape or ()

    @staticmethod
    def _listed(text: str) -> list[str]:
        return [each for each in text.split(",") if each]
