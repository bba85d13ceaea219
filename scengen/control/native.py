"""libmujoco called from compiled code: the only module that handles raw addresses.

numba resolves `mj_step1` and similar functions as plain external symbols, so that a whole control period runs without
the interpreter and its lock, and the result is cached on disk like any other compiled function. The price is that
addresses must stay valid: keep model and data alive, and take new addresses for every new MjData. The arrays of mjData
have fixed addresses, except those in its arena (contacts, constraints), which move.
"""

import ctypes
import functools
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import mujoco
import numpy as np
from numba import carray, njit, types  # pyright: ignore[reportPrivateImportUsage]
from numba.core.types import ExternalFunction
from numba.extending import intrinsic
from numpy.typing import NDArray

LIBRARIES = {"linux": "libmujoco.so*", "darwin": "libmujoco*.dylib", "win32": "mujoco.dll"}
"""Names of MuJoCo's library in its wheels, by platform. Only that of Linux was tried."""


def _library() -> Path:
    """Path of the shared library that the bindings have already loaded."""
    name = LIBRARIES.get(sys.platform, LIBRARIES["linux"])
    found = sorted(Path(mujoco.__file__).parent.glob(name))
    if not found:
        raise RuntimeError(f"mujoco has no {name} beside it; install its wheel: pip install 'mujoco>=3.5,<5'")
    return found[0]


llvm.load_library_permanently(str(_library()))

ALIGNMENT = 64
"""Alignment of MuJoCo's allocations [bytes]: mju_malloc."""
_MODEL_AND_DATA = types.void(types.intp, types.intp)
"""Signature of two pointers passed as integers: the same registers in the C ABI of x86-64 and aarch64."""
step = ExternalFunction("mj_step", _MODEL_AND_DATA)
step1 = ExternalFunction("mj_step1", _MODEL_AND_DATA)
step2 = ExternalFunction("mj_step2", _MODEL_AND_DATA)
kinematics = ExternalFunction("mj_kinematics", _MODEL_AND_DATA)


def _pointer_to(kind: types.Type) -> Callable:
    """Intrinsic that turns an integer address into a pointer to `kind`."""

    @intrinsic
    def cast(typingctx, address):
        pointer = types.CPointer(kind)

        def codegen(context, builder, signature, args):
            return builder.inttoptr(args[0], context.get_value_type(pointer))

        return pointer(types.intp), codegen

    return cast


_float64_pointer = _pointer_to(types.float64)
_int32_pointer = _pointer_to(types.int32)
_int64_pointer = _pointer_to(types.int64)


@njit
def float64s(address, shape):
    """View of the C-ordered float64 array of `shape` at `address`."""
    return carray(_float64_pointer(address), shape)


@njit
def int32s(address, shape):
    """View of the C-ordered int32 array of `shape` at `address`."""
    return carray(_int32_pointer(address), shape)


@njit
def int64s(address, shape):
    """View of the C-ordered int64 array of `shape` at `address`."""
    return carray(_int64_pointer(address), shape)


class Layout(NamedTuple):
    """Location of the contacts in memory, for compiled code [bytes]."""

    ncon: int
    """Offset in mjData of the number of contacts (int32)."""
    contact: int
    """Offset in mjData of the pointer to the first mjContact."""
    stride: int
    """Size of one mjContact."""
    dist: int
    """Offset in mjContact of the distance (float64, negative in penetration)."""
    geom: int
    """Offset in mjContact of the two geom ids (int32, shape (2,))."""


@functools.cache
def layout() -> Layout:
    """The memory layout of this version of MuJoCo, found by experiment once per process.

    Two scenes with different numbers of contacts must agree. The number of contacts is the word that the bindings
    follow when it is changed for a moment; the pointer is the word that libmujoco follows.
    """
    first, second = _locate(*_sunken_balls(2)), _locate(*_sunken_balls(3))
    if first != second:
        raise RuntimeError(_unknown(f"two scenes disagree: {first} and {second}"))
    return first


def warning_counts(data: mujoco.MjData) -> tuple[int, int, int]:
    """Address, stride [bytes] and number of the warning counters (int32), which are part of mjData itself."""
    numbers = data.warning.number
    return numbers.ctypes.data, numbers.strides[0], len(numbers)


