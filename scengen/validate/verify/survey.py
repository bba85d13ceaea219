"""The indices of a run drawn again, and the counts of a manifest compared with them, its rows and its reasons."""

import itertools
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from ...certificate import CHECKS, STAGES
from ...errors import Infeasible
from ...pool import PoolRow
from ...pool.manifest import PROCESS, Manifest, without_numbers
from .claims import Claims

CHUNK = 50
"""Number of indices that one worker draws at a time."""
MAX_DRAWS = 10_000
"""Number of draws beyond which a manifest without scenarios is not drawn again; a draw takes 0.5 to 14 ms."""
MAX_DRAWS_PER_ROW = 2000
"""Number of further draws allowed for every certified scenario; a run gives up far earlier."""
ROWS_IN_TIME = 1000
"""Number of scenarios whose indices may together be drawn in the time that verification gives to one scenario."""


@dataclass(frozen=True)
class Drawn:
    """Result of drawing one index again."""

    proposals: int
    """Number of draws."""
    infeasible: Mapping[str, int]
    """Number of infeasible draws by reason."""
    feasible: bool
    """Whether the last draw was feasible."""


@dataclass
class Survey:
    """Counts over the indices that have been drawn again so far."""

    indices: int = 0
    proposals: int = 0
    """Number of draws."""
    feasible: int = 0
    """Number of indices that gave a feasible scenario."""
    infeasible: Counter[str] = field(default_factory=Counter)
    """Number of infeasible draws by reason."""
    left_out: list[int] = field(default_factory=list)
    """Indices with a feasible scenario that was not certified."""

    def add(self, found: Mapping[int, Drawn], certified: Collection[int]) -> None:
        """Count some more indices.

        Args:
            certified: all indices that were certified.
        """
        for index, drawn in found.items():
            self.indices += 1
            self.proposals += drawn.proposals
            self.feasible += drawn.feasible
            self.infeasible.update({f"feasible: {why}": times for why, times in drawn.infeasible.items()})
            if drawn.feasible and index not in certified:
                self.left_out.append(index)


def draw_again(indices: Sequence[int], claims: Claims) -> dict[int, Drawn]:
    """Draw some indices of a run again, up to the first feasible scenario of each."""
    found = {}
    for index in indices:
        try:
            draw = claims.draw(index)
            found[index] = Drawn(draw.attempt + 1, dict(draw.rejected), True)
        except Infeasible as error:
            found[index] = Drawn(error.tries, dict(error.reasons), False)
    return found


def chunks(count: int) -> Iterator[range]:
    """The indices of a run in pieces."""
    return (range(start, min(start + CHUNK, count)) for start in range(0, count, CHUNK))


def too_large(manifest: Manifest) -> str:
    """Reason why the indices of a pool are not drawn again; empty if they are."""
    most = MAX_DRAWS + MAX_DRAWS_PER_ROW * manifest.scenarios
    for count, what in ((manifest.indices, "indices"), (manifest.funnel.get("proposed", 0), "draws")):
        if count > most:
            return f"{count} {what} for {manifest.scenarios} scenarios are too many to draw again; at most {most} are"
    return ""


