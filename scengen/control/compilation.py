"""Notice about the first compilation of the control loop, which takes some seconds without any other output."""

import sys
from contextlib import suppress
from functools import cache

from numba.core import event

NOTICE = "scengen: compiling the control loop, once after an installation; it takes some seconds"
"""Text of the notice."""


@cache
def announce() -> None:
    """From now on, print a notice to standard error, once, when the control loop is compiled.

    Nothing is printed if the loop is read from numba's cache.
    """
    event.register("numba:compile", _Announcement())


class _Announcement(event.Listener):
    """Listener that prints the notice at the first compilation."""

    def __init__(self) -> None:
        self._printed = False

    def on_start(self, event: event.Event) -> None:
        what = (event.data or {})["dispatcher"].py_func.__module__
        if not self._printed and what.startswith(f"{__package__}."):
            self._printed = True
            with suppress(OSError, ValueError):  # the notice is not worth an error where standard error is closed
                print(NOTICE, file=sys.stderr, flush=True)

    def on_end(self, event: event.Event) -> None:
        pass
