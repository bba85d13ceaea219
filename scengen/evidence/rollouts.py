"""Rollouts of one scenario that show how a task behaves: the oracle, disturbances of it, and ways that must fail."""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from ..control.loop import ACTION, Loop
from ..control.teleop import MOTION
from ..episode import Actions
from ..means import OPEN, SHOWN
from ..pool.manifest import without_numbers
from ..samplers.keyed import normals
from ..scenario import Plan, Planner, Scenario
from ..sim import scene_text
from ..sim.world import World
from ..validate.rollout import Jitter, Rollout, replay, run, try_shortcut
from ..validate.settings import Robust

WAITING_TIME = 2.0
"""Time for which an idle robot waits before the rollout may end at rest [s], as in a certificate."""
NOISES = (0.1, 0.3, 1.0)
"""Standard deviations of the noise that is added to the oracle's actions, in the range of an action."""
JITTERED = 2
"""Number of jittered runs: one with the latency of a certificate, one without."""
NUDGE = Robust(runs=1, position=1e-6, turn=1e-4, mass=1e-6, friction=1e-6, noise=1e-6, latency=0)
"""Disturbance so small that a verdict that changes with it is decided by rounding."""

Observer = Callable[[World], None]
"""Function that looks at a world after each control period, and changes nothing in it."""


class Watched(World):
    """A world that calls an observer after each control period."""

    observer: Observer | None = None

    def step_filtered(self, filtered: NDArray[np.float32]) -> None:
        super().step_filtered(filtered)
        if self.observer is not None:
            self.observer(self)


@dataclass(frozen=True)
class Played:
    """Result of a rollout at two levels: its verdict, and its bits."""

    verdict: str
    """Outcome; after a failure also its reason, with `#` for each number."""
    seconds: float
    """Time at which the goal was reached, or at which the episode ended [s]."""
    bits: str
    """Hash of the actions, the final state, and what the rules said in each control period; eight hex digits."""
    steady: bool = True
    """Whether the verdict stays the same under disturbances of `NUDGE`. Otherwise another machine may find another."""

    @property
    def plain(self) -> list[str | float | bool]:
        """Plain data; the last item is left out for a steady verdict."""
        return [self.verdict, self.seconds, self.bits, *([] if self.steady else ["unsteady"])]


OnChange = Callable[[World, str, NDArray[np.float64], str], None]
"""Function that is called when the rules change their answer."""


@dataclass
class Trace:
    """Answers of the rules of a scenario in each control period of a rollout."""

    scenario: Scenario
    changes: list[tuple[float, str]] = field(default_factory=list)
    """Times at which the rules changed their answer [s], and the new answer."""
    on_change: OnChange | None = None
    """Called with the world and the new answer, and with the state and the answer of the period before."""
    before: NDArray[np.float64] | None = None
    """State after the last period, if changes are requested."""

    def __call__(self, world: World) -> None:
        answer = answer_of(self.scenario, world)
        if not self.changes or self.changes[-1][1] != answer:
            if self.on_change is not None and self.before is not None:
                self.on_change(world, answer, self.before, self.changes[-1][1])
            self.changes.append((round(world.time, 6), answer))
        if self.on_change is not None:
            self.before = world.state()


def answer_of(scenario: Scenario, world: World) -> str:
    """Answers of the rules in a state: the reason of a failure, whether the goal holds, whether an event is pending,
    which means are shown (+) or missed (-), by number, and the memory.

    Numbers of the memory that are not whole are left out, because they change in every period.
    """
    lost = scenario.failure(world)
    parts = [without_numbers(lost) if lost else "goal" if scenario.success(world) else "open"]
    if lost is not None:
        parts.append(type(lost).__name__)
    if scenario.pending(world):
        parts.append("pending")
    judged = enumerate(mean.found(world) for mean in scenario.means().values())
    parts += [f"{'+' if found == SHOWN else '-'}{number}" for number, found in judged if found != OPEN]
    memory = world.memory
    parts += [f"{name} {whole(memory[name])}" for name in memory.names if memory[name]]
    return ", ".join(parts)


def whole(value: float) -> str:
    """A whole number as text; `~` for any other number."""
    return str(int(value)) if value == int(value) else "~"


