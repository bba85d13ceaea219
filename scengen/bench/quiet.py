"""Whether the machine was quiet while costs were measured."""

from collections.abc import Mapping
from pathlib import Path

from .timing import Measure

MAX_SPREAD = 0.1
"""Largest spread of a measure, as a share of its median, of a quiet machine. Twice what an idle one shows."""
MAX_LOAD = 0.5
"""Largest load average at the start of a run on a quiet machine [processes]."""
MAX_WAIT = 0.05
"""Largest share of its time for which the run waits for a core on a quiet machine."""
SCHEDULED = Path("/proc/self/schedstat")
"""File in which Linux says for how long a process has run, and has waited for a core [ns]."""


def scheduled() -> tuple[float, float]:
    """Time for which this process has run, and for which it has waited for a core [ns]; 0 where Linux does not say."""
    try:
        ran, waited = SCHEDULED.read_text().split()[:2]
        return float(ran), float(waited)
    except (OSError, ValueError):
        return 0.0, 0.0


def disturbance(load: float, waiting: float, ratios: Mapping[str, Measure]) -> str:
    """Reason why the machine was not quiet; empty if it was.

    Args:
        load: load average at the start [processes].
        waiting: share of the run's time for which it waited for a core.
        ratios: the measured ratios.
    """
    parts = []
    if load > MAX_LOAD:
        parts.append(f"its load average was {load:.1f} at the start")
    if waiting > MAX_WAIT:
        parts.append(f"the run waited for a core in {waiting:.0%} of the time")
    wide = [name for name, ratio in ratios.items() if ratio.spread > MAX_SPREAD * ratio.median]
    if wide:
        parts.append(f"{', '.join(wide)} spread by more than {MAX_SPREAD:.0%}")
    return "; ".join(parts)
