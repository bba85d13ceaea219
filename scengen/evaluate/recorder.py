"""Lines of episodes that another program plays, such as LeRobot's evaluation or a model that acts.

The files are those of `scengen evaluate`, and `scengen verify results=` rebuilds them. Which episodes were played is
the choice of that program, and is reported as a claim.
"""

import atexit
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, SupportsFloat

import gymnasium
import numpy as np
from numpy.typing import NDArray

from ..envs.gym import Observation, PoolEnv
from ..errors import BadConfig, cut
from ..perturb.perturbation import Perturbation
from ..pool import Pool, kinds
from ..pool.files import sha256
from ..work.log import Log
from ..work.targets import try_folder, write
from .arms import CLEAN
from .arms import NONE as NO_ARMS
from .comparison import Comparison, PolicyResult
from .lines import RUN
from .player import Rollout
from .rollouts import Evaluation, LineLog, crashed_record, identity
from .scenarios import known
from .settings import EvaluateSettings, RolloutId

MAX_NAME = 200
"""Length of the longest name of a program or a policy [characters]."""
MAX_REASON = 1000
"""Length of the longest reason in a line [characters]."""
LEFT = "the episode was left before its end"
"""Entry `crashed` of a line about an episode that was not played to its end: it is in no rate."""


@dataclass(frozen=True)
class Player:
    """Program and policy that play the episodes."""

    harness: str
    """Name of the program, such as `lerobot-eval`."""
    policy: str
    """Name of the policy."""
    version: str | None = None
    """Version of the policy; episodes of another version are refused."""

    def check(self) -> None:
        """Raise `BadConfig` if a name is not a short text of one line."""
        for name, given in vars(self).items():
            good = isinstance(given, str) and 0 < len(given) <= MAX_NAME and given.isprintable()
            if not good and (name, given) != ("version", None):
                raise BadConfig(f"{name} = {cut(repr(given))}; give one line of 1 to {MAX_NAME} characters")


class Recorder:
    """Writes the lines of the episodes of one or more environments with the same settings, one process at a time."""

    def __init__(
        self, to: str | Path, player: Player, env: PoolEnv, search: Sequence[str] = (), replaces: bool = False
    ):
        """Open the folder, or continue it.

        Args:
            to: folder of the results.
            player: who plays.
            env: an environment in which episodes are played.
            search: folders of other packages, see `task_files.search_path`.
            replaces: whether lines of an earlier run are replaced, by a program that plays all of them again.

        Raises:
            ScengenError: the folder is something else, or holds episodes of other settings.
        """
        player.check()
        self.settings = settings_of(Path(to), player, env)
        self.settings.check()
        kinds.check_target(self.settings.folder, kinds.EPISODES)
        try_folder(self.settings.folder)
        pools = [Pool.open(folder).check() for folder in self.settings.folders]
        about = {key: told for pool in pools for key, told in known(pool, search).items()}
        self._folder_of = {id_: folder for folder, id_ in about}
        observed = [*env.streams, *env.cameras]
        task_versions = {told["task"]: told["task_version"] for told in about.values()}
        code = sha256(f"{player.harness} {player.policy} {player.version}")
        depends = {**identity(self.settings, pools), "task_versions": task_versions}
        depends |= {"code": dict.fromkeys(task_versions, code), "observed": dict.fromkeys(task_versions, observed)}
        folder = self.settings.folder
        self._log = Log(folder / kinds.EPISODES, depends, head=folder / RUN, replaces=replaces)
        self._log.__enter__()
        self._lines = LineLog(self.settings, about, self._log)
        self._open: dict[int, Rollout] = {}
        self._counts = Counter((line["scenario"], line["perturbation"]) for line in self._log.records)
        self._is_closed = False
        atexit.register(self.close)

    def begin(self, env: PoolEnv, seen: Observation) -> None:
        """Note the start of an episode; one that is still open in this environment was left.

        Args:
            env: the environment, after its reset.
            seen: the first observation.

        Raises:
            BadConfig: the recorder is closed.
        """
        if self._is_closed:
            raise BadConfig(f"the recorder of {self.settings.folder} is closed; make another one")
        self._leave(env)
        perturbation, scenario = str(env.perturbation), env.row.id
        number = self._counts[scenario, perturbation]
        self._counts[scenario, perturbation] += 1
        which = RolloutId(env.row.task, perturbation, CLEAN, self._folder_of[scenario], scenario, number)
        self._open[id(env)] = Rollout(which, env)
        self._open[id(env)].begin(seen)

    def end(self, env: PoolEnv, info: Mapping[str, Any]) -> None:
        """Store the line of the episode that is open in an environment; nothing if none is.

        Args:
            info: the last `info` of the environment, with `success`, `reason` and `lacks`.

        Raises:
            BadConfig: `info` is another one.
        """
        if missing := {"success", "reason"} - info.keys():
            raise BadConfig(f"info has no {min(missing)}; give the last one that the environment has returned")
        rollout = self._open.pop(id(env), None)
        if rollout is None:
            return
        success, reason = bool(info["success"]), cut(str(info["reason"]), MAX_REASON)
        rollout.end(success, "" if success else reason, lacks=str(info.get("lacks", "")))
        self._lines.add(rollout.record)

    def discard(self) -> None:
        """Forget episodes that are open: a later run plays them."""
        self._open.clear()

    def finish(self) -> Path:
        """Sort the lines and write the tables, if there are lines. Returns the folder."""
        if self._is_closed or not self._log.records:
            return self.settings.folder
        self._lines.sort()
        found = Evaluation(list(self._log.records), 0, {}, (), {}, self._lines.chain)
        for path, text in Comparison([PolicyResult(self.settings, found)]).files(self.settings.folder).items():
            write(path, text)
        return self.settings.folder

    def close(self) -> None:
        """Store what was left, write the tables, and free the folder."""
        if not self._is_closed:
            for rollout in [*self._open.values()]:
                self._leave(rollout.env)
            self.finish()
            self._log.__exit__(None, None, None)
            self._is_closed = True
            atexit.unregister(self.close)

    def _leave(self, env: PoolEnv) -> None:
        """Store the line of an episode that was left."""
        if rollout := self._open.pop(id(env), None):
            record = crashed_record(rollout.which, LEFT)
            self._lines.add({**record, **rollout.start})


