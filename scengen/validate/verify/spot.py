"""Statistics of a random sample of the rows of a pool."""

from math import ceil, comb, exp, lgamma

CONFIDENCE = 0.95
"""Probability with which a sample meets a false row."""


def excluded_share(total: int, sample: int) -> float:
    """The smallest share of false rows that a sample without a false row excludes at 95 %."""
    return (possible_false(total, sample) + 1) / total


def bound(total: int, sample: int, rows: str) -> str:
    """The largest share of false rows after a sample without one, as text.

    Args:
        rows: what the rows are, such as "scenarios".
    """
    share = ceil(1000 * possible_false(total, sample) / total) / 10
    return f"at most {share:g} % of the {rows} can be bad (95 % confidence)"


def possible_false(total: int, sample: int) -> int:
    """Largest number of false rows that a sample without a false row leaves possible at 95 %.

    If more of the rows were false, a sample of this size would contain one with a probability of at least 95 %
    (hypergeometric: rows are drawn without replacement). Of a million rows, a sample of 300 leaves 1 %.
    """
    low, high = 0, total - sample + 1  # with so many false rows every sample contains one
    while high - low > 1:
        middle = (low + high) // 2
        if _missed(total, sample, middle) <= 1 - CONFIDENCE:
            high = middle
        else:
            low = middle
    return low


def _missed(total: int, sample: int, false: int) -> float:
    """Probability that a sample contains none of the false rows."""
    if false > total - sample:
        return 0.0
    if total <= 1000:
        return comb(total - false, sample) / comb(total, sample)
    return exp(_log_comb(total - false, sample) - _log_comb(total, sample))


def _log_comb(n: int, k: int) -> float:
    return lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1)
