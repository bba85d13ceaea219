"""Imported before any test: scengen chooses how to draw without a display, and it must come before mujoco for that."""

import ctypes
import gc
import sys

import pytest
from hypothesis import settings

import scengen  # noqa: F401

settings.register_profile(
    "scengen", deadline=None
)  # a busy machine takes longer for an example than Hypothesis' 200 ms
settings.load_profile("scengen")


@pytest.fixture(scope="module", autouse=True)
def memory_is_given_back():
    """Meshes and pictures of a finished file return to the system; glibc would keep half a gigabyte of them."""
    yield
    gc.collect()
    if sys.platform == "linux":
        ctypes.CDLL(None).malloc_trim(0)
