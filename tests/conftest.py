"""Imported before any test: scengen chooses how to draw without a display, and it must come before mujoco for that."""

import ctypes
import gc
import os
import sys
from pathlib import Path

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


# --- how long tests take ---------------------------------------------------------------------

DURATIONS = Path(__file__).parent / "durations.txt"
"""Processor times [s] and ids of the tests that take at least `SLOW`, a line each. Written by `make durations`."""
SLOW = 1.0
"""Processor time from which a test is run by `make slow` alone [s]. The mark `each_change` keeps a longer test among
those of continuous integration."""
STARTED = pytest.StashKey[float]()


def pytest_addoption(parser):
    parser.addoption(
        "--durations-file", action="store_true", help=f"measure processor time and update {DURATIONS.name}"
    )


def known_durations():
    return {id_: float(seconds) for seconds, id_ in (line.split(" ", 1) for line in DURATIONS.read_text().splitlines())}


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    known = known_durations()
    for item in items:
        if "chromium" in item.fixturenames:  # two browsers at once draw too slowly in software
            item.add_marker("each_change")
            item.add_marker(pytest.mark.xdist_group("browser"))
        elif known.get(item.nodeid, 0.0) >= SLOW and not item.get_closest_marker("each_change"):
            item.add_marker("slow")


def processor_time():
    """Processor time of this process and of its children that have ended [s]."""
    return sum(os.times()[:4])


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    item.stash[STARTED] = processor_time()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    report = yield
    if call.when == "teardown":
        report.user_properties.append(("processor_time", processor_time() - item.stash[STARTED]))
    return report


def pytest_terminal_summary(terminalreporter, config):
    """Write what was measured. Tests that did not run keep their times."""
    if config.getoption("--durations-file"):
        reports = (r for of in terminalreporter.stats.values() for r in of if getattr(r, "when", "") == "teardown")
        measured = {r.nodeid: dict(r.user_properties)["processor_time"] for r in reports}
        kept = {id_: seconds for id_, seconds in (known_durations() | measured).items() if seconds >= SLOW}
        DURATIONS.write_text("".join(f"{seconds:.1f} {id_}\n" for id_, seconds in sorted(kept.items())))
