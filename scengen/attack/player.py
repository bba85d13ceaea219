"""Play an attempt of the adversary: from the start or from a saved state, through the teleoperation filter or raw."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray

from ..control.loop import Loop
from ..episode import STRICT, Actions, Episode, Outcome, Rules
from ..errors import BadConfig, GaveUp
from ..geometry import Vec3
from ..scenario import Plan, Scenario
from ..sim.recording import RecordingWorld
from ..sim.world import World
from ..skills.motion import alone
from ..validate.rollout import Stillness
from . import macros, plans
from .macros import Macro
from .phases import by_the_clock, follow, repeat, trace
from .signature import ContactPair, Signature, signature, starts
from .solids import Solid, solids

SETTLE_TIME = 1.0
"""Time for which a reached goal has to last without action, as in a certificate [s]."""


@dataclass(frozen=True)
class Attempt:
    """A plan of the adversary, as data."""

    tier: str
    macros: tuple[Macro, ...]
    """Moves, in order."""
    stage: int | None = None
    """Stage of the witness at which the attempt starts; None for the start of the episode."""

    def __str__(self) -> str:
        return "; ".join(map(str, self.macros)) or "nothing more"


def in_turn(families: Iterable[Iterator[Attempt]]) -> Iterator[Attempt]:
    """The first attempt of each family, then the second ones, and so on."""
    for round_ in zip_longest(*families):
        yield from (attempt for attempt in round_ if attempt)


@dataclass(frozen=True)
class Node:
    """A state from which attempts can begin: everything that the rest of an episode depends on."""

    state: NDArray[np.float64]
    """State of the physics."""
    held: float
    """Time for which the goal has held [s]."""
    actions: Actions
    """Actions that led to the state."""
    signature: Signature
    """Signature so far."""
    about: str = ""
    """Description of the way to the state, as text; empty at the start."""

    def after(self, what: object) -> str:
        """Description of the way to the state, and of a further move."""
        return f"{self.about}; {what}" if self.about else str(what)

    @property
    def seconds(self) -> float:
        """Time since the start of the episode [s]."""
        return len(self.actions) * Loop.PERIOD


@dataclass(frozen=True)
class Played:
    """The result of an attempt."""

    outcome: Outcome
    reason: str
    """Reason of the outcome."""
    seconds: float
    """Time at which the goal was reached or the episode ended [s]."""
    actions: Actions
    """All actions since the start of the episode, as the controller received them."""
    digest: str
    """Hash of the final physics state."""
    signature: Signature
    """Signature at the time the goal was reached, or at the end."""
    notes: tuple[str, ...]
    """Macros that gave up, with their reasons."""
    nodes: tuple[Node, ...] = field(repr=False)
    """States at the ends of the macros while the outcome was open."""

    @property
    def solved(self) -> bool:
        """Whether the goal was reached."""
        return self.outcome == "success"


class Player:
    """Plays attempts on one scenario. It holds the world and the data that macros need."""

    def __init__(
        self,
        scenario: Scenario,
        scene_xml: str,
        embodiment: str,
        horizon: float,
        witness: Actions,
        rules: Rules = STRICT,
    ):
        self.rules: Rules = rules
        self.scenario, self.scene_xml, self.embodiment, self.horizon = scenario, scene_xml, embodiment, horizon
        self.world = World.load(scene_xml, embodiment)
        self._places = starts(self.world)
        nothing = np.zeros((0, self.world.size), np.float32)
        self.start = Node(self.world.state(), 0.0, nothing, self.signature())
        found = trace(scenario, self.world, witness)
        if found is None:
            raise BadConfig(
                f"scenario {scenario.id}: the witness does not reach the goal, so the scenario cannot be attacked"
            )
        self.trace = found
        """Trace of the witness."""
        self.foreign: dict[str, Actions] = {}
        """Witnesses of other scenarios, by id."""
        self.memories: dict[str, Callable[[World], Plan]] = {}
        """Plans that repeat training solutions, by name, the best one first."""
        self.durations: Sequence[Sequence[float]] = ()
        """Durations of the waits in some training solutions [s]."""

    @cached_property
    def solids(self) -> Mapping[str, Solid]:
        """The solids of the scene."""
        return solids(self.world)

    def plan(self, macro: Macro, raw: bool) -> Plan:
        """The plan of one macro."""
        match macro.kind:
            case "follow":
                return follow(self.world, self.trace, macro)
            case "resume":
                first, last = macro.numbers
                shift = self.world.com(macro.target) - self.trace.ways[macro.target][round(first)]
                return follow(self.world, self.trace, Macro("follow", "", (first, last, 1.0, 0.0, *map(float, shift))))
            case "replay":
                return repeat(self.foreign[macro.target], raw)
            case "memory":
                return self.memories[macro.target](self.world)
            case "clock":
                return by_the_clock(self.world, self.trace, macro.numbers)
            case "along":
                way = self.trace.way_of(macro.target)
                arm = self.world.arms[macro.arm]
                return alone(arm, plans.carry_along(arm, macro.target, way, *macro.numbers))
            case "shortcut":
                return self.scenario.shortcuts()[macro.target].plan(self.world)
            case "answer":
                answer = self.scenario.answer()
                assert answer is not None, "only families with an answer are guessed at"
                return answer.act(self.world, macro.numbers[0])
        return macros.plan(self.world, self.solids, macro)

    def stage(self, k: int) -> Node:
        """The state at the beginning of phase `k` of the witness."""
        stage = self.trace.stages[k]
        about = f"the first {k} phases of the witness" if k else ""
        return Node(stage.state, stage.held, self.trace.actions[: stage.row], stage.signature, about)

    @cached_property
    def phases(self) -> int:
        """Number of phases of the witness after which the goal is reached without further actions."""
        low, high = 0, len(self.trace.stages) - 1  # at the last stage the goal is reached
        while low < high:
            middle = (low + high) // 2
            low, high = (low, middle) if self.play((), False, self.stage(middle)).solved else (middle + 1, high)
        return low

    @cached_property
    def latches(self) -> frozenset[ContactPair]:
        """Contacts since the start that the goal or its rules query, as pairs of names: those that they look up where
        the witness has reached the goal, and that have occurred."""
        self.rewind(len(self.trace.stages) - 1)
        world = RecordingWorld.twin(self.world)
        self.scenario.success(world)
        self.scenario.failure(world)
        occurred = (question.names for question in world.asked if question.kind == "touched" and question.answer)
        return frozenset((one, other) for one, other in occurred)

    def rewind(self, k: int | None = None) -> None:
        """Put the world at stage `k` of the witness, or at the start, so that a plan can be made for it."""
        self.world.restore(self.start.state if k is None else self.trace.stages[k].state)

    def start_place(self, body: str) -> Vec3:
        """Position of a body's centre of mass at the start [m]."""
        self.rewind()
        return self.world.com(body)

    def goal_place(self, body: str) -> Vec3:
        """Position of a body's centre of mass at the end of the witness [m]."""
        self.rewind(len(self.trace.stages) - 1)
        return self.world.com(body)

    def idle(self, seconds: float) -> Iterator[None]:
        """Let the world go on without action, from the start: one control period after the other."""
        world = self.world
        world.restore(self.start.state)
        episode = Episode(self.scenario, world, self.horizon)
        for _ in range(round(seconds / Loop.PERIOD)):
            episode.step(world.received(world.idle))
            yield

    def signature(self) -> Signature:
        """The signature of the episode so far."""
        return signature(self.world, self._places)

    def play(self, steps: Sequence[Macro], raw: bool, node: Node | None = None) -> Played:
        """Play macros one after the other, then idle, until success, failure, the time limit, or rest.

        A macro that gives up does not end the others. A success counts if the goal still holds after `SETTLE_TIME`.

        Args:
            raw: whether actions go to the controller as they are, clipped, and not through the teleoperation filter.
            node: state from which to begin; None for the start of the scenario.
        """
        node = node or self.start
        self.world.restore(node.state)
        episode = Episode(self.scenario, self.world, self.horizon, self.rules)
        episode.held = node.held
        return _RunningAttempt(self, episode, node, raw).to_end(steps)


