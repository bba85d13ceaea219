"""Random numbers by identity: the same question gets the same answer, whoever asks and whenever.

Every number is a hash of what it is for, so that adding a parameter, an axis or a worker moves no other
number, and scenario 731 can be made alone. A hash also does not change with the version of any library.
"""

import hashlib
import statistics

_NORMAL = statistics.NormalDist()


def unit(*key: str | int) -> float:
    """A number in (0, 1), uniform over keys: 53 bits of BLAKE2b of the key, centred in their cell.

    The centre of the last cell rounds to 1, which is no number below 1: there it is the largest one."""
    text = "\x1f".join(map(str, key))
    digest = hashlib.blake2b(text.encode(), digest_size=8).digest()
    return min(((int.from_bytes(digest, "big") >> 11) + 0.5) / 2**53, 1.0 - 2.0**-53)


def spread(size: float, *key: str | int) -> float:
    """A number uniform in (-size, size)."""
    return size * (2.0 * unit(*key) - 1.0)


def normal(*key: str | int) -> float:
    """A standard normal number."""
    return _NORMAL.inv_cdf(unit(*key))
