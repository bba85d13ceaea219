"""A run's indices drawn again: what a manifest counts follows from them, from its rows, and from its reasons."""

import itertools
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from ..certificate import CHECKS, STAGES
from ..errors import Infeasible
from ..pool.pool import PROCESS, Pool, PoolRow, uncounted
from .claims import Claims

CHUNK = 50
"""Indices that one worker draws at a time."""
MOST, MOST_PER_ROW = 10_000, 2000
"""Draws beyond which a manifest is too large to be drawn again, and how many more for every certified scenario: a run
gives up far earlier, and a draw takes 0.5 to 14 ms."""
ROWS_IN_TIME = 1000
"""For how many scenarios their indices may together be drawn in the time that verification gives to one."""


@dataclass(frozen=True)
class Drawn:
    """What came of one index."""

    proposals: int
    infeasible: Mapping[str, int]
    """Infeasible draws by reason."""
    feasible: bool


@dataclass
class Survey:
    """What came of the indices that have been drawn again so far."""

    indices: int = 0
    proposals: int = 0
    feasible: int = 0
    """Indices that gave a feasible scenario."""
    infeasible: Counter[str] = field(default_factory=Counter)
    """Infeasible draws by reason."""
    left: list[int] = field(default_factory=list)
    """Indices with a feasible scenario that was not certified."""

    def add(self, found: Mapping[int, Drawn], certified: Collection[int]) -> None:
        """Count some more.

        Args:
            certified: all indices that were.
        """
        for index, drawn in found.items():
            self.indices += 1
            self.proposals += drawn.proposals
            self.feasible += drawn.feasible
            self.infeasible.update({f"feasible: {why}": times for why, times in drawn.infeasible.items()})
            if drawn.feasible and index not in certified:
                self.left.append(index)


def draw_again(indices: Sequence[int], claims: Claims) -> dict[int, Drawn]:
    """Draw some indices of a run again, up to the first feasible scenario of each."""
    found, design = {}, claims.task.design(claims.sampler)
    for index in indices:
        try:
            draw = claims.task.draw(claims.split, claims.seed, index, design)
            found[index] = Drawn(draw.attempt + 1, dict(draw.rejected), True)
        except Infeasible as error:
            found[index] = Drawn(error.tries, dict(error.reasons), False)
    return found


def chunks(count: int) -> Iterator[range]:
    """The indices of a run in pieces."""
    return (range(start, min(start + CHUNK, count)) for start in range(0, count, CHUNK))


def too_large(pool: Pool) -> str:
    """Why the indices of a pool are not drawn again; empty if they are."""
    most = MOST + MOST_PER_ROW * len(pool)
    for count, what in ((pool.indices, "indices"), (pool.funnel.get("proposed", 0), "draws")):
        if count > most:
            return f"{count} {what} for {len(pool)} scenarios are too many to draw again"
    return ""


