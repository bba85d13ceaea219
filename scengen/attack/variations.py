"""Tiers of witnesses: one with a phase dropped, repeated, mirrored, slowed or accelerated; one of another scenario."""

from collections.abc import Iterator

from .macros import Macro
from .player import Attempt, Player

WITNESS = "witness"
"""Tier of variations of the scenario's own witness."""
FOREIGN = "foreign"
"""Tier of witnesses of other scenarios."""

PACES = (0.4, 2.5)
"""Paces of a slowed and an accelerated phase [times the speed of the witness]."""
NO_SHIFT = (0.0, 0.0, 0.0)
"""No displacement [m]."""


def perturbed(player: Player) -> Iterator[Attempt]:
    """Every phase of the witness changed in one way, from the state at which it starts, the last phases first."""
    count = player.phases
    for k in reversed(range(count)):
        yield Attempt(WITNESS, rest(player, k + 1), k)
        yield Attempt(WITNESS, (phase(player, k, mirrored=True), *rest(player, k + 1)), k)
        yield Attempt(WITNESS, (phase(player, k), phase(player, k), *rest(player, k + 1)), k)
        for pace in PACES:
            yield Attempt(WITNESS, (phase(player, k, pace), *rest(player, k + 1)), k)
    for k in range(count - 1):  # two phases change places
        yield Attempt(WITNESS, (phase(player, k + 1), phase(player, k), *rest(player, k + 2)), k)
    for pace in PACES:
        yield Attempt(WITNESS, tuple(phase(player, k, pace) for k in range(len(player.trace.phases))))


def at_another_pace(player: Player, attempt: Attempt) -> bool:
    """Whether an attempt makes all moves of the witness in their order, at any pace, and nothing else."""
    first, last = player.trace.phases[attempt.stage or 0][0], player.trace.phases[-1][1]
    for macro in attempt.macros:
        if macro.kind != "follow" or any(macro.numbers[3:]) or macro.numbers[0] != first:
            return False
        first = macro.numbers[1]
    return first == last


def foreign(player: Player) -> Iterator[Attempt]:
    """The unchanged witnesses of other scenarios: pure memory."""
    for name in player.foreign:
        yield Attempt(FOREIGN, (Macro("replay", name),))


def phase(
    player: Player, k: int, pace: float = 1.0, mirrored: bool = False, shift: tuple[float, ...] = NO_SHIFT
) -> Macro:
    """A macro that repeats phase `k` of the witness.

    Args:
        pace: speed [times the speed of the witness].
        mirrored: whether left and right are exchanged.
        shift: displacement of the whole phase [m].
    """
    first, last = player.trace.phases[k]
    return Macro("follow", "", (float(first), float(last), pace, float(mirrored), *shift))


def rest(player: Player, k: int) -> tuple[Macro, ...]:
    """The phases of the witness from `k` on, as one macro; none if the witness has fewer phases."""
    phases = player.trace.phases
    if k >= len(phases):
        return ()
    return (stretch(phases[k][0], phases[-1][1]),)


def stretch(first: int, last: int) -> Macro:
    """A macro that repeats the witness from one row to another."""
    return Macro("follow", "", (float(first), float(last), 1.0, 0.0, *NO_SHIFT))
