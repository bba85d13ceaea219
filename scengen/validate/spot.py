"""What a random sample says about all rows of a pool."""

from math import comb, exp, lgamma

CONFIDENCE = 0.95


def excluded_share(total: int, sample: int) -> float:
    """The least share of false rows that a sample without a false one excludes at 95 %.

    Were at least this share of the rows false, a sample of this size would have met one with at least 95 % probability
    (hypergeometric: rows are drawn without putting any back). 300 of a million rows exclude 1 %.
    """
    low, high = 0, total - sample + 1  # with that many false ones every sample meets one
    while high - low > 1:
        middle = (low + high) // 2
        if _missed(total, sample, middle) <= 1 - CONFIDENCE:
            high = middle
        else:
            low = middle
    return high / total


def _missed(total: int, sample: int, false: int) -> float:
    """Probability that a sample meets none of the false ones."""
    if false > total - sample:
        return 0.0
    if total <= 1000:
        return comb(total - false, sample) / comb(total, sample)
    return exp(_log_comb(total - false, sample) - _log_comb(total, sample))


def _log_comb(n: int, k: int) -> float:
    return lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1)