@dataclass
class Stage:
    """A scenario in which rollouts are played one after the other."""

    scenario: Scenario
    embodiment: str
    horizon: float
    """Time limit [s]."""
    cheats: Mapping[str, tuple[Callable[[Scenario, World], Plan], bool]] = field(default_factory=dict)
    """Plans that once reached the goal without the intended means, and whether they act without the filter, by name."""
    on_change: OnChange | None = None
    """See `Trace.on_change`."""

    def __post_init__(self) -> None:
        self.text = scene_text.emit(self.scenario.build())[0]
        self.world = self._load(self.text)
        self.actions: Actions | None = None
        """Actions of the oracle; None before it has been played."""

    def _load(self, text: str) -> Watched:
        return Watched.load(text, self.embodiment)

    def plays(self, everything: bool = True) -> Iterator[tuple[str, Callable[[World], Rollout]]]:
        """Names of the rollouts, and functions that play them in a world of the scene. The oracle comes first.

        Args:
            everything: whether all rollouts are wanted; otherwise the oracle alone.
        """
        scenario, horizon = self.scenario, self.horizon
        yield "oracle", lambda world: run(scenario, world, scenario.oracle, horizon)
        if not everything:
            return
        for noise in NOISES:
            yield f"noise {noise:g}", lambda world, noise=noise: self._replayed(world, noise)
        yield "idle", lambda world: run(scenario, world, _wait, horizon, until_settled=True)
        for name, shortcut in scenario.shortcuts().items():
            for raw in (False, True):
                message = f"shortcut {name}{', raw' if raw else ''}"
                yield message, lambda world, s=shortcut, raw=raw: try_shortcut(scenario, world, s, horizon, raw=raw)
        for number in range(JITTERED):
            yield f"jitter {number}", lambda world, number=number: self._jittered(world, number)
        if scenario.steps():
            yield "steps", lambda world: run(scenario, world, self._steps, horizon)
        for name, (plan, raw) in self.cheats.items():
            yield f"cheat {name}", lambda world, p=plan, raw=raw: self._attempt(world, lambda w: p(scenario, w), raw)

    def ablations(self) -> Iterator[tuple[str, str]]:
        """Names of the scenes without the intended means, and their texts."""
        for name, spec in self.scenario.ablations().items():
            yield name, scene_text.emit(spec)[0]

    def play(self, name: str, how: Callable[[World], Rollout], world: Watched | None = None) -> Played:
        """Play a rollout.

        Args:
            name: `oracle` for the rollout whose actions others repeat.
            how: the function that plays it.
            world: the world in which it is played; by default that of the scene.
        """
        trace, world = Trace(self.scenario, on_change=self.on_change), world or self.world
        world.observer = trace
        try:
            found = how(world)
        finally:
            world.observer = None
        if name == "oracle":
            self.actions = found.actions
        return played(found, trace.changes)

    def replay_ablated(self, text: str) -> Played:
        """Replay the oracle's actions in a scene without the intended means."""
        world = self._load(text)
        return self.play("ablation", lambda world: self._replayed(world, 0.0), world)

    def steady(self, verdict: str, how: Callable[[World], Rollout], text: str = "") -> bool:
        """Whether a rollout has the same verdict in slightly disturbed worlds."""
        world = self._load(text) if text else self.world
        for number in range(NUDGE.runs):
            nudge = Jitter.within(NUDGE, self.scenario.id, number)
            if verdict_of(how(nudge.disturbed(world, self.scenario.DISTURBED))) != verdict:
                return False
        return True

    def _steps(self, world: World) -> Plan:
        """The moves of the sub-goals one after the other, as the family lists them."""
        for move in self.scenario.steps().values():
            yield from move(world)

    def _attempt(self, world: World, planner: Planner, raw: bool) -> Rollout:
        return run(self.scenario, world, planner, self.horizon, raw=raw)

    def _jittered(self, world: World, number: int) -> Rollout:
        jitter = Jitter.within(Robust(), self.scenario.id, number)
        disturbed = jitter.disturbed(world, self.scenario.DISTURBED)
        return run(self.scenario, disturbed, self.scenario.oracle, self.horizon, jitter=jitter)

    def _replayed(self, world: World, noise: float) -> Rollout:
        assert self.actions is not None
        actions = noisy(self.actions, noise, self.scenario.id) if noise else self.actions
        return replay(self.scenario, world, actions, self.horizon, until_settled=True)


def played(found: Rollout, changes: list[tuple[float, str]]) -> Played:
    """The result of a rollout with the answers of its rules."""
    text = json.dumps([found.digest, found.outcome, found.reason, found.gave_up, changes])
    bits = hashlib.sha256(text.encode() + found.actions.tobytes()).hexdigest()[:8]
    return Played(verdict_of(found), found.seconds, bits)


def verdict_of(found: Rollout) -> str:
    """Outcome of a rollout, and the kind of reason of a failure. Why a plan gave up is not a rule of the task."""
    return f"failure: {without_numbers(found.reason)}" if found.outcome == "failure" else found.outcome


def noisy(actions: Actions, noise: float, key: str) -> Actions:
    """Actions with noise on the six motion channels of each arm."""
    shaken = actions.astype(float).reshape(len(actions), -1, ACTION)
    for period, arms in enumerate(shaken):
        for arm, channels in enumerate(arms):
            channels[:MOTION] += noise * np.array(normals(MOTION, key, "noise", period, arm))
    return np.clip(shaken, -1.0, 1.0).reshape(actions.shape).astype(np.float32)


def _wait(world: World) -> Plan:
    yield from repeat(world.idle, round(WAITING_TIME / Loop.PERIOD))
