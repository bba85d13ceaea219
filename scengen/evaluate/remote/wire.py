"""Messages of policy servers: msgpack with arrays, as openpi and GR00T write them. Nothing in a message is executed.

Messages are untrusted. Its size, the lengths in it, its nesting and the types of its arrays are bounded, and
pickled objects, which msgpack-numpy would load, are refused.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import ScengenError, cut

MAX_MESSAGE = 2**24
"""Largest message of a server [bytes]. A chunk of 100 actions of two arms has 11 kB."""
MAX_ENTRIES = 10_000
"""Largest number of entries of a list or a mapping in a message."""
MAX_AXES = 6
"""Largest number of axes of an array. GR00T's pictures have five."""
DTYPES = {
    name: dtype
    for kind in ("?", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f2", "f4", "f8")
    for dtype in (np.dtype(f">{kind}"), np.dtype(f"<{kind}"))
    for name in (dtype.str, dtype.name, kind)
}
"""Accepted types of arrays, by the names in messages; a name without an order of bytes is little-endian."""


class BadMessage(ScengenError):
    """A message is not what the protocol says."""


def openpi_array(value: Any) -> Any:
    """An array or a number of numpy as openpi writes it; the function is msgpack's `default`."""
    if isinstance(value, np.ndarray):
        kind, shape = value.dtype.str, list(value.shape)
        return {b"__ndarray__": True, b"data": value.tobytes(), b"dtype": kind, b"shape": shape}
    if isinstance(value, np.generic):
        return {b"__npgeneric__": True, b"data": value.item(), b"dtype": value.dtype.str}
    raise TypeError(f"{type(value).__name__} is not a value of a message")


def msgpack_numpy_array(value: Any) -> Any:
    """An array or a number of numpy as msgpack-numpy writes it, which GR00T uses since N1.7."""
    if isinstance(value, np.ndarray):
        kind, shape = value.dtype.str, list(value.shape)
        return {b"nd": True, b"type": kind, b"kind": b"", b"shape": shape, b"data": value.tobytes()}
    if isinstance(value, np.generic):
        return {b"nd": False, b"type": value.dtype.str, b"data": value.tobytes()}
    raise TypeError(f"{type(value).__name__} is not a value of a message")


def unpacked(message: bytes) -> Any:
    """The content of a message of either protocol.

    Raises:
        BadMessage: it is too large, damaged, or holds an array of another type.
    """
    import msgpack  # here, because only evaluations of remote policies need it

    if len(message) > MAX_MESSAGE:
        raise BadMessage(f"a message has {len(message)} bytes; at most {MAX_MESSAGE} are accepted")
    try:
        return msgpack.unpackb(
            message,
            object_hook=_revived,
            raw=False,
            max_array_len=MAX_ENTRIES,
            max_map_len=MAX_ENTRIES,
            max_ext_len=0,
        )
    except BadMessage:
        raise
    except (ValueError, TypeError, msgpack.UnpackException, RecursionError) as error:
        raise BadMessage(f"a message is not msgpack ({type(error).__name__}: {cut(str(error))})") from None


def _revived(node: dict[Any, Any]) -> Any:
    """A mapping of a message, or the array that it stands for."""
    told = {key.decode("latin-1") if isinstance(key, bytes) else key: value for key, value in node.items()}
    if "__ndarray__" in told:
        return _array(told.get("dtype"), told.get("shape"), told.get("data"))
    if "__npgeneric__" in told:
        return told.get("data")
    if "nd" in told and "type" in told:
        scalar = not told["nd"]
        found = _array(told["type"], () if scalar else told.get("shape"), told.get("data"))
        return found.item() if scalar else found
    if "__ModalityConfig__" in told:
        return told.get("as_json")
    return told


def _array(kind: Any, shape: Any, data: Any) -> NDArray[Any]:
    """An array from its description; a copy, so that it can be written to.

    Raises:
        BadMessage: the description is not one of an array of numbers, or the bytes are not as many.
    """
    dtype = DTYPES.get(kind.removeprefix("=")) if isinstance(kind, str) else None
    if dtype is None:
        raise BadMessage(
            f"an array in a message has the type {cut(repr(kind))}; numbers of at most 8 bytes are accepted"
        )
    if not isinstance(shape, (list, tuple)) or len(shape) > MAX_AXES or any(type(n) is not int or n < 0 for n in shape):
        raise BadMessage(f"an array in a message has the shape {cut(repr(shape))}")
    if not isinstance(data, bytes) or len(data) != math.prod(shape) * dtype.itemsize:
        raise BadMessage(f"an array in a message has a different number of bytes than {kind} of shape {tuple(shape)}")
    return np.frombuffer(data, dtype).reshape(shape).copy()


def mapping(value: Any, what: str) -> Mapping[str, Any]:
    """A value that must be a mapping with words as keys.

    Raises:
        BadMessage: it is none.
    """
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise BadMessage(f"{what} is {cut(repr(value))}, not a mapping")
    return value
