"""Rollouts of a policy, one after the other."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..compose import load_task
from ..envs.gym import PoolEnv
from ..episode import check_rules
from ..errors import ForeignCode, ScengenError
from ..pool import Pool
from ..pool.library import Library
from ..samplers.keyed import unit
from ..samplers.split import ID
from ..sim.world import ROBOT, World
from .policies import REPLAY, Policy, find_policy, identity, make_policy, policy_errors
from .settings import EvaluateSettings, RolloutId


class BadPolicy(ScengenError):
    """A policy returned an invalid action."""


PHASES = ("before contact", "in contact", "after contact")
"""Phases of an episode: no arm has touched a movable body yet, one touches such a body, or one has touched it."""


def phase(world: World) -> str:
    """The phase in which a world is, one of `PHASES`."""
    model = world.model
    movable = [
        model.body(body).name for body in range(1, model.nbody) if model.body_weldid[body] and body not in world.own
    ]
    if any(world.touching(ROBOT, name) for name in movable):
        return "in contact"
    return "after contact" if any(world.touched(ROBOT, name) for name in movable) else "before contact"


class PolicyPlayer:
    """Plays rollouts. It keeps one environment and one policy as long as the task stays the same."""

    def __init__(self, settings: EvaluateSettings, search: Sequence[str] = (), strict: bool = True):
        """
        Args:
            strict: whether a policy that crashes in the very first episode ends the evaluation.
        """
        self.settings, self.search, self.strict = settings, search, strict
        self._running: tuple[PoolEnv, Policy] | None = None

    def __call__(self, which: RolloutId) -> dict[str, Any]:
        """Play one rollout, from reset to its end, or until the policy crashes.

        Returns:
            The record, with the actions that the controller received as `played` if episodes are kept.

        Raises:
            BadPolicy: the policy returned an invalid action.
            ForeignCode: the policy crashed in the first episode.
        """
        crashed = ""
        try:
            success, reason = self._played(which)
        except ForeignCode as error:
            if self.strict:
                raise
            success, reason, crashed = False, "", str(error)
        self.strict = False
        env, _ = self._prepared_for(which.task)
        told = {"success": success, "reason": reason, "seconds": round(env.world.time, 3), "phase": phase(env.world)}
        key = {"pool": which.pool, "scenario": which.scenario, "rollout": which.rollout}
        kept = {"played": env.played} if self.settings.keep and not crashed else {}
        return {**key, **told, **({"crashed": crashed} if crashed else {}), **kept}

    def _played(self, which: RolloutId) -> tuple[bool, str]:
        """Whether a rollout succeeds, and why not."""
        env, policy = self._prepared_for(which.task)
        observation, info = env.reset(options={"scenario": which.scenario})
        name, where = self.settings.name, f"on scenario {env.row.name}"
        with policy_errors(name, f"its reset {where}"):
            policy.reset(observation, info, int(2**31 * unit("rollout", which.scenario, which.rollout)))
        over = False
        while not over:
            with policy_errors(name, f"its act {where}"):
                action = np.asarray(policy.act(observation), float)
            try:
                observation, _, terminated, truncated, info = env.step(action)
            except (ValueError, TypeError) as error:
                raise BadPolicy(f"policy {name} {where}: {error}") from None
            over = terminated or truncated
        return bool(info["success"]), info["reason"]

    def identities(self, tasks: set[str]) -> dict[str, str]:
        """Hashes of the policy by task, see `policies.identity`."""
        return {task: self._identity(task) for task in sorted(tasks)}

    def _identity(self, task: str) -> str:
        _, policy = self._prepared_for(task)
        factory = find_policy(self.settings.name, client=self.settings.remote)
        return identity(self.settings.name, factory, policy)

    def _prepared_for(self, task: str) -> tuple[PoolEnv, Policy]:
        if self._running and self._running[0].task.name != task:
            self.close()
        if not self._running:
            settings, remote = self.settings, self.settings.remote
            folders = [f for f in settings.folders if task in Pool.open(f).kinds("task")[0]]
            env = PoolEnv(
                task,
                folders,
                remote.streams(load_task(task, self.search).embodiment) if remote else settings.observations,
                width=settings.width,
                height=settings.height,
                action_filter=settings.action_filter,
                action_repeat=remote.repeat if remote else settings.action_repeat,
                rules=check_rules(settings.rules),
                settle=settings.settle,
                search=self.search,
            )
            memory = _training(folders) if settings.name == REPLAY else None
            factory = find_policy(settings.name, memory, remote)
            self._running = env, make_policy(settings.name, factory, env)
        return self._running

    def close(self) -> None:
        """Close the environment, and the policy if it has a method `close`."""
        if self._running:
            env, policy = self._running
            env.close()
            if callable(close := getattr(policy, "close", None)):
                with policy_errors(self.settings.name, "its close"):
                    close()
            self._running = None


def _training(folders: Sequence[str]) -> Library | None:
    """The training scenarios of the pools; None if there are none."""
    every = Library([Pool.open(folder) for folder in folders])
    return every.of_split(ID) if ID in every.kinds("split") else None