def patience(pool: Pool, seconds: float) -> float:
    """How long drawing all indices of a pool again may take [s].

    Args:
        seconds: what one scenario may take.
    """
    return seconds * (1 + len(pool) // ROWS_IN_TIME)


def too_many(pool: Pool, indices: int, proposals: int) -> str:
    """Why what has been drawn so far, `proposals` at `indices`, cannot be what a manifest counts; empty if it can."""
    told = pool.funnel.get("proposed", 0)
    if proposals <= told:
        return ""
    return f"the funnel tells of {told} draws; {indices} of its {pool.indices} indices alone give {proposals}"


def wrong_order(indices: Sequence[int], pool: Pool) -> Iterator[str]:
    """Where the indices of the rows cannot be those of a run, or their number.

    Args:
        indices: in the order of the rows, each larger than the one before.
    """
    if len(indices) != len(pool):
        yield f"the manifest promises {len(pool)} scenarios, the shards hold {len(indices)}"
    if len(indices) > pool.manifest["n"]:
        yield f"the manifest says n = {pool.manifest['n']}, the shards hold {len(indices)} scenarios"
    if not pool.chosen and len(indices) == pool.manifest["n"] > 0 and indices[-1] != pool.indices - 1:
        yield f"the manifest counts {pool.indices} indices, but a run ends with the last scenario, index {indices[-1]}"


def wrong_funnel(pool: Pool, certified: int, first: int, drawn: Survey) -> Iterator[str]:
    """Where funnel, reasons and counts of a manifest do not follow from its rows and from what was drawn again.

    Args:
        certified: how many rows there are.
        first: how many of them are first draws.
        drawn: every index of the run.
    """
    infeasible, failed = drawn.infeasible, Counter[str]()
    told = {key: times for key, times in pool.reasons.items() if key.startswith("feasible: ")}
    if told != dict(infeasible):
        yield f"the reasons of infeasible draws are not those that come out again, {_told(infeasible)}"
    for key, times in pool.reasons.items():
        name = key.partition(": ")[0]
        if name not in (*CHECKS, PROCESS):
            yield f"the reasons name a check {name[:40]!r} that nobody makes"
        elif name != "feasible":
            failed[name] += times
    left = drawn.feasible - certified
    if failed.total() != left:
        yield f"the reasons tell of {failed.total()} rejected scenarios, and {left} were drawn and not certified"
    order = [*reversed(CHECKS)]
    failed["compiles"] += failed.pop(PROCESS, 0)  # such a scenario is feasible, and got through nothing else
    expected = {"proposed": drawn.proposals}
    for stage, checks in STAGES.items():
        expected[stage] = certified + sum(n for k, n in failed.items() if order.index(k) < order.index(checks[-1]))
    if dict(pool.funnel) != expected:
        yield f"the funnel is not what comes out again, {expected}"
    if pool.manifest["first_draws"] != first:
        yield f"first_draws = {pool.manifest['first_draws']}, and {first} first draws were certified"


def wrong_subset(pool: Pool) -> Iterator[str]:
    """Where the counts of a subset contradict each other; those of the pool it was chosen from cannot be made again."""
    if pool.manifest["n"] != len(pool) or len(pool) > pool.funnel.get("certified", 0):
        yield "the subset has another number of scenarios than it says, or more than were certified"
    if list(pool.funnel) and set(pool.funnel) != {"proposed", *STAGES}:
        yield "the funnel has other steps than those of a run"


@dataclass(frozen=True)
class Reject:
    """What is counted of a scenario that was kept although it was not certified."""

    index: int
    reason: str
    """Why it was not, as the reasons of a manifest count it."""

    @classmethod
    def of(cls, row: PoolRow) -> "Reject":
        """That of a row."""
        return cls(row.index, uncounted(row.certificate.reason))


def wrong_rejects(pool: Pool, kept: Sequence[Reject], certified: Collection[int]) -> Iterator[str]:
    """Where the kept rejects are not those of the reasons.

    Args:
        certified: the indices of the rows.
    """
    indices = [reject.index for reject in kept]
    if any(a >= b for a, b in itertools.pairwise(indices)):
        yield "the rejects do not stand in the order of their indices, each once"
    if both := {index for index in indices if index in certified}:
        yield f"index {min(both)} is a reject, and certified too"
    expected = {
        key: times
        for key, times in pool.reasons.items()
        if (name := key.partition(": ")[0]) not in ("feasible", "attack")  # of which nothing is kept
        and CHECKS.get(name) in pool.manifest["config"]["keep"]
    }
    if Counter(reject.reason for reject in kept) != expected:
        yield f"{len(kept)} rejects are kept; by keep= and the reasons it should be {_told(expected)}"


def wrong_losses(pool: Pool, again: Mapping[int, str]) -> Iterator[str]:
    """Where the reasons of a manifest are not those for which its other feasible scenarios fail here.

    A scenario that had ended its process, or reached a limit of its author's machine, may come to any end; so may one
    that an attack on the finished pool has refuted, of which no certificate knows.

    Args:
        again: why each of them is not certified, by index; empty for one that is.
    """
    told = Counter({key: times for key, times in pool.reasons.items() if not key.startswith("feasible: ")})
    free = (PROCESS, "attack") if "attack" in pool.manifest else (PROCESS,)
    lost = sum(told.pop(key) for key in list(told) if key.partition(": ")[0] in free)
    found = Counter(again.values())
    if (missing := told - found) or (found - told).total() > lost:
        certified = f"; {found['']} of them are certified here" if found[""] else ""
        yield f"certified again, scenarios that it left out fail otherwise than it tells, {_told(missing)}{certified}"


def wrong_attack(pool: Pool) -> Iterator[str]:
    """Where an attack on the finished pool has left out more scenarios than it has hits that show a way around."""
    hits = pool.manifest.get("attack", {}).get("hits", [])
    shown = {str(hit.get("scenario")) for hit in hits if hit.get("lacks")}
    told = sum(times for key, times in pool.reasons.items() if key.startswith("attack: "))
    if "attack" in pool.manifest and not pool.manifest["config"]["certify"].get("attack") and told > len(shown):
        yield f"the attack has refuted {told} scenarios, and shows a way around {len(shown)} of them"


def _told(counts: Mapping[str, int]) -> str:
    return str(dict(itertools.islice(counts.items(), 5)))[:500]