class RecordedEpisodes(gymnasium.Wrapper[Observation, NDArray[np.float32], Observation, NDArray[np.float32]]):
    """An environment whose episodes a recorder writes. Episodes that an automatic reset starts, without a seed and
    without the name of a scenario, are not counted."""

    def __init__(self, env: PoolEnv, recorder: Recorder):
        super().__init__(env)
        self._pool_env, self._recorder = env, recorder

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """See `PoolEnv.reset`."""
        seen, info = self.env.reset(seed=seed, options=options)
        if seed is not None or "scenario" in (options or {}):
            self._recorder.begin(self._pool_env, seen)
        return seen, info

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, SupportsFloat, bool, bool, dict[str, Any]]:
        """See `PoolEnv.step`."""
        seen, reward, terminated, truncated, info = self.env.step(action)
        if terminated or truncated:
            self._recorder.end(self._pool_env, info)
        return seen, reward, terminated, truncated, info

    def close(self) -> None:
        """Write the tables. The folder is free when the program ends, or the recorder is closed."""
        super().close()
        self._recorder.finish()


def settings_of(to: Path, player: Player, env: PoolEnv) -> EvaluateSettings:
    """The settings of an evaluation that plays the same episodes.

    Raises:
        BadConfig: the environment plays the scenarios of another one, whose pools are not known.
    """
    given = env.arguments
    if not isinstance(given["pool"], (Path, list)):
        raise BadConfig("the environment names no pool; pass pool=FOLDER, which lines refer to")
    folders = given["pool"] if isinstance(given["pool"], list) else [given["pool"]]
    names = ("width", "height", "action_filter", "action_repeat", "rules", "settle", "perturb_seed")
    chosen = {name: given[name] for name in names}
    perturbation = Perturbation.parse(given["perturb"])
    return EvaluateSettings(
        policy=player.policy,
        pool=[_from_here(Path(folder)) for folder in folders],
        observations=[*env.streams, *env.cameras],
        rollouts=1,
        to=str(to),
        version=player.version,
        perturb=[str(perturbation)] if perturbation else None,
        look=env.look.name,
        arms=NO_ARMS,
        harness=player.harness,
        **chosen,
    )


def _from_here(folder: Path) -> str:
    """A folder as people name it: from the working directory if it lies below."""
    return str(folder.relative_to(Path.cwd()) if folder.is_relative_to(Path.cwd()) else folder)
