"""Work that goes wrong, for the tests of those who hand out work; worker processes import it."""

import os
import signal
import time

import numpy as np

from scengen.errors import UnknownName


def work(item):
    """The item, or what it names: a process that hangs, works, crashes or takes all memory; an error."""
    if item == "hang":
        time.sleep(60)
    if item == "spin":
        while True:
            pass
    if item == "busy":  # for 0.3 s of processor time
        begun = time.process_time()
        while time.process_time() - begun < 0.3:
            pass
    if item == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    if item == "memory":
        np.ones(100_000_000)
    if item == "error":
        raise UnknownName("letter", "x", "ab")
    if item == "kill":  # the worker that has started this process
        os.kill(os.getppid(), signal.SIGKILL)
    return item


def lost(item, reason):
    """What is made of an item that is lost."""
    return f"{item} {reason}"
