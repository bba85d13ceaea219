"""Certificates as text: the numbers of each check as people read them, with units and at most three digits."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from ..certificate import Check

Numbers = Mapping[str, Any]
"""Numbers of a check."""

RESULTS = {True: "yes", False: "NO", None: "skipped"}
"""Words for whether a check passed."""


def lines(checks: tuple[Check, ...]) -> Iterator[tuple[str, str, str]]:
    """A line for each check, and an indented one for each shortcut and each ablation: name, whether it passed, what it
    has found."""
    for check in checks:
        yield check.name, "nothing to check" if check.waived else RESULTS[check.passed], check.reason or found(check)
        yield from ((f"  {name}", "", told) for name, told in _parts(check))


def found(check: Check) -> str:
    """What a check that passed has found, as text; its numbers by name if nothing else fits them."""
    try:
        return WORDS[check.name](check.settings, check.numbers)
    except (KeyError, TypeError, ValueError):  # a pool may hold anything
        return plain(check.numbers)


def plain(numbers: Numbers) -> str:
    """Numbers by name."""
    return ", ".join(f"{name} {_number(value)}" for name, value in numbers.items())


def _number(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _feasible(_: Numbers, numbers: Numbers) -> str:
    return f"no constraint is violated; {plain(numbers)}" if numbers else "no constraint is violated"


def _compiles(_: Numbers, numbers: Numbers) -> str:
    return f"{numbers['bodies']} bodies, {numbers['geoms']} geoms, {numbers['coordinates']} coordinates"


def _overlap(_: Numbers, numbers: Numbers) -> str:
    return f"deepest contact {1000 * numbers['deepest']:.3f} mm"


def _rest(limits: Numbers, numbers: Numbers) -> str:
    moved = f"bodies move {1000 * numbers['drift']:.3f} mm and turn {numbers['turn']:.3f} deg at most"
    return f"{moved} in {limits['seconds']:g} s without actions"


def _idle(_: Numbers, numbers: Numbers) -> str:
    return f"doing nothing: {_ending(numbers)}"


def _solved(_: Numbers, numbers: Numbers) -> str:
    return f"the oracle reaches the goal after {numbers['seconds']:g} s"


def _robust(_: Numbers, numbers: Numbers) -> str:
    counts = f"{numbers['solved']} of {numbers['runs']} jittered runs succeed"
    failures = "".join(f"; {failure}" for failure in numbers["failures"])
    return f"{counts}: at least {numbers['bound']:.0%} of all, with 95 % confidence{failures}"


def _numerics(_: Numbers, numbers: Numbers) -> str:
    return "; ".join(
        f"{name.replace('_', ' ')}: {', '.join(f'{who} {outcome}' for who, outcome in ends.items())}"
        for name, ends in numbers.items()
    )


def _witness(_: Numbers, numbers: Numbers) -> str:
    return (
        f"{numbers['periods']} recorded actions reach the goal after {numbers['seconds']:g} s, and end in the same bits"
    )


def _tried(what: str) -> Callable[[Numbers, Numbers], str]:
    def told(_: Numbers, numbers: Numbers) -> str:
        return f"{len(numbers)} {what}{'' if len(numbers) == 1 else 's'} tried; none reaches the goal"

    return told


WORDS: Mapping[str, Callable[[Numbers, Numbers], str]] = {
    "feasible": _feasible,
    "compiles": _compiles,
    "overlap": _overlap,
    "rest": _rest,
    "unsolved": lambda *_: "the goal does not hold at the start",
    "idle": _idle,
    "shortcuts": _tried("shortcut"),
    "solved": _solved,
    "robust": _robust,
    "numerics": _numerics,
    "ablations": _tried("ablation"),
    "witness": _witness,
}
"""Words for what each check has found, from its settings and its numbers."""


def _parts(check: Check) -> Iterator[tuple[str, str]]:
    """Each shortcut, and each ablation, with how it ended."""
    for name, ends in check.numbers.items() if check.name in ("shortcuts", "ablations") else ():
        try:
            yield name, _ending(ends) if check.name == "ablations" else _endings(ends)
        except (KeyError, TypeError, AttributeError, ValueError):  # a pool may hold anything
            yield name, str(ends)


def _endings(ends: Mapping[str, Numbers]) -> str:
    """How a shortcut ended in each of its ways, `filtered` and `raw`; equal ends are named once."""
    kinds = {(end["reason"], end["outcome"]) for end in ends.values()}
    if len(kinds) > 1:
        return "; ".join(f"{how}: {_ending(end)}" for how, end in ends.items())
    ((reason, outcome),) = kinds
    times = ", ".join(f"{how} after {end['seconds']:.3g} s" for how, end in ends.items())
    return f"{reason or outcome} ({outcome}, {times})"


def _ending(end: Numbers) -> str:
    """How a rollout ended, as text."""
    return f"{end['reason'] or end['outcome']} ({end['outcome']} after {end['seconds']:.3g} s)"
