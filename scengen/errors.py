"""Errors a user can act on. Each message says what was given, what is accepted, and the nearest name."""

import difflib
from collections.abc import Iterable, Mapping


class ScengenError(Exception):
    """Base class of every error raised on purpose by scengen."""


class BadConfig(ScengenError):
    """A configuration contradicts itself or its scenario class."""


class OutOfBounds(ScengenError):
    """A parameter lies outside the range in which its scenario has a physical meaning."""

    def __init__(self, where: str, value: object, low: float, high: float, unit: str):
        super().__init__(f"{where} = {value} {unit}; it must lie in [{low:g}, {high:g}] {unit}")


class UnknownName(ScengenError):
    """A name was asked for that does not exist; the message lists the ones that do."""

    def __init__(self, kind: str, name: str, known: Iterable[str]):
        names = sorted(known)
        super().__init__(f"no {kind} named {name!r}{nearest(name, names)}; known: {', '.join(names) or '(none)'}")


class Infeasible(ScengenError):
    """No draw satisfied the scenario's own constraints."""

    def __init__(self, where: str, tries: int, reasons: Mapping[str, int]):
        self.tries, self.reasons = tries, dict(reasons)
        told = "; ".join(f"{n}x {reason}" for reason, n in sorted(reasons.items(), key=lambda x: -x[1]))
        super().__init__(f"{where}: none of {tries} draws was feasible ({told}); widen the distributions")


class PoolError(ScengenError):
    """A pool is missing, damaged, locked, or does not belong to the run that wants to write it."""


class Unstable(ScengenError):
    """MuJoCo raised a warning, so that nothing simulated after it means anything."""


class NoOracle(ScengenError):
    """A family without a scripted solution was asked for one."""

    def __init__(self, family: str):
        super().__init__(f"{family} has no oracle; write its method oracle(world), see CONTRIBUTING.md")


class GaveUp(ScengenError):
    """A move did not reach its end condition in time."""


def nearest(name: str, known: Iterable[str]) -> str:
    """The clause ` (did you mean 'x'?)`, or nothing when no known name is close."""
    close = difflib.get_close_matches(name, list(known), n=1, cutoff=0.6)
    return f" (did you mean {close[0]!r}?)" if close else ""


def at_least(settings: object, **lowest: float) -> None:
    """Raise `BadConfig` for the first of the named settings that is less than its lowest value; None passes."""
    for name, low in lowest.items():
        value = getattr(settings, name)
        if value is not None and value < low:
            raise BadConfig(f"{name} = {value}; it must be at least {low:g}")
