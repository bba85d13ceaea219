"""Rollouts of a policy: as many at once as there are slots, one batch after the other."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any, NamedTuple, TypeVar

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from ..compose import load_task
from ..envs.gym import INFOS, Observation, PoolEnv, checked
from ..envs.vector import PoolVectorEnv
from ..episode import check_rules
from ..errors import ForeignCode, ScengenError
from ..perturb.language import Words
from ..perturb.perturbation import NONE, Perturbation
from ..pool import Pool
from ..pool.files import sha256
from ..pool.library import Library
from ..samplers.keyed import unit
from ..samplers.split import ID
from ..sim.arm import ROBOT
from ..sim.world import World
from .arms import ARMS, CLEAN, PICTURES, instruction, seen_by
from .lines import picture_digest, state_digest
from .policies import REPLAY, Policy, find_policy, identity, make_policy, policy_errors
from .remote.policy import RemotePolicy
from .settings import EvaluateSettings, RolloutId

A = TypeVar("A")


class BadPolicy(ScengenError):
    """A policy returned an invalid action."""


class Spent(NamedTuple):
    """Time of rollouts with pictures."""

    seconds: float = 0.0
    """Time of the rollouts, added up over threads and processes [s]."""
    pictures: int = 0
    """Number of pictures that were drawn."""
    drawing: float = 0.0
    """Part of the time that they took [s]."""

    def plus(self, other: "Spent") -> "Spent":
        """The sum of two."""
        return Spent(self.seconds + other.seconds, self.pictures + other.pictures, self.drawing + other.drawing)

    def __str__(self) -> str:
        share = f"{self.drawing / self.seconds:.0%}" if self.seconds else "0%"
        return f"drawing took {share} of the time: {self.pictures} pictures in {self.drawing:.1f} s"


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
    """Plays batches of rollouts: those of a batch at once, each in a slot of a vector environment, by its own policy.
    It keeps the environment and the policies as long as the task stays the same."""

    def __init__(
        self,
        settings: EvaluateSettings,
        search: Sequence[str] = (),
        strict: bool = True,
        threads: int | None = None,
    ):
        """
        Args:
            strict: whether a policy that crashes in the very first batch ends the evaluation.
            threads: number of threads that step the slots; None for the available cores.
        """
        self.settings, self.search, self.strict, self.threads = settings, search, strict, threads
        self.has_cameras = False
        """Whether a policy that was described observes cameras."""
        self._running: tuple[tuple[str, str], PoolVectorEnv, list[Policy]] | None = None

    def __call__(self, batch: Sequence[RolloutId]) -> list[dict[str, Any]]:
        """Play rollouts of one task and condition, from reset to their ends, or until their policies crash.

        Returns:
            The records, each with the actions that the controller received as `played` if episodes are kept, and the
            first one with the `Spent` time of all if there are cameras.

        Raises:
            BadPolicy: a policy returned an invalid action.
            ForeignCode: a policy crashed in the first batch.
        """
        envs, policies = self._prepared_for(batch[0].task, batch[0].perturbation)
        places = zip(batch, envs.envs, policies, strict=False)
        rollouts = [_PlayedRollout(which, env, policy=policy) for which, env, policy in places]
        for rollout in rollouts:
            rollout.instruct(self.search)
        start, before = time.perf_counter(), [env.drawing for env in envs.envs]
        self._play(envs, rollouts)
        self.strict = False
        if envs.envs[0].cameras:
            drawn = np.subtract([env.drawing for env in envs.envs], before).sum(axis=0).tolist()
            rollouts[0].record["spent"] = Spent(envs.threads * (time.perf_counter() - start), int(drawn[0]), drawn[1])
        return [rollout.record for rollout in rollouts]

    def _play(self, envs: PoolVectorEnv, rollouts: "Sequence[_PlayedRollout]") -> None:
        """Play rollouts in the first slots."""
        count, size = envs.action_space.shape or (0, 0)
        names = [rollouts[min(slot, len(rollouts) - 1)].which.scenario for slot in range(count)]
        seen, infos = envs.reset(options={"scenario": names, "reset_mask": np.arange(count) < len(rollouts)})
        for slot, rollout in enumerate(rollouts):
            info = {name: infos[name].tolist()[slot] for name in INFOS}
            first = rollout.begin(_of_slot(seen, slot))
            begin = partial(rollout.policy.reset, first, info, rollout.seed)
            self._tried([rollout], f"its reset {rollout.where}", begin)
        actions = np.zeros((count, size), np.float32)
        while going := {slot: rollout for slot, rollout in enumerate(rollouts) if not rollout.record}:
            views = [rollout.sees(rollout.shown(_of_slot(seen, slot))) for slot, rollout in going.items()]
            chosen = self._actions([*going.values()], views)
            for (slot, rollout), action in zip(going.items(), chosen, strict=True):
                if action is not None:
                    actions[slot] = self._checked(rollout, action, size)
            draw = np.zeros(count, np.bool_)
            for slot, rollout in going.items():
                draw[slot] = rollout.looks = self._looks(rollout)
            seen, _, terminated, truncated, infos = envs.step(actions, draw)
            for slot, rollout in going.items():
                if not rollout.record and (terminated[slot] or truncated[slot]):
                    rollout.end(bool(infos["success"][slot]), infos["reason"][slot], lacks=infos["lacks"][slot])
                    if self.settings.keep:
                        rollout.record["played"] = rollout.env.played

    def _actions(
        self, rollouts: "Sequence[_PlayedRollout]", observations: Sequence[Observation]
    ) -> list[NDArray[np.float64] | None]:
        """The next action in each rollout; None if its policy crashes, which ends it."""
        policies, together = [one.policy for one in rollouts], getattr(rollouts[0].policy, "act_all", None)
        if together is None or self.settings.slots == 1:
            return [
                self._tried([one], f"its act {one.where}", lambda one=one, seen=seen: _array(one.policy.act(seen)))
                for one, seen in zip(rollouts, observations, strict=True)
            ]
        found = self._tried(rollouts, "its act_all", lambda: [*map(_array, together(policies, observations))])
        if found is not None and len(found) != len(rollouts):
            told = f"its act_all returns {len(found)} actions for {len(rollouts)} policies"
            raise BadPolicy(f"policy {self.settings.name}: {told}")
        return [None] * len(rollouts) if found is None else [*found]

    def _tried(self, rollouts: "Sequence[_PlayedRollout]", part: str, call: Callable[[], A]) -> A | None:
        """Return value of a part of a policy; None if it crashes, which ends its rollouts."""
        try:
            with policy_errors(self.settings.name, part, rollouts[0].env):
                return call()
        except ForeignCode as error:
            if self.strict:
                raise
            for rollout in rollouts:
                rollout.end(False, "", crashed=str(error))
            return None

    def _looks(self, rollout: "_PlayedRollout") -> bool:
        """Whether pictures are drawn for the next act of a policy. One without `looks` uses them."""
        looks = getattr(rollout.policy, "looks", None)
        if rollout.record or rollout.blind or not rollout.env.cameras:
            return False
        return looks is None or bool(self._tried([rollout], f"its looks {rollout.where}", looks))

    def _checked(self, rollout: "_PlayedRollout", action: NDArray[np.float64], size: int) -> NDArray[np.float32]:
        try:
            return checked(action, size)
        except ValueError as error:
            raise BadPolicy(f"policy {self.settings.name} {rollout.where}: {error}") from None

    def described(self, tasks: set[str]) -> dict[str, dict[str, Any]]:
        """What the policy is and what it observes, by task: hashes of it, see `policies.identity`, of a server its
        description of itself; and names of streams and cameras."""
        told: dict[str, dict[str, Any]] = {"server" if self.settings.remote else "code": {}, "observed": {}}
        who, observed = told.values()
        for task in sorted(tasks):
            envs, policies = self._prepared_for(task, NONE)
            _check_conditions(envs.envs[0], self.settings, self.search)
            who[task], names = self._identity(policies[0]), envs.envs[0].observed
            observed[task] = [*names.streams, *names.cameras]
            self.has_cameras |= bool(names.cameras)
        return told

    def _identity(self, policy: Policy) -> Any:
        if isinstance(policy, RemotePolicy):
            return policy.described()
        factory = find_policy(self.settings.name, client=self.settings.remote)
        return identity(self.settings.name, factory, policy)

    def _prepared_for(self, task: str, perturbation: str) -> tuple[PoolVectorEnv, list[Policy]]:
        if self._running and self._running[0] != (task, perturbation):
            self.close()
        if not self._running:
            settings = self.settings
            remote = settings.remote
            observed = remote.streams(load_task(task, self.search).embodiment) if remote else settings.observations
            envs = environments(settings, task, perturbation, observed, self.search, self.threads)
            own = [folder for folder in folders_of(settings, task) if folder not in settings.benign]
            memory = _training(own) if settings.name == REPLAY else None
            factory = find_policy(settings.name, memory, settings.remote)
            made = [make_policy(settings.name, factory, env) for env in envs.envs]
            self._running = (task, perturbation), envs, made
        return self._running[1:]

    def close(self) -> None:
        """Close the environment, and the policies if they have a method `close`."""
        if self._running:
            _, envs, policies = self._running
            envs.close()
            for policy in policies:
                if callable(close := getattr(policy, "close", None)):
                    with policy_errors(self.settings.name, "its close"):
                        close()
            self._running = None


def _check_conditions(env: PoolEnv, settings: EvaluateSettings, search: Sequence[str]) -> None:
    """Raise `ScengenError` if a condition cannot be played on a task: before any is, which may take hours."""
    row, seen = env._rows[0], env.observed
    chosen = [*map(Perturbation.parse, settings.perturbations)]
    every = Perturbation(tuple(dict.fromkeys(part for one in chosen for part in one.parts)))
    every.check([*seen.streams], [*seen.cameras.values()], env.look)
    for perturbation in chosen:
        if perturbation.has_words:
            words = Words.of(row.task, row.instruction, search)
            perturbation.of(row.id, settings.perturb_seed, words=words).instruction  # noqa: B018  (it raises an error)
    for arm in settings.chosen_arms or ():
        instruction(arm, row, search)


def folders_of(settings: EvaluateSettings, task: str) -> list[str]:
    """Folders of the pools of a task."""
    return [folder for folder in settings.every_folder if task in Pool.open(folder).kinds("task")[0]]


def environments(
    settings: EvaluateSettings,
    task: str,
    perturbation: str,
    observed: Sequence[str] | None,
    search: Sequence[str] = (),
    threads: int | None = None,
) -> PoolVectorEnv:
    """The environments in which the rollouts of a task are played, one for each slot.

    Args:
        observed: names of streams and cameras; None for those of environments.
    """
    return PoolVectorEnv(
        task,
        folders_of(settings, task),
        settings.slots,
        threads,
        AutoresetMode.DISABLED,
        observations=observed,
        width=settings.width,
        height=settings.height,
        action_filter=settings.action_filter,
        action_repeat=settings.remote.repeat if settings.remote else settings.action_repeat,
        rules=check_rules(settings.rules),
        settle=settings.settle,
        perturb=perturbation,
        perturb_seed=settings.perturb_seed,
        look=settings.look,
        search=search,
    )


def first_look(env: PoolEnv, seen: Observation) -> dict[str, Any]:
    """What a line says of the start of an episode, from the state and from what the policy sees."""
    pictures = {camera: picture_digest(seen[camera]) for camera in env.cameras}
    return {
        "instruction": env.instruction,
        "perturb": env.drawn.plain(),
        "first_state": state_digest(env.world),
        "pictures": pictures,
        "renderer": env.renderer,
    }


def policy_seed(scenario: str, rollout: int) -> int:
    """Seed of the random numbers of a policy, the same under each condition."""
    return int(2**31 * unit("rollout", scenario, rollout))


@dataclass
class Rollout:
    """A rollout in an environment, by a policy or by another program."""

    which: RolloutId
    """The rollout."""
    env: PoolEnv
    """The environment."""
    record: dict[str, Any] = field(default_factory=dict)
    """Data that are known only at the end of the episode; empty before."""
    start: dict[str, Any] = field(default_factory=dict)
    """What is known of its start, see `first_look`."""

    def begin(self, seen: Observation) -> Observation:
        """Note the start. Returns what the policy sees of the first observation."""
        view = self.sees(seen)
        self.start = first_look(self.env, view)
        return view

    def sees(self, seen: Observation) -> Observation:
        """What the policy sees of an observation."""
        return seen_by(self.which.arm, seen, self.env.cameras)

    @property
    def seed(self) -> int:
        """Seed of the policy's random numbers."""
        return policy_seed(self.which.scenario, self.which.rollout)

    def end(self, success: bool, reason: str, lacks: str = "", crashed: str = "") -> None:
        """Write its record."""
        world, played = self.env.world, self.env.played
        told = {"success": success, "reason": reason, "lacks": lacks, "crashed": crashed, "phase": phase(world)}
        ran = {"seconds": round(world.time, 3), "actions": len(played), "actions_sha256": sha256(played.tobytes())}
        read = {"instruction_read": self.env.instruction_read, "policy_seed": self.seed, "final_state": world.digest}
        self.record = {**asdict(self.which), **self.start, **told, **ran, **read}


