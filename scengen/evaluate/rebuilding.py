"""Episodes rebuilt from their lines: to the same first state and pictures, and to the end where actions were kept."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from ..compose import load_task
from ..envs.gym import PoolEnv
from ..episode import Actions, check_rules
from ..errors import ScengenError, contrasted
from ..pool.files import sha256
from ..samplers.task import Task
from ..validate.playable import stored_world
from ..validate.rebuilt import difference, rebuild
from ..validate.rollout import replay
from ..work.fingerprint import fingerprint
from .arms import CLEAN, instruction, seen_by
from .player import environments, first_look, phase
from .settings import EvaluateSettings


@dataclass(frozen=True)
class Rebuilt:
    """Result of rebuilding an episode."""

    number: int
    """Number of its line."""
    faults: tuple[str, ...] = ()
    """What is not as the line says."""
    pictures: bool = False
    """Whether its pictures were compared."""
    replayed: bool = False
    """Whether its kept actions were played."""
    lost: str = ""
    """Reason why it could not be rebuilt; empty if it was."""


Item = tuple[int, Mapping[str, Any], Actions | None]
"""Number of a line, the line, and the actions that were kept."""


@dataclass
class Rebuilder:
    """Rebuilds episodes. It keeps the environment as long as task and perturbation stay the same."""

    settings: EvaluateSettings
    """Settings of the run, with the folders in which the pools are here."""
    observed: Mapping[str, Sequence[str]]
    """Names of the streams and cameras that the policy observed, by task."""
    search: Sequence[str] = ()
    """Overrides that add folders of other packages."""
    _env: tuple[tuple[str, str], PoolEnv, Task] | None = field(default=None, init=False)

    def __call__(self, item: Item) -> Rebuilt:
        number, line, actions = item
        try:
            env, task = self._prepared_for(line["task"], line["perturbation"])
            faults = [*self._wrong_start(env, task, line)]
            compared = bool(line["pictures"]) and not _other_pictures(line, env)
            if actions is not None:
                faults += _wrong_end(env, task, line, actions, self.settings)
        except (ScengenError, ValueError, TypeError, KeyError, ArithmeticError) as error:
            why = " ".join(str(error).split())[:300] or type(error).__name__
            return Rebuilt(number, (f"cannot be rebuilt: {why}",))
        return Rebuilt(number, tuple(faults), compared, actions is not None)

    def _wrong_start(self, env: PoolEnv, task: Task, line: Mapping[str, Any]) -> Iterator[str]:
        """Differences of the first state and the first pictures."""
        row = env._rows[env._rows.find(line["scenario"])]
        env.instruct(instruction(line["arm"], row, self.search) if line["arm"] != CLEAN else None)
        seen, _ = env.reset(options={"scenario": line["scenario"]})
        scenario = task.scenario(row.params, row.split)
        if scenario.id != row.id:
            yield "names a scenario whose id does not belong to the parameters in the pool"
        here = fingerprint() == line["machine"]
        if what := difference(row.scene_xml, rebuild(scenario), here, row.embodiment):
            yield f"names a scenario of the pool for which {what}"
        found = first_look(env, seen_by(line["arm"], seen, env.cameras))
        for name in ("instruction", "perturb", "first_state"):
            if found[name] != line[name]:
                yield f"has another {name} than the rebuilt episode"
        if {*found["pictures"]} != {*line["pictures"]}:
            yield f"has pictures of {[*line['pictures']]}, the run of {[*env.cameras]}"
        elif found["pictures"] != line["pictures"] and not _other_pictures(line, env):
            yield "has other first pictures than the rebuilt episode"

    def _prepared_for(self, task: str, perturbation: str) -> tuple[PoolEnv, Task]:
        if self._env and self._env[0] != (task, perturbation):
            self._env[1].close()
            self._env = None
        if not self._env:
            settings = replace(self.settings, policy="idle", slots=1)
            envs = environments(settings, task, perturbation, self.observed[task], self.search, 1)
            self._env = (task, perturbation), envs.envs[0], load_task(task, self.search)
        return self._env[1:]


def _other_pictures(line: Mapping[str, Any], env: PoolEnv) -> str:
    """Reason why pictures cannot be compared; empty if they can."""
    if line["machine"] != fingerprint():
        return "they were taken on a machine with different rounding"
    return "" if line["renderer"] == env.renderer else f"they were taken with {line['renderer'][:60]}"


def _wrong_end(
    env: PoolEnv, task: Task, line: Mapping[str, Any], actions: Actions, settings: EvaluateSettings
) -> Iterator[str]:
    """Differences of the outcome when the kept actions are played."""
    if sha256(actions.tobytes()) != line["actions_sha256"] or len(actions) != line["actions"]:
        yield "has another hash or number of actions than the kept ones"
        return
    row, rules = env.row, check_rules(settings.rules)
    world = stored_world(row, None, env.perturbation.conditions(row.embodiment), settings.perturb_seed)
    again = replay(task.scenario(row.params), world, actions, row.horizon, row.certificate.settle or 0.0, rules=rules)
    found = {"success": again.solved, "reason": again.reason, "lacks": again.lacks}
    exact = {"seconds": round(world.time, 3), "phase": phase(world), "final_state": again.digest}
    here = line["machine"] == fingerprint()
    for name, value in {**found, **exact}.items() if here else {"success": again.solved}.items():
        if value != line[name]:
            told, found = contrasted(ascii(str(line[name])), ascii(str(value)))
            yield f"says {name} = {told}; its kept actions give {found}"


def lost(item: Item, reason: str) -> Rebuilt:
    """Result for an episode whose process died."""
    return Rebuilt(item[0], lost=reason)
