"""Policies: their interface, how one is found by name, and four built-in ones that serve as references for a pool.

A policy is any object with the two methods of `Policy` that `factory(env)` returns. The factory is named
`module:factory` and called for every slot in every process and for every task. A policy may have a static method
`act_all(policies, observations)` that returns the actions of several of them, in their order: a network computes those
of all slots at once. It may have a method `looks()` that says whether the next `act` uses pictures, such as at the
end of a chunk of actions: pictures take most of the time, and if it returns false, the next observation has none.

A factory may declare what its policies need, as attributes (of a class, class attributes): see `Needs`.
"""

import hashlib
import inspect
import sys
import uuid
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..control.teleop import Filter, unfiltered
from ..envs.gym import Observation, PoolEnv
from ..envs.observations import ALL, requested
from ..episode import Actions
from ..errors import BadConfig, GaveUp, ScengenError, UnknownName, cut
from ..learn.player import TrainedPolicy
from ..learn.store import StoredPolicy
from ..params import Value
from ..pool.library import Library
from ..samplers.task import Task
from ..sim.arm import IDLE
from ..sim.embodiment import hands
from ..work.foreign import at_fault, factory_of, is_factory, is_typed
from .remote.client import ClientSettings, is_address
from .remote.policy import RemotePolicy


class Policy(Protocol):
    """The interface of a policy."""

    def reset(self, observation: Observation, info: Mapping[str, Any], seed: int) -> None:
        """Start an episode; all randomness of the policy in it must come from `seed`."""
        ...

    def act(self, observation: Observation) -> ArrayLike:
        """The action for the next step, of the shape of `env.action_space`: seven numbers for each arm."""
        ...


Factory = Callable[[PoolEnv], Policy]


@dataclass(frozen=True)
class Needs:
    """What a factory declares of its policies. An evaluation follows, unless its settings say otherwise."""

    observations: tuple[str, ...] | None = None
    """Names of the streams and cameras that the policy reads; None if it does not say."""
    action_repeat: int | None = None
    """Number of control periods for which each action is held; None if it does not say."""
    language: bool | None = None
    """Whether the policy reads `env.task_description`; None if it does not say."""

    @classmethod
    def of(cls, name: str, factory: Any) -> "Needs":
        """What the factory of a policy declares.

        Raises:
            BadConfig: a declaration is of another type.
        """
        told = {f.name: getattr(factory, f.name, None) for f in fields(cls)}
        names = told["observations"]
        if names is not None:
            is_list = isinstance(names, Sequence) and not isinstance(names, str)
            if not is_list or not all(isinstance(each, str) for each in names):
                raise _misdeclared(name, "observations", names, "a list of names of streams and cameras")
            told["observations"] = tuple(names)
        for key, kind, what in (("action_repeat", int, "a whole number"), ("language", bool, "true or false")):
            if told[key] is not None and type(told[key]) is not kind:
                raise _misdeclared(name, key, told[key], what)
        return cls(**told)

    def missing(self, observed: Iterable[str]) -> list[str]:
        """Names that the policy reads and that are not among those that are observed."""
        return [each for each in self.observations or () if each not in requested(observed, ALL)]


def _misdeclared(name: str, key: str, given: Any, what: str) -> BadConfig:
    return BadConfig(f"policy = {cut(name)}; its {key} = {cut(repr(given), 60)} must be {what}")


class Idle:
    """A policy that does nothing: a scenario that it solves is trivial."""

    def __init__(self, env: PoolEnv):
        self._action = np.resize(IDLE, env.action_space.shape or ())

    def reset(self, observation: Observation, info: Mapping[str, Any], seed: int) -> None:
        """Start an episode; the policy has no state."""

    def act(self, observation: Observation) -> ArrayLike:
        """No motion, grippers open."""
        return self._action


class Random:
    """A policy with uniformly random actions."""

    def __init__(self, env: PoolEnv):
        self._random, self._shape = np.random.default_rng(), env.action_space.shape

    def reset(self, observation: Observation, info: Mapping[str, Any], seed: int) -> None:
        """Start the random stream of `seed`."""
        self._random = np.random.default_rng(seed)

    def act(self, observation: Observation) -> ArrayLike:
        """Uniform random numbers in [-1, 1]."""
        return self._random.uniform(-1.0, 1.0, self._shape)