@dataclass
class _PlayedRollout(Rollout):
    """A rollout of a policy in a slot."""

    policy: Policy = field(kw_only=True)
    looks: bool = True
    """Whether the policy uses the pictures of the last observation."""

    @property
    def blind(self) -> bool:
        """Whether all pictures are black, so that none has to be drawn."""
        return self.which.arm in ARMS and ARMS[self.which.arm].needs == PICTURES

    def shown(self, seen: Observation) -> Observation:
        """An observation without pictures that the policy does not use."""
        unused = () if self.looks or self.blind else self.env.cameras
        return {name: value for name, value in seen.items() if name not in unused}

    def instruct(self, search: Sequence[str]) -> None:
        """Give the instruction of the arm."""
        rows, arm = self.env._rows, self.which.arm
        self.env.instruct(instruction(arm, rows[rows.find(self.which.scenario)], search) if arm != CLEAN else None)

    @property
    def where(self) -> str:
        """The scenario, for errors."""
        return f"on scenario {self.env.row.name}"


def _of_slot(seen: Mapping[str, Any], slot: int) -> Observation:
    """The observation of one slot."""
    return {name: values[slot] for name, values in seen.items()}


def _array(action: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(action, float)


def _training(folders: Sequence[str]) -> Library | None:
    """The training scenarios of the pools; None if there are none."""
    every = Library([Pool.open(folder) for folder in folders])
    return every.of_split(ID) if ID in every.kinds("split") else None
