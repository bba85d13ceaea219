"""Tier of the clock: the scenario's own solution, but each wait lasts as long as it does in training on average.

It shows whether the oracle's waits carry information: a robot that goes by the clock does not look at what it waits
for.
"""

from collections.abc import Iterator

import numpy as np

from .macros import Macro
from .player import Attempt, Player

CLOCK = "clock"
"""Tier of the clock."""
MIN_SPREAD = 0.3
"""Spread of the duration of a wait over training draws below which there is nothing to wait for [s]."""
SHARES = (0.5, 1.0, 0.0)
"""Quantiles of the training durations that are tried, the median first."""


def timed(player: Player) -> Iterator[Attempt]:
    """The own solution with the training durations of its waits; nothing if these vary by less than `MIN_SPREAD`."""
    own = player.trace.waits
    known = [times for times in player.durations if len(times) == len(own)]
    if len(known) < 3 or not own or np.ptp(known, axis=0).max() < MIN_SPREAD:
        return
    for share in SHARES:
        yield Attempt(CLOCK, (Macro("clock", "", tuple(map(float, np.quantile(known, share, axis=0)))),))