def patience(scenarios: int, seconds: float) -> float:
    """Time limit for drawing all indices of a pool again [s].

    Args:
        scenarios: number of scenarios of the pool.
        seconds: time limit of one scenario [s].
    """
    return seconds * (1 + scenarios // ROWS_IN_TIME)


def too_many(manifest: Manifest, indices: int, proposals: int) -> str:
    """Reason why the draws so far contradict the count of a manifest; empty if they do not.

    Args:
        indices: number of indices drawn so far.
        proposals: number of draws at these indices.
    """
    told = manifest.funnel.get("proposed", 0)
    if proposals <= told:
        return ""
    return f"the funnel counts {told} draws; {indices} of its {manifest.indices} indices alone give {proposals}"


def wrong_order(indices: Sequence[int], manifest: Manifest) -> Iterator[str]:
    """Faults of the number of rows and of their indices.

    Args:
        indices: indices in the order of the rows, each larger than the previous one.
    """
    count, n = len(indices), manifest.n
    if count != manifest.scenarios:
        yield f"the manifest promises {manifest.scenarios} scenarios, the shards hold {count}"
    if count > n:
        yield f"the manifest says n = {n}, the shards hold {count} scenarios"
    if not manifest.is_subset and count == n > 0 and indices[-1] != manifest.indices - 1:
        yield f"the manifest counts {manifest.indices} indices, but a run ends with its last scenario, {indices[-1]}"


def wrong_funnel(manifest: Manifest, certified: int, first: int, drawn: Survey) -> Iterator[str]:
    """Faults of funnel, reasons and counts of a manifest, given its rows and what was drawn again.

    Args:
        certified: number of rows.
        first: number of rows that are first draws.
        drawn: every index of the run.
    """
    infeasible, failed = drawn.infeasible, Counter[str]()
    told = {key: times for key, times in manifest.reasons.items() if key.startswith("feasible: ")}
    if told != dict(infeasible):
        yield f"the reasons of infeasible draws differ from those of the draws made again, {shown(infeasible)}"
    for key, times in manifest.reasons.items():
        name = key.partition(": ")[0]
        if name not in (*CHECKS, PROCESS):
            yield f"the reasons name {name[:40]!r}, which is not a check"
        elif name != "feasible":
            failed[name] += times
    left_out = drawn.feasible - certified
    if failed.total() != left_out:
        yield f"the reasons count {failed.total()} rejected scenarios, but {left_out} were drawn and not certified"
    order = [*reversed(CHECKS)]
    failed["compiles"] += failed.pop(PROCESS, 0)  # such a scenario is feasible, and got through no other step
    expected = {"proposed": drawn.proposals}
    for stage, checks in STAGES.items():
        expected[stage] = certified + sum(n for k, n in failed.items() if order.index(k) < order.index(checks[-1]))
    if dict(manifest.funnel) != expected:
        yield f"the funnel differs from the one that follows from rows, reasons and draws, {expected}"
    if manifest.first_draws != first:
        yield f"first_draws = {manifest.first_draws}, but {first} first draws were certified"


def wrong_subset(manifest: Manifest) -> Iterator[str]:
    """Contradictions in the counts of a subset; the counts of the pool that it was chosen from cannot be repeated."""
    scenarios, funnel = manifest.scenarios, manifest.funnel
    if manifest.n != scenarios or scenarios > funnel.get("certified", 0):
        yield "the subset has a different number of scenarios than it says, or more than were certified"
    if list(funnel) and set(funnel) != {"proposed", *STAGES}:
        yield "the funnel has other steps than that of a run"


@dataclass(frozen=True)
class Reject:
    """Counts about a scenario that was kept although it was not certified."""

    index: int
    reason: str
    """Reason why it was not certified, as the reasons of a manifest count it."""

    @classmethod
    def of(cls, row: PoolRow) -> "Reject":
        """The reject of a row."""
        return cls(row.index, without_numbers(row.certificate.reason))


def wrong_rejects(manifest: Manifest, kept: Sequence[Reject], certified: Collection[int]) -> Iterator[str]:
    """Differences between the kept rejects and the reasons of a manifest.

    Args:
        certified: the indices of the rows.
    """
    indices = [reject.index for reject in kept]
    if any(a >= b for a, b in itertools.pairwise(indices)):
        yield "the rejects are not in the order of their indices, each once"
    if both := {index for index in indices if index in certified}:
        yield f"index {min(both)} is a reject, and certified too"
    expected = {
        key: times
        for key, times in manifest.reasons.items()
        if (name := key.partition(": ")[0]) not in ("feasible", "attack")  # of which nothing is kept
        and CHECKS.get(name) in manifest.config.keep
    }
    if Counter(reject.reason for reject in kept) != expected:
        yield f"{len(kept)} rejects are kept; by keep= and the reasons it should be {shown(expected)}"


def wrong_losses(manifest: Manifest, again: Mapping[int, str]) -> Iterator[str]:
    """Differences between the reasons of a manifest and those for which the scenarios that it left out fail here.

    A scenario that had ended its process, or reached a limit of its author's machine, may have any result. The same
    holds for one that an attack on the finished pool has refuted, because no certificate knows of the attack.

    Args:
        again: reason why each of these scenarios is not certified here, by index; empty for one that is.
    """
    told = {key: times for key, times in manifest.reasons.items() if not key.startswith("feasible: ")}
    free = {PROCESS} if manifest.attack is None else {PROCESS, "attack"}
    if why := unlike(told, Counter(again.values()), free):
        yield f"certified again, scenarios that it left out fail for other reasons than {why}"


def unlike(reasons: Mapping[str, int], again: Counter[str], free: Collection[str]) -> str:
    """How counted reasons differ from those of what was made again, as text; empty if they do not.

    Args:
        again: number by reason of what was made again; "" counts successes.
        free: checks that cannot be repeated: what they count may have any result.
    """
    told = Counter(reasons)
    lost = sum(told.pop(key) for key in list(told) if key.partition(": ")[0] in free)
    if not (missing := told - again) and (again - told).total() <= lost:
        return ""
    return shown(missing) + (f"; {again['']} of them succeed here" if again[""] else "")


def wrong_attack(manifest: Manifest) -> Iterator[str]:
    """Whether an attack on the finished pool has left out more scenarios than it has hits that show a way around."""
    shown = {str(hit.get("scenario")) for hit in manifest.hits if hit.get("lacks") or hit.get("otherwise")}
    told = sum(times for key, times in manifest.reasons.items() if key.startswith("attack: "))
    if manifest.attack is not None and not manifest.config.certify.get("attack") and told > len(shown):
        yield f"the attack has refuted {told} scenarios, but shows a way around {len(shown)} of them"


def shown(counts: Mapping[str, int]) -> str:
    """The first of some counts, for messages."""
    return str(dict(itertools.islice(counts.items(), 5)))[:500]