class Oracle:
    """The task's own scripted solution. It reads the full state and serves as an upper bound, not as a competitor."""

    def __init__(self, env: PoolEnv):
        self.env, self.filter = env, Filter(len(hands(env.task.embodiment)))
        self.sent = unfiltered if env.action_filter else self.filter
        self.identity = inspect.getsource(env.task.family)

    def reset(self, observation: Observation, info: Mapping[str, Any], seed: int) -> None:
        """Start the plan again."""
        self.plan = self.env.scenario.oracle(self.env.world)
        self.filter.reset()

    def act(self, observation: Observation) -> ArrayLike:
        """The plan's next action, filtered once, as for the certificate; idle after the end of the plan."""
        try:
            return self.sent(next(self.plan))
        except (StopIteration, GaveUp):
            self.plan = iter(())
            return self.sent(self.env.world.idle)


class NearestReplay:
    """A policy that replays the witness of the nearest other training scenario: the success of pure memory."""

    def __init__(self, env: PoolEnv, memory: Library | None):
        """
        Args:
            memory: training scenarios of the task.

        Raises:
            BadConfig: there are fewer than two.
        """
        if memory is None or len(memory) < 2:
            raise BadConfig(f"policy replay needs a pool of {env.task.name} with split id and at least 2 scenarios")
        self.env, self.memory = env, memory
        self.points = np.array([coordinates(env.task, params) for (params,) in memory.columns("params")])

    def reset(self, observation: Observation, info: Mapping[str, Any], seed: int) -> None:
        """Find the nearest witness."""
        here = coordinates(self.env.task, self.env.values)
        far = np.linalg.norm(self.points - here, axis=1)
        far[self.memory.directory.ids == self.env.row.id.encode()] = np.inf
        self.actions: Actions = self.memory.witness(int(far.argmin()))
        self.next = 0

    def act(self, observation: Observation) -> ArrayLike:
        """The witness's next action; idle after its end."""
        if self.next == len(self.actions):
            return self.env.world.idle
        self.next += 1
        return self.actions[self.next - 1]


BUILT_IN: dict[str, Factory] = {"idle": Idle, "random": Random, "oracle": Oracle}
"""Factories of the built-in policies, by name."""
REPLAY = "replay"
"""Name of the built-in policy that needs training scenarios."""
FULL_RATE_POLICIES = (REPLAY, "oracle")
"""Built-in policies whose actions are meant for one control period each."""


def coordinates(task: Task, values: Mapping[str, Value]) -> NDArray[np.float64]:
    """The parameters of a scenario that vary in training, each in units of its training range."""
    found = []
    for name, dist in task.training.items():
        low, high = min(i.low for i in dist.support), max(i.high for i in dist.support)
        if high > low:
            found.append((values[name] - low) / (high - low))
    return np.array(found)


def find_policy(name: str, memory: Library | None = None, client: ClientSettings | None = None) -> Factory:
    """The factory of a policy.

    Args:
        name: a built-in name, the folder of a policy of `scengen train`, `module:factory` from the path or the working
            directory, or the address of a server.
        memory: training scenarios, for the policy `replay`.
        client: names of observations and actions, for the policy of a server.

    Raises:
        ScengenError: there is no such policy.
    """
    if name == REPLAY:
        return lambda env: NearestReplay(env, memory)
    if name in BUILT_IN:
        return BUILT_IN[name]
    if Path(name).is_dir():
        return partial(TrainedPolicy, StoredPolicy.open(name))
    if client is not None and is_address(name):
        return lambda env: RemotePolicy(env, name, client)
    if not is_factory(name):
        known = [
            *BUILT_IN,
            REPLAY,
            "module:factory",
            "a folder",
            "ws://HOST:PORT",
            "wss://HOST:PORT",
            "zmq://HOST:PORT",
        ]
        meant = f"{name.removesuffix('.py')}:FACTORY" if name.endswith(".py") else None
        raise UnknownName("policy", name, known, meant)
    return factory_of("policy", name)


