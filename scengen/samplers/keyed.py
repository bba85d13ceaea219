"""Random numbers by identity: the same key always gives the same number, for every caller and in every order.

Every number is a hash of its purpose. Adding a parameter, an axis or a worker therefore changes no other number, and
scenario 731 can be made alone. A hash also does not depend on the version of any library.
"""

import hashlib
import statistics

_NORMAL = statistics.NormalDist()


def unit(*key: str | int) -> float:
    """A number in (0, 1), uniform over keys: 53 bits of BLAKE2b of the key, see `_unit`."""
    return _unit(_digest(8, key))


def spread(size: float, *key: str | int) -> float:
    """A number uniform in (-size, size)."""
    return size * (2.0 * unit(*key) - 1.0)


def normals(count: int, *key: str | int) -> list[float]:
    """Independent standard normal numbers, at most 8, because one hash provides them all."""
    digest = _digest(8 * count, key)
    return [_NORMAL.inv_cdf(_unit(digest[start : start + 8])) for start in range(0, len(digest), 8)]


def _digest(size: int, key: tuple[str | int, ...]) -> bytes:
    """Hash of a key [size bytes]."""
    return hashlib.blake2b("\x1f".join(map(str, key)).encode(), digest_size=size).digest()


def _unit(digest: bytes) -> float:
    """The first 53 of 64 bits as a number in (0, 1), centred in its cell.

    The centre of the last cell rounds to 1, which is outside the interval. That cell gives the largest number below 1.
    """
    return min(((int.from_bytes(digest, "big") >> 11) + 0.5) / 2**53, 1.0 - 2.0**-53)
