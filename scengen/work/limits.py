"""Limits of the settings that command lines give."""

from ..errors import BadConfig, cut

MAX_SETTINGS = {
    "budget": 10_000_000,
    "any_n": 1_000_000,
    "axis_n": 100_000,
    "attack": 1_000_000,
    "chunk": 1000,
    "comparisons": 1_000_000,
    "epochs": 1_000_000,
    "patience": 10_000,
    "films": 100_000,
    "explore": 100,
    "first": 1_000_000_000,
    "fps": 100,  # control periods in a second
    "frames": 200,  # a strip of them is a picture of some 100 000 pixels' width
    "height": 4096,  # what OpenGL draws everywhere [pixels]
    "images": 100_000,
    "index": 1_000_000_000,
    "limit": 1_000_000_000,
    "limit_mb": 1_000_000,
    "limit_seconds": 86_400,  # a day
    "looks": 1000,
    "minutes": 100_000,
    "n": 1_000_000,
    "permutations": 1_000_000,
    "perturb_seed": 2**62,
    "played": 1000,
    "repeats": 1000,
    "rollouts": 1_000_000,
    "rounds": 10_000,
    "runs": 1000,
    "sample": 1_000_000_000,
    "seed": 2**63 - 1,  # a column of a pool holds it
    "seeds": 1_000_000,
    "size": 1024,  # a sheet has dozens of such pictures [pixels]
    "steps": 100,
    "width": 4096,
    "workers": 256,
}
"""Largest values of settings that count or measure something: far beyond practical use, and within what can be
computed."""


def check_count(n: int, limit: int | None, most: int | None, why: str, what: str) -> None:
    """Raise `BadConfig` if a run cannot make n results with any draws.

    Args:
        limit: largest number of tries; None if it is not set.
        most: number of different tries that there are; None without a limit.
        why: the reason why there are no more.
        what: the results, such as "scenarios".
    """
    if limit is not None and limit < n:
        raise BadConfig(
            f"limit = {limit}; {n} {what} need at least as many tries; give limit={n} or more, or a smaller n"
        )
    if most is not None and most < n:
        raise BadConfig(f"n = {n} {what}; {why}; give n={most} or less, or other settings")


def at_least(settings: object, **lowest: float) -> None:
    """Raise `BadConfig` for the first of the named settings that is below its lowest value or above `MAX_SETTINGS`.

    Values that are not numbers, such as None, are accepted.
    """
    for name, low in lowest.items():
        value = getattr(settings, name)
        if not isinstance(value, (int, float)):
            continue
        if not value >= low:
            raise BadConfig(f"{name} = {cut(str(value))}; it must be at least {low:g}")
        if value > MAX_SETTINGS[name]:
            raise BadConfig(f"{name} = {cut(str(value))}; it must be at most {MAX_SETTINGS[name]}")
