"""The attack on one scenario: every tier gets its share of rollouts, and the archive decides where the rest goes."""

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice

from ..samplers.keyed import unit
from . import draws
from .evidence import Causal, Hit, TierRate, hit, rates
from .macros import Macro
from .player import Attempt, Node, Played, Player
from .priors import Prior, guesses
from .retries import RETRY, retries
from .signature import Signature
from .variations import FOREIGN, WITNESS, foreign, perturbed

SHORTCUT, PRIOR, RANDOM, SEARCH = "shortcut", "prior", "random", "search"
SHARES = {SHORTCUT: 0.10, PRIOR: 0.10, RETRY: 0.30, FOREIGN: 0.08, WITNESS: 0.14, RANDOM: 0.14, SEARCH: 0.14}
"""Share of the rollouts that each tier gets, in the order in which they are played. What a tier does not use goes to
the last one."""
TIERS = tuple(SHARES)
FATAL = 2
"""A first move that has lost the episode this often is not tried again."""
LEFT = 2.0
"""An episode with less time left than this is not continued [s]."""


@dataclass(frozen=True)
class UntriedShortcut:
    """A shortcut that was not carried out: a move of it gave up, so that nothing is known about it."""

    name: str
    raw: bool
    reason: str


@dataclass
class AttackResult:
    """What came of the attack on one scenario."""

    scenario: str
    rates: list[TierRate]
    hits: list[Hit]
    cpu: float
    """Processor time of the rollouts of the adversary [s]."""
    untried: list[UntriedShortcut]
    lost: str = ""
    """Why the attack did not come to its end: the process crashed, or reached a limit."""


@dataclass(frozen=True)
class ArchivedState:
    """A state of the archive."""

    node: Node
    raw: bool
    signature: Signature


@dataclass
class Archive:
    """What has been reached, by contacts and displacements: successes first, else what is rare."""

    cells: dict[tuple[bool, Signature], list[ArchivedState]] = field(default_factory=dict)
    visits: Counter[tuple[bool, Signature]] = field(default_factory=Counter)
    successes: list[tuple[Hit, Node | None, tuple[Macro, ...]]] = field(default_factory=list)
    """Each with where it began, and its macros."""

    def add(self, cell: ArchivedState) -> None:
        """Keep a state; of many alike the latest ones."""
        key = (cell.raw, cell.signature)
        self.visits[key] += 1
        self.cells[key] = [*self.cells.get(key, []), cell][-4:]

    def rarest(self, raw: bool, number: float) -> ArchivedState | None:
        """A state of the cell that was visited least, on the way of raw or of filtered actions."""
        keys = [key for key in self.cells if key[0] == raw]
        if not keys:
            return None
        chosen = min(keys, key=lambda key: self.visits[key])
        self.visits[chosen] += 1
        return self.cells[chosen][int(number * len(self.cells[chosen]))]

    def parent(self, raw: bool, number: float) -> tuple[Hit, Node | None, tuple[Macro, ...]] | None:
        """One of the successes that are farthest from the witness; none that does all that the witness does."""
        known = [one for one in self.successes if one[0].raw == raw and one[0].refutes]
        most = max((len(hit.lacks) for hit, _, _ in known), default=0)
        far = [one for one in known if len(one[0].lacks) == most]
        return far[int(number * len(far))] if far else None


class Attack:
    """The adversary at work on one scenario."""

    def __init__(
        self,
        player: Player,
        seed: int,
        number: int = 0,
        of: int = 1,
        priors: Sequence[Prior] = (),
        until: Callable[[Hit], bool] = lambda hit: False,
    ):
        """`number` of `of`: which part of the tiers that are lists this scenario takes. `until`: stop at such a hit."""
        self.player, self.seed, self.number, self.of, self.priors, self.until = player, seed, number, of, priors, until
        self.causal = Causal(player)
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
        total = sum(SHARES[tier] for tier in tiers)
        owed = 0.0
        for tier in (t for t in TIERS if t in tiers):
            owed += budget * SHARES[tier] / total
            owed -= self._tier(tier, 2 * round(owed / 2))
        if round(owed) > 0 and not self.done and {RANDOM, SEARCH} & {*tiers}:
            self._tier(SEARCH if SEARCH in tiers else RANDOM, 2 * round(owed / 2))
        return AttackResult(self.player.scenario.id, rates(self.counts), self.hits, self.cpu, self.untried)

    def _tier(self, tier: str, rollouts: int) -> int:
        """Play attempts of one tier; returns how many rollouts that took."""
        spent = 0
        if tier == SEARCH:
            while spent < rollouts and not self.done:
                self._step(spent)
                spent += 1
            return spent
        for attempt in self._attempts(tier):
            if spent >= rollouts or self.done:
                break
            if self.fatal[_first(attempt)] >= FATAL:
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
        lists = {SHORTCUT: shortcuts, RETRY: retries, WITNESS: perturbed, FOREIGN: foreign}
        whole = list(lists[tier](player))
        for k in range(self.of):  # its own part first, then those of the others
            yield from islice(whole, (self.number + k) % self.of, None, self.of)

    def _step(self, count: int) -> None:
        """One rollout of the search: from a success a variation of it, else from what is rare something random."""
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
        cell = self.archive.rarest(raw, unit(*key, "state"))
        moves = tuple(draws.macro(self.player, *key, place) for place in range(1 + int(2 * unit(*key, "count"))))
        self._try(Attempt(SEARCH, moves), raw, cell.node if cell else None)

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
            self.fatal[_first(attempt)] += 1
        for one in played.nodes:
            if one.seconds < self.player.horizon - LEFT:
                self.archive.add(ArchivedState(one, raw, one.signature))
        return played


def shortcuts(player: Player) -> Iterator[Attempt]:
    """The declared shortcuts, alone and in sequence, each from where the former ended."""
    names = list(player.scenario.shortcuts())
    for name in names:
        yield Attempt(SHORTCUT, (Macro("shortcut", name),))
    for first in names:
        for second in names:
            yield Attempt(SHORTCUT, (Macro("shortcut", first), Macro("shortcut", second)))


def _first(attempt: Attempt) -> tuple[int | None, str, str]:
    """What an attempt begins with: moves of the same kind on the same thing, from the same state."""
    if not attempt.macros:
        return attempt.stage, "", ""
    one = attempt.macros[0]
    what = str(one.numbers) if one.kind in ("follow", "answer", "shake", "turn", "move") else one.target
    return attempt.stage, f"{one.kind} {one.arm}", what
