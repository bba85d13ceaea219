"""The attack on one scenario: every tier gets its share of the rollouts, and an archive guides the search."""

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice

from ..samplers.keyed import unit
from . import draws
from .clock import CLOCK, timed
from .detours import DETOUR, detours
from .evidence import CausalContacts, Hit, TierRate, hit, rates
from .feel import FEEL, felt
from .macros import Macro
from .memories import MEMORY, remembered
from .player import Attempt, Node, Played, Player
from .priors import GUESSES, Prior, guesses
from .retries import RETRY, retries
from .servo import SERVO, servo
from .signature import Signature
from .variations import FOREIGN, WITNESS, foreign, perturbed

SHORTCUT = "shortcut"
"""Tier of the family's declared shortcuts."""
PRIOR = "prior"
"""Tier of fixed answers."""
RANDOM = "random"
"""Tier of random plans."""
SEARCH = "search"
"""Tier of the search that starts from states of the archive."""
TIER_SHARES = {
    SHORTCUT: 0.10,
    PRIOR: 0.10,
    MEMORY: 0.04,
    CLOCK: 0.04,
    SERVO: 0.20,
    RETRY: 0.30,
    DETOUR: 0.14,
    FEEL: 0.14,
    FOREIGN: 0.08,
    WITNESS: 0.14,
    RANDOM: 0.14,
    SEARCH: 0.14,
}
"""Relative share of the rollouts of each tier, in the order in which they are played. Rollouts that a tier leaves go to
the last one."""
TIERS = tuple(TIER_SHARES)
"""All tiers, in the order in which they are played."""
LEAKS = "leaks"
"""Tier of observations that reveal hidden parameters. It plays nothing, see `scengen.ood.analysis.leaks`."""
RATED = (
    *(tier for tier in TIERS if tier not in (PRIOR, MEMORY)),
    *(f"{PRIOR}_{count}" for count in GUESSES),
    *(f"{MEMORY}_{count}" for count in GUESSES),
)
"""Names under which hits are counted: tiers, and tiers with the number of answers or memories in an episode."""
MAX_FATAL = 2
"""Number of lost episodes after which a first move is not tried again."""
MIN_TIME_LEFT = 2.0
"""Minimum remaining time of an episode that is continued [s]."""


@dataclass(frozen=True)
class UntriedShortcut:
    """A shortcut that was not carried out: one of its moves gave up, so its success is unknown."""

    name: str
    raw: bool
    """Whether actions reached the controller without the teleoperation filter."""
    reason: str
    """Reason why the move gave up."""


@dataclass
class AttackResult:
    """The result of the attack on one scenario."""

    scenario: str
    """Id of the scenario."""
    rates: list[TierRate]
    """Hit rates of the tiers."""
    hits: list[Hit]
    cpu: float
    """Processor time of the adversary's rollouts [s]."""
    untried: list[UntriedShortcut]
    lost: str = ""
    """Reason why the attack did not end: the process crashed, or reached a limit. Empty if it ended."""


@dataclass(frozen=True)
class ArchivedState:
    """A state of the archive."""

    node: Node
    raw: bool
    """Whether actions reached the controller without the teleoperation filter."""
    signature: Signature
    """Signature of the way to the state."""


@dataclass
class Archive:
    """States that were reached, in cells of equal contacts and displacements, and successes."""

    cells: dict[tuple[bool, Signature], list[ArchivedState]] = field(default_factory=dict)
    """States by kind of actions and signature."""
    visits: Counter[tuple[bool, Signature]] = field(default_factory=Counter)
    """Number of visits of each cell."""
    successes: list[tuple[Hit, Node | None, tuple[Macro, ...]]] = field(default_factory=list)
    """Successes, each with the state from which it started, and its macros."""

    def add(self, state: ArchivedState) -> None:
        """Keep a state; a cell keeps its four latest ones."""
        key = (state.raw, state.signature)
        self.visits[key] += 1
        self.cells[key] = [*self.cells.get(key, []), state][-4:]

    def rarest(self, raw: bool, number: float) -> ArchivedState | None:
        """A state of the least visited cell; None if there is no cell.

        Args:
            raw: whether to choose among the cells of raw or of filtered actions.
            number: random number from 0 to 1 that chooses a state of the cell.
        """
        keys = [key for key in self.cells if key[0] == raw]
        if not keys:
            return None
        chosen = min(keys, key=lambda key: self.visits[key])
        self.visits[chosen] += 1
        return self.cells[chosen][int(number * len(self.cells[chosen]))]

    def parent(self, raw: bool, number: float) -> tuple[Hit, Node | None, tuple[Macro, ...]] | None:
        """One of the successes that lack most contacts of the witness; None if all successes make all of them.

        Args:
            raw: whether to choose among successes with raw or with filtered actions.
            number: random number from 0 to 1 that chooses a success.
        """
        known = [one for one in self.successes if one[0].raw == raw and one[0].refutes]
        most = max((len(hit.lacks) for hit, _, _ in known), default=0)
        far = [one for one in known if len(one[0].lacks) == most]
        return far[int(number * len(far))] if far else None


def never(hit: Hit) -> bool:
    """No hit ends an attack: all rollouts are spent."""
    return False


