"""The first compilation of the control loop takes seconds in which nothing else happens: people are told why."""

import sys
from functools import cache

from numba.core import event

TOLD = "scengen: compiling the control loop, once after an installation; it takes some seconds"


@cache
def announce() -> None:
    """Say on standard error, once, when the control loop is compiled from now on, and not read from numba's cache."""
    event.register("numba:compile", _Announcement())


class _Announcement(event.Listener):
    def __init__(self) -> None:
        self._told = False

    def on_start(self, event: event.Event) -> None:
        what = (event.data or {})["dispatcher"].py_func.__module__
        if not self._told and what.startswith(f"{__package__}."):
            self._told = True
            print(TOLD, file=sys.stderr, flush=True)

    def on_end(self, event: event.Event) -> None:
        pass