@njit
def warnings(address, stride, kinds):
    """Total number of warnings since the last reset, from the values of `warning_counts`."""
    total = 0
    for kind in range(kinds):
        total += int32s(address + kind * stride, 1)[0]
    return total


def silence() -> None:
    """Stop MuJoCo, process-wide, from printing warnings and writing MUJOCO_LOG.TXT. The warnings stay counted."""
    # The handler takes a C string and its result is ignored: mju_str2Type fits and has no side effect.
    library = ctypes.CDLL(str(_library()))
    handler = ctypes.cast(library.mju_str2Type, ctypes.c_void_p)
    ctypes.c_void_p.in_dll(library, "mju_user_warning").value = handler.value


def _unknown(detail: str) -> str:
    """Message of the error for an unknown memory layout."""
    tried = "install a version that was tried, 3.5.0 or 4.0.0"
    return f"no contacts found in mjData of mujoco {mujoco.__version__} ({detail}); {tried}"


def _sunken_balls(n: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A small world with n contacts of different depths: n balls pressed into a plane."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1])
    for i in range(n):
        ball = spec.worldbody.add_body(pos=[i, 0, 0.09 - 0.01 * i])
        ball.add_freejoint()
        ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _locate(model: mujoco.MjModel, data: mujoco.MjData) -> Layout:
    """The layout seen in one MjData that has at least two contacts of different force."""
    dist, geom = data.contact.dist, data.contact.geom
    stride = dist.strides[0]
    # Which field a contact starts with is unknown. Its `dist` lies less than one stride after the start.
    near = dist.ctypes.data
    force = np.zeros(6)

    def first_force() -> float:
        mujoco.mj_contactForce(model, data, 0, force)
        return force[0]

    first = first_force()
    mujoco.mj_contactForce(model, data, 1, force)
    second = force[0]
    if data.ncon < 2 or first == second or geom.strides[0] != stride:
        raise RuntimeError(_unknown(f"the probe shows {data.ncon} contacts of {first} and {second} N"))

    counts, pointers = _words(data, np.dtype(np.int32)), _words(data, np.dtype(np.uintp))
    ncon = _followed(counts, counts == data.ncon, -1, lambda: data.ncon == len(dist) - 1)
    at_contacts = (pointers <= near) & (pointers > near - stride)
    contact = _followed(pointers, at_contacts, stride, lambda: first_force() == second)
    start = near - int(pointers[contact // pointers.itemsize])
    return Layout(ncon, contact, stride, start, start + geom.ctypes.data - near)


def _words(data: mujoco.MjData, kind: np.dtype) -> NDArray:
    """View of the struct mjData itself as an array of words, as long as its allocation."""
    size = _allocated(data._address) // kind.itemsize * kind.itemsize
    struct: Any = (ctypes.c_char * size).from_address(data._address)
    return np.frombuffer(struct, kind)


def _allocated(address: int) -> int:
    """Size of an allocation of MuJoCo [bytes]. Only that of Linux was tried."""
    if sys.platform == "win32":
        size, more = ctypes.CDLL("ucrtbase")._aligned_msize, (ctypes.c_size_t(ALIGNMENT), ctypes.c_size_t(0))
    else:
        libc = ctypes.CDLL(None)
        size, more = libc.malloc_size if sys.platform == "darwin" else libc.malloc_usable_size, ()
    size.restype = ctypes.c_size_t
    return size(ctypes.c_void_p(address), *more)


def _followed(words: NDArray, plausible: NDArray, change: int, seen: Callable[[], bool]) -> int:
    """Offset [bytes] of the one plausible word for which `seen` holds while `change` is added to it."""
    found = []
    for index in np.flatnonzero(plausible):
        before = words[index]
        words[index] = int(before) + change
        try:
            if seen():
                found.append(int(index) * words.itemsize)
        finally:
            words[index] = before
    if len(found) != 1:
        raise RuntimeError(_unknown(f"{len(found)} words of the struct behave like it"))
    return found[0]
