"""Imported before any test: scengen chooses how to draw without a display, and it must come before mujoco for that."""

import ctypes
import gc
import sys

import pytest

import scengen  # noqa: F401


@pytest.fixture(scope="module", autouse=True)
def memory_is_given_back():
    """Meshes and pictures of a finished file return to the system; glibc would keep half a gigabyte of them."""
    yield
    gc.collect()
    if sys.platform == "linux":
        ctypes.CDLL(None).malloc_trim(0)