class Attack:
    """The attack on one scenario."""

    def __init__(
        self,
        player: Player,
        seed: int,
        number: int = 0,
        of: int = 1,
        priors: Sequence[Prior] = (),
        until: Callable[[Hit], bool] = never,
    ):
        """
        Args:
            number, of: number of the scenario, and of all scenarios. Each scenario starts with its own part of the
                tiers that are lists.
            priors: fixed answers of the task.
            until: test of a hit at which the attack ends.
        """
        self.player, self.seed, self.number, self.of, self.priors, self.until = player, seed, number, of, priors, until
        self.causal = CausalContacts(player)
        self.archive, self.fatal = Archive(), Counter[tuple[int | None, str, str]]()
        self.counts: list[TierRate] = []
        self.hits: list[Hit] = []
        self.untried: list[UntriedShortcut] = []
        self.cpu, self.done = 0.0, False
        for k, stage in enumerate(player.trace.stages[: player.phases]):
            for raw in (False, True):
                self.archive.add(ArchivedState(player.stage(k), raw, stage.signature))

    def run(self, budget: int, tiers: Sequence[str] = TIERS) -> AttackResult:
        """Spend `budget` rollouts on some tiers."""
        total = sum(TIER_SHARES[tier] for tier in tiers)
        owed = 0.0
        for tier in (t for t in TIERS if t in tiers):
            owed += budget * TIER_SHARES[tier] / total
            owed -= self._play_tier(tier, 2 * round(owed / 2))
        if round(owed) > 0 and not self.done and {RANDOM, SEARCH} & {*tiers}:
            self._play_tier(SEARCH if SEARCH in tiers else RANDOM, 2 * round(owed / 2))
        return AttackResult(self.player.scenario.id, rates(self.counts), self.hits, self.cpu, self.untried)

    def _play_tier(self, tier: str, rollouts: int) -> int:
        """Play attempts of one tier.

        Returns:
            The number of rollouts that were spent.
        """
        spent = 0
        if tier == SEARCH:
            while spent < rollouts and not self.done:
                self._search_step(spent)
                spent += 1
            return spent
        for attempt in self._attempts(tier):
            if spent >= rollouts or self.done:
                break
            if self.fatal[_first_move(attempt)] >= MAX_FATAL:
                continue
            node = None if attempt.stage is None else self.player.stage(attempt.stage)
            for raw in (False, True):
                if spent < rollouts and not self.done:
                    self._try(attempt, raw, node)
                    spent += 1
        return spent

    def _attempts(self, tier: str) -> Iterator[Attempt]:
        player = self.player
        if tier == RANDOM:
            count = 0
            while True:
                yield Attempt(RANDOM, draws.plan(player, self.seed, player.scenario.id, RANDOM, count))
                count += 1
        if tier == PRIOR:
            yield from guesses(self.priors)
            return
        if tier == MEMORY:
            yield from remembered(player)
            return
        lists = {
            SHORTCUT: shortcuts,
            CLOCK: timed,
            SERVO: servo,
            RETRY: retries,
            DETOUR: detours,
            FEEL: felt,
            FOREIGN: foreign,
            WITNESS: perturbed,
        }
        whole = list(lists[tier](player))
        for k in range(self.of):  # its own part first, then those of the others
            yield from islice(whole, (self.number + k) % self.of, None, self.of)

    def _search_step(self, count: int) -> None:
        """One rollout of the search: a variation of a success, or random moves from a rare state if there is none."""
        key = (self.seed, self.player.scenario.id, SEARCH, count)
        raw = bool(count % 2)
        if parent := self.archive.parent(raw, unit(*key, "parent")):
            _, node, macros = parent
            changed = tuple(draws.varied(one, *key, k) for k, one in enumerate(macros))
            if len(changed) > 1 and unit(*key, "drop") < 0.3:
                lost = int(len(changed) * unit(*key, "which"))
                changed = changed[:lost] + changed[lost + 1 :]
            self._try(Attempt(SEARCH, changed), raw, node)
            return
        rare = self.archive.rarest(raw, unit(*key, "state"))
        moves = tuple(draws.macro(self.player, *key, place) for place in range(1 + int(2 * unit(*key, "count"))))
        self._try(Attempt(SEARCH, moves), raw, rare.node if rare else None)

    def _try(self, attempt: Attempt, raw: bool, node: Node | None) -> Played:
        start = time.process_time()
        played = self.player.play(attempt.macros, raw, node)
        self.cpu += time.process_time() - start
        found = hit(self.player, attempt, raw, played, node, self.causal) if played.solved else None
        refuting = int(found is not None and found.refutes)
        self.counts.append(TierRate(attempt.tier, raw, 1, int(found is not None), refuting))
        if found:
            self.hits.append(found)
            self.archive.successes.append((found, node, attempt.macros))
            self.done = self.done or self.until(found)
        if attempt.tier == SHORTCUT and len(attempt.macros) == 1 and played.outcome == "timeout" and played.notes:
            self.untried.append(UntriedShortcut(attempt.macros[0].target, raw, played.notes[0]))
        if played.outcome == "failure" and not played.nodes:
            self.fatal[_first_move(attempt)] += 1
        for one in played.nodes:
            if one.seconds < self.player.horizon - MIN_TIME_LEFT:
                self.archive.add(ArchivedState(one, raw, one.signature))
        return played


def shortcuts(player: Player) -> Iterator[Attempt]:
    """The declared shortcuts, alone and in pairs, the second one from the end of the first."""
    names = list(player.scenario.shortcuts())
    for name in names:
        yield Attempt(SHORTCUT, (Macro("shortcut", name),))
    for first in names:
        for second in names:
            yield Attempt(SHORTCUT, (Macro("shortcut", first), Macro("shortcut", second)))


def _first_move(attempt: Attempt) -> tuple[int | None, str, str]:
    """The first move of an attempt: its state, its kind and arm, and its target or numbers."""
    if not attempt.macros:
        return attempt.stage, "", ""
    one = attempt.macros[0]
    if one.kind in ("pursue", "pin", "block", "cradle"):
        what = f"{one.target} {one.numbers}"
    else:
        what = str(one.numbers) if one.kind in ("follow", "answer", "clock", "shake", "turn", "move") else one.target
    return attempt.stage, f"{one.kind} {one.arm}", what