class _RunningAttempt:
    """One attempt in progress."""

    def __init__(self, player: Player, episode: Episode, node: Node, raw: bool):
        self.player, self.episode, self.node, self.raw, self.world = player, episode, node, raw, player.world
        self.rows: list[NDArray[np.float32]] = list(node.actions)
        self.notes: list[str] = []
        self.nodes: list[Node] = []

    def to_end(self, steps: Sequence[Macro]) -> Played:
        node = self.node
        for macro in steps:
            self._play_macro(macro)
            if self.episode.outcome is not None:
                break
            actions = self._actions()
            state, left = self.world.state(), self.player.signature()
            node = Node(state, self.episode.held, actions, left, node.after(macro))
            self.nodes.append(node)
        self._idle()
        if self.episode.outcome == "success":
            return self._settled()
        reason = self.episode.reason or "everything came to rest without reaching the goal"
        return self._ended(self.episode.outcome or "timeout", reason, self.world.time)

    def _play_macro(self, macro: Macro) -> None:
        try:
            for action in self.player.plan(macro, self.raw):
                if self._step(action) is not None:
                    return
        except GaveUp as error:
            self.notes.append(f"{macro.kind} {macro.target}".rstrip() + f": {error}")

    def _step(self, action: NDArray[np.float64]) -> Outcome | None:
        given = self.world.received(action, self.raw)
        self.rows.append(given)
        return self.episode.step(given)

    def _idle(self) -> None:
        """Idle until the outcome is decided or everything has been at rest for a while."""
        stillness = Stillness(self.player.scenario, self.world)
        while self.episode.outcome is None and (not stillness.lasts() or self.episode.held):
            self._step(self.world.idle)

    def _settled(self) -> Played:
        reached = self.world.time
        left = self.player.signature()
        for _ in range(round(SETTLE_TIME / Loop.PERIOD)):
            if self._step(self.world.idle) != "success":
                break
        outcome, reason = self.episode.settled()
        return self._ended(outcome, reason, reached if outcome == "success" else self.world.time, left)

    def _ended(
        self,
        outcome: Outcome,
        reason: str,
        seconds: float,
        left: Signature | None = None,
    ) -> Played:
        left = left or self.player.signature()
        notes, nodes = tuple(self.notes), tuple(self.nodes)
        return Played(outcome, reason, round(seconds, 6), self._actions(), self.world.digest, left, notes, nodes)

    def _actions(self) -> Actions:
        """Actions that the controller has received so far."""
        return np.array(self.rows, np.float32).reshape(-1, self.world.size)
