"""Tier of perturbed witnesses: a phase dropped, repeated, mirrored, slowed or quickened; another scenario's witness."""

from collections.abc import Iterator

from .macros import Macro
from .player import Attempt, Player

WITNESS, FOREIGN = "witness", "foreign"

PACES = (0.4, 2.5)
"""Slowed and quickened: times the speed of the witness."""
NOWHERE = (0.0, 0.0, 0.0)
"""No displacement."""


def perturbed(player: Player) -> Iterator[Attempt]:
    """Every phase of the witness changed in one way, from the state at which it begins; the last phases first."""
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


def foreign(player: Player) -> Iterator[Attempt]:
    """The witnesses of other scenarios, as they are: memory alone."""
    for name in player.foreign:
        yield Attempt(FOREIGN, (Macro("replay", name),))


def phase(
    player: Player, k: int, pace: float = 1.0, mirrored: bool = False, shift: tuple[float, ...] = NOWHERE
) -> Macro:
    """Phase `k` of the witness once more."""
    first, last = player.trace.phases[k]
    return Macro("follow", "", (float(first), float(last), pace, float(mirrored), *shift))


def rest(player: Player, k: int) -> tuple[Macro, ...]:
    """The phases of the witness from `k` on, as one."""
    phases = player.trace.phases
    if k >= len(phases):
        return ()
    return (Macro("follow", "", (float(phases[k][0]), float(phases[-1][1]), 1.0, 0.0, 0.0, 0.0, 0.0)),)