def make_policy(name: str, factory: Factory, env: PoolEnv) -> Policy:
    """The policy that a factory returns.

    Raises:
        ForeignCode: the factory raises an error.
        BadConfig: the factory does not accept an environment, or the returned object is not a policy.
    """
    try:
        inspect.signature(factory).bind(env)
    except TypeError:
        what = "its factory is called with the environment, and does not accept it"
        remedy = "write `def make_policy(env)`, or `def __init__(self, env)`"
        raise BadConfig(f"policy = {cut(name)}; {what}; {remedy}") from None
    except ValueError:  # written in C, without a signature
        pass
    with policy_errors(name, "its factory", env):
        policy = factory(env)
    if missing := [method for method in ("reset", "act") if not callable(getattr(policy, method, None))]:
        what = f"returned {type(policy).__name__}, which has no method {' and no '.join(missing)}"
        raise BadConfig(f"policy = {cut(name)}; its factory {what}; see the class Policy in scengen.evaluate.policies")
    if env.cameras and (trained := getattr(policy, "look", None)) not in (None, str(env.look)):
        warnings.warn(f"{cut(name)} was trained with look {cut(str(trained))} and now sees {env.look}", stacklevel=2)
    return policy


@contextmanager
def policy_errors(name: str, part: str, env: PoolEnv | None = None) -> Iterator[None]:
    """Attribute an error to the policy unless scengen raises it on purpose.

    Args:
        env: environment of the policy.

    Raises:
        BadConfig: the policy reads a stream or a camera that it is not given.
        ForeignCode: another error that is not a `ScengenError`.
    """
    try:
        yield
    except ScengenError:
        raise
    except KeyError as error:
        if env is not None and error.args and (known := _unobserved(error.args[0], env)):
            raise BadConfig(unobserved(name, [known], [*env.streams, *env.cameras])) from None
        raise at_fault("policy", name, f"{part} fails", error) from error
    except Exception as error:
        raise at_fault("policy", name, f"{part} fails", error) from error


def unobserved(name: str, missing: Sequence[str], observed: Sequence[str]) -> str:
    """A line about streams and cameras that a policy reads but is not given, with the setting that adds them."""
    whole = ",".join([*observed, *missing])
    return f"{cut(name)} reads {', '.join(missing)}, which is not observed; pass observations=[{whole}]"


def _unobserved(key: Any, env: PoolEnv) -> str:
    """The key if it is the name of a stream or a camera that is not observed; else an empty text."""
    if not isinstance(key, str) or key in (*env.streams, *env.cameras):
        return ""
    try:
        env.check_observations([key])
    except UnknownName:
        return ""
    return key


def identity(name: str, factory: Factory, policy: Policy) -> str:
    """Hash of a policy's attribute or method `identity` or `version`; of its source if it has neither.

    The source of a policy is the file of its factory and those of its class and bases, each with all Python files of
    its package. Weights in other files are not included: a policy that loads weights should declare their version. A
    policy that was typed into a session, such as a notebook's, has no file and is another one at each call.
    """
    for attribute in ("identity", "version"):
        if (said := getattr(policy, attribute, None)) is not None:
            with policy_errors(name, f"its {attribute}"):
                said = said() if callable(said) else said
            return _sha(f"{attribute} {said!r}".encode())
    if any(map(is_typed, (factory, type(policy)))):
        return _sha(uuid.uuid4().bytes)
    files: set[Path] = set()
    for code in (factory, *type(policy).__mro__):
        module = sys.modules.get(getattr(code, "__module__", ""))
        file = getattr(module, "__file__", None)
        if module is None or file is None or module.__name__.partition(".")[0] in sys.stdlib_module_names:
            continue
        package, dot, _ = module.__name__.partition(".")
        if module.__name__.startswith("scengen."):
            files.add(Path(file))
        elif dot and (top := getattr(sys.modules.get(package), "__file__", None)):
            files.update(Path(top).parent.rglob("*.py"))
        else:
            files.add(Path(file))
    return _sha("\n".join(_sha(path.read_bytes()) for path in sorted(files)).encode())


def _sha(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
